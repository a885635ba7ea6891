//! E(M): constraints in, the edited motion and what is left of them out (LAMA, section 3.6).

use std::ops::Range;
use std::time::Instant;

use glam::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::constraint::Constraint;
use super::foot_following::follow;
use super::latent::{Decoder, Search, SearchFigures, Target, mix, search};
use crate::body_solver::{
    DegreesOfFreedom, FADE_FRAMES, FootPlan, FoundTerms, Span, Surfaces, Term, centre_of_mass, correct,
    is_supported,
};
use crate::error::{Error, Result};
use crate::library::foot::LEGS;
use crate::math::curve::{least_jerk, smoothstep};
use crate::math::rotation::{angle_between, wrap_angle, yaw};
use crate::motion::{FRAME_RATE, Joint, Motion, Pose, Posture};
use crate::progress::Progress;
use crate::settings::EditorSettings;

/// An edited motion, and how its constraints were met.
#[derive(Debug, Clone, PartialEq)]
pub struct EditedMotion {
    /// The motion after the edit.
    pub motion: Motion,
    /// What the edit did.
    pub figures: EditFigures,
}

/// What an edit did.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct EditFigures {
    /// What is left of each constraint.
    pub constraints: Vec<ConstraintFigures>,
    /// Frames `first..end` that may differ from the motion before.
    pub first_frame: usize,
    /// The first frame after those that may differ.
    pub end_frame: usize,
    /// What the search along the manifold did, where there was one.
    pub search: Option<SearchFigures>,
    /// Seconds that the edit took.
    pub seconds: f32,
}

impl EditFigures {
    /// Two edits of one motion, the other after this one.
    pub fn join(&mut self, other: EditFigures) {
        let empty = self.end_frame == 0;
        self.first_frame = if empty { other.first_frame } else { self.first_frame.min(other.first_frame) };
        self.end_frame = self.end_frame.max(other.end_frame);
        self.constraints.extend(other.constraints);
        self.search = other.search.or(self.search.take());
        self.seconds += other.seconds;
    }
}

/// What is left of a constraint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConstraintFigures {
    /// The constraint's name.
    pub name: String,
    /// The joint's name.
    pub joint: String,
    /// Frames that it speaks of.
    pub frames: usize,
    /// Distance from the places asked for, cm; `None` where none was.
    pub mean_cm: Option<f32>,
    /// The largest distance from the places asked for, cm.
    pub max_cm: Option<f32>,
    /// The same for rotation or facing, degrees.
    pub mean_degrees: Option<f32>,
    /// The largest angle from the rotations or facings asked for, degrees.
    pub max_degrees: Option<f32>,
    /// Within 1 cm and 3°.
    pub met: bool,
}

/// σ of a hard constraint, metres and radians: met to a fraction of a millimetre where the body can.
const DEMAND_SIGMA: (f32, f32) = (2e-4, 1e-3);
/// The weight of a standing person shifts no farther than this from where it was, metres: half of a foot's length.
const BALANCE: f32 = 0.11;
/// σ of the way to a constraint, metres.
const WAY_SIGMA: f32 = 0.02;
/// σ of a wish.
const WISH_SIGMA: (f32, f32) = (0.04, 0.15);
/// A constraint this early (frames) may change the motion's first frame.
const EARLY: usize = 12;

/// A whole edit: what to meet, and what else holds.
pub(super) struct Edit<'a> {
    pub motion: &'a Motion,
    pub constraints: &'a [Constraint],
    /// World height of the floor, metres.
    pub floor: f32,
    pub settings: &'a EditorSettings,
    pub feet: FootPlan,
    /// The frames that may change.
    pub span: Range<usize>,
    /// What thighs and back of a seated body are kept out of.
    pub surfaces: Option<Surfaces<'a>>,
    /// Where the pelvis passes on its way to its constraint, if not with the least jerk: frame, place.
    pub pelvis_way: Vec<(usize, Vec3)>,
    /// Local rotations that must come out exactly: frame, joint, rotation.
    pub exact: &'a [(usize, Joint, Quat)],
}

impl<'a> Edit<'a> {
    pub(super) fn new(
        motion: &'a Motion,
        constraints: &'a [Constraint],
        floor: f32,
        settings: &'a EditorSettings,
    ) -> Self {
        let mut edit = Self {
            motion,
            constraints,
            floor,
            settings,
            feet: FootPlan::of(motion),
            span: span(motion, constraints, settings),
            surfaces: None,
            pelvis_way: Vec::new(),
            exact: &[],
        };
        let mut feet = edit.feet.clone();
        follow(&mut feet, constraints, &edit.span, |frame| edit.fade(frame));
        edit.feet = feet;
        edit
    }

