//! Other nodes of this one's name. In: what participants say of their nodes. Out: a word on each namesake, once.
//!
//! A reader of its own, because the crate's hands its finds on over a channel of eight that drops what comes in a
//! burst, and a burst is what discovery is: of two nodes of one name, neither told in every second start.

use ros2_client::entities_info::ParticipantEntitiesInfo;
use ros2_client::{Context, Gid, builtin_topics};
use rustdds::no_key::DataReaderCdr;
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{QosPolicyBuilder, RTPSEntity as _, TopicKind};

use super::topics::failed;
use crate::error::Result;

/// Words of participants that may wait; each change of a node is one, and the newest of a participant says it all.
const WAITING: i32 = 256;
/// Namesakes told; beyond them one is told again.
const TOLD_MAX: usize = 64;

/// Looks for namesakes.
pub(super) struct Namesakes {
    reader: DataReaderCdr<ParticipantEntitiesInfo>,
    /// This node's full name and participant.
    name: String,
    gid: Gid,
    /// Participants that were told of.
    told: Vec<Gid>,
}

impl Namesakes {
    /// A look-out for a node.
    ///
    /// * `name` - its full name.
    ///
    /// # Errors
    /// `Error::Io` when DDS refuses.
    pub(super) fn of(context: &Context, name: String) -> Result<Self> {
        let participant = context.domain_participant();
        // Whoever came before has said it already: the last word of each is asked for.
        let qos = QosPolicyBuilder::new()
            .durability(Durability::TransientLocal)
            .reliability(Reliability::Reliable {
                max_blocking_time: rustdds::Duration::ZERO,
            })
            .history(History::KeepLast { depth: WAITING })
            .build();
        let full = builtin_topics::ros_discovery::TOPIC_NAME;
        let kind = builtin_topics::ros_discovery::TYPE_NAME;
        let topic = participant
            .create_topic(full.to_owned(), kind.to_owned(), &qos, TopicKind::NoKey)
            .map_err(|e| failed(full, e))?;
        let subscriber = participant
            .create_subscriber(&qos)
            .map_err(|e| failed(full, e))?;
        let reader = subscriber
            .create_datareader_no_key_cdr(&topic, None)
            .map_err(|e| failed(full, e))?;
        Ok(Self {
            reader,
            name,
            gid: Gid::from(participant.guid()),
            told: Vec::new(),
        })
    }

    /// What there is to say of a namesake that was not told of yet.
    pub(super) fn look(&mut self) -> Option<String> {
        // A word that cannot be read is one of another ROS distribution, and no namesake that can be told.
        while let Some(sample) = self.reader.take_next_sample().transpose() {
            let Ok(sample) = sample else { continue };
            let info = sample.value();
            let same = |own: &str| {
                let mut nodes = info.nodes().iter();
                nodes.any(|node| node.fully_qualified_name() == own)
            };
            if info.gid() == self.gid || self.told.contains(&info.gid()) || !same(&self.name) {
                continue;
            }
            if self.told.len() == TOLD_MAX {
                self.told.remove(0);
            }
            self.told.push(info.gid());
            return Some(format!(
                "another node is named {}, too: give one of them another name with -r __node:=NAME",
                self.name
            ));
        }
        None
    }
}
