//! What keeps alive who sits or stands at a motion's end, for as long as asked: breath, sway, looks, shifts of the weight, hands
//! and knees that stir (ours; the paper's motions end with their clips).
//!
//! All of it is laid over the motion that is there, by a seed. Feet stay where they stand, hands where they rest or follow
//! their cues, a seated pelvis on its cue. Where it would bring the body into itself or into the scene there is less of it.

mod armrest;
mod backrest;
mod gaze;
mod limb;
mod pause;
mod score;

use std::ops::Range;

use glam::{Quat, Vec3};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::anatomy::{BodyPart, beyond_limits, touching};
use crate::cue::{Hand, is_carried};
use crate::error::Result;
use crate::figures::{Surroundings, in_scene};
use crate::library::foot::LEGS;
use crate::math::curve::{smoothstep, softened, widened};
use crate::math::rotation::{wrap_angle, yaw};
use crate::motion::skeleton::{ARMS, BODY_BOXES, JOINT_OFFSET, LEG_LENGTH, Limb, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, Joint, Motion, Pose, Posture};
use crate::progress::Progress;
use armrest::lay_aside;
use backrest::{leans_already, settle_trunk};
pub(crate) use gaze::{Gaze, GazeFigures, look};
use limb::reach;
pub(crate) use pause::{Pause, pause};
use score::{Moment, Score};

/// Seconds in which a body comes to life as its action completes, and frames in which a hand that follows a cue goes still before it.
const BEGINS_IN: f32 = 0.5;
const CARRIED_MARGIN: usize = 12;
/// Of a movement that a clip ends in, what is left from frame to frame.
const SETTLES: f32 = 0.8;

/// What breath does: the chest extends, the collar bones rise, radians.
const BREATH_CHEST: f32 = 0.018;
const BREATH_SHOULDERS: f32 = 0.030;
/// How far a pelvis rolls with the weight, radians: on a seat towards it, over the feet away from it.
const ROLLS_SEATED: f32 = 0.035;
const ROLLS_STANDING: f32 = -0.022;
/// How far a standing pelvis goes over one foot, metres; of a seated trunk's lean a standing one has so much.
const OVER_A_FOOT: f32 = 0.022;
const STANDING_TRUNK: f32 = 0.45;
/// Of what moves in a trunk that sits freely, one that leans on the back of the seat has so much.
const CARRIED_TRUNK: f32 = 0.5;
/// How much of a trunk's lean the pelvis makes, and the turns of each joint of the spine between the pelvis's and the chest's.
const PELVIS_SHARE: f32 = 0.4;
const SPINE_SHARES: [f32; 2] = [0.4, 0.7];
/// How far a hand stirs along the thigh, inwards and up, metres; an arm that hangs swings and bends, radians.
const STIRS: Vec3 = Vec3::new(0.08, 0.018, 0.045);
/// Of that, on the arm of a seat.
const STIRS_ASIDE: f32 = 0.35;
const ARM_SWINGS: f32 = 0.06;
const ELBOW_BENDS: f32 = 0.16;
/// An arm that is held back by its hand is straightened without effort so far, and then by so much more, shares of its length.
const EASY_REACH: f32 = 0.92;
const REACH_GIVES: f32 = 0.05;
const ARM_LENGTH: f32 =
    JOINT_OFFSET[Joint::LeftForeArm as usize].x + JOINT_OFFSET[Joint::LeftHand as usize].x;
/// Fingers droop from a hand that is lifted, radians.
const FINGERS_DROOP: f32 = 0.25;
/// A wrist nearer to a thigh's middle than this rests on it, one beyond that does not, metres.
const ON_A_THIGH: (f32, f32) = (0.14, 0.20);
/// A sole so high over the floor hangs, metres.
const HANGS: f32 = 0.04;
/// While a hand follows a cue so much of the rest is left.
const WHILE_CARRIED: f32 = 0.35;

