//! Accumulators of the cells of a block: one kind to a plane.

use std::any::Any;
use std::fmt::Debug;

use bytemuck::{Pod, Zeroable};

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point;

/// Points and the cells they go into.
#[derive(Clone, Copy, Debug)]
pub struct CellHits<'a> {
    /// Indices of the cells in the block.
    pub cells: &'a [u32],
    /// The points, one for each cell, with a value in place of their height where the subject is another.
    pub points: &'a [Point],
    /// Their squared distances from the centres of the cells, in units; empty if not needed.
    pub squares: &'a [u128],
    /// World size of the unit.
    pub unit: f64,
    /// Real values, indexed by the heights of the points.
    pub reals: &'a [f64],
}

/// An accumulator of the points of one cell: integer sums or extremes, so that the order of points does not
/// matter.
pub(super) trait CellAccumulator: Pod + Debug + Send {
    /// Whether distances from the centre count.
    const BY_DISTANCE: bool = false;
    /// The accumulator of no point.
    const NONE: Self;

    /// Adds a point at squared distance `square` from the centre; false on overflow.
    #[must_use]
    fn take(&mut self, point: &Point, square: u128) -> bool;

    /// Merges another accumulator; false on overflow.
    #[must_use]
    fn join(&mut self, other: Self) -> bool;
}

/// One kind of number for each cell of a block.
pub(super) trait AccumulatorPlane: Any + Debug + Send {
    /// Adds points.
    fn add(&mut self, hits: CellHits<'_>) -> Result<()>;

    /// Merges another plane of the same cells and kind.
    fn fold(&mut self, other: &dyn AccumulatorPlane) -> Result<()>;

    /// Its content as bytes, for this machine.
    fn bytes(&self) -> &[u8];

    /// Its content as mutable bytes, resized to `bytes`.
    fn bytes_mut(&mut self, bytes: usize) -> &mut [u8];

    /// Bytes in memory.
    fn memory_use(&self) -> usize {
        self.bytes().len()
    }

    /// Sorts values of single points, cell by cell.
    fn settle(&mut self) {}
}

/// An accumulator for each cell.
#[derive(Clone, Debug)]
pub(super) struct DensePlane<K>(pub(super) Vec<K>);

impl<K: CellAccumulator> DensePlane<K> {
    pub(super) fn new(cells: usize) -> Self {
        Self(vec![K::NONE; cells])
    }

    fn checked(fits: bool) -> Result<()> {
        match fits {
            true => Ok(()),
            false => Err(Error::limit("number of points in one cell", "above 2^32", u32::MAX)
                .remedy("reduce ‹cell›")),
        }
    }
}

impl<K: CellAccumulator> AccumulatorPlane for DensePlane<K> {
    fn add(&mut self, hits: CellHits<'_>) -> Result<()> {
        let each = hits.cells.iter().zip(hits.points);
        let mut fit = true;
        if K::BY_DISTANCE {
            each.zip(hits.squares).for_each(|((cell, point), square)| {
                fit &= self.0[*cell as usize].take(point, *square);
            });
        } else {
            each.for_each(|(cell, point)| fit &= self.0[*cell as usize].take(point, 0));
        }
        Self::checked(fit)
    }

    fn fold(&mut self, other: &dyn AccumulatorPlane) -> Result<()> {
        let pairs = self.0.iter_mut().zip(&like::<Self>(other)?.0);
        Self::checked(pairs.fold(true, |fit, (own, other)| own.join(*other) & fit))
    }

    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }

    fn bytes_mut(&mut self, _: usize) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.0)
    }
}

/// A plane as one of the kind `P`.
pub(super) fn like<P: AccumulatorPlane>(plane: &dyn AccumulatorPlane) -> Result<&P> {
    let plane: &dyn Any = plane;
    plane
        .downcast_ref()
        .ok_or_else(|| Error::new(ErrorKind::Internal, "two blocks have different statistics"))
}

/// A kind of plane. Planes of the same name and parameters are shared.
#[derive(Clone, Copy, Debug)]
pub(super) struct AccumulatorKind {
    pub(super) name: &'static str,
    /// Parameters of the plane.
    pub(super) parameters: [f64; 2],
    pub(super) make: fn(usize, [f64; 2]) -> Box<dyn AccumulatorPlane>,
    pub(super) bytes_per_cell: usize,
    pub(super) bytes_per_point: usize,
}

impl PartialEq for AccumulatorKind {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.parameters == other.parameters
    }
}

impl AccumulatorKind {
    /// A `K` for each cell.
    pub(super) const fn cells<K: CellAccumulator>(name: &'static str) -> Self {
        Self {
            name,
            parameters: [0.0; 2],
            make: |cells, _| Box::new(DensePlane::<K>::new(cells)),
            bytes_per_cell: size_of::<K>(),
            bytes_per_point: 0,
        }
    }
}

/// Number of points.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PointCount(pub(super) u32);

impl PointCount {
    pub(super) const KIND: AccumulatorKind = AccumulatorKind::cells::<Self>("count");
}

impl CellAccumulator for PointCount {
    const NONE: Self = Self(0);

    #[inline(always)]
    fn take(&mut self, _: &Point, _: u128) -> bool {
        let (next, over) = self.0.overflowing_add(1);
        self.0 = next;
        !over
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        let (next, over) = self.0.overflowing_add(other.0);
        self.0 = next;
        !over
    }
}
