//! Decoding compressed point clouds: the `laz` crate, and the decoder of this crate.
//!
//! `cargo bench --bench laz_decode [FILTER]`. One thread; x, y, z, class, returns and flags of points
//! of formats 6 and 1, and whole records of formats 6, 7, 8, 1 and 3 (`elem/s` are points).

use std::f64::consts::TAU;
use std::hint::black_box;
use std::io::Cursor;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use laz::record::{
    LayeredPointRecordCompressor, LayeredPointRecordDecompressor, RecordCompressor,
    RecordDecompressor, SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemRecordBuilder};
use terrane_cloud::lazip::{
    CompressedChunk, DecodedFields, FieldSelection, LaszipItem, LaszipSchema, LazDecoder,
};

/// Points of a chunk, as LASzip has them.
const CHUNK: usize = 50_000;
/// Chunks.
const CHUNKS: usize = 8;

/// Numbers that look random, from 0 to 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Records of scan lines over hills and woods, in millimetres, as bytes of `format`.
fn records(format: u8) -> Vec<u8> {
    let mut noise = Noise(1);
    let mut records = Vec::new();
    let mut pulse = 0_u32;
    let mut points = 0;
    while points < CHUNK * CHUNKS {
        pulse += 1;
        let x = f64::from(pulse % 600) * 0.66 + noise.next() * 0.1;
        let y = f64::from(pulse / 600) * 0.6 + noise.next() * 0.1;
        let ground = 120.0 + 15.0 * (x / 210.0 * TAU).sin() + 11.0 * (y / 170.0 * TAU).cos();
        let is_wood = (x / 45.0).sin() + (y / 60.0).sin() > 0.4;
        let of = if is_wood { 1 + (noise.next() * 4.0) as u8 } else { 1 };
        for number in 1..=of {
            let height = f64::from(of - number) * (2.0 + 4.0 * noise.next());
            let place = [x, y, ground + height + noise.next() * 0.1];
            let class = if number == of { 2 } else { 5 };
            record(&mut records, format, place, [number, of, class], pulse);
            points += 1;
        }
    }
    records.truncate(CHUNK * CHUNKS * if format == 6 { 30 } else { 28 });
    records
}

fn record(to: &mut Vec<u8>, format: u8, place: [f64; 3], of: [u8; 3], pulse: u32) {
    let [number, of, class] = of;
    place.iter().for_each(|axis| to.extend(((axis * 1000.0) as i32).to_le_bytes()));
    to.extend(200_u16.to_le_bytes());
    match format {
        6 => to.extend([of << 4 | number, 0, class, 0, 0, 0]),
        _ => to.extend([of << 3 | number, class, 0, 0]),
    }
    to.extend(1_u16.to_le_bytes());
    to.extend((1e8 + f64::from(pulse) * 2.5e-6).to_le_bytes());
}

fn compress(items: &Vec<LazItem>, records: &[u8]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut compressor: Box<dyn RecordCompressor<_>> = match items[0].version() {
        1 | 2 => Box::new(SequentialPointRecordCompressor::new(&mut bytes)),
        _ => Box::new(LayeredPointRecordCompressor::new(&mut bytes)),
    };
    compressor.set_fields_from(items).expect("known items");
    compressor.compress_many(records).expect("room in memory");
    compressor.done().expect("room in memory");
    drop(compressor);
    bytes.into_inner()
}

/// What grids and meshes need.
fn few_fields() -> DecompressionSelection {
    DecompressionSelection::xy_returns_channel()
        .decompress_z()
        .decompress_classification()
        .decompress_flags()
}

fn decompress(
    items: &Vec<LazItem>,
    selection: DecompressionSelection,
    bytes: &[u8],
    records: &mut [u8],
) {
    let bytes = Cursor::new(bytes);
    let mut decompressor: Box<dyn RecordDecompressor<_>> = match items[0].version() {
        1 | 2 => Box::new(SequentialPointRecordDecompressor::new(bytes)),
        _ => Box::new(LayeredPointRecordDecompressor::new(bytes)),
    };
    decompressor.set_fields_from(items).expect("known items");
    decompressor.set_selection(selection);
    decompressor.decompress_many(records).expect("sound bytes");
}

