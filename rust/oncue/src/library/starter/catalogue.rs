//! Which clips the starter library has.

use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::Vec2;
use rayon::prelude::*;

use super::body::animate;
use super::curve::mix;
use super::plan::{Plan, Planner, SETTLE_SECONDS, SWIVEL_FROM, Seat, Seating, Stride, seated_foothold};
use super::seat::{TUCKED, seated_legs, way_down};
use super::style::Style;
use crate::action::ActionLabel;
use crate::error::Result;
use crate::library::{Clip, MotionLibrary, Segment, Source};
use crate::math::planar::rotate;
use crate::motion::{FRAME_RATE, Motion};
use crate::progress::Progress;

/// Seat heights, metres.
pub(super) const SEAT_HEIGHTS: [f32; 11] = [0.30, 0.34, 0.38, 0.42, 0.46, 0.50, 0.54, 0.59, 0.64, 0.70, 0.75];

/// Of these, where one may have to turn on the seat: chairs and stools at tables and counters, not sofas.
pub(super) const SWIVEL_HEIGHTS: [f32; 5] = [0.38, 0.46, 0.54, 0.64, 0.75];

/// Of these, where a panel may leave no room for the knees: stools at bars.
pub(super) const BAR_HEIGHTS: [f32; 3] = [0.64, 0.70, 0.75];

/// Seconds of standing before what a clip is about, in which the weight goes over to one foot, and after it.
const STANDING_SECONDS: f32 = 0.75;
const STANDING_AFTER: f32 = 1.0;

/// Walking begins with the shift of the weight, seconds before a foot leaves the floor.
const STARTS_BEFORE: f32 = 0.6;

/// A clip before it is animated: a plan, and from when on it is kept.
struct Recipe {
    name: String,
    plan: Plan,
    from: f32,
}

/// All clips and their mirrored copies: procedural motion on the unified skeleton, 30 Hz, floor at z = 0.
///
/// The same bytes every time. Fails only when cancelled.
pub fn generate(progress: &Progress) -> Result<MotionLibrary> {
    progress.stage("Making the starter library");
    let recipes = recipes();
    let made = AtomicUsize::new(0);
    let one = |recipe: &Recipe| {
        progress.check()?;
        let clip = make(recipe);
        progress.fraction(made.fetch_add(1, Ordering::Relaxed) as f32 / recipes.len() as f32);
        Ok(clip)
    };
    let mut clips = recipes.par_iter().map(one).collect::<Result<Vec<Clip>>>()?;
    let mirrored: Vec<Clip> = clips.iter().map(Clip::mirror).collect();
    clips.extend(mirrored);
    Ok(MotionLibrary { clips })
}

fn make(recipe: &Recipe) -> Clip {
    let mut motion = animate(&recipe.plan);
    let mut segments = segments(&recipe.plan, motion.len());
    let first = ((recipe.from * FRAME_RATE) as usize).min(motion.len());
    motion =
        Motion { postures: motion.postures.split_off(first), contacts: motion.contacts.split_off(first) };
    segments.retain(|s| s.end > first);
    for segment in &mut segments {
        segment.first = segment.first.saturating_sub(first);
        segment.end -= first;
        segment.complete = segment.complete.saturating_sub(first);
    }
    Clip { name: recipe.name.clone(), source: Source::Procedural, mirrored: false, motion, segments }
}

