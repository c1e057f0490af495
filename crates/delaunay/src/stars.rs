//! The part of the whole triangulation that a block owns, from the known points around the block.
//!
//! A triangle belongs to the block that holds its lowest corner (x, then y), so blocks share nothing
//! and are never merged. Points of the block and a margin are triangulated together with the hull of
//! the whole cloud. A triangle is final when its disc holds no other point of the cloud. Where every
//! triangle at a site v that has a corner beyond v is final, those are all triangles that v owns: they
//! cover the plane around v to the right of it as far as the hull goes, and the whole triangulation
//! has no others there. Hence a block is done when each triangle with a corner in it is final, save
//! those of which it holds the highest corner alone.

use super::disc::CircumscribedDisc;
use super::hull::ConvexHull;
use super::predicates::{Site, site};
use super::query::{deepest, from_lowest};
use super::space::{NeededWindow, PointIndex};
use super::triangulation::Triangulation;
use super::window::SiteWindow;
use terrane_base::error::Result;
use terrane_base::geom::Point;

/// Pitches of margin around a block. Triangles reach a few spacings of points, and their discs twice
/// as far; those that reach further fetch what they need.
const MARGIN: i32 = 6;

/// The Delaunay triangles of the whole cloud whose lowest corner lies in `block`, each
/// counter-clockwise from that corner, sorted. Of points at one (x, y) the lowest is meant.
///
/// `hull` is that of the whole cloud. `far` may hold any other of its points (of each position the
/// lowest), such as one for each coarse square: they keep circles small, and so what is needed. Of the
/// points known, those near the block are triangulated and others fetched where a disc reaches them;
/// blocks of 20,000 to 60,000 points stay in the cache.
///
/// The inner result lists the regions to load if the known points do not suffice.
///
/// # Errors
/// More points than [`Triangulation::new`] takes.
pub fn stars(
    space: &impl PointIndex,
    hull: &ConvexHull,
    block: &SiteWindow,
    far: &[Point],
) -> Result<std::result::Result<Vec<[Point; 3]>, NeededWindow>> {
    let window = block.grown(space.pitch().saturating_mul(MARGIN));
    let mut points = within(space, &window);
    points.extend_from_slice(hull.ring());
    points.extend_from_slice(far);
    loop {
        let triangulation = Triangulation::new(&points)?;
        let mut round = StarRound { space, window: &window, block, missing: vec![], needs: None };
        let owned = round.collect(&triangulation, &points);
        match (round.missing.is_empty(), round.needs) {
            (true, None) => return Ok(Ok(owned)),
            (true, Some(needs)) => return Ok(Err(NeededWindow(needs))),
            _ => points.append(&mut round.missing),
        }
    }
}

/// The known points in a window.
pub(super) fn within(space: &impl PointIndex, window: &SiteWindow) -> Vec<Point> {
    let mut points = vec![];
    space.visit(window, |run| points.extend(run.iter().filter(|p| window.contains(site(p)))));
    points
}

/// One look at a triangulation of some of the known points.
struct StarRound<'a, S> {
    space: &'a S,
    /// All known points in here are part of it.
    window: &'a SiteWindow,
    block: &'a SiteWindow,
    /// Points found in discs of triangles.
    missing: Vec<Point>,
    /// The regions required for triangles whose discs contain no known point.
    needs: Option<SiteWindow>,
}

