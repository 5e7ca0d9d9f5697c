"""A jump of /clock back in time: all that is known is flushed, every pair ends with cause `reset`, and the node goes on."""

import pytest
from conftest import RELIABLE
from diagnostic_msgs.msg import DiagnosticArray
from frames import Sender, pose
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import Log
from rosgraph_msgs.msg import Clock
from sweepd_msgs.msg import Pairs, State, Tick

# Two pairs that collide, one of them moved by topics of common types.
SCENE = """
frame_id = "world"
[run]
rate = 50
[[source]]
name = "sim"
timeout_ms = 500
[[source]]
name = "poses"
timeout_ms = 500
ros2 = { type = "pose" }
[[body]]
name = "a"
source = "sim"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "b"
source = "sim"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "p"
source = "poses"
ros_topic = "/p"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "post"
moves = false
position = [10, 0, 0]
shape = { type = "sphere", radius = 0.5 }
"""


class World:
    """Simulated time, and a sender of each kind that stamps with it."""

    def __init__(self, room, sim_time):
        self.room = room
        self.daemon = room.daemon(SCENE, ros_args=["-p", f"use_sim_time:={str(sim_time).lower()}"])
        node = room.node()
        self.clock = node.create_publisher(Clock, "/clock", RELIABLE)
        self.p = node.create_publisher(PoseStamped, "/p", RELIABLE)
        self.sender = Sender(node)
        self.now_ns = 1_000 * 10**9
        self.pairs, self.states = room.hear(Pairs, "/sweepd/pairs"), room.hear(State, "/sweepd/state")
        self.ticks, self.logs = room.hear(Tick, "/sweepd/tick"), room.hear(Log, "/rosout")
        room.until(lambda: self.ticks and self.ticks[-1].colliding == 2, "two collisions", then=self.step)

    def tick_clock(self):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(self.now_ns, 10**9)
        self.clock.publish(message)

    def step(self):
        self.now_ns += 20_000_000
        self.tick_clock()
        self.sender.send({"a": (0, 0, 0), "b": (0.5, 0, 0)}, stamp_ns=self.now_ns)
        message = PoseStamped(pose=pose((10.5, 0, 0)))
        message.header.frame_id = "world"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self.now_ns, 10**9)
        self.p.publish(message)

    def ends(self, start):
        return [(p.name_a, p.name_b, p.end_cause) for m in self.pairs[start:] for p in m.pairs if p.events & p.END]


def test_a_jump_back_ends_every_pair_with_cause_reset_flushes_and_goes_on(room):
    world = World(room, True)
    # nothing is on its way any more when the clock jumps, and nobody sends a pose after it
    room.spin(0.2)
    start, state = len(world.pairs), len(world.states)
    world.now_ns = 10 * 10**9
    room.until(lambda: len(world.ends(start)) >= 2, "both pairs ended", then=world.tick_clock)
    assert sorted(world.ends(start)) == [("a", "b", 5), ("p", "post", 5)]
    unknown = room.until(lambda: [s for s in world.states[state:] if "not_received" in s.reason_words], "bodies not received")
    assert unknown[0].word == "unknown"
    room.until(lambda: any("/clock went back" in log.msg for log in world.logs), "a word on /rosout")
    # later stamps of the new time are taken, though the old ones were greater
    room.until(lambda: world.ticks[-1].colliding == 2, "both pairs again", then=world.step)
    last = world.pairs[-1].header.stamp
    assert last.sec < 100, "poses of the new time"
    boots = {tick.tick_header.boot_id for tick in world.ticks}
    assert len(boots) == 1 and world.daemon.process.poll() is None
    begins = lambda: {(p.name_a, p.name_b) for m in world.pairs[start:] for p in m.pairs if p.events & p.BEGIN}  # noqa: E731
    room.until(lambda: begins() == {("a", "b"), ("p", "post")}, "both have begun anew", then=world.step)


@pytest.mark.parametrize("sim_time", [True, False])
def test_two_publishers_of_the_clock_are_told_where_time_is_theirs(room, sim_time):
    world = World(room, sim_time)
    other, two = room.node("other").create_publisher(Clock, "/clock", RELIABLE), "/clock: two publishers"
    said = lambda: any(two in log.msg for log in world.logs)  # noqa: E731

    def both():
        world.step()
        message = Clock()
        message.clock.sec = world.now_ns // 10**9 - 2
        other.publish(message)

    if sim_time:
        room.until(said, "a word on /rosout", then=both)
    else:
        for _ in range(60):
            both()
            room.spin(0.02)
        assert not said()


@pytest.mark.parametrize("step_s", [0.0, 5.0])
def test_a_clock_that_stands_or_jumps_ahead_ends_nothing(room, step_s):
    world = World(room, True)
    start = len(world.pairs)
    world.now_ns += int(step_s * 1e9)
    for _ in range(20):
        world.tick_clock()
        world.step()
        room.spin(0.02)
    assert world.ends(start) == [] and world.ticks[-1].colliding == 2


def test_a_time_that_comes_late_ends_nothing(room):
    world = World(room, True)
    start = len(world.pairs)
    for late_s in (0.1, 2.0, 500.0) * 4:
        world.step()
        now_ns, world.now_ns = world.now_ns, world.now_ns - int(late_s * 1e9)
        world.tick_clock()
        world.now_ns = now_ns
        room.spin(0.02)
    room.until(lambda: world.ticks[-1].receipts_refused >= 12, "late times are counted", then=world.step)
    assert world.ends(start) == [] and world.ticks[-1].colliding == 2
    assert not any("went back" in log.msg for log in world.logs)


def test_without_use_sim_time_the_clock_says_nothing(room):
    world = World(room, False)
    start = len(world.pairs)
    for second in (50, 5, 1):
        message = Clock()
        message.clock.sec = second
        world.clock.publish(message)
        for _ in range(10):
            world.sender.send({"a": (0, 0, 0), "b": (0.5, 0, 0)}, stamp_ns=world.now_ns)
            room.spin(0.02)
    assert [end for end in world.ends(start) if end[0] == "a"] == []
    assert not any("went back" in log.msg for log in world.logs)


def test_bug_a_clock_that_never_comes_was_told_nowhere(room):
    room.daemon(SCENE, ros_args=["-p", "use_sim_time:=true"])
    said = room.hear(DiagnosticArray, "/diagnostics")
    clock = room.node().create_publisher(Clock, "/clock", RELIABLE)

    def is_told():
        return any("no time has come" in s.message or any("no time has come" in v.value for v in s.values) for m in said[-1:] for s in m.status)

    room.until(is_told, "a word on it")
    message = Clock()
    message.clock.sec = 1_000
    room.until(lambda: not is_told(), "no word on it any more", then=lambda: clock.publish(message))
