//! Features that get properties computed from a grid: read in batches, and written in the order of the file.

use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_crs::CoordinateOperation;
use terrane_engine::Resources;
use terrane_engine::memory::{PROGRAM, short};
use terrane_engine::options::FileOutput;
use terrane_engine::transform::{self, Transformed, extent_of};
use terrane_files::path_of;
use terrane_raster::GridInfo;
use terrane_vector::{
    self as vector, Feature, FeatureProperties, FeatureSink, FeatureSource, FieldDefinition,
    FieldKind, GeometryType, PropertyValue, VectorFormat, VectorOpenOptions, VectorWriteOptions,
    WrittenFeatures,
};

/// Memory of a vertex of a batch in bytes, with what is read of it and written.
const VERTEX_BYTES: u64 = 128;
/// Farthest position of a ring from the grid, in cells: further away they are not exact to a ten-thousandth of one.
const FARTHEST: f64 = 1e12;
/// Most features of a batch.
const MAX_FEATURES: usize = 1 << 14;

/// The feature file that is read, by its option value, and the file that is written.
pub(crate) struct AnnotatedNames<'a> {
    pub(crate) input: &'a Path,
    pub(crate) layer: Option<&'a str>,
    /// A row of a table is a point.
    pub(crate) are_points: bool,
    pub(crate) output: &'a Path,
    pub(crate) file: &'a FileOutput,
}

/// The format of the output.
///
/// # Errors
/// A format that cannot be written, or holds no geometries of `kind` or no properties.
pub(crate) fn format(
    output: &Path,
    file: &FileOutput,
    kind: GeometryType,
) -> Result<&'static VectorFormat> {
    let format = vector::by_path(output, file.format.as_deref())?;
    let is_short = match format.holds {
        holds if !holds.kinds.contains(&kind) => Some(kind.name()),
        holds if holds.values == vector::PropertySupport::None => Some("properties"),
        _ => None,
    };
    match is_short {
        Some(what) => Err(Error::usage(format!("{} does not support {what}", format.name))
            .in_file(output)
            .remedy("write GeoJSON, FlatGeobuf or Shapefile")),
        None => Ok(format),
    }
}

/// A feature and its place, for errors.
pub(crate) struct BatchedFeature<'a> {
    pub(crate) feature: Feature,
    location: String,
    path: &'a Path,
}

impl BatchedFeature<'_> {
    /// An error about the feature.
    pub(crate) fn error(&self, error: Error) -> Error {
        error.at(&self.location).in_file(self.path)
    }
}

/// Features as they are read, and the file in which they are written.
pub(crate) struct AnnotatedFeatures<'a> {
    input: &'a Path,
    source: Box<dyn FeatureSource>,
    sink: Box<dyn FeatureSink>,
    /// Names of the new properties.
    names: Vec<String>,
    place: GridPlace,
}

/// From positions of features to those of a grid.
pub(crate) struct GridPlace {
    operation: Option<CoordinateOperation>,
    transform: terrane_base::geom::Affine,
}

impl GridPlace {
    /// Positions of a ring in cells: the cell of column c spans c to c + 1, with the sample in its centre.
    ///
    /// # Errors
    /// Positions that the coordinate operation does not cover, or too far away.
    pub(crate) fn cells(&self, positions: &[[f64; 2]]) -> Result<Vec<[f64; 2]>> {
        let mut positions = positions.to_vec();
        if let Some(operation) = &self.operation {
            transform::reproject(&mut positions, operation)?;
        }
        positions.iter_mut().for_each(|at| {
            *at = self.transform.invert(at[0], at[1]).map(|at| at + 0.5);
        });
        match positions.as_flattened().iter().all(|at| at.abs() <= FARTHEST) {
            true => Ok(positions),
            false => Err(Error::bad_input("a position is too far from the grid")
                .remedy("correct the position, or remove the feature")),
        }
    }

    /// Positions as columns and rows, whole numbers at samples; NaN where the coordinate operation does not cover them.
    pub(crate) fn samples<'p>(
        &'p self,
        positions: &'p [[f64; 2]],
    ) -> impl Iterator<Item = [f64; 2]> + 'p {
        positions.iter().map(|at| {
            let operation = self.operation.as_ref();
            let at = operation.map_or(Ok(*at), |operation| operation.position(*at));
            at.map_or([f64::NAN; 2], |[x, y]| self.transform.invert(x, y))
        })
    }

    /// The operation from the CRS of the features to that of the grid, if they differ.
    pub(crate) fn transformed(&self) -> Option<Transformed> {
        self.operation.as_ref().map(Transformed::of)
    }

    fn of(features: &FeatureCrs<'_>, info: &GridInfo) -> Result<Self> {
        let [grid, own] = [&info.crs, features.crs].map(|crs| crs.without_heights());
        let transform = info.transform;
        if grid.agrees(&own) {
            return Ok(Self { operation: None, transform });
        }
        if !grid.is_named() || !own.is_named() {
            grid.check_same(&own, "features").map_err(|e| e.in_file(features.path))?;
        }
        let options = terrane_crs::CoordinateOperationOptions {
            extent: Some(extent_of(info)),
            ..Default::default()
        };
        let operation = CoordinateOperation::between(&grid, &own, &options)
            .map_err(|e| e.in_file(features.path))?;
        Ok(Self { operation: Some(operation.inverse()), transform })
    }
}

