//! The motion synthesizer S: (m_t, a_t) ↦ m_{t+1} (LAMA, section 3.3).
//!
//! Every N-th frame the query feature x_t is matched against the database; between searches the
//! matched clip plays on. What the database gives is carried to where the character stands,
//! inertialised ([`inertia`]), altered by the posture offset τ, turned towards the cue when it sits
//! or stops ([`alignment`]), and its planted feet are kept where they are ([`feet`]). A finished motion is
//! played no faster than the library's joints turn ([`pace`]).

mod alignment;
mod feet;
mod inertia;
mod pace;

use glam::{Quat, Vec3};

use crate::cue::ActionCue;
use crate::library::database::MotionDatabase;
use crate::library::feature::{PoseFeature, pose_feature};
use crate::math::Planar;
use crate::math::rotation::{from_angle_axes, from_angle_axis, to_angle_axis, wrap_angle};
use crate::motion::skeleton::JOINT_COUNT;
use crate::motion::{FRAME_RATE, FootContact, Joint, Pose, Posture};

use alignment::Alignment;
use feet::Foot;
use inertia::{Glide, Inertia};

pub(crate) use pace::unhurried;

/// Seconds of one frame.
pub(crate) const FRAME_TIME: f32 = 1.0 / FRAME_RATE;

/// The joints that the posture offset a^offset turns: shoulders and elbows (angle-axis, 12 numbers).
pub(crate) const OFFSET_JOINTS: [Joint; 4] =
    [Joint::LeftArm, Joint::LeftForeArm, Joint::RightArm, Joint::RightForeArm];

/// a^offset: an angle-axis vector (radians, in the joint's own frame) for each of [`OFFSET_JOINTS`].
pub(crate) type PostureOffset = [Vec3; OFFSET_JOINTS.len()];

/// How long a transition's difference lasts at the least, seconds.
const TRANSITION_SECONDS: f32 = 0.35;
/// …and longer where a joint would turn by more than this share of what the library's own turns: the clip turns it too.
const TRANSITION_SHARE: f32 = 0.6;
/// The same for the root's velocity.
const ROOT_SETTLES_IN: f32 = 0.35;
/// The same for a new posture offset.
const OFFSET_SETTLES_IN: f32 = 0.4;
/// Share of the hips' fastest turn in the library that the heading may take of it; the rest is for their tilt.
const TURN_SHARE: f32 = 0.97;

/// What neither the root nor a foot leads.
const UPPER_BODY: [Joint; 13] = [
    Joint::Spine,
    Joint::Spine1,
    Joint::Spine2,
    Joint::Neck,
    Joint::Head,
    Joint::LeftShoulder,
    Joint::LeftArm,
    Joint::LeftForeArm,
    Joint::LeftHand,
    Joint::RightShoulder,
    Joint::RightArm,
    Joint::RightForeArm,
    Joint::RightHand,
];

/// Everything S knows of the character at frame t.
#[derive(Debug, Clone)]
pub struct Character {
    /// Database frame that plays.
    pub frame: usize,
    /// Root's projection on the floor.
    pub planar: Planar,
    /// m_t.
    pub posture: Posture,
    /// Forward kinematics of m_t.
    pub pose: Pose,
    /// Forward kinematics of m_{t-1}.
    pub before: Pose,
    pub contact: FootContact,
    /// World height of the floor it walks on, metres.
    pub floor: f32,
    /// Squared distance (radians²) of m_t from m̂_t over the offset joints, for R_reg.
    pub offset_distance: f32,
    /// The fastest turn of a leg's joint in this frame over the 99.9th percentile of the library's, at least 1; all others
    /// keep to it. What is more than 1 makes the motion slower, see [`unhurried`].
    pub leg_speed: f32,
    joints: [Inertia; JOINT_COUNT],
    height: Inertia,
    glide: Glide,
    feet: [Foot; 2],
    /// The posture offset that is shown, that is wanted, and the difference.
    offset: PostureOffset,
    wanted_offset: PostureOffset,
    missing_offset: [Inertia; OFFSET_JOINTS.len()],
    alignment: Option<Alignment>,
}

