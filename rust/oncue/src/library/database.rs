//! A [`MotionLibrary`] made matchable: one plain struct of arrays over all frames, and one search
//! index an action type.

use std::sync::OnceLock;

use glam::{Quat, Vec3};
use ndarray::{Array2, aview1};
use rayon::prelude::*;

use super::clip::{MotionLibrary, Segment};
use super::contact::standing;
use super::feature::{
    FUTURE_FRAMES, FeatureWeights, Future, MAX_FEATURE, PoseFeature, feature_size, pose_feature,
    write_feature,
};
use super::known_poses::KnownPoses;
use super::rise::{Rise, rises};
use super::search::SearchIndex;
use super::start::{Start, starts};
use super::sufficiency::STANDING_FRAMES;
use crate::action::{ActionLabel, ActionType, Completion, FutureKind};
use crate::error::{Error, Result};
use crate::math::Planar;
use crate::math::curve::softened;
use crate::math::rotation::{angle_between, from_angle_axis, to_angle_axis};
use crate::motion::speed::{joint_accelerations, joint_turns};
use crate::motion::{FootContact, JOINT_COUNT, Joint, Posture};
use crate::progress::Progress;

/// One frame of the database, as the synthesizer needs it. Everything person-centric: the root's
/// projection stands at the origin and faces -Y.
#[derive(Debug, Clone)]
pub struct DatabaseFrame {
    /// The posture carried to the origin.
    pub posture: Posture,
    /// From this frame's person-centric space to the next frame's; standing still at a clip's end.
    pub step: Planar,
    /// From the clip's first frame to this one.
    travelled: Planar,
    pub contact: FootContact,
    /// Whether the heel or the ball of each foot carries it.
    pub stands: [bool; 2],
    /// Frames until it does, from where each swings; `u16::MAX` where the clip ends before.
    pub until_stands: [u16; 2],
    /// Toe joints.
    pub toe: [Vec3; 2],
    /// Rotations of the feet (not relative to the shin).
    pub foot_rotation: [Quat; 2],
    pub clip: u32,
    /// Frame in the clip.
    pub index: u32,
    /// Label of the segment it lies in.
    pub label: ActionLabel,
    /// For sit, stop and stand-up: frames until the action is complete (0 from then on).
    pub until_complete: u16,
    /// Frames until the pelvis rests on the seat, from where a person may still turn; for a stop as `until_complete`.
    pub until_seated: u16,
    /// Frames that follow in the clip before its end.
    pub remaining: u16,
    /// How readily this frame takes a part of what the action must be turned and shifted by to end at its cue: most
    /// while a foot swings, so that no planted foot is dragged along. From frame to frame it changes slowly.
    pub gives_way: GivesWay,
}

/// See [`DatabaseFrame::gives_way`].
#[derive(Debug, Clone, Copy, Default)]
pub struct GivesWay {
    pub turn: f32,
    /// Who sits, and turns on the seat, does not glide along it.
    pub shift: f32,
}

/// What even a frame with both feet planted takes: the pelvis can move a little over standing feet.
const PLANTED_SHARE: f32 = 0.06;
/// Frames to either side over which that is spread, so that the pelvis is not pushed from one frame to the next.
const SPREAD_FRAMES: usize = 5;

/// The search index of one action type.
#[derive(Debug, Clone, Default)]
struct ActionIndex {
    search: SearchIndex,
    /// Database frame of each entry.
    frames: Vec<u32>,
    /// Entry of each database frame; `u32::MAX` where the frame may not be entered.
    entries: Vec<u32>,
    /// How far an entry's action ends from where it is entered, metres, at the most; 0 for walking.
    reach: f32,
}

/// A matched frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameMatch {
    /// Index into [`MotionDatabase::frames`].
    pub frame: usize,
    /// ‖w_f ⊙ (x - y_k)‖².
    pub cost: f32,
}

/// How fast each joint may turn.
#[derive(Debug, Clone, Copy)]
pub struct TurnLimits {
    /// 99.9th percentile of the joint's turn in a frame, radians.
    pub usual: [f32; JOINT_COUNT],
    /// Cosine of half of it, and what rounding may add: what rules nearly all turns out without an arc function.
    half_cosine: [f32; JOINT_COUNT],
}

impl TurnLimits {
    pub fn new(usual: [f32; JOINT_COUNT]) -> Self {
        // A turn of a quarter of a degree differs from none in the last digits of its cosine alone.
        Self { usual, half_cosine: usual.map(|turn| (0.5 * turn).cos() + 4.0 * f32::EPSILON) }
    }

