//! Writes what the scene index knows of a room's floor as JSON: occupancy, clearance, and the clear path of every task.
//!
//! `cargo run --release -p oncue --example scene_map -- FOLDER_WITH_ROOMS ROOM OUT.json`

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::Path;

use oncue::Progress;
use oncue::scene::{ClearPath, SceneIndex, SceneSettings};
use serde_json::json;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, room, out] = arguments.as_slice() else {
        eprintln!("usage: scene_map FOLDER_WITH_ROOMS ROOM OUT.json");
        std::process::exit(2);
    };
    let folder = Path::new(folder);
    let mesh = common::glb::read(&folder.join(format!("{room}.glb")));
    let settings = SceneSettings::default();
    let scene = match SceneIndex::build(&mesh.positions, &mesh.triangles, &settings, &Progress::new()) {
        Ok(scene) => scene,
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(1);
        }
    };
    let grid = scene.occupancy();
    let tasks: Vec<_> = common::rooms::read(folder)
        .iter()
        .filter(|row| row.room == *room)
        .map(|row| {
            let ways = ClearPath::to_cue(&scene, &row.task.cue);
            let start = row.task.start.position.truncate();
            let ahead = [0.5, 1.0, 1.5].map(|d| ways.point_ahead(start, d).to_array());
            json!({
                "task": row.number,
                "start": start.to_array(),
                "pelvis": row.task.cue.position.to_array(),
                "heading": row.task.cue.planar().heading(),
                "path": ways.path(start).iter().map(|p| p.to_array()).collect::<Vec<_>>(),
                "approach": ways.approach_points().iter().map(|a| a.position.to_array()).collect::<Vec<_>>(),
                "ahead": ahead,
                "distance": ways.distance(start),
                "distances": (0..grid.raster.len()).map(|i| ways.distance(grid.raster.center(i))).collect::<Vec<_>>(),
            })
        })
        .collect();
    let map = json!({
        "origin": grid.raster.origin.to_array(),
        "cell": grid.raster.cell,
        "width": grid.raster.width,
        "height": grid.raster.height,
        "floor": scene.floor_height(),
        "occupied": grid.occupied_cells(),
        "walkable": grid.walkable_cells(),
        "clearance": grid.clearance_cells(),
        "tasks": tasks,
    });
    if let Err(error) = std::fs::write(out, map.to_string()) {
        eprintln!("{out}: {error}");
        std::process::exit(1);
    }
}
