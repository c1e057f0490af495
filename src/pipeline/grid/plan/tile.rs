//! The result of one task: a GeoTIFF with the values of a tile's cells, and a note that seals it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::manifest::{Manifest, TaskId};
use crate::cloud::{Census, PointSource};
use crate::delaunay::Window;
use crate::error::{Error, ErrorKind, Result};
use crate::geom::{REACH, Rect};
use crate::gridding::{Axis, Recipe, Statistic};
use crate::pipeline::grid::GridJob;
use crate::pipeline::grid::extent::Extent;
use crate::pipeline::grid::make::Maker;
use crate::pipeline::grid::surface;
use crate::pipeline::plan::{self, Digest, OBJECTS};
use crate::pipeline::points::reach;
use crate::pipeline::{Cancel, Progress};
use crate::raster::SampleType;

/// Values are kept as they were computed, and compressed.
const CREATION: [(&str, &str); 3] = [("COMPRESS", "ZSTD"), ("PREDICTOR", "3"), ("BIGTIFF", "YES")];
/// How many times wider the window becomes when one was too small.
const WIDER: i32 = 4;

/// What is known of a tile that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Done {
    /// Of the plan and the task.
    key: Digest,
    /// Of the file's bytes.
    digest: Digest,
    pub(super) bytes: u64,
    pub(super) read: u64,
    pub(super) kept: u64,
    pub(super) spilled: u64,
}

/// Where a tile's result lies.
pub(super) struct Place {
    pub(super) file: PathBuf,
    note: PathBuf,
    key: Digest,
}

impl Place {
    pub(super) fn new(folder: &Path, plan: Digest, task: TaskId) -> Self {
        let key = Digest::of_parts(&[&plan.0, task.to_string().as_bytes()]);
        let name = format!("{task}-{}", key.short());
        let at = |ending: &str| folder.join(OBJECTS).join(format!("{name}.{ending}"));
        Self { file: at("tif"), note: at("json"), key }
    }

    /// What is done; `None` when it is not. Fails when it is there and damaged; with `whole`, every
    /// byte is looked at.
    pub(super) fn look(&self, whole: bool, cancel: &Cancel) -> Result<Option<Done>> {
        let Ok(text) = std::fs::read(&self.note) else { return Ok(None) };
        let done: Done = serde_json::from_slice(&text).map_err(|_| damaged(&self.note))?;
        let bytes = std::fs::metadata(&self.file).map_err(|_| damaged(&self.file))?.len();
        if done.key != self.key || done.bytes != bytes {
            return Err(damaged(&self.file));
        }
        if whole && plan::digest_of(std::slice::from_ref(&self.file), cancel)? != done.digest {
            return Err(damaged(&self.file));
        }
        Ok(Some(done))
    }

    /// Seals the file that was just written.
    fn seal(&self, census: &Census, spilled: u64, cancel: &Cancel) -> Result<Done> {
        let digest = plan::digest_of(std::slice::from_ref(&self.file), cancel)?;
        let bytes = std::fs::metadata(&self.file).map_err(|e| Error::read(&self.file, e))?.len();
        let Census { read, kept, .. } = *census;
        let done = Done { key: self.key, digest, bytes, read, kept, spilled };
        plan::write_json(&self.note, &done)?;
        Ok(done)
    }
}

fn damaged(path: &Path) -> Error {
    Error::new(ErrorKind::Io, "is damaged")
        .in_file(path)
        .remedy("run again: what is damaged is made anew")
}

/// A plan's cloud and cells, opened.
pub(super) struct Opened {
    pub(super) job: GridJob,
    pub(super) points: Box<dyn PointSource>,
    pub(super) extent: Extent,
}

impl Opened {
    /// Makes a tile from the part of the cloud that lies near it, or as much more as it takes.
    pub(super) fn make(
        &self,
        plan: &Manifest,
        (task, place): (TaskId, &Place),
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Done> {
        let job = self.job_of(place);
        let (points, extent) =
            (&*self.points, self.extent.part(plan.grid.cells(task), self.points.info()));
        let recipe = Recipe::new(&job.stats, &job.rules(extent.cell()));
        let cells = self.window(&extent, recipe.reach());
        let mut margin = self.margin(&recipe, &cells);
        loop {
            let within = margin.map(|margin| cells.grown(margin));
            let extent = extent.clone();
            let maker = Maker { points, job: &job, extent, within, progress, cancel };
            if let Some(made) = maker.try_make()? {
                return place.seal(&made.points, made.spilled_bytes, cancel);
            }
            margin = margin.map(|margin| margin.saturating_mul(WIDER).min(REACH));
        }
    }

    /// The job whose output is a tile's result.
    fn job_of(&self, place: &Place) -> GridJob {
        let creation = CREATION.map(|(key, value)| (key.to_owned(), value.to_owned()));
        GridJob {
            output: place.file.clone(),
            format: Some("GTiff".to_owned()),
            creation: creation.to_vec(),
            sample_type: SampleType::F64,
            round: false,
            nodata: f64::NAN,
            overwrite: true,
            ..self.job.clone()
        }
    }

    /// All that lies less than `reach` world units from the centre of a cell, or in one.
    fn window(&self, extent: &Extent, reach: f64) -> Window {
        let frame = &self.points.info().frame;
        let ends = |axis: usize, cells: Axis, count: u32| {
            let [a, b] = [0, count - 1].map(|cell| cells.world_centre(i64::from(cell)));
            let margin = cells.world_cell().max(reach);
            let low = frame.steps(axis, a.min(b) - margin).floor() - 1.0;
            let high = frame.steps(axis, a.max(b) + margin).ceil() + 1.0;
            [low, high].map(|steps| steps.clamp(f64::from(-REACH), f64::from(REACH)) as i32)
        };
        let (width, height) = extent.lattice.size();
        let [west, east] = ends(0, extent.lattice.x, width);
        let [south, north] = ends(1, extent.lattice.y, height);
        Window { low: [west, south], high: [east, north] }
    }

    /// Steps around the cells that are read at first; `None` for the whole cloud.
    fn margin(&self, recipe: &Recipe, cells: &Window) -> Option<i32> {
        let info = self.points.info();
        let own = |statistic: &Statistic| match *statistic {
            Statistic::Natural => None,
            Statistic::Tin { max_edge } => {
                // What has long edges is void, whatever lies further away.
                let longest = max_edge.or(self.job.max_edge).map(|most| reach(&info.frame, most));
                Some(longest.unwrap_or(0).max(surface::tiling(info).side()).saturating_add(4))
            }
            _ => Some(0),
        };
        let margins = recipe.bands().iter().map(|band| own(&band.statistic));
        let most = margins.reduce(|a, b| Some(a?.max(b?))).flatten()?;
        let side = |axis: usize| cells.high[axis].abs_diff(cells.low[axis]) / 8;
        // A narrow tile among far points: some of its own size at least.
        Some(if most == 0 { 0 } else { most.max(side(0).min(side(1)) as i32) })
    }
}

/// The values of the cells of all tiles.
pub(super) struct Tiles {
    /// By band.
    pub(super) bands: Vec<Box<dyn crate::raster::GridSource>>,
}

impl crate::pipeline::grid::source::Cells for Tiles {
    fn values(
        &self,
        number: usize,
        _: &crate::gridding::Band,
        rect: Rect,
        out: &mut [f64],
    ) -> Result<()> {
        self.bands[number].read_f64(rect, out)
    }
}