/// What happens when, from the plan.
fn segments(plan: &Plan, frames: usize) -> Vec<Segment> {
    let mut spans: Vec<(f32, ActionLabel, f32)> = Vec::new();
    let seated_first = plan.seat.is_some() && plan.seatings.first().is_none_or(|s| !s.down);
    let resting = if seated_first { ActionLabel::SeatedIdle } else { ActionLabel::Idle };
    spans.push((0.0, resting, 0.0));

    // Steps less than a second apart make one group.
    let steps: Vec<super::plan::Step> = plan.standing_steps().copied().collect();
    let mut groups: Vec<&[super::plan::Step]> = Vec::new();
    let mut rest = &steps[..];
    while !rest.is_empty() {
        let count = 1 + rest.windows(2).take_while(|w| w[1].lift - w[0].land < 0.8).count();
        let (group, after) = rest.split_at(count);
        groups.push(group);
        rest = after;
    }
    for group in groups {
        let (first, last) = (group[0], group[group.len() - 1]);
        spans.push((first.lift - STARTS_BEFORE, ActionLabel::Walk, 0.0));
        let into_seat =
            plan.seatings.iter().find(|s| s.down && s.start > last.lift - 0.2 && s.start < last.land + 0.6);
        if into_seat.is_some() {
            let begin = group[group.len().saturating_sub(3)].lift - if group.len() <= 3 { 0.35 } else { 0.0 };
            spans.push((begin, ActionLabel::Sit, 0.0));
        } else {
            if group.len() >= 4 {
                spans.push((group[group.len() - 2].lift, ActionLabel::Stop, last.land + 0.45));
            }
            spans.push((last.land + if group.len() >= 4 { 0.55 } else { 0.3 }, ActionLabel::Idle, 0.0));
        }
    }
    for seating in &plan.seatings {
        if seating.down {
            if spans.last().is_none_or(|s| s.1 != ActionLabel::Sit) {
                spans.push((seating.start, ActionLabel::Sit, 0.0));
            }
            if let Some(span) = spans.last_mut() {
                span.2 = seating.settled;
            }
            spans.push((seating.settled + 0.1, ActionLabel::SeatedIdle, 0.0));
        } else {
            spans.push((seating.start, ActionLabel::StandUp, seating.end));
            let walks_on =
                |s: &super::plan::Step| s.lift > seating.start && s.lift - 0.35 < seating.end + 0.1;
            if !steps.iter().any(walks_on) {
                spans.push((seating.end + 0.1, ActionLabel::Idle, 0.0));
            }
        }
    }
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let frame = |t: f32| ((t.max(0.0) * FRAME_RATE).round() as usize).min(frames);
    let mut out: Vec<Segment> = Vec::new();
    for (i, &(from, label, complete)) in spans.iter().enumerate() {
        let (first, end) = (frame(from), spans.get(i + 1).map_or(frames, |s| frame(s.0)));
        if end <= first {
            continue;
        }
        let complete = if complete > 0.0 { frame(complete).clamp(first, end - 1) } else { end - 1 };
        match out.last_mut() {
            Some(last) if last.label == label && complete == end - 1 => {
                (last.end, last.complete) = (end, complete)
            }
            _ => out.push(Segment { label, first, end, complete }),
        }
    }
    out
}

/// The recipes, in the library's order. The style of each follows from its place.
fn recipes() -> Vec<Recipe> {
    let mut out = Vec::new();
    locomotion(&mut out);
    seats(&mut out);
    BAR_HEIGHTS.iter().for_each(|&height| sits_at_a_bar(&mut out, height));
    // Last, since a clip's style follows from its place.
    starts_with_a_turn(&mut out, &[45.0, 75.0, 110.0, 160.0]);
    out
}

fn planner(out: &[Recipe], side: usize) -> Planner {
    Planner::new(Style::of_clip(out.len() as u64), side)
}

/// Metres between the ankles of who comes to stand before a seat: feet are set as one will sit.
const STANCE_BEFORE_A_SEAT: f32 = 0.19;

/// Of who goes to a seat.
fn sitting_planner(out: &[Recipe], side: usize) -> Planner {
    let mut planner = planner(out, side);
    planner.stance = STANCE_BEFORE_A_SEAT;
    planner
}

fn add(out: &mut Vec<Recipe>, name: String, mut planner: Planner, from: f32) {
    planner.stand(STANDING_AFTER);
    out.push(Recipe { name, plan: planner.finish(), from });
}

/// Turns inside a walk: so many radians a step at most.
const SHARPEST: f32 = 0.80;

