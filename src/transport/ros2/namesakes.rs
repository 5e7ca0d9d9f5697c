//! Other nodes with the name of this one. In: announcements of nodes by participants. Out: one text per namesake.
//!
//! It has its own reader: that of the crate passes its finds through a channel of eight entries, which overflows during
//! discovery, so that in every second start neither of two namesakes was reported.

use ros2_client::entities_info::ParticipantEntitiesInfo;
use ros2_client::{Context, Gid, builtin_topics};
use rustdds::no_key::DataReaderCdr;
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{QosPolicyBuilder, RTPSEntity as _, TopicKind};

use super::topics::failed;
use crate::error::Result;

/// Announcements that may wait; each change of a node is one, and the newest of a participant is complete.
const WAITING: i32 = 256;
/// Most namesakes remembered as reported; beyond that one may be reported again.
const TOLD_MAX: usize = 64;

/// Looks for namesakes.
pub(super) struct Namesakes {
    reader: DataReaderCdr<ParticipantEntitiesInfo>,
    /// This node's full name and participant.
    name: String,
    gid: Gid,
    /// Participants that were reported.
    told: Vec<Gid>,
}

impl Namesakes {
    /// Starts the search for a node.
    ///
    /// * `name` - its full name.
    ///
    /// # Errors
    /// `Error::Io` when DDS refuses.
    pub(super) fn of(context: &Context, name: String) -> Result<Self> {
        let participant = context.domain_participant();
        // Earlier participants have announced their nodes already: the last announcement of each is requested.
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

    /// Text about a namesake that was not reported yet.
    pub(super) fn look(&mut self) -> Option<String> {
        // An unreadable announcement comes from another ROS distribution.
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
