"""The node as ROS 2 users know nodes: its name, its graph, its QoS, remaps, exit."""

import contextlib
import os
import signal
import threading
import time
from pathlib import Path

import pytest
from frames import Sender
from parameters import set_parameter
from rcl_interfaces.msg import Log
from rclpy.duration import Duration
from rclpy.qos import QoSDurabilityPolicy, QoSReliabilityPolicy
from scenes import HANDS
from sweepd_msgs.msg import Pairs, State, Tick
from sweepd_msgs.srv import RemoveBody
from topics import SCENE as TOPICS

OUT = {"state": "State", "tick": "Tick", "pairs": "Pairs", "contacts": "Contacts", "names": "Names"}


def node_names(node):
    return {(namespace.rstrip("/") + "/" + name) for name, namespace in node.get_node_names_and_namespaces()}


def test_the_graph_shows_the_node_its_topics_and_types(room):
    room.daemon(HANDS)
    node = room.node()
    room.until(lambda: "/sweepd" in node_names(node), "the node in the graph")

    def published():
        return dict(node.get_publisher_names_and_types_by_node("sweepd", "/"))

    def wanted():
        there = published()
        return all(there.get(f"/sweepd/{topic}") == [f"sweepd_msgs/msg/{kind}"] for topic, kind in OUT.items())

    room.until(wanted, f"its topics: {published()}")
    assert published().get("/rosout") == ["rcl_interfaces/msg/Log"]
    assert published().get("/parameter_events") == ["rcl_interfaces/msg/ParameterEvent"]
    assert published().get("/diagnostics") == ["diagnostic_msgs/msg/DiagnosticArray"]

    def taken():
        return dict(node.get_subscriber_names_and_types_by_node("sweepd", "/"))

    # what it publishes is in the graph a moment earlier
    room.until(lambda: {"/sweepd/transforms", "/clock"} <= taken().keys(), "what it reads")
    assert taken()["/sweepd/transforms"] == ["sweepd_msgs/msg/BodyTransforms"]
    # `ros2 topic echo` and `ros2 bag record` refuse a topic that is shown with two types
    shown = dict(node.get_topic_names_and_types())
    assert {topic: kinds for topic, kinds in shown.items() if len(kinds) != 1} == {}
    assert shown["/clock"] == ["rosgraph_msgs/msg/Clock"]


def test_the_qos_offered_is_what_readers_need(room):
    room.daemon(HANDS)
    node = room.node()
    for topic, kind in OUT.items():
        # the node's name comes up to a second after its endpoints
        offers = room.until(lambda: [o for o in node.get_publishers_info_by_topic(f"/sweepd/{topic}") if o.node_name == "sweepd"], topic)
        (offer,) = offers
        assert offer.topic_type == f"sweepd_msgs/msg/{kind}"
        qos = offer.qos_profile
        assert qos.reliability == QoSReliabilityPolicy.RELIABLE, topic
        latched = QoSDurabilityPolicy.TRANSIENT_LOCAL if topic == "names" else QoSDurabilityPolicy.VOLATILE
        assert qos.durability == latched, topic
        if topic in ("state", "tick"):
            # a DDS time is a whole number of 2^-32 s
            assert abs(qos.deadline.nanoseconds - 200_000_000) <= 1, "two heartbeats"
            assert qos.liveliness_lease_duration == Duration(seconds=3)
    sub = room.until(lambda: node.get_subscriptions_info_by_topic("/sweepd/transforms"), "transforms")[0]
    assert sub.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT, "matches both kinds of sender"


