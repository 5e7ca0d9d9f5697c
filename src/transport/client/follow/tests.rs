//! Ticks and messages of several boots in any order, and endless ticks.

use std::collections::VecDeque;
use std::sync::Arc;

use super::*;
use crate::time::ManualClock;
use crate::transport::client::{Client, Rows, Topics};
use crate::transport::hello::hello;
use crate::wire::{
    AnswerHeader, ChangesHeader, FrameHeader, Hello, Reason, RequestHeader, State, VertexHeader,
    VertexRow,
};

/// Queues that a test fills, of ticks, pairs and changes.
#[derive(Debug, Default)]
struct Queues {
    ticks: VecDeque<TickRow>,
    pairs: VecDeque<(u64, u64)>,
    changes: VecDeque<(u64, u64)>,
    /// After each tick there is another.
    endless: bool,
}

fn tick(boot_id: u64, tick: u64, sent_ns: u64) -> TickRow {
    let mut row = TickRow::default();
    (row.header.boot_id, row.header.tick) = (boot_id, tick);
    row.sent_ns = sent_ns;
    row
}

impl Link for Queues {
    fn subscribe(&mut self, _: Topics) -> Result<()> {
        Ok(())
    }
    fn send(&mut self, _: &FrameHeader, _: Rows<'_>) -> Result<()> {
        Ok(())
    }
    fn send_vertices(&mut self, _: &VertexHeader, _: &[VertexRow]) -> Result<()> {
        Ok(())
    }
    fn wait(&mut self, _: u64) -> Result<()> {
        Ok(())
    }
    fn tick(&mut self) -> Result<Option<TickRow>> {
        let next = self.ticks.pop_front();
        if let Some(row) = next.filter(|_| self.endless) {
            let header = row.header;
            self.ticks
                .push_back(tick(header.boot_id, header.tick + 1, row.sent_ns + 1));
        }
        Ok(next)
    }
    fn pairs(&mut self, into: &mut Message<PairRow>) -> Result<bool> {
        let Some((boot_id, tick)) = self.pairs.pop_front() else {
            return Ok(false);
        };
        (into.header.boot_id, into.header.tick) = (boot_id, tick);
        Ok(true)
    }
    fn changes(&mut self, into: &mut Message<PairRow, ChangesHeader>) -> Result<bool> {
        let Some((boot_id, tick)) = self.changes.pop_front() else {
            return Ok(false);
        };
        into.header = ChangesHeader::default();
        (into.header.message.boot_id, into.header.message.tick) = (boot_id, tick);
        Ok(true)
    }
    fn renew_changes(&mut self) -> Result<()> {
        Ok(())
    }
    fn contact_changes(&mut self, _: &mut Message<ContactRow, ChangesHeader>) -> Result<bool> {
        Ok(false)
    }
    fn renew_contact_changes(&mut self) -> Result<()> {
        Ok(())
    }
    fn contacts(&mut self, _: &mut Message<ContactRow>) -> Result<bool> {
        Ok(false)
    }
    fn regions(&mut self, _: &mut Message<RegionRow>) -> Result<bool> {
        Ok(false)
    }
    fn bodies(&mut self, _: &mut Message<BodyRow>) -> Result<bool> {
        Ok(false)
    }
    fn body_verdicts(&mut self, _: &mut Message<u8>) -> Result<bool> {
        Ok(false)
    }
    fn names(&mut self, _: &mut Message<NameRow>) -> Result<bool> {
        Ok(false)
    }
    fn plan(&mut self, _: &mut Message<u8>) -> Result<bool> {
        Ok(false)
    }
    fn hello(&mut self) -> Result<Option<Hello>> {
        Ok(Some(hello(7)))
    }
    fn request(&mut self, _: &RequestHeader, _: &[u8], _: &[&[u8]]) -> Result<()> {
        Ok(())
    }
    fn answer(&mut self, _: &mut Vec<u8>) -> Result<Option<AnswerHeader>> {
        Ok(None)
    }
}

