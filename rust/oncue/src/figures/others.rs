//! Other people in a shot: where each is on every frame of one clock, how deep two are in one another, and how long somebody waits
//! to get past.

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::percent;
use super::spans::Spans;
use crate::anatomy::{BodyPart, DEEP, body_capsules};
use crate::math::capsule::Capsule;
use crate::motion::{FRAME_RATE, Motion, Pose};

/// People who pass one another leave so much between them where they can, metres.
const BERTH: f32 = 0.05;
/// For that they wait so many frames longer than to get past at all.
const POLITE: usize = 60;
/// Waiting is tried in steps of so many frames: a tenth of a second.
const WAIT_STEP: usize = 3;
/// Whoever is past within so many frames of the place of a meeting takes part in it.
const TRAIL: usize = 15;
/// Who goes no farther than this is at rest, metres.
const STAYS: f32 = 0.12;
/// What a motion that meets somebody costs among others, in objections of an eye; and a second of waiting.
const MEETS: f32 = 3.0;
const WAITS: f32 = 0.5;
/// Sides of a limb where it is made a solid.
const SIDES: usize = 8;

/// A body on one frame.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pelvis: Vec3,
    capsules: Vec<(BodyPart, Capsule)>,
    /// The corners of the box about it.
    bounds: (Vec3, Vec3),
}

/// How near is too near.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Near {
    /// Deeper in one another than flesh gives.
    Deep,
    /// Nearer than people pass.
    Close,
}

impl Body {
    pub(crate) fn of(pose: &Pose) -> Self {
        Self::made_of(pose.positions[0], body_capsules(pose).to_vec())
    }

    /// Somebody who stands at a place on the floor, whatever the arms do.
    fn standing(place: Vec3) -> Self {
        let ends = [place + Vec3::Z * 0.35, place + Vec3::Z * 1.45];
        Self::made_of(place + Vec3::Z, vec![(BodyPart::Trunk, Capsule { ends, radii: [0.15; 2] })])
    }

    fn made_of(pelvis: Vec3, capsules: Vec<(BodyPart, Capsule)>) -> Self {
        let boxes = capsules.iter().map(|(_, c)| box_of(c));
        let bounds = boxes.reduce(|(lo, hi), (low, high)| (lo.min(low), hi.max(high)));
        Self { pelvis, bounds: bounds.unwrap_or((pelvis, pelvis)), capsules }
    }

    /// The pairs of capsules of two bodies that may be nearer than `gap`, metres.
    fn pairs<'a>(
        &'a self,
        other: &'a Body,
        gap: f32,
    ) -> impl Iterator<Item = (&'a (BodyPart, Capsule), &'a (BodyPart, Capsule))> {
        let near = !apart(self.bounds, other.bounds, gap);
        let own = self.capsules.iter().filter(move |(_, c)| near && !apart(box_of(c), other.bounds, gap));
        own.flat_map(move |one| other.capsules.iter().map(move |two| (one, two)))
            .filter(move |(one, two)| !apart(box_of(&one.1), box_of(&two.1), gap))
    }

    fn is(&self, near: Near, other: &Body) -> bool {
        match near {
            Near::Close => self.pairs(other, BERTH).any(|(one, two)| one.1.depth_in(&two.1) > -BERTH),
            Near::Deep => self.touches(other).any(|(_, depth)| depth > DEEP),
        }
    }

    /// The parts of two bodies that are in one another, and how deep, beyond what flesh gives, metres.
    fn touches<'a>(&'a self, other: &'a Body) -> impl Iterator<Item = ([BodyPart; 2], f32)> {
        self.pairs(other, 0.0).filter_map(|((part, one), (theirs, two))| {
            let depth = one.depth_in(two) - part.gives() - theirs.gives();
            (depth > 0.0).then_some(([*part, *theirs], depth))
        })
    }

    /// The body as triangles, for a scene that it is in the way in.
    fn solid(&self, out: &mut Vec<[Vec3; 3]>) {
        for (_, Capsule { ends, radii }) in &self.capsules {
            let along = (ends[1] - ends[0]).normalize_or(Vec3::Z);
            let across = along.any_orthonormal_vector();
            let beside = along.cross(across);
            let ring = |end: usize, i: usize| {
                let (sin, cos) = (std::f32::consts::TAU * (i % SIDES) as f32 / SIDES as f32).sin_cos();
                ends[end] + (across * cos + beside * sin) * radii[end]
            };
            let tips = [ends[0] - along * radii[0], ends[1] + along * radii[1]];
            for i in 0..SIDES {
                let [a, b, c, d] = [ring(0, i), ring(0, i + 1), ring(1, i), ring(1, i + 1)];
                out.extend([[a, b, d], [a, d, c], [tips[0], b, a], [tips[1], c, d]]);
            }
        }
    }
}

