//! Topics of single bodies: a name is claimed for the first body of a topic, and released with the last one.
//!
//! In: bodies. Out: names of topics, and those that are no longer used.

use std::collections::{BTreeMap, BTreeSet};

use super::super::RosScene;
use super::super::names::Names;
use crate::config::RosKind;
use crate::transport::BodyNote;

/// The topics of bodies, by the names of these.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Topics {
    of: BTreeMap<String, Topic>,
}

/// The topic of a body.
#[derive(Clone, Debug)]
struct Topic {
    /// Index of the body's source.
    source: usize,
    /// Its name as given by the body.
    given: String,
    full: String,
    /// Whether there is a subscription.
    heard: bool,
}

impl Topics {
    /// The topics of a scene's bodies, whose names have been claimed. A body whose topic collides has none.
    ///
    /// * `fed` - the bodies that have a subscription: index of the source among those of common topics, and index of
    ///   the body within the source. Of two bodies with one topic, only one may have a subscription.
    pub(in super::super) fn of(
        scene: &RosScene,
        names: &Names,
        fed: &BTreeSet<(usize, usize)>,
    ) -> Self {
        let mut next = vec![0; scene.sources.len()];
        let own = scene.bodies.iter().filter_map(|body| {
            let source = body.source?;
            let next = next.get_mut(source)?;
            let member = std::mem::replace(next, *next + 1);
            let before = scene.sources.get(..source)?.iter();
            let place = before.filter(|source| source.ros2.is_some()).count();
            let ros = scene.sources.get(source)?.ros2.as_ref()?;
            let is_own = ros.kind != RosKind::Tf;
            let full = names.of_body(&body.topic).filter(|_| is_own)?;
            let topic = Topic {
                source,
                given: body.topic.clone(),
                heard: fed.contains(&(place, member)),
                full,
            };
            Some((body.name.clone(), topic))
        });
        Self { of: own.collect() }
    }

    /// Claims the topic of a body; returns its full name.
    ///
    /// # Errors
    /// One text, if it is not a valid name or is used for something else.
    pub(super) fn put(&mut self, body: &BodyNote, names: &mut Names) -> Result<String, String> {
        let full = names.claim_for_body(&body.topic)?;
        let topic = Topic {
            source: body.source.unwrap_or(usize::MAX),
            given: body.topic.clone(),
            full: full.clone(),
            heard: false,
        };
        self.of.insert(body.name.clone(), topic);
        Ok(full)
    }

    /// Records that the topic of a body has a subscription.
    pub(super) fn note_heard(&mut self, body: &str) {
        if let Some(topic) = self.of.get_mut(body) {
            topic.heard = true;
        }
    }

    /// Whether a body of this name already has a subscription with the same source and topic.
    pub(super) fn hears(&self, body: &BodyNote) -> bool {
        let own = self.of.get(&body.name).filter(|topic| topic.heard);
        own.is_some_and(|own| (Some(own.source), &own.given) == (body.source, &body.topic))
    }

    /// Removes a body; returns its topic if no other body uses it.
    pub(super) fn remove(&mut self, body: &str, names: &mut Names) -> Option<String> {
        let topic = self.of.remove(body)?.full;
        if self.of.values().any(|other| other.full == topic) {
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

    fn body(name: &str, topic: &str) -> BodyNote {
        BodyNote {
            name: name.to_owned(),
            source: Some(0),
            topic: topic.to_owned(),
            ..BodyNote::default()
        }
    }

    #[test]
    fn bug_the_topic_of_a_body_that_has_left_is_free_for_another_thing() {
        let words = ["-r", "/left:=/right"].map(str::to_owned);
        let mut names = Names::new(&RosArgs::parse(&words).unwrap(), "sweepd").unwrap();
        let mut topics = Topics::default();
        topics.put(&body("a", "/left"), &mut names).unwrap();
        topics.put(&body("b", "/left"), &mut names).unwrap();
        assert_eq!(topics.remove("a", &mut names), None, "b has it");
        assert!(topics.put(&body("c", "/right"), &mut names).is_err());
        assert_eq!(topics.remove("b", &mut names).unwrap(), "/right");
        assert_eq!(
            topics.put(&body("c", "/right"), &mut names).unwrap(),
            "/right"
        );
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
        let scene = RosScene {
            sources: vec![source],
            bodies: vec![body("a", "~/tick")],
            ..RosScene::default()
        };
        let mut topics = Topics::of(&scene, &names, &BTreeSet::new());
        assert_eq!(topics.remove("a", &mut names), None);
        assert!(
            names.claim_for_body("~/tick").is_err(),
            "it is still the node's"
        );
    }

    #[test]
    fn bug_of_two_bodies_on_one_topic_that_without_a_subscription_counted_as_heard() {
        let mut names = Names::new(&RosArgs::parse(&[]).unwrap(), "sweepd").unwrap();
        let source = |kind: Option<RosKind>| RosSourceSpec {
            name: "s".to_owned(),
            timeout_ns: 1,
            ros2: kind.map(|kind| RosSource {
                kind,
                topic: String::new(),
                static_topic: String::new(),
                max_skew_ns: 0,
            }),
        };
        let of = |name: &str, source| BodyNote {
            source,
            ..body(name, "/p")
        };
        let scene = RosScene {
            // The first source is one of shared memory, which is not among those of common topics.
            sources: vec![source(None), source(Some(RosKind::Pose))],
            bodies: vec![of("wall", None), of("a", Some(1)), of("b", Some(1))],
            ..RosScene::default()
        };
        names.claim_for_body("/p").unwrap();
        let topics = Topics::of(&scene, &names, &BTreeSet::from([(0, 1)]));
        let heard = scene.bodies.iter().map(|body| topics.hears(body));
        assert_eq!(heard.collect::<Vec<_>>(), [false, false, true]);
    }

    #[test]
    fn bug_a_body_that_was_put_again_where_it_is_heard_lost_its_subscription() {
        let mut names = Names::new(&RosArgs::parse(&[]).unwrap(), "sweepd").unwrap();
        let mut topics = Topics::default();
        let one = BodyNote {
            id: 1,
            ..body("a", "/a")
        };
        topics.put(&one, &mut names).unwrap();
        assert!(!topics.hears(&one), "no files were left for it");
        topics.note_heard("a");
        let other = BodyNote {
            id: 2,
            bounds: Some(([0.0; 3], [1.0; 3])),
            ..one.clone()
        };
        assert!(topics.hears(&one) && topics.hears(&other));
        for source in [None, Some(1)] {
            let elsewhere = BodyNote {
                source,
                ..one.clone()
            };
            assert!(!topics.hears(&elsewhere));
        }
        assert!(!topics.hears(&body("a", "/b")) && !topics.hears(&body("b", "/a")));
        topics.remove("a", &mut names);
        assert!(!topics.hears(&one));
    }
}
