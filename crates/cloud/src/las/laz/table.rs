//! The chunk table of a LAZ file, checked entry by entry against the file length, and recovery of chunks without it.

use std::io::Cursor;

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::IntegerDecompressorBuilder;

use crate::las::bytes::LasHeaderBytes;
use crate::las::header::LasHeader;
use crate::lazip::FieldSelection;
use terrane_base::error::{Error, Result};
use terrane_files::RawFile;

use super::{ChunkDecoder, LazCompressor, LazLayout, layers};

/// Bytes of the offset of the table, before the first chunk or, if it could not be written later, at the end of the
/// file.
const POINTER_BYTES: u64 = 8;
/// Size of the tables of most files.
const TABLE_BYTES: u64 = 1 << 18;
/// Bytes of the table's version and number of entries.
const HEAD_BYTES: u64 = 8;
/// Generous maximum bytes of an entry: two numbers of at most 32 bits and their lengths.
const MAX_ENTRY_BYTES: u64 = 16;

/// A run of points that is compressed independently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LazChunk {
    pub(crate) at: u64,
    pub(crate) bytes: u64,
    pub(crate) points: u64,
}

/// The chunks of a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum LazChunkTable {
    /// Independent chunks.
    Chunks(Vec<LazChunk>),
    /// All points in one stream.
    Stream(LazChunk),
}

/// Further findings.
#[derive(Default)]
pub(crate) struct LazTableFindings {
    /// A note.
    pub(crate) note: Option<String>,
    /// Possible points of the table beyond those of the header.
    pub(crate) more: u64,
}

/// Prefetches the table, so that a network failure is not taken for a missing table.
fn prefetch(file: &RawFile, start: u64) -> Result<()> {
    if !file.is_remote() || file.check_range(start, POINTER_BYTES).is_err() {
        return Ok(());
    }
    let pointer = file.read_vec(start, POINTER_BYTES)?;
    let at = pointer.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
    let end = at.saturating_add(TABLE_BYTES).min(file.size());
    let table = at.min(end)..end;
    file.prefetch(&[table], &[])
}

/// The table of `file`; with `salvage`, chunks are recovered without a damaged table.
pub(crate) fn read(
    file: &RawFile,
    header: &LasHeader,
    layout: &LazLayout,
    salvage: bool,
) -> Result<(LazChunkTable, LazTableFindings)> {
    let start = header.points_at;
    if layout.compressor == LazCompressor::Stream {
        let bytes = file.size() - start;
        return Ok((
            LazChunkTable::Stream(LazChunk { at: start, bytes, points: header.count }),
            LazTableFindings::default(),
        ));
    }
    let first = start.saturating_add(POINTER_BYTES);
    prefetch(file, start)?;
    let found = entries(file, header, layout, first);
    match found {
        Ok((chunks, more)) => {
            Ok((LazChunkTable::Chunks(chunks), LazTableFindings { note: None, more }))
        }
        // Without points a table is optional.
        Err(_) if header.count == 0 => {
            Ok((LazChunkTable::Chunks(Vec::new()), LazTableFindings::default()))
        }
        Err(missing) if salvage || missing.is_unfinished => {
            let table = without(file, header, layout, first)?;
            let note = format!("{}; chunks were located without it", missing.what);
            Ok((table, LazTableFindings { note: Some(note), more: 0 }))
        }
        Err(missing) => Err(Error::bad_input(missing.what)
            .remedy("copy the file again, or read the good part with ‹salvage›")),
    }
}

/// Why the table is missing.
struct MissingChunkTable {
    what: String,
    /// The writer was interrupted; nothing is damaged.
    is_unfinished: bool,
}

fn missing(what: impl Into<String>) -> MissingChunkTable {
    MissingChunkTable { what: what.into(), is_unfinished: false }
}

/// The 64-bit offset stored at byte `at`.
fn pointer(file: &RawFile, at: u64) -> Option<i64> {
    let bytes = file.read_vec(at, POINTER_BYTES).ok()?;
    Some(LasHeaderBytes(&bytes).u64(0) as i64)
}

/// Offset of the table: before the first chunk, or at the end of the file.
fn place(file: &RawFile, first: u64) -> std::result::Result<u64, MissingChunkTable> {
    let stated = pointer(file, first - POINTER_BYTES)
        .ok_or_else(|| missing("the file ends before its points"))?;
    let place = u64::try_from(stated).ok().filter(|at| *at >= first);
    // Writers that cannot seek leave -1 there and append the offset to the file.
    let last = file.size().checked_sub(POINTER_BYTES).filter(|at| *at >= first);
    let place = place.or_else(|| {
        let appended = u64::try_from(pointer(file, last?)?).ok();
        appended.filter(|at| *at >= first && *at < file.size())
    });
    let Some(place) = place else {
        let what = "the chunk table was not written".to_owned();
        return Err(MissingChunkTable { what, is_unfinished: stated <= 0 });
    };
    match place.checked_add(HEAD_BYTES) {
        Some(end) if end <= file.size() => Ok(place),
        _ => Err(missing(format!(
            "file is truncated: the chunk table offset is {place}, the file ends at byte {}",
            file.size()
        ))),
    }
}

