//! Ground classification of a point cloud without classes, tile by tile.
//!
//! The lowest points of a tile are read from the store with the halo of the method. The halo of pmf is
//! its reach, so its ground is exactly that of the whole point cloud for any tile size. The others have tiles
//! of a fixed size, from the origin of coordinates on, which are part of their definition.

use std::collections::BTreeSet;

use super::lengths::MetricFrame;
use crate::point_index::{PointStore, TileSummary, Tiling};
use terrane_base::error::Result;
use terrane_base::geom::{Point, REACH};
use terrane_base::rounding::floored;
use terrane_delaunay::SiteWindow;
use terrane_engine::{Cancel, Progress, workers};
use terrane_ground::{GroundSurface, GroundTiling, LowestPoints, NO_POINT, Request};

/// Part of the memory of a search for tiles, if a method works in tiles of any size.
const ANY_SHARE: u64 = 2;
/// Most of it for tiles of a fixed size, beyond the first one.
const FIXED_SHARE: [u64; 2] = [3, 4];
/// Fewest and most cells along a tile.
const SIDES: [i64; 2] = [64, 1024];

/// Memory of a search for the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GroundSearchMemory {
    /// Bytes for the tiles of all threads.
    pub(crate) tiles: u64,
    /// Bytes for each store of points.
    pub(crate) store: u64,
}

impl GroundSearchMemory {
    /// Divides `memory` among the tiles of up to `threads` threads, of `tile` bytes each (0 for tiles of any size),
    /// and `stores` stores. Tiles come first: points can be spilled, tiles cannot.
    pub(crate) fn divide(memory: u64, stores: u64, tile: u64, threads: usize) -> Self {
        let [part, parts] = FIXED_SHARE;
        let tiles = match tile {
            0 => memory / ANY_SHARE,
            _ => tile * (memory / parts * part / tile).clamp(1, threads.max(1) as u64),
        };
        Self { tiles, store: memory.saturating_sub(tiles) / stores }
    }

    /// Least memory for a tile of this size.
    pub(crate) fn least(tile: u64) -> u64 {
        let [part, parts] = FIXED_SHARE;
        tile.div_ceil(part).saturating_mul(parts)
    }
}

/// A ground method with its candidate points.
pub(crate) struct GroundFilter<'a> {
    /// Candidate points.
    candidates: Vec<&'a PointStore>,
    /// Other points that may lie on the ground.
    others: Option<&'a PointStore>,
    method: Request,
    ground_tiling: GroundTiling,
    /// Metres to a step.
    step: [f64; 3],
    /// Steps along a cell, in x and y.
    cell: [f64; 2],
    /// Cells along a tile, without its halo.
    side: i64,
    /// Threads whose tiles fit into memory; at least one.
    threads: usize,
    /// Window of the search, if not everywhere.
    within: Option<SiteWindow>,
}

/// Cells from the first to before the end, in x and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct GroundCellRange {
    low: [i64; 2],
    end: [i64; 2],
}

impl GroundCellRange {
    fn width(&self) -> usize {
        (self.end[0] - self.low[0]) as usize
    }

    fn count(&self) -> usize {
        self.width() * (self.end[1] - self.low[1]) as usize
    }

    fn grown(&self, margin: i64) -> Self {
        Self { low: self.low.map(|v| v - margin), end: self.end.map(|v| v + margin) }
    }

    /// The intersection with `other`, which must not be empty.
    fn within(&self, other: &Self) -> Self {
        Self {
            low: [0, 1].map(|i| self.low[i].max(other.low[i])),
            end: [0, 1].map(|i| self.end[i].min(other.end[i])),
        }
    }

    /// Their window, for cells of this number of steps a side, with a step more.
    fn window(&self, cell: [f64; 2]) -> SiteWindow {
        let low = [0, 1].map(|i| (self.low[i] as f64 * cell[i]).floor() - 1.0);
        let high = [0, 1].map(|i| (self.end[i] as f64 * cell[i]).ceil() + 1.0);
        let [low, high] =
            [low, high].map(|end| end.map(|v| v.clamp(f64::from(-REACH), f64::from(REACH)) as i32));
        SiteWindow { low, high }
    }

    /// The column and row of a cell, if it is one of these.
    fn place(&self, cell: [i64; 2]) -> Option<[usize; 2]> {
        let inside = (0..2).all(|i| (self.low[i]..self.end[i]).contains(&cell[i]));
        inside.then(|| [0, 1].map(|i| (cell[i] - self.low[i]) as usize))
    }
}

