//! Who sits and stays lays a hand on what is beside the seat, where there is something to lay it on.

use glam::{Mat3, Quat, Vec2, Vec3};
use rayon::prelude::*;

use super::limb::reach;
use super::{Flaws, Hold, flawless, flawless_way, settles};
use crate::math::curve::least_jerk;
use crate::motion::skeleton::ARMS;
use crate::motion::{FRAME_RATE, Motion, Posture};

/// Where a wrist may lie: beside the pelvis, ahead of it, and over the seat, metres; where it lies best.
const BESIDE: (f32, f32) = (0.22, 0.42);
const AHEAD: (f32, f32) = (0.06, 0.34);
const OVER_SEAT: (f32, f32) = (0.10, 0.32);
const BEST: Vec2 = Vec2::new(0.29, 0.20);
const STEP: f32 = 0.03;
/// Of the places in which a hand could lie so many are tried on the whole way.
const TRIED: usize = 4;
/// What carries fingers and forearm is as high to within so much, so far ahead of the wrist and behind it, metres.
const LEVEL: f32 = 0.025;
const FINGERS: f32 = 0.08;
const FOREARM: f32 = 0.10;
/// Rays come down from so high over the seat, metres.
const RAYS_FROM: f32 = 0.40;
/// A wrist's middle over what carries it, metres.
const WRIST_OVER: f32 = 0.046;
/// Fingers point inwards and down by so much, radians.
const INWARDS: f32 = 0.15;
const DOWN: f32 = 0.02;
/// How the hand gets there: when and in how long, seconds; how high it goes on the way, metres; turns of the elbow about the
/// line from shoulder to hand, radians. The first that brings nothing into anything is taken.
const AT: f32 = 0.05;
const SECONDS: f32 = 0.85;
const RISES: [f32; 3] = [0.06, 0.12, 0.18];
const SWIVELS: [f32; 5] = [0.0, 0.25, -0.25, 0.5, -0.5];

/// Lays a hand on what is beside the seat; whether there is such a thing and a way there.
pub(super) fn lay_aside(motion: &mut Motion, hold: &Hold, side: usize) -> bool {
    let base = &motion.postures[hold.from..];
    let Some(seat) = hold.around.seats.at_end() else { return false };
    if !settles(motion, hold) {
        return false;
    }
    let last = base.len() - 1;
    let places = armrest(&base[last], hold, seat, side);
    if places.is_empty() {
        return false;
    }
    let rest: Vec<Flaws> = base.par_iter().map(|posture| Flaws::of(posture, hold)).collect();
    let whole = |place: &Place, swivel: f32, rises: f32| {
        flawless_way(&rest, hold, |frame| laid(&base[frame], frame, place, side, swivel, rises))
    };
    let ends = places.iter().flat_map(|place| SWIVELS.map(|swivel| (place, swivel)));
    let laid = ends
        .filter(|&(place, swivel)| {
            let end = laid(&base[last], last, place, side, swivel, 0.0);
            flawless(end, &rest[last], hold).is_some()
        })
        .take(TRIED)
        .find_map(|(place, swivel)| RISES.iter().find_map(|&rises| whole(place, swivel, rises)));
    let Some(laid) = laid else { return false };
    motion.postures[hold.from..].copy_from_slice(&laid);
    true
}

/// Where a wrist lies, and how the hand is turned; world.
struct Place {
    wrist: Vec3,
    turned: Quat,
}

/// Where there is something level beside the seat that is long enough for a hand and half a forearm; the best place first.
fn armrest(posture: &Posture, hold: &Hold, seat: f32, side: usize) -> Vec<Place> {
    let sign = if side == 0 { 1.0 } else { -1.0 };
    let heading = Quat::from_rotation_z(posture.planar().yaw);
    let middle = posture.root_position;
    let at = |beside: f32, ahead: f32| middle + heading * Vec3::new(sign * beside, -ahead, 0.0);
    let height = |beside: f32, ahead: f32| {
        let from = at(beside, ahead).with_z(seat + RAYS_FROM);
        let down = hold.around.scene.ray(from, Vec3::NEG_Z, RAYS_FROM - OVER_SEAT.0)?;
        (RAYS_FROM - down <= OVER_SEAT.1).then_some(seat + RAYS_FROM - down)
    };
    let steps = |(least, most): (f32, f32)| {
        (0..=((most - least) / STEP).round() as usize).map(move |step| least + STEP * step as f32)
    };
    let carries = |beside: f32, ahead: f32| {
        let top = height(beside, ahead)?;
        let level = |ahead: f32| height(beside, ahead).is_some_and(|other| (other - top).abs() < LEVEL);
        (level(ahead + FINGERS) && level(ahead - FOREARM)).then_some(top)
    };
    let fingers = heading * Vec3::new(-sign * INWARDS, -1.0, -DOWN).normalize();
    // The palm is below: a hand's X axis is along the arm on the left and against it on the right.
    let x = sign * fingers;
    let y = Vec3::Z.cross(x).normalize();
    let turned = Quat::from_mat3(&Mat3::from_cols(x, y, x.cross(y)));
    let mut found: Vec<(f32, Place)> = steps(BESIDE)
        .flat_map(|beside| steps(AHEAD).map(move |ahead| (beside, ahead)))
        .filter_map(|(beside, ahead)| {
            let wrist = at(beside, ahead).with_z(carries(beside, ahead)? + WRIST_OVER);
            Some((Vec2::new(beside, ahead).distance(BEST), Place { wrist, turned }))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, place)| place).collect()
}

/// A frame in which the hand is on its way, and whether it is missed.
fn laid(
    base: &Posture,
    frame: usize,
    place: &Place,
    side: usize,
    swivel: f32,
    rises: f32,
) -> (Posture, bool) {
    let sign = if side == 0 { 1.0 } else { -1.0 };
    let [_, upper, lower, hand] = ARMS[side];
    let (mut posture, mut pose) = (*base, base.pose());
    let u = ((frame as f32 / FRAME_RATE - AT) / SECONDS).clamp(0.0, 1.0);
    let part = least_jerk(u);
    let to = pose.position(hand).lerp(place.wrist, part) + Vec3::Z * (rises * 16.0 * (u * (1.0 - u)).powi(2));
    let turned = pose.rotation(hand).slerp(place.turned, part);
    let limb = [upper, lower, hand];
    let away = reach(&mut posture, &mut pose, limb, Vec3::Z * -sign, to, turned, sign * swivel * part);
    (posture, away > 0.01)
}
