//! The node as the daemon sees it: opened on the daemon's thread, a [`Door`] beside the one of shared memory, closed
//! in the order that takes its name out of the graph at once.

use std::net::Ipv4Addr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;

use ros2_client::{Context, Node, NodeName, NodeOptions, RosoutRaw as _};
use rustdds::DomainParticipantBuilder;
use rustdds::mio1::Waker;

use super::args::RosArgs;
use super::diagnose::Diagnoser;
use super::env::{Network, Range};
use super::inlet::{Feeder, Inlet, Line};
use super::names::Names;
use super::outlet::{Outlet, Publishers};
use super::parcel::{Caps, Parcels};
use super::poses::Source;
use super::shared::{Say, Shared};
use super::shelf::Shelf;
use super::sockets;
use super::speak::{Book, Speaker};
use super::topics::{In, TypeName, subscription};
use super::{RosBody, RosScene};
use crate::config::RosKind;
use crate::error::{Error, Result};
use crate::time::Clock;
use crate::transport::{Door, RequestToken, Wake};
use crate::wire::{BODY_NAME_LEN, Demand, Inbox, NameRow, Outbox, RequestHeader, TickRow};

/// The node's name where nobody says another.
const NODE_NAME: &str = "sweepd";
/// Rows a tick: two messages of contacts, a tenth of what two cores can send at 100 Hz.
const CAPS: Caps = Caps {
    pairs: 1000,
    contacts: 500,
};

/// How the node opens.
#[derive(Clone, Debug)]
pub struct RosOptions {
    /// What was said behind `--ros-args`.
    pub args: RosArgs,
    /// Domain and range.
    pub network: Network,
    /// Random number of this start, never 0.
    pub boot_id: u64,
    /// Random number for the sessions of sources of common topics, never 0.
    pub session: u64,
}

/// The node. Its threads live as long as it does.
pub struct RosNode {
    shelf: Arc<Shelf>,
    shared: Arc<Shared>,
    parcels: Arc<Parcels>,
    waker: Waker,
    /// Last user of the node beside the sending thread.
    node: Option<Arc<Node>>,
    context: Option<Context>,
    receiving: Option<JoinHandle<()>>,
    sending: Option<JoinHandle<()>>,
    spinning: Option<JoinHandle<()>>,
    demand: Demand,
}

impl std::fmt::Debug for RosNode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RosNode")
            .field("shared", &self.shared)
            .finish_non_exhaustive()
    }
}

impl RosNode {
    /// Opens the node with all its topics and starts its threads.
    ///
    /// * `wake` - wakes the tick thread.
    ///
    /// # Errors
    /// `Error::Usage` when names are none or collide; `Error::Refused` when the node cannot be kept on this host;
    /// `Error::Io` when DDS or the system fails.
    pub fn open(
        options: &RosOptions,
        scene: &RosScene,
        wake: Box<dyn Fn() + Send>,
    ) -> Result<Self> {
        let mut names = Names::new(&options.args, NODE_NAME).map_err(Error::Usage)?;
        let context = join(options.network)?;
        let name = NodeName::new(names.namespace(), names.node())
            .map_err(|e| Error::Usage(format!("--ros-args: {}: {e}", names.full_node())))?;
        let rosout = options.args.rosout != Some(false);
        let mut node = context
            .new_node(name, NodeOptions::new().enable_rosout(rosout))
            .map_err(|e| {
                Error::io(
                    format!("ROS 2: node {} cannot be made", names.full_node()),
                    e,
                )
            })?;

        let sources = Source::of(scene);
        let shelf = Arc::new(Shelf::default());
        for source in &sources {
            shelf.add_group(source.name, options.session, source.bodies());
        }
        let book = Book::of(&first_names(scene));
        let least = match options.args.log_level.as_deref() {
            None | Some("debug" | "info") => Say::Info,
            Some(_) => Say::Warn,
        };
        let shared = Arc::new(Shared::new(names.node(), book.clone(), CAPS, least));
        let heartbeat_ns = scene.heartbeat_ns;
        let publishers = Publishers::create(&mut node, &context, &mut names, heartbeat_ns, true)?;
        let lines = subscribe(&mut node, &context, &mut names, &sources)?;
        shared.set_rosout(Some(node.rosout_writer()));
        let spinner = node
            .spinner()
            .map_err(|e| Error::io("ROS 2: the node cannot spin", e))?;

        let node = Arc::new(node);
        let parcels = Arc::new(Parcels::default());
        let place = (scene.frame_id.clone(), heartbeat_ns);
        let (inlet, waker) = Inlet::new(
            lines,
            sources,
            Arc::clone(&shelf),
            Arc::clone(&shared),
            wake,
            place,
        )?;
        let outlet = Outlet {
            node: Arc::clone(&node),
            publishers,
            parcels: Arc::clone(&parcels),
            shared: Arc::clone(&shared),
            speaker: Speaker {
                frame_id: scene.frame_id.clone(),
                book,
            },
            boot_id: options.boot_id,
            name: names.full_node(),
            diagnoser: Diagnoser::default(),
            told: (TickRow::default(), 0),
        };
        let mut open = Self {
            shelf,
            shared,
            parcels,
            waker,
            node: Some(node),
            context: Some(context),
            receiving: None,
            sending: None,
            spinning: None,
            demand: Demand::default(),
        };
        open.spinning = Some(thread("ros-spin", move || {
            if let Err(e) = futures_executor::block_on(spinner.spin()) {
                tracing::error!("ROS 2: parameters are not answered any more: {e}");
            }
        })?);
        open.sending = Some(thread("ros-tx", move || outlet.run())?);
        open.receiving = Some(thread("ros-rx", move || inlet.run())?);
        open.greet(options.network, &names);
        Ok(open)
    }

