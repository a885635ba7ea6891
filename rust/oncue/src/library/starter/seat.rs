//! Sitting down, sitting, getting up.
//!
//! Phases and angles follow the kinematics of rising from a chair: trunk flexion first, the seat left at about a third of
//! the time while the trunk is near its greatest flexion (Schenkman et al. 1990; Nuzik et al. 1986), and of sitting down,
//! which is slower and in the reverse order (Kralj et al. 1990). Lower seats ask for more flexion (Janssen et al. 2002).
//! What differs from person to person (pace, lean, where feet and hands come to rest) is [`super::style::Manner`].

use super::curve::{ease, keyed, mix};
use super::plan::{Plan, Seating};
use crate::motion::skeleton::{ANKLE_HEIGHT, LEG_LENGTH, SEATED_HIPS_HEIGHT, STANDING_HIPS_HEIGHT};

/// The pelvis joint behind the front edge, metres.
pub(super) const PELVIS_BEHIND_EDGE: f32 = 0.22;
const HIP_BELOW_PELVIS: f32 = 0.02;

/// How the legs rest on a seat of some height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SeatedLegs {
    /// Ankles ahead of the pelvis joint, metres.
    pub ankle_ahead: f32,
    /// Height of the ankles, metres.
    pub ankle_height: f32,
    /// Radians, heel up negative.
    pub pitch: f32,
    /// The feet leave the floor.
    pub hanging: bool,
}

/// Shins this much further under the seat, radians: how one sits down where a table leaves little room.
pub(super) const TUCKED: f32 = 0.30;

/// Legs of a person on a seat of `height` metres: feet flat up to about 0.54 m, then on the balls of the feet, then
/// hanging. `tuck`: radians that the shins lean back beyond what is comfortable.
pub(super) fn seated_legs(height: f32, tuck: f32) -> SeatedLegs {
    // Shins lean back under the seat on a chair, the feet go forward on a low one.
    let shin = mix(-14.0, 7.0, ((height - 0.30) / 0.14).clamp(0.0, 1.0)).to_radians() + tuck;
    let hip = height + SEATED_HIPS_HEIGHT - HIP_BELOW_PELVIS;
    // Thighs slope down by 10° at most, else they would cut the seat's edge.
    let lowest_knee = hip - LEG_LENGTH * 10f32.to_radians().sin();
    let knee = (ANKLE_HEIGHT + LEG_LENGTH * shin.cos()).max(lowest_knee);
    let rise = (knee - hip) / LEG_LENGTH;
    let ankle_ahead = LEG_LENGTH * ((1.0 - rise * rise).sqrt() - shin.sin());
    let ankle_height = knee - LEG_LENGTH * shin.cos();
    // On the ball: the ankle turns about the Toe joint, 0.143 m away and 24.8° up from it when flat.
    let (radius, flat) = (0.060f32.hypot(0.13), 0.060f32.atan2(0.13));
    let sine = (ankle_height - (ANKLE_HEIGHT - 0.060)) / radius;
    if sine <= (flat + 0.75).sin() {
        SeatedLegs { ankle_ahead, ankle_height, pitch: flat - sine.asin(), hanging: false }
    } else {
        SeatedLegs { ankle_ahead, ankle_height, pitch: -0.30, hanging: true }
    }
}

/// How far the body is on its way to the seat.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct SeatState {
    /// 0 over the feet, 1 over the seat.
    pub back: f32,
    /// 0 standing height, 1 on the seat.
    pub down: f32,
    /// Forward lean beyond standing, radians.
    pub lean: f32,
    /// 0 arms hang, 1 hands on the thighs.
    pub hands: f32,
    /// How far hands that reach for the seat are there.
    pub reach: f32,
    /// 0 upright posture, 1 the posture of sitting (pelvis tilted back).
    pub rest: f32,
    /// 0 feet as planned, 1 as [`SeatedLegs`] has them.
    pub feet: f32,
}

const SEATED: SeatState =
    SeatState { back: 1.0, down: 1.0, lean: 0.0, hands: 1.0, reach: 0.0, rest: 1.0, feet: 1.0 };

/// Greatest forward lean on the way down, radians: the lower the seat the more. Who leans farther looks at their knees, and the
/// hands hang at the shins.
fn lean_down(height: f32) -> f32 {
    mix(62.0, 42.0, high(height)).to_radians()
}

/// Greatest forward lean on the way up, radians: far over the feet from a low seat.
fn lean_up(height: f32) -> f32 {
    mix(1.0, 0.78, ((height - 0.32) / 0.12).clamp(0.0, 1.0)) * mix(66.0, 42.0, high(height)).to_radians()
}

