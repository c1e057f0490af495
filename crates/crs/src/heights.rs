//! Vertical transformations: none, a change of unit, or a geoid.

use std::sync::Arc;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, VerticalReference};

use super::geoid::Geoid;

/// Transformation of a height.
#[derive(Clone)]
pub(crate) enum HeightOperation {
    /// Multiplies by a factor.
    Times(f64),
    /// From heights above the geoid (with metres per unit) to the ellipsoid of the target.
    ToEllipsoid(Arc<Geoid>, f64),
    /// From the ellipsoid of the source to heights above the geoid (with metres per unit).
    ToGeoid(Arc<Geoid>, f64),
}

impl HeightOperation {
    /// The transformation between the heights of two CRSs; adds notes.
    ///
    /// # Errors
    /// No known transformation between the vertical references.
    pub(crate) fn between(
        [from, to]: [&Crs; 2],
        is_shifted: bool,
        geoid: Option<&Arc<Geoid>>,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let sides = [from.heights(), to.heights()];
        match (sides, geoid) {
            ([from, to], None)
                if from == to && !(is_shifted && to == VerticalReference::Ellipsoidal) =>
            {
                Ok(Self::Times(1.0))
            }
            ([_, VerticalReference::Unknown], None) => Ok(Self::Times(1.0)),
            ([_, VerticalReference::Unknown], Some(_)) => {
                Err(Error::usage("‹geoid› requires a target CRS with a vertical axis")
                    .remedy("use a 3D or compound CRS such as EPSG:4979, or omit ‹geoid›"))
            }
            (
                [
                    VerticalReference::Above { datum: a, metres, is_down, .. },
                    VerticalReference::Above { datum: b, metres: per, is_down: down, .. },
                ],
                None,
            ) if a == b => Ok(Self::Times(signed(metres, is_down) / signed(per, down))),
            (
                [VerticalReference::Above { metres, is_down, .. }, VerticalReference::Ellipsoidal],
                Some(geoid),
            ) => Ok(Self::ToEllipsoid(geoid.clone(), signed(metres, is_down))),
            (
                [VerticalReference::Ellipsoidal, VerticalReference::Above { metres, is_down, .. }],
                Some(geoid),
            ) => Ok(Self::ToGeoid(geoid.clone(), signed(metres, is_down))),
            ([VerticalReference::Unknown, VerticalReference::Ellipsoidal], Some(geoid)) => {
                let unit = from.vertical_metres();
                notes.push(format!(
                    "the vertical datum is missing; heights are assumed to be above the geoid{}",
                    if unit.is_none() { ", in metres" } else { "" }
                ));
                Ok(Self::ToEllipsoid(geoid.clone(), unit.unwrap_or(1.0)))
            }
            ([from, to], geoid) => Err(refusal(&from, &to, geoid.is_some())),
        }
    }

    /// The inverse transformation.
    pub(crate) fn inverse(&self) -> Self {
        match self {
            Self::Times(factor) => Self::Times(1.0 / factor),
            Self::ToEllipsoid(geoid, metres) => Self::ToGeoid(geoid.clone(), *metres),
            Self::ToGeoid(geoid, metres) => Self::ToEllipsoid(geoid.clone(), *metres),
        }
    }
}

/// Metres per unit of heights; negative for depths.
fn signed(metres: f64, is_down: bool) -> f64 {
    if is_down { -metres } else { metres }
}

fn refusal(from: &VerticalReference, to: &VerticalReference, has_geoid: bool) -> Error {
    let [from_text, to_text] = [from, to].map(|heights| match heights {
        VerticalReference::Unknown => "without a vertical datum".to_owned(),
        VerticalReference::Ellipsoidal => "above the ellipsoid".to_owned(),
        VerticalReference::Above { name, .. } => format!("in {name}"),
    });
    let message = format!(
        "no vertical transformation is known: source heights are {from_text}, target heights are {to_text}"
    );
    let remedy = match (from, to, has_geoid) {
        (VerticalReference::Unknown, VerticalReference::Above { .. }, _) => {
            "use a target CRS without heights to keep the source heights"
        }
        (VerticalReference::Ellipsoidal, VerticalReference::Ellipsoidal, _) => {
            "use a target CRS without heights, or transform heights with PROJ first"
        }
        (_, VerticalReference::Ellipsoidal, false) | (VerticalReference::Ellipsoidal, _, false) => {
            "pass a geoid (‹geoid› FILE), or use a target CRS without heights"
        }
        (_, _, true) => "one geoid converts only between geoid heights and ellipsoidal heights",
        _ => "transform heights with PROJ first, or use a target CRS without heights",
    };
    Error::unsupported(message).remedy(remedy)
}
