//! The word that was meant, for texts that say what to change. In: a word, the known ones. Out: the nearest. Pure.

/// The known word that differs least from `word`, if it is near enough to be meant.
pub(crate) fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let (distance, found) = known
        .iter()
        .map(|candidate| (edits(word, candidate), *candidate))
        .min_by_key(|(distance, _)| *distance)?;
    let near = distance <= 1 + found.len() / 4;
    // A word cut short or run on ("pos", "half_extents_m") is meant too.
    let is_part = |candidate: &&&str| {
        word.len() >= 3 && (candidate.starts_with(word) || word.starts_with(**candidate))
    };
    if near {
        Some(found)
    } else {
        known.iter().find(is_part).copied()
    }
}

/// How many letters have to be put in, taken out, changed or swapped with their neighbour.
fn edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(64).collect(), b.chars().collect());
    let mut before_last = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let same = usize::from(a[i - 1] != b[j - 1]);
            row[j] = (last[j - 1] + same).min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before_last[j - 2] + 1);
            }
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_key_is_the_one_that_was_meant() {
        let known = &["position", "orientation", "mask", "moves"];
        assert_eq!(nearest("postion", known), Some("position"));
        assert_eq!(nearest("msak", known), Some("mask"));
        assert_eq!(nearest("pos", known), Some("position"));
        assert_eq!(nearest("moves_m", known), Some("moves"));
        assert_eq!(nearest("colour", known), None);
        assert_eq!(nearest("", known), None);
    }
}
