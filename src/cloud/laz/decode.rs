//! Decoding of chunks: bytes and a number of points go in, fields of points come out, some thousand
//! at a time, so that memory is bounded whatever a file claims.

use crate::cloud::lazip::{self, Chunk, Decoder, Fields, Stream, Wanted};
use crate::error::Result;

use super::{Compressor, Layout, layers};

/// Points that are decoded before they are handed on.
pub(super) const BLOCK: u64 = 8192;

/// Where and why decoding ended early; all points before were handed on.
#[derive(Debug)]
pub(in crate::cloud) struct Damage {
    /// Points handed on.
    pub(in crate::cloud) good: u64,
    pub(in crate::cloud) what: String,
}

/// A decoder and its room, to be used again and again.
#[derive(Default)]
pub(in crate::cloud) struct Unpacker {
    decoder: Decoder,
    fields: Fields,
}

/// A chunk on its way, or what is wrong with its head.
type Begun<'d> = std::result::Result<Stream<'d, 'd>, lazip::Damage>;

/// A chunk, and what is wanted of it.
struct Job<'a> {
    layout: &'a Layout,
    chunk: Chunk<'a>,
    wanted: Wanted,
}

impl Unpacker {
    /// Decodes a chunk of `count` points. Fields that are not wanted hold anything.
    ///
    /// # Errors
    /// Whatever `each` returns.
    pub(in crate::cloud) fn decode(
        &mut self,
        layout: &Layout,
        bytes: &[u8],
        count: u64,
        wanted: Wanted,
        each: &mut dyn FnMut(&Fields) -> Result<()>,
    ) -> Result<std::result::Result<(), Damage>> {
        if layout.compressor == Compressor::Layers
            && let Err(what) = check(layout, bytes, count)
        {
            return Ok(Err(Damage { good: 0, what }));
        }
        let Self { decoder, fields } = self;
        let job = Job { layout, chunk: Chunk { bytes, count: count as usize }, wanted };
        let mut good = 0;
        let what = match job.begin(decoder) {
            Ok(stream) => go(stream, count, &mut good, fields, each)?,
            Err(what) => Some(what),
        };
        let Some(what) = what else { return Ok(Ok(())) };
        let whole = good;
        fields.clear();
        good += job.search(decoder, whole, fields);
        each(fields)?;
        Ok(Err(Damage { good, what: what.to_string() }))
    }
}

/// Hands on blocks of points as long as they are whole, and says what ended that early.
fn go(
    mut stream: Stream<'_, '_>,
    count: u64,
    good: &mut u64,
    fields: &mut Fields,
    each: &mut dyn FnMut(&Fields) -> Result<()>,
) -> Result<Option<lazip::Damage>> {
    while *good < count {
        fields.clear();
        let points = BLOCK.min(count - *good);
        if let Err(what) = stream.read(points as usize, fields) {
            return Ok(Some(what));
        }
        each(fields)?;
        *good += points;
    }
    Ok(None)
}

impl Job<'_> {
    fn begin<'d>(&'d self, decoder: &'d mut Decoder) -> Begun<'d> {
        decoder.stream(&self.layout.schema, self.chunk, self.wanted)
    }

    /// Leaves the points that follow the first `whole` and come before the damage in `fields`, and
    /// returns how many they are: the block is damaged, and some of its points are not.
    fn search(&self, decoder: &mut Decoder, whole: u64, fields: &mut Fields) -> u64 {
        let Ok(mut stream) = self.begin(decoder) else { return 0 };
        for _ in 0..whole / BLOCK {
            fields.clear();
            // These were read before.
            let _ = stream.read(BLOCK as usize, fields);
        }
        fields.clear();
        while (fields.len() as u64) < BLOCK && stream.read(1, fields).is_ok() {}
        fields.len() as u64
    }
}

/// Its layers must lie in the chunk, and its points be those that the file claims.
fn check(layout: &Layout, bytes: &[u8], count: u64) -> std::result::Result<(), String> {
    if (bytes.len() as u64) < layers::head_bytes(layout) {
        return Err(format!("its {} bytes do not hold its head", bytes.len()));
    }
    let (points, claimed) = layers::claims(layout, bytes);
    if claimed > bytes.len() as u64 {
        return Err(format!("its layers claim {claimed} of its {} bytes", bytes.len()));
    }
    if points != count {
        return Err(format!("it claims {points} points, and the file {count} for it"));
    }
    Ok(())
}
