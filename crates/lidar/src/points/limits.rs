//! How far what a store holds is all there is: a store may be filled from a part of a cloud.
//!
//! Of a surface through all points, two things are noted on the way: a disc that was found empty but
//! reaches out of the window that was read, and a position that the points read do not surround but those
//! of unread parts might. Then more has to be read, and the work done again. Both notes are on the safe
//! side, so what comes out is what the whole cloud gives. With a longest edge, corners of triangles that
//! count lie within it, and nothing further away can matter. Where the hull of all points is known, they are
//! added to those read, and tell which positions are surrounded.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use terrane_base::geom::Point;
use terrane_cloud::PointSource;
use terrane_delaunay::{CircumscribedDisc, ConvexHull, FixedPosition, HullLocation, SiteWindow};

/// The part of a cloud that a store is filled from, and whether an answer needed more of it.
///
/// An answer that was found while [`is_exceeded`](Self::is_exceeded) stays false is that of the whole
/// cloud: no disc that had to be empty left the window, and no position that the points known do not
/// surround may lie among others.
#[derive(Debug)]
pub(crate) struct PointStoreLimits {
    /// All points of the cloud that lie in it are in the store.
    window: SiteWindow,
    /// All that the cloud may reach.
    cloud: SiteWindow,
    /// Around all boxes that other points may lie in.
    others: ConvexHull,
    /// Around these and the points known.
    outer: OnceLock<ConvexHull>,
    exceeded: AtomicBool,
}

impl PointStoreLimits {
    /// Of a store that has all its points in `window`, and those of its hull.
    pub(crate) fn with_hull(source: &dyn PointSource, window: SiteWindow) -> Self {
        Self {
            window,
            cloud: across(source.info().bounds.unwrap_or_default()),
            others: ConvexHull::default(),
            outer: OnceLock::new(),
            exceeded: AtomicBool::new(false),
        }
    }

    /// Of the parts of a cloud that may have points in `window`; the others are not read.
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

    /// True once an answer needed more than the window.
    pub(crate) fn is_exceeded(&self) -> bool {
        self.exceeded.load(Ordering::Relaxed)
    }

    /// Notes that `disc` has to be empty.
    pub(super) fn note_disc(&self, disc: &CircumscribedDisc) {
        if disc.clip(&self.cloud).is_some_and(|part| !self.window.covers(&part)) {
            self.exceed();
        }
    }

    /// Notes that a position was looked up in the surface over the points known, whose hull is `hull`.
    pub(super) fn note_position(&self, hull: &ConvexHull, position: FixedPosition) {
        let place = hull.place(position);
        if place == HullLocation::Inside {
            return;
        }
        let outer = self.outer.get_or_init(|| hull.merge(&self.others)).place(position);
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
    let touches = |part: &usize| {
        let bounds = source.bounds_of(*part);
        bounds.is_some_and(|bounds| across(bounds).intersection(window).is_some())
    };
    (0..source.parts()).filter(touches).collect()
}

/// The window between two points.
fn across([low, high]: [Point; 2]) -> SiteWindow {
    SiteWindow { low: [low.x, low.y], high: [high.x, high.y] }
}
