//! The grid of a plan: its statistics and its files.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::difference::refuse_another;
use super::files::with_companions;
use super::kind::PlannedWork;
use super::plan_file::PlanManifest;
use crate::options::GridInput;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_files::{is_made, name_of, path_of};
use terrane_raster::{self as raster, GridInfo, GridSource, Inputs};

/// Properties of the input grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedGrid {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    transform: [f64; 6],
    crs: String,
}

impl PlannedGrid {
    /// Properties of an opened grid.
    pub fn of(info: &GridInfo) -> Self {
        let Affine { x0, a, b, y0, d, e } = info.transform;
        let transform = [x0, a, b, y0, d, e];
        let crs = info.crs.wkt.clone().unwrap_or_else(|| info.crs.label());
        Self { width: info.width, height: info.height, transform, crs }
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Fails if the opened grid differs from the plan's, or is read from more files (`all`): an added companion file
    /// may declare voids.
    pub fn check<W: PlannedWork>(
        &self,
        plan: &PlanManifest<W>,
        source: &dyn GridSource,
        all: Vec<PathBuf>,
    ) -> Result<()> {
        let known: HashSet<Cow<'_, Path>> = plan.files().collect();
        let all = with_companions(all);
        if let Some(new) = all.iter().find(|path| !known.contains(path.as_path())) {
            return Err(Error::bad_input("is read with the input but is not part of the plan")
                .in_file(new)
                .remedy("move it away, or make a new plan in another folder"));
        }
        refuse_another("grid", &plan.label, self, &Self::of(source.info()))
    }
}

/// The files of a grid: those of its input, and companion files.
pub fn grid_files(input: &Inputs, reading: &GridInput, source: &dyn GridSource) -> Vec<PathBuf> {
    let members = source.members().into_iter().filter_map(|path| name_of(path).ok());
    let names = input.names().iter().cloned().chain(members).filter(|name| !is_made(name));
    let paths = names.map(|name| path_of(raster::file_name(&name)).into_owned());
    paths.chain(reading.files()).collect()
}
