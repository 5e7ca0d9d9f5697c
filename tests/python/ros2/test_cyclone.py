"""A second DDS, Cyclone: it writes `~/transforms`, reads `~/tick` and `~/contacts`, and knows nothing of ROS 2."""

import json

from scenes import HANDS

ON_LOOPBACK = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast>
</General><Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""


def test_cyclone_dds_writes_transforms_and_reads_ticks_and_contacts(room):
    room.daemon(HANDS)
    # where the room has no network of its own, the daemon is on loopback, and so must the peer be
    peer = room.python("peer_cyclone.py", room.domain, 8, env={} if room.private else {"CYCLONEDDS_URI": ON_LOOPBACK})
    lines = [json.loads(line) for line in peer.communicate(timeout=60)[0].splitlines()]
    ticks = [line for line in lines if "seq" in line]
    contacts = [line for line in lines if "of" in line and line["kind"] == 0]
    print(f"{len(ticks)} ticks, {len(contacts)} contacts")
    assert peer.returncode == 0
    assert len(ticks) > 100 and len({tick["seq"] for tick in ticks}) > 100
    for tick in ticks:
        x = max(0.5, 2.0 - 0.02 * tick["seq"])
        assert tick["stamp_ns"] == tick["seq"] * 10**9 + 5 and tick["bodies"] == 3
        if abs(x - 1.0) > 1e-9:
            assert tick["colliding"] == (x < 1.0), tick
    seqs = {tick["tick"]: tick["seq"] for tick in ticks}
    checked = 0
    for contact in contacts:
        if contact["of"] in seqs:
            x = max(0.5, 2.0 - 0.02 * seqs[contact["of"]])
            assert (contact["a"], contact["b"]) == ("left", "right")
            assert abs(contact["gap_m"] - (x - 1.0)) < 1e-9 and abs(contact["normal"] - 1.0) < 1e-9
            checked += 1
    assert checked > 50
