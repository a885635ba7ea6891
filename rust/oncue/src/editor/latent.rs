//! The search along the manifold: z* that minimizes L = w_p·L_pos + w_f·L_foot + w_r·L_root (LAMA, section 3.6 and
//! supplementary, "Motion Editing Loss").
//!
//! What the manifold cannot say of a motion is not lost: the edited motion is M carried along by the difference of
//! Ψ⁻¹(z*) and Ψ⁻¹(z), where the paper takes Ψ⁻¹(z*) itself. With z* = z the motion comes back as it was. Windows of a
//! longer motion overlap, are optimized each by itself and are blended.

use std::ops::Range;

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::body_solver::FootPlaces;
use crate::error::Result;
use crate::manifold::Manifold;
use crate::manifold::autoencoder::DecoderWorkspace;
use crate::manifold::kinematics::{Kinematics, RootPath};
use crate::manifold::window::{
    CONTACTS, FEATURES, HEIGHT, ROTATIONS, STEP, WINDOW, from_motion, rotation, rotation_range, to_motion,
};
use crate::math::rotation::{from_angle_axis, to_angle_axis};
use crate::motion::{JOINT_COUNT, Joint, Motion, Posture};
use crate::nn::Adam;
use crate::progress::Progress;
use crate::settings::EditorSettings;

/// What the search needs of a manifold: Ψ, Ψ⁻¹ and the gradient of Ψ⁻¹. Windows are [`WINDOW`] × [`FEATURES`].
pub trait Decoder: Sync {
    /// Buffers, used again and again.
    type Work: Default;
    /// z = Ψ(X).
    fn encode(&self, x: &[f32]) -> Vec<f32>;
    /// X = Ψ⁻¹(z).
    fn decode<'w>(&self, z: &[f32], work: &'w mut Self::Work) -> &'w [f32];
    /// The gradient by z, given that by X, at the last z that was decoded.
    fn backward<'w>(&self, d_x: &[f32], work: &'w mut Self::Work) -> &'w [f32];
}

/// Where one joint is to be on one frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Target {
    pub frame: usize,
    pub joint: Joint,
    /// The point of the joint that `position` places, in the joint's frame.
    pub offset: Vec3,
    pub position: Option<Vec3>,
    pub rotation: Option<Mat3>,
}

/// The joints of [`FootPlaces`], in its order.
pub(crate) const FOOT_JOINTS: [Joint; 4] =
    [Joint::LeftFoot, Joint::LeftToe, Joint::RightFoot, Joint::RightToe];

/// What the search is to do with a motion.
pub(crate) struct Search<'a> {
    /// On a floor at z = 0.
    pub motion: &'a Motion,
    /// The frames that may change.
    pub span: Range<usize>,
    pub targets: &'a [Target],
    /// For every frame of the motion.
    pub feet: &'a [FootPlaces],
    pub settings: &'a EditorSettings,
}

/// What the search did, for the report.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SearchFigures {
    /// Windows that were searched.
    pub windows: usize,
    /// Adam's steps, of the window that took most.
    pub steps: usize,
    /// Mean distance of the targets before the search and after it, cm.
    pub before_cm: f32,
    /// Mean distance of the targets after the search, cm.
    pub after_cm: f32,
}

/// The motion after the search: frames outside the span, and their contacts, are as they were.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn search<D: Decoder>(
    decoder: &D,
    search: &Search,
    progress: &Progress,
) -> Result<(Motion, SearchFigures)> {
    let windows = windows(&search.span, search.motion.len());
    let found: Vec<Found> =
        windows.par_iter().map(|&first| window(decoder, search, first, progress)).collect::<Result<_>>()?;
    let mut out = search.motion.clone();
    for frame in search.span.clone() {
        let mut blended: Option<(Posture, f32)> = None;
        for (first, found) in windows.iter().zip(&found) {
            let Some(posture) = frame.checked_sub(*first).and_then(|at| found.motion.postures.get(at)) else {
                continue;
            };
            // Towards its ends a window counts for less.
            let at = (frame - first) as f32 + 0.5;
            let weight = (at.min(WINDOW as f32 - at) / OVERLAP as f32).clamp(1e-3, 1.0);
            blended = Some(match blended {
                None => (*posture, weight),
                Some((before, total)) => (mix(&before, posture, weight / (total + weight)), total + weight),
            });
        }
        if let Some((posture, _)) = blended {
            out.postures[frame] = posture;
        }
    }
    filter_changes(search.motion, &mut out, &search.span);
    let mean = |f: fn(&Found) -> f32| found.iter().map(f).sum::<f32>() / found.len().max(1) as f32;
    let figures = SearchFigures {
        windows: windows.len(),
        steps: found.iter().map(|f| f.steps).max().unwrap_or_default(),
        before_cm: 100.0 * mean(|f| f.before),
        after_cm: 100.0 * mean(|f| f.after),
    };
    Ok((out, figures))
}

