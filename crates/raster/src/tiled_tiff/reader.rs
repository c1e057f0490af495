//! Reader of stores: recognised, validated byte by byte up to the tiles, and memory-mapped.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use super::crs::GeoKeyTags;
use super::header::{MARK, TiledTiffGeoreference, TiledTiffHeader, sample_type};
use super::layout::TiledTiffLayout;
use super::map::MappedFile;
use super::metadata::GdalMetadata;
use super::sample::{SampleCodec, TiledTiffHeight};
use super::tags::{ENTRY, MAGIC, START, TiffTagValues, TiledTiffPreamble, tag, value_bytes};
use crate::format::GridOpenOptions;
use crate::grid::{GridInfo, GridSource};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;

/// Opens `path` if it is a store of this version, with every byte outside the tiles as this version writes
/// it; `None` otherwise. Fails if the file cannot be read, or lacks the requested band.
pub fn try_open(path: &Path, options: &GridOpenOptions) -> Result<Option<Box<dyn GridSource>>> {
    let mut file = File::open(path).map_err(|e| Error::read(path, e))?;
    let facts = file.metadata().map_err(|e| Error::read(path, e))?;
    if !facts.is_file() {
        return Ok(None);
    }
    let found = recognise(&mut file, facts.len()).map_err(|e| Error::read(path, e))?;
    let Some((header, front, mut info)) = found else { return Ok(None) };
    if options.band != 1 {
        return Err(Error::usage(format!("band {} does not exist", options.band))
            .in_file(path)
            .remedy("omit ‹band›: the file has one band"));
    }
    info.nodata = options.nodata.or(info.nodata);
    let map = MappedFile::new(&file).map_err(|e| Error::read(path, e))?;
    let (codec, data) = (SampleCodec::new(&info), front.data as usize);
    Ok(Some(Box::new(MappedTiledTiff { info, layout: header.layout, codec, map, data })))
}

/// The metadata of a valid store; `None` for any other file.
fn recognise(
    file: &mut File,
    length: u64,
) -> io::Result<Option<(TiledTiffHeader, TiledTiffPreamble, GridInfo)>> {
    let Some(tags) = read_tags(file, length)? else { return Ok(None) };
    let Some(header) = parse(&tags) else { return Ok(None) };
    let Some(info) = header.info() else { return Ok(None) };
    let front = header.front();
    let expected = header.layout.tiles().checked_mul(header.layout.tile_bytes());
    if expected.and_then(|tiles| tiles.checked_add(front.data)) != Some(length) {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(0))?;
    for piece in front.pieces() {
        if !next_bytes_are(file, &piece)? {
            return Ok(None);
        }
    }
    Ok(Some((header, front, info)))
}

fn next_bytes_are(file: &mut File, expected: &[u8]) -> io::Result<bool> {
    let mut found = vec![0; expected.len()];
    file.read_exact(&mut found)?;
    Ok(found == expected)
}

/// The directory of a file that begins like a store. Reads and allocations are limited to the file size and
/// to the limit of header values.
fn read_tags(file: &mut File, length: u64) -> io::Result<Option<Vec<(u16, TiffTagValues)>>> {
    let mut start = [0; START + 8];
    if length < start.len() as u64 {
        return Ok(None);
    }
    file.read_exact(&mut start)?;
    let (magic, count) = start.split_at(START);
    let count = u64::from_le_bytes(count.try_into().unwrap_or_default());
    if magic != MAGIC || count > limits::MAX_IFD_ENTRIES || length < count * ENTRY as u64 {
        return Ok(None);
    }
    let mut entries = vec![0; count as usize * ENTRY];
    if !read_inside(file, START as u64 + 8, length, &mut entries)? {
        return Ok(None);
    }
    entries.chunks_exact(ENTRY).map(|entry| read_tag(file, length, entry)).collect()
}

