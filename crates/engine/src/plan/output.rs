//! The output of a plan: its path, whether it is unaltered, and whether it may be replaced.
//!
//! The output record (`finished.json`) holds the path, relative if it is inside the folder, so that a folder may be
//! moved. It also holds the digest, which distinguishes altered, missing, unfinished and foreign outputs.

use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::artifact::CheckDepth;
use super::digest::{Digest, digest_of};
use super::manifest::{no_folder, noted_path, write_json};
use super::report::LastOutput;
use crate::Cancel;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::atomic::refuse_existing;
use terrane_files::{folder_for, name_of, path_of};
use terrane_mesh::split;

/// File name of the record.
pub(super) const FINISHED: &str = "finished.json";

/// Record of the last output, finished or not.
#[derive(Serialize, Deserialize)]
struct OutputRecord<R> {
    plan_id: Digest,
    /// Relative to the plan folder if inside it, so that the folder may be moved; else absolute.
    path: String,
    /// Output options that are not part of the plan.
    form: Value,
    /// `None` until the output is finished.
    finished: Option<FinishedOutput<R>>,
}

#[derive(Serialize, Deserialize)]
struct FinishedOutput<R> {
    #[serde(flatten)]
    facts: FileStamp,
    digest: Digest,
    report: R,
}

/// Metadata of files that needs no reading.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
struct FileStamp {
    bytes: u64,
    /// Latest modification time of the files, in nanoseconds since 1970.
    modified: u64,
}

/// State of an output.
enum OutputState<R> {
    /// Never written by this plan.
    Unknown,
    /// Begun by a run that was interrupted or is still active.
    Begun,
    /// Unaltered, with its report.
    Whole(R),
    /// Written, but missing.
    Missing,
    /// Written, but altered since.
    Altered(String),
}

/// Location of a plan's output.
pub(super) struct PlanOutput {
    folder: PathBuf,
    plan: Digest,
    /// Path as given.
    pub(super) path: PathBuf,
    absolute: PathBuf,
    form: Value,
}

impl PlanOutput {
    /// The output of the plan in `folder`; `form` holds the output options. Fails if the path cannot be recorded.
    pub(super) fn new(folder: &Path, plan: Digest, path: &Path, form: Value) -> Result<Self> {
        let absolute = noted_path(path)?;
        Ok(Self { folder: folder.to_path_buf(), plan, path: path.to_path_buf(), absolute, form })
    }

    /// State of the output; a quick check trusts modification times. Fails only when cancelled.
    fn state<R: DeserializeOwned>(
        &self,
        depth: CheckDepth,
        cancel: &Cancel,
    ) -> Result<OutputState<R>> {
        let note = note::<R>(&self.folder).filter(|note| {
            (note.plan_id, &note.form) == (self.plan, &self.form)
                && place(&self.folder, &note.path).is_ok_and(|path| path == self.absolute)
        });
        let Some(note) = note else { return Ok(OutputState::Unknown) };
        let Some(finished) = note.finished else { return Ok(OutputState::Begun) };
        if self.absolute.symlink_metadata().is_err() {
            return Ok(OutputState::Missing);
        }
        match finished.difference(&self.absolute, depth, cancel) {
            Ok(None) => Ok(OutputState::Whole(finished.report)),
            Ok(Some(how)) => Ok(OutputState::Altered(how)),
            Err(error) if error.kind() == ErrorKind::Interrupted => Err(error),
            // What cannot be read is not what was written.
            Err(error) => Ok(OutputState::Altered(error.to_string())),
        }
    }

    /// The report of an unaltered output, and whether an existing file may be replaced: an unfinished output may, any
    /// file with `overwrite`. Fails early where the run would fail at its end: if the folder is missing, or a file
    /// exists that may not be replaced.
    pub(super) fn claim<R: DeserializeOwned>(
        &self,
        overwrite: bool,
        cancel: &Cancel,
    ) -> Result<(Option<R>, bool)> {
        let may_replace = match self.state(CheckDepth::Whole, cancel)? {
            OutputState::Whole(report) => return Ok((Some(report), overwrite)),
            OutputState::Altered(how) if !overwrite => {
                return Err(Error::usage(format!("changed since the plan wrote it: {how}"))
                    .in_file(&self.path)
                    .remedy("pass ‹overwrite› to replace it, or choose another name"));
            }
            state => overwrite || matches!(state, OutputState::Begun),
        };
        if !folder_for(&self.path, None).is_dir() {
            return Err(no_folder(&self.path, std::io::ErrorKind::NotFound.into()));
        }
        refuse_existing(&self.path, may_replace)?;
        Ok((None, may_replace))
    }

