"""A client in a process of its own, to be stopped and killed. SIGINT ends it in good order.

    python -m soak.child source INSTANCE SOURCE BASE BODIES.json PAUSE_S
    python -m soak.child reader INSTANCE

The source prints its session, then sends full frames without end: the one of number ``n`` has the poses of step
``BASE + n``, which is its stamp. The reader listens and does nothing.
"""

from __future__ import annotations

import json
import sys
import time

import sweepd

from .paths import Path


def source(instance: str, name: str, base: str, bodies: str, pause_s: str) -> None:
    """Sends until it is killed."""
    with open(bodies, encoding="utf-8") as file:
        paths = {body: Path.read(keys) for body, keys in json.load(file).items()}
    with sweepd.Client(instance, name, quat_order="xyzw", listen=(), timeout_s=60) as client:
        print(client.session, flush=True)
        sent = 0
        while True:
            stamp = int(base) + sent + 1
            try:
                number = client.send({body: path.at(stamp) for body, path in paths.items()}, stamp_ns=stamp)
                assert number == sent + 1, (number, sent)
                sent = number
            except (sweepd.Restarted, sweepd.TimedOut):
                # the daemon is away, or another one
                pass
            time.sleep(float(pause_s))


def reader(instance: str) -> None:
    """Listens until it is killed."""
    topics = ("pairs", "changes", "contacts", "contact_changes", "bodies")
    with sweepd.Client(instance, None, quat_order="xyzw", listen=topics, timeout_s=60) as client:
        print("listens", flush=True)
        while True:
            try:
                client.wait(1.0)
            except (sweepd.Restarted, sweepd.TimedOut):
                pass


if __name__ == "__main__":
    try:
        {"source": source, "reader": reader}[sys.argv[1]](*sys.argv[2:])
    except KeyboardInterrupt:
        pass