    /// On the way to a constraint and back, and from one to the next, a joint moves as a reaching hand does: with the least
    /// jerk (Flash & Hogan 1985). Gives that way's places as wishes, with their frames.
    fn ways(&self) -> Vec<(usize, Term)> {
        let wish =
            |joint, offset, target| Term::Point { joint, offset, target, sigma: Vec3::splat(WAY_SIGMA) };
        let mut out: Vec<_> = self
            .pelvis_way
            .iter()
            .map(|&(frame, place)| (frame, wish(Joint::Hips, Vec3::ZERO, place)))
            .collect();
        let mut points: Vec<(Joint, Vec3)> = Vec::new();
        for c in self.constraints.iter().filter(|c| !c.soft && !c.positions.is_empty()) {
            if !is_foot(c.joint) && !points.contains(&(c.joint, c.offset)) {
                points.push((c.joint, c.offset));
            }
        }
        points.sort_by_key(|p| p.0);
        for (joint, offset) in points {
            let own = |frame: usize| self.motion.postures[frame].pose().point(joint, offset);
            // How far the point is asked away from where it was, frame by frame.
            let mut asked: Vec<Option<Vec3>> = vec![None; self.motion.len()];
            let same = |c: &&Constraint| c.joint == joint && c.offset == offset && !c.soft;
            for c in self.constraints.iter().filter(same) {
                for frame in c.frames() {
                    asked[frame] = c.position(frame).map(|p| p - own(frame)).or(asked[frame]);
                }
            }
            let reach = |away: Vec3| reach_frames(away.length(), self.settings);
            let mut before: Option<usize> = None;
            let mut frame = self.span.start;
            while frame < self.span.end {
                if asked[frame].is_some() {
                    before = Some(frame);
                    frame += 1;
                    continue;
                }
                let after = (frame..self.span.end).find(|&f| asked[f].is_some());
                let end = after.unwrap_or(self.span.end);
                let ends = [before, after].map(|f| f.map(|f| (f, asked[f].unwrap_or_default())));
                for at in frame..end {
                    if joint == Joint::Hips && self.pelvis_way.iter().any(|w| w.0 == at) {
                        continue;
                    }
                    let moved = match ends {
                        [Some((a, from)), Some((b, to))] if b - a <= reach(from) + reach(to) => {
                            Some(from.lerp(to, least_jerk((at - a) as f32 / (b - a) as f32)))
                        }
                        [from, to] => {
                            let back = from.map(|(a, away)| {
                                away * (1.0 - least_jerk((at - a) as f32 / reach(away) as f32))
                            });
                            let there = to.map(|(b, away)| {
                                away * (1.0 - least_jerk((b - at) as f32 / reach(away) as f32))
                            });
                            match (back, there) {
                                (Some(back), Some(there)) => Some(back + there),
                                (back, there) => back.or(there),
                            }
                        }
                    };
                    let moved = moved.filter(|m| m.length() > 0.0);
                    out.extend(moved.map(|m| (at, wish(joint, offset, own(at) + m))));
                }
                frame = end;
            }
        }
        out
    }

    /// Runs the edit; frames outside the span are those of the motion, bit for bit.
    pub(super) fn run<D: Decoder>(&self, decoder: Option<&D>, progress: &Progress) -> Result<EditedMotion> {
        let began = Instant::now();
        progress.stage("Editing the motion");
        let (base, figures) = match decoder.filter(|_| self.settings.manifold) {
            Some(decoder) => {
                let (motion, figures) = self.search(decoder, progress)?;
                (motion, Some(figures))
            }
            None => (self.motion.clone(), None),
        };
        progress.fraction(0.6);
        let mut motion = self.motion.clone();
        let finished = self.finish(&base, progress)?;
        for (frame, mut posture) in self.span.clone().zip(finished) {
            let before = &self.motion.postures[frame];
            for (q, before) in posture.rotations.iter_mut().zip(before.rotations) {
                if q.dot(before) < 0.0 {
                    *q = -*q;
                }
            }
            motion.postures[frame] = posture;
            for (contact, foot) in motion.contacts[frame].iter_mut().zip(&self.feet.feet[frame]) {
                // A foot that had to leave its place is in the air meanwhile.
                if *contact >= 1.0 && !foot.planted && !self.asks_foot(frame) {
                    *contact = 0.0;
                }
            }
        }
        for &(frame, joint, rotation) in self.exact {
            motion.postures[frame].rotations[joint.index()] = rotation;
        }
        progress.fraction(1.0);
        let figures = EditFigures {
            constraints: self.constraints.iter().map(|c| constraint_figures(c, &motion)).collect(),
            first_frame: self.span.start,
            end_frame: self.span.end,
            search: figures,
            seconds: began.elapsed().as_secs_f32(),
        };
        Ok(EditedMotion { motion, figures })
    }

    /// Whether a foot of that frame is asked to be somewhere; what it stands on there is not known.
    fn asks_foot(&self, frame: usize) -> bool {
        self.constraints.iter().any(|c| is_foot(c.joint) && c.frames().contains(&frame))
    }

    /// The search along the manifold, faded out towards the ends of the span.
    fn search<D: Decoder>(&self, decoder: &D, progress: &Progress) -> Result<(Motion, SearchFigures)> {
        let lower = |p: &Posture| Posture { root_position: p.root_position - Vec3::Z * self.floor, ..*p };
        let motion = Motion {
            postures: self.motion.postures.iter().map(lower).collect(),
            contacts: self.motion.contacts.clone(),
        };
        let mut targets = Vec::new();
        for c in self.constraints {
            for frame in c.frames() {
                let rotation = c.rotation(frame).or_else(|| {
                    let root = motion.postures[frame].rotations[0];
                    c.facing(frame).map(|facing| Quat::from_rotation_z(facing - yaw(root)) * root)
                });
                targets.push(Target {
                    frame,
                    joint: c.joint,
                    offset: c.offset,
                    position: c.position(frame).map(|p| p - Vec3::Z * self.floor),
                    rotation: rotation.map(Mat3::from_quat),
                });
            }
        }
        let mut feet = self.feet.places();
        feet.iter_mut().flatten().for_each(|p| p.z -= self.floor);
        let wanted = Search {
            motion: &motion,
            span: self.span.clone(),
            targets: &targets,
            feet: &feet,
            settings: self.settings,
        };
        let (mut found, figures) = search(decoder, &wanted, progress)?;
        for frame in self.span.clone() {
            let weight = self.fade(frame);
            found.postures[frame] = mix(&motion.postures[frame], &found.postures[frame], weight);
        }
        found.postures.iter_mut().for_each(|p| p.root_position.z += self.floor);
        Ok((found, figures))
    }

    /// 0 at the joined ends of the span, 1 where it is asked for something.
    fn fade(&self, frame: usize) -> f32 {
        let (first, end) = asked(self.constraints).unwrap_or((self.span.start, self.span.end));
        let joins = self.joins();
        let rise = if joins[0] && frame < first {
            (frame + 1 - self.span.start) as f32 / (first - self.span.start + 1) as f32
        } else {
            1.0
        };
        let fall = if joins[1] && frame >= end {
            (self.span.end - frame) as f32 / (self.span.end - end + 1) as f32
        } else {
            1.0
        };
        smoothstep(rise) * smoothstep(fall)
    }

