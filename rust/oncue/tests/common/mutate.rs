//! Files that nobody wrote: what Oncue reads, changed at random, read in this process, and what comes of it counted.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use oncue::controller::StoredPolicy;
use oncue::internals::checkpoint;
use oncue::library::{self, LibrarySettings, StarterUse};
use oncue::manifold::Manifold;
use oncue::motion::skeleton::NAMES;
use oncue::{MotionDatabase, MotionLibrary, Progress, Settings};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};

/// An input that takes longer counts as a hang.
const HANG: Duration = Duration::from_secs(20);

/// A kind of file, one that is whole, and what reads it.
pub struct Kind {
    pub name: &'static str,
    whole: Vec<u8>,
    form: Form,
    /// Whether it was read; an error where what was read is nonsense.
    read: fn(&[u8], &Path) -> Result<bool, String>,
}

/// How a file is changed.
enum Form {
    /// By its words, also to these.
    Text(&'static [&'static str]),
    /// By its words, or by its values.
    Json,
    /// By its bytes; mostly those of its payload, under a checksum that fits.
    Container,
}

/// What came of the inputs of a kind.
#[derive(Debug, Default, Clone)]
pub struct Counts {
    pub inputs: usize,
    pub read: usize,
    pub refused: usize,
    /// What was read and is no sound file, each with its number.
    pub nonsense: Vec<String>,
    pub panics: Vec<String>,
    pub hangs: usize,
    pub slowest: Duration,
}

/// All kinds of files.
pub fn kinds() -> Vec<Kind> {
    let golden = |name: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
        std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let kind = |name, whole, read| Kind { name, whole, form: Form::Container, read };
    let json = |name, whole: Value, read| Kind {
        name,
        // A word for each piece of it.
        whole: serde_json::to_string_pretty(&whole).unwrap_or_default().replace(',', " ,").into_bytes(),
        form: Form::Json,
        read,
    };
    let text = capture().as_bytes().to_vec();
    vec![
        Kind { name: "capture (.bvh)", whole: text, form: Form::Text(&MOCAP_WORDS), read: read_capture },
        json("mapping file of a capture", own_mapping(), read_own_mapping),
        json("mapping file for all captures", common_mapping(), read_common_mapping),
        json("settings (JSON)", json!(Settings::default()), read_settings),
        kind("motion library", golden("library-1.oncue"), read_library),
        kind("policy", golden("policy-1.oncuepolicy"), read_policy),
        kind("motion manifold", golden("manifold-1.oncueman"), read_manifold),
        kind("checkpoint of a training", golden("checkpoint-1.oncueckp"), read_checkpoint),
    ]
}

/// Reads `count` changed files of a kind; the same seed gives the same files.
pub fn try_kind(kind: &Kind, count: usize, seed: u64) -> Counts {
    let mut counts = Counts { inputs: count, ..Counts::default() };
    let scratch = scratch();
    for number in 0..count {
        let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(0x9e37_79b9).wrapping_add(number as u64));
        let bytes = kind.changed(&mut rng);
        let begun = Instant::now();
        match catch_unwind(AssertUnwindSafe(|| (kind.read)(&bytes, &scratch))) {
            Ok(Ok(true)) => counts.read += 1,
            Ok(Ok(false)) => counts.refused += 1,
            Ok(Err(nonsense)) => counts.nonsense.push(format!("{number}: {nonsense}")),
            Err(_) => counts.panics.push(number.to_string()),
        }
        let spent = begun.elapsed();
        counts.hangs += usize::from(spent > HANG);
        counts.slowest = counts.slowest.max(spent);
    }
    remove(&scratch);
    counts
}

fn remove(scratch: &Path) {
    for written in [scratch.to_path_buf(), scratch.with_extension(MAPPING), scratch.with_extension("json")] {
        let _ = std::fs::remove_file(written);
    }
}

impl Kind {
    /// Whether the file is read as it is; an error where what was read is nonsense.
    pub fn read_whole(&self) -> Result<bool, String> {
        let scratch = scratch();
        let read = (self.read)(&self.whole, &scratch);
        remove(&scratch);
        read
    }

