//! The pace of a finished motion: where a joint would turn faster than the library's own ever do, or the whole person faster
//! than people turn, all of it goes slower for a moment, along the same way. Nothing comes to stand elsewhere, and nothing that was clear of the scene is not.

use super::feet::{CHAIN, bend_leg};
use crate::library::database::TurnLimits;
use crate::math::rotation::{wrap_angle, yaw};
use crate::motion::skeleton::JOINT_OFFSET;
use crate::motion::{FRAME_RATE, JOINT_COUNT, Motion, Posture};

/// Share of what a joint may turn that is made use of where it would turn more.
const TURN_SHARE: f32 = 0.99;
/// How fast the whole person turns at the most, over five frames, radians a second: captured people who walk and turn on the
/// spot reach 95 to 105° a second (ACCAD).
const MOST_TURN: f32 = 1.75;
/// Steps over which that is measured: so many before and after the one between two frames.
const TURN_AROUND: usize = 2;
/// How often the pace is corrected.
const ROUNDS: usize = 16;
/// A step is corrected to so many times what its turn asks for, no more: what hurries then is a knee that flips between
/// two frames, which no pace mends.
const MOST_CORRECTED: f32 = 2.0;
/// Frames to either side in which the pace changes.
const EASE: usize = 5;
/// Of a frame: nearer than this to one of the motion's it is that one.
const SAME: f32 = 1e-3;

/// A motion at another pace.
#[derive(Debug, Clone)]
pub(crate) struct Paced {
    pub motion: Motion,
    /// The frame of the motion before, with its fraction, that each frame shows.
    shows: Vec<f32>,
}

impl Paced {
    /// The first frame that shows frame `before` of the motion before, or what comes after.
    pub(crate) fn frame_of(&self, before: usize) -> usize {
        let after = self.shows.iter().position(|f| f + SAME >= before as f32);
        after.unwrap_or(self.shows.len().saturating_sub(1))
    }
}

/// The motion so much slower, where it must be, that no joint turns faster than `limits` and nobody whirls round; `None` where
/// nothing does.
pub(crate) fn unhurried(motion: &Motion, limits: &TurnLimits) -> Option<Paced> {
    // How many frames each step from frame to frame takes.
    let hurries = motion.postures.windows(2).map(|pair| over(hurry(pair, limits)));
    let mut frames: Vec<f32> = hurries.zip(whirls(motion)).map(|(joint, whole)| joint.max(whole)).collect();
    if frames.iter().all(|f| *f <= 1.0) {
        return None;
    }
    let most: Vec<f32> = frames.iter().map(|frames| MOST_CORRECTED * frames).collect();
    let mut paced = played(motion, &eased(&frames));
    // A knee does not turn evenly between two frames: what still hurries gets more.
    for _ in 0..ROUNDS {
        let mut hurries = false;
        for (pair, shows) in paced.motion.postures.windows(2).zip(paced.shows.windows(2)) {
            let ratio = hurry(pair, limits);
            if ratio > 1.0 {
                for step in shows[0] as usize..(shows[1].ceil() as usize).min(frames.len()) {
                    let corrected = (frames[step] * over(ratio)).min(most[step]);
                    hurries |= corrected > frames[step];
                    frames[step] = corrected;
                }
            }
        }
        if !hurries {
            break;
        }
        paced = played(motion, &eased(&frames));
    }
    Some(paced)
}

/// The fastest turn between two frames over what its joint may turn, at least 1.
fn hurry(pair: &[Posture], limits: &TurnLimits) -> f32 {
    let ratio = |j: usize| limits.ratio(j, pair[0].rotations[j], pair[1].rotations[j]);
    (0..JOINT_COUNT).map(ratio).fold(1.0, f32::max)
}

/// How many times faster than [`MOST_TURN`] the person turns about each step between two frames, at least 1.
fn whirls(motion: &Motion) -> Vec<f32> {
    let yaws: Vec<f32> = motion.postures.iter().map(|posture| yaw(posture.rotations[0])).collect();
    let turns: Vec<f32> = yaws.windows(2).map(|pair| wrap_angle(pair[1] - pair[0])).collect();
    let around = |i: usize| &turns[i.saturating_sub(TURN_AROUND)..(i + TURN_AROUND + 1).min(turns.len())];
    let speed = |steps: &[f32]| steps.iter().sum::<f32>().abs() * FRAME_RATE / steps.len() as f32;
    (0..turns.len()).map(|i| (speed(around(i)) / MOST_TURN).max(1.0)).collect()
}

/// How many times longer a step takes that is `ratio` times too fast.
fn over(ratio: f32) -> f32 {
    if ratio > 1.0 { ratio / TURN_SHARE } else { 1.0 }
}

