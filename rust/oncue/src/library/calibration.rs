//! How a file's joints are turned against ours, measured from the motion itself.
//!
//! For each of our joints a constant rotation C takes our rest frame to the frame of the file's joint, so
//! that our global rotation is R·C with the file's R. No rest pose is used, so it does not matter whether
//! the rest pose is a T-pose (ACCAD's and Bandai's are not). Instead:
//!
//! - limbs: the bone's direction in its joint's frame is exact; the twist about it comes from the hinge of
//!   the knee or elbow, the mean of thigh × shin over the frames, weighted by how much the hinge bends;
//! - pelvis: left is the line through the hip joints; up is the mean vertical of upright frames;
//! - spine, neck, head, collar bones: on average over upright frames they are as at rest, and the spine
//!   leans by the angle at which the shoulders stand before the hips;
//! - feet: flat, and pointing from ankle to toe, in the frames where they are low and still.

use glam::{DVec2, DVec3, Mat3, Quat, Vec2, Vec3};

use super::sampler::Sampler;
use crate::motion::skeleton::{JOINT_COUNT, LEG_LENGTH};
use crate::motion::{FRAME_RATE, Joint};

use Joint::*;

/// Sums over frames, of one file or of all files with one skeleton.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sums {
    /// Σ w R⁻¹ · (left, back, up) of the frame that the joint stands for.
    frames: [[DVec3; 3]; JOINT_COUNT],
    spine: Vec<[DVec3; 3]>,
    /// Σ R⁻¹ · direction of the bone.
    bones: [DVec3; JOINT_COUNT],
    /// Σ w R⁻¹ · hinge axis.
    hinges: [DVec3; JOINT_COUNT],
    /// Σ w · direction from the hips to the shoulders, seen from the pelvis' heading.
    trunk: DVec3,
    /// Columns of Σ R_hand⁻¹ R_forearm.
    hands: [[DVec3; 3]; 2],
    pub floor: FloorSums,
}

/// Second moments of where flat feet stand, each file about its own mean: the slope of the captured floor.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct FloorSums {
    xx: f64,
    xy: f64,
    yy: f64,
    zx: f64,
    zy: f64,
}

/// How much the floor's slope clings to what is expected, m² · frames.
const FLOOR_PRIOR: f64 = 10.0;
/// A steeper floor is a ramp that was walked on, not a tilted capture.
const STEEPEST_FLOOR: f32 = 0.035;

impl FloorSums {
    fn add_points(&mut self, points: &[Vec3]) {
        let mean = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
        for p in points {
            let d = (*p - mean).as_dvec3();
            self.xx += d.x * d.x;
            self.xy += d.x * d.y;
            self.yy += d.y * d.y;
            self.zx += d.z * d.x;
            self.zy += d.z * d.y;
        }
    }

    fn add(&mut self, other: &FloorSums) {
        self.xx += other.xx;
        self.xy += other.xy;
        self.yy += other.yy;
        self.zx += other.zx;
        self.zy += other.zy;
    }

    /// Slope (dz/dx, dz/dy) by least squares, drawn towards `expected`.
    pub(crate) fn slope(&self, expected: Vec2) -> Vec2 {
        let e = expected.as_dvec2();
        let (a, b, c) = (self.xx + FLOOR_PRIOR, self.xy, self.yy + FLOOR_PRIOR);
        let r = DVec2::new(self.zx, self.zy) + FLOOR_PRIOR * e;
        let slope = (DVec2::new(c * r.x - b * r.y, a * r.y - b * r.x) / (a * c - b * b)).as_vec2();
        if slope.length() < STEEPEST_FLOOR { slope } else { Vec2::ZERO }
    }
}

