//! Whole records, byte for byte, of every format and kind of compression.

use super::moves::{moved, moves};
use super::*;
use laz::las::{Point0, Point4, Point5, Point6, Point7, Point8, Point9, Point10};
use proptest::prelude::*;

/// Items of every point format, in every version.
fn all_items() -> Vec<Vec<LazItem>> {
    use LazItemRecordBuilder as Builder;
    let mut all: Vec<_> =
        (0..6).flat_map(|format| [0, 3].map(|extra| items(format, extra).0)).collect();
    all.extend([
        Builder::version_1_of::<Point0>(0),
        Builder::version_1_of::<Point1>(0),
        Builder::version_1_of::<Point2>(0),
        Builder::version_1_of::<Point3>(0),
        Builder::version_1_of::<Point4>(0),
        Builder::version_1_of::<Point5>(0),
    ]);
    for extra in [0, 3] {
        all.extend([
            Builder::version_3_of::<Point6>(extra),
            Builder::version_3_of::<Point7>(extra),
            Builder::version_3_of::<Point8>(extra),
            Builder::version_3_of::<Point9>(extra),
            Builder::version_3_of::<Point10>(extra),
            Builder::version_4_of::<Point6>(extra),
            Builder::version_4_of::<Point7>(extra),
            Builder::version_4_of::<Point8>(extra),
            Builder::version_4_of::<Point9>(extra),
            Builder::version_4_of::<Point10>(extra),
        ]);
    }
    all
}

fn size_of(items: &[LazItem]) -> usize {
    items.iter().map(|item| usize::from(item.size())).sum()
}

fn records_of(
    decoder: &mut LazDecoder,
    schema: &LaszipSchema,
    bytes: &[u8],
    count: usize,
) -> Result<DecodedFields, ChunkDamage> {
    let mut fields = DecodedFields::default();
    let mut stream =
        decoder.stream(schema, CompressedChunk { bytes, count }, FieldSelection::RECORDS)?;
    stream.read(count, &mut fields)?;
    stream.end().map(|_| fields)
}

/// Records come out as they went in, and so do the columns.
fn goes_round(decoder: &mut LazDecoder, items: &Vec<LazItem>, records: &[u8], what: &str) {
    let size = size_of(items);
    let count = records.len() / size;
    let bytes = compress(items, records);
    let fields = records_of(decoder, &schema(items), &bytes, count).expect(what);
    if fields.records != records {
        let at = fields.records.iter().zip(records).position(|(a, b)| a != b);
        panic!("{what}: byte {:?} of record {:?}", at.map(|at| at % size), at.map(|at| at / size));
    }
    let columns = if is_layered(items) { new_fields } else { old_fields }(records, size);
    assert!(DecodedFields { records: Vec::new(), ..fields } == columns, "{what}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn records_come_out_as_they_went_in(moves in moves(120)) {
        let mut decoder = LazDecoder::new();
        for items in all_items() {
            goes_round(&mut decoder, &items, &moved(&items, &moves), &format!("{items:?}"));
        }
    }
}

#[test]
fn records_of_every_style_come_out_as_they_went_in() {
    let mut decoder = LazDecoder::new();
    for items in all_items() {
        for style in STYLES {
            for count in [1, 2, 40, 3000] {
                let make = if is_layered(&items) { new_records } else { old_records };
                let mut records = make(style, size_of(&items), count, 5 + count as u64);
                if items.iter().any(|item| (item.size(), item.version()) == (6, 1)) {
                    let blue = 25 + usize::from(plain(&items[1]).kind == 7) * 8;
                    records.chunks_exact_mut(size_of(&items)).for_each(|r| r[blue] = 0);
                }
                goes_round(&mut decoder, &items, &records, &format!("{items:?} {style:?} {count}"));
            }
        }
    }
}

