//! The row of `regions`: where a pair may touch, when there was no time to find out or to find all of it.

use iceoryx2::prelude::ZeroCopySend;

/// One place where a pair may touch. The union of a pair's regions holds every point that the two share; of two convex
/// shapes with `COMPLETE` the points of the contacts alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Region")]
pub struct RegionRow {
    /// Smaller body id.
    pub body_a: u64,
    /// Larger body id.
    pub body_b: u64,
    /// Centre of the sphere, scene frame, metres.
    pub centre: [f64; 3],
    /// Its radius, metres; infinity: the place of a body is not known.
    pub radius_m: f64,
    /// Axis of the cone of normals, from A to B, unit, scene frame.
    pub cone_axis: [f64; 3],
    /// Half angle of that cone, radians; pi: any direction.
    pub cone_half_angle_rad: f64,
    /// Best guess of a point of contact, scene frame, metres.
    pub point: [f64; 3],
    /// Best guess of the normal there, from A to B, unit, scene frame.
    pub normal: [f64; 3],
    /// Best guess of the depth there, metres, not below 0.
    pub depth_m: f64,
    /// `region_flags`.
    pub flags: u32,
    /// Place among the pair's regions, from 0.
    pub index: u8,
    /// How many regions the pair has.
    pub count: u8,
    /// `Level` reached; boxes: no more than the bodies' boxes is behind it.
    pub level: u8,
    /// Zero.
    pub reserved: u8,
}

// The layout is a promise: a change here is a new wire version.
const _: () = assert!(size_of::<RegionRow>() == 144);
