//! Statistics of a whole point cloud for a model of a part: source of the ground, point spacing, and hulls.

use serde::{Deserialize, Serialize};

use super::filter::spacing;
use super::kinds::GroundFrom;
use super::lengths::MetricFrame;
use super::notes::found_in_classes;
use crate::point_index::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_cloud::CloudInfo;
use terrane_delaunay::ConvexHull;

/// Statistics of a point cloud.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct CloudOverview {
    /// True if the ground is that of its classes.
    pub(crate) by_class: bool,
    /// Spacing of last returns in metres, for a ground method.
    pub(crate) last: f64,
    /// True if the candidates are all returns, as return numbers are not reliable.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) all_returns: bool,
    /// Spacing of first returns in metres, for the surface.
    pub(crate) first: f64,
    /// Steps along the longest edge in a crown, or of the window of a tile of the surface.
    pub(crate) reach: i32,
    /// Most points in the window of a tile of the surface.
    #[serde(default, skip_serializing_if = "is_none")]
    pub(crate) square: u64,
    /// Hull of the ground points of the classes.
    pub(super) ground: Vec<[i32; 3]>,
    /// Hull of the returns of the surface.
    pub(super) surface: Vec<[i32; 3]>,
    /// Notes on the points of a model.
    pub(crate) notes: Vec<String>,
}

impl CloudOverview {
    /// Adds points of the ground classes; sets the source of the ground.
    pub(crate) fn add_classes(&mut self, ground: &PointStore, classes: &[u8]) -> Result<()> {
        self.by_class = ground.count() > 0;
        self.ground = places(&ground.hull()?);
        self.notes.extend(self.by_class.then(|| found_in_classes(ground.count(), classes)));
        Ok(())
    }

    /// Adds the candidates of a ground method.
    pub(crate) fn add_candidates(
        &mut self,
        candidates: &[&PointStore],
        cloud: &CloudInfo,
        ground: GroundFrom,
    ) -> Result<()> {
        self.last = spacing(candidates, &MetricFrame::of(&cloud.crs, &cloud.frame)?);
        self.notes.push(format!("ground: found by {}", ground.method().name()));
        Ok(())
    }

    /// Hull of the ground, if known.
    pub(crate) fn around_ground(&self) -> Vec<Point> {
        points(&self.ground)
    }

    /// Hull of the returns of the surface.
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
