//! Leaves that hands open: how they hang, what can be said of them before anything is played, and the scene with them as they stand by then.

use glam::{Quat, Vec3};

use crate::cue::{Hung, Leaf, OpenCue, Performance, Step};
use crate::editor::manipulation::FARTHEST_PALM;
use crate::error::{Error, Result};
use crate::math::capsule::Capsule;
use crate::motion::skeleton::STANDING_HIPS_HEIGHT;
use crate::progress::Progress;
use crate::scene::{MovingObject, SceneIndex};

/// No leaf is opened farther by one cue, degrees and metres.
const FARTHEST: (f32, f32) = (180.0, 2.0);
/// Nor less far.
const LEAST: (f32, f32) = (1.0, 0.01);
/// A handle nearer to its hinge than this turns nothing, metres.
const LEVER: f32 = 0.04;
/// What one cue opens moves for so long, seconds.
const SECONDS: (f32, f32) = (0.3, 60.0);
/// A hand leads what it opens no faster, metres a second.
const FASTEST: f32 = 2.5;
/// Who stands before a leaf takes up so much room, metres, from over the floor to so high; who sits, about the trunk alone.
const GIRTH: f32 = 0.15;
const STANDS: (f32, f32) = (0.35, 1.45);
const SITS: (f32, f32) = (0.10, 0.50);
/// A leaf is looked at on so many places of its way.
const LOOKS: usize = 24;
/// A hinge that is steeper than this is upright: its cosine.
const UPRIGHT: f32 = 0.7;

impl Leaf {
    /// What takes it from where it stands at first to where it is once it is open so far, degrees or metres: x ↦ turn · x + place.
    pub(super) fn pose(&self, opened: f32) -> (Vec3, Quat) {
        match self.hung {
            Hung::Hinge { point, axis } => {
                let turn = Quat::from_axis_angle(axis.normalize(), opened.to_radians());
                (point - turn * point, turn)
            }
            Hung::Slide { direction } => (direction.normalize() * opened, Quat::IDENTITY),
        }
    }

    /// A point of it once it is open so far; `at`: as it stands at first, world, metres.
    pub(super) fn point(&self, at: Vec3, opened: f32) -> Vec3 {
        let (place, turn) = self.pose(opened);
        turn * at + place
    }

    /// How far a point of it goes while it is opened by `amount`, metres.
    pub(super) fn way(&self, at: Vec3, amount: f32) -> f32 {
        match self.hung {
            Hung::Hinge { point, axis } => {
                (at - point).reject_from(axis.normalize()).length() * amount.to_radians().abs()
            }
            Hung::Slide { .. } => amount.abs(),
        }
    }

    /// Whether it goes on by itself once it is let go: a door does, a lid falls, a drawer stops.
    pub(super) fn swings_on(&self) -> bool {
        matches!(self.hung, Hung::Hinge { axis, .. } if axis.normalize().z.abs() > UPRIGHT)
    }

    /// An amount of opening in words.
    pub(super) fn in_words(&self, amount: f32) -> String {
        match self.hung {
            Hung::Hinge { .. } => format!("{amount:.0}°"),
            Hung::Slide { .. } => format!("{:.0} cm", 100.0 * amount),
        }
    }

    fn check(&self) -> Result<()> {
        let name = &self.name;
        let hung = match self.hung {
            Hung::Hinge { point, axis } => [point, axis],
            Hung::Slide { direction } => [Vec3::ZERO, direction],
        };
        let turn = self.rotation.iter().map(|part| part * part).sum::<f32>();
        if !self.position.is_finite() || !hung[0].is_finite() || (turn - 1.0).abs() > 1e-2 {
            return Err(Error::input(format!(
                "‘{name}’ stands or hangs at a place that is not a number, or has a rotation that is no unit quaternion."
            )));
        }
        if !hung[1].is_finite() || hung[1].length() < 1e-6 {
            return Err(Error::input(format!(
                "Which way ‘{name}’ opens is unknown: its hinge, or slide, has no direction. Give it one."
            )));
        }
        Ok(())
    }

