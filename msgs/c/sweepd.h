/* Wire version 1 of sweepd: the rows and headers of every message, for C11 and C++11.
 *
 * msgs/README.md has the services and what each message means; tests/wire_layout.rs compares this file with it, with
 * the Python package and with the daemon. SI units, right-handed, z up. Quaternions are x, y, z, w. */
#ifndef SWEEPD_H
#define SWEEPD_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#define SWEEPD_ASSERT(what) static_assert(what, #what)
#else
#define SWEEPD_ASSERT(what) _Static_assert(what, #what)
#endif

#define SWEEPD_WIRE_VERSION 1
/* No sub-shape: a contact of a shape that has no triangles. */
#define SWEEPD_NO_INDEX UINT32_MAX
/* Sources of a tick. */
#define SWEEPD_SOURCES_MAX 16
/* Bytes of a source's name, NUL-padded UTF-8. */
#define SWEEPD_SOURCE_NAME_LEN 32
/* Bytes of a body's name, NUL-padded UTF-8. */
#define SWEEPD_BODY_NAME_LEN 104
/* Places for reject counters. */
#define SWEEPD_REJECTS_LEN 16
/* Places for stage times. */
#define SWEEPD_STAGES_LEN 8

/* What is known of a pair at the poses this tick used. */
enum {
    /* No verdict was ever certified. */
    SWEEPD_VERDICT_NONE = 0,
    /* gap_min > 0, and not below the pair's report_within_m. */
    SWEEPD_VERDICT_APART = 1,
    /* gap_min > 0 and below the pair's report_within_m. */
    SWEEPD_VERDICT_NEAR = 2,
    /* Not decided: 0 lies inside the interval and work was not finished, or a body is unknown. */
    SWEEPD_VERDICT_POSSIBLE = 3,
    /* gap_max <= 0, or finished with 0 inside the rounding interval (touching). */
    SWEEPD_VERDICT_COLLIDING = 4,
};

/* The tick in one word: the first that applies, from the last to the first here. */
enum {
    /* At least one body, all known, every enabled pair proved apart, nothing cut off. */
    SWEEPD_STATE_CLEAR = 0,
    /* As clear, but some pair is nearer than its report_within_m. */
    SWEEPD_STATE_NEAR = 1,
    /* Some pair is not decided. */
    SWEEPD_STATE_POSSIBLE = 2,
    /* Something is missing: see the reason bits. */
    SWEEPD_STATE_UNKNOWN = 3,
    /* At least one certified collision. */
    SWEEPD_STATE_COLLIDING = 4,
};

/* Why a tick is unknown or not clear; bit numbers of TickRow::reasons: test `tick.reasons & (1 << CODE)`. */
enum {
    /* A moving body has had no admitted pose in this boot. */
    SWEEPD_REASON_NOT_RECEIVED = 0,
    /* A body's newest pose is too old. */
    SWEEPD_REASON_STALE = 1,
    /* A too old body is held at its last pose by request. */
    SWEEPD_REASON_HELD = 2,
    /* A too old body was taken out of the scene by request. */
    SWEEPD_REASON_REMOVED_BY_AGE = 3,
    /* A body's newest pose or vertices were refused. */
    SWEEPD_REASON_REJECTED = 4,
    /* Rows, pairs or frames of a path did not fit. */
    SWEEPD_REASON_TRUNCATED = 5,
    /* Work was not finished. */
    SWEEPD_REASON_UNDECIDED = 6,
    /* There is no body, or no source has sent anything. */
    SWEEPD_REASON_NO_INPUT = 7,
    /* A continuous body touched another on its way to this tick's poses, or it is not decided
     * whether it did. */
    SWEEPD_REASON_SWEPT = 8,
    /* A continuous body's step was beyond its teleport_m: what lies between was not asked. clear
     * may stand beside it. */
    SWEEPD_REASON_TELEPORTED = 9,
};

/* Why a tick was run. */
enum {
    /* A frame (in on_all a round of frames) or the rate's next beat. */
    SWEEPD_TICK_CAUSE_FRAME = 0,
    /* A body or a source reached its time-out. */
    SWEEPD_TICK_CAUSE_TIMEOUT = 1,
    /* Nothing else happened for a heartbeat. */
    SWEEPD_TICK_CAUSE_HEARTBEAT = 2,
    /* A scene edit was applied, or a tick was asked for. */
    SWEEPD_TICK_CAUSE_EDIT = 3,
};

/* How the broad phase worked a tick. */
enum {
    /* The method has one way. */
    SWEEPD_BROAD_MODE_WHOLE = 0,
    /* Few bodies moved: their candidates were compared one by one. */
    SWEEPD_BROAD_MODE_SPARSE = 1,
    /* Many moved: all candidates were compared, or what lists them for some ticks, as a list. */
    SWEEPD_BROAD_MODE_LIST = 2,
    /* All bodies were sorted anew, and their candidates found anew. */
    SWEEPD_BROAD_MODE_SORT = 3,
    /* No candidates are kept: overlaps were found among all boxes. */
    SWEEPD_BROAD_MODE_SCRATCH = 4,
};

/* Why the broad phase worked a tick as it did. */
enum {
    /* There was nothing to choose. */
    SWEEPD_BROAD_CAUSE_NONE = 0,
    /* Less than a tenth of the bodies moved (a fourteenth, once they are listed). */
    SWEEPD_BROAD_CAUSE_FEW_MOVED = 1,
    /* More moved. */
    SWEEPD_BROAD_CAUSE_MANY_MOVED = 2,
    /* More than an eighth of the bodies came in, or jumped away from where they stood. */
    SWEEPD_BROAD_CAUSE_MANY_CAME = 3,
    /* The order has worn: its blocks met too many others, or a body found no free place. */
    SWEEPD_BROAD_CAUSE_WORN = 4,
    /* By counted work, candidates took more than none would. */
    SWEEPD_BROAD_CAUSE_COST = 5,
    /* ... and are not tried again yet. */
    SWEEPD_BROAD_CAUSE_SPELL = 6,
    /* Candidates are tried again. */
    SWEEPD_BROAD_CAUSE_TRIAL = 7,
    /* Few have moved for some ticks: candidates will last. */
    SWEEPD_BROAD_CAUSE_CALM = 8,
    /* It was asked for, which no daemon does. */
    SWEEPD_BROAD_CAUSE_FORCED = 9,
    /* More moved, and nearly all of them tremble about their places. */
    SWEEPD_BROAD_CAUSE_STANDING = 10,
};

