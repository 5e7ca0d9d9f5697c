//! Reads the viewpoint of a scene.

use std::f64::consts::PI;

use crate::config::Viewpoint;
use crate::limits::{COORDINATE_MAX_M, EXTENT_MAX_M, EXTENT_MIN_M, VIEW_WEIGHT_MAX};
use crate::math::Vec3;
use crate::scene::node::{Fault, Node};
use crate::scene::read_body::BODY_NAME_BYTES_MAX;
use crate::scene::table::{Table, mend_name, shortened};

/// Default factor on the weight of what is in view.
const WEIGHT_DEFAULT: f64 = 4.0;
/// Default half-angle of the view, radians: 60 degrees in total.
const HALF_ANGLE_RAD_DEFAULT: f64 = PI / 6.0;
/// Least half-angle, radians: a narrower view contains only what surrounds the eye.
const HALF_ANGLE_RAD_MIN: f64 = 1e-3;

/// Reads `[viewpoint]`.
///
/// * `bodies` - names of the scene's bodies.
pub(crate) fn read_viewpoint(node: Node, bodies: &[&str]) -> Result<Viewpoint, Fault> {
    let keys = &[
        "body",
        "position",
        "direction",
        "half_angle_rad",
        "weight",
        "half_m",
    ];
    let mut table = Table::open(node, "[viewpoint]", keys)?;
    let at = table.at("body");
    let body = table.name("body", BODY_NAME_BYTES_MAX)?;
    if let Some(name) = body.as_deref().filter(|name| !bodies.contains(name)) {
        let text = format!(
            "the viewpoint is on body \"{}\", which is not there: {}",
            shortened(name),
            mend_name(name, bodies, "[[body]]")
        );
        return Err(Fault::new(at, text));
    }
    let at = table.at("position");
    let position = table.triple("position")?.unwrap_or_default();
    if position.iter().any(|x| x.abs() > COORDINATE_MAX_M) {
        let text =
            format!("position is beyond {COORDINATE_MAX_M} m: move the scene's origin nearer");
        return Err(Fault::new(at, text));
    }
    let at = table.at("direction");
    let direction = Vec3::from(table.triple("direction")?.unwrap_or([1.0, 0.0, 0.0]));
    let largest = direction.amax();
    if largest == 0.0 {
        let text = "direction of the viewpoint has no length: write where it looks, as [1, 0, 0]";
        return Err(Fault::new(at, text));
    }
    // Scaled by its largest component first: the square of 1e200 overflows and that of 1e-200 underflows.
    let direction = (direction / largest).normalize();
    let half_angle_rad = table.number_within("half_angle_rad", HALF_ANGLE_RAD_MIN, PI)?;
    let weight = table.number_within("weight", 1.0, VIEW_WEIGHT_MAX)?;
    Ok(Viewpoint {
        body,
        position,
        direction: direction.into(),
        half_angle_rad: half_angle_rad.unwrap_or(HALF_ANGLE_RAD_DEFAULT),
        weight: weight.unwrap_or(WEIGHT_DEFAULT),
        half_m: table.number_within("half_m", EXTENT_MIN_M, EXTENT_MAX_M)?,
    })
}