    /// `to`, or as much of the way there from `from` as the joint turns at the most; `None` where that is all of it.
    #[inline]
    pub fn slowed_down(&self, joint: usize, from: Quat, to: Quat) -> Option<Quat> {
        if from.dot(to).abs() >= self.half_cosine[joint] {
            return None;
        }
        // A thousandth less, for what rounding adds.
        let most = 0.999 * self.usual[joint];
        let turn = to_angle_axis(to * from.inverse());
        if turn.length() <= self.usual[joint] {
            return None;
        }
        Some((from_angle_axis(turn.clamp_length_max(most)) * from).normalize())
    }

    /// The turn from `from` to `to` over the joint's usual one, at least 1.
    #[inline]
    pub fn ratio(&self, joint: usize, from: Quat, to: Quat) -> f32 {
        if from.dot(to).abs() >= self.half_cosine[joint] {
            return 1.0;
        }
        (angle_between(from, to) / self.usual[joint].max(1e-4)).max(1.0)
    }
}

/// The database that S searches.
#[derive(Debug, Clone)]
pub struct MotionDatabase {
    /// [`MotionLibrary::checksum`] of what it was built from.
    pub library_checksum: String,
    /// Every frame of every clip.
    pub frames: Vec<DatabaseFrame>,
    /// {p_j}, {ṗ_j}, θ_up, c of every frame.
    pub pose_features: Vec<PoseFeature>,
    /// w_f², with which the search was built.
    pub weights: FeatureWeights,
    /// One an action type.
    indices: [ActionIndex; ActionType::COUNT],
    /// How fast the joints turn in all that is matched.
    pub turns: TurnLimits,
    /// 99.9th percentile of each joint's acceleration in the library, m/s².
    pub accelerations: [f32; JOINT_COUNT],
    /// Frames of standing still, at which a motion may begin.
    pub idle_frames: Vec<u32>,
    /// First steps, with which a motion begins where one leads its way.
    pub starts: Vec<Start>,
    /// How one gets up from a seat.
    pub rises: Vec<Rise>,
    /// See [`MotionDatabase::known_poses`].
    known_poses: OnceLock<KnownPoses>,
}

/// Sits and stops are entered at the latest this many frames before they complete…
const ENTER_BEFORE: u16 = 18;
/// …and at the earliest this many before the pelvis is on the seat (the released sit clips are 85 frames long).
const ENTER_WITHIN: u16 = 100;
/// The pelvis rests: it is no more than this higher than in the end, metres.
const REST_HEIGHT: f32 = 0.015;

impl MotionDatabase {
    /// Computes the features of every frame and builds the indices.
    ///
    /// # Errors
    /// `Input` where the library has no standing or no walking; `Cancelled`.
    pub fn build(library: &MotionLibrary, weights: &FeatureWeights, progress: &Progress) -> Result<Self> {
        weights.validate()?;
        let per_clip = library
            .clips
            .par_iter()
            .enumerate()
            .map(|(c, clip)| progress.check().map(|()| clip_frames(c, clip)))
            .collect::<Result<Vec<(Vec<DatabaseFrame>, Vec<PoseFeature>)>>>()?;
        let mut frames = Vec::with_capacity(library.frame_count());
        let mut pose_features = Vec::with_capacity(library.frame_count());
        for (f, p) in per_clip {
            frames.extend(f);
            pose_features.extend(p);
        }
        let stands = |f: &DatabaseFrame| {
            f.label == ActionLabel::Idle && usize::from(f.remaining) + 1 >= STANDING_FRAMES
        };
        let idle_frames =
            (0..frames.len() as u32).filter(|&f| stands(&frames[f as usize])).collect::<Vec<u32>>();
        let matched =
            frames.iter().zip(frames.iter().skip(1)).filter(|(a, _)| a.remaining > 0 && a.label.is_matched());
        // Both are carried to the origin: the way from one to the other is put back, or the hips would never turn round.
        let pairs = matched.map(|(a, b)| (a.posture, b.posture.moved(Planar::default(), a.step)));
        let turns = TurnLimits::new(joint_turns(pairs, 0.999));
        let accelerations = joint_accelerations(library.clips.iter().map(|clip| &clip.motion), 0.999);
        let mut database = Self {
            library_checksum: library.checksum(),
            frames,
            pose_features,
            weights: weights.clone(),
            indices: Default::default(),
            turns,
            accelerations,
            idle_frames,
            starts: Vec::new(),
            rises: Vec::new(),
            known_poses: OnceLock::new(),
        };
        if database.idle_frames.is_empty() {
            return Err(Error::input(
                "The motion library has no standing still to begin from; add an idle clip or let the starter library fill in what is missing.",
            ));
        }
        database.starts = starts(&database.frames, |frame, ahead| database.travel(frame, ahead));
        database.rises = rises(&database.frames);
        let built = ActionType::ALL
            .par_iter()
            .map(|&a| database.index(a, progress))
            .collect::<Result<Vec<ActionIndex>>>()?;
        for (slot, index) in database.indices.iter_mut().zip(built) {
            *slot = index;
        }
        if database.indices[ActionType::LOCOMOTION.index()].search.is_empty() {
            return Err(Error::input(
                "The motion library has no walking; add walking clips or the starter library.",
            ));
        }
        Ok(database)
    }

