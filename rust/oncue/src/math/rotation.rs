//! Rotations: 6D (Zhou et al. 2019), angle-axis, and the parts about an axis.

use glam::{Mat3, Quat, Vec3};

/// The 6D form of a rotation: the first two columns of its matrix, `[c0.x, c0.y, c0.z, c1.x, c1.y, c1.z]`.
pub fn to_6d(rotation: Quat) -> [f32; 6] {
    let m = Mat3::from_quat(rotation);
    [m.x_axis.x, m.x_axis.y, m.x_axis.z, m.y_axis.x, m.y_axis.y, m.y_axis.z]
}

/// The rotation nearest to a 6D vector, by Gram-Schmidt. Degenerate input gives the identity.
pub fn from_6d(v: [f32; 6]) -> Quat {
    let x = Vec3::new(v[0], v[1], v[2]);
    let y = Vec3::new(v[3], v[4], v[5]);
    let Some(x) = x.try_normalize() else { return Quat::IDENTITY };
    let Some(y) = (y - x * x.dot(y)).try_normalize() else { return Quat::IDENTITY };
    Quat::from_mat3(&Mat3::from_cols(x, y, x.cross(y)))
}

/// Angle-axis vector (radians) of the shortest way round.
pub fn to_angle_axis(rotation: Quat) -> Vec3 {
    let q = if rotation.w < 0.0 { -rotation } else { rotation };
    let v = Vec3::new(q.x, q.y, q.z);
    let sine = v.length();
    if sine < 1e-7 { 2.0 * v } else { v * (2.0 * sine.atan2(q.w) / sine) }
}

/// Angle between two rotations, radians, exact near zero too, where the arc cosine of a rounded product is off by thousandths.
pub fn angle_between(a: Quat, b: Quat) -> f32 {
    to_angle_axis(a * b.inverse()).length()
}

/// Rotation of an angle-axis vector in radians.
#[inline]
pub fn from_angle_axis(v: Vec3) -> Quat {
    from_angle_axes(&[v])[0]
}

/// [`from_angle_axis`] of many at once: the series side by side.
#[inline]
pub fn from_angle_axes<const N: usize>(v: &[Vec3; N]) -> [Quat; N] {
    let squares = v.map(|v| v.length_squared());
    let (mut sines, mut cosines) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        (sines[i], cosines[i]) = half_angle_series(squares[i]);
    }
    std::array::from_fn(|i| {
        if squares[i] > SERIES_UP_TO {
            return Quat::from_scaled_axis(v[i]);
        }
        let xyz = v[i] * sines[i];
        Quat::from_xyzw(xyz.x, xyz.y, xyz.z, cosines[i])
    })
}

/// Half a radian, squared.
const SERIES_UP_TO: f32 = 0.25;

/// sin(x/2)/x and cos(x/2) of x² up to [`SERIES_UP_TO`]: the series to x⁶ are exact to f32, and need no library call.
#[inline(always)]
fn half_angle_series(square: f32) -> (f32, f32) {
    (
        0.5 + square * (-1.0 / 48.0 + square * (1.0 / 3840.0 - square / 645_120.0)),
        1.0 + square * (-0.125 + square * (1.0 / 384.0 - square / 46_080.0)),
    )
}

/// Yaw about +Z (radians): the twist of `rotation` about the vertical.
///
/// Stays defined for a character that leans, and is 0 where the twist is undefined (upside down).
pub fn yaw(rotation: Quat) -> f32 {
    if rotation.z.abs() < 1e-9 && rotation.w.abs() < 1e-9 {
        return 0.0;
    }
    wrap_angle(2.0 * rotation.z.atan2(rotation.w))
}

/// Wraps an angle in radians into (-pi, pi].
pub fn wrap_angle(angle: f32) -> f32 {
    use std::f32::consts::{PI, TAU};
    let a = angle.rem_euclid(TAU);
    if a > PI { a - TAU } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::{FRAC_PI_2, PI};

    #[test]
    fn six_d_of_a_quarter_turn_about_z() {
        let v = to_6d(Quat::from_rotation_z(FRAC_PI_2));
        for (a, b) in v.iter().zip([0.0, 1.0, 0.0, -1.0, 0.0, 0.0]) {
            assert!((a - b).abs() < 1e-6, "{v:?}");
        }
    }

    #[test]
    fn yaw_ignores_lean() {
        let lean = Quat::from_rotation_z(0.7) * Quat::from_rotation_x(0.4);
        assert!((yaw(lean) - 0.7).abs() < 1e-5);
        assert!((wrap_angle(3.0 * PI) - PI).abs() < 1e-5);
    }

    #[test]
    fn the_series_is_the_rotation() {
        for angle in [0.0, 1e-6, 0.1, 0.3, 0.499_99, 0.500_01, 3.0] {
            let v = Vec3::new(0.6, -0.64, 0.48) * angle;
            let (a, b) = (from_angle_axis(v), Quat::from_scaled_axis(v));
            assert!((a - b).length() < 2e-7, "{angle}: {a} {b}");
            assert_eq!(from_angle_axes(&[v, Vec3::ZERO]), [a, Quat::IDENTITY]);
        }
    }

    #[test]
    fn a_small_angle_is_exact() {
        let a = Quat::from_scaled_axis(Vec3::new(0.3, -1.2, 2.0));
        for angle in [0.0, 1e-4, 0.5, 3.0] {
            let b = Quat::from_axis_angle(Vec3::Y, angle) * a;
            assert!(
                (angle_between(a, b) - angle).abs() < 1e-5 && (angle_between(a, -b) - angle).abs() < 1e-5
            );
        }
    }

    proptest! {
        #[test]
        fn forms_round_trip(x in -3.0f32..3.0, y in -3.0f32..3.0, z in -3.0f32..3.0) {
            let q = Quat::from_scaled_axis(Vec3::new(x, y, z));
            prop_assert!(from_6d(to_6d(q)).dot(q).abs() > 1.0 - 1e-5);
            prop_assert!(from_angle_axis(to_angle_axis(q)).dot(q).abs() > 1.0 - 1e-5);
        }
    }
}