    fn joins(&self) -> [bool; 2] {
        let first = asked(self.constraints).map_or(0, |(first, _)| first);
        [self.span.start > 0 || first > EARLY, self.span.end < self.motion.len()]
    }

    /// The finishing pass over the span, from what the search found.
    fn finish(&self, base: &Motion, progress: &Progress) -> Result<Vec<Posture>> {
        let postures = &base.postures[self.span.clone()];
        let degrees = self.degrees();
        let mut terms: Vec<Vec<Term>> = self.span.clone().map(|frame| self.terms(frame)).collect();
        let first = self.span.start;
        for (frame, wish) in self.ways() {
            terms[frame - first].push(wish);
        }
        let span = Span {
            postures,
            joins: self.joins(),
            degrees: &degrees,
            terms: &terms,
            found: self.surfaces.as_ref().map(|s| s as &dyn FoundTerms),
            spread: FADE_FRAMES,
        };
        correct(&span, progress)
    }

    pub(super) fn degrees(&self) -> DegreesOfFreedom {
        let joints: Vec<Joint> =
            self.constraints.iter().map(|c| c.joint).chain(self.exact.iter().map(|e| e.1)).collect();
        let turned: Vec<Joint> = self
            .constraints
            .iter()
            .filter(|c| !c.rotations.is_empty())
            .map(|c| c.joint)
            .chain(self.exact.iter().map(|e| e.1))
            .collect();
        DegreesOfFreedom::for_joints(&joints, &turned)
    }

    /// Everything that one frame should meet.
    pub(super) fn terms(&self, frame: usize) -> Vec<Term> {
        let mut out = Vec::new();
        let posture = &self.motion.postures[frame];
        let pose = posture.pose();
        self.feet.terms(frame, self.floor, &mut out);
        let asks_pelvis = self.constraints.iter().any(|c| c.joint == Joint::Hips && !c.positions.is_empty());
        let supported = is_supported(&pose, self.floor);
        // The root keeps its path; on a seat it is held, standing it may give way to a reach.
        let sigma = match (asks_pelvis, supported) {
            (true, _) => Vec3::splat(0.25),
            (false, true) => Vec3::splat(2e-3),
            (false, false) => Vec3::new(0.05, 0.05, 0.06),
        };
        out.push(Term::Point {
            joint: Joint::Hips,
            offset: Vec3::ZERO,
            target: pose.position(Joint::Hips),
            sigma,
        });
        if !supported && !asks_pelvis {
            let most =
                if self.motion.contacts[frame].iter().all(|&c| c >= 1.0) { BALANCE } else { f32::INFINITY };
            out.push(Term::Balance { target: centre_of_mass(&pose), sigma: 0.03, most });
        }
        self.free_terms(&pose, supported, &mut out);
        for c in self.constraints {
            let (place, turn) = if c.soft { WISH_SIGMA } else { DEMAND_SIGMA };
            if let Some(target) = c.position(frame) {
                let sigma = Vec3::splat(place);
                out.push(Term::Point { joint: c.joint, offset: c.offset, target, sigma });
            }
            if let Some(target) = c.rotation(frame) {
                out.push(Term::Turn { joint: c.joint, target, sigma: turn });
            }
            if let Some(yaw) = c.facing(frame) {
                out.push(Term::Facing { yaw, sigma: turn });
            }
        }
        for &(_, joint, target) in self.exact.iter().filter(|e| e.0 == frame) {
            out.push(Term::Local { joint, target, sigma: 1e-4 });
        }
        out
    }

    /// What is asked for nothing follows the trunk only in part: the head stays upright, an arm hangs as it hung, the hand
    /// of a seated person rests where it rested.
    fn free_terms(&self, pose: &Pose, supported: bool, out: &mut Vec<Term>) {
        use Joint::*;
        let asked = |chain: &[Joint]| self.constraints.iter().any(|c| chain.contains(&c.joint));
        if !asked(&[Neck, Head]) {
            out.push(Term::Turn { joint: Head, target: pose.rotation(Head), sigma: 0.4 });
        }
        for arm in [
            [LeftShoulder, LeftArm, LeftForeArm, LeftHand],
            [RightShoulder, RightArm, RightForeArm, RightHand],
        ] {
            if asked(&arm) {
                continue;
            }
            if supported {
                let sigma = Vec3::splat(0.04);
                out.push(Term::Point {
                    joint: arm[3],
                    offset: Vec3::ZERO,
                    target: pose.position(arm[3]),
                    sigma,
                });
            } else {
                out.push(Term::Turn { joint: arm[1], target: pose.rotation(arm[1]), sigma: 0.25 });
            }
        }
    }

