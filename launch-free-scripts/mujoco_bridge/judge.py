"""Second and third opinions: MuJoCo's own contacts at margin 0, and a pair's gap by support functions.

In: the simulated state. Out: the set of colliding pairs, or one gap. The simulation itself is not touched: MuJoCo is
asked on a copy of the model without margins, gaps, sleep and speculation.
"""

import copy

import mujoco
import numpy as np

from . import shapes
from .model import Refused

CCD_ITERATIONS = 200
"""Enough for a tolerance of 1e-10; MuJoCo's default is 35."""
BAND_M = 1e-6
"""A pair whose gap is nearer to 0 than this is decided by rounding: MuJoCo's own tolerance (ccd_tolerance) is 1e-6."""


class Judge:
    """MuJoCo's contacts at margin 0.

    * `ccd_tolerance` - of MuJoCo's convex collisions, metres; None: the model's own (1e-6 unless it says otherwise).
    """

    def __init__(self, model, scene, ccd_tolerance=None):
        self.model = copy.copy(model)
        if ccd_tolerance is not None:
            self.model.opt.ccd_tolerance = ccd_tolerance
            self.model.opt.ccd_iterations = max(CCD_ITERATIONS, self.model.opt.ccd_iterations)
        for name in ("geom_margin", "geom_gap", "geom_adhesion", "pair_margin", "pair_gap", "pair_adhesion", "body_margin"):
            if hasattr(self.model, name):
                getattr(self.model, name)[:] = 0
        off, on = mujoco.mjtDisableBit, mujoco.mjtEnableBit
        self.model.opt.disableflags &= ~int(off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT)
        for name in ("mjENBL_SLEEP", "mjENBL_OVERRIDE", "mjENBL_SPECULATIVE"):
            self.model.opt.enableflags &= ~int(getattr(on, name, 0))
        self.data = mujoco.MjData(self.model)
        self.scene = scene
        self.place = {int(geom): k for k, geom in enumerate(scene.geoms)}

    def look(self, data):
        """Takes over the state of a simulation; its poses are then at that state, not at the start of its last step."""
        self.data.qpos[:] = data.qpos
        self.data.mocap_pos[:] = data.mocap_pos
        self.data.mocap_quat[:] = data.mocap_quat
        mujoco.mj_kinematics(self.model, self.data)

    def contacts(self):
        """Colliding pairs as places in the scene, smaller first, with MuJoCo's least `dist`, metres.

        Raises Refused when MuJoCo had no room for all contacts.
        """
        mujoco.mj_collision(self.model, self.data)
        warning = self.data.warning[mujoco.mjtWarning.mjWARN_CONTACTFULL]
        if warning.number:
            raise Refused('MuJoCo had no room for its contacts: raise <size memory="..."/> in the model')
        found = {}
        for (first, second), dist in zip(self.data.contact.geom, self.data.contact.dist):
            if first < 0 or second < 0 or dist > 0:
                continue
            key = tuple(sorted((self.place[int(first)], self.place[int(second)])))
            # Pairs of two bodies that cannot move are not sweepd's.
            if self.scene.allowed[key]:
                found[key] = min(float(dist), found.get(key, np.inf))
        return found

    def gap(self, first, second):
        """The gap of two bodies by the third judge, metres, at the poses of `look`."""
        sides = []
        for k in (first, second):
            geom = self.scene.geoms[k]
            rotation = self.data.geom_xmat[geom].reshape(3, 3)
            sides.append((self.scene.shapes[k], rotation, self.data.geom_xpos[geom].copy()))
        return signed_gap(*sides)


def signed_gap(side_a, side_b):
    """Distance, or minus the least translation that separates, of two posed shapes; of a height field the least over
    its prisms.

    * `side_a`, `side_b` - shape, rotation matrix, position.
    """
    if side_a[0]["type"] == "height_field":
        side_a, side_b = side_b, side_a
    if side_b[0]["type"] != "height_field":
        return convex_gap(side_a, side_b)
    shape, rotation, position = side_b
    # The box of the other in the field's frame, a little wider, tells the cells that matter.
    axes = np.vstack([np.eye(3), -np.eye(3)]) @ rotation.T
    ends = shapes.support(side_a[0], axes @ side_a[1]) + (axes @ (side_a[2] - position))
    pieces = shapes.prisms(shape, -ends[3:] - 1e-3, ends[:3] + 1e-3)
    pieces = [(piece, rotation, position) for piece in pieces]
    # Any direction gives a lower bound, so pieces that are surely farther away need no search.
    bounds = [separation_of(side_a, piece)(DIRECTIONS).max() for piece in pieces]
    least = np.inf
    for k in np.argsort(bounds):
        if bounds[k] < least:
            least = min(least, convex_gap(side_a, pieces[k]))
    return least


