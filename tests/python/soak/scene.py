"""The scene as whoever edits it knows it: bodies, rules, what they mean for pairs, and how both are written."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any, Iterable, Mapping, NamedTuple, Optional

import numpy as np

from .paths import Path
from .shapes import Forms, Part, Plane

ALL_GROUPS = 0xFFFFFFFF


@dataclass(frozen=True)
class Body:
    """A body and its path; one without a source stands still where its path begins."""

    name: str
    source: Optional[str] = None
    parts: tuple[Part, ...] = ()
    plane: Optional[Plane] = None
    path: Path = Path()
    continuous: bool = False
    teleport_m: Optional[float] = None
    report_within_m: float = 0.0
    max_speed_mps: Optional[float] = None
    on_stale: Optional[str] = None
    group: int = 1
    mask: int = ALL_GROUPS
    enabled: bool = True
    #: Its coordinates have few binary places: as a box its gaps to others of the kind are exact.
    dyadic: bool = False

    @property
    def moves(self) -> bool:
        """Whether frames move it."""
        return self.source is not None

    def keys(self) -> dict[str, Any]:
        """As a scene file or a ``put`` says it."""
        shapes = [part.keys() for part in self.parts] + ([self.plane.keys()] if self.plane else [])
        keys: dict[str, Any] = {"name": self.name, "shape": shapes[0] if len(shapes) == 1 else shapes}
        if self.source is None:
            keys.update(moves=False, position=list(self.path.at(0)[0]))
        plain = Body(self.name)
        said = ["source", "teleport_m", "report_within_m", "max_speed_mps", "on_stale", "group", "mask", "enabled"]
        said += ["continuous"]
        keys.update((key, getattr(self, key)) for key in said if getattr(self, key) != getattr(plain, key))
        return keys


class Rule(NamedTuple):
    """A pair rule; its sides are names or patterns."""

    action: str
    a: str
    b: str
    report_within_m: Optional[float] = None

    def speaks_of(self, a: str, b: str) -> bool:
        """Whether it is about this pair, in either order."""
        either = [(self.a, self.b), (self.b, self.a)]
        return any(fnmatchcase(a, one) and fnmatchcase(b, other) for one, other in either)

    def keys(self) -> dict[str, Any]:
        """As the scene says it."""
        keys = {"action": self.action, "a": self.a, "b": self.b, "reason": "soak"}
        return keys if self.report_within_m is None else {**keys, "report_within_m": self.report_within_m}


class Source(NamedTuple):
    """A source of the scene file."""

    name: str
    timeout_ms: int
    on_stale: str = "unknown"


class Pairs(NamedTuple):
    """What the filters say of each two bodies, by their places in a list."""

    allowed: np.ndarray
    report_m: np.ndarray
    ignored: int


class Scene:
    """Bodies by name and rules; an edit makes another one."""

    def __init__(self, bodies: Mapping[str, Body], rules: tuple[Rule, ...] = ()) -> None:
        self.bodies = dict(bodies)
        self.rules = rules

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Names in the order of the file."""
        return tuple(self.bodies)

    @functools.cached_property
    def forms(self) -> Forms:
        """Shapes of the bodies in that order."""
        return Forms([(body.parts, body.plane) for body in self.bodies.values()])

    @functools.cached_property
    def pairs(self) -> Pairs:
        """What the filters say, in that order."""
        count = len(self.bodies)
        allowed, report = np.zeros((count, count), bool), np.zeros((count, count))
        ignored = 0
        bodies = list(self.bodies.values())
        for i, a in enumerate(bodies):
            for j, b in enumerate(bodies[:i]):
                if not (a.moves or b.moves) or (a.plane and b.plane):
                    continue
                rule = next((rule for rule in reversed(self.rules) if rule.speaks_of(a.name, b.name)), None)
                ignored += rule is not None and rule.action == "ignore"
                masks = bool(a.group & b.mask) and bool(b.group & a.mask)
                checked = masks if rule is None else rule.action == "check"
                within_m = max(a.report_within_m, b.report_within_m)
                if rule is not None and rule.report_within_m is not None:
                    within_m = rule.report_within_m
                allowed[i, j] = allowed[j, i] = checked and a.enabled and b.enabled
                report[i, j] = report[j, i] = within_m
        return Pairs(allowed, report, ignored)

    def of_source(self, source: str) -> list[Body]:
        """The bodies that a source moves."""
        return [body for body in self.bodies.values() if body.source == source]

    def with_body(self, body: Body) -> Scene:
        """One body put: new, or in the place of the one of its name."""
        return Scene({**self.bodies, body.name: body}, self.rules)

    def without(self, name: str) -> Scene:
        """One body removed."""
        return Scene({key: body for key, body in self.bodies.items() if key != name}, self.rules)

    def changed(self, name: str, **fields: Any) -> Scene:
        """One body told something else."""
        return self.with_body(replace(self.bodies[name], **fields))

    def with_rule(self, rule: Rule) -> Scene:
        """One rule more, behind all others."""
        return Scene(self.bodies, (*self.rules, rule))

    def without_rules(self, a: str, b: str) -> Scene:
        """Without the rules of these two sides."""
        return Scene(self.bodies, tuple(rule for rule in self.rules if {rule.a, rule.b} != {a, b}))

    def toml(self, run: Iterable[str], limits: Mapping[str, int], sources: Iterable[Source]) -> str:
        """The scene file; ``run`` are lines of ``[run]``."""
        lines = ["[run]", *run]
        if limits:
            lines += ["[limits]", *(f"{key} = {value}" for key, value in limits.items())]
        for source in sources:
            lines += ["[[source]]", *(f"{key} = {_toml(value)}" for key, value in source._asdict().items())]
        for body in self.bodies.values():
            lines += ["[[body]]", *(f"{key} = {_toml(value)}" for key, value in body.keys().items())]
        for rule in self.rules:
            lines += ["[[rule]]", *(f"{key} = {_toml(value)}" for key, value in rule.keys().items())]
        return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    # true, numbers and strings are written as in JSON
    return json.dumps(value)