    /// The mesh on its poses.
    fn object(&self, poses: &[(Vec3, Quat)], progress: &Progress) -> Result<MovingObject> {
        MovingObject::build(&self.name, &self.positions, &self.triangles, poses, progress).map_err(|error| {
            match error {
                Error::Input(said) => Error::Input(format!("‘{}’ cannot be opened: {said}", self.name)),
                other => other,
            }
        })
    }

    /// It, open so far on each frame, degrees or metres.
    ///
    /// # Errors
    /// `Input` for a mesh that is none; `Cancelled`.
    pub(super) fn opened(
        &self,
        opened: impl Iterator<Item = f32>,
        progress: &Progress,
    ) -> Result<MovingObject> {
        self.object(&opened.map(|so_far| self.pose(so_far)).collect::<Vec<_>>(), progress)
    }
}

/// How far each leaf is open when each of the steps begins, and after all of them.
fn openings(performance: &Performance) -> Vec<Vec<f32>> {
    let mut now = vec![0.0f32; performance.leaves.len()];
    let mut all = vec![now.clone()];
    for step in &performance.steps {
        for open in step.openings() {
            let which = performance.leaves.iter().position(|leaf| leaf.name == open.leaf);
            which.into_iter().for_each(|which| now[which] += open.amount);
        }
        all.push(now.clone());
    }
    all
}

/// The scene with each leaf as it stands when a step begins.
pub(crate) struct Phases<'a> {
    base: &'a SceneIndex,
    scenes: Vec<SceneIndex>,
    /// Which of them, of each step and after all; none: as it is without leaves.
    of_step: Vec<Option<usize>>,
}

impl<'a> Phases<'a> {
    /// # Errors
    /// `Input` for a leaf whose mesh is none; `Cancelled`.
    pub(crate) fn of(
        base: &'a SceneIndex,
        performance: &Performance,
        progress: &Progress,
    ) -> Result<Self> {
        let mut phases = Self { base, scenes: Vec::new(), of_step: vec![None; performance.steps.len() + 1] };
        if performance.leaves.is_empty() {
            return Ok(phases);
        }
        let mut known: Vec<Vec<f32>> = Vec::new();
        for (step, now) in openings(performance).into_iter().enumerate() {
            let at = known.iter().position(|one| *one == now);
            phases.of_step[step] = Some(at.unwrap_or(known.len()));
            if at.is_some() {
                continue;
            }
            let mut solids = Vec::new();
            for (leaf, so_far) in performance.leaves.iter().zip(&now) {
                leaf.check()?;
                solids.extend(leaf.opened([*so_far].into_iter(), progress)?.triangles_on(0));
            }
            phases.scenes.push(base.with(&solids, progress)?);
            known.push(now);
        }
        Ok(phases)
    }

    /// The scene without leaves.
    pub(crate) fn without(&self) -> &'a SceneIndex {
        self.base
    }

    /// The scene in which a step is played; after all of them for how many there are.
    pub(crate) fn before(&self, step: usize) -> &SceneIndex {
        self.of_step.get(step).copied().flatten().map_or(self.base, |at| &self.scenes[at])
    }

    /// Whether there are any leaves.
    pub(crate) fn differ(&self) -> bool {
        !self.scenes.is_empty()
    }
}

/// What can be known of what is opened before anything is played, but for whether the hand is free.
///
/// # Errors
/// `Input` or `Unreachable`, naming the cue and the person; `Cancelled`.
pub(crate) fn check_openings(performance: &Performance) -> Result<()> {
    performance.leaves.iter().try_for_each(Leaf::check)?;
    let person = &performance.start.name;
    for (step, now) in performance.steps.iter().zip(openings(performance)) {
        let mut now = now;
        for open in step.openings() {
            let name = &open.name;
            let Some(which) = performance.leaves.iter().position(|leaf| leaf.name == open.leaf) else {
                return Err(Error::input(format!(
                    "‘{name}’ is about ‘{}’, which is nothing that ‘{person}’ can open.",
                    open.leaf
                )));
            };
            let leaf = &performance.leaves[which];
            if performance.things.iter().any(|thing| thing.name == leaf.name) {
                return Err(Error::input(format!(
                    "‘{name}’ has ‘{person}’ open ‘{}’, which is taken as well; what hangs somewhere is not carried away.",
                    leaf.name
                )));
            }
            check_open(leaf, open, person)?;
            check_stand(leaf, open, now[which], step, performance)?;
            now[which] += open.amount;
        }
    }
    Ok(())
}

