//! The checkpoint of a training: all its state, in full precision, so that it goes on as if never stopped.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::autoencoder::Manifold;
use super::report::TrainingReport;
use crate::data_file::{FileKind, write_whole};
use crate::error::{Error, FileFault, Result};
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
    oldest: 1,
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
    let state = decode(&bytes, path)?;
    let theirs = &state.report;
    if (&theirs.library, theirs.seed, &theirs.settings) != (&report.library, report.seed, &report.settings) {
        return Err(Error::DataFile {
            file: path.into(),
            fault: FileFault::Unfit,
            reason:
                "it belongs to a training with another library, seed or settings; remove it, or name another \
                     checkpoint."
                    .into(),
        });
    }
    Ok(state)
}

/// The state of a checkpoint's bytes.
fn decode(bytes: &[u8], path: &Path) -> Result<TrainingState> {
    match FILE.unpack(bytes, path)? {
        (1, payload) => postcard::from_bytes(payload).map_err(|_| FILE.damaged(path)),
        _ => Err(FILE.damaged(path)),
    }
}

/// Whether the bytes of a checkpoint decode, for those who try bytes that nobody wrote.
///
/// # Errors
/// [`Error::DataFile`] where they do not.
pub fn decodes(bytes: &[u8]) -> Result<()> {
    decode(bytes, Path::new("checkpoint")).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data_file::golden;

    #[test]
    fn each_version_is_read() {
        let manifold = Manifold::random(1, 7);
        let adam =
            manifold.encoder.layers.iter().map(|layer| Adam::new(0.5, layer.parameters.len())).collect();
        let report = TrainingReport { library: "a library".into(), seed: 5, ..TrainingReport::default() };
        let now = TrainingState { report, epoch: 3, step: 9, manifold, adam };
        let bytes = FILE.pack("Checkpoint.", &postcard::to_stdvec(&now).expect("plain numbers"));
        assert_eq!(decode(&golden("checkpoint-1.oncueckp", &bytes), Path::new("x")).expect("read"), now);
    }
}
