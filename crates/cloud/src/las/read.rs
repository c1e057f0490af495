//! Reading the points of a part, block by block.

use super::LasFile;
use super::laz::{ChunkDecoder, LazLayout};
use super::parts::{LasPart, LasPartKind};
use crate::frame::ClaimedExtent;
use crate::lazip::{DecodedFields, FieldSelection};
use terrane_base::error::{Error, Result};
use terrane_files::{AHEAD, RawFile, is_remote};

/// Most later parts of a remote file that are asked for with one.
const MAX_AHEAD: usize = 64;
/// Bytes of records per block; they and their points stay in the cache.
const BLOCK_BYTES: u64 = 1 << 18;

/// Reading buffers of a thread.
#[derive(Default)]
pub(crate) struct LasReadBuffers {
    /// Raw bytes of the file.
    bytes: Vec<u8>,
    unpacker: ChunkDecoder,
}

impl LasReadBuffers {
    /// Decodes a chunk, whose bytes have been read, or a stream.
    fn unpack(
        &mut self,
        layout: &LazLayout,
        file: &RawFile,
        part: &LasPart,
        wanted: FieldSelection,
        each: &mut dyn FnMut(&DecodedFields) -> Result<()>,
    ) -> Result<std::result::Result<(), String>> {
        let Self { bytes, unpacker } = self;
        match part.kind {
            LasPartKind::Stream => {
                let decoded = unpacker.stream(layout, file, part.at, part.points, wanted, each)?;
                Ok(decoded.map(drop))
            }
            _ => unpacker.chunk(layout, bytes, part.points, wanted, each),
        }
    }
}

/// A block of points.
#[derive(Clone, Copy)]
pub(crate) enum LasPointBlock<'a> {
    /// Whole records.
    Records(&'a [u8]),
    /// Selected fields.
    Fields(&'a DecodedFields),
}

impl<'a> LasPointBlock<'a> {
    /// Selects records or fields.
    fn new(fields: &'a DecodedFields, wanted: FieldSelection) -> Self {
        match wanted.records {
            true => Self::Records(&fields.records),
            false => Self::Fields(fields),
        }
    }
}

/// Consumer of points: index of the first one, and the block.
type Each<'a> = dyn FnMut(u64, LasPointBlock<'_>) -> Result<()> + 'a;

impl LasFile {
    /// Passes on the points of a part, as whole records if these are requested or not compressed; returns the number
    /// of unreadable points. With `salvage`, a chunk is passed on as a whole or not at all: damaged bytes decode to
    /// plausible points, and the place of the damage in a chunk is unknown.
    ///
    /// # Errors
    /// Damage, unless `salvage` is set, and errors of `each`.
    pub(crate) fn records(
        &self,
        part: usize,
        wanted: FieldSelection,
        salvage: bool,
        buffers: &mut LasReadBuffers,
        each: &mut Each<'_>,
    ) -> Result<u64> {
        let found = &self.parts[part];
        let lost = match found.kind {
            LasPartKind::Plain => self.read_plain(found, buffers, each).map(|()| 0),
            _ => self.read_packed(part, wanted, salvage, buffers, each),
        };
        Ok(lost.map_err(|e| e.in_file(&self.path))? + found.lost)
    }

    fn read_plain(
        &self,
        part: &LasPart,
        buffers: &mut LasReadBuffers,
        each: &mut Each<'_>,
    ) -> Result<()> {
        let (file, record) = (self.reopen()?, u64::from(self.header.record));
        let step = (BLOCK_BYTES / record).max(1);
        for first in (0..part.points).step_by(step as usize) {
            let bytes = step.min(part.points - first) * record;
            buffers.bytes.resize(buffers.bytes.len().max(bytes as usize), 0);
            let block = &mut buffers.bytes[..bytes as usize];
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
        buffers: &mut LasReadBuffers,
        each: &mut Each<'_>,
    ) -> Result<u64> {
        let (Some(layout), part) = (&self.layout, self.parts[number]) else { return Ok(0) };
        let file = self.reopen()?;
        if part.kind == LasPartKind::Chunk {
            buffers.bytes.resize(terrane_files::to_usize("chunk", part.bytes)?, 0);
            file.read_at(part.at, &mut buffers.bytes)?;
        }
        // To be passed on as a whole or not at all, a chunk is decoded twice.
        if salvage {
            let (reach, mut is_sound) = (self.reach(&part), true);
            let decoded = buffers.unpack(layout, &file, &part, wanted, &mut |fields| {
                is_sound &= is_plausible(fields, &reach);
                Ok(())
            })?;
            if decoded.is_err() || !is_sound {
                return Ok(part.points);
            }
        }
        let mut next = part.first;
        let decoded = buffers.unpack(layout, &file, &part, wanted, &mut |fields| {
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

    /// Asks for a part of a remote file, and with it for the next ones that are wanted.
    ///
    /// # Errors
    /// Those of reading.
    pub(crate) fn prefetch(&self, part: usize, is_wanted: impl Fn(usize) -> bool) -> Result<()> {
        if !is_remote(&self.path) {
            return Ok(());
        }
        let bytes = |part: &LasPart| part.at..part.at.saturating_add(part.bytes);
        let (mut ahead, mut left) = (Vec::new(), AHEAD);
        for (number, next) in self.parts.iter().enumerate().skip(part + 1) {
            if next.bytes > left || ahead.len() == MAX_AHEAD {
                break;
            }
            if is_wanted(number) {
                left -= next.bytes;
                ahead.push(bytes(next));
            }
        }
        self.reopen()?.prefetch(&[bytes(&self.parts[part])], &ahead)
    }

    /// Possible extent of the points of a part: the stated bounds, and the cube of an octree node.
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

/// Whether all points are plausible: within `reach`, and with valid return numbers.
fn is_plausible(fields: &DecodedFields, reach: &Option<ClaimedExtent>) -> bool {
    let (mut places, mut returns) = (fields.places.iter(), fields.returns.iter());
    places.all(|place| reach.is_some_and(|reach| reach.holds(*place)))
        && returns.all(|bits| bits >> 4 == 0 || bits & 15 <= bits >> 4)
}

#[cfg(test)]
mod tests;
