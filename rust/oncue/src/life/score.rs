//! What moves in who sits or stands about, and when: drawn once for a whole hold, then played frame by frame.
//!
//! Who has sat down settles first, each take in its own way.

use std::f32::consts::TAU;
use std::ops::Range;

use glam::{Vec2, Vec3};
use rand::RngExt;
use rand_pcg::Pcg64;

use crate::math::curve::least_jerk;

/// Breaths a second, and by how much these differ from person to person.
const BREATHS: (f32, f32) = (0.25, 0.04);
/// Knots of the slow sway a second, and of the quicker one over it.
const SWAY_RATES: [f32; 2] = [0.45, 1.1];
/// Seconds between two looks, two shifts of the weight, and two stirs of a hand.
const LOOKS_EVERY: Range<f32> = 1.6..5.0;
const SHIFTS_EVERY: Range<f32> = 1.5..5.5;
const STIRS_EVERY: Range<f32> = 0.8..3.5;
/// Seconds that a look, a shift and a stir take; a look takes longer the farther it goes, seconds for each radian.
pub(super) const LOOK_SECONDS: f32 = 0.45;
pub(super) const LOOK_SECONDS_PER_RADIAN: f32 = 0.8;
const SHIFT_SECONDS: Range<f32> = 1.1..1.9;
const STIR_SECONDS: Range<f32> = 0.7..1.2;
/// One look in so many goes far.
const FAR_LOOKS: f32 = 0.4;
/// The chest comes round after a look by so long, seconds.
pub(super) const CHEST_FOLLOWS: f32 = 0.25;

/// How takes settle: whether against the back of the seat and with which hands on its arms, where it has such; trunk forwards and to the left side, radians; left
/// and right foot forwards, metres; hands along the thighs, metres. Takes beside each other differ in most of it.
const SETTLINGS: [Settling; 5] = [
    Settling {
        leans_back: false,
        armrests: [false, false],
        trunk: [0.34, -0.03],
        feet: [-0.08, 0.03],
        hands: [0.06, 0.07],
    },
    Settling {
        leans_back: true,
        armrests: [true, true],
        trunk: [0.0, 0.03],
        feet: [0.15, 0.05],
        hands: [-0.06, -0.04],
    },
    Settling {
        leans_back: true,
        armrests: [false, true],
        trunk: [0.05, 0.14],
        feet: [0.03, 0.18],
        hands: [0.05, -0.06],
    },
    Settling {
        leans_back: false,
        armrests: [true, false],
        trunk: [0.19, -0.13],
        feet: [0.13, -0.09],
        hands: [-0.05, 0.07],
    },
    Settling {
        leans_back: true,
        armrests: [true, true],
        trunk: [0.08, 0.02],
        feet: [-0.10, -0.07],
        hands: [0.01, 0.0],
    },
];
/// How much of each of these differs from take to take besides, radians and metres.
const SETTLINGS_VARY: f32 = 0.025;
/// Seconds in which trunk and hands settle, in which each foot is set, and after which; how high it is lifted, metres and for
/// each metre of its way.
const SETTLES_IN: f32 = 0.95;
const FOOT_SECONDS: f32 = 0.5;
const FEET_AT: [f32; 2] = [0.10, 0.65];
const FOOT_LIFTS: (f32, f32) = (0.008, 0.07);
/// While a foot is off the floor the trunk goes back and to the other side by so much, radians; lifted so high half of its
/// weight is gone, metres.
const BALANCES: (f32, f32) = (0.02, 0.06);
const OFF_THE_FLOOR: f32 = 0.012;
/// A foot that is nearer to its place than this is not set anew, metres.
const STANDS: f32 = 0.025;

#[derive(Debug, Clone, Copy, Default)]
struct Settling {
    leans_back: bool,
    armrests: [bool; 2],
    trunk: [f32; 2],
    feet: [f32; 2],
    hands: [f32; 2],
}

/// From one value to the next with the least jerk, and a bump on the way.
#[derive(Debug, Clone, Default)]
struct Moves(Vec<Move>);

#[derive(Debug, Clone, Copy)]
struct Move {
    at: f32,
    seconds: f32,
    to: Vec3,
    bump: f32,
}

