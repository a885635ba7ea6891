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
use crate::anatomy::{DEEP, own_depth};
use crate::cue::{ActionCue, BodyState, Moments};
use crate::figures::{Surroundings, depth_in_scene};
use crate::library::feature::{Future, MAX_FEATURE, PoseFeature, feature_size, write_feature};
use crate::library::foot::turned_out;
use crate::library::{Rise, SEEN_AHEAD, Start};
use crate::math::Planar;
use crate::math::capsule::Capsule;
use crate::math::rotation::wrap_angle;
use crate::metrics::{ContactError, PASS_DISTANCE, is_met, is_penetrating};
use crate::motion::speed::accelerations;
use crate::motion::{FRAME_RATE, FootContact, JOINT_COUNT, Joint, Motion, Pose, Posture};
use crate::synthesizer::{Character, PostureOffset};

/// Frames before the end of a sit or stop at which the posture offset is gone; it begins to fade twice as early.
const OFFSET_FADE: f32 = 15.0;

/// The space that an arm takes as it swings beside a walking body: an upright capsule so far aside of the root, so thick and
/// between such heights over the floor, metres. It reaches 40 cm to the side.
const ARM_ASIDE: f32 = 0.22;
const ARM_SPACE: f32 = 0.18;
const ARM_HEIGHTS: (f32, f32) = (0.75, 1.35);
/// Where something reaches so far into this space the arm is wanted elsewhere: beside a wall at 30 cm. Metres.
const TIGHT: f32 = 0.10;
/// How far ahead of the body it is looked for, seconds.
const AHEAD: [f32; 4] = [0.0, 0.33, 0.67, 1.0];

/// The own body is looked at every so many frames: nothing that lasts longer than a brief touch (`report.brief_frames`) is
/// missed, at a third of the time.
const OWN_BODY_EVERY: usize = 3;

/// A start leads the way that is no farther than this from it: the cosine.
const START_LEADS: f32 = 0.8;
/// So many episodes of ten begin with a start where one leads the way: the others show whether it is in the way.
const STARTED_OF_TEN: u32 = 8;
/// Of a hold so much is the clip's, seconds: longer ones run out, or get up again. The rest is `life`'s.
const LONGEST_PLAYED: f32 = 1.0;

/// Who steps with the same foot again sooner than after so many frames stumbles.
const AGAIN_WITHIN: usize = 20;

/// So far feet that stand are easily turned in and out under the leg, radians: ACCAD's are for all but a few frames in a thousand.
const EASY_TURN: (f32, f32) = (0.55, 0.65);

/// Frames of a step, over which the pace is a mean.
const STEP_FRAMES: usize = 15;

/// A waypoint is behind whoever is so much farther from it again, having been within `PASS_DISTANCE`, or, of who misses it, having
/// been nearer than `MISSED`, metres.
const BEHIND: f32 = 0.02;
const MISSED_BEHIND: f32 = 0.15;
const MISSED: f32 = 0.5;
/// So far the edit may still move who passes a waypoint, metres.
const LEFT_TO_EDIT: f32 = 0.02;

/// How an episode ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EpisodeEnd {
    /// The action is complete (whether it met the cue is another question).
    Complete,
    /// Early terminations (LAMA, supplementary).
    LeftScene,
    /// The mean r_coli of the last five frames, over the whole body, fell below `termination.collision`. Never with
    /// `reward.collision` off.
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
    /// C_tr + C_vel, summed over all transitions.
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
    /// How much its pace changed, faster or slower, all together, m/s; the swing of a step does not count.
    pub surge: f32,
    /// Squared radians of posture offset, summed.
    pub offset: f32,
    /// Frames in which a limb is more than 1 cm deep in the own body, beyond what flesh gives, by every third of them.
    pub in_own_body: usize,
    /// How deep the deepest limb is in the own body, summed over the frames, metres.
    pub own_depth: f32,
    /// How deep the deepest part is in the scene in the posture that is held, metres.
    pub held_depth: f32,
    /// How far from the take's own taste it is, see `taste`.
    pub taste: usize,
    /// It does not begin with a start, although one of the library's leads its way.
    pub unprepared: bool,
    /// How far from each waypoint it was passed, summed, and at the most, metres.
    pub passed: f32,
    /// The most of [`Tally::passed`] of one waypoint.
    pub worst_pass: f32,
    /// Steps, on the way to the action, of the foot that has just made the step before.
    pub repeated_steps: usize,
    /// How far feet that stand are turned out or in against the pelvis beyond what legs do easily, summed over both and the
    /// frames, radians.
    pub twisted: f32,
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
    /// Which leg of the way it is on, and how near it has been to that leg's waypoint, metres.
    pub(super) leg: usize,
    nearest: f32,
    /// Mean r_coli of the last frames, and where the root was.
    collisions: [f32; 5],
    trail: Vec<Vec2>,
    /// The database frame up to which the first step, or a getting up, plays on as it is.
    start_until: Option<usize>,
    rising: Option<Rising>,
    /// Frame at which who sat at first stood.
    pub stood_at: Option<usize>,
    /// The foot that made the last step, and the frame in which it came down.
    last_step: Option<(usize, usize)>,
    /// Where the next search for the action may begin: the last one's find, played on.
    likely_action: Option<usize>,
    /// How tight it is beside the arms where the next decision begins, if that was looked at already.
    pub(super) tightness: Option<[f32; 2]>,
    /// Frame at which the sit or stop was entered.
    pub action_from: Option<usize>,
    /// The motion, if it is recorded.
    pub record: Option<Motion>,
}

/// Someone who gets up.
#[derive(Debug, Clone, Copy)]
struct Rising {
    /// World height of the seat, metres.
    seat: f32,
    walks_on: bool,
    /// Which of the starts that will lead the way is played then, by its remainder.
    then: u32,
}

/// What one decision led to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    pub reward: f32,
    pub end: Option<EpisodeEnd>,
}

