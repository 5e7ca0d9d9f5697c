//! Names of ROS 2 topics, as far as a scene can tell. In: a name as it is written. Out: whether it can be one; what a
//! node's own name, its namespace and its remaps make of it is the node's matter.

/// A part of a name between slashes.
pub(crate) fn is_token(token: &str) -> bool {
    let mut chars = token.chars();
    let head = chars.next();
    head.is_some_and(|c| c.is_ascii_alphabetic() || c == '_')
        && chars.all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Whether a name may be that of a topic or service: `~/x`, `x` or `/x`.
pub(crate) fn is_topic(name: &str) -> bool {
    let own = name.strip_prefix('~').and_then(|own| own.strip_prefix('/'));
    let inner = own.or_else(|| name.strip_prefix('/')).unwrap_or(name);
    inner.split('/').all(is_token)
}

/// What is said of a name that is none, with the mend.
pub(crate) fn no_topic(name: &str) -> String {
    format!(
        "`{name}` is no name of a topic or service: write letters, digits, _ and / between them, and no digit behind a /"
    )
}

#[cfg(test)]
mod tests {
    use super::is_topic;

    #[test]
    fn names_of_topics_are_known_from_others() {
        for name in ["/p", "p", "~/p", "/a/b_c/_d9", "~/a/b", "/a__b/pose"] {
            assert!(is_topic(name), "{name}");
        }
        for name in [
            "",
            "/",
            "~",
            "~/",
            "~p",
            "/a/",
            "/a//b",
            "//a",
            "/1a",
            "/a b",
            "/ünï",
            "/a/{node}",
        ] {
            assert!(!is_topic(name), "{name}");
        }
    }
}
