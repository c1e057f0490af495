//! The surface of a tile as a viewer draws it, and the vertical distances of samples from it.
//!
//! The triangle that the normal at a sample meets is found by walking: across a side that the normal passes on the
//! outside, until there is none; beyond the border of the tile the last triangle counts. Which side of an edge a
//! normal passes is the sign of a determinant of the edge's ends and the normal; along a parallel that is a sum of
//! a cosine and a sine with constant factors, and so is the height at which the normal meets the plane of the
//! triangle. Both triangles of an edge compute the same number with other signs, so a walk does not go to and fro.
//! Edges are straight and parallels are not: seen from a sample, a tile is not convex, and a walk may end at its border
//! anywhere. It goes on along the border, to the triangle whose side the meridian of the sample passes.
//!
//! Degenerate triangles, with two corners in the same position, are met by no normal and are left out: positions that
//! were rounded may coincide. So do those at a pole, which has all heights of vertices there; the furthest of them
//! counts.
//!
//! A place that is rounded moves a sample up or down a slope. So of each sample it is told by how much it is surely off,
//! and by how much it may be: that matters where walls are a thousand times as high as they are wide. Factors that are
//! counted from the centre of the earth do not tell the sides of such walls apart either: a sample on one, or so near a
//! side that rounding decides, is looked at from itself ([`ProofEastNorthUp`]), together with all triangles it may lie in. Where
//! positions are rounded to a lattice, triangles may be turned over, and the surface then lies above itself: the furthest
//! of the triangles that a normal meets counts.

mod sides;

use super::decode::DecodedTile;
use super::ellipsoid::{
    A, B, ProofMeridian, ProofParallel, Vector, cross, dot, latitude, length, minus, plus,
};
use super::tiling::ProofTileId;
use sides::{CollapsedSides, poles, twins};

/// Cosine of a latitude below which it is a pole: rounding.
const POLAR: f64 = 1e-12;

/// No triangle beside.
const NONE: u32 = u32::MAX;

/// Bytes that a vertex and its two triangles take here, while they are made.
pub const BYTES_PER_VERTEX: usize =
    2 * size_of::<ProofTileFacet>() + 2 * size_of::<Vector>() + 6 * size_of::<[u32; 3]>();

/// Metres that the distance of a normal from a side is rounded by, counted from the centre of the earth.
const ROUNDING: f64 = 32.0 * f64::EPSILON * A;
/// Cosine of the slope from which on a triangle is a wall.
const WALL: f64 = 1.0 / 16.0;
/// The same from which on it may be turned over as seen from some sample.
const TURNED: f64 = 1e-4;

/// A triangle.
#[derive(Clone, Debug)]
struct ProofTileFacet {
    /// Of each side, what the normal is multiplied with for the determinant.
    sides: [Vector; 3],
    /// x and y of each side, for the part of the determinant that comes of the ellipsoid being no sphere.
    flat: [[f64; 2]; 3],
    /// Normal of its plane, and what it gives with any place of the plane.
    plane: (Vector, f64),
    /// The triangles beside, by side.
    beside: [u32; 3],
    /// Whether a side is more along a parallel than along a meridian.
    on_parallel: [bool; 3],
    /// Metres of each side; of walls without end, and less than any where nothing is beyond.
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
    /// The lowest and the highest vertex at the south pole, and at the north pole.
    poles: [Option<[f64; 2]>; 2],
}

/// What a run of samples comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleRunErrors {
    /// Samples with a height.
    pub count: u64,
    /// Those further from the surface than a limit.
    pub over: u64,
    /// Sum of the squares of their distances.
    pub squares: f64,
    /// The largest distance, and which sample of the run it is, the first of several.
    pub most: Option<(f64, usize)>,
    /// The largest of what samples are surely off by, their places being rounded, and of what they may be.
    pub ends: [f64; 2],
}

