"""Rows of bodies: names and ids, which pose of which frame, how old, and what follows from it."""

from __future__ import annotations

from typing import Iterator, Optional

import numpy as np
from sweepd.layout import BodyStatus, PairFlags, Verdict

from .check_tick import NONE
from .faults import Fault
from .ledger import Frame
from .moment import Moment
from .told import Told
from .world import World

_STALE = {"unknown": BodyStatus.STALE, "hold": BodyStatus.HELD, "remove": BodyStatus.REMOVED_BY_AGE}
#: Placed by a pose that came, and is shown.
_POSED = (BodyStatus.KNOWN, BodyStatus.STALE, BodyStatus.HELD, BodyStatus.REMOVED_BY_AGE)


def check_names(told: Told, world: World) -> Iterator[Fault]:
    """Names are those of the scene; an id stays with its name, a new name gets the least that is free."""
    boot = world.boots[told.boot]
    scene = boot.scenes[told.tick.header.scene_rev]
    if set(told.names) != set(scene.bodies):
        more, less = set(told.names) - set(scene.bodies), set(scene.bodies) - set(told.names)
        yield Fault(
            "names", told.number, "the scene", f"beyond the scene {more}, missing {less}", "the bodies of the scene"
        )
    for name in sorted(told.names, key=lambda name: told.names[name]):
        id_ = told.names[name]
        if name not in boot.ids:
            taken = set(boot.ids.values())
            least = next(free for free in range(1, len(taken) + 2) if free not in taken)
            if id_ != least:
                yield Fault("ids", told.number, f"body `{name}`", f"id {id_}", f"{least} is the least that is free")
            boot.ids[name] = id_
        elif boot.ids[name] != id_:
            yield Fault("ids", told.number, f"body `{name}`", f"id {id_}", f"it had {boot.ids[name]} in this boot")


def check_bodies(now: Moment, before: Optional[Moment]) -> Iterator[Fault]:
    """Every body has the pose of the frame that it says, and the status that its age calls for."""
    rows = now.rows
    ids = [int(id_) for id_ in rows["body"]]
    if ids != sorted(set(ids)) or set(ids) != set(now.told.names.values()):
        yield Fault(
            "bodies", now.tick, "the rows", f"ids {ids}", f"by id, those of the names {sorted(now.told.names.values())}"
        )
        return
    for at, row in enumerate(rows):
        body, who = now.body(at), f"body `{now.names[at]}`"
        if body is None:
            continue
        puts = now.boot.puts[now.told.tick.header.scene_rev][body.name]
        if int(row["generation"]) != puts:
            yield Fault("generation", now.tick, who, f"{row['generation']}", f"it was put {puts} times")
        status = BodyStatus(int(row["status"]))
        if not body.enabled or status == BodyStatus.DISABLED:
            if body.enabled or status != BodyStatus.DISABLED:
                yield Fault("status", now.tick, who, status.name.lower(), f"enabled is {body.enabled}")
        elif not body.moves:
            place = body.path.at(0)[0]
            if status != BodyStatus.KNOWN or tuple(row["position"]) != place or int(row["age_ns"]) != NONE:
                text = f"{status.name.lower()} at {tuple(row['position'])}, age {row['age_ns']}"
                yield Fault("status", now.tick, who, text, f"it cannot move, and stands at {place}")
        else:
            yield from _check_moving(now, before, at, status, who)


