//! s_t = ψ(m_{t-1}, m_t, W, φ_A) = (s^body, s^scene, s^inter) (LAMA, section 3.2).
//!
//! Everything is person-centric. Beside the state an observation carries which action types are open
//! (a sit or stop whose match is poor is refused before it is chosen) and what is proposed: the step
//! along the shortest clear path, to which the network adds.

use std::f32::consts::PI;

use glam::Vec2;

use super::environment::Environment;
use super::policy::TYPE_COUNT;
use super::signal::goal_through;
use super::taste::Taste;
use crate::action::ActionType;
use crate::library::database::FrameMatch;
use crate::library::feature::{Future, MAX_FEATURE, PoseFeature, feature_size, write_feature};
use crate::math::Planar;
use crate::math::rotation::{to_6d, wrap_angle};
use crate::motion::skeleton::JOINT_COUNT;
use crate::motion::{FRAME_RATE, Posture};
use crate::settings::StateSettings;
use crate::synthesizer::Character;

/// The next second's glide passes a waypoint that it gets to no farther away than this, metres: nearer, and it would go straight to it
/// and turn there; farther, and what the feet make of it would miss it.
const ROUNDS_AT: f32 = 0.05;
/// A way that is no more than this much longer than the straight line leads straight to its waypoint, metres.
const STRAIGHT: f32 = 0.08;
/// A sit or stop may be entered before the waypoints that lie so near to the straight line to its cue, metres: it passes them.
const ON_LINE: f32 = 0.08;
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

/// Writes s_t to `out` (as long as [`state_size`]) and says what is open and proposed. `leg`: of the way, that the character is on;
/// `likely`: a database frame near
/// which the best sit or stop may be found; it only speeds that up. `taste`: what is entered rather than something else.
pub(crate) fn observe(
    environment: &Environment,
    character: &Character,
    before: &Posture,
    leg: usize,
    likely: Option<usize>,
    taste: &Taste,
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
    let action = leads_to_cue(environment, leg, here.position)
        .then(|| find_action(environment, character, &query, distance, likely, taste))
        .flatten();
    let a = action.as_ref();
    push(a.map_or(0.0, |a| f32::from(u8::from(a.accepted))));
    push(a.map_or(2.0, |a| a.position.min(2.0)));
    push(a.map_or(PI, |a| a.direction));
    push(a.map_or(0.5, |a| a.height.min(0.5)));
    push(a.map_or(3.0, |a| a.posture.min(3.0)));
    let wanted = environment.task.cue.action_type;
    ActionType::of_cues().for_each(|action_type| push(f32::from(u8::from(wanted == action_type))));

    let path = &environment.path;
    let remaining = path.distance(leg, here.position);
    // One second ahead at the pace, slower over the last half metre, and a look beyond.
    let stride = settings.signal.pace * taste.pace * (remaining / 0.6).clamp(0.35, 1.0);
    let follows = settings.state.clear_path || settings.signal.propose_clear_path;
    let [stride_end, beyond, way @ ..] = if follows {
        let ahead = [stride, stride + 0.3, WAY_AHEAD[0], WAY_AHEAD[1], WAY_AHEAD[2]];
        path.points_ahead(leg, here.position, ahead)
    } else {
        [here.position; 5]
    };
    // Only a seat that is entered from its side is faced otherwise than the cue, and only close by does it matter: where
    // the farthest look ahead is the end of the way.
    let passed = path.waypoint(leg);
    let arrives = follows && passed.is_none() && remaining < WAY_AHEAD[2] && path.last().from_the_side();
    let arrival = arrives.then(|| path.last().arrival_at(way[2])).flatten();
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
        let near = |place: &Vec2| {
            let straight = here.position.distance(*place);
            straight < stride && path.leg(leg).distance(here.position) < straight + STRAIGHT
        };
        let waypoint = passed.filter(near);
        let way = WayAhead { remaining, stride, stride_end, beyond, waypoint, arrival };
        let goal = path.leg(leg).goal();
        propose(environment, here, velocity, &way, goal, a, &mut proposal);
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
    taste: &Taste,
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
    let best_of = |passed_over: &[bool]| {
        let found = environment.database.search(cue.action_type, &feature[..size], likely, passed_over)?;
        let Some(Future::Complete(end, end_height)) =
            environment.database.future(cue.action_type, found.frame)
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
    };
    best_of(taste.passed_over(cue.action_type))
}

