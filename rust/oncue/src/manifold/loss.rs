//! L_recon, and how well a manifold gives windows back (LAMA, supplementary, "Reconstruction Loss").

use glam::Vec3;
use rand::RngExt;
use rayon::prelude::*;

use super::augment::augment;
use super::autoencoder::{DecoderWorkspace, Manifold, Normalization};
use super::kinematics::{Kinematics, RootPath};
use super::report::ReconstructionFigures;
use super::settings::{CHUNK_WINDOWS, ManifoldSettings};
use super::training_windows::{Window, generator};
use super::window::{CONTACTS, FEATURES, ROTATIONS, WINDOW, from_motion, rotation};
use crate::error::Result;
use crate::math::Planar;
use crate::math::rotation::angle_between;
use crate::motion::JOINT_COUNT;
use crate::progress::Progress;

/// L_pos counts in decimetres: an error of 1 dm weighs as one standard deviation of a feature does.
const POSITION_UNIT: f32 = 0.1;

/// L_recon of one window; adds its gradient by `found` to `d_found`. `buffers` hold the joints of the two.
///
/// Each term is a mean over the frames and its numbers: of the normalized contacts, root numbers and 6D rotations
/// the squared difference, of the joints the squared distance in decimetres.
pub(super) fn reconstruction_loss(
    wanted: &[f32],
    found: &[f32],
    normalization: &Normalization,
    path_share: f32,
    settings: &ManifoldSettings,
    buffers: (&mut Kinematics, &mut Kinematics),
    d_found: &mut [f32],
) -> f64 {
    let frames = found.len() / FEATURES;
    let mut weights = [settings.root_weight / 4.0; FEATURES];
    weights[ROTATIONS].fill(settings.rotation_weight / ROTATIONS.len() as f32);
    weights[CONTACTS].fill(settings.contact_weight / CONTACTS.len() as f32);
    let mut loss = 0.0f64;
    for ((wanted, found), d) in wanted
        .chunks_exact(FEATURES)
        .zip(found.chunks_exact(FEATURES))
        .zip(d_found.chunks_exact_mut(FEATURES))
    {
        let mut sum = 0.0;
        for i in 0..FEATURES {
            let weight = weights[i] / frames as f32;
            let difference = (found[i] - wanted[i]) / normalization.std[i];
            sum += weight * difference * difference;
            d[i] += 2.0 * weight * difference / normalization.std[i];
        }
        loss += f64::from(sum);
    }
    let (there, here) = buffers;
    let unit = POSITION_UNIT * POSITION_UNIT * (frames * JOINT_COUNT) as f32;
    for (path, share) in [(RootPath::Centred, 1.0), (RootPath::From(Planar::default()), path_share)] {
        if share == 0.0 {
            continue;
        }
        there.forward(wanted, path);
        here.forward(found, path);
        let weight = settings.position_weight * share / unit;
        let d_positions: Vec<[Vec3; JOINT_COUNT]> = here
            .positions
            .iter()
            .zip(&there.positions)
            .map(|(here, there)| {
                std::array::from_fn(|joint| {
                    let difference = here[joint] - there[joint];
                    loss += f64::from(weight * difference.length_squared());
                    2.0 * weight * difference
                })
            })
            .collect();
        here.backward(found, &d_positions, None, d_found);
    }
    loss
}

/// How well `manifold` gives `windows` back; changed as in training where there is a `seed` for it.
pub(super) fn measure(
    manifold: &Manifold,
    windows: &[Window],
    augmented: Option<u64>,
    progress: &Progress,
) -> Result<ReconstructionFigures> {
    let xs = |first: usize, some: &[Window]| -> Vec<f32> {
        let x = some.iter().enumerate().map(|(i, window)| {
            let motion = window.motion();
            let changed = augmented.map(|seed| {
                let mut rng = generator(seed, u32::MAX - 1, (first + i) as u32);
                let other = windows[rng.random_range(0..windows.len())].motion();
                augment(&motion, &other, &mut rng)
            });
            from_motion(&changed.unwrap_or(motion)).0
        });
        x.flatten().collect()
    };
    let sums: Vec<[f64; 5]> = windows
        .par_chunks(CHUNK_WINDOWS)
        .enumerate()
        .map(|(chunk, some)| {
            progress.check()?;
            let x = xs(chunk * CHUNK_WINDOWS, some);
            let z = manifold.encode(&x);
            progress.check()?;
            let mut work = DecoderWorkspace::default();
            let found = manifold.decode(&z, &mut work);
            let mut sum = [0.0; 5];
            let size = WINDOW * FEATURES;
            for (wanted, found) in x.chunks_exact(size).zip(found.chunks_exact(size)) {
                sum.iter_mut().zip(window_errors(wanted, found)).for_each(|(s, e)| *s += e);
            }
            Ok(sum)
        })
        .collect::<Result<_>>()?;
    let mean =
        |which: usize| (sums.iter().map(|s| s[which]).sum::<f64>() / windows.len().max(1) as f64) as f32;
    Ok(ReconstructionFigures {
        windows: windows.len(),
        joint_error_cm: 100.0 * mean(0),
        path_joint_error_cm: 100.0 * mean(1),
        rotation_error_degrees: mean(2).to_degrees(),
        contact_accuracy: mean(3),
        root_drift_cm: 100.0 * mean(4),
    })
}

