//! The footstep plan: where each foot stands, when it lifts and when it lands.
//!
//! Walking speed sets step length and cadence: length grows with about the 0.58th power of speed (Grieve & Gear 1966),
//! double support shrinks with speed (Murray et al. 1966; Winter 1991), feet land about 0.1 m apart and toe out by
//! 5–7° (Murray et al. 1964).

use glam::Vec2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::curve::{ease, mix};
use super::style::Style;
use crate::math::planar::rotate;
use crate::motion::Joint;
use crate::motion::skeleton::JOINT_OFFSET;

/// Where a foot stands: its ankle's projection on the floor, and its yaw (not wrapped).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Foothold {
    pub ankle: Vec2,
    pub yaw: f32,
}

/// The Toe joint of a flat foot on `hold`.
pub(super) fn ball_of(hold: &Foothold) -> Vec2 {
    hold.ankle + hold.forward() * BALL
}

impl Foothold {
    pub(super) fn forward(&self) -> Vec2 {
        rotate(self.yaw, Vec2::NEG_Y)
    }
}

/// One step of one foot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    /// 0 left, 1 right.
    pub side: usize,
    /// The ball of the foot leaves the floor, seconds.
    pub lift: f32,
    /// First touch, seconds.
    pub land: f32,
    pub to: Foothold,
}

/// The way down to a seat or up from it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seating {
    pub down: bool,
    /// Seconds: the trunk begins to move.
    pub start: f32,
    /// Seconds: seated (down) or upright (up).
    pub end: f32,
    /// Seconds: seated and facing as one stays; later than `end` where the person swivels on the seat.
    pub settled: f32,
}

/// The seat that a clip uses, and where the pelvis rests on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seat {
    /// Metres.
    pub height: f32,
    /// See [`super::seat::seated_legs`], radians.
    pub tuck: f32,
    /// Pelvis joint's place on the floor on reaching the seat.
    pub pelvis: Vec2,
    /// How far the pelvis moves on the seat while the person turns on it.
    pub shift: Vec2,
    /// There is a table: the hands rest in the lap, not towards the knees.
    pub at_table: bool,
    /// How far each knee is turned outwards in the end, radians.
    pub spread: f32,
}

/// All that the motion of one clip follows from.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub style: Style,
    /// Where the feet stand at time 0, left and right.
    pub feet: [Foothold; 2],
    /// In order of time; one foot is in the air at a time.
    pub steps: Vec<Step>,
    pub duration: f32,
    pub seat: Option<Seat>,
    /// In order of time. Without any, a clip with a seat is seated throughout.
    pub seatings: Vec<Seating>,
    /// Seconds: a seated person sits otherwise from here on.
    pub stirs: Option<f32>,
}

impl Plan {
    /// How far a seated person has turned on the seat at `t` seconds: 0 to 1.
    pub(super) fn swivelled(&self, t: f32) -> f32 {
        self.swivel_time().map_or(1.0, |(from, to)| ease(t, from, to))
    }

    /// From when to when a person turns on the seat, seconds.
    fn swivel_time(&self) -> Option<(f32, f32)> {
        let turning = self.seatings.iter().find(|s| s.down && s.settled > s.end)?;
        Some((mix(turning.start, turning.end, SWIVEL_FROM), turning.settled - SETTLE_SECONDS))
    }

    /// Where the pelvis joint rests on `seat` at `t` seconds.
    pub(super) fn seat_place(&self, seat: &Seat, t: f32) -> Vec2 {
        let moved = match self.swivel_time() {
            // Who has no room for the knees moves in once they are past what is ahead.
            Some((from, to)) if seat.spread > 0.0 => {
                ease(t, mix(from, to, MOVE_IN_FROM), to + SETTLE_SECONDS)
            }
            _ => self.swivelled(t),
        };
        seat.pelvis + seat.shift * moved
    }

    /// How far a seated person has come to sit otherwise at `t` seconds: 0 to 1.
    pub(super) fn stirred(&self, t: f32) -> f32 {
        self.stirs.map_or(0.0, |at| ease(t, at, at + STIRRING_SECONDS))
    }