    /// Says where the node is, and what opens it.
    fn greet(&self, network: Network, names: &Names) {
        let reach = match network.range {
            Range::Localhost => {
                "on this host only; ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET opens it to the network"
            }
            Range::Subnet => "on every network of this host",
        };
        let text = format!(
            "ROS 2 node {} in domain {}, {reach}",
            names.full_node(),
            network.domain
        );
        self.shared.say(Say::Info, &text);
        if network.range == Range::Localhost && sockets::loopback_is_multicast() {
            self.shared.say(
                Say::Warn,
                "interface lo carries the MULTICAST flag: other ROS 2 nodes of this host then send what this one reads to the network, too; switch it off with: ip link set lo multicast off",
            );
        }
        if std::env::var("ROS_DISTRO").is_ok_and(|distro| distro == "humble") {
            self.shared.say(
                Say::Warn,
                "ROS_DISTRO is humble, whose graph this build does not speak (Iron and later): topics work, node names may not",
            );
        }
    }

    /// Ends the threads and leaves the graph.
    fn close(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.parcels.stop();
        let _gone_already = self.waker.wake();
        for thread in [self.sending.take(), self.receiving.take()] {
            let _told_by_its_panic = thread.map(JoinHandle::join);
        }
        self.shared.set_rosout(None);
        if let Some(node) = self.node.take() {
            node.stop_spinner();
            drop(node);
        }
        let _told_by_its_panic = self.spinning.take().map(JoinHandle::join);
        drop(self.context.take());
    }
}

impl Drop for RosNode {
    fn drop(&mut self) {
        self.close();
    }
}

/// Joins the DDS domain, on this host or on all its networks.
fn join(network: Network) -> Result<Context> {
    let failed = |e: &dyn std::fmt::Display| {
        Error::Refused(format!(
            "ROS 2: domain {} cannot be joined: {e}",
            network.domain
        ))
    };
    let builder = DomainParticipantBuilder::new(network.domain);
    let builder = match network.range {
        Range::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
        Range::Subnet => builder,
    };
    let participant = builder.build().map_err(|e| failed(&e))?;
    if network.range == Range::Localhost {
        sockets::bind_to_loopback().map_err(|why| {
            Error::Refused(format!(
                "ROS 2: the node cannot be kept on this host: {why}; set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET to let it onto the network"
            ))
        })?;
    }
    Context::from_domain_participant(participant).map_err(|e| failed(&e))
}