impl Character {
    /// Standing at `start` in database frame `frame`, on a floor `floor` metres high.
    pub fn standing(database: &MotionDatabase, frame: usize, start: Planar, floor: f32) -> Self {
        let source = &database.frames[frame];
        let mut posture = source.posture.moved(Planar::default(), start);
        posture.root_position.z += floor;
        let pose = posture.pose();
        let mut character = Self {
            frame,
            planar: start,
            posture,
            pose,
            before: pose,
            contact: source.contact,
            floor,
            offset_distance: 0.0,
            leg_speed: 1.0,
            joints: [Inertia::default(); JOINT_COUNT],
            height: Inertia::default(),
            glide: Glide::default(),
            feet: [0, 1].map(|side| Foot::standing(&start, source, side)),
            offset: [Vec3::ZERO; OFFSET_JOINTS.len()],
            wanted_offset: [Vec3::ZERO; OFFSET_JOINTS.len()],
            missing_offset: [Inertia::default(); OFFSET_JOINTS.len()],
            alignment: None,
        };
        character.pose_from(database);
        character.before = character.pose;
        character
    }

    /// {p_j}, {ṗ_j}, θ_up, c of the query feature x_t.
    pub fn pose_feature(&self) -> PoseFeature {
        let mut feature = pose_feature(&self.pose, &self.before, self.contact);
        // Features are over the floor that the person stands on.
        for e in 0..5 {
            feature[3 * e + 2] -= self.floor;
        }
        feature
    }

    /// Planar velocity of the root in person-centric space, m/s.
    pub fn velocity(&self) -> glam::Vec2 {
        let step = (self.pose.positions[0] - self.before.positions[0]).truncate() * FRAME_RATE;
        self.planar.direction_to_local(step)
    }

    /// Enters database frame `frame` without a visible jump.
    pub fn transition(&mut self, database: &MotionDatabase, frame: usize) {
        let (old, new) = (&database.frames[self.frame], &database.frames[frame]);
        let old_next = &database.frames[self.frame + usize::from(old.remaining > 0)];
        let new_next = &database.frames[frame + usize::from(new.remaining > 0)];
        for joint in 0..JOINT_COUNT {
            let velocity = |a: &Posture, b: &Posture| {
                to_angle_axis(b.rotations[joint] * a.rotations[joint].inverse()) * FRAME_RATE
            };
            let shown = from_angle_axis(self.joints[joint].offset) * old.posture.rotations[joint];
            let inertia = &mut self.joints[joint];
            inertia.offset = to_angle_axis(shown * new.posture.rotations[joint].inverse());
            inertia.velocity +=
                velocity(&old.posture, &old_next.posture) - velocity(&new.posture, &new_next.posture);
            inertia.limit_velocity();
            let speed = TRANSITION_SHARE * database.turns.usual[joint] * FRAME_RATE;
            inertia.settle_in(inertia::settling_time(inertia.offset.length(), speed, TRANSITION_SECONDS));
        }
        self.height.offset.z += old.posture.root_position.z - new.posture.root_position.z;
        self.height.velocity.z += (old_next.posture.root_position.z
            - old.posture.root_position.z
            - new_next.posture.root_position.z
            + new.posture.root_position.z)
            * FRAME_RATE;
        self.height.settle_in(TRANSITION_SECONDS);
        let drift = self.planar.direction_to_world(old.step.position - new.step.position);
        self.glide.add(drift.extend(old.step.yaw - new.step.yaw) * FRAME_RATE, ROOT_SETTLES_IN);
        for side in 0..2 {
            self.feet[side].transition(&self.planar, old, old_next, new, new_next, side);
        }
        self.frame = frame;
        self.alignment = None;
    }

    /// From now on the clip's end is led to the cue.
    pub fn align(&mut self, cue: &ActionCue) {
        self.alignment = Some(Alignment::new(cue));
    }

