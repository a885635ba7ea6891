//! Who sits and stays leans back where the seat has a back, until that carries the trunk.

use rayon::prelude::*;

use super::score::Moment;
use super::{ARM, Body, FEET, Flaws, GROUPS, Hold, LEGGED, TRUNK, flawless_way, settles};
use crate::anatomy::BodyPart;
use crate::math::curve::least_jerk;
use crate::motion::skeleton::{BODY_BOXES, Limb};
use crate::motion::{FRAME_RATE, Joint, Motion, Posture};

/// Farthest that anybody leans back, and whom nothing carries, radians from the vertical: thirty captured people on sofas and
/// chairs lean back by 25°.
const MOST: f32 = 0.60;
const FREELY: f32 = 0.09;
/// Who leans back by less than this to what is behind is there, radians.
const LEAST: f32 = 0.05;
/// Steps in which a back is looked for, within what it is found, and how far before it the trunk stays, radians: breath needs room.
const STEP: f32 = 0.04;
const WITHIN: f32 = 0.004;
const ROOM: f32 = 0.012;
/// Shares of the way that are tried where arms or head are in the way.
const SHARES: [f32; 3] = [1.0, 0.85, 0.7];
/// Hands come back along the thighs, in steps and at most, metres.
const HANDS_STEP: f32 = 0.02;
const HANDS_STEPS: usize = 7;
/// Seconds that leaning back takes, and for each radian.
const SECONDS: f32 = 0.75;
const SECONDS_PER_RADIAN: f32 = 1.2;

/// Lets the trunk of who sits come to rest, from the frame on which the body does: against the back of the seat where this take
/// leans back (`wanted`) and there is one, and else no farther back than who is not carried sits. Whether something carries it.
pub(super) fn settle_trunk(motion: &mut Motion, hold: &Hold, wanted: bool) -> bool {
    let frames = motion.len() - hold.from;
    let seconds = (frames - 1) as f32 / FRAME_RATE;
    if !settles(motion, hold) {
        return false;
    }
    let body = Body::new(motion, hold);
    let leans = leans_back(&body.base[frames - 1]);
    let back = backrest(&body, hold, frames - 1, MOST - leans);
    let (lean, hands, carried) = match back {
        Some((lean, _)) if lean < LEAST => return true,
        Some((lean, hands)) if wanted => (lean, hands, true),
        _ if leans > FREELY => (FREELY - leans, 0.0, false),
        _ => return false,
    };
    let takes = (SECONDS + SECONDS_PER_RADIAN * lean.abs()).min(seconds);
    let rest: Vec<Flaws> = body.base.par_iter().map(|posture| Flaws::of(posture, hold)).collect();
    let settled = SHARES.into_iter().find_map(|share| {
        flawless_way(&rest, hold, |frame| {
            let part = share * least_jerk(frame as f32 / FRAME_RATE / takes);
            leaning(&body, frame, lean * part, hands * part)
        })
    });
    let Some(settled) = settled else { return false };
    motion.postures[hold.from..].copy_from_slice(&settled);
    carried
}

/// Whether who sits leans back already, farther than who is not carried does.
pub(super) fn leans_already(motion: &Motion, hold: &Hold) -> bool {
    hold.around.seats.at_end().is_some() && leans_back(&motion.postures[hold.from]) > FREELY + LEAST
}

/// How far the trunk leans back, radians: the line from the lowest joint of the spine to the neck, against the vertical.
fn leans_back(posture: &Posture) -> f32 {
    let pose = posture.pose();
    let line = pose.position(Joint::Neck) - pose.position(Joint::Spine);
    let ahead = glam::Quat::from_rotation_z(posture.planar().yaw) * glam::Vec3::NEG_Y;
    (-line.dot(ahead)).atan2(line.z)
}

/// How far the trunk leans back, of at most `most`, until something carries it, radians, and the hands come back with it, metres.
fn backrest(body: &Body, hold: &Hold, last: usize, most: f32) -> Option<(f32, f32)> {
    let rest = Flaws::of(&body.base[last], hold);
    let carries = |lean: f32| Flaws::of(&leaning(body, last, lean, 0.0).0, hold).back_in_scene(&rest);
    let steps = (most / STEP).ceil().max(1.0) as usize;
    let mut carried = (1..=steps).map(|step| STEP * step as f32).find(|&lean| carries(lean))?;
    let mut free = carried - STEP;
    while carried - free > WITHIN {
        let middle = 0.5 * (free + carried);
        if carries(middle) { carried = middle } else { free = middle }
    }
    let lean = free - ROOM;
    let hands = (0..=HANDS_STEPS)
        .map(|step| HANDS_STEP * step as f32)
        .find(|&hands| !leaning(body, last, lean, hands).1)?;
    Some((lean, hands))
}

/// A frame in which the trunk leans back, and whether a foot or a hand is missed. The head looks where it did.
fn leaning(body: &Body, frame: usize, lean: f32, hands: f32) -> (Posture, bool) {
    let mut share = [0.0; GROUPS];
    [TRUNK, ARM[0], ARM[1], LEGGED, FEET].into_iter().for_each(|group| share[group] = 1.0);
    let moment =
        Moment { settled: glam::Vec2::new(-lean, 0.0), hands_settle: [-hands; 2], ..Moment::default() };
    let (posture, [feet, hands]) = body.at(frame, &moment, share);
    (posture, feet || hands)
}

impl Flaws {
    /// Whether the back is in the scene, farther than at rest.
    fn back_in_scene(&self, rest: &Flaws) -> bool {
        let deeper = self.scene.iter().any(|&(part, depth)| {
            matches!(part, BodyPart::Pelvis | BodyPart::Trunk) && depth > rest.allowed_in_scene(part)
        });
        let crosses = BODY_BOXES
            .iter()
            .zip(self.crossings.iter().zip(&rest.crossings))
            .any(|(node, (now, own))| node.limb == Limb::Torso && now > own);
        deeper || crosses
    }
}
