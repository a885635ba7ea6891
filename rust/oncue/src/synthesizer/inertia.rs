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
pub struct Inertia {
    pub offset: Vec3,
    pub velocity: Vec3,
    acceleration: Vec3,
    /// Seconds until it is zero.
    left: f32,
}

impl Inertia {
    /// From now on it is gone in `seconds`, from what it is and as fast as it moves.
    pub fn settle_in(&mut self, seconds: f32) {
        self.left = seconds;
    }

    /// At `offset` with `velocity`, and gone in `seconds`.
    pub fn begin(&mut self, offset: Vec3, velocity: Vec3, seconds: f32) {
        *self = Self { offset, velocity, acceleration: Vec3::ZERO, left: seconds };
    }

    /// It came to lie at `offset` in this frame instead, and goes on at the pace that makes; `seconds` to catch up, if no
    /// more are left.
    pub fn divert(&mut self, offset: Vec3, seconds: f32) {
        self.velocity += (offset - self.offset) / FRAME_TIME;
        self.offset = offset;
        self.left = self.left.max(seconds);
    }

    /// One frame towards zero: a polynomial of the fifth degree, from what is to rest.
    #[inline]
    pub fn step(&mut self) {
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
    pub fn limit_velocity(&mut self) {
        self.velocity = self.velocity.clamp_length_max(8.0);
    }
}

/// Seconds, `shortest` or more, in which an offset of `angle` radians goes to zero no faster than `speed` radians a second.
pub fn settling_time(angle: f32, speed: f32, shortest: f32) -> f32 {
    (FASTEST * angle / speed.max(1e-3)).clamp(shortest, LONGEST)
}

/// A velocity that dies away: the root glides from the old clip's pace to the new one's. x, y: m/s; z: rad/s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Glide {
    velocity: Vec3,
    acceleration: Vec3,
    left: f32,
}

impl Glide {
    /// So much faster, and gone in `seconds`.
    pub fn add(&mut self, velocity: Vec3, seconds: f32) {
        self.velocity += velocity;
        self.left = seconds;
    }

    /// The displacement of one frame: of a velocity that goes to zero along a cubic.
    pub fn step(&mut self) -> Vec3 {
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

    /// Offset, velocity and acceleration after `t` of `end` seconds on the way of the fifth degree to rest at zero.
    fn quintic(start: [f64; 3], end: f64, t: f64) -> [f64; 3] {
        let [x, v, a] = start;
        let c = [
            x,
            v,
            a / 2.0,
            (-20.0 * x - 12.0 * v * end - 3.0 * a * end.powi(2)) / (2.0 * end.powi(3)),
            (30.0 * x + 16.0 * v * end + 3.0 * a * end.powi(2)) / (2.0 * end.powi(4)),
            (-12.0 * x - 6.0 * v * end - a * end.powi(2)) / (2.0 * end.powi(5)),
        ];
        let power = |n: usize| if n == 0 { 1.0 } else { t.powi(n as i32) };
        let sum = |terms: &dyn Fn(usize) -> f64| (0..6).map(terms).sum::<f64>();
        [
            sum(&|n| c[n] * power(n)),
            sum(&|n| if n > 0 { n as f64 * c[n] * power(n - 1) } else { 0.0 }),
            sum(&|n| if n > 1 { (n * (n - 1)) as f64 * c[n] * power(n - 2) } else { 0.0 }),
        ]
    }

    #[test]
    fn from_any_start_it_is_the_quintic_to_rest() {
        for (start, seconds) in [([0.3, -1.2, 4.0], 0.5), ([-0.2, 2.0, -9.0], 0.8), ([0.0, 0.7, 3.0], 0.3)] {
            let [x, v, a] = start.map(|n: f64| n as f32);
            let mut inertia = Inertia {
                offset: Vec3::new(x, -x, 0.0),
                velocity: Vec3::new(v, -v, 0.0),
                acceleration: Vec3::new(a, -a, 0.0),
                left: seconds,
            };
            let frames = (seconds * 30.0).round() as usize;
            for frame in 1..frames {
                inertia.step();
                let expected = quintic(start, f64::from(seconds), frame as f64 / 30.0);
                let found = [inertia.offset.x, inertia.velocity.x, inertia.acceleration.x];
                for ((found, expected), scale) in found.into_iter().zip(expected).zip([1.0, 10.0, 300.0]) {
                    assert!(
                        (f64::from(found) - expected).abs() < 1e-4 * scale,
                        "{frame}: {found} {expected}"
                    );
                }
                assert_eq!((inertia.offset.y, inertia.offset.z), (-inertia.offset.x, 0.0));
                assert!((inertia.left - (seconds - frame as f32 / 30.0)).abs() < 1e-5);
            }
            inertia.step();
            assert_eq!(inertia, Inertia::default());
        }
    }

    #[test]
    fn a_glides_velocity_is_the_cubic_to_rest() {
        for (v, a, seconds) in [(1.0f64, -3.0f64, 0.5f64), (-0.4, 2.0, 0.3)] {
            let mut glide = Glide {
                velocity: Vec3::X * v as f32,
                acceleration: Vec3::X * a as f32,
                left: seconds as f32,
            };
            // v(t) = v + a t + b t² + c t³, which is 0 with its derivative at the end.
            let b = (-3.0 * v - 2.0 * a * seconds) / seconds.powi(2);
            let c = (2.0 * v + a * seconds) / seconds.powi(3);
            let way = |t: f64| v * t + a * t * t / 2.0 + b * t.powi(3) / 3.0 + c * t.powi(4) / 4.0;
            for frame in 1..(seconds * 30.0).round() as usize {
                let (before, now) = ((frame - 1) as f64 / 30.0, frame as f64 / 30.0);
                let step = f64::from(glide.step().x);
                assert!((step - (way(now) - way(before))).abs() < 1e-6, "{frame}: {step}");
                let velocity = v + a * now + b * now * now + c * now.powi(3);
                let pull = a + 2.0 * b * now + 3.0 * c * now * now;
                assert!((f64::from(glide.velocity.x) - velocity).abs() < 1e-5);
                assert!((f64::from(glide.acceleration.x) - pull).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn what_is_diverted_goes_on_at_the_pace_that_makes() {
        let mut inertia = Inertia::default();
        inertia.begin(Vec3::X, Vec3::Y, 0.1);
        inertia.divert(Vec3::X * 1.2, 0.4);
        assert_eq!((inertia.offset, inertia.left), (Vec3::X * 1.2, 0.4));
        // 0.2 in a thirtieth of a second more.
        assert!(inertia.velocity.distance(Vec3::new(6.0, 1.0, 0.0)) < 1e-4);
        inertia.divert(Vec3::X, 0.2);
        assert_eq!(inertia.left, 0.4);
        inertia.velocity = Vec3::new(0.0, 30.0, 40.0);
        inertia.limit_velocity();
        assert!(inertia.velocity.distance(Vec3::new(0.0, 4.8, 6.4)) < 1e-5);
        let mut glide = Glide::default();
        glide.add(Vec3::X, 0.2);
        glide.add(Vec3::Y, 0.3);
        assert_eq!((glide.velocity, glide.left), (Vec3::new(1.0, 1.0, 0.0), 0.3));
    }
}
