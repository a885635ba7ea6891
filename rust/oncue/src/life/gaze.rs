//! A person who looks at something for a while, whatever the rest of the body does meanwhile: head and neck, and where these do not
//! suffice the chest, are laid over the motion that is there.
//!
//! The eyes, which the body has not, go first: the head sets off after them, takes the longer the farther it goes, and the chest comes after.
//! Nobody stares over the shoulder at what is behind: the head lets go of it, and comes back to it.

use std::f32::consts::TAU;
use std::ops::Range;

use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;

use super::limb::reach;
use super::score::{CHEST_FOLLOWS, LOOK_SECONDS, LOOK_SECONDS_PER_RADIAN};
use super::{Flaws, turn_trunk};
use crate::error::Result;
use crate::figures::Surroundings;
use crate::math::curve::least_jerk;
use crate::math::rotation::wrap_angle;
use crate::motion::skeleton::ARMS;
use crate::motion::{FRAME_RATE, Joint, Motion, Pose, Posture};
use crate::progress::Progress;

/// The gaze meets a place that it misses by no more than this, degrees.
pub(crate) const MEETS: f32 = 5.0;
/// Seconds by which the eyes are sooner than the head.
const EYES_LEAD: f32 = 0.15;
/// Between the eyes, in the head's frame, metres.
const EYES: Vec3 = Vec3::new(0.0, -0.09, 0.09);
/// How far a head turns on the chest, and looks up and down, degrees; it slows down within so much of that.
const HEAD_TURNS: f32 = 75.0;
const UP_AND_DOWN: (f32, f32) = (45.0, 50.0);
const SLOWS: f32 = 12.0;
/// The chest turns by such a part of what is farther round than this, and no farther than that, degrees.
const CHEST_SHARE: f32 = 0.55;
const CHEST_FROM: f32 = 35.0;
const CHEST_TURNS: f32 = 28.0;
/// What is farther round from where the chest faces is behind the person, degrees.
const BEHIND: f32 = HEAD_TURNS + CHEST_TURNS - SLOWS;
/// What is in view for a shorter time is not looked at, and what is out of view for a shorter time is not let go, seconds.
const SHORTEST: f32 = 0.6;
/// A hand that would come this far from where it is without has the chest turn less, metres.
const MISSES: f32 = 0.02;
/// How much of chest and head turns, where more would bring the body into itself or the scene or a joint beyond its limit.
const LESS: [(f32, f32); 5] = [(1.0, 1.0), (0.5, 1.0), (0.0, 1.0), (0.0, 0.5), (0.0, 0.0)];

/// Something that the person is to look at.
pub(crate) struct Gaze<'a> {
    /// From and to before which frame of the motion.
    pub frames: Range<usize>,
    /// Where it is on each frame of the motion, world, metres; after the last it stays.
    pub path: &'a [Vec3],
}

impl Gaze<'_> {
    fn place(&self, frame: usize) -> Vec3 {
        self.path[frame.min(self.path.len() - 1)]
    }
}

/// On how many frames a gaze is what.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct GazeFigures {
    /// It meets what is looked at.
    pub met: usize,
    /// The head is on its way there.
    pub turning: usize,
    /// What is looked at is behind the person, or so shortly in view that nobody turns to it.
    pub behind: usize,
    /// Joints, the own body or what stands around hold the head back, or it lies too high or low.
    pub held: usize,
}