/// The entries, which are consecutive from `first` and hold all points; and the number of possible further points.
fn entries(
    file: &RawFile,
    header: &LasHeader,
    layout: &LazLayout,
    first: u64,
) -> std::result::Result<(Vec<LazChunk>, u64), MissingChunkTable> {
    let place = place(file, first)?;
    let unreadable = |e: Error| missing(e.to_string());
    let head = file.read_vec(place, HEAD_BYTES).map_err(unreadable)?;
    let (version, count) = (LasHeaderBytes(&head).u32(0), u64::from(LasHeaderBytes(&head).u32(4)));
    // A chunk begins with a whole point.
    let most = (place - first) / layout.record.max(1) as u64 + 1;
    if version != 0 || count > most {
        return Err(missing(format!(
            "the chunk table is invalid: {count} chunks, version {version}"
        )));
    }
    let bytes = (count * MAX_ENTRY_BYTES + MAX_ENTRY_BYTES).min(file.size() - place - HEAD_BYTES);
    let packed = file.read_vec(place + HEAD_BYTES, bytes).map_err(unreadable)?;
    let sizes = unpack(&packed, count, layout.chunk_points.is_none())
        .ok_or_else(|| missing("the chunk table is damaged"))?;
    placed(&sizes, header.count, layout, first..place)
}

/// Number of points, if stored, and bytes of each chunk.
fn unpack(packed: &[u8], count: u64, has_points: bool) -> Option<Vec<(u32, u32)>> {
    if count == 0 {
        return Some(Vec::new());
    }
    let mut numbers = IntegerDecompressorBuilder::new().bits(32).contexts(2).build_initialized();
    let mut decoder = ArithmeticDecoder::new(Cursor::new(packed));
    decoder.read_init_bytes().ok()?;
    // The count was held against the bytes before the table: each chunk begins with a whole point.
    let mut sizes: Vec<(u32, u32)> = Vec::with_capacity(count as usize);
    let mut last = (0_u32, 0_u32);
    for _ in 0..count {
        if has_points {
            last.0 = numbers.decompress(&mut decoder, last.0 as i32, 0).ok()? as u32;
        }
        last.1 = numbers.decompress(&mut decoder, last.1 as i32, 1).ok()? as u32;
        sizes.push(last);
    }
    Some(sizes)
}

fn placed(
    sizes: &[(u32, u32)],
    count: u64,
    layout: &LazLayout,
    room: std::ops::Range<u64>,
) -> std::result::Result<(Vec<LazChunk>, u64), MissingChunkTable> {
    let (mut at, mut left, mut more) = (room.start, count, 0);
    let mut chunks = Vec::with_capacity(sizes.len());
    for (number, (points, bytes)) in sizes.iter().enumerate() {
        let bytes = u64::from(*bytes);
        if bytes > room.end - at {
            return Err(missing(format!(
                "the chunk table states {bytes} bytes for chunk {number}, {} are left",
                room.end - at
            )));
        }
        let all = u64::from(layout.chunk_points.unwrap_or(*points));
        let points = all.min(left);
        if points > 0 {
            chunks.push(LazChunk { at, bytes, points });
        } else if bytes >= layout.record as u64 {
            // A chunk begins with a whole point.
            more += all;
        }
        (at, left) = (at + bytes, left - points);
    }
    // Bytes that no entry covers mean that an entry was read wrong: nothing else tells a damaged table
    // whose numbers happen to fit.
    if at < room.end {
        let (has, bytes) = (at - room.start, room.end - room.start);
        return Err(missing(format!("the chunk table covers {has} of {bytes} bytes of points")));
    }
    if left > 0 {
        let has = count - left;
        return Err(missing(format!("the chunk table covers {has} of {count} points")));
    }
    Ok((chunks, more))
}

/// The chunks of a file without a table: layered ones state their lengths, others are decoded to find their ends.
fn without(
    file: &RawFile,
    header: &LasHeader,
    layout: &LazLayout,
    first: u64,
) -> Result<LazChunkTable> {
    let first = first.min(file.size());
    let chunks = match (layout.compressor, layout.chunk_points) {
        (LazCompressor::Layers, _) => walk(file, header, layout, first)?,
        (_, Some(chunk_points)) => follow(file, layout, first, header.count, chunk_points)?,
        (_, None) => {
            let what = "chunks of variable size cannot be located without the chunk table";
            return Err(Error::bad_input(what).remedy("copy the file again"));
        }
    };
    Ok(LazChunkTable::Chunks(chunks))
}

/// Chunks of `chunk_points` points from byte `at`, decoded to their ends, up to the first damaged one.
fn follow(
    file: &RawFile,
    layout: &LazLayout,
    mut at: u64,
    mut left: u64,
    chunk_points: u32,
) -> Result<Vec<LazChunk>> {
    let (mut unpacker, mut chunks) = (ChunkDecoder::default(), Vec::new());
    while left > 0 && at < file.size() {
        let points = u64::from(chunk_points).min(left);
        let found = unpacker.stream(
            layout,
            file,
            at,
            points,
            FieldSelection::default(),
            &mut |_| Ok(()),
        )?;
        let Ok(bytes) = found else { break };
        chunks.push(LazChunk { at, bytes, points });
        (at, left) = (at + bytes, left - points);
    }
    Ok(chunks)
}

/// Layered chunks by their headers, as far as they are complete.
fn walk(
    file: &RawFile,
    header: &LasHeader,
    layout: &LazLayout,
    first: u64,
) -> Result<Vec<LazChunk>> {
    let head = layers::head_bytes(layout);
    let (mut at, mut left, mut chunks) = (first, header.count, Vec::new());
    while left > 0 && head <= file.size() - at {
        let bytes = file.read_vec(at, head)?;
        let (points, bytes) = layers::claims(layout, &bytes);
        let fits = bytes <= file.size() - at;
        let is_full = layout.chunk_points.is_none_or(|full| points == u64::from(full).min(left));
        if !fits || !is_full || points == 0 || points > left {
            break;
        }
        chunks.push(LazChunk { at, bytes, points });
        (at, left) = (at + bytes, left - points);
    }
    Ok(chunks)
}
