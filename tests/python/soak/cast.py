"""Who takes part: bodies of all kinds on paths that make them meet, by a seed."""

from __future__ import annotations

from dataclasses import replace
from random import Random
from typing import Optional

from .paths import Path
from .scene import Body, Rule, Scene, Source
from .shapes import ORIGIN, Part, Plane, Vector

#: Leads in lockstep; driven from here, as ARM is. CHILD is a process of its own.
SIM, ARM, CHILD = "sim", "arm", "child"
#: A wall is thinner than any step of what is shot through it, metres.
_THIN_M = 0.0005


def sources(random: Random) -> tuple[Source, ...]:
    """The sources, with what becomes of their bodies when they are silent."""
    fates = ["unknown", "hold", "remove"]
    random.shuffle(fates)
    return (Source(SIM, 500, fates[0]), Source(ARM, 300, fates[1]), Source(CHILD, 250, fates[2]))


def cast(random: Random) -> Scene:
    """A scene; some are far from the origin, where coordinates are coarse."""
    far_m = random.choice([0.0, 0.0, 1024.0])
    bodies = [*_fixed(), *_of_sim(random), *_of_arm(random), *_of_child(random)]
    # ids go by the order of the file
    random.shuffle(bodies)
    bodies = [_moved(body, (far_m, -far_m, 0.0)) for body in bodies]
    rules = (Rule("ignore", "sim_orbit_*", "arm_box"), Rule("check", "sim_orbit_0", "arm_box", 0.25))
    return Scene({body.name: body for body in bodies}, rules)


def extra(random: Random, name: str, source: str, scene: Scene) -> Body:
    """A body to be put while the daemon runs, where the others are."""
    far = next(body.path.centre for body in scene.bodies.values() if body.name == "post")
    body = _orbiting(random, name, source, _ball(random) if random.random() < 0.6 else _brick(random))
    if random.random() < 0.3 and not body.parts[0].is_box:
        body = replace(body, continuous=True)
    return _moved(body, (far[0], far[1], 0.0))


def _fixed() -> list[Body]:
    slant = Plane((0.6, 0.0, 0.8), -3.5)
    at = lambda x, y, z: Path(centre=(x, y, z))  # noqa: E731
    return [
        Body("floor", plane=Plane((0.0, 0.0, 1.0), -2.0)),
        Body("slant", plane=slant),
        Body("wall_x", parts=(Part((_THIN_M, 2.5, 2.5)),), path=at(0.0, 0.0, 0.0)),
        Body("wall_y", parts=(Part((2.5, _THIN_M, 2.5)),), path=at(0.0, 1.25, 0.0)),
        Body("block", parts=(Part((0.5, 0.25, 0.5)),), path=at(2.0, 2.0, 0.0), dyadic=True),
        # its place says where the scene is
        Body("post", parts=(Part(radius_m=0.4),), path=at(0.0, 0.0, 0.0), report_within_m=0.1),
    ]


def _of_sim(random: Random) -> list[Body]:
    orbits = [_orbiting(random, f"sim_orbit_{at}", SIM, _ball(random)) for at in range(4)]
    boxes = [_orbiting(random, f"sim_box_{at}", SIM, _brick(random)) for at in range(2)]
    turner = replace(_ball(random), offset_m=(0.3, 0.2, 0.1))
    ramp = Path(centre=(2.0, 1.0, 0.0), ramp=(0.0, 1.0 / 64.0, 0.0), period=48)
    both = (Part(radius_m=0.3, offset_m=(0.4, 0.0, 0.0)), Part((0.2, 0.3, 0.2), offset_m=(-0.3, 0.0, 0.0)))
    return [
        *orbits,
        *boxes,
        replace(_orbiting(random, "sim_turning", SIM, turner, spin=0.21), report_within_m=0.2),
        replace(_orbiting(random, "sim_turning_fast", SIM, turner, spin=0.7), continuous=True),
        Body("sim_ramp", SIM, (Part((0.25, 0.25, 0.25)),), path=ramp, dyadic=True),
        replace(_orbiting(random, "sim_both", SIM, both[0]), parts=both),
        _shot(random, "sim_shot_ball", SIM, Part(radius_m=0.05)),
        _shot(random, "sim_shot_box", SIM, Part((0.04, 0.06, 0.05))),
        replace(_shot(random, "sim_jumper", SIM, Part(radius_m=0.1)), teleport_m=random.choice([1.0, 10.0])),
        _trembling(random),
    ]


