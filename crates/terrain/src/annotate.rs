//! Operations that give features properties of a grid: their common options, run and report.
//!
//! Features are read in batches that fit into the memory, and written in the order of the file.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::sample::SampleOptions;
use crate::zonal::ZonalOptions;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_crs::{CoordinateOperation, CoordinateOperationOptions};
use terrane_engine::memory::{self, MemoryShares};
use terrane_engine::operation::RunRequest;
use terrane_engine::options::{FeatureInput, FileOutput, GridInput};
use terrane_engine::outputs::not_member;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::{self, Transformed, extent_of};
use terrane_engine::{Cancel, Resources};
use terrane_files::{atomic, path_of};
use terrane_options::Options;
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource};
use terrane_vector::{
    self as vector, Feature, FeatureSink, FeatureSource, FieldDefinition, FieldKind, GeometryType,
    PropertySupport, PropertyValue, VectorFormat, VectorOpenOptions, VectorWriteOptions,
    WrittenFeatures,
};

/// Bytes of a vertex in a batch: as it was read, and the copy of the writer.
const VERTEX_BYTES: u64 = 128;
/// Bytes of a feature and of a property beside their texts.
const FEATURE_BYTES: u64 = 512;
const PROPERTY_BYTES: u64 = 160;
/// Most features of a batch.
const MAX_FEATURES: usize = 1 << 14;
/// Farthest position of a ring from the grid, in cells: beyond, `f64` does not tell ten-thousandths of a cell apart.
const FARTHEST: f64 = 1e12;
/// Greatest distance, in cells, of a reprojected edge from the straight edge in its place.
const BEND: f64 = 0.01;
/// An edge is halved at most this often.
const MAX_HALVINGS: u32 = 12;

/// Options of all operations that give features properties of a grid
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
pub struct AnnotationOptions {
    /// How the features are read.
    #[option(flatten)]
    pub features: FeatureInput,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

terrane_engine::has_within!(
    SampleOptions ZonalOptions: AnnotationOptions => [FeatureInput FileOutput GridInput Resources]
);

/// What was read and written.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct AnnotationReport {
    pub input: String,
    /// File of the features.
    pub features_file: String,
    pub output: String,
    /// Name of the written format.
    pub format: String,
    /// CRS of the grid.
    pub crs: String,
    /// Transformation of the features to the CRS of the grid, if theirs differs; they are written in their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    /// Features written.
    pub features: u64,
    pub notes: Vec<String>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
}

/// What is asked of [`run`].
pub(crate) struct AnnotationRequest<'a> {
    pub(crate) options: &'a AnnotationOptions,
    /// The feature file, by its option value.
    pub(crate) features: &'a Path,
    pub(crate) run: RunRequest<'a>,
    pub(crate) format: &'static VectorFormat,
    /// A row of a table is a point.
    pub(crate) are_points: bool,
    /// The output is a table of the properties alone.
    pub(crate) omits_geometry: bool,
    /// Bytes of a thread.
    pub(crate) worker: u64,
    /// The option that names the new properties, for errors.
    pub(crate) naming: &'static str,
}

/// A grid, and the place of features in it.
pub(crate) struct AnnotationGrid<'a> {
    pub(crate) source: &'a dyn GridSource,
    pub(crate) place: GridPlace,
    pub(crate) shares: MemoryShares,
    pub(crate) cancel: &'a Cancel,
    worker: u64,
    memory: u64,
}

impl AnnotationGrid<'_> {
    /// The error for `bytes` of data beside the cache that do not fit into their `share` of [`MemoryShares::mesh`].
    pub(crate) fn short(&self, message: String, bytes: u64, share: u64) -> Error {
        let workers = self.worker.saturating_mul(self.shares.threads as u64);
        let enough = memory::least_with(workers, bytes.saturating_mul(share));
        memory::short(message, enough.max(self.memory))
    }
}

/// True if all samples of a grid are whole numbers.
pub(crate) fn is_whole(info: &GridInfo) -> bool {
    !info.sample_type.is_float() && info.scale == 1.0 && info.offset.fract() == 0.0
}

/// A height as a property; null if it is not finite.
pub(crate) fn property(height: f64, is_whole: bool) -> PropertyValue {
    match is_whole {
        _ if !height.is_finite() => PropertyValue::Null,
        true => PropertyValue::Int(height as i64),
        false => PropertyValue::Real(height),
    }
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
    let missing = match format.holds {
        holds if holds.values == PropertySupport::None => Some("properties"),
        holds if !holds.kinds.contains(&kind) && !is_cells(format) => Some(kind.name()),
        _ => None,
    };
    match missing {
        Some(what) => Err(Error::usage(format!("{} does not support {what}", format.name))
            .in_file(output)
            .remedy("write GeoJSON, FlatGeobuf or Shapefile")),
        None => Ok(format),
    }
}