impl Episode {
    /// About to be played, with the clip as it is until database frame `start_until`.
    fn of(character: Character, start_until: Option<usize>) -> Self {
        Self {
            before: character.posture,
            trail: vec![character.planar.position],
            leg: 0,
            nearest: f32::INFINITY,
            // None, but for the rollouts of a choice.
            tally: Tally { taste: usize::MAX, ..Tally::default() },
            start_until,
            rising: None,
            stood_at: None,
            collisions: [1.0; 5],
            last_step: None,
            likely_action: None,
            tightness: None,
            action_from: None,
            record: None,
            character,
        }
    }

    /// One frame on the way to a waypoint that is so far away now, metres: the next leg begins where that one is behind.
    fn walk_by(&mut self, away: f32) {
        let farther = away - self.nearest;
        self.nearest = self.nearest.min(away);
        let is_behind = if self.nearest < PASS_DISTANCE { farther > BEHIND } else { farther > MISSED_BEHIND };
        if is_behind && self.nearest < MISSED {
            self.pass();
        }
    }

    /// On to the next leg.
    fn pass(&mut self) {
        self.tally.passed += self.nearest;
        self.tally.worst_pass = self.tally.worst_pass.max(self.nearest);
        self.leg += 1;
        self.nearest = f32::INFINITY;
    }

    /// When what happened in it, `complete` being the frame on which it ended.
    pub fn moments(&self, complete: usize) -> Moments {
        Moments { stood_at: self.stood_at, action_from: self.action_from, complete }
    }
}

