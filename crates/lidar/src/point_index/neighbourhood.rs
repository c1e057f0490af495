//! The points around a position; more are loaded when a query needs them.

use std::cell::RefCell;

use super::tile_store::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_delaunay::{
    CircumscribedDisc, ConvexHull, FixedPosition, Location, Natural, NeededWindow, PointBins,
    PointIndex, SiteWindow, TriangleFinder,
};

/// Tiles loaded at a time, the nearest first.
const AT_ONCE: usize = 16;

/// All points of a window, and of the tiles beyond it that were needed.
pub(crate) struct SurroundingPoints<'a> {
    store: &'a PointStore,
    /// Points of the window.
    bins: PointBins,
    known: SiteWindow,
    /// Points beyond it, by tile.
    beyond: Vec<(usize, PointBins)>,
    /// Tiles that the last query lacked.
    missing: RefCell<Vec<usize>>,
}

impl<'a> SurroundingPoints<'a> {
    /// The points of the tiles that `window` touches.
    pub(crate) fn new(store: &'a PointStore, window: SiteWindow) -> Result<Self> {
        let tiling = store.tiling();
        let windows = tiling.touching(window).map(|square| tiling.window_of(square));
        let known = windows.reduce(|all, window| all.union(&window)).unwrap_or(window);
        let bins = binned(store, tiling.touching(window))?;
        Ok(Self { store, bins, known, beyond: Vec::new(), missing: RefCell::default() })
    }

    /// The location of each position in the triangulation, in order.
    pub(crate) fn find_all(
        &mut self,
        hull: &ConvexHull,
        positions: impl Iterator<Item = FixedPosition>,
        each: impl FnMut(FixedPosition, Location),
    ) -> Result<()> {
        self.find_all_small(hull, positions, |_| true, each)
    }

    /// As [`find_all`](Self::find_all), for small triangles only; on a shared side, the small one.
    pub(crate) fn find_all_small(
        &mut self,
        hull: &ConvexHull,
        positions: impl Iterator<Item = FixedPosition>,
        is_small: impl Fn(&[Point; 3]) -> bool,
        mut each: impl FnMut(FixedPosition, Location),
    ) -> Result<()> {
        let mut left = positions.peekable();
        while left.peek().is_some() {
            let mut finder = TriangleFinder::new(&*self, hull);
            while let Some(&position) = left.peek() {
                let Ok(location) = finder.find_small(position, &is_small) else { break };
                if let Some(limits) = &self.store.limits {
                    limits.note_position(hull, position);
                }
                each(position, location);
                left.next();
            }
            // At least one square is new in each round, so this ends.
            self.load_missing()?;
        }
        Ok(())
    }

    /// The location of each position, in order, if it is a point or a triangle that `is_small`; other triangles
    /// are only reported as not small. Small triangles have no edge longer than `reach` steps, the margin of
    /// the window around the positions.
    ///
    /// A small triangle of all points has its corners in the window, so it is also a triangle of the known
    /// points: other triangles need no further check, regardless of their circles. Positions without a point
    /// within reach are skipped.
    pub(crate) fn find_small(
        &mut self,
        hull: &ConvexHull,
        positions: impl Iterator<Item = FixedPosition>,
        reach: i32,
        is_small: impl Fn(&[Point; 3]) -> bool,
        mut each: impl FnMut(FixedPosition, Location),
    ) -> Result<()> {
        let mut left = positions.peekable();
        while left.peek().is_some() {
            let known = KnownPoints(self);
            let mut finder = TriangleFinder::new(&known, hull);
            while let Some(&position) = left.peek() {
                let location = match self.is_near(position, reach) {
                    true => finder.find_small(position, &is_small).unwrap_or(Location::Outside),
                    false => Location::Outside,
                };
                if let Location::Triangle(corners) = &location
                    && is_small(corners)
                    && self
                        .certify(&CircumscribedDisc::around(corners.map(|p| [p.x, p.y])))
                        .is_err()
                {
                    break;
                }
                each(position, location);
                left.next();
            }
            self.load_missing()?;
        }
        Ok(())
    }

    /// Whether a known point may be within `reach` steps, along both axes.
    fn is_near(&self, position: FixedPosition, reach: i32) -> bool {
        let at = position.floor();
        let (window, mut any) = (SiteWindow { low: at, high: at }.grown(reach + 1), false);
        self.visit(&window, |run| any |= !run.is_empty());
        any
    }

