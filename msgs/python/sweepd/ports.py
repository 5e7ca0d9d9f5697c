"""Shared memory: the iceoryx2 ports of one client, as numpy arrays without copies.

An array over a received message keeps its sample alive, and with it the place in shared memory. A reader may hold four
messages of a kind: while three are held, the next one is copied.
"""

import ctypes
import functools
import json
import os
import time
import weakref

import iceoryx2 as iox2
import numpy as np

from . import files, layout
from .errors import Refused, SweepdError, TimedOut
from .refusals import text

#: Event ids of ``wake`` and ``ready``.
SENT, ASKED = 1, 2
_RETRY_S = 0.05
# One less than a reader may hold, for the one that is copied.
_HELD_MAX = 3
_SLICE_LEN_START = 256
_REQUEST_LEN_START = 1 << 14
_ROWS_MAX = 1 << 26
_UNANSWERED = (
    "no daemon has this request any more: the one that it went to has ended, or none was there. Whether it was done is not"
    " known (`sweepd list` says which daemons run)"
)
_FOREIGN = tuple(kind for kind in vars(iox2).values() if isinstance(kind, type) and issubclass(kind, Exception))

# What has ports or samples of iceoryx2.
_LIVING: "weakref.WeakSet[object]" = weakref.WeakSet()
_keep = ctypes.pythonapi.Py_IncRef
_keep.argtypes, _keep.restype = (ctypes.py_object,), None


def _leave_to_parent():
    """In a forked child: ports and samples are the parent's, and never given back here, not at the child's end either.

    iceoryx2 would remove the parent's files, and hand its samples back a second time.
    """
    for one in list(_LIVING):
        for value in vars(one).values():
            _keep(value)
        one.forked = True


os.register_at_fork(after_in_child=_leave_to_parent)


def dtype(row):
    """The numpy structured type of a row."""
    return np.dtype(row)


class _Held:
    """Memory of a sample for numpy; the arrays made from it keep the sample."""

    def __init__(self, sample, address, count, kind):
        self._sample = sample
        self.__array_interface__ = {
            "version": 3,
            "data": (address, True),
            "shape": (count * kind.itemsize,),
            "typestr": "|u1",
        }
        _LIVING.add(self)


def _view(sample, kind, held):
    """Rows over a sample, or a copy where too many others are held, or none may be (``held`` is None)."""
    # the header's count: a slice's own length counted bytes in iceoryx2 0.10.0 (issue 1533)
    count = sample.header.number_of_elements
    if count == 0:
        return np.empty(0, kind)
    if count > _ROWS_MAX:
        raise SweepdError(f"a message says that it has {count} rows")
    one = _Held(sample, sample.payload_ptr, count, kind)
    rows = np.asarray(one).view(kind)
    if held is None or len(held) >= _HELD_MAX:
        rows = rows.copy()
        rows.flags.writeable = False
    else:
        held.add(one)
    return rows


def _fill(address, rows):
    """Copies rows into shared memory; one copy, the only one on this side."""
    # as bytes: field by field, as numpy assigns rows, takes three times as long
    rows = np.ascontiguousarray(rows)
    ctypes.memmove(address, rows.ctypes.data, rows.nbytes)


def _ours(what):
    """What iceoryx2 raises within a method, one type for each port, as an error of this package."""

    def wrap(method):
        @functools.wraps(method)
        def call(self, *args, **kwargs):
            self.check_open(what)
            try:
                return method(self, *args, **kwargs)
            except _FOREIGN as e:
                # a port that was not needed yet may be of a daemon that has ended meanwhile
                if _is_away(e):
                    raise TimedOut(f"{what}: {self._nobody(e)}") from e
                raise SweepdError(f"{what}: {_why(e)}") from e

        return call

    return wrap


def _is_away(e):
    """Whether it says that no daemon is there."""
    return str(e) == "DoesNotExist"


def _why(e):
    short = files.short()
    if short is not None:
        return f"{short} ({e})"
    why = str(e)
    if why.startswith("ExceedsMax") and type(e).__name__.endswith(("CreateError", "OpenError")):
        return (
            f"every place is taken ({why}); end a client that is not needed (`sweepd list` counts them, msgs/README.md has"
            " the limits). One that was killed gives its place back within two seconds"
        )
    if why == "ExceedsMaxActiveRequests":
        return f"those asked before are not answered yet ({why}): ask again in a moment"
    return why


