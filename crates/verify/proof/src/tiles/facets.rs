//! The surface of a tile as a viewer draws it, and the vertical distances of samples from it.
//!
//! The triangle that the normal of a sample meets is found by walking: across any side that has the normal on its outer
//! side, until there is none. Beyond the border of the tile the last triangle counts. The side of an edge is the sign of a
//! determinant of the ends of the edge and the normal. Along a parallel it is a sum of a cosine and a sine with constant
//! factors, and so is the height at which the normal meets the plane of the triangle. Both triangles of an edge compute the
//! same number with opposite signs, so a walk does not oscillate. Edges are straight and parallels are not: seen from a
//! sample, a tile is not convex, and a walk may end anywhere at its border. It continues along the border, to the triangle
//! whose side the meridian of the sample passes.
//!
//! Degenerate triangles, with two corners at the same position, are met by no normal and are left out: rounded positions may
//! coincide. So do vertices at a pole, whatever their heights; the furthest of them counts.
//!
//! Rounding of the position of a sample moves it up or down a slope. Each sample therefore has a lower and an upper bound of
//! its distance, which matters where walls are a thousand times as high as they are wide. Factors relative to the centre of
//! the earth do not resolve such walls either: a sample on a wall, or so near a side that rounding decides, is measured in a
//! frame of its own ([`ProofEastNorthUp`]), with all triangles that may contain it. Where positions are rounded to a
//! lattice, triangles may be turned over, and the surface then overlaps itself: the furthest of the triangles that a normal
//! meets counts.

mod sides;

use super::decode::DecodedTile;
use super::ellipsoid::{
    A, B, ProofMeridian, ProofParallel, Vector, cross, dot, latitude, length, minus, plus, position,
};
use super::tiling::ProofTileId;
use sides::{CollapsedSides, poles, twins};

/// Cosine of a latitude below which it counts as a pole.
const POLAR: f64 = 1e-12;

/// No neighbour.
const NONE: u32 = u32::MAX;

/// Peak bytes of a vertex and its two triangles.
pub const BYTES_PER_VERTEX: usize =
    2 * size_of::<ProofTileFacet>() + 2 * size_of::<Vector>() + 6 * size_of::<[u32; 3]>();

/// Rounding of the distance of a normal from a side, relative to the centre of the earth, in metres.
const ROUNDING: f64 = 32.0 * f64::EPSILON * A;
/// Cosine of the slope from which on a triangle is a wall.
const WALL: f64 = 1.0 / 16.0;
/// Cosine of the slope from which on a triangle may be turned over, as seen from some sample.
const TURNED: f64 = 1e-4;

/// A triangle.
#[derive(Clone, Debug)]
struct ProofTileFacet {
    /// By side: the factor of the normal in the determinant.
    sides: [Vector; 3],
    /// By side: x and y, for the term of the determinant by the flattening of the ellipsoid.
    flat: [[f64; 2]; 3],
    /// Normal of its plane, and the dot product of the normal with any point of the plane.
    plane: (Vector, f64),
    /// Neighbours, by side.
    neighbours: [u32; 3],
    /// By side: whether it is more along a parallel than along a meridian.
    on_parallel: [bool; 3],
    /// By side: metres; infinite for walls, else minus infinity at a border.
    lengths: [f64; 3],
    corners: [u32; 3],
}

/// The triangles of a tile, in space.
#[derive(Clone, Debug)]
pub struct TileFacets {
    facets: Vec<ProofTileFacet>,
    positions: Vec<Vector>,
    /// Triangles that may be turned over.
    turned: Vec<u32>,
    /// Lowest and highest vertex at the south pole and at the north pole.
    poles: [Option<[f64; 2]>; 2],
}

/// Errors of a run of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleRunErrors {
    /// Samples with a height.
    pub count: u64,
    /// Samples further from the surface than a limit.
    pub over: u64,
    /// Sum of squared distances.
    pub squares: f64,
    /// The largest distance, and the index of its first sample.
    pub max: Option<(f64, usize)>,
    /// Largest lower bound and largest upper bound of a distance, given the rounding of positions.
    pub ends: [f64; 2],
}

/// A triangle on a parallel: factors of the determinants of its sides, and of its plane.
struct ProofParallelFacet {
    sides: [[f64; 3]; 3],
    lengths: [f64; 3],
    plane: [f64; 4],
    parallel: ProofParallel,
    /// Length of the normal of the plane.
    length: f64,
}

