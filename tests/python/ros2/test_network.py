"""What leaves the host and what comes in from outside: nothing, in loopback mode. Needs root (name spaces)."""

import json
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import conftest
import pytest
from conftest import own_network
from frames import Sender
from rclpy.serialization import serialize_message
from scenes import HANDS
from sweepd_msgs.msg import State, Tick

FAR = {"left": (0, 0, 0), "right": (5, 0, 0)}
CLOSE = {"left": (0, 0, 0), "right": (0.5, 0, 0)}

pytestmark = pytest.mark.skipif(os.geteuid() != 0, reason="network name spaces need root")


def ip(*words):
    subprocess.run(["ip", *words], check=True)


class Lan:
    """A second host: its own name space on the other end of a cable; a thread lives there."""

    def __init__(self):
        ready, self._go, self.done = threading.Event(), threading.Event(), threading.Event()
        self._jobs, self._results = [], []

        def live():
            own_network()
            self.tid = threading.get_native_id()
            ready.set()
            while True:
                self._go.wait()
                self._go.clear()
                job = self._jobs.pop()
                if job is None:
                    return
                try:
                    self._results.append(job())
                finally:
                    self.done.set()

        self._thread = threading.Thread(target=live, daemon=True)
        self._thread.start()
        ready.wait()
        ip("link", "add", "cable", "type", "veth", "peer", "name", "cable2")
        ip("link", "set", "cable2", "netns", str(self.tid))
        ip("addr", "add", "10.77.0.1/24", "dev", "cable")
        ip("link", "set", "cable", "up")
        ip("route", "add", "224.0.0.0/4", "dev", "cable")
        self.run(lambda: ip("addr", "add", "10.77.0.2/24", "dev", "cable2"))
        self.run(lambda: ip("link", "set", "cable2", "up"))
        self.run(lambda: ip("route", "add", "default", "dev", "cable2"))

    def run(self, job):
        """Does it over there."""
        self.done.clear()
        self._jobs.append(job)
        self._go.set()
        self.done.wait()
        return self._results.pop()

    def start(self, args, env, **more):
        return self.run(lambda: subprocess.Popen(args, env=env, **more))

    def close(self):
        self._jobs.append(None)
        self._go.set()
        self._thread.join()


class Packets:
    """Every IPv4 packet that this host sends on the cable, by source port."""

    def __init__(self, device):
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.ntohs(0x0003))
        self.socket.bind((device, 0))
        self.socket.settimeout(0.2)
        self.sent = []
        self._run = True
        self._thread = threading.Thread(target=self._take, daemon=True)
        self._thread.start()

    def _take(self):
        while self._run:
            try:
                data, where = self.socket.recvfrom(65536)
            except TimeoutError:
                continue
            if where[2] == socket.PACKET_OUTGOING and data[12:14] == b"\x08\x00":
                start = 14 + 4 * (data[14] & 15)
                if data[23] == 17:
                    self.sent.append((struct.unpack(">HH", data[start : start + 4]), data[start + 8 :]))

    def stop(self):
        self._run = False
        self._thread.join()
        self.socket.close()
        return self.sent


def udp_ports(pid):
    """The ports the process has bound."""
    inodes = set()
    for fd in os.listdir(f"/proc/{pid}/fd"):
        try:
            link = os.readlink(f"/proc/{pid}/fd/{fd}")
        except FileNotFoundError:  # closed meanwhile, as at the start
            continue
        if link.startswith("socket:"):
            inodes.add(link[8:-1])
    rows = [line.split() for line in open(f"/proc/{pid}/net/udp").readlines()[1:]]
    return {int(row[1].split(":")[1], 16) for row in rows if row[9] in inodes}


@pytest.fixture
def lan(room):
    made = Lan()
    yield made
    made.close()


def test_in_loopback_mode_nothing_leaves_the_host_while_ros_runs_on_another(room, lan):
    packets = Packets("cable")
    daemon = room.daemon(HANDS)
    # nobody else of this host speaks yet: all that is heard now is the daemon's, whatever its port
    ours, until = set(), time.monotonic() + 2
    while time.monotonic() < until:
        ours |= udp_ports(daemon.pid)
        time.sleep(0.01)
    assert "on this host only" in daemon.log and ours, daemon.log
    assert packets.sent == [], "the start"
    node = room.node()
    env = room.env | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": "10.77.0.1"}
    beside = os.path.join(os.path.dirname(__file__), "peer_echo.py")
    other = lan.start([sys.executable, beside, "--seconds", "9"], env)
    states = room.hear(State, "/sweepd/state")
    sender = Sender(node)
    room.until(lambda: states and states[-1].word == "clear", "clear", then=lambda: sender.send(FAR))
    until = time.monotonic() + 8
    while time.monotonic() < until:
        sender.send(FAR)
        room.spin(0.1)
        ours |= udp_ports(daemon.pid)
    other.wait(timeout=15)
    # its farewell is in it, too
    assert daemon.stop()[0] == 0
    room.spin(0.5)
    sent = packets.stop()
    from_daemon = [ports for ports, _ in sent if ports[0] in ours]
    print(f"packets on the cable: {len(sent)} of this host, {len(from_daemon)} of the daemon's ports {sorted(ours)}")
    assert sent, "the rclpy node of this host is heard on the cable, so the ear works"
    assert from_daemon == []
    assert not [data for _, data in sent if b"colliding" in data or b"clear" in data]


