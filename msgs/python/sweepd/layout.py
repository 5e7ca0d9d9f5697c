"""Wire version 1 of sweepd as ctypes structures: pure standard library, nothing imported but ctypes.

``msgs/README.md`` has the services and what each message means; ``tests/wire_layout.rs`` compares this module with
it, with the C header and with the daemon. SI units, right-handed, z up. Quaternions are x, y, z, w.
"""

import ctypes
from enum import IntEnum, IntFlag

WIRE_VERSION = 1
#: No sub-shape: a contact of a shape that has no triangles.
NO_INDEX = 0xFFFFFFFF
SOURCE_NAME_LEN = 32
BODY_NAME_LEN = 104
REJECTS_LEN = 16
STAGES_LEN = 8
SOURCES_MAX = 16


class _Row(ctypes.Structure):
    """A row or header; iceoryx2 matches it by ``type_name()`` and size."""

    TYPE_NAME = ""

    @classmethod
    def type_name(cls):
        """The name iceoryx2 compares."""
        return cls.TYPE_NAME


class TransformRow(_Row):
    """One body's pose."""

    TYPE_NAME = "sweepd.v1.Transform"
    _fields_ = [
        # Body id.
        ("body", ctypes.c_uint64),
        # Zero.
        ("flags", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
        # Origin of the body's frame in the scene's frame, metres.
        ("position", ctypes.c_double * 3),
        # Orientation x, y, z, w, unit length within 1e-2.
        ("orientation", ctypes.c_double * 4),
    ]


class TransformVelRow(_Row):
    """One body's pose and velocity."""

    TYPE_NAME = "sweepd.v1.TransformVel"
    _fields_ = [
        # Pose, as TransformRow.
        ("transform", TransformRow),
        # Velocity of the body frame's origin in the scene's frame, metres a second.
        ("linear", ctypes.c_double * 3),
        # Angular velocity in the scene's frame, radians a second.
        ("angular", ctypes.c_double * 3),
    ]


class FrameHeader(_Row):
    """User header of transforms and transforms_vel: whose frame, which one, how old, how urgent."""

    TYPE_NAME = "sweepd.v1.FrameHeader"
    _fields_ = [
        # Random number drawn at each client start; never 0.
        ("session", ctypes.c_uint64),
        # Raised by the client when its world resets.
        ("epoch", ctypes.c_uint64),
        # Counts the frames of a session; order within a session is (epoch, seq).
        ("seq", ctypes.c_uint64),
        # When the client sent it, nanoseconds of CLOCK_BOOTTIME; 0: not said, then age counts from receipt.
        ("sent_ns", ctypes.c_uint64),
        # The sender's own stamp of the poses, nanoseconds of the clock clock_id; echoed, never trusted.
        ("stamp_ns", ctypes.c_uint64),
        # Least scene revision these poses need; 0: any.
        ("scene_rev", ctypes.c_uint64),
        # Deadline of the tick on CLOCK_MONOTONIC, nanoseconds; 0: none. Can shorten the budget, never lengthen
        # it.
        ("deadline_ns", ctypes.c_uint64),
        # Time left for the tick from receipt, nanoseconds; 0: not said.
        ("time_left_ns", ctypes.c_uint64),
        # Name of the source, NUL-padded UTF-8.
        ("source", ctypes.c_uint8 * SOURCE_NAME_LEN),
        # frame_flags: full, partial or paused.
        ("flags", ctypes.c_uint32),
        # The sender's number for the clock of stamp_ns; echoed.
        ("clock_id", ctypes.c_uint32),
        # WIRE_VERSION of the sender.
        ("schema", ctypes.c_uint32),
        # Low half of the boot_id whose body ids the rows have; 0: not said. What is of another boot is refused.
        ("boot", ctypes.c_uint32),
    ]


class VertexRow(_Row):
    """One vertex."""

    TYPE_NAME = "sweepd.v1.Vertex"
    _fields_ = [
        # In the body's frame, metres.
        ("position", ctypes.c_float * 3),
    ]


class VertexHeader(_Row):
    """User header of vertices: whose they are, which of them, and which version they make."""

    TYPE_NAME = "sweepd.v1.VertexHeader"
    _fields_ = [
        # Session of the client, the same as in its frames; never 0.
        ("session", ctypes.c_uint64),
        # Epoch of the frame that they belong with.
        ("epoch", ctypes.c_uint64),
        # Number of the frame that they belong with: they are taken with the first that is not older, or, but for
        # those of the source that on_frame names, after a time-out of their source. 0: at once, behind what the
        # session sent before.
        ("seq", ctypes.c_uint64),
        # When the client sent them, nanoseconds of CLOCK_BOOTTIME; 0: not said.
        ("sent_ns", ctypes.c_uint64),
        # Body id.
        ("body", ctypes.c_uint64),
        # Version of the vertices after this message, from 1; raised with each message of a body.
        ("version", ctypes.c_uint64),
        # Of a range: the version that it is applied to. Any other, and it is refused.
        ("base_version", ctypes.c_uint64),
        # Which message of vertices of the session this is, from 1: a gap says that some were lost, and all that the
        # source bent is unknown until all of its vertices come again. 0: not said.
        ("number", ctypes.c_uint64),
        # Name of the source, NUL-padded UTF-8.
        ("source", ctypes.c_uint8 * SOURCE_NAME_LEN),
        # Place of the first row in the mesh's list of vertices; 0 where all are sent.
        ("first", ctypes.c_uint32),
        # How many rows follow.
        ("count", ctypes.c_uint32),
        # How many vertices the mesh has.
        ("total", ctypes.c_uint32),
        # vertex_flags: full or range.
        ("flags", ctypes.c_uint32),
        # WIRE_VERSION of the sender.
        ("schema", ctypes.c_uint32),
        # Low half of the boot_id whose body ids the rows have; 0: not said. What is of another boot is refused.
        ("boot", ctypes.c_uint32),
    ]


class MessageHeader(_Row):
    """User header of every message the daemon publishes."""

    TYPE_NAME = "sweepd.v1.MessageHeader"
    _fields_ = [
        # Random number of this start of the daemon.
        ("boot_id", ctypes.c_uint64),
        # Tick, from 1.
        ("tick", ctypes.c_uint64),
        # Scene revision the tick used.
        ("scene_rev", ctypes.c_uint64),
        # Oldest sender's stamp among the poses used, nanoseconds; of no meaning where sources have clocks of their own.
        ("oldest_stamp_ns", ctypes.c_uint64),
        # Newest sender's stamp among the poses used, nanoseconds; of no meaning where sources have clocks of their own.
        ("newest_stamp_ns", ctypes.c_uint64),
        # Rows that did not fit into this message.
        ("truncated", ctypes.c_uint64),
        # State of the tick.
        ("state", ctypes.c_uint8),
        # Zero.
        ("reserved", ctypes.c_uint8 * 3),
        # WIRE_VERSION.
        ("schema", ctypes.c_uint32),
    ]


class ChangesHeader(_Row):
    """User header of changes and contact_changes: what the rows apply to, and what results from that."""

    TYPE_NAME = "sweepd.v1.ChangesHeader"
    _fields_ = [
        # As in every message.
        ("message", MessageHeader),
        # The tick whose list these rows change; 0: they are the whole list.
        ("base_tick", ctypes.c_uint64),
        # How many rows the list has with them.
        ("listed", ctypes.c_uint64),
    ]


class PairRow(_Row):
    """One pair that is not plainly apart, or one last event of a pair."""

    TYPE_NAME = "sweepd.v1.Pair"
    _fields_ = [
        # Smaller body id.
        ("body_a", ctypes.c_uint64),
        # Larger body id.
        ("body_b", ctypes.c_uint64),
        # Lower end of the proved gap, metres, signed; minus infinity: nothing known.
        ("gap_min_m", ctypes.c_double),
        # Upper end of the proved gap, metres, signed; infinity: nothing known.
        ("gap_max_m", ctypes.c_double),
        # Best estimate of the gap, metres, signed; NaN: none.
        ("gap_best_m", ctypes.c_double),
        # How fast the gap shrinks along the normal, metres a second; negative: it grows; NaN: not known (no velocity
        # was sent, or a body is silent, refused or deforms).
        ("closing_mps", ctypes.c_double),
        # Of a swept pair that touched, or may have, on the way from the last tick's poses (0) to this one's (1): the share
        # before which it did not (steps that jumped, which are not swept, aside); NaN: not swept, or free of touch.
        ("toi_min", ctypes.c_double),
        # The share by which it had touched first (SWEPT_HIT), or 1 (SWEPT_OPEN); NaN as toi_min.
        ("toi_max", ctypes.c_double),
        # Begin: the earliest tick in which it may have happened.
        ("begin_first_tick", ctypes.c_uint64),
        # Begin: the tick in which it was certified.
        ("begin_last_tick", ctypes.c_uint64),
        # End: the earliest tick in which it may have happened.
        ("end_first_tick", ctypes.c_uint64),
        # End: the tick in which it was certified or caused.
        ("end_last_tick", ctypes.c_uint64),
        # Tick of the last certified verdict; 0: never.
        ("certified_tick", ctypes.c_uint64),
        # Ticks since the interval was computed at the poses of its tick.
        ("bound_age_ticks", ctypes.c_uint32),
        # Verdict at this tick's poses.
        ("verdict", ctypes.c_uint8),
        # Last certified Verdict: apart, near or colliding.
        ("certified_verdict", ctypes.c_uint8),
        # Bits of Event, by number.
        ("events", ctypes.c_uint8),
        # EndCause of the end in this row.
        ("end_cause", ctypes.c_uint8),
        # Level reached.
        ("level", ctypes.c_uint8),
        # pair_flags.
        ("flags", ctypes.c_uint8),
        # Zero.
        ("reserved", ctypes.c_uint8 * 6),
    ]


class ContactRow(_Row):
    """One point of contact, or the closest points of a near pair."""

    TYPE_NAME = "sweepd.v1.Contact"
    _fields_ = [
        # Stays while the contact does; 0: the kind `closest`, of which a pair has one at most.
        ("id", ctypes.c_uint64),
        # Smaller body id.
        ("body_a", ctypes.c_uint64),
        # Larger body id.
        ("body_b", ctypes.c_uint64),
        # Point on A's surface, scene frame, metres.
        ("point_a", ctypes.c_double * 3),
        # Point on B's surface, scene frame, metres.
        ("point_b", ctypes.c_double * 3),
        # Point on A's surface, A's body frame, metres.
        ("point_a_body", ctypes.c_double * 3),
        # Point on B's surface, B's body frame, metres.
        ("point_b_body", ctypes.c_double * 3),
        # Unit, scene frame, from A to B.
        ("normal", ctypes.c_double * 3),
        # Gap at this contact, metres; negative: depth.
        ("gap_m", ctypes.c_double),
        # Lower end of the shape pair's proved gap, metres.
        ("gap_min_m", ctypes.c_double),
        # Upper end of the shape pair's proved gap, metres.
        ("gap_max_m", ctypes.c_double),
        # Shape of A, by its place in the body.
        ("shape_a", ctypes.c_uint32),
        # Shape of B, by its place in the body.
        ("shape_b", ctypes.c_uint32),
        # Triangle of A's shape; u32::MAX: none.
        ("triangle_a", ctypes.c_uint32),
        # Triangle of B's shape; u32::MAX: none.
        ("triangle_b", ctypes.c_uint32),
        # contact_flags.
        ("flags", ctypes.c_uint32),
        # ContactKind.
        ("kind", ctypes.c_uint8),
        # Zero.
        ("reserved", ctypes.c_uint8 * 3),
    ]


class RegionRow(_Row):
    """One place where a pair may touch.

    The union of a pair's regions holds every point that the two share; of two convex shapes with `COMPLETE` the points
    of the contacts alone.
    """

    TYPE_NAME = "sweepd.v1.Region"
    _fields_ = [
        # Smaller body id.
        ("body_a", ctypes.c_uint64),
        # Larger body id.
        ("body_b", ctypes.c_uint64),
        # Centre of the sphere, scene frame, metres.
        ("centre", ctypes.c_double * 3),
        # Its radius, metres; infinity: the place of a body is not known.
        ("radius_m", ctypes.c_double),
        # Axis of the cone of normals, from A to B, unit, scene frame.
        ("cone_axis", ctypes.c_double * 3),
        # Half angle of that cone, radians; pi: any direction.
        ("cone_half_angle_rad", ctypes.c_double),
        # Best guess of a point of contact, scene frame, metres.
        ("point", ctypes.c_double * 3),
        # Best guess of the normal there, from A to B, unit, scene frame.
        ("normal", ctypes.c_double * 3),
        # Best guess of the depth there, metres, not below 0.
        ("depth_m", ctypes.c_double),
        # region_flags.
        ("flags", ctypes.c_uint32),
        # Place among the pair's regions, from 0.
        ("index", ctypes.c_uint8),
        # How many regions the pair has.
        ("count", ctypes.c_uint8),
        # Level reached; boxes: no more than the bodies' boxes is behind it.
        ("level", ctypes.c_uint8),
        # Zero.
        ("reserved", ctypes.c_uint8),
    ]


class BodyRow(_Row):
    """One body."""

    TYPE_NAME = "sweepd.v1.Body"
    _fields_ = [
        # Body id.
        ("body", ctypes.c_uint64),
        # Last admitted position of the body's frame, scene frame, metres.
        ("position", ctypes.c_double * 3),
        # Last admitted orientation x, y, z, w.
        ("orientation", ctypes.c_double * 4),
        # The sender's stamp of that pose, nanoseconds.
        ("stamp_ns", ctypes.c_uint64),
        # Receipt of that pose, nanoseconds of CLOCK_BOOTTIME.
        ("received_ns", ctypes.c_uint64),
        # Age at this tick, nanoseconds; u64::MAX: never received.
        ("age_ns", ctypes.c_uint64),
        # Generation: raised when a body of this name is put again.
        ("generation", ctypes.c_uint32),
        # Place of its source in TickRow::sources; u32::MAX: none.
        ("source", ctypes.c_uint32),
        # BodyStatus.
        ("status", ctypes.c_uint8),
        # Worst Verdict over all its pairs.
        ("verdict", ctypes.c_uint8),
        # Last RejectReason, when the status is rejected.
        ("reject", ctypes.c_uint8),
        # Zero.
        ("reserved", ctypes.c_uint8 * 5),
    ]


class NameRow(_Row):
    """A body's name."""

    TYPE_NAME = "sweepd.v1.Name"
    _fields_ = [
        # Body id.
        ("body", ctypes.c_uint64),
        # Place of its source in TickRow::sources; u32::MAX: none.
        ("source", ctypes.c_uint32),
        # Generation of the body.
        ("generation", ctypes.c_uint32),
        # Bytes of the name in use.
        ("len", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
        # UTF-8, NUL-padded.
        ("name", ctypes.c_uint8 * BODY_NAME_LEN),
    ]


class SourceRow(_Row):
    """One source as the tick saw it."""

    TYPE_NAME = "sweepd.v1.Source"
    _fields_ = [
        # Name, NUL-padded UTF-8; empty: no source in this place.
        ("name", ctypes.c_uint8 * SOURCE_NAME_LEN),
        # Session in force; 0: none yet.
        ("session", ctypes.c_uint64),
        # Epoch of its newest frame.
        ("epoch", ctypes.c_uint64),
        # Number of its newest frame.
        ("seq", ctypes.c_uint64),
        # Sender's stamp of its newest frame, nanoseconds.
        ("stamp_ns", ctypes.c_uint64),
        # Age of its newest frame, nanoseconds; u64::MAX: none yet.
        ("age_ns", ctypes.c_uint64),
        # Frames admitted in this boot.
        ("frames", ctypes.c_uint64),
        # Frames passed over because a newer one was there, or lost on their way (gaps in seq).
        ("skipped", ctypes.c_uint64),
        # Frames refused.
        ("refused", ctypes.c_uint64),
        # Sender's number for the clock of stamp_ns.
        ("clock_id", ctypes.c_uint32),
        # 1: alive (a frame within its time-out).
        ("alive", ctypes.c_uint8),
        # 1: its newest frame was paused.
        ("paused", ctypes.c_uint8),
        # Zero.
        ("reserved", ctypes.c_uint8 * 2),
    ]


class TickRow(_Row):
    """The tick: published last, at least each heartbeat, never truncated."""

    TYPE_NAME = "sweepd.v1.Tick"
    _fields_ = [
        # As in every message; truncated here is the sum over all messages.
        ("header", MessageHeader),
        # When the tick ended, nanoseconds of CLOCK_BOOTTIME.
        ("sent_ns", ctypes.c_uint64),
        # From wake-up to the outbox filled, and what the last sending took, nanoseconds.
        ("elapsed_ns", ctypes.c_uint64),
        # Time this tick had from wake-up on: the budget, or less by a frame's deadline; ns; u64::MAX: no end.
        ("budget_ns", ctypes.c_uint64),
        # Work budget in units; u64::MAX: none.
        ("budget_units", ctypes.c_uint64),
        # What this tick could not cut (admission, broad phase, widening, publishing), nanoseconds.
        ("floor_ns", ctypes.c_uint64),
        # Work units spent; a step under way is brought to its end, so perhaps one or two beyond the budget.
        ("units", ctypes.c_uint64),
        # Nanoseconds by Stage; sending: of the tick before.
        ("stage_ns", ctypes.c_uint64 * STAGES_LEN),
        # Refusals in this boot by RejectReason.
        ("rejects", ctypes.c_uint64 * REJECTS_LEN),
        # Bodies in the scene.
        ("bodies", ctypes.c_uint64),
        # Bodies that are stale, rejected or not received, and those whose pairs are truncated; not those held or removed.
        ("unknown", ctypes.c_uint64),
        # Pairs of overlapping boxes.
        ("candidates", ctypes.c_uint64),
        # Pairs certified colliding.
        ("colliding", ctypes.c_uint64),
        # Pairs not decided.
        ("possible", ctypes.c_uint64),
        # Pairs apart, but nearer than their report_within_m.
        ("near", ctypes.c_uint64),
        # Pairs of bodies that a rule, neighbour or rigid group ignores.
        ("ignored", ctypes.c_uint64),
        # Ticks of this boot that ended after their budget or a frame's deadline.
        ("missed", ctypes.c_uint64),
        # Begins and their ends that were both never sent.
        ("cancelled_events", ctypes.c_uint64),
        # Body ids of the worst pair (smaller first); 0: none.
        ("worst_a", ctypes.c_uint64),
        # See worst_a.
        ("worst_b", ctypes.c_uint64),
        # Widest interval among the pairs published, metres.
        ("widest_m", ctypes.c_double),
        # Ticks for which the oldest undecided pair has been so.
        ("oldest_undecided_ticks", ctypes.c_uint64),
        # Bits of Reason, by number.
        ("reasons", ctypes.c_uint32),
        # TickCause.
        ("cause", ctypes.c_uint8),
        # 1: ended after its budget or a frame's deadline.
        ("overrun", ctypes.c_uint8),
        # Sources in use in sources.
        ("sources_len", ctypes.c_uint8),
        # Place in sources whose frame caused the tick; 255: none.
        ("cause_source", ctypes.c_uint8),
        # Where validate failed and a structure was rebuilt, times in this boot.
        ("rebuilds", ctypes.c_uint64),
        # Bodies whose fat box the broad phase made anew.
        ("broad_renewed", ctypes.c_uint32),
        # BroadMode: how the broad phase worked.
        ("broad_mode", ctypes.c_uint8),
        # BroadCause: why.
        ("broad_cause", ctypes.c_uint8),
        # Zero.
        ("reserved", ctypes.c_uint8 * 2),
        # The sources, in the scene's order.
        ("sources", SourceRow * SOURCES_MAX),
    ]


class Hello(_Row):
    """What a client reads before anything else. This layout is frozen forever."""

    TYPE_NAME = "sweepd.Hello"
    _fields_ = [
        # b"sweepd\0\0".
        ("magic", ctypes.c_uint8 * 8),
        # Random number of this start of the daemon.
        ("boot_id", ctypes.c_uint64),
        # Process id of the daemon.
        ("pid", ctypes.c_uint32),
        # User id of the daemon.
        ("uid", ctypes.c_uint32),
        # WIRE_VERSION of the daemon.
        ("wire_version", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
        # sweepd's version, NUL-padded ASCII.
        ("sweepd_version", ctypes.c_uint8 * 16),
        # iceoryx2's version, NUL-padded ASCII.
        ("iceoryx2_version", ctypes.c_uint8 * 16),
    ]


class RequestHeader(_Row):
    """User header of a request; the payload is json_len bytes of JSON, then the blobs it names by offset."""

    TYPE_NAME = "sweepd.v1.RequestHeader"
    _fields_ = [
        # Bytes of JSON at the front of the payload.
        ("json_len", ctypes.c_uint64),
        # The client's number for this request, echoed.
        ("request", ctypes.c_uint64),
        # WIRE_VERSION of the sender.
        ("schema", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]


class AnswerHeader(_Row):
    """User header of an answer; the payload is JSON."""

    TYPE_NAME = "sweepd.v1.AnswerHeader"
    _fields_ = [
        # Random number of this start of the daemon.
        ("boot_id", ctypes.c_uint64),
        # The client's number of the request.
        ("request", ctypes.c_uint64),
        # WIRE_VERSION.
        ("schema", ctypes.c_uint32),
        # 1: done, 0: refused.
        ("ok", ctypes.c_uint32),
    ]


class Verdict(IntEnum):
    """What is known of a pair at the poses this tick used."""

    # No verdict was ever certified.
    NONE = 0
    # gap_min > 0, and not below the pair's report_within_m.
    APART = 1
    # gap_min > 0 and below the pair's report_within_m.
    NEAR = 2
    # Not decided: 0 lies inside the interval and work was not finished, or a body is unknown.
    POSSIBLE = 3
    # gap_max <= 0, or finished with 0 inside the rounding interval (touching).
    COLLIDING = 4


class State(IntEnum):
    """The tick in one word: the first that applies, counting from the last listed here to the first."""

    # At least one body, all known, every enabled pair proved apart, nothing cut off.
    CLEAR = 0
    # As clear, but some pair is nearer than its report_within_m.
    NEAR = 1
    # Some pair is not decided.
    POSSIBLE = 2
    # Something is missing: see the reason bits.
    UNKNOWN = 3
    # At least one certified collision.
    COLLIDING = 4


class Reason(IntEnum):
    """Why a tick is unknown or not clear; bit numbers of TickRow::reasons: test ``tick.reasons & (1 << CODE)``."""

    # A moving body has had no admitted pose in this boot.
    NOT_RECEIVED = 0
    # A body's newest pose is too old.
    STALE = 1
    # A too old body is held at its last pose by request.
    HELD = 2
    # A too old body was taken out of the scene by request.
    REMOVED_BY_AGE = 3
    # A body's newest pose or vertices were refused.
    REJECTED = 4
    # Rows, pairs or frames of a path did not fit.
    TRUNCATED = 5
    # Work was not finished.
    UNDECIDED = 6
    # There is no body, or no source has sent anything.
    NO_INPUT = 7
    # A continuous body touched another on its way to this tick's poses, or it is not decided whether it did.
    SWEPT = 8
    # A continuous body's step was beyond its teleport_m: what lies between was not asked. clear may stand beside it.
    TELEPORTED = 9


class TickCause(IntEnum):
    """Why a tick was run."""

    # A frame (in on_all a round of frames) or the rate's next beat.
    FRAME = 0
    # A body or a source reached its time-out.
    TIMEOUT = 1
    # Nothing else happened for a heartbeat.
    HEARTBEAT = 2
    # A scene edit was applied, or a tick was asked for.
    EDIT = 3


class BroadMode(IntEnum):
    """How the broad phase worked a tick."""

    # The method has one way.
    WHOLE = 0
    # Few bodies moved: their candidates were compared one by one.
    SPARSE = 1
    # Many moved: all candidates were compared, or what lists them for some ticks, as a list.
    LIST = 2
    # All bodies were sorted anew, and their candidates found anew.
    SORT = 3
    # No candidates are kept: overlaps were found among all boxes.
    SCRATCH = 4


class BroadCause(IntEnum):
    """Why the broad phase worked a tick as it did."""

    # There was nothing to choose.
    NONE = 0
    # Less than a tenth of the bodies moved (a fourteenth, once they are listed).
    FEW_MOVED = 1
    # More moved, in this tick or in one of the last three.
    MANY_MOVED = 2
    # More than an eighth of the bodies came in, or jumped away from where they stood.
    MANY_CAME = 3
    # The order has worn: its blocks met too many others, or a body found no free place.
    WORN = 4
    # By counted work, candidates took more than none would.
    COST = 5
    # ... and are not tried again yet.
    SPELL = 6
    # Candidates are tried again.
    TRIAL = 7
    # Few have moved for some ticks: candidates will last.
    CALM = 8
    # It was asked for, which no daemon does.
    FORCED = 9
    # More moved, and nearly all of them tremble about their places.
    STANDING = 10


class Event(IntEnum):
    """Bit numbers of PairRow::events: test ``row["events"] & (1 << Event.BEGIN)``.

    A row may carry an end and a begin, in that order but where PASSED says otherwise.
    """

    # First tick in which the pair is certified colliding.
    BEGIN = 0
    # Certified colliding before and now.
    PERSIST = 1
    # Certified not colliding, or ended by a cause.
    END = 2
    # Beside a begin and an end: it began and ended within this tick's motion, the begin first.
    PASSED = 3


class EndCause(IntEnum):
    """Why a collision ended."""

    # No end in this row.
    NONE = 0
    # The bodies were certified apart.
    SEPARATED = 1
    # A body was removed from the scene.
    REMOVED = 2
    # A body was disabled.
    DISABLED = 3
    # A filter or pair rule now ignores the pair.
    FILTERED = 4
    # A source's session or epoch changed, or the scene was reset.
    RESET = 5
    # The daemon restarted; said by the client library when the boot id changes.
    RESTART = 6
    # A body was taken out for its age (on_stale = "remove").
    SOURCE_LOST = 7


class RejectReason(IntEnum):
    """Why a pose, a frame or a request was refused; index into TickRow::rejects."""

    # A position or quaternion holds NaN or infinity.
    NOT_FINITE = 0
    # A quaternion's length differs from 1 by more than 1e-2.
    BAD_QUATERNION = 1
    # A body id that the scene does not have.
    UNKNOWN_BODY = 2
    # The body belongs to another source.
    WRONG_SOURCE = 3
    # A source name that the scene does not have.
    UNKNOWN_SOURCE = 4
    # Another session of this source is alive.
    SOURCE_TAKEN = 5
    # The session has ended; the client must open a new one. Or what came has ids of another run of the daemon.
    SESSION_OVER = 6
    # A frame that is not newer than the newest of its session.
    OLD_FRAME = 7
    # The frame needs a scene revision that did not come in time.
    SCENE_REVISION = 8
    # A layout number, flags or a count that do not fit.
    BAD_LAYOUT = 9
    # The same body twice in one frame.
    DUPLICATE = 10
    # The body takes its pose from another (attach), or cannot move; or vertices of one that does not deform.
    NOT_STEERABLE = 11
    # Frames that waited while the daemon was silent too long, without sent_ns.
    TOO_OLD = 12
    # A frame or pose beyond a limit (rows a frame, coordinates).
    OVER_LIMIT = 13
    # A chain of ROS 2 frames from the body to the scene's frame that has a loop, a link older than the source's
    # time-out, or stamps too far apart; or a pose or a frame in another frame than the scene's.
    BAD_CHAIN = 14
    # A range of vertices that does not follow on the version the body has, or comes after refused ones; or vertices
    # of the source were lost on the way.
    VERTEX_VERSION = 15


class BodyStatus(IntEnum):
    """Whether a body's place is known."""

    # Its newest pose is admitted and young enough, or it cannot move.
    KNOWN = 0
    # It moves, and no pose was admitted in this boot (or since a reset); or it deforms, and no vertices were.
    NOT_RECEIVED = 1
    # Its newest pose or vertices were refused.
    REJECTED = 2
    # Too old; its pairs are possible within reach.
    STALE = 3
    # Too old, held at its last pose by request.
    HELD = 4
    # Too old, taken out by request.
    REMOVED_BY_AGE = 5
    # Disabled by an edit.
    DISABLED = 6
    # The pair set was full: its pairs are not all there.
    TRUNCATED = 7


class Level(IntEnum):
    """How far the work on a pair came."""

    # Nothing but the boxes.
    BOXES = 0
    # An older answer, widened by the motion since.
    CARRIED = 1
    # Some leaves or shape pairs are still open.
    PARTIAL = 2
    # The exact query is finished at this tick's poses.
    EXACT = 3


class ContactKind(IntEnum):
    """What a contact row is."""

    # A point of a contact manifold.
    CONTACT = 0
    # The closest points of a near pair.
    CLOSEST = 1
    # In contact_changes alone: the pair has no contacts any more.
    GONE = 2


class Stage(IntEnum):
    """The stages of a tick; index into TickRow::stage_ns."""

    # Admission of frames and edits, ages.
    WORLD = 0
    # Broad phase.
    BROAD = 1
    # Widening every moved pair's interval.
    WIDEN = 2
    # Narrowing within the budget.
    NARROW = 3
    # Filling the outbox.
    PUBLISH = 4
    # Handing the outbox to the transports, in the tick before.
    SEND = 5
    # Narrowing that went on after that, until the budget of the tick before was used.
    REST = 6


class FrameFlags(IntFlag):
    """Bits of FrameHeader::flags; exactly one of the three."""

    # Holds every body of its source.
    FULL = 1
    # Holds some bodies of its source.
    PARTIAL = 2
    # Holds none: the world stands still, ages are renewed for one time-out.
    PAUSED = 4


class VertexFlags(IntFlag):
    """VertexHeader::flags; exactly one of the two."""

    # Holds every vertex of the mesh.
    FULL = 1
    # Holds a range of them, applied to base_version.
    RANGE = 2


class PairFlags(IntFlag):
    """Bits of PairRow::flags."""

    # Finished, and 0 lies inside the rounding interval: touching counts as colliding.
    TOUCHING = 1
    # gap_best_m or the contacts are estimates; the interval is proved all the same.
    ESTIMATE = 2
    # A body of the pair is unknown or stale.
    UNKNOWN_BODY = 4
    # A body of the pair is held at an old pose.
    HELD_BODY = 8
    # The pair is gone (removed, filtered, ended by a cause, or its boxes parted); this row only carries its last
    # event.
    GONE = 16
    # Certified to have touched on the way to this tick's poses, within toi_min to toi_max.
    SWEPT_HIT = 32
    # Not decided whether it touched on the way; if so, from toi_min on.
    SWEPT_OPEN = 64
    # A continuous body of the pair jumped by more than its teleport_m: what lies between was not asked.
    TELEPORTED = 128


class ContactFlags(IntFlag):
    """Bits of ContactRow::flags."""

    # Taken at an older pose and carried along, each point with its body; the interval is that of the bodies' gap by now,
    # its upper end infinite where a body has several shapes.
    ESTIMATE = 1


class RegionFlags(IntFlag):
    """Bits of RegionRow::flags."""

    # The pair's contacts are exact at this tick's poses, and all of them lie in its regions.
    COMPLETE = 1
    # Not all of the pair was looked at: the regions hold what there may be, and get smaller with work.
    ESTIMATE = 2
    # There was more than is looked at for one pair: one of the regions stands for the rest.
    CLIPPED = 4


#: Every structure that crosses a process boundary, by name.
LAYOUTS = {
    row.__name__: row
    for row in (
        TransformRow,
        TransformVelRow,
        FrameHeader,
        VertexRow,
        VertexHeader,
        MessageHeader,
        ChangesHeader,
        PairRow,
        ContactRow,
        RegionRow,
        BodyRow,
        NameRow,
        SourceRow,
        TickRow,
        Hello,
        RequestHeader,
        AnswerHeader,
    )
}
