//! Points with all their fields, and how a point format stores them.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;

/// A point with what its record tells. Fields that a format does not have are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Record {
    /// Steps of the file's frame.
    pub point: Point,
    /// Seconds, in adjusted standard GPS time (GPS time less a billion); formats but 0 and 2.
    pub time: f64,
    /// Strength of the return.
    pub intensity: u16,
    /// Which return of its pulse, from 1; at most 7 before format 6, 15 from there on.
    pub number: u8,
    /// Returns of the pulse, with the same limits.
    pub returns: u8,
    /// Class; those beyond 31 become 1 (unclassified) before format 6, which cannot tell them.
    pub class: u8,
    /// Marks, with the bits of LAS 1.4: synthetic 1, key point 2, withheld 4, overlap 8 (which formats
    /// before 6 do not have).
    pub flags: u8,
    /// True when the scanner moved in the positive direction.
    pub forward: bool,
    /// True at the end of a scan line.
    pub edge: bool,
    /// Angle of the beam in steps of 0.006 degrees.
    pub angle: i16,
    /// Whatever the user likes.
    pub user: u8,
    /// The file or flight line it came from.
    pub source: u16,
    /// Red, green, blue; formats 2, 3, 7, 8.
    pub colour: [u16; 3],
    /// Near infrared; format 8.
    pub infrared: u16,
}

/// A point format of LAS that can be written: 0 to 3 (LAS 1.2) and 6 to 8 (LAS 1.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointFormat(u8);

impl Default for PointFormat {
    fn default() -> Self {
        Self(6)
    }
}

/// Size of the fields that all formats have, before 6 and from 6 on.
const OLD: usize = 20;
const NEW: usize = 30;
/// Steps of 0.006 degrees in a degree.
const ANGLES: f32 = 0.006;

impl PointFormat {
    /// The formats there are.
    pub const ALL: [u8; 7] = [0, 1, 2, 3, 6, 7, 8];

    /// The format of this number.
    ///
    /// # Errors
    /// One that is not written.
    pub fn new(number: u8) -> Result<Self> {
        if Self::ALL.contains(&number) {
            return Ok(Self(number));
        }
        Err(Error::usage(format!("point format {number} is not written"))
            .remedy("choose 0, 1, 2, 3, 6, 7 or 8"))
    }

    /// Its number.
    pub fn number(self) -> u8 {
        self.0
    }

    /// True for the formats of LAS 1.4.
    pub fn is_new(self) -> bool {
        self.0 >= 6
    }

    fn has_time(self) -> bool {
        matches!(self.0, 1 | 3)
    }

    fn has_colour(self) -> bool {
        matches!(self.0, 2 | 3 | 7 | 8)
    }

    /// Bytes of a record.
    pub fn size(self) -> usize {
        let base = if self.is_new() { NEW } else { OLD };
        let time = if self.has_time() { 8 } else { 0 };
        let colour = if self.has_colour() { 6 } else { 0 };
        base + time + colour + if self.0 == 8 { 2 } else { 0 }
    }

    /// Appends the records as they are stored.
    pub(super) fn encode(self, records: &[Record], bytes: &mut Vec<u8>) {
        bytes.reserve(records.len() * self.size());
        for record in records {
            let common = common(record);
            if self.is_new() {
                bytes.extend_from_slice(&new(common, record));
            } else {
                bytes.extend_from_slice(&old(common, record));
            }
            self.encode_more(record, bytes);
        }
    }

    /// The fields that only some formats have.
    #[inline(always)]
    fn encode_more(self, record: &Record, bytes: &mut Vec<u8>) {
        if self.has_time() {
            bytes.extend_from_slice(&record.time.to_le_bytes());
        }
        if self.has_colour() {
            bytes.extend(record.colour.iter().flat_map(|c| c.to_le_bytes()));
        }
        if self.0 == 8 {
            bytes.extend_from_slice(&record.infrared.to_le_bytes());
        }
    }
}

/// The first fourteen bytes, which are the same in all formats.
#[inline(always)]
fn common(record: &Record) -> [u8; 14] {
    let mut bytes = [0; 14];
    bytes[0..4].copy_from_slice(&record.point.x.to_le_bytes());
    bytes[4..8].copy_from_slice(&record.point.y.to_le_bytes());
    bytes[8..12].copy_from_slice(&record.point.z.to_le_bytes());
    bytes[12..14].copy_from_slice(&record.intensity.to_le_bytes());
    bytes
}

#[inline(always)]
fn new(common: [u8; 14], record: &Record) -> [u8; NEW] {
    let mut bytes = [0; NEW];
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
fn old(common: [u8; 14], record: &Record) -> [u8; OLD] {
    let class = if record.class < 32 { record.class } else { 1 };
    let mut bytes = [0; OLD];
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
