//! Planted feet imply travel: whoever walks leaves his foot where it stands.
//!
//! So the way is what takes a sliding foot's motion away: of a walk on the spot, as on a treadmill, and of one whose way was
//! made longer or shorter than its steps, as where the root counts in another unit than the bones.

use glam::{Vec2, Vec3};

use super::sampler::Sampler;
use crate::motion::skeleton::LEG_LENGTH;
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
/// A way that is so many times what the feet allow, or so many times shorter, is not theirs. Of 133 captures of people who go
/// somewhere all are between 1.01 and 1.22 times that: feet roll.
const OTHER_WAY: f32 = 1.4;
/// Fewer seconds of going tell nothing of a way.
const FEWEST_SECONDS: usize = 2;
/// Two ways are in proportion where so many of their seconds are within this share of what they have in common.
const ALIKE: f32 = 0.25;
/// See [`ALIKE`].
const MOST: f32 = 0.75;
/// Hips lower over the feet than this crawl, sit or lie, leg lengths: feet that follow a body do not carry it.
const LOWEST_HIPS: f32 = 0.75;

/// What is mended of a way that is not that of the feet.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Travel {
    /// What is to be added to the places of each frame at 30 Hz, metres.
    pub way: Vec<Vec2>,
    /// A sentence about it.
    pub note: String,
}

/// What is to be mended of a file's way; `None` where its feet go along with it. The error is a sentence: no way fits them.
pub(super) fn travel(sampler: &mut Sampler) -> Result<Option<Travel>, String> {
    let count = sampler.frame_count();
    let mut feet: Vec<[Vec3; 4]> = Vec::with_capacity(count);
    let mut hips: Vec<Vec3> = Vec::with_capacity(count);
    for frame in 0..count {
        sampler.sample(frame);
        feet.push([
            sampler.at(Joint::LeftFoot),
            sampler.at(Joint::RightFoot),
            sampler.toe(0),
            sampler.toe(1),
        ]);
        hips.push((sampler.at(Joint::LeftUpLeg) + sampler.at(Joint::RightUpLeg)) / 2.0);
    }
    let steps = smoothed(&backs(&feet));
    let way: Vec<Vec2> = std::iter::once(Vec2::ZERO)
        .chain(steps.iter().scan(Vec2::ZERO, |at, step| {
            *at += *step;
            Some(*at)
        }))
        .take(count)
        .collect();
    match on_the_spot(&hips, &way) {
        Some(travel) => Ok(Some(travel)),
        None => out_of_proportion(&feet, &hips, &way),
    }
}

/// Of a walk on the spot: the way that takes the feet's sliding (`way`) away.
fn on_the_spot(hips: &[Vec3], way: &[Vec2]) -> Option<Travel> {
    let length: f32 = way
        .chunks(FRAME_RATE as usize)
        .map(|second| second[0].distance(second[second.len() - 1]))
        .filter(|&slide| slide > SLIDES)
        .sum();
    let (low, high) = hips.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), p| {
        (low.min(p.truncate()), high.max(p.truncate()))
    });
    (length >= SHORTEST_WAY && low.distance(high) < STAYS * length).then(|| {
        let metres: f32 = way.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        Travel {
            way: way.to_vec(),
            note: format!(
                "it walks on the spot; {metres:.1} m of way were given back from its planted feet."
            ),
        }
    })
}

