//! One foot's path through its plan: stance, heel rise, swing, heel strike.
//!
//! The tables are means over straight walking at 1.0–1.3 m/s of the Open Motion Project by ACCAD / The Ohio State
//! University (60 strides of `Male1_B1` to `B3` and `B9` to `B15`, CC BY 3.0), measured by `tools/gait_curves.py` and read at twentieths of the
//! stride; the shapes agree with Winter 1991 (two clearance peaks of the toe with the minimum between, heel strike
//! with the toe up by some 25°). Steps to the side, round and back have tables of their own.

use std::f32::consts::PI;
use std::sync::LazyLock;

use glam::{Quat, Vec2, Vec3};

use super::curve::{Spline, ease, minimum_jerk, mix, soft_maximum};
use super::plan::{BALL, Foothold, Plan, Step, ball_of};
use crate::math::planar::rotate;
use crate::motion::Joint;
use crate::motion::skeleton::{HEEL_LENGTH, JOINT_OFFSET, TOE_HEIGHT, TOE_LENGTH};

/// Metres between the middles of the feet as one passes the other.
const ROOM: f32 = 0.125;
const HEEL_TO_BALL: f32 = HEEL_LENGTH + BALL;

/// Heel rise: time as a share of rise → lift, pitch in degrees (toe up positive) for forward, level and backward steps.
const RISE: [(f32, [f32; 3]); 5] = [
    (0.28, [-3.0, -2.0, 0.0]),
    (0.48, [-7.5, -4.5, 0.0]),
    (0.68, [-13.5, -8.5, 0.0]),
    (0.88, [-22.5, -13.0, 0.0]),
    (1.0, [-30.0, -16.0, 0.0]),
];

/// How high a seated person lifts a foot to put it elsewhere, of what a walking one does: there is a table over the knees.
const SHUFFLE: f32 = 0.32;

/// Of a walking step's heel rise and height so much is left where the foot does not trail the other one as it leaves: it is not
/// pushed off, but lifted over.
const FROM_BESIDE: f32 = 0.65;
/// A foot that trails the other by this share of its way is pushed off.
const TRAILS: f32 = 0.45;

/// u where the heel strikes: lift is 0, the flat foot 1.
const STRIKE: f32 = 0.76;

/// A step this far backward lands on the ball and stays there.
const TOE_FIRST: f32 = 0.25;

/// Swing: u, pitch in degrees, height of the ball over its stance in centimetres; forward, level, backward.
const SWING: [(f32, [f32; 3], [f32; 3]); 8] = [
    (0.127, [-43.0, -20.0, 1.5], [5.2, 1.6, 1.2]),
    (0.218, [-50.0, -20.0, 3.5], [8.3, 3.2, 2.9]),
    (0.31, [-45.0, -16.0, 5.0], [8.9, 4.5, 4.4]),
    (0.40, [-33.0, -11.0, 1.0], [6.9, 4.9, 4.9]),
    (0.49, [-17.0, -6.0, -6.0], [4.4, 4.6, 4.5]),
    (0.58, [1.0, -1.0, -12.5], [3.6, 3.8, 3.2]),
    (0.67, [18.0, 3.0, -16.0], [6.2, 2.4, 1.3]),
    (STRIKE, [25.0, 4.5, -15.0], [8.0, 1.4, 0.0]),
];

/// After the strike: share of the way to the flat foot, pitch in degrees.
const FLATTEN: [(f32, [f32; 3]); 3] =
    [(0.40, [15.0, 3.0, -9.0]), (0.77, [4.0, 0.8, -2.2]), (1.0, [0.0, 0.0, 0.0])];

/// Progress of the ball from one foothold to the next in a forward step.
const PROGRESS: [(f32, f32); 10] = [
    (0.0, 0.0),
    (0.127, 0.034),
    (0.218, 0.112),
    (0.31, 0.234),
    (0.40, 0.384),
    (0.49, 0.555),
    (0.58, 0.732),
    (0.67, 0.892),
    (STRIKE, 0.989),
    (0.84, 1.0),
];

/// A foot at one moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct FootSample {
    /// The Toe joint, world.
    pub ball: Vec3,
    pub yaw: f32,
    /// Radians, toe up positive.
    pub pitch: f32,
    /// Radians that the toes are bent up against the foot.
    pub toe_bend: f32,
    /// The ball rests.
    pub planted: bool,
}

