//! The motion synthesizer S: (m_t, a_t) ↦ m_{t+1} (LAMA, section 3.3).
//!
//! Every N-th frame the query feature x_t is matched against the database; between searches the
//! matched clip plays on. What the database gives is carried to where the character stands,
//! inertialised ([`inertia`]), altered by the posture offset τ as far as arms go ([`arms`]), turned towards the cue when it sits
//! or stops ([`alignment`]), and its feet stand where they landed ([`feet`]). A finished motion is
//! played no faster than the library's joints turn ([`pace`]).

mod alignment;
mod arms;
mod feet;
mod inertia;
mod pace;

use glam::{Quat, Vec3};

use crate::cue::{ActionCue, BodyState};
use crate::library::database::MotionDatabase;
use crate::library::feature::{PoseFeature, pose_feature};
use crate::math::Planar;
use crate::math::rotation::{from_angle_axes, from_angle_axis, to_angle_axis, wrap_angle};
use crate::motion::skeleton::JOINT_COUNT;
use crate::motion::{FRAME_RATE, FootContact, Joint, Pose, Posture};

use alignment::Alignment;
use feet::Foot;
use inertia::{Glide, Inertia};

pub(crate) use pace::{FASTEST_WALK, Leeway, unhurried};

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
    /// What the offset joints are turned by: the offset as far as arms go.
    offset_turns: [Quat; OFFSET_JOINTS.len()],
    missing_offset: [Inertia; OFFSET_JOINTS.len()],
    alignment: Option<Alignment>,
    lift: Option<SeatLift>,
}

/// How much higher than the clip's the seat is that one gets up from.
#[derive(Debug, Clone, Copy)]
struct SeatLift {
    metres: f32,
    /// Heights of the clip's pelvis on its seat and standing, metres.
    seated: f32,
    stands: f32,
}

