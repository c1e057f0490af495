//! Points of clouds into files of points.

use std::path::PathBuf;

use pyo3::prelude::*;
use terrane::{
    Above, BufferMark, Error, HeightsAs, LasVersion, PointFormat, PointsBuilder, Result, Split,
    Squares,
};

use crate::error::told;
use crate::grid::{System, with_system};
use crate::plan::Plan;
use crate::report::dictionary;
use crate::work::{Machine, Settings, run, with_machine};

/// Which points, written how, as Python has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Points {
    point_format: Option<u8>,
    las_version: Option<String>,
    dedupe: bool,
    thin: Option<String>,
    heights: Option<String>,
    classify: Vec<String>,
    ground: Option<String>,
    tile: Option<f64>,
    split: Option<String>,
    buffer: f64,
    buffer_mark: String,
}

/// The error of a text that says nothing known.
fn wrong(name: &'static str) -> impl Fn(String) -> Error {
    move |how| Error::usage(format!("{name}: {how}"))
}

impl Points {
    fn of<'a>(&self, cloud: &'a terrane::Cloud) -> Result<PointsBuilder<'a>> {
        let mut builder = cloud.points().dedupe(self.dedupe).above(self.above()?);
        if let Some(number) = self.point_format {
            builder = builder.format(PointFormat::new(number)?);
        }
        if let Some(text) = &self.las_version {
            let version: LasVersion = text.parse().map_err(wrong("las_version"))?;
            builder = builder.las_version(version);
        }
        if let Some(thin) = &self.thin {
            builder = builder.thin(thin.parse().map_err(wrong("thin"))?);
        }
        Ok(builder)
    }

    fn above(&self) -> Result<Above> {
        let heights = match self.heights.as_deref() {
            None => None,
            Some("dimension") => Some(HeightsAs::Dimension),
            Some("z") => Some(HeightsAs::Z),
            Some(other) => {
                return Err(wrong("heights")(format!("{other} is none of dimension, z")));
            }
        };
        let classify = self.classify.iter().map(|way| way.parse().map_err(wrong("classify")));
        let from = self.ground.as_deref().map_or(Ok(Default::default()), str::parse)?;
        Ok(Above { from, heights, classify: classify.collect::<Result<_>>()? })
    }

    fn squares(&self) -> Result<Option<Squares>> {
        let mark: BufferMark = self.buffer_mark.parse().map_err(wrong("buffer_mark"))?;
        Ok(self.tile.map(|side| Squares { side, buffer: self.buffer, mark }))
    }
}

/// Writes them: one file, or a folder of squares or of values.
pub(crate) fn write<'py>(
    py: Python<'py>,
    cloud: &terrane::Cloud,
    (path, asked, system): (PathBuf, &Points, System),
    overwrite: bool,
    settings: Settings,
) -> PyResult<Bound<'py, PyAny>> {
    let make = |machine: &Machine| {
        let builder = with_machine!(asked.of(cloud)?, machine).overwrite(overwrite);
        let builder = with_system!(builder, system);
        match (asked.squares()?, &asked.split) {
            (Some(squares), _) => builder.write_squares(squares, path),
            (None, Some(attribute)) => {
                let split = Split { attribute: attribute.clone(), is_plain: false };
                builder.write_split(split, path)
            }
            (None, None) => builder.write(path),
        }
    };
    let report = run(py, settings, make)?;
    dictionary(py, &report)
}

/// Plans a folder of squares.
pub(crate) fn plan(
    py: Python<'_>,
    cloud: &terrane::Cloud,
    (folder, asked, cut): (PathBuf, &Points, Option<u32>),
    settings: Settings,
) -> PyResult<Plan> {
    if asked.split.is_some() {
        let refused = Error::usage("split is not supported by plans of points");
        return told(py, Err(refused.remedy("call points(..., split=...) on the squares")));
    }
    let none = || Error::usage("a plan makes squares").remedy("pass tile=SIDE");
    let squares = told(py, asked.squares().and_then(|squares| squares.ok_or_else(none)))?;
    let make = |machine: &Machine| {
        with_machine!(asked.of(cloud)?, machine).plan_squares(squares, folder, cut)
    };
    run(py, settings, make).map(Plan)
}
