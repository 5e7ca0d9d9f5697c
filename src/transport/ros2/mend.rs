//! Opens the node again if threads of DDS have ended, or if a participant that was given up is back.
//!
//! In: how to open a node. Out: a door that continues with another node.
//!
//! Each thread of rustdds 0.15 ends for good when its wait is interrupted, for example by SIGSTOP and SIGCONT or a
//! debugger; the node then neither receives nor sends while the daemon ticks on (see `tests/python/ros2`). A thread
//! checks this once a second; it also opens and closes nodes, so that the tick never waits for that. Peers discover the
//! new participant like that of a restarted daemon, but with the same boot id, and miss a second or two. The old node
//! does not hear a participant that was away for longer than its lease (`absent`).

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use super::{RosNode, RosScene, open};
use crate::error::{Error, Result};
use crate::time::{Clock, SystemClock};
use crate::transport::{BodyChange, Door, RequestToken, Setting, Wake};
use crate::wire::{Demand, Inbox, Outbox, RequestHeader, TickRow, Undelivered};

/// Time between two checks of DDS: peers notice silence by the lease after 3 s.
const LOOK: Duration = Duration::from_secs(1);
/// Least time between two new nodes for returning participants, nanoseconds: each new node costs all peers a second or
/// two, and on an unreliable network some participant is always returning.
const BACK_NS: u64 = 30_000_000_000;
/// Names of the threads of DDS, as truncated by the system.
const DDS_THREADS: [&str; 2] = ["RustDDS Partici", "RustDDS discove"];
/// The upper bits of a request number identify the node; the uppermost bit is the daemon's.
const NODE_SHIFT: u32 = 40;

/// Opens the node for a scene.
pub type Opener = Box<dyn Fn(&RosScene) -> Result<RosNode> + Send>;

/// Flags shared by the door and the watching thread.
#[derive(Clone, Debug, Default)]
struct Flags {
    /// The door must hand over the node.
    dead: Arc<AtomicBool>,
    /// A participant is back that the node cannot hear.
    back: Arc<AtomicBool>,
    /// The thread must end.
    ended: Arc<AtomicBool>,
}

/// A node that is opened again when its DDS threads have ended.
pub struct LastingNode {
    /// `None` while it is being opened again.
    live: Option<RosNode>,
    /// Number of the node, from 0.
    number: u64,
    /// Whether the node needs all names, because it is new.
    tell_names: bool,
    /// The scene including all edits so far.
    scene: Arc<Mutex<RosScene>>,
    /// Changes by edits while there was no node; the next one may have been opened before them.
    missed: Vec<BodyChange>,
    flags: Flags,
    broken: Option<Sender<RosNode>>,
    mended: Receiver<RosNode>,
    watcher: Option<JoinHandle<()>>,
}

impl std::fmt::Debug for LastingNode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LastingNode")
            .field("number", &self.number)
            .finish_non_exhaustive()
    }
}

impl LastingNode {
    /// Opens the node for the first time.
    ///
    /// # Errors
    /// Those of [`RosNode::open`].
    pub fn open(scene: RosScene, opener: Opener) -> Result<Self> {
        let live = opener(&scene)?;
        let scene = Arc::new(Mutex::new(scene));
        let watched = Arc::clone(&scene);
        let (broken, to_mend) = channel();
        let (give, mended) = channel();
        let flags = Flags::default();
        let seen = flags.clone();
        let watcher = std::thread::Builder::new()
            .name("ros-watch".to_owned())
            .spawn(move || watch((&opener, &watched), &seen, &to_mend, &give))
            .map_err(|e| Error::io("cannot start the thread ros-watch", e))?;
        Ok(Self {
            live: Some(live),
            number: 0,
            tell_names: false,
            scene,
            missed: Vec::new(),
            flags,
            broken: Some(broken),
            mended,
            watcher: Some(watcher),
        })
    }

    /// Hands over a dead node, and takes the new one.
    fn exchange(&mut self, inbox: &mut Inbox) {
        let is_back = self.live.as_ref().is_some_and(RosNode::is_to_open_anew);
        self.flags.back.store(is_back, Ordering::Relaxed);
        if self.live.is_some() && self.flags.dead.load(Ordering::Acquire) {
            if let (Some(mut node), Some(broken)) = (self.live.take(), &self.broken) {
                // Its sessions are ended here: otherwise the next node's would be refused for a time-out.
                node.end(inbox);
                // If the watching thread has ended, the node is dropped.
                let _gone = broken.send(node);
            }
        } else if self.live.is_none()
            && let Ok(mut node) = self.mended.try_recv()
        {
            node.bodies(&std::mem::take(&mut self.missed));
            self.live = Some(node);
            self.number += 1;
            self.tell_names = true;
        }
    }
}

impl Drop for LastingNode {
    fn drop(&mut self) {
        self.flags.ended.store(true, Ordering::Release);
        self.broken = None;
        if let Some(watcher) = self.watcher.take() {
            watcher.thread().unpark();
            let _told_by_its_panic = watcher.join();
        }
    }
}

