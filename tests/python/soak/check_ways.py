"""Continuous bodies: no touch on the way is untold, and what is told of one is so."""

from __future__ import annotations

from typing import Iterator, Optional

import numpy as np
from sweepd.layout import PairFlags, Reason, Verdict

from .check_pairs import goes_on, said
from .faults import Fault
from .moment import Moment
from .told import has
from .ways import Crossings, Way

#: What comes nearer to a touch than this, or to one side of it, is left to rounding, metres.
_GRAZE_M = 1e-9
#: What comes as near to a touch as this may stay open, however much work there is, metres.
_ROUNDED_M = 1e-6
#: Poses of a tick that a body is followed through.
_LEGS_MAX = 32
#: Just before a share: who touches there may be asked for the first time.
_BEFORE = 1e-12
_SWEPT = int(PairFlags.SWEPT_HIT | PairFlags.SWEPT_OPEN)


def check_ways(now: Moment, before: Moment) -> Iterator[Fault]:
    """Every pair with a body that was swept, against the least gap on its way."""
    if now.list is None or before.list is None:
        return
    ways = _ways(now, before)
    yield from _check_jumps(now, ways)
    crossings = _candidates(now, before, ways)
    if crossings is None:
        return
    crossings.solve()
    least, asked = crossings.least(), crossings.least(asked=True)
    until_min, until_max = np.ones(len(least)), np.ones(len(least))
    for at, pair in enumerate(crossings.pairs):
        row = now.by_ids.get(_ids(now, pair))
        if row is not None and int(row["flags"]) & _SWEPT:
            until_min[at], until_max[at] = row["toi_min"], row["toi_max"]
    before_min, by_max = crossings.least(until_min - _BEFORE, asked=True), crossings.least(until_max)
    cut = now.told.tick.header.truncated > 0
    for at, pair in enumerate(crossings.pairs):
        a, b = sorted(int(now.order_place[body]) for body in pair)
        row = now.by_ids.get(_ids(now, pair))
        swept = int(row["flags"]) & _SWEPT if row is not None else 0
        if swept:
            wrong = _wrong_touch(swept, (least[at], before_min[at], by_max[at]))
            if wrong is not None:
                yield Fault("way", now.tick, now.who(a, b), said(row), wrong)
            if swept == PairFlags.SWEPT_OPEN and _is_to_decide(now, pair, ways) and abs(asked[at]) > _ROUNDED_M:
                truth = f"no limit of work was set, and the gap was {float(asked[at])!r} m at the least"
                yield Fault("undecided", now.tick, now.who(a, b), said(row), truth)
        elif asked[at] < -_GRAZE_M and not cut and not _was_told(now, before, pair, row):
            told = "it is not listed: plainly apart" if row is None else said(row)
            truth = f"on its way the gap was {float(asked[at])!r} m at the least; {_on_way(now, before, pair, ways)}"
            yield Fault("untold", now.tick, now.who(a, b), told, truth)


def _is_to_decide(now: Moment, pair: tuple[int, int], ways: dict[int, Optional[Way]]) -> bool:
    """Whether nothing limits the work on a way, and what is to be found out."""
    followed = [way for body in pair if (way := ways.get(body)) is not None]
    in_step = len(followed) < 2 or followed[0].is_in_step_with(followed[1])
    return now.is_unlimited and in_step and all(way.legs <= _LEGS_MAX for way in followed)


def _on_way(now: Moment, before: Moment, pair: tuple[int, int], ways: dict[int, Optional[Way]]) -> str:
    """The ways of a pair and its row of the tick before, in words."""
    told = []
    for body in pair:
        way, name = ways.get(body), now.scene.names[body]
        told.append(f"`{name}` went {way.centres[:, 0].tolist()}" if way is not None else f"`{name}` stood still")
    old = before.by_ids.get(_ids(now, pair))
    return ", ".join(told) + f"; in the tick before: {'apart' if old is None else said(old)}"


def _ids(now: Moment, pair: tuple[int, int]) -> tuple[int, int]:
    """Ids of two bodies by their places in the scene, the smaller first."""
    one, other = (int(now.rows["body"][now.order_place[body]]) for body in pair)
    return min(one, other), max(one, other)


def _wrong_touch(swept: int, gaps: tuple[float, float, float]) -> Optional[str]:
    least, before_min, by_max = map(float, gaps)
    if before_min < -_GRAZE_M:
        return f"before that share the gap was {before_min!r} m already"
    if swept & PairFlags.SWEPT_HIT and by_max > _GRAZE_M:
        return f"up to that share the gap was {by_max!r} m at the least, all the way {least!r} m"
    return None


