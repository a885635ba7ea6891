//! The motion editor on motions of the starter library: constraints that nothing was tuned to, and what must not change.

mod common;

use std::sync::OnceLock;

use glam::{Quat, Vec2, Vec3};
use oncue::ActionLabel;
use oncue::editor::plain_ik;
use oncue::editor::{
    Constraint, EditedMotion, Key, Wishes, check_constraints, edit_motion, shipped_manifold,
};
use oncue::editor::{Seat, SeatFit};
use oncue::editor::{lengthened, manipulate};
use oncue::internals::foot::sole;
use oncue::library::starter;
use oncue::manifold::Manifold;
use oncue::math::rotation::to_angle_axis;
use oncue::metrics::foot_figures;
use oncue::motion::skeleton::ANKLE_HEIGHT;
use oncue::motion::smoothness::{Smoothness, smoothness};
use oncue::motion::{Joint, Pose, Posture};
use oncue::settings::EditorSettings;
use oncue::{
    ActionCue, ActionType, Error, Hand, ManipulationCue, Motion, MotionLibrary, Progress, SceneIndex,
};

use common::boxes::boxes;

fn library() -> &'static MotionLibrary {
    static LIBRARY: OnceLock<MotionLibrary> = OnceLock::new();
    LIBRARY.get_or_init(|| starter::generate(&Progress::new()).expect("the starter library"))
}

/// The longest segment of a label, cut to `frames`; with the frame at which its action is complete. Sits from the front.
fn segment(label: ActionLabel, frames: usize) -> (Motion, usize) {
    segment_of(|name| !name.contains("sideways"), label, frames)
}

/// As [`segment`], of clips by their names.
fn segment_of(wanted: impl Fn(&str) -> bool, label: ActionLabel, frames: usize) -> (Motion, usize) {
    let clips = library().clips.iter().flat_map(|c| c.segments.iter().map(move |s| (c, s)));
    let (clip, s) = clips
        .filter(|(c, s)| s.label == label && wanted(&c.name))
        .max_by_key(|(c, s)| (s.end.min(c.motion.len()) - s.first, c.motion.len()))
        .expect("a segment");
    // A sit goes on into the seated part.
    let end = (s.first + frames).min(clip.motion.len()).max(s.end);
    let motion = Motion {
        postures: clip.motion.postures[s.first..end].to_vec(),
        contacts: clip.motion.contacts[s.first..end].to_vec(),
    };
    (motion, s.complete - s.first)
}

/// Someone who stands still for 150 frames.
fn standing() -> Motion {
    segment(ActionLabel::Idle, 150).0
}

fn edit(motion: &Motion, constraints: &[Constraint]) -> oncue::Result<EditedMotion> {
    edit_with_keys(motion, constraints, &[])
}

fn edit_with_keys(motion: &Motion, constraints: &[Constraint], keys: &[Key]) -> oncue::Result<EditedMotion> {
    let wishes = Wishes { constraints, keys, scene: None, floor: 0.0 };
    edit_motion(motion, &wishes, None, &EditorSettings::default(), &Progress::new())
}

/// Largest accelerations anywhere in the library.
fn range_of_the_library() -> Smoothness {
    let mut out = Smoothness::default();
    for clip in &library().clips {
        let s = smoothness(&clip.motion, &(0..clip.motion.len()));
        out.largest_acceleration = out.largest_acceleration.max(s.largest_acceleration);
        out.largest_turn = out.largest_turn.max(s.largest_turn);
    }
    out
}

