//! Image layout: size, blocks, sample type and compression, validated once.

use crate::grid::SampleType;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;

use super::codec::GeoTiffCompression;
use super::ifd::{ByteOrder, GeoTiffDirectory, about};
use super::predictor::Predictor;
use super::tags;

/// Layout of an image.
#[derive(Clone, Debug)]
pub(super) struct GeoTiffLayout {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Columns and rows of a block; strips are as wide as the image.
    pub(super) block_width: u32,
    pub(super) block_height: u32,
    pub(super) tiled: bool,
    pub(super) bands: u32,
    /// True if each band has its own blocks (PlanarConfiguration 2).
    pub(super) separate: bool,
    pub(super) sample_type: SampleType,
    /// True for one-bit samples, which are unpacked to bytes (`sample_type`).
    pub(super) one_bit: bool,
    pub(super) compression: GeoTiffCompression,
    pub(super) predictor: Predictor,
    pub(super) order: ByteOrder,
}

impl GeoTiffLayout {
    /// Reads and checks the layout of the grid in `directory`.
    pub(super) fn read(directory: &GeoTiffDirectory<'_>) -> Result<Self> {
        Self::of(directory, |directory| Ok((sample_type(directory)?, false)))
    }

    /// Reads and checks the layout of the mask in `directory`, with samples of 1 or 8 bits.
    pub(super) fn read_mask(directory: &GeoTiffDirectory<'_>) -> Result<Self> {
        Self::of(directory, mask_sample_type)
    }

