//! Arms and trunks as no pose of the library has them.

use glam::{Quat, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::percent;
use super::spans::{Span, Spans};
use crate::library::KnownPoses;
use crate::motion::{FRAME_RATE, Motion, Pose};
use crate::scene::SceneIndex;

/// A pose farther than this from every pose of the library is none that it has, degrees.
const FAR: f32 = 20.0;
/// Every so many frames are looked at, each for itself and those up to the next.
const STEP: usize = 3;
/// A gap is near that one is in within so many frames.
const NEAR: usize = FRAME_RATE as usize;
/// Gaps wider than this are none, metres.
const WIDEST: f32 = 1.0;
/// A gap up to this asks for another pose than the library's, cm.
const ASKS: f32 = 70.0;
/// A gap is looked for at these heights over the pelvis, metres …
const GAP_HEIGHTS: [f32; 3] = [-0.3, 0.0, 0.3];
/// … and in so many directions over half a turn.
const GAP_DIRECTIONS: usize = 12;

/// A part whose pose is held against the library's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)] // Their names say it.
pub enum PosedPart {
    LeftArm,
    RightArm,
    Trunk,
}

/// How far arms and trunk are from the poses of the library that the motion was made with.
///
/// The distance of two poses is the largest of the angles between their bones: upper arm and forearm in the chest's frame;
/// the spine's three parts, neck, head and the line across the chest in the pelvis's.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseDistanceFigures {
    /// Share of the frames in which an arm is farther than 20° from every pose of an arm, percent.
    pub arms_percent: f32,
    /// The farthest that an arm gets, degrees.
    pub arms_worst_degrees: f32,
    /// Share of the frames in which the trunk is farther than 20° from every pose of a trunk, percent.
    pub trunk_percent: f32,
    /// The farthest that the trunk gets, degrees.
    pub trunk_worst_degrees: f32,
    /// Where, from frame to frame, the farthest first.
    pub beyond: Vec<FarPose>,
}

/// A part farther than 20° from every pose of the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FarPose {
    /// Which.
    pub part: PosedPart,
    /// The first frame.
    pub first: usize,
    /// The frame after the last.
    pub end: usize,
    /// How far from the nearest at most, degrees.
    pub degrees: f32,
    /// The frame in which it is farthest.
    pub frame: usize,
    /// The narrowest gap that the body is in from a second before until a second after, cm: what turns arms rightly. None
    /// where all are wider than a metre, or no scene was given.
    pub gap_cm: Option<f32>,
}

/// Figures of a motion beside the library that it was made with.
pub fn pose_distance_figures(
    motion: &Motion,
    known: &KnownPoses,
    scene: Option<&SceneIndex>,
) -> PoseDistanceFigures {
    let count = motion.len();
    let looked_at: Vec<usize> = (0..count).step_by(STEP).collect();
    let distances: Vec<[f32; 3]> = looked_at
        .par_iter()
        .map(|&frame| {
            let pose = motion.postures[frame].pose();
            [known.arm_distance(&pose, 0), known.arm_distance(&pose, 1), known.trunk_distance(&pose)]
        })
        .collect();
    let mut spans: Spans<PosedPart, ()> = Spans::default();
    let (mut arms, mut trunk) = (Share::default(), Share::default());
    for (&frame, &[left, right, back]) in looked_at.iter().zip(&distances) {
        let end = (frame + STEP).min(count);
        arms.add(left.max(right), end - frame);
        trunk.add(back, end - frame);
        let parts = [(PosedPart::LeftArm, left), (PosedPart::RightArm, right), (PosedPart::Trunk, back)];
        for (part, degrees) in parts.into_iter().filter(|(_, degrees)| *degrees > FAR) {
            (frame..end).for_each(|frame| spans.add(frame, part, degrees, ()));
        }
    }
    let told = |span: Span<PosedPart, ()>| FarPose {
        part: span.key,
        first: span.first,
        end: span.end,
        degrees: span.worst,
        frame: span.worst_frame,
        gap_cm: scene
            .and_then(|scene| narrowest_gap(motion, scene, span.first, span.end))
            .map(|gap| 100.0 * gap),
    };
    PoseDistanceFigures {
        arms_percent: percent(arms.far, count),
        arms_worst_degrees: arms.worst,
        trunk_percent: percent(trunk.far, count),
        trunk_worst_degrees: trunk.worst,
        beyond: spans.worst_first().into_iter().map(told).collect(),
    }
}

impl PoseDistanceFigures {
    /// How often arm or trunk are far from what the library has for more than `brief` frames, where no gap asks for it.
    pub(crate) fn unasked(&self, brief: usize) -> usize {
        let wide = |far: &FarPose| far.gap_cm.is_none_or(|gap| gap > ASKS);
        self.beyond.iter().filter(|far| far.end - far.first > brief && wide(far)).count()
    }
}