/// What every edit keeps: frames outside its span to the bit, planted feet, soles over the floor, hinges that bend the
/// human way, accelerations of the library.
fn assert_sound(before: &Motion, edited: &EditedMotion) {
    let (after, figures) = (&edited.motion, &edited.figures);
    let span = figures.first_frame..figures.end_frame;
    for frame in (0..before.len()).filter(|f| !span.contains(f)) {
        assert_eq!(before.postures[frame], after.postures[frame], "frame {frame} outside {span:?}");
    }
    let (foot, foot_before) = (foot_figures(after, 0.0), foot_figures(before, 0.0));
    assert!(foot.worst_skate_cm < foot_before.worst_skate_cm + 0.05, "{foot:?} {foot_before:?}");
    for (frame, posture) in after.postures.iter().enumerate() {
        let (pose, own) = (posture.pose(), before.postures.get(frame).map(Posture::pose));
        for side in 0..2 {
            let lowest = |p| sole(p, side).iter().map(|s| s.z).fold(f32::INFINITY, f32::min);
            let least = own.as_ref().map_or(0.0, lowest).min(0.0);
            assert!(lowest(&pose) > least - 0.006, "frame {frame}: sole at {}", lowest(&pose));
            let knee = posture.rotations[[Joint::LeftLeg, Joint::RightLeg][side].index()];
            assert!(to_angle_axis(knee).x > -0.02, "frame {frame}: a knee bends backwards: {knee}");
        }
    }
    let (smooth, allowed) = (smoothness(after, &span), range_of_the_library());
    assert!(smooth.largest_acceleration < allowed.largest_acceleration, "{smooth:?} {allowed:?}");
    assert!(smooth.largest_turn < allowed.largest_turn, "{smooth:?} {allowed:?}");
}

#[test]
fn hands_reach_a_sphere_around_the_shoulder() {
    let motion = standing();
    let frame = 70;
    let pose = motion.postures[frame].pose();
    let here = motion.postures[frame].planar();
    let mut misses = Vec::new();
    // A spiral over the sphere, without what lies behind the person.
    for i in 0..24 {
        let up = 1.0 - 2.0 * (i as f32 + 0.5) / 24.0;
        let turn = 2.4 * i as f32;
        let flat = Vec2::from_angle(turn) * (1.0 - up * up).sqrt();
        let (hand, shoulder, outward) = if i % 2 == 0 {
            (Joint::LeftHand, Joint::LeftArm, 1.0)
        } else {
            (Joint::RightHand, Joint::RightArm, -1.0)
        };
        // Before the person, and on the hand's own side of the middle.
        let local = Vec2::new(outward * flat.x.abs(), -flat.y.abs());
        let radius = 0.30 + 0.25 * (i % 3) as f32 / 2.0;
        let target = pose.position(shoulder) + here.direction_to_world(local).extend(up) * radius;
        let pin = Constraint::positions("Sphere", hand, frame, vec![target; 10]);
        let edited = edit(&motion, &[pin]).unwrap_or_else(|e| panic!("{i}: {e}"));
        assert!(edited.figures.constraints[0].met, "{i}: {:?}", edited.figures);
        misses.push(edited.figures.constraints[0].max_cm.expect("places"));
        assert_sound(&motion, &edited);
    }
    misses.sort_by(f32::total_cmp);
    assert!(misses[misses.len() / 2] < 0.2, "{misses:?}");
}

#[test]
fn out_of_reach_is_said_by_how_much_and_which_way() {
    let motion = standing();
    let pose = motion.postures[60].pose();
    let ahead = motion.postures[60].planar().forward().extend(0.0);
    let target = pose.position(Joint::LeftArm) + ahead * 1.5;
    let far = Constraint::positions("Shelf", Joint::LeftHand, 60, vec![target]);
    let Err(error) = edit(&motion, &[far]) else { panic!("it is out of reach") };
    let text = error.to_string();
    assert!(matches!(error, Error::Unreachable(_)) && text.contains("‘Shelf’"), "{text}");
    let (amount, _) = text.split_once(" m out of reach").expect("by how much");
    let miss: f32 = amount.rsplit(' ').next().and_then(|n| n.parse().ok()).expect("a number");
    assert!(text.contains("m towards the character"), "{text}");
    // Moved as it says, and a finger's breadth more, it can be met.
    let moved = Constraint::positions("Shelf", Joint::LeftHand, 60, vec![target - ahead * (miss + 0.03)]);
    assert!(edit(&motion, &[moved]).expect("within reach").figures.constraints[0].met);
    assert!(miss < 1.5 - 0.55, "the trunk and the feet give nothing: {miss}");
}

/// A seat of boxes: the seat itself, and a backrest behind it.
fn seat_scene(height: f32, depth: f32) -> SceneIndex {
    let (positions, triangles) = boxes(&[
        ([-3.0, -3.0, -0.1], [3.0, 3.0, 0.0]),
        ([-0.25, -depth + 0.18, height - 0.06], [0.25, 0.18, height]),
        ([-0.25, 0.13, height], [0.25, 0.18, height + 0.4]),
    ]);
    SceneIndex::build(&positions, &triangles, &Default::default(), &Progress::new()).expect("a scene")
}

