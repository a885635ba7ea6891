//! Feet: whole soles that stand, roll and step, and legs that reach for them.
//!
//! A foot follows its clip directly, not through the inertialised chain above it. While its heel or its ball carries it, it
//! follows the clip over ground of its own, which stays where it was when the foot landed: the foot rolls from heel to ball to
//! toe as the clip's does, whatever the root does over it (transitions, alignment, the root's glide), and the point that
//! carries it does not move. In the swing the foot comes back to the root's ground before it strikes. Where no swing comes in
//! time, it takes a small step of its own, or, where the other foot does not stand, turns on its ball with the heel up.

use std::f32::consts::PI;

use glam::{Quat, Vec2, Vec3};

use super::FRAME_TIME;
use super::inertia::{Inertia, settling_time};
use crate::library::database::DatabaseFrame;
use crate::library::foot::HEEL_ARM;
use crate::math::Planar;
use crate::math::curve::smoothstep;
use crate::math::rotation::{from_angle_axis, to_angle_axis, wrap_angle, yaw};
use crate::motion::skeleton::{JOINT_OFFSET, LEG_LENGTH, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, Joint, Pose, Posture};

/// A foot takes a step of its own when the clip's is this far from it, metres, or turned by this much, radians.
const STEP_FROM: (f32, f32) = (0.16, 0.45);
/// … or when it stands this much farther inward than the clip's, metres, where feet would be in each other's way …
const STEP_INWARD: f32 = 0.07;
/// … or is turned farther in or out than hip and ankle easily allow, radians, the clip's alone not being so.
const EASY_TURN: (f32, f32) = (0.5, 0.8);
/// What of that is the ground's doing, radians.
const STRAIN: f32 = 0.2;
/// Where the clip's swing is shorter than such a step, that swing is one when so much is left: the foot would be whisked along
/// the floor. Metres, radians.
const BRISK_STEP: (f32, f32) = (0.06, 0.2);
/// How long a step of its own takes, seconds, how high the foot rises, metres, and how far the heel leads, radians, over the
/// first part of it.
const STEP_TIME: f32 = 0.3;
const STEP_HEIGHT: f32 = 0.05;
const STEP_RISE: f32 = 0.3;
const STEP_LEADS: f32 = 0.7;
/// Where it cannot step it turns on its ball when the clip's is turned by this much, radians …
const PIVOT_TURN: f32 = 0.5;
/// … in so many seconds, with the heel raised by this angle, radians, which takes this share of the time.
const PIVOT_TIME: f32 = 0.4;
const PIVOT_RISE: f32 = 0.2;
const PIVOT_EASE: f32 = 0.3;
/// A foot heads where it headed while its heel and ball are no farther than this from level, metres.
const FLAT: f32 = 0.012;
/// A foot whose heel is higher than its ball by more than this, metres, turns on the ball when it is turned in or out farther
/// than this, radians, the faster the farther, per second.
const HEEL_OFF: f32 = 0.02;
const LOOSE_TURN: (f32, f32) = (0.5, 0.6);
const LOOSENS: f32 = 8.0;
/// So much height a swing has for each metre and each radian that the foot is to be moved and turned apart from its clip's, and
/// no more than so much: nothing is whisked along the floor. It rises to it so fast, m/s.
const SWING_LIFT: (f32, f32) = (0.2, 0.05);
const MOST_LIFT: f32 = 0.03;
const LIFT_SPEED: f32 = 0.3;
/// What is left in the air goes no faster, m/s and radians a second.
const LEFT_SPEED: (f32, f32) = (2.0, 5.0);
/// What a stand has left is gone so many seconds before the foot strikes again, within these bounds.
const BEFORE_STRIKE: f32 = 0.05;
const SWING_SECONDS: (f32, f32) = (0.1, 0.3);
/// How long what is left of height and slope lasts once a foot stands, seconds.
const LANDED_SECONDS: f32 = 0.2;
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

/// Which way along x the outside of each foot lies.
const OUTWARD: [f32; 2] = [1.0, -1.0];

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Foot {
    /// Shown toe minus the clip's: on the floor plane, world, and of the sole's lowest point in height.
    toe: Inertia,
    /// Shown foot rotation over the clip's; while it stands, without the part about the vertical.
    turn: Inertia,
    /// What it stands on.
    ground: Option<Ground>,
    /// How far the leg, too short, has pulled it from there in the last frame.
    dragged: Option<Vec2>,
    /// Seconds into a step of its own.
    stepping: Option<f32>,
    /// Seconds into a turn on the ball.
    pivoting: Option<f32>,
    /// How high its swing goes at the least, metres.
    lift: f32,
    /// How much higher than the ball its heel was in the last frame, metres.
    heel: f32,
}

/// Where a foot stands.
#[derive(Debug, Clone, Copy)]
struct Ground {
    /// Where the root would be, had nothing but the clip moved it since the foot landed.
    root: Planar,
    /// Whether the heel carries it; else the ball does.
    on_heel: bool,
    /// Where that point is, world.
    place: Vec2,
    /// Where it heads while it is flat.
    heading: Option<f32>,
    /// The clip's toe and heading on this ground from those on the root's, in the last frame.
    away: Vec2,
    turned: f32,
}

