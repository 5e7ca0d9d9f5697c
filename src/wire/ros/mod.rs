//! ROS 2 messages as serde structs in field order, which is what CDR carries: `msgs/sweepd_msgs` and the common
//! packages, as far as the node speaks them.
//!
//! `.msg` files are the contract; these structs are kept equal to them by a test. Units and frames stand there.

mod collisions;
mod common;
mod frame_name;
mod seen;
mod services;
mod speak;
mod sweepd;

pub use collisions::{GzContact, GzContacts, GzEntity, JointWrench, Wrench};
pub use common::{
    Clock, Duration, Header, Odometry, Point, Pose, PoseStamped, PoseWithCovariance, Quaternion,
    TfMessage, Time, Transform, TransformStamped, Twist, TwistWithCovariance, Vector3,
};
pub use frame_name::plain_frame;
pub use seen::{
    ColorRgba, DiagnosticArray, DiagnosticStatus, KeyValue, Marker, MarkerArray, MeshFile, Texture,
    UvCoordinate, diagnostic_level, marker_kind,
};
pub use services::{
    AttachBody, Edited, EnableBody, Gap, GapTold, Mesh, MeshTriangle, Point32, PutBody, RemoveBody,
    Reset, SetFilter, SolidPrimitive, TickNow, Ticked,
};
pub use speak::{Book, Counts, Speaker, tick_header};
pub use sweepd::{
    BodyTransform, BodyTransforms, Contact, Contacts, Name, Names, Pair, Pairs, Source, State,
    Tick, TickHeader,
};
