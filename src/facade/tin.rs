//! Meshes with a proven bound on their error, in memory and into files.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use super::grid::Grid;
use super::run::{Run, System, output_settings, run_settings, system_settings};
use terrane_base::bound::Bound;
use terrane_base::geom::{Affine, Crs};
use terrane_base::{Error, Result};
use terrane_files::{lock, name_of};
use terrane_jobs::plan::AnyPlan as Plan;
use terrane_jobs::tin::{
    self, BuildJob, Built, Goal, PlanJob, Refinement, TinJob, TinReport, USUAL_TILE,
};
use terrane_mesh::{MeshBatch, MeshHeader, MeshSink};
use terrane_raster::{self as raster, ArraySample, OpenOptions};

/// A triangle mesh in memory.
///
/// Vertices are samples of the grid it was made from; triangles refer to them by index and are
/// counter-clockwise seen from above. The mesh is Delaunay on the lattice of samples (unless
/// [asked not to be](TinBuilder::data_dependent)), has no cracks, and covers every cell whose
/// four samples are valid, and nothing else.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// let heights: Vec<f32> = (0..64 * 64).map(|i| ((i % 64) as f32 / 5.0).sin() * 10.0).collect();
/// let tin = terrane::Tin::from_array(&heights, 64, 64)?.max_error(0.5).build()?;
/// assert!(tin.max_error() <= 0.5 && tin.vertices().len() < 64 * 64);
/// let [a, b, c] = tin.triangles()[0].map(|corner| tin.vertices()[corner as usize]);
/// # let _ = (a, b, c);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Tin {
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) tolerance: f64,
    pub(super) max_error: f64,
    rmse: f64,
    unmet: Option<String>,
    pub(super) header: MeshHeader,
}

/// What a [`Tin`] is made of.
#[derive(Clone, Debug)]
pub struct TinParts {
    /// Positions.
    pub vertices: Vec<[f64; 3]>,
    /// Corners as indices of them, counter-clockwise seen from above.
    pub triangles: Vec<[u32; 3]>,
    /// The bound that was kept.
    pub tolerance: f64,
    /// The largest vertical distance of a valid sample from the mesh.
    pub max_error: f64,
    /// The root of the mean square of these distances.
    pub rmse: f64,
    /// What was asked for and is not so.
    pub unmet: Option<String>,
    /// What files of it say.
    pub header: MeshHeader,
}

/// A grid of heights in memory: what [`Tin::from_array`] takes a slice for.
pub type ArrayGrid<'a> = raster::ArrayGrid<'a>;

impl Tin {
    /// A mesh of `height` rows of `width` samples each, row by row, of any type of number. NaN and infinities
    /// are voids. x is the column and y the row with its sign changed, unless
    /// [`place`](TinBuilder::place)d elsewhere.
    ///
    /// # Errors
    /// Another number of samples than `width * height`, or none.
    pub fn from_array<S: ArraySample>(
        heights: &[S],
        width: u32,
        height: u32,
    ) -> Result<TinBuilder<ArrayGrid<'_>>> {
        ArrayGrid::new(heights, width, height).map(TinBuilder::of)
    }

    /// What was asked for and is not so, in words: a few triangles with a smaller angle than
    /// [`min_angle`](TinBuilder::min_angle), or vertices on [`breaklines`](TinBuilder::breaklines) without an edge
    /// along them. `None` of nearly every mesh. The bound of the error always holds.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// let tin = terrane::open("synth:rough,size=129,seed=7")?.tin().max_error(5.0).min_angle(20.0).build()?;
    /// assert_eq!(tin.unmet(), None);
    /// # Ok(())
    /// # }
    /// ```
    pub fn unmet(&self) -> Option<&str> {
        self.unmet.as_deref()
    }

    /// Positions, x, y and z in the units of the grid.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// Corners as indices of [`vertices`](Self::vertices).
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The largest vertical distance of a valid sample from the mesh.
    pub fn max_error(&self) -> f64 {
        self.max_error
    }

    /// The root of the mean square of these distances.
    pub fn rmse(&self) -> f64 {
        self.rmse
    }

    /// The bound that was kept: the one asked for, or that which a number of vertices or triangles allowed.
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// The reference system of its positions.
    pub fn crs(&self) -> &Crs {
        &self.header.crs
    }

    /// All that it is made of, to be kept elsewhere.
    pub fn into_parts(self) -> TinParts {
        let Self { vertices, triangles, tolerance, max_error, rmse, unmet, header } = self;
        TinParts { vertices, triangles, tolerance, max_error, rmse, unmet, header }
    }

    /// The mesh that was taken apart.
    ///
    /// # Errors
    /// A corner that is no vertex.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// let tin = terrane::open("synth:rough,size=65")?.tin().max_error(5.0).build()?;
    /// let parts = tin.clone().into_parts();
    /// assert_eq!(terrane::Tin::from_parts(parts)?.triangles(), tin.triangles());
    /// # Ok(())
    /// # }
    /// ```
    pub fn from_parts(parts: TinParts) -> Result<Self> {
        let TinParts { vertices, triangles, tolerance, max_error, rmse, unmet, header } = parts;
        let is_vertex = |corner: &u32| (*corner as usize) < vertices.len();
        if let Some(number) = triangles.iter().position(|t| !t.iter().all(is_vertex)) {
            return Err(
                Error::bad_input("a corner is no vertex").at(format_args!("triangle {number}"))
            );
        }
        Ok(Self { vertices, triangles, tolerance, max_error, rmse, unmet, header })
    }
}

