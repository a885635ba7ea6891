//! What several test files share: where the reference data lies, readers for it, and tests that need it.
#![allow(dead_code)]

pub mod boxes;
pub mod glb;
pub mod rooms;
pub mod walks;

use std::path::PathBuf;

/// A part of the reference data: in `ONCUE_SHARED`, or in `../shared` beside the repository. `None` where it is absent.
pub fn shared(part: &str) -> Option<PathBuf> {
    let root = std::env::var_os("ONCUE_SHARED")
        .map(PathBuf::from)
        .unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    Some(root.join(part)).filter(|path| path.exists())
}
