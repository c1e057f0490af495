//! Grids in files and in memory, and jobs on them.

use std::path::PathBuf;

use numpy::{Element, PyArray1, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use terrane::prelude::*;
use terrane::{Affine, ArrayGrid, ArraySample, Crs, ErrorKind, Inputs, Rect, TinOptions};
use terrane_base::frontend::Frontend;
use terrane_base::geom::wkt;
use terrane_files::name_of;
use terrane_options::Options;

use crate::array::NumpyElements;
use crate::error::{exception, to_python};
use crate::mesh::{Mesh, crs_text};
use crate::operation;
use crate::work::{BuilderSettings, JobSettings, run};

/// A grid of heights.
#[pyclass(frozen, module = "terrane._terrane")]
pub(crate) struct Grid(pub(crate) terrane::Grid);

/// Input options of a grid from Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct GridReading {
    band: Option<u32>,
    nodata: Option<f64>,
    clip: Option<PathBuf>,
    water: Option<PathBuf>,
}

/// Inputs of names.
pub(crate) fn inputs(mut names: Vec<PathBuf>) -> terrane::Result<Inputs> {
    match names.len() {
        1 => Ok(Inputs::from(names.remove(0))),
        _ => names.into_iter().map(name_of).collect::<terrane::Result<Vec<_>>>().map(Inputs::from),
    }
}

/// The CRS of a text.
pub(crate) fn crs_of(text: Option<&str>) -> terrane::Result<Crs> {
    let Some(text) = text else { return Ok(Crs::default()) };
    let crs = wkt::of_srs(text);
    match crs.epsg.is_some() || crs.wkt.is_some() {
        true => Ok(crs),
        false => Err(terrane::Error::usage(format!("{text:?} is not a CRS"))
            .remedy("pass a code such as \"EPSG:32631\", or WKT")),
    }
}

impl Grid {
    fn held<T: ArraySample + Element>(
        array: &Bound<'_, PyArrayDyn<T>>,
        place: Option<[f64; 6]>,
        crs: Crs,
        nodata: Option<f64>,
    ) -> PyResult<terrane::Grid> {
        let py = array.py();
        let &[height, width] = array.shape() else {
            return Err(PyValueError::new_err("the array is not two-dimensional"));
        };
        let most = u32::MAX as usize;
        let [width, height] = [width, height].map(|side| side.min(most) as u32);
        let samples = NumpyElements::of(array)?;
        let transform = place.map_or(Affine::LATTICE, Affine::from_gdal);
        let open = || {
            let grid = ArrayGrid::shared(samples, width, height)?.with_nodata(nodata);
            let is_placed = place.is_some() || crs != Crs::default();
            terrane::open_array(if is_placed { grid.placed(transform, crs) } else { grid })
        };
        to_python(py, py.detach(open))
    }
}

#[pymethods]
impl Grid {
    /// Opens files, or a synthetic terrain.
    #[staticmethod]
    fn open(py: Python<'_>, names: Vec<PathBuf>, reading: GridReading) -> PyResult<Self> {
        let open = || {
            let mut grid = terrane::open(inputs(names)?)?;
            if let Some(band) = reading.band.filter(|band| *band != 1) {
                grid = grid.band(band)?;
            }
            Self::read_as(grid, reading)
        };
        to_python(py, py.detach(open)).map(Self)
    }

    /// A grid from an array, with GDAL's geotransform `place`.
    #[staticmethod]
    fn array(
        array: &Bound<'_, PyAny>,
        place: Option<[f64; 6]>,
        crs: Option<&str>,
        reading: GridReading,
    ) -> PyResult<Self> {
        let py = array.py();
        let crs = to_python(py, crs_of(crs))?;
        macro_rules! of_type {
            ($($type:ty)*) => {$(
                if let Ok(array) = array.cast::<PyArrayDyn<$type>>() {
                    let grid = Self::held(array, place, crs, reading.nodata)?;
                    let rest = GridReading { nodata: None, ..reading };
                    return to_python(py, py.detach(|| Self::read_as(grid, rest))).map(Self);
                }
            )*};
        }
        of_type!(f32 f64 i16 u16 u8 i8 i32 u32);
        Err(PyValueError::new_err("unsupported type of array"))
    }

    /// Size, georeference and other properties.
    #[getter]
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (info, told) = (self.0.info(), PyDict::new(py));
        told.set_item("width", info.width)?;
        told.set_item("height", info.height)?;
        told.set_item("place", info.georeferenced.then(|| info.transform.to_gdal()))?;
        told.set_item("crs", crs_text(&info.crs))?;
        told.set_item("wkt", info.crs.to_wkt())?;
        told.set_item("type", info.sample_type.name())?;
        told.set_item("nodata", info.nodata)?;
        told.set_item("bands", info.bands)?;
        told.set_item("format", info.format)?;
        Ok(told)
    }

    /// Notes about problems: kind and text of each.
    #[getter]
    fn notes(&self) -> Vec<(&'static str, String)> {
        self.0
            .notes()
            .into_iter()
            .map(|note| (note.kind, Frontend::Python.spell(&note.text).into_owned()))
            .collect()
    }

    /// All heights, row by row, NaN for voids.
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let info = self.0.info();
        let all = Rect::new(0, 0, info.width, info.height);
        let heights = py.detach(|| self.0.heights(all));
        Ok(PyArray1::from_vec(py, to_python(py, heights)?))
    }

    /// A mesh in memory, with options by name.
    fn tin(
        &self,
        py: Python<'_>,
        options: &Bound<'_, PyDict>,
        settings: JobSettings,
    ) -> PyResult<Mesh> {
        let options = to_python(py, operation::options_of(TinOptions::TABLE, options)?)?;
        let make = |machine: &BuilderSettings| {
            let job = self.0.tin().with_named(&options)?;
            job.progress(machine.progress.clone()).cancel(&machine.cancel).build()
        };
        run(py, settings, make).map(Mesh::from)
    }
}

impl Grid {
    fn read_as(mut grid: terrane::Grid, reading: GridReading) -> terrane::Result<terrane::Grid> {
        if let Some(nodata) = reading.nodata {
            grid = grid.nodata(nodata)?;
        }
        if let Some(water) = reading.water {
            grid = grid.water(water)?;
        }
        match reading.clip {
            Some(clip) => grid.clip(clip),
            None => Ok(grid),
        }
    }
}

/// Usage error of a Python option.
pub(crate) fn usage(py: Python<'_>, message: &str, remedy: &str) -> PyErr {
    exception(py, &terrane::Error::new(ErrorKind::Usage, message).remedy(remedy))
}
