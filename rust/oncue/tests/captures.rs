//! Captures as artists have them: other names, axes, rates and sides, and ways that were taken from the walk.

mod written;

use std::path::PathBuf;

use oncue::internals::UpAxis;
use oncue::library::{BuiltLibrary, Capture, CaptureSource, Clip, LibrarySettings, StarterUse, build};
use oncue::motion::{Joint, Pose};
use oncue::{ActionLabel, Error, Progress};
use written::Written;

/// A folder of this test's own, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("oncue-captures-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, text).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn only(path: PathBuf) -> Result<BuiltLibrary, Error> {
    let settings = LibrarySettings { mirror: false, starter: StarterUse::None, ..LibrarySettings::default() };
    build(&[path], &settings, &Progress::new())
}

/// A walk with turns, made by rule.
fn walk() -> Clip {
    let starter = oncue::library::starter::generate(&Progress::new()).unwrap();
    let long = |c: &&Clip| c.name.starts_with("walk 1.00") && c.motion.len() > 150;
    starter.clips.iter().find(long).unwrap().clone()
}

/// What one file gave, and its clip.
fn read(folder: &Folder, text: &str) -> (Capture, Clip) {
    let built = only(folder.write("take.bvh", text)).unwrap();
    (built.captures[0].clone(), built.library.clips[0].clone())
}

fn poses(clip: &Clip) -> Vec<Pose> {
    clip.motion.postures.iter().map(|p| p.pose()).collect()
}

/// Largest distance of a foot, a hand or the head from where it is in the original, metres.
fn off(original: &Clip, clip: &Clip, mirrored: bool) -> f32 {
    let original = if mirrored { original.mirror() } else { original.clone() };
    let (a, b) = (poses(&original), poses(clip));
    assert!(a.len() - b.len() < 3, "{} frames of {}", b.len(), a.len());
    // Where it begins and which way it faces is free.
    let (from, to) = (clip.motion.postures[0].planar(), original.motion.postures[0].planar());
    let mut worst = 0.0f32;
    for frame in 0..b.len() {
        let pose = clip.motion.postures[frame].moved(from, to).pose();
        for joint in [Joint::LeftFoot, Joint::RightFoot, Joint::LeftHand, Joint::RightHand, Joint::Head] {
            worst = worst.max(a[frame].position(joint).distance(pose.position(joint)));
        }
    }
    worst
}

#[test]
fn six_up_axes_read_alike() {
    let (folder, walk) = (Folder::new("up"), walk());
    for up in UpAxis::ALL {
        let (capture, clip) = read(&folder, &Written { up, ..Written::default() }.text(&walk));
        assert!(off(&walk, &clip, false) < 0.06, "{up:?}: {} m", off(&walk, &clip, false));
        let said = capture.notes.iter().any(|note| note.contains("points up"));
        assert_eq!(said, !matches!(up, UpAxis::Y | UpAxis::Z), "{up:?}: {:?}", capture.notes);
        assert_eq!(capture.notes.len(), usize::from(said));
    }
}

#[test]
fn a_skeleton_without_names_is_told_by_its_shape() {
    let (folder, walk) = (Folder::new("shape"), walk());
    let nameless = |name: &str| {
        let number = oncue::motion::skeleton::NAMES.iter().position(|n| *n == name).unwrap_or_default();
        format!("Bone_{number:03}")
    };
    for up in [UpAxis::Y, UpAxis::Z] {
        let (capture, clip) =
            read(&folder, &Written { name: nameless, up, ..Written::default() }.text(&walk));
        assert!(capture.notes[0].contains("shape tells which is which"), "{:?}", capture.notes);
        assert!(off(&walk, &clip, false) < 0.06, "{}", off(&walk, &clip, false));
    }
    // Who stands stiffly shows no knees, but his toes.
    let built =
        only(folder.write("take.bvh", &Written { name: nameless, ..Written::default() }.text(&still(&walk))));
    assert!(built.is_ok(), "{:?}", built.err());
}

