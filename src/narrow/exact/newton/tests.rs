//! Newton's step beside the whole system.

use super::*;
use crate::builtin::Random;
use nalgebra::{DMatrix, DVector};

/// The system of one step, whole: two coordinates, then the change of each weight but the first.
fn whole(set: &Set) -> Option<Vec<f64>> {
    let size = set.count + 1;
    let (mut m, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
    let first = set.actives[0];
    for x in &set.actives[..set.count] {
        let bend = [[x.bend[0], x.bend[1]], [x.bend[1], x.bend[2]]];
        for row in 0..2 {
            for column in 0..2 {
                m[(row, column)] -= x.weight * bend[row][column];
            }
            m[(row, row)] -= x.weight * x.value;
            right[row] -= x.weight * x.slope[row];
        }
    }
    for (j, x) in set.actives[1..set.count].iter().enumerate() {
        for k in 0..2 {
            m[(k, 2 + j)] = x.slope[k] - first.slope[k];
            m[(2 + j, k)] = m[(k, 2 + j)];
        }
        right[2 + j] = first.value - x.value;
    }
    Some(m.lu().solve(&right)?.iter().copied().collect())
}

#[test]
fn a_step_solves_the_whole_system() {
    let mut random = Random::new(7);
    for turn in 0..3000 {
        let mut set = Set {
            count: turn % 3 + 1,
            ..Set::default()
        };
        for x in &mut set.actives {
            x.weight = random.unit();
            x.value = random.range(-1.0, 1.0);
            x.slope = [random.range(-1.0, 1.0), random.range(-1.0, 1.0)];
            let (p, q) = (random.range(-1.0, 1.0), random.range(-1.0, 1.0));
            x.bend = [p * p, p * q, q * q];
        }
        let Some(known) = whole(&set) else { continue };
        let (x, y, change) = step(&set).unwrap();
        let size = known.iter().fold(1.0_f64, |most, v| most.max(v.abs()));
        for (found, known) in [x, y, change[1], change[2]].iter().zip(&known) {
            assert!(
                (found - known).abs() < 1e-9 * size * size,
                "{set:?}: {found} {known}"
            );
        }
        assert!(change.iter().sum::<f64>().abs() < 1e-9 * size);
    }
}
