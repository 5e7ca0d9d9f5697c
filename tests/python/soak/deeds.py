"""What happens to a daemon in use: edits, resets, silence, clients that come and go, and ends of processes."""

from __future__ import annotations

import signal
import time
from typing import Callable

from . import cast, check_answers
from .checker import Checker
from .clients import OwnSource, Process, Reader
from .driver import TOPICS, Soak
from .scene import ALL_GROUPS, Body, Rule
from .world import Change

#: Bodies that are put beside those of the beginning, at most.
_EXTRA_MAX = 6
#: A deed in so many steps.
_STEPS_PER_DEED = 12.0


class Mix:
    """Deeds by chance, and some at set times so that a short run has them too.

    * ``from_s``, ``until_s``: of the run, monotonic seconds.
    """

    def __init__(self, from_s: float, until_s: float) -> None:
        length_s = until_s - from_s
        shares = [
            (0.15, kill_child),
            (0.3, late_reader),
            (0.4, restart_by_kill),
            (0.55, silence),
            (0.65, take_over),
            (0.75, reader_leaves),
            (0.85, kill_child),
        ]
        self._due = [(from_s + share * length_s, deed) for share, deed in shares]

    def __call__(self, soak: Soak) -> None:
        if self._due and time.monotonic() >= self._due[0][0]:
            self._due.pop(0)[1](soak)
        elif soak.random.random() < 1.0 / _STEPS_PER_DEED:
            deeds, weights = zip(*_WEIGHTS)
            soak.random.choices(deeds, weights)[0](soak)


# -------------------------------------------------------------------- edits


def _any_body(soak: Soak, of: tuple[str, ...] = (cast.SIM, cast.ARM)) -> Body:
    bodies = [body for body in soak.scene.bodies.values() if body.source in of]
    return soak.random.choice(sorted(bodies, key=lambda body: body.name))


def put_new(soak: Soak) -> None:
    """A body more; the name of one that was removed comes back with its id."""
    names = [f"extra_{at}" for at in range(_EXTRA_MAX)]
    free = [name for name in names if name not in soak.scene.bodies]
    if not free:
        return remove(soak)
    body = cast.extra(soak.random, soak.random.choice(free), soak.random.choice([cast.SIM, cast.ARM]), soak.scene)
    soak.edit([{"put": body.keys()}], soak.scene.with_body(body), put=(body.name,))


def put_again(soak: Soak) -> None:
    """Another body in the place of one, under its name."""
    old = _any_body(soak)
    new = cast.extra(soak.random, old.name, old.source or cast.SIM, soak.scene)
    change = Change(removed=frozenset([old.name]))
    soak.edit([{"put": new.keys()}], soak.scene.with_body(new), change, (new.name,))


def remove(soak: Soak) -> None:
    """One body less, at times with another in the same request."""
    extras = sorted(name for name in soak.scene.bodies if name.startswith("extra_"))
    if not extras:
        return put_new(soak)
    gone = soak.random.sample(extras, min(len(extras), soak.random.choice([1, 1, 2])))
    scene = soak.scene
    for name in gone:
        scene = scene.without(name)
    soak.edit([{"remove": name} for name in gone], scene, Change(removed=frozenset(gone)))


def enable(soak: Soak) -> None:
    """Takes a body out of everything, or back in."""
    off = sorted(body.name for body in soak.scene.bodies.values() if not body.enabled)
    if off:
        name, enabled = soak.random.choice(off), True
    else:
        name, enabled = _any_body(soak, (cast.SIM, cast.ARM, cast.CHILD)).name, False
    change = Change(disabled=frozenset([] if enabled else [name]))
    scene = soak.scene.changed(name, enabled=enabled)
    soak.edit([{"enable": {"body": name, "enabled": enabled}}], scene, change)


