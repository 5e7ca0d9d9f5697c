"""Bodies put while the node runs, onto sources of common topics: they are heard, shown, moved elsewhere and let go."""

import json
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from frames import pose
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from shape_msgs.msg import SolidPrimitive
from sweepd_msgs.msg import BodyTransforms, State, Tick
from sweepd_msgs.srv import PutBody, RemoveBody
from tf2_msgs.msg import TFMessage
from topics import SCENE, Feeder
from visualization_msgs.msg import MarkerArray


def put(room, name, source, **options):
    ball = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.1])
    request = PutBody.Request(name=name, source=source, moves=True, pose=pose((0, 0, 0)), primitives=[ball],
                              primitive_poses=[pose((0, 0, 0))], options_json=json.dumps(options) if options else "")  # fmt: skip
    return room.call(PutBody, "/sweepd/put_body", request)


class Late:
    """The scene's own bodies kept known, and one more sent on a topic of a kind."""

    def __init__(self, room, scene=SCENE):
        self.room = room
        room.daemon(scene, ros_args=["-p", "ros.allow_edits:=true"])
        self.node = room.node()
        self.states, self.ticks = room.hear(State, "/sweepd/state"), room.hear(Tick, "/sweepd/tick")
        self.feeder = Feeder(room, self.node)
        self.reader = room.client(None, listen=("bodies",))
        self.publishers = {}
        room.until(lambda: self.states and self.states[-1].word == "clear", "clear", then=self.feeder)

    def publisher(self, kind, topic):
        if topic not in self.publishers:
            self.publishers[topic] = self.node.create_publisher(kind, topic, 10)
        return self.publishers[topic]

    def send(self, kind, topic, x):
        """The scene's bodies, and this one at x."""
        self.feeder()
        self.send_one(kind, topic, x)

    def send_one(self, kind, topic, x):
        """One body at x."""
        if kind == "tf":
            return self.feeder.tf.publish(TFMessage(transforms=[self.feeder.link(topic, "world", (x, 0.0, 0.0))]))
        message = PoseStamped() if kind == "pose" else Odometry()
        message.header.frame_id = "world"
        self.feeder.stamp(message.header, topic)
        if kind == "pose":
            message.pose = pose((x, 0, 0))
        else:
            message.pose.pose = pose((x, 0, 0))
        return self.publisher(type(message), topic).publish(message)

    def where(self, name):
        """Where the daemon has it, and its status."""
        result = self.reader.latest() or self.reader.wait()
        while name not in self.reader.names or not any(int(row["body"]) == self.reader.names[name] for row in result.bodies):
            result = self.reader.wait()
        row = next(row for row in result.bodies if int(row["body"]) == self.reader.names[name])
        return row["position"].tolist(), int(row["status"])


KINDS = {"tf": ("tf", {"ros_frame": "late_frame"}, "late_frame"), "pose": ("poses", {"ros_topic": "/late/pose"}, "/late/pose"),
         "odometry": ("odom", {"ros_topic": "/late/odom"}, "/late/odom")}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_body_that_comes_late_is_heard_moves_and_is_shown(room, kind):
    late = Late(room)
    markers = room.hear(MarkerArray, "/sweepd/markers")
    source, options, topic = KINDS[kind]
    answer = put(room, "late", source, **options)
    assert answer.success, answer.message
    room.until(lambda: "not_received" in late.states[-1].reason_words, "not received at first", then=late.feeder)
    for x in (7.0, 8.0):
        room.until(lambda: late.where("late") == ([x, 0, 0], 0), f"known at {x}", then=lambda: late.send(kind, topic, x))
    room.until(lambda: late.states[-1].word == "clear", "clear with it", then=lambda: late.send(kind, topic, 8.0))
    room.until(lambda: any(abs(p.x - 8.1) < 1e-9 for m in markers[-3:] for p in m.markers[0].points), "its box",
               then=lambda: late.send(kind, topic, 8.0))  # fmt: skip
    # it meets the box at 4
    state = room.until(lambda: late.states[-1].word == "colliding" and late.states[-1], "a collision", then=lambda: late.send(kind, topic, 4.1))
    assert {state.worst_name_a, state.worst_name_b} == {"late", "box"}
    # silent: stale, and told as its own
    room.until(lambda: late.states[-1].word == "unknown" and {"stale", "rejected"} & set(late.states[-1].reason_words), "stale", then=late.feeder)


@pytest.mark.parametrize("kind", KINDS)
def test_a_body_that_left_is_not_heard_any_more_and_may_come_again_elsewhere(room, kind):
    late = Late(room)
    source, options, topic = KINDS[kind]
    assert put(room, "late", source, **options).success
    room.until(lambda: late.where("late") == ([7, 0, 0], 0), "known", then=lambda: late.send(kind, topic, 7.0))
    assert room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="late")).success
    room.until(lambda: late.states[-1].word == "clear", "clear without it", then=late.feeder)
    room.spin(0.3)
    rejects = list(late.ticks[-1].rejects)
    for _ in range(30):
        late.send(kind, topic, 7.5)
        room.spin(0.02)
    assert list(late.ticks[-1].rejects) == rejects and late.states[-1].word == "clear"
    # again, on another topic: the old one moves nothing
    other = topic + "_b"
    assert put(room, "late", source, **{next(iter(options)): other}).success
    room.until(lambda: late.where("late") == ([9, 0, 0], 0), "known by its new topic", then=lambda: late.send(kind, other, 9.0))
    for _ in range(20):
        late.send(kind, topic, 5.0)
        room.spin(0.01)
        late.send(kind, other, 9.0)
        room.spin(0.01)
        assert late.where("late")[0] == [9, 0, 0]


