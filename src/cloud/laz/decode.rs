//! Decoding of points, behind one door: a layout, bytes and a number of points go in, uncompressed
//! records come out, some thousand at a time, so that memory is bounded whatever a file claims.

use std::io::{Cursor, Read, Seek};

use laz::DecompressionSelection;
use laz::record::{
    LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor,
};

use crate::error::Result;

use super::quiet::caught;
use super::{Compressor, Layout, Wanted, layers};

/// Points that are decoded before they are handed on.
const BLOCK: u64 = 8192;

/// Where and why decoding ended early; all points before were handed on.
#[derive(Debug)]
pub(in crate::cloud) struct Damage {
    /// Points handed on.
    pub(in crate::cloud) good: u64,
    pub(in crate::cloud) what: String,
}

/// What hands records on.
pub(in crate::cloud) type Each<'a> = dyn FnMut(&[u8]) -> Result<()> + 'a;

/// Decodes a chunk of `count` points. Fields that are not wanted hold anything. `block` is room for
/// records, and may be used again.
///
/// # Errors
/// Whatever `each` returns.
pub(in crate::cloud) fn decode(
    layout: &Layout,
    bytes: &[u8],
    count: u64,
    wanted: Wanted,
    block: &mut Vec<u8>,
    each: &mut Each<'_>,
) -> Result<std::result::Result<(), Damage>> {
    if layout.compressor == Compressor::Layers
        && let Err(what) = check(layout, bytes, count)
    {
        return Ok(Err(Damage { good: 0, what }));
    }
    let source = Cursor::new(bytes);
    run(layout, source, count, u64::MAX, wanted, block, each)
}

/// Decodes a stream of `count` points, chunk after chunk where there are chunks.
///
/// # Errors
/// Whatever `each` returns.
pub(in crate::cloud) fn stream(
    layout: &Layout,
    source: impl Read + Seek + Send + Sync,
    count: u64,
    block: &mut Vec<u8>,
    each: &mut Each<'_>,
) -> Result<std::result::Result<(), Damage>> {
    let chunk = match layout.compressor {
        Compressor::Stream => u64::MAX,
        _ => layout.chunk_points.map_or(u64::MAX, u64::from),
    };
    run(layout, source, count, chunk, Wanted::default(), block, each)
}

/// The decoder reserves what a layer claims: all of them must lie in the chunk.
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

fn run<'a>(
    layout: &Layout,
    source: impl Read + Seek + Send + Sync + 'a,
    count: u64,
    chunk: u64,
    wanted: Wanted,
    block: &mut Vec<u8>,
    each: &mut Each<'_>,
) -> Result<std::result::Result<(), Damage>> {
    let broken = |good: u64, what: String| Ok(Err(Damage { good, what }));
    let Some(mut decoder) = caught(|| decoder(layout, source)) else {
        return broken(0, "it cannot be decoded".to_owned());
    };
    let mut good = 0;
    while good < count {
        let in_chunk = good % chunk;
        if in_chunk == 0 {
            match caught(|| begin(&mut *decoder, layout, wanted)) {
                Some(Ok(())) => {}
                Some(Err(what)) => return broken(good, what),
                None => return broken(good, "it cannot be decoded".to_owned()),
            }
        }
        let points = BLOCK.min(count - good).min(chunk - in_chunk);
        block.resize(points as usize * layout.record, 0);
        let (decoded, what) = fill(&mut *decoder, layout.record, block);
        let bytes = decoded as usize * layout.record;
        each(&block[..bytes])?;
        good += decoded;
        if let Some(what) = what {
            return broken(good, what);
        }
    }
    Ok(Ok(()))
}

type Decoder<'a, R> = Box<dyn RecordDecompressor<R> + 'a>;

fn decoder<'a, R: Read + Seek + Send + Sync + 'a>(layout: &Layout, source: R) -> Decoder<'a, R> {
    match layout.compressor {
        Compressor::Layers => Box::new(LayeredPointRecordDecompressor::new(source)),
        _ => Box::new(SequentialPointRecordDecompressor::new(source)),
    }
}

/// Makes ready for a chunk.
fn begin<R>(
    decoder: &mut (dyn RecordDecompressor<R> + '_),
    layout: &Layout,
    wanted: Wanted,
) -> std::result::Result<(), String> {
    decoder.reset();
    decoder.set_fields_from(layout.vlr.items()).map_err(|e| e.to_string())?;
    decoder.set_selection(selection(wanted));
    Ok(())
}

fn selection(wanted: Wanted) -> DecompressionSelection {
    let mut selection = DecompressionSelection::xy_returns_channel();
    if wanted.z {
        selection = selection.decompress_z();
    }
    if wanted.class {
        selection = selection.decompress_classification();
    }
    if wanted.flags {
        selection = selection.decompress_flags();
    }
    selection
}

/// Fills `block` with records: how many, and why they are not more.
fn fill<R>(
    decoder: &mut (dyn RecordDecompressor<R> + '_),
    record: usize,
    block: &mut [u8],
) -> (u64, Option<String>) {
    let mut decoded = 0;
    let result = caught(|| {
        block.chunks_exact_mut(record).try_for_each(|point| {
            decoder.decompress_next(point)?;
            decoded += 1;
            Ok::<_, std::io::Error>(())
        })
    });
    let what = match result {
        Some(Ok(())) => None,
        Some(Err(e)) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            Some("its bytes end before its points".to_owned())
        }
        Some(Err(e)) => Some(e.to_string()),
        None => Some("it cannot be decoded".to_owned()),
    };
    (decoded, what)
}