/* Bit numbers of PairRow::events: test `row.events & (1 << SWEEPD_EVENT_BEGIN)`. A row may carry an end and a
 * begin, in that order but where passed says otherwise. */
enum {
    /* First tick in which the pair is certified colliding. */
    SWEEPD_EVENT_BEGIN = 0,
    /* Certified colliding before and now. */
    SWEEPD_EVENT_PERSIST = 1,
    /* Certified not colliding, or ended by a cause. */
    SWEEPD_EVENT_END = 2,
    /* Beside a begin and an end: it began and ended within this tick's motion, the begin first. */
    SWEEPD_EVENT_PASSED = 3,
};

/* Why a collision ended. */
enum {
    /* No end in this row. */
    SWEEPD_END_CAUSE_NONE = 0,
    /* The bodies were certified apart. */
    SWEEPD_END_CAUSE_SEPARATED = 1,
    /* A body was removed from the scene. */
    SWEEPD_END_CAUSE_REMOVED = 2,
    /* A body was disabled. */
    SWEEPD_END_CAUSE_DISABLED = 3,
    /* A filter or pair rule now ignores the pair. */
    SWEEPD_END_CAUSE_FILTERED = 4,
    /* A source's session or epoch changed, or the scene was reset. */
    SWEEPD_END_CAUSE_RESET = 5,
    /* The daemon restarted; said by the client library when the boot id changes. */
    SWEEPD_END_CAUSE_RESTART = 6,
    /* A body was taken out for its age (on_stale = "remove"). */
    SWEEPD_END_CAUSE_SOURCE_LOST = 7,
};

/* Why a pose, a frame or a request was refused; index into TickRow::rejects. */
enum {
    /* A position or quaternion holds NaN or infinity. */
    SWEEPD_REJECT_REASON_NOT_FINITE = 0,
    /* A quaternion's length differs from 1 by more than 1e-2. */
    SWEEPD_REJECT_REASON_BAD_QUATERNION = 1,
    /* A body id that the scene does not have. */
    SWEEPD_REJECT_REASON_UNKNOWN_BODY = 2,
    /* The body belongs to another source. */
    SWEEPD_REJECT_REASON_WRONG_SOURCE = 3,
    /* A source name that the scene does not have. */
    SWEEPD_REJECT_REASON_UNKNOWN_SOURCE = 4,
    /* Another session of this source is alive. */
    SWEEPD_REJECT_REASON_SOURCE_TAKEN = 5,
    /* The session has ended; the client must open a new one. Or what came has ids of another run of the
     * daemon. */
    SWEEPD_REJECT_REASON_SESSION_OVER = 6,
    /* A frame that is not newer than the newest of its session. */
    SWEEPD_REJECT_REASON_OLD_FRAME = 7,
    /* The frame needs a scene revision that did not come in time. */
    SWEEPD_REJECT_REASON_SCENE_REVISION = 8,
    /* A layout number, flags or a count that do not fit. */
    SWEEPD_REJECT_REASON_BAD_LAYOUT = 9,
    /* The same body twice in one frame. */
    SWEEPD_REJECT_REASON_DUPLICATE = 10,
    /* The body takes its pose from another (attach), or cannot move; or vertices of one that
     * does not deform. */
    SWEEPD_REJECT_REASON_NOT_STEERABLE = 11,
    /* Frames that waited while the daemon was silent too long, without sent_ns. */
    SWEEPD_REJECT_REASON_TOO_OLD = 12,
    /* A frame or pose beyond a limit (rows a frame, coordinates). */
    SWEEPD_REJECT_REASON_OVER_LIMIT = 13,
    /* A chain of ROS 2 frames from the body to the scene's frame that has a loop, a link older
     * than the source's time-out, or stamps too far apart; or a pose or a frame in another
     * frame than the scene's. */
    SWEEPD_REJECT_REASON_BAD_CHAIN = 14,
    /* A range of vertices that does not follow on the version the body has, or comes after
     * refused ones; or vertices of the source were lost on the way. */
    SWEEPD_REJECT_REASON_VERTEX_VERSION = 15,
};

/* Whether a body's place is known. */
enum {
    /* Its newest pose is admitted and young enough, or it cannot move. */
    SWEEPD_BODY_STATUS_KNOWN = 0,
    /* It moves, and no pose was admitted in this boot (or since a reset); or it deforms, and no
     * vertices were. */
    SWEEPD_BODY_STATUS_NOT_RECEIVED = 1,
    /* Its newest pose or vertices were refused. */
    SWEEPD_BODY_STATUS_REJECTED = 2,
    /* Too old; its pairs are possible within reach. */
    SWEEPD_BODY_STATUS_STALE = 3,
    /* Too old, held at its last pose by request. */
    SWEEPD_BODY_STATUS_HELD = 4,
    /* Too old, taken out by request. */
    SWEEPD_BODY_STATUS_REMOVED_BY_AGE = 5,
    /* Disabled by an edit. */
    SWEEPD_BODY_STATUS_DISABLED = 6,
    /* The pair set was full: its pairs are not all there. */
    SWEEPD_BODY_STATUS_TRUNCATED = 7,
};

