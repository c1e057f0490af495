//! What the times of points are counted from, which bits of the global encoding say, and in LAS 1.5 a field.

use super::las::LasHeader;
use super::version::{LasVersion, PointPacking};
use terrane_base::error::{Error, Result};

/// Bits of the global encoding: times are GPS times less a billion seconds; with the other bit, from version 1.5 on,
/// less as many millions as the header says.
const STANDARD: u16 = 1;
const OFFSET: u16 = 1 << 6;
/// The millions of seconds of adjusted standard GPS times.
const BILLION: u16 = 1000;

/// What times are counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GpsTimeEpoch {
    /// The beginning of the week.
    Week,
    /// The beginning of GPS time and so many millions of seconds.
    Gps(u16),
}

impl GpsTimeEpoch {
    /// Adjusted standard GPS times.
    pub(super) const USUAL: Self = Self::Gps(BILLION);

    pub(super) fn of(header: &LasHeader) -> Self {
        match header.encoding & (STANDARD | OFFSET) {
            both if both == STANDARD | OFFSET && header.version >= [1, 5] => {
                Self::Gps(header.time_offset)
            }
            bits if bits & STANDARD > 0 => Self::USUAL,
            _ => Self::Week,
        }
    }

    /// The bits of the global encoding, and the millions of seconds, that say so in a version; of points without
    /// times those that every version has.
    ///
    /// # Errors
    /// A version that cannot say so.
    pub(super) fn written(self, version: LasVersion, has_time: bool) -> Result<(u16, u16)> {
        match self {
            Self::Week => Ok((0, 0)),
            Self::Gps(_) if !has_time || self == Self::USUAL => Ok((STANDARD, 0)),
            Self::Gps(millions) if version >= LasVersion::V1_5 => Ok((STANDARD | OFFSET, millions)),
            Self::Gps(millions) => Err(Error::unsupported(format!(
                "LAS {version} does not support GPS times with an offset of {millions} million seconds"
            ))
            .remedy("write .las or .laz with ‹las_version› 1.5")),
        }
    }

    /// What is to be said of them where nothing else does.
    pub(super) fn note(self, packing: PointPacking) -> Option<String> {
        match self {
            Self::Gps(millions) if packing == PointPacking::Text && self != Self::USUAL => {
                Some(format!(
                    "times are GPS times minus {millions} million seconds; text does not record the offset"
                ))
            }
            _ => None,
        }
    }
}
