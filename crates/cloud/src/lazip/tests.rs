//! The decoder against the `laz` crate, on chunks that the crate compressed.

mod moves;
mod records;
mod whole;

use super::*;
use laz::las::{Point1, Point2, Point3};
use laz::record::{
    LayeredPointRecordCompressor, LayeredPointRecordDecompressor, RecordCompressor,
    RecordDecompressor, SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
};
use laz::{LazItem, LazItemRecordBuilder};
use records::{Dice, STYLES, Style, axis, new_records, old_records, put};
use std::io::Cursor;

fn schema(items: &[LazItem]) -> LaszipSchema {
    let items: Vec<_> = items.iter().map(plain).collect();
    LaszipSchema::new(&items).unwrap()
}

/// An item as the file has it.
fn plain(item: &LazItem) -> LaszipItem {
    LaszipItem { kind: item.item_type().into(), size: item.size(), version: item.version() }
}

fn is_layered(items: &[LazItem]) -> bool {
    items[0].version() > 2
}

fn compress(items: &Vec<LazItem>, records: &[u8]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let compressor: Box<dyn RecordCompressor<_>> = match is_layered(items) {
        true => Box::new(LayeredPointRecordCompressor::new(&mut bytes)),
        false => Box::new(SequentialPointRecordCompressor::new(&mut bytes)),
    };
    fill(compressor, items, records);
    bytes.into_inner()
}

fn fill<W>(
    mut compressor: Box<dyn RecordCompressor<W> + '_>,
    items: &Vec<LazItem>,
    records: &[u8],
) {
    compressor.set_fields_from(items).unwrap();
    compressor.compress_many(records).unwrap();
    compressor.done().unwrap();
}

/// Records as the `laz` crate decodes them.
fn decompress(items: &Vec<LazItem>, bytes: &[u8], count: usize) -> std::io::Result<Vec<u8>> {
    let mut records = vec![0; count * items.iter().map(|i| usize::from(i.size())).sum::<usize>()];
    let bytes = Cursor::new(bytes);
    let mut decompressor: Box<dyn RecordDecompressor<_>> = match is_layered(items) {
        true => Box::new(LayeredPointRecordDecompressor::new(bytes)),
        false => Box::new(SequentialPointRecordDecompressor::new(bytes)),
    };
    decompressor.set_fields_from(items).unwrap();
    decompressor.decompress_many(&mut records)?;
    Ok(records)
}

/// The fields of records of formats 0 to 5.
fn old_fields(records: &[u8], size: usize) -> DecodedFields {
    let mut fields = DecodedFields::default();
    for record in records.chunks_exact(size) {
        let (bits, class) = (record[14], record[15]);
        fields.places.push([0, 4, 8].map(|at| axis(record, at)));
        fields.returns.push((bits >> 3 & 7) << 4 | bits & 7);
        fields.flags.push(class >> 5 | bits >> 2 & 0x30);
        fields.classes.push(class & 31);
    }
    fields
}

/// The fields of records of formats 6 to 10.
fn new_fields(records: &[u8], size: usize) -> DecodedFields {
    let mut fields = DecodedFields::default();
    for record in records.chunks_exact(size) {
        fields.places.push([0, 4, 8].map(|at| axis(record, at)));
        fields.returns.push(record[14]);
        fields.flags.push(record[15] & 15 | record[15] >> 2 & 0x30);
        fields.classes.push(record[16]);
    }
    fields
}

fn decode(
    decoder: &mut LazDecoder,
    schema: &LaszipSchema,
    chunk: CompressedChunk,
) -> Result<DecodedFields, ChunkDamage> {
    let mut fields = DecodedFields::default();
    decoder.chunk(schema, chunk, FieldSelection::ALL, &mut fields).map(|()| fields)
}

/// Items of a format and the size of its records.
fn items(format: u8, extra: u16) -> (Vec<LazItem>, usize) {
    let items = LazItemRecordBuilder::default_for_point_format_id(format, extra).unwrap();
    let size = items.iter().map(|item| usize::from(item.size())).sum();
    (items, size)
}

#[test]
fn layered_chunks_are_decoded_as_they_were() {
    let mut decoder = LazDecoder::new();
    for (format, extra) in [(6, 0), (7, 0), (8, 0), (6, 5), (8, 3), (9, 0), (10, 2)] {
        for style in STYLES {
            for count in [1, 2, 3, 40, 3000] {
                let (items, size) = items(format, extra);
                let records = new_records(style, size, count, 7 + count as u64);
                let bytes = compress(&items, &records);
                let chunk = CompressedChunk { bytes: &bytes, count };
                let fields = decode(&mut decoder, &schema(&items), chunk);
                let what = format!("format {format}, {extra} extra bytes, {style:?}, {count}");
                assert!(fields == Ok(new_fields(&records, size)), "{what}");
            }
        }
    }
}