impl FootSample {
    /// The foot's rotation in the world.
    pub(super) fn rotation(&self) -> Quat {
        Quat::from_rotation_z(self.yaw) * Quat::from_rotation_x(-self.pitch)
    }

    /// The Foot joint, world.
    pub(super) fn ankle(&self) -> Vec3 {
        self.ball - self.rotation() * JOINT_OFFSET[Joint::LeftToe.index()]
    }
}

/// Height of the Toe joint over its stance when a foot pitched toe up rests on its heel, and the slope.
fn heel_rest(pitch: f32) -> (f32, f32) {
    if pitch <= 0.0 {
        return (0.0, 0.0);
    }
    let height = HEEL_TO_BALL * pitch.sin() + TOE_HEIGHT * (pitch.cos() - 1.0);
    (height, HEEL_TO_BALL * pitch.cos() - TOE_HEIGHT * pitch.sin())
}

/// One flight from foothold to foothold, with the heel rise before and the flattening after.
struct Flight {
    rise: f32,
    lift: f32,
    land: f32,
    flat: f32,
    from: Foothold,
    to: Foothold,
    /// -1 back, 0 level, 1 a full forward step.
    forward: f32,
    /// Over time, radians.
    pitch: Spline,
    /// Over u, metres.
    height: Spline,
    /// Sideways detour round the standing leg, metres, and the progress at which it is widest.
    detour: Vec2,
    widest: f32,
}

/// Forward, level or backward table value.
fn blend(values: [f32; 3], forward: f32) -> f32 {
    if forward >= 0.0 { mix(values[1], values[0], forward) } else { mix(values[1], values[2], -forward) }
}

impl Flight {
    /// `effort`: how high the foot is lifted and how far the heel is, 1 in walking; `wider`: metres that the foot goes further
    /// round the standing leg than the feet alone need.
    fn new(
        from: Foothold,
        step: &Step,
        earliest_rise: f32,
        other: Foothold,
        effort: f32,
        wider: f32,
    ) -> Self {
        let &Step { lift, land, to, .. } = step;
        let swing = land - lift;
        let rise = (lift - (0.6 * swing).clamp(0.16, 0.40)).max(earliest_rise);
        let (a, b) = (ball_of(&from), ball_of(&to));
        let heading = 0.5 * (from.yaw + to.yaw);
        let ahead = (b - a).dot(rotate(heading, Vec2::NEG_Y));
        let forward = if ahead >= 0.0 { (ahead / 0.75).min(1.0) } else { (ahead / 0.35).max(-1.0) };
        let forward = forward.signum() * forward.abs().powf(0.8);

        let behind = (ball_of(&other) - a).dot(rotate(heading, Vec2::NEG_Y));
        let trails = (behind / (TRAILS * ahead.max(0.1))).clamp(0.0, 1.0);
        let pushed = mix(mix(1.0, FROM_BESIDE, forward.max(0.0).sqrt()), 1.0, trails);

        // Backwards, the heel comes down slowly.
        let flat = land + swing * mix((1.0 - STRIKE) / STRIKE, 0.55, (-forward).max(0.0));
        let time = |u: f32| lift + u / STRIKE * swing;
        let degrees = |v: [f32; 3]| {
            let pitch = effort * blend(v, forward).to_radians();
            if pitch < 0.0 { pushed * pitch } else { pitch }
        };
        let mut knots = vec![(rise, 0.0)];
        knots.extend(RISE.iter().map(|&(v, p)| (mix(rise, lift, v), degrees(p))));
        knots.extend(SWING.iter().map(|&(u, p, _)| (time(u), degrees(p))));
        knots.extend(FLATTEN.iter().map(|&(v, p)| (mix(land, flat, v), degrees(p))));
        let pitch = Spline::new(&knots, (0.0, 0.0));

        let strike_pitch = pitch.at(land);
        let pitch_slope = (pitch.at(land + 0.002) - pitch.at(land - 0.002)) / 0.004 * swing / STRIKE;
        let (strike_height, slope) = heel_rest(strike_pitch);
        // A short step does not lift as high.
        let reach = effort * ((b - a).length() / 0.3).clamp(0.55, 1.0);
        let mut knots = vec![(0.0, 0.0)];
        knots.extend(
            SWING[..SWING.len() - 1].iter().map(|&(u, _, h)| (u, reach * pushed * blend(h, forward) * 0.01)),
        );
        knots.push((STRIKE, strike_height));
        let height = Spline::new(&knots, (0.0, slope * pitch_slope));

        // The swinging foot goes round the standing one, on its own side.
        let centre = |h: &Foothold| h.ankle + h.forward() * 0.5 * BALL;
        let (c0, c1, around) = (centre(&from), centre(&to), centre(&other));
        let ahead = rotate(heading, Vec2::NEG_Y);
        let outward = rotate(heading, Vec2::new(if step.side == 0 { 1.0 } else { -1.0 }, 0.0));
        let short_of_room = |s: f32| {
            let from_other = c0.lerp(c1, s) - around;
            // Where the feet are abreast; one ahead of the other needs no room beside it.
            let abreast = 1.0 - (from_other.dot(ahead).abs() / 0.25).min(1.0);
            (ROOM - from_other.dot(outward)).max(0.0) * abreast
        };
        let nearest = (1..20).map(|i| short_of_room(i as f32 / 20.0)).fold(0.0, f32::max);
        let way = c1 - c0;
        let passing = (around - c0).dot(way) / way.length_squared().max(1e-4);
        Self {
            rise,
            lift,
            land,
            flat,
            from,
            to,
            forward,
            pitch,
            height,
            detour: outward * (nearest + wider),
            widest: passing.clamp(0.3, 0.7),
        }
    }