/// Deeper than this, and than without life, no part comes into the body or the scene, metres.
const TOUCHES: f32 = 0.005;
const DEEPER: f32 = 0.001;
/// Further no joint goes beyond its limit, or than without life, degrees: less than is counted.
const BEYOND: f32 = 4.0;
/// What rests is missed by no more than this, metres: feet and hands at cues, and hands.
const MISSES: (f32, f32) = (5e-4, 2e-2);
/// A seated knee sinks no further than this, metres.
const KNEE_SINKS: f32 = 0.02;
/// Elbows go outwards as the trunk leans over the hands or aside, radians for each radian.
const ELBOWS_OUT: (f32, f32) = (0.9, 0.4);
/// So often there is half as much of what is too much, then none; from which round on of trunk and legs for the sake of arms and head.
const ROUNDS: usize = 7;
const CARRIERS_FROM: usize = 3;
/// Frames before and after in which there is less.
const EASES: usize = 18;

/// What can be there less of, alone.
const TRUNK: usize = 0;
const HEAD: usize = 1;
const ARM: [usize; 2] = [2, 3];
const LEGGED: usize = 4;
/// Where the feet stand: as much of it in every frame, or they would slide.
const FEET: usize = 5;
const GROUPS: usize = 6;

/// A motion's end that goes on.
pub(crate) struct Hold<'a> {
    /// Frame from which on the body rests.
    pub from: usize,
    /// Frames that the motion is to have; more where it has.
    pub frames: usize,
    /// How much moves, 1 as usual, 0 nothing.
    pub size: f32,
    pub seed: u64,
    /// World height of the floor, metres.
    pub floor: f32,
    /// Feet that may be set elsewhere.
    pub feet_free: [bool; 2],
    /// Frames in which a hand follows a cue.
    pub carried: &'a [(Hand, Range<usize>)],
    pub around: Surroundings<'a>,
    /// Whether the rest is left again as it was entered, so that a motion goes on from its end.
    pub goes_on: bool,
}

/// Lengthens a motion to what is asked and brings its end to life.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn enliven(motion: &mut Motion, hold: &Hold, progress: &Progress) -> Result<()> {
    lengthen(motion, hold.frames, hold.around.seats.at_end().is_some());
    if hold.size <= 0.0 || hold.from >= motion.len() {
        return Ok(());
    }
    let frames = motion.len() - hold.from;
    let seconds = frames as f32 / FRAME_RATE;
    let score = Score::new(seconds, hold.size, hold.seed, &mut Pcg64::seed_from_u64(hold.seed ^ 0x11FE_0000));
    // Nobody settles who is about to go.
    let leans_back = match hold.goes_on {
        true => leans_already(motion, hold),
        false => settle_trunk(motion, hold, score.leans_back()),
    };
    let armrests = score.armrests();
    let aside = [0, 1].map(|side| !hold.goes_on && armrests[side] && lay_aside(motion, hold, side));
    let body = Body { leans_back, aside, ..Body::new(motion, hold) };
    let rest: Vec<Flaws> = body.base.par_iter().map(|posture| Flaws::of(posture, hold)).collect();
    let mut less = vec![vec![0.0f32; frames]; GROUPS];
    let mut demands = less.clone();
    for round in 0..=ROUNDS {
        progress.check()?;
        let played: Vec<(Posture, [bool; GROUPS])> = (0..frames)
            .into_par_iter()
            .map(|frame| {
                let share = std::array::from_fn(|group| 1.0 - less[group][frame]);
                let (posture, [feet, hands]) = body.at(frame, &score.at(frame as f32 / FRAME_RATE), share);
                let mut too_much = Flaws::of(&posture, hold).over(&rest[frame]);
                too_much[TRUNK] |= hands;
                too_much[FEET] |= feet;
                // Where it does not help that head and arms are still, what carries them is: the trunk, and the thighs under hands.
                if round >= CARRIERS_FROM {
                    let arms = too_much[ARM[0]] | too_much[ARM[1]];
                    too_much[TRUNK] |= too_much[HEAD] | arms | feet;
                    too_much[LEGGED] |= arms;
                    // Feet that are set elsewhere move thighs, and hands lie on these.
                    too_much[FEET] |= arms && round > CARRIERS_FROM;
                }
                let too_much = too_much;
                (posture, too_much)
            })
            .collect();
        if round == ROUNDS || played.iter().all(|(_, too_much)| !too_much.contains(&true)) {
            let feet = body.feet_free.map(|free| free && less[FEET][0] < 1.0);
            for (frame, (posture, _)) in played.into_iter().enumerate() {
                motion.postures[hold.from + frame] = posture;
                let moments = score.at(frame as f32 / FRAME_RATE).feet;
                for side in 0..2 {
                    if feet[side] && moments[side].in_the_air {
                        motion.contacts[hold.from + frame][side] = 0.0;
                    }
                }
            }
            break;
        }
        for (group, (demand, less)) in demands.iter_mut().zip(&mut less).enumerate() {
            for ((demand, less), (_, too_much)) in demand.iter_mut().zip(less.iter()).zip(&played) {
                let wanted = if round + 2 < ROUNDS { 0.5 + 0.5 * less } else { 1.0 };
                *demand = if too_much[group] { demand.max(wanted) } else { *demand };
            }
            // Eased as a whole: the larger of two eased curves would have a kink.
            *less = match group {
                FEET => vec![demand.iter().copied().fold(0.0, f32::max); frames],
                _ => softened(&widened(demand, EASES), EASES),
            };
        }
    }
    Ok(())
}