/* How far the work on a pair came. */
enum {
    /* Nothing but the boxes. */
    SWEEPD_LEVEL_BOXES = 0,
    /* An older answer, widened by the motion since. */
    SWEEPD_LEVEL_CARRIED = 1,
    /* Some leaves or shape pairs are still open. */
    SWEEPD_LEVEL_PARTIAL = 2,
    /* The exact query is finished at this tick's poses. */
    SWEEPD_LEVEL_EXACT = 3,
};

/* What a contact row is. */
enum {
    /* A point of a contact manifold. */
    SWEEPD_CONTACT_KIND_CONTACT = 0,
    /* The closest points of a near pair. */
    SWEEPD_CONTACT_KIND_CLOSEST = 1,
    /* In `contact_changes` alone: the pair has no contacts any more. */
    SWEEPD_CONTACT_KIND_GONE = 2,
};

/* The stages of a tick; index into TickRow::stage_ns. */
enum {
    /* Admission of frames and edits, ages. */
    SWEEPD_STAGE_WORLD = 0,
    /* Broad phase. */
    SWEEPD_STAGE_BROAD = 1,
    /* Widening every moved pair's interval. */
    SWEEPD_STAGE_WIDEN = 2,
    /* Narrowing within the budget. */
    SWEEPD_STAGE_NARROW = 3,
    /* Filling the outbox. */
    SWEEPD_STAGE_PUBLISH = 4,
    /* Handing the outbox to the transports, in the tick before. */
    SWEEPD_STAGE_SEND = 5,
    /* Narrowing that went on after that, until the budget of the tick before was used. */
    SWEEPD_STAGE_REST = 6,
};

/* Bits of FrameHeader::flags; exactly one of the three. */
enum {
    /* Holds every body of its source. */
    SWEEPD_FRAME_FLAGS_FULL = 1,
    /* Holds some bodies of its source. */
    SWEEPD_FRAME_FLAGS_PARTIAL = 2,
    /* Holds none: the world stands still, ages are renewed for one time-out. */
    SWEEPD_FRAME_FLAGS_PAUSED = 4,
};

/* VertexHeader::flags; exactly one of the two. */
enum {
    /* Holds every vertex of the mesh. */
    SWEEPD_VERTEX_FLAGS_FULL = 1,
    /* Holds a range of them, applied to base_version. */
    SWEEPD_VERTEX_FLAGS_RANGE = 2,
};

/* Bits of PairRow::flags. */
enum {
    /* Finished, and 0 lies inside the rounding interval: touching counts as colliding. */
    SWEEPD_PAIR_FLAGS_TOUCHING = 1,
    /* gap_best_m or the contacts are estimates; the interval is proved all the same. */
    SWEEPD_PAIR_FLAGS_ESTIMATE = 2,
    /* A body of the pair is unknown or stale. */
    SWEEPD_PAIR_FLAGS_UNKNOWN_BODY = 4,
    /* A body of the pair is held at an old pose. */
    SWEEPD_PAIR_FLAGS_HELD_BODY = 8,
    /* The pair is gone (removed, filtered, ended by a cause, or its boxes parted); this row only
     * carries its last event. */
    SWEEPD_PAIR_FLAGS_GONE = 16,
    /* Certified to have touched on the way to this tick's poses, within toi_min to toi_max. */
    SWEEPD_PAIR_FLAGS_SWEPT_HIT = 32,
    /* Not decided whether it touched on the way; if so, from toi_min on. */
    SWEEPD_PAIR_FLAGS_SWEPT_OPEN = 64,
    /* A continuous body of the pair jumped by more than its teleport_m: what lies between was not
     * asked. */
    SWEEPD_PAIR_FLAGS_TELEPORTED = 128,
};

/* Bits of ContactRow::flags. */
enum {
    /* Taken at an older pose and carried along, each point with its body; the interval is that of the bodies' gap by now,
     * its upper end infinite where a body has several shapes. */
    SWEEPD_CONTACT_FLAGS_ESTIMATE = 1,
};

/* Bits of RegionRow::flags. */
enum {
    /* The pair's contacts are exact at this tick's poses, and all of them lie in its regions. */
    SWEEPD_REGION_FLAGS_COMPLETE = 1,
    /* Not all of the pair was looked at: the regions hold what there may be, and get smaller
     * with work. */
    SWEEPD_REGION_FLAGS_ESTIMATE = 2,
    /* There was more than is looked at for one pair: one of the regions stands for the rest. */
    SWEEPD_REGION_FLAGS_CLIPPED = 4,
};

/* Type name "sweepd.v1.Transform", 72 bytes. One body's pose. */
typedef struct sweepd_transform_row {
    /* Body id. */
    uint64_t body;
    /* Zero. */
    uint32_t flags;
    /* Zero. */
    uint32_t reserved;
    /* Origin of the body's frame in the scene's frame, metres. */
    double position[3];
    /* Orientation x, y, z, w, unit length within 1e-2. */
    double orientation[4];
} sweepd_transform_row;
SWEEPD_ASSERT(offsetof(sweepd_transform_row, body) == 0);
SWEEPD_ASSERT(offsetof(sweepd_transform_row, flags) == 8);
SWEEPD_ASSERT(offsetof(sweepd_transform_row, reserved) == 12);
SWEEPD_ASSERT(offsetof(sweepd_transform_row, position) == 16);
SWEEPD_ASSERT(offsetof(sweepd_transform_row, orientation) == 40);
SWEEPD_ASSERT(sizeof(sweepd_transform_row) == 72);

/* Type name "sweepd.v1.TransformVel", 120 bytes. One body's pose and velocity. */
typedef struct sweepd_transform_vel_row {
    /* Pose, as TransformRow. */
    sweepd_transform_row transform;
    /* Velocity of the body frame's origin in the scene's frame, metres a second. */
    double linear[3];
    /* Angular velocity in the scene's frame, radians a second. */
    double angular[3];
} sweepd_transform_vel_row;
SWEEPD_ASSERT(offsetof(sweepd_transform_vel_row, transform) == 0);
SWEEPD_ASSERT(offsetof(sweepd_transform_vel_row, linear) == 72);
SWEEPD_ASSERT(offsetof(sweepd_transform_vel_row, angular) == 96);
SWEEPD_ASSERT(sizeof(sweepd_transform_vel_row) == 120);