/// True for tables of cells, which take any features without their geometry.
fn is_cells(format: &VectorFormat) -> bool {
    format.holds.values == PropertySupport::Cells
}

/// Passes all features in batches to `work`, which writes them with values of the properties that `fields` names.
///
/// # Errors
/// An output that exists or cannot be written; errors of opening the grid and the features; CRSs without an operation
/// between them; properties of the same name; those of `work`.
pub(crate) fn run(
    request: &AnnotationRequest<'_>,
    fields: impl FnOnce(&GridInfo) -> Vec<(String, FieldKind)>,
    mut work: impl FnMut(&AnnotationGrid<'_>, FeatureBatch<'_>, &mut AnnotatedFile) -> Result<()>,
) -> Result<AnnotationReport> {
    let start = Instant::now();
    let AnnotationRequest { options, format, worker, run, .. } = *request;
    let RunRequest { inputs, output, progress, cancel, .. } = run;
    atomic::refuse_existing(output, options.file.replacing.overwrite)?;
    let (resources, cache) = (&options.resources, GridOpenOptions::default().cache_bytes);
    let opening = options.grid.options(resources, cache)?;
    let (source, shares) = memory::open(inputs, &opening, resources, worker)?;
    not_member(source.as_ref(), output)?;
    let info = source.info();
    info.check_cells().map_err(|e| e.in_file(Path::new(&inputs.to_string())))?;
    let path = feature_path(request.features);
    let layer = options.features.layer.clone();
    let opening = VectorOpenOptions { layer, rows_are_points: request.are_points };
    let mut features = vector::open(&path, &opening)?;
    let place = GridPlace::of(features.as_ref(), info).map_err(|e| e.in_file(&path))?;
    let memory = resources.memory;
    let grid = AnnotationGrid { source: source.as_ref(), place, shares, cancel, worker, memory };
    let mut file = AnnotatedFile::create(request, &path, features.as_ref(), fields(info))?;
    progress.begin("features", features.layer().features.unwrap_or(0));
    loop {
        cancel.check()?;
        let batch = read(features.as_mut(), &path, &grid)?;
        let count = batch.len() as u64;
        if count == 0 {
            break;
        }
        work(&grid, batch, &mut file)?;
        progress.advance(count);
    }
    let count = file.count;
    let written = file.sink.finish(&features.layer().foreign)?;
    progress.end();
    let WrittenFeatures { bytes: output_bytes, notes: of_writing, .. } = written;
    let transformed = grid.place.operation.as_ref().map(Transformed::of);
    let of_operation = grid.place.operation.iter().flat_map(|own| own.notes().to_vec()).collect();
    Ok(AnnotationReport {
        input: inputs.to_string(),
        features_file: path.display().to_string(),
        output: output.display().to_string(),
        format: format.name.to_owned(),
        crs: info.crs.label(),
        transformed,
        features: count,
        notes: [features.notes(), of_writing, of_operation, raster::cautions(info)].concat(),
        output_bytes,
        run: RunStatistics::since(start, resources).with_threads(shares.threads),
    })
}

/// Some features, in the order of the file.
pub(crate) type FeatureBatch<'a> = Vec<BatchedFeature<'a>>;

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

/// The next features, as many as a quarter of the shared memory holds; none at the end.
fn read<'a>(
    features: &mut dyn FeatureSource,
    path: &'a Path,
    grid: &AnnotationGrid<'_>,
) -> Result<FeatureBatch<'a>> {
    let (mut batch, mut bytes) = (Vec::new(), 0);
    while bytes < grid.shares.mesh / 4 && batch.len() < MAX_FEATURES {
        let Some(feature) = features.next()? else { break };
        let own = feature_bytes(&feature);
        let feature = BatchedFeature { feature, location: features.location(), path };
        if own > grid.shares.mesh / 4 {
            let message = format!("the feature takes {} MiB", own.div_ceil(1 << 20));
            return Err(feature.error(grid.short(message, own, 4)));
        }
        bytes += own;
        batch.push(feature);
    }
    Ok(batch)
}

/// Bytes of a feature while it is in a batch and written.
fn feature_bytes(feature: &Feature) -> u64 {
    let texts = feature.properties.iter().map(|(_, value)| match value {
        PropertyValue::Text(text)
        | PropertyValue::Date(text)
        | PropertyValue::DateTime(text)
        | PropertyValue::Json(text) => text.len(),
        _ => 0,
    });
    let foreign = feature.foreign.iter().map(|member| member.name.len() + member.json.len());
    let texts = texts.chain(foreign).sum::<usize>() as u64;
    let properties = feature.properties.iter().count() as u64;
    let vertices = feature.geometry.vertices() as u64;
    FEATURE_BYTES + 2 * texts + properties * PROPERTY_BYTES + vertices * VERTEX_BYTES
}

