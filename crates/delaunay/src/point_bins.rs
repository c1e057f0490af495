//! Points in square bins: a counting sort by bin, canonical order within each, one of each position.

use super::disc::CircumscribedDisc;
use super::predicates::Site;
use super::window::SiteWindow;
use terrane_base::geom::Point;

/// Points that a bin should hold where they are spread evenly.
const PER_BIN: u64 = 3;

/// Most bins for each point, where they are not.
const MAX_BINS: u64 = 2;

/// A uniform grid of bins over the points' own extent. Of points at one (x, y) only the lowest is
/// kept. About 16 bytes a point; each row of bins is one run of memory.
#[derive(Clone, Debug)]
pub struct PointBins {
    window: SiteWindow,
    size: i32,
    /// 2^63 by the size, rounded up: products are quicker than quotients.
    inverse: u64,
    columns: usize,
    /// Start of each bin's points; one more than there are bins.
    starts: Vec<u32>,
    points: Vec<Point>,
}

impl PointBins {
    /// Sorts points into bins; below 2^32 points, in linear time.
    pub fn new(points: &[Point]) -> Self {
        let Some(window) = SiteWindow::of(points.iter().map(|p| [p.x, p.y])) else {
            return Self::empty();
        };
        let mut bins = Self::sized(window, even_size(&window, points.len()));
        bins.sort(points);
        while let Some(size) = bins.finer(points.len()) {
            bins = Self::sized(window, size);
            bins.sort(points);
        }
        bins.settle();
        bins
    }

    fn empty() -> Self {
        Self::sized(SiteWindow { low: [0; 2], high: [0; 2] }, 1)
    }

    fn sized(window: SiteWindow, size: i32) -> Self {
        let [columns, rows] = [0, 1].map(|i| bins_along(&window, i, size) as usize);
        // Too large by less than 1: over steps below 2^32 less than 2^-31, which no size below 2^31 carries into the next bin.
        let inverse = (1_u64 << 63).div_ceil(size as u64);
        Self { window, size, inverse, columns, starts: vec![0; columns * rows + 1], points: vec![] }
    }

    /// A smaller size, where most bins are empty and the others too full.
    fn finer(&self, points: usize) -> Option<i32> {
        let used = self.starts.windows(2).filter(|pair| pair[0] < pair[1]).count();
        let size = self.size / 2;
        let bins =
            bins_along(&self.window, 0, size.max(1)) * bins_along(&self.window, 1, size.max(1));
        let crowded = points as u64 > 4 * PER_BIN * used as u64;
        (crowded && size > 0 && bins <= MAX_BINS * points as u64).then_some(size)
    }

    /// Counting sort. While points are placed, `starts[bin + 1]` is where the next one goes.
    fn sort(&mut self, points: &[Point]) {
        let bins: Vec<u32> = points.iter().map(|p| self.bin([p.x, p.y]) as u32).collect();
        let mut ends = vec![0u32; self.starts.len() + 1];
        bins.iter().for_each(|&bin| ends[bin as usize + 2] += 1);
        (2..ends.len()).for_each(|i| ends[i] += ends[i - 1]);
        self.points = vec![Point::default(); points.len()];
        for (point, &bin) in points.iter().zip(&bins) {
            let end = &mut ends[bin as usize + 1];
            self.points[*end as usize] = *point;
            *end += 1;
        }
        // After placing, `ends[bin + 1]` is the end of a bin, which is the start of the next.
        ends.pop();
        self.starts = ends;
    }

    /// Puts each bin into order and drops all but the lowest point of each position.
    fn settle(&mut self) {
        let (mut count, mut from) = (0, 0);
        for bin in 0..self.starts.len() - 1 {
            // Read here, as settling the next bin writes it.
            let to = self.starts[bin + 1] as usize;
            self.points[from..to].sort_unstable();
            self.starts[bin] = count as u32;
            for i in from..to {
                let point = self.points[i];
                let last = self.points[self.starts[bin] as usize..count].last();
                if last.is_none_or(|last| [last.x, last.y] != [point.x, point.y]) {
                    self.points[count] = point;
                    count += 1;
                }
            }
            from = to;
        }
        if let Some(end) = self.starts.last_mut() {
            *end = count as u32;
        }
        self.points.truncate(count);
    }

    #[inline(always)]
    fn column(&self, x: i32) -> usize {
        self.along((x - self.window.low[0]) as u32)
    }

    #[inline(always)]
    fn row(&self, y: i32) -> usize {
        self.along((y - self.window.low[1]) as u32)
    }

    /// Steps, below 2^31, divided by the size and rounded down: the product is too large by less than 2^-32, and what
    /// is not a whole number is further below the next one.
    #[inline(always)]
    fn along(&self, steps: u32) -> usize {
        ((u128::from(steps) * u128::from(self.inverse)) >> 63) as usize
    }

    #[inline(always)]
    fn bin(&self, p: Site) -> usize {
        self.row(p[1]) * self.columns + self.column(p[0])
    }

