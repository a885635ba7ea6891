//! The seat fit: pelvis at q_root and r_root, feet on their cues or flat on the floor, thighs on the seat and not in it,
//! the back before the backrest (LAMA, sections 3.6 and 4.3).
//!
//! A foot that has to stand elsewhere does so from its last step on, as far as the leg reaches from the standing body;
//! what is left is a small step of the seated person. The paper leaves the feet out of its edit and misses them by
//! 20 to 40 cm.

use glam::{Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::constraint::{Constraint, check_numbers};
use super::edit::{Edit, EditFigures, EditedMotion};
use super::latent::Decoder;
use crate::body_solver::{FootPlan, FoundTerms, Span, Surfaces, correct};
use crate::cue::ActionCue;
use crate::error::{Error, Result};
use crate::library::foot::LEGS;
use crate::math::curve::{least_jerk, smoothstep};
use crate::math::rotation::{to_angle_axis, wrap_angle, yaw};
use crate::motion::skeleton::{ANKLE_HEIGHT, JOINT_OFFSET, LEG_LENGTH, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, Joint, Motion, Pose};
use crate::progress::Progress;
use crate::scene::SceneIndex;
use crate::settings::EditorSettings;

/// A pelvis farther from its cue than this is not fitted, metres.
const FARTHEST_PELVIS: f32 = 0.55;
/// Longest a leg gets, as a share of its length.
const LEG_SHARE: f32 = 0.985;
/// A foot that stands this near its place is not moved, metres.
const STANDS: f32 = 0.004;
/// No one takes longer to sit down, frames.
const LONGEST_DESCENT: usize = 75;
/// A swing shorter than this carries no foot elsewhere, frames.
const SHORTEST_SWING_FRAMES: usize = 8;
/// Seconds of a seated step, and between the two feet's.
const STEP_SECONDS: f32 = 0.6;
const STEP_APART: f32 = 0.35;
/// How high a seated step lifts the foot, metres, and for each metre of its way.
const SEATED_STEP_LIFT: (f32, f32) = (0.02, 0.10);

/// A foot whose toes are this far over the floor on the last frame hangs, metres.
const OFF_THE_FLOOR: f32 = 0.04;

/// Deeper no thigh is pressed into a seat for the sake of where the feet stand, cm.
const DEEPEST_THIGH: f32 = 2.0;

/// A pelvis so near to where it stays is there, metres.
const AT_REST: f32 = 0.005;

/// How a seated person sits, on the motion's last frame unless said otherwise.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SeatFigures {
    /// Pelvis joint to q_root, cm, and facing to r_root, degrees: the worst of the seated frames.
    pub pelvis_cm: f32,
    /// The facing away from the cue's, degrees.
    pub facing_degrees: f32,
    /// Ankle to each given foot cue, cm.
    pub feet_cm: [Option<f32>; 2],
    /// How far each sole is from flat, degrees.
    pub sole_degrees: [f32; 2],
    /// The feet hang: the seat is too high for them to stand.
    pub hanging: [bool; 2],
    /// Deepest that a thigh is in the seat and the back in the backrest, cm, of the seated frames.
    pub thigh_cm: f32,
    /// Deepest that the back is in the backrest, cm.
    pub back_cm: f32,
}

/// A fitted motion.
#[derive(Debug, Clone, PartialEq)]
pub struct SeatFit {
    /// The motion that sits on its seat.
    pub motion: Motion,
    /// What the edit did.
    pub figures: EditFigures,
    /// How the person sits.
    pub seat: SeatFigures,
}

/// A sit to be fitted.
pub struct Seat<'a> {
    /// Walks and sits down.
    pub motion: &'a Motion,
    /// The sit cue.
    pub cue: &'a ActionCue,
    /// The frame at which the person is seated.
    pub complete: usize,
    /// W, which thighs and back are kept out of.
    pub scene: Option<&'a SceneIndex>,
    /// World height of the floor, metres.
    pub floor: f32,
    /// The editor's constants.
    pub settings: &'a EditorSettings,
}

/// The frame from which on the body rests, of a motion that is complete at frame `complete`: there, or where the pelvis of who
/// sits came to its place.
pub(crate) fn rests_from(motion: &Motion, complete: usize, sits: bool) -> usize {
    let place = |frame: usize| motion.postures[frame].root_position;
    let stays = |frame: &usize| place(*frame).distance(place(complete)) < AT_REST;
    if sits { (0..=complete).rev().take_while(stays).last().unwrap_or(complete) } else { complete }
}

