//! Feet whole: how they land, roll, swivel and leave, whatever the contact flag says.

use std::ops::Range;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::percent;
use crate::library::contact::runs;
use crate::library::foot::{sole, turned_out};
use crate::math::rotation::wrap_angle;
use crate::motion::{FRAME_RATE, Pose};
use crate::scene::SceneIndex;

/// A sole whose heel and ball are both within this distance of what it stands on is flat, metres.
const FLAT: f32 = 0.01;
/// A stance is flat for at least so many frames.
const SHORTEST_FLAT: usize = 3;
/// A flat foot that turns further has swivelled, radians.
const SWIVEL: f32 = 15f32.to_radians();
/// A foot is carried by its lowest point where that is no higher than this, metres …
const CARRYING_HEIGHT: f32 = 0.02;
/// … and slower than this, m/s: swinging toes pass as low.
const CARRYING_SPEED: f32 = 0.8;
/// Of someone whose pelvis is higher than this over what a foot stands on, metres, …
const STANDING: f32 = 0.8;
/// … feet that carry are turned out and in by no more than this of where the pelvis faces, radians, but for a few frames of a
/// thousand of ACCAD's.
const TURNED_OUT: f32 = 50f32.to_radians();
const TURNED_IN: f32 = 35f32.to_radians();
/// A step is in the air for at least so many frames …
const SHORTEST_SWING: usize = 5;
/// … while the body walks, no slower and no faster than this, m/s …
const WALKING: Range<f32> = 0.4..2.0;
/// … and at most so far from where it faces, radians: who walks backwards or runs lands otherwise.
const FORWARDS: f32 = 45f32.to_radians();
/// A foot whose heel is lower than its ball by less lands flat, metres.
const LEVEL: f32 = 0.002;
/// Toes clear the floor late in the swing, between these parts of it: after they have passed the other foot, before they
/// are raised for the heel to land.
const LATE_SWING: (f32, f32) = (0.5, 0.85);

/// How feet stand and step.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct WholeFootFigures {
    /// While the sole is flat.
    pub flat: FlatFoot,
    /// Against the pelvis.
    pub turned: TurnedFeet,
    /// While the person walks.
    pub steps: StepFigures,
}

/// Feet that carry someone who stands or walks, turned out or in of where the pelvis faces.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct TurnedFeet {
    /// Share of the frames with a foot that is turned out by more than 50° or in by more than 35°, percent.
    pub percent: f32,
    /// The farthest that one is turned out, degrees.
    pub out_degrees: f32,
    /// The farthest that one is turned in, degrees.
    pub in_degrees: f32,
}

/// Feet whose heel and ball are both within 1 cm of what they stand on, for three frames or more.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FlatFoot {
    /// How many such stances there are.
    pub stances: usize,
    /// How far the heel gets on the floor plane from where the stance began, cm.
    pub heel_drift_cm: Spread,
    /// The same of the ball of the foot.
    pub ball_drift_cm: Spread,
    /// How far the foot turns on the floor within a stance, degrees.
    pub swivel_degrees: Spread,
    /// Share of the stances that turn by more than 15°, percent.
    pub swivelled_percent: f32,
    /// Those stances, the worst first.
    pub swivels: Vec<Swivel>,
}

/// A flat foot that turned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Swivel {
    /// 0 is the left foot, 1 the right.
    pub side: usize,
    /// The first frame of the stance.
    pub first: usize,
    /// The frame after its last.
    pub end: usize,
    /// How far it turned, degrees.
    pub degrees: f32,
}

/// The middle of a set of values, and what nine in ten of them do not exceed; 0 of nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The middle one.
    pub median: f32,
    /// The 90th percentile.
    pub p90: f32,
}

impl Spread {
    fn of(mut values: Vec<f32>) -> Self {
        values.sort_unstable_by(f32::total_cmp);
        let at = |part: f32| values.get((part * values.len() as f32) as usize).copied().unwrap_or_default();
        Self { median: at(0.5), p90: at(0.9) }
    }
}

