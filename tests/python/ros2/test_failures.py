"""Daemons that die, hang and come back, and senders that say nonsense: readers learn it, and the rest goes on."""

import random
import secrets
import signal
import socket
import struct
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from conftest import LATCHED, RELIABLE
from frames import Sender
from parameters import put
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSLivelinessPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.serialization import serialize_message
from scenes import HANDS
from std_msgs.msg import String
from sweepd_msgs.msg import Names, Pairs, State, Tick
from sweepd_msgs.srv import Gap, TickNow

HEARTBEAT_S = 0.1
FAR = {"left": (0, 0, 0), "right": (5, 0, 0)}
CLOSE = {"left": (0, 0, 0), "right": (0.5, 0, 0)}


def watched(room, topic="/sweepd/state", kind=State, heartbeats=3.0):
    """Two readers, one that asks for a deadline of so many heartbeats and one that asks for the lease; the times of their events."""
    events = {"deadline": [], "lease": [], "refused": []}

    def reader(qos, name):
        seen = SubscriptionEventCallbacks(
            deadline=lambda info: events["deadline"].append(time.monotonic()),
            liveliness=lambda info: events["lease"].append((time.monotonic(), info.alive_count)),
            incompatible_qos=lambda info: events["refused"].append((name, info.last_policy_kind)),
        )
        return room.hear(kind, topic, qos, event_callbacks=seen)

    deadline = reader(QoSProfile(depth=10, deadline=Duration(seconds=heartbeats * HEARTBEAT_S)), "deadline")
    lease = reader(
        QoSProfile(depth=10, liveliness=QoSLivelinessPolicy.AUTOMATIC, liveliness_lease_duration=Duration(seconds=3)),
        "lease",
    )
    room.until(lambda: deadline and lease, f"both readers of {topic} are served")
    assert events["refused"] == []
    return events


def watched_topics(room):
    """Such readers of both topics that promise a deadline and a lease; their events by topic."""
    # the reader's own figure counts from the last message; what is left of three heartbeats is for the machine
    return {topic: watched(room, topic, kind, heartbeats=2.5) for topic, kind in (("/sweepd/state", State), ("/sweepd/tick", Tick))}


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_readers_learn_that_the_daemon_is_dead_or_hangs(room, number):
    daemon = room.daemon(HANDS)
    room.node()
    watches = watched_topics(room)
    room.spin(1.0)
    before = {topic: len(events["deadline"]) for topic, events in watches.items()}
    start = time.monotonic()
    daemon.send(number)
    room.until(lambda: all(len(events["deadline"]) > before[topic] for topic, events in watches.items()), "missed deadlines", seconds=5)
    gone = lambda events: [t for t, alive in events["lease"] if t > start and alive == 0]  # noqa: E731
    room.until(lambda: all(map(gone, watches.values())), "lost leases", seconds=6)
    for topic, events in watches.items():
        missed, lost = events["deadline"][before[topic]] - start, gone(events)[0] - start
        print(f"{number.name}: {topic}: deadline missed after {missed:.3f} s, lease lost after {lost:.3f} s")
        assert missed <= 3 * HEARTBEAT_S and lost <= 3.5, topic


@pytest.mark.slow
def test_an_idle_daemon_gives_no_false_alarm_in_a_minute(room):
    room.daemon(HANDS)
    room.node()
    # the very readers that learn of a death within three heartbeats
    watches = watched_topics(room)
    count = lambda: {topic: (len(events["deadline"]), len(events["lease"])) for topic, events in watches.items()}  # noqa: E731
    before = count()
    room.spin(60)
    assert count() == before


