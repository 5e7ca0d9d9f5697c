#!/usr/bin/env python3
"""Pairs of meshes to the end, cold, beside parry3d-f64, coal and FCL.

    python3 benches/mesh_peers.py [--rounds N] [--csv FILE] [--no-cpp]

Needs `pip install coal python-fcl numpy` (here: 3.0.3, 0.7.0.11). For FCL from C++ it installs by apt-get what is not
there of g++ and libfcl-dev, and compiles for some three minutes, once; `--no-cpp` leaves that out.

200 pairs of closed meshes of 19,880 triangles at the same poses, each asked for its verdict, then for its distance where
it is apart, or for all its contacts where it touches. CPU time of one thread around each single call, libraries one
after the other in each round; the median of a pair's rounds counts. sweepd and parry3d-f64 are called from Rust
(`cargo bench --bench time_critical -- peers FOLDER`, once a round); coal and FCL from Python, so that a Python call is
in their time: what it takes is measured with two distant spheres and told beside them ("call"). That holds no contact:
python-fcl's `collide` also builds a Python object and four numpy arrays for each contact; coal's results stay in C++.
So FCL is also called from C++ ("fcl-cpp": `benches/peers/mesh_fcl.cpp`, once a round), and that is the timing of its
contact sets. Nearly all of FCL is templates, which Debian's library holds as compiled for any x86-64; here they are
compiled from Debian's headers with -O3 -march=native, for ours too uses what the processor has.

Nothing is carried from one query to the next in any of them. Trees are built before; FCL and coal have boxes around
triangles in groups of one (their default), OBBRSS; "fcl-cpp OBB/RSS" has lighter ones, OBB to collide and RSS for the
distance. Solids: ours also proves that neither lies within the other, which the others do not ask; no pair here does.
Contacts: ours are the points of manifolds by surface; parry's are points of manifolds by triangle pair; coal's and
FCL's are one or more for each pair of triangles that cross, up to 100,000.

Verdicts and distances are compared: with ours to 1e-6 m, which is 5e-7 of the diameter; pairs nearer to touching than
that are exempt, and counted.

Writes `benches/results/mesh_peers.csv`, or FILE, and prints the table of the README.
"""

import argparse
import os
import re
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import coal
import fcl
import numpy as np
from provenance import commit, compiler, machine

ROOT = Path(__file__).resolve().parent.parent
TOLERANCE_M = 1e-6
CONTACTS_MAX = 100_000
SEED = 17
FCL_SOURCE = ROOT / "benches/peers/mesh_fcl.cpp"
FCL_HEADERS = Path("/usr/include/fcl")
FCL_FLAGS = ("-std=c++17", "-O3", "-march=native", "-DNDEBUG")


def read_mesh(path):
    data = path.read_bytes()
    vertices, faces = struct.unpack_from("<2I", data)
    points = np.frombuffer(data, "<f8", 3 * vertices, 8).reshape(-1, 3)
    corners = np.frombuffer(data, "<u4", 3 * faces, 8 + 24 * vertices).reshape(-1, 3)
    return points.copy(), corners.astype(np.int64)


def rotation(q):
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


class Coal:
    """coal 3, OBBRSS."""

    name = f"coal {coal.__version__}"

    def __init__(self, meshes):
        self.models = []
        for vertices, faces in meshes:
            model = coal.BVHModelOBBRSS()
            model.beginModel(len(faces), len(vertices))
            model.addVertices(vertices)
            model.addTriangles(faces)
            model.endModel()
            self.models.append(model)
        flag = coal.CollisionRequestFlag
        self.first = coal.CollisionRequest(flag.NO_REQUEST, 1)
        self.all = coal.CollisionRequest(flag.CONTACT, CONTACTS_MAX)
        self.nearest = coal.DistanceRequest()

    def pose(self, place, turn):
        return coal.Transform3s(turn, place)

    def sphere(self):
        return coal.Sphere(0.1)

    def pair(self, x, y, poses):
        return (self.models[x], poses[0], self.models[y], poses[1])

    def ask(self, pair, job):
        if job == "distance":
            result = coal.DistanceResult()
            start = time.thread_time_ns()
            coal.distance(*pair, self.nearest, result)
            took = time.thread_time_ns() - start
            return took, result.min_distance <= 0, result.min_distance, 0
        result = coal.CollisionResult()
        request = self.first if job == "verdict" else self.all
        start = time.thread_time_ns()
        coal.collide(*pair, request, result)
        took = time.thread_time_ns() - start
        return took, result.isCollision(), float("nan"), result.numContacts()


