//! Hydro-flattening: grids with level water, as in bare-earth models of surveys.
//!
//! A polygon is a lake, which is level, or a river if a centre line of the same file runs inside it. A river is
//! level from bank to bank and never rises along its lines, which are drawn downstream. Surfaces follow the Lidar
//! Base Specification of the U.S. Geological Survey: water is level or falls monotonically, and is never above the
//! adjacent ground. The minimum areas and widths of the specification are not applied: every polygon is water.
//!
//! - **Water samples** are those inside the polygon with its corners snapped to samples, and those on the
//!   [path](terrane_base::geom::SampleSegment) along its edges ([`mask`]), so that edges of a mesh can follow the bank
//!   exactly. Voids become water, too.
//! - **Levels** come from banks: the valid samples adjacent (8-neighbourhood) to water. A lake has the height of its
//!   lowest bank. A river falls linearly between the places where its banks are lower than anywhere upstream
//!   ([`profile`]). So no water sample is above an adjacent bank sample.
//! - **Networks**: lines continue at common ends, a lake is not above a line that ends in it, and a line that begins
//!   in a lake is not above the lake ([`levels`]).
//! - Water in voids without an adjacent valid sample stays void; if it has heights, it is an error.
//! - Where bodies overlap, the lowest level applies. Polygons of one kind with a common edge form one body.
//! - Heights in the water file are ignored.

mod axis;
mod layer;
mod levels;
mod mask;
mod profile;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use crate::GridInfo;
use crate::clip::{ClipRings, PolygonEdgeIndex};
pub(crate) use layer::levelled;
use levels::WaterLevels;
use mask::WaterMask;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Ends};

/// A position (x, y).
type Xy = [f64; 2];

/// Builder of water polygons and centre lines.
#[derive(Debug, Default)]
pub struct WaterFeatures {
    rings: ClipRings,
    areas: u32,
    /// Positions of all rings, and of all lines.
    at: [Vec<Xy>; 2],
    /// Polygon of each ring, and the end of its positions.
    ends: Vec<(u32, usize)>,
    line_ends: Vec<usize>,
}

impl WaterFeatures {
    /// Maximum memory of a vertex in bytes (measured): its positions in the world and on the grid, and the
    /// edge indexes, which are built one after the other.
    pub const VERTEX_BYTES: u64 = 320;

    /// Begins another polygon.
    ///
    /// # Errors
    /// More than 2^32 polygons.
    pub fn begin_area(&mut self) -> Result<()> {
        self.rings.begin_feature()?;
        self.areas += 1;
        Ok(())
    }

    /// Adds a ring, with its closing position, to the current polygon.
    ///
    /// # Errors
    /// As [`ClipRings::push`]; no current polygon.
    pub fn push_ring(&mut self, ring: &[Xy]) -> Result<()> {
        let area =
            self.areas.checked_sub(1).ok_or_else(|| Error::usage("ring without a polygon"))?;
        self.rings.push(ring)?;
        self.at[0].extend_from_slice(ring);
        self.ends.push((area, self.at[0].len()));
        Ok(())
    }

    /// Adds a centre line, drawn downstream; lines of zero length are ignored.
    ///
    /// # Errors
    /// A coordinate that is not finite.
    pub fn push_line(&mut self, line: &[Xy]) -> Result<()> {
        if let Some(at) = line.iter().find(|at| !at.iter().all(|c| c.is_finite())) {
            return Err(Error::bad_input(format!("position {at:?} is not finite")));
        }
        if line.iter().any(|at| *at != line[0]) {
            self.at[1].extend_from_slice(line);
            self.line_ends.push(self.at[1].len());
        }
        Ok(())
    }

    /// Number of polygons.
    pub fn areas(&self) -> u32 {
        self.areas
    }

    /// Each ring with its polygon.
    fn rings(&self) -> impl Iterator<Item = (u32, &[Xy])> {
        let starts = std::iter::once(0).chain(self.ends.iter().map(|(_, end)| *end));
        starts.zip(&self.ends).map(|(start, &(area, end))| (area, &self.at[0][start..end]))
    }

    /// Each line.
    fn lines(&self) -> impl Iterator<Item = &[Xy]> {
        let starts = std::iter::once(&0).chain(&self.line_ends);
        starts.zip(&self.line_ends).map(|(start, end)| &self.at[1][*start..*end])
    }
}

/// Water of a file. Levels are computed by the first read, and hold for one grid.
#[derive(Debug)]
pub struct Water {
    path: PathBuf,
    crs: Crs,
    features: WaterFeatures,
    /// Body of each polygon.
    body_of: Vec<u32>,
    /// Centre lines of each body; empty for a lake.
    bodies: Vec<Vec<u32>>,
    levels: Mutex<Option<Arc<WaterLevels>>>,
}

/// Report on flattened water.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct WaterReport {
    /// Name of the water file.
    pub file: String,
    /// Number of lakes.
    pub lakes: u64,
    /// Number of rivers, bodies with a centre line.
    pub rivers: u64,
    /// Number of bodies without a sample on the grid.
    pub outside: u64,
    /// Number of bodies in voids without an adjacent valid sample, which stay void.
    pub without_bank: u64,
    /// Lowest and highest level of water samples.
    pub levels: Option<[f64; 2]>,
    /// Maximum height of all banks above the river at one place, where banks are lower further upstream.
    pub dug: f64,
    /// Numbers of lines, from 1, along which banks rise; they are probably drawn upstream.
    pub rising: Vec<u64>,
}

