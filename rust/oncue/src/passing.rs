//! How a motion gets past what moves in the scene by itself: each frame against where everything stands on it.

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::figures::{BodyPart, body_capsules};
use crate::math::capsule::Capsule;
use crate::motion::{Motion, Pose};
use crate::progress::Progress;
use crate::scene::{BODY_REACH, MovingObject};

/// Depths up to here are a touch, metres.
const TOUCH: f32 = 0.03;
/// Waiting is tried in steps of so many frames: a tenth of a second.
const WAIT_STEP: usize = 3;

/// What a motion is measured by.
#[derive(Debug, Clone, Copy)]
pub struct PassingOptions {
    /// World height of the floor, metres: what is lower than a step over it touches nobody.
    pub floor: f32,
    /// Whether arms and hands are free to touch: they hold what moves.
    pub arms_may_touch: bool,
    /// Frames that the person may stand and wait at the start.
    pub most_wait: usize,
}

/// A moving object that the body runs into.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Meeting {
    /// Which.
    pub object: String,
    /// The part of the body that is deepest in it.
    pub part: BodyPart,
    /// The first frame, and the frame after the last.
    pub first: usize,
    /// The frame after the last.
    pub end: usize,
    /// On how many of them.
    pub frames: usize,
    /// How deep at most, cm.
    pub depth_cm: f32,
    /// On which frame.
    pub frame: usize,
}

/// How a motion gets past.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Passing {
    /// Frames that the person waits at the start: the fewest by which it gets past all of them; 0 where none do.
    pub wait: usize,
    /// What it runs into; empty where it gets past.
    pub meetings: Vec<Meeting>,
    /// Share of the frames in which it is in any of them, percent.
    pub percent: f32,
}

/// How a motion gets past moving objects, and how long it waits at its start to do so.
///
/// # Errors
/// `Cancelled`.
pub fn pass_moving(
    motion: &Motion,
    objects: &[MovingObject],
    options: &PassingOptions,
    progress: &Progress,
) -> Result<Passing> {
    let bodies: Vec<Body> =
        motion.postures.iter().map(|posture| Body::of(&posture.pose(), options)).collect();
    let past = |wait: usize| Passing { wait, meetings: Vec::new(), percent: 0.0 };
    let Some(first) = bodies.first() else { return Ok(past(0)) };
    let at_once = meetings(&bodies, objects);
    if at_once.is_empty() {
        return Ok(past(0));
    }
    // Later than when everything has come to rest nothing changes.
    let moves = objects.iter().map(MovingObject::frames).max().unwrap_or(0);
    for wait in (WAIT_STEP..=options.most_wait.min(moves + WAIT_STEP)).step_by(WAIT_STEP) {
        progress.check()?;
        if (wait - WAIT_STEP..wait).any(|frame| first.meets(objects, frame)) {
            break;
        }
        if !bodies.par_iter().enumerate().any(|(frame, body)| body.meets(objects, frame + wait)) {
            return Ok(past(wait));
        }
    }
    let met = bodies.par_iter().enumerate().filter(|(frame, body)| body.meets(objects, *frame)).count();
    Ok(Passing { wait: 0, meetings: at_once, percent: 100.0 * met as f32 / bodies.len() as f32 })
}

/// The body on one frame.
struct Body {
    pelvis: Vec3,
    capsules: Vec<(BodyPart, Capsule)>,
}

impl Body {
    fn of(pose: &Pose, options: &PassingOptions) -> Self {
        let counts = |part: BodyPart, capsule: &Capsule| {
            let high = capsule.ends[0].z.max(capsule.ends[1].z) + capsule.radii[0].max(capsule.radii[1]);
            high > options.floor + STEP && !(options.arms_may_touch && is_arm(part))
        };
        let capsules = body_capsules(pose).into_iter().filter(|(part, capsule)| counts(*part, capsule));
        Self { pelvis: pose.positions[0], capsules: capsules.collect() }
    }