impl TileFacets {
    /// The triangles of a tile. `positions` are those of its vertices.
    pub fn new(tile: &DecodedTile, positions: &[Vector]) -> Self {
        let origin = positions.first().copied().unwrap_or_default();
        let poles = poles(positions);
        let mut collapsed = CollapsedSides::of(&tile.triangles, positions, &poles);
        if collapsed.0.iter().all(Option::is_some) {
            // A tile without any area is still measured, and is infinitely far from every sample.
            collapsed.0.fill(None);
        }
        let twins = twins(&tile.triangles);
        let mut facets: Vec<ProofTileFacet> = Vec::new();
        let mut numbers = vec![NONE; tile.triangles.len()];
        for (triangle, &corners) in tile.triangles.iter().enumerate() {
            if collapsed.0[triangle].is_none() {
                numbers[triangle] = facets.len() as u32;
                facets.push(ProofTileFacet::new(corners, positions, origin));
            }
        }
        for (triangle, &number) in numbers.iter().enumerate().filter(|(_, at)| **at != NONE) {
            facets[number as usize].neighbours = std::array::from_fn(|side| {
                let other = collapsed.beyond(&twins, triangle, side);
                other.map_or(NONE, |other| numbers[other])
            });
        }
        facets.iter_mut().for_each(|facet| facet.open_borders(positions));
        let poles = poles.map(|vertices| {
            let heights = vertices.iter().map(|&vertex| positions[vertex as usize][2].abs() - B);
            heights.map(|z| [z; 2]).reduce(|[low, high], [z, _]| [low.min(z), high.max(z)])
        });
        let turned = (0..).zip(&facets).filter(|(_, facet)| facet.is_turned(positions));
        let turned = turned.map(|(number, _)| number).collect();
        Self { facets, positions: positions.to_vec(), turned, poles }
    }

    /// Positions of the vertices of a tile.
    pub fn positions(id: ProofTileId, tile: &DecodedTile) -> Vec<Vector> {
        if !tile.placed.is_empty() {
            return tile.placed.clone();
        }
        let vertices = tile.vertices.iter();
        vertices
            .map(|&vertex| {
                let [longitude, latitude] = DecodedTile::place(id, vertex);
                position(longitude, latitude, tile.height(vertex))
            })
            .collect()
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        self.facets.len() * size_of::<ProofTileFacet>()
            + self.positions.len() * size_of::<Vector>()
            + size_of::<Self>()
    }

    /// Measures the samples of a row at these longitudes; voids are NaN. The search begins at the triangle `from`, which
    /// becomes that of the first sample. `rounded` is the error of positions in metres. The distance from a triangle
    /// without area is infinite.
    pub fn row(
        &self,
        from: &mut u32,
        parallel: &ProofParallel,
        meridians: &[ProofMeridian],
        heights: &[f64],
        limit: f64,
        rounded: f64,
    ) -> SampleRunErrors {
        if parallel.cos.abs() < POLAR {
            return self.at_pole(parallel.sin > 0.0, heights, limit);
        }
        let mut errors = SampleRunErrors::default();
        let mut now = *from;
        let Some(facet) = self.facets.get(now as usize) else { return errors };
        let mut row = facet.on(parallel);
        for (index, (&at, &height)) in meridians.iter().zip(heights).enumerate() {
            if height.is_nan() {
                continue;
            }
            if !self.is_here(now, &row, at) {
                now = self.walk(now, parallel, at);
                row = self.facets[now as usize].on(parallel);
            }
            let is_simple = self.turned.is_empty() && row.is_surely_in(at, ROUNDING + rounded);
            let distance = if is_simple {
                let [surface, ratio] = row.height(at);
                BoundedDistance::of((surface - height).abs(), ratio * rounded)
            } else {
                let frame = ProofEastNorthUp::new(parallel, at, height);
                let here = self.walk_in(now, &frame);
                if here != now {
                    now = here;
                    row = self.facets[now as usize].on(parallel);
                }
                let nearest = self.nearest(now, &frame, rounded);
                if self.is_folded(&frame, rounded) {
                    self.furthest(nearest, &frame, rounded)
                } else {
                    nearest
                }
            };
            if errors.count == 0 {
                *from = now;
            }
            errors.add(index, distance, limit);
        }
        errors
    }