/// A sit of the library, carried so that it ends near the origin, `off` from it and turned by `turn`.
fn sitting(off: Vec2, turn: f32) -> (Motion, usize) {
    let on_a_chair = |name: &str| name == "sit 46 cm, turn 0°";
    carried(segment_of(on_a_chair, ActionLabel::Sit, 170), off, turn)
}

fn carried((mut motion, complete): (Motion, usize), off: Vec2, turn: f32) -> (Motion, usize) {
    let from = motion.postures[complete].planar();
    let to = oncue::math::Planar::new(off, turn);
    motion.postures.iter_mut().for_each(|p| *p = p.moved(from, to));
    (motion, complete)
}

fn fit(motion: &Motion, complete: usize, cue: &ActionCue, scene: &SceneIndex) -> oncue::Result<SeatFit> {
    let settings = EditorSettings::default();
    let seat = Seat { motion, cue, complete, scene: Some(scene), floor: 0.0, settings: &settings };
    seat.fit(None::<&Manifold>, &Progress::new())
}

fn sit_cue(height: f32, feet: [Option<Vec3>; 2]) -> ActionCue {
    ActionCue {
        name: "Seat".into(),
        action_type: ActionType::Sit,
        position: Vec3::new(0.0, 0.0, height + 0.10),
        yaw: 0.0,
        feet,
    }
}

#[test]
fn seats_from_low_to_high_are_fitted() {
    for (height, depth) in
        [(0.30, 0.50), (0.38, 0.45), (0.45, 0.45), (0.52, 0.40), (0.60, 0.40), (0.75, 0.35)]
    {
        let (motion, complete) = sitting(Vec2::new(0.04, -0.05), 0.12);
        let cue = sit_cue(height, [None; 2]);
        let fitted = fit(&motion, complete, &cue, &seat_scene(height, depth))
            .unwrap_or_else(|e| panic!("{height}: {e}"));
        let s = &fitted.seat;
        assert!(s.pelvis_cm < 0.5 && s.facing_degrees < 1.0, "{height}: {s:?}");
        assert!(s.thigh_cm < 0.8 && s.back_cm < 0.8, "{height}: {s:?}");
        // A shin and a foot are 0.53 m: higher seats lift the heels, and bar stools the feet.
        if height < 0.50 {
            assert_eq!(s.hanging, [false; 2], "{height}: {s:?}");
            assert!(s.sole_degrees.iter().all(|&d| d < 3.0), "{height}: {s:?}");
        } else {
            assert!(s.hanging == [height > 0.65; 2] || height == 0.60, "{height}: {s:?}");
        }
        assert_sound(&motion, &EditedMotion { motion: fitted.motion, figures: fitted.figures });
    }
}

/// Who sits down on the side of a chair and turns on it is fitted as well: the turn stays a turn, the feet step round.
#[test]
fn a_turn_on_the_seat_is_fitted() {
    for (name, height) in [("on the middle, turn 0", 0.44), ("on the front, turn 0", 0.50)] {
        let wanted = |n: &str| n.starts_with("sit 46 cm sideways") && n.contains(name) && n.contains("90°");
        let (motion, complete) =
            carried(segment_of(wanted, ActionLabel::Sit, 170), Vec2::new(0.02, -0.02), 0.08);
        let cue = sit_cue(height, [None; 2]);
        let fitted = fit(&motion, complete, &cue, &seat_scene(height, 0.42)).expect("a fit");
        let s = &fitted.seat;
        assert!(s.pelvis_cm < 0.5 && s.facing_degrees < 1.0 && s.thigh_cm < 0.8, "{height}: {s:?}");
        assert_sound(&motion, &EditedMotion { motion: fitted.motion, figures: fitted.figures });
    }
}