/// A triangle on a parallel: what the determinants of its sides, and its plane, have as factors there.
struct ProofParallelFacet {
    sides: [[f64; 3]; 3],
    lengths: [f64; 3],
    plane: [f64; 4],
    parallel: ProofParallel,
    /// Length of the normal of the plane.
    length: f64,
}

impl TileFacets {
    /// Those of a tile; `positions` are those of its vertices.
    pub fn new(tile: &DecodedTile, positions: &[Vector]) -> Self {
        let origin = positions.first().copied().unwrap_or_default();
        let poles = poles(positions);
        let coincide = |a: u32, b: u32| {
            let is_polar = |at: &Vec<u32>| at.contains(&a) && at.contains(&b);
            // Broken tiles have triangles that name one vertex twice: these stay.
            a != b && (positions[a as usize] == positions[b as usize] || poles.iter().any(is_polar))
        };
        let mut collapsed = CollapsedSides::of(&tile.triangles, coincide);
        if collapsed.0.iter().all(Option::is_some) {
            // A tile without any area is still looked at, and is infinitely far from every sample.
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
            facets[number as usize].beside = std::array::from_fn(|side| {
                let other = collapsed.beyond(&twins, triangle, side);
                other.map_or(NONE, |other| numbers[other])
            });
        }
        facets.iter_mut().for_each(|facet| facet.open_borders(positions));
        let heights = |at: &Vec<u32>| {
            let heights = at.iter().map(|&vertex| positions[vertex as usize][2].abs() - B);
            heights.map(|z| [z; 2]).reduce(|[low, high], [z, _]| [low.min(z), high.max(z)])
        };
        let poles = poles.each_ref().map(heights);
        let turned = (0..).zip(&facets).filter(|(_, facet)| facet.is_turned(positions));
        let turned = turned.map(|(number, _)| number).collect();
        Self { facets, positions: positions.to_vec(), turned, poles }
    }