impl Ground {
    /// Moves it so that the clip's toe comes to lie at `toe`, facing as it faces.
    fn put(&mut self, frame: &DatabaseFrame, side: usize, toe: Vec2) {
        self.root.position += toe - clip_toe(&self.root, frame, side).truncate();
    }

    /// The clip's toe and heading on this ground from those on the root's.
    fn beside(&self, planar: &Planar, frame: &DatabaseFrame, side: usize) -> (Vec2, f32) {
        let away = clip_toe(&self.root, frame, side) - clip_toe(planar, frame, side);
        (away.truncate(), wrap_angle(self.root.yaw - planar.yaw))
    }
}

/// Where the clip's toe would be.
fn clip_toe(planar: &Planar, frame: &DatabaseFrame, side: usize) -> Vec3 {
    let toe = frame.toe[side];
    planar.point_to_world(toe.truncate()).extend(toe.z)
}

/// The height of the clip's heel or ball, whichever is lower.
fn clip_low(frame: &DatabaseFrame, side: usize) -> f32 {
    frame.toe[side].z + (frame.foot_rotation[side] * HEEL_ARM).z.min(-TOE_HEIGHT)
}

/// A foot to be shown: its toe joint over the floor, and how it is turned.
#[derive(Debug, Clone, Copy)]
struct Shown {
    toe: Vec3,
    rotation: Quat,
}

impl Shown {
    /// Heel or toe joint on the floor plane.
    fn point(&self, heel: bool) -> Vec2 {
        (if heel { self.toe + self.rotation * HEEL_ARM } else { self.toe }).truncate()
    }

    /// How much higher than the ball the heel is, metres.
    fn slope(&self) -> f32 {
        (self.rotation * HEEL_ARM).z + TOE_HEIGHT
    }

    /// The height of heel or ball, whichever is lower.
    fn low(&self) -> f32 {
        self.toe.z - TOE_HEIGHT + self.slope().min(0.0)
    }

    fn heading(&self) -> f32 {
        let ahead = self.rotation * -HEEL_ARM;
        ahead.y.atan2(ahead.x)
    }
}

impl Foot {
    /// Of a character that appears in `frame`: a foot that stands is held from the first.
    pub(super) fn standing(planar: &Planar, frame: &DatabaseFrame, side: usize) -> Self {
        let mut foot = Self::default();
        if frame.stands[side] {
            foot.land(planar, frame, side);
        }
        foot
    }

    /// Of a character that goes on from `pose` in `frame`: it is where and as it was, and stands if it did.
    pub(super) fn continuing(
        planar: &Planar,
        frame: &DatabaseFrame,
        floor: f32,
        side: usize,
        pose: &Pose,
        stands: bool,
    ) -> Self {
        let mut foot = Self::default();
        let [.., ankle, toe] = CHAIN[side];
        let rotation = pose.rotation(ankle);
        let away = pose.position(toe) - clip_toe(planar, frame, side);
        let low = pose.position(toe).z - floor + (rotation * HEEL_ARM).z.min(-TOE_HEIGHT);
        let turn = to_angle_axis(rotation * (planar.rotation() * frame.foot_rotation[side]).inverse());
        let seconds = swing_seconds(frame, side, away.truncate().length(), turn.length());
        let away = away.with_z(low - clip_low(frame, side));
        foot.toe.begin(away, Vec3::ZERO, seconds);
        foot.turn.begin(turn, Vec3::ZERO, seconds);
        if stands {
            foot.land(planar, frame, side);
        }
        foot
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
        let shown = self.shown(planar, old, side);
        let base = self.base(planar);
        let left = to_angle_axis(shown.rotation * (base.rotation() * new.foot_rotation[side]).inverse());
        let rise =
            |a: &DatabaseFrame, b: &DatabaseFrame| (clip_low(b, side) - clip_low(a, side)) * FRAME_RATE;
        self.toe.offset.z += clip_low(old, side) - clip_low(new, side);
        self.toe.velocity.z += rise(old, old_next) - rise(new, new_next);
        if let Some(mut ground) = self.ground {
            // It stays as it is, whatever comes: its ground is the new clip's from now on.
            let turn = from_angle_axis(left);
            let about = yaw(turn);
            ground.root.yaw = wrap_angle(ground.root.yaw + about);
            self.turn.begin(to_angle_axis(turn * Quat::from_rotation_z(-about)), Vec3::ZERO, LANDED_SECONDS);
            self.toe.settle_in(LANDED_SECONDS);
            self.toe.limit_velocity();
            self.ground = Some(ground);
            let now = self.shown(planar, new, side).point(ground.on_heel);
            ground.root.position += shown.point(ground.on_heel) - now;
            (ground.away, ground.turned) = ground.beside(planar, new, side);
            self.ground = Some(ground);
            return;
        }
        let velocity = |a: &DatabaseFrame, b: &DatabaseFrame| {
            let next = planar.compose(a.step);
            (clip_toe(&next, b, side) - clip_toe(planar, a, side)).truncate().extend(0.0) * FRAME_RATE
        };
        let away = (clip_toe(planar, old, side) - clip_toe(planar, new, side)).truncate();
        self.toe.offset += away.extend(0.0);
        self.toe.velocity += velocity(old, old_next) - velocity(new, new_next);
        self.toe.limit_velocity();
        let seconds = swing_seconds(new, side, self.toe.offset.truncate().length(), left.length());
        self.toe.settle_in(seconds);
        self.turn.begin(left, Vec3::ZERO, seconds);
    }

