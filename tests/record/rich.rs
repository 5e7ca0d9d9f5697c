//! A run with every kind of input that an engine accepts: meshes from files and from blobs, a cloth, a bullet, applied
//! and refused edits, settings, sources that end, fall silent and restart, invalid poses.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex};

use sweepd::config::Mode;
use sweepd::time::ManualClock;
use sweepd::transport::Setting;
use sweepd::transport::client::{Client, FrameInfo, Link as _, Part, Rows, Topics};
use sweepd::transport::memory::{Hub, MemoryLink};
use sweepd::wire::{RequestHeader, TransformRow, TransformVelRow, VertexRow, WIRE_VERSION};

use super::common::Rng;
use super::stage::{self, Folder};

const CELLS: u16 = 10;
/// Time between two rounds of frames, nanoseconds.
const FRAME_NS: u64 = 10_000_000;

/// Parameters of a run.
pub struct Play<'a> {
    pub seed: u64,
    pub rounds: usize,
    /// Work units per tick.
    pub units: Option<u64>,
    /// Time per tick and duration of each clock read, nanoseconds.
    pub time_ns: Option<(u64, u64)>,
    pub sink: Option<&'a stage::Make<'a>>,
}

impl Default for Play<'_> {
    fn default() -> Self {
        Self {
            seed: 11,
            rounds: 900,
            units: Some(400),
            time_ns: None,
            sink: None,
        }
    }
}

/// Results of a run.
#[derive(Debug, Default)]
pub struct Told {
    pub ticks: u64,
    pub contacts: usize,
    pub answers: usize,
}

fn scene(play: &Play<'_>) -> String {
    let mut text = String::from("[run]\nmode = \"on_all\"\nheartbeat_ms = 50\n");
    if let Some(units) = play.units {
        let _ = writeln!(text, "budget_units = {units}");
    }
    if let Some((time_ns, _)) = play.time_ns {
        let _ = writeln!(text, "budget_ms = {}", time_ns as f64 / 1e6);
    }
    text += "[[source]]\nname = \"sim\"\ntimeout_ms = 60\n\
             [[source]]\nname = \"other\"\ntimeout_ms = 45\n\
             [[body]]\nname = \"floor\"\nid = 100\nmoves = false\n\
             shape = { type = \"half_space\", normal = [0, 0, 1] }\n\
             [[body]]\nname = \"terrain\"\nid = 101\nmoves = false\n\
             shape = { type = \"height_field\", heights = [[0, 0.3, 0], [0.3, 0.1, 0.2], [0, 0.2, 0]], \
             size = [2, 2], base_m = 0.2 }\n";
    let shapes = [
        "{ type = \"sphere\", radius = 0.3 }",
        "{ type = \"box\", half_extents = [0.2, 0.3, 0.25] }",
        "{ type = \"trimesh\", file = \"wedge.stl\", scale = [0.4, 0.4, 0.4] }",
        "{ type = \"convex\", file = \"wedge.obj\", scale = [0.5, 0.5, 0.5] }",
        "{ type = \"capsule\", radius = 0.15, half_height = 0.3 }",
        "{ type = \"cylinder\", radius = 0.2, half_height = 0.2 }",
    ];
    let more = [
        "report_within_m = 0.1\n",
        "on_stale = \"hold\"\n",
        "max_speed_mps = 2.0\n",
        "on_stale = \"remove\"\n",
        "priority = 3.0\n",
    ];
    for id in 1..=18_usize {
        let (shape, more) = (shapes[id % shapes.len()], more[id % more.len()]);
        let source = if id % 3 == 0 { "other" } else { "sim" };
        let _ = write!(
            text,
            "[[body]]\nname = \"b{id}\"\nid = {id}\nsource = \"{source}\"\nshape = {shape}\n{more}"
        );
    }
    text += "[[body]]\nname = \"bullet\"\nid = 40\nsource = \"other\"\ncontinuous = true\nteleport_m = 3.0\n\
             shape = { type = \"sphere\", radius = 0.1 }\n\
             [[body]]\nname = \"pair\"\nid = 41\nsource = \"sim\"\n\
             [[body.shape]]\ntype = \"sphere\"\nradius = 0.2\n\
             [[body.shape]]\ntype = \"box\"\nhalf_extents = [0.1, 0.1, 0.3]\nposition = [0.2, 0, 0]\n";
    let (vertices, faces) = cloth_mesh();
    let _ = write!(
        text,
        "[[body]]\nname = \"cloth\"\nid = 42\nsource = \"sim\"\ndeforms = true\n\
         shape = {{ type = \"trimesh\", vertices = {vertices:?}, faces = {faces:?} }}\n"
    );
    text
}

fn place(k: u16) -> f32 {
    f32::from(k) * 2.0 / f32::from(CELLS) - 1.0
}

