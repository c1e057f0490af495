//! PNG heights: grayscale samples, heights encoded in red, green and blue (terrain-RGB and terrarium), or the
//! bands of a photograph if colours are requested. Decoded row by row into a temporary file at opening.

use std::io::BufReader;
use std::path::Path;

use ::png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Reader, Transformations};

use crate::format::{GridOpenOptions, RasterFormat, some_band};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::spool::SampleSpool;
use crate::strided::{StridedGrid, StridedLayout};
use crate::{prj, world};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_base::limits;
use terrane_files::{self as file, RawFile};

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "PNG",
    extensions: &["png"],
    about: "8 and 16-bit gray; terrain-RGB and Terrarium by file name or as terrarium:FILE; colours as bands",
    sniff: |head| head.starts_with(b"\x89PNG\r\n\x1a\n"),
    open: |path, options| open(path, None, options),
};

/// Memory limit of the decoder in bytes: a row and its buffers, or a whole interlaced image.
const MAX_MEMORY: u64 = 256 << 20;
/// Maximum compression ratio of deflate.
const MAX_RATIO: u64 = 1032;
/// Value of transparent pixels of an image with an alpha channel, above any encoded height.
const TRANSPARENT: u32 = u32::MAX;
const WEB_MERCATOR: u32 = 3857;

/// Height encoding in red, green and blue: `(R * 65536 + G * 256 + B) * scale + offset`.
#[derive(Debug, PartialEq)]
pub(super) struct RgbHeightEncoding {
    name: &'static str,
    /// Marks of the encoding in file names and input prefixes, in lower case.
    marks: &'static [&'static str],
    pub(super) scale: f64,
    pub(super) offset: f64,
}

pub(super) static PACKINGS: [RgbHeightEncoding; 2] = [
    RgbHeightEncoding {
        name: "terrain-RGB",
        marks: &["terrain-rgb", "terrainrgb", "terrain_rgb"],
        scale: 0.1,
        offset: -10_000.0,
    },
    RgbHeightEncoding {
        name: "terrarium",
        marks: &["terrarium"],
        scale: 1.0 / 256.0,
        offset: -32_768.0,
    },
];

impl RgbHeightEncoding {
    /// Display name.
    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    /// The encoding that an input such as `terrarium:tile.png` declares, and the file name.
    pub(super) fn stated(input: &str) -> Option<(&'static Self, &str)> {
        let (mark, path) = input.split_once(':')?;
        let stated = PACKINGS.iter().find(|p| p.marks.contains(&mark))?;
        Some((stated, path))
    }

    /// The encoding implied by the name of the file, or else of a parent folder.
    pub(super) fn named(path: &Path) -> Option<&'static Self> {
        path.iter().rev().find_map(|name| {
            let name = name.to_string_lossy().to_lowercase();
            PACKINGS.iter().find(|packing| packing.marks.iter().any(|mark| name.contains(mark)))
        })
    }
}

/// Opens the image at `path`; `packing` is the encoding given by the user.
pub(super) fn open(
    path: &Path,
    packing: Option<&'static RgbHeightEncoding>,
    options: &GridOpenOptions,
) -> Result<Box<dyn GridSource>> {
    let grid = decode(path, packing, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(grid))
}

/// Content of an image and layout of its stored samples.
struct PngSampleLayout {
    packing: Option<&'static RgbHeightEncoding>,
    /// Colour type of the image.
    color: ColorType,
    wide: bool,
    nodata: Option<f64>,
    /// Index of the band among red, green, blue and alpha, if colours are bands.
    channel: Option<usize>,
}

type Picture<'a> = Reader<BufReader<file::RawFileReader<'a>>>;

fn decode(
    path: &Path,
    stated: Option<&'static RgbHeightEncoding>,
    options: &GridOpenOptions,
) -> Result<StridedGrid> {
    let file = RawFile::open(path)?;
    let memory = Limits { bytes: MAX_MEMORY as usize };
    let mut decoder = Decoder::new_with_limits(BufReader::new(file.reader()), memory);
    decoder.set_transformations(Transformations::IDENTITY);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let mut picture = decoder.read_info().map_err(damaged)?;
    let (width, height) = (picture.info().width, picture.info().height);
    limits::check("width", u64::from(width), limits::MAX_SIDE)?;
    limits::check("height", u64::from(height), limits::MAX_SIDE)?;
    let content = PngSampleLayout::of(&picture, path, stated, options)?;
    some_band(options.band, content.bands())?;
    check_size(&picture, file.size())?;
    let spool =
        spool_rows(&mut picture, &content, SampleSpool::new(path, options.temp_dir.as_deref())?)?;
    let info = describe(path, (width, height), &content, &picture)?;
    let layout = StridedLayout::rows(width, info.sample_type.bytes());
    StridedGrid::new(spool, info, layout)
}

