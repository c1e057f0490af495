//! Meshes with a proven bound on their error, in memory.

use std::sync::{Arc, Mutex};

use terrane_options::{Options, check, to_map};

use super::build::{BuildJob, BuildOutcome, build, build_files};
use super::options::TinOptions;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_engine::operation::Job;
use terrane_engine::options::GridInput;
use terrane_files::lock;
use terrane_mesh::{MeshBatch, MeshHeader, MeshSink};
use terrane_raster::{ArrayGrid, ArraySample, GridOpenOptions};

/// A triangle mesh in memory.
///
/// Vertices are samples of the grid it was made from; triangles refer to them by index and are
/// counter-clockwise seen from above. The mesh is Delaunay on the lattice of samples (unless
/// [asked not to be](super::TinMethodSetters::triangulation)), has no cracks, and covers every cell whose
/// four samples are valid, and nothing else.
///
/// ```
/// # fn main() -> terrane_base::Result<()> {
/// use terrane_terrain::tin::{BuildTin, TinTargetSetters, Tin};
/// let heights: Vec<f32> = (0..64 * 64).map(|i| ((i % 64) as f32 / 5.0).sin() * 10.0).collect();
/// let tin = Tin::from_array(&heights, 64, 64)?.max_error(0.5).build()?;
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
    shortfall: Option<String>,
    pub(super) header: MeshHeader,
}

/// The parts of a [`Tin`].
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
    /// Requirements that the mesh does not meet.
    pub shortfall: Option<String>,
    /// Header for its files.
    pub header: MeshHeader,
}

impl Tin {
    /// A mesh of `height` rows of `width` samples each, row by row, of any type of number. NaN and infinities
    /// are voids. x is the column and y the row with its sign changed, unless
    /// [`place`](SamplePositions::place)d elsewhere.
    ///
    /// # Errors
    /// A number of samples other than `width * height`, or 0.
    pub fn from_array<S: ArraySample>(
        heights: &[S],
        width: u32,
        height: u32,
    ) -> Result<Job<'_, TinOptions, ArrayGrid<'_>>> {
        let grid = ArrayGrid::new(heights, width, height)?;
        Ok(Job::new(grid, TinOptions::default()))
    }

    /// Requirements that the mesh does not meet, as text: triangles with an angle below
    /// [`min_angle`](super::TinMethodSetters::min_angle), or vertices on
    /// [`breaklines`](terrane_engine::options::ConstraintsSetters::breaklines) without an edge along them.
    /// `None` for nearly every mesh. The error bound always holds.
    ///
    /// ```
    /// # fn main() -> terrane_base::Result<()> {
    /// use terrane_terrain::tin::{BuildTin, TinMethodSetters, TinTargetSetters, Tin};
    /// let tin = Tin::from_array(&[0.0_f32, 1.0, 4.0, 9.0, 2.0, 3.0], 3, 2)?.max_error(0.5).min_angle(20.0).build()?;
    /// assert_eq!(tin.shortfall(), None);
    /// # Ok(())
    /// # }
    /// ```
    pub fn shortfall(&self) -> Option<&str> {
        self.shortfall.as_deref()
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

    /// The error bound of the mesh: the given tolerance, or the one found for a budget of vertices or
    /// triangles.
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// CRS of the positions.
    pub fn crs(&self) -> &Crs {
        &self.header.crs
    }

    /// Takes the mesh apart, for storage elsewhere.
    pub fn into_parts(self) -> TinParts {
        let Self { vertices, triangles, tolerance, max_error, rmse, shortfall, header } = self;
        TinParts { vertices, triangles, tolerance, max_error, rmse, shortfall, header }
    }

    /// The mesh from its parts.
    ///
    /// # Errors
    /// A corner that is not the index of a vertex.
    ///
    /// ```
    /// # fn main() -> terrane_base::Result<()> {
    /// use terrane_terrain::tin::{BuildTin, TinTargetSetters, Tin};
    /// let tin = Tin::from_array(&[0.0_f32, 1.0, 4.0, 9.0], 2, 2)?.max_error(5.0).build()?;
    /// let parts = tin.clone().into_parts();
    /// assert_eq!(Tin::from_parts(parts)?.triangles(), tin.triangles());
    /// # Ok(())
    /// # }
    /// ```
    pub fn from_parts(parts: TinParts) -> Result<Self> {
        let TinParts { vertices, triangles, tolerance, max_error, rmse, shortfall, header } = parts;
        let wrong = triangles
            .iter()
            .position(|triangle| triangle.iter().any(|&id| id as usize >= vertices.len()));
        if let Some(number) = wrong {
            return Err(Error::bad_input("a corner is not the index of a vertex")
                .at(format_args!("triangle {number}")));
        }
        Ok(Self { vertices, triangles, tolerance, max_error, rmse, shortfall, header })
    }
}

/// Georeferencing of samples in memory.
pub trait SamplePositions: Sized {
    /// Sets the geotransform and the CRS of the samples.
    #[must_use]
    fn place(self, transform: Affine, crs: Crs) -> Self;
}

impl SamplePositions for Job<'_, TinOptions, ArrayGrid<'_>> {
    fn place(self, transform: Affine, crs: Crs) -> Self {
        self.with_source(|grid| grid.placed(transform, crs))
    }
}

/// Building a mesh in memory, without a file.
pub trait BuildTin {
    /// Makes the mesh in memory. It takes about 50 bytes a vertex beside the budget of the job.
    ///
    /// # Errors
    /// An invalid tolerance; no target; conflicting options, or options for meshes in files; damaged grid
    /// files; no cell with four valid samples; a budget below the coarsest mesh; too little memory;
    /// cancellation.
    fn build(self) -> Result<Tin>;
}

impl BuildTin for Job<'_, TinOptions, ArrayGrid<'_>> {
    fn build(self) -> Result<Tin> {
        self.act(|grid, options, progress, cancel| {
            let nodata = options.grid.nodata;
            let mut reading = GridInput::default();
            reading.nodata = nodata;
            options.check_in_memory(&reading)?;
            let grid = match nodata {
                Some(_) => grid.with_nodata(nodata),
                None => grid,
            };
            build_by(options, |sink, job| build(&grid, sink, job, progress, cancel))
        })
    }
}

impl BuildTin for Job<'_, TinOptions> {
    fn build(self) -> Result<Tin> {
        self.act(|inputs, options, progress, cancel| {
            options.check_in_memory(&options.grid)?;
            let cache_bytes = GridOpenOptions::default().cache_bytes;
            let open = options.grid.options(&options.resources, cache_bytes)?;
            build_by(options, |sink, job| build_files(&inputs, &open, sink, job, progress, cancel))
        })
    }
}

