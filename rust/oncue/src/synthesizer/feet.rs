//! Feet: a planted toe stays where it is, and the legs reach for the feet.
//!
//! The clip's toes and foot rotations are followed directly, not through the inertialised chain
//! above them: a planted foot of the clip is then planted in the result whatever the pelvis does.
//! What remains of the difference (transitions, alignment, the root's glide) is absorbed by holding
//! the toe in place while it is in contact and letting go of it in the swing. Where no swing comes in
//! time, the foot takes a small step of its own.

use glam::{Quat, Vec2, Vec3};

use super::FRAME_TIME;
use super::inertia::Inertia;
use crate::library::database::DatabaseFrame;
use crate::math::Planar;
use crate::math::rotation::{from_angle_axis, to_angle_axis};
use crate::motion::skeleton::{JOINT_OFFSET, LEG_LENGTH, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, Joint, Pose, Posture};

/// A held toe takes a step when the clip's toe is this far from it, metres.
const STEP_FROM: f32 = 0.16;
/// How long that step takes, seconds, and how high the foot rises, metres.
const STEP_TIME: f32 = 0.3;
const STEP_HEIGHT: f32 = 0.05;
/// How long what a transition or a stand has left lasts, seconds.
const FOOT_SECONDS: f32 = 0.2;
/// Longest reach of a leg as a share of its full length: the knee keeps some 8° of flexion.
const LEG_SHARE: f32 = 0.9975;
/// Metres from the hip to the ankle, at the most.
const LONGEST_LEG: f32 = 2.0 * LEG_LENGTH * LEG_SHARE;
/// The heel may rise this far to bring the leg within reach, radians.
const HEEL_RISE: f32 = 0.9;

/// UpLeg, Leg, Foot, Toe of each side.
pub(super) const CHAIN: [[Joint; 4]; 2] = [
    [Joint::LeftUpLeg, Joint::LeftLeg, Joint::LeftFoot, Joint::LeftToe],
    [Joint::RightUpLeg, Joint::RightLeg, Joint::RightFoot, Joint::RightToe],
];

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Foot {
    /// Shown toe minus the clip's toe, world.
    toe: Inertia,
    /// Shown foot rotation over the clip's.
    turn: Inertia,
    /// Where the toe is held, world.
    held: Option<Vec2>,
    /// Where the toe came to stand because the leg could not reach the held place, in the last frame.
    dragged: Option<Vec2>,
    /// Seconds into a step of its own.
    stepping: Option<f32>,
    last_toe: Vec3,
}

impl Foot {
    /// Where the clip's toe would be.
    fn clip_toe(planar: &Planar, frame: &DatabaseFrame, side: usize) -> Vec3 {
        let toe = frame.toe[side];
        planar.point_to_world(toe.truncate()).extend(toe.z)
    }

    /// Of a character that appears in `frame`: a planted toe is held from the first.
    pub(super) fn standing(planar: &Planar, frame: &DatabaseFrame, side: usize) -> Self {
        let toe = Self::clip_toe(planar, frame, side);
        let held = (frame.contact[side] >= 1.0).then(|| toe.truncate());
        Self { held, last_toe: toe, ..Self::default() }
    }

    pub(super) fn transition(
        &mut self,
        planar: &Planar,
        old: &DatabaseFrame,
        old_next: &DatabaseFrame,
        new: &DatabaseFrame,
        new_next: &DatabaseFrame,
        side: usize,
    ) {
        let velocity = |a: &DatabaseFrame, b: &DatabaseFrame| {
            let next = planar.compose(a.step);
            (Self::clip_toe(&next, b, side) - Self::clip_toe(planar, a, side)) * FRAME_RATE
        };
        self.toe.offset += Self::clip_toe(planar, old, side) - Self::clip_toe(planar, new, side);
        self.toe.velocity += velocity(old, old_next) - velocity(new, new_next);
        self.toe.limit_velocity();
        self.toe.settle_in(FOOT_SECONDS);
        let shown = from_angle_axis(self.turn.offset) * planar.rotation() * old.foot_rotation[side];
        let turn = to_angle_axis(shown * (planar.rotation() * new.foot_rotation[side]).inverse());
        self.turn.begin(turn, Vec3::ZERO, FOOT_SECONDS);
        self.last_toe = Self::clip_toe(planar, new, side);
    }

    /// Whether the toe is held in place.
    pub(super) fn stands(&self) -> bool {
        self.held.is_some() && self.dragged.is_none()
    }

