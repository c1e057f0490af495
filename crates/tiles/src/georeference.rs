//! Georeference of the samples of a grid, with notes.

use std::path::Path;

use serde::{Deserialize, Serialize};

use terrane_base::error::Result;
use terrane_base::geom::VerticalReference;
use terrane_engine::Resources;
use terrane_engine::globe::{OnGlobe, VerticalShift};
use terrane_globe::{GeodeticBounds, GridGeolocation};
use terrane_raster::{GridInfo, Inputs};

/// Heights above the ellipsoid after adding the geoid.
pub const WITH_GEOID: &str = "ellipsoid, with the geoid added";
/// Ellipsoidal heights.
pub const ON_ELLIPSOID: &str = "ellipsoid";
/// Heights used as given.
pub const AS_GIVEN: &str = "as given";

/// Georeference data for the division of work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct GridFootprint {
    /// Columns and rows.
    pub(super) size: [u32; 2],
    /// Bounds of the samples: west, south, east and north.
    sides: [f64; 4],
    /// Degrees between samples, along the finer axis.
    pub(super) spacing: f64,
}

/// Heights of a grid, with notes.
#[derive(Clone, Debug)]
pub(super) struct HeightReference {
    pub(super) lift: VerticalShift,
    /// Vertical reference as written in the metadata.
    pub(super) from: &'static str,
    pub(super) notes: Vec<String>,
}

impl GridFootprint {
    /// Georeference of a grid.
    pub(super) fn of(chart: &GridGeolocation) -> Self {
        let GeodeticBounds { west, south, east, north } = chart.bounds();
        Self { size: chart.size(), sides: [west, south, east, north], spacing: chart.spacing() }
    }

    /// Where the samples lie.
    pub(super) fn bounds(&self) -> GeodeticBounds {
        let [west, south, east, north] = self.sides;
        GeodeticBounds { west, south, east, north }
    }
}

/// Georeference of the samples of a grid, and its heights.
///
/// # Errors
/// A grid without a georeference; the error names the missing part.
pub(super) fn of(
    info: &GridInfo,
    input: &Inputs,
    geoid: Option<&str>,
    resources: &Resources,
) -> Result<(GridGeolocation, HeightReference)> {
    let (chart, mut notes) = chart(info).map_err(|error| match input.names() {
        [name] => error.in_file(Path::new(name)),
        _ => error,
    })?;
    let (lift, knows_unit) = VerticalShift::of(&info.crs, geoid, resources)?;
    if !knows_unit {
        notes.push("the unit of heights is unknown; metres are assumed".to_owned());
    }
    let is_ellipsoidal = info.crs.heights() == VerticalReference::Ellipsoidal;
    let from = match (lift.has_geoid(), is_ellipsoidal) {
        (true, _) => WITH_GEOID,
        (false, true) => ON_ELLIPSOID,
        (false, false) => AS_GIVEN,
    };
    notes.extend(match (lift.has_geoid(), is_ellipsoidal) {
        (true, _) => Some("heights are converted from the geoid to the ellipsoid".to_owned()),
        (false, true) => None,
        (false, false) => Some(
            "heights are used as ellipsoidal; heights above sea level are off by the geoid undulation (up to \
             100 m): pass ‹geoid›"
                .to_owned(),
        ),
    });
    Ok((chart, HeightReference { lift, from, notes }))
}

fn chart(info: &GridInfo) -> Result<(GridGeolocation, Vec<String>)> {
    let size = [info.width, info.height];
    let (place, notes) = OnGlobe::of(info)?;
    let chart = match place {
        OnGlobe::Straight(map) => GridGeolocation::straight(map, size),
        OnGlobe::Moved(map, operation) => {
            let back = operation.inverse();
            GridGeolocation::bent(
                size,
                |[col, row]| operation.position(map.apply(col, row)),
                |place| back.position(place).map(|[x, y]| map.invert(x, y)),
            )?
        }
    };
    Ok((chart, notes))
}
