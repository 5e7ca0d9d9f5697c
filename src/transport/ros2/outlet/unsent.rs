//! Reports of messages that DDS did not send, once a second, with their topics. In: the count of unsent messages, and
//! the losses of writers. Out: texts.

use super::super::shared::{Say, Shared};
use super::publishers::Publishers;

/// Time between two looks, nanoseconds.
const LOOK_NS: u64 = 1_000_000_000;

/// The last report.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Unsent {
    all: u64,
    looked_ns: u64,
    /// Text of the last look, for `/diagnostics`; `None`: all was sent.
    pub(super) words: Option<String>,
}

impl Unsent {
    /// Looks once a second, and reports new losses.
    ///
    /// * `now_ns` - nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) fn look(&mut self, publishers: &mut Publishers, shared: &Shared, now_ns: u64) {
        if now_ns.saturating_sub(self.looked_ns) < LOOK_NS {
            return;
        }
        self.looked_ns = now_ns;
        let all = shared.counts().sends_dropped;
        let lost = all.saturating_sub(self.all);
        self.all = all;
        let topics = publishers.take_lost();
        self.words = (lost > 0).then(|| words(lost, &topics));
        if let Some(words) = &self.words {
            shared.say_seldom(Say::Warn, words, now_ns);
        }
    }
}

/// * `lost` - lost messages of all topics, and ticks that were replaced by newer ones before they were published.
/// * `topics` - messages lost by writers, by topic.
fn words(lost: u64, topics: &[(String, u64)]) -> String {
    let mut of: Vec<String> = (topics.iter())
        .map(|(topic, lost)| format!("{lost} of {topic}"))
        .collect();
    let told: u64 = topics.iter().map(|(_, lost)| lost).sum();
    if lost > told {
        let rest = lost - told;
        of.push(format!("{rest} ticks or answers before they were sent"));
    }
    format!(
        "ROS 2: {lost} messages were not sent over DDS, as a reader or this machine is too slow or a network is down ({}): give readers larger \
         buffers (net.core.rmem_default), lower ros_max_pairs or ros_max_contacts, or set out_reliability to best_effort",
        of.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_sent_is_told_with_its_topic_and_what_to_do() {
        let text = words(7, &[("/sweepd/pairs".to_owned(), 5)]);
        for part in [
            "7 messages",
            "DDS",
            "5 of /sweepd/pairs",
            "2 ticks",
            "ros_max_pairs",
            "rmem_default",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let text = words(5, &[("/sweepd/pairs".to_owned(), 5)]);
        assert!(!text.contains("ticks or answers"), "{text}");
    }
}
