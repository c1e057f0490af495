//! Goals of a simplification: a length, an area, a share or number of vertices, or a file size.

use serde::Serialize;

use super::length::Length;
use super::tool::DistanceKind;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Crs;
use terrane_line::SimplifyMethod;
use terrane_line::registry::ToleranceKind;

/// Goal of a simplification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineGoal {
    /// Largest distance of a vertex from the segment that replaces it.
    Tolerance(Length),
    /// Smallest effective area of a triangle in squared units of the data, for methods that use areas.
    Area(f64),
    /// Largest share of the vertices, from 0 to 1.
    Ratio(f64),
    /// Largest number of vertices.
    Count(u64),
    /// Largest size in bytes.
    Size(u64),
}

/// Unit of a searched goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GoalUnit {
    Vertices,
    Bytes,
}

impl LineGoal {
    /// Fails if the method does not support the goal.
    pub(super) fn check(&self, method: &SimplifyMethod) -> Result<()> {
        self.check_number()?;
        match (self, method.bounds) {
            (Self::Tolerance(_), ToleranceKind::Area(_)) => {
                Err(Error::usage(format!("method {} does not bound the distance", method.name))
                    .remedy("pass ‹area› or ‹keep_ratio›, or choose another ‹method›"))
            }
            (Self::Area(_), ToleranceKind::Distance) => {
                Err(Error::usage(format!("method {} uses distances, not areas", method.name))
                    .remedy("pass ‹tolerance›, or ‹method› visvalingam"))
            }
            (Self::Tolerance(_), ToleranceKind::Distance)
            | (Self::Area(_), ToleranceKind::Area(_)) => Ok(()),
            (Self::Ratio(_) | Self::Count(_) | Self::Size(_), _) => Ok(()),
        }
    }

    /// Fails for an invalid length, area or share.
    fn check_number(&self) -> Result<()> {
        let (what, value, most) = match *self {
            Self::Tolerance(Length { value, .. }) => ("tolerance", value, f64::MAX),
            Self::Area(area) => ("area", area, f64::MAX),
            Self::Ratio(share) => ("share of vertices", share, 1.0),
            Self::Count(_) | Self::Size(_) => return Ok(()),
        };
        if (0.0..=most).contains(&value) {
            return Ok(());
        }
        let most = if most == 1.0 { "a value from 0 to 1" } else { "a finite value of 0 or more" };
        Err(Error::usage(format!("{what} {value} is out of range")).remedy(format!("pass {most}")))
    }

    /// Target of the search for a threshold, for a number of vertices; `None` for a given threshold.
    pub(super) fn target(&self, vertices: u64) -> Option<(u64, GoalUnit)> {
        match *self {
            Self::Ratio(share) => {
                Some(((vertices as f64 * share).floor() as u64, GoalUnit::Vertices))
            }
            Self::Count(count) => Some((count, GoalUnit::Vertices)),
            Self::Size(bytes) => Some((bytes, GoalUnit::Bytes)),
            Self::Tolerance(_) | Self::Area(_) => None,
        }
    }
}

/// Metric and threshold of a length for data in `crs`.
///
/// # Errors
/// A length in metres for data of unknown unit; a length in space for data in degrees.
pub fn measured(length: Length, is_space: bool, crs: &Crs) -> Result<(DistanceKind, f64)> {
    let plain = if is_space { DistanceKind::Space } else { DistanceKind::Plane };
    let Some(metres) = length.unit else { return Ok((plain, length.value)) };
    if let Some(unit) = crs.horizontal_metres() {
        return Ok((plain, length.value * metres / unit));
    }
    match crs.horizontal_unit() {
        "degree" if is_space => {
            Err(Error::unsupported("‹metric› 3d on longitudes and latitudes in degrees")
                .remedy("leave out ‹metric› 3d, or transform the data to a projected CRS"))
        }
        "degree" if !crs.spheroid()?.is_none_or(|own| own.is_of_earth()) => {
            let what = "metres on a geographic CRS of a body other than the Earth";
            Err(Error::unsupported(what).remedy("pass ‹tolerance› as a plain number, in degrees"))
        }
        "degree" => Ok((DistanceKind::Geographic, length.value * metres)),
        _ => Err(Error::usage("a tolerance in metres requires a CRS with a known unit")
            .remedy("pass ‹tolerance› as a plain number, in units of the data")),
    }
}

/// An achieved goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MetGoal {
    /// Tolerance in units of the metric, or area.
    pub value: f64,
    /// True for metres on the ellipsoid.
    pub metres: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_told_in_the_units_of_the_data() {
        let crs = |epsg| Crs { epsg: Some(epsg), ..Crs::default() };
        let hundred = Length { value: 100.0, unit: Some(1.0) };
        let told = |length, space, crs: &Crs| measured(length, space, crs).unwrap();
        assert_eq!(told(hundred, false, &crs(28992)), (DistanceKind::Plane, 100.0));
        assert_eq!(told(hundred, true, &crs(28992)), (DistanceKind::Space, 100.0));
        let degrees = Crs { geographic: Some(true), ..crs(4326) };
        assert_eq!(told(hundred, false, &degrees), (DistanceKind::Geographic, 100.0));
        assert!(measured(hundred, true, &degrees).is_err());
        assert!(measured(hundred, false, &Crs::default()).is_err());
        let plain = Length { value: 0.5, unit: None };
        assert_eq!(told(plain, false, &degrees), (DistanceKind::Plane, 0.5));
        let feet = Crs { geographic: Some(false), ..crs(2263) };
        let (_, told) = told(Length { value: 1.0, unit: Some(0.3048) }, false, &feet);
        assert!((told - 1.0).abs() < 1e-5, "{told}");
    }
}
