"""A room for each test: a network name space (where root allows), a ROS domain, daemons, and rclpy nodes that the test
itself spins. Everything is found by waiting for data, never by counting endpoints: those of a gone process stay in the
graph for 50 s.

Needs the environment of launch-free-scripts/ros2_env.sh and `SWEEPD=path/to/sweepd`.
"""

import ctypes
import itertools
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "msgs/python"))

SWEEPD = os.environ.get("SWEEPD")
PATIENCE_S = 15.0
RELIABLE = QoSProfile(depth=100, reliability=QoSReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=100, reliability=QoSReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=100, reliability=QoSReliabilityPolicy.RELIABLE, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)

_CLONE_NEWNET = 0x40000000
# Tests that run side by side take turns at the domains, from a place that differs from run to run.
_workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
_run = os.getppid() if _workers > 1 else os.getpid()
_domains = itertools.cycle(range(1 + _run % 50 + _worker, 100, _workers))


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: minutes long; runs with SWEEPD_CI_SLOW=1")


def pytest_collection_modifyitems(config, items):
    for item in items:
        if "room" in getattr(item, "fixturenames", ()) and not SWEEPD:
            item.add_marker(pytest.mark.skip(reason="SWEEPD names no binary"))
        if item.get_closest_marker("slow") and os.environ.get("SWEEPD_CI_SLOW") != "1":
            item.add_marker(pytest.mark.skip(reason="slow: set SWEEPD_CI_SLOW=1"))


def own_network():
    """Gives this thread, and what it starts from now on, a network name space with loopback only; False: not allowed."""
    if os.geteuid() != 0 or ctypes.CDLL(None, use_errno=True).unshare(_CLONE_NEWNET) != 0:
        return False
    return subprocess.run(["ip", "link", "set", "lo", "up"], check=False).returncode == 0


class Daemon:
    """A running `sweepd run`."""

    def __init__(self, args, env, log):
        self.log_path = log
        # Whether a test has seen it refuse to start.
        self.refused = False
        with log.open("w") as file:
            self.process = subprocess.Popen(args, env=env, stdout=file, stderr=subprocess.STDOUT)

    @property
    def log(self):
        """What it has said."""
        return self.log_path.read_text()

    @property
    def pid(self):
        return self.process.pid

    def send(self, number):
        self.process.send_signal(number)

    def refusal(self):
        """Waits for a daemon that must not start; its exit code."""
        code = self.process.wait(timeout=PATIENCE_S)
        self.refused = code in (2, 4)
        return code

    def stop(self, number=signal.SIGINT):
        """Its exit code and how long it took, seconds."""
        start = time.monotonic()
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.process.wait(timeout=PATIENCE_S), time.monotonic() - start

    def memory_kb(self):
        """Resident memory, KiB."""
        status = Path(f"/proc/{self.pid}/status").read_text()
        return int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1])

    def cpu_s(self):
        """CPU time of its threads so far, seconds; `stat` would only say on whom the clock's beat fell."""
        tasks = Path(f"/proc/{self.pid}/task").iterdir()
        return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks) / 1e9

    def wakes(self):
        """How often its threads have slept and were woken so far."""
        states = ((task / "status").read_text() for task in Path(f"/proc/{self.pid}/task").iterdir())
        return sum(int(state.rpartition("\nvoluntary_ctxt_switches:")[2].split()[0]) for state in states)


