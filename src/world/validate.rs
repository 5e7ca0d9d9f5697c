//! A full check of the world's own structure, for tests after every tick and on demand.

use super::World;
use super::body::Body;
use super::edit_rules::Uncounted;
use super::filters::{BARS, ENABLED, HALF_SPACES, KEEPS, LIVE, MOVES};
use super::tag::Tag;
use crate::ids::BodySlot;
use crate::wire::BodyStatus;

impl World {
    /// Checks everything that the other calls rely on. Cost: O(bodies log bodies).
    ///
    /// # Errors
    /// What does not hold, and of which body.
    pub fn validate(&self) -> Result<(), String> {
        self.lists.validate()?;
        if !self.order.is_sorted_by(|a, b| a.0 < b.0) {
            return Err("the bodies are not in the order of their ids".to_owned());
        }
        let there = self.bodies.iter().flatten().count();
        if there != self.order.len()
            || there + self.free.len() + self.resting.len() != self.bodies.len()
        {
            return Err("a slot is lost, or stands twice".to_owned());
        }
        let mut by_status = [0; BodyStatus::ALL.len()];
        for (slot, body) in self.bodies() {
            by_status[usize::from(body.status.code())] += 1;
            self.validate_body(slot, body)
                .map_err(|what| format!("body `{}`: {what}", body.name))?;
        }
        let bends = self.bodies.iter().flatten();
        let bends = bends.filter(|body| body.vertices.is_some()).count();
        let grow = self.entries.iter().filter(|entry| entry.growing).count();
        if (bends, grow) != (self.deforming.len(), self.growing.len()) {
            return Err("a body that deforms, or whose reach grows, is lost".to_owned());
        }
        let roots = self.bodies().map(|(slot, _)| slot);
        let roots = roots.map(|slot| (slot, self.entries[slot.index()].root));
        if !self.attached.are_whole(roots) {
            return Err("a body hangs on another, or not, by mistake".to_owned());
        }
        if by_status != self.by_status {
            return Err("the tallies by status are off".to_owned());
        }
        if !self.filters_hold() {
            return Err("what the filters make of the scene is off".to_owned());
        }
        if !self.ages.are_whole() {
            return Err("the nearest deadline, or an end of the stamps, is off".to_owned());
        }
        Ok(())
    }

    /// Whether the filters are as counted anew from nothing, where no edit waits to be counted.
    fn filters_hold(&self) -> bool {
        if self.uncounted != Uncounted::Nothing {
            return true;
        }
        let mut anew = self.filters.clone();
        for slot in 0..self.bodies.len() {
            anew.mark_ruled(slot);
        }
        anew.count_ignored(&self.names);
        anew.margins_m.fill(0.0);
        anew.find_forced(&self.names);
        let own = &self.filters;
        let mut marks = own.bodies.iter().zip(&anew.bodies);
        marks.all(|(own, anew)| own.flags == anew.flags)
            && own.ignored == anew.ignored
            && own.forced == anew.forced
            && own.margins_m == anew.margins_m
    }

    fn validate_body(&self, slot: BodySlot, body: &Body) -> Result<(), &'static str> {
        let check = |holds: bool, what: &'static str| if holds { Ok(()) } else { Err(what) };
        let (entry, hot) = (
            &self.entries[slot.index()],
            &self.filters.bodies[slot.index()],
        );
        check(
            self.slot_of(body.id) == Some(slot),
            "its id leads elsewhere",
        )?;
        check(
            self.slot_named(&body.name) == Some(slot),
            "its name leads elsewhere",
        )?;
        let name = self.names.get(hot.name);
        check(name.id == Some(body.id), "its name has another id")?;
        check(*name.text == *body.name, "its filters have another name")?;
        check(
            name.generation == body.generation,
            "its name has another generation",
        )?;
        check(self.tag(slot) == Some(&Tag::of(body)), "its tag is another")?;
        check(hot.has(LIVE), "the filters do not know it")?;
        check(
            hot.has(ENABLED) == entry.enabled,
            "the filters disagree on enabled",
        )?;
        check(
            hot.has(MOVES) == body.moves,
            "the filters disagree on moves",
        )?;
        check(
            hot.has(HALF_SPACES) == body.only_half_spaces,
            "the filters disagree on half-spaces",
        )?;
        let keeps = body.in_broad && body.reach_m.is_infinite();
        check(hot.has(KEEPS) == keeps, "the filters disagree on keeps")?;
        // Until the tick ends; one that came back in it is barred at once.
        let may_meet = !keeps || self.met.contains(&slot);
        check(
            if hot.has(BARS) { keeps } else { may_meet },
            "the filters disagree on bars",
        )?;
        let judged = self.judge(slot, body);
        check(
            judged.status == body.status,
            "its status is not what its age says",
        )?;
        check(
            judged.reach_m.to_bits() == body.reach_m.to_bits(),
            "its reach is off",
        )?;
        check(
            judged.in_broad == body.in_broad,
            "it is in the broad phase, or not, by mistake",
        )?;
        let margin_m = self.margin_of(slot, body);
        let needed_m = if body.reach_m.is_finite() {
            margin_m + body.reach_m
        } else {
            margin_m
        };
        let holds = body.proxy.holds(&entry.tight.widened(needed_m));
        check(holds || !body.in_broad, "its box does not hold it")?;
        let placed = self.entries[entry.root.index()].has_pose || self.stays_for_its_way(slot);
        check(
            !body.in_broad || placed,
            "it is in the broad phase without a pose",
        )?;
        let Some(root) = self.body(entry.root).filter(|_| entry.root != slot) else {
            return check(entry.root == slot, "what it hangs on is gone");
        };
        let age = |body: &Body| (body.since_ns, body.received_ns, body.stamp_ns, body.reject);
        check(
            age(body) == age(root) && body.pose == root.pose * entry.root_pose,
            "it is not where, or as old as, what it hangs on says",
        )
    }
}
