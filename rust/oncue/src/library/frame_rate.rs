//! A frame rate that cannot be is questioned: legs swing like pendulums, whoever they belong to.
//!
//! Slow walkers stand longer, they do not swing more slowly; so the time in which a foot passes the other tells
//! frames that were captured at one rate and are played at another.

use super::gait::{Gait, Steps};

/// The middle 80 % of a foot's way past the other take this long in walking and running, seconds.
const PASS_SECONDS: f32 = 0.27;
/// Whoever needs less or more than this is played at another rate than that of the capture, seconds.
const LIVELY: [f32; 2] = [0.11, 0.55];
/// Steps from which it is told that somebody walks, and at what rate.
pub(super) const FEWEST_STEPS: usize = 4;
/// Rates at which captures are made, frames a second.
const USUAL: [f64; 4] = [30.0, 60.0, 120.0, 240.0];
/// Nobody captures at fewer frames a second: such a header holds a default, not a rate.
const SLOWEST: f64 = 5.0;
/// What a mapping file may say, frames a second.
const TOLD: std::ops::RangeInclusive<f64> = 1.0..=1000.0;

/// The rate that a mapping file says. The error is a sentence.
pub(super) fn told(rate: f64) -> Result<f64, String> {
    if TOLD.contains(&rate) {
        return Ok(rate);
    }
    Err(format!(
        "its mapping file gives it {rate} frames a second; from {} to {} can be.",
        TOLD.start(),
        TOLD.end()
    ))
}

/// Whoever flies falls: the rate is right where it is within this factor of what the fall tells.
const FLIGHT: f64 = 1.6;

/// The rate of a capture whose file says `says`, and a sentence where it is another.
///
/// # Errors
/// A sentence where the file's rate cannot be and its motion does not tell another.
pub(super) fn frame_rate(says: f64, gait: &Gait) -> Result<(f64, Option<String>), String> {
    // Who skips or gallops passes his feet at another time than who walks, but falls as all do.
    let falls = gait.rate_by_flight().is_some_and(|rate| (1.0 / FLIGHT..FLIGHT).contains(&(says / rate)));
    match gait.steps(FEWEST_STEPS) {
        Some(steps) if !falls => Ok(by_steps(says, &steps)),
        None if says < SLOWEST => Err(format!(
            "it says that it has {says:.2} frames a second, which no capture has, and nobody walks in it, which would \
             tell. A mapping file can give its rate: NAME.oncue.json beside NAME.bvh, see docs/captures.md."
        )),
        _ => Ok((says, None)),
    }
}

fn by_steps(says: f64, steps: &Steps) -> (f64, Option<String>) {
    let takes = steps.pass_frames / says as f32;
    if (LIVELY[0]..=LIVELY[1]).contains(&takes) {
        return (says, None);
    }
    let off = |rate: &f64| (steps.pass_frames / *rate as f32 / PASS_SECONDS).ln().abs();
    let guess = USUAL.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(says);
    let note = format!(
        "it says {says:.3} frames a second, at which a foot would swing for {takes:.2} s; {guess} was taken. A mapping \
         file can give its rate."
    );
    (guess, Some(note))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_rates_are_guessed_from_the_swing() {
        // By hand: 16 frames at 60 a second are 0.27 s.
        let steps = |pass_frames| Steps { pass_frames };
        assert_eq!(by_steps(60.0, &steps(16.0)), (60.0, None));
        for wrong in [1.0, 12.0, 24.0, 240.0] {
            let (rate, note) = by_steps(wrong, &steps(16.0));
            assert_eq!(rate, 60.0, "{wrong}");
            assert!(note.unwrap().contains("60 was taken"));
        }
        assert_eq!(by_steps(25.0, &steps(32.0)).0, 120.0);
        // A very slow and a very brisk walker at 30.
        assert_eq!(by_steps(30.0, &steps(14.0)), (30.0, None));
        assert_eq!(by_steps(30.0, &steps(5.0)), (30.0, None));
    }
}
