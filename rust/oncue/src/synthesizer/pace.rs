//! The pace of a finished motion: where a joint would turn faster than the library's own ever do, or the whole person faster
//! than people turn, all of it goes slower for a moment, along the same way; and who is to be somewhere at a time hurries, or takes
//! their time. Nothing comes to stand elsewhere, and nothing that was clear of the scene is not.

use super::feet::{CHAIN, bend_leg};
use crate::library::database::TurnLimits;
use crate::math::curve::{smoothstep, softened, widened};
use crate::math::rotation::{angle_between, wrap_angle, yaw};
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

/// Who hurries walks so many times as fast, and does all else so many times as fast; who takes their time walks so many times as fast.
const HURRIED: (f32, f32) = (1.25, 1.2);
const LEISURELY: f32 = 0.8;
/// Who hurries turns no joint more than so many times as fast as the library's people at their own pace at the most.
const HURRIED_TURNS: f32 = 1.25;
/// Nobody is made to walk faster than this over a stride, nor slower than that, m/s.
pub(crate) const FASTEST_WALK: f32 = 1.6;
const SLOWEST_WALK: f32 = 0.6;
/// Who is faster than this sets off, and walks from that on, m/s.
const SETS_OFF: (f32, f32) = (0.2, 0.5);
/// Frames to either side over which a walk's speed is told: half of a stride's.
const STRIDE: usize = 15;
/// Frames to either side in which the pace of who hurries changes.
const HASTENS: usize = 6;

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
    turning_speeds(motion).iter().map(|speed| (speed / MOST_TURN).max(1.0)).collect()
}

/// How fast the person turns round about each step between two frames, radians a second.
fn turning_speeds(motion: &Motion) -> Vec<f32> {
    let yaws: Vec<f32> = motion.postures.iter().map(|posture| yaw(posture.rotations[0])).collect();
    let turns: Vec<f32> = yaws.windows(2).map(|pair| wrap_angle(pair[1] - pair[0])).collect();
    let around = |i: usize| &turns[i.saturating_sub(TURN_AROUND)..(i + TURN_AROUND + 1).min(turns.len())];
    let speed = |steps: &[f32]| steps.iter().sum::<f32>().abs() * FRAME_RATE / steps.len() as f32;
    (0..turns.len()).map(|i| speed(around(i))).collect()
}

/// How many times longer a step takes that is `ratio` times too fast.
fn over(ratio: f32) -> f32 {
    if ratio > 1.0 { ratio / TURN_SHARE } else { 1.0 }
}

/// How many frames each step from frame to frame may take until frame `until`, where a person hurries or takes their time: along the same
/// way, in the same postures.
#[derive(Debug, Clone)]
pub(crate) struct Leeway {
    frames: Vec<f32>,
    until: usize,
}

impl Leeway {
    /// Of who hurries to be where they are on frame `until`: nobody walks or turns round faster than people do, and no joint turns more
    /// than [`HURRIED_TURNS`] times as fast as `limits`, but where it does anyway.
    pub(crate) fn hurried(motion: &Motion, until: usize, limits: &TurnLimits) -> Self {
        let speeds = walking_speeds(motion);
        let turning = turning_speeds(motion);
        let most = |step: usize| {
            let walks = walks(speeds[step]);
            let own = HURRIED.1 + (HURRIED.0 - HURRIED.1) * walks;
            let turns = turned(&motion.postures[step..step + 2], limits);
            let spare = |most: f32, now: f32| (most / now.max(1e-3)).max(1.0);
            own.min(spare(FASTEST_WALK, speeds[step]))
                .min(spare(TURN_SHARE * HURRIED_TURNS, turns))
                .min(spare(MOST_TURN, turning[step]))
        };
        // What can be spared of each frame, …
        let kept: Vec<f32> =
            (0..speeds.len()).map(|step| if step < until { 1.0 / most(step) } else { 1.0 }).collect();
        // … no more of any than of those around it.
        Self { frames: softened(&widened(&kept, HASTENS), HASTENS), until }.eased(until)
    }

