"""Load: many bodies, many contacts, readers that are slow or stopped. Minutes long ones run with SWEEPD_CI_SLOW=1."""

import time

import pytest
from motion import Cloud
from scenes import HANDS, cloud
from sweepd_msgs.msg import Pairs, Tick

BODIES = 500


def run_cloud(room, seconds):
    """Moves the cloud over ROS 2, then the same frames over shared memory; returns what was heard of both."""
    frames = int(seconds * 100)
    room.daemon(cloud(BODIES))
    room.node()
    ticks = room.hear(Tick, "/sweepd/tick", keep=lambda t: (t.tick_header.tick, t.cause, t.sources[0].seq, t.sources[0].skipped,
                                                            t.sends_dropped, t.receipts_undecodable))  # fmt: skip
    pairs = room.hear(Pairs, "/sweepd/pairs", keep=lambda m: (m.tick_header.tick, m.chunk_index, m.chunk_count,
                                                               [(p.body_a, p.body_b, p.verdict, p.gap_min_m, p.gap_max_m) for p in m.pairs]))  # fmt: skip
    room.until(lambda: ticks and pairs, "ticks and pairs")
    mover = room.python("peer_mover.py", BODIES, frames)
    room.until(lambda: mover.poll() is not None, "the mover's end", seconds=seconds + 60)
    print(mover.stdout.read().strip())
    return ticks, pairs, frames


def check_cloud(room, seconds):
    ticks, pairs, frames = run_cloud(room, seconds)
    numbers = [tick[0] for tick in ticks]
    gaps = sum(b != a + 1 for a, b in zip(numbers, numbers[1:]))
    framed = [tick for tick in ticks if tick[1] == Tick.FRAME]
    used = [tick[2] for tick in framed]
    skipped = framed[-1][3] - framed[0][3]
    told = framed[-1][2] - framed[0][2] + 1 - len(framed)
    chunks = {}
    for tick, place, count, some in pairs:
        chunks.setdefault(tick, {})[place] = (count, some)
    whole = {tick: [row for place in sorted(parts) for row in parts[place][1]]
             for tick, parts in chunks.items() if len(parts) == parts[min(parts)][0]}  # fmt: skip
    print(f"{len(ticks)} ticks heard, {gaps} gaps in their numbers; {len(framed)} of {frames} frames made a tick, {told} did not, "
          f"{skipped} of them told as skipped; sends dropped {ticks[-1][4]}, undecodable {ticks[-1][5]}")  # fmt: skip
    assert gaps == 0, "a tick was lost or repeated"
    assert used == sorted(set(used)) and told <= skipped, "each frame has one tick, or it is told that it was passed over"
    assert len(framed) > 0.9 * frames and ticks[-1][5] == 0
    missing = [tick for tick, cause, *_ in framed if tick not in whole]
    assert len(missing) <= ticks[-1][4], "a tick whose pairs did not come is counted as dropped"
    # the same frames over shared memory, by a daemon of its own
    room.plain_daemon(cloud(BODIES))
    paths = Cloud(BODIES)
    compared, differences, found = 0, 0, 0
    import sweepd

    with sweepd.Client(f"{room.instance}_plain", "sim", quat_order="xyzw", timeout_s=15, listen=("pairs",)) as client:
        ids = [client.names[name] for name in paths.names]
        frame = client.rows((ids, paths.positions(0), [(0, 0, 0, 1)] * BODIES))
        for tick, _, seq, *_ in framed:
            if tick not in whole:
                continue
            frame["position"] = paths.positions(seq)
            ours = client.step(frame, timeout_s=10).pairs
            near = {(int(r["body_a"]), int(r["body_b"])) for r in ours if r["verdict"] == 4}
            theirs = {(a, b) for a, b, verdict, *_ in whole[tick] if verdict == 4}
            compared, found = compared + 1, found + len(theirs)
            differences += near != theirs
    print(f"{compared} ticks compared with shared memory, {found} colliding pairs, {differences} ticks differ")
    assert differences == 0 and compared > 0.9 * frames and found > 10 * compared


def test_pairs_of_five_hundred_bodies_are_those_of_shared_memory(room):
    check_cloud(room, 5)


@pytest.mark.slow
def test_pairs_of_five_hundred_bodies_are_those_of_shared_memory_for_a_minute(room):
    check_cloud(room, 60)


def test_an_idle_node_is_small(room):
    daemon = room.daemon(HANDS)
    node = room.node()
    room.until(lambda: "sweepd" in node.get_node_names(), "the node")
    room.spin(2)
    before, start = daemon.cpu_s(), time.monotonic()
    time.sleep(10)
    share = (daemon.cpu_s() - before) / (time.monotonic() - start)
    print(f"idle: {100 * share:.2f} % of a core, {daemon.memory_kb()} KiB resident")
    assert daemon.memory_kb() <= 40 * 1024 and share < 0.05
