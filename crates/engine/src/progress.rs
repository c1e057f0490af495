//! Progress of a job, reported to a watcher.

use terrane_cloud::PointSource;

/// Receives progress reports of a job; called from several threads.
pub trait Progress: Sync {
    /// A stage begins, with its name and total number of units (samples, triangles, bytes).
    fn begin(&self, stage: &str, total: u64);
    /// `units` more are done in the current stage.
    fn advance(&self, units: u64);
    /// A part of a file will be read next; called if the input has several files.
    fn file(&self, _file: FileAt<'_>) {}
    /// The current stage is over.
    fn end(&self);
}

/// One of several input files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileAt<'a> {
    /// Its name as found.
    pub name: &'a str,
    /// Its number in the order of names, from 1.
    pub number: usize,
    /// Number of files.
    pub of: usize,
}

impl<'a> FileAt<'a> {
    /// The file of a part of a point cloud with several files.
    pub fn new(source: &'a dyn PointSource, part: usize) -> Option<Self> {
        let files = source.files();
        let number = source.file_of(part).filter(|_| files.len() > 1)?;
        Some(Self { name: files.get(number)?, number: number + 1, of: files.len() })
    }

    /// Reports that a part of a point cloud will be read next.
    pub fn report_part(progress: &dyn Progress, source: &dyn PointSource, part: usize) {
        if let Some(file) = FileAt::new(source, part) {
            progress.file(file);
        }
    }
}

/// Progress that is discarded.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
}
