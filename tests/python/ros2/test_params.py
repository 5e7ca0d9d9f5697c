"""Parameters: given at the start, read and set by others while the node runs, refused with a reason; simulated time."""

import time

import pytest
from conftest import BEST_EFFORT, LATCHED, RELIABLE
from diagnostic_msgs.msg import DiagnosticArray
from frames import Sender
from parameters import put, value
from rcl_interfaces.msg import Log, Parameter, ParameterEvent, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParametersAtomically
from rosgraph_msgs.msg import Clock
from scenes import HANDS, cloud
from sweepd_msgs.msg import Contacts, Pairs, State, Tick

EDITS = ["-p", "ros.allow_edits:=true"]
FAR = {"left": (0, 0, 0), "right": (5, 0, 0)}
CLOSE = {"left": (0, 0, 0), "right": (0.5, 0, 0)}


def get(room, *names):
    answer = room.call(GetParameters, "/sweepd/get_parameters", GetParameters.Request(names=names))
    picked = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value"}
    return [getattr(one, picked[one.type]) if one.type else None for one in answer.values]


def test_parameters_are_listed_described_and_read(room):
    room.daemon(HANDS, "--budget", "3ms")
    room.node()
    names = set(room.call(ListParameters, "/sweepd/list_parameters").result.names)
    wanted = {"budget_ms", "budget_units", "mode", "ros_max_pairs", "ros_max_contacts", "markers_rate_hz", "out_reliability",
              "publish_markers", "publish_collisions", "ros.allow_edits", "use_sim_time", "timeout_ms.sim"}  # fmt: skip
    assert wanted <= names, wanted - names
    assert get(room, "budget_ms", "mode", "ros_max_contacts", "timeout_ms.sim", "nothing") == [3.0, "on_frame=sim", 500, 500.0, None]
    kinds = room.call(GetParameterTypes, "/sweepd/get_parameter_types", GetParameterTypes.Request(names=["mode", "nothing"])).types
    assert list(kinds) == [ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_NOT_SET]
    listed = room.call(ListParameters, "/sweepd/list_parameters", ListParameters.Request(prefixes=["timeout_ms", "ros"])).result
    assert (list(listed.names), list(listed.prefixes)) == (["ros.allow_edits", "timeout_ms.sim"], ["ros", "timeout_ms"])


def test_descriptors_tell_what_a_parameter_is_for_its_range_and_when_it_is_set(room):
    room.daemon(HANDS)
    room.node()
    names = ["budget_ms", "markers_rate_hz", "ros_max_contacts", "out_reliability", "ros.allow_edits", "nothing"]
    answer = room.call(DescribeParameters, "/sweepd/describe_parameters", DescribeParameters.Request(names=names))
    told = dict(zip(names, answer.descriptors))
    assert [d.name for d in answer.descriptors] == names
    assert all(d.description and not d.dynamic_typing for name, d in told.items() if name != "nothing")
    budget, rate, rows = told["budget_ms"], told["markers_rate_hz"], told["ros_max_contacts"]
    assert budget.type == ParameterType.PARAMETER_DOUBLE and "-1 for no limit" in budget.additional_constraints
    assert "allow_edits" in budget.additional_constraints and "allow_edits" not in rate.additional_constraints
    assert (rate.floating_point_range[0].from_value, rate.floating_point_range[0].to_value) == (0.1, 100.0)
    assert (rows.integer_range[0].from_value, rows.integer_range[0].to_value) == (0, 100_000)
    assert told["out_reliability"].additional_constraints == "reliable or best_effort"
    assert [name for name in names if told[name].read_only] == ["ros.allow_edits"]
    assert told["nothing"].type == ParameterType.PARAMETER_NOT_SET


def test_safety_parameters_are_refused_unless_edits_are_allowed(room):
    room.daemon(HANDS)
    room.node()
    for name, one in [("budget_ms", 1.0), ("mode", "rate=10"), ("timeout_ms.sim", 100.0), ("report_within_m", 0.1),
                      ("use_sim_time", True)]:  # fmt: skip
        ((done, reason),) = put(room, **{name.replace(".", "__"): one})
        assert not done and "allow_edits" in reason, (name, reason)
    assert put(room, ros__allow_edits=True)[0][0] is False
    assert put(room, ros_max_contacts=10) == [(True, "")]
    assert get(room, "budget_ms", "ros_max_contacts") == [-1.0, 10]


