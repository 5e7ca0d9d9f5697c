"""The client: poses out, the result of exactly that frame in."""

from __future__ import annotations

import ctypes
import difflib
import json
import operator
import secrets
import time
from typing import Any, Iterable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from . import layout
from .errors import Refused, Restarted, Skipped, SweepdError, TimedOut
from .frames import MOVING, POSE, array, blank, columns_of, rows_of, seconds, seconds_to_send, time_left, whole
from .lists import ContactList, PairList
from .ports import Ports
from .refusals import is_under_way, source_row, why_no_result
from .turns import Turns, in_turn

_LOOK_AGAIN_S = 0.05
_BOOTS_OVER_MAX = 16
# ticks of the boot in force that may still come while a message of the next one is there: what a queue holds, twice
_TICKS_LEFT_MAX = 16
# ticks that one look takes at most: more than wait in its queues
_DRAINED_MAX = 32
# ticks without all that is listened to that are passed over at first, and how far apart they are at least: more than wait where a
# boot went unseen, and a second. A message that cannot be handed over is no reason to be silent for ever
_PASSED_MAX = 32
_PASSED_NS = 1_000_000_000 // _PASSED_MAX
_NAMES_TOLD = 5
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
# what `step` takes beside poses and time
_FRAME_FIELDS = ("stamp_ns", "clock_id", "scene_rev", "deadline_ns", "time_left_ns", "partial")
_VERTEX = np.dtype(layout.VertexRow)
#: Poses of bodies as ``Client.send`` describes them: by name, columns, or rows.
Poses = Union[Mapping[str, Sequence[ArrayLike]], Sequence[ArrayLike], np.ndarray]
_POSES = ("transforms", layout.TransformRow)
_MOTION = ("transforms_vel", layout.TransformVelRow)


def _bytes_of(source):
    """Length of what can be a name; 0 where it cannot."""
    try:
        return 0 if "\0" in source else len(source.encode())
    except (AttributeError, TypeError, UnicodeEncodeError):
        return 0


def _topics_of(listen):
    if isinstance(listen, str):
        listen = (listen,)
    try:
        listen = list(listen)
    except TypeError:
        listen = [listen]
    unknown = [topic for topic in listen if not isinstance(topic, str) or topic not in _TOPICS]
    if unknown:
        raise SweepdError(f"listen={unknown}: there are {', '.join(_TOPICS)}")
    return listen


class Result:
    """A tick and what belongs to it.

    ``tick`` is a structure (see ``msgs/README.md``); ``pairs``, ``contacts``, ``regions`` and ``bodies`` are numpy
    structured arrays over shared memory, None where the client did not listen or a newer one overtook it. Keep as many
    results as you like: where three arrays of a kind are still there, the next one is a copy. ``changes`` are the rows that
    changed since the tick before, under ``changes_header`` whose ``base_tick`` is 0 the whole list; None also where the
    list is not whole (yet, or again). ``contact_changes`` and ``contact_changes_header`` are the same of contacts. Copies
    (``copy.deepcopy``) and pickles are whole.
    """

    def __init__(self, tick: layout.TickRow, messages: dict[str, Any], lists: dict[str, Any], turns: Turns) -> None:
        self.tick = tick
        self._lists, self._turns = lists, turns
        self.changes_header: Optional[layout.ChangesHeader]
        self.changes: Optional[np.ndarray]
        self.changes_header, self.changes = messages.pop("changes", (None, None))
        self.contact_changes_header: Optional[layout.ChangesHeader]
        self.contact_changes: Optional[np.ndarray]
        self.contact_changes_header, self.contact_changes = messages.pop("contact_changes", (None, None))
        self.pairs: Optional[np.ndarray] = messages.get("pairs")
        self.contacts: Optional[np.ndarray] = messages.get("contacts")
        self.regions: Optional[np.ndarray] = messages.get("regions")
        self.bodies: Optional[np.ndarray] = messages.get("bodies")
        self.body_verdicts: Optional[np.ndarray] = messages.get("body_verdicts")

    @property
    def state(self) -> str:
        """The tick in one word: clear, near, possible, unknown or colliding."""
        return layout.State(self.tick.header.state).name.lower()

    @property
    @in_turn
    def listed(self) -> Optional[np.ndarray]:
        """What ``pairs`` would hold, kept from ``changes``: an array of its own; None where ``changes`` is.

        Made when it is asked for, which is to be before the client goes on to the next tick.
        """
        return None if self.changes is None else self._rows("changes", "listed")

    @property
    @in_turn
    def listed_contacts(self) -> Optional[np.ndarray]:
        """What ``contacts`` would hold, kept from ``contact_changes``; as ``listed``."""
        return None if self.contact_changes is None else self._rows("contact_changes", "listed_contacts")

    def _rows(self, topic, name):
        if not self._lists[topic].is_of(self.tick.header):
            raise SweepdError(f"the client has gone on to another tick: ask a result for `{name}` before the next step")
        return self._lists[topic].rows()

    @property
    def colliding(self) -> np.ndarray:
        """``(n, 2)`` ids of the pairs certified colliding at the poses of this tick, by id."""
        rows = self.listed if self.pairs is None else self.pairs
        if rows is None:
            raise SweepdError("this client does not listen to pairs or changes, or has not all of them yet")
        gone = rows["flags"] & int(layout.PairFlags.GONE) != 0
        rows = rows[(rows["verdict"] == layout.Verdict.COLLIDING) & ~gone]
        return np.stack([rows["body_a"], rows["body_b"]], axis=1)


