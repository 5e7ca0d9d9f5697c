//! The pairs of shapes of two bodies at one pose, nearest boxes first: for queries on demand, which keep nothing.

use crate::math::Pose;
use crate::narrow::cover::lanes;
use crate::narrow::mesh::Placed;
use crate::shape::{BoxId, Held};
use crate::world::Body;

use super::side::{Side, children, gaps, placed, roots};

/// Pairs of boxes that wait, each with a lower bound on its gap, metres; its memory is reused from walk to walk.
#[derive(Debug, Default)]
pub(in crate::narrow) struct Waiting(Vec<(f64, BoxId, BoxId)>);

/// A walk over the pairs of shapes.
pub(in crate::narrow) struct PairWalk<'a, 'w> {
    a: Side<'a>,
    b: Side<'a>,
    at: Placed,
    waiting: &'w mut Waiting,
}

impl<'a, 'w> PairWalk<'a, 'w> {
    /// * `rel` - pose of B seen from A.
    pub(in crate::narrow) fn new(
        (a, b): (&'a Body, &'a Body),
        rel: &Pose,
        waiting: &'w mut Waiting,
    ) -> Self {
        let (a, b) = (Side::of(a), Side::of(b));
        waiting.0.clear();
        let pairs = roots(&a, &b).map(|(of_a, of_b)| (f64::NEG_INFINITY, of_a, of_b));
        waiting.0.extend(pairs);
        let at = placed(&a, &b, rel);
        Self { a, b, at, waiting }
    }

    /// The places of the next two shapes; `None`: there are no more, or a test was refused.
    ///
    /// * `test` - called before each test of a box against a pack: false refuses it.
    /// * `worth` - whether a pair with this lower bound on its gap is to be opened, metres; zero or less: it may touch.
    pub(in crate::narrow) fn next(
        &mut self,
        mut test: impl FnMut() -> bool,
        worth: impl Fn(f64) -> bool,
    ) -> Option<(u32, u32)> {
        let (a, b) = (&self.a, &self.b);
        loop {
            let (low, id_a, id_b) = self.waiting.0.pop()?;
            if !worth(low) {
                continue;
            }
            if let (Held::Triangle(i), Held::Triangle(j)) = (a.held(id_a), b.held(id_b)) {
                return Some((i, j));
            }
            if !test() {
                return None;
            }
            let group = children((a, id_a), (b, id_b));
            let gaps = gaps(&group, (a, b), &self.at);
            let from = self.waiting.0.len();
            for lane in lanes(group.mask) {
                let (of_a, of_b) = group.pair(lane);
                self.waiting.0.push((gaps[lane as usize], of_a, of_b));
            }
            // The nearest on top.
            self.waiting.0[from..].sort_unstable_by(|x, y| y.0.total_cmp(&x.0));
        }
    }
}
