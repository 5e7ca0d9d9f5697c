//! Families of cases, each swept along one parameter over many decades.

mod angles;
mod kinds;
mod meshes;
mod motion;
mod overlaps;
mod sizes;

use super::stage::Case;

/// A family.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// Its name for `--family`.
    pub name: &'static str,
    /// What is stiff or extreme about it.
    pub about: &'static str,
    /// Its parameter, with the unit.
    pub parameter: &'static str,
    /// Its cases, each with its kind and parameter.
    pub cases: fn() -> Vec<Case>,
}

/// All families, in the order of the report.
pub const FAMILIES: &[Family] = &[
    Family {
        name: "far_origin",
        about: "pairs 1 mm apart or 1 mm deep, far from the origin of the scene, up to the largest coordinate admitted",
        parameter: "distance from the origin, m",
        cases: sizes::far_origin,
    },
    Family {
        name: "gap",
        about: "pairs of all kinds nearly touching, still apart",
        parameter: "gap, m (sizes 0.2 to 1 m)",
        cases: sizes::gap,
    },
    Family {
        name: "depth",
        about: "the same pairs overlapping by next to nothing",
        parameter: "depth, m (sizes 0.2 to 1 m)",
        cases: sizes::depth,
    },
    Family {
        name: "scale",
        about: "the same pairs from micrometres to a thousand kilometres, gap and depth 1/1000 of the size",
        parameter: "size, m",
        cases: sizes::scale,
    },
    Family {
        name: "size_ratio",
        about: "a small body at a body of 10 km, down to 1 um",
        parameter: "ratio of the sizes",
        cases: sizes::size_ratio,
    },
    Family {
        name: "quaternion",
        about: "orientations that are not of length 1, up to what admission takes",
        parameter: "| length of the quaternion - 1 |",
        cases: sizes::quaternion,
    },
    Family {
        name: "parallel",
        about: "edges, faces and axes that are nearly parallel",
        parameter: "angle, rad",
        cases: angles::parallel,
    },
    Family {
        name: "slivers",
        about: "needles, slivers and discs beside bodies of 1 m",
        parameter: "aspect ratio",
        cases: angles::slivers,
    },
    Family {
        name: "peg",
        about: "a peg in its hole, a wheel on its axle: axes that nearly coincide",
        parameter: "angle between the axes, rad",
        cases: angles::peg,
    },
    Family {
        name: "coincident",
        about: "faces, edges, corners and whole bodies that coincide exactly: the gap is 0, or the least way out",
        parameter: "size, m",
        cases: overlaps::coincident,
    },
    Family {
        name: "nested",
        about: "one body wholly within another",
        parameter: "ratio of the sizes",
        cases: overlaps::nested,
    },
    Family {
        name: "deep",
        about: "bodies whose middles nearly coincide, down to denormal distances",
        parameter: "distance of the middles, m",
        cases: overlaps::deep,
    },
    Family {
        name: "denormals",
        about: "corners above a face by less than f64 can tell from 0 at their size",
        parameter: "gap, m",
        cases: overlaps::denormals,
    },
    Family {
        name: "mesh_slivers",
        about: "solid meshes with triangles that are nearly degenerate",
        parameter: "least height of a triangle, m",
        cases: meshes::slivers,
    },
    Family {
        name: "stack",
        about: "eight boxes on a floor, with gaps of next to nothing between them",
        parameter: "gap, m",
        cases: motion::stack,
    },
    Family {
        name: "spin",
        about: "needles that turn by half a turn and a little in each tick, beside a post",
        parameter: "aspect ratio",
        cases: motion::spin,
    },
    Family {
        name: "vibration",
        about: "bodies that vibrate about touching in each tick: verdicts are to follow the truth, and to change no more often",
        parameter: "amplitude, m",
        cases: motion::vibration,
    },
    Family {
        name: "bullet",
        about: "bodies that fly through a wall of 1 mm within one tick: the time of impact",
        parameter: "way in one tick, m",
        cases: motion::bullet,
    },
];

/// The family with this name.
#[must_use]
pub fn named(name: &str) -> Option<&'static Family> {
    FAMILIES.iter().find(|family| family.name == name)
}
