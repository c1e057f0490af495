//! Output in another CRS: the request, and sinks that reproject features and meshes as they are written. Processing
//! uses the CRS of the input.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use crate::grids_in_memory::{SHARE, check_memory, read};
use crate::options::OperationFiles;
use crate::{Resources, feature_files, geoid};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point3, wkt};
use terrane_crs::{CoordinateOperation, CoordinateOperationOptions, ShiftGrid};
use terrane_files::{name_of, path_of};
use terrane_mesh::{MeshBatch, MeshSink};
use terrane_raster::GridInfo;
use terrane_vector::{CoordinateSequence, Feature, FeatureSink, JsonMember, WrittenFeatures};

/// Target CRS, with the files for the transformation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TargetCrs {
    /// The CRS: a code ("EPSG:4326", "EPSG:6339+6360") or WKT.
    pub target: String,
    /// Files of the operation to it.
    #[serde(flatten)]
    pub files: OperationFiles,
}

/// Report on the transformation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Transformed {
    /// CRS of the output.
    pub crs: String,
    /// Coordinate operation.
    pub operation: String,
    /// Accuracy in metres; 0 within one datum, `None` if unknown.
    pub accuracy: Option<f64>,
}

impl Transformed {
    /// The report on an operation.
    pub fn of(operation: &CoordinateOperation) -> Self {
        Self {
            crs: operation.target().label(),
            operation: operation.name().to_owned(),
            accuracy: operation.accuracy(),
        }
    }
}

impl TargetCrs {
    /// A target CRS by code or text.
    pub fn to(target: impl Into<String>) -> Self {
        Self { target: target.into(), ..Self::default() }
    }

    /// The same with absolute paths.
    pub fn absolute(&self) -> Result<Self> {
        let OperationFiles { shift_grid, geoid } = &self.files;
        let [shift_grid, geoid] =
            [shift_grid, geoid].map(|path| path.as_deref().map(absolute).transpose());
        let files = OperationFiles { shift_grid: shift_grid?, geoid: geoid? };
        Ok(Self { files, ..self.clone() })
    }

    /// Minimum memory limit that holds its files.
    pub fn least_memory(&self) -> u64 {
        let sizes = self.files().map(|path| path.metadata().map_or(0, |file| file.len()));
        sizes.max().unwrap_or(0).saturating_mul(SHARE)
    }

    /// Its files.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.paths()
    }

    /// As [`OperationFiles::operation`], to this CRS.
    ///
    /// # Errors
    /// Those of [`OperationFiles::operation`].
    pub fn operation(
        &self,
        input: &Path,
        crs: &Crs,
        extent: Option<[f64; 4]>,
        resources: &Resources,
    ) -> Result<CoordinateOperation> {
        self.files.operation(&wkt::of_srs(&self.target), input, crs, extent, resources)
    }
}

impl OperationFiles {
    /// The files that are given.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.shift_grid.iter().chain(&self.geoid).map(PathBuf::as_path)
    }

    /// The operation from `crs`, that of the file `input`, to the CRS `target`, for data within `extent`: x and y low,
    /// x and y high.
    ///
    /// # Errors
    /// The errors of [`CoordinateOperation::between`]; grids that cannot be read.
    pub fn operation(
        &self,
        target: &Crs,
        input: &Path,
        crs: &Crs,
        extent: Option<[f64; 4]>,
        resources: &Resources,
    ) -> Result<CoordinateOperation> {
        // Errors about the CRS of the input name its file.
        crs.conversion().map_err(|e| e.in_file(input))?;
        let shift_grid = self.shift_grid.as_ref().map(|path| {
            ShiftGrid::of_ntv2(&read(path, resources)?).map(Arc::new).map_err(|e| e.in_file(path))
        });
        let geoid = self.geoid.as_ref().map(|path| geoid::read(path, resources).map(Arc::new));
        let options = CoordinateOperationOptions {
            extent,
            shift_grid: shift_grid.transpose()?,
            geoid: geoid.transpose()?,
        };
        CoordinateOperation::between(crs, target, &options)
    }
}

