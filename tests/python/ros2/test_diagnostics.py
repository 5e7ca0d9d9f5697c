"""`/diagnostics`: each level of each part, with the reason, and back to OK when the trouble is over."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from frames import Sender
from parameters import set_parameter
from scenes import cloud
from sweepd_msgs.msg import State
from topics import SCENE
from topics import Feeder as Topics

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
FAR = {"b0000": (0, 0, 0), "b0001": (5, 0, 0)}
# The spheres' boxes overlap, the spheres do not.
CORNERS = {"b0000": (0, 0, 0), "b0001": (0.7, 0.7, 0.7)}


class Doctor:
    """The newest status of each part of the node, and hands that feed it."""

    def __init__(self, room, send):
        self.room, self.send = room, send
        self.heard = room.hear(DiagnosticArray, "/diagnostics")

    def part(self, name):
        """Level and message of a part."""
        found = [s for s in self.heard[-1].status if s.name == f"/sweepd: {name}"] if self.heard else []
        return (found[0].level, found[0].message) if found else (None, "")

    def until(self, name, level, *words, seconds=15):
        """Feeds until the part has that level with these words."""
        fits = lambda: self.part(name)[0] == level and all(word in self.part(name)[1] for word in words)  # noqa: E731
        self.room.until(fits, f"{name} with level {level} and {words}", seconds, then=self.send)
        return self.part(name)[1]


def fed(room):
    """Two spheres, sent all the time; what is sent can be exchanged."""
    room.daemon(cloud(2, timeout_ms=500), ros_args=["-p", "ros.allow_edits:=true"])
    node = room.node()
    sender = Sender(node)
    poses, on = {**FAR}, [True]
    states = room.hear(State, "/sweepd/state")
    doctor = Doctor(room, lambda: on[0] and sender.send(poses))
    room.until(lambda: states and states[-1].word == "clear", "clear", then=doctor.send)
    return doctor, poses, on


def test_a_node_in_order_is_ok_in_every_part_once_a_second(room):
    doctor, _, _ = fed(room)
    for part in ("state", "budget", "sources", "ros2"):
        doctor.until(part, OK)
    assert doctor.part("state")[1] == "clear"
    start = len(doctor.heard)
    for _ in range(60):
        doctor.send()
        room.spin(0.05)
    assert 2 <= len(doctor.heard) - start <= 4, "three seconds"
    status = doctor.heard[-1].status[0]
    assert status.hardware_id == "sweepd" and {value.key: value.value for value in status.values}["bodies"] == "2"


def test_a_collision_is_an_answer_and_what_is_not_decided_a_warning(room):
    doctor, poses, _ = fed(room)
    poses.update(b0001=(0.5, 0, 0))
    assert doctor.until("state", OK, "colliding") == "colliding"
    set_parameter(room, "budget_units", 0)
    poses.update(CORNERS)
    doctor.until("state", WARN, "possible", "undecided")
    values = {value.key: value.value for value in doctor.heard[-1].status[0].values}
    assert values["possible"] == "1"
    set_parameter(room, "budget_units", -1)
    doctor.until("state", OK, "clear")


def test_a_budget_that_is_missed_is_a_warning_then_an_error_and_over_when_it_is_raised(room):
    doctor, _, _ = fed(room)
    doctor.until("budget", OK)
    # a microsecond: no tick can keep it
    set_parameter(room, "budget_ms", 0.001)
    levels = []

    def noted():
        levels.append(doctor.part("budget"))
        return levels[-1][0] == ERROR

    room.until(noted, "an error", then=doctor.send)
    warnings = [message for level, message in levels if level == WARN]
    assert warnings and "ended after their budget" in warnings[0]
    assert "raise budget_ms" in levels[-1][1]
    set_parameter(room, "budget_ms", -1.0)
    doctor.until("budget", OK, "within")


def test_a_silent_source_is_an_error_by_its_name(room):
    doctor, _, on = fed(room)
    doctor.until("sources", OK)
    on[0] = False
    doctor.until("sources", ERROR, "silent", "sim")
    doctor.until("state", ERROR, "unknown", "stale")
    on[0] = True
    doctor.until("sources", OK)
    doctor.until("state", OK, "clear")


def test_refused_poses_are_a_warning_with_the_reason_and_their_number(room):
    doctor, poses, _ = fed(room)
    doctor.until("sources", OK)
    poses.update(b0001=((5, 0, 0), (0, 0, 0, 0)))
    doctor.until("sources", WARN, "refused in the last second", "bad_quaternion")
    doctor.until("state", ERROR, "unknown", "rejected")
    poses.update(FAR)
    doctor.until("sources", OK)
    doctor.until("state", OK, "clear")


def test_faults_of_topics_are_a_warning_and_go_when_they_are_mended(room):
    room.daemon(SCENE)
    topics = Topics(room, room.node())
    doctor = Doctor(room, topics)
    states = room.hear(State, "/sweepd/state")
    room.until(lambda: states and states[-1].word == "clear", "clear: every link has come", then=topics)
    doctor.until("ros2", OK)
    topics.skip = {"elbow"}
    doctor.until("ros2", WARN, "body hand", "older than")
    topics.skip = set()
    doctor.until("ros2", OK)