@pytest.mark.parametrize(("reach", "heard"), [("SUBNET", True), ("LOCALHOST", False)])
def test_the_variable_that_is_said_opens_the_node_to_other_hosts(room, lan, reach, heard):
    daemon = room.daemon(HANDS, env={"ROS_AUTOMATIC_DISCOVERY_RANGE": reach})
    env = room.env | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    beside = os.path.join(os.path.dirname(__file__), "peer_echo.py")
    other = lan.start([sys.executable, beside, "--seconds", "9"], env, stdout=subprocess.PIPE, text=True)
    said, _ = other.communicate(timeout=40)
    print(f"{reach}: the other host says: {said.strip()}")
    assert (int(said.split()[1]) > 0) == heard
    assert ("on every network of this host" if heard else "on this host only") in daemon.log


def test_a_loopback_that_carries_the_multicast_flag_is_warned_of_with_what_to_do(room, monkeypatch):
    # /sys is that of the name space it was mounted in: the daemon gets one of the test's own
    own_sys = room.folder / "own_sys.sh"
    own_sys.write_text(f"#!/bin/sh\nexec unshare -m sh -c 'mount -t sysfs none /sys && exec \"$0\" \"$@\"' {conftest.SWEEPD} \"$@\"\n")
    own_sys.chmod(0o755)
    monkeypatch.setattr(conftest, "SWEEPD", str(own_sys))
    ip("link", "set", "lo", "multicast", "on")
    room.node()
    daemon = room.daemon(HANDS)
    words = "ip link set lo multicast off"
    room.until(lambda: words in daemon.log and "MULTICAST" in daemon.log, "a warning")
    assert daemon.stop()[0] == 0
    subprocess.run(words.split(), check=True)
    daemon = room.daemon(HANDS)
    room.until(lambda: "on this host only" in daemon.log, "the greeting")
    room.spin(0.5)
    assert "MULTICAST" not in daemon.log


def rtps_data(guid_prefix, writer, number, payload):
    """A user sample as RTPS says it, from this writer."""
    data = struct.pack("<HH", 0, 16) + bytes(4) + writer + struct.pack("<iI", 0, number) + payload
    submessage = struct.pack("<BBH", 0x15, 0x05, len(data)) + data
    return b"RTPS\x02\x03\x01\x0f" + guid_prefix + submessage


def test_forged_samples_from_another_host_are_not_taken(room, lan):
    daemon = room.daemon(HANDS)
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    states = room.hear(State, "/sweepd/state")
    sender = Sender(node)
    room.until(lambda: states and states[-1].word == "clear", "clear", then=lambda: sender.send(FAR))
    # the real writer's name, as the graph tells it to anybody
    gid = bytes(node.get_publishers_info_by_topic("/sweepd/transforms")[0].endpoint_gid)
    forger = Sender(node)
    forger.session = sender.session
    forger.seq = sender.seq + 1_000_000
    payload = bytes(serialize_message(forger.frame(CLOSE)))

    def forge(address):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for port in sorted(udp_ports(daemon.pid)):
                for number in range(1, 41):
                    try:
                        out.sendto(rtps_data(gid[:12], gid[12:16], sender.seq + number, payload), (address, port))
                    except OSError:
                        pass

    # from this host they are believed, which shows that the forgery is a good one
    lan.run(lambda: [forge("10.77.0.1") for _ in range(3)])
    until = time.monotonic() + 3
    seqs = []
    while time.monotonic() < until:
        sender.send(FAR)
        room.spin(0.05)
        seqs.append(ticks[-1].sources[0].seq)
    assert max(seqs) < 1_000_000, "a forged frame was taken"
    assert "colliding" not in {state.word for state in states}
    assert seqs[-1] >= sender.seq - 5, "genuine frames go on"
    forge("127.0.0.1")
    room.until(lambda: ticks[-1].sources[0].seq > 1_000_000, "the same forgery from this host is taken, so it was a good one")


def test_twenty_participants_all_match_and_all_hear(room, lan):
    room.daemon(HANDS)
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    contexts, heard, spinners, run = [], [], [], [True]
    for number in range(20):
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=room.domain)
        node = rclpy.create_node(f"reader_{number}", context=context)
        mine = []
        node.create_subscription(State, "/sweepd/state", mine.append, 10)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        contexts.append((context, node, executor))
        heard.append(mine)

    def spin():
        while run[0]:
            for _, _, executor in contexts:
                executor.spin_once(timeout_sec=0)
            time.sleep(0.005)

    spinners = threading.Thread(target=spin)
    start = time.monotonic()
    spinners.start()
    try:
        while not all(heard) and time.monotonic() - start < 20:
            time.sleep(0.05)
        print(f"{sum(map(bool, heard))} of 20 after {time.monotonic() - start:.1f} s")
        assert all(heard)
    finally:
        run[0] = False
        spinners.join()
        for context, node, executor in contexts:
            executor.shutdown()
            node.destroy_node()
            rclpy.shutdown(context=context)


def test_the_profile_for_fast_dds_gives_a_subscribers_sockets_room(room):
    most = int(Path("/proc/sys/net/core/rmem_max").read_text()) if Path("/proc/sys/net/core/rmem_max").exists() else 0
    if most < 4 << 20:
        pytest.skip(f"net.core.rmem_max is {most}, or not shown in this name space: the profile asks for 4 MB")
    room.daemon(HANDS)
    profile = Path(__file__).resolve().parents[3] / "launch-free-scripts/ros2/fastdds_profile.xml"
    largest = {}
    for name, env in (("without", {}), ("with", {"FASTDDS_DEFAULT_PROFILES_FILE": str(profile)})):
        said = json.loads(room.python("peer_sockets.py", 15, env=env).communicate(timeout=60)[0])
        assert said["heard"], name
        largest[name] = max(said["buffers"].values())
    # Linux doubles what is asked for
    assert largest["with"] == 8 << 20 > largest["without"], largest
