//! Foot contact c ∈ {0, 0.5, 1} (LAMA, section 3.3), found from the height and the speed of the toe.

use glam::Vec3;

use super::foot::sole;
use crate::motion::skeleton::{ANKLE_HEIGHT, HEEL_LENGTH, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, FootContact, Joint, Motion, Pose};

/// A planted toe is at most this far over its height on the floor when it lands, metres …
const LAND_HEIGHT: f32 = 0.03;
/// … and this far while it stays.
const STAY_HEIGHT: f32 = 0.05;
/// It is slower than this when it lands, metres a second …
const LAND_SPEED: f32 = 0.40;
/// … and than this while it stays.
const STAY_SPEED: f32 = 0.60;
/// It stays within this distance of where it is planted, metres: a slow shuffle is no plant.
const STAY_RADIUS: f32 = 0.04;
/// At the ends of a plant it is within this distance of its median, metres.
const STILL_RADIUS: f32 = 0.015;
/// A sole within this distance of the floor is near it (c = 0.5), metres …
const NEAR_HEIGHT: f32 = 0.04;
/// … unless its toe flies by: swinging toes pass low, at 3 m/s.
const NEAR_SPEED: f32 = 1.0;
/// Shorter plants and shorter gaps are noise, frames.
const SHORTEST_PLANT: usize = 3;

/// Foot contact of every frame: `[left, right]`, 1 while the toe is planted, 0.5 while toe or heel is near the floor.
///
/// The floor is z = 0. Landing and leaving have their own thresholds, so contact does not flicker.
pub(crate) fn detect(motion: &Motion) -> Vec<FootContact> {
    let poses: Vec<Pose> = motion.postures.iter().map(|p| p.pose()).collect();
    let mut contacts = vec![[0.0; 2]; poses.len()];
    for (side, (toe, foot)) in Joint::TOES.into_iter().zip(Joint::FEET).enumerate() {
        let toes: Vec<Vec3> = poses.iter().map(|p| p.position(toe)).collect();
        let planted = planted_frames(&toes, TOE_HEIGHT);
        for (frame, pose) in poses.iter().enumerate() {
            let heel = pose.position(foot) + pose.rotation(foot) * Vec3::new(0.0, HEEL_LENGTH, -ANKLE_HEIGHT);
            let lowest = heel.z.min(toes[frame].z - TOE_HEIGHT);
            contacts[frame][side] =
                match (planted[frame], lowest < NEAR_HEIGHT && speed(&toes, frame) < NEAR_SPEED) {
                    (true, _) => 1.0,
                    (false, true) => 0.5,
                    (false, false) => 0.0,
                };
        }
    }
    contacts
}

/// Speed of a point at a frame, metres a second.
fn speed(track: &[Vec3], frame: usize) -> f32 {
    let (a, b) = (frame.saturating_sub(1), (frame + 1).min(track.len() - 1));
    if a == b { 0.0 } else { track[a].distance(track[b]) * FRAME_RATE / (b - a) as f32 }
}

/// Whether the heel or the ball of each foot carries it, in every frame: `[left, right]`. `planted` says which toes do.
///
/// From the heel's strike to the last of the toe it stands: the moment between the two, as it rolls, is no swing.
pub(crate) fn standing(poses: &[Pose], planted: &[FootContact]) -> Vec<[bool; 2]> {
    let mut stands = vec![[false; 2]; poses.len()];
    for side in 0..2 {
        let heels: Vec<Vec3> = poses.iter().map(|pose| sole(pose, side)[0]).collect();
        let on_heel = planted_frames(&heels, 0.0);
        let on_toe = |frame: usize| planted.get(frame).is_some_and(|contact| contact[side] >= 1.0);
        let mut carried: Vec<bool> = (0..poses.len()).map(|f| on_heel[f] || on_toe(f)).collect();
        for (first, end) in runs(&carried, false) {
            if first > 0 && end < poses.len() && end - first <= SHORTEST_PLANT {
                carried[first..end].fill(true);
            }
        }
        stands.iter_mut().zip(carried).for_each(|(stands, carried)| stands[side] = carried);
    }
    stands
}

/// Whether a toe or a heel is planted in each frame, from its positions in the world and its height where it stands.
fn planted_frames(toes: &[Vec3], rest: f32) -> Vec<bool> {
    let count = toes.len();
    let mut planted = vec![false; count];
    // Where the toe stands: mean of the plant so far.
    let mut anchor: Option<(Vec3, f32)> = None;
    for frame in 0..count {
        let height = toes[frame].z - rest;
        let speed = speed(toes, frame);
        let (limit_height, limit_speed) =
            if anchor.is_some() { (STAY_HEIGHT, STAY_SPEED) } else { (LAND_HEIGHT, LAND_SPEED) };
        let stays =
            anchor.is_none_or(|(sum, n)| (sum / n).truncate().distance(toes[frame].truncate()) < STAY_RADIUS);
        if height < limit_height && speed < limit_speed && stays {
            planted[frame] = true;
            let (sum, n) = anchor.unwrap_or((Vec3::ZERO, 0.0));
            anchor = Some((sum + toes[frame], n + 1.0));
        } else {
            anchor = None;
        }
    }
    // Fill short gaps in which the toe hardly moves (unless that would join the plants of a shuffle), then drop
    // what is too short.
    let mut last: Option<(usize, usize)> = None;
    for (first, end) in runs(&planted, true) {
        match last {
            Some((start, before))
                if first - before < SHORTEST_PLANT
                    && toes[start].distance(toes[end - 1]) < 1.5 * STAY_RADIUS =>
            {
                planted[before..first].fill(true);
                last = Some((start, end));
            }
            _ => last = Some((first, end)),
        }
    }
    // A toe that already drags away (or still drifts in) at the end of its plant is not planted there.
    for (first, end) in runs(&planted, true) {
        let place = median(&toes[first..end]);
        let off = |f: usize| toes[f].truncate().distance(place.truncate()) > STILL_RADIUS;
        let left = (first..end).rev().take_while(|&f| off(f)).count();
        let landed = (first..end - left).take_while(|&f| off(f)).count();
        planted[first..first + landed].fill(false);
        planted[end - left..end].fill(false);
    }
    for (first, end) in runs(&planted, true) {
        if end - first < SHORTEST_PLANT && first > 0 && end < count {
            planted[first..end].fill(false);
        }
    }
    planted
}

