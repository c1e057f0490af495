//! Epochs of GPS times: bits of the global encoding, and a field in LAS 1.5.

use super::las::LasHeader;
use super::version::{LasVersion, PointPacking};
use terrane_base::error::{Error, Result};

/// Bits of the global encoding: times are adjusted standard GPS times (minus a billion seconds); or, from version
/// 1.5, minus the time offset of the header.
const STANDARD: u16 = 1;
const OFFSET: u16 = 1 << 6;
/// Time offset of adjusted standard GPS times, in millions of seconds.
const BILLION: u16 = 1000;

/// Epoch of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GpsTimeEpoch {
    /// Start of the GPS week.
    Week,
    /// Start of GPS time plus this number of million seconds.
    Gps(u16),
}

impl GpsTimeEpoch {
    /// Adjusted standard GPS times.
    pub(super) const USUAL: Self = Self::Gps(BILLION);

    /// Seconds from the start of GPS time to time 0; `None` for seconds of a week.
    pub(super) fn offset(self) -> Option<f64> {
        match self {
            Self::Week => None,
            Self::Gps(millions) => Some(f64::from(millions) * 1e6),
        }
    }

    pub(super) fn of(header: &LasHeader) -> Self {
        match header.encoding & (STANDARD | OFFSET) {
            both if both == STANDARD | OFFSET && header.version >= [1, 5] => {
                Self::Gps(header.time_offset)
            }
            bits if bits & STANDARD > 0 => Self::USUAL,
            _ => Self::Week,
        }
    }

    /// Bits of the global encoding and time offset for a LAS version; without times, bits that every version
    /// supports.
    ///
    /// # Errors
    /// A version that does not support the epoch.
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

    /// A note, where the format does not record the epoch.
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
