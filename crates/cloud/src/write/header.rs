//! The header of LAS 1.2 and 1.4 and the records after it.

use super::tally::{RETURNS, Tally};
use super::{Layout, PointFormat, WriteOptions, crs};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Frame;

/// Bytes of the header itself.
const OLD: u16 = 227;
const NEW: u16 = 375;
/// Bits of the global encoding: times are adjusted standard GPS times; the CRS is well-known text.
const STANDARD_TIME: u16 = 1;
const WKT: u16 = 16;
/// Bit of the point format that says that points are compressed.
const COMPRESSED: u8 = 128;

/// A variable length record.
pub(super) struct Vlr {
    pub(super) user: &'static str,
    pub(super) number: u16,
    pub(super) about: &'static str,
    pub(super) data: Vec<u8>,
}

impl Vlr {
    fn append(&self, bytes: &mut Vec<u8>) -> Result<()> {
        let length = u16::try_from(self.data.len());
        let length = length.map_err(|_| too_long(self.about, self.data.len()))?;
        bytes.extend_from_slice(&[0; 2]);
        bytes.extend_from_slice(&text::<16>(self.user));
        bytes.extend_from_slice(&self.number.to_le_bytes());
        bytes.extend_from_slice(&length.to_le_bytes());
        bytes.extend_from_slice(&text::<32>(self.about));
        bytes.extend_from_slice(&self.data);
        Ok(())
    }
}

fn too_long(what: &str, length: usize) -> Error {
    let message = format!("the {what} takes {length} bytes, and a record holds 65535");
    Error::new(ErrorKind::CannotWrite, message)
}

/// Text padded with zeros, cut where it is too long.
fn text<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    for (byte, from) in field.iter_mut().zip(text.bytes()) {
        *byte = from;
    }
    field
}

/// All of the header that is known from the start.
pub(super) struct Header {
    format: PointFormat,
    is_compressed: bool,
    frame: Frame,
    encoding: u16,
    vlrs: Vec<u8>,
    /// How many records `vlrs` holds.
    records: u32,
}

impl Header {
    pub(super) fn new(options: &WriteOptions, layout: &Layout) -> Result<Self> {
        let format = layout.format();
        let mut all = crs::records(&options.crs, format.is_new());
        let is_wkt = all.iter().any(|vlr| vlr.number == crs::WKT_RECORD);
        if let Some(laz) = layout.vlr() {
            let mut data = Vec::new();
            let fault =
                |e| Error::new(ErrorKind::Internal, format!("no record of compression: {e}"));
            laz.write_to(&mut data).map_err(fault)?;
            let (user, number) = (laz::LazVlr::USER_ID, laz::LazVlr::RECORD_ID);
            all.push(Vlr { user, number, about: laz::LazVlr::DESCRIPTION, data });
        }
        let mut vlrs = Vec::new();
        all.iter().try_for_each(|vlr| vlr.append(&mut vlrs))?;
        Ok(Self {
            format,
            is_compressed: layout.is_compressed(),
            frame: options.frame,
            encoding: STANDARD_TIME | if is_wkt { WKT } else { 0 },
            vlrs,
            records: all.len() as u32,
        })
    }

    fn own_size(&self) -> u16 {
        if self.format.is_new() { NEW } else { OLD }
    }

    /// Bytes of the header and its records: where points begin.
    pub(super) fn length(&self) -> u64 {
        u64::from(self.own_size()) + self.vlrs.len() as u64
    }

    /// Fails when there are more points than the version counts.
    pub(super) fn check(&self, tally: &Tally) -> Result<()> {
        if self.format.is_new() || tally.count() <= u64::from(u32::MAX) {
            return Ok(());
        }
        let message = format!("LAS 1.2 cannot count {} points", tally.count());
        Err(Error::new(ErrorKind::CannotWrite, message).remedy("choose point format 6, 7 or 8"))
    }

    /// The header with its records. The day it was made is left open, so that equal points are equal
    /// files.
    pub(super) fn bytes(&self, tally: &Tally) -> Result<Vec<u8>> {
        let (is_new, format) = (self.format.is_new(), self.format);
        let mut bytes = b"LASF".to_vec();
        bytes.extend_from_slice(&[0, 0]);
        bytes.extend_from_slice(&self.encoding.to_le_bytes());
        bytes.extend_from_slice(&[0; 16]);
        bytes.extend_from_slice(&[1, if is_new { 4 } else { 2 }]);
        bytes.extend_from_slice(&text::<32>("OTHER"));
        bytes.extend_from_slice(&text::<32>(concat!("terrane ", env!("CARGO_PKG_VERSION"))));
        bytes.extend_from_slice(&[0; 4]);
        bytes.extend_from_slice(&self.own_size().to_le_bytes());
        bytes.extend_from_slice(&(self.length() as u32).to_le_bytes());
        bytes.extend_from_slice(&self.records.to_le_bytes());
        bytes.push(format.number() | if self.is_compressed { COMPRESSED } else { 0 });
        bytes.extend_from_slice(&(format.size() as u16).to_le_bytes());
        self.old_counts(tally, &mut bytes);
        self.extent(tally, &mut bytes);
        if is_new {
            new_counts(tally, &mut bytes);
        }
        debug_assert_eq!(bytes.len(), usize::from(self.own_size()));
        bytes.extend_from_slice(&self.vlrs);
        Ok(bytes)
    }

    /// The counts of 32 bits: zero in files with the new formats.
    fn old_counts(&self, tally: &Tally, bytes: &mut Vec<u8>) {
        let shown = |count: u64| if self.format.is_new() { 0 } else { count as u32 };
        bytes.extend_from_slice(&shown(tally.count()).to_le_bytes());
        bytes.extend(tally.returns[..5].iter().flat_map(|count| shown(*count).to_le_bytes()));
    }

    /// Scale, offset, and the box of all points, high before low; zeros for no points.
    fn extent(&self, tally: &Tally, bytes: &mut Vec<u8>) {
        let Frame { scale, offset } = self.frame;
        let world = |axis: usize, step: i32| match tally.count() {
            0 => 0.0,
            _ => f64::from(step) * scale[axis] + offset[axis],
        };
        let ends = |axis: usize| [world(axis, tally.high[axis]), world(axis, tally.low[axis])];
        let all = scale.into_iter().chain(offset).chain((0..3).flat_map(ends));
        bytes.extend(all.flat_map(f64::to_le_bytes));
    }
}

/// Waveforms and extended records, of which there are none, and the counts of 64 bits.
fn new_counts(tally: &Tally, bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(&[0; 8 + 8 + 4]);
    bytes.extend_from_slice(&tally.count().to_le_bytes());
    let returns: [u64; RETURNS] = tally.returns;
    bytes.extend(returns.iter().flat_map(|count| count.to_le_bytes()));
}
