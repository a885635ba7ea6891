//! The triangles of a scene, checked.

use glam::Vec3;

use crate::error::{Error, Result};
use crate::progress::Progress;

/// Coordinates beyond this (metres) are refused: single precision cannot place a foot there.
const FARTHEST: f32 = 1.0e5;

/// The triangles' corners, without those that have no area.
///
/// Errors: `Input` for an empty mesh, an index out of range, a vertex that is no number, and one too far away;
/// the sentence names the triangle. Vertices that no triangle uses are not looked at.
pub fn corners(positions: &[Vec3], triangles: &[[u32; 3]], progress: &Progress) -> Result<Vec<[Vec3; 3]>> {
    if triangles.is_empty() {
        return Err(Error::input("The scene has no mesh faces: nothing to walk on and nothing to sit on."));
    }
    let mut out = Vec::with_capacity(triangles.len());
    for (number, triangle) in triangles.iter().enumerate() {
        if number % 65_536 == 0 {
            progress.check()?;
        }
        let mut corner = [Vec3::ZERO; 3];
        for (corner, &index) in corner.iter_mut().zip(triangle) {
            *corner = *positions.get(index as usize).ok_or_else(|| {
                Error::input(format!(
                    "Triangle {number} of the scene names vertex {index}, but there are {} vertices.",
                    positions.len()
                ))
            })?;
            if !corner.is_finite() {
                return Err(Error::input(format!(
                    "Triangle {number} of the scene has a vertex ({index}) whose position is not a number: {corner}."
                )));
            }
            if corner.abs().max_element() > FARTHEST {
                return Err(Error::input(format!(
                    "Triangle {number} of the scene has a vertex ({index}) at {corner}, farther than {} km from the origin.",
                    FARTHEST / 1000.0
                )));
            }
        }
        // In double precision: two corners that differ at all may span an area too small for f32.
        let [a, b, c] = corner.map(|v| v.as_dvec3());
        if (b - a).cross(c - a).length_squared() > 0.0 {
            out.push(corner);
        }
    }
    if out.is_empty() {
        return Err(Error::input(format!("All {} triangles of the scene have zero area.", triangles.len())));
    }
    Ok(out)
}