    fn changed(&self, rng: &mut Pcg64) -> Vec<u8> {
        let mut bytes = self.whole.clone();
        let changes = rng.random_range(1..=4);
        if let Form::Text(words) = self.form {
            (0..changes).for_each(|_| change_text(&mut bytes, words, rng));
        } else if matches!(self.form, Form::Json) {
            match serde_json::from_slice::<Value>(&bytes) {
                Ok(mut value) if rng.random_bool(0.7) => {
                    (0..changes).for_each(|_| change_value(&mut value, rng));
                    bytes = value.to_string().into_bytes();
                }
                _ => (0..changes).for_each(|_| change_text(&mut bytes, &JSON_WORDS, rng)),
            }
        } else if rng.random_bool(0.3) {
            (0..changes).for_each(|_| change_bytes(&mut bytes, rng));
        } else {
            // The payload alone, so that it is decoded.
            let header = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
            let mut payload = bytes.split_off(16 + header + 32);
            (0..changes).for_each(|_| change_bytes(&mut payload, rng));
            bytes.truncate(16 + header);
            bytes.extend_from_slice(blake3::hash(&payload).as_bytes());
            bytes.extend_from_slice(&payload);
        }
        bytes
    }
}

fn place(len: usize, rng: &mut Pcg64) -> usize {
    // Often near the beginning, where sizes stand.
    let most = if rng.random_bool(0.4) { len.min(64) } else { len };
    rng.random_range(0..most.max(1)).min(len)
}

fn change_bytes(bytes: &mut Vec<u8>, rng: &mut Pcg64) {
    let at = place(bytes.len(), rng);
    let run = rng.random_range(1..=16).min(bytes.len().saturating_sub(at));
    let numbers: [[u8; 4]; 6] = [
        [0; 4],
        [0xff; 4],
        f32::NAN.to_le_bytes(),
        f32::INFINITY.to_le_bytes(),
        1e30f32.to_le_bytes(),
        [0xff, 0xff, 0xff, 0x7f],
    ];
    match rng.random_range(0..7) {
        0 if at < bytes.len() => bytes[at] ^= 1 << rng.random_range(0..8),
        1 if at < bytes.len() => bytes[at] = rng.random(),
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(at..at + run)),
        4 => {
            let again = bytes[at..at + run].to_vec();
            bytes.splice(at..at, again);
        }
        5 => {
            let new: Vec<u8> = (0..run.max(1)).map(|_| rng.random()).collect();
            bytes.splice(at..at, new);
        }
        _ => {
            let number = numbers[rng.random_range(0..numbers.len())];
            bytes.iter_mut().skip(at).zip(number).for_each(|(byte, new)| *byte = new);
        }
    }
}

const MOCAP_WORDS: [&str; 16] = [
    "nan",
    "inf",
    "-1e38",
    "1e999",
    "0",
    "-0",
    "4294967296",
    "-1",
    "}",
    "{",
    "ROOT a",
    "JOINT Hips",
    "End Site",
    "CHANNELS 6 Xposition",
    "Frames: 1000000000",
    "\u{fffd}",
];

const JSON_WORDS: [&str; 20] = [
    "null",
    "true",
    "-1",
    "0",
    "1e999",
    "1e-320",
    "18446744073709551616",
    "9223372036854775807",
    "4294967296",
    "1000000000",
    "NaN",
    "{",
    "}",
    "[",
    "]",
    "\"\\ud800\"",
    "\"LeftLeg\"",
    "\"Hips\"",
    "\"sit\"",
    "\"\"",
];

