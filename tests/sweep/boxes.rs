//! The swept box of a continuous body contains it during the whole motion.

use sweepd::math::{Pose, Vec3};
use sweepd::wire::frame_flags;

use crate::oracle::rng::Rng;
use crate::rig::{ALL, FRAME_NS, Rig, body, scene};
use crate::truth::Motion;
use crate::walls::bullets;

#[test]
fn a_swept_box_holds_every_point_all_the_way_and_is_tight_again_in_the_next_tick() {
    for (kind, bullet) in bullets().iter().enumerate() {
        let mut rng = Rng::new(300 + kind as u64);
        let mut rig = Rig::new(&scene(
            "",
            &[body(1, [0.0; 3], &bullet.shape, "continuous = true")],
        ));
        for case in 0..300 {
            let far = 10.0_f64.powf(rng.range(-2.0, 6.0));
            let size = bullet.radius * 10.0_f64.powf(rng.range(-1.0, 3.0));
            // Some turn by more than half a turn, which is declared by their velocity.
            let turns = if case % 3 == 0 {
                rng.range(0.6, 3.0)
            } else {
                rng.range(0.0, 0.49)
            };
            let motion = Motion {
                from: Pose::from_parts(rng.vector(far).into(), rng.rotation()),
                travel: rng.vector(size),
                axis: rng.direction(),
                angle: turns * std::f64::consts::TAU,
            };
            rig.epoch += 1;
            rig.velocities.clear();
            rig.place(1, &motion.from);
            rig.send(ALL);
            let slot = rig.engine.world().slot_named("b1").unwrap();
            let tight = *rig.engine.world().proxy(slot).unwrap();
            if case % 3 == 0 {
                let spin = motion.axis * (motion.angle / (FRAME_NS as f64 * 1e-9));
                rig.velocities = vec![[0.0, 0.0, 0.0, spin.x, spin.y, spin.z]];
            }
            rig.place(1, &motion.end());
            rig.send(ALL);
            let swept = *rig.engine.world().proxy(slot).unwrap();
            assert!(swept.min.iter().zip(tight.min.iter()).all(|(s, t)| s <= t));
            let slack = 1e-13 * far;
            for k in 0..=200 {
                for p in &bullet.points {
                    let at = motion.place(p, f64::from(k) / 200.0);
                    for axis in 0..3 {
                        assert!(
                            swept.min[axis] <= at[axis] - bullet.margin + slack
                                && at[axis] + bullet.margin - slack <= swept.max[axis],
                            "kind {kind} case {case} share {k}/200: {at:?} {swept:?}"
                        );
                    }
                }
            }
            // The box is never larger than that of the bounding ball along the path of the centre.
            let ball = motion.travel.abs()
                + Vec3::repeat(2.0 * bullet.radius * (1.0 + 1e-9) + 1e-12 * far);
            assert!(
                (swept.max - swept.min)
                    .iter()
                    .zip(ball.iter())
                    .all(|(s, b)| s <= b)
            );
            rig.idle(FRAME_NS, ALL);
            let after = *rig.engine.world().proxy(slot).unwrap();
            assert!(swept.holds(&after));
            rig.flags = frame_flags::FULL;
        }
    }
}