/// `to`: degrees.
fn starts_with_a_turn(out: &mut Vec<Recipe>, to: &[f32]) {
    for &degrees in to {
        for speed in [0.6, 1.1] {
            let mut p = planner(out, 0);
            let first = degrees.min(45.0).to_radians();
            let count = ((degrees - 45.0) / 45.0).ceil().max(0.0);
            // Who turns right round takes his time.
            let turning = speed * if degrees > 140.0 { 0.7 } else { 0.8 };
            p.stand(STANDING_SECONDS + 0.2).step(turning, 0.45, first);
            for _ in 0..count as usize {
                p.step(turning, 0.5, (degrees.to_radians() - first) / count);
            }
            p.step(speed, 0.85, 0.0).walk(3, speed, 0.0).stop(speed);
            add(out, format!("start with a turn of {degrees}° to {speed:.1} m/s"), p, 0.0);
        }
    }
}

fn locomotion(out: &mut Vec<Recipe>) {
    for (i, speed) in [0.4, 0.55, 0.7, 0.85, 1.0, 1.15, 1.3, 1.5].into_iter().enumerate() {
        let mut p = planner(out, i % 2);
        p.start(speed, 0.0).walk(7 + i % 2, speed, 0.0).stop(speed);
        add(out, format!("walk {speed:.2} m/s"), p, 0.0);
    }
    for speed in [0.5, 0.8, 1.15] {
        let mut p = planner(out, 0);
        p.start(speed, 0.0).walk(3, speed, 0.0).walk(3, 0.5 * (speed + 1.1), 0.0).walk(3, 1.1, 0.0);
        p.walk(2, 0.8, 0.0).stop(0.6);
        add(out, format!("walk {speed:.2} m/s, change of pace"), p, 0.0);
    }
    // Curves, closed by a stop in the curve or after a straight.
    for (i, radius) in [0.4, 0.6, 0.9, 1.4, 2.2, 3.5].into_iter().enumerate() {
        for (j, speed) in [0.5f32, 0.8, 1.15].into_iter().enumerate() {
            if radius < 0.7 && speed > 1.0 {
                continue;
            }
            let mut p = planner(out, (i + j) % 2);
            let turn = (super::plan::step_length(speed) / radius).min(SHARPEST);
            p.start(speed, 0.0).walk(1 + j % 2, speed, 0.4 * turn).walk(7, speed, turn);
            if (i + j) % 2 == 0 {
                p.walk(1, speed, 0.4 * turn).walk(1, speed, 0.0);
            }
            p.stop(speed);
            add(out, format!("curve {radius:.1} m at {speed:.2} m/s"), p, 0.0);
        }
    }
    for (i, (radius, speed)) in
        [(0.7f32, 0.7f32), (1.1, 0.9), (1.8, 1.2), (2.6, 1.35)].into_iter().enumerate()
    {
        let mut p = planner(out, i % 2);
        let turn = super::plan::step_length(speed) / radius;
        p.start(speed, 0.0).walk(1, speed, 0.5 * turn).walk(4, speed, turn).walk(1, speed, 0.0);
        p.walk(4, speed, -turn).walk(1, speed, 0.0).stop(speed);
        add(out, format!("S-curve {radius:.1} m at {speed:.2} m/s"), p, 0.0);
    }
    // Sharp turns between straights, by either foot.
    for degrees in [45.0f32, 90.0, 135.0, 180.0] {
        for (speed, inner) in [(0.65, true), (0.65, false), (1.1, true), (1.1, false)] {
            let steps = (degrees / 46.0).ceil().max(1.0) as usize;
            let mut p = planner(out, if inner { 0 } else { 1 });
            p.start(speed, 0.0).walk(2, speed, 0.0);
            for k in 0..steps {
                let slow = if degrees > 60.0 { 0.55 } else { 0.8 };
                let last = k + 1 == steps;
                p.step(
                    speed * if last { 0.9 } else { 0.75 },
                    if last { 0.8 } else { slow },
                    degrees.to_radians() / steps as f32,
                );
            }
            p.walk(3, speed, 0.0).stop(speed);
            add(
                out,
                format!(
                    "walk {speed:.2} m/s, turn {degrees}°, {} foot",
                    if inner { "inner" } else { "outer" }
                ),
                p,
                0.0,
            );
        }
    }
    // Turns on the spot, and starts out of them.
    for degrees in [30.0f32, 45.0, 60.0, 90.0, 120.0, 135.0, 150.0, 180.0] {
        let pairs = (degrees / 62.0).ceil() as usize;
        let mut p = planner(out, 0);
        p.stand(STANDING_SECONDS).turn_on_spot(degrees.to_radians(), pairs);
        add(out, format!("turn on the spot {degrees}°"), p, 0.0);
    }
    starts_with_a_turn(out, &[30.0, 60.0, 90.0, 135.0, 180.0]);
    // A few steps: small corrections of place.
    for (i, share) in [0.3, 0.5, 0.75].into_iter().enumerate() {
        let mut p = planner(out, i % 2);
        p.stand(STANDING_SECONDS).step(0.6, share, 0.0).close(0.42).stand(1.2);
        p.step(0.7, share, 0.0)
            .step(0.7, share, 0.0)
            .close(0.42)
            .stand(1.2)
            .step(0.7, share, 0.25)
            .close(0.42);
        add(out, format!("short steps {i}"), p, 0.0);
    }
    for (i, left) in [0.15, 0.25, 0.35].into_iter().enumerate() {
        let mut p = planner(out, 0);
        p.stand(STANDING_SECONDS)
            .side_step(left, 0.42)
            .side_step(left, 0.40)
            .side_step(left, 0.40)
            .stand(1.3)
            .side_step(left, 0.44);
        add(out, format!("side steps {i}"), p, 0.0);
    }
    for (i, (length, speed)) in [(0.20f32, 0.30f32), (0.32, 0.5), (0.42, 0.7)].into_iter().enumerate() {
        for turn in [0.0, 0.18] {
            let mut p = planner(out, i % 2);
            p.stand(STANDING_SECONDS + 0.1).back_step(0.6 * length, 0.6 * speed, 0.5 * turn);
            for _ in 0..5 {
                p.back_step(length, speed, turn);
            }
            p.back_step(0.6 * length, 0.7 * speed, 0.0).close(0.45);
            add(out, format!("back steps {i}, {turn}"), p, 0.0);
        }
    }
    for i in 0..4 {
        let mut p = planner(out, 0);
        p.plan_mut().style.sway = [0.010, 0.020, 0.030, 0.015][i];
        p.stand(11.0);
        add(out, format!("idle {i}"), p, 0.0);
    }
}

