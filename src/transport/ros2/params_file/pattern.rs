//! Patterns of node names in files of parameters. In: the parts of a pattern and of a name. Out: whether they match.

/// Whether a pattern matches a name: `*` matches one part of the name, `**` any number of parts.
///
/// Cost: O(parts of the pattern * parts of the name): where a part fails, the last `**` before it takes one part more;
/// an earlier `**` need not, since the last one can take those parts too.
pub(super) fn matches(pattern: &[&str], name: &[&str]) -> bool {
    let (mut part, mut own) = (0, 0);
    // Behind the last `**`, and how far it reaches.
    let mut last: Option<(usize, usize)> = None;
    while own < name.len() {
        match pattern.get(part) {
            Some(&"**") => {
                part += 1;
                last = Some((part, own));
            }
            Some(one) if *one == "*" || *one == name[own] => (part, own) = (part + 1, own + 1),
            _ => {
                let Some((behind, reach)) = last else {
                    return false;
                };
                last = Some((behind, reach + 1));
                (part, own) = (behind, reach + 1);
            }
        }
    }
    pattern[part..].iter().all(|one| *one == "**")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `matches`, by trying every length for each `**`.
    fn matches_by_trying(pattern: &[&str], name: &[&str]) -> bool {
        match (pattern, name) {
            ([], []) => true,
            (["**", rest @ ..], _) => {
                (0..=name.len()).any(|at| matches_by_trying(rest, &name[at..]))
            }
            ([one, rest @ ..], [own, others @ ..]) => {
                (*one == "*" || one == own) && matches_by_trying(rest, others)
            }
            _ => false,
        }
    }

    #[test]
    fn patterns_of_nodes_match_what_trying_every_length_matches() {
        let (parts, names) = (["**", "*", "a", "b"], ["a", "b"]);
        let digits = |mut number: usize, base: usize, len: usize| {
            let digit = move |_| {
                let digit = number % base;
                number /= base;
                digit
            };
            (0..len).map(digit).collect::<Vec<_>>()
        };
        for pattern_len in 0..6_u32 {
            for pattern in 0..4_usize.pow(pattern_len) {
                let pattern = digits(pattern, 4, pattern_len as usize);
                let pattern: Vec<&str> = pattern.iter().map(|at| parts[*at]).collect();
                for name_len in 0..5_u32 {
                    for name in 0..2_usize.pow(name_len) {
                        let name = digits(name, 2, name_len as usize);
                        let name: Vec<&str> = name.iter().map(|at| names[*at]).collect();
                        let wanted = matches_by_trying(&pattern, &name);
                        assert_eq!(matches(&pattern, &name), wanted, "{pattern:?} {name:?}");
                    }
                }
            }
        }
        // It took time without end, and the stack.
        let many = [vec!["**"; 100_000], vec!["x"]].concat();
        assert!(!matches(&many, &["a"; 30]));
    }
}
