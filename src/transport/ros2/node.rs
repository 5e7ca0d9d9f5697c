//! The node as a [`Door`] of the daemon, beside that of shared memory. It is opened on the daemon's thread and closed
//! in the order that removes its name from the graph at once.

mod files;
mod make;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::Duration;

use files::check_files;
pub(super) use make::join;
use make::{make, mapping};
use ros2_client::{Context, RosoutRaw as _};
use rustdds::mio1::Waker;

use super::args::RosArgs;
use super::diagnose::Diagnoser;
use super::env::{Network, Range, unread};
use super::inlet::{Inlet, Local};
use super::lines::{fed, subscribe};
use super::markers::Boxes;
use super::names::Names;
use super::namesakes::Namesakes;
use super::outlet::{Latest, Outlet, Publishers, Read, Topics, Unheard, Unsent};
use super::params::{Answers, Table};
use super::parcel::Parcels;
use super::poses::Source;
use super::readers::Readers;
use super::said::said;
use super::services::Services;
use super::shared::{Say, Shared};
use super::shelf::Shelf;
use super::sockets;
use super::strangers::Strangers;
use super::{RosScene, open};
use crate::error::{Error, Result};
use crate::time::Clock;
use crate::transport::client::random_u64;
use crate::transport::{BodyChange, BodyNote, Door, RequestToken, Setting as Applied, Wake};
use crate::wire::ros::{Book, Speaker};
use crate::wire::{
    Answer, BODY_NAME_LEN, Demand, Inbox, NameRow, Outbox, RequestHeader, TickRow, Undelivered,
    WIRE_VERSION,
};

/// Default name of the node.
const NODE_NAME: &str = "sweepd";
/// Time between the end of the node and that of its participant.
const FAREWELL: Duration = Duration::from_millis(100);

/// Options for opening the node.
#[derive(Clone, Debug)]
pub struct RosOptions {
    /// The arguments after `--ros-args`.
    pub args: RosArgs,
    /// Domain and discovery range.
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
    waker: Arc<Waker>,
    context: Option<Context>,
    receiving: Option<JoinHandle<()>>,
    sending: Option<JoinHandle<()>>,
    demand: Demand,
    /// Requests that wait for the next tick.
    ticks_asked: Vec<u64>,
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
    /// `Error::Usage` for invalid or colliding names, `Error::Refused` if the node cannot be confined to this host.
    pub fn open(
        options: &RosOptions,
        scene: &RosScene,
        wake: Box<dyn Fn() + Send>,
    ) -> Result<Self> {
        let mut names = Names::new(&options.args, NODE_NAME).map_err(Error::Usage)?;
        let (table, mut odd) = Table::started(scene, &said(&options.args)?, &names.full_node())
            .map_err(Error::Usage)?;
        let (table, book) = (Arc::new(table), Book::of(&first_names(scene)));
        let shared = shared(options, scene, &names, book.clone());

        check_files(scene)?;
        let (context, noise) = join(options.network)?;
        let mut node = make(options, &context, &names)?;
        shared.take(table.effects());
        // Before any writer is created, so that no reader is missed.
        let (readers, sources) = (Readers::of(&context), Source::of(scene));
        let (heartbeat_ns, local) = (scene.config.heartbeat_ns, Local::of(scene, options.boot_id));
        let shelf = Arc::new(shelf(&sources, options.session));
        let publishers = Publishers::create(
            (&mut node, &context, &mut names),
            (heartbeat_ns, scene.sources.len()),
            shared.reliable(),
        )?;
        let (mapping, edits) = (mapping(options.network), table.flag("ros.allow_edits"));
        let services = Services::create((&mut node, mapping), &mut names, edits)?;
        let answers = Answers::create((&mut node, mapping), &context, &mut names, &table)?;
        // After all names of the node itself, so that no body gets one of these.
        let (lines, unheard) = subscribe(&mut node, &context, &mut names, &sources, scene.again)?;
        odd.extend(unheard);
        let topics = Topics::of(scene, &names, &fed(&lines));
        shared.set_rosout(Some(node.rosout_writer()));
        let namesakes = Namesakes::of(&context, node.fully_qualified_name())?;
        table.run();

        let parcels = Arc::new(Parcels::default());
        let (inlet, waker) = Inlet::new(
            (lines, services, answers),
            sources,
            Arc::clone(&shelf),
            Arc::clone(&shared),
            wake,
            (local, heartbeat_ns),
        )?;
        let outlet = Outlet {
            node,
            context: context.clone(),
            publishers,
            parcels: Arc::clone(&parcels),
            shared: Arc::clone(&shared),
            waker: Arc::clone(&waker),
            speaker: Speaker::of(&scene.frame_id, book),
            boot_id: options.boot_id,
            name: names.full_node(),
            diagnoser: Diagnoser::default(),
            latest: Latest::default(),
            told_ns: 0,
            shown_ns: 0,
            heartbeat_ns,
            boxes: boxes(scene),
            left_out: 0,
            unsent: Unsent::default(),
            noise,
            strangers: Strangers::of(&context, &names, scene),
            readers,
            read: Read::default(),
            namesakes,
            unheard: Unheard::of(scene, &topics),
            topics,
            names: names.clone(),
            sources: scene.sources.clone(),
        };
        let mut open = Self {
            shelf,
            shared,
            parcels,
            waker,
            context: Some(context),
            receiving: None,
            sending: None,
            demand: Demand::default(),
            ticks_asked: Vec::new(),
        };
        open.start(inlet, outlet)?;
        open.greet(options.network, &names, &odd);
        Ok(open)
    }