/// σ of the filter over what the search changed, frames.
const FILTER: f32 = 3.0;

/// What the search changed in `span`, filtered over time: a convolutional decoder that is led far from where it was trained
/// trembles from frame to frame, and no one moves so. What the filter takes from a target the finishing pass gives back.
fn filter_changes(before: &Motion, found: &mut Motion, span: &Range<usize>) {
    let changes: Vec<([Vec3; JOINT_COUNT], Vec3)> = span
        .clone()
        .map(|f| {
            let (a, b) = (&before.postures[f], &found.postures[f]);
            let turn = |j: usize| to_angle_axis(a.rotations[j].inverse() * b.rotations[j]);
            (std::array::from_fn(turn), b.root_position - a.root_position)
        })
        .collect();
    let radius = (3.0 * FILTER) as i64;
    let last = changes.len() as i64 - 1;
    for (i, frame) in span.clone().enumerate() {
        let (mut turns, mut shift, mut total) = ([Vec3::ZERO; JOINT_COUNT], Vec3::ZERO, 0.0);
        for d in -radius..=radius {
            let weight = (-0.5 * (d as f32 / FILTER).powi(2)).exp();
            let (other_turns, other_shift) = &changes[(i as i64 + d).clamp(0, last) as usize];
            turns.iter_mut().zip(other_turns).for_each(|(t, o)| *t += *o * weight);
            shift += *other_shift * weight;
            total += weight;
        }
        let own = &before.postures[frame];
        found.postures[frame] = Posture {
            root_position: own.root_position + shift / total,
            rotations: std::array::from_fn(|j| {
                (own.rotations[j] * from_angle_axis(turns[j] / total)).normalize()
            }),
        };
    }
}

/// Frames that two windows share.
const OVERLAP: usize = 40;

/// First frames of the windows that cover a span, within the motion where it is long enough.
fn windows(span: &Range<usize>, frames: usize) -> Vec<usize> {
    let last = frames.saturating_sub(WINDOW);
    if span.len() + OVERLAP <= WINDOW {
        let first = (span.start + span.len() / 2).saturating_sub(WINDOW / 2);
        return vec![first.min(last)];
    }
    let begin = span.start.saturating_sub(OVERLAP / 2).min(last);
    let end = (span.end + OVERLAP / 2).min(frames).saturating_sub(WINDOW).max(begin);
    let count = (end - begin).div_ceil(WINDOW - OVERLAP);
    (0..=count).map(|i| begin + (end - begin) * i / count.max(1)).collect()
}

/// A share `t` of the way from one posture to another.
pub(crate) fn mix(a: &Posture, b: &Posture, t: f32) -> Posture {
    Posture {
        root_position: a.root_position.lerp(b.root_position, t),
        rotations: std::array::from_fn(|j| {
            let (p, q) = (a.rotations[j], b.rotations[j]);
            p.slerp(if p.dot(q) < 0.0 { -q } else { q }, t).normalize()
        }),
    }
}

struct Found {
    motion: Motion,
    steps: usize,
    before: f32,
    after: f32,
}

/// One window's optimization, from frame `first` on.
fn window<D: Decoder>(decoder: &D, search: &Search, first: usize, progress: &Progress) -> Result<Found> {
    let settings = search.settings;
    // A motion shorter than a window stands still at its end.
    let held = |frame: usize| (first + frame).min(search.motion.len() - 1);
    let original = Motion {
        postures: (0..WINDOW).map(|f| search.motion.postures[held(f)]).collect(),
        contacts: (0..WINDOW).map(|f| search.motion.contacts[held(f)]).collect(),
    };
    let feet: Vec<FootPlaces> = (0..WINDOW).map(|f| search.feet[held(f)]).collect();
    let targets: Vec<Target> = search
        .targets
        .iter()
        .filter(|t| (first..first + WINDOW).contains(&t.frame))
        .map(|t| Target { frame: t.frame - first, ..*t })
        .collect();
    if targets.is_empty() {
        return Ok(Found { motion: original, steps: 0, before: 0.0, after: 0.0 });
    }
    let (x, start) = from_motion(&original);
    let latent = decoder.encode(&x);
    let root = original.postures.iter().map(|p| p.root_position.truncate()).collect();
    let loss = Loss { targets, feet, root, x, settings };

    let mut work = D::Work::default();
    let mut z = latent;
    let carried = Carried::new(&loss.x, decoder.decode(&z, &mut work));
    let mut adam = Adam::new(settings.learning_rate, z.len());
    let mut pass = Pass::default();
    let mut misses = Vec::with_capacity(settings.steps);
    let mut steps = 0;
    loop {
        progress.check()?;
        carried.apply(decoder.decode(&z, &mut work), &mut pass.x);
        pass.kinematics.forward(&pass.x, RootPath::From(start));
        let miss = loss.miss(&pass.kinematics);
        misses.push(miss.mean);
        // Stopped when met, or when a hundred steps have gained next to nothing.
        let stuck = steps >= 150 && miss.mean > 0.97 * misses[steps - 100];
        if steps == settings.steps || miss.largest < settings.met || stuck {
            break;
        }
        loss.gradient(&mut pass);
        carried.pull_back(&mut pass.d_x);
        let d_z = decoder.backward(&pass.d_x, &mut work);
        adam.step(&mut z, d_z, 1.0);
        steps += 1;
    }
    let mut motion = to_motion(&pass.x, start);
    motion.contacts = original.contacts;
    Ok(Found { motion, steps, before: misses[0], after: misses[misses.len() - 1] })
}

