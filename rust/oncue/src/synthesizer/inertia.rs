//! Inertialization: what a transition changes is kept as an offset that goes to zero on its own (Bollo 2018), here always
//! along the way of least jerk from wherever it is (Flash and Hogan 1985), so that not even its acceleration jumps. A
//! critically damped spring (Holden 2020) begins each way with several times the acceleration.

use glam::Vec3;

use super::FRAME_TIME;

/// However far apart two postures are, a transition ends within so many seconds.
const LONGEST: f32 = 1.2;
/// The way of least jerk from rest to rest is this much faster in its middle than on average.
const FASTEST: f32 = 1.875;

/// An offset (radians or metres) that goes to zero without a jump in value, velocity or acceleration.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Inertia {
    pub offset: Vec3,
    pub velocity: Vec3,
    acceleration: Vec3,
    /// Seconds until it is zero.
    left: f32,
}

impl Inertia {
    /// From now on it is gone in `seconds`, from what it is and as fast as it moves.
    pub(super) fn settle_in(&mut self, seconds: f32) {
        self.left = seconds;
    }

    /// At `offset` with `velocity`, and gone in `seconds`.
    pub(super) fn begin(&mut self, offset: Vec3, velocity: Vec3, seconds: f32) {
        *self = Self { offset, velocity, acceleration: Vec3::ZERO, left: seconds };
    }

    /// It came to lie at `offset` in this frame instead, and goes on at the pace that makes; `seconds` to catch up, if no
    /// more are left.
    pub(super) fn divert(&mut self, offset: Vec3, seconds: f32) {
        self.velocity += (offset - self.offset) / FRAME_TIME;
        self.offset = offset;
        self.left = self.left.max(seconds);
    }

    /// One frame towards zero: a polynomial of the fifth degree, from what is to rest.
    #[inline]
    pub(super) fn step(&mut self) {
        let (t, left) = (FRAME_TIME, self.left);
        if left <= 1.001 * t {
            *self = Self::default();
            return;
        }
        let (x, v, a) = (self.offset, self.velocity * left, self.acceleration * left * left);
        let s = t / left;
        let (c3, c4, c5) =
            (-10.0 * x - 6.0 * v - 1.5 * a, 15.0 * x + 8.0 * v + 1.5 * a, -6.0 * x - 3.0 * v - 0.5 * a);
        self.offset = x + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5))));
        self.velocity = (v + s * (a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / left;
        self.acceleration = (a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (left * left);
        self.left = left - t;
    }

    /// Two noisy velocities may differ by more than any joint turns: 8 rad/s (or m/s) at the most.
    pub(super) fn limit_velocity(&mut self) {
        self.velocity = self.velocity.clamp_length_max(8.0);
    }
}

/// Seconds, `shortest` or more, in which an offset of `angle` radians goes to zero no faster than `speed` radians a second.
pub(super) fn settling_time(angle: f32, speed: f32, shortest: f32) -> f32 {
    (FASTEST * angle / speed.max(1e-3)).clamp(shortest, LONGEST)
}

/// A velocity that dies away: the root glides from the old clip's pace to the new one's. x, y: m/s; z: rad/s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Glide {
    velocity: Vec3,
    acceleration: Vec3,
    left: f32,
}

impl Glide {
    /// So much faster, and gone in `seconds`.
    pub(super) fn add(&mut self, velocity: Vec3, seconds: f32) {
        self.velocity += velocity;
        self.left = seconds;
    }

    /// The displacement of one frame: of a velocity that goes to zero along a cubic.
    pub(super) fn step(&mut self) -> Vec3 {
        let (t, left) = (FRAME_TIME, self.left);
        if left <= 1.001 * t {
            *self = Self::default();
            return Vec3::ZERO;
        }
        let (v, a) = (self.velocity, self.acceleration * left);
        let s = t / left;
        let (c2, c3) = (-3.0 * v - 2.0 * a, 2.0 * v + a);
        self.velocity = v + s * (a + s * (c2 + s * c3));
        self.acceleration = (a + s * (2.0 * c2 + s * 3.0 * c3)) / left;
        self.left = left - t;
        t * (v + s * (a / 2.0 + s * (c2 / 3.0 + s * c3 / 4.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Offsets of a whole way, frame by frame.
    fn way(mut inertia: Inertia) -> Vec<f32> {
        std::iter::from_fn(|| {
            let shown = inertia.offset.x;
            inertia.step();
            Some(shown)
        })
        .take(40)
        .collect()
    }

    #[test]
    fn from_rest_to_rest_with_the_least_jerk() {
        let mut inertia = Inertia::default();
        inertia.begin(Vec3::X, Vec3::ZERO, 0.8);
        for (frame, x) in way(inertia).into_iter().enumerate() {
            let s = (frame as f32 / 24.0).min(1.0);
            let expected = 1.0 - s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            assert!((x - expected).abs() < 1e-4, "frame {frame}: {x} {expected}");
        }
    }

    #[test]
    fn what_moves_goes_on_moving() {
        let mut inertia = Inertia::default();
        inertia.begin(Vec3::ZERO, Vec3::X, 0.4);
        let x = way(inertia);
        assert!((x[1] - FRAME_TIME).abs() < 2e-3);
        assert!(x.windows(3).all(|w| (w[2] - 2.0 * w[1] + w[0]).abs() < 0.012));
        assert!(x[12].abs() < 1e-5 && x[39] == 0.0);
    }

    #[test]
    fn a_second_transition_begins_where_the_first_is() {
        let mut inertia = Inertia::default();
        inertia.begin(Vec3::X, Vec3::ZERO, 0.4);
        (0..6).for_each(|_| inertia.step());
        let (offset, velocity) = (inertia.offset.x, inertia.velocity.x);
        assert!((offset - 0.5).abs() < 1e-4 && (velocity + FASTEST / 0.4).abs() < 1e-3);
        inertia.settle_in(0.4);
        inertia.step();
        assert!((inertia.offset.x - offset - velocity * FRAME_TIME).abs() < 2e-2);
    }

    #[test]
    fn the_fastest_of_a_way_is_what_was_asked() {
        let seconds = settling_time(0.8, 2.0, 0.3);
        assert!((seconds - 0.75).abs() < 1e-5);
        assert_eq!((settling_time(0.01, 2.0, 0.3), settling_time(9.0, 0.1, 0.3)), (0.3, LONGEST));
    }

    #[test]
    fn a_glide_ends_at_rest() {
        let mut glide = Glide::default();
        glide.add(Vec3::X, 0.4);
        let steps: Vec<f32> = (0..12).map(|_| glide.step().x).collect();
        assert!(steps.windows(2).all(|w| w[1] < w[0] && w[0] - w[1] < 0.13 * FRAME_TIME));
        // Half of what it would go at its first pace.
        assert!((steps.iter().sum::<f32>() - 0.2).abs() < 2e-3);
        assert_eq!(glide.step(), Vec3::ZERO);
    }
}