/// The seat behind a person who stands at the planner's place, once they have turned by `turn` (radians).
fn seat_behind(p: &Planner, height: f32, tuck: f32, turn: f32) -> Seat {
    let back = rotate(p.yaw() + turn, Vec2::Y) * seated_legs(height, tuck).ankle_ahead;
    Seat { height, tuck, pelvis: p.position() + back, shift: Vec2::ZERO, at_table: tuck > 0.0, spread: 0.0 }
}

/// So far before where one sits in the end is the back of a chair no hindrance, metres.
const CLEAR_OF_THE_BACK: f32 = 0.11;
/// So far behind where one sits in the end the knees pass before the panel of a bar, metres.
const CLEAR_OF_THE_BAR: f32 = 0.16;
/// Knees at such a panel: each turned outwards by so much, and the shins under the seat, radians.
const KNEES_APART: f32 = 0.72;
const FEET_AT_THE_BAR: f32 = 0.20;

/// Of the way down, when each foot is set as one sits: one while the legs hardly give yet, the other once the seat carries; where the last
/// of the turn is made while sinking, both on the way.
const FEET_SET: [f32; 2] = [0.20, 0.86];
const FEET_TURN: [f32; 2] = [0.30, 0.74];
/// Seconds before the last foot is down that the trunk begins to lean.
const LEANS_BEFORE: f32 = 0.30;

/// Sits down; the last `turn` (radians) of the way round is made while sinking.
fn sit_down(p: &mut Planner, height: f32, tuck: f32, turn: f32) {
    sit_down_and_swivel(p, height, tuck, Swivel { sinking: turn, ..Swivel::default() });
}

