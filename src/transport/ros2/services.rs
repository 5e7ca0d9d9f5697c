//! The node's services: scene edits, answered when a tick has applied them; the gap of two bodies; an immediate tick.
//!
//! In: requests of any node in the domain, on the receiving thread. Out: the same JSON requests as over shared memory,
//! so that both have one parser, built on a separate thread; responses.

mod edits;
mod gap;
mod scribe;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{Message, Name, Node, RmwRequestId, Server, ServiceMapping, ServiceTypeName};
use rustdds::mio1::event::Source as _;
use rustdds::mio1::{Interest, Registry, Token, Waker};
use serde_json::json;

use edits::{attach, filter, put};
use gap::told;
use scribe::{Scribe, Words};

use super::names::Names;
use super::open;
use super::reply;
use super::shared::{Say, Shared};
use super::topics::{In, TypeName, failed, patiently};
use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};
use crate::wire::ros::{
    AttachBody, Edited, EnableBody, Gap, GapTold, PutBody, RemoveBody, Reset, SetFilter, TickNow,
    Ticked,
};
use crate::wire::{self, Answer, MessageHeader};

/// Requests that wait for their response; more are refused at once.
const OPEN_MAX: usize = 64;
/// Requests and responses of a service that DDS keeps until all readers have acknowledged them. All clients share them:
/// with a depth of ten, a lost response was overwritten by those of other clients before it could be sent again.
const DEPTH: usize = 256;

impl Message for AttachBody {}
impl Message for Edited {}
impl Message for EnableBody {}
impl Message for Gap {}
impl Message for GapTold {}
impl Message for PutBody {}
impl Message for RemoveBody {}
impl Message for Reset {}
impl Message for SetFilter {}
impl Message for TickNow {}
impl Message for Ticked {}

/// Kind of a request to the daemon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verb {
    Gap,
    Put,
    Remove,
    Enable,
    Attach,
    Filter,
    Reset,
}

/// The mailbox between the receiving thread and the tick thread.
#[derive(Debug, Default)]
pub(super) struct Desk {
    /// Requests that the tick thread has not taken yet: token, JSON.
    pub(super) asked: Mutex<Vec<(u64, Vec<u8>)>>,
    /// Whether there are new requests, so that the tick thread must be woken.
    is_written: AtomicBool,
    /// Immediate ticks that the tick thread has not taken yet: tokens.
    pub(super) ticks: Mutex<Vec<u64>>,
    /// Answers that the receiving thread has not taken yet.
    pub(super) answered: Mutex<Vec<(u64, Answer)>>,
    /// Headers of requested ticks, by token, that the receiving thread has not taken yet.
    pub(super) ticked: Mutex<Vec<(u64, MessageHeader)>>,
}

/// The servers, on the receiving thread.
pub(super) struct Services {
    put: Server<PutBody, Edited>,
    remove: Server<RemoveBody, Edited>,
    enable: Server<EnableBody, Edited>,
    attach: Server<AttachBody, Edited>,
    filter: Server<SetFilter, Edited>,
    reset: Server<Reset, Edited>,
    gap: Server<Gap, GapTold>,
    tick: Server<TickNow, Ticked>,
    pending: BTreeMap<u64, (Verb, RmwRequestId)>,
    ticks: BTreeMap<u64, RmwRequestId>,
    /// Answers to edits whose names this node does not know yet.
    late: Vec<(u64, Answer)>,
    next: u64,
    allowed: bool,
    scribe: Option<Scribe>,
}

impl Services {
    /// Creates the servers.
    ///
    /// * `mapping` - how responses are matched to requests, which differs between the DDS implementations of ROS 2.
    /// * `allowed` - whether edits are allowed.
    ///
    /// # Errors
    /// `Error::Usage` when remaps collide; `Error::Io` when DDS refuses.
    pub(super) fn create(
        (node, mapping): (&mut Node, ServiceMapping),
        names: &mut Names,
        allowed: bool,
    ) -> Result<Self> {
        let kind = |kind| ("sweepd_msgs", kind);
        Ok(Self {
            put: server(node, mapping, names, "~/put_body", kind("PutBody"))?,
            remove: server(node, mapping, names, "~/remove_body", kind("RemoveBody"))?,
            enable: server(node, mapping, names, "~/enable_body", kind("EnableBody"))?,
            attach: server(node, mapping, names, "~/attach_body", kind("AttachBody"))?,
            filter: server(node, mapping, names, "~/set_filter", kind("SetFilter"))?,
            reset: server(node, mapping, names, "~/reset", kind("Reset"))?,
            gap: server(node, mapping, names, "~/gap", kind("Gap"))?,
            tick: server(node, mapping, names, "~/tick_now", kind("TickNow"))?,
            pending: BTreeMap::new(),
            ticks: BTreeMap::new(),
            late: Vec::new(),
            next: 1,
            allowed,
            scribe: None,
        })
    }

