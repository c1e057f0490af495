//! Reader of GeoTIFF and BigTIFF, by window, out of core. A block is a strip or a tile of the file.
//!
//! Compressed blocks are decoded as a whole, outside any lock, and kept in a bounded cache. Uncompressed blocks may have
//! any size: only the requested part of each row is read from the file.

mod blocks;
mod codec;
mod gdal;
mod geokeys;
mod georef;
mod ifd;
mod image;
mod layout;
mod lerc;
mod lzw;
mod mask;
mod predictor;
mod prefetch;
mod tags;

use std::path::Path;
use std::sync::{Arc, OnceLock};

use crate::cache::SharedBlocks;
use crate::format::{GridOpenOptions, RasterFormat};
use crate::grid::{GridInfo, GridSource, unit_and_text};
use crate::notes::MASK;
use crate::sample::{HeightSample, ToHeight};
use crate::window::SampleWindow;
use crate::{sidecars, tiled_tiff, world};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, GeoKeys, Rect};
use terrane_files::{RawFile, is_remote};

use georef::Georeference;
use ifd::GeoTiffDirectory;
use image::{GeoTiffImage, check_cache};
use layout::GeoTiffLayout;
use mask::GeoTiffMask;

/// The entry in the list of raster formats.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "GeoTIFF",
    extensions: &["tif", "tiff", "gtiff", "btf", "tf8"],
    about: "classic and BigTIFF, strips or tiles; uncompressed, LZW, DEFLATE, PackBits, ZSTD, LERC",
    sniff: ifd::is_tiff,
    open,
};

/// Extensions of world files, which are read if the TIFF itself has no affine georeference.
const WORLD_ENDINGS: [&str; 4] = ["tfw", "tifw", "tiffw", "wld"];

/// Opens a GeoTIFF. A TIFF that terrane wrote as a store (`-f store`) is memory-mapped instead, unless it has a `.msk`
/// sidecar: the mapped reader knows no masks.
fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let may_be_mapped = !is_remote(path) && sidecars::mask(path).is_none();
    if may_be_mapped && let Some(store) = tiled_tiff::try_open(path, options)? {
        return Ok(store);
    }
    let source = GeoTiff::open(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(source))
}

/// One band of an open GeoTIFF, with the masks that make samples void.
struct GeoTiff {
    image: GeoTiffImage,
    /// Internal mask, `.msk` sidecar and alpha band, as far as the file has them.
    masks: Vec<GeoTiffMask>,
    info: GridInfo,
    /// Stored samples to heights: nodata, scale, offset.
    to_height: ToHeight,
    /// Decoded blocks of the image and of all masks.
    cache: SharedBlocks,
    /// What will be read from the top.
    expected: OnceLock<Rect>,
}

impl GeoTiff {
    fn open(path: &Path, options: &GridOpenOptions) -> Result<Self> {
        let file = Arc::new(RawFile::open(path)?);
        let directory = GeoTiffDirectory::read(&file)?;
        let layout = GeoTiffLayout::read(&directory)?;
        check_band(options.band, layout.bands)?;
        let (band, cache) = (options.band - 1, options.blocks());
        let cache_bytes = cache.max_bytes();
        check_cache(&layout, cache_bytes)?;
        let mut info = describe(path, &directory, &layout, options)?;
        let image = GeoTiffImage::new(&file, &directory, layout, band, 0)?;
        let (file, directory, layout) = (&file, &directory, &image.blocks.layout);
        let masks = mask::find(mask::MaskedGrid { file, directory, layout, band, cache_bytes })?;
        info.details.extend(masks.iter().map(|mask| (MASK.to_owned(), mask.name.clone())));
        let to_height = ToHeight::of(&info);
        Ok(Self { image, masks, info, to_height, cache, expected: OnceLock::new() })
    }

    /// The images of the grid and of its masks.
    fn images(&self) -> impl Iterator<Item = &GeoTiffImage> {
        self.masks.iter().map(|mask| &mask.image).chain([&self.image])
    }