/// Feet come back by so much before one gets up, metres.
const DRAWN_BACK: f32 = 0.07;

/// What one does on a seat before one sits as one stays.
#[derive(Debug, Clone, Copy, Default)]
struct Swivel {
    /// Radians made while sinking, left positive.
    sinking: f32,
    /// Radians made on the seat.
    turn: f32,
    /// Metres that the pelvis moves back meanwhile.
    back: f32,
    /// How far each knee turns outwards, radians.
    spread: f32,
}

fn sit_down_and_swivel(p: &mut Planner, height: f32, tuck: f32, swivel: Swivel) {
    let mut seat = seat_behind(p, height, tuck, swivel.sinking);
    p.plan_mut().style.seated.forth *= room_ahead(height);
    // The trunk begins to lean before the last foot is down.
    let start = p.now() - if p.stepped() { LEANS_BEFORE } else { 0.0 };
    let end = start + way_down(height, p.style().seated.pace);
    let mut settled = end;
    if swivel.turn != 0.0 {
        // Whoever swivels in does so for want of room.
        p.plan_mut().style.seated.forth = 0.0;
        seat.at_table = true;
        seat.spread = swivel.spread;
        seat.shift = rotate(p.yaw() + swivel.turn, Vec2::Y) * swivel.back;
        p.stand(start + SWIVEL_FROM * (end - start) - p.now());
        let count = (swivel.turn.abs() / 0.9).ceil() as usize;
        p.swivel(swivel.turn, count, seated_legs(height, tuck).ankle_ahead, seat.shift);
        settled = settled.max(p.now() + SETTLE_SECONDS);
    } else if !seated_legs(height, tuck).hanging {
        if tuck > 0.0 {
            // Feet that are drawn back have little room to go further.
            p.plan_mut().style.seated.stagger *= 0.3;
            p.plan_mut().style.seated.forth = 0.0;
        }
        let lifts = if swivel.sinking == 0.0 { FEET_SET } else { FEET_TURN };
        let lifts = lifts.map(|part| mix(start, end, part));
        p.settle(swivel.sinking, lifts);
    }
    let plan = p.plan_mut();
    plan.seat = Some(seat);
    plan.seatings.push(Seating { down: true, start, end, settled });
    p.stand(settled - p.now() + 0.1);
}

/// How much of a turn before a seat is made while sinking, degrees: little over a low one, where hips have less room; none
/// where feet hang and turn with the pelvis alone.
fn turned_while_sinking(height: f32, degrees: f32) -> f32 {
    let most = mix(8.0, 18.0, ((height - 0.32) / 0.08).clamp(0.0, 1.0));
    if seated_legs(height, 0.0).hanging { 0.0 } else { (0.35 * degrees).min(most) }
}

