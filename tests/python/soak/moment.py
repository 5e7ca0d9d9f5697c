"""A tick together with all that is known of the world at its poses."""

from __future__ import annotations

import functools
from typing import Optional

import numpy as np
from sweepd.layout import BodyStatus, PairFlags, Verdict

from .ledger import Frame
from .scene import Body, Scene
from .told import Told, ids_of, source_rows
from .world import World

#: No end of time or units.
NO_LIMIT = 0xFFFF_FFFF_FFFF_FFFF
#: Where a body is placed for certain, as the tick sees it.
PLACED = (BodyStatus.KNOWN, BodyStatus.HELD)
#: Takes part in pairs, wherever it may be.
THERE = (*PLACED, BodyStatus.STALE, BodyStatus.REJECTED)


class Moment:
    """A tick whose bodies were listened to. Lists and matrices go by the bodies' ids."""

    def __init__(self, told: Told, world: World) -> None:
        assert told.bodies is not None
        self.told = told
        self.world = world
        self.boot = world.boots[told.boot]
        self.setup = self.boot.setup
        self.scene: Scene = self.boot.scenes[told.tick.header.scene_rev]
        self.sources = source_rows(told.tick)
        self.rows = told.bodies
        self.status = self.rows["status"]
        by_id = {id_: name for name, id_ in told.names.items()}
        self.names = [by_id.get(int(id_), f"id {id_}") for id_ in self.rows["body"]]
        self.place = {int(id_): at for at, id_ in enumerate(self.rows["body"])}
        self._frames: dict[tuple[str, int], Optional[Frame]] = {}

    @property
    def tick(self) -> int:
        """Number of the tick."""
        return self.told.number

    @property
    def is_unlimited(self) -> bool:
        """Whether its work had no end."""
        return self.told.tick.budget_ns == NO_LIMIT and self.told.tick.budget_units == NO_LIMIT

    def body(self, at: int) -> Optional[Body]:
        """What the scene says of a body; None where it has none of the name."""
        return self.scene.bodies.get(self.names[at])

    def frame(self, at: int) -> Optional[Frame]:
        """The frame that a body's pose is of, by its stamp; None where no such frame was sent."""
        body = self.body(at)
        if body is None or body.source is None:
            return None
        key = (body.source, int(self.rows["stamp_ns"][at]))
        if key not in self._frames:
            self._frames[key] = self.world.ledger.of_stamp(*key)
        return self._frames[key]

    def who(self, a: int, b: int) -> str:
        """A pair in words, by places."""
        told = [f"`{self.names[at]}` ({BodyStatus(int(self.status[at])).name.lower()})" for at in (a, b)]
        return " and ".join(told)

    def who_by_ids(self, ids: tuple[int, int]) -> str:
        """A pair in words, by ids."""
        places = [self.place.get(id_) for id_ in ids]
        if None in places:
            return f"pair {ids}"
        return self.who(*places)  # type: ignore[arg-type]

    @functools.cached_property
    def order(self) -> np.ndarray:
        """Places of the bodies in the scene's own order."""
        places = {name: at for at, name in enumerate(self.scene.names)}
        return np.array([places[name] for name in self.names], np.intp)

    @functools.cached_property
    def order_place(self) -> np.ndarray:
        """The other way round: of each body in the scene's order its place by ids."""
        return np.argsort(self.order)

    @functools.cached_property
    def allowed(self) -> np.ndarray:
        """Pairs that are checked."""
        return self.scene.pairs.allowed[np.ix_(self.order, self.order)]

    @functools.cached_property
    def report_m(self) -> np.ndarray:
        """Below which gap pairs are near."""
        return self.scene.pairs.report_m[np.ix_(self.order, self.order)]

    @functools.cached_property
    def placed(self) -> np.ndarray:
        """Bodies whose pose is that of the tick."""
        return np.isin(self.status, PLACED)

    @functools.cached_property
    def there(self) -> np.ndarray:
        """Bodies that take part; of a refused one that depends on whether it ever had a pose."""
        return np.isin(self.status, THERE)

    @functools.cached_property
    def reach_m(self) -> np.ndarray:
        """How far each body may be from its pose."""
        reach = np.where(self.placed, 0.0, np.inf)
        for at in np.flatnonzero(self.status == BodyStatus.STALE):
            body = self.body(int(at))
            if body is not None and body.max_speed_mps is not None:
                far_m = body.max_speed_mps * float(self.rows["age_ns"][at]) * 1e-9
                reach[at] = far_m if far_m <= self.setup.stale_reach_m else np.inf
        return reach

    def pose_of(self, at: int) -> Optional[tuple[tuple[float, ...], tuple[float, ...]]]:
        """The pose that a body has by what was sent, or stands at by the scene; None: none is known."""
        body = self.body(at)
        if body is None:
            return None
        if body.source is None:
            return body.path.at(0)
        frame = self.frame(at)
        return None if frame is None or not frame.moves(body.name) else frame.poses[body.name]

    @functools.cached_property
    def centres(self) -> np.ndarray:
        """Centres of all parts in the scene's order, NaN where no pose is known."""
        count = len(self.scene.names)
        positions, orientations = np.full((count, 3), np.nan), np.ones((count, 4))
        for at in range(len(self.names)):
            pose = self.pose_of(at)
            if pose is not None and self.there[at]:
                positions[self.order[at]], orientations[self.order[at]] = pose
        return self.scene.forms.centres(positions, orientations)

    @functools.cached_property
    def gaps(self) -> np.ndarray:
        """True gap of each two bodies at the tick's poses, NaN where one has none."""
        with np.errstate(invalid="ignore"):
            return self.scene.forms.gaps(self.centres)[np.ix_(self.order, self.order)]

    @functools.cached_property
    def slack_m(self) -> np.ndarray:
        """How far rounding may have put each of these gaps from the truth; 0 where it is exact."""
        known = self.centres[np.isfinite(self.centres).all(axis=1)]
        slack = np.full(self.gaps.shape, self.scene.forms.slack(known))
        bodies = list(self.scene.bodies.values())
        exact = np.array([body.dyadic and self.scene.forms.box_alone[at] for at, body in enumerate(bodies)], bool)
        first = {int(owner): at for at, owner in reversed(list(enumerate(self.scene.forms.owner)))}
        for i in np.flatnonzero(exact):
            for j in np.flatnonzero(exact[:i]):
                a, b = first[int(i)], first[int(j)]
                half = self.scene.forms.half[a] + self.scene.forms.half[b]
                over = np.abs(self.centres[a] - self.centres[b]) - half
                if np.count_nonzero(over > 0.0) <= 1:
                    at = np.flatnonzero(self.order == i)[0], np.flatnonzero(self.order == j)[0]
                    slack[at] = slack[at[::-1]] = 0.0
        return slack

    @functools.cached_property
    def list(self) -> Optional[np.ndarray]:
        """Rows of the list of pairs, whichever message they came with."""
        return self.told.pairs

    @functools.cached_property
    def by_ids(self) -> dict[tuple[int, int], np.void]:
        """The same by ids."""
        return {ids_of(row): row for row in (self.list if self.list is not None else ())}

    @functools.cached_property
    def at_rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows of two bodies of the scene, but for pairs that are gone: which they are, and the places of A and B."""
        rows = self.list
        if rows is None:
            return (np.empty(0, np.intp),) * 3
        kept = [
            (at, self.place[int(row["body_a"])], self.place[int(row["body_b"])])
            for at, row in enumerate(rows)
            if not int(row["flags"]) & PairFlags.GONE
            and int(row["body_a"]) in self.place
            and int(row["body_b"]) in self.place
        ]
        return tuple(np.array(column, np.intp) for column in zip(*kept)) if kept else (np.empty(0, np.intp),) * 3

    @functools.cached_property
    def listed(self) -> np.ndarray:
        """Pairs whose row says more than that they are apart."""
        listed = np.zeros((len(self.names),) * 2, bool)
        if self.list is not None:
            which, a, b = self.at_rows
            more = self.list["verdict"][which] > Verdict.APART
            listed[a[more], b[more]] = listed[b[more], a[more]] = True
        return listed
