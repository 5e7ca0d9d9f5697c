//! Counts in texts for people. In: a count, the word for one and for many. Out: the count with its word. Pure.

use std::fmt::Display;

/// So many of something, with the word that goes with the count.
pub(crate) fn counted(
    count: impl Display + PartialEq + From<u8> + Copy,
    one: &str,
    many: &str,
) -> String {
    let word = if count == 1.into() { one } else { many };
    format!("{count} {word}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_has_a_word_of_its_own() {
        let told = [0_u64, 1, 2].map(|count| counted(count, "body", "bodies"));
        assert_eq!(told, ["0 bodies", "1 body", "2 bodies"]);
    }
}
