//! `-`: stdin and stdout, for formats that are read and written sequentially.
//!
//! Input is collected in a temporary file, because readers need random access, and output is complete before
//! its first byte is written: a failed run writes nothing. These files have arbitrary names, so all messages go
//! through [`display`].

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use tempfile::TempDir;

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::{Cancel, Resources};
use terrane_files::atomic;
use terrane_files::name_of;
use terrane_raster::Inputs;
use terrane_vector as vector;

/// The name of stdin.
const STDIN: &str = "-";
/// The same as a point cloud.
const CLOUD: &str = "cloud:-";

/// Bytes of stdin per read.
const CHUNK: usize = 1 << 18;
/// Number of buffered chunks.
const CHUNKS: usize = 4;
/// Interval of checks for cancellation while waiting.
const PATIENCE: Duration = Duration::from_millis(50);

/// Content of a pipe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PipeContent<'a> {
    /// A grid: XYZ.
    Grid,
    /// Points as text.
    Points,
    /// Features, in the named format or one detected from the first bytes.
    Features(Option<&'a str>),
}

impl PipeContent<'_> {
    /// True for a name of stdin with this content.
    fn is_named(self, name: &str) -> bool {
        name == STDIN || (self == PipeContent::Points && name == CLOUD)
    }
}

/// Stdin as a temporary file.
pub(crate) struct StdinFile<'a> {
    file: Option<GatheredStdin>,
    holds: PipeContent<'a>,
}

/// The temporary file of stdin.
struct GatheredStdin {
    _folder: TempDir,
    path: PathBuf,
}

impl<'a> StdinFile<'a> {
    /// Creates an empty file if one of `names` is stdin, and replaces the name. Other inputs should be checked
    /// before the data is [gathered](Self::gather).
    pub(crate) fn expect(
        names: &mut [String],
        holds: PipeContent<'a>,
        resources: &Resources,
    ) -> Result<Self> {
        if names.iter().filter(|name| holds.is_named(name)).count() > 1 {
            return Err(Error::usage("stdin can be read only once").remedy("name - once"));
        }
        let Some(name) = names.iter_mut().find(|name| holds.is_named(name)) else {
            return Ok(Self { file: None, holds });
        };
        let (folder, mut path) = place(resources, "stdin")?;
        match holds {
            PipeContent::Grid | PipeContent::Points => path.set_extension("xyz"),
            PipeContent::Features(Some(name)) => {
                path.set_extension(streamed(vector::by_path(&path, Some(name))?, "read")?)
            }
            PipeContent::Features(None) => false,
        };
        File::create(&path).map_err(|e| Error::write(&path, e))?;
        *name = name_of(path.clone())?;
        Ok(Self { file: Some(GatheredStdin { _folder: folder, path }), holds })
    }

    /// True if an input is stdin.
    pub(crate) fn is_read(&self) -> bool {
        self.file.is_some()
    }

    /// Fails if an input is stdin, for an `option` that reads the input repeatedly.
    pub(crate) fn refuse(&self, option: &str) -> Result<()> {
        if !self.is_read() {
            return Ok(());
        }
        Err(Error::usage(format!(
            "{option} is not supported with stdin (it reads the input twice)"
        ))
        .in_file(Path::new(STDIN))
        .remedy(format!("name a file, or leave {option} out")))
    }

    /// Reads stdin if it is among `names`. If the format is detected now, the file is renamed accordingly.
    pub(crate) fn gather(&mut self, names: &mut [String], cancel: &Cancel) -> Result<()> {
        let Some(GatheredStdin { path, .. }) = &mut self.file else { return Ok(()) };
        if fill(path, cancel)? == 0 {
            return Err(Error::bad_input("is empty")
                .in_file(Path::new(STDIN))
                .remedy("pipe a file in"));
        }
        if self.holds != PipeContent::Features(None) {
            return Ok(());
        }
        let format = vector::identify(path)?.ok_or_else(|| {
            Error::usage("format of stdin is unknown")
                .remedy(format!("pass --input-format: {}", known()))
        })?;
        let named = path.with_extension(streamed(format, "read")?);
        std::fs::rename(&*path, &named).map_err(|e| Error::write(&named, e))?;
        let (old, new) = (name_of(path.clone())?, name_of(named.clone())?);
        names.iter_mut().filter(|name| **name == old).for_each(|name| name.clone_from(&new));
        *path = named;
        Ok(())
    }

    /// Inputs of a job with their names for messages.
    pub(crate) fn inputs(&self, names: Vec<String>) -> Inputs {
        let inputs = Inputs::from(names);
        if !self.is_read() {
            return inputs;
        }
        let label = display(&inputs.to_string()).into_owned();
        Inputs::labelled(inputs.names().to_vec(), label)
    }
}