def test_name_namespace_and_topics_are_remapped(room):
    room.daemon(HANDS, ros_args=["-r", "__node:=watch", "-r", "__ns:=/cell", "-r", "~/pairs:=/touching"])
    node = room.node()
    room.until(lambda: "/cell/watch" in node_names(node), "the remapped node")
    pairs = room.hear(Pairs, "/touching")
    ticks = room.hear(Tick, "/cell/watch/tick")
    sender = Sender(node, topic="/cell/watch/transforms")
    room.until(lambda: pairs and ticks and ticks[-1].colliding == 1, "a pair",
               then=lambda: sender.send({"left": (0, 0, 0), "right": (0.5, 0, 0)}))  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--enclave", "/x"], ["--enclave"]),
        (["-r", "~/pairs:=~/contacts"], ["~/pairs", "~/contacts"]),
        (["-r", "tick"], ["tick"]),
    ],
)
def test_what_cannot_be_honoured_is_refused_at_the_start(room, arguments, words):
    daemon = room.daemon(HANDS, ros_args=arguments)
    assert daemon.refusal() in (2, 4)
    assert all(word in daemon.log for word in words), daemon.log


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-r", "/tf:=~/transforms"], ["/tf", "~/transforms"]),
        (["-r", "/tf:=/tf_static"], ["/tf", "/tf_static"]),
        (["-r", "/tracker/person:=/cart/odom"], ["/tracker/person", "/cart/odom"]),
        (["-r", "~/pairs:=/tf"], ["/tf", "~/pairs"]),
    ],
)
def test_a_remap_of_a_sources_topic_onto_another_is_refused_at_the_start(room, arguments, words):
    daemon = room.daemon(TOPICS, ros_args=arguments)
    assert daemon.refusal() == 2
    assert "would both be" in daemon.log and all(word in daemon.log for word in words), daemon.log


