//! Parts of a LAS or LAZ file: runs of records, compressed chunks, nodes of an octree.

use crate::copc::Node;
use crate::frame::Claim;
use crate::laz::{self, Chunk, Layout, Table, Unpacker};
use crate::lazip::{Fields, Wanted};
use terrane_base::error::{Error, Result};
use terrane_files::RawFile;

use super::{Header, LasFile};

/// Uncompressed points of a part.
const PLAIN_POINTS: u64 = 1 << 17;
/// Bytes of records that are read at a time: they and their points stay in the cache.
const BLOCK_BYTES: u64 = 1 << 18;

/// A part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// Number in the file of its first point.
    pub(crate) first: u64,
    /// Points that may be read.
    pub(crate) points: u64,
    /// Points after these that are not there.
    pub(crate) lost: u64,
    at: u64,
    bytes: u64,
    kind: Kind,
    /// World box of an octree's node.
    pub(crate) cube: Option<[[f64; 3]; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Plain,
    Chunk,
    Stream,
}

/// Room that a thread keeps for reading.
#[derive(Default)]
pub(crate) struct Room {
    /// As in the file.
    bytes: Vec<u8>,
    unpacker: Unpacker,
}

/// Points that are handed on together.
#[derive(Clone, Copy)]
pub(crate) enum Block<'a> {
    /// Whole records.
    Records(&'a [u8]),
    /// The fields that were wanted.
    Fields(&'a Fields),
}

impl<'a> Block<'a> {
    /// What was decompressed, as it was wanted.
    fn new(fields: &'a Fields, wanted: Wanted) -> Self {
        match wanted.records {
            true => Self::Records(&fields.records),
            false => Self::Fields(fields),
        }
    }
}

impl Part {
    fn new(kind: Kind, first: u64, chunk: Chunk) -> Self {
        let Chunk { at, bytes, points } = chunk;
        Self { first, points, lost: 0, at, bytes, kind, cube: None }
    }
}

/// Runs of uncompressed records.
pub(super) fn plain(
    header: &Header,
    len: u64,
    salvage: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<Part>> {
    let record = u64::from(header.record);
    let there = (len - header.points_at) / record;
    let room = header.points_end(len).saturating_sub(header.points_at) / record;
    notes.extend(more(header.count, room, salvage)?);
    let count = header.count.min(there);
    if count < header.count && !salvage {
        return Err(lacking(header.count, there));
    }
    let part = |first: u64| {
        let points = PLAIN_POINTS.min(count - first);
        let (at, bytes) = (header.points_at + first * record, points * record);
        Part::new(Kind::Plain, first, Chunk { at, bytes, points })
    };
    let parts = (0..count).step_by(PLAIN_POINTS as usize).map(part).collect();
    Ok(with_lost(parts, header.count))
}

fn lacking(claimed: u64, there: u64) -> Error {
    Error::bad_input(format!(
        "file is truncated or damaged: {claimed} points claimed, {there} there"
    ))
    .remedy("copy the file again, or read the good part with ‹salvage›")
}

/// What is to be said of points that no header counts.
///
/// # Errors
/// All points are such: whoever wrote them was stopped before the count was known.
fn more(claimed: u64, there: u64, salvage: bool) -> Result<Option<String>> {
    let Some(more) = there.checked_sub(claimed).filter(|more| *more > 0) else { return Ok(None) };
    match claimed == 0 && !salvage {
        true => Err(Error::bad_input(format!(
            "its header claims no points, and there is room for {there}: it was not written to its end"
        ))
        .remedy("put the count and the bounds into the header, for example with lasinfo -repair")),
        false => Ok(Some(format!(
            "behind the {claimed} points that the header claims there is room for {more}, which are not read"
        ))),
    }
}

/// The nodes of an octree.
pub(super) fn octree(nodes: Vec<Node>) -> Vec<Part> {
    let mut first = 0;
    let part = |node: Node| {
        let part = Part { cube: Some(node.cube), ..Part::new(Kind::Chunk, first, node.chunk) };
        first += node.chunk.points;
        part
    };
    nodes.into_iter().map(part).collect()
}

/// Compressed chunks, or one stream.
pub(super) fn packed(
    file: &RawFile,
    header: &Header,
    layout: &Layout,
    salvage: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<Part>> {
    let (table, found) = laz::table(file, header, layout, salvage)?;
    notes.extend(found.note);
    notes.extend(more(header.count, header.count + found.more, salvage)?);
    let parts = match table {
        Table::Stream(chunk) if chunk.points == 0 => Vec::new(),
        Table::Stream(chunk) => vec![Part::new(Kind::Stream, 0, chunk)],
        Table::Chunks(chunks) => {
            let mut first = 0;
            let part = |chunk: Chunk| {
                let part = Part::new(Kind::Chunk, first, chunk);
                first += chunk.points;
                part
            };
            chunks.into_iter().map(part).collect()
        }
    };
    let there = parts.iter().map(|part| part.points).sum();
    if there < header.count && !salvage {
        return Err(lacking(header.count, there));
    }
    Ok(with_lost(parts, header.count))
}

/// The parts, the last of which knows what is missing to `claimed`.
fn with_lost(mut parts: Vec<Part>, claimed: u64) -> Vec<Part> {
    let there: u64 = parts.iter().map(|part| part.points).sum();
    let lost = claimed.saturating_sub(there);
    match parts.last_mut() {
        Some(last) => last.lost = lost,
        None if lost > 0 => {
            let nothing = Part::new(Kind::Plain, 0, Chunk { at: 0, bytes: 0, points: 0 });
            parts.push(Part { lost, ..nothing });
        }
        None => {}
    }
    parts
}

/// What takes points: the number of the first one, and the points.
type Each<'a> = dyn FnMut(u64, Block<'_>) -> Result<()> + 'a;

impl LasFile {
    /// Hands on the points of a part, as whole records if those are wanted or if they are not compressed;
    /// returns how many of its points cannot be read. With `salvage`, a chunk is handed on whole or not
    /// at all: points decode from damaged bytes, too, and nothing tells where in a chunk the damage
    /// begins, only that something in it is not as it can be.
    ///
    /// # Errors
    /// Damage, unless it is passed over, and whatever `each` returns.
    pub(crate) fn records(
        &self,
        part: usize,
        wanted: Wanted,
        salvage: bool,
        room: &mut Room,
        each: &mut Each<'_>,
    ) -> Result<u64> {
        let found = &self.parts[part];
        let lost = match found.kind {
            Kind::Plain => self.read_plain(found, room, each).map(|()| 0),
            _ => self.read_packed(part, wanted, salvage, room, each),
        };
        Ok(lost.map_err(|e| e.in_file(&self.path))? + found.lost)
    }

    fn read_plain(&self, part: &Part, room: &mut Room, each: &mut Each<'_>) -> Result<()> {
        let (file, record) = (self.reopen()?, u64::from(self.header.record));
        let step = (BLOCK_BYTES / record).max(1);
        for first in (0..part.points).step_by(step as usize) {
            let bytes = step.min(part.points - first) * record;
            room.bytes.resize(room.bytes.len().max(bytes as usize), 0);
            let block = &mut room.bytes[..bytes as usize];
            file.read_at(part.at + first * record, block)?;
            each(part.first + first, Block::Records(block))?;
        }
        Ok(())
    }

    fn read_packed(
        &self,
        number: usize,
        wanted: Wanted,
        salvage: bool,
        room: &mut Room,
        each: &mut Each<'_>,
    ) -> Result<u64> {
        let (Some(layout), part) = (&self.layout, self.parts[number]) else { return Ok(0) };
        let (file, Room { bytes, unpacker }) = (self.reopen()?, room);
        if part.kind == Kind::Chunk {
            bytes.resize(terrane_files::to_usize("chunk", part.bytes)?, 0);
            file.read_at(part.at, bytes)?;
        }
        let mut unpack = |each: &mut dyn FnMut(&Fields) -> Result<()>| match part.kind {
            Kind::Stream => {
                let found = unpacker.stream(layout, (&file, part.at), part.points, wanted, each)?;
                Ok(found.map(drop))
            }
            _ => unpacker.chunk(layout, bytes, part.points, wanted, each),
        };
        if salvage {
            let (reach, mut is_sound) = (self.reach(&part), true);
            let whole = unpack(&mut |fields| {
                is_sound &= can_be(fields, &reach);
                Ok(())
            })?;
            if whole.is_err() || !is_sound {
                return Ok(part.points);
            }
        }
        let mut next = part.first;
        let decoded = unpack(&mut |fields| {
            let first = next;
            next += fields.len() as u64;
            each(first, Block::new(fields, wanted))
        })?;
        let Err(what) = decoded else { return Ok(0) };
        let last = part.first + part.points - 1;
        Err(Error::bad_input(format!("it is damaged: {what}"))
            .at(format_args!("chunk {number}, points {} to {last}", part.first))
            .remedy("copy the file again, or read the good part with ‹salvage›"))
    }

    /// Where points of a part may lie: in the bounds claimed, and in the cube of an octree's node.
    fn reach(&self, part: &Part) -> Option<Claim> {
        let claim = self.claim()?;
        let Some([low, high]) = part.cube else { return Some(claim) };
        let cube = Claim::new(claim.scale, claim.offset, low, high);
        // Points are rounded to steps.
        let low = std::array::from_fn(|i| claim.low[i].max(cube.low[i].saturating_sub(1)));
        let high = std::array::from_fn(|i| claim.high[i].min(cube.high[i].saturating_add(1)));
        Some(Claim { low, high, ..claim })
    }
}

/// Whether all points may be what they are: within `reach`, and no return behind the last one.
fn can_be(fields: &Fields, reach: &Option<Claim>) -> bool {
    let within = |place: &[i32; 3]| reach.is_some_and(|reach| reach.holds(*place));
    let returned = |bits: &u8| bits >> 4 == 0 || bits & 15 <= bits >> 4;
    fields.places.iter().all(within) && fields.returns.iter().all(returned)
}

#[cfg(test)]
mod tests;
