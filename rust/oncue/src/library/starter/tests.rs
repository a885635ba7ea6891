//! What the starter library promises, over all of its clips.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::catalogue::{BAR_HEIGHTS, SEAT_HEIGHTS, SWIVEL_HEIGHTS};
use super::generate;
use super::seat::PELVIS_BEHIND_EDGE;
use crate::action::{ActionLabel, ActionType};
use crate::library::quality::{faults, measure};
use crate::library::{Clip, FeatureWeights, MotionDatabase, MotionLibrary};
use crate::math::rotation::wrap_angle;
use crate::motion::skeleton::{BODY_BOXES, Limb, SEATED_HIPS_HEIGHT};
use crate::motion::{Joint, Posture};
use crate::progress::Progress;

static LIBRARY: LazyLock<MotionLibrary> = LazyLock::new(|| generate(&Progress::new()).unwrap());

fn clips() -> impl Iterator<Item = &'static Clip> {
    LIBRARY.clips.iter().filter(|c| !c.mirrored)
}

fn spans(label: ActionLabel) -> impl Iterator<Item = (&'static Clip, usize, usize, usize)> {
    clips().flat_map(move |c| {
        c.segments.iter().filter(move |s| s.label == label).map(move |s| (c, s.first, s.end, s.complete))
    })
}

#[test]
fn ten_minutes_before_mirroring_with_every_label() {
    let frames: usize = clips().map(|c| c.motion.len()).sum();
    assert!(frames >= 18_000, "{frames}");
    for (label, least) in [
        (ActionLabel::Walk, 240.0),
        (ActionLabel::Idle, 60.0),
        (ActionLabel::Sit, 120.0),
        (ActionLabel::SeatedIdle, 60.0),
        (ActionLabel::StandUp, 30.0),
        (ActionLabel::Stop, 60.0),
    ] {
        let seconds: usize = spans(label).map(|(_, first, end, _)| end - first).sum();
        assert!(seconds as f32 / 30.0 > least, "{label:?}: {} s", seconds as f32 / 30.0);
    }
}

#[test]
fn the_same_bytes_every_time() {
    let again = generate(&Progress::new()).unwrap();
    let bytes = |library: &MotionLibrary| postcard::to_stdvec(library).unwrap();
    assert!(bytes(&LIBRARY) == bytes(&again));
}

#[test]
fn cancel_is_heard() {
    let progress = Progress::new();
    progress.cancel();
    assert!(matches!(generate(&progress), Err(crate::Error::Cancelled)));
}

