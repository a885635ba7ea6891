//! A reader for binary glTF meshes, for tests and benches: triangles in Blender's axes, node transforms applied.

use std::path::Path;

use glam::{Mat4, Quat, Vec3};
use serde_json::Value;

/// Positions in metres, Z up, and triangles, of all mesh nodes of a file.
pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

pub fn read(path: &Path) -> Mesh {
    let bytes = std::fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(&bytes[..4], b"glTF");
    let json_length = word(12);
    let json: Value = serde_json::from_slice(&bytes[20..20 + json_length]).unwrap();
    let binary = &bytes[20 + json_length + 8..];
    let mut mesh = Mesh { positions: Vec::new(), triangles: Vec::new() };
    let scene = json["scene"].as_u64().unwrap_or(0) as usize;
    // glTF is Y up: (x, y, z) becomes (x, -z, y).
    let z_up = Mat4::from_cols_array(&[1., 0., 0., 0., 0., 0., 1., 0., 0., -1., 0., 0., 0., 0., 0., 1.]);
    let mut open: Vec<(usize, Mat4)> =
        numbers(&json["scenes"][scene]["nodes"]).iter().map(|&n| (n as usize, z_up)).collect();
    while let Some((node, parent)) = open.pop() {
        let node = &json["nodes"][node];
        let world = parent * local(node);
        open.extend(numbers(&node["children"]).iter().map(|&n| (n as usize, world)));
        let Some(index) = node["mesh"].as_u64() else { continue };
        for primitive in json["meshes"][index as usize]["primitives"].as_array().unwrap() {
            if primitive["mode"].as_u64().unwrap_or(4) != 4 {
                continue;
            }
            let first = mesh.positions.len() as u32;
            let places = accessor(&json, binary, &primitive["attributes"]["POSITION"]);
            let count = places.len() / 3;
            mesh.positions.extend(
                places
                    .chunks_exact(3)
                    .map(|p| world.transform_point3(Vec3::new(p[0] as f32, p[1] as f32, p[2] as f32))),
            );
            let indices: Vec<u32> = if primitive["indices"].is_u64() {
                accessor(&json, binary, &primitive["indices"]).iter().map(|&i| i as u32).collect()
            } else {
                (0..count as u32).collect()
            };
            mesh.triangles
                .extend(indices.chunks_exact(3).map(|t| [first + t[0], first + t[1], first + t[2]]));
        }
    }
    mesh
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map(|a| a.iter().filter_map(Value::as_f64).collect()).unwrap_or_default()
}

fn local(node: &Value) -> Mat4 {
    let n = |key: &str| numbers(&node[key]).iter().map(|&x| x as f32).collect::<Vec<f32>>();
    if let Ok(matrix) = <[f32; 16]>::try_from(n("matrix")) {
        return Mat4::from_cols_array(&matrix);
    }
    let vector = |key: &str, default: Vec3| <[f32; 3]>::try_from(n(key)).map_or(default, Vec3::from);
    let rotation = <[f32; 4]>::try_from(n("rotation")).map_or(Quat::IDENTITY, Quat::from_array);
    Mat4::from_scale_rotation_translation(
        vector("scale", Vec3::ONE),
        rotation,
        vector("translation", Vec3::ZERO),
    )
}

/// All numbers of an accessor, flat.
fn accessor(json: &Value, binary: &[u8], index: &Value) -> Vec<f64> {
    let accessor = &json["accessors"][index.as_u64().unwrap() as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let width = match accessor["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC3" => 3,
        other => panic!("accessor type {other}"),
    };
    let (size, read): (usize, fn(&[u8]) -> f64) = match accessor["componentType"].as_u64().unwrap() {
        5121 => (1, |b| f64::from(b[0])),
        5123 => (2, |b| f64::from(u16::from_le_bytes([b[0], b[1]]))),
        5125 => (4, |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        5126 => (4, |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        other => panic!("component type {other}"),
    };
    let start =
        (view["byteOffset"].as_u64().unwrap_or(0) + accessor["byteOffset"].as_u64().unwrap_or(0)) as usize;
    let stride = view["byteStride"].as_u64().map_or(width * size, |s| s as usize);
    let count = accessor["count"].as_u64().unwrap() as usize;
    (0..count)
        .flat_map(|i| (0..width).map(move |c| start + i * stride + c * size))
        .map(|at| read(&binary[at..at + size]))
        .collect()
}