/// The median of each coordinate. `points` must not be empty.
pub(crate) fn median(points: &[Vec3]) -> Vec3 {
    let middle = |axis: usize| {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        values[values.len() / 2]
    };
    Vec3::new(middle(0), middle(1), middle(2))
}

/// The stretches `first..end` in which `flags` has the value `value`.
pub(crate) fn runs(flags: &[bool], value: bool) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    let mut frame = 0;
    while frame < flags.len() {
        let end = flags[frame..].iter().position(|&f| f != flags[frame]).map_or(flags.len(), |n| frame + n);
        if flags[frame] == value {
            out.push((frame, end));
        }
        frame = end;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Posture;
    use glam::Quat;

    #[test]
    fn a_step_is_planted_lifted_planted() {
        // By hand: 20 frames on the floor, 12 frames through the air over 0.7 m, 20 frames on the floor.
        let mut toes = vec![Vec3::new(0.0, 0.0, TOE_HEIGHT); 20];
        for i in 1..=12 {
            let t = i as f32 / 12.0;
            let arc = 0.08 * (std::f32::consts::PI * t).sin();
            toes.push(Vec3::new(0.0, -0.7 * t, TOE_HEIGHT + arc));
        }
        toes.extend([Vec3::new(0.0, -0.7, TOE_HEIGHT); 20]);
        let planted = planted_frames(&toes, TOE_HEIGHT);
        assert!(planted[..19].iter().all(|&p| p) && planted[33..].iter().all(|&p| p));
        assert!(planted[21..31].iter().all(|&p| !p), "{planted:?}");
    }

    #[test]
    fn a_foot_stands_from_the_heels_strike_on() {
        // By hand: it comes in with the toes up by 0.4 radians, its heel stays where it struck in frame 8 while the foot
        // comes down to flat in frame 14, and its toe is planted from frame 16 on.
        let poses: Vec<Pose> = (0..24)
            .map(|frame: i32| {
                let mut posture = Posture::default();
                let slope = 0.4 * (1.0 - (frame - 8) as f32 / 6.0).clamp(0.0, 1.0);
                posture.rotations[Joint::LeftFoot.index()] = Quat::from_rotation_x(-slope);
                let heel = sole(&posture.pose(), 0)[0];
                let ahead = 0.04 * (8 - frame).max(0) as f32;
                let rest = sole(&Posture::default().pose(), 0)[0];
                posture.root_position += rest + Vec3::new(0.0, ahead, 0.5 * ahead) - heel;
                posture.pose()
            })
            .collect();
        let planted: Vec<_> = (0..24).map(|f| if f >= 16 { [1.0, 0.0] } else { [0.5, 0.0] }).collect();
        let stands = standing(&poses, &planted);
        let first = stands.iter().position(|s| s[0]).expect("it stands");
        assert!((8..=9).contains(&first), "{first}");
        assert!(stands[first..].iter().all(|s| s[0]));
        // Without the heel it would stand from frame 16 on; a longer gap than a roll is a swing.
        let hover: Vec<Pose> = poses
            .iter()
            .map(|pose| {
                let mut pose = *pose;
                pose.positions.iter_mut().for_each(|p| p.z += 0.1);
                pose
            })
            .collect();
        let alone = standing(&hover, &planted);
        assert_eq!(alone.iter().position(|s| s[0]), Some(16));
        for (gap, closed) in [(3, true), (4, false)] {
            let planted: Vec<_> =
                (0..24).map(|f| [if (8..8 + gap).contains(&f) { 0.5 } else { 1.0 }, 0.0]).collect();
            assert_eq!(standing(&hover, &planted).iter().all(|s| s[0]), closed);
        }
    }

    #[test]
    fn a_glide_and_a_low_swing_are_no_plants() {
        let glide: Vec<Vec3> = (0..60).map(|i| Vec3::new(0.0, -0.02 * i as f32, TOE_HEIGHT)).collect();
        assert!(planted_frames(&glide, TOE_HEIGHT).iter().all(|&p| !p));
        let slow: Vec<Vec3> = (0..200).map(|i| Vec3::new(0.0, -0.006 * i as f32, TOE_HEIGHT)).collect();
        for (first, end) in runs(&planted_frames(&slow, TOE_HEIGHT), true) {
            assert!(slow[first].distance(slow[end - 1]) < 0.1, "a shuffle breaks into short plants");
        }
    }

    #[test]
    fn rest_is_contact_and_a_lifted_body_is_none() {
        let mut motion = Motion { postures: vec![Posture::default(); 10], contacts: Vec::new() };
        assert!(detect(&motion).iter().all(|&c| c == [1.0, 1.0]));
        for posture in &mut motion.postures {
            posture.root_position.z += 0.035;
            // A hovering body is near the floor, but it does not stand: nothing moves, so only height tells.
        }
        assert!(detect(&motion).iter().all(|&c| c == [0.5, 0.5]));
        for posture in &mut motion.postures {
            posture.root_position.z += 0.3;
        }
        assert!(detect(&motion).iter().all(|&c| c == [0.0, 0.0]));
        assert!(detect(&Motion::default()).is_empty());
    }
}