impl Sums {
    pub(crate) fn add(&mut self, other: &Sums) {
        for (a, b) in self.frames.iter_mut().flatten().zip(other.frames.iter().flatten()) {
            *a += *b;
        }
        if self.spine.len() < other.spine.len() {
            self.spine.resize(other.spine.len(), Default::default());
        }
        for (a, b) in self.spine.iter_mut().flatten().zip(other.spine.iter().flatten()) {
            *a += *b;
        }
        for (a, b) in self.bones.iter_mut().zip(&other.bones).chain(self.hinges.iter_mut().zip(&other.hinges))
        {
            *a += *b;
        }
        for (a, b) in self.hands.iter_mut().flatten().zip(other.hands.iter().flatten()) {
            *a += *b;
        }
        self.trunk += other.trunk;
        self.floor.add(&other.floor);
    }
}

/// How many flat-footed frames, and how much bending, the group's measure counts for beside a file's own.
const FOOT_PRIOR: f64 = 6.0;
const HINGE_PRIOR: f64 = 3.0;

impl Sums {
    /// The sums that a file is calibrated by: the group's for trunk and head, so that one stooping take is not
    /// straightened; its own for feet and hinges, which sit differently from session to session, with the group's
    /// to fall back on.
    pub(crate) fn with_group(&self, group: &Sums) -> Sums {
        let mut out = group.clone();
        for joint in [LeftFoot, LeftToe, RightFoot, RightToe] {
            let (own, group) = (&self.frames[joint.index()], &group.frames[joint.index()]);
            let share = FOOT_PRIOR / group[2].length().max(1e-9);
            out.frames[joint.index()] = [0, 1, 2].map(|i| own[i] + group[i] * share);
        }
        for joint in HINGES.into_iter().flat_map(|[first, second, _]| [first, second]) {
            let i = joint.index();
            let share = HINGE_PRIOR / group.hinges[i].length().max(1e-9);
            out.hinges[i] = self.hinges[i] + group.hinges[i] * share;
            out.bones[i] = self.bones[i];
        }
        out
    }
}

/// Thigh and shin, upper arm and forearm of each side, with the end of the second bone.
const HINGES: [[Joint; 3]; 4] = [
    [LeftUpLeg, LeftLeg, LeftFoot],
    [RightUpLeg, RightLeg, RightFoot],
    [LeftArm, LeftForeArm, LeftHand],
    [RightArm, RightForeArm, RightHand],
];

/// What one frame of the file shows, kept for the second pass.
struct Seen {
    feet: [Vec3; 2],
    toes: [Vec3; 2],
}

/// Measures the sums of one file.
pub(crate) fn measure(sampler: &mut Sampler) -> Sums {
    let s = sampler;
    let count = s.frame_count();
    let mut seen = Vec::with_capacity(count);
    let mut headings: Vec<f32> = Vec::with_capacity(count);
    for frame in 0..count {
        s.sample(frame);
        seen.push(Seen { feet: Joint::FEET.map(|j| s.at(j)), toes: [s.toe(0), s.toe(1)] });
        let left = s.at(LeftUpLeg) - s.at(RightUpLeg);
        headings.push(left.y.atan2(left.x));
    }
    let ends = |frame: usize| (frame.saturating_sub(1), (frame + 1).min(count - 1));
    let speed = |frame: usize, side: usize| {
        let (a, b) = ends(frame);
        let feet = seen[a].feet[side].distance(seen[b].feet[side]);
        feet.max(seen[a].toes[side].distance(seen[b].toes[side])) * FRAME_RATE / (b - a).max(1) as f32
    };
    let mut floor = FloorSums::default();
    let still: Vec<Vec3> = (0..count)
        .flat_map(|frame| [0, 1].map(|side| (frame, side)))
        .filter(|&(frame, side)| speed(frame, side) < 0.15)
        .map(|(frame, side)| seen[frame].feet[side])
        .collect();
    floor.add_points(&still);
    let slope = floor.slope(Vec2::ZERO);
    let height = |p: Vec3| p.z - slope.dot(p.truncate());
    let lowest = |points: fn(&Seen, usize) -> Vec3, side: usize| {
        let mut heights: Vec<f32> = seen.iter().map(|x| height(points(x, side))).collect();
        heights.sort_unstable_by(f32::total_cmp);
        heights[heights.len() / 20]
    };
    let low: [[f32; 2]; 2] =
        [0, 1].map(|side| [lowest(|x, s| x.feet[s], side), lowest(|x, s| x.toes[s], side)]);
    let mut sums = Sums { spine: vec![Default::default(); s.table.spine.len()], floor, ..Default::default() };
    for (frame, here) in seen.iter().enumerate() {
        s.sample(frame);
        let (a, b) = ends(frame);
        let seconds = (b - a).max(1) as f32 / FRAME_RATE;
        let turn = crate::math::rotation::wrap_angle(headings[b] - headings[a]) / seconds;
        add_upright(&mut sums, s, turn);
        add_hinges(&mut sums, s);
        for (side, low) in low.iter().enumerate() {
            let speed = speed(frame, side);
            let rise = (height(here.feet[side]) - low[0]).abs() + (height(here.toes[side]) - low[1]).abs();
            let weight = (-(rise / 0.015).powi(2) - (speed / 0.15).powi(2)).exp() + 1e-9;
            add_flat_foot(&mut sums, s, side, weight);
        }
    }
    sums
}