    /// Whether there are live participants that this node cannot hear and a new one could.
    pub(super) fn is_to_open_anew(&self) -> bool {
        self.shared.again.load(Ordering::Relaxed)
    }

    /// Hands over the waiting frames, then the ends of its sessions of common topics.
    pub(super) fn end(&mut self, inbox: &mut Inbox) {
        self.shelf.drain(inbox);
        self.shelf.end(inbox);
    }

    fn start(&mut self, inlet: Inlet, outlet: Outlet) -> Result<()> {
        self.sending = Some(thread("ros-tx", move || outlet.run())?);
        self.receiving = Some(thread("ros-rx", move || inlet.run())?);
        Ok(())
    }

    /// Logs the node's name, domain and range, and warnings of the start.
    fn greet(&self, network: Network, names: &Names, odd: &[String]) {
        let reach = match network.range {
            Range::Localhost if network.pinned => {
                "on this host only, because ROS_LOCALHOST_ONLY=1 says so; without it ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET opens it to the network"
            }
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
        if network.unsecured {
            self.shared.say(
                Say::Warn,
                "ROS_SECURITY_ENABLE is true, and this build has no DDS security: what the node sends and hears is not secured",
            );
        }
        let unread = unread(|name| std::env::var(name).ok());
        for text in unread.iter().chain(odd) {
            self.shared.say(Say::Warn, text);
        }
    }

    /// Ends the threads, and leaves the graph.
    fn close(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.parcels.stop();
        let _gone_already = self.waker.wake();
        // The writer of /rosout is dropped before the node, which ends with the sending thread.
        self.shared.set_rosout(None);
        for thread in [self.receiving.take(), self.sending.take()] {
            let _told_by_its_panic = thread.map(JoinHandle::join);
        }
        // The node has announced its end. Peers that missed it can ask again only while the participant lives; others
        // show the name until the lease ends.
        #[allow(
            clippy::disallowed_methods,
            reason = "the end of the process, with nothing left to wait on"
        )]
        std::thread::sleep(FAREWELL);
        drop(self.context.take());
    }
}

impl Drop for RosNode {
    fn drop(&mut self) {
        self.close();
    }
}

