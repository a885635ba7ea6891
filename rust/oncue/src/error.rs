//! One variant per thing that a user can act on.
//!
//! Every message is a sentence for an artist: it names the object, the file or the value.

use std::path::PathBuf;

use glam::Vec3;

/// What is amiss with a file that Oncue may have made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFault {
    /// It is of another kind.
    Foreign,
    /// A newer Oncue made it.
    Newer,
    /// An Oncue made it that is older than any whose files are read.
    Older,
    /// Its content is not what was written.
    Damaged,
    /// It is whole, and was made for something else than it is asked for.
    Unfit,
}

/// Everything that can go wrong in the core.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A cue, a start or a setting that cannot be met as given.
    #[error("{0}")]
    Input(String),
    /// Nothing in the scene or the library could fulfil the task; the sentence says why.
    #[error("{0}")]
    Unreachable(String),
    /// A cue that lies too far from the edge of its seat to be sat down on.
    #[error("{sentence}")]
    FarFromEdge {
        /// The whole of what is said.
        sentence: String,
        /// Where it could be, world, metres.
        place: Vec3,
        /// Facing where, radians.
        yaw: f32,
    },
    /// A motion capture file that stays unreadable.
    #[error("{file}: {reason}")]
    MocapFile {
        /// The file.
        file: PathBuf,
        /// A sentence without the file's name.
        reason: String,
    },
    /// A file made by Oncue (library, policy, manifold) that is damaged, too new or of another kind.
    #[error("{file}: {reason}")]
    DataFile {
        /// The file.
        file: PathBuf,
        /// What is amiss, for whoever decides by it.
        fault: FileFault,
        /// A sentence without the file's name.
        reason: String,
    },
    /// The operating system refused a file.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The user asked to stop.
    #[error("Cancelled.")]
    Cancelled,
}

/// What may end with an [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An [`Error::Input`] from anything printable.
    pub fn input(sentence: impl Into<String>) -> Self {
        Self::Input(sentence.into())
    }

    /// An [`Error::Io`] for `file`.
    pub fn io(file: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Io { file: file.into(), source }
    }
}
