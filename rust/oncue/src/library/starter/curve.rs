//! Curves over time: splines through knots, minimum-jerk pieces, Gaussian smoothing.

use std::f32::consts::TAU;

/// The cubic spline (twice continuously differentiable) through `(x, y)` knots, with given end slopes.
#[derive(Debug, Clone)]
pub(super) struct Spline {
    x: Vec<f32>,
    y: Vec<f32>,
    /// Slope at each knot.
    slope: Vec<f32>,
}

impl Spline {
    /// `knots` in ascending `x`, at least two; `ends` are the slopes at the first and the last.
    pub(super) fn new(knots: &[(f32, f32)], ends: (f32, f32)) -> Self {
        let (x, y): (Vec<f32>, Vec<f32>) = knots.iter().copied().unzip();
        let n = x.len();
        // Continuity of the second derivative at the inner knots is a tridiagonal system in the slopes.
        let (mut diagonal, mut upper, mut right) = (vec![1.0f32; n], vec![0.0f32; n], vec![0.0f32; n]);
        right[0] = ends.0;
        for i in 1..n.saturating_sub(1) {
            let (h0, h1) = (x[i] - x[i - 1], x[i + 1] - x[i]);
            let lower = h1;
            let factor = lower / diagonal[i - 1];
            diagonal[i] = 2.0 * (h0 + h1) - factor * upper[i - 1];
            upper[i] = h0;
            let b = 3.0 * ((y[i] - y[i - 1]) / h0 * h1 + (y[i + 1] - y[i]) / h1 * h0);
            right[i] = b - factor * right[i - 1];
        }
        let mut slope = vec![0.0; n];
        slope[n - 1] = ends.1;
        for i in (0..n - 1).rev() {
            slope[i] = (right[i] - upper[i] * slope[i + 1]) / diagonal[i];
        }
        Self { x, y, slope }
    }

    /// The value at `x`, held constant outside the knots.
    pub(super) fn at(&self, x: f32) -> f32 {
        let last = self.x.len() - 1;
        if x <= self.x[0] {
            return self.y[0];
        }
        if x >= self.x[last] {
            return self.y[last];
        }
        let i = self.x.partition_point(|&k| k <= x) - 1;
        let h = self.x[i + 1] - self.x[i];
        let u = (x - self.x[i]) / h;
        let (u2, u3) = (u * u, u * u * u);
        self.y[i] * (2.0 * u3 - 3.0 * u2 + 1.0)
            + self.slope[i] * h * (u3 - 2.0 * u2 + u)
            + self.y[i + 1] * (3.0 * u2 - 2.0 * u3)
            + self.slope[i + 1] * h * (u3 - u2)
    }
}

/// Minimum-jerk progress from 0 to 1 (Flash & Hogan 1985): velocity and acceleration vanish at both ends.
pub(super) fn minimum_jerk(u: f32) -> f32 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// Minimum-jerk progress of `t` from `first` to `last`.
pub(super) fn ease(t: f32, first: f32, last: f32) -> f32 {
    if last <= first {
        return if t < last { 0.0 } else { 1.0 };
    }
    minimum_jerk((t - first) / (last - first))
}

pub(super) fn mix(a: f32, b: f32, weight: f32) -> f32 {
    a + (b - a) * weight
}

/// Values joined by half a cosine between `(time, value)` keys, constant outside.
pub(super) fn keyed(keys: &[(f32, f32)], t: f32) -> f32 {
    let i = keys.partition_point(|k| k.0 <= t);
    if i == 0 {
        return keys.first().map_or(0.0, |k| k.1);
    }
    if i == keys.len() {
        return keys[i - 1].1;
    }
    let (a, b) = (keys[i - 1], keys[i]);
    let u = (t - a.0) / (b.0 - a.0).max(1e-6);
    mix(a.1, b.1, 0.5 - 0.5 * (0.5 * TAU * u).cos())
}

/// The larger of two, rounded over `width` where they cross; never below either.
pub(super) fn soft_maximum(a: f32, b: f32, width: f32) -> f32 {
    let h = (0.5 + 0.5 * (a - b) / width).clamp(0.0, 1.0);
    mix(b, a, h) + width * h * (1.0 - h)
}

/// Gaussian smoothing with the standard deviation `sigma` in samples; the ends are held.
pub(super) fn smooth(values: &[f32], sigma: f32) -> Vec<f32> {
    let Some(last) = values.len().checked_sub(1) else { return Vec::new() };
    let radius = (3.0 * sigma).ceil() as usize;
    let kernel: Vec<f32> =
        (0..=2 * radius).map(|k| (-0.5 * ((k as f32 - radius as f32) / sigma).powi(2)).exp()).collect();
    let total: f32 = kernel.iter().sum();
    let held: Vec<f32> =
        (0..values.len() + 2 * radius).map(|i| values[i.saturating_sub(radius).min(last)]).collect();
    // Weight by weight over all samples, which processors do several at a time.
    let mut sums = vec![0.0f32; values.len()];
    for (k, weight) in kernel.iter().enumerate() {
        sums.iter_mut().zip(&held[k..]).for_each(|(sum, value)| *sum += weight * value);
    }
    sums.iter_mut().for_each(|sum| *sum /= total);
    sums
}

