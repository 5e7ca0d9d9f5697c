"""The tick's own row: order, silence, state, reasons, counts, budget, and what it says of its sources."""

from __future__ import annotations

import functools
from collections import Counter
from typing import Callable, Iterator, Optional

import numpy as np
from sweepd.layout import BodyStatus, PairFlags, Reason, Stage, State, TickCause, Verdict

from .faults import Fault
from .ledger import Frame
from .moment import Moment
from .told import Told, has, source_rows
from .world import World

#: No limit, no age.
NONE = 0xFFFF_FFFF_FFFF_FFFF
#: Work that is under way when the units are spent is brought to its end; of these shapes it is so much at most.
PIECE_UNITS = 2
#: What a busy machine may add to a heartbeat.
_LATE_NS = 5_000_000_000
#: What may pass between the tick's judging of ages and the moment that it says, beside what it measured.
_AGE_SLACK_NS = 500_000_000


def check_order(told: Told, before: Optional[Told], world: World) -> Iterator[Fault]:
    """Ticks of a boot go on, by number and then by when they were sent; none is late; messages repeat what it says."""
    tick = told.tick
    boot = world.boots[told.boot]
    if tick.header.scene_rev not in boot.scenes:
        known = f"revisions {min(boot.scenes)} to {boot.newest}"
        yield Fault("revision", told.number, "the tick", f"scene_rev {tick.header.scene_rev}", known)
    if told.changes_header is not None and not told.is_bare:
        message = told.changes_header.message
        repeated = (message.boot_id, message.tick, message.scene_rev, message.state)
        header = (told.boot, told.number, tick.header.scene_rev, tick.header.state)
        if repeated != header:
            yield Fault("repeated", told.number, "changes", f"{repeated}", f"the tick says {header}")
    if tick.rebuilds:
        yield Fault("rebuilds", told.number, "the tick", f"rebuilds {tick.rebuilds}", "every structure holds")
    if before is None or before.boot != told.boot:
        return
    if (told.number, tick.sent_ns) <= (before.number, before.tick.sent_ns):
        told_text = f"number {told.number}, sent at {tick.sent_ns}"
        yield Fault(
            "order", told.number, "the tick", told_text, f"number {before.number}, {before.tick.sent_ns} was before"
        )
    silent_ns = tick.sent_ns - before.tick.sent_ns
    most_ns = boot.setup.heartbeat_ms * 1_000_000 + _LATE_NS
    if told.number <= before.number + 1 and silent_ns > most_ns:
        text = f"nothing for {silent_ns / 1e6:.0f} ms"
        yield Fault("silence", told.number, "the tick", text, f"a tick at least each {boot.setup.heartbeat_ms} ms")


def check_bare(told: Told) -> Iterator[Fault]:
    """A tick that goes out alone while work goes on knows nothing yet, and says so."""
    tick = told.tick
    if tick.header.state != State.UNKNOWN or not has(tick.reasons, Reason.UNDECIDED):
        text = f"state {tick.header.state}, reasons {tick.reasons:b}"
        yield Fault("bare", told.number, "the tick", text, "unknown and undecided while it is under way")


def check_counts(now: Moment) -> Iterator[Fault]:
    """Counts, reasons and state are those of the rows."""
    tick, rows = now.told.tick, now.list
    status = now.status
    of = lambda *wanted: int(np.isin(status, wanted).sum())  # noqa: E731
    unknown = of(BodyStatus.NOT_RECEIVED, BodyStatus.REJECTED, BodyStatus.STALE, BodyStatus.TRUNCATED)
    yield from _equal(now, "count", "bodies", tick.bodies, len(status))
    yield from _equal(now, "count", "unknown bodies", tick.unknown, unknown)
    yield from _equal(now, "count", "ignored pairs", tick.ignored, now.scene.pairs.ignored)
    if rows is None:
        return
    there = rows[rows["flags"] & int(PairFlags.GONE) == 0]
    verdict = lambda wanted: int((there["verdict"] == wanted).sum())  # noqa: E731
    counted = [("colliding", Verdict.COLLIDING), ("possible", Verdict.POSSIBLE), ("near", Verdict.NEAR)]
    cut = tick.header.truncated > 0
    for word, wanted in counted:
        said = getattr(tick, word)
        if said != verdict(wanted) and not (cut and said > verdict(wanted)):
            yield Fault("count", now.tick, f"{word} pairs", f"{said}", f"{verdict(wanted)} rows")
    if tick.candidates < len(there):
        yield Fault("count", now.tick, "candidates", f"{tick.candidates}", f"{len(there)} rows of pairs that are there")
    if cut:
        return
    yield from _check_state(now, there)
    yield from _check_worst(now, there)


