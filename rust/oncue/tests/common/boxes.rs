//! Rooms and seats of axis-aligned boxes.

use glam::Vec3;

/// Boxes from their lowest and highest corners, metres, as triangles.
pub fn boxes(list: &[([f32; 3], [f32; 3])]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (low, high) in list {
        let base = positions.len() as u32;
        for i in 0..8 {
            let pick = |axis: usize| if i & (1 << axis) == 0 { low[axis] } else { high[axis] };
            positions.push(Vec3::new(pick(0), pick(1), pick(2)));
        }
        for q in [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]] {
            triangles.push([base + q[0], base + q[1], base + q[2]]);
            triangles.push([base + q[0], base + q[2], base + q[3]]);
        }
    }
    (positions, triangles)
}