def test_many_bodies_with_topics_of_their_own_in_one_edit_are_all_heard(room):
    late = Late(room)
    names = [f"late_{n}" for n in range(60)]
    ball = {"type": "sphere", "radius": 0.1}
    edits = [{"put": {"name": name, "source": "poses", "ros_topic": f"/{name}/pose", "shape": ball}} for name in names]
    assert late.reader.request({"edits": edits})["ok"]
    # one of them leaves, and one is moved to another topic, perhaps before there was time to subscribe to theirs
    last = dict(edits[-1]["put"], ros_topic="/elsewhere/pose")
    assert late.reader.request({"edits": [{"remove": names[-2]}, {"put": last}]})["ok"]
    topics = {name: f"/{name}/pose" for name in names if name != names[-2]} | {names[-1]: "/elsewhere/pose"}
    places = {name: 10.0 + n for n, name in enumerate(topics)}

    def send():
        late.feeder()
        for name, topic in topics.items():
            late.send_one("pose", topic, places[name])

    def all_known():
        result = late.reader.latest() or late.reader.wait()
        rows = {int(row["body"]): row for row in result.bodies}
        found = {name: rows.get(late.reader.names.get(name)) for name in topics}
        return all(row is not None and row["status"] == 0 and row["position"][0] == places[name] for name, row in found.items())

    room.until(all_known, "all of them known", then=send)


@pytest.mark.parametrize("kind", ["pose", "odometry"])
def test_bug_a_body_that_came_again_was_known_by_the_last_message_of_before(room, kind):
    late = Late(room)
    source, options, topic = KINDS[kind]
    assert put(room, "late", source, **options).success
    room.until(lambda: late.where("late") == ([7, 0, 0], 0), "known", then=lambda: late.send(kind, topic, 7.0))
    # a second body on the topic while the first is heard no more, and the first again
    assert put(room, "other", source, **options).success
    assert room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="late")).success
    assert put(room, "late", source, **options).success
    until = time.monotonic() + 1.0
    while time.monotonic() < until:
        late.feeder()
        room.spin(0.02)
        assert late.where("late")[1] != 0 and late.where("other")[1] != 0
    room.until(lambda: late.where("late") == late.where("other") == ([8, 0, 0], 0), "known again", then=lambda: late.send(kind, topic, 8.0))


def test_a_chain_that_never_changes_makes_a_late_body_known_at_once(room):
    late = Late(room)
    # its frame is the end of a chain that was said long ago
    assert put(room, "tip", "tf", ros_frame="arm_tip").success
    position, _ = room.until(lambda: (lambda w: w if w[1] == 0 else None)(late.where("tip")), "known", then=late.feeder)
    assert position == pytest.approx([0, 0.5, 1.0], abs=1e-9)


def test_what_does_not_fit_its_source_is_refused_and_a_shared_topic_is_told(room):
    late = Late(room)
    for source, options, word in [("poses", {}, "ros_topic"), ("odom", {"ros_frame": "x"}, "ros_topic"), ("tf", {"ros_topic": "/x"}, "ros_frame"),
                                  ("sim", {"ros_topic": "/x"}, "no ros2")]:  # fmt: skip
        answer = put(room, "odd", source, **options)
        assert not answer.success and word in answer.message, (source, options, answer.message)
    said = room.hear(DiagnosticArray, "/diagnostics")
    assert put(room, "twin", "poses", ros_topic="/tracker/person").success
    room.until(lambda: any("/tracker/person: it moves more than one body" in s.message for m in said[-2:] for s in m.status), "a word on it",
               then=late.feeder)  # fmt: skip


def test_bug_poses_by_name_move_a_body_that_the_answer_to_an_edit_or_a_revision_brings(room):
    # a new client of a service may be found later than a source may be silent
    patient = SCENE.replace('name = "sim"\ntimeout_ms = 500', 'name = "sim"\ntimeout_ms = 20000')
    assert patient != SCENE
    late = Late(room, patient)
    sim = late.feeder.sim
    # once, just behind the answer
    answer = put(room, "one", "sim")
    assert answer.success, answer.message
    sim.send({"one": (7.0, 0.0, 0.0)}, flags=BodyTransforms.PARTIAL)
    room.until(lambda: late.where("one") == ([7, 0, 0], 0), "known by one frame")
    # before the edit, once, with the revision that it needs: it waits
    number = sim.send({"two": (8.0, 0.0, 0.0)}, flags=BodyTransforms.PARTIAL, scene_rev=answer.scene_rev + 1)
    room.spin(0.2)
    assert put(room, "two", "sim").success
    room.until(lambda: late.where("two") == ([8, 0, 0], 0), "known by a frame that waited")
    room.until(lambda: [source.seq for source in late.ticks[-1].sources if source.name == "sim"] == [number], "by that very frame")


def test_bug_frames_that_wait_for_a_revision_that_never_comes_are_refused_at_any_rate(room):
    late = Late(room)
    refused = lambda: sum(source.refused for source in late.ticks[-1].sources if source.name == "sim")  # noqa: E731
    before, needed = refused(), late.ticks[-1].tick_header.scene_rev + 1

    def send_some():
        """200 Hz where the machine keeps up: within the time-out more come than may wait."""
        for _ in range(4):
            late.feeder.sim.send({"box": (4.0, 0.0, 0.0)}, scene_rev=needed)
            time.sleep(0.005)

    counted = lambda: late.ticks[-1].rejects[Tick.REJECT_SCENE_REVISION] >= 100 and refused() >= before + 100  # noqa: E731
    room.until(counted, "refused and counted", then=send_some)