impl Moves {
    fn add(&mut self, at: f32, seconds: f32, to: Vec3, bump: f32) {
        self.0.push(Move { at, seconds, to, bump });
    }

    /// The value at `t` seconds, and the height of the bump.
    fn at(&self, t: f32) -> (Vec3, f32) {
        self.0.iter().take_while(|m| m.at <= t).fold((Vec3::ZERO, 0.0), |(value, bump), m| {
            let u = ((t - m.at) / m.seconds).min(1.0);
            (value.lerp(m.to, least_jerk(u)), bump + m.bump * 16.0 * (u * (1.0 - u)).powi(2))
        })
    }
}

/// Noise that knows no frequency above its knots': cubics through random values.
#[derive(Debug, Clone)]
struct Noise {
    rate: f32,
    knots: Vec<f32>,
}

impl Noise {
    fn new(seconds: f32, rate: f32, random: &mut Pcg64) -> Self {
        let knots = (0..(seconds * rate) as usize + 5).map(|_| random.random_range(-1.0f32..1.0)).collect();
        Self { rate, knots }
    }

    fn at(&self, t: f32) -> f32 {
        let x = (t * self.rate).clamp(0.0, self.knots.len() as f32 - 4.5);
        let (i, u) = (x as usize, x.fract());
        let k = |d: usize| self.knots[i + d];
        // Uniform cubic B-spline: two continuous derivatives.
        (k(0) * (1.0 - u).powi(3)
            + k(1) * (3.0 * u.powi(3) - 6.0 * u * u + 4.0)
            + k(2) * (-3.0 * u.powi(3) + 3.0 * u * u + 3.0 * u + 1.0)
            + k(3) * u.powi(3))
            / 6.0
    }
}

/// What one person does during one hold.
#[derive(Debug, Clone)]
pub(super) struct Score {
    size: f32,
    breaths: (f32, f32),
    sway: [[Noise; 2]; 5],
    /// Trunk forwards and to the left, pelvis to the left side.
    shifts: Moves,
    /// Head to the left and down, seen from the pelvis.
    looks: Moves,
    /// A hand along the thigh and inwards; arms that hang: forwards, and bent.
    stirs: [Moves; 2],
    /// Each knee outwards.
    knees: [Moves; 2],
    settling: Settling,
    /// Each foot to the left and forwards.
    feet: [Moves; 2],
}

/// How a foot is set elsewhere at one time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct FootMoment {
    /// To the left and forwards, metres.
    pub moved: Vec2,
    /// How high it is, metres.
    pub lifted: f32,
    pub in_the_air: bool,
}

/// What moves at one time. Turns in radians, about where the body is without.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Moment {
    /// −1 breathed out, 1 breathed in, times the size.
    pub breath: f32,
    /// Trunk: forwards, to the left side, to the left about the vertical.
    pub trunk: Vec3,
    /// How far the weight is on the left side: −1 to 1, times the size.
    pub weight: f32,
    /// Where the head turns from straight ahead: to the left, down.
    pub look: (f32, f32),
    /// Hands: shares of the way along and inwards, and how high they are lifted, −1 to 1, times the size.
    pub hands: [Vec3; 2],
    /// Knees, outwards, radians.
    pub knees: [f32; 2],
    /// How the body settles: trunk forwards and to the left side, radians; hands along the thighs, metres.
    pub settled: Vec2,
    pub hands_settle: [f32; 2],
    pub feet: [FootMoment; 2],
}