def test_wrong_values_are_refused_with_a_reason_and_atomic_sets_are_all_or_nothing(room):
    room.daemon(HANDS, ros_args=EDITS)
    room.node()
    for name, one in [("budget_ms", -2.0), ("ros_max_contacts", -1), ("markers_rate_hz", 0.0), ("mode", "fast"),
                      ("mode", "on_frame=nobody"), ("publish_markers", "yes"), ("out_reliability", "often"), ("ros.allow_edits", False),
                      ("no_such_parameter", 1)]:  # fmt: skip
        ((done, reason),) = put(room, **{name.replace(".", "__"): one})
        assert not done and reason, (name, one)
    both = [Parameter(name="ros_max_contacts", value=value(7)), Parameter(name="budget_ms", value=value(-5.0))]
    answer = room.call(SetParametersAtomically, "/sweepd/set_parameters_atomically", SetParametersAtomically.Request(parameters=both))
    assert not answer.result.successful and answer.result.reason
    assert get(room, "budget_ms", "ros_max_contacts") == [-1.0, 500], "the good one of the two is not taken either"
    both[1] = Parameter(name="budget_ms", value=value(5.0))
    answer = room.call(SetParametersAtomically, "/sweepd/set_parameters_atomically", SetParametersAtomically.Request(parameters=both))
    assert answer.result.successful and get(room, "budget_ms", "ros_max_contacts") == [5.0, 7]


def test_the_reliability_of_large_topics_is_set_while_running(room):
    room.daemon(HANDS)
    node = room.node()
    sender = Sender(node)
    feed = lambda: sender.send(CLOSE)  # noqa: E731
    strict, loose = room.hear(Pairs, "/sweepd/pairs", RELIABLE), room.hear(Pairs, "/sweepd/pairs", BEST_EFFORT)
    room.until(lambda: strict and loose, "pairs for both readers", then=feed)
    assert put(room, out_reliability="best_effort") == [(True, "")]
    room.spin(1.0)
    start, heard = len(strict), len(loose)
    room.until(lambda: len(loose) > heard + 20, "pairs for the reader that asks for no more", then=feed)
    assert len(strict) == start, "one that asks for reliable messages does not match"
    assert put(room, out_reliability="reliable") == [(True, "")]
    heard = len(loose)
    room.until(lambda: len(strict) > start + 20 and len(loose) > heard + 20, "pairs for both again", then=feed)


def test_what_is_set_takes_effect_and_is_told(room):
    room.daemon(HANDS, ros_args=EDITS)
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    events = room.hear(ParameterEvent, "/parameter_events")
    logs = room.hear(Log, "/rosout")
    sender = Sender(node)
    room.until(lambda: ticks and ticks[-1].budget_ns == Tick.UNLIMITED, "no budget", then=lambda: sender.send(FAR))
    assert put(room, budget_ms=4) == [(True, "")], "a whole number stands for a number"
    room.until(lambda: ticks[-1].budget_ns == 4_000_000, "the budget in the tick", then=lambda: sender.send(FAR))
    assert get(room, "budget_ms") == [4.0]
    assert put(room, mode="rate=20") == [(True, "")]
    start = len(ticks)
    room.until(lambda: len(ticks) > start + 20, "ticks without frames", seconds=5)
    changed = lambda: [(p.name, p.value.double_value) for e in events if e.node == "/sweepd" for p in e.changed_parameters]  # noqa: E731
    room.until(lambda: ("budget_ms", 4.0) in changed(), "a parameter event")
    room.until(lambda: any("budget_ms" in log.msg for log in logs), "a line on /rosout")


