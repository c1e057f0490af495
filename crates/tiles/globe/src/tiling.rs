//! Tiling of the globe: two tiles of 180 degrees at level 0, each divided into four at every further level.

/// Steps of positions and heights across a tile.
pub const STEPS: i32 = 32_767;

/// Geometric error of level 0 in metres: a quarter of the equator over 65 samples, for each of two tiles.
const LEVEL_ZERO: f64 = 77_067.339_879_863_53;

/// The deepest level; tiles are 19 m wide there.
pub const DEEPEST: u8 = 20;

/// Geometric error of a level in metres.
pub fn level_error(level: u8) -> f64 {
    LEVEL_ZERO / f64::from(1_u32 << level)
}

/// Width and height of a tile in degrees.
pub fn degrees(level: u8) -> f64 {
    180.0 / f64::from(1_u32 << level)
}

/// A tile: `x` from longitude -180 to the east, `y` from the south pole to the north.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GlobeTileId {
    /// From 0 to [`DEEPEST`].
    pub level: u8,
    /// Below 2^(level + 1).
    pub x: u32,
    /// Below 2^level.
    pub y: u32,
}

/// A rectangle of longitudes and latitudes, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct GeodeticBounds {
    pub west: f64,
    pub south: f64,
    pub east: f64,
    pub north: f64,
}

impl GeodeticBounds {
    /// True for a place within it or on its border.
    #[inline]
    pub fn holds(&self, [lon, lat]: [f64; 2]) -> bool {
        self.west <= lon && lon <= self.east && self.south <= lat && lat <= self.north
    }

    /// Nearest position inside, along both axes.
    pub(crate) fn nearest(&self, [lon, lat]: [f64; 2]) -> [f64; 2] {
        [lon.clamp(self.west, self.east), lat.clamp(self.south, self.north)]
    }

    /// The rectangle enlarged by this many degrees on each side.
    pub fn grown(&self, degrees: f64) -> Self {
        Self {
            west: self.west - degrees,
            south: self.south - degrees,
            east: self.east + degrees,
            north: self.north + degrees,
        }
    }
}

impl GlobeTileId {
    /// Bounds; exact.
    pub fn bounds(self) -> GeodeticBounds {
        let width = degrees(self.level);
        let [west, south] = [-180.0 + f64::from(self.x) * width, -90.0 + f64::from(self.y) * width];
        GeodeticBounds { west, south, east: west + width, north: south + width }
    }

    /// Position at steps from the west and the south.
    #[inline]
    pub fn place(self, [u, v]: [i32; 2]) -> [f64; 2] {
        let (bounds, width) = (self.bounds(), degrees(self.level));
        let sides = [(bounds.west, bounds.east, u), (bounds.south, bounds.north, v)];
        sides.map(|(from, to, steps)| match steps {
            // Bit-identical to the neighbouring tile.
            STEPS => to,
            _ => from + width * (f64::from(steps) / f64::from(STEPS)),
        })
    }

    /// Steps of a position from the west and the south.
    #[inline]
    pub fn steps(self, [lon, lat]: [f64; 2]) -> [f64; 2] {
        let (bounds, steps) = (self.bounds(), f64::from(STEPS) / degrees(self.level));
        [(lon - bounds.west) * steps, (lat - bounds.south) * steps]
    }

    /// The four children.
    pub fn children(self) -> [Self; 4] {
        let [x, y] = [2 * self.x, 2 * self.y];
        [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|[x, y]| Self {
            level: self.level + 1,
            x,
            y,
        })
    }

    /// The parent.
    pub fn parent(self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        Some(Self { level, x: self.x / 2, y: self.y / 2 })
    }

    /// Tiles of a level whose closed rectangles intersect `bounds`: first and last column and row.
    pub fn meeting(level: u8, bounds: &GeodeticBounds) -> [[u32; 2]; 2] {
        let (width, rows) = (degrees(level), 1 << level);
        let GeodeticBounds { west, south, east, north } = *bounds;
        let axes = [(west, east, -180.0, 2 * rows), (south, north, -90.0, rows)];
        axes.map(|(low, high, from, count)| {
            let first = ((low - from) / width).ceil() - 1.0;
            let last = ((high - from) / width).floor();
            [first, last].map(|tile| tile.clamp(0.0, f64::from(count - 1)) as u32)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_of_a_level_share_their_borders_to_the_bit() {
        for level in 0..=DEEPEST {
            let here = GlobeTileId { level, x: (1 << level) / 3, y: (1 << level) / 3 };
            let east = GlobeTileId { x: here.x + 1, ..here };
            assert_eq!(here.bounds().east, east.bounds().west);
            for v in [0, 1, 1000, STEPS - 1, STEPS] {
                assert_eq!(here.place([STEPS, v]), east.place([0, v]));
            }
            if level > 0 {
                assert!(here.parent().unwrap().children().contains(&here));
            }
        }
        assert_eq!(GlobeTileId { level: 0, x: 1, y: 0 }.parent(), None);
    }

    #[test]
    fn tiles_that_meet_a_rectangle_are_those_whose_closed_ones_do() {
        let bounds = GeodeticBounds { west: 0.0, south: -0.1, east: 1.0, north: 45.0 };
        for level in 0..9 {
            let [[west, east], [south, north]] = GlobeTileId::meeting(level, &bounds);
            for x in 0..2 << level {
                for y in 0..1 << level {
                    let b = GlobeTileId { level, x, y }.bounds();
                    let meets = b.west <= bounds.east
                        && b.east >= bounds.west
                        && b.south <= bounds.north
                        && b.north >= bounds.south;
                    let found = (west..=east).contains(&x) && (south..=north).contains(&y);
                    assert_eq!(meets, found, "{level} {x} {y}");
                }
            }
        }
    }

    #[test]
    fn places_and_steps_are_each_others_inverse() {
        let tile = GlobeTileId { level: 9, x: 531, y: 389 };
        for at in [[0, 0], [STEPS, 7], [123, 20_000]] {
            let [u, v] = tile.steps(tile.place(at));
            assert!((u - f64::from(at[0])).abs() < 1e-6 && (v - f64::from(at[1])).abs() < 1e-6);
        }
    }
}
