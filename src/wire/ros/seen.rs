//! `diagnostic_msgs` and `visualization_msgs`: what people look at.

use serde::{Deserialize, Serialize};

use super::common::{Duration, Header, Point, Pose, Vector3};

/// Values of `DiagnosticStatus::level`.
pub mod diagnostic_level {
    /// All is well.
    pub const OK: u8 = 0;
    /// To be looked at.
    pub const WARN: u8 = 1;
    /// Not to be relied on.
    pub const ERROR: u8 = 2;
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// What.
    pub key: String,
    /// How much.
    pub value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// See [`diagnostic_level`].
    pub level: u8,
    /// Whose.
    pub name: String,
    /// In words.
    pub message: String,
    /// Of which device.
    pub hardware_id: String,
    /// Figures.
    pub values: Vec<KeyValue>,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// When.
    pub header: Header,
    /// Each part of the node.
    pub status: Vec<DiagnosticStatus>,
}

/// Values of `Marker::kind` (`type` in ROS) and `Marker::action`.
pub mod marker_kind {
    /// A box.
    pub const CUBE: i32 = 1;
    /// Lines by pairs of points.
    pub const LINE_LIST: i32 = 5;
    /// A sphere a point.
    pub const SPHERE_LIST: i32 = 7;
    /// Text that faces whoever looks.
    pub const TEXT_VIEW_FACING: i32 = 9;
    /// Action: put it there, or change it.
    pub const ADD: i32 = 0;
}

/// `std_msgs/ColorRGBA`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorRgba {
    /// Red, 0 to 1.
    pub r: f32,
    /// Green, 0 to 1.
    pub g: f32,
    /// Blue, 0 to 1.
    pub b: f32,
    /// Opacity, 0 to 1.
    pub a: f32,
}

/// `visualization_msgs/UVCoordinate`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UvCoordinate {
    /// Across.
    pub u: f32,
    /// Up.
    pub v: f32,
}

/// `visualization_msgs/MeshFile`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshFile {
    /// Its name.
    pub filename: String,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// `sensor_msgs/CompressedImage`, always empty here: a texture.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Texture {
    /// Not used.
    pub header: Header,
    /// Not used.
    pub format: String,
    /// Not used.
    pub data: Vec<u8>,
}

/// `visualization_msgs/Marker`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// When, in which frame.
    pub header: Header,
    /// Layer.
    pub ns: String,
    /// Unique within its layer; stays with what it shows.
    pub id: i32,
    /// See [`marker_kind`].
    #[serde(rename = "type")]
    pub kind: i32,
    /// See [`marker_kind`].
    pub action: i32,
    /// Where.
    pub pose: Pose,
    /// Metres.
    pub scale: Vector3,
    /// Of all of it.
    pub color: ColorRgba,
    /// How long it stays without a new one.
    pub lifetime: Duration,
    /// Whether it moves with its frame.
    pub frame_locked: bool,
    /// Points of lists, metres.
    pub points: Vec<Point>,
    /// A colour a point, or none.
    pub colors: Vec<ColorRgba>,
    /// Not used.
    pub texture_resource: String,
    /// Not used.
    pub texture: Texture,
    /// Not used.
    pub uv_coordinates: Vec<UvCoordinate>,
    /// What a text says.
    pub text: String,
    /// Not used.
    pub mesh_resource: String,
    /// Not used.
    pub mesh_file: MeshFile,
    /// Not used.
    pub mesh_use_embedded_materials: bool,
}

/// `visualization_msgs/MarkerArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// The markers.
    pub markers: Vec<Marker>,
}
