//! Names of topics and services: `~` and relative names made absolute, remap rules applied, collisions found.

use std::collections::BTreeMap;

use super::args::RosArgs;
use crate::config::ros_name::{is_topic, no_topic};

/// Topics that ros2-client opens for each node, under these names whatever is remapped.
const BY_CLIENT_LIBRARY: [&str; 2] = ["/rosout", "/parameter_events"];

/// Makes full names for one node.
#[derive(Clone, Debug)]
pub struct Names {
    args: RosArgs,
    node: String,
    namespace: String,
    /// Full names given out: the name that was asked for, and what for.
    taken: BTreeMap<String, (String, String)>,
}

impl Names {
    /// Names for the node that the arguments describe.
    ///
    /// # Errors
    /// One text, when node or namespace is no name.
    pub fn new(args: &RosArgs, default_node: &str) -> Result<Self, String> {
        let node = args.node_name(default_node)?;
        let namespace = args.namespace(&node)?;
        Ok(Self {
            args: args.clone(),
            node,
            namespace,
            taken: BY_CLIENT_LIBRARY
                .map(|name| (name.to_owned(), (name.to_owned(), name.to_owned())))
                .into(),
        })
    }

    /// The node's name.
    #[must_use]
    pub fn node(&self) -> &str {
        &self.node
    }

    /// The name of the node's logger, as rclcpp makes it.
    #[must_use]
    pub fn logger(&self) -> String {
        self.full_node().trim_start_matches('/').replace('/', ".")
    }

    /// The node's namespace.
    #[must_use]
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// Namespace and name.
    #[must_use]
    pub fn full_node(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.node)
    }

    /// The full name after expansion and remaps, and kept: a second thing of that name is refused.
    ///
    /// # Errors
    /// One text, when it is no name or another thing has it.
    pub fn claim(&mut self, name: &str) -> Result<String, String> {
        self.share(name, name)
    }

    /// As [`Self::claim`], for one of several things of a kind that read the same topic.
    ///
    /// # Errors
    /// One text, when it is no name or a thing of another kind has it.
    pub fn share(&mut self, name: &str, kind: &str) -> Result<String, String> {
        let full = self.resolve(name)?;
        match self.taken.get(&full) {
            Some((other, taken_for)) if taken_for != kind && other == name => Err(format!(
                "`{name}` is the name of another thing: give one of them another one"
            )),
            Some((other, taken_for)) if taken_for != kind => Err(format!(
                "`{name}` and `{other}` would both be {full}: name or remap (--ros-args -r) one of them otherwise"
            )),
            Some(_) => Ok(full),
            None => {
                let given = (name.to_owned(), kind.to_owned());
                self.taken.insert(full.clone(), given);
                Ok(full)
            }
        }
    }

    /// As [`Self::claim`], for the topic of a body, which may be that of another body, too, but not of the node's own.
    ///
    /// # Errors
    /// One text, when it is no name or a thing that is no body has it.
    pub fn claim_for_body(&mut self, topic: &str) -> Result<String, String> {
        self.share(topic, &of_body(topic))
    }

    /// The full name of a body's topic; `None` where bodies do not have it.
    #[must_use]
    pub fn of_body(&self, topic: &str) -> Option<String> {
        let full = self.resolve(topic).ok()?;
        let (_, taken_for) = self.taken.get(&full)?;
        (*taken_for == of_body(topic)).then_some(full)
    }

    /// Gives a full name back: its thing is no more.
    pub fn release(&mut self, full: &str) {
        self.taken.remove(full);
    }

    /// The full name after expansion and remaps.
    ///
    /// # Errors
    /// One text, when it is no name.
    pub fn resolve(&self, name: &str) -> Result<String, String> {
        let full = self.expand(name)?;
        for rule in self.args.rules(&self.node) {
            if rule.from.starts_with("__") {
                continue;
            }
            if self.expand(&rule.from)? == full {
                return self.expand(&rule.to);
            }
        }
        Ok(full)
    }

    /// `~/x` is in the node, `x` in its namespace, `/x` in the root.
    fn expand(&self, name: &str) -> Result<String, String> {
        let root = self.namespace.trim_end_matches('/');
        let full = match name.strip_prefix('~') {
            Some(rest) => format!("{root}/{}{rest}", self.node),
            None if name.starts_with('/') => name.to_owned(),
            None => format!("{root}/{name}"),
        };
        if is_topic(&full) {
            Ok(full)
        } else {
            Err(no_topic(name))
        }
    }
}