    /// Measures samples at a pole, where all vertices are at one point: the furthest counts.
    fn at_pole(&self, is_north: bool, heights: &[f64], limit: f64) -> SampleRunErrors {
        let mut errors = SampleRunErrors::default();
        let Some([low, high]) = self.poles[usize::from(is_north)] else { return errors };
        for (index, &height) in heights.iter().enumerate() {
            if !height.is_nan() {
                let distance = (height - low).abs().max((height - high).abs());
                let distance = BoundedDistance { distance, lower: distance, upper: distance };
                errors.add(index, distance, limit);
            }
        }
        errors
    }

    /// The corners of a triangle in the frame of a sample.
    fn corners_in(&self, frame: &ProofEastNorthUp, facet: &ProofTileFacet) -> [Vector; 3] {
        facet.corners.map(|corner| frame.local(self.positions[corner as usize]))
    }

    /// The neighbour across the first side, from `turn` on, that has the normal of a sample on its outer side.
    fn way_out(
        &self,
        frame: &ProofEastNorthUp,
        facet: &ProofTileFacet,
        turn: usize,
    ) -> Option<u32> {
        let corners = self.corners_in(frame, facet);
        let mut sides = (0..3).map(|k| (turn + k) % 3).filter(|&k| !facet.is_border(k));
        let out = sides.find(|&k| turn_of(corners[k], corners[(k + 1) % 3]) < 0.0);
        out.map(|side| facet.neighbours[side])
    }

    /// The triangle that the normal of a sample meets, in the frame of the sample.
    fn walk_in(&self, from: u32, frame: &ProofEastNorthUp) -> u32 {
        let mut now = from;
        for turn in 0..=self.facets.len() {
            match self.way_out(frame, &self.facets[now as usize], turn) {
                Some(neighbour) => now = neighbour,
                None => return now,
            }
        }
        let mut all = (0..).zip(&self.facets);
        all.find(|(_, facet)| self.way_out(frame, facet, 0).is_none()).map_or(now, |(at, _)| at)
    }

    /// Distance of a sample from a triangle. The bounds include all connected triangles that may contain the sample.
    fn nearest(&self, facet: u32, frame: &ProofEastNorthUp, rounded: f64) -> BoundedDistance {
        let mut connected = vec![facet];
        let mut all: Option<BoundedDistance> = None;
        let mut next = 0;
        while let Some(facet) = connected.get(next).map(|&number| &self.facets[number as usize]) {
            next += 1;
            let corners = self.corners_in(frame, facet);
            let [height, ratio] = plane(corners);
            let distance = BoundedDistance::of(height.abs(), ratio * rounded);
            all = Some(all.map_or(distance, |all| BoundedDistance {
                lower: all.lower.min(distance.lower),
                upper: all.upper.max(distance.upper),
                ..all
            }));
            for (k, &neighbour) in facet.neighbours.iter().enumerate() {
                let is_near = from_side(corners[k], corners[(k + 1) % 3]) <= rounded;
                if neighbour != NONE && is_near && !connected.contains(&neighbour) {
                    connected.push(neighbour);
                }
            }
        }
        all.unwrap_or_default()
    }

    /// Whether a triangle that is turned over may lie above or below a sample.
    fn is_folded(&self, frame: &ProofEastNorthUp, rounded: f64) -> bool {
        let turned = self.turned.iter().map(|&number| &self.facets[number as usize]);
        turned
            .map(|facet| self.corners_in(frame, facet))
            .any(|corners| is_met(corners, rounded).is_some())
    }

    /// Distance of a sample from the furthest triangle above and below it; at least `nearest`.
    fn furthest(
        &self,
        nearest: BoundedDistance,
        frame: &ProofEastNorthUp,
        rounded: f64,
    ) -> BoundedDistance {
        let all = self.facets.iter().map(|facet| self.corners_in(frame, facet));
        let met = all.filter_map(|corners| Some((corners, is_met(corners, rounded)?)));
        met.fold(nearest, |furthest, (corners, is_sure)| {
            let [height, ratio] = plane(corners);
            let possible = BoundedDistance::of(height.abs(), ratio * rounded);
            let sure = if is_sure { possible } else { BoundedDistance::default() };
            BoundedDistance {
                distance: furthest.distance.max(sure.distance),
                lower: furthest.lower.max(sure.lower),
                upper: furthest.upper.max(possible.upper),
            }
        })
    }

