//! Leaves that hands open: how they hang, what can be said of them before anything is played, and the scene with them as they stand by then.

use glam::{Quat, Vec3};

use super::things::Placement;
use crate::cue::{Amount, Hung, Leaf, OpenCue, Performance, Step};
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
/// A hand leads what it opens no faster, metres a second; with the least jerk the fastest is so many times the mean.
const FASTEST: f32 = 2.5;
const PEAK: f32 = 1.875;
/// Who stands before a leaf takes up so much room, metres, from over the floor to so high; who sits, about the trunk alone.
const GIRTH: f32 = 0.15;
const STANDS: (f32, f32) = (0.35, 1.45);
const SITS: (f32, f32) = (0.10, 0.50);
/// A leaf is looked at on so many places of its way.
const LOOKS: usize = 24;
/// A hinge that is steeper than this is upright: its cosine.
const UPRIGHT: f32 = 0.7;

impl Leaf {
    /// Where it is once it is open so far, degrees or metres.
    pub(super) fn at(&self, opened: f32) -> Placement {
        let [w, x, y, z] = self.rotation;
        let rest = Placement { position: self.position, rotation: Quat::from_xyzw(x, y, z, w).normalize() };
        let (place, turn) = match self.hung {
            Hung::Hinge { point, axis } => {
                let turn = Quat::from_axis_angle(axis.normalize(), opened.to_radians());
                (point - turn * point, turn)
            }
            Hung::Slide { direction } => (direction.normalize() * opened, Quat::IDENTITY),
        };
        Placement { position: rest.point(place), rotation: rest.rotation * turn }
    }

    /// How far a point of its own goes while it is opened by `amount`, metres.
    pub(super) fn way(&self, own: Vec3, amount: f32) -> f32 {
        match self.hung {
            Hung::Hinge { .. } => self.lever(own) * amount.to_radians().abs(),
            Hung::Slide { .. } => amount.abs(),
        }
    }

    /// How far a point of its own is from its hinge, metres.
    fn lever(&self, own: Vec3) -> f32 {
        match self.hung {
            Hung::Hinge { point, axis } => (own - point).reject_from(axis.normalize()).length(),
            Hung::Slide { .. } => f32::INFINITY,
        }
    }

    /// Whether it goes on by itself once it is let go: a door does, a lid falls, a drawer stops.
    pub(super) fn swings_on(&self) -> bool {
        let rest = self.at(0.0).rotation;
        matches!(self.hung, Hung::Hinge { axis, .. } if (rest * axis.normalize()).z.abs() > UPRIGHT)
    }

    /// An amount of opening in words.
    pub(super) fn in_words(&self, amount: f32) -> String {
        match self.hung {
            Hung::Hinge { .. } => format!("{amount:.0}°"),
            Hung::Slide { .. } => format!("{:.0} cm", 100.0 * amount),
        }
    }

    /// `said`: who opens it by what, for messages.
    fn check(&self, said: &str) -> Result<()> {
        let hung = match self.hung {
            Hung::Hinge { point, axis } => [point, axis],
            Hung::Slide { direction } => [Vec3::ZERO, direction],
        };
        let turn = self.rotation.iter().map(|part| part * part).sum::<f32>();
        if !self.position.is_finite() || !hung[0].is_finite() || (turn - 1.0).abs() > 1e-2 {
            return Err(Error::input(format!(
                "{said}, which stands or hangs at a place that is not a number, or has a rotation that is no unit quaternion."
            )));
        }
        if !hung[1].is_finite() || hung[1].length() < 1e-6 {
            return Err(Error::input(format!(
                "{said}, and which way that opens is unknown: its hinge, or slide, has no direction; give it one."
            )));
        }
        Ok(())
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
        let poses: Vec<(Vec3, Quat)> =
            opened.map(|so_far| self.at(so_far)).map(|at| (at.position, at.rotation)).collect();
        let built = MovingObject::build(&self.name, &self.positions, &self.triangles, &poses, progress);
        built.map_err(|error| match error {
            Error::Input(said) => Error::Input(format!("‘{}’ cannot be opened: {said}", self.name)),
            other => other,
        })
    }
}

