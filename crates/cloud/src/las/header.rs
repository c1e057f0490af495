//! The public header block of LAS 1.0 to 1.5 (ASPRS LAS 1.4 R16, section 2.4; LAS 1.5 R00, section 2.3), checked
//! against the file length.

use terrane_base::error::{Error, Result};
use terrane_base::limits;

use super::bytes::LasHeaderBytes;
use crate::format::PointFormat;

/// Header bytes of LAS 1.0 to 1.2, of 1.3, of 1.4 and of 1.5.
pub(crate) const SIZES: [u16; 4] = [227, 235, 375, 393];
/// Maximum header bytes that are read.
pub(super) const MAX_BYTES: u64 = 393;

/// Counts in 32 bits, beside the counts in 64 bits of LAS 1.4 and later.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LegacyCounts {
    /// All points.
    pub points: u64,
    /// Points by return, from the first.
    pub returns: Vec<u64>,
}

/// The header of a LAS file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LasHeader {
    pub(crate) version: [u8; 2],
    /// File source id.
    pub(crate) source: u16,
    /// Bytes before the first VLR.
    pub(super) size: u16,
    /// Offset of the points.
    pub(crate) points_at: u64,
    pub(super) vlrs: u32,
    /// Point format, 0 to 10.
    pub(crate) format: u8,
    pub(crate) is_compressed: bool,
    /// Record length.
    pub(crate) record: u16,
    pub(crate) count: u64,
    /// Points by return; and the legacy counts of LAS 1.4 and later.
    pub(crate) returns: Vec<u64>,
    pub(crate) legacy: Option<LegacyCounts>,
    pub(crate) scale: [f64; 3],
    pub(crate) offset: [f64; 3],
    pub(crate) low: [f64; 3],
    pub(crate) high: [f64; 3],
    pub(super) evlrs_at: u64,
    pub(super) evlrs: u32,
    /// Offset of internal waveforms, from version 1.3.
    waves_at: u64,
    pub(crate) system: String,
    pub(crate) software: String,
    /// Day of the year, and year.
    pub(crate) created: [u16; 2],
    pub(crate) encoding: u16,
    /// Time offset in millions of seconds, from version 1.5.
    pub(crate) time_offset: u16,
    /// Notes on oddities.
    pub(crate) notes: Vec<String>,
}

impl LasHeader {
    /// From the first bytes of a file of `len` bytes.
    pub(super) fn parse(head: &[u8], len: u64) -> Result<Self> {
        if !head.starts_with(b"LASF") {
            return Err(Error::bad_input(
                "is not a LAS or LAZ file: the signature LASF is missing",
            )
            .remedy("copy the file again, or use another file"));
        }
        if head.len() < usize::from(SIZES[0]) {
            return Err(Error::bad_input(format!(
                "file is truncated: {len} bytes are too short for a header"
            ))
            .remedy("copy the file again"));
        }
        let header = Self::read(LasHeaderBytes(head));
        header.check_version()?;
        header.check_layout(len)?;
        header.check_place()?;
        Ok(header)
    }

    fn read(b: LasHeaderBytes<'_>) -> Self {
        let version = [b.u8(24), b.u8(25)];
        let is_long = version >= [1, 4];
        let (count, notes) = count(b, is_long);
        let narrow = LegacyCounts {
            points: b.u32(107).into(),
            returns: (0..5).map(|i| b.u32(111 + 4 * i).into()).collect(),
        };
        let (returns, legacy) = match is_long {
            true => ((0..15).map(|i| b.u64(255 + 8 * i)).collect(), Some(narrow)),
            false => (narrow.returns, None),
        };
        Self {
            version,
            source: b.u16(4),
            size: b.u16(94),
            points_at: u64::from(b.u32(96)),
            vlrs: b.u32(100),
            format: b.u8(104) & 0x7f,
            is_compressed: b.u8(104) & 0x80 != 0,
            record: b.u16(105),
            count,
            returns,
            legacy,
            scale: [131, 139, 147].map(|at| b.f64(at)),
            offset: [155, 163, 171].map(|at| b.f64(at)),
            // Maximum and minimum of each axis follow each other.
            high: [179, 195, 211].map(|at| b.f64(at)),
            low: [187, 203, 219].map(|at| b.f64(at)),
            evlrs_at: if is_long { b.u64(235) } else { 0 },
            evlrs: if is_long { b.u32(243) } else { 0 },
            waves_at: if version >= [1, 3] { b.u64(227) } else { 0 },
            system: b.text(26, 32),
            software: b.text(58, 32),
            created: [b.u16(90), b.u16(92)],
            encoding: b.u16(6),
            time_offset: if version >= [1, 5] { b.u16(391) } else { 0 },
            notes,
        }
    }