def _patiently(act, until):
    """Tries again until it succeeds or the time is up."""
    while True:
        try:
            return act()
        except (FileNotFoundError, *_FOREIGN):
            if time.monotonic() >= until:
                raise
        time.sleep(_RETRY_S)


def check_name(instance):
    """Raises Refused for what cannot be the name of an instance."""
    fits = isinstance(instance, str) and 1 <= len(instance) <= 32
    fits = fits and all(c in "abcdefghijklmnopqrstuvwxyz0123456789_" for c in instance)
    if not fits:
        raise Refused(f"instance name {instance!r}: use 1 to 32 of a-z, 0-9 and _")


def _config(root, prefix):
    # never from a file: a configuration in the current directory would put us on other files than the daemon
    config = iox2.config.default()
    try:
        if root is not None:
            config.global_cfg.root_path = iox2.Path.new(str(root))
        if prefix is not None:
            config.global_cfg.prefix = iox2.FileName.new(str(prefix))
    except _FOREIGN as e:
        raise SweepdError(f"root={str(root)!r}, prefix={str(prefix)!r}: these make no file names ({e})") from e
    return config


def _check_owner(config):
    """True when the root is there; another user's is refused: iceoryx2 would drop our samples in silence."""
    path = config.global_cfg.root_path.to_string()
    try:
        owner = os.stat(path).st_uid
    except FileNotFoundError:
        return False
    except OSError as e:
        raise Refused(f"{path}: {e.strerror}; shared memory belongs to one user, run as that user") from e
    if owner != os.geteuid():
        raise Refused(
            f"{path} belongs to user id {owner}, this process runs as {os.geteuid()}; "
            "run both as one user, or this one in a container"
        )
    return True


