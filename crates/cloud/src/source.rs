//! Sources of points: files, mosaics of files, points in memory, synthetic clouds.

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point, PointFrame};

/// Most points of a batch.
pub const BATCH: usize = 1 << 16;

/// What a cloud is, before any point is read.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudInfo {
    /// Where the points lie.
    pub frame: PointFrame,
    /// Lowest and highest coordinates that the headers claim, cut to the box and heights asked for;
    /// every point handed on lies within. `None` where no point can be.
    pub bounds: Option<[Point; 2]>,
    /// Points that the headers claim, of the parts that may touch the box asked for.
    pub count: u64,
    /// The coordinate reference system, as far as known.
    pub crs: Crs,
}

/// What became of the points that were read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCensus {
    /// Points that the files hold, those lost among them.
    pub read: u64,
    /// Points handed on.
    pub kept: u64,
    /// Points left out because they are marked as withheld.
    pub withheld: u64,
    /// Points left out by a filter that was asked for.
    pub filtered: u64,
    /// Points given up because they lie outside the bounds their file claims.
    pub outside: u64,
    /// Points given up because they cannot be read.
    pub lost: u64,
}

impl PointCensus {
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

/// A cloud that is read part by part. Parts are independent: any thread may read any part, in any
/// order, and all parts together hold every point once.
pub trait PointSource: Send + Sync {
    /// What the cloud is.
    fn info(&self) -> &CloudInfo;

    /// How many parts there are. Neighbours in the order of parts are near each other in their file.
    fn parts(&self) -> usize;

    /// Points that part `part` holds, at most, before filters.
    fn points_of(&self, part: usize) -> u64;

    /// Lowest and highest coordinates that points of a part may have across; heights are those of the
    /// cloud. `None` where the part has no point that is wanted.
    fn bounds_of(&self, _part: usize) -> Option<[Point; 2]> {
        self.info().bounds
    }

    /// Reads a part and hands on its filtered points in batches of at most [`BATCH`].
    ///
    /// # Errors
    /// Damage that the source was not told to pass over, and whatever `each` returns.
    fn read(
        &self,
        part: usize,
        each: &mut dyn FnMut(&[Point]) -> Result<()>,
    ) -> Result<PointCensus>;

    /// A way to read it with these attributes, by the names of [`terrane_base::attribute`] or of extra bytes.
    ///
    /// # Errors
    /// An attribute that its points, or those of one of its files, do not have.
    fn columns(&self, names: &[String]) -> Result<Box<dyn AttributeSource + '_>> {
        let names = names.join(", ");
        Err(Error::unsupported(format!("this point source has no attribute {names}")))
    }

    /// The files behind it, by name.
    fn files(&self) -> &[String] {
        &[]
    }

    /// Which of [`PointSource::files`] part `part` is of.
    fn file_of(&self, _part: usize) -> Option<usize> {
        None
    }

    /// What is odd about it, or easily overlooked, one line each.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// The files that damage was passed over in so far, each with the points that are lost.
    fn losses(&self) -> Vec<(String, u64)> {
        Vec::new()
    }
}

/// Reads points together with some of their attributes.
pub trait AttributeSource: Send + Sync {
    /// Reads a part and hands on its filtered points, at most [`BATCH`] at a time, with a column for
    /// each attribute; NaN where a point has no value.
    ///
    /// # Errors
    /// As for [`PointSource::read`].
    fn read(&self, part: usize, each: &mut Each<'_>) -> Result<PointCensus>;
}

/// What takes points with their columns.
pub type Each<'a> = dyn FnMut(&[Point], &[Vec<f64>]) -> Result<()> + 'a;