/// Whether who sits stays long enough to settle on what the seat offers, seconds: not who gets up at once, nor over hands at work.
const SETTLES_FROM: f32 = 0.9;

fn settles(motion: &Motion, hold: &Hold) -> bool {
    let seconds = (motion.len() - hold.from - 1) as f32 / FRAME_RATE;
    hold.around.seats.at_end().is_some() && seconds >= SETTLES_FROM && hold.carried.is_empty()
}

/// A posture that misses nothing and has no more flaws than the body at rest.
fn flawless((posture, missed): (Posture, bool), rest: &Flaws, hold: &Hold) -> Option<Posture> {
    (!missed && !Flaws::of(&posture, hold).over(rest).contains(&true)).then_some(posture)
}

/// The same of every frame that the body rests; `way`: a frame's posture, and whether it misses something.
fn flawless_way(
    rest: &[Flaws],
    hold: &Hold,
    way: impl Fn(usize) -> (Posture, bool) + Sync,
) -> Option<Vec<Posture>> {
    rest.par_iter().enumerate().map(|(frame, rest)| flawless(way(frame), rest, hold)).collect()
}

/// The motion goes on until it has so many frames: what still moves comes to rest, and the feet stay. So does the place of a
/// pelvis that sits.
fn lengthen(motion: &mut Motion, frames: usize, seated: bool) {
    let (Some(&last), Some(&contact)) = (motion.postures.last(), motion.contacts.last()) else { return };
    let before = motion.postures[motion.len().saturating_sub(2)];
    let feet = last.pose();
    let mut goes_on = 0.0;
    let mut share = 1.0;
    for _ in motion.len()..frames {
        share *= SETTLES;
        goes_on += share;
        let mut posture = last;
        if !seated {
            posture.root_position += (last.root_position - before.root_position) * goes_on;
        }
        for (rotation, before) in posture.rotations.iter_mut().zip(before.rotations) {
            let mut turn = before.inverse() * *rotation;
            if turn.w < 0.0 {
                turn = -turn;
            }
            *rotation = (*rotation * Quat::from_scaled_axis(turn.to_scaled_axis() * goes_on)).normalize();
        }
        let mut pose = posture.pose();
        for [thigh, shin, foot, toe] in LEGS {
            posture.rotations[toe.index()] = last.rotations[toe.index()];
            let (to, turned) = (feet.position(foot), feet.rotation(foot));
            reach(&mut posture, &mut pose, [thigh, shin, foot], Vec3::X, to, turned, 0.0);
        }
        motion.postures.push(posture);
        motion.contacts.push(contact);
    }
}

/// The body that is brought to life: the motion without, and what of it rests on what.
struct Body<'a> {
    base: &'a [Posture],
    seated: bool,
    /// The trunk is carried by the back of the seat.
    leans_back: bool,
    /// Hands that lie on the arms of the seat.
    aside: [bool; 2],
    hangs: [bool; 2],
    feet_free: [bool; 2],
    /// Frames after which all is again as it was, where it is to be.
    leaves_at: Option<usize>,
    /// How far each hand follows a cue, 0 to 1, by frame.
    carried: [Vec<f32>; 2],
    /// Where the head is turned to at rest, from the pelvis to the left, radians.
    looks: f32,
}

