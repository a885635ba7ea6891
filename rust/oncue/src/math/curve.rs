//! Shapes over a parameter, and over the samples of a curve.

use std::f32::consts::PI;

/// From 0 to 1 as `t` does, without a jump in velocity; what lies outside is held.
pub(crate) fn smoothstep(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// From 0 to 1 with the least jerk; what lies outside is held.
pub(crate) fn least_jerk(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// The samples within `radius` of each that there are.
fn around(values: &[f32], i: usize, radius: usize) -> std::ops::Range<usize> {
    i.saturating_sub(radius)..(i + radius + 1).min(values.len())
}

/// The largest of the values within `radius` samples of each, at least 0.
pub(crate) fn widened(values: &[f32], radius: usize) -> Vec<f32> {
    let largest = |i| values[around(values, i, radius)].iter().copied().fold(0.0, f32::max);
    (0..values.len()).map(largest).collect()
}

/// The mean of the values within `radius` samples of each, with the weights of a raised cosine.
pub(crate) fn softened(values: &[f32], radius: usize) -> Vec<f32> {
    let width = radius as f32 + 1.0;
    let weights: Vec<f32> = (0..=radius).map(|d| 1.0 + (PI * d as f32 / width).cos()).collect();
    (0..values.len())
        .map(|i| {
            let weighted = around(values, i, radius).map(|f| (weights[f.abs_diff(i)], values[f]));
            let (sum, all) = weighted.fold((0.0, 0.0), |(sum, all), (w, value)| (sum + w * value, all + w));
            sum / all
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_softened_into_a_rise() {
        let step: Vec<f32> = (0..40).map(|i| if i < 20 { 0.0 } else { 1.0 }).collect();
        let soft = softened(&step, 5);
        assert!(soft.is_sorted() && soft[14] == 0.0 && soft[25] == 1.0);
        assert!(soft.windows(2).all(|w| w[1] - w[0] < 0.18), "{soft:?}");
        // An even value stays, to the ends.
        assert!(softened(&[2.0; 7], 5).iter().all(|v| (v - 2.0).abs() < 1e-6));
    }

    #[test]
    fn a_peak_is_widened() {
        assert_eq!(widened(&[0.0, 0.0, 3.0, 1.0, 0.0, 0.0], 1), [0.0, 3.0, 3.0, 3.0, 1.0, 0.0]);
    }

    #[test]
    fn smoothstep_by_hand() {
        assert_eq!([-1.0, 0.0, 0.25, 0.5, 1.0, 2.0].map(smoothstep), [0.0, 0.0, 0.15625, 0.5, 1.0, 1.0]);
    }
}
