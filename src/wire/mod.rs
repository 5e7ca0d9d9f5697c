//! What crosses a wall: the rows of every message, their codes, and the two boxes (`Inbox`, `Outbox`) that the
//! engine is handed and hands back. `msgs/` holds the same layouts for other languages; `tests/wire_layout.rs`
//! compares them.

mod answers;
mod changes;
mod codes;
mod frame;
mod mend;
mod outbox;
mod region;
mod request;
#[cfg(any(feature = "ros2", feature = "mcap"))]
pub mod ros;
mod rows;
mod tick;
mod vertices;

pub use answers::{
    GapFound, GapKnown, ImpactFound, RayFound, TouchingFound, TouchingRow, UnknownBody,
};
pub use changes::ChangesHeader;
pub use codes::{
    BodyStatus, BroadCause, BroadMode, ContactKind, EndCause, Event, Level, Reason, RejectReason,
    Stage, State, TickCause, Verdict, contact_flags, frame_flags, pair_flags, region_flags,
    vertex_flags,
};
pub use frame::{Frame, Inbox, name_bytes, name_str};
pub use outbox::{Demand, Outbox, Undelivered};
pub use region::RegionRow;
pub use request::{Answer, AnswerHeader, RequestHeader};
pub use rows::{
    BODY_NAME_LEN, BodyRow, ContactRow, FrameHeader, Hello, MessageHeader, NameRow, PairRow,
    SOURCE_NAME_LEN, SOURCES_MAX, TransformRow, TransformVelRow,
};
pub use tick::{REJECTS_LEN, STAGES_LEN, SourceRow, TickRow};
pub use vertices::{VertexFrame, VertexHeader, VertexRow};

/// Version of every layout here; it stands in service names and type names, and in each header.
pub const WIRE_VERSION: u32 = 1;
/// No sub-shape: a contact of a shape that has no triangles.
pub const NO_INDEX: u32 = u32::MAX;
