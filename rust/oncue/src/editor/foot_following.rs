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
