//! Plans: work written down in a folder, to be done in pieces, by anyone, and resumed. What is common
//! to the plans of meshes and of grids.
//!
//! | name | what |
//! |---|---|
//! | `plan.json` | the plan |
//! | `objects/` | the result of each task that is done |
//! | `finished.json` | where the result is written, and its digest once it is there |
//! | `lock` | held by whoever does all that is left in the folder |

mod digest;
mod files;
mod output;
mod report;

use std::ffi::OsStr;
use std::fmt;
use std::fs::{File, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use digest::Digest;
pub(crate) use files::{InputFile, check, look_at, with_companions};
pub(crate) use output::{Output, State, last_output};
pub(crate) use report::shared;
pub use report::{DiskCheck, Forecast, TaskReport, Told};

use crate::sift::Skipped;
use crate::{Cancel, REVISION};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::limits;
use terrane_files::atomic::{AtomicFile, is_temporary, refuse_stdout};

pub(crate) const PLAN: &str = "plan.json";
pub(crate) const OBJECTS: &str = "objects";
const FINISHED: &str = "finished.json";
const LOCK: &str = "lock";
/// Largest plan that is read: millions of tasks and a million files fit.
const MOST_BYTES: u64 = 1 << 30;
/// Bytes of a result that are read at a time.
const PIECE_BYTES: usize = 1 << 20;

/// Something that can be planned.
pub(crate) trait Planned: Serialize + DeserializeOwned + Clone {
    /// Of what: "tin" or "grid".
    const KIND: &'static str;

    /// The version and revision of the program that made it.
    fn made_by(&self) -> (&str, u32);

    /// Fails when the plan contradicts itself.
    fn check(&self) -> std::result::Result<(), String>;

    /// What it is made from.
    fn files(&self) -> &[InputFile];

    /// The same, to be changed.
    fn files_mut(&mut self) -> &mut [InputFile];

    /// Files that are left out of the input because they are bad.
    fn skipped(&self) -> &[Skipped];

    /// The same, to be changed.
    fn skipped_mut(&mut self) -> &mut Vec<Skipped>;
}

/// A plan with its digest, as it is on disk.
#[derive(Serialize, Deserialize)]
struct Sealed<P> {
    plan_id: Digest,
    plan: P,
}

/// What a folder holds a plan of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A mesh ([`tin`](crate::tin)).
    Tin,
    /// A grid ([`grid::plan`](crate::grid::plan)).
    Grid,
}

/// What the plan in `folder` is of.
///
/// # Errors
/// A folder without a plan.
pub fn kind(folder: &Path) -> Result<Kind> {
    #[derive(Deserialize)]
    struct Named {
        plan: Inner,
    }
    #[derive(Deserialize)]
    struct Inner {
        kind: String,
    }
    let path = folder.join(PLAN);
    let named: Named =
        serde_json::from_slice(&text_of(folder)?).map_err(|e| damaged(&path, &e.to_string()))?;
    match named.plan.kind.as_str() {
        "tin" => Ok(Kind::Tin),
        "grid" => Ok(Kind::Grid),
        other => Err(damaged(&path, &format!("nothing is known of plans of a {other:?}"))),
    }
}

/// The text of the plan in a folder.
fn text_of(folder: &Path) -> Result<Vec<u8>> {
    let path = folder.join(PLAN);
    if !path.exists() {
        return Err(Error::bad_input("holds no plan").in_file(folder).remedy(
            "make one: terrane plan tin GRID... or terrane plan grid CLOUD..., -o FOLDER",
        ));
    }
    let fail = |e| Error::read(&path, e);
    let bytes = std::fs::metadata(&path).map_err(fail)?.len();
    limits::check("bytes of a plan", bytes, MOST_BYTES).map_err(|e| e.in_file(&path))?;
    std::fs::read(&path).map_err(fail)
}

/// Reads the plan in `folder`; returns it with its digest.
pub(crate) fn read<P: Planned>(folder: &Path) -> Result<(P, Digest)> {
    let (text, path) = (text_of(folder)?, folder.join(PLAN));
    let Sealed { plan_id, plan } =
        serde_json::from_slice::<Sealed<P>>(&text).map_err(|e| damaged(&path, &e.to_string()))?;
    if id(&plan) != plan_id {
        return Err(damaged(&path, "its digest does not match"));
    }
    check_version(&plan, &path)?;
    plan.check().map_err(|how| damaged(&path, &how))?;
    Ok((plan, plan_id))
}

/// The digest that stands for a plan.
pub(crate) fn id<P: Planned>(plan: &P) -> Digest {
    Digest::of(&serde_json::to_vec(plan).unwrap_or_default())
}

/// A plan as the text of a file.
pub(crate) fn to_text<P: Planned>(plan: &P) -> Result<Vec<u8>> {
    let sealed = Sealed { plan_id: id(plan), plan };
    serde_json::to_vec_pretty(&sealed)
        .map_err(|e| Error::new(ErrorKind::Internal, format!("cannot write down the plan: {e}")))
}