    /// Starts the thread that converts requests to JSON.
    ///
    /// * `waker` - of the receiving thread.
    ///
    /// # Errors
    /// `Error::Io` when the system has no thread left.
    pub(super) fn start(&mut self, shared: &Arc<Shared>, waker: Arc<Waker>) -> Result<()> {
        self.scribe = Some(Scribe::start(Arc::clone(shared), waker)?);
        Ok(())
    }

    /// Registers the servers with one token, after the subscriptions.
    pub(super) fn register(&mut self, registry: &Registry, token: Token) -> std::io::Result<()> {
        register(&mut self.put, registry, token)?;
        register(&mut self.remove, registry, token)?;
        register(&mut self.enable, registry, token)?;
        register(&mut self.attach, registry, token)?;
        register(&mut self.filter, registry, token)?;
        register(&mut self.reset, registry, token)?;
        register(&mut self.gap, registry, token)?;
        register(&mut self.tick, registry, token)
    }

    /// Takes requests and sends responses; returns whether the tick thread has work.
    pub(super) fn round(&mut self, desk: &Desk, shared: &Shared) -> bool {
        self.respond(desk, shared);
        let mut asked: Vec<(Verb, RmwRequestId, Words)> = Vec::new();
        receive(&self.put, shared, |id, r| {
            asked.push((Verb::Put, id, Box::new(move || put(&r))));
        });
        receive(&self.remove, shared, |id, r| {
            let edit = move || Ok(json!({ "remove": r.name }));
            asked.push((Verb::Remove, id, Box::new(edit)));
        });
        receive(&self.enable, shared, |id, r| {
            let edit = move || Ok(json!({ "enable": { "body": r.name, "enabled": r.enabled } }));
            asked.push((Verb::Enable, id, Box::new(edit)));
        });
        receive(&self.attach, shared, |id, r| {
            asked.push((Verb::Attach, id, Box::new(move || Ok(attach(&r)))));
        });
        receive(&self.filter, shared, |id, r| {
            asked.push((Verb::Filter, id, Box::new(move || filter(&r))));
        });
        receive(&self.reset, shared, |id, r| {
            let edit = move || match r.source.as_str() {
                "" => Ok(json!({ "reset": {} })),
                source => Ok(json!({ "reset": { "source": source } })),
            };
            asked.push((Verb::Reset, id, Box::new(edit)));
        });
        receive(&self.gap, shared, |id, r| {
            let names = move || Ok(json!({ "gap": { "a": r.name_a, "b": r.name_b } }));
            asked.push((Verb::Gap, id, Box::new(names)));
        });
        for (verb, id, words) in asked {
            self.ask(verb, id, words, shared);
        }
        let mut came = desk.is_written.swap(false, Ordering::Acquire);
        let mut ticks = Vec::new();
        receive(&self.tick, shared, |id, _| ticks.push(id));
        for id in ticks {
            came = true;
            if self.ticks.len() >= OPEN_MAX {
                let refusal = Ticked {
                    message: crowded(),
                    ..Ticked::default()
                };
                reply::send((&self.tick, "~/tick_now"), id, refusal, shared);
                continue;
            }
            let token = self.token();
            self.ticks.insert(token, id);
            open(&desk.ticks).push(token);
        }
        came
    }

    fn token(&mut self) -> u64 {
        self.next += 1;
        self.next
    }

    /// Passes a request to the conversion thread, or refuses it before any work is done for it.
    fn ask(&mut self, verb: Verb, id: RmwRequestId, words: Words, shared: &Shared) {
        let token = self.token();
        let refusal = if verb != Verb::Gap && !self.allowed {
            "edits are refused: start the node with --ros-args -p ros.allow_edits:=true".to_owned()
        } else if self.pending.len() >= OPEN_MAX {
            crowded()
        } else if !(self.scribe.as_ref()).is_some_and(|scribe| scribe.take((token, verb, words))) {
            "the node closes".to_owned()
        } else {
            self.pending.insert(token, (verb, id));
            return;
        };
        let answer = Answer {
            error: Some(refusal),
            ..Answer::default()
        };
        self.send(verb, id, answer, shared);
    }

    fn respond(&mut self, desk: &Desk, shared: &Shared) {
        // Both lists are moved out first: the loops would hold the locks while DDS sends, and the tick thread would
        // wait for them.
        let mut answered = std::mem::take(&mut self.late);
        answered.append(&mut open(&desk.answered));
        let ticked = std::mem::take(&mut *open(&desk.ticked));
        let names_rev = shared.names_rev();
        for (token, answer) in answered {
            // A client that has the answer may send poses under the names that its edit added.
            if answer.scene_rev > names_rev {
                self.late.push((token, answer));
                continue;
            }
            let Some((verb, id)) = self.pending.remove(&token) else {
                continue;
            };
            self.send(verb, id, answer, shared);
        }
        for (token, header) in ticked {
            let Some(id) = self.ticks.remove(&token) else {
                continue;
            };
            let response = Ticked {
                success: true,
                message: String::new(),
                tick_header: wire::ros::tick_header(&header),
                word: wire::State::from_code(header.state)
                    .map_or("unknown", wire::State::word)
                    .to_owned(),
            };
            reply::send((&self.tick, "~/tick_now"), id, response, shared);
        }
    }