def test_parameter_files_and_arguments_are_taken_in_order(room):
    first, second = room.folder / "a.yaml", room.folder / "b.yaml"
    first.write_text("/**:\n  ros__parameters:\n    budget_ms: 7\n    ros_max_contacts: 11\n    ros:\n      allow_edits: true\n")
    second.write_text("/cell:\n  sweepd:\n    ros__parameters:\n      ros_max_contacts: 12\nother:\n  ros__parameters:\n    budget_ms: 1\n")
    room.daemon(HANDS, ros_args=["-r", "__ns:=/cell", "--params-file", str(first), "--params-file", str(second), "-p", "ros_max_pairs:=13"])
    room.node()
    names = ["budget_ms", "ros_max_contacts", "ros_max_pairs", "ros.allow_edits"]
    answer = room.call(GetParameters, "/cell/sweepd/get_parameters", GetParameters.Request(names=names))
    budget, contacts, pairs, edits = answer.values
    assert (budget.double_value, contacts.integer_value, pairs.integer_value, edits.bool_value) == (7.0, 12, 13, True)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["-p", "ros_max_contacts:=-1"], "ros_max_contacts"),
        (["-p", "budget_ms:=soon"], "budget_ms"),
        (["--params-file", "/nowhere.yaml"], "/nowhere.yaml"),
    ],
)
def test_a_value_that_cannot_be_meant_is_refused_at_the_start(room, arguments, word):
    daemon = room.daemon(HANDS, ros_args=arguments)
    assert daemon.refusal() in (2, 4)
    assert word in daemon.log, daemon.log


def test_an_unknown_parameter_is_told(room):
    room.node()
    logs = room.hear(Log, "/rosout", LATCHED)
    daemon = room.daemon(HANDS, ros_args=["-p", "no_such_parameter:=1"])
    room.until(lambda: "no_such_parameter" in daemon.log and "ros_max_contacts" in daemon.log, "a word on it, and what there is")
    room.until(lambda: any("no_such_parameter" in log.msg and log.level == Log.WARN for log in logs), "and on /rosout")


def test_limits_of_rows_are_parameters(room):
    room.daemon(cloud(30), ros_args=["-p", "ros_max_contacts:=20000"])
    node = room.node()
    contacts = room.hear(Contacts, "/sweepd/contacts")
    sender = Sender(node)
    together = {f"b{n:04}": (0.001 * n, 0, 0) for n in range(30)}
    room.until(lambda: contacts and contacts[-1].complete and contacts[-1].contacts, "all of them", then=lambda: sender.send(together))
    put(room, ros_max_contacts=5)
    cut = room.until(lambda: not contacts[-1].complete and contacts[-1], "cut", then=lambda: sender.send(together))
    assert len(cut.contacts) == 5 and cut.tick_header.truncated == 30 * 29 // 2 - 5


def test_a_sources_timeout_that_is_set_while_running_is_when_its_bodies_are_stale(room):
    room.daemon(HANDS, ros_args=EDITS)
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)

    def silence():
        """How long after the last frame its bodies are stale, seconds."""
        room.until(lambda: ticks and ticks[-1].reasons == 0, "known bodies", then=lambda: sender.send(FAR))
        last, start = time.clock_gettime_ns(time.CLOCK_BOOTTIME), len(ticks)
        seq = sender.send(FAR)
        room.until(lambda: any(t.sources[0].seq == seq for t in ticks[start:]), "the last frame")
        stale = room.until(lambda: [t for t in ticks[start:] if t.sources[0].seq == seq and t.reasons & State.STALE], "stale bodies")
        return (stale[0].sent_ns - last) / 1e9

    assert 0.5 <= silence() < 0.9, "as the scene says"
    # shorter and longer than that; 0.4 s is for the way and for the machine
    for timeout in (0.1, 1.5):
        assert put(room, timeout_ms__sim=1e3 * timeout) == [(True, "")]
        assert timeout <= silence() < timeout + 0.4, timeout


