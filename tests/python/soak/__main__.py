"""Runs the soak by hand: one seed, or one after another; ends with 1 where a fault was found."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path as File

from .deeds import Mix
from .driver import MODES, Report, Soak


def soak(seed: int, mode: str, seconds: float, folder: File) -> Report:
    """One run, up to its first fault."""
    run = Soak(seed, mode, seconds, folder)
    try:
        now_s = time.monotonic()
        run.run(now_s + seconds, Mix(now_s, now_s + seconds))
    finally:
        run.close()
    return run.report


def main() -> int:
    """As the command line says."""
    parser = argparse.ArgumentParser(prog="python -m soak", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="the first one, where there are several (1)")
    parser.add_argument("--seeds", type=int, default=1, help="how many, one after another (1)")
    parser.add_argument("--mode", choices=[*MODES, "all"], default="all")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each run (60)")
    parser.add_argument("--counts", action="store_true", help="tells what was looked at")
    given = parser.parse_args()
    modes = MODES if given.mode == "all" else (given.mode,)
    faults = 0
    for seed in range(given.seed, given.seed + given.seeds):
        for mode in modes:
            folder = File(tempfile.mkdtemp(prefix="sweepd_soak_"))
            report = soak(seed, mode, given.seconds, folder)
            print(report, flush=True)
            if report.faults:
                print(f"  scenes and logs: {folder}", flush=True)
            if given.counts:
                print("  " + ", ".join(f"{what} {count}" for what, count in sorted(report.counts.items())), flush=True)
            faults += len(report.faults)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