/* Type name "sweepd.v1.FrameHeader", 112 bytes. User header of transforms and transforms_vel:
 * whose frame, which one, how old, how urgent. */
typedef struct sweepd_frame_header {
    /* Random number drawn at each client start; never 0. */
    uint64_t session;
    /* Raised by the client when its world resets. */
    uint64_t epoch;
    /* Counts the frames of a session; order within a session is (epoch, seq). */
    uint64_t seq;
    /* When the client sent it, nanoseconds of CLOCK_BOOTTIME; 0: not said, then age counts from
     * receipt. */
    uint64_t sent_ns;
    /* The sender's own stamp of the poses, nanoseconds of the clock clock_id; echoed, never
     * trusted. */
    uint64_t stamp_ns;
    /* Least scene revision these poses need; 0: any. */
    uint64_t scene_rev;
    /* Deadline of the tick on CLOCK_MONOTONIC, nanoseconds; 0: none. Can shorten the budget,
     * never lengthen it. */
    uint64_t deadline_ns;
    /* Time left for the tick from receipt, nanoseconds; 0: not said. */
    uint64_t time_left_ns;
    /* Name of the source, NUL-padded UTF-8. */
    uint8_t source[SWEEPD_SOURCE_NAME_LEN];
    /* frame_flags: full, partial or paused. */
    uint32_t flags;
    /* The sender's number for the clock of stamp_ns; echoed. */
    uint32_t clock_id;
    /* WIRE_VERSION of the sender. */
    uint32_t schema;
    /* Low half of the boot_id whose body ids the rows have; 0: not said. What is of another boot is
     * refused. */
    uint32_t boot;
} sweepd_frame_header;
SWEEPD_ASSERT(offsetof(sweepd_frame_header, session) == 0);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, epoch) == 8);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, seq) == 16);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, sent_ns) == 24);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, stamp_ns) == 32);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, scene_rev) == 40);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, deadline_ns) == 48);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, time_left_ns) == 56);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, source) == 64);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, flags) == 96);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, clock_id) == 100);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, schema) == 104);
SWEEPD_ASSERT(offsetof(sweepd_frame_header, boot) == 108);
SWEEPD_ASSERT(sizeof(sweepd_frame_header) == 112);

/* Type name "sweepd.v1.Vertex", 12 bytes. One vertex. */
typedef struct sweepd_vertex_row {
    /* In the body's frame, metres. */
    float position[3];
} sweepd_vertex_row;
SWEEPD_ASSERT(offsetof(sweepd_vertex_row, position) == 0);
SWEEPD_ASSERT(sizeof(sweepd_vertex_row) == 12);

/* Type name "sweepd.v1.VertexHeader", 120 bytes. User header of vertices: whose they are, which
 * of them, and which version they make. */
typedef struct sweepd_vertex_header {
    /* Session of the client, the same as in its frames; never 0. */
    uint64_t session;
    /* Epoch of the frame that they belong with. */
    uint64_t epoch;
    /* Number of the frame that they belong with: they are taken with the first that is not older,
     * or, but for those of the source that on_frame names, after a time-out of their source. 0: at
     * once, behind what the session sent before. */
    uint64_t seq;
    /* When the client sent them, nanoseconds of CLOCK_BOOTTIME; 0: not said. */
    uint64_t sent_ns;
    /* Body id. */
    uint64_t body;
    /* Version of the vertices after this message, from 1; raised with each message of a body. */
    uint64_t version;
    /* Of a range: the version that it is applied to. Any other, and it is refused. */
    uint64_t base_version;
    /* Which message of vertices of the session this is, from 1: a gap says that some were lost, and all that
     * the source bent is unknown until all of its vertices come again. 0: not said. */
    uint64_t number;
    /* Name of the source, NUL-padded UTF-8. */
    uint8_t source[SWEEPD_SOURCE_NAME_LEN];
    /* Place of the first row in the mesh's list of vertices; 0 where all are sent. */
    uint32_t first;
    /* How many rows follow. */
    uint32_t count;
    /* How many vertices the mesh has. */
    uint32_t total;
    /* vertex_flags: full or range. */
    uint32_t flags;
    /* WIRE_VERSION of the sender. */
    uint32_t schema;
    /* Low half of the boot_id whose body ids the rows have; 0: not said. What is of another boot is
     * refused. */
    uint32_t boot;
} sweepd_vertex_header;
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, session) == 0);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, epoch) == 8);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, seq) == 16);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, sent_ns) == 24);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, body) == 32);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, version) == 40);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, base_version) == 48);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, number) == 56);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, source) == 64);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, first) == 96);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, count) == 100);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, total) == 104);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, flags) == 108);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, schema) == 112);
SWEEPD_ASSERT(offsetof(sweepd_vertex_header, boot) == 116);
SWEEPD_ASSERT(sizeof(sweepd_vertex_header) == 120);

/* Type name "sweepd.v1.MessageHeader", 56 bytes. User header of every message the daemon
 * publishes. */
