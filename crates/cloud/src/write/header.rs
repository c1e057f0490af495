//! The header of LAS 1.2 to 1.5, and the VLRs after it.

use super::chunk::PointLayout;
use super::header_statistics::{PointTally, RETURNS};
use super::options::CloudWriteOptions;
use super::vlr::{MAX_BYTES, Vlr, text};
use super::{crs, octree};
use crate::format::PointFormat;
use crate::las::{IS_WKT, SIZES, WKT};
use crate::version::{LasVersion, PointPacking};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Crs, PointFrame};

/// Bit of the point format field for compressed points.
const COMPRESSED: u8 = 128;
/// Generating software, and its offset in the header.
pub(super) const SOFTWARE: &str = concat!("terrane ", env!("CARGO_PKG_VERSION"));
pub(super) const SOFTWARE_AT: usize = 58;

/// The header as far as known before points are written.
pub(super) struct LasHeaderDraft {
    format: PointFormat,
    version: LasVersion,
    size: usize,
    is_compressed: bool,
    frame: PointFrame,
    encoding: u16,
    time_offset: u16,
    source: u16,
    system: String,
    vlrs: Vec<u8>,
    /// Number of VLRs in `vlrs`.
    records: u32,
    /// EVLRs: records too long for VLRs.
    pub(super) behind: Vec<Vlr>,
    /// Offset of the EVLRs.
    pub(super) behind_at: u64,
}

