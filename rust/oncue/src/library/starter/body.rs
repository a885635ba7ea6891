//! From a plan to postures: balance, pelvis, legs, trunk, arms.
//!
//! The centre of pressure follows the plan (heel to ball under the standing foot, across in double support); the pelvis
//! moves as an inverted pendulum above it, which gives the sway over the standing foot, the surge of each step and the
//! weight shift before the first step. The size of rotations and of arm swing per metre between the feet is that of the
//! walks named in [`super::foot`]: pelvis ±7° about the vertical and ±5° to the side, shoulders nearly still about the
//! vertical and ±4° over the standing leg, which carries the neck 4–6 cm from side to side; upper arms -15° to +10°.
//!
//! What a plan alone would run into itself is kept clear afterwards: a foot goes further round the other leg, knees are turned
//! apart, arms held off the trunk, hands laid round the thighs and not through them.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Quat, Vec2, Vec3};

use super::curve::{ease, keyed, mix, pendulum, running_minimum, smooth, soft_maximum};
use super::foot::{FootSample, FootTrack};
use super::limb::{self, ARM_LENGTH, Arm, LEG_REACH, Leg, Trunk};
use super::plan::{Foothold, Plan, WEIGHT_SHIFT};
use super::seat::{self, SeatState};
use crate::library::foot::LEGS;
use crate::math::planar::rotate;
use crate::motion::skeleton::{ARMS, JOINT_COUNT, JOINT_OFFSET, LEG_LENGTH, SEATED_HIPS_HEIGHT, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, FootContact, Joint, Motion, Posture};

/// Samples to a frame inside the generator.
const FINE: usize = 4;
const SAMPLE_TIME: f32 = 1.0 / (FRAME_RATE * FINE as f32);
/// ω of the pendulum, 1/s: g over the height of the centre of mass.
const OMEGA: f32 = 3.25;
/// The pelvis joint's height when standing, metres.
const STANDING_HEIGHT: f32 = 0.9885;

/// Legs keep so far apart, metres; a foot goes at most so much further round the other leg, in so many tries.
const CLEAR: f32 = 0.004;
const WIDEST: f32 = 0.30;
const MOST_TRIES: usize = 6;
/// A knee is turned outwards by so much at most, radians, tried in so many steps.
const MOST_PARTED: f32 = 0.36;
const PARTING_STEPS: usize = 6;
/// An arm is held off the trunk in so many steps.
const OFF_STEPS: usize = 6;
/// What keeps limbs clear is held for so many frames before and after.
const HOLDING_FRAMES: usize = 4;
/// Farthest that a wrist bends towards the thumb and towards the little finger, radians.
const WRIST_ASIDE: (f32, f32) = (0.55, 0.75);
/// Farthest from the hip that a wrist lies on a thigh, metres.
const ONTO_THE_KNEE: f32 = 0.37;
/// From the wrist to the finger tips of a hand at rest, metres.
const FINGERS: f32 = 0.15;
/// Finger tips of a hand that lies on a thigh, from its middle, metres.
const OVER_A_THIGH: f32 = 0.085;
/// Farthest that a hand on a thigh is bent and turned against its forearm, radians.
const WRIST_BEND: f32 = 0.72;
/// While a seated person has a foot off the floor the pelvis rolls and the trunk leans to the other side, radians, from so many
/// seconds before.
const BALANCES: (f32, f32) = (0.03, 0.08);
const BALANCED_BEFORE: f32 = 0.12;
/// Upper arms of who turns: seconds by which they lag, and radians off the trunk for each radian a second.
const ARMS_LAG: f32 = 0.07;
const ARMS_OUT: f32 = 0.05;
/// From a shoulder to where the wrist lies on the thigh, metres: so near no hand is laid there, and from so far it may.
const NO_ROOM: (f32, f32) = (0.14, 0.38);
/// A hand that reaches for the seat: how far beside its middle, and the wrist over it, metres.
const BESIDE_THE_THIGH: f32 = 0.22;
const WRIST_OVER_A_SEAT: f32 = 0.06;
/// The wrists of hands that pass over a seat, wide as it may be, stay so far above it, from so far before its edge, and are
/// bent back below so much above it, metres.
const PASSING_A_SEAT: f32 = 0.18;
const BEFORE_A_SEAT: f32 = 0.14;
const FLAT_BELOW: f32 = 0.32;
/// How far its wrist is bent back, radians.
const WRIST_ON_A_SEAT: f32 = 1.0;

/// What the whole body follows from, sampled every [`SAMPLE_TIME`].
struct Signals {
    feet: [Vec<FootSample>; 2],
    ankles: [Vec<Vec3>; 2],
    pelvis: Vec<Vec2>,
    height: Vec<f32>,
    yaw: Vec<f32>,
    /// Left ankle ahead of the right along the heading, metres.
    lead: Vec<f32>,
    /// Weight: 1 all on the left foot, -1 all on the right.
    load: Vec<f32>,
    slow_load: Vec<f32>,
    /// Radians that each knee is turned outwards to keep clear of the other leg.
    apart: Vec<f32>,
    /// How far each arm is held off the trunk to keep clear of it, 0 to 1.
    off: [Vec<f32>; 2],
    /// m/s and m/s² along and to the left of the heading.
    speed: Vec<f32>,
    surge: Vec<f32>,
    sideways: Vec<f32>,
    seat: Vec<SeatState>,
    /// Which foot a seated person has off the floor: 1 the left, -1 the right.
    off_floor: Vec<f32>,
}