impl PngSampleLayout {
    fn of(
        picture: &Picture<'_>,
        path: &Path,
        stated: Option<&'static RgbHeightEncoding>,
        options: &GridOpenOptions,
    ) -> Result<Self> {
        let info = picture.info();
        let wide = info.bit_depth == BitDepth::Sixteen;
        if !wide && info.bit_depth != BitDepth::Eight {
            let bits = info.bit_depth as u8;
            return Err(Error::unsupported(format!(
                "PNG with {bits} bits per sample is not supported"
            )));
        }
        let color = info.color_type;
        let is_colour = matches!(color, ColorType::Rgb | ColorType::Rgba);
        if is_colour && options.colours && stated.is_none() && !wide {
            let channel = Some(options.band.saturating_sub(1) as usize);
            return Ok(Self { packing: None, color, wide, nodata: options.nodata, channel });
        }
        let packing = match color {
            ColorType::Grayscale | ColorType::GrayscaleAlpha => None,
            ColorType::Indexed => {
                return Err(Error::unsupported("PNG with a palette contains colours, not heights"));
            }
            _ if wide => return Err(Error::unsupported("16-bit RGB PNG is not supported")),
            _ => Some(
                stated.or_else(|| RgbHeightEncoding::named(path)).ok_or_else(|| ambiguous(path))?,
            ),
        };
        if let (Some(stated), None) = (stated, packing) {
            return Err(Error::usage(format!("grayscale PNG is not {}", stated.name)));
        }
        // A grayscale image can declare one transparent value.
        let key = info.trns.as_deref().filter(|_| color == ColorType::Grayscale);
        let key = key.map(|bytes| bytes.iter().fold(0.0, |v, b| v * 256.0 + f64::from(*b)));
        Ok(Self { packing, color, wide, nodata: options.nodata.or(key), channel: None })
    }

    fn bands(&self) -> u32 {
        self.channel.map_or(1, |_| self.color.samples() as u32)
    }

    fn has_alpha(&self) -> bool {
        // Alpha read as a band makes no sample void.
        self.channel.is_none() && matches!(self.color, ColorType::GrayscaleAlpha | ColorType::Rgba)
    }

    /// Type of stored samples, wider than in the image for encoded heights and transparency.
    fn sample_type(&self) -> SampleType {
        match (self.packing.is_some() || self.has_alpha(), self.wide) {
            (true, _) => SampleType::U32,
            (false, true) => SampleType::U16,
            (false, false) => SampleType::U8,
        }
    }

    /// Appends a row of the image to `out` as samples of [`sample_type`](Self::sample_type).
    fn convert(&self, row: &[u8], out: &mut Vec<u8>) {
        if let Some(channel) = self.channel {
            out.extend(row.chunks_exact(self.color.samples()).filter_map(|c| c.get(channel)));
            return;
        }
        match self.sample_type() {
            SampleType::U8 => out.extend_from_slice(row),
            SampleType::U16 => {
                let samples = row.as_chunks::<2>().0.iter();
                out.extend(samples.flat_map(|s| u16::from_be_bytes(*s).to_ne_bytes()));
            }
            _ => {
                let bytes = self.color.samples() * if self.wide { 2 } else { 1 };
                let samples = row.chunks_exact(bytes);
                out.extend(samples.flat_map(|sample| self.pack(sample).to_ne_bytes()));
            }
        }
    }

    /// Integer value of the bytes of one pixel, alpha last.
    fn pack(&self, sample: &[u8]) -> u32 {
        let alpha = if !self.has_alpha() { 0 } else { 1 + usize::from(self.wide) };
        let (value, alpha) = sample.split_at(sample.len() - alpha);
        let value = value.iter().fold(0, |v, byte| v << 8 | u32::from(*byte));
        let transparent = !alpha.is_empty() && alpha.iter().all(|byte| *byte == 0);
        let void = transparent || self.nodata == Some(f64::from(value));
        if void && self.has_alpha() { TRANSPARENT } else { value }
    }
}

fn ambiguous(path: &Path) -> Error {
    let name = path.display();
    Error::bad_input("height encoding of the RGB PNG is unknown")
        .remedy(format!(
            "pass terrarium:{name} or terrain-rgb:{name}; for a photograph, pass ‹bands› 1,2,3 to ‹terrane tin›"
        ))
}

/// Fails if the file is too short for the image, or the image too large.
fn check_size(picture: &Picture<'_>, file_bytes: u64) -> Result<()> {
    let info = picture.info();
    let row = info.raw_row_length_from_width(info.width) as u64;
    let bytes = row.saturating_mul(u64::from(info.height));
    limits::check("unpacked size in bytes", bytes, limits::MAX_UNPACKED_BYTES)?;
    if info.interlaced {
        limits::check("size of the interlaced PNG in bytes", bytes, MAX_MEMORY)?;
    }
    limits::check("row size in bytes", row, MAX_MEMORY)?;
    if bytes / MAX_RATIO > file_bytes {
        return Err(Error::bad_input(format!(
            "file is truncated or its header is wrong: {file_bytes} bytes cannot contain {bytes} bytes of samples"
        )));
    }
    Ok(())
}

