//! Logs refusals: a client that only sends is not informed of any. In: the world after a tick. Out: a line when
//! refusals begin, and then rarely while they go on.

use crate::time::Seldom;
use crate::wire::{REJECTS_LEN, RejectReason};
use crate::world::World;

/// What was logged.
#[derive(Debug, Default)]
pub(super) struct Refusals {
    seen: u64,
    told: [u64; REJECTS_LEN],
    seldom: Seldom,
}

impl Refusals {
    /// The text to log now, if any: the number since the last line, why, which source, what to change.
    ///
    /// * `now_ns` - nanoseconds, always of the same clock.
    pub(super) fn words(&mut self, world: &World, now_ns: u64) -> Option<String> {
        let counts = world.rejects();
        let all: u64 = counts.iter().sum();
        let new = all.saturating_sub(self.seen);
        self.seen = all;
        self.seldom.note(new, now_ns)?;
        let new = RejectReason::ALL.iter().filter_map(|reason| {
            let place = usize::from(reason.code());
            let count = counts.get(place)? - self.told.get(place)?;
            let of = world
                .refused_of(*reason)
                .map(|name| format!(", the last of source \"{name}\""));
            let mut of = of.unwrap_or_default();
            if let Some(body) = world.refused_body(*reason) {
                of.push_str(&format!(", body \"{body}\""));
            }
            let mend = reason.mend();
            (count > 0).then(|| format!("{count} {reason}{of}: {mend}"))
        });
        let text = format!(
            "frames or poses are refused: {}",
            new.collect::<Vec<_>>().join("; ")
        );
        self.told = *counts;
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::tick::build::build_shapes;
    use crate::wire::{Frame, FrameHeader, TransformRow, WIRE_VERSION, frame_flags, name_bytes};
    const S: u64 = 1_000_000_000;

    /// A frame with one body, at `x` metres.
    fn frame(source: &str, seq: u64, body: u64, x: f64) -> Frame {
        let header = FrameHeader {
            source: name_bytes(source),
            session: 7,
            seq,
            flags: frame_flags::FULL,
            schema: WIRE_VERSION,
            ..FrameHeader::default()
        };
        let row = TransformRow {
            body,
            position: [x, 0.0, 0.0],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..TransformRow::default()
        };
        Frame {
            header,
            transforms: vec![row],
            ..Frame::default()
        }
    }

    #[test]
    fn bug_what_is_refused_of_a_client_that_only_sends_is_in_the_log() {
        let text = "[[source]]\nname = \"sim\"\n[[body]]\nname = \"b\"\nid = 3\n\
                    shape = { type = \"sphere\", radius = 1 }\n";
        let scene = Scene::parse(text, "scene.toml", std::path::Path::new("")).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        let mut world = World::new(&scene, shapes.bodies, S).unwrap();
        let mut seq = 0;
        let mut admit = |world: &mut World, source: &str, body: u64| {
            seq += 1;
            world.admit(&frame(source, seq, body, 0.0), S);
        };
        let mut refusals = Refusals::default();
        admit(&mut world, "sim", 3);
        assert_eq!(refusals.words(&world, 5), None);
        admit(&mut world, "sim", 30);
        admit(&mut world, "nosuch", 3);
        assert_eq!(
            refusals.words(&world, 5).unwrap(),
            "frames or poses are refused: 1 unknown_body, the last of source \"sim\": send bodies that the scene has, \
             by the ids of this start; 1 unknown_source, the last of source \"nosuch\": send in the name of a source \
             that the scene has"
        );
        for _ in 0..9 {
            admit(&mut world, "sim", 30);
            assert_eq!(refusals.words(&world, S), None);
        }
        let text = refusals.words(&world, 60 * S).unwrap();
        assert!(
            text.contains("refused: 9 unknown_body") && !text.contains("nosuch"),
            "{text}"
        );
        assert_eq!(refusals.words(&world, 90 * S), None);
    }

    #[test]
    fn bug_a_pose_that_is_refused_is_told_with_the_name_of_its_body() {
        let text = "[[source]]\nname = \"sim\"\n[[body]]\nname = \"b\"\nid = 3\nsource = \"sim\"\n\
                    shape = { type = \"sphere\", radius = 1 }\n";
        let scene = Scene::parse(text, "scene.toml", std::path::Path::new("")).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        let mut world = World::new(&scene, shapes.bodies, S).unwrap();
        world.admit(&frame("sim", 1, 3, 1e300), S);
        let text = Refusals::default().words(&world, S).unwrap();
        assert!(
            text.contains("1 over_limit, the last of source \"sim\", body \"b\": "),
            "{text}"
        );
    }
}
