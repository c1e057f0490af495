//! GeoTIFF and BigTIFF: our own directory parser and decode path, by window and out of core.
//!
//! Compressed blocks are decoded outside any lock and kept in a bounded cache; uncompressed ones
//! are read row by row straight from the file, whatever their size.

mod blocks;
mod codec;
mod gdal;
mod geokeys;
mod georef;
mod ifd;
mod layout;
mod predictor;
mod tags;

use std::path::Path;

use crate::error::{Error, ErrorKind, Result};
use crate::geom::{Affine, Crs, Rect};
use crate::raster::cache::{Block, BlockCache};
use crate::raster::file::RawFile;
use crate::raster::sample::{Height, ToHeight};
use crate::raster::{GridInfo, GridSource, OpenOptions, RasterFormat, Window, normal_unit, store};

use blocks::{Blocks, Place};
use codec::Compression;
use geokeys::GeoKeys;
use georef::Georeference;
use ifd::Directory;
use layout::Layout;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "GeoTIFF",
    extensions: &["tif", "tiff", "gtiff", "btf", "tf8"],
    about: "classic and BigTIFF; strips and tiles; none, LZW, deflate, packbits, zstd",
    sniff: ifd::is_tiff,
    open,
};

/// Opens a GeoTIFF; a store written by terrane is recognised first and mapped.
fn open(path: &Path, options: &OpenOptions) -> Result<Box<dyn GridSource>> {
    if let Some(store) = store::try_open(path, options)? {
        return Ok(store);
    }
    let source = GeoTiff::open(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(source))
}

/// An open GeoTIFF.
struct GeoTiff {
    file: RawFile,
    info: GridInfo,
    blocks: Blocks,
    to_height: ToHeight,
    cache: BlockCache,
}

impl GeoTiff {
    fn open(path: &Path, options: &OpenOptions) -> Result<Self> {
        let file = RawFile::open(path)?;
        let directory = Directory::read(&file)?;
        let layout = Layout::read(&directory)?;
        check_band(options.band, layout.bands)?;
        check_cache(&layout, options.cache_bytes)?;
        let info = describe(&directory, &layout, options)?;
        let blocks = Blocks::read(&directory, layout, options.band - 1, &file)?;
        let to_height = ToHeight::of(&info);
        Ok(Self { file, info, blocks, to_height, cache: BlockCache::new(options.cache_bytes) })
    }

    fn read<H: Height>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window = Window::new(&self.info, rect, out).map_err(|e| e.in_file(self.path()))?;
        let layout = &self.blocks.layout;
        for (bx, by) in blocks_touching(layout, rect) {
            let part = layout.block_rect(bx, by).intersect(&rect);
            match self.blocks.place(bx, by, &self.file)? {
                None => self.fill_sparse(part, &mut window),
                Some(place) if layout.compression == Compression::None => {
                    self.read_raw((bx, by), place, part, &mut window)?;
                }
                Some(place) => self.read_decoded((bx, by), place, part, &mut window)?,
            }
        }
        Ok(())
    }

    fn path(&self) -> &Path {
        self.file.path()
    }

    /// Blocks that were never written are nodata; without a declared nodata they are zeros.
    fn fill_sparse<H: Height>(&self, part: Rect, window: &mut Window<'_, H>) {
        let sparse = match self.info.nodata {
            Some(_) => H::VOID,
            None => H::of_f64(self.info.offset),
        };
        (0..part.height).for_each(|row| window.row(part, row).fill(sparse));
    }

    fn read_raw<H: Height>(
        &self,
        block: (u32, u32),
        place: Place,
        part: Rect,
        window: &mut Window<'_, H>,
    ) -> Result<()> {
        self.blocks.read_raw(block, place, part, &self.file, |row, samples| {
            self.to_height.convert(samples, window.row(part, row as u32));
        })
    }

    fn read_decoded<H: Height>(
        &self,
        (bx, by): (u32, u32),
        place: Place,
        part: Rect,
        window: &mut Window<'_, H>,
    ) -> Result<()> {
        let samples = self.decoded(bx, by, place)?;
        let block = self.blocks.layout.block_rect(bx, by);
        let size = self.info.sample_type.bytes();
        let pitch = self.blocks.layout.block_width as usize * size;
        let first = (part.col - block.col) as usize * size;
        for row in 0..part.height {
            let start = (part.row - block.row + row) as usize * pitch + first;
            let bytes = &samples[start..][..part.width as usize * size];
            self.to_height.convert(bytes, window.row(part, row));
        }
        Ok(())
    }

    fn decoded(&self, bx: u32, by: u32, place: Place) -> Result<Block> {
        let number = self.blocks.number(bx, by);
        self.cache.get(number, || self.blocks.decode(bx, by, place, &self.file))
    }
}