/// Writes stdin to the file at `path`; returns the size.
fn fill(path: &Path, cancel: &Cancel) -> Result<u64> {
    let mut file = File::create(path).map_err(|e| Error::write(path, e))?;
    let (chunks, mut bytes) = (chunks_of_stdin(), 0);
    loop {
        cancel.check()?;
        let chunk = match chunks.recv_timeout(PATIENCE) {
            Ok(chunk) => chunk.map_err(|e| Error::io(ErrorKind::Io, "read stdin", e))?,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::new(ErrorKind::Internal, "the stdin reader stopped"));
            }
        };
        if chunk.is_empty() {
            return Ok(bytes);
        }
        file.write_all(&chunk).map_err(|e| Error::write(path, e))?;
        bytes += chunk.len() as u64;
    }
}

/// Chunks of stdin, the last one empty: read by a thread, because a blocking read cannot be cancelled.
fn chunks_of_stdin() -> Receiver<io::Result<Vec<u8>>> {
    let (sender, receiver) = sync_channel(CHUNKS);
    std::thread::spawn(move || {
        let mut stdin = io::stdin().lock();
        loop {
            let mut chunk = Vec::with_capacity(CHUNK);
            let read = (&mut stdin).take(CHUNK as u64).read_to_end(&mut chunk);
            let is_last = chunk.is_empty() || read.is_err();
            if sender.send(read.map(|_| chunk)).is_err() || is_last {
                return;
            }
        }
    });
    receiver
}

/// Extension of a format that can be read and written sequentially.
fn streamed(format: &vector::VectorFormat, done: &str) -> Result<&'static str> {
    if vector::STREAMED.contains(&format.name) {
        return Ok(format.extensions[0]);
    }
    Err(Error::usage(format!("{} cannot be {done} through a pipe", format.name))
        .in_file(Path::new(STDIN))
        .remedy(format!("name a file, or use one of {}", known())))
}

fn known() -> String {
    vector::STREAMED.join(", ")
}

/// A vector file that is written to stdout when it is complete.
pub(crate) struct StdoutFile {
    _folder: TempDir,
    path: PathBuf,
}

impl StdoutFile {
    /// Replaces `output` by a temporary file if it is stdout.
    pub(crate) fn take(
        output: &mut PathBuf,
        format: Option<&str>,
        resources: &Resources,
    ) -> Result<Option<Self>> {
        if !atomic::is_stdout(output) {
            return Ok(None);
        }
        let ending = streamed(vector::by_path(output, format)?, "written")?;
        let (folder, path) = place(resources, "stdout")?;
        *output = path.with_extension(ending);
        Ok(Some(Self { _folder: folder, path: output.clone() }))
    }

    /// Writes the file to stdout.
    pub(crate) fn pour(&self) -> Result<()> {
        let mut file = File::open(&self.path).map_err(|e| Error::read(&self.path, e))?;
        match io::copy(&mut file, &mut io::stdout().lock()) {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
                Err(Error::io(ErrorKind::Io, "write to stdout", e))
            }
            _ => Ok(()),
        }
    }
}

/// Paths without extensions of the temporary files of stdin and stdout.
static PLACES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// A file `name` in a temporary folder, shown as `-` from now on.
fn place(resources: &Resources, name: &str) -> Result<(TempDir, PathBuf)> {
    let around = resources.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
    // Some messages have absolute paths.
    let folder = std::path::absolute(&around)
        .and_then(|around| tempfile::Builder::new().prefix("terrane-").tempdir_in(around))
        .map_err(|e| Error::write(&around, atomic::plain(e)))?;
    let path = folder.path().join(name);
    let shown = path.display().to_string();
    // As escaped in JSON, if different.
    let quoted = serde_json::Value::from(shown.as_str()).to_string();
    let mut places = terrane_files::lock(&PLACES);
    places.extend([quoted.trim_matches('"').to_owned(), shown]);
    Ok((folder, path))
}

/// Replaces temporary files of stdin and stdout by `-` in a text.
pub(crate) fn display(text: &str) -> Cow<'_, str> {
    let places = terrane_files::lock(&PLACES);
    places.iter().fold(Cow::Borrowed(text), |text, place| match text.contains(place) {
        true => Cow::Owned(without(place, &text)),
        false => text,
    })
}

/// Replaces each path `place` with an extension by a dash.
fn without(place: &str, text: &str) -> String {
    let mut parts = text.split(place);
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, rest| {
        let rest = rest.strip_prefix('.').unwrap_or(rest);
        text + atomic::STDOUT + rest.trim_start_matches(|c: char| c.is_ascii_alphanumeric())
    })
}

/// Fails when an input is stdin.
pub(crate) fn refuse_input(name: &str) -> Result<()> {
    if name != STDIN && name != CLOUD {
        return Ok(());
    }
    Err(Error::usage("stdin is not supported here").in_file(Path::new(name)).remedy("name a file"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn temporary_names_are_told_as_a_dash() {
        let tell = |text| without("/t/terrane-a/stdin", text);
        assert_eq!(tell("/t/terrane-a/stdin.xyz: line 3: is bad"), "-: line 3: is bad");
        assert_eq!(tell(r#"{"a":"/t/terrane-a/stdin","b":1}"#), r#"{"a":"-","b":1}"#);
        assert_eq!(tell("a and /t/terrane-a/stdin.wkt, /t/terrane-a/stdin.csv."), "a and -, -.");
    }
}