    /// The natural neighbour height at each position of `window`, in their order.
    pub(crate) fn natural(
        &mut self,
        hull: &ConvexHull,
        window: SiteWindow,
        positions: impl Iterator<Item = FixedPosition>,
        mut each: impl FnMut(Option<f64>),
    ) -> Result<()> {
        let mut left = positions.peekable();
        while left.peek().is_some() {
            let mut natural = Natural::new(&*self, hull, &window)?;
            while let Some(&position) = left.peek() {
                let Ok(height) = natural.height(position)? else { break };
                each(height);
                left.next();
            }
            self.load_missing()?;
        }
        Ok(())
    }

    /// Loads the tiles that the last query lacked, or the nearest of them.
    fn load_missing(&mut self) -> Result<()> {
        let mut missing = self.missing.take();
        // The nearest first, in an order that nothing but the squares decides; they may settle what the others were for.
        let tiling = self.store.tiling();
        missing.sort_by_key(|&square| (self.known.steps_to(&tiling.window_of(square)), square));
        for &square in missing.iter().take(AT_ONCE) {
            self.beyond.push((square, binned(self.store, [square].into_iter())?));
        }
        Ok(())
    }

    /// Records that a query depends on an empty circle.
    fn note(&self, disc: &CircumscribedDisc) {
        if let Some(limits) = &self.store.limits {
            limits.note_disc(disc);
        }
    }

    fn is_loaded(&self, square: usize) -> bool {
        self.known.covers(&self.store.tiling().window_of(square))
            || self.beyond.iter().any(|(loaded, _)| *loaded == square)
    }
}

/// The points of tiles, sorted into bins.
fn binned(store: &PointStore, mut squares: impl Iterator<Item = usize>) -> Result<PointBins> {
    let mut points = Vec::new();
    squares.try_for_each(|square| store.visit(square, |run| points.extend_from_slice(run)))?;
    Ok(PointBins::new(&points))
}

impl PointIndex for SurroundingPoints<'_> {
    fn pitch(&self) -> i32 {
        self.bins.size()
    }

    fn visit(&self, window: &SiteWindow, mut each: impl FnMut(&[Point])) {
        self.bins.visit(window, &mut each);
        for (_, bins) in &self.beyond {
            if bins.window().intersection(window).is_some() {
                bins.visit(window, &mut each);
            }
        }
    }

    fn visit_disc(
        &self,
        disc: &CircumscribedDisc,
        window: &SiteWindow,
        mut each: impl FnMut(&[Point]),
    ) {
        self.bins.visit_disc(disc, window, &mut each);
        for (_, bins) in &self.beyond {
            if bins.window().intersection(window).is_some() {
                bins.visit_disc(disc, window, &mut each);
            }
        }
    }

    fn extent(&self) -> SiteWindow {
        let windows = self.beyond.iter().map(|(_, bins)| bins.window());
        windows.fold(self.bins.window(), |all, window| all.union(&window))
    }

    fn certify(&self, disc: &CircumscribedDisc) -> std::result::Result<(), NeededWindow> {
        if self.store.is_within(disc, &self.known) {
            self.note(disc);
            return Ok(());
        }
        let mut missing = self.missing.borrow_mut();
        missing.clear();
        missing.extend(self.store.squares_in(*disc).filter(|&square| !self.is_loaded(square)));
        let windows = missing.iter().map(|&square| self.store.tiling().window_of(square));
        match windows.reduce(|all, window| all.union(&window)) {
            Some(window) => Err(NeededWindow(window)),
            None => {
                self.note(disc);
                Ok(())
            }
        }
    }
}

/// The known points around a position, ignoring all others.
struct KnownPoints<'a, 'b>(&'a SurroundingPoints<'b>);

impl PointIndex for KnownPoints<'_, '_> {
    fn pitch(&self) -> i32 {
        self.0.pitch()
    }

    fn visit(&self, window: &SiteWindow, each: impl FnMut(&[Point])) {
        self.0.visit(window, each);
    }

    fn visit_disc(
        &self,
        disc: &CircumscribedDisc,
        window: &SiteWindow,
        each: impl FnMut(&[Point]),
    ) {
        self.0.visit_disc(disc, window, each);
    }

    fn extent(&self) -> SiteWindow {
        self.0.extent()
    }

    fn certify(&self, _: &CircumscribedDisc) -> std::result::Result<(), NeededWindow> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point_index::Tiling;
    use terrane_delaunay::LoadedPoints;

