//! Windows with more in them than the captures show: arms that reach anywhere, backs that bend, pelvises that sink.
//!
//! An edit asks for postures that few libraries hold. Each change here is one that a body could make: it fades in
//! and out smoothly, an elbow bends about its own hinge, the feet stay where they were and the legs follow by
//! their inverse kinematics. Training sees such windows beside the plain ones; errors are measured on plain ones.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};
use rand::RngExt;
use rand_pcg::Pcg32;

use super::window::WINDOW;
use crate::library::foot;
use crate::math::curve::smoothstep;
use crate::math::rotation::yaw;
use crate::motion::skeleton::ARMS;
use crate::motion::{Joint, Motion, Posture};

const SPINE: [Joint; 3] = [Joint::Spine, Joint::Spine1, Joint::Spine2];
const UPPER_BODY: std::ops::RangeInclusive<usize> = Joint::Spine as usize..=Joint::RightHand as usize;
/// The pelvis does not sink below this, metres: half a squat.
const LOWEST_PELVIS: f32 = 0.40;

/// How often each change is made, of the windows that are changed at all.
const HOLD_SHARE: f32 = 0.2;
const SPLICE_SHARE: f32 = 0.25;
const REACH_SHARE: f32 = 0.5;
const BEND: f32 = 0.4;
const SINK: f32 = 0.3;
const JITTER: f32 = 0.4;

/// A changed copy of `window`; `other` lends its upper body. Both have [`WINDOW`] frames.
pub(super) fn augment(window: &Motion, other: &Motion, rng: &mut Pcg32) -> Motion {
    let mut motion = window.clone();
    if chance(rng, HOLD_SHARE) {
        hold(&mut motion, rng);
    }
    if chance(rng, SPLICE_SHARE) {
        splice(&mut motion, other, rng);
    }
    for side in 0..2 {
        if chance(rng, REACH_SHARE) {
            reach(&mut motion, side, rng);
        }
    }
    if chance(rng, JITTER) {
        jitter(&mut motion, rng);
    }
    let (bend, sink) = (chance(rng, BEND), chance(rng, SINK));
    if bend || sink {
        move_pelvis(&mut motion, bend, sink, rng);
    }
    motion
}

fn chance(rng: &mut Pcg32, probability: f32) -> bool {
    rng.random_range(0.0..1.0) < probability
}

/// Stops time at one frame, as the editor does where a manipulation needs longer than the motion stands still.
fn hold(motion: &mut Motion, rng: &mut Pcg32) {
    let at = rng.random_range(0..WINDOW);
    let frames = rng.random_range(15..100);
    let frame = |t: usize| if t <= at { t } else { t.saturating_sub(frames).max(at) };
    motion.postures = (0..WINDOW).map(|t| motion.postures[frame(t)]).collect();
    motion.contacts = (0..WINDOW).map(|t| motion.contacts[frame(t)]).collect();
}

/// A weight that rises from 0 to 1 and falls again, once, somewhere; it may have risen before the window begins.
struct Bump {
    rise: [f32; 2],
    fall: [f32; 2],
}

impl Bump {
    fn new(rng: &mut Pcg32) -> Self {
        let rise = rng.random_range(-40.0..WINDOW as f32 * 0.7);
        let plateau = rise + rng.random_range(12.0..36.0);
        let fall = plateau + rng.random_range(0.0..90.0);
        Self { rise: [rise, plateau], fall: [fall, fall + rng.random_range(12.0..36.0)] }
    }

    fn at(&self, frame: usize) -> f32 {
        let step = |[from, to]: [f32; 2]| smoothstep((frame as f32 - from) / (to - from));
        step(self.rise) * (1.0 - step(self.fall))
    }
}

/// A number that sways slowly about its middle.
struct Sway {
    middle: f32,
    range: f32,
    phase: f32,
    speed: f32,
}

impl Sway {
    /// Stays within `low..high`.
    fn new(low: f32, high: f32, rng: &mut Pcg32) -> Self {
        let range = rng.random_range(0.0..0.3) * (high - low);
        Self {
            middle: rng.random_range(low + range..high - range),
            range,
            phase: rng.random_range(0.0..TAU),
            speed: TAU / rng.random_range(30.0..150.0),
        }
    }

    fn at(&self, frame: usize) -> f32 {
        self.middle + self.range * (self.phase + self.speed * frame as f32).sin()
    }
}