/// Steps of someone who walks forwards at 0.4 to 2 m/s; medians, none where nobody does.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StepFigures {
    /// How many there are.
    pub steps: usize,
    /// Share of them that land with the heel first, percent.
    pub heel_first_percent: Option<f32>,
    /// How far the foot points up as it lands, degrees.
    pub toe_up_degrees: Option<f32>,
    /// How far the tip of the toes is over the ground at least, late in the swing, cm.
    pub toe_clearance_cm: Option<f32>,
    /// How far the heel is raised at most as the foot leaves, as the foot's slope, degrees.
    pub heel_up_degrees: Option<f32>,
}

/// One frame of one foot: heel, ball and tip of the sole.
#[derive(Debug, Clone, Copy)]
struct Sole {
    points: [Vec3; 3],
    /// Over what each stands on, metres.
    heights: [f32; 3],
}

impl Sole {
    fn is_flat(&self) -> bool {
        self.heights[0] < FLAT && self.heights[1] < FLAT
    }

    fn lowest(&self) -> usize {
        (1..3).fold(0, |lowest, i| if self.heights[i] < self.heights[lowest] { i } else { lowest })
    }

    /// How far the foot points up, radians.
    fn slope(&self) -> f32 {
        let [heel, ball, _] = self.points;
        (ball.z - heel.z).atan2(ball.truncate().distance(heel.truncate()))
    }

    fn yaw(&self) -> f32 {
        let along = self.points[1] - self.points[0];
        along.y.atan2(along.x)
    }
}

#[derive(Debug, Clone, Copy)]
struct Step {
    heel_first: bool,
    toe_up: f32,
    toe_clearance: f32,
    heel_up: f32,
}

/// What has been counted so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    heel_drift: Vec<f32>,
    ball_drift: Vec<f32>,
    swivel: Vec<f32>,
    swivels: Vec<Swivel>,
    /// Frames, those with a foot that is turned too far, and how far one is turned in (negative) and out, radians.
    frames: usize,
    turned: usize,
    farthest: (f32, f32),
    steps: Vec<Step>,
}

impl Tally {
    /// `floor`: its height where there is no scene, world, metres.
    pub(super) fn add(&mut self, poses: &[Pose], floor: f32, scene: Option<&SceneIndex>) {
        let ground = |point: Vec3| {
            scene.and_then(|scene| scene.floor_height_at(point.truncate(), point.z)).unwrap_or(floor)
        };
        let mut turned = vec![false; poses.len()];
        for side in 0..2 {
            let soles: Vec<Sole> = poses
                .iter()
                .map(|pose| {
                    let points = sole(pose, side);
                    Sole { points, heights: points.map(|point| point.z - ground(point)) }
                })
                .collect();
            let flat: Vec<bool> = soles.iter().map(Sole::is_flat).collect();
            for stance in runs(&flat, true).into_iter().map(|(first, end)| first..end) {
                if stance.len() >= SHORTEST_FLAT {
                    self.stand(&soles, side, stance);
                }
            }
            let carried: Vec<bool> = (0..soles.len()).map(|frame| is_carried(&soles, frame)).collect();
            for (frame, pose) in poses.iter().enumerate().filter(|(frame, _)| carried[*frame]) {
                let [heel, ..] = soles[frame].points;
                if pose.positions[0].z - heel.z + soles[frame].heights[0] < STANDING {
                    continue;
                }
                let out = turned_out(pose, side);
                turned[frame] |= !(-TURNED_IN..=TURNED_OUT).contains(&out);
                self.farthest = (self.farthest.0.min(out), self.farthest.1.max(out));
            }
            for swing in runs(&carried, false).into_iter().map(|(first, end)| first..end) {
                let Some(after) = poses.get(swing.end) else { continue };
                let is_whole = swing.start > 0 && swing.len() >= SHORTEST_SWING;
                if is_whole && walks(&poses[swing.start], after, swing.len()) {
                    self.steps.push(step(&soles, swing));
                }
            }
        }
        self.frames += poses.len();
        self.turned += turned.into_iter().filter(|is| *is).count();
    }