    /// The points of some bins of a row.
    #[inline(always)]
    fn run(&self, row: usize, columns: [usize; 2]) -> &[Point] {
        let at = row * self.columns;
        let (from, to) = (self.starts[at + columns[0]], self.starts[at + columns[1] + 1]);
        &self.points[from as usize..to as usize]
    }

    /// Side of a bin, in steps.
    pub fn size(&self) -> i32 {
        self.size
    }

    /// The extent of the points (the origin alone, when there are none).
    pub fn window(&self) -> SiteWindow {
        self.window
    }

    /// All points: bin by bin, in order within each, no two at the same (x, y).
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Hands out all points in the window, and others near it.
    #[inline]
    pub fn visit(&self, window: &SiteWindow, mut each: impl FnMut(&[Point])) {
        let Some(part) = window.intersection(&self.window) else { return };
        let columns = [self.column(part.low[0]), self.column(part.high[0])];
        for row in self.row(part.low[1])..=self.row(part.high[1]) {
            each(self.run(row, columns));
        }
    }

    /// Hands out all points in both the window and the disc, and others near it.
    #[inline]
    pub fn visit_disc(
        &self,
        disc: &CircumscribedDisc,
        window: &SiteWindow,
        mut each: impl FnMut(&[Point]),
    ) {
        let Some(part) = window.intersection(&self.window) else { return };
        let Some([low, high]) = disc.span(1, part.low[0], part.high[0]) else { return };
        let (low, high) = (low.max(part.low[1].into()), high.min(part.high[1].into()));
        if low > high {
            return;
        }
        for row in self.row(low as i32)..=self.row(high as i32) {
            let bottom = self.window.low[1] + row as i32 * self.size;
            let Some([left, right]) = disc.span(0, bottom, bottom + (self.size - 1)) else {
                continue;
            };
            let (left, right) = (left.max(part.low[0].into()), right.min(part.high[0].into()));
            if left <= right {
                each(self.run(row, [self.column(left as i32), self.column(right as i32)]));
            }
        }
    }
}

fn length(window: &SiteWindow, axis: usize) -> u64 {
    (i64::from(window.high[axis]) - i64::from(window.low[axis])) as u64 + 1
}

fn bins_along(window: &SiteWindow, axis: usize, size: i32) -> u64 {
    (length(window, axis) - 1) / size as u64 + 1
}

