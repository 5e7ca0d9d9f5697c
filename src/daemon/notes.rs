//! What doors need to know of a body.

use crate::ids::BodyId;
use crate::scene::BodySpec;
use crate::transport::BodyNote;
use crate::world::PlacedShape;

/// What doors need to know about a body.
#[must_use]
pub fn body_note(spec: &BodySpec, id: BodyId, placed: &[PlacedShape]) -> BodyNote {
    BodyNote {
        id: id.0,
        name: spec.name.clone(),
        source: spec.source,
        frame: spec.ros_frame.as_ref().unwrap_or(&spec.name).clone(),
        topic: spec.ros_topic.clone().unwrap_or_default(),
        continuous: spec.continuous,
        attached: spec.attached_to.is_some(),
        bounds: bounds(placed),
    }
}

/// Centre and half extents of a body's box in its own frame; `None`: it is infinite.
fn bounds(placed: &[PlacedShape]) -> Option<([f64; 3], [f64; 3])> {
    let boxes = placed.iter().map(|p| p.shape.aabb_at(&p.pose));
    let whole = boxes.reduce(|a, b| a.merged(&b))?;
    let (centre, half) = (whole.centre(), whole.half_extents());
    let finite = half.iter().all(|x| x.is_finite());
    finite.then(|| ([centre.x, centre.y, centre.z], [half.x, half.y, half.z]))
}