    fn index(&self, action_type: ActionType, progress: &Progress) -> Result<ActionIndex> {
        let size = feature_size(action_type);
        let mut features = Array2::zeros((0, size));
        let mut frames = Vec::new();
        let mut entries = vec![u32::MAX; self.frames.len()];
        let mut reach = 0.0f32;
        for f in 0..self.frames.len() {
            if f % 1024 == 0 {
                progress.check()?;
            }
            if let Some(future) = self.future(action_type, f) {
                if let Future::Complete(end, _) = &future {
                    reach = reach.max(end.position.length());
                }
                entries[f] = frames.len() as u32;
                frames.push(f as u32);
                let mut feature = [0.0; MAX_FEATURE];
                write_feature(&self.pose_features[f], &future, &mut feature[..size]);
                features
                    .push_row(aview1(&feature[..size]))
                    .unwrap_or_else(|_| unreachable!("a row of its size"));
            }
        }
        let search = SearchIndex::build(features.view(), &self.weights.vector(action_type));
        Ok(ActionIndex { search, frames, entries, reach })
    }

    /// o_future of a frame, or `None` where it may not be entered for this action.
    pub fn future(&self, action_type: ActionType, frame: usize) -> Option<Future> {
        let f = &self.frames[frame];
        let spec = action_type.spec();
        if !spec.entered_in.contains(&f.label) {
            return None;
        }
        match spec.future {
            // The last 30 frames of a clip have no complete future.
            FutureKind::Path => (usize::from(f.remaining) >= FUTURE_FRAMES[2])
                .then(|| Future::Walk(FUTURE_FRAMES.map(|ahead| self.travel(frame, ahead)))),
            FutureKind::Completion => {
                let ahead = f.until_complete;
                let in_time = ahead >= ENTER_BEFORE && f.until_seated <= ENTER_WITHIN;
                (in_time && f.remaining >= ahead).then(|| {
                    let end = &self.frames[frame + usize::from(ahead)];
                    Future::Complete(self.travel(frame, usize::from(ahead)), end.posture.root_position.z)
                })
            }
        }
    }

    /// The poses of arms and trunk that the library has; made when they are first asked for.
    pub fn known_poses(&self) -> &KnownPoses {
        self.known_poses.get_or_init(|| KnownPoses::new(self.frames.iter().map(|frame| frame.posture.pose())))
    }

    /// Where the root is `ahead` frames later, person-centric. Stays inside the clip.
    pub fn travel(&self, frame: usize, ahead: usize) -> Planar {
        let ahead = ahead.min(usize::from(self.frames[frame].remaining));
        self.frames[frame].travelled.relative(self.frames[frame + ahead].travelled)
    }

    /// k*: the best frame to enter for `query` (LAMA, eq. 2). `hint` only speeds the search up. Frames whose place among
    /// [`MotionDatabase::entries`] is true in `passed_over` are not entered; it may be empty.
    pub fn search(
        &self,
        action_type: ActionType,
        query: &[f32],
        hint: Option<usize>,
        passed_over: &[bool],
    ) -> Option<FrameMatch> {
        let index = &self.indices[action_type.index()];
        let hint = hint.and_then(|f| index.entries.get(f)).filter(|e| **e != u32::MAX).map(|e| *e as usize);
        let found = index.search.nearest(query, hint, passed_over)?;
        Some(FrameMatch { frame: index.frames[found.entry] as usize, cost: found.cost })
    }

    /// The cost of one frame for `query`, or `None` where it may not be entered.
    pub fn cost(&self, action_type: ActionType, query: &[f32], frame: usize) -> Option<f32> {
        let index = &self.indices[action_type.index()];
        let entry = *index.entries.get(frame)?;
        (entry != u32::MAX).then(|| index.search.cost(query, entry as usize))
    }

    /// How far a sit or stop ends from where it is entered at the most, metres.
    pub fn reach(&self, action_type: ActionType) -> f32 {
        self.indices[action_type.index()].reach
    }

    /// The frames that may be entered for an action.
    pub fn entries(&self, action_type: ActionType) -> &[u32] {
        &self.indices[action_type.index()].frames
    }
}