def test_running_peers_go_on_with_a_restarted_daemon(room):
    daemon = room.daemon(HANDS)
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    pairs = room.hear(Pairs, "/sweepd/pairs")
    names = room.hear(Names, "/sweepd/names", LATCHED)
    clients = {kind: node.create_client(kind, f"/sweepd/{name}") for kind, name in ((TickNow, "tick_now"), (Gap, "gap"))}
    sender = Sender(node)

    def answered(kind, request, boot):
        """The answer of the daemon of this boot to a client that was there before it; asks anew each second."""
        futures, asked = [], [0.0]

        def ask():
            sender.send(CLOSE)
            if time.monotonic() - asked[0] >= 1.0:
                asked[0] = time.monotonic()
                futures.append(clients[kind].call_async(request))

        answers = lambda: [f.result() for f in futures if f.done() and f.result().tick_header.boot_id == boot]  # noqa: E731
        return room.until(answers, f"an answer to a {kind.__name__} client that was there before", seconds=20, then=ask)[0]

    def served(boot):
        assert answered(TickNow, TickNow.Request(), boot).success
        gap = answered(Gap, Gap.Request(name_a="left", name_b="right"), boot)
        assert gap.success and gap.verdict == Gap.Response.COLLIDING, gap
        room.until(lambda: names and names[-1].boot_id == boot, "the names of this boot", then=lambda: sender.send(CLOSE))
        assert {one.name for one in names[-1].names} == {"left", "right", "floor"}

    room.until(lambda: states and states[-1].word == "colliding", "a collision", then=lambda: sender.send(CLOSE))
    first = states[-1].tick_header.boot_id
    served(first)
    for sends_meanwhile in (False, True):
        daemon.send(signal.SIGKILL)
        daemon.process.wait()
        heard = len(states)
        daemon = room.daemon(HANDS)
        start = time.monotonic()
        if not sends_meanwhile:
            # no frame reaches it before its first word does, so that this word tells of the gap
            new = room.until(lambda: [s for s in states[heard:] if s.tick_header.boot_id != first], "the new daemon's first word", seconds=20)
            assert new[0].word == "unknown" and "not_received" in new[0].reason_words, new[0]
        room.until(lambda: states[-1].tick_header.boot_id != first and states[-1].word == "colliding", "the new daemon's word",
                   then=lambda: sender.send(CLOSE), seconds=20)  # fmt: skip
        print(f"served again {time.monotonic() - start:.2f} s after the restart")
        first = states[-1].tick_header.boot_id
        room.until(lambda: pairs and pairs[-1].tick_header.boot_id == first and pairs[-1].pairs, "its pairs", then=lambda: sender.send(CLOSE))
        words = [s.word for s in states[heard:] if s.tick_header.boot_id == first]
        assert set(words) <= {"unknown", "colliding"}, "no word of a new boot is better than what is known"
        served(first)
    assert len({state.tick_header.boot_id for state in states}) == 3


def test_a_daemon_that_was_stopped_and_continued_is_heard_again_and_the_gap_is_told(room):
    """DDS's own threads may not survive it: then the node is opened anew, with the boot id as it was."""
    daemon = room.daemon(HANDS)
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)
    room.until(lambda: ticks and ticks[-1].sources[0].frames > 3, "frames", then=lambda: sender.send(FAR))
    daemon.send(signal.SIGSTOP)
    room.spin(1.0)
    daemon.send(signal.SIGCONT)
    stopped = ticks[-1].sent_ns
    room.until(lambda: ticks[-1].sent_ns > stopped and ticks[-1].sources[0].frames > 10, "ticks and frames again", seconds=20,
               then=lambda: sender.send(FAR))  # fmt: skip
    assert len({tick.tick_header.boot_id for tick in ticks}) == 1
    numbers = [tick.tick_header.tick for tick in ticks]
    assert numbers == sorted(set(numbers)), "none repeated"
    gaps = [b.sent_ns - a.sent_ns for a, b in zip(ticks, ticks[1:])]
    print(f"heard again after {max(gaps) / 1e9:.2f} s; ticks not heard meanwhile: {numbers[-1] - numbers[0] + 1 - len(numbers)}")
    assert max(gaps) > 900_000_000
    late = room.node("late")
    names = room.hear(Names, "/sweepd/names", LATCHED, node=late)
    room.until(lambda: names and len(names[-1].names) == 3, "the names, too")


@pytest.mark.slow
def test_a_peer_that_was_away_for_longer_than_its_lease_hears_and_is_heard_again(room):
    """Fast DDS's lease is 20 s. DDS does not take such a peer back: the node is opened anew when it is heard."""
    daemon = room.daemon(HANDS)
    room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    peer = room.python("peer_answer.py")
    room.until(lambda: ticks and ticks[-1].sources[0].frames > 20, "frames")
    peer.send_signal(signal.SIGSTOP)
    room.until(lambda: "counts as gone" in daemon.log, "that it was lost", seconds=30)
    assert "opened anew" not in daemon.log, "not for one that may be dead"
    room.spin(3.0)
    before = len(ticks)
    peer.send_signal(signal.SIGCONT)
    start, frames = time.monotonic(), ticks[-1].sources[0].frames
    room.until(lambda: "opened anew" in daemon.log and ticks[-1].sources[0].frames > frames + 50, "frames again", seconds=20)
    gaps = [b.sent_ns - a.sent_ns for a, b in zip(ticks[before:], ticks[before + 1 :])]
    print(f"served again after {time.monotonic() - start:.1f} s; another reader missed {max(gaps) / 1e9:.1f} s of ticks")
    assert max(gaps) < 5_000_000_000
    assert len({tick.tick_header.boot_id for tick in ticks}) == 1


