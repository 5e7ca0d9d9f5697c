//! The node's services: scene edits as requests of the daemon, answered when the tick has applied them; the gap of two
//! bodies; a tick at once.
//!
//! In: requests of anybody in the domain, on the receiving thread. Out: the JSON of a request, as shared memory carries
//! it, so that both have one reader; responses.

mod edits;
mod gap;

use std::collections::BTreeMap;
use std::sync::Mutex;

use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{Message, Name, Node, RmwRequestId, Server, ServiceMapping, ServiceTypeName};
use rustdds::mio1::event::Source as _;
use rustdds::mio1::{Interest, Registry, Token};
use serde_json::{Value, json};

use edits::{attach, filter, put, short};
use gap::told;

use super::names::Names;
use super::open;
use super::shared::{Say, Shared};
use super::topics::{TypeName, failed};
use crate::error::{Error, Result};
use crate::wire::ros::{
    AttachBody, Edited, EnableBody, Gap, GapTold, PutBody, RemoveBody, Reset, SetFilter, TickNow,
    Ticked,
};
use crate::wire::{self, Answer, MessageHeader};

/// Requests that wait for their answer; more are refused at once.
const OPEN_MAX: usize = 64;

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

/// What is asked of the daemon.
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

/// What stands between the receiving thread and the tick thread.
#[derive(Debug, Default)]
pub(super) struct Desk {
    /// Requests that the tick thread has not taken: token, JSON.
    pub(super) asked: Mutex<Vec<(u64, Vec<u8>)>>,
    /// Ticks at once that it has not taken: tokens.
    pub(super) ticks: Mutex<Vec<u64>>,
    /// Answers that the receiving thread has not taken.
    pub(super) answered: Mutex<Vec<(u64, Answer)>>,
    /// Ticks that were asked for.
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
    /// Answers to edits whose names are not known here yet.
    late: Vec<(u64, Answer)>,
    next: u64,
    allowed: bool,
}

impl Services {
    /// Creates them.
    ///
    /// * `allowed` - whether edits are done.
    ///
    /// # Errors
    /// `Error::Usage` when remaps collide; `Error::Io` when DDS refuses.
    pub(super) fn create(node: &mut Node, names: &mut Names, allowed: bool) -> Result<Self> {
        let kind = |kind| ("sweepd_msgs", kind);
        Ok(Self {
            put: server(node, names, "~/put_body", kind("PutBody"))?,
            remove: server(node, names, "~/remove_body", kind("RemoveBody"))?,
            enable: server(node, names, "~/enable_body", kind("EnableBody"))?,
            attach: server(node, names, "~/attach_body", kind("AttachBody"))?,
            filter: server(node, names, "~/set_filter", kind("SetFilter"))?,
            reset: server(node, names, "~/reset", kind("Reset"))?,
            gap: server(node, names, "~/gap", kind("Gap"))?,
            tick: server(node, names, "~/tick_now", kind("TickNow"))?,
            pending: BTreeMap::new(),
            ticks: BTreeMap::new(),
            late: Vec::new(),
            next: 1,
            allowed,
        })
    }

    /// Registers them behind the subscriptions.
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

    /// Takes requests and sends responses; whether the tick thread has something to do.
    pub(super) fn round(&mut self, desk: &Desk, shared: &Shared) -> bool {
        self.respond(desk, shared);
        let mut asked = Vec::new();
        receive(&self.put, shared, |id, r| {
            asked.push((Verb::Put, id, put(&r)))
        });
        receive(&self.remove, shared, |id, r| {
            asked.push((Verb::Remove, id, Ok(json!({ "remove": r.name }))));
        });
        receive(&self.enable, shared, |id, r| {
            let edit = json!({ "enable": { "body": r.name, "enabled": r.enabled } });
            asked.push((Verb::Enable, id, Ok(edit)));
        });
        receive(&self.attach, shared, |id, r| {
            asked.push((Verb::Attach, id, Ok(attach(&r))))
        });
        receive(&self.filter, shared, |id, r| {
            asked.push((Verb::Filter, id, filter(&r)))
        });
        receive(&self.reset, shared, |id, r| {
            let edit = match r.source.as_str() {
                "" => json!({ "reset": {} }),
                source => json!({ "reset": { "source": source } }),
            };
            asked.push((Verb::Reset, id, Ok(edit)));
        });
        receive(&self.gap, shared, |id, r| {
            let names = json!({ "gap": { "a": r.name_a, "b": r.name_b } });
            asked.push((Verb::Gap, id, Ok(names)));
        });
        let mut came = !asked.is_empty();
        for (verb, id, what) in asked {
            self.ask(verb, id, what, desk, shared);
        }
        let mut ticks = Vec::new();
        receive(&self.tick, shared, |id, _| ticks.push(id));
        for id in ticks {
            came = true;
            if self.ticks.len() >= OPEN_MAX {
                let refusal = Ticked {
                    message: crowded(),
                    ..Ticked::default()
                };
                let sent = self.tick.send_response(id, refusal);
                shared.note_unsent(u64::from(sent.is_err()));
                continue;
            }
            let token = self.token();
            self.ticks.insert(token, id);
            open(&desk.ticks).push(token);
        }
        came
    }

