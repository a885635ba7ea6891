//! Feet that give way to constraints: they step to where they are asked, and back.

use std::ops::Range;

use glam::Vec3;

use super::constraint::Constraint;
use crate::body_solver::FootPlan;
use crate::library::foot::LEGS;

/// A planted foot that has to be farther elsewhere than this steps there, metres.
const STEPPING_DISTANCE: f32 = 0.004;
/// How high such a step lifts the foot, as a share of its way.
const LIFT_SHARE: f32 = 0.25;
/// Gives way to constraints that ask for a foot to be elsewhere: around them the foot steps there and back, as `fade`
/// (0 to 1 over the frames of `span`) has it.
pub(super) fn follow(
    plan: &mut FootPlan,
    constraints: &[Constraint],
    span: &Range<usize>,
    fade: impl Fn(usize) -> f32,
) {
    for (side, leg) in LEGS.iter().enumerate() {
        for c in constraints.iter().filter(|c| !c.soft && leg[1..].contains(&c.joint)) {
            let frames = c.frames();
            for frame in span.clone() {
                let near = frame.clamp(frames.start, frames.end - 1);
                let own = &plan.feet[near][side];
                let place = if c.joint == leg[3] { own.toe } else { own.ankle };
                // A pinned shin says nothing of the foot's place, but frees it.
                let away = match c.position(near) {
                    Some(target) if c.joint != leg[1] => target - place,
                    _ => Vec3::ZERO,
                };
                let inside = frames.contains(&frame);
                let weight = if inside { 1.0 } else { fade(frame) };
                let foot = &mut plan.feet[frame][side];
                if inside {
                    foot.planted = false;
                    foot.sigma = 0.3;
                    continue;
                }
                if away.length() > STEPPING_DISTANCE && weight > 0.0 && weight < 1.0 {
                    foot.planted = false;
                    foot.sigma = foot.sigma.max(0.02);
                }
                let lift = LIFT_SHARE * away.truncate().length() * 4.0 * weight * (1.0 - weight);
                let moved = away * weight + Vec3::Z * lift;
                foot.ankle += moved;
                foot.toe += moved;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Joint;
    use crate::test_world::{close, still};

    /// The feet of who stands for 20 frames, after a constraint on frames 8 and 9 was followed.
    fn followed(joint: Joint, away: Option<Vec3>, soft: bool) -> (FootPlan, FootPlan) {
        let motion = still(20);
        let before = FootPlan::of(&motion);
        let place = motion.postures[8].pose().position(joint);
        let mut c = Constraint::positions("Foot", joint, 8, vec![place; 2]);
        match away {
            Some(away) => c.positions.iter_mut().for_each(|p| *p += away),
            None => (c.rotations, c.positions) = (vec![glam::Quat::IDENTITY; 2], Vec::new()),
        }
        c.soft = soft;
        let mut plan = before.clone();
        // Up from frame 4 on, and down to frame 13.
        let fade = |f: usize| (if f < 8 { f as f32 - 4.0 } else { 13.0 - f as f32 } / 4.0).clamp(0.0, 1.0);
        follow(&mut plan, &[c], &(2..16), fade);
        (before, plan)
    }

    #[test]
    fn a_foot_steps_to_where_it_is_asked_and_back() {
        let away = Vec3::new(0.12, -0.16, 0.0);
        for joint in [Joint::LeftFoot, Joint::LeftToe] {
            let (before, plan) = followed(joint, Some(away), false);
            for frame in 0..20 {
                let (old, new) = (before.feet[frame], plan.feet[frame]);
                // The other foot has nothing to do with it.
                assert_eq!((old[1].ankle, old[1].planted), (new[1].ankle, new[1].planted));
                let weight = match frame {
                    5 | 12 => 0.25,
                    6 | 11 => 0.5,
                    7 | 10 => 0.75,
                    _ => 0.0,
                };
                // As high as a quarter of its way of 20 cm, in the middle.
                let lift = 0.25 * 0.2 * 4.0 * weight * (1.0 - weight);
                let moved = away * weight + Vec3::Z * lift;
                assert!((new[0].ankle - old[0].ankle).distance(moved) < 1e-6, "{frame}");
                assert!((new[0].toe - old[0].toe).distance(moved) < 1e-6, "{frame}");
                let flies = weight > 0.0;
                assert_eq!(new[0].planted, !flies && !(8..10).contains(&frame), "{frame}");
                let sigma = if (8..10).contains(&frame) {
                    0.3
                } else if flies {
                    0.02
                } else {
                    0.01
                };
                close(new[0].sigma, sigma, 1e-6);
            }
        }
    }

    #[test]
    fn a_hair_is_no_step_and_a_shin_frees_its_foot() {
        let (before, plan) = followed(Joint::RightFoot, Some(Vec3::X * 0.003), false);
        assert!(plan.feet[6][1].planted && !plan.feet[8][1].planted);
        close(plan.feet[6][1].ankle.x - before.feet[6][1].ankle.x, 0.0015, 1e-5);
        let (_, plan) = followed(Joint::RightFoot, Some(Vec3::X * 0.005), false);
        assert!(!plan.feet[6][1].planted);
        let free = |plan: &FootPlan, side: usize| (0..20).filter(|f| !plan.feet[*f][side].planted).count();
        let unmoved = |a: &FootPlan, b: &FootPlan| (0..20).all(|f| a.feet[f][1].ankle == b.feet[f][1].ankle);
        // A shin's place says nothing of the foot's; a rotation asks for no place.
        for (joint, away) in [(Joint::RightLeg, Some(Vec3::X * 0.3)), (Joint::RightFoot, None)] {
            let (before, plan) = followed(joint, away, false);
            assert_eq!((free(&plan, 1), free(&plan, 0)), (2, 0));
            assert!(unmoved(&before, &plan));
        }
        // A hand, a thigh and a wish leave the feet alone.
        for (joint, soft) in [(Joint::RightHand, false), (Joint::RightUpLeg, false), (Joint::RightFoot, true)]
        {
            let (before, plan) = followed(joint, Some(Vec3::X * 0.3), soft);
            assert_eq!(free(&plan, 1), 0);
            assert!(unmoved(&before, &plan));
        }
    }
}
