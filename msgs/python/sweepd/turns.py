"""Who may use a client: one thread at a time."""

import functools
import threading

from .errors import SweepdError


class Turns:
    """Lets one thread in, as deep as it likes, and refuses others meanwhile."""

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


def in_turn(method):
    """A method of what has ``_turns``, for one thread at a time."""

    @functools.wraps(method)
    def call(self, *args, **kwargs):
        with self._turns:
            return method(self, *args, **kwargs)

    return call