def _check_moving(now: Moment, before: Optional[Moment], at: int, status: BodyStatus, who: str) -> Iterator[Fault]:
    row, body = now.rows[at], now.body(at)
    assert body is not None and body.source is not None
    source = now.sources[body.source]
    setup = now.setup.source(body.source)
    newest = now.world.ledger.of_order(body.source, source.session, (source.epoch, source.seq))
    is_new = before is not None and before.sources[body.source].frames != source.frames
    if is_new and newest is not None and newest.moves(body.name) and status not in _POSED:
        yield Fault(
            "status", now.tick, who, status.name.lower(), f"frame {newest.order} of this tick has a good pose of it"
        )
    if is_new and newest is not None and body.name in newest.spoilt and status != BodyStatus.REJECTED:
        yield Fault(
            "status", now.tick, who, status.name.lower(), f"its pose in frame {newest.order} of this tick was spoilt"
        )
    if status not in _POSED:
        return
    age_ns, timeout_ns = int(row["age_ns"]), setup.timeout_ms * 1_000_000
    wanted = BodyStatus.KNOWN if age_ns < timeout_ns else _STALE[body.on_stale or setup.on_stale]
    if status != wanted:
        text = f"{status.name.lower()} at an age of {age_ns} ns"
        yield Fault("status", now.tick, who, text, f"{wanted.name.lower()}: its time-out is {timeout_ns} ns")
    if source.session and age_ns < source.age_ns:
        yield Fault(
            "age", now.tick, who, f"age {age_ns} ns", f"the newest frame of its source is {source.age_ns} ns old"
        )
    frame = now.frame(at)
    if frame is None or frame.void or not frame.moves(body.name):
        text = "no such frame was sent" if frame is None else f"frame {frame.order} is not one that it can be from"
        yield Fault("pose", now.tick, who, f"stamp {row['stamp_ns']}", text)
        return
    yield from _check_pose(now, at, frame, who)


def _check_pose(now: Moment, at: int, frame: Frame, who: str) -> Iterator[Fault]:
    row, body = now.rows[at], now.body(at)
    assert body is not None and body.source is not None
    position, orientation = frame.poses[body.name]
    told = tuple(float(x) for x in row["position"])
    off = np.abs(np.array(row["orientation"]) - np.array(orientation)).max()
    if told != position or off > 1e-12:
        yield Fault(
            "pose",
            now.tick,
            who,
            f"{told}, {row['orientation']}",
            f"frame {frame.order} says {position}, {orientation}",
        )
    source = now.sources[body.source]
    if not source.session:
        return
    if (frame.session, frame.epoch) != (source.session, source.epoch) or frame.order > (source.epoch, source.seq):
        text = f"session {frame.session:x}, frame {frame.order}"
        truth = f"session {source.session:x} in force, frame {(source.epoch, source.seq)} is its newest"
        yield Fault("session", now.tick, who, text, truth)
        return
    # where frames were lost or passed over, a newer pose may have been among them, but for one in the newest frame
    newest = now.world.ledger.newest_with(body.source, source.session, (source.epoch, source.seq), body.name)
    is_sure = newest is not None and (source.skipped == 0 or newest.order == (source.epoch, source.seq))
    if is_sure and newest is not None and newest.order > frame.order:
        text = f"the pose of frame {frame.order}"
        yield Fault("pose", now.tick, who, text, f"frame {newest.order} was used, and has a newer one")


def check_verdicts(now: Moment) -> Iterator[Fault]:
    """A body's verdict is the worst of its pairs, and no better than possible where its place is not known."""
    told, rows = now.told, now.list
    if told.verdicts is not None and told.verdicts.tolist() != now.rows["verdict"].tolist():
        text = f"{told.verdicts.tolist()}"
        yield Fault("body_verdict", now.tick, "body_verdicts", text, f"bodies say {now.rows['verdict'].tolist()}")
    if rows is None or told.tick.header.truncated:
        return
    worst = np.where(np.isin(now.status, [BodyStatus.KNOWN, BodyStatus.HELD, BodyStatus.DISABLED]), 1, 3)
    which, a, b = now.at_rows
    flags, verdict = rows["flags"][which], rows["verdict"][which].astype(int)
    verdict = np.where(flags & int(PairFlags.SWEPT_OPEN) != 0, np.maximum(verdict, int(Verdict.POSSIBLE)), verdict)
    verdict = np.where(flags & int(PairFlags.SWEPT_HIT) != 0, int(Verdict.COLLIDING), verdict)
    np.maximum.at(worst, a, verdict)
    np.maximum.at(worst, b, verdict)
    for at in np.flatnonzero(worst != now.rows["verdict"]):
        told_text = Verdict(int(now.rows["verdict"][at])).name.lower()
        yield Fault(
            "body_verdict", now.tick, f"body `{now.names[at]}`", told_text, Verdict(int(worst[at])).name.lower()
        )