/// The value of a signal `seconds` later (earlier if negative).
fn shifted(signal: &[f32], i: usize, seconds: f32) -> f32 {
    let j = i as f32 + seconds / SAMPLE_TIME;
    signal[(j.round().max(0.0) as usize).min(signal.len() - 1)]
}

/// Seconds after which a foot that is about to leave presses most, and how much of its half of the weight more.
const PUSH: (f32, f32) = (0.14, 0.6);

/// Share of the weight on the left foot, as keys over time.
fn load_keys(plan: &Plan) -> Vec<(f32, f32)> {
    let mut keys: Vec<(f32, f32)> = vec![(-1.0, 0.5)];
    let mut landed = -1.0f32;
    for step in plan.standing_steps() {
        let standing = if step.side == 0 { 0.0 } else { 1.0 };
        if step.lift - landed > 0.75 {
            // The later of both: the weight need not have come to the middle before it goes over.
            let begins = step.lift - WEIGHT_SHIFT.0;
            if landed > 0.0 {
                keys.push((landed + 0.40, 0.5));
            }
            let begins = begins.max(landed + 0.41);
            keys.push((begins, 0.5));
            // The foot that is to leave presses first: that is what sends the body over to the other.
            let pressed = begins + PUSH.0;
            if pressed < step.lift - WEIGHT_SHIFT.1 {
                keys.push((pressed, 0.5 + PUSH.1 * (0.5 - standing)));
            }
            keys.push((step.lift - WEIGHT_SHIFT.1, standing));
        }
        keys.push((step.lift, standing));
        keys.push((step.land, standing));
        landed = step.land;
    }
    if landed > 0.0 {
        keys.push((landed + 0.45, 0.5));
    }
    keys
}

/// Where along a foot, from the ankle forward in metres, the pressure is: keys over time.
fn pressure_keys(plan: &Plan, side: usize) -> Vec<(f32, f32)> {
    const STANDING: f32 = 0.045;
    let mut keys = vec![(-1.0, STANDING)];
    let mut now = plan.feet;
    let mut landed = f32::NEG_INFINITY;
    for step in &plan.steps {
        let from = now[step.side];
        let ahead = (step.to.ankle - from.ankle).dot(from.forward());
        let size = (ahead.abs() / 0.6).min(1.0) * ahead.signum();
        if step.side == side {
            if step.lift - landed > 0.9 {
                keys.push((step.lift - 0.4, STANDING));
            }
            keys.push((step.lift, STANDING + 0.075 * size));
            keys.push((step.land, STANDING - 0.07 * size));
            landed = step.land;
        }
        now[step.side] = step.to;
    }
    keys.push((landed.max(0.0) + 0.5, STANDING));
    keys
}

/// Which foot a seated person has off the floor at `t`, eased: 1 the left, -1 the right.
fn off_floor(plan: &Plan, t: f32) -> f32 {
    let seated = plan.steps.iter().filter(|step| plan.is_seated(step));
    seated
        .map(|step| {
            let (first, last) = (step.lift - BALANCED_BEFORE, step.land + BALANCED_BEFORE);
            let part = ((t - first) / (last - first)).clamp(0.0, 1.0);
            (PI * part).sin().powi(2) * if step.side == 0 { 1.0 } else { -1.0 }
        })
        .sum()
}

fn drift(plan: &Plan, t: f32, rates: [f32; 2], phases: [usize; 2]) -> f32 {
    let wave = |k: usize| (TAU * rates[k] * t + plan.style.phases[phases[k]]).sin();
    0.65 * wave(0) + 0.35 * wave(1)
}

impl Signals {
    /// `wider`: see [`FootTrack::new`], left and right.
    fn of(plan: &Plan, wider: &[Vec<f32>; 2]) -> Self {
        let n = (plan.duration / SAMPLE_TIME).round() as usize + 1;
        let time = |i: usize| i as f32 * SAMPLE_TIME;
        let sigma = |seconds: f32| seconds / SAMPLE_TIME;
        let tracks = [0, 1].map(|s| FootTrack::new(plan, s, &wider[s]));
        let seat: Vec<SeatState> = (0..n).map(|i| seat::seat_state(plan, time(i))).collect();
        let mut feet = [0, 1].map(|s| (0..n).map(|i| tracks[s].sample(time(i))).collect::<Vec<_>>());

        // Heading: between the feet.
        let middle: Vec<f32> = (0..n).map(|i| 0.5 * (feet[0][i].yaw + feet[1][i].yaw)).collect();
        let yaw = smooth(&middle, sigma(0.16));

        seat_feet(plan, &seat, &yaw, &mut feet);
        let ankles = [0, 1].map(|s| feet[s].iter().map(FootSample::ankle).collect::<Vec<_>>());

        // Pressure and pendulum.
        let keys = load_keys(plan);
        let share: Vec<f32> = (0..n).map(|i| keyed(&keys, time(i))).collect();
        let along = [pressure_keys(plan, 0), pressure_keys(plan, 1)];
        let pressure: Vec<Vec2> = (0..n)
            .map(|i| {
                let t = time(i);
                let under = |s: usize| {
                    let hold: Foothold = tracks[s].foothold(t);
                    hold.ankle + hold.forward() * keyed(&along[s], t)
                };
                let sway = Vec2::new(
                    plan.style.sway * drift(plan, t, [0.13, 0.29], [0, 1]),
                    0.5 * plan.style.sway * drift(plan, t, [0.19, 0.37], [2, 3]),
                );
                under(1).lerp(under(0), share[i]) + rotate(yaw[i], sway)
            })
            .collect();
        let axis = |f: fn(&Vec2) -> f32| {
            let values = smooth(&pressure.iter().map(f).collect::<Vec<_>>(), sigma(0.02));
            pendulum(&values, OMEGA, SAMPLE_TIME)
        };
        let mass: Vec<Vec2> =
            axis(|p| p.x).into_iter().zip(axis(|p| p.y)).map(|(x, y)| Vec2::new(x, y)).collect();
        let heading = |i: usize| rotate(yaw[i], Vec2::NEG_Y);
        let lead: Vec<f32> = (0..n)
            .map(|i| (ankles[0][i] - ankles[1][i]).truncate().dot(heading(i)) * (1.0 - seat[i].back))
            .collect();
        let load: Vec<f32> = share.iter().map(|s| 2.0 * s - 1.0).collect();
        let velocity = |i: usize| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
            // Steps of a seated person move the feet, not the body.
            (mass[b] - mass[a]) / ((b - a) as f32 * SAMPLE_TIME) * (1.0 - seat[i].back)
        };
        let speed = smooth(&(0..n).map(|i| velocity(i).dot(heading(i))).collect::<Vec<_>>(), sigma(0.25));
        // The pelvis is behind the centre of mass; in walking it stays above the standing ankle on average.
        let pelvis: Vec<Vec2> = (0..n)
            .map(|i| {
                let standing =
                    mass[i] + rotate(yaw[i], Vec2::new(0.0, 0.015 + 0.015 * speed[i].clamp(0.0, 1.2)));
                plan.seat.map_or(standing, |s| standing.lerp(plan.seat_place(&s, time(i)), seat[i].back))
            })
            .collect();