class Fcl:
    """FCL by python-fcl, OBBRSS."""

    name = f"FCL (python-fcl {fcl.version.__version__})"

    def __init__(self, meshes):
        self.models = []
        for vertices, faces in meshes:
            model = fcl.BVHModel()
            model.beginModel(len(vertices), len(faces))
            model.addSubModel(vertices, faces)
            model.endModel()
            self.models.append(model)
        self.first = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
        self.all = fcl.CollisionRequest(num_max_contacts=CONTACTS_MAX, enable_contact=True)
        self.nearest = fcl.DistanceRequest()

    def pose(self, place, turn):
        return fcl.Transform(turn, place)

    def sphere(self):
        return fcl.Sphere(0.1)

    def pair(self, x, y, poses):
        return (
            fcl.CollisionObject(self.models[x], poses[0]),
            fcl.CollisionObject(self.models[y], poses[1]),
        )

    def ask(self, pair, job):
        if job == "distance":
            result = fcl.DistanceResult()
            start = time.thread_time_ns()
            distance = fcl.distance(*pair, self.nearest, result)
            took = time.thread_time_ns() - start
            return took, distance <= 0, distance, 0
        result = fcl.CollisionResult()
        request = self.first if job == "verdict" else self.all
        start = time.thread_time_ns()
        fcl.collide(*pair, request, result)
        took = time.thread_time_ns() - start
        return took, result.is_collision, float("nan"), len(result.contacts)


def call_us(library):
    """What a Python call of nearly nothing takes: two spheres far apart."""
    models, library.models = library.models, [library.sphere(), library.sphere()]
    places = [library.pose(np.array([x, 0.0, 0.0]), np.eye(3)) for x in (0.0, 10.0)]
    pair = library.pair(0, 1, places)
    took = [library.ask(pair, "verdict")[0] for _ in range(2000)]
    library.models = models
    return statistics.median(took) / 1e3


def command(*words):
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def install_fcl():
    missing = [] if shutil.which("c++") else ["g++"]
    if not FCL_HEADERS.is_dir():
        missing.append("libfcl-dev")
    if not missing:
        return
    as_root = [] if os.geteuid() == 0 else ["sudo", "-n"]
    try:
        for words in (["update"], ["install", "-y", "--no-install-recommends", *missing]):
            subprocess.run([*as_root, "apt-get", *words], check=True, stdout=sys.stderr)
    except (OSError, subprocess.CalledProcessError):
        sys.exit(
            f"mesh_peers.py: FCL from C++ needs {' '.join(missing)}, which may not be installed from here: "
            "install them, or run with --no-cpp."
        )


def build_fcl():
    """FCL called from C++, compiled for this machine; anew where its source, headers or this file changed."""
    install_fcl()
    folder = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "mesh_fcl"
    binary = folder / "mesh_fcl"
    # A header that a package brought has the time of its making, but the change of its place is of now.
    newest = max(path.stat().st_ctime for path in (FCL_SOURCE, FCL_HEADERS / "config.h", Path(__file__)))
    if binary.exists() and binary.stat().st_mtime > newest:
        return binary
    # By `extern template` a header leaves its templates to Debian's library, whatever the flags here. All of them are
    # compiled here, not some: Eigen aligns its matrices by the flags, so that the two would not fit together.
    for header in FCL_HEADERS.rglob("*.h"):
        copy = folder / "include/fcl" / header.relative_to(FCL_HEADERS)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(re.sub(r"extern template\b.*?;", "", header.read_text(), flags=re.DOTALL))
    print("compiling FCL, some three minutes", file=sys.stderr, flush=True)
    headers = [f"-I{folder / 'include'}", "-isystem", "/usr/include/eigen3"]
    subprocess.run(["c++", *FCL_FLAGS, *headers, str(FCL_SOURCE), "-o", str(binary), "-lfcl", "-lccd"], check=True)
    return binary


def cpp_compiler():
    return f"c++ {command('c++', '-dumpfullversion', '-dumpversion')} {' '.join(FCL_FLAGS[1:3])}"


