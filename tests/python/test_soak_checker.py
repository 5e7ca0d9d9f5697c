"""The checker of the soak can fail: a whole run passes, and spoilt in one place it is found out, check by check.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import copy
import os
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from needed import needed

np = needed("numpy")
needed("sweepd")

from soak import check_answers  # noqa: E402
from soak import checker as soak_checker  # noqa: E402
from soak.checker import Checker  # noqa: E402
from soak.clients import Agreement  # noqa: E402
from soak.moment import NO_LIMIT, Moment  # noqa: E402
from soak.script import TOPICS, Script  # noqa: E402
from soak.told import ids_of, source_rows  # noqa: E402
from sweepd.layout import (  # noqa: E402
    BodyStatus,
    ContactFlags,
    ContactKind,
    EndCause,
    Event,
    PairFlags,
    State,
    TickCause,
    Verdict,
)

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
#: Found by the driver, which is told or waits for it.
OF_DRIVER = {"ended", "answer", "child", "validate", "client"}
#: Seen to fail below, each by itself.
BY_THEMSELVES = {"restart", "agreement", "answer_gap", "answer_touching"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A whole run: what was sent, and every tick."""
    script = Script(1, "on_frame", 0.0, tmp_path_factory.mktemp("soak"), TOPICS)
    try:
        ticks = script.play()
    finally:
        script.close()
    assert not script.report.faults, str(script.report)
    return SimpleNamespace(world=script.world, ticks=ticks, counts=script.report.counts)


def checked(world, ticks, until=None):
    """What a checker finds in ticks, up to the first that a check of this name finds something in."""
    for boot in world.boots.values():
        boot.ids.clear()
    checker, found = Checker(world), []
    for told in ticks:
        found += checker.take(told.copy())
        if until in {fault.check for fault in found}:
            break
    return found


def test_a_run_that_is_whole_has_no_fault_and_something_of_everything(run):
    assert checked(run.world, run.ticks) == []
    for what in ("begin", "persist", "end", "passed", "possible", "swept_hit", "swept_open", "teleported", "touching"):
        assert run.counts[what] > 0 or what == "possible", (what, run.counts)
    for what in ("end separated", "end removed", "state possible", "state unknown", "state colliding", "bare ticks"):
        assert run.counts[what] > 0 or what == "bare ticks", (what, run.counts)


# -------------------------------------------------------------------- where there is something to spoil


def find(ticks, fits, behind=2):
    """The first tick that fits, with some before it."""
    for at, told in enumerate(ticks):
        if at >= behind and told.pairs is not None and told.bodies is not None and fits(told):
            return at
    raise AssertionError("no tick fits")


def row_of(rows, fits):
    """Place of the first row that fits; None where none does."""
    return next((at for at, row in enumerate(rows) if fits(row)), None)


def is_of(verdict, *flags, event=None):
    """A row of a verdict, with flags, and with no event but this; its bodies are known."""

    def fits(row):
        has_flags = (
            all(int(row["flags"]) & flag for flag in (*flags,)) and not int(row["flags"]) & PairFlags.UNKNOWN_BODY
        )
        has_event = event is None or int(row["events"]) == 1 << event
        return int(row["verdict"]) == verdict and has_flags and has_event

    return fits


def parted(row):
    """Who collided before and has gone away."""
    return int(row["events"]) == 1 << Event.END and int(row["end_cause"]) == EndCause.SEPARATED


def has_open_way(row):
    """Whether there was a touch on the way is not decided."""
    return int(row["flags"]) & PairFlags.SWEPT_OPEN


def unlimited(told):
    """Whether the tick's work had no end."""
    return told.tick.budget_ns == NO_LIMIT and told.tick.budget_units == NO_LIMIT


def spoil_row(fits, when=lambda told: True, **fields):
    """Writes into the first row that fits, in ``pairs`` alone."""

    def spoil(world, ticks):
        at = find(ticks, lambda told: when(told) and row_of(told.pairs, fits) is not None)
        rows = ticks[at].pairs
        for name, value in fields.items():
            rows[name][row_of(rows, fits)] = value

    return spoil


