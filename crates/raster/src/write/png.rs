//! PNG: heights packed into red, green and blue: terrain-RGB (steps of 0.1 from -10000) or terrarium
//! (steps of 1/256 from -32768), with a world file and .prj beside it. Voids are transparent. What other pictures share
//! with it is here, too.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};

use ::png::{BitDepth, ColorType, Encoder, EncodingError, StreamWriter};

use super::creation::Accepts::Words;
use super::gray::{self, GraySink};
use super::picture::PictureSink;
use super::rows::RowSink;
use super::sidecar::{self, Sidecars};
use super::{CreationOption, GridFormat, Order};
use crate::png::{PACKINGS, Packing};
use crate::store::header::number;
use crate::store::sample::Height;
use crate::{GridInfo, SampleType};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_files::atomic::AtomicFile;
use terrane_files::{lock, unlocked};

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "PNG",
    extensions: &["png"],
    about: "terrain-RGB, terrarium, or gray of 8 or 16 bits (‹type› uint8, uint16), with .pgw and .prj; scale and offset \
            are applied",
    options: &[
        CreationOption {
            key: "ENCODING",
            accepts: Words(&["TERRAIN-RGB", "TERRARIUM", "GRAY"]),
            about: "how heights are held [GRAY where ‹type› is uint8 or uint16 and of reliefs, else by the name of the \
                    file, else TERRAIN-RGB]",
        },
        CreationOption {
            key: "ALPHA",
            accepts: Words(&["YES", "NO"]),
            about: "transparent voids of packed heights [YES where the grid declares nodata]",
        },
    ],
    several_bands: false,
    holds_colours: true,
    holds_types: false,
    names_voids: true,
    bytes_per_sample: 24,
    create: |order| match (order.options.are_colours, gray::is_asked(order)?) {
        (true, _) => Ok(Box::new(PictureSink::new(order)?)),
        (_, true) => Ok(Box::new(GraySink::new(order)?)),
        (_, false) => Ok(Box::new(PngSink::new(order)?)),
    },
};

/// Greatest packed value.
const MOST: f64 = 16_777_215.0;
/// Heights this near to a step, in steps, are that step.
const HAIR: f64 = 1e-3;

/// A picture in the making.
struct PngSink {
    info: GridInfo,
    packing: &'static Packing,
    alpha: bool,
    round: bool,
    canvas: Canvas,
    notes: Vec<String>,
}

impl PngSink {
    fn new(order: &Order<'_>) -> Result<Self> {
        let options = order.options;
        if let Some(other) = options.sample_type {
            let message = format!(
                "PNG holds gray of uint8 or uint16, or packed heights, not {}",
                other.name()
            );
            return Err(
                Error::usage(message).remedy("leave ‹type› and ENCODING out, or ‹type› alone")
            );
        }
        if options.nodata.is_some() {
            return Err(Error::usage("voids of a PNG are transparent, and have no value")
                .remedy("leave ‹out_nodata› out"));
        }
        let packing = packing(order)?;
        let alpha = match order.creation.word("ALPHA") {
            Some(word) => word == "YES",
            None => order.info.nodata.is_some(),
        };
        let colours = if alpha { ColorType::Rgba } else { ColorType::Rgb };
        let canvas = Canvas::new(order, (colours, BitDepth::Eight), None)?;
        let (info, notes) = (order.info.clone(), notes(order, packing));
        let info = GridInfo { scale: packing.scale, offset: packing.offset, nodata: None, ..info };
        let info = GridInfo { sample_type: SampleType::U32, ..info };
        let round = options.round;
        Ok(Self { info, packing, alpha, round, canvas, notes })
    }

    fn void(&self) -> Result<[u8; 4]> {
        if self.alpha {
            return Ok([0; 4]);
        }
        Err(Error::bad_input("a void, but the picture has no transparency")
            .remedy("pass ‹co› ALPHA=YES"))
    }

    /// Red, green, blue and full opacity.
    fn pack<H: Height>(&self, height: H) -> Result<[u8; 4]> {
        let height = height.to_f64();
        let wanted = (height - self.packing.offset) / self.packing.scale;
        let step = wanted.round();
        let (name, scale) = (self.packing.name(), self.packing.scale);
        if !(0.0..=MOST).contains(&step) {
            let message = format!("the height {height} is beyond what {name} holds");
            return Err(Error::bad_input(message).remedy("write another format"));
        }
        let again = step * scale + self.packing.offset;
        let same = (step - wanted).abs() < HAIR || again as f32 == height as f32;
        if !same && !self.round {
            let message = format!("{name} holds steps of {scale}, and the height is {height}");
            return Err(Error::bad_input(message).remedy("pass ‹round› to store the nearest"));
        }
        let [_, red, green, blue] = (step as u32).to_be_bytes();
        Ok([red, green, blue, u8::MAX])
    }
}