fn check_version<P: Planned>(plan: &P, path: &Path) -> Result<()> {
    let (theirs, ours) = (plan.made_by(), (env!("CARGO_PKG_VERSION"), REVISION));
    if theirs == ours {
        return Ok(());
    }
    let name = |(version, revision)| format!("terrane {version} (revision {revision})");
    Err(Error::bad_input(format!("was made by {}, this is {}", name(theirs), name(ours)))
        .in_file(path)
        .remedy("use the same version, or plan anew in another folder"))
}

pub(crate) fn damaged(path: &Path, how: &str) -> Error {
    Error::bad_input(format!("is no plan as terrane writes it: {how}"))
        .in_file(path)
        .remedy("plan anew in another folder")
}

/// Puts `plan` into the folder `path`, made if it is not there; one that holds the very same plan is
/// taken as it is. Fails with `Usage` when it holds anything else.
pub(crate) fn put<P: Planned>(path: &Path, plan: &P) -> Result<()> {
    if path.join(PLAN).exists() {
        let of = kind(path)?;
        let another = |how: String| {
            Err(Error::usage(format!("holds another plan: {how}"))
                .in_file(path)
                .remedy("choose another folder, or remove this one"))
        };
        if format!("{of:?}").to_lowercase() != P::KIND {
            return another(format!("it is of a {of:?}").to_lowercase());
        }
        let (there, _) = read::<P>(path)?;
        return match changes(&there, plan) {
            None => Ok(()),
            Some(how) => another(how),
        };
    }
    let fail = |e| Error::write(path, e);
    make_folder(path)?;
    // What an earlier attempt to plan here left is no reason to refuse.
    let is_own = |name: &OsStr| name == OBJECTS || name.to_str().is_some_and(is_temporary);
    let mut entries = std::fs::read_dir(path).map_err(fail)?.flatten();
    if entries.any(|entry| !is_own(&entry.file_name())) {
        return Err(Error::usage("is not empty and holds no plan")
            .in_file(path)
            .remedy("choose another folder, or a name that is not there yet"));
    }
    std::fs::create_dir_all(path.join(OBJECTS)).map_err(fail)?;
    let mut file = AtomicFile::create(&path.join(PLAN), false)?;
    file.write_all(&to_text(plan)?).map_err(|e| Error::write(&path.join(PLAN), e))?;
    file.commit().map(drop)
}

/// Makes the folder `path` unless it is there. Those above it are never made: a name that was mistyped
/// would only be found by who looks for the plan.
fn make_folder(path: &Path) -> Result<()> {
    refuse_stdout(path)?;
    match std::fs::create_dir(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(no_folder(path, error)),
        made => made.map_err(|e| Error::write(path, e)),
    }
}

/// The error of what cannot be made because the folder it belongs in is not there.
fn no_folder(path: &Path, error: io::Error) -> Error {
    Error::write(path, error)
        .remedy(format!("make {} first, or correct the name", parent(path).display()))
}

/// The first thing in which `here` asks for something else than `there`, as a line for people. What was
/// left out is no such thing: the work is of what is left.
fn changes<P: Planned>(there: &P, here: &P) -> Option<String> {
    let mut here = here.clone();
    let files = there.files().iter().zip(here.files_mut());
    files.for_each(|(there, here)| here.forgive_time(there));
    here.skipped_mut().clear();
    here.skipped_mut().extend_from_slice(there.skipped());
    difference(there, &here)
}

/// Makes `folder` ready for work: for all that is left (`alone`), or for one task. Waits for nobody:
/// fails when another does all that is left. Single tasks take no lock, because results appear whole
/// and are the same whoever makes them; two who do everything would only do it twice. Where the file
/// system has no locks nothing is locked.
pub(crate) fn enter(folder: &Path, alone: bool) -> Result<Option<File>> {
    // Results may be thrown away, all at once too.
    let objects = folder.join(OBJECTS);
    std::fs::create_dir_all(&objects).map_err(|e| Error::write(&objects, e))?;
    if !alone {
        return Ok(None);
    }
    let path = folder.join(LOCK);
    let file = File::options().create(true).append(true).open(&path);
    let file = file.map_err(|e| Error::write(&path, e))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(Error::new(ErrorKind::NotYet, "others are at work in this folder")
                .in_file(folder)
                .remedy("try again when they are done, or do single tasks (--task)"))
        }
        _ => Ok(Some(file)),
    }
}

/// How thoroughly results are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// What stands for the rest.
    Quick,
    /// Every byte.
    Whole,
}

/// The error of a result in a plan's folder of results that is not what was written.
pub(crate) fn damaged_object(path: &Path) -> Error {
    let folder = parent(parent(path));
    Error::new(ErrorKind::Io, "is damaged")
        .in_file(path)
        .remedy(format!("it is made anew by terrane run {}", folder.display()))
}

/// The error of a task that is needed first.
pub(crate) fn not_done(folder: &Path, task: impl fmt::Display) -> Error {
    Error::new(ErrorKind::NotYet, format!("{task} is not done"))
        .in_file(folder)
        .remedy(format!("run it first: --task {task}"))
}