def drop_row(fits, names=None):
    """Takes the first row that fits out of ``pairs``, of two bodies by name where these are given."""

    def place(told):
        ids = None if names is None else sorted(told.names[name] for name in names)
        return row_of(told.pairs, lambda row: fits(row) and ids in (None, list(ids_of(row))))

    def spoil(world, ticks):
        at = find(ticks, lambda told: place(told) is not None)
        ticks[at].pairs = np.delete(ticks[at].pairs, place(ticks[at]))

    return spoil


def spoil_tick(fits=lambda told: True, behind=2, **fields):
    """Writes into the tick's own row; a function is given what is there."""

    def spoil(world, ticks):
        at = find(ticks, fits, behind)
        for name, value in fields.items():
            was = getattr(ticks[at].tick, name)
            setattr(ticks[at].tick, name, value(was) if callable(value) else value)

    return spoil


def spoil_header(**fields):
    def spoil(world, ticks):
        at = find(ticks, lambda told: True, 20)
        for name, value in fields.items():
            setattr(ticks[at].tick.header, name, value)

    return spoil


def spoil_source(fits=lambda row: True, of="sim", **fields):
    def spoil(world, ticks):
        at = find(ticks, lambda told: fits(source_rows(told.tick)[of]), 20)
        row = source_rows(ticks[at].tick)[of]
        for field, value in fields.items():
            was = getattr(row, field)
            setattr(row, field, value(was) if callable(value) else value)

    return spoil


def spoil_body(fits, **fields):
    def spoil(world, ticks):
        at = find(ticks, lambda told: row_of(told.bodies, fits) is not None, 20)
        rows = ticks[at].bodies
        place = row_of(rows, fits)
        for name, value in fields.items():
            rows[name][place] = value(rows[name][place]) if callable(value) else value

    return spoil


def moving(row):
    return int(row["source"]) == 0 and int(row["status"]) == BodyStatus.KNOWN


def fixed(row):
    return int(row["source"]) == 0xFFFFFFFF


def gone_state(world, ticks):
    """A tick that says clear though bodies collide."""
    at = find(ticks, lambda told: told.tick.header.state == State.COLLIDING)
    for header in (ticks[at].tick.header, ticks[at].changes_header.message):
        header.state = State.CLEAR


def other_names(world, ticks):
    at = find(ticks, lambda told: True, 20)
    names = dict(ticks[at].names)
    names["runner"], names["shy"] = names["shy"], names["runner"]
    ticks[at].names = names


def less_names(world, ticks):
    at = find(ticks, lambda told: True, 20)
    ticks[at].names = {name: id_ for name, id_ in ticks[at].names.items() if name != "shy"}


def less_bodies(world, ticks):
    at = find(ticks, lambda told: True, 20)
    ticks[at].bodies = ticks[at].bodies[1:]


def silent(world, ticks):
    """Nothing for a quarter of an hour."""
    for told in ticks[20:]:
        told.tick.sent_ns += 900_000_000_000


def again(world, ticks):
    ticks.insert(21, ticks[19].copy())


def bare(world, ticks):
    """A tick under way that says it is clear."""
    tick = ticks[20].copy()
    tick.tick.header.tick += 1
    tick.tick.sources_len = 0
    tick.tick.header.state = State.CLEAR
    tick.changes_header = tick.contact_changes_header = None
    ticks.insert(21, tick)


def unknown_boot(world, ticks):
    ticks[5].tick.header.boot_id = 1


def void_frame(world, ticks):
    """A tick that used a frame which had to be refused."""
    source = source_rows(ticks[30].tick)["sim"]
    frame = world.ledger.of_order("sim", source.session, (source.epoch, source.seq))
    object.__setattr__(frame, "void", True)