typedef struct sweepd_message_header {
    /* Random number of this start of the daemon. */
    uint64_t boot_id;
    /* Tick, from 1. */
    uint64_t tick;
    /* Scene revision the tick used. */
    uint64_t scene_rev;
    /* Oldest sender's stamp among the poses used, nanoseconds; of no meaning where sources have clocks of their own. */
    uint64_t oldest_stamp_ns;
    /* Newest sender's stamp among the poses used, nanoseconds; of no meaning where sources have clocks of their own. */
    uint64_t newest_stamp_ns;
    /* Rows that did not fit into this message. */
    uint64_t truncated;
    /* State of the tick. */
    uint8_t state;
    /* Zero. */
    uint8_t reserved[3];
    /* WIRE_VERSION. */
    uint32_t schema;
} sweepd_message_header;
SWEEPD_ASSERT(offsetof(sweepd_message_header, boot_id) == 0);
SWEEPD_ASSERT(offsetof(sweepd_message_header, tick) == 8);
SWEEPD_ASSERT(offsetof(sweepd_message_header, scene_rev) == 16);
SWEEPD_ASSERT(offsetof(sweepd_message_header, oldest_stamp_ns) == 24);
SWEEPD_ASSERT(offsetof(sweepd_message_header, newest_stamp_ns) == 32);
SWEEPD_ASSERT(offsetof(sweepd_message_header, truncated) == 40);
SWEEPD_ASSERT(offsetof(sweepd_message_header, state) == 48);
SWEEPD_ASSERT(offsetof(sweepd_message_header, reserved) == 49);
SWEEPD_ASSERT(offsetof(sweepd_message_header, schema) == 52);
SWEEPD_ASSERT(sizeof(sweepd_message_header) == 56);

/* Type name "sweepd.v1.ChangesHeader", 72 bytes. User header of changes and contact_changes: what
 * the rows are to be applied to, and what that makes. */
typedef struct sweepd_changes_header {
    /* As in every message. */
    sweepd_message_header message;
    /* The tick whose list these rows change; 0: they are the whole list. */
    uint64_t base_tick;
    /* How many rows the list has with them. */
    uint64_t listed;
} sweepd_changes_header;
SWEEPD_ASSERT(offsetof(sweepd_changes_header, message) == 0);
SWEEPD_ASSERT(offsetof(sweepd_changes_header, base_tick) == 56);
SWEEPD_ASSERT(offsetof(sweepd_changes_header, listed) == 64);
SWEEPD_ASSERT(sizeof(sweepd_changes_header) == 72);

/* Type name "sweepd.v1.Pair", 120 bytes. One pair that is not plainly apart, or one last event
 * of a pair. */
typedef struct sweepd_pair_row {
    /* Smaller body id. */
    uint64_t body_a;
    /* Larger body id. */
    uint64_t body_b;
    /* Lower end of the proved gap, metres, signed; minus infinity: nothing known. */
    double gap_min_m;
    /* Upper end of the proved gap, metres, signed; infinity: nothing known. */
    double gap_max_m;
    /* Best estimate of the gap, metres, signed; NaN: none. */
    double gap_best_m;
    /* How fast the gap shrinks along the normal, metres a second; negative: it grows; NaN: not
     * known (no velocity was sent, or a body is silent, refused or deforms). */
    double closing_mps;
    /* Of a swept pair that touched, or may have, on the way from the last tick's poses (0) to this
     * one's (1): the share before which it did not (steps that jumped, which are not swept, aside);
     * NaN: not swept, or free of touch. */
    double toi_min;
    /* The share by which it had touched first (SWEPT_HIT), or 1 (SWEPT_OPEN); NaN as toi_min. */
    double toi_max;
    /* Begin: the earliest tick in which it may have happened. */
    uint64_t begin_first_tick;
    /* Begin: the tick in which it was certified. */
    uint64_t begin_last_tick;
    /* End: the earliest tick in which it may have happened. */
    uint64_t end_first_tick;
    /* End: the tick in which it was certified or caused. */
    uint64_t end_last_tick;
    /* Tick of the last certified verdict; 0: never. */
    uint64_t certified_tick;
    /* Ticks since the interval was computed at the poses of its tick. */
    uint32_t bound_age_ticks;
    /* Verdict at this tick's poses. */
    uint8_t verdict;
    /* Last certified Verdict: apart, near or colliding. */
    uint8_t certified_verdict;
    /* Bits of Event, by number. */
    uint8_t events;
    /* EndCause of the end in this row. */
    uint8_t end_cause;
    /* Level reached. */
    uint8_t level;
    /* pair_flags. */
    uint8_t flags;
    /* Zero. */
    uint8_t reserved[6];
} sweepd_pair_row;
SWEEPD_ASSERT(offsetof(sweepd_pair_row, body_a) == 0);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, body_b) == 8);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, gap_min_m) == 16);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, gap_max_m) == 24);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, gap_best_m) == 32);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, closing_mps) == 40);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, toi_min) == 48);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, toi_max) == 56);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, begin_first_tick) == 64);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, begin_last_tick) == 72);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, end_first_tick) == 80);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, end_last_tick) == 88);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, certified_tick) == 96);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, bound_age_ticks) == 104);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, verdict) == 108);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, certified_verdict) == 109);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, events) == 110);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, end_cause) == 111);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, level) == 112);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, flags) == 113);
SWEEPD_ASSERT(offsetof(sweepd_pair_row, reserved) == 114);
SWEEPD_ASSERT(sizeof(sweepd_pair_row) == 120);

/* Type name "sweepd.v1.Contact", 192 bytes. One point of contact, or the closest points of a
 * near pair. */