    /// The part that is deepest in an object on a frame, and how deep, metres.
    fn depth_in(&self, object: &MovingObject, frame: usize) -> Option<(BodyPart, f32)> {
        if !object.is_near(frame, self.pelvis, BODY_REACH) {
            return None;
        }
        self.capsules
            .iter()
            .filter_map(|(part, capsule)| Some((*part, object.depth_of(capsule, frame)?)))
            .filter(|(_, depth)| *depth > TOUCH)
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn meets(&self, objects: &[MovingObject], frame: usize) -> bool {
        objects.iter().any(|object| self.depth_in(object, frame).is_some())
    }
}

/// What is lower than this over the floor is stepped over, metres.
const STEP: f32 = 0.1;

fn is_arm(part: BodyPart) -> bool {
    use BodyPart::{LeftForearm, LeftHand, LeftUpperArm, RightForearm, RightHand, RightUpperArm};
    matches!(part, LeftForearm | LeftHand | LeftUpperArm | RightForearm | RightHand | RightUpperArm)
}

/// What a body that does not wait runs into, the longest first.
fn meetings(bodies: &[Body], objects: &[MovingObject]) -> Vec<Meeting> {
    let mut found: Vec<Meeting> = objects
        .iter()
        .filter_map(|object| {
            let hits: Vec<(usize, BodyPart, f32)> = bodies
                .par_iter()
                .enumerate()
                .filter_map(|(frame, body)| body.depth_in(object, frame).map(|(part, d)| (frame, part, d)))
                .collect();
            let (first, last) = (hits.first()?.0, hits.last()?.0);
            let worst = hits.iter().max_by(|a, b| a.2.total_cmp(&b.2))?;
            Some(Meeting {
                object: object.name.clone(),
                part: worst.1,
                first,
                end: last + 1,
                frames: hits.len(),
                depth_cm: 100.0 * worst.2,
                frame: worst.0,
            })
        })
        .collect();
    found.sort_by(|a, b| b.frames.cmp(&a.frames).then_with(|| a.object.cmp(&b.object)));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Planar;
    use crate::test_world::{PACE, STANDS, close, person};
    use glam::{Quat, Vec2};

    /// Who glides from the origin along -Y, 4 cm a frame, for 3 m.
    fn walk() -> Motion {
        let at = |frame: usize| person(Planar::new(Vec2::new(0.0, -PACE * frame as f32), 0.0), STANDS, 0.0);
        Motion { postures: (0..75).map(at).collect(), contacts: vec![[1.0; 2]; 75] }
    }

    /// A door across the way at y = -2, 1.2 m wide with its hinge at x = -0.6, opened by so many degrees on each frame.
    fn door(degrees: impl Fn(usize) -> f32, frames: usize) -> MovingObject {
        let hinge = Vec3::new(-0.6, -2.0, 0.0);
        let pose = |frame: usize| {
            let turn = Quat::from_rotation_z(degrees(frame).to_radians());
            (hinge - turn * hinge, turn)
        };
        leaf(&(0..frames).map(pose).collect::<Vec<_>>())
    }

    /// The same door, moved as one likes.
    fn leaf(poses: &[(Vec3, Quat)]) -> MovingObject {
        let (lo, hi) = (Vec3::new(-0.6, -2.03, 0.0), Vec3::new(0.6, -1.97, 2.0));
        let corners: Vec<Vec3> = (0..8)
            .map(|i: usize| Vec3::select(glam::BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4), hi, lo))
            .collect();
        let quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let triangles: Vec<[u32; 3]> =
            quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        MovingObject::build("Door", &corners, &triangles, poses, &Progress::new()).expect("a door")
    }

    fn passed(object: MovingObject, most_wait: usize) -> Passing {
        let options = PassingOptions { floor: 0.0, arms_may_touch: false, most_wait };
        pass_moving(&walk(), &[object], &options, &Progress::new()).expect("not cancelled")
    }

