//! The order of records, a slow disk, a sink that fails, a writer that holds the lock.

use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};

use super::*;
use crate::record::given::Asked;
use crate::scene::Scene;
use crate::tick::TickInput;
use crate::tick::build::build_shapes;
use crate::time::ManualClock;

/// Reports its calls; `tick` returns only when the test allows it.
struct Slow {
    told: Sender<String>,
    may: Receiver<Result<()>>,
}

impl Sink for Slow {
    fn tick(&mut self, record: &TickRecord, _: bool) -> Result<()> {
        let tick = record.out.tick.header.tick;
        self.told.send(format!("tick {tick}")).unwrap();
        self.may.recv().unwrap_or(Ok(()))
    }
    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
    fn end(&mut self, why: &str) -> Result<()> {
        self.told.send(format!("end {why}")).unwrap();
        Ok(())
    }
}

/// An engine with one ball.
fn engine() -> Engine {
    let text = "[[source]]\nname = \"s\"\n[[body]]\nname = \"a\"\nshape = { type = \"sphere\", radius = 1.0 }\n";
    let scene = Scene::parse(text, "s.toml", Path::new("")).unwrap();
    let shapes = build_shapes(&scene).unwrap();
    let clock = Arc::new(ManualClock::new(1));
    Engine::new(&scene, shapes.bodies, 7, clock).unwrap()
}

fn run(engine: &mut Engine, recorder: &mut Recorder, inbox: &Inbox) {
    let ask = Ask::default();
    engine.tick(TickInput {
        inbox,
        edits: &[],
        demand: ask.demand,
        budget: ask.budget,
        cause: ask.cause,
        cause_source: None,
        woke_ns: 0,
        pulse: None,
    });
    recorder.tick(inbox, ask, engine);
}

fn slow() -> (Recorder, Receiver<String>, Sender<Result<()>>) {
    let (told, heard) = channel();
    let (let_go, may) = channel();
    let sink = Box::new(Slow { told, may });
    (Recorder::start(sink).unwrap(), heard, let_go)
}

#[test]
fn records_are_written_in_order_and_the_end_comes_last() {
    let (mut recorder, heard, let_go) = slow();
    let mut engine = engine();
    for _ in 0..50 {
        run(&mut engine, &mut recorder, &Inbox::default());
        let_go.send(Ok(())).unwrap();
    }
    recorder.finish().unwrap();
    let mut wanted: Vec<_> = (1..=50).map(|tick| format!("tick {tick}")).collect();
    wanted.push("end ".to_owned());
    assert_eq!(heard.try_iter().collect::<Vec<_>>(), wanted);
}

#[test]
fn bug_a_recording_that_nobody_ended_says_so() {
    let (mut recorder, heard, let_go) = slow();
    drop(let_go);
    run(&mut engine(), &mut recorder, &Inbox::default());
    drop(recorder);
    let heard: Vec<_> = heard.try_iter().collect();
    assert_eq!(heard.len(), 2, "{heard:?}");
    assert!(
        heard[1].starts_with("end the daemon broke down"),
        "{heard:?}"
    );
}

#[test]
fn a_tick_does_not_wait_for_the_writer_and_nothing_is_lost() {
    let (mut recorder, heard, let_go) = slow();
    drop(let_go);
    let mut engine = engine();
    let desk = Arc::clone(&recorder.desk);
    for round in 0..10 {
        // The lock is held: a wait for it would never end.
        let taken = desk.lock();
        for _ in 0..round {
            run(&mut engine, &mut recorder, &Inbox::default());
        }
        assert!(recorder.held.len() >= round);
        drop(taken);
        run(&mut engine, &mut recorder, &Inbox::default());
    }
    recorder.finish().unwrap();
    let mut wanted: Vec<_> = (1..=55).map(|tick| format!("tick {tick}")).collect();
    wanted.push("end ".to_owned());
    assert_eq!(heard.try_iter().collect::<Vec<_>>(), wanted);
}

#[test]
fn a_disk_that_does_not_follow_ends_the_recording_and_nothing_else() {
    let (mut recorder, heard, let_go) = slow();
    let mut engine = engine();
    // Frames of a source that the scene does not have, each a fifth of the limit of the queue.
    let mut inbox = Inbox::default();
    let rows = RECORD_QUEUE_BYTES_MAX / 5 / size_of::<crate::wire::TransformRow>();
    inbox.push().transforms = vec![Default::default(); rows];
    for _ in 0..20 {
        run(&mut engine, &mut recorder, &inbox);
    }
    assert!(recorder.over && engine.ticks() == 20);
    drop(let_go);
    recorder.finish().unwrap();
    let heard: Vec<_> = heard.try_iter().collect();
    assert_eq!(heard.len(), 5, "{heard:?}");
    assert!(
        heard[4].starts_with("end the disk did not follow"),
        "{heard:?}"
    );
}

#[test]
fn bug_an_edit_larger_than_what_may_wait_ended_the_recording() {
    let (mut recorder, heard, let_go) = slow();
    let mut engine = engine();
    run(&mut engine, &mut recorder, &Inbox::default());
    let mut record = Box::<TickRecord>::default();
    record.edits.push(EditRecord {
        token: 0,
        origin: Origin::Asked(Asked {
            payload: vec![b' '; RECORD_QUEUE_BYTES_MAX + 1],
            ..Asked::default()
        }),
        outcome: Err("a body of that name is there".to_owned()),
    });
    recorder.held.push_back(record);
    for _ in 0..5 {
        run(&mut engine, &mut recorder, &Inbox::default());
    }
    assert!(!recorder.over);
    drop(let_go);
    recorder.finish().unwrap();
    let heard: Vec<_> = heard.try_iter().collect();
    assert_eq!((heard.len(), &*heard[7]), (8, "end "), "{heard:?}");
}

#[test]
fn a_sink_that_fails_is_told_once_and_takes_no_more() {
    let (mut recorder, heard, let_go) = slow();
    let mut engine = engine();
    let full = Error::io("cannot write x.mcap", std::io::Error::other("no space"));
    let_go.send(Err(full)).unwrap();
    run(&mut engine, &mut recorder, &Inbox::default());
    while recorder.desk.lock().failed.is_none() {
        std::thread::yield_now();
    }
    for _ in 0..5 {
        run(&mut engine, &mut recorder, &Inbox::default());
    }
    assert!(recorder.over);
    let error = recorder.finish().unwrap_err();
    assert!(error.to_string().contains("x.mcap"), "{error}");
    assert_eq!(heard.try_iter().collect::<Vec<_>>(), ["tick 1"]);
}