#[test]
fn no_clip_has_a_fault() {
    let found: Vec<String> = LIBRARY
        .clips
        .iter()
        .flat_map(|c| faults(&measure(c)).into_iter().map(move |fault| format!("{}: {fault}", c.name)))
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// What the project's own eyes would object to in any motion, the library is free of.
#[test]
fn limbs_stay_out_of_the_own_body_and_within_their_limits() {
    let figures = LIBRARY.body_figures();
    assert!(figures.own_body.percent < 0.3, "{:?}", figures.own_body);
    assert!(figures.joint_limits.percent < 0.02, "{:?}", figures.joint_limits);
}

#[test]
fn segments_tile_their_clip() {
    for clip in &LIBRARY.clips {
        assert_eq!(clip.motion.postures.len(), clip.motion.contacts.len());
        let mut at = 0;
        for s in &clip.segments {
            assert!(
                s.first == at && s.end > s.first && (s.first..s.end).contains(&s.complete),
                "{}: {s:?}",
                clip.name
            );
            at = s.end;
        }
        assert_eq!(at, clip.motion.len(), "{}", clip.name);
    }
}

/// The whole turn about the vertical over some frames, radians.
fn turned(clip: &Clip, first: usize, end: usize) -> f32 {
    let yaw: Vec<f32> = clip.motion.postures[first..end].iter().map(|p| p.planar().yaw).collect();
    yaw.windows(2).map(|w| wrap_angle(w[1] - w[0])).sum()
}

#[test]
fn walking_covers_its_speeds_and_turns() {
    let (mut slowest, mut fastest, mut sharpest) = (f32::INFINITY, 0.0f32, 0.0f32);
    for (clip, first, end, _) in spans(ActionLabel::Walk).filter(|s| s.2 - s.1 > 60) {
        let p = &clip.motion.postures;
        let middle = (first + end) / 2;
        let speed = p[middle + 15].root_position.truncate().distance(p[middle - 15].root_position.truncate());
        if clip.name.starts_with("walk") {
            slowest = slowest.min(speed);
        }
        fastest = fastest.max(speed);
        sharpest = sharpest.max(turned(clip, middle - 15, middle + 15).abs());
    }
    assert!(slowest < 0.45 && fastest > 1.45 && sharpest > 1.0, "{slowest} {fastest} {sharpest}");
}

#[test]
fn sits_cover_heights_and_turns_and_end_on_the_seat() {
    for height in SEAT_HEIGHTS {
        let mut turns: Vec<f32> = Vec::new();
        let word = format!("sit {} cm", (100.0 * height).round());
        for (clip, first, end, complete) in spans(ActionLabel::Sit).filter(|s| s.0.name.starts_with(&word)) {
            let seated = &clip.motion.postures[complete];
            assert!((seated.root_position.z - height - SEATED_HIPS_HEIGHT).abs() < 0.005, "{}", clip.name);
            let last = clip.motion.postures.last().unwrap();
            assert!(last.root_position.distance(seated.root_position) < 0.01, "{}", clip.name);
            assert!(end > complete && clip.motion.len() - complete >= 15);
            turns.push(turned(clip, 0, complete).to_degrees());
            let _ = first;
        }
        for wanted in [0.0, 30.0, 60.0, 90.0, 135.0, 180.0] {
            assert!(
                turns.iter().any(|t| (t - wanted).abs() < 12.0),
                "{word}: no turn of {wanted}° in {turns:?}"
            );
        }
    }
}

/// Where a table leaves no room before a seat, one sits down on its side and turns on it: the pelvis stays where it is, or
/// moves back on the seat.
#[test]
fn swivelling_sits_turn_on_the_seat() {
    for height in SWIVEL_HEIGHTS {
        assert!(SEAT_HEIGHTS.contains(&height));
        let word = format!("sit {} cm sideways", (100.0 * height).round());
        let mut swivels: Vec<f32> = Vec::new();
        let sideways = |clip: &Clip| clip.name.starts_with(&word) && !clip.name.contains("knees apart");
        for (clip, first, _, complete) in spans(ActionLabel::Sit).filter(|s| sideways(s.0)) {
            let seated = |p: &Posture| p.root_position.z < height + SEATED_HIPS_HEIGHT + 0.005;
            let postures = &clip.motion.postures;
            let down = (first..complete).find(|f| seated(&postures[*f])).expect("a seat");
            let turn = turned(clip, down, complete).to_degrees();
            swivels.push(turn);
            for posture in &postures[down..=complete] {
                let glide = posture.root_position.truncate() - postures[complete].root_position.truncate();
                let most = if clip.name.contains("front") { 0.125 } else { 0.012 };
                assert!(seated(posture) && glide.length() < most, "{}: {glide}", clip.name);
            }
            // Between the landing and the end no knee goes through the other leg's.
            for posture in &postures[down..=complete] {
                let pose = posture.pose();
                let apart = pose.position(Joint::LeftLeg).distance(pose.position(Joint::RightLeg));
                assert!(apart > 0.11, "{}: knees {apart} m apart", clip.name);
            }
        }
        assert_eq!(swivels.len(), 12, "{word}");
        assert!(swivels.iter().any(|t| (t - 60.0).abs() < 6.0), "{swivels:?}");
        assert!(swivels.iter().filter(|t| (*t - 90.0).abs() < 6.0).count() == 10, "{swivels:?}");
    }
}

/// On a round stool 0.41 m from the panel of a bar no leg reaches the panel, neither while the person turns and moves in
/// nor in the end, and none goes through the stool.
#[test]
fn knees_apart_find_room_at_a_bar() {
    const PANEL: f32 = 0.41;
    const STOOL: (f32, f32) = (0.05, 0.155);
    for height in BAR_HEIGHTS {
        assert!(SEAT_HEIGHTS.contains(&height));
        let word = format!("sit {} cm sideways on the rear, knees apart", (100.0 * height).round());
        let at_bar: Vec<_> = spans(ActionLabel::Sit).filter(|s| s.0.name.starts_with(&word)).collect();
        assert_eq!(at_bar.len(), 5, "{word}");
        for (clip, first, _, complete) in at_bar {
            let seat = clip.motion.postures[complete].planar();
            for posture in &clip.motion.postures[first..] {
                let pose = posture.pose();
                for node in BODY_BOXES.iter().filter(|b| matches!(b.limb, Limb::Leg | Limb::Foot)) {
                    let (at, turned) = (pose.position(node.joint), pose.rotations[node.joint.index()]);
                    for corner in 0..8 {
                        let sign = |bit: u32| if corner & bit == 0 { -1.0 } else { 1.0 };
                        let corner = node.half_extents * Vec3::new(sign(1), sign(2), sign(4));
                        let point = at + turned * (node.center + corner);
                        let local = seat.point_to_local(point.truncate());
                        assert!(-local.y < PANEL, "{}: {} m ahead", clip.name, -local.y);
                        let from_middle = (local - Vec2::Y * STOOL.0).length();
                        assert!(
                            from_middle > STOOL.1 || point.z > height - 0.08,
                            "{}: {from_middle} m from the middle of the stool at height {}",
                            clip.name,
                            point.z
                        );
                    }
                }
            }
        }
    }
}

/// Shins, seen as lines, stay out of a box seat; so do the feet.
#[test]
fn shins_stay_out_of_the_seat() {
    // What stands at a bar is a stool.
    for (clip, _, _, complete) in spans(ActionLabel::Sit).filter(|s| !s.0.name.contains("knees apart")) {
        let seat = clip.motion.postures[complete].planar();
        let top = clip.motion.postures[complete].root_position.z - SEATED_HIPS_HEIGHT;
        for (f, posture) in clip.motion.postures.iter().enumerate() {
            let pose = posture.pose();
            for (knee, foot) in [(Joint::LeftLeg, Joint::LeftFoot), (Joint::RightLeg, Joint::RightFoot)] {
                for k in 0..=10 {
                    let point = pose.position(knee).lerp(pose.position(foot), k as f32 / 10.0);
                    let local = seat.point_to_local(point.truncate());
                    // Tucked feet stand a little under the seat's edge, between its legs.
                    let under = if clip.name.contains("tucked") { 0.045 } else { 0.0 };
                    let behind_edge = local.y + PELVIS_BEHIND_EDGE - under;
                    let inside =
                        behind_edge > 0.0 && behind_edge < 0.45 && local.x.abs() < 0.25 && point.z < top;
                    assert!(
                        !inside,
                        "{} frame {f}: {behind_edge} m behind the edge at height {}",
                        clip.name, point.z
                    );
                }
            }
        }
    }
}

/// Largest distance of head, hands and feet between two postures, each seen from its own place and facing.
fn apart(a: &Posture, b: &Posture) -> f32 {
    let b = b.moved(b.planar(), a.planar());
    let (p, q) = (a.pose(), b.pose());
    [Joint::Head, Joint::LeftHand, Joint::RightHand, Joint::LeftFoot, Joint::RightFoot]
        .into_iter()
        .map(|j| p.position(j).distance(q.position(j)))
        .fold(0.0, f32::max)
}

#[test]
fn a_sit_begins_as_walking_or_standing_looks() {
    let others: Vec<&Posture> = clips()
        .flat_map(|c| c.segments.iter().map(move |s| (c, s)))
        .filter(|(c, s)| {
            matches!(s.label, ActionLabel::Walk | ActionLabel::Idle) && !c.name.starts_with("sit")
        })
        .flat_map(|(c, s)| &c.motion.postures[s.first..s.end])
        .collect();
    for (clip, first, _, _) in spans(ActionLabel::Sit) {
        let start = &clip.motion.postures[first];
        let nearest = others.iter().map(|p| apart(start, p)).fold(f32::INFINITY, f32::min);
        assert!(nearest < 0.12, "{} begins {nearest} m from any walk", clip.name);
    }
}

/// Without any capture every action must be there to be played.
#[test]
fn every_action_type_has_frames_to_enter() {
    let database = MotionDatabase::build(&LIBRARY, &FeatureWeights::default(), &Progress::new()).unwrap();
    for &action_type in ActionType::ALL {
        assert!(database.entries(action_type).len() > 100, "{action_type:?}");
    }
}

/// On chairs some people prop a hand up on the seat beside the hip, most do not; some stretch their legs.
#[test]
fn people_rest_in_many_ways() {
    let on_a_chair = |name: &str| {
        ["sit 42 cm", "sit 46 cm", "sit 50 cm"].iter().any(|word| name.starts_with(word))
            && !name.contains("tucked")
            && !name.contains("sideways")
    };
    let (mut sits, mut propped, mut ahead) = (0, 0, Vec::new());
    for (clip, _, _, complete) in spans(ActionLabel::Sit).filter(|s| on_a_chair(&s.0.name)) {
        let posture = &clip.motion.postures[complete];
        let (pose, seat) = (posture.pose(), posture.planar());
        let local = |joint: Joint| seat.point_to_local(pose.position(joint).truncate());
        let beside = |hand: Joint| {
            local(hand).x.abs() > 0.17 && pose.position(hand).z < posture.root_position.z + 0.045
        };
        sits += 1;
        propped += usize::from(Joint::HANDS.into_iter().any(beside));
        ahead.push(-0.5 * (local(Joint::LeftFoot).y + local(Joint::RightFoot).y));
    }
    assert!(propped >= 3 && 2 * propped < sits, "{propped} of {sits}");
    ahead.sort_by(f32::total_cmp);
    assert!(ahead[ahead.len() - 1] - ahead[0] > 0.12, "{ahead:?}");
}
