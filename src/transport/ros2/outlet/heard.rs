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
    /// Those of a scene, whose names have been given out. A body whose topic is another thing's has none.
    pub(in super::super) fn of(scene: &RosScene, names: &Names) -> Self {
        let own = scene.bodies.iter().filter_map(|body| {
            let ros = scene.sources.get(body.source?)?.ros2.as_ref()?;
            let is_own = ros.kind != RosKind::Tf;
            let topic = names.of_body(&body.topic).filter(|_| is_own)?;
            Some((body.name.clone(), topic))
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
        let full = names.claim_for_body(topic)?;
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
    use super::super::super::RosSourceSpec;
    use super::super::super::args::RosArgs;
    use super::*;
    use crate::config::RosSource;
    use crate::transport::BodyNote;

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

    #[test]
    fn bug_a_body_whose_topic_is_another_things_does_not_give_it_back() {
        let mut names = Names::new(&RosArgs::parse(&[]).unwrap(), "sweepd").unwrap();
        names.claim("~/tick").unwrap();
        assert!(names.claim_for_body("~/tick").is_err());
        let source = RosSourceSpec {
            name: "poses".to_owned(),
            timeout_ns: 1,
            ros2: Some(RosSource {
                kind: RosKind::Pose,
                topic: String::new(),
                static_topic: String::new(),
                max_skew_ns: 0,
            }),
        };
        let body = BodyNote {
            name: "a".to_owned(),
            source: Some(0),
            topic: "~/tick".to_owned(),
            ..BodyNote::default()
        };
        let scene = RosScene {
            sources: vec![source],
            bodies: vec![body],
            ..RosScene::default()
        };
        let mut topics = Topics::of(&scene, &names);
        assert_eq!(topics.remove("a", &mut names), None);
        assert!(
            names.claim_for_body("~/tick").is_err(),
            "it is still the node's"
        );
    }
}
