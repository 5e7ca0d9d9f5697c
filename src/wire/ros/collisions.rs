//! `ros_gz_interfaces`: contacts as Gazebo's bridge says them.

use serde::{Deserialize, Serialize};

use super::common::{Header, Vector3};

/// `ros_gz_interfaces/Entity`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GzEntity {
    /// Body id.
    pub id: u64,
    /// Body name.
    pub name: String,
    /// 5: a collision.
    #[serde(rename = "type")]
    pub kind: u8,
}

/// `geometry_msgs/Wrench`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Newton.
    pub force: Vector3,
    /// Newton metres.
    pub torque: Vector3,
}

/// `ros_gz_interfaces/JointWrench`; never sent: this node knows no forces.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointWrench {
    /// When.
    pub header: Header,
    /// `std_msgs/String`.
    pub body_1_name: String,
    /// `std_msgs/UInt32`.
    pub body_1_id: u32,
    /// `std_msgs/String`.
    pub body_2_name: String,
    /// `std_msgs/UInt32`.
    pub body_2_id: u32,
    /// On the first.
    pub body_1_wrench: Wrench,
    /// On the second.
    pub body_2_wrench: Wrench,
}

/// `ros_gz_interfaces/Contact`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GzContact {
    /// A.
    pub collision1: GzEntity,
    /// B.
    pub collision2: GzEntity,
    /// Midway between the points on both surfaces, scene frame, metres.
    pub positions: Vec<Vector3>,
    /// Unit, scene frame, from A to B.
    pub normals: Vec<Vector3>,
    /// Metres, positive where they overlap.
    pub depths: Vec<f64>,
    /// None.
    pub wrenches: Vec<JointWrench>,
}

/// `ros_gz_interfaces/Contacts`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GzContacts {
    /// Oldest pose used, scene frame.
    pub header: Header,
    /// One a pair of bodies.
    pub contacts: Vec<GzContact>,
}