/// The motion with `frames` frames for each of its steps.
fn played(motion: &Motion, frames: &[f32]) -> Paced {
    let (mut paced, mut shows) = (Motion::default(), Vec::new());
    // `begun`: when the step from frame `at` begins.
    let (mut at, mut begun) = (0, 0.0);
    for now in 0.. {
        while at < frames.len() && begun + frames[at] < now as f32 {
            begun += frames[at];
            at += 1;
        }
        let part = frames.get(at).map_or(0.0, |f| (now as f32 - begun) / f);
        shows.push(at as f32 + part);
        paced.postures.push(between(motion, at, part));
        let after = motion.contacts[(at + usize::from(part > SAME)).min(motion.len() - 1)];
        paced.contacts.push([0, 1].map(|side| motion.contacts[at][side].min(after[side])));
        if at == frames.len() {
            break;
        }
    }
    Paced { motion: paced, shows }
}

/// No less than the values (1 or more), and changing slowly: what each is more than 1 falls off evenly to its sides.
fn eased(values: &[f32]) -> Vec<f32> {
    let at = |i: usize, f: usize| (values[f] - 1.0) * (1.0 - i.abs_diff(f) as f32 / (EASE as f32 + 1.0));
    let around = |i: usize| i.saturating_sub(EASE)..(i + EASE + 1).min(values.len());
    (0..values.len()).map(|i| 1.0 + around(i).map(|f| at(i, f)).fold(0.0, f32::max)).collect()
}

