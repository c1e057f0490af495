//! Partially loaded points of a cloud: their positions, empty regions, and regions to load.

use super::disc::CircumscribedDisc;
use super::point_bins::PointBins;
use super::predicates::Site;
use super::window::SiteWindow;
use terrane_base::geom::Point;

/// Points of this window must be known before the answer is final. It may be much larger than what
/// turns out to be needed (the circle shrinks with every point found), so load what lies in it *and*
/// in a window somewhat larger than the one known, and ask again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NeededWindow(pub SiteWindow);

/// A partially loaded point cloud. Every method returns points in runs; a run may include points that were not
/// requested.
pub trait PointIndex {
    /// A length that holds a few points where the cloud is dense; at least 1.
    fn pitch(&self) -> i32;

    /// Hands out all known points in the window.
    fn visit(&self, window: &SiteWindow, each: impl FnMut(&[Point]));

    /// Hands out all known points in both the window and the disc.
    fn visit_disc(&self, disc: &CircumscribedDisc, window: &SiteWindow, each: impl FnMut(&[Point]));

    /// Bounds of the known points; nothing is handed out beyond.
    fn extent(&self) -> SiteWindow;

    /// True if every point of the cloud in the disc is known.
    ///
    /// # Errors
    /// The region to load.
    fn certify(&self, disc: &CircumscribedDisc) -> Result<(), NeededWindow>;
}

/// Coarse occupancy of a cloud: cells that contain at least one point.
#[derive(Clone, Debug)]
pub struct OccupancyGrid {
    window: SiteWindow,
    size: i32,
    columns: usize,
    holds: Vec<bool>,
}

/// Maximum number of cells of an [`OccupancyGrid`].
const MAX_CELLS: usize = 1 << 24;

impl OccupancyGrid {
    /// An empty map of `window` in squares of `size` steps, or larger ones where those would be more
    /// than 2^24.
    pub fn new(window: SiteWindow, size: i32) -> Self {
        let lengths = [0, 1].map(|axis| i64::from(window.high[axis]) - i64::from(window.low[axis]));
        let mut size = size.max(1);
        loop {
            let [columns, rows] = lengths.map(|length| (length / i64::from(size)) as usize + 1);
            if columns * rows <= MAX_CELLS {
                return Self { window, size, columns, holds: vec![false; columns * rows] };
            }
            size = size.saturating_mul(2);
        }
    }

    /// Notes that there is a point at `p`, which lies in the window.
    pub fn add(&mut self, p: Site) {
        let [column, row] = self.cell(p);
        self.holds[row * self.columns + column] = true;
    }

    /// Notes the points of a map of the same window and size.
    pub fn merge(&mut self, other: &Self) {
        self.holds.iter_mut().zip(&other.holds).for_each(|(here, there)| *here |= there);
    }

    fn cell(&self, p: Site) -> [usize; 2] {
        [0, 1].map(|i| ((p[i] - self.window.low[i]) / self.size) as usize)
    }

    /// The smallest window of occupied cells that touch the disc and do not lie in `known`.
    fn unknown(&self, disc: &CircumscribedDisc, known: &SiteWindow) -> Option<SiteWindow> {
        let clipped = disc.clip(&self.window)?;
        let rows = self.cell(clipped.low)[1]..=self.cell(clipped.high)[1];
        let mut unknown: Option<SiteWindow> = None;
        for row in rows {
            for cell in self.row_cells(disc, row).filter(|cell| !known.covers(cell)) {
                unknown = Some(unknown.map_or(cell, |all| all.union(&cell)));
            }
        }
        unknown
    }

    /// The occupied cells of a row that touch the disc.
    fn row_cells(&self, disc: &CircumscribedDisc, row: usize) -> impl Iterator<Item = SiteWindow> {
        let low = self.window.low[1] + row as i32 * self.size;
        let strip = SiteWindow {
            low: [self.window.low[0], low],
            high: [self.window.high[0], low.saturating_add(self.size - 1).min(self.window.high[1])],
        };
        let clipped = disc.clip(&strip);
        let columns = clipped.map(|clipped| self.cell(clipped.low)[0]..=self.cell(clipped.high)[0]);
        let columns = columns.into_iter().flatten();
        columns.filter(move |column| self.holds[row * self.columns + column]).map(move |column| {
            let left = strip.low[0] + column as i32 * self.size;
            let right = left.saturating_add(self.size - 1).min(strip.high[0]);
            SiteWindow { low: [left, strip.low[1]], high: [right, strip.high[1]] }
        })
    }
}

/// The usual space: every point of the cloud in one window is in the bins, and where the others can
/// be is known coarsely.
#[derive(Clone, Copy, Debug)]
pub struct LoadedPoints<'a> {
    /// The points, and maybe others.
    pub bins: &'a PointBins,
    /// All points in here are in the bins.
    pub known: SiteWindow,
    /// No point lies outside.
    pub bounds: SiteWindow,
    /// Occupancy within the bounds, if known; it covers the bounds.
    pub coverage: Option<&'a OccupancyGrid>,
}

impl<'a> LoadedPoints<'a> {
    /// A cloud all of whose points are in the bins.
    pub fn whole(bins: &'a PointBins) -> Self {
        Self { bins, known: SiteWindow::ALL, bounds: SiteWindow::ALL, coverage: None }
    }
}

