//! Decoding of files that are one stream, or whose chunks cannot be told apart but by decoding: with
//! the `laz` crate, which reads a file bit by bit. Records come out some thousand at a time.

use std::io::{Read, Seek};

use laz::record::{RecordDecompressor, SequentialPointRecordDecompressor};

use crate::error::Result;

use super::decode::BLOCK;
use super::quiet::caught;
use super::{Compressor, Damage, Layout};

/// Decodes a stream of `count` points, chunk after chunk where there are chunks. `block` is room for
/// records, and may be used again.
///
/// # Errors
/// Whatever `each` returns.
pub(in crate::cloud) fn stream(
    layout: &Layout,
    source: impl Read + Seek + Send + Sync,
    count: u64,
    block: &mut Vec<u8>,
    each: &mut dyn FnMut(&[u8]) -> Result<()>,
) -> Result<std::result::Result<(), Damage>> {
    let broken = |good: u64, what: String| Ok(Err(Damage { good, what }));
    let unknown = || "it cannot be decoded".to_owned();
    let chunk = match layout.compressor {
        Compressor::Stream => u64::MAX,
        _ => layout.chunk_points.map_or(u64::MAX, u64::from),
    };
    let Some(mut decoder) = caught(|| SequentialPointRecordDecompressor::new(source)) else {
        return broken(0, unknown());
    };
    let mut good = 0;
    while good < count {
        let in_chunk = good % chunk;
        if in_chunk == 0 {
            match caught(|| begin(&mut decoder, layout)) {
                Some(Ok(())) => {}
                Some(Err(what)) => return broken(good, what),
                None => return broken(good, unknown()),
            }
        }
        let points = BLOCK.min(count - good).min(chunk - in_chunk);
        block.resize(points as usize * layout.record, 0);
        let (decoded, what) = fill(&mut decoder, layout.record, block);
        let bytes = decoded as usize * layout.record;
        each(&block[..bytes])?;
        good += decoded;
        if let Some(what) = what {
            return broken(good, what);
        }
    }
    Ok(Ok(()))
}

/// Makes ready for a chunk.
fn begin<R: Read + Seek + Send + Sync>(
    decoder: &mut SequentialPointRecordDecompressor<'_, R>,
    layout: &Layout,
) -> std::result::Result<(), String> {
    decoder.reset();
    decoder.set_fields_from(layout.vlr.items()).map_err(|e| e.to_string())
}

/// Fills `block` with records: how many, and why they are not more.
fn fill<R: Read + Seek + Send + Sync>(
    decoder: &mut SequentialPointRecordDecompressor<'_, R>,
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
