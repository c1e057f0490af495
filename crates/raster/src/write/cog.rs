//! Cloud-optimised GeoTIFF: all directories, then the overviews from the smallest, then the full resolution.
//! Encoded blocks are buffered in unnamed files, because overviews and block tables precede the image in the
//! file.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::Mutex;

use super::compress::TiffCompression;
use super::creation::Accepts::{Whole, Words};
use super::creation::{CreationOption, CreationOptions};
use super::directory::{TiffDirectoryBuilder, TiffOffsets, TiffVariant};
use super::format::{GridFormat, GridSink, GridWriteRequest};
use super::level::{self, OverviewLevel, OverviewResampling};
use super::packed::{PackedBlocks, temporary_path};
use super::tiff::{self, SampleCoding, TiffImage};
use crate::grid::{GridInfo, GridSource};
use crate::tiled_tiff::HeightSlice;
use crate::tiled_tiff::header::facts;
use crate::tiled_tiff::metadata::{BandName, number};
use crate::tiled_tiff::sample::{SampleCodec, SampleRounding, TiledTiffHeight};
use crate::tiled_tiff::tags::{TiffTagValues, tag};
use crate::tiled_tiff::writer::check_free_space;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::atomic::AtomicFile;
use terrane_files::{AppendWriter, lock, unlocked};

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "COG",
    extensions: &["tif", "tiff"],
    about: "cloud-optimised GeoTIFF with overviews",
    options: &[
        tiff::COMPRESS,
        tiff::LEVEL,
        tiff::PREDICTOR,
        CreationOption {
            key: "BLOCKSIZE",
            accepts: Whole { least: 64, most: 4096, step: 16 },
            about: "tile size [512]",
        },
        CreationOption {
            key: "OVERVIEWS",
            accepts: Words(&["AUTO", "NONE"]),
            about: "overviews of half the size each, down to a single tile [AUTO]",
        },
        CreationOption {
            key: "OVERVIEW_RESAMPLING",
            accepts: Words(&["AVERAGE", "NEAREST"]),
            about: "mean of the valid samples of 2 x 2, or the upper left sample [AVERAGE]",
        },
        CreationOption {
            key: "RESAMPLING",
            accepts: Words(&["AVERAGE", "NEAREST"]),
            about: "alias of OVERVIEW_RESAMPLING, used if that is not set",
        },
        tiff::BIGTIFF,
    ],
    several_bands: true,
    holds_colours: true,
    holds_types: true,
    names_voids: true,
    bytes_per_sample: 40,
    create: |order| Ok(Box::new(CogSink::new(order)?)),
};

const TILE: u32 = 512;

/// A COG under construction.
struct CogSink {
    target: AtomicFile,
    info: GridInfo,
    bands: Vec<BandName>,
    creation: CreationOptions,
    /// Levels from full resolution down.
    layers: Vec<CogLevel>,
    /// Index of the level being written.
    current: usize,
    codec: SampleCodec,
    how: OverviewResampling,
}

/// A resolution level.
struct CogLevel {
    image: TiffImage,
    blocks: Mutex<PackedBlocks>,
    /// Source heights by band until the level is current; those of the first level are passed in by the
    /// caller.
    heights: Vec<OverviewLevel>,
}

impl CogLevel {
    /// A level whose blocks are kept in an unnamed file in `folder`.
    fn new(image: TiffImage, heights: Vec<OverviewLevel>, folder: &Path) -> Result<Self> {
        let blocks = Mutex::new(PackedBlocks::new(AppendWriter::spool(folder)?));
        Ok(Self { image, blocks, heights })
    }
}

impl CogSink {
    fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        let info = order.stored()?;
        let creation = order.creation.clone();
        let side = creation.number("BLOCKSIZE").unwrap_or(TILE);
        let coding = SampleCoding::of(&creation, info.sample_type, "DEFLATE")?;
        let image = TiffImage {
            width: info.width,
            height: info.height,
            block: (side, side),
            tiled: true,
            sample_type: info.sample_type,
            coding,
            bands: order.options.band_count(),
            are_colours: order.options.are_colours,
        };
        image.check()?;
        let target = AtomicFile::create(order.path, order.options.overwrite)?;
        let (path, folder) = (target.path(), order.options.temp_dir.as_deref());
        let sizes = below(&creation, &image)?;
        let below: Vec<TiffImage> =
            sizes.iter().map(|&(width, height)| TiffImage { width, height, ..image }).collect();
        check_free_space(path, target.file(), reserved_bytes(&image, &below, folder.is_some()))?;
        let spools = temporary_path(path, folder)?;
        let mut layers = vec![CogLevel::new(image, Vec::new(), &spools)?];
        for image in below {
            let heights = (0..image.bands).map(|_| {
                let single = order.info.exact_in_f32();
                OverviewLevel::new(path, folder, image.width, image.height, single)
            });
            layers.push(CogLevel::new(image, heights.collect::<Result<_>>()?, &spools)?);
        }
        let (codec, how) = (order.codec(&info), resampling(&creation));
        let bands = order.options.bands.clone();
        Ok(Self { target, info, bands, creation, layers, current: 0, codec, how })
    }

    fn encode_heights<H: TiledTiffHeight>(
        &self,
        band: u32,
        rect: Rect,
        heights: &[H],
        out: &mut Vec<u8>,
    ) -> Result<()> {
        self.layers[self.current].image.encode(&self.codec, rect, heights, out)?;
        let below = self.layers.get(self.current + 1);
        match below.and_then(|layer| layer.heights.get(band as usize)) {
            Some(level) => level.put(rect, heights, self.how),
            None => Ok(()),
        }
    }

    /// Directory of each level; overviews only have the nodata tag.
    fn directories(&self) -> Result<Vec<TiffDirectoryBuilder>> {
        let nodata = self.info.nodata.map(number);
        let nodata = nodata.map(|text| (tag::GDAL_NODATA, TiffTagValues::Ascii(text)));
        let mut all = vec![self.layers[0].image.directory(facts(&self.info, &self.bands)?, false)];
        let overviews = self.layers.iter().skip(1);
        all.extend(overviews.map(|l| l.image.directory(nodata.iter().cloned().collect(), true)));
        Ok(all)
    }
}

