//! Grids whose water is level, as surveys deliver bare-earth models (hydro-flattening).
//!
//! Polygons are water: a lake, which is level, or a river, where a centre line of the same file runs within it.
//! A river is level from bank to bank and falls, or stays, along its lines, which are drawn downstream. Followed is
//! what the Lidar Base Specification of the U.S. Geological Survey asks of surfaces: water is level, or falls
//! monotonically, and is never above the ground beside it. Not followed is what it says of areas and widths from
//! which on water counts: what is in the file is water.
//!
//! - **Water** are the samples within the polygon whose corners are the samples nearest to those of a ring, and
//!   those on the [path](terrane_base::geom::SampleSegment) along its sides ([`mask`]), so that edges of a mesh can follow
//!   its bank exactly. Voids become water, too.
//! - **Levels** come from banks: the valid samples beside water (of the eight around a sample) that are none.
//!   A lake is as high as the lowest of them. A river goes down by straight lines from each place where its banks
//!   are lower than anywhere upstream to the next one ([`profile`]). So no sample of water is above a bank sample
//!   beside it: nothing floats.
//! - **Networks**: lines that share an end go on from one another, a lake is not above a line that ends in it,
//!   and a line that begins in one is not above it ([`levels`]).
//! - Water in voids without a valid sample beside it stays void; with heights of its own it is refused.
//! - Where bodies of water overlap, the lowest level holds. Polygons of one kind that share a side are one body.
//! - Heights that the file may have are not looked at.

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

/// Polygons and centre lines that are being gathered.
#[derive(Debug, Default)]
pub struct WaterFeatures {
    rings: ClipRings,
    areas: u32,
    /// Positions of all rings, and of all lines.
    at: [Vec<Xy>; 2],
    /// The area of each ring, and where it ends.
    ends: Vec<(u32, usize)>,
    line_ends: Vec<usize>,
}

impl WaterFeatures {
    /// Bytes that a vertex takes at the most (measured): where it is in the world and on the grid, with the indexes of
    /// sides, which are made one after the other.
    pub const VERTEX_BYTES: u64 = 320;

    /// Begins another polygon.
    ///
    /// # Errors
    /// More than 2^32 of them.
    pub fn begin_area(&mut self) -> Result<()> {
        self.rings.begin_feature()?;
        self.areas += 1;
        Ok(())
    }

    /// Adds a ring to the polygon begun last, its first position again at the end.
    ///
    /// # Errors
    /// As [`ClipRings::push`]; no polygon was begun.
    pub fn push_ring(&mut self, ring: &[Xy]) -> Result<()> {
        let none = || Error::usage("a ring of no polygon");
        let area = self.areas.checked_sub(1).ok_or_else(none)?;
        self.rings.push(ring)?;
        self.at[0].extend_from_slice(ring);
        self.ends.push((area, self.at[0].len()));
        Ok(())
    }

    /// Adds a centre line, drawn downstream; one without a length is none.
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

    /// Each ring with its area.
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

/// Water of a file. Levels are found by the first read of the one grid it is for.
#[derive(Debug)]
pub struct Water {
    path: PathBuf,
    crs: Crs,
    features: WaterFeatures,
    /// The body of each polygon.
    body_of: Vec<u32>,
    /// The lines of each body; none of a lake.
    bodies: Vec<Vec<u32>>,
    levels: Mutex<Option<Arc<WaterLevels>>>,
}

/// Report on flattened water.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct WaterReport {
    /// The file it is in.
    pub file: String,
    /// Bodies of it that are level, and
    pub lakes: u64,
    /// those along which a centre line runs.
    pub rivers: u64,
    /// Bodies without a sample on the grid.
    pub outside: u64,
    /// Bodies in voids, without a valid sample beside them: they stay void.
    pub without_bank: u64,
    /// Level of the lowest and of the highest sample of water.
    pub levels: Option<[f64; 2]>,
    /// The most that a river lies below all of its banks at some place: they were lower further upstream.
    pub dug: f64,
    /// Numbers of lines along which the banks of a river rise, counted from 1: they seem to be drawn upstream.
    pub rising: Vec<u64>,
}

impl WaterReport {
    /// What is odd about it, in words.
    pub fn notes(&self) -> Vec<String> {
        let told = |number: &u64| {
            let file = &self.file;
            format!("line {number} of {file}: its banks rise, is it drawn upstream?")
        };
        self.rising.iter().map(told).collect()
    }
}

impl Water {
    /// The water of the file `path`, in the system `crs`. Takes O((n + m) log n) time for n sides and m vertices
    /// of lines, where few sides are at a height.
    pub fn new(mut features: WaterFeatures, path: &Path, crs: Crs) -> Self {
        let world = PolygonEdgeIndex::new(std::mem::take(&mut features.rings));
        let lines_of = lines_of(&features, &world);
        let is_river = |area: u32| !lines_of[area as usize].is_empty();
        let body_of = bodies(&features, is_river);
        let count = body_of.iter().max().map_or(0, |most| *most as usize + 1);
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

    /// Each ring with the number of its polygon, from 0 on; the rings of one come after each other.
    pub fn rings(&self) -> impl Iterator<Item = (u32, &[Xy])> {
        self.features.rings()
    }

    /// The file that it is from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Vertices of its polygons.
    pub fn vertices(&self) -> usize {
        self.features.at[0].len()
    }

    /// Bytes that it takes.
    pub fn held(&self) -> u64 {
        let [of_rings, of_lines] = [0, 1].map(|kind| self.features.at[kind].len());
        (of_rings + of_lines) as u64 * WaterFeatures::VERTEX_BYTES + levels::held(of_lines)
    }

    /// The sides of all polygons on a grid, from sample to sample: what edges of a mesh follow.
    ///
    /// # Errors
    /// Another reference system; no polygon on the grid.
    pub fn banks(&self, grid: &GridInfo) -> Result<Vec<Ends>> {
        Ok(WaterMask::new(self, grid)?.into_sides())
    }

    /// What became of it; `None` before anything was read.
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

/// The lines that run within each area: with a vertex that is no end, or the middle of a segment.
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

/// The number of the body that each area belongs to: areas of one kind with a side in common are one.
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
    let number = |area| {
        let first = first_of(&mut with, area) as usize;
        if numbers[first] == u32::MAX {
            (numbers[first], next) = (next, next + 1);
        }
        numbers[first]
    };
    (0..features.areas).map(number).collect()
}

/// The first area of the body that an area belongs to so far.
fn first_of(with: &mut [u32], mut area: u32) -> u32 {
    while with[area as usize] != area {
        let up = with[area as usize];
        with[area as usize] = with[up as usize];
        area = up;
    }
    area
}
