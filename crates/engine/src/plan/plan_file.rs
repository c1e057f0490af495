//! The plan file: input, options and tasks, with a digest. It never changes once written.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::artifact::OBJECTS;
use super::difference::{by_place, difference};
use super::digest::Digest;
use super::files::{self, InputFile};
use super::kind::{PlanStep, PlannedWork};
use super::manifest::no_folder;
use super::report::{Forecast, PlanNeeds};
use crate::skip_bad::Skipped;
use crate::{REVISION, json};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::limits;
use terrane_files::atomic::{AtomicFile, is_temporary, refuse_stdout};

/// File name in the folder.
pub const PLAN: &str = "plan.json";
/// Maximum size of a plan file: enough for millions of tasks and a million files.
const MAX_BYTES: u64 = 1 << 30;
/// Folder of the points after stages, which the tasks read.
pub const POINTS: &str = "points";

/// Kind of a plan's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PlanKind {
    /// A mesh.
    Tin,
    /// A mesh of a point cloud.
    Cloud,
    /// A grid.
    Grid,
    /// Tiles in global coordinates.
    Tiles,
    /// Tiles of points.
    Points,
}

impl PlanKind {
    /// The output, which exists once the plan is finished.
    pub fn made<T>(self, made: Option<T>) -> Result<T> {
        let lost =
            || Error::new(ErrorKind::Internal, format!("a run ended without {}", self.what()));
        made.ok_or_else(lost)
    }

    /// The output, in words.
    pub fn what(self) -> &'static str {
        match self {
            Self::Tin => "a mesh of a grid",
            Self::Cloud => "a mesh of a point cloud",
            Self::Grid => "a grid",
            Self::Tiles => "tiles",
            Self::Points => "points",
        }
    }
}

/// A plan.
#[derive(Clone, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct PlanManifest<W: PlannedWork> {
    #[serde(flatten)]
    maker: PlanHeader,
    /// The user's name of the input, for messages only.
    pub label: String,
    /// Options and input of its tasks.
    #[serde(flatten)]
    pub work: W,
    files: Vec<InputFile>,
    /// Estimated resources.
    pub needs: PlanNeeds,
    /// Damaged files that are left out of the input.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// Common head of all plans: kind and program version.
#[derive(Clone, Serialize, Deserialize)]
struct PlanHeader {
    kind: PlanKind,
    terrane: String,
    revision: u32,
}

/// A plan with its digest, as stored.
#[derive(Serialize, Deserialize)]
struct PlanWithDigest<P> {
    plan_id: Digest,
    plan: P,
}

/// Kind of the plan in `folder`.
///
/// # Errors
/// The folder has no plan.
pub fn kind(folder: &Path) -> Result<PlanKind> {
    let named = serde_json::from_slice::<PlanWithDigest<PlanHeader>>(&text_of(folder)?);
    named.map(|named| named.plan.kind).map_err(|e| bad(folder, &e.to_string()))
}

/// The text of the plan file in a folder.
fn text_of(folder: &Path) -> Result<Vec<u8>> {
    let path = folder.join(PLAN);
    if !path.exists() {
        let what = "does not hold a plan";
        let error = if folder.exists() { Error::bad_input(what) } else { Error::not_found(what) };
        return Err(error.in_file(folder).remedy(
            "make one with ‹terrane plan tin›, ‹terrane plan tiles›, ‹terrane plan grid› or ‹terrane plan points›",
        ));
    }
    let fail = |e| Error::read(&path, e);
    let bytes = std::fs::metadata(&path).map_err(fail)?.len();
    limits::check("the size of the plan in bytes", bytes, MAX_BYTES)
        .map_err(|e| e.in_file(&path))?;
    std::fs::read(&path).map_err(fail)
}

/// The error for a file that is not a plan.
fn bad(folder: &Path, how: &str) -> Error {
    Error::bad_input(format!("is not a valid plan: {how}"))
        .in_file(&folder.join(PLAN))
        .remedy("make a new plan in another folder")
}

impl PlanHeader {
    /// Fails if the plan was made by another version of the program.
    fn check_version(&self, folder: &Path) -> Result<()> {
        let theirs = (self.terrane.as_str(), self.revision);
        let ours = (env!("CARGO_PKG_VERSION"), REVISION);
        if theirs == ours {
            return Ok(());
        }
        let [theirs, ours] = [theirs, ours]
            .map(|(version, revision)| format!("terrane {version} (revision {revision})"));
        Err(Error::bad_input(format!("was made by {theirs}, this is {ours}"))
            .in_file(&folder.join(PLAN))
            .remedy("use the same version, or make a new plan in another folder"))
    }
}

impl<W: PlannedWork> PlanManifest<W> {
    /// Plans `work` on an input that the user calls `label`: the files of `paths` with their companion files. `skipped`
    /// files were left out.
    pub fn new(
        work: W,
        (label, paths): (String, Vec<PathBuf>),
        needs: PlanNeeds,
        skipped: &[Skipped],
    ) -> Result<Self> {
        let files = files::stat(&files::with_companions(paths))?;
        let terrane = env!("CARGO_PKG_VERSION").to_owned();
        let maker = PlanHeader { kind: W::KIND, terrane, revision: REVISION };
        Ok(Self { maker, label, work, files, needs, skipped: skipped.to_vec() })
    }

    /// Reads the plan in `folder` with its digest.
    pub fn read(folder: &Path) -> Result<(Self, Digest)> {
        let text = text_of(folder)?;
        // The header first: all else may have another form in another version.
        let made: PlanWithDigest<PlanHeader> =
            serde_json::from_slice(&text).map_err(|e| bad(folder, &e.to_string()))?;
        made.plan.check_version(folder)?;
        let PlanWithDigest { plan_id, plan } =
            serde_json::from_slice::<PlanWithDigest<Self>>(&text)
                .map_err(|e| bad(folder, &e.to_string()))?;
        if plan.id() != plan_id {
            return Err(bad(folder, "digest mismatch"));
        }
        plan.work.check().map_err(|e| bad(folder, &e.to_string()))?;
        Ok((plan, plan_id))
    }

