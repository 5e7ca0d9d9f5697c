//! Bodies attached to others, by the body that each hangs on in the end: they take pose, age and unknown from it.
//!
//! In: attachments as `edit_links` resolved them, and the bodies touched in a tick. Out: the attached bodies brought in
//! line. A tick costs those whose root, or which themselves, were touched; a scene at rest costs nothing.

use super::World;
use crate::ids::BodySlot;

/// If the touched bodies are at least one for so many attached ones, all are gone through.
const MANY: usize = 4;

/// What attachments make of a slot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Link {
    /// It hangs on no body, and none on it.
    #[default]
    None,
    /// Others hang on it in the end.
    Root,
    /// It hangs on another.
    Hangs,
}

/// The attached bodies.
#[derive(Clone, Debug, Default)]
pub(super) struct Attached {
    /// By slot.
    slots: Vec<BodySlot>,
    /// Each behind the body that it hangs on in the end, by both.
    by_root: Vec<(BodySlot, BodySlot)>,
    /// By slot; shorter than the bodies are many where the last of them have none.
    links: Vec<Link>,
    /// Roots and attached bodies touched in this tick. May contain duplicates.
    stirred: Vec<BodySlot>,
    /// Memory kept across calls.
    due: Vec<BodySlot>,
    /// How many were brought in line in this tick, one counted as often as it was.
    settled: u64,
}

impl Attached {
    /// By slot.
    pub(super) fn slots(&self) -> &[BodySlot] {
        &self.slots
    }

    /// Opens a tick.
    pub(super) fn begin(&mut self) {
        self.stirred.clear();
        self.settled = 0;
    }

    /// Replaces all; afterwards all count as touched.
    ///
    /// * `slots` - in order.
    pub(super) fn set(&mut self, slots: Vec<BodySlot>, root_of: impl Fn(BodySlot) -> BodySlot) {
        self.by_root.clear();
        self.by_root
            .extend(slots.iter().map(|slot| (root_of(*slot), *slot)));
        self.by_root.sort_unstable();
        self.links.clear();
        for &(root, slot) in &self.by_root {
            let last = root.index().max(slot.index());
            if self.links.len() <= last {
                self.links.resize(last + 1, Link::None);
            }
            self.links[root.index()] = Link::Root;
            self.links[slot.index()] = Link::Hangs;
        }
        self.slots = slots;
        self.stirred.clear();
        self.stirred.extend_from_slice(&self.slots);
        // A tick without edits touches each of them, and each root, at most once more.
        self.stirred.reserve(2 * self.slots.len());
        self.due.reserve(2 * self.slots.len());
    }

    /// A body was touched, for the first time in this tick.
    #[inline]
    pub(super) fn stir(&mut self, slot: BodySlot) {
        if self
            .links
            .get(slot.index())
            .is_some_and(|link| *link != Link::None)
        {
            self.stirred.push(slot);
        }
    }

    /// The attached bodies whose root is this one, by slot; each behind the root.
    pub(super) fn of_root(&self, root: BodySlot) -> &[(BodySlot, BodySlot)] {
        let first = self.by_root.partition_point(|of| of.0 < root);
        let count = self.by_root[first..].partition_point(|of| of.0 == root);
        &self.by_root[first..first + count]
    }

    /// The attached bodies that are touched, or whose roots are, by slot; perhaps some more.
    fn take_due(&mut self) -> Vec<BodySlot> {
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        if self.stirred.len() * MANY >= self.slots.len() {
            due.extend_from_slice(&self.slots);
            return due;
        }
        for &slot in &self.stirred {
            match self.links.get(slot.index()) {
                Some(Link::Hangs) => due.push(slot),
                Some(Link::Root) => due.extend(self.of_root(slot).iter().map(|of| of.1)),
                Some(Link::None) | None => {}
            }
        }
        due.sort_unstable();
        due.dedup();
        due
    }

    /// Structure check: returns whether lists and marks are those of these roots; a root is its own.
    pub(super) fn are_whole(&self, roots: impl Iterator<Item = (BodySlot, BodySlot)>) -> bool {
        let mut anew = Self::default();
        let mut hanging: Vec<_> = roots.filter(|(slot, root)| slot != root).collect();
        hanging.sort_unstable();
        let slots = hanging.iter().map(|of| of.0).collect();
        let root_of = |slot| {
            let at = hanging.binary_search_by_key(&slot, |of| of.0);
            at.map_or(slot, |at| hanging[at].1)
        };
        anew.set(slots, root_of);
        anew.slots == self.slots && anew.by_root == self.by_root && anew.links == self.links
    }
}

impl World {
    /// Records that a body's pose, age or what is known of it changed in this tick.
    #[inline]
    pub(super) fn touch(&mut self, slot: BodySlot) {
        let entry = &mut self.entries[slot.index()];
        if entry.touched != self.tick {
            entry.touched = self.tick;
            self.attached.stir(slot);
        }
    }