    /// Records that the output is begun.
    pub(super) fn begin(&self) -> Result<()> {
        self.write::<()>(None)
    }

    /// Records that the output is finished.
    pub(super) fn finish<R: Serialize>(&self, report: R, cancel: &Cancel) -> Result<()> {
        let files = files(&self.absolute)?;
        let (facts, digest) = (FileStamp::of(&files)?, digest_of(&files, cancel)?);
        self.write(Some(FinishedOutput { facts, digest, report }))
    }

    fn write<R: Serialize>(&self, finished: Option<FinishedOutput<R>>) -> Result<()> {
        let folder =
            std::path::absolute(&self.folder).map_err(|e| Error::write(&self.folder, e))?;
        let path = self.absolute.strip_prefix(folder).unwrap_or(&self.absolute);
        let path = name_of(path.to_path_buf())?;
        let note = OutputRecord { plan_id: self.plan, path, form: self.form.clone(), finished };
        write_json(&self.folder.join(FINISHED), &note)
    }
}

impl<R> FinishedOutput<R> {
    /// The difference between the files at `path` and the written ones, if any.
    fn difference(
        &self,
        path: &Path,
        depth: CheckDepth,
        cancel: &Cancel,
    ) -> Result<Option<String>> {
        let files = files(path)?;
        let here = FileStamp::of(&files)?;
        if here.bytes != self.facts.bytes {
            return Ok(Some(format!(
                "size changed from {} to {} bytes",
                self.facts.bytes, here.bytes
            )));
        }
        if depth == CheckDepth::Quick && here == self.facts {
            return Ok(None);
        }
        let is_same = digest_of(&files, cancel)? == self.digest;
        Ok((!is_same).then(|| "content changed".to_owned()))
    }
}

impl FileStamp {
    fn of(files: &[PathBuf]) -> Result<Self> {
        files.iter().try_fold(Self { bytes: 0, modified: 0 }, |all, path| {
            let meta = std::fs::metadata(path).and_then(|meta| Ok((meta.modified()?, meta.len())));
            let (time, bytes) = meta.map_err(|e| Error::read(path, e))?;
            let time = time.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
            Ok(Self { bytes: all.bytes + bytes, modified: all.modified.max(time) })
        })
    }
}

/// The last output of the plan in `folder` for the report: its path if it is unaltered, else its fault. Checks quickly.
pub(super) fn last_output(folder: &Path, plan: Digest) -> Result<LastOutput> {
    let note = note::<Value>(folder).filter(|note| note.plan_id == plan);
    let Some(note) = note else { return Ok(LastOutput::default()) };
    let output = PlanOutput::new(folder, plan, &place(folder, &note.path)?, note.form)?;
    let path = output.absolute.display().to_string();
    let (output, output_fault) =
        match output.state::<Value>(CheckDepth::Quick, &Cancel::default())? {
            OutputState::Whole(_) => (Some(path), None),
            OutputState::Missing => (None, Some(format!("{path} is missing"))),
            OutputState::Altered(how) => {
                (None, Some(format!("{path} changed since it was written: {how}")))
            }
            OutputState::Unknown | OutputState::Begun => (None, None),
        };
    Ok(LastOutput { output, output_fault })
}

fn note<R: DeserializeOwned>(folder: &Path) -> Option<OutputRecord<R>> {
    let text = std::fs::read(folder.join(FINISHED)).ok()?;
    serde_json::from_slice(&text).ok()
}

/// The absolute path of a recorded one.
fn place(folder: &Path, noted: &str) -> Result<PathBuf> {
    std::path::absolute(folder.join(path_of(noted))).map_err(|e| Error::read(folder, e))
}

/// The files of a result: for a folder of meshes those of its index, for other folders all.
fn files(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]);
    }
    if let Ok(files) = split::files(path) {
        return Ok(files);
    }
    let (mut files, mut folders) = (Vec::new(), vec![path.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        let fail = |e| Error::read(&folder, e);
        for entry in std::fs::read_dir(&folder).map_err(fail)? {
            let entry = entry.map_err(fail)?;
            // The type of the entry itself. `is_dir` of a path follows links, and one that leads upwards would
            // be walked for ever.
            let is_folder = entry.file_type().map_err(fail)?.is_dir();
            if is_folder { &mut folders } else { &mut files }.push(entry.path());
        }
    }
    files.sort();
    Ok(files)
}
