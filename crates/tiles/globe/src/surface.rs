//! Surface of a tile: borders, anchor vertices that follow the curvature of the earth, and samples with the
//! largest errors, until all decoded errors are within the level's error.

use std::cell::RefCell;

use crate::border::{self, TileSide};
use crate::globe::{EllipsoidNormal, SinCos, bend};
use crate::level::{TileLevel, nearest};
use crate::measure::TileShell;
use crate::sample_run::{SampleMeridian, SampleRow, TerrainSample, TerrainSampleRun};
use crate::terrain::TerrainSampler;
use crate::tile::{TerrainTile, TileErrorMeasure, TileVertex, point};
use crate::tiling::{GlobeTileId, STEPS};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point;
use terrane_tin::scatter::{InsertUntilWithin, ScatterMesh};

/// Rounds in which samples beyond the error are added to the mesh.
const MAX_ROUNDS: u32 = 48;

/// Capacity kept by a thread from tile to tile: more points than most tiles have.
const MAX_KEPT: usize = 1 << 17;

thread_local! {
    /// Reused buffer for the points of a tile: allocation costs more than filling.
    static POINTS: RefCell<Vec<Point>> = const { RefCell::new(Vec::new()) };
}

/// Positions of a column's samples in a tile.
struct TileMeridian {
    lon: f64,
    /// Steps from the west.
    u: i32,
    /// Of how far it is from the middle.
    cosine: f64,
}

/// Nearest position inside the borders, which are shared with neighbours.
fn inner(place: [f64; 2]) -> [i32; 2] {
    place.map(|at| nearest(at).clamp(1, STEPS - 1))
}

/// A tile in progress.
pub struct TileBuilder<'a> {
    id: GlobeTileId,
    level: &'a TileLevel,
    drop: HorizonDrop,
    mesh: ScatterMesh,
}

impl<'a> TileBuilder<'a> {
    /// Borders and anchor vertices of a tile.
    ///
    /// # Errors
    /// Only for an invalid tile, which is an internal error.
    pub fn new(
        id: GlobeTileId,
        level: &'a TileLevel,
        ground: &impl TerrainSampler,
    ) -> Result<Self> {
        let mut drop = HorizonDrop::new(id, level);
        let mut first = Vec::new();
        for side in TileSide::ALL {
            for [along, height] in border::vertices(id, side, level, ground) {
                first.push(TileVertex { at: side.position(along), height });
            }
        }
        let posts: Vec<i32> =
            (1..level.posts).map(|part| border::along(part, level.posts)).collect();
        for at in posts.iter().flat_map(|v| posts.iter().map(|u| [*u, *v])) {
            let place = id.place(at);
            let height = ground.height(place);
            let height = level.steps(height.unwrap_or_else(|| ground.filled(place)));
            first.push(TileVertex { at, height });
        }
        let points: Vec<Point> = first.into_iter().map(|vertex| drop.point_above(vertex)).collect();
        let corners = [[0, 0], [STEPS, 0], [0, STEPS]];
        let corners: Vec<Point> = corners
            .iter()
            .filter_map(|at| points.iter().copied().find(|p| [p.x, p.y] == *at))
            .collect();
        let mesh = <[Point; 3]>::try_from(corners).ok().and_then(ScatterMesh::new);
        let mut mesh =
            mesh.ok_or_else(|| Error::new(ErrorKind::Internal, "a tile has no corners"))?;
        points.into_iter().for_each(|point| {
            mesh.insert(point);
        });
        Ok(Self { id, level, drop, mesh })
    }