fn box_of(capsule: &Capsule) -> (Vec3, Vec3) {
    let reach = Vec3::splat(capsule.radii[0].max(capsule.radii[1]));
    let [one, other] = capsule.ends;
    (one.min(other) - reach, one.max(other) + reach)
}

fn apart(one: (Vec3, Vec3), other: (Vec3, Vec3), gap: f32) -> bool {
    (one.0 - other.1).max(other.0 - one.1).max_element() > gap
}

/// Somebody else in the shot: at rest before the clock's frame 0, and after the last frame.
#[derive(Debug, Clone)]
pub(crate) struct Other {
    pub name: String,
    bodies: Vec<Body>,
    /// The frame from which on nothing is known of them.
    until: usize,
}

impl Other {
    /// Somebody whose motion is there.
    pub(crate) fn moving(name: &str, motion: &Motion) -> Self {
        Self { name: name.to_owned(), bodies: bodies(motion), until: usize::MAX }
    }

    /// Somebody who stands at a place on the floor for so many frames.
    pub(crate) fn standing(name: &str, place: Vec3, until: usize) -> Self {
        Self { name: name.to_owned(), bodies: vec![Body::standing(place)], until }
    }

    /// A fingerprint of where they are.
    pub(crate) fn fingerprint(&self) -> blake3::Hash {
        let places = self.bodies.iter().flat_map(|body| &body.capsules).flat_map(|(_, capsule)| capsule.ends);
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.until.to_le_bytes());
        for number in places.flat_map(|place| place.to_array()) {
            hasher.update(&number.to_le_bytes());
        }
        hasher.finalize()
    }

    fn at(&self, frame: usize) -> Option<&Body> {
        (frame < self.until).then(|| &self.bodies[frame.min(self.bodies.len() - 1)])
    }

    /// Frames after which nothing changes.
    fn moves(&self) -> usize {
        if self.until == usize::MAX { self.bodies.len() } else { self.until }
    }

    /// Whether they stay where they are from one frame to the other.
    fn rests(&self, first: usize, last: usize) -> bool {
        let Some(place) = self.at(first).map(|body| body.pelvis) else { return false };
        let last = last.min(self.moves());
        (first..=last).all(|frame| self.at(frame).is_some_and(|body| body.pelvis.distance(place) < STAYS))
    }
}

/// The others of who begins a motion on a frame of the clock.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Company<'a> {
    pub others: &'a [Other],
    /// The clock's frame on which the motion begins where nobody waits.
    pub begins: usize,
    /// Whether the person stays for good where the motion ends.
    pub stays: bool,
    /// Frames that the person may wait at its start.
    pub most_wait: usize,
}