/// A mesh to be made: by greedy insertion (Garland and Heckbert 1995) in tiles that share the vertices along
/// their rims, joined without seams, redundant vertices dropped again.
///
/// One of [`max_error`](Self::max_error), [`max_vertices`](Self::max_vertices) and
/// [`max_triangles`](Self::max_triangles) says what it has to reach; the last one given counts. Takes time
/// about in proportion to the samples, and twice to six times as long for a number of vertices or triangles.
/// The result depends on nothing but the heights, this and the size of [tiles](Self::tile).
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("mesh.ply");
/// let dem = terrane::open("synth:rough,size=257,seed=7")?;
/// let report = dem.tin().max_error(2.0).memory("256M").write(&path)?;
/// assert!(report.vertices < 257 * 257);
/// assert!(dem.verify(&path).run()?.verdict.passed);
/// # Ok(())
/// # }
/// ```
pub struct TinBuilder<S> {
    source: S,
    goal: Option<Goal>,
    refinement: Refinement,
    keep_points: Option<PathBuf>,
    breaklines: Option<PathBuf>,
    tile: u32,
    format: Option<String>,
    split: Option<u32>,
    system: System,
    run: Run,
}

run_settings!([S] TinBuilder<S>);

impl<S> TinBuilder<S> {
    pub(super) fn of(source: S) -> Self {
        Self {
            source,
            goal: None,
            refinement: Refinement::default(),
            keep_points: None,
            breaklines: None,
            tile: USUAL_TILE,
            format: None,
            split: None,
            system: System::default(),
            run: Run::default(),
        }
    }

    /// No valid sample further than this from the mesh, vertically, in the unit of the heights. 0 keeps
    /// all but what lies in planes.
    pub fn max_error(mut self, tolerance: f64) -> Self {
        self.goal = Some(Goal::MaxError(tolerance));
        self
    }

    /// The smallest tolerance that so many vertices allow.
    pub fn max_vertices(mut self, count: u64) -> Self {
        self.goal = Some(Goal::MaxVertices(count));
        self
    }

    /// The smallest tolerance that so many triangles allow.
    pub fn max_triangles(mut self, count: u64) -> Self {
        self.goal = Some(Goal::MaxTriangles(count));
        self
    }

    /// Of what the error is promised: of all samples (so it is unless told otherwise), or of the lines
    /// between them as well.
    pub fn bound(mut self, bound: Bound) -> Self {
        self.refinement.bound = bound;
        self
    }

    /// Insert one largest error at a time, as the paper has it: slower, and more vertices.
    pub fn strict(mut self, strict: bool) -> Self {
        self.refinement.strict = strict;
        self
    }

    /// Drop vertices that later ones made redundant (so it is unless told otherwise).
    pub fn drop_redundant(mut self, drop: bool) -> Self {
        self.refinement.drop = drop;
        self
    }

    /// Let vertices lie above or below their samples, up to the tolerance, where that takes fewer of them: a
    /// tenth to a third fewer, mostly a fifth, in some five times the time. The bound is kept all the same.
    pub fn fit(mut self, fit: bool) -> Self {
        self.refinement.fit = fit;
        self
    }

    /// Let triangles be any that keep the error, not Delaunay ones alone, where that takes fewer vertices: a fifth
    /// to a third fewer, in some twice the time. They are thinner then; where none may be, say [`min_angle`](Self::min_angle).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("mesh.ply");
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let delaunay = dem.tin().max_error(5.0).build()?;
    /// let made = dem.tin().max_error(5.0).data_dependent(true).write(&path)?;
    /// assert!(made.vertices < delaunay.vertices().len() as u64);
    /// assert!(dem.verify(&path).run()?.verdict.passed);
    /// # Ok(())
    /// # }
    /// ```
    pub fn data_dependent(mut self, data_dependent: bool) -> Self {
        self.refinement.data_dependent = data_dependent;
        self
    }

