//! Meshes of any size for the benches, and what they cost in memory.

use glam::Vec3;

pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// Every triangle cut in four until there are at least `size`, then the rest of the first ones left whole.
pub fn finer(mesh: &Mesh, size: usize) -> Mesh {
    let mut out = Mesh { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() };
    while out.triangles.len() < size {
        // Cut only as many as are needed.
        let cut = (size - out.triangles.len()).div_ceil(3).min(out.triangles.len());
        let mut triangles = out.triangles[cut..].to_vec();
        for &[a, b, c] in &out.triangles[..cut] {
            let n = out.positions.len() as u32;
            let p = |i: u32| out.positions[i as usize];
            let middles = [0.5 * (p(a) + p(b)), 0.5 * (p(b) + p(c)), 0.5 * (p(c) + p(a))];
            out.positions.extend(middles);
            triangles.extend([[a, n, n + 2], [n, b, n + 1], [n + 2, n + 1, c], [n, n + 1, n + 2]]);
        }
        out.triangles = triangles;
    }
    out
}

/// An 8 × 8 × 3 m room: two triangles a wall, chairs and tables of boxes, and finely meshed round cushions.
pub fn made_room() -> Mesh {
    let mut mesh = Mesh { positions: Vec::new(), triangles: Vec::new() };
    let solid = |mesh: &mut Mesh, lo: Vec3, hi: Vec3| {
        let n = mesh.positions.len() as u32;
        for i in 0..8 {
            let pick = |bit: u32, a: f32, b: f32| if i >> bit & 1 == 0 { a } else { b };
            mesh.positions.push(Vec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z)));
        }
        for [a, b, c, d] in
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        {
            mesh.triangles.extend([[n + a, n + b, n + c], [n + a, n + c, n + d]]);
        }
    };
    let v = Vec3::new;
    solid(&mut mesh, v(-0.1, -0.1, -0.1), v(8.1, 8.1, 0.0));
    for (lo, hi) in [
        (v(-0.1, 0.0, 0.0), v(0.0, 8.0, 3.0)),
        (v(8.0, 0.0, 0.0), v(8.1, 8.0, 3.0)),
        (v(0.0, -0.1, 0.0), v(8.0, 0.0, 3.0)),
        (v(0.0, 8.0, 0.0), v(8.0, 8.1, 3.0)),
    ] {
        solid(&mut mesh, lo, hi);
    }
    for k in 0..9 {
        let at = v(1.3 + 2.6 * (k % 3) as f32, 1.2 + 2.7 * (k / 3) as f32, 0.0);
        solid(&mut mesh, at + v(-0.5, -0.4, 0.70), at + v(0.5, 0.4, 0.74));
        for (x, y) in [(-0.45, -0.35), (0.40, -0.35), (-0.45, 0.30), (0.40, 0.30)] {
            solid(&mut mesh, at + v(x, y, 0.0), at + v(x + 0.05, y + 0.05, 0.70));
        }
        solid(&mut mesh, at + v(-0.2, 0.55, 0.42), at + v(0.2, 0.95, 0.46));
        // A round cushion of 9,800 triangles beside the chair.
        let n = mesh.positions.len() as u32;
        let (rings, spokes) = (70u32, 70u32);
        for i in 0..=rings {
            for j in 0..spokes {
                let (a, b) = (
                    std::f32::consts::PI * i as f32 / rings as f32,
                    std::f32::consts::TAU * j as f32 / spokes as f32,
                );
                mesh.positions
                    .push(at + v(0.8, 0.7, 0.2) + 0.2 * v(a.sin() * b.cos(), a.sin() * b.sin(), a.cos()));
            }
        }
        for i in 0..rings {
            for j in 0..spokes {
                let (a, b) = (n + i * spokes + j, n + i * spokes + (j + 1) % spokes);
                mesh.triangles.extend([[a, b, a + spokes], [b, b + spokes, a + spokes]]);
            }
        }
    }
    mesh
}

/// Most memory this process ever held, from Linux.
pub fn peak_memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or("peak memory unknown");
    peak.split_whitespace().collect::<Vec<_>>().join(" ")
}