    fn of(
        directory: &GeoTiffDirectory<'_>,
        samples: impl Fn(&GeoTiffDirectory<'_>) -> Result<(SampleType, bool)>,
    ) -> Result<Self> {
        let width = side(directory, tags::IMAGE_WIDTH)?;
        let height = side(directory, tags::IMAGE_LENGTH)?;
        let tiled = directory.has(tags::TILE_WIDTH);
        let (block_width, block_height) = block_size(directory, tiled, width, height)?;
        let bands = directory.int(tags::SAMPLES_PER_PIXEL)?.unwrap_or(1);
        limits::check("number of bands", bands, limits::MAX_BANDS)?;
        if bands == 0 {
            return Err(about(tags::SAMPLES_PER_PIXEL, "is 0"));
        }
        refuse_odd_pixels(directory)?;
        let compression = compression(directory)?;
        let (sample_type, one_bit) = samples(directory)?;
        let layout = Self {
            width,
            height,
            block_width,
            block_height,
            tiled,
            bands: bands as u32,
            separate: is_separate(directory)?,
            compression,
            sample_type,
            one_bit,
            predictor: Predictor::from_code(directory.int(tags::PREDICTOR)?.unwrap_or(1))?,
            order: directory.order,
        };
        layout.check()?;
        Ok(layout)
    }

    fn check(&self) -> Result<()> {
        let per_plane = self.blocks_across() * self.blocks_down();
        let blocks = per_plane.saturating_mul(self.planes());
        limits::check("number of blocks", blocks, limits::MAX_BLOCKS)?;
        if !self.is_read_by_rows() {
            let bytes = self.decoded_bytes();
            limits::check("decoded block size in bytes", bytes, limits::MAX_BLOCK_BYTES)?;
        }
        let float = self.sample_type.is_float();
        if self.effective_predictor() == Predictor::Float && !float {
            return Err(Error::bad_input("floating point predictor on integer samples"));
        }
        if self.one_bit && self.effective_predictor() != Predictor::None {
            return Err(Error::bad_input("predictor on samples of one bit"));
        }
        if self.one_bit && self.compression.is_lerc() {
            return Err(Error::bad_input("LERC on samples of one bit"));
        }
        // The only library that writes LERC in TIFF swaps the bytes of samples first. Integers are restored;
        // floats were quantised and masked by their swapped values.
        if float && self.compression.is_lerc() && self.order != ByteOrder::NATIVE {
            let order = self.order.name();
            return Err(Error::unsupported(format!("LERC of {order} floats is not supported"))
                .remedy("recreate the file from its source with -co ENDIANNESS=LITTLE"));
        }
        Ok(())
    }

    /// True if windows are read row by row from the file, false if blocks are decoded as a whole.
    pub(super) fn is_read_by_rows(&self) -> bool {
        self.compression == GeoTiffCompression::None && !self.one_bit
    }

    /// Decoded size in bytes of a full block of all its bands. Saturates.
    pub(super) fn decoded_bytes(&self) -> u64 {
        let row = u64::from(self.block_width) * self.stride() as u64;
        let samples = row.saturating_mul(u64::from(self.block_height));
        samples.saturating_mul(self.sample_type.bytes() as u64)
    }

    /// Bytes in memory while a full block of one band is decoded: the block, the compressed bytes (which may be as many), and
    /// all bands where they are [parted](Self::needs_scratch). Saturates.
    pub(super) fn peak_bytes(&self) -> u64 {
        let all = self.decoded_bytes();
        let block = all / self.stride() as u64;
        block.saturating_add(all).saturating_add(if self.needs_scratch() { all } else { 0 })
    }

    /// True if blocks are decompressed into another buffer, from which the samples of the band are taken: where other bands
    /// or the predictor of floats part the bytes of samples.
    pub(super) fn needs_scratch(&self) -> bool {
        self.one_bit || self.stride() > 1 || self.effective_predictor() == Predictor::Float
    }

    /// The predictor in effect: uncompressed data have none, whatever the tag says.
    pub(super) fn effective_predictor(&self) -> Predictor {
        match self.compression {
            GeoTiffCompression::None
            | GeoTiffCompression::PackBits
            | GeoTiffCompression::Lerc(_) => Predictor::None,
            _ => self.predictor,
        }
    }

    /// Number of blocks across.
    pub(super) fn blocks_across(&self) -> u64 {
        u64::from(self.width.div_ceil(self.block_width))
    }

    /// Number of blocks down.
    pub(super) fn blocks_down(&self) -> u64 {
        u64::from(self.height.div_ceil(self.block_height))
    }

    /// Number of planes: one per band if bands are separate.
    pub(super) fn planes(&self) -> u64 {
        if self.separate { u64::from(self.bands) } else { 1 }
    }

    /// Samples per pixel in a block.
    pub(super) fn stride(&self) -> usize {
        if self.separate { 1 } else { self.bands as usize }
    }

    /// Stored bytes of one row of a block, all its bands.
    pub(super) fn row_bytes(&self) -> u64 {
        let samples = u64::from(self.block_width) * self.stride() as u64;
        if self.one_bit { samples.div_ceil(8) } else { samples * self.sample_type.bytes() as u64 }
    }

    /// Stored bytes of `rows` rows of a block. Saturates.
    pub(super) fn block_bytes(&self, rows: u32) -> u64 {
        self.row_bytes().saturating_mul(u64::from(rows))
    }

    /// Number of rows stored in the blocks of block row `by`: the last strip ends with the image, tiles are
    /// always full.
    pub(super) fn stored_rows(&self, by: u32) -> u32 {
        let first = by * self.block_height;
        if self.tiled { self.block_height } else { self.block_height.min(self.height - first) }
    }

    /// The samples in block (`bx`, `by`).
    pub(super) fn block_rect(&self, bx: u32, by: u32) -> Rect {
        let (col, row) = (bx * self.block_width, by * self.block_height);
        let width = self.block_width.min(self.width - col);
        let height = self.block_height.min(self.height - row);
        Rect::new(col, row, width, height)
    }

    /// Index of block (`bx`, `by`) of plane `plane` in the block tables.
    pub(super) fn block_index(&self, plane: u64, bx: u32, by: u32) -> u64 {
        (plane * self.blocks_down() + u64::from(by)) * self.blocks_across() + u64::from(bx)
    }

    /// Details for `terrane info`.
    pub(super) fn details(&self) -> Vec<(String, String)> {
        let kind = if self.tiled { "tiles" } else { "strips" };
        let mut details = vec![
            ("compression", self.compression.name().to_owned()),
            ("predictor", self.effective_predictor().name().to_owned()),
            ("layout", format!("{kind} of {} x {}", self.block_width, self.block_height)),
            ("byte order", self.order.name().to_owned()),
        ];
        if self.bands > 1 {
            let planes = if self.separate { "separate" } else { "interleaved" };
            details.push(("bands stored", planes.to_owned()));
        }
        details.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// A mandatory side of the image: 1 to [`limits::MAX_SIDE`].
fn side(directory: &GeoTiffDirectory<'_>, tag: u16) -> Result<u32> {
    let Some(value) = directory.int(tag)? else {
        return Err(about(tag, "is missing"));
    };
    if value == 0 {
        return Err(about(tag, "is 0"));
    }
    limits::check(tags::name(tag), value, limits::MAX_SIDE)?;
    Ok(value as u32)
}

fn block_size(
    directory: &GeoTiffDirectory<'_>,
    tiled: bool,
    width: u32,
    height: u32,
) -> Result<(u32, u32)> {
    if tiled {
        return Ok((side(directory, tags::TILE_WIDTH)?, side(directory, tags::TILE_LENGTH)?));
    }
    let rows = directory.int(tags::ROWS_PER_STRIP)?.unwrap_or(u64::from(height));
    if rows == 0 {
        return Err(about(tags::ROWS_PER_STRIP, "is 0"));
    }
    // The default of RowsPerStrip is 2^32 - 1, for one strip.
    Ok((width, rows.min(u64::from(height)) as u32))
}

/// The compression; LERC has an additional compression in its own tag.
fn compression(directory: &GeoTiffDirectory<'_>) -> Result<GeoTiffCompression> {
    let code = directory.int(tags::COMPRESSION)?.unwrap_or(1);
    let parameters = directory.ints(tags::LERC_PARAMETERS)?.unwrap_or_default();
    GeoTiffCompression::from_code(code, parameters.get(1).copied().unwrap_or(0))
}

fn is_separate(directory: &GeoTiffDirectory<'_>) -> Result<bool> {
    match directory.int(tags::PLANAR_CONFIGURATION)?.unwrap_or(1) {
        1 => Ok(false),
        2 => Ok(true),
        other => {
            Err(about(tags::PLANAR_CONFIGURATION, format_args!("is {other}, expected 1 or 2")))
        }
    }
}

/// Rejects indirect colours and reversed bits, which are not elevation data.
fn refuse_odd_pixels(directory: &GeoTiffDirectory<'_>) -> Result<()> {
    let colours = match directory.int(tags::PHOTOMETRIC)? {
        Some(3) => Some("palette"),
        Some(5) => Some("CMYK"),
        Some(6) => Some("YCbCr"),
        Some(8..=10) => Some("CIE L*a*b*"),
        Some(32803) => Some("colour filter array"),
        Some(32844 | 32845) => Some("LogLuv"),
        _ => None,
    };
    if let Some(name) = colours {
        return Err(Error::unsupported(format!(
            "photometric interpretation {name} is not supported"
        ))
        .remedy("write plain heights: gdal_translate -co PHOTOMETRIC=MINISBLACK IN OUT"));
    }
    match directory.int(tags::FILL_ORDER)? {
        None | Some(1) => Ok(()),
        Some(order) => {
            Err(Error::unsupported(format!("FillOrder {order} (reversed bits) is not supported"))
                .remedy("rewrite the file: gdal_translate IN OUT"))
        }
    }
}

fn sample_type(directory: &GeoTiffDirectory<'_>) -> Result<SampleType> {
    let bits = common(directory, tags::BITS_PER_SAMPLE, 1)?;
    let format = common(directory, tags::SAMPLE_FORMAT, 1)?;
    // Format 4 is "untyped"; it is read as unsigned, as GDAL does.
    Ok(match (format, bits) {
        (1 | 4, 8) => SampleType::U8,
        (1 | 4, 16) => SampleType::U16,
        (1 | 4, 32) => SampleType::U32,
        (2, 8) => SampleType::I8,
        (2, 16) => SampleType::I16,
        (2, 32) => SampleType::I32,
        (3, 16) => SampleType::F16,
        (3, 32) => SampleType::F32,
        (3, 64) => SampleType::F64,
        _ => return Err(unsupported_samples(format, bits)),
    })
}

/// Sample type of a mask of 1 or 8 bits per sample.
fn mask_sample_type(directory: &GeoTiffDirectory<'_>) -> Result<(SampleType, bool)> {
    match common(directory, tags::BITS_PER_SAMPLE, 1)? {
        1 => Ok((SampleType::U8, true)),
        8 => Ok((SampleType::U8, false)),
        bits => {
            Err(Error::unsupported(format!("mask with {bits} bits per sample is not supported"))
                .remedy("rewrite the mask with 1 or 8 bits per sample: gdal_translate -mask"))
        }
    }
}

fn unsupported_samples(format: u64, bits: u64) -> Error {
    let kind = match format {
        1 | 4 => "unsigned integer",
        2 => "signed integer",
        3 => "floating point",
        5 => "complex integer",
        6 => "complex floating point",
        _ => "unknown",
    };
    let target = if bits > 32 { "Float64" } else { "Float32" };
    Error::unsupported(format!("{bits}-bit {kind} samples are not supported")).remedy(format!(
        "convert to 8, 16 or 32-bit integers or 16, 32 or 64-bit floats: gdal_translate -ot {target} IN OUT"
    ))
}

/// The common value of all bands, or `missing` if the tag is absent.
fn common(directory: &GeoTiffDirectory<'_>, tag: u16, missing: u64) -> Result<u64> {
    let Some(values) = directory.ints(tag)? else { return Ok(missing) };
    match values.split_first() {
        None => Err(about(tag, "is empty")),
        Some((first, rest)) if rest.iter().all(|v| v == first) => Ok(*first),
        Some(_) => {
            let name = tags::name(tag);
            Err(Error::unsupported(format!("bands with different {name} are not supported"))
                .remedy("extract one band: gdal_translate -b 1 IN OUT"))
        }
    }
}