impl<'a> Body<'a> {
    fn new(motion: &'a Motion, hold: &Hold) -> Self {
        let base = &motion.postures[hold.from..];
        let last = base[base.len() - 1];
        let pose = last.pose();
        let seated = hold.around.seats.at_end().is_some();
        let carried = [Hand::Left, Hand::Right].map(|side| {
            let follows = |frame: usize| is_carried(hold.carried, side, hold.from + frame);
            let carried: Vec<f32> = (0..base.len()).map(|f| if follows(f) { 1.0 } else { 0.0 }).collect();
            softened(&widened(&carried, CARRIED_MARGIN), CARRIED_MARGIN)
        });
        let ahead = pose.rotation(Joint::Head) * Vec3::NEG_Y;
        let looks = wrap_angle(ahead.x.atan2(-ahead.y) - last.planar().yaw);
        let hangs =
            [0, 1].map(|side| seated && pose.position(LEGS[side][3]).z - TOE_HEIGHT - hold.floor > HANGS);
        let feet_free = [0, 1].map(|side| seated && hold.feet_free[side] && !hangs[side]);
        let leaves_at = hold.goes_on.then_some(base.len());
        let aside = [false; 2];
        Self { base, seated, leans_back: false, aside, hangs, feet_free, leaves_at, carried, looks }
    }

    /// A frame with what moves at its moment, `share` of each group; and whether a foot and a hand that rest are missed, or a thigh sinks.
    fn at(&self, frame: usize, moment: &Moment, share: [f32; GROUPS]) -> (Posture, [bool; 2]) {
        let base = self.base[frame];
        let before = base.pose();
        let part = |frames: usize| smoothstep(frames as f32 / (BEGINS_IN * FRAME_RATE));
        let begun = part(frame) * self.leaves_at.map_or(1.0, |end| part(end - frame));
        let carried = [0, 1].map(|side| self.carried[side][frame]);
        let left = 1.0 - (1.0 - WHILE_CARRIED) * carried[0].max(carried[1]);
        let of = |group: usize| begun * share[group] * if group >= LEGGED { 1.0 } else { left };
        let heading = Quat::from_rotation_z(base.planar().yaw);
        let in_heading = |turn: Quat| heading * turn * heading.inverse();

        let mut posture = base;
        let much = of(TRUNK);
        let (rolls, trunk_share) =
            if self.seated { (ROLLS_SEATED, 1.0) } else { (ROLLS_STANDING, STANDING_TRUNK) };
        let mut settled =
            if self.settles() { moment.settled.extend(0.0) * (share[TRUNK] * left) } else { Vec3::ZERO };
        let mut stirs = moment.trunk * Vec3::new(trunk_share, trunk_share, 1.0) * much;
        if self.leans_back {
            // What is carried stirs less, and not into what carries it.
            settled *= Vec3::new(0.0, CARRIED_TRUNK, 0.0);
            stirs = CARRIED_TRUNK * stirs.with_x(soft(stirs.x));
        }
        let trunk = settled + stirs;
        let pelvis = in_heading(
            Quat::from_rotation_x(PELVIS_SHARE * trunk.x)
                * Quat::from_rotation_y(rolls * moment.weight * much + PELVIS_SHARE * settled.y),
        );
        if !self.seated {
            posture.root_position += heading * Vec3::X * (OVER_A_FOOT * moment.weight * much);
        }
        let chest = in_heading(
            Quat::from_rotation_z(trunk.z)
                * Quat::from_rotation_x(trunk.x - BREATH_CHEST * moment.breath * much)
                * Quat::from_rotation_y(trunk.y),
        );
        let looks = of(HEAD);
        let head = in_heading(
            Quat::from_rotation_z(looks * (moment.look.0 - self.looks))
                * Quat::from_rotation_x(looks * moment.look.1),
        );
        // A pelvis that rolls faces as it did.
        let rolled = pelvis * before.rotations[0];
        let hips = Quat::from_rotation_z(yaw(before.rotations[0]) - yaw(rolled)) * rolled;
        posture.rotations[0] = hips.normalize();
        turn_trunk(&mut posture, &before, hips, [pelvis, chest, head]);
        for (side, sign) in [1.0f32, -1.0].into_iter().enumerate() {
            let raised = Quat::from_rotation_y(-sign * BREATH_SHOULDERS * moment.breath * much);
            let collar = ARMS[side][0].index();
            posture.rotations[collar] = raised * posture.rotations[collar];
        }
        let mut pose = posture.pose();
        if !self.seated {
            let sinks = (0..2).map(|side| self.sinks(&before, &pose, side)).fold(0.0, f32::max);
            posture.root_position.z -= sinks;
            pose = posture.pose();
        }
        let feet = self.legs(&mut posture, &mut pose, &before, moment, [of(LEGGED), share[FEET]]);
        let shares = ArmShares {
            much: ARM.map(of),
            carried,
            out: ELBOWS_OUT.0 * soft(trunk.x) + ELBOWS_OUT.1 * (soft(trunk.y) + soft(-trunk.y)),
        };
        let hands = self.arms(&mut posture, &mut pose, &before, moment, &shares);
        (posture, [feet, hands])
    }