class Ports:
    """The ports of one client. They are for one thread at a time, which the client ensures."""

    def __init__(self, instance, timeout_s, root=None, prefix=None):
        check_name(instance)
        files.check()
        files.check_room()
        iox2.set_log_level_from_env_or(iox2.LogLevel.Fatal)
        self._instance = instance
        self._config = _config(root, prefix)
        self._senders = {}
        self._readers = {}
        self._client = self._hello = self._said = None
        self._pending = []
        self._closed = False
        #: Whether this is a forked process, and the ports are those of its parent.
        self.forked = False
        _LIVING.add(self)
        until = time.monotonic() + timeout_s
        try:
            _patiently(self._open, until)
            self.hello = self._greet(until)
        except FileNotFoundError as e:
            self.close()
            raise TimedOut(self._nobody("its files are missing")) from e
        except _FOREIGN as e:
            self.close()
            raise self._unopened(e, f"instance `{instance}` cannot be opened") from e
        except SweepdError:
            self.close()
            raise
        self._boot = self.hello.boot_id

    def check_open(self, what):
        """Raises if the client is closed, or belongs to another process."""
        if self.forked:
            raise SweepdError(f"{what}: this client is that of the process that forked this one; make a client after the fork")
        if self._closed:
            raise SweepdError(f"{what}: this client is closed; make a new one")

    def _nobody(self, why):
        return (
            f"no daemon runs as instance `{self._instance}` ({why}); start one with `{self._run()}`, "
            "`sweepd list` shows who is there"
        )

    def _run(self):
        of_it = "" if self._instance == "default" else f" --instance {self._instance}"
        return f"sweepd run SCENE{of_it}"

    def silence(self):
        """What it means that the daemon is silent, and what to do."""
        short = files.short()
        files_told = "" if short is None else f"messages may not pass, for {short}; else, "
        return (
            f"{files_told}if that lasts, the daemon was killed or is stopped: `sweepd doctor --instance {self._instance}`"
            f" says which, `{self._run()}` starts a new one"
        )

    def _open(self):
        if not _check_owner(self._config):
            self._hello = None
            raise FileNotFoundError
        if self._hello is None:
            self._open_hello()
        try:
            self._tick = self._topic("tick").publish_subscribe(layout.TickRow).open().subscriber_builder().create()
            self._ready = self._topic("ready").event().open().listener_builder().create()
            # last: its coming wakes the daemon, which then sends us the newest hello and tick
            self._wake = self._topic("wake").event().open().notifier_builder().create()
        except _FOREIGN as e:
            # a daemon of another wire version has others than these, and says its own in the one that all have
            hello = self._newest_hello() or self._said
            if hello is not None:
                _check_hello(hello)
            # it says so once; but of one that is away nothing holds
            self._said = None if _is_away(e) else hello
            raise

    def _open_hello(self):
        """Stays open from try to try: nothing of ours wakes a daemon of another version, which says hello by its own clock."""
        self._node = (
            iox2.NodeBuilder.new()
            .config(self._config)
            # signals belong to the host program
            .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            .create(iox2.ServiceType.Ipc)
        )
        service = self._service(f"{self._instance}/hello").publish_subscribe(layout.Hello).open()
        self._hello = service.subscriber_builder().create()

    def _service(self, name):
        return self._node.service_builder(iox2.ServiceName.new(name))

    def _topic(self, topic):
        return self._service(f"{self._instance}/v{layout.WIRE_VERSION}/{topic}")

    def _greet(self, until):
        while True:
            hello = self._newest_hello() or self._said
            if hello is not None:
                _check_hello(hello)
                return hello
            if time.monotonic() >= until:
                raise TimedOut(
                    f"the services of instance `{self._instance}` are there, but no daemon says hello; {self.silence()}"
                )
            self.wait(0.005)

    def _newest_hello(self):
        newest = None
        while (sample := self._hello.receive()) is not None:
            newest = layout.Hello.from_buffer_copy(sample.payload().contents)
        return newest

    @_ours("`hello` cannot be received")
    def boot(self):
        """Boot id of the newest daemon that has said hello."""
        hello = self._newest_hello()
        if hello is not None:
            self._boot = hello.boot_id
        return self._boot

    def wake(self, event):
        """Wakes the daemon; one that is away finds what was sent when it is back."""
        try:
            self._wake.notify_with_custom_event_id(iox2.EventId.new(event))
        except iox2.NotifierNotifyError:
            pass

    def wait(self, timeout_s):
        """Sleeps until the daemon has sent something, a signal has come, or the time is up."""
        try:
            # iceoryx2 0.10 hands the system whole microseconds, rounded down, and 0 is for ever; in this order NaN is less
            self._ready.timed_wait(iox2.Duration.from_secs_f64(max(2e-6, timeout_s)))
        except iox2.ListenerWaitError as e:
            # Python runs the signal's handler once we are back: for Ctrl-C that raises KeyboardInterrupt
            if str(e) != "InterruptSignal":
                raise SweepdError(f"`ready` cannot be waited for: {e}") from e

    def subscribe(self, topic, row, header=layout.MessageHeader, until=0.0):
        """Listens to a message kind from now on; ``until`` says how long to wait for a place if all are taken."""
        if topic not in self._readers:
            self._read(topic, row, header, lambda: self._messages(topic, row, header), until)

    def renew(self, topic, row, header):
        """Reopens the port of a message kind: what waits in it is lost, and the daemon sees a new reader.

        If no daemon is there, everything stays as it is. Raises Refused if another reader took the place meanwhile; the
        topic is not open then.
        """
        try:
            messages = self._messages(topic, row, header)
        except _FOREIGN as e:
            if _is_away(e):
                return
            raise self._unread(topic, e) from e
        # First the old port, which takes a reader's place. The service is held meanwhile: while a daemon starts anew
        # nobody else may hold it, and who lets it go last takes it along.
        self._readers.pop(topic, None)
        self._read(topic, row, header, lambda: messages)

    def _messages(self, topic, row, header):
        return self._topic(topic).publish_subscribe(iox2.Slice[row]).user_header(header).open()

    def _read(self, topic, row, header, messages, until=0.0):
        try:
            port = _patiently(lambda: messages().subscriber_builder().create(), until)
        except _FOREIGN as e:
            raise self._unread(topic, e) from e
        # where a port may be reopened nothing is held: the daemon reuses what the old one had received
        held = None if header is layout.ChangesHeader else weakref.WeakSet()
        self._readers[topic] = (port, np.dtype(row), header, held)
        self.wake(14)

    def _unread(self, topic, e):
        return self._unopened(e, f"`{topic}` of instance `{self._instance}` cannot be read")

    def _unopened(self, e, what):
        """What of this package stands for what iceoryx2 raised when something was to be opened."""
        return TimedOut(self._nobody(e)) if _is_away(e) else Refused(f"{what}: {_why(e)}")

    def is_open(self, topic):
        """Whether the client listens to the topic."""
        return topic in self._readers

    @_ours("`tick` cannot be received")
    def tick(self):
        """The next tick as a structure of its own, or None."""
        sample = self._tick.receive()
        if sample is None:
            return None
        return layout.TickRow.from_buffer_copy(sample.payload().contents)

    @_ours("a message cannot be received")
    def message(self, topic):
        """The next message of a kind as ``(header, rows)``, or None; the rows are mostly in shared memory."""
        reader, kind, header, held = self._readers[topic]
        sample = reader.receive()
        if sample is None:
            return None
        header = header.from_buffer_copy(sample.user_header().contents)
        return header, _view(sample, kind, held)

    def _sender(self, topic, row, header, count):
        if topic not in self._senders:
            self._senders[topic] = (
                self._messages(topic, row, header)
                .publisher_builder()
                # a sample sent right after a growth is lost if its sender ends before it is mapped
                .initial_max_slice_len(max(count, _SLICE_LEN_START))
                .allocation_strategy(iox2.AllocationStrategy.PowerOfTwo)
                .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
                .create()
            )
        return self._senders[topic]

    @_ours("a frame cannot be sent")
    def send(self, topic, row, header, rows, wake=True):
        """Hands rows over and, if ``wake``, wakes the daemon."""
        sample = self._sender(topic, row, type(header), len(rows)).loan_slice_uninit(len(rows))
        _fill(sample.payload_ptr, rows)
        ctypes.memmove(sample.user_header_ptr, ctypes.byref(header), ctypes.sizeof(header))
        sample.assume_init().send()
        if wake:
            self.wake(SENT)

    @_ours("a request cannot be sent")
    def request(self, header, payload):
        """Sends a request; the answer comes with :meth:`answer`."""
        if self._client is None:
            service = (
                self._topic("requests")
                .request_response(iox2.Slice[ctypes.c_uint8], iox2.Slice[ctypes.c_uint8])
                .request_header(layout.RequestHeader)
                .response_header(layout.AnswerHeader)
                .open()
            )
            self._client = (
                service.client_builder()
                .initial_max_slice_len(max(len(payload), _REQUEST_LEN_START))
                .allocation_strategy(iox2.AllocationStrategy.PowerOfTwo)
                .create()
            )
        self._pending = [one for one in self._pending if one[0].is_connected]
        request = self._client.loan_slice_uninit(len(payload))
        ctypes.memmove(request.user_header_ptr, ctypes.byref(header), ctypes.sizeof(header))
        ctypes.memmove(request.payload_ptr, payload, len(payload))
        self._pending.append((request.assume_init().send(), header.request))
        self.wake(ASKED)

    @_ours("an answer cannot be received")
    def answer(self):
        """The next answer as ``(header, bytes)``, or None. A request that no daemon will answer is refused here."""
        for one in self._pending:
            pending, request = one
            # before it is looked for: no answer is sent after a request was let go of
            is_open = pending.is_connected
            response = pending.receive()
            if response is None and is_open:
                continue
            self._pending.remove(one)
            if response is None:
                header = layout.AnswerHeader(request=request, schema=layout.WIRE_VERSION)
                return header, json.dumps({"error": _UNANSWERED}).encode()
            header = layout.AnswerHeader.from_buffer_copy(response.user_header().contents)
            return header, ctypes.string_at(response.payload_ptr, response.header.number_of_elements)
        return None

    def close(self):
        """Frees the ports: samples and ports first, the node last."""
        self._closed = True
        self._pending, self._senders, self._readers = [], {}, {}
        self._client = self._tick = self._hello = self._ready = self._wake = self._node = None


def _check_hello(hello):
    from . import __version__

    theirs, iceoryx2 = text(hello.sweepd_version), text(hello.iceoryx2_version)
    if bytes(hello.magic) != b"sweepd\0\0" or hello.wire_version != layout.WIRE_VERSION or iceoryx2 != "0.10.0":
        raise Refused(
            f"the daemon is sweepd {theirs} (wire version {hello.wire_version}, iceoryx2 {iceoryx2}), this client "
            f"sweepd {__version__} (wire version {layout.WIRE_VERSION}, iceoryx2 0.10.0); use the same version on "
            "both sides"
        )
