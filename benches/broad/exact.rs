//! The exact set of overlapping boxes, by a method that no measured broad phase uses: strips along y, in each a sweep
//! along x.

use super::scenes::Box3;

/// A pair, the smaller index first.
pub type Pair = (u32, u32);

pub fn overlap(a: &Box3, b: &Box3) -> bool {
    (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k])
}

/// All pairs of overlapping boxes, sorted.
pub fn pairs(boxes: &[Box3]) -> Vec<Pair> {
    let low = boxes.iter().map(|b| b[0][1]).fold(f32::INFINITY, f32::min);
    let high = boxes
        .iter()
        .map(|b| b[0][1])
        .fold(f32::NEG_INFINITY, f32::max);
    let strips = (boxes.len() / 500).clamp(1, 400);
    let width = ((high - low) / strips as f32).max(f32::MIN_POSITIVE);
    let strip = |y: f32| (((y - low) / width).max(0.0) as usize).min(strips - 1);
    let mut of_strip: Vec<Vec<u32>> = vec![Vec::new(); strips];
    for (i, b) in boxes.iter().enumerate() {
        for list in &mut of_strip[strip(b[0][1])..=strip(b[1][1])] {
            list.push(i as u32);
        }
    }
    let mut found = Vec::new();
    for (at, list) in of_strip.iter_mut().enumerate() {
        list.sort_by(|a, b| boxes[*a as usize][0][0].total_cmp(&boxes[*b as usize][0][0]));
        for (place, &i) in list.iter().enumerate() {
            let a = &boxes[i as usize];
            for &j in &list[place + 1..] {
                let b = &boxes[j as usize];
                if b[0][0] > a[1][0] {
                    break;
                }
                // A pair can share several strips; it is recorded only in the one that contains the greater of the two
                // lower y bounds.
                if strip(a[0][1].max(b[0][1])) == at && overlap(a, b) {
                    found.push((i.min(j), i.max(j)));
                }
            }
        }
    }
    found.sort_unstable();
    found
}