    /// Refuses those of `constraints` that the body cannot meet from where it stands or sits, before anything is edited.
    ///
    /// # Errors
    /// `Unreachable`; the sentence says by how much and which way to move the cue.
    pub(super) fn check_reach(&self, constraints: &[Constraint], progress: &Progress) -> Result<()> {
        /// Frames looked at for each constraint.
        const LOOKS: usize = 9;
        /// A miss that the whole edit may still close, metres.
        const NEAR: f32 = 0.01;
        let degrees = self.degrees();
        let solve = |frames: &[usize], terms: Vec<Vec<Term>>| {
            let postures: Vec<Posture> = frames.iter().map(|&f| self.motion.postures[f]).collect();
            let span = Span {
                postures: &postures,
                joins: [false; 2],
                degrees: &degrees,
                terms: &terms,
                found: self.surfaces.as_ref().map(|s| s as &dyn FoundTerms),
                spread: 0.0,
            };
            correct(&span, progress)
        };
        let miss = |c: &Constraint, frame: usize, posture: &Posture| {
            c.position(frame).map(|target| c.point(&posture.pose()) - target)
        };
        for c in constraints.iter().filter(|c| !c.soft && !c.positions.is_empty()) {
            let frames = c.frames();
            let looks = frames.len().min(LOOKS);
            let looked: Vec<usize> =
                (0..looks).map(|i| frames.start + i * (frames.len() - 1) / (looks - 1).max(1)).collect();
            let reached = solve(&looked, looked.iter().map(|&f| self.terms(f)).collect())?;
            let worst = looked
                .iter()
                .zip(&reached)
                .filter_map(|(&frame, posture)| Some((frame, miss(c, frame, posture)?.length())))
                .filter(|(_, miss)| *miss > NEAR)
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((frame, _)) = worst else { continue };
            // Of several on that frame the one farthest from the root gives way: all that is missing is its.
            let asked = constraints.iter().filter(|o| !o.soft && o.position(frame).is_some());
            let blamed = asked.max_by_key(|o| o.joint).unwrap_or(c);
            let mut terms = self.terms(frame);
            let target = blamed.position(frame).unwrap_or_default();
            for term in &mut terms {
                if let Term::Point { joint, target: t, sigma, .. } = term
                    && *joint == blamed.joint
                    && *t == target
                {
                    *sigma = Vec3::splat(0.01);
                }
            }
            let posture = solve(&[frame], vec![terms])?[0];
            let miss = miss(blamed, frame, &posture).unwrap_or_default();
            // Asked for less sharply it is reached after all: the first search had lost its way.
            if miss.length() <= NEAR {
                continue;
            }
            let here = self.motion.postures[frame].planar();
            let local = here.direction_to_local(miss.truncate());
            return Err(Error::Unreachable(format!(
                "‘{}’ is {:.2} m out of reach of the {} on frame {frame}; move it {}, or the character nearer.",
                blamed.name,
                miss.length(),
                blamed.joint.name(),
                directions(local.x, -local.y, miss.z)
            )));
        }
        Ok(())
    }
}

/// "0.21 m back and 0.10 m down", as the character sees it: left, ahead and up in metres.
fn directions(left: f32, ahead: f32, up: f32) -> String {
    let mut parts: Vec<(f32, &str)> = vec![
        (ahead.abs(), if ahead > 0.0 { "away from the character" } else { "towards the character" }),
        (left.abs(), if left > 0.0 { "to the character's left" } else { "to the character's right" }),
        (up.abs(), if up > 0.0 { "up" } else { "down" }),
    ];
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = (0.25 * parts[0].0).max(0.01);
    parts.retain(|p| p.0 >= least);
    let words: Vec<String> = parts.iter().map(|(d, way)| format!("{d:.2} m {way}")).collect();
    words.join(" and ")
}

/// First frame and end of what the constraints ask for.
fn asked(constraints: &[Constraint]) -> Option<(usize, usize)> {
    let first = constraints.iter().map(|c| c.frames().start).min()?;
    let end = constraints.iter().map(|c| c.frames().end).max()?;
    Some((first, end))
}

/// The frames that an edit may change: those asked for, and room before and after to get there and back.
pub(super) fn span(motion: &Motion, constraints: &[Constraint], settings: &EditorSettings) -> Range<usize> {
    let whole = whole_span(motion, constraints, settings);
    whole.start..whole.end.min(motion.len())
}

/// The same with the whole of the way back, which may end after the motion.
pub(crate) fn whole_span(
    motion: &Motion,
    constraints: &[Constraint],
    settings: &EditorSettings,
) -> Range<usize> {
    let Some((mut first, mut end)) = asked(constraints) else { return 0..0 };
    for c in constraints {
        let frames = c.frames();
        let away = |frame: usize| {
            let posture = motion.postures.get(frame)?;
            Some(c.position(frame)?.distance(c.point(&posture.pose())))
        };
        let before = reach_frames(away(frames.start).unwrap_or_default(), settings);
        let after = reach_frames(away(frames.end - 1).unwrap_or_default(), settings);
        first = first.min(frames.start.saturating_sub(before));
        end = end.max(frames.end + after);
    }
    first..end
}

/// Frames of a reach over `distance` metres: long ones take longer, though not in proportion.
pub(crate) fn reach_frames(distance: f32, settings: &EditorSettings) -> usize {
    let seconds =
        (settings.reach_seconds + settings.reach_seconds_per_metre * distance).max(settings.blend_seconds);
    (seconds * FRAME_RATE).round() as usize
}

fn is_foot(joint: Joint) -> bool {
    LEGS.iter().any(|leg| leg[1..].contains(&joint))
}