impl Score {
    /// `size`: of everything that goes on, 1 as usual; what is larger also comes more often. `take`: by which the body settles.
    pub(super) fn new(seconds: f32, size: f32, take: u64, random: &mut Pcg64) -> Self {
        let signed = |random: &mut Pcg64, most: f32| random.random_range(-most..=most);
        let often = size.clamp(0.4, 2.0).sqrt();
        let mut score = Self {
            size,
            breaths: (BREATHS.0 + signed(random, BREATHS.1), random.random_range(0.0..TAU)),
            sway: std::array::from_fn(|_| SWAY_RATES.map(|rate| Noise::new(seconds, rate, random))),
            shifts: Moves::default(),
            looks: Moves::default(),
            stirs: Default::default(),
            knees: Default::default(),
            settling: SETTLINGS[(take % SETTLINGS.len() as u64) as usize],
            feet: Default::default(),
        };
        let settling = &mut score.settling;
        for value in settling.trunk.iter_mut().chain(&mut settling.hands).chain(&mut settling.feet) {
            *value += signed(random, SETTLINGS_VARY);
        }
        let first = random.random_range(0..2usize);
        for (side, ahead) in score.settling.feet.into_iter().enumerate() {
            let to = Vec3::new(signed(random, SETTLINGS_VARY), ahead, 0.0);
            let lifts = FOOT_LIFTS.0 + FOOT_LIFTS.1 * to.length();
            if to.length() > STANDS {
                score.feet[side].add(FEET_AT[usize::from(side != first)], FOOT_SECONDS, to, lifts);
            }
        }
        // The first of each comes soon: nobody sits down and is still.
        let mut t = random.random_range(0.2..1.2);
        while t < seconds {
            let far = random.random_range(0.0..1.0) < FAR_LOOKS;
            let yaw = signed(random, if far { 0.65 } else { 0.20 });
            let before = score.looks.at(t).0.x;
            let to = Vec3::new(yaw, random.random_range(-0.06..0.14), 0.0);
            score.looks.add(t, LOOK_SECONDS + LOOK_SECONDS_PER_RADIAN * (yaw - before).abs(), to, 0.0);
            t += 0.4 + random.random_range(LOOKS_EVERY) / often;
        }
        let mut t = random.random_range(0.6..3.0);
        let mut side = if random.random_range(0..2) == 0 { 1.0 } else { -1.0 };
        while t < seconds {
            let weight = side * random.random_range(0.35..1.0);
            let to = Vec3::new(random.random_range(-0.09..0.13), 0.11 * weight, weight);
            let takes = random.random_range(SHIFT_SECONDS);
            score.shifts.add(t, takes, to, 0.0);
            // With the weight goes a knee.
            let knee = random.random_range(0..2usize);
            score.knees[knee].add(t + 0.2, takes, Vec3::X * random.random_range(-0.10..0.20), 0.0);
            side = if random.random_range(0.0..1.0) < 0.7 { -side } else { side };
            t += takes + random.random_range(SHIFTS_EVERY) / often;
        }
        for hand in 0..2 {
            let mut t = random.random_range(0.3..4.0);
            while t < seconds {
                let to = Vec3::new(signed(random, 1.0), signed(random, 1.0), 0.0);
                let takes = random.random_range(STIR_SECONDS);
                score.stirs[hand].add(t, takes, to, random.random_range(0.25..1.0));
                t += takes + random.random_range(STIRS_EVERY) / often;
            }
        }
        score
    }

    /// Whether who sits in this take leans back where the seat has a back.
    pub(super) fn leans_back(&self) -> bool {
        self.settling.leans_back
    }

    /// Which hands come to lie on the arms of the seat in this take, where it has some.
    pub(super) fn armrests(&self) -> [bool; 2] {
        self.settling.armrests
    }