    fn send(&self, verb: Verb, id: RmwRequestId, answer: Answer, shared: &Shared) {
        if let (Some(why), true) = (&answer.error, verb != Verb::Gap) {
            let text = format!("an edit over ROS 2 was refused: {why}");
            shared.say_seldom(Say::Warn, &text, SystemClock.boottime_ns());
        }
        match verb {
            Verb::Gap => reply::send((&self.gap, "~/gap"), id, told(answer), shared),
            Verb::Put => reply::send((&self.put, "~/put_body"), id, edited(answer), shared),
            Verb::Remove => {
                reply::send((&self.remove, "~/remove_body"), id, edited(answer), shared)
            }
            Verb::Enable => {
                reply::send((&self.enable, "~/enable_body"), id, edited(answer), shared)
            }
            Verb::Attach => {
                reply::send((&self.attach, "~/attach_body"), id, edited(answer), shared)
            }
            Verb::Filter => reply::send((&self.filter, "~/set_filter"), id, edited(answer), shared),
            Verb::Reset => reply::send((&self.reset, "~/reset"), id, edited(answer), shared),
        }
    }
}

/// Why a request beyond the limit is refused.
fn crowded() -> String {
    format!("{OPEN_MAX} requests wait for their answers: ask again later")
}

fn edited(answer: Answer) -> Edited {
    Edited {
        success: answer.ok,
        message: answer.error.unwrap_or_default(),
        warnings: answer.warnings,
        scene_rev: answer.scene_rev,
    }
}

/// Creates a server.
///
/// # Errors
/// `Error::Usage` when remaps collide; `Error::Io` when DDS refuses.
pub(super) fn server<Q: Message + Clone + 'static, R: Message + 'static>(
    node: &mut Node,
    mapping: ServiceMapping,
    names: &mut Names,
    name: &str,
    (package, kind): TypeName,
) -> Result<Server<Q, R>> {
    let full = names.claim(name).map_err(Error::Usage)?;
    let parsed = service_name(&full, names.namespace())?;
    let qos = QosProfile::publisher_default()
        .history(History::KeepLast { depth: DEPTH })
        .reliability_reliable(WhenFull::Fail);
    let kind = ServiceTypeName::new(package, kind);
    let make = || node.create_server(mapping, &parsed, &kind, qos.clone(), qos.clone());
    patiently(In::AT_START, make).map_err(|e| failed(&full, e))
}

/// Converts a full name for ros2-client: relative to the node's namespace, which alone may contain `__` there.
///
/// # Errors
/// `Error::Usage` for a name with `__` after the namespace.
fn service_name(full: &str, namespace: &str) -> Result<Name> {
    let root = namespace.trim_end_matches('/');
    let behind = full
        .strip_prefix(root)
        .and_then(|own| own.strip_prefix('/'));
    let own = behind.filter(|_| !root.is_empty()).unwrap_or(full);
    Name::parse(own).map_err(|_| {
        Error::Usage(format!(
            "{full} cannot be the name of a service here: write no two _ in a row behind the namespace"
        ))
    })
}

/// Registers a server, so that its requests wake the thread that polls the registry.
///
/// # Errors
/// The error of the operating system.
pub(super) fn register<Q: Message + 'static, R: Message + 'static>(
    server: &mut Server<Q, R>,
    registry: &Registry,
    token: Token,
) -> std::io::Result<()> {
    server.register(registry, token, Interest::READABLE)
}

/// Takes the waiting requests, at most `OPEN_MAX`.
pub(super) fn receive<Q: Message + 'static, R: Message + 'static>(
    server: &Server<Q, R>,
    shared: &Shared,
    mut each: impl FnMut(RmwRequestId, Q),
) {
    for _ in 0..OPEN_MAX {
        match server.receive_request() {
            Ok(Some((id, request))) => each(id, request),
            Ok(None) => return,
            Err(_) => shared.note_undecodable(),
        }
    }
}

#[cfg(test)]
mod tests {
    use ros2_client::NodeName;

    use super::*;

    #[test]
    fn bug_services_of_a_namespace_with_two_underscores_could_not_be_opened() {
        for namespace in ["/", "/cell", "/robot__1", "/a/robot__1"] {
            let root = namespace.trim_end_matches('/');
            let node = NodeName::new(namespace, "sweepd").unwrap();
            for own in ["sweepd/gap", "gap"] {
                let full = format!("{root}/{own}");
                let name = service_name(&full, namespace).unwrap();
                let on_dds = name.to_dds_name("rq", &node, "Request");
                assert_eq!(on_dds, format!("rq{full}Request"));
            }
        }
        let elsewhere = service_name("/other/gap", "/cell").unwrap();
        assert!(elsewhere.is_absolute());
        assert!(service_name("/cellar/gap", "/cell").unwrap().is_absolute());
        let why = service_name("/cell/my__gap", "/cell").unwrap_err();
        assert!(why.to_string().contains("/cell/my__gap cannot be the name"));
    }
}