/// The bounds of a grid's samples.
pub fn extent_of(info: &GridInfo) -> [f64; 4] {
    let [east, south] = [info.width, info.height].map(|samples| f64::from(samples.max(1) - 1));
    let mut extent = PositionExtent::NONE;
    for [col, row] in [[0.0, 0.0], [east, 0.0], [0.0, south], [east, south]] {
        extent.add(info.transform.apply(col, row));
    }
    extent.0
}

/// Bounds of positions.
#[derive(Clone, Copy, Debug)]
pub struct PositionExtent([f64; 4]);

impl PositionExtent {
    /// Bounds of no position.
    pub const NONE: Self = Self([f64::MAX, f64::MAX, f64::MIN, f64::MIN]);

    /// Extends the bounds by a position.
    pub fn add(&mut self, [x, y]: [f64; 2]) {
        let [x0, y0, x1, y1] = self.0;
        self.0 = [x0.min(x), y0.min(y), x1.max(x), y1.max(y)];
    }

    /// The bounds; `None` if nothing was added.
    pub fn get(self) -> Option<[f64; 4]> {
        (self.0[0] <= self.0[2] && self.0[1] <= self.0[3]).then_some(self.0)
    }
}

/// Reprojects features as they are written.
pub struct FeatureReprojection {
    /// The sink of reprojected features.
    pub inner: Box<dyn FeatureSink>,
    /// The operation between the two CRSs.
    pub operation: Arc<CoordinateOperation>,
}

impl FeatureSink for FeatureReprojection {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        let mut feature = feature.clone();
        feature.foreign.retain(stays);
        let mut failed = None;
        feature.geometry.for_each_leaf(&mut |coordinates| {
            if failed.is_none() {
                failed = take(coordinates, &self.operation).err();
            }
        });
        failed.map_or(Ok(()), Err)?;
        self.inner.write(&feature)
    }

    fn finish(self: Box<Self>, foreign: &[JsonMember]) -> Result<WrittenFeatures> {
        let foreign: Vec<JsonMember> =
            foreign.iter().filter(|member| stays(member)).cloned().collect();
        self.inner.finish(&foreign)
    }
}

/// True for members to keep: all but bounding boxes, which are in the source CRS.
pub fn stays(member: &JsonMember) -> bool {
    member.name != "bbox"
}

fn take(coordinates: &mut CoordinateSequence, operation: &CoordinateOperation) -> Result<()> {
    let CoordinateSequence { xy, z, ends, .. } = coordinates;
    for (place, at) in xy.iter_mut().enumerate() {
        // Not a number stands for no height, and stays what it is.
        match z.get_mut(place).filter(|z| !z.is_nan()) {
            Some(z) => {
                let [x, y, height] = operation.point([at[0], at[1], *z])?;
                (*at, *z) = ([x, y], height);
            }
            None => *at = operation.position(*at)?,
        }
    }
    let mut start = 0;
    for end in ends.iter().copied() {
        check_steps(&xy[start..end], operation)?;
        start = end;
    }
    Ok(())
}

/// Fails if a line jumps from one edge of a map to the other: two neighbours in the source CRS are half of the earth
/// apart.
///
/// # Errors
/// Unsupported: the step.
pub fn check_steps(line: &[[f64; 2]], operation: &CoordinateOperation) -> Result<()> {
    const HALF: f64 = 20_037_508.0;
    let target = operation.target();
    let half = target.horizontal_metres().map_or(180.0, |metres| HALF / metres);
    let torn = line.windows(2).find(|pair| (pair[0][0] - pair[1][0]).abs() > half);
    torn.map_or(Ok(()), |pair| {
        let message = format!(
            "the line from {}, {} to {}, {} crosses the edge of {}",
            pair[0][0],
            pair[0][1],
            pair[1][0],
            pair[1][1],
            target.label()
        );
        Err(Error::unsupported(message).remedy("cut it there first, or choose another CRS"))
    })
}

/// Reprojects a mesh as it is written. Keeps the triangles, which must not be flipped.
pub struct MovingMesh {
    inner: Box<dyn MeshSink>,
    operation: Arc<CoordinateOperation>,
    vertices: Vec<Point3>,
    corners: Vec<[Point3; 3]>,
}