impl Company<'_> {
    /// How many frames the person waits at the start of a motion to meet nobody; `None` where no wait does.
    pub(crate) fn wait(&self, motion: &Motion) -> Option<usize> {
        self.wait_of(&bodies(motion))
    }

    fn wait_of(&self, bodies: &[Body]) -> Option<usize> {
        let (least, polite) = (self.least(bodies, Near::Deep), self.least(bodies, Near::Close));
        let least = least?;
        polite.filter(|polite| *polite <= least + POLITE).or(Some(least))
    }

    /// The fewest frames of waiting with which nobody comes so near.
    fn least(&self, bodies: &[Body], near: Near) -> Option<usize> {
        let (first, last) = (bodies.first()?, bodies.last()?);
        // Later than when all have come to rest nothing changes.
        let moves = self.others.iter().map(Other::moves).max().unwrap_or(0);
        let most = self.most_wait.min(moves.saturating_sub(self.begins) + WAIT_STEP);
        for wait in (0..=most).step_by(WAIT_STEP) {
            let begins = self.begins + wait;
            if (wait.saturating_sub(WAIT_STEP)..wait)
                .any(|frame| self.meets(first, self.begins + frame, near))
            {
                return None;
            }
            let ends = begins + bodies.len();
            let on_the_way =
                bodies.par_iter().enumerate().any(|(frame, body)| self.meets(body, begins + frame, near));
            let afterwards =
                || self.stays && (ends..moves.max(ends)).any(|frame| self.meets(last, frame, near));
            if !(on_the_way || afterwards()) {
                return Some(wait);
            }
        }
        None
    }

    fn meets(&self, body: &Body, frame: usize, near: Near) -> bool {
        self.others.iter().any(|other| other.at(frame).is_some_and(|other| body.is(near, other)))
    }

    /// What is to be minded in a motion among others, as an eye's objections are counted.
    pub(crate) fn objections(&self, motion: &Motion) -> f32 {
        let bodies = bodies(motion);
        match self.wait_of(&bodies) {
            Some(wait) => WAITS * wait as f32 / FRAME_RATE,
            None => MEETS + self.met(&bodies).len() as f32,
        }
    }

    /// Whom a motion that does not wait meets, and on which frame of the clock they are nearest the middle of it.
    fn met(&self, bodies: &[Body]) -> Vec<(usize, usize)> {
        let frames = |other: &Other| -> Vec<usize> {
            let close = |frame: &usize| {
                other.at(self.begins + frame).is_some_and(|other| bodies[*frame].is(Near::Close, other))
            };
            (0..bodies.len()).filter(close).collect()
        };
        let met = self.others.iter().map(frames).enumerate().filter(|(_, frames)| !frames.is_empty());
        met.map(|(other, frames)| (other, self.begins + frames[frames.len() / 2])).collect()
    }

    /// Whether a motion that begins without a wait is deep in nobody.
    pub(crate) fn is_free(&self, motion: &Motion) -> bool {
        !bodies(motion)
            .iter()
            .enumerate()
            .any(|(frame, body)| self.meets(body, self.begins + frame, Near::Deep))
    }

    /// The others who stay where they are from the motion's begin for so many frames, as triangles.
    pub(crate) fn resting(&self, frames: usize, out: &mut Vec<[Vec3; 3]>) {
        for other in self.others.iter().filter(|other| other.rests(self.begins, self.begins + frames)) {
            other.at(self.begins).into_iter().for_each(|body| body.solid(out));
        }
    }

    /// Those whom a motion meets, as they go by there, as triangles; where somebody goes by nearer than `room` metres to one of the
    /// `places` they are left out.
    pub(crate) fn in_the_way(&self, motion: &Motion, places: &[Vec3], room: f32, out: &mut Vec<[Vec3; 3]>) {
        for (other, frame) in self.met(&bodies(motion)) {
            for frame in [frame.saturating_sub(TRAIL), frame, frame + TRAIL] {
                let Some(body) = self.others[other].at(frame) else { continue };
                let near = |place: &Vec3| place.truncate().distance(body.pelvis.truncate()) < room;
                if !places.iter().any(near) {
                    body.solid(out);
                }
            }
        }
    }
}

fn bodies(motion: &Motion) -> Vec<Body> {
    motion.postures.par_iter().map(|posture| Body::of(&posture.pose())).collect()
}

