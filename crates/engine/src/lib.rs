//! What every job is made with: memory, threads and progress, options and operations, plans, files beside the input.

// The derive of options names this crate.
extern crate self as terrane_engine;

pub mod bands;
pub mod beside;
pub mod breaklines;
pub mod disk;
pub mod figures;
pub mod geoid;
pub mod globe;
pub mod ground;
pub mod input;
pub mod kept;
pub mod memory;
pub mod on_cloud;
pub mod operation;
pub mod options;
pub mod outputs;
pub mod placing;
pub mod plan;
pub mod proof;
pub mod reading;
pub mod sift;
pub mod transform;
pub mod water;
pub mod workers;

use options::{Bytes, FileName};
pub use terrane_base::Cancel;
use terrane_cloud::PointSource;
use terrane_files::{cores, physical_memory, proc_bytes};
use terrane_options::{Options, Range};

/// Changed whenever the same job would write other bytes, or a plan has another form: plans of another
/// revision are not gone on with. `tests/golden.rs` holds it to that.
pub const REVISION: u32 = 17;

/// Receives a job's progress; called from several threads.
pub trait Progress: Sync {
    /// A stage begins: its name and its total number of units (samples, triangles, bytes).
    fn begin(&self, stage: &str, total: u64);
    /// `units` more are done in the current stage.
    fn advance(&self, units: u64);
    /// A part of a file is about to be read, where the input is of several.
    fn file(&self, _file: FileAt<'_>) {}
    /// The current stage is over.
    fn end(&self);
}

/// One of the files of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileAt<'a> {
    /// As it was found.
    pub name: &'a str,
    /// In the order of names, from 1.
    pub number: usize,
    /// How many files there are.
    pub of: usize,
}

impl<'a> FileAt<'a> {
    /// The file of a part of a cloud of several.
    pub fn new(source: &'a dyn PointSource, part: usize) -> Option<Self> {
        let files = source.files();
        let number = source.file_of(part).filter(|_| files.len() > 1)?;
        Some(Self { name: files.get(number)?, number: number + 1, of: files.len() })
    }

    /// Tells that a part of a cloud is about to be read.
    pub fn tell(progress: &dyn Progress, source: &dyn PointSource, part: usize) {
        if let Some(file) = FileAt::new(source, part) {
            progress.file(file);
        }
    }
}

/// Progress that is not shown.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
}

/// What a job may use
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Resources", setters = group)]
pub struct Resources {
    /// Worker threads
    #[option(value = "N", default = cores(), default_text = "all cores", range = Range::new(1.0, 1024.0), role = Run)]
    pub threads: usize,
    /// Memory for everything the job holds, such as 512M or 4GiB
    #[option(value = "SIZE", with = Bytes, default = default_memory(), role = Run, no_setter,
             default_text = "half of the machine's, at most 4GiB")]
    pub memory: u64,
    /// Folder for temporary files
    #[option(value = "DIR", with = FileName, role = Run,
             default_text = "the output's, or the system's where there is none and for inputs that must be unpacked")]
    pub temp_dir: Option<std::path::PathBuf>,
}

const DEFAULT_MEMORY: u64 = 4 << 30;

fn default_memory() -> u64 {
    physical_memory().map_or(DEFAULT_MEMORY, |all| (all / 2).min(DEFAULT_MEMORY))
}

/// Largest resident memory of this process so far, in bytes, where the system tells.
pub fn peak_memory() -> Option<u64> {
    proc_bytes("/proc/self/status", "VmHWM:")
}
