//! Sequential PNG writer for any pixel type, with a world file and a .prj sidecar.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};

use ::png::{BitDepth, ColorType, Encoder, EncodingError, StreamWriter};

use super::format::GridWriteRequest;
use super::sidecar::Sidecars;
use crate::grid::GridInfo;
use crate::tiled_tiff::metadata::number;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::atomic::AtomicFile;
use terrane_files::{lock, unlocked};

/// A PNG written from top to bottom, with its sidecars.
pub(super) struct PngCanvas {
    target: AtomicFile,
    sidecars: Sidecars,
    picture: Mutex<StreamWriter<'static, PngOutputFile>>,
    /// First write error, if any.
    cause: Cause,
}

impl PngCanvas {
    /// A PNG of the given pixel type; `transparent` is the gray value of transparent pixels.
    pub(super) fn new(
        order: &GridWriteRequest<'_>,
        pixels: (ColorType, BitDepth),
        transparent: Option<u16>,
    ) -> Result<Self> {
        let target = AtomicFile::create(order.path, order.options.overwrite)?;
        let sidecars = sidecars(order)?;
        let cause = Cause::default();
        let picture = Mutex::new(start(&target, order.info, (pixels, transparent), &cause)?);
        Ok(Self { target, sidecars, picture, cause })
    }

    pub(super) fn path(&self) -> &Path {
        self.target.path()
    }

    /// Appends pixels.
    pub(super) fn append(&self, bytes: &[u8]) -> Result<()> {
        let written = lock(&self.picture).write_all(bytes);
        written.map_err(|e| failed(self.target.path(), &self.cause, e))
    }

    /// Completes the file and its sidecars; returns the size in bytes.
    pub(super) fn finish(self) -> Result<u64> {
        let Self { mut target, sidecars, picture, cause } = self;
        unlocked(picture).finish().map_err(|e| failed(target.path(), &cause, e))?;
        check_end(&mut target).map_err(|e| Error::write(target.path(), e))?;
        sidecars.commit()?;
        target.commit()
    }
}

fn sidecars(order: &GridWriteRequest<'_>) -> Result<Sidecars> {
    let mut sidecars = Sidecars::new(order.path, order.options);
    if order.info.georeferenced {
        let map = order.info.transform;
        let numbers = [map.a, map.d, map.b, map.e, map.x0, map.y0].map(number);
        sidecars.add("pgw", &(numbers.join("\n") + "\n"))?;
    } else {
        sidecars.remove(&["pgw", "PGW", "pngw", "PNGW", "wld", "WLD"])?;
    }
    sidecars.add_prj(&order.info.crs)?;
    Ok(sidecars)
}

fn start(
    target: &AtomicFile,
    info: &GridInfo,
    ((colours, depth), transparent): ((ColorType, BitDepth), Option<u16>),
    cause: &Cause,
) -> Result<StreamWriter<'static, PngOutputFile>> {
    let path = target.path();
    let file = target.file().try_clone().map_err(|e| Error::write(path, e))?;
    let told = PngOutputFile { file, cause: cause.clone() };
    let mut encoder = Encoder::new(told, info.width, info.height);
    encoder.set_color(colours);
    encoder.set_depth(depth);
    if let Some(gray) = transparent {
        encoder.set_trns(gray.to_be_bytes().to_vec());
    }
    let started = encoder.write_header().and_then(|writer| writer.into_stream_writer());
    started.map_err(|e| failed(path, cause, e))
}

/// First error of a file.
type Cause = Arc<Mutex<Option<io::Error>>>;

/// A file that keeps its I/O error, of which the encoder only keeps the message.
struct PngOutputFile {
    file: File,
    cause: Cause,
}

impl PngOutputFile {
    fn with_path<T>(&self, done: io::Result<T>) -> io::Result<T> {
        done.map_err(|error| {
            let kind = error.kind();
            if kind != io::ErrorKind::Interrupted {
                lock(&self.cause).get_or_insert(error);
            }
            kind.into()
        })
    }
}

impl Write for PngOutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let done = self.file.write(bytes);
        self.with_path(done)
    }

    fn flush(&mut self) -> io::Result<()> {
        let done = self.file.flush();
        self.with_path(done)
    }
}

fn failed(path: &Path, cause: &Cause, error: impl Into<EncodingError>) -> Error {
    match (lock(cause).take(), error.into()) {
        (Some(e), _) | (None, EncodingError::IoError(e)) => Error::write(path, e),
        (None, other) => Error::new(ErrorKind::CannotWrite, other.to_string()).in_file(path),
    }
}

/// IEND chunk: length, name and checksum.
const LAST: [u8; 12] = [0, 0, 0, 0, b'I', b'E', b'N', b'D', 0xAE, 0x42, 0x60, 0x82];

/// Fails if the file does not end with IEND, because the encoder does not report that.
fn check_end(target: &mut AtomicFile) -> io::Result<()> {
    let mut last = [0; LAST.len()];
    target.seek(SeekFrom::End(-(LAST.len() as i64)))?;
    target.read_exact(&mut last)?;
    if last == LAST { Ok(()) } else { Err(io::ErrorKind::StorageFull.into()) }
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_told_with_its_remedy() {
        let cause = Cause::default();
        let file = File::options().write(true).open("/dev/full").unwrap();
        let mut encoder = Encoder::new(PngOutputFile { file, cause: cause.clone() }, 64, 64);
        encoder.set_depth(BitDepth::Eight);
        let error = encoder.write_header().err().expect("no room for a header");
        let error = failed(Path::new("a.png"), &cause, error);
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.to_string().contains("; free some space"), "{error}");
    }
}