/// Adds w R⁻¹ · axes to the three sums.
fn add_frame(sum: &mut [DVec3; 3], rotation: Quat, axes: [Vec3; 3], weight: f32) {
    for (sum, axis) in sum.iter_mut().zip(axes) {
        *sum += (rotation.inverse() * axis * weight).as_dvec3();
    }
}

/// Left (kept level with `level`), back and up of a body part whose left side lies along `left`.
fn axes(left: Vec3, level: bool) -> Option<[Vec3; 3]> {
    let left = if level { Vec3::new(left.x, left.y, 0.0) } else { left }.try_normalize()?;
    let back = Vec3::Z.cross(left).try_normalize()?;
    Some([left, back, left.cross(back)])
}

fn add_upright(sums: &mut Sums, s: &Sampler, turn: f32) {
    let hips_left = s.at(LeftUpLeg) - s.at(RightUpLeg);
    let chest_left = s.at(LeftArm) - s.at(RightArm);
    let hip_middle = (s.at(LeftUpLeg) + s.at(RightUpLeg)) / 2.0;
    let trunk = ((s.at(LeftArm) + s.at(RightArm)) / 2.0 - hip_middle).normalize_or_zero();
    let lean = trunk.z.clamp(-1.0, 1.0).acos();
    let leg = |hip: Joint, ankle: Joint| s.at(hip).distance(s.at(ankle)) / (2.0 * LEG_LENGTH);
    let stretched =
        ((leg(LeftUpLeg, LeftFoot).min(leg(RightUpLeg, RightFoot)) - 0.75) / 0.25).clamp(0.0, 1.0);
    let weight =
        (-(lean / 0.25).powi(2)).exp() * (stretched * stretched + 1e-3) / (1.0 + (turn / 0.7).powi(2)) + 1e-9;

    let (Some(pelvis), Some(chest)) = (axes(hips_left, false), axes(chest_left, false)) else { return };
    let (Some(pelvis_level), Some(chest_level)) = (axes(hips_left, true), axes(chest_left, true)) else {
        return;
    };
    let part = |sums: &mut Sums, joint: Joint, axes: [Vec3; 3]| {
        if let Some(rotation) = s.rotation(joint) {
            add_frame(&mut sums.frames[joint.index()], rotation, axes, weight);
        }
    };
    part(sums, Hips, pelvis);
    part(sums, Neck, chest_level);
    part(sums, Head, chest_level);
    part(sums, LeftShoulder, chest);
    part(sums, RightShoulder, chest);
    let n = s.table.spine.len();
    for (i, &joint) in s.table.spine.iter().enumerate() {
        let u = (i + 1) as f32 / n as f32;
        let left = pelvis_level[0].lerp(chest_level[0], u);
        let axes = if i + 1 == n { Some(chest) } else { axes(left, true) };
        if let Some(axes) = axes {
            add_frame(&mut sums.spine[i], s.pose.rotations[joint], axes, weight);
        }
    }
    let local = Vec3::new(trunk.dot(pelvis_level[0]), trunk.dot(pelvis_level[1]), trunk.z);
    sums.trunk += (local * weight).as_dvec3();
    // Where the hinges hardly bend, knees point forward and hanging elbows back.
    for [first, second, _] in HINGES {
        let axis = if matches!(first, LeftUpLeg | RightUpLeg) { pelvis[0] } else { -chest[0] };
        for joint in [first, second] {
            if let Some(rotation) = s.rotation(joint) {
                sums.hinges[joint.index()] += (rotation.inverse() * axis * (0.02 * weight)).as_dvec3();
            }
        }
    }
}

