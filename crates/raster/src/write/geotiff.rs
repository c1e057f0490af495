//! Plain GeoTIFF in tiles or strips: space for the directory, then the blocks as they come; the directory is
//! written last.

use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::sync::Mutex;

use super::compress::TiffCompression;
use super::creation::Accepts::{Whole, Words};
use super::creation::CreationOption;
use super::directory::{TiffDirectoryBuilder, TiffOffsets, TiffVariant};
use super::format::{GridFormat, GridSink, GridWriteRequest};
use super::packed::PackedBlocks;
use super::tiff::{self, SampleCoding, TiffImage};
use crate::grid::GridInfo;
use crate::tiled_tiff::HeightSlice;
use crate::tiled_tiff::header::facts;
use crate::tiled_tiff::sample::SampleCodec;
use crate::tiled_tiff::writer::check_free_space;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::atomic::AtomicFile;
use terrane_files::{AppendWriter, lock, unlocked};

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "GTiff",
    extensions: &["tif", "tiff"],
    about: "plain GeoTIFF in strips or tiles; the default for .tif",
    options: &[
        tiff::COMPRESS,
        tiff::LEVEL,
        tiff::PREDICTOR,
        CreationOption {
            key: "TILED",
            accepts: Words(&["YES", "NO"]),
            about: "tiles instead of strips [NO]",
        },
        CreationOption {
            key: "BLOCKXSIZE",
            accepts: Whole { least: 16, most: 4096, step: 16 },
            about: "tile width [256]",
        },
        CreationOption {
            key: "BLOCKYSIZE",
            accepts: Whole { least: 1, most: 4096, step: 1 },
            about: "tile height, a multiple of 16 [256], or rows per strip [about 64 KiB]",
        },
        tiff::BIGTIFF,
    ],
    several_bands: true,
    holds_colours: true,
    holds_types: true,
    names_voids: true,
    bytes_per_sample: 40,
    create: |order| Ok(Box::new(GeoTiffSink::new(order)?)),
};

const TILE: u32 = 256;
/// Approximate size of a strip in bytes.
const STRIP_BYTES: u64 = 64 << 10;

/// A GeoTIFF under construction.
struct GeoTiffSink {
    target: AtomicFile,
    info: GridInfo,
    image: TiffImage,
    codec: SampleCodec,
    directory: TiffDirectoryBuilder,
    form: TiffVariant,
    blocks: Mutex<PackedBlocks>,
}

impl GeoTiffSink {
    fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        let info = order.stored()?;
        let image = image(order, &info)?;
        image.check()?;
        let directory = image.directory(facts(&info, &order.options.bands)?, false);
        let plain = image.plain_bytes();
        let exact = match image.coding.compression {
            TiffCompression::None => {
                Some(front(&directory, TiffVariant::Classic).saturating_add(plain))
            }
            _ => None,
        };
        let form = tiff::form(&order.creation, exact, plain)?;
        let target = AtomicFile::create(order.path, order.options.overwrite)?;
        check_free_space(target.path(), target.file(), exact.unwrap_or(0))?;
        let blocks = PackedBlocks::new(AppendWriter::of(&target, front(&directory, form))?);
        let codec = order.codec(&info);
        Ok(Self { target, info, image, codec, directory, form, blocks: Mutex::new(blocks) })
    }
}

/// Offset of the first block.
fn front(directory: &TiffDirectoryBuilder, form: TiffVariant) -> u64 {
    form.start() + directory.bytes(form)
}

fn image(order: &GridWriteRequest<'_>, info: &GridInfo) -> Result<TiffImage> {
    let (creation, bands) = (&order.creation, order.options.band_count());
    let are_colours = order.options.are_colours;
    let GridInfo { width, height, sample_type, .. } = *info;
    let coding = SampleCoding::of(creation, sample_type, "NONE")?;
    let tiled = creation.word("TILED") == Some("YES");
    let rows = creation.number("BLOCKYSIZE");
    let block = if tiled {
        if let Some(rows) = rows.filter(|rows| !rows.is_multiple_of(16)) {
            return Err(Error::usage(format!("BLOCKYSIZE={rows} is not a valid tile height"))
                .remedy("choose a multiple of 16"));
        }
        (creation.number("BLOCKXSIZE").unwrap_or(TILE), rows.unwrap_or(TILE))
    } else {
        creation.refuse("BLOCKXSIZE", "for strips: add ‹co› TILED=YES")?;
        let row_bytes = u64::from(width) * sample_type.bytes() as u64;
        let usual = (STRIP_BYTES / row_bytes).clamp(1, u64::from(u32::MAX)) as u32;
        (width, rows.unwrap_or(usual).min(height))
    };
    Ok(TiffImage { width, height, block, tiled, sample_type, coding, bands, are_colours })
}

impl GridSink for GeoTiffSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn block(&self) -> (u32, u32) {
        self.image.block
    }

    fn encode(
        &self,
        _band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        match heights {
            HeightSlice::F32(heights) => self.image.encode(&self.codec, rect, heights, out),
            HeightSlice::F64(heights) => self.image.encode(&self.codec, rect, heights, out),
        }
        .map_err(|e| e.in_file(self.target.path()))
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        let mut blocks = lock(&self.blocks);
        blocks.append(bytes)?;
        if front(&self.directory, self.form) + blocks.bytes() > self.form.most() {
            return Err(tiff::too_large().in_file(self.target.path()));
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        let Self { target, image, directory, form, blocks, .. } = *self;
        let (_, sizes) = unlocked(blocks).finish(image.blocks())?;
        let mut out = BufWriter::new(target.file());
        let data = front(&directory, form);
        let places = TiffOffsets { at: form.start(), next: 0, data };
        out.seek(SeekFrom::Start(0))
            .and_then(|_| out.write_all(&form.header()))
            .and_then(|()| directory.write(&mut out, form, places, &sizes))
            .and_then(|()| out.flush())
            .map_err(|e| Error::write(target.path(), e))?;
        drop(out);
        target.commit()
    }
}
