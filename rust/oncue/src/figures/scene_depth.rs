//! The whole body in the scene: how deep, where and with which part.

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::spans::Spans;
use super::{Surroundings, percent};
use crate::anatomy::{BodyPart, DEEP, body_capsules};
use crate::motion::Pose;

/// Depths from here on are no touch any more, metres.
const VERY_DEEP: f32 = 0.03;

/// How deep the body is in the scene's surfaces.
///
/// A part is as deep as its surface is behind the scene's. What lies wholly inside a solid and reaches no surface is not seen.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneDepthFigures {
    /// Share of the frames in which a part is deeper than 1 cm, percent.
    pub over_1_cm_percent: f32,
    /// Share of the frames in which a part is deeper than 3 cm, percent.
    pub over_3_cm_percent: f32,
    /// The deepest, cm; 0 where nothing touches.
    pub deepest_cm: f32,
    /// What is deeper than 1 cm, from frame to frame, the deepest first.
    pub touches: Vec<SceneTouch>,
}

/// A part of the body in the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneTouch {
    /// Which.
    pub part: BodyPart,
    /// The first frame.
    pub first: usize,
    /// The frame after the last.
    pub end: usize,
    /// How deep at most, cm.
    pub depth_cm: f32,
    /// The frame in which it is deepest.
    pub frame: usize,
    /// Where the scene's surface is there, world, metres.
    pub place: [f32; 3],
}

/// What has been counted so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    frames: usize,
    deep: usize,
    very_deep: usize,
    deepest: f32,
    spans: Spans<BodyPart, Vec3>,
}

impl Tally {
    pub(super) fn add(&mut self, poses: &[Pose], floor: f32, surroundings: &Surroundings) {
        let all: Vec<Vec<(BodyPart, f32, Vec3)>> = poses
            .par_iter()
            .enumerate()
            .map(|(frame, pose)| in_scene(pose, frame, floor, surroundings))
            .collect();
        for (frame, touches) in all.into_iter().enumerate() {
            let mut deepest = 0f32;
            for (part, depth, place) in touches {
                deepest = deepest.max(depth);
                if depth > DEEP {
                    self.spans.add(frame, part, depth, place);
                }
            }
            self.deepest = self.deepest.max(deepest);
            self.deep += usize::from(deepest > DEEP);
            self.very_deep += usize::from(deepest > VERY_DEEP);
        }
        self.frames += poses.len();
    }

    pub(super) fn finish(self) -> SceneDepthFigures {
        let touches = self.spans.worst_first().into_iter().map(|span| SceneTouch {
            part: span.key,
            first: span.first,
            end: span.end,
            depth_cm: 100.0 * span.worst,
            frame: span.worst_frame,
            place: span.with.to_array(),
        });
        SceneDepthFigures {
            over_1_cm_percent: percent(self.deep, self.frames),
            over_3_cm_percent: percent(self.very_deep, self.frames),
            deepest_cm: 100.0 * self.deepest,
            touches: touches.collect(),
        }
    }
}

/// How deep the deepest part is in the scene, metres, where whoever sits has sat down.
pub(crate) fn depth_in_scene(pose: &Pose, floor: f32, surroundings: &Surroundings) -> f32 {
    let touches = in_scene(pose, usize::MAX, floor, surroundings);
    touches.into_iter().map(|(_, depth, _)| depth).fold(0.0, f32::max)
}