/// Fails when `output` is a file that a plan in `folder` was made from, or that the folder is made of.
pub(crate) fn refuse_own<P: Planned>(folder: &Path, plan: &P, output: &Path) -> Result<()> {
    let place = |path: &Path| std::fs::canonicalize(path);
    let Ok(output_place) = place(output) else { return Ok(()) };
    let is_it = |path: &Path| place(path).is_ok_and(|path| path == output_place);
    let own = [PLAN, FINISHED, LOCK].map(|name| folder.join(name));
    let is_object =
        place(&folder.join(OBJECTS)).is_ok_and(|objects| output_place.starts_with(objects));
    let mut inputs = plan.files().iter().map(InputFile::path);
    if is_object || own.iter().any(|path| is_it(path)) || inputs.any(is_it) {
        return Err(Error::usage("output is the input itself, or belongs to the plan")
            .in_file(output)
            .remedy("choose another name"));
    }
    Ok(())
}

/// Writes a small file as JSON.
pub(crate) fn write_json<T: Serialize>(path: &Path, what: &T) -> Result<()> {
    let mut file = AtomicFile::create(path, true)?;
    let written = serde_json::to_writer_pretty(&mut file, what).map_err(io::Error::from);
    written.map_err(|e| Error::write(path, e))?;
    file.commit().map(drop)
}

/// Paths in plans and notes: as names, so that any can be told.
pub(crate) mod as_name {
    use std::path::{Path, PathBuf};

    use serde::{Deserialize, Deserializer, Serializer, de, ser};

    use terrane_files::{name_of, path_of};

    pub(crate) fn serialize<S: Serializer>(path: &Path, out: S) -> Result<S::Ok, S::Error> {
        out.serialize_str(&name_of(path.to_path_buf()).map_err(ser::Error::custom)?)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<PathBuf, D::Error> {
        let name = String::deserialize(from)?;
        match name.contains('\0') {
            true => Err(de::Error::custom("a name holds a byte of 0")),
            false => Ok(path_of(&name).into_owned()),
        }
    }
}

/// A path that can be noted: absolute.
pub(crate) fn noted_path(output: &Path) -> Result<PathBuf> {
    let path = std::path::absolute(output).map_err(|e| Error::write(output, e))?;
    Ok(path)
}

/// Of the bytes of files, one after the other.
pub(crate) fn digest_of(files: &[PathBuf], cancel: &Cancel) -> Result<Digest> {
    let mut hasher = blake3::Hasher::new();
    let mut piece = vec![0; PIECE_BYTES];
    for path in files {
        let fail = |e| Error::read(path, e);
        let mut file = File::open(path).map_err(fail)?;
        loop {
            cancel.check()?;
            match file.read(&mut piece).map_err(fail)? {
                0 => break,
                bytes => hasher.update(&piece[..bytes]),
            };
        }
    }
    Ok(Digest(*hasher.finalize().as_bytes()))
}

/// An interrupted run says that its work is not lost.
pub(crate) fn kept(error: Error) -> Error {
    match error.kind() {
        ErrorKind::Interrupted => {
            Error::new(ErrorKind::Interrupted, "interrupted; finished tasks are kept")
                .remedy("run again to go on")
        }
        _ => error,
    }
}

/// The folder that a file is in.
pub(crate) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// The first value in which two things differ, by its name in both.
pub(crate) fn difference<T: Serialize>(there: &T, here: &T) -> Option<String> {
    let [there, here] = [there, here].map(|thing| serde_json::to_value(thing).unwrap_or_default());
    first_difference("", &there, &here)
}

fn first_difference(name: &str, there: &Value, here: &Value) -> Option<String> {
    if there == here {
        return None;
    }
    let within = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    if let (Value::Object(a), Value::Object(b)) = (there, here) {
        let inner = |(key, value): (&String, &Value)| {
            first_difference(&within(key), value, b.get(key).unwrap_or(&Value::Null))
        };
        return a.iter().find_map(inner);
    }
    if let (Value::Array(a), Value::Array(b)) = (there, here)
        && a.len() == b.len()
    {
        let mut pairs = a.iter().zip(b).enumerate();
        return pairs.find_map(|(i, (a, b))| first_difference(&within(&i.to_string()), a, b));
    }
    let short = |value: &Value| match value {
        Value::Array(items) => format!("{} of them", items.len()),
        other => other.to_string(),
    };
    Some(format!("{name} is {} there and {} here", short(there), short(here)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named() {
        let of = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        let tell = |a: &str, b: &str| difference(&of(a), &of(b)).unwrap_or_default();
        assert_eq!(
            tell(r#"{"a":{"b":1,"c":2}}"#, r#"{"a":{"b":1,"c":3}}"#),
            "a.c is 2 there and 3 here"
        );
        assert_eq!(
            tell(r#"{"f":["x","y"]}"#, r#"{"f":["x"]}"#),
            "f is 2 of them there and 1 of them here"
        );
        assert_eq!(
            tell(r#"{"f":["x","y"]}"#, r#"{"f":["x","z"]}"#),
            r#"f.1 is "y" there and "z" here"#
        );
        assert_eq!(tell("[1]", "[1]"), "");
    }
}
