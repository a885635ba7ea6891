//! People of the starter library walk, sit down, sit, get up and set off as people do: figures of captured motion as bounds.

use std::ops::Range;

use oncue::Progress;
use oncue::figures::StyleValues;
use oncue::library::starter;

/// Style of all clips whose name `wanted` says yes to.
fn style(wanted: impl Fn(&str) -> bool) -> StyleValues {
    let mut library = starter::generate(&Progress::new()).expect("the starter library");
    library.clips.retain(|clip| wanted(&clip.name));
    library.style(None)
}

/// The tenth, half and nine tenths of a row.
fn spread(style: &StyleValues, name: &str) -> [f32; 3] {
    let (group, row) = name.split_once('.').expect("group.row");
    let rows = style.rows();
    let found = rows.iter().find(|found| (found.0, found.1) == (group, row));
    let mut sorted = found.unwrap_or_else(|| panic!("no row {name}")).2.to_vec();
    assert!(!sorted.is_empty(), "{name} has no values");
    sorted.sort_by(f32::total_cmp);
    [0.1, 0.5, 0.9].map(|part| sorted[(part * (sorted.len() - 1) as f32).round() as usize])
}

/// Each row's median lies in its range.
fn medians(style: &StyleValues, bounds: &[(&str, Range<f32>)]) {
    for (name, range) in bounds {
        let [low, middle, high] = spread(style, name);
        assert!(range.contains(&middle), "{name}: {low} {middle} {high}, not within {range:?}");
    }
}

/// As fast as the captures that the bounds are from: walks of the Open Motion Project, 1.0 to 1.2 m/s.
#[test]
fn walks_move_as_captured_walks_do() {
    let at_speed = |name: &str| name.starts_with("walk 1.00") || name.starts_with("walk 1.15 m/s");
    let walks = style(at_speed);
    medians(
        &walks,
        &[
            ("walking.neck_sideways_cm", 3.6..7.7),
            ("walking.head_bob_cm", 1.2..3.6),
            ("walking.shoulders_degrees", 13.0..20.0),
            ("walking.pelvis_degrees", 11.0..19.0),
            ("walking.head_pitch_degrees", -19.0..-11.0),
            ("walking.wrist_fore_aft_cm", 27.0..38.0),
            ("walking.wrist_sideways_cm", 5.0..10.5),
            ("walking.knee_up_cm", 5.5..7.4),
        ],
    );
    // No two strides are the same.
    let [low, middle, high] = spread(&walks, "walking.wrist_fore_aft_cm");
    assert!(high - low > 0.05 * middle, "{low} {middle} {high}");
}

#[test]
fn starts_shift_the_weight_first() {
    let starts = style(|name| name.starts_with("walk") || name.starts_with("curve"));
    medians(&starts, &[("start.weight_shift_cm", 3.5..6.4), ("start.shift_s", 0.3..0.9)]);
}

/// Chairs: between 42 and 50 cm high.
#[test]
fn people_sit_down_on_chairs_as_people_do() {
    let chair = |name: &str| ["sit 42", "sit 46", "sit 50"].iter().any(|word| name.starts_with(word));
    let free = |name: &str| chair(name) && !name.contains("tucked") && !name.contains("sideways");
    let sits = style(free);
    medians(
        &sits,
        &[
            ("descent.descent_s", 1.0..1.6),
            ("descent.lean_degrees", 45.0..70.0),
            // Of UI-PRMD's 117 sits a tenth and nine tenths are -0.10 and 0.17 s, 58 and 83 %.
            ("descent.lean_leads_s", -0.10..0.17),
            ("descent.sunk_at_lean_percent", 58.0..83.0),
            ("descent.lean_at_seat_degrees", 25.0..45.0),
            ("descent.upper_arm_degrees", 35.0..70.0),
            ("descent.fastest_sink_m_per_s", 0.35..0.50),
            ("descent.feet_move_cm", 3.0..14.0),
            ("seated.feet_fore_aft_cm", 6.0..13.0),
            ("seated.ankles_apart_cm", 24.0..35.0),
            ("seated.knees_apart_cm", 28.0..45.0),
            ("seated.trunk_degrees", -14.0..-3.0),
        ],
    );
    // A family, not a clip.
    for (name, least) in
        [("descent.lean_degrees", 5.0), ("seated.knees_apart_cm", 5.0), ("descent.descent_s", 0.1)]
    {
        let [low, _, high] = spread(&sits, name);
        assert!(high - low > least, "{name}: {low} {high}");
    }
    let turning = style(|name| free(name) && (name.contains("walk up") || name.contains("60°")));
    medians(&turning, &[("descent.pelvis_turns_degrees", 6.0..20.0)]);
}

/// Seated people are never quite still, and get up by leaning over their feet.
#[test]
fn people_stir_while_seated_and_lean_to_get_up() {
    let seated = style(|name| name.starts_with("seated"));
    medians(&seated, &[("seated.head_cm_per_s", 0.4..8.0), ("seated.knees_cm_per_s", 0.1..3.0)]);
    let rising = style(|name| name.starts_with("stand up 4") || name.starts_with("stand up 50"));
    medians(&rising, &[("rising.lean_degrees", 35.0..60.0), ("rising.rise_s", 0.5..1.2)]);
}

/// Hands rest in several ways.
#[test]
fn hands_are_laid_down_in_several_ways() {
    use oncue::motion::Joint;
    let library = starter::generate(&Progress::new()).expect("the starter library");
    let mut places: Vec<[f32; 2]> = Vec::new();
    for clip in library.clips.iter().filter(|c| !c.mirrored && c.name.starts_with("seated")) {
        let pose = clip.motion.postures[30].pose();
        let along = |hand: Joint, hip: Joint| pose.position(hand).distance(pose.position(hip));
        places.push([along(Joint::LeftHand, Joint::LeftUpLeg), along(Joint::RightHand, Joint::RightUpLeg)]);
    }
    let apart = |a: &[f32; 2], b: &[f32; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) > 0.03;
    let mut kinds: Vec<[f32; 2]> = Vec::new();
    for place in places {
        if kinds.iter().all(|kind| apart(kind, &place)) {
            kinds.push(place);
        }
    }
    assert!(kinds.len() >= 4, "{kinds:?}");
}
