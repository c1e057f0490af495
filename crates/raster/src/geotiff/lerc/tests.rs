//! Blobs made by a plain encoder, square by square, and blobs of noise.

use super::*;
use proptest::prelude::*;

/// Types by LERC's numbers.
const KINDS: [SampleType; 8] = [
    SampleType::I8,
    SampleType::U8,
    SampleType::I16,
    SampleType::U16,
    SampleType::I32,
    SampleType::U32,
    SampleType::F32,
    SampleType::F64,
];

/// A blob of version 2.4 around `body`, with its sizes and checksum right.
fn blob(
    shape: LercBlockShape,
    valid: usize,
    [low, high]: [f64; 2],
    error: f64,
    body: &[u8],
) -> Vec<u8> {
    let kind = (0..).zip(KINDS).find(|(_, kind)| *kind == shape.kind).unwrap().0;
    let size = 14 + 28 + 24 + body.len();
    let numbers = [shape.height, shape.width, shape.depth, valid, 8, size].map(|n| n as i32);
    let mut rest: Vec<u8> = numbers.into_iter().chain([kind]).flat_map(i32::to_le_bytes).collect();
    rest.extend([error, low, high].into_iter().flat_map(f64::to_le_bytes));
    rest.extend(body);
    let sum = lerc::checksum::fletcher32(&rest);
    let head = [&b"Lerc2 "[..], &4_i32.to_le_bytes(), &sum.to_le_bytes()].concat();
    [head, rest].concat()
}

fn shape(kind: SampleType, width: usize, height: usize) -> LercBlockShape {
    LercBlockShape { kind, width, height, depth: 1 }
}

fn decoded(blob: &[u8], shape: LercBlockShape) -> Result<Vec<u8>, Fault> {
    let samples = shape.width * shape.height * shape.depth;
    let mut out = vec![0x55; samples * shape.kind.bytes()];
    decode(blob, shape, &mut out).map(|()| out)
}

fn i16s(bytes: &[u8]) -> Vec<i16> {
    bytes.as_chunks::<2>().0.iter().map(|b| i16::from_ne_bytes(*b)).collect()
}

/// Four squares of a 10 x 9 grid: steps above the lowest, plain, all 0, all 1000.
fn four_squares() -> (Vec<u8>, Vec<i16>) {
    let square = |col: usize, row: usize| usize::from(col >= 8) + 2 * usize::from(row >= 8);
    let height = |col: usize, row: usize| match square(col, row) {
        0 => 100 + (col + 8 * row) as i16,
        1 => -(col as i16) * 300,
        2 => 0,
        _ => 1000,
    };
    let mut body = vec![0; 4];
    body.extend([(-2700_i16).to_le_bytes(), 1000_i16.to_le_bytes()].concat());
    // Not in one sweep; low value as a byte, then 64 numbers of six bits.
    body.extend([0, 1 | 1 << 6, 100, 0x80 | 6, 64]);
    let bits: Vec<u8> = (0..64 * 6).map(|i| (i / 6) >> (i % 6) & 1).map(|b: i32| b as u8).collect();
    body.extend(bits.chunks(8).map(|bits| (0..8).map(|i| bits[i] << i).sum::<u8>()));
    body.push(1 << 2);
    (0..8).for_each(|row| (8..10).for_each(|col| body.extend(height(col, row).to_le_bytes())));
    body.push(2);
    body.push(3 | 1 << 2);
    body.extend(1000_i16.to_le_bytes());
    let heights = (0..90).map(|i| height(i % 10, i / 10)).collect();
    (blob(shape(SampleType::I16, 10, 9), 90, [-2700.0, 1000.0], 0.5, &body), heights)
}

#[test]
fn every_kind_of_square() {
    let (blob, heights) = four_squares();
    let shape = shape(SampleType::I16, 10, 9);
    assert_eq!(i16s(&decoded(&blob, shape).unwrap()), heights);
    for (wrong, words) in [
        (
            LercBlockShape { width: 9, height: 10, ..shape },
            "10 x 9 pixels with 1 samples, expected 9 x 10",
        ),
        (
            LercBlockShape { depth: 2, ..shape },
            "10 x 9 pixels with 1 samples, expected 10 x 9 with 2",
        ),
        (LercBlockShape { kind: SampleType::U16, ..shape }, "type differs from uint16"),
    ] {
        assert!(decoded(&blob, wrong).unwrap_err().contains(words));
    }
}

#[test]
fn any_change_is_noticed() {
    let (blob, _) = four_squares();
    for at in 0..blob.len() {
        let mut damaged = blob.clone();
        damaged[at] ^= 1 << (at % 8);
        assert!(decoded(&damaged, shape(SampleType::I16, 10, 9)).is_err(), "byte {at}");
        assert!(decoded(&blob[..at], shape(SampleType::I16, 10, 9)).is_err(), "{at} bytes");
    }
}

/// A mask of 12 pixels: two literal bytes, then the end.
fn masked(mask: [u8; 2], body: &[u8]) -> Vec<u8> {
    let runs = [&2_i16.to_le_bytes()[..], &mask, &i16::MIN.to_le_bytes()].concat();
    [&(runs.len() as i32).to_le_bytes()[..], &runs, body].concat()
}

