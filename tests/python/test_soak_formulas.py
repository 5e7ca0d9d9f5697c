"""The formulas that the soak trusts, against counting and against what is plain; no daemon."""

from random import Random

import pytest
from needed import needed

np = needed("numpy")
needed("sweepd")

from soak.paths import Path, triangle  # noqa: E402
from soak.scene import Body, Rule, Scene  # noqa: E402
from soak.shapes import Forms, Part, Plane, gap_of, turned  # noqa: E402
from soak.ways import Crossings, Way  # noqa: E402

UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


def test_gaps_of_spheres_boxes_and_planes_are_those_that_one_can_see():
    shapes = [
        ((Part(radius_m=0.5),), None),
        ((Part((1.0, 2.0, 3.0)),), None),
        ((), Plane((0.0, 0.6, 0.8), 1.0)),
        ((Part(radius_m=0.25), Part((0.25, 0.25, 0.25), offset_m=(0.0, 4.0, 0.0))), None),
    ]
    forms = Forms(shapes)
    positions = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    gaps = forms.gaps(forms.centres(positions, np.tile(UPRIGHT, (4, 1))))
    assert gaps[0, 1] == gaps[1, 0] == 1.5
    assert gaps[0, 2] == gaps[2, 0] == -1.5
    assert gaps[0, 3] == 0.25
    assert gaps[1, 2] == pytest.approx(-1.0 - 0.6 * 2.0 - 0.8 * 3.0)
    # the ball of the last one is nearer than its box
    assert gaps[1, 3] == 1.75
    assert np.isinf(np.diag(gaps)).all()


def test_a_gap_is_the_least_translation_that_parts_two_that_overlap():
    random = Random(5)
    for _ in range(200):
        half = np.array([random.choice([0.0, random.uniform(0.1, 1.0)])] * 3) * [1.0, 0.5, 2.0]
        radius = random.choice([0.0, 0.3]) if half.any() else 0.3
        apart = np.array([random.uniform(-1.5, 1.5) for _ in range(3)])
        gap = float(gap_of(apart, half, np.array(radius)))
        if gap >= 0.0:
            continue
        directions = np.random.default_rng(random.randrange(1 << 30)).normal(size=(4000, 3))
        directions = np.concatenate([directions, np.eye(3), -np.eye(3)])
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        assert (gap_of(apart - gap * 0.999 * directions, half, np.array(radius)) < 0.0).all(), (
            "less parts them in no way"
        )
        assert gap_of(apart - gap * 1.05 * directions, half, np.array(radius)).max() > 0.0, "and more in some"


def test_an_offset_turns_with_its_body():
    half = np.sqrt(0.5)
    quarter = np.array([[0.0, 0.0, half, half]])
    np.testing.assert_allclose(turned(2.0 * quarter, np.array([[1.0, 0.0, 3.0]])), [[0.0, 1.0, 3.0]], atol=1e-15)


def test_paths_come_to_exact_places():
    assert [triangle(step, 2) for step in range(9)] == [-2, -1, 0, 1, 2, 1, 0, -1, -2]
    path = Path(centre=(1.0, 0.0, 0.0), ramp=(0.25, 0.0, 0.0), period=4, shuttle=(0.0, 2.0, 0.0))
    assert path.at(9)[0] == (1.0 + 0.25 * 3, 2.0, 0.0)
    assert Path.read(path.keys()) == path


def ways_by_counting(forms, way_a, way_b, until):
    """The least gap at very many shares of the way."""
    least = np.inf
    for share in np.linspace(0.0, until, 20001):
        centres = np.concatenate([way_a.at(share), way_b.at(share)])
        least = min(least, forms.gaps(centres)[0, 1])
    return least


@pytest.mark.parametrize("seed", range(6))
def test_the_least_gap_on_the_way_is_that_of_counting(seed):
    random = Random(seed)
    kinds = [Part(radius_m=0.3), Part((0.2, 0.4, 0.1)), Part((0.01, 1.0, 1.0))]
    shapes = [((random.choice(kinds),), None), ((random.choice(kinds),), None)]
    if seed == 5:
        shapes[1] = ((), Plane((0.6, 0.0, 0.8), -0.3))
    forms = Forms(shapes)
    legs = random.choice([(1, 1), (2, 3), (1, 0), (3, 1)])
    rng = np.random.default_rng(seed)
    points = lambda count: rng.uniform(-2.0, 2.0, (count + 1, 1, 3))  # noqa: E731
    way_a = Way(points(legs[0]))
    way_b = Way(points(legs[1]) if seed != 5 else np.empty((1, 0, 3)))
    crossings = Crossings(forms)
    crossings.add(0, 1, way_a, way_b)
    crossings.solve()
    for until in (1.0, 0.31):
        least = float(crossings.least(np.array([until]))[0])
        counted = ways_by_counting(forms, way_a, way_b, until)
        assert counted - 1e-3 < least <= counted + 1e-12, (legs, until)


def test_a_jump_is_left_out_of_the_way():
    forms = Forms([((Part(radius_m=0.1),), None), ((Part(radius_m=0.1),), None)])
    through = np.array([[[-1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]], [[1.0, 0.5, 0.0]]])
    still = Way(np.zeros((1, 1, 3)))
    for jumps, wanted in (([False, False], -0.2), ([True, False], 0.8)):
        crossings = Crossings(forms)
        crossings.add(0, 1, Way(through, jumps), still)
        crossings.solve()
        assert float(crossings.least(asked=True)[0]) == pytest.approx(wanted)


def test_the_last_rule_that_speaks_of_a_pair_wins_over_masks():
    bodies = [Body(name, source="sim", parts=(Part(radius_m=1.0),)) for name in ("a_1", "a_2", "b")]
    scene = Scene({body.name: body for body in bodies}).changed("b", mask=2)
    assert scene.pairs.allowed.tolist() == [[False, True, False], [True, False, False], [False] * 3]
    scene = scene.with_rule(Rule("check", "b", "a_*", 0.5))
    assert scene.pairs.allowed.sum() == 6 and scene.pairs.report_m[2, 0] == 0.5
    scene = scene.with_rule(Rule("ignore", "a_?", "b"))
    assert scene.pairs.allowed.sum() == 2 and scene.pairs.ignored == 2
    assert scene.without_rules("b", "a_?").pairs.ignored == 0