/// How often somebody is in another person of the shot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct OthersFigures {
    /// Share of the shot's frames in which a part is deeper than 1 cm in somebody else, percent.
    pub percent: f32,
    /// The deepest, cm, beyond what flesh gives; 0 where nobody touches anybody.
    pub deepest_cm: f32,
    /// What is deeper than 1 cm, from frame to frame, the deepest first.
    pub touches: Vec<OthersTouch>,
}

/// A part of somebody in a part of somebody else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OthersTouch {
    /// The name of the other person's start.
    pub person: String,
    /// Which parts: the own one, and theirs.
    pub parts: [BodyPart; 2],
    /// The first frame of the clock.
    pub first: usize,
    /// The frame after the last.
    pub end: usize,
    /// How deep at most, cm, beyond what flesh gives.
    pub depth_cm: f32,
    /// The frame in which it is deepest.
    pub frame: usize,
}

/// The figures of each of all people in a shot. After their last frames they stay where they are until the last of all.
pub(crate) fn others_figures(people: &[Other]) -> Vec<OthersFigures> {
    let frames = people.iter().map(|person| person.bodies.len()).max().unwrap_or(0);
    let of = |own: usize| {
        let touches = |frame: usize| -> Vec<(usize, [BodyPart; 2], f32)> {
            let Some(body) = people[own].at(frame) else { return Vec::new() };
            let others = people.iter().enumerate().filter(|(other, _)| *other != own);
            let at = others.filter_map(|(other, person)| Some((other, person.at(frame)?)));
            at.flat_map(|(other, theirs)| {
                body.touches(theirs).map(|(parts, depth)| (other, parts, depth)).collect::<Vec<_>>()
            })
            .collect()
        };
        let all: Vec<_> = (0..frames).into_par_iter().map(touches).collect();
        let (mut spans, mut deep, mut deepest) = (Spans::<(usize, [BodyPart; 2]), ()>::default(), 0, 0.0f32);
        for (frame, found) in all.iter().enumerate() {
            deep += usize::from(found.iter().any(|(_, _, depth)| *depth > DEEP));
            for &(other, parts, depth) in found {
                deepest = deepest.max(depth);
                if depth > DEEP {
                    spans.add(frame, (other, parts), depth, ());
                }
            }
        }
        let touches = spans.worst_first().into_iter().map(|span| OthersTouch {
            person: people[span.key.0].name.clone(),
            parts: span.key.1,
            first: span.first,
            end: span.end,
            depth_cm: 100.0 * span.worst,
            frame: span.worst_frame,
        });
        OthersFigures {
            percent: percent(deep, frames),
            deepest_cm: 100.0 * deepest,
            touches: touches.collect(),
        }
    };
    (0..people.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Planar;
    use crate::test_world::{PACE, STANDS, close, person};
    use glam::Vec2;

    fn at(x: f32, y: f32, yaw: f32) -> crate::motion::Posture {
        person(Planar::new(Vec2::new(x, y), yaw), STANDS, 0.0)
    }

    fn motion(postures: Vec<crate::motion::Posture>) -> Motion {
        Motion { contacts: vec![[1.0; 2]; postures.len()], postures }
    }

    /// Who glides along -Y from the origin, 3 m in 75 frames.
    fn ahead() -> Motion {
        motion((0..=75).map(|frame| at(0.0, -PACE * frame as f32, 0.0)).collect())
    }

    /// Who comes along X from x = -2.4 on over the same way at y = -1.6, and goes on to 2.4.
    fn across() -> Motion {
        motion((0..=120).map(|frame| at(PACE * frame as f32 - 2.4, -1.6, 1.57)).collect())
    }

    fn company(others: &[Other]) -> Company<'_> {
        Company { others, begins: 0, stays: true, most_wait: 300 }
    }

    #[test]
    fn who_crosses_is_let_pass_with_room_between() {
        let others = [Other::moving("Across", &across())];
        // Without a wait: at y = -1.6 on frame 40, when the other is 0.8 m short of the way; the other comes into the back.
        let wait = company(&others).wait(&ahead()).expect("a wait");
        assert_eq!(wait % WAIT_STEP, 0);
        let (own, theirs) = (ahead(), across());
        let gap = |wait: usize| {
            let pose = |motion: &Motion, frame: usize| motion.postures[frame.min(motion.len() - 1)].pose();
            let body = |motion: &Motion, frame: usize| Body::of(&pose(motion, frame));
            let near = |frame: usize| {
                let (one, other) = (body(&own, frame.saturating_sub(wait)), body(&theirs, frame));
                let pairs = one.capsules.iter().flat_map(|a| other.capsules.iter().map(move |b| (a, b)));
                pairs.map(|(a, b)| -a.1.depth_in(&b.1)).fold(f32::INFINITY, f32::min)
            };
            (0..200).map(near).fold(f32::INFINITY, f32::min)
        };
        assert!(gap(wait) >= BERTH - 1e-4, "{wait}: {}", gap(wait));
        assert!(wait == 0 || gap(wait - WAIT_STEP) < BERTH, "{wait}");
        // Who begins later than all have gone by meets nobody.
        let late = Company { begins: 200, ..company(&others) };
        assert_eq!(late.wait(&ahead()), Some(0));
        // Somebody who waits in the way is run into, however long.
        let stands = [Other::standing("Stays", Vec3::new(0.0, -2.0, 0.0), usize::MAX)];
        assert_eq!(company(&stands).wait(&ahead()), None);
        assert!(company(&stands).objections(&ahead()) >= MEETS);
        // Until they set out.
        let leaves = [Other::standing("Leaves", Vec3::new(0.0, -2.0, 0.0), 90)];
        let wait = company(&leaves).wait(&ahead()).expect("a wait");
        assert!((40..=90).contains(&wait), "{wait}");
        close(company(&leaves).objections(&ahead()), WAITS * wait as f32 / FRAME_RATE, 1e-5);
    }

    #[test]
    fn where_one_stays_somebody_may_come_later() {
        // The other comes to the end of the way long after the motion has ended there.
        let comes = motion((0..=300).map(|frame| at(0.02 * frame as f32 - 6.0, -3.0, 1.57)).collect());
        let others = [Other::moving("Comes", &comes)];
        assert_eq!(company(&others).wait(&ahead()), None);
        let goes_on = Company { stays: false, ..company(&others) };
        assert_eq!(goes_on.wait(&ahead()), Some(0));
    }

    #[test]
    fn figures_are_of_both_and_name_the_other() {
        let people =
            [Other::moving("Ahead", &ahead()), Other::moving("Stands", &motion(vec![at(0.1, -1.6, 0.0)]))];
        let [own, theirs] = &others_figures(&people)[..] else { panic!("two people") };
        assert!(own.percent > 10.0 && own.percent < 40.0, "{own:?}");
        close(own.percent, theirs.percent, 1e-4);
        close(own.deepest_cm, theirs.deepest_cm, 1e-3);
        let (one, other) = (&own.touches[0], &theirs.touches[0]);
        assert_eq!((one.person.as_str(), other.person.as_str()), ("Stands", "Ahead"));
        assert_eq!([one.parts[0], one.parts[1]], [other.parts[1], other.parts[0]]);
        assert!((one.first..one.end).contains(&one.frame) && one.first > 25 && one.end < 56, "{one:?}");
        let said = own.problems();
        assert!(said[0].contains("of ‘Stands’ (frames ") && said.len() <= 4, "{said:?}");
        assert!(others_figures(&people[..1])[0].touches.is_empty());
    }

    #[test]
    fn a_body_is_a_solid_of_its_own_size() {
        let body = Body::of(&at(0.0, 0.0, 0.0).pose());
        let mut solid = Vec::new();
        body.solid(&mut solid);
        assert_eq!(solid.len(), body.capsules.len() * 4 * SIDES);
        let (low, high) = solid
            .iter()
            .flatten()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        assert!(low.distance(body.bounds.0) < 0.03 && high.distance(body.bounds.1) < 0.03, "{low} {high}");
    }
}