    /// Whether the trunk takes the seated posture of the take.
    fn settles(&self) -> bool {
        self.seated && self.leaves_at.is_none()
    }

    /// How far the pelvis has to sink for a leg to reach its foot, metres.
    fn sinks(&self, before: &Pose, now: &Pose, side: usize) -> f32 {
        let [thigh, _, foot, _] = LEGS[side];
        let (hip, ankle) = (now.position(thigh), before.position(foot));
        let longest = before.position(thigh).distance(ankle).max(2.0 * LEG_LENGTH * 0.995);
        let across = hip.truncate().distance(ankle.truncate());
        let height = (longest * longest - across * across).max(0.0).sqrt();
        (hip.z - ankle.z - height).max(0.0)
    }

    /// Legs under the pelvis, their feet where they stand, the knees as they stir. Whether a foot is missed or a thigh sinks.
    fn legs(
        &self,
        posture: &mut Posture,
        pose: &mut Pose,
        before: &Pose,
        moment: &Moment,
        much: [f32; 2],
    ) -> bool {
        let mut missed = false;
        let heading = Quat::from_rotation_z(self.base[0].planar().yaw);
        for (side, sign) in [1.0f32, -1.0].into_iter().enumerate() {
            let [thigh, shin, foot, toe] = LEGS[side];
            let knee = moment.knees[side] * much[0] * if self.seated { 1.0 } else { 0.2 };
            if self.hangs[side] {
                posture.rotations[shin.index()] *= Quat::from_rotation_x(1.5 * knee);
                [shin, foot].iter().for_each(|joint| pose.place(posture, joint.index()));
            } else {
                let set = moment.feet[side];
                let free = if self.feet_free[side] { much[1] } else { 0.0 };
                let moved = heading * Vec3::new(set.moved.x, -set.moved.y, set.lifted) * free;
                let (to, turned) = (before.position(foot) + moved, before.rotation(foot));
                let limb = [thigh, shin, foot];
                missed |= reach(posture, pose, limb, Vec3::X, to, turned, -sign * knee) > MISSES.0;
                // A thigh that goes down goes into the seat.
                let sinks = before.position(shin).z - pose.position(shin).z;
                missed |= self.seated && sinks > KNEE_SINKS;
            }
            pose.place(posture, toe.index());
        }
        missed
    }

