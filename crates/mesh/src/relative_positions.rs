//! Positions in f32 relative to an origin with a scale, for formats without f64.

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point3;

/// Converts world positions to f32 positions relative to an origin, and tracks their bounding box.
pub(super) struct LocalCoordinates {
    origin: Point3,
    scale: Point3,
    low: [f32; 3],
    high: [f32; 3],
}

impl LocalCoordinates {
    /// Positions relative to `origin`, with `scale` stored units per world unit.
    pub(super) fn new(origin: Point3, scale: Point3) -> Result<Self> {
        if origin.iter().any(|c| !c.is_finite()) {
            return Err(Error::usage("the origin of the mesh is not finite"));
        }
        if !is_scale(&scale) {
            return Err(Error::usage("the scale of the mesh is not positive and finite"));
        }
        Ok(Self { origin, scale, low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] })
    }

    /// The origin.
    pub(super) fn origin(&self) -> Point3 {
        self.origin
    }

    /// The scale, if it is not 1.
    pub(super) fn scale(&self) -> Option<Point3> {
        Some(self.scale).filter(|scale| *scale != [1.0; 3])
    }

    /// Minimum and maximum coordinates so far; (inf, -inf) without positions.
    pub(super) fn bounds(&self) -> [[f32; 3]; 2] {
        [self.low, self.high]
    }

    /// The position relative to the origin, rounded to f32.
    pub(super) fn place(&mut self, point: &Point3) -> [f32; 3] {
        let local: [f32; 3] =
            std::array::from_fn(|i| ((point[i] - self.origin[i]) * self.scale[i]) as f32);
        for (i, &c) in local.iter().enumerate() {
            self.low[i] = self.low[i].min(c);
            self.high[i] = self.high[i].max(c);
        }
        local
    }

    /// The corners of a triangle, each as by [`place`](Self::place).
    pub(super) fn triangle(&mut self, corners: &[Point3; 3]) -> [[f32; 3]; 3] {
        corners.each_ref().map(|point| self.place(point))
    }

    /// Fails if a position exceeded the range of f32.
    pub(super) fn check(&self) -> Result<()> {
        let out = self.low.contains(&f32::NEG_INFINITY) || self.high.contains(&f32::INFINITY);
        if out {
            let message = "a position exceeds the range of f32";
            return Err(Error::new(ErrorKind::CannotWrite, message)
                .remedy("write PLY or OBJ, or a smaller ‹size›, ‹scale› or ‹exaggerate›"));
        }
        Ok(())
    }
}

/// True for positive, finite factors.
pub(super) fn is_scale(scale: &Point3) -> bool {
    scale.iter().all(|factor| factor.is_normal() && *factor > 0.0)
}

/// World position of a stored position.
pub(super) fn to_world(stored: Point3, origin: Point3, scale: Point3) -> Point3 {
    std::array::from_fn(|i| origin[i] + stored[i] / scale[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_bounds_and_refuses_what_f32_cannot_hold() {
        let mut local = LocalCoordinates::new([500_000.0, 4e6, 0.0], [1.0; 3]).unwrap();
        assert!(local.check().is_ok(), "no position is no failure");
        assert_eq!(local.place(&[500_001.5, 4e6 - 2.0, 7.0]), [1.5, -2.0, 7.0]);
        assert_eq!(local.place(&[499_999.0, 4e6, 9.0]), [-1.0, 0.0, 9.0]);
        assert_eq!(local.bounds(), [[-1.0, -2.0, 7.0], [1.5, 0.0, 9.0]]);
        assert!(local.check().is_ok());
        local.place(&[0.0, 0.0, -1e39]);
        assert_eq!(local.check().unwrap_err().kind(), ErrorKind::CannotWrite);
        assert!(LocalCoordinates::new([f64::NAN, 0.0, 0.0], [1.0; 3]).is_err());
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(LocalCoordinates::new([0.0; 3], [1.0, scale, 1.0]).is_err(), "{scale}");
        }
        let mut scaled =
            LocalCoordinates::new([7.5, 46.5, 0.0], [75_000.0, 111_000.0, 1.0]).unwrap();
        let stored = scaled.place(&[8.5, 45.5, 12.0]).map(f64::from);
        assert_eq!(stored, [75_000.0, -111_000.0, 12.0]);
        let back = to_world(stored, [7.5, 46.5, 0.0], [75_000.0, 111_000.0, 1.0]);
        assert_eq!(back, [8.5, 45.5, 12.0]);
    }
}