/// State shared by the threads, with the names before the first tick.
fn shared(options: &RosOptions, scene: &RosScene, names: &Names, book: Book) -> Arc<Shared> {
    let least = Say::least(options.args.log_level.as_deref());
    let timeouts_ns: Vec<u64> = scene.sources.iter().map(|s| s.timeout_ns).collect();
    Arc::new(Shared::new(&names.logger(), book, &timeouts_ns, least))
}

/// A shelf for the bodies of common topics.
fn shelf(sources: &[Source], session: u64) -> Shelf {
    let shelf = Shelf::default();
    for source in sources {
        shelf.add_group(source.name, session, source.seats());
    }
    shelf
}

/// The boxes of bounded bodies.
fn boxes(scene: &RosScene) -> Boxes {
    let bodies = scene.bodies.iter();
    bodies.filter_map(|b| Some((b.id, b.bounds?))).collect()
}

/// The names before the first tick publishes them.
fn first_names(scene: &RosScene) -> Vec<NameRow> {
    let row = |body: &BodyNote| {
        let mut name = [0; BODY_NAME_LEN];
        for (to, from) in name.iter_mut().zip(body.name.bytes()) {
            *to = from;
        }
        let source = body.source.and_then(|place| u32::try_from(place).ok());
        NameRow {
            body: body.id,
            source: source.unwrap_or(u32::MAX),
            len: u32::try_from(body.name.len().min(BODY_NAME_LEN)).unwrap_or(0),
            name,
            ..NameRow::default()
        }
    };
    scene.bodies.iter().map(row).collect()
}

fn thread(name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>> {
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(work)
        .map_err(|e| Error::io(format!("cannot start the thread {name}"), e))
}

impl Door for RosNode {
    /// Returns at once: the receiving thread wakes the door that the daemon waits on.
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

    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
        self.shelf.hear(&outbox.tick, random_u64);
        let gone = self.parcels.put(outbox, self.demand, self.shared.caps());
        // Done by the sending thread, together with the topics; no shared memory is involved.
        self.shared.note_unsent(gone);
        if !self.ticks_asked.is_empty() {
            let header = outbox.tick.header;
            let ticked = self.ticks_asked.drain(..).map(|token| (token, header));
            open(&self.shared.desk.ticked).extend(ticked);
            let _gone_already = self.waker.wake();
        }
        Ok(Undelivered::default())
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        let gone = self.parcels.put_tick(tick);
        self.shared.note_unsent(gone);
        Ok(())
    }

    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
        let asked = std::mem::take(&mut *open(&self.shared.desk.asked));
        for (token, json) in asked {
            let header = RequestHeader {
                json_len: json.len() as u64,
                request: token,
                schema: WIRE_VERSION,
                reserved: 0,
            };
            take(RequestToken(token), header, json);
        }
    }

    fn answer(&mut self, token: RequestToken, _ok: bool, json: &str) -> Result<()> {
        let answer: Answer = serde_json::from_str(json)
            .map_err(|e| Error::io("ROS 2: an answer cannot be read", e))?;
        open(&self.shared.desk.answered).push((token.0, answer));
        self.waker
            .wake()
            .map_err(|e| Error::io("ROS 2: an answer cannot be handed over", e))
    }

    fn settings(&mut self, take: &mut dyn FnMut(Applied)) {
        self.shared.take_settings().into_iter().for_each(&mut *take);
        let asked = std::mem::take(&mut *open(&self.shared.desk.ticks));
        if !asked.is_empty() {
            self.ticks_asked.extend(asked);
            take(Applied::TickNow);
        }
    }

    fn follows_bodies(&self) -> bool {
        true
    }

    fn bodies(&mut self, changes: &[BodyChange]) {
        open(&self.shared.changes).extend_from_slice(changes);
    }

    fn tell(&mut self, words: &str) {
        open(&self.shared.words).push(words.to_owned());
    }

    fn housekeeping(&mut self) {}
}