impl GridSource for GeoTiff {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.read(rect, out)
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.read(rect, out)
    }

    /// Forgets the blocks that lie wholly inside `rect`.
    fn release(&self, rect: Rect) {
        let rect = rect.intersect(&self.info.bounds());
        let layout = &self.blocks.layout;
        for (bx, by) in blocks_touching(layout, rect) {
            let block = layout.block_rect(bx, by);
            if block.intersect(&rect) == block {
                self.cache.forget(self.blocks.number(bx, by));
            }
        }
    }
}

/// Blocks with samples in `rect` (inside the grid), row by row.
fn blocks_touching(layout: &Layout, rect: Rect) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (layout.block_width, layout.block_height);
    let columns = rect.col / width..rect.end_col().div_ceil(width);
    let rows = rect.row / height..rect.end_row().div_ceil(height);
    let (columns, rows) = if rect.is_empty() { (0..0, 0..0) } else { (columns, rows) };
    rows.flat_map(move |by| columns.clone().map(move |bx| (bx, by)))
}

fn check_band(band: u32, bands: u32) -> Result<()> {
    if (1..=bands).contains(&band) {
        return Ok(());
    }
    let has = if bands == 1 { "1 band".to_owned() } else { format!("{bands} bands") };
    Err(Error::usage(format!("band {band} is out of range: the file has {has}"))
        .remedy(format!("give --band from 1 to {bands}")))
}

/// A compressed block is decoded whole, so it has to fit.
fn check_cache(layout: &Layout, cache_bytes: usize) -> Result<()> {
    let bytes = layout.block_bytes(layout.block_height);
    if layout.compression == Compression::None || bytes <= cache_bytes as u64 {
        return Ok(());
    }
    let message = format!(
        "one block takes {bytes} bytes decoded, more than the {cache_bytes} bytes for cached blocks"
    );
    Err(Error::new(ErrorKind::Resource, message).remedy(
        "give more --memory, or rewrite the file in tiles: gdal_translate -co TILED=YES IN OUT",
    ))
}

/// Everything the directory says of the grid.
fn describe(directory: &Directory<'_>, layout: &Layout, options: &OpenOptions) -> Result<GridInfo> {
    let keys = GeoKeys::read(directory)?;
    let pixel_is_point = keys.pixel_is_point();
    let georeference = georef::read(directory, pixel_is_point)?;
    let items = gdal::band_items(directory, options.band)?;
    let nodata = match options.nodata {
        Some(value) => Some(value),
        None => gdal::nodata(directory)?,
    };
    let transform = match georeference {
        Georeference::Affine(map) => Some(map),
        _ => None,
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
        details: details(directory, layout, &items, georeference),
    })
}

/// The band's own unit is preferred to that of the vertical system.
fn crs(keys: GeoKeys, items: &gdal::BandItems) -> Crs {
    let mut crs = keys.into_crs();
    if let Some(unit) = &items.unit {
        crs.vertical_unit = Some(normal_unit(unit));
    }
    crs
}

fn details(
    directory: &Directory<'_>,
    layout: &Layout,
    items: &gdal::BandItems,
    georeference: Georeference,
) -> Vec<(String, String)> {
    let kind = if directory.big { "BigTIFF" } else { "classic TIFF" };
    let mut details = vec![("container".to_owned(), kind.to_owned())];
    details.extend(layout.details());
    if let Some(description) = &items.description {
        details.push(("band description".to_owned(), description.clone()));
    }
    if georeference == Georeference::ControlPoints {
        let ignored = "control points only, not used".to_owned();
        details.push(("georeference".to_owned(), ignored));
    }
    details
}