/// Has a person look, and tells on how many frames of each gaze it is met. Frames before the first and well after the last are left to the
/// bit as they are; feet, pelvis and hands are everywhere.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn look(
    motion: &mut Motion,
    gazes: &[Gaze],
    around: &Surroundings,
    floor: f32,
    progress: &Progress,
) -> Result<Vec<GazeFigures>> {
    let bases: Vec<Base> = motion.postures.par_iter().map(Base::new).collect();
    let mut turns: Vec<Turn> = Vec::new();
    for (of, gaze) in gazes.iter().enumerate() {
        let angles = unwrapped(&bases, gaze);
        for seen in in_view(&angles, &gaze.frames) {
            let before = turns.last().filter(|turn| turn.leaves.end > seen.start);
            turns.push(Turn::new(of, seen, &angles, &bases, before));
        }
    }
    let touched: Vec<usize> =
        (0..motion.len()).filter(|&frame| turns.iter().any(|turn| turn.moves(frame))).collect();
    let rest: Vec<Flaws> =
        touched.par_iter().map(|&f| Flaws::on_frame(&motion.postures[f], around, f, floor)).collect();
    loop {
        progress.check()?;
        let played: Vec<(Posture, bool)> = touched
            .par_iter()
            .zip(&rest)
            .map(|(&frame, rest)| {
                let (posture, missed) = bases[frame].looking(&motion.postures[frame], frame, gazes, &turns);
                let over = Flaws::on_frame(&posture, around, frame, floor).over(rest).contains(&true);
                (posture, over || missed > MISSES)
            })
            .collect();
        let mut is_fine = true;
        for turn in turns.iter_mut().filter(|turn| turn.less + 1 < LESS.len()) {
            let too_much =
                |(&frame, (_, too_much)): (&usize, &(Posture, bool))| *too_much && turn.moves(frame);
            if touched.iter().zip(&played).any(too_much) {
                turn.less += 1;
                is_fine = false;
            }
        }
        if is_fine {
            for (&frame, (posture, _)) in touched.iter().zip(played) {
                motion.postures[frame] = posture;
            }
            break;
        }
    }
    let told = |(of, gaze): (usize, &Gaze)| {
        let mut told = GazeFigures::default();
        let own: Vec<&Turn> = turns.iter().filter(|turn| turn.of == of).collect();
        for frame in gaze.frames.clone() {
            let seen = own.iter().find(|turn| turn.seen.contains(&frame));
            let count = match seen {
                _ if missed_by(&motion.postures[frame].pose(), gaze.place(frame)) <= MEETS => &mut told.met,
                None => &mut told.behind,
                Some(turn) if turn.at(frame) < 1.0 => &mut told.turning,
                Some(_) => &mut told.held,
            };
            *count += 1;
        }
        told
    };
    Ok(gazes.iter().enumerate().map(told).collect())
}

/// How far a head is from facing a place, degrees.
fn missed_by(pose: &Pose, place: Vec3) -> f32 {
    let facing = pose.rotation(Joint::Head) * Vec3::NEG_Y;
    facing.angle_between(place - eyes(pose)).to_degrees()
}

fn eyes(pose: &Pose) -> Vec3 {
    pose.position(Joint::Head) + pose.rotation(Joint::Head) * EYES
}

/// Heading and elevation of a direction, radians.
fn angles_of(direction: Vec3) -> Vec2 {
    Vec2::new(direction.y.atan2(direction.x), direction.z.atan2(direction.truncate().length()))
}

/// Values beyond `most − slows` come ever slower to `most`, and no farther.
fn saturated(value: f32, most: f32, slows: f32) -> f32 {
    let over = (value.abs() - (most - slows)).clamp(0.0, 2.0 * slows);
    let within = value.abs().min(most - slows);
    value.signum() * (within + over - over * over / (4.0 * slows))
}

/// How a body without a gaze faces.
struct Base {
    /// Heading of the chest, radians.
    chest: f32,
    /// Where the head looks, from there to the left and up, radians.
    looks: Vec2,
    eyes: Vec3,
}

impl Base {
    fn new(posture: &Posture) -> Self {
        let pose = posture.pose();
        let facing = |joint: Joint| angles_of(pose.rotation(joint) * Vec3::NEG_Y);
        let (chest, head) = (facing(Joint::Spine2).x, facing(Joint::Head));
        Self { chest, looks: Vec2::new(wrap_angle(head.x - chest), head.y), eyes: eyes(&pose) }
    }