typedef struct sweepd_contact_row {
    /* Stays while the contact does; 0: the kind `closest`, of which a pair has one at most. */
    uint64_t id;
    /* Smaller body id. */
    uint64_t body_a;
    /* Larger body id. */
    uint64_t body_b;
    /* Point on A's surface, scene frame, metres. */
    double point_a[3];
    /* Point on B's surface, scene frame, metres. */
    double point_b[3];
    /* Point on A's surface, A's body frame, metres. */
    double point_a_body[3];
    /* Point on B's surface, B's body frame, metres. */
    double point_b_body[3];
    /* Unit, scene frame, from A to B. */
    double normal[3];
    /* Gap at this contact, metres; negative: depth. */
    double gap_m;
    /* Lower end of the shape pair's proved gap, metres. */
    double gap_min_m;
    /* Upper end of the shape pair's proved gap, metres. */
    double gap_max_m;
    /* Shape of A, by its place in the body. */
    uint32_t shape_a;
    /* Shape of B, by its place in the body. */
    uint32_t shape_b;
    /* Triangle of A's shape; u32::MAX: none. */
    uint32_t triangle_a;
    /* Triangle of B's shape; u32::MAX: none. */
    uint32_t triangle_b;
    /* contact_flags. */
    uint32_t flags;
    /* ContactKind. */
    uint8_t kind;
    /* Zero. */
    uint8_t reserved[3];
} sweepd_contact_row;
SWEEPD_ASSERT(offsetof(sweepd_contact_row, id) == 0);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, body_a) == 8);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, body_b) == 16);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, point_a) == 24);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, point_b) == 48);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, point_a_body) == 72);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, point_b_body) == 96);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, normal) == 120);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, gap_m) == 144);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, gap_min_m) == 152);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, gap_max_m) == 160);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, shape_a) == 168);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, shape_b) == 172);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, triangle_a) == 176);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, triangle_b) == 180);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, flags) == 184);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, kind) == 188);
SWEEPD_ASSERT(offsetof(sweepd_contact_row, reserved) == 189);
SWEEPD_ASSERT(sizeof(sweepd_contact_row) == 192);

/* Type name "sweepd.v1.Region", 144 bytes. One place where a pair may touch. The union of a
 * pair's regions holds every point that the two share; of two convex shapes with COMPLETE the
 * points of the contacts alone. */
typedef struct sweepd_region_row {
    /* Smaller body id. */
    uint64_t body_a;
    /* Larger body id. */
    uint64_t body_b;
    /* Centre of the sphere, scene frame, metres. */
    double centre[3];
    /* Its radius, metres; infinity: the place of a body is not known. */
    double radius_m;
    /* Axis of the cone of normals, from A to B, unit, scene frame. */
    double cone_axis[3];
    /* Half angle of that cone, radians; pi: any direction. */
    double cone_half_angle_rad;
    /* Best guess of a point of contact, scene frame, metres. */
    double point[3];
    /* Best guess of the normal there, from A to B, unit, scene frame. */
    double normal[3];
    /* Best guess of the depth there, metres, not below 0. */
    double depth_m;
    /* region_flags. */
    uint32_t flags;
    /* Place among the pair's regions, from 0. */
    uint8_t index;
    /* How many regions the pair has. */
    uint8_t count;
    /* Level reached; boxes: no more than the bodies' boxes is behind it. */
    uint8_t level;
    /* Zero. */
    uint8_t reserved;
} sweepd_region_row;
SWEEPD_ASSERT(offsetof(sweepd_region_row, body_a) == 0);
SWEEPD_ASSERT(offsetof(sweepd_region_row, body_b) == 8);
SWEEPD_ASSERT(offsetof(sweepd_region_row, centre) == 16);
SWEEPD_ASSERT(offsetof(sweepd_region_row, radius_m) == 40);
SWEEPD_ASSERT(offsetof(sweepd_region_row, cone_axis) == 48);
SWEEPD_ASSERT(offsetof(sweepd_region_row, cone_half_angle_rad) == 72);
SWEEPD_ASSERT(offsetof(sweepd_region_row, point) == 80);
SWEEPD_ASSERT(offsetof(sweepd_region_row, normal) == 104);
SWEEPD_ASSERT(offsetof(sweepd_region_row, depth_m) == 128);
SWEEPD_ASSERT(offsetof(sweepd_region_row, flags) == 136);
SWEEPD_ASSERT(offsetof(sweepd_region_row, index) == 140);
SWEEPD_ASSERT(offsetof(sweepd_region_row, count) == 141);
SWEEPD_ASSERT(offsetof(sweepd_region_row, level) == 142);
SWEEPD_ASSERT(offsetof(sweepd_region_row, reserved) == 143);
SWEEPD_ASSERT(sizeof(sweepd_region_row) == 144);

/* Type name "sweepd.v1.Body", 104 bytes. One body. */
typedef struct sweepd_body_row {
    /* Body id. */
    uint64_t body;
    /* Last admitted position of the body's frame, scene frame, metres. */
    double position[3];
    /* Last admitted orientation x, y, z, w. */
    double orientation[4];
    /* The sender's stamp of that pose, nanoseconds. */
    uint64_t stamp_ns;
    /* Receipt of that pose, nanoseconds of CLOCK_BOOTTIME. */
    uint64_t received_ns;
    /* Age at this tick, nanoseconds; u64::MAX: never received. */
    uint64_t age_ns;
    /* Generation: raised when a body of this name is put again. */
    uint32_t generation;
    /* Place of its source in TickRow::sources; u32::MAX: none. */
    uint32_t source;
    /* BodyStatus. */
    uint8_t status;
    /* Worst Verdict over all its pairs. */
    uint8_t verdict;
    /* Last RejectReason, when the status is rejected. */
    uint8_t reject;
    /* Zero. */
    uint8_t reserved[5];
} sweepd_body_row;
SWEEPD_ASSERT(offsetof(sweepd_body_row, body) == 0);
SWEEPD_ASSERT(offsetof(sweepd_body_row, position) == 8);
SWEEPD_ASSERT(offsetof(sweepd_body_row, orientation) == 32);
SWEEPD_ASSERT(offsetof(sweepd_body_row, stamp_ns) == 64);
SWEEPD_ASSERT(offsetof(sweepd_body_row, received_ns) == 72);
SWEEPD_ASSERT(offsetof(sweepd_body_row, age_ns) == 80);
SWEEPD_ASSERT(offsetof(sweepd_body_row, generation) == 88);
SWEEPD_ASSERT(offsetof(sweepd_body_row, source) == 92);
SWEEPD_ASSERT(offsetof(sweepd_body_row, status) == 96);
SWEEPD_ASSERT(offsetof(sweepd_body_row, verdict) == 97);
SWEEPD_ASSERT(offsetof(sweepd_body_row, reject) == 98);
SWEEPD_ASSERT(offsetof(sweepd_body_row, reserved) == 99);
SWEEPD_ASSERT(sizeof(sweepd_body_row) == 104);

