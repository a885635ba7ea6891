//! Curves that are worked by hand, and the bound on curves that are not.

use glam::{DQuat, DVec3};
use proptest::prelude::*;

use super::*;

const TOLERANCE: f64 = 0.003;

/// A trunk with an arm of two bones and a leg of one on it.
fn bones() -> Bones {
    let offsets = vec![DVec3::new(0.0, 0.0, 0.9), DVec3::new(0.0, 0.1, 0.4), DVec3::X * 0.3, -DVec3::Z * 0.5];
    let rests = vec![
        DQuat::IDENTITY,
        DQuat::from_rotation_y(0.7),
        DQuat::from_rotation_x(-0.4),
        DQuat::from_rotation_z(2.0),
    ];
    Bones::new(vec![None, Some(0), Some(1), Some(0)], offsets, rests).unwrap()
}

fn limbs() -> Vec<Limb> {
    [vec![0], vec![1, 2], vec![3]].map(|bones| Limb { bones, keyed: Vec::new() }).to_vec()
}

fn limits(frames: usize) -> Limits {
    let carrying = Tolerance { place: TOLERANCE / 3.0, turn: 0.003 };
    let carried = Tolerance { place: TOLERANCE, turn: 0.02 };
    Limits {
        tolerances: vec![carrying, carried, carried, carried],
        planted: vec![false; 4 * frames],
        drift: 0.0018,
    }
}

/// Frame by frame: the first bone at (x, 0, 0), turned about z; the others about x.
fn motion(frames: usize, at: impl Fn(f64, usize) -> f64) -> Poses {
    let each = |frame: usize| frame as f64;
    Poses {
        locations: (0..frames).map(|frame| DVec3::X * at(each(frame), 0)).collect(),
        rotations: (0..frames)
            .flat_map(|frame| {
                let turned = |bone: usize| DQuat::from_rotation_x(at(each(frame), bone + 1));
                [DQuat::from_rotation_z(at(each(frame), 1)), turned(1), turned(2), turned(3)]
            })
            .collect(),
    }
}

fn fit(motion: &Poses) -> Vec<BoneKeys> {
    fit_keys(&bones(), &limbs(), &limits(motion.locations.len()), motion, None).unwrap()
}

/// What keys play at a time: cubics by their ends' values and slopes, worked out anew.
fn play(keys: &BoneKeys, width: usize, time: f64) -> Vec<f64> {
    let next = keys.frames.partition_point(|&frame| frame as f64 <= time).clamp(1, keys.frames.len() - 1);
    let (a, b) = (next - 1, next);
    let span = (keys.frames[b] - keys.frames[a]) as f64;
    let t = (time - keys.frames[a] as f64) / span;
    let at = |rows: &[f64], key: usize, c: usize| rows[key * width + c];
    (0..width)
        .map(|c| {
            (2.0 * t.powi(3) - 3.0 * t * t + 1.0) * at(&keys.values, a, c)
                + (t.powi(3) - 2.0 * t * t + t) * span * at(&keys.after, a, c)
                + (3.0 * t * t - 2.0 * t.powi(3)) * at(&keys.values, b, c)
                + (t.powi(3) - t * t) * span * at(&keys.before, b, c)
        })
        .collect()
}

/// The heads of all bones at a time, as keys play them.
fn heads(keys: &[BoneKeys], time: f64) -> Vec<DVec3> {
    let rows: Vec<Vec<f64>> =
        (0..4).map(|bone| play(&keys[bone], if bone == 0 { 7 } else { 4 }, time)).collect();
    let turns = rows.iter().map(|r| DQuat::from_xyzw(r[1], r[2], r[3], r[0])).collect();
    placed(DVec3::new(rows[0][4], rows[0][5], rows[0][6]), turns)
}

fn placed(location: DVec3, turns: Vec<DQuat>) -> Vec<DVec3> {
    let bones = bones();
    let mut placed: Vec<(DVec3, DQuat)> = Vec::new();
    for (bone, turn) in turns.into_iter().enumerate() {
        let parent = bones.parents[bone].map_or((DVec3::ZERO, DQuat::IDENTITY), |p| placed[p]);
        let location = if bone == 0 { location } else { DVec3::ZERO };
        placed.push(bones.upon(bone, parent, turn.normalize(), location));
    }
    placed.into_iter().map(|(head, _)| head).collect()
}