def _equal(now: Moment, check: str, who: str, told: int, truth: int) -> Iterator[Fault]:
    if told != truth:
        yield Fault(check, now.tick, who, f"{told}", f"{truth}")


def _check_state(now: Moment, there: np.ndarray) -> Iterator[Fault]:
    tick, status = now.told.tick, now.status
    touched = bool((there["flags"] & int(PairFlags.SWEPT_HIT) != 0).any())
    open_ = bool((there["flags"] & int(PairFlags.SWEPT_OPEN) != 0).any())
    possible = bool((there["verdict"] == Verdict.POSSIBLE).any())
    collides = there["verdict"] == Verdict.COLLIDING
    colliding = bool(collides.any())
    # who collides now has touched by now: what its way alone says, the tick need not repeat
    beside = bool((there["flags"][~collides] & int(PairFlags.SWEPT_HIT) != 0).any())
    may = None if touched else False
    enabled = bool((status != BodyStatus.DISABLED).any())
    silent = all(row.frames == 0 for row in now.sources.values())
    reasons = {
        Reason.NOT_RECEIVED: BodyStatus.NOT_RECEIVED in status,
        Reason.STALE: BodyStatus.STALE in status,
        Reason.HELD: BodyStatus.HELD in status,
        Reason.REMOVED_BY_AGE: BodyStatus.REMOVED_BY_AGE in status,
        Reason.REJECTED: BodyStatus.REJECTED in status,
        Reason.TRUNCATED: False,
        Reason.UNDECIDED: possible or open_ or may,
        Reason.NO_INPUT: not enabled or silent,
        Reason.SWEPT: beside or open_ or may,
    }
    for reason, wanted in reasons.items():
        if wanted is not None and has(tick.reasons, reason) != wanted:
            text = f"{'set' if not wanted else 'not set'}"
            yield Fault(
                "reason", now.tick, reason.name.lower(), text, f"by the rows it {'holds' if wanted else 'does not'}"
            )
    unsafe = [Reason.NOT_RECEIVED, Reason.STALE, Reason.HELD, Reason.REMOVED_BY_AGE, Reason.REJECTED, Reason.NO_INPUT]
    if colliding or touched:
        state = State.COLLIDING
    elif any(reasons[reason] for reason in unsafe):
        state = State.UNKNOWN
    elif possible or open_:
        state = State.POSSIBLE
    elif (there["verdict"] == Verdict.NEAR).any():
        state = State.NEAR
    else:
        state = State.CLEAR
    if tick.header.state != state:
        yield Fault(
            "state", now.tick, "the tick", State(tick.header.state).name.lower(), f"the rows say {state.name.lower()}"
        )


def _check_worst(now: Moment, there: np.ndarray) -> Iterator[Fault]:
    tick = now.told.tick
    undecided = bool((there["verdict"] == Verdict.POSSIBLE).any())
    if bool(tick.oldest_undecided_ticks) != undecided:
        told = f"oldest_undecided_ticks {tick.oldest_undecided_ticks}"
        yield Fault("oldest", now.tick, "the tick", told, f"{'some' if undecided else 'no'} rows are possible")
    active = there[there["verdict"] > Verdict.APART]
    if len(active):
        worst = int(active["verdict"].max())
        row = now.by_ids.get((tick.worst_a, tick.worst_b))
        swept = int(PairFlags.SWEPT_HIT | PairFlags.SWEPT_OPEN)
        fits = row is not None and (int(row["verdict"]) == worst or int(row["flags"]) & swept)
        if not fits:
            told = f"worst pair {tick.worst_a}, {tick.worst_b}"
            yield Fault("worst", now.tick, "the tick", told, f"the worst row is {Verdict(worst).name.lower()}")
        with np.errstate(invalid="ignore"):
            width = float(np.max(active["gap_max_m"] - active["gap_min_m"]))
        if tick.widest_m < width:
            yield Fault("widest", now.tick, "the tick", f"widest_m {tick.widest_m}", f"a row is {width} wide")


