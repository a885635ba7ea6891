//! Things that hands take: their boxes, where hands grip them, and what can be said of them before anything is played.

use glam::{Quat, Vec3};

use crate::cue::{Hand, Performance, Thing, ThingCue};
use crate::error::{Error, Result};
use crate::math::capsule::Capsule;

/// One hand carries what is no larger than this along its shortest, middle and longest side, metres; two hands what is no larger than that.
const LARGEST: [[f32; 3]; 2] = [[0.25, 0.50, 0.80], [0.50, 0.70, 1.00]];
/// Two hands beside a grip that is not within a thing keep so far from it each, metres.
const BESIDE: f32 = 0.10;

/// Where a thing is, and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    /// World, metres.
    pub position: Vec3,
    /// World.
    pub rotation: Quat,
}

impl Placement {
    /// A point of the thing's own in the world, metres.
    pub(super) fn point(&self, own: Vec3) -> Vec3 {
        self.position + self.rotation * own
    }
}

impl Thing {
    /// Where it is at first.
    pub(crate) fn placement(&self) -> Placement {
        let [w, x, y, z] = self.rotation;
        Placement { position: self.position, rotation: Quat::from_xyzw(x, y, z, w).normalize() }
    }

    /// Its box.
    pub(super) fn own(&self) -> Box3 {
        Box3 { low: self.low, high: self.high }
    }

    fn check(&self) -> Result<()> {
        let name = &self.name;
        let numbers = self.position.is_finite() && self.low.is_finite() && self.high.is_finite();
        let turn = self.rotation.iter().map(|part| part * part).sum::<f32>();
        if !numbers || !self.low.cmple(self.high).all() || (turn - 1.0).abs() > 1e-2 {
            return Err(Error::input(format!(
                "Thing ‘{name}’ has a place or a box that is not a number, a box inside out, or a rotation that is no unit quaternion."
            )));
        }
        Ok(())
    }
}

/// A box in a thing's own frame, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Box3 {
    pub low: Vec3,
    pub high: Vec3,
}

impl Box3 {
    pub(super) fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let high = |bit: usize| i >> bit & 1 == 1;
            Vec3::select(glam::BVec3::new(high(0), high(1), high(2)), self.high, self.low)
        })
    }

    /// Capsules within it, in its own frame: side by side along its longest side as thick as the shortest, and its edges, `thickness` thick
    /// at the most, metres.
    pub(super) fn filled(&self, thickness: f32) -> Vec<Capsule> {
        /// No more stand side by side; between them there are gaps then.
        const MOST: f32 = 24.0;
        let size = self.high - self.low;
        let capsule = |radius: f32, ends: [Vec3; 2]| Capsule { ends, radii: [radius; 2] };
        let radius = (0.5 * thickness).min(0.25 * size.min_element());
        let corners = Box3 { low: self.low + radius, high: self.high - radius }.corners();
        let pairs = (0..8usize).flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit)));
        let edges = pairs.filter(|(i, j)| i != j).map(|(i, j)| capsule(radius, [corners[i], corners[j]]));
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| size[a].total_cmp(&size[b]));
        let [short, middle, long] = axes;
        let radius = 0.5 * size[short];
        let rows = (size[middle] / size[short].max(1e-3)).ceil().clamp(1.0, MOST);
        let core = Box3 { low: self.low + radius, high: self.high - radius };
        let row = |i: usize| {
            let mut ends = [core.low, core.high];
            let part = if rows > 1.0 { i as f32 / (rows - 1.0) } else { 0.5 };
            let across = core.low[middle] + part * (core.high[middle] - core.low[middle]);
            for end in &mut ends {
                end[short] = 0.5 * (self.low[short] + self.high[short]);
                end[middle] = across;
            }
            (ends[0][long], ends[1][long]) = (core.low[long], core.high[long]);
            capsule(radius, ends)
        };
        edges.chain((0..rows as usize).map(row)).collect()
    }

    /// From the thing's origin to the middle of what it stands on, world axes, where it is turned so.
    pub(super) fn foot(&self, rotation: Quat) -> Vec3 {
        let lowest =
            self.corners().map(|corner| (rotation * corner).z).into_iter().fold(f32::INFINITY, f32::min);
        (rotation * (0.5 * (self.low + self.high))).with_z(lowest)
    }

    /// The axis of a placed thing that is nearest to a level direction, in the world, either way round; the direction where none is level.
    pub(super) fn axis_along(&self, at: &Placement, direction: Vec3) -> Vec3 {
        let axes = Vec3::AXES.map(|axis| at.rotation * axis);
        let along = |axis: &Vec3| axis.dot(direction).abs();
        let level = axes.into_iter().filter(|axis| axis.z.abs() < 0.3);
        let nearest = level.max_by(|a, b| along(a).total_cmp(&along(b))).filter(|axis| along(axis) > 0.5);
        nearest.map_or(direction, |axis| axis * axis.dot(direction).signum())
    }

    /// Where the left and the right palm grip, in the thing's frame: on its faces to either side of `grip`, or beside that where it is not
    /// within. `to_left`: the body's left in the thing's frame.
    pub(super) fn grips(&self, hand: Hand, grip: Vec3, to_left: Vec3) -> [Option<Vec3>; 2] {
        let within = grip.cmpge(self.low - 1e-3).all() && grip.cmple(self.high + 1e-3).all();
        let side = |way: Vec3| {
            if !within {
                return if hand == Hand::Both { grip + BESIDE * way } else { grip };
            }
            let to_face = |axis: usize| {
                let face = if way[axis] > 0.0 { self.high[axis] } else { self.low[axis] };
                if way[axis].abs() < 1e-4 {
                    f32::INFINITY
                } else {
                    ((face - grip[axis]) / way[axis]).max(0.0)
                }
            };
            grip + way * (0..3).map(to_face).fold(f32::INFINITY, f32::min)
        };
        [(hand != Hand::Right).then(|| side(to_left)), (hand != Hand::Left).then(|| side(-to_left))]
    }

    /// How deep a capsule is in the box of a thing that is there, metres; negative is the gap between them.
    pub(super) fn depth(&self, at: &Placement, capsule: &Capsule) -> f32 {
        /// Places along a capsule's axis that are looked at.
        const PLACES: usize = 9;
        let (middle, half) = (0.5 * (self.low + self.high), 0.5 * (self.high - self.low));
        let ends = capsule.ends.map(|end| at.rotation.inverse() * (end - at.position) - middle);
        let depth = |i: usize| {
            let part = i as f32 / (PLACES - 1) as f32;
            let over = ends[0].lerp(ends[1], part).abs() - half;
            let outside = over.max(Vec3::ZERO).length();
            capsule.radius(part) - if outside > 0.0 { outside } else { over.max_element() }
        };
        (0..PLACES).map(depth).fold(f32::NEG_INFINITY, f32::max)
    }
}