    /// Of who takes their time to be where they are on frame `until`: the walk alone goes slower.
    pub(crate) fn leisurely(motion: &Motion, until: usize) -> Self {
        let speeds = walking_speeds(motion);
        let own = |step: usize| {
            let slowest = (speeds[step] / SLOWEST_WALK).clamp(1.0, 1.0 / LEISURELY);
            1.0 + (slowest - 1.0) * walks(speeds[step])
        };
        let more: Vec<f32> =
            (0..speeds.len()).map(|step| if step < until { own(step) - 1.0 } else { 0.0 }).collect();
        Self { frames: softened(&more, HASTENS).iter().map(|more| 1.0 + more).collect(), until }.eased(until)
    }

    /// The pace of the first frames, and of the last ones before frame `until`, is the motion's own.
    fn eased(mut self, until: usize) -> Self {
        let ease = |frames: usize| smoothstep(frames as f32 / (2 * HASTENS) as f32);
        for (step, frames) in self.frames.iter_mut().enumerate() {
            *frames = 1.0 + (*frames - 1.0) * ease(step) * ease(until.saturating_sub(step + 1));
        }
        self
    }

    /// By how many frames frame `until` may come later; negative: sooner.
    pub(crate) fn most(&self) -> isize {
        self.sum().trunc() as isize
    }

    fn sum(&self) -> f64 {
        self.frames[..self.until].iter().map(|frames| f64::from(*frames) - 1.0).sum()
    }

    /// The motion so that frame `until` comes `by` frames later, of the sign of [`Self::most`] and no more; what comes after it stays.
    pub(crate) fn taken(&self, motion: &Motion, by: isize) -> Paced {
        let share = by as f64 / self.sum();
        let (mut shows, mut begun) = (vec![(0, 0.0)], 0.0f64);
        for step in 0..self.until {
            let takes = 1.0 + share * (f64::from(self.frames[step]) - 1.0);
            let ends = begun + takes;
            // Each of the frames in (begun, ends]; what rounding leaves does not lose or double the last one.
            while shows.len() as f64 <= ends + 1e-6 {
                let part = ((shows.len() as f64 - begun) / takes) as f32;
                shows.push(if part > 1.0 - SAME { (step + 1, 0.0) } else { (step, part) });
            }
            begun = ends;
        }
        shows.extend((self.until + 1..motion.len()).map(|frame| (frame, 0.0)));
        shown(motion, &shows)
    }
}

/// How much a person walks who gets about so fast, 0 to 1.
fn walks(speed: f32) -> f32 {
    smoothstep((speed - SETS_OFF.0) / (SETS_OFF.1 - SETS_OFF.0))
}

/// How fast the person gets about in each step from frame to frame, over a stride, m/s.
fn walking_speeds(motion: &Motion) -> Vec<f32> {
    let place = |frame: usize| motion.postures[frame].root_position.truncate();
    let steps: Vec<f32> = (1..motion.len()).map(|f| place(f).distance(place(f - 1)) * FRAME_RATE).collect();
    softened(&steps, STRIDE)
}

/// The fastest turn between two frames over what its joint may turn.
fn turned(pair: &[Posture], limits: &TurnLimits) -> f32 {
    let turn = |j: usize| angle_between(pair[0].rotations[j], pair[1].rotations[j]);
    (0..JOINT_COUNT).map(|j| turn(j) / limits.usual[j].max(1e-4)).fold(0.0, f32::max)
}

/// The motion with `frames` frames for each of its steps.
fn played(motion: &Motion, frames: &[f32]) -> Paced {
    let mut shows = Vec::new();
    // `begun`: when the step from frame `at` begins.
    let (mut at, mut begun) = (0, 0.0);
    for now in 0.. {
        while at < frames.len() && begun + frames[at] < now as f32 {
            begun += frames[at];
            at += 1;
        }
        let part = frames.get(at).map_or(0.0, |f| (now as f32 - begun) / f);
        shows.push((at, part));
        if at == frames.len() {
            break;
        }
    }
    shown(motion, &shows)
}