/// Lends the upper body of another window.
fn splice(motion: &mut Motion, other: &Motion, rng: &mut Pcg32) {
    let bump = Bump::new(rng);
    for (frame, (posture, lent)) in motion.postures.iter_mut().zip(&other.postures).enumerate() {
        let weight = bump.at(frame);
        for joint in UPPER_BODY {
            posture.rotations[joint] = blend(posture.rotations[joint], lent.rotations[joint], weight);
        }
    }
}

/// Moves an arm to anywhere that a shoulder and an elbow allow.
fn reach(motion: &mut Motion, side: usize, rng: &mut Pcg32) {
    // Worked out for the left arm, which points along +X at rest; the right one is its mirror image.
    let [shoulder, arm, forearm, hand] = ARMS[side];
    let bump = Bump::new(rng);
    let elevation = Sway::new(0.15, 2.7, rng);
    // From straight ahead towards the arm's own side; across the chest below zero.
    let azimuth = Sway::new(-0.6, 1.8, rng);
    let twist = Sway::new(-1.0, 1.0, rng);
    let flexion = Sway::new(0.05, 2.3, rng);
    let wrist = [Sway::new(-0.6, 0.6, rng), Sway::new(-0.4, 0.4, rng), Sway::new(-0.6, 0.6, rng)];
    for (frame, posture) in motion.postures.iter_mut().enumerate() {
        let weight = bump.at(frame);
        let (up, out) = (elevation.at(frame), azimuth.at(frame));
        let direction = Vec3::new(up.sin() * out.sin(), -up.sin() * out.cos(), -up.cos());
        // The collar bone follows a raised arm.
        let raised = (up - 1.4).max(0.0) * 0.35;
        let collar = Quat::from_rotation_y(-raised);
        let upper = Quat::from_rotation_arc(Vec3::X, collar.inverse() * direction)
            * Quat::from_rotation_x(twist.at(frame));
        let lower = Quat::from_rotation_z(-flexion.at(frame));
        let turned = Quat::from_scaled_axis(Vec3::from_array(std::array::from_fn(|i| wrist[i].at(frame))));
        for (joint, rotation) in [(shoulder, collar), (arm, upper), (forearm, lower), (hand, turned)] {
            let rotation = if side == 0 { rotation } else { mirrored(rotation) };
            let now = &mut posture.rotations[joint.index()];
            *now = blend(*now, rotation, weight);
        }
    }
}

/// Turns every joint of the upper body a little.
fn jitter(motion: &mut Motion, rng: &mut Pcg32) {
    for joint in UPPER_BODY {
        let size = rng.random_range(0.0..0.2);
        let sways: [Sway; 3] = std::array::from_fn(|_| Sway::new(-size, size, rng));
        for (frame, posture) in motion.postures.iter_mut().enumerate() {
            let offset = Vec3::from_array(std::array::from_fn(|i| sways[i].at(frame)));
            posture.rotations[joint] =
                (posture.rotations[joint] * Quat::from_scaled_axis(offset)).normalize();
        }
    }
}

/// Bends the back (and the pelvis with it) and lowers the pelvis, the feet staying where they are.
fn move_pelvis(motion: &mut Motion, bend: bool, sink: bool, rng: &mut Pcg32) {
    let bump = Bump::new(rng);
    let or_none = |on: bool, value: f32| if on { value } else { 0.0 };
    // Forward is the greater part of what a back can do; a little comes from the hips.
    let forward = or_none(bend, rng.random_range(-0.15..1.2));
    let side = or_none(bend, rng.random_range(-0.3..0.3));
    let turn = or_none(bend, rng.random_range(-0.6..0.6));
    let pitch = or_none(bend, rng.random_range(0.0..0.6) * forward);
    let depth = or_none(sink, rng.random_range(-0.02..0.5));
    let shift = [rng.random_range(-0.06..0.06), 0.12 * pitch + rng.random_range(0.0..0.25) * depth];
    for (frame, posture) in motion.postures.iter_mut().enumerate() {
        let weight = bump.at(frame);
        if weight == 0.0 {
            continue;
        }
        let before = posture.pose();
        let facing = Quat::from_rotation_z(yaw(posture.rotations[0]));
        // Where the pelvis may go: not below a deep squat, and not down at all where it is low already.
        let room = (posture.root_position.z - LOWEST_PELVIS).max(0.0);
        let down = (weight * depth).min(0.7 * room);
        posture.root_position += facing * Vec3::new(weight * shift[0], weight * shift[1], -down);
        posture.rotations[0] =
            (facing * Quat::from_rotation_x(weight * pitch) * facing.inverse() * posture.rotations[0])
                .normalize();
        let share = weight / SPINE.len() as f32;
        for joint in SPINE {
            let offset = Vec3::new(share * forward, share * side, share * turn);
            let now = &mut posture.rotations[joint.index()];
            *now = (*now * Quat::from_scaled_axis(offset)).normalize();
        }
        plant(posture, &before);
    }
}

