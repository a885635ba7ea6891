//! A walk from which its way was taken, as on a treadmill: planted feet slide back under a body that stays.
//!
//! Whoever walks leaves his foot where it stands. So the way is what takes the sliding foot's motion away.

use glam::{Vec2, Vec3};

use super::sampler::Sampler;
use crate::motion::{FRAME_RATE, Joint};

/// A way shorter than this is no walk, metres.
const SHORTEST_WAY: f32 = 1.5;
/// A body that goes by more than this share of the way itself walks.
const STAYS: f32 = 0.25;
/// In a second of it planted feet slide by more than this, metres: less is what captures slide anyway.
const SLIDES: f32 = 0.3;
/// A part of the foot is planted within this of where it stands, metres.
const PLANTED: f32 = 0.04;
/// The way is smoothed over so many frames to both sides: between two feet it jumps.
const SMOOTH: usize = 2;

/// The way of each frame at 30 Hz (metres, from the first frame), or `None` where nothing is to be given back.
pub(super) fn way(sampler: &mut Sampler) -> Option<Vec<Vec2>> {
    let count = sampler.frame_count();
    let mut feet: Vec<[Vec3; 4]> = Vec::with_capacity(count);
    let mut hips: Vec<Vec2> = Vec::with_capacity(count);
    for frame in 0..count {
        sampler.sample(frame);
        feet.push([
            sampler.at(Joint::LeftFoot),
            sampler.at(Joint::RightFoot),
            sampler.toe(0),
            sampler.toe(1),
        ]);
        hips.push((sampler.at(Joint::LeftUpLeg) + sampler.at(Joint::RightUpLeg)).truncate() / 2.0);
    }
    let steps = smoothed(&backs(&feet));
    let way: Vec<Vec2> = std::iter::once(Vec2::ZERO)
        .chain(steps.iter().scan(Vec2::ZERO, |at, step| {
            *at += *step;
            Some(*at)
        }))
        .take(count)
        .collect();
    let length: f32 = way
        .chunks(FRAME_RATE as usize)
        .map(|second| second[0].distance(second[second.len() - 1]))
        .filter(|&slide| slide > SLIDES)
        .sum();
    let (low, high) =
        hips.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    (length >= SHORTEST_WAY && low.distance(high) < STAYS * length).then_some(way)
}

/// How the body moves over the foot that stands, from each frame to the next.
fn backs(feet: &[[Vec3; 4]]) -> Vec<Vec2> {
    let lows: [f32; 4] = std::array::from_fn(|part| {
        let mut heights: Vec<f32> = feet.iter().map(|f| f[part].z).collect();
        heights.sort_unstable_by(f32::total_cmp);
        heights.get(heights.len() / 20).copied().unwrap_or_default()
    });
    let mut last = Vec2::ZERO;
    feet.windows(2)
        .map(|pair| {
            let height = |part: usize| (pair[0][part].z - lows[part]).max(pair[1][part].z - lows[part]);
            let lowest = (0..4).min_by(|&a, &b| height(a).total_cmp(&height(b))).unwrap_or_default();
            // In the air it goes on as it went.
            if height(lowest) < PLANTED {
                last = (pair[0][lowest] - pair[1][lowest]).truncate();
            }
            last
        })
        .collect()
}

fn smoothed(steps: &[Vec2]) -> Vec<Vec2> {
    (0..steps.len())
        .map(|i| {
            let near = &steps[i.saturating_sub(SMOOTH)..(i + SMOOTH + 1).min(steps.len())];
            near.iter().sum::<Vec2>() / near.len() as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_body_goes_as_the_standing_foot_slides_back() {
        // By hand: the left ankle stands and slides back (+Y) by 2 cm a frame, the right one swings high over it.
        let feet: Vec<[Vec3; 4]> = (0..40)
            .map(|f| {
                let y = 0.02 * f as f32;
                let air = if f < 4 { 0.0 } else { 0.2 };
                [
                    Vec3::new(0.1, y, 0.1),
                    Vec3::new(-0.1, -y, 0.1 + air),
                    Vec3::new(0.1, y - 0.2, 0.02),
                    Vec3::new(-0.1, -y, 0.02 + air),
                ]
            })
            .collect();
        let way: Vec2 = smoothed(&backs(&feet)).iter().sum();
        assert!(way.distance(Vec2::new(0.0, -0.02 * 39.0)) < 1e-4, "{way}");
    }
}