/// The motion that shows these of a motion's frames, each with the part of the way to the next.
fn shown(motion: &Motion, shows: &[(usize, f32)]) -> Paced {
    let mut paced = Motion::default();
    for &(at, part) in shows {
        paced.postures.push(between(motion, at, part));
        let after = motion.contacts[(at + usize::from(part > SAME)).min(motion.len() - 1)];
        paced.contacts.push([0, 1].map(|side| motion.contacts[at][side].min(after[side])));
    }
    Paced { motion: paced, shows: shows.iter().map(|&(at, part)| at as f32 + part).collect() }
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

    /// Somebody who stands for half a second, gets about so fast, m/s, for three, and stands again.
    fn glides(speed: f32) -> Motion {
        let mut motion = Motion::default();
        let mut way = 0.0;
        for frame in 0..120 {
            let mut posture = Posture::default();
            posture.root_position.y -= way;
            way += if (15..105).contains(&frame) { speed / FRAME_RATE } else { 0.0 };
            motion.postures.push(posture);
            motion.contacts.push([1.0; 2]);
        }
        motion
    }

    /// The farthest that anybody gets in a second, m.
    fn fastest(motion: &Motion) -> f32 {
        let seconds = motion.postures.windows(31).map(|p| p[30].root_position.distance(p[0].root_position));
        seconds.fold(0.0, f32::max)
    }

    const LOOSE: f32 = 1.0;

    #[test]
    fn who_hurries_is_there_on_the_frame_and_no_faster_than_people_walk() {
        let limits = TurnLimits::new([LOOSE; JOINT_COUNT]);
        for (speed, most) in [(1.2, 1.5), (1.5, 1.62), (1.8, 1.81)] {
            let motion = glides(speed);
            let leeway = Leeway::hurried(&motion, 110, &limits);
            for by in [leeway.most(), leeway.most() / 2, -1] {
                let paced = leeway.taken(&motion, by);
                let met = 110usize.saturating_add_signed(by);
                assert_eq!(
                    (paced.frame_of(110), paced.motion.len()),
                    (met, 120usize.saturating_add_signed(by))
                );
                // The same frames before and after, and all of the way.
                assert!(paced.motion.postures[met..] == motion.postures[110..]);
                assert_eq!(paced.motion.postures[0], motion.postures[0]);
                assert!(fastest(&paced.motion) < most, "{speed}: {}", fastest(&paced.motion));
                let ahead = |pair: &[Posture]| pair[1].root_position.y <= pair[0].root_position.y;
                assert!(paced.motion.postures.windows(2).all(ahead));
                // No seam: the pace changes slowly.
                assert!(paced.shows.windows(3).all(|s| (s[2] - 2.0 * s[1] + s[0]).abs() < 0.06));
            }
        }
        // By hand: 90 frames of 1.2 m/s at up to 1.25 times that, less where they set in.
        let most = Leeway::hurried(&glides(1.2), 110, &limits).most();
        assert!((-20..=-16).contains(&most), "{most}");
    }

    #[test]
    fn no_joint_is_hurried_beyond_its_limit() {
        let mut motion = glides(1.2);
        for (frame, posture) in motion.postures.iter_mut().enumerate() {
            posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_x(0.05 * frame as f32);
        }
        let most = |limit: f32| Leeway::hurried(&motion, 110, &TurnLimits::new([limit; JOINT_COUNT])).most();
        assert_eq!(most(0.05 / HURRIED_TURNS), 0);
        let (some, all) = (most(0.045), most(LOOSE));
        assert!(all < some && some < -5, "{some} {all}");
        let limits = TurnLimits::new([0.045; JOINT_COUNT]);
        let paced = Leeway::hurried(&motion, 110, &limits).taken(&motion, some);
        // Of the forearm: legs as straight as these bend to no side, and turn as it comes.
        let arm = |posture: &Posture| posture.rotations[Joint::LeftForeArm.index()];
        let turns = paced.motion.postures.windows(2).map(|pair| angle_between(arm(&pair[0]), arm(&pair[1])));
        let fastest = turns.fold(0.0, f32::max);
        assert!(fastest <= 0.045 * HURRIED_TURNS, "{fastest}");
    }

    #[test]
    fn who_takes_their_time_still_walks() {
        for (speed, least) in [(1.2, 0.95), (0.7, 0.595)] {
            let motion = glides(speed);
            let leeway = Leeway::leisurely(&motion, 110);
            let most = leeway.most();
            assert!(most > 4, "{most}");
            let paced = leeway.taken(&motion, most);
            assert_eq!(paced.frame_of(110), 110usize.saturating_add_signed(most));
            let slowest = paced.motion.postures[50..80].windows(2);
            let slowest = slowest.map(|p| p[1].root_position.distance(p[0].root_position) * FRAME_RATE);
            assert!(slowest.fold(f32::MAX, f32::min) > least);
        }
        // Who stands has no walk to slow down.
        assert_eq!(Leeway::leisurely(&glides(0.0), 110).most(), 0);
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
