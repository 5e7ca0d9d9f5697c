"""A plain ROS 2 node that listens to sweepd and counts: `peer_echo.py [--seconds N] [--pause S]`, a line at the end.

`--pause` waits so long in each callback: a slow reader. `--ticks` listens to `~/tick`, too.
"""

import argparse
import time

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from sweepd_msgs.msg import Contacts, State, Tick

parser = argparse.ArgumentParser()
parser.add_argument("--seconds", type=float, default=5)
parser.add_argument("--pause", type=float, default=0)
parser.add_argument("--ticks", action="store_true")
args = parser.parse_args()

rclpy.init()
node = rclpy.create_node("peer_echo")
states, chunks = [0], {}


def contact(message):
    key = message.tick_header.tick
    chunks.setdefault(key, [0, message.chunk_count])[0] += 1
    time.sleep(args.pause)


def state(_message):
    states[0] += 1


node.create_subscription(Contacts, "/sweepd/contacts", contact, 10)
node.create_subscription(State, "/sweepd/state", state, 10)
if args.ticks:
    node.create_subscription(Tick, "/sweepd/tick", lambda message: None, 10)
executor = SingleThreadedExecutor()
executor.add_node(node)
until = time.monotonic() + args.seconds
while time.monotonic() < until:
    try:
        executor.spin_once(timeout_sec=0.1)
    except (ExternalShutdownException, RCLError):  # asked to end
        raise SystemExit from None
whole = [tick for tick, (got, count) in chunks.items() if got == count]
span = (max(whole) - min(whole) + 1) if whole else 0
print(f"states {states[0]} whole {len(whole)} of {span} first {min(whole, default=0)} last {max(whole, default=0)}", flush=True)
