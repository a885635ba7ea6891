//! What happens in a motion, found from the motion itself.
//!
//! Sitting is told from squatting by statics: a body whose mass stands behind its heels is held by a seat.

use glam::{Vec2, Vec3};

use super::clip::Segment;
use super::contact::runs;
use super::foot;
use crate::action::ActionLabel;
use crate::motion::{FRAME_RATE, Joint, Motion, Pose};

use Joint::*;

/// Faster is running, metres a second.
const RUN_SPEED: f32 = 1.9;
/// A pelvis lower than this is crouching, lying or sitting, metres (it stands at 0.99).
const LOW_PELVIS: f32 = 0.82;
/// Standing still: pelvis slower than this, metres a second …
const STILL_SPEED: f32 = 0.12;
/// … with both feet planted for at least so many frames.
const STILL_FRAMES: usize = 12;
/// A trunk bent further than this is picking something up, radians.
const BENT_TRUNK: f32 = 0.70;
/// Shorter stretches of walking or standing join their neighbours, frames.
const SHORTEST_STRETCH: usize = 8;
/// Frames kept after an action is complete: the settling.
const SETTLE_FRAMES: usize = 10;

/// What is measured in one frame.
struct Signal {
    pelvis: Vec3,
    /// Planar speed of the pelvis over half a second, metres a second.
    speed: f32,
    /// Angle of the trunk from the vertical, radians.
    lean: f32,
    /// Mean angle of the thighs from the vertical, radians.
    thigh: f32,
    /// How far the mass stands before the heels, metres (negative: behind them).
    balance: f32,
    /// Both feet off the floor.
    airborne: bool,
    planted: [bool; 2],
    /// A hand is raised, or both hold something in front.
    busy_hands: bool,
    raised_hand: bool,
}

/// Labels a motion whose contacts are set. The segments cover it without gaps.
pub(crate) fn label(motion: &Motion) -> Vec<Segment> {
    let count = motion.len();
    if count == 0 {
        return Vec::new();
    }
    let signals = signals(motion);
    let mut labels = vec![ActionLabel::Walk; count];
    let both: Vec<bool> =
        signals.iter().map(|s| s.planted == [true, true] && s.speed < STILL_SPEED).collect();
    for (first, end) in runs(&both, true) {
        if end - first >= STILL_FRAMES.min(count) {
            labels[first..end].fill(ActionLabel::Idle);
        }
    }
    join_short(&mut labels);
    mark_other(&mut labels, &signals);
    join_short(&mut labels);
    let mut segments: Vec<Segment> = Vec::new();
    mark_sits(&mut labels, &signals, &mut segments);
    mark_stops(&mut labels, &signals, &mut segments);
    // The rest of the frames, run by run.
    let mut frame = 0;
    while frame < count {
        if let Some(made) = segments.iter().find(|s| s.first == frame) {
            frame = made.end;
            continue;
        }
        let next = segments.iter().map(|s| s.first).filter(|&f| f > frame).min().unwrap_or(count);
        let end = (frame..next).find(|&f| labels[f] != labels[frame]).unwrap_or(next);
        segments.push(Segment { label: labels[frame], first: frame, end, complete: end - 1 });
        frame = end;
    }
    segments.sort_by_key(|s| s.first);
    segments
}

/// The same, but that sits and rises whose arms are held up are not matched: as a person sits down who was asked to hold them so,
/// nobody does.
pub(crate) fn label_for_use(motion: &Motion) -> Vec<Segment> {
    let signals = signals(motion);
    let mut segments = label(motion);
    for segment in &mut segments {
        let seated =
            [ActionLabel::Sit, ActionLabel::SeatedIdle, ActionLabel::StandUp].contains(&segment.label);
        let own = &signals[segment.first..segment.end];
        let raised = own.iter().filter(|signal| signal.raised_hand).count();
        if seated && 2 * raised > own.len() {
            segment.label = ActionLabel::Other;
        }
    }
    segments
}

