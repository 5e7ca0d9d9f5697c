//! Names and patterns: `*` matches any run of characters (also an empty one), `?` exactly one.

/// Whether `name` matches `pattern`; case matters, and without `*` and `?` it is equality.
///
/// Cost: O(pattern + name) for one `*`, O(pattern x name) at worst; no allocation.
///
/// Source: the greedy match with one point of return, as in Krauss 2008, "Matching wildcards: an algorithm".
#[must_use]
pub fn pattern_matches(pattern: &str, name: &str) -> bool {
    let (mut pattern, mut name) = (pattern.chars(), name.chars());
    // Where to continue after a mismatch: after the last `*`, which then matches one more character.
    let mut point_of_return = None;
    loop {
        let name_here = name.clone();
        match (pattern.next(), name.next()) {
            (Some('*'), _) => {
                point_of_return = Some((pattern.clone(), name_here.clone()));
                name = name_here;
            }
            (None, None) => return true,
            (Some('?'), Some(_)) => {}
            (Some(wanted), Some(given)) if wanted == given => {}
            _ => {
                let Some((after_star, mut rest)) = point_of_return.take() else {
                    return false;
                };
                if rest.next().is_none() {
                    return false;
                }
                (pattern, name) = (after_star.clone(), rest.clone());
                point_of_return = Some((after_star, rest));
            }
        }
    }
}

/// The literal characters that every match begins with, and those that it ends with.
pub(crate) fn literal_ends(pattern: &str) -> (&str, &str) {
    let mut head = pattern.split(['*', '?']);
    let mut tail = pattern.rsplit(['*', '?']);
    (head.next().unwrap_or(""), tail.next().unwrap_or(""))
}

/// Whether a pattern has a `*` or `?`, and so may match more than one name.
#[must_use]
pub fn is_pattern(text: &str) -> bool {
    text.contains(['*', '?'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_name_matches_itself_only() {
        assert!(pattern_matches("arm", "arm"));
        assert!(!pattern_matches("arm", "arm2"));
        assert!(!pattern_matches("arm", "Arm"));
        assert!(pattern_matches("", ""));
        assert!(!pattern_matches("", "a"));
    }

    #[test]
    fn stars_and_question_marks_match_runs_and_single_characters() {
        for (pattern, name, wanted) in [
            ("*", "", true),
            ("*", "anything", true),
            ("arm*", "arm", true),
            ("arm*", "arm_link_3", true),
            ("*_link", "arm_link", true),
            ("*_link", "arm_link_3", false),
            ("a*b*c", "a__b__b__c", true),
            ("a*b*c", "a__c__b", false),
            ("link?", "link7", true),
            ("link?", "link", false),
            ("link?", "link77", false),
            ("?*", "", false),
            ("*?", "ü", true),
            ("ü?", "üß", true),
            ("a**b", "ab", true),
        ] {
            assert_eq!(pattern_matches(pattern, name), wanted, "{pattern} {name}");
        }
    }

    #[test]
    fn a_match_agrees_with_a_plain_recursive_twin() {
        fn twin(pattern: &[u8], name: &[u8]) -> bool {
            match (pattern.split_first(), name.split_first()) {
                (None, None) => true,
                (Some((b'*', rest)), None) => twin(rest, name),
                (Some((b'*', rest)), Some((_, tail))) => twin(rest, name) || twin(pattern, tail),
                (Some((b'?', rest)), Some((_, tail))) => twin(rest, tail),
                (Some((p, rest)), Some((n, tail))) => p == n && twin(rest, tail),
                _ => false,
            }
        }
        // Every pattern of up to 4 letters against every name of up to 4.
        let words = |letters: &[u8]| -> Vec<Vec<u8>> {
            let mut all = vec![vec![]];
            let mut from = 0;
            for _ in 0..4 {
                let to = all.len();
                for k in from..to {
                    for letter in letters {
                        let mut word = all[k].clone();
                        word.push(*letter);
                        all.push(word);
                    }
                }
                from = to;
            }
            all
        };
        for pattern in words(b"ab*?") {
            for name in words(b"ab") {
                let (p, n) = (
                    std::str::from_utf8(&pattern).unwrap(),
                    std::str::from_utf8(&name).unwrap(),
                );
                assert_eq!(pattern_matches(p, n), twin(&pattern, &name), "{p} {n}");
            }
        }
    }
}
