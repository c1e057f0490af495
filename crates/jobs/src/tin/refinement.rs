//! How a mesh of a grid is refined, whatever its goal and wherever it goes.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::angles::angle_bound;
use super::job::Goal;
use super::worker::{line_bytes, worker_bytes};
use crate::Resources;
use crate::kept::Features;
use terrane_base::bound::Bound;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_raster::Water;
use terrane_tin::Spec;

/// What is asked of a mesh beside its goal. A plan notes it as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refinement {
    /// Of what the tolerance is promised.
    pub bound: Bound,
    /// Reference greedy instead of adaptive strides.
    pub strict: bool,
    /// Run the drop pass.
    pub drop: bool,
    /// Let vertices lie above or below their samples.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fit: bool,
    /// Let triangles be others than Delaunay ones.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub data_dependent: bool,
    /// The smallest angle that triangles may have in plan, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_angle: Option<f64>,
    /// The name of a file of features; the sample nearest to each point of it stays a vertex.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep_points: Option<String>,
    /// The name of a file of lines and polygons that edges follow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<String>,
}

impl Default for Refinement {
    fn default() -> Self {
        Self {
            bound: Bound::default(),
            strict: false,
            drop: true,
            fit: false,
            data_dependent: false,
            min_angle: None,
            keep_points: None,
            breaklines: None,
        }
    }
}

impl Refinement {
    /// What the kernel is told on a grid with this map, errors measured; the tolerance is yet to be found.
    ///
    /// # Errors
    /// An angle that the cells do not have; redundant vertices that are to be kept, and not.
    pub(super) fn spec(&self, map: &Affine) -> Result<Spec> {
        if self.data_dependent && !self.drop {
            let message = "which triangles are not Delaunay is found by dropping vertices";
            return Err(Error::usage(message)
                .remedy("leave one of ‹triangulation› data-dependent and ‹no_drop› out"));
        }
        Ok(Spec {
            tolerance: 0.0,
            bound: self.bound,
            strict: self.strict,
            drop: self.drop,
            fit: self.fit,
            data_dependent: self.data_dependent,
            min_angle: angle_bound(self.min_angle, map)?,
            single_precision: None,
            measure: true,
        })
    }

    /// Reads the points and breaklines to keep.
    ///
    /// # Errors
    /// Files that cannot be read; breaklines where angles are limited, as they may meet under any; level water
    /// where heights may be others.
    pub(super) fn features(
        &self,
        water: Option<&Arc<Water>>,
        resources: &Resources,
    ) -> Result<Features> {
        if self.breaklines.is_some() && self.min_angle.is_some() {
            let message = "breaklines may meet under any angle, so there is no smallest one";
            return Err(Error::usage(message)
                .remedy("leave one of ‹breaklines› and ‹min_angle› out, or pass ‹keep_points›"));
        }
        if water.is_some() && self.min_angle.is_some() {
            let message = "banks of water may meet under any angle, so there is no smallest one";
            return Err(Error::usage(message).remedy("leave one of ‹water› and ‹min_angle› out"));
        }
        if water.is_some() && self.fit {
            let message = "vertices above or below their samples would not leave water level";
            return Err(Error::usage(message).remedy("leave one of ‹water› and ‹fit› out"));
        }
        let [points, lines] = self.files();
        Features::read(points, lines, water, resources)
    }

    /// The names of the files of points and of breaklines.
    pub(super) fn files(&self) -> [Option<&str>; 2] {
        [&self.keep_points, &self.breaklines].map(Option::as_deref)
    }

    /// Most bytes of a worker on tiles of `tile` cells, without what all hold together, that `follows` lines or
    /// not.
    pub(super) fn worker_bytes(&self, goal: Goal, tile: u32, follows: bool) -> u64 {
        // Any sample may become a vertex to reach these.
        let keeps_all = goal == Goal::MaxError(0.0) || self.min_angle.is_some();
        let lines = if follows { line_bytes(tile) } else { 0 };
        lines + worker_bytes(tile, keeps_all, self.fit)
    }
}
