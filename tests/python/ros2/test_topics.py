"""What goes in and out over ROS 2 is what goes in and out over shared memory, field by field, with a real rclpy peer."""

import itertools
import math

import pytest
import rows
from conftest import BEST_EFFORT, LATCHED
from frames import Sender
from scenes import HANDS, cloud
from sweepd_msgs.msg import BodyTransforms, Contacts, Names, Pairs, State, Tick

TURN = (0.0, 0.0, math.sin(0.3), math.cos(0.3))


def poses(step):
    """Hands that meet and part."""
    return {
        "left": ((0.25 * math.sin(0.02 * step), 0.0, 0.1), TURN),
        "right": ((1.05 + 0.5 * math.sin(0.13 * step), 0.1, 0.0), (0.0, 0.0, 0.0, 1.0)),
    }


def listen(room):
    """All output topics; names by id."""
    room.node()
    heard = {
        "tick": room.hear(Tick, "/sweepd/tick"),
        "state": room.hear(State, "/sweepd/state"),
        "pairs": room.hear(Pairs, "/sweepd/pairs"),
        "contacts": room.hear(Contacts, "/sweepd/contacts"),
        "names": room.hear(Names, "/sweepd/names", LATCHED),
    }
    room.until(lambda: all(heard.values()), "a message on each topic")
    names = {name.body: name.name for message in heard["names"] for name in message.names}
    return heard, names


def by_tick(messages):
    return {(m.tick_header.boot_id, m.tick_header.tick): m for m in messages}


def differences(heard, names, results):
    """Compares copies of results over shared memory with what was heard."""
    ticks, states = by_tick(heard["tick"]), by_tick(heard["state"])
    pairs, contacts = rows.whole(heard["pairs"]), rows.whole(heard["contacts"])
    out = []
    for row, pair_rows, contact_rows in results:
        key = (row.header.boot_id, row.header.tick)
        out += rows.tick(row, ticks[key]) + rows.state(row, states[key], names)
        out += rows.listed(pair_rows, pairs[key], names, rows.PAIR)
        out += rows.listed(contact_rows, contacts[key], names, rows.CONTACT, rows.POINTS)
    return out


def test_every_field_of_every_output_is_that_of_shared_memory(room):
    room.daemon(HANDS)
    heard, names = listen(room)
    client = room.client("sim")
    results = []
    for step in range(120):
        result = client.step(poses(step), timeout_s=5, stamp_ns=1_000_000_000 + 7 * step)
        results.append((result.tick, result.pairs.copy(), result.contacts.copy()))
        last = (result.tick.header.boot_id, result.tick.header.tick)
        room.until(lambda: last in by_tick(heard["tick"]), f"tick {last}")
    for topic in ("pairs", "contacts"):
        room.until(lambda: last in rows.whole(heard[topic]), f"{topic} of {last}")
    assert sum(len(result[1]) for result in results) > 50, "pairs to compare"
    assert sum(len(result[2]) for result in results) > 50, "contacts to compare"
    assert differences(heard, names, results) == []
    assert sorted(names.values()) == ["floor", "left", "right"]
    assert all(m.header.frame_id == "world" for topic in heard.values() for m in topic)


def test_transforms_arrive_as_sent_and_each_frame_has_its_tick(room):
    room.daemon(HANDS)
    room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(room.nodes[0])
    reader = room.client(None, listen=("bodies",))
    room.until(lambda: ticks and ticks[-1].sources and ticks[-1].sources[0].frames > 0, "the first frame",
               then=lambda: sender.send(poses(0)))  # fmt: skip
    ids = reader.names
    for step in range(1, 100):
        stamp = 5_000_000_000 + 1_000_003 * step
        # by name and by id in turn
        named = poses(step) if step % 2 else {ids[name]: pose for name, pose in poses(step).items()}
        seq = sender.send(named, stamp_ns=stamp, boot_id=ticks[-1].tick_header.boot_id)
        row = room.until(lambda: next((t for t in ticks if t.sources[0].seq == seq), None), f"the tick of frame {seq}")
        assert (row.cause, row.sources[0].session, row.tick_header.newest_stamp_ns) == (Tick.FRAME, sender.session, stamp)
        result = reader.latest()
        while result.tick.sources[0].seq < seq:
            result = reader.wait()
        bodies = {int(body["body"]): body for body in result.bodies}
        for name, (position, orientation) in poses(step).items():
            body = bodies[ids[name]]
            assert body["position"].tolist() == list(position), name
            assert body["orientation"] == pytest.approx(orientation, abs=1e-15)
            assert body["stamp_ns"] == stamp
    assert ticks[-1].sources[0].refused == 0 and ticks[-1].receipts_undecodable == 0