    /// The posture with what its head and chest turn to on a frame, and how far a hand is missed, metres.
    fn looking(&self, base: &Posture, frame: usize, gazes: &[Gaze], turns: &[Turn]) -> (Posture, f32) {
        let before = base.pose();
        let chest = turns.iter().fold(0.0, |chest, turn| {
            let to = chest_turn(turn.angles[frame - turn.first(frame)]) * LESS[turn.less].0;
            chest + (to - chest) * turn.chest_at(frame)
        });
        let carried = Quat::from_rotation_z(chest);
        let (mut head, mut posture, mut pose) = (carried, *base, before);
        // The eyes go along with the head: it is turned to where they are then.
        for round in 0..4 {
            if round > 0 {
                head = self.head_turn(frame, eyes(&pose), chest, gazes, turns);
            }
            turn_trunk(&mut posture, &before, before.rotation(Joint::Hips), [Quat::IDENTITY, carried, head]);
            pose = posture.pose();
        }
        let mut missed = 0.0f32;
        if chest != 0.0 {
            // What hands do they go on doing.
            for ([_, upper, lower, hand], sign) in ARMS.into_iter().zip([1.0, -1.0]) {
                let (to, turned) = (before.position(hand), before.rotation(hand));
                let limb = [upper, lower, hand];
                missed = missed.max(reach(&mut posture, &mut pose, limb, Vec3::Z * -sign, to, turned, 0.0));
            }
        }
        (posture, missed)
    }

    /// The turn of the head in the world by which eyes at a place look where they are to.
    fn head_turn(&self, frame: usize, eyes: Vec3, chest: f32, gazes: &[Gaze], turns: &[Turn]) -> Quat {
        // Who turns the chest takes the head along, and it has so much farther to go on its own.
        let (most, up, down) =
            (HEAD_TURNS.to_radians(), UP_AND_DOWN.0.to_radians(), UP_AND_DOWN.1.to_radians());
        let slows = SLOWS.to_radians();
        let looks = turns.iter().fold(self.looks, |looks, turn| {
            let seen = angles_of(gazes[turn.of].place(frame) - eyes);
            let known = turn.angles[frame - turn.first(frame)];
            // The same way round as over the whole turn.
            let across = known + wrap_angle(seen.x - self.chest - known);
            let across = chest + saturated(across - chest, most, slows);
            let upwards = saturated(seen.y, if seen.y > 0.0 { up } else { down }, slows);
            let share = turn.at(frame) * LESS[turn.less].1;
            looks + (Vec2::new(across, upwards) - looks) * share
        });
        // About the vertical, and about what lies level across the head's own facing.
        let from = self.chest + self.looks.x;
        let across = Vec3::new(from.sin(), -from.cos(), 0.0);
        Quat::from_rotation_z(looks.x - self.looks.x) * Quat::from_axis_angle(across, looks.y - self.looks.y)
    }
}

/// How far a chest turns to what is so far round, radians.
fn chest_turn(angle: f32) -> f32 {
    let over = angle.abs() - CHEST_FROM.to_radians();
    // What is over zero, without a kink there.
    let over = 0.5 * (over + (over * over + 1e-2).sqrt());
    let most = CHEST_TURNS.to_radians();
    angle.signum() * saturated(CHEST_SHARE * over, most, SLOWS.to_radians()) * smooth_sign(angle)
}

/// 0 straight ahead, 1 from some degrees on: what changes sides does so without a jump.
fn smooth_sign(angle: f32) -> f32 {
    least_jerk(angle.abs() / CHEST_FROM.to_radians())
}

/// How far a gaze's place is round from where the chest faces on every frame, to the left, radians: without jumps from behind one side to
/// behind the other from where it is in view on.
fn unwrapped(bases: &[Base], gaze: &Gaze) -> Vec<f32> {
    bases
        .iter()
        .enumerate()
        .map(|(frame, base)| wrap_angle(angles_of(gaze.place(frame) - base.eyes).x - base.chest))
        .collect()
}

