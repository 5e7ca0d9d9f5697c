"""What stands for a daemon in tests of the client's own bookkeeping."""

from types import SimpleNamespace


def inbox_of(topics, *, boot, tick, message):
    """An inbox of a client of that boot: ``tick()`` and ``message(topic)`` give what waits there, or None."""
    from sweepd.inbox import Inbox

    ports = SimpleNamespace(
        hello=SimpleNamespace(boot_id=boot),
        subscribe=lambda *_: None,
        tick=tick,
        message=message,
        wait=lambda _: None,
    )
    return Inbox(ports, topics, until=0)