/// The CRS of a feature file.
struct FeatureCrs<'a> {
    crs: &'a terrane_base::geom::Crs,
    path: &'a Path,
}

impl<'a> AnnotatedFeatures<'a> {
    /// Opens both files; `fields` are the new properties.
    ///
    /// # Errors
    /// A file that cannot be read or created; a property of the same name; CRSs without an operation between them.
    pub(crate) fn open(
        names: &AnnotatedNames<'a>,
        format: &VectorFormat,
        fields: &[(String, FieldKind)],
        info: &GridInfo,
        resources: &Resources,
    ) -> Result<Self> {
        let input = names.input;
        let options = VectorOpenOptions {
            layer: names.layer.map(str::to_owned),
            rows_are_points: names.are_points,
        };
        let source = vector::open(input, &options)?;
        let mut layer = source.layer().clone();
        let place = GridPlace::of(&FeatureCrs { crs: &layer.crs, path: input }, info)?;
        if let Some(schema) = &mut layer.schema {
            for (name, kind) in fields {
                if schema.iter().any(|field| *field.name == **name) {
                    return Err(exists(name).in_file(input));
                }
                let [width, decimals] = [None; 2];
                schema.push(FieldDefinition {
                    name: (**name).into(),
                    kind: *kind,
                    width,
                    decimals,
                });
            }
        }
        let options = VectorWriteOptions {
            overwrite: names.file.replacing.overwrite,
            temp_dir: resources.temp_dir.clone(),
            ..VectorWriteOptions::default()
        };
        let sink = vector::create(names.output, format, &layer, &options)?;
        let names = fields.iter().map(|(name, _)| name.clone()).collect();
        Ok(Self { input, source, sink, names, place })
    }

    /// From positions of the features to cells of the grid.
    pub(crate) fn place(&self) -> &GridPlace {
        &self.place
    }

    /// The next features, of vertices that fit into `bytes`; none at the end.
    ///
    /// # Errors
    /// Damaged features; a feature that does not fit.
    pub(crate) fn read(&mut self, bytes: u64) -> Result<Vec<BatchedFeature<'a>>> {
        let (mut batch, mut vertices) = (Vec::new(), 0);
        while vertices * VERTEX_BYTES < bytes / 2 && batch.len() < MAX_FEATURES {
            let Some(feature) = self.source.next()? else { break };
            let count = feature.geometry.vertices() as u64;
            let location = self.source.location();
            if count * VERTEX_BYTES > bytes / 2 {
                let message = format!("a feature of {count} vertices does not fit in memory");
                let enough = 3 * PROGRAM + 16 * count * VERTEX_BYTES;
                return Err(short(message, enough).at(location).in_file(self.input));
            }
            vertices += count;
            batch.push(BatchedFeature { feature, location, path: self.input });
        }
        Ok(batch)
    }

    /// Writes a feature with new properties, in the order of their names.
    ///
    /// # Errors
    /// A property of the same name; those of the file.
    pub(crate) fn write(
        &mut self,
        own: &mut BatchedFeature<'_>,
        values: impl IntoIterator<Item = PropertyValue>,
    ) -> Result<()> {
        for (name, value) in self.names.iter().zip(values) {
            let FeatureProperties(properties) = &mut own.feature.properties;
            if properties.iter().any(|(other, _)| **other == **name) {
                return Err(own.error(exists(name)));
            }
            properties.push(((**name).into(), value));
        }
        self.sink.write(&own.feature)
    }

    /// Finishes the file; what was written, with the notes of reading.
    ///
    /// # Errors
    /// Those of the file.
    pub(crate) fn finish(self) -> Result<WrittenFeatures> {
        let foreign = self.source.layer().foreign.clone();
        let mut written = self.sink.finish(&foreign)?;
        written.notes.splice(0..0, self.source.notes());
        if let Some(operation) = &self.place.operation {
            written.notes.extend(operation.notes().iter().cloned());
        }
        Ok(written)
    }
}

fn exists(name: &str) -> Error {
    Error::bad_input(format!("the features have a property {name}"))
        .remedy("pass ‹prefix› to name the new properties otherwise")
}

/// The path of a feature file by its option value.
pub(crate) fn path(name: &Path) -> std::path::PathBuf {
    name.to_str().map_or_else(|| name.to_path_buf(), |name| path_of(name).into_owned())
}