    /// No triangle with a smaller angle than this in plan, in degrees, up to that of half of two cells (26.565 of
    /// square ones): samples are inserted until that holds. 20 degrees take a tenth to a half more of them.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("mesh.ply");
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let made = dem.tin().max_error(5.0).min_angle(20.0).write(&path)?;
    /// assert_eq!(made.thin_triangles.unwrap().count, 0);
    /// assert_eq!(dem.verify(&path).run()?.of.min_angle, Some(20.0));
    /// # Ok(())
    /// # }
    /// ```
    pub fn min_angle(mut self, degrees: f64) -> Self {
        self.refinement.min_angle = Some(degrees);
        self
    }

    /// Samples that stay vertices, at their heights: the nearest one to each point of a file of features, and to
    /// each vertex of its lines and polygons, in the system of the grid.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let (peaks, path) = (folder.path().join("peaks.wkt"), folder.path().join("mesh.ply"));
    /// # std::fs::write(&peaks, "MULTIPOINT ((500100 4749000), (500512 4749377))").unwrap();
    /// # std::fs::write(peaks.with_extension("prj"), "EPSG:32631").unwrap();
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let made = dem.tin().max_error(5.0).keep_points(&peaks).write(&path)?;
    /// assert_eq!(made.keep_points.unwrap().vertices, 2);
    /// assert!(dem.verify(&path).keep_points(&peaks).run()?.verdict.judged);
    /// # Ok(())
    /// # }
    /// ```
    pub fn keep_points(mut self, file: impl Into<PathBuf>) -> Self {
        self.keep_points = Some(file.into());
        self
    }

    /// Lines and polygons of a file of features, in the system of the grid, that edges of the mesh follow: from
    /// sample to sample, none further than 1.5 cells from its line.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let (roads, path) = (folder.path().join("roads.wkt"), folder.path().join("mesh.ply"));
    /// # std::fs::write(&roads, "LINESTRING (500100 4749000, 500512 4749377)").unwrap();
    /// # std::fs::write(roads.with_extension("prj"), "EPSG:32631").unwrap();
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let made = dem.tin().max_error(5.0).breaklines(&roads).write(&path)?;
    /// assert_eq!(made.breaklines.unwrap().apart, 0);
    /// assert!(dem.verify(&path).breaklines(&roads).run()?.verdict.judged);
    /// # Ok(())
    /// # }
    /// ```
    pub fn breaklines(mut self, file: impl Into<PathBuf>) -> Self {
        self.breaklines = Some(file.into());
        self
    }

    fn refinement(&self) -> Result<Refinement> {
        let name = |file: &Option<PathBuf>| file.clone().map(name_of).transpose();
        let [keep_points, breaklines] = [name(&self.keep_points)?, name(&self.breaklines)?];
        Ok(Refinement { keep_points, breaklines, ..self.refinement.clone() })
    }

    /// Cells along the side of a tile, 16 to 8192; 512 unless told otherwise. The mesh depends on it, and the
    /// memory that each thread takes.
    pub fn tile(mut self, cells: u32) -> Self {
        self.tile = cells;
        self
    }

    fn goal(&self) -> Result<Goal> {
        let none = || Error::usage("the mesh has nothing to reach").remedy("say .max_error(...)");
        self.goal.ok_or_else(none)
    }

    /// Makes the mesh by `build`, which is given a sink and the job.
    fn build_by(
        &self,
        build: impl FnOnce(Box<dyn MeshSink>, &BuildJob<'_>) -> Result<Built>,
    ) -> Result<Tin> {
        let (goal, resources) = (self.goal()?, &self.run.resources()?);
        let refinement = &self.refinement()?;
        let job = BuildJob { goal, refinement, tile: self.tile, resources };
        let kept = Kept::default();
        let built = build(Box::new(kept.clone()), &job)?;
        Ok(kept.into_tin(built))
    }
}

impl TinBuilder<ArrayGrid<'_>> {
    /// Where samples lie, and in which reference system.
    pub fn place(mut self, transform: Affine, crs: Crs) -> Self {
        self.source = self.source.placed(transform, crs);
        self
    }

    /// A value that stands for no height.
    pub fn nodata(mut self, value: f64) -> Self {
        self.source = self.source.with_nodata(Some(value));
        self
    }

    /// Makes the mesh.
    ///
    /// # Errors
    /// A tolerance that is none; no goal; samples without a cell of four valid ones; too few vertices
    /// allowed for any mesh; too little memory; cancelled.
    pub fn build(self) -> Result<Tin> {
        let Run { progress, cancel, .. } = &self.run;
        self.build_by(|sink, job| tin::build(&self.source, sink, job, &**progress, cancel))
    }
}

