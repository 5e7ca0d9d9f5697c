"""Sources and readers of this process, and processes with one each."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import OrderedDict
from pathlib import Path as File
from typing import Iterable, Optional

import sweepd

from .checker import Checker
from .faults import Fault
from .ledger import CHILD_STAMPS, Child, Frame, Ledger
from .paths import Pose
from .scene import Body, Scene
from .told import Told, source_rows, told_of

#: How long a daemon may take to come, and to answer, on a busy machine, seconds.
PATIENCE_S = 60.0
#: The folder that holds this package.
_ROOT = File(__file__).resolve().parents[1]
#: Ticks remembered of what all readers have to agree on.
_AGREED = 512
#: Ticks that are taken at once: as many as a queue holds.
_DRAINED_MAX = 8
#: What is said of velocities bounds nothing.
_ANY_VELOCITY = ((0.5, 0.0, 0.0), (0.0, 0.0, 0.1))
#: No pose.
NOWHERE: Pose = ((float("nan"), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class OwnSource:
    """A source that this process drives; each frame it sends is taken down."""

    def __init__(self, instance: str, name: str, ledger: Ledger) -> None:
        self.name = name
        self._instance = instance
        self._ledger = ledger
        self._stamp = 0
        self._epoch = 0
        self.client = self._open()
        #: Order of the frame sent last; None: none in this session.
        self.last: Optional[tuple[int, int]] = None
        #: A tick used a frame of this session and epoch.
        self.is_heard = False
        #: Until when it sends nothing, monotonic seconds.
        self.quiet_until_s = 0.0
        #: Bodies that its frames leave out, and until when.
        self.absent: dict[str, float] = {}

    def _open(self) -> sweepd.Client:
        return sweepd.Client(self._instance, self.name, quat_order="xyzw", listen=(), timeout_s=PATIENCE_S)

    @property
    def session(self) -> int:
        """Its session."""
        return self.client.session

    def reopen(self, close: bool) -> sweepd.Client:
        """Begins another session; the client before is returned, closed or not."""
        old = self.client
        if close:
            old.close()
        self.client = self._open()
        self._epoch, self.last, self.is_heard = 0, None, False
        return old

    def reset_epoch(self) -> None:
        """Says with the next frame that its world was reset."""
        self.client.reset_epoch()
        self._epoch += 1
        self.is_heard = False

    def send(
        self, poses: dict[str, Pose], *, partial: bool = False, time_left_ns: int = 0, moving: bool = False
    ) -> bool:
        """Sends a frame; False where the daemon is away or another one by now.

        * ``moving``: with velocities, through the queue of those.
        """
        self._stamp += 1
        spoilt = frozenset(name for name, pose in poses.items() if pose is NOWHERE)
        before_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        rows = {name: (*pose, *_ANY_VELOCITY) for name, pose in poses.items()} if moving else poses
        try:
            seq = self.client.send(rows, stamp_ns=self._stamp, partial=partial, time_left_ns=time_left_ns)
        except (sweepd.Restarted, sweepd.TimedOut):
            return False
        sent_ns = (before_ns, time.clock_gettime_ns(time.CLOCK_BOOTTIME))
        self._put(seq, poses, spoilt=spoilt, full=not partial, time_left_ns=time_left_ns, sent_ns=sent_ns)
        return True

    def pause(self) -> None:
        """Sends a paused frame."""
        before_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        seq = self.client.pause()
        sent_ns = (before_ns, time.clock_gettime_ns(time.CLOCK_BOOTTIME))
        self._stamp += 1
        self._put(seq, {}, paused=True, full=False, sent_ns=sent_ns)

    def send_void(self, client: sweepd.Client, poses: dict[str, Pose], boot: Optional[int] = None) -> None:
        """Sends a frame that must be refused: by the client of a session that is over, or with ids of another boot.

        As one that has looked who is there right before the daemon changed.
        """
        self._stamp += 1
        rows, was = client.rows(poses), client._inbox.boot
        client._inbox.boot = was if boot is None else boot
        try:
            seq = client._send(rows, sweepd.layout.FrameFlags.FULL, {"stamp_ns": self._stamp})
        finally:
            client._inbox.boot = was
        frame = Frame(self.name, client.session, client._epoch, seq, self._stamp, poses, void=True)
        self._ledger.put(frame)

    def _put(self, seq: int, poses: dict[str, Pose], **fields: object) -> None:
        frame = Frame(self.name, self.session, self._epoch, seq, self._stamp, poses, **fields)  # type: ignore[arg-type]
        self._ledger.put(frame)
        self.last = frame.order

    def bodies(self, scene: Scene) -> list[Body]:
        """Bodies that its full frames have now."""
        now_s = time.monotonic()
        self.absent = {name: until_s for name, until_s in self.absent.items() if until_s > now_s}
        return [body for body in scene.of_source(self.name) if body.name not in self.absent]


class Agreement:
    """What all readers that have a tick have of it."""

    def __init__(self) -> None:
        self._seen: "OrderedDict[tuple[int, int, int, str], bytes]" = OrderedDict()

    def check(self, told: Told) -> list[Fault]:
        """Compares with what other readers had of the same tick."""
        rows = {"tick": bytes(told.tick), "names": json.dumps(sorted(told.names.items())).encode()}
        topics = ("pairs", "contacts", "regions", "bodies", "verdicts")
        rows.update((topic, rows_.tobytes()) for topic in topics if (rows_ := getattr(told, topic)) is not None)
        faults = []
        for topic, content in rows.items():
            key = (told.boot, told.number, told.tick.sent_ns, topic)
            if self._seen.setdefault(key, content) != content:
                text = "not what another reader has of this tick"
                faults.append(Fault("agreement", told.number, topic, text, "all readers have the same"))
        while len(self._seen) > _AGREED:
            self._seen.popitem(last=False)
        return faults


class Reader:
    """A reader whose every tick is checked."""

    def __init__(self, instance: str, topics: Iterable[str], checker: Checker, agreement: Agreement) -> None:
        self.topics = tuple(topics)
        self.checker = checker
        self._agreement = agreement
        self.client = sweepd.Client(instance, None, quat_order="xyzw", listen=self.topics, timeout_s=PATIENCE_S)
        #: The newest tick.
        self.told: Optional[Told] = None
        #: Where every tick is kept, for tests.
        self.kept: Optional[list[Told]] = None

    def drain(self, wait_s: float = 0.0) -> list[Fault]:
        """Takes the ticks that are there, or the next one where none is."""
        faults: list[Fault] = []
        # where ticks come faster than they are checked, there is always one
        for _ in range(_DRAINED_MAX):
            try:
                result = self.client.wait(wait_s)
            except sweepd.TimedOut:
                return faults
            except sweepd.Restarted as e:
                faults += self.checker.restarted(e.ends)
                continue
            told = told_of(result, self.client.names)
            if self.kept is not None:
                self.kept.append(told.copy())
            # before the checker adds what it makes of changes
            faults += self._agreement.check(told)
            faults += self.checker.take(told)
            self.told = told
            wait_s = 0.0
        return faults

    def has_used(self, source: str, session: int, order: tuple[int, int]) -> bool:
        """Whether its newest tick used this frame, or a newer one."""
        row = None if self.told is None else source_rows(self.told.tick).get(source)
        return row is not None and row.session == session and (row.epoch, row.seq) >= order

    def has_refused(self, source: str) -> bool:
        """Whether, by its newest tick, a frame of a source was refused or passed over in this boot."""
        row = None if self.told is None else source_rows(self.told.tick).get(source)
        return row is not None and row.refused + row.skipped > 0

    def close(self) -> None:
        """Frees its places."""
        self.client.close()


class Process:
    """A child process."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "soak.child", *arguments]
        self._process = subprocess.Popen(command, cwd=_ROOT, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        #: What it says once it is connected.
        self.said = self._process.stdout.readline().strip()

    def kill(self) -> None:
        """Ends it at once, whatever it is doing."""
        self._process.kill()
        self._clear_up()

    def end(self) -> None:
        """Lets it close its client, so that nothing of it is left behind."""
        self._process.send_signal(signal.SIGINT)
        # it may have been stopped
        self._process.send_signal(signal.SIGCONT)
        try:
            self._process.wait(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._clear_up()

    def _clear_up(self) -> None:
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def signal(self, number: signal.Signals) -> None:
        """Stops it, or lets it go on."""
        os.kill(self._process.pid, number)

    @property
    def ended(self) -> bool:
        """Whether it ended by itself."""
        return self._process.poll() is not None


class ChildSource(Process):
    """A source in a process of its own."""

    def __init__(self, instance: str, name: str, number: int, scene: Scene, folder: File, ledger: Ledger) -> None:
        bodies = scene.of_source(name)
        base = CHILD_STAMPS * number
        path = folder / f"child_{number}.json"
        path.write_text(json.dumps({body.name: body.path.keys() for body in bodies}))
        super().__init__("source", instance, name, str(base), str(path), "0.015")
        if self.said:
            poses = lambda stamp: {body.name: body.path.at(stamp) for body in bodies}  # noqa: E731
            ledger.put_child(Child(name, int(self.said), base, poses))