class Client:
    """A client of one instance: a source of frames, or with ``source=None`` a reader.

    For one thread at a time: what another one asks in the midst of a call is refused, but for ``names`` and ``plan``. It
    waits without Python's lock, so other threads go on. In a forked process it is the parent's: make another one there.

    * ``quat_order``: how you write quaternions, ``"xyzw"`` (ROS) or ``"wxyz"`` (MuJoCo). A source must say it.
    * ``listen``: the messages to listen to, or one, of ``pairs``, ``changes``, ``contacts``, ``contact_changes``,
      ``regions``, ``bodies``, ``body_verdicts``, ``plan``; the daemon computes what somebody listens to. ``names`` are always.
    * ``timeout_s``: how long to look for a daemon.
    * ``root``, ``prefix``: other files than iceoryx2's default ones; the daemon's must be the same.
    """

    def __init__(
        self,
        instance: str = "default",
        source: Optional[str] = "sim",
        *,
        quat_order: Optional[str] = None,
        timeout_s: float = 5.0,
        listen: Union[str, Iterable[str]] = ("pairs", "contacts"),
        root: Optional[str] = None,
        prefix: Optional[str] = None,
    ) -> None:
        if quat_order not in ("xyzw", "wxyz") and not (quat_order is None and source is None):
            raise SweepdError(
                f'quat_order={quat_order!r}: say "xyzw" or "wxyz", as you write quaternions; a reader, which sends none,'
                " says source=None instead"
            )
        self._turns = Turns()
        self._quat_order = quat_order
        self._source = source
        if source is not None and not 1 <= _bytes_of(source) < layout.SOURCE_NAME_LEN:
            raise SweepdError(
                f"source name {source!r}: a text of 1 to {layout.SOURCE_NAME_LEN - 1} bytes of UTF-8, without NUL"
            )
        listen = _topics_of(listen)
        timeout_s = seconds(timeout_s)
        until = time.monotonic() + timeout_s
        self._ports = Ports(instance, timeout_s, root, prefix)
        self._topics = list(dict.fromkeys([*listen, "names"]))
        try:
            for topic in self._topics:
                self._ports.subscribe(topic, _TOPICS[topic], _HEADERS.get(topic, layout.MessageHeader), until)
        except SweepdError:
            # who keeps the error keeps this object, which would keep the places of its ports
            self._ports.close()
            raise
        self._ahead = {topic: None for topic in self._topics}
        self._waited = {topic: 0 for topic in self._topics}
        self._now = {topic: None for topic in self._topics}
        self._lists = {topic: _LISTS[topic]() for topic in self._topics if topic in _LISTS}
        #: This client's session, drawn at its start.
        self.session: int = secrets.randbits(64) or 1
        self._epoch = 0
        self._seq = 0
        self._versions: dict[int, int] = {}
        # messages of vertices of this session
        self._bent = 0
        self._requests = 0
        self._tick = None
        self._held = None
        # of the daemon whose ids the names are
        self._boot = self._ports.hello.boot_id
        self._boots_over: list[int] = []
        # ticks that may yet be passed over until one has all that is listened to, 0: one had; and when the last was sent
        self._to_pass, self._passed_ns = _PASSED_MAX, 0
        self._names: tuple[Any, dict[str, int]] = (None, {})
        self._named: tuple[Any, dict[int, str]] = (None, {})
        self._wait_names(timeout_s)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_exception: Any) -> None:
        self.close()

    @in_turn
    def close(self) -> None:
        """Frees the ports; the session is over."""
        self._ahead, self._now, self._held = {}, {}, None
        self._ports.close()

    @property
    def hello(self) -> layout.Hello:
        """What the daemon said of itself at the connection."""
        return self._ports.hello

    @property
    def names(self) -> dict[str, int]:
        """Name to id of every body in the scene, as of the newest tick heard. Ids are those of one start of the daemon."""
        self._ports.check_open("names cannot be told")
        message = self._lasting("names")
        if message is None:
            return {}
        header, rows = message
        key = (header.boot_id, header.tick)
        if self._names[0] != key:
            ids = {bytes(row["name"])[: row["len"]].decode(): int(row["body"]) for row in rows}
            self._names = (key, ids)
        return self._names[1]

    @property
    def plan(self) -> Optional[dict[str, Any]]:
        """What the daemon chose for the scene, left out, and why: a dict; None where the client does not listen to ``plan``."""
        self._ports.check_open("the plan cannot be told")
        message = self._lasting("plan")
        return None if message is None else json.loads(message[1].tobytes())

    def _lasting(self, topic):
        message = self._now.get(topic)
        return None if message is None or message[0].boot_id != self._boot else message

    def name_of(self, body: int) -> Optional[str]:
        """The name of a body by its id, as rows have it; None where the scene has none (any more)."""
        names = self.names
        if self._named[0] != self._names[0]:
            self._named = (self._names[0], {id_: name for name, id_ in names.items()})
        try:
            return self._named[1].get(operator.index(body))
        except TypeError:
            raise SweepdError(f"body {body!r}: give an id, as rows have it") from None

    @in_turn
    def send(
        self,
        poses: Poses,
        *,
        stamp_ns: int = 0,
        clock_id: int = 0,
        scene_rev: int = 0,
        deadline_ns: int = 0,
        time_left_ns: int = 0,
        partial: bool = False,
    ) -> int:
        """Sends a frame and does not wait. Returns its number.

        * ``poses``: ``{name: (position, quaternion)}``, or ``(ids, positions, quaternions)`` as arrays of shape
          ``(n,)``, ``(n, 3)``, ``(n, 4)``; metres, quaternions in the order you said. With velocities, of all bodies or
          of none: ``{name: (position, quaternion, linear, angular)}``, or two more arrays of shape ``(n, 3)``; metres
          and radians a second, in the scene's frame. An array made by ``rows()`` or ``loan()`` is copied once, as it
          is.
        * ``partial``: these are some bodies of the source only.
        * ``time_left_ns``: of the tick, from receipt; 0 says nothing, and less than 0, too late already, leaves it nothing.

        Raises Restarted where another daemon is there than that of the ids, TimedOut where it has not said its own yet;
        rows made before that are refused.
        """
        self._settle(0.0)
        flags = layout.FrameFlags.PARTIAL if partial else layout.FrameFlags.FULL
        fields = dict(
            stamp_ns=whole("stamp_ns", stamp_ns),
            clock_id=whole("clock_id", clock_id, 32),
            scene_rev=whole("scene_rev", scene_rev),
            deadline_ns=whole("deadline_ns", deadline_ns),
            time_left_ns=time_left(time_left_ns),
        )
        rows = self.rows(poses)
        if getattr(rows, "boot_id", 0) not in (0, self._boot):
            raise SweepdError(
                "these rows were made before the daemon restarted, and their ids may be other bodies' now: make them"
                " anew with rows() or loan()"
            )
        return self._send(rows, flags, fields)

    @in_turn
    def pause(self) -> int:
        """Says that the world stands still: the ages of its bodies are renewed for one time-out."""
        return self._send(np.empty(0, POSE), layout.FrameFlags.PAUSED, {})

    @in_turn
    def reset_epoch(self) -> None:
        """Says that the world was reset: with the next frame every pair of the source's bodies ends."""
        self._epoch += 1
        # what the daemon had of vertices is void with it
        self._versions = {}

    @in_turn
    def send_vertices(
        self,
        body: Union[str, int],
        vertices: ArrayLike,
        *,
        first: Optional[int] = None,
        total: Optional[int] = None,
    ) -> int:
        """Sends vertices of a body that deforms; they belong with the frame that is sent next. Returns their version.

        * ``body``: name or id.
        * ``vertices``: ``(n, 3)`` positions in the body's frame, metres; they go out as float32.
        * ``first``, ``total``: these are ``n`` of ``total`` vertices, from place ``first`` on, and take the place of
          those sent before; without them these are all.

        Where the daemon has missed or refused vertices of the body, it needs all of them again: the body's pairs are
        possible and ``bodies`` say why.
        """
        if (first is None) != (total is None):
            raise SweepdError("a range of vertices needs first and total")
        given: np.ndarray = array("vertices", vertices)
        if given.ndim != 2 or given.shape[1] != 3 or given.dtype.kind not in "fiu":
            raise SweepdError(
                f"vertices of shape {given.shape} and dtype {given.dtype}: give real numbers of shape (n, 3)"
            )
        with np.errstate(all="ignore"):
            # what is beyond float32 is infinite, which the daemon refuses and counts
            moved = np.ascontiguousarray(given, dtype=np.float32)
        self._settle(0.0)
        id_: int = self._ids([body])[0] if isinstance(body, str) else whole("body", body)
        base = self._versions.get(id_)
        if first is not None and base is None:
            raise SweepdError("a range of vertices changes those sent before: send all of them first")
        base = base or 0
        flags = layout.VertexFlags.FULL if first is None else layout.VertexFlags.RANGE
        header = layout.VertexHeader(
            session=self.session,
            epoch=self._epoch,
            seq=self._seq + 1,
            sent_ns=time.clock_gettime_ns(time.CLOCK_BOOTTIME),
            body=id_,
            version=base + 1,
            base_version=base,
            number=self._bent + 1,
            first=whole("first", first or 0, 32),
            count=len(moved),
            total=len(moved) if total is None else whole("total", total, 32),
            flags=flags,
            schema=layout.WIRE_VERSION,
        )
        self._name(header)
        rows = moved.view(_VERTEX).reshape(len(moved))
        self._ports.send("vertices", layout.VertexRow, header, rows, wake=False)
        self._versions[id_] = base + 1
        self._bent += 1
        return base + 1

    @in_turn
    def step(self, poses: Poses, timeout_s: float = 1.0, **fields: Any) -> Result:
        """Sends a frame and returns the :class:`Result` of exactly that frame; ``fields`` are those of ``send``.

        Raises TimedOut (with what was refused meanwhile), Restarted or Skipped.
        """
        if unknown := [name for name in fields if name not in _FRAME_FIELDS]:
            raise SweepdError(f"step({unknown[0]}=...): a frame has {', '.join(_FRAME_FIELDS)}")
        timeout_s = seconds_to_send(timeout_s)
        until = time.monotonic() + timeout_s
        self._drain()
        self._settle(until)
        before = self._tick
        seq = self.send(poses, **fields)
        while True:
            if not self._next(until):
                raise TimedOut(self._why_no_result(seq, before, timeout_s, fields.get("scene_rev", 0)))
            row = self._row(self._tick)
            if row is None or row.session != self.session:
                continue
            if (row.epoch, row.seq) >= (self._epoch, seq):
                if row.seq == seq:
                    self._begin()
                    return self._result()
                raise Skipped(seq)

    @in_turn
    def latest(self) -> Optional[Result]:
        """The newest :class:`Result` there is, without waiting; None until a tick had all that the client listens to."""
        self._drain()
        return self._result() if self._tick is not None and self._begin() else None

    @in_turn
    def wait(self, timeout_s: float = 1.0) -> Result:
        """The :class:`Result` of the next tick; raises TimedOut or Restarted.

        The first, and the first after Restarted, is of a tick that has all that the client listens to: those made before
        the daemon knew of the client are passed over, and so is what is told of one that is still under way.
        """
        timeout_s = seconds(timeout_s)
        until = time.monotonic() + timeout_s
        came = False
        while self._next(until):
            if self._begin():
                return self._result()
            came = True
        if not came:
            raise TimedOut(f"no tick within {timeout_s} s; {self._ports.silence()}")
        why = "one is still under way" if is_under_way(self._tick) else "they were made before the daemon knew of this client"
        raise TimedOut(f"no tick within {timeout_s} s had all that this client listens to: {why}; wait again, or for longer")

    @in_turn
    def request(self, edits: Any, blobs: Iterable[Any] = (), timeout_s: float = 5.0) -> dict[str, Any]:
        """Sends a scene edit or a query (anything ``json`` can write) and returns the daemon's answer as a dict.

        Raises Refused with the daemon's words when it refused, TimedOut when it is silent. After an edit ``names`` are
        those of the scene as it is then: as ``latest()`` does, the client goes on to the newest tick.
        """
        timeout_s = seconds_to_send(timeout_s)
        try:
            # what Python writes for NaN and infinity is no JSON
            text = json.dumps(edits, allow_nan=False).encode()
            payload = b"".join([text, *(bytes(memoryview(blob)) for blob in blobs)])
        except (TypeError, ValueError, RecursionError) as e:
            raise SweepdError(f"the request is no JSON with blobs of bytes after it: {e}") from e
        self._requests += 1
        header = layout.RequestHeader(
            json_len=len(text), request=self._requests, schema=layout.WIRE_VERSION
        )
        self._ports.request(header, payload)
        until = time.monotonic() + timeout_s
        while True:
            answered = self._ports.answer()
            if answered is not None and answered[0].request == header.request:
                answer = json.loads(answered[1])
                if not answered[0].ok:
                    raise Refused(answer.get("error", "refused"))
                # an edit is answered after its tick, with which new names came
                if isinstance(edits, dict) and "edits" in edits:
                    self._drain()
                return answer
            left = until - time.monotonic()
            if left <= 0:
                raise TimedOut(
                    f"no answer within {timeout_s} s: a large request may take longer, give it more by timeout_s;"
                    f" {self._ports.silence()}"
                )
            self._ports.wait(min(left, _LOOK_AGAIN_S))

    @in_turn
    def rows(self, poses: Poses) -> np.ndarray:
        """Poses as an array of TransformRow, to be filled once and changed in place for later frames.

        With velocities (see ``send``) of TransformVelRow, whose field ``transform`` is the pose.
        """
        if isinstance(poses, np.ndarray) and poses.dtype in (POSE, MOVING):
            if poses.ndim != 1:
                raise SweepdError(f"rows of shape {poses.shape}: give (n,)")
            return poses
        if self._quat_order is None:
            raise SweepdError('a reader that makes rows says how it writes quaternions: quat_order="xyzw" or "wxyz"')
        wxyz = self._quat_order == "wxyz"
        if isinstance(poses, dict):
            rows = rows_of(self._ids(poses), columns_of(poses), wxyz, poses)
        else:
            try:
                ids, *columns = poses
            except (TypeError, ValueError):
                raise SweepdError(
                    f"poses of type {type(poses).__name__}: give {{name: (position, quaternion)}},"
                    " (ids, positions, quaternions) or rows"
                ) from None
            rows = rows_of(ids, columns, wxyz)
        rows.boot_id = self._boot
        return rows

    def loan(self, count: int, *, velocities: bool = False) -> np.ndarray:
        """An array of ``count`` rows to be filled: ``body``, ``position`` and ``orientation`` of each.

        TransformRow, or with ``velocities`` TransformVelRow, whose velocities are 0 at first. ``orientation`` is
        x, y, z, w, whatever order was said. A row that is not filled is no pose, and refused by the daemon.

        The rows are yours: each ``send`` or ``step`` copies them as they are then, and they may be changed and sent
        again. A view of a field is one of this array alone; rows of another call have their own memory.
        """
        self._ports.check_open("rows cannot be made")
        rows = blank(count, velocities)
        rows.boot_id = self._boot
        return rows

    def _ids(self, poses):
        names = self.names
        try:
            return [names[name] for name in poses]
        except KeyError:
            # somebody may have put it since this client last looked
            self._drain()
        names = self.names
        try:
            return [names[name] for name in poses]
        except KeyError as e:
            name = e.args[0]
            if not names:
                raise TimedOut("the daemon has not said the names of its bodies yet: send again in a moment") from None
            near = difflib.get_close_matches(str(name), names, _NAMES_TOLD) or sorted(names)[:_NAMES_TOLD]
            told = ", ".join(near) or "none"
            more = f" and {len(names) - len(near)} more" if len(near) < len(names) else ""
            raise SweepdError(f"the scene has no body {name!r}; it has {told}{more}") from None

    def _send(self, rows, flags, fields):
        header = layout.FrameHeader(
            session=self.session,
            epoch=self._epoch,
            seq=self._seq + 1,
            sent_ns=time.clock_gettime_ns(time.CLOCK_BOOTTIME),
            flags=flags,
            schema=layout.WIRE_VERSION,
            **fields,
        )
        self._name(header)
        topic, row = _MOTION if rows.dtype == MOVING else _POSES
        self._ports.send(topic, row, header, rows)
        self._seq += 1
        return self._seq

    def _settle(self, until):
        """Sees to it that ids are those of the daemon that is there: raises Restarted, or TimedOut where it is silent."""
        while self._ports.boot() not in (self._boot, *self._boots_over):
            if not self._next(until):
                raise TimedOut(
                    "a daemon has just started, and has not said the ids of its bodies yet: step, or send again in a"
                    " moment"
                )

    def _name(self, header):
        if self._source is None:
            raise SweepdError("this client was opened as a reader; name a source to send frames")
        name = self._source.encode()
        header.source[: len(name)] = name
        header.boot = self._boot & 0xFFFFFFFF

    def _row(self, tick):
        return source_row(tick, self._source)

    def _wait_names(self, timeout_s):
        """Names come with the newest state, a moment after the connection."""
        until = time.monotonic() + timeout_s
        while self._now["names"] is None and self._next(until):
            pass

    def _drain(self):
        """Takes what is there, up to the newest tick; raises Restarted."""
        # where a tick takes longer to read than the next one takes to come, there is always one
        for _ in range(_DRAINED_MAX):
            if not self._take():
                return

    def _next(self, until):
        """The next newer tick and all that belongs to it; False when the time is up."""
        while not self._take():
            left = until - time.monotonic()
            if left <= 0:
                return False
            self._ports.wait(min(left, _LOOK_AGAIN_S))
        return True

    def _take(self):
        while True:
            tick, self._held = self._held or self._ports.tick(), None
            if tick is None:
                return False
            new = tick.header
            # queues of an old and a new daemon are read in no certain order
            if new.boot_id in self._boots_over:
                continue
            old = self._tick and self._tick.header
            if old and old.boot_id != new.boot_id:
                # there is one daemon at a time: what is left of one that came and went unseen is older
                if tick.sent_ns < self._tick.sent_ns:
                    self._note_over(new.boot_id)
                    continue
                self._restart(old, tick)
            # a tick that takes longer than a heartbeat is told of under its own number before it is there itself
            if old and (new.tick, tick.sent_ns) <= (old.tick, self._tick.sent_ns):
                continue
            self._tick, self._boot = tick, new.boot_id
            for topic in self._topics:
                if topic in self._lists:
                    self._advance_list(topic, new)
                else:
                    self._advance(topic, new)
            return True

    def _begin(self):
        """Looks at the newest tick until one has all that is listened to; whether it, or one before it, had."""
        if self._to_pass:
            messages = self._messages()
            if all(self._lasting(topic) if topic in _LASTING else topic in messages for topic in self._topics):
                self._to_pass = 0
            elif self._tick.sent_ns >= self._passed_ns + _PASSED_NS and not is_under_way(self._tick):
                # one that is under way has nothing yet, however often it is told of
                self._to_pass, self._passed_ns = self._to_pass - 1, self._tick.sent_ns
        return not self._to_pass

    def _restart(self, old, tick):
        self._note_over(old.boot_id)
        ends = np.empty((0, 2), np.uint64)
        pairs, rows = self._now.get("pairs"), None
        if pairs is not None and pairs[0].boot_id == old.boot_id:
            rows = pairs[1]
        elif "changes" in self._lists and self._lists["changes"].boot_id == old.boot_id:
            rows = self._lists["changes"].rows()
        if rows is not None:
            there = rows["flags"] & int(layout.PairFlags.GONE) == 0
            rows = rows[there & (rows["certified_verdict"] == layout.Verdict.COLLIDING)]
            ends = np.stack([rows["body_a"], rows["body_b"]], axis=1)
        self._tick, self._held, self._boot = None, tick, tick.header.boot_id
        # the new one has no vertices, and may not know of this client yet
        self._versions, self._to_pass = {}, _PASSED_MAX
        # so that names are new from here on
        self._advance("names", tick.header)
        raise Restarted(old.boot_id, tick.header.boot_id, ends)

    def _note_over(self, boot_id):
        self._boots_over = [*self._boots_over[1 - _BOOTS_OVER_MAX :], boot_id]

    def _is_in_vain(self, topic, boot_id):
        """Whether a message of another boot than the tick's waits for a tick that no longer comes: that boot went unseen."""
        self._waited[topic] += 1
        in_vain = self._waited[topic] > _TICKS_LEFT_MAX
        if in_vain:
            self._waited[topic] = 0
            self._note_over(boot_id)
        return in_vain

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
            elif header.boot_id == tick.boot_id or not self._is_in_vain(topic, header.boot_id):
                return
            ahead = None

    def _advance_list(self, topic, tick):
        """As ``_advance``, but every message is applied; one that is not for the list has the whole list asked for."""
        listing = self._lists[topic]
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
                if header.boot_id == tick.boot_id or not self._is_in_vain(topic, header.boot_id):
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

    def _result(self):
        return Result(self._tick, self._messages(), self._lists, self._turns)

    def _messages(self):
        """What belongs to the newest tick, by topic."""
        tick = self._tick.header
        messages = {}
        for topic, now in self._now.items():
            if now is None:
                continue
            if topic in self._lists:
                if self._lists[topic].is_of(tick):
                    messages[topic] = now
            elif (now[0].boot_id, now[0].tick) == (tick.boot_id, tick.tick):
                messages[topic] = now[1]
        return messages

    def _why_no_result(self, seq, before, timeout_s, scene_rev=0):
        told = f"no result of frame {seq} of `{self._source}` within {timeout_s} s"
        tick = self._tick
        if tick is None or (before is not None and tick.header.tick == before.header.tick):
            return f"{told}: no tick came at all; {self._ports.silence()}"
        return told + why_no_result(tick, before, self._source, scene_rev)