impl LasHeaderDraft {
    pub(super) fn new(options: &CloudWriteOptions, layout: &PointLayout) -> Result<Self> {
        let (format, version, carried) = (layout.format(), options.version, &options.carried);
        let systems = crs::records(&options.crs, format.is_new());
        let is_wkt = systems.iter().any(|vlr| vlr.number == WKT);
        if version >= LasVersion::V1_5 && !is_wkt && !systems.is_empty() {
            return Err(no_text(&options.crs));
        }
        // Readers expect it to be the first.
        let info =
            options.cube.as_ref().map(|cube| octree::info(cube, &PointTally::default(), 0, 0));
        let all =
            info.into_iter().chain(systems).chain(laz(layout)?).chain(carried.vlrs.iter().cloned());
        let (behind, before): (Vec<_>, Vec<_>) = all.partition(Vlr::is_long);
        if let Some(vlr) = behind.first().filter(|_| version < LasVersion::V1_4) {
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
            version,
            size: layout.size(),
            is_compressed: layout.packing() != PointPacking::Plain,
            frame: options.frame,
            encoding: carried.encoding
                | if is_wkt || version >= LasVersion::V1_5 { IS_WKT } else { 0 },
            time_offset: carried.time_offset,
            source: carried.source,
            system,
            vlrs,
            records: before.len() as u32,
            behind,
            behind_at: 0,
        })
    }

    /// Replaces the COPC info VLR, which is the first.
    pub(super) fn set_info(&mut self, info: &Vlr) {
        let mut bytes = Vec::new();
        info.append(false, &mut bytes);
        self.vlrs[..bytes.len()].copy_from_slice(&bytes);
    }

    fn own_size(&self) -> u16 {
        SIZES[usize::from(self.version.minor() - 2)]
    }

    /// Bytes of the header and its VLRs: offset of the points.
    pub(super) fn length(&self) -> u64 {
        u64::from(self.own_size()) + self.vlrs.len() as u64
    }

    /// Fails if there are more points than the version supports.
    pub(super) fn check(&self, tally: &PointTally) -> Result<()> {
        if self.version >= LasVersion::V1_4 || tally.count() <= u64::from(u32::MAX) {
            return Ok(());
        }
        let message = format!("LAS {} cannot store {} points", self.version, tally.count());
        Err(Error::new(ErrorKind::CannotWrite, message).remedy("choose point format 6, 7 or 8"))
    }

    /// The header with its VLRs. The creation date is empty, so that equal points make equal files.
    pub(super) fn bytes(&self, tally: &PointTally) -> Vec<u8> {
        let format = self.format;
        let mut bytes = b"LASF".to_vec();
        bytes.extend_from_slice(&self.source.to_le_bytes());
        bytes.extend_from_slice(&self.encoding.to_le_bytes());
        bytes.extend_from_slice(&[0; 16]);
        bytes.extend_from_slice(&[1, self.version.minor()]);
        bytes.extend_from_slice(&text::<32>(&self.system));
        bytes.extend_from_slice(&text::<32>(SOFTWARE));
        bytes.extend_from_slice(&[0; 4]);
        bytes.extend_from_slice(&self.own_size().to_le_bytes());
        bytes.extend_from_slice(&(self.length() as u32).to_le_bytes());
        bytes.extend_from_slice(&self.records.to_le_bytes());
        bytes.push(format.number() | if self.is_compressed { COMPRESSED } else { 0 });
        bytes.extend_from_slice(&(self.size as u16).to_le_bytes());
        self.old_counts(tally, &mut bytes);
        self.extent(tally, &mut bytes);
        // There are no internal waveforms.
        bytes.resize(bytes.len() + if self.version.minor() > 2 { 8 } else { 0 }, 0);
        if self.version >= LasVersion::V1_4 {
            self.new_counts(tally, &mut bytes);
        }
        if self.version >= LasVersion::V1_5 {
            let [first, last] = tally.time_range();
            bytes.extend([last, first].iter().flat_map(|time| time.to_le_bytes()));
            bytes.extend_from_slice(&self.time_offset.to_le_bytes());
        }
        debug_assert_eq!(bytes.len(), usize::from(self.own_size()));
        bytes.extend_from_slice(&self.vlrs);
        bytes
    }

    /// The legacy 32-bit counts: zero with point formats 6 to 10, or if they overflow.
    fn old_counts(&self, tally: &PointTally, bytes: &mut Vec<u8>) {
        let is_shown = !self.format.is_new() && tally.count() <= u64::from(u32::MAX);
        let shown = |count: u64| if is_shown { count as u32 } else { 0 };
        bytes.extend_from_slice(&shown(tally.count()).to_le_bytes());
        bytes.extend(tally.returns[..5].iter().flat_map(|count| shown(*count).to_le_bytes()));
    }

    /// Scale, offset, and bounds of all points, maximum before minimum; zeros without points.
    fn extent(&self, tally: &PointTally, bytes: &mut Vec<u8>) {
        let PointFrame { scale, offset } = self.frame;
        let ends = (0..3).flat_map(|axis| {
            [tally.high[axis], tally.low[axis]].map(|step| match tally.count() {
                0 => 0.0,
                _ => f64::from(step) * scale[axis] + offset[axis],
            })
        });
        let all = scale.into_iter().chain(offset).chain(ends);
        bytes.extend(all.flat_map(f64::to_le_bytes));
    }

    /// EVLRs and 64-bit counts.
    fn new_counts(&self, tally: &PointTally, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.behind_at.to_le_bytes());
        bytes.extend_from_slice(&(self.behind.len() as u32).to_le_bytes());
        bytes.extend_from_slice(&tally.count().to_le_bytes());
        let returns: [u64; RETURNS] = tally.returns;
        bytes.extend(returns.iter().flat_map(|count| count.to_le_bytes()));
    }
}

fn no_text(crs: &Crs) -> Error {
    let message =
        format!("LAS 1.5 requires the CRS as WKT, and {} cannot be written as WKT", crs.label());
    Error::new(ErrorKind::CannotWrite, message).remedy("choose ‹las_version› 1.4")
}

fn too_long(vlr: &Vlr) -> Error {
    let (name, length) = (vlr.name(), vlr.data.len());
    let message = format!(
        "the VLR {name} ({length} bytes) exceeds the limit of {MAX_BYTES} bytes of this LAS version"
    );
    Error::new(ErrorKind::CannotWrite, message).remedy("choose point format 6, 7 or 8")
}

/// The LASzip VLR.
fn laz(layout: &PointLayout) -> Result<Option<Vlr>> {
    let Some(laz) = layout.vlr() else { return Ok(None) };
    let mut data = Vec::new();
    laz.write_to(&mut data)
        .map_err(|e| Error::new(ErrorKind::Internal, format!("cannot make the LASzip VLR: {e}")))?;
    let (user, number) = (laz::LazVlr::USER_ID, laz::LazVlr::RECORD_ID);
    Ok(Some(Vlr { user: user.into(), number, about: laz::LazVlr::DESCRIPTION.into(), data }))
}
