//! Options of a point file to be written.

use super::octree::OctreeCube;
use super::vlr::Vlr;
use crate::format::PointFormat;
use crate::version::{LasVersion, PointPacking};
use terrane_base::geom::{Crs, PointFrame};

/// What a file is to be.
#[derive(Clone, Debug)]
pub struct CloudWriteOptions {
    /// Format of its points.
    pub format: PointFormat,
    /// The version of LAS, which has points of this format.
    pub version: LasVersion,
    /// Whether and how they are compressed.
    pub packing: PointPacking,
    /// Where nodes lie, of files that have them.
    pub cube: Option<OctreeCube>,
    /// Where the points lie: scale and offset of the header.
    pub frame: PointFrame,
    /// Named in the file as far as known: as well-known text from point format 6 on, as GeoKeys
    /// before it. LAS 1.5 knows nothing but text.
    pub crs: Crs,
    /// What is taken over from other files.
    pub carried: CarriedMetadata,
    /// Replace an existing file.
    pub overwrite: bool,
}

impl CloudWriteOptions {
    /// An uncompressed file with points of this format, of the first version that has them.
    pub fn new(format: PointFormat, frame: PointFrame, crs: Crs) -> Self {
        let (version, packing) = (LasVersion::of(format), PointPacking::default());
        let carried = CarriedMetadata::default();
        Self { format, version, packing, cube: None, frame, crs, carried, overwrite: false }
    }
}

/// What a file takes over from those that its points come from.
#[derive(Clone, Debug, PartialEq)]
pub struct CarriedMetadata {
    /// Bits of the global encoding, but for that of well-known text.
    pub encoding: u16,
    /// What times are counted from, in millions of seconds of GPS time, where the encoding says so.
    pub time_offset: u16,
    /// Number of the file or flight line.
    pub source: u16,
    /// What measured it.
    pub system: String,
    /// Bytes of each record behind the fields of its format.
    pub extra_bytes: u16,
    /// Other records.
    pub vlrs: Vec<Vlr>,
}

impl Default for CarriedMetadata {
    /// Nothing; times are adjusted standard GPS times.
    fn default() -> Self {
        Self {
            encoding: 1,
            time_offset: 0,
            source: 0,
            system: String::new(),
            extra_bytes: 0,
            vlrs: Vec::new(),
        }
    }
}