    /// Arms that hang go with the trunk, hands that rest or follow a cue stay; all stir. Whether a hand is missed.
    fn arms(
        &self,
        posture: &mut Posture,
        pose: &mut Pose,
        before: &Pose,
        moment: &Moment,
        shares: &ArmShares,
    ) -> bool {
        let ArmShares { much, carried, out } = *shares;
        let mut missed = false;
        let heading = Quat::from_rotation_z(self.base[0].planar().yaw);
        for (side, sign) in [1.0f32, -1.0].into_iter().enumerate() {
            let [_, upper, lower, hand] = ARMS[side];
            let [stirs, settles] = if self.aside[side] { [STIRS_ASIDE, 0.0] } else { [1.0; 2] };
            let stir = moment.hands[side] * (stirs * much[side] * (1.0 - carried[side]));
            let settles = moment.hands_settle[side] * (settles * much[side] * (1.0 - carried[side]));
            let stays = if self.seated { 1.0 } else { carried[side] };
            if stays < 1.0 {
                // The wish of an arm that hangs.
                let free = 1.0 - stays;
                let swing = heading * Quat::from_rotation_x(-ARM_SWINGS * stir.x * free) * heading.inverse();
                let chest = pose.rotation(ARMS[side][0]);
                posture.rotations[upper.index()] =
                    (chest.inverse() * swing * chest * posture.rotations[upper.index()]).normalize();
                let bend = ELBOW_BENDS * (0.5 * stir.y.abs() + stir.z) * free;
                posture.rotations[lower.index()] *= Quat::from_rotation_z(-sign * bend);
            }
            [upper, lower, hand].iter().for_each(|joint| pose.place(posture, joint.index()));
            if stays > 0.0 {
                let (place, turned) = self.rest(
                    pose,
                    before,
                    hand,
                    STIRS * stir + Vec3::X * settles,
                    sign,
                    1.0 - carried[side],
                );
                let wanted = pose.position(hand).lerp(place, stays);
                // An arm that a hand holds back straightens softly: the hand gives a little. One that follows a cue does not.
                let shoulder = pose.position(upper);
                let easy =
                    before.position(upper).distance(before.position(hand)).max(EASY_REACH * ARM_LENGTH);
                let room = (ARM_LENGTH - easy).clamp(0.001, REACH_GIVES * ARM_LENGTH);
                let span = wanted.distance(shoulder).max(1e-3);
                let over = (span - easy).max(0.0);
                let held = span - (1.0 - carried[side]) * (over - room * (over / room).tanh());
                let to = shoulder + (wanted - shoulder) * (held / span);
                let turned = pose.rotation(hand).slerp(turned, stays);
                let away =
                    reach(posture, pose, [upper, lower, hand], Vec3::Z * -sign, to, turned, sign * out);
                let away = if carried[side] > 0.0 { away } else { pose.position(hand).distance(wanted) };
                missed |= away > if carried[side] > 0.0 { MISSES.0 } else { MISSES.1 };
            }
        }
        missed
    }

    /// Where a hand at rest is while it stirs (along, inwards, up; metres): on the thigh that it lies on as far as it goes along with
    /// that, or where it is in the world.
    fn rest(
        &self,
        pose: &Pose,
        before: &Pose,
        hand: Joint,
        stir: Vec3,
        sign: f32,
        goes_along: f32,
    ) -> (Vec3, Quat) {
        let (place, turned) = (before.position(hand), before.rotation(hand));
        let away = |side: usize| {
            let [hip, knee] = [LEGS[side][0], LEGS[side][1]].map(|joint| before.position(joint));
            let part = ((place - hip).dot(knee - hip) / (knee - hip).length_squared()).clamp(0.0, 1.0);
            place.distance(hip.lerp(knee, part))
        };
        let side = if away(0) <= away(1) { 0 } else { 1 };
        let lies =
            goes_along - goes_along * smoothstep((away(side) - ON_A_THIGH.0) / (ON_A_THIGH.1 - ON_A_THIGH.0));
        let thigh = LEGS[side][0];
        let goes = pose.rotation(thigh) * before.rotation(thigh).inverse();
        let carried = pose.position(thigh) + goes * (place - before.position(thigh));
        let (along, inwards) = (before.rotation(thigh) * Vec3::NEG_Z, before.rotation(Joint::Hips) * Vec3::X);
        let moved = along * stir.x - inwards * (sign * stir.y) + Vec3::Z * stir.z;
        let drooping = Quat::from_rotation_y(sign * FINGERS_DROOP * stir.z / STIRS.z);
        (place.lerp(carried, lies) + moved, Quat::IDENTITY.slerp(goes, lies) * turned * drooping)
    }
}

/// Spine, neck and head of a posture as pelvis, chest and head turn in the world from where they are in `before`, on hips that are turned
/// so.
fn turn_trunk(posture: &mut Posture, before: &Pose, hips: Quat, [pelvis, chest, head]: [Quat; 3]) {
    let mut parent = hips;
    for (joint, turn) in [
        (Joint::Spine, pelvis.slerp(chest, SPINE_SHARES[0])),
        (Joint::Spine1, pelvis.slerp(chest, SPINE_SHARES[1])),
        (Joint::Spine2, chest),
        (Joint::Neck, chest.slerp(head, 0.5)),
        (Joint::Head, head),
    ] {
        let rotation = turn * before.rotation(joint);
        posture.rotations[joint.index()] = (parent.inverse() * rotation).normalize();
        parent = rotation;
    }
}

