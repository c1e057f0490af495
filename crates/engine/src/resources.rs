//! Resources of a job: memory, threads and a folder for temporary files.

use crate::options::{ByteSizeText, FileName};
use terrane_files::{cores, physical_memory, proc_bytes};
use terrane_options::{OptionRange, Options};

/// Resources of a job
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Resources", setters = group)]
pub struct Resources {
    /// Worker threads
    #[option(value = "N", default = cores(), default_text = "all cores", range = OptionRange::new(1.0, 1024.0), role = Run)]
    pub threads: usize,
    /// Memory limit of the whole job, such as 512M or 4GiB
    #[option(value = "SIZE", with = ByteSizeText, default = default_memory(), role = Run, no_setter,
             default_text = "half of the machine's memory, at most 4GiB")]
    pub memory: u64,
    /// Folder for temporary files
    #[option(value = "DIR", with = FileName, role = Run,
             default_text = "the folder of the output; the system's without an output and to unpack inputs")]
    pub temp_dir: Option<std::path::PathBuf>,
}

const DEFAULT_MEMORY: u64 = 4 << 30;

fn default_memory() -> u64 {
    physical_memory().map_or(DEFAULT_MEMORY, |all| (all / 2).min(DEFAULT_MEMORY))
}

/// Peak resident memory of this process so far, in bytes, if the system reports it.
pub fn peak_memory() -> Option<u64> {
    proc_bytes("/proc/self/status", "VmHWM:")
}