    /// Positions of the vertices of a tile.
    pub fn positions(id: ProofTileId, tile: &DecodedTile) -> Vec<Vector> {
        if !tile.placed.is_empty() {
            return tile.placed.clone();
        }
        let place = |&vertex: &[u16; 3]| {
            let [longitude, latitude] = DecodedTile::place(id, vertex);
            ProofParallel::at(latitude).position(ProofMeridian::at(longitude), tile.height(vertex))
        };
        tile.vertices.iter().map(place).collect()
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> usize {
        self.facets.len() * size_of::<ProofTileFacet>()
            + self.positions.len() * size_of::<Vector>()
            + size_of::<Self>()
    }

    /// Measures the samples of a row at these longitudes; voids are NaN. `from` is the triangle where the search
    /// begins, and becomes that of the first sample. Their places may be off by so many metres. A distance that is no
    /// number, because a triangle has no area, is infinite.
    pub fn row(
        &self,
        from: &mut u32,
        parallel: &ProofParallel,
        meridians: &[ProofMeridian],
        heights: &[f64],
        [limit, rounded]: [f64; 2],
    ) -> SampleRunErrors {
        let mut seen = SampleRunErrors::default();
        if parallel.cos.abs() < POLAR {
            let Some([low, high]) = self.poles[usize::from(parallel.sin > 0.0)] else {
                return seen;
            };
            let valid = heights.iter().enumerate().filter(|(_, height)| !height.is_nan());
            valid.for_each(|(index, &height)| {
                let distance = (height - low).abs().max((height - high).abs());
                seen.add(
                    index,
                    BoundedDistance { distance, lower: distance, upper: distance },
                    limit,
                );
            });
            return seen;
        }
        let mut now = *from;
        let Some(facet) = self.facets.get(now as usize) else { return seen };
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
                let [surface, steep] = row.height(at);
                BoundedDistance::of((surface - height).abs(), steep * rounded)
            } else {
                let frame = ProofEastNorthUp::new(parallel, at, height);
                let here = self.walk_in(now, &frame);
                if here != now {
                    now = here;
                    row = self.facets[now as usize].on(parallel);
                }
                let near = self.near(now, &frame, rounded);
                if self.is_folded(&frame, rounded) {
                    self.over(near, &frame, rounded)
                } else {
                    near
                }
            };
            if seen.count == 0 {
                *from = now;
            }
            seen.add(index, distance, limit);
        }
        seen
    }

    /// A triangle as it is seen from a sample.
    fn seen_from(&self, frame: &ProofEastNorthUp, facet: &ProofTileFacet) -> [Vector; 3] {
        facet.corners.map(|corner| frame.look(self.positions[corner as usize]))
    }

    /// The side of a triangle that the normal of a sample passes on the outside, of several the first from `turn` on.
    fn way_out(
        &self,
        frame: &ProofEastNorthUp,
        facet: &ProofTileFacet,
        turn: usize,
    ) -> Option<u32> {
        let corners = self.seen_from(frame, facet);
        let mut sides = (0..3).map(|k| (turn + k) % 3).filter(|&k| facet.beside[k] != NONE);
        let out = sides.find(|&k| across(corners[k], corners[(k + 1) % 3]) < 0.0);
        out.map(|side| facet.beside[side])
    }

    /// The triangle that the normal of a sample meets, as seen from there.
    fn walk_in(&self, from: u32, frame: &ProofEastNorthUp) -> u32 {
        let mut now = from;
        for turn in 0..=self.facets.len() {
            match self.way_out(frame, &self.facets[now as usize], turn) {
                Some(beside) => now = beside,
                None => return now,
            }
        }
        let mut all = (0..).zip(&self.facets);
        all.find(|(_, facet)| self.way_out(frame, facet, 0).is_none()).map_or(now, |(at, _)| at)
    }

    /// How far a sample is from a triangle; the bounds are those of all triangles joined to it that its place may lie in.
    fn near(&self, facet: u32, frame: &ProofEastNorthUp, rounded: f64) -> BoundedDistance {
        let mut seen = vec![facet];
        let mut all: Option<BoundedDistance> = None;
        let mut next = 0;
        while let Some(facet) = seen.get(next).map(|&number| &self.facets[number as usize]) {
            next += 1;
            let corners = self.seen_from(frame, facet);
            let [height, steep] = plane(corners);
            let one = BoundedDistance::of(height.abs(), steep * rounded);
            all = Some(all.map_or(one, |all| BoundedDistance {
                lower: all.lower.min(one.lower),
                upper: all.upper.max(one.upper),
                ..all
            }));
            for (k, &beside) in facet.beside.iter().enumerate().filter(|(_, at)| **at != NONE) {
                let is_near = from_side(corners[k], corners[(k + 1) % 3]) <= rounded;
                if is_near && !seen.contains(&beside) {
                    seen.push(beside);
                }
            }
        }
        all.unwrap_or_default()
    }

    /// Whether a triangle that is turned over may lie above or below a sample.
    fn is_folded(&self, frame: &ProofEastNorthUp, rounded: f64) -> bool {
        let turned = self.turned.iter().map(|&number| &self.facets[number as usize]);
        turned.map(|facet| self.seen_from(frame, facet)).any(|seen| is_met(seen, rounded).is_some())
    }

    /// How far a sample is from the furthest of all triangles above and below it, where `near` is what it is from those
    /// that one of them is joined to.
    fn over(
        &self,
        near: BoundedDistance,
        frame: &ProofEastNorthUp,
        rounded: f64,
    ) -> BoundedDistance {
        let seen = self.facets.iter().map(|facet| self.seen_from(frame, facet));
        let met = seen.filter_map(|seen| Some((seen, is_met(seen, rounded)?)));
        met.fold(near, |all, (seen, is_sure)| {
            let [height, steep] = plane(seen);
            let one = BoundedDistance::of(height.abs(), steep * rounded);
            let sure = if is_sure { one } else { BoundedDistance::default() };
            BoundedDistance {
                distance: all.distance.max(sure.distance),
                lower: all.lower.max(sure.lower),
                upper: all.upper.max(one.upper),
            }
        })
    }

    /// The triangle that the normal meets, or the last one before the border.
    fn walk(&self, from: u32, parallel: &ProofParallel, at: ProofMeridian) -> u32 {
        let mut now = from;
        for step in 0..=self.facets.len() {
            let facet = &self.facets[now as usize];
            let row = facet.on(parallel);
            // Not the same side first every time: a walk could go round in circles.
            let sides = (0..3).map(|k| (step + k) % 3);
            let mut out = sides.filter(|&k| !facet.is_border(k) && row.side(k, at) < 0.0);
            let beside = out.next().map(|side| facet.beside[side]);
            match beside.or_else(|| self.along_border(now, &row, at)) {
                Some(next) => now = next,
                None => return now,
            }
        }
        self.search(parallel, at).unwrap_or(now)
    }

    /// The same by looking at every triangle.
    fn search(&self, parallel: &ProofParallel, at: ProofMeridian) -> Option<u32> {
        let mut all = 0..self.facets.len() as u32;
        all.find(|&facet| self.is_here(facet, &self.facets[facet as usize].on(parallel), at))
    }

    /// Whether a normal on a parallel, whose factors for the triangle are given, meets it, or is nearest to it and
    /// beyond the border.
    fn is_here(&self, facet: u32, row: &ProofParallelFacet, at: ProofMeridian) -> bool {
        self.facets[facet as usize].has(row, at) && self.along_border(facet, row, at).is_none()
    }

    /// Where a normal is beyond a side of the border that it is not beside: the triangle of the border beside which it is.
    /// Of two that meet at a vertex of the border, and that it is beyond, it stays at the one on whose side it is.
    fn along_border(&self, facet: u32, row: &ProofParallelFacet, at: ProofMeridian) -> Option<u32> {
        let here = &self.facets[facet as usize];
        let mut out = (0..3).filter(|&side| here.is_border(side) && row.side(side, at) < 0.0);
        out.find_map(|side| {
            let next = |(facet, side)| self.next_on_border(facet, side, &row.parallel, at);
            let (mut now, mut is_next) = (next((facet, side))?, true);
            // No more often than there are triangles: broken tiles may go round in circles.
            for _ in &self.facets {
                let Some(further) = next(now) else { break };
                (now, is_next) = (further, false);
            }
            let there = self.facets[now.0 as usize].on(&row.parallel);
            let stays =
                is_next && there.side(now.1, at) < 0.0 && !self.holds(now.0, &row.parallel, at);
            (now.0 != facet && !stays).then_some(now.0)
        })
    }

    fn holds(&self, facet: u32, parallel: &ProofParallel, at: ProofMeridian) -> bool {
        let facet = &self.facets[facet as usize];
        facet.has(&facet.on(parallel), at)
    }

    /// The triangle of the border after this one or before it, with its side there, in the direction of a place; `None`
    /// where its meridian passes this side, or its parallel does where the side is more along a meridian.
    fn next_on_border(
        &self,
        facet: u32,
        side: usize,
        parallel: &ProofParallel,
        at: ProofMeridian,
    ) -> Option<(u32, usize)> {
        let corner = |facet: u32, k: usize| {
            self.positions[self.facets[facet as usize].corners[k % 3] as usize]
        };
        let on_parallel = self.facets[facet as usize].on_parallel[side];
        let [from, to] = [0, 1].map(|k| corner(facet, side + k));
        let [before, after] = if on_parallel {
            let turn = |[ax, ay, _]: Vector, [bx, by, _]: Vector| ax * by - ay * bx;
            let normal = [at.cos, at.sin, 0.0];
            [turn(normal, from), turn(to, normal)].map(|beyond| beyond * turn(from, to))
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
        // Around the end of the side that is nearer, from one side that meets it to the next.
        let (pivot, turn) = if is_after { (to, 1) } else { (from, 2) };
        let (mut now, mut side) = (facet, (side + turn) % 3);
        for _ in 0..self.facets.len() {
            let there = &self.facets[now as usize];
            if there.is_border(side) {
                // Beyond a corner of the tile, the side on a parallel counts before that on a meridian.
                let is_same = there.on_parallel[side] == on_parallel;
                let is_first = there.on_parallel[side] && self.holds(now, parallel, at);
                return (is_same || is_first).then_some((now, side));
            }
            now = there.beside[side];
            let end = (0..3).find(|&k| corner(now, k) == pivot)?;
            // The side that begins there, or the one that ends there.
            side = if is_after { end } else { (end + 2) % 3 };
        }
        None
    }
}

