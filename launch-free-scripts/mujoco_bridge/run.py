"""One run: load, write the scene, then step, send, receive and compare.

In: the command line. Out: counts, and an exit code.
"""

import time

import mujoco
import numpy as np

from .compare import Compare
from .daemon import Daemon
from .judge import Judge
from .model import Refused, load
from .scene import SOURCE, Scene

POSSIBLE = 3
"""Verdict of a pair that was left open (`sweepd.layout.Verdict`)."""
NOISE_MEMORY_S = 0.2
"""How long the noise on the actuators remembers itself, seconds."""


class Run:
    """A model, its simulation, its scene, and what came of it."""

    def __init__(self, chosen, scene_path):
        self.chosen = chosen
        self.scene_path = scene_path
        self.model = load(chosen.model, chosen.hull_ellipsoids, chosen.hull_sdf, chosen.without_flex)
        self.data = mujoco.MjData(self.model)
        self.start()
        self.scene = Scene(self.model)
        self.judge = Judge(self.model, self.scene, chosen.ccd_tolerance)
        self.judge.look(self.data)
        budgeted = chosen.budget_ms is not None or chosen.budget_units is not None
        compare = Compare(self.scene, self.judge, chosen.at_least, budgeted)
        self.compare = compare if chosen.compare else None
        self.random = np.random.default_rng(chosen.seed)
        self.done = 0
        self.answer_s = 0.0
        self.interrupted = False
        heading = []
        if chosen.budget_ms is not None:
            heading.append(f"budget_ms = {chosen.budget_ms!r}")
        if chosen.budget_units is not None:
            heading.append(f"budget_units = {chosen.budget_units}")
        scene_path.write_text(self.scene.text(self.judge.data, chosen.model.name, heading), encoding="utf-8")

    def start(self):
        """Puts the simulation at its keyframe."""
        if self.chosen.keyframe is None:
            return
        key = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_KEY, self.chosen.keyframe)
        if key < 0:
            names = ", ".join(self.model.key(k).name for k in range(self.model.nkey)) or "none"
            raise Refused(f'the model has no keyframe "{self.chosen.keyframe}": it has {names}')
        mujoco.mj_resetDataKeyframe(self.model, self.data, key)

    def drive(self):
        """Steps until the end, with a daemon of its own if asked."""
        # Wrong installations are told before a daemon is started.
        try:
            import sweepd
            import sweepd.client
        except ImportError as error:
            raise Refused(f"{error}: pip install ./msgs/python iceoryx2==0.10.0") from None
        if self.chosen.spawn is None:
            self.stream(sweepd, None)
            return
        with Daemon(self.chosen.spawn, self.scene_path, self.chosen.instance) as daemon:
            self.stream(sweepd, daemon)

    def stream(self, sweepd, daemon):
        """One frame and one answer a step."""
        try:
            with sweepd.Client(
                instance=self.chosen.instance,
                source=SOURCE,
                quat_order="wxyz",
                timeout_s=self.chosen.timeout,
                listen=("pairs",),
            ) as client:
                self.require_scene(client)
                if daemon:
                    # Another daemon of this name would have answered, and ours would be gone.
                    daemon.require_alive()
                self.all_steps(client)
        except KeyboardInterrupt:
            self.interrupted = True
        except sweepd.SweepdError as error:
            if daemon:
                daemon.require_alive()
            if isinstance(error, sweepd.TimedOut):
                raise TimeoutError(str(error)) from None
            raise Refused(str(error)) from None

    def require_scene(self, client):
        """Refuses a daemon whose bodies are not those of this scene."""
        ours = dict(zip(self.scene.names, self.scene.ids.tolist()))
        for name, body in sorted(ours.items() ^ client.names.items()):
            where = "this model" if ours.get(name) == body else "its scene"
            raise Refused(
                f'the daemon runs another scene (body "{name}" with id {body} is only in {where}):'
                " start it with the file of --scene-out, or with --spawn"
            )

    def all_steps(self, client):
        """Until the last step, or for ever."""
        interval_s = self.interval_s()
        begun = time.monotonic()
        while self.chosen.steps is None or self.done < self.chosen.steps:
            self.one_step(client)
            if interval_s:
                time.sleep(max(0.0, begun + self.done * interval_s - time.monotonic()))

    def interval_s(self):
        """Least time between steps, seconds; 0: none."""
        if self.chosen.realtime:
            return self.model.opt.timestep
        return 1 / self.chosen.rate if self.chosen.rate else 0.0

    def one_step(self, client):
        """Simulates, sends the poses at the new state, and waits for the answer to exactly that frame."""
        if self.chosen.ctrl_noise and self.model.nu:
            self.push()
        before_s = self.data.time
        mujoco.mj_step(self.model, self.data)
        if self.data.time < before_s:
            # MuJoCo starts anew when a simulation explodes: the world has jumped.
            client.reset_epoch()
        self.judge.look(self.data)
        poses = self.scene.poses(self.judge.data)[self.scene.moving]
        frame = (self.scene.ids[self.scene.moving], poses[:, :3], poses[:, 3:])
        stamp_ns = int(self.data.time * 1e9)
        sent = time.monotonic()
        # Its seconds are on no clock of this machine: a clock_id of its own says so.
        result = client.step(frame, timeout_s=self.chosen.timeout, stamp_ns=stamp_ns, clock_id=1)
        self.answer_s += time.monotonic() - sent
        self.done += 1
        if self.compare:
            colliding, possible = self.sets(result)
            self.compare.step(self.done, colliding, possible, self.judge.contacts())

    def push(self):
        """Smooth noise on every actuator, within its control range."""
        limited = self.model.actuator_ctrllimited.astype(bool)
        low, high = np.where(limited[:, None], self.model.actuator_ctrlrange, [-1.0, 1.0]).T
        kept = np.exp(-self.model.opt.timestep / NOISE_MEMORY_S)
        fresh = self.random.standard_normal(self.model.nu) * (high - low) / 2 * self.chosen.ctrl_noise
        middle = (low + high) / 2
        moved = middle + kept * (self.data.ctrl - middle) + np.sqrt(1 - kept**2) * fresh
        self.data.ctrl[:] = np.clip(moved, low, high)

    def sets(self, result):
        """Colliding and possible pairs of an answer, as places in the scene."""
        if result.pairs is None:
            raise Refused("the pairs of a tick were lost on the way: another reader may hold the daemon up")
        if result.tick.header.truncated:
            raise Refused("the answer is cut off: raise pair_rows under [limits] of the scene")
        place = {int(body): k for k, body in enumerate(self.scene.ids)}

        def pairs(ids):
            return {tuple(sorted((place[int(a)], place[int(b)]))) for a, b in ids}

        possible = result.pairs[result.pairs["verdict"] == POSSIBLE]
        return pairs(result.colliding), pairs(zip(possible["body_a"], possible["body_b"]))

    def summary(self):
        """What is printed at the end."""
        moving = int(self.scene.moving.sum())
        found = {"model": str(self.chosen.model), "bodies": len(self.scene.geoms), "moving": moving}
        found["pairs_checked"] = int(np.triu(self.scene.allowed).sum())
        if self.chosen.scene_out:
            found["scene"] = str(self.scene_path)
        if self.scene.lost:
            found["pairs_that_cannot_move"] = len(self.scene.lost)
        if self.compare:
            found.update(self.compare.summary())
        else:
            found["steps"] = self.done
        if self.done:
            found["answer_us_mean"] = round(1e6 * self.answer_s / self.done, 1)
        if self.interrupted:
            found["interrupted"] = True
        return found

    def exit_code(self):
        """0: as wished; 1: a difference, or a comparison cut short."""
        if self.compare and (not self.compare.holds() or self.interrupted):
            return 1
        return 0
