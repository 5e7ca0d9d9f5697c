"""What comes in: ticks in their order, and with each the messages that belong to it, over restarts of the daemon."""

import ctypes
import time

import numpy as np

from . import layout
from .errors import Restarted, SweepdError
from .lists import ContactList, PairList
from .refusals import is_under_way

LOOK_AGAIN_S = 0.05
_BOOTS_OVER_MAX = 16
# ticks of the boot in force that may still come while a message of the next one is there: what a queue holds, twice
_TICKS_LEFT_MAX = 16
# ticks that one look takes at most: more than wait in its queues
_DRAINED_MAX = 32
# ticks without all that is listened to that are passed over at first, and how far apart they are at least: more than wait where a
# boot went unseen, and a second. A message that cannot be handed over is no reason to be silent for ever
_PASSED_MAX = 32
_PASSED_NS = 1_000_000_000 // _PASSED_MAX
_TOPICS = {
    "pairs": layout.PairRow,
    "changes": layout.PairRow,
    "contacts": layout.ContactRow,
    "contact_changes": layout.ContactRow,
    "regions": layout.RegionRow,
    "bodies": layout.BodyRow,
    "body_verdicts": ctypes.c_uint8,
    "names": layout.NameRow,
    "plan": ctypes.c_uint8,
}
_HEADERS = {"changes": layout.ChangesHeader, "contact_changes": layout.ChangesHeader}
_LISTS = {"changes": PairList, "contact_changes": ContactList}
# sent when they change, where all others are each tick's
_LASTING = ("names", "plan")


def topics_of(listen):
    """The topics that a client listens to, with those that all do; raises where there is no such topic."""
    if isinstance(listen, str):
        listen = (listen,)
    try:
        listen = list(listen)
    except TypeError:
        listen = [listen]
    unknown = [topic for topic in listen if not isinstance(topic, str) or topic not in _TOPICS]
    if unknown:
        raise SweepdError(f"listen={unknown}: there are {', '.join(_TOPICS)}")
    return list(dict.fromkeys([*listen, "names"]))


