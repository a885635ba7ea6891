//! Tests that need reference data: where it is absent they are reported as ignored, with what they need, and never as passed.
//!
//! The standard harness decides what it ignores when it is compiled. Files of such tests have `harness = false`, and a
//! `main` that hands their tests to [`run`].

#![allow(dead_code)]

use std::path::Path;
use std::process::ExitCode;

use libtest_mimic::{Arguments, Trial, run as run_trials};

/// A test of the part of the reference data whose path it is given.
pub fn needs(part: &str, name: &str, test: fn(&Path)) -> Trial {
    let path = crate::common::shared(part);
    let kind = if path.is_none() { format!("no {part}: set ONCUE_SHARED") } else { String::new() };
    let absent = path.is_none();
    let run = move || {
        let path = path.ok_or("the reference data is absent")?;
        test(&path);
        Ok(())
    };
    Trial::test(name, run).with_kind(kind).with_ignored_flag(absent)
}

/// A test that needs none.
pub fn always(name: &str, test: fn()) -> Trial {
    let run = move || {
        test();
        Ok(())
    };
    Trial::test(name, run)
}

/// Runs the tests as the standard harness would, with its arguments.
pub fn run(tests: Vec<Trial>) -> ExitCode {
    run_trials(&Arguments::from_args(), tests).exit_code()
}