/// What can be known of things and hands before anything is played: each is there, is not too big, and is taken by free hands before it
/// is put down.
///
/// # Errors
/// `Input`, naming the cue and the person.
pub(crate) fn check_things(performance: &Performance) -> Result<()> {
    let person = &performance.start.name;
    performance.things.iter().try_for_each(Thing::check)?;
    // Who is carried by which hand.
    let mut held: Vec<(&str, Hand)> = Vec::new();
    for step in &performance.steps {
        for cue in &step.things {
            let (name, thing) = (cue.name(), cue.thing());
            if let ThingCue::Open(open) = cue {
                if let Some((other, hand)) = held.iter().find(|(_, hand)| hand.shares(open.hand)) {
                    return Err(Error::input(format!(
                        "‘{name}’ has ‘{person}’ open ‘{thing}’ with {}, and {} ‘{other}’; put that down first, or choose another hand.",
                        open.hand.in_words(),
                        hand.carries()
                    )));
                }
                continue;
            }
            let Some(known) = performance.things.iter().find(|one| one.name == thing) else {
                return Err(Error::input(format!(
                    "‘{name}’ is about ‘{thing}’, which is none of the things of ‘{person}’."
                )));
            };
            let at = held.iter().position(|(one, _)| *one == thing);
            match (cue, at) {
                (ThingCue::Take(take), None) => {
                    if let Some((other, hand)) = held.iter().find(|(_, hand)| hand.shares(take.hand)) {
                        return Err(Error::input(format!(
                            "‘{name}’ has ‘{person}’ take ‘{thing}’ with {}, and {} ‘{other}’; put that down first, or choose another hand.",
                            take.hand.in_words(),
                            hand.carries()
                        )));
                    }
                    check_size(known, take.hand, name, person)?;
                    if !take.grip.is_finite() {
                        return Err(Error::input(format!(
                            "‘{name}’ grips ‘{thing}’ at a place that is not a number."
                        )));
                    }
                    held.push((thing, take.hand));
                }
                (ThingCue::Put(put), Some(at)) => {
                    if !put.position.is_finite() || put.yaw.is_some_and(|yaw| !yaw.is_finite()) {
                        return Err(Error::input(format!(
                            "‘{name}’ puts ‘{thing}’ at a place that is not a number."
                        )));
                    }
                    held.remove(at);
                }
                (ThingCue::Take(_), Some(_)) => {
                    return Err(Error::input(format!(
                        "‘{name}’ has ‘{person}’ take ‘{thing}’, which is in a hand already; put it down first."
                    )));
                }
                (ThingCue::Open(_), _) => {}
                (ThingCue::Put(_), None) => {
                    return Err(Error::input(format!(
                        "‘{name}’ has ‘{person}’ put ‘{thing}’ down, which is in no hand by then; take it before."
                    )));
                }
            }
        }
        for path in &step.manipulations {
            if let Some((thing, hand)) = held.iter().find(|(_, hand)| hand.shares(path.hand)) {
                return Err(Error::input(format!(
                    "‘{}’ leads {} of ‘{person}’, and {} ‘{thing}’; put that down first, or choose the other hand.",
                    path.name,
                    path.hand.in_words(),
                    hand.carries()
                )));
            }
        }
    }
    Ok(())
}

fn check_size(thing: &Thing, hand: Hand, name: &str, person: &str) -> Result<()> {
    let mut sides = (thing.high - thing.low).to_array();
    sides.sort_by(f32::total_cmp);
    let most = LARGEST[usize::from(hand == Hand::Both)];
    if sides.iter().zip(most).all(|(side, most)| *side <= most) {
        return Ok(());
    }
    Err(Error::input(format!(
        "‘{}’ is too big for ‘{name}’: it measures {:.2} × {:.2} × {:.2} m, and ‘{person}’ carries up to {:.2} × {:.2} × {:.2} m with {}.",
        thing.name,
        sides[0],
        sides[1],
        sides[2],
        most[0],
        most[1],
        most[2],
        hand.in_words()
    )))
}

impl Hand {
    /// Whether one hand is of both.
    fn shares(self, other: Hand) -> bool {
        self == other || self == Hand::Both || other == Hand::Both
    }

    fn in_words(self) -> &'static str {
        match self {
            Hand::Left => "the left hand",
            Hand::Right => "the right hand",
            Hand::Both => "both hands",
        }
    }

    fn carries(self) -> &'static str {
        match self {
            Hand::Left => "the left hand carries",
            Hand::Right => "the right hand carries",
            Hand::Both => "both hands carry",
        }
    }
}
