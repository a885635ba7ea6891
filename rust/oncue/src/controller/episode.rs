//! One episode: A and S in turn in the scene, until the action is complete or an early termination.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rand::{Rng, RngExt};

use super::environment::Environment;
use super::policy::{Draw, TYPE_COUNT};
use super::reward::{
    TransitionCost, collision_reward, interaction_reward, position_reward, regularization_reward,
    transition_reward, velocity_reward,
};
use super::state::{Observation, observe};
use crate::action::ActionType;
use crate::library::feature::{Future, MAX_FEATURE, PoseFeature, feature_size, write_feature};
use crate::math::Planar;
use crate::math::rotation::wrap_angle;
use crate::metrics::{ContactError, is_met, is_penetrating};
use crate::motion::speed::accelerations;
use crate::motion::{FRAME_RATE, JOINT_COUNT, Joint, Motion, Pose, Posture};
use crate::synthesizer::{Character, PostureOffset};

/// Frames before the end of a sit or stop at which the posture offset is gone; it begins to fade twice as early.
const OFFSET_FADE: f32 = 15.0;

/// How an episode ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EpisodeEnd {
    /// The action is complete (whether it met the cue is another question).
    Complete,
    /// Early terminations (LAMA, supplementary).
    LeftScene,
    /// The limbs were in furniture for five frames.
    Collision,
    /// The root hardly moved for as many frames as the settings say.
    Stall,
    /// Too many frames.
    TooLong,
}

/// Figures of an episode, gathered frame by frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tally {
    /// Frames that were played.
    pub frames: usize,
    /// Frames with at least 10 leg or 7 arm crossings (LAMA, section 4.1).
    pub penetrating: usize,
    /// Frames with any crossing of the whole body but those of the seat.
    pub touching: usize,
    /// Crossings of the whole body, summed.
    pub crossings: u64,
    /// C_tr + C_vel over all transitions, and the worst.
    pub transition: f32,
    /// The largest C_tr + C_vel.
    pub worst_transition: f32,
    /// How many transitions there were.
    pub transitions: usize,
    /// Frames that the motion lacks where a leg hurries, see `Character::leg_speed`, and the most of one frame.
    pub hurry: f32,
    /// The most of [`Tally::hurry`] in one frame.
    pub worst_hurry: f32,
    /// How much harder a joint is accelerated than the library's own (its 99.9th percentile), as a part of that: summed over
    /// the frames, and the most.
    pub jolt: f32,
    /// The most of [`Tally::jolt`] in one frame.
    pub worst_jolt: f32,
    /// How far feet creep that seem to stand (LAMA, section 4.1).
    pub contact: ContactError,
    /// Metres the root travelled.
    pub travelled: f32,
    /// Squared radians of posture offset, summed.
    pub offset: f32,
    /// Pelvis to the cue at the end, metres, and facing, radians.
    pub residual: f32,
    /// The facing away from the cue's at the end, radians.
    pub facing: f32,
}

/// An episode under way.
#[derive(Debug, Clone)]
pub struct Episode {
    pub character: Character,
    pub tally: Tally,
    before: Posture,
    /// Mean r_coli of the last frames, and where the root was.
    collisions: [f32; 5],
    trail: Vec<Vec2>,
    /// Where the next search for the action may begin: the last one's find, played on.
    likely_action: Option<usize>,
    /// Frame at which the sit or stop was entered.
    pub action_from: Option<usize>,
    /// The motion, if it is recorded.
    pub record: Option<Motion>,
}

/// What one decision led to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    pub reward: f32,
    pub end: Option<EpisodeEnd>,
}