def test_parameters_set_while_running_hold_in_the_node_that_is_opened_anew(room):
    daemon = room.daemon(HANDS, ros_args=["-p", "ros.allow_edits:=true", "-p", "budget_ms:=7.0"])
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    room.until(lambda: ticks and ticks[-1].budget_ns == 7_000_000, "the budget of the start")
    assert put(room, budget_ms=4.0, mode="rate=20", timeout_ms__sim=400.0, ros_max_contacts=11) == [(True, "")] * 4
    room.until(lambda: ticks[-1].budget_ns == 4_000_000, "the budget that was set")
    daemon.send(signal.SIGSTOP)
    room.spin(1.0)
    daemon.send(signal.SIGCONT)
    stopped = ticks[-1].sent_ns
    room.until(lambda: "opened anew" in daemon.log and ticks[-1].sent_ns > stopped + 2 * 10**9, "ticks of the new node", seconds=25)
    assert ticks[-1].budget_ns == 4_000_000
    node = room.node("late")
    request = GetParameters.Request(names=["budget_ms", "mode", "timeout_ms.sim", "ros_max_contacts"])
    # the node that was given up is seen until its lease ends, and a question that goes to it alone is lost
    answer = room.call(GetParameters, "/sweepd/get_parameters", request, node=node, seconds=25, each_s=2.0)
    budget, mode, timeout, contacts = answer.values
    assert (budget.double_value, mode.string_value, timeout.double_value, contacts.integer_value) == (4.0, "rate=20", 400.0, 11)


def test_a_restarted_sender_is_a_new_session_and_its_pairs_end(room):
    room.daemon(HANDS)
    node = room.node()
    pairs = room.hear(Pairs, "/sweepd/pairs")
    ticks = room.hear(Tick, "/sweepd/tick")
    first = Sender(node)
    room.until(lambda: ticks and pairs and any(p.verdict == 4 for p in pairs[-1].pairs), "a collision", then=lambda: first.send(CLOSE))
    second = Sender(node)
    before = ticks[-1].rejects[Tick.REJECT_SOURCE_TAKEN]
    second.send(FAR)
    room.until(lambda: ticks[-1].rejects[Tick.REJECT_SOURCE_TAKEN] > before, "a second session refused while the first lives",
               then=lambda: (first.send(CLOSE), second.send(FAR)))  # fmt: skip
    room.until(lambda: ticks[-1].sources[0].session == second.session, "the second session in force", then=lambda: second.send(FAR))
    ends = [p for message in pairs for p in message.pairs if p.events & 4]
    assert ends and ends[-1].end_cause in (5, 7), ends[-1:]


def test_a_new_epoch_ends_the_pairs_with_cause_reset(room):
    room.daemon(HANDS)
    node = room.node()
    pairs = room.hear(Pairs, "/sweepd/pairs")
    sender = Sender(node)
    room.until(lambda: pairs and any(p.verdict == 4 for p in pairs[-1].pairs), "a collision", then=lambda: sender.send(CLOSE))
    sender.epoch += 1
    room.until(lambda: any(p.events & 4 and p.end_cause == 5 for m in pairs for p in m.pairs), "an end with cause reset",
               then=lambda: sender.send(FAR))  # fmt: skip


