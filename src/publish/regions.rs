//! Rows of `regions`: where pairs touch, or may touch.

use crate::limits::{REGION_LOOKS_FREE, REGION_LOOKS_PER_TICK, REGIONS_PER_PAIR_MAX};
use crate::math::ROUND;
use crate::narrow::Region;
use crate::wire::{MessageHeader, Outbox, RegionRow, region_flags};
use crate::world::Body;

use super::{Publisher, View};

/// The last class of rows with regions: colliding, then possible.
const CLASS_MAX: u8 = 2;

impl Publisher {
    /// Fills `regions` with what the budget allowed, or with the result of a few looks; returns how many rows did not
    /// fit, one for each pair left out. Whole pairs are kept: colliding ones first, deepest first.
    pub(super) fn fill_regions(
        &mut self,
        view: &mut View<'_>,
        header: MessageHeader,
        out: &mut Outbox,
    ) -> u64 {
        out.regions.clear();
        if !view.demand.regions {
            return 0;
        }
        let (chosen, rows) = (&mut self.ranked, &self.listing);
        chosen.clear();
        let open = (0..).zip(rows.iter());
        chosen.extend(
            open.filter(|(_, row)| row.slot.is_some() && row.class() <= CLASS_MAX)
                .map(|(at, row)| {
                    let (class, gap) = row.rank();
                    (0, class, gap, at)
                }),
        );
        let looks = (REGION_LOOKS_PER_TICK / chosen.len().max(1)).min(REGION_LOOKS_FREE);
        let most = self.limits.region_rows.max(REGIONS_PER_PAIR_MAX);
        let ranked = chosen.len() * REGIONS_PER_PAIR_MAX > most;
        let mut sorted = if ranked { 0 } else { chosen.len() };
        let mut left_out = 0;
        for nth in 0..chosen.len() {
            if out.regions.len() + REGIONS_PER_PAIR_MAX > most {
                left_out = (chosen.len() - nth) as u64;
                break;
            }
            if nth == sorted {
                // Sorts no more than may be sent.
                let behind = &mut chosen[nth..];
                let next = most.min(behind.len());
                if next < behind.len() {
                    behind.select_nth_unstable(next);
                }
                behind[..next].sort_unstable();
                sorted += next;
            }
            let (.., at) = chosen[nth];
            let Some(slot) = rows.row(at as usize).slot else {
                continue;
            };
            let Some(finding) = view.narrow.finding(slot) else {
                continue;
            };
            let (Some(a), Some(b)) = (view.world.body(finding.a), view.world.body(finding.b))
            else {
                continue;
            };
            let Some(found) = view.narrow.regions(slot, view.world, looks) else {
                continue;
            };
            let mut flags = if found.complete {
                region_flags::COMPLETE
            } else {
                region_flags::ESTIMATE
            };
            if found.clipped {
                flags |= region_flags::CLIPPED;
            }
            let number = |k: usize| u8::try_from(k).unwrap_or(u8::MAX);
            for (index, region) in found.all.iter().enumerate() {
                out.regions.push(RegionRow {
                    flags,
                    index: number(index),
                    count: number(found.all.len()),
                    level: found.level.code(),
                    ..row(a, b, region)
                });
            }
        }
        if ranked {
            (out.regions).sort_unstable_by_key(|row| (row.body_a, row.body_b, row.index));
        }
        out.regions_header = MessageHeader {
            truncated: left_out,
            ..header
        };
        left_out
    }
}

fn row(a: &Body, b: &Body, region: &Region) -> RegionRow {
    let turn = &a.pose.rotation;
    let centre = a.pose * region.centre;
    RegionRow {
        body_a: a.id.0,
        body_b: b.id.0,
        centre: centre.coords.into(),
        // Precision lost far from the origin of the scene.
        radius_m: region.radius_m + 16.0 * ROUND * centre.coords.norm(),
        cone_axis: (turn * region.axis).into(),
        cone_half_angle_rad: region.half_angle_rad,
        point: (a.pose * region.point).coords.into(),
        normal: (turn * region.normal).into(),
        depth_m: region.depth_m,
        ..RegionRow::default()
    }
}
