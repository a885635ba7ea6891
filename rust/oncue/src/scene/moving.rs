//! What moves in the scene by itself: a mesh, and where it stands on each frame.

use std::ops::Range;

use glam::{Quat, Vec3};

use super::SceneContact;
use super::box_edges::OrientedBox;
use super::mesh;
use super::triangle_tree::{Scratch, TriangleTree};
use crate::anatomy::BodyPart;
use crate::cue::{Hand, is_carried};
use crate::error::{Error, Result};
use crate::math::capsule::Capsule;
use crate::motion::{BODY_BOXES, Joint, Pose};
use crate::progress::Progress;

/// A body reaches no farther from its pelvis, metres.
pub const BODY_REACH: f32 = 1.3;

/// A rigid mesh that moves, and its poses at 30 Hz; after the last it stands still.
#[derive(Debug)]
pub struct MovingObject {
    /// Its name, for messages.
    pub name: String,
    tree: TriangleTree,
    /// Middle and radius of a ball about it, as it was read, metres.
    ball: (Vec3, f32),
    poses: Vec<(Vec3, Quat)>,
    /// Hands that have it, and on which frames: it is not in their way.
    held: Vec<(Hand, Range<usize>)>,
}

impl MovingObject {
    /// A mesh (world, metres) and for each frame what takes it from where it was read to where it stands then: x ↦ turn · x +
    /// place.
    ///
    /// Errors: `Input` for a mesh that cannot be used and for poses that are none, naming the object; `Cancelled`.
    pub fn build(
        name: &str,
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        poses: &[(Vec3, Quat)],
        progress: &Progress,
    ) -> Result<Self> {
        let unit = |turn: Quat| (turn.length() - 1.0).abs() < 1e-2;
        if poses.is_empty() || !poses.iter().all(|(place, turn)| place.is_finite() && unit(*turn)) {
            return Err(Error::input(format!(
                "‘{name}’ moves to a place that is not a number; look at its keys, drivers and constraints."
            )));
        }
        let corners = mesh::corners(positions, triangles, progress)?;
        let first = corners[0][0];
        let (lo, hi) = corners.iter().flatten().fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        let poses = poses.iter().map(|&(place, turn)| (place, turn.normalize())).collect();
        let ball = (0.5 * (lo + hi), 0.5 * lo.distance(hi));
        Ok(Self {
            name: name.to_owned(),
            tree: TriangleTree::build(&corners, progress)?,
            ball,
            poses,
            held: Vec::new(),
        })
    }

    /// The same in hands that have it on these frames.
    pub(crate) fn held_by(self, held: Vec<(Hand, Range<usize>)>) -> Self {
        Self { held, ..self }
    }

    /// Whether a part of the body is a hand that has it on a frame.
    pub(crate) fn is_held_by(&self, part: BodyPart, frame: usize) -> bool {
        match part {
            BodyPart::LeftHand => is_carried(&self.held, Hand::Left, frame),
            BodyPart::RightHand => is_carried(&self.held, Hand::Right, frame),
            _ => false,
        }
    }

    /// Its triangles as they stand on a frame, world, metres.
    pub(crate) fn triangles_on(&self, frame: usize) -> Vec<[Vec3; 3]> {
        let (at, turn) = self.pose(frame);
        self.tree.triangles().into_iter().map(|corners| corners.map(|corner| turn * corner + at)).collect()
    }

    /// Frames until it stands still.
    pub fn frames(&self) -> usize {
        self.poses.len()
    }

    /// Whether it may come nearer to `place` than `reach` on a frame, metres.
    pub fn is_near(&self, frame: usize, place: Vec3, reach: f32) -> bool {
        let (at, turn) = self.pose(frame);
        (turn * self.ball.0 + at).distance(place) <= self.ball.1 + reach
    }

    /// As [`super::SceneIndex::depth_of`] of what stands there on a frame: how deep a capsule (world) is in its surface, metres.
    pub fn depth_of(&self, capsule: &Capsule, frame: usize) -> Option<f32> {
        let (at, turn) = self.pose(frame);
        let back = turn.conjugate();
        let there = Capsule { ends: capsule.ends.map(|end| back * (end - at)), radii: capsule.radii };
        self.tree.depth_of(&there, f32::NEG_INFINITY).map(|contact| contact.depth)
    }

    /// As [`super::SceneIndex::contacts_of`] of what stands there on a frame; where that is lower than `above` (world z) it is not counted.
    pub(crate) fn contacts_of(&self, capsule: &Capsule, frame: usize, above: f32) -> Vec<SceneContact> {
        let (at, turn) = self.pose(frame);
        let [a, b] = capsule.ends;
        let reach = 0.5 * a.distance(b) + capsule.radii[0].max(capsule.radii[1]);
        if !self.is_near(frame, 0.5 * (a + b), reach) {
            return Vec::new();
        }
        let back = turn.conjugate();
        let there = Capsule { ends: capsule.ends.map(|end| back * (end - at)), radii: capsule.radii };
        let mut contacts = self.tree.contacts_of(&there, f32::NEG_INFINITY);
        for contact in &mut contacts {
            (contact.place, contact.direction) = (turn * contact.place + at, turn * contact.direction);
        }
        contacts.retain(|contact| contact.place.z >= above);
        contacts
    }

    /// As [`super::SceneIndex::body_intersections`] of what stands there on a frame; parts whose middle is lower than `above` (world
    /// z) are not counted.
    pub fn body_intersections(&self, pose: &Pose, frame: usize, above: f32) -> [u32; BODY_BOXES.len()] {
        let mut counts = [0; BODY_BOXES.len()];
        if !self.is_near(frame, pose.positions[0], BODY_REACH) {
            return counts;
        }
        let (at, turn) = self.pose(frame);
        let back = turn.conjugate();
        let mut scratch = Scratch::default();
        for (node, count) in BODY_BOXES.iter().zip(&mut counts) {
            let (place, rotation) = (pose.positions[node.joint.index()], pose.rotations[node.joint.index()]);
            let held = match node.joint {
                Joint::LeftHand => is_carried(&self.held, Hand::Left, frame),
                Joint::RightHand => is_carried(&self.held, Hand::Right, frame),
                _ => false,
            };
            if !held && (place + rotation * node.center).z >= above {
                let there = OrientedBox::of_node(node, back * (place - at), back * rotation);
                *count = self.tree.count(&there, f32::NEG_INFINITY, &mut scratch);
            }
        }
        counts
    }

    fn pose(&self, frame: usize) -> (Vec3, Quat) {
        self.poses[frame.min(self.poses.len() - 1)]
    }
}