/// M carried along by the decoder: X_M turned and shifted by what Ψ⁻¹(z*) differs from Ψ⁻¹(z).
struct Carried {
    /// For each frame and joint the rotation R_M·R̂⁻¹ by which the decoder's 6D vectors are turned.
    turns: Vec<[Mat3; JOINT_COUNT]>,
    /// Root height and step: what is added to the decoder's.
    shifts: Vec<[f32; 4]>,
}

impl Carried {
    fn new(x: &[f32], decoded: &[f32]) -> Self {
        let matrix = |row: &[f32], joint: usize| Mat3::from_quat(rotation(row, joint));
        let rows = || x.chunks_exact(FEATURES).zip(decoded.chunks_exact(FEATURES));
        Self {
            turns: rows()
                .map(|(own, out)| std::array::from_fn(|j| matrix(own, j) * matrix(out, j).transpose()))
                .collect(),
            shifts: rows()
                .map(|(own, out)| std::array::from_fn(|i| own[HEIGHT + i] - out[HEIGHT + i]))
                .collect(),
        }
    }

    fn apply(&self, decoded: &[f32], x: &mut Vec<f32>) {
        x.clear();
        x.extend_from_slice(decoded);
        for (row, (turns, shifts)) in x.chunks_exact_mut(FEATURES).zip(self.turns.iter().zip(&self.shifts)) {
            for (joint, turn) in turns.iter().enumerate() {
                turn_columns(&mut row[rotation_range(joint)], turn);
            }
            for (value, shift) in row[HEIGHT..STEP.end].iter_mut().zip(shifts) {
                *value += shift;
            }
        }
    }

    /// From the gradient by the carried X to that by the decoder's. The contacts are left as they are.
    fn pull_back(&self, d_x: &mut [f32]) {
        for (row, turns) in d_x.chunks_exact_mut(FEATURES).zip(&self.turns) {
            for (joint, turn) in turns.iter().enumerate() {
                turn_columns(&mut row[rotation_range(joint)], &turn.transpose());
            }
            row[CONTACTS].fill(0.0);
        }
    }
}

fn turn_columns(numbers: &mut [f32], turn: &Mat3) {
    for column in numbers.chunks_exact_mut(3) {
        let turned = *turn * Vec3::new(column[0], column[1], column[2]);
        column.copy_from_slice(&turned.to_array());
    }
}

/// Buffers of one evaluation.
#[derive(Default)]
struct Pass {
    x: Vec<f32>,
    kinematics: Kinematics,
    d_positions: Vec<[Vec3; JOINT_COUNT]>,
    d_rotations: Vec<[Mat3; JOINT_COUNT]>,
    d_x: Vec<f32>,
}

/// L = w_p·L_pos + w_f·L_foot + w_r·L_root, and ours: w_s times the second differences of what is changed in X's rotations.
/// Means where the paper has sums, so that one pinned frame weighs as much as a long path.
struct Loss<'a> {
    targets: Vec<Target>,
    feet: Vec<FootPlaces>,
    root: Vec<Vec2>,
    /// X of the motion before.
    x: Vec<f32>,
    settings: &'a EditorSettings,
}

