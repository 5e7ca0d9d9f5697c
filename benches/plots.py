#!/usr/bin/env python3
"""The pictures of the README, from the committed CSV files.

    python3 benches/plots.py [--error]

Needs `pip install matplotlib`. `--error` first makes `results/error.csv` anew, with `target/release/sweepd`: a pool of 400
mixed bodies, at each of some budgets. Writes `results/anytime.svg` and `results/broad.svg`.
"""

import argparse
import csv
import json
import subprocess
import tempfile
from pathlib import Path

import matplotlib
from provenance import commit, compiler, machine

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

RESULTS = Path(__file__).parent / "results"
SWEEPD = Path(__file__).parents[1] / "target/release/sweepd"
# Okabe and Ito's colours, which those who see fewer colours tell apart too.
BLUE, ORANGE, GREEN, RED, GREY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#8c8c8c"
# Columns of the report that are kept.
COLUMNS = ["budget_ns", "undecided_share", "guess_error_share", "width_mean_m", "onset_p50_ticks", "onset_p99_ticks",
           "time_p50_ns", "time_p99_ns", "wrong", "excluded"]
# Peers as `broad.csv` names them, and how a reader knows them.
PEERS = {"parry": "parry3d Bvh", "rapier": "rapier3d BVH", "physx-abp": "PhysX ABP", "bullet-dbvt": "Bullet dbvt"}
SCENES = {"gas": "gas, all moving", "mixed": "mixed sizes", "galaxy": "galaxy", "sheet": "sheet", "churn": "churn 1 %",
          "teleport": "teleport 5 %", "fast": "fast", "pile": "pile with floor", "static1": "1 % moving"}


def make_error_csv() -> None:
    """Runs the report of error against run time, and keeps its table."""
    with tempfile.TemporaryDirectory() as folder:
        pool = Path(folder) / "pool.toml"
        subprocess.run([SWEEPD, "feed", "--write-scene", pool, "--count", "400"], check=True, stdout=subprocess.DEVNULL)
        report = subprocess.run([SWEEPD, "report", "error", pool, "--json"], check=True, capture_output=True)
    told = json.loads(report.stdout)
    start = {"machine": machine(), "commit": commit(), "compiler": compiler()}
    start |= {"seed": told["seed"], "bodies": told["bodies"]}
    with open(RESULTS / "error.csv", "w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [*start, *COLUMNS], extrasaction="ignore", lineterminator="\n")
        table.writeheader()
        table.writerows(start | row for row in told["rows"])


def rows_of(name: str) -> list[dict[str, str]]:
    """The rows of a CSV of results."""
    with open(RESULTS / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def style(axes: plt.Axes) -> None:
    """A quiet frame."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)


def save(figure: plt.Figure, name: str) -> None:
    """As text that stays text, the same for the same data."""
    figure.savefig(RESULTS / name, metadata={"Date": None}, facecolor="white")
    plt.close(figure)


def anytime() -> None:
    """Left: error of a scene against the time of a tick. Right: pairs of meshes decided against time, by method."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.4), layout="constrained")
    rows = [row for row in rows_of("error.csv") if row["budget_ns"]]
    time_us = [float(row["time_p50_ns"]) / 1e3 for row in rows]
    lines = [("undecided_share", "pairs undecided", BLUE), ("guess_error_share", "last verdict not the truth", RED)]
    for column, name, colour in lines:
        left.plot(time_us, [100 * float(row[column]) for row in rows], "o-", color=colour, label=name, markersize=4)
    left.set(xlabel="time of a tick, p50, us", ylabel="share of pairs, %", ylim=(-2, 104))
    left.set_title("400 mixed bodies: error against run time", fontsize=10)
    left.legend(frameon=False, fontsize=8)
    style(left)
    cold = [row for row in rows_of("time_critical.csv") if row["case"] == "cold" and row["budget"].endswith("us")]
    methods = [("carried", "sweepd", BLUE, "-"), ("walk", "walk over boxes", GREEN, "--"),
               ("priority", "priority queue", ORANGE, "--"), ("breadth_first", "breadth first (Hubbard)", GREY, "--")]
    for method, name, colour, dashes in methods:
        points = [(float(row["budget"][:-2]) / 1e3, 100 - float(row["unresolved_percent"])) for row in cold
                  if row["method"] == method]
        right.plot(*zip(*sorted(points)), dashes, marker="o", color=colour, label=name, markersize=3.5)
    right.set(xscale="log", xlabel="budget, ms", ylabel="pairs decided, %", ylim=(-2, 104))
    right.xaxis.set_major_formatter("{x:g}")
    right.set_title("200 pairs of meshes of 19,880 triangles, cold", fontsize=10)
    right.legend(frameon=False, fontsize=8)
    style(right)
    save(figure, "anytime.svg")


def broad() -> None:
    """Mean time of a frame of each broad phase, by scene."""
    rows = [row for row in rows_of("broad.csv") if row["bodies"] == "100000"]
    figure, axes = plt.subplots(figsize=(9.6, 4.2), layout="constrained")
    height = 0.16
    methods = {"order": "sweepd"} | PEERS
    colours = [BLUE, ORANGE, GREEN, RED, GREY]
    for at, (method, name) in enumerate(methods.items()):
        here = {row["scene"]: float(row["mean_us"]) / 1e3 for row in rows if row["method"] == method and row["mean_us"]}
        places = [(place + at * height, here[scene]) for place, scene in enumerate(SCENES) if scene in here]
        axes.barh([y for y, _ in places], [x for _, x in places], height=height, color=colours[at], label=name)
    axes.set(xscale="log", xlabel="mean time of a frame, ms (logarithmic); no bar: not done within 120 s")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks([place + 2 * height for place in range(len(SCENES))], SCENES.values())
    axes.invert_yaxis()
    axes.set_title("broad phase, 100,000 bodies, one thread", fontsize=10)
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    style(axes)
    save(figure, "broad.svg")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--error", action="store_true", help="make results/error.csv anew")
    if parser.parse_args().error:
        make_error_csv()
    # Text as text, and names of parts that do not change from run to run.
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "sweepd", "font.size": 9, "font.family": "sans-serif"})
    anytime()
    broad()


if __name__ == "__main__":
    main()
