"""The smallest source: moves one body of a running daemon and prints what it touches.

Start a daemon (`sweepd run SCENE`), then: python minimal.py BODY [--instance NAME] [--source NAME] [--steps N]
"""

import argparse

import sweepd

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("body", help="name of the body to move along x")
parser.add_argument("--instance", default="default", help="instance of the daemon (default: %(default)s)")
parser.add_argument("--source", default="sim", help="source the scene gives the body to (default: %(default)s)")
parser.add_argument("--steps", type=int, default=100, help="frames to send (default: %(default)s)")
args = parser.parse_args()

client = sweepd.Client(args.instance, args.source, quat_order="xyzw")
for step in range(args.steps):
    result = client.step({args.body: ((0.01 * step, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))}, timeout_s=1.0)
    print(step, result.state, result.colliding.tolist())
