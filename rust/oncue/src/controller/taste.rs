//! What a take prefers (ours; the paper's policy plays the same again and again).
//!
//! Seeds are to differ as takes do. Each enters sits and stops that end in other postures than those of the seeds beside it,
//! passes over some of the walks, and walks a little faster or slower; a livelier take enters clips in which more moves, a
//! calmer one others. Half of the rollouts follow the take's own taste, the others those of the next seeds or none at all: where
//! the seat allows no other, the motion is kept that fits.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::action::{ActionType, FutureKind};
use crate::library::database::MotionDatabase;
use crate::library::feature::{PoseFeature, VELOCITY};
use crate::motion::Joint;
use crate::settings::{KeptSettings, Settings};

/// How much faster or slower one take walks than the next, as a part of the pace.
const PACE_VARIES: f32 = 0.06;
/// …and the liveliest than one as usual.
const LIVELY_PACE: f32 = 0.15;

/// How many of the next seeds' tastes are followed by some of a take's rollouts.
const OTHERS: usize = 2;
/// How often the means are taken anew.
const ROUNDS: usize = 10;

/// See the module.
#[derive(Debug, Clone)]
pub(crate) struct Taste {
    /// Of each action type's entries, those that are not entered; empty where all are.
    passed_over: [Vec<bool>; ActionType::COUNT],
    /// Of the usual pace.
    pub(crate) pace: f32,
}

impl Default for Taste {
    /// None: all is entered, at the usual pace.
    fn default() -> Self {
        Self { passed_over: Default::default(), pace: 1.0 }
    }
}

/// How the clips of a library are shared out among the takes of a task.
struct Shares {
    /// See [`by_liveliness`].
    lively: Vec<f32>,
    /// Of the walks: the take that passes a clip over.
    walks: Vec<usize>,
    /// Of each action type that completes: the take that enters a clip. Who ends too high or too low is nobody's.
    endings: [BTreeMap<u32, usize>; ActionType::COUNT],
}

impl Shares {
    fn new(database: &MotionDatabase, height: Option<f32>, settings: &Settings) -> Self {
        let takes = settings.kept.takes.max(1);
        let lively = by_liveliness(&clip_motion(database));
        let part = |clip: usize| Pcg64::seed_from_u64(clip as u64).random_range(0..takes);
        let endings = std::array::from_fn(|at| match ActionType::ALL[at].spec().future {
            FutureKind::Path => BTreeMap::new(),
            FutureKind::Completion => {
                let about = height.map(|height| (height, settings.synthesizer.refuse_height));
                shared_out(&endings(database, ActionType::ALL[at], about), takes)
            }
        });
        Self { walks: (0..lively.len()).map(part).collect(), lively, endings }
    }
}

impl Taste {
    /// The taste of the take with this seed.
    fn of_take(database: &MotionDatabase, seed: u64, shares: &Shares, settings: &KeptSettings) -> Self {
        let liveliness = settings.liveliness;
        let takes = settings.takes.max(1);
        // Consecutive seeds share the clips out among them.
        let own = (seed % takes as u64) as usize;
        let liked = (liveliness.max(0.0) / 2.0, 1.0 + liveliness.min(0.0) / 2.0);
        let liked = |clip: u32| (liked.0..=liked.1).contains(&shares.lively[clip as usize]);
        let passed_over = std::array::from_fn(|at| {
            let action_type = ActionType::ALL[at];
            let clips =
                database.entries(action_type).iter().map(|frame| database.frames[*frame as usize].clip);
            match action_type.spec().future {
                FutureKind::Path => {
                    clips.map(|clip| takes > 1 && shares.walks[clip as usize] == own).collect()
                }
                FutureKind::Completion => {
                    let owner = |clip: u32| shares.endings[at].get(&clip).copied().unwrap_or(own);
                    clips.map(|clip| owner(clip) != own || !liked(clip)).collect()
                }
            }
        });
        let varied = Pcg64::seed_from_u64(seed).random_range(-PACE_VARIES..=PACE_VARIES);
        let varied = if takes > 1 { varied } else { 0.0 };
        Self { passed_over, pace: 1.0 + varied + LIVELY_PACE * liveliness }
    }

