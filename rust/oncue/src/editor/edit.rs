//! E(M): constraints in, the edited motion and what is left of them out (LAMA, section 3.6).

use std::ops::Range;
use std::time::Instant;

use glam::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::constraint::Constraint;
use super::foot_following::follow;
use super::latent::{Decoder, Search, SearchFigures, Target, mix, search};
use crate::body_solver::{
    DegreesOfFreedom, FADE_FRAMES, FootPlan, Span, Surfaces, Term, centre_of_mass, correct, is_supported,
};
use crate::error::{Error, Result};
use crate::library::foot::LEGS;
use crate::math::curve::smoothstep;
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
            surfaces: self.surfaces,
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
                surfaces: self.surfaces,
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
pub(super) fn whole_span(
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
pub(super) fn reach_frames(distance: f32, settings: &EditorSettings) -> usize {
    let seconds =
        (settings.reach_seconds + settings.reach_seconds_per_metre * distance).max(settings.blend_seconds);
    (seconds * FRAME_RATE).round() as usize
}

fn is_foot(joint: Joint) -> bool {
    LEGS.iter().any(|leg| leg[1..].contains(&joint))
}

/// From 0 to 1 with the least jerk.
fn least_jerk(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
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
