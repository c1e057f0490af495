//! Lengths of a point cloud in metres, the unit of the thresholds of terrain models.

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point, PointFrame};

/// Steps of a frame in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MetricFrame {
    /// A step along each axis.
    pub(crate) step: [f64; 3],
    /// True if the unit is unknown, and metres are assumed.
    pub(crate) is_guess: bool,
}

impl MetricFrame {
    /// The note on assumed metres.
    pub(crate) const GUESS: &str = "the point cloud lacks a unit of length; metres are assumed";

    /// From the units of `crs`; heights without a unit are in that of x and y.
    ///
    /// # Errors
    /// Degrees, or an unknown vertical unit.
    pub(crate) fn of(crs: &Crs, frame: &PointFrame) -> Result<Self> {
        let side = crs.horizontal_metres();
        if crs.horizontal_unit() == "degree" {
            return Err(no_length("degree"));
        }
        let rise = match (crs.vertical_metres(), &crs.vertical_unit) {
            (None, Some(unit)) => return Err(no_length(unit)),
            (rise, _) => rise.or(side).unwrap_or(1.0),
        };
        let ([x, y, z], across) = (frame.scale, side.unwrap_or(1.0));
        Ok(Self { step: [x * across, y * across, z * rise], is_guess: side.is_none() })
    }

    /// How wide and high the box around a cloud is.
    pub(crate) fn extent(&self, bounds: Option<[Point; 2]>) -> [f64; 2] {
        let Some([low, high]) = bounds else { return [0.0; 2] };
        let steps = [high.x.abs_diff(low.x), high.y.abs_diff(low.y)];
        [0, 1].map(|i| f64::from(steps[i]) * self.step[i])
    }
}

fn no_length(unit: &str) -> Error {
    let message = format!("the unit of the coordinates is {unit:?}, expected metres or feet");
    Error::unsupported(message)
        .remedy("reproject the point cloud (‹dtm› of classified ground points works in any unit)")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(crs: &Crs) -> Result<MetricFrame> {
        MetricFrame::of(crs, &PointFrame { scale: [0.01, 0.02, 0.1], offset: [0.0; 3] })
    }

    #[test]
    fn units_are_converted_and_degrees_refused() {
        let crs = |epsg, unit: Option<&str>| Crs {
            epsg,
            vertical_unit: unit.map(str::to_owned),
            ..Crs::default()
        };
        let plain = steps(&crs(None, None)).unwrap();
        assert_eq!(plain, MetricFrame { step: [0.01, 0.02, 0.1], is_guess: true });
        let mixed = steps(&crs(Some(32631), Some("foot"))).unwrap();
        assert_eq!(mixed, MetricFrame { step: [0.01, 0.02, 0.1 * 0.3048], is_guess: false });
        let feet = steps(&crs(Some(2263), None)).unwrap();
        assert!(
            feet.step.iter().zip([0.003048, 0.006096, 0.03048]).all(|(a, b)| (a - b).abs() < 1e-6)
        );
        let degrees = Crs { geographic: Some(true), ..Crs::default() };
        assert!(steps(&degrees).unwrap_err().to_string().contains("degree"));
        assert!(
            steps(&crs(Some(32631), Some("sazhen"))).unwrap_err().to_string().contains("sazhen")
        );
    }
}
