//! Decoding compressed point clouds: the `laz` crate, and the decoder of this crate, with one chunk
//! at a time and with two.
//!
//! `cargo bench --bench laz_decode [FILTER]`. One thread; x, y, z, class, returns and flags of points
//! of formats 6 and 1 (`elem/s` are points).

use std::f64::consts::TAU;
use std::hint::black_box;
use std::io::Cursor;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use laz::record::{
    LayeredPointRecordCompressor, LayeredPointRecordDecompressor, RecordCompressor,
    RecordDecompressor, SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemRecordBuilder};
use terrane_cloud::lazip::{Chunk, Decoder, Fields, Item, Schema, Wanted};

/// Points of a chunk, as LASzip has them.
const CHUNK: usize = 50_000;
/// Chunks, an even number.
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

fn decompress(items: &Vec<LazItem>, bytes: &[u8], records: &mut [u8]) {
    let selection = DecompressionSelection::xy_returns_channel()
        .decompress_z()
        .decompress_classification()
        .decompress_flags();
    let bytes = Cursor::new(bytes);
    let mut decompressor: Box<dyn RecordDecompressor<_>> = match items[0].version() {
        1 | 2 => Box::new(SequentialPointRecordDecompressor::new(bytes)),
        _ => Box::new(LayeredPointRecordDecompressor::new(bytes)),
    };
    decompressor.set_fields_from(items).expect("known items");
    decompressor.set_selection(selection);
    decompressor.decompress_many(records).expect("sound bytes");
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
            b.iter(|| chunks.iter().for_each(|chunk| decompress(&items, chunk, &mut records)));
        });
        let plain = |item: &LazItem| {
            let kind = item.item_type().into();
            Item { kind, size: item.size(), version: item.version() }
        };
        let schema = Schema::new(&items.iter().map(plain).collect::<Vec<_>>()).expect("known");
        let chunks: Vec<_> = chunks.iter().map(|bytes| Chunk { bytes, count: CHUNK }).collect();
        let (mut decoder, mut fields) = (Decoder::new(), [Fields::default(), Fields::default()]);
        group.bench_function("one chunk", |b| {
            b.iter(|| {
                for chunk in &chunks {
                    fields[0].clear();
                    let done = decoder.chunk(&schema, *chunk, Wanted::ALL, &mut fields[0]);
                    done.expect("sound bytes");
                    black_box(&fields);
                }
            });
        });
        group.bench_function("two chunks", |b| {
            b.iter(|| {
                for pair in chunks.as_chunks().0 {
                    fields.iter_mut().for_each(Fields::clear);
                    let done = decoder.pair(&schema, *pair, Wanted::ALL, &mut fields);
                    assert_eq!(done, [Ok(()), Ok(())]);
                    black_box(&fields);
                }
            });
        });
        group.finish();
    }
}

criterion_group!(benches, chunks);
criterion_main!(benches);
