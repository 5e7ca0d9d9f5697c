"""Bad input from other nodes: each is told in words on /rosout and /diagnostics, and does no harm beyond its own body.

What the start refuses (remaps that collide, parameters) is in test_node.py and test_params.py.
"""

import math
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from frames import Sender, pose
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from scenes import HANDS
from sweepd_msgs.msg import BodyTransforms, State, Tick
from tf2_msgs.msg import TFMessage
from topics import SCENE, Feeder

S = 10**9


class Desk:
    """A daemon fed on every kind of topic, and where a user looks."""

    def __init__(self, room, skip=()):
        self.room = room
        self.daemon = room.daemon(SCENE)
        node = room.node()
        self.states = room.hear(State, "/sweepd/state")
        self.ticks = room.hear(Tick, "/sweepd/tick")
        self.logs = room.hear(Log, "/rosout")
        self.said = room.hear(DiagnosticArray, "/diagnostics")
        self.feeder = Feeder(room, node)
        self.feeder.skip = set(skip)
        if not skip:
            room.until(lambda: self.states and self.states[-1].word == "clear", "clear: every body is known", then=self.feeder)

    def told(self, *words, feed=None):
        """Until one line of /rosout (level WARN, from the node) and the newest diagnostics have all words."""
        has = lambda text: all(word in text for word in words)  # noqa: E731
        feed = feed or self.feeder
        self.room.until(lambda: any(log.name == "sweepd" and log.level == Log.WARN and has(log.msg) for log in self.logs),
                        f"{words} on /rosout", then=feed)  # fmt: skip
        self.room.until(lambda: any(has(status.message) and status.level > b"\0" for message in self.said[-2:] for status in message.status),
                        f"{words} in the diagnostics", then=feed)  # fmt: skip

    def word(self, word, feed=None):
        return self.room.until(lambda: self.states[-1].word == word and self.states[-1], word, then=feed or self.feeder)


@pytest.mark.parametrize(("who", "name"), [("person", "body person"), ("cart", "body cart"), ("elbow", "frame elbow"), ("box", "source sim")])
@pytest.mark.parametrize(("shift_s", "side"), [(30, "in the future"), (-30, "in the past")])
def test_stamps_far_from_the_nodes_clock_are_told_and_the_poses_are_used(room, who, name, shift_s, side):
    desk = Desk(room)
    # a chain is judged by its stamps among each other, so all of it is off
    shifted = {"elbow", "base"} if who == "elbow" else {who}
    desk.feeder.shift_ns = {one: shift_s * S for one in shifted}
    desk.told(name, side, "clock")
    desk.word("clear")
    start = len(desk.states)
    for _ in range(60):
        desk.feeder()
        room.spin(0.02)
    assert {state.word for state in desk.states[start:]} == {"clear"}, "ages count from receipt, not by stamps"