/// The smallest value within `radius` samples of each.
pub(super) fn running_minimum(values: &[f32], radius: usize) -> Vec<f32> {
    (0..values.len())
        .map(|i| {
            let window = &values[i.saturating_sub(radius)..(i + radius + 1).min(values.len())];
            window.iter().copied().fold(f32::INFINITY, f32::min)
        })
        .collect()
}

/// The motion of a mass on an inverted pendulum of constant height whose centre of pressure is `pressure`:
/// solves `c - c″ / ω² = p` (Kajita et al. 2001) over the whole clip, so the mass moves before the foot does.
/// `step` in seconds; at rest at both ends.
pub(super) fn pendulum(pressure: &[f32], omega: f32, step: f32) -> Vec<f32> {
    let n = pressure.len();
    let k = 1.0 / f64::from(omega * step).powi(2);
    let (mut upper, mut right) = (vec![0.0f64; n], vec![0.0f64; n]);
    for i in 0..n {
        let diagonal = 1.0 + if i == 0 || i == n - 1 { k } else { 2.0 * k };
        let (above, before) = if i == 0 { (0.0, 0.0) } else { (upper[i - 1], right[i - 1]) };
        let lower = if i == 0 { 0.0 } else { -k };
        let pivot = diagonal - lower * above;
        upper[i] = if i == n - 1 { 0.0 } else { -k / pivot };
        right[i] = (f64::from(pressure[i]) - lower * before) / pivot;
    }
    let mut out = vec![0.0f32; n];
    let mut next = 0.0f64;
    for i in (0..n).rev() {
        next = right[i] - upper[i] * next;
        out[i] = next as f32;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spline_of_a_cubic_is_that_cubic() {
        let f = |x: f32| x * x * x - 2.0 * x + 0.5;
        let knots: Vec<_> = [0.0, 0.4, 0.5, 1.1, 2.0].iter().map(|&x| (x, f(x))).collect();
        let spline = Spline::new(&knots, (-2.0, 10.0));
        for i in 0..=40 {
            let x = i as f32 * 0.05;
            assert!((spline.at(x) - f(x)).abs() < 1e-4, "{x}: {} {}", spline.at(x), f(x));
        }
    }

    #[test]
    fn pendulum_solves_its_equation() {
        let step = 1.0 / 120.0;
        let pressure: Vec<f32> = (0..600).map(|i| if (200..400).contains(&i) { 0.1 } else { 0.0 }).collect();
        let c = pendulum(&pressure, 3.2, step);
        for i in 1..599 {
            let acceleration = (c[i + 1] - 2.0 * c[i] + c[i - 1]) / step.powi(2);
            assert!((c[i] - acceleration / 3.2f32.powi(2) - pressure[i]).abs() < 2e-3);
        }
        // It sets off before the pressure moves.
        assert!(c[190] > 0.03);
    }

    #[test]
    fn smoothing_is_a_weighted_mean_with_held_ends() {
        assert_eq!(smooth(&[], 2.0), Vec::<f32>::new());
        assert!(smooth(&[3.0; 40], 4.0).iter().all(|v| (v - 3.0).abs() < 1e-5));
        // A single one among zeros becomes the kernel: weights e^(-d²/2) over their sum up to three samples away.
        let mut single = vec![0.0; 21];
        single[10] = 1.0;
        let smoothed = smooth(&single, 1.0);
        let total: f32 = (-3..=3).map(|d| (-0.5 * (d * d) as f32).exp()).sum();
        for d in 0..=3usize {
            let expected = (-0.5 * (d * d) as f32).exp() / total;
            assert!((smoothed[10 + d] - expected).abs() < 1e-6 && (smoothed[10 - d] - expected).abs() < 1e-6);
        }
        assert_eq!(smoothed[14], 0.0);
        // The first sample is held before the beginning: half of the kernel falls on it.
        let edge = smooth(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0)[0];
        let half: f32 = (0..=3).map(|d| (-0.5 * (d * d) as f32).exp()).sum();
        assert!((edge - half / total).abs() < 1e-6);
    }

    #[test]
    fn minimum_jerk_is_a_smooth_rise() {
        assert_eq!((minimum_jerk(0.0), minimum_jerk(1.0)), (0.0, 1.0));
        assert!((minimum_jerk(0.5) - 0.5).abs() < 1e-6);
        assert!(minimum_jerk(0.01) < 2e-5);
    }
}
