"""What the programs of the demo are told on their command line."""

import argparse


def arguments():
    """`seconds` to run, and the name of sweepd's `node`."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--node", default="sweepd", help="name of sweepd's node")
    return parser.parse_args()
