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
            pelvis: 1.0,
            lean: 0.0,
            hands: 0.0,
            stagger: 0.0,
            sway: 0.012,
            phases: [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 0.5, 2.5],
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
            pelvis: about(1.0, 0.15),
            lean: about(0.0, 0.015),
            hands: about(0.0, 0.035),
            stagger: about(0.0, 0.014),
            sway: about(0.012, 0.003),
            phases: std::array::from_fn(|_| about(0.0, std::f32::consts::PI)),
        }
    }
}
