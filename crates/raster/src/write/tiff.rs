//! Common parts of GeoTIFF and COG: block layout, block encoding, and tags.

use super::compress::TiffCompression;
use super::creation::Accepts::{Whole, Words};
use super::creation::{CreationOption, CreationOptions};
use super::directory::{TiffDirectoryBuilder, TiffVariant};
use super::predict;
use crate::grid::SampleType;
use crate::tiled_tiff::header::sample_tags;
use crate::tiled_tiff::sample::{SampleCodec, TiledTiffHeight};
use crate::tiled_tiff::tags::{TiffTagValues, tag};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;

pub(super) const COMPRESS: CreationOption = CreationOption {
    key: "COMPRESS",
    accepts: Words(&["NONE", "DEFLATE", "ZSTD", "LZW", "PACKBITS"]),
    about: "compression [COG: DEFLATE, GTiff: NONE]",
};
pub(super) const LEVEL: CreationOption = CreationOption {
    key: "LEVEL",
    accepts: Whole { least: 1, most: 22, step: 1 },
    about: "compression level of DEFLATE, 1 to 12 [6], or ZSTD [9]",
};
pub(super) const PREDICTOR: CreationOption = CreationOption {
    key: "PREDICTOR",
    accepts: Words(&["NO", "YES", "STANDARD", "FLOATING_POINT", "1", "2", "3"]),
    about: "2 is STANDARD, 3 is FLOATING_POINT, YES is by sample type [YES]",
};
pub(super) const BIGTIFF: CreationOption = CreationOption {
    key: "BIGTIFF",
    accepts: Words(&["YES", "NO", "IF_NEEDED", "IF_SAFER"]),
    about: "64-bit offsets, for files above 4 GiB [IF_NEEDED]",
};

const SUBFILE_TYPE: u16 = 254;
const STRIP_OFFSETS: u16 = 273;
const ROWS_PER_STRIP: u16 = 278;
const STRIP_BYTES: u16 = 279;
const PREDICTOR_TAG: u16 = 317;
const EXTRA_SAMPLES: u16 = 338;
/// ExtraSamples: unspecified; unassociated alpha.
const UNSPECIFIED: u16 = 0;
const OPACITY: u16 = 2;
/// PhotometricInterpretation: BlackIsZero; RGB.
const GRAY: u16 = 1;
const RGB: u16 = 2;
/// PlanarConfiguration: chunky; planar.
const CHUNKY: u16 = 1;
const PLANAR: u16 = 2;

/// Sample encoding by COMPRESS, LEVEL and PREDICTOR.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleCoding {
    pub(super) compression: TiffCompression,
    /// The value of the Predictor tag.
    predictor: u16,
}

impl SampleCoding {
    /// From the options; `default` is the default compression.
    pub(super) fn of(
        creation: &CreationOptions,
        sample_type: SampleType,
        default: &str,
    ) -> Result<Self> {
        let compression = TiffCompression::of(creation, default)?;
        let word = creation.word("PREDICTOR");
        let plain = matches!(word, Some("NO" | "1"));
        if !compression.predicts() && !plain {
            creation.refuse("PREDICTOR", "without DEFLATE, ZSTD or LZW")?;
        }
        let predictor = match word {
            _ if plain || !compression.predicts() => 1,
            Some("STANDARD" | "2") => 2,
            Some("FLOATING_POINT" | "3") => 3,
            _ if sample_type.is_float() => 3,
            _ => 2,
        };
        if predictor == 3 && !sample_type.is_float() {
            let message = format!("PREDICTOR=3 requires float samples, found {sample_type:?}");
            return Err(Error::usage(message).remedy("choose PREDICTOR=2"));
        }
        Ok(Self { compression, predictor })
    }
}

/// An image: size, blocks and encoding.
#[derive(Clone, Copy, Debug)]
pub(super) struct TiffImage {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Columns and rows of a block; strips are as wide as the image.
    pub(super) block: (u32, u32),
    pub(super) tiled: bool,
    pub(super) sample_type: SampleType,
    pub(super) coding: SampleCoding,
    /// Number of bands, each with its own blocks.
    pub(super) bands: u32,
    /// True if the bands are red, green, blue and optionally alpha.
    pub(super) are_colours: bool,
}