/* Type name "sweepd.v1.Name", 128 bytes. A body's name. */
typedef struct sweepd_name_row {
    /* Body id. */
    uint64_t body;
    /* Place of its source in TickRow::sources; u32::MAX: none. */
    uint32_t source;
    /* Generation of the body. */
    uint32_t generation;
    /* Bytes of the name in use. */
    uint32_t len;
    /* Zero. */
    uint32_t reserved;
    /* UTF-8, NUL-padded. */
    uint8_t name[SWEEPD_BODY_NAME_LEN];
} sweepd_name_row;
SWEEPD_ASSERT(offsetof(sweepd_name_row, body) == 0);
SWEEPD_ASSERT(offsetof(sweepd_name_row, source) == 8);
SWEEPD_ASSERT(offsetof(sweepd_name_row, generation) == 12);
SWEEPD_ASSERT(offsetof(sweepd_name_row, len) == 16);
SWEEPD_ASSERT(offsetof(sweepd_name_row, reserved) == 20);
SWEEPD_ASSERT(offsetof(sweepd_name_row, name) == 24);
SWEEPD_ASSERT(sizeof(sweepd_name_row) == 128);

/* Type name "sweepd.v1.Source", 104 bytes. One source as the tick saw it. */
typedef struct sweepd_source_row {
    /* Name, NUL-padded UTF-8; empty: no source in this place. */
    uint8_t name[SWEEPD_SOURCE_NAME_LEN];
    /* Session in force; 0: none yet. */
    uint64_t session;
    /* Epoch of its newest frame. */
    uint64_t epoch;
    /* Number of its newest frame. */
    uint64_t seq;
    /* Sender's stamp of its newest frame, nanoseconds. */
    uint64_t stamp_ns;
    /* Age of its newest frame, nanoseconds; u64::MAX: none yet. */
    uint64_t age_ns;
    /* Frames admitted in this boot. */
    uint64_t frames;
    /* Frames passed over because a newer one was there, or lost on their way (gaps in seq). */
    uint64_t skipped;
    /* Frames refused. */
    uint64_t refused;
    /* Sender's number for the clock of stamp_ns. */
    uint32_t clock_id;
    /* 1: alive (a frame within its time-out). */
    uint8_t alive;
    /* 1: its newest frame was paused. */
    uint8_t paused;
    /* Zero. */
    uint8_t reserved[2];
} sweepd_source_row;
SWEEPD_ASSERT(offsetof(sweepd_source_row, name) == 0);
SWEEPD_ASSERT(offsetof(sweepd_source_row, session) == 32);
SWEEPD_ASSERT(offsetof(sweepd_source_row, epoch) == 40);
SWEEPD_ASSERT(offsetof(sweepd_source_row, seq) == 48);
SWEEPD_ASSERT(offsetof(sweepd_source_row, stamp_ns) == 56);
SWEEPD_ASSERT(offsetof(sweepd_source_row, age_ns) == 64);
SWEEPD_ASSERT(offsetof(sweepd_source_row, frames) == 72);
SWEEPD_ASSERT(offsetof(sweepd_source_row, skipped) == 80);
SWEEPD_ASSERT(offsetof(sweepd_source_row, refused) == 88);
SWEEPD_ASSERT(offsetof(sweepd_source_row, clock_id) == 96);
SWEEPD_ASSERT(offsetof(sweepd_source_row, alive) == 100);
SWEEPD_ASSERT(offsetof(sweepd_source_row, paused) == 101);
SWEEPD_ASSERT(offsetof(sweepd_source_row, reserved) == 102);
SWEEPD_ASSERT(sizeof(sweepd_source_row) == 104);

/* Type name "sweepd.v1.Tick", 2088 bytes. The tick: published last, at least each heartbeat,
 * never truncated. */