impl MovingMesh {
    /// Reprojects to `inner`.
    pub fn new(inner: Box<dyn MeshSink>, operation: Arc<CoordinateOperation>) -> Self {
        Self { inner, operation, vertices: Vec::new(), corners: Vec::new() }
    }

    /// Adds the corners of triangles; computes each vertex once.
    fn take_corners(&mut self, batch: &MeshBatch<'_>) -> Result<()> {
        let mut known: HashMap<u64, Point3> = HashMap::new();
        self.corners.clear();
        for (ids, corners) in batch.triangles.iter().zip(batch.corners) {
            let mut moved = [[0.0; 3]; 3];
            for ((place, id), corner) in moved.iter_mut().zip(ids).zip(corners) {
                *place = match known.get(id) {
                    Some(found) => *found,
                    None => *known.entry(*id).or_insert(self.operation.point(*corner)?),
                };
            }
            if !is_upright(&moved) {
                return Err(self.turned(corners[0]));
            }
            self.corners.push(moved);
        }
        Ok(())
    }

    fn turned(&self, [x, y, _]: Point3) -> Error {
        let target = self.operation.target().label();
        let message = format!("the triangle at {x}, {y} is inverted in {target}");
        Error::unsupported(message)
            .remedy("choose a smaller ‹tile› (smaller triangles) or another CRS")
    }
}

/// True if the corners are counter-clockwise seen from above.
fn is_upright([a, b, c]: &[Point3; 3]) -> bool {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
}

impl MeshSink for MovingMesh {
    fn wants_corners(&self) -> bool {
        true
    }

    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
        self.vertices.clear();
        for vertex in batch.vertices {
            self.vertices.push(self.operation.point(*vertex)?);
        }
        self.take_corners(&batch)?;
        let corners = if self.inner.wants_corners() { &self.corners[..] } else { &[] };
        self.inner.push(MeshBatch { vertices: &self.vertices, corners, ..batch })
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        self.inner.finish()
    }
}

fn absolute(path: &Path) -> Result<PathBuf> {
    let name = feature_files::absolute(&name_of(path.to_path_buf())?)?;
    Ok(path_of(&name).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;

    struct Drain;

    impl MeshSink for Drain {
        fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
            assert!(batch.corners.is_empty(), "not asked for");
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<u64> {
            Ok(0)
        }
    }

    #[test]
    fn a_triangle_that_turns_over_is_an_error_with_its_place() {
        let from = wkt::of_srs("EPSG:32632");
        let operation = CoordinateOperation::to_wgs84(&from, None).unwrap();
        let mut sink = MovingMesh::new(Box::new(Drain), Arc::new(operation));
        let [a, b] = [[300_000.0, 5e6, 0.0], [500_000.0, 5e6, 0.0]];
        let mut push = |up: f64| {
            let corners = [a, b, [400_000.0, 5e6 + up, 0.0]];
            let batch = MeshBatch {
                vertices: &corners,
                values: &[],
                triangles: &[[0, 1, 2]],
                corners: &[corners],
            };
            sink.push(batch)
        };
        push(2000.0).unwrap();
        let told = push(-2000.0).unwrap_err().to_string();
        assert!(told.contains("at 300000, 5000000 is inverted in EPSG:4326"), "{told}");
    }

    #[test]
    fn lines_across_the_edge_of_a_map_are_found() {
        let operation = CoordinateOperation::to_wgs84(&wkt::of_srs("EPSG:32632"), None).unwrap();
        assert!(check_steps(&[[170.0, 5.0], [179.0, 5.0]], &operation).is_ok());
        let told = check_steps(&[[179.0, 5.0], [-179.0, 5.0]], &operation).unwrap_err().to_string();
        assert!(told.contains("crosses the edge of EPSG:4326"), "{told}");
    }

    #[test]
    fn what_is_held_whole_is_a_small_part_of_the_memory() {
        assert!(check_memory(1 << 20, 8 << 20).is_ok());
        let told = check_memory(1 << 20, (8 << 20) - 1).unwrap_err();
        assert_eq!(told.kind(), ErrorKind::Resource);
        assert!(told.to_string().contains("‹memory› 8M"), "{told}");
    }
}