fn add_hinges(sums: &mut Sums, s: &Sampler) {
    for (i, [first, second, third]) in HINGES.into_iter().enumerate() {
        let (Some(a), Some(b)) = (s.rotation(first), s.rotation(second)) else { continue };
        let end = match s.position(third) {
            Some(end) => end,
            None => {
                let index = s.table.get(second).unwrap_or_default();
                s.at(second) + b * (s.file().joints[index].end_site.unwrap_or_default() * s.scale)
            }
        };
        let upper = (s.at(second) - s.at(first)).normalize_or_zero();
        let lower = (end - s.at(second)).normalize_or_zero();
        sums.bones[first.index()] += (a.inverse() * upper).as_dvec3();
        sums.bones[second.index()] += (b.inverse() * lower).as_dvec3();
        // Length sin θ; once more by it, so that nearly straight limbs hardly count.
        let axis = upper.cross(lower);
        let axis = axis * axis.length();
        sums.hinges[first.index()] += (a.inverse() * axis).as_dvec3();
        sums.hinges[second.index()] += (b.inverse() * axis).as_dvec3();
        if i >= 2
            && let Some(hand) = s.rotation(third)
        {
            let relative = hand.inverse() * b;
            for (sum, axis) in sums.hands[i - 2].iter_mut().zip([Vec3::X, Vec3::Y, Vec3::Z]) {
                *sum += (relative * axis).as_dvec3();
            }
        }
    }
}

fn add_flat_foot(sums: &mut Sums, s: &Sampler, side: usize, weight: f32) {
    let (foot, toe) = (Joint::FEET[side], Joint::TOES[side]);
    let forward = s.toe(side) - s.at(foot);
    // Left of a foot that points forward.
    let left = Vec3::Z.cross(forward);
    let Some(axes) = axes(left, true) else { return };
    if let Some(rotation) = s.rotation(foot) {
        add_frame(&mut sums.frames[foot.index()], rotation, axes, weight);
    }
    if let Some(rotation) = s.rotation(toe) {
        add_frame(&mut sums.frames[toe.index()], rotation, axes, weight);
    }
}

/// The rotations C.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Calibration {
    /// `None` where the file has no such joint, or nothing was measured.
    pub joints: [Option<Quat>; JOINT_COUNT],
    pub spine: Vec<Quat>,
}

