//! Lines: vector files as arrays, and simplification of arrays and files.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use terrane::{Cancel, Coordinates, ErrorKind, Method};
use terrane_vector::{
    CoordinateSequence, Feature, Geometry, GeometryType, LayerHeader, PropertyValue,
    VectorOpenOptions, VectorWriteOptions,
};

use crate::error::to_python;
use crate::grid::{crs_of, usage};
use crate::mesh::{crs_text, rows};
use crate::work::{JobSettings, run};

/// Methods by their names on the command line.
const METHODS: [(&str, Method); 5] = [
    ("cone", Method::Cone),
    ("rdp", Method::Rdp),
    ("imai-iri", Method::ImaiIri),
    ("visvalingam", Method::Visvalingam),
    ("weighted-visvalingam", Method::WeightedVisvalingam),
];

fn method_of(py: Python<'_>, name: &str) -> PyResult<Method> {
    let found = METHODS.iter().find(|(known, _)| *known == name);
    let names = METHODS.map(|(name, _)| name).join(", ");
    let unknown =
        || usage(py, &format!("unknown method {name:?}"), &format!("choose one of {names}"));
    found.map(|(_, method)| *method).ok_or_else(unknown)
}

/// Lines of a vector file: positions, offsets of lines, a number per line, and the CRS. Other geometries are
/// omitted.
#[pyfunction]
pub(crate) fn read_lines<'py>(
    py: Python<'py>,
    path: PathBuf,
    attribute: &str,
) -> PyResult<Bound<'py, PyTuple>> {
    let read = || {
        let mut source = terrane_vector::open(&path, &VectorOpenOptions::default())?;
        let (mut flat, mut offsets, mut values) = (Vec::new(), vec![0_i64], Vec::new());
        while let Some(feature) = source.next()? {
            let value = match feature.properties.get(attribute) {
                Some(PropertyValue::Real(value)) => *value,
                Some(PropertyValue::Int(value)) => *value as f64,
                _ => f64::NAN,
            };
            for part in feature.geometry.leaves().flat_map(|leaf| leaf.parts()) {
                flat.extend(part.xy.iter().flatten());
                offsets.push((flat.len() / 2) as i64);
                values.push(value);
            }
        }
        let crs = crs_text(&source.layer().crs);
        Ok((flat, offsets, values, crs))
    };
    let (flat, offsets, values, crs): (Vec<f64>, _, Vec<f64>, _) = to_python(py, py.detach(read))?;
    let offsets = PyArray1::from_vec(py, offsets);
    let values = PyArray1::from_vec(py, values);
    (rows(py, &flat, 2)?, offsets, values, crs).into_pyobject(py)
}

/// Simplifies lines or rings of an array of positions, each independently: returns the kept positions, with
/// rings closed, and the offsets of lines.
#[pyfunction]
pub(crate) fn simplify_places<'py>(
    py: Python<'py>,
    positions: &Bound<'py, PyArray2<f64>>,
    offsets: &Bound<'py, PyArray1<i64>>,
    tolerance: f64,
    method: &str,
    rings: bool,
    settings: JobSettings,
) -> PyResult<Bound<'py, PyTuple>> {
    let method = method_of(py, method)?;
    let (positions, offsets) = (positions.readonly(), offsets.readonly());
    let (all, offsets) = (positions.as_slice()?, offsets.as_slice()?);
    let [count, width] = [positions.shape()[0], positions.shape()[1]];
    let is_sound = offsets.first() == Some(&0)
        && offsets.last() == Some(&(count as i64))
        && offsets.is_sorted();
    if !is_sound {
        let message = "offsets do not match the positions";
        return Err(usage(py, message, "pass ascending offsets from 0 to the number of positions"));
    }
    if !matches!(width, 2 | 3) {
        let message = "positions need 2 or 3 coordinates";
        return Err(usage(py, message, "pass an array of 2 or 3 columns"));
    }
    let (places, ends) = run(py, settings, |machine| {
        let how = LineSimplification { tolerance, method, rings, cancel: &machine.cancel };
        let threads = machine.threads.unwrap_or_else(terrane_files::cores);
        match width {
            2 => how.side_by_side(all.as_chunks::<2>().0, offsets, threads),
            _ => how.side_by_side(all.as_chunks::<3>().0, offsets, threads),
        }
    })?;
    (PyArray1::from_vec(py, places), PyArray1::from_vec(py, ends)).into_pyobject(py)
}

/// Settings of a simplification.
#[derive(Clone, Copy)]
struct LineSimplification<'a> {
    tolerance: f64,
    method: Method,
    rings: bool,
    cancel: &'a Cancel,
}

/// Kept positions, and the end of each line among them.
type Left = (Vec<i64>, Vec<i64>);