/// How far the heads are from a motion at its frames, in the carried bones' tolerance.
fn farthest(keys: &[BoneKeys], motion: &Poses) -> f64 {
    let frames = motion.locations.len();
    let at = |frame: usize| {
        let turns = motion.rotations[4 * frame..4 * frame + 4].to_vec();
        let wanted = placed(motion.locations[frame], turns);
        let apart = heads(keys, frame as f64).into_iter().zip(wanted).map(|(a, b)| a.distance(b));
        apart.fold(0.0, f64::max)
    };
    (0..frames).map(at).fold(0.0, f64::max) / TOLERANCE
}

#[test]
fn what_stands_still_has_a_key_at_each_end() {
    for keys in fit(&motion(40, |_, channel| 0.1 * channel as f64)) {
        assert_eq!(keys.frames, [0, 39]);
        let slopes = keys.before.iter().chain(&keys.after).filter(|slope| slope.is_finite());
        assert!(
            slopes.clone().count() == keys.values.len() && slopes.into_iter().all(|slope| slope.abs() < 1e-9)
        );
        // Nothing lies before the first key and after the last.
        assert!(keys.before[0].is_nan() && keys.after.last().unwrap().is_nan());
    }
}

#[test]
fn a_cubic_is_one_span_with_its_own_slopes() {
    // x = (t/20)³ − (t/20)² runs from 0 to 0, at 0 with slope 0 and at 20 with slope 1/20.
    let motion =
        motion(21, |t, channel| if channel == 0 { (t / 20.0).powi(3) - (t / 20.0).powi(2) } else { 0.0 });
    let root = &fit(&motion)[0];
    assert_eq!(root.frames, [0, 20]);
    assert!(root.after[4].abs() < 1e-3 && (root.before[11] - 0.05).abs() < 1e-3, "{root:?}");
    assert!((play(root, 7, 10.0)[4] + 0.125).abs() < 1e-3);
}

#[test]
fn a_swing_is_keyed_about_where_it_turns_or_passes() {
    // Two whole swings of half a radian in 48 frames.
    let motion = motion(
        49,
        |t, channel| if channel == 2 { 0.5 * (t * std::f64::consts::TAU / 24.0).sin() } else { 0.0 },
    );
    let keys = fit(&motion);
    assert_eq!(keys[0].frames, [0, 48]);
    assert_eq!(keys[1].frames, keys[2].frames, "a limb shares its keys");
    assert!((4..=6).contains(&keys[1].frames.len()), "{:?}", keys[1].frames);
    for frame in &keys[1].frames[1..keys[1].frames.len() - 1] {
        assert!([0, 1, 5].contains(&(frame % 6)), "{:?}", keys[1].frames);
    }
    assert!(farthest(&keys, &motion) <= 1.0);
}

#[test]
fn asked_for_frames_are_keyed() {
    let motion = motion(40, |t, channel| 0.01 * t * channel as f64);
    let mut limbs = limbs();
    limbs[1].keyed = vec![7, 8, 31];
    let keys = fit_keys(&bones(), &limbs, &limits(40), &motion, None).unwrap();
    assert!([7, 8, 31].iter().all(|frame| keys[2].frames.contains(frame)));
    assert!(!keys[0].frames.contains(&7));
}

#[test]
fn a_step_is_keyed_on_both_sides() {
    let motion = motion(30, |t, channel| if t < 15.0 { 0.0 } else { 0.2 + 0.1 * channel as f64 });
    let keys = fit(&motion);
    for one in &keys {
        assert!(one.frames.contains(&14) && one.frames.contains(&15), "{:?}", one.frames);
    }
    assert!(farthest(&keys, &motion) <= 1.0);
}

#[test]
fn what_is_planted_does_not_drift() {
    // The leg's bone is where the trunk carries it, and the trunk sways.
    let sway = motion(60, |t, channel| {
        [0.05 * (t / 5.0).sin(), 0.2 * (t / 6.0).sin(), 0.0, 0.0, 0.3 * (t / 4.0).cos()][channel]
    });
    let drift = |keys: &[BoneKeys]| {
        let error = |frame: usize| {
            let turns = sway.rotations[4 * frame..4 * frame + 4].to_vec();
            heads(keys, frame as f64)[3] - placed(sway.locations[frame], turns)[3]
        };
        (1..60).map(|frame| error(frame).distance(error(frame - 1))).fold(0.0, f64::max)
    };
    let mut limits = limits(60);
    limits.drift = 0.0002;
    let free = drift(&fit_keys(&bones(), &limbs(), &limits, &sway, None).unwrap());
    for frame in 0..59 {
        limits.planted[4 * frame + 3] = true;
    }
    let planted = drift(&fit_keys(&bones(), &limbs(), &limits, &sway, None).unwrap());
    assert!(free > 0.0002 && planted <= 0.000_201, "{free} {planted}");
}