        let slope = |values: &[f32], i: usize| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
            (values[b] - values[a]) / ((b - a) as f32 * SAMPLE_TIME)
        };
        let surge = smooth(&(0..n).map(|i| slope(&speed, i)).collect::<Vec<_>>(), sigma(0.15));
        let sideways: Vec<f32> = (0..n).map(|i| speed[i] * slope(&yaw, i)).collect();
        let mut signals = Self {
            feet,
            ankles,
            pelvis,
            height: vec![0.0; n],
            yaw,
            lead: smooth(&lead, sigma(0.05)),
            slow_load: smooth(&load, sigma(0.13)),
            load: smooth(&load, sigma(0.055)),
            apart: vec![0.0; n],
            off: [vec![0.0; n], vec![0.0; n]],
            speed,
            surge,
            sideways: smooth(&sideways, sigma(0.3)),
            off_floor: (0..n).map(|i| seat[i].down * off_floor(plan, time(i))).collect(),
            seat,
        };
        signals.height = signals.pelvis_height(plan);
        signals
    }

    /// As high as the legs reach, smoothly: lowest in double support, highest over the standing foot.
    fn pelvis_height(&self, plan: &Plan) -> Vec<f32> {
        let n = self.pelvis.len();
        let reach = |i: usize, longest: f32| {
            let rotation = self.pelvis_rotation(plan, i);
            let within = |s: usize| {
                let hip = rotation * JOINT_OFFSET[[Joint::LeftUpLeg, Joint::RightUpLeg][s].index()];
                let ankle = self.ankles[s][i];
                let across = (self.pelvis[i] + hip.truncate()).distance(ankle.truncate());
                ankle.z + (longest * longest - across * across).max(0.04).sqrt() - hip.z
            };
            within(0).min(within(1))
        };
        let standing: Vec<f32> = (0..n).map(|i| reach(i, self.easy_reach(i)).min(STANDING_HEIGHT)).collect();
        let standing = smooth(&running_minimum(&standing, (0.10 / SAMPLE_TIME) as usize), 0.06 / SAMPLE_TIME);
        let seated = |i: usize| plan.seat.map_or(standing[i], |s| s.height + SEATED_HIPS_HEIGHT).min(1.2);
        let height: Vec<f32> = (0..n).map(|i| mix(standing[i], seated(i), self.seat[i].down)).collect();
        // Once more for the way to the seat.
        (0..n).map(|i| height[i].min(reach(i, LEG_REACH))).collect()
    }

    /// A leg's length in walking: the faster, the more the knee gives at heel strike (12–18°).
    fn easy_reach(&self, i: usize) -> f32 {
        let knee = mix(12.0, 18.0, ((self.speed[i].abs() - 0.9) / 0.6).clamp(0.0, 1.0));
        2.0 * LEG_LENGTH * (0.5 * knee).to_radians().cos()
    }

    fn pelvis_rotation(&self, plan: &Plan, i: usize) -> Quat {
        let seat = self.seat[i];
        let size = plan.style.pelvis;
        let turn = -0.235 * size * self.lead[i];
        // The swinging side drops as it is let go, and is most of the way up again when the foot passes.
        let let_go = self.load[i] - 0.6 * shifted(&self.slow_load, i, -0.12);
        let list = -0.062 * size * let_go * self.walking(i) - BALANCES.0 * self.off_floor[i];
        // Hips hinge while the thighs are upright; on a low seat they have no more room.
        let share = plan.seat.map_or(0.5, |s| mix(0.64, seat::pelvis_share(s.height), seat.down));
        let tilt = 0.03 + 0.02 * self.speed[i].clamp(-0.5, 1.5) + 0.012 * self.surge[i] + share * seat.lean
            - (0.20 + 0.4 * seat::recline(plan)) * seat.rest;
        Quat::from_rotation_z(shifted(&self.yaw, i, 0.05) + turn)
            * Quat::from_rotation_x(tilt)
            * Quat::from_rotation_y(list)
    }

    /// How much of the list of walking the pelvis shows: a third when standing, all from 0.8 m/s, none seated.
    fn walking(&self, i: usize) -> f32 {
        (0.35 + 0.65 * (self.speed[i].abs() / 0.8).min(1.0)) * (1.0 - self.seat[i].down)
    }

    /// Both legs under the pelvis, on their ankles.
    fn legs(&self, plan: &Plan, i: usize) -> [Leg; 2] {
        let root = self.pelvis[i].extend(self.height[i]);
        let pelvis = self.pelvis_rotation(plan, i);
        let t = i as f32 * SAMPLE_TIME;
        // Who sits at ease has the knees apart, and they are never quite still.
        let at_ease = if plan.seat.is_some_and(|s| s.at_table) { 0.0 } else { plan.style.seated.knees };
        let stirs = 0.03 * drift(plan, t, [0.10, 0.23], [3, 5]);
        let spread = (plan.knee_spread(t) + at_ease + stirs) * self.seat[i].feet;
        [0, 1].map(|s| {
            let sample = &self.feet[s][i];
            let sign = if s == 0 { 1.0 } else { -1.0 };
            let hip = root + pelvis * JOINT_OFFSET[LEGS[s][0].index()];
            let knee_yaw = mix(self.yaw[i] + spread * sign, sample.yaw, 0.65) + self.apart[i] * sign;
            let ankle = self.ankles[s][i];
            let (thigh, shin) = limb::leg(hip, ankle, rotate(knee_yaw, Vec2::NEG_Y).extend(0.0));
            Leg { hip, ankle, thigh, shin, foot: sample.rotation() }
        })
    }

    /// How much further each foot must go round the other leg in each of its steps, metres, given how far it goes.
    fn crossings(&self, plan: &Plan, wider: &mut [Vec<f32>; 2]) -> bool {
        let tracks = [0, 1].map(|s| FootTrack::new(plan, s, &[]));
        let mut more = [0, 1].map(|s| vec![0.0f32; tracks[s].steps()]);
        for i in (0..self.pelvis.len()).step_by(FINE) {
            let depth = limb::depth_between(&self.legs(plan, i)) + CLEAR;
            if depth <= 0.0 {
                continue;
            }
            for s in 0..2 {
                if let Some(step) = tracks[s].step_at(i as f32 * SAMPLE_TIME) {
                    more[s][step] = more[s][step].max(depth);
                }
            }
        }
        for (wide, more) in wider.iter_mut().zip(&more) {
            wide.resize(more.len(), 0.0);
            wide.iter_mut().zip(more).for_each(|(wide, more)| *wide = (*wide + more).min(WIDEST));
        }
        more.iter().flatten().any(|more| *more > 0.0)
    }

    /// Turns the knees outwards where the legs would still touch.
    fn part_knees(&mut self, plan: &Plan) {
        let least = |signals: &mut Self, i: usize| {
            for turn in 0..=PARTING_STEPS {
                signals.apart[i] = MOST_PARTED * turn as f32 / PARTING_STEPS as f32;
                if limb::depth_between(&signals.legs(plan, i)) <= -0.5 * CLEAR {
                    break;
                }
            }
            signals.apart[i]
        };
        let frames: Vec<usize> = (0..self.pelvis.len()).step_by(FINE).collect();
        let needed: Vec<f32> = frames.into_iter().map(|i| -least(self, i)).collect();
        self.apart = held(&needed, self.apart.len());
    }

    /// Pelvis, spine, neck and head, world rotations.
    fn trunk(&self, plan: &Plan, i: usize, world: &mut [Quat; JOINT_COUNT]) {
        let t = i as f32 * SAMPLE_TIME;
        let style = &plan.style;
        let seat = self.seat[i];
        let pelvis = self.pelvis_rotation(plan, i);
        world[Joint::Hips.index()] = pelvis;

        // Trunk: leans with speed and acceleration, against the swing of the pelvis; breathes.
        let breath = breath(plan, t);
        let calm = drift(plan, t, [0.09, 0.21], [5, 6]);
        let lean = 0.025
            + style.lean
            + 0.022 * self.speed[i].clamp(-1.0, 1.6)
            + 0.06 * self.surge[i].clamp(-2.0, 2.0)
            + seat.lean
            + (0.03 - seat::recline(plan)
                + 0.07 * plan.stirred(t)
                + 0.03 * drift(plan, t, [0.09, 0.21], [2, 6]))
                * seat.rest
            + 0.006 * breath
            + 0.008 * calm
            + 0.012 * (self.speed[i].abs() / 0.8).min(1.0) * drift(plan, t, [0.42, 0.85], [0, 6]);
        let counter = 0.010 * self.lead[i] * style.pelvis;
        let side = (0.052 * shifted(&self.slow_load, i, -0.04) + 0.05 * self.sideways[i].clamp(-1.5, 1.5))
            * (1.0 - seat.down)
            + (0.045 * drift(plan, t, [0.08, 0.18], [1, 4]) + 0.04 * plan.stirred(t)) * seat.rest
            - BALANCES.1 * self.off_floor[i];
        let thorax = Quat::from_rotation_z(shifted(&self.yaw, i, 0.12) + counter + 0.02 * calm)
            * Quat::from_rotation_x(lean)
            * Quat::from_rotation_y(side);
        let curl = pelvis.inverse() * thorax;
        for (k, joint) in [Joint::Spine, Joint::Spine1, Joint::Spine2].into_iter().enumerate() {
            world[joint.index()] = pelvis * Quat::IDENTITY.slerp(curl, (k + 1) as f32 / 3.0);
        }

        // Head: looks where the path goes, a little down; turns before the body does.
        let look = shifted(&self.yaw, i, 0.30) - shifted(&self.yaw, i, 0.12);
        let about = drift(plan, t, [0.07, 0.17], [7, 0]);
        // A seated person looks about, now and then.
        let look = 0.9 * (look / 0.9).tanh()
            + 0.07 * about
            + mix(0.15, 0.5, seat.rest) * about.powi(3) * (1.0 - self.walking(i).min(1.0));
        let gaze = 0.12
            + 0.14 * (self.speed[i].abs()).min(1.0)
            + 0.30 * seat.lean
            + 0.02 * drift(plan, t, [0.11, 0.05], [3, 7]);
        let head = Quat::from_rotation_z(shifted(&self.yaw, i, 0.12) + look) * Quat::from_rotation_x(gaze);
        let nod = thorax.inverse() * head;
        world[Joint::Neck.index()] = thorax * Quat::IDENTITY.slerp(nod, 0.5);
        world[Joint::Head.index()] = thorax * nod;
    }

    fn posture(&self, plan: &Plan, i: usize) -> Posture {
        let mut world = [Quat::IDENTITY; JOINT_COUNT];
        let root_position = self.pelvis[i].extend(self.height[i]);
        self.trunk(plan, i, &mut world);
        let legs = self.legs(plan, i);
        for (s, leg) in legs.iter().enumerate() {
            let [up, low, foot, toe] = LEGS[s];
            world[up.index()] = leg.thigh;
            world[low.index()] = leg.shin;
            world[foot.index()] = leg.foot;
            world[toe.index()] = leg.foot * Quat::from_rotation_x(-self.feet[s][i].toe_bend);
        }
        let chest = (Self::chest(root_position, &world), world[Joint::Spine2.index()]);
        for s in 0..2 {
            let arm = self.arm(plan, i, s, chest, &legs[s]);
            for (joint, rotation) in ARMS[s].into_iter().zip([arm.clavicle, arm.upper, arm.lower, arm.hand]) {
                world[joint.index()] = rotation;
            }
        }

        let mut rotations = world;
        for joint in Joint::ALL {
            if let Some(parent) = joint.parent() {
                rotations[joint.index()] =
                    (world[parent.index()].inverse() * world[joint.index()]).normalize();
            }
        }
        Posture { root_position, rotations }
    }

    /// Where the arms hang from: the chest's joint.
    fn chest(root: Vec3, world: &[Quat; JOINT_COUNT]) -> Vec3 {
        let mut at = root;
        for joint in [Joint::Spine, Joint::Spine1, Joint::Spine2] {
            let parent = joint.parent().map_or(Quat::IDENTITY, |p| world[p.index()]);
            at += parent * JOINT_OFFSET[joint.index()];
        }
        at
    }

    /// Arms swing against the legs, or come to rest on the thighs, by way of the seat where they reach for it.
    fn arm(&self, plan: &Plan, i: usize, s: usize, chest: (Vec3, Quat), leg: &Leg) -> Arm {
        let t = i as f32 * SAMPLE_TIME;
        let (seat, style) = (self.seat[i], &plan.style);
        let breath = breath(plan, t);
        let (chest, thorax) = chest;
        let sign = if s == 0 { 1.0 } else { -1.0 };
        let mirror = |q: Quat| if s == 0 { q } else { Quat::from_xyzw(q.x, -q.y, -q.z, q.w) };
        let [clavicle, upper, lower, hand_joint] = ARMS[s];
        let off = self.off[s][i];
        // One hand is a little ahead of the other.
        let delay = (sign * 8.0 * style.hands * FRAME_RATE * FINE as f32 * 0.25) as isize;
        let hands = self.seat[(i as isize - delay).clamp(0, self.seat.len() as isize - 1) as usize].hands;
        // No swing is quite as wide as the one before.
        let arms = style.arms * (1.0 + 0.13 * drift(plan, t, [0.33, 0.51], [2 + s, 5 + s]));
        let swing = -sign * shifted(&self.lead, i, -0.02) * arms;
        // Arms lag behind a body that turns, and swing out.
        let turning = (shifted(&self.yaw, i, 0.1) - shifted(&self.yaw, i, -0.1)) / 0.2;
        let forward = -0.055 + 0.34 * swing + seat.lean + sign * ARMS_LAG * turning;
        let bend =
            0.27 + 0.11 * self.speed[i].abs().min(1.4) + 0.34 * shifted(&self.lead, i, -0.05) * -sign * arms;
        let shrug = 0.012 * breath + 0.05 * hands;
        let shoulder = thorax * mirror(Quat::from_rotation_y(-shrug) * Quat::from_rotation_z(-0.03 * swing));
        let away = 0.165
            + style.off
            + 0.02 * self.speed[i].abs().min(1.5)
            + ARMS_OUT * turning.abs().min(2.0)
            + 0.30 * off;
        let hang_upper = thorax
            * mirror(
                Quat::from_rotation_x(-forward)
                    * Quat::from_rotation_y(FRAC_PI_2 - away)
                    * Quat::from_rotation_x(0.42),
            );
        let hang_lower = hang_upper * mirror(Quat::from_rotation_z(-bend.max(0.10)));
        let hang_hand = hang_lower * mirror(Quat::from_rotation_x(0.15) * Quat::from_rotation_z(-0.06));
        let joint = chest + thorax * JOINT_OFFSET[clavicle.index()] + shoulder * JOINT_OFFSET[upper.index()];
        let hanging = Arm {
            sign,
            shoulder: joint,
            clavicle: shoulder,
            upper: hang_upper,
            lower: hang_lower,
            hand: hang_hand,
        };
        // Who props a hand up on the seat leaves it there.
        let reach = (seat.reach * style.seated.reach[s]).max(hands * style.seated.props[s])
            * plan.seat.map_or(0.0, |s| if s.at_table { 0.0 } else { 1.0 });
        if hands <= 0.0 && reach <= 0.0 {
            return hanging;
        }
        let to_elbow = hang_upper * JOINT_OFFSET[lower.index()];
        let hung_wrist = joint + to_elbow + hang_lower * JOINT_OFFSET[hand_joint.index()];
        // Towards the knees while the trunk leans over them.
        // At a table the hands come back into the lap, and the elbows stay close to the body.
        let [rest, then] = style.seated.hands.map(|hands| hands[s]);
        let stirred = plan.stirred(t);
        let at_table = plan.seat.is_some_and(|s| s.at_table);
        let (along, elbows_out) = if at_table {
            (mix(0.255, 0.19, plan.swivelled(t)), 0.20)
        } else {
            (mix(rest.along, then.along, stirred) + 0.012 * drift(plan, t, [0.06, 0.15], [s, 7]), 0.27)
        };
        // Further over a low seat, whose knees are nearer to the shoulders.
        let forth = plan.seat.map_or(0.0, |s| mix(0.25, 0.15, ((s.height - 0.30) / 0.12).clamp(0.0, 1.0)));
        let along = (along - sign * style.hands + forth * (seat.lean / 1.2).min(1.0)).min(ONTO_THE_KNEE);
        let inwards = if at_table { 0.012 } else { mix(rest.inwards, then.inwards, stirred) };
        // Hands are lifted where they go elsewhere.
        let lifted = 0.05 * (PI * stirred).sin() * ((rest.along - then.along).abs() / 0.05).min(1.0);
        let resting = leg.hip + leg.thigh * Vec3::new(-inwards * sign, -0.092 - lifted, -along);
        let mut from = hung_wrist;
        // Shoulders that are ahead take the hand along to the edge.
        let ahead = 0.06 + 0.30 * (-seat::recline(plan)).max(0.0) * seat.rest;
        if let Some(place) = plan.seat.filter(|_| reach > 0.0) {
            let beside =
                plan.seat_place(&place, t) + rotate(self.yaw[i], Vec2::new(BESIDE_THE_THIGH * sign, -ahead));
            from = from.lerp(beside.extend(place.height + WRIST_OVER_A_SEAT), reach);
        }
        // Not before the trunk has come up so far that the elbows need not rise for it.
        let laid = hands * (1.0 - reach) * ease(joint.distance(resting), NO_ROOM.0, NO_ROOM.1);
        let mut wrist = round_the_thigh(leg, sign, from, resting, laid);
        wrist += thorax * Vec3::new(0.05 * sign, -0.06, 0.0) * off;
        let mut over_seat = 0.0;
        if let Some(place) = plan.seat {
            let from_pelvis = wrist.truncate() - plan.seat_place(&place, t);
            let ahead = from_pelvis.dot(rotate(self.yaw[i], Vec2::NEG_Y));
            let above = 1.0 - ease(ahead, seat::PELVIS_BEHIND_EDGE, seat::PELVIS_BEHIND_EDGE + BEFORE_A_SEAT);
            let lifted =
                soft_maximum(wrist.z, place.height + mix(PASSING_A_SEAT, WRIST_OVER_A_SEAT, reach), 0.03);
            wrist.z = mix(wrist.z, lifted, above);
            over_seat = above * (1.0 - ease(wrist.z - place.height, PASSING_A_SEAT, FLAT_BELOW));
        }
        wrist = within_reach(joint, wrist);
        let line = (hung_wrist - joint).normalize_or(Vec3::NEG_Z);
        let hung = (to_elbow - line * to_elbow.dot(line)).normalize_or(Vec3::Y);
        let bent = hands.max(reach);
        // Elbows hang out and back however far the trunk leans over the thighs.
        let leaning = Quat::from_rotation_z(self.yaw[i]) * Quat::from_rotation_x(0.35 * seat.lean);
        let elbow = hung.lerp(leaning * Vec3::new((elbows_out + 0.9 * off) * sign, 0.85, -0.50), bent);
        let (u, l) = limb::arm(sign, joint, wrist, elbow);
        let flat = flat_hand(sign, leg.thigh);
        let eased = l * (hang_lower.inverse() * hang_hand);
        let flat = bent_at_most(l, l.slerp(flat, 0.8), WRIST_BEND);
        let on_seat = laid_hand(sign, rotate(self.yaw[i], Vec2::NEG_Y).extend(0.0), Vec3::Z);
        let eased =
            eased.slerp(bent_at_most(l, on_seat, WRIST_ON_A_SEAT), reach.max(over_seat * (1.0 - laid)));
        let hand = eased.slerp(flat, ease(laid, 0.45, 1.0));
        let wrist = joint + u * JOINT_OFFSET[lower.index()] + l * JOINT_OFFSET[hand_joint.index()];
        let room = mix(0.115, OVER_A_THIGH, ease(laid, 0.8, 1.0));
        let hand = fingers_over_the_thigh(leg, sign, wrist, hand, room);
        Arm { upper: u, lower: l, hand, ..hanging }
    }

    /// Holds arms off the trunk where they would touch it.
    fn free_arms(&mut self, plan: &Plan) {
        let frames: Vec<usize> = (0..self.pelvis.len()).step_by(FINE).collect();
        let mut needed = [0, 1].map(|_| vec![0.0f32; frames.len()]);
        for (frame, &i) in frames.iter().enumerate() {
            let root = self.pelvis[i].extend(self.height[i]);
            let mut world = [Quat::IDENTITY; JOINT_COUNT];
            self.trunk(plan, i, &mut world);
            let hips = world[Joint::Hips.index()];
            let waist = root
                + hips * JOINT_OFFSET[Joint::Spine.index()]
                + world[Joint::Spine.index()] * JOINT_OFFSET[Joint::Spine1.index()];
            let chest = (Self::chest(root, &world), world[Joint::Spine2.index()]);
            let trunk = Trunk::new([(root, hips), (waist, world[Joint::Spine1.index()]), chest]);
            let legs = self.legs(plan, i);
            for s in 0..2 {
                for tried in 0..=OFF_STEPS {
                    self.off[s][i] = tried as f32 / OFF_STEPS as f32;
                    if trunk.depth_of(&self.arm(plan, i, s, chest, &legs[s])) <= 0.0 {
                        break;
                    }
                }
                needed[s][frame] = -self.off[s][i];
            }
        }
        for (off, needed) in self.off.iter_mut().zip(&needed) {
            *off = held(needed, off.len());
        }
    }
}

