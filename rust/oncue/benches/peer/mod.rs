//! The same work for a peer: what a bench has just done, written to `out/bench/NAME`, is done there once more by a script
//! of `tools/peers`, which checks that it comes to the same and prints its figures beside ours.
//!
//! Peers run only where `ONCUE_PEERS` names a Python that has them (`nox -s bench` sets it), after our own measurement
//! and never at the same time, with as many threads as we had.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// A folder of arrays: raw little-endian numbers, `NAME.f32` and `NAME.u32`.
pub struct Work {
    python: PathBuf,
    folder: PathBuf,
}

impl Work {
    /// An empty folder, or `None` where there are no peers.
    pub fn new(name: &str) -> Option<Self> {
        let python = std::env::var_os("ONCUE_PEERS")?.into();
        let folder = root().join("out/bench").join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("a folder");
        Some(Self { python, folder })
    }

    pub fn floats(&self, name: &str, numbers: &[f32]) {
        self.write(&format!("{name}.f32"), numbers.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    pub fn counts(&self, name: &str, numbers: impl IntoIterator<Item = u32>) {
        self.write(&format!("{name}.u32"), numbers.into_iter().flat_map(u32::to_le_bytes).collect());
    }

    fn write(&self, name: &str, bytes: Vec<u8>) {
        fs::write(self.folder.join(name), bytes).expect("a file");
    }

    /// Runs `tools/peers/SCRIPT FOLDER`; `facts` are the shapes it needs and our own figures (`facts.json`).
    pub fn run(&self, script: &str, facts: &Value) {
        self.write("facts.json", facts.to_string().into_bytes());
        let threads = rayon::current_num_threads().to_string();
        let mut command = Command::new(&self.python);
        command.arg(root().join("tools/peers").join(script)).arg(&self.folder);
        // A shell that holds numpy to one thread would hold the peers to it too.
        for name in ["OPENBLAS_NUM_THREADS", "OPENBLAS_MAIN_FREE", "OPENBLAS_CORETYPE", "GOTO_NUM_THREADS"] {
            command.env_remove(name);
        }
        for name in ["OMP_NUM_THREADS", "MKL_NUM_THREADS"] {
            command.env(name, &threads);
        }
        let status = command.status().expect("the Python that ONCUE_PEERS names");
        assert!(status.success(), "{script} failed");
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}