    /// Attached bodies take pose, age and unknown from the body they hang on.
    pub(super) fn settle_attached(&mut self) {
        if self.attached.stirred.is_empty() {
            return;
        }
        let due = self.attached.take_due();
        for &slot in &due {
            let entry = &self.entries[slot.index()];
            let (root, root_pose) = (entry.root, entry.root_pose);
            if self.entries[root.index()].touched != self.tick && entry.touched != self.tick {
                continue;
            }
            let Some(root) = self.body(root) else {
                continue;
            };
            let pose = root.pose * root_pose;
            let velocity = root.twist_at(&root_pose.translation.vector.into());
            let (stamp_ns, since_ns, received_ns) =
                (root.stamp_ns, root.since_ns, root.received_ns);
            let reject = root.reject;
            self.attached.settled += 1;
            let moved = self.place_attached(slot, &pose);
            if let Some(body) = self.bodies[slot.index()].as_mut() {
                body.stamp_ns = stamp_ns;
                body.since_ns = since_ns;
                body.received_ns = received_ns;
                body.reject = reject;
            }
            let was_in = self.body(slot).is_some_and(|body| body.in_broad);
            let other_speed = self.take_velocity(slot, velocity);
            self.settle(slot, moved);
            if other_speed && !moved && was_in {
                self.lists.restated(slot);
            }
        }
        self.attached.due = due;
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::path::Path;

    use crate::daemon::build_shapes;
    use crate::scene::Scene;
    use crate::wire::{Frame, FrameHeader, TransformRow, WIRE_VERSION, frame_flags, name_bytes};
    use crate::world::World;

    const ROOTS: u64 = 30;
    const HANGERS: u64 = 10;
    const MS: u64 = 1_000_000;

    /// Bodies with tens of others on each, some of those on one another.
    fn world() -> World {
        let mut text = String::from("[[source]]\nname = \"feed\"\n");
        for root in 1..=ROOTS {
            for hanger in 0..=HANGERS {
                let id = root * 100 + hanger;
                let on = if hanger % 3 == 2 { id - 1 } else { root * 100 };
                let place = match hanger {
                    0 => "source = \"feed\"".to_owned(),
                    _ => format!("attached_to = \"b{on}\"\nposition = [0.0, {hanger}.0, 0.0]"),
                };
                let _ = write!(
                    text,
                    "[[body]]\nname = \"b{id}\"\nid = {id}\n{place}\n\
                     shape = {{ type = \"sphere\", radius = 0.1 }}\n"
                );
            }
        }
        let scene = Scene::parse(&text, "test", Path::new(".")).unwrap();
        World::new(&scene, build_shapes(&scene).unwrap().bodies, 0).unwrap()
    }

    fn frame(tick: u64, roots: &[(u64, f64)]) -> Frame {
        let mut frame = Frame {
            header: FrameHeader {
                session: 1,
                seq: tick,
                source: name_bytes("feed"),
                flags: frame_flags::PARTIAL,
                schema: WIRE_VERSION,
                ..FrameHeader::default()
            },
            received_ns: tick * MS,
            ..Frame::default()
        };
        let row = |&(root, x): &(u64, f64)| TransformRow {
            body: root * 100,
            position: [x, 0.0, 0.0],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..TransformRow::default()
        };
        frame.set_transforms(&roots.iter().map(row).collect::<Vec<_>>());
        frame
    }

    #[test]
    fn bug_each_tick_went_through_all_attached_bodies_also_at_rest() {
        let mut world = world();
        let all: Vec<(u64, f64)> = (1..=ROOTS).map(|root| (root, root as f64)).collect();
        let moved: [&[(u64, f64)]; 6] = [
            &all,
            &[],
            &[(7, -3.0)],
            &[],
            &[(1, 5.0), (7, -3.0)],
            &[(30, 0.5), (7, f64::NAN)],
        ];
        for (tick, roots) in (1..).zip(moved) {
            world.begin_tick(tick, tick * MS);
            if !roots.is_empty() {
                world.admit(&frame(tick, roots), tick * MS);
            }
            world.age(tick * MS);
            world.validate().unwrap();
            // A new session forgets all that was known first.
            let times = if tick == 1 { 2 } else { 1 };
            let wanted = times * HANGERS * roots.len() as u64;
            assert_eq!(world.attached.settled, wanted, "tick {tick}");
        }
        // By age alone.
        world.begin_tick(9, 10_000 * MS);
        world.age(10_000 * MS);
        world.validate().unwrap();
        assert_eq!(world.counts().unknown, ROOTS * (1 + HANGERS));
    }

    #[test]
    fn what_hangs_on_a_body_is_found_from_its_root_and_within_a_chain() {
        let mut world = world();
        world.begin_tick(1, MS);
        world.age(MS);
        let slot = |id: u64| world.slot_named(&format!("b{id}")).unwrap();
        let on = |id: u64| world.hanging_on(slot(id));
        assert_eq!(on(300).len() as u64, HANGERS);
        assert_eq!(on(304), [(slot(305), on(304)[0].1)]);
        assert!(on(305).is_empty());
        let seen = on(300).into_iter().find(|(at, _)| *at == slot(305));
        let y = seen.unwrap().1.translation.vector.y;
        assert!((y - 9.0).abs() < 1e-12, "{y}");
    }
}
