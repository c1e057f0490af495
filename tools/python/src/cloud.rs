//! Point clouds, in files and in memory, and what is made of them.

use std::num::NonZeroU32;
use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use terrane::{Error, Filter, Flags, GridBuilder, Marks, Preset, Return};

use crate::error::told;
use crate::grid::{System, crs_of, inputs};
use crate::mesh::crs_text;
use crate::plan::Plan;
use crate::points::{self, Points};
use crate::report::dictionary;
use crate::work::{Machine, Settings, run, with_machine};

/// A point cloud.
#[pyclass(frozen, module = "terrane._terrane")]
pub(crate) struct Cloud(terrane::Cloud);

/// Which points are wanted, as Python has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Wanted {
    classes: Option<Vec<u8>>,
    returns: Option<String>,
    keep_withheld: bool,
    bounds: Option<[f64; 4]>,
    z_range: Option<[f64; 2]>,
    r#where: Option<String>,
    every: Option<NonZeroU32>,
    salvage: bool,
}

impl Wanted {
    fn of(self, mut cloud: terrane::Cloud) -> terrane::Result<terrane::Cloud> {
        let returns = self.returns.as_deref().map(return_of).transpose()?;
        let condition = self.r#where.as_deref().map(str::parse).transpose();
        let condition = condition.map_err(|how| Error::usage(format!("where: {how}")))?;
        let filter = Filter {
            classes: self.classes,
            returns,
            keep_withheld: self.keep_withheld,
            bounds: self.bounds,
            z_range: self.z_range,
            condition,
            every: self.every,
            ..Filter::default()
        };
        if self.salvage {
            cloud = cloud.salvage(true)?;
        }
        if filter == Filter::default() { Ok(cloud) } else { cloud.filter(filter) }
    }
}

fn return_of(name: &str) -> terrane::Result<Return> {
    match (name, name.parse::<u8>()) {
        ("first", _) => Ok(Return::First),
        ("last", _) => Ok(Return::Last),
        ("only", _) => Ok(Return::Only),
        (_, Ok(number)) if number > 0 => Ok(Return::Number(number)),
        _ => Err(terrane::Error::usage(format!("{name:?} is no return of a pulse"))
            .remedy("say \"first\", \"last\", \"only\" or a number from 1")),
    }
}

/// What a grid of points is to be, as Python has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Asked {
    cell: Option<f64>,
    stats: Option<String>,
    model: Option<String>,
    bounds: Option<[f64; 4]>,
    like: Option<String>,
    radius: Option<f64>,
    max_edge: Option<f64>,
    fill: u32,
    water: Option<PathBuf>,
    canopy: Option<String>,
    format: Option<String>,
    creation: Vec<(String, String)>,
}

impl Asked {
    fn of<'a>(&self, cloud: &'a terrane::Cloud) -> terrane::Result<GridBuilder<'a>> {
        let mut builder = cloud.grid(self.cell).fill(self.fill);
        if let Some(stats) = &self.stats {
            builder = builder.stats(stats);
        }
        if let Some(model) = &self.model {
            let unknown = || terrane::Error::usage(format!("{model:?} is no model of the terrain"));
            let models = [("dtm", Preset::Dtm), ("dsm", Preset::Dsm), ("chm", Preset::Chm)];
            let (_, model) =
                models.into_iter().find(|(name, _)| name == model).ok_or_else(unknown)?;
            builder = builder.model(model);
        }
        if let Some(bounds) = self.bounds {
            builder = builder.bounds(bounds);
        }
        if let Some(like) = &self.like {
            builder = builder.like(like);
        }
        if let Some(radius) = self.radius {
            builder = builder.radius(radius);
        }
        if let Some(length) = self.max_edge {
            builder = builder.max_edge(length);
        }
        if let Some(file) = &self.water {
            builder = builder.water(file);
        }
        if let Some(method) = &self.canopy {
            builder = builder.canopy(method.parse()?);
        }
        if let Some(format) = &self.format {
            builder = builder.format(format);
        }
        for (key, value) in &self.creation {
            builder = builder.creation(key, value);
        }
        Ok(builder)
    }
}

#[pymethods]
impl Cloud {
    /// The cloud in some files, or a synthetic one.
    #[staticmethod]
    fn open(py: Python<'_>, names: Vec<PathBuf>, wanted: Wanted) -> PyResult<Self> {
        let open = || wanted.of(terrane::open_cloud(inputs(names)?)?);
        told(py, py.detach(open)).map(Self)
    }