#[test]
fn layered_chunks_are_encoded_to_the_bytes_of_the_crate() {
    let mut encoder = LazEncoder::new();
    for (format, extra) in [(6, 0), (7, 0), (8, 0), (6, 5), (8, 3)] {
        for style in STYLES {
            for count in [1, 2, 3, 40, 3000, 20_000] {
                let (items, size) = items(format, extra);
                let records = new_records(style, size, count, 7 + count as u64);
                let bytes = encoder.chunk(&schema(&items), &records);
                let what = format!("format {format}, {extra} extra bytes, {style:?}, {count}");
                assert!(bytes == Some(compress(&items, &records)), "{what}");
            }
        }
    }
}

/// Items of every old format, in both versions where the crate has them right.
fn old_items() -> Vec<Vec<LazItem>> {
    let mut all: Vec<_> =
        (0..6).flat_map(|format| [0, 2].map(|extra| items(format, extra).0)).collect();
    all.push(LazItemRecordBuilder::version_1_of::<Point1>(0));
    all.push(LazItemRecordBuilder::version_1_of::<Point2>(0));
    all.push(LazItemRecordBuilder::version_1_of::<Point3>(0));
    all
}

#[test]
fn chunks_of_records_are_decoded_as_they_were() {
    let mut decoder = LazDecoder::new();
    for items in old_items() {
        let size = items.iter().map(|item| usize::from(item.size())).sum();
        for style in STYLES {
            for count in [1, 2, 40, 3000] {
                let mut records = old_records(style, size, count, 1 + count as u64);
                if items.iter().any(|item| (item.size(), item.version()) == (6, 1)) {
                    // The crate cannot read what it writes of the upper byte of blue.
                    records.chunks_exact_mut(size).for_each(|record| record[size - 1] = 0);
                }
                let bytes = compress(&items, &records);
                let chunk = CompressedChunk { bytes: &bytes, count };
                let fields = decode(&mut decoder, &schema(&items), chunk);
                assert!(fields == Ok(old_fields(&records, size)), "{items:?}, {style:?}, {count}");
            }
        }
    }
}

#[test]
fn a_stream_is_read_batch_by_batch() {
    let mut decoder = LazDecoder::new();
    for format in [3, 7] {
        let (items, size) = items(format, 1);
        let is_new = is_layered(&items);
        let make = if is_new { new_records } else { old_records };
        let records = make(Style::Walk, size, 1000, 4);
        let bytes = compress(&items, &records);
        let schema = schema(&items);
        let mut fields = DecodedFields::default();
        let chunk = CompressedChunk { bytes: &bytes, count: 1000 };
        let mut stream = decoder.stream(&schema, chunk, FieldSelection::ALL).unwrap();
        for count in [0, 1, 400, 0, 599] {
            stream.read(count, &mut fields).unwrap();
        }
        assert!(fields == if is_new { new_fields } else { old_fields }(&records, size));
        assert!(stream.read(5000, &mut fields).is_err());
        assert_eq!(fields.len(), 1000);
    }
}

#[test]
fn a_long_chunk_wears_its_models_in() {
    let (items, size) = items(6, 0);
    for style in STYLES {
        let records = new_records(style, size, 90_000, 3);
        let bytes = compress(&items, &records);
        let chunk = CompressedChunk { bytes: &bytes, count: 90_000 };
        let fields = decode(&mut LazDecoder::new(), &schema(&items), chunk);
        assert!(fields == Ok(new_fields(&records, size)), "{style:?}");
    }
}

#[test]
fn only_wanted_fields_are_decoded() {
    let (items, size) = items(6, 0);
    let records = new_records(Style::Walk, size, 500, 11);
    let bytes = compress(&items, &records);
    let chunk = CompressedChunk { bytes: &bytes, count: 500 };
    let all = new_fields(&records, size);
    let mut decoder = LazDecoder::new();
    for mask in 0..8 {
        let [z, class, flags] = [1, 2, 4].map(|bit| mask & bit != 0);
        let wanted = FieldSelection { z, class, flags, records: false };
        let mut fields = DecodedFields::default();
        decoder.chunk(&schema(&items), chunk, wanted, &mut fields).unwrap();
        let flat =
            |fields: &DecodedFields| fields.places.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>();
        assert_eq!(flat(&fields), flat(&all));
        assert_eq!(fields.returns, all.returns);
        assert!(!wanted.z || fields.places == all.places);
        assert!(!wanted.class || fields.classes == all.classes);
        assert!(!wanted.flags || fields.flags == all.flags);
    }
}

