"""The driver of the soak waits for frames of a session, not for its newest alone."""

from types import SimpleNamespace

import pytest
from needed import needed

needed("numpy")
needed("sweepd")

from soak.driver import Report, Soak  # noqa: E402


class Behind:
    """A reader whose ticks are so many frames behind what is sent."""

    def __init__(self, source, behind):
        self.source, self.behind, self.told = source, behind, None

    def drain(self, _wait_s):
        return []

    def has_used(self, _name, session, order):
        epoch, seq = self.source.last
        return session == self.source.session and (epoch, seq - self.behind) >= max(order, (epoch, 1))


class OneSource(Soak):
    """A driver of one source, without a daemon."""

    def __init__(self, behind):
        self.report = Report(0, "on_frame", 0.0)
        self.source = SimpleNamespace(name="sim", session=7, last=(0, 1), is_heard=False)
        self.own = {"sim": self.source}
        self.setup = SimpleNamespace(lead=None)
        self.daemon = SimpleNamespace(ended=False)
        self.readers = [Behind(self.source, behind)]
        self.sent = 0

    def _send(self, source):
        self.sent += 1
        source.last = (0, source.last[1] + 1)
        # the reader may have caught up with all frames once no more come
        if source.is_heard:
            self.readers[0].behind = 0
        return True


@pytest.mark.parametrize("behind", [1, 5])
def test_bug_a_source_is_heard_once_any_frame_of_its_session_was_used(behind):
    soak = OneSource(behind)
    assert not soak.await_used([soak.source], patience_s=0.2)
    assert soak.source.is_heard and soak.sent == behind, "no more is sent than until a tick used one"
    soak.readers[0].behind = 0
    soak.report.faults.clear()
    assert soak.await_used([soak.source], patience_s=0.2)


def test_a_source_that_no_tick_used_is_not_heard():
    soak = OneSource(1 << 30)
    assert not soak.await_used([soak.source], patience_s=0.2)
    assert not soak.source.is_heard and soak.sent > 5
    assert [fault.check for fault in soak.report.faults] == ["answer"]
