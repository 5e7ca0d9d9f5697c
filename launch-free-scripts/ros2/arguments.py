"""What the programs of the demo are told, on their command line and by Ctrl-C."""

import argparse
import signal

import rclpy
from rclpy.signals import SignalHandlerOptions


def arguments():
    """`seconds` to run, the name of sweepd's `node`, and whether it runs on this host."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--node", default="sweepd", help="name of sweepd's node")
    parser.add_argument("--same-host", action="store_true", help="sweepd runs on this host: say when frames were sent, so that ages count from that")
    return parser.parse_args()


def begin():
    """Begins ROS; returns a list that is empty until Ctrl-C.

    An exception out of a signal's handler, as Python has it for Ctrl-C, may come up in the middle of rclpy's conversions,
    which make another error of it; and rclpy's own handler takes the context away from who publishes.
    """
    over = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.append(True))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    return over