/// Feet that hang in the motion are left as they hang: knees apart before the panel of a bar, here a seat 3 cm higher than
/// the clip's and the pelvis 2 cm aside.
#[test]
fn knees_apart_stay_apart() {
    let height = 0.67;
    let (positions, triangles) = boxes(&[
        ([-3.0, -3.0, -0.1], [3.0, 3.0, 0.0]),
        ([-0.11, -0.06, height - 0.03], [0.11, 0.16, height]),
        ([-1.0, -0.9, 0.0], [1.0, -0.415, 0.9]),
    ]);
    let scene =
        SceneIndex::build(&positions, &triangles, &Default::default(), &Progress::new()).expect("a scene");
    let wanted = |n: &str| n.starts_with("sit 64 cm") && n.contains("knees apart, turn 0");
    let (motion, complete) = carried(segment_of(wanted, ActionLabel::Sit, 170), Vec2::new(0.02, 0.01), 0.04);
    let fitted = fit(&motion, complete, &sit_cue(height, [None; 2]), &scene).expect("a fit");
    let s = &fitted.seat;
    assert!(s.hanging == [true; 2] && s.pelvis_cm < 0.5 && s.facing_degrees < 1.0, "{s:?}");
    for posture in &fitted.motion.postures[complete..] {
        let counts = scene.seated_intersections(&posture.pose(), 0.05, height);
        assert_eq!(counts.iter().sum::<u32>(), 0, "{counts:?}");
    }
    // On a chair that low they would be in the floor: there they stand.
    let low = fit(&motion, complete, &sit_cue(0.38, [None; 2]), &seat_scene(0.38, 0.45)).expect("a fit");
    assert_eq!(low.seat.hanging, [false; 2], "{:?}", low.seat);
}

#[test]
fn feet_step_to_their_cues_and_do_not_slide() {
    let scene = seat_scene(0.45, 0.45);
    for (left, right) in
        [(Vec2::new(0.12, -0.40), Vec2::new(-0.12, -0.40)), (Vec2::new(0.22, -0.55), Vec2::new(-0.05, -0.25))]
    {
        let (motion, complete) = sitting(Vec2::ZERO, 0.0);
        let cue = sit_cue(0.45, [Some(left.extend(0.0)), Some(right.extend(0.0))]);
        let fitted = fit(&motion, complete, &cue, &scene).expect("a fit");
        let pose = fitted.motion.postures[fitted.motion.len() - 1].pose();
        for (joint, place) in [(Joint::LeftFoot, left), (Joint::RightFoot, right)] {
            let miss = pose.position(joint).distance(place.extend(ANKLE_HEIGHT));
            assert!(miss < 0.01, "{joint:?}: {miss} {:?}", fitted.seat);
        }
        assert!(fitted.figures.constraints.iter().all(|c| c.met), "{:?}", fitted.figures);
        assert_sound(&motion, &EditedMotion { motion: fitted.motion, figures: fitted.figures });
    }
}

#[test]
fn a_foot_cue_that_no_leg_reaches_is_refused() {
    let (motion, complete) = sitting(Vec2::ZERO, 0.0);
    let cue = sit_cue(0.45, [Some(Vec3::new(0.1, -1.15, 0.0)), None]);
    let text = fit(&motion, complete, &cue, &seat_scene(0.45, 0.45)).expect_err("out of reach").to_string();
    assert!(text.contains("Seat: left foot") && text.contains("towards the character"), "{text}");
}

#[test]
fn feet_on_the_floor_before_a_high_stool_contradict_it() {
    let (motion, complete) = sitting(Vec2::ZERO, 0.0);
    let feet = [Some(Vec3::new(0.20, -0.42, 0.0)), Some(Vec3::new(-0.10, -0.30, 0.0))];
    let (cue, scene) = (sit_cue(0.70, feet), seat_scene(0.70, 0.40));
    let error = fit(&motion, complete, &cue, &scene).expect_err("thighs in the seat");
    let text = error.to_string();
    assert!(matches!(error, Error::Unreachable(_)) && text.contains("contradict each other"), "{text}");
    assert!(fit(&motion, complete, &sit_cue(0.70, [None; 2]), &scene).is_ok());
}

/// Where a hand holds what it holds: 8 cm from the wrist along the hand and 2 cm before the palm, which faces down in the
/// rest pose.
fn gripping(pose: &Pose, joint: Joint) -> Vec3 {
    let along = if joint == Joint::LeftHand { 0.08 } else { -0.08 };
    pose.position(joint) + pose.rotation(joint) * Vec3::new(along, 0.0, -0.02)
}