    /// Whether it is held in place.
    pub(super) fn stands(&self) -> bool {
        self.ground.is_some() && self.dragged.is_none()
    }

    /// One frame on, along `step` of the clip; `frame` is the frame now shown.
    pub(super) fn step(
        &mut self,
        planar: &Planar,
        step: Planar,
        frame: &DatabaseFrame,
        side: usize,
        other_stands: bool,
    ) {
        let dragged = self.dragged.take();
        let on = |t: f32| t + FRAME_TIME;
        self.stepping = self.stepping.map(on).filter(|t| *t < STEP_TIME - 0.5 * FRAME_TIME);
        self.pivoting = self.pivoting.map(on).filter(|t| *t < PIVOT_TIME);
        self.toe.step();
        self.turn.step();
        let mut carries = frame.stands[side] && self.stepping.is_none();
        let Some(mut ground) = self.ground.take() else {
            if self.stepping.is_none() {
                let (far, turned) = (self.toe.offset.truncate().length(), self.turn.offset.z.abs());
                let lift = (SWING_LIFT.0 * far + SWING_LIFT.1 * turned).min(MOST_LIFT);
                self.lift = lift.min(self.lift + LIFT_SPEED * FRAME_TIME);
            }
            if carries {
                self.land(planar, frame, side);
            }
            return;
        };
        if let Some(dragged) = dragged {
            ground.root.position += dragged;
            ground.place += dragged;
            ground.away += dragged;
        }
        ground.root = ground.root.compose(step);
        let (away, turned) = ground.beside(planar, frame, side);
        let beyond = |most: (f32, f32)| away.length() > most.0 || turned.abs() > most.1;
        let strained = is_strained(planar, &ground.root, frame, side);
        let steps = if carries {
            (beyond(STEP_FROM) || strained || dragged.is_some()) && self.pivoting.is_none()
        } else {
            f32::from(frame.until_stands[side]) * FRAME_TIME < STEP_TIME && beyond(BRISK_STEP)
        };
        if steps && other_stands {
            self.stepping = Some(FRAME_TIME);
        } else if steps {
            // Until the other foot is down.
            carries = true;
        }
        if !carries || self.stepping.is_some() {
            // The shown foot stood still: what is left begins by undoing the root's own way.
            let seconds = if self.stepping.is_some() {
                STEP_TIME - FRAME_TIME
            } else {
                swing_seconds(frame, side, away.length(), turned.abs())
            };
            let velocity = (away - ground.away) * FRAME_RATE;
            self.toe.begin(away.extend(self.toe.offset.z), velocity.extend(self.toe.velocity.z), seconds);
            self.toe.limit_velocity();
            self.turn_off(turned, ground.turned, seconds);
            self.pivoting = None;
            return;
        }
        let twisted = turned.abs() > PIVOT_TURN || (strained && turned.abs() > STRAIN);
        if self.pivoting.is_none() && twisted && frame.contact[side] >= 1.0 {
            self.pivoting = Some(0.0);
            self.turn_off(turned, ground.turned, PIVOT_TIME);
        }
        if self.pivoting.is_some() {
            ground.root.yaw = planar.yaw;
        }
        if self.heel > HEEL_OFF {
            ground.root.yaw -= self.loose_turn(planar, &ground.root, frame, side);
        }
        self.ground = Some(ground);
        let mut shown = self.shown(planar, frame, side);
        let flat = shown.slope().abs() < FLAT && self.pivoting.is_none();
        if let Some(heading) = ground.heading.filter(|_| flat) {
            ground.root.yaw += wrap_angle(heading - shown.heading());
            self.ground = Some(ground);
            shown = self.shown(planar, frame, side);
        }
        ground.heading = flat.then(|| shown.heading());
        let on_heel = frame.contact[side] < 1.0 && shown.slope() < 0.0;
        let point = shown.point(ground.on_heel);
        ground.root.position += ground.place - point;
        if on_heel != ground.on_heel {
            ground.on_heel = on_heel;
            ground.place += shown.point(on_heel) - point;
        }
        (ground.away, ground.turned) = ground.beside(planar, frame, side);
        self.ground = Some(ground);
    }

    /// It stands from now on, where and as it is shown.
    fn land(&mut self, planar: &Planar, frame: &DatabaseFrame, side: usize) {
        let shown = self.shown(planar, frame, side);
        let turn = from_angle_axis(self.turn.offset);
        let about = yaw(turn);
        let rest = to_angle_axis(turn * Quat::from_rotation_z(-about));
        self.turn.begin(rest, self.turn.velocity.with_z(0.0), LANDED_SECONDS);
        let height = shown.low() - clip_low(frame, side);
        self.toe.begin(Vec3::Z * height, Vec3::Z * self.toe.velocity.z, LANDED_SECONDS);
        self.lift = 0.0;
        let on_heel = frame.contact[side] < 1.0 && shown.slope() < 0.0;
        let mut ground = Ground {
            root: Planar::new(planar.position, wrap_angle(planar.yaw + about)),
            on_heel,
            place: shown.point(on_heel),
            heading: None,
            away: Vec2::ZERO,
            turned: 0.0,
        };
        ground.put(frame, side, shown.toe.truncate());
        (ground.away, ground.turned) = ground.beside(planar, frame, side);
        self.ground = Some(ground);
    }

