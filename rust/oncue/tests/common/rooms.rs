//! rooms.tsv: the real rooms' tasks.

use std::path::Path;

use glam::Vec3;
use oncue::math::Planar;
use oncue::{ActionCue, ActionType, InitialState, Task};

/// One row: a walk from a start to a seat.
pub struct Row {
    pub room: String,
    pub number: String,
    pub floor_z: f32,
    pub task: Task,
    /// Length of the shortest path with 0.25 m clearance to within `path_end_gap` of the pelvis target, metres.
    pub path: f32,
    pub path_end_gap: f32,
    pub start_clearance: f32,
    pub seat_height: f32,
}

/// All rows of `folder/rooms.tsv`.
pub fn read(folder: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(folder.join("rooms.tsv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split('\t').collect();
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split('\t').collect();
            let text = |name: &str| cells[names.iter().position(|n| *n == name).unwrap()];
            let number = |name: &str| text(name).parse::<f32>().unwrap();
            let place = |p: &str| {
                Vec3::new(number(&format!("{p}_x")), number(&format!("{p}_y")), number(&format!("{p}_z")))
            };
            let yaw = |name: &str| Planar::from_heading(glam::Vec2::ZERO, number(name).to_radians()).yaw;
            Row {
                room: text("room").into(),
                number: text("task").into(),
                floor_z: number("floor_z"),
                task: Task {
                    start: InitialState::standing("Start", place("start"), yaw("start_heading_deg")),
                    cue: ActionCue {
                        name: text("seat_object").into(),
                        action_type: ActionType::Sit,
                        position: place("pelvis"),
                        yaw: yaw("facing_heading_deg"),
                        feet: [None; 2],
                    },
                    passes: Vec::new(),
                    manipulations: Vec::new(),
                },
                path: number("path_m"),
                path_end_gap: number("path_end_gap_m"),
                start_clearance: number("start_clearance_m"),
                seat_height: number("seat_height_m"),
            }
        })
        .collect()
}