fn schema(items: &[LazItem]) -> LaszipSchema {
    let plain = |item: &LazItem| {
        let kind = item.item_type().into();
        LaszipItem { kind, size: item.size(), version: item.version() }
    };
    LaszipSchema::new(&items.iter().map(plain).collect::<Vec<_>>()).expect("known")
}

/// The records of `format`, of `size` bytes each, with intensities, scan angles and colours.
fn dressed(format: u8, size: usize) -> Vec<u8> {
    let mut noise = Noise(7);
    let (base, angle) = if format < 6 { (28, 16) } else { (30, 18) };
    let bare = records(if format < 6 { 1 } else { 6 });
    let mut all = Vec::with_capacity(bare.len() / base * size);
    for (number, bare) in bare.chunks_exact(base).enumerate() {
        let mut record = bare.to_vec();
        record[12..14].copy_from_slice(&((noise.next() * 900.0) as u16).to_le_bytes());
        record[angle] = (number / 90 % 40) as u8;
        while record.len() < size {
            let grey = 20_000.0 + 9_000.0 * (number as f64 / 300.0).sin();
            record.extend(((grey + 2_000.0 * noise.next()) as u16).to_le_bytes());
        }
        all.extend(record);
    }
    all
}

fn whole_records(c: &mut Criterion) {
    for format in [6, 7, 8, 1, 3] {
        let items = LazItemRecordBuilder::default_for_point_format_id(format, 0).expect("known");
        let size: usize = items.iter().map(|item| usize::from(item.size())).sum();
        let chunks: Vec<_> = dressed(format, size)
            .chunks(CHUNK * size)
            .map(|records| compress(&items, records))
            .collect();
        let mut group = c.benchmark_group(format!("records of format {format}"));
        group.throughput(Throughput::Elements((CHUNK * CHUNKS) as u64)).sample_size(10);
        group.bench_function("laz crate", |b| {
            let (mut records, all) = (vec![0; CHUNK * size], DecompressionSelection::all());
            let mut decompress = |chunk| decompress(&items, all, chunk, &mut records);
            b.iter(|| chunks.iter().map(Vec::as_slice).for_each(&mut decompress));
        });
        let schema = schema(&items);
        let (mut decoder, mut fields) = (LazDecoder::new(), DecodedFields::default());
        group.bench_function("ours", |b| {
            b.iter(|| {
                for bytes in &chunks {
                    let chunk = CompressedChunk { bytes, count: CHUNK };
                    let stream = decoder.stream(&schema, chunk, FieldSelection::RECORDS);
                    let mut stream = stream.expect("sound bytes");
                    for _ in 0..CHUNK / 5_000 {
                        fields.clear();
                        stream.read(5_000, &mut fields).expect("sound bytes");
                        black_box(&fields);
                    }
                    stream.end().expect("an end");
                }
            });
        });
        group.finish();
    }
}

fn chunks(c: &mut Criterion) {
    for format in [6, 1] {
        let items = LazItemRecordBuilder::default_for_point_format_id(format, 0).expect("known");
        let size: usize = items.iter().map(|item| usize::from(item.size())).sum();
        let records = records(format);
        let chunks: Vec<_> =
            records.chunks(CHUNK * size).map(|records| compress(&items, records)).collect();
        let mut group = c.benchmark_group(format!("format {format}"));
        group.throughput(Throughput::Elements((CHUNK * CHUNKS) as u64)).sample_size(10);
        group.bench_function("laz crate", |b| {
            let mut records = vec![0; CHUNK * size];
            let mut decompress = |chunk| decompress(&items, few_fields(), chunk, &mut records);
            b.iter(|| chunks.iter().map(Vec::as_slice).for_each(&mut decompress));
        });
        let schema = schema(&items);
        let chunks: Vec<_> =
            chunks.iter().map(|bytes| CompressedChunk { bytes, count: CHUNK }).collect();
        let (mut decoder, mut fields) = (LazDecoder::new(), DecodedFields::default());
        group.bench_function("ours", |b| {
            b.iter(|| {
                for chunk in &chunks {
                    fields.clear();
                    let done = decoder.chunk(&schema, *chunk, FieldSelection::ALL, &mut fields);
                    done.expect("sound bytes");
                    black_box(&fields);
                }
            });
        });
        group.finish();
    }
}

criterion_group!(benches, chunks, whole_records);
criterion_main!(benches);