    /// How far a foot on `ground` turns in this frame that has nothing but its ball on the floor, radians.
    fn loose_turn(&self, planar: &Planar, ground: &Planar, frame: &DatabaseFrame, side: usize) -> f32 {
        let (most_in, most_out) = LOOSE_TURN;
        let out = turned_out(planar, ground, frame, side);
        let beyond = (out - most_out).max(0.0) + (out + most_in).min(0.0);
        OUTWARD[side] * beyond * LOOSENS * FRAME_TIME
    }

    /// The turn of its ground becomes one that goes in `seconds`; in the last frame it was `before`.
    fn turn_off(&mut self, turned: f32, before: f32, seconds: f32) {
        let left = from_angle_axis(self.turn.offset) * Quat::from_rotation_z(turned);
        let velocity = self.turn.velocity + Vec3::Z * wrap_angle(turned - before) * FRAME_RATE;
        self.turn.begin(to_angle_axis(left), velocity, seconds);
        self.turn.limit_velocity();
    }

    /// What the clip is laid on.
    fn base(&self, planar: &Planar) -> Planar {
        self.ground.map_or(*planar, |ground| ground.root)
    }

    /// How far a turn on the ball or a step of its own raises the heel, radians.
    fn rise(&self) -> f32 {
        let pivot = |t: f32| {
            let part = t / PIVOT_TIME;
            PIVOT_RISE * smoothstep(part / PIVOT_EASE) * smoothstep((1.0 - part) / PIVOT_EASE)
        };
        let step = |t: f32| STEP_RISE * (PI * (t / (STEP_LEADS * STEP_TIME)).min(1.0)).sin().powi(2);
        self.pivoting.map_or(0.0, pivot) + self.stepping.map_or(0.0, step)
    }

    /// The foot as it is to be shown, over the floor, if the leg reaches so far.
    fn shown(&self, planar: &Planar, frame: &DatabaseFrame, side: usize) -> Shown {
        let base = self.base(planar);
        let rotation = from_angle_axis(self.turn.offset)
            * base.rotation()
            * frame.foot_rotation[side]
            * Quat::from_rotation_x(self.rise());
        let at = clip_toe(&base, frame, side).truncate() + self.toe.offset.truncate();
        // Never under the floor, or no deeper than the clip.
        let own = clip_low(frame, side);
        let low = (own + self.toe.offset.z).max(own.min(0.0)).max(self.lift);
        let lifted = self.stepping.map_or(0.0, |t| STEP_HEIGHT * (PI * t / STEP_TIME).sin());
        let height = low + lifted - (rotation * HEEL_ARM).z.min(-TOE_HEIGHT);
        Shown { toe: at.extend(height), rotation }
    }

    /// The contact that is shown: a foot that steps or is dragged is not planted.
    pub(super) fn contact(&self, clip: f32) -> f32 {
        match (self.stepping, self.stands()) {
            (Some(_), _) => 0.0,
            (None, false) if clip >= 1.0 => 0.5,
            _ => clip,
        }
    }

    /// Bends the leg so that the foot stands where it should.
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
        let Shown { toe: target, mut rotation } = self.shown(planar, frame, side);
        let target = target + Vec3::Z * floor;
        let hip = pose.positions[thigh];
        let ankle_of = |rotation: Quat| target - rotation * JOINT_OFFSET[toe];
        let mut ankle = ankle_of(rotation);
        let mut heel = self.rise();
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
            heel += high;
            rotation = raised(high);
            ankle = ankle_of(rotation);
            if ankle.distance(hip) > LONGEST_LEG + 1e-3 {
                ankle = hip + (ankle - hip).clamp_length_max(LONGEST_LEG);
                if self.ground.is_some() {
                    let came = ankle + rotation * JOINT_OFFSET[toe];
                    self.dragged = Some((came - target).truncate());
                }
            }
        }
        bend_leg(side, ankle, rotation, posture, pose);
        self.heel = Shown { toe: target, rotation }.slope();
        if heel > 0.0 {
            posture.rotations[toe] = Quat::from_rotation_x(-heel) * posture.rotations[toe];
            pose.place(posture, toe);
        }
    }
}

/// Whether a foot on `ground` stands in the other's way, or is twisted under the leg, as the clip's is not.
fn is_strained(planar: &Planar, ground: &Planar, frame: &DatabaseFrame, side: usize) -> bool {
    // The middle of the foot, person-centric.
    let place = |on: &Planar| {
        let middle = clip_toe(on, frame, side) + 0.5 * (on.rotation() * frame.foot_rotation[side] * HEEL_ARM);
        OUTWARD[side] * planar.point_to_local(middle.truncate()).x
    };
    let (out, clip_out) = (turned_out(planar, ground, frame, side), turned_out(planar, planar, frame, side));
    let (most_in, most_out) = EASY_TURN;
    place(ground) < place(planar) - STEP_INWARD
        || (out > most_out && out > clip_out + STRAIN)
        || (out < -most_in && out < clip_out - STRAIN)
}