def not_the_next(world, ticks):
    """A frame without a tick of its own, and nothing said of it: that tick is taken out."""
    del ticks[30]
    for told in ticks[30:]:
        told.tick.header.tick -= 1
        for row in source_rows(told.tick).values():
            row.frames -= 1


def moved(place):
    """A pose that nobody sent."""
    return place + 1e-9


def stranger_id(world, ticks):
    """Every tick has another id for a body."""
    for told in ticks:
        told.names = {name: id_ if name != "shy" else 99 for name, id_ in told.names.items()}


def lost_pair(world, ticks):
    """The possible pair of a body that may be anywhere is dropped."""
    lost = {int(row["body"]) for told in ticks for row in told.bodies if int(row["status"]) == BodyStatus.STALE}

    def fits(row):
        return int(row["verdict"]) == Verdict.POSSIBLE and bool(lost & set(ids_of(row)))

    at = find(ticks, lambda told: row_of(told.pairs, fits) is not None)
    ticks[at + 1].pairs = np.delete(ticks[at + 1].pairs, row_of(ticks[at + 1].pairs, fits))


def spoil_changes(name, by):
    def spoil(world, ticks):
        at = find(ticks, lambda told: told.changes_header is not None and told.changes_header.base_tick > 0, 20)
        setattr(ticks[at].changes_header, name, getattr(ticks[at].changes_header, name) + by)

    return spoil


def kept_row(world, ticks):
    """``changes`` have a row of which ``pairs`` say something else."""
    at = find(
        ticks, lambda told: told.changes is not None and len(told.changes) > 0 and told.changes_header.base_tick, 20
    )
    ticks[at].changes["begin_first_tick"] += 1


def kept_contact(world, ticks):
    """``contact_changes`` have a contact of which ``contacts`` say something else."""
    at = find(ticks, lambda told: told.contact_changes is not None and told.contact_changes_header.base_tick, 20)
    at = find(ticks, lambda told: bool((told.contact_changes["kind"] == ContactKind.CONTACT).any()), at)
    ticks[at].contact_changes["gap_m"] -= 1e-12


def forgotten_contact(world, ticks):
    """A pair whose contacts are gone is not told."""

    def gone(told):
        return told.contact_changes["kind"] == ContactKind.GONE

    at = find(ticks, lambda told: told.contact_changes is not None and bool(gone(told).any()), 20)
    ticks[at].contact_changes = ticks[at].contact_changes[~gone(ticks[at])]


def spoil_contact(field, by):
    def spoil(world, ticks):
        def fits(row):
            exact = not int(row["flags"]) & ContactFlags.ESTIMATE
            return exact and int(row["kind"]) == ContactKind.CONTACT

        at = find(ticks, lambda told: told.contacts is not None and row_of(told.contacts, fits) is not None)
        rows = ticks[at].contacts
        rows[field][row_of(rows, fits)] += by

    return spoil


def less_regions(world, ticks):
    at = find(ticks, lambda told: told.regions is not None and len(told.regions) > 0)
    ticks[at].regions = ticks[at].regions[:0]


def less_contacts(world, ticks):
    at = find(ticks, lambda told: unlimited(told) and told.contacts is not None and len(told.contacts) > 0)
    ticks[at].contacts = ticks[at].contacts[:0]


def out_of_order(world, ticks):
    at = find(ticks, lambda told: len(told.pairs) > 1)
    ticks[at].pairs = ticks[at].pairs[::-1]


def jumped(told):
    """The tick after this one would have a frame of a jump."""
    return int(told.tick.reasons) >> 9 & 1