/// How much there is of what arms do.
struct ArmShares {
    much: [f32; 2],
    /// How far each hand follows a cue, 0 to 1.
    carried: [f32; 2],
    /// Radians that elbows go outwards.
    out: f32,
}

/// What is over zero, without a kink there.
fn soft(x: f32) -> f32 {
    0.5 * (x + (x * x + 1e-3).sqrt() - 1e-3f32.sqrt())
}

/// What is not as it should be in a posture.
struct Flaws {
    /// Parts in each other, metres.
    own: Vec<([BodyPart; 2], f32)>,
    /// Parts in the scene, metres.
    scene: Vec<(BodyPart, f32)>,
    /// Joints beyond their limits, degrees.
    joints: Vec<(Joint, f32)>,
    /// Crossings of the boxes B with the scene.
    crossings: [u32; BODY_BOXES.len()],
}

impl Flaws {
    fn of(posture: &Posture, hold: &Hold) -> Self {
        Self::on_frame(posture, &hold.around, usize::MAX, hold.floor)
    }

    /// On a frame of a motion, in which the seat of that frame carries the person.
    fn on_frame(posture: &Posture, around: &Surroundings, frame: usize, floor: f32) -> Self {
        let pose = posture.pose();
        let above = floor + around.ignore_below;
        Self {
            crossings: around.scene.intersections_on(&pose, above, around.seats.at(frame)),
            own: touching(&pose, 0.0).collect(),
            scene: in_scene(&pose, frame, floor, around)
                .into_iter()
                .map(|(part, depth, _)| (part, depth))
                .collect(),
            joints: beyond_limits(posture).iter().map(|&(joint, _, over)| (joint, over)).collect(),
        }
    }

    /// How deep a part may come into the scene, metres, where the body at rest is as deep as this one.
    fn allowed_in_scene(&self, part: BodyPart) -> f32 {
        let own = self.scene.iter().filter(|r| r.0 == part).map(|r| r.1).fold(0.0, f32::max);
        TOUCHES.max(own + DEEPER)
    }

    /// Of which groups there is too much, where a body at rest has flaws of its own.
    fn over(&self, rest: &Flaws) -> [bool; GROUPS] {
        let mut over = [false; GROUPS];
        let mut tell = |part: BodyPart| match part {
            BodyPart::Head => over[HEAD] = true,
            BodyPart::Pelvis | BodyPart::Trunk => over[TRUNK] = true,
            part if part.is_arm() => over[ARM[usize::from(part.side() > 0)]] = true,
            _ => (over[LEGGED], over[FEET]) = (true, true),
        };
        for &(parts, depth) in &self.own {
            // Of two capsules of one part the deeper.
            let own = rest.own.iter().filter(|r| r.0 == parts).map(|r| r.1).fold(0.0, f32::max);
            if depth > TOUCHES.max(own + DEEPER) {
                parts.into_iter().for_each(&mut tell);
            }
        }
        for &(part, depth) in &self.scene {
            if depth > rest.allowed_in_scene(part) {
                tell(part);
            }
        }
        for (node, (now, own)) in BODY_BOXES.iter().zip(self.crossings.iter().zip(&rest.crossings)) {
            if now > own {
                tell(match (node.limb, node.joint) {
                    (Limb::Leg | Limb::Foot, _) => BodyPart::LeftShin,
                    (Limb::Arm, Joint::LeftArm | Joint::LeftForeArm) => BodyPart::LeftForearm,
                    (Limb::Arm, _) => BodyPart::RightForearm,
                    (Limb::Torso, _) => BodyPart::Trunk,
                    (Limb::Head, _) => BodyPart::Head,
                });
            }
        }
        for ((joint, now), (_, own)) in self.joints.iter().zip(&rest.joints) {
            if *now > BEYOND.max(own + 0.1) {
                let side = |joints: &[[Joint; 4]; 2]| joints.iter().position(|chain| chain.contains(joint));
                match (side(&ARMS), side(&LEGS)) {
                    (Some(side), _) => over[ARM[side]] = true,
                    (_, Some(_)) => (over[LEGGED], over[FEET]) = (true, true),
                    _ if *joint == Joint::Head => over[HEAD] = true,
                    _ => over[TRUNK] = true,
                }
            }
        }
        over
    }
}

#[cfg(test)]
mod tests;