fn signals(motion: &Motion) -> Vec<Signal> {
    let poses: Vec<Pose> = motion.postures.iter().map(|p| p.pose()).collect();
    let count = poses.len();
    let window = 7;
    (0..count)
        .map(|frame| {
            let pose = &poses[frame];
            let at = |j: Joint| pose.position(j);
            let (a, b) = (frame.saturating_sub(window), (frame + window).min(count - 1));
            let way = poses[a].position(Hips).truncate().distance(poses[b].position(Hips).truncate());
            let speed = if a == b { 0.0 } else { way * FRAME_RATE / (b - a) as f32 };
            let forward = motion.postures[frame].planar().forward();
            let ahead = |p: Vec3, from: Vec3| (p - from).truncate().dot(forward);
            let shoulders = (at(LeftArm) + at(RightArm)) / 2.0;
            let angle = |v: Vec3| v.normalize_or_zero().z.clamp(-1.0, 1.0).acos();
            let thigh = (angle(at(LeftUpLeg) - at(LeftLeg)) + angle(at(RightUpLeg) - at(RightLeg))) / 2.0;
            // Segment masses after Dempster, rounded: trunk 0.5, head 0.08, arms 0.1, thighs 0.2, shins and feet 0.12.
            let mass = shoulders.lerp(at(Hips), 0.5) * 0.5
                + at(Head) * 0.08
                + (at(LeftForeArm) + at(RightForeArm)) * 0.05
                + (at(LeftUpLeg) + at(LeftLeg) + at(RightUpLeg) + at(RightLeg)) * 0.05
                + (at(LeftLeg) + at(LeftFoot) + at(RightLeg) + at(RightFoot)) * 0.03;
            let heels = [0, 1].map(|side| foot::sole(pose, side)[0]);
            let heel: Vec2 = (heels[0] + heels[1]).truncate() / 2.0;
            let lowest = |side: usize| foot::sole(pose, side).iter().map(|p| p.z).fold(f32::MAX, f32::min);
            let planted = motion.contacts.get(frame).map_or([false; 2], |c| c.map(|c| c == 1.0));
            let hands = Joint::HANDS.map(at);
            let raised_hand = hands.iter().any(|h| h.z > shoulders.z - 0.05);
            // Both hands held before the body and elbows bent: arms that swing are seldom so, and never for long.
            let reach = hands.map(|h| ahead(h, at(Hips)));
            let bent = |upper: Joint, elbow: Joint, hand: Joint| {
                (at(elbow) - at(upper)).angle_between(at(hand) - at(elbow)) > 0.7
            };
            let holding = reach.iter().all(|&r| r > 0.04)
                && hands[0].distance(hands[1]) < 0.5
                && bent(LeftArm, LeftForeArm, LeftHand)
                && bent(RightArm, RightForeArm, RightHand);
            Signal {
                pelvis: at(Hips),
                speed,
                lean: angle(shoulders - at(Hips)),
                thigh,
                balance: (mass.truncate() - heel).dot(forward),
                airborne: !planted[0] && !planted[1] && lowest(0) > 0.02 && lowest(1) > 0.02,
                planted,
                busy_hands: holding,
                raised_hand,
            }
        })
        .collect()
}

/// Stretches of walking or standing shorter than [`SHORTEST_STRETCH`] take their neighbour's label.
fn join_short(labels: &mut [ActionLabel]) {
    let mut frame = 0;
    while frame < labels.len() {
        let end = (frame..labels.len()).find(|&f| labels[f] != labels[frame]).unwrap_or(labels.len());
        if end - frame < SHORTEST_STRETCH {
            let neighbour = if frame > 0 { Some(labels[frame - 1]) } else { labels.get(end).copied() };
            if let Some(neighbour) = neighbour {
                labels[frame..end].fill(neighbour);
            }
        }
        frame = end;
    }
}

/// Something that is not offered for matching, and how it shows.
struct Unmatched {
    /// As a sentence names it.
    what: &'static str,
    shows: fn(&Signal) -> bool,
    /// It lasts for so many frames at least …
    shortest: usize,
    /// … and takes so many around it along.
    around: usize,
}

const UNMATCHED: [Unmatched; 6] = [
    Unmatched { what: "running", shows: |s| s.speed > RUN_SPEED, shortest: 4, around: 5 },
    Unmatched { what: "both feet in the air", shows: |s| s.airborne, shortest: 2, around: 8 },
    // Before what a seat's height shows: who sits with an arm held up does not crouch.
    Unmatched { what: "a raised hand", shows: |s| s.raised_hand, shortest: 5, around: 5 },
    Unmatched { what: "crouching or lying", shows: |s| s.pelvis.z < LOW_PELVIS, shortest: 3, around: 5 },
    Unmatched { what: "bending down", shows: |s| s.lean > BENT_TRUNK, shortest: 3, around: 5 },
    Unmatched { what: "hands held in front", shows: |s| s.busy_hands, shortest: 12, around: 5 },
];