/// The parts of a gaze's frames in which its place is in view.
fn in_view(angles: &[f32], frames: &Range<usize>) -> Vec<Range<usize>> {
    let shortest = (SHORTEST * FRAME_RATE) as usize;
    let mut parts: Vec<Range<usize>> = Vec::new();
    for frame in frames.clone().filter(|&frame| angles[frame].abs().to_degrees() <= BEHIND) {
        match parts.last_mut() {
            Some(part) if frame <= part.end + shortest => part.end = frame + 1,
            _ => parts.push(frame..frame + 1),
        }
    }
    parts.retain(|part| part.len() >= shortest);
    parts
}

/// One turn towards what is looked at, and away again.
struct Turn {
    /// Which gaze's.
    of: usize,
    /// The frames in which it is looked at.
    seen: Range<usize>,
    /// Frames that the head takes to get there.
    comes_in: f32,
    /// The frames in which it turns away; none at the motion's end.
    leaves: Range<usize>,
    /// How far round it is from `seen.start` on until it is left, radians.
    angles: Vec<f32>,
    /// The place in [`LESS`] of how much of it there is.
    less: usize,
}

impl Turn {
    fn new(of: usize, seen: Range<usize>, angles: &[f32], bases: &[Base], before: Option<&Turn>) -> Self {
        let takes = |angle: f32| {
            ((LOOK_SECONDS + LOOK_SECONDS_PER_RADIAN * angle.abs()) * FRAME_RATE).round() as usize
        };
        let from =
            before.map_or(bases[seen.start].looks.x, |turn| turn.angles[seen.start - turn.first(seen.start)]);
        let last = seen.end - 1;
        let away = takes(angles[last] - bases[last].looks.x);
        let leaves = seen.end..(seen.end + away).min(bases.len());
        // On over the back, where it goes there, never round the other way at once.
        let mut own = angles[seen.start..leaves.end].to_vec();
        for frame in 1..own.len() {
            own[frame] += TAU * ((own[frame - 1] - own[frame]) / TAU).round();
        }
        let comes_in = takes(angles[seen.start] - from) as f32;
        Self { of, seen, comes_in, leaves, angles: own, less: 0 }
    }

    /// The first frame of `angles`, for a frame within them; one outside counts as the nearest.
    fn first(&self, frame: usize) -> usize {
        let nearest = frame.clamp(self.seen.start, self.seen.start + self.angles.len() - 1);
        self.seen.start + frame - nearest
    }

    /// How far the head is turned there, 0 to 1.
    fn at(&self, frame: usize) -> f32 {
        self.at_time(frame as f32)
    }

    /// The same of the chest.
    fn chest_at(&self, frame: usize) -> f32 {
        self.at_time(frame as f32 - CHEST_FOLLOWS * FRAME_RATE)
    }

    fn moves(&self, frame: usize) -> bool {
        self.at(frame) > 0.0 || self.chest_at(frame) > 0.0
    }