/// What is needed in single frames (negative), held over some frames before and after and eased in and out, at every sample.
fn held(needed: &[f32], samples: usize) -> Vec<f32> {
    if needed.iter().all(|value| *value == 0.0) {
        return vec![0.0; samples];
    }
    let eased = smooth(&running_minimum(needed, HOLDING_FRAMES), 0.5 * HOLDING_FRAMES as f32);
    let at = |i: usize| {
        let (frame, part) = (i / FINE, (i % FINE) as f32 / FINE as f32);
        -mix(eased[frame], eased[(frame + 1).min(eased.len() - 1)], part)
    };
    (0..samples).map(at).collect()
}

fn breath(plan: &Plan, t: f32) -> f32 {
    (TAU * 0.24 * t + plan.style.phases[4]).sin()
}

/// A wrist held to where an arm reaches without its elbow snapping straight or folding up.
fn within_reach(shoulder: Vec3, wrist: Vec3) -> Vec3 {
    const EASY: f32 = 0.92 * ARM_LENGTH;
    const MOST: f32 = 0.99 * ARM_LENGTH;
    const LEAST: f32 = 0.17;
    let span = wrist - shoulder;
    let distance = soft_maximum(span.length(), LEAST, 0.02);
    let over = (distance - EASY).max(0.0);
    let held = distance - over + (MOST - EASY) * (over / (MOST - EASY)).tanh();
    shoulder + span.normalize_or(Vec3::NEG_Z) * held
}