impl SeatLift {
    /// What of it is left where the clip's pelvis is at `height`.
    fn at(&self, height: f32) -> f32 {
        let risen = (height - self.seated) / (self.stands - self.seated).max(1e-3);
        self.metres * (1.0 - risen.clamp(0.0, 1.0))
    }
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
            offset_turns: [Quat::IDENTITY; OFFSET_JOINTS.len()],
            missing_offset: [Inertia::default(); OFFSET_JOINTS.len()],
            alignment: None,
            lift: None,
        };
        character.pose_from(database);
        character.before = character.pose;
        character
    }

    /// Going on from what `body` does, in database frame `frame`, on a floor `floor` metres high: what is different is gone as
    /// after a transition; of who sits, the height of the seat as the clip's pelvis rises until frame `rises_until`.
    pub fn continuing(
        database: &MotionDatabase,
        frame: usize,
        rises_until: Option<usize>,
        body: &BodyState,
        floor: f32,
    ) -> Self {
        let [before, now] = &body.postures;
        let here = now.planar();
        let mut character = Self::standing(database, frame, here, floor);
        let source = &database.frames[frame];
        let next = &database.frames[frame + usize::from(source.remaining > 0)];
        let local = |posture: &Posture| posture.moved(posture.planar(), Planar::default());
        let (local_before, local_now) = (local(before), local(now));
        for joint in 0..JOINT_COUNT {
            let turn = |from: &Posture, to: &Posture| {
                to_angle_axis(to.rotations[joint] * from.rotations[joint].inverse()) * FRAME_RATE
            };
            let offset =
                to_angle_axis(local_now.rotations[joint] * source.posture.rotations[joint].inverse());
            let velocity = turn(&local_before, &local_now) - turn(&source.posture, &next.posture);
            let speed = TRANSITION_SHARE * database.turns.usual[joint] * FRAME_RATE;
            let inertia = &mut character.joints[joint];
            let seconds = inertia::settling_time(offset.length(), speed, TRANSITION_SECONDS);
            inertia.begin(offset, velocity, seconds);
            inertia.limit_velocity();
        }
        let height = |posture: &Posture| posture.root_position.z;
        let away = height(now) - floor - height(&source.posture);
        let velocity = height(now) - height(before) - height(&next.posture) + height(&source.posture);
        let away = match rises_until {
            Some(end) => {
                let stands = height(&database.frames[end].posture);
                character.lift = Some(SeatLift { metres: away, seated: height(&source.posture), stands });
                0.0
            }
            None => away,
        };
        character.height.begin(Vec3::Z * away, Vec3::Z * velocity * FRAME_RATE, TRANSITION_SECONDS);
        let moved = before.planar().relative(here);
        let drift = here.direction_to_world(moved.position - source.step.position);
        let drift = drift.extend(wrap_angle(moved.yaw - source.step.yaw));
        character.glide.add(drift * FRAME_RATE, ROOT_SETTLES_IN);
        (character.posture, character.contact) = (*now, body.contact);
        (character.pose, character.before) = (now.pose(), before.pose());
        character.feet = [0, 1].map(|side| {
            Foot::continuing(&here, source, floor, side, &character.pose, body.contact[side] > 0.0)
        });
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
        self.height.offset.z += self.lift.take().map_or(0.0, |lift| lift.at(old.posture.root_position.z));
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
            let frame = &database.frames[self.frame];
            self.feet[side].step(&self.planar, source.step, frame, side, other_stands);
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
            let offset = offset.map_or(Quat::IDENTITY, |j| self.offset_turns[j]);
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
        let lift = self.alignment.as_ref().map_or(0.0, Alignment::lift)
            + self.lift.map_or(0.0, |lift| lift.at(source.posture.root_position.z));
        let z = source.posture.root_position.z + self.height.offset.z + lift + self.floor;
        posture.root_position = self.planar.position.extend(z);
        let offsets = from_angle_axes(&self.joints.map(|j| j.offset));
        for joint in 0..JOINT_COUNT {
            posture.rotations[joint] = offsets[joint] * source.posture.rotations[joint];
        }
        posture.rotations[0] = self.planar.rotation() * posture.rotations[0];
        self.pose = posture.pose();
        self.offset_turns = arms::turn(posture, &mut self.pose, &self.offset);
        self.offset_distance =
            self.offset_turns.iter().map(|turn| to_angle_axis(*turn).length_squared()).sum();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::angle_between;
    use crate::test_world::{
        PACE, SITS_AT, SITS_BACK, SITS_IN, STANDS, STOPS_AFTER, TURN, close, database, frame_of, sit_cue,
        stop_cue,
    };
    use glam::Vec2;
    use std::f32::consts::FRAC_PI_2;

    const NO_OFFSET: PostureOffset = [Vec3::ZERO; 4];

    fn at(clip: &str, index: usize, start: Planar, floor: f32) -> Character {
        Character::standing(database(), frame_of(clip, index), start, floor)
    }

    fn play(character: &mut Character, frames: usize) {
        (0..frames).for_each(|_| character.advance(database(), &NO_OFFSET));
    }

    #[test]
    fn a_clip_is_played_from_where_one_stands() {
        // Facing +X on a floor of 0.3 m.
        let start = Planar::new(Vec2::new(1.0, 2.0), FRAC_PI_2);
        let mut character = at("walk", 10, start, 0.3);
        let rest = character.posture;
        assert_eq!(character.velocity(), Vec2::ZERO);
        for n in 1..=20 {
            let before = character.pose;
            character.advance(database(), &NO_OFFSET);
            let place = Vec3::new(1.0 + PACE * n as f32, 2.0, STANDS + 0.3);
            assert!(
                character.posture.root_position.distance(place) < 1e-4,
                "{}",
                character.posture.root_position
            );
            assert_eq!(character.before, before);
            assert_eq!(character.frame, frame_of("walk", 10 + n));
            assert!(character.velocity().distance(Vec2::new(0.0, -1.2)) < 1e-3);
            for joint in Joint::ALL {
                // Nothing but the root moves: the whole person glides.
                let moved = character.pose.position(joint) - rest.pose().position(joint);
                assert!(moved.distance(Vec3::X * PACE * n as f32) < 2e-3, "{joint:?}: {moved}");
            }
            assert_eq!(
                (character.contact, character.leg_speed, character.offset_distance),
                ([0.0; 2], 1.0, 0.0)
            );
        }
        // What it looks like is over the floor that it stands on.
        let feature = character.pose_feature();
        close(feature[11], crate::motion::skeleton::ANKLE_HEIGHT, 2e-3);
        // At its end a clip stands still.
        play(&mut character, 200);
        assert_eq!(character.frame, frame_of("walk", 119));
        assert_eq!(character.until_complete(database()), None);
    }

    #[test]
    fn a_curve_turns_with_its_clip() {
        let mut character = at("left", 0, Planar::new(Vec2::ZERO, 1.0), 0.0);
        play(&mut character, 30);
        close(character.planar.yaw, 1.0 + 0.04 * 30.0, 1e-4);
        let yaw: f32 = 1.2;
        let local = 0.75 * Vec2::new(1.0 - yaw.cos(), -yaw.sin());
        let place = Vec2::from_angle(1.0).rotate(local);
        assert!(character.planar.position.distance(place) < 1e-3, "{}", character.planar.position);
    }

    #[test]
    fn a_transition_shows_no_jump_and_is_soon_forgotten() {
        // From half of the way down to a seat to standing: 20 cm and bent legs.
        let mut character = at("sit", 30, Planar::default(), 0.0);
        play(&mut character, 1);
        let from = character.pose;
        character.transition(database(), frame_of("stand", 0));
        let mut expected = Inertia::default();
        let z = |frame: usize| database().frames[frame].posture.root_position.z;
        let (old, new) = (frame_of("sit", 31), frame_of("stand", 0));
        expected.begin(
            Vec3::Z * (z(old) - z(new)),
            Vec3::Z * (z(old + 1) - z(old)) * FRAME_RATE,
            TRANSITION_SECONDS,
        );
        let mut last = from;
        for _ in 0..40 {
            character.advance(database(), &NO_OFFSET);
            expected.step();
            close(character.posture.root_position.z, STANDS + expected.offset.z, 1e-4);
            for joint in Joint::ALL {
                let step = character.pose.position(joint).distance(last.position(joint));
                assert!(step < 0.08, "{joint:?} {step}");
            }
            last = character.pose;
        }
        let own = &database().frames[character.frame].posture;
        for joint in Joint::ALL {
            let off = angle_between(character.posture.rotations[joint.index()], own.rotations[joint.index()]);
            // The legs bend to where the feet stand.
            let allowed = if joint >= Joint::LeftUpLeg { 0.35 } else { 1e-3 };
            assert!(off < allowed, "{joint:?} {off}");
        }
        close(character.posture.root_position.z, STANDS, 1e-4);
    }

    #[test]
    fn the_root_glides_from_pace_to_pace() {
        let mut character = at("walk", 0, Planar::default(), 0.0);
        play(&mut character, 10);
        let begun = character.planar.position;
        character.transition(database(), frame_of("stand", 0));
        let mut steps = Vec::new();
        for _ in 0..30 {
            let before = character.planar.position;
            character.advance(database(), &NO_OFFSET);
            steps.push(character.planar.position.distance(before));
        }
        assert!(steps[0] < PACE && steps[0] > 0.9 * PACE, "{steps:?}");
        assert!(steps.windows(2).all(|w| w[1] <= w[0] + 1e-6));
        assert!(steps[11..].iter().all(|s| *s < 1e-6), "{steps:?}");
        // Half of what it would go at its first pace.
        let gone = character.planar.position - begun;
        close(gone.y, -0.5 * PACE * FRAME_RATE * ROOT_SETTLES_IN, 0.01);
        close(gone.x, 0.0, 1e-5);
        // The same for turning.
        let mut character = at("left", 0, Planar::default(), 0.0);
        play(&mut character, 10);
        let before = character.planar.yaw;
        character.transition(database(), frame_of("stand", 0));
        play(&mut character, 30);
        close(character.planar.yaw - before, 0.5 * 0.04 * FRAME_RATE * ROOT_SETTLES_IN, 0.01);
    }

    #[test]
    fn a_joint_goes_on_as_fast_as_it_turned() {
        // Walking the spine turns to the left, a step of 0.3 of its limit a frame; in the arc to the right, half as fast.
        let (joint, step) = (Joint::Spine1.index(), 0.3 * TURN);
        let mut database = database().clone();
        let (walk, arc) = (frame_of("walk", 0), frame_of("left", 0));
        for i in 0..60 {
            database.frames[walk + i].posture.rotations[joint] = Quat::from_rotation_z(step * i as f32);
            database.frames[arc + i].posture.rotations[joint] = Quat::from_rotation_z(-0.5 * step * i as f32);
        }
        let mut character = Character::standing(&database, walk + 5, Planar::default(), 0.0);
        let turned = |character: &mut Character| {
            let before = character.posture.rotations[joint];
            character.advance(&database, &NO_OFFSET);
            to_angle_axis(character.posture.rotations[joint] * before.inverse()).z
        };
        close(turned(&mut character), step, 1e-4);
        character.transition(&database, arc + 2);
        close(turned(&mut character), step, 0.2 * step);
        // In the end it turns as the arc has it.
        let later: Vec<f32> = (0..45).map(|_| turned(&mut character)).collect();
        close(later[44], -0.5 * step, 1e-4);
    }

    #[test]
    fn arms_turn_to_their_offset_no_faster_than_they_may() {
        let elbow = Joint::LeftForeArm.index();
        let wanted = [Vec3::ZERO, Vec3::Z * -0.8, Vec3::ZERO, Vec3::Z * 0.3];
        let mut character = at("stand", 0, Planar::default(), 0.0);
        let own = character.posture;
        let mut last = own.rotations[elbow];
        let mut turned = Vec::new();
        for _ in 0..25 {
            character.advance(database(), &wanted);
            let now = character.posture.rotations[elbow];
            assert!(angle_between(last, now) <= TURN + 1e-4);
            turned.push(angle_between(own.rotations[elbow], now));
            last = now;
        }
        assert!(turned[0] < 0.05 && turned.windows(2).all(|w| w[1] >= w[0] - 1e-4), "{turned:?}");
        let shown = own.rotations[elbow].inverse() * last;
        assert!(to_angle_axis(shown).distance(wanted[1]) < 1e-3, "{}", to_angle_axis(shown));
        close(character.offset_distance, 0.64 + 0.09, 1e-4);
        // And back.
        play(&mut character, 25);
        assert!(angle_between(own.rotations[elbow], character.posture.rotations[elbow]) < 1e-3);
        assert_eq!(character.offset_distance, 0.0);
    }

    #[test]
    fn what_would_turn_too_fast_is_caught_up_with() {
        let mut database = database().clone();
        database.turns = crate::library::database::TurnLimits::new([0.03; JOINT_COUNT]);
        let elbow = Joint::RightForeArm.index();
        let wanted = [Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::Z * 0.9];
        let mut character = Character::standing(&database, frame_of("stand", 0), Planar::default(), 0.0);
        let own = character.posture.rotations[elbow];
        let (mut last, mut fastest) = (own, 0.0f32);
        for frame in 0..90 {
            character.advance(&database, &wanted);
            let now = character.posture.rotations[elbow];
            fastest = fastest.max(angle_between(last, now));
            let shown = character.posture.pose();
            for joint in UPPER_BODY {
                let off = shown.position(joint).distance(character.pose.position(joint));
                assert!(off < 1e-4, "frame {frame}: {joint:?} is shown {off} m from where it is");
            }
            last = now;
        }
        assert!(fastest <= 0.03 && fastest > 0.029, "{fastest}");
        close(angle_between(own, last), 0.9, 0.02);
    }

    #[test]
    fn a_leg_that_hurries_is_said() {
        let mut database = database().clone();
        database.turns = crate::library::database::TurnLimits::new([0.01; JOINT_COUNT]);
        let mut character = Character::standing(&database, frame_of("sit", 28), Planar::default(), 0.0);
        let knee = Joint::LeftLeg.index();
        let before = character.posture.rotations[knee];
        character.advance(&database, &NO_OFFSET);
        let fastest = feet::CHAIN.iter().flatten().map(|j| j.index()).map(|j| {
            let last = Character::standing(&database, frame_of("sit", 28), Planar::default(), 0.0).posture;
            angle_between(last.rotations[j], character.posture.rotations[j]) / 0.01
        });
        let fastest = fastest.fold(0.0, f32::max);
        assert!(fastest > 1.5 && angle_between(before, character.posture.rotations[knee]) > 0.01);
        close(character.leg_speed, fastest, 0.02);
    }

    #[test]
    fn nobody_turns_faster_than_the_hips_may() {
        let mut database = database().clone();
        database.turns = crate::library::database::TurnLimits::new([0.02; JOINT_COUNT]);
        for (clip, side) in [("left", 1.0), ("right", -1.0)] {
            let mut character = Character::standing(&database, frame_of(clip, 0), Planar::default(), 0.0);
            (0..10).for_each(|_| character.advance(&database, &NO_OFFSET));
            close(character.planar.yaw, side * 10.0 * 0.97 * 0.02, 1e-4);
        }
    }

    #[test]
    fn a_sit_is_led_to_its_cue() {
        for (shift, turn, lift) in [
            (Vec2::ZERO, 0.0, 0.0),
            (Vec2::new(0.1, 0.05), 0.25, 0.05),
            (Vec2::new(-0.08, -0.1), -0.2, -0.06),
        ] {
            let mut cue = sit_cue();
            cue.position += shift.extend(lift + 0.2);
            cue.yaw = turn;
            let mut character = at("sit", 0, Planar::default(), 0.2);
            character.align(&cue);
            assert_eq!(character.until_complete(database()), Some(SITS_IN));
            let mut last = character.planar;
            for ahead in (0..SITS_IN).rev() {
                let contact = character.contact;
                character.advance(database(), &NO_OFFSET);
                for (side, toe) in Joint::TOES.into_iter().enumerate() {
                    // No planted foot is dragged along.
                    let slid = character.pose.position(toe).distance(character.before.position(toe));
                    let planted = contact[side] == 1.0 && character.contact[side] == 1.0;
                    assert!(!planted || slid < 1e-3, "{slid}");
                }
                assert_eq!(character.until_complete(database()), Some(ahead));
                // Half a centimetre is the clip's own, more is led.
                let step = character.planar.position.distance(last.position);
                assert!(step < 0.012 + 0.022, "{step}");
                assert!(wrap_angle(character.planar.yaw - last.yaw).abs() < 0.05);
                last = character.planar;
            }
            let root = character.posture.root_position;
            assert!(root.distance(cue.position) < 2e-3, "{root} for {}", cue.position);
            close(character.planar.yaw, turn, 2e-3);
            // Once complete nothing is led any more.
            play(&mut character, 10);
            assert!(character.posture.root_position.distance(root) < 1e-4);
        }
        let here = at("sit", 0, Planar::default(), 0.0).posture.root_position;
        assert!(here.distance(Vec3::new(0.0, 0.0, STANDS)) < 1e-4 && SITS_BACK > 0.0 && SITS_AT < STANDS);
    }

    #[test]
    fn a_stop_is_led_on_the_floor_alone() {
        let cue = stop_cue(Vec2::new(0.1, -STOPS_AFTER - 0.06), 0.1);
        let mut character = at("stop", 0, Planar::default(), 0.0);
        character.align(&cue);
        play(&mut character, 45);
        let root = character.posture.root_position;
        assert!(root.distance(Vec3::new(0.1, -STOPS_AFTER - 0.06, STANDS)) < 3e-3, "{root}");
        close(character.planar.yaw, 0.1, 1e-3);
        // A new transition forgets the cue.
        character.transition(database(), frame_of("walk", 0));
        assert_eq!(character.until_complete(database()), None);
    }

    #[test]
    fn a_rotation_stays_one() {
        let q = Quat::from_xyzw(0.1, 0.2, 0.3, 0.9);
        close(normalize(q).length(), 1.0, 1e-6);
        let unit = q.normalize();
        assert_eq!(normalize(unit), unit);
    }
}