    /// The triangle that the normal meets, or the last one before the border.
    fn walk(&self, from: u32, parallel: &ProofParallel, at: ProofMeridian) -> u32 {
        let mut now = from;
        for step in 0..=self.facets.len() {
            let facet = &self.facets[now as usize];
            let row = facet.on(parallel);
            // Begins with another side each time, as a walk could go round in circles.
            let mut sides = (0..3).map(|k| (step + k) % 3);
            let out = sides.find(|&k| !facet.is_border(k) && row.side(k, at) < 0.0);
            let neighbour = out.map(|side| facet.neighbours[side]);
            match neighbour.or_else(|| self.along_border(now, &row, at)) {
                Some(next) => now = next,
                None => return now,
            }
        }
        self.search(parallel, at).unwrap_or(now)
    }

    /// The triangle that the normal meets, by testing every triangle.
    fn search(&self, parallel: &ProofParallel, at: ProofMeridian) -> Option<u32> {
        let mut all = 0..self.facets.len() as u32;
        all.find(|&facet| self.is_here(facet, &self.facets[facet as usize].on(parallel), at))
    }

    /// Whether a normal meets a triangle, or is nearest to it and beyond the border. `row` are the factors of the triangle on
    /// the parallel.
    fn is_here(&self, facet: u32, row: &ProofParallelFacet, at: ProofMeridian) -> bool {
        self.facets[facet as usize].contains(row, at) && self.along_border(facet, row, at).is_none()
    }

    /// Where a normal is beyond a side of the border but not opposite to it: the triangle of the border opposite to it.
    /// Between two sides that meet at a vertex of the border, beyond both, the triangle of the walk stays.
    fn along_border(&self, facet: u32, row: &ProofParallelFacet, at: ProofMeridian) -> Option<u32> {
        let here = &self.facets[facet as usize];
        let mut out = (0..3).filter(|&side| here.is_border(side) && row.side(side, at) < 0.0);
        out.find_map(|side| {
            let parallel = &row.parallel;
            let mut now = self.next_on_border(BorderSide { facet, side }, parallel, at)?;
            let mut is_next = true;
            // No more often than there are triangles: broken tiles may go round in circles.
            for _ in &self.facets {
                let Some(next) = self.next_on_border(now, parallel, at) else { break };
                (now, is_next) = (next, false);
            }
            let there = self.facets[now.facet as usize].on(parallel);
            let stays = is_next
                && there.side(now.side, at) < 0.0
                && !self.contains(now.facet, parallel, at);
            (now.facet != facet && !stays).then_some(now.facet)
        })
    }

    fn contains(&self, facet: u32, parallel: &ProofParallel, at: ProofMeridian) -> bool {
        let facet = &self.facets[facet as usize];
        facet.contains(&facet.on(parallel), at)
    }

    fn corner(&self, facet: u32, k: usize) -> Vector {
        self.positions[self.facets[facet as usize].corners[k % 3] as usize]
    }

    /// The next side of the border towards a position, forwards or backwards. `None` where the meridian of the position
    /// passes this side; or its parallel, for a side that is more along a meridian.
    fn next_on_border(
        &self,
        BorderSide { facet, side }: BorderSide,
        parallel: &ProofParallel,
        at: ProofMeridian,
    ) -> Option<BorderSide> {
        let on_parallel = self.facets[facet as usize].on_parallel[side];
        let [from, to] = [0, 1].map(|k| self.corner(facet, side + k));
        let [before, after] = if on_parallel {
            let normal = [at.cos, at.sin, 0.0];
            [turn_of(normal, from), turn_of(to, normal)].map(|beyond| beyond * turn_of(from, to))
        } else {
            let place = parallel.position(at, 0.0);
            let north = parallel.north(at);
            let [from, to] = [from, to].map(|end| dot(north, minus(end, place)));
            [from * (to - from), to * (from - to)]
        };
        let is_after = after > 0.0;
        if !is_after && before <= 0.0 {
            return None;
        }
        // Around the nearer end of the side, from triangle to triangle.
        let (pivot, turn) = if is_after { (to, 1) } else { (from, 2) };
        let (mut now, mut side) = (facet, (side + turn) % 3);
        for _ in 0..self.facets.len() {
            let there = &self.facets[now as usize];
            if there.is_border(side) {
                // Beyond a corner of the tile, the side on a parallel counts before that on a meridian.
                let is_same = there.on_parallel[side] == on_parallel;
                let is_first = there.on_parallel[side] && self.contains(now, parallel, at);
                return (is_same || is_first).then_some(BorderSide { facet: now, side });
            }
            now = there.neighbours[side];
            let end = (0..3).find(|&k| self.corner(now, k) == pivot)?;
            // The side that begins at the pivot, or the one that ends there.
            side = if is_after { end } else { (end + 2) % 3 };
        }
        None
    }
}