fn cloth_mesh() -> (Vec<[f32; 3]>, Vec<[u16; 3]>) {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for i in 0..=CELLS {
        for j in 0..=CELLS {
            vertices.push([place(j), place(i), 0.2]);
            if i < CELLS && j < CELLS {
                let a = i * (CELLS + 1) + j;
                let (b, c, d) = (a + 1, a + CELLS + 2, a + CELLS + 1);
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    (vertices, faces)
}

/// The cloth, twisted and stretched more and more, so that its tree wears.
fn cloth(round: usize) -> Vec<VertexRow> {
    let phase = (round % 200) as f32 / 200.0;
    let (stretch, height) = (1.0 + 2.0 * phase, 0.2 + 0.1 * (20.0 * phase).sin());
    let rows = (0..=CELLS).flat_map(|i| (0..=CELLS).map(move |j| (place(j), place(i))));
    let bent = rows.map(|(x, y)| VertexRow {
        position: [stretch * x, stretch * y, height + 0.1 * (stretch - 1.0) * x],
    });
    bent.collect()
}

/// The clients of a run.
struct Cast {
    hub: Hub,
    clock: Arc<ManualClock>,
    sim: Option<Client>,
    other: Option<Client>,
    desk: MemoryLink,
    panel: stage::Panel,
    random: Rng,
    /// Positions by id, from 1.
    places: Vec<[f64; 3]>,
    told: Told,
    asked: u64,
}

impl Cast {
    fn client(&self, source: &str) -> Client {
        let clock = Arc::clone(&self.clock) as _;
        let link = Box::new(self.hub.link());
        let mut client = Client::over(link, clock, Some(source), 0).unwrap();
        client.subscribe(Topics::ALL).unwrap();
        client
    }

    /// Sends the frames of a round, and does the other events of this round.
    fn act(&mut self, round: usize) {
        if self.sim.is_none() {
            self.sim = Some(self.client("sim"));
        }
        if self.other.is_none() && round % 90 > 20 {
            self.other = Some(self.client("other"));
        }
        for place in &mut self.places {
            for x in place.iter_mut() {
                *x = (*x + self.random.between(-0.04, 0.04)).clamp(-0.9, 0.9);
            }
        }
        if !(200..212).contains(&(round % 300)) {
            self.send_sim(round);
        }
        self.send_other(round);
        match round % 300 {
            // The client of a source disconnects, and later reconnects with another session.
            85 => self.other = None,
            140 => self.sim.as_mut().unwrap().reset_epoch(),
            _ => {}
        }
        if let Some(client) = self.sim.as_mut() {
            client.latest().unwrap();
            let contacts = client.view().contacts();
            self.told.contacts += contacts.map_or(0, |message| message.rows.len());
        }
        self.edit(round);
        self.set(round);
    }

    fn row(&mut self, id: u64) -> TransformRow {
        let angle = 0.1 * self.places[id as usize][0];
        let mut row = TransformRow {
            body: id,
            position: self.places[id as usize],
            orientation: [0.0, 0.0, f64::sin(angle), f64::cos(angle)],
            ..TransformRow::default()
        };
        match self.random.below(600) {
            0 => row.position[0] = f64::NAN,
            1 => row.orientation = [0.0; 4],
            2 => row.body = 999,
            _ => {}
        }
        row
    }

    fn send_sim(&mut self, round: usize) {
        let ids = (1..=18).filter(|id| id % 3 != 0).chain([41, 42]);
        let rows: Vec<_> = ids.map(|id| self.row(id)).collect();
        let part = self.random.once_in(9);
        let client = self.sim.as_mut().unwrap();
        client.send_vertices(42, Part::Full, &cloth(round)).unwrap();
        let info = FrameInfo {
            stamp_ns: round as u64 * FRAME_NS,
            partial: part,
            ..FrameInfo::default()
        };
        let rows = if part { &rows[..7] } else { &rows[..] };
        client.send(&info, Rows::Poses(rows)).unwrap();
    }

    fn send_other(&mut self, round: usize) {
        let ids: Vec<_> = (1..=18).filter(|id| id % 3 == 0).collect();
        let mut rows: Vec<_> = ids.iter().map(|id| self.row(*id)).collect();
        let side = if round.is_multiple_of(2) { 1.2 } else { -1.2 };
        rows.push(TransformRow {
            body: 40,
            position: [side, 0.0, 0.4],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..TransformRow::default()
        });
        let moving: Vec<_> = (rows.iter())
            .map(|row| TransformVelRow {
                transform: *row,
                linear: [0.1, -0.2, 0.0],
                angular: [0.0, 0.0, 1.0],
            })
            .collect();
        let paused = self.random.once_in(12);
        let Some(client) = self.other.as_mut() else {
            return;
        };
        if paused {
            client.pause().unwrap();
        } else {
            let info = FrameInfo::default();
            client.send(&info, Rows::Moving(&moving)).unwrap();
        }
    }

    /// Sends a request in some rounds; reads the answers that have come.
    fn edit(&mut self, round: usize) {
        let mut text = Vec::new();
        while self.desk.answer(&mut text).unwrap().is_some() {
            self.told.answers += 1;
        }
        if round % 12 != 5 {
            return;
        }
        let mut blobs = Vec::new();
        for x in [0.0_f64, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5, 0.1] {
            blobs.extend(x.to_le_bytes());
        }
        for k in [0_u32, 1, 2] {
            blobs.extend(k.to_le_bytes());
        }
        let edits = match (round / 12) % 12 {
            0 => {
                r#"{"put": {"name": "new", "source": "sim", "moves": false, "position": [0.3, 0, 0.2],
                "shape": {"type": "box", "half_extents": [0.2, 0.2, 0.2]}}}"#
            }
            1 => {
                r#"{"put": {"name": "sheet", "moves": false, "shape": {"type": "trimesh",
                "vertices_blob": {"offset": 0, "count": 3}, "faces_blob": {"offset": 72, "count": 1}}}}"#
            }
            2 => {
                r#"{"put": {"name": "part", "moves": false, "position": [0, 0.4, 0],
                "shape": {"type": "trimesh", "file": "wedge.obj", "scale": [0.3, 0.3, 0.3]}}}"#
            }
            3 => r#"{"attach": {"body": "new", "to": "b1", "position": [0, 0, 0.3]}}"#,
            4 => {
                r#"{"rule": {"action": "ignore", "a": "b*", "b": "floor", "reason": "test"}}, {"remove": "sheet"}"#
            }
            5 => r#"{"remove": "nobody"}"#,
            6 => r#"{"detach": "new"}, {"enable": {"body": "b2", "enabled": false}}"#,
            7 => {
                r#"{"drop_rules": {"a": "b*", "b": "floor"}}, {"enable": {"body": "b2", "enabled": true}}"#
            }
            8 => {
                r#"{"filter": {"body": "b4", "group": 2, "mask": 1}}, {"margin": {"body": "b5", "report_within_m": 0.4}}"#
            }
            9 => r#"{"remove": "part"}, {"remove": "new"}"#,
            10 => r#"{"reset": {"source": "other"}}"#,
            _ => {
                r#"{"put": {"name": "b7", "id": 7, "source": "sim", "shape": {"type": "cone", "radius": 0.3, "half_height": 0.2}}}"#
            }
        };
        let more = if round.is_multiple_of(5) {
            ", \"validate\": true"
        } else {
            ""
        };
        let json = format!("{{\"edits\": [{edits}]{more}}}");
        self.asked += 1;
        let header = RequestHeader {
            json_len: json.len() as u64,
            request: self.asked,
            schema: WIRE_VERSION,
            reserved: 0,
        };
        self.desk
            .request(&header, json.as_bytes(), &[&blobs])
            .unwrap();
    }

    fn set(&mut self, round: usize) {
        let setting = match round % 300 {
            100 => Setting::Margin(Some(0.15)),
            130 => Setting::Margin(None),
            160 => Setting::Reset,
            170 => Setting::Timeout {
                source: 1,
                timeout_ns: 35_000_000,
            },
            180 => Setting::Mode(Mode::Rate(100.0)),
            190 => Setting::Mode(Mode::OnAll),
            195 => Setting::TickNow,
            _ => return,
        };
        self.panel.lock().unwrap().push(setting);
    }
}