impl Seat<'_> {
    /// Fits the motion to the seat.
    ///
    /// # Errors
    /// `Unreachable` where a foot cue or the pelvis's place is out of reach, by how much and which way, and where foot cues
    /// ask for thighs that pass through the seat; `Cancelled`.
    pub fn fit<D: Decoder>(&self, decoder: Option<&D>, progress: &Progress) -> Result<SeatFit> {
        progress.stage("Fitting the seat");
        self.check()?;
        let mut motion = self.motion.clone();
        let settled = self.settle(&motion, progress)?;
        let (plan, contacts) = self.plan_feet(&mut motion, &settled);
        motion.contacts = contacts;
        let mut constraints = vec![self.pelvis(motion.len())];
        for (side, cue) in self.cue.feet.iter().enumerate() {
            let Some(foot) = cue.filter(|_| !settled.hangs[side]) else { continue };
            let last = motion.len() - 1;
            let name = format!("{}: {} foot", self.cue.name, ["left", "right"][side]);
            let ankle = foot + Vec3::Z * ANKLE_HEIGHT;
            constraints.push(Constraint::positions(&name, Joint::FEET[side], last, vec![ankle]));
        }
        let mut edit = Edit::new(&motion, &constraints, self.floor, self.settings);
        // Feet that stand elsewhere do so from their last step on.
        let moved = (0..motion.len())
            .find(|&f| (0..2).any(|s| plan.feet[f][s].ankle.distance(edit.feet.feet[f][s].ankle) > STANDS));
        let lead = (self.settings.blend_seconds * FRAME_RATE) as usize / 2;
        edit.span.start = edit.span.start.min(moved.map_or(usize::MAX, |f| f.saturating_sub(lead)));
        edit.feet = plan;
        edit.pelvis_way = self.descent();
        let begins = edit.pelvis_way.first().map_or(usize::MAX, |w| w.0.saturating_sub(lead));
        edit.span.start = edit.span.start.min(begins);
        edit.surfaces = self.surfaces();
        edit.check_reach(&constraints, progress)?;
        let EditedMotion { motion, figures } = edit.run(decoder, progress)?;
        let seat = self.figures(&motion, settled.hangs);
        if seat.thigh_cm > DEEPEST_THIGH && self.cue.feet.iter().any(Option::is_some) {
            return Err(Error::Unreachable(format!(
                "‘{}’ and its foot cues contradict each other: with the feet there the thighs would be {:.0} cm inside the seat. \
                 Move the feet nearer to the seat's front edge, or take their cues away.",
                self.cue.name, seat.thigh_cm
            )));
        }
        Ok(SeatFit { motion, figures, seat })
    }

    fn check(&self) -> Result<()> {
        self.settings.validate()?;
        check_numbers(self.motion, self.floor)?;
        let seated = self.motion.postures.get(self.complete).ok_or_else(|| {
            Error::input(format!("The motion ends before anyone sits at ‘{}’.", self.cue.name))
        })?;
        let away = seated.root_position.distance(self.cue.position);
        if away > FARTHEST_PELVIS {
            return Err(Error::Unreachable(format!(
                "The motion sits down {away:.2} m from ‘{}’; at most {FARTHEST_PELVIS:.2} m can be fitted. Synthesize it anew.",
                self.cue.name
            )));
        }
        Ok(())
    }

    /// Pelvis at q_root, facing as r_root, from the moment the person is seated.
    fn pelvis(&self, frames: usize) -> Constraint {
        let count = frames.saturating_sub(self.complete).max(1);
        Constraint {
            facings: vec![self.cue.yaw; count],
            ..Constraint::positions(
                &self.cue.name,
                Joint::Hips,
                self.complete,
                vec![self.cue.position; count],
            )
        }
    }

    /// The pelvis's way down: as it sinks it comes by as much nearer to q_root, so that nobody sits down in the air first.
    fn descent(&self) -> Vec<(usize, Vec3)> {
        let root = |frame: usize| self.motion.postures[frame].root_position;
        let seated = root(self.complete);
        let away = self.cue.position - seated;
        if away.length() < STANDS {
            return Vec::new();
        }
        let window = self.complete.saturating_sub(LONGEST_DESCENT)..self.complete;
        let top = window.clone().map(|f| root(f).z).fold(seated.z, f32::max);
        if top - seated.z < 0.1 {
            return Vec::new();
        }
        let first = window.rev().find(|&f| root(f).z > top - 0.01).unwrap_or(self.complete);
        (first..self.complete)
            .map(|frame| {
                let sunk = ((top - root(frame).z) / (top - seated.z)).clamp(0.0, 1.0);
                (frame, root(frame) + away * sunk)
            })
            .collect()
    }

    /// Where the feet of the seated person end up.
    fn settle(&self, motion: &Motion, progress: &Progress) -> Result<Settled> {
        let last = motion.len() - 1;
        let seated = FootPlan::of(motion).feet[last];
        let pelvis_moves = self.cue.position - motion.postures[last].root_position;
        let hang_already = [0, 1].map(|side| {
            let over = seated[side].toe.z + pelvis_moves.z - self.floor - TOE_HEIGHT;
            self.cue.feet[side].is_none() && !seated[side].planted && over > OFF_THE_FLOOR
        });
        let mut feet = [0, 1].map(|side| {
            let foot = &seated[side];
            if hang_already[side] {
                return Place { ankle: foot.ankle + pelvis_moves, turn: foot.turn };
            }
            let turn = Quat::from_rotation_z(yaw(foot.turn));
            let ankle = match self.cue.feet[side] {
                Some(place) => place + Vec3::Z * ANKLE_HEIGHT,
                None => {
                    // Flat about its own toes.
                    let toe = Vec3::new(foot.toe.x, foot.toe.y, self.floor + ANKLE_HEIGHT);
                    toe - (turn * JOINT_OFFSET[LEGS[side][3].index()]).with_z(0.0)
                }
            };
            Place { ankle, turn }
        });
        // Does the leg get there with the thigh on the seat? Tried on the last frame alone.
        let pelvis = [self.pelvis(motion.len())];
        let mut edit = Edit::new(motion, &pelvis, self.floor, self.settings);
        for (foot, place) in edit.feet.feet[last].iter_mut().zip(&feet) {
            foot.ankle = place.ankle;
            foot.turn = place.turn;
            foot.toe_turn = place.turn;
            foot.planted = false;
            foot.sigma = 1e-3;
        }
        let postures = [motion.postures[last]];
        let terms = [edit.terms(last)];
        let degrees = edit.degrees();
        let surfaces = self.surfaces();
        let span = Span {
            postures: &postures,
            joins: [false; 2],
            degrees: &degrees,
            terms: &terms,
            found: surfaces.as_ref().map(|s| s as &dyn FoundTerms),
            spread: 0.0,
        };
        let pose = correct(&span, progress)?[0].pose();
        let hangs = [0, 1].map(|side| {
            if hang_already[side] {
                return true;
            }
            let missed = pose.position(LEGS[side][2]).distance(feet[side].ankle) > 0.01;
            let sunk = self.surfaces().is_some_and(|s| s.thigh_depth(&pose, side) > 0.015);
            self.cue.feet[side].is_none() && (missed || sunk)
        });
        for side in 0..2 {
            if hangs[side] && !hang_already[side] {
                // As near the floor as the thigh on the seat lets it come.
                let hip = pose.position(LEGS[side][0]);
                let ahead = self.cue.planar().forward().extend(0.0);
                let knee = hip + ahead * (0.95 * LEG_LENGTH);
                feet[side].ankle = knee - Vec3::Z * (0.97 * LEG_LENGTH) + ahead * 0.05;
                feet[side].ankle.z = feet[side].ankle.z.max(self.floor + ANKLE_HEIGHT);
            }
        }
        Ok(Settled { feet, hangs, hang_already })
    }

    /// The feet of every frame; the motion is lengthened where a seated step needs the time.
    fn plan_feet(&self, motion: &mut Motion, settled: &Settled) -> (FootPlan, Vec<[f32; 2]>) {
        let mut left = [Vec2::ZERO; 2];
        let mut plan = FootPlan::of(motion);
        for side in 0..2 {
            let place = &settled.feet[side];
            let seated = plan.feet[motion.len() - 1][side];
            let shift = (place.ankle - seated.ankle).truncate();
            if settled.hangs[side] || shift.length() < STANDS {
                continue;
            }
            let share = self.share_before_sitting(motion, &plan, side, shift);
            left[side] = shift * (1.0 - share);
            self.shift_last_plant(&mut plan, side, shift * share);
        }
        let mut contacts = motion.contacts.clone();
        // The rest is a step of the seated person, the foot with the longer way first.
        let order = if left[0].length() >= left[1].length() { [0, 1] } else { [1, 0] };
        let steps = (STEP_SECONDS * FRAME_RATE) as usize;
        let mut next = self.complete + 2;
        for side in order {
            let last = plan.feet.len() - 1;
            let from = plan.feet[last][side];
            let place = &settled.feet[side];
            let lifts = place.ankle.truncate().distance(from.ankle.truncate()) > 0.02 || settled.hangs[side];
            // Feet that will hang leave the floor while the seat takes the weight.
            let begin = if settled.hangs[side] {
                self.leaves_floor(&plan, side, steps)
            } else {
                // A foot that is in the air by itself lands first.
                (next..plan.feet.len()).find(|&frame| plan.feet[frame][side].planted).unwrap_or(next)
            };
            let end = begin + steps;
            while plan.feet.len() < end + 4 {
                hold(motion, &mut plan, &mut contacts);
            }
            let reached = place.ankle.distance(from.ankle);
            let height = if lifts { SEATED_STEP_LIFT.0 + SEATED_STEP_LIFT.1 * reached } else { 0.0 };
            let toe = JOINT_OFFSET[LEGS[side][3].index()];
            let first = plan.feet[begin][side];
            for frame in begin..plan.feet.len() {
                let t = ((frame - begin) as f32 / steps as f32).clamp(0.0, 1.0);
                let eased = least_jerk(t);
                let foot = &mut plan.feet[frame][side];
                if settled.hang_already[side] {
                    let moved = (place.ankle - from.ankle) * eased;
                    foot.ankle += moved;
                    foot.toe += moved;
                    foot.sigma = 0.05;
                    continue;
                }
                let arc = height * 16.0 * t * t * (1.0 - t) * (1.0 - t);
                foot.ankle = first.ankle.lerp(place.ankle, eased) + Vec3::Z * arc;
                foot.turn = first.turn.slerp(same_side(first.turn, place.turn), eased);
                foot.toe_turn = first.toe_turn.slerp(same_side(first.toe_turn, place.turn), eased);
                foot.toe = foot.ankle + foot.turn * toe;
                foot.sigma = if settled.hangs[side] { 0.05 } else { 1e-3 };
                let stands = (t == 0.0 || t == 1.0) && !settled.hangs[side];
                foot.planted = stands || (!lifts && !settled.hangs[side]);
                if lifts {
                    contacts[frame][side] = if stands { 1.0 } else { 0.0 };
                }
            }
            if lifts && !settled.hangs[side] {
                next += (STEP_APART * FRAME_RATE) as usize;
            }
        }
        (plan, contacts)
    }

    /// The frame on which a foot that is to hang leaves the floor: while the seat takes the weight, and before the leg gets
    /// too short for it.
    fn leaves_floor(&self, plan: &FootPlan, side: usize, steps: usize) -> usize {
        let too_short = self.descent().into_iter().find(|&(frame, root)| {
            let posture = &self.motion.postures[frame];
            let hip = posture.pose().position(LEGS[side][0]) + root - posture.root_position;
            hip.distance(plan.feet[frame][side].ankle) > 2.0 * LEG_LENGTH * 0.95
        });
        let seated = self.complete.saturating_sub(steps * 2 / 3);
        too_short.map_or(seated, |(frame, _)| seated.min(frame.saturating_sub(3)))
    }

    /// How much of a foot's shift its last plant takes: as much as the leg reaches while the body still stands.
    fn share_before_sitting(&self, motion: &Motion, plan: &FootPlan, side: usize, shift: Vec2) -> f32 {
        let Some(swing) = plan.last_swing(side, self.complete) else { return 0.0 };
        let stands = swing.end..self.complete;
        if stands.is_empty() || swing.start == 0 || swing.len() < SHORTEST_SWING_FRAMES {
            return 0.0;
        }
        let longest = 2.0 * LEG_LENGTH * LEG_SHARE;
        let reaches = |share: f32| {
            stands.clone().all(|frame| {
                let hip = motion.postures[frame].pose().position(LEGS[side][0]);
                let foot = &plan.feet[frame][side];
                let own = hip.distance(foot.ankle);
                let ankle = foot.ankle + (shift * share).extend(0.0);
                hip.distance(ankle) <= longest.max(own)
                    && self.is_free(motion, frame, side, ankle - foot.ankle)
            })
        };
        [1.0, 0.75, 0.5, 0.25].into_iter().find(|&share| reaches(share)).unwrap_or(0.0)
    }

    /// Whether the foot and shin, moved by `shift`, cross nothing that they did not cross before.
    fn is_free(&self, motion: &Motion, frame: usize, side: usize, shift: Vec3) -> bool {
        let Some(scene) = self.scene else { return true };
        let pose = motion.postures[frame].pose();
        let above = self.floor + 0.05;
        let mut moved = pose;
        for joint in [LEGS[side][1], LEGS[side][2], LEGS[side][3]] {
            let share = if joint == LEGS[side][1] { 0.5 } else { 1.0 };
            moved.positions[joint.index()] += shift * share;
        }
        // Shin and foot, in the order of the box nodes.
        let legs = |pose: &Pose| -> u32 {
            let counts = scene.body_intersections(pose, above);
            counts[2 * side + 1] + counts[8 + side]
        };
        legs(&moved) <= legs(&pose)
    }

    /// From the last swing on a foot stands `shift` from where it stood.
    fn shift_last_plant(&self, plan: &mut FootPlan, side: usize, shift: Vec2) {
        let Some(swing) = plan.last_swing(side, self.complete) else { return };
        for frame in swing.start..plan.feet.len() {
            let t = (frame + 1 - swing.start) as f32 / (swing.len() + 1) as f32;
            let moved = (shift * smoothstep(t)).extend(0.0);
            let foot = &mut plan.feet[frame][side];
            foot.ankle += moved;
            foot.toe += moved;
            foot.sigma = foot.sigma.min(0.01);
        }
    }

    fn surfaces(&self) -> Option<Surfaces<'_>> {
        self.scene.map(|scene| Surfaces { scene, floor: self.floor })
    }

    /// How the person sits in `motion`.
    pub fn figures(&self, motion: &Motion, hanging: [bool; 2]) -> SeatFigures {
        let mut out = SeatFigures { hanging, ..Default::default() };
        let Some(last) = motion.postures.last() else { return out };
        for posture in motion.postures.iter().skip(self.complete) {
            let pose = posture.pose();
            out.pelvis_cm = out.pelvis_cm.max(100.0 * posture.root_position.distance(self.cue.position));
            let facing = wrap_angle(posture.planar().yaw - self.cue.yaw).abs();
            out.facing_degrees = out.facing_degrees.max(facing.to_degrees());
            if let Some(surfaces) = self.surfaces() {
                let thigh = surfaces.thigh_depth(&pose, 0).max(surfaces.thigh_depth(&pose, 1));
                out.thigh_cm = out.thigh_cm.max(100.0 * thigh);
                out.back_cm = out.back_cm.max(100.0 * surfaces.back_depth(&pose));
            }
        }
        let pose = last.pose();
        for side in 0..2 {
            let foot = LEGS[side][2];
            let ankle = pose.position(foot);
            out.feet_cm[side] =
                self.cue.feet[side].map(|f| 100.0 * (f + Vec3::Z * ANKLE_HEIGHT).distance(ankle));
            let turn = pose.rotation(foot);
            let tilt = Quat::from_rotation_z(-yaw(turn)) * turn;
            out.sole_degrees[side] = to_angle_axis(tilt).length().to_degrees();
        }
        out
    }
}

