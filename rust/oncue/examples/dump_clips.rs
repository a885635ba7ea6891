//! Writes joint positions of the starter library's clips whose name contains a word: `dump_clips WORD OUT.json`.
//!
//! One JSON object a clip: name, segments, contacts (F, 2), positions (F, 22, 3), quality.

use oncue::internals::quality;
use oncue::library::starter;
use oncue::progress::Progress;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let word = arguments.next().unwrap_or_default();
    let out = arguments.next().unwrap_or_else(|| "clips.json".into());
    let begun = std::time::Instant::now();
    let library = starter::generate(&Progress::new())?;
    eprintln!("{} clips, {} frames in {:?}", library.clips.len(), library.frame_count(), begun.elapsed());
    let clips: Vec<_> = library.clips.iter().filter(|c| !c.mirrored && c.name.contains(&word)).collect();
    let objects: Vec<_> = clips
        .iter()
        .map(|clip| {
            let positions: Vec<_> = clip.motion.postures.iter().map(|p| p.pose().positions).collect();
            let quality = quality::measure(clip);
            for fault in quality::faults(&quality) {
                eprintln!("{}: {fault}", clip.name);
            }
            serde_json::json!({
                "name": clip.name, "segments": clip.segments, "contacts": clip.motion.contacts,
                "positions": positions, "quality": quality,
                "knees": clip.motion.postures.iter().map(|p| [quality::knee_flexion(p.rotations[15]).0, quality::knee_flexion(p.rotations[19]).0]).collect::<Vec<_>>(),
            })
        })
        .collect();
    std::fs::write(out, serde_json::to_string(&objects)?)?;
    Ok(())
}
