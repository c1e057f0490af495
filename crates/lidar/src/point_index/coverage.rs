//! Limits of a store that is filled from a part of a point cloud.
//!
//! For surfaces through all points, two conditions are recorded: a circle found empty that reaches out of the
//! window that was read, and a position outside the hull of the points read that unread parts might enclose.
//! Then more has to be read, and the work repeated. Both conditions are conservative, so the result is that of
//! the whole point cloud. With a longest edge, nothing further away matters. If the hull of all points is
//! known, its points are added to those read, and decide which positions are enclosed.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use terrane_base::geom::Point;
use terrane_cloud::PointSource;
use terrane_delaunay::{CircumscribedDisc, ConvexHull, FixedPosition, HullLocation, SiteWindow};

/// The part of a cloud that a store is filled from, and whether a query needed more of it.
///
/// While [`is_exceeded`](Self::is_exceeded) is false, results are those of the whole point cloud: no circle
/// that had to be empty left the window, and no position outside the known hull may be enclosed by other
/// points.
#[derive(Debug)]
pub(crate) struct PointStoreCoverage {
    /// All points in this window are in the store.
    window: SiteWindow,
    /// Window of the whole point cloud.
    cloud: SiteWindow,
    /// Hull of the boxes of all unread points.
    others: ConvexHull,
    /// Hull of these and of the known points.
    outer: OnceLock<ConvexHull>,
    exceeded: AtomicBool,
}

impl PointStoreCoverage {
    /// Limits of a store with all points in `window`, and those of the hull.
    pub(crate) fn with_hull(source: &dyn PointSource, window: SiteWindow) -> Self {
        Self {
            window,
            cloud: across(source.info().bounds.unwrap_or_default()),
            others: ConvexHull::default(),
            outer: OnceLock::new(),
            exceeded: AtomicBool::new(false),
        }
    }

    /// Limits of a store of the parts that may have points in `window`; the others are not read.
    pub(crate) fn new(source: &dyn PointSource, window: SiteWindow) -> Self {
        let corners = (0..source.parts())
            .filter_map(|part| source.bounds_of(part))
            .filter(|bounds| !window.covers(&across(*bounds)))
            .flat_map(|[low, high]| {
                [low, Point::new(high.x, low.y, 0), high, Point::new(low.x, high.y, 0)]
            });
        let others = ConvexHull::of(corners.collect());
        Self { others, ..Self::with_hull(source, window) }
    }

    /// True once a query needed more than the window.
    pub(crate) fn is_exceeded(&self) -> bool {
        self.exceeded.load(Ordering::Relaxed)
    }

    /// Records that `disc` has to be empty.
    pub(super) fn note_disc(&self, disc: &CircumscribedDisc) {
        if disc.clip(&self.cloud).is_some_and(|part| !self.window.covers(&part)) {
            self.exceed();
        }
    }

    /// Records a query at a position of the surface over the known points with this `hull`.
    pub(super) fn note_position(&self, hull: &ConvexHull, position: FixedPosition) {
        let place = hull.locate(position);
        if place == HullLocation::Inside {
            return;
        }
        let outer = self.outer.get_or_init(|| hull.merge(&self.others)).locate(position);
        if outer != HullLocation::Outside
            && !(place == HullLocation::Boundary && outer == HullLocation::Boundary)
        {
            self.exceed();
        }
    }

    fn exceed(&self) {
        self.exceeded.store(true, Ordering::Relaxed);
    }
}

/// The parts that may have points in a window.
pub(crate) fn parts_in(source: &dyn PointSource, window: &SiteWindow) -> Vec<usize> {
    let parts = (0..source.parts()).filter(|part| {
        let bounds = source.bounds_of(*part);
        bounds.is_some_and(|bounds| across(bounds).intersection(window).is_some())
    });
    parts.collect()
}

/// The window between two points.
fn across([low, high]: [Point; 2]) -> SiteWindow {
    SiteWindow { low: [low.x, low.y], high: [high.x, high.y] }
}