/// How far each leaf is open when each of the steps begins, and after all of them.
pub(super) fn openings(performance: &Performance) -> Vec<Vec<f32>> {
    let mut now = vec![0.0f32; performance.leaves.len()];
    let mut all = vec![now.clone()];
    for step in &performance.steps {
        for open in step.openings() {
            let which = performance.leaves.iter().position(|leaf| leaf.name == open.thing);
            which.into_iter().for_each(|which| now[which] += open.by.number());
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
    pub(crate) fn of(base: &'a SceneIndex, performance: &Performance, progress: &Progress) -> Result<Self> {
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
                leaf.check(&format!("There is ‘{}’", leaf.name))?;
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
    let person = &performance.start.name;
    for (step, now) in performance.steps.iter().zip(openings(performance)) {
        let mut now = now;
        for open in step.openings() {
            let name = &open.name;
            let Some(which) = performance.leaves.iter().position(|leaf| leaf.name == open.thing) else {
                return Err(Error::input(format!(
                    "‘{name}’ is about ‘{}’, which is nothing that ‘{person}’ can open.",
                    open.thing
                )));
            };
            let leaf = &performance.leaves[which];
            if performance.things.iter().any(|thing| thing.name == leaf.name) {
                return Err(Error::input(format!(
                    "‘{name}’ has ‘{person}’ open ‘{}’, which is taken as well; what hangs somewhere is not carried away.",
                    leaf.name
                )));
            }
            leaf.check(&format!("‘{name}’ has ‘{person}’ open ‘{}’", leaf.name))?;
            check_open(leaf, open, person)?;
            check_stand(leaf, open, now[which], step, performance)?;
            now[which] += open.by.number();
        }
    }
    Ok(())
}

fn check_open(leaf: &Leaf, open: &OpenCue, person: &str) -> Result<()> {
    let OpenCue { name, by, grip, over_seconds, .. } = open;
    let (amount, thing) = (by.number(), &leaf.name);
    let (most, least) = match (leaf.hung, by) {
        (Hung::Hinge { .. }, Amount::Degrees(_)) => (FARTHEST.0, LEAST.0),
        (Hung::Slide { .. }, Amount::Metres(_)) => (FARTHEST.1, LEAST.1),
        (Hung::Hinge { .. }, Amount::Metres(_)) => {
            return Err(Error::input(format!(
                "‘{name}’ has ‘{person}’ open ‘{thing}’ by metres, and it hangs on a hinge; give degrees."
            )));
        }
        (Hung::Slide { .. }, Amount::Degrees(_)) => {
            return Err(Error::input(format!(
                "‘{name}’ has ‘{person}’ open ‘{thing}’ by degrees, and it slides; give metres."
            )));
        }
    };
    if !(least..=most).contains(&amount.abs()) {
        return Err(Error::input(format!(
            "‘{name}’ has ‘{person}’ open ‘{thing}’ by {}; give {} to {}, or the same backwards.",
            leaf.in_words(amount),
            leaf.in_words(least),
            leaf.in_words(most)
        )));
    }
    if !grip.is_finite() {
        return Err(Error::input(format!(
            "‘{name}’ has ‘{person}’ take hold of ‘{thing}’ at a place that is not a number."
        )));
    }
    if leaf.lever(*grip) < LEVER {
        return Err(Error::input(format!(
            "‘{name}’ has ‘{person}’ take hold of ‘{thing}’ on its hinge, where nobody can turn it; move the cue to the handle."
        )));
    }
    let Some(seconds) = over_seconds else { return Ok(()) };
    let least = (PEAK * leaf.way(*grip, amount) / FASTEST).max(SECONDS.0);
    if !(least..=SECONDS.1).contains(seconds) {
        return Err(Error::input(format!(
            "‘{name}’ has ‘{person}’ open ‘{thing}’ in {seconds:.1} s; give {least:.1} to {:.0} s.",
            SECONDS.1
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
    let far = leaf.at(opened).point(open.grip).distance(pelvis);
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
    let way = (0..=LOOKS).map(|look| opened + open.by.number() * look as f32 / LOOKS as f32);
    let swept = leaf.opened(way, &Progress::new())?;
    if (0..=LOOKS).any(|look| swept.depth_of(&body, look).is_some()) {
        return Err(Error::Unreachable(format!(
            "‘{person}’ would stand in the way of ‘{}’, which ‘{}’ opens: move ‘{}’ out of where it goes.",
            leaf.name, open.name, cue.name
        )));
    }
    Ok(())
}