/// Puts the feet back where `before` has them.
fn plant(posture: &mut Posture, before: &crate::motion::Pose) {
    for (side, foot) in Joint::FEET.into_iter().enumerate() {
        let pose = posture.pose();
        foot::reach(posture, &pose, side, before.position(foot), before.rotation(foot));
    }
}

fn blend(from: Quat, to: Quat, weight: f32) -> Quat {
    from.slerp(if from.dot(to) < 0.0 { -to } else { to }, weight).normalize()
}

/// The rotation seen in the plane x = 0.
fn mirrored(q: Quat) -> Quat {
    Quat::from_xyzw(q.x, -q.y, -q.z, q.w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::angle_between;
    use rand::SeedableRng;

    fn standing() -> Motion {
        let mut posture = Posture::default();
        posture.root_position.z -= 0.02;
        let pose = Posture::default().pose();
        plant(&mut posture, &pose);
        Motion { postures: vec![posture; WINDOW], contacts: vec![[1.0, 1.0]; WINDOW] }
    }

    #[test]
    fn feet_stay_and_everything_moves_smoothly() {
        let window = standing();
        let feet = window.postures[0].pose();
        let mut most_bent = 0.0f32;
        for seed in 0..200 {
            let mut rng = Pcg32::seed_from_u64(seed);
            let changed = augment(&window, &window, &mut rng);
            assert_eq!((changed.postures.len(), changed.contacts.len()), (WINDOW, WINDOW));
            for pair in changed.postures.windows(2) {
                for (a, b) in pair[0].rotations.iter().zip(&pair[1].rotations) {
                    // A whole arm goes up within 12 frames at the most.
                    assert!(angle_between(*a, *b) < 0.6, "seed {seed}");
                }
                assert!(pair[0].root_position.distance(pair[1].root_position) < 0.08);
            }
            for posture in &changed.postures {
                let pose = posture.pose();
                for foot in Joint::FEET {
                    // Where the leg is too short for the shifted pelvis the foot gives way a little.
                    assert!(pose.position(foot).distance(feet.position(foot)) < 0.05, "seed {seed}");
                }
                assert!(posture.root_position.z >= LOWEST_PELVIS);
                most_bent = most_bent.max(1.0 - pose.position(Joint::Head).z / feet.position(Joint::Head).z);
            }
        }
        assert!(most_bent > 0.3, "{most_bent}");
    }

    #[test]
    fn arms_reach_forward_up_and_down_and_elbows_bend_forward() {
        let window = standing();
        let (mut high, mut low, mut ahead) = (0.0f32, 2.0f32, 0.0f32);
        for seed in 0..100 {
            let mut motion = window.clone();
            reach(&mut motion, (seed % 2) as usize, &mut Pcg32::seed_from_u64(seed));
            for posture in &motion.postures {
                let pose = posture.pose();
                for hand in Joint::HANDS {
                    let hand = pose.position(hand);
                    high = high.max(hand.z);
                    low = low.min(hand.z);
                    ahead = ahead.max(-hand.y);
                }
            }
        }
        assert!(high > 1.8 && low < 1.0 && ahead > 0.4, "{high} {low} {ahead}");
        // By hand: the left arm straight ahead, the elbow at a right angle: the hand points across, to the right.
        let mut posture = Posture::default();
        posture.rotations[Joint::LeftArm.index()] = Quat::from_rotation_arc(Vec3::X, Vec3::NEG_Y);
        posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_z(-std::f32::consts::FRAC_PI_2);
        let pose = posture.pose();
        let forearm = pose.position(Joint::LeftHand) - pose.position(Joint::LeftForeArm);
        assert!(forearm.normalize().distance(Vec3::NEG_X) < 1e-5);
    }

    #[test]
    fn a_held_frame_stands_still_and_time_goes_on_after_it() {
        let mut window = standing();
        for (frame, posture) in window.postures.iter_mut().enumerate() {
            posture.root_position.x = frame as f32;
        }
        for seed in 0..50 {
            let mut held = window.clone();
            hold(&mut held, &mut Pcg32::seed_from_u64(seed));
            let steps: Vec<f32> =
                held.postures.windows(2).map(|p| p[1].root_position.x - p[0].root_position.x).collect();
            assert!(steps.iter().all(|s| *s == 0.0 || *s == 1.0), "{steps:?}");
        }
    }
}