def margin(soak: Soak) -> None:
    """Another distance within which pairs are near."""
    body = _any_body(soak, (cast.SIM, cast.ARM, cast.CHILD))
    within_m = soak.random.choice([within_m for within_m in (0.0, 0.05, 0.3) if within_m != body.report_within_m])
    scene = soak.scene.changed(body.name, report_within_m=within_m)
    soak.edit([{"margin": {"body": body.name, "report_within_m": within_m}}], scene)


def filters(soak: Soak) -> None:
    """Another group and mask."""
    body = _any_body(soak)
    group, mask = soak.random.choice([(1, ALL_GROUPS), (2, ALL_GROUPS), (1, 2), (2, 1)])
    scene = soak.scene.changed(body.name, group=group, mask=mask)
    soak.edit([{"filter": {"body": body.name, "group": group, "mask": mask}}], scene)


def rules(soak: Soak) -> None:
    """A pair rule more, or those of a pair gone."""
    if len(soak.scene.rules) > 6:
        rule = soak.random.choice(soak.scene.rules)
        soak.edit([{"drop_rules": {"a": rule.a, "b": rule.b}}], soak.scene.without_rules(rule.a, rule.b))
        return
    one = soak.random.choice([_any_body(soak).name, "sim_orbit_*", "wall_?"])
    report_m = soak.random.choice([None, 0.4])
    rule = Rule(soak.random.choice(["ignore", "check"]), one, _any_body(soak).name, report_m)
    rule = rule if rule.action == "check" else rule._replace(report_within_m=None)
    soak.edit([{"rule": rule.keys()}], soak.scene.with_rule(rule))


def reset(soak: Soak) -> None:
    """Poses are forgotten by an edit."""
    name = soak.random.choice([None, cast.SIM, cast.ARM, cast.CHILD])
    those = frozenset([cast.SIM, cast.ARM, cast.CHILD] if name is None else [name])
    keys = {} if name is None else {"source": name}
    scene = soak.scene
    # a revision of its own, though the bodies are the same
    soak.edit([{"reset": keys}], type(scene)(scene.bodies, scene.rules), Change(reset=those))


# -------------------------------------------------------------------- sources


def _any_source(soak: Soak) -> OwnSource:
    return soak.own[soak.random.choice(sorted(soak.own))]


def new_epoch(soak: Soak) -> None:
    """A source's world is reset."""
    source = _any_source(soak)
    soak.note(f"a new epoch of {source.name}")
    source.reset_epoch()


def new_session(soak: Soak) -> None:
    """A source's client goes and another comes."""
    source = _any_source(soak)
    soak.note(f"a new session of {source.name}")
    source.reopen(close=True)


def take_over(soak: Soak) -> None:
    """A silent source is taken over by another client; what the first one sends after that is refused."""
    source = _any_source(soak)
    soak.note(f"{source.name} is taken over")
    soak.pass_time(soak.setup.source(source.name).timeout_ms / 1000.0 + 0.2)
    old = source.reopen(close=False)
    try:
        lead = [] if source.name == cast.SIM else [soak.own[cast.SIM]]
        while not source.is_heard and not soak.report.faults:
            soak.step += 1
            sent = [one for one in (source, *lead) if soak._send(one)]
            soak.await_used(sent)
        if not soak.report.faults:
            source.send_void(old, {body.name: body.path.at(soak.step) for body in source.bodies(soak.scene)})
            soak.pass_time(0.15)
    finally:
        old.close()


def silence(soak: Soak) -> None:
    """A source says nothing for about its time-out, or longer."""
    source = _any_source(soak)
    seconds = soak.random.choice([0.2, 0.4, 0.8])
    soak.note(f"{source.name} is silent for {seconds} s")
    source.quiet_until_s = time.monotonic() + seconds


def stop_child(soak: Soak) -> None:
    """A source's process is stopped for longer than its time-out, and goes on."""
    if soak.child is None:
        return soak.start_child()
    soak.note("the child is stopped")
    soak.child.signal(signal.SIGSTOP)
    soak.random.choice([_steps, Soak.pass_time])(soak, soak.random.choice([0.1, 0.6]))
    soak.child.signal(signal.SIGCONT)


