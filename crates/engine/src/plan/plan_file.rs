//! The plan on paper: what is made from what, under a digest. It never changes once written.

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

/// Its file in the folder.
pub const PLAN: &str = "plan.json";
/// Largest plan that is read: millions of tasks and a million files fit.
const MAX_BYTES: u64 = 1 << 30;

/// What a folder holds a plan of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PlanKind {
    /// A mesh.
    Tin,
    /// A mesh of a cloud.
    Cloud,
    /// A grid.
    Grid,
    /// Tiles of the globe.
    Tiles,
    /// Squares of points.
    Points,
}

impl PlanKind {
    /// What was made, which is there at the end.
    pub fn made<T>(self, made: Option<T>) -> Result<T> {
        let lost =
            || Error::new(ErrorKind::Internal, format!("a run ended without {}", self.what()));
        made.ok_or_else(lost)
    }

    /// What comes of it, in words.
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
    /// What the user called the input; people are told, and nothing depends on it.
    pub label: String,
    /// What its tasks do.
    #[serde(flatten)]
    pub work: W,
    files: Vec<InputFile>,
    /// What they take.
    pub needs: PlanNeeds,
    /// Files that are left out of the input because they are bad.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

/// What every plan begins with: of what it is, and which version of the program made it.
#[derive(Clone, Serialize, Deserialize)]
struct PlanHeader {
    kind: PlanKind,
    terrane: String,
    revision: u32,
}

/// A plan with its digest, as it is on disk.
#[derive(Serialize, Deserialize)]
struct PlanWithDigest<P> {
    plan_id: Digest,
    plan: P,
}

/// What the plan in `folder` is of.
///
/// # Errors
/// A folder without a plan.
pub fn kind(folder: &Path) -> Result<PlanKind> {
    let named = serde_json::from_slice::<PlanWithDigest<PlanHeader>>(&text_of(folder)?);
    named.map(|named| named.plan.kind).map_err(|e| bad(folder, &e.to_string()))
}

/// The text of the plan in a folder.
fn text_of(folder: &Path) -> Result<Vec<u8>> {
    let path = folder.join(PLAN);
    if !path.exists() {
        let told = "does not hold a plan";
        let error = if folder.exists() { Error::bad_input(told) } else { Error::not_found(told) };
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

/// The error of a file that is no plan.
fn bad(folder: &Path, how: &str) -> Error {
    Error::bad_input(format!("is not a valid plan: {how}"))
        .in_file(&folder.join(PLAN))
        .remedy("make a new plan in another folder")
}

impl PlanHeader {
    /// Fails where it is another program than this one.
    fn check_version(&self, folder: &Path) -> Result<()> {
        let theirs = (self.terrane.as_str(), self.revision);
        let ours = (env!("CARGO_PKG_VERSION"), REVISION);
        if theirs == ours {
            return Ok(());
        }
        let name = |(version, revision)| format!("terrane {version} (revision {revision})");
        Err(Error::bad_input(format!("was made by {}, this is {}", name(theirs), name(ours)))
            .in_file(&folder.join(PLAN))
            .remedy("use the same version, or make a new plan in another folder"))
    }
}

impl<W: PlannedWork> PlanManifest<W> {
    /// The plan of `work` on an input that the user calls `label`: the files of `paths` and what lies beside them;
    /// `skipped` were left out.
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

    /// Reads the plan in `folder`; returns it with its digest.
    pub fn read(folder: &Path) -> Result<(Self, Digest)> {
        let (text, bad) = (text_of(folder)?, |how: &str| bad(folder, how));
        // Of another version all else may have another form.
        let made: PlanWithDigest<PlanHeader> =
            serde_json::from_slice(&text).map_err(|e| bad(&e.to_string()))?;
        made.plan.check_version(folder)?;
        let PlanWithDigest { plan_id, plan } =
            serde_json::from_slice::<PlanWithDigest<Self>>(&text)
                .map_err(|e| bad(&e.to_string()))?;
        if plan.id() != plan_id {
            return Err(bad("digest mismatch"));
        }
        plan.work.check().map_err(|e| bad(&e.to_string()))?;
        Ok((plan, plan_id))
    }

    /// The plan that a folder holds already, if it is one of this kind and version. What was seen of the input for it
    /// need not be seen again: `put` compares all else, the files by their digests.
    pub fn there(folder: &Path) -> Option<Self> {
        let (plan, _) = Self::read(folder).ok()?;
        (plan.maker.kind == W::KIND).then_some(plan)
    }

    /// The digest that stands for it. Times that were measured differ from run to run, and an input may be called
    /// in many ways, so both are left out: plans of one request have one digest.
    fn id(&self) -> Digest {
        let needs = PlanNeeds { seconds: [0.0; 2], ..self.needs.clone() };
        let request = Self { needs, label: String::new(), ..self.clone() };
        Digest::of(json::to_string(&request).unwrap_or_default().as_bytes())
    }

    /// The text of its file.
    fn to_text(&self) -> Result<String> {
        let sealed = PlanWithDigest { plan_id: self.id(), plan: self };
        json::to_string_pretty(&sealed)
            .map_err(|e| Error::new(ErrorKind::Internal, format!("cannot serialize the plan: {e}")))
    }

    /// What the tasks that are `left` take.
    pub(super) fn forecast(&self, left: &[PlanStep<W::Task>]) -> Forecast {
        let size = |task: &W::Task| self.work.size(PlanStep::Task(*task));
        let all: u64 = self.work.tasks().iter().map(size).sum();
        let is_task = |task: &&PlanStep<W::Task>| **task != PlanStep::Finish;
        let tasks: u64 = left.iter().filter(is_task).map(|task| self.work.size(*task)).sum();
        let share = tasks as f64 / all.max(1) as f64;
        self.needs.forecast(share, left.contains(&PlanStep::Finish))
    }

    /// What it is made from.
    pub fn files(&self) -> impl Iterator<Item = Cow<'_, Path>> {
        self.files.iter().map(InputFile::path)
    }

    /// Fails when one of its files is not what it was; the error names it and the difference. With
    /// `by_content` digests are compared, else only sizes and times.
    pub(super) fn check_files(&self, by_content: bool) -> Result<()> {
        files::check(&self.files, by_content)
    }

    /// Puts it into the folder `path`, made if it is not there; one that holds the very same plan is
    /// taken as it is. Fails with `Usage` when it holds anything else.
    pub fn put(&self, path: &Path) -> Result<()> {
        if path.join(PLAN).exists() {
            return self.check_same(path);
        }
        let fail = |e| Error::write(path, e);
        make_folder(path)?;
        // What an earlier attempt to plan here left is no reason to refuse.
        let is_own = |name: &OsStr| name == OBJECTS || name.to_str().is_some_and(is_temporary);
        let mut entries = std::fs::read_dir(path).map_err(fail)?.flatten();
        if entries.any(|entry| !is_own(&entry.file_name())) {
            return Err(Error::usage("is not empty and does not hold a plan")
                .in_file(path)
                .remedy("choose an empty or new folder"));
        }
        std::fs::create_dir_all(path.join(OBJECTS)).map_err(fail)?;
        let mut file = AtomicFile::create(&path.join(PLAN), false)?;
        file.write_all(self.to_text()?.as_bytes())
            .map_err(|e| Error::write(&path.join(PLAN), e))?;
        file.commit().map(drop)
    }

    /// Fails when the folder `path` holds another plan.
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

    /// The first thing in which this one asks for something else than `there`, as a line for people.
    /// What was left out is no such thing: the work is of what is left. Files are known by where they are, whatever
    /// leads there.
    fn changes(&self, there: Self) -> Option<String> {
        let (skipped, label) = (there.skipped.clone(), there.label.clone());
        let mut here = Self { skipped, label, ..self.clone() };
        here.needs.seconds = there.needs.seconds;
        let files = there.files.iter().zip(&mut here.files);
        files.for_each(|(there, here)| here.forgive_time(there));
        difference(&by_place(&there), &by_place(&here))
    }
}

/// Fails where a file is in place of the folder.
pub fn refuse_file(path: &Path) -> Result<()> {
    match path.exists() && !path.is_dir() {
        true => Err(Error::usage("is a file, not a folder")
            .in_file(path)
            .remedy("name a new or existing folder")),
        false => Ok(()),
    }
}

/// Makes the folder `path` unless it is there. Those above it are never made: a name that was mistyped
/// would only be found by who looks for the plan.
fn make_folder(path: &Path) -> Result<()> {
    refuse_stdout(path)?;
    refuse_file(path)?;
    match std::fs::create_dir(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(no_folder(path, error)),
        made => made.map_err(|e| Error::write(path, e)),
    }
}