/// Disk space that is certainly needed besides the output, however well blocks compress: uncompressed blocks
/// exist twice at the end, in the output and in the spool, which may be `elsewhere`. Heights of overviews
/// check their space themselves.
fn reserved_bytes(image: &TiffImage, below: &[TiffImage], elsewhere: bool) -> u64 {
    if image.coding.compression != TiffCompression::None {
        return 0;
    }
    let plain =
        below.iter().chain([image]).fold(0_u64, |sum, i| sum.saturating_add(i.plain_bytes()));
    if elsewhere { plain } else { plain.saturating_mul(2) }
}

/// Sizes of the overviews.
fn below(creation: &CreationOptions, image: &TiffImage) -> Result<Vec<(u32, u32)>> {
    if creation.word("OVERVIEWS") == Some("NONE") {
        for key in ["OVERVIEW_RESAMPLING", "RESAMPLING"] {
            creation.refuse(key, "without overviews")?;
        }
        return Ok(Vec::new());
    }
    Ok(level::sizes(image.width, image.height, image.block.0))
}

fn resampling(creation: &CreationOptions) -> OverviewResampling {
    let words = ["OVERVIEW_RESAMPLING", "RESAMPLING"].map(|key| creation.word(key));
    match words.into_iter().flatten().next() {
        Some("NEAREST") => OverviewResampling::Nearest,
        _ => OverviewResampling::Average,
    }
}

impl GridSink for CogSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn block(&self) -> (u32, u32) {
        self.layers[self.current].image.block
    }

    fn encode(
        &self,
        band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        match heights {
            HeightSlice::F32(heights) => self.encode_heights(band, rect, heights, out),
            HeightSlice::F64(heights) => self.encode_heights(band, rect, heights, out),
        }
        .map_err(|e| e.in_file(self.target.path()))
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        lock(&self.layers[self.current].blocks).append(bytes)
    }

    fn next_level(&mut self) -> Result<Option<Vec<Box<dyn GridSource>>>> {
        let Some(next) = self.layers.get_mut(self.current + 1) else { return Ok(None) };
        let heights = std::mem::take(&mut next.heights);
        self.current += 1;
        if self.how == OverviewResampling::Average {
            self.codec = self.codec.rounding(SampleRounding::Aside);
        }
        heights.into_iter().map(OverviewLevel::into_source).collect::<Result<_>>().map(Some)
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        let directories = self.directories()?;
        let Self { target, creation, layers, .. } = *self;
        let bytes: u64 = layers.iter().map(|layer| lock(&layer.blocks).bytes()).sum();
        let exact = front(&directories, TiffVariant::Classic).saturating_add(bytes);
        let plain: u64 = layers.iter().map(|layer| layer.image.plain_bytes()).sum();
        let form = tiff::form(&creation, Some(exact), plain)?;
        let spools = layers.into_iter();
        let spools = spools.map(|layer| unlocked(layer.blocks).finish(layer.image.blocks()));
        let spools = spools.collect::<Result<Vec<_>>>()?;
        let sizes: Vec<&[u32]> = spools.iter().map(|(_, sizes)| &sizes[..]).collect();
        write_directories(target.file(), form, &directories, &sizes)
            .map_err(|e| Error::write(target.path(), e))?;
        let mut out = AppendWriter::of(&target, front(&directories, form))?;
        // Overviews before the image, the smallest first: who reads the head of a COG has them at hand.
        spools.into_iter().rev().try_for_each(|(spool, _)| out.append(spool))?;
        target.commit()
    }
}

/// Offset of the first block.
fn front(directories: &[TiffDirectoryBuilder], form: TiffVariant) -> u64 {
    form.start() + directories.iter().map(|directory| directory.bytes(form)).sum::<u64>()
}

/// Writes the directories from full resolution down; blocks of the given sizes follow from the smallest level
/// up.
fn write_directories(
    file: &File,
    form: TiffVariant,
    directories: &[TiffDirectoryBuilder],
    sizes: &[&[u32]],
) -> io::Result<()> {
    let mut out = BufWriter::new(file);
    out.write_all(&form.header())?;
    let (mut at, mut end) = (form.start(), front(directories, form));
    end += sizes.iter().copied().flatten().map(|size| u64::from(*size)).sum::<u64>();
    for (i, (directory, sizes)) in directories.iter().zip(sizes).enumerate() {
        end -= sizes.iter().map(|size| u64::from(*size)).sum::<u64>();
        let after = at + directory.bytes(form);
        let next = if i + 1 < directories.len() { after } else { 0 };
        directory.write(&mut out, form, TiffOffsets { at, next, data: end }, sizes)?;
        at = after;
    }
    out.flush()
}