def check_budget(now: Told, before: Optional[Told], world: World) -> Iterator[Fault]:
    """The budget is that which was asked for, by the command and by frames; what was over it is flagged and counted."""
    tick, setup = now.tick, world.boots[now.boot].setup
    ages_only = setup.lead is not None and tick.cause != TickCause.FRAME
    units = 0 if ages_only else setup.budget_units
    wanted_units = NONE if units is None else units
    if tick.budget_units != wanted_units:
        yield Fault("units", now.number, "the budget", f"budget_units {tick.budget_units}", f"{wanted_units}")
    # what is left of a budget of time is used after the tick, and told with the next
    if units is not None and tick.units > units + PIECE_UNITS and tick.stage_ns[Stage.REST] == 0:
        yield Fault("units", now.number, "the budget", f"{tick.units} units spent", f"{units} were there")
    consecutive = before is not None and before.boot == now.boot and before.number + 1 == now.number
    # a frame that was used shortens the budget of its tick; of one behind a tick that was missed it is not known which
    taken = _admitted(now, before, world) if consecutive and before is not None else []
    lefts = [frame.time_left_ns for frame in taken if frame.time_left_ns]
    own = NONE if setup.budget_ns is None else setup.budget_ns
    most_ns = min([own, *lefts])
    if tick.budget_ns > most_ns or (consecutive and not lefts and tick.budget_ns != own):
        yield Fault(
            "budget", now.number, "the budget", f"budget_ns {tick.budget_ns}", f"at most {most_ns}, by frames {lefts}"
        )
    if bool(tick.overrun) != (tick.elapsed_ns > tick.budget_ns):
        text = f"overrun {tick.overrun}"
        yield Fault("overrun", now.number, "the budget", text, f"{tick.elapsed_ns} ns of {tick.budget_ns}")
    if consecutive and before is not None and tick.missed != before.tick.missed + tick.overrun:
        yield Fault("late", now.number, "the budget", f"missed {tick.missed}", f"{before.tick.missed} + {tick.overrun}")


def _admitted(now: Told, before: Told, world: World) -> list[Frame]:
    """The newest frame of each source that this tick took."""
    rows, old = source_rows(now.tick), source_rows(before.tick)
    news = [(name, row) for name, row in rows.items() if name not in old or old[name].frames != row.frames]
    # by their stamps, for the session may have ended with its last frame; a pause has none, and leaves no time
    frames = (world.ledger.of_stamp(name, row.stamp_ns) for name, row in news)
    return [frame for frame in frames if frame is not None]