    fn check_version(&self) -> Result<()> {
        let [major, minor] = self.version;
        if (major, minor) < (1, 0) || (major, minor) > (1, 5) {
            let message = format!("unknown LAS version {major}.{minor}");
            return Err(Error::unsupported(message).remedy("use a version from 1.0 to 1.5"));
        }
        if self.format >= PointFormat::COUNT {
            let message = format!("unknown point format {}", self.format);
            return Err(Error::unsupported(message).remedy("use a format from 0 to 10"));
        }
        Ok(())
    }

    fn check_layout(&self, len: u64) -> Result<()> {
        limits::check("number of points", self.count, limits::MAX_POINTS)
            .map_err(|e| e.remedy("copy the file again"))?;
        let size = SIZES[usize::from(self.version[1].saturating_sub(2))];
        if self.size < size {
            return damaged(format!(
                "the header is {} bytes long, version 1.{} requires {size}",
                self.size, self.version[1]
            ));
        }
        if self.points_at < u64::from(self.size) || self.points_at > len {
            return damaged(format!(
                "the point offset {} is outside the file (header ends at {}, file at {len})",
                self.points_at, self.size
            ));
        }
        let least = least(self.format);
        if self.record < least {
            return damaged(format!(
                "the record length is {}, point format {} requires {least} or more",
                self.record, self.format
            ));
        }
        Ok(())
    }

    /// Scale, offset and bounds.
    fn check_place(&self) -> Result<()> {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let (scale, offset) = (self.scale[axis], self.offset[axis]);
            if !(scale.is_normal() && scale > 0.0 && offset.is_finite()) {
                let message = format!("the scale of {name} is {scale} with offset {offset}");
                return Err(Error::bad_input(message)
                    .remedy("rewrite the file with a positive scale and a finite offset"));
            }
            let (low, high) = (self.low[axis], self.high[axis]);
            let sound = low.is_finite() && high.is_finite() && low <= high;
            if self.count > 0 && !sound {
                let message = format!("the bounds of {name} are invalid: {low} to {high}");
                return Err(Error::bad_input(message)
                    .remedy("repair the header, for example with pdal translate IN OUT"));
            }
        }
        Ok(())
    }

    /// End of the points: offset of the next section, or the length of the file.
    pub(crate) fn points_end(&self, len: u64) -> u64 {
        let others = [(self.evlrs > 0).then_some(self.evlrs_at), Some(self.waves_at)];
        let behind = others.into_iter().flatten().filter(|at| *at >= self.behind(len));
        behind.fold(len, u64::min)
    }

    /// Minimum offset of sections after the points; the size of compressed points is unknown here.
    pub(super) fn behind(&self, len: u64) -> u64 {
        let bytes = if self.is_compressed { 0 } else { self.count * u64::from(self.record) };
        self.points_at.saturating_add(bytes).min(len.max(self.points_at))
    }

    /// True for formats 6 to 10.
    pub(crate) fn is_new(&self) -> bool {
        PointFormat::new(self.format).is_ok_and(PointFormat::is_new)
    }

    /// Extra bytes of each point.
    pub(crate) fn extra_bytes(&self) -> u16 {
        self.record - least(self.format)
    }
}

/// Record length of a point format without extra bytes.
fn least(format: u8) -> u16 {
    PointFormat::new(format).map_or(0, |format| format.size() as u16)
}

/// Number of points: the 64-bit count of LAS 1.4, or the legacy count if only that is set.
fn count(b: LasHeaderBytes<'_>, is_long: bool) -> (u64, Vec<String>) {
    let narrow = u64::from(b.u32(107));
    let wide = if is_long { b.u64(247) } else { narrow };
    match (wide, narrow) {
        (0, 1..) => {
            let note = format!("only the legacy point count is set: {narrow}");
            (narrow, vec![note])
        }
        (_, 1..) if wide != narrow => {
            let note = format!(
                "the point count {wide} differs from the legacy point count {narrow}; the former is \
                 used"
            );
            (wide, vec![note])
        }
        _ => (wide, Vec::new()),
    }
}

fn damaged(message: String) -> Result<()> {
    Err(Error::bad_input(message).remedy("copy the file again"))
}