/// An arc of 30 cm before the person's chest.
fn arc(motion: &Motion, frame: usize, frames: usize) -> Vec<Vec3> {
    let here = motion.postures[frame].planar();
    let chest = motion.postures[frame].pose().position(Joint::Spine2).z;
    (0..frames)
        .map(|i| {
            let t = i as f32 / (frames - 1) as f32;
            let angle = std::f32::consts::PI * (t * t * (3.0 - 2.0 * t));
            here.point_to_world(Vec2::new(0.0, -0.40)).extend(chest - 0.1)
                + Vec3::new(0.0, 0.0, 0.15 * angle.sin())
        })
        .collect()
}

fn carry(motion: &Motion, cues: &[ManipulationCue]) -> oncue::Result<oncue::editor::Manipulated> {
    manipulate(None::<&Manifold>, motion, cues, None, 0.0, &EditorSettings::default(), &Progress::new())
}

#[test]
fn a_hand_follows_its_path_and_the_motion_grows_by_it() {
    let (seated, _) = segment(ActionLabel::SeatedIdle, 90);
    for (motion, hand, first_frame) in [
        (standing(), Hand::Left, Some(60)),
        (standing(), Hand::Both, Some(60)),
        (seated.clone(), Hand::Right, Some(40)),
        (seated, Hand::Both, None),
    ] {
        let path = arc(&motion, 40, 45);
        let cue = ManipulationCue { name: "Lid".into(), hand, path: path.clone(), first_frame };
        let done = carry(&motion, &[cue]).expect("within reach");
        assert_eq!(done.cues.len(), 1);
        let first = done.cues[0].first_frame;
        if let Some(asked) = first_frame {
            assert_eq!(first, asked);
            assert_eq!(done.motion.len(), motion.len() + 45);
        } else {
            assert!(first >= motion.len() && done.motion.len() >= first + 45 + 15);
        }
        assert!(done.figures.constraints.iter().all(|c| c.met), "{:?}", done.figures);
        let last = done.motion.postures[first + 44].pose();
        let away = |joint: Joint| gripping(&last, joint).distance(path[44]);
        match hand {
            Hand::Left => assert!(away(Joint::LeftHand) < 0.01),
            Hand::Right => assert!(away(Joint::RightHand) < 0.01),
            Hand::Both => assert!(
                (away(Joint::LeftHand) - 0.1).abs() < 0.01 && (away(Joint::RightHand) - 0.1).abs() < 0.01
            ),
        }
    }
}

/// Frames of a reach or a return over `metres`: 0.6 s and 0.3 s a metre, at least 0.8 s.
fn reach_frames(metres: f32) -> usize {
    (30.0 * (0.6 + 0.3 * metres).max(0.8)).round() as usize
}

#[test]
fn who_is_still_waits_for_a_late_cue_and_takes_the_time_to_get_back() {
    let (seated, _) = segment(ActionLabel::SeatedIdle, 90);
    let (count, settings) = (45, EditorSettings::default());
    for (what, motion) in [("stands", standing()), ("sits", seated)] {
        let last = motion.len() - 1;
        let own = |frame: usize| motion.postures[frame.min(last)];
        let low = match what {
            "stands" => -0.75,
            _ => -0.25,
        };
        let path: Vec<Vec3> = arc(&motion, last, count).iter().map(|p| p + Vec3::Z * low).collect();
        // Long after the end, on the frame after it, on its last frame, and a few before.
        for first in [last + 60, last + 1, last, last - 4] {
            let cue = ManipulationCue {
                name: "Drawer".into(),
                hand: Hand::Right,
                path: path.clone(),
                first_frame: Some(first),
            };
            let (before, _) = lengthened(&motion, &cue, 0.0, &settings).expect("room for it");
            let done = carry(&motion, &[cue]).unwrap_or_else(|e| panic!("{what} {first}: {e}"));
            let after = &done.motion;
            assert_eq!(done.cues[0].first_frame, first);
            // The path, the whole return, and a frame on which all is as it was.
            let held = gripping(&own(first).pose(), Joint::RightHand);
            // What was there after the hold goes on after it.
            let end = first + count;
            let below = held.distance(path[count - 1]);
            assert_eq!(held, gripping(&before.postures[end - 1].pose(), Joint::RightHand));
            assert_eq!(after.len(), end + reach_frames(below) + 1, "{what} {first}");
            assert_eq!(after.contacts.len(), after.len());
            assert_eq!(after.postures[after.len() - 1], own(last), "{what} {first}");
            // To the bit as it was before the reach, and held from the end until then.
            let reach = reach_frames(held.distance(path[0]));
            assert_eq!(done.figures.first_frame, first - reach, "{what} {first}");
            for frame in 0..first - reach {
                assert_eq!(after.postures[frame], own(frame), "{what} {first}: frame {frame}");
                assert_eq!(after.contacts[frame], motion.contacts[frame.min(last)]);
            }
            for (i, place) in path.iter().enumerate() {
                let pose = after.postures[first + i].pose();
                let miss = gripping(&pose, Joint::RightHand).distance(*place);
                assert!(miss < 0.01, "{what} {first}: {miss} on frame {}", first + i);
            }
            for frame in 1..after.len() {
                let pose = [frame - 1, frame].map(|f| after.postures[f].pose());
                for (side, joint) in [Joint::LeftToe, Joint::RightToe].into_iter().enumerate() {
                    let planted = [frame - 1, frame].iter().all(|&f| after.contacts[f][side] >= 1.0);
                    let slide = pose[0].position(joint).distance(pose[1].position(joint));
                    assert!(!planted || slide < 0.003, "{what} {first}: a foot slides {slide} on {frame}");
                }
            }
            assert_sound(&before, &EditedMotion { motion: done.motion, figures: done.figures });
        }
    }
}

