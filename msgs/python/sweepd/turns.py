"""Who may use a client: one thread at a time."""

from __future__ import annotations

import functools
import threading
from typing import Any, Callable, TypeVar

from .errors import SweepdError

_Method = TypeVar("_Method", bound=Callable[..., Any])


class Turns:
    """Lets one thread in, as often nested as it likes, and refuses others meanwhile."""

    def __init__(self):
        self._lock = threading.RLock()

    def __reduce__(self):
        # a copy of what has turns is another thing, and has its own
        return Turns, ()

    def __enter__(self):
        if not self._lock.acquire(blocking=False):
            raise SweepdError(
                "another thread is using this client: give each thread a client of its own, or let them take turns"
            )

    def __exit__(self, *_exception):
        self._lock.release()


def in_turn(method: _Method) -> _Method:
    """Lets one thread at a time into a method of an object that has ``_turns``."""

    @functools.wraps(method)
    def call(self, *args, **kwargs):
        with self._turns:
            return method(self, *args, **kwargs)

    return call  # type: ignore[return-value]