    /// The tastes that rollouts of the take with this seed follow, for an action that ends with the pelvis `height` metres over
    /// the floor, where that matters: its own, those of the next seeds, and none; none alone where all takes are alike.
    pub(crate) fn all_of_take(
        database: &MotionDatabase,
        seed: u64,
        height: Option<f32>,
        settings: &Settings,
    ) -> Vec<Self> {
        let kept = &settings.kept;
        let mut tastes = Vec::new();
        if kept.takes > 1 || kept.liveliness != 0.0 {
            let shares = Shares::new(database, height, settings);
            let others = OTHERS.min(kept.takes - 1) as u64;
            tastes.extend((0..=others).map(|n| Self::of_take(database, seed.wrapping_add(n), &shares, kept)));
        }
        tastes.push(Self::default());
        tastes
    }

    /// Which entries of an action type are not entered, for [`MotionDatabase::search`].
    pub(crate) fn passed_over(&self, action_type: ActionType) -> &[bool] {
        &self.passed_over[action_type.index()]
    }
}

/// The posture in which each clip's action ends, of an action type that completes: the upper body from the pelvis, and where
/// the feet stand beside and before it, metres. By clip; `about`: only of those that end at this height of the pelvis or so
/// far from it, metres.
fn endings(
    database: &MotionDatabase,
    action_type: ActionType,
    about: Option<(f32, f32)>,
) -> BTreeMap<u32, Vec<f32>> {
    let mut endings = BTreeMap::new();
    for &frame in database.entries(action_type) {
        let frame = frame as usize;
        let end = frame + usize::from(database.frames[frame].until_complete);
        let posture = &database.frames[end].posture;
        if about.is_some_and(|(height, most)| (posture.root_position.z - height).abs() > most) {
            continue;
        }
        endings.entry(database.frames[frame].clip).or_insert_with(|| {
            let pose = posture.pose();
            let from_pelvis = |joint: Joint| pose.position(joint) - pose.positions[0];
            // The height of a seat is none of the posture's.
            let feet =
                [Joint::LeftFoot, Joint::RightFoot].map(|foot| from_pelvis(foot).truncate().to_array());
            let upper = Joint::ALL.iter().filter(|joint| **joint > Joint::Hips && **joint < Joint::LeftUpLeg);
            let upper = upper.flat_map(|joint| from_pelvis(*joint).to_array());
            upper.chain(feet.into_iter().flatten()).collect()
        });
    }
    endings
}

/// Shares clips out by how they end, so that what ends alike is of one share: the k means of the endings (Lloyd 1982), from
/// endings on that are about as far apart as can be (Gonzalez 1985).
fn shared_out(endings: &BTreeMap<u32, Vec<f32>>, shares: usize) -> BTreeMap<u32, usize> {
    let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
    let nearest = |middles: &[Vec<f32>], ending: &[f32]| {
        let near = |best: (usize, f32), (share, middle): (usize, &Vec<f32>)| {
            let distance = apart(middle, ending);
            if distance < best.1 { (share, distance) } else { best }
        };
        middles.iter().enumerate().fold((0, f32::INFINITY), near)
    };
    let mut middles: Vec<Vec<f32>> = endings.values().next().cloned().into_iter().collect();
    while (1..shares).contains(&middles.len()) {
        let (mut middle, mut far) = (None, 0.0);
        for ending in endings.values() {
            let distance = nearest(&middles, ending).1;
            if distance > far {
                (middle, far) = (Some(ending.clone()), distance);
            }
        }
        let Some(middle) = middle else { break };
        middles.push(middle);
    }
    for _ in 0..ROUNDS {
        let mut sums = vec![(0.0f32, vec![0.0f32; middles.first().map_or(0, Vec::len)]); middles.len()];
        for ending in endings.values() {
            let (count, sum) = &mut sums[nearest(&middles, ending).0];
            *count += 1.0;
            sum.iter_mut().zip(ending).for_each(|(sum, x)| *sum += x);
        }
        for (middle, (count, sum)) in middles.iter_mut().zip(sums).filter(|(_, (count, _))| *count > 0.0) {
            *middle = sum.into_iter().map(|x| x / count).collect();
        }
    }
    endings.iter().map(|(clip, ending)| (*clip, nearest(&middles, ending).0)).collect()
}