/// What is left of a constraint in a motion.
pub(crate) fn constraint_figures(c: &Constraint, motion: &Motion) -> ConstraintFigures {
    let (mut places, mut turns) = (Vec::new(), Vec::new());
    for frame in c.frames() {
        let Some(posture) = motion.postures.get(frame) else { continue };
        let pose = posture.pose();
        places.extend(c.position(frame).map(|p| 100.0 * p.distance(c.point(&pose))));
        turns.extend(c.rotation(frame).map(|q| angle_between(q, pose.rotation(c.joint)).to_degrees()));
        turns.extend(c.facing(frame).map(|f| wrap_angle(f - posture.planar().yaw).abs().to_degrees()));
    }
    let mean = |v: &[f32]| (!v.is_empty()).then(|| v.iter().sum::<f32>() / v.len() as f32);
    let max = |v: &[f32]| v.iter().copied().reduce(f32::max);
    ConstraintFigures {
        name: c.name.clone(),
        joint: c.joint.name().to_owned(),
        frames: c.frames().len(),
        mean_cm: mean(&places),
        max_cm: max(&places),
        mean_degrees: mean(&turns),
        max_degrees: max(&turns),
        met: max(&places).is_none_or(|m| m <= 1.0) && max(&turns).is_none_or(|m| m <= 3.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::latent::SearchFigures;
    use crate::manifold::Manifold;
    use crate::motion::JOINT_COUNT;
    use crate::test_world::{SITS_AT, close, person, still};
    use glam::Vec2;

    fn hand(first: usize, places: &[Vec3]) -> Constraint {
        Constraint::positions("Lid", Joint::LeftHand, first, places.to_vec())
    }

    /// The place of the left hand of who stands, and so far from there.
    fn near(by: Vec3) -> Vec3 {
        still(1).postures[0].pose().position(Joint::LeftHand) + by
    }

    fn settings() -> EditorSettings {
        EditorSettings {
            blend_seconds: 0.2,
            reach_seconds: 0.1,
            reach_seconds_per_metre: 1.0,
            manifold: false,
            ..Default::default()
        }
    }

    #[test]
    fn a_reach_takes_its_time() {
        let s = EditorSettings {
            reach_seconds: 0.6,
            reach_seconds_per_metre: 0.3,
            blend_seconds: 0.7,
            ..settings()
        };
        // 0.6 + 0.3 · 1 s, and never less than the blend.
        assert_eq!((reach_frames(1.0, &s), reach_frames(0.0, &s), reach_frames(2.0, &s)), (27, 21, 36));
    }

    #[test]
    fn the_span_is_what_is_asked_with_the_ways_there_and_back() {
        let motion = still(60);
        // 0.3 m away at first, 0.5 m at last: 0.4 s and 0.6 s.
        let c = hand(30, &[near(Vec3::Y * -0.3), near(Vec3::Y * -0.4), near(Vec3::Y * -0.5)]);
        assert_eq!(span(&motion, std::slice::from_ref(&c), &settings()), 18..51);
        assert_eq!(whole_span(&motion, std::slice::from_ref(&c), &settings()), 18..51);
        // With a second one at the ends: no farther than the motion, but for the way back.
        let late = Constraint { joint: Joint::RightHand, ..hand(58, &[near(Vec3::ZERO)]) };
        let early = Constraint { rotations: vec![Quat::IDENTITY], ..hand(2, &[]) };
        let all = [c, late, early];
        let whole = whole_span(&motion, &all, &settings());
        assert!(whole.start == 0 && whole.end > 60, "{whole:?}");
        assert_eq!(span(&motion, &all, &settings()), 0..60);
        assert_eq!(asked(&all), Some((2, 59)));
        assert_eq!((span(&motion, &[], &settings()), asked(&[])), (0..0, None));
    }

    #[test]
    fn an_edit_fades_in_and_out() {
        let motion = still(60);
        let c = [hand(30, &[near(Vec3::ZERO); 3])];
        let s = settings();
        let edit = Edit::new(&motion, &c, 0.0, &s);
        // 0.2 s are six frames to either side.
        assert_eq!(edit.span, 24..39);
        assert_eq!(edit.joins(), [true, true]);
        for frame in 24..39 {
            let t = match frame {
                24..30 => (frame - 23) as f32 / 7.0,
                33..39 => (39 - frame) as f32 / 7.0,
                _ => 1.0,
            };
            close(edit.fade(frame), t * t * (3.0 - 2.0 * t), 1e-5);
        }
        // At the motion's ends it begins and ends with what is asked.
        let c = [hand(3, &[near(Vec3::ZERO); 57])];
        let edit = Edit::new(&motion, &c, 0.0, &s);
        assert_eq!((edit.span.clone(), edit.joins()), (0..60, [false, false]));
        assert!((0..60).all(|f| edit.fade(f) == 1.0));
        // Later than twelve frames the first frame is kept.
        let c = [hand(13, &[near(Vec3::Y * -0.9)])];
        let edit = Edit::new(&motion, &c, 0.0, &s);
        assert_eq!((edit.span.start, edit.joins()), (0, [true, true]));
        let c = [hand(12, &[near(Vec3::Y * -0.9)])];
        assert_eq!(Edit::new(&motion, &c, 0.0, &s).joins(), [false, true]);
    }

    /// The ways' wishes: frame, joint and how far from where the joint was.
    fn ways(edit: &Edit) -> Vec<(usize, Joint, Vec3)> {
        let own = |frame: usize, joint| edit.motion.postures[frame].pose().position(joint);
        edit.ways()
            .into_iter()
            .map(|(frame, term)| match term {
                Term::Point { joint, target, sigma, .. } => {
                    assert_eq!(sigma, Vec3::splat(WAY_SIGMA));
                    (frame, joint, target - own(frame, joint))
                }
                _ => panic!("a way is of points"),
            })
            .collect()
    }

    #[test]
    fn a_hand_goes_there_and_back_with_the_least_jerk() {
        let motion = still(60);
        let away = Vec3::Y * -0.3;
        let (c, s) = ([hand(30, &[near(away); 2])], settings());
        let edit = Edit::new(&motion, &c, 0.0, &s);
        let ways = ways(&edit);
        // 0.4 s there, from frame 18 (from where it was) to 30, and back from 31 to 43.
        let ease = |t: f32| t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
        let mut expected = Vec::new();
        expected.extend((19..30).map(|f| (f, 1.0 - ease((30 - f) as f32 / 12.0))));
        expected.extend((32..43).map(|f| (f, 1.0 - ease((f - 31) as f32 / 12.0))));
        assert_eq!(
            ways.iter().map(|w| w.0).collect::<Vec<_>>(),
            expected.iter().map(|e| e.0).collect::<Vec<_>>()
        );
        for ((_, joint, moved), (frame, share)) in ways.iter().zip(expected) {
            assert_eq!(*joint, Joint::LeftHand);
            assert!(moved.distance(away * share) < 1e-4, "{frame}: {moved} {share}");
        }
        assert_eq!((least_jerk(-1.0), least_jerk(0.5), least_jerk(2.0)), (0.0, 0.5, 1.0));
    }

    #[test]
    fn between_two_places_a_hand_does_not_go_back() {
        let motion = still(80);
        let (a, b) = (Vec3::Y * -0.3, Vec3::Y * -0.5);
        let s = settings();
        let both = |second: usize| [hand(30, &[near(a)]), hand(second, &[near(b)])];
        // 0.4 s and 0.6 s are 30 frames: within them it goes straight there.
        let c = both(50);
        let at = |c: &[Constraint], frame: usize| {
            let edit = Edit::new(&motion, c, 0.0, &s);
            ways(&edit).into_iter().filter(|w| w.0 == frame).map(|w| w.2.y).sum::<f32>()
        };
        close(at(&c, 40), -0.4, 1e-4);
        close(at(&c, 31), -0.3 - 0.2 * least_jerk(0.05), 1e-4);
        // Beyond it has the time to hang in between.
        let c = both(70);
        close(at(&c, 48), 0.0, 1e-4);
        close(at(&c, 36), -0.15, 1e-4);
        close(at(&c, 61), -0.25, 1e-4);
        // Where the two overlap what is left of both adds up; feet and wishes have no such way.
        let c = both(61);
        close(at(&c, 42), -0.5 * (1.0 - least_jerk(19.0 / 18.0)), 1e-4);
        close(
            at(&c, 44),
            -0.5 * (1.0 - least_jerk(17.0 / 18.0)) - 0.3 * (1.0 - least_jerk(14.0 / 12.0)),
            1e-4,
        );
        let foot = Constraint { joint: Joint::LeftFoot, ..hand(30, &[Vec3::ZERO]) };
        let wish = Constraint { soft: true, ..hand(30, &[near(a)]) };
        let c = [foot, wish];
        assert!(ways(&Edit::new(&motion, &c, 0.0, &s)).is_empty());
    }

    #[test]
    fn the_pelvis_has_a_way_of_its_own() {
        let motion = still(60);
        let place = motion.postures[0].root_position + Vec3::new(0.0, 0.3, 0.0);
        let (c, s) = ([Constraint::positions("Seat", Joint::Hips, 30, vec![place; 30])], settings());
        let mut edit = Edit::new(&motion, &c, 0.0, &s);
        edit.pelvis_way = vec![(28, place), (29, place)];
        let ways = ways(&edit);
        let frames: Vec<usize> = ways.iter().map(|w| w.0).collect();
        assert_eq!(frames[..2], [28, 29]);
        assert!(frames[2..].iter().all(|f| *f < 28) && frames.len() > 8, "{frames:?}");
        assert!(ways[0].2.distance(Vec3::Y * 0.3) < 1e-5);
    }

    #[test]
    fn a_hand_is_brought_to_its_place_and_all_else_stays() {
        let motion = still(50);
        let place = near(Vec3::new(0.05, -0.3, 0.35));
        let (c, s) = ([hand(20, &[place; 4])], settings());
        let edit = Edit::new(&motion, &c, 0.0, &s);
        edit.check_reach(&c, &Progress::new()).expect("within reach");
        let edited = edit.run(None::<&Manifold>, &Progress::new()).expect("not cancelled");
        let span = edit.span.clone();
        assert_eq!((edited.figures.first_frame, edited.figures.end_frame), (span.start, span.end));
        assert!(edited.figures.search.is_none());
        let figures = &edited.figures.constraints[0];
        assert!(figures.met && figures.max_cm.expect("a place") < 0.2, "{figures:?}");
        assert_eq!(edited.motion.postures[..span.start], motion.postures[..span.start]);
        assert_eq!(edited.motion.postures[span.end..], motion.postures[span.end..]);
        assert_eq!(edited.motion.contacts, motion.contacts);
        for (frame, posture) in edited.motion.postures.iter().enumerate() {
            let (pose, own) = (posture.pose(), motion.postures[frame].pose());
            for toe in Joint::TOES {
                assert!(pose.position(toe).distance(own.position(toe)) < 2e-3);
            }
            let hand = pose.position(Joint::LeftHand);
            if (20..24).contains(&frame) {
                assert!(hand.distance(place) < 2e-3, "{frame}: {}", hand.distance(place));
            }
            // Each rotation stays on the side that it was on.
            let before = &motion.postures[frame].rotations;
            assert!(posture.rotations.iter().zip(before).all(|(q, b)| q.dot(*b) >= 0.0));
        }
        // The way there is half done in its middle.
        let half = edited.motion.postures[20 - (20 - span.start) / 2].pose().position(Joint::LeftHand);
        let gone = half.distance(near(Vec3::ZERO)) / place.distance(near(Vec3::ZERO));
        assert!((0.3..0.7).contains(&gone), "{gone}");
    }

    #[test]
    fn what_is_out_of_reach_is_said_by_how_much_and_which_way() {
        let motion = still(50);
        let s = settings();
        let refused = |by: Vec3| {
            let c = [hand(20, &[near(by); 3])];
            let edit = Edit::new(&motion, &c, 0.0, &s);
            edit.check_reach(&c, &Progress::new())
                .map_err(|e| (e.to_string(), matches!(e, Error::Unreachable(_))))
        };
        assert!(refused(Vec3::new(0.0, -0.4, 0.3)).is_ok());
        let (said, unreachable) = refused(Vec3::new(0.0, -1.6, 0.4)).unwrap_err();
        assert!(
            unreachable && said.contains("‘Lid’") && said.contains("out of reach of the LeftHand"),
            "{said}"
        );
        assert!(said.contains("towards the character") && said.contains("frame 2"), "{said}");
        let (said, _) = refused(Vec3::new(1.8, 0.0, 0.6)).unwrap_err();
        assert!(said.contains("m to the character's right"), "{said}");
        let (said, _) = refused(Vec3::Z * 2.2).unwrap_err();
        assert!(said.contains("m down"), "{said}");
        // A wish may be missed, and a rotation has no place.
        let wish = [Constraint { soft: true, ..hand(20, &[near(Vec3::Y * -2.0)]) }];
        assert!(Edit::new(&motion, &wish, 0.0, &s).check_reach(&wish, &Progress::new()).is_ok());
        // Only the last of many frames is too far: the looks go from the first to the last.
        let path: Vec<Vec3> = (0..20).map(|i| near(Vec3::new(0.0, -0.08 * i as f32, 0.4))).collect();
        let c = [hand(20, &path)];
        let said = Edit::new(&motion, &c, 0.0, &s).check_reach(&c, &Progress::new()).unwrap_err().to_string();
        assert!(said.contains("on frame 39"), "{said}");
    }

    #[test]
    fn directions_are_the_characters() {
        assert_eq!(directions(0.0, 0.3, 0.0), "0.30 m away from the character");
        assert_eq!(
            directions(0.1, -0.3, 0.0),
            "0.30 m towards the character and 0.10 m to the character's left"
        );
        assert_eq!(directions(-0.2, 0.0, -0.4), "0.40 m down and 0.20 m to the character's right");
        // What is less than a quarter of the longest, or than a centimetre, is not worth a word.
        assert_eq!(directions(0.07, 0.3, 0.08), "0.30 m away from the character and 0.08 m up");
        assert_eq!(directions(0.005, 0.0, 0.02), "0.02 m up");
    }

    fn count(terms: &[Term], wanted: impl Fn(&Term) -> bool) -> usize {
        terms.iter().filter(|t| wanted(t)).count()
    }

    #[test]
    fn a_frame_is_asked_for_what_its_posture_needs() {
        let mut motion = still(40);
        let seated = person(crate::math::Planar::default(), SITS_AT, 0.3);
        motion.postures[30..].fill(seated);
        motion.contacts[10] = [1.0, 0.5];
        let s = settings();
        let terms = |c: &[Constraint], frame: usize| Edit::new(&motion, c, 0.0, &s).terms(frame);
        let root = |terms: &[Term]| {
            terms.iter().find_map(|t| match t {
                Term::Point { joint: Joint::Hips, sigma, .. } => Some(*sigma),
                _ => None,
            })
        };
        let balance = |terms: &[Term]| {
            terms.iter().find_map(|t| match t {
                Term::Balance { most, .. } => Some(*most),
                _ => None,
            })
        };
        let (stands, sits) = (terms(&[], 0), terms(&[], 35));
        assert_eq!(root(&stands), Some(Vec3::new(0.05, 0.05, 0.06)));
        assert_eq!(root(&sits), Some(Vec3::splat(2e-3)));
        assert_eq!(
            (balance(&stands), balance(&sits), balance(&terms(&[], 10))),
            (Some(BALANCE), None, Some(f32::INFINITY))
        );
        // Hands of who sits rest in place, arms of who stands hang; the head stays upright.
        let rests =
            |t: &[Term], hand: Joint| count(t, |t| matches!(t, Term::Point { joint, .. } if *joint == hand));
        let hangs =
            |t: &[Term], of: Joint| count(t, |t| matches!(t, Term::Turn { joint, .. } if *joint == of));
        assert_eq!((rests(&stands, Joint::LeftHand), rests(&sits, Joint::LeftHand)), (0, 1));
        assert_eq!((hangs(&stands, Joint::LeftArm), hangs(&sits, Joint::LeftArm)), (1, 0));
        assert_eq!((hangs(&stands, Joint::Head), hangs(&stands, Joint::RightArm)), (1, 1));
        // What is asked for is free of that, on its frames and on others.
        let c = [hand(20, &[Vec3::ONE]), Constraint { joint: Joint::Neck, ..hand(20, &[Vec3::ONE]) }];
        let asked = terms(&c, 0);
        assert_eq!(
            (hangs(&asked, Joint::LeftArm), hangs(&asked, Joint::Head), hangs(&asked, Joint::RightArm)),
            (0, 0, 1)
        );
        assert_eq!((rests(&asked, Joint::LeftHand), rests(&terms(&c, 20), Joint::LeftHand)), (0, 1));
        // A pelvis that is asked to be somewhere is held by that alone, and needs no balance.
        let c = [Constraint {
            facings: vec![0.7],
            rotations: vec![Quat::IDENTITY],
            ..Constraint::positions("Seat", Joint::Hips, 5, vec![Vec3::ONE])
        }];
        let pelvis = terms(&c, 5);
        assert_eq!((root(&pelvis), balance(&pelvis)), (Some(Vec3::splat(0.25)), None));
        let hard = |t: &Term| matches!(t, Term::Point { sigma, target, .. } if *target == Vec3::ONE && sigma.x == DEMAND_SIGMA.0);
        assert_eq!(count(&pelvis, hard), 1);
        assert_eq!(
            count(
                &pelvis,
                |t| matches!(t, Term::Facing { yaw, sigma } if *yaw == 0.7 && *sigma == DEMAND_SIGMA.1)
            ),
            1
        );
        let soft = [Constraint { soft: true, ..c[0].clone() }];
        let wish = |t: &Term| matches!(t, Term::Point { sigma, target, .. } if *target == Vec3::ONE && sigma.x == WISH_SIGMA.0);
        assert_eq!(count(&terms(&soft, 5), wish), 1);
        // A key's own rotation, on its frame alone.
        let exact = [(7, Joint::Head, Quat::from_rotation_x(0.2))];
        let mut edit = Edit::new(&motion, &[], 0.0, &s);
        edit.exact = &exact;
        let local = |t: &Term| matches!(t, Term::Local { joint: Joint::Head, .. });
        assert_eq!((count(&edit.terms(7), local), count(&edit.terms(8), local)), (1, 0));
    }

    #[test]
    fn what_is_left_of_a_constraint_by_hand() {
        let motion = still(10);
        let pose = motion.postures[0].pose();
        let place = pose.position(Joint::LeftHand);
        let figures = |c: Constraint| constraint_figures(&c, &motion);
        let f = figures(hand(2, &[place + Vec3::X * 0.004, place + Vec3::Z * 0.008]));
        close(f.mean_cm.expect("places"), 0.6, 1e-3);
        close(f.max_cm.expect("places"), 0.8, 1e-3);
        assert_eq!((f.mean_degrees, f.max_degrees, f.met, f.frames), (None, None, true, 2));
        assert_eq!((f.name.as_str(), f.joint.as_str()), ("Lid", "LeftHand"));
        assert!(!figures(hand(2, &[place + Vec3::X * 0.011])).met);
        let turned = |angle: f32| Constraint {
            rotations: vec![Quat::from_rotation_z(angle) * pose.rotation(Joint::LeftHand)],
            ..hand(2, &[])
        };
        let f = figures(turned(0.05));
        close(f.max_degrees.expect("turned"), 0.05f32.to_degrees(), 1e-2);
        assert_eq!((f.mean_cm, f.met), (None, true));
        assert!(!figures(turned(0.06)).met);
        let facing = Constraint { joint: Joint::Hips, facings: vec![-0.2, 6.2], ..hand(2, &[]) };
        let f = figures(facing);
        close(f.mean_degrees.expect("facing"), (0.2 + std::f32::consts::TAU - 6.2).to_degrees() / 2.0, 1e-2);
        // Frames that the motion does not have count for nothing.
        assert_eq!(figures(hand(9, &[place, Vec3::ONE])).max_cm.map(|m| m < 1e-3), Some(true));
        // Who faces 0.3 to the left and is asked for 0.1 lacks 0.2.
        let mut turned_left = still(3);
        turned_left.postures[2].rotations[0] = Quat::from_rotation_z(0.3);
        let asked = Constraint { joint: Joint::Hips, facings: vec![0.1], ..hand(2, &[]) };
        let f = constraint_figures(&asked, &turned_left);
        close(f.max_degrees.expect("a facing"), 0.2f32.to_degrees(), 1e-2);
    }

    #[test]
    fn two_edits_are_one() {
        let one = |first: usize, end: usize| EditFigures {
            constraints: vec![constraint_figures(&hand(2, &[Vec3::ONE]), &still(5))],
            first_frame: first,
            end_frame: end,
            search: None,
            seconds: 1.0,
        };
        let mut both = EditFigures::default();
        both.join(one(20, 30));
        assert_eq!((both.first_frame, both.end_frame, both.seconds), (20, 30, 1.0));
        let searched = Some(SearchFigures { steps: 3, ..Default::default() });
        both.join(EditFigures { search: searched.clone(), ..one(10, 25) });
        assert_eq!((both.first_frame, both.end_frame, both.constraints.len()), (10, 30, 2));
        both.join(one(15, 60));
        assert_eq!((both.first_frame, both.end_frame, both.seconds), (10, 60, 3.0));
        assert_eq!(both.search, searched);
    }

    #[test]
    fn a_foot_that_leaves_its_place_is_in_the_air_meanwhile() {
        let motion = still(60);
        let place = motion.postures[0].pose().position(Joint::LeftFoot) + Vec3::new(0.1, -0.1, 0.0);
        let (c, s) = ([Constraint::positions("Foot", Joint::LeftFoot, 30, vec![place; 3])], settings());
        let edited = Edit::new(&motion, &c, 0.0, &s).run(None::<&Manifold>, &Progress::new()).expect("done");
        assert!(edited.figures.constraints[0].met);
        let air: Vec<usize> = (0..60).filter(|f| edited.motion.contacts[*f][0] == 0.0).collect();
        assert!(!air.is_empty() && air.iter().all(|f| !(30..33).contains(f)), "{air:?}");
        assert!(air.contains(&29) && air.contains(&33) && !air.contains(&10));
        assert!((0..60).all(|f| edited.motion.contacts[f][1] == 1.0));
        assert!(is_foot(Joint::LeftToe) && is_foot(Joint::RightLeg) && !is_foot(Joint::LeftUpLeg));
        assert_eq!(edited.motion.postures.len(), 60);
        assert_eq!(Vec2::ZERO, motion.postures[0].root_position.truncate());
        assert_eq!(edited.motion.postures[0].rotations.len(), JOINT_COUNT);
    }

    #[test]
    fn the_search_knows_nothing_of_the_floors_height_and_fades_out() {
        use crate::editor::latent::tests::Linear;
        let decoder = Linear::new(200, 3);
        let s = EditorSettings { manifold: true, steps: 12, learning_rate: 0.02, ..settings() };
        let searched = |floor: f32| {
            let mut motion = still(60);
            motion.postures.iter_mut().for_each(|p| p.root_position.z += floor);
            let c = [
                hand(20, &[near(Vec3::new(-0.05, -0.1, 0.05 + floor)); 4]),
                Constraint { joint: Joint::Hips, facings: vec![0.02; 4], ..hand(20, &[]) },
            ];
            let edit = Edit::new(&motion, &c, floor, &s);
            let (found, figures) = edit.search(&decoder, &Progress::new()).expect("found");
            let (span, postures) = (edit.span.clone(), found.postures);
            assert_eq!(postures[..span.start], motion.postures[..span.start]);
            assert_eq!(postures[span.end..], motion.postures[span.end..]);
            // At the joined ends of the span hardly anything of it shows.
            let off = |f: usize| postures[f].root_position.distance(motion.postures[f].root_position);
            assert!(off(span.start) <= 0.1 * off(21) + 1e-6, "{} {}", off(span.start), off(21));
            (postures, figures, edit.run(Some(&decoder), &Progress::new()).expect("done"))
        };
        let (low, figures, edited) = searched(0.0);
        assert!(figures.steps > 0 && figures.after_cm != figures.before_cm, "{figures:?}");
        assert_eq!(edited.figures.search.as_ref(), Some(&figures));
        assert!(edited.figures.constraints.iter().all(|c| c.met), "{:?}", edited.figures.constraints);
        let (high, _, _) = searched(0.5);
        for (a, b) in low.iter().zip(&high) {
            assert!((a.root_position + Vec3::Z * 0.5).distance(b.root_position) < 2e-3);
        }
        // Without the settings' leave it is not asked.
        let motion = still(60);
        let (c, off) = ([hand(20, &[near(Vec3::Y * -0.2)])], settings());
        let edited = Edit::new(&motion, &c, 0.0, &off).run(Some(&decoder), &Progress::new()).expect("done");
        assert!(edited.figures.search.is_none());
    }
}
