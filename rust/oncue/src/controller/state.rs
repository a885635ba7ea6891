//! s_t = ψ(m_{t-1}, m_t, W, φ_A) = (s^body, s^scene, s^inter) (LAMA, section 3.2).
//!
//! Everything is person-centric. Beside the state an observation carries which action types are open
//! (a sit or stop whose match is poor is refused before it is chosen) and what is proposed: the step
//! along the shortest clear path, to which the network adds.

use std::f32::consts::PI;

use glam::Vec2;

use super::environment::Environment;
use super::policy::TYPE_COUNT;
use crate::action::ActionType;
use crate::library::database::FrameMatch;
use crate::library::feature::{Future, MAX_FEATURE, PoseFeature, feature_size, write_feature};
use crate::math::Planar;
use crate::math::rotation::{to_6d, wrap_angle};
use crate::motion::skeleton::JOINT_COUNT;
use crate::motion::{FRAME_RATE, Posture};
use crate::settings::StateSettings;
use crate::synthesizer::Character;

/// This near to where one stands before a seat that is entered from its side one turns the back to it, metres.
const ARRIVAL_DISTANCE: f32 = 0.25;

/// A sit or stop that would be possible now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActionMatch {
    pub found: FrameMatch,
    /// How far its end misses the cue before alignment: metres, radians, metres of height.
    pub position: f32,
    pub direction: f32,
    pub height: f32,
    /// C_tr + C_vel of entering it.
    pub posture: f32,
    /// Good enough to be entered.
    pub accepted: bool,
}

/// What the policy is told besides the state.
#[derive(Debug, Clone, Default)]
pub struct Observation {
    pub allowed: [bool; TYPE_COUNT],
    /// Added to the network's output.
    pub proposal: Vec<f32>,
    pub query: Option<Box<PoseFeature>>,
    pub action: Option<ActionMatch>,
}

/// Length of s_t.
pub(crate) fn state_size(settings: &StateSettings) -> usize {
    let body = BODY_SIZE + if settings.joint_rotations { 2 * ROTATION_NUMBERS } else { 0 };
    let scene = settings.view_cells.pow(2) * settings.view_spacing.len()
        + if settings.scene_position { 2 } else { 0 };
    body + scene + INTERACTION_SIZE + if settings.clear_path { PATH_SIZE } else { 0 }
}

impl Environment<'_> {
    /// Length of s_t under the environment's settings.
    pub fn state_size(&self) -> usize {
        state_size(&self.settings.state)
    }
}

const ROTATION_NUMBERS: usize = 6 * (JOINT_COUNT - 1);
/// θ_up, h, p_e and its velocity, contacts, root velocity.
const BODY_SIZE: usize = 1 + 1 + 15 + 15 + 2 + 2;
/// Way left, points on it, and the facing at its end.
const PATH_SIZE: usize = 1 + 2 * WAY_AHEAD.len() + 2;
const WAY_AHEAD: [f32; 3] = [0.5, 1.0, 2.0];
/// Cue: place (near and far scale), facing, height, distance; the open action; the type asked for.
const INTERACTION_SIZE: usize = 2 + 2 + 2 + 1 + 1 + 5 + ActionType::CUE_COUNT;