/// Hands eased from frame to frame where they are laid down or taken up, and no further aside than wrists go.
fn ease_hands(postures: &mut [Posture]) {
    for (s, [.., hand]) in ARMS.into_iter().enumerate() {
        let sign = if s == 0 { 1.0 } else { -1.0 };
        let raw: Vec<Quat> = postures.iter().map(|p| p.rotations[hand.index()]).collect();
        for (f, posture) in postures.iter_mut().enumerate() {
            let near = |k: isize| raw[(f as isize + k).clamp(0, raw.len() as isize - 1) as usize];
            let sum = (-5..=5isize).fold(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, k| {
                let weight = (-0.5 * (k as f32 / 2.2).powi(2)).exp();
                let q = near(k);
                sum + q * if q.dot(raw[f]) < 0.0 { -weight } else { weight }
            });
            let eased = sum.normalize();
            // The little finger's side is behind the left hand, palm down.
            let aside = (eased * Vec3::X * sign).y.clamp(-1.0, 1.0).asin();
            let over = aside - aside.clamp(-WRIST_ASIDE.0, WRIST_ASIDE.1);
            posture.rotations[hand.index()] = Quat::from_rotation_z(-sign * over) * eased;
        }
    }
}

/// A point by a thigh: how far along it from the hip, and beside its axis.
fn by_thigh(leg: &Leg, point: Vec3) -> (f32, Vec3) {
    let bone = leg.thigh * Vec3::NEG_Z;
    let along = (point - leg.hip).dot(bone);
    (along, point - leg.hip - bone * along)
}

