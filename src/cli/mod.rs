//! Arguments to jobs, progress, reports. Uses the public API of the other rooms only.

use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the command line and returns the process exit code.
pub fn main(_args: impl IntoIterator<Item = OsString>) -> ExitCode {
    ExitCode::SUCCESS
}