fn seats(out: &mut Vec<Recipe>) {
    for height in SEAT_HEIGHTS {
        let cm = (100.0 * height).round();
        for degrees in [0.0f32, 30.0, 60.0, 90.0] {
            let mut p = sitting_planner(out, 0);
            p.stand(STANDING_SECONDS + 0.1);
            let sinking = turned_while_sinking(height, degrees);
            if degrees > 0.0 {
                let pairs = ((degrees - sinking) / 50.0).ceil() as usize;
                p.turn_on_spot((degrees - sinking).to_radians(), pairs);
            }
            sit_down(&mut p, height, 0.0, sinking.to_radians());
            add(out, format!("sit {cm} cm, turn {degrees}°"), p, 0.0);
        }
        // A back step to the seat, then down.
        let mut p = sitting_planner(out, 1);
        p.stand(STANDING_SECONDS + 0.1).back_step(0.22, 0.42, 0.0).close(0.42);
        sit_down(&mut p, height, 0.0, 0.0);
        add(out, format!("sit {cm} cm, back step"), p, 0.0);
        if (0.40..0.56).contains(&height) {
            tucked_sits(out, height);
        }
        if SWIVEL_HEIGHTS.contains(&height) {
            swivelling_sits(out, height);
        }
        for (speed, pace) in [(0.8, ""), (0.6, ", slowly")] {
            for degrees in [90.0f32, 135.0, 180.0] {
                let mut p = sitting_planner(out, if degrees > 100.0 { 1 } else { 0 });
                let sinking = turned_while_sinking(height, degrees);
                let from = walk_up_and_turn(&mut p, speed, (degrees - sinking).to_radians());
                sit_down(&mut p, height, 0.0, sinking.to_radians());
                add(out, format!("sit {cm} cm, walk up from {}°{pace}", 180.0 - degrees), p, from);
            }
        }
        for walk_off in [false, true] {
            let mut p = seated_planner(out, height, DRAWN_BACK);
            let start = 0.9;
            let end = start + 0.8 * way_down(height, p.style().seated.pace);
            if !seated_legs(height, 0.0).hanging {
                p.draw_back([start - 0.35, mix(start, end, 0.06)]);
            }
            p.plan_mut().seatings.push(Seating { down: false, start, end, settled: end });
            p.stand(end - p.now());
            if walk_off {
                p.step(0.8, 0.6, 0.0).walk(2, 0.9, 0.0).stop(0.8);
            }
            add(out, format!("stand up {cm} cm{}", if walk_off { " and walk" } else { "" }), p, 0.0);
        }
        let mut p = seated_planner(out, height, 0.0);
        p.stand(5.0).stir(!seated_legs(height, 0.0).hanging).stand(5.0);
        add(out, format!("seated {cm} cm"), p, 0.0);
    }
}

/// Of the way that feet are set ahead, how much a seat allows: on a high one they stand on their balls.
fn room_ahead(height: f32) -> f32 {
    ((0.56 - height) / 0.08).clamp(0.0, 1.0)
}

/// Seated, with the feet as one sits; they come back by `drawn_back` metres as one gets up.
fn seated_planner(out: &[Recipe], height: f32, drawn_back: f32) -> Planner {
    let mut p = planner(out, 0);
    let legs = seated_legs(height, 0.0);
    let mut seat = seat_behind(&p, height, 0.0, 0.0);
    p.plan_mut().style.seated.forth *= room_ahead(height);
    if !legs.hanging {
        seat.pelvis -= rotate(p.yaw(), Vec2::Y) * drawn_back;
        let under_knees = seat.pelvis + rotate(p.yaw(), Vec2::NEG_Y) * legs.ankle_ahead;
        let style = *p.style();
        p.plan_mut().feet = [0, 1].map(|side| seated_foothold(under_knees, p.yaw(), side, &style));
    }
    p.plan_mut().seat = Some(seat);
    p
}

/// Sits with the feet drawn back, as between a chair and its table: from standing, turning, and from the side.
fn tucked_sits(out: &mut Vec<Recipe>, height: f32) {
    let cm = (100.0 * height).round();
    for degrees in [0.0f32, 45.0] {
        let mut p = planner(out, 0);
        p.stand(STANDING_SECONDS + 0.1);
        if degrees > 0.0 {
            p.turn_on_spot(degrees.to_radians(), (degrees / 50.0).ceil() as usize);
        }
        sit_down(&mut p, height, TUCKED, 0.0);
        add(out, format!("sit {cm} cm tucked, turn {degrees}°"), p, 0.0);
    }
    for steps in [1, 2] {
        let mut p = planner(out, 0);
        p.stand(STANDING_SECONDS + 0.1);
        for _ in 0..steps {
            p.side_step(0.26, 0.40);
        }
        sit_down(&mut p, height, TUCKED, 0.0);
        add(out, format!("sit {cm} cm tucked, {steps} side steps"), p, 0.0);
    }
}

/// Sits down on the side of a seat and turns on it towards its front, as where a table leaves no room to stand before it:
/// on its middle where the table is close, or on the front half, clear of a back, and then back.
fn swivelling_sits(out: &mut Vec<Recipe>, height: f32) {
    for (half, back) in [("middle", 0.0), ("front", CLEAR_OF_THE_BACK)] {
        for degrees in [60.0f32, 90.0] {
            let swivel = Swivel { turn: degrees.to_radians(), back, ..Swivel::default() };
            sideways_sit(out, height, half, 0.0, swivel, Arriving::Turning(0.0));
        }
        let swivel = Swivel { turn: FRAC_PI_2, back, ..Swivel::default() };
        for arriving in FROM_THE_SIDE {
            sideways_sit(out, height, half, 0.0, swivel, arriving);
        }
    }
}