fn spool_rows(
    picture: &mut Picture<'_>,
    content: &PngSampleLayout,
    mut spool: SampleSpool,
) -> Result<RawFile> {
    let mut samples = Vec::new();
    if picture.info().interlaced {
        let mut all = vec![0; picture.output_buffer_size().unwrap_or(0)];
        let row = picture.next_frame(&mut all).map_err(damaged)?.line_size;
        for row in all.chunks_exact(row) {
            samples.clear();
            content.convert(row, &mut samples);
            spool.write(&samples)?;
        }
    } else {
        while let Some(row) = picture.next_row().map_err(damaged)? {
            samples.clear();
            content.convert(row.data(), &mut samples);
            spool.write(&samples)?;
        }
    }
    // The checksum of the last chunk is verified at the end of the image.
    picture.finish().map_err(damaged)?;
    spool.finish()
}

fn damaged(error: DecodingError) -> Error {
    match error {
        DecodingError::LimitsExceeded => {
            Error::limit("number of bytes to decode", "more", MAX_MEMORY)
        }
        DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            Error::bad_input("file is truncated: image data are incomplete")
        }
        other => Error::bad_input(format!("damaged PNG: {other}")),
    }
}

fn describe(
    path: &Path,
    size: (u32, u32),
    content: &PngSampleLayout,
    picture: &Picture<'_>,
) -> Result<GridInfo> {
    let (map, crs) = place(path, size.0, size.1)?;
    let nodata = if content.has_alpha() { Some(f64::from(TRANSPARENT)) } else { content.nodata };
    let packing = content.packing;
    let plain = if content.channel.is_some() { "none: colours" } else { "gray" };
    let heights = packing.map_or(plain, |p| p.name);
    let interlace = if picture.info().interlaced { "Adam7" } else { "none" };
    Ok(GridInfo {
        transform: map.unwrap_or(Affine::LATTICE),
        georeferenced: map.is_some(),
        crs,
        nodata,
        scale: packing.map_or(1.0, |p| p.scale),
        offset: packing.map_or(0.0, |p| p.offset),
        details: vec![
            ("compression".to_owned(), "deflate".to_owned()),
            ("colours".to_owned(), format!("{:?}", content.color)),
            ("heights".to_owned(), heights.to_owned()),
            ("interlace".to_owned(), interlace.to_owned()),
        ],
        bands: content.bands(),
        band: content.channel.map_or(1, |channel| channel as u32 + 1),
        ..GridInfo::plain(FORMAT.name, size.0, size.1, content.sample_type())
    })
}

/// Transform from a world file, or else from a z/x/y tile address.
fn place(path: &Path, width: u32, height: u32) -> Result<(Option<Affine>, Crs)> {
    if let Some(map) = world::sidecar_transform(path, &["pgw", "pngw", "wld"])? {
        return Ok((Some(map), prj::sidecar_crs(path)?));
    }
    let Some(tile) = world::WebMercatorTile::of_path(path) else {
        return Ok((None, prj::sidecar_crs(path)?));
    };
    let crs = Crs {
        epsg: Some(WEB_MERCATOR),
        citation: Some("WGS 84 / Pseudo-Mercator".to_owned()),
        geographic: Some(false),
        ..Crs::default()
    };
    Ok((Some(tile.transform(width, height)), crs))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_prefixes_tell_the_packing() {
        let named = |path: &str| RgbHeightEncoding::named(Path::new(path)).map(|p| p.name);
        assert_eq!(named("a/Terrarium_5.png"), Some("terrarium"));
        assert_eq!(named("terrarium/mapbox-terrain-rgb.png"), Some("terrain-RGB"));
        assert_eq!(named("terrainrgb/1/1/0.png"), Some("terrain-RGB"));
        assert_eq!(named("a/terrain.png"), None);
        let (stated, path) = RgbHeightEncoding::stated("terrain-rgb:c:/a.png").unwrap();
        assert_eq!((stated.name, path), ("terrain-RGB", "c:/a.png"));
        assert!(RgbHeightEncoding::stated("c:/terrarium.png").is_none());
    }

    #[test]
    fn alpha_and_nodata_are_void() {
        let content = |color, wide, nodata| PngSampleLayout {
            packing: None,
            color,
            wide,
            nodata,
            channel: None,
        };
        let rgba = content(ColorType::Rgba, false, Some(65793.0));
        assert_eq!(rgba.pack(&[1, 2, 3, 255]), 0x1_0203);
        assert_eq!(rgba.pack(&[1, 2, 3, 0]), TRANSPARENT);
        assert_eq!(rgba.pack(&[1, 1, 1, 9]), TRANSPARENT);
        let gray = content(ColorType::GrayscaleAlpha, true, None);
        assert_eq!((gray.pack(&[1, 2, 0, 1]), gray.pack(&[1, 2, 0, 0])), (258, TRANSPARENT));
        assert_eq!(content(ColorType::Rgb, false, Some(1.0)).pack(&[0, 0, 1]), 1);
    }
}