#[test]
fn curves_that_stay_are_gone_round() {
    let wanted = motion(60, |t, channel| 0.3 * (t / (5.0 + channel as f64)).sin());
    let halves = motion(119, |t, channel| 0.3 * (t / 2.0 / (5.0 + channel as f64)).sin() + 0.05);
    // All stays but the arm from frame 20 to 40; of its second bone frames 28 to 32 stay too.
    let mut stays = vec![true; 240];
    for frame in 20..40 {
        stays[4 * frame + 1] = false;
        stays[4 * frame + 2] = (28..32).contains(&frame);
    }
    let kept = Kept { played: halves.clone(), stays };
    let keys = fit_keys(&bones(), &limbs(), &limits(60), &wanted, Some(&kept)).unwrap();
    assert!(keys[0].frames.is_empty() && keys[3].frames.is_empty());
    for bone in [1, 2] {
        assert_eq!((keys[bone].frames[0], *keys[bone].frames.last().unwrap()), (20, 40));
        assert!(keys[bone].before[0].is_nan() && keys[bone].after.last().unwrap().is_nan());
        // At its ends a stretch goes on from what plays there.
        assert!((keys[bone].values[0] - halves.rotations[4 * 40 + bone].w).abs() < 1e-12);
    }
    let second = &keys[2];
    assert!(second.frames.iter().all(|&frame| frame <= 28 || frame >= 32));
    let at = second.frames.iter().position(|&frame| frame == 28).unwrap();
    assert!(second.after[4 * at].is_nan() && !second.before[4 * at].is_nan());
    assert!(second.before[4 * (at + 1)].is_nan() && !second.after[4 * (at + 1)].is_nan());
    assert!(keys[1].frames.contains(&28) && keys[1].frames.contains(&32));
}

#[test]
fn arrays_of_different_motions_are_refused() {
    let wanted = motion(10, |t, _| t / 100.0);
    let refused = |limits: &Limits, wanted: &Poses, kept: Option<&Kept>| {
        let answer = fit_keys(&bones(), &limbs(), limits, wanted, kept);
        matches!(answer, Err(Error::Input(_)))
    };
    assert!(!refused(&limits(10), &wanted, None));
    assert!(refused(&limits(9), &wanted, None));
    let mut broken = wanted.clone();
    broken.rotations[7] = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    assert!(refused(&limits(10), &broken, None));
    broken.rotations.pop();
    assert!(refused(&limits(10), &broken, None));
    let kept = Kept { played: wanted.clone(), stays: vec![true; 40] };
    assert!(refused(&limits(10), &wanted, Some(&kept)));
    assert!(Bones::new(vec![Some(0)], vec![DVec3::ZERO], vec![DQuat::IDENTITY]).is_err());
}

#[test]
fn no_frame_and_one_frame_are_motions_too() {
    assert!(fit(&motion(0, |_, _| 0.0)).iter().all(|keys| keys.frames.is_empty()));
    let keys = fit(&motion(1, |_, channel| 0.1 * channel as f64));
    assert!(keys.iter().all(|keys| keys.frames == [0]), "{keys:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_bound_holds_on_smooth_curves(
        waves in prop::collection::vec((0.02..0.5_f64, 0.05..0.5_f64, 0.0..6.0_f64), 10),
        step in 5..55_usize,
        height in 0.0..0.6_f64,
    ) {
        let motion = motion(60, |t, channel| {
            let smooth: f64 = waves[2 * channel..2 * channel + 2]
                .iter()
                .map(|(size, speed, begin)| size * (speed * t + begin).sin())
                .sum();
            smooth + if t >= step as f64 { height } else { 0.0 }
        });
        let keys = fit(&motion);
        prop_assert!(farthest(&keys, &motion) <= 1.0 + 1e-9);
        prop_assert_eq!(&keys[1].frames, &keys[2].frames);
        let ends: Vec<_> = keys.iter().map(|keys| (keys.frames[0], *keys.frames.last().unwrap())).collect();
        prop_assert!(ends.iter().all(|ends| *ends == (0, 59)));
    }
}