impl TiffImage {
    /// Fails if number or size of blocks exceeds the limits.
    pub(super) fn check(&self) -> Result<()> {
        limits::check("number of blocks", self.blocks(), limits::MAX_BLOCKS)
            .map_err(|e| e.remedy("write larger blocks, larger cells or a smaller extent"))?;
        let bytes = self.row_bytes() as u64 * u64::from(self.block.1);
        limits::check("block size in bytes", bytes, limits::MAX_BLOCK_BYTES)
    }

    /// Number of blocks of all bands.
    pub(super) fn blocks(&self) -> u64 {
        let across = u64::from(self.width.div_ceil(self.block.0));
        across * u64::from(self.height.div_ceil(self.block.1)) * u64::from(self.bands)
    }

    /// Uncompressed size of all blocks in bytes; the last strip ends with the image.
    pub(super) fn plain_bytes(&self) -> u64 {
        let rows = match self.tiled {
            true => self.blocks() * u64::from(self.block.1),
            false => u64::from(self.height) * u64::from(self.bands),
        };
        rows.saturating_mul(self.row_bytes() as u64)
    }

    /// Size of a row of a block in bytes.
    fn row_bytes(&self) -> usize {
        self.block.0 as usize * self.sample_type.bytes()
    }

    /// The directory, with additional tags `facts`.
    pub(super) fn directory(
        &self,
        facts: Vec<(u16, TiffTagValues)>,
        is_overview: bool,
    ) -> TiffDirectoryBuilder {
        let (bits, format) = sample_tags(self.sample_type);
        let count = self.bands as usize;
        let photometric = if self.are_colours { RGB } else { GRAY };
        let planar = if self.bands == 1 { CHUNKY } else { PLANAR };
        let mut tags = facts;
        tags.extend([
            (tag::WIDTH, TiffTagValues::long(self.width)),
            (tag::HEIGHT, TiffTagValues::long(self.height)),
            (tag::BITS, TiffTagValues::Short(vec![bits; count])),
            (tag::COMPRESSION, TiffTagValues::short(self.coding.compression.code())),
            (tag::PHOTOMETRIC, TiffTagValues::short(photometric)),
            (tag::SAMPLES_PER_PIXEL, TiffTagValues::short(self.bands as u16)),
            (tag::PLANAR, TiffTagValues::short(planar)),
            (tag::SAMPLE_FORMAT, TiffTagValues::Short(vec![format; count])),
        ]);
        let (own, extra) = if self.are_colours { (3, OPACITY) } else { (1, UNSPECIFIED) };
        if self.bands > own {
            tags.push((
                EXTRA_SAMPLES,
                TiffTagValues::Short(vec![extra; (self.bands - own) as usize]),
            ));
        }
        if is_overview {
            tags.push((SUBFILE_TYPE, TiffTagValues::long(1)));
        }
        if self.coding.predictor != 1 {
            tags.push((PREDICTOR_TAG, TiffTagValues::short(self.coding.predictor)));
        }
        let (block_width, block_height) = self.block;
        if !self.tiled {
            tags.push((ROWS_PER_STRIP, TiffTagValues::long(block_height)));
            let tables = [STRIP_OFFSETS, STRIP_BYTES];
            return TiffDirectoryBuilder::new(tags, tables, self.blocks(), self.bands);
        }
        tags.extend([
            (tag::TILE_WIDTH, TiffTagValues::long(block_width)),
            (tag::TILE_HEIGHT, TiffTagValues::long(block_height)),
        ]);
        let tables = [tag::TILE_OFFSETS, tag::TILE_BYTES];
        TiffDirectoryBuilder::new(tags, tables, self.blocks(), self.bands)
    }