    /// One frame on; `frame` is the frame now shown.
    pub(super) fn step(&mut self, planar: &Planar, frame: &DatabaseFrame, side: usize, other_stands: bool) {
        let clip = Self::clip_toe(planar, frame, side);
        let dragged = self.dragged.take();
        if let (Some(held), Some(dragged)) = (&mut self.held, dragged) {
            *held = dragged;
        }
        self.stepping = self.stepping.map(|t| t + FRAME_TIME).filter(|t| *t < STEP_TIME);
        let planted = frame.contact[side] >= 1.0 && self.stepping.is_none();
        if let Some(held) = self.held {
            let offset = held - clip.truncate();
            if planted && other_stands && (offset.length() > STEP_FROM || dragged.is_some()) {
                self.stepping = Some(FRAME_TIME);
            }
            if !planted || self.stepping.is_some() {
                // The shown toe stood still: its offset begins by undoing the clip's own velocity.
                let velocity = -((clip - self.last_toe) * FRAME_RATE).truncate();
                self.toe.begin(
                    offset.extend(self.toe.offset.z),
                    velocity.extend(self.toe.velocity.z),
                    FOOT_SECONDS,
                );
                self.toe.limit_velocity();
                self.held = None;
            }
        }
        self.toe.step();
        if let Some(held) = self.held {
            self.toe.offset = (held - clip.truncate()).extend(self.toe.offset.z);
            self.toe.velocity = Vec3::Z * self.toe.velocity.z;
        } else if planted && self.stepping.is_none() {
            self.held = Some(clip.truncate() + self.toe.offset.truncate());
        }
        self.turn.step();
        self.last_toe = clip;
    }

    /// The contact that is shown: a foot that steps or is dragged is not planted.
    pub(super) fn contact(&self, clip: f32) -> f32 {
        match (self.stepping, self.stands()) {
            (Some(_), _) => 0.0,
            (None, false) if clip >= 1.0 => 0.5,
            _ => clip,
        }
    }

    /// Bends the leg so that the toe stands where it should.
    pub(super) fn reach(
        &mut self,
        planar: &Planar,
        frame: &DatabaseFrame,
        floor: f32,
        side: usize,
        posture: &mut Posture,
        pose: &mut Pose,
    ) {
        let [thigh, .., toe] = CHAIN[side].map(Joint::index);
        self.dragged = None;
        let mut target = Self::clip_toe(planar, frame, side) + self.toe.offset;
        let lifted =
            self.stepping.map_or(0.0, |t| STEP_HEIGHT * (std::f32::consts::PI * t / STEP_TIME).sin());
        target.z += lifted;
        // Never under the floor: a toe's joint may sink no lower than when it stands flat.
        target.z = target.z.max(TOE_HEIGHT.min(frame.toe[side].z)) + floor;
        let mut rotation = from_angle_axis(self.turn.offset) * planar.rotation() * frame.foot_rotation[side];
        let hip = pose.positions[thigh];
        let ankle_of = |rotation: Quat| target - rotation * JOINT_OFFSET[toe];
        let mut ankle = ankle_of(rotation);
        let mut heel = 0.0;
        if ankle.distance(hip) > LONGEST_LEG {
            // Raise the heel about the toe just far enough, as a trailing leg does.
            let raised = |angle: f32| rotation * Quat::from_rotation_x(angle);
            let (mut low, mut high) = (0.0, HEEL_RISE);
            for _ in 0..10 {
                let middle = 0.5 * (low + high);
                if ankle_of(raised(middle)).distance(hip) > LONGEST_LEG {
                    low = middle
                } else {
                    high = middle
                }
            }
            heel = high;
            rotation = raised(heel);
            ankle = ankle_of(rotation);
            if ankle.distance(hip) > LONGEST_LEG + 1e-3 {
                ankle = hip + (ankle - hip).clamp_length_max(LONGEST_LEG);
                if self.held.is_some() {
                    self.dragged = Some((ankle + rotation * JOINT_OFFSET[toe]).truncate());
                }
            }
        }
        bend_leg(side, ankle, rotation, posture, pose);
        if heel > 0.0 {
            posture.rotations[toe] = Quat::from_rotation_x(-heel) * posture.rotations[toe];
            pose.place(posture, toe);
        }
    }
}