/// By ENCODING, or else by the name, which readers go by too: the two must not contradict.
fn packing(order: &Order<'_>) -> Result<&'static Packing> {
    let named = Packing::named(order.path);
    let asked = order.creation.word("ENCODING");
    let asked =
        asked.and_then(|word| PACKINGS.iter().find(|p| word.eq_ignore_ascii_case(p.name())));
    match (asked, named) {
        (Some(asked), Some(named)) if asked != named => {
            let message = format!("the name says {}, and readers go by it", named.name());
            Err(Error::usage(message).remedy("choose another name or ENCODING"))
        }
        (asked, named) => Ok(asked.or(named).unwrap_or(&PACKINGS[0])),
    }
}

/// A picture that is written from above, with what lies beside it.
pub(super) struct Canvas {
    target: AtomicFile,
    sidecars: Sidecars,
    picture: Mutex<StreamWriter<'static, Told>>,
    /// Why the file could not be written, once that is so.
    cause: Cause,
}

impl Canvas {
    /// Of such pixels; `transparent` is the gray that is.
    pub(super) fn new(
        order: &Order<'_>,
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

    /// Puts the next pixels in their place.
    pub(super) fn append(&self, bytes: &[u8]) -> Result<()> {
        let written = lock(&self.picture).write_all(bytes);
        written.map_err(|e| failed(self.target.path(), &self.cause, e))
    }

    /// Completes the file and what lies beside it, and tells its size in bytes.
    pub(super) fn finish(self) -> Result<u64> {
        let Self { mut target, sidecars, picture, cause } = self;
        unlocked(picture).finish().map_err(|e| failed(target.path(), &cause, e))?;
        check_end(&mut target).map_err(|e| Error::write(target.path(), e))?;
        sidecars.commit()?;
        target.commit()
    }
}

fn sidecars(order: &Order<'_>) -> Result<Sidecars> {
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

fn notes(order: &Order<'_>, packing: &Packing) -> Vec<String> {
    let mut notes = sidecar::lost(order.info);
    if Packing::named(order.path).is_none() {
        let (name, path) = (packing.name().to_lowercase(), order.path.display());
        notes.push(format!("the name does not tell the encoding: read it as {name}:{path}"));
    }
    notes
}

fn start(
    target: &AtomicFile,
    info: &GridInfo,
    ((colours, depth), transparent): ((ColorType, BitDepth), Option<u16>),
    cause: &Cause,
) -> Result<StreamWriter<'static, Told>> {
    let path = target.path();
    let file = target.file().try_clone().map_err(|e| Error::write(path, e))?;
    let told = Told { file, cause: cause.clone() };
    let mut encoder = Encoder::new(told, info.width, info.height);
    encoder.set_color(colours);
    encoder.set_depth(depth);
    if let Some(gray) = transparent {
        encoder.set_trns(gray.to_be_bytes().to_vec());
    }
    let started = encoder.write_header().and_then(|writer| writer.into_stream_writer());
    started.map_err(|e| failed(path, cause, e))
}

/// The first error of a file.
type Cause = Arc<Mutex<Option<io::Error>>>;

/// A file that remembers why it could not be written: of that the encoder keeps the words alone.
struct Told {
    file: File,
    cause: Cause,
}

impl Told {
    fn told<T>(&self, done: io::Result<T>) -> io::Result<T> {
        done.map_err(|error| {
            let kind = error.kind();
            if kind != io::ErrorKind::Interrupted {
                lock(&self.cause).get_or_insert(error);
            }
            kind.into()
        })
    }
}

impl Write for Told {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let done = self.file.write(bytes);
        self.told(done)
    }

    fn flush(&mut self) -> io::Result<()> {
        let done = self.file.flush();
        self.told(done)
    }
}

fn failed(path: &Path, cause: &Cause, error: impl Into<EncodingError>) -> Error {
    match (lock(cause).take(), error.into()) {
        (Some(e), _) | (None, EncodingError::IoError(e)) => Error::write(path, e),
        (None, other) => Error::new(ErrorKind::CannotWrite, other.to_string()).in_file(path),
    }
}

/// The last chunk of every PNG: its length, name and checksum.
const LAST: [u8; 12] = [0, 0, 0, 0, b'I', b'E', b'N', b'D', 0xAE, 0x42, 0x60, 0x82];

/// Fails when the file does not end in the last chunk: whether that was written, the encoder does not
/// say.
fn check_end(target: &mut AtomicFile) -> io::Result<()> {
    let mut last = [0; LAST.len()];
    target.seek(SeekFrom::End(-(LAST.len() as i64)))?;
    target.read_exact(&mut last)?;
    if last == LAST { Ok(()) } else { Err(io::ErrorKind::StorageFull.into()) }
}

impl RowSink for PngSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn encode_rows<H: Height + Display>(
        &self,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()> {
        for (row, line) in (rect.row..).zip(heights.chunks_exact(rect.width as usize)) {
            for (col, height) in (rect.col..).zip(line) {
                let packed = if height.is_void() { self.void() } else { self.pack(*height) };
                let packed = packed.map_err(|e| {
                    e.at(format_args!("column {col}, row {row}")).in_file(self.canvas.path())
                })?;
                out.extend_from_slice(if self.alpha { &packed } else { &packed[..3] });
            }
        }
        Ok(())
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        self.canvas.append(bytes)
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn finish(self) -> Result<u64> {
        self.canvas.finish()
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_told_with_its_remedy() {
        let cause = Cause::default();
        let file = File::options().write(true).open("/dev/full").unwrap();
        let mut encoder = Encoder::new(Told { file, cause: cause.clone() }, 64, 64);
        encoder.set_depth(BitDepth::Eight);
        let error = encoder.write_header().err().expect("no room for a header");
        let error = failed(Path::new("a.png"), &cause, error);
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.to_string().contains("; free some space"), "{error}");
    }
}