fn clip_frames(clip_index: usize, clip: &super::clip::Clip) -> (Vec<DatabaseFrame>, Vec<PoseFeature>) {
    let motion = &clip.motion;
    let count = motion.len();
    let poses: Vec<_> = motion.postures.iter().map(Posture::pose).collect();
    let planars: Vec<_> = motion.postures.iter().map(Posture::planar).collect();
    let stands = standing(&poses, &motion.contacts);
    let mut frames = Vec::with_capacity(count);
    let mut features = Vec::with_capacity(count);
    for i in 0..count {
        let here = planars[i];
        let local = motion.postures[i].moved(here, Planar::default());
        let pose = local.pose();
        let step = if i + 1 < count { here.relative(planars[i + 1]) } else { Planar::default() };
        let nothing = Segment { label: ActionLabel::Other, first: 0, end: count, complete: count };
        let segment = clip.segments.iter().find(|s| (s.first..s.end).contains(&i)).unwrap_or(&nothing);
        let completion = segment.label.completion();
        let complete = segment.complete.min(count.saturating_sub(1));
        let height = |f: usize| motion.postures[f].root_position.z;
        let rests = |f: &usize| height(*f) <= height(complete) + REST_HEIGHT;
        let (until_complete, until_seated) = match completion {
            Completion::Never => (0, 0),
            Completion::AtItsFrame => (complete.saturating_sub(i), complete.saturating_sub(i)),
            Completion::OnceSeated => {
                let seated = (i..complete).find(rests).unwrap_or(complete);
                (complete.saturating_sub(i), seated.saturating_sub(i))
            }
        };
        frames.push(DatabaseFrame {
            posture: local,
            step,
            travelled: planars[0].relative(here),
            contact: motion.contacts.get(i).copied().unwrap_or([0.0; 2]),
            stands: stands[i],
            until_stands: [u16::MAX; 2],
            toe: Joint::TOES.map(|j| pose.position(j)),
            foot_rotation: Joint::FEET.map(|j| pose.rotation(j)),
            clip: clip_index as u32,
            index: i as u32,
            label: segment.label,
            until_complete: until_complete as u16,
            until_seated: until_seated as u16,
            remaining: (count - 1 - i).min(usize::from(u16::MAX)) as u16,
            gives_way: GivesWay::default(),
        });
        features.push(pose_feature(&poses[i], &poses[i.saturating_sub(1)], frames[i].contact));
    }
    let mut until = [u16::MAX; 2];
    for frame in frames.iter_mut().rev() {
        until = [0, 1].map(|side| if frame.stands[side] { 0 } else { until[side].saturating_add(1) });
        frame.until_stands = until;
    }
    if count > 1 {
        // The first frame has no frame before it: it moves as the second does.
        let velocity = features[1][super::feature::VELOCITY..super::feature::UP].to_vec();
        features[0][super::feature::VELOCITY..super::feature::UP].copy_from_slice(&velocity);
    }
    let swing: Vec<f32> = frames
        .iter()
        .map(|f| PLANTED_SHARE + f.contact.iter().map(|c| 1.0 - c).sum::<f32>().min(1.0))
        .collect();
    let stands: Vec<f32> =
        frames.iter().zip(&swing).map(|(f, s)| if f.until_seated > 0 { *s } else { 0.0 }).collect();
    for (frame, (turn, shift)) in frames
        .iter_mut()
        .zip(softened(&swing, SPREAD_FRAMES).into_iter().zip(softened(&stands, SPREAD_FRAMES)))
    {
        frame.gives_way = GivesWay { turn, shift };
    }
    (frames, features)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{database, frame_of};

    #[test]
    fn the_smallest_turns_are_told_apart() {
        // A collar bone that turns a quarter of a degree in a frame at the most.
        let limits = TurnLimits::new([0.004; JOINT_COUNT]);
        for (turn, ratio) in [(0.0039, 1.0), (0.00404, 1.01), (0.0041, 1.025)] {
            let to = Quat::from_rotation_y(turn);
            assert!((limits.ratio(3, Quat::IDENTITY, to) - ratio).abs() < 2e-3, "{turn}");
            assert_eq!(limits.slowed_down(3, Quat::IDENTITY, to).is_some(), ratio > 1.0, "{turn}");
        }
    }

    #[test]
    fn frames_until_a_foot_stands_count_down_to_it() {
        let frames = &database().frames;
        for (at, pair) in frames.windows(2).enumerate().filter(|(_, pair)| pair[0].remaining > 0) {
            for side in 0..2 {
                let (now, next) = (pair[0].until_stands[side], pair[1].until_stands[side]);
                let expected = if pair[0].stands[side] { 0 } else { next.saturating_add(1) };
                assert_eq!(now, expected, "frame {at}");
            }
        }
        // Who stands, stands; who glides and never does comes to no ground.
        assert!(frames[frame_of("stand", 0)].stands == [true; 2]);
        assert_eq!(frames[frame_of("walk", 0)].until_stands, [u16::MAX; 2]);
    }
}