/// How far the clip's foot on `ground` is turned out, person-centric, radians.
fn turned_out(planar: &Planar, ground: &Planar, frame: &DatabaseFrame, side: usize) -> f32 {
    let rotation = ground.rotation() * frame.foot_rotation[side];
    let ahead = planar.direction_to_local((rotation * -HEEL_ARM).truncate());
    OUTWARD[side] * ahead.x.atan2(-ahead.y)
}

/// Seconds in which metres and radians that a stand or a transition has left are gone: before the clip's foot strikes again, if
/// that is no haste.
fn swing_seconds(frame: &DatabaseFrame, side: usize, away: f32, turned: f32) -> f32 {
    let (least, most) = SWING_SECONDS;
    let swing = f32::from(frame.until_stands[side]) * FRAME_TIME - BEFORE_STRIKE;
    let unhurried = |left: f32, speed: f32| settling_time(left, speed, least);
    swing.min(most).max(unhurried(away, LEFT_SPEED.0)).max(unhurried(turned, LEFT_SPEED.1))
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

    /// A frame of standing, its left foot pitched with the toes up, or with the heel up where that is negative, about what
    /// is then lowest; and whether the clip says that the toe is planted.
    fn pitched(toes_up: f32, contact: f32) -> DatabaseFrame {
        let mut frame = stand().clone();
        let turned = frame.foot_rotation[0] * Quat::from_rotation_x(-toes_up);
        let heel = frame.toe[0] + frame.foot_rotation[0] * HEEL_ARM;
        if toes_up > 0.0 {
            frame.toe[0] = heel - turned * HEEL_ARM;
        }
        frame.foot_rotation[0] = turned;
        frame.contact[0] = contact;
        frame
    }

    /// Heel and toe joint as they are shown.
    fn points(foot: &Foot, planar: &Planar, frame: &DatabaseFrame) -> [Vec3; 2] {
        let shown = foot.shown(planar, frame, 0);
        [shown.toe + shown.rotation * HEEL_ARM, shown.toe]
    }

    fn stay(foot: &mut Foot, planar: &Planar, frame: &DatabaseFrame) {
        foot.step(planar, Planar::default(), frame, 0, true);
    }

    #[test]
    fn a_knee_bends_in_the_plane_it_bent_in() {
        // A knee that is bent straight ahead, and an ankle that goes 30 cm to the left.
        let mut posture = Posture { root_position: Vec3::Z * 0.9, ..Posture::default() };
        posture.rotations[Joint::LeftUpLeg.index()] = Quat::from_rotation_x(0.4);
        posture.rotations[Joint::LeftLeg.index()] = Quat::from_rotation_x(-0.8);
        let mut pose = posture.pose();
        let hip = pose.position(Joint::LeftUpLeg);
        let ankle = pose.position(Joint::LeftFoot) + Vec3::X * 0.3;
        let bent = pose.position(Joint::LeftLeg).y - hip.y;
        assert!(bent.abs() > 0.1, "{bent}");
        bend_leg(0, ankle, Quat::IDENTITY, &mut posture, &mut pose);
        assert!(pose.position(Joint::LeftFoot).distance(ankle) < 1e-3);
        let (knee, way) = (pose.position(Joint::LeftLeg) - hip, (ankle - hip).normalize());
        let aside = knee - way * knee.dot(way);
        assert!(aside.x.abs() < 3e-3 && aside.z.abs() < 3e-3 && aside.y * bent > 0.005, "{aside}");
    }

    #[test]
    fn a_sole_is_held_whole_while_the_root_moves_and_turns_over_it() {
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        assert!(foot.stands());
        assert_eq!(foot.contact(1.0), 1.0);
        let stood = points(&foot, &at(0.0), stand());
        for n in 1..=15 {
            let n = n as f32;
            let root = Planar::new(Vec2::new(-0.008 * n, 0.0), 0.02 * n);
            stay(&mut foot, &root, stand());
            for (now, then) in points(&foot, &root, stand()).iter().zip(&stood) {
                assert!(now.distance(*then) < 1e-4 && foot.stands(), "{now} {then}");
            }
        }
    }

    #[test]
    fn what_is_too_far_or_too_far_turned_steps() {
        for root in [at(-0.17), at(0.08), Planar::new(Vec2::ZERO, 0.46)] {
            let mut foot = Foot::standing(&at(0.0), stand(), 0);
            stay(&mut foot, &at(-0.15), stand());
            stay(&mut foot, &at(0.06), stand());
            assert!(foot.stands());
            // It steps, in nine frames, and stands where the clip has it, turned as the clip is.
            stay(&mut foot, &root, stand());
            assert!(!foot.stands());
            assert_eq!(foot.contact(1.0), 0.0);
            let mut highest = 0.0f32;
            let mut steps = 1;
            while foot.stepping.is_some() {
                highest = highest.max(foot.shown(&root, stand(), 0).toe.z);
                stay(&mut foot, &root, stand());
                steps += 1;
                assert!(steps < 20);
            }
            assert_eq!(steps, (STEP_TIME * FRAME_RATE) as usize);
            close(highest, TOE_HEIGHT + STEP_HEIGHT, 1e-3);
            let clip = clip_toe(&root, stand(), 0);
            let shown = foot.shown(&root, stand(), 0);
            assert!(foot.stands() && shown.toe.distance(clip) < 1e-3, "{} {clip}", shown.toe);
            assert!(shown.rotation.angle_between(root.rotation() * stand().foot_rotation[0]) < 2e-3);
            assert_eq!(foot.contact(1.0), 1.0);
        }
    }

    #[test]
    fn a_foot_in_the_others_way_or_twisted_is_strained() {
        let turned = |yaw: f32| {
            let mut frame = stand().clone();
            frame.foot_rotation = frame.foot_rotation.map(|foot| Quat::from_rotation_z(yaw) * foot);
            frame
        };
        let root = Planar::default();
        for (side, out) in [(0, 1.0), (1, -1.0)] {
            let strained = |x: f32, yaw: f32, clip: f32| {
                // About the foot, which stays where it is.
                let frame = turned(out * clip);
                let mut ground = Planar::new(Vec2::ZERO, out * yaw);
                let middle = |on: &Planar| {
                    let arm = on.rotation() * frame.foot_rotation[side] * HEEL_ARM;
                    (clip_toe(on, &frame, side) + 0.5 * arm).truncate()
                };
                ground.position = middle(&root) - middle(&ground) + Vec2::X * out * x;
                is_strained(&root, &ground, &frame, side)
            };
            assert!(!strained(0.2, 0.0, 0.0) && !strained(-0.06, 0.0, 0.0) && strained(-0.08, 0.0, 0.0));
            // Turned out by 0.85, in by 0.55; less; as much, but by the clip; and by the clip for the most part.
            assert!(strained(0.0, 0.85, 0.0) && strained(0.0, -0.55, 0.0));
            assert!(!strained(0.0, 0.75, 0.0) && !strained(0.0, -0.45, 0.0));
            assert!(!strained(0.0, 0.0, 0.85) && !strained(0.0, 0.0, -0.55));
            assert!(!strained(0.0, 0.1, 0.75) && strained(0.0, 0.3, 0.6));
        }
    }

    #[test]
    fn a_foot_on_its_ball_turns_back_under_the_leg() {
        // The clip has its heel up, and turned out by 0.9 (the left) or in by 0.8.
        for (yaw, easy) in [(0.9, LOOSE_TURN.1), (-0.8, -LOOSE_TURN.0)] {
            let mut frame = pitched(-0.4, 1.0);
            frame.foot_rotation[0] = Quat::from_rotation_z(yaw) * frame.foot_rotation[0];
            let mut foot = Foot::standing(&at(0.0), &frame, 0);
            let [_, ball] = points(&foot, &at(0.0), &frame);
            let out = |foot: &Foot| {
                let ahead = foot.shown(&at(0.0), &frame, 0).rotation * -HEEL_ARM;
                ahead.x.atan2(-ahead.y)
            };
            let mut last = out(&foot);
            for _ in 0..30 {
                foot.heel = 0.1;
                foot.step(&at(0.0), Planar::default(), &frame, 0, false);
                let now = out(&foot);
                // The faster the farther: nothing begins with a jerk.
                close(last - now, (last - easy) * LOOSENS * FRAME_TIME, 1e-4);
                assert!(points(&foot, &at(0.0), &frame)[1].distance(ball) < 1e-4 && foot.stands());
                last = now;
            }
            close(last, easy, 1e-3);
            // On a flat sole it stays as it is.
            let mut foot = Foot::standing(&at(0.0), &frame, 0);
            foot.heel = 0.01;
            foot.step(&at(0.0), Planar::default(), &frame, 0, false);
            close(out(&foot), yaw, 1e-4);
        }
    }

    #[test]
    fn a_flat_foot_heads_where_it_headed_though_its_clip_turns() {
        let mut turning = stand().clone();
        turning.foot_rotation[0] = Quat::from_rotation_z(0.2) * turning.foot_rotation[0];
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        stay(&mut foot, &at(0.0), stand());
        let stood = points(&foot, &at(0.0), stand());
        stay(&mut foot, &at(0.0), &turning);
        for (now, then) in points(&foot, &at(0.0), &turning).iter().zip(&stood) {
            assert!(now.distance(*then) < 1e-4, "{now} {then}");
        }
        // With the heel up it turns as it likes, on its ball.
        let mut risen = pitched(-0.2, 1.0);
        stay(&mut foot, &at(0.0), &risen);
        let before = foot.shown(&at(0.0), &risen, 0).heading();
        risen.foot_rotation[0] = Quat::from_rotation_z(0.2) * risen.foot_rotation[0];
        stay(&mut foot, &at(0.0), &risen);
        close(foot.shown(&at(0.0), &risen, 0).heading() - before, 0.2, 1e-3);
        assert!(points(&foot, &at(0.0), &risen)[1].truncate().distance(stood[1].truncate()) < 1e-4);
    }

    #[test]
    fn a_swing_that_has_far_to_go_goes_higher() {
        let mut low = stand().clone();
        (low.stands[0], low.contact[0], low.until_stands[0]) = (false, 0.0, 12);
        let mut highest = [0.0f32; 2];
        for (highest, far) in highest.iter_mut().zip([0.02, 0.14]) {
            let root = at(-far);
            let mut foot = Foot::standing(&at(0.0), stand(), 0);
            stay(&mut foot, &root, stand());
            for _ in 0..12 {
                stay(&mut foot, &root, &low);
                *highest = highest.max(foot.shown(&root, &low, 0).low());
            }
            // Nothing is left to be lifted for.
            close(foot.shown(&root, &low, 0).low(), 0.0, 1e-4);
        }
        assert!(highest[0] < 0.005 && highest[1] > 0.015 && highest[1] <= MOST_LIFT, "{highest:?}");
    }

    #[test]
    fn what_cannot_step_yet_waits_for_the_other_foot() {
        let mut swing = stand().clone();
        (swing.stands[0], swing.contact[0], swing.until_stands[0]) = (false, 0.5, 4);
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        stay(&mut foot, &at(-0.1), stand());
        let stood = points(&foot, &at(-0.1), stand());
        foot.step(&at(-0.1), Planar::default(), &swing, 0, false);
        assert!(foot.stands() && points(&foot, &at(-0.1), &swing)[1].distance(stood[1]) < 1e-4);
        foot.step(&at(-0.1), Planar::default(), &swing, 0, true);
        assert!(foot.stepping.is_some());
    }

    #[test]
    fn no_foot_steps_while_the_other_is_in_the_air() {
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        let stood = points(&foot, &at(0.0), stand());
        foot.step(&at(0.3), Planar::default(), stand(), 0, false);
        assert!(foot.stands() && points(&foot, &at(0.3), stand())[1].distance(stood[1]) < 1e-5);
        foot.step(&at(0.3), Planar::default(), stand(), 0, true);
        assert!(!foot.stands());
    }

    #[test]
    fn where_it_cannot_step_it_turns_on_its_ball_with_the_heel_up() {
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        let stood = points(&foot, &at(0.0), stand());
        let heading = |foot: &Foot, root: &Planar| yaw(foot.shown(root, stand(), 0).rotation);
        let mut turned_flat = 0.0f32;
        let mut last = 0.0;
        let mut risen = 0.0f32;
        for n in 1..=40 {
            let root = Planar::new(Vec2::ZERO, (0.03 * n as f32).min(0.6));
            foot.step(&root, Planar::default(), stand(), 0, false);
            let [heel, toe] = points(&foot, &root, stand());
            assert!(toe.truncate().distance(stood[1].truncate()) < 1e-4 && foot.stands());
            assert!(heel.z > -1e-4 && (toe.z - TOE_HEIGHT).abs() < 1e-4);
            let now = heading(&foot, &root);
            risen = risen.max(heel.z);
            if heel.z < 0.01 {
                turned_flat += (now - last).abs();
            }
            last = now;
        }
        assert!(risen > 0.03, "{risen}");
        close(last, 0.6, 0.02);
        assert!(turned_flat < 0.06, "{turned_flat}");
    }

    #[test]
    fn a_foot_rolls_from_heel_to_ball_over_what_carries_it() {
        // It lands on the heel, becomes flat and leaves over the ball, while the root goes on and turns as it likes.
        let frames: Vec<_> =
            (0..=20).map(|n| pitched(0.3 - 0.05 * n as f32, if n >= 5 { 1.0 } else { 0.5 })).collect();
        let mut foot = Foot::standing(&at(0.0), &frames[0], 0);
        let mut last = points(&foot, &at(0.0), &frames[0]);
        for (n, frame) in frames.iter().enumerate().skip(1) {
            let root = Planar::new(Vec2::new(0.002 * n as f32, 0.003 * n as f32), 0.01 * n as f32);
            stay(&mut foot, &root, frame);
            let now = points(&foot, &root, frame);
            let carries = usize::from(n >= 5);
            let slid = now[carries].truncate().distance(last[carries].truncate());
            assert!(n == 5 || slid < 1e-5, "frame {n}: {slid}");
            // The one rolls about the other, by less than a centimetre a frame.
            assert!(now[1 - carries].distance(last[1 - carries]) < 0.011);
            // Toes up, and heel up, as the clip has it, and nothing under the floor.
            close(now[1].z, clip_toe(&at(0.0), frame, 0).z, 1e-4);
            assert!(now[0].z > -1e-4);
            let own = frame.foot_rotation[0];
            assert!(foot.shown(&root, frame, 0).rotation.angle_between(own) < 2e-3);
            last = now;
        }
    }

    #[test]
    fn a_swinging_foot_lets_go_and_comes_to_its_clip_before_it_strikes() {
        for (until, frames) in [(u16::MAX, 9), (8, 7), (2, 3)] {
            let mut swing = walk(3).clone();
            swing.until_stands[0] = until;
            let mut foot = Foot::standing(&at(0.0), stand(), 0);
            // Less than a brisk swing would make a step of.
            let root = Planar::new(Vec2::new(0.02, 0.0), 0.15);
            stay(&mut foot, &root, stand());
            let left = |foot: &Foot| {
                let shown = foot.shown(&root, &swing, 0);
                let away = shown.toe.distance(clip_toe(&root, &swing, 0));
                (away, shown.rotation.angle_between(root.rotation() * swing.foot_rotation[0]))
            };
            let mut lefts = Vec::new();
            for _ in 0..=frames {
                stay(&mut foot, &root, &swing);
                assert!(!foot.stands() && foot.stepping.is_none());
                lefts.push(left(&foot));
            }
            close(lefts[0].1, 0.15, 1e-3);
            assert!(lefts.windows(2).all(|w| w[1].1 <= w[0].1 + 1e-3), "{lefts:?}");
            assert!(lefts[frames].0 < 1e-4 && lefts[frames].1 < 2e-3, "{lefts:?}");
            assert!(lefts[frames - 2].1 > 2e-3, "{lefts:?}");
            assert_eq!((foot.contact(0.0), foot.contact(0.5), foot.contact(1.0)), (0.0, 0.5, 0.5));
        }
        // A walking foot appears without being held.
        assert!(!Foot::standing(&at(0.0), walk(3), 0).stands());
    }

    #[test]
    fn a_short_swing_that_has_far_to_go_is_a_step_of_its_own() {
        let mut swing = walk(3).clone();
        swing.until_stands[0] = 4;
        for (root, steps) in [(at(0.05), false), (at(0.07), true), (Planar::new(Vec2::ZERO, 0.25), true)] {
            let mut foot = Foot::standing(&at(0.0), stand(), 0);
            stay(&mut foot, &root, stand());
            stay(&mut foot, &root, &swing);
            assert_eq!(foot.stepping.is_some(), steps);
        }
    }

    #[test]
    fn a_transition_leaves_a_foot_as_it_stands() {
        // From flat to a clip whose foot is elsewhere, turned by 0.3 radians and with the toes up.
        let mut new = pitched(0.25, 1.0);
        new.foot_rotation[0] = Quat::from_rotation_z(0.3) * new.foot_rotation[0];
        new.toe[0] += Vec3::new(0.05, -0.1, 0.0);
        let mut foot = Foot::standing(&at(0.0), stand(), 0);
        let stood = points(&foot, &at(0.0), stand());
        foot.transition(&at(0.0), stand(), stand(), &new, &new, 0);
        for (now, then) in points(&foot, &at(0.0), &new).iter().zip(&stood) {
            assert!(now.distance(*then) < 1e-4, "{now} {then}");
        }
        // Its slope becomes the clip's; where it stands and faces stays.
        for _ in 0..10 {
            stay(&mut foot, &at(0.0), &new);
            assert!(points(&foot, &at(0.0), &new)[1].truncate().distance(stood[1].truncate()) < 1e-4);
        }
        let [heel, toe] = points(&foot, &at(0.0), &new);
        close(heel.z, 0.0, 1e-4);
        close((toe.z - TOE_HEIGHT) / 0.19, 0.25f32.sin(), 0.02);
        let along = (toe - heel).truncate();
        close(along.y.atan2(along.x), (stood[1] - stood[0]).y.atan2((stood[1] - stood[0]).x), 1e-3);
    }

    #[test]
    fn a_transition_in_the_air_keeps_the_toe_and_its_velocity() {
        let mut foot = Foot::standing(&at(0.0), walk(3), 1);
        let before = foot.shown(&at(0.0), walk(3), 1);
        foot.transition(&at(0.0), walk(3), walk(4), stand(), stand(), 1);
        let after = foot.shown(&at(0.0), stand(), 1);
        assert!(after.toe.distance(before.toe) < 1e-5);
        assert!(after.rotation.angle_between(before.rotation) < 1e-3);
        // Gliding on at 1.2 m/s.
        assert!(foot.toe.velocity.distance(Vec3::Y * -1.2) < 1e-3, "{}", foot.toe.velocity);
        // No noise is faster than 8 m/s.
        let mut leaps = walk(4).clone();
        leaps.toe[1].x += 1.0;
        foot.transition(&at(0.0), walk(3), &leaps, stand(), stand(), 1);
        close(foot.toe.velocity.length(), 8.0, 1e-3);
    }

    #[test]
    fn what_is_left_of_a_slope_pushes_neither_heel_nor_ball_under_the_floor() {
        for slope in [-0.4, -0.1, 0.1, 0.4] {
            let mut foot = Foot::standing(&at(0.0), stand(), 0);
            foot.turn.begin(Vec3::X * slope, Vec3::ZERO, 0.2);
            let [heel, toe] = points(&foot, &at(0.0), stand());
            close(heel.z.min(toe.z - TOE_HEIGHT), 0.0, 1e-5);
            close(heel.z.max(toe.z - TOE_HEIGHT), 0.19 * slope.abs().sin(), 0.003);
        }
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
        let own = clip_toe(&at(0.0), stand(), 0);
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
        let own = clip_toe(&at(0.0), stand(), 0);
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
        let came = pose.position(Joint::LeftToe).truncate();
        let mut waits = foot;
        waits.step(&at(0.0), Planar::default(), stand(), 0, false);
        assert!(points(&waits, &at(0.0), stand())[1].truncate().distance(came) < 1e-4);
        foot.step(&at(0.0), Planar::default(), stand(), 0, true);
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
