//! Forward kinematics of X with its gradient: L_pos and every constraint of the editor go through it.

use glam::{Mat3, Vec2, Vec3};

use super::window::{FEATURES, HEIGHT, STEP, next_planar, rotation_range};
use crate::math::Planar;
use crate::math::planar::rotate;
use crate::motion::JOINT_COUNT;
use crate::motion::skeleton::{JOINT_OFFSET, PARENT};

/// Where the frames of X are placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RootPath {
    /// Every frame at the origin, facing the rest pose's way: the steps are ignored.
    Centred,
    /// The first frame here, the others by their steps.
    From(Planar),
}

/// The joints of every frame of X, in the space of the [`RootPath`], and what the gradient needs.
#[derive(Debug, Clone, Default)]
pub struct Kinematics {
    path: Option<RootPath>,
    planar: Vec<Planar>,
    /// Relative to the parent; the root's relative to its facing.
    local: Vec<[Mat3; JOINT_COUNT]>,
    /// Global rotation of each joint.
    pub rotations: Vec<[Mat3; JOINT_COUNT]>,
    /// Place of each joint, metres.
    pub positions: Vec<[Vec3; JOINT_COUNT]>,
}

impl Kinematics {
    /// Places the joints of X (frames × [`FEATURES`]).
    pub fn forward(&mut self, x: &[f32], path: RootPath) {
        self.path = Some(path);
        self.planar.clear();
        self.local.clear();
        self.rotations.clear();
        self.positions.clear();
        let mut here = match path {
            RootPath::Centred => Planar::default(),
            RootPath::From(start) => start,
        };
        for (frame, row) in x.chunks_exact(FEATURES).enumerate() {
            if frame > 0 && path != RootPath::Centred {
                here = next_planar(here, row);
            }
            let local: [Mat3; JOINT_COUNT] =
                std::array::from_fn(|joint| gram_schmidt(&row[rotation_range(joint)]));
            let mut rotations = local;
            rotations[0] = Mat3::from_rotation_z(here.yaw) * local[0];
            let mut positions = [here.position.extend(row[HEIGHT]); JOINT_COUNT];
            for joint in 1..JOINT_COUNT {
                let parent = PARENT[joint];
                rotations[joint] = rotations[parent] * local[joint];
                positions[joint] = positions[parent] + rotations[parent] * JOINT_OFFSET[joint];
            }
            self.planar.push(here);
            self.local.push(local);
            self.rotations.push(rotations);
            self.positions.push(positions);
        }
    }

    /// Where each frame stands and faces.
    pub fn planar(&self) -> &[Planar] {
        &self.planar
    }

    /// Adds to `d_x` the gradient of a loss by X, given its gradients by [`Kinematics::positions`] and, where
    /// there is one, by the global [`Kinematics::rotations`] (entry by entry). `x` is that of the last
    /// [`Kinematics::forward`].
    pub fn backward(
        &self,
        x: &[f32],
        d_positions: &[[Vec3; JOINT_COUNT]],
        d_rotations: Option<&[[Mat3; JOINT_COUNT]]>,
        d_x: &mut [f32],
    ) {
        // By the place and the facing of the frames after the one at hand.
        let (mut d_place, mut d_yaw) = (Vec2::ZERO, 0.0);
        for frame in (0..self.positions.len()).rev() {
            let (local, global) = (&self.local[frame], &self.rotations[frame]);
            let row = &x[frame * FEATURES..(frame + 1) * FEATURES];
            let d_row = &mut d_x[frame * FEATURES..(frame + 1) * FEATURES];
            let mut d_position = d_positions[frame];
            let mut d_rotation = d_rotations.map_or([Mat3::ZERO; JOINT_COUNT], |d| d[frame]);
            for joint in (1..JOINT_COUNT).rev() {
                let (parent, offset) = (PARENT[joint], JOINT_OFFSET[joint]);
                let (dp, dr) = (d_position[joint], d_rotation[joint]);
                d_position[parent] += dp;
                d_rotation[parent] += outer(dp, offset) + dr * local[joint].transpose();
                let d_local = global[parent].transpose() * dr;
                let range = rotation_range(joint);
                gram_schmidt_backward(&row[range.clone()], &local[joint], &d_local, &mut d_row[range]);
            }
            let turn = Mat3::from_rotation_z(self.planar[frame].yaw);
            let range = rotation_range(0);
            let d_local = turn.transpose() * d_rotation[0];
            gram_schmidt_backward(&row[range.clone()], &local[0], &d_local, &mut d_row[range]);
            d_row[HEIGHT] += d_position[0].z;

            if self.path == Some(RootPath::Centred) {
                continue;
            }
            d_place += d_position[0].truncate();
            let spun = |column: Vec3| Vec3::Z.cross(column);
            d_yaw += d_rotation[0].x_axis.dot(spun(global[0].x_axis))
                + d_rotation[0].y_axis.dot(spun(global[0].y_axis))
                + d_rotation[0].z_axis.dot(spun(global[0].z_axis));
            if frame > 0 {
                let before = self.planar[frame - 1];
                let step = Vec2::new(row[STEP.start], row[STEP.start + 1]);
                let d_step = rotate(-before.yaw, d_place);
                d_row[STEP.start] += d_step.x;
                d_row[STEP.start + 1] += d_step.y;
                d_row[STEP.start + 2] += d_yaw;
                // The step is turned by the facing of the frame before.
                d_yaw += d_step.dot(step.perp());
            }
        }
    }
}