/// Writes s_t to `out` (as long as [`state_size`]) and says what is open and proposed. `likely`: a database frame near
/// which the best sit or stop may be found; it only speeds that up.
pub(crate) fn observe(
    environment: &Environment,
    character: &Character,
    before: &Posture,
    likely: Option<usize>,
    out: &mut [f32],
) -> Observation {
    let settings = &environment.settings;
    let here = character.planar;
    let query = character.pose_feature();
    let mut at = 0;
    let mut push = |v: f32| {
        out[at] = v;
        at += 1;
    };

    // s^body
    push(query[32].clamp(-1.0, 1.0).acos());
    push(query_height(character));
    query[..15].iter().for_each(|v| push(*v));
    query[15..30].iter().for_each(|v| push(v * 0.3));
    query[33..35].iter().for_each(|v| push(*v));
    let velocity = character.velocity();
    velocity.to_array().iter().for_each(|v| push(*v));
    if settings.state.joint_rotations {
        for joint in 1..JOINT_COUNT {
            let now = to_6d(character.posture.rotations[joint]);
            let then = to_6d(before.rotations[joint]);
            now.iter().for_each(|v| push(*v));
            now.iter().zip(then).for_each(|(a, b)| push((a - b) * FRAME_RATE * 0.2));
        }
    }

    // s^scene
    let grid = environment.scene.occupancy();
    for spacing in &settings.state.view_spacing {
        let cells = settings.state.view_cells;
        let middle = (cells as f32 - 1.0) / 2.0;
        for row in 0..cells {
            for column in 0..cells {
                let local = Vec2::new(column as f32 - middle, row as f32 - middle) * *spacing;
                let clearance = grid.clearance(here.point_to_world(local));
                // Free space half a metre wide is as good as free.
                push(1.0 - (clearance / 0.5).clamp(0.0, 1.0));
            }
        }
    }
    if settings.state.scene_position {
        let (low, high) = environment.scene.bounds();
        let size = (high - low).truncate().max(Vec2::splat(1e-3));
        let root = (here.position - low.truncate()) / size;
        push(root.x);
        push(root.y);
    }

    // s^inter = φ_A
    let cue = here.relative(environment.task.cue.planar());
    let distance = cue.position.length();
    let near = cue.position.clamp_length_max(1.0);
    let far = cue.position.clamp_length_max(6.0) / 3.0;
    for v in [near.x, near.y, far.x, far.y, cue.forward().x, cue.forward().y] {
        push(v);
    }
    push(environment.task.cue.position.z - character.floor);
    push((distance / 3.0).min(2.0));
    let action = find_action(environment, character, &query, distance, likely);
    let a = action.as_ref();
    push(a.map_or(0.0, |a| f32::from(u8::from(a.accepted))));
    push(a.map_or(2.0, |a| a.position.min(2.0)));
    push(a.map_or(PI, |a| a.direction));
    push(a.map_or(0.5, |a| a.height.min(0.5)));
    push(a.map_or(3.0, |a| a.posture.min(3.0)));
    let wanted = environment.task.cue.action_type;
    ActionType::of_cues().for_each(|action_type| push(f32::from(u8::from(wanted == action_type))));

    let remaining = environment.path.distance(here.position);
    // One second ahead at the pace, slower over the last half metre, and a look beyond.
    let stride = settings.signal.pace * (remaining / 0.6).clamp(0.35, 1.0);
    let follows = settings.state.clear_path || settings.signal.propose_clear_path;
    let [stride_end, beyond, way @ ..] = if follows {
        environment
            .path
            .points_ahead(here.position, [stride, stride + 0.3, WAY_AHEAD[0], WAY_AHEAD[1], WAY_AHEAD[2]])
    } else {
        [here.position; 5]
    };
    // Only a seat that is entered from its side is faced otherwise than the cue, and only close by does it matter: where
    // the farthest look ahead is the end of the way.
    let arrival = (follows && remaining < WAY_AHEAD[2] && environment.path.from_the_side())
        .then(|| environment.path.arrival_at(way[2]))
        .flatten();
    if settings.state.clear_path {
        push((remaining / 3.0).min(3.0));
        for (ahead, point) in WAY_AHEAD.into_iter().zip(way) {
            let local = here.point_to_local(point);
            push(local.x / ahead);
            push(local.y / ahead);
        }
        let facing = arrival.map_or(environment.task.cue.yaw, |a| a.yaw) - here.yaw;
        push(facing.sin());
        push(facing.cos());
    }
    debug_assert_eq!(at, out.len());

    let accepted = a.is_some_and(|a| a.accepted);
    let mut allowed = [false; TYPE_COUNT];
    allowed[ActionType::LOCOMOTION.index()] = true;
    allowed[wanted.index()] |= accepted;
    let mut proposal = vec![0.0; TYPE_COUNT + settings.signal.vector_size()];
    if settings.signal.propose_clear_path {
        let way = Way { remaining, stride_end, beyond, arrival };
        propose(environment, here, velocity, &way, a, &mut proposal);
    }
    Observation { allowed, proposal, query: Some(Box::new(query)), action }
}

