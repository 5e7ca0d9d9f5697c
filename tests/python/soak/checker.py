"""Holds every tick that one reader receives against the contract, the formulas and the ticks before it."""

from __future__ import annotations

from collections import Counter, deque
from typing import Optional

import numpy as np
from sweepd import layout

from . import check_bodies, check_pairs, check_places, check_tick, check_ways
from .check_changes import Contacts, Listing, compare, compare_contacts
from .check_events import Balance, Ids
from .faults import Fault
from .moment import Moment
from .told import Told
from .world import World

#: Moments that an answer may be about: it is told some ticks later.
_RECENT = 32
_PAIR = np.dtype(layout.PairRow)
_CONTACT = np.dtype(layout.ContactRow)


class Checker:
    """The checks of one reader; what it does not listen to is not checked."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._before: Optional[Told] = None
        self._moment: Optional[Moment] = None
        #: The newest moments, the last at the end.
        self.recent: deque[Moment] = deque(maxlen=_RECENT)
        self._listing, self._contacts = Listing(), Contacts()
        self._balance, self._is_balanced = Balance(), False
        self._losses = check_tick.Losses()
        #: What was looked at, and what could not be.
        self.counts: Counter[str] = Counter()

    @property
    def open(self) -> set[Ids]:
        """Pairs whose collisions are told and have not ended."""
        return self._balance.open

    def take(self, told: Told) -> list[Fault]:
        """Checks a tick; what is wrong with it, each thing once."""
        self.counts["ticks"] += 1
        boot = self._world.boot(told.boot)
        if boot is None:
            return [Fault("boot", told.number, "the tick", f"boot {told.boot:x}", "no such daemon was started")]
        if self._before is not None and self._before.boot != told.boot:
            self._begin_anew()
        before = self._before
        faults = list(check_tick.check_order(told, before, self._world))
        if told.is_bare:
            self.counts["bare ticks"] += 1
            return [*faults, *check_tick.check_bare(told)]
        if told.tick.header.scene_rev not in boot.scenes:
            return faults
        followed = before is not None and before.number + 1 == told.number
        self.counts["ticks with more units"] += int(told.tick.units > told.tick.budget_units)
        self.counts["ticks missed"] += int(before is not None and not followed)
        faults += check_tick.check_budget(told, before, self._world)
        faults += check_tick.check_sources(told, before, self._world)
        if followed and before is not None:
            faults += self._losses.check(told, before, self._world)
        faults += check_bodies.check_names(told, self._world)
        faults += self._take_lists(told, followed)
        # where even the bodies are not those of the scene nothing can be said of their pairs
        if told.bodies is not None and not {"names", "sources"} & {fault.check for fault in faults}:
            faults += self._take_bodies(told, followed)
        else:
            self._moment, self._is_balanced = None, False
        self._before = told
        return faults

    def restarted(self, ends: np.ndarray) -> list[Fault]:
        """The client has told that the daemon is another; ``ends``: pairs whose collisions ended with the old one."""
        told = {(int(a), int(b)) for a, b in ends}
        wanted = self.open
        faults = []
        number = self._before.number if self._before is not None else 0
        # of rows that found no room the client knows nothing
        whole = self._moment is not None and self._moment.told.tick.header.truncated == 0
        if self._is_balanced and whole and told != wanted:
            text = f"ends of {sorted(told - wanted)} too many, {sorted(wanted - told)} missing"
            faults.append(Fault("restart", number, "the client", text, "each pair that collided last has ended"))
        self._begin_anew()
        return faults

    def _begin_anew(self) -> None:
        self._before = self._moment = None
        self._listing, self._contacts = Listing(), Contacts()
        self._balance, self._is_balanced = Balance(), False
        self._losses = check_tick.Losses()

    def _take_lists(self, told: Told, followed: bool) -> list[Fault]:
        """What is kept from messages of what is new; where that is all there is, it stands for the whole from here on."""
        faults = list(self._listing.take(told, followed))
        if self._listing.of == (told.boot, told.number):
            rows = self._listing.rows(told.number, _PAIR)
            self.counts["lists from changes"] += 1
            if told.pairs is None:
                told.pairs = rows
            else:
                faults += compare(told, rows)
        faults += self._contacts.take(told, followed)
        if self._contacts.of == (told.boot, told.number):
            rows = self._contacts.rows(_CONTACT)
            self.counts["contacts from changes"] += 1
            if told.contacts is None:
                told.contacts = rows
            else:
                faults += compare_contacts(told, rows)
        return faults

    def _take_bodies(self, told: Told, followed: bool) -> list[Fault]:
        moment, before = Moment(told, self._world), self._moment if followed else None
        faults = list(check_bodies.check_bodies(moment, before))
        if {"bodies", "pose", "session"} & {fault.check for fault in faults}:
            # nothing that builds on poses can be judged
            self._moment, self._is_balanced = None, False
            return faults
        faults += check_tick.check_counts(moment)
        faults += check_bodies.check_verdicts(moment)
        faults += check_pairs.check_rows(moment)
        faults += check_pairs.check_truth(moment)
        faults += check_pairs.check_decided(moment)
        faults += check_places.check_contacts(moment)
        faults += check_places.check_regions(moment)
        if before is not None:
            faults += check_pairs.check_unbounded(moment, before)
            faults += check_ways.check_ways(moment, before)
        faults += self._take_events(moment, before)
        self._count(moment)
        self._moment = moment
        self.recent.append(moment)
        return faults

    def _take_events(self, moment: Moment, before: Optional[Moment]) -> list[Fault]:
        if moment.list is None:
            self._is_balanced = False
            return []
        if before is not None and self._is_balanced:
            return list(self._balance.check(moment, before))
        # who begins to listen while rows are left out does not know which collisions are told
        self._is_balanced = moment.told.tick.header.truncated == 0
        self._balance.restart(moment.list)
        return []

    def _count(self, moment: Moment) -> None:
        rows = moment.list
        if rows is None:
            return
        self.counts["ticks whole"] += 1
        self.counts["rows"] += len(rows)
        self.counts["possible"] += int(np.count_nonzero(rows["verdict"] == layout.Verdict.POSSIBLE))
        for event in layout.Event:
            self.counts[event.name.lower()] += int(np.count_nonzero(rows["events"] >> event & 1))
        for flag in layout.PairFlags:
            self.counts[flag.name.lower()] += int(np.count_nonzero(rows["flags"] & int(flag)))
        for cause in rows["end_cause"][rows["end_cause"] > 0]:
            self.counts[f"end {layout.EndCause(int(cause)).name.lower()}"] += 1
        self.counts[f"state {layout.State(moment.told.tick.header.state).name.lower()}"] += 1
