"""What is wrong, in words that are enough to look into it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One thing that does not hold.

    * ``check``: which check found it. ``who``: the pair, body or source, by name. ``told``: what the rows say.
      ``truth``: what the formula, the ledger or the contract says.
    """

    check: str
    tick: int
    who: str
    told: str
    truth: str

    def __str__(self) -> str:
        return f"[{self.check}] tick {self.tick}, {self.who}\n    told:  {self.told}\n    truth: {self.truth}"