/// The way of a wrist from beside a thigh onto it, at `part`: round its outer side (`sign` 1 left, -1 right), not through it.
fn round_the_thigh(leg: &Leg, sign: f32, from: Vec3, onto: Vec3, part: f32) -> Vec3 {
    let (outward, upward) = (leg.thigh * Vec3::X * sign, leg.thigh * Vec3::NEG_Y);
    let polar = |point: Vec3| {
        let (along, out) = by_thigh(leg, point);
        (along, out.length(), out.dot(upward).atan2(out.dot(outward)))
    };
    let (from, onto) = (polar(from), polar(onto));
    let along = mix(from.0, onto.0, part);
    let room = mix(0.125, 0.0, ease(part, 0.6, 1.0)) * ease(along, -0.05, 0.10);
    let radius = soft_maximum(mix(from.1, onto.1, part), room, 0.01);
    let angle = mix(from.2, onto.2, part);
    leg.hip + leg.thigh * Vec3::NEG_Z * along + (outward * angle.cos() + upward * angle.sin()) * radius
}

/// A hand turned until its finger tips are `room` (metres) from the middle of the thigh.
fn fingers_over_the_thigh(leg: &Leg, sign: f32, wrist: Vec3, hand: Quat, room: f32) -> Quat {
    let fingers = hand * Vec3::new(FINGERS * sign, 0.0, -0.02);
    let away = by_thigh(leg, wrist).1.normalize_or_zero();
    let (along, out) = by_thigh(leg, wrist + fingers);
    let height = out.dot(away);
    let beside = out.length_squared() - height * height;
    let room = room * ease(along, -0.05, 0.10) * (1.0 - ease(along, LEG_LENGTH, LEG_LENGTH + 0.10));
    let needed = (room * room - beside).max(0.0).sqrt();
    let raised = fingers + away * (soft_maximum(height, needed, 0.01) - height);
    Quat::from_rotation_arc(fingers.normalize(), raised.normalize_or(fingers.normalize())) * hand
}