    fn at_time(&self, frame: f32) -> f32 {
        let comes = (frame - self.seen.start as f32 - EYES_LEAD * FRAME_RATE) / self.comes_in;
        let is_left = if self.leaves.is_empty() {
            0.0
        } else {
            (frame - self.leaves.start as f32) / self.leaves.len() as f32
        };
        least_jerk(comes) * (1.0 - least_jerk(is_left))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::beyond_limits;
    use crate::math::Planar;
    use crate::scene::SceneIndex;
    use crate::seats::Seats;
    use crate::test_world::{STANDS, person, room};

    /// Stands at the origin facing −Y, its pelvis turning by so much a second, radians.
    fn turning(frames: usize, speed: f32) -> Motion {
        let at =
            |frame: usize| person(Planar::new(Vec2::ZERO, speed * frame as f32 / FRAME_RATE), STANDS, 0.0);
        Motion { postures: (0..frames).map(at).collect(), contacts: vec![[1.0; 2]; frames] }
    }

    fn looked(
        motion: &Motion,
        scene: &SceneIndex,
        gazes: &[(Range<usize>, Vec3)],
    ) -> (Motion, Vec<GazeFigures>) {
        let paths: Vec<[Vec3; 1]> = gazes.iter().map(|gaze| [gaze.1]).collect();
        let gazes: Vec<Gaze> =
            gazes.iter().zip(&paths).map(|(gaze, path)| Gaze { frames: gaze.0.clone(), path }).collect();
        let mut out = motion.clone();
        let around = Surroundings::with(scene, Seats::default());
        let told = look(&mut out, &gazes, &around, 0.0, &Progress::new()).expect("not cancelled");
        (out, told)
    }

    /// The fastest that a head turns in the world, degrees a second, and its hardest change, degrees a second from frame to frame.
    fn haste(motion: &Motion) -> (f32, f32) {
        let facing = |p: &Posture| p.pose().rotation(Joint::Head) * Vec3::NEG_Y;
        let all: Vec<Vec3> = motion.postures.iter().map(facing).collect();
        let speeds: Vec<Vec3> = all.windows(2).map(|w| (w[1] - w[0]) * FRAME_RATE).collect();
        let fastest = speeds.iter().map(|speed| speed.length()).fold(0.0, f32::max);
        let hardest = speeds.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, f32::max);
        (fastest.to_degrees(), hardest.to_degrees())
    }

    #[test]
    fn a_head_turns_to_a_place_and_away_again() {
        let scene = room(&[]);
        let motion = turning(240, 0.0);
        for (x, y, z) in [(0.6, -1.5, 1.6), (-1.4, -1.0, 1.1), (1.5, -0.2, 2.1), (-0.9, -0.15, 1.5)] {
            let place = Vec3::new(x, y, z);
            let (out, told) = looked(&motion, &scene, &[(30..150, place)]);
            let [told] = told[..] else { panic!("one gaze") };
            assert_eq!(told.met + told.turning, 120, "{place}: {told:?}");
            assert!(told.met > 60, "{place}: {told:?}");
            // Frames before are as they were, and so is the end.
            assert_eq!(out.postures[..31], motion.postures[..31]);
            assert_eq!(out.postures[230..], motion.postures[230..]);
            assert!(missed_by(&out.postures[120].pose(), place) < 0.5, "{place}");
            for (posture, base) in out.postures.iter().zip(&motion.postures) {
                assert!(beyond_limits(posture).iter().all(|b| b.2 < 0.0), "{place}");
                for joint in [Joint::LeftHand, Joint::RightHand, Joint::LeftFoot] {
                    assert!(posture.pose().position(joint).distance(base.pose().position(joint)) < 0.02);
                }
            }
            let (fastest, hardest) = haste(&out);
            assert!(fastest < 200.0 && hardest < 45.0, "{place}: {fastest}°/s, {hardest}");
        }
    }

    #[test]
    fn the_head_goes_first_and_the_chest_only_where_it_is_needed() {
        let scene = room(&[]);
        let (motion, yaw) = (turning(150, 0.0), |p: &Posture, joint: Joint| {
            angles_of(p.pose().rotation(joint) * Vec3::NEG_Y).x + std::f32::consts::FRAC_PI_2
        });
        let near = looked(&motion, &scene, &[(0..150, Vec3::new(0.5, -2.0, 1.6))]).0;
        assert!(near.postures.iter().all(|p| yaw(p, Joint::Spine2).abs() < 0.01));
        let far = looked(&motion, &scene, &[(0..150, Vec3::new(2.0, -0.2, 1.6))]).0;
        let begins = |joint: Joint| far.postures.iter().position(|p| yaw(p, joint) > 0.05).expect("it turns");
        assert!(begins(Joint::Head) >= 4 && begins(Joint::Head) + 5 < begins(Joint::Spine2));
        let last = &far.postures[149];
        assert!((0.3..0.6).contains(&yaw(last, Joint::Spine2)), "{}", yaw(last, Joint::Spine2));
        assert!(yaw(last, Joint::Spine) < 0.6 * yaw(last, Joint::Spine2));
    }