    fn stand(&mut self, soles: &[Sole], side: usize, stance: Range<usize>) {
        let (first, end) = (stance.start, stance.end);
        let begin = &soles[first];
        let drift = |i: usize| {
            let from = begin.points[i].truncate();
            soles[stance.clone()].iter().map(|s| s.points[i].truncate().distance(from)).fold(0.0, f32::max)
        };
        self.heel_drift.push(drift(0));
        self.ball_drift.push(drift(1));
        let (least, most) = soles[stance.clone()]
            .iter()
            .map(|sole| wrap_angle(sole.yaw() - begin.yaw()))
            .fold((0f32, 0f32), |(least, most), yaw| (least.min(yaw), most.max(yaw)));
        self.swivel.push(most - least);
        if most - least > SWIVEL {
            self.swivels.push(Swivel { side, first, end, degrees: (most - least).to_degrees() });
        }
    }

    pub(super) fn merge(&mut self, other: Tally) {
        self.heel_drift.extend(other.heel_drift);
        self.ball_drift.extend(other.ball_drift);
        self.swivel.extend(other.swivel);
        self.swivels.extend(other.swivels);
        self.frames += other.frames;
        self.turned += other.turned;
        let (most_in, most_out) = other.farthest;
        self.farthest = (self.farthest.0.min(most_in), self.farthest.1.max(most_out));
        self.steps.extend(other.steps);
    }

    pub(super) fn finish(mut self, spans: bool) -> WholeFootFigures {
        let scaled = |values: &[f32], scale: f32| Spread::of(values.iter().map(|v| scale * v).collect());
        let swivelled = self.swivels.len();
        self.swivels.sort_by(|a, b| b.degrees.total_cmp(&a.degrees));
        let median = |of: fn(&Step) -> f32| {
            (!self.steps.is_empty()).then(|| Spread::of(self.steps.iter().map(of).collect()).median)
        };
        let heel_first = self.steps.iter().filter(|step| step.heel_first).count();
        WholeFootFigures {
            flat: FlatFoot {
                stances: self.swivel.len(),
                heel_drift_cm: scaled(&self.heel_drift, 100.0),
                ball_drift_cm: scaled(&self.ball_drift, 100.0),
                swivel_degrees: scaled(&self.swivel, 1f32.to_degrees()),
                swivelled_percent: percent(swivelled, self.swivel.len()),
                swivels: if spans { self.swivels } else { Vec::new() },
            },
            turned: TurnedFeet {
                percent: percent(self.turned, self.frames),
                out_degrees: self.farthest.1.to_degrees(),
                in_degrees: -self.farthest.0.to_degrees(),
            },
            steps: StepFigures {
                steps: self.steps.len(),
                heel_first_percent: (!self.steps.is_empty()).then(|| percent(heel_first, self.steps.len())),
                toe_up_degrees: median(|step| step.toe_up.to_degrees()),
                toe_clearance_cm: median(|step| 100.0 * step.toe_clearance),
                heel_up_degrees: median(|step| step.heel_up.to_degrees()),
            },
        }
    }
}

/// Whether someone walks forwards from one pose to another, so many frames later.
fn walks(before: &Pose, after: &Pose, frames: usize) -> bool {
    let way = (after.positions[0] - before.positions[0]).truncate();
    let facing = (before.rotations[0] * Vec3::NEG_Y).truncate();
    WALKING.contains(&(way.length() * FRAME_RATE / frames as f32)) && facing.angle_to(way).abs() < FORWARDS
}

/// Whether a foot's lowest point carries it: low and still.
fn is_carried(soles: &[Sole], frame: usize) -> bool {
    let lowest = soles[frame].lowest();
    let (before, after) = (frame.saturating_sub(1), (frame + 1).min(soles.len() - 1));
    let step = soles[before].points[lowest].truncate().distance(soles[after].points[lowest].truncate());
    let speed = step * FRAME_RATE / (after - before).max(1) as f32;
    soles[frame].heights[lowest] < CARRYING_HEIGHT && speed < CARRYING_SPEED
}