/// The mean speed of head and hands in each clip, m/s.
fn clip_motion(database: &MotionDatabase) -> Vec<f32> {
    let clips = database.frames.last().map_or(0, |frame| frame.clip as usize + 1);
    let mut sums = vec![(0.0f32, 0.0f32); clips];
    let speed = |feature: &PoseFeature| -> f32 {
        // Head and hands come first among the end effectors.
        feature[VELOCITY..VELOCITY + 9]
            .chunks_exact(3)
            .map(|v| v.iter().map(|x| x * x).sum::<f32>().sqrt())
            .sum()
    };
    for (frame, feature) in database.frames.iter().zip(&database.pose_features) {
        let (sum, count) = &mut sums[frame.clip as usize];
        *sum += speed(feature) / 3.0;
        *count += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum / count.max(1.0)).collect()
}

/// The place of each clip in their order by motion, 0 for the calmest to 1 for the liveliest.
fn by_liveliness(motion: &[f32]) -> Vec<f32> {
    let mut order: Vec<usize> = (0..motion.len()).collect();
    order.sort_by(|a, b| motion[*a].total_cmp(&motion[*b]).then(a.cmp(b)));
    let mut place = vec![0.0; motion.len()];
    for (at, clip) in order.into_iter().enumerate() {
        place[clip] = at as f32 / (motion.len() - 1).max(1) as f32;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{SITS_AT, clip_of, database};

    fn settings(takes: usize, liveliness: f32) -> Settings {
        let kept = KeptSettings { takes, liveliness, ..KeptSettings::default() };
        Settings { kept, ..Settings::default() }
    }

    /// The take's own taste.
    fn own(seed: u64, settings: &Settings) -> Taste {
        Taste::all_of_take(database(), seed, None, settings).swap_remove(0)
    }

    /// The clips that are entered for an action.
    fn entered(taste: &Taste, action_type: ActionType) -> Vec<String> {
        let over = taste.passed_over(action_type);
        let mut clips: Vec<_> = database()
            .entries(action_type)
            .iter()
            .enumerate()
            .filter(|(entry, _)| !over.get(*entry).is_some_and(|over| *over))
            .map(|(_, frame)| clip_of(*frame as usize))
            .collect();
        clips.dedup();
        clips
    }

    #[test]
    fn seeds_beside_each_other_share_out_the_sits() {
        let database = database();
        for round in 0..6u64 {
            let takes: Vec<Taste> = (0..3).map(|share| own(3 * round + share, &settings(3, 0.0))).collect();
            for action_type in [ActionType::Sit, ActionType::Stop] {
                let entries = database.entries(action_type).len();
                for entry in 0..entries {
                    let by = takes.iter().filter(|t| !t.passed_over(action_type)[entry]).count();
                    assert_eq!(by, 1, "{action_type:?}, entry {entry}");
                }
            }
            // Of the walks each is passed over by one.
            for entry in 0..database.entries(ActionType::Walk).len() {
                let by = takes.iter().filter(|t| t.passed_over(ActionType::Walk)[entry]).count();
                assert_eq!(by, 1);
            }
        }
    }

    #[test]
    fn one_take_alone_has_no_taste() {
        let all = Taste::all_of_take(database(), 7, None, &settings(1, 0.0));
        assert_eq!(all.len(), 1);
        assert_eq!((all[0].passed_over(ActionType::Sit), all[0].pace), (&[][..], 1.0));
        // Its own, two others, none.
        let all = Taste::all_of_take(database(), 7, None, &settings(5, 0.0));
        assert_eq!(all.len(), 4);
        assert!(all[..3].iter().all(|taste| taste.pace != 1.0) && all[3].pace == 1.0);
        let next = own(8, &settings(5, 0.0));
        assert_eq!(all[1].passed_over(ActionType::Stop), next.passed_over(ActionType::Stop));
        // Those who share with one other, and those who are only livelier.
        assert_eq!(Taste::all_of_take(database(), 7, None, &settings(2, 0.0)).len(), 3);
        assert_eq!(Taste::all_of_take(database(), 7, None, &settings(1, 0.5)).len(), 2);
    }

    #[test]
    fn only_what_ends_as_high_is_shared_out() {
        let ends = endings(database(), ActionType::Sit, None);
        assert!(!ends.is_empty());
        assert_eq!(endings(database(), ActionType::Sit, Some((SITS_AT, 0.08))).len(), ends.len());
        assert!(endings(database(), ActionType::Sit, Some((SITS_AT + 0.09, 0.08))).is_empty());
    }

    #[test]
    fn a_livelier_take_enters_what_moves_more_and_walks_faster() {
        let motion = clip_motion(database());
        let place = by_liveliness(&motion);
        let of = |name: &str| {
            let at =
                database().frames.iter().enumerate().position(|(f, _)| clip_of(f) == name).expect("a clip");
            database().frames[at].clip as usize
        };
        // Who walks moves head and hands at the pace, who stands does not.
        assert!((motion[of("walk")] - 1.2).abs() < 0.05 && motion[of("stand")] < 0.01, "{motion:?}");
        assert!(place[of("walk")] > place[of("stand")]);
        let (calm, lively) = (own(1, &settings(1, -1.0)), own(1, &settings(1, 1.0)));
        assert!((calm.pace - 0.85).abs() < 1e-6 && (lively.pace - 1.15).abs() < 1e-6);
        for action_type in [ActionType::Sit, ActionType::Stop] {
            let lowest = |taste: &Taste| {
                entered(taste, action_type).into_iter().map(|c| place[of(&c)]).fold(1.0, f32::min)
            };
            let highest = |taste: &Taste| {
                entered(taste, action_type).into_iter().map(|c| place[of(&c)]).fold(0.0, f32::max)
            };
            assert!(lowest(&lively) >= 0.5 && highest(&calm) <= 0.5);
        }
    }

    #[test]
    fn what_ends_alike_is_of_one_share() {
        let at = |x: f32, y: f32| vec![x, y];
        let endings = BTreeMap::from([
            (2, at(0.0, 0.0)),
            (3, at(5.0, 0.1)),
            (5, at(0.1, 0.0)),
            (7, at(5.0, 0.0)),
            (8, at(0.0, 3.0)),
        ]);
        // The first begins; the farthest from it is 3; then 8.
        let share = |shares| shared_out(&endings, shares).into_values().collect::<Vec<_>>();
        assert_eq!(share(1), [0; 5]);
        assert_eq!(share(2), [0, 1, 0, 1, 0]);
        assert_eq!(share(3), [0, 1, 0, 1, 2]);
        // No more shares than endings that differ.
        let alike = BTreeMap::from([(1, at(1.0, 1.0)), (4, at(1.0, 1.0))]);
        assert_eq!(shared_out(&alike, 3).into_values().collect::<Vec<_>>(), [0, 0]);
        // Means move: 1.9 is nearer to 0 than to 4 at first, then nearer to what lies about 2.1.
        let line = [0.0, 4.0, 1.9, 2.1, 2.1].into_iter().enumerate();
        let line: BTreeMap<u32, Vec<f32>> = line.map(|(clip, x)| (clip as u32, at(x, 0.0))).collect();
        assert_eq!(shared_out(&line, 2).into_values().collect::<Vec<_>>(), [0, 1, 1, 1, 1]);
        assert!(shared_out(&BTreeMap::new(), 3).is_empty());
    }

    #[test]
    fn the_calmest_comes_first() {
        assert_eq!(by_liveliness(&[0.3, 0.1, 0.2]), [1.0, 0.0, 0.5]);
        assert_eq!(by_liveliness(&[0.3]), [0.0]);
        assert!(by_liveliness(&[]).is_empty());
    }
}
