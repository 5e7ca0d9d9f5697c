//! Topics that bodies have of their own: given out when a body comes, given back when the last body of one has left.
//!
//! In: bodies. Out: names of topics, and which of them nobody has any more.

use std::collections::BTreeMap;

use super::super::RosScene;
use super::super::names::Names;
use crate::config::RosKind;

/// The topics of bodies, by the names of these.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Topics {
    of: BTreeMap<String, String>,
}

impl Topics {
    /// Those of a scene, whose names have been given out.
    pub(in super::super) fn of(scene: &RosScene, names: &Names) -> Self {
        let own = scene.bodies.iter().filter_map(|body| {
            let ros = scene.sources.get(body.source?)?.ros2.as_ref()?;
            let topic = names.resolve(&body.topic).ok()?;
            (ros.kind != RosKind::Tf).then(|| (body.name.clone(), topic))
        });
        Self { of: own.collect() }
    }

    /// Gives a body its topic; its full name.
    ///
    /// # Errors
    /// One text, when it is no name or another thing has it.
    pub(super) fn put(
        &mut self,
        body: &str,
        topic: &str,
        names: &mut Names,
    ) -> Result<String, String> {
        let full = names.claim(topic)?;
        self.of.insert(body.to_owned(), full.clone());
        Ok(full)
    }

    /// A body has left, or comes anew: the topic it had, where no other body has it.
    pub(super) fn remove(&mut self, body: &str, names: &mut Names) -> Option<String> {
        let topic = self.of.remove(body)?;
        if self.of.values().any(|other| *other == topic) {
            return None;
        }
        names.release(&topic);
        Some(topic)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::args::RosArgs;
    use super::*;

    #[test]
    fn bug_the_topic_of_a_body_that_has_left_is_free_for_another_thing() {
        let words = ["-r", "/left:=/right"].map(str::to_owned);
        let mut names = Names::new(&RosArgs::parse(&words).unwrap(), "sweepd").unwrap();
        let mut topics = Topics::default();
        topics.put("a", "/left", &mut names).unwrap();
        topics.put("b", "/left", &mut names).unwrap();
        assert_eq!(topics.remove("a", &mut names), None, "b has it");
        assert!(topics.put("c", "/right", &mut names).is_err());
        assert_eq!(topics.remove("b", &mut names).unwrap(), "/right");
        assert_eq!(topics.put("c", "/right", &mut names).unwrap(), "/right");
        assert_eq!(topics.remove("nobody", &mut names), None);
    }
}