    #[test]
    fn a_door_is_met_where_it_stands_on_that_frame() {
        // Shut for good: the body is in it as it comes through, about frame 50.
        let shut = passed(door(|_| 0.0, 1), 300);
        assert_eq!((shut.wait, shut.meetings.len()), (0, 1));
        let meeting = &shut.meetings[0];
        assert!(meeting.object == "Door" && meeting.first < 50 && meeting.end > 50, "{meeting:?}");
        assert!(meeting.first > 35 && meeting.end < 62, "{meeting:?}");
        assert!((meeting.first..meeting.end).contains(&meeting.frame), "{meeting:?}");
        // One thing alone is met on as many frames as there are frames in which any is.
        close(shut.percent, 100.0 * meeting.frames as f32 / 75.0, 1e-3);
        // Open for good, or open before the body is there.
        assert_eq!(passed(door(|_| 90.0, 1), 300), Passing { wait: 0, meetings: vec![], percent: 0.0 });
        assert_eq!(
            passed(door(|f| 6.0 * f as f32, 16), 300),
            Passing { wait: 0, meetings: vec![], percent: 0.0 }
        );
        // Open now, and shut when the body comes: there is nothing to wait for.
        let shuts = passed(door(|f| 90.0 - 6.0 * f as f32, 16), 300);
        assert_eq!((shuts.wait, shuts.meetings.len()), (0, 1));
    }

    #[test]
    fn a_door_that_opens_late_is_waited_for_no_longer_than_needed() {
        let late = |f: usize| if f < 90 { 0.0 } else { (6.0 * (f - 90) as f32).min(90.0) };
        let waited = passed(door(late, 120), 300);
        // The leaf sweeps the way up to y = -0.8, where a body that does not wait comes on frame 20: until it is open, frame 105.
        assert!(waited.meetings.is_empty() && (75..90).contains(&waited.wait), "{waited:?}");
        assert_eq!(waited.wait % WAIT_STEP, 0);
        // A little less would not do, nor is more waited than is allowed.
        let hasty = passed(door(late, 120), waited.wait - WAIT_STEP);
        assert_eq!((hasty.wait, hasty.meetings.len()), (0, 1));
    }

    #[test]
    fn who_is_run_over_while_waiting_does_not_wait() {
        // It comes towards the person, over the start, and is far behind afterwards.
        let poses: Vec<(Vec3, Quat)> =
            (0..120).map(|f| (Vec3::Y * 0.06 * f as f32, Quat::IDENTITY)).collect();
        let said = passed(leaf(&poses), 300);
        assert_eq!((said.wait, said.meetings.len()), (0, 1));
    }

    #[test]
    fn hands_hold_what_moves() {
        // A plate that touches the arms alone, beside the body.
        let beside = leaf(&[(Vec3::new(0.84, 0.0, 0.0), Quat::IDENTITY)]);
        let with = |arms_may_touch: bool| {
            let options = PassingOptions { floor: 0.0, arms_may_touch, most_wait: 0 };
            pass_moving(&walk(), std::slice::from_ref(&beside), &options, &Progress::new())
                .expect("not cancelled")
        };
        let meetings = with(false).meetings;
        assert!(meetings.len() == 1 && is_arm(meetings[0].part), "{meetings:?}");
        assert_eq!(with(true).meetings, []);
    }

    #[test]
    fn poses_that_are_none_are_refused_by_name() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let built = |poses: &[(Vec3, Quat)]| {
            MovingObject::build("Fan", &corners, &[[0, 1, 2]], poses, &Progress::new())
        };
        assert!(built(&[(Vec3::ZERO, Quat::IDENTITY)]).is_ok());
        for poses in [
            vec![],
            vec![(Vec3::NAN, Quat::IDENTITY)],
            vec![(Vec3::ZERO, Quat::from_xyzw(0.0, 0.0, 0.0, 2.0))],
        ] {
            assert!(built(&poses).expect_err("refused").to_string().contains("‘Fan’"));
        }
    }
}
