"""Latency from an rclpy publisher through the daemon back to an rclpy subscriber, beside a plain rclpy echo.

    python=$(./launch-free-scripts/ros2_env.sh)
    $python benches/ros2_latency.py [--bodies 100] [--samples 3000] [--csv benches/results/ros2_latency.csv]

One frame at a time, 5 ms apart, daemon and echo in turn in one run. `beyond_tick` is the time from publish() to the pairs
message in the callback, less the time that the tick itself took (`elapsed_ns`). It has two parts, told apart by the daemon's
own stamps on the clock that both share: `inbound` from publish() to the frame's admission (rclpy's encoding, DDS, the
daemon's reader), `outbound` from the tick's end to the callback (the daemon's writer, DDS, rclpy's decoding). The echo is a
second rclpy process that sends the same bytes back, without decoding them. Nothing else should run: the figures are those
of an idle machine.

`lean` is the same way with the least that rclpy asks for: a wait set for each subscription in place of an executor, and bytes
in place of message objects, which rclpy publishes and hands over as they are; and so is its echo, `lean_echo`. What is left is
DDS and the daemon.

`cyclone` is the same way with a peer that costs little: Cyclone DDS (a C library under a thin Python binding) publishes
bytes that were encoded before, and takes the pairs without decoding them.
"""

import argparse
import csv
import json
import os
import platform
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rclpy
from geometry_msgs.msg import Pose
from provenance import commit, machine
from rclpy.executors import SingleThreadedExecutor
from sweepd_msgs.msg import BodyTransform, BodyTransforms, Pairs, Tick

ROOT = Path(__file__).resolve().parents[1]
SEED = 23
PAUSE_S = 0.005

ECHO = """
import rclpy, sys
from rclpy.executors import SingleThreadedExecutor
from sweepd_msgs.msg import BodyTransforms
rclpy.init()
node = rclpy.create_node("echo")
out = node.create_publisher(BodyTransforms, "/echo/out", 10)
node.create_subscription(BodyTransforms, "/echo/in", out.publish, 10, raw=True)
executor = SingleThreadedExecutor()
executor.add_node(node)
try:
    executor.spin()
except BaseException:
    pass
"""


# The daemon is on loopback; so is the peer, which finds it without multicast.
ON_LOOPBACK = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast>
</General><Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""


def scene(bodies):
    shapes = "".join(f"[[body]]\nname = 'b{n}'\nshape = {{ type = 'sphere', radius = 0.3 }}\n" for n in range(bodies))
    return f"[run]\non_frame = 'sim'\n[[source]]\nname = 'sim'\ntimeout_ms = 5000\n{shapes}"


def percentile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


class Bench:
    """Sends frames and takes the answers' times."""

    def __init__(self, bodies):
        self.node = rclpy.create_node("latency")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.to_daemon = self.node.create_publisher(BodyTransforms, "/sweepd/transforms", 10)
        self.to_echo = self.node.create_publisher(BodyTransforms, "/echo/in", 10)
        self.pairs_at, self.tick, self.echo_at = {}, {}, {}
        self.node.create_subscription(Pairs, "/sweepd/pairs", self.pairs, 10)
        self.node.create_subscription(Tick, "/sweepd/tick", self.ticked, 10)
        self.node.create_subscription(BodyTransforms, "/echo/out", self.echoed, 10)
        dice = random.Random(SEED)
        self.at = [[dice.uniform(0, 4) for _ in range(3)] for _ in range(bodies)]
        self.frame = BodyTransforms(source="sim", session=dice.getrandbits(60), flags=BodyTransforms.FULL)
        self.frame.header.frame_id = "world"
        self.frame.transforms = [BodyTransform(name=f"b{n}", pose=Pose()) for n in range(bodies)]
        self.dice = dice

    def pairs(self, message):
        arrived = time.perf_counter_ns(), time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        self.pairs_at[message.tick_header.newest_stamp_ns] = (*arrived, len(message.pairs))

    def ticked(self, message):
        if message.cause == Tick.FRAME:
            # Age and send time are both of CLOCK_BOOTTIME: the frame was admitted when the tick began to count ages.
            self.tick[message.tick_header.newest_stamp_ns] = (message.elapsed_ns, message.sources[0].age_ns, message.sent_ns)

    def echoed(self, message):
        self.echo_at[message.seq] = time.perf_counter_ns()

    def next_frame(self):
        """The next frame, each body moved by some millimetres; its stamp is its number."""
        self.frame.seq += 1
        self.frame.header.stamp.sec, self.frame.header.stamp.nanosec = 1, self.frame.seq
        for body, at in zip(self.frame.transforms, self.at):
            for axis in range(3):
                at[axis] += self.dice.uniform(-5e-3, 5e-3)
            body.pose.position.x, body.pose.position.y, body.pose.position.z = at

    def wait(self, condition, seconds):
        until = time.monotonic() + seconds
        while not condition() and time.monotonic() < until:
            self.executor.spin_once(timeout_sec=0.05)
        return condition()

    def sample(self, publisher, there):
        """Publishes the next frame; nanoseconds of publish() and whether the answer came."""
        self.next_frame()
        self.frame.sent_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        start = time.perf_counter_ns()
        publisher.publish(self.frame)
        return start, self.wait(lambda: there(self.frame.seq), 2.0)