def rows(command_words, path):
    """Those that a program wrote, of Rust or C++: both in the same columns."""
    subprocess.run(command_words, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    for line in path.read_text().splitlines()[1:]:
        pair, library, job, ns, touches, low, high, contacts = line.split(",")
        yield int(pair), library, job, int(ns), touches == "1", float(low), float(high), int(contacts)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--binary", nargs="*", default=["cargo", "bench", "-q", "--bench", "time_critical", "--"])
    parser.add_argument("--csv", type=Path, default=ROOT / "benches/results/mesh_peers.csv")
    parser.add_argument("--no-cpp", action="store_true", help="leave FCL from C++ out")
    args = parser.parse_args()
    from_cpp = None if args.no_cpp else build_fcl()
    took, answers = {}, {}

    def note(library, job, pair, ns, touches, low, high, contacts):
        took.setdefault((library, job), {}).setdefault(pair, []).append(ns)
        answers[library, job, pair] = (touches, low, high, contacts)

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        libraries = None
        for number in range(args.rounds):
            jobs = []
            for row in rows([*args.binary, "peers", str(folder)], folder / "rust.csv"):
                pair, library, job, *rest = row
                note(library, job, pair, *rest)
                if library == "sweepd":
                    jobs.append((pair, job))
            if libraries is None:
                meshes = [read_mesh(folder / f"mesh{k}.bin") for k in range(4)]
                poses = np.frombuffer((folder / "poses.bin").read_bytes(), "<f8").reshape(-1, 2, 7)
                libraries = [Coal(meshes), Fcl(meshes)]
                calls = {library.name: call_us(library) for library in libraries}
            for library in libraries:
                for pair, job in jobs:
                    placed = [library.pose(p[:3].copy(), rotation(p[3:])) for p in poses[pair]]
                    asked = library.pair(pair % 4, (pair + 1) % 4, placed)
                    ns, touches, distance, contacts = library.ask(asked, job)
                    note(library.name, job, pair, ns, touches, distance, distance, contacts)
            if from_cpp:
                (folder / "jobs.txt").write_text("".join(f"{pair} {job}\n" for pair, job in jobs))
                for pair, library, job, *rest in rows([str(from_cpp), str(folder)], folder / "fcl.csv"):
                    note(library, job, pair, *rest)
            print(f"round {number + 1} of {args.rounds}", flush=True)
    report(args.csv, args.rounds, took, answers, calls)


def report(csv, rounds, took, answers, calls):
    columns = (
        "machine,commit,compiler,seed,library,job,pairs,rounds,p50_us,p90_us,mean_us,call_us,"
        "contacts_mean,disagree,exempt"
    )
    head = f"{machine()},{commit()}"
    lines, table = [columns], {}
    for (library, job), pairs in sorted(took.items()):
        medians = sorted(statistics.median(each) / 1e3 for each in pairs.values())
        disagree = exempt = contacts = 0
        for pair in pairs:
            touches, low, high, count = answers[library, job, pair]
            contacts += count
            ours = answers.get(("sweepd", "distance", pair))
            truth = answers["sweepd", "verdict", pair][0]
            # Of a pair that touches ours says how deep at most: near to touching is what is apart by little.
            if ours and ours[1] <= TOLERANCE_M and touches != truth:
                exempt += 1
                continue
            if job == "distance" and library != "sweepd":
                disagree += not (ours[1] - TOLERANCE_M <= low <= ours[2] + TOLERANCE_M)
            elif touches != truth:
                disagree += 1
        p50, p90 = (medians[min(len(medians) - 1, int(share * len(medians)))] for share in (0.5, 0.9))
        mean = statistics.fmean(medians)
        call = calls.get(library, 0.0)
        made_by = cpp_compiler() if library.startswith("fcl-cpp") else compiler()
        lines.append(
            f"{head},{made_by},{SEED},{library},{job},{len(pairs)},{rounds},{p50:.2f},{p90:.2f},{mean:.2f},{call:.2f},"
            f"{contacts / len(pairs):.1f},{disagree},{exempt}"
        )
        table[library, job] = (p50, mean, disagree, exempt, contacts / len(pairs))
    csv.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    print("\n| library | verdict, p50 / mean | distance | contacts (how many) | other answers, exempt |\n| --- | --- | --- | --- | --- |")
    for library in sorted({library for library, _ in table}, key=lambda name: table[name, "verdict"][1]):
        cells = [table[library, job] for job in ("verdict", "distance", "contacts")]
        times = [f"{cell[0]:.1f} / {cell[1]:.1f} us" for cell in cells]
        times[2] += f" ({cells[2][4]:.0f})"
        wrong, exempt = (sum(cell[k] for cell in cells) for k in (2, 3))
        print(f"| {library} | {' | '.join(times)} | {wrong}, {exempt} |")


if __name__ == "__main__":
    main()