#[test]
fn several_late_cues_are_met_on_their_own_frames() {
    let motion = standing();
    let path = arc(&motion, 149, 30);
    let cues = [(Hand::Left, 180), (Hand::Right, 200), (Hand::Left, 300)].map(|(hand, first)| {
        ManipulationCue { name: format!("Cue {first}"), hand, path: path.clone(), first_frame: Some(first) }
    });
    let done = carry(&motion, &cues).expect("within reach");
    for (cue, at) in cues.iter().zip(&done.cues) {
        assert_eq!(cue.first_frame, Some(at.first_frame));
        let joint = if cue.hand == Hand::Left { Joint::LeftHand } else { Joint::RightHand };
        for (i, place) in path.iter().enumerate() {
            let pose = done.motion.postures[at.first_frame + i].pose();
            assert!(gripping(&pose, joint).distance(*place) < 0.01, "{}: {i}", cue.name);
        }
    }
    assert_eq!(done.motion.postures.last(), motion.postures.last());
}

#[test]
fn nobody_waits_on_the_way() {
    let (walking, _) = segment(ActionLabel::Walk, 90);
    let pose = walking.postures[walking.len() - 1].pose();
    let path = vec![pose.position(Joint::LeftHand) + Vec3::Z * 0.1; 20];
    let cue = |first| {
        [ManipulationCue {
            name: "Rail".into(),
            hand: Hand::Left,
            path: path.clone(),
            first_frame: Some(first),
        }]
    };
    let last = walking.len() - 1;
    for first in [last - 10, last + 1, last + 40] {
        let text = carry(&walking, &cue(first)).expect_err("it ends on the way").to_string();
        let range = format!("‘Rail’ runs from frame {first} to {}", first + 19);
        assert!(text.contains(&range) && text.contains("ends on the way"), "{text}");
    }
}

#[test]
fn an_offset_places_a_point_of_the_joint() {
    let motion = standing();
    let offset = Vec3::new(0.02, -0.10, 0.12);
    let place = motion.postures[60].pose().point(Joint::Head, offset) + Vec3::new(0.0, -0.08, -0.05);
    let crown = Constraint { offset, ..Constraint::positions("Crown", Joint::Head, 60, vec![place; 10]) };
    let edited = edit(&motion, std::slice::from_ref(&crown)).expect("within reach");
    let pose = edited.motion.postures[65].pose();
    let there = pose.position(Joint::Head) + pose.rotation(Joint::Head) * offset;
    assert!(there.distance(place) < 0.01, "{there} {place}");
    assert!(edited.figures.constraints[0].met && edited.figures.constraints[0].max_cm < Some(1.0));
    // Two points of one joint may be apart as they are in its frame, and no farther.
    let own = |place| Constraint::positions("Neck", Joint::Head, 60, vec![place; 10]);
    check_constraints(&motion, &[crown.clone(), own(place + Vec3::X * 0.15)]).expect("within the offset");
    let text = check_constraints(&motion, &[crown, own(place + Vec3::X * 0.26)]).unwrap_err().to_string();
    assert!(text.contains("‘Crown’ and ‘Neck’ both want the Head on frame 60, 0.10 m apart"), "{text}");
}