impl LineSimplification<'_> {
    /// All lines on several threads; the result does not depend on their number.
    fn side_by_side<const N: usize>(
        self,
        positions: &[[f64; N]],
        offsets: &[i64],
        threads: usize,
    ) -> terrane::Result<Left>
    where
        [f64; N]: Coordinates,
    {
        // A thread is not worth its start for less.
        let threads = threads.clamp(1, 1 + positions.len() / 50_000);
        let cut = |part: usize| {
            let position = positions.len() as u128 * part as u128 / threads as u128;
            offsets.partition_point(|start| (*start as u128) < position)
        };
        let last = offsets.len() - 1;
        let cuts: Vec<usize> =
            (0..=threads).map(|part| if part == threads { last } else { cut(part) }).collect();
        let parts = std::thread::scope(|scope| {
            let start = |ends: &[usize]| {
                let lines = &offsets[ends[0]..=ends[1].max(ends[0])];
                scope.spawn(move || self.each(positions, lines))
            };
            let started: Vec<_> = cuts.windows(2).map(start).collect();
            let join = |thread: std::thread::ScopedJoinHandle<'_, terrane::Result<Left>>| {
                let fault = || terrane::Error::new(ErrorKind::Internal, "a thread failed");
                thread.join().unwrap_or_else(|_| Err(fault()))
            };
            started.into_iter().map(join).collect::<terrane::Result<Vec<_>>>()
        })?;
        let (mut places, mut ends) = (Vec::new(), vec![0]);
        for (more, more_ends) in parts {
            let before = places.len() as i64;
            places.extend(more);
            ends.extend(more_ends.into_iter().map(|end| before + end));
        }
        Ok((places, ends))
    }

    /// Lines of a range, one after the other.
    fn each<const N: usize>(self, positions: &[[f64; N]], offsets: &[i64]) -> terrane::Result<Left>
    where
        [f64; N]: Coordinates,
    {
        let Self { tolerance, method, rings, cancel } = self;
        let (mut places, mut ends) = (Vec::new(), Vec::with_capacity(offsets.len()));
        for ends_of in offsets.windows(2) {
            cancel.check()?;
            let [start, end] = [ends_of[0], ends_of[1]];
            let line = &positions[start as usize..end as usize];
            // Of fewer positions nothing can go.
            let least = if rings { 5 } else { 3 };
            if line.len() < least {
                places.extend(start..end);
            } else {
                let first = places.len();
                let kept = terrane::simplify(line, tolerance).method(method).ring(rings).indices();
                places.extend(kept.into_iter().map(|place| start + place as i64));
                if rings {
                    places.push(places[first]);
                }
            }
            ends.push(places.len() as i64);
        }
        Ok((places, ends))
    }
}

/// Geometries of one type as ragged arrays of shapely: type, positions, and offsets of parts, polygons and
/// geometries.
type Group<'py> = (String, Bound<'py, PyArray2<f64>>, Vec<Bound<'py, PyArray1<i64>>>);

/// Writes groups of geometries to a file, one feature each, in order and bit by bit.
#[pyfunction]
pub(crate) fn write_geometries(
    py: Python<'_>,
    path: PathBuf,
    groups: Vec<Group<'_>>,
    crs: Option<&str>,
) -> PyResult<()> {
    let layer = LayerHeader { crs: to_python(py, crs_of(crs))?, ..LayerHeader::default() };
    let format = to_python(py, terrane_vector::by_path(&path, None))?;
    let options = VectorWriteOptions::default();
    let mut sink = to_python(py, terrane_vector::create(&path, format, &layer, &options))?;
    for (kind, positions, offsets) in groups {
        let unknown =
            || usage(py, &format!("{kind:?} is not a type of lines"), "pass lines or polygons");
        let kind = GeometryType::by_name(&kind).ok_or_else(unknown)?;
        let (width, positions) = (positions.shape()[1], positions.readonly());
        let mut levels = Vec::with_capacity(offsets.len());
        for level in &offsets {
            levels.push(level.readonly().as_slice()?.to_vec());
        }
        let ragged = RaggedArrays { positions: positions.as_slice()?, width, levels };
        for number in 0..ragged.len() {
            let geometry = ragged.places(kind, number).ok_or_else(|| {
                usage(py, "offsets are inconsistent", "pass the offsets from shapely")
            })?;
            let feature = Geometry::new(kind, geometry)
                .map(|geometry| Feature { geometry, ..Feature::default() });
            let written = feature.and_then(|feature| sink.write(&feature));
            to_python(py, written)?;
        }
    }
    to_python(py, sink.finish(&[])).map(drop)
}

/// The arrays of a [`Group`].
struct RaggedArrays<'a> {
    positions: &'a [f64],
    width: usize,
    levels: Vec<Vec<i64>>,
}

impl RaggedArrays<'_> {
    /// Number of geometries.
    fn len(&self) -> usize {
        self.levels.last().map_or(0, |ends| ends.len().saturating_sub(1))
    }

    /// Range of an entry in the next lower level.
    fn range(&self, level: usize, number: usize) -> Option<std::ops::Range<usize>> {
        let ends = self.levels.get(level)?.get(number..number + 2)?;
        Some(usize::try_from(ends[0]).ok()?..usize::try_from(ends[1]).ok()?)
    }

    /// Coordinates of a geometry.
    fn places(&self, kind: GeometryType, number: usize) -> Option<CoordinateSequence> {
        let mut places = CoordinateSequence::default();
        let polygons = match kind {
            GeometryType::LineString | GeometryType::MultiLineString | GeometryType::Polygon => {
                number..number + 1
            }
            _ => self.range(2, number)?,
        };
        for polygon in polygons {
            let parts = match kind {
                GeometryType::LineString => polygon..polygon + 1,
                _ => self.range(1, polygon)?,
            };
            for part in parts {
                for place in self.range(0, part)? {
                    let at = self.positions.get(place * self.width..(place + 1) * self.width)?;
                    places.push([at[0], at[1]], at.get(2).copied(), None);
                }
                places.end_part();
            }
            places.end_polygon();
        }
        Some(places)
    }
}