#[test]
fn a_mapping_file_says_the_up_axis() {
    let (folder, walk) = (Folder::new("told"), walk());
    folder.write("take.oncue.json", r#"{"up": "-y"}"#);
    let (capture, clip) = read(&folder, &Written { up: UpAxis::Y, ..Written::default() }.text(&walk));
    // It is believed, although it is wrong: the head is under the feet.
    let upside_down = poses(&clip).iter().all(|p| p.position(Joint::Head).z < p.position(Joint::LeftFoot).z);
    assert!(upside_down && capture.notes.is_empty(), "{:?}", capture.notes);
    assert!(!capture.seconds.contains_key(&ActionLabel::Walk), "{:?}", capture.seconds);
    assert!(capture.reason.unwrap().contains("none of it is walking"));
}

#[test]
fn exchanged_sides_and_left_handed_files_are_mended() {
    let (folder, walk) = (Folder::new("sides"), walk());
    let other = |name: &str| match name.strip_prefix("Left") {
        Some(rest) => format!("Right{rest}"),
        None => name.replace("Right", "Left"),
    };
    let exchanged = Written { name: other, ..Written::default() };
    let (capture, clip) = read(&folder, &exchanged.text(&walk));
    assert!(capture.notes[0].contains("left and right legs and arms were exchanged"), "{:?}", capture.notes);
    assert!(off(&walk, &clip, false) < 0.06);
    // A left-handed file is the picture in the mirror: its sides are those of the mirrored walk.
    let (capture, clip) = read(&folder, &Written { left_handed: true, ..Written::default() }.text(&walk));
    assert!(capture.notes[0].contains("were exchanged"), "{:?}", capture.notes);
    assert!(off(&walk, &clip, true) < 0.06, "{}", off(&walk, &clip, true));
    // Only the arms.
    let arms = |name: &str| match ["Arm", "Hand", "Shoulder"].iter().any(|part| name.contains(part)) {
        true => match name.strip_prefix("Left") {
            Some(rest) => format!("Right{rest}"),
            None => name.replace("Right", "Left"),
        },
        false => name.to_owned(),
    };
    let (capture, clip) = read(&folder, &Written { name: arms, ..Written::default() }.text(&walk));
    assert!(capture.notes[0].contains("left and right arms were exchanged"), "{:?}", capture.notes);
    assert!(off(&walk, &clip, false) < 0.06);
}

#[test]
fn knees_that_bend_against_the_toes_are_no_persons() {
    let (folder, mut bird) = (Folder::new("bird"), walk());
    for posture in &mut bird.motion.postures {
        for knee in [Joint::LeftLeg, Joint::RightLeg] {
            let bend = &mut posture.rotations[knee.index()];
            *bend = bend.inverse();
        }
    }
    let reason = only(folder.write("bird.bvh", &Written::default().text(&bird))).unwrap_err().to_string();
    assert!(reason.contains("knees bend forward of its toes"), "{reason}");
}

#[cfg(unix)]
#[test]
fn what_is_reached_in_two_ways_is_one_capture() {
    let (folder, walk) = (Folder::new("links"), walk());
    let text = Written::default().text(&walk);
    let file = folder.write("take.bvh", &text);
    let inner = folder.0.join("inner");
    std::fs::create_dir_all(&inner).unwrap();
    std::os::unix::fs::symlink(&folder.0, inner.join("up")).unwrap();
    std::os::unix::fs::symlink(&inner, folder.0.join("again")).unwrap();
    std::os::unix::fs::symlink(&file, folder.0.join("zz other name.bvh")).unwrap();
    let settings = LibrarySettings { mirror: false, starter: StarterUse::None, ..LibrarySettings::default() };
    let linked = inner.join("up");
    let built = build(&[folder.0.clone(), file.clone(), linked], &settings, &Progress::new()).unwrap();
    assert_eq!(built.captures.len(), 1, "{:?}", built.captures.iter().map(|c| &c.file).collect::<Vec<_>>());
    assert_eq!(built.captures[0].file, file);
}

/// A `.bvh` whose thighs and shins are so many times as long.
fn with_legs(text: &str, times: f32) -> String {
    let mut scaled = false;
    let lines = text.lines().map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["JOINT", name] => {
                scaled = name.ends_with("Leg") && !name.ends_with("UpLeg") || name.ends_with("Foot")
            }
            ["End", _] => scaled = false,
            ["OFFSET", x, y, z] if scaled => {
                let times = |word: &str| times * word.parse::<f32>().unwrap();
                return format!("OFFSET {} {} {}\n", times(x), times(y), times(z));
            }
            _ => {}
        }
        format!("{line}\n")
    });
    lines.collect()
}