    pub(super) fn at(&self, t: f32) -> Moment {
        let sway = |k: usize| 0.75 * self.sway[k][0].at(t) + 0.35 * self.sway[k][1].at(t);
        let phase = TAU * self.breaths.0 * t + self.breaths.1;
        // Breathing in takes two fifths of a breath.
        let breath = (phase + 0.25 * phase.sin()).sin();
        let shift = self.shifts.at(t).0;
        let look = self.looks.at(t).0;
        let follows = self.looks.at(t - CHEST_FOLLOWS).0.x;
        let trunk =
            Vec3::new(0.115 * sway(0) + shift.x, 0.100 * sway(1) + shift.y, 0.070 * sway(2) + 0.22 * follows);
        let stir = |side: usize| {
            let (place, lifted) = self.stirs[side].at(t);
            self.size * place.with_z(lifted)
        };
        let settled = least_jerk(t / SETTLES_IN);
        let foot = |side: usize| {
            let (moved, lifted) = self.feet[side].at(t);
            let in_the_air = self.feet[side].0.iter().any(|m| t > m.at && t < m.at + m.seconds);
            FootMoment { moved: moved.truncate(), lifted, in_the_air }
        };
        let feet = [foot(0), foot(1)];
        let off = feet.map(|foot| foot.lifted.powi(2) / (foot.lifted.powi(2) + OFF_THE_FLOOR.powi(2)));
        let balances = Vec2::new(-BALANCES.0 * off[0].max(off[1]), BALANCES.1 * (off[1] - off[0]));
        let knee = |side: usize| self.size * (self.knees[side].at(t).0.x + 0.10 * sway(3 + side));
        Moment {
            breath: self.size * breath,
            trunk: self.size * trunk,
            weight: self.size * shift.z,
            look: (
                self.size.min(1.3) * look.x + 0.02 * sway(2),
                self.size.min(1.3) * look.y + 0.02 * sway(0),
            ),
            hands: [stir(0), stir(1)],
            knees: [knee(0), knee(1)],
            settled: Vec2::from(self.settling.trunk) * settled + balances,
            hands_settle: self.settling.hands.map(|along| along * settled),
            feet,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn score(seed: u64, size: f32) -> Score {
        Score::new(60.0, size, seed, &mut Pcg64::seed_from_u64(seed))
    }

    #[test]
    fn moves_by_hand() {
        let mut moves = Moves::default();
        moves.add(1.0, 2.0, Vec3::X, 0.5);
        moves.add(5.0, 1.0, Vec3::ZERO, 0.0);
        assert_eq!(moves.at(0.9), (Vec3::ZERO, 0.0));
        // Half-way there, at the top of the bump.
        assert!((moves.at(2.0).0 - Vec3::X * 0.5).length() < 1e-6 && (moves.at(2.0).1 - 0.5).abs() < 1e-6);
        assert!((moves.at(4.0).0 - Vec3::X).length() < 1e-6 && moves.at(4.0).1.abs() < 1e-6);
        assert!(moves.at(7.0).0.length() < 1e-6);
    }

    #[test]
    fn who_is_held_goes_on_moving_to_the_end() {
        for seed in 0..20 {
            let score = score(seed, 1.0);
            let moments: Vec<Moment> = (0..1800).map(|f| score.at(f as f32 / 30.0)).collect();
            for tenth in moments.chunks(300) {
                let range = |f: &dyn Fn(&Moment) -> f32| {
                    let values = tenth.iter().map(f);
                    values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min)
                };
                assert!(range(&|m| m.look.0) > 0.03 && range(&|m| m.breath) > 1.9, "{seed}");
                assert!(range(&|m| m.trunk.x) > 0.005 && range(&|m| m.trunk.y) > 0.005, "{seed}");
                assert!(range(&|m| m.hands[0].x) + range(&|m| m.hands[1].x) > 0.05, "{seed}");
            }
            // Nothing jumps.
            for w in moments.windows(3) {
                let rate = (w[1].look.0 - w[0].look.0).abs() * 30.0;
                let kink = (w[2].look.0 - 2.0 * w[1].look.0 + w[0].look.0).abs() * 900.0;
                assert!(rate < 2.6 && kink < 22.0, "{seed}: {rate} rad/s, {kink} rad/s²");
                assert!((w[1].trunk - w[0].trunk).length() * 30.0 < 0.7, "{seed}");
            }
        }
    }

    #[test]
    fn seeds_differ_and_livelier_is_more() {
        let mean = |score: &Score| {
            let trunk = (0..1800).map(|f| score.at(f as f32 / 30.0).trunk.length());
            trunk.sum::<f32>() / 1800.0
        };
        let of = |size: f32| (0..20).map(|seed| mean(&score(seed, size))).sum::<f32>();
        assert!(of(0.4) < 0.6 * of(1.0) && of(1.6) > 1.4 * of(1.0));
        assert_eq!(score(3, 1.0).at(20.0), score(3, 1.0).at(20.0));
        assert_ne!(score(3, 1.0).at(20.0), score(4, 1.0).at(20.0));
    }
}