/// Runs it, and records it in the folder's file.
pub fn play(folder: &Folder, play: &Play<'_>) -> Told {
    let (hub, clock) = (Hub::new(), Arc::new(ManualClock::new(1_000_000_000)));
    if let Some((_, step_ns)) = play.time_ns {
        clock.step_each_read(step_ns);
    }
    let panel: stage::Panel = Arc::new(Mutex::default());
    let mut random = Rng::new(play.seed);
    let mut cast = Cast {
        desk: hub.link(),
        sim: None,
        other: None,
        places: (0..43)
            .map(|_| [0.0; 3].map(|_: f64| random.between(-0.9, 0.9)))
            .collect(),
        hub: hub.clone(),
        clock: Arc::clone(&clock),
        panel: Arc::clone(&panel),
        random,
        told: Told::default(),
        asked: 0,
    };
    let text = scene(play);
    let (mut round, mut calls) = (0, 0_usize);
    let ticks = stage::run(folder, &text, &hub, &clock, panel, play.sink, || {
        calls += 1;
        // The server says hello in its first round; each frame is followed by several rounds.
        if calls > 1 && calls % 4 == 0 && round < play.rounds {
            clock.advance(FRAME_NS);
            cast.act(round);
            round += 1;
        }
        // Gives the worker thread time to run.
        if calls % 64 == 0 {
            std::thread::yield_now();
        }
        round == play.rounds && calls % 4 == 3
    });
    Told { ticks, ..cast.told }
}