/// The file of features with new properties.
pub(crate) struct AnnotatedFile {
    sink: Box<dyn FeatureSink>,
    names: Vec<String>,
    naming: &'static str,
    count: u64,
}

impl AnnotatedFile {
    fn create(
        request: &AnnotationRequest<'_>,
        path: &Path,
        features: &dyn FeatureSource,
        fields: Vec<(String, FieldKind)>,
    ) -> Result<Self> {
        let naming = request.naming;
        let mut layer = features.layer().clone();
        if let Some(schema) = &mut layer.schema {
            for (name, kind) in &fields {
                if schema.iter().any(|field| *field.name == **name) {
                    return Err(exists(name, naming).in_file(path));
                }
                let [width, decimals] = [None; 2];
                let (name, kind) = (name.as_str().into(), *kind);
                schema.push(FieldDefinition { name, kind, width, decimals });
            }
        }
        let options = VectorWriteOptions {
            overwrite: request.options.file.replacing.overwrite,
            table: request.omits_geometry,
            temp_dir: request.options.resources.temp_dir.clone(),
            ..VectorWriteOptions::default()
        };
        let sink = vector::create(request.run.output, request.format, &layer, &options)?;
        let names = fields.into_iter().map(|(name, _)| name).collect();
        Ok(Self { sink, names, naming, count: 0 })
    }

    /// Writes a feature with new properties, in the order of their names.
    ///
    /// # Errors
    /// A property of the same name; those of the file.
    pub(crate) fn write(
        &mut self,
        mut own: BatchedFeature<'_>,
        values: impl IntoIterator<Item = PropertyValue>,
    ) -> Result<()> {
        for (name, value) in self.names.iter().zip(values) {
            if own.feature.properties.get(name).is_some() {
                return Err(own.error(exists(name, self.naming)));
            }
            own.feature.properties.push(name.as_str(), value);
        }
        self.count += 1;
        self.sink.write(&own.feature)
    }
}

fn exists(name: &str, naming: &str) -> Error {
    Error::bad_input(format!("the features have a property {name} already"))
        .remedy(format!("choose another name with {naming}"))
}

/// The path of a feature file by its option value.
fn feature_path(name: &Path) -> PathBuf {
    name.to_str().map_or_else(|| name.to_path_buf(), |name| path_of(name).into_owned())
}

/// From positions of features to cells of a grid: the cell of column c spans c to c + 1, with the sample in its centre.
pub(crate) struct GridPlace {
    operation: Option<CoordinateOperation>,
    transform: Affine,
    /// The middle longitude of a grid in degrees.
    longitude: Option<f64>,
    /// Some positions in both, to tell whether polygons stay around the grid when they are reprojected.
    marks: Vec<[[f64; 2]; 2]>,
}

impl GridPlace {
    fn of(features: &dyn FeatureSource, info: &GridInfo) -> Result<Self> {
        let layer = features.layer();
        let [grid, own] = [&info.crs, &layer.crs].map(|crs| crs.without_heights());
        let transform = info.transform;
        let middle = transform.apply(f64::from(info.width) / 2.0, f64::from(info.height) / 2.0);
        let longitude = (grid.geographic == Some(true)).then_some(middle[0]);
        let mut place = Self { operation: None, transform, longitude, marks: Vec::new() };
        if grid.agrees(&own) {
            return Ok(place);
        }
        if !grid.is_named() || !own.is_named() {
            grid.check_same(&own, "features")?;
        }
        let between = |from, to, extent| {
            let options = CoordinateOperationOptions { extent, ..Default::default() };
            CoordinateOperation::between(from, to, &options)
        };
        // The place of the grid chooses among operations. Around a pole it has none in degrees.
        let operation = between(&grid, &own, Some(extent_of(info))).map(|back| back.inverse());
        let operation =
            operation.or_else(|error| between(&own, &grid, layer.extent).or(Err(error)))?;
        let back = operation.inverse();
        for [col, row] in [[0.52, 0.47], [0.23, 0.19], [0.81, 0.27], [0.17, 0.83], [0.77, 0.71]] {
            let cell = [col * f64::from(info.width), row * f64::from(info.height)];
            let at = back.position(transform.apply(cell[0] - 0.5, cell[1] - 0.5));
            place.marks.extend(at.ok().map(|at| [at, cell]));
        }
        place.operation = Some(operation);
        Ok(place)
    }

    /// A position in cells; `None` if the coordinate operation does not cover it.
    pub(crate) fn cell(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let [x, y] = self.in_grid(at).ok()?;
        Some(self.cell_of([x + self.turn(x), y]))
    }