    /// Encodes the block of the heights of `rect` into `out`; tiles are padded with voids.
    pub(super) fn encode<H: TiledTiffHeight>(
        &self,
        codec: &SampleCodec,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()> {
        let rows = if self.tiled { self.block.1 } else { rect.height };
        let mut plain = vec![0; self.row_bytes() * rows as usize];
        let lines = heights.chunks_exact(rect.width as usize).chain(std::iter::repeat(&[][..]));
        let bytes = plain.chunks_exact_mut(self.row_bytes());
        for ((row, line), bytes) in (rect.row..).zip(lines).zip(bytes) {
            codec.encode(line, bytes).map_err(|misfit| codec.refusal(misfit, rect.col, row))?;
        }
        self.predict(&mut plain);
        self.coding.compression.run(&plain, self.row_bytes(), out)
    }

    fn predict(&self, plain: &mut [u8]) {
        let size = self.sample_type.bytes();
        let rows = plain.chunks_exact_mut(self.row_bytes());
        match self.coding.predictor {
            2 => rows.for_each(|row| predict::horizontal(row, size)),
            3 => {
                let mut scratch = Vec::new();
                rows.for_each(|row| predict::float(row, size, &mut scratch));
            }
            _ => (),
        }
    }
}

/// Uncompressed size in bytes from which compressed files of unknown size use 64-bit offsets: no compression
/// doubles the size.
const SAFE_BYTES: u64 = 2 << 30;

/// The TIFF variant by BIGTIFF, for a file of `exact` bytes in the classic form if known, else of about
/// `plain` uncompressed bytes.
///
/// # Errors
/// Usage: BIGTIFF=NO for a file known to be too large.
pub(super) fn form(
    creation: &CreationOptions,
    exact: Option<u64>,
    plain: u64,
) -> Result<TiffVariant> {
    let fits = exact.map_or(plain <= SAFE_BYTES, |bytes| bytes <= TiffVariant::Classic.most());
    match creation.word("BIGTIFF").unwrap_or("IF_NEEDED") {
        "YES" => Ok(TiffVariant::Big),
        "NO" if exact.is_some() && !fits => Err(too_large()),
        "NO" => Ok(TiffVariant::Classic),
        "IF_SAFER" if plain > SAFE_BYTES => Ok(TiffVariant::Big),
        _ if fits => Ok(TiffVariant::Classic),
        _ => Ok(TiffVariant::Big),
    }
}

/// Error of a file that exceeds the limit of classic TIFF.
pub(super) fn too_large() -> Error {
    Error::usage("file exceeds the 4 GiB limit of classic TIFF").remedy("omit ‹co› BIGTIFF=NO")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn creation(given: &[(&str, &str)]) -> CreationOptions {
        const OPTIONS: &[CreationOption] = &[COMPRESS, LEVEL, PREDICTOR, BIGTIFF];
        let given: Vec<_> = given.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        CreationOptions::new("X", OPTIONS, &given).unwrap()
    }

    #[test]
    fn sixty_four_bits_by_need() {
        let (none, yes, no) = (&[][..], &[("BIGTIFF", "YES")][..], &[("BIGTIFF", "NO")][..]);
        let safer = &[("BIGTIFF", "IF_SAFER")][..];
        let of = |given, exact, plain| form(&creation(given), exact, plain).ok();
        let (most, safe) = (u64::from(u32::MAX), SAFE_BYTES);
        for (given, exact, plain, expected) in [
            (none, Some(most), most, Some(TiffVariant::Classic)),
            (none, Some(most + 1), 0, Some(TiffVariant::Big)),
            (none, None, safe, Some(TiffVariant::Classic)),
            (none, None, safe + 1, Some(TiffVariant::Big)),
            (yes, Some(1), 1, Some(TiffVariant::Big)),
            (no, Some(most + 1), 0, None),
            (no, None, safe + 1, Some(TiffVariant::Classic)),
            (safer, Some(safe), safe, Some(TiffVariant::Classic)),
            (safer, Some(safe + 1), safe + 1, Some(TiffVariant::Big)),
        ] {
            assert_eq!(of(given, exact, plain), expected, "{given:?} {exact:?} {plain}");
        }
    }

    #[test]
    fn the_predictor_follows_the_samples() {
        let of = |given: &[(&str, &str)], sample_type| {
            SampleCoding::of(&creation(given), sample_type, "DEFLATE")
                .map(|coding| coding.predictor)
        };
        assert_eq!(of(&[], SampleType::I16).unwrap(), 2);
        assert_eq!(of(&[], SampleType::F32).unwrap(), 3);
        assert_eq!(of(&[("COMPRESS", "NONE")], SampleType::F32).unwrap(), 1);
        assert_eq!(of(&[("PREDICTOR", "no")], SampleType::F32).unwrap(), 1);
        assert_eq!(of(&[("PREDICTOR", "2")], SampleType::F32).unwrap(), 2);
        assert!(of(&[("PREDICTOR", "3")], SampleType::I16).is_err());
        assert!(of(&[("PREDICTOR", "2"), ("COMPRESS", "PACKBITS")], SampleType::I16).is_err());
    }
}