impl ProofTileFacet {
    fn new(corners: [u32; 3], positions: &[Vector], origin: Vector) -> Self {
        let from = corners.map(|corner| positions[corner as usize]);
        let [a, b, c] = from.map(|corner| minus(corner, origin));
        let side = |from: Vector, to: Vector| {
            // Seen from the origin, so that no digits are lost: from x to, less (from - to) x the foot of the normal.
            plus(cross(from, to), cross(minus(from, to), origin))
        };
        let flat = |from: Vector, to: Vector| [from[0] - to[0], from[1] - to[1]];
        let normal = cross(minus(b, a), minus(c, a));
        let is_wall = dot(normal, from[0]) <= WALL * length(from[0]) * length(normal);
        let reach = |from, to| if is_wall { f64::INFINITY } else { length(minus(to, from)) };
        Self {
            sides: [side(a, b), side(b, c), side(c, a)],
            flat: [flat(a, b), flat(b, c), flat(c, a)],
            plane: (normal, dot(normal, a) + dot(normal, origin)),
            beside: [NONE; 3],
            on_parallel: [false; 3],
            lengths: [reach(a, b), reach(b, c), reach(c, a)],
            corners,
        }
    }

    /// Whether it may be turned over, as seen from samples that it lies above or below.
    fn is_turned(&self, positions: &[Vector]) -> bool {
        let [x, y, z] = positions[self.corners[0] as usize];
        // Up, but for what it changes by with the height.
        let up = [x, y, z * (A / B).powi(2)];
        let (normal, _) = self.plane;
        dot(normal, up) <= TURNED * length(up) * length(normal)
    }