/// Whether who goes straight to the cue from here passes the waypoints that are left.
fn leads_to_cue(environment: &Environment, leg: usize, here: Vec2) -> bool {
    let way = environment.path.last().goal() - here;
    environment.path.waypoints(leg).all(|place| {
        let along = ((place - here).dot(way) / way.length_squared().max(1e-6)).clamp(0.0, 1.0);
        place.distance(here + along * way) < ON_LINE
    })
}

/// The way to the cue from where the character is.
struct WayAhead {
    /// Metres.
    remaining: f32,
    /// How far a second's walk along it leads, metres, where that ends, and a place beyond.
    stride: f32,
    stride_end: Vec2,
    beyond: Vec2,
    /// The waypoint that a second's walk straight ahead gets to.
    waypoint: Option<Vec2>,
    /// Where to stand, and which way to face, before a seat that is entered from its side.
    arrival: Option<Planar>,
}

/// The step along the shortest clear path, and to sit where a sit fits.
fn propose(
    environment: &Environment,
    here: Planar,
    velocity: Vec2,
    way: &WayAhead,
    goal: Vec2,
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
    let ahead = if way.remaining.is_finite() { way.stride_end } else { goal };
    let local = here.point_to_local(ahead);
    if let Some(place) = way.waypoint {
        let onward = here.direction_to_local(way.beyond - place);
        let (goal, facing) = round(here.point_to_local(place), onward, local, velocity, way.stride);
        let turn = facing.clamp(-settings.largest_turn, settings.largest_turn);
        settings.encode_goal(goal, turn, velocity, vector);
        return;
    }
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
    settings.encode_goal(local * shortening(facing), turn, velocity, vector);
}

/// Nobody walks off backwards: a large turn shortens the stride.
fn shortening(facing: f32) -> f32 {
    (1.25 - facing.abs() / PI).clamp(0.2, 1.0)
}