/// The step that a swing makes; a frame before it and one after it are there.
fn step(soles: &[Sole], swing: Range<usize>) -> Step {
    let landing = &soles[swing.end];
    let within = |part: f32| swing.start + (part * swing.len() as f32) as usize;
    let late = within(LATE_SWING.0)..within(LATE_SWING.1).max(within(LATE_SWING.0) + 1);
    let clearance = soles[late].iter().map(|sole| sole.heights[2]).fold(f32::INFINITY, f32::min);
    // A foot leaves by rolling on: it is steepest about when it leaves.
    let leaving = swing.start.saturating_sub(2)..swing.start + 2;
    Step {
        heel_first: landing.heights[0] + LEVEL < landing.heights[1],
        toe_up: landing.slope(),
        toe_clearance: clearance,
        heel_up: soles[leaving].iter().map(|sole| -sole.slope()).fold(f32::NEG_INFINITY, f32::max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Joint, Posture};
    use glam::Quat;

    fn figures(postures: &[Posture]) -> WholeFootFigures {
        let mut tally = Tally::default();
        tally.add(&postures.iter().map(Posture::pose).collect::<Vec<_>>(), 0.0, None);
        tally.finish(true)
    }

    #[test]
    fn a_flat_figure_that_turns_and_slides_by_hand() {
        // Both feet turn with the body by 30° about the root's vertical line. A heel is 9.5 cm beside it and 6 cm behind
        // it, so its chord is 2·sin 15°·|(9.5, 6)|; the ball is 13 cm before it.
        let postures: Vec<Posture> = (0..=30)
            .map(|frame| {
                let mut posture = Posture::default();
                posture.rotations[0] = Quat::from_rotation_z((frame as f32).to_radians());
                posture
            })
            .collect();
        let flat = figures(&postures).flat;
        assert_eq!(flat.stances, 2);
        let chord = |x: f32, y: f32| 2.0 * 15f32.to_radians().sin() * x.hypot(y);
        assert!((flat.swivel_degrees.median - 30.0).abs() < 1e-2, "{flat:?}");
        assert_eq!((flat.swivelled_percent, flat.swivels.len()), (100.0, 2));
        assert_eq!((flat.swivels[0].first, flat.swivels[0].end), (0, 31));
        let ankle_y = Posture::default().pose().position(Joint::LeftFoot).y;
        assert!((flat.heel_drift_cm.median - chord(9.5, 100.0 * ankle_y + 6.0)).abs() < 1e-2, "{flat:?}");
        assert!((flat.ball_drift_cm.median - chord(9.5, 100.0 * ankle_y - 13.0)).abs() < 1e-2);
        // Not by 14°, and not with the heel raised by 2 cm over a foot of 19 cm.
        assert_eq!(figures(&postures[..15]).flat.swivelled_percent, 0.0);
        let raised = postures.iter().map(|posture| {
            let mut posture = *posture;
            posture.rotations[Joint::LeftFoot.index()] = Quat::from_rotation_x(0.12);
            posture.rotations[Joint::RightFoot.index()] = Quat::from_rotation_x(0.12);
            posture.root_position.z += 0.13 * 0.12;
            posture
        });
        assert_eq!(figures(&raised.collect::<Vec<_>>()).flat.stances, 0);
    }

    #[test]
    fn feet_are_turned_against_the_pelvis() {
        // The left foot turned about the vertical, out to the left; the right one as it is.
        let posture = |out: f32| {
            let mut posture = Posture::default();
            posture.rotations[Joint::LeftFoot.index()] = Quat::from_rotation_z(out.to_radians());
            posture
        };
        let turned = |outs: &[f32]| figures(&outs.iter().map(|out| posture(*out)).collect::<Vec<_>>()).turned;
        let found = turned(&[49.0; 4]);
        assert!((found.percent, found.in_degrees) == (0.0, 0.0) && (found.out_degrees - 49.0).abs() < 0.01);
        assert_eq!(turned(&[51.0; 4]).percent, 100.0);
        assert_eq!(turned(&[-34.0; 4]).percent, 0.0);
        let found = turned(&[-36.0; 4]);
        assert!(found.percent == 100.0 && (found.in_degrees - 36.0).abs() < 0.01, "{found:?}");
        // Where the pelvis faces is what counts, and the right foot's outside lies to the right.
        let mut posture = posture(20.0);
        posture.rotations[0] = Quat::from_rotation_z(2.0);
        posture.rotations[Joint::RightFoot.index()] = Quat::from_rotation_z(-60f32.to_radians());
        let found = figures(&[posture; 4]).turned;
        assert!(found.percent == 100.0 && (found.out_degrees - 60.0).abs() < 0.01, "{found:?}");
        // In the air they may be as they like, and under who sits.
        let mut low = posture;
        low.root_position.z = 0.7;
        low.rotations[Joint::RightUpLeg.index()] = Quat::from_rotation_x(1.0);
        low.rotations[Joint::LeftUpLeg.index()] = Quat::from_rotation_x(1.0);
        assert_eq!(figures(&[low; 4]).turned, TurnedFeet::default());
        posture.root_position.z += 0.1;
        assert_eq!(figures(&[posture; 4]).turned, TurnedFeet::default());
    }

    /// A body that moves forwards at 1.2 m/s over a left foot that swings in frames 10 to 20, pitched as it leaves and
    /// lands (radians, up is positive).
    fn stride(leaves: f32, lands: f32) -> Vec<Posture> {
        (0..32)
            .map(|frame| {
                let mut posture = Posture::default();
                let part = ((frame as f32 - 10.0) / 10.0).clamp(0.0, 1.0);
                posture.root_position.y = -0.4 * part;
                posture.root_position.z += 0.08 * (std::f32::consts::PI * part).sin();
                let pitch = if part == 0.0 { 0.0 } else { leaves + (lands - leaves) * part };
                let after = if frame > 20 { 0.0 } else { 1.0 };
                posture.rotations[Joint::LeftFoot.index()] = Quat::from_rotation_x(-pitch * after);
                posture
            })
            .collect()
    }

    #[test]
    fn steps_land_with_what_is_lower() {
        let heel = figures(&stride(-0.6, 0.25)).steps;
        // Both feet are carried along; the right one lands flat.
        assert_eq!(heel.steps, 2, "{heel:?}");
        assert_eq!(heel.heel_first_percent, Some(50.0));
        let toe = figures(&stride(-0.6, -0.2)).steps;
        assert_eq!(toe.heel_first_percent, Some(0.0));
        // Backwards, or faster than one walks, nothing is told.
        let backwards = stride(0.6, 0.25).into_iter().map(|mut posture| {
            posture.root_position.y *= -1.0;
            posture
        });
        assert_eq!(figures(&backwards.collect::<Vec<_>>()).steps.steps, 0);
        let running = stride(-0.6, 0.25).into_iter().map(|mut posture| {
            posture.root_position.y *= 2.0;
            posture
        });
        assert_eq!(figures(&running.collect::<Vec<_>>()).steps.steps, 0);
        let standing = figures(&[Posture::default(); 20]).steps;
        assert_eq!((standing.steps, standing.toe_up_degrees), (0, None));
    }

    #[test]
    fn a_step_by_hand() {
        // Heel, ball and tip 13 cm and 7 cm apart along −Y, the foot sloped by `slope` about the heel `z` high.
        let sole = |y: f32, z: f32, slope: f32| {
            let at = |along: f32| Vec3::new(0.0, y - along * slope.cos(), z + along * slope.sin());
            let points = [at(0.0), at(0.19), at(0.26)];
            Sole { points, heights: points.map(|p| p.z) }
        };
        let mut soles = vec![sole(0.0, 0.0, 0.0), sole(0.0, 0.13, -0.7), sole(-0.1, 0.18, -0.8)];
        soles.extend([
            sole(-0.3, 0.15, -0.5),
            sole(-0.5, 0.05, 0.0),
            sole(-0.6, 0.03, 0.1),
            sole(-0.7, 0.0, 0.3),
        ]);
        let found = step(&soles, 2..6);
        assert!(found.heel_first && (found.toe_up - 0.3).abs() < 1e-5);
        assert!((found.heel_up - 0.8).abs() < 1e-5);
        // Half to 85 % of four frames: the third alone.
        assert!((found.toe_clearance - 0.05).abs() < 1e-5);
    }
}
