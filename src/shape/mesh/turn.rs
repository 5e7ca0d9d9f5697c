//! Shells that face inwards, turned round (law 3.3).
//!
//! In: a solid's mesh and its shells with their volumes. Out: faces whose order of corners agrees with the solid meant.

use super::topology::{Shell, Topology};
use super::{Inside, Mesh};
use crate::math::Point;

impl Mesh {
    /// Law 3.3: a shell of negative volume that is not wholly within another is turned round with all it holds.
    pub(super) fn turn_shells(&mut self, topology: &Topology) {
        let shells = &topology.shells;
        let mut sign = vec![1.0; shells.len()];
        // The largest first, so that what a turned shell holds is judged as turned.
        let mut order: Vec<usize> = (0..shells.len()).collect();
        order.sort_by(|&a, &b| {
            let size = |i: usize| shells[i].volume.abs();
            size(b).total_cmp(&size(a)).then(a.cmp(&b))
        });
        let mut turned = 0;
        for &i in &order {
            let negative = shells[i].volume * sign[i] < 0.0;
            if !negative || (0..shells.len()).any(|j| self.holds(topology, j, i)) {
                continue;
            }
            turned += 1;
            for (j, sign) in sign.iter_mut().enumerate() {
                if j == i || self.holds(topology, i, j) {
                    *sign = -*sign;
                }
            }
        }
        for (face, &shell) in self.faces.iter_mut().zip(&topology.shell_of) {
            if sign[shell as usize] < 0.0 {
                face.swap(1, 2);
            }
        }
        if turned > 0 {
            self.warnings.push(format!(
                "{turned} of {} shells faced inwards and stood in no other: turned round with all they hold",
                shells.len()
            ));
        }
    }

    /// Whether shell `inner` lies wholly within shell `outer`: every vertex inside, and no vertex the other way.
    ///
    /// Shells that pass through each other with edges alone are taken for held; no reading of them is right.
    fn holds(&self, topology: &Topology, outer: usize, inner: usize) -> bool {
        let (a, b): (&Shell, &Shell) = (&topology.shells[outer], &topology.shells[inner]);
        if outer == inner || !(0..3).all(|k| a.low[k] <= b.low[k] && b.high[k] <= a.high[k]) {
            return false;
        }
        let mut test = Inside::default();
        let mut winds = |point: Point, shell: usize| {
            test.run(self, point, |face| {
                topology.shell_of[face as usize] as usize == shell
            }) != 0
        };
        let corners = |shell: usize| {
            let of = topology.shell_of.iter().zip(&self.faces);
            of.filter(move |(s, _)| **s as usize == shell)
                .flat_map(|(_, face)| face.map(|v| self.vertices[v as usize]))
        };
        // One corner decides most cases.
        winds(self.vertices[b.vertex as usize], outer)
            && corners(inner).all(|p| winds(p, outer))
            && !corners(outer).any(|p| winds(p, inner))
    }
}