    /// How far each knee is turned outwards at `t` seconds, radians.
    pub(super) fn knee_spread(&self, t: f32) -> f32 {
        self.seat.map_or(0.0, |seat| seat.spread * ease(self.swivelled(t), 0.0, KNEES_PAST))
    }

    /// The steps that carry the body: those of a seated person do not.
    pub(super) fn standing_steps(&self) -> impl Iterator<Item = &Step> {
        self.steps.iter().filter(|step| !self.is_seated(step))
    }

    /// Whether the person sits while taking this step, or a seat all but carries them.
    pub(super) fn is_seated(&self, step: &Step) -> bool {
        let part = |s: &Seating| (step.lift - s.start) / (s.end - s.start);
        match self.seatings.iter().rev().find(|s| s.start < step.lift) {
            Some(s) if s.down => part(s) >= FEET_FREE.0,
            Some(s) => part(s) < FEET_FREE.1,
            None => self.seat.is_some() && self.seatings.first().is_none_or(|s| !s.down),
        }
    }
}

/// From where on the way down, and until where on the way up, feet are set without carrying the body.
const FEET_FREE: (f32, f32) = (0.14, 0.3);

/// Seconds before a foot leaves the floor that it pushes the weight off to the other, and that the weight is there.
pub(super) const WEIGHT_SHIFT: (f32, f32) = (0.56, 0.10);
/// Seconds that it takes to sit otherwise.
const STIRRING_SECONDS: f32 = 1.3;
/// Metres between the ankles while standing.
pub(super) const STANDING_WIDTH: f32 = 0.17;
/// Metres between the ankles while walking.
pub(super) const WALKING_WIDTH: f32 = 0.115;
/// From the ankle to the ball of the foot along the sole, metres.
pub(super) const BALL: f32 = -JOINT_OFFSET[Joint::LeftToe.index()].y;
const TOE_OUT: f32 = 0.11;
/// The longest swing of a small step: seconds, and for each metre that the ball of the foot moves.
const SHORTEST_SWING: f32 = 0.26;
const SWING_PER_METRE: f32 = 0.45;
/// Share of the way down after which a person may turn on the seat: the weight is on it and the trunk comes up.
pub(super) const SWIVEL_FROM: f32 = 0.84;
/// Share of the turn on the seat in which knees are spread, and from which on one moves in: both have passed by then
/// what is ahead in the end.
const KNEES_PAST: f32 = 0.6;
const MOVE_IN_FROM: f32 = 0.7;
/// Seconds from the last step of the turn until all of the body has come round.
pub(super) const SETTLE_SECONDS: f32 = 0.35;

/// Step length in metres at a walking speed in m/s.
pub(super) fn step_length(speed: f32) -> f32 {
    0.70 * (speed / 1.4).powf(0.58)
}

/// Share of a step's time from one foot's touch to the lift of the other's ball; its toes leave a little later,
/// so this is about two thirds of double support.
pub(super) fn double_support_share(speed: f32) -> f32 {
    (0.38 - 0.18 * speed).clamp(0.11, 0.36)
}

/// Lays down a plan, step after step, from standing at the origin facing -Y.
pub(super) struct Planner {
    plan: Plan,
    /// The body's frame over the last foothold: place and yaw (not wrapped).
    position: Vec2,
    yaw: f32,
    /// Nothing lifts before this.
    free: f32,
    /// Time that the last foot landed.
    landed: f32,
    /// Side of the next step.
    pub next: usize,
    /// Metres between the ankles where the feet come to stand.
    pub stance: f32,
    /// No two steps are the same.
    random: Pcg64Mcg,
}

/// What one step does to the body's frame, and how fast.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stride {
    /// Metres.
    pub forward: f32,
    /// Metres.
    pub left: f32,
    /// Radians to the left.
    pub turn: f32,
    /// Metres between the ankles after it.
    pub width: f32,
    /// Seconds from lift to first touch.
    pub swing: f32,
    /// Seconds with both feet down before the lift.
    pub double_support: f32,
}

