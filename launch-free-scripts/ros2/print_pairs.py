"""An rclpy node that prints what sweepd says: the state when it changes, and each pair that begins or ends.

    python print_pairs.py [--seconds N] [--node NAME]

Exits 0 when at least one collision began and ended, 1 when not; 0 at Ctrl-C.
"""

import time

import rclpy
from arguments import arguments, begin
from rclpy.executors import SingleThreadedExecutor
from sweepd_msgs.msg import Pair, Pairs, State

CAUSES = {getattr(Pair, name): name[4:].lower() for name in dir(Pair) if name.startswith("END_")}


class Printer:
    """Prints and counts."""

    def __init__(self, node, target):
        self.begun, self.ended = 0, 0
        self._word = None
        node.create_subscription(State, f"/{target}/state", self.state, 10)
        node.create_subscription(Pairs, f"/{target}/pairs", self.pairs, 10)

    def state(self, message):
        if message.word == self._word:
            return
        self._word = message.word
        why = ", ".join(message.reason_words)
        worst = f"; worst: {message.worst_name_a} and {message.worst_name_b}" if message.worst_name_a else ""
        print(f"tick {message.tick_header.tick}: {message.word}{f' ({why})' if why else ''}{worst}", flush=True)

    def pairs(self, message):
        for pair in message.pairs:
            names = f"{pair.name_a} and {pair.name_b}"
            if pair.events & Pair.END:
                self.ended += 1
                print(f"tick {message.tick_header.tick}:   end   {names} ({CAUSES[pair.end_cause]})", flush=True)
            if pair.events & Pair.BEGIN:
                self.begun += 1
                gap = f"gap {1000 * pair.gap_min_m:.1f} to {1000 * pair.gap_max_m:.1f} mm"
                print(f"tick {message.tick_header.tick}:   begin {names}, {gap}", flush=True)


def main():
    args = arguments()
    over = begin()
    node = rclpy.create_node("print_pairs")
    printer = Printer(node, args.node)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    until = time.monotonic() + args.seconds
    while not over and time.monotonic() < until:
        executor.spin_once(timeout_sec=0.1)
    if over:
        return 0
    print(f"{printer.begun} collisions began, {printer.ended} ended")
    return 0 if printer.begun and printer.ended else 1


if __name__ == "__main__":
    raise SystemExit(main())
