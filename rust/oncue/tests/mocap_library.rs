//! Real motion capture, end to end: what a library built from it must keep and must not do.
//!
//! Reads `$ONCUE_SHARED/data/mocap` (default `<repository>/../shared`); tests of what is absent are ignored.

mod common;
#[path = "common/shared_tests.rs"]
mod shared_tests;

mod written;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

use oncue::ActionLabel;
use oncue::internals::{Sampler, UpAxis, foot, joint_names, leg_length, mocap_file, recognize_unit};
use oncue::library::{BuiltLibrary, Clip, LibrarySettings, Source, StarterUse, build};
use oncue::math::rotation::wrap_angle;
use oncue::motion::{Joint, Pose};
use oncue::{Error, Progress};
use shared_tests::{always, needs};
use written::Written;

fn settings() -> LibrarySettings {
    LibrarySettings {
        mirror: false,
        starter: StarterUse::None,
        raised_arms: true,
        ..LibrarySettings::default()
    }
}

/// The library of a folder, built once for all tests.
fn built(folder: &Path) -> Arc<BuiltLibrary> {
    static BUILT: Mutex<BTreeMap<PathBuf, Arc<BuiltLibrary>>> = Mutex::new(BTreeMap::new());
    let mut all = BUILT.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    all.entry(folder.to_path_buf())
        .or_insert_with(|| Arc::new(build(&[folder.to_path_buf()], &settings(), &Progress::new()).unwrap()))
        .clone()
}

/// Rows of INDEX.tsv for one set: trial → (category, net turn in degrees).
fn index(folder: &Path) -> BTreeMap<String, (String, Option<f32>)> {
    let set = folder.file_name().unwrap().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(folder.with_file_name("INDEX.tsv")).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split('\t').collect();
    let column = |name: &str| head.iter().position(|h| *h == name).unwrap();
    let (file, category, turn) = (column("file"), column("category"), column("net_turn_deg"));
    lines
        .map(|l| l.split('\t').collect::<Vec<_>>())
        .filter_map(|row| {
            let name = row[file].strip_prefix(&format!("{set}/"))?.strip_suffix(".bvh")?;
            Some((name.to_owned(), (row[category].to_owned(), row[turn].parse().ok())))
        })
        .collect()
}

fn poses(clip: &Clip) -> Vec<Pose> {
    clip.motion.postures.iter().map(|p| p.pose()).collect()
}

/// Heading of the line between the hip joints at the end less that at the start, all turns counted, degrees.
fn net_turn(poses: &[Pose]) -> f32 {
    let heading = |p: &Pose| {
        let left = p.position(Joint::LeftUpLeg) - p.position(Joint::RightUpLeg);
        left.y.atan2(left.x)
    };
    poses.windows(2).map(|w| wrap_angle(heading(&w[1]) - heading(&w[0]))).sum::<f32>().to_degrees()
}

/// Whether a frame is in a segment that is matched (anything but Other).
fn matched(clip: &Clip, frame: usize) -> bool {
    clip.segments.iter().any(|s| s.label != ActionLabel::Other && (s.first..s.end).contains(&frame))
}

fn seconds(clip: &Clip, label: ActionLabel) -> f32 {
    clip.segments.iter().filter(|s| s.label == label).map(|s| (s.end - s.first) as f32 / 30.0).sum()
}