    /// Whether answers wait for names.
    pub(super) fn wait(&self) -> bool {
        !self.late.is_empty()
    }

    fn token(&mut self) -> u64 {
        self.next += 1;
        self.next
    }

    fn ask(
        &mut self,
        verb: Verb,
        id: RmwRequestId,
        what: std::result::Result<Value, String>,
        desk: &Desk,
        shared: &Shared,
    ) {
        let refusal = match what {
            _ if verb != Verb::Gap && !self.allowed => {
                "edits are refused: start the node with -p ros.allow_edits:=true".to_owned()
            }
            _ if self.pending.len() >= OPEN_MAX => crowded(),
            Err(why) => why,
            Ok(what) => {
                let request = if verb == Verb::Gap {
                    what
                } else {
                    shared.say(Say::Info, &in_words(&what));
                    json!({ "edits": [what] })
                };
                let token = self.token();
                self.pending.insert(token, (verb, id));
                open(&desk.asked).push((token, request.to_string().into_bytes()));
                return;
            }
        };
        let answer = Answer {
            error: Some(refusal),
            ..Answer::default()
        };
        self.send(verb, id, answer, shared);
    }

    fn respond(&mut self, desk: &Desk, shared: &Shared) {
        // Taken in statements of their own: a loop would keep the lock while DDS sends, and the tick thread would wait
        // for it.
        let mut answered = std::mem::take(&mut self.late);
        answered.append(&mut open(&desk.answered));
        let ticked = std::mem::take(&mut *open(&desk.ticked));
        let names_rev = shared.names_rev();
        for (token, answer) in answered {
            // Whoever has the answer may send poses by the names that it brought.
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
            let sent = self.tick.send_response(id, response);
            shared.note_unsent(u64::from(sent.is_err()));
        }
    }

    fn send(&self, verb: Verb, id: RmwRequestId, answer: Answer, shared: &Shared) {
        if let (Some(why), true) = (&answer.error, verb != Verb::Gap) {
            shared.say(Say::Warn, &format!("an edit over ROS 2 was refused: {why}"));
        }
        let sent = match verb {
            Verb::Gap => self.gap.send_response(id, told(answer)),
            Verb::Put => self.put.send_response(id, edited(answer)),
            Verb::Remove => self.remove.send_response(id, edited(answer)),
            Verb::Enable => self.enable.send_response(id, edited(answer)),
            Verb::Attach => self.attach.send_response(id, edited(answer)),
            Verb::Filter => self.filter.send_response(id, edited(answer)),
            Verb::Reset => self.reset.send_response(id, edited(answer)),
        };
        shared.note_unsent(u64::from(sent.is_err()));
    }
}

/// Why a request is refused that would be one too many.
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

/// An edit for the log: its verb, and the body it names.
fn in_words(edit: &Value) -> String {
    let entry = edit.as_object().and_then(|edit| edit.iter().next());
    let verb = entry.map_or("", |(verb, _)| verb.as_str());
    let body = entry.and_then(|(_, what)| what.get("name"));
    let body = body.map_or_else(|| short(edit), ToString::to_string);
    format!("edit over ROS 2: {verb} {body}")
}

/// Creates a server.
///
/// # Errors
/// `Error::Usage` when remaps collide; `Error::Io` when DDS refuses.
pub(super) fn server<Q: Message + Clone + 'static, R: Message + 'static>(
    node: &mut Node,
    names: &mut Names,
    name: &str,
    (package, kind): TypeName,
) -> Result<Server<Q, R>> {
    let full = names.claim(name).map_err(Error::Usage)?;
    let parsed = Name::parse(&full).map_err(|e| Error::Usage(format!("{full}: {e}")))?;
    let qos = QosProfile::publisher_default()
        .history(History::KeepLast { depth: 10 })
        .reliability_reliable(WhenFull::Fail);
    let kind = ServiceTypeName::new(package, kind);
    node.create_server(ServiceMapping::Enhanced, &parsed, &kind, qos.clone(), qos)
        .map_err(|e| failed(&full, e))
}

/// Has the thread that waits on the registry woken by requests.
///
/// # Errors
/// Those of the system.
pub(super) fn register<Q: Message + 'static, R: Message + 'static>(
    server: &mut Server<Q, R>,
    registry: &Registry,
    token: Token,
) -> std::io::Result<()> {
    server.register(registry, token, Interest::READABLE)
}

/// Takes the requests that wait.
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