/// Somewhere in the tree a value is another, is gone, or is there once more.
fn change_value(value: &mut Value, rng: &mut Pcg64) {
    let inside = !rng.random_bool(0.1);
    match value {
        Value::Object(fields) if inside && !fields.is_empty() => {
            let names: Vec<String> = fields.keys().cloned().collect();
            let name = &names[rng.random_range(0..names.len())];
            match rng.random_range(0..10) {
                0 => drop(fields.remove(name)),
                1 => {
                    let kept = fields.remove(name).unwrap_or_default();
                    fields.insert(format!("{name}s"), kept);
                }
                _ => change_value(&mut fields[name], rng),
            }
        }
        Value::Array(items) if inside && !items.is_empty() => {
            let at = rng.random_range(0..items.len());
            match rng.random_range(0..10) {
                0 => drop(items.remove(at)),
                1 => items.push(items[at].clone()),
                _ => change_value(&mut items[at], rng),
            }
        }
        Value::Number(_) if rng.random_bool(0.7) => {
            let numbers = [
                json!(0),
                json!(-1),
                json!(1),
                json!(2),
                json!(50),
                json!(1e-320),
                json!(1e38),
                json!(u64::MAX),
            ];
            *value = numbers[rng.random_range(0..numbers.len())].clone();
        }
        Value::String(_) if rng.random_bool(0.7) => {
            let words = ["", "z", "-x", "walk", "stop", "Hips", "LeftLeg", "RightFoot", "nobody", "\u{0}"];
            *value = json!(words[rng.random_range(0..words.len())]);
        }
        _ => {
            let odd =
                [Value::Null, json!(true), json!(3), json!("text"), json!([]), json!({}), json!([{"a": 1}])];
            *value = odd[rng.random_range(0..odd.len())].clone();
        }
    }
}

fn change_text(bytes: &mut Vec<u8>, new_words: &[&str], rng: &mut Pcg64) {
    let words: Vec<(usize, usize)> = {
        let mut found = Vec::new();
        let mut begin = None;
        for (i, byte) in bytes.iter().enumerate() {
            match (byte.is_ascii_whitespace(), begin) {
                (false, None) => begin = Some(i),
                (true, Some(b)) => {
                    found.push((b, i));
                    begin = None;
                }
                _ => {}
            }
        }
        found
    };
    // The hierarchy is a small part of the words.
    let early = rng.random_bool(0.6);
    let Some(&(from, to)) =
        words.get(rng.random_range(0..if early { words.len().min(400) } else { words.len() }.max(1)))
    else {
        return;
    };
    match rng.random_range(0..4) {
        0 => drop(bytes.drain(from..to)),
        1 => {
            let again = [&bytes[from..to], b" "].concat();
            bytes.splice(from..from, again);
        }
        2 => change_bytes(bytes, rng),
        _ => {
            let word = new_words[rng.random_range(0..new_words.len())].bytes();
            bytes.splice(from..to, word);
        }
    }
}

/// A file of this process and thread alone.
fn scratch() -> PathBuf {
    let thread = format!("{:?}", std::thread::current().id());
    let number: String = thread.chars().filter(char::is_ascii_digit).collect();
    std::env::temp_dir().join(format!("oncue-mutation-{}-{number}.bvh", std::process::id()))
}

/// The text of a capture of three seconds.
fn capture() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    TEXT.get_or_init(|| {
        let starter = library::starter::generate(&Progress::new()).expect("a library");
        let lengths = starter.clips.iter().filter(|clip| clip.motion.len() >= 90);
        let shortest = lengths.min_by_key(|clip| clip.motion.len()).expect("a clip of three seconds");
        library::to_bvh(&shortest.motion).expect("written")
    })
}

/// All the way to a clip.
fn read_capture(bytes: &[u8], scratch: &Path) -> Result<bool, String> {
    std::fs::write(scratch, bytes).map_err(|error| error.to_string())?;
    build(scratch, None)
}

fn build(path: &Path, mapping: Option<PathBuf>) -> Result<bool, String> {
    let settings = LibrarySettings { starter: StarterUse::None, mapping, ..LibrarySettings::default() };
    match library::build(&[path.to_path_buf()], &settings, &Progress::new()) {
        Ok(built) => sound(&built.library).map(|()| built.library.clips.iter().any(|_| true)),
        Err(_) => Ok(false),
    }
}

/// Ending of the mapping file that lies beside a capture.
const MAPPING: &str = "oncue.json";

