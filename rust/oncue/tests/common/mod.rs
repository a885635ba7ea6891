//! What several test files share: where the reference data lies, and readers for it.
#![allow(dead_code)]

pub mod boxes;
pub mod glb;
pub mod rooms;

use std::path::PathBuf;

/// The folder of reference data: `ONCUE_SHARED`, or `../shared` beside the repository. `None`, with a message, where absent.
pub fn shared(part: &str) -> Option<PathBuf> {
    let root = std::env::var_os("ONCUE_SHARED")
        .map(PathBuf::from)
        .unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let path = root.join(part);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent (set ONCUE_SHARED)", path.display());
    None
}
