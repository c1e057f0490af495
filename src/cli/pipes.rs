//! `-`: stdin and stdout, for formats that are read and written from front to back.
//!
//! What comes in is gathered in a temporary file, because everything else here reads by position, and
//! what goes out is complete before its first byte is written: a failed run writes nothing.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::error::{Error, ErrorKind, Result};
use crate::files::name_of;
use crate::pipeline::Resources;
use crate::raster::Inputs;
use crate::vector;

/// The name of stdin and stdout.
pub(super) const DASH: &str = "-";

/// What is in a pipe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Holds<'a> {
    /// A grid: XYZ.
    Grid,
    /// Points as text.
    Points,
    /// Features, in the format of this name or else known by its first bytes.
    Features(Option<&'a str>),
}

/// Stdin as a file; it goes with the value.
pub(super) struct Stdin {
    _folder: Option<TempDir>,
    path: Option<PathBuf>,
}

impl Stdin {
    /// Gathers stdin where one of `names` stands for it, and puts the file's name there.
    pub(super) fn take(
        names: &mut [String],
        holds: Holds<'_>,
        resources: &Resources,
    ) -> Result<Self> {
        let dash = |name: &String| name == DASH || (holds == Holds::Points && name == "cloud:-");
        if names.iter().filter(|name| dash(name)).count() > 1 {
            return Err(Error::usage("stdin can be read only once").remedy("name - once"));
        }
        let Some(name) = names.iter_mut().find(|name| dash(name)) else {
            return Ok(Self { _folder: None, path: None });
        };
        let folder = folder(resources)?;
        let path = gather(folder.path(), holds)?;
        *name = name_of(path.clone())?;
        Ok(Self { _folder: Some(folder), path: Some(path) })
    }

    /// True where an input is stdin.
    pub(super) fn is_read(&self) -> bool {
        self.path.is_some()
    }

    /// Inputs of a job, told as `-` where they are stdin: the temporary name is another each time.
    pub(super) fn inputs(&self, names: Vec<String>) -> Inputs {
        match (&self.path, names.len()) {
            (Some(_), 1) => Inputs::labelled(names, DASH.to_owned()),
            _ => names.into(),
        }
    }

    /// Calls the temporary file what the user does.
    pub(super) fn named(&self, error: Error) -> Error {
        let is_it = self.path.is_some() && error.path() == self.path.as_deref();
        if is_it { error.renamed(Path::new(DASH)) } else { error }
    }
}

/// Stdin in a file of `folder`, under an ending that tells its format.
fn gather(folder: &Path, holds: Holds<'_>) -> Result<PathBuf> {
    let path = folder.join("stdin");
    let fail = |e| Error::io(ErrorKind::Io, "read stdin", e);
    let mut file = File::create(&path).map_err(|e| Error::write(&path, e))?;
    if io::copy(&mut io::stdin().lock(), &mut file).map_err(fail)? == 0 {
        return Err(Error::bad_input("is empty").in_file(Path::new(DASH)).remedy("pipe a file in"));
    }
    let ending = match holds {
        Holds::Grid | Holds::Points => "xyz",
        Holds::Features(Some(name)) => streamed(vector::by_path(&path, Some(name))?, "read")?,
        Holds::Features(None) => match vector::identify(&path)? {
            Some(format) => streamed(format, "read")?,
            None => {
                return Err(Error::usage("nothing says what format stdin has")
                    .remedy(format!("name it with --input-format: {}", known())));
            }
        },
    };
    let named = path.with_extension(ending);
    std::fs::rename(&path, &named).map_err(|e| Error::write(&named, e))?;
    Ok(named)
}

/// The ending of a format, unless it cannot come or go through a pipe.
fn streamed(format: &vector::VectorFormat, done: &str) -> Result<&'static str> {
    if vector::STREAMED.contains(&format.name) {
        return Ok(format.extensions[0]);
    }
    Err(Error::usage(format!("{} cannot be {done} through a pipe", format.name))
        .in_file(Path::new(DASH))
        .remedy(format!("name a file, or use one of {}", known())))
}

fn known() -> String {
    vector::STREAMED.join(", ")
}

/// A file of features that is written to stdout once it is complete.
pub(super) struct Stdout {
    _folder: TempDir,
    path: PathBuf,
}

impl Stdout {
    /// Where `output` is stdout: puts the name of a temporary file there.
    pub(super) fn take(
        output: &mut PathBuf,
        format: Option<&str>,
        resources: &Resources,
    ) -> Result<Option<Self>> {
        if *output != Path::new(DASH) {
            return Ok(None);
        }
        let ending = streamed(vector::by_path(output, format)?, "written")?;
        let folder = folder(resources)?;
        let path = folder.path().join("stdout").with_extension(ending);
        output.clone_from(&path);
        Ok(Some(Self { _folder: folder, path }))
    }

    /// Writes the file to stdout.
    pub(super) fn pour(&self) -> Result<()> {
        let mut file = File::open(&self.path).map_err(|e| Error::read(&self.path, e))?;
        match io::copy(&mut file, &mut io::stdout().lock()) {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
                Err(Error::io(ErrorKind::Io, "write to stdout", e))
            }
            _ => Ok(()),
        }
    }
}

fn folder(resources: &Resources) -> Result<TempDir> {
    let place = resources.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
    let made = tempfile::Builder::new().prefix("terrane-").tempdir_in(&place);
    made.map_err(|e| Error::write(&place, e))
}

/// Fails when a file would be called `-`.
pub(super) fn refuse_output(path: &Path) -> Result<()> {
    if path != Path::new(DASH) {
        return Ok(());
    }
    Err(Error::usage("stdout is not written to here")
        .in_file(path)
        .remedy(format!("name a file; line and contour write {} to stdout", known())))
}

/// Fails when an input is stdin.
pub(super) fn refuse_input(name: &str) -> Result<()> {
    if name != DASH {
        return Ok(());
    }
    Err(Error::usage("stdin is not read here")
        .in_file(Path::new(name))
        .remedy("name a file; tin, convert and contour read XYZ, grid points and line features"))
}