def test_refused_frames_are_counted_by_reason_and_the_next_good_one_is_taken(room):
    room.daemon(HANDS)
    room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    states = room.hear(State, "/sweepd/state")
    sender = Sender(room.nodes[0])
    room.until(lambda: ticks and ticks[-1].bodies == 3 and states and states[-1].word != "unknown", "a known state",
               then=lambda: sender.send(poses(0)))  # fmt: skip
    nan = {"left": (math.nan, 0, 0), "right": (3, 0, 0)}
    bad = [
        (Tick.REJECT_NOT_FINITE, dict(poses=nan)),
        (Tick.REJECT_BAD_QUATERNION, dict(poses={"left": ((0, 0, 0), (0, 0, 0, 0)), "right": (3, 0, 0)})),
        (Tick.REJECT_UNKNOWN_BODY, dict(poses={"nobody": (0, 0, 0)}, flags=BodyTransforms.PARTIAL)),
        (Tick.REJECT_BAD_LAYOUT, dict(poses=poses(0), flags=9)),
        (Tick.REJECT_SESSION_OVER, dict(poses={1: (0, 0, 0)}, flags=BodyTransforms.PARTIAL)),
        (Tick.REJECT_SESSION_OVER, dict(poses={1: (0, 0, 0)}, flags=BodyTransforms.PARTIAL, boot_id=1)),
    ]
    for reason, frame in bad:
        before = ticks[-1].rejects[reason]
        sender.send(**frame)
        room.until(lambda: ticks[-1].rejects[reason] > before, f"reason {reason} counted")
        room.until(lambda: states[-1].word != "unknown", "a known state again", then=lambda: sender.send(poses(0)))
    stranger = Sender(room.nodes[0], source="nobody")
    room.until(lambda: ticks[-1].rejects[Tick.REJECT_UNKNOWN_SOURCE] > 0, "an unknown source",
               then=lambda: stranger.send(poses(0)))  # fmt: skip


def test_bug_a_subscriber_that_comes_to_a_busy_topic_costs_the_others_nothing(room):
    room.daemon(HANDS)
    room.node()
    sender, step = Sender(room.nodes[0]), itertools.count()
    ticks = room.hear(Pairs, "/sweepd/pairs", keep=lambda m: m.tick_header.tick)
    send = lambda: sender.send(poses(next(step)))  # noqa: E731
    # more than the writer keeps for a reader that does not acknowledge
    room.until(lambda: len(ticks) > 150, "pairs", then=send)
    for number in range(4):
        theirs = room.hear(Pairs, "/sweepd/pairs", node=room.node(f"newcomer_{number}"))
        room.until(lambda: len(theirs) > 40, "pairs for the newcomer", then=send)
    assert ticks == list(range(ticks[0], ticks[-1] + 1))


def test_ids_are_those_of_one_run_of_the_daemon(room):
    room.daemon(HANDS)
    room.node()
    names, states = room.hear(Names, "/sweepd/names", LATCHED), room.hear(State, "/sweepd/state")
    sender = Sender(room.nodes[0])
    room.until(lambda: names, "names")
    ids = {name.name: name.body for name in names[-1].names}
    far = {ids["left"]: (0, 0, 0), ids["right"]: (5, 0, 0)}
    room.until(lambda: states and states[-1].word == "clear", "clear by ids", then=lambda: sender.send(far, boot_id=names[-1].boot_id))


def test_paused_frames_keep_the_poses_young_and_silence_makes_them_unknown(room):
    room.daemon(HANDS)
    room.node()
    states = room.hear(State, "/sweepd/state")
    sender = Sender(room.nodes[0])
    far = {"left": (0, 0, 0), "right": (5, 0, 0)}
    room.until(lambda: states and states[-1].word == "clear", "clear", then=lambda: sender.send(far))
    start = len(states)
    for _ in range(15):
        sender.send({}, flags=BodyTransforms.PAUSED)
        room.spin(0.1)
    words = {state.word for state in states[start:]}
    assert words == {"clear"}
    state = room.until(lambda: states[-1].word == "unknown" and states[-1], "unknown after silence")
    assert "stale" in state.reason_words


def crowd(room, count, *ros_args):
    """Spheres all in one place: every pair collides, each with one contact. Returns how to send them."""
    room.daemon(cloud(count), ros_args=ros_args)
    room.node()
    sender = Sender(room.nodes[0])
    together = {f"b{n:04}": (0.001 * n, 0, 0) for n in range(count)}
    return (lambda: sender.send(together)), count * (count - 1) // 2


def test_a_large_tick_comes_in_chunks_below_128_kb_and_is_whole(room):
    send, wanted = crowd(room, 44, "-p", "ros_max_pairs:=1000")
    raw = room.hear(Pairs, "/sweepd/pairs", raw=True)
    heard = room.hear(Pairs, "/sweepd/pairs")
    room.until(lambda: any(len(all) == wanted for all in rows.whole(heard).values()), f"all {wanted} pairs", then=send)
    assert max(message.chunk_count for message in heard) > 1, "more than one chunk"
    assert 60_000 < max(map(len, raw)) <= 128 * 1024
    assert all(message.complete == (message.tick_header.truncated == 0) for message in heard)


def test_contacts_beyond_the_limit_are_cut_and_told(room):
    send, wanted = crowd(room, 40)
    contacts = room.hear(Contacts, "/sweepd/contacts")
    cut = room.until(lambda: next((m for m in contacts if m.tick_header.truncated), None), "a cut tick", then=send)
    key = (cut.tick_header.boot_id, cut.tick_header.tick)
    room.until(lambda: key in rows.whole(contacts), "the rest of it", then=send)
    assert not cut.complete and len(rows.whole(contacts)[key]) == 500
    assert cut.tick_header.truncated == wanted - 500


def test_best_effort_and_late_readers_are_served(room):
    room.daemon(HANDS)
    room.node()
    for topic, kind in (("tick", Tick), ("state", State), ("pairs", Pairs), ("contacts", Contacts)):
        heard = room.hear(kind, f"/sweepd/{topic}", BEST_EFFORT)
        room.until(lambda: heard, f"{topic}, best effort")
    late = room.node("late")
    names = room.hear(Names, "/sweepd/names", LATCHED, node=late)
    room.until(lambda: names, "names for who comes late")
    assert [name.name for name in names[-1].names] == ["left", "right", "floor"]
