//! How one clip differs from the next: small, drawn from a generator of its own.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Factors about 1, and the phases of the slow drifts of standing and breathing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Style {
    /// Step length at a speed (so cadence the other way).
    pub length: f32,
    /// Width of the track.
    pub width: f32,
    pub toe_out: f32,
    /// Arm swing.
    pub arms: f32,
    /// Radians that the elbows are bent, and the upper arms held off the trunk, beyond the mean.
    pub elbows: f32,
    pub off: f32,
    /// Pelvic list and rotation.
    pub pelvis: f32,
    /// Radians: forward lean of the trunk beyond the mean.
    pub lean: f32,
    /// Metres: the left hand rests nearer to the hip by this, the right farther.
    pub hands: f32,
    /// Metres: the left foot stands ahead by this, the right behind.
    pub stagger: f32,
    /// Metres: drift of the weight while standing.
    pub sway: f32,
    /// Phases in radians of the drifts.
    pub phases: [f32; 8],
    pub seated: Manner,
    /// Of what differs from step to step.
    pub seed: u64,
}

/// Where a hand lies on its thigh: metres from the hip joint towards the knee, and inwards from the middle of the thigh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HandRest {
    pub along: f32,
    pub inwards: f32,
}

const NEAR_THE_KNEE: HandRest = HandRest { along: 0.275, inwards: 0.015 };
const ON_THE_THIGH: HandRest = HandRest { along: 0.215, inwards: 0.0 };
const IN_THE_LAP: HandRest = HandRest { along: 0.165, inwards: 0.022 };

/// How two hands rest, left and right.
const HAND_RESTS: [[HandRest; 2]; 6] = [
    [ON_THE_THIGH, ON_THE_THIGH],
    [IN_THE_LAP, IN_THE_LAP],
    [NEAR_THE_KNEE, NEAR_THE_KNEE],
    [IN_THE_LAP, ON_THE_THIGH],
    [ON_THE_THIGH, NEAR_THE_KNEE],
    [NEAR_THE_KNEE, IN_THE_LAP],
];

/// The trunk of who sits: how far it leans back beyond the mean, radians, and which of [`HAND_RESTS`] go with it.
const ATTITUDES: [(f32, &[usize]); 4] = [
    // Upright, hands anywhere.
    (0.0, &[0, 1, 2, 3, 4, 5]),
    (0.0, &[0, 1, 2, 3, 4, 5]),
    // Leaning over the thighs, hands out towards the knees.
    (-0.30, &[2, 4, 2]),
    // Leaning back, hands near the hips.
    (0.17, &[0, 1, 3]),
];

/// Which hands stay on the seat: mostly none.
const PROPS: [[f32; 2]; 8] =
    [[0.0; 2], [0.0; 2], [0.0; 2], [0.0; 2], [0.0; 2], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
/// How far ahead of the usual the feet are, metres: drawn in, or stretched out.
const FORTH: [f32; 6] = [0.0, 0.0, 0.13, 0.0, 0.07, 0.16];

/// How one sits down, sits and gets up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Manner {
    /// Time on the way, of the usual.
    pub pace: f32,
    /// Lean on the way, of the usual.
    pub bow: f32,
    /// Radians that the trunk leans back beyond the mean once seated; forwards where negative.
    pub recline: f32,
    /// Metres between the ankles.
    pub width: f32,
    /// Metres that the left foot is ahead of the right.
    pub stagger: f32,
    /// Radians that each knee is turned outwards.
    pub knees: f32,
    /// Left and right, and where they lie once the person has stirred.
    pub hands: [[HandRest; 2]; 2],
    /// How far each hand reaches for the seat on the way: 0 not, 1 until it is there.
    pub reach: [f32; 2],
    /// Whether each hand stays on the seat, beside the hip: 0 or 1.
    pub props: [f32; 2],
    /// Metres that both feet are farther ahead than usual.
    pub forth: f32,
    /// The foot that is set first.
    pub first: usize,
}

impl Manner {
    #[cfg(test)]
    const PLAIN: Self = Self {
        pace: 1.0,
        bow: 1.0,
        recline: 0.0,
        width: 0.25,
        stagger: 0.09,
        knees: 0.1,
        hands: [[ON_THE_THIGH, ON_THE_THIGH], [IN_THE_LAP, ON_THE_THIGH]],
        reach: [0.0, 0.0],
        props: [0.0, 0.0],
        forth: 0.0,
        first: 0,
    };

    fn of_clip(index: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(0x5EA7_0000 + index);
        let (attitude, rests) = ATTITUDES[random.random_range(0..ATTITUDES.len())];
        let kind = random.random_range(0..rests.len());
        let other = rests[(kind + random.random_range(1..rests.len())) % rests.len()];
        let kind = rests[kind];
        let hands = [HAND_RESTS[kind], HAND_RESTS[other]];
        // Mostly one: on its way to the seat an arm has room that it has not over the thighs.
        let reach = [[1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
            [random.random_range(0..6usize)];
        let first = random.random_range(0..2usize);
        let ahead = if first == 0 { -1.0 } else { 1.0 };
        let mut about = |middle: f32, spread: f32| middle + spread * random.random_range(-1.0f32..1.0);
        let manner = Self {
            pace: about(1.0, 0.24),
            bow: about(1.04, 0.12),
            recline: attitude + about(0.0, 0.035),
            width: about(0.285, 0.045),
            stagger: ahead * about(0.09, 0.03),
            knees: about(0.15, 0.09),
            hands,
            reach,
            props: [0.0, 0.0],
            forth: 0.0,
            first,
        };
        let props = PROPS[random.random_range(0..PROPS.len())];
        Self { props, forth: FORTH[random.random_range(0..FORTH.len())], ..manner }
    }
}

impl Style {
    /// The mean of all.
    #[cfg(test)]
    pub(super) fn plain() -> Self {
        Self {
            length: 1.0,
            width: 1.0,
            toe_out: 1.0,
            arms: 1.0,
            elbows: 0.0,
            off: 0.0,
            pelvis: 1.0,
            lean: 0.0,
            hands: 0.0,
            stagger: 0.0,
            sway: 0.012,
            phases: [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 0.5, 2.5],
            seated: Manner::PLAIN,
            seed: 0,
        }
    }

    /// The style of clip number `index`.
    pub(super) fn of_clip(index: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(0x0A0C_0E00 + index);
        let mut about = |middle: f32, spread: f32| middle + spread * random.random_range(-1.0f32..1.0);
        Self {
            length: about(1.0, 0.04),
            width: about(1.0, 0.12),
            toe_out: about(1.0, 0.3),
            arms: about(1.0, 0.15),
            elbows: about(0.0, 0.07),
            off: about(0.0, 0.025),
            pelvis: about(1.0, 0.15),
            lean: about(0.0, 0.015),
            hands: about(0.0, 0.035),
            stagger: about(0.0, 0.02),
            sway: about(0.012, 0.003),
            phases: std::array::from_fn(|_| about(0.0, std::f32::consts::PI)),
            seated: Manner::of_clip(index),
            seed: index,
        }
    }
}
