"""What was sent: every frame of every source, so that a tick's poses are known from the numbers it says it used."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from typing import Callable, Mapping, Optional

from .paths import Pose

#: Frames kept: many more than queues hold, and none that is not in use by then.
_KEPT = 4_000
#: Stamps that are kept free for each process that sends by itself.
CHILD_STAMPS = 10_000_000


@dataclass(frozen=True)
class Frame:
    """A frame as it was sent.

    * ``stamp``: its number among all of its source, never 0, and the ``stamp_ns`` that it was sent with.
    * ``spoilt``: bodies whose pose in it cannot be admitted.
    * ``void``: whether it must be refused as a whole.
    * ``sent_ns``: before and after it was sent, CLOCK_BOOTTIME; None: not known.
    """

    source: str
    session: int
    epoch: int
    seq: int
    stamp: int
    poses: Mapping[str, Pose]
    spoilt: frozenset[str] = frozenset()
    full: bool = True
    paused: bool = False
    void: bool = False
    time_left_ns: int = 0
    sent_ns: Optional[tuple[int, int]] = None

    @property
    def order(self) -> tuple[int, int]:
        """Its place in its session."""
        return self.epoch, self.seq

    def moves(self, name: str) -> bool:
        """Whether it has a pose of a body that can be admitted."""
        return name in self.poses and name not in self.spoilt


@dataclass
class _Session:
    frames: list[Frame] = field(default_factory=list)
    orders: list[tuple[int, int]] = field(default_factory=list)


@dataclass(frozen=True)
class Child:
    """A process of its own that sends full frames only: the one of number ``seq`` has the poses of ``base + seq``."""

    source: str
    session: int
    base: int
    poses: Callable[[int], Mapping[str, Pose]]

    def frame(self, seq: int) -> Frame:
        """Its frame of a number."""
        stamp = self.base + seq
        return Frame(self.source, self.session, 0, seq, stamp, self.poses(stamp))


class Ledger:
    """Frames by session and by stamp."""

    def __init__(self) -> None:
        self._sessions: dict[tuple[str, int], _Session] = {}
        self._stamps: dict[tuple[str, int], Frame] = {}
        self._children: dict[tuple[str, int], Child] = {}

    def put(self, frame: Frame) -> None:
        """Takes down a frame, in the order of its session."""
        if not frame.paused:
            self._stamps[(frame.source, frame.stamp)] = frame
        if not frame.void:
            session = self._sessions.setdefault((frame.source, frame.session), _Session())
            session.frames.append(frame)
            session.orders.append(frame.order)
            if len(session.frames) > 2 * _KEPT:
                del session.frames[:_KEPT], session.orders[:_KEPT]
        if len(self._stamps) > 2 * _KEPT:
            self._stamps = dict(list(self._stamps.items())[-_KEPT:])

    def put_child(self, child: Child) -> None:
        """Takes down who sends by himself."""
        self._children[(child.source, child.session)] = child

    def knows(self, source: str, session: int) -> bool:
        """Whether anything was sent for a source in this session."""
        return (source, session) in self._children or (source, session) in self._sessions

    def of_stamp(self, source: str, stamp: int) -> Optional[Frame]:
        """The frame of a stamp, void ones too; None where none has it."""
        for child in self._children.values():
            if child.source == source and child.base < stamp < child.base + CHILD_STAMPS:
                return child.frame(stamp - child.base)
        return self._stamps.get((source, stamp))

    def of_order(self, source: str, session: int, order: tuple[int, int]) -> Optional[Frame]:
        """The frame of a number; None where none has it."""
        child = self._children.get((source, session))
        if child is not None:
            return child.frame(order[1]) if order[0] == 0 else None
        found = self.between(source, session, (order[0], order[1] - 1), order)
        return found[-1] if found and found[-1].order == order else None

    def between(self, source: str, session: int, after: tuple[int, int], to: tuple[int, int]) -> list[Frame]:
        """Frames of a session behind one and up to another, that need not be refused."""
        child = self._children.get((source, session))
        if child is not None:
            return [child.frame(seq) for seq in range(after[1] + 1, to[1] + 1)]
        kept = self._sessions.get((source, session))
        if kept is None:
            return []
        return kept.frames[bisect_right(kept.orders, after) : bisect_right(kept.orders, to)]

    def count_between(self, source: str, session: int, after: tuple[int, int], to: tuple[int, int]) -> int:
        """How many those are."""
        if (source, session) in self._children:
            return to[1] - after[1]
        return len(self.between(source, session, after, to))

    def newest_with(self, source: str, session: int, to: tuple[int, int], name: str) -> Optional[Frame]:
        """The newest frame of the epoch up to a number that moves a body."""
        child = self._children.get((source, session))
        if child is not None:
            return child.frame(to[1]) if to[1] else None
        kept = self._sessions.get((source, session))
        if kept is None:
            return None
        first = bisect_left(kept.orders, (to[0], 0))
        for frame in reversed(kept.frames[first : bisect_right(kept.orders, to)]):
            if frame.moves(name):
                return frame
        return None