#[test]
fn bad_cues_are_named_and_leave_the_motion_alone() {
    let motion = standing();
    let path = arc(&motion, 40, 30);
    let cue = |name: &str, hand, path: &[Vec3], first_frame| ManipulationCue {
        name: name.into(),
        hand,
        path: path.to_vec(),
        first_frame,
    };
    let refused = |cues: &[ManipulationCue]| carry(&motion, cues).expect_err("refused").to_string();
    let moved: Vec<Vec3> = path.iter().map(|p| *p + Vec3::Z * 0.2).collect();
    let twice =
        refused(&[cue("Lid", Hand::Left, &path, Some(50)), cue("Door", Hand::Both, &moved, Some(60))]);
    assert!(twice.contains("‘Lid’") && twice.contains("‘Door’") && twice.contains("LeftHand"), "{twice}");
    let mut jump = path.clone();
    jump[12] += Vec3::X;
    assert!(refused(&[cue("Lid", Hand::Left, &jump, Some(50))]).contains("jumps by"), "{jump:?}");
    for first in [motion.len() + 3600, usize::MAX] {
        let text = refused(&[cue("Lid", Hand::Left, &path, Some(first))]);
        assert!(
            text.contains(&format!("begins on frame {first}")) && text.contains("at most 120 s"),
            "{text}"
        );
    }
    let none = Motion { postures: Vec::new(), contacts: Vec::new() };
    let text = carry(&none, &[cue("Lid", Hand::Left, &path, Some(5))]).expect_err("refused").to_string();
    assert!(text.contains("no motion"), "{text}");
    assert!(refused(&[cue("Lid", Hand::Left, &[], Some(9))]).contains("has no path"));
    let keys = [Key { joint: "Tail".into(), frame: 10 }];
    assert!(edit_with_keys(&motion, &[], &keys).expect_err("no tail").to_string().contains("no bone ‘Tail’"));
    let keys = [Key { joint: "Head".into(), frame: 1000 }];
    assert!(edit_with_keys(&motion, &[], &keys).expect_err("too late").to_string().contains("frame 1000"));
}

#[test]
fn keys_stay_to_the_bit_and_the_frames_around_adapt() {
    let mut motion = standing();
    let untouched = motion.clone();
    let (arm, spine) = (Joint::LeftArm.index(), Joint::Spine1.index());
    let keyed = &mut motion.postures[70];
    keyed.rotations[arm] *= Quat::from_rotation_y(-0.9);
    keyed.rotations[spine] *= Quat::from_rotation_x(0.2);
    let keys = ["LeftArm", "Spine1"].map(|joint| Key { joint: joint.into(), frame: 70 });
    let edited = edit_with_keys(&motion, &[], &keys).expect("an edit");
    let after = &edited.motion;
    for joint in [arm, spine] {
        assert_eq!(after.postures[70].rotations[joint], motion.postures[70].rotations[joint]);
        // Half of the change has come over to the frames near it.
        let near = after.postures[67].rotations[joint].angle_between(after.postures[70].rotations[joint]);
        let key = untouched.postures[67].rotations[joint].angle_between(motion.postures[70].rotations[joint]);
        assert!(near < 0.5 * key, "{joint}: {near} of {key}");
    }
    let place = after.postures[70].pose().position(Joint::LeftArm);
    assert!(place.distance(motion.postures[70].pose().position(Joint::LeftArm)) < 2e-3);
    assert_sound(&untouched, &edited);
}

#[test]
fn pins_hold_places_and_turns_over_a_range() {
    let (motion, _) = segment(ActionLabel::Idle, 150);
    let pose = motion.postures[50].pose();
    let turn = Quat::from_rotation_z(0.4) * pose.rotation(Joint::RightHand);
    let place = pose.position(Joint::RightHand) + Vec3::new(0.0, 0.0, 0.25);
    let hand = Constraint {
        rotations: vec![turn; 20],
        ..Constraint::positions("Hand", Joint::RightHand, 50, vec![place; 20])
    };
    let head = Constraint {
        rotations: vec![Quat::from_rotation_z(0.5) * pose.rotation(Joint::Head); 20],
        ..Constraint::positions("Head", Joint::Head, 50, Vec::new())
    };
    let foot = pose.position(Joint::LeftFoot) + Vec3::new(0.03, 0.05, 0.08);
    let foot = Constraint::positions("Foot", Joint::LeftFoot, 55, vec![foot; 5]);
    let edited = edit(&motion, &[hand, head, foot]).expect("an edit");
    assert!(edited.figures.constraints.iter().all(|c| c.met), "{:?}", edited.figures);
    assert_sound(&motion, &edited);
}

