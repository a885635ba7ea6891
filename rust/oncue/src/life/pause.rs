//! Who stays a while before a motion begins: at rest where it begins, alive, and again as it begins when it does.

use glam::Quat;

use super::{Hold, enliven};
use crate::error::Result;
use crate::figures::Surroundings;
use crate::motion::{Motion, Posture};
use crate::progress::Progress;

/// What still moves as the rest begins, and what moves already as it ends, does so for so many frames.
const EASES: usize = 15;

/// How someone stays.
pub(crate) struct Pause<'a> {
    /// For so many frames.
    pub frames: usize,
    /// The posture one frame before, where the motion goes on from another.
    pub before: Option<Posture>,
    /// How much moves, 1 as usual, 0 nothing.
    pub size: f32,
    pub seed: u64,
    /// World height of the floor, metres.
    pub floor: f32,
    pub around: Surroundings<'a>,
}

/// What is to be put in front of a motion so that it begins so much later: the first frame is the motion's own, and the frame after the
/// last would be it again, moving as it does there.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn pause(motion: &Motion, pause: &Pause, progress: &Progress) -> Result<Motion> {
    let first = motion.postures[0];
    let still = Way::default();
    let leaves = motion.postures.get(1).map_or(still, |next| Way::between(&first, next));
    let enters = pause.before.map_or(still, |before| Way::between(&before, &first));
    let frames = pause.frames;
    let eases = EASES.min(frames / 2).max(1);
    let posture = |frame: usize| {
        // Hermite's: as fast as at the end, and nowhere else, from and to the same place.
        let (since, until) = (frame as f32 / eases as f32, (frames - frame) as f32 / eases as f32);
        let share = |t: f32| if t < 1.0 { eases as f32 * t * (1.0 - t) * (1.0 - t) } else { 0.0 };
        leaves.gone(&enters.gone(&first, share(since)), -share(until))
    };
    let mut rest =
        Motion { postures: (0..frames).map(posture).collect(), contacts: vec![motion.contacts[0]; frames] };
    let hold = Hold {
        from: 0,
        frames,
        size: pause.size,
        seed: pause.seed,
        floor: pause.floor,
        feet_free: [false; 2],
        carried: &[],
        around: pause.around.clone(),
        goes_on: true,
    };
    enliven(&mut rest, &hold, progress)?;
    Ok(rest)
}

/// What a posture does in a frame.
#[derive(Clone, Copy, Default)]
struct Way {
    moves: glam::Vec3,
    turns: [glam::Vec3; crate::motion::JOINT_COUNT],
}

impl Way {
    fn between(one: &Posture, other: &Posture) -> Self {
        let mut turns = [glam::Vec3::ZERO; crate::motion::JOINT_COUNT];
        for (turn, (from, to)) in turns.iter_mut().zip(one.rotations.iter().zip(&other.rotations)) {
            let way = from.inverse() * *to;
            *turn = if way.w < 0.0 { -way } else { way }.to_scaled_axis();
        }
        Self { moves: other.root_position - one.root_position, turns }
    }

    /// The posture so many frames on.
    fn gone(&self, posture: &Posture, frames: f32) -> Posture {
        let mut out = *posture;
        out.root_position += self.moves * frames;
        for (rotation, turn) in out.rotations.iter_mut().zip(&self.turns) {
            *rotation = (*rotation * Quat::from_scaled_axis(*turn * frames)).normalize();
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Planar;
    use crate::test_world::{STANDS, person, room};
    use glam::{Vec2, Vec3};

    #[test]
    fn who_pauses_lives_and_leaves_as_if_there_had_been_no_pause() {
        let scene = room(&[]);
        // Sways by 2 mm a frame when it begins, and set off at 1 cm a frame.
        let at = |y: f32| person(Planar::new(Vec2::new(0.0, y), 0.0), STANDS, 0.0);
        let motion = Motion { postures: vec![at(0.0), at(-0.01)], contacts: vec![[1.0; 2]; 2] };
        let asked = |frames: usize| Pause {
            frames,
            before: Some(at(0.002)),
            size: 1.0,
            seed: 4,
            floor: 0.0,
            around: Surroundings::with(&scene, crate::seats::Seats::default()),
        };
        for frames in [3, 30, 150] {
            let rest = pause(&motion, &asked(frames), &Progress::new()).expect("not cancelled");
            assert_eq!((rest.len(), rest.contacts.len()), (frames, frames));
            assert!(rest.postures[0].root_position.distance(motion.postures[0].root_position) < 1e-5);
            // Nothing jumps, at the ends neither.
            let all: Vec<Posture> =
                [at(0.002)].into_iter().chain(rest.postures).chain(motion.postures.clone()).collect();
            let head = |p: &Posture| p.pose().position(crate::motion::Joint::Head);
            let steps: Vec<Vec3> = all.windows(2).map(|w| head(&w[1]) - head(&w[0])).collect();
            let jolt = steps.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, f32::max);
            assert!(jolt < if frames < 30 { 0.012 } else { 0.004 }, "{frames}: {jolt}");
            // It lives, where there is time to.
            let far = all.iter().map(|p| head(p).distance(head(&all[1]))).fold(0.0, f32::max);
            assert!(frames < 150 || far > 0.01, "{far}");
        }
    }
}