fn query_height(character: &Character) -> f32 {
    character.posture.root_position.z - character.floor
}

/// The best sit or stop from here, with how well it fits.
fn find_action(
    environment: &Environment,
    character: &Character,
    query: &PoseFeature,
    distance: f32,
    likely: Option<usize>,
) -> Option<ActionMatch> {
    let cue = &environment.task.cue;
    // From farther away than any action of the library reaches, none could be accepted.
    let settings = &environment.settings.synthesizer;
    if distance > environment.database.reach(cue.action_type) + settings.refuse_position {
        return None;
    }
    let target = character.planar.relative(cue.planar());
    let height = cue.position.z - character.floor;
    let mut feature = [0.0; MAX_FEATURE];
    let size = feature_size(cue.action_type);
    write_feature(query, &Future::Complete(target, height), &mut feature[..size]);
    let found = environment.database.search(cue.action_type, &feature[..size], likely)?;
    let Some(Future::Complete(end, end_height)) = environment.database.future(cue.action_type, found.frame)
    else {
        return None;
    };
    let posture = environment.transition_cost(query, found.frame);
    let matched = ActionMatch {
        found,
        position: end.position.distance(target.position),
        direction: wrap_angle(end.yaw - target.yaw).abs(),
        height: cue.pelvis_height().map_or(0.0, |_| (end_height - height).abs()),
        posture: posture.posture + posture.velocity,
        accepted: false,
    };
    let accepted = matched.position <= settings.refuse_position
        && matched.direction <= settings.refuse_direction
        && matched.height <= settings.refuse_height
        && matched.posture <= settings.refuse_posture;
    Some(ActionMatch { accepted, ..matched })
}

/// The way to the cue from where the character is.
struct Way {
    /// Metres.
    remaining: f32,
    /// Where a second's walk along it ends, and a place beyond.
    stride_end: Vec2,
    beyond: Vec2,
    /// Where to stand, and which way to face, before a seat that is entered from its side.
    arrival: Option<Planar>,
}

/// The step along the shortest clear path, and to sit where a sit fits.
fn propose(
    environment: &Environment,
    here: Planar,
    velocity: Vec2,
    way: &Way,
    action: Option<&ActionMatch>,
    out: &mut [f32],
) {
    let settings = &environment.settings.signal;
    let (types, vector) = out.split_at_mut(TYPE_COUNT);
    let wanted = environment.task.cue.action_type.index();
    if let Some(action) = action.filter(|a| a.accepted) {
        // The closer the fit, the likelier.
        let fit = action.position / 0.15 + action.direction / 0.3 + action.posture / 0.6;
        types[wanted] = 2.0 - 1.5 * fit;
    } else {
        types[wanted] = -4.0;
    }
    let ahead = if way.remaining.is_finite() { way.stride_end } else { environment.path.goal() };
    let local = here.point_to_local(ahead);
    let arrived = match way.arrival {
        Some(arrival) => here.position.distance(arrival.position) < ARRIVAL_DISTANCE,
        None => way.remaining < 0.45,
    };
    let facing = if arrived {
        // Turn to face as the cue asks, or with the back to the seat's side.
        way.arrival.map_or(environment.task.cue.yaw, |a| a.yaw)
    } else {
        (way.beyond - here.position).to_angle() + PI / 2.0
    };
    let facing = wrap_angle(facing - here.yaw);
    let turn = facing.clamp(-settings.largest_turn, settings.largest_turn);
    // Nobody walks off backwards: a large turn shortens the stride.
    let slow = (1.25 - facing.abs() / PI).clamp(0.2, 1.0);
    settings.encode_goal(local * slow, turn, velocity, vector);
}
