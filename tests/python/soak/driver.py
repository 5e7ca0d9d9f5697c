"""The driver: starts the daemon, sends frames, restarts it, edits its scene, and has every tick checked."""

from __future__ import annotations

import signal
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from pathlib import Path as File
from random import Random
from typing import Any, Callable, Optional

import sweepd

from . import cast
from .checker import Checker
from .clients import NOWHERE, PATIENCE_S, Agreement, ChildSource, OwnSource, Process, Reader
from .daemon import Daemon
from .faults import Fault
from .moment import Moment
from .paths import Pose
from .scene import Scene, Source
from .world import NOTHING, Change, Setup, World

MODES = ("on_frame", "on_all", "rate")
#: What the first reader listens to: all, or what makes the daemon leave something out.
TOPICS = (
    ("pairs", "changes", "contacts", "contact_changes", "regions", "bodies", "body_verdicts"),
    ("pairs", "changes", "bodies", "body_verdicts"),
    ("changes", "contact_changes", "bodies"),
    ("pairs", "regions", "bodies"),
)
#: How long a frame may stay without a tick before that is told, seconds: on a machine that is busy with other tests.
_ANSWER_S = 20.0
#: As many as a reader can check, on a machine that is busy with other tests.
_RATE_HZ = 60
#: Deeds that are told with a fault.
_TOLD_DEEDS = 30


@dataclass
class Report:
    """What came of a run."""

    seed: int
    mode: str
    seconds: float
    faults: list[Fault] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    deeds: "deque[str]" = field(default_factory=lambda: deque(maxlen=_TOLD_DEEDS))
    command: list[str] = field(default_factory=list)
    step: int = 0

    def __str__(self) -> str:
        again = f"python -m soak --seed {self.seed} --mode {self.mode} --seconds {self.seconds:g}"
        lines = [
            f"soak: seed {self.seed}, {self.mode}, {self.counts['ticks']} ticks, {len(self.faults)} faults; {again}"
        ]
        if self.faults:
            lines += [f"  {fault}" for fault in self.faults[:20]]
            lines += [f"  the daemon: {' '.join(self.command)}", "  done before, the last at the end:"]
            lines += [f"    {deed}" for deed in self.deeds]
        return "\n".join(lines)


Deeds = Callable[["Soak"], None]