FAR = 1e6
SPOILT = {
    "order": again,
    "repeated": spoil_header(state=State.POSSIBLE),
    "revision": spoil_header(scene_rev=77),
    "silence": silent,
    "bare": bare,
    "boot": unknown_boot,
    "count": spoil_tick(lambda told: told.tick.colliding > 0, colliding=lambda was: was - 1),
    "reason": spoil_tick(reasons=lambda was: was ^ 1),
    "state": gone_state,
    "worst": spoil_tick(lambda told: told.tick.colliding > 0, worst_a=0),
    "undecided": spoil_row(is_of(Verdict.COLLIDING), unlimited, gap_max_m=1.0, verdict=Verdict.POSSIBLE),
    "oldest": spoil_tick(oldest_undecided_ticks=7),
    "widest": spoil_tick(lambda told: told.tick.widest_m > 0.0, widest_m=-1.0),
    "units": spoil_tick(budget_units=5),
    "budget": spoil_tick(budget_ns=10_000_000_000),
    "overrun": spoil_tick(overrun=lambda was: 1 - was),
    "late": spoil_tick(missed=lambda was: was + 1),
    "sources": spoil_source(name=(65,)),
    "session": spoil_source(session=5),
    "frame": void_frame,
    "frames": spoil_source(frames=0),
    "lockstep": spoil_tick(lambda told: told.tick.cause == TickCause.FRAME, 20, cause=TickCause.HEARTBEAT),
    "silent": not_the_next,
    "rebuilds": spoil_tick(rebuilds=1),
    "alive": spoil_source(lambda row: row.alive, alive=0),
    "age": spoil_source(lambda row: row.age_ns > 700_000_000, "arm", age_ns=0),
    "names": less_names,
    "ids": other_names,
    "bodies": less_bodies,
    "generation": spoil_body(moving, generation=2),
    "status": spoil_body(moving, status=BodyStatus.HELD),
    "pose": spoil_body(moving, position=moved),
    "body_verdict": spoil_body(lambda row: int(row["verdict"]) == Verdict.COLLIDING, verdict=Verdict.APART),
    "rows": out_of_order,
    "row": spoil_row(is_of(Verdict.COLLIDING), gap_max_m=0.5),
    "interval": spoil_row(is_of(Verdict.NEAR), gap_min_m=0.2),
    "missed": drop_row(is_of(Verdict.COLLIDING)),
    "unbounded": lost_pair,
    "balance": spoil_row(is_of(Verdict.COLLIDING, event=Event.BEGIN), events=1 << Event.PERSIST),
    "way": spoil_row(is_of(Verdict.APART, PairFlags.SWEPT_HIT), toi_min=0.0, toi_max=0.01),
    "untold": drop_row(is_of(Verdict.APART, PairFlags.SWEPT_HIT)),
    "teleport": spoil_tick(jumped, reasons=lambda was: was & ~(1 << 9)),
    "base": spoil_changes("base_tick", -1),
    "listed": spoil_changes("listed", 1),
    "changes": kept_row,
    "contact_changes": kept_contact,
    "contact": spoil_contact("point_a", FAR),
    "region": less_regions,
}
#: More ways to spoil a run, which the check of that name has to find as well.
MORE = {
    "an end without its begin": ("balance", spoil_row(is_of(Verdict.COLLIDING), events=1 << Event.END, end_cause=1)),
    "a begin told twice": (
        "balance",
        spoil_row(is_of(Verdict.COLLIDING, event=Event.PERSIST), events=1 << Event.BEGIN),
    ),
    "an end that never was": ("balance", drop_row(parted)),
    "an end by a cause that never was": ("balance", spoil_row(parted, end_cause=EndCause.RESET)),
    "a begin in a tick when it was not so any more": (
        "balance",
        spoil_row(is_of(Verdict.COLLIDING, event=Event.BEGIN), begin_last_tick=1),
    ),
    "a collision told as clear": ("row", spoil_row(is_of(Verdict.COLLIDING), verdict=Verdict.APART)),
    "a gap that is less than the truth": ("interval", spoil_row(is_of(Verdict.COLLIDING), gap_max_m=-0.49)),
    "an id that is not the least": ("ids", stranger_id),
    "a fixed body that moved": ("status", spoil_body(fixed, position=moved)),
    "a normal of no unit length": ("contact", spoil_contact("normal", 0.1)),
    "more work than was there": ("units", spoil_tick(lambda told: told.tick.budget_units == 0, units=9)),
    "contacts that are gone and not told": ("listed", forgotten_contact),
    "a collision without contact": ("undecided", less_contacts),
    "a possible pair that is dropped": ("missed", drop_row(is_of(Verdict.POSSIBLE), ("sinker", "floor"))),
    "an open way that is dropped": ("untold", drop_row(has_open_way, ("shot", "wall"))),
}