#[test]
fn legs_like_nobodys_are_named() {
    let (folder, walk) = (Folder::new("legs"), walk());
    let text = Written::default().text(&walk);
    for times in [0.3, 3.0] {
        let Err(Error::Input(said)) = only(folder.write("take.bvh", &with_legs(&text, times))) else {
            panic!("it was read")
        };
        assert!(said.contains("times as long as its trunk"), "{said}");
    }
    // A child's, and those of somebody very tall.
    for times in [0.65, 1.0, 1.3] {
        let (capture, _) = read(&folder, &with_legs(&text, times));
        assert!(capture.seconds[&ActionLabel::Walk] > 3.0, "{times}: {:?}", capture.seconds);
    }
}

#[test]
fn a_rate_that_cannot_be_is_questioned() {
    let (folder, walk) = (Folder::new("rate"), walk());
    for header_rate in [1.0, 12.0, 20.0, 240.0] {
        let (capture, clip) = read(&folder, &Written { header_rate, ..Written::default() }.text(&walk));
        assert!(capture.notes[0].contains("60 was taken"), "{header_rate}: {:?}", capture.notes);
        assert!(off(&walk, &clip, false) < 0.06, "{header_rate}");
    }
    // A person knows better.
    folder.write("take.oncue.json", r#"{"rate": 12}"#);
    let (capture, clip) = read(&folder, &Written { header_rate: 1.0, ..Written::default() }.text(&walk));
    assert!(capture.notes.is_empty(), "{:?}", capture.notes);
    assert!(clip.motion.len().abs_diff(5 * walk.motion.len()) < 10, "{} frames", clip.motion.len());
    folder.write("take.oncue.json", r#"{"rate": 0}"#);
    let reason = only(folder.0.join("take.bvh")).unwrap_err().to_string();
    assert!(reason.contains("gives it 0 frames a second; from 1 to 1000 can be"), "{reason}");
    // Where nobody walks nothing tells.
    let still = still(&walk);
    std::fs::remove_file(folder.0.join("take.oncue.json")).unwrap();
    let text = Written { header_rate: 1.0, ..Written::default() }.text(&still);
    let reason = only(folder.write("take.bvh", &text)).unwrap_err().to_string();
    assert!(reason.contains("1.00 frames a second, which no capture has"), "{reason}");
    assert!(reason.contains("docs/captures.md"), "{reason}");
}

/// Two seconds of the first pose.
fn still(clip: &Clip) -> Clip {
    let mut still = clip.clone();
    still.motion.postures = vec![clip.motion.postures[0]; 60];
    still.motion.contacts = vec![[1.0; 2]; 60];
    still
}

#[test]
fn a_walk_on_the_spot_gets_its_way_back() {
    let (folder, walk) = (Folder::new("spot"), walk());
    let (capture, clip) = read(&folder, &Written { on_the_spot: true, ..Written::default() }.text(&walk));
    assert!(capture.notes[0].contains("walks on the spot"), "{:?}", capture.notes);
    let share = way(&clip) / way(&walk);
    assert!((0.93..1.07).contains(&share), "{} m for {} m", way(&clip), way(&walk));
    assert!(capture.seconds[&ActionLabel::Walk] > 3.0, "{:?}", capture.seconds);
    // Who stands still is left standing.
    let (capture, _) = read(&folder, &Written::default().text(&still(&walk)));
    assert!(capture.notes.is_empty(), "{:?}", capture.notes);
}

#[test]
fn a_way_that_is_not_that_of_its_steps_is_mended_or_named() {
    let (folder, walk) = (Folder::new("travel"), walk());
    for way_times in [0.01, 0.5, 1.6, 2.0, 2.54, 30.0] {
        let (capture, clip) = read(&folder, &Written { way_times, ..Written::default() }.text(&walk));
        let (way, whole) = (way(&clip), way(&walk));
        assert!((0.88..1.07).contains(&(way / whole)), "{way_times}: {way} m for {whole} m");
        assert!(capture.seconds[&ActionLabel::Walk] > 3.0, "{way_times}: {:?}", capture.seconds);
        let said = if way_times < 0.1 { "it walks on the spot" } else { "as its planted feet allow" };
        assert!(
            capture.notes.len() == 1 && capture.notes[0].contains(said),
            "{way_times}: {:?}",
            capture.notes
        );
    }
    // Feet roll, and people differ.
    for way_times in [0.85, 1.0, 1.2] {
        let (capture, _) = read(&folder, &Written { way_times, ..Written::default() }.text(&walk));
        assert!(capture.notes.is_empty(), "{way_times}: {:?}", capture.notes);
    }
    // On skates, and backwards over feet that go forward.
    let mut skates = walk.clone();
    for (frame, posture) in skates.motion.postures.iter_mut().enumerate() {
        *posture = walk.motion.postures[0];
        posture.root_position.y -= 0.04 * frame as f32;
    }
    let backwards = Written { way_times: -1.0, ..Written::default() }.text(&walk);
    for text in [Written::default().text(&skates), backwards] {
        let path = folder.write("take.bvh", &text);
        let reason = only(path.clone()).unwrap_err().to_string();
        assert!(reason.contains("its feet glide, or its way is not that of its steps"), "{reason}");
        folder.write("take.oncue.json", r#"{"labels": [{"label": "walk", "first": 0, "end": 60}]}"#);
        let told = only(path).unwrap();
        assert!(told.captures[0].notes.is_empty() && told.captures[0].seconds[&ActionLabel::Walk] > 0.9);
        std::fs::remove_file(folder.0.join("take.oncue.json")).unwrap();
    }
}

/// How far a clip goes, metres, measured each half second.
fn way(clip: &Clip) -> f32 {
    let places: Vec<_> = clip.motion.postures.iter().step_by(15).map(|p| p.planar().position).collect();
    places.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

#[test]
fn each_file_is_told_with_what_it_gave() {
    let (folder, walk) = (Folder::new("rows"), walk());
    folder.write("a walk.bvh", &Written::default().text(&walk));
    folder.write("damaged.bvh", "HIERARCHY");
    // A walk with both hands up is none that is matched.
    let mut hands_up = walk.clone();
    for posture in &mut hands_up.motion.postures {
        for (arm, turn) in [(Joint::LeftArm, -1.2f32), (Joint::RightArm, 1.2)] {
            posture.rotations[arm.index()] = glam::Quat::from_rotation_y(turn);
        }
    }
    folder.write("hands up.bvh", &Written::default().text(&hands_up));
    let built = only(folder.0.clone()).unwrap();
    let [walk, damaged, hands_up] = &built.captures[..] else { panic!("{:?}", built.captures) };
    assert_eq!(walk.clip.as_deref(), Some("a walk"));
    let seconds: f32 = walk.seconds.values().sum();
    assert!((seconds - built.library.clips[0].motion.len() as f32 / 30.0).abs() < 1e-3);
    assert!(walk.seconds[&ActionLabel::Walk] > 3.0);
    assert!(damaged.clip.is_none() && damaged.seconds.is_empty() && damaged.reason.is_some());
    assert_eq!(built.skipped().collect::<Vec<_>>(), [damaged]);
    assert_eq!(hands_up.seconds.keys().collect::<Vec<_>>(), [&ActionLabel::Other]);
    let reason = hands_up.reason.as_ref().unwrap();
    assert!(reason.starts_with("none of it is walking") && reason.contains("a raised hand"), "{reason}");
}

#[test]
fn a_scrap_does_not_take_the_starters_place() {
    let (folder, walk) = (Folder::new("scrap"), walk());
    let mut scrap = walk.clone();
    scrap.motion.postures.truncate(60);
    scrap.motion.contacts.truncate(60);
    let path = folder.write("scrap.bvh", &Written::default().text(&scrap));
    let built = build(&[path], &LibrarySettings::default(), &Progress::new()).unwrap();
    let starter = oncue::library::starter::generate(&Progress::new()).unwrap().summary();
    for (row, made) in built.library.summary().rows.iter().zip(&starter.rows) {
        if row.label.is_matched() {
            assert_eq!(row.procedural_seconds, made.procedural_seconds, "{:?}", row.label);
            assert!(row.shortfall.is_some(), "{:?}", row.label);
        }
    }
    assert!(built.library.summary().rows[0].mocap_seconds > 0.5, "the scrap is there too");
}

#[test]
fn a_file_that_stands_for_another_goes_by_its_name() {
    let (folder, walk) = (Folder::new("sources"), walk());
    let text = Written::default().text(&walk);
    // Kept under names that say nothing, in another order than their sources'.
    let kept = folder.0.join("kept");
    std::fs::create_dir_all(&kept).unwrap();
    let sources: Vec<(PathBuf, CaptureSource)> =
        [("1.bvh", "b.fbx", "Run"), ("2.bvh", "a.glb", "Walk"), ("0.bvh", "b.fbx", "Walk")]
            .into_iter()
            .map(|(kept_as, file, action)| {
                let path = folder.write(&format!("kept/{kept_as}"), &text);
                (path, CaptureSource { file: folder.0.join(file), action: action.into() })
            })
            .collect();
    folder.write("kept/3.bvh", "HIERARCHY");
    let broken = CaptureSource { file: folder.0.join("c.fbx"), action: "None".into() };
    // A mapping file lies beside the source.
    folder.write("a.oncue.json", r#"{"labels": [{"label": "other", "first": 0, "end": 100000}]}"#);
    let settings = LibrarySettings {
        mirror: false,
        starter: StarterUse::None,
        sources: sources.into_iter().chain([(kept.join("3.bvh"), broken)]).collect(),
        ..LibrarySettings::default()
    };
    let built = build(&[kept], &settings, &Progress::new()).unwrap();
    let told: Vec<(&str, &str, Option<&str>)> = built
        .captures
        .iter()
        .map(|c| {
            (c.file.file_name().unwrap().to_str().unwrap(), c.action.as_deref().unwrap(), c.clip.as_deref())
        })
        .collect();
    assert_eq!(
        told,
        [
            ("a.glb", "Walk", Some("a Walk")),
            ("b.fbx", "Run", Some("b Run")),
            ("b.fbx", "Walk", Some("b Walk")),
            ("c.fbx", "None", None),
        ]
    );
    assert_eq!(built.captures[0].seconds.keys().collect::<Vec<_>>(), [&ActionLabel::Other]);
    assert!(built.captures[1].seconds[&ActionLabel::Walk] > 3.0);
    // A file that stands for itself has no action.
    assert_eq!(only(folder.write("own.bvh", &text)).unwrap().captures[0].action, None);
}