    /// Points with voids much larger than a square, and an outline with a notch.
    fn points() -> Vec<Point> {
        let mut state = 99_u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((state >> 33) % below) as i32
        };
        let all = (0..20_000).map(|_| Point::new(random(10_000), random(10_000), random(500)));
        let is_far =
            |p: &Point, x: i32, y: i32, r: i32| (p.x - x).pow(2) + (p.y - y).pow(2) > r * r;
        let all = all.filter(|p| is_far(p, 3000, 3000, 1800) && is_far(p, 10_000, 6000, 2500));
        all.filter(|p| is_far(p, 5000, 8000, 900)).collect()
    }

    #[test]
    fn a_part_with_what_it_takes_in_answers_like_the_whole() {
        let points = points();
        let folder = tempfile::tempdir().unwrap();
        let corners = [Point::new(0, 0, 0), Point::new(9999, 9999, 0)];
        let store = PointStore::empty(Tiling::new(corners, 4_000_000), folder.path(), 50_000);
        store.add(&points).unwrap();
        assert!(store.points.memory_use() <= 50_000 && store.points.spilled() > 0);
        let hull = store.hull().unwrap();
        assert_eq!(hull.ring(), ConvexHull::of(points.clone()).ring());
        let bins = PointBins::new(&points);
        let space = LoadedPoints::whole(&bins);
        let (mut whole, mut asked, mut beyond) = (TriangleFinder::new(&space, &hull), 0, 0);
        for (x, y) in (0..100).map(|i| (i % 10 * 1000, i / 10 * 1000)) {
            let window = SiteWindow { low: [x, y], high: [x + 999, y + 999] };
            let mut around = SurroundingPoints::new(&store, window).unwrap();
            let positions = (0..400).map(|i| {
                let (col, row) = (f64::from(i % 20) + 0.5, f64::from(i / 20) + 0.5);
                FixedPosition::from_steps(f64::from(x) + 50.0 * col, f64::from(y) + 50.0 * row)
            });
            around
                .find_all(&hull, positions, |position, found| {
                    assert_eq!(whole.find(position).unwrap(), found);
                    asked += 1;
                })
                .unwrap();
            beyond += around.beyond.len();
        }
        assert!(asked == 40_000 && beyond > 100, "{asked} {beyond}");
    }

    #[test]
    fn small_triangles_are_those_of_the_whole() {
        let points = points();
        let folder = tempfile::tempdir().unwrap();
        let corners = [Point::new(0, 0, 0), Point::new(9999, 9999, 0)];
        let store = PointStore::empty(Tiling::new(corners, 4_000_000), folder.path(), 50_000);
        store.add(&points).unwrap();
        let hull = store.hull().unwrap();
        let bins = PointBins::new(&points);
        let space = LoadedPoints::whole(&bins);
        let reach = 130;
        let is_small = |found: &Location| match found {
            Location::Triangle([a, b, c]) => [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(p, q)| (p.x - q.x).pow(2) + (p.y - q.y).pow(2) <= reach * reach),
            Location::At(_) => true,
            Location::Outside => false,
        };
        let (mut whole, mut small, mut large) = (TriangleFinder::new(&space, &hull), 0, 0);
        for (x, y) in (0..100).map(|i| (i % 10 * 1000, i / 10 * 1000)) {
            let window = SiteWindow { low: [x, y], high: [x + 999, y + 999] };
            let mut around = SurroundingPoints::new(&store, window.grown(reach)).unwrap();
            let positions = (0..400).map(|i| {
                let (col, row) = (f64::from(i % 20) + 0.5, f64::from(i / 20) + 0.5);
                FixedPosition::from_steps(f64::from(x) + 50.0 * col, f64::from(y) + 50.0 * row)
            });
            let is = |corners: &[Point; 3]| is_small(&Location::Triangle(*corners));
            around
                .find_small(&hull, positions, reach, is, |position, found| {
                    let is = |corners: &[Point; 3]| is_small(&Location::Triangle(*corners));
                    let expected = whole.find_small(position, is).unwrap();
                    assert_eq!(is_small(&found), is_small(&expected), "{position:?}");
                    if is_small(&expected) {
                        assert_eq!(found, expected);
                        small += 1;
                    } else {
                        large += 1;
                    }
                })
                .unwrap();
        }
        assert!(small > 5000 && large > 5000, "{small} {large}");
    }
}