impl Unmatched {
    /// The frames that it takes.
    fn stretches(&self, signals: &[Signal]) -> Vec<std::ops::Range<usize>> {
        let flags: Vec<bool> = signals.iter().map(self.shows).collect();
        runs(&flags, true)
            .into_iter()
            .filter(|(first, end)| end - first >= self.shortest)
            .map(|(first, end)| first.saturating_sub(self.around)..(end + self.around).min(signals.len()))
            .collect()
    }
}

/// Runs, jumps, crouches, lies, bends, carries, raised hands.
fn mark_other(labels: &mut [ActionLabel], signals: &[Signal]) {
    for range in UNMATCHED.iter().flat_map(|unmatched| unmatched.stretches(signals)) {
        labels[range].fill(ActionLabel::Other);
    }
    // A scrap between two of them is part of them.
    let other: Vec<bool> = labels.iter().map(|&l| l == ActionLabel::Other).collect();
    for (first, end) in runs(&other, false) {
        if end - first < 15 && first > 0 && end < labels.len() {
            labels[first..end].fill(ActionLabel::Other);
        }
    }
}

/// What is done in the frames labelled [`ActionLabel::Other`], with how many of them, the most first. A frame in
/// which two things are done counts for the first; what only lies between them is not counted.
pub(crate) fn unmatched(motion: &Motion, segments: &[Segment]) -> Vec<(&'static str, usize)> {
    let signals = signals(motion);
    let mut open = vec![false; motion.len()];
    for segment in segments.iter().filter(|s| s.label == ActionLabel::Other) {
        open[segment.first..segment.end].fill(true);
    }
    let mut out = Vec::new();
    for unmatched in &UNMATCHED {
        let mut count = 0;
        for frame in unmatched.stretches(&signals).into_iter().flatten() {
            count += usize::from(std::mem::take(&mut open[frame]));
        }
        if count > 0 {
            out.push((unmatched.what, count));
        }
    }
    out.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    out
}

/// Finds stretches of sitting; makes the sit before each, the seated idle, and the stand-up after.
fn mark_sits(labels: &mut [ActionLabel], signals: &[Signal], segments: &mut Vec<Segment>) {
    let seated: Vec<bool> = signals
        .iter()
        .map(|s| {
            s.balance < 0.0
                && s.thigh > 0.5
                && s.lean < 0.75
                && s.speed < 0.3
                && (0.28..0.93).contains(&s.pelvis.z)
        })
        .collect();
    let mut stretches: Vec<(usize, usize)> = Vec::new();
    for (first, end) in runs(&seated, true) {
        match stretches.last_mut() {
            Some(last) if first - last.1 < 12 => last.1 = end,
            _ => stretches.push((first, end)),
        }
    }
    stretches.retain(|(first, end)| end - first >= 15);
    let count = signals.len();
    let height = |f: usize| signals[f].pelvis.z;
    let mut free_from = 0;
    for (i, &(first, end)) in stretches.iter().enumerate() {
        let mut heights: Vec<f32> = (first..end).map(height).collect();
        heights.sort_unstable_by(f32::total_cmp);
        let seat = heights[heights.len() / 2];
        let mut leans: Vec<f32> = (first..end).map(|f| signals[f].lean).collect();
        leans.sort_unstable_by(f32::total_cmp);
        let upright = leans[leans.len() / 2];
        let until = stretches.get(i + 1).map_or(count, |next| next.0);
        // Down: from standing height before to where the body has settled.
        let stand_before = (free_from.max(first.saturating_sub(75))..first).map(height).fold(0.0, f32::max);
        let mut idle_from = first;
        if stand_before > seat + 0.08 {
            // Seated is: at the seat's height, and the trunk has come up again.
            let settled = |f: usize| (height(f) - seat).abs() < 0.02 && signals[f].lean < upright + 0.12;
            let complete = (first..end).find(|&f| settled(f)).unwrap_or(first);
            let descent =
                (free_from..complete).rev().find(|&f| height(f) > stand_before - 0.04).unwrap_or(free_from);
            let begin = free_from.max(descent.saturating_sub(30));
            let sit_end = (complete + 1 + SETTLE_FRAMES).min(end);
            segments.push(Segment { label: ActionLabel::Sit, first: begin, end: sit_end, complete });
            idle_from = sit_end;
        }
        // Up: from the last frame at the seat's height to standing.
        let stand_after = (end..until.min(end + 75)).map(height).fold(0.0, f32::max);
        let mut idle_end = end;
        if stand_after > seat + 0.08 {
            let leave = (first..end).rev().find(|&f| height(f) < seat + 0.02).unwrap_or(end - 1);
            let complete = (leave..until)
                .find(|&f| height(f) > stand_after - 0.04 && signals[f].lean < 0.35)
                .unwrap_or(until - 1);
            idle_end = leave.saturating_sub(8).max(idle_from);
            let up_end = (complete + 1 + SETTLE_FRAMES).min(until);
            segments.push(Segment { label: ActionLabel::StandUp, first: idle_end, end: up_end, complete });
            free_from = up_end;
        } else {
            free_from = end;
        }
        if idle_end > idle_from {
            segments.push(Segment {
                label: ActionLabel::SeatedIdle,
                first: idle_from,
                end: idle_end,
                complete: idle_end - 1,
            });
        }
    }
    for segment in segments.iter() {
        labels[segment.first..segment.end].fill(segment.label);
    }
}

