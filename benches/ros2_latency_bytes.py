"""The lean rclpy peer of ros2_latency.py: a wait set for each subscription in place of an executor, and bytes in place of
messages.

    ros2_latency_bytes.py BODIES SAMPLES    # the peer
    ros2_latency_bytes.py echo              # its echo: sends back what comes

Prints one JSON object of lists, microseconds: `through` the daemon, `beyond_tick`, and `echo` of the same bytes by a process
of this kind; and `lost`.
"""

import json
import subprocess
import sys
import time

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.serialization import deserialize_message, serialize_message
from ros2_frame import EncodedFrame, fill, stamp_of
from sweepd_msgs.msg import BodyTransform, BodyTransforms, Pairs, Tick

PAUSE_S = 0.005
# Longest sleep: how soon the end is seen.
WAIT_NS = 50_000_000
SEED = 31


class Peer:
    """Sends frames as bytes and takes the answers' times."""

    def __init__(self, bodies):
        self.node = rclpy.create_node("latency_bytes")
        self.to_daemon = self.node.create_publisher(BodyTransforms, "/sweepd/transforms", 10)
        self.to_echo = self.node.create_publisher(BodyTransforms, "/echo/bytes/in", 10)
        self.pairs = Inlet(self.node, Pairs, "/sweepd/pairs")
        self.ticks = Inlet(self.node, Tick, "/sweepd/tick")
        self.echoes = Inlet(self.node, BodyTransforms, "/echo/bytes/out")
        frame = BodyTransforms()
        fill(frame, BodyTransform, bodies, SEED, second=3)
        self.frame = EncodedFrame(frame, serialize_message(frame), SEED)

    def through(self, number):
        """One frame through the daemon: microseconds until its pairs, and of its tick; None: no answer."""
        encoded, stamp = self.frame.next(number)
        start = time.perf_counter_ns()
        self.to_daemon.publish(encoded)
        arrived = self.pairs.next(lambda raw: stamp_of(raw) == stamp)
        tick = self.ticks.next(lambda raw: stamp_of(raw) == stamp)
        if not arrived or not tick:
            return None
        return (arrived[1] - start) / 1e3, deserialize_message(tick[0], Tick).elapsed_ns / 1e3

    def echo(self, number):
        """The same bytes there and back, microseconds; None: no answer."""
        encoded, _ = self.frame.next(1000000 + number)
        start = time.perf_counter_ns()
        self.to_echo.publish(encoded)
        came = self.echoes.next(lambda raw: raw == encoded)
        return (came[1] - start) / 1e3 if came else None


class Inlet:
    """A subscription that is waited on and taken from directly."""

    def __init__(self, node, kind, topic):
        self.subscription = node.create_subscription(kind, topic, print, 10, raw=True)
        self.context = node.context
        with self.context.handle:
            self.waiting = _rclpy.WaitSet(1, 0, 0, 0, 0, 0, self.context.handle)

    def next(self, wanted, seconds=2.0):
        """The first message that is wanted, as bytes, and when it was taken, nanoseconds; None: none came."""
        until = time.perf_counter_ns() + seconds * 1e9
        while time.perf_counter_ns() < until:
            with self.subscription.handle:
                taken = self.subscription.handle.take_message(self.subscription.msg_type, True)
            now = time.perf_counter_ns()
            if taken and wanted(taken[0]):
                return taken[0], now
            if not taken:
                self.sleep()
        return None

    def sleep(self):
        with self.context.handle, self.subscription.handle:
            self.waiting.clear_entities()
            self.waiting.add_subscription(self.subscription.handle)
            self.waiting.wait(WAIT_NS)


def send_back():
    rclpy.init()
    node = rclpy.create_node("echo_bytes")
    out = node.create_publisher(BodyTransforms, "/echo/bytes/out", 10)
    come = Inlet(node, BodyTransforms, "/echo/bytes/in")
    while rclpy.ok():
        if got := come.next(lambda _: True):
            out.publish(got[0])


def sample(way, samples):
    """What a way takes once it answers, one number a sample; and how many were lost."""
    seq = next((seq for seq in range(1, 20) if way(seq) is not None), 20)
    found = []
    for number in range(samples + 100):
        found.append(way(seq + 1 + number))
        time.sleep(PAUSE_S)
    came = [one for one in found[100:] if one is not None]
    return came, samples - len(came)


def main():
    if sys.argv[1:] == ["echo"]:
        return send_back()
    bodies, samples = map(int, sys.argv[1:])
    rclpy.init()
    peer = Peer(bodies)
    through, lost = sample(peer.through, samples)
    # It takes a core, as the peer does: it is there only while it is asked.
    there = subprocess.Popen([sys.executable, __file__, "echo"])
    echoes, more = sample(peer.echo, samples)
    there.kill()
    beyond = [one - tick for one, tick in through]
    print(json.dumps({"through": [one for one, _ in through], "beyond_tick": beyond, "echo": echoes, "lost": lost + more}))
    rclpy.shutdown()


if __name__ == "__main__":
    main()