#[test]
fn bug_a_look_at_what_is_there_never_ended_where_ticks_came_faster_than_they_were_read() {
    let mut queues = Queues {
        endless: true,
        ..Queues::default()
    };
    queues.ticks.push_back(tick(7, 1, 1));
    let clock = Arc::new(ManualClock::new(1));
    let mut client = Client::over(Box::new(queues), clock, None, 1).unwrap();
    assert_eq!(client.latest().unwrap(), Heard::Tick);
    // More than any queue holds.
    assert!(client.view().tick().header.tick > 8);
}

#[test]
fn bug_what_a_boot_that_came_and_went_unseen_left_was_followed_for_ever() {
    let (mut follow, mut queues) = (Follow::default(), Queues::default());
    queues.ticks.extend([
        tick(1, 1, 10),
        tick(3, 1, 30),
        tick(2, 1, 20),
        tick(3, 2, 31),
    ]);
    let mut heard = Vec::new();
    for _ in 0..4 {
        heard.push(match follow.next(&mut queues).unwrap() {
            Heard::Restarted(restarted) => restarted.new_boot,
            Heard::Tick => 100 + follow.view.tick.header.boot_id,
            Heard::Silence => 0,
        });
    }
    assert_eq!(heard, [101, 3, 103, 103]);
    assert_eq!(follow.view.tick.header.tick, 2);
}

#[test]
fn bug_a_message_of_a_boot_without_a_tick_held_up_all_behind_it() {
    let (mut follow, mut queues) = (Follow::default(), Queues::default());
    for at in 1..60 {
        queues.ticks.push_back(tick(3, at, at));
        // Two of another boot before those of this one.
        for queue in [&mut queues.pairs, &mut queues.changes] {
            if at == 1 {
                queue.extend([(2, 8), (2, 9)]);
            }
            queue.push_back((3, at));
        }
        assert_eq!(follow.next(&mut queues).unwrap(), Heard::Tick);
        let waits = at <= u64::from(TICKS_LEFT_MAX);
        assert_eq!(follow.view.pairs().is_none(), waits, "tick {at}");
        assert_eq!(follow.view.list().is_none(), waits, "tick {at}");
    }
    // A message of the next boot waits for its tick, while the last ticks of this one come first.
    queues.pairs.push_back((4, 1));
    for at in 60..65 {
        queues.ticks.push_back(tick(3, at, at));
        follow.next(&mut queues).unwrap();
    }
    queues.ticks.push_back(tick(4, 1, 99));
    assert!(matches!(
        follow.next(&mut queues).unwrap(),
        Heard::Restarted(_)
    ));
    assert_eq!(follow.next(&mut queues).unwrap(), Heard::Tick);
    assert!(follow.view.pairs().is_some());
}

#[test]
fn bug_rows_of_a_long_tick_were_handed_out_beside_what_was_told_of_it_and_again_with_its_end() {
    let (mut follow, mut queues) = (Follow::default(), Queues::default());
    // All of it is there before the first read.
    for (number, sent_ns) in [(1, 10), (2, 20), (2, 30), (2, 40)] {
        let mut row = tick(7, number, sent_ns);
        if (20..40).contains(&sent_ns) {
            (row.header.state, row.reasons) = (State::Unknown.code(), Reason::Undecided.bit());
        }
        queues.ticks.push_back(row);
    }
    for queue in [&mut queues.pairs, &mut queues.changes] {
        queue.extend([(7, 1), (7, 2)]);
    }
    let mut handed_out = Vec::new();
    while follow.next(&mut queues).unwrap() == Heard::Tick {
        let view = &follow.view;
        handed_out.push((view.pairs().is_some(), view.list().is_some()));
    }
    let [with, without] = [(true, true), (false, false)];
    assert_eq!(handed_out, [with, without, without, with]);
}