impl ProofTileFacet {
    fn new(corners: [u32; 3], positions: &[Vector], origin: Vector) -> Self {
        let from = corners.map(|corner| positions[corner as usize]);
        let [a, b, c] = from.map(|corner| minus(corner, origin));
        let ends = [[a, b], [b, c], [c, a]];
        let normal = cross(minus(b, a), minus(c, a));
        let is_wall = dot(normal, from[0]) <= WALL * length(from[0]) * length(normal);
        Self {
            // Relative to the origin, so that no digits are lost: from x to, less (from - to) x the foot of the normal.
            sides: ends.map(|[from, to]| plus(cross(from, to), cross(minus(from, to), origin))),
            flat: ends.map(|[from, to]| [from[0] - to[0], from[1] - to[1]]),
            plane: (normal, dot(normal, a) + dot(normal, origin)),
            neighbours: [NONE; 3],
            on_parallel: [false; 3],
            lengths: match is_wall {
                true => [f64::INFINITY; 3],
                false => ends.map(|[from, to]| length(minus(to, from))),
            },
            corners,
        }
    }

    /// Whether it may be turned over, as seen from samples above or below it.
    fn is_turned(&self, positions: &[Vector]) -> bool {
        let [x, y, z] = positions[self.corners[0] as usize];
        // The normal of the ellipsoid, which hardly changes with the height.
        let up = [x, y, z * (A / B).powi(2)];
        let (normal, _) = self.plane;
        dot(normal, up) <= TURNED * length(up) * length(normal)
    }

    /// Marks the sides of the border: no normal is too near to them, as no triangle is beyond.
    fn open_borders(&mut self, positions: &[Vector]) {
        for side in (0..3).filter(|&side| self.neighbours[side] == NONE) {
            if self.lengths[side].is_finite() {
                self.lengths[side] = f64::NEG_INFINITY;
            }
            let [a, b] = [0, 1].map(|k| positions[self.corners[(side + k) % 3] as usize]);
            let [north, other] = [a, b].map(latitude);
            let east = (a[0] * b[1] - a[1] * b[0]) / a[0].hypot(a[1]).max(b[0].hypot(b[1]));
            self.on_parallel[side] = east.abs() > (north - other).abs() * A;
        }
    }

    fn is_border(&self, side: usize) -> bool {
        self.neighbours[side] == NONE
    }

    /// Whether a normal is on the inner side of all sides except borders. `row` are the factors on the parallel.
    fn contains(&self, row: &ProofParallelFacet, at: ProofMeridian) -> bool {
        (0..3).all(|k| self.is_border(k) || row.side(k, at) >= 0.0)
    }

    /// Its factors on a parallel.
    #[inline]
    fn on(&self, parallel: &ProofParallel) -> ProofParallelFacet {
        let &ProofParallel { cos, sin, radius, drop } = parallel;
        let (normal, level) = self.plane;
        let rest = level - normal[2] * (radius * sin - drop);
        ProofParallelFacet {
            sides: std::array::from_fn(|k| {
                let ([x, y, z], [along_x, along_y]) = (self.sides[k], self.flat[k]);
                [cos * (x + drop * along_y), cos * (y - drop * along_x), sin * z]
            }),
            lengths: self.lengths,
            plane: [cos * normal[0], cos * normal[1], sin * normal[2], rest],
            parallel: *parallel,
            length: dot(normal, normal).sqrt(),
        }
    }
}

impl ProofParallelFacet {
    /// Positive if the normal is on the inner side.
    fn side(&self, k: usize, at: ProofMeridian) -> f64 {
        let [x, y, rest] = self.sides[k];
        x * at.cos + y * at.sin + rest
    }

