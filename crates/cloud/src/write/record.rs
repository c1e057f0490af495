//! Points with the fields of their records.

use terrane_base::geom::Point;

use crate::format::{ANGLES, PointFormat};

/// A point with the fields of its record. Fields that a format lacks are dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointRecord {
    /// Steps of the file's frame.
    pub point: Point,
    /// Adjusted standard GPS time in seconds (GPS time minus a billion); all formats except 0 and 2.
    pub time: f64,
    /// Intensity.
    pub intensity: u16,
    /// Return number, from 1; at most 7 in formats 0 to 5, else 15.
    pub number: u8,
    /// Number of returns, with the same limits.
    pub returns: u8,
    /// Class; values above 31 become 1 (unclassified) in formats 0 to 5.
    pub class: u8,
    /// Flags, with the bits of LAS 1.4: synthetic 1, key point 2, withheld 4, overlap 8 (formats 6 to 10).
    pub flags: u8,
    /// True when the scanner moved in the positive direction.
    pub forward: bool,
    /// True at the end of a scan line.
    pub edge: bool,
    /// Scan angle in steps of 0.006 degrees.
    pub angle: i16,
    /// User data.
    pub user: u8,
    /// Point source id: file or flight line.
    pub source: u16,
    /// Red, green, blue; formats 2, 3, 5, 7, 8, 10.
    pub colour: [u16; 3],
    /// Near infrared; formats 8 and 10.
    pub infrared: u16,
}

impl PointFormat {
    /// Appends the records as stored, without waveforms.
    pub(crate) fn encode(self, records: &[PointRecord], bytes: &mut Vec<u8>) {
        bytes.reserve(records.len() * self.size());
        for record in records {
            let (first, common) = (bytes.len(), common(record));
            if self.is_new() {
                bytes.extend_from_slice(&new(common, record));
            } else {
                bytes.extend_from_slice(&old(common, record));
            }
            self.encode_more(record, bytes);
            bytes.resize(first + self.size(), 0);
        }
    }

    /// The optional fields.
    #[inline(always)]
    fn encode_more(self, record: &PointRecord, bytes: &mut Vec<u8>) {
        let places = self.places();
        if places.time.is_some() && !self.is_new() {
            bytes.extend_from_slice(&record.time.to_le_bytes());
        }
        if places.colour.is_some() {
            bytes.extend(record.colour.iter().flat_map(|c| c.to_le_bytes()));
        }
        if places.infrared.is_some() {
            bytes.extend_from_slice(&record.infrared.to_le_bytes());
        }
    }
}

/// The first fourteen bytes, which all formats share.
#[inline(always)]
fn common(record: &PointRecord) -> [u8; 14] {
    let mut bytes = [0; 14];
    bytes[0..4].copy_from_slice(&record.point.x.to_le_bytes());
    bytes[4..8].copy_from_slice(&record.point.y.to_le_bytes());
    bytes[8..12].copy_from_slice(&record.point.z.to_le_bytes());
    bytes[12..14].copy_from_slice(&record.intensity.to_le_bytes());
    bytes
}

#[inline(always)]
fn new(common: [u8; 14], record: &PointRecord) -> [u8; PointFormat::NEW] {
    let mut bytes = [0; PointFormat::NEW];
    bytes[..14].copy_from_slice(&common);
    bytes[14] = record.number.min(15) | record.returns.min(15) << 4;
    bytes[15] = record.flags & 15 | u8::from(record.forward) << 6 | u8::from(record.edge) << 7;
    bytes[16] = record.class;
    bytes[17] = record.user;
    bytes[18..20].copy_from_slice(&record.angle.to_le_bytes());
    bytes[20..22].copy_from_slice(&record.source.to_le_bytes());
    bytes[22..30].copy_from_slice(&record.time.to_le_bytes());
    bytes
}

#[inline(always)]
fn old(common: [u8; 14], record: &PointRecord) -> [u8; PointFormat::OLD] {
    let class = if record.class < 32 { record.class } else { 1 };
    let mut bytes = [0; PointFormat::OLD];
    bytes[..14].copy_from_slice(&common);
    bytes[14] = record.number.min(7)
        | record.returns.min(7) << 3
        | u8::from(record.forward) << 6
        | u8::from(record.edge) << 7;
    bytes[15] = class | (record.flags & 7) << 5;
    bytes[16] = ((f32::from(record.angle) * ANGLES) as i8).to_le_bytes()[0];
    bytes[17] = record.user;
    bytes[18..20].copy_from_slice(&record.source.to_le_bytes());
    bytes
}
