//! Options for writing a point file.

use super::octree::OctreeCube;
use super::vlr::Vlr;
use crate::format::PointFormat;
use crate::version::{LasVersion, PointPacking};
use terrane_base::geom::{Crs, PointFrame};

/// Options of an output file.
#[derive(Clone, Debug)]
pub struct CloudWriteOptions {
    /// Point format.
    pub format: PointFormat,
    /// LAS version, which must support the point format.
    pub version: LasVersion,
    /// Packing.
    pub packing: PointPacking,
    /// Root cube of COPC files.
    pub cube: Option<OctreeCube>,
    /// Scale and offset of the header.
    pub frame: PointFrame,
    /// CRS as far as known: WKT for point formats 6 to 10, GeoKeys for others. LAS 1.5 supports WKT only.
    pub crs: Crs,
    /// Metadata of the input files.
    pub carried: CopiedMetadata,
    /// Replace an existing file.
    pub overwrite: bool,
}

impl CloudWriteOptions {
    /// An uncompressed file with this point format, of the first version that supports it.
    pub fn new(format: PointFormat, frame: PointFrame, crs: Crs) -> Self {
        let (version, packing) = (LasVersion::of(format), PointPacking::default());
        let carried = CopiedMetadata::default();
        Self { format, version, packing, cube: None, frame, crs, carried, overwrite: false }
    }
}

/// Metadata copied from input files.
#[derive(Clone, Debug, PartialEq)]
pub struct CopiedMetadata {
    /// Bits of the global encoding, except the WKT bit.
    pub encoding: u16,
    /// Time offset in millions of seconds, if the encoding says so.
    pub time_offset: u16,
    /// File source id.
    pub source: u16,
    /// System identifier.
    pub system: String,
    /// Extra bytes per record.
    pub extra_bytes: u16,
    /// Other VLRs.
    pub vlrs: Vec<Vlr>,
}

impl Default for CopiedMetadata {
    /// No metadata; times are adjusted standard GPS times.
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