/// a·bᵀ: the gradient by R of a point R·b, where that by the point is a.
fn outer(a: Vec3, b: Vec3) -> Mat3 {
    Mat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// How far the targets are missed, metres (a radian of rotation counts as 20 cm).
struct Miss {
    mean: f32,
    largest: f32,
}

const RADIAN: f32 = 0.2;

impl Target {
    /// Where the point that it places is.
    fn point(&self, k: &Kinematics) -> Vec3 {
        let joint = self.joint.index();
        k.positions[self.frame][joint] + k.rotations[self.frame][joint] * self.offset
    }
}

impl Loss<'_> {
    fn miss(&self, k: &Kinematics) -> Miss {
        let (mut sum, mut largest) = (0.0, 0.0f32);
        for t in &self.targets {
            let joint = t.joint.index();
            let place = t.position.map_or(0.0, |p| p.distance(t.point(k)));
            let turn = t.rotation.map_or(0.0, |r| (squared(&(k.rotations[t.frame][joint] - r)) / 2.0).sqrt());
            let miss = place.max(RADIAN * turn);
            sum += miss;
            largest = largest.max(miss);
        }
        Miss { mean: sum / self.targets.len().max(1) as f32, largest }
    }

    /// L at the carried X of `pass`.
    #[cfg(test)]
    fn value(&self, k: &Kinematics, x: &[f32]) -> f64 {
        let s = self.settings;
        let (targets, frames) = (self.targets.len() as f64, self.root.len() as f64);
        let mut sum = 0.0;
        for t in &self.targets {
            let joint = t.joint.index();
            let place = t.position.map_or(0.0, |p| p.distance_squared(t.point(k)));
            let turn = t
                .rotation
                .map_or(0.0, |r| RADIAN * RADIAN * squared(&(k.rotations[t.frame][joint] - r)) / 2.0);
            sum += f64::from(s.w_pos * (place + turn)) / targets;
        }
        for (f, feet) in self.feet.iter().enumerate() {
            for (joint, place) in FOOT_JOINTS.iter().zip(feet) {
                sum += f64::from(s.w_foot * place.distance_squared(k.positions[f][joint.index()]))
                    / (4.0 * frames);
            }
        }
        let off = |f: usize| k.positions[f][0].truncate() - self.root[f];
        for f in 0..self.root.len() {
            sum += f64::from(s.w_root * off(f).length_squared()) / frames;
            if f > 0 {
                sum += f64::from(s.w_root_velocity * (off(f) - off(f - 1)).length_squared()) / frames;
            }
        }
        for (row, feature) in self.curved() {
            sum += f64::from(s.w_smooth * self.bend(x, row, feature).powi(2)) / frames;
        }
        sum
    }

    /// Every second difference that L counts: its first row, and the feature.
    fn curved(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        (0..self.root.len().saturating_sub(2)).flat_map(|row| ROTATIONS.map(move |feature| (row, feature)))
    }

    fn bend(&self, x: &[f32], row: usize, feature: usize) -> f32 {
        let change = |d: usize| {
            let at = (row + d) * FEATURES + feature;
            x[at] - self.x[at]
        };
        change(0) - 2.0 * change(1) + change(2)
    }

    /// The gradient of L by X, into `pass.d_x`.
    fn gradient(&self, pass: &mut Pass) {
        let s = self.settings;
        let frames = self.root.len();
        let k = &pass.kinematics;
        pass.d_positions.clear();
        pass.d_positions.resize(frames, [Vec3::ZERO; JOINT_COUNT]);
        pass.d_rotations.clear();
        pass.d_rotations.resize(frames, [Mat3::ZERO; JOINT_COUNT]);
        let scale = 2.0 * s.w_pos / self.targets.len().max(1) as f32;
        for t in &self.targets {
            let joint = t.joint.index();
            if let Some(place) = t.position {
                let d_point = scale * (t.point(k) - place);
                pass.d_positions[t.frame][joint] += d_point;
                pass.d_rotations[t.frame][joint] += outer(d_point, t.offset);
            }
            if let Some(rotation) = t.rotation {
                pass.d_rotations[t.frame][joint] +=
                    (k.rotations[t.frame][joint] - rotation) * (scale * RADIAN * RADIAN / 2.0);
            }
        }
        let scale = 2.0 * s.w_foot / (4 * frames) as f32;
        for (f, feet) in self.feet.iter().enumerate() {
            for (joint, place) in FOOT_JOINTS.iter().zip(feet) {
                pass.d_positions[f][joint.index()] += scale * (k.positions[f][joint.index()] - *place);
            }
        }
        let off = |f: usize| k.positions[f][0].truncate() - self.root[f];
        let share = 2.0 / frames as f32;
        for f in 0..frames {
            pass.d_positions[f][0] += (off(f) * (share * s.w_root)).extend(0.0);
            if f > 0 {
                let d = ((off(f) - off(f - 1)) * (share * s.w_root_velocity)).extend(0.0);
                pass.d_positions[f][0] += d;
                pass.d_positions[f - 1][0] -= d;
            }
        }
        pass.d_x.clear();
        pass.d_x.resize(frames * FEATURES, 0.0);
        let scale = 2.0 * s.w_smooth / frames as f32;
        for (row, feature) in self.curved() {
            let at = |d: usize| (row + d) * FEATURES + feature;
            let bend = scale * self.bend(&pass.x, row, feature);
            pass.d_x[at(0)] += bend;
            pass.d_x[at(1)] -= 2.0 * bend;
            pass.d_x[at(2)] += bend;
        }
        k.backward(&pass.x, &pass.d_positions, Some(&pass.d_rotations), &mut pass.d_x);
    }
}

fn squared(m: &Mat3) -> f32 {
    m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()
}

impl Decoder for Manifold {
    type Work = DecoderWorkspace;

    fn encode(&self, x: &[f32]) -> Vec<f32> {
        Manifold::encode(self, x)
    }