output_settings!([] TinBuilder<&Grid>);
system_settings!([] TinBuilder<&Grid>);

impl TinBuilder<&Grid> {
    /// Write a folder with a mesh for every so many by so many tiles.
    pub fn split(mut self, tiles: u32) -> Self {
        self.split = Some(tiles);
        self
    }

    /// Makes the mesh in memory, which it takes about 50 bytes a vertex of, beside what the job may use.
    ///
    /// # Errors
    /// As for arrays; damage in the grid's files; [`split`](Self::split), [`format`](Self::format) and
    /// [`to_crs`](Self::to_crs), which are about files.
    pub fn build(self) -> Result<Tin> {
        if self.split.is_some() || self.format.is_some() || self.system.transform()?.is_some() {
            return Err(Error::usage("a format, a split and another system are of files")
                .remedy("write the mesh, or leave them out"));
        }
        let Run { progress, cancel, .. } = &self.run;
        let Grid { inputs: input, reading, .. } = self.source;
        let options =
            reading.options(&self.run.resources()?, OpenOptions::default().cache_bytes)?;
        self.build_by(|sink, job| tin::build_files(input, &options, sink, job, &**progress, cancel))
    }

    /// Makes the mesh and writes it while it is made, whatever its size, within the memory allowed. The file
    /// appears whole or not at all.
    ///
    /// # Errors
    /// As [`build`](Self::build); an output that exists or cannot be written, or a format that does not hold
    /// the mesh; a system that nothing is known to lead to.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<TinReport> {
        tin::run(&self.job(path.into())?, &*self.run.progress, &self.run.cancel)
    }

    /// Writes down in a folder what is to be made and by which tasks, so that it can be done by pieces and by
    /// many machines: [`Plan`](crate::Plan). A task has `cut` rows of tiles, or as many as make a
    /// fair piece of work. The format is PLY unless told otherwise.
    ///
    /// # Errors
    /// As [`write`](Self::write); a goal other than an error; a folder that holds something else.
    pub fn plan(self, folder: impl Into<PathBuf>, cut: impl Into<Option<u32>>) -> Result<Plan> {
        if self.split.is_some() || self.run.overwrite {
            return Err(Error::usage(
                "a plan writes no mesh yet, to be split or in place of another",
            )
            .remedy("leave split and overwrite out"));
        }
        let folder = folder.into();
        let format = Some(self.format.clone().unwrap_or_else(|| "PLY".to_owned()));
        let job = TinJob { format, ..self.job(folder.join("mesh"))? };
        let plan = PlanJob { job, folder: folder.clone(), cut: cut.into(), skipped: Vec::new() };
        tin::plan_work(&plan, &*self.run.progress, &self.run.cancel)?;
        Plan::open(folder)
    }

    fn job(&self, output: PathBuf) -> Result<TinJob> {
        Ok(TinJob {
            reading: self.source.reading.clone(),
            format: self.format.clone(),
            overwrite: self.run.overwrite,
            split: self.split,
            transform: self.system.transform()?,
            refinement: self.refinement()?,
            tile: self.tile,
            resources: self.run.resources()?,
            ..TinJob::new(self.source.inputs.clone(), output, self.goal()?)
        })
    }
}

/// A sink that keeps what it is given.
#[derive(Clone, Default)]
struct Kept(Arc<Mutex<Lists>>);

#[derive(Default)]
struct Lists {
    pub(super) vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Kept {
    fn into_tin(self, built: Built) -> Tin {
        let mut lists = lock(&self.0);
        let Lists { vertices, triangles } = std::mem::take(&mut *lists);
        let Built { tolerance, outcome, unmet, header } = built;
        let surface = (outcome.valid - outcome.isolated).max(1) as f64;
        Tin {
            vertices,
            triangles,
            tolerance,
            max_error: outcome.max_error,
            rmse: (outcome.square_sum / surface).sqrt(),
            unmet,
            header,
        }
    }
}

impl MeshSink for Kept {
    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
        let mut lists = lock(&self.0);
        lists.vertices.extend_from_slice(batch.vertices);
        if u32::try_from(lists.vertices.len()).is_err() {
            return Err(Error::limit("number of vertices in memory", "above 2^32", u32::MAX)
                .remedy("write the mesh into a file, or allow a larger error"));
        }
        // An id is that of a vertex that came before.
        lists.triangles.extend(batch.triangles.iter().map(|t| t.map(|id| id as u32)));
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        Ok(0)
    }
}