def _was_told(now: Moment, before: Moment, pair: tuple[int, int], row: Optional[np.void]) -> bool:
    """Whether the touch is one of a collision that is told at these poses, or was at the last."""
    if row is not None and int(row["verdict"]) == Verdict.COLLIDING:
        return True
    old = before.by_ids.get(_ids(now, pair))
    # a row that found no room then may have been one of a collision
    return before.told.tick.header.truncated > 0 if old is None else int(old["verdict"]) == Verdict.COLLIDING


def _ways(now: Moment, before: Moment) -> dict[int, Optional[Way]]:
    """The way of each continuous body that is placed, by its place in the scene; None: it is not known."""
    ways: dict[int, Optional[Way]] = {}
    for at in range(len(now.names)):
        body = now.body(at)
        if body is None or not body.continuous or body.source is None or not now.placed[at]:
            continue
        was = before.place.get(int(now.rows["body"][at]))
        known = was is not None and before.placed[was]
        ways[int(now.order[at])] = _way(now, before, at, was) if known and was is not None else None
    return ways


def _way(now: Moment, before: Moment, at: int, was: int) -> Optional[Way]:
    body, id_ = now.body(at), int(now.rows["body"][at])
    assert body is not None and body.source is not None
    source, old = now.sources[body.source], before.sources[body.source]
    first = before.pose_of(was)
    if first is None or not goes_on(now, before, (id_, id_)) or now.scene is not before.scene:
        return None
    taken = now.world.ledger.between(body.source, source.session, (old.epoch, old.seq), (source.epoch, source.seq))
    # of frames that were lost, refused or passed over the way is not known
    if source.frames - old.frames != len(taken) or any(body.name in frame.spoilt for frame in taken):
        return None
    with_poses = [frame for frame in taken if not frame.paused]
    moving = [(at, frame) for at, frame in enumerate(with_poses, 1) if frame.moves(body.name)]
    poses, frames = [first, *(frame.poses[body.name] for _, frame in moving)], [at for at, _ in moving]
    if all(pose == first for pose in poses):
        # who stands still goes no way
        poses, frames = [first], []
    forms = now.scene.forms
    parts = forms.parts_of(int(now.order[at]))
    count = len(now.scene.names)
    centres = []
    for position, orientation in poses:
        positions, orientations = np.zeros((count, 3)), np.ones((count, 4))
        positions[now.order[at]], orientations[now.order[at]] = position, orientation
        centres.append(forms.centres(positions, orientations)[parts])
    jumps = None
    if body.teleport_m is not None:
        pivots = [of_pose.mean(axis=0) for of_pose in centres]
        jumps = [float(np.linalg.norm(to - from_)) > body.teleport_m for from_, to in zip(pivots, pivots[1:])]
    return Way(np.stack(centres), jumps, (frames, len(with_poses)), body.source)


def _check_jumps(now: Moment, ways: dict[int, Optional[Way]]) -> Iterator[Fault]:
    """A teleport is told, and none where all ways are known and none was."""
    jumped = any(way is not None and any(way.jumps) for way in ways.values())
    told = has(now.told.tick.reasons, Reason.TELEPORTED)
    if jumped and not told:
        yield Fault(
            "teleport", now.tick, "the tick", "no teleport", "a body went farther than its teleport_m in a step"
        )
    all_known = all(ways.get(at) is not None for at, body in enumerate(now.scene.bodies.values()) if body.continuous)
    if told and not jumped and all_known:
        yield Fault(
            "teleport", now.tick, "the tick", "a teleport", "no body went farther than its teleport_m in a step"
        )


def _candidates(now: Moment, before: Moment, ways: dict[int, Optional[Way]]) -> Optional[Crossings]:
    """Pairs of which a way is known and that come near one another on it."""
    forms, count = now.scene.forms, len(now.scene.names)
    low, high = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    whole: dict[int, Way] = {}
    for at in range(len(now.names)):
        body = int(now.order[at])
        if not now.placed[at] or (body in ways and ways[body] is None):
            continue
        way = ways.get(body) or Way(now.centres[forms.parts_of(body)][None])
        whole[body] = way
        if way.centres.shape[1]:
            parts = forms.parts_of(body)
            half = forms.half[parts] + forms.radius[parts][:, None]
            low[body] = (way.centres - half).min(axis=(0, 1))
            high[body] = (way.centres + half).max(axis=(0, 1))
    swept = np.array([body in ways and ways[body] is not None and ways[body].legs > 0 for body in range(count)], bool)
    planes = {at for at, _, _ in forms.planes}
    low[list(planes)], high[list(planes)] = -np.inf, np.inf
    with np.errstate(invalid="ignore"):
        near = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    near &= now.scene.pairs.allowed & (swept[:, None] | swept[None]) & np.tri(count, k=-1, dtype=bool)
    pairs = [(int(a), int(b)) for a, b in np.argwhere(near) if a in whole and b in whole]
    if not pairs:
        return None
    crossings = Crossings(forms)
    for a, b in pairs:
        crossings.add(a, b, whole[a], whole[b])
    return crossings