/// Of a walk whose way is another than its feet allow (`way` is what they slide): what makes it theirs, in proportion.
fn out_of_proportion(feet: &[[Vec3; 4]], hips: &[Vec3], way: &[Vec2]) -> Result<Option<Travel>, String> {
    let second = FRAME_RATE as usize;
    let is_low = |f: usize| hips[f].z - (feet[f][0].z + feet[f][1].z) / 2.0 < LOWEST_HIPS * 2.0 * LEG_LENGTH;
    // How far the body goes in each second, and how far the feet that stand let it.
    let seconds: Vec<(Vec2, Vec2)> = (0..hips.len())
        .step_by(second)
        .map(|first| (first, (first + second).min(hips.len()) - 1))
        .filter(|&(first, last)| !(first..=last).any(is_low))
        .map(|(first, last)| ((hips[last] - hips[first]).truncate(), way[last] - way[first]))
        .map(|(goes, slides)| (goes, goes + slides))
        .filter(|(goes, lets)| goes.length().max(lets.length()) > SLIDES)
        .collect();
    let goes: f32 = seconds.iter().map(|(goes, _)| goes.length()).sum();
    let lets: f32 = seconds.iter().map(|(_, lets)| lets.length()).sum();
    if goes.max(lets) < SHORTEST_WAY || seconds.len() < FEWEST_SECONDS {
        return Ok(None);
    }
    let mut shares: Vec<f32> =
        seconds.iter().map(|(goes, lets)| goes.dot(*lets) / goes.length_squared()).collect();
    shares.sort_unstable_by(f32::total_cmp);
    let share = shares[shares.len() / 2];
    if (1.0 / OTHER_WAY..OTHER_WAY).contains(&share) {
        return Ok(None);
    }
    let is_alike = |(goes, lets): &&(Vec2, Vec2)| {
        let fits = share * *goes;
        fits.distance(*lets) < ALIKE * fits.length().max(lets.length())
    };
    let alike = seconds.iter().filter(is_alike).count();
    if !(share > 0.0 && alike as f32 >= MOST * seconds.len() as f32) {
        return Err(format!(
            "it goes {goes:.1} m while its planted feet let it go {lets:.1} m, and not in proportion: its feet glide, or its way \
             is not that of its steps. A mapping file with labels takes it as it is (docs/captures.md)."
        ));
    }
    Ok(Some(Travel {
        way: hips.iter().map(|p| (share - 1.0) * (*p - hips[0]).truncate()).collect(),
        note: format!(
            "its way is {:.2} times as long as its planted feet allow: {goes:.1} m were taken as {:.1} m.",
            1.0 / share,
            share * goes
        ),
    }))
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

    /// Feet that stand in turn for half a second each while the body goes `pace` metres a frame and they let it go `step`.
    fn walks(frames: usize, pace: f32, step: f32) -> (Vec<[Vec3; 4]>, Vec<Vec3>, Vec<Vec2>) {
        let hips = (0..frames).map(|f| Vec3::new(0.0, pace * f as f32, 0.9)).collect();
        let feet = (0..frames)
            .map(|f| {
                let part = |side: usize, height: f32| {
                    let stands = (f / 15) % 2 == side;
                    let since = (f % 15) as f32;
                    Vec3::new(
                        0.0,
                        (pace - step) * since + pace * 15.0 * (f / 15) as f32,
                        height + if stands { 0.0 } else { 0.1 },
                    )
                };
                [part(0, 0.1), part(1, 0.1), part(0, 0.02), part(1, 0.02)]
            })
            .collect();
        let way = (0..frames).map(|f| Vec2::new(0.0, (step - pace) * f as f32)).collect();
        (feet, hips, way)
    }

    #[test]
    fn a_way_is_taken_in_proportion_to_its_steps() {
        let mended = |pace: f32, step: f32| {
            let (feet, hips, way) = walks(150, pace, step);
            out_of_proportion(&feet, &hips, &way).unwrap()
        };
        // By hand: 2 cm a frame where the feet let it go 1 cm: after 149 frames 1.49 m are too much.
        let travel = mended(0.02, 0.01).unwrap();
        assert!(travel.way[149].distance(Vec2::new(0.0, -1.49)) < 1e-3 && travel.way[0] == Vec2::ZERO);
        // Five seconds of 29 steps from frame to frame each.
        assert!(
            travel.note.contains("2.00 times as long as its planted feet allow: 2.9 m were taken as 1."),
            "{}",
            travel.note
        );
        let travel = mended(0.02, 0.04).unwrap();
        assert!(travel.way[149].distance(Vec2::new(0.0, 2.98)) < 1e-3 && travel.note.contains("0.50 times"));
        // Within a third it is what captures are.
        assert_eq!((mended(0.02, 0.015), mended(0.02, 0.027)), (None, None));
        assert!(mended(0.02, 0.0141).is_some() && mended(0.02, 0.0285).is_some());
        // Who stands and sways goes nowhere.
        assert_eq!(mended(0.002, 0.0), None);
    }

    #[test]
    fn a_way_that_no_steps_make_is_refused() {
        let refused = |pace: f32, step: f32| {
            let (feet, hips, way) = walks(150, pace, step);
            out_of_proportion(&feet, &hips, &way).unwrap_err()
        };
        // On skates, and backwards over feet that go forward.
        assert!(
            refused(0.06, 0.0).contains("it goes 8.7 m while its planted feet let it go 0.0 m"),
            "{}",
            refused(0.06, 0.0)
        );
        assert!(refused(0.02, -0.02).contains("let it go 2.9 m, and not"));
        // Who crawls takes his feet along.
        let (feet, mut hips, way) = walks(150, 0.05, 0.0);
        hips.iter_mut().for_each(|p| p.z = 0.4);
        assert_eq!(out_of_proportion(&feet, &hips, &way), Ok(None));
        // Half of the seconds on skates, half of them not: nothing that is in proportion.
        let (feet, hips, mut way) = walks(150, 0.05, 0.0);
        (75..150).for_each(|f| way[f] = way[74]);
        assert!(out_of_proportion(&feet, &hips, &way).is_err());
        // One posture, and no frame.
        let (feet, hips, way) = walks(1, 0.05, 0.0);
        assert_eq!(out_of_proportion(&feet, &hips, &way), Ok(None));
        assert_eq!(out_of_proportion(&[], &[], &[]), Ok(None));
    }
}