/// One tag; `None` if it is not one of a store. Of tile tables only the count is read.
fn read_tag(
    file: &mut File,
    length: u64,
    entry: &[u8],
) -> io::Result<Option<(u16, TiffTagValues)>> {
    let [tag, kind, count, place] = [0..2, 2..4, 4..12, 12..20].map(|range| {
        let bytes = entry.get(range).unwrap_or_default();
        bytes.iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte))
    });
    let (tag, kind) = (tag as u16, kind as u16);
    if [tag::TILE_OFFSETS, tag::TILE_BYTES].contains(&tag) {
        // Not read: they have an entry for each tile, which follows from the layout.
        return Ok(Some((tag, TiffTagValues::Table { count, first: 0, step: 0 })));
    }
    let size = value_bytes(kind).and_then(|size| size.checked_mul(count));
    let max_bytes = limits::MAX_HEADER_BYTES.min(length);
    let Some(size) = size.filter(|size| *size <= max_bytes) else { return Ok(None) };
    let mut bytes = entry.get(12..).unwrap_or_default().to_vec();
    bytes.resize(size as usize, 0);
    if size > 8 && !read_inside(file, place, length, &mut bytes)? {
        return Ok(None);
    }
    Ok(TiffTagValues::decode(kind, &bytes).map(|values| (tag, values)))
}

/// Fills `bytes` from `place`, unless they extend beyond the file.
fn read_inside(file: &mut File, place: u64, length: u64, bytes: &mut [u8]) -> io::Result<bool> {
    if place.checked_add(bytes.len() as u64).is_none_or(|end| end > length) {
        return Ok(false);
    }
    file.seek(SeekFrom::Start(place))?;
    file.read_exact(bytes)?;
    Ok(true)
}

/// The metadata in the tags of a store; `None` if one is missing or invalid.
fn parse(tags: &[(u16, TiffTagValues)]) -> Option<TiledTiffHeader> {
    if text(tags, tag::SOFTWARE)? != MARK {
        return None;
    }
    let (bits, format) = (shorts(tags, tag::BITS), shorts(tags, tag::SAMPLE_FORMAT));
    let layout = TiledTiffLayout {
        width: long(tags, tag::WIDTH)?,
        height: long(tags, tag::HEIGHT)?,
        tile_width: long(tags, tag::TILE_WIDTH)?,
        tile_height: long(tags, tag::TILE_HEIGHT)?,
        sample_type: sample_type(*bits.first()?, *format.first()?)?,
    };
    layout.check().ok()?;
    let georeference = [tag::PIXEL_SCALE, tag::TIEPOINT, tag::MATRIX].map(|tag| doubles(tags, tag));
    let metadata = text(tags, tag::GDAL_METADATA).map(|xml| GdalMetadata::from_xml(&xml));
    Some(TiledTiffHeader {
        layout,
        position: position(georeference)?,
        keys: GeoKeyTags {
            directory: shorts(tags, tag::GEO_KEYS),
            doubles: doubles(tags, tag::GEO_DOUBLES),
            ascii: text(tags, tag::GEO_ASCII).unwrap_or_default(),
        },
        metadata: metadata.unwrap_or(Some(GdalMetadata::default()))?,
        nodata: text(tags, tag::GDAL_NODATA),
    })
}

fn values(tags: &[(u16, TiffTagValues)], tag: u16) -> Option<&TiffTagValues> {
    tags.iter().find(|(other, _)| *other == tag).map(|(_, values)| values)
}

fn long(tags: &[(u16, TiffTagValues)], tag: u16) -> Option<u32> {
    match values(tags, tag) {
        Some(TiffTagValues::Long(values)) => values.first().copied(),
        _ => None,
    }
}

fn shorts(tags: &[(u16, TiffTagValues)], tag: u16) -> Vec<u16> {
    match values(tags, tag) {
        Some(TiffTagValues::Short(values)) => values.clone(),
        _ => Vec::new(),
    }
}

fn doubles(tags: &[(u16, TiffTagValues)], tag: u16) -> Vec<f64> {
    match values(tags, tag) {
        Some(TiffTagValues::Double(values)) => values.clone(),
        _ => Vec::new(),
    }
}