/// How the waypoint at `place` is rounded, from where it leads `onward`: the goal of the next second, and the facing there. Who
/// made for where the way leads in a second, `ahead`, would cut the corner. All is person-centric; `stride`: metres.
fn round(place: Vec2, onward: Vec2, ahead: Vec2, velocity: Vec2, stride: f32) -> (Vec2, f32) {
    let away = place.length();
    // Of the bend so much is turned by then as is left of the second once the waypoint is passed.
    let bend = place.perp_dot(onward).atan2(place.dot(onward));
    let most = PI * (1.0 - away / stride).max(0.0);
    let facing = wrap_angle(place.to_angle() + bend.clamp(-most, most) + PI / 2.0);
    let slow = shortening(facing);
    let stride = stride * slow;
    let goal = if away >= stride {
        place * (stride / away)
    } else {
        goal_through(ahead * slow, velocity, place, away / stride, ROUNDS_AT).clamp_length_max(stride)
    };
    (goal, facing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use crate::test_world::{
        Boxes, SITS_AT, SITS_BACK, STANDS, World, close, database, frame_of, sit_cue, stop_cue,
    };
    use glam::Vec3;
    use std::f32::consts::FRAC_PI_2;

    fn standing(start: Planar) -> Character {
        Character::standing(database(), frame_of("stand", 0), start, 0.0)
    }

    fn look(world: &World, character: &Character) -> (Vec<f32>, Observation) {
        let environment = world.environment();
        let mut out = vec![f32::NAN; environment.state_size()];
        let observation =
            observe(&environment, character, &character.posture, 0, None, &Taste::default(), &mut out);
        assert!(out.iter().all(|v| v.is_finite()));
        (out, observation)
    }

    const VIEW: usize = BODY_SIZE;
    const CELLS: usize = 9 * 9;
    const INTERACTION: usize = VIEW + 2 * CELLS;
    const PATH: usize = INTERACTION + INTERACTION_SIZE;

    /// The view of both spacings, row by row.
    fn views(state: &[f32]) -> [&[f32]; 2] {
        [&state[VIEW..VIEW + CELLS], &state[VIEW + CELLS..INTERACTION]]
    }

    #[test]
    fn a_wall_is_seen_on_its_side() {
        // Facing +X: the right hand is at -Y, behind is -X.
        let here = Planar::new(Vec2::new(0.4, 0.2), FRAC_PI_2);
        let (row, column) = (|i: usize| i / 9, |i: usize| i % 9);
        let sides: [(&Boxes, &dyn Fn(usize) -> i32); 4] = [
            (&[([-2.9, -2.9, 0.0], [2.9, -0.7, 1.0])], &|i| 4 - column(i) as i32),
            (&[([-2.9, 1.1, 0.0], [2.9, 2.9, 1.0])], &|i| column(i) as i32 - 4),
            (&[([1.3, -2.9, 0.0], [2.9, 2.9, 1.0])], &|i| 4 - row(i) as i32),
            (&[([-2.9, -2.9, 0.0], [-0.5, 2.9, 1.0])], &|i| row(i) as i32 - 4),
        ];
        for (boxes, towards) in sides {
            let world = World::new(boxes, here, stop_cue(Vec2::new(0.5, 0.0), 0.0));
            let (state, _) = look(&world, &standing(here));
            for (view, spacing) in views(&state).into_iter().zip([0.15, 0.45]) {
                for (i, seen) in view.iter().enumerate() {
                    // The wall is 0.9 m away on its side: half a metre before it all is free, in it nothing.
                    let away = 0.9 - spacing * towards(i) as f32;
                    let edge = spacing * 4.0 > 1.5 && away > 1.5;
                    let expected = 1.0 - (away / 0.5).clamp(0.0, 1.0);
                    if !edge {
                        close(*seen, expected, 0.12);
                    }
                }
            }
        }
    }

    #[test]
    fn the_view_is_one_less_the_clearance_there() {
        let boxes = [([0.3, -1.0, 0.0], [0.9, -0.4, 1.0]), ([-1.4, 0.2, 0.0], [-0.6, 1.5, 1.0])];
        let here = Planar::new(Vec2::new(-0.2, -0.3), 0.6);
        let world = World::new(&boxes, here, stop_cue(Vec2::new(2.0, 0.0), 0.0));
        let (state, _) = look(&world, &standing(here));
        let (sin, cos) = 0.6f32.sin_cos();
        for (view, spacing) in views(&state).into_iter().zip([0.15, 0.45]) {
            for (i, seen) in view.iter().enumerate() {
                let (x, y) = (spacing * ((i % 9) as f32 - 4.0), spacing * ((i / 9) as f32 - 4.0));
                let place = Vec2::new(-0.2 + cos * x - sin * y, -0.3 + sin * x + cos * y);
                let clearance = world.scene.occupancy().clearance(place);
                close(*seen, 1.0 - (2.0 * clearance).min(1.0), 1e-3);
            }
        }
    }

    #[test]
    fn the_cue_is_seen_from_the_person() {
        let here = Planar::new(Vec2::new(1.0, -1.0), FRAC_PI_2);
        let mut world = World::new(&[], here, stop_cue(Vec2::new(3.0 - 0.2, -0.5), FRAC_PI_2 + 0.5));
        world.task.start.position.z = 0.0;
        let mut character = standing(here);
        character.floor = 0.02;
        world.task.cue.position.z = 0.3;
        let (state, observation) = look(&world, &character);
        let s = &state[INTERACTION..PATH];
        // Ahead is +X, which is -Y for the person; +Y is to the left, which is +X.
        let (local, distance) = (Vec2::new(0.5, -1.8), Vec2::new(0.5, -1.8).length());
        close(s[0], local.x / distance, 1e-5);
        close(s[1], local.y / distance, 1e-5);
        close(s[2], local.x / 3.0, 1e-5);
        close(s[3], local.y / 3.0, 1e-5);
        close(s[4], 0.5f32.sin(), 1e-5);
        close(s[5], -0.5f32.cos(), 1e-5);
        close(s[6], 0.28, 1e-5);
        close(s[7], distance / 3.0, 1e-5);
        // From so far away no stop is open: refused, and as bad as it is said.
        assert!(observation.action.is_none());
        assert_eq!(s[8..13], [0.0, 2.0, PI, 0.5, 3.0]);
        assert_eq!(s[13..], [0.0, 1.0]);
        assert_eq!(observation.allowed, [true, false, false]);
        // Close to it the place is not stretched, and far from it it is cut off.
        let near = look(&world, &standing(Planar::new(Vec2::new(2.6, -0.8), FRAC_PI_2))).0;
        close(near[INTERACTION], 0.3, 1e-5);
        close(near[INTERACTION + 1], -0.2, 1e-5);
        world.task.cue.position = Vec3::new(9.0, -1.0, 0.0);
        let far = look(&world, &standing(here)).0;
        close(far[INTERACTION + 3], -2.0, 1e-5);
        assert_eq!(far[INTERACTION + 7], 2.0);
    }

    #[test]
    fn the_body_is_seen() {
        let here = Planar::new(Vec2::new(0.5, 1.0), 0.9);
        let world = World::new(&[], here, stop_cue(Vec2::new(2.0, 0.0), 0.0));
        let mut character = Character::standing(database(), frame_of("walk", 5), here, 0.0);
        for _ in 0..3 {
            character.advance(database(), &Default::default());
        }
        character.contact = [0.5, 1.0];
        let (state, _) = look(&world, &character);
        let feature = character.pose_feature();
        close(state[0], 0.0, 1e-3);
        close(state[1], STANDS, 1e-5);
        for i in 0..15 {
            close(state[2 + i], feature[i], 1e-6);
            close(state[17 + i], 0.3 * feature[15 + i], 1e-6);
        }
        assert_eq!(state[32..34], [0.5, 1.0]);
        // 4 cm a frame ahead.
        close(state[34], 0.0, 1e-3);
        close(state[35], -1.2, 1e-3);
    }

    #[test]
    fn the_papers_state_has_rotations_and_the_place_in_the_scene() {
        let here = Planar::new(Vec2::new(1.5, -2.0), 0.0);
        let mut world = World::new(&[], here, stop_cue(Vec2::new(2.0, 0.0), 0.0));
        let mut other = Settings::preset("paper").expect("a preset").state;
        other.view_cells = 3;
        world.settings.state = other;
        let environment = world.environment();
        let size = BODY_SIZE + 2 * 6 * 21 + 9 + 2 + INTERACTION_SIZE;
        assert_eq!(environment.state_size(), size);
        let mut character = standing(here);
        let before = character.posture;
        character.posture.rotations[1] = glam::Quat::from_rotation_z(0.1);
        let mut out = vec![f32::NAN; size];
        observe(&environment, &character, &before, 0, None, &Taste::default(), &mut out);
        let rotations = &out[BODY_SIZE..];
        // The first columns of a turn by 0.1 about Z, and a fifth of their speed.
        let (sin, cos) = 0.1f32.sin_cos();
        for (seen, now) in rotations.iter().zip([cos, sin, 0.0, -sin, cos, 0.0]) {
            close(*seen, now, 1e-5);
        }
        for (seen, change) in rotations[6..].iter().zip([cos - 1.0, sin, 0.0, -sin, cos - 1.0, 0.0]) {
            close(*seen, 6.0 * change, 1e-4);
        }
        assert!(rotations[18..24].iter().all(|v| v.abs() < 1e-6), "nothing else moved");
        let place = &out[BODY_SIZE + 252 + 9..];
        close(place[0], 0.75, 1e-4);
        close(place[1], 1.0 / 6.0, 1e-4);
    }

    #[test]
    fn the_way_is_seen_from_the_person() {
        // Straight ahead of who faces +X, 1.6 m.
        let here = Planar::new(Vec2::new(-1.0, 0.5), FRAC_PI_2);
        let world = World::new(&[], here, stop_cue(Vec2::new(0.6, 0.5), FRAC_PI_2 + 0.4));
        let (state, _) = look(&world, &standing(here));
        let s = &state[PATH..];
        close(s[0], 1.6 / 3.0, 0.02);
        for (i, (x, y)) in [(0.0, -1.0), (0.0, -1.0), (0.0, -0.8)].into_iter().enumerate() {
            close(s[1 + 2 * i], x, 0.06);
            close(s[2 + 2 * i], y, 0.06);
        }
        close(s[7], 0.4f32.sin(), 1e-5);
        close(s[8], 0.4f32.cos(), 1e-5);
        // Where no way leads the points are where one stands.
        let world =
            World::new(&[([-0.2, -3.0, 0.0], [0.2, 3.0, 2.0])], here, stop_cue(Vec2::new(2.0, 0.5), 0.0));
        let (state, _) = look(&world, &standing(here));
        assert_eq!(state[PATH], 3.0);
        assert!(state[PATH + 1..PATH + 7].iter().all(|v| v.abs() < 1e-6));
    }

    #[test]
    fn a_sit_is_open_where_its_end_is_near_the_cue() {
        let action = |change: &dyn Fn(&mut World)| {
            let mut world = World::stool();
            change(&mut world);
            let (state, observation) = look(&world, &standing(Planar::default()));
            let accepted = observation.action.is_some_and(|a| a.accepted);
            assert_eq!(observation.allowed, [true, accepted, false]);
            assert_eq!(state[INTERACTION + 8], f32::from(u8::from(accepted)));
            if let Some(a) = observation.action {
                close(state[INTERACTION + 9], a.position.min(2.0), 1e-6);
                close(state[INTERACTION + 10], a.direction, 1e-6);
                close(state[INTERACTION + 11], a.height.min(0.5), 1e-6);
                close(state[INTERACTION + 12], a.posture.min(3.0), 1e-6);
            }
            assert_eq!(state[INTERACTION + 13..PATH], [1.0, 0.0]);
            (observation.action, accepted)
        };
        let (exact, accepted) = action(&|_| ());
        let exact = exact.expect("a sit");
        assert!(
            accepted && exact.position < 0.1 && exact.direction < 0.02 && exact.height < 0.02,
            "{exact:?}"
        );
        // Each limit by itself: just within it, and just beyond.
        type Move = fn(&mut World, f32);
        let limits: [(&str, f32, Move); 4] = [
            ("position", 0.30, |w, x| w.task.cue.position.x += x),
            ("direction", 0.5, |w, x| w.task.cue.yaw += x),
            ("direction", 0.5, |w, x| w.task.cue.yaw -= x),
            ("height", 0.08, |w, x| w.task.cue.position.z += x),
        ];
        for (name, limit, shift) in limits {
            let (near, accepted) = action(&|w| shift(w, 0.9 * limit));
            let near = near.expect("a sit");
            assert!(accepted, "{name}: {near:?}");
            let (far, accepted) = action(&|w| shift(w, 1.1 * limit));
            let far = far.expect("a sit");
            assert!(!accepted, "{name}: {far:?}");
            let of = |a: &ActionMatch| match name {
                "position" => a.position,
                "direction" => a.direction,
                _ => a.height,
            };
            close(of(&far), 1.1 * limit, 0.05 * limit);
            close(of(&near), 0.9 * limit, 0.05 * limit);
        }
        // And the transition, of who comes walking: 1.2 m/s of feet, hands and head, and feet in the air.
        let mut walks =
            Character::standing(database(), frame_of("walk", 5), Planar::new(Vec2::Y * 0.12, 0.0), 0.0);
        (0..3).for_each(|_| walks.advance(database(), &Default::default()));
        let mut world = World::stool();
        let posture = look(&world, &walks).1.action.expect("a sit").posture;
        assert!(posture > 0.3, "{posture}");
        for (limit, accepted) in [(1.05 * posture, true), (0.95 * posture, false)] {
            world.settings.synthesizer.refuse_posture = limit;
            assert_eq!(look(&world, &walks).1.action.expect("a sit").accepted, accepted);
        }
        // From farther than it reaches there is none to look for.
        assert!(action(&|w| w.task.cue.position.y += SITS_BACK + 0.7).0.is_none());
    }

    #[test]
    fn the_height_of_a_stop_says_nothing() {
        let mut world = World::stop_ahead(0.5);
        world.task.cue.position.z = 0.4;
        let mut character = Character::standing(database(), frame_of("walk", 0), Planar::default(), 0.0);
        for _ in 0..5 {
            character.advance(database(), &Default::default());
        }
        let (_, observation) = look(&world, &character);
        let action = observation.action.expect("a stop");
        assert!(action.accepted && action.height == 0.0, "{action:?}");
        assert_eq!(observation.allowed, [true, false, true]);
    }

    #[test]
    fn a_waypoint_is_rounded_and_not_cut() {
        let ahead = Vec2::new(0.0, -1.1);
        // Straight on it is no matter.
        let (goal, facing) = round(Vec2::new(0.0, -0.5), Vec2::new(0.0, -0.6), ahead, ahead, 1.1);
        close(goal.distance(ahead), 0.0, 1e-3);
        close(facing, 0.0, 1e-4);
        // Half a metre before a bend to the left, +X for who faces -Y.
        let (place, onward) = (Vec2::new(0.0, -0.5), Vec2::new(0.6, 0.0));
        let cut = place + onward;
        let (goal, facing) = round(place, onward, cut, ahead, 1.1);
        let passes_at = |goal: Vec2| {
            let v = ahead;
            let glide = |s: f32| goal * (2.0 * s * s - s.powi(3)) + v * (s - 2.0 * s * s + s.powi(3));
            (0..=100).map(|i| glide(i as f32 / 100.0).distance(place)).fold(f32::INFINITY, f32::min)
        };
        assert!(passes_at(goal) < 0.08 && passes_at(cut) > 0.1, "{} {}", passes_at(goal), passes_at(cut));
        // The turn is made by then, and it goes on to where the way leads.
        close(facing, FRAC_PI_2, 1e-4);
        assert!(goal.x > 0.05, "{goal}");
        // The other side is the mirror image.
        let mirrored = |v: Vec2| Vec2::new(-v.x, v.y);
        let (other, turned) = round(mirrored(place), mirrored(onward), mirrored(cut), ahead, 1.1);
        assert!(other.distance(mirrored(goal)) < 1e-4);
        close(turned, -facing, 1e-4);
        // Who is to come back goes there first.
        let (goal, _) = round(Vec2::new(0.0, -0.8), Vec2::new(0.0, 1.0), Vec2::new(0.0, -0.5), ahead, 1.1);
        assert!(goal.y < -0.6, "{goal}");
    }

    #[test]
    fn no_sit_or_stop_is_entered_before_a_waypoint_that_it_would_not_pass() {
        let at = |x: f32| {
            let mut world = World::stop_ahead(0.5);
            world.task.passes = vec![crate::PassCue { name: "By".into(), position: Vec3::new(x, -0.3, 0.0) }];
            let mut character = Character::standing(database(), frame_of("walk", 0), Planar::default(), 0.0);
            for _ in 0..5 {
                character.advance(database(), &Default::default());
            }
            look(&world, &character).1.action.is_some()
        };
        assert!(at(0.0) && at(0.07), "on the line");
        assert!(!at(0.2) && !at(-0.2));
    }

    #[test]
    fn the_clear_way_is_proposed() {
        // Two metres to the left of who faces -Y.
        let world = World::new(&[], Planar::default(), stop_cue(Vec2::new(2.0, 0.0), 0.3));
        let (_, observation) = look(&world, &standing(Planar::default()));
        let (signal, p) = (&world.settings.signal, &observation.proposal);
        assert_eq!(p.len(), TYPE_COUNT + signal.vector_size());
        assert_eq!(p[..TYPE_COUNT], [0.0, 0.0, -4.0]);
        // A quarter turn to the left; for that 1.05 m become 1.25 - 0.5 of it.
        close(p[TYPE_COUNT], 0.75 * signal.pace / signal.reach, 0.03);
        close(p[TYPE_COUNT + 1], 0.0, 0.03);
        close(p[TYPE_COUNT + 2], FRAC_PI_2 / signal.largest_turn, 0.03);
        assert!(p[TYPE_COUNT + 3..].iter().all(|v| *v == 0.0));
        // Straight behind: the turn is cut off, and the stride shortest.
        let world = World::new(&[], Planar::default(), stop_cue(Vec2::new(-0.01, 2.0), 0.3));
        let p = look(&world, &standing(Planar::default())).1.proposal;
        close(p[TYPE_COUNT + 2].abs(), 1.0, 1e-5);
        close(p[TYPE_COUNT + 1], 0.25 * signal.pace / signal.reach, 0.03);
        // Close to the cue one goes slower, and turns as it asks.
        let world = World::new(&[], Planar::default(), stop_cue(Vec2::new(0.0, -0.3), 0.3));
        let (_, observation) = look(&world, &standing(Planar::default()));
        let p = observation.proposal;
        close(p[TYPE_COUNT + 2], 0.3 / signal.largest_turn, 1e-4);
        close(p[TYPE_COUNT + 1], -(1.25 - 0.3 / PI).min(1.0) * 0.3 / signal.reach, 0.04);
        // Nothing is proposed where the settings say so.
        let mut world = World::new(&[], Planar::default(), stop_cue(Vec2::new(2.0, 0.0), 0.3));
        world.settings.signal.propose_clear_path = false;
        let p = look(&world, &standing(Planar::default())).1.proposal;
        assert!(p.iter().all(|v| *v == 0.0));
    }

    #[test]
    fn an_open_sit_is_proposed_by_its_fit() {
        for shift in [0.0, 0.2] {
            let mut world = World::stool();
            world.task.cue = sit_cue();
            world.task.cue.position = Vec3::new(0.0, SITS_BACK + shift, SITS_AT);
            let (_, observation) = look(&world, &standing(Planar::default()));
            let a = observation.action.expect("a sit");
            let fit = a.position / 0.15 + a.direction / 0.3 + a.posture / 0.6;
            close(observation.proposal[1], 2.0 - 1.5 * fit, 1e-4);
            assert!((observation.proposal[1] > 0.9) == (shift == 0.0), "{}", observation.proposal[1]);
        }
    }

    #[test]
    fn where_no_way_leads_the_cue_itself_is_proposed() {
        let wall = [([-0.2, -3.0, 0.0], [0.2, 3.0, 2.0])];
        let here = Planar::new(Vec2::new(-2.0, 0.0), FRAC_PI_2);
        let world = World::new(&wall, here, stop_cue(Vec2::new(0.0 + 1.0, 0.0), 0.0));
        let p = look(&world, &standing(here)).1.proposal;
        assert!(p[TYPE_COUNT + 1] < -0.5, "{p:?}");
        close(p[TYPE_COUNT], 0.0, 1e-4);
    }

    #[test]
    fn before_a_seat_of_one_side_one_turns_the_back_to_it() {
        // A stool between table and wall: only its sides are free.
        let boxes = [
            ([-0.2, -0.2, 0.42], [0.2, 0.2, 0.46]),
            ([-0.8, -1.1, 0.68], [0.8, -0.35, 0.74]),
            ([-0.8, 0.25, 0.0], [0.8, 0.3, 2.0]),
        ];
        let mut cue = sit_cue();
        cue.position = Vec3::new(0.0, 0.0, 0.56);
        let mut world = World::new(&boxes, Planar::new(Vec2::new(2.0, 0.0), -FRAC_PI_2), cue);
        let way = world.environment().path.last().clone();
        assert!(way.from_the_side());
        let end_from = |place| way.arrival_at(way.point_ahead(place, 2.0)).expect("a place to stand");
        let arrival = end_from(end_from(Vec2::new(0.6, 0.0)).position);
        // There, facing the seat, what is proposed is to turn away from it.
        let here = Planar::new(arrival.position, arrival.yaw + 0.8);
        world.task.start.position = here.position.extend(0.0);
        assert!(arrival.position.distance(end_from(arrival.position).position) < 0.1);
        let (state, observation) = look(&world, &standing(here));
        close(observation.proposal[TYPE_COUNT + 2], -0.8 / world.settings.signal.largest_turn, 0.02);
        close(state[PATH + 7], -0.8f32.sin(), 0.02);
        close(state[PATH + 8], 0.8f32.cos(), 0.02);
    }
}
