//! Whole records of compressed files of others, byte for byte as the `laz` crate decodes them.

use std::io::{Cursor, Seek, SeekFrom};
use std::path::PathBuf;

use crate::data;
use laz::laszip::ChunkTable;
use laz::{LasZipDecompressor, LazVlr};
use terrane_cloud::lazip::{
    CompressedChunk, DecodedFields, FieldSelection, LaszipItem, LaszipSchema, LazDecoder,
};

/// A compressed file, as far as a decoder has to know of it.
struct Packed {
    bytes: Vec<u8>,
    points_at: usize,
    count: usize,
    /// Bytes of a record.
    size: usize,
    vlr: LazVlr,
    /// Whether all points are in one stream.
    is_stream: bool,
}

fn number<const N: usize>(bytes: &[u8], at: usize) -> usize {
    bytes[at..at + N].iter().rev().fold(0, |number, byte| number << 8 | usize::from(*byte))
}

impl Packed {
    fn read(path: &PathBuf) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let data = laszip_record(&bytes);
        let count = match bytes[25] {
            4 => number::<8>(&bytes, 247),
            _ => number::<4>(&bytes, 107),
        };
        Self {
            points_at: number::<4>(&bytes, 96),
            size: number::<2>(&bytes, 105),
            vlr: LazVlr::from_buffer(data).unwrap(),
            is_stream: number::<2>(data, 0) == 1,
            count,
            bytes,
        }
    }

    fn schema(&self) -> LaszipSchema {
        let item = |item: &laz::LazItem| LaszipItem {
            kind: item.item_type().into(),
            size: item.size(),
            version: item.version(),
        };
        LaszipSchema::new(&self.vlr.items().iter().map(item).collect::<Vec<_>>()).unwrap()
    }

    fn points(&self) -> Cursor<&[u8]> {
        let mut points = Cursor::new(&self.bytes[..]);
        points.seek(SeekFrom::Start(self.points_at as u64)).unwrap();
        points
    }

    fn theirs(&self) -> Vec<u8> {
        let mut records = vec![0; self.count * self.size];
        let mut decoder = LasZipDecompressor::new(self.points(), self.vlr.clone()).unwrap();
        decoder.decompress_many(&mut records).unwrap();
        records
    }

    fn ours(&self, decoder: &mut LazDecoder) -> Vec<u8> {
        let (schema, mut fields) = (self.schema(), DecodedFields::default());
        if self.is_stream {
            let bytes = &self.bytes[self.points_at..];
            let (mut flow, left) = decoder.flow(&schema, bytes, FieldSelection::RECORDS).unwrap();
            let rest = &bytes[bytes.len() - left..];
            flow.read(rest, self.count, &mut fields).unwrap();
            return fields.records;
        }
        let mut points = self.points();
        let table = ChunkTable::read_from(&mut points, &self.vlr).unwrap();
        let (mut at, mut left) = (points.position() as usize, self.count);
        for entry in &table {
            let (count, bytes) =
                ((entry.point_count as usize).min(left), entry.byte_count as usize);
            let chunk = CompressedChunk { bytes: &self.bytes[at..at + bytes], count };
            decoder.chunk(&schema, chunk, FieldSelection::RECORDS, &mut fields).unwrap();
            (at, left) = (at + bytes, left - count);
        }
        fields.records
    }
}

/// The data of the record that says how points are compressed.
fn laszip_record(bytes: &[u8]) -> &[u8] {
    let mut at = number::<2>(bytes, 94);
    loop {
        let data = at + 54..at + 54 + number::<2>(bytes, at + 20);
        if number::<2>(bytes, at + 18) == 22_204 {
            return &bytes[data];
        }
        at = data.end;
    }
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn real_files_become_the_records_that_another_decoder_finds() {
    let (mut decoder, mut seen) = (LazDecoder::new(), 0);
    for path in [data::files("lidar"), data::files("lidar/formats")].concat() {
        if path.extension().is_none_or(|ending| ending != "laz") {
            continue;
        }
        let file = Packed::read(&path);
        let (ours, theirs) = (file.ours(&mut decoder), file.theirs());
        let off = ours.iter().zip(&theirs).position(|(a, b)| a != b);
        let place = off.map(|at| (at / file.size, at % file.size));
        assert!(place.is_none() && ours.len() == theirs.len(), "{}: {place:?}", path.display());
        seen += 1;
    }
    assert!(seen >= 15, "{seen} files");
}