#[test]
fn layers_that_never_change_are_left_out() {
    let items = LazItemRecordBuilder::version_3_of::<Point10>(2);
    let size = size_of(&items);
    let records = new_records(Style::Constant, size, 40, 3);
    let bytes = compress(&items, &records);
    let lengths: Vec<_> = (0..14).map(|layer| axis(&bytes, size + 4 + 4 * layer)).collect();
    assert!(lengths[2..].iter().all(|length| *length == 0), "{lengths:?}");
    goes_round(&mut LazDecoder::new(), &items, &records, "constant");
}

#[test]
fn records_are_read_batch_by_batch() {
    let mut decoder = LazDecoder::new();
    for items in all_items() {
        let size = size_of(&items);
        let make = if is_layered(&items) { new_records } else { old_records };
        let mut records = make(Style::Walk, size, 1000, 4);
        if items[0].version() == 1 {
            records.chunks_exact_mut(size).for_each(|record| record[20..].fill(1));
        }
        let bytes = compress(&items, &records);
        let schema = schema(&items);
        let mut fields = DecodedFields::default();
        let chunk = CompressedChunk { bytes: &bytes, count: 1000 };
        let mut stream = decoder.stream(&schema, chunk, FieldSelection::RECORDS).unwrap();
        for count in [0, 1, 400, 0, 599] {
            stream.read(count, &mut fields).unwrap();
        }
        assert!(fields.records == records, "{items:?}");
        assert_eq!(stream.end(), Ok(0));
        assert!(stream.read(5000, &mut fields).is_err());
        assert_eq!((fields.len(), fields.records.len()), (1000, records.len()));
    }
}

#[test]
fn records_pass_through_windows() {
    let mut decoder = LazDecoder::new();
    for format in 0..6 {
        let (items, size) = items(format, 1);
        let records = old_records(Style::Walk, size, 900, 6);
        let bytes = compress(&items, &records);
        let schema = schema(&items);
        let mut fields = DecodedFields::default();
        let (mut flow, left) = decoder.flow(&schema, &bytes, FieldSelection::RECORDS).unwrap();
        let mut rest = &bytes[bytes.len() - left..];
        for count in [1, 300, 599] {
            let left = flow.read(rest, count, &mut fields).unwrap();
            rest = &rest[rest.len() - left..];
        }
        assert_eq!(flow.end(rest), Ok(0));
        assert!(fields.records == records, "format {format}");
    }
}

#[test]
fn damage_in_a_chunk_leaves_the_next_one() {
    let (items, size) = items(8, 2);
    let schema = schema(&items);
    let records = new_records(Style::Walk, size, 300, 1);
    let good = compress(&items, &records);
    let mut bad = good.clone();
    let last = bad.len() - 30;
    bad[last..].fill(0x5a);
    let mut decoder = LazDecoder::new();
    for bytes in [&bad, &good[..good.len() / 3], &good] {
        let mut fields = DecodedFields::default();
        let chunk = CompressedChunk { bytes, count: 300 };
        let done = decoder.chunk(&schema, chunk, FieldSelection::RECORDS, &mut fields);
        let is_good = *bytes == *good;
        assert!(done.is_ok() == (fields.len() == 300) && (done.is_ok() || !is_good));
        assert!(!is_good || fields.records == records);
        assert_eq!(fields.records.len(), size * fields.len());
    }
}

#[test]
fn every_layer_that_ends_early_is_named() {
    use LazLayer::*;
    let shared =
        [Places, Heights, Classes, Flags, Intensities, Angles, UserData, Sources, Times].to_vec();
    let tails = [vec![Colours, Infrared, Packets], vec![ExtraBytes; 3]].concat();
    let items = LazItemRecordBuilder::version_4_of::<Point10>(3);
    let (size, schema) = (size_of(&items), schema(&items));
    let records = new_records(Style::Wild, size, 200, 2);
    let bytes = compress(&items, &records);
    let mut decoder = LazDecoder::new();
    let layers = [shared, tails].concat();
    let head = size + 4 + 4 * layers.len();
    let mut begin = head;
    for (number, layer) in layers.iter().enumerate() {
        let at = size + 4 + 4 * number;
        let length = axis(&bytes, at);
        for cut in [1, 2, 3, length / 2, length - 4, length - 1] {
            let shorter = without(&bytes, &begin, length, cut, at);
            let found = records_of(&mut decoder, &schema, &shorter, 200);
            assert_eq!(found, Err(ChunkDamage::Layer(*layer)), "{cut}");
        }
        let mut longer = bytes.clone();
        put(&mut longer, at, &(length + 1).to_le_bytes());
        longer.insert(begin + length as usize, 0);
        let found = records_of(&mut decoder, &schema, &longer, 200);
        assert_eq!(found, Err(ChunkDamage::Layer(*layer)), "one byte more");
        begin += length as usize;
    }
    assert_eq!(begin, bytes.len());
}

