"""Talk to sweepd, a collision server, over shared memory.

``sweepd.layout`` needs only the standard library. ``sweepd.Client`` needs iceoryx2 and numpy, which are loaded when it
is first named.
"""

from typing import TYPE_CHECKING

from . import layout

if TYPE_CHECKING:
    from .client import Client, Result
    from .errors import Refused, Restarted, Skipped, SweepdError, TimedOut

__all__ = ["Client", "Refused", "Restarted", "Result", "Skipped", "SweepdError", "TimedOut", "layout"]
__version__ = "0.1.0"


def __getattr__(name):
    if name == "Client" or name == "Result":
        from . import client

        return getattr(client, name)
    if name in __all__:
        from . import errors

        return getattr(errors, name)
    raise AttributeError(f"module 'sweepd' has no attribute {name!r}")


def __dir__():
    return sorted({*globals(), *__all__})
