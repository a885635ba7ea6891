//! The objects of `objects.tsv` as tasks: someone stands or sits before one and opens it.

use std::path::Path;

use glam::{Quat, Vec2, Vec3};
use oncue::library::ActionLabel;
use oncue::math::Planar;
use oncue::{Hand, ManipulationCue, Motion, MotionLibrary};

use crate::AnyError;
use crate::common::glb;

pub struct ObjectTask {
    pub name: String,
    pub motion: Motion,
    pub cue: ManipulationCue,
    /// Corners of the object's triangles, closed, world, for drawing.
    pub mesh: Vec<[Vec3; 3]>,
}

/// Where an object stands and how it is opened: file, moving part, height of its base, seconds, hand, share of its range.
const TASKS: [(&str, &str, f32, f32, Hand, f32); 14] = [
    ("door.glb", "door_leaf", 0.0, 2.0, Hand::Left, 0.55),
    ("frontDoor.glb", "frontDoor_leaf", 0.0, 2.0, Hand::Left, 0.55),
    ("laptop.glb", "laptop_lid", 0.72, 1.5, Hand::Right, 1.0),
    ("laptop_blendswap.glb", "laptop_blendswap_lid", 0.72, 1.5, Hand::Left, 1.0),
    ("fridge.glb", "fridge_door", 0.0, 1.8, Hand::Right, 0.7),
    ("oven.glb", "oven_door", 0.9, 1.6, Hand::Left, 0.8),
    ("wardrobe.glb", "wardrobe_door_left", 0.0, 1.8, Hand::Left, 0.7),
    ("wardrobe.glb", "wardrobe_door_right", 0.0, 1.8, Hand::Right, 0.7),
    ("chest.glb", "chest_drawer_1", 0.0, 1.2, Hand::Right, 1.0),
    ("chest.glb", "chest_drawer_2", 0.0, 1.2, Hand::Left, 1.0),
    ("chest.glb", "chest_drawer_3", 0.0, 1.2, Hand::Right, 1.0),
    ("chest.glb", "chest_drawer_4", 0.0, 1.2, Hand::Right, 1.0),
    ("toilet_cc0.glb", "toilet_cc0_lid", 0.0, 1.8, Hand::Right, 0.8),
    ("trashcan_bullet.glb", "trashcan_bullet_flap", 0.0, 1.2, Hand::Right, 1.0),
];

/// All tasks; their persons are a standing and a seated one of the library.
pub fn tasks(folder: &Path, library: &MotionLibrary) -> Result<Vec<ObjectTask>, AnyError> {
    let text = std::fs::read_to_string(folder.join("objects.tsv"))?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().ok_or("objects.tsv is empty")?.split('\t').collect();
    let rows: Vec<Vec<&str>> = lines.map(|l| l.split('\t').collect()).collect();
    let (standing, seated) = (person(library, ActionLabel::Idle)?, person(library, ActionLabel::SeatedIdle)?);
    let mut out = Vec::new();
    for (file, part, height, seconds, hand, share) in TASKS {
        let cell = |row: &Vec<&str>, name: &str| -> String {
            names.iter().position(|n| *n == name).and_then(|i| row.get(i)).unwrap_or(&"").to_string()
        };
        let row = rows
            .iter()
            .find(|r| cell(r, "file") == file && cell(r, "moving_node") == part)
            .ok_or(format!("{file} lacks {part}"))?;
        let vector = |name: &str| -> Result<Vec3, AnyError> {
            let numbers: Vec<f32> = cell(row, name).split(' ').map(str::parse).collect::<Result<_, _>>()?;
            Ok(Vec3::from_slice(&numbers))
        };
        let up = Vec3::Z * height;
        let (axis, origin, contact) =
            (vector("axis_xyz")?, vector("origin_xyz")? + up, vector("contact_xyz")? + up);
        let most = cell(row, "range_max").parse::<f32>()? * share;
        let frames = (30.0 * seconds) as usize;
        let path: Vec<Vec3> = (0..frames)
            .map(|f| {
                let t = f as f32 / (frames - 1) as f32;
                let value = most * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
                if cell(row, "joint") == "slide" {
                    contact + axis * value
                } else {
                    origin + Quat::from_axis_angle(axis, value.to_radians()) * (contact - origin)
                }
            })
            .collect();
        let sits = file.starts_with("laptop");
        let base = if sits { &seated } else { &standing };
        let place = if sits {
            Planar::new(contact.truncate() - Vec2::new(0.0, 0.38), std::f32::consts::PI)
        } else {
            stand_before(&path, hand)
        };
        let from = base.postures[0].planar();
        let motion = Motion {
            postures: base.postures.iter().map(|p| p.moved(from, place)).collect(),
            contacts: base.contacts.clone(),
        };
        let mesh = glb::read(&folder.join(file));
        let corner = |i: u32| mesh.positions[i as usize] + up;
        out.push(ObjectTask {
            name: part.to_owned(),
            motion,
            cue: ManipulationCue { name: part.to_owned(), hand, path, first_frame: Some(30) },
            mesh: mesh.triangles.iter().map(|t| t.map(corner)).collect(),
        });
    }
    Ok(out)
}

/// Ninety frames of someone who stands or sits still.
fn person(library: &MotionLibrary, label: ActionLabel) -> Result<Motion, AnyError> {
    for clip in &library.clips {
        for s in clip.segments.iter().filter(|s| s.label == label && s.end - s.first >= 60) {
            let range = s.first..s.end.min(s.first + 90);
            let seat = clip.motion.postures[s.first].root_position.z;
            if label == ActionLabel::SeatedIdle && !(0.5..0.6).contains(&seat) {
                continue;
            }
            return Ok(Motion {
                postures: clip.motion.postures[range.clone()].to_vec(),
                contacts: clip.motion.contacts[range].to_vec(),
            });
        }
    }
    Err("the library has no one who stands or sits still".into())
}

/// Where to stand so that the path comes no nearer to the body than an open door, and the hand has the least to reach.
fn stand_before(path: &[Vec3], hand: Hand) -> Planar {
    let middle = path.iter().map(|p| p.truncate()).sum::<Vec2>() / path.len() as f32;
    let side = if hand == Hand::Left { 0.17 } else { -0.17 };
    let mut best = (f32::INFINITY, Planar::default());
    for i in 0..41 {
        for j in 0..41 {
            let at = middle + Vec2::new(0.05 * (i - 20) as f32, -0.05 * j as f32);
            let to = middle - at;
            let here = Planar::from_heading(at, to.y.atan2(to.x));
            let shoulder = here.point_to_world(Vec2::new(side, 0.0));
            // Before the object's front, and out of the way of what moves.
            let room = path.iter().map(|p| p.truncate().distance(at)).fold(f32::INFINITY, f32::min);
            if at.y > path[0].y - 0.25 || room < 0.33 {
                continue;
            }
            let far = path.iter().map(|p| p.truncate().distance(shoulder)).fold(0.0, f32::max);
            if far < best.0 {
                best = (far, here);
            }
        }
    }
    best.1
}
