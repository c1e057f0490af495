//! What a model of a part of a cloud has to know of all of it: which points are ground, how far apart points
//! are, and what surrounds them.

use serde::{Deserialize, Serialize};

use super::filter::spacing;
use super::kinds::GroundFrom;
use super::metres::MetricFrame;
use super::notes::found_in_classes;
use crate::points::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_cloud::CloudInfo;
use terrane_delaunay::ConvexHull;

/// What was seen of a cloud.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct CloudOverview {
    /// True where the ground is that of its classes.
    pub(crate) by_class: bool,
    /// Metres between last returns, where a method finds the ground.
    pub(crate) last: f64,
    /// True where it looks among all returns, as their numbers tell nothing.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) all_returns: bool,
    /// Metres between first returns, for the surface.
    pub(crate) first: f64,
    /// Steps along the longest edge in a crown, or to the end of what a square of the surface sees.
    pub(crate) reach: i32,
    /// Most points that a square of the surface sees.
    #[serde(default, skip_serializing_if = "is_none")]
    pub(crate) square: u64,
    /// What surrounds the ground of the classes.
    pub(super) ground: Vec<[i32; 3]>,
    /// What surrounds the returns of the surface.
    pub(super) surface: Vec<[i32; 3]>,
    /// Which points a model is made of, one line each.
    pub(crate) notes: Vec<String>,
}

impl CloudOverview {
    /// Of points of these classes, which are the ground if there are any.
    pub(crate) fn look_at_classes(&mut self, ground: &PointStore, classes: &[u8]) -> Result<()> {
        self.by_class = ground.count() > 0;
        self.ground = places(&ground.hull()?);
        self.notes.extend(self.by_class.then(|| found_in_classes(ground.count(), classes)));
        Ok(())
    }

    /// Of the points that a method finds the ground among.
    pub(crate) fn look_at_candidates(
        &mut self,
        candidates: &[&PointStore],
        cloud: &CloudInfo,
        ground: GroundFrom,
    ) -> Result<()> {
        self.last = spacing(candidates, &MetricFrame::of(&cloud.crs, &cloud.frame)?);
        self.notes.push(format!("ground: found by {}", ground.method().name()));
        Ok(())
    }

    /// What surrounds the ground, where that is known.
    pub(crate) fn around_ground(&self) -> Vec<Point> {
        points(&self.ground)
    }

    /// What surrounds the returns of the surface.
    pub(super) fn around_surface(&self) -> Vec<Point> {
        points(&self.surface)
    }
}

fn is_none(count: &u64) -> bool {
    *count == 0
}

pub(super) fn places(hull: &ConvexHull) -> Vec<[i32; 3]> {
    hull.sorted().iter().map(|p| [p.x, p.y, p.z]).collect()
}

fn points(places: &[[i32; 3]]) -> Vec<Point> {
    places.iter().map(|&[x, y, z]| Point { x, y, z }).collect()
}
