//! People of the starter library walk, sit down, sit, get up and set off as people do: figures of captured motion as bounds.

#[path = "../examples/common/style.rs"]
mod style;

use std::ops::Range;

use oncue::Progress;
use oncue::library::{Clip, starter};
use style::Row;

/// The rows of `measure` over all clips whose name `wanted` says yes to.
fn rows(measure: fn(&[&Clip]) -> Vec<Row>, wanted: impl Fn(&str) -> bool) -> Vec<Row> {
    let library = starter::generate(&Progress::new()).expect("the starter library");
    let clips: Vec<&Clip> =
        library.clips.iter().filter(|clip| !clip.mirrored && wanted(&clip.name)).collect();
    measure(&clips)
}

/// The tenth, half and nine tenths of a row.
fn spread(rows: &[Row], name: &str) -> [f32; 3] {
    let row = rows.iter().find(|row| row.name == name).unwrap_or_else(|| panic!("no row {name}"));
    row.spread().unwrap_or_else(|| panic!("{name} has no values"))
}

/// Each row's median lies in its range.
fn medians(rows: &[Row], bounds: &[(&str, Range<f32>)]) {
    for (name, range) in bounds {
        let [low, middle, high] = spread(rows, name);
        assert!(range.contains(&middle), "{name}: {low} {middle} {high}, not within {range:?}");
    }
}

/// As fast as the captures that the bounds are from: walks of the Open Motion Project, 1.0 to 1.2 m/s.
#[test]
fn walks_move_as_captured_walks_do() {
    let at_speed = |name: &str| name.starts_with("walk 1.00") || name.starts_with("walk 1.15 m/s");
    let walks = rows(style::walking, at_speed);
    medians(
        &walks,
        &[
            ("neck sideways cm", 3.6..7.7),
            ("head bob cm", 1.2..3.6),
            ("shoulders/pelvis °", 13.0..20.0),
            ("pelvis turn °", 11.0..19.0),
            ("head pitch °", -19.0..-11.0),
            ("wrist fore-aft cm", 27.0..38.0),
            ("wrist sideways cm", 5.0..10.5),
            ("knee up cm", 5.5..7.4),
        ],
    );
    // No two strides are the same.
    let [low, middle, high] = spread(&walks, "wrist fore-aft cm");
    assert!(high - low > 0.05 * middle, "{low} {middle} {high}");
}

#[test]
fn starts_shift_the_weight_first() {
    let starts = rows(style::starting, |name| name.starts_with("walk") || name.starts_with("curve"));
    medians(&starts, &[("weight shift cm", 3.5..6.4), ("shift to lift-off s", 0.3..0.9)]);
}

/// Chairs: between 42 and 50 cm high.
#[test]
fn people_sit_down_on_chairs_as_people_do() {
    let chair = |name: &str| ["sit 42", "sit 46", "sit 50"].iter().any(|word| name.starts_with(word));
    let free = |name: &str| chair(name) && !name.contains("tucked") && !name.contains("sideways");
    let sits = rows(style::sitting, free);
    medians(
        &sits,
        &[
            ("descent s", 1.0..1.6),
            ("peak lean down °", 45.0..70.0),
            ("fastest sink m/s", 0.35..0.50),
            ("feet move down cm", 3.0..14.0),
            ("feet fore-aft cm", 6.0..13.0),
            ("ankles apart cm", 24.0..35.0),
            ("knees apart cm", 28.0..45.0),
            ("trunk seated °", -14.0..-3.0),
        ],
    );
    // A family, not a clip.
    for (name, least) in [("peak lean down °", 5.0), ("knees apart cm", 5.0), ("descent s", 0.1)] {
        let [low, _, high] = spread(&sits, name);
        assert!(high - low > least, "{name}: {low} {high}");
    }
    let turning =
        rows(style::sitting, |name| free(name) && (name.contains("walk up") || name.contains("60°")));
    medians(&turning, &[("pelvis turns down °", 6.0..20.0)]);
}

/// Seated people are never quite still, and get up by leaning over their feet.
#[test]
fn people_stir_while_seated_and_lean_to_get_up() {
    let seated = rows(style::sitting, |name| name.starts_with("seated"));
    medians(&seated, &[("head seated cm/s", 0.4..8.0), ("knees seated cm/s", 0.1..3.0)]);
    let rising =
        rows(style::sitting, |name| name.starts_with("stand up 4") || name.starts_with("stand up 50"));
    medians(&rising, &[("peak lean up °", 35.0..60.0), ("rise s", 0.5..1.2)]);
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