impl Environment<'_> {
    /// An episode from the task's own start.
    pub fn begin(&self, rng: &mut impl Rng) -> Episode {
        self.begin_at(self.task.start.planar(), rng)
    }

    /// An episode from anywhere on the clear floor, facing anywhere.
    pub fn begin_anywhere(&self, rng: &mut impl Rng) -> Episode {
        if self.starts().is_empty() {
            return self.begin(rng);
        }
        let xy = self.starts()[rng.random_range(0..self.starts().len())];
        self.begin_at(Planar::new(xy, rng.random_range(-PI..PI)), rng)
    }

    /// An episode standing at `start`, in one of the library's moments of standing still.
    pub fn begin_at(&self, start: Planar, rng: &mut impl Rng) -> Episode {
        let idle = &self.database.idle_frames;
        let frame = idle[rng.random_range(0..idle.len())] as usize;
        let character = Character::standing(self.database, frame, start, self.task.start.position.z);
        let before = character.posture;
        Episode {
            character,
            tally: Tally::default(),
            before,
            collisions: [1.0; 5],
            trail: vec![start.position],
            likely_action: None,
            action_from: None,
            record: None,
        }
    }

    /// s_t and what is open.
    pub fn observe(&self, episode: &Episode, out: &mut [f32]) -> Observation {
        observe(self, &episode.character, &episode.before, episode.likely_action, out)
    }

    /// Plays a_t for N frames, or a sit or stop to its end.
    pub fn step(&self, episode: &mut Episode, observation: &Observation, draw: &Draw) -> Outcome {
        let settings = self.settings;
        let character = &mut episode.character;
        let action_type = ActionType::ALL[draw.action_type.min(TYPE_COUNT - 1)];
        let signal = settings.signal.decode(action_type, &draw.vector, character.velocity());
        let query = observation.query.as_deref().copied().unwrap_or_else(|| character.pose_feature());
        let action = observation.action.filter(|a| a.accepted && action_type != ActionType::LOCOMOTION);

        // k*: a sit or stop was matched while observing; walking is matched with a^future.
        let target = match action {
            Some(action) => Some(action.found.frame),
            None => self.match_walk(character, &query, &signal.future),
        };
        let mut cost = TransitionCost::default();
        if let Some(frame) = target {
            cost = self.transition_cost(&query, frame);
            character.transition(self.database, frame);
            let total = cost.posture + cost.velocity;
            episode.tally.transition += total;
            episode.tally.worst_transition = episode.tally.worst_transition.max(total);
            episode.tally.transitions += 1;
        }
        if action.is_some() {
            episode.character.align(&self.task.cue);
            episode.action_from = Some(episode.tally.frames);
        }
        episode.likely_action = observation.action.map(|a| a.found.frame + settings.synthesizer.search_every);
        let smooth = transition_reward(cost, &settings.reward);
        let (mean, end) = self.play(episode, &signal.posture_offset, action.is_some());
        let mut reward = settings.reward.w_tr * mean.trajectory + settings.reward.w_reg * mean.regularization
            - settings.reward.time_cost;
        // The paper's R_act belongs to the action; its smoothness terms guard walking's transitions too.
        reward *= smooth;
        if end == Some(EpisodeEnd::Complete) {
            let tally = &mut episode.tally;
            let root = episode.character.pose.positions[0];
            let cue = &self.task.cue;
            tally.residual = cue.pelvis_distance(root);
            tally.facing = wrap_angle(episode.character.planar.yaw - cue.yaw).abs();
            let inter = interaction_reward(&[tally.residual], tally.facing, &settings.reward);
            reward += settings.reward.w_act * settings.reward.action_scale * inter * smooth * mean.collision;
        }
        Outcome { reward, end }
    }

    /// The frame to jump to for walking, or `None` to play on.
    fn match_walk(&self, character: &Character, query: &PoseFeature, future: &[Planar; 3]) -> Option<usize> {
        let mut feature = [0.0; MAX_FEATURE];
        let size = feature_size(ActionType::LOCOMOTION);
        write_feature(query, &Future::Walk(*future), &mut feature[..size]);
        let feature = &feature[..size];
        let found = self.database.search(ActionType::LOCOMOTION, feature, Some(character.frame))?;
        let on = self.database.cost(ActionType::LOCOMOTION, feature, character.frame);
        match on {
            Some(cost) if cost <= found.cost * (1.0 + self.settings.synthesizer.reluctance) => None,
            _ => (found.frame != character.frame).then_some(found.frame),
        }
    }

    /// Plays frames until the next search or the action's end; means over the frames.
    fn play(
        &self,
        episode: &mut Episode,
        offset: &PostureOffset,
        action: bool,
    ) -> (Means, Option<EpisodeEnd>) {
        let settings = self.settings;
        let mut means = Means::default();
        let mut frames = 0;
        let mut end = None;
        while end.is_none() {
            if !action && frames >= settings.synthesizer.search_every {
                break;
            }
            if action && episode.character.until_complete(self.database) == Some(0) {
                end = Some(EpisodeEnd::Complete);
                break;
            }
            // On the way down the arms may still be tucked in; at its end the hands lie where the clip lays them.
            let ahead = episode.character.until_complete(self.database);
            let fade = if action {
                ahead.map_or(0.0, |a| (a as f32 / OFFSET_FADE - 1.0).clamp(0.0, 1.0))
            } else {
                1.0
            };
            end = self.frame(episode, &offset.map(|v| v * fade), action, &mut means);
            frames += 1;
        }
        means.finish(frames);
        (means, end)
    }

    fn frame(
        &self,
        episode: &mut Episode,
        offset: &PostureOffset,
        action: bool,
        means: &mut Means,
    ) -> Option<EpisodeEnd> {
        let settings = self.settings;
        episode.before = episode.character.posture;
        let root_before = episode.character.planar.position;
        let earlier = episode.character.before.positions;
        episode.character.advance(self.database, offset);
        let character = &episode.character;
        let floor = character.floor;
        let above = floor + settings.reward.ignore_below;
        // The seat under the pelvis is what a sit is for.
        let seat = self.task.cue.seat_height().filter(|_| action);
        let counts = match seat {
            Some(seat) => self.scene.seated_intersections(&character.pose, above, seat),
            None => self.scene.body_intersections(&character.pose, above),
        };
        let coli = collision_reward(&counts, &settings.reward);
        let place = character.planar.position;
        let step = place.distance(root_before);
        let tally = &mut episode.tally;
        tally.frames += 1;
        tally.travelled += step;
        tally.offset += character.offset_distance;
        tally.hurry += character.leg_speed - 1.0;
        tally.worst_hurry = tally.worst_hurry.max(character.leg_speed - 1.0);
        let jolt = self.jolt([&earlier, &character.before.positions, &character.pose.positions]);
        tally.jolt += jolt;
        tally.worst_jolt = tally.worst_jolt.max(jolt);
        let toes = |pose: &Pose| Joint::TOES.map(|toe| pose.position(toe).truncate());
        tally.contact.add(toes(&character.before), toes(&character.pose));
        let (legs, arms): (u32, u32) = (counts[..4].iter().sum(), counts[4..8].iter().sum());
        tally.penetrating += usize::from(is_penetrating(legs, arms));
        tally.touching += usize::from(counts.iter().any(|c| *c > 0));
        tally.crossings += u64::from(counts.iter().sum::<u32>());
        if let Some(record) = &mut episode.record {
            record.postures.push(character.posture);
            record.contacts.push(character.contact);
        }

        let distance = if settings.reward.geodesic {
            self.path.distance(place).min(20.0)
        } else {
            place.distance(self.task.cue.position.truncate())
        };
        let frame = tally.frames;
        episode.collisions[frame % 5] = coli;
        episode.trail.push(place);
        means.collision += coli;
        means.trajectory +=
            coli * position_reward(distance, &settings.reward) * velocity_reward(step, &settings.reward);
        let change = mean_square_change(&episode.before, &character.posture);
        means.regularization +=
            regularization_reward(character.offset_distance / 4.0, change, &settings.reward);

        let termination = &settings.termination;
        let (low, high) = self.scene.bounds();
        if place.cmplt(low.truncate()).any() || place.cmpgt(high.truncate()).any() {
            return Some(EpisodeEnd::LeftScene);
        }
        if frame >= 5 && episode.collisions.iter().sum::<f32>() / 5.0 < termination.collision {
            return Some(EpisodeEnd::Collision);
        }
        if !action && episode.trail.len() > termination.stall_frames {
            let then = episode.trail.len() - 1 - termination.stall_frames;
            let walked: f32 = episode.trail[then..].windows(2).map(|w| w[0].distance(w[1])).sum();
            // Turning on the spot is not standing about.
            if walked / (termination.stall_frames as f32) < termination.stall_step {
                return Some(EpisodeEnd::Stall);
            }
        }
        (frame >= termination.longest).then_some(EpisodeEnd::TooLong)
    }

    /// See [`Tally::jolt`].
    fn jolt(&self, positions: [&[Vec3; JOINT_COUNT]; 3]) -> f32 {
        let hard = accelerations(positions);
        let usual = &self.database.accelerations;
        hard.iter().zip(usual).map(|(hard, usual)| hard / usual.max(1e-2) - 1.0).fold(0.0, f32::max)
    }

    /// Plays on for as long as a motion is held after its action is complete.
    pub fn hold(&self, episode: &mut Episode) {
        for _ in 0..(self.settings.synthesizer.hold_seconds * FRAME_RATE) as usize {
            self.frame(episode, &PostureOffset::default(), true, &mut Means::default());
        }
    }

    /// How narrow the way is here and where the next second leads at this velocity: 0 from the scene's `free_clearance`
    /// on, 1 from `narrow_clearance` down.
    pub fn narrowness(&self, episode: &Episode) -> f32 {
        let (grid, settings) = (self.scene.occupancy(), self.scene.settings());
        let here = episode.character.planar;
        let velocity = here.direction_to_world(episode.character.velocity());
        let room = [0.0, 0.33, 0.67, 1.0]
            .map(|seconds| grid.clearance(here.position + velocity * seconds))
            .into_iter()
            .fold(f32::INFINITY, f32::min);
        let (narrow, free) = (settings.narrow_clearance, settings.free_clearance);
        ((free - room) / (free - narrow)).clamp(0.0, 1.0)
    }

    /// Nothing that an artist would mind: the cue met, no limb in the scene, no detour.
    pub fn is_clean(&self, end: EpisodeEnd, tally: &Tally) -> bool {
        let shortest = self.path.distance(self.task.start.planar().position);
        self.succeeded(end, tally)
            && tally.penetrating == 0
            && tally.touching * 100 <= tally.frames
            && tally.travelled <= 1.3 * shortest + 0.2
    }

    /// Whether an episode that ended so met its cue: within 10 cm and 20° (the table of the paper's robustness test).
    pub fn succeeded(&self, end: EpisodeEnd, tally: &Tally) -> bool {
        end == EpisodeEnd::Complete && is_met(tally.residual, tally.facing)
    }
}

/// Means over the frames of one decision.
#[derive(Debug, Clone, Copy, Default)]
struct Means {
    trajectory: f32,
    regularization: f32,
    collision: f32,
}

impl Means {
    fn finish(&mut self, frames: usize) {
        let n = frames.max(1) as f32;
        self.trajectory /= n;
        self.regularization /= n;
        self.collision /= n;
    }
}

/// ‖m_t - m_{t-1}‖², mean over the joints, squared radians.
fn mean_square_change(a: &Posture, b: &Posture) -> f32 {
    let sum: f32 = a.rotations[1..]
        .iter()
        .zip(&b.rotations[1..])
        .map(|(a, b)| {
            // For a small angle, 4 (1 - |⟨a, b⟩|²) is its square.
            let dot = a.dot(*b);
            4.0 * (1.0 - (dot * dot).min(1.0))
        })
        .sum();
    sum / (a.rotations.len() - 1) as f32
}
