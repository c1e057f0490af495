//! PNG with heights encoded in red, green and blue: terrain-RGB (steps of 0.1 from -10000) or terrarium
//! (steps of 1/256 from -32768), with a world file and a .prj sidecar. Voids are transparent.

use std::fmt::Display;

use ::png::{BitDepth, ColorType};

use super::creation::Accepts::Words;
use super::creation::CreationOption;
use super::format::{GridFormat, GridWriteRequest};
use super::gray::{self, GraySink};
use super::picture::PictureSink;
use super::png_picture::PngCanvas;
use super::rows::RowSink;
use super::sidecar;
use crate::grid::{GridInfo, SampleType};
use crate::png::{PACKINGS, RgbHeightEncoding};
use crate::tiled_tiff::sample::TiledTiffHeight;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "PNG",
    extensions: &["png"],
    about: "terrain-RGB, terrarium, or 8 or 16-bit grayscale (‹type› uint8, uint16), with .pgw and .prj; scale and offset are applied",
    options: &[
        CreationOption {
            key: "ENCODING",
            accepts: Words(&["TERRAIN-RGB", "TERRARIUM", "GRAY"]),
            about: "encoding of heights [GRAY for ‹type› uint8 or uint16 and for reliefs, else by file name, else \
                TERRAIN-RGB]",
        },
        CreationOption {
            key: "ALPHA",
            accepts: Words(&["YES", "NO"]),
            about: "transparent voids of encoded heights [YES if the grid declares nodata]",
        },
    ],
    several_bands: false,
    holds_colours: true,
    holds_types: false,
    names_voids: true,
    bytes_per_sample: 24,
    create: |order| match (order.options.are_colours, gray::is_requested(order)?) {
        (true, _) => Ok(Box::new(PictureSink::new(order)?)),
        (_, true) => Ok(Box::new(GraySink::new(order)?)),
        (_, false) => Ok(Box::new(PngSink::new(order)?)),
    },
};

/// Maximum encoded value.
const MOST: f64 = 16_777_215.0;
/// Tolerance, in steps, within which a height counts as a multiple of the step.
const HAIR: f64 = 1e-3;

/// A PNG under construction.
struct PngSink {
    info: GridInfo,
    packing: &'static RgbHeightEncoding,
    alpha: bool,
    round: bool,
    canvas: PngCanvas,
    notes: Vec<String>,
}

impl PngSink {
    fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        let options = order.options;
        if let Some(other) = options.sample_type {
            let message = format!(
                "PNG supports grayscale of uint8 or uint16 and RGB-encoded heights, not {}",
                other.name()
            );
            return Err(Error::usage(message).remedy("omit ‹type›, or both ‹type› and ENCODING"));
        }
        if options.nodata.is_some() {
            return Err(Error::usage(
                "PNG stores voids as transparent pixels, not as a nodata value",
            )
            .remedy("omit ‹out_nodata›"));
        }
        let packing = packing(order)?;
        let alpha = match order.creation.word("ALPHA") {
            Some(word) => word == "YES",
            None => order.info.nodata.is_some(),
        };
        let colours = if alpha { ColorType::Rgba } else { ColorType::Rgb };
        let canvas = PngCanvas::new(order, (colours, BitDepth::Eight), None)?;
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
        Err(Error::bad_input("sample is void, but the image has no transparency")
            .remedy("pass ‹co› ALPHA=YES"))
    }

    /// Encodes a height as red, green, blue and full opacity.
    fn pack<H: TiledTiffHeight>(&self, height: H) -> Result<[u8; 4]> {
        let height = height.to_f64();
        let wanted = (height - self.packing.offset) / self.packing.scale;
        let step = wanted.round();
        let (name, scale) = (self.packing.name(), self.packing.scale);
        if !(0.0..=MOST).contains(&step) {
            let message = format!("height {height} is outside the range of {name}");
            return Err(Error::bad_input(message).remedy("write another format"));
        }
        let again = step * scale + self.packing.offset;
        // Far from 0 a step read as an f32 is off by more than a hair: it counts as itself if it reads the same again.
        let same = (step - wanted).abs() < HAIR || again as f32 == height as f32;
        if !same && !self.round {
            let message =
                format!("height {height} is not a multiple of {scale}, the step of {name}");
            return Err(Error::bad_input(message).remedy("pass ‹round› to store the nearest value"));
        }
        let [_, red, green, blue] = (step as u32).to_be_bytes();
        Ok([red, green, blue, u8::MAX])
    }
}

/// The encoding given by ENCODING, or else by the file name; they must not conflict, because readers rely on
/// the name.
fn packing(order: &GridWriteRequest<'_>) -> Result<&'static RgbHeightEncoding> {
    let named = RgbHeightEncoding::named(order.path);
    let asked = order.creation.word("ENCODING");
    let asked =
        asked.and_then(|word| PACKINGS.iter().find(|p| word.eq_ignore_ascii_case(p.name())));
    match (asked, named) {
        (Some(asked), Some(named)) if asked != named => {
            let message = format!("file name implies {}, which readers will assume", named.name());
            Err(Error::usage(message).remedy("choose another name or ENCODING"))
        }
        (asked, named) => Ok(asked.or(named).unwrap_or(&PACKINGS[0])),
    }
}

fn notes(order: &GridWriteRequest<'_>, packing: &RgbHeightEncoding) -> Vec<String> {
    let mut notes = sidecar::lost(order.info);
    if RgbHeightEncoding::named(order.path).is_none() {
        let (name, path) = (packing.name().to_lowercase(), order.path.display());
        notes.push(format!("file name does not imply the encoding: read it as {name}:{path}"));
    }
    notes
}

impl RowSink for PngSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn encode_rows<H: TiledTiffHeight + Display>(
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
