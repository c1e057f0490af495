//! Sources of heights for bands that are not statistics: surfaces through the points, models of the terrain.

use super::extent::CellRequest;
use super::neighbours::CloudSurfaces;
use super::surface_model::PreparedSurfaceModel;
use terrane_base::error::Result;
use terrane_engine::skip_bad::LostPoints;
use terrane_gridding::Statistic;

/// Surfaces through the points, or a model of the terrain.
pub(super) enum HeightSource {
    Surfaces(Box<CloudSurfaces>),
    Model(Box<PreparedSurfaceModel>),
}

impl HeightSource {
    /// The values of a band at the centres of cells, NaN where there is none.
    pub(super) fn values(
        &self,
        statistic: Statistic,
        piece: CellRequest<'_>,
        out: &mut [f64],
    ) -> Result<()> {
        match self {
            Self::Surfaces(surfaces) => surfaces.values(statistic, piece, out),
            Self::Model(model) => model.values(piece, out),
        }
    }

    /// True if unread points were needed.
    pub(super) fn is_exceeded(&self) -> bool {
        match self {
            Self::Surfaces(surfaces) => surfaces.store().is_exceeded(),
            Self::Model(model) => model.is_exceeded(),
        }
    }

    /// Notes on the points used, if not all.
    pub(super) fn notes(&self) -> &[String] {
        match self {
            Self::Surfaces(_) => &[],
            Self::Model(model) => &model.notes,
        }
    }

    /// Files with skipped damage, if they are read for heights only.
    pub(super) fn losses(&self) -> Option<&LostPoints> {
        match self {
            Self::Surfaces(_) => None,
            Self::Model(model) => Some(&model.losses),
        }
    }

    /// Bytes that went to temporary files.
    pub(super) fn spilled_bytes(&self) -> u64 {
        match self {
            Self::Surfaces(surfaces) => surfaces.spilled_bytes(),
            Self::Model(model) => model.spilled_bytes(),
        }
    }
}
