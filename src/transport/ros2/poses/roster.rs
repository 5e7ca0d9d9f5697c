//! The bodies of a source of common topics: those of the scene, plus additions and removals by edits at run time.

use super::super::order::Order;
use super::super::shelf::Seat;
use super::super::tf::Tree;
use super::{Member, NOBODY, Source};
use crate::transport::BodyNote;
use crate::wire::ros::TfMessage;

impl Member {
    pub(super) fn of(body: &BodyNote, tree: &mut Tree) -> Self {
        Self {
            seat: Seat::of(body),
            name: body.name.clone(),
            frame: tree.pin(&body.frame),
            topic: body.topic.clone(),
            order: Order::default(),
            last: None,
            told_ns: 0,
            told_late: false,
            since_ns: None,
            awaited_ns: None,
            fault: None,
        }
    }
}

impl Source {
    /// Adds a body, in the slot of a removed one or at the end; returns its index.
    pub(in super::super) fn put_body(&mut self, body: &BodyNote) -> usize {
        let member = Member::of(body, &mut self.tree);
        let mut members = self.members.iter();
        let free = members.position(|member| member.seat == NOBODY);
        let place = free.unwrap_or(self.members.len());
        match self.members.get_mut(place) {
            Some(slot) => *slot = member,
            None => self.members.push(member),
        }
        place
    }

    /// Keeps the state of a body that was put again with the same frame and topic, and returns its index.
    pub(in super::super) fn keep_body(&mut self, body: &BodyNote) -> Option<usize> {
        let frame = self.tree.pin(&body.frame);
        self.tree.unpin(frame);
        let place = self.place_of(&body.name)?;
        let member = self.members.get_mut(place)?;
        if (member.frame, &member.topic) != (frame, &body.topic) {
            return None;
        }
        member.seat = Seat::of(body);
        // Its shape may be new, and the daemon then has no pose of it: the chain is reported again.
        member.last = None;
        Some(place)
    }

    /// Sets whether a body is attached to another one; returns its index and seat if that is a change.
    pub(in super::super) fn hang_body(
        &mut self,
        name: &str,
        attached: bool,
    ) -> Option<(usize, Seat)> {
        let place = self.place_of(name)?;
        let member = self.members.get_mut(place)?;
        if member.seat.attached == attached {
            return None;
        }
        member.seat.attached = attached;
        // While the body was attached, refusals and poses of fixed links were not handed on: they hold still, and are
        // reported again. A pose of links that change does not: it may be old.
        let is_aging = matches!(&member.last, Some(Ok(found)) if found.received_ns.is_some());
        if !attached && !is_aging {
            member.last = None;
        }
        Some((place, member.seat))
    }

    /// Removes a body; returns the index that it had, if any.
    pub(in super::super) fn remove_body(&mut self, name: &str) -> Option<usize> {
        let place = self.place_of(name)?;
        let member = self.members.get_mut(place)?;
        member.seat = NOBODY;
        member.fault = None;
        member.last = None;
        self.tree.unpin(member.frame);
        Some(place)
    }

    /// Index and name of each of its bodies.
    pub(in super::super) fn bodies(&self) -> impl Iterator<Item = (usize, &str)> {
        let members = self.members.iter().enumerate();
        let seated = members.filter(|(_, member)| member.seat != NOBODY);
        seated.map(|(place, member)| (place, member.name.as_str()))
    }

    /// Whether a message has a link that has already changed since the last look, and the source has a continuous body:
    /// then the poses must be looked up before the message is taken, because each pose is part of a path.
    pub(in super::super) fn is_overtaken(&self, message: &TfMessage) -> bool {
        let mut links = message.transforms.iter();
        self.members.iter().any(|member| member.seat.continuous)
            && links.any(|link| self.tree.is_news(&link.child_frame_id))
    }

    fn place_of(&self, name: &str) -> Option<usize> {
        let mut members = self.members.iter();
        members.position(|member| member.seat != NOBODY && member.name == name)
    }
}