    /// Nothing is beyond a side without a triangle beside: no normal is too near to it.
    fn open_borders(&mut self, positions: &[Vector]) {
        for side in (0..3).filter(|&side| self.beside[side] == NONE) {
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
        self.beside[side] == NONE
    }

    /// Whether a normal on a parallel, whose factors are given, passes all sides on the inside that are no borders.
    fn has(&self, row: &ProofParallelFacet, at: ProofMeridian) -> bool {
        (0..3).all(|k| self.is_border(k) || row.side(k, at) >= 0.0)
    }

    /// Its factors on a parallel.
    fn on(&self, parallel: &ProofParallel) -> ProofParallelFacet {
        let &ProofParallel { cos, sin, radius, drop } = parallel;
        let side = |k: usize| {
            let ([x, y, z], [along_x, along_y]) = (self.sides[k], self.flat[k]);
            [cos * (x + drop * along_y), cos * (y - drop * along_x), sin * z]
        };
        let (normal, level) = self.plane;
        let rest = level - normal[2] * (radius * sin - drop);
        ProofParallelFacet {
            sides: [side(0), side(1), side(2)],
            lengths: self.lengths,
            plane: [cos * normal[0], cos * normal[1], sin * normal[2], rest],
            parallel: *parallel,
            length: dot(normal, normal).sqrt(),
        }
    }
}

impl ProofParallelFacet {
    /// Above zero where the normal passes a side on the inside.
    fn side(&self, k: usize, at: ProofMeridian) -> f64 {
        let [x, y, rest] = self.sides[k];
        x * at.cos + y * at.sin + rest
    }