/// Of one window: joint error and the same along the path (m), rotation error (rad), contact accuracy, drift (m).
fn window_errors(wanted: &[f32], found: &[f32]) -> [f64; 5] {
    let frames = wanted.len() / FEATURES;
    let joints = (frames * JOINT_COUNT) as f64;
    let mut out = [0.0; 5];
    let (mut there, mut here) = (Kinematics::default(), Kinematics::default());
    for (which, path) in [(0, RootPath::Centred), (1, RootPath::From(Planar::default()))] {
        there.forward(wanted, path);
        here.forward(found, path);
        let pairs = here.positions.iter().flatten().zip(there.positions.iter().flatten());
        out[which] = pairs.map(|(a, b)| f64::from(a.distance(*b))).sum::<f64>() / joints;
    }
    if let (Some(a), Some(b)) = (here.planar().last(), there.planar().last()) {
        out[4] = f64::from(a.position.distance(b.position));
    }
    let level = |contact: f32| (2.0 * contact.clamp(0.0, 1.0)).round() as u8;
    for (wanted, found) in wanted.chunks_exact(FEATURES).zip(found.chunks_exact(FEATURES)) {
        for joint in 0..JOINT_COUNT {
            out[2] += f64::from(angle_between(rotation(wanted, joint), rotation(found, joint))) / joints;
        }
        for foot in CONTACTS {
            out[3] += f64::from(u8::from(level(wanted[foot]) == level(found[foot]))) / (2 * frames) as f64;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::window::tests::random_motion;
    use crate::manifold::window::{HEIGHT, STEP};

    #[test]
    fn gradient_of_the_loss_agrees_with_finite_differences() {
        let (wanted, _) = from_motion(&random_motion(3, 1));
        let (mut found, _) = from_motion(&random_motion(3, 2));
        let mut normalization = Normalization::default();
        normalization.std.iter_mut().enumerate().for_each(|(i, s)| *s = 0.2 + 0.01 * i as f32);
        let settings = ManifoldSettings::default();
        for path_share in [0.0, 0.5] {
            let loss = |found: &[f32], d: &mut [f32]| {
                let (mut a, mut b) = (Kinematics::default(), Kinematics::default());
                reconstruction_loss(
                    &wanted,
                    found,
                    &normalization,
                    path_share,
                    &settings,
                    (&mut a, &mut b),
                    d,
                )
            };
            let mut gradient = vec![0.0; found.len()];
            loss(&found, &mut gradient);
            let mut unused = vec![0.0; found.len()];
            for i in 0..found.len() {
                let (saved, h) = (found[i], 2e-3);
                found[i] = saved + h;
                let up = loss(&found, &mut unused);
                found[i] = saved - h;
                let down = loss(&found, &mut unused);
                found[i] = saved;
                let (numeric, analytic) = ((up - down) / f64::from(2.0 * h), f64::from(gradient[i]));
                assert!(
                    (numeric - analytic).abs() < 3e-2 * (1.0 + analytic.abs()),
                    "{i}: {numeric} {analytic}"
                );
            }
        }
    }

    #[test]
    fn the_terms_of_the_loss_by_hand() {
        // One frame; every contact off by one standard deviation, the root's height by 2 dm and its std by 0.4 m.
        let (wanted, _) = from_motion(&random_motion(1, 1));
        let mut found = wanted.clone();
        CONTACTS.for_each(|i| found[i] += 0.5);
        found[HEIGHT] += 0.2;
        let mut normalization = Normalization::default();
        normalization.std.fill(0.5);
        normalization.std[HEIGHT] = 0.4;
        let settings = ManifoldSettings::default();
        let buffers = (&mut Kinematics::default(), &mut Kinematics::default());
        let mut d = vec![0.0; found.len()];
        let loss = reconstruction_loss(&wanted, &found, &normalization, 0.5, &settings, buffers, &mut d);
        // w_c·1 + w_r·(0.5²)/4 + w_p·2², half of it once more along the path.
        let expected = 0.5 + 0.0625 + 1.5 * 1.3 * 4.0;
        assert!((loss - expected).abs() < 1e-3, "{loss} {expected}");
    }

    #[test]
    fn errors_of_a_window_by_hand() {
        let (wanted, _) = from_motion(&random_motion(WINDOW, 3));
        assert!(
            window_errors(&wanted, &wanted)
                .iter()
                .zip([0.0, 0.0, 0.0, 1.0, 0.0])
                .all(|(a, b)| (a - b).abs() < 1e-6)
        );
        let mut found = wanted.clone();
        for row in found.chunks_exact_mut(FEATURES) {
            row[HEIGHT] += 0.03;
        }
        let errors = window_errors(&wanted, &found);
        assert!((errors[0] - 0.03).abs() < 1e-4 && (errors[1] - 0.03).abs() < 1e-4 && errors[4] < 1e-6);
        // A straight path whose every step is 1 mm too long: 119 mm at its end.
        let mut straight = wanted.clone();
        let mut longer = wanted.clone();
        for (row, long) in straight.chunks_exact_mut(FEATURES).zip(longer.chunks_exact_mut(FEATURES)) {
            row[STEP].copy_from_slice(&[0.0, -0.02, 0.0]);
            long[STEP].copy_from_slice(&[0.0, -0.021, 0.0]);
        }
        let errors = window_errors(&straight, &longer);
        assert!((errors[4] - 0.119).abs() < 1e-4 && errors[0] < 1e-6);
    }
}