fn check_open(leaf: &Leaf, open: &OpenCue, person: &str) -> Result<()> {
    let OpenCue { name, amount, handle, seconds, .. } = open;
    let (most, least) = match leaf.hung {
        Hung::Hinge { .. } => (FARTHEST.0, LEAST.0),
        Hung::Slide { .. } => (FARTHEST.1, LEAST.1),
    };
    if !(least..=most).contains(&amount.abs()) {
        return Err(Error::input(format!(
            "‘{name}’ has ‘{person}’ open ‘{}’ by {}; give {} to {}, or the same backwards.",
            leaf.name,
            leaf.in_words(*amount),
            leaf.in_words(least),
            leaf.in_words(most)
        )));
    }
    if !handle.is_finite() {
        return Err(Error::input(format!(
            "‘{name}’ has ‘{person}’ take hold of ‘{}’ at a place that is not a number.",
            leaf.name
        )));
    }
    if let Hung::Hinge { point, axis } = leaf.hung {
        let lever = (*handle - point).reject_from(axis.normalize()).length();
        if lever < LEVER {
            return Err(Error::input(format!(
                "‘{name}’ has ‘{person}’ take hold of ‘{}’ on its hinge, where nobody can turn it; move the cue to the handle.",
                leaf.name
            )));
        }
    }
    let Some(seconds) = seconds else { return Ok(()) };
    let fastest = 1.875 * leaf.way(*handle, *amount) / seconds;
    if !(SECONDS.0..=SECONDS.1).contains(seconds) || fastest > FASTEST {
        let least = (1.875 * leaf.way(*handle, *amount) / FASTEST).max(SECONDS.0);
        return Err(Error::input(format!(
            "‘{name}’ has ‘{person}’ open ‘{}’ in {seconds:.1} s; give {least:.1} to {:.0} s.",
            leaf.name, SECONDS.1
        )));
    }
    Ok(())
}

/// Refuses a cue at which the handle is out of reach, or the leaf would go through who stands or sits there.
fn check_stand(
    leaf: &Leaf,
    open: &OpenCue,
    opened: f32,
    step: &Step,
    performance: &Performance,
) -> Result<()> {
    let (person, cue) = (&performance.start.name, &step.cue);
    let floor = performance.start.position.z;
    let pelvis = cue.position.with_z(cue.pelvis_height().unwrap_or(floor + STANDING_HIPS_HEIGHT));
    let far = leaf.point(open.handle, opened).distance(pelvis);
    if far > FARTHEST_PALM {
        return Err(Error::Unreachable(format!(
            "‘{}’ has ‘{person}’ open ‘{}’, whose handle lies {far:.2} m from where ‘{}’ puts the pelvis, {:.2} m farther than a hand \
             gets; move ‘{}’ nearer.",
            open.name,
            leaf.name,
            cue.name,
            far - FARTHEST_PALM,
            cue.name
        )));
    }
    let (foot, (low, high)) =
        if cue.is_seated() { (pelvis, SITS) } else { (cue.position.with_z(floor), STANDS) };
    let body = Capsule { ends: [foot + Vec3::Z * low, foot + Vec3::Z * high], radii: [GIRTH; 2] };
    let way = (0..=LOOKS).map(|look| opened + open.amount * look as f32 / LOOKS as f32);
    let swept = leaf.opened(way, &Progress::new())?;
    if (0..=LOOKS).any(|look| swept.depth_of(&body, look).is_some()) {
        return Err(Error::Unreachable(format!(
            "‘{person}’ would stand in the way of ‘{}’, which ‘{}’ opens: move ‘{}’ out of where it goes.",
            leaf.name, open.name, cue.name
        )));
    }
    Ok(())
}