class Room:
    """What one test has for itself."""

    def __init__(self, folder):
        self.folder = folder
        self.private = own_network()
        self.domain = next(_domains)
        self.instance = f"r{os.getpid()}_{self.domain}_{time.monotonic_ns() % 10**6}"
        self.env = {key: value for key, value in os.environ.items() if not key.startswith(("ROS_", "RMW_"))}
        self.env["ROS_DOMAIN_ID"] = str(self.domain)
        if not self.private:
            self.env["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self.daemons = []
        self.peers = []
        self.nodes = []
        self._context = None
        self._executor = None
        self._clients = []

    def daemon(self, scene, *flags, ros_args=(), env=None, instance=None):
        """Starts a daemon with a ROS 2 node on a scene (TOML text)."""
        more = ["--ros-args", *ros_args] if ros_args else []
        return self._start(scene, ["--instance", instance or self.instance, "--ros2", *flags, *more], env)

    def plain_daemon(self, scene, *flags):
        """Starts a daemon without a ROS 2 node, instance `.._plain`."""
        return self._start(scene, ["--instance", f"{self.instance}_plain", *flags], None)

    def _start(self, scene, flags, env):
        number = len(self.daemons)
        path = self.folder / f"scene_{number}.toml"
        path.write_text(scene)
        args = [SWEEPD, "run", str(path), *flags]
        made = Daemon(args, self.env | (env or {}), self.folder / f"daemon_{number}.log")
        self.daemons.append(made)
        return made

    def python(self, script, *args, env=None, stdout=subprocess.PIPE):
        """Starts another process of this environment on a script beside this file."""
        path = Path(__file__).parent / script
        peer = subprocess.Popen(
            [sys.executable, str(path), *map(str, args)], env=self.env | (env or {}), stdout=stdout, text=True
        )
        self.peers.append(peer)
        return peer

    def node(self, name="peer", **options):
        """An rclpy node in the room's domain."""
        if self._context is None:
            self._context = rclpy.Context()
            rclpy.init(context=self._context, domain_id=self.domain)
            self._executor = SingleThreadedExecutor(context=self._context)
        node = rclpy.create_node(name, context=self._context, **options)
        self.nodes.append(node)
        self._executor.add_node(node)
        return node

    def hear(self, kind, topic, qos=RELIABLE, node=None, keep=None, **options):
        """A list that fills with the messages of a topic; `keep` makes something of each."""
        heard = []
        node = node or (self.nodes[0] if self.nodes else self.node())
        take = heard.append if keep is None else lambda message: heard.append(keep(message))
        node.create_subscription(kind, topic, take, qos, **options)
        return heard

    def client(self, source=None, listen=("pairs", "contacts", "bodies")):
        """A client over shared memory."""
        import sweepd

        made = sweepd.Client(self.instance, source, quat_order="xyzw", timeout_s=PATIENCE_S, listen=listen)
        self._clients.append(made)
        return made

    def spin(self, seconds):
        """Serves the nodes for so long."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def until(self, condition, what, seconds=PATIENCE_S, then=None):
        """Serves the nodes until the condition holds; `then` runs at most each 20 ms. Returns what it is."""
        until = time.monotonic() + seconds
        beat = 0.0
        while not (value := condition()):
            if time.monotonic() > until:
                logs = "\n".join(daemon.log[-3000:] for daemon in self.daemons)
                raise AssertionError(f"not within {seconds} s: {what}\n{logs}")
            if then is not None and time.monotonic() - beat >= 0.02:
                beat = time.monotonic()
                then()
            self._executor.spin_once(timeout_sec=0.005)
        return value

    def call(self, kind, name, request=None, seconds=PATIENCE_S, node=None, each_s=math.inf, then=None):
        """Calls a service and returns its answer; asks anew each `each_s`, for a question that may be asked twice.

        `then`: what must go on meanwhile, as in `until`. On a busy machine it takes a second until a new client and
        the service have found each other, longer than a source may be silent.
        """
        node = node or (self.nodes[0] if self.nodes else self.node())
        client = node.create_client(kind, name)
        self.until(client.service_is_ready, f"service {name}", seconds, then)
        futures, asked = [], -math.inf

        def ask():
            nonlocal asked
            if time.monotonic() - asked >= each_s or not futures:
                asked = time.monotonic()
                futures.append(client.call_async(request or kind.Request()))
            if then is not None:
                then()

        answered = self.until(lambda: [f for f in futures if f.done()], f"an answer of {name}", seconds, then=ask)
        node.destroy_client(client)
        return answered[0].result()

    def close(self):
        for client in self._clients:
            client.close()
        for peer in self.peers:
            if peer.poll() is None:
                peer.send_signal(signal.SIGCONT)
                peer.terminate()
            peer.wait(timeout=PATIENCE_S)
        if self._context is not None:
            self._executor.shutdown()
            for node in self.nodes:
                node.destroy_node()
            rclpy.shutdown(context=self._context)
        ends = []
        for daemon in self.daemons:
            if daemon.process.poll() is None:
                daemon.send(signal.SIGCONT)
            ends.append(daemon.stop()[0])
        return ends


@pytest.fixture
def room(tmp_path):
    made = Room(tmp_path)
    yield made
    ends = made.close()
    bad = [(end, daemon.log[-2000:]) for end, daemon in zip(ends, made.daemons) if end not in (0, -signal.SIGKILL) and not daemon.refused]
    assert not bad, bad