def measure(bench, samples):
    """Round trips in microseconds: through the daemon, beyond the tick, the tick, the echo; and pairs a tick."""
    stamp = lambda seq: 1_000_000_000 + seq  # noqa: E731
    both = lambda seq: stamp(seq) in bench.pairs_at and stamp(seq) in bench.tick  # noqa: E731
    if not bench.wait(lambda: bench.sample(bench.to_daemon, both)[1], 20):
        raise SystemExit("the daemon does not answer")
    if not bench.wait(lambda: bench.sample(bench.to_echo, lambda seq: seq in bench.echo_at)[1], 20):
        raise SystemExit("the echo does not answer")
    through, beyond, ticks, echo, lost, rows, inbound, outbound = [], [], [], [], 0, [], [], []
    for number in range(samples + 100):
        start, came = bench.sample(bench.to_daemon, both)
        at = stamp(bench.frame.seq)
        time.sleep(PAUSE_S)
        echo_start, echo_came = bench.sample(bench.to_echo, lambda seq: seq in bench.echo_at)
        time.sleep(PAUSE_S)
        if number < 100:
            continue
        lost += (not came) + (not echo_came)
        if came:
            arrived, arrived_boot, count = bench.pairs_at[at]
            elapsed, age, sent = bench.tick[at]
            through.append((arrived - start) / 1e3)
            ticks.append(elapsed / 1e3)
            beyond.append(through[-1] - ticks[-1])
            inbound.append(age / 1e3)
            outbound.append((arrived_boot - sent) / 1e3)
            rows.append(count)
        if echo_came:
            echo.append((bench.echo_at[bench.frame.seq] - echo_start) / 1e3)
    found = {"through": through, "beyond_tick": beyond, "inbound": inbound, "outbound": outbound, "tick": ticks, "echo": echo}
    return found, lost, sum(rows) / len(rows)


def stop(process):
    """Ends it; by force where it does not hear."""
    process.terminate()
    try:
        process.wait(timeout=5)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def append(path, row):
    """Adds a row to a table; rows from before it had some column keep that empty."""
    rows = list(csv.DictReader(path.open(newline=""))) if path.exists() else []
    names = list(dict.fromkeys(name for some in [*rows, row] for name in some))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows([*rows, row])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bodies", type=int, default=100)
    parser.add_argument("--samples", type=int, default=3000)
    parser.add_argument("--csv", type=Path)
    args = parser.parse_args()
    sweepd = os.environ.get("SWEEPD", str(ROOT / "target/release/sweepd"))
    rclpy.init()
    domain = rclpy.get_default_context().get_domain_id()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(scene(args.bodies))
        daemon = subprocess.Popen([sweepd, "--quiet", "run", str(path), "--instance", f"lat_{os.getpid()}", "--ros2"])
        echo = subprocess.Popen([sys.executable, "-c", ECHO])
        try:
            found, lost, pairs = measure(Bench(args.bodies), args.samples)
            rclpy.shutdown()
            stop(echo)
            # A peer's session of the source ends with its time-out; then the next one's begins.
            time.sleep(6)
            lean = [sys.executable, str(ROOT / "benches/ros2_latency_bytes.py"), str(args.bodies), str(args.samples)]
            lean = json.loads(subprocess.run(lean, stdout=subprocess.PIPE, text=True, check=True).stdout)
            time.sleep(6)
            cheap = [sys.executable, str(ROOT / "benches/ros2_latency_cyclone.py"), str(domain), str(args.bodies), str(args.samples)]
            cyclone = json.loads(subprocess.run(cheap, stdout=subprocess.PIPE, text=True, check=True, env=os.environ | {"CYCLONEDDS_URI": ON_LOOPBACK}).stdout)
        finally:
            stop(daemon)
            stop(echo)
    lost += cyclone.count(None) + lean["lost"]
    found |= {"lean": lean["through"], "lean_beyond_tick": lean["beyond_tick"], "lean_echo": lean["echo"]}
    found["cyclone"] = [value for value in cyclone if value is not None]
    row = {"machine": machine(), "commit": commit(), "compiler": f"Python {platform.python_version()}", "seed": SEED,
           "bodies": args.bodies, "samples": args.samples, "lost": lost, "pairs_mean": round(pairs, 1)}  # fmt: skip
    for name, values in found.items():
        row[f"{name}_p50_us"] = round(percentile(values, 0.5), 1)
        row[f"{name}_p99_us"] = round(percentile(values, 0.99), 1)
        print(f"{name:12} p50 {row[f'{name}_p50_us']:8.1f} us   p99 {row[f'{name}_p99_us']:8.1f} us")
    print(f"{args.bodies} bodies, {pairs:.0f} pairs a tick, {lost} of {5 * args.samples} answers lost")
    if args.csv:
        append(args.csv, row)


if __name__ == "__main__":
    main()