/// Side of bins with [`PER_BIN`] points each, were they spread evenly; so large that a thin extent
/// has no more bins than points.
fn even_size(window: &SiteWindow, points: usize) -> i32 {
    let (width, height, points) = (length(window, 0), length(window, 1), points as u64);
    let even = ((width as f64) * (height as f64) * PER_BIN as f64 / points as f64).sqrt() as u64;
    let min_size = width.max(height).div_ceil(points);
    even.max(min_size).clamp(1, 1 << 30) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points() -> impl Strategy<Value = Vec<Point>> {
        (1i32..2_000).prop_flat_map(|most| {
            let point = (-most..most, -most..most, 0..3);
            prop::collection::vec(point.prop_map(|(x, y, z)| Point::new(x, y, z)), 0..200)
        })
    }

    fn lowest_of_each(mut points: Vec<Point>) -> Vec<Point> {
        points.sort();
        points.dedup_by_key(|p| [p.x, p.y]);
        points
    }

    proptest! {
        #[test]
        fn keeps_the_lowest_point_of_each_position(points in points()) {
            let bins = PointBins::new(&points);
            let mut kept = bins.points().to_vec();
            kept.sort();
            prop_assert_eq!(kept, lowest_of_each(points.clone()));
            let mut backwards = points;
            backwards.reverse();
            let again = PointBins::new(&backwards);
            prop_assert_eq!(again.points(), bins.points());
        }

        #[test]
        fn visits_miss_nothing(points in points(), c in prop::array::uniform6(-3_000i32..3_000)) {
            let bins = PointBins::new(&points);
            let corners = [[c[0], c[1]], [c[2], c[3]], [c[4], c[5]]];
            let window = SiteWindow::of(corners).unwrap();
            let mut seen = vec![];
            bins.visit(&window, |run| seen.extend_from_slice(run));
            let inside = |p: &&Point| window.contains([p.x, p.y]);
            prop_assert!(bins.points().iter().filter(inside).all(|p| seen.contains(p)));
            if super::super::predicates::orient(corners[0], corners[1], corners[2]) <= 0 {
                return Ok(());
            }
            let disc = CircumscribedDisc::around(corners);
            let mut seen = vec![];
            bins.visit_disc(&disc, &SiteWindow::ALL, |run| seen.extend_from_slice(run));
            let inside = |p: &&Point| disc.holds([p.x, p.y]);
            prop_assert!(bins.points().iter().filter(inside).all(|p| seen.contains(p)));
        }
    }

    /// How many squares of this size, counted from the lowest x and y, hold points, and how many there
    /// are.
    fn bin_layout(points: &[Point], size: i64) -> (usize, i64) {
        let low = |axis: fn(&Point) -> i32| i64::from(points.iter().map(axis).min().unwrap());
        let high = |axis: fn(&Point) -> i32| i64::from(points.iter().map(axis).max().unwrap());
        let (west, south) = (low(|p| p.x), low(|p| p.y));
        let at = |p: &Point| ((i64::from(p.x) - west) / size, (i64::from(p.y) - south) / size);
        let used: std::collections::BTreeSet<_> = points.iter().map(at).collect();
        let count = |from: i64, to: i64| (to - from) / size + 1;
        (used.len(), count(west, high(|p| p.x)) * count(south, high(|p| p.y)))
    }

    proptest! {
        /// Three points a bin if they lay evenly, and bins half as wide again and again where those in
        /// use hold more than twelve, as long as there are no more than two for each point.
        #[test]
        fn bins_are_halved_while_they_are_crowded(points in clustered()) {
            let bins = PointBins::new(&points);
            let count = points.len() as i64;
            let extent = bin_layout(&points, 1).1;
            let first = (1..).take_while(|size| size * size * count <= 3 * extent).last().unwrap_or(1);
            let sides = [bins.window().high, bins.window().low];
            let longest = (0..2).map(|i| i64::from(sides[0][i]) - i64::from(sides[1][i]) + 1).max().unwrap();
            let first = first.max((longest + count - 1) / count);
            let mut size = first;
            let crowded = |size| points.len() > 12 * bin_layout(&points, size).0;
            while crowded(size) && size > 1 && bin_layout(&points, size / 2).1 <= 2 * count {
                size /= 2;
            }
            prop_assert_eq!(i64::from(bins.size()), size);
            prop_assert_eq!(bins.starts.len() as i64, bin_layout(&points, size).1 + 1);
        }
    }

    /// Points most of which lie in a corner of their extent.
    fn clustered() -> impl Strategy<Value = Vec<Point>> {
        (1i32..60, 1i32..60, 60i32..3_000).prop_flat_map(|(width, height, far)| {
            let near = (0..width, 0..height).prop_map(|(x, y)| Point::new(x - 7, y - 99, 0));
            let any = (0..far, 0..far / 3).prop_map(|(x, y)| Point::new(x - 7, y - 99, 0));
            (prop::collection::vec(near, 1..300), prop::collection::vec(any, 0..9))
                .prop_map(|(near, any)| [near, any].concat())
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn products_are_quotients(bits in 0_u32..=30, size: u32, bin: u32, beside in 0_u32..3) {
            let size = (size & ((1 << bits) - 1)) + 1;
            let bins = PointBins::sized(SiteWindow { low: [0; 2], high: [0; 2] }, size as i32);
            // Next to where a bin begins, below 2^31 steps.
            let most = (1_u32 << 31) - 2;
            let steps = (bin % (most / size + 1) * size + beside).saturating_sub(1).min(most);
            prop_assert_eq!(bins.along(steps), (steps / size) as usize);
        }
    }

    #[test]
    fn windows_and_discs_beside_the_points_are_given_none() {
        let points: Vec<_> = (0..900).map(|i| Point::new(i % 30 * 4, i / 30 * 4, 0)).collect();
        let bins = PointBins::new(&points);
        let count = |window: &SiteWindow, disc: Option<&CircumscribedDisc>| {
            let mut seen = 0;
            match disc {
                None => bins.visit(window, |run| seen += run.len()),
                Some(disc) => bins.visit_disc(disc, window, |run| seen += run.len()),
            }
            seen
        };
        let window = |low: Site, high: Site| SiteWindow { low, high };
        assert_eq!(count(&window([200, 0], [300, 300]), None), 0);
        assert!((100..200).contains(&count(&window([20, 20], [59, 59]), None)));
        // A circle of radius 20 around (60, 60), which holds some 80 points.
        let disc = CircumscribedDisc::around([[80, 60], [48, 76], [48, 44]]);
        let near = count(&SiteWindow::ALL, Some(&disc));
        assert!((78..180).contains(&near), "{near}");
        assert!(count(&window([60, 60], [119, 119]), Some(&disc)) < near / 2);
        assert_eq!(count(&window([0, 0], [30, 119]), Some(&disc)), 0);
        assert_eq!(count(&window([0, 0], [119, 30]), Some(&disc)), 0);
        assert_eq!(count(&window([90, 0], [119, 119]), Some(&disc)), 0);
        // A row, a column, and a position.
        for (high, least) in [([119, 60], 6), ([60, 119], 6), ([60, 60], 1)] {
            assert!(count(&window([60, 60], high), Some(&disc)) >= least);
        }
    }

    #[test]
    fn thin_and_crowded_extents_stay_within_bounds() {
        let line: Vec<_> = (0..1000).map(|i| Point::new(i * 500_000, 0, 0)).collect();
        let bins = PointBins::new(&line);
        assert!(bins.starts.len() <= 2_002 && bins.points().len() == 1000);
        let mut crowd: Vec<_> = (0..1000).map(|i| Point::new(i % 40, i / 40, 0)).collect();
        crowd.push(Point::new(1 << 28, 1 << 28, 0));
        assert!(PointBins::new(&crowd).starts.len() <= 2_100);
        assert!(PointBins::new(&[]).points().is_empty());
        let one = PointBins::new(&vec![Point::new(7, 7, 7); 100]);
        assert!(one.size() == 1 && one.points().len() == 1);
    }
}