fn main() -> ExitCode {
    // A set that is absent is ignored by itself.
    let of_sets = ["accad", "cmu", "bandai"].into_iter().flat_map(|set| {
        let test =
            move |name: &str, test| needs(&format!("data/mocap/{set}"), &format!("{set}::{name}"), test);
        [
            test(
                "every_file_is_built_or_skipped_with_a_reason",
                every_file_is_built_or_skipped_with_a_reason,
            ),
            test("turns_are_the_sources", turns_are_the_sources),
            test("travel_and_units_are_the_sources", travel_and_units_are_the_sources),
            test(
                "planted_feet_stay_and_soles_stay_above_the_floor",
                planted_feet_stay_and_soles_stay_above_the_floor,
            ),
            test(
                "walking_feet_are_planted_about_half_of_the_time",
                walking_feet_are_planted_about_half_of_the_time,
            ),
            test("labels_fit_the_categories", labels_fit_the_categories),
            test("bodies_stand_upright", bodies_stand_upright_with_knees_forward_and_arms_down),
        ]
    });
    let accad = |name: &str, test| needs("data/mocap/accad", &format!("accad::{name}"), test);
    let cmu = |name: &str, test| needs("data/mocap/cmu", &format!("cmu::{name}"), test);
    let others = [
        accad("stops_are_found_where_accad_stops", stops_are_found_where_accad_stops),
        accad("a_good_file_among_bad_ones_is_used", a_good_file_among_bad_ones_is_used),
        accad("the_starter_fills_what_mocap_lacks", the_starter_fills_what_mocap_lacks),
        cmu("one_library_whatever_the_number_of_threads", one_library_whatever_the_number_of_threads),
        always("bad_input_gets_a_sentence", bad_input_gets_a_sentence),
        always(
            "a_known_motion_comes_back_whatever_its_joints_frames",
            a_known_motion_comes_back_whatever_its_joints_frames,
        ),
        always("sidecars_label_and_exclude", sidecars_label_and_exclude),
    ];
    shared_tests::run(of_sets.chain(others).collect())
}