    /// Reads the heights of `rect` into `out`, row by row; voids are NaN.
    fn read<H: HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window = SampleWindow::new(&self.info, rect, out)
            .map_err(|e| e.in_file(self.image.file.path()))?;
        if self.image.file.is_remote() {
            let expected = self.expected.get().copied().unwrap_or(rect);
            self.images().try_for_each(|image| image.prefetch(rect, expected))?;
        }
        let sparse = self.sparse_height();
        self.image.each_row(rect, &self.cache, |part, row, samples| {
            let heights = window.row(part, row);
            match samples {
                Some(samples) => self.to_height.convert(samples, heights),
                None => heights.fill(sparse),
            }
        })?;
        self.masks.iter().try_for_each(|mask| mask.apply(rect, &self.cache, &mut window))
    }

    /// The height of samples in sparse blocks, which are not in the file: void if a nodata value is declared, otherwise
    /// that of the stored value 0.
    fn sparse_height<H: HeightSample>(&self) -> H {
        match self.info.nodata {
            Some(_) => H::VOID,
            // Scale times 0, plus the offset.
            None => H::of_f64(self.info.offset),
        }
    }
}

impl GridSource for GeoTiff {
    reads_alike!();

    /// Size in bytes of the largest decoded block of image and masks; 0 if all are read by rows.
    fn block_bytes(&self) -> u64 {
        let layouts = self.images().map(|image| &image.blocks.layout);
        layouts.filter(|l| !l.is_read_by_rows()).map(GeoTiffLayout::peak_bytes).max().unwrap_or(0)
    }

    fn release(&self, rect: Rect) {
        let rect = rect.intersect(&self.info.bounds());
        self.images().for_each(|image| image.release(rect, &self.cache));
    }

    fn advise_read(&self, rect: Rect) {
        // What was expected first is the larger part.
        let _ = self.expected.set(rect);
    }
}

/// Fails if the file with `bands` bands has no band `band` (from 1).
fn check_band(band: u32, bands: u32) -> Result<()> {
    if (1..=bands).contains(&band) {
        return Ok(());
    }
    let has = if bands == 1 { "1 band".to_owned() } else { format!("{bands} bands") };
    Err(Error::usage(format!("band {band} is out of range: the file has {has}"))
        .remedy(format!("pass ‹band› 1 to {bands}")))
}

/// The metadata of the grid, from the tags of the directory, the options and a world file.
fn describe(
    path: &Path,
    directory: &GeoTiffDirectory<'_>,
    layout: &GeoTiffLayout,
    options: &GridOpenOptions,
) -> Result<GridInfo> {
    let keys = geokeys::read(directory)?;
    let pixel_is_point = keys.pixel_is_point();
    let georeference = georef::read(directory, pixel_is_point)?;
    let items = gdal::band_items(directory, options.band)?;
    let nodata = match options.nodata {
        // The option replaces the tag, as the tag may be wrong.
        Some(value) => Some(value),
        None => gdal::nodata(directory)?,
    };
    let transform = match georeference {
        Georeference::Affine(map) => Some(map),
        _ => world::sidecar_transform(path, &WORLD_ENDINGS)?,
    };
    Ok(GridInfo {
        width: layout.width,
        height: layout.height,
        transform: transform.unwrap_or(Affine::LATTICE),
        georeferenced: transform.is_some(),
        pixel_is_point,
        crs: crs(keys, &items),
        sample_type: layout.sample_type,
        nodata,
        scale: items.scale,
        offset: items.offset,
        block: (layout.block_width, layout.block_height),
        bands: layout.bands,
        band: options.band,
        format: FORMAT.name,
        details: details(directory, layout, &items, georeference, transform.is_some()),
    })
}

/// The CRS of the GeoKeys. The vertical unit in the metadata of the band takes precedence over that of the vertical CRS.
fn crs(keys: GeoKeys, items: &gdal::BandItems) -> Crs {
    let mut crs = keys.into_crs();
    if let Some(unit) = &items.unit {
        let (unit, text) = unit_and_text(unit);
        (crs.vertical_unit, crs.vertical_unit_text) = (Some(unit), text);
    }
    crs
}

/// Names and values for `terrane info`; `has_transform` is true if the grid has an affine georeference, of the file or
/// of a world file.
fn details(
    directory: &GeoTiffDirectory<'_>,
    layout: &GeoTiffLayout,
    items: &gdal::BandItems,
    georeference: Georeference,
    has_transform: bool,
) -> Vec<(String, String)> {
    let kind = if directory.big { "BigTIFF" } else { "classic TIFF" };
    let mut details = vec![("container".to_owned(), kind.to_owned())];
    details.extend(layout.details());
    for (name, text) in [("grid type", &items.kind), ("band description", &items.description)] {
        details.extend(text.iter().map(|text| (name.to_owned(), text.clone())));
    }
    if georeference == Georeference::ControlPoints && !has_transform {
        let ignored = "control points only, not used".to_owned();
        details.push(("georeference".to_owned(), ignored));
    }
    details
}
