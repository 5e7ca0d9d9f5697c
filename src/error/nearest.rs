//! The word that was meant, for texts that say what to change. In: a word, the known ones. Out: the nearest. Pure.

/// Names of bodies that a missing one is compared with at most: a tenth of a millisecond or so each thousand.
pub(crate) const NAMES_COMPARED_MAX: usize = 4096;

/// The known word that differs least from `word`, if it is near enough to be meant.
pub(crate) fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let mut edits = Edits::of(word);
    let mut best: Option<(usize, &str)> = None;
    for &candidate in known {
        let most = match best {
            Some((0, _)) => break,
            Some((least, _)) => least - 1,
            None => usize::MAX,
        };
        // Something of it must be left, or "b" would mean "a".
        let near = (1 + candidate.len() / 4).min(candidate.len().saturating_sub(1));
        if let Some(distance) = edits.to(candidate, most.min(near)) {
            best = Some((distance, candidate));
        }
    }
    // "bodies" is more than two edits from "body".
    let is_singular = |candidate: &&&str| {
        let stem = word.strip_suffix("ies");
        stem.is_some() && candidate.strip_suffix('y') == stem
    };
    // A word cut short or run on ("pos", "half_extents_m") is meant too.
    let is_part = |candidate: &&&str| {
        word.len() >= 3 && (candidate.starts_with(word) || word.starts_with(**candidate))
    };
    match best {
        Some((_, found)) => Some(found),
        None => {
            let mut known = known.iter();
            let singular = known.clone().find(is_singular);
            singular.or_else(|| known.find(is_part)).copied()
        }
    }
}

/// How many letters of a word have to be put in, taken out, changed or swapped with their neighbour to make another.
struct Edits {
    word: Vec<char>,
    other: Vec<char>,
    /// The newest rows of the table of distances between beginnings of both; kept, so that none is allocated a word.
    before_last: Vec<usize>,
    last: Vec<usize>,
    row: Vec<usize>,
}

impl Edits {
    fn of(word: &str) -> Self {
        Self {
            word: word.chars().take(64).collect(),
            other: Vec::new(),
            before_last: Vec::new(),
            last: Vec::new(),
            row: Vec::new(),
        }
    }

    /// The edits to another word; `None`: more than `most`.
    fn to(&mut self, other: &str, most: usize) -> Option<usize> {
        self.other.clear();
        self.other.extend(other.chars());
        let (a, b) = (&self.word, &self.other);
        if a.len().abs_diff(b.len()) > most {
            return None;
        }
        for row in [&mut self.before_last, &mut self.last, &mut self.row] {
            row.clear();
            row.extend(0..=b.len());
        }
        let mut least_of_last = 0;
        for i in 1..=a.len() {
            self.row[0] = i;
            for j in 1..=b.len() {
                let same = usize::from(a[i - 1] != b[j - 1]);
                let (last, row) = (&self.last, &mut self.row);
                row[j] = (last[j - 1] + same).min(last[j] + 1).min(row[j - 1] + 1);
                if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                    row[j] = row[j].min(self.before_last[j - 2] + 1);
                }
            }
            // What comes is made of the newest two rows, and is no less than the least there.
            let least = self.row.iter().copied().min().unwrap_or(0);
            if least > most && least_of_last > most {
                return None;
            }
            least_of_last = least;
            std::mem::swap(&mut self.before_last, &mut self.last);
            std::mem::swap(&mut self.last, &mut self.row);
        }
        Some(self.last[b.len()]).filter(|distance| *distance <= most)
    }
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
        assert_eq!(nearest("bodies", &["source", "body"]), Some("body"));
        assert_eq!(nearest("colour", known), None);
        assert_eq!(nearest("", known), None);
        assert_eq!(nearest("b", &["a", "c"]), None);
        assert_eq!(nearest("ab", &["a", "ba"]), Some("ba"));
    }

    #[test]
    fn what_is_farther_than_the_limit_is_left_and_nothing_nearer() {
        let words = [
            "", "a", "ab", "ba", "abc", "acb", "cab", "bca", "aabbcc", "ccbbaa",
        ];
        for word in words {
            let mut edits = Edits::of(word);
            for other in words {
                let whole = edits.to(other, usize::MAX).unwrap();
                for most in 0..8 {
                    let within = edits.to(other, most);
                    assert_eq!(within, Some(whole).filter(|d| *d <= most), "{word} {other}");
                }
                assert_eq!(Edits::of(other).to(word, usize::MAX), Some(whole));
            }
        }
        assert_eq!(Edits::of("abcd").to("acbd", 9), Some(1));
        assert_eq!(Edits::of("kitten").to("sitting", 9), Some(3));
    }
}
