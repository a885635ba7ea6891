//! The checkpoint of a training: all its state, in full precision, so that it goes on as if never stopped.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::autoencoder::Manifold;
use super::report::TrainingReport;
use crate::data_file::{FileKind, write_whole};
use crate::error::{Error, Result};
use crate::nn::Adam;

/// All that changes while a manifold is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct TrainingState {
    /// What is known so far; names the training, too.
    pub report: TrainingReport,
    pub epoch: u32,
    pub step: u64,
    pub manifold: Manifold,
    /// One a layer, encoder's first.
    pub adam: Vec<Adam>,
}

const FILE: FileKind = FileKind {
    magic: b"ONCUECKP",
    version: 1,
    name: "checkpoint of a manifold's training",
    remedy: "remove it to begin the training again",
};

/// # Errors
/// [`Error::Io`] where the system refuses it.
pub(super) fn write(path: &Path, state: &TrainingState) -> Result<()> {
    // Plain structs of numbers and strings always serialize.
    let payload = postcard::to_stdvec(state).unwrap_or_default();
    write_whole(path, &FILE.pack("Checkpoint of the training of an Oncue motion manifold.", &payload))
}

/// The state of the training that `report` names.
///
/// # Errors
/// [`Error::DataFile`] where the file is damaged or of another training, [`Error::Io`].
pub(super) fn read(path: &Path, report: &TrainingReport) -> Result<TrainingState> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let state: TrainingState =
        postcard::from_bytes(FILE.unpack(&bytes, path)?).map_err(|_| FILE.damaged(path))?;
    let theirs = &state.report;
    if (&theirs.library, theirs.seed, &theirs.settings) != (&report.library, report.seed, &report.settings) {
        return Err(Error::DataFile {
            file: path.into(),
            reason:
                "it belongs to a training with another library, seed or settings; remove it, or name another \
                     checkpoint."
                    .into(),
        });
    }
    Ok(state)
}
