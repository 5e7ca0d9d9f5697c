//! The rows of the wire as bytes: field by field in the order of their layout, so that on a little-endian machine they
//! are what shared memory holds and `msgs/` describes. A field that is forgotten here does not compile.

use super::bytes::{Damaged, Differing, Field, Take};
use crate::wire::{
    BodyRow, ContactRow, FrameHeader, MessageHeader, NameRow, PairRow, RegionRow, SourceRow,
    TickRow, TransformRow, VertexHeader,
};

macro_rules! rows {
    ($($type:ident { $($field:ident: $kind:ty,)+ })+) => { $(
        impl Field for $type {
            const BYTES: usize = 0 $(+ <$kind as Field>::BYTES)+;

            fn put(&self, to: &mut Vec<u8>) {
                $(<$kind as Field>::put(&self.$field, to);)+
            }

            fn take(from: &mut Take<'_>) -> Result<Self, Damaged> {
                Ok(Self { $($field: <$kind as Field>::take(from)?,)+ })
            }

            fn differ(&self, other: &Self, skip: &[&str]) -> Option<Differing> {
                $(
                    let name = stringify!($field);
                    if !skip.contains(&name)
                        && let Some((path, one, two)) = self.$field.differ(&other.$field, &[])
                    {
                        let dot = if path.is_empty() || path.starts_with('[') { "" } else { "." };
                        return Some((format!("{name}{dot}{path}"), one, two));
                    }
                )+
                None
            }
        }

        // No field is missing, and there is no padding.
        const _: () = assert!(<$type as Field>::BYTES == size_of::<$type>());
    )+
        /// Description of the bytes in a recording.
        #[cfg(test)]
        const WORDS: &str = concat!($(
            stringify!($type), "\n", $("  ", stringify!($field), ": ", stringify!($kind), "\n",)+
        )+);
    };
}

rows! {
    FrameHeader {
        session: u64, epoch: u64, seq: u64, sent_ns: u64, stamp_ns: u64, scene_rev: u64,
        deadline_ns: u64, time_left_ns: u64, source: [u8; 32], flags: u32, clock_id: u32,
        schema: u32, boot: u32,
    }
    TransformRow {
        body: u64, flags: u32, reserved: u32, position: [f64; 3], orientation: [f64; 4],
    }
    VertexHeader {
        session: u64, epoch: u64, seq: u64, sent_ns: u64, body: u64, version: u64,
        base_version: u64, number: u64, source: [u8; 32], first: u32, count: u32, total: u32,
        flags: u32, schema: u32, boot: u32,
    }
    MessageHeader {
        boot_id: u64, tick: u64, scene_rev: u64, oldest_stamp_ns: u64, newest_stamp_ns: u64,
        truncated: u64, state: u8, reserved: [u8; 3], schema: u32,
    }
    PairRow {
        body_a: u64, body_b: u64, gap_min_m: f64, gap_max_m: f64, gap_best_m: f64,
        closing_mps: f64, toi_min: f64, toi_max: f64, begin_first_tick: u64, begin_last_tick: u64,
        end_first_tick: u64, end_last_tick: u64, certified_tick: u64, bound_age_ticks: u32,
        verdict: u8, certified_verdict: u8, events: u8, end_cause: u8, level: u8, flags: u8,
        reserved: [u8; 6],
    }
    ContactRow {
        id: u64, body_a: u64, body_b: u64, point_a: [f64; 3], point_b: [f64; 3],
        point_a_body: [f64; 3], point_b_body: [f64; 3], normal: [f64; 3], gap_m: f64,
        gap_min_m: f64, gap_max_m: f64, shape_a: u32, shape_b: u32, triangle_a: u32,
        triangle_b: u32, flags: u32, kind: u8, reserved: [u8; 3],
    }
    RegionRow {
        body_a: u64, body_b: u64, centre: [f64; 3], radius_m: f64, cone_axis: [f64; 3],
        cone_half_angle_rad: f64, point: [f64; 3], normal: [f64; 3], depth_m: f64, flags: u32,
        index: u8, count: u8, level: u8, reserved: u8,
    }
    BodyRow {
        body: u64, position: [f64; 3], orientation: [f64; 4], stamp_ns: u64, received_ns: u64,
        age_ns: u64, generation: u32, source: u32, status: u8, verdict: u8, reject: u8,
        reserved: [u8; 5],
    }
    NameRow {
        body: u64, source: u32, generation: u32, len: u32, reserved: u32, name: [u8; 104],
    }
    SourceRow {
        name: [u8; 32], session: u64, epoch: u64, seq: u64, stamp_ns: u64, age_ns: u64,
        frames: u64, skipped: u64, refused: u64, clock_id: u32, alive: u8, paused: u8,
        reserved: [u8; 2],
    }
    TickRow {
        header: MessageHeader, sent_ns: u64, elapsed_ns: u64, budget_ns: u64, budget_units: u64,
        floor_ns: u64, units: u64, stage_ns: [u64; 8], rejects: [u64; 16], bodies: u64,
        unknown: u64, candidates: u64, colliding: u64, possible: u64, near: u64, ignored: u64,
        missed: u64, cancelled_events: u64, worst_a: u64, worst_b: u64, widest_m: f64,
        oldest_undecided_ticks: u64, reasons: u32, cause: u8, overrun: u8, sources_len: u8,
        cause_source: u8, rebuilds: u64, broad_renewed: u32, broad_mode: u8, broad_cause: u8,
        reserved: [u8; 2], sources: [SourceRow; 16],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::LAYOUT;

    #[test]
    fn bug_rows_that_change_are_of_another_layout() {
        // FNV-1a.
        let take = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        let hash = WORDS.bytes().fold(0xcbf2_9ce4_8422_2325, take);
        assert_eq!(
            (LAYOUT, hash),
            (3, 0xdbed_7429_18f2_05b9),
            "raise `LAYOUT` in `given.rs` by one, and write it here with the new number: {hash:#x}\n{WORDS}"
        );
    }
}