impl PointIndex for LoadedPoints<'_> {
    fn pitch(&self) -> i32 {
        self.bins.size()
    }

    fn visit(&self, window: &SiteWindow, each: impl FnMut(&[Point])) {
        self.bins.visit(window, each);
    }

    fn visit_disc(
        &self,
        disc: &CircumscribedDisc,
        window: &SiteWindow,
        each: impl FnMut(&[Point]),
    ) {
        self.bins.visit_disc(disc, window, each);
    }

    fn extent(&self) -> SiteWindow {
        self.bins.window()
    }

    fn certify(&self, disc: &CircumscribedDisc) -> Result<(), NeededWindow> {
        if disc.lies_in(&self.known) {
            return Ok(());
        }
        let Some(part) = disc.clip(&self.bounds) else { return Ok(()) };
        if self.known.covers(&part) {
            return Ok(());
        }
        match self.coverage {
            None => Err(NeededWindow(part)),
            Some(coverage) => {
                coverage.unknown(disc, &self.known).map_or(Ok(()), |w| Err(NeededWindow(w)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BOUNDS: SiteWindow = SiteWindow { low: [-40, 20], high: [170, 190] };

    /// Distance of a position from the nearest point of a cell.
    fn gap(square: &SiteWindow, centre: [f64; 2]) -> f64 {
        let along = |i: usize| {
            let (low, high) = (f64::from(square.low[i]), f64::from(square.high[i]));
            (low - centre[i]).max(centre[i] - high).max(0.0)
        };
        along(0).hypot(along(1))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        #[test]
        fn what_is_called_for_is_the_squares_with_points_that_touch_the_disc(
            points in prop::collection::vec((-40..=170_i32, 20..=190_i32), 0..12), size in 1..60_i32,
            x in -150..250_i32, y in -150..300_i32, small: bool, known in prop::array::uniform4(-60..200_i32)
        ) {
            let mut coverage = OccupancyGrid::new(BOUNDS, size);
            let mut half = coverage.clone();
            for (i, &(x, y)) in points.iter().enumerate() {
                if i % 2 == 0 { coverage.add([x, y]) } else { half.add([x, y]) }
            }
            coverage.merge(&half);
            let offsets = if small { [[7, 24], [-25, 0], [15, -20]] } else { [[33, 56], [-63, 16], [0, -65]] };
            let radius = if small { 25.0 } else { 65.0 };
            let disc = CircumscribedDisc::around(offsets.map(|[dx, dy]| [x + dx, y + dy]));
            let known = SiteWindow::of([[known[0], known[1]], [known[2], known[3]]]).unwrap();
            let square = |&(x, y): &(i32, i32)| {
                let low = [0, 1].map(|i| {
                    let p = [x, y][i] - BOUNDS.low[i];
                    BOUNDS.low[i] + p / size * size
                });
                let high = [0, 1].map(|i| (low[i] + size - 1).min(BOUNDS.high[i]));
                SiteWindow { low, high }
            };
            let all: Vec<_> = points.iter().map(square).filter(|square| !known.covers(square)).collect();
            // What the disc touches by less than three steps may be called for, or not.
            let within = |room: f64| {
                let centre = [x, y].map(f64::from);
                all.iter().filter(move |square| gap(square, centre) <= radius + room).copied()
                    .reduce(|a, b| a.union(&b))
            };
            let found = coverage.unknown(&disc, &known);
            let (least, most) = (within(0.0), within(3.0));
            prop_assert!(least.is_none_or(|least| found.is_some_and(|found| found.covers(&least))));
            prop_assert!(found.is_none_or(|found| most.is_some_and(|most| most.covers(&found))));
        }
    }

    #[test]
    fn maps_have_no_more_squares_than_they_may() {
        let squares = |high: i32, size: i32| {
            let map = OccupancyGrid::new(SiteWindow { low: [0; 2], high: [high; 2] }, size);
            (map.size, map.columns, map.holds.len())
        };
        assert_eq!(squares(4095, 1), (1, 4096, 1 << 24));
        assert_eq!(squares(4096, 1), (2, 2049, 2049 * 2049));
        assert_eq!(squares(99, 10), (10, 10, 100));
        assert_eq!(squares(100, 10), (10, 11, 121));
        assert_eq!(squares(5, 0), (1, 6, 36));
    }

    #[test]
    fn what_is_known_needs_nothing_more() {
        let bins = PointBins::new(&[]);
        let window = |low: Site, high: Site| SiteWindow { low, high };
        let bounds = window([0, 0], [100, 100]);
        // A circle of radius 50 around the origin of the bounds.
        let disc = CircumscribedDisc::around([[50, 0], [-30, 40], [-30, -40]]);
        let certify = |known: SiteWindow, coverage: Option<&OccupancyGrid>| {
            LoadedPoints { bins: &bins, known, bounds, coverage }.certify(&disc)
        };
        assert_eq!(certify(window([-60, -60], [60, 60]), None), Ok(()));
        // Nothing lies beyond the bounds.
        assert_eq!(certify(window([0, 0], [60, 60]), None), Ok(()));
        let Err(NeededWindow(part)) = certify(window([0, 0], [20, 60]), None) else { panic!() };
        assert!(part.low == [0, 0] && part.high.iter().all(|v| (50..54).contains(v)), "{part:?}");
        let mut coverage = OccupancyGrid::new(bounds, 10);
        assert_eq!(certify(window([0, 0], [20, 60]), Some(&coverage)), Ok(()));
        coverage.add([33, 5]);
        let needs = NeededWindow(window([30, 0], [39, 9]));
        assert_eq!(certify(window([0, 0], [20, 60]), Some(&coverage)), Err(needs));
        let beyond = LoadedPoints {
            bins: &bins,
            known: bounds,
            bounds: window([60, 60], [99, 99]),
            coverage: None,
        };
        assert_eq!(beyond.certify(&disc), Ok(()));
    }
}