impl<'a> GroundFilter<'a> {
    /// For all points, on `threads` threads whose tiles take about `memory` bytes together, or on fewer.
    pub(crate) fn new(
        candidates: Vec<&'a PointStore>,
        metres: &MetricFrame,
        method: Request,
        memory: u64,
        threads: usize,
    ) -> Self {
        let ground_tiling = method.tiling(spacing(&candidates, metres));
        Self::on(ground_tiling, candidates, metres, method, memory, threads)
    }

    fn on(
        ground_tiling: GroundTiling,
        candidates: Vec<&'a PointStore>,
        metres: &MetricFrame,
        method: Request,
        memory: u64,
        threads: usize,
    ) -> Self {
        let step = metres.step;
        let cell = cell(&ground_tiling, metres);
        let (others, within) = (None, None);
        let side = ground_tiling.core.unwrap_or_default() as i64;
        let filter =
            Self { candidates, others, method, ground_tiling, step, cell, side, threads, within };
        match ground_tiling.core {
            Some(_) => Self { threads: filter.fitting(memory), ..filter },
            None => {
                let most = memory / method.bytes_per_cell();
                let (threads, side) = best_tiling(most, threads, ground_tiling.halo as i64);
                Self { threads, side, ..filter }
            }
        }
    }

    /// Number of threads whose tiles fit into memory; at least one.
    fn fitting(&self, memory: u64) -> usize {
        let all = self.all();
        let extent = [0, 1].map(|i| (all.end[i] - all.low[i]) as f64 * self.ground_tiling.cell);
        match bytes_of(&self.method, self.ground_tiling, extent) {
            0 => self.threads,
            tile => (memory / tile).clamp(1, self.threads as u64) as usize,
        }
    }

    /// For the ground in a `window` of a point cloud with this `spacing` in metres; the candidates must include
    /// all points [around](around) it.
    pub(crate) fn within(
        window: SiteWindow,
        spacing: f64,
        candidates: Vec<&'a PointStore>,
        metres: &MetricFrame,
        method: Request,
        memory: u64,
        threads: usize,
    ) -> Self {
        let of = Self::on(method.tiling(spacing), candidates, metres, method, memory, threads);
        Self { within: Some(window), ..of }
    }

    /// Also classifies other points on the ground, without making them candidates.
    pub(crate) fn and(self, others: &'a PointStore) -> Self {
        let is_new = self.candidates.iter().all(|store| !std::ptr::eq(*store, others));
        Self { others: is_new.then_some(others), ..self }
    }

