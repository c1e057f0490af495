//! Reading the points of a part, block by block.

use super::LasFile;
use super::laz::ChunkDecoder;
use super::parts::{LasPart, LasPartKind};
use crate::frame::ClaimedExtent;
use crate::lazip::{DecodedFields, FieldSelection};
use terrane_base::error::{Error, Result};

/// Bytes of records that are read at a time: they and their points stay in the cache.
const BLOCK_BYTES: u64 = 1 << 18;

/// Room that a thread keeps for reading.
#[derive(Default)]
pub(crate) struct LasReadBuffers {
    /// As in the file.
    bytes: Vec<u8>,
    unpacker: ChunkDecoder,
}

/// Points that are handed on together.
#[derive(Clone, Copy)]
pub(crate) enum LasPointBlock<'a> {
    /// Whole records.
    Records(&'a [u8]),
    /// The fields that were wanted.
    Fields(&'a DecodedFields),
}

impl<'a> LasPointBlock<'a> {
    /// What was decompressed, as it was wanted.
    fn new(fields: &'a DecodedFields, wanted: FieldSelection) -> Self {
        match wanted.records {
            true => Self::Records(&fields.records),
            false => Self::Fields(fields),
        }
    }
}

/// What takes points: the number of the first one, and the points.
type Each<'a> = dyn FnMut(u64, LasPointBlock<'_>) -> Result<()> + 'a;

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
        wanted: FieldSelection,
        salvage: bool,
        room: &mut LasReadBuffers,
        each: &mut Each<'_>,
    ) -> Result<u64> {
        let found = &self.parts[part];
        let lost = match found.kind {
            LasPartKind::Plain => self.read_plain(found, room, each).map(|()| 0),
            _ => self.read_packed(part, wanted, salvage, room, each),
        };
        Ok(lost.map_err(|e| e.in_file(&self.path))? + found.lost)
    }

    fn read_plain(
        &self,
        part: &LasPart,
        room: &mut LasReadBuffers,
        each: &mut Each<'_>,
    ) -> Result<()> {
        let (file, record) = (self.reopen()?, u64::from(self.header.record));
        let step = (BLOCK_BYTES / record).max(1);
        for first in (0..part.points).step_by(step as usize) {
            let bytes = step.min(part.points - first) * record;
            room.bytes.resize(room.bytes.len().max(bytes as usize), 0);
            let block = &mut room.bytes[..bytes as usize];
            file.read_at(part.at + first * record, block)?;
            each(part.first + first, LasPointBlock::Records(block))?;
        }
        Ok(())
    }

    fn read_packed(
        &self,
        number: usize,
        wanted: FieldSelection,
        salvage: bool,
        room: &mut LasReadBuffers,
        each: &mut Each<'_>,
    ) -> Result<u64> {
        let (Some(layout), part) = (&self.layout, self.parts[number]) else { return Ok(0) };
        let (file, LasReadBuffers { bytes, unpacker }) = (self.reopen()?, room);
        if part.kind == LasPartKind::Chunk {
            bytes.resize(terrane_files::to_usize("chunk", part.bytes)?, 0);
            file.read_at(part.at, bytes)?;
        }
        let mut unpack = |each: &mut dyn FnMut(&DecodedFields) -> Result<()>| match part.kind {
            LasPartKind::Stream => {
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
            each(first, LasPointBlock::new(fields, wanted))
        })?;
        let Err(what) = decoded else { return Ok(0) };
        let last = part.first + part.points - 1;
        Err(Error::bad_input(format!("chunk is damaged: {what}"))
            .at(format_args!("chunk {number}, points {} to {last}", part.first))
            .remedy("copy the file again, or read the good part with ‹salvage›"))
    }

    /// Where points of a part may lie: in the bounds claimed, and in the cube of an octree's node.
    fn reach(&self, part: &LasPart) -> Option<ClaimedExtent> {
        let claim = self.claim()?;
        let Some([low, high]) = part.cube else { return Some(claim) };
        let cube = ClaimedExtent::new(claim.scale, claim.offset, low, high);
        // Points are rounded to steps.
        let low = std::array::from_fn(|i| claim.low[i].max(cube.low[i].saturating_sub(1)));
        let high = std::array::from_fn(|i| claim.high[i].min(cube.high[i].saturating_add(1)));
        Some(ClaimedExtent { low, high, ..claim })
    }
}

/// Whether all points may be what they are: within `reach`, and no return behind the last one.
fn can_be(fields: &DecodedFields, reach: &Option<ClaimedExtent>) -> bool {
    let within = |place: &[i32; 3]| reach.is_some_and(|reach| reach.holds(*place));
    let returned = |bits: &u8| bits >> 4 == 0 || bits & 15 <= bits >> 4;
    fields.places.iter().all(within) && fields.returns.iter().all(returned)
}

#[cfg(test)]
mod tests;