#[derive(Default)]
struct Share {
    far: usize,
    worst: f32,
}

impl Share {
    fn add(&mut self, degrees: f32, frames: usize) {
        self.worst = self.worst.max(degrees);
        self.far += if degrees > FAR { frames } else { 0 };
    }
}

/// The narrowest gap that the body is in about frames `first` to `end`, metres.
fn narrowest_gap(motion: &Motion, scene: &SceneIndex, first: usize, end: usize) -> Option<f32> {
    let about = first.saturating_sub(NEAR)..(end + NEAR).min(motion.len());
    about.step_by(STEP).filter_map(|frame| gap(&motion.postures[frame].pose(), scene)).min_by(f32::total_cmp)
}

/// How wide the narrowest gap is that the pelvis is in, metres: between what stands opposite each other.
fn gap(pose: &Pose, scene: &SceneIndex) -> Option<f32> {
    let pelvis = pose.positions[0];
    let across =
        |k: usize| Quat::from_rotation_z(std::f32::consts::PI * k as f32 / GAP_DIRECTIONS as f32) * Vec3::X;
    let lines = GAP_HEIGHTS.into_iter().flat_map(|up| (0..GAP_DIRECTIONS).map(move |k| (up, k)));
    lines
        .filter_map(|(up, k)| {
            let from = pelvis + up * Vec3::Z;
            let one = scene.ray(from, across(k), WIDEST)?;
            Some(one + scene.ray(from, -across(k), WIDEST - one)?)
        })
        .min_by(f32::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Joint, Posture};
    use crate::test_world::room;

    /// So many frames at rest, in which the left arm is turned by `radians` in frames 6 to 14.
    fn motion(radians: f32) -> Motion {
        let mut postures = vec![Posture::default(); 20];
        for posture in &mut postures[6..15] {
            posture.rotations[Joint::LeftArm.index()] = Quat::from_rotation_y(radians);
        }
        Motion { contacts: vec![[1.0; 2]; postures.len()], postures }
    }

    fn figures(radians: f32, scene: Option<&SceneIndex>) -> PoseDistanceFigures {
        let known = KnownPoses::new([Posture::default().pose()].into_iter());
        pose_distance_figures(&motion(radians), &known, scene)
    }

    #[test]
    fn an_arm_that_is_far_is_told_with_its_frames() {
        let near = figures(0.34, None);
        assert_eq!((near.arms_percent, near.beyond.len()), (0.0, 0));
        assert!((near.arms_worst_degrees - 0.34f32.to_degrees()).abs() < 0.01, "{near:?}");
        let far = figures(0.5, None);
        // Frames 6, 9 and 12 are looked at, for nine of twenty.
        assert_eq!((far.arms_percent, far.trunk_percent, far.beyond.len()), (45.0, 0.0, 1), "{far:?}");
        let worst = &far.beyond[0];
        assert_eq!((worst.part, worst.first, worst.end, worst.frame), (PosedPart::LeftArm, 6, 15, 6));
        assert!((worst.degrees - 0.5f32.to_degrees()).abs() < 0.01 && worst.gap_cm.is_none());
        assert_eq!([3, 8, 9].map(|brief| far.unasked(brief)), [1, 1, 0]);
    }

    #[test]
    fn the_last_frames_count_for_themselves_alone() {
        let mut motion = motion(0.0);
        for posture in &mut motion.postures[18..] {
            posture.rotations[Joint::Spine.index()] = Quat::from_rotation_x(0.5);
        }
        let known = KnownPoses::new([Posture::default().pose()].into_iter());
        let found = pose_distance_figures(&motion, &known, None);
        assert_eq!((found.trunk_percent, found.arms_percent), (10.0, 0.0), "{found:?}");
        assert_eq!((found.beyond[0].part, found.beyond[0].end), (PosedPart::Trunk, 20));
    }

    #[test]
    fn the_gap_that_one_is_in_is_told() {
        let walls =
            |half: f32| room(&[([-2.0, -0.5, 0.0], [-half, 0.5, 2.0]), ([half, -0.5, 0.0], [2.0, 0.5, 2.0])]);
        let gap_of = |scene: &SceneIndex| figures(0.5, Some(scene)).beyond[0].gap_cm;
        assert!((gap_of(&walls(0.3)).expect("a gap") - 60.0).abs() < 0.01);
        assert_eq!(gap_of(&walls(0.55)), None);
        let unasked = |half: f32| figures(0.5, Some(&walls(half))).unasked(3);
        assert_eq!([0.3, 0.4, 0.55].map(unasked), [0, 1, 1]);
        // One wall is no gap, however near.
        assert_eq!(gap_of(&room(&[([-2.0, -0.5, 0.0], [-0.2, 0.5, 2.0])])), None);
    }
}