@pytest.mark.parametrize("check", sorted(SPOILT))
def test_what_is_spoilt_is_found_by_its_check(run, check):
    is_found(run, check, SPOILT[check])


@pytest.mark.parametrize("what", sorted(MORE))
def test_so_is_what_is_spoilt_in_other_ways(run, what):
    is_found(run, *MORE[what])


def is_found(run, check, spoil):
    world, ticks = copy.deepcopy(run.world), [told.copy() for told in run.ticks]
    spoil(world, ticks)
    found = checked(world, ticks, check)
    assert check in {fault.check for fault in found}, [str(fault) for fault in found[:5]]
    for fault in found:
        assert fault.told and fault.truth and str(fault.tick) in str(fault)


def test_ends_that_a_client_tells_at_a_restart_are_those_of_what_collided(run):
    boots = [told.boot for told in run.ticks]
    last = boots.index(boots[-1]) - 1
    checker = Checker(copy.deepcopy(run.world))
    for told in run.ticks[: last + 1]:
        checker.take(told.copy())
    ends = np.array(sorted(checker.open), np.uint64).reshape(-1, 2)
    assert len(ends) > 0
    assert copy.deepcopy(checker).restarted(ends) == []
    assert {fault.check for fault in copy.deepcopy(checker).restarted(ends[1:])} == {"restart"}


def test_readers_that_have_not_the_same_of_a_tick_are_found(run):
    agreement, told = Agreement(), run.ticks[20]
    assert agreement.check(told) == [] and agreement.check(told.copy()) == []
    other = told.copy()
    other.bodies["position"][0] += 1.0
    assert [fault.who for fault in agreement.check(other)] == ["bodies"]


def test_answers_that_do_not_hold_are_found(run):
    moment = Moment(run.ticks[20], run.world)
    a, b = (moment.names.index(name) for name in ("runner", "kerb"))
    gap = float(moment.gaps[a, b])
    answer = {"gap_min_m": gap - 1e-9, "gap_max_m": gap + 1e-9, "verdict": Verdict.APART}
    assert list(check_answers.check_gap(moment, ("runner", "kerb"), answer)) == []
    for spoilt in (
        {"gap_min_m": gap + 1e-3, "gap_max_m": gap + 1.0},
        {"gap_max_m": None},
        {"verdict": Verdict.POSSIBLE},
    ):
        found = list(check_answers.check_gap(moment, ("runner", "kerb"), {**answer, **spoilt}))
        assert {fault.check for fault in found} == {"answer_gap"}, spoilt
    row = {"b": "kerb", **answer}
    whole = {"rows": [row], "unknown": [], "complete": True}
    found = list(check_answers.check_touching(moment, "runner", gap + 1.0, whole))
    assert "`kerb`" not in str(found), "it has a row that holds"
    for spoilt in ({"rows": []}, {"rows": [{**row, "gap_min_m": gap + 1e-3}]}):
        found = list(check_answers.check_touching(moment, "runner", gap + 1.0, {**whole, **spoilt}))
        assert any(fault.check == "answer_touching" and "`kerb`" in fault.who for fault in found), spoilt


def test_every_check_there_is_has_been_seen_to_fail():
    folder = Path(soak_checker.__file__).parent
    text = "".join(path.read_text() for path in folder.glob("*.py"))
    there = set(re.findall(r'(?:Fault|fault|_equal)\(\s*(?:now, |now\.number, name, )?"(\w+)"', text))
    assert there - OF_DRIVER == set(SPOILT) | BY_THEMSELVES
