//! The triangles of a scene, checked.

use glam::Vec3;
use rayon::prelude::*;

use super::settings::SceneSettings;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// Coordinates beyond this (metres) are refused: single precision cannot place a foot there.
const FARTHEST_COORDINATE: f32 = 1.0e5;
/// Triangles looked at between two checks for a cancel.
const TRIANGLE_CHUNK: usize = 65_536;

/// The triangles' corners, without those that have no area.
///
/// Errors: `Input` for an empty mesh, an index out of range, a vertex that is no number, and one too far away;
/// the sentence names the triangle. Vertices that no triangle uses are not looked at.
pub(super) fn corners(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    progress: &Progress,
) -> Result<Vec<[Vec3; 3]>> {
    if triangles.is_empty() {
        return Err(Error::input("The scene has no mesh faces: nothing to walk on and nothing to sit on."));
    }
    // Chunk by chunk in parallel; the first chunk's error is the one that is told, whatever thread was first.
    let chunks: Vec<Result<Vec<[Vec3; 3]>>> = triangles
        .par_chunks(TRIANGLE_CHUNK)
        .enumerate()
        .map(|(chunk, triangles)| {
            progress.check()?;
            let mut out = Vec::with_capacity(triangles.len());
            for (i, triangle) in triangles.iter().enumerate() {
                let corners = checked(positions, triangle, chunk * TRIANGLE_CHUNK + i)?;
                // In double precision: two corners that differ at all may span an area too small for f32.
                let [a, b, c] = corners.map(|v| v.as_dvec3());
                if (b - a).cross(c - a).length_squared() > 0.0 {
                    out.push(corners);
                }
            }
            Ok(out)
        })
        .collect();
    let mut out = Vec::with_capacity(triangles.len());
    for chunk in chunks {
        out.extend(chunk?);
    }
    if out.is_empty() {
        return Err(Error::input(format!("All {} triangles of the scene have zero area.", triangles.len())));
    }
    Ok(out)
}

/// BLAKE3 of triangles, settings and, where it is not the dominant one, the level that is walked on, hexadecimal. Chunks are
/// hashed in parallel and their hashes in order.
pub(super) fn fingerprint(corners: &[[Vec3; 3]], settings: &SceneSettings, level: Option<f32>) -> String {
    let parts: Vec<[u8; 32]> = corners
        .par_chunks(TRIANGLE_CHUNK)
        .map(|chunk| {
            let mut hasher = blake3::Hasher::new();
            let mut bytes = Vec::with_capacity(chunk.len() * 36);
            for v in chunk.iter().flatten().flat_map(|v| v.to_array()) {
                bytes.extend_from_slice(&v.to_le_bytes());
            }
            hasher.update(&bytes);
            *hasher.finalize().as_bytes()
        })
        .collect();
    let mut hasher = blake3::Hasher::new();
    parts.iter().for_each(|part| {
        hasher.update(part);
    });
    // Numbers and flags always serialize.
    hasher.update(&postcard::to_stdvec(settings).unwrap_or_default());
    if let Some(level) = level {
        hasher.update(&level.to_le_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

fn checked(positions: &[Vec3], triangle: &[u32; 3], number: usize) -> Result<[Vec3; 3]> {
    let mut corners = [Vec3::ZERO; 3];
    for (corner, &index) in corners.iter_mut().zip(triangle) {
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
        if corner.abs().max_element() > FARTHEST_COORDINATE {
            return Err(Error::input(format!(
                "Triangle {number} of the scene has a vertex ({index}) at {corner}, farther than {} km from the origin.",
                FARTHEST_COORDINATE / 1000.0
            )));
        }
    }
    Ok(corners)
}