impl TinOptions {
    /// Fails for options that a mesh in memory does not support, and for conflicting options.
    ///
    /// # Errors
    /// Usage: the first of these options.
    pub fn check_in_memory(&self, grid: &GridInput) -> Result<()> {
        let Self { target, refinement, tile, resources, .. } = self.clone();
        let (grid, others) = (grid.clone(), Self::default());
        let supported = to_map(&Self { target, refinement, tile, resources, grid, ..others });
        let of_files =
            to_map(self).into_iter().find(|(name, value)| supported.get(name) != Some(value));
        if let Some((name, _)) = of_files {
            let why = match GridInput::TABLE.find(&name) {
                Some(_) => "is only supported for grids in files",
                None => "is only supported for meshes in files",
            };
            return Err(Error::usage(format!("‹{name}› {why}"))
                .remedy(format!("leave ‹{name}› out, or write a file")));
        }
        check(self)?;
        self.textbook().map(drop)
    }
}

/// Makes a mesh by `build`, which is given a sink and the job.
fn build_by(
    options: &TinOptions,
    build: impl FnOnce(Box<dyn MeshSink>, &BuildJob<'_>) -> Result<BuildOutcome>,
) -> Result<Tin> {
    let TinOptions { refinement, tile, resources, .. } = options;
    let job = BuildJob { goal: options.target.goal()?, refinement, tile: *tile, resources };
    let sink = MemorySink::default();
    let built = build(Box::new(sink.clone()), &job)?;
    Ok(sink.into_tin(built))
}

/// A sink that keeps vertices and triangles in memory.
#[derive(Clone, Default)]
struct MemorySink(Arc<Mutex<TinArrays>>);

#[derive(Default)]
struct TinArrays {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl MemorySink {
    fn into_tin(self, built: BuildOutcome) -> Tin {
        let mut lists = lock(&self.0);
        let TinArrays { vertices, triangles } = std::mem::take(&mut *lists);
        let BuildOutcome { tolerance, outcome, shortfall, header } = built;
        let surface = (outcome.valid - outcome.isolated).max(1) as f64;
        Tin {
            vertices,
            triangles,
            tolerance,
            max_error: outcome.max_error,
            rmse: (outcome.square_sum / surface).sqrt(),
            shortfall,
            header,
        }
    }
}

impl MeshSink for MemorySink {
    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
        let mut lists = lock(&self.0);
        lists.vertices.extend_from_slice(batch.vertices);
        if u32::try_from(lists.vertices.len()).is_err() {
            return Err(Error::limit("number of vertices in memory", "above 2^32", u32::MAX)
                .remedy("write the mesh to a file, or raise ‹max_error›"));
        }
        // An id is that of a vertex that came before.
        lists.triangles.extend(batch.triangles.iter().map(|t| t.map(|id| id as u32)));
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        Ok(0)
    }
}
