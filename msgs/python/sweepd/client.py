"""The client: poses out, the result of exactly that frame in."""

from __future__ import annotations

import difflib
import json
import operator
import secrets
import time
from collections.abc import Mapping
from typing import Any, Iterable, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from . import layout
from .errors import Refused, Skipped, SweepdError, TimedOut
from .frames import MOVING, POSE, array, blank, columns_of, rows_of, seconds, seconds_to_send, time_left, whole
from .inbox import LOOK_AGAIN_S, Inbox, topics_of
from .ports import Ports
from .refusals import is_under_way, source_row, why_no_result
from .result import Result
from .turns import Turns, in_turn

_NAMES_TOLD = 5
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


class Client:
    """A client of one instance: a source of frames, or with ``source=None`` a reader.

    A client is for one thread at a time: while a call runs, calls from other threads are refused, except for ``names``,
    ``name_of`` and ``plan``. It waits without Python's lock, so other threads go on. After a fork it belongs to the parent: make
    another client in the child.

    * ``quat_order``: how you write quaternions, ``"xyzw"`` (ROS) or ``"wxyz"`` (MuJoCo). A source must say it.
    * ``listen``: which messages, or which one, to listen to, of ``pairs``, ``changes``, ``contacts``,
      ``contact_changes``, ``regions``, ``bodies``, ``body_verdicts``, ``plan``. The daemon computes what somebody
      listens to. Every client listens to ``names``.
    * ``timeout_s``: how long to look for a daemon.
    * ``root``, ``prefix``: files other than iceoryx2's default ones; the daemon must use the same.
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
        topics = topics_of(listen)
        timeout_s = seconds(timeout_s)
        until = time.monotonic() + timeout_s
        self._ports = Ports(instance, timeout_s, root, prefix)
        try:
            self._inbox = Inbox(self._ports, topics, until)
        except SweepdError:
            # who keeps the error keeps this object, which would keep the places of its ports
            self._ports.close()
            raise
        #: This client's session, drawn at its start.
        self.session: int = secrets.randbits(64) or 1
        self._epoch = 0
        self._seq = 0
        # of what a daemon, by its boot, has of the vertices of a body
        self._versions: dict[tuple[int, int], int] = {}
        # messages of vertices of this session
        self._bent = 0
        self._requests = 0
        self._names: tuple[Any, dict[str, int]] = (None, {})
        self._named: tuple[Any, dict[int, str]] = (None, {})
        self._inbox.wait_names(time.monotonic() + timeout_s)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_exception: Any) -> None:
        self.close()

    @in_turn
    def close(self) -> None:
        """Frees the ports; the session is over."""
        self._inbox.clear()
        self._ports.close()

    @property
    def hello(self) -> layout.Hello:
        """What the daemon said of itself at the connection."""
        return self._ports.hello

    @property
    def names(self) -> dict[str, int]:
        """Name to id of every body in the scene, as of the newest tick heard. Ids are those of one start of the daemon."""
        self._ports.check_open("names cannot be told")
        message = self._inbox.lasting("names")
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
        """What the daemon chose for the scene and left out, and why: a dict; None if the client does not listen."""
        self._ports.check_open("the plan cannot be told")
        message = self._inbox.lasting("plan")
        return None if message is None else json.loads(message[1].tobytes())

    def name_of(self, body: int) -> Optional[str]:
        """The name of a body by its id, as rows have it; None if the scene does not have the body (any more)."""
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
        * ``stamp_ns``: your own stamp of the poses, nanoseconds of the clock that you call ``clock_id``; both are echoed.
        * ``scene_rev``: the least revision of the scene that the poses need, 0 any; the frame waits for it, for one time-out.
        * ``partial``: these are only some of the bodies of the source.
        * ``deadline_ns``: when the tick must end, as ``time.monotonic_ns()``; 0 none. It can only shorten the budget.
        * ``time_left_ns``: what the tick has left from receipt; 0 says nothing. Below 0 it is already too late, and the
          tick has nothing left.

        Raises Restarted if the daemon is not the one that the ids are of, and TimedOut if a new daemon has not said its
        ids yet; rows made before a restart are refused.
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
        if getattr(rows, "boot_id", 0) not in (0, self._inbox.boot):
            raise SweepdError(
                "these rows were made before the daemon restarted, and their ids may be other bodies' now: make them"
                " anew with rows() or loan()"
            )
        return self._send(rows, flags, fields)

    @in_turn
    def pause(self) -> int:
        """Says that the world stands still: the ages of its bodies are renewed for one time-out.

        Raises Restarted or TimedOut as ``send`` does.
        """
        self._settle(0.0)
        return self._send(np.empty(0, POSE), layout.FrameFlags.PAUSED, {})

    @in_turn
    def reset_epoch(self) -> None:
        """Says that the world was reset: every pair of the source's bodies ends with the next frame."""
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
        """Sends vertices of a deforming body; they belong to the frame that is sent next. Returns their version.

        * ``body``: name or id.
        * ``vertices``: ``(n, 3)`` positions in the body's frame, metres; they go out as float32.
        * ``first``, ``total``: these are ``n`` of ``total`` vertices, from place ``first`` on, and replace those sent
          before. Without ``first`` and ``total`` these are all vertices.

        If the daemon has missed or refused vertices of the body, it needs all of them again: the body's pairs are
        possible and ``bodies`` say why. If this call fails while it sends, that holds for each body whose vertices this
        source sends.
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
        known = (self._inbox.boot, id_)
        base = self._versions.get(known)
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
        # counted first, as in _send
        self._versions[known] = base + 1
        self._bent += 1
        self._ports.send("vertices", layout.VertexRow, header, rows, wake=False)
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
        self._inbox.drain()
        self._settle(until)
        before = self._inbox.tick
        seq = self.send(poses, **fields)
        while True:
            if not self._inbox.next(until):
                raise TimedOut(self._why_no_result(seq, before, timeout_s, fields.get("scene_rev", 0)))
            row = self._row(self._inbox.tick)
            if row is None or row.session != self.session:
                continue
            if (row.epoch, row.seq) >= (self._epoch, seq):
                if row.seq == seq:
                    self._inbox.begin()
                    return self._result()
                raise Skipped(seq)

    @in_turn
    def latest(self) -> Optional[Result]:
        """The newest :class:`Result`, without waiting; None until a tick has had all that the client listens to.

        If no more ticks come, it is the last one, again and again: ``age_s`` says so.
        """
        self._inbox.drain()
        return self._result() if self._inbox.tick is not None and self._inbox.begin() else None

    @in_turn
    def wait(self, timeout_s: float = 1.0) -> Result:
        """The :class:`Result` of the next tick; raises TimedOut or Restarted.

        The first one, and the first after Restarted, is of a tick that has all that the client listens to. Ticks made
        before the daemon knew of the client are passed over, and so are reports of a tick that is still under way.
        """
        timeout_s = seconds(timeout_s)
        until = time.monotonic() + timeout_s
        came = False
        while self._inbox.next(until):
            if self._inbox.begin():
                return self._result()
            came = True
        if not came:
            raise TimedOut(f"no tick within {timeout_s} s; {self._ports.silence()}")
        why = "one is still under way" if is_under_way(self._inbox.tick) else "they were made before the daemon knew of this client"
        raise TimedOut(f"no tick within {timeout_s} s had all that this client listens to: {why}; wait again, or for longer")

    @in_turn
    def request(self, edits: Any, blobs: Iterable[Any] = (), timeout_s: float = 5.0) -> dict[str, Any]:
        """Sends a scene edit or a query (anything ``json`` can write) and returns the daemon's answer as a dict.

        Raises Refused with the daemon's words when it refused, TimedOut when it is silent. After an edit ``names`` are
        those of the scene as it is then: as ``latest()`` does, the client goes on to the newest tick. Where the daemon has
        restarted meanwhile they are so from ``Restarted`` on, which the next call that waits, looks or sends raises.
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
                    # of a restart the next call tells: the answer would be lost with it
                    self._inbox.drain(tells_restart=False)
                return answer
            left = until - time.monotonic()
            if left <= 0:
                raise TimedOut(
                    f"no answer within {timeout_s} s: a large request may take longer, give it more by timeout_s;"
                    f" {self._ports.silence()}"
                )
            self._ports.wait(min(left, LOOK_AGAIN_S))

    @in_turn
    def rows(self, poses: Poses) -> np.ndarray:
        """Poses as an array of TransformRow, to be filled once and changed in place for later frames.

        With velocities (see ``send``) it is an array of TransformVelRow, whose field ``transform`` is the pose.
        """
        if isinstance(poses, np.ndarray) and poses.dtype in (POSE, MOVING):
            if poses.ndim != 1:
                raise SweepdError(f"rows of shape {poses.shape}: give (n,)")
            return poses
        if self._quat_order is None:
            raise SweepdError('a reader that makes rows says how it writes quaternions: quat_order="xyzw" or "wxyz"')
        wxyz = self._quat_order == "wxyz"
        if isinstance(poses, Mapping):
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
        rows.boot_id = self._inbox.boot
        return rows

    def loan(self, count: int, *, velocities: bool = False) -> np.ndarray:
        """An array of ``count`` rows for you to fill: ``body``, ``position`` and ``orientation`` of each.

        The rows are TransformRow, or with ``velocities`` TransformVelRow, whose velocities are 0 at first.
        ``orientation`` is x, y, z, w, whatever ``quat_order`` says. A row that is not filled is no pose, and the daemon
        refuses it.

        The rows are yours: each ``send`` or ``step`` copies them as they are then, and you may change and send them
        again. A view of a field belongs to this array alone; rows of another call have their own memory.
        """
        self._ports.check_open("rows cannot be made")
        rows = blank(count, velocities)
        rows.boot_id = self._inbox.boot
        return rows

    def _ids(self, poses):
        names = self.names
        try:
            return [names[name] for name in poses]
        except KeyError:
            # somebody may have put it since this client last looked
            self._inbox.drain()
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
        # counted first: a signal may end this in the midst, and a number that was sent must never be another frame's
        self._seq += 1
        self._ports.send(topic, row, header, rows)
        return self._seq

    def _settle(self, until):
        """Sees to it that ids are those of the daemon that is there: raises Restarted, or TimedOut where it is silent."""
        while not self._inbox.is_settled():
            if not self._inbox.next(until):
                raise TimedOut(
                    "a daemon has just started, and has not said the ids of its bodies yet: step, or send again in a"
                    " moment"
                )

    def _name(self, header):
        if self._source is None:
            raise SweepdError("this client was opened as a reader; name a source to send frames")
        name = self._source.encode()
        header.source[: len(name)] = name
        header.boot = self._inbox.boot & 0xFFFFFFFF

    def _row(self, tick):
        return source_row(tick, self._source)

    def _result(self):
        return Result(self._inbox.tick, self._inbox.messages(), self._inbox.lists, self._turns)

    def _why_no_result(self, seq, before, timeout_s, scene_rev=0):
        told = f"no result of frame {seq} of `{self._source}` within {timeout_s} s"
        tick = self._inbox.tick
        if tick is None or (before is not None and tick.header.tick == before.header.tick):
            return f"{told}: no tick came at all; {self._ports.silence()}"
        return told + why_no_result(tick, before, self._source, scene_rev)
