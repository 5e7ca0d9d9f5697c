//! Limits of every queue, buffer and loop: unit, reason, and what happens at the limit.
//!
//! Scene files can lower (some: raise) these in `[limits]`; the values here are the defaults and the hard ends.

/// Threads that one tick works with at most: the broad phase of a large scene gains little by more.
pub const THREADS_MAX: usize = 8;
/// Comparisons of boxes in a tick's search from which on other threads are asked: about half a millisecond. To wake
/// another thread and to wait for it takes up to 50 us.
pub const SHARED_TESTS_MIN: u64 = 36_000;
/// Names that pair rules with patterns match in all, each counted once per side of each rule: every one is kept, and
/// counting ignored pairs goes through them. An edit that would make more is refused, and so is a scene.
pub const PATTERN_MATCHES_MAX: usize = 1 << 22;
/// Sources a daemon can have, and so the source rows of a tick. iceoryx2 reserves a connection for each.
pub const SOURCES_MAX: usize = 16;
/// Bodies a scene may hold. Slots are u32 and a pair key is two of them; beyond a million the floor of a tick
/// leaves no time for the narrow phase on the machines this was built for.
pub const BODIES_MAX: usize = 1 << 20;
/// Shapes in one body; contact rows name them by place.
pub const SHAPES_PER_BODY_MAX: usize = 1 << 16;
/// Triangles of one mesh: 8 million take about two gigabytes with their trees; more are refused, never loaded in part.
pub const TRIANGLES_MAX: usize = 8_000_000;
/// Triangles of a mesh that deforms: a million are refitted in some 5 ms.
pub const DEFORMING_TRIANGLES_MAX: usize = 1 << 20;
/// Vertices of a mesh that deforms, and rows of one vertex message: 12 MiB. More in a message are refused.
pub const DEFORMING_VERTICES_MAX: usize = 1 << 20;
/// Vertices of a convex hull after building; support functions walk all of them.
pub const HULL_VERTICES_MAX: usize = 4096;
/// Default for pairs kept; beyond it the state is `unknown` and so is each body concerned.
pub const PAIRS_DEFAULT: usize = 1 << 22;
/// Most rows of `pairs`, `contacts` or `regions` that a scene may ask for, and that a client takes.
pub const ROWS_MAX: usize = 1 << 24;
/// Default for rows of `pairs`; beyond it rows are left out by rank and counted.
pub const PAIR_ROWS_DEFAULT: usize = 1 << 16;
/// Default for rows of `contacts`.
pub const CONTACT_ROWS_DEFAULT: usize = 1 << 16;
/// Default for rows of `regions`; beyond it whole pairs are left out by rank and counted.
pub const REGION_ROWS_DEFAULT: usize = 1 << 14;
/// Regions of one body pair: what a response can take in at a glance; more are taken together.
pub const REGIONS_PER_PAIR_MAX: usize = 8;
/// Pairs of boxes that are looked at for the regions of one shape pair within the budget, some 0.5 us each; where there
/// are more, the roots are split instead.
pub const REGION_LOOKS_MAX: usize = 4096;
/// Shape pairs that are looked at for the regions of one body pair; of more only the bodies' boxes are.
pub const REGION_SHAPE_PAIRS_MAX: usize = 256;
/// Tests spent on the regions of one pair in one tick, some 1 us each, out of the budget. At a quarter of the work the
/// median radius is 24 % of the diameter with none, 14 % with 16, 9 % with 64 (`benches/time_critical`).
pub const REGION_TESTS_PER_PAIR: u32 = 64;
/// Pairs of boxes that publishing looks at for the regions of one shape pair that the budget did not reach, some 0.5 us
/// each; where a front has more, the regions are those of its roots. Part of the floor.
pub const REGION_LOOKS_FREE: usize = 64;
/// The same for all pairs of one tick, shared by them: some 1 ms at most.
pub const REGION_LOOKS_PER_TICK: usize = 1 << 11;
/// Contact points of one manifold: of two convex shapes, or of one flat patch of meshes.
pub const MANIFOLD_POINTS_MAX: usize = 4;
/// Contacts of one body pair, unless the scene says another number: one manifold's.
pub const CONTACTS_PER_PAIR_DEFAULT: usize = MANIFOLD_POINTS_MAX;
/// Contacts of one body pair, deepest first.
pub const CONTACTS_PER_PAIR_MAX: usize = 16;
/// Transforms in one frame; more are refused as `over_limit`.
pub const FRAME_ROWS_MAX: usize = BODIES_MAX;
/// Vertex messages of one source that wait for their tick, and as many that wait for the scene; beyond it the oldest
/// go, and what the source has bent is unknown until all of its vertices come again.
pub const VERTEX_FRAMES_WAITING_MAX: usize = 1024;
/// Vertices of one source that wait for their tick, in all of its messages: as many as its queue in shared memory
/// holds.
pub const VERTEX_ROWS_WAITING_MAX: usize = 64 * DEFORMING_VERTICES_MAX;
/// Most frames of one source that wait for a scene revision, and most that wait for their tick if each makes one or is
/// part of a body's path. Beyond it, and beyond `FRAME_ROWS_MAX` rows of all of them, the oldest are dropped.
pub const FRAMES_WAITING_MAX: usize = 1024;
/// Frames of one source that wait whatever their size is. Where they are parts of nothing, those beyond it are folded
/// into one, or the oldest go; so they do of one that is to be refused, and of those that wait for the ROS 2 node.
pub const FRAMES_PER_DRAIN_MAX: usize = 64;
/// Largest coordinate of a pose, metres: beyond it f64 has a spacing of 0.1 mm and no contact means anything.
pub const COORDINATE_MAX_M: f64 = 1e12;
/// Longest ray, and how far one goes where nothing is said, metres: nothing but a half-space is farther from any place,
/// and two corners of all that there may be are `2 sqrt(3)` times the largest coordinate apart.
pub const RAY_MAX_M: f64 = 4.0 * COORDINATE_MAX_M;
/// Largest extent of a shape, metres.
pub const EXTENT_MAX_M: f64 = 1e9;
/// Smallest extent of a shape, metres; a capsule's half height may be 0.
pub const EXTENT_MIN_M: f64 = 1e-9;
/// Largest deviation of a frame quaternion's length from 1; beyond it the sender means something else.
pub const QUATERNION_NORM_TOLERANCE: f64 = 1e-2;
/// Least and greatest `priority` of a body. Their ratio bounds how long a pair can be passed over for others.
pub const PRIORITY_MIN: f64 = 0.01;
/// See [`PRIORITY_MIN`].
pub const PRIORITY_MAX: f64 = 100.0;
/// Greatest `weight` of a viewpoint, for the same reason.
pub const VIEW_WEIGHT_MAX: f64 = 100.0;
/// Poses between two ticks that the path of a continuous body follows; beyond it only its box knows of them, and its
/// pairs are told as open. More than one comes where a tick takes longer than a frame, or ticks come at a rate of their
/// own: a simulator of 1,000 frames a second has 17 between two of 60 ticks.
pub const LEGS_MAX: usize = 32;
/// Whole turns between two poses that a declared angular velocity may add; beyond it a pair is told as open. A drill at
/// 100,000 turns a minute makes 1667 in a second.
pub const LEG_TURNS_MAX: f64 = 4096.0;
/// Looks at a pair in a sweep; a pair that would not come to its end with so many is told as open, whatever time is
/// left. A touch takes 5 to 40, each turn close beside something some tens; a look takes microseconds, at a mesh up to
/// milliseconds. What has a budget is cut off by that before: this is the end of what has none.
pub const SWEEP_LOOKS_MAX: u32 = 16_384;
/// Fewest ticks a second of mode `rate`, hertz: one in a quarter of an hour.
pub const RATE_HZ_MIN: f64 = 1e-3;
/// Most of them, hertz: beyond it a tick has no time for its floor.
pub const RATE_HZ_MAX: f64 = 1e5;
/// Default heartbeat, milliseconds.
pub const HEARTBEAT_MS_DEFAULT: u64 = 100;
/// How long a round of `on_all` waits for the sources still silent after its first frame by default, milliseconds.
pub const LATE_MS_DEFAULT: u64 = 5;
/// Beyond this reach a body that is too old makes no new pairs by default, metres.
pub const STALE_REACH_M_DEFAULT: f64 = 1.0;
/// Default spin of a wait before it sleeps, microseconds: a wake-up costs 10 to 25, so a peer that answers within this
/// is heard sooner; longer, and a source at 1 kHz would cost the daemon more than 5 % of a core.
pub const SPIN_US_DEFAULT: u64 = 50;
/// Default time-out of a source, milliseconds.
pub const TIMEOUT_MS_DEFAULT: u64 = 500;
/// Files that a daemon must be allowed to open: it has some 80 open from its start on.
pub const OPEN_FILES_LEAST: u64 = 96;
/// Bytes that a file of a daemon must be allowed to have: the memory for answers is some 24 MiB from its start on.
pub const FILE_BYTES_LEAST: u64 = 32 << 20;
/// Bytes of address space that a daemon must be allowed to have: it maps some 90 MiB of shared memory and the stacks
/// and heaps of its threads at its start, and uses little of it.
pub const ADDRESS_BYTES_LEAST: u64 = 192 << 20;
/// Bytes of shared memory that must be free where a daemon starts: its ports take some 280 KiB before any message.
pub const SHARED_BYTES_LEAST: u64 = 512 << 10;
/// Bytes of shared memory that must be free where a client connects.
pub const SHARED_BYTES_A_CLIENT: u64 = 256 << 10;
/// Files that a ROS 2 node takes beside its daemon's: sockets of DDS, and some for each writer and reader.
pub const ROS_FILES: u64 = 200;
/// Files that it takes for each topic of a body.
pub const ROS_FILES_A_TOPIC: u64 = 4;
/// Files that a client takes of a daemon: 7 or 8 where it listens to some messages or sends poses, twice as many where
/// it does all that there is.
pub const FILES_A_CLIENT: u64 = 8;
/// Files that a process must be allowed to open beside those that it has, to be a client: `monitor` opens 42, `record`
/// 49, one that listens to everything and sends some 80.
pub const CLIENT_FILES_LEAST: u64 = 56;
/// Bytes of an answer of a ROS 2 service, its CDR head among them: `RustDDS` takes larger ones apart, and those arrive
/// nowhere (`transport/ros2/reply`). It does so above the least MTU of the networks that lead to its readers less 128;
/// that of IPv6, which VPNs have too, is 1280.
pub const ROS_REPLY_BYTES_MAX: usize = 1280 - 128;
/// Bytes of a text in an answer of a ROS 2 service that is too large: room for the others.
pub const ROS_REPLY_TEXT_BYTES_MAX: usize = 512;
/// Bytes of one scene edit request.
pub const REQUEST_BYTES_MAX: usize = 1 << 29;
/// Remembered sessions that are over, per daemon; beyond it the oldest is forgotten, and its client could come back.
pub const SESSIONS_OVER_MAX: usize = 1024;
/// Rows of an answer to what touches a body: the bodies are copied between two ticks, and told in some 2 MB of JSON.
/// Beyond it those with the farthest boxes are left out, counted, and the answer is not complete.
pub const TOUCHING_ROWS_MAX: usize = 1 << 12;
/// Bodies whose boxes one ray passes; beyond it those that begin farthest are left out, which is told where the ray is
/// not stopped before.
pub const RAY_BODIES_MAX: usize = 1 << 12;
/// Names of bodies with unknown places in one answer; the others are counted.
pub const UNKNOWN_ROWS_MAX: usize = 256;
/// Bytes that wait for the thread that records; beyond it the disk does not follow and the recording ends, the daemon
/// goes on. A tick of 1,000 bodies takes some 100 kB.
pub const RECORD_QUEUE_BYTES_MAX: usize = 1 << 26;
/// The same of what edits came with, which is large and seldom, and in memory anyway while they are done: two of the
/// largest requests.
pub const RECORD_EDIT_BYTES_MAX: usize = 2 * REQUEST_BYTES_MAX;

const _: () = {
    assert!(BODIES_MAX < u32::MAX as usize);
    assert!(PAIRS_DEFAULT < u32::MAX as usize);
    assert!(CONTACTS_PER_PAIR_MAX >= MANIFOLD_POINTS_MAX);
    assert!(SOURCES_MAX <= 255);
    assert!(FRAMES_PER_DRAIN_MAX < FRAMES_WAITING_MAX);
    assert!(ROS_REPLY_TEXT_BYTES_MAX < ROS_REPLY_BYTES_MAX / 2);
    assert!(RAY_MAX_M > 3.5 * (COORDINATE_MAX_M + EXTENT_MAX_M));
};
