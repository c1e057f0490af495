//! Options of pages.

use std::path::Path;

use terrane_options::{OptionRange, OptionRule, Options};

use super::{
    MAX_POINTS, PageJob, PageReport, cloud, grid_sample, insertion, lines, surface, tiles,
};
use crate::html::HtmlPage;
use crate::view::{Exaggeration, Lighting};
use terrane_base::error::{Error, Result};
use terrane_engine::input::{self, SurfaceInput};
use terrane_engine::memory::cache_beside;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{CloudInput, FeatureInput, FileName, GridInput, Replacing};
use terrane_engine::outputs::check_ending;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_raster::Inputs;

terrane_engine::has_within!(PageOptions TilesPageOptions: Lighting => [Exaggeration]);

/// Make an interactive page of a grid or mesh: one self-contained HTML file
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_SURFACES)]
#[non_exhaustive]
pub struct PageOptions {
    /// Grid to compare a mesh with: shows the maximum error of each triangle
    #[option(value = "GRID", with = FileName, role = ReadsGrid)]
    pub against: Option<String>,
    /// Animate greedy insertion on a small grid, for teaching. Large grids are subsampled to at most 129 samples along
    /// a side
    pub insertion: bool,
    /// Show triangle edges from the start
    pub edges: bool,
    /// How it is lit at the start.
    #[option(flatten)]
    pub lighting: Lighting,
    /// How the grid is read; within its bounds, which may be those of a part of a mesh, too.
    #[option(flatten)]
    pub grid: GridInput,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const OF_SURFACES: &[OptionRule] = &[OptionRule::NotWith("insertion", &["against", "edges"])];

/// Make an interactive page of a point cloud: one self-contained HTML file
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct CloudPageOptions {
    /// Maximum number of points shown; larger clouds are thinned evenly
    #[option(value = "N", default = 2_000_000u64, range = OptionRange::new(1.0, MAX_POINTS as f64))]
    pub points: u64,
    /// How high heights look at the start.
    #[option(flatten)]
    pub heights: Exaggeration,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Make an interactive page of lines and polygons with all their simplifications: one self-contained HTML file
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct LinePageOptions {
    /// How the lines are read.
    #[option(flatten)]
    pub features: FeatureInput,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Make an interactive page of terrain tiles, loaded from a server of their folder
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
pub struct TilesPageOptions {
    /// Show triangle edges from the start
    pub edges: bool,
    /// How it is lit at the start.
    #[option(flatten)]
    pub lighting: Lighting,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const ENDINGS: &[&str] = &["html", "htm"];

impl Operation for PageOptions {
    const NAME: &'static str = "page";
    type Input = GridInput;
    const WRITES: Writes = Writes::Page;
    type Report = PageReport;

    fn check(&self, output: &Path) -> Result<()> {
        check_ending(output, ENDINGS, "a page")
    }

    fn run(&self, request: RunRequest<'_>) -> Result<PageReport> {
        let job = PageJob {
            lighting: self.lighting.clone(),
            edges: self.edges,
            ..PageJob::of(&request, &self.replacing, &self.resources)
        };
        job.write(|| self.make(&job, request.progress, request.cancel), request.cancel)
    }
}

impl PageOptions {
    fn make(
        &self,
        job: &PageJob<'_>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(HtmlPage, PageReport)> {
        let part = self.grid.bounds;
        // The page crops: a mesh has bounds too.
        let unbounded = self.grid.unbounded();
        let opening = unbounded.options(job.resources, cache_beside(job.resources.memory))?;
        match (input::open(job.input.names(), &opening)?, &self.against) {
            (SurfaceInput::Grid(_), Some(_)) => {
                Err(Error::usage("‹against› requires a mesh, not a grid")
                    .remedy("leave ‹against› out, or make a mesh with ‹terrane tin›"))
            }
            (SurfaceInput::Grid(grid), None) if self.insertion => {
                insertion::page(grid.as_ref(), part, job, cancel)
            }
            (SurfaceInput::Grid(grid), None) => {
                grid_sample::page(grid.as_ref(), part, job, progress, cancel)
            }
            (SurfaceInput::Mesh(_), _) if self.insertion => {
                Err(Error::usage("the insertion page requires a grid, not a mesh")
                    .remedy("name the source grid of the mesh"))
            }
            (SurfaceInput::Mesh(mesh), Some(grid)) => {
                let against = surface::ReferenceGrid { name: Inputs::from(grid.as_str()), opening };
                surface::page(mesh.as_ref(), Some(&against), part, job, progress, cancel)
            }
            (SurfaceInput::Mesh(mesh), None) => {
                self.grid.refuse_for_meshes()?;
                surface::page(mesh.as_ref(), None, part, job, progress, cancel)
            }
        }
    }
}

impl Operation for CloudPageOptions {
    const NAME: &'static str = "cloud-page";
    type Input = CloudInput;
    const WRITES: Writes = Writes::Page;
    type Report = PageReport;

    fn check(&self, output: &Path) -> Result<()> {
        check_ending(output, ENDINGS, "a page")
    }

    fn run(&self, request: RunRequest<'_>) -> Result<PageReport> {
        let heights = self.heights.clone();
        let job = PageJob {
            lighting: Lighting { heights, ..Lighting::default() },
            ..PageJob::of(&request, &self.replacing, &self.resources)
        };
        let opening = self.cloud.options(&self.resources)?;
        job.write(
            || cloud::page(&opening, self.points, &job, request.progress, request.cancel),
            request.cancel,
        )
    }
}

impl Operation for LinePageOptions {
    const NAME: &'static str = "line-page";
    type Input = FeatureInput;
    const WRITES: Writes = Writes::Page;
    type Report = PageReport;

    fn check(&self, output: &Path) -> Result<()> {
        check_ending(output, ENDINGS, "a page")
    }

    fn run(&self, request: RunRequest<'_>) -> Result<PageReport> {
        let job = PageJob::of(&request, &self.replacing, &self.resources);
        let layer = self.features.layer.as_ref();
        job.write(|| lines::page(layer, &job, request.progress, request.cancel), request.cancel)
    }
}

impl TilesPageOptions {
    /// Makes the page of a folder of tiles in a file.
    ///
    /// # Errors
    /// A folder whose kind of tiles is undeclared; a file that cannot be written; cancelled.
    pub fn run(&self, folder: &Inputs, output: &Path, cancel: &Cancel) -> Result<PageReport> {
        let (lighting, edges) = (self.lighting.clone(), self.edges);
        let (overwrite, resources) = (false, &self.resources);
        let job = PageJob { input: folder, output, overwrite, lighting, edges, resources };
        job.write(|| tiles::page(&job), cancel)
    }
}

impl<'a> PageJob<'a> {
    fn of(request: &RunRequest<'a>, replacing: &Replacing, resources: &'a Resources) -> Self {
        let RunRequest { inputs: input, output, .. } = *request;
        let overwrite = replacing.overwrite;
        Self { input, output, overwrite, lighting: Lighting::default(), edges: false, resources }
    }
}