typedef struct sweepd_tick_row {
    /* As in every message; truncated here is the sum over all messages. */
    sweepd_message_header header;
    /* When the tick ended, nanoseconds of CLOCK_BOOTTIME. */
    uint64_t sent_ns;
    /* From wake-up to the outbox filled, and what the last sending took, nanoseconds. */
    uint64_t elapsed_ns;
    /* Time this tick had from wake-up on: the budget, or less by a frame's deadline; ns; u64::MAX: no end. */
    uint64_t budget_ns;
    /* Work budget in units; u64::MAX: none. */
    uint64_t budget_units;
    /* What this tick could not cut (admission, broad phase, widening, publishing), nanoseconds. */
    uint64_t floor_ns;
    /* Work units spent; a step under way is brought to its end, so perhaps one or two beyond the
     * budget. */
    uint64_t units;
    /* Nanoseconds by Stage; sending: of the tick before. */
    uint64_t stage_ns[SWEEPD_STAGES_LEN];
    /* Refusals in this boot by RejectReason. */
    uint64_t rejects[SWEEPD_REJECTS_LEN];
    /* Bodies in the scene. */
    uint64_t bodies;
    /* Bodies that are stale, rejected or not received, and those whose pairs are truncated; not those held or removed. */
    uint64_t unknown;
    /* Pairs of overlapping boxes. */
    uint64_t candidates;
    /* Pairs certified colliding. */
    uint64_t colliding;
    /* Pairs not decided. */
    uint64_t possible;
    /* Pairs apart, but nearer than their report_within_m. */
    uint64_t near;
    /* Pairs of bodies that a rule, neighbour or rigid group ignores. */
    uint64_t ignored;
    /* Ticks of this boot that ended after their budget or a frame's deadline. */
    uint64_t missed;
    /* Begins and their ends that were both never sent. */
    uint64_t cancelled_events;
    /* Body ids of the worst pair (smaller first); 0: none. */
    uint64_t worst_a;
    /* See worst_a. */
    uint64_t worst_b;
    /* Widest interval among the pairs published, metres. */
    double widest_m;
    /* Ticks for which the oldest undecided pair has been so. */
    uint64_t oldest_undecided_ticks;
    /* Bits of Reason, by number. */
    uint32_t reasons;
    /* TickCause. */
    uint8_t cause;
    /* 1: ended after its budget or a frame's deadline. */
    uint8_t overrun;
    /* Sources in use in sources. */
    uint8_t sources_len;
    /* Place in sources whose frame caused the tick; 255: none. */
    uint8_t cause_source;
    /* Where validate failed and a structure was rebuilt, times in this boot. */
    uint64_t rebuilds;
    /* Bodies whose fat box the broad phase made anew. */
    uint32_t broad_renewed;
    /* BroadMode: how the broad phase worked. */
    uint8_t broad_mode;
    /* BroadCause: why. */
    uint8_t broad_cause;
    /* Zero. */
    uint8_t reserved[2];
    /* The sources, in the scene's order. */
    sweepd_source_row sources[SWEEPD_SOURCES_MAX];
} sweepd_tick_row;
SWEEPD_ASSERT(offsetof(sweepd_tick_row, header) == 0);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, sent_ns) == 56);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, elapsed_ns) == 64);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, budget_ns) == 72);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, budget_units) == 80);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, floor_ns) == 88);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, units) == 96);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, stage_ns) == 104);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, rejects) == 168);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, bodies) == 296);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, unknown) == 304);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, candidates) == 312);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, colliding) == 320);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, possible) == 328);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, near) == 336);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, ignored) == 344);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, missed) == 352);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, cancelled_events) == 360);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, worst_a) == 368);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, worst_b) == 376);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, widest_m) == 384);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, oldest_undecided_ticks) == 392);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, reasons) == 400);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, cause) == 404);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, overrun) == 405);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, sources_len) == 406);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, cause_source) == 407);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, rebuilds) == 408);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, broad_renewed) == 416);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, broad_mode) == 420);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, broad_cause) == 421);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, reserved) == 422);
SWEEPD_ASSERT(offsetof(sweepd_tick_row, sources) == 424);
SWEEPD_ASSERT(sizeof(sweepd_tick_row) == 2088);

/* Type name "sweepd.Hello", 64 bytes. What a client reads before anything else. This layout is
 * frozen for ever. */
typedef struct sweepd_hello {
    /* b"sweepd\0\0". */
    uint8_t magic[8];
    /* Random number of this start of the daemon. */
    uint64_t boot_id;
    /* Process id of the daemon. */
    uint32_t pid;
    /* User id of the daemon. */
    uint32_t uid;
    /* WIRE_VERSION of the daemon. */
    uint32_t wire_version;
    /* Zero. */
    uint32_t reserved;
    /* sweepd's version, NUL-padded ASCII. */
    uint8_t sweepd_version[16];
    /* iceoryx2's version, NUL-padded ASCII. */
    uint8_t iceoryx2_version[16];
} sweepd_hello;
SWEEPD_ASSERT(offsetof(sweepd_hello, magic) == 0);
SWEEPD_ASSERT(offsetof(sweepd_hello, boot_id) == 8);
SWEEPD_ASSERT(offsetof(sweepd_hello, pid) == 16);
SWEEPD_ASSERT(offsetof(sweepd_hello, uid) == 20);
SWEEPD_ASSERT(offsetof(sweepd_hello, wire_version) == 24);
SWEEPD_ASSERT(offsetof(sweepd_hello, reserved) == 28);
SWEEPD_ASSERT(offsetof(sweepd_hello, sweepd_version) == 32);
SWEEPD_ASSERT(offsetof(sweepd_hello, iceoryx2_version) == 48);
SWEEPD_ASSERT(sizeof(sweepd_hello) == 64);

/* Type name "sweepd.v1.RequestHeader", 24 bytes. User header of a request; the payload is
 * json_len bytes of JSON, then the blobs it names by offset. */
typedef struct sweepd_request_header {
    /* Bytes of JSON at the front of the payload. */
    uint64_t json_len;
    /* The client's number for this request, echoed. */
    uint64_t request;
    /* WIRE_VERSION of the sender. */
    uint32_t schema;
    /* Zero. */
    uint32_t reserved;
} sweepd_request_header;
SWEEPD_ASSERT(offsetof(sweepd_request_header, json_len) == 0);
SWEEPD_ASSERT(offsetof(sweepd_request_header, request) == 8);
SWEEPD_ASSERT(offsetof(sweepd_request_header, schema) == 16);
SWEEPD_ASSERT(offsetof(sweepd_request_header, reserved) == 20);
SWEEPD_ASSERT(sizeof(sweepd_request_header) == 24);

/* Type name "sweepd.v1.AnswerHeader", 24 bytes. User header of an answer; the payload is JSON. */
typedef struct sweepd_answer_header {
    /* Random number of this start of the daemon. */
    uint64_t boot_id;
    /* The client's number of the request. */
    uint64_t request;
    /* WIRE_VERSION. */
    uint32_t schema;
    /* 1: done, 0: refused. */
    uint32_t ok;
} sweepd_answer_header;
SWEEPD_ASSERT(offsetof(sweepd_answer_header, boot_id) == 0);
SWEEPD_ASSERT(offsetof(sweepd_answer_header, request) == 8);
SWEEPD_ASSERT(offsetof(sweepd_answer_header, schema) == 16);
SWEEPD_ASSERT(offsetof(sweepd_answer_header, ok) == 20);
SWEEPD_ASSERT(sizeof(sweepd_answer_header) == 24);

#ifdef __cplusplus
}
#endif
#endif