/// Sits down on the side of a high stool, on its rear half, turns and moves in with the knees apart and the feet drawn
/// back: so one sits at a bar whose panel is nearer than knees reach.
fn sits_at_a_bar(out: &mut Vec<Recipe>, height: f32) {
    let swivel =
        Swivel { turn: FRAC_PI_2, back: -CLEAR_OF_THE_BAR, spread: KNEES_APART, ..Swivel::default() };
    for arriving in [Arriving::Turning(0.0)].into_iter().chain(FROM_THE_SIDE) {
        sideways_sit(out, height, "rear, knees apart", FEET_AT_THE_BAR, swivel, arriving);
    }
}

/// How one comes to stand with the back to the side of a seat.
#[derive(Debug, Clone, Copy)]
enum Arriving {
    /// Turns on the spot, degrees.
    Turning(f32),
    /// Steps back.
    BackStep,
    /// Walks up to the seat and turns round.
    WalkingUp,
}

/// All but standing there already.
const FROM_THE_SIDE: [Arriving; 4] =
    [Arriving::BackStep, Arriving::Turning(90.0), Arriving::Turning(-90.0), Arriving::WalkingUp];

/// `half`: the part of the seat that one lands on, for the name.
fn sideways_sit(
    out: &mut Vec<Recipe>,
    height: f32,
    half: &str,
    tuck: f32,
    swivel: Swivel,
    arriving: Arriving,
) {
    let walks = matches!(arriving, Arriving::WalkingUp);
    let mut p = planner(out, usize::from(!matches!(arriving, Arriving::Turning(_))));
    let mut from = 0.0;
    if !walks {
        p.stand(STANDING_SECONDS + 0.1);
    }
    let how = match arriving {
        Arriving::Turning(degrees) => {
            if degrees != 0.0 {
                p.turn_on_spot(degrees.to_radians(), 2);
            }
            format!("turn {degrees}°")
        }
        Arriving::BackStep => {
            p.back_step(0.22, 0.42, 0.0).close(0.42);
            "back step".into()
        }
        Arriving::WalkingUp => {
            from = walk_up_and_turn(&mut p, 0.8, PI);
            "walk up from 0°".into()
        }
    };
    sit_down_and_swivel(&mut p, height, tuck, swivel);
    let (cm, degrees) = ((100.0 * height).round(), swivel.turn.to_degrees().round());
    add(out, format!("sit {cm} cm sideways on the {half}, {how}, swivel {degrees}°"), p, from);
}

/// Walks towards a seat and turns left by `turn` in front of it; gives the time when it walks evenly.
fn walk_up_and_turn(p: &mut Planner, speed: f32, turn: f32) -> f32 {
    p.start(speed, 0.0).walk(1, speed, 0.0);
    let from = p.now() - 0.2;
    if p.next == 1 {
        p.walk(1, speed, 0.0);
    }
    p.step(0.8 * speed, 0.75, 0.0);
    if p.next == 1 {
        p.step(0.8 * speed, 0.6, 0.0);
    }
    let count = (turn / 0.8).ceil() as usize;
    let heading = p.yaw();
    for k in 0..count {
        let share = 1.0 / count as f32;
        // The last of the way is made while turning.
        let ahead = [0.16, 0.05, 0.01, 0.0][k.min(3)];
        let (yaw, part) = (p.yaw(), turn * share);
        let local = rotate(heading - (yaw + 0.5 * part), Vec2::new(0.0, -ahead));
        p.stride(Stride {
            forward: -local.y,
            left: local.x,
            turn: part,
            width: p.stance,
            swing: 0.46,
            double_support: 0.17,
        });
    }
    p.close(0.40);
    from
}
