//! Checks the whole structure against the boxes of the world.

use super::entry::ages;
use super::{NONE, Order, Proxies, ones, parts, small};
use crate::broad::members::Members;
use crate::broad::order::fatten::{loose, outward};
use crate::ids::BodySlot;
use crate::simd::boxes::{Lanes, Portable, WIDTH};

impl Order {
    /// Checks that lanes and bodies refer to each other, boxes are stored and inside their fat boxes, the tree contains
    /// the fat boxes, and the candidates and overlaps of each block are complete.
    pub(in crate::broad) fn check<P: Proxies>(
        &self,
        members: &Members,
        proxies: &P,
    ) -> Result<(), String> {
        if self.afresh.on {
            return self.check_afresh(members, proxies);
        }
        self.check_homes()?;
        let bodies = members.bounded();
        if bodies.len() != self.len {
            return Err(format!(
                "{} bodies have lanes, {} boxes are in",
                self.len,
                bodies.len()
            ));
        }
        for slot in bodies {
            let rank = self
                .rank(*slot)
                .ok_or_else(|| format!("{slot:?} has no lane"))?;
            let (block, lane) = parts(rank);
            if self.slot_of[rank as usize] != slot.0 || self.live[block] >> lane & 1 == 0 {
                return Err(format!("the lane of {slot:?} is not its own"));
            }
            let fat = self.fat[block].get(lane);
            let boxed = outward(Portable, proxies.aabb(*slot), &self.origin);
            let exact = boxed.corners();
            let stored = self.exact[rank as usize].corners();
            if !self.lags && stored.map(f32::to_bits) != exact.map(f32::to_bits) {
                return Err(format!("the stored box of {slot:?} is not its box"));
            }
            if (0..3).any(|k| fat[k] > exact[k] || fat[k + 3] < exact[k + 3]) {
                return Err(format!("{slot:?} has left its fat box"));
            }
            let held = &self.held[slot.index()];
            let hold = held.hold();
            if loose(&hold.fat).corners().map(f32::to_bits) != fat.map(f32::to_bits) {
                return Err(format!("the two fat boxes of {slot:?} do not fit"));
            }
            let aabb = proxies.aabb(*slot);
            let corners = [aabb.min.coords.as_ref(), aabb.max.coords.as_ref()];
            let keeps = Portable.keeps(corners, &self.origin, held);
            let within = Portable.holds(&hold.fat, &boxed) && Portable.holds(&boxed, &hold.core);
            if !(keeps || within) {
                return Err(format!("{slot:?} does not keep to its hold"));
            }
        }
        let lanes: u32 = self.live.iter().map(|live| live.count_ones()).sum();
        let named = self.slot_of.iter().filter(|slot| **slot != NONE).count();
        if lanes as usize != self.len || named != self.len {
            return Err(format!(
                "{lanes} lanes live, {named} named, {} bodies",
                self.len
            ));
        }
        if self
            .dirty
            .iter()
            .chain(&self.renewing)
            .any(|lanes| *lanes != 0)
        {
            return Err("a lane is marked beyond its tick".into());
        }
        self.tree.validate(&self.fat)?;
        self.links.validate(&self.live)?;
        let hits = self.links.hits();
        if hits != self.hits {
            return Err(format!("{hits} overlaps stand, {} are counted", self.hits));
        }
        self.check_list()?;
        self.check_bits(proxies)
    }

    /// Checks every bit of candidates and overlaps against the boxes; for few bodies only, since it tests every pair.
    fn check_bits<P: Proxies>(&self, proxies: &P) -> Result<(), String> {
        if self.len > 300 {
            return Ok(());
        }
        let ranks: Vec<usize> = (0..self.slot_of.len())
            .filter(|rank| self.slot_of[*rank] != NONE)
            .collect();
        for (at, low) in ranks.iter().enumerate() {
            for high in &ranks[at + 1..] {
                let ((a, row), (b, lane)) =
                    ((low / WIDTH, low % WIDTH), (high / WIDTH, high % WIDTH));
                let record = u32::try_from(a).ok().zip(u32::try_from(b).ok());
                let record = record.and_then(|(a, b)| self.links.find(a, b));
                let bits = record
                    .map(|record| *self.links.bits(record))
                    .unwrap_or_default();
                let (one, other) = (self.fat[a].get(row), self.fat[b].get(lane));
                let near = (0..3).all(|k| one[k] <= other[k + 3] && other[k] <= one[k + 3]);
                let slots = [*low, *high].map(|rank| BodySlot(self.slot_of[rank]));
                let hit = proxies.aabb(slots[0]).overlaps(proxies.aabb(slots[1]));
                let stored =
                    [bits.cand[row], bits.hit[row]].map(|bits| ones(bits).any(|l| l == lane));
                if stored != [near, hit] {
                    return Err(format!(
                        "the bits of {slots:?} are {stored:?}, not {:?}",
                        [near, hit]
                    ));
                }
            }
        }
        Ok(())
    }

    /// Checks that each block has a region, and each sorted block a key.
    pub(super) fn check_homes(&self) -> Result<(), String> {
        let (homes, blocks) = (self.homes.len(), self.live.len());
        if homes != blocks.div_ceil(WIDTH) || self.keys.len() != self.sorted {
            let (keys, sorted) = (self.keys.len(), self.sorted);
            return Err(format!(
                "{homes} runs of parts of space for {blocks} blocks, {keys} keys for {sorted}"
            ));
        }
        Ok(())
    }

    /// Checks, while the list is kept, that every live entry is a candidate with its state, and every uncertain
    /// candidate is listed once.
    fn check_list(&self) -> Result<(), String> {
        if !self.listed {
            return Ok(());
        }
        let mut seen: Vec<[u32; 2]> = Vec::new();
        for entry in &self.entries {
            let ranks = entry.ranks();
            let [first, second] = ranks.map(|rank| self.ages[rank as usize]);
            if ages(first, second) != entry.ages() {
                continue;
            }
            let ((a, row), (b, lane)) = (parts(ranks[0]), parts(ranks[1]));
            let Some(record) = self.links.find(small(a), small(b)) else {
                return Err(format!("{ranks:?} are listed, their blocks have no record"));
            };
            let bits = self.links.bits(record);
            let bit = (
                bits.cand[row] >> lane & 1 == 1,
                bits.hit[row] >> lane & 1 == 1,
            );
            if bit != (true, entry.is_hit()) {
                return Err(format!("{ranks:?} are listed, the matrix has {bit:?}"));
            }
            seen.push(ranks);
        }
        let listed = seen.len();
        seen.sort_unstable();
        seen.dedup();
        let mut wanted = 0;
        for record in 0..self.links.len() {
            if self.links.blocks(record)[0] != NONE {
                let [a, b] = self.links.blocks(record).map(|block| block as usize);
                let bits = self.links.bits(record);
                for row in 0..WIDTH {
                    let sure = Portable.meets(&self.sure[b], &self.sure[a].get(row));
                    if sure & bits.cand[row] & !bits.hit[row] != 0 {
                        return Err(format!(
                            "row {row} of {record} holds sure pairs without a hit"
                        ));
                    }
                    wanted += (bits.cand[row] & !sure).count_ones() as usize;
                }
            }
        }
        if listed != seen.len() || listed != wanted {
            return Err(format!(
                "{listed} listed, {} different, {wanted} candidates",
                seen.len()
            ));
        }
        Ok(())
    }
}
