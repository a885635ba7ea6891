//! Curves of a limb that make up for each other, and for what the limb hangs on.

use glam::{DQuat, DVec3};

use super::segment::{Segments, Slopes};

/// How much a turn counts beside a place, each in its tolerances.
const OF_TURN: f64 = 1.0;
/// What each bone's handles are turned by: three numbers after the first key, three before the second.
const TURNS: usize = 6;

impl Segments<'_> {
    /// Slopes with which the limb's watched bones come nearer to where they are in the motion: one Gauss-Newton step of the
    /// squared errors in the world, in tolerances, from `slopes` on.
    pub(super) fn refined(&self, from: usize, to: usize, slopes: &[Option<Slopes>]) -> Vec<Option<Slopes>> {
        let free: Vec<usize> = (0..slopes.len()).filter(|&k| slopes[k].is_some()).collect();
        let size = TURNS * free.len();
        let mut normal = vec![0.0; size * size];
        let mut right = vec![0.0; size];
        let mut pose = Vec::new();
        let mut rows = vec![DVec3::ZERO; size];
        for sample in 2 * from + 1..2 * to {
            self.pose(from, to, sample, slopes, &mut pose);
            let [_, w1, w2, _] = self.weights(from, to, sample);
            for (index, &bone) in self.limb.bones.iter().enumerate() {
                let allowed = self.limits.tolerances[bone];
                if allowed.place.is_finite() {
                    let error = (self.truth.placed(sample, bone).0 - pose[index].0) / allowed.place;
                    for (column, &k) in free.iter().enumerate() {
                        let moves = self.is_over(k, index);
                        // Turned about an axis of its own a bone carries what hangs on it round its head.
                        let arm = pose[index].0 - pose[k].0;
                        for axis in 0..3 {
                            let about = pose[k].1 * DVec3::AXES[axis];
                            let moved = if moves { about.cross(arm) / allowed.place } else { DVec3::ZERO };
                            rows[TURNS * column + axis] = w1 * moved;
                            rows[TURNS * column + 3 + axis] = w2 * moved;
                        }
                    }
                    add(&mut normal, &mut right, &rows, error);
                }
            }
            for (column, &k) in free.iter().enumerate() {
                let allowed = self.limits.tolerances[self.limb.bones[k]];
                let weight = OF_TURN / allowed.turn;
                let error = turn_to(pose[k].2, self.truth.local(sample, self.limb.bones[k])) * weight;
                for axis in 0..3 {
                    let (a, b) = (TURNS * column + axis, TURNS * column + 3 + axis);
                    let (wa, wb) = (w1 * weight, w2 * weight);
                    normal[a * size + a] += wa * wa;
                    normal[b * size + b] += wb * wb;
                    normal[b * size + a] += wa * wb;
                    right[a] += wa * error[axis];
                    right[b] += wb * error[axis];
                }
            }
        }
        for k in 0..size {
            normal[k * size + k] += 1e-6;
        }
        if !solve(&mut normal, &mut right) {
            return slopes.to_vec();
        }
        let mut refined = slopes.to_vec();
        for (column, &k) in free.iter().enumerate() {
            let turns = &right[TURNS * column..TURNS * (column + 1)];
            if let Some(slopes) = &mut refined[k] {
                self.turn_handles(from, to, self.limb.bones[k], slopes, turns);
            }
        }
        refined
    }
}

/// The rotation vector that takes one rotation to another near to it, in the frame of the first.
fn turn_to(from: DQuat, to: DQuat) -> DVec3 {
    let between = from.conjugate() * to;
    let half = DVec3::new(between.x, between.y, between.z);
    2.0 * if between.w < 0.0 { -half } else { half }
}

/// Adds three equations to the lower half of the normal ones.
fn add(normal: &mut [f64], right: &mut [f64], rows: &[DVec3], error: DVec3) {
    let size = rows.len();
    for a in (0..size).filter(|&a| rows[a] != DVec3::ZERO) {
        for b in 0..=a {
            normal[a * size + b] += rows[a].dot(rows[b]);
        }
        right[a] += rows[a].dot(error);
    }
}

/// Solves a positive definite system, of which the lower half is given, in place; false where it is none.
fn solve(matrix: &mut [f64], right: &mut [f64]) -> bool {
    let size = right.len();
    for a in 0..size {
        for b in 0..=a {
            let sum: f64 = (0..b).map(|k| matrix[a * size + k] * matrix[b * size + k]).sum();
            let rest = matrix[a * size + b] - sum;
            if a == b {
                if rest <= 0.0 {
                    return false;
                }
                matrix[a * size + a] = rest.sqrt();
            } else {
                matrix[a * size + b] = rest / matrix[b * size + b];
            }
        }
    }
    for a in 0..size {
        let sum: f64 = (0..a).map(|k| matrix[a * size + k] * right[k]).sum();
        right[a] = (right[a] - sum) / matrix[a * size + a];
    }
    for a in (0..size).rev() {
        let sum: f64 = (a + 1..size).map(|k| matrix[k * size + a] * right[k]).sum();
        right[a] = (right[a] - sum) / matrix[a * size + a];
    }
    true
}