    /// Whether the normal is on the inner side of all sides by `margin` metres; false for walls.
    fn is_surely_in(&self, at: ProofMeridian, margin: f64) -> bool {
        (0..3).all(|k| self.side(k, at) >= self.lengths[k] * margin)
    }

    /// The height at which the normal meets the plane, and the ratio of its area to that in plan.
    fn height(&self, at: ProofMeridian) -> [f64; 2] {
        let [x, y, z, rest] = self.plane;
        let across = x * at.cos + y * at.sin;
        let up = (across + z).recip();
        [(rest - self.parallel.radius * across) * up, self.length * up.abs()]
    }
}

impl SampleRunErrors {
    fn add(&mut self, index: usize, distance: BoundedDistance, limit: f64) {
        let BoundedDistance { distance, lower, upper } = distance;
        self.count += 1;
        self.over += u64::from(lower > limit);
        self.ends[0] = self.ends[0].max(lower);
        self.ends[1] = self.ends[1].max(upper);
        self.squares += distance * distance;
        if self.max.is_none_or(|(max, _)| distance > max) {
            self.max = Some((distance, index));
        }
    }
}

/// Distance of a sample from the surface in metres, and its bounds given the rounding of positions.
#[derive(Clone, Copy, Debug, Default)]
struct BoundedDistance {
    distance: f64,
    lower: f64,
    upper: f64,
}

impl BoundedDistance {
    /// A distance that rounding of the position changes by up to `rounded`; NaN becomes infinite.
    fn of(distance: f64, rounded: f64) -> Self {
        if distance.is_finite() {
            Self { distance, lower: distance - rounded, upper: distance + rounded }
        } else {
            Self { distance: f64::INFINITY, lower: f64::INFINITY, upper: f64::INFINITY }
        }
    }
}

/// Local east-north-up frame of a sample. Nearby positions have small coordinates, so rounding is less than a nanometre.
struct ProofEastNorthUp {
    at: Vector,
    axes: [Vector; 3],
}

impl ProofEastNorthUp {
    fn new(parallel: &ProofParallel, at: ProofMeridian, height: f64) -> Self {
        let axes = [at.east(), parallel.north(at), parallel.normal(at)];
        Self { at: parallel.position(at, height), axes }
    }

    fn local(&self, position: Vector) -> Vector {
        self.axes.map(|axis| dot(axis, minus(position, self.at)))
    }
}

/// A side of the border.
#[derive(Clone, Copy)]
struct BorderSide {
    facet: u32,
    side: usize,
}

/// Twice the area in plan of the triangle of the origin and a side: positive if the origin is on its left.
fn turn_of([ax, ay, _]: Vector, [bx, by, _]: Vector) -> f64 {
    ax * by - ay * bx
}

/// Whether the origin is surely in a triangle in plan, of either orientation: inside and further than `rounded` from its
/// sides. `None` if it is outside and further than `rounded`.
fn is_met(corners: [Vector; 3], rounded: f64) -> Option<bool> {
    let sides = [[0, 1], [1, 2], [2, 0]].map(|[from, to]| [corners[from], corners[to]]);
    let turns = sides.map(|[from, to]| turn_of(from, to));
    let is_in = turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0);
    let is_near = sides.iter().any(|[from, to]| from_side(*from, *to) <= rounded);
    (is_in || is_near).then_some(is_in && !is_near)
}

/// Distance of the origin from a side in plan.
fn from_side(a: Vector, b: Vector) -> f64 {
    let [x, y] = [b[0] - a[0], b[1] - a[1]];
    let squared = x * x + y * y;
    let along = if squared > 0.0 { -(a[0] * x + a[1] * y) / squared } else { 0.0 };
    let along = along.clamp(0.0, 1.0);
    (a[0] + along * x).hypot(a[1] + along * y)
}

/// The height of the plane through three corners above the origin, and the ratio of its area to that in plan.
fn plane(corners: [Vector; 3]) -> [f64; 2] {
    let [a, b, c] = corners;
    let weights = [turn_of(b, c), turn_of(c, a), turn_of(a, b)];
    let area: f64 = weights.iter().sum();
    let height: f64 = weights.iter().zip(corners).map(|(weight, corner)| weight * corner[2]).sum();
    [height / area, length(cross(minus(b, a), minus(c, a))) / area.abs()]
}

#[cfg(test)]
mod tests;