fn text(tags: &[(u16, TiffTagValues)], tag: u16) -> Option<String> {
    match values(tags, tag) {
        Some(TiffTagValues::Ascii(text)) => Some(text.clone()),
        _ => None,
    }
}

fn position([scale, tiepoint, matrix]: [Vec<f64>; 3]) -> Option<TiledTiffGeoreference> {
    if !matrix.is_empty() {
        return Some(TiledTiffGeoreference::Matrix(matrix));
    }
    if scale.is_empty() && tiepoint.is_empty() {
        return Some(TiledTiffGeoreference::Nowhere);
    }
    let scale = [*scale.first()?, *scale.get(1)?];
    Some(TiledTiffGeoreference::North { scale, origin: [*tiepoint.get(3)?, *tiepoint.get(4)?] })
}

/// A mapped store.
struct MappedTiledTiff {
    info: GridInfo,
    layout: TiledTiffLayout,
    codec: SampleCodec,
    map: MappedFile,
    /// Offset of tile 0.
    data: usize,
}

impl MappedTiledTiff {
    fn read<H: TiledTiffHeight>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        self.check(rect, out.len())?;
        for (across, down) in self.tiles(rect) {
            self.read_tile(across, down, rect, out);
        }
        Ok(())
    }

    fn check(&self, rect: Rect, values: usize) -> Result<()> {
        if rect.fits(self.info.width, self.info.height) && values == rect.len() {
            return Ok(());
        }
        Err(Error::usage(format!("{rect:?} with {values} values is not a window of the store")))
    }

    /// The tiles that overlap `rect`.
    fn tiles(&self, rect: Rect) -> impl Iterator<Item = (u32, u32)> + use<> {
        let TiledTiffLayout { tile_width, tile_height, .. } = self.layout;
        let across = rect.col / tile_width..rect.end_col().div_ceil(tile_width);
        let down = rect.row / tile_height..rect.end_row().div_ceil(tile_height);
        let down = if rect.is_empty() { 0..0 } else { down };
        down.flat_map(move |down| across.clone().map(move |across| (across, down)))
    }

    /// Bytes of a tile in the mapping.
    fn tile_bytes(&self, across: u32, down: u32) -> Range<usize> {
        let bytes = self.layout.tile_bytes() as usize;
        let start = self.data + self.layout.tile(across, down) as usize * bytes;
        start..start + bytes
    }

    fn read_tile<H: TiledTiffHeight>(&self, across: u32, down: u32, rect: Rect, out: &mut [H]) {
        let tile = self.layout.tile_rect(across, down);
        let part = tile.intersect(&rect);
        let range = self.tile_bytes(across, down);
        if part == tile {
            self.map.want(range.clone());
        }
        let rows = self.map[range].chunks_exact(self.layout.row_bytes() as usize);
        let from = (part.col - tile.col) as usize * self.layout.sample_type.bytes();
        let lines = out.chunks_exact_mut(rect.width as usize);
        let lines = lines.skip((part.row - rect.row) as usize).take(part.height as usize);
        let start = (part.col - rect.col) as usize;
        for (stored, line) in rows.skip((part.row - tile.row) as usize).zip(lines) {
            self.codec.decode(&stored[from..], &mut line[start..start + part.width as usize]);
        }
    }
}

impl GridSource for MappedTiledTiff {
    reads_alike!();

    /// As [`copied`](Self::copied): a page that is read again is in the system's cache.
    fn release(&self, rect: Rect) {
        self.copied(rect);
    }

    /// Releases the pages of all tiles that overlap `rect`; otherwise a reader by other pieces than tiles
    /// would keep all pages.
    fn copied(&self, rect: Rect) {
        let rect = rect.intersect(&self.info.bounds());
        for (across, down) in self.tiles(rect) {
            self.map.release(self.tile_bytes(across, down));
        }
    }
}