    #[test]
    fn what_comes_to_be_behind_is_let_go_and_what_was_behind_is_found() {
        let scene = room(&[]);
        // Twice round in twelve seconds, 60° a second.
        let motion = turning(360, TAU / 6.0);
        let place = Vec3::new(0.0, -2.0, 1.6);
        let (out, told) = looked(&motion, &scene, &[(0..360, place)]);
        let [told] = told[..] else { panic!("one gaze") };
        assert!(told.behind > 80 && told.met > 80, "{told:?}");
        let (fastest, hardest) = haste(&out);
        assert!(fastest < 260.0 && hardest < 60.0, "{fastest}°/s, {hardest}");
        assert!(out.postures.iter().all(|p| beyond_limits(p).iter().all(|b| b.2 < 0.0)));
        // What is behind all the time is not looked at, and nothing is done.
        let behind = Vec3::new(0.0, 2.0, 1.6);
        let still = turning(90, 0.0);
        let (out, told) = looked(&still, &scene, &[(0..90, behind)]);
        assert_eq!((out, told), (still, vec![GazeFigures { behind: 90, ..GazeFigures::default() }]));
    }

    #[test]
    fn from_one_place_to_the_next_without_a_look_between() {
        let scene = room(&[]);
        let (left, right) = (Vec3::new(1.2, -1.5, 1.6), Vec3::new(-1.2, -1.5, 1.4));
        let (out, told) = looked(&turning(200, 0.0), &scene, &[(0..90, left), (90..200, right)]);
        assert!(told[0].met > 40 && told[1].met > 40, "{told:?}");
        let (fastest, hardest) = haste(&out);
        assert!(fastest < 220.0 && hardest < 45.0, "{fastest}°/s, {hardest}");
        assert!(missed_by(&out.postures[199].pose(), right) < 0.5);
    }

    #[test]
    fn what_stands_around_holds_it_back() {
        // A board so near before the face that a head that turns down comes into it.
        let free = room(&[]);
        let shut = room(&[([-0.5, -0.75, 1.0], [0.5, -0.15, 1.35])]);
        let place = Vec3::new(0.0, -0.5, 0.2);
        let motion = turning(120, 0.0);
        let (_, told) = looked(&motion, &free, &[(0..120, place)]);
        // Too far down for anybody.
        assert!(told[0].met == 0 && told[0].held > 60, "{told:?}");
        let around = Surroundings::with(&shut, Seats::default());
        let (out, _) = looked(&motion, &shut, &[(0..120, place)]);
        for (posture, base) in out.postures.iter().zip(&motion.postures) {
            let rest = Flaws::on_frame(base, &around, 0, 0.0);
            assert!(!Flaws::on_frame(posture, &around, 0, 0.0).over(&rest).contains(&true));
        }
    }

    #[test]
    fn saturated_by_hand() {
        assert_eq!([-3.0, 0.5, 4.0].map(|x| saturated(x, 10.0, 2.0)), [-3.0, 0.5, 4.0]);
        assert_eq!([12.0, 50.0, -50.0].map(|x| saturated(x, 10.0, 2.0)), [10.0, 10.0, -10.0]);
        let (before, at, after) =
            (saturated(7.9, 10.0, 2.0), saturated(8.0, 10.0, 2.0), saturated(8.1, 10.0, 2.0));
        assert!((at - before - 0.1).abs() < 1e-4 && (after - at - 0.1).abs() < 2e-3);
    }
}
