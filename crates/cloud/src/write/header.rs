//! The header of LAS 1.2, 1.3 and 1.4, and the records after it.

use super::tally::{RETURNS, Tally};
use super::{Layout, Packing, Vlr, WriteOptions, crs, octree};
use crate::format::PointFormat;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Frame;

/// Bytes of the header itself, by version.
const SIZES: [u16; 3] = [227, 235, 375];
/// Bit of the global encoding: the CRS is well-known text.
const WKT: u16 = 16;
/// Bit of the point format that says that points are compressed.
const COMPRESSED: u8 = 128;
/// Most bytes of a record before the points.
const MOST_BYTES: usize = u16::MAX as usize;

impl Vlr {
    /// For people.
    pub(crate) fn name(&self) -> String {
        format!("{} {}", self.user, self.number)
    }

    /// Appends it as it stands before the points, or behind them.
    pub(super) fn append(&self, is_behind: bool, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&[0; 2]);
        bytes.extend_from_slice(&text::<16>(&self.user));
        bytes.extend_from_slice(&self.number.to_le_bytes());
        let length = (self.data.len() as u64).to_le_bytes();
        bytes.extend_from_slice(if is_behind { &length } else { &length[..2] });
        bytes.extend_from_slice(&text::<32>(&self.about));
        bytes.extend_from_slice(&self.data);
    }

    fn is_long(&self) -> bool {
        self.data.len() > MOST_BYTES
    }
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
    size: usize,
    is_compressed: bool,
    frame: Frame,
    encoding: u16,
    source: u16,
    system: String,
    vlrs: Vec<u8>,
    /// How many records `vlrs` holds.
    records: u32,
    /// Records that are too long to stand before the points.
    pub(super) behind: Vec<Vlr>,
    /// Where records begin behind the points.
    pub(super) behind_at: u64,
}

impl Header {
    pub(super) fn new(options: &WriteOptions, layout: &Layout) -> Result<Self> {
        let (format, carried) = (layout.format(), &options.carried);
        let systems = crs::records(&options.crs, format.is_new());
        let is_wkt = systems.iter().any(|vlr| vlr.number == crs::WKT_RECORD);
        // Readers look for it at the first place.
        let info = options.cube.as_ref().map(|cube| octree::info(cube, &Tally::default(), (0, 0)));
        let all =
            info.into_iter().chain(systems).chain(laz(layout)?).chain(carried.vlrs.iter().cloned());
        let (behind, before): (Vec<_>, Vec<_>) = all.partition(Vlr::is_long);
        if let Some(vlr) = behind.first().filter(|_| !format.is_new()) {
            return Err(too_long(vlr));
        }
        let mut vlrs = Vec::new();
        before.iter().for_each(|vlr| vlr.append(false, &mut vlrs));
        let system = match carried.system.as_str() {
            "" => "OTHER".to_owned(),
            named => named.to_owned(),
        };
        Ok(Self {
            format,
            size: layout.size(),
            is_compressed: layout.packing() != Packing::Plain,
            frame: options.frame,
            encoding: carried.encoding | if is_wkt { WKT } else { 0 },
            source: carried.source,
            system,
            vlrs,
            records: before.len() as u32,
            behind,
            behind_at: 0,
        })
    }

    /// Puts the record of an octree in its place, which is the first.
    pub(super) fn set_info(&mut self, info: &Vlr) {
        let mut bytes = Vec::new();
        info.append(false, &mut bytes);
        self.vlrs[..bytes.len()].copy_from_slice(&bytes);
    }

    /// The last part of its version.
    fn version(&self) -> u8 {
        match self.format.number() {
            0..=3 => 2,
            4..=5 => 3,
            _ => 4,
        }
    }

    fn own_size(&self) -> u16 {
        SIZES[usize::from(self.version() - 2)]
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
        let message = format!("LAS 1.{} cannot count {} points", self.version(), tally.count());
        Err(Error::new(ErrorKind::CannotWrite, message).remedy("choose point format 6, 7 or 8"))
    }

    /// The header with its records. The day it was made is left open, so that equal points are equal
    /// files.
    pub(super) fn bytes(&self, tally: &Tally) -> Vec<u8> {
        let format = self.format;
        let mut bytes = b"LASF".to_vec();
        bytes.extend_from_slice(&self.source.to_le_bytes());
        bytes.extend_from_slice(&self.encoding.to_le_bytes());
        bytes.extend_from_slice(&[0; 16]);
        bytes.extend_from_slice(&[1, self.version()]);
        bytes.extend_from_slice(&text::<32>(&self.system));
        bytes.extend_from_slice(&text::<32>(concat!("terrane ", env!("CARGO_PKG_VERSION"))));
        bytes.extend_from_slice(&[0; 4]);
        bytes.extend_from_slice(&self.own_size().to_le_bytes());
        bytes.extend_from_slice(&(self.length() as u32).to_le_bytes());
        bytes.extend_from_slice(&self.records.to_le_bytes());
        bytes.push(format.number() | if self.is_compressed { COMPRESSED } else { 0 });
        bytes.extend_from_slice(&(self.size as u16).to_le_bytes());
        self.old_counts(tally, &mut bytes);
        self.extent(tally, &mut bytes);
        // Waveforms are not in the file.
        bytes.resize(bytes.len() + if self.version() > 2 { 8 } else { 0 }, 0);
        if format.is_new() {
            self.new_counts(tally, &mut bytes);
        }
        debug_assert_eq!(bytes.len(), usize::from(self.own_size()));
        bytes.extend_from_slice(&self.vlrs);
        bytes
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

    /// Records behind the points, and the counts of 64 bits.
    fn new_counts(&self, tally: &Tally, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.behind_at.to_le_bytes());
        bytes.extend_from_slice(&(self.behind.len() as u32).to_le_bytes());
        bytes.extend_from_slice(&tally.count().to_le_bytes());
        let returns: [u64; RETURNS] = tally.returns;
        bytes.extend(returns.iter().flat_map(|count| count.to_le_bytes()));
    }
}

fn too_long(vlr: &Vlr) -> Error {
    let (name, length) = (vlr.name(), vlr.data.len());
    let message = format!(
        "the record {name} takes {length} bytes, and one of this version holds {MOST_BYTES}"
    );
    Error::new(ErrorKind::CannotWrite, message).remedy("choose point format 6, 7 or 8")
}

/// The record that tells how points are compressed.
fn laz(layout: &Layout) -> Result<Option<Vlr>> {
    let Some(laz) = layout.vlr() else { return Ok(None) };
    let mut data = Vec::new();
    let fault = |e| Error::new(ErrorKind::Internal, format!("no record of compression: {e}"));
    laz.write_to(&mut data).map_err(fault)?;
    let (user, number) = (laz::LazVlr::USER_ID, laz::LazVlr::RECORD_ID);
    Ok(Some(Vlr { user: user.into(), number, about: laz::LazVlr::DESCRIPTION.into(), data }))
}