/// The parts that are in the scene in a frame, how deep, and where the surface is.
pub(crate) fn in_scene(
    pose: &Pose,
    frame: usize,
    floor: f32,
    surroundings: &Surroundings,
) -> Vec<(BodyPart, f32, Vec3)> {
    body_capsules(pose)
        .into_iter()
        .filter_map(|(part, capsule)| {
            let above = surroundings.counted_from(part, frame, floor);
            let moving = surroundings.moving.iter().filter(|object| !object.is_held_by(part, frame));
            let in_them = moving.flat_map(|object| object.contacts_of(&capsule, frame, above));
            let contacts = surroundings.scene.depth_of(&capsule, above).into_iter().chain(in_them);
            let deepest = contacts.max_by(|a, b| a.depth.total_cmp(&b.depth))?;
            Some((part, deepest.depth, deepest.place))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Posture;
    use crate::progress::Progress;
    use crate::scene::{SceneIndex, SceneSettings};
    use crate::seats::Seats;

    /// A floor, and a wall across it at `y`.
    fn wall(y: f32) -> SceneIndex {
        let corners = [
            [-2.0, -2.0, 0.0],
            [2.0, -2.0, 0.0],
            [2.0, 2.0, 0.0],
            [-2.0, 2.0, 0.0],
            [-2.0, y, 0.0],
            [2.0, y, 0.0],
            [2.0, y, 2.0],
            [-2.0, y, 2.0],
        ];
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        SceneIndex::build(&corners.map(Vec3::from), &triangles, &SceneSettings::default(), &Progress::new())
            .expect("a room")
    }

    fn figures(y: f32, seats: Seats) -> SceneDepthFigures {
        let scene = wall(y);
        let mut tally = Tally::default();
        let poses = [Posture::default().pose(); 2];
        tally.add(&poses, 0.0, &Surroundings { scene: &scene, moving: &[], ignore_below: 0.1, seats });
        tally.finish()
    }

    #[test]
    fn a_wall_behind_the_back_by_hand() {
        // The pelvis reaches back to 0.013 + 0.115 = 12.8 cm, farther than the trunk and the legs.
        let free = figures(0.13, Seats::default());
        assert_eq!(free, SceneDepthFigures::default());
        let deep = figures(0.112, Seats::default());
        assert!((deep.deepest_cm - 1.6).abs() < 0.01, "{deep:?}");
        assert_eq!((deep.over_1_cm_percent, deep.over_3_cm_percent), (100.0, 0.0));
        let worst = &deep.touches[0];
        assert_eq!((worst.part, worst.first, worst.end), (BodyPart::Pelvis, 0, 2));
        assert!((worst.place[1] - 0.112).abs() < 1e-5 && worst.place[2] > 0.9);
        // A seat as high as the pelvis carries it, from the second frame on.
        let seated = figures(0.112, Seats::taken(1, 1.1));
        assert_eq!((seated.over_1_cm_percent, seated.touches[0].end), (50.0, 1));
    }

    #[test]
    fn a_forearm_through_a_wall_by_hand() {
        // Turned by a right angle the left arm points at the wall: the elbow is 45.8 cm from the middle, the wrist 73.6. With
        // the wall at 60 the wrist's end is the shorter, 13.6 cm, and the forearm is as thick there as its axis is along.
        let mut posture = Posture::default();
        posture.rotations[0] = glam::Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let scene = wall(0.60);
        let surroundings =
            Surroundings { scene: &scene, moving: &[], ignore_below: 0.1, seats: Seats::default() };
        let found = in_scene(&posture.pose(), 0, 0.0, &surroundings);
        let radius = 0.039 - 0.011 * (0.60 - 0.458) / 0.278;
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(
            found[0].0 == BodyPart::LeftForearm && (found[0].1 - (0.136 + radius)).abs() < 1e-3,
            "{found:?}"
        );
    }

    #[test]
    fn a_foot_in_a_plinth_is_told_and_one_on_a_rug_is_not() {
        use crate::test_world::{room, stop_cue};
        let pose = Posture::default().pose();
        let depth = |height: f32| {
            let scene = room(&[([-0.5, -0.5, 0.0], [0.5, 0.5, height])]);
            let cue = stop_cue(glam::Vec2::ZERO, 0.0);
            depth_in_scene(&pose, 0.0, &Surroundings::at_end(&scene, &cue))
        };
        // The ankle's end of the foot is 2 cm under the top of it.
        assert!(depth(0.07) > 0.015, "{}", depth(0.07));
        assert_eq!(depth(0.03), 0.0);
    }
}