    /// The existing plan of a folder, if it is of this kind and version. Its input statistics can be reused: `put`
    /// compares the rest, the files by their digests.
    pub fn existing(folder: &Path) -> Option<Self> {
        let (plan, _) = Self::read(folder).ok()?;
        (plan.maker.kind == W::KIND).then_some(plan)
    }

    /// The identifying digest. Excludes measured times, which vary from run to run, and the label of the input: plans
    /// of one request have one digest.
    fn id(&self) -> Digest {
        let needs = PlanNeeds { seconds: [0.0; 2], ..self.needs.clone() };
        let request = Self { needs, label: String::new(), ..self.clone() };
        Digest::of(json::to_string(&request).unwrap_or_default().as_bytes())
    }

    /// The text of the plan file.
    fn to_text(&self) -> Result<String> {
        let sealed = PlanWithDigest { plan_id: self.id(), plan: self };
        json::to_string_pretty(&sealed)
            .map_err(|e| Error::new(ErrorKind::Internal, format!("cannot serialize the plan: {e}")))
    }

    /// Estimated resources of the tasks that are `left`.
    pub(super) fn forecast(&self, left: &[PlanStep<W::Task>]) -> Forecast {
        let all = self.work.tasks().into_iter().map(|task| self.work.size(PlanStep::Task(task)));
        let tasks = left.iter().filter(|step| **step != PlanStep::Finish);
        let tasks: u64 = tasks.map(|task| self.work.size(*task)).sum();
        let share = tasks as f64 / all.sum::<u64>().max(1) as f64;
        self.needs.forecast(share, left.contains(&PlanStep::Finish))
    }

    /// The input files.
    pub fn files(&self) -> impl Iterator<Item = Cow<'_, Path>> {
        self.files.iter().map(InputFile::path)
    }

    /// Fails if an input file has changed; the error names the file and the difference. Compares digests if
    /// `by_content` is set, else sizes and times only.
    pub(super) fn check_files(&self, by_content: bool) -> Result<()> {
        files::check(&self.files, by_content)
    }

    /// Writes the plan into the folder `path`, which is created if missing; accepts a folder with an equal plan. Fails
    /// with `Usage` if the folder has other contents.
    pub fn put(&self, path: &Path) -> Result<()> {
        if path.join(PLAN).exists() {
            return self.check_same(path);
        }
        let fail = |e| Error::write(path, e);
        make_folder(path)?;
        refuse_others(path)?;
        std::fs::create_dir_all(path.join(OBJECTS)).map_err(fail)?;
        let mut file = AtomicFile::create(&path.join(PLAN), false)?;
        file.write_all(self.to_text()?.as_bytes())
            .map_err(|e| Error::write(&path.join(PLAN), e))?;
        file.commit().map(drop)
    }

    /// Fails if the folder `path` holds another plan.
    fn check_same(&self, path: &Path) -> Result<()> {
        let of = kind(path)?;
        let how = match of == W::KIND {
            true => self.changes(Self::read(path)?.0),
            false => Some(format!("it is for {}", of.what())),
        };
        how.map_or(Ok(()), |how| {
            Err(Error::usage(format!("holds another plan: {how}"))
                .in_file(path)
                .remedy("choose another folder, or remove this one"))
        })
    }

    /// The first difference in the request from the plan `there`, as a message. Ignores skipped files, as the plan
    /// covers the remaining ones. Compares files by resolved paths.
    fn changes(&self, there: Self) -> Option<String> {
        let (skipped, label) = (there.skipped.clone(), there.label.clone());
        let mut here = Self { skipped, label, ..self.clone() };
        here.needs.seconds = there.needs.seconds;
        let files = there.files.iter().zip(&mut here.files);
        files.for_each(|(there, here)| here.forgive_time(there));
        difference(&by_place(&there), &by_place(&here))
    }
}

/// Fails for a folder that holds neither a plan nor what may lie in a folder before its plan.
///
/// # Errors
/// A folder with other contents, or that cannot be read.
pub fn refuse_others(path: &Path) -> Result<()> {
    if path.join(PLAN).exists() || !path.exists() {
        return Ok(());
    }
    let mut entries = std::fs::read_dir(path).map_err(|e| Error::read(path, e))?.flatten();
    match entries.any(|entry| !is_left_over(&entry.file_name())) {
        false => Ok(()),
        true => Err(Error::usage("is not empty and does not hold a plan")
            .in_file(path)
            .remedy("choose an empty or new folder")),
    }
}

/// True for what lies in a folder before its plan is written: points, and what an interrupted attempt left.
fn is_left_over(name: &OsStr) -> bool {
    name == OBJECTS || name == POINTS || name.to_str().is_some_and(is_temporary)
}

/// Fails if `path` is a file.
pub fn refuse_file(path: &Path) -> Result<()> {
    match path.exists() && !path.is_dir() {
        true => Err(Error::usage("is a file, not a folder")
            .in_file(path)
            .remedy("name a new or existing folder")),
        false => Ok(()),
    }
}

/// Creates the folder `path` unless it exists. Never creates its parents, as the path may be mistyped.
fn make_folder(path: &Path) -> Result<()> {
    refuse_stdout(path)?;
    refuse_file(path)?;
    match std::fs::create_dir(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(no_folder(path, error)),
        made => made.map_err(|e| Error::write(path, e)),
    }
}
