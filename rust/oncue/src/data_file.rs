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
use std::path::{Path, PathBuf};

use crate::error::{Error, FileFault, Result};

/// Longer headers are damage.
const MAX_HEADER: usize = 1 << 16;

/// A kind of file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FileKind {
    pub magic: &'static [u8; 8],
    /// The versions that are read: whoever unpacks one has an arm for each, and a committed file of each to hold it against.
    pub oldest: u32,
    /// The newest of them, and the one that is written.
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

    /// The version and the payload of a file's bytes; `file` is for the error.
    ///
    /// # Errors
    /// [`Error::DataFile`] where the bytes are foreign, too new, too old, cut off or damaged.
    pub(crate) fn unpack<'a>(&self, bytes: &'a [u8], file: &Path) -> Result<(u32, &'a [u8])> {
        let refuse = |fault, reason| Error::DataFile { file: file.into(), fault, reason };
        let damaged = || self.damaged(file);
        let rest = bytes
            .strip_prefix(self.magic)
            .ok_or_else(|| refuse(FileFault::Foreign, format!("it is not an Oncue {}.", self.name)))?;
        let (version, rest) = split_u32(rest).ok_or_else(damaged)?;
        if version > self.version {
            let newer = format!(
                "it was made by a newer Oncue (format {version}, this one reads up to {}); update Oncue.",
                self.version
            );
            return Err(refuse(FileFault::Newer, newer));
        }
        if version < self.oldest {
            let older = format!(
                "it was made by an older Oncue (format {version}, this one reads from {} on); {}.",
                self.oldest, self.remedy
            );
            return Err(refuse(FileFault::Older, older));
        }
        let (header, rest) = split_u32(rest).ok_or_else(damaged)?;
        let header = header as usize;
        if header > MAX_HEADER || rest.len() < header + 32 {
            return Err(damaged());
        }
        let (checksum, payload) = rest[header..].split_at(32);
        if blake3::hash(payload).as_bytes() != checksum {
            return Err(damaged());
        }
        Ok((version, payload))
    }

    /// The error of a file whose content makes no sense.
    pub(crate) fn damaged(&self, file: &Path) -> Error {
        let reason = format!("it is damaged or cut off; {}.", self.remedy);
        Error::DataFile { file: file.into(), fault: FileFault::Damaged, reason }
    }
}

/// Writes `bytes` beside their place and renames them, so that no reader sees half of them.
///
/// # Errors
/// [`Error::Io`] where the system refuses it; an earlier file is then as it was.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let (part, mut file) = new_part(path).map_err(|e| Error::io(path, e))?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    drop(file);
    written.and_then(|()| std::fs::rename(&part, path)).map_err(|e| {
        let _ = std::fs::remove_file(&part);
        Error::io(path, e)
    })?;
    // The name must outlast a power cut as the bytes do; where a folder cannot be synced there is nothing to be done.
    #[cfg(unix)]
    let _ = sync_folder_of(path);
    Ok(())
}

/// Has what is in a file's folder outlast a power cut.
#[cfg(unix)]
fn sync_folder_of(path: &Path) -> std::io::Result<()> {
    // A bare name lies in the current folder, whose name is not empty to the system.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::File::open(folder)?.sync_all()
}

/// A new file beside `path` that nobody else writes, and no link of somebody else's.
fn new_part(path: &Path) -> std::io::Result<(PathBuf, std::fs::File)> {
    let mut last = std::io::Error::from(std::io::ErrorKind::AlreadyExists);
    for attempt in 0..PARTS {
        let mut name = path.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}-{attempt}.part", std::process::id()));
        let part = path.with_file_name(name);
        match std::fs::File::create_new(&part) {
            Ok(file) => return Ok((part, file)),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => last = error,
            Err(error) => return Err(error),
        }
    }
    Err(last)
}

/// So many parts of one file may lie about.
const PARTS: usize = 64;

fn split_u32(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (number, rest) = bytes.split_first_chunk::<4>()?;
    Some((u32::from_le_bytes(*number), rest))
}