def separation_of(side_a, side_b):
    """The function that tells how far two convex shapes are apart along directions `[n, 3]` from A to B.

    Along any unit direction this is a lower bound of the gap; the greatest over all directions is the gap.
    """
    (shape_a, rot_a, pos_a), (shape_b, rot_b, pos_b) = side_a, side_b

    def separation(directions):
        # Where B begins minus where A ends.
        ends_a = shapes.support(shape_a, directions @ rot_a)
        ends_b = shapes.support(shape_b, -directions @ rot_b)
        return directions @ (pos_b - pos_a) - ends_a - ends_b

    return separation


def convex_gap(side_a, side_b):
    """The greatest separation over all directions: even directions first, then a search around the best three."""
    if side_a[0]["type"] == "half_space":
        side_a, side_b = side_b, side_a
    if side_b[0]["type"] == "half_space":
        # Only one direction has an end.
        normal = -np.asarray(side_b[0]["normal"]) @ side_b[1].T
        beyond = shapes.support(side_a[0], normal[None] @ side_a[1])[0]
        return float(normal @ (side_b[2] - side_a[2]) - beyond - side_b[0]["offset"])
    separation = separation_of(side_a, side_b)
    values = separation(DIRECTIONS)
    best, tried = -np.inf, []
    for start in np.argsort(values)[::-1]:
        direction = DIRECTIONS[start]
        # The neighbours of a start lead to the same place.
        if all(direction @ other < np.cos(2 * HALF_WIDTH) for other in tried):
            tried.append(direction)
            best = max(best, climb(separation, direction))
        if len(tried) == 3:
            break
    return float(best)


def climb(separation, direction):
    """The greatest separation near a direction.

    In a plane of directions `direction + x e + y f` separation is concave up to the length of the direction, kinks
    and all. So the best over y is unimodal in x, and two nested searches of one dimension find it, where a search
    that follows a gradient would stop on a ridge.
    """
    best, half = -np.inf, HALF_WIDTH
    for _ in range(12):
        across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        across /= np.linalg.norm(across)
        other = np.cross(direction, across)
        frame = np.vstack([direction, across, other])
        value, x, y = nested(separation, frame, half)
        direction = np.array([1, x, y]) @ frame
        direction /= np.linalg.norm(direction)
        improved = value > best + 1e-13
        best = max(best, value)
        # At the edge: go on from there. Inside: once more in a narrow plane, where length plays no part.
        if max(abs(x), abs(y)) < 0.99 * half:
            if not improved or half < 1e-2 * HALF_WIDTH:
                break
            half *= 0.05
    return best


def nested(separation, frame, half):
    """Greatest value over the square `[-half, half]^2`, and where: x outside, y inside, each by shrinking intervals."""

    def over_y(xs):
        low, high = np.full(len(xs), -half), np.full(len(xs), half)
        for _ in range(SHRINKS):
            ys = low[:, None] + (high - low)[:, None] * GRID
            vectors = frame[0] + xs[:, None, None] * frame[1] + ys[..., None] * frame[2]
            unit = vectors / np.linalg.norm(vectors, axis=2, keepdims=True)
            values = separation(unit.reshape(-1, 3)).reshape(ys.shape)
            k = values.argmax(axis=1)
            rows = np.arange(len(xs))
            found = values[rows, k], ys[rows, k]
            low, high = ys[rows, np.maximum(k - 1, 0)], ys[rows, np.minimum(k + 1, len(GRID) - 1)]
        return found

    low, high = -half, half
    best = (-np.inf, 0.0, 0.0)
    for _ in range(SHRINKS):
        xs = low + (high - low) * GRID
        values, ys = over_y(xs)
        k = int(values.argmax())
        best = max(best, (values[k], xs[k], ys[k]))
        low, high = xs[max(k - 1, 0)], xs[min(k + 1, len(GRID) - 1)]
    return best


def fibonacci(count):
    """`[count, 3]` directions, evenly over the sphere."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    turn = np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z * z)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


DIRECTIONS = fibonacci(1024)
"""Directions of the first round of the third judge, 0.11 rad apart."""
HALF_WIDTH = 0.25
"""Half the side of the square of directions that a search looks at: twice the distance of the first round's."""
GRID = np.linspace(0, 1, 13)
"""Places that divide an interval: each round leaves a sixth of it."""
SHRINKS = 7
"""Rounds: 6^7 is 3e5; the later, narrower squares find a direction within 1e-9."""
