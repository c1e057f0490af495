//! Areas of longitudes and latitudes, in degrees.

/// How far, in degrees, data may reach beyond the area of a shift as if they were in it: areas of countries
/// end at their coasts and borders.
pub(crate) const NEAR: f64 = 0.25;

/// How far beyond its area a shift is still used: rectangles of maps have corners in the sea.
pub(crate) const FAR: f64 = 3.0;

/// From west to east, which is smaller where it goes across 180 degrees; from south to north.
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

    /// In steradians, nearly.
    pub(crate) fn size(&self) -> f64 {
        let [south, north] = [self.south, self.north].map(|latitude| latitude.to_radians().sin());
        self.width().to_radians() * (north - south)
    }

    /// True where `other` is in it, but for so many degrees.
    pub(crate) fn holds(&self, other: &Self, slack: f64) -> bool {
        let room = self.width() + 2.0 * slack;
        let into = (other.west - self.west + slack).rem_euclid(360.0);
        let is_as_wide = room >= 360.0 || into + other.width() <= room;
        is_as_wide && other.south >= self.south - slack && other.north <= self.north + slack
    }

    /// True where a place is in it, but for a little.
    pub(crate) fn has(&self, [longitude, latitude]: [f64; 2]) -> bool {
        let place = Self { west: longitude, south: latitude, east: longitude, north: latitude };
        self.holds(&place, FAR + 1e-6)
    }

    /// The longitude in its middle, from -180 degrees on and below 180.
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
