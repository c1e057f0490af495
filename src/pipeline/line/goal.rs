//! How much is left out: by a length, an area, a share or number of vertices, or a size of the file.

use serde::Serialize;

use super::tool::Measure;
use crate::error::{Error, Result};
use crate::geom::Crs;
use crate::line::Method;
use crate::line::registry::Bounds;

/// What the result has to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// No vertex farther than this from the segment in its place.
    Tolerance(Length),
    /// No triangle of less than this effective area, in squared units of the data, for methods that
    /// go by area.
    Area(f64),
    /// This share of the vertices, from 0 to 1, or fewer.
    Ratio(f64),
    /// So many vertices, or fewer.
    Count(u64),
    /// So many bytes, or fewer.
    Size(u64),
}

/// A length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length {
    /// How long.
    pub value: f64,
    /// Metres in its unit; `None` for units of the data.
    pub unit: Option<f64>,
}

impl Goal {
    /// Fails when the method cannot be held to it.
    pub(super) fn check(&self, method: &Method) -> Result<()> {
        match (self, method.bounds) {
            (Self::Tolerance(_), Bounds::Area) => {
                Err(Error::usage(format!("{} bounds no distance", method.name))
                    .remedy("pass --area or --keep-ratio, or choose another --method"))
            }
            (Self::Area(_), Bounds::Distance) => {
                Err(Error::usage(format!("{} goes by distance, not by area", method.name))
                    .remedy("pass --tolerance, or --method visvalingam"))
            }
            _ => Ok(()),
        }
    }

    /// The most vertices, of so many, if it says so.
    pub(super) fn most(&self, vertices: u64) -> Option<u64> {
        match *self {
            Self::Ratio(share) => Some((vertices as f64 * share).floor() as u64),
            Self::Count(count) => Some(count),
            _ => None,
        }
    }
}

/// The metric and threshold of a length over data in `crs`.
///
/// # Errors
/// A length in metres over data of an unknown unit, or one measured in space over degrees.
pub(in crate::pipeline) fn measured(
    length: Length,
    is_space: bool,
    crs: &Crs,
) -> Result<(Measure, f64)> {
    let plain = if is_space { Measure::Space } else { Measure::Plane };
    let Some(metres) = length.unit else { return Ok((plain, length.value)) };
    let by = |unit: f64| Ok((plain, length.value * metres / unit));
    match crs.horizontal_unit() {
        "metre" => by(1.0),
        "foot" => by(0.3048),
        "US survey foot" => by(1200.0 / 3937.0),
        "degree" if is_space => Err(Error::unsupported("heights beside longitudes in degrees")
            .remedy("leave out --metric 3d, or bring the data into a projected system")),
        "degree" => Ok((Measure::Geographic, length.value * metres)),
        _ => Err(Error::usage("the data name no unit that metres could be told in")
            .remedy("pass --tolerance as a plain number, in units of the data")),
    }
}

/// A goal as it was met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Threshold {
    /// The tolerance in units of the metric, or the area.
    pub value: f64,
    /// True for metres on the ellipsoid.
    pub metres: bool,
}

/// The smallest threshold for which `fits` holds, about: 48 halvings between the smallest and the
/// largest that may matter for data `extent` wide. `fits` has to hold from some threshold on.
///
/// # Errors
/// Those of `fits`; a goal that not even the largest threshold meets.
pub(super) fn smallest(extent: f64, mut fits: impl FnMut(f64) -> Result<bool>) -> Result<f64> {
    const STEPS: u32 = 48;
    if fits(0.0)? {
        return Ok(0.0);
    }
    let most = (extent * 4.0).max(f64::MIN_POSITIVE);
    if !fits(most)? {
        return Err(Error::usage(
            "so little cannot be met: the ends of lines and the corners of \
            the smallest rings are more",
        )
        .remedy("ask for more, or pass --collapse drop"));
    }
    let (mut low, mut high) = ((most * 1e-12).ln(), most.ln());
    for _ in 0..STEPS {
        let middle = f64::midpoint(low, high);
        match fits(middle.exp())? {
            true => high = middle,
            false => low = middle,
        }
    }
    Ok(high.exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_told_in_the_units_of_the_data() {
        let crs = |epsg| Crs { epsg: Some(epsg), ..Crs::default() };
        let hundred = Length { value: 100.0, unit: Some(1.0) };
        let told = |length, space, crs: &Crs| measured(length, space, crs).unwrap();
        assert_eq!(told(hundred, false, &crs(28992)), (Measure::Plane, 100.0));
        assert_eq!(told(hundred, true, &crs(28992)), (Measure::Space, 100.0));
        let degrees = Crs { geographic: Some(true), ..crs(4326) };
        assert_eq!(told(hundred, false, &degrees), (Measure::Geographic, 100.0));
        assert!(measured(hundred, true, &degrees).is_err());
        assert!(measured(hundred, false, &Crs::default()).is_err());
        let plain = Length { value: 0.5, unit: None };
        assert_eq!(told(plain, false, &degrees), (Measure::Plane, 0.5));
        let feet = Crs { geographic: Some(false), ..crs(2263) };
        let (_, told) = told(Length { value: 1.0, unit: Some(0.3048) }, false, &feet);
        assert!((told - 1.0).abs() < 1e-5, "{told}");
    }

    #[test]
    fn the_smallest_threshold_is_found() {
        let found = smallest(1000.0, |t| Ok(t >= 0.37)).unwrap();
        assert!((0.37..0.3701).contains(&found), "{found}");
        assert_eq!(smallest(1.0, |_| Ok(true)).unwrap(), 0.0);
        assert!(smallest(1.0, |_| Ok(false)).is_err());
    }
}