impl WaterReport {
    /// Notes on unusual results.
    pub fn notes(&self) -> Vec<String> {
        let notes = self.rising.iter().map(|number| {
            format!(
                "line {number} of {}: bank heights rise along the line; check that it is drawn downstream",
                self.file
            )
        });
        notes.collect()
    }
}

impl Water {
    /// The water of the file `path`, with the CRS `crs`. O((n + m) log n) for n edges and m vertices of
    /// lines, if few edges overlap in height.
    pub fn new(mut features: WaterFeatures, path: &Path, crs: Crs) -> Self {
        let world = PolygonEdgeIndex::new(std::mem::take(&mut features.rings));
        let lines_of = lines_of(&features, &world);
        let body_of = bodies(&features, |area| !lines_of[area as usize].is_empty());
        let count = body_of.iter().max().map_or(0, |last| *last as usize + 1);
        let mut bodies = vec![Vec::new(); count];
        for (lines, &body) in lines_of.into_iter().zip(&body_of) {
            bodies[body as usize].extend(lines);
        }
        for lines in &mut bodies {
            lines.sort_unstable();
            lines.dedup();
        }
        let levels = Mutex::default();
        Self { path: path.to_path_buf(), crs, features, body_of, bodies, levels }
    }

    /// Each ring with the number of its polygon, from 0; rings of a polygon are adjacent.
    pub fn rings(&self) -> impl Iterator<Item = (u32, &[Xy])> {
        self.features.rings()
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of vertices of its polygons.
    pub fn vertices(&self) -> usize {
        self.features.at[0].len()
    }

    /// Memory in bytes.
    pub fn memory_use(&self) -> u64 {
        let [of_rings, of_lines] = [0, 1].map(|kind| self.features.at[kind].len());
        (of_rings + of_lines) as u64 * WaterFeatures::VERTEX_BYTES + levels::memory_use(of_lines)
    }

    /// Edges of all polygons on a grid, from sample to sample, for breaklines of a mesh.
    ///
    /// # Errors
    /// Another CRS; no polygon on the grid.
    pub fn banks(&self, grid: &GridInfo) -> Result<Vec<Ends>> {
        Ok(WaterMask::new(self, grid)?.into_sides())
    }

    /// The summary; `None` before the first read.
    pub fn report(&self) -> Option<WaterReport> {
        self.lock().as_ref().map(|levels| levels.report(self))
    }

    fn lock(&self) -> MutexGuard<'_, Option<Arc<WaterLevels>>> {
        self.levels.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_river(&self, body: u32) -> bool {
        !self.bodies[body as usize].is_empty()
    }
}

/// The lines inside each polygon: with an inner vertex, or the midpoint of a segment, in it.
fn lines_of(features: &WaterFeatures, world: &PolygonEdgeIndex) -> Vec<Vec<u32>> {
    let mut lines_of = vec![Vec::new(); features.areas as usize];
    let (mut turns, mut found) = (Vec::new(), Vec::new());
    for (number, line) in (0..).zip(features.lines()) {
        let inner = line.iter().skip(1).take(line.len().saturating_sub(2)).copied();
        let middles = line.windows(2).map(|p| [0, 1].map(|axis| p[0][axis].midpoint(p[1][axis])));
        for at in inner.chain(middles) {
            found.clear();
            world.features_at(at, &mut turns, &mut found);
            for feature in &found {
                let lines: &mut Vec<u32> = &mut lines_of[*feature as usize - 1];
                if lines.last() != Some(&number) {
                    lines.push(number);
                }
            }
        }
    }
    lines_of
}

/// The body of each polygon: polygons of one kind with a common edge form a body.
fn bodies(features: &WaterFeatures, is_river: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut with: Vec<u32> = (0..features.areas).collect();
    let mut sides: HashMap<_, u32> = HashMap::new();
    for (area, ring) in features.rings() {
        for pair in ring.windows(2).filter(|pair| pair[0] != pair[1]) {
            let mut ends = [pair[0], pair[1]].map(|at| at.map(|c| (c + 0.0).to_bits()));
            ends.sort_unstable();
            let other = *sides.entry((ends, is_river(area))).or_insert(area);
            let [a, b] = [other, area].map(|of| first_of(&mut with, of));
            with[a.max(b) as usize] = a.min(b);
        }
    }
    let mut numbers = vec![u32::MAX; with.len()];
    let mut next = 0;
    let bodies = (0..features.areas).map(|area| {
        let first = first_of(&mut with, area) as usize;
        if numbers[first] == u32::MAX {
            (numbers[first], next) = (next, next + 1);
        }
        numbers[first]
    });
    bodies.collect()
}

/// The first polygon of the body that a polygon belongs to so far.
fn first_of(with: &mut [u32], mut area: u32) -> u32 {
    while with[area as usize] != area {
        let up = with[area as usize];
        with[area as usize] = with[up as usize];
        area = up;
    }
    area
}