/// The name of a set, of its folder.
fn set_of(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn every_file_is_built_or_skipped_with_a_reason(folder: &Path) {
    let set = set_of(folder);
    let files =
        std::fs::read_dir(folder).unwrap().filter_map(|e| e.ok()?.path().extension().map(|e| e == "bvh"));
    let count = files.filter(|&bvh| bvh).count();
    let built = built(folder);
    for skipped in built.skipped() {
        eprintln!("{}: {:?}", skipped.file.display(), skipped.reason);
        assert!(skipped.reason.as_ref().is_some_and(|reason| reason.ends_with('.')));
    }
    assert_eq!((built.captures.len(), built.skipped().count()), (count, 0), "{set}");
    // Nothing of them is read otherwise than it stands there.
    let notes: Vec<_> = built.captures.iter().filter(|c| !c.notes.is_empty()).collect();
    assert!(notes.is_empty(), "{notes:?}");
    for clip in &built.library.clips {
        let mut end = 0;
        for segment in &clip.segments {
            assert_eq!(segment.first, end, "{}: segments cover the clip", clip.name);
            assert!(segment.first < segment.end && (segment.first..segment.end).contains(&segment.complete));
            end = segment.end;
        }
        assert_eq!(end, clip.motion.len(), "{}", clip.name);
    }
}

fn turns_are_the_sources(folder: &Path) {
    let set = set_of(folder);
    let index = index(folder);
    let (mut far, mut count) = (Vec::new(), 0);
    for clip in &built(folder).library.clips {
        // On hands and knees or on the back a heading means little.
        let (category, Some(turn)) = &index[&clip.name] else { continue };
        if ["crawl", "lie/getup"].contains(&category.as_str()) {
            continue;
        }
        count += 1;
        let ours = net_turn(&poses(clip));
        if (ours - turn).abs() > 10.0 {
            far.push(format!("{} ({category}): {ours:.0}° for {turn:.0}°", clip.name));
        }
    }
    eprintln!("{set}: {} of {count} turns off by more than 10°: {far:?}", far.len());
    assert!(far.len() * 20 <= count, "{set}: {far:?}");
}

fn travel_and_units_are_the_sources(folder: &Path) {
    for clip in &built(folder).library.clips {
        let path = folder.join(format!("{}.bvh", clip.name));
        let file = mocap_file::read(&path).unwrap();
        let table = joint_names::recognize(&file, None).unwrap();
        let unit = recognize_unit(leg_length(&file, &table));
        let expected = if clip.name.contains("cgspeed") { "0.45 inch" } else { "cm" };
        assert_eq!(unit.map(|u| u.0), Some(expected), "{}", clip.name);
        let mut sampler = Sampler::new(&file, &table, UpAxis::Y).unwrap();
        assert!((clip.motion.len()..clip.motion.len() + 3).contains(&sampler.frame_count()));
        let hips = |s: &Sampler| {
            let middle = s.position(Joint::LeftUpLeg).unwrap() + s.position(Joint::RightUpLeg).unwrap();
            middle.truncate() / 2.0
        };
        let (mut theirs, mut ours, mut last) = (0.0, 0.0, None);
        let poses = poses(clip);
        for frame in (0..poses.len()).step_by(5) {
            sampler.sample(frame);
            let at = hips(&sampler);
            let middle = poses[frame].position(Joint::LeftUpLeg) + poses[frame].position(Joint::RightUpLeg);
            let own = middle.truncate() / 2.0;
            if let Some((before, own_before)) = last {
                theirs += at.distance(before);
                ours += own.distance(own_before);
            }
            last = Some((at, own));
        }
        if theirs > 1.0 {
            assert!((ours / theirs - 1.0).abs() < 0.05, "{}: {ours} m for {theirs} m", clip.name);
        }
    }
}

fn planted_feet_stay_and_soles_stay_above_the_floor(folder: &Path) {
    let set = set_of(folder);
    let (mut worst, mut lowest, mut flat, mut stance) = (0.0f32, f32::MAX, 0, 0);
    for clip in &built(folder).library.clips {
        let poses = poses(clip);
        for frame in 1..poses.len() {
            if !(matched(clip, frame) && matched(clip, frame - 1)) {
                continue;
            }
            for (side, toe) in Joint::TOES.into_iter().enumerate() {
                let contact = |f: usize| clip.motion.contacts[f][side];
                let sole = foot::sole(&poses[frame], side);
                lowest = lowest.min(sole.iter().map(|p| p.z).fold(f32::MAX, f32::min));
                if contact(frame) == 1.0 && contact(frame - 1) == 1.0 {
                    let slide = poses[frame].position(toe).distance(poses[frame - 1].position(toe));
                    assert!(slide < 1e-3, "{} slides {slide} m at frame {frame}", clip.name);
                    worst = worst.max(slide);
                    stance += 1;
                    flat += usize::from(sole[2].z < 0.02);
                }
            }
        }
    }
    eprintln!(
        "{set}: slide at most {:.2} mm, lowest {:.2} mm, toes flat in {:.1} % of stance",
        worst * 1e3,
        lowest * 1e3,
        100.0 * flat as f32 / stance as f32
    );
    assert!(lowest > -0.005, "{set}: {lowest}");
    assert!(flat as f32 > 0.9 * stance as f32, "{set}: planted toes lie on the floor");
}

fn walking_feet_are_planted_about_half_of_the_time(folder: &Path) {
    let set = set_of(folder);
    let index = index(folder);
    let mut ratios: Vec<f32> = Vec::new();
    for clip in &built(folder).library.clips {
        if index[&clip.name].0 != "walk" {
            continue;
        }
        for side in 0..2 {
            let frames: Vec<f32> = (0..clip.motion.len())
                .filter(|&f| matched(clip, f))
                .map(|f| clip.motion.contacts[f][side])
                .collect();
            if frames.len() > 60 {
                ratios.push(frames.iter().filter(|&&c| c == 1.0).count() as f32 / frames.len() as f32);
            }
        }
    }
    ratios.sort_by(f32::total_cmp);
    let median = ratios[ratios.len() / 2];
    eprintln!(
        "{set}: toe planted {:.2} … {median:.2} … {:.2} of a walk",
        ratios[0],
        ratios[ratios.len() - 1]
    );
    // A foot stands for 60 % of the cycle; its toe lands 8–12 % after the heel.
    assert!(
        (0.45..0.62).contains(&median) && ratios[0] > 0.25 && ratios[ratios.len() - 1] < 0.75,
        "{set} {ratios:?}"
    );
}

fn labels_fit_the_categories(folder: &Path) {
    let set = set_of(folder);
    let index = index(folder);
    let mut shares: BTreeMap<String, BTreeMap<String, f32>> = BTreeMap::new();
    let mut totals: BTreeMap<String, f32> = BTreeMap::new();
    for clip in &built(folder).library.clips {
        let category = &index[&clip.name].0;
        for &label in ActionLabel::ALL {
            *shares.entry(category.clone()).or_default().entry(format!("{label:?}")).or_default() +=
                seconds(clip, label);
        }
        *totals.entry(category.clone()).or_default() += clip.motion.len() as f32 / 30.0;
    }
    let share = |category: &str, label: &str| match totals.get(category) {
        Some(total) => shares[category][label] / total,
        None => f32::NAN,
    };
    for (category, total) in &totals {
        let row: Vec<String> = shares[category]
            .iter()
            .filter(|(_, s)| **s > 0.0)
            .map(|(l, s)| format!("{l} {:.0} %", 100.0 * s / total))
            .collect();
        eprintln!("{set} {category}: {}", row.join(", "));
    }
    // NaN, where a set lacks the category, passes.
    let wrong = |bad: bool, what: &str| assert!(!bad, "{set}: {what}");
    wrong(share("walk", "Walk") < 0.8, "walks are Walk");
    wrong(share("turn-left", "Walk") < 0.7, "turns are Walk");
    wrong(share("idle", "Idle") < 0.8, "idles are Idle");
    for category in ["run", "run turn-left", "run turn-right", "crawl", "lie/getup"] {
        wrong(share(category, "Other") < 0.45, category);
        wrong(share(category, "Sit") + share(category, "SeatedIdle") > 0.0, category);
    }
    // What only looks like sitting must not be offered as a sit; who does sit, gets up or stays seated must be found.
    for (category, shares) in &shares {
        let seated = ["Sit", "SeatedIdle", "StandUp"].map(|label| shares[label]);
        if category.contains("sit") {
            wrong(seated.contains(&0.0), &format!("{category}: a sit is not found whole, {seated:?}"));
        } else {
            wrong(seated.iter().sum::<f32>() > 0.0, &format!("{category}: a sit is found where nobody sits"));
        }
    }
}

fn stops_are_found_where_accad_stops(folder: &Path) {
    let built = built(folder);
    let library = &built.library;
    for name in ["Male1_B2_WalkToStand", "Male1_B5_WalkBackToStand"] {
        let clip = library.clips.iter().find(|c| c.name == name).unwrap();
        let stop =
            clip.segments.iter().find(|s| s.label == ActionLabel::Stop).unwrap_or_else(|| panic!("{name}"));
        let poses = poses(clip);
        let moved = |a: usize, b: usize| {
            poses[a].position(Joint::Hips).truncate().distance(poses[b].position(Joint::Hips).truncate())
        };
        assert!(moved(stop.first, stop.complete) > 0.25, "{name} walks into its stop");
        assert!(moved(stop.complete, clip.motion.len() - 1) < 0.08, "{name} stands after it");
    }
}

fn bodies_stand_upright_with_knees_forward_and_arms_down(folder: &Path) {
    for clip in &built(folder).library.clips {
        let walk: Vec<Pose> = poses(clip)
            .into_iter()
            .enumerate()
            .filter(|(f, _)| {
                clip.segments.iter().any(|s| s.label == ActionLabel::Walk && (s.first..s.end).contains(f))
            })
            .map(|(_, p)| p)
            .collect();
        if walk.len() < 30 {
            continue;
        }
        let mean = |of: &dyn Fn(&Pose) -> f32| walk.iter().map(of).sum::<f32>() / walk.len() as f32;
        let forward = |p: &Pose| {
            let left = (p.position(Joint::LeftUpLeg) - p.position(Joint::RightUpLeg)).normalize();
            left.cross(glam::Vec3::Z).normalize()
        };
        let name = &clip.name;
        // The knee lies before the line from hip to ankle.
        let knee = mean(&|p| {
            let (hip, ankle) = (p.position(Joint::LeftUpLeg), p.position(Joint::LeftFoot));
            (p.position(Joint::LeftLeg) - (hip + ankle) / 2.0).dot(forward(p))
        });
        assert!(knee > 0.02, "{name}: knees point {knee}");
        // Feet, face and chest look the way the hips do.
        for joint in [Joint::LeftFoot, Joint::RightFoot, Joint::Head, Joint::Spine2] {
            let facing = mean(&|p| (p.rotation(joint) * glam::Vec3::NEG_Y).dot(forward(p)));
            // Who steps sideways looks where he goes.
            let least = if joint == Joint::Head { 0.3 } else { 0.55 };
            assert!(facing > least, "{name}: {joint:?} faces {facing}");
        }
        let upright = mean(&|p| (p.position(Joint::Neck) - p.position(Joint::Hips)).normalize().z);
        assert!(upright > 0.85, "{name}: trunk {upright}");
        let hang = mean(&|p| (p.position(Joint::LeftForeArm) - p.position(Joint::LeftArm)).normalize().z);
        assert!(hang < -0.5, "{name}: upper arm {hang}");
    }
}

fn one_library_whatever_the_number_of_threads(folder: &Path) {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            build(&[folder.to_path_buf()], &settings(), &Progress::new()).unwrap().library.checksum()
        })
    };
    assert_eq!(on(1), on(3));
}

