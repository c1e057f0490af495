//! Tile borders, computed from data on the border only, so both neighbours get the same border.
//!
//! Borders of two levels are not nested, because a border is refined from its corners. They differ by at most
//! the errors of both levels.

use crate::globe::{EllipsoidNormal, Vector};
use crate::level::TileLevel;
use crate::terrain::TerrainSampler;
use crate::tiling::{GlobeTileId, STEPS};

/// A side of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub(crate) enum TileSide {
    West,
    South,
    East,
    North,
}

impl TileSide {
    /// All sides, in the order of files.
    pub(crate) const ALL: [Self; 4] = [Self::West, Self::South, Self::East, Self::North];

    /// Position at a number of steps from the south or the west.
    pub(crate) fn position(self, along: i32) -> [i32; 2] {
        match self {
            Self::West => [0, along],
            Self::South => [along, 0],
            Self::East => [STEPS, along],
            Self::North => [along, STEPS],
        }
    }

    /// Steps of a position along the side.
    pub(crate) fn along(self, [u, v]: [i32; 2]) -> Option<i32> {
        let [across, along, side] = match self {
            Self::West => [u, v, 0],
            Self::South => [v, u, 0],
            Self::East => [u, v, STEPS],
            Self::North => [v, u, STEPS],
        };
        (across == side).then_some(along)
    }
}

/// A candidate vertex on a border.
struct BorderStop {
    along: i32,
    /// Always a vertex.
    is_post: bool,
    /// Position in steps of the level.
    height: i32,
    /// Height in metres before rounding.
    metres: f64,
    upright: EllipsoidNormal,
    point: Vector,
}

/// Vertices of a side: steps along it and heights in steps of the level, from the south or the west. The
/// candidate with the largest error becomes a vertex until all are within the goal of borders, and no candidate
/// below a straight part is further than the goal of tiles from one above it. Vertices one step inside the
/// border may be joined with the ends of the part from anywhere along it; a sample there is off by its distance
/// from the part plus the error of the vertex.
pub(crate) fn vertices(
    tile: GlobeTileId,
    side: TileSide,
    level: &TileLevel,
    ground: &impl TerrainSampler,
) -> Vec<[i32; 2]> {
    let stops = TileBorder { tile, side, level, ground }.stops();
    let mut vertices: Vec<usize> = (0..stops.len()).filter(|i| stops[*i].is_post).collect();
    let mut open: Vec<[usize; 2]> = vertices.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    while let Some([from, to]) = open.pop() {
        if let Some(worst) = worst(&stops, [from, to], [level.border_goal(), level.goal()]) {
            vertices.push(worst);
            open.extend([[from, worst], [worst, to]]);
        }
    }
    vertices.sort_unstable();
    vertices.into_iter().map(|i| [stops[i].along, stops[i].height]).collect()
}

/// Steps to the start of a part.
pub(crate) fn along(part: u32, parts: u32) -> i32 {
    // In whole numbers, as the tile on the other side has to find the same steps.
    let double = 2 * u64::from(part) * STEPS as u64 + u64::from(parts);
    (double / (2 * u64::from(parts))) as i32
}

/// A side of a tile, on the ground.
struct TileBorder<'a, G> {
    tile: GlobeTileId,
    side: TileSide,
    level: &'a TileLevel,
    ground: &'a G,
}

impl<G: TerrainSampler> TileBorder<'_, G> {
    /// Breaks of the ground, and anchor vertices. In voids the fill is used and continues along the same straight
    /// lines, so borders of different levels are as close to each other there as elsewhere.
    fn stops(&self) -> Vec<BorderStop> {
        let Self { tile, side, level, ground } = self;
        let mut stops: Vec<BorderStop> = (0..=level.posts).map(|part| self.post(part)).collect();
        let ends = [0, STEPS].map(|end| self.place(end));
        ground.bends(ends, &mut |place, height| {
            let [u, v] = tile.steps(place).map(|at| at.round() as i32);
            let along = if matches!(side, TileSide::West | TileSide::East) { v } else { u };
            let height = height.unwrap_or_else(|| ground.filled(place));
            stops.push(self.stop(along.clamp(0, STEPS), height, false));
        });
        sort(&mut stops);
        let feet = self.feet(&stops);
        if !feet.is_empty() {
            stops.extend(feet.into_iter().map(|along| self.stop(along, 0.0, false)));
            sort(&mut stops);
        }
        stops
    }

    /// Longitude and latitude at a number of steps.
    fn place(&self, along: i32) -> [f64; 2] {
        self.tile.place(self.side.position(along))
    }

    fn stop(&self, along: i32, metres: f64, is_post: bool) -> BorderStop {
        let height = self.level.steps(metres);
        let upright = EllipsoidNormal::at(self.place(along));
        let point = upright.point(f64::from(height) * self.level.step);
        BorderStop { along, is_post, height, metres, upright, point }
    }

    /// Anchor vertex at the start of a part.
    fn post(&self, part: u32) -> BorderStop {
        let along = along(part, self.level.posts);
        let place = self.place(along);
        let height = self.ground.height(place);
        self.stop(along, height.unwrap_or_else(|| self.ground.filled(place)), true)
    }

    /// Where ground that descends beyond a grid reaches the ellipsoid: between two stops both the height at the
    /// edge and the descent change linearly.
    fn feet(&self, stops: &[BorderStop]) -> Vec<i32> {
        let descents = stops.iter().map(|stop| self.ground.beyond(self.place(stop.along)));
        let descents: Vec<_> = descents.collect();
        let pairs = stops.windows(2).zip(descents.windows(2));
        let mut feet = Vec::new();
        for (two, of) in pairs.filter(|(_, of)| **of != [None; 2]) {
            let ends = [0, 1].map(|end| of[end].unwrap_or([two[end].metres, 0.0]));
            for sign in [1.0, -1.0] {
                let [a, b] = ends.map(|[height, fall]| height - sign * fall);
                if a * b < 0.0 && (b - a).is_finite() {
                    let [from, to] = [two[0].along, two[1].along].map(f64::from);
                    feet.push((from + (to - from) * (a / (a - b))).round() as i32);
                }
            }
        }
        feet
    }
}

/// Sorts stops along the border. At one position an anchor vertex has priority, otherwise the first stop.
fn sort(stops: &mut Vec<BorderStop>) {
    stops.sort_by_key(|stop| (stop.along, !stop.is_post));
    stops.dedup_by_key(|stop| stop.along);
}

/// The stop between two others that is furthest from the straight line between them, if it exceeds one goal, or
/// if stops on both sides of the line are further apart than the other.
fn worst(stops: &[BorderStop], [from, to]: [usize; 2], [max, apart]: [f64; 2]) -> Option<usize> {
    let (a, b) = (&stops[from], &stops[to]);
    let chord = b.point - a.point;
    let (mut worst, mut ends) = ((0.0, from), [0.0_f64; 2]);
    for (i, stop) in (from + 1..to).zip(&stops[from + 1..]) {
        let part = f64::from(stop.along - a.along) / f64::from(b.along - a.along);
        let off = (stop.point - (a.point + chord * part)).dot(stop.upright.normal);
        ends = [ends[0].min(off), ends[1].max(off)];
        if off.abs() > worst.0 {
            worst = (off.abs(), i);
        }
    }
    (worst.0 > max || ends[1] - ends[0] > apart).then_some(worst.1)
}