#[test]
fn truncated_chunks_of_records_are_refused() {
    let mut decoder = LazDecoder::new();
    for items in all_items() {
        let (size, schema) = (size_of(&items), schema(&items));
        let make = if is_layered(&items) { new_records } else { old_records };
        let mut records = make(Style::Walk, size, 12, 9);
        if items[0].version() == 1 {
            records.chunks_exact_mut(size).for_each(|record| record[20..].fill(1));
        }
        let bytes = compress(&items, &records);
        for length in 0..bytes.len() {
            let found = records_of(&mut decoder, &schema, &bytes[..length], 12);
            assert!(found.is_err(), "{length} of {}: {items:?}", bytes.len());
        }
        assert!(records_of(&mut decoder, &schema, &bytes, 12).is_ok());
    }
}

#[test]
fn mutated_records_never_disagree_with_laz() {
    let mut decoder = LazDecoder::new();
    let (mut agreed, mut refused) = (0, 0);
    // What decodes colours of the first version is wrong where their upper bytes change.
    let is_right = |items: &Vec<LazItem>| items[0].version() > 1;
    for items in all_items().into_iter().filter(is_right) {
        let (size, schema) = (size_of(&items), schema(&items));
        let make = if is_layered(&items) { new_records } else { old_records };
        for style in STYLES {
            let sound = compress(&items, &make(style, size, 60, 21));
            let mut dice = Dice(size as u64);
            for _ in 0..60 {
                let mut bytes = sound.clone();
                for _ in 0..1 + dice.below(3) {
                    let at = dice.below(bytes.len() as u64) as usize;
                    bytes[at] = dice.roll() as u8;
                }
                let chunk = CompressedChunk { bytes: &bytes, count: 60 };
                let mut ours = DecodedFields::default();
                if decoder.chunk(&schema, chunk, FieldSelection::RECORDS, &mut ours).is_err() {
                    refused += 1;
                    continue;
                }
                assert_eq!(ours.records.len(), 60 * size);
                let theirs = std::panic::catch_unwind(|| decompress(&items, &bytes, 60));
                if let Ok(Ok(theirs)) = theirs {
                    assert!(ours.records == theirs, "{items:?}, {style:?}");
                    agreed += 1;
                }
            }
        }
    }
    assert!(agreed > 300 && refused > 300, "{agreed} agreed, {refused} refused");
}

#[test]
fn noise_becomes_records_or_is_refused() {
    let (items, size) = items(10, 4);
    let schema = schema(&items);
    let (layers, mut decoder, mut dice) = (9 + 3 + 4, LazDecoder::new(), Dice(78));
    for round in 0..200 {
        let mut bytes: Vec<u8> = (0..3000).map(|_| dice.roll() as u8).collect();
        put(&mut bytes, size, &1000_u32.to_le_bytes());
        for layer in 0..layers {
            put(&mut bytes, size + 4 + 4 * layer, &150_u32.to_le_bytes());
        }
        if round % 3 == 0 {
            bytes[size + 4 + 4 * layers..].fill(if round % 2 == 0 { 0 } else { 255 });
        }
        if let Ok(fields) = records_of(&mut decoder, &schema, &bytes, 1000) {
            assert_eq!(fields.records.len(), 1000 * size);
        }
    }
}