/// A skeleton without a person.
const CHAIR: &str = "HIERARCHY\nROOT Seat\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.03\n0 0 0\n0 0 0\n";

fn bad_input_gets_a_sentence() {
    let dir = std::env::temp_dir().join(format!("oncue-bad-mocap-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let fail = |paths: &[PathBuf]| build(paths, &settings(), &Progress::new()).unwrap_err();
    let gone = dir.join("gone");
    assert!(matches!(fail(std::slice::from_ref(&gone)), Error::Io { file, .. } if file == gone));
    assert!(fail(std::slice::from_ref(&dir)).to_string().contains("holds no .bvh files"));
    std::fs::write(dir.join("empty.bvh"), "").unwrap();
    std::fs::write(dir.join("binary.bvh"), [0u8, 1, 2, 3]).unwrap();
    std::fs::write(dir.join("chair.bvh"), CHAIR).unwrap();
    let reason = fail(std::slice::from_ref(&dir)).to_string();
    assert!(reason.starts_with("None of the 3 motion capture files could be used; binary.bvh:"), "{reason}");
    let progress = Progress::new();
    progress.cancel();
    assert!(matches!(build(std::slice::from_ref(&dir), &settings(), &progress), Err(Error::Cancelled)));
    std::fs::remove_dir_all(&dir).unwrap();
}

fn a_good_file_among_bad_ones_is_used(folder: &Path) {
    let dir = std::env::temp_dir().join(format!("oncue-mixed-mocap-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    std::fs::write(dir.join("empty.bvh"), "").unwrap();
    std::fs::write(dir.join("chair.bvh"), CHAIR).unwrap();
    let good = folder.join("Male1_B3_Walk.bvh");
    let built = build(&[dir.clone(), good], &settings(), &Progress::new()).unwrap();
    assert_eq!((built.library.clips.len(), built.skipped().count()), (1, 2));
    assert!(
        built
            .skipped()
            .filter_map(|s| s.reason.as_ref())
            .any(|r| r.contains("LeftUpLeg") && r.contains("Seat"))
    );
    std::fs::remove_dir_all(&dir).unwrap();
}

fn the_starter_fills_what_mocap_lacks(folder: &Path) {
    let settings = LibrarySettings::default();
    let library = build(&[folder.to_path_buf()], &settings, &Progress::new()).unwrap().library;
    let summary = library.summary();
    let turns = summary.turn_shortfall.as_ref().expect("nobody turns from standing four times");
    assert!(turns.contains("1 turns from standing to the left and 1 to the right"), "{turns}");
    for row in &summary.rows {
        // Of turns from standing what is walked and stood is the starter's, and no more.
        let turning = [ActionLabel::Walk, ActionLabel::Idle].contains(&row.label);
        let lacking = [ActionLabel::Sit, ActionLabel::SeatedIdle, ActionLabel::StandUp].contains(&row.label);
        assert_eq!(row.procedural_seconds > 0.0, lacking || turning, "{:?}", row.label);
        assert_eq!(row.shortfall.is_some(), lacking, "{:?}", row.label);
        assert_eq!(row.mocap_seconds, row.mirrored_seconds, "{:?}", row.label);
    }
    let walks = |clip: &&Clip| {
        clip.source == Source::Procedural && clip.segments.iter().any(|s| s.label == ActionLabel::Walk)
    };
    let turned: Vec<&str> = library.clips.iter().filter(walks).map(|clip| clip.name.as_str()).collect();
    assert!(turned.len() > 20 && turned.iter().all(|name| name.contains("turn")), "{turned:?}");
}

fn a_known_motion_comes_back_whatever_its_joints_frames() {
    let dir = std::env::temp_dir().join(format!("oncue-round-trip-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let starter = oncue::library::starter::generate(&Progress::new()).unwrap();
    let pick = |start: &str| starter.clips.iter().find(|c| c.name.starts_with(start)).unwrap();
    let takes = [
        (pick("walk 1.00"), 100.0, UpAxis::Y),
        (pick("walk 1.00"), 1.0, UpAxis::Z),
        (pick("sit 46 cm, turn 30"), 39.37, UpAxis::Y),
        (pick("stand up 46"), 1000.0, UpAxis::Z),
    ];
    for (seed, (original, units, up)) in takes.into_iter().enumerate() {
        let path = dir.join("known.bvh");
        std::fs::write(
            &path,
            Written { seed: seed as u64, units_in_a_metre: units, up, ..Written::default() }.text(original),
        )
        .unwrap();
        let built = build(&[path], &settings(), &Progress::new()).unwrap();
        let clip = &built.library.clips[0];
        let (a, b) = (poses(original), poses(clip));
        let count = b.len();
        assert!(a.len() - count < 3);
        let mut worst = [(0.0f32, 0); 22];
        for frame in 0..count {
            for joint in Joint::ALL {
                let off = a[frame].position(joint).distance(b[frame].position(joint));
                if off > worst[joint.index()].0 {
                    worst[joint.index()] = (off, frame);
                }
            }
        }
        let table: Vec<String> =
            Joint::ALL.iter().map(|j| format!("{} {:.0}", j.name(), 1e3 * worst[j.index()].0)).collect();
        eprintln!("{}: worst mm {}", original.name, table.join(", "));
        for joint in Joint::ALL {
            let leg = joint >= Joint::LeftUpLeg || joint == Joint::Hips;
            // A knee that is nearly straight answers millimetres of the cleaned foot with centimetres.
            let allowed = if leg { 0.06 } else { 0.02 };
            assert!(
                worst[joint.index()].0 < allowed,
                "{}: {joint:?} {:?}",
                original.name,
                worst[joint.index()]
            );
        }
        // The labels found are the labels made, up to where an action begins.
        for wanted in &original.segments {
            if matches!(wanted.label, ActionLabel::Sit | ActionLabel::StandUp | ActionLabel::Stop) {
                let found = clip.segments.iter().find(|s| s.label == wanted.label);
                let found = found.unwrap_or_else(|| {
                    panic!("{}: no {:?} in {:?}", original.name, wanted.label, clip.segments)
                });
                // The one counts from the pelvis at rest and the trunk near it, the other until the trunk is, whose last
                // tenth of a radian takes half a second.
                assert!(
                    found.complete.abs_diff(wanted.complete) < 27,
                    "{}: {found:?} for {wanted:?}",
                    original.name
                );
            }
        }
    }
    std::fs::remove_dir_all(&dir).unwrap();
}

fn sidecars_label_and_exclude() {
    let dir = std::env::temp_dir().join(format!("oncue-sidecar-build-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let starter = oncue::library::starter::generate(&Progress::new()).unwrap();
    let walk = starter.clips.iter().find(|c| c.name.starts_with("walk 1.00")).unwrap();
    for name in ["a", "b", "c"] {
        std::fs::write(
            dir.join(format!("{name}.bvh")),
            Written { seed: 7, units_in_a_metre: 100.0, up: UpAxis::Y, ..Written::default() }.text(walk),
        )
        .unwrap();
    }
    // The file's own frames: 60 Hz, so twice ours.
    let labels = r#"{"labels": [{"label": "sit", "first": 100, "end": 200, "complete": 180}]}"#;
    std::fs::write(dir.join("a.oncue.json"), labels).unwrap();
    std::fs::write(dir.join("oncue.json"), r#"{"files": {"b.bvh": {"exclude": true}}}"#).unwrap();
    std::fs::write(dir.join("c.oncue.json"), r#"{"labels": [{"label": "dance", "first": 0, "end": 2}]}"#)
        .unwrap();
    let built = build(std::slice::from_ref(&dir), &settings(), &Progress::new()).unwrap();
    assert_eq!(built.library.clips.len(), 1);
    let sit = built.library.clips[0].segments.iter().find(|s| s.label == ActionLabel::Sit).unwrap();
    assert_eq!((sit.first, sit.end, sit.complete), (50, 100, 90));
    let reasons: Vec<&str> = built.skipped().filter_map(|s| s.reason.as_deref()).collect();
    assert!(
        reasons[0].contains("excludes it") && reasons[1].contains("c.oncue.json was not understood"),
        "{reasons:?}"
    );
    std::fs::remove_dir_all(&dir).unwrap();
}