impl Planner {
    pub(super) fn new(style: Style, first_side: usize) -> Self {
        let foot = |side: usize| foothold(Vec2::ZERO, 0.0, side, STANDING_WIDTH, &style);
        let feet = [foot(0), foot(1)];
        let plan = Plan {
            style,
            feet,
            steps: Vec::new(),
            duration: 0.0,
            seat: None,
            seatings: Vec::new(),
            stirs: None,
        };
        let random = Pcg64Mcg::seed_from_u64(0x57E9_0000 + style.seed);
        Self {
            plan,
            position: Vec2::ZERO,
            yaw: 0.0,
            free: 0.0,
            landed: 0.0,
            next: first_side,
            stance: STANDING_WIDTH,
            random,
        }
    }

    /// A factor about 1.
    fn about(&mut self, spread: f32) -> f32 {
        1.0 + spread * self.random.random_range(-1.0f32..1.0)
    }

    /// Seconds so far: the last foot's landing or the end of the stand after it.
    pub(super) fn now(&self) -> f32 {
        self.free.max(self.landed)
    }

    /// Whether a step, not a stand, came last.
    pub(super) fn stepped(&self) -> bool {
        self.landed > self.free
    }

    pub(super) fn yaw(&self) -> f32 {
        self.yaw
    }

    pub(super) fn position(&self) -> Vec2 {
        self.position
    }

    pub(super) fn stand(&mut self, seconds: f32) -> &mut Self {
        self.free = self.now() + seconds;
        self
    }

    /// One step with the next foot; the other foot is next after it.
    pub(super) fn stride(&mut self, stride: Stride) -> &mut Self {
        let side = self.next;
        let heading = self.yaw + 0.5 * stride.turn;
        self.position += rotate(heading, Vec2::new(stride.left, -stride.forward));
        self.yaw += stride.turn;
        let lift = self.free.max(self.landed + stride.double_support * self.about(0.08));
        let to = foothold(self.position, self.yaw, side, stride.width, &self.plan.style);
        let from = self.foot(side);
        // A small step is a quick one.
        let way = ball_of(&to).distance(ball_of(&from));
        let land = lift + stride.swing.min(SHORTEST_SWING + SWING_PER_METRE * way) * self.about(0.035);
        self.plan.steps.push(Step { side, lift, land, to });
        self.landed = land;
        self.next = 1 - side;
        self
    }

    /// One walking step at `speed`, of `share` of that speed's length, turning by `turn`.
    pub(super) fn step(&mut self, speed: f32, share: f32, turn: f32) -> &mut Self {
        let style = self.plan.style;
        let length = step_length(speed) * style.length * self.about(0.05);
        let duration = length / speed * (0.35 + 0.65 * share);
        let both = double_support_share(speed) * duration;
        let width = WALKING_WIDTH * style.width * self.about(0.12);
        self.stride(Stride {
            forward: length * share,
            left: 0.0,
            turn,
            width,
            swing: duration - both,
            double_support: both,
        })
    }

    /// From standing: weight shifts, a shorter first step, a nearly full second.
    pub(super) fn start(&mut self, speed: f32, turn: f32) -> &mut Self {
        self.stand(WEIGHT_SHIFT.0 + 0.2);
        self.step(speed, 0.78, turn).step(speed, 0.95, 0.0)
    }

    /// `count` steps at `speed`, each turning by `turn`.
    pub(super) fn walk(&mut self, count: usize, speed: f32, turn: f32) -> &mut Self {
        for _ in 0..count {
            self.step(speed, 1.0, turn);
        }
        self
    }

    /// Two shortening steps, the second closing beside the first.
    pub(super) fn stop(&mut self, speed: f32) -> &mut Self {
        let slower = (0.8 * speed).max(0.4);
        self.step(slower, 0.72, 0.0);
        self.close(0.42)
    }