    /// How much of the detour is gone at some progress: none at both ends.
    fn aside(&self, progress: f32) -> f32 {
        let part = if progress < self.widest {
            progress / self.widest
        } else {
            (1.0 - progress) / (1.0 - self.widest)
        };
        (0.5 * PI * part).sin().powi(2)
    }

    fn sample(&self, t: f32) -> FootSample {
        let u = if t < self.land {
            (t - self.lift) / (self.land - self.lift) * STRIKE
        } else {
            STRIKE + (t - self.land) / (self.flat - self.land) * (1.0 - STRIKE)
        };
        let (a, b) = (ball_of(&self.from), ball_of(&self.to));
        let pitch = self.pitch.at(t);
        let pitch = if u <= 0.0 { pitch.min(0.0) } else { pitch };
        let yaw = mix(self.from.yaw, self.to.yaw, ease(u, 0.06, 0.76));
        let backward = (-self.forward).max(0.0);
        // The toes lie flat until the lift and, where they touch first, from the landing.
        let toe_weight = ease(u, 0.5, STRIKE).max(1.0 - ease(u, 0.0, 0.36));
        let toe_bend = (-pitch).max(0.0) * toe_weight;
        let (rest, _) = heel_rest(pitch);
        let planted_at_landing = backward > TOE_FIRST && u >= STRIKE && pitch <= 0.0;
        if u <= 0.0 || u >= 1.0 || planted_at_landing {
            let at = if u <= 0.0 { a } else { b };
            return FootSample { ball: at.extend(TOE_HEIGHT), yaw, pitch, toe_bend, planted: true };
        }
        let gait = PROGRESS_SPLINE.at(u);
        let even = minimum_jerk(u / mix(0.92, STRIKE, (backward / TOE_FIRST).min(1.0)));
        let s = mix(even, gait, self.forward.max(0.0));
        let mut at = a.lerp(b, s) + self.detour * self.aside(s);
        if u > 0.4 && pitch > 0.0 {
            // Resting on the heel, the ball is behind where it will lie.
            let back = HEEL_TO_BALL * (1.0 - pitch.cos()) + TOE_HEIGHT * pitch.sin();
            at -= rotate(yaw, Vec2::NEG_Y) * back;
        }
        // Neither the heel nor the tip of the toes, bent less than the foot is pitched, enters the floor.
        let droop = (-pitch - toe_bend).max(0.0);
        let rest = rest.max(TOE_LENGTH * droop.sin() - TOE_HEIGHT * (1.0 - droop.cos()));
        let lifted = if u < STRIKE { soft_maximum(self.height.at(u), rest, 0.004) } else { rest };
        FootSample { ball: at.extend(TOE_HEIGHT + lifted.max(0.0)), yaw, pitch, toe_bend, planted: false }
    }
}

static PROGRESS_SPLINE: LazyLock<Spline> = LazyLock::new(|| Spline::new(&PROGRESS, (0.0, 0.0)));

/// The whole path of one foot.
pub(super) struct FootTrack {
    first: Foothold,
    flights: Vec<Flight>,
}