class Inbox:
    """Reads the queues of a client's ports up to a tick, and keeps what belongs to it."""

    def __init__(self, ports, topics, until):
        for topic in topics:
            ports.subscribe(topic, _TOPICS[topic], _HEADERS.get(topic, layout.MessageHeader), until)
        self._ports = ports
        self._topics = topics
        # messages of a later tick or boot, and how many ticks they have waited
        self._ahead = dict.fromkeys(topics)
        self._waited = dict.fromkeys(topics, 0)
        self._now = dict.fromkeys(topics)
        #: The lists that are kept from what is new in them, by topic.
        self.lists = {topic: _LISTS[topic]() for topic in topics if topic in _LISTS}
        #: The newest tick; None where there was none of this boot.
        self.tick = None
        self._held = None
        #: Boot of the daemon whose ids the names are.
        self.boot = ports.hello.boot_id
        self._boots_over = []
        # ticks that may yet be passed over until one has all that is listened to, 0: one had; and when the last was sent
        self._to_pass, self._passed_ns = _PASSED_MAX, 0

    def clear(self):
        """Lets go of all messages, which lie in shared memory."""
        self._ahead, self._now, self._held = {}, {}, None

    def is_settled(self):
        """Whether the daemon that is there is the one whose ids the names are, or one that is over."""
        return self._ports.boot() in (self.boot, *self._boots_over)

    def wait_names(self, until):
        """Names come with the newest state, a moment after the connection."""
        while self._now["names"] is None and self.next(until):
            pass

    def drain(self, *, tells_restart=True):
        """Takes what is there, up to the newest tick; raises Restarted, or leaves that to the next look."""
        # where a tick takes longer to read than the next one takes to come, there is always one
        for _ in range(_DRAINED_MAX):
            if not self._take(tells_restart):
                return

    def next(self, until):
        """The next newer tick and all that belongs to it; False when the time is up."""
        while not self._take():
            left = until - time.monotonic()
            if left <= 0:
                return False
            self._ports.wait(min(left, LOOK_AGAIN_S))
        return True

    def begin(self):
        """Looks at the newest tick until one has all that is listened to; whether it, or one before it, had."""
        if self._to_pass:
            messages = self.messages()
            if all(self.lasting(topic) if topic in _LASTING else topic in messages for topic in self._topics):
                self._to_pass = 0
            elif self.tick.sent_ns >= self._passed_ns + _PASSED_NS and not is_under_way(self.tick):
                # one that is under way has nothing yet, however often it is told of
                self._to_pass, self._passed_ns = self._to_pass - 1, self.tick.sent_ns
        return not self._to_pass

    def messages(self):
        """What belongs to the newest tick, by topic."""
        tick = self.tick.header
        messages = {}
        for topic, now in self._now.items():
            if now is None:
                continue
            if topic in self.lists:
                if self.lists[topic].is_of(tick):
                    messages[topic] = now
            elif (now[0].boot_id, now[0].tick) == (tick.boot_id, tick.tick):
                messages[topic] = now[1]
        return messages

    def lasting(self, topic):
        """The newest message of a topic that is sent when it changes, of this boot; None where there is none."""
        message = self._now.get(topic)
        return None if message is None or message[0].boot_id != self.boot else message

    def _take(self, tells_restart=True):
        while True:
            tick, self._held = self._held or self._ports.tick(), None
            if tick is None:
                return False
            new = tick.header
            # queues of an old and a new daemon are read in no certain order
            if new.boot_id in self._boots_over:
                continue
            old = self.tick and self.tick.header
            if old and old.boot_id != new.boot_id:
                # there is one daemon at a time: what is left of one that came and went unseen is older
                if tick.sent_ns < self.tick.sent_ns:
                    self._note_over(new.boot_id)
                    continue
                if not tells_restart:
                    self._held = self._newest(tick)
                    return False
                self._restart(old, tick)
            # a tick that takes longer than a heartbeat is told of under its own number before it is there itself
            if old and (new.tick, tick.sent_ns) <= (old.tick, self.tick.sent_ns):
                continue
            self.tick, self.boot = tick, new.boot_id
            # who looks late finds the rows of its end beside what was told of it before; they are handed out once
            is_bare = is_under_way(tick)
            for topic in self._topics:
                if is_bare and topic not in _LASTING:
                    continue
                if topic in self.lists:
                    self._advance_list(topic, new)
                else:
                    self._advance(topic, new)
            return True

    def _newest(self, tick):
        """The newest tick that waits, if it is newer than this one: a restart is told as of then, with the names of then."""
        for _ in range(_DRAINED_MAX):
            other = self._ports.tick()
            if other is None:
                break
            older, tick = sorted((tick, other), key=lambda row: row.sent_ns)
            if older.header.boot_id not in (tick.header.boot_id, self.boot, *self._boots_over):
                # it came and went unheard: what is left of it must not stand before what the new one says
                self._note_over(older.header.boot_id)
        return tick

    def _restart(self, old, tick):
        self._note_over(old.boot_id)
        ends = np.empty((0, 2), np.uint64)
        pairs, rows = self._now.get("pairs"), None
        if pairs is not None and pairs[0].boot_id == old.boot_id:
            rows = pairs[1]
        elif "changes" in self.lists and self.lists["changes"].boot_id == old.boot_id:
            rows = self.lists["changes"].rows()
        if rows is not None:
            there = rows["flags"] & int(layout.PairFlags.GONE) == 0
            rows = rows[there & (rows["certified_verdict"] == layout.Verdict.COLLIDING)]
            ends = np.stack([rows["body_a"], rows["body_b"]], axis=1)
        self.tick, self._held, self.boot = None, tick, tick.header.boot_id
        # the new one may not know of this client yet
        self._to_pass = _PASSED_MAX
        # so that names are new from here on
        self._advance("names", tick.header)
        raise Restarted(old.boot_id, tick.header.boot_id, ends)

    def _note_over(self, boot_id):
        self._boots_over = [*self._boots_over[1 - _BOOTS_OVER_MAX :], boot_id]

    def _give_up(self, topic, boot_id):
        """Lets a message of another boot than the tick's wait once more, or gives up that boot: whether it did.

        After so many ticks those of that boot no longer come: it went unseen.
        """
        self._waited[topic] += 1
        if self._waited[topic] <= _TICKS_LEFT_MAX:
            return False
        self._waited[topic] = 0
        self._note_over(boot_id)
        return True

    def _advance(self, topic, tick):
        """Takes messages up to the tick; one of a later tick or boot is kept for then."""
        while True:
            ahead = self._ahead[topic]
            if ahead is None:
                ahead = self._ahead[topic] = self._ports.message(topic)
                self._waited[topic] = 0
            if ahead is None:
                return
            header = ahead[0]
            if header.boot_id in self._boots_over:
                self._ahead[topic] = None
            elif header.boot_id == tick.boot_id and header.tick <= tick.tick:
                now = self._now[topic]
                if now is None or now[0].boot_id != header.boot_id or now[0].tick < header.tick:
                    self._now[topic] = ahead
                self._ahead[topic] = None
                if header.tick == tick.tick:
                    # no more is of this tick
                    return
            elif header.boot_id == tick.boot_id or not self._give_up(topic, header.boot_id):
                return
            ahead = None

    def _advance_list(self, topic, tick):
        """As ``_advance``, but every message is applied; one that is not for the list has the whole list asked for."""
        listing = self.lists[topic]
        if not self._ports.is_open(topic):
            # the place went to another reader when the port was to be renewed
            self._renew_list(topic)
            if not self._ports.is_open(topic):
                # and now the daemon is away
                return
        while True:
            ahead, self._ahead[topic] = self._ahead[topic], None
            if ahead is None:
                ahead, self._waited[topic] = self._ports.message(topic), 0
            if ahead is None:
                return
            header = ahead[0].message
            if header.boot_id in self._boots_over:
                continue
            if header.boot_id != tick.boot_id or header.tick > tick.tick:
                self._ahead[topic] = ahead
                if header.boot_id == tick.boot_id or not self._give_up(topic, header.boot_id):
                    return
                continue
            self._now[topic] = None
            if listing.take(*ahead):
                ahead = None
                self._renew_list(topic)
            elif listing.is_whole:
                self._now[topic] = ahead
            if header.tick == tick.tick:
                return
            ahead = None

    def _renew_list(self, topic):
        self._ports.renew(topic, _TOPICS[topic], layout.ChangesHeader)