class Soak:
    """One run."""

    def __init__(
        self, seed: int, mode: str, seconds: float, folder: File, topics: Optional[tuple[str, ...]] = None
    ) -> None:
        self.random = Random(f"{seed} {mode}")
        self.report = Report(seed, mode, seconds)
        self.folder = folder
        self.world = World()
        self.daemon = Daemon(folder)
        self.step = 0
        self.sources, self.first_scene = self.draw_scene()
        self.agreement = Agreement()
        self.children = 0
        self.child: Optional[ChildSource] = None
        self.idle: Optional[Process] = None
        self.setup = self.draw_setup()
        self._start_daemon(self.first_scene)
        instance = self.daemon.instance
        topics = topics or self.random.choice(TOPICS)
        self.readers = [Reader(instance, topics, Checker(self.world), self.agreement)]
        self.control = sweepd.Client(instance, None, quat_order="xyzw", listen=(), timeout_s=PATIENCE_S)
        self.boot_id = self.control.hello.boot_id
        self.world.boot(self.boot_id)
        self.own = {name: OwnSource(instance, name, self.world.ledger) for name in (cast.SIM, cast.ARM)}
        self.start_child()

    @property
    def main(self) -> Reader:
        """The reader that is always there."""
        return self.readers[0]

    @property
    def scene(self) -> Scene:
        """The scene as it is now."""
        return self.world.boots[self.boot_id].scene

    def run(self, until_s: float, deeds: Deeds) -> None:
        """Goes on until a time (monotonic seconds) or the first fault; ``deeds(soak)`` does something now and then."""
        try:
            while time.monotonic() < until_s and not self.report.faults:
                deeds(self)
                self.one_step()
            self.drain()
        except sweepd.SweepdError as e:
            self.fault("client", "a client", f"{type(e).__name__}: {e}", "all that was asked can be done")

    def note(self, deed: str) -> None:
        """Takes down what is about to be done."""
        told = self.main.told if hasattr(self, "readers") else None
        self.report.deeds.append(f"step {self.step}, tick {told.number if told else 0}: {deed}")

    def found(self, faults: list[Fault]) -> None:
        """Takes faults, each once: readers that have the same tick find the same."""
        self.report.faults += [fault for fault in dict.fromkeys(faults) if fault not in self.report.faults]

    def fault(self, check: str, who: str, told: str, truth: str) -> None:
        """A fault that no tick shows."""
        number = self.main.told.number if self.main.told else 0
        self.found([Fault(check, number, who, told, truth)])

    def drain(self, wait_s: float = 0.0) -> None:
        """Takes and checks what every reader has received."""
        for at, reader in enumerate(self.readers):
            self.found(reader.drain(wait_s if at == 0 else 0.0))

    def pass_time(self, seconds: float) -> None:
        """Listens for a while."""
        until_s = time.monotonic() + seconds
        while (left_s := until_s - time.monotonic()) > 0.0 and not self.report.faults:
            self.drain(min(left_s, 0.05))

    # ---------------------------------------------------------------- frames

    def one_step(self) -> None:
        """A frame of each own source, and mostly the wait for its tick."""
        self.step += 1
        self.report.step = self.step
        sent: list[OwnSource] = []
        names = self.random.sample(sorted(self.own), len(self.own))
        for name in names:
            source = self.own[name]
            if time.monotonic() >= source.quiet_until_s and self._send(source):
                sent.append(source)
        if not sent:
            self.drain(0.01)
        elif self.random.random() < 0.85 or not all(source.is_heard for source in sent):
            self.await_used(sent)
        else:
            self.drain()

    def _send(self, source: OwnSource) -> bool:
        """One frame of a kind by chance; whether a tick with it is to be waited for."""
        chance = self.random.random()
        bodies = source.bodies(self.scene)
        poses: dict[str, Pose] = {body.name: body.path.at(self.step) for body in bodies}
        if not source.is_heard or chance < 0.88 or len(bodies) < 2:
            return source.send(poses, time_left_ns=self._time_left_ns(), moving=self.random.random() < 0.2)
        if chance < 0.93:
            some = self.random.sample(sorted(poses), self.random.randint(1, len(poses) - 1))
            return source.send({name: poses[name] for name in some}, partial=True)
        if chance < 0.95:
            poses[self.random.choice(sorted(poses))] = NOWHERE
            return source.send(poses)
        if chance < 0.97:
            source.absent[self.random.choice(sorted(poses))] = time.monotonic() + self.random.choice([0.01, 0.7])
            return False
        try:
            source.pause()
        except sweepd.SweepdError:
            return False
        return True

    def _time_left_ns(self) -> int:
        if self.random.random() < 0.9:
            return 0
        return self.random.choice([1, 1000, 20_000, 200_000, 5_000_000])

    def await_used(self, sent: list[OwnSource], patience_s: float = _ANSWER_S) -> bool:
        """Waits for the tick that used the newest frames of these sources; False, and a fault, where none comes."""
        until_s = time.monotonic() + patience_s
        # in lockstep the tick is that of the leading source, whenever the other's frame came
        waits = [source for source in sent if self.setup.lead in (None, source.name)]
        while not self.report.faults:
            self.drain(0.02)
            used = [source for source in self.own.values() if self._is_used(source)]
            for source in self.own.values():
                source.is_heard |= self._is_spoken_for(source)
            if all(source in used for source in waits):
                return True
            if self.daemon.ended:
                self.fault("ended", "the daemon", self.daemon.log(), "nobody ended it")
            elif time.monotonic() > until_s:
                text = f"no tick with the newest frames of {[source.name for source in waits]} for {patience_s} s"
                self.fault("answer", "the daemon", text, "each frame has a tick, or one behind it has")
            elif not all(source.is_heard for source in waits):
                # the session before may not be known to be over yet
                for source in waits:
                    if not source.is_heard:
                        self._send(source)
        return False

    def _is_used(self, source: OwnSource) -> bool:
        return source.last is not None and self.main.has_used(source.name, source.session, source.last)

    def _is_spoken_for(self, source: OwnSource) -> bool:
        """Whether its newest tick used any frame of a source's session: ticks may come a frame behind what is sent."""
        if source.last is None:
            return False
        epoch, _ = source.last
        return self.main.has_used(source.name, source.session, (epoch, 0))

    # ---------------------------------------------------------------- scene

    def edit(
        self, edits: list[dict[str, Any]], scene: Scene, change: Change = NOTHING, put: tuple[str, ...] = ()
    ) -> None:
        """Asks for edits, which make this scene."""
        self.note(f"edits {edits}")
        self.report.counts["edits"] += 1
        boot = self.world.boots[self.boot_id]
        answer = self.control.request({"edits": edits}, timeout_s=PATIENCE_S)
        if answer["scene_rev"] == boot.newest:
            return
        if answer["scene_rev"] != boot.newest + 1:
            self.fault("revision", "an edit", f"scene_rev {answer['scene_rev']}", f"{boot.newest + 1} is the next")
        self.world.edited(self.boot_id, answer["scene_rev"], scene, change, put)
        self.drain()

    def ask(self, kind: str, question: dict[str, Any]) -> tuple[dict[str, Any], Optional[Moment]]:
        """Asks a question; the answer, and the tick that it is about, if that was heard with all that is needed."""
        self.report.counts["questions"] += 1
        try:
            answer = self.control.request({kind: question}, timeout_s=PATIENCE_S)[kind]
        except sweepd.Refused:
            # a body that is asked for has no place that is known
            self.report.counts["questions refused"] += 1
            return {}, None
        self.drain()
        header = answer["tick_header"]
        for moment in reversed(self.main.checker.recent):
            if (moment.told.boot, moment.tick) == (header["boot_id"], header["tick"]):
                return answer, moment
        return answer, None

    def validate(self) -> None:
        """Has the daemon check its own structures."""
        answer = self.control.request({"validate": True}, timeout_s=PATIENCE_S)
        if answer.get("warnings"):
            self.fault("validate", "the daemon", f"{answer['warnings']}", "every structure holds")

    # ---------------------------------------------------------------- processes

    def start_child(self) -> None:
        """Starts a source in a process of its own."""
        self.children += 1
        self.child = ChildSource(
            self.daemon.instance, cast.CHILD, self.children, self.scene, self.folder, self.world.ledger
        )
        if not self.child.said:
            self.fault("child", "a client", "it ended before it was connected", "the daemon is there")

    def kill_child(self) -> None:
        """Kills it."""
        if self.child is not None:
            self._check_alive(self.child)
            self.child.kill()
        self.child = None

    def _check_alive(self, process: Process) -> None:
        if process.ended:
            self.fault("child", "a client", "it has ended", "it goes on until it is killed")

    def draw_scene(self) -> tuple[tuple[Source, ...], Scene]:
        """Who takes part."""
        return cast.sources(self.random), cast.cast(self.random)

    def draw_setup(self) -> Setup:
        """Budget and limits by chance; mode and sources stay."""
        mode = {"on_frame": f'on_frame = "{cast.SIM}"', "on_all": 'mode = "on_all"', "rate": f"rate = {_RATE_HZ}"}[
            self.report.mode
        ]
        # by a chance of their own, so that a seed has the same ones however far it came before
        random = Random(f"{self.report.seed} {self.report.mode} {self.report.counts['daemons']}")
        units, ns = random.choice(
            [
                (None, None),
                (0, None),
                (1, None),
                (3, None),
                (25, None),
                (400, None),
                (None, 0),
                (None, 50_000),
                (None, 1_000_000),
            ]
        )
        return Setup(
            mode,
            self.sources,
            lead=cast.SIM if self.report.mode == "on_frame" else None,
            budget_ns=ns,
            budget_units=units,
            heartbeat_ms=random.choice([50, 100]),
            pair_rows=random.choice([None, None, None, None, 12]),
        )

    def _start_daemon(self, scene: Scene) -> None:
        text = f"budget {self.setup.budget_ns} ns, {self.setup.budget_units} units, {self.setup.pair_rows} rows"
        self.note(f"the daemon starts: {text}")
        self.world.expect(self.setup, scene)
        self.daemon.start(self.setup, scene)
        self.report.command = self.daemon.command
        self.report.counts["daemons"] += 1

    def restart_daemon(self, number: signal.Signals) -> None:
        """Ends the daemon and starts another on a scene in another order, so that ids are other bodies'."""
        self.drain()
        old = self.boot_id
        self.note(f"the daemon gets {number.name}")
        wrong = self.daemon.end(number)
        if wrong is not None:
            self.fault("ended", "the daemon", wrong, f"it was ended by {number.name}")
            return
        # what it sent before its end
        self.drain()
        bodies = list(self.first_scene.bodies.values())
        self.random.shuffle(bodies)
        self.first_scene = Scene({body.name: body for body in bodies}, self.first_scene.rules)
        self.setup = self.draw_setup()
        self._start_daemon(self.first_scene)
        until_s = time.monotonic() + PATIENCE_S
        while self.main.told is None or self.main.told.boot == old:
            self.drain(0.05)
            if time.monotonic() > until_s or self.daemon.ended:
                self.fault("boot", "the daemon", f"no tick of it; {self.daemon.log()}", "it was started again")
                return
        self.boot_id = self.main.told.boot
        for source in self.own.values():
            source.is_heard, source.absent = False, {}
        self._catch_up(self.control)
        for source in self.own.values():
            self._catch_up(source.client)
        self._send_stale(old)

    def _catch_up(self, client: sweepd.Client) -> None:
        """A client meets the new daemon: it says so once."""
        for _ in range(1000):
            try:
                client.latest()
                if client._inbox.boot == self.boot_id:
                    return
            except sweepd.Restarted as e:
                if e.new_boot != self.boot_id:
                    self.fault("restart", "a client", f"boot {e.new_boot:x}", f"{self.boot_id:x} is there")
            time.sleep(0.01)
        self.fault("restart", "a client", "it has not met the new daemon", "ticks of it have come")

    def _send_stale(self, old: int) -> None:
        """A frame with the ids of the boot before, which are other bodies' now."""
        for source in self.own.values():
            poses = {body.name: body.path.at(self.step) for body in source.bodies(self.scene)}
            source.send_void(source.client, poses, boot=old)
        until_s = time.monotonic() + PATIENCE_S
        while not all(self.main.has_refused(name) for name in self.own) and not self.report.faults:
            self.drain(0.05)
            if time.monotonic() > until_s:
                self.fault("answer", "the daemon", "no frame counted as refused", "frames with old ids were sent")

    def close(self) -> None:
        """Ends whatever runs."""
        for process in (self.child, self.idle):
            if process is not None:
                self._check_alive(process)
                process.end()
        for reader in self.readers:
            self.report.counts += reader.checker.counts
            reader.close()
        for source in self.own.values():
            source.client.close()
        self.control.close()
        if not self.daemon.ended:
            wrong = self.daemon.end(signal.SIGINT)
            if wrong is not None and not self.report.faults:
                self.fault("ended", "the daemon", wrong, "it was asked to end")
