"""What whoever drives the daemon knows of it: how it was started, which scene each revision is, what was sent."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Optional

from .ledger import Ledger
from .scene import Scene, Source


class Change(NamedTuple):
    """What an edit did, for the causes of ends."""

    removed: frozenset[str] = frozenset()
    disabled: frozenset[str] = frozenset()
    #: Sources whose poses were forgotten.
    reset: frozenset[str] = frozenset()


NOTHING = Change()


@dataclass(frozen=True)
class Setup:
    """How a daemon was started."""

    mode: str
    sources: tuple[Source, ...]
    #: Of ``on_frame``.
    lead: Optional[str] = None
    budget_ns: Optional[int] = None
    budget_units: Optional[int] = None
    heartbeat_ms: int = 100
    #: Limit of rows of ``pairs``; None: none that counts.
    pair_rows: Optional[int] = None
    #: What the scene file does not say: the default.
    stale_reach_m: float = 1.0

    def source(self, name: str) -> Source:
        """A source by name."""
        return next(source for source in self.sources if source.name == name)


@dataclass
class Boot:
    """A start of the daemon."""

    setup: Setup
    #: By revision, from 1.
    scenes: dict[int, Scene]
    changes: dict[int, Change] = field(default_factory=dict)
    #: How often each name was put, by revision too.
    puts: dict[int, dict[str, int]] = field(default_factory=dict)
    #: Ids that were ever told, by name.
    ids: dict[str, int] = field(default_factory=dict)

    @property
    def newest(self) -> int:
        """The newest revision."""
        return max(self.scenes)

    @property
    def scene(self) -> Scene:
        """The scene as it is now."""
        return self.scenes[self.newest]

    def changes_between(self, after: int, to: int) -> Change:
        """All that was done behind a revision and up to another."""
        done = [self.changes[rev] for rev in range(after + 1, to + 1) if rev in self.changes]
        unite = lambda sets: frozenset().union(*sets)  # noqa: E731
        return Change(*(unite(change[at] for change in done) for at in range(3)))


class World:
    """Every boot, and the ledger."""

    def __init__(self) -> None:
        self.ledger = Ledger()
        self.boots: dict[int, Boot] = {}
        self._next: Optional[Boot] = None

    def expect(self, setup: Setup, scene: Scene) -> None:
        """A daemon is about to be started with a scene."""
        self._next = Boot(setup, {1: scene}, puts={1: {name: 1 for name in scene.bodies}})

    def boot(self, boot_id: int) -> Optional[Boot]:
        """The boot of an id: what is heard first is that which was expected; None where none was."""
        if boot_id not in self.boots and self._next is not None:
            self.boots[boot_id], self._next = self._next, None
        return self.boots.get(boot_id)

    def edited(self, boot_id: int, revision: int, scene: Scene, change: Change, put: tuple[str, ...] = ()) -> None:
        """An edit was answered."""
        boot = self.boots[boot_id]
        puts = boot.puts[boot.newest]
        boot.puts[revision] = {**puts, **{name: puts.get(name, 0) + 1 for name in put}}
        boot.scenes[revision] = scene
        boot.changes[revision] = change