    /// The other foot comes beside the one that stands.
    pub(super) fn close(&mut self, swing: f32) -> &mut Self {
        self.stride(Stride {
            forward: 0.0,
            left: 0.0,
            turn: 0.0,
            width: self.stance,
            swing,
            double_support: 0.20,
        })
    }

    /// Turns by `total` (radians, left positive) in `count` pairs of strides, the inner foot first; the other follows it.
    fn turn_in_pairs(
        &mut self,
        total: f32,
        count: usize,
        stride: impl Fn(&Self, f32) -> Stride,
    ) -> &mut Self {
        let part = total / count as f32;
        self.next = if total > 0.0 { 0 } else { 1 };
        for turn in std::iter::repeat_n([part, 0.0], count).flatten() {
            self.stride(stride(self, turn));
        }
        self
    }

    /// Turns on the spot by `total` (radians, left positive) in `count` pairs of steps, the inner foot first.
    pub(super) fn turn_on_spot(&mut self, total: f32, count: usize) -> &mut Self {
        let swing = 0.32 + 0.12 * (total / count as f32).abs();
        self.turn_in_pairs(total, count, |planner, turn| Stride {
            forward: 0.0,
            left: 0.0,
            turn,
            width: planner.stance,
            swing,
            double_support: 0.17,
        })
    }

    /// A side step by `left` metres: out and close.
    pub(super) fn side_step(&mut self, left: f32, swing: f32) -> &mut Self {
        self.next = if left > 0.0 { 0 } else { 1 };
        for (share, both) in [(1.0, 0.2), (0.0, 0.18)] {
            self.stride(Stride {
                forward: 0.0,
                left: left * share,
                turn: 0.0,
                width: self.stance,
                swing,
                double_support: both,
            });
        }
        self
    }

    /// Turns on the seat by `total` (radians, left positive) in `count` pairs of steps round the pelvis, the inner foot
    /// first. `radius`: ankles from the pelvis joint, metres; the pelvis moves by `shift` meanwhile.
    pub(super) fn swivel(&mut self, total: f32, count: usize, radius: f32, shift: Vec2) -> &mut Self {
        self.turn_in_pairs(total, count, |planner, turn| {
            let chord = rotate(turn, Vec2::NEG_Y) - Vec2::NEG_Y;
            // What the stride does to the body's frame, seen from half-way between both headings.
            let moved = rotate(-(planner.yaw + 0.5 * turn), shift) / (2 * count) as f32;
            let local = rotate(-0.5 * turn, radius * chord) + moved;
            Stride {
                forward: -local.y,
                left: local.x,
                turn,
                width: STANDING_WIDTH,
                swing: 0.40,
                double_support: 0.08,
            }
        })
    }

    /// Feet set as one sits: apart and one ahead of the other, at the times given, after a turn by `turn` (radians, left
    /// positive) over the feet.
    pub(super) fn settle(&mut self, turn: f32, lifts: [f32; 2]) -> &mut Self {
        self.yaw += turn;
        let first = match turn {
            0.0 => self.plan.style.seated.first,
            left if left > 0.0 => 0,
            _ => 1,
        };
        for (side, lift) in [first, 1 - first].into_iter().zip(lifts) {
            let to = seated_foothold(self.position, self.yaw, side, &self.plan.style);
            self.set_foot(side, lift.max(self.landed + 0.02), to);
        }
        self
    }

    /// Feet drawn back from where one sits to where one gets up.
    pub(super) fn draw_back(&mut self, lifts: [f32; 2]) -> &mut Self {
        let first = self.plan.style.seated.first;
        for (side, lift) in [first, 1 - first].into_iter().zip(lifts) {
            let to = foothold(self.position, self.yaw, side, STANDING_WIDTH, &self.plan.style);
            self.set_foot(side, lift.max(self.landed + 0.02), to);
        }
        self
    }

