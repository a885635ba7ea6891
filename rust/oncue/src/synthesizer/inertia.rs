//! Inertialization: what a transition changes is kept as an offset that a critically damped spring
//! takes to zero (Bollo 2018; Holden 2020, spring form).

use glam::{Vec2, Vec3};

use super::FRAME_TIME;

/// 4 ln 2: a critically damped spring's damping is this over the half-life.
const DAMPING: f32 = 2.772_588_7;

/// However far apart two postures are, seconds: a transition is over before the next but one.
const LONGEST_HALF_LIFE: f32 = 0.35;

/// A critically damped spring of one half-life, made ready for a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    y: f32,
    decay: f32,
}

impl Spring {
    pub fn new(half_life: f32) -> Self {
        let y = DAMPING / half_life / 2.0;
        Self { y, decay: (-y * FRAME_TIME).exp() }
    }

    /// Moves `value` towards `target` by one frame.
    #[inline]
    pub fn step(&self, value: &mut Vec3, velocity: &mut Vec3, target: Vec3) {
        let j0 = *value - target;
        let j1 = *velocity + j0 * self.y;
        *value = self.decay * (j0 + j1 * FRAME_TIME) + target;
        *velocity = self.decay * (*velocity - j1 * self.y * FRAME_TIME);
    }
}

/// An offset (radians or metres) that dies away without a jump in value or velocity.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Inertia {
    pub offset: Vec3,
    pub velocity: Vec3,
}

impl Inertia {
    /// One frame towards zero.
    pub fn step(&mut self, spring: &Spring) {
        spring.step(&mut self.offset, &mut self.velocity, Vec3::ZERO);
    }

    /// Two noisy velocities may differ by more than any joint turns: 8 rad/s (or m/s) at the most.
    pub fn limit_velocity(&mut self) {
        self.velocity = self.velocity.clamp_length_max(8.0);
    }
}

/// The half-life, `shortest` or longer, with which an offset of `angle` radians dies away no faster than `speed` radians
/// a second: a critically damped spring let go at x0 is fastest at x0 y / e.
pub fn half_life(angle: f32, speed: f32, shortest: f32) -> f32 {
    (DAMPING / 2.0 / std::f32::consts::E * angle / speed.max(1e-3)).clamp(shortest, LONGEST_HALF_LIFE)
}

/// What is left of a velocity after one frame.
pub fn decay(half_life: f32) -> f32 {
    (-std::f32::consts::LN_2 / half_life * FRAME_TIME).exp()
}

/// A velocity that dies away: the root glides from the old clip's pace to the new one's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct InertiaVec2 {
    pub velocity: Vec2,
}

impl InertiaVec2 {
    /// The displacement of one frame.
    pub fn step(&mut self, half_life: f32) -> Vec2 {
        let step = self.velocity * FRAME_TIME;
        self.velocity *= decay(half_life);
        step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_life_halves_the_offset_and_nothing_jumps() {
        let mut inertia = Inertia { offset: Vec3::X, velocity: Vec3::ZERO };
        let mut last = 1.0;
        for frame in 1..=60 {
            inertia.step(&Spring::new(0.2));
            assert!(inertia.offset.x < last && inertia.offset.x > 0.0);
            assert!(last - inertia.offset.x < 0.12, "frame {frame}");
            last = inertia.offset.x;
            if frame == 6 {
                // A critically damped spring is a little slower than the pure exponential at first.
                assert!((0.4..0.75).contains(&last), "{last}");
            }
        }
        assert!(last < 1e-3);
    }
}