def kill_child(soak: Soak) -> None:
    """A source's process is killed in the middle; after a while there is another."""
    if soak.child is not None:
        soak.note("the child is killed")
        soak.kill_child()
        _steps(soak, soak.random.choice([0.05, 0.8]))
    soak.note("a child starts")
    soak.start_child()


def _steps(soak: Soak, seconds: float) -> None:
    """The others go on for a while."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s and not soak.report.faults:
        soak.one_step()


def flood(soak: Soak) -> None:
    """More frames than a queue holds."""
    source = _any_source(soak)
    if source.is_heard:
        soak.note(f"{source.name} sends many frames at once")
        for _ in range(soak.random.choice([4, 9])):
            soak.step += 1
            soak._send(source)


# -------------------------------------------------------------------- questions


def ask_gap(soak: Soak) -> None:
    """The gap of two bodies."""
    names = soak.random.sample(sorted(soak.scene.bodies), 2)
    answer, moment = soak.ask("gap", {"a": names[0], "b": names[1]})
    if moment is not None:
        soak.found(list(check_answers.check_gap(moment, (names[0], names[1]), answer)))


def ask_touching(soak: Soak) -> None:
    """What a body touches, or is near to."""
    name = soak.random.choice(sorted(body.name for body in soak.scene.bodies.values() if body.moves))
    within_m = soak.random.choice([0.0, 0.5])
    answer, moment = soak.ask("touching", {"body": name, "within_m": within_m})
    if moment is not None:
        soak.found(list(check_answers.check_touching(moment, name, within_m, answer)))


def validate(soak: Soak) -> None:
    """The daemon checks itself."""
    soak.validate()


# -------------------------------------------------------------------- readers and daemons


def late_reader(soak: Soak) -> None:
    """A reader joins, and is checked from its first tick on."""
    if len(soak.readers) < 2:
        topics = soak.random.choice(TOPICS)
        soak.note(f"a reader of {topics} joins")
        soak.readers.append(Reader(soak.daemon.instance, topics, Checker(soak.world), soak.agreement))


def reader_leaves(soak: Soak) -> None:
    """The reader that has been there for longest leaves, if there is another."""
    if len(soak.readers) > 1 and "bodies" in soak.readers[1].topics:
        soak.note("a reader leaves")
        gone = soak.readers.pop(0)
        soak.report.counts += gone.checker.counts
        gone.close()


def idle_reader(soak: Soak) -> None:
    """A reader in a process of its own comes, and is killed at the next time."""
    if soak.idle is None:
        soak.note("a reader of its own process joins")
        soak.idle = Process("reader", soak.daemon.instance)
    else:
        soak.note("the reader of its own process is killed")
        soak.idle.kill()
        soak.idle = None


def restart_by_kill(soak: Soak) -> None:
    """The daemon is killed; another takes its services over."""
    soak.restart_daemon(signal.SIGKILL)


def restart_by_end(soak: Soak) -> None:
    """The daemon is asked to end, and started again."""
    soak.restart_daemon(signal.SIGTERM)


_WEIGHTS: list[tuple[Callable[[Soak], None], float]] = [
    (put_new, 4),
    (put_again, 4),
    (remove, 4),
    (enable, 4),
    (margin, 3),
    (filters, 3),
    (rules, 4),
    (reset, 2),
    (new_epoch, 2),
    (new_session, 1),
    (take_over, 0.3),
    (silence, 2),
    (stop_child, 1),
    (kill_child, 0.5),
    (flood, 2),
    (late_reader, 2),
    (reader_leaves, 1),
    (idle_reader, 0.5),
    (ask_gap, 2),
    (ask_touching, 2),
    (validate, 1),
    (restart_by_kill, 0.25),
    (restart_by_end, 0.1),
]
