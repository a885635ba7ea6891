//! The container of every file that Oncue makes: libraries, policies, manifolds.
//!
//! ```text
//! magic       8 bytes, the kind of file
//! version     u32, little-endian
//! header size u32, little-endian; the header is one line of text that says what made the file
//! header      UTF-8
//! checksum    32 bytes, BLAKE3 of the payload
//! payload     postcard
//! ```

use std::io::Write;
use std::path::Path;

use crate::error::{Error, Result};

/// Longer headers are damage.
const MAX_HEADER: usize = 1 << 16;

/// A kind of file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FileKind {
    pub magic: &'static [u8; 8],
    /// The newest version that is read and the one that is written.
    pub version: u32,
    /// As a sentence names it: "motion library".
    pub name: &'static str,
    /// What to do about a damaged one: "build the library again".
    pub remedy: &'static str,
}

impl FileKind {
    /// The bytes of a file.
    pub(crate) fn pack(&self, header: &str, payload: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(payload.len() + header.len() + 48);
        bytes.extend_from_slice(self.magic);
        bytes.extend_from_slice(&self.version.to_le_bytes());
        bytes.extend_from_slice(&(header.len() as u32).to_le_bytes());
        bytes.extend_from_slice(header.as_bytes());
        bytes.extend_from_slice(blake3::hash(payload).as_bytes());
        bytes.extend_from_slice(payload);
        bytes
    }

    /// The payload of a file's bytes; `file` is for the error.
    ///
    /// # Errors
    /// [`Error::DataFile`] where the bytes are foreign, too new, cut off or damaged.
    pub(crate) fn unpack<'a>(&self, bytes: &'a [u8], file: &Path) -> Result<&'a [u8]> {
        let refuse = |reason: String| Error::DataFile { file: file.into(), reason };
        let damaged = || self.damaged(file);
        let rest = bytes
            .strip_prefix(self.magic)
            .ok_or_else(|| refuse(format!("it is not an Oncue {}.", self.name)))?;
        let (version, rest) = split_u32(rest).ok_or_else(damaged)?;
        if version > self.version {
            return Err(refuse(format!(
                "it was made by a newer Oncue (format {version}, this one reads up to {}); update Oncue.",
                self.version
            )));
        }
        let (header, rest) = split_u32(rest).ok_or_else(damaged)?;
        let header = header as usize;
        if version == 0 || header > MAX_HEADER || rest.len() < header + 32 {
            return Err(damaged());
        }
        let (checksum, payload) = rest[header..].split_at(32);
        if blake3::hash(payload).as_bytes() != checksum {
            return Err(damaged());
        }
        Ok(payload)
    }

    /// The error of a file whose content makes no sense.
    pub(crate) fn damaged(&self, file: &Path) -> Error {
        Error::DataFile { file: file.into(), reason: format!("it is damaged or cut off; {}.", self.remedy) }
    }
}

/// Writes `bytes` beside their place and renames them, so that no reader sees half of them.
///
/// # Errors
/// [`Error::Io`] where the system refuses it; an earlier file is then as it was.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = std::fs::File::create(&part)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&part, path));
    written.map_err(|e| {
        let _ = std::fs::remove_file(&part);
        Error::io(path, e)
    })
}

fn split_u32(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (number, rest) = bytes.split_first_chunk::<4>()?;
    Some((u32::from_le_bytes(*number), rest))
}