/// A hand's rotation bent back to within `most` radians of its forearm's.
fn bent_at_most(forearm: Quat, hand: Quat, most: f32) -> Quat {
    let angle = forearm.angle_between(hand);
    if angle > most { forearm.slerp(hand, most / angle) } else { hand }
}

/// A hand that lies on the thigh: fingers towards the knee and a little inwards, palm on it.
fn flat_hand(sign: f32, thigh: Quat) -> Quat {
    laid_hand(sign, (thigh * Vec3::new(-0.30 * sign, 0.0, -1.0)).normalize(), thigh * Vec3::NEG_Y)
}

/// A hand by where its fingers and its back point.
fn laid_hand(sign: f32, fingers: Vec3, back: Vec3) -> Quat {
    let x = fingers * sign;
    let y = back.cross(x).normalize();
    Quat::from_mat3(&glam::Mat3::from_cols(x, y, x.cross(y)))
}

/// On high seats the heels rise, then the feet leave the floor. `yaw`: the heading.
fn seat_feet(plan: &Plan, seat: &[SeatState], yaw: &[f32], feet: &mut [Vec<FootSample>; 2]) {
    let Some(place) = plan.seat else { return };
    let legs = seat::seated_legs(place.height, place.tuck);
    if legs.pitch > -0.02 {
        return;
    }
    for (s, samples) in feet.iter_mut().enumerate() {
        let sign = if s == 0 { 1.0 } else { -1.0 };
        for (i, ((sample, state), yaw)) in samples.iter_mut().zip(seat).zip(yaw).enumerate() {
            let w = state.feet;
            if w <= 0.0 {
                continue;
            }
            if legs.hanging {
                // Off the floor the feet turn as the knees do.
                let outwards = sign * plan.knee_spread(i as f32 * SAMPLE_TIME);
                let hung = FootSample {
                    yaw: mix(sample.yaw, *yaw + outwards, w),
                    pitch: mix(sample.pitch, legs.pitch, w),
                    toe_bend: (1.0 - w) * sample.toe_bend,
                    ..*sample
                };
                let pelvis = plan.seat_place(&place, i as f32 * SAMPLE_TIME);
                let place = pelvis
                    + rotate(*yaw, Vec2::new(0.10 * sign, 0.0))
                    + rotate(*yaw + outwards, Vec2::new(0.0, -legs.ankle_ahead));
                let ankle = place.extend(legs.ankle_height);
                let ball = ankle + hung.rotation() * JOINT_OFFSET[Joint::LeftToe.index()];
                *sample = FootSample { ball: sample.ball.lerp(ball, w), planted: false, ..hung };
            } else {
                sample.pitch = mix(sample.pitch, legs.pitch, w);
                sample.toe_bend = mix(sample.toe_bend, -legs.pitch, w);
            }
        }
    }
}