/// Bends a leg so that its ankle stands at `ankle` (world) and its foot is turned by `rotation`; the knee bends in the plane
/// it bent in.
pub(super) fn bend_leg(side: usize, ankle: Vec3, rotation: Quat, posture: &mut Posture, pose: &mut Pose) {
    let [thigh, shin, foot, toe] = CHAIN[side].map(Joint::index);
    let hip = pose.positions[thigh];
    let down = (ankle - hip).normalize_or(Vec3::NEG_Z);
    let distance = ankle.distance(hip).clamp(0.15, LONGEST_LEG);
    let straight = pose.positions[foot] - hip;
    let knee_before = pose.positions[shin] - hip;
    let bent = knee_before - straight * (knee_before.dot(straight) / straight.length_squared().max(1e-9));
    let pole = bent + 0.02 * (rotation * Vec3::NEG_Y);
    let ahead = pose.rotations[0] * Vec3::NEG_Y;
    let pole = (pole - down * pole.dot(down)).normalize_or(ahead);
    let along = distance / 2.0;
    let knee = hip + down * along + pole * (LEG_LENGTH * LEG_LENGTH - along * along).max(0.0).sqrt();
    let side_axis = pole.cross(down).normalize_or(Vec3::X);
    let bone = |from: Vec3, to: Vec3| {
        let z = (from - to).normalize_or(Vec3::Z);
        let x = (side_axis - z * side_axis.dot(z)).normalize_or(Vec3::X);
        Quat::from_mat3(&glam::Mat3::from_cols(x, z.cross(x), z))
    };
    let (thigh_rotation, shin_rotation) = (bone(hip, knee), bone(knee, ankle));
    posture.rotations[thigh] = pose.rotations[0].inverse() * thigh_rotation;
    posture.rotations[shin] = thigh_rotation.inverse() * shin_rotation;
    posture.rotations[foot] = shin_rotation.inverse() * rotation;
    for joint in [thigh, shin, foot, toe] {
        pose.place(posture, joint);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{STANDS, close, database, frame_of, person};

    fn stand() -> &'static DatabaseFrame {
        &database().frames[frame_of("stand", 0)]
    }

    fn walk(index: usize) -> &'static DatabaseFrame {
        &database().frames[frame_of("walk", index)]
    }

    fn at(x: f32) -> Planar {
        Planar::new(Vec2::new(x, 0.0), 0.0)
    }

    fn clip(x: f32) -> Vec2 {
        Foot::clip_toe(&at(x), stand(), 0).truncate()
    }

    #[test]
    fn a_planted_toe_is_held_while_the_root_moves_on() {
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        assert!(foot.stands());
        assert_eq!(foot.contact(1.0), 1.0);
        for n in 1..=15 {
            foot.step(&at(0.01 * n as f32), stand(), 0, true);
            let shown = clip(0.01 * n as f32) + foot.toe.offset.truncate();
            assert!(shown.distance(clip(0.0)) < 1e-5 && foot.stands());
        }
        // Sixteen centimetres are too far: it steps, in nine frames, and stands where the clip has it.
        foot.step(&at(0.17), stand(), 0, true);
        assert!(!foot.stands());
        assert_eq!(foot.contact(1.0), 0.0);
        let mut steps = 1;
        while foot.stepping.is_some() {
            foot.step(&at(0.17), stand(), 0, true);
            steps += 1;
            assert!(steps < 20);
        }
        assert_eq!(steps, (STEP_TIME * FRAME_RATE) as usize);
        assert!(foot.stands() && foot.held.expect("held").distance(clip(0.17)) < 0.01);
        assert_eq!(foot.contact(1.0), 1.0);
    }

    #[test]
    fn no_foot_steps_while_the_other_is_in_the_air() {
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        foot.step(&at(0.3), stand(), 0, false);
        assert!(foot.stands() && foot.held == Some(clip(0.0)));
        foot.step(&at(0.3), stand(), 0, true);
        assert!(!foot.stands());
    }

    #[test]
    fn a_swinging_foot_lets_go_and_comes_to_its_clip() {
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        foot.step(&at(0.1), stand(), 0, true);
        close(foot.toe.offset.x, -0.1, 1e-5);
        let mut offsets = Vec::new();
        for n in 0..8 {
            foot.step(&at(0.1), walk(n), 0, true);
            assert!(!foot.stands());
            offsets.push(foot.toe.offset.x);
        }
        // From where it stood to nothing in a fifth of a second.
        assert!(offsets[0] < -0.07 && offsets[0] > -0.101, "{offsets:?}");
        assert!(offsets.windows(2).all(|w| w[1] >= w[0] - 1e-5));
        close(offsets[5], 0.0, 1e-5);
        assert_eq!((foot.contact(0.0), foot.contact(0.5), foot.contact(1.0)), (0.0, 0.5, 0.5));
        // A walking foot appears without being held.
        assert!(!Foot::standing(&at(0.0), walk(3), 0).stands());
    }

    #[test]
    fn a_transition_keeps_the_toe_and_its_velocity() {
        let mut foot = Foot::standing(&at(0.0), walk(3), 1);
        foot.transition(&at(0.0), walk(3), walk(4), stand(), stand(), 1);
        let shown = Foot::clip_toe(&at(0.0), stand(), 1) + foot.toe.offset;
        assert!(shown.distance(Foot::clip_toe(&at(0.0), walk(3), 1)) < 1e-5);
        // Gliding on at 1.2 m/s.
        assert!(foot.toe.velocity.distance(Vec3::Y * -1.2) < 1e-3, "{}", foot.toe.velocity);
        assert!(foot.turn.offset.length() < 1e-4);
        assert!(foot.last_toe.distance(Foot::clip_toe(&at(0.0), stand(), 1)) < 1e-6);
        // No noise is faster than 8 m/s.
        let mut leaps = walk(4).clone();
        leaps.toe[1].x += 1.0;
        foot.transition(&at(0.0), walk(3), &leaps, stand(), stand(), 1);
        close(foot.toe.velocity.length(), 8.0, 1e-3);
    }

    fn reached(foot: &mut Foot, height: f32, floor: f32) -> (Posture, Pose) {
        let mut posture = person(Planar::default(), height, 0.0);
        let mut pose = posture.pose();
        foot.reach(&at(0.0), stand(), floor, 0, &mut posture, &mut pose);
        (posture, pose)
    }

    #[test]
    fn the_leg_bends_to_the_foot() {
        let toe = |pose: &Pose| pose.position(Joint::LeftToe);
        let own = Foot::clip_toe(&at(0.0), stand(), 0);
        for height in [STANDS, 0.8, 0.6] {
            let mut foot = Foot::standing(&at(0.0), stand(), 0);
            let (posture, pose) = reached(&mut foot, height, 0.0);
            assert!(toe(&pose).distance(own) < 1e-4, "{}", toe(&pose));
            assert!(foot.stands());
            // What is shown is what the rotations say, the sole is flat, and the knee is before the leg.
            let again = posture.pose();
            for joint in CHAIN[0] {
                assert!(again.position(joint).distance(pose.position(joint)) < 1e-4);
            }
            assert!(pose.rotation(Joint::LeftFoot).angle_between(stand().foot_rotation[0]) < 2e-3);
            assert!(pose.position(Joint::LeftLeg).y < pose.position(Joint::LeftUpLeg).y - 0.05);
            assert_eq!(
                posture.rotations[Joint::RightLeg.index()],
                person(Planar::default(), height, 0.0).rotations[Joint::RightLeg.index()]
            );
        }
    }

    #[test]
    fn a_leg_that_is_too_short_raises_the_heel_and_then_drags_the_toe() {
        let own = Foot::clip_toe(&at(0.0), stand(), 0);
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        // 3 cm higher than a straight leg.
        let (posture, pose) = reached(&mut foot, 1.02, 0.0);
        assert!(pose.position(Joint::LeftToe).distance(own) < 2e-3 && foot.stands());
        let tilt = pose.rotation(Joint::LeftFoot).angle_between(stand().foot_rotation[0]);
        assert!((0.1..HEEL_RISE).contains(&tilt), "{tilt}");
        assert!(pose.position(Joint::LeftFoot).z > 0.1);
        // The toes stay flat on the floor.
        assert!(pose.rotation(Joint::LeftToe).angle_between(stand().foot_rotation[0]) < 2e-3);
        let hip = pose.position(Joint::LeftUpLeg);
        // Just as far as it must.
        close(hip.distance(pose.position(Joint::LeftFoot)), LONGEST_LEG, 2e-3);
        assert!(posture.pose().position(Joint::LeftToe).distance(own) < 2e-3);
        // 30 cm higher the foot comes off.
        let (_, pose) = reached(&mut foot, 1.3, 0.0);
        assert!(!foot.stands() && foot.dragged.is_some());
        assert_eq!(foot.contact(1.0), 0.5);
        close(pose.position(Joint::LeftUpLeg).distance(pose.position(Joint::LeftFoot)), LONGEST_LEG, 1e-3);
        // From there it is held, and steps as soon as the other stands.
        let dragged = foot.dragged.expect("dragged");
        assert!(dragged.distance(pose.position(Joint::LeftToe).truncate()) < 1e-4);
        let mut waits = foot;
        waits.step(&at(0.0), stand(), 0, false);
        assert_eq!(waits.held, Some(dragged));
        foot.step(&at(0.0), stand(), 0, true);
        assert!(foot.stepping.is_some());
    }

    #[test]
    fn a_step_lifts_the_foot_and_no_toe_sinks() {
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        foot.stepping = Some(STEP_TIME / 2.0);
        let (_, pose) = reached(&mut foot, 0.9, 0.1);
        close(pose.position(Joint::LeftToe).z, TOE_HEIGHT + STEP_HEIGHT + 0.1, 1e-3);
        foot.stepping = Some(STEP_TIME / 6.0);
        let (_, pose) = reached(&mut foot, 0.9, 0.0);
        close(pose.position(Joint::LeftToe).z, TOE_HEIGHT + 0.5 * STEP_HEIGHT, 1e-3);
        foot.stepping = None;
        foot.toe.offset.z = -0.1;
        let (_, pose) = reached(&mut foot, 0.9, 0.0);
        close(pose.position(Joint::LeftToe).z, TOE_HEIGHT, 1e-3);
    }
}