struct Settled {
    feet: [Place; 2],
    hangs: [bool; 2],
    /// They hang in the motion as it is, and move with the pelvis.
    hang_already: [bool; 2],
}

struct Place {
    ankle: Vec3,
    turn: Quat,
}

/// One more frame like the last.
fn hold(motion: &mut Motion, plan: &mut FootPlan, contacts: &mut Vec<[f32; 2]>) {
    let last = motion.len() - 1;
    motion.postures.push(motion.postures[last]);
    motion.contacts.push(motion.contacts[last]);
    plan.feet.push(plan.feet[last]);
    contacts.push(contacts[last]);
}

fn same_side(a: Quat, b: Quat) -> Quat {
    if a.dot(b) < 0.0 { -b } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::Manifold;
    use crate::math::Planar;
    use crate::motion::Posture;
    use crate::test_world::{SITS_AT, SITS_BACK, STANDS, close, library, person, room, sit_cue};

    /// The library's sit, complete at frame 50 of 60.
    fn motion() -> Motion {
        let mut motion = library().clips.remove(5).motion;
        motion.postures.truncate(60);
        motion.contacts.truncate(60);
        motion
    }

    fn settings() -> EditorSettings {
        EditorSettings { manifold: false, ..Default::default() }
    }

    fn seat<'a>(motion: &'a Motion, cue: &'a ActionCue, settings: &'a EditorSettings) -> Seat<'a> {
        Seat { motion, cue, complete: 50, scene: None, floor: 0.0, settings }
    }

    #[test]
    fn a_seat_that_fits_stays_and_one_that_is_near_is_met() {
        let (motion, s) = (motion(), settings());
        for shift in [Vec3::ZERO, Vec3::new(0.06, 0.04, -0.03)] {
            let mut cue = sit_cue();
            cue.position += shift;
            cue.yaw = if shift == Vec3::ZERO { 0.0 } else { 0.1 };
            let fit = seat(&motion, &cue, &s).fit(None::<&Manifold>, &Progress::new()).expect("fits");
            assert!(fit.seat.pelvis_cm < 0.5 && fit.seat.facing_degrees < 1.0, "{:?}", fit.seat);
            assert!(fit.seat.sole_degrees.iter().all(|d| *d < 2.0), "{:?}", fit.seat);
            assert_eq!((fit.seat.hanging, fit.seat.feet_cm), ([false; 2], [None; 2]));
            for posture in &fit.motion.postures[50..] {
                assert!(posture.root_position.distance(cue.position) < 5e-3);
            }
            assert_eq!(fit.motion.postures[0], motion.postures[0]);
            // The feet stand where they stood all along.
            for (frame, posture) in fit.motion.postures.iter().enumerate().take(60) {
                for toe in Joint::TOES {
                    let own = motion.postures[frame].pose().position(toe);
                    assert!(posture.pose().position(toe).distance(own) < 6e-3, "{frame}");
                }
            }
        }
    }

    #[test]
    fn feet_come_to_their_cues_by_a_seated_step() {
        let (motion, s) = (motion(), settings());
        let mut cue = sit_cue();
        let own = |side: usize| motion.postures[59].pose().position(Joint::FEET[side]).with_z(0.0);
        cue.feet = [Some(own(0) + Vec3::new(0.06, -0.08, 0.0)), Some(own(1))];
        let fit = seat(&motion, &cue, &s).fit(None::<&Manifold>, &Progress::new()).expect("fits");
        assert!(fit.seat.feet_cm.iter().all(|f| f.is_some_and(|cm| cm < 0.7)), "{:?}", fit.seat);
        // Two frames after it is complete one foot begins, 0.35 s later the other; each takes 0.6 s. The first is lifted
        // by 2 cm and a tenth of its 10 cm.
        assert_eq!(fit.motion.len(), 52 + 10 + 18 + 4);
        let ankle = |frame: usize, side: usize| fit.motion.postures[frame].pose().position(Joint::FEET[side]);
        close(ankle(61, 0).z, ANKLE_HEIGHT + 0.03, 5e-3);
        close(ankle(61, 0).y - own(0).y, -0.04, 6e-3);
        assert!((53..70).all(|f| fit.motion.contacts[f][0] == 0.0 && fit.motion.contacts[f][1] == 1.0));
        assert_eq!(fit.motion.contacts[72], [1.0, 1.0]);
        assert!(
            ankle(52, 0).with_z(0.0).distance(own(0)) < 5e-3
                && ankle(61, 1).with_z(0.0).distance(own(1)) < 5e-3
        );
        // Out of reach.
        cue.feet = [Some(own(0) + Vec3::new(0.0, -0.9, 0.0)), None];
        let error = seat(&motion, &cue, &s).fit(None::<&Manifold>, &Progress::new()).unwrap_err();
        assert!(matches!(error, Error::Unreachable(_)) && error.to_string().contains("left foot"), "{error}");
    }

    #[test]
    fn what_is_too_far_away_or_never_seated_is_refused() {
        let (motion, s) = (motion(), settings());
        let mut cue = sit_cue();
        cue.position.y += 0.53;
        assert!(seat(&motion, &cue, &s).check().is_ok());
        cue.position.y += 0.04;
        let said = seat(&motion, &cue, &s).check().unwrap_err().to_string();
        assert!(said.contains("0.57 m from ‘Stool’") && said.contains("0.55 m"), "{said}");
        let never = Seat { complete: 60, ..seat(&motion, &cue, &s) };
        assert!(never.check().unwrap_err().to_string().contains("ends before anyone sits"));
    }

    #[test]
    fn the_pelvis_is_asked_for_from_when_it_is_seated() {
        let (motion, s, cue) = (motion(), settings(), sit_cue());
        let c = seat(&motion, &cue, &s).pelvis(60);
        assert_eq!((c.frames(), c.joint, c.facings.len()), (50..60, Joint::Hips, 10));
        assert!(c.positions.iter().all(|p| *p == cue.position));
        assert_eq!(seat(&motion, &cue, &s).pelvis(50).frames(), 50..51);
    }

    #[test]
    fn as_the_pelvis_sinks_it_comes_nearer() {
        let (motion, s) = (motion(), settings());
        let mut cue = sit_cue();
        assert!(seat(&motion, &cue, &s).descent().is_empty(), "it is there already");
        let away = Vec3::new(0.05, -0.1, 0.02);
        cue.position += away;
        let way = seat(&motion, &cue, &s).descent();
        assert_eq!(way.last().map(|w| w.0), Some(49));
        // It begins where the pelvis is a centimetre under its highest.
        let z = |f: usize| motion.postures[f].root_position.z;
        let first = way[0].0;
        assert!(z(first) > STANDS - 0.01 && z(first + 1) <= STANDS - 0.01, "{first}");
        for (frame, place) in way {
            let sunk = (STANDS - z(frame)) / (STANDS - SITS_AT);
            assert!(place.distance(motion.postures[frame].root_position + away * sunk) < 1e-4);
        }
        // Who hardly sinks has no way down.
        let mut flat = motion.clone();
        flat.postures.iter_mut().for_each(|p| p.root_position.z = SITS_AT);
        flat.postures[20].root_position.z += 0.09;
        assert!(seat(&flat, &cue, &s).descent().is_empty());
        flat.postures[20].root_position.z += 0.02;
        assert!(!seat(&flat, &cue, &s).descent().is_empty());
    }

    /// A motion whose left foot swings in frames 20 to 31 and stands 30 cm farther from then on, seated from frame 50.
    fn steps() -> Motion {
        let mut motion = motion();
        for (frame, contacts) in motion.contacts.iter_mut().enumerate() {
            contacts[0] = if (20..32).contains(&frame) { 0.0 } else { 1.0 };
        }
        motion
    }

    #[test]
    fn the_last_step_takes_a_feets_shift() {
        let (motion, s, cue) = (steps(), settings(), sit_cue());
        let seat = seat(&motion, &cue, &s);
        let own = FootPlan::of(&motion);
        let mut plan = own.clone();
        let shift = Vec2::new(0.1, -0.05);
        seat.shift_last_plant(&mut plan, 0, shift);
        for frame in 0..60 {
            let t = ((frame as f32 - 19.0) / 13.0).clamp(0.0, 1.0);
            let moved = (shift * t * t * (3.0 - 2.0 * t)).extend(0.0);
            let (a, b) = (own.feet[frame][0], plan.feet[frame][0]);
            assert!((b.ankle - a.ankle).distance(moved) < 1e-6 && (b.toe - a.toe).distance(moved) < 1e-6);
            assert_eq!(plan.feet[frame][1].ankle, own.feet[frame][1].ankle);
            assert!(frame < 20 || b.sigma <= 0.01);
        }
        // The right foot never swings: nothing is shifted.
        let mut plan = own.clone();
        seat.shift_last_plant(&mut plan, 1, shift);
        assert!((0..60).all(|f| plan.feet[f][1].ankle == own.feet[f][1].ankle));
        // As much as the leg reaches: a little is all, a step backwards none of it.
        let share = |shift: Vec2| seat.share_before_sitting(&motion, &own, 0, shift);
        assert_eq!((share(Vec2::new(0.05, 0.0)), share(Vec2::new(0.0, -3.0))), (1.0, 0.0));
        let half = share(Vec2::new(0.0, -0.55));
        assert!(half > 0.0 && half < 1.0, "{half}");
        assert_eq!(seat.share_before_sitting(&motion, &own, 1, Vec2::new(0.05, 0.0)), 0.0);
        // A hop of seven frames carries nothing.
        let mut hop = motion.clone();
        (20..25).for_each(|f| hop.contacts[f][0] = 1.0);
        assert_eq!(seat.share_before_sitting(&hop, &FootPlan::of(&hop), 0, Vec2::new(0.05, 0.0)), 0.0);
        (20..25).for_each(|f| hop.contacts[f][0] = if f < 24 { 1.0 } else { 0.0 });
        assert_eq!(seat.share_before_sitting(&hop, &FootPlan::of(&hop), 0, Vec2::new(0.05, 0.0)), 1.0);
    }

    #[test]
    fn a_foot_in_the_air_lands_before_it_is_set_elsewhere() {
        let (mut motion, s) = (motion(), settings());
        // The left foot is lifted and put back while the pelvis comes to rest, in frames 48 to 58.
        for frame in 48..58 {
            let part = (frame - 47) as f32 / 11.0;
            let lifted = -0.12 * (std::f32::consts::PI * part).sin();
            motion.postures[frame].rotations[Joint::LeftUpLeg.index()] *= Quat::from_rotation_x(lifted);
            motion.contacts[frame][0] = 0.0;
        }
        let mut cue = sit_cue();
        let own = motion.postures[59].pose().position(Joint::LeftFoot).with_z(0.0);
        cue.feet = [Some(own + Vec3::new(0.06, -0.08, 0.0)), None];
        let fit = seat(&motion, &cue, &s).fit(None::<&Manifold>, &Progress::new()).expect("fits");
        assert!(fit.seat.feet_cm[0].is_some_and(|cm| cm < 0.7), "{:?}", fit.seat);
        // It begins once the foot has landed, not two frames after the pelvis has.
        let landed = fit.motion.postures[58].pose().position(Joint::LeftFoot);
        assert!(landed.distance(own.with_z(ANKLE_HEIGHT)) < 5e-3, "{landed} {own}");
        for frame in 1..fit.motion.len() {
            let toe = |frame: usize| fit.motion.postures[frame].pose().position(Joint::LeftToe);
            let stands = fit.motion.contacts[frame][0] == 1.0 && fit.motion.contacts[frame - 1][0] == 1.0;
            assert!(!stands || toe(frame).distance(toe(frame - 1)) < 4e-3, "{frame}");
        }
    }

    #[test]
    fn a_foot_is_not_put_into_furniture() {
        let (motion, s, cue) = (steps(), settings(), sit_cue());
        // A board of 20 cm to the left of the feet.
        let scene = room(&[([0.25, -0.5, 0.0], [0.27, 0.3, 0.2])]);
        let seat = Seat { scene: Some(&scene), ..seat(&motion, &cue, &s) };
        assert!(
            seat.is_free(&motion, 40, 0, Vec3::X * 0.05) && !seat.is_free(&motion, 40, 0, Vec3::X * 0.15)
        );
        assert!(seat.is_free(&motion, 40, 0, Vec3::X * -0.1));
        assert!(seat.is_free(&motion, 40, 1, Vec3::X * 0.15));
        let none = Seat { scene: None, ..seat };
        assert!(none.is_free(&motion, 40, 0, Vec3::X * 0.15));
        // In front of the shin alone: it moves half as far as the foot.
        let bar = room(&[([0.0, -0.75, 0.3], [0.3, -0.2, 0.32])]);
        let seat = Seat { scene: Some(&bar), ..none };
        assert!(!seat.is_free(&motion, 0, 0, Vec3::Y * -0.3));
        let seat = Seat { scene: Some(&scene), ..seat };
        let plan = FootPlan::of(&motion);
        assert_eq!(seat.share_before_sitting(&motion, &plan, 0, Vec2::new(0.2, 0.0)), 0.5);
    }

    #[test]
    fn feet_that_do_not_reach_the_floor_hang() {
        // A bar stool: the pelvis ends 0.35 m higher than it sits, the feet come along.
        let s = settings();
        let mut motion = motion();
        for (frame, posture) in motion.postures.iter_mut().enumerate() {
            if frame >= 50 {
                posture.root_position.z += 0.3;
                motion.contacts[frame] = [0.0; 2];
            }
        }
        let mut cue = sit_cue();
        cue.position.z += 0.35;
        let seat = seat(&motion, &cue, &s);
        let settled = seat.settle(&motion, &Progress::new()).expect("settled");
        assert_eq!((settled.hangs, settled.hang_already), ([true; 2], [true; 2]));
        let own = FootPlan::of(&motion).feet[59];
        for side in 0..2 {
            assert!((settled.feet[side].ankle - own[side].ankle).distance(Vec3::Z * 0.05) < 1e-5);
        }
        let fit = seat.fit(None::<&Manifold>, &Progress::new()).expect("fits");
        assert_eq!(fit.seat.hanging, [true; 2]);
        assert!(fit.seat.pelvis_cm < 0.5);
        let last = fit.motion.postures[fit.motion.len() - 1].pose();
        assert!(last.position(Joint::LeftFoot).z > 0.3, "{}", last.position(Joint::LeftFoot));
        // On the floor of the same seat's place the feet that stand do not hang.
        let (on_the_floor, low_cue) = (self::motion(), sit_cue());
        let low = Seat { motion: &on_the_floor, cue: &low_cue, ..seat };
        assert_eq!(low.settle(low.motion, &Progress::new()).expect("settled").hangs, [false; 2]);
    }

    #[test]
    fn how_one_sits_by_hand() {
        let s = settings();
        let mut motion = motion();
        let mut cue = sit_cue();
        // The worst of the seated frames counts; what is before does not.
        motion.postures[55].root_position.x += 0.03;
        motion.postures[52].rotations[0] = Quat::from_rotation_z(0.1);
        motion.postures[10].root_position.x += 1.0;
        let foot = Joint::LeftFoot.index();
        motion.postures[59].rotations[foot] =
            Quat::from_rotation_x(0.2) * motion.postures[59].rotations[foot];
        let ankle = motion.postures[59].pose().position(Joint::LeftFoot);
        cue.feet[0] = Some((ankle + Vec3::Y * 0.07) - Vec3::Z * ANKLE_HEIGHT);
        let figures = seat(&motion, &cue, &s).figures(&motion, [true, false]);
        close(figures.pelvis_cm, 3.0, 0.01);
        close(figures.facing_degrees, 0.1f32.to_degrees(), 0.01);
        close(figures.feet_cm[0].expect("given"), 7.0, 0.01);
        close(figures.sole_degrees[0], 0.2f32.to_degrees(), 0.05);
        close(figures.sole_degrees[1], 0.0, 0.05);
        assert_eq!(
            (figures.feet_cm[1], figures.hanging, figures.thigh_cm, figures.back_cm),
            (None, [true, false], 0.0, 0.0)
        );
        // In a seat that is 2 cm higher than the thighs' undersides, with a backrest 3 cm in the back.
        let seated = person(Planar::default(), SITS_AT, SITS_BACK);
        let under = seated.pose().position(Joint::LeftUpLeg).z - 0.05;
        let still = Motion { postures: vec![seated; 60], contacts: vec![[1.0; 2]; 60] };
        let scene = room(&[
            ([-0.3, -0.15, 0.0], [0.3, 0.2, under + 0.02]),
            ([-0.3, 0.05 + 0.02, 0.7], [0.3, 0.3, 1.2]),
        ]);
        let mut cue = sit_cue();
        cue.position = seated.root_position;
        let figures = Seat { scene: Some(&scene), ..seat(&still, &cue, &s) }.figures(&still, [false; 2]);
        assert!((1.0..9.0).contains(&figures.thigh_cm), "{figures:?}");
        assert!((2.0..6.0).contains(&figures.back_cm), "{figures:?}");
        assert_eq!(seat(&still, &cue, &s).figures(&Motion::default(), [false; 2]).pelvis_cm, 0.0);
        assert_eq!(Posture::default().rotations.len(), still.postures[0].rotations.len());
    }

    #[test]
    fn feet_that_the_seat_lifts_off_the_floor_hang_too() {
        // They stand in the motion, and the seat is 0.3 m higher than it: no leg is that long.
        let (s, motion) = (settings(), motion());
        let mut cue = sit_cue();
        cue.position.z += 0.45;
        let seat = seat(&motion, &cue, &s);
        let settled = seat.settle(&motion, &Progress::new()).expect("settled");
        assert_eq!((settled.hangs, settled.hang_already), ([true; 2], [false; 2]));
        for (side, place) in settled.feet.iter().enumerate() {
            // The hip is 2 cm under the pelvis; knee 0.95 of a thigh ahead (-Y), and 0.97 of a shin down from there.
            let hip = cue.position + Vec3::new([0.095, -0.095][side], 0.0, -0.02);
            let ankle = hip + Vec3::new(0.0, -0.95 * LEG_LENGTH - 0.05, -0.97 * LEG_LENGTH);
            assert!(place.ankle.distance(ankle) < 0.03, "{} {ankle}", place.ankle);
        }
        // They leave the floor while the seat takes the weight, before the leg gets too short for it.
        let plan = FootPlan::of(&motion);
        let leaves = seat.leaves_floor(&plan, 0, 18);
        assert!(leaves <= 50 - 12, "{leaves}");
        let (mut longer, short) = (motion.clone(), settled);
        let (planned, contacts) = seat.plan_feet(&mut longer, &short);
        assert_eq!((planned.feet.len(), longer.len()), (contacts.len(), contacts.len()));
        for side in 0..2 {
            let last = planned.feet[planned.feet.len() - 1][side];
            assert!(
                last.ankle.distance(short.feet[side].ankle) < 1e-4 && !last.planted && last.sigma == 0.05
            );
            assert_eq!((contacts[leaves - 2][side], contacts[leaves + 9][side]), (1.0, 0.0));
            // Half-way it is half-way, and over it by the arc.
            let begun = planned.feet[leaves][side].ankle;
            let way = begun.distance(short.feet[side].ankle);
            let half = planned.feet[leaves + 9][side].ankle;
            let expected = begun.lerp(short.feet[side].ankle, 0.5) + Vec3::Z * (0.02 + 0.1 * way);
            assert!(half.distance(expected) < 5e-3, "{half} {expected}");
        }
    }
}