impl Calibration {
    /// # Errors
    /// A sentence where the motion does not show how the body is turned.
    pub(crate) fn from_sums(sums: &Sums) -> Result<Self, String> {
        let mut joints = [None; JOINT_COUNT];
        for joint in [Hips, Neck, Head, LeftShoulder, RightShoulder, LeftFoot, RightFoot, LeftToe, RightToe] {
            joints[joint.index()] = mean_frame(&sums.frames[joint.index()]);
        }
        if joints[Hips.index()].is_none() {
            return Err("its pelvis was not understood.".into());
        }
        for [first, second, _] in HINGES {
            let leg = matches!(first, LeftUpLeg | RightUpLeg);
            // Our rest: legs down, hinge to the left; arms out to their side, palms down.
            let (bone, hinge) = match first {
                LeftArm => (Vec3::X, Vec3::NEG_Z),
                RightArm => (Vec3::NEG_X, Vec3::Z),
                _ => (Vec3::NEG_Z, Vec3::X),
            };
            for joint in [first, second] {
                let i = joint.index();
                joints[i] = align(bone, hinge, sums.bones[i].as_vec3(), sums.hinges[i].as_vec3());
                if joints[i].is_none() {
                    let limb = if leg { "leg" } else { "arm" };
                    return Err(format!("a bone of its {limb} ({}) has no length.", joint.name()));
                }
            }
        }
        for (side, (hand, forearm)) in
            [(LeftHand, LeftForeArm), (RightHand, RightForeArm)].into_iter().enumerate()
        {
            joints[hand.index()] =
                mean_frame(&sums.hands[side]).and_then(|mean| joints[forearm.index()].map(|c| mean * c));
        }
        // The trunk's lean: forward is -Y. Ours at rest leans back by 2°, and all of it is above the Spine joint.
        let trunk = sums.trunk.as_vec3();
        let rest = (-0.02f32).atan2(0.505);
        let lean = (((-trunk.y).atan2(trunk.z) - rest) * 1.25).clamp(-0.3, 1.2);
        let spine = sums
            .spine
            .iter()
            .map(|sum| mean_frame(sum).map(|c| c * Quat::from_rotation_x(lean)))
            .collect::<Option<Vec<_>>>()
            .ok_or("its spine was not understood.")?;
        for shoulder in [LeftShoulder, RightShoulder] {
            let c = &mut joints[shoulder.index()];
            *c = c.map(|c| c * Quat::from_rotation_x(lean));
        }
        Ok(Self { joints, spine })
    }
}

/// Rotation whose columns are nearest to (left, back, up) in the joint's frame: left first, then up.
fn mean_frame(sum: &[DVec3; 3]) -> Option<Quat> {
    let x = sum[0].as_vec3().try_normalize()?;
    let z = sum[2].as_vec3().normalize_or_zero();
    let z = (z - x * x.dot(z)).try_normalize()?;
    Some(Quat::from_mat3(&Mat3::from_cols(x, z.cross(x), z)))
}

/// The rotation that takes `bone` and `hinge` to `to_bone` (exactly) and `to_hinge` (as nearly as it goes).
fn align(bone: Vec3, hinge: Vec3, to_bone: Vec3, to_hinge: Vec3) -> Option<Quat> {
    let b = to_bone.try_normalize()?;
    let h = to_hinge.try_normalize()?;
    let h = (h - b * b.dot(h)).try_normalize()?;
    let from = Mat3::from_cols(bone, hinge, bone.cross(hinge));
    let to = Mat3::from_cols(b, h, b.cross(h));
    Some(Quat::from_mat3(&(to * from.transpose())).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::angle_between;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn align_is_exact(x in -3.0f32..3.0, y in -3.0f32..3.0, z in -3.0f32..3.0) {
            let turn = Quat::from_scaled_axis(Vec3::new(x, y, z));
            let found = align(Vec3::NEG_Z, Vec3::X, turn * Vec3::NEG_Z, turn * (Vec3::X + 0.4 * Vec3::NEG_Z)).unwrap();
            prop_assert!(angle_between(found, turn) < 1e-4);
            let columns = [turn * Vec3::X * 3.0, turn * Vec3::Y, turn * Vec3::Z].map(|v| v.as_dvec3());
            prop_assert!(angle_between(mean_frame(&columns).unwrap(), turn) < 1e-4);
        }
    }
}