    /// Whether the normal passes all sides on the inside by so many metres, and this is no wall.
    fn is_surely_in(&self, at: ProofMeridian, margin: f64) -> bool {
        (0..3).all(|k| self.side(k, at) >= self.lengths[k] * margin)
    }

    /// The height at which the normal meets the plane, and metres up the plane for one along it.
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
        if self.most.is_none_or(|(most, _)| distance > most) {
            self.most = Some((distance, index));
        }
    }
}

/// Metres that a sample is from the surface: as its place is given, and the bounds of that as far as places are rounded.
#[derive(Clone, Copy, Debug, Default)]
struct BoundedDistance {
    distance: f64,
    lower: f64,
    upper: f64,
}

impl BoundedDistance {
    /// From a triangle, where that changes by so much as far as places are rounded.
    fn of(distance: f64, rounded: f64) -> Self {
        if distance.is_finite() {
            Self { distance, lower: distance - rounded, upper: distance + rounded }
        } else {
            Self { distance: f64::INFINITY, lower: f64::INFINITY, upper: f64::INFINITY }
        }
    }
}

/// A sample, and the directions to the east, to the north and up from there. Nothing is far from it, so that rounding
/// takes no more than part of a nanometre.
struct ProofEastNorthUp {
    at: Vector,
    axes: [Vector; 3],
}

impl ProofEastNorthUp {
    fn new(parallel: &ProofParallel, at: ProofMeridian, height: f64) -> Self {
        let axes = [at.east(), parallel.north(at), parallel.normal(at)];
        Self { at: parallel.position(at, height), axes }
    }

    fn look(&self, position: Vector) -> Vector {
        self.axes.map(|axis| dot(axis, minus(position, self.at)))
    }
}

/// Twice the area of the triangle of the origin and a side, seen from above: above zero where the origin is on its left.
fn across([ax, ay, _]: Vector, [bx, by, _]: Vector) -> f64 {
    ax * by - ay * bx
}

/// Whether the origin lies in a triangle as seen from above, whatever way that turns, or within so many metres of it; and
/// whether it lies in it by as many.
fn is_met(corners: [Vector; 3], rounded: f64) -> Option<bool> {
    let sides = [[0, 1], [1, 2], [2, 0]].map(|[from, to]| [corners[from], corners[to]]);
    let parts = sides.map(|[from, to]| across(from, to));
    let is_in = parts.iter().all(|part| *part >= 0.0) || parts.iter().all(|part| *part <= 0.0);
    let is_near = sides.iter().any(|[from, to]| from_side(*from, *to) <= rounded);
    (is_in || is_near).then_some(is_in && !is_near)
}

/// How far the origin is from a side, seen from above.
fn from_side(a: Vector, b: Vector) -> f64 {
    let [x, y] = [b[0] - a[0], b[1] - a[1]];
    let square = x * x + y * y;
    let along = if square > 0.0 { -(a[0] * x + a[1] * y) / square } else { 0.0 };
    let along = along.clamp(0.0, 1.0);
    (a[0] + along * x).hypot(a[1] + along * y)
}

/// The height of the plane through three corners above the origin, and metres up the plane for one along it.
fn plane(corners: [Vector; 3]) -> [f64; 2] {
    let [a, b, c] = corners;
    let parts = [across(b, c), across(c, a), across(a, b)];
    let area: f64 = parts.iter().sum();
    let height: f64 = parts.iter().zip(corners).map(|(part, corner)| part * corner[2]).sum();
    [height / area, length(cross(minus(b, a), minus(c, a))) / area.abs()]
}

#[cfg(test)]
mod tests;