    /// From now on the person sits otherwise: hands, trunk, and one foot, which comes back beside the other.
    pub(super) fn stir(&mut self, moves_a_foot: bool) -> &mut Self {
        let at = self.now();
        self.plan.stirs = Some(at);
        if moves_a_foot {
            let side = 1 - self.plan.style.seated.first;
            let mut to = self.foot(side);
            to.ankle -= 0.8 * self.plan.style.seated.stagger.abs() * to.forward();
            self.set_foot(side, at + 0.3, to);
        }
        self
    }

    /// A small step that carries nothing.
    fn set_foot(&mut self, side: usize, lift: f32, to: Foothold) {
        let from = self.foot(side);
        let land = lift + SHORTEST_SWING + 0.05 + SWING_PER_METRE * ball_of(&to).distance(ball_of(&from));
        self.plan.steps.push(Step { side, lift, land, to });
        self.landed = land;
        self.next = 1 - side;
    }

    /// Where a foot stands after all steps so far.
    fn foot(&self, side: usize) -> Foothold {
        self.plan.steps.iter().rev().find(|s| s.side == side).map_or(self.plan.feet[side], |s| s.to)
    }

    /// One step backwards by `length` metres at `speed`.
    pub(super) fn back_step(&mut self, length: f32, speed: f32, turn: f32) -> &mut Self {
        let duration = (length / speed).max(0.5);
        self.stride(Stride {
            forward: -length,
            left: 0.0,
            turn,
            width: 0.13,
            swing: 0.64 * duration,
            double_support: 0.36 * duration,
        })
    }

    /// The plan as it stands, ending now.
    pub(super) fn finish(mut self) -> Plan {
        self.plan.duration = self.now();
        self.plan
    }

    pub(super) fn style(&self) -> &Style {
        &self.plan.style
    }

    /// For what a stride cannot say: seats.
    pub(super) fn plan_mut(&mut self) -> &mut Plan {
        &mut self.plan
    }
}

/// The same of a seated person: apart and one ahead.
pub(super) fn seated_foothold(position: Vec2, yaw: f32, side: usize, style: &Style) -> Foothold {
    let sign = if side == 0 { 1.0 } else { -1.0 };
    Foothold {
        ankle: position
            + rotate(yaw, 0.5 * sign * Vec2::new(style.seated.width, -style.seated.stagger))
            + rotate(yaw, Vec2::NEG_Y) * style.seated.forth,
        yaw: yaw + sign * (TOE_OUT * style.toe_out + 0.5 * style.seated.knees),
    }
}

/// The foothold of `side` under a body frame.
pub(super) fn foothold(position: Vec2, yaw: f32, side: usize, width: f32, style: &Style) -> Foothold {
    let sign = if side == 0 { 1.0 } else { -1.0 };
    let stagger = if width < STANDING_WIDTH { 0.0 } else { style.stagger };
    Foothold {
        ankle: position + rotate(yaw, Vec2::new(sign * 0.5 * width, -sign * stagger)),
        yaw: yaw + sign * TOE_OUT * style.toe_out,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_gait_relations_hold() {
        // Murray: free speed of men about 1.5 m/s at 112 steps/min; slow walks of 0.5 m/s near 75 steps/min.
        let cadence = |v: f32| 60.0 * v / step_length(v);
        assert!((108.0..124.0).contains(&cadence(1.5)), "{}", cadence(1.5));
        assert!((66.0..86.0).contains(&cadence(0.5)), "{}", cadence(0.5));
        assert!(double_support_share(0.5) > double_support_share(1.4));
    }

    #[test]
    fn one_foot_is_in_the_air_at_a_time() {
        let mut planner = Planner::new(Style::plain(), 0);
        planner.start(1.2, 0.0).walk(6, 1.2, 0.1).stop(1.2).stand(0.5).turn_on_spot(-2.0, 2).stand(0.5);
        planner.side_step(0.3, 0.45).back_step(0.3, 0.5, 0.0);
        let plan = planner.finish();
        for pair in plan.steps.windows(2) {
            assert!(
                pair[1].lift > pair[0].land && pair[0].side != pair[1].side
                    || pair[1].lift > pair[0].land + 0.1
            );
        }
    }
}
