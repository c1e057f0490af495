//! Plans: work written down in a folder, to be done in pieces, by anyone, and resumed. One engine for
//! every kind of plan; what a kind's tasks are, and what one does, it says itself (`Work`).
//!
//! | name | what |
//! |---|---|
//! | `plan.json` | the plan |
//! | `objects/` | the result of each task that is done |
//! | `finished.json` | where the result is written, and its digest once it is there |
//! | `lock` | held by whoever does all that is left in the folder |

mod any;
mod digest;
mod files;
mod folder;
mod object;
mod output;
mod planned;
mod report;
mod run;
mod sheet;
mod work;

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

pub use any::{Division, Plan as AnyPlan, PlanRun, PlanStatus, RunOptions, RunSetters};
pub use digest::Digest;
pub use files::with_companions;
pub use folder::Survey;
pub use planned::{PlannedGrid, grid_files};
pub use report::{DiskCheck, Forecast, RunReport, StatusReport, TaskReport, Told, Written};
pub use report::{Needs, shared};
pub use run::{Form, PlanJob, RunJob};
pub use run::{run, run_in, run_named, status};
pub use sheet::{Kind, kind};
pub use sheet::{PLAN, Plan, refuse_file};
pub use work::{At, Made, Named, Numbered, Order, Work};

use crate::Cancel;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::atomic::AtomicFile;
use terrane_files::{name_of, path_of};

/// What [`Divisible`](crate::operation::Divisible) asks of an operation whose plans are of this kind of work.
#[macro_export]
macro_rules! planned_as {
    ($work:ty, $status:ty, $done:ty) => {
        const KIND: $crate::plan::Kind = <$work as $crate::plan::Work>::KIND;
        type Status = $status;
        type Done = $done;

        fn status(folder: &Path) -> Result<$crate::plan::StatusReport<$status>> {
            $crate::plan::status::<$work>(folder)
        }

        fn run_plan(
            job: &$crate::plan::RunJob,
            progress: &dyn $crate::Progress,
            cancel: &$crate::Cancel,
        ) -> Result<$crate::plan::RunReport<$done>> {
            $crate::plan::run_named::<$work>(job, progress, cancel)
        }
    };
}

/// Most tasks of a plan.
pub const MOST_TASKS: u64 = 1 << 22;
/// The folder of objects.
const OBJECTS: &str = "objects";
/// Bytes of a result that are read at a time.
const PIECE_BYTES: usize = 1 << 20;

/// How thoroughly results are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// What stands for the rest.
    Quick,
    /// Every byte.
    Whole,
}

/// The error of an object that is not what was written.
pub fn damaged_object(path: &Path) -> Error {
    Error::new(ErrorKind::Io, "is damaged")
        .in_file(path)
        .remedy("run the plan, which makes it anew: ‹terrane plan run›")
}

/// The error of what cannot be made because the folder it belongs in is not there.
fn no_folder(path: &Path, error: io::Error) -> Error {
    Error::write(path, error)
        .remedy(format!("make {} first, or correct the name", parent(path).display()))
}

/// Fails when what was found in the input (`there`) is not what it is `here`, so that it is not the
/// `what` of that label.
pub fn refuse_another<T: Serialize>(what: &str, label: &str, there: &T, here: &T) -> Result<()> {
    let refuse = |how| {
        Err(Error::bad_input(format!("is not the {what} the plan was made for: {how}"))
            .in_file(Path::new(label))
            .remedy("put it back, or plan anew in another folder"))
    };
    difference(there, here).map_or(Ok(()), refuse)
}

/// Writes a small file as JSON.
pub fn write_json<T: Serialize>(path: &Path, what: &T) -> Result<()> {
    let mut file = AtomicFile::create(path, true)?;
    let written = serde_json::to_writer_pretty(&mut file, what).map_err(io::Error::from);
    written.map_err(|e| Error::write(path, e))?;
    file.commit().map(drop)
}

/// A path that can be noted: absolute.
pub fn noted_path(output: &Path) -> Result<PathBuf> {
    let path = std::path::absolute(output).map_err(|e| Error::write(output, e))?;
    Ok(path)
}

/// Of the bytes of files, one after the other.
pub fn digest_of(files: &[PathBuf], cancel: &Cancel) -> Result<Digest> {
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
fn kept(error: Error) -> Error {
    match error.kind() {
        ErrorKind::Interrupted => {
            Error::new(ErrorKind::Interrupted, "interrupted; finished tasks are kept")
                .remedy("run again to go on")
        }
        _ => error,
    }
}

/// The folder that a file is in.
fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A thing in which each file is known by where it really is, links followed, as far as that can be told here.
fn by_place<T: Serialize>(thing: &T) -> Value {
    let mut told = serde_json::to_value(thing).unwrap_or_default();
    resolve(&mut told);
    told
}

/// Resolves paths in texts: all of one, or what follows the name of a format.
fn resolve(value: &mut Value) {
    match value {
        Value::Array(all) => all.iter_mut().for_each(resolve),
        Value::Object(all) => all.values_mut().for_each(resolve),
        Value::String(text) => {
            let Some(begin) = text.find('/') else { return };
            let place = std::fs::canonicalize(&*path_of(&text[begin..])).ok();
            if let Some(place) = place.and_then(|place| name_of(place).ok()) {
                text.replace_range(begin.., &place);
            }
        }
        Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}

/// The first value in which two things differ, by its name in both.
fn difference<T: Serialize>(there: &T, here: &T) -> Option<String> {
    let [there, here] = [there, here].map(|thing| serde_json::to_value(thing).unwrap_or_default());
    first_difference("", &there, &here)
}

fn first_difference(name: &str, there: &Value, here: &Value) -> Option<String> {
    if there == here {
        return None;
    }
    let within = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    if let (Value::Object(a), Value::Object(b)) = (there, here) {
        let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
        let [of_a, of_b] = [a, b].map(|own| |key: &String| own.get(key).unwrap_or(&Value::Null));
        return keys
            .into_iter()
            .find_map(|key| first_difference(&within(key), of_a(key), of_b(key)));
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
        assert_eq!(tell(r#"{"a":1}"#, r#"{"a":1,"b":2}"#), "b is null there and 2 here");
        assert_eq!(tell(r#"{"a":1,"b":null}"#, r#"{"a":1}"#), "");
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