def check_sources(now: Told, before: Optional[Told], world: World) -> Iterator[Fault]:
    """Each source's row is that of a frame that was sent and may be used, goes on in its session, and tells its age."""
    setup, ledger = world.boots[now.boot].setup, world.ledger
    rows = source_rows(now.tick)
    if list(rows) != [source.name for source in setup.sources]:
        yield Fault("sources", now.number, "the tick", f"{list(rows)}", f"{[source.name for source in setup.sources]}")
        return
    consecutive = before is not None and before.boot == now.boot and before.number + 1 == now.number
    old = source_rows(before.tick) if before is not None and before.boot == now.boot else {}
    for name, row in rows.items():
        fault = functools.partial(_fault, now.number, name)
        order = (row.epoch, row.seq)
        if row.session and not ledger.knows(name, row.session):
            yield fault("session", f"session {row.session:x}", "nobody sent in it")
        elif row.session and row.seq:
            frame = ledger.of_order(name, row.session, order)
            if frame is None or frame.void:
                yield fault("frame", f"epoch and number {order}", "no such frame was sent, or it was to be refused")
            else:
                yield from _check_frame(now, row, frame, fault)
        timeout_ns = setup.source(name).timeout_ms * 1_000_000
        if row.age_ns != NONE and bool(row.alive) != (row.age_ns < timeout_ns):
            yield fault("alive", f"alive {row.alive}", f"its age is {row.age_ns} ns of {timeout_ns}")
        was = old.get(name)
        if was is None:
            continue
        if (row.frames, row.skipped, row.refused) < (was.frames, was.skipped, was.refused):
            yield fault("frames", f"{row.frames} frames, {row.skipped} skipped", f"{was.frames}, {was.skipped} before")
        if row.session == was.session and row.session and order < (was.epoch, was.seq):
            yield fault("frames", f"epoch and number {order}", f"{(was.epoch, was.seq)} was used before")
        if consecutive and name == setup.lead:
            yield from _check_lockstep(now, row.frames - was.frames, fault)


def _check_frame(now: Told, row, frame: Frame, fault: Callable[..., Fault]) -> Iterator[Fault]:
    stamp = 0 if frame.paused else frame.stamp
    if row.stamp_ns != stamp or bool(row.paused) != frame.paused:
        yield fault("frame", f"stamp {row.stamp_ns}, paused {row.paused}", f"stamp {stamp}, paused {frame.paused}")
    if frame.sent_ns is None:
        return
    first_ns, last_ns = frame.sent_ns
    # what came while the daemon looked is as old as the beginning of its look
    oldest_ns = now.tick.sent_ns - first_ns + _AGE_SLACK_NS
    youngest_ns = now.tick.sent_ns - now.tick.elapsed_ns - _AGE_SLACK_NS - last_ns
    if not youngest_ns <= row.age_ns <= oldest_ns:
        yield fault("age", f"age {row.age_ns} ns", f"the frame was sent {youngest_ns} to {oldest_ns} ns ago")


def _check_lockstep(now: Told, taken: int, fault: Callable[..., Fault]) -> Iterator[Fault]:
    """One tick for each frame of the leading source, and no other tick takes one."""
    by_frame = now.tick.cause == TickCause.FRAME
    if taken > 1 or (taken == 1 and not by_frame):
        cause = TickCause(now.tick.cause).name.lower()
        yield fault("lockstep", f"{taken} frames in a tick whose cause is {cause}", "one a tick, in a tick of its own")


class Losses:
    """No frame is passed over in silence: each was used, or counted as skipped or refused."""

    def __init__(self) -> None:
        self._missing: Counter[str] = Counter()

    def check(self, now: Told, before: Told, world: World) -> Iterator[Fault]:
        """Takes the tick that follows."""
        rows, old = source_rows(now.tick), source_rows(before.tick)
        for name, row in rows.items():
            was = old.get(name)
            if was is None or not row.session or row.session != was.session or not was.seq:
                continue
            sent = world.ledger.count_between(name, row.session, (was.epoch, was.seq), (row.epoch, row.seq))
            taken = row.frames - was.frames
            if taken > sent:
                yield _fault(
                    now.number, name, "frames", f"{taken} frames used", f"{sent} were sent since the tick before"
                )
            self._missing[name] += sent - taken
            # what is lost is counted when that is seen, which may be ticks before those behind it are used
            told = row.skipped + row.refused
            if self._missing[name] > told:
                text = f"{row.skipped} skipped, {row.refused} refused in this boot"
                yield _fault(
                    now.number, name, "silent", text, f"{self._missing[name]} were not used, since it is listened to"
                )


def _fault(tick: int, source: str, check: str, told: str, truth: str) -> Fault:
    return Fault(check, tick, f"source `{source}`", told, truth)


def _name(row) -> str:
    return bytes(row.name).split(b"\0")[0].decode()