def test_the_limit_of_pairs_that_is_set_while_running_bounds_the_rows_and_the_rest_is_told(room):
    room.daemon(cloud(30))
    node = room.node()
    pairs = room.hear(Pairs, "/sweepd/pairs")
    sender = Sender(node)
    together = {f"b{n:04}": (0.001 * n, 0, 0) for n in range(30)}
    whole = room.until(lambda: pairs and pairs[-1].complete and pairs[-1].pairs and pairs[-1], "all", then=lambda: sender.send(together))
    assert len(whole.pairs) == 30 * 29 // 2 and whole.tick_header.truncated == 0
    assert put(room, ros_max_pairs=7) == [(True, "")]
    cut = room.until(lambda: not pairs[-1].complete and pairs[-1], "cut", then=lambda: sender.send(together))
    assert len(cut.pairs) == 7 and cut.tick_header.truncated == 30 * 29 // 2 - 7


def test_the_reason_of_a_refusal_has_the_range_in_words(room):
    room.daemon(HANDS, ros_args=EDITS)
    room.node()
    ((done, reason),) = put(room, markers_rate_hz=1000.0)
    assert not done and "markers_rate_hz is 1000: write a number from 0.1 to 100" in reason, reason


def test_the_margin_of_near_pairs_is_a_parameter_given_at_the_start_and_set_while_running(room):
    room.daemon(HANDS, ros_args=[*EDITS, "-p", "report_within_m:=0.6"])
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    sender = Sender(node)
    # spheres of 0.5 m, 1.5 m apart: a gap of 0.5 m
    apart = {"left": (0, 0, 0), "right": (1.5, 0, 0)}

    def word(wanted, what):
        room.until(lambda: states and states[-1].word == wanted, what, then=lambda: sender.send(apart))

    word("near", "nearer than 0.6 m")
    assert put(room, report_within_m=0.4) == [(True, "")]
    word("clear", "farther than 0.4 m")
    assert put(room, report_within_m=2.0) == [(True, "")]
    word("near", "nearer than 2 m")
    assert put(room, report_within_m=-1.0) == [(True, "")]
    word("clear", "as the scene says")
    ((done, reason),) = put(room, report_within_m=-0.5)
    assert not done and "what each body was put with" in reason


def test_simulated_time_is_switched_on_and_off_while_running(room):
    room.daemon(HANDS, ros_args=EDITS)
    node = room.node()
    clock = node.create_publisher(Clock, "/clock", RELIABLE)
    said = room.hear(DiagnosticArray, "/diagnostics")
    sender = Sender(node)

    def step():
        message = Clock()
        message.clock.sec = 1_500
        clock.publish(message)
        sender.send(FAR)

    def is_simulated(wanted, what):
        start = len(said)
        room.until(lambda: len(said) > start and (said[-1].header.stamp.sec == 1_500) == wanted, what, then=step)

    is_simulated(False, "the time of the host")
    assert put(room, use_sim_time=True) == [(True, "")]
    is_simulated(True, "the time of /clock")
    assert put(room, use_sim_time=False) == [(True, "")]
    is_simulated(False, "the time of the host again")


def test_simulated_time_is_that_of_the_clock_topic_and_a_jump_back_ends_every_pair(room):
    room.daemon(HANDS, ros_args=["-p", "use_sim_time:=true"])
    node = room.node()
    clock = node.create_publisher(Clock, "/clock", RELIABLE)
    pairs = room.hear(Pairs, "/sweepd/pairs")
    states = room.hear(State, "/sweepd/state")
    sender = Sender(node)
    now = [1_000.0]

    def step():
        now[0] += 0.02
        message = Clock()
        message.clock.sec, message.clock.nanosec = int(now[0]), int((now[0] % 1) * 1e9)
        clock.publish(message)
        sender.send(CLOSE, stamp_ns=int(now[0] * 1e9))

    room.until(lambda: states and states[-1].word == "colliding", "a collision", then=step)
    # What was sent on /clock before the daemon matched it is lost: only what is stamped by it shows that it was heard.
    said = room.hear(DiagnosticArray, "/diagnostics")
    room.until(lambda: said and 1_000 <= said[-1].header.stamp.sec < 2_000, "the daemon's time is that of /clock", then=step)
    start = len(pairs)
    now[0] = 10.0
    room.until(lambda: any(p.events & p.END and p.end_cause == p.END_RESET for m in pairs[start:] for p in m.pairs),
               "an end with cause reset", then=step)  # fmt: skip
    room.until(lambda: states[-1].word == "colliding", "and it goes on", then=step)
