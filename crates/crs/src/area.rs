//! Areas of use in longitude and latitude, in degrees.

/// Tolerance, in degrees, by which data may exceed the area of use of a shift: areas of countries end at coasts and
/// borders.
pub(crate) const NEAR: f64 = 0.25;

/// Distance, in degrees, up to which a shift is used outside its area: corners of map rectangles are often in the
/// sea.
pub(crate) const FAR: f64 = 3.0;

/// West to east, where west exceeds east across 180 degrees, and south to north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AreaOfUse {
    pub(crate) west: f64,
    pub(crate) south: f64,
    pub(crate) east: f64,
    pub(crate) north: f64,
}

impl AreaOfUse {
    fn width(&self) -> f64 {
        match self.east - self.west {
            width if width < 0.0 => width + 360.0,
            width => width,
        }
    }

    /// Approximate size in steradians.
    pub(crate) fn size(&self) -> f64 {
        let [south, north] = [self.south, self.north].map(|latitude| latitude.to_radians().sin());
        self.width().to_radians() * (north - south)
    }

    /// True if it contains `other`, with a tolerance in degrees.
    pub(crate) fn holds(&self, other: &Self, slack: f64) -> bool {
        let width = self.width() + 2.0 * slack;
        let into = (other.west - self.west + slack).rem_euclid(360.0);
        let is_as_wide = width >= 360.0 || into + other.width() <= width;
        is_as_wide && other.south >= self.south - slack && other.north <= self.north + slack
    }

    /// True if it contains a place, with a small tolerance.
    pub(crate) fn has(&self, [longitude, latitude]: [f64; 2]) -> bool {
        let place = Self { west: longitude, south: latitude, east: longitude, north: latitude };
        self.holds(&place, FAR + 1e-6)
    }

    /// True if it extends beyond 180 degrees on either side.
    pub(crate) fn crosses_180(&self) -> bool {
        self.west < -180.0 || self.east > 180.0 || self.east < self.west
    }

    /// Longitude of the centre, from -180 (inclusive) to 180 degrees.
    pub(crate) fn middle(&self) -> f64 {
        (self.west + self.width() / 2.0 + 180.0).rem_euclid(360.0) - 180.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_go_across_180_degrees() {
        let area = AreaOfUse { west: 170.0, south: -50.0, east: -170.0, north: -30.0 };
        assert_eq!((area.width(), area.middle()), (20.0, -180.0));
        for (place, is_in) in [
            ([175.0, -40.0], true),
            ([-175.0, -40.0], true),
            ([185.0, -40.0], true),
            ([-168.1, -40.0], true),
            ([166.5, -40.0], false),
            ([0.0, -40.0], false),
            ([175.0, -53.1], false),
        ] {
            assert_eq!(area.has(place), is_in, "{place:?}");
        }
        let all = AreaOfUse { west: -180.0, south: -90.0, east: 180.0, north: 90.0 };
        assert!(all.holds(&area, 0.0) && !area.holds(&all, 1.0) && all.has([180.0, 90.0]));
    }
}
