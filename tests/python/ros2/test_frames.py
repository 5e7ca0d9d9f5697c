"""What a frame of `~/transforms` says beside its poses, from rclpy: velocities, a scene revision, a deadline, time left."""

import math
import time

import pytest
from frames import Sender
from geometry_msgs.msg import Twist
from scenes import HANDS, cloud
from sweepd_msgs.msg import Pair, Pairs, Tick
from sweepd_msgs.srv import SetFilter

FAR = {"left": (0, 0, 0), "right": (5, 0, 0)}
PATIENT = HANDS.replace("timeout_ms = 500", "timeout_ms = 60000")
# A rod along x, and a post beside it that the rod meets as it turns.
ROD = """
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 60000
[[body]]
name = "rod"
continuous = true
shape = { type = "box", half_extents = [1.0, 0.05, 0.05] }
[[body]]
name = "post"
moves = false
position = [0.0, 0.9, 0.0]
shape = { type = "sphere", radius = 0.05 }
"""


def test_a_whole_turn_between_two_frames_is_followed_by_the_angular_velocity(room):
    room.daemon(ROD)
    node = room.node()
    ticks, pairs = room.hear(Tick, "/sweepd/tick"), room.hear(Pairs, "/sweepd/pairs")
    sender = Sender(node)
    now_ns = [10**9]

    def turn(rate):
        """A frame a tenth of a second later, of the same pose, turning at so many radians a second."""
        now_ns[0] += 10**8
        twist = Twist()
        twist.angular.z = rate
        seq = sender.send({"rod": (0, 0, 0)}, stamp_ns=now_ns[0], velocities=[twist])
        tick = room.until(lambda: next((t for t in ticks if t.sources[0].seq == seq), None), f"the tick of frame {seq}")
        number = tick.tick_header.tick
        (message,) = room.until(lambda: [m for m in pairs if m.tick_header.tick == number], "its pairs")
        return message.pairs

    room.until(lambda: ticks and pairs, "the daemon")
    turn(0.0)
    assert turn(0.0) == [], "at rest nothing is met"
    (hit,) = turn(20 * math.pi)
    assert hit.flags & Pair.SWEPT_HIT and hit.events & Pair.PASSED
    # a quarter of the turn, less what the two are thick
    assert 0.2 < hit.toi_min <= hit.toi_max < 0.25
    assert turn(0.0) == []


def test_velocities_that_are_not_as_many_as_the_poses_are_refused(room):
    room.daemon(PATIENT)
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)
    room.until(lambda: ticks and ticks[-1].sources[0].frames > 0, "a frame", then=lambda: sender.send(FAR))
    room.until(lambda: ticks[-1].rejects[Tick.REJECT_BAD_LAYOUT] > 0, "a refusal", then=lambda: sender.send(FAR, velocities=[Twist()]))


def test_a_frame_that_needs_a_later_scene_waits_for_it(room):
    room.daemon(PATIENT, ros_args=["-p", "ros.allow_edits:=true"])
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)
    room.until(lambda: ticks and ticks[-1].sources[0].frames > 0, "a frame", then=lambda: sender.send(FAR))
    room.spin(0.2)
    frames = ticks[-1].sources[0].frames
    sender.send(FAR, scene_rev=ticks[-1].tick_header.scene_rev + 1)
    room.spin(0.5)
    assert ticks[-1].sources[0].frames == frames, "it waits"
    ignore = SetFilter.Request(action=SetFilter.Request.IGNORE, a="left", b="right", reason="test")
    assert room.call(SetFilter, "/sweepd/set_filter", ignore).success
    room.until(lambda: ticks[-1].sources[0].frames == frames + 1, "it is taken")


@pytest.mark.parametrize("field", ["time_left_ns", "deadline_ns"])
def test_the_time_that_a_frame_leaves_bounds_the_work_of_its_tick(room, field):
    """Two spheres whose boxes overlap: without time the pair stays possible, with time enough it is decided."""
    room.daemon(cloud(2, timeout_ms=60000))
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)

    def possible(at, **more):
        seq = sender.send({"b0000": (0, 0, 0), "b0001": at}, **more)
        return room.until(lambda: next((t for t in ticks if t.sources[0].seq == seq), None), f"the tick of frame {seq}").possible

    apart, corners = (5, 0, 0), (0.7, 0.7, 0.7)
    room.until(lambda: ticks and ticks[-1].sources[0].frames > 0, "a frame", then=lambda: sender.send({"b0000": (0, 0, 0), "b0001": apart}))
    monotonic_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
    none, enough = (1, 10**10) if field == "time_left_ns" else (monotonic_ns, monotonic_ns + 10**12)
    for _ in range(3):
        assert possible(corners, **{field: none}) == 1
        assert possible(corners, **{field: enough}) == 0
        assert possible(apart) == 0
        assert possible(corners) == 0
        assert possible(apart) == 0