impl<S: PointIndex> StarRound<'_, S> {
    /// The triangles that the block owns, sorted; not to be trusted unless nothing is found or needed.
    fn collect(&mut self, triangulation: &Triangulation, points: &[Point]) -> Vec<[Point; 3]> {
        let mut owned = vec![];
        for corners in triangulation.triangles() {
            let corners = from_lowest(corners.map(|i| points[i as usize]));
            let [a, b, c] = corners;
            let is_owned = self.block.contains(site(&a));
            if is_owned || self.block.contains(site(&b.min(c))) {
                self.check(corners.map(|p| site(&p)));
            }
            if is_owned {
                owned.push(corners);
            }
        }
        owned.sort_unstable();
        owned
    }

    /// True if a triangle is final.
    fn check(&mut self, corners: [Site; 3]) {
        let disc = CircumscribedDisc::around(corners);
        if !disc.lies_in(self.window)
            && let Some(point) = deepest(self.space, &disc, &SiteWindow::ALL)
        {
            return self.missing.push(point);
        }
        if let Err(NeededWindow(more)) = self.space.certify(&disc) {
            self.needs = Some(self.needs.map_or(more, |all| all.union(&more)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::oracle;
    use super::super::point_bins::PointBins;
    use super::super::space::{LoadedPoints, OccupancyGrid};
    use super::*;

    fn whole(points: &[Point]) -> Vec<[Point; 3]> {
        let triangulation = Triangulation::new(points).unwrap();
        triangulation.validate().unwrap();
        let corners = triangulation.triangles().map(|t| t.map(|i| points[i as usize]));
        let mut all: Vec<_> = corners.map(from_lowest).collect();
        all.sort();
        all
    }

    /// Disjoint blocks that cover a window.
    fn blocks(window: &SiteWindow, along: i32) -> Vec<SiteWindow> {
        let cuts = |axis: usize| -> Vec<[i32; 2]> {
            let (low, high) = (i64::from(window.low[axis]), i64::from(window.high[axis]));
            let at = |i: i32| (low + (high + 1 - low) * i64::from(i) / i64::from(along)) as i32;
            (0..along).map(|i| [at(i), at(i + 1) - 1]).filter(|cut| cut[0] <= cut[1]).collect()
        };
        let rows = cuts(1);
        let block = |x: [i32; 2], y: [i32; 2]| SiteWindow { low: [x[0], y[0]], high: [x[1], y[1]] };
        cuts(0).into_iter().flat_map(|x| rows.iter().map(move |y| block(x, *y))).collect()
    }

    /// A point of each coarse cell: the first in order.
    fn skeleton(points: &[Point], size: i32) -> Vec<Point> {
        let mut sorted = points.to_vec();
        sorted.sort_by_key(|p| (p.x.div_euclid(size), p.y.div_euclid(size), *p));
        sorted.dedup_by_key(|p| (p.x.div_euclid(size), p.y.div_euclid(size)));
        sorted
    }

    /// Loads only the required regions until the block is done; also returns the number of loads.
    fn load(
        points: &[Point],
        block: &SiteWindow,
        far: &[Point],
        map: Option<&OccupancyGrid>,
    ) -> (Vec<[Point; 3]>, u32) {
        let (hull, mut known) = (ConvexHull::of(points.to_vec()), *block);
        let bounds = SiteWindow::of(points.iter().map(site)).unwrap();
        for round in 0..100 {
            let inside = points.iter().filter(|p| known.contains(site(p))).copied();
            let bins = PointBins::new(&inside.collect::<Vec<_>>());
            let space = LoadedPoints { bins: &bins, known, bounds, coverage: map };
            match stars(&space, &hull, block, far).unwrap() {
                Ok(owned) => return (owned, round),
                Err(NeededWindow(more)) => {
                    assert!(!known.covers(&more));
                    known = known.union(&more);
                }
            }
        }
        panic!("does not end");
    }

    #[test]
    fn blocks_make_up_the_whole() {
        let mut loads = 0;
        for n in [3, 30, 500] {
            for (name, mut points) in oracle::awkward(n) {
                let sites: std::collections::BTreeMap<_, _> =
                    points.iter().rev().map(|p| (site(p), *p)).collect();
                points.retain(|p| sites[&site(p)].z == p.z);
                let expected = whole(&points);
                let bounds = SiteWindow::of(points.iter().map(site)).unwrap();
                let wide =
                    1 + (bounds.high[0] - bounds.low[0]).max(bounds.high[1] - bounds.low[1]) / 16;
                let mut map = OccupancyGrid::new(bounds, wide);
                points.iter().for_each(|p| map.add(site(p)));
                let far = skeleton(&points, wide);
                for (far, map) in [(&far[..], Some(&map)), (&far[..], None), (&[], None)] {
                    let mut found = vec![];
                    for block in blocks(&bounds, 3) {
                        let (owned, rounds) = load(&points, &block, far, map);
                        found.extend(owned);
                        loads += rounds;
                    }
                    found.sort();
                    assert!(found == expected, "{name} {n}");
                }
            }
        }
        assert!(loads > 100, "{loads}");
    }

    #[test]
    fn small_blocks_of_a_known_cloud_make_up_the_whole() {
        for (name, points) in oracle::awkward(3_000) {
            let (bins, hull) = (PointBins::new(&points), ConvexHull::of(points.clone()));
            let space = LoadedPoints::whole(&bins);
            let mut found = vec![];
            for block in blocks(&bins.window(), 6) {
                found.extend(stars(&space, &hull, &block, &[]).unwrap().unwrap());
            }
            found.sort();
            assert!(found == whole(bins.points()), "{name}");
        }
    }
}
