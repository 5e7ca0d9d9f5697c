//! `changes` and `contact_changes`: lists kept from them equal the `pairs` and `contacts` that another process reads,
//! through edits, lost messages and restarts.

use sweepd::transport::client::{Client, FrameInfo, Heard, Rows, StepError, Topics};
use sweepd::wire::{EndCause, TransformRow};

use crate::live::{Desk, SECOND_NS, at, step, until};

const BODIES: u64 = 40;

fn scene() -> String {
    let mut text = String::from(
        "[run]\non_frame = \"sim\"\n[limits]\npair_rows = 100\n[[source]]\nname = \"sim\"\ntimeout_ms = 30000\n",
    );
    for id in 1..=BODIES {
        text += &format!(
            "[[body]]\nname = \"b{id}\"\nid = {id}\nreport_within_m = 0.5\n\
             shape = {{ type = \"sphere\", radius = 0.5 }}\n"
        );
    }
    text
}

fn changes_only(desk: &Desk, source: Option<&str>) -> Client {
    let mut client = desk.client(source);
    let topics = Topics {
        changes: true,
        ..Topics::default()
    };
    client.subscribe(topics).unwrap();
    client
}

/// Bodies in a row, the first `squeezed` of them close together; in each step another fifth of the bodies is shifted.
fn rows(number: u64, squeezed: u64) -> Vec<TransformRow> {
    let place = |id: u64| {
        let step = if id < squeezed { 0.2 } else { 1.2 };
        let shift = if (id + number).is_multiple_of(5) {
            0.3
        } else {
            0.0
        };
        #[allow(clippy::cast_precision_loss, reason = "small numbers")]
        let x = step * id as f64 + shift;
        at(id, x)
    };
    (1..=BODIES).map(place).collect()
}

/// Rows as text, so that NaN equals NaN.
fn text<T: std::fmt::Debug>(rows: impl Iterator<Item = T>) -> Vec<String> {
    rows.map(|row| format!("{row:?}")).collect()
}

/// The pairs that a reader received in a tick.
fn pairs_of(reader: &mut Client, tick: u64) -> Vec<String> {
    until("the tick with its pairs", || {
        reader.view().tick().header.tick >= tick
            || reader.wait_tick(SECOND_NS).unwrap() == Heard::Silence
    });
    assert_eq!(reader.view().tick().header.tick, tick);
    text(reader.view().pairs().unwrap().rows.iter().copied())
}

#[test]
fn lists_kept_from_changes_are_what_another_process_reads_in_pairs_and_contacts() {
    let desk = Desk::new();
    let _daemon = desk.run(&scene(), &[]);
    let mut client = changes_only(&desk, Some("sim"));
    let topics = Topics {
        contact_changes: true,
        ..Topics::default()
    };
    client.subscribe(topics).unwrap();
    let mut reader = desk.client(None);
    let topics = Topics {
        pairs: true,
        contacts: true,
        ..Topics::default()
    };
    reader.subscribe(topics).unwrap();
    let (mut deltas, mut cut, mut contact_deltas) = (0, 0, 0);
    for number in 1..=120 {
        // Squeezed bodies have more pairs than fit in the list.
        let squeezed = if number % 40 > 30 { 30 } else { 3 };
        match number {
            25 => request(&mut client, r#"{"edits": [{"remove": "b7"}]}"#),
            50 => request(
                &mut client,
                r#"{"edits": [{"enable": {"body": "b9", "enabled": false}}]}"#,
            ),
            75 => client.reset_epoch(),
            _ => {}
        }
        step(&mut client, &rows(number, squeezed));
        let tick = client.view().tick().header.tick;
        let list = client.view().list().unwrap();
        let header = list.changes().header;
        deltas += u64::from(header.base_tick != 0);
        cut += u64::from(header.message.truncated > 0);
        assert_eq!(
            text(list.iter()),
            pairs_of(&mut reader, tick),
            "step {number}"
        );
        let contacts = client.view().contact_list().unwrap();
        contact_deltas += u64::from(contacts.changes().header.base_tick != 0);
        let told = reader.view().contacts().unwrap();
        assert_eq!(
            text(contacts.iter()),
            text(told.rows.iter()),
            "step {number}"
        );
        for row in &told.rows {
            let of_pair = contacts.get(row.body_a, row.body_b);
            assert!(of_pair.contains(row), "step {number}");
        }
        assert_eq!(contacts.len(), told.rows.len());
    }
    assert!(deltas > 60 && cut > 10, "{deltas} deltas, {cut} cut off");
    assert!(contact_deltas > 60, "{contact_deltas} deltas");
}

fn request(client: &mut Client, json: &str) {
    let answer = client.request(json, &[], 10 * SECOND_NS).unwrap();
    assert!(answer.ok, "{answer:?}");
}

#[test]
fn a_reader_that_missed_messages_has_the_whole_list_again_and_shows_no_other() {
    let desk = Desk::new();
    let _daemon = desk.run(&scene(), &[]);
    let mut client = changes_only(&desk, Some("sim"));
    let mut sleeper = changes_only(&desk, None);
    step(&mut client, &rows(1, 3));
    until("its first list", || {
        sleeper.wait_tick(SECOND_NS).unwrap();
        sleeper.view().list().is_some()
    });
    for number in 2..=30 {
        step(&mut client, &rows(number, 3));
    }
    // Its queue has dropped most of the messages.
    assert_eq!(sleeper.latest().unwrap(), Heard::Tick);
    let (mut number, mut shown) = (30, 0);
    until("the whole list again, and those that build on it", || {
        number += 1;
        step(&mut client, &rows(number, 3));
        let tick = client.view().tick().header.tick;
        while sleeper.view().tick().header.tick < tick {
            sleeper.wait_tick(SECOND_NS).unwrap();
        }
        let (own, other) = (client.view(), sleeper.view());
        if other.tick().header.tick == tick
            && let Some(list) = other.list()
        {
            assert_eq!(text(list.iter()), text(own.list().unwrap().iter()));
            shown += 1;
        }
        shown == 20
    });
}

#[test]
fn a_restart_is_told_with_the_ends_of_the_list_to_who_reads_changes_alone() {
    let desk = Desk::new();
    let mut daemon = desk.run(&scene(), &[]);
    let mut client = changes_only(&desk, Some("sim"));
    step(&mut client, &rows(1, 3));
    step(&mut client, &rows(1, 3));
    let colliding = client.view().tick().colliding;
    assert!(colliding > 0);
    daemon.kill();
    let _again = desk.run(&scene(), &[]);
    let mut told = None;
    until("the restart", || {
        match client.step(&FrameInfo::default(), Rows::Poses(&rows(1, 3)), SECOND_NS) {
            Err(StepError::Restarted(news)) => told = Some(news),
            Err(StepError::TimedOut(_)) => {}
            other => panic!("{other:?}"),
        }
        told.is_some()
    });
    let ends = told.unwrap().ends;
    assert_eq!(ends.len() as u64, colliding);
    let restart = EndCause::Restart.code();
    assert!(ends.iter().all(|row| row.end_cause == restart));
    step(&mut client, &rows(1, 3));
    assert_eq!(
        client
            .view()
            .list()
            .unwrap()
            .iter()
            .filter(|row| row.verdict == 4)
            .count() as u64,
        colliding
    );
}