#[test]
fn a_stream_that_ends_early_is_named() {
    let (items, size) = items(6, 0);
    let schema = schema(&items);
    let records = new_records(Style::Wild, size, 200, 2);
    let bytes = compress(&items, &records);
    let mut decoder = LazDecoder::new();
    let layers = [LazLayer::Places, LazLayer::Heights, LazLayer::Classes, LazLayer::Flags];
    for (number, layer) in layers.into_iter().enumerate() {
        let at = size + 4 + 4 * number;
        let length = axis(&bytes, at);
        for cut in [1, 2, 3, length / 2, length - 4, length - 1] {
            let shorter = without(&bytes, &layers_before(&bytes, size, number), length, cut, at);
            let chunk = CompressedChunk { bytes: &shorter, count: 200 };
            assert_eq!(
                decode(&mut decoder, &schema, chunk),
                Err(ChunkDamage::Layer(layer)),
                "{cut}"
            );
        }
    }
    let chunk = CompressedChunk { bytes: &bytes, count: 201 };
    assert_eq!(decode(&mut decoder, &schema, chunk), Err(ChunkDamage::Count(200)));
}

/// Where layer `number` begins.
fn layers_before(bytes: &[u8], size: usize, number: usize) -> usize {
    let lengths = (0..number).map(|layer| axis(bytes, size + 4 + 4 * layer) as usize);
    size + 40 + lengths.sum::<usize>()
}

/// The chunk with the last `cut` bytes of a layer left out, and its length set right.
fn without(bytes: &[u8], begin: &usize, length: i32, cut: i32, at: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    put(&mut bytes, at, &(length - cut).to_le_bytes());
    let end = begin + length as usize;
    bytes.drain(end - cut as usize..end);
    bytes
}

#[test]
fn truncated_chunks_are_refused() {
    let (items, size) = items(7, 2);
    let schema = schema(&items);
    let records = new_records(Style::Walk, size, 60, 9);
    let bytes = compress(&items, &records);
    let mut decoder = LazDecoder::new();
    let end = layers_before(&bytes, size, 4) + 4 * 3;
    for length in 0..end {
        let chunk = CompressedChunk { bytes: &bytes[..length], count: 60 };
        assert!(decode(&mut decoder, &schema, chunk).is_err(), "{length} of {end}");
    }
}

#[test]
fn mutated_chunks_never_disagree_with_laz() {
    let mut decoder = LazDecoder::new();
    let mut agreed = 0;
    for format in [1, 3, 6, 7] {
        let (items, size) = items(format, 0);
        let schema = schema(&items);
        let is_new = is_layered(&items);
        let make = if is_new { new_records } else { old_records };
        let fields_of = if is_new { new_fields } else { old_fields };
        for style in STYLES {
            let sound = compress(&items, &make(style, size, 120, 21));
            let mut dice = Dice(u64::from(format));
            for _ in 0..300 {
                let mut bytes = sound.clone();
                for _ in 0..1 + dice.below(3) {
                    let at = dice.below(bytes.len() as u64) as usize;
                    bytes[at] = dice.roll() as u8;
                }
                let Ok(ours) =
                    decode(&mut decoder, &schema, CompressedChunk { bytes: &bytes, count: 120 })
                else {
                    continue;
                };
                let theirs = std::panic::catch_unwind(|| decompress(&items, &bytes, 120));
                if let Ok(Ok(theirs)) = theirs {
                    assert!(ours == fields_of(&theirs, size), "format {format}, {style:?}");
                    agreed += 1;
                }
            }
        }
    }
    assert!(agreed > 300, "{agreed}");
}

#[test]
fn noise_is_decoded_or_refused() {
    let (items, size) = items(6, 0);
    let schema = schema(&items);
    let mut decoder = LazDecoder::new();
    let mut dice = Dice(77);
    for round in 0..300 {
        let mut bytes: Vec<u8> = (0..2000).map(|_| dice.roll() as u8).collect();
        put(&mut bytes, size, &1000_u32.to_le_bytes());
        for layer in 0..9 {
            put(&mut bytes, size + 4 + 4 * layer, &150_u32.to_le_bytes());
        }
        if round % 3 == 0 {
            bytes[size + 40..].fill(if round % 2 == 0 { 0 } else { 255 });
        }
        let chunk = CompressedChunk { bytes: &bytes, count: 1000 };
        if let Ok(fields) = decode(&mut decoder, &schema, chunk) {
            assert_eq!(fields.len(), 1000);
        }
    }
}

#[test]
fn unknown_items_are_named() {
    let point = LaszipItem { kind: 10, size: 30, version: 3 };
    let odd = LaszipItem { kind: 14, size: 3, version: 7 };
    assert_eq!(LaszipSchema::new(&[point, odd]), Err(odd));
    assert_eq!(odd.to_string(), "new extra bytes (type 14) of 3 bytes, version 7");
    assert!(LaszipSchema::new(&[]).is_err());
}