/// Watches the node, and opens it again if necessary.
fn watch(
    (opener, scene): (&Opener, &Mutex<RosScene>),
    flags: &Flags,
    to_mend: &Receiver<RosNode>,
    give: &Sender<RosNode>,
) {
    let pause = || {
        std::thread::park_timeout(LOOK);
        flags.ended.load(Ordering::Acquire)
    };
    let mut back_ns = 0;
    while !pause() {
        let now_ns = SystemClock.boottime_ns();
        if !dds_lives() {
            tracing::error!(
                "ROS 2: a thread of DDS has ended (SIGSTOP and SIGCONT, or a debugger, do that): the node is opened anew"
            );
        } else if flags.back.load(Ordering::Relaxed)
            && (back_ns == 0 || now_ns.saturating_sub(back_ns) >= BACK_NS)
        {
            back_ns = now_ns;
            tracing::warn!(
                "ROS 2: a DDS participant that counted as gone is heard again (a computer that slept, a network that was down, a process that was stopped), and DDS does not take it back: the node is opened anew, and others do not hear it for a second or two"
            );
        } else {
            continue;
        }
        flags.dead.store(true, Ordering::Release);
        let Ok(broken) = to_mend.recv() else { return };
        drop(broken);
        let mut told = false;
        let node = loop {
            let scene = RosScene {
                again: true,
                ..open(scene).clone()
            };
            match opener(&scene) {
                Ok(node) => break node,
                Err(e) if !told => {
                    told = true;
                    tracing::error!("ROS 2: {e}; it is tried again each second");
                }
                Err(_) => {}
            }
            if pause() {
                return;
            }
        };
        flags.dead.store(false, Ordering::Release);
        if give.send(node).is_err() {
            return;
        }
    }
}

/// Whether all threads of DDS exist; assumed without /proc.
fn dds_lives() -> bool {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else {
        return true;
    };
    let mut seen = [false; DDS_THREADS.len()];
    for task in tasks.flatten() {
        let name = std::fs::read_to_string(task.path().join("comm")).unwrap_or_default();
        for (seen, wanted) in seen.iter_mut().zip(DDS_THREADS) {
            *seen |= name.trim_end() == wanted;
        }
    }
    seen == [true; DDS_THREADS.len()]
}

impl Door for LastingNode {
    fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        match &mut self.live {
            Some(node) => node.wait(timeout_ns, clock),
            None => Ok(Wake::default()),
        }
    }

    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        self.exchange(inbox);
        if let Some(node) = &mut self.live {
            node.receive(inbox, clock);
        }
    }

    fn demand(&mut self) -> Demand {
        self.live.as_mut().map(Door::demand).unwrap_or_default()
    }

    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
        let Some(node) = &mut self.live else {
            return Ok(Undelivered::default());
        };
        if std::mem::take(&mut self.tell_names) && !outbox.names_changed {
            let mut whole = outbox.clone();
            whole.names_changed = true;
            return node.publish(&whole);
        }
        node.publish(outbox)
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        match &mut self.live {
            Some(node) => node.publish_tick(tick),
            None => Ok(()),
        }
    }

    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
        let number = self.number << NODE_SHIFT;
        if let Some(node) = &mut self.live {
            node.requests(&mut |token, header, payload| {
                take(RequestToken(token.0 | number), header, payload);
            });
        }
    }

    fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
        match &mut self.live {
            Some(node) if token.0 >> NODE_SHIFT == self.number => {
                let token = RequestToken(token.0 & ((1 << NODE_SHIFT) - 1));
                node.answer(token, ok, json)
            }
            // The client's request ended with the node.
            _ => Ok(()),
        }
    }

    fn settings(&mut self, take: &mut dyn FnMut(Setting)) {
        if let Some(node) = &mut self.live {
            node.settings(take);
        }
    }

    fn follows_bodies(&self) -> bool {
        true
    }

    fn bodies(&mut self, changes: &[BodyChange]) {
        let mut scene = open(&self.scene);
        changes.iter().for_each(|change| scene.follow(change));
        drop(scene);
        match &mut self.live {
            Some(node) => node.bodies(changes),
            None => self.missed.extend_from_slice(changes),
        }
    }

    fn tell(&mut self, words: &str) {
        if let Some(node) = &mut self.live {
            node.tell(words);
        }
    }

    fn housekeeping(&mut self) {
        if let Some(node) = &mut self.live {
            node.housekeeping();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::args::RosArgs;
    use super::super::env::{Network, Range};
    use super::super::wheel::tests::domain;
    use super::super::{RosOptions, RosSourceSpec};
    use super::*;
    use crate::config::{RosKind, RosSource};

    #[test]
    fn bug_the_session_of_a_node_that_is_given_up_was_not_over_until_its_time_out() {
        let network = Network {
            domain: domain(5),
            range: Range::Localhost,
            pinned: false,
            unsecured: false,
            cyclone: false,
        };
        let opener = move |scene: &RosScene| {
            let options = RosOptions {
                args: RosArgs::parse(&[]).map_err(Error::Usage)?,
                network,
                boot_id: 7,
                session: 9,
            };
            RosNode::open(&options, scene, Box::new(|| {}))
        };
        let scene = RosScene {
            sources: vec![RosSourceSpec {
                name: "tf".to_owned(),
                timeout_ns: 1,
                ros2: Some(RosSource {
                    kind: RosKind::Tf,
                    topic: "/tf".to_owned(),
                    static_topic: "/tf_static".to_owned(),
                    max_skew_ns: 1,
                }),
            }],
            ..RosScene::default()
        };
        let mut node = LastingNode::open(scene, Box::new(opener)).unwrap();
        let mut inbox = Inbox::default();
        node.receive(&mut inbox, &SystemClock);
        assert!(inbox.is_empty());
        // As the watching thread would set it.
        node.flags.dead.store(true, Ordering::Release);
        node.receive(&mut inbox, &SystemClock);
        assert_eq!(inbox.ended(), [9]);
        inbox.clear();
        node.receive(&mut inbox, &SystemClock);
        assert!(inbox.is_empty(), "said once");
    }
}