/// The posture `part` of the way from frame `at` to the next: what stands in both stands.
fn between(motion: &Motion, at: usize, part: f32) -> Posture {
    let before = &motion.postures[at];
    let Some(after) = motion.postures.get(at + 1).filter(|_| part > SAME) else {
        return *before;
    };
    let mut posture = *before;
    posture.root_position = before.root_position.lerp(after.root_position, part);
    for (rotation, after) in posture.rotations.iter_mut().zip(&after.rotations) {
        *rotation = rotation.slerp(*after, part).normalize();
    }
    let (from, to, mut pose) = (before.pose(), after.pose(), posture.pose());
    for (side, [.., foot, toe]) in CHAIN.iter().enumerate() {
        let rotation = from.rotation(*foot).slerp(to.rotation(*foot), part);
        let place = from.position(*toe).lerp(to.position(*toe), part);
        let ankle = place - rotation * JOINT_OFFSET[toe.index()];
        bend_leg(side, ankle, rotation, &mut posture, &mut pose);
    }
    posture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::angle_between;
    use crate::motion::Joint;
    use glam::{Quat, Vec3};

    /// A person who stands with bent knees and turns a forearm, fast in the middle, while the pelvis shifts.
    fn motion() -> Motion {
        let mut motion = Motion::default();
        for frame in 0..40 {
            let mut posture = Posture::default();
            posture.root_position += Vec3::new(0.001 * frame as f32, 0.0, -0.05);
            let angle = 0.4 / (1.0 + (-(frame as f32 - 20.0)).exp());
            posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_x(angle);
            let mut pose = posture.pose();
            for side in 0..2 {
                let toe = Posture::default().pose().position(Joint::TOES[side]);
                let ankle = toe - JOINT_OFFSET[Joint::TOES[side].index()];
                bend_leg(side, ankle, Quat::IDENTITY, &mut posture, &mut pose);
            }
            motion.postures.push(posture);
            motion.contacts.push([1.0; 2]);
        }
        motion
    }

    #[test]
    fn who_does_not_hurry_is_left_alone() {
        assert!(unhurried(&motion(), &TurnLimits::new([0.2; JOINT_COUNT])).is_none());
    }

    #[test]
    fn a_turn_keeps_to_its_limit_and_the_feet_stay() {
        let (motion, limit) = (motion(), 0.06);
        let paced = unhurried(&motion, &TurnLimits::new([limit; JOINT_COUNT])).expect("it hurries");
        let arm = |p: &Posture| p.rotations[Joint::LeftForeArm.index()];
        for pair in paced.motion.postures.windows(2) {
            assert!(angle_between(arm(&pair[0]), arm(&pair[1])) <= limit);
        }
        let toes = |p: &Posture| Joint::TOES.map(|toe| p.pose().position(toe));
        let stood = toes(&motion.postures[0]);
        for posture in &paced.motion.postures {
            assert!(toes(posture).iter().zip(&stood).all(|(a, b)| a.distance(*b) < 1e-4));
        }
        // The same way, from the same posture to the same.
        assert_eq!(paced.motion.postures[0], motion.postures[0]);
        assert_eq!(paced.motion.postures.last(), motion.postures.last());
        assert_eq!(paced.motion.contacts.len(), paced.motion.postures.len());
        // Half again as long where it was fastest, and no longer elsewhere.
        let added = paced.motion.len() - motion.len();
        assert!((3..12).contains(&added), "{added}");
        assert_eq!((paced.frame_of(5), paced.frame_of(39)), (5, 39 + added));
    }

    #[test]
    fn what_no_pace_mends_does_not_hold_the_motion_up() {
        // The whole leg spins between two frames, as a straight one does whose knee has no side: it is still to last.
        let mut motion = motion();
        for posture in &mut motion.postures[20..] {
            let thigh = Joint::LeftUpLeg.index();
            posture.rotations[thigh] *= Quat::from_rotation_z(0.5);
        }
        let long = |limit: f32| {
            unhurried(&motion, &TurnLimits::new([limit; JOINT_COUNT])).expect("it hurries").motion.len()
        };
        // Eleven times too fast, and half as much to either side, is about sixty frames more; twice that is the most.
        assert!(long(0.05) < 40 + 2 * 70, "{}", long(0.05));
    }

    #[test]
    fn nobody_whirls_round() {
        // Half a turn in two seconds, in the middle of which it goes at 3 radians a second.
        let mut motion = motion();
        motion.postures.resize(60, Posture::default());
        motion.contacts.resize(60, [1.0; 2]);
        for (frame, posture) in motion.postures.iter_mut().enumerate() {
            *posture = Posture::default();
            let angle = 1.5 * (1.0 + (2.0 * (frame as f32 - 30.0) / FRAME_RATE).tanh());
            posture.rotations[0] = Quat::from_rotation_z(angle);
        }
        let fastest = |motion: &Motion| {
            let whole: Vec<f32> = motion.postures.iter().map(|p| yaw(p.rotations[0])).collect();
            whole.windows(6).map(|w| (w[5] - w[0]) * FRAME_RATE / 5.0).fold(0.0, f32::max)
        };
        assert!((fastest(&motion) - 3.0).abs() < 0.1);
        let paced = unhurried(&motion, &TurnLimits::new([1.0; JOINT_COUNT])).expect("it whirls");
        assert!(fastest(&paced.motion) < 1.05 * MOST_TURN, "{}", fastest(&paced.motion));
        assert!(fastest(&paced.motion) > 0.8 * MOST_TURN);
        assert_eq!(paced.motion.postures.last(), motion.postures.last());
        // By hand: an even turn takes as much longer as it is too fast, less at its ends, where it sets in.
        let steady = |speed: f32| {
            let mut even = motion.clone();
            for (frame, posture) in even.postures.iter_mut().enumerate() {
                posture.rotations[0] = Quat::from_rotation_z(speed / FRAME_RATE * frame as f32);
            }
            whirls(&even)
        };
        assert!(steady(1.7).iter().all(|w| *w == 1.0));
        assert!(steady(-3.5).iter().all(|w| (w - 2.0).abs() < 1e-3));
    }

    #[test]
    fn the_pace_changes_slowly() {
        let mut needed = vec![1.0; 40];
        needed[20] = 2.0;
        let eased = eased(&needed);
        assert!(eased.iter().zip(&needed).all(|(e, n)| e >= n));
        assert!(eased.windows(2).all(|w| (w[1] - w[0]).abs() < 0.2));
        assert!(eased[..8].iter().all(|e| (e - 1.0).abs() < 1e-6));
    }

    #[test]
    fn a_step_takes_as_long_as_it_is_too_fast() {
        assert_eq!((over(0.5), over(1.0)), (1.0, 1.0));
        assert!((over(2.0) - 2.0 / 0.99).abs() < 1e-6);
        let mut posture = Posture::default();
        posture.rotations[5] = Quat::from_rotation_x(0.3);
        posture.rotations[6] = Quat::from_rotation_z(0.2);
        let limits = TurnLimits::new([0.1; JOINT_COUNT]);
        assert!((hurry(&[Posture::default(), posture], &limits) - 3.0).abs() < 1e-3);
        assert_eq!(hurry(&[posture, posture], &limits), 1.0);
    }

    #[test]
    fn frames_are_shown_at_their_pace() {
        // Three frames, the first step twice as long, the second half again as long.
        let mut motion = motion();
        motion.postures.truncate(3);
        motion.contacts = vec![[1.0, 0.0], [0.5, 1.0], [1.0, 1.0]];
        let paced = played(&motion, &[2.0, 1.5]);
        assert_eq!(paced.shows.len(), 5);
        for (shown, expected) in paced.shows.iter().zip([0.0, 0.5, 1.0, 1.0 + 2.0 / 3.0, 2.0]) {
            assert!((shown - expected).abs() < 1e-4, "{:?}", paced.shows);
        }
        assert_eq!(paced.motion.postures[0], motion.postures[0]);
        assert_eq!(paced.motion.postures[4], motion.postures[2]);
        let x = paced.motion.postures[1].root_position.x;
        assert!((x - 0.0005).abs() < 1e-5, "{x}");
        // Between two frames a foot is planted as far as it is in both.
        assert_eq!(paced.motion.contacts[..2], [[1.0, 0.0], [0.5, 0.0]]);
        assert_eq!(paced.motion.contacts[3], [0.5, 1.0]);
        assert_eq!(paced.motion.contacts[4], [1.0, 1.0]);
        let frames: Vec<usize> = (0..3).map(|f| paced.frame_of(f)).collect();
        assert_eq!(frames, [0, 2, 4]);
        assert_eq!(paced.frame_of(9), 4);
    }

    #[test]
    fn what_is_eased_falls_off_evenly() {
        let mut needed = vec![1.0; 20];
        needed[10] = 1.6;
        for (i, eased) in eased(&needed).into_iter().enumerate() {
            // A sixth less with each frame to either side.
            let expected = 1.0 + 0.6 * (1.0 - i.abs_diff(10) as f32 / 6.0).max(0.0);
            assert!((eased - expected).abs() < 1e-5, "{i}: {eased} {expected}");
        }
    }
}