impl Environment<'_> {
    /// An episode from the task's own start.
    pub fn begin(&self, rng: &mut impl Rng) -> Episode {
        let start = &self.task.start;
        let Some(body) = &start.body else { return self.begin_at(start.planar(), rng) };
        let Some((seat, rises)) =
            start.seat().and_then(ActionCue::seat_height).zip(self.rises_by_chance(rng))
        else {
            return self.begin_as(start.planar(), Some(body), rng);
        };
        let character =
            Character::continuing(self.database, rises.first, Some(rises.end), body, start.position.z);
        let mut episode = Episode::of(character, Some(rises.end));
        episode.rising = Some(Rising { seat, walks_on: rises.walks_on, then: rng.random() });
        episode
    }

    /// One of the likeliest ways to get up from the task's start.
    fn rises_by_chance(&self, rng: &mut impl Rng) -> Option<Rise> {
        let rises = self.rises();
        (!rises.is_empty()).then(|| rises[rng.random_range(0..rises.len())])
    }

    /// An episode from anywhere on the clear floor, facing anywhere.
    pub fn begin_anywhere(&self, rng: &mut impl Rng) -> Episode {
        if self.starts().is_empty() {
            return self.begin(rng);
        }
        let xy = self.starts()[rng.random_range(0..self.starts().len())];
        self.begin_at(Planar::new(xy, rng.random_range(-PI..PI)), rng)
    }

    /// An episode standing at `start`: about to set off as the library does, or in one of its moments of standing still.
    pub fn begin_at(&self, start: Planar, rng: &mut impl Rng) -> Episode {
        self.begin_as(start, None, rng)
    }

    /// The same, going on from what a standing `body` does.
    fn begin_as(&self, start: Planar, body: Option<&BodyState>, rng: &mut impl Rng) -> Episode {
        let starts = self.starts_of(start, 0);
        let idle = &self.database.idle_frames;
        let standing = idle[rng.random_range(0..idle.len())] as usize;
        let starting = !starts.is_empty() && rng.random_range(0..10) < STARTED_OF_TEN;
        let begins = starting.then(|| starts[rng.random_range(0..starts.len())]);
        let frame = begins.map_or(standing, |start| start.first);
        let floor = self.task.start.position.z;
        let character = match body {
            Some(body) => Character::continuing(self.database, frame, None, body, floor),
            None => Character::standing(self.database, frame, start, floor),
        };
        let mut episode = Episode::of(character, begins.map(|start| start.end));
        episode.tally.unprepared = begins.is_none() && !starts.is_empty();
        episode
    }

    /// The first steps that lead where the way from `start`, on a leg, leads; who has less to go needs none.
    fn starts_of(&self, start: Planar, leg: usize) -> Vec<&Start> {
        let remaining = self.path.distance(leg, start.position);
        if !remaining.is_finite() || remaining < SEEN_AHEAD {
            return Vec::new();
        }
        let [ahead] = self.path.points_ahead(leg, start.position, [SEEN_AHEAD]);
        let ahead = ahead - start.position;
        let ahead = start.direction_to_local(ahead).normalize_or_zero();
        self.database.starts.iter().filter(|start| start.way.dot(ahead) > START_LEADS).collect()
    }

    /// s_t and what is open.
    pub fn observe(&self, episode: &Episode, out: &mut [f32]) -> Observation {
        let taste = self.taste(episode.tally.taste);
        let mut observation = observe(
            self,
            &episode.character,
            &episode.before,
            episode.leg,
            episode.likely_action,
            taste,
            out,
        );
        if episode.rising.is_some() {
            // Who sits gets up first.
            observation.action = None;
            observation.allowed = [false; TYPE_COUNT];
            observation.allowed[ActionType::LOCOMOTION.index()] = true;
        }
        observation
    }

    /// Who got up stands: and sets off as the library does where a start leads the way.
    fn stand(&self, episode: &mut Episode, rising: Rising) {
        episode.rising = None;
        episode.stood_at = Some(episode.tally.frames);
        episode.start_until = None;
        let here = episode.character.planar;
        // Who sat did not stand about.
        episode.trail = vec![here.position];
        let starts = self.starts_of(here, episode.leg);
        if rising.walks_on || starts.is_empty() {
            return;
        }
        let start = starts[rising.then as usize % starts.len()];
        episode.character.transition(self.database, start.first);
        episode.start_until = Some(start.end);
    }

    /// Plays a_t for N frames, or a sit or stop to its end.
    pub fn step(&self, episode: &mut Episode, observation: &Observation, draw: &Draw) -> Outcome {
        let settings = self.settings;
        if let Some(rising) = episode.rising
            && episode.start_until.is_some_and(|until| episode.character.frame >= until)
        {
            self.stand(episode, rising);
        }
        let character = &mut episode.character;
        let action_type = ActionType::ALL[draw.action_type.min(TYPE_COUNT - 1)];
        let signal = settings.signal.decode(action_type, &draw.vector, character.velocity());
        let query = observation.query.as_deref().copied().unwrap_or_else(|| character.pose_feature());
        let action = observation.action.filter(|a| a.accepted && action_type != ActionType::LOCOMOTION);

        // k*: a sit or stop was matched while observing; walking is matched with a^future.
        let target = match action {
            Some(action) => Some(action.found.frame),
            None if episode.start_until.is_some_and(|until| character.frame < until) => None,
            None => {
                let passed_over = self.taste(episode.tally.taste).passed_over(ActionType::LOCOMOTION);
                self.match_walk(character, &query, &signal.future, passed_over)
            }
        };
        let mut cost = TransitionCost::default();
        if let Some(frame) = target {
            episode.start_until = None;
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
            while let Some(place) = self.path.waypoint(episode.leg) {
                episode.nearest = episode.nearest.min(place.distance(episode.character.planar.position));
                episode.pass();
            }
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
    fn match_walk(
        &self,
        character: &Character,
        query: &PoseFeature,
        future: &[Planar; 3],
        passed_over: &[bool],
    ) -> Option<usize> {
        let mut feature = [0.0; MAX_FEATURE];
        let size = feature_size(ActionType::LOCOMOTION);
        write_feature(query, &Future::Walk(*future), &mut feature[..size]);
        let feature = &feature[..size];
        let found =
            self.database.search(ActionType::LOCOMOTION, feature, Some(character.frame), passed_over)?;
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
        let mut known = episode.tightness.take();
        let everywhere = settings.synthesizer.offset_everywhere;
        let mut tightness = if everywhere { [1.0; 2] } else { [0.0; 2] };
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
            if !everywhere
                && frames % settings.synthesizer.search_every == 0
                && *offset != PostureOffset::default()
            {
                tightness = known.take().unwrap_or_else(|| self.tightness(&episode.character));
            }
            // Where an arm has room it hangs and swings as people's do.
            let offset = std::array::from_fn(|joint| offset[joint] * (fade * tightness[joint / 2]));
            end = self.frame(episode, &offset, action, &mut means);
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
        let contact = episode.character.contact;
        episode.character.advance(self.database, offset);
        let character = &episode.character;
        let floor = character.floor;
        let above = floor + settings.reward.ignore_below;
        // The seat under the pelvis is what a sit is for.
        let seat = self.task.cue.seat_height().filter(|_| action).or(episode.rising.map(|r| r.seat));
        let counts = self.scene.intersections_on(&character.pose, above, seat);
        let coli = collision_reward(&counts, &settings.reward);
        let place = character.planar.position;
        let step = place.distance(root_before);
        let tally = &mut episode.tally;
        tally.frames += 1;
        tally.travelled += step;
        tally.offset += character.offset_distance;
        if tally.frames.is_multiple_of(OWN_BODY_EVERY) {
            let own_depth = own_depth(&character.pose);
            tally.in_own_body += OWN_BODY_EVERY * usize::from(own_depth > DEEP);
            tally.own_depth += OWN_BODY_EVERY as f32 * own_depth;
        }
        for side in 0..2 {
            match (contact[side] > 0.0, character.contact[side] > 0.0) {
                (true, false) if !action => {
                    let again =
                        |&(last, down): &(usize, usize)| last == side && tally.frames - down < AGAIN_WITHIN;
                    tally.repeated_steps += usize::from(episode.last_step.as_ref().is_some_and(again));
                }
                (false, true) => episode.last_step = Some((side, tally.frames)),
                _ => {}
            }
        }
        tally.twisted += twisted(&character.pose, character.contact);
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
            self.path.distance(episode.leg, place).min(20.0)
        } else {
            self.path.straight_distance(episode.leg, place)
        };
        let frame = tally.frames;
        episode.collisions[frame % 5] = coli;
        episode.trail.push(place);
        tally.surge += surge(&episode.trail) / STEP_FRAMES as f32;
        means.collision += coli;
        means.trajectory +=
            coli * position_reward(distance, &settings.reward) * velocity_reward(step, &settings.reward);
        let change = mean_square_change(&episode.before, &character.posture);
        means.regularization +=
            regularization_reward(character.offset_distance / 4.0, change, &settings.reward);

        if let Some(waypoint) = self.path.waypoint(episode.leg) {
            episode.walk_by(waypoint.distance(place));
        }
        let termination = &settings.termination;
        let (low, high) = self.scene.bounds();
        if place.cmplt(low.truncate()).any() || place.cmpgt(high.truncate()).any() {
            return Some(EpisodeEnd::LeftScene);
        }
        if frame >= 5 && episode.collisions.iter().sum::<f32>() / 5.0 < termination.collision {
            return Some(EpisodeEnd::Collision);
        }
        if !action && episode.rising.is_none() && episode.trail.len() > termination.stall_frames {
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

    /// Plays on for as long as a motion is held after its action is complete, `LONGEST_PLAYED` at most, and looks at where it
    /// ends.
    pub fn hold(&self, episode: &mut Episode) {
        let seconds = self.settings.synthesizer.hold_seconds.min(LONGEST_PLAYED);
        for _ in 0..(seconds * FRAME_RATE) as usize {
            self.frame(episode, &PostureOffset::default(), true, &mut Means::default());
        }
        let surroundings = Surroundings::at_end(self.scene, &self.task.cue);
        let character = &episode.character;
        episode.tally.held_depth = depth_in_scene(&character.pose, character.floor, &surroundings);
    }

    /// How tight it is beside the left and the right arm, here and where the next second leads at this velocity: 0 where an arm
    /// may swing, 1 where something is within 30 cm of the body's middle.
    pub fn tightness(&self, character: &Character) -> [f32; 2] {
        let (here, floor) = (character.planar, character.floor);
        let velocity = here.direction_to_world(character.velocity());
        [ARM_ASIDE, -ARM_ASIDE].map(|aside| {
            let aside = here.direction_to_world(Vec2::new(aside, 0.0));
            let mut deepest = 0f32;
            for seconds in AHEAD {
                let place = here.position + velocity * seconds + aside;
                let ends = [ARM_HEIGHTS.0, ARM_HEIGHTS.1].map(|height| place.extend(floor + height));
                let space = Capsule { ends, radii: [ARM_SPACE; 2] };
                let contact = self.scene.depth_of(&space, floor + self.settings.reward.ignore_below);
                deepest = deepest.max(contact.map_or(0.0, |contact| contact.depth));
                // It gets no tighter.
                if deepest >= TIGHT {
                    break;
                }
            }
            (deepest / TIGHT).min(1.0)
        })
    }

    /// Nothing that an artist would mind: the cue met, no limb in the scene, no detour.
    pub fn is_clean(&self, end: EpisodeEnd, tally: &Tally) -> bool {
        let shortest = self.path.distance(0, self.departure);
        self.succeeded(end, tally)
            && tally.penetrating == 0
            && tally.touching * 100 <= tally.frames
            && tally.travelled <= 1.3 * shortest + 0.2
    }

    /// Whether an episode that ended so met its cue: within 10 cm and 20° (the table of the paper's robustness test); and passed its
    /// waypoints.
    pub fn succeeded(&self, end: EpisodeEnd, tally: &Tally) -> bool {
        end == EpisodeEnd::Complete
            && is_met(tally.residual, tally.facing)
            && tally.worst_pass < PASS_DISTANCE - LEFT_TO_EDIT
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

/// By how much the pace of the last step differs from that of the one before, m/s; 0 before there were two.
fn surge(trail: &[Vec2]) -> f32 {
    let [before, from, to] =
        [2, 1, 0].map(|ago| trail.len().checked_sub(1 + ago * STEP_FRAMES).map(|at| trail[at]));
    let pace = |a: Option<Vec2>, b: Option<Vec2>| Some(a?.distance(b?) * FRAME_RATE / STEP_FRAMES as f32);
    match (pace(before, from), pace(from, to)) {
        (Some(then), Some(now)) => (now - then).abs(),
        _ => 0.0,
    }
}

/// How far feet that stand are turned in or out beyond what is easy, both together, radians.
fn twisted(pose: &Pose, contact: FootContact) -> f32 {
    let (most_in, most_out) = EASY_TURN;
    let beyond = |side: usize| {
        let out = turned_out(pose, side);
        if contact[side] > 0.0 { (out - most_out).max(-out - most_in).max(0.0) } else { 0.0 }
    };
    beyond(0) + beyond(1)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{
        HALF_FLOOR, PACE, SITS_AT, SITS_BACK, SITS_IN, World, clip_of, close, database, decide, frame_of,
        stop_cue, walk_on,
    };
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    fn begin(environment: &Environment) -> Episode {
        environment.begin(&mut Pcg64::seed_from_u64(1))
    }

    /// Repeats one decision until the episode ends, at most so often.
    fn repeat(
        environment: &Environment,
        episode: &mut Episode,
        draw: &Draw,
        times: usize,
    ) -> Option<EpisodeEnd> {
        let mut state = vec![0.0; environment.state_size()];
        (0..times).find_map(|_| {
            let observation = environment.observe(episode, &mut state);
            environment.step(episode, &observation, draw).end
        })
    }

    /// Who walks from `start` where the cue plays no part.
    fn walker(boxes: &crate::test_world::Boxes, start: Planar) -> World {
        World::new(boxes, start, stop_cue(Vec2::new(-2.5, 2.5), 0.0))
    }

    #[test]
    fn who_walks_over_any_edge_leaves_the_scene() {
        for (direction, yaw) in
            [(Vec2::NEG_Y, 0.0), (Vec2::X, PI / 2.0), (Vec2::Y, PI), (Vec2::NEG_X, -PI / 2.0)]
        {
            let world = walker(&[], Planar::new(direction * (HALF_FLOOR - 0.7), yaw));
            let environment = world.environment();
            let mut episode = begin(&environment);
            assert_eq!(
                repeat(&environment, &mut episode, &walk_on(&world.settings), 20),
                Some(EpisodeEnd::LeftScene)
            );
            let place = episode.character.planar.position;
            // It ends on the first frame beyond the edge, and there was no other reason.
            assert!((HALF_FLOOR..HALF_FLOOR + PACE + 1e-3).contains(&place.dot(direction)), "{place}");
            assert!(place.distance(direction * place.dot(direction)) < 0.05);
            assert_eq!((episode.tally.touching, episode.tally.crossings), (0, 0));
            // A walk that is played as it is hurries no leg.
            assert_eq!((episode.tally.hurry, episode.tally.worst_hurry), (0.0, 0.0));
            close(episode.tally.travelled, place.distance(world.task.start.position.truncate()), 0.02);
        }
        let world = walker(&[], Planar::default());
        let environment = world.environment();
        let mut episode = begin(&environment);
        assert_eq!(repeat(&environment, &mut episode, &walk_on(&world.settings), 6), None);
        assert_eq!(episode.tally.frames, 6 * world.settings.synthesizer.search_every);
    }

    /// Walls every 5 cm from y = -1 on: any box of the body crosses several.
    fn palisade() -> Vec<([f32; 3], [f32; 3])> {
        (0..20).map(|i| -1.0 - 0.05 * i as f32).map(|y| ([-2.0, y - 0.01, 0.0], [2.0, y, 2.0])).collect()
    }

    #[test]
    fn who_walks_into_walls_collides() {
        let mut world = walker(&palisade(), Planar::default());
        {
            let environment = world.environment();
            let mut episode = begin(&environment);
            assert_eq!(
                repeat(&environment, &mut episode, &walk_on(&world.settings), 20),
                Some(EpisodeEnd::Collision)
            );
            let (tally, y) = (&episode.tally, episode.character.planar.position.y);
            // Five frames and their way after the body first touches.
            assert!((-1.4..-0.9).contains(&y), "{y}");
            assert!((4..12).contains(&tally.penetrating), "{tally:?}");
            assert!(tally.touching >= tally.penetrating && tally.touching < tally.frames);
            assert!(tally.crossings as usize > 10 * tally.penetrating);
            assert!(!environment.is_clean(EpisodeEnd::Complete, tally));
        }
        // Where collisions do not count, the same walk goes on.
        world.settings.reward.collision = false;
        let environment = world.environment();
        assert_eq!(repeat(&environment, &mut begin(&environment), &walk_on(&world.settings), 5), None);
    }

    #[test]
    fn a_collision_is_the_mean_of_the_last_five_frames() {
        let mut world = walker(&[([-0.3, -0.3, 0.9], [0.3, 0.3, 0.92])], Planar::default());
        // A rate at which r_coli is 1/e there.
        let pose = crate::test_world::still(1).postures[0].pose();
        let counts = world.scene.body_intersections(&pose, world.settings.reward.ignore_below);
        let weighted =
            -collision_reward(&counts, &world.settings.reward).ln() / world.settings.reward.collision_rate;
        world.settings.reward.collision_rate = 1.0 / weighted;
        world.settings.termination.collision = 0.4;
        let environment = world.environment();
        let mut episode = begin(&environment);
        // In a plate at the height of the pelvis from the first frame.
        assert_eq!(
            repeat(&environment, &mut episode, &decide(&world.settings, ActionType::Walk, [0.0; 3]), 9),
            Some(EpisodeEnd::Collision)
        );
        assert_eq!((episode.tally.frames, episode.tally.touching), (5, 5));
        let coli = episode.collisions[0];
        close(coli, (-1f32).exp(), 0.02);
        // A little under its value it does not end.
        world.settings.termination.collision = coli - 0.01;
        let environment = world.environment();
        assert_eq!(
            repeat(
                &environment,
                &mut begin(&environment),
                &decide(&world.settings, ActionType::Walk, [0.0; 3]),
                3
            ),
            None
        );
    }

    #[test]
    fn who_stands_about_stalls() {
        let mut world = walker(&[], Planar::default());
        let stand = decide(&world.settings, ActionType::Walk, [0.0; 3]);
        {
            let environment = world.environment();
            let mut episode = begin(&environment);
            assert_eq!(repeat(&environment, &mut episode, &stand, 20), Some(EpisodeEnd::Stall));
            assert_eq!(episode.tally.frames, world.settings.termination.stall_frames);
            assert!(episode.tally.travelled < 1e-3);
            assert_eq!(repeat(&environment, &mut begin(&environment), &walk_on(&world.settings), 6), None);
        }
        // The step is a mean over the frames: just under it a walk stalls, just over it it does not.
        world.settings.termination.stall_frames = 20;
        for (step, end) in [(1.02 * PACE, Some(EpisodeEnd::Stall)), (0.5 * PACE, None)] {
            world.settings.termination.stall_step = step;
            let environment = world.environment();
            assert_eq!(
                repeat(&environment, &mut begin(&environment), &walk_on(&world.settings), 6),
                end,
                "{step}"
            );
        }
    }

    #[test]
    fn a_waypoint_is_behind_once_it_has_been_passed() {
        let mut world = walker(&[], Planar::default());
        let by = |y: f32| crate::PassCue { name: "By".into(), position: Vec3::new(0.05, y, 0.0) };
        world.task.passes = vec![by(-0.6), by(-1.2)];
        let environment = world.environment();
        let mut episode = begin(&environment);
        repeat(&environment, &mut episode, &walk_on(&world.settings), 3);
        assert_eq!(episode.leg, 1, "at {}", episode.character.planar.position);
        repeat(&environment, &mut episode, &walk_on(&world.settings), 3);
        // Five centimetres aside of each.
        assert_eq!(episode.leg, 2);
        close(episode.tally.passed, 0.10, 0.02);
        close(episode.tally.worst_pass, 0.05, 0.01);
        let met = Tally { residual: 0.0, facing: 0.0, ..episode.tally };
        assert!(environment.succeeded(EpisodeEnd::Complete, &met));
        let missed = Tally { worst_pass: 0.14, ..met };
        assert!(!environment.succeeded(EpisodeEnd::Complete, &missed));

        // Who starts beside one and goes there has not passed it; who goes by at 30 cm has, and missed it.
        let walked = |away: &[f32]| {
            let mut episode = begin(&environment);
            away.iter().for_each(|away| episode.walk_by(*away));
            (episode.leg, episode.tally.worst_pass)
        };
        assert_eq!(walked(&[0.30, 0.33, 0.36, 0.2, 0.1, 0.08]).0, 0);
        assert_eq!(walked(&[0.10, 0.09, 0.10]).0, 0);
        assert_eq!(walked(&[0.10, 0.09, 0.12]), (1, 0.09));
        assert_eq!(walked(&[0.40, 0.30, 0.50]), (1, 0.30));
        assert_eq!(walked(&[0.90, 0.80, 1.20]).0, 0);
    }

    #[test]
    fn an_episode_has_a_longest() {
        let mut world = walker(&[], Planar::default());
        world.settings.termination.longest = 34;
        let environment = world.environment();
        let mut episode = begin(&environment);
        assert_eq!(
            repeat(&environment, &mut episode, &walk_on(&world.settings), 20),
            Some(EpisodeEnd::TooLong)
        );
        assert_eq!(episode.tally.frames, 34);
    }

    /// One sit from the start of [`World::stool`], recorded.
    fn sit(world: &World) -> (Episode, Outcome) {
        let environment = world.environment();
        let mut episode = begin(&environment);
        episode.record = Some(Motion::default());
        let mut state = vec![0.0; environment.state_size()];
        let observation = environment.observe(&episode, &mut state);
        let mut draw = decide(&world.settings, ActionType::Sit, [0.0; 3]);
        // The left elbow is asked to bend by half a radian.
        let elbow = world.settings.signal.future_size() + 5;
        draw.vector[elbow] = -0.5 / world.settings.signal.offset_scale;
        let outcome = environment.step(&mut episode, &observation, &draw);
        (episode, outcome)
    }

    #[test]
    fn a_sit_is_played_to_its_end_and_meets_its_cue() {
        let mut world = World::stool();
        // Neither standing about nor anything else ends it before.
        world.settings.termination.stall_frames = 10;
        world.settings.termination.stall_step = 0.1;
        let (episode, outcome) = sit(&world);
        let environment = world.environment();
        assert_eq!(outcome.end, Some(EpisodeEnd::Complete));
        assert_eq!(episode.action_from, Some(0));
        assert!((SITS_IN - 35..=SITS_IN).contains(&episode.tally.frames), "{}", episode.tally.frames);
        let root = episode.character.pose.positions[0];
        assert!(root.distance(Vec3::new(0.0, SITS_BACK, SITS_AT)) < 0.03, "{root}");
        close(episode.tally.residual, root.distance(world.task.cue.position), 1e-6);
        close(episode.tally.facing, 0.0, 0.02);
        assert!(environment.succeeded(EpisodeEnd::Complete, &episode.tally));
        for end in [EpisodeEnd::LeftScene, EpisodeEnd::Collision, EpisodeEnd::Stall, EpisodeEnd::TooLong] {
            assert!(!environment.succeeded(end, &episode.tally));
        }
        let far = Tally { residual: 0.11, ..episode.tally };
        let turned = Tally { facing: 21f32.to_radians(), ..episode.tally };
        let just = Tally { residual: 0.099, facing: 19.9f32.to_radians(), ..episode.tally };
        assert!(!environment.succeeded(EpisodeEnd::Complete, &far));
        assert!(!environment.succeeded(EpisodeEnd::Complete, &turned));
        assert!(environment.succeeded(EpisodeEnd::Complete, &just));
    }

    #[test]
    fn a_type_that_is_not_open_walks_on() {
        let mut world = World::stool();
        world.settings.synthesizer.refuse_height = 0.0;
        world.task.cue.position.z += 0.05;
        let (episode, outcome) = sit(&world);
        assert_eq!((outcome.end, episode.action_from), (None, None));
        assert_eq!(episode.tally.frames, world.settings.synthesizer.search_every);
    }

    #[test]
    fn the_posture_offset_is_gone_when_the_sit_is_complete() {
        let mut world = World::stool();
        world.settings.synthesizer.offset_everywhere = true;
        let (episode, _) = sit(&world);
        let motion = episode.record.expect("recorded");
        let frames = motion.len();
        let own = database().frames[0].posture.rotations[Joint::LeftForeArm.index()];
        let turned = |frame: usize| {
            crate::math::rotation::angle_between(
                motion.postures[frame].rotations[Joint::LeftForeArm.index()],
                own,
            )
        };
        // Half a radian until 30 frames before the end, and nothing over the last few.
        let begin = (0..frames).map(turned).fold(0.0, f32::max);
        close(begin, 0.5, 0.02);
        assert!(turned(frames - 1) < 0.02, "{}", turned(frames - 1));
        assert!((0..frames - 20).all(|f| turned(f) <= 0.51) && turned(frames - 24) > 0.1);
        assert!(episode.tally.offset > 0.25 && episode.tally.offset < 0.26 * frames as f32);
        // Walking keeps it.
        let mut world = walker(&[], Planar::default());
        world.settings.synthesizer.offset_everywhere = true;
        let environment = world.environment();
        let mut episode = begin_walk(&environment);
        let mut draw = walk_on(&world.settings);
        let elbow = world.settings.signal.future_size() + 5;
        draw.vector[elbow] = -0.5 / world.settings.signal.offset_scale;
        repeat(&environment, &mut episode, &draw, 4);
        let arm = episode.character.posture.rotations[Joint::LeftForeArm.index()];
        close(crate::math::rotation::angle_between(arm, own), 0.5, 0.01);
    }

    fn begin_walk(environment: &Environment) -> Episode {
        let mut episode = begin(environment);
        episode.character.transition(database(), frame_of("walk", 0));
        episode
    }

    /// The reward of one sit, each of its parts alone, from the recorded motion.
    #[test]
    fn the_reward_is_the_equations_over_the_frames() {
        let only = |change: &dyn Fn(&mut crate::settings::RewardSettings)| {
            let mut world = World::stool();
            world.settings.synthesizer.offset_everywhere = true;
            let reward = &mut world.settings.reward;
            (reward.w_tr, reward.w_act, reward.w_reg, reward.collision) = (0.0, 0.0, 0.0, false);
            (reward.transition_rate, reward.velocity_rate) = (0.0, 0.0);
            change(reward);
            let (episode, outcome) = sit(&world);
            (world, episode, outcome.reward)
        };
        let (world, episode, reward) = only(&|r| r.w_act = 0.7);
        let s = world.settings.reward.clone();
        let (p, f) = (episode.tally.residual / s.sigma_inter, episode.tally.facing / s.sigma_facing);
        close(reward, 0.7 * s.action_scale * (-p * p - f * f).exp(), 1e-3);

        let (world, episode, reward) = only(&|r| r.w_tr = 0.7);
        let (environment, motion) = (world.environment(), episode.record.expect("recorded"));
        let mut last = Vec2::ZERO;
        let mut sum = 0.0;
        for posture in &motion.postures {
            let place = posture.root_position.truncate();
            let near = (-environment.path.distance(0, place) / s.sigma_root).exp();
            let fast = (place.distance(last) / s.velocity_threshold).powi(2).min(1.0);
            sum += near * fast;
            last = place;
        }
        close(reward, 0.7 * sum / motion.len() as f32, 2e-3);
        assert!(reward > 0.01);

        // By the paper the way is the crow's.
        let (world, episode, reward) = only(&|r| (r.w_tr, r.geodesic) = (0.7, false));
        let motion = episode.record.expect("recorded");
        let (mut last, mut sum) = (Vec2::ZERO, 0.0);
        for posture in &motion.postures {
            let place = posture.root_position.truncate();
            let near = place.distance(world.task.cue.position.truncate()) / s.sigma_root;
            sum += (-near * near).exp() * (place.distance(last) / s.velocity_threshold).powi(2).min(1.0);
            last = place;
        }
        close(reward, 0.7 * sum / motion.len() as f32, 2e-3);

        let (world, episode, reward) = only(&|r| (r.w_reg, r.sigma_reg) = (0.5, 0.1));
        let mut before = begin(&world.environment()).character.posture;
        let elbow = Joint::LeftForeArm.index();
        let own = before.rotations[elbow];
        let motion = episode.record.expect("recorded");
        let mut sum = 0.0;
        for posture in &motion.postures {
            // Of the four joints that an offset turns it is the elbow alone.
            let offset = crate::math::rotation::angle_between(own, posture.rotations[elbow]).powi(2) / 4.0;
            sum += (-(offset + mean_square_change(&before, posture)) / 0.1f32.powi(2)).exp();
            before = *posture;
        }
        close(reward, 0.5 * sum / motion.len() as f32, 2e-3);
        assert!(reward < 0.49 && episode.tally.offset > 0.0, "{reward}");
        let (_, _, reward) = only(&|r| r.time_cost = 0.3);
        close(reward, -0.3, 1e-6);
        // A transition that shows takes its share of all.
        let (_, episode, reward) =
            only(&|r| (r.time_cost, r.transition_rate, r.velocity_rate) = (0.3, 2.0, 2.0));
        close(reward, -0.3 * (-2.0 * episode.tally.transition).exp(), 1e-5);
        assert_eq!(episode.tally.transitions, 1);
        assert_eq!(episode.tally.transition, episode.tally.worst_transition);
    }

    #[test]
    fn what_plays_plays_on_and_another_way_is_entered() {
        let world = walker(&[], Planar::default());
        let environment = world.environment();
        let mut episode = begin_walk(&environment);
        let settings = &world.settings;
        repeat(&environment, &mut episode, &walk_on(settings), 3);
        // The same is asked for as is played: no transition but perhaps the first.
        assert!(episode.tally.transitions <= 1, "{}", episode.tally.transitions);
        assert_eq!(clip_of(episode.character.frame), "walk");
        for (turn, clip) in [(1.2f32, "left"), (-1.2, "right")] {
            let mut turning = episode.clone();
            let before = turning.tally;
            let goal = Vec2::new(0.75 * (1.0 - 1.2f32.cos()) * turn.signum(), -0.75 * 1.2f32.sin())
                / settings.signal.reach;
            let draw =
                decide(settings, ActionType::Walk, [goal.x, goal.y, turn / settings.signal.largest_turn]);
            repeat(&environment, &mut turning, &draw, 2);
            assert_eq!(clip_of(turning.character.frame), clip);
            let tally = turning.tally;
            assert!(tally.transitions > before.transitions && tally.transition > before.transition);
            assert!(tally.worst_transition >= (tally.transition / tally.transitions as f32) - 1e-6);
            assert!(tally.worst_transition <= tally.transition + 1e-6);
            assert!(turning.character.planar.yaw * turn > 0.0);
        }
    }

    #[test]
    fn a_transition_costs_posture_and_velocity() {
        let world = walker(&[], Planar::default());
        let environment = world.environment();
        let mut episode = begin(&environment);
        let query = episode.character.pose_feature();
        repeat(&environment, &mut episode, &walk_on(&world.settings), 1);
        let entered = episode.character.frame - world.settings.synthesizer.search_every;
        let cost = environment.transition_cost(&query, entered);
        // Who stands and who walks here hold themselves alike, but not as fast.
        assert!(cost.velocity > 0.01 && cost.posture != 1.0, "{cost:?}");
        assert_eq!(episode.tally.transitions, 1);
        close(episode.tally.transition, cost.posture + cost.velocity, 1e-6);
    }

    #[test]
    fn a_jolt_is_what_is_over_the_librarys() {
        let world = walker(&[], Planar::default());
        let environment = world.environment();
        let rest = [Vec3::ZERO; JOINT_COUNT];
        let mut moved = rest;
        moved[7] = Vec3::X * 0.1;
        // 0.1 m · (30 Hz)² = 90 m/s², where the library has 50.
        close(environment.jolt([&rest, &rest, &moved]), 0.8, 1e-4);
        moved[7] = Vec3::X * 0.05;
        assert_eq!(environment.jolt([&rest, &rest, &moved]), 0.0);
    }

    #[test]
    fn a_hold_goes_on_for_its_seconds() {
        let mut world = World::stool();
        world.settings.synthesizer.hold_seconds = 0.5;
        let (mut episode, _) = sit(&world);
        let (frames, root) = (episode.tally.frames, episode.character.pose.positions[0]);
        world.environment().hold(&mut episode);
        assert_eq!(episode.tally.frames, frames + 15);
        assert_eq!(episode.record.as_ref().map(Motion::len), Some(frames + 15));
        assert!(root.distance(episode.character.pose.positions[0]) < 0.02);
    }

    #[test]
    fn the_tally_is_what_was_recorded() {
        let (episode, _) = sit(&World::stool());
        let (motion, tally) = (episode.record.expect("recorded"), episode.tally);
        assert_eq!(motion.len(), tally.frames);
        let mut travelled = 0.0;
        let mut last = Vec2::ZERO;
        for posture in &motion.postures {
            travelled += posture.root_position.truncate().distance(last);
            last = posture.root_position.truncate();
        }
        close(tally.travelled, travelled, 1e-4);
        assert!(tally.worst_jolt <= tally.jolt + 1e-6 && tally.worst_hurry <= tally.hurry + 1e-6);
        assert!(tally.hurry >= 0.0 && tally.jolt >= 0.0);
        // On a stool of its own height nothing is touched: what carries is not counted.
        assert_eq!((tally.penetrating, tally.touching, tally.crossings), (0, 0, 0));
        // On one that comes up beside the pelvis it is.
        let mut world = World::stool();
        world.scene = crate::test_world::room(&[([-0.2, 0.25, 0.0], [0.2, 0.5, 0.62])]);
        let (episode, outcome) = sit(&world);
        assert!(outcome.end.is_some());
        assert!(episode.tally.touching > 0 && episode.tally.crossings > 0);
    }

    #[test]
    fn it_is_tight_beside_an_arm_here_and_ahead() {
        // A wall on the left of who walks along -y, at x = 0.33, from y = -1 to -3; the right is free. The left arm's space
        // begins 40 cm aside: 7 of its 10 cm are taken.
        let walls = [([0.33, -3.0, 0.0], [2.0, -1.0, 2.0])];
        for (y, walks, expected) in
            [(-2.0, false, 0.7), (0.0, false, 0.0), (-0.2, true, 0.7), (2.0, true, 0.0)]
        {
            let world = walker(&walls, Planar::new(Vec2::new(0.0, y), 0.0));
            let environment = world.environment();
            let mut episode = begin(&environment);
            if walks {
                episode.character.transition(database(), frame_of("walk", 0));
                for _ in 0..15 {
                    episode.character.advance(database(), &PostureOffset::default());
                }
            }
            let [left, right] = environment.tightness(&episode.character);
            close(left, expected, 0.1);
            assert_eq!(right, 0.0);
        }
        // A bench is lower than hands hang.
        let world = walker(&[([0.2, -3.0, 0.0], [2.0, 3.0, 0.45])], Planar::default());
        let environment = world.environment();
        assert_eq!(environment.tightness(&begin(&environment).character), [0.0; 2]);
    }

    #[test]
    fn arms_that_have_room_are_the_librarys() {
        let mut world = walker(&[], Planar::default());
        let wanted = |world: &World, walls: &[([f32; 3], [f32; 3])]| {
            let mut walled = walker(walls, Planar::default());
            walled.settings = world.settings.clone();
            let environment = walled.environment();
            let mut episode = begin(&environment);
            let mut draw = walk_on(&walled.settings);
            let first = walled.settings.signal.future_size();
            draw.vector[first..].fill(0.4);
            repeat(&environment, &mut episode, &draw, 2);
            episode.tally.offset
        };
        assert_eq!(wanted(&world, &[]), 0.0);
        // Between two walls they are turned.
        let walls = [([0.3, -3.0, 0.0], [2.0, 3.0, 2.0]), ([-2.0, -3.0, 0.0], [-0.3, 3.0, 2.0])];
        assert!(wanted(&world, &walls) > 0.01);
        world.settings.signal.posture_offset = false;
        assert_eq!(wanted(&world, &walls), 0.0);
    }

    #[test]
    fn a_clean_episode_has_none_of_the_flaws() {
        let world = World::stop_ahead(2.0);
        let environment = world.environment();
        let clean = Tally { frames: 200, travelled: 2.5, touching: 2, ..Tally::default() };
        assert!(environment.is_clean(EpisodeEnd::Complete, &clean));
        assert!(!environment.is_clean(EpisodeEnd::Stall, &clean));
        for flawed in [
            Tally { penetrating: 1, ..clean },
            Tally { touching: 3, ..clean },
            // 1.3 times the shortest way, and 20 cm.
            Tally { travelled: 2.95, ..clean },
            Tally { residual: 0.2, ..clean },
            Tally { facing: 1.0, ..clean },
        ] {
            assert!(!environment.is_clean(EpisodeEnd::Complete, &flawed), "{flawed:?}");
        }
        assert!(environment.is_clean(EpisodeEnd::Complete, &Tally { travelled: 2.7, ..clean }));
    }

    #[test]
    fn episodes_begin_where_they_should() {
        let world = walker(&[([-3.0, -3.0, 0.0], [0.0, 3.0, 2.0])], Planar::new(Vec2::new(1.0, 2.0), 0.7));
        let world = World {
            task: crate::cue::Task { cue: stop_cue(Vec2::new(2.0, 0.0), 0.0), ..world.task },
            ..world
        };
        let environment = world.environment();
        let mut rng = Pcg64::seed_from_u64(5);
        let own = environment.begin(&mut rng);
        assert_eq!(own.character.planar, world.task.start.planar());
        let nothing = Tally { taste: usize::MAX, ..Tally::default() };
        assert_eq!((own.tally, own.action_from, own.collisions), (nothing, None, [1.0; 5]));
        assert_eq!(clip_of(own.character.frame), "stand");
        assert!(!environment.starts().is_empty());
        for start in environment.starts() {
            // Right of the wall, and a body's room from it and from the edges: 15 cm apart.
            assert!(start.x > 0.25 && start.x < 2.75 && start.y.abs() < 2.75, "{start}");
        }
        let apart = environment.starts()[0].distance(environment.starts()[1]);
        close(apart, 0.15, 1e-4);
        let (mut turns, mut places) = (0, 0);
        for _ in 0..20 {
            let other = environment.begin_anywhere(&mut rng).character.planar;
            assert!(environment.starts().contains(&other.position));
            turns += usize::from(other.yaw > 0.0);
            places += usize::from(other.position.distance(Vec2::new(1.0, 2.0)) > 0.5);
        }
        assert!((3..18).contains(&turns) && places > 10);
        // Where there is no such place they begin at the task's own start.
        let mut shut = walker(&[], Planar::default());
        shut.task.cue.position.x = 100.0;
        let environment = shut.environment();
        assert!(environment.starts().is_empty());
        assert_eq!(environment.begin_anywhere(&mut rng).character.planar, Planar::default());
    }

    #[test]
    fn a_surge_is_a_change_of_pace_from_step_to_step() {
        let at = |pace: &dyn Fn(usize) -> f32, frames: usize| {
            let mut trail = vec![Vec2::ZERO];
            (0..frames).fold(0.0, |sum, frame| {
                let last = trail[trail.len() - 1];
                trail.push(last + Vec2::new(0.6, 0.8) * pace(frame) / FRAME_RATE);
                sum + surge(&trail) / STEP_FRAMES as f32
            })
        };
        close(at(&|_| 1.1, 90), 0.0, 1e-4);
        // What goes up and down within a step is none of it.
        close(at(&|frame| if frame % 15 < 7 { 1.4 } else { 0.8 }, 90), 0.0, 0.05);
        // From 0.8 to 1.2 m/s and back: each change counts once.
        close(at(&|frame| if (60..120).contains(&frame) { 1.2 } else { 0.8 }, 180), 0.8, 0.02);
        assert_eq!(at(&|frame| frame as f32, 2 * STEP_FRAMES - 1), 0.0);
    }

    #[test]
    fn the_change_is_the_mean_square_of_the_joints() {
        let a = Posture::default();
        let mut b = a;
        b.rotations[0] = glam::Quat::from_rotation_z(1.0);
        b.rotations[3] = glam::Quat::from_rotation_x(0.1);
        b.rotations[9] = glam::Quat::from_rotation_y(-0.2);
        // The root's own turn is none of a joint.
        close(mean_square_change(&a, &b), (0.01 + 0.04) / 21.0, 2e-5);
        let mut means = Means { trajectory: 6.0, regularization: 3.0, collision: 1.5 };
        means.finish(3);
        assert_eq!((means.trajectory, means.regularization, means.collision), (2.0, 1.0, 0.5));
    }
}