@pytest.mark.parametrize(
    ("name", "value"), [("RMW_IMPLEMENTATION", "rmw_zenoh_cpp"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"), ("ROS_DOMAIN_ID", "many")]
)  # fmt: skip
def test_an_environment_that_cannot_be_honoured_is_refused_by_name(room, name, value):
    daemon = room.daemon(HANDS, env={name: value})
    assert daemon.refusal() in (2, 4)
    assert name in daemon.log and value in daemon.log


def test_loopback_is_said_at_the_start_with_the_variable_that_opens_it(room):
    daemon = room.daemon(HANDS)
    room.node()
    room.until(lambda: "ROS_AUTOMATIC_DISCOVERY_RANGE" in daemon.log, "the hint")


def test_a_variable_that_is_set_is_not_advised(room):
    daemon = room.daemon(HANDS, env={"ROS_LOCALHOST_ONLY": "1", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"})
    room.node()
    room.until(lambda: "on this host only, because ROS_LOCALHOST_ONLY=1 says so" in daemon.log, "what keeps it here")


@pytest.mark.parametrize(("level", "heard"), [("info", {"INFO", "WARN"}), ("warn", {"WARN"}), ("error", set())])
def test_the_log_level_holds_for_rosout_and_for_stderr(room, level, heard):
    daemon = room.daemon(HANDS, ros_args=["--log-level", level, "-p", "ros.allow_edits:=true"])
    node = room.node()
    logs = room.hear(Log, "/rosout")
    ticks = room.hear(Tick, "/sweepd/tick")
    room.until(lambda: ticks and node.count_publishers("/rosout") > 1, "the node, and its way to /rosout")
    # each set is a line of level INFO, each edit of a body that is not there one of level WARN
    wanted = {"INFO": Log.INFO, "WARN": Log.WARN}
    for number in range(10):
        set_parameter(room, "ros_max_pairs", 100 + number)
        assert not room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="nobody")).success
        room.spin(0.05)
    said = {name for name, code in wanted.items() if any(log.name == "sweepd" and log.level == code for log in logs)}
    assert said == heard, [(log.level, log.msg) for log in logs]
    assert {name for name in wanted if name in daemon.log} == heard, daemon.log


def paths_below(*roots):
    """What is in these folders at any depth; others may come and go meanwhile."""
    return {Path(folder, name) for root in roots for folder, dirs, files in os.walk(root) for name in dirs + files}


def iceoryx_paths(pid):
    """The files in shared memory and in iceoryx2's folder that are the process's: mapped, open, or of its nodes."""
    shared, nodes = Path("/dev/shm"), Path("/tmp/iceoryx2/nodes")
    mapped = {Path(line.split(maxsplit=5)[5]) for line in Path(f"/proc/{pid}/maps").read_text().splitlines() if "/dev/shm/" in line}
    opened = set()
    for fd in os.listdir(f"/proc/{pid}/fd"):
        with contextlib.suppress(FileNotFoundError):  # closed meanwhile
            opened.add(Path(os.readlink(f"/proc/{pid}/fd/{fd}")))
    # it may look into another's node, but it holds the lock of its own ones only
    own = {path.stem.removeprefix("iox2_") for path in opened if path.suffix == ".node_monitor_owner_lock"}
    of_nodes = {path for path in paths_below(nodes) if any(name in str(path) for name in own)}
    return mapped | of_nodes | {path for path in opened if {shared, nodes.parent / "services"} & set(path.parents)}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_at_exit_the_name_leaves_the_graph_at_once_and_nothing_is_left(room, number):
    before = paths_below("/dev/shm", "/tmp/iceoryx2")
    daemon = room.daemon(HANDS)
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    room.until(lambda: ticks and "/sweepd" in node_names(node), "the node at work")
    paths = iceoryx_paths(daemon.pid) - before
    # iceoryx2 names its files itself, so those of this daemon are known by what it has mapped and opened
    assert len([path for path in paths if path.name.startswith("iox2_")]) > 10 and any(path.is_dir() for path in paths), paths
    done = {}
    waiter = threading.Thread(target=lambda: done.update(zip(("code", "seconds"), daemon.stop(number))))
    start = time.monotonic()
    waiter.start()
    room.until(lambda: "/sweepd" not in node_names(node), "the name gone", seconds=4)
    gone = time.monotonic() - start
    waiter.join()
    print(f"exit: code {done['code']} after {done['seconds']:.2f} s, the name gone after {gone:.2f} s")
    assert done["code"] == 0 and done["seconds"] < 2 and gone < 2
    assert [path for path in Path("/dev/shm").glob(f"*{room.instance}*")] == []
    assert [path for path in paths if path.exists()] == []


def test_without_the_flag_there_is_no_socket_and_no_thread_of_dds(room):
    with_node = room.daemon(HANDS)
    room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    room.until(lambda: ticks, "a node at work")

    def counts(pid):
        tasks = len(os.listdir(f"/proc/{pid}/task"))
        links = [os.readlink(f"/proc/{pid}/fd/{fd}") for fd in os.listdir(f"/proc/{pid}/fd")]
        return tasks, sum(link.startswith("socket:") for link in links)

    plain = room.plain_daemon(HANDS)
    room.until(lambda: "runs" in plain.log, "the plain daemon")
    plain_threads, plain_sockets = counts(plain.pid)
    threads, sockets = counts(with_node.pid)
    assert sockets >= 5 and threads >= plain_threads + 3
    threads_of = lambda pid: [comm.read_text().strip() for comm in Path(f"/proc/{pid}/task").glob("*/comm")]  # noqa: E731
    of_dds = lambda pid: {name for name in threads_of(pid) if name.startswith(("ros-", "RustDDS"))}  # noqa: E731
    assert {name.split("-")[0].split()[0] for name in of_dds(with_node.pid)} == {"ros", "RustDDS"}, threads_of(with_node.pid)
    assert of_dds(plain.pid) == set()
    # iceoryx2's events are Unix sockets or files; none is of the internet
    tables = [Path(f"/proc/{plain.pid}/net/{kind}") for kind in ("udp", "tcp", "udp6", "tcp6")]
    inet = {line.split()[9] for table in tables if table.exists() for line in table.read_text().splitlines()[1:]}
    links = [os.readlink(f"/proc/{plain.pid}/fd/{fd}") for fd in os.listdir(f"/proc/{plain.pid}/fd")]
    assert not [link for link in links if link.startswith("socket:") and link[8:-1] in inet]