def _of_arm(random: Random) -> list[Body]:
    balls = [_orbiting(random, f"arm_orbit_{at}", ARM, _ball(random)) for at in range(3)]
    box = replace(_orbiting(random, "arm_box", ARM, _brick(random)), on_stale=random.choice([None, "hold", "remove"]))
    slow = [replace(ball, max_speed_mps=speed_mps) for ball, speed_mps in zip(balls, (0.5, 3.0, None))]
    return [*slow, box, _shot(random, "arm_shot", ARM, Part(radius_m=0.08))]


def _of_child(random: Random) -> list[Body]:
    fates: list[Optional[str]] = [None, "unknown", "hold", "remove"]
    balls = [_orbiting(random, f"child_orbit_{at}", CHILD, _ball(random)) for at in range(4)]
    balls = [replace(ball, on_stale=fate) for ball, fate in zip(balls, fates)]
    balls[1] = replace(balls[1], max_speed_mps=1.0)
    return [
        *balls,
        _orbiting(random, "child_box", CHILD, _brick(random)),
        _shot(random, "child_shot", CHILD, Part(radius_m=0.1)),
    ]


def _ball(random: Random) -> Part:
    return Part(radius_m=random.uniform(0.15, 0.5))


def _brick(random: Random) -> Part:
    return Part((random.uniform(0.1, 0.5), random.uniform(0.1, 0.5), random.uniform(0.1, 0.5)))


def _vector(random: Random, most: float) -> Vector:
    return (random.uniform(-most, most), random.uniform(-most, most), random.uniform(-most, most))


def _orbiting(random: Random, name: str, source: str, part: Part, spin: float = 0.0) -> Body:
    path = Path(
        centre=_vector(random, 1.8),
        swing=_vector(random, 1.2),
        sway=_vector(random, 1.2),
        rate=random.choice([0.005, 0.02, 0.05, 0.2]),
        phase=random.uniform(0.0, 6.28),
        spin=spin,
    )
    report_m = random.choice([0.0, 0.0, 0.15])
    return Body(name, source, (part,), path=path, report_within_m=report_m)


def _shot(random: Random, name: str, source: str, part: Part) -> Body:
    """There and back through the walls, and through whoever is shot as well, in a step each."""
    aim = _vector(random, 1.0)
    path = Path(
        centre=_vector(random, 0.4),
        sway=_vector(random, 0.6),
        rate=0.03,
        shuttle=(random.choice([1.5, 2.2, 12.0]), aim[1], 0.3 * aim[2]),
    )
    return Body(name, source, (part,), path=path, continuous=True)


def _trembling(random: Random) -> Body:
    """About a touch with the post, by less and less than what sensors tell."""
    radius_m = 0.3
    size_m = random.choice([1e-3, 1e-6, 1e-9, 1e-12])
    path = Path(centre=(0.4 + radius_m, 0.0, 0.0), swing=(size_m, 0.0, 0.0), rate=1.0)
    return Body("sim_trembling", SIM, (Part(radius_m=radius_m),), path=path)


def _moved(body: Body, by: Vector) -> Body:
    if by == ORIGIN:
        return body
    if body.plane is not None:
        along = sum(n * d for n, d in zip(body.plane.normal, by))
        return replace(body, plane=replace(body.plane, offset_m=body.plane.offset_m + along))
    x, y, z = (c + d for c, d in zip(body.path.centre, by))
    return replace(body, path=replace(body.path, centre=(x, y, z)))