    fn decode<'w>(&self, z: &[f32], work: &'w mut DecoderWorkspace) -> &'w [f32] {
        Manifold::decode(self, z, work)
    }

    fn backward<'w>(&self, d_x: &[f32], work: &'w mut DecoderWorkspace) -> &'w [f32] {
        Manifold::backward(self, d_x, work)
    }
}

/// How far a motion on a floor at z = 0 is from the manifold, cm: the mean distance of its joints from those of
/// Ψ⁻¹(Ψ(X)), over the frames of `span` (LAMA, ‖X - Ψ⁻¹(Ψ(X))‖, in a unit that can be seen).
pub fn manifold_distance<D: Decoder>(decoder: &D, motion: &Motion, span: &Range<usize>) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0usize);
    let mut work = D::Work::default();
    let mut kinematics = [Kinematics::default(), Kinematics::default()];
    for first in windows(span, motion.len()) {
        let held = |frame: usize| (first + frame).min(motion.len() - 1);
        let window = Motion {
            postures: (0..WINDOW).map(|f| motion.postures[held(f)]).collect(),
            contacts: (0..WINDOW).map(|f| motion.contacts[held(f)]).collect(),
        };
        let (x, _) = from_motion(&window);
        let z = decoder.encode(&x);
        kinematics[0].forward(&x, RootPath::Centred);
        kinematics[1].forward(decoder.decode(&z, &mut work), RootPath::Centred);
        for frame in (0..WINDOW).filter(|f| span.contains(&(first + f))) {
            for joint in 0..JOINT_COUNT {
                let [own, out] = [0, 1].map(|i| kinematics[i].positions[frame][joint]);
                sum += f64::from(own.distance(out));
                count += 1;
            }
        }
    }
    (100.0 * sum / count.max(1) as f64) as f32
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    /// X = mean + B·z with B orthonormal columns: what it says of a motion is known.
    pub(crate) struct Linear {
        columns: Vec<Vec<f32>>,
    }

    impl Linear {
        pub(crate) fn new(count: usize, seed: u64) -> Self {
            let mut rng = Pcg32::seed_from_u64(seed);
            let size = WINDOW * FEATURES;
            let mut columns: Vec<Vec<f32>> = Vec::new();
            for _ in 0..count {
                // Smooth over time: a random cosine for every feature.
                let mut column = vec![0.0; size];
                for i in 0..FEATURES {
                    let (rate, phase, size): (f32, f32, f32) =
                        (rng.random_range(0.0..0.1), rng.random_range(0.0..6.0), rng.random_range(-1.0..1.0));
                    for f in 0..WINDOW {
                        column[f * FEATURES + i] = size * (rate * f as f32 + phase).cos();
                    }
                }
                for other in &columns {
                    let along: f32 = column.iter().zip(other).map(|(a, b)| a * b).sum();
                    column.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
                }
                let length = column.iter().map(|a| a * a).sum::<f32>().sqrt();
                column.iter_mut().for_each(|a| *a /= length);
                columns.push(column);
            }
            Self { columns }
        }
    }

    impl Decoder for Linear {
        type Work = (Vec<f32>, Vec<f32>);

        fn encode(&self, x: &[f32]) -> Vec<f32> {
            self.columns.iter().map(|c| c.iter().zip(x).map(|(a, b)| a * b).sum()).collect()
        }

        fn decode<'w>(&self, z: &[f32], work: &'w mut Self::Work) -> &'w [f32] {
            work.0.clear();
            work.0.resize(WINDOW * FEATURES, 0.0);
            for (column, z) in self.columns.iter().zip(z) {
                work.0.iter_mut().zip(column).for_each(|(x, c)| *x += z * c);
            }
            // Away from degenerate rotations.
            for row in work.0.chunks_exact_mut(FEATURES) {
                for joint in 0..JOINT_COUNT {
                    row[rotation_range(joint)][0] += 1.0;
                    row[rotation_range(joint)][4] += 1.0;
                }
            }
            &work.0
        }

        fn backward<'w>(&self, d_x: &[f32], work: &'w mut Self::Work) -> &'w [f32] {
            work.1 = self.encode(d_x);
            &work.1
        }
    }

    fn standing(frames: usize) -> Motion {
        Motion { postures: vec![Posture::default(); frames], contacts: vec![[1.0, 1.0]; frames] }
    }

    fn places(motion: &Motion) -> Vec<FootPlaces> {
        motion.postures.iter().map(|p| FOOT_JOINTS.map(|j| p.pose().position(j))).collect()
    }

    #[test]
    fn gradient_by_z_agrees_with_finite_differences() {
        // Through Gram-Schmidt, the carrying, the kinematics and every term of L.
        let at = |frame, joint: Joint, offset, rotation| Target {
            frame,
            joint,
            offset,
            position: Some(Vec3::ONE),
            rotation,
        };
        let turned = Some(Mat3::from_rotation_x(0.4));
        let targets = vec![
            at(40, Joint::LeftHand, Vec3::ZERO, turned),
            at(60, Joint::RightHand, Vec3::new(-0.4, 0.2, 0.3), None),
            at(90, Joint::Hips, Vec3::ZERO, None),
        ];
        gradient_agrees(targets.clone(), EditorSettings::default(), 0.1);
        // Each term by itself, or the larger ones would hide what is wrong with the smaller.
        let nothing = EditorSettings {
            w_pos: 0.0,
            w_foot: 0.0,
            w_root: 0.0,
            w_root_velocity: 0.0,
            w_smooth: 0.0,
            ..EditorSettings::default()
        };
        let rotation = targets.iter().map(|t| Target { position: None, rotation: turned, ..*t }).collect();
        gradient_agrees(rotation, EditorSettings { w_pos: 100.0, ..nothing.clone() }, 0.01);
        gradient_agrees(targets.clone(), EditorSettings { w_pos: 7.0, ..nothing.clone() }, 0.05);
        gradient_agrees(targets.clone(), EditorSettings { w_foot: 100.0, ..nothing.clone() }, 0.05);
        gradient_agrees(targets.clone(), EditorSettings { w_root: 100.0, ..nothing.clone() }, 0.05);
        gradient_agrees(targets.clone(), EditorSettings { w_root_velocity: 1e4, ..nothing.clone() }, 0.01);
        gradient_agrees(targets, EditorSettings { w_smooth: 1e6, ..nothing }, 0.01);
    }

    /// `small`: a derivative of this size is compared in absolute terms.
    fn gradient_agrees(targets: Vec<Target>, settings: EditorSettings, small: f64) {
        let decoder = Linear::new(12, 1);
        let motion = standing(WINDOW);
        let (x, start) = from_motion(&motion);
        let root = motion.postures.iter().map(|p| p.root_position.truncate() + 0.02).collect();
        let loss = Loss { targets, feet: places(&motion), root, x: x.clone(), settings: &settings };
        let mut work = <Linear as Decoder>::Work::default();
        let mut z = decoder.encode(&x);
        let carried = Carried::new(&x, decoder.decode(&z, &mut work));
        z.iter_mut().enumerate().for_each(|(i, z)| *z += 0.4 * (i as f32).sin());
        let mut pass = Pass::default();
        let mut value = |z: &[f32], pass: &mut Pass| {
            carried.apply(decoder.decode(z, &mut work), &mut pass.x);
            pass.kinematics.forward(&pass.x, RootPath::From(start));
            loss.value(&pass.kinematics, &pass.x)
        };
        value(&z, &mut pass);
        loss.gradient(&mut pass);
        carried.pull_back(&mut pass.d_x);
        let d_z = decoder.encode(&pass.d_x);
        let mut largest = 0.0f64;
        for i in 0..z.len() {
            let (saved, h) = (z[i], 2e-2);
            z[i] = saved + h;
            let up = value(&z, &mut pass);
            z[i] = saved - h;
            let down = value(&z, &mut pass);
            z[i] = saved;
            let numeric = (up - down) / f64::from(2.0 * h);
            let analytic = f64::from(d_z[i]);
            largest = largest.max(numeric.abs());
            let off = (numeric - analytic).abs();
            assert!(off < 2e-2 * (small + analytic.abs()), "{settings:?} {i}: {numeric} {analytic}");
        }
        assert!(largest > small, "{settings:?}: {largest}");
    }

    #[test]
    fn where_two_windows_meet_each_counts_by_how_far_it_is_from_its_end() {
        /// Lifts the whole window by z, and nothing else.
        struct Lift(Vec<f32>);
        impl Decoder for Lift {
            type Work = (Vec<f32>, Vec<f32>);
            fn encode(&self, _: &[f32]) -> Vec<f32> {
                vec![0.0]
            }
            fn decode<'w>(&self, z: &[f32], work: &'w mut Self::Work) -> &'w [f32] {
                work.0.clone_from(&self.0);
                work.0.chunks_exact_mut(FEATURES).for_each(|row| row[HEIGHT] += z[0]);
                &work.0
            }
            fn backward<'w>(&self, d_x: &[f32], work: &'w mut Self::Work) -> &'w [f32] {
                work.1 = vec![d_x.chunks_exact(FEATURES).map(|row| row[HEIGHT]).sum()];
                &work.1
            }
        }
        let motion = standing(400);
        let decoder = Lift(from_motion(&standing(WINDOW)).0);
        let span = 20..WINDOW + 60;
        let first = windows(&span, 400);
        assert_eq!(first.len(), 2);
        let root = motion.postures[0].root_position;
        let lifted =
            |frame: usize, by: f32| Target { joint: Joint::Hips, ..hand_at(frame, root + Vec3::Z * by) };
        // One target in each window alone: 5 cm up and 3 cm down.
        let targets = [lifted(first[0] + 5, 0.05), lifted(first[1] + WINDOW - 5, -0.03)];
        let settings = EditorSettings {
            w_foot: 0.0,
            w_root: 0.0,
            w_root_velocity: 0.0,
            w_smooth: 0.0,
            met: 1e-4,
            ..EditorSettings::default()
        };
        let feet = places(&motion);
        let wanted = Search {
            motion: &motion,
            span: span.clone(),
            targets: &targets,
            feet: &feet,
            settings: &settings,
        };
        let (out, figures) = search(&decoder, &wanted, &Progress::new()).unwrap();
        assert_eq!(figures.windows, 2);
        assert!((figures.before_cm - 4.0).abs() < 1e-3 && figures.after_cm < 0.1, "{figures:?}");
        for frame in span {
            let weight = |window: usize| {
                let at = frame as f32 - first[window] as f32 + 0.5;
                if (0.0..WINDOW as f32).contains(&at) {
                    (at.min(WINDOW as f32 - at) / 40.0).min(1.0)
                } else {
                    0.0
                }
            };
            let expected = (0.05 * weight(0) - 0.03 * weight(1)) / (weight(0) + weight(1));
            let found = out.postures[frame].root_position.z - root.z;
            assert!((found - expected).abs() < 6e-3, "{frame}: {found} {expected}");
        }
    }

    fn hand_at(frame: usize, place: Vec3) -> Target {
        let (joint, offset) = (Joint::LeftHand, Vec3::ZERO);
        Target { frame, joint, offset, position: Some(place), rotation: None }
    }

    #[test]
    fn a_target_that_is_met_changes_nothing() {
        let motion = standing(150);
        let place = motion.postures[0].pose().position(Joint::LeftHand);
        let targets = [hand_at(70, place)];
        let (feet, settings) = (places(&motion), EditorSettings::default());
        let wanted =
            Search { motion: &motion, span: 40..100, targets: &targets, feet: &feet, settings: &settings };
        let (out, figures) = search(&Linear::new(8, 2), &wanted, &Progress::new()).unwrap();
        assert_eq!(figures.steps, 0);
        for (a, b) in motion.postures.iter().zip(&out.postures) {
            assert!(a.root_position.distance(b.root_position) < 1e-4);
        }
    }

    #[test]
    fn the_search_comes_nearer_and_leaves_the_rest_alone() {
        let motion = standing(200);
        let place = motion.postures[0].pose().position(Joint::LeftHand) + Vec3::new(-0.05, -0.1, 0.05);
        let targets = [hand_at(90, place)];
        let (feet, settings) =
            (places(&motion), EditorSettings { learning_rate: 0.02, ..Default::default() });
        let wanted =
            Search { motion: &motion, span: 60..120, targets: &targets, feet: &feet, settings: &settings };
        let (out, figures) = search(&Linear::new(200, 3), &wanted, &Progress::new()).unwrap();
        assert!(figures.after_cm < 0.5 * figures.before_cm, "{figures:?}");
        assert_eq!(out.postures[..60], motion.postures[..60]);
        assert_eq!(out.postures[120..], motion.postures[120..]);
    }

    #[test]
    fn windows_cover_a_span_and_stay_within_the_motion() {
        for (span, frames) in
            [(0..30, 30), (100..190, 200), (0..300, 300), (50..420, 500), (180..200, 200), (3..140, 150)]
        {
            let first = windows(&span, frames);
            for frame in span.clone() {
                assert!(first.iter().any(|f| (*f..f + WINDOW).contains(&frame)), "{span:?} {first:?}");
            }
            assert!(first.iter().all(|f| *f == 0 || f + WINDOW <= frames), "{first:?}");
        }
    }

    #[test]
    fn postures_mix_on_the_shorter_way() {
        let mut a = Posture::default();
        let mut b = a;
        b.root_position.x = 1.0;
        a.rotations[4] = glam::Quat::from_rotation_z(0.2);
        b.rotations[4] = -glam::Quat::from_rotation_z(0.6);
        let half = mix(&a, &b, 0.25);
        assert!((half.root_position.x - 0.25).abs() < 1e-6);
        assert!(half.rotations[4].dot(glam::Quat::from_rotation_z(0.3)).abs() > 0.999_99);
        assert!(mix(&a, &b, 0.0).rotations[4].dot(a.rotations[4]) > 0.999_99);
    }

    #[test]
    fn what_trembles_is_filtered_and_what_stays_is_not() {
        let before = standing(60);
        let mut found = before.clone();
        for f in 10..50 {
            // A steady shift and turn, and a tremble from frame to frame.
            let tremble = if f % 2 == 0 { 0.01 } else { -0.01 };
            found.postures[f].root_position += Vec3::new(0.1, tremble, 0.0);
            found.postures[f].rotations[6] = glam::Quat::from_rotation_x(0.2 + tremble);
        }
        filter_changes(&before, &mut found, &(10..50));
        for f in 10..50 {
            let p = &found.postures[f];
            assert!((p.root_position.x - 0.1).abs() < 1e-5, "{}", p.root_position);
            let at_an_end = !(19..41).contains(&f);
            assert!(
                p.root_position.y.abs() < if at_an_end { 6e-3 } else { 1e-4 },
                "{f}: {}",
                p.root_position.y
            );
            let turn = to_angle_axis(p.rotations[6]);
            assert!((turn.x - 0.2).abs() < 6e-3 && turn.y.abs() + turn.z.abs() < 1e-5);
        }
        assert_eq!(found.postures[9], before.postures[9]);
        // One frame's change becomes a bell of σ = 3 frames.
        let mut found = before.clone();
        found.postures[30].root_position.z += 1.0;
        filter_changes(&before, &mut found, &(10..50));
        let bell: f32 = (-9..=9).map(|d| (-(d * d) as f32 / 18.0).exp()).sum();
        for d in [0, 2, 5] {
            let z = found.postures[30 + d].root_position.z - before.postures[0].root_position.z;
            assert!((z - (-((d * d) as f32) / 18.0).exp() / bell).abs() < 1e-4, "{d}: {z}");
        }
    }

    #[test]
    fn windows_by_hand() {
        // Within one window: about the middle of the span. Longer: from half an overlap before to half after, evenly.
        assert_eq!(windows(&(100..140), 400), [120 - WINDOW / 2]);
        assert_eq!(windows(&(0..10), 400), [0]);
        assert_eq!(windows(&(390..400), 400), [400 - WINDOW]);
        let long = windows(&(100..400), 600);
        assert_eq!((long[0], long[long.len() - 1]), (80, 420 - WINDOW));
        let step = WINDOW - OVERLAP;
        assert_eq!(long.len(), (long[long.len() - 1] - 80).div_ceil(step) + 1);
        assert!(long.windows(2).all(|w| w[1] - w[0] <= step));
    }

    #[test]
    fn misses_by_hand() {
        let motion = standing(WINDOW);
        let (x, start) = from_motion(&motion);
        let mut kinematics = Kinematics::default();
        kinematics.forward(&x, RootPath::From(start));
        let hand = motion.postures[0].pose().position(Joint::LeftHand);
        let target = |frame, away: Vec3, turn: f32| Target {
            frame,
            joint: Joint::LeftHand,
            offset: Vec3::ZERO,
            position: Some(hand + away),
            rotation: Some(Mat3::from_rotation_y(turn)),
        };
        let settings = EditorSettings::default();
        let targets =
            vec![target(3, Vec3::X * 0.03, 0.0), target(5, Vec3::ZERO, 0.3), target(9, Vec3::X * 0.01, 0.1)];
        let root = motion.postures.iter().map(|p| p.root_position.truncate()).collect();
        let loss = Loss { targets, feet: places(&motion), root, x, settings: &settings };
        let miss = loss.miss(&kinematics);
        // 3 cm; 0.3 rad, which is 2·sin(0.15)·0.2 m; the larger of 1 cm and 2·sin(0.05)·0.2 m.
        let parts = [0.03, 0.4 * 0.15f32.sin(), 0.4 * 0.05f32.sin()];
        let mean = parts.iter().sum::<f32>() / 3.0;
        assert!((miss.mean - mean).abs() < 1e-4, "{} {mean}", miss.mean);
        assert!((miss.largest - parts[1]).abs() < 1e-4);
        assert_eq!(squared(&Mat3::from_cols(Vec3::X, Vec3::Y * 2.0, Vec3::ONE)), 8.0);
        let m = outer(Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0));
        assert_eq!(m.col(1), Vec3::new(5.0, 10.0, 15.0));
    }

    #[test]
    fn a_motion_that_the_decoder_says_is_on_the_manifold() {
        struct Says(Vec<f32>);
        impl Decoder for Says {
            type Work = Vec<f32>;
            fn encode(&self, _: &[f32]) -> Vec<f32> {
                vec![0.0]
            }
            fn decode<'w>(&self, _: &[f32], work: &'w mut Vec<f32>) -> &'w [f32] {
                work.clone_from(&self.0);
                work
            }
            fn backward<'w>(&self, _: &[f32], work: &'w mut Vec<f32>) -> &'w [f32] {
                work
            }
        }
        let motion = standing(WINDOW);
        let (x, _) = from_motion(&motion);
        assert!(manifold_distance(&Says(x.clone()), &motion, &(10..20)) < 1e-3);
        // Four centimetres higher on every frame.
        let mut higher = x;
        higher.chunks_exact_mut(FEATURES).for_each(|row| row[HEIGHT] += 0.04);
        let distance = manifold_distance(&Says(higher), &motion, &(10..20));
        assert!((distance - 4.0).abs() < 1e-3, "{distance}");
    }
}
