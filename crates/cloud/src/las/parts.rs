//! Parts of a LAS or LAZ file: runs of records, compressed chunks, nodes of an octree.

use terrane_base::error::{Error, Result};
use terrane_files::RawFile;

use super::copc::CopcNode;
use super::header::LasHeader;
use super::laz::{self, LazChunk, LazChunkTable, LazLayout};

/// Points of an uncompressed part.
const PLAIN_POINTS: u64 = 1 << 17;

/// A part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LasPart {
    /// Index in the file of its first point.
    pub(crate) first: u64,
    /// Readable points.
    pub(crate) points: u64,
    /// Missing points after these.
    pub(crate) lost: u64,
    pub(super) at: u64,
    pub(super) bytes: u64,
    pub(super) kind: LasPartKind,
    /// World bounds of an octree node.
    pub(crate) cube: Option<[[f64; 3]; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LasPartKind {
    Plain,
    Chunk,
    Stream,
}

impl LasPart {
    fn new(kind: LasPartKind, first: u64, chunk: LazChunk) -> Self {
        let LazChunk { at, bytes, points } = chunk;
        Self { first, points, lost: 0, at, bytes, kind, cube: None }
    }
}

/// Runs of uncompressed records.
pub(super) fn plain(
    header: &LasHeader,
    len: u64,
    salvage: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<LasPart>> {
    let record = u64::from(header.record);
    let there = (len - header.points_at) / record;
    let capacity = header.points_end(len).saturating_sub(header.points_at) / record;
    notes.extend(more(header.count, capacity, salvage)?);
    let count = header.count.min(there);
    if count < header.count && !salvage {
        return Err(lacking(header.count, there));
    }
    let parts = (0..count).step_by(PLAIN_POINTS as usize).map(|first| {
        let points = PLAIN_POINTS.min(count - first);
        let (at, bytes) = (header.points_at + first * record, points * record);
        LasPart::new(LasPartKind::Plain, first, LazChunk { at, bytes, points })
    });
    Ok(with_lost(parts.collect(), header.count))
}

fn lacking(claimed: u64, there: u64) -> Error {
    Error::bad_input(format!(
        "file is truncated or damaged: expected {claimed} points, found {there}"
    ))
    .remedy("copy the file again, or read the good part with ‹salvage›")
}

/// Note on points beyond the count of the header.
///
/// # Errors
/// The header states 0 points: the writer was interrupted.
fn more(claimed: u64, there: u64, salvage: bool) -> Result<Option<String>> {
    let Some(more) = there.checked_sub(claimed).filter(|more| *more > 0) else { return Ok(None) };
    match claimed == 0 && !salvage {
        true => Err(Error::bad_input(format!(
            "the header states 0 points, the file has space for {there} (unfinished file)"
        ))
        .remedy(
            "repair the point count and bounds of the header, for example with lasinfo -repair",
        )),
        false => Ok(Some(format!(
            "{more} possible points after the {claimed} points of the header are ignored"
        ))),
    }
}

/// The nodes of an octree.
pub(super) fn octree(nodes: Vec<CopcNode>) -> Vec<LasPart> {
    let mut first = 0;
    let parts = nodes.into_iter().map(|CopcNode { cube, chunk }| {
        let part = LasPart::new(LasPartKind::Chunk, first, chunk);
        first += chunk.points;
        LasPart { cube: Some(cube), ..part }
    });
    parts.collect()
}

/// Compressed chunks, or one stream.
pub(super) fn packed(
    file: &RawFile,
    header: &LasHeader,
    layout: &LazLayout,
    salvage: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<LasPart>> {
    let (table, found) = laz::table(file, header, layout, salvage)?;
    notes.extend(found.note);
    notes.extend(more(header.count, header.count + found.more, salvage)?);
    let parts = match table {
        LazChunkTable::Stream(chunk) if chunk.points == 0 => Vec::new(),
        LazChunkTable::Stream(chunk) => vec![LasPart::new(LasPartKind::Stream, 0, chunk)],
        LazChunkTable::Chunks(chunks) => {
            let mut first = 0;
            let parts = chunks.into_iter().map(|chunk| {
                let part = LasPart::new(LasPartKind::Chunk, first, chunk);
                first += chunk.points;
                part
            });
            parts.collect()
        }
    };
    let there = parts.iter().map(|part| part.points).sum();
    if there < header.count && !salvage {
        return Err(lacking(header.count, there));
    }
    Ok(with_lost(parts, header.count))
}

/// Adds the points missing to `claimed` to the last part.
fn with_lost(mut parts: Vec<LasPart>, claimed: u64) -> Vec<LasPart> {
    let there: u64 = parts.iter().map(|part| part.points).sum();
    let lost = claimed.saturating_sub(there);
    match parts.last_mut() {
        Some(last) => last.lost = lost,
        None if lost > 0 => {
            let nothing =
                LasPart::new(LasPartKind::Plain, 0, LazChunk { at: 0, bytes: 0, points: 0 });
            parts.push(LasPart { lost, ..nothing });
        }
        None => {}
    }
    parts
}