/// The motion of a whole plan at 30 Hz.
pub(super) fn animate(plan: &Plan) -> Motion {
    let mut wider = [Vec::new(), Vec::new()];
    let mut signals = Signals::of(plan, &wider);
    for _ in 0..MOST_TRIES {
        if !signals.crossings(plan, &mut wider) {
            break;
        }
        signals = Signals::of(plan, &wider);
    }
    signals.part_knees(plan);
    signals.free_arms(plan);
    let frames = (signals.pelvis.len() - 1) / FINE + 1;
    let mut postures: Vec<Posture> = (0..frames).map(|f| signals.posture(plan, f * FINE)).collect();
    if plan.seat.is_some() {
        ease_hands(&mut postures);
    }
    let contacts = (0..frames).map(|f| contact(&signals, f * FINE)).collect();
    Motion { postures, contacts }
}

/// 1 the ball rests, 0.5 near the floor and slow, 0 otherwise.
fn contact(signals: &Signals, i: usize) -> FootContact {
    [0, 1].map(|s| {
        let track = &signals.feet[s];
        let (a, b) = (i.saturating_sub(2), (i + 2).min(track.len() - 1));
        if track[a].planted && track[i].planted && track[b].planted {
            return 1.0;
        }
        let speed = track[a].ball.distance(track[b].ball) / ((b - a) as f32 * SAMPLE_TIME);
        let foot = &track[i];
        let lowest = foot.ball.z.min(foot.ankle().z - 0.05);
        if lowest < TOE_HEIGHT + 0.04 && speed < 1.0 { 0.5 } else { 0.0 }
    })
}