    /// The rings of polygons in cells. Reprojected edges are divided so that they stay where they were.
    ///
    /// # Errors
    /// Positions that the coordinate operation does not cover, or too far away; polygons that reprojection turns inside
    /// out, as those around a pole or the whole earth.
    pub(crate) fn rings<'g>(
        &self,
        rings: impl Iterator<Item = (&'g [[f64; 2]], bool)>,
    ) -> Result<Vec<CellRing>> {
        let (mut all, mut turn) = (Vec::new(), 0.0);
        let mut crossings = [vec![false; self.marks.len()], vec![false; self.marks.len()]];
        for (ring, is_hole) in rings {
            let mut positions = self.bent(ring)?;
            // Holes turn with their polygon.
            if !is_hole {
                let x = positions.iter().map(|at| at[0]);
                let [low, high] = [x.clone().reduce(f64::min), x.reduce(f64::max)];
                turn = low.zip(high).map_or(0.0, |(low, high)| self.turn((low + high) / 2.0));
            }
            positions.iter_mut().for_each(|[x, y]| [*x, *y] = self.cell_of([*x + turn, *y]));
            if !positions.as_flattened().iter().all(|at| at.abs() <= FARTHEST) {
                return Err(Error::bad_input("a position is too far from the grid")
                    .remedy("correct the position, or remove the feature"));
            }
            for (mark, [at, cell]) in self.marks.iter().enumerate() {
                crossings[0][mark] ^= is_within(ring, *at);
                crossings[1][mark] ^= is_within(&positions, *cell);
            }
            all.push(CellRing { positions, is_hole });
        }
        let [before, after] = crossings;
        let changed = before.iter().zip(&after).filter(|(before, after)| before != after).count();
        match 2 * changed > self.marks.len() {
            true => {
                Err(Error::unsupported("the polygon cannot be reprojected to the CRS of the grid")
                    .remedy("clip it to the surroundings of the grid first"))
            }
            false => Ok(all),
        }
    }

    /// A ring in the CRS of the grid, with further positions on edges that are not straight there.
    fn bent(&self, ring: &[[f64; 2]]) -> Result<Vec<[f64; 2]>> {
        let Some(operation) = &self.operation else { return Ok(ring.to_vec()) };
        let (Some(first), mut positions) = (ring.first(), Vec::new()) else {
            return Ok(Vec::new());
        };
        let mut from = [*first, operation.position(*first)?];
        positions.push(from[1]);
        for at in ring.iter().skip(1) {
            let to = [*at, operation.position(*at)?];
            self.bend([from, to], MAX_HALVINGS, &mut positions)?;
            from = to;
        }
        transform::check_steps(&positions, operation)?;
        Ok(positions)
    }

    /// Appends the positions of an edge after its first; each end is a position before and after reprojection. Halves are
    /// the same in either direction, so that neighbours share them.
    fn bend(
        &self,
        [from, to]: [[[f64; 2]; 2]; 2],
        halvings: u32,
        positions: &mut Vec<[f64; 2]>,
    ) -> Result<()> {
        let half = |a: [f64; 2], b: [f64; 2]| [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
        let middle = half(from[0], to[0]);
        let middle = [middle, self.in_grid(middle)?];
        let [a, b] = [half(from[1], to[1]), middle[1]].map(|at| self.cell_of(at));
        if halvings == 0 || (a[0] - b[0]).hypot(a[1] - b[1]) <= BEND {
            positions.push(to[1]);
            return Ok(());
        }
        self.bend([from, middle], halvings - 1, positions)?;
        self.bend([middle, to], halvings - 1, positions)
    }

    fn in_grid(&self, at: [f64; 2]) -> Result<[f64; 2]> {
        self.operation.as_ref().map_or(Ok(at), |operation| operation.position(at))
    }

    /// Degrees to add to a longitude to have it near the grid, which may count them from 0 to 360.
    fn turn(&self, x: f64) -> f64 {
        self.longitude.map_or(0.0, |middle| 360.0 * ((middle - x) / 360.0).round())
    }

    fn cell_of(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        self.transform.invert(x, y).map(|at| at + 0.5)
    }
}

/// A ring of a polygon, in cells.
pub(crate) struct CellRing {
    pub(crate) positions: Vec<[f64; 2]>,
    pub(crate) is_hole: bool,
}

/// True if a position is within a ring, by the number of edges to the left of it.
fn is_within(ring: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let edges = ring.iter().zip(ring.iter().cycle().skip(1));
    let left = edges.filter(|([ax, ay], [bx, by])| {
        (*ay <= y) != (*by <= y) && ax + (bx - ax) * ((y - ay) / (by - ay)) < x
    });
    left.count() % 2 == 1
}
