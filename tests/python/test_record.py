"""A recording as other programs read it: the `mcap` package opens it, mcap-ros2-support decodes every topic.

Needs `SWEEPD=path/to/sweepd` and these packages.
"""

import os
import signal
import struct
import subprocess
import time

import pytest
from needed import needed

reader = needed("mcap.reader")
ros2 = needed("mcap_ros2.decoder")

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
INSTANCE = f"rec_{os.getpid()}"
SHOWN = {f"/sweepd/{topic}" for topic in ("names", "bodies", "contacts", "pairs", "state", "tick")}


def record(tmp_path, end):
    """Records a pool of bodies that a source moves; the file."""
    scene, file = tmp_path / "pool.toml", tmp_path / "run.mcap"
    subprocess.run([SWEEPD, "-q", "feed", "--write-scene", scene, "--count", "60"], check=True)
    run = [SWEEPD, "-q", "run", scene, "--instance", INSTANCE, "--record", file]
    daemon = subprocess.Popen(run)
    try:
        feed = [SWEEPD, "-q", "feed", scene, "--instance", INSTANCE, "--frames", "150"]
        subprocess.run(feed, check=True, timeout=60)
        if end == signal.SIGKILL:
            time.sleep(1.5)
        daemon.send_signal(end)
        code = daemon.wait(timeout=30)
        assert code == (0 if end == signal.SIGTERM else -end), code
    finally:
        daemon.kill()
        daemon.wait()
    return file


def topics(file):
    """The decoded messages by topic."""
    found = {}
    with open(file, "rb") as stream:
        mcap = reader.make_reader(stream, decoder_factories=[ros2.DecoderFactory()])
        for schema, channel, message, decoded in mcap.iter_decoded_messages():
            assert schema.encoding == "ros2msg" and channel.message_encoding == "cdr", schema.name
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    return found


def test_every_topic_decodes_and_tells_one_story(tmp_path):
    file = record(tmp_path, signal.SIGTERM)
    with open(file, "rb") as stream:
        mcap = reader.make_reader(stream)
        assert mcap.get_header().profile == "ros2"
        assert mcap.get_summary().statistics.message_count > 500
    found = topics(file)
    assert set(found) == SHOWN | {"/sweepd/record/start", "/sweepd/record/input", "/sweepd/record/output"}
    numbers = [tick.tick_header.tick for _, tick in found["/sweepd/tick"]]
    assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) >= 100
    assert_one_story(found)


def test_what_a_client_hears_decodes_and_tells_one_story(tmp_path):
    scene, file = tmp_path / "pool.toml", tmp_path / "heard.mcap"
    subprocess.run([SWEEPD, "-q", "feed", "--write-scene", scene, "--count", "60"], check=True)
    daemon = subprocess.Popen([SWEEPD, "-q", "run", scene, "--instance", INSTANCE])
    feed = subprocess.Popen([SWEEPD, "-q", "feed", scene, "--instance", INSTANCE, "--rate", "200"])
    try:
        hear = [SWEEPD, "-q", "record", file, "--instance", INSTANCE, "--ticks", "200"]
        subprocess.run(hear, check=True, timeout=60)
    finally:
        for process in (feed, daemon):
            process.kill()
            process.wait()
    found = topics(file)
    assert set(found) == SHOWN
    # The first ticks come before the daemon knows that somebody listens.
    whole = {pairs.tick_header.tick for _, pairs in found["/sweepd/pairs"]}
    found["/sweepd/tick"] = [row for row in found["/sweepd/tick"] if row[1].tick_header.tick in whole]
    assert len(whole) >= 150
    assert_one_story(found)


def assert_one_story(found):
    """That what was recorded of each tick belongs together."""
    ticks = [tick for _, tick in found["/sweepd/tick"]]
    times = [time_ns for time_ns, _ in found["/sweepd/tick"]]
    assert times == sorted(times) and abs(times[-1] - time.time_ns()) < 300e9
    names = {name.body: name.name for name in found["/sweepd/names"][0][1].names}
    assert len(names) == 60
    colliding = 0
    for tick, (_, pairs) in zip(ticks, found["/sweepd/pairs"], strict=True):
        assert pairs.tick_header.tick == tick.tick_header.tick and pairs.complete
        colliding += tick.colliding
        told = [pair for pair in pairs.pairs if pair.verdict == 4 and not pair.flags & 16]
        assert len(told) == tick.colliding
        for pair in told:
            assert (names[pair.body_a], names[pair.body_b]) == (pair.name_a, pair.name_b)
            assert pair.gap_max_m <= 1e-9
    assert colliding > 0
    assert any(contacts.contacts for _, contacts in found["/sweepd/contacts"])
    bodies = found["/sweepd/bodies"][-1][1]
    assert {transform.name for transform in bodies.transforms} == set(names.values())
    assert bodies.header.frame_id == "world"


def test_the_rows_of_the_contract_are_in_it_bit_by_bit(tmp_path):
    found = topics(record(tmp_path, signal.SIGTERM))
    for (_, raw), (_, tick) in zip(found["/sweepd/record/output"], found["/sweepd/tick"], strict=True):
        data = bytes(raw.data)
        # Four bytes, then a TickRow, whose header begins with boot id, tick and scene revision.
        assert struct.unpack_from("<QQQ", data, 4) == (
            tick.tick_header.boot_id,
            tick.tick_header.tick,
            tick.tick_header.scene_rev,
        )
        # Of the tick's 2088 bytes, then four message headers of 56, then the count of pairs.
        (rows,) = struct.unpack_from("<I", data, 4 + 2088 + 4 * 56)
        pairs = [row for _, row in found["/sweepd/pairs"] if row.tick_header.tick == tick.tick_header.tick]
        told = [pair for message in pairs for pair in message.pairs]
        assert rows == len(told)
        for at, pair in enumerate(told):
            place = 4 + 2088 + 4 * 56 + 4 + 120 * at
            assert struct.unpack_from("<QQd", data, place) == (pair.body_a, pair.body_b, pair.gap_min_m)


def test_what_a_killed_daemon_leaves_can_be_read(tmp_path):
    file = record(tmp_path, signal.SIGKILL)
    count = 0
    with open(file, "rb") as stream:
        try:
            for _ in reader.NonSeekingReader(stream).iter_messages(["/sweepd/tick"], log_time_order=False):
                count += 1
        except Exception:  # the end is missing
            pass
    assert count >= 100, count