    /// Adds samples as vertices until all given samples, with rounded positions, are within the level's error.
    pub fn fit(&mut self, samples: impl FnOnce(&mut dyn FnMut(TerrainSampleRun<'_>))) {
        let mut points = POINTS.take();
        points.clear();
        let mut columns = Vec::new();
        samples(&mut |run| match run {
            TerrainSampleRun::Row(row) => self.candidates(&row, &mut columns, &mut points),
            TerrainSampleRun::One(TerrainSample { place, height, .. }) => {
                points.push(self.candidate(self.id.steps(place), height))
            }
        });
        let goal = self.level.goal() / self.level.unit();
        InsertUntilWithin::new(&mut self.mesh, &points, goal).run();
        if points.capacity() <= MAX_KEPT {
            POINTS.set(points);
        }
    }

    /// The tile with all samples within the level's error, where positions can distinguish samples: samples
    /// beyond it are added round by round. `measure` measures all samples, exactly if they exceed the error.
    ///
    /// # Errors
    /// Those of `measure`.
    pub fn refine(
        &mut self,
        mut measure: impl FnMut(&mut TileShell) -> Result<()>,
    ) -> Result<TerrainTile> {
        let mut best: Option<TerrainTile> = None;
        for _ in 0..MAX_ROUNDS {
            let mut shell = self.shell();
            measure(&mut shell)?;
            let (found, beyond) = shell.end();
            // Not simply the last round: an insertion may turn triangles and leave another sample further off.
            if best.as_ref().is_none_or(|best| found.largest < best.measure.largest) {
                best = Some(self.finish(found));
            }
            if !self.insert(&beyond) {
                break;
            }
        }
        best.ok_or_else(|| Error::new(ErrorKind::Internal, "a tile has no error"))
    }

    /// Adds samples as vertices, however small their error seems; returns whether one was added. If a sample is
    /// a vertex already, its position was rounded into a steep triangle: another position around it becomes a
    /// vertex, too.
    pub fn insert(&mut self, samples: &[TerrainSample]) -> bool {
        let before = self.mesh.points().len();
        for sample in samples {
            let [u, v] = self.id.steps(sample.place);
            let [[near, far], [close, off]] = [u, v].map(|at| {
                if at.round() > at { [at.ceil(), at.floor()] } else { [at.floor(), at.ceil()] }
            });
            let places = [[near, close], [far, close], [near, off], [far, off]];
            places.into_iter().any(|place| {
                let point = self.candidate(place, sample.height);
                self.mesh.insert(point).is_some()
            });
        }
        self.mesh.points().len() > before
    }

    fn candidate(&mut self, place: [f64; 2], height: f64) -> Point {
        self.drop.point_above(TileVertex { at: inner(place), height: self.level.steps(height) })
    }

    /// Candidates of a row of samples, as if each were added alone. `columns` caches results of the previous
    /// row, which are mostly the same.
    fn candidates(
        &mut self,
        row: &SampleRow<'_>,
        columns: &mut Vec<TileMeridian>,
        points: &mut Vec<Point>,
    ) {
        let lat = row.parallel.lat;
        let Some((first, _)) = row.iter().next() else { return };
        if columns.len() != row.len() || columns[0].lon != first.lon {
            columns.clear();
            columns.extend(row.iter().map(|(SampleMeridian { lon, .. }, _)| {
                let [u, _] = inner(self.id.steps([*lon, lat]));
                TileMeridian { lon: *lon, u, cosine: self.drop.cosine(u) }
            }));
        }
        let [_, v] = inner(self.id.steps([first.lon, lat]));
        // Both are powers of two, so the product equals the quotient.
        let [by_step, by_unit] = [self.level.step, self.level.unit()].map(|size| 1.0 / size);
        let units = self.level.step * by_unit;
        let [add, by] = self.drop.along(v);
        let centre = self.drop.centre;
        let samples = row.iter().zip(&*columns).filter(|((_, height), _)| height.is_finite());
        points.extend(samples.map(|((_, height), TileMeridian { u, cosine, .. })| {
            let drop = ((add + by * cosine) - centre) * by_unit;
            Point::new(*u, v, nearest(f64::from(nearest(height * by_step)) * units + drop))
        }));
    }

    /// The current surface, to measure samples against.
    pub fn shell(&self) -> TileShell {
        let (vertices, numbers) = self.vertices();
        let TileLevel { step, lattice, .. } = *self.level;
        let points = vertices.iter().map(|vertex| point(self.id, step, lattice, *vertex));
        let (points, triangles) = (points.collect(), self.triangles(&numbers));
        TileShell::new(self.id, self.level, &vertices, points, triangles)
    }

    /// The current tile with its measured errors.
    pub fn finish(&self, measure: TileErrorMeasure) -> TerrainTile {
        let (vertices, numbers) = self.vertices();
        let triangles = self.triangles(&numbers).iter().map(|(corners, _)| *corners).collect();
        let (step, lattice) = (self.level.step, self.level.lattice);
        TerrainTile { id: self.id, step, lattice, vertices, triangles, measure }
    }

    fn vertices(&self) -> (Vec<TileVertex>, Vec<u32>) {
        let vertices = self.mesh.points().iter().map(|point| self.drop.lower(*point)).collect();
        let mut numbers = vec![u32::MAX; self.mesh.triangles().len()];
        // Ghost triangles have no index.
        let inner =
            (0..self.mesh.triangles().len() as u32).filter(|i| self.mesh.corners(*i).is_some());
        for (number, triangle) in inner.enumerate() {
            numbers[triangle as usize] = number as u32;
        }
        (vertices, numbers)
    }

    /// Corners, and neighbours opposite each corner: [`u32::MAX`] beyond the borders.
    fn triangles(&self, numbers: &[u32]) -> Vec<([u32; 3], [u32; 3])> {
        let inner = self.mesh.triangles().iter().zip(numbers).filter(|(_, n)| **n != u32::MAX);
        inner.map(|(t, _)| (t.corners, t.twins.map(|twin| numbers[twin as usize]))).collect()
    }
}

/// Makes a tile of samples that can be passed on repeatedly.
///
/// # Errors
/// Only for an invalid tile, which is an internal error.
pub fn build(
    id: GlobeTileId,
    level: &TileLevel,
    ground: &impl TerrainSampler,
) -> Result<TerrainTile> {
    let bounds = id.bounds();
    let mut builder = TileBuilder::new(id, level, ground)?;
    builder.fit(|take| {
        ground.runs(&bounds, level.stride, &mut |run| take(run));
        ground.feet(&bounds, level.stride, &mut |foot| take(TerrainSampleRun::One(foot)));
    });
    builder.refine(|shell| {
        ground.runs(&bounds, 1, &mut |run| shell.add_run(&run, level.tolerance));
        Ok(())
    })
}

/// Depth of the ellipsoid below the tangent plane at the centre of a tile, in kernel units: triangles that are
/// flat relative to the plane are almost flat for a client.
struct HorizonDrop {
    id: GlobeTileId,
    step: f64,
    unit: f64,
    middle: SinCos,
    centre: f64,
    lon: f64,
    /// Cached values of the last row: a sum, and a factor of the cosine along it.
    row: (i32, [f64; 2]),
}

impl HorizonDrop {
    fn new(id: GlobeTileId, level: &TileLevel) -> Self {
        let bounds = id.bounds();
        let middle = SinCos::of((bounds.south + bounds.north) / 2.0);
        let mut drop = Self {
            id,
            step: level.step,
            unit: level.unit(),
            middle,
            centre: 0.0,
            lon: (bounds.west + bounds.east) / 2.0,
            row: (-1, [0.0; 2]),
        };
        let [add, by] = drop.terms(middle);
        drop.centre = add + by;
        drop
    }

    fn terms(&self, lat: SinCos) -> [f64; 2] {
        let bend = bend(lat);
        // The part of the earth's axis, and that of the equator.
        let up = EllipsoidNormal::of(SinCos { sin: 0.0, cos: 1.0 }, lat, bend).point(0.0).0;
        [up[2] * self.middle.sin, up[0] * self.middle.cos]
    }

    /// Height of the ellipsoid above the plane in units, never positive.
    fn of(&mut self, at: [i32; 2]) -> f64 {
        let ([add, by], cosine) = (self.along(at[1]), self.cosine(at[0]));
        ((add + by * cosine) - self.centre) / self.unit
    }

    /// Sum of a row, and factor of the cosine along it.
    fn along(&mut self, v: i32) -> [f64; 2] {
        if self.row.0 != v {
            let [_, lat] = self.id.place([0, v]);
            self.row = (v, self.terms(SinCos::of(lat)));
        }
        self.row.1
    }

    /// Cosine of a column's distance from the centre.
    fn cosine(&self, u: i32) -> f64 {
        let [lon, _] = self.id.place([u, 0]);
        cosine((lon - self.lon).to_radians())
    }

    fn point_above(&mut self, vertex: TileVertex) -> Point {
        let height = f64::from(vertex.height) * (self.step / self.unit);
        let z = nearest(height + self.of(vertex.at));
        Point::new(vertex.at[0], vertex.at[1], z)
    }

    fn lower(&self, point: Point) -> TileVertex {
        let at = [point.x, point.y];
        let mut fresh = Self { row: (-1, [0.0; 2]), ..*self };
        let height = (f64::from(point.z) - fresh.of(at)) / (self.step / self.unit);
        TileVertex { at, height: height.round() as i32 }
    }
}

/// Cosine, fast for small angles.
fn cosine(angle: f64) -> f64 {
    let square = angle * angle;
    if square > 0.01 {
        return angle.cos();
    }
    1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0))
}