/// All that a mapping file can say of a capture.
fn own_mapping() -> Value {
    let joints: BTreeMap<&str, &str> = NAMES.iter().map(|name| (*name, *name)).collect();
    json!({
        "exclude": false,
        "up": "y",
        "rate": 30,
        "mapping": joints,
        "labels": [
            {"label": "walk", "first": 0, "end": 40},
            {"label": "sit", "first": 40, "end": 80, "complete": 70},
        ],
    })
}

/// The same for all captures, and some of one of them.
fn common_mapping() -> Value {
    let mut all = own_mapping();
    all["files"] = json!({"walk.bvh": own_mapping(), "b.bvh": {"up": "-x"}});
    if let Value::Object(fields) = &mut all {
        fields.remove("labels");
    }
    all
}

fn read_own_mapping(bytes: &[u8], scratch: &Path) -> Result<bool, String> {
    let written = std::fs::write(scratch, capture())
        .and_then(|()| std::fs::write(scratch.with_extension(MAPPING), bytes));
    written.map_err(|error| error.to_string())?;
    build(scratch, None)
}

fn read_common_mapping(bytes: &[u8], scratch: &Path) -> Result<bool, String> {
    let path = scratch.with_extension("json");
    let written = std::fs::write(scratch, capture()).and_then(|()| std::fs::write(&path, bytes));
    written.map_err(|error| error.to_string())?;
    let _ = std::fs::remove_file(scratch.with_extension(MAPPING));
    build(scratch, Some(path))
}

fn read_settings(bytes: &[u8], _: &Path) -> Result<bool, String> {
    let Ok(settings) = serde_json::from_slice::<Settings>(bytes) else { return Ok(false) };
    if settings.validate().is_err() {
        return Ok(false);
    }
    // What is let in are numbers that can be written and read again.
    let text = serde_json::to_vec(&settings).map_err(|error| error.to_string())?;
    match serde_json::from_slice::<Settings>(&text) {
        Ok(again) if again == settings => Ok(true),
        Ok(_) => Err("what was read is not what is written".into()),
        Err(error) => Err(error.to_string()),
    }
}

fn read_library(bytes: &[u8], _: &Path) -> Result<bool, String> {
    let Ok(library) = MotionLibrary::from_bytes(bytes, Path::new("library")) else { return Ok(false) };
    sound(&library)?;
    let again = MotionLibrary::from_bytes(&library.to_bytes(), Path::new("library"));
    if again.as_ref().ok() != Some(&library) {
        return Err("what was read is not what is written".into());
    }
    // What is asked of it next.
    let weights = Settings::default().synthesizer.weights;
    let _ = MotionDatabase::build(&library, &weights, &Progress::new());
    Ok(true)
}

fn sound(library: &MotionLibrary) -> Result<(), String> {
    let postures = library.clips.iter().flat_map(|clip| &clip.motion.postures);
    // What half precision or an old file rounds off is no nonsense.
    let is_turn = |q: &oncue::glam::Quat| (q.length_squared() - 1.0).abs() < 2e-3;
    let finite = |p: &oncue::Posture| p.root_position.is_finite() && p.rotations.iter().all(is_turn);
    if postures.into_iter().all(finite) { Ok(()) } else { Err("a posture is no posture".into()) }
}

fn read_policy(bytes: &[u8], _: &Path) -> Result<bool, String> {
    let Ok(policy) = StoredPolicy::from_bytes(bytes, Path::new("policy")) else { return Ok(false) };
    match StoredPolicy::from_bytes(&policy.to_bytes(), Path::new("policy")) {
        Ok(again) if again == policy => Ok(true),
        _ => Err("what was read is not what is written".into()),
    }
}

fn read_manifold(bytes: &[u8], _: &Path) -> Result<bool, String> {
    let Ok(manifold) = Manifold::from_bytes(bytes, Path::new("manifold")) else { return Ok(false) };
    match Manifold::from_bytes(&manifold.to_bytes(), Path::new("manifold")) {
        Ok(_) => Ok(true),
        Err(error) => Err(error.to_string()),
    }
}

fn read_checkpoint(bytes: &[u8], _: &Path) -> Result<bool, String> {
    Ok(checkpoint::decodes(bytes).is_ok())
}
