"""The smallest source: moves one body of a running daemon through the others of its source and prints what touches.

Start a daemon (`sweepd run SCENE`), then: python minimal.py BODY [OTHER ..] [--instance NAME] [--source NAME] [--steps N]

A frame has the poses of all bodies of its source, so name them all: one that is left out becomes unknown, and of what is
unknown no touch is proved. The first body goes along x, one centimetre a step; the others stand at 1 m, 2 m, 3 m ...
"""

import argparse

import sweepd

UPRIGHT = (0.0, 0.0, 0.0, 1.0)

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("body", help="name of the body to move along x")
parser.add_argument("others", nargs="*", help="names of all other bodies of the source")
parser.add_argument("--instance", default="default", help="instance of the daemon (default: %(default)s)")
parser.add_argument("--source", default="sim", help="source the scene gives the bodies to (default: %(default)s)")
parser.add_argument("--steps", type=int, default=100, help="frames to send (default: %(default)s)")
args = parser.parse_args()

client = sweepd.Client(args.instance, args.source, quat_order="xyzw")
poses = {name: ((float(at), 0.0, 0.0), UPRIGHT) for at, name in enumerate(args.others, start=1)}
for step in range(args.steps):
    poses[args.body] = ((0.01 * step, 0.0, 0.0), UPRIGHT)
    result = client.step(poses, timeout_s=1.0)
    print(step, result.state, [(client.name_of(a), client.name_of(b)) for a, b in result.colliding])
