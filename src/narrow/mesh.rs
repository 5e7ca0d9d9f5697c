//! Mesh pairs as walks over leaves that can stop.
//!
//! In: two shapes of which at least one is a mesh, and the pose of B seen from A. Out: a sound interval of their gap
//! from the start, narrowed by every unit of work, a witness and contacts.
//!
//! Three ways:
//! - [`CarriedFront`] for a pair of single shapes: proofs at one pose are carried to the next (see `carried`);
//! - [`MeshQuery`], a query at one pose that can stop: for bodies of several shapes, and half-spaces. Between two
//!   surfaces it is a front that is not carried on;
//! - [`Walk`], the same over trees of axis-aligned boxes: the reference implementation and baseline of the other two.
//!
//! Before the first two start a search, cheaper tests run: a plane that separates the two shapes (`parting`), inner
//! balls that overlap (`deep`), and for a pair that touched last the triangles that touched and their neighbours
//! (`carried/touch`). If solids are found to touch, and their leaves prove no more than that, further work establishes
//! whether they overlap (`carried/fathom`).
//!
//! In a walk, every pair of triangles is covered by exactly one entry at any time: on the stack (boxes that may touch),
//! in the heap (boxes proved apart by a known distance), or settled (queried, or proved farther than the best distance
//! known). So the least of all entries is a sound lower bound at any interruption. Three stages:
//! 1. `Surfaces`: the stack, depth first and nearest child first, until two leaves touch or none is left.
//! 2. `Inside`: if the surfaces are apart and one of the two is a solid, one point of every connected surface is tested
//!    against the other solid, both ways (law 3.3).
//! 3. `Refine`: the heap, best first, until nothing can be nearer than the best leaf pair.
//!
//! Contacts: `manifold` makes points of two leaves that touch, with the normal of the surface around them; `patches`
//! keeps the deepest and the outermost of each patch as they are found. `narrow/contacts` chooses the four of a patch
//! that are published.
//!
//! Refused: breadth-first order (Hubbard): it confirms contacts last of all; one order for all three stages. Lower ends
//! of overlapping pairs are bounds, not depths: the least overlap of the root boxes along 15 axes, and the largest ball
//! that fits into a root box (see `bound`).

use super::exact::Closest;

mod bound;
mod carried;
mod contacts;
mod containment;
mod deep;
mod front;
mod half_space;
mod lack;
mod lead_out;
mod manifold;
mod parting;
mod patches;
mod placed;
mod query;
mod retest;
mod scan;
mod shared;
mod side;
mod triangle;
mod walk;
mod way;

pub use carried::{CarriedFront, FrontStore, Search, has_front};
pub use contacts::{LEAF_CONTACTS_MAX, LeafContact};
pub use deep::overlap;
pub(in crate::narrow) use lead_out::lead_out;
pub use parting::parted;
pub use patches::{PATCH_POINTS, PATCHES_MAX, numbered};
pub(in crate::narrow) use placed::Placed;
pub use query::{Goal, MeshQuery};
pub use retest::retest_witness;
pub(in crate::narrow) use scan::{PlaneScan, Scan, behind};
pub use walk::Walk;

/// The nearest or deepest pair of leaves found so far.
pub type Witness = LeafContact;