def test_a_pose_older_than_the_one_before_is_passed_over_counted_and_told(room):
    desk = Desk(room)
    reader = room.client(None, listen=("bodies",))
    desk.feeder.x["person"] = 2.5
    room.spin(0.1)
    before = desk.ticks[-1].receipts_refused

    def late():
        desk.feeder()
        message = PoseStamped(pose=pose((9, 9, 9)))
        message.header.frame_id = "world"
        desk.feeder.stamp(message.header, "person", time.time_ns() - S // 5)
        desk.feeder.person.publish(message)

    desk.told("body person", "before the one", "passed over", feed=late)
    room.until(lambda: desk.ticks[-1].receipts_refused > before, "it is counted", then=late)
    result = reader.latest() or reader.wait()
    places = {int(row["body"]): row["position"].tolist() for row in result.bodies}
    assert places[reader.names["person"]] == [2.5, 0, 0]
    assert desk.states[-1].word == "clear"


def test_a_frame_that_never_appears_is_told(room):
    desk = Desk(room, skip={"elbow"})
    desk.told("body hand", 'no link from frame "elbow" towards "world"')
    assert "clear" not in {state.word for state in desk.states} and "not_received" in desk.states[-1].reason_words


def test_a_loop_in_tf_is_told(room):
    desk = Desk(room)
    desk.feeder.skip = {"elbow"}

    def looped():
        desk.feeder()
        desk.feeder.tf.publish(TFMessage(transforms=[desk.feeder.link("elbow", "arm_tip", (0.0, 0.0, 0.5))]))

    desk.told("body hand", "lead in a loop", feed=looped)
    assert desk.word("unknown", looped).reason_words == ["rejected"]
    desk.feeder.skip = set()
    desk.word("clear")


@pytest.mark.parametrize("who", ["person", "cart", "elbow", "box"])
def test_a_quaternion_of_zeros_is_told_and_makes_that_body_unknown(room, who):
    desk = Desk(room)
    desk.feeder.skip = {who}
    zeros = (0.0, 0.0, 0.0, 0.0)

    def bent():
        desk.feeder()
        feeder = desk.feeder
        if who == "elbow":
            feeder.tf.publish(TFMessage(transforms=[feeder.link("elbow", "mount", (0.0, 0.0, 0.5), zeros)]))
        elif who == "box":
            feeder.sim.send({"box": ((4.0, 0.0, 0.0), zeros)})
        else:
            message = PoseStamped() if who == "person" else Odometry()
            message.header.frame_id = "world"
            feeder.stamp(message.header, who)
            if who == "person":
                message.pose = pose((2, 0, 0), zeros)
            else:
                message.pose.pose = pose((3, 0, 0), zeros)
            (feeder.person if who == "person" else feeder.cart).publish(message)

    assert "rejected" in desk.word("unknown", bent).reason_words
    room.until(lambda: desk.ticks[-1].rejects[Tick.REJECT_BAD_QUATERNION] > 0, "counted by its reason", then=bent)
    room.until(lambda: any("bad_quaternion" in status.message for message in desk.said[-2:] for status in message.status),
               "its reason in the diagnostics", then=bent)  # fmt: skip
    body, words = ("hand", 'frame "elbow" is no pose') if who == "elbow" else (who, "is no pose: bad_quaternion")
    desk.told(f"body {body}", words, feed=bent)
    desk.feeder.skip = set()
    desk.word("clear")


def test_a_body_fed_by_two_publishers_of_its_topic_is_told(room):
    desk = Desk(room)
    other = room.node("other").create_publisher(PoseStamped, "/tracker/person", 10)

    def both():
        desk.feeder()
        message = PoseStamped(pose=pose((2, 0, 0)))
        message.header.frame_id = "world"
        desk.feeder.stamp(message.header, "person")
        other.publish(message)

    desk.told("/tracker/person", "two publishers", feed=both)


def test_a_frame_of_tf_that_two_publishers_link_is_told(room):
    desk = Desk(room)
    other = room.node("other").create_publisher(TFMessage, "/tf", 10)

    def both():
        desk.feeder()
        other.publish(TFMessage(transforms=[desk.feeder.link("elbow", "mount", (0.0, 0.0, 0.7))]))

    desk.told("frame elbow", "two publishers", feed=both)


def test_a_body_fed_by_another_source_is_told_and_its_own_wins(room):
    desk = Desk(room)

    def both():
        desk.feeder()
        desk.feeder.sim.send({"person": (4.0, 0.0, 0.0)}, flags=BodyTransforms.PARTIAL)

    room.until(lambda: desk.ticks[-1].rejects[Tick.REJECT_WRONG_SOURCE] > 3, "refused: wrong source", then=both)
    room.until(lambda: any("wrong_source" in status.message for message in desk.said[-2:] for status in message.status),
               "its reason in the diagnostics", then=both)  # fmt: skip
    desk.told("body person", "source sim", "source poses", feed=both)
    assert desk.states[-1].word == "clear"


def test_a_frame_that_is_linked_on_tf_and_on_tf_static_is_told(room):
    desk = Desk(room)

    def both():
        desk.feeder()
        desk.feeder.fixed.publish(TFMessage(transforms=[desk.feeder.link("elbow", "mount", (0.0, 0.0, 0.5), stamp_ns=0)]))

    desk.told("frame elbow", "fixed links", feed=both)


def test_a_frame_of_transforms_in_another_frame_than_the_scenes_is_refused_counted_and_told(room):
    desk = Desk(room, skip=["box"])

    def lost():
        desk.feeder()
        message = desk.feeder.sim.frame({"box": (4.0, 0.0, 0.0)})
        message.header.frame_id = "somewhere"
        desk.feeder.sim.publisher.publish(message)

    desk.told("source sim", "somewhere", feed=lost)
    room.until(lambda: desk.ticks[-1].rejects[Tick.REJECT_BAD_CHAIN] > 3 and desk.ticks[-1].receipts_refused > 3, "counted", then=lost)
    assert desk.word("unknown", feed=lost)
    desk.feeder.skip = set()
    desk.word("clear")


def test_stamps_of_another_clock_are_carried_and_not_told_as_odd(room):
    desk = Desk(room, skip=["box"])
    room.until(lambda: desk.ticks and desk.said, "the node", then=desk.feeder)

    def elsewhen():
        desk.feeder()
        desk.feeder.sim.send({"box": (4.0, 0.0, 0.0)}, stamp_ns=77, clock_id=9)

    desk.word("clear", feed=elsewhen)
    for _ in range(150):
        elsewhen()
        room.spin(0.02)
    (source,) = [source for source in desk.ticks[-1].sources if source.name == "sim"]
    assert (source.clock_id, source.stamp_ns) == (9, 77)
    assert not [log.msg for log in desk.logs if "source sim" in log.msg and "clock" in log.msg]


def test_bug_frames_that_are_refused_for_their_head_or_their_names_are_told_with_what_to_write(room):
    desk = Desk(room)
    sim = desk.feeder.sim

    def wrong(name, **fields):
        def feed():
            desk.feeder()
            message = sim.frame({name: (4.0, 0.0, 0.0)}, flags=BodyTransforms.PARTIAL)
            for field, value in fields.items():
                setattr(message, field, value)
            sim.publisher.publish(message)

        return feed

    desk.told('source "nosuch"', "no such source, it has", "sim", feed=wrong("box", source="nosuch"))
    desk.told("source sim", "session 0", "random number", feed=wrong("box", session=0))
    desk.told("source sim", "flags 0", "FULL, PARTIAL or PAUSED", feed=wrong("box", flags=0))
    desk.told("source sim", "raise seq", feed=wrong("box", seq=1))
    desk.told('body "bxo"', 'did you mean "box"?', feed=wrong("bxo"))
    desk.word("clear")
    # The daemon's own line: seldom, of all that was refused.
    assert "frames or poses are refused: " in desk.daemon.log


def test_two_nodes_of_one_name_are_told(room):
    first = room.daemon(HANDS)
    room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    logs = room.hear(Log, "/rosout")
    room.until(lambda: ticks, "the first node")
    words = "another node is named /sweepd"
    assert words not in first.log
    second = room.daemon(HANDS, instance=room.instance + "_b")
    room.until(lambda: words in first.log and words in second.log, "a word on it from both", seconds=20)
    room.until(lambda: any(words in log.msg and "__node" in log.msg for log in logs), "and on /rosout")
    room.until(lambda: len({tick.tick_header.boot_id for tick in ticks[-50:]}) == 2, "told apart by boot id")


def test_numbers_that_are_none_are_refused_by_every_kind_of_topic(room):
    desk = Desk(room)
    desk.feeder.x |= {"person": math.nan, "cart": math.inf, "box": math.nan}
    state = desk.word("unknown")
    assert "rejected" in state.reason_words
    room.until(lambda: desk.ticks[-1].rejects[Tick.REJECT_NOT_FINITE] > 3, "counted by its reason", then=desk.feeder)
    desk.feeder.x |= {"person": 2.0, "cart": 3.0, "box": 4.0}
    desk.word("clear")
