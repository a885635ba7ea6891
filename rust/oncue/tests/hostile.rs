//! Numbers that no scene, library or training has: each ends in a sentence, and can be cancelled meanwhile.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use oncue::glam::Vec3;
use oncue::library::{Source, starter};
use oncue::manifold::{Manifold, ManifoldSettings, train_manifold};
use oncue::scene::SceneSettings;
use oncue::{ActionLabel, Error, Motion, MotionDatabase, MotionLibrary, Progress, SceneIndex, Settings};

/// A cancel is answered within this.
const ANSWER: Duration = Duration::from_secs(20);

#[test]
fn indexing_a_floor_that_is_there_many_times_can_be_cancelled() {
    let corners = [Vec3::new(-20.0, -20.0, 0.0), Vec3::new(20.0, -20.0, 0.0), Vec3::new(0.0, 20.0, 0.0)];
    let positions: Vec<Vec3> = std::iter::repeat_n(corners, 20_000).flatten().collect();
    let triangles: Vec<[u32; 3]> = (0..20_000u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let progress = Arc::new(Progress::new());
    let (sender, receiver) = channel();
    let work = thread::spawn({
        let progress = progress.clone();
        move || {
            sender.send(
                SceneIndex::build(&positions, &triangles, &SceneSettings::default(), &progress).map(|_| ()),
            )
        }
    });
    // Done before it is cancelled is as good.
    let result = receiver.recv_timeout(Duration::from_millis(300)).or_else(|_| {
        progress.cancel();
        receiver.recv_timeout(ANSWER)
    });
    assert!(matches!(result, Ok(Ok(()) | Err(Error::Cancelled))), "{result:?}");
    work.join().expect("no panic").expect("heard");
}

fn small() -> ManifoldSettings {
    ManifoldSettings {
        channels: 8,
        epochs: 1,
        batch: 16,
        stride: 200,
        augmented: 0.0,
        ..ManifoldSettings::default()
    }
}

#[test]
fn a_training_writes_what_can_be_read_or_says_why_not() {
    let library = starter::generate(&Progress::new()).expect("the starter library");
    let few = MotionLibrary { clips: library.clips[..6].to_vec() };
    for settings in [
        ManifoldSettings { learning_rate: 1.0, final_learning_rate: 1.0, noise: 10.0, epochs: 4, ..small() },
        ManifoldSettings { origin: "o".repeat(4096), ..small() },
        ManifoldSettings {
            contact_weight: 1e3,
            root_weight: 1e3,
            rotation_weight: 1e3,
            position_weight: 1e3,
            ..small()
        },
    ] {
        match train_manifold(&few, &settings, 1, None, &Progress::new()) {
            Ok(manifold) => {
                let read = Manifold::from_bytes(&manifold.to_bytes(), Path::new("made.oncueman"));
                assert!(read.is_ok(), "{:?}: {:?}", settings, read.err());
            }
            Err(error) => assert!(error.to_string().ends_with('.'), "{error}"),
        }
    }
    for settings in [
        ManifoldSettings { learning_rate: 1e30, ..small() },
        ManifoldSettings { noise: 1e30, ..small() },
        ManifoldSettings { origin: "o".repeat(1 << 17), ..small() },
        ManifoldSettings { mocap_repeats: 1 << 31, ..small() },
        ManifoldSettings { batch: 1 << 31, ..small() },
        ManifoldSettings { stride: 0, ..small() },
    ] {
        let error =
            train_manifold(&few, &settings, 1, None, &Progress::new()).expect_err("refused").to_string();
        assert!(error.contains("manifold."), "{error}");
    }
}

/// A library whose checksum is right and whose clips are none: nothing is divided by its nothing.
#[test]
fn a_library_of_nothing_is_a_sentence() {
    let library = starter::generate(&Progress::new()).expect("the starter library");
    let mut clip = library.clips[0].clone();
    clip.motion.postures.truncate(1);
    clip.motion.contacts.truncate(1);
    clip.segments.clear();
    let short = clip.clone();
    clip.motion = Motion::default();
    let mut captured = short.clone();
    captured.source = Source::Mocap;
    let libraries = [
        MotionLibrary::default(),
        MotionLibrary { clips: vec![clip.clone(); 4] },
        MotionLibrary { clips: vec![short; 4] },
        MotionLibrary { clips: vec![captured; 4] },
    ];
    for library in libraries {
        let bytes = library.to_bytes();
        let Ok(read) = MotionLibrary::from_bytes(&bytes, Path::new("made.oncue")) else { continue };
        let weights = Settings::default().synthesizer.weights;
        let built = MotionDatabase::build(&read, &weights, &Progress::new());
        assert!(built.is_err(), "nothing to match against");
        let trained = train_manifold(&read, &small(), 1, None, &Progress::new());
        assert!(trained.expect_err("nothing to learn from").to_string().ends_with('.'));
        assert!(
            read.summary().rows.iter().all(|row| row.mocap_seconds == 0.0 || row.label == ActionLabel::Other)
        );
        let _ = (read.foot_figures(), read.body_figures());
    }
}
