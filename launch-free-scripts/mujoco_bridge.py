#!/usr/bin/env python3
"""Streams a MuJoCo simulation into sweepd, and checks its answers against MuJoCo's contacts.

Any MJCF that MuJoCo compiles: each geom that can collide becomes a body, meshes the hulls that MuJoCo collides,
planes half-spaces, height fields height fields; contype, conaffinity, welds, parents, excludes and pairs become
groups, rigid groups and pair rules. Then every simulated step is one frame, and one tick answers it (lockstep).

  mujoco_bridge.py models/pile.xml --spawn ../target/release/sweepd --compare --at-least 1000
  mujoco_bridge.py model.xml --scene-out scene.toml --steps 0     only writes the scene
  mujoco_bridge.py model.xml --instance lab                       streams to a daemon that runs scene.toml already
"""

import argparse
import json
import math
import os
import signal
import sys
import tempfile
from pathlib import Path

EPILOG = """\
With --compare the set of colliding pairs must be equal to MuJoCo's (contacts at margin 0, flags for sleep and margin
override off, the simulation itself untouched) in every step. A pair on which they differ is exempt only where MuJoCo's
distance, or that of a third judge (a search over directions with support functions), is within 1e-6 m of 0, and at
most 1 % of the colliding pair-steps may be; the count is printed. Not compared: pairs of two bodies that cannot move
(sweepd never pairs them), and flexes with --without-flex. Under a budget pairs may be left open: then every collision
must be among the colliding and possible ones, and none may be invented.

exit codes: 0 done and equal, 1 a difference, 2 usage, 3 sweepd did not answer in time, 4 refused or could not run
needs: pip install mujoco numpy iceoryx2==0.10.0, and pip install ./msgs/python
"""


def number(kind, least, beyond=False):
    """A reader of finite numbers from `least` on, or beyond it."""

    def read(text):
        value = kind(text)
        if not math.isfinite(value) or value < least or (beyond and value == least):
            raise argparse.ArgumentTypeError(f"{text}: write a number {'above' if beyond else 'not below'} {least}")
        return value

    # What argparse calls it where it is no number at all.
    read.__name__ = kind.__name__
    return read


def parse(arguments):
    """The command line."""
    lines = __doc__.split("\n\n")
    parser = argparse.ArgumentParser(
        description="\n\n".join(lines), epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("model", type=Path, metavar="MODEL.xml", help="an MJCF file")
    parser.add_argument("--compare", action="store_true", help="check every step against MuJoCo's contacts")
    parser.add_argument("--steps", type=number(int, 0), metavar="N",
                        help="stop after N steps (default: 500 with --compare, else never)")  # fmt: skip
    parser.add_argument("--at-least", type=int, default=0, metavar="N", help="with --compare: fewer colliding pair-steps are a failure")
    parser.add_argument("--ccd-tolerance", type=float, metavar="M",
                        help="of MuJoCo's answers in the comparison, e.g. 1e-10 (default: the model's, mostly 1e-6)")  # fmt: skip
    parser.add_argument("--rate", type=number(float, 0, beyond=True), metavar="HZ",
                        help="at most so many steps a second (default: as fast as answers come)")  # fmt: skip
    parser.add_argument("--realtime", action="store_true", help="as many steps a second as the model's timestep says")
    parser.add_argument("--spawn", type=Path, metavar="SWEEPD", help="start this daemon, and end it afterwards")
    parser.add_argument("--instance", metavar="NAME", help="of the daemon (default: one of its own with --spawn, else default)")
    parser.add_argument("--scene-out", type=Path, metavar="FILE", help="keep the scene here (default: a temporary file)")
    parser.add_argument("--budget-ms", type=number(float, 0), metavar="MS",
                        help="wall time of a tick, into the scene (default: no limit)")  # fmt: skip
    parser.add_argument("--budget-units", type=number(int, 0), metavar="N",
                        help="work units of a tick, into the scene (default: no limit)")  # fmt: skip
    parser.add_argument("--keyframe", metavar="NAME", help="start from this keyframe of the model")
    parser.add_argument("--ctrl-noise", type=number(float, 0), default=0.0, metavar="SHARE",
                        help="drive the actuators by smooth noise, in shares of their control range (default: 0, none)")  # fmt: skip
    parser.add_argument("--seed", type=number(int, 0), default=1, help="of that noise (default: %(default)s)")
    parser.add_argument("--hull-ellipsoids", action="store_true", help="turn ellipsoids into hulls of 162 points, in MuJoCo too")
    parser.add_argument("--hull-sdf", action="store_true", help="turn SDFs into the hulls of their meshes, in MuJoCo too")
    parser.add_argument("--without-flex", action="store_true", help="leave flexes out of the scene and the comparison")
    parser.add_argument("--timeout", type=number(float, 0, beyond=True), default=10.0, metavar="S",
                        help="for the daemon's answers (default: %(default)s s)")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="the summary as one line of JSON on stdout")
    chosen = parser.parse_args(arguments)
    if chosen.steps is None and chosen.compare:
        chosen.steps = 500
    if chosen.instance is None:
        chosen.instance = f"mujoco_{os.getpid()}" if chosen.spawn else "default"
    return chosen


def main(arguments=None):
    """Runs the bridge; returns the exit code."""
    chosen = parse(arguments)
    try:
        import mujoco
        import numpy  # noqa: F401
    except ImportError as error:
        print(f"mujoco_bridge: {error}: pip install mujoco numpy", file=sys.stderr)
        return 4
    from mujoco_bridge.model import Refused
    from mujoco_bridge.run import Run

    # Without a handler MuJoCo writes its warnings into a file in the current folder.
    mujoco.set_mju_user_warning(lambda text: print(f"mujoco_bridge: MuJoCo warns: {text}", file=sys.stderr))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        with tempfile.TemporaryDirectory(prefix="mujoco_bridge_") as folder:
            run = Run(chosen, chosen.scene_out or Path(folder) / "scene.toml")
            if chosen.steps != 0:
                run.drive()
    except Refused as error:
        print(f"mujoco_bridge: {error}", file=sys.stderr)
        return 4
    except TimeoutError as error:
        print(f"mujoco_bridge: sweepd did not answer: {error}", file=sys.stderr)
        return 3
    except KeyboardInterrupt:
        return 130
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"mujoco_bridge: {where}{error.strerror or error}", file=sys.stderr)
        return 4
    try:
        report(run, chosen)
        sys.stdout.flush()
    except BrokenPipeError:
        # Who read has gone: a normal end. Python would complain once more when it closes the stream.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        print(f"mujoco_bridge: standard output: {error.strerror}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 4
    return run.exit_code()


def report(run, chosen):
    """Says how it went."""
    summary = run.summary()
    if chosen.json:
        print(json.dumps(summary))
        return
    for line in summary.get("differences", []):
        print(line)
    for key, value in summary.items():
        if key != "differences":
            print(f"{key}: {value}")


if __name__ == "__main__":
    sys.exit(main())