/// A committed file of an earlier Oncue, by its name. With `ONCUE_WRITE_GOLDEN` one that is not there is written first: the
/// bytes of now, for a version that is new.
#[cfg(test)]
pub(crate) fn golden(name: &str, now: &[u8]) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("ONCUE_WRITE_GOLDEN").is_some() && !path.exists() {
        std::fs::write(&path, now).expect("a folder that can be written");
    }
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: FileKind =
        FileKind { magic: b"ONCUETST", oldest: 2, version: 3, name: "test", remedy: "make it again" };

    fn fault(bytes: &[u8]) -> (FileFault, String) {
        match KIND.unpack(bytes, Path::new("there")) {
            Err(Error::DataFile { fault, reason, .. }) => (fault, reason),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn newer_older_foreign_and_damaged_are_four_sentences() {
        let with = |version: u32| FileKind { version, ..KIND }.pack("made by hand", b"payload");
        for version in [2, 3] {
            let bytes = with(version);
            assert_eq!(KIND.unpack(&bytes, Path::new("there")).expect("read"), (version, &b"payload"[..]));
        }
        let said = [fault(&with(4)), fault(&with(1)), fault(b"PNG"), fault(&with(3)[..30])];
        let faults = said.each_ref().map(|(fault, _)| *fault);
        assert_eq!(faults, [FileFault::Newer, FileFault::Older, FileFault::Foreign, FileFault::Damaged]);
        for ((_, sentence), part) in said.iter().zip([
            "made by a newer Oncue (format 4, this one reads up to 3); update",
            "made by an older Oncue (format 1, this one reads from 2 on); make it again.",
            "not an Oncue test",
            "damaged or cut off; make it again.",
        ]) {
            assert!(sentence.contains(part), "{sentence}");
        }
    }

    #[test]
    fn a_file_is_written_beside_what_others_left() {
        let folder = std::env::temp_dir().join(format!("oncue-parts-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("kept");
        // A part of this very process's name, and one that leads elsewhere.
        let part = |attempt: usize| folder.join(format!("kept.{}-{attempt}.part", std::process::id()));
        std::fs::write(part(0), b"left").expect("written");
        #[cfg(unix)]
        std::os::unix::fs::symlink(folder.join("elsewhere"), part(1)).expect("linked");
        write_whole(&path, b"whole").expect("written");
        assert_eq!(std::fs::read(&path).expect("read"), b"whole");
        assert_eq!(std::fs::read(part(0)).expect("read"), b"left");
        assert!(!folder.join("elsewhere").exists());
        std::fs::remove_dir_all(&folder).expect("removed");
    }

    #[cfg(unix)]
    #[test]
    fn through_a_linked_folder_it_is_written_where_that_leads_and_a_link_in_its_place_gives_way() {
        let folder = std::env::temp_dir().join(format!("oncue-links-{}", std::process::id()));
        let real = folder.join("real");
        std::fs::create_dir_all(&real).expect("a folder");
        let linked = folder.join("linked");
        std::os::unix::fs::symlink(&real, &linked).expect("linked");
        write_whole(&linked.join("kept"), b"one").expect("written");
        assert_eq!(std::fs::read(real.join("kept")).expect("read"), b"one");
        assert!(linked.is_symlink());
        // What a link in its place leads to is somebody else's.
        let others = folder.join("others");
        std::fs::write(&others, b"others").expect("written");
        std::os::unix::fs::symlink(&others, real.join("link")).expect("linked");
        write_whole(&linked.join("link"), b"two").expect("written");
        assert_eq!(std::fs::read(&others).expect("read"), b"others");
        assert!(!real.join("link").is_symlink());
        // Nothing is left beside them, and a folder that leads nowhere is an error of its own name.
        assert_eq!(std::fs::read_dir(&real).expect("a folder").count(), 2);
        std::fs::remove_dir_all(&real).expect("removed");
        let error = write_whole(&linked.join("kept"), b"three").expect_err("nowhere");
        assert!(error.to_string().contains("kept"), "{error}");
        std::fs::remove_dir_all(&folder).expect("removed");
    }

    #[cfg(unix)]
    #[test]
    fn the_folder_of_a_file_is_synced_wherever_it_is() {
        let folder = std::env::temp_dir().join(format!("oncue-sync-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let linked = folder.join("linked");
        std::os::unix::fs::symlink(&folder, &linked).expect("linked");
        for path in [folder.join("kept"), linked.join("kept"), PathBuf::from("kept"), PathBuf::from("./kept")]
        {
            sync_folder_of(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
        assert!(sync_folder_of(&folder.join("gone/kept")).is_err());
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