impl FootTrack {
    /// `wider`: for each of the foot's steps, in order, how much further it goes round the other leg, metres.
    pub(super) fn new(plan: &Plan, side: usize, wider: &[f32]) -> Self {
        let mut now = plan.feet;
        let mut flights: Vec<Flight> = Vec::new();
        for step in &plan.steps {
            if step.side == side {
                let earliest = flights.last().map_or(f32::NEG_INFINITY, |f| f.flat);
                let effort = if plan.is_seated(step) { SHUFFLE } else { 1.0 };
                let wider = wider.get(flights.len()).copied().unwrap_or(0.0);
                flights.push(Flight::new(now[side], step, earliest, now[1 - side], effort, wider));
            }
            now[step.side] = step.to;
        }
        Self { first: plan.feet[side], flights }
    }

    pub(super) fn sample(&self, t: f32) -> FootSample {
        let next = self.flights.partition_point(|f| f.rise <= t);
        match next.checked_sub(1).map(|i| &self.flights[i]) {
            Some(flight) if t < flight.flat => flight.sample(t),
            past => {
                let hold = past.map_or(self.first, |f| f.to);
                let ball = ball_of(&hold).extend(TOE_HEIGHT);
                FootSample { ball, yaw: hold.yaw, pitch: 0.0, toe_bend: 0.0, planted: true }
            }
        }
    }

    /// The step that the foot is making at `t`, by number.
    pub(super) fn step_at(&self, t: f32) -> Option<usize> {
        self.flights.iter().position(|f| (f.rise..f.flat).contains(&t))
    }

    pub(super) fn steps(&self) -> usize {
        self.flights.len()
    }

    /// Where the foot stands or is about to land at `t`.
    pub(super) fn foothold(&self, t: f32) -> Foothold {
        let past = self.flights.partition_point(|f| f.lift <= t);
        past.checked_sub(1).map_or(self.first, |i| self.flights[i].to)
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::Planner;
    use super::super::style::Style;
    use super::*;
    use crate::motion::skeleton::ANKLE_HEIGHT;

    fn plans() -> Vec<Plan> {
        let mut walk = Planner::new(Style::plain(), 0);
        walk.start(1.2, 0.0).walk(6, 1.2, 0.2).stop(1.2).stand(1.0);
        let mut turn = Planner::new(Style::plain(), 1);
        turn.stand(0.6).turn_on_spot(-1.6, 2).stand(0.5).side_step(0.3, 0.45).stand(0.5);
        let mut back = Planner::new(Style::plain(), 1);
        back.stand(0.6).back_step(0.3, 0.5, 0.0).back_step(0.3, 0.5, 0.0).close(0.5).stand(1.0);
        [walk, turn, back].map(Planner::finish).into()
    }

    #[test]
    fn no_point_of_the_sole_enters_the_floor() {
        for plan in plans() {
            for side in 0..2 {
                let track = FootTrack::new(&plan, side, &[]);
                for i in 0..(plan.duration * 200.0) as usize {
                    let f = track.sample(i as f32 / 200.0);
                    let heel = f.ankle() + f.rotation() * Vec3::new(0.0, HEEL_LENGTH, -ANKLE_HEIGHT);
                    let toe = f.rotation() * Quat::from_rotation_x(-f.toe_bend);
                    let tip = f.ball + toe * Vec3::new(0.0, -TOE_LENGTH, -TOE_HEIGHT);
                    let sole = f.ball + toe * Vec3::new(0.0, 0.0, -TOE_HEIGHT);
                    for (name, point) in [("heel", heel), ("tip", tip), ("ball", sole)] {
                        assert!(
                            point.z > -0.001,
                            "{name} {point} at {} s of {side}: {f:?}",
                            i as f32 / 200.0
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn planted_balls_rest_and_nothing_jumps() {
        for plan in plans() {
            for side in 0..2 {
                let track = FootTrack::new(&plan, side, &[]);
                let step = 1.0 / 240.0;
                let samples: Vec<_> =
                    (0..(plan.duration / step) as usize).map(|i| track.sample(i as f32 * step)).collect();
                for w in samples.windows(3) {
                    if w[0].planted && w[1].planted {
                        assert!(w[0].ball.distance(w[1].ball) < 1e-5);
                    }
                    let acceleration = (w[2].ball - 2.0 * w[1].ball + w[0].ball) / (step * step);
                    assert!(acceleration.length() < 120.0, "{acceleration} {:?}", w[1]);
                    let pitch = (w[2].pitch - 2.0 * w[1].pitch + w[0].pitch) / (step * step);
                    assert!(pitch.abs() < 700.0, "{pitch} {:?}", w[1]);
                }
            }
        }
    }
}