/// 0 on a chair, 1 on a bar stool.
fn high(height: f32) -> f32 {
    ((height - 0.42) / 0.33).clamp(0.0, 1.0)
}

/// How much of a lean the pelvis makes on the seat; the spine makes the rest.
pub(super) fn pelvis_share(height: f32) -> f32 {
    mix(0.20, 0.50, ((height - 0.31) / 0.15).clamp(0.0, 1.0))
}

/// How far anybody leans over the thighs once seated, radians.
const MOST_FORWARD: f32 = 0.26;

/// How far the trunk leans back once seated, radians, forwards where negative: far on what is as low as a sofa, not on a stool.
pub(super) fn recline(plan: &Plan) -> f32 {
    plan.seat.map_or(0.0, |seat| {
        let usual = mix(0.13, 0.02, ((seat.height - 0.38) / 0.26).clamp(0.0, 1.0));
        if seat.at_table { 0.02 } else { (usual + plan.style.seated.recline).max(-MOST_FORWARD) }
    })
}

/// Of the way down, when the pelvis begins to sink and when it rests.
const SINKING: (f32, f32) = (0.02, 0.84);
/// Fastest sink but for what leaning adds to it, m/s.
const FASTEST_SINK: f32 = 0.325;

/// Seconds from the first lean to sitting: the pelvis sinks by minimum jerk, whose fastest is 15/8 of its mean speed.
pub(super) fn way_down(height: f32, pace: f32) -> f32 {
    let drop = STANDING_HIPS_HEIGHT - height - SEATED_HIPS_HEIGHT;
    let sinking = pace * (1.875 * drop / FASTEST_SINK).clamp(1.5, 2.3);
    sinking / (SINKING.1 - SINKING.0)
}

/// The state of `plan` at `t` seconds.
pub(super) fn seat_state(plan: &Plan, t: f32) -> SeatState {
    let Some(seat) = plan.seat else { return SeatState::default() };
    let current = plan.seatings.iter().rev().find(|s| s.start <= t).or(plan.seatings.first());
    let Some(&Seating { down, start, end, .. }) = current else { return SEATED };
    let v = (t - start) / (end - start);
    let bow = plan.style.seated.bow;
    if down {
        SeatState {
            back: ease(v, 0.05, 0.72),
            down: ease(v, SINKING.0, SINKING.1),
            // Hips and knees give together; half-way down the trunk begins to come up again.
            lean: bow
                * lean_down(seat.height)
                * keyed(&[(0.02, 0.0), (0.48, 1.0), (0.53, 0.98), (0.98, 0.0)], v),
            hands: ease(v, 0.28, 0.85),
            reach: keyed(&[(0.15, 0.0), (0.53, 1.0), (0.76, 1.0), (0.98, 0.0)], v),
            rest: ease(v, 0.60, 1.0),
            feet: ease(v, 0.48, 0.95),
        }
    } else {
        SeatState {
            back: 1.0 - ease(v, 0.14, 0.84),
            down: 1.0 - ease(v, 0.26, 0.93),
            lean: bow
                * lean_up(seat.height)
                * keyed(&[(0.0, 0.0), (0.36, 1.0), (0.46, 0.97), (0.96, 0.0)], v),
            hands: 1.0 - ease(v, 0.22, 0.90),
            // From a bar stool one slides, and hands have nothing to push.
            reach: keyed(&[(0.0, 0.0), (0.22, 1.0), (0.34, 1.0), (0.64, 0.0)], v)
                * (1.0 - ease(seat.height, 0.58, 0.74)),
            rest: 1.0 - ease(v, 0.0, 0.38),
            feet: 1.0 - ease(v, 0.0, 0.34),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_of_a_chair_bend_at_right_angles() {
        let legs = seated_legs(0.45, 0.0);
        let (drop, ahead) = (0.53 - legs.ankle_height, legs.ankle_ahead);
        let knee = 2.0 * (drop.hypot(ahead) / (2.0 * LEG_LENGTH)).acos();
        assert!((75f32..100.0).contains(&knee.to_degrees()), "{}", knee.to_degrees());
        assert!(legs.pitch.abs() < 0.02 && !legs.hanging);
        assert!(seated_legs(0.30, 0.0).ankle_ahead > legs.ankle_ahead + 0.05);
        assert!(seated_legs(0.57, 0.0).pitch < -0.1 && !seated_legs(0.57, 0.0).hanging);
        assert!(seated_legs(0.75, 0.0).hanging);
        // Tucked, the feet stay flat and come back by a hand's breadth.
        let tucked = seated_legs(0.45, TUCKED);
        assert!(tucked.pitch.abs() < 0.02 && legs.ankle_ahead - tucked.ankle_ahead > 0.10);
    }
}
