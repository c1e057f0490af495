//! Fixed tiles with halos on which a spike-free surface is defined, and the number of points in the window of
//! each.
//!
//! Frozen triangles depend on those around them, so the surface is defined on tiles: in practice a change
//! reaches a few edges of frozen triangles, and a halo has twelve of them.

use std::collections::BTreeMap;
use std::sync::Mutex;

use super::lengths::MetricFrame;
use terrane_base::geom::{Point, REACH};
use terrane_delaunay::{FreezeRule, SiteWindow};
use terrane_files::lock;

/// Edges of frozen triangles along a halo.
const EDGES: f64 = 12.0;
/// Halos along a tile.
const HALOS: i32 = 6;
/// Default edge length in pulse spacings, and least length of a twelfth of a halo.
const SPACINGS: f64 = 3.0;
/// Width of the narrowest halo, in metres.
const NARROWEST: f64 = 1.0;
/// Steps along the widest halo: with its tile it is below 2^28.
const WIDEST: f64 = (1 << 24) as f64;

/// The tiles, counted from the offset of the point cloud.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpikeFreeTiles {
    pub(super) freeze: FreezeRule,
    /// Steps along a halo.
    halo: i32,
}

impl SpikeFreeTiles {
    /// For pulses `spacing` metres apart, with the freeze length in metres (`None` for three times the spacing)
    /// and the buffer.
    pub(super) fn new(
        spacing: f64,
        edge: Option<f64>,
        buffer: f64,
        MetricFrame { step, .. }: &MetricFrame,
    ) -> Self {
        let usual = SPACINGS * spacing;
        let freeze = FreezeRule { edge: edge.unwrap_or(usual), buffer, step: *step };
        let metres = (EDGES * freeze.edge.max(usual)).max(NARROWEST);
        let halo = (metres / step[0].min(step[1])).ceil().clamp(1.0, WIDEST) as i32;
        Self { freeze, halo }
    }

    fn side(&self) -> i32 {
        HALOS * self.halo
    }

    /// Steps around a position that contain the window of its tile.
    pub(super) fn reach(&self) -> i32 {
        self.side() + self.halo
    }

    /// The tile of a coordinate, along its axis.
    pub(super) fn along(&self, at: i32) -> i32 {
        at.div_euclid(self.side())
    }

    /// The window of a tile, halo included.
    pub(super) fn window(&self, square: [i32; 2]) -> SiteWindow {
        let [side, halo] = [self.side(), self.halo].map(i64::from);
        let low = square.map(|at| i64::from(at) * side - halo);
        let high = low.map(|v| v + side + 2 * halo - 1);
        let [low, high] =
            [low, high].map(|end| end.map(|v| v.clamp(-i64::from(REACH), i64::from(REACH)) as i32));
        SiteWindow { low, high }
    }

    /// The first and the last tile along both axes whose windows contain a point.
    fn tiles_around(&self, p: &Point) -> [[i32; 2]; 2] {
        [p.x, p.y].map(|v| [v - self.halo, v + self.halo].map(|end| self.along(end)))
    }
}

/// Number of points in the window of each tile.
#[derive(Debug)]
pub(super) struct SpikeFreeTally {
    pub(super) squares: SpikeFreeTiles,
    counts: Mutex<BTreeMap<[i32; 2], u64>>,
}

impl SpikeFreeTally {
    pub(super) fn new(squares: SpikeFreeTiles) -> Self {
        Self { squares, counts: Mutex::default() }
    }

    /// Counts points.
    pub(super) fn take(&self, points: &[Point]) {
        let mut batch = BTreeMap::<[i32; 2], u64>::new();
        let squares = &self.squares;
        for run in points.chunk_by(|a, b| squares.tiles_around(a) == squares.tiles_around(b)) {
            let [xs, ys] = squares.tiles_around(&run[0]).map(|[first, last]| first..=last);
            for square in ys.flat_map(|y| xs.clone().map(move |x| [x, y])) {
                *batch.entry(square).or_default() += run.len() as u64;
            }
        }
        let mut counts = lock(&self.counts);
        batch.into_iter().for_each(|(square, count)| *counts.entry(square).or_default() += count);
    }

    /// The tiles with points in their windows, with their number.
    pub(super) fn counts(self) -> BTreeMap<[i32; 2], u64> {
        self.counts.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const METRES: MetricFrame = MetricFrame { step: [0.01, 0.02, 0.01], is_guess: false };

    #[test]
    fn a_halo_has_twelve_edges_and_fits() {
        let of = |spacing, edge| SpikeFreeTiles::new(spacing, edge, 0.5, &METRES);
        assert_eq!((of(0.5, None).freeze.edge, of(0.5, None).halo), (1.5, 1800));
        assert_eq!((of(0.5, Some(4.0)).freeze.edge, of(0.5, Some(4.0)).halo), (4.0, 4800));
        assert_eq!((of(0.5, Some(0.0)).freeze.edge, of(0.5, Some(0.0)).halo), (0.0, 1800));
        assert_eq!((of(0.0, None).halo, of(1e9, None).halo), (100, 1 << 24));
        let SiteWindow { low, high } = of(1e9, None).window([0, -1]);
        assert!((0..2).all(|i| i64::from(high[i]) - i64::from(low[i]) < (1 << 28) - 1));
    }

    #[test]
    fn each_square_is_told_of_all_that_it_sees() {
        let tally = SpikeFreeTally::new(SpikeFreeTiles::new(0.0, Some(0.0), 0.5, &METRES));
        let squares = tally.squares;
        let place = |k: i32| Point::new(k * 7919 % 4000 - 2000, k * 104_729 % 5000 - 2500, k);
        let points: Vec<Point> = (0..900).map(place).collect();
        points.chunks(130).for_each(|batch| tally.take(batch));
        let counts = tally.counts();
        assert!(counts.len() > 20);
        for (square, count) in counts {
            let window = squares.window(square);
            let seen = points.iter().filter(|p| window.contains([p.x, p.y])).count() as u64;
            assert_eq!(seen, count, "{square:?}");
        }
    }
}