/// What a body's topic is taken for: by bodies that say it in the same words.
fn of_body(topic: &str) -> String {
    format!("poses by {topic}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(line: &str) -> Names {
        let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        Names::new(&RosArgs::parse(&words).unwrap(), "sweepd").unwrap()
    }

    #[test]
    fn names_are_expanded_and_remapped() {
        let plain = names("");
        assert_eq!(plain.resolve("~/contacts").unwrap(), "/sweepd/contacts");
        assert_eq!(plain.full_node(), "/sweepd");
        assert_eq!(plain.logger(), "sweepd");
        let cell = names("-r __ns:=/cell -r ~/contacts:=touch -r /tf:=/other/tf -r x:pairs:=no");
        assert_eq!(cell.resolve("~/contacts").unwrap(), "/cell/touch");
        assert_eq!(cell.resolve("~/pairs").unwrap(), "/cell/sweepd/pairs");
        assert_eq!(cell.resolve("/tf").unwrap(), "/other/tf");
        assert_eq!(cell.full_node(), "/cell/sweepd");
        assert_eq!(cell.logger(), "cell.sweepd");
    }

    #[test]
    fn bug_names_with_two_underscores_in_a_row_were_refused_though_ros_takes_them() {
        let names = names("-r __ns:=/robot__1 -r ~/pairs:=/my__pairs");
        assert_eq!(names.resolve("~/gap").unwrap(), "/robot__1/sweepd/gap");
        assert_eq!(names.resolve("~/pairs").unwrap(), "/my__pairs");
        assert_eq!(names.resolve("/a__b/pose").unwrap(), "/a__b/pose");
    }

    #[test]
    fn a_remap_that_collides_is_refused_with_both_names() {
        let mut names = names("-r ~/pairs:=~/contacts");
        names.claim("~/contacts").unwrap();
        let error = names.claim("~/pairs").unwrap_err();
        assert!(
            error.contains("~/pairs") && error.contains("~/contacts"),
            "{error}"
        );
    }

    #[test]
    fn bug_a_topic_could_be_remapped_to_that_of_the_log() {
        for own in BY_CLIENT_LIBRARY {
            let mut names = names(&format!("-r ~/pairs:={own}"));
            let error = names.claim("~/pairs").unwrap_err();
            assert!(error.contains("~/pairs") && error.contains(own), "{error}");
            assert!(names.claim_for_body(own).is_err());
        }
    }

    #[test]
    fn things_of_one_kind_share_a_topic_and_others_do_not() {
        let mut names = names("-r /tf:=~/transforms -r /left/pose:=/right/pose");
        names.share("/links", "links").unwrap();
        assert_eq!(names.share("links", "links").unwrap(), "/links");
        assert!(names.claim("/links").is_err());
        names.claim("~/transforms").unwrap();
        assert!(names.share("/tf", "links").is_err());
        names.claim("/left/pose").unwrap();
        let error = names.claim("/right/pose").unwrap_err();
        assert!(error.contains("/left/pose"), "{error}");
        // What was refused has taken nothing away.
        assert_eq!(names.claim("/left/pose").unwrap(), "/right/pose");
    }

    #[test]
    fn bug_a_body_cannot_have_a_topic_of_the_node() {
        let mut names = names("");
        for own in ["~/tick", "/clock"] {
            names.claim(own).unwrap();
            let error = names.claim_for_body(own).unwrap_err();
            assert!(error.contains(own), "{error}");
            assert_eq!(names.of_body(own), None);
        }
        for _ in 0..2 {
            assert_eq!(names.claim_for_body("/pose").unwrap(), "/pose");
        }
        assert_eq!(names.of_body("/pose").unwrap(), "/pose");
        assert!(names.claim("/pose").is_err());
    }

    #[test]
    fn what_is_no_name_is_refused() {
        let names = names("-r ~/tick:=bad-name");
        assert!(names.resolve("~/tick").is_err());
        for bad in ["/", "/a//b", "/9", "a b", ""] {
            assert!(names.resolve(bad).is_err(), "{bad}");
        }
    }
}
