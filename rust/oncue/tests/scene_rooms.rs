//! The scene index on every real room and task.

mod common;
#[path = "common/shared_tests.rs"]
mod shared_tests;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use glam::Vec3;
use oncue::Progress;
use oncue::scene::{ClearPath, SceneIndex, SceneSettings, check_task};

fn main() -> ExitCode {
    shared_tests::run(vec![shared_tests::needs(
        "data/rooms",
        "every_task_of_the_real_rooms_is_reachable_on_a_path_of_the_known_length",
        every_task_of_the_real_rooms_is_reachable_on_a_path_of_the_known_length,
    )])
}

fn every_task_of_the_real_rooms_is_reachable_on_a_path_of_the_known_length(folder: &Path) {
    let rows = common::rooms::read(folder);
    assert_eq!(rows.len(), 33);
    let mut scenes: BTreeMap<String, SceneIndex> = BTreeMap::new();
    let mut failures = Vec::new();
    println!(
        "room | task | floor | clearance (table) | known m | clear path m | ratio | approach m, degrees | check"
    );
    for row in &rows {
        let scene = scenes.entry(row.room.clone()).or_insert_with(|| {
            let mesh = common::glb::read(&folder.join(format!("{}.glb", row.room)));
            SceneIndex::build(&mesh.positions, &mesh.triangles, &SceneSettings::default(), &Progress::new())
                .unwrap()
        });
        let mut fail = |what: String| failures.push(format!("{} {}: {what}", row.room, row.number));
        if (scene.floor_height() - row.floor_z).abs() > 0.02 {
            fail(format!("floor at {}, not {}", scene.floor_height(), row.floor_z));
        }
        let check = check_task(scene, &row.task);
        if let Err(error) = &check {
            fail(error.to_string());
        }
        let start = row.task.start.position.truncate();
        let ways = ClearPath::to_cue(scene, &row.task.cue);
        let path = ways.path(start);
        let length: f32 = path.windows(2).map(|w| w[0].distance(w[1])).sum();
        let end = path.last().copied().unwrap_or(start);
        // To the seat on either side: the known path and the gap it ends with, ours and the rest from where it ends.
        let known = row.path + row.path_end_gap;
        let ratio = (length + end.distance(ways.goal())) / known;
        let seat = scene
            .floor_height_at(row.task.cue.position.truncate(), row.task.cue.position.z)
            .unwrap_or(f32::NAN);
        let approach = ways.approach_from(start);
        println!(
            "{} | {} | {:.3} | {:.2} ({:.2}) | {known:.2} | {:.2} ({:.2} by the field) | {ratio:.2} | {} | {} | seat {:.2} ({:.2})",
            row.room,
            row.number,
            scene.floor_height(),
            scene.occupancy().clearance(start),
            row.start_clearance,
            length + end.distance(ways.goal()),
            ways.distance(start),
            approach.map_or("none".into(), |a| format!(
                "{:.2}, {:.0}°{}",
                a.position.distance(ways.goal()),
                a.angle.to_degrees(),
                if ways.from_the_side() { ", side only" } else { "" }
            )),
            check.map_or_else(|e| e.to_string(), |()| "ok".into()),
            seat - scene.floor_height(),
            row.seat_height,
        );
        if path.len() < 2 {
            fail("no path".into());
        } else if !(0.75..1.25).contains(&ratio) && (ratio - 1.0).abs() * known > 0.5 {
            // The known path may end behind the seat, ours leads round to where one sits down: up to a step more.
            fail(format!("path of {:.2} m against {known:.2} m", ratio * known));
        }
        for point in &path[1..] {
            let chest = Vec3::new(point.x, point.y, scene.floor_height());
            if scene.occupancy().is_occupied(*point) {
                fail(format!("the path passes through furniture at {chest}"));
                break;
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