/// The names before the first tick says them.
fn first_names(scene: &RosScene) -> Vec<NameRow> {
    let row = |body: &RosBody| {
        let mut name = [0; BODY_NAME_LEN];
        for (to, from) in name.iter_mut().zip(body.name.bytes()) {
            *to = from;
        }
        NameRow {
            body: body.id,
            len: u32::try_from(body.name.len().min(BODY_NAME_LEN)).unwrap_or(0),
            name,
            ..NameRow::default()
        }
    };
    scene.bodies.iter().map(row).collect()
}

/// Frames of a client: lockstep wants each of them.
const FRAMES: In = In {
    reliable: false,
    latched: false,
    depth: 16,
};
const LINKS: In = In {
    reliable: false,
    latched: false,
    depth: 100,
};
const FIXED_LINKS: In = In {
    reliable: true,
    latched: true,
    depth: 100,
};
const POSES: In = In {
    reliable: false,
    latched: false,
    depth: 1,
};
const TF: TypeName = ("tf2_msgs", "TFMessage");

/// Subscribes to what the scene needs, each topic once.
fn subscribe(
    node: &mut Node,
    context: &Context,
    names: &mut Names,
    sources: &[Source],
) -> Result<Vec<Line>> {
    let own = names.claim("~/transforms").map_err(Error::Usage)?;
    let kind = ("sweepd_msgs", "BodyTransforms");
    let own = subscription(node, context, (&own, kind), FRAMES)?;
    let mut lines = vec![Line::Transforms(own)];
    let mut trees: Vec<(String, bool, Vec<usize>)> = Vec::new();
    for (place, source) in sources.iter().enumerate() {
        let topic = |full: &str| names.resolve(full).map_err(Error::Usage);
        if source.kind == RosKind::Tf {
            for (given, fixed) in [(&source.topic, false), (&source.static_topic, true)] {
                let full = topic(given)?;
                match trees.iter_mut().find(|(known, ..)| *known == full) {
                    Some((.., places)) => places.push(place),
                    None => trees.push((full, fixed, vec![place])),
                }
            }
            continue;
        }
        for (member, given) in source.topics().enumerate() {
            let feeder = Feeder {
                source: place,
                member,
                topic: topic(given)?,
                heard: [None, None],
            };
            let full = feeder.topic.clone();
            lines.push(if source.kind == RosKind::Pose {
                let kind = ("geometry_msgs", "PoseStamped");
                Line::Pose(subscription(node, context, (&full, kind), POSES)?, feeder)
            } else {
                let kind = ("nav_msgs", "Odometry");
                Line::Odometry(subscription(node, context, (&full, kind), POSES)?, feeder)
            });
        }
    }
    for (full, fixed, sources) in trees {
        let quality = if fixed { FIXED_LINKS } else { LINKS };
        let from = subscription(node, context, (&full, TF), quality)?;
        lines.push(Line::Links {
            from,
            fixed,
            sources,
        });
    }
    Ok(lines)
}

fn thread(name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>> {
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(work)
        .map_err(|e| Error::io(format!("cannot start the thread {name}"), e))
}

impl Door for RosNode {
    /// Returns at once: the receiving thread wakes the door that is waited on.
    fn wait(&mut self, _timeout_ns: u64, _clock: &dyn Clock) -> Result<Wake> {
        Ok(Wake::default())
    }

    fn receive(&mut self, inbox: &mut Inbox, _clock: &dyn Clock) {
        self.shelf.drain(inbox);
    }

    fn demand(&mut self) -> Demand {
        self.demand = self.shared.demand();
        self.demand
    }

    fn publish(&mut self, outbox: &Outbox) -> Result<u64> {
        let gone = self.parcels.put(outbox, self.demand, self.shared.caps());
        self.shared.note_unsent(gone);
        Ok(gone)
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        self.parcels.put_tick(tick);
        Ok(())
    }

    fn requests(&mut self, _take: &mut dyn FnMut(RequestToken, RequestHeader, &[u8])) {}

    fn answer(&mut self, _token: RequestToken, _ok: bool, _json: &str) -> Result<()> {
        Ok(())
    }

    fn housekeeping(&mut self) {}
}
