//! The published topics, each with its quality of service and the limit of messages that its writer keeps.

use std::time::Duration;

use ros2_client::{Context, Node, Publisher};

use super::super::names::Names;
use super::super::topics::{Out, publisher};
use super::super::wheel::{Means, Wheel};
use super::owed::Owed;
use crate::error::{Error, Result};
use crate::wire::ros;

/// Messages of names kept for late joiners at first, one per revision of a scene of some thousand bodies. For larger
/// scenes a writer keeps one or two revisions. Late joiners get the kept messages, oldest first.
const NAMES_DEPTH: usize = 4;
/// Bytes of a state, of a tick, and of each source in it. For a stopped reader a writer keeps up to 16 thousand states,
/// or 8 thousand ticks of a scene with one source: 20 s at 400 Hz, and by then the reader's lease has ended. So these
/// topics keep one writer, as tools expect; a new one replaces it only above 400 Hz with a stopped reader. A new reader
/// delays them until it has caught up; their messages wait meanwhile.
const STATE_BYTES: usize = 512;
/// As [`STATE_BYTES`].
const TICK_BYTES: usize = 832;
/// As [`STATE_BYTES`].
const SOURCE_BYTES: usize = 192;
/// Bytes of the largest messages.
const CHUNK_BYTES: usize = 128 << 10;

/// The publishers.
pub(in super::super) struct Publishers {
    pub(super) state: Wheel<ros::State>,
    pub(super) tick: Wheel<ros::Tick>,
    pub(super) pairs: Wheel<ros::Pairs>,
    pub(super) contacts: Wheel<ros::Contacts>,
    pub(super) names: Owed<ros::Names>,
    pub(super) diagnostics: Publisher<ros::DiagnosticArray>,
    pub(super) markers: Wheel<ros::MarkerArray>,
    pub(super) collisions: Wheel<ros::GzContacts>,
}

impl Publishers {
    /// Creates them.
    ///
    /// * `heartbeat_ns`, `sources_len` - heartbeat and number of sources of the scene.
    /// * `reliable` - whether lost pairs and contacts are sent again.
    ///
    /// # Errors
    /// `Error::Usage` if remaps collide; `Error::Io` if DDS refuses.
    pub(in super::super) fn create(
        (node, context, names): (&mut Node, &Context, &mut Names),
        (heartbeat_ns, sources_len): (u64, usize),
        reliable: bool,
    ) -> Result<Self> {
        let mut claim = |name: &str| names.claim(name).map_err(Error::Usage);
        // Readers notice silence of the node by the deadline and by the lease.
        let watched = |bytes| Out {
            deadline: Some(Duration::from_nanos(heartbeat_ns.saturating_mul(2))),
            bytes,
            ..Out::RELIABLE
        };
        let large = Out {
            reliable,
            bytes: CHUNK_BYTES,
            ..Out::RELIABLE
        };
        let latched = Out {
            latched: true,
            depth: NAMES_DEPTH,
            ..large
        };
        let latched = Out {
            reliable: true,
            ..latched
        };
        Ok(Self {
            contacts: Wheel::new(
                node,
                context,
                (&claim("~/contacts")?, ("sweepd_msgs", "Contacts")),
                large,
            )?,
            pairs: Wheel::new(
                node,
                context,
                (&claim("~/pairs")?, ("sweepd_msgs", "Pairs")),
                large,
            )?,
            names: Owed::new(
                node,
                context,
                (&claim("~/names")?, ("sweepd_msgs", "Names")),
                latched,
            )?,
            markers: Wheel::new(
                node,
                context,
                (&claim("~/markers")?, ("visualization_msgs", "MarkerArray")),
                Out {
                    bytes: CHUNK_BYTES,
                    ..Out::RELIABLE
                },
            )?,
            collisions: Wheel::new(
                node,
                context,
                (&claim("~/collisions")?, ("ros_gz_interfaces", "Contacts")),
                large,
            )?,
            diagnostics: publisher(
                node,
                context,
                (
                    &claim("/diagnostics")?,
                    ("diagnostic_msgs", "DiagnosticArray"),
                ),
                Out {
                    depth: 10,
                    ..Out::RELIABLE
                },
            )?,
            state: Wheel::new(
                node,
                context,
                (&claim("~/state")?, ("sweepd_msgs", "State")),
                watched(STATE_BYTES),
            )?,
            tick: Wheel::new(
                node,
                context,
                (&claim("~/tick")?, ("sweepd_msgs", "Tick")),
                watched(TICK_BYTES + sources_len * SOURCE_BYTES),
            )?,
        })
    }

    /// Whether a writer has not accepted all messages.
    pub(super) fn hold(&self) -> bool {
        let rows = self.contacts.holds() || self.pairs.holds();
        let shown = self.collisions.holds() || self.markers.holds();
        rows || shown || self.state.holds() || self.tick.holds() || self.names.holds()
    }

    /// Messages lost by writers since the last call, by topic.
    pub(super) fn take_lost(&mut self) -> Vec<(String, u64)> {
        let lost = [
            self.pairs.take_lost(),
            self.contacts.take_lost(),
            self.collisions.take_lost(),
            self.markers.take_lost(),
            self.state.take_lost(),
            self.tick.take_lost(),
        ];
        lost.into_iter().filter(|(_, lost)| *lost > 0).collect()
    }

    /// Sets whether lost pairs and contacts are sent again.
    pub(super) fn set_reliable(&mut self, with: &mut Means<'_>, reliable: bool) {
        self.pairs.set_reliable(with, reliable);
        self.contacts.set_reliable(with, reliable);
        self.collisions.set_reliable(with, reliable);
    }
}