fn outer(a: Vec3, b: Vec3) -> Mat3 {
    Mat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The rotation of a 6D vector; degenerate input gives the identity, as [`crate::math::rotation::from_6d`] does.
fn gram_schmidt(v: &[f32]) -> Mat3 {
    let (a, b) = (Vec3::new(v[0], v[1], v[2]), Vec3::new(v[3], v[4], v[5]));
    let Some(x) = a.try_normalize() else { return Mat3::IDENTITY };
    let Some(y) = (b - x * x.dot(b)).try_normalize() else { return Mat3::IDENTITY };
    Mat3::from_cols(x, y, x.cross(y))
}

/// Adds the gradient by the 6D vector `v`, given that by its rotation `m`.
fn gram_schmidt_backward(v: &[f32], m: &Mat3, d: &Mat3, out: &mut [f32]) {
    let (a, b) = (Vec3::new(v[0], v[1], v[2]), Vec3::new(v[3], v[4], v[5]));
    let (x, y) = (m.x_axis, m.y_axis);
    let along = x.dot(b);
    let (length_a, length_u) = (a.length(), (b - x * along).length());
    if length_a < 1e-12 || length_u < 1e-12 {
        return;
    }
    let mut dx = d.x_axis + y.cross(d.z_axis);
    let dy = d.y_axis + d.z_axis.cross(x);
    let du = (dy - y * y.dot(dy)) / length_u;
    let db = du - x * x.dot(du);
    dx -= b * x.dot(du) + du * along;
    let da = (dx - x * x.dot(dx)) / length_a;
    for (out, d) in out.iter_mut().zip(da.to_array().into_iter().chain(db.to_array())) {
        *out += d;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::window::tests::random_motion;
    use crate::manifold::window::{from_motion, to_motion};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    #[test]
    fn joints_stand_where_the_motion_has_them() {
        let (x, start) = from_motion(&random_motion(30, 3));
        let mut kinematics = Kinematics::default();
        kinematics.forward(&x, RootPath::From(start));
        for (frame, posture) in to_motion(&x, start).postures.iter().enumerate() {
            let pose = posture.pose();
            for joint in 0..JOINT_COUNT {
                assert!(pose.positions[joint].distance(kinematics.positions[frame][joint]) < 1e-4);
                let rotation = Mat3::from_quat(pose.rotations[joint]);
                assert!(rotation.abs_diff_eq(kinematics.rotations[frame][joint], 1e-4));
            }
        }
    }

    /// A loss that weighs every number of every joint by its own random weight.
    struct Weighed {
        positions: Vec<[Vec3; JOINT_COUNT]>,
        rotations: Vec<[Mat3; JOINT_COUNT]>,
    }

    impl Weighed {
        fn new(frames: usize, seed: u64) -> Self {
            let mut rng = Pcg32::seed_from_u64(seed);
            let mut v = move || Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
            Self {
                positions: (0..frames).map(|_| std::array::from_fn(|_| v())).collect(),
                rotations: (0..frames)
                    .map(|_| std::array::from_fn(|_| Mat3::from_cols(v(), v(), v())))
                    .collect(),
            }
        }

        fn loss(&self, k: &Kinematics) -> f64 {
            let dot = |a: Vec3, b: Vec3| f64::from(a.x * b.x) + f64::from(a.y * b.y) + f64::from(a.z * b.z);
            let mut sum = 0.0;
            for frame in 0..k.positions.len() {
                for joint in 0..JOINT_COUNT {
                    sum += dot(self.positions[frame][joint], k.positions[frame][joint]);
                    let (w, r) = (&self.rotations[frame][joint], &k.rotations[frame][joint]);
                    sum += dot(w.x_axis, r.x_axis) + dot(w.y_axis, r.y_axis) + dot(w.z_axis, r.z_axis);
                }
            }
            sum
        }
    }

    #[test]
    fn gradient_agrees_with_finite_differences() {
        const FRAMES: usize = 3;
        let (mut x, start) = from_motion(&random_motion(FRAMES, 4));
        // Away from the rotations: the gradient has to hold for what a decoder gives, too.
        let mut rng = Pcg32::seed_from_u64(5);
        x.iter_mut().for_each(|v| *v += rng.random_range(-0.1..0.1));
        let weighed = Weighed::new(FRAMES, 6);
        for path in [RootPath::From(start), RootPath::Centred] {
            let mut kinematics = Kinematics::default();
            kinematics.forward(&x, path);
            let mut d_x = vec![0.0; x.len()];
            kinematics.backward(&x, &weighed.positions, Some(&weighed.rotations), &mut d_x);
            for i in 0..x.len() {
                let mut moved = x.clone();
                let h = 2e-3;
                let mut at = |value: f32| {
                    moved[i] = value;
                    kinematics.forward(&moved, path);
                    weighed.loss(&kinematics)
                };
                let numeric = (at(x[i] + h) - at(x[i] - h)) / f64::from(2.0 * h);
                let analytic = f64::from(d_x[i]);
                assert!(
                    (numeric - analytic).abs() < 2e-2 * (1.0 + analytic.abs()),
                    "{path:?} {i}: {numeric} {analytic}"
                );
            }
        }
    }

    #[test]
    fn a_degenerate_rotation_gives_numbers() {
        let x = vec![0.0; 2 * FEATURES];
        let mut kinematics = Kinematics::default();
        kinematics.forward(&x, RootPath::Centred);
        let mut d_x = vec![0.0; x.len()];
        kinematics.backward(&x, &[[Vec3::ONE; JOINT_COUNT]; 2], None, &mut d_x);
        assert!(d_x.iter().all(|d| d.is_finite()));
        assert!(kinematics.positions[0][0].is_finite());
    }
}