def test_samples_that_cannot_be_decoded_are_counted_and_other_topics_go_on(room):
    daemon = room.daemon(HANDS)
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)
    room.until(lambda: ticks and ticks[-1].sources[0].frames > 0, "a frame", then=lambda: sender.send(FAR))
    good = serialize_message(sender.frame(FAR))
    seed = secrets.randbits(32)
    print("seed", seed)
    noise = random.Random(seed)
    cases = [good[:4], good[: len(good) // 2], good[:-3]]
    # counts that promise far more than there is, in every place a count may stand
    cases += [good[:at] + struct.pack("<I", 0xFFFFFFF0) + good[at + 4 :] for at in range(8, len(good) - 4, 4)]
    cases += [good[:4] + noise.randbytes(noise.randrange(1, 400)) for _ in range(200)]
    for case in cases:
        sender.publisher.publish(bytes(case))
        room.spin(0.002)
    frames = ticks[-1].sources[0].frames
    room.until(lambda: ticks[-1].receipts_undecodable >= 3, "undecodable samples counted",
               then=lambda: sender.publisher.publish(bytes(good[: len(good) // 2])))  # fmt: skip
    # some of the noise may have been a frame of the old session with a number far ahead: a new session is never shut out
    fresh = Sender(node)
    room.until(lambda: ticks[-1].sources[0].frames > frames and ticks[-1].sources[0].session == fresh.session, "frames again",
               then=lambda: fresh.send(FAR))  # fmt: skip
    assert daemon.process.poll() is None
    print(f"{len(cases)} bad samples: {ticks[-1].receipts_undecodable} undecodable, rejects {list(ticks[-1].rejects)}")


def test_another_type_on_our_topic_does_no_harm(room):
    daemon = room.daemon(HANDS)
    # one participant has one type a topic: the wrong one is in a participant of its own
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=room.domain)
    stranger = rclpy.create_node("wrong", context=context)
    for qos in (RELIABLE, QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)):
        wrong = stranger.create_publisher(String, "/sweepd/transforms", qos)
        stranger.create_subscription(String, "/sweepd/tick", print, qos)
    right = room.node("right")
    states = room.hear(State, "/sweepd/state", node=right)
    logs, said = room.hear(Log, "/rosout", node=right), room.hear(DiagnosticArray, "/diagnostics", node=right)
    sender = Sender(right)
    room.until(lambda: states and states[-1].word == "clear", "clear beside it",
               then=lambda: (wrong.publish(String(data="x" * 1000)), sender.send(FAR)))  # fmt: skip
    assert daemon.process.poll() is None
    for topic, count, ours in (("/sweepd/transforms", 2, "BodyTransforms"), ("/sweepd/tick", 2, "Tick")):
        words = f"topic {topic}: {count} endpoints of other nodes have type std_msgs/msg/String there, and this node sweepd_msgs/msg/{ours}"
        room.until(lambda: any(words in log.msg and log.level == Log.WARN for log in logs), f"{words} on /rosout")
        room.until(lambda: any(words in status.message for message in said[-2:] for status in message.status), f"{words} in the diagnostics")
    stranger.destroy_node()
    rclpy.shutdown(context=context)


def test_malformed_datagrams_do_no_harm(room):
    daemon = room.daemon(HANDS)
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    said = room.hear(DiagnosticArray, "/diagnostics")
    sender = Sender(node)
    room.until(lambda: states and states[-1].word == "clear", "clear", then=lambda: sender.send(FAR))
    seed = secrets.randbits(32)
    print("seed", seed)
    noise = random.Random(seed)
    base = 7400 + 250 * room.domain
    ports = [base, base + 1] + [base + 10 + 2 * k + odd for k in range(6) for odd in (0, 1)]
    header = b"RTPS\x02\x03\x01\x0f"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for number in range(6000):
            body = noise.randbytes(noise.randrange(0, 300))
            kind = number % 4
            if kind == 1:
                body = header + noise.randbytes(12) + body
            elif kind == 2:  # a submessage that promises more than there is
                body = header + noise.randbytes(12) + struct.pack("<BBH", noise.choice([0x15, 0x16, 0x06, 0x07, 0x09]), 1, 0xFFF0) + body
            elif kind == 3:  # one with a length that fits and contents that do not
                body = header + noise.randbytes(12) + struct.pack("<BBH", noise.choice([0x15, 0x16, 0x06, 0x07, 0x08, 0x12, 0x13]), 1, len(body)) + body
            try:
                out.sendto(body, ("127.0.0.1", ports[number % len(ports)]))
            except ConnectionRefusedError:
                pass
            if number % 20 == 0:
                room.spin(0.002)
    count = len(states)
    room.until(lambda: len(states) > count + 20 and states[-1].word == "clear", "clear after it", then=lambda: sender.send(FAR))
    assert daemon.process.poll() is None
    late = room.node("late")
    heard = room.hear(State, "/sweepd/state", node=late)
    room.until(lambda: heard, "a late reader is found and served")
    # half of them have no header, or a first submessage longer than they are, and of the others most are wrong behind
    # that; the daemon has some of the ports, its peers the others
    for words in ("datagrams were no RTPS", "datagrams began as RTPS and could not be read"):
        room.until(lambda: any(words in status.message for one in said for status in one.status), f"{words} in the diagnostics")
    values = {v.key: int(v.value) for status in said[-1].status for v in status.values if v.key.startswith("datagrams_")}
    print(values)
    assert values.keys() == {"datagrams_dropped", "datagrams_unread"} and min(values.values()) >= 100, values