    /// The tiling of all its points.
    fn tiling(&self) -> &'a Tiling {
        self.candidates[0].tiling()
    }

    /// Whether a point is in the window of the search.
    fn accepts(&self, point: &Point) -> bool {
        self.within.is_none_or(|window| window.contains([point.x, point.y]))
    }

    /// Adds the ground points to `into`.
    pub(crate) fn run(
        &self,
        into: &PointStore,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<()> {
        let tiles = self.tiles()?;
        progress.begin("ground", tiles.len() as u64);
        workers::run(
            self.threads,
            tiles.len() as u64,
            cancel,
            || (),
            |(), tile| {
                self.filter_tile(self.core(tiles[tile as usize]), into)?;
                progress.advance(1);
                Ok(())
            },
            Ok,
        )?;
        progress.end();
        Ok(())
    }

    /// The cell that holds a point, and where in it.
    fn locate(&self, point: &Point) -> ([i64; 2], [f64; 2]) {
        let at = [f64::from(point.x) / self.cell[0], f64::from(point.y) / self.cell[1]];
        let cell = at.map(floored);
        (cell, [0, 1].map(|i| at[i] - cell[i] as f64))
    }

    /// The tile of a cell.
    fn tile_of(&self, cell: [i64; 2]) -> [i64; 2] {
        cell.map(|cell| cell.div_euclid(self.side))
    }

    /// The cells that the point cloud touches; all others are empty.
    fn all(&self) -> GroundCellRange {
        let SiteWindow { low, high } = self.tiling().window();
        let [low, last] = [low, high].map(|[x, y]| self.locate(&Point::new(x, y, 0)).0);
        GroundCellRange { low, end: last.map(|last| last + 1) }
    }

    /// The tiles with points, which may be few in a sparse point cloud.
    fn tiles(&self) -> Result<Vec<[i64; 2]>> {
        let mut tiles = BTreeSet::new();
        let tile_at = |[x, y]: [i32; 2]| self.tile_of(self.locate(&Point::new(x, y, 0)).0);
        for square in 0..self.tiling().count() {
            for store in &self.candidates {
                let Some(TileSummary { window, .. }) = store.summary(square) else { continue };
                let corners = [window.low, window.high];
                // Points need not be read where they all lie in one tile.
                if tile_at(corners[0]) == tile_at(corners[1])
                    && corners.iter().all(|[x, y]| self.accepts(&Point::new(*x, *y, 0)))
                {
                    tiles.insert(tile_at(corners[0]));
                    continue;
                }
                let mut last = None;
                store.visit(square, |run| {
                    for point in run.iter().filter(|point| self.accepts(point)) {
                        let tile = self.tile_of(self.locate(point).0);
                        if last.replace(tile) != Some(tile) {
                            tiles.insert(tile);
                        }
                    }
                })?;
            }
        }
        Ok(tiles.into_iter().collect())
    }

    /// The cells of a tile.
    fn core(&self, tile: [i64; 2]) -> GroundCellRange {
        let low = tile.map(|at| at * self.side);
        GroundCellRange { low, end: low.map(|at| at + self.side) }
    }

    /// The tiles of the store that cells touch.
    fn squares(&self, cells: &GroundCellRange) -> impl Iterator<Item = usize> + use<> {
        self.tiling().touching(cells.window(self.cell))
    }

    /// Adds the ground points of a tile.
    fn filter_tile(&self, core: GroundCellRange, into: &PointStore) -> Result<()> {
        let reach = self.ground_tiling.halo as i64;
        let wide = self.all().within(&core.grown(reach));
        let surface = self.method.find(&LowestPoints {
            points: &self.lows(&wide)?,
            width: wide.width(),
            cell: self.ground_tiling.cell,
            corner: [0, 1].map(|i| wide.low[i] as f64 * self.cell[i]),
            step: self.step,
        });
        let mut ground = Vec::new();
        let all: Vec<_> = self.candidates.iter().copied().chain(self.others).collect();
        for square in self.squares(&core) {
            ground.clear();
            visit(&all, square, |run| {
                let accepted = run.iter().filter(|p| self.accepts(p));
                ground.extend(accepted.filter(|p| self.is_ground(p, &core, &wide, &surface)));
            })?;
            into.add(&ground)?;
        }
        Ok(())
    }

    /// The lowest point in each of these cells; of several the first by x and y.
    fn lows(&self, cells: &GroundCellRange) -> Result<Vec<Point>> {
        let (mut lows, width) = (vec![NO_POINT; cells.count()], cells.width());
        for square in self.squares(cells) {
            visit(&self.candidates, square, |run| {
                for point in run {
                    if let Some([col, row]) = cells.place(self.locate(point).0) {
                        let low = &mut lows[row * width + col];
                        if (point.z, point.x, point.y) < (low.z, low.x, low.y) {
                            *low = *point;
                        }
                    }
                }
            })?;
        }
        Ok(lows)
    }

    /// Whether a point lies in the core and is ground by the surface of the cells around it.
    fn is_ground(
        &self,
        point: &Point,
        core: &GroundCellRange,
        wide: &GroundCellRange,
        surface: &GroundSurface,
    ) -> bool {
        let (cell, place) = self.locate(point);
        core.place(cell).is_some()
            && wide
                .place(cell)
                .is_some_and(|[col, row]| surface.is_ground(col, row, place, point.z))
    }
}

/// Threads and cells along a tile that find the ground of most cells in a time, for at most `most` cells in the tiles of
/// all threads, halos included. Each thread computes the halo of its own tile.
fn best_tiling(most: u64, threads: usize, halo: i64) -> (usize, i64) {
    let side = |threads: usize| {
        let wide = (most / threads as u64).isqrt() as i64;
        (wide - 2 * halo).clamp(SIDES[0], SIDES[1])
    };
    let speed = |threads: usize| {
        let side = side(threads) as f64;
        let wide = side + 2.0 * halo as f64;
        let fits = threads == 1 || wide * wide * threads as f64 <= most as f64;
        if fits { threads as f64 * (side / wide).powi(2) } else { 0.0 }
    };
    let best = (1..=threads).max_by(|a, b| speed(*a).total_cmp(&speed(*b))).unwrap_or(1);
    (best, side(best))
}