#[test]
fn plain_inverse_kinematics_misses_a_low_drawer_that_the_editor_opens() {
    let motion = standing();
    let here = motion.postures[60].planar();
    let target = here.point_to_world(Vec2::new(0.15, -0.45)).extend(0.15);
    let low = [Constraint::positions("Drawer", Joint::LeftHand, 60, vec![target; 20])];
    let ours = edit(&motion, &low).expect("within reach");
    let plain = plain_ik(&motion, &low, &EditorSettings::default(), &Progress::new()).expect("a try");
    assert!(ours.figures.constraints[0].met, "{:?}", ours.figures);
    assert!(plain.figures.constraints[0].max_cm.expect("places") > 2.0, "{:?}", plain.figures);
    assert_sound(&motion, &ours);
}

#[test]
fn the_manifold_that_ships_leads_to_the_same_place_with_the_body_along() {
    let motion = standing();
    let here = motion.postures[60].planar();
    let target = here.point_to_world(Vec2::new(-0.15, -0.45)).extend(0.45);
    let low = [Constraint::positions("Lid", Joint::RightHand, 60, vec![target; 20])];
    let wishes = Wishes { constraints: &low, keys: &[], scene: None, floor: 0.0 };
    let manifold = shipped_manifold().expect("it ships");
    let edit = |steps| {
        let settings = EditorSettings { steps, ..Default::default() };
        edit_motion(&motion, &wishes, Some(manifold), &settings, &Progress::new()).expect("within reach")
    };
    let edited = edit(200);
    assert!(edited.figures.constraints[0].met, "{:?}", edited.figures);
    let search = edited.figures.search.as_ref().expect("a search");
    assert!(search.after_cm < 0.3 * search.before_cm, "{search:?}");
    assert_sound(&motion, &edited);
    // The knees take part, as they do in life.
    let bend = |m: &Motion| to_angle_axis(m.postures[70].rotations[Joint::RightLeg.index()]).length();
    assert!(bend(&edited.motion) > bend(&motion) + 0.1);
    let again =
        rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread").install(|| edit(200));
    assert_eq!(again.motion, edited.motion);
}

#[test]
fn cancel_is_seen() {
    let progress = Progress::new();
    progress.cancel();
    let motion = standing();
    let place = motion.postures[60].pose().position(Joint::LeftHand);
    let pins = [Constraint::positions("Pin", Joint::LeftHand, 60, vec![place + Vec3::Z * 0.1])];
    let wishes = Wishes { constraints: &pins, keys: &[], scene: None, floor: 0.0 };
    let result = edit_motion(&motion, &wishes, None, &EditorSettings::default(), &progress);
    assert!(matches!(result, Err(Error::Cancelled)));
}

/// A hand that is asked for while the person turns on the seat follows its path, and the turn goes on; who stands is held.
#[test]
fn nobody_is_held_in_the_middle_of_a_turn() {
    let wanted = |n: &str| n.starts_with("sit 46 cm sideways on the middle, turn 0") && n.contains("90°");
    let (motion, complete) = segment_of(wanted, ActionLabel::Sit, 170);
    let turning = complete - 25;
    let here = gripping(&motion.postures[turning].pose(), Joint::RightHand);
    let cue = |first: usize, place: Vec3| ManipulationCue {
        name: "Cup".into(),
        hand: Hand::Right,
        first_frame: Some(first),
        path: vec![place + Vec3::Z * 0.05; 12],
    };
    let moving = carry(&motion, &[cue(turning, here)]).expect("within reach");
    assert_eq!(moving.holds, []);
    let facing = |m: &Motion| m.postures[complete].planar().yaw;
    assert!((facing(&moving.motion) - facing(&motion)).abs() < 0.1, "{}", facing(&moving.motion));

    let still = standing();
    let place = gripping(&still.postures[70].pose(), Joint::RightHand);
    assert_eq!(carry(&still, &[cue(70, place)]).expect("within reach").holds, [(70, 12)]);
}
