//! The result of one task: a GeoTIFF with the values of a tile's cells, and a note that seals it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::manifest::{Cells, TaskId};
use crate::grid::GridJob;
use crate::grid::extent::Extent;
use crate::grid::make::Maker;
use crate::grid::neighbours;
use crate::grid::report::GridReport;
use crate::plan::{self, Digest, Look, OBJECTS, damaged_object as damaged};
use crate::points::reach;
use crate::{Cancel, Progress};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{REACH, Rect};
use terrane_cloud::{Census, PointSource};
use terrane_delaunay::Window;
use terrane_gridding::{Axis, Recipe, Shape, Statistic};
use terrane_raster::SampleType;

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
    /// Of all the above.
    seal: Digest,
}

impl Done {
    fn sealed(self) -> Self {
        let counts = [self.bytes, self.read, self.kept, self.spilled].map(u64::to_le_bytes);
        let parts = [self.key.bytes(), self.digest.bytes(), counts.as_flattened()];
        Self { seal: Digest::of_parts(&parts), ..self }
    }
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

    /// What is done; `None` when it is not. Fails when it is there and damaged.
    pub(super) fn look(&self, look: Look, cancel: &Cancel) -> Result<Option<Done>> {
        cancel.check()?;
        let Ok(text) = std::fs::read(&self.note) else { return Ok(None) };
        let Ok(file) = std::fs::metadata(&self.file) else { return Ok(None) };
        let done: Done = serde_json::from_slice(&text).map_err(|_| damaged(&self.note))?;
        if done.key != self.key || done.clone().sealed() != done {
            return Err(damaged(&self.note));
        }
        let digest = || plan::digest_of(std::slice::from_ref(&self.file), cancel);
        if done.bytes != file.len() || (look == Look::Whole && digest()? != done.digest) {
            return Err(damaged(&self.file));
        }
        Ok(Some(done))
    }

    /// Seals the file that was just written.
    fn seal(&self, census: &Census, spilled: u64, cancel: &Cancel) -> Result<Done> {
        let digest = plan::digest_of(std::slice::from_ref(&self.file), cancel)?;
        let bytes = std::fs::metadata(&self.file).map_err(|e| Error::read(&self.file, e))?.len();
        let Census { read, kept, .. } = *census;
        let done = Done { key: self.key, digest, bytes, read, kept, spilled, seal: self.key };
        let done = done.sealed();
        plan::write_json(&self.note, &done)?;
        Ok(done)
    }
}

/// Which tiles are done.
#[derive(Default)]
pub(super) struct Survey {
    pub(super) done: BTreeMap<u32, Done>,
    /// Those that are there and not sound; what is in neither is missing.
    pub(super) damaged: Vec<u32>,
}

impl Survey {
    /// Looks for the results of all tiles, in parallel; tells `progress` of each. Fails when it is to
    /// stop.
    pub(super) fn of(
        (folder, plan): (&Path, Digest),
        cells: &Cells,
        look: Look,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self> {
        let find = |&tile: &u32| {
            progress.advance(1);
            (tile, Place::new(folder, plan, TaskId::Tile(tile)).look(look, cancel))
        };
        let tiles: Vec<u32> = cells.tiles().collect();
        let found: Vec<_> = tiles.par_iter().map(find).collect();
        // What was not read to its end is not known to be damaged.
        cancel.check()?;
        let mut survey = Self::default();
        for (tile, found) in found {
            match found {
                Ok(Some(done)) => drop(survey.done.insert(tile, done)),
                Ok(None) => {}
                Err(_) => survey.damaged.push(tile),
            }
        }
        Ok(survey)
    }

    /// The first tile of `cells` that is missing.
    pub(super) fn missing(&self, cells: &Cells) -> Option<TaskId> {
        let is_there = |tile: &u32| self.done.contains_key(tile) || self.damaged.contains(tile);
        cells.tiles().find(|tile| !is_there(tile)).map(TaskId::Tile)
    }
}

/// A plan's cloud and cells, opened.
pub(super) struct Opened {
    pub(super) job: GridJob,
    pub(super) points: Box<dyn PointSource>,
    pub(super) extent: Extent,
}

impl Opened {
    /// Makes the tile of these `cells` from the part of the cloud that lies near it, or as much more as
    /// it takes.
    pub(super) fn make(
        &self,
        (cells, place): (Rect, &Place),
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Done> {
        let mut near = self.near(cells);
        loop {
            if let Some(made) = self.try_make(cells, &place.file, near, (progress, cancel))? {
                return place.seal(&made.points, made.spilled_bytes, cancel);
            }
            near = near.map(Near::wider);
        }
    }

    /// Writes the tile of these `cells` to `file` from the parts `within`; `None` when these are too few.
    pub(super) fn try_make(
        &self,
        cells: Rect,
        file: &Path,
        near: Option<Near>,
        (progress, cancel): (&dyn Progress, &Cancel),
    ) -> Result<Option<GridReport>> {
        let (points, job) = (&*self.points, self.job_of(file));
        let extent = self.extent.part(cells, points.info());
        let within = near.map(Near::window);
        Maker { points, job: &job, extent, within, progress, cancel }.try_make()
    }

    /// What is read for the tile of these `cells` at first; `None` for the whole cloud.
    pub(super) fn near(&self, cells: Rect) -> Option<Near> {
        let extent = self.extent.part(cells, self.points.info());
        let recipe = Recipe::new(&self.job.stats, &self.job.rules(extent.cell()));
        let cells = self.window(&extent, recipe.reach());
        let margin = self.margin(&recipe, &cells)?;
        Some(Near { cells, margin })
    }

    /// The job whose output is a tile's result.
    pub(super) fn job_of(&self, file: &Path) -> GridJob {
        let creation = CREATION.map(|(key, value)| (key.to_owned(), value.to_owned()));
        GridJob {
            output: file.to_path_buf(),
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
        let own = |statistic: &Statistic| match statistic.shape() {
            Some(Shape::Natural) => None,
            Some(Shape::Linear { max_edge }) => {
                // What has long edges is void, whatever lies further away.
                let longest = max_edge.or(self.job.max_edge).map(|most| reach(&info.frame, most));
                Some(longest.unwrap_or(0).max(neighbours::tiling(info).side()).saturating_add(4))
            }
            None => Some(0),
        };
        let margins = recipe.bands().iter().map(|band| own(&band.statistic));
        let most = margins.reduce(|a, b| Some(a?.max(b?))).flatten()?;
        let side = |axis: usize| cells.high[axis].abs_diff(cells.low[axis]) / 8;
        // A narrow tile among far points: some of its own size at least.
        Some(if most == 0 { 0 } else { most.max(side(0).min(side(1)) as i32) })
    }
}

/// What is read of a cloud for some cells.
#[derive(Clone, Copy)]
pub(super) struct Near {
    cells: Window,
    /// Steps around them.
    margin: i32,
}

impl Near {
    pub(super) fn window(self) -> Window {
        self.cells.grown(self.margin)
    }

    fn wider(self) -> Self {
        Self { margin: self.margin.saturating_mul(WIDER).min(REACH), ..self }
    }
}

/// The values of the cells of all tiles.
pub(super) struct Tiles {
    /// By band.
    pub(super) bands: Vec<Box<dyn terrane_raster::GridSource>>,
}

impl crate::grid::source::Cells for Tiles {
    fn values(
        &self,
        number: usize,
        _: &terrane_gridding::Band,
        rect: Rect,
        out: &mut [f64],
    ) -> Result<()> {
        self.bands[number].read_f64(rect, out)
    }
}