/// Reads the points of a tile of some stores.
fn visit(stores: &[&PointStore], square: usize, mut each: impl FnMut(&[Point])) -> Result<()> {
    stores.iter().try_for_each(|store| store.visit(square, &mut each))
}

/// Steps along a cell, in x and y.
fn cell(ground_tiling: &GroundTiling, metres: &MetricFrame) -> [f64; 2] {
    [0, 1].map(|i| ground_tiling.cell / metres.step[i])
}

/// The window of all points that decide which points of a window are ground, for points `spacing` metres apart.
pub(crate) fn around(
    method: &Request,
    metres: &MetricFrame,
    spacing: f64,
    window: SiteWindow,
) -> SiteWindow {
    let ground_tiling = method.tiling(spacing);
    let (cell, side) = (cell(&ground_tiling, metres), ground_tiling.core.unwrap_or(1) as i64);
    let [first, last] = [window.low, window.high]
        .map(|end| [0, 1].map(|i| ((f64::from(end[i]) / cell[i]).floor() as i64).div_euclid(side)));
    let (low, end) = (first.map(|tile| tile * side), last.map(|tile| (tile + 1) * side));
    GroundCellRange { low, end }.grown(ground_tiling.halo as i64).window(cell)
}

/// Bytes of a tile of a method with fixed tiles, for a point cloud of this width and height in metres and any
/// density; 0 for a method with tiles of any size.
pub(crate) fn square_bytes(method: &Request, extent: [f64; 2]) -> u64 {
    bytes_of(method, method.tiling(0.0), extent)
}

fn bytes_of(method: &Request, ground_tiling: GroundTiling, extent: [f64; 2]) -> u64 {
    let max_side = ground_tiling.core.map_or(0, |core| core + 2 * ground_tiling.halo) as u64;
    let cells =
        extent.map(|metres| ((metres / ground_tiling.cell).ceil() as u64).saturating_add(2));
    cells.map(|cells| cells.min(max_side)).iter().product::<u64>() * method.bytes_per_cell()
}

