//! Sources of points: files, mosaics of files, points in memory, synthetic clouds.

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point, PointFrame};

use super::attributes::{AttributeSelection, PointBatch};

/// Maximum points of a batch.
pub const BATCH: usize = 1 << 16;

/// Metadata of a cloud, known before points are read.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudInfo {
    /// Scale and offset of the points.
    pub frame: PointFrame,
    /// Minimum and maximum coordinates of the headers, cut to the filter's bounds; every point passed on lies within.
    /// `None` if no point passes the filter.
    pub bounds: Option<[Point; 2]>,
    /// Number of points of the headers, in parts that may intersect the filter's bounds.
    pub count: u64,
    /// The CRS, as far as known.
    pub crs: Crs,
}

/// Counts of points read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReturnCounts {
    /// Points of the files, including lost ones.
    pub read: u64,
    /// Points passed on.
    pub kept: u64,
    /// Points with the withheld flag, dropped.
    pub withheld: u64,
    /// Points dropped by filters.
    pub filtered: u64,
    /// Points skipped because they lie outside the bounds of the header.
    pub outside: u64,
    /// Unreadable points, skipped.
    pub lost: u64,
}

impl ReturnCounts {
    /// Adds the counts of another part.
    pub fn add(&mut self, other: &Self) {
        self.read += other.read;
        self.kept += other.kept;
        self.withheld += other.withheld;
        self.filtered += other.filtered;
        self.outside += other.outside;
        self.lost += other.lost;
    }
}

/// A point cloud that is read part by part. Parts are independent: any thread may read any part, in any order, and
/// all parts together hold every point once.
pub trait PointSource: Send + Sync {
    /// Metadata.
    fn info(&self) -> &CloudInfo;

    /// Number of parts. Consecutive parts are close in their file.
    fn parts(&self) -> usize;

    /// Maximum points of a part, before filters.
    fn points_of(&self, part: usize) -> u64;

    /// Horizontal bounds of the points of a part; the heights are those of the cloud. `None` if no point of the part
    /// passes the filter.
    fn bounds_of(&self, _part: usize) -> Option<[Point; 2]> {
        self.info().bounds
    }

    /// Reads a part and passes on its filtered points with the selected attributes, in batches of at most [`BATCH`].
    /// Only the attributes selected and those that filters need are decoded.
    ///
    /// # Errors
    /// Damage that is not skipped, and errors of `each`.
    fn read(
        &self,
        part: usize,
        selection: &AttributeSelection,
        each: &mut PointConsumer<'_>,
    ) -> Result<ReturnCounts>;

    /// As [`read`](Self::read), with positions alone.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    fn positions(
        &self,
        part: usize,
        each: &mut dyn FnMut(&[Point]) -> Result<()>,
    ) -> Result<ReturnCounts> {
        self.read(part, &AttributeSelection::default(), &mut |batch| each(batch.positions))
    }

    /// A selection of these attributes for [`read`](Self::read), by the names of [`terrane_base::attribute`] or of
    /// extra bytes, and [`CLASS_FLAGS`](crate::CLASS_FLAGS).
    ///
    /// # Errors
    /// An attribute that the points of some file lack.
    fn select(&self, names: &[String]) -> Result<AttributeSelection> {
        match names {
            [] => Ok(AttributeSelection::default()),
            _ => Err(Error::unsupported(format!(
                "this point source has no attribute {}",
                names.join(", ")
            ))),
        }
    }

    /// The source files, by name.
    fn files(&self) -> &[String] {
        &[]
    }

    /// Index of the file of a part in [`PointSource::files`].
    fn file_of(&self, _part: usize) -> Option<usize> {
        None
    }

    /// Notes on oddities, one line each.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// Files with skipped damage so far, each with the number of lost points.
    fn losses(&self) -> Vec<(String, u64)> {
        Vec::new()
    }
}

/// Consumer of the batches of points.
pub type PointConsumer<'a> = dyn FnMut(PointBatch<'_>) -> Result<()> + 'a;
