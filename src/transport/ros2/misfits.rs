//! Endpoints of other nodes that DDS does not match because their qualities of service are incompatible, such as
//! rclpy's default publisher on `/tf_static`. In: events of DDS, one per pair. Out: texts for as long as they exist.

use std::collections::{BTreeMap, BTreeSet};

use rustdds::policy::{Durability, Reliability};
use rustdds::{GUID, QosPolicies};

use super::told::brief;

/// Most reports at a time: many nodes of one kind have one cause, and mostly one topic.
const TOLD_MAX: usize = 10;

/// Kind of a remote endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Remote {
    /// A writer that this node would read.
    Publisher,
    /// A reader of a topic of this node.
    Subscriber,
}

/// Incompatible pairs of endpoints, this node's first.
#[derive(Clone, Debug, Default)]
pub(super) struct Misfits {
    /// The topic's full name, and the text.
    of: BTreeMap<(GUID, GUID), (String, String)>,
    new: Vec<String>,
}

impl Misfits {
    pub(super) fn holds(&self, two: (GUID, GUID)) -> bool {
        self.of.contains_key(&two)
    }

    /// Adds an incompatible pair.
    ///
    /// * `topic` - as DDS names it.
    pub(super) fn put(
        &mut self,
        two: (GUID, GUID),
        (topic, remote): (&str, Remote),
        (offered, requested): (&QosPolicies, &QosPolicies),
    ) {
        let topic = topic.strip_prefix("rt").unwrap_or(topic);
        let text = words(topic, remote, offered, requested);
        if !self.of.values().any(|(_, known)| *known == text) {
            self.new.push(text.clone());
        }
        self.of.insert(two, (topic.to_owned(), text));
    }

    /// Removes a pair that matches now, or of which one is gone.
    pub(super) fn lose(&mut self, gone: impl Fn(&GUID, &GUID) -> bool) {
        self.of.retain(|(local, remote), _| !gone(local, remote));
    }

    /// Removes all pairs of a topic, given by its full name, that this node no longer uses.
    pub(super) fn part(&mut self, topic: &str) {
        self.of.retain(|_, (own, _)| own != topic);
    }

    /// Texts of the current pairs, each once.
    pub(super) fn found(&self) -> Vec<String> {
        let all: BTreeSet<&str> = self.of.values().map(|(_, text)| text.as_str()).collect();
        all.into_iter().take(TOLD_MAX).map(str::to_owned).collect()
    }

    /// Texts that are new since the last call.
    pub(super) fn take_new(&mut self) -> Vec<String> {
        std::mem::take(&mut self.new)
    }
}

fn words(topic: &str, remote: Remote, offered: &QosPolicies, requested: &QosPolicies) -> String {
    // A policy that is not given has its weakest value.
    let durable = |qos: &QosPolicies| qos.durability().unwrap_or(Durability::Volatile);
    let reliable =
        |qos: &QosPolicies| matches!(qos.reliability(), Some(Reliability::Reliable { .. }));
    let short_durable = durable(offered) < durable(requested);
    let short_reliable = reliable(requested) && !reliable(offered);
    let mut two = [Vec::new(), Vec::new()];
    if short_reliable {
        two[0].push("best effort");
        two[1].push("reliable");
    }
    if short_durable {
        two[0].push("volatile");
        two[1].push("transient local");
    }
    if two[0].is_empty() {
        two = ["deadline", "liveliness"].map(|one| vec![one]);
    }
    let [has, needs] = two.map(|all| all.join(" and "));
    let topic = brief(topic);
    match (remote, short_durable || short_reliable) {
        (Remote::Publisher, true) => {
            let mend = if short_durable {
                "publish it latched (reliable and transient local)"
            } else {
                "publish it as reliable"
            };
            format!(
                "topic {topic}: a publisher offers {has}, this node needs {needs}: it is not heard; {mend}"
            )
        }
        (Remote::Subscriber, true) => format!(
            "topic {topic}: a subscriber asks for {needs}, this node offers {has}: it hears nothing; subscribe as {has}{}",
            if short_reliable {
                ", or set out_reliability to reliable"
            } else {
                ""
            }
        ),
        _ => format!(
            "topic {topic}: another node's quality of service ({has}, {needs}, ownership or order) does not go with this node's: the two do not hear each other"
        ),
    }
}

#[cfg(test)]
mod tests {
    use rustdds::QosPolicyBuilder;

    use super::*;

    fn quality(reliable: bool, durability: Durability) -> QosPolicies {
        let reliability = if reliable {
            Reliability::Reliable {
                max_blocking_time: rustdds::Duration::ZERO,
            }
        } else {
            Reliability::BestEffort
        };
        QosPolicyBuilder::new()
            .reliability(reliability)
            .durability(durability)
            .build()
    }

    #[test]
    fn bug_a_publisher_of_another_quality_of_service_was_unheard_in_silence() {
        let needs = quality(true, Durability::TransientLocal);
        let told = |reliable, durability| {
            let offers = quality(reliable, durability);
            words("/tf_static", Remote::Publisher, &offers, &needs)
        };
        assert_eq!(
            told(true, Durability::Volatile),
            "topic /tf_static: a publisher offers volatile, this node needs transient local: it is not heard; publish it latched (reliable and transient local)"
        );
        assert!(
            told(false, Durability::TransientLocal)
                .contains("best effort, this node needs reliable:")
        );
        let both = told(false, Durability::Volatile);
        assert!(both.contains(
            "offers best effort and volatile, this node needs reliable and transient local"
        ));
        let offers = quality(false, Durability::Volatile);
        let asks = quality(true, Durability::Volatile);
        let told = words("/sweepd/pairs", Remote::Subscriber, &offers, &asks);
        assert!(
            told.ends_with("subscribe as best effort, or set out_reliability to reliable"),
            "{told}"
        );
        let told = words("/x", Remote::Subscriber, &asks, &asks);
        assert!(told.contains("do not hear each other"), "{told}");
    }

    #[test]
    fn what_is_told_is_told_once_and_as_long_as_it_lasts() {
        let [own, one, other] = [1, 2, 3].map(|n| GUID::from_bytes([n; 16]));
        let (volatile, latched) = (
            quality(true, Durability::Volatile),
            quality(true, Durability::TransientLocal),
        );
        let mut misfits = Misfits::default();
        for remote in [one, other] {
            let topic = ("rt/tf_static", Remote::Publisher);
            misfits.put((own, remote), topic, (&volatile, &latched));
        }
        assert_eq!((misfits.found().len(), misfits.take_new().len()), (1, 1));
        misfits.lose(|_, remote| *remote == one);
        assert_eq!(misfits.found().len(), 1);
        misfits.part("/tf_static");
        assert!(misfits.found().is_empty() && misfits.take_new().is_empty());
    }
}