#[test]
fn samples_outside_the_mask_are_nan() {
    let shape = shape(SampleType::F32, 4, 3);
    let heights = [1.5_f32, -2.5, 7.25];
    let mut body = [(-2.5_f32).to_le_bytes(), 7.25_f32.to_le_bytes()].concat();
    body.push(1);
    body.extend(heights.iter().flat_map(|h| h.to_le_bytes()));
    let body = masked([0b0100_0001, 0b0001_0000], &body);
    let out = decoded(&blob(shape, 3, [-2.5, 7.25], 0.0, &body), shape).unwrap();
    let out: Vec<f32> = out.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
    let valid: Vec<_> = (0..12).filter(|i| !out[*i].is_nan()).map(|i| (i, out[i])).collect();
    assert_eq!(valid, [(1, 1.5), (7, -2.5), (11, 7.25)]);
    assert!(decoded(&blob(shape, 4, [-2.5, 7.25], 0.0, &body), shape).is_err(), "miscounted");
}

#[test]
fn a_blob_for_each_sample_of_a_pixel_shares_the_mask_before() {
    let shape = shape(SampleType::F32, 4, 3);
    let body = masked([0b0100_0001, 0b0001_0000], &[]);
    let blobs = [
        blob(shape, 3, [5.0, 5.0], 0.0, &body),
        blob(shape, 3, [6.0, 6.0], 0.0, &[0; 4]),
        blob(shape, 12, [7.0, 7.0], 0.0, &[0; 4]),
    ];
    let three = LercBlockShape { depth: 3, ..shape };
    let out = decoded(&blobs.concat(), three).unwrap();
    let out: Vec<f32> = out.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
    for (pixel, samples) in out.chunks_exact(3).enumerate() {
        let valid = [1, 7, 11].contains(&pixel);
        assert!(samples[0] == 5.0 && samples[1] == 6.0 || !valid, "{samples:?}");
        assert!(samples[0].is_nan() && samples[1].is_nan() || valid, "{samples:?}");
        assert_eq!(samples[2], 7.0);
    }
    assert!(decoded(&blobs[..2].concat(), three).is_err(), "one is missing");
    assert!(decoded(&blobs[1..].concat(), three).is_err(), "no mask before");
}

#[test]
fn grids_of_one_value_or_none() {
    let shape = shape(SampleType::I16, 4, 3);
    let flat = decoded(&blob(shape, 12, [7.0, 7.0], 0.5, &[0; 4]), shape).unwrap();
    assert_eq!(i16s(&flat), [7; 12]);
    let void = decoded(&blob(shape, 0, [0.0, 0.0], 0.5, &[0; 4]), shape).unwrap();
    assert_eq!(i16s(&void), [0; 12]);
    let run = [&(-2_i16).to_le_bytes()[..], &[0xf0], &i16::MIN.to_le_bytes()].concat();
    let body = [&(run.len() as i32).to_le_bytes()[..], &run].concat();
    let half = decoded(&blob(shape, 8, [7.0, 7.0], 0.5, &body), shape).unwrap();
    assert_eq!(i16s(&half), [7, 7, 7, 7, 0, 0, 0, 0, 7, 7, 7, 7]);
}

#[test]
fn other_versions_are_read_or_refused_by_name() {
    let heights: Vec<f32> = (0..90).map(|i| (i as f32).sqrt()).collect();
    let newer = lerc::encode_slice(10, 9, &heights, lerc::Precision::Lossless).unwrap();
    assert!(newer[6] > 4);
    let read = decoded(&newer, shape(SampleType::F32, 10, 9)).unwrap();
    assert_eq!(read, heights.iter().flat_map(|h| h.to_ne_bytes()).collect::<Vec<u8>>());
    let (mut blob, _) = four_squares();
    blob[6] = 7;
    let error = decoded(&blob, shape(SampleType::I16, 10, 9)).unwrap_err();
    assert!(error.contains("LERC version: 7"), "{error}");
    assert!(decoded(b"no such thing", shape(SampleType::I16, 1, 1)).unwrap_err().contains("LERC"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]
    #[test]
    fn noise_with_a_right_checksum_never_panics(
        kind in 0_usize..8, valid in 0_usize..40, coded in any::<bool>(), depth in 1_usize..3,
        mut body in prop::collection::vec(prop_oneof![any::<u8>(), 0_u8..5], 0..300),
        sweep in 0_u8..2, mode in 0_u8..4,
    ) {
        let kind = KINDS[kind];
        let shape = LercBlockShape { depth, ..shape(kind, 13, 3) };
        if coded {
            // Far enough for squares and codes to be reached.
            let ranges = 2 * depth * kind.bytes();
            let start = [vec![0; 4], (0..ranges as u8).collect(), vec![sweep, mode]].concat();
            body.splice(..0, start);
        }
        let valid = if coded { 39 } else { valid.min(39) };
        let _ = decoded(&blob(shape, valid, [0.0, 1.0], 0.5, &body), shape);
    }
}