    /// One frame of S: the database's next posture, updated by τ: m_{t+1} = τ(m̂_{k*+1}, a^offset).
    /// The arms turn towards `offset` smoothly.
    pub fn advance(&mut self, database: &MotionDatabase, offset: &PostureOffset) {
        let source = &database.frames[self.frame];
        self.before = self.pose;
        let before = self.planar;
        self.planar = self.planar.compose(source.step);
        let glide = self.glide.step();
        self.planar.position += glide.truncate();
        self.planar.yaw = wrap_angle(self.planar.yaw + glide.z);
        if source.remaining > 0 {
            self.frame += 1;
        }
        if let Some(alignment) = &mut self.alignment {
            alignment.step(database, self.frame, &mut self.planar, self.floor);
        }
        let turn = wrap_angle(self.planar.yaw - before.yaw);
        let most = TURN_SHARE * database.turns.usual[Joint::Hips.index()];
        self.planar.yaw = wrap_angle(before.yaw + turn.clamp(-most, most));
        self.joints.iter_mut().for_each(Inertia::step);
        self.height.step();
        for (at, wanted) in offset.iter().enumerate() {
            let missing = &mut self.missing_offset[at];
            if self.wanted_offset[at] != *wanted {
                missing.offset += self.wanted_offset[at] - *wanted;
                missing.settle_in(OFFSET_SETTLES_IN);
            }
            missing.step();
            self.offset[at] = *wanted + missing.offset;
        }
        self.wanted_offset = *offset;
        for side in 0..2 {
            let other_stands = self.feet[1 - side].stands();
            self.feet[side].step(&self.planar, &database.frames[self.frame], side, other_stands);
        }
        let last = self.posture;
        self.pose_from(database);
        self.slow_down(&last, database);
    }

    /// No joint turns faster than the library's own do (its 99.9th percentile): what is missing stays in its offset, to be
    /// caught up with. A leg that stands follows the pelvis as fast as it must; see [`unhurried`].
    fn slow_down(&mut self, last: &Posture, database: &MotionDatabase) {
        let source = &database.frames[self.frame];
        let mut slowed = false;
        for &joint in &UPPER_BODY {
            let at = joint.index();
            let Some(rotation) =
                database.turns.slowed_down(at, last.rotations[at], self.posture.rotations[at])
            else {
                continue;
            };
            slowed = true;
            self.posture.rotations[at] = rotation;
            let offset = OFFSET_JOINTS.iter().position(|j| *j == joint);
            let offset = offset.map_or(Quat::IDENTITY, |j| from_angle_axis(self.offset[j]));
            let shown = rotation * offset.inverse();
            let offset = to_angle_axis(shown * source.posture.rotations[at].inverse());
            self.joints[at].divert(offset, TRANSITION_SECONDS);
        }
        if slowed {
            for joint in UPPER_BODY {
                self.pose.place(&self.posture, joint.index());
            }
        }
        self.leg_speed = feet::CHAIN
            .iter()
            .flatten()
            .map(|j| {
                database.turns.ratio(j.index(), last.rotations[j.index()], self.posture.rotations[j.index()])
            })
            .fold(1.0, f32::max);
    }

    /// Recomputes m_t from the database frame and everything laid over it.
    fn pose_from(&mut self, database: &MotionDatabase) {
        let source = &database.frames[self.frame];
        let posture = &mut self.posture;
        let lift = self.alignment.as_ref().map_or(0.0, Alignment::lift);
        let z = source.posture.root_position.z + self.height.offset.z + lift + self.floor;
        posture.root_position = self.planar.position.extend(z);
        let offsets = from_angle_axes(&self.joints.map(|j| j.offset));
        for joint in 0..JOINT_COUNT {
            posture.rotations[joint] = offsets[joint] * source.posture.rotations[joint];
        }
        posture.rotations[0] = self.planar.rotation() * posture.rotations[0];
        self.offset_distance = 0.0;
        for (joint, offset) in OFFSET_JOINTS.iter().zip(&self.offset) {
            let rotation = &mut posture.rotations[joint.index()];
            *rotation = (*rotation * from_angle_axis(*offset)).normalize();
            self.offset_distance += offset.length_squared();
        }
        self.pose = posture.pose();
        for side in 0..2 {
            self.feet[side].reach(&self.planar, source, self.floor, side, posture, &mut self.pose);
        }
        self.contact = [0, 1].map(|s| self.feet[s].contact(source.contact[s]));
        for rotation in &mut posture.rotations {
            *rotation = normalize(*rotation);
        }
    }

    /// Frames until the sit or stop that plays is complete; `None` while walking.
    pub fn until_complete(&self, database: &MotionDatabase) -> Option<usize> {
        self.alignment.as_ref().map(|_| usize::from(database.frames[self.frame].until_complete))
    }
}

fn normalize(q: Quat) -> Quat {
    let length = q.length_squared();
    if (length - 1.0).abs() > 1e-6 { q.normalize() } else { q }
}