/// Approximate point spacing of all stores in metres, from the tiles with points.
pub(super) fn spacing(stores: &[&PointStore], metres: &MetricFrame) -> f64 {
    let (mut count, mut steps) = (0, 0.0);
    for square in 0..stores[0].tiling().count() {
        let all = stores.iter().filter_map(|store| store.summary(square));
        let Some(TileSummary { window, count: points, .. }) = all.reduce(TileSummary::merged)
        else {
            continue;
        };
        let [x, y] = [0, 1].map(|i| f64::from(window.high[i].abs_diff(window.low[i])));
        count += points;
        steps += x * y;
    }
    (steps * metres.step[0] * metres.step[1] / (count.max(1) as f64)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_engine::{Resources, Silent};

    /// A slope with houses and holes, in centimetres: where a halo that is too small shows.
    fn store(folder: &std::path::Path) -> PointStore {
        let height = |x: i32, y: i32| {
            // None at the border, where nothing tells a house from a step of the terrain.
            let inside = (-8000..7000).contains(&x) && (1000..15_000).contains(&y);
            let house = inside && x.rem_euclid(4100) < 1800 && y.rem_euclid(3700) < 1500;
            x / 20 - y / 30 + if house { 600 } else { 0 }
        };
        let places = (0..260 * 210).map(|k| (k % 260 * 70 + k % 7 - 9000, k / 260 * 80 + k % 11));
        let dry = places
            .filter(|(x, y): &(i32, i32)| (x - 3000).pow(2) + (y - 9000).pow(2) > 2500 * 2500);
        let points: Vec<Point> = dry.map(|(x, y)| Point::new(x, y, height(x, y))).collect();
        let corners = [Point::new(-9000, 0, 0), Point::new(9200, 16_800, 0)];
        let store = PointStore::empty(Tiling::new(corners, 200_000), folder, 100_000);
        store.add(&points).unwrap();
        store
    }

    fn found(candidates: &PointStore, method: Request, memory: u64, threads: usize) -> Vec<Point> {
        let folder = Resources::default().temp_dir.unwrap_or_else(std::env::temp_dir);
        let into = PointStore::empty(*candidates.tiling(), &folder, 1 << 24);
        let metres = MetricFrame { step: [0.01; 3], is_guess: false };
        let filter = GroundFilter::new(vec![candidates], &metres, method, memory, threads);
        assert!(memory > 0 || method != Request::PMF || filter.tiles().unwrap().len() > 8);
        filter.run(&into, &Silent, &Cancel::default()).unwrap();
        let (mut all, mut points) = (Vec::new(), Vec::new());
        for square in 0..into.tiling().count() {
            into.load(square, &mut points).unwrap();
            all.extend_from_slice(&points);
        }
        all
    }

    /// More threads never find fewer cells.
    #[test]
    fn a_thread_more_is_not_slower() {
        let speed = |(threads, side): (usize, i64), halo: i64| {
            threads as f64 * (side as f64 / (side + 2 * halo) as f64).powi(2)
        };
        for (most, halo) in [(10_000, 300), (800_000, 280), (3_000_000, 280), (1 << 32, 30)] {
            let speeds: Vec<f64> =
                (1..9).map(|n| speed(best_tiling(most, n, halo), halo)).collect();
            assert!(speeds.is_sorted(), "{most} {halo}: {speeds:?}");
        }
        // A tile of 64 cells would find a hundredth of the cells that it computes.
        assert_eq!(best_tiling(800_000, 2, 280), (1, 334));
        assert_eq!(best_tiling(1 << 32, 8, 30), (8, 1024));
    }

    #[test]
    fn tiles_find_the_ground_of_the_whole() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path());
        let found = |memory, threads| found(&store, Request::PMF, memory, threads);
        let (tiled, whole) = (found(0, 3), found(1 << 30, 1));
        assert_eq!(tiled, whole);
        let plane = |p: &Point| f64::from(p.x) / 20.0 - f64::from(p.y) / 30.0;
        assert!(whole.iter().all(|p| (f64::from(p.z) - plane(p)).abs() < 100.0), "houses are off");
        assert!(whole.len() > 35_000, "{}", whole.len());
    }

    #[test]
    fn every_method_finds_the_same_whatever_the_memory_and_the_threads() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path());
        let plane = |p: &Point| f64::from(p.x) / 20.0 - f64::from(p.y) / 30.0;
        for method in terrane_ground::METHODS {
            let found = |memory, threads| found(&store, Request::plain(method), memory, threads);
            let whole = found(1 << 30, 1);
            assert_eq!(found(0, 3), whole, "{}", method.name);
            let off = whole.iter().filter(|p| (f64::from(p.z) - plane(p)).abs() > 100.0).count();
            assert!(off == 0 && whole.len() > 30_000, "{}: {off} {}", method.name, whole.len());
        }
    }

    #[test]
    fn tiles_and_stores_fit_into_the_memory() {
        for (tile, stores) in [(0, 2), (1 << 20, 2), (94_371_840, 2), (94_371_840, 4)] {
            let least = GroundSearchMemory::least(tile);
            for memory in [least, least + 1, 2 * least, 5 * least, 1 << 29, 1 << 34] {
                for threads in [1, 2, 64] {
                    let shares = GroundSearchMemory::divide(memory, stores, tile, threads);
                    assert!(shares.tiles + stores * shares.store <= memory, "{memory} {shares:?}");
                    assert!(
                        shares.tiles >= tile && (tile == 0 || shares.tiles.is_multiple_of(tile))
                    );
                }
            }
        }
        // Tiles of 768 by 768 cells on two threads in half a GiB, with what workers and the program leave.
        let shares = GroundSearchMemory::divide(380 << 20, 2, 768 * 768 * 168, 2);
        assert_eq!(shares.tiles, 2 * 768 * 768 * 168);
    }

    #[test]
    fn cells_of_points_are_the_lower_ones() {
        for v in [-3.0, -2.5, -0.0, 0.0, 0.99, 7.0, 7.5, -1e15 - 0.5, 1e15 + 0.5] {
            assert_eq!(floored(v), v.floor() as i64, "{v}");
        }
    }

    #[test]
    fn spacing_is_that_of_the_places_with_points() {
        let folder = tempfile::tempdir().unwrap();
        let metres = MetricFrame { step: [0.01; 3], is_guess: false };
        let found = spacing(&[&store(folder.path())], &metres);
        assert!((0.6..0.8).contains(&found), "{found}");
    }
}