/// The last two steps before standing still, and the settling.
fn mark_stops(labels: &mut [ActionLabel], signals: &[Signal], segments: &mut Vec<Segment>) {
    let count = labels.len();
    for complete in 1..count {
        if labels[complete] != ActionLabel::Idle || labels[complete - 1] != ActionLabel::Walk {
            continue;
        }
        let walk = (0..complete).rev().find(|&f| labels[f] != ActionLabel::Walk).map_or(0, |f| f + 1);
        let idle_end = (complete..count).find(|&f| labels[f] != ActionLabel::Idle).unwrap_or(count);
        let fastest =
            (walk.max(complete.saturating_sub(60))..complete).map(|f| signals[f].speed).fold(0.0, f32::max);
        if idle_end - complete < SHORTEST_STRETCH || fastest < 0.4 {
            continue;
        }
        let mut lifts: Vec<usize> = (walk.max(1)..complete)
            .filter(|&f| (0..2).any(|side| signals[f - 1].planted[side] && !signals[f].planted[side]))
            .collect();
        lifts.dedup();
        let first = if lifts.len() >= 2 { lifts[lifts.len() - 2] } else { walk };
        let first = first.max(complete.saturating_sub(60)).max(walk);
        // A stop needs something to stop from.
        if complete - first < SHORTEST_STRETCH {
            continue;
        }
        let end = (complete + 1 + SETTLE_FRAMES).min(idle_end);
        labels[first..end].fill(ActionLabel::Stop);
        segments.push(Segment { label: ActionLabel::Stop, first, end, complete });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::starter;
    use crate::progress::Progress;
    use glam::Quat;

    #[test]
    fn sits_with_raised_arms_are_not_for_use() {
        let library = starter::generate(&Progress::new()).expect("not cancelled");
        let clip = library.clips.iter().find(|clip| clip.name == "sit 46 cm, turn 0°").expect("a sit");
        let mut motion = clip.motion.clone();
        let found = |segments: &[Segment], label: ActionLabel| segments.iter().any(|s| s.label == label);
        assert_eq!(label(&motion), label_for_use(&motion));
        assert!(found(&label(&motion), ActionLabel::Sit));
        for posture in &mut motion.postures {
            for (arm, side) in [(Joint::LeftArm, 1.0), (Joint::RightArm, -1.0)] {
                posture.rotations[arm.index()] = Quat::from_rotation_y(-side * 0.6);
            }
        }
        // What it is is seen as before; it is set aside, with the reason.
        assert!(found(&label(&motion), ActionLabel::Sit));
        let aside = label_for_use(&motion);
        assert!(!found(&aside, ActionLabel::Sit) && !found(&aside, ActionLabel::SeatedIdle));
        assert!(
            unmatched(&motion, &aside).iter().any(|(what, frames)| *what == "a raised hand" && *frames > 30)
        );
    }
}