    /// The cloud of points in an array of three columns, with classes, and numbers of returns.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)]
    fn array(
        points: &Bound<'_, PyArray2<f64>>,
        classes: Option<&Bound<'_, PyArray1<u8>>>,
        numbers: Option<&Bound<'_, PyArray1<u8>>>,
        returns: Option<&Bound<'_, PyArray1<u8>>>,
        flags: Option<&Bound<'_, PyArray1<u8>>>,
        crs: Option<&str>,
        wanted: Wanted,
    ) -> PyResult<Self> {
        let py = points.py();
        let crs = told(py, crs_of(crs))?;
        let points = points.readonly();
        let (positions, _) = points.as_slice()?.as_chunks::<3>();
        let column = |of: Option<&Bound<'_, PyArray1<u8>>>| {
            of.map(|array| Ok::<_, PyErr>(array.readonly().as_slice()?.to_vec())).transpose()
        };
        let columns = [column(classes)?, column(numbers)?, column(returns)?, column(flags)?];
        let of = |column: usize, number: usize| {
            columns[column].as_ref().and_then(|all| all.get(number)).copied().unwrap_or(0)
        };
        let marks: Option<Vec<Marks>> = columns.iter().any(Option::is_some).then(|| {
            let mark = |number: usize| Marks {
                class: of(0, number),
                returns: [of(1, number), of(2, number)],
                flags: Flags(of(3, number)),
            };
            (0..positions.len()).map(mark).collect()
        });
        let open = || wanted.of(terrane::open_points(positions, marks.as_deref(), crs)?);
        told(py, py.detach(open)).map(Self)
    }

    /// What the cloud is.
    #[getter]
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (info, told) = (self.0.info(), PyDict::new(py));
        told.set_item("count", info.count)?;
        told.set_item("crs", crs_text(&info.crs))?;
        Ok(told)
    }

    fn grid<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        asked: Asked,
        overwrite: bool,
        settings: Settings,
    ) -> PyResult<Bound<'py, PyAny>> {
        let make = |machine: &Machine| {
            with_machine!(asked.of(&self.0)?, machine).overwrite(overwrite).write(path)
        };
        let report = run(py, settings, make)?;
        dictionary(py, &report)
    }

    fn plan_grid(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        asked: Asked,
        cut: Option<u32>,
        settings: Settings,
    ) -> PyResult<Plan> {
        let make = |machine: &Machine| with_machine!(asked.of(&self.0)?, machine).plan(folder, cut);
        run(py, settings, make).map(Plan)
    }

    fn points<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        asked: Points,
        system: System,
        overwrite: bool,
        settings: Settings,
    ) -> PyResult<Bound<'py, PyAny>> {
        points::write(py, &self.0, (path, &asked, system), overwrite, settings)
    }

    fn plan_points(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        asked: Points,
        cut: Option<u32>,
        settings: Settings,
    ) -> PyResult<Plan> {
        points::plan(py, &self.0, (folder, &asked, cut), settings)
    }

    fn plan_tin(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        max_error: f64,
        format: Option<String>,
        cut: Option<u32>,
        settings: Settings,
    ) -> PyResult<Plan> {
        let make = |machine: &Machine| {
            let mut builder = with_machine!(self.0.tin().max_error(max_error), machine);
            if let Some(format) = format {
                builder = builder.format(format);
            }
            builder.plan(folder, cut)
        };
        run(py, settings, make).map(Plan)
    }

    fn write_tin<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        max_error: f64,
        overwrite: bool,
        settings: Settings,
    ) -> PyResult<Bound<'py, PyAny>> {
        let make = |machine: &Machine| {
            let builder = with_machine!(self.0.tin().max_error(max_error), machine);
            builder.overwrite(overwrite).write(path)
        };
        let report = run(py, settings, make)?;
        dictionary(py, &report)
    }

    fn verify<'py>(
        &self,
        py: Python<'py>,
        mesh: PathBuf,
        max_error: Option<f64>,
        settings: Settings,
    ) -> PyResult<Bound<'py, PyAny>> {
        let report = run(py, settings, |machine| {
            let mut builder = with_machine!(self.0.verify(mesh), machine);
            if let Some(tolerance) = max_error {
                builder = builder.max_error(tolerance);
            }
            builder.run()
        })?;
        dictionary(py, &report)
    }
}
