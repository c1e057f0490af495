//! The points of a cloud in parts of space that fit into memory, and the parts around each.
//!
//! The bounding box is divided into cells; cells with too many points are divided again by their own bounding
//! box, until only duplicate positions exceed the limit. So a few distant points cost one more pass, for any
//! distribution of points.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::path::Path;

use bytemuck::{Pod, Zeroable};

use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_engine::plan::RunControl;
use terrane_files::Buckets;
use terrane_ground::neighbors::{Bounds, MetricSpace, NeighborParts};

/// Average number of points of a cell.
const AVERAGE: u64 = 1 << 12;
/// Most points of a part.
pub(super) const MOST: u64 = 1 << 14;
/// Most cells of a level.
const MAX_CELLS: u64 = 1 << 16;
/// Bytes of tables for each cell.
const CELL: u64 = 512;
/// Largest ratio of the final number of cells to that of a level.
const TIMES: u64 = 3;
/// Deepest level of division.
const DEEPEST: usize = 30;
/// Entries that are read together.
const TOGETHER: usize = 1 << 12;

/// A point and the number of its record.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct NumberedPoint {
    place: [i32; 3],
    spare: u32,
    number: u64,
}

impl NumberedPoint {
    pub(super) fn new(Point { x, y, z }: Point, number: u64) -> Self {
        Self { place: [x, y, z], spare: 0, number }
    }

    fn point(&self) -> Point {
        let [x, y, z] = self.place;
        Point { x, y, z }
    }
}

/// Bytes of tables for `points`.
pub(super) fn tables(points: u64) -> u64 {
    cells_for(points) * CELL * TIMES
}

fn cells_for(points: u64) -> u64 {
    (points / AVERAGE).clamp(1, MAX_CELLS)
}

/// A box in cells.
struct PartCells {
    low: [i64; 3],
    side: [i64; 3],
    counts: [i64; 3],
    /// The number of the first.
    first: usize,
}

impl PartCells {
    /// About `count` cells, as cubic as possible.
    fn new([low, high]: Bounds, space: &MetricSpace, count: u64, first: usize) -> Self {
        let (low, high) = (steps(low), steps(high));
        let extent = [0, 1, 2].map(|axis| (high[axis] - low[axis]).max(0) + 1);
        let (mut side, mut cells) = (extent, 1);
        while cells < count {
            let metres = [0, 1, 2].map(|axis| side[axis] as f64 * space.step[axis]);
            let divisible = (0..3).filter(|axis| side[*axis] > 1);
            let longest = divisible.max_by(|a, b| metres[*a].total_cmp(&metres[*b]));
            let Some(axis) = longest else { break };
            // The larger half stays, so that no side becomes 0.
            side[axis] -= side[axis] / 2;
            cells *= 2;
        }
        let counts = [0, 1, 2].map(|axis| (extent[axis] as u64).div_ceil(side[axis] as u64) as i64);
        Self { low, side, counts, first }
    }

    fn count(&self) -> usize {
        self.counts.iter().product::<i64>() as usize
    }

    /// The number of the cell of a point; one beyond them belongs to the nearest.
    fn of(&self, point: Point) -> usize {
        let at = steps(point);
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let cell = (at[axis] - self.low[axis]).div_euclid(self.side[axis]);
            cell.clamp(0, self.counts[axis] - 1)
        });
        self.first + ((z * self.counts[1] + y) * self.counts[0] + x) as usize
    }
}

fn steps(Point { x, y, z }: Point) -> [i64; 3] {
    [x, y, z].map(i64::from)
}

/// Points by cell.
struct PartLevel {
    entries: Buckets<NumberedPoint>,
    bounds: Vec<Option<Bounds>>,
}

impl PartLevel {
    fn new(cells: usize, folder: &Path, memory: u64) -> Self {
        Self { entries: Buckets::new(folder, cells, memory), bounds: vec![None; cells] }
    }

    /// Extends the bounds of a cell by a point.
    fn widen(&mut self, cell: usize, point: Point) {
        let [low, high] = self.bounds[cell].unwrap_or([point; 2]);
        self.bounds[cell] = Some([
            Point { x: low.x.min(point.x), y: low.y.min(point.y), z: low.z.min(point.z) },
            Point { x: high.x.max(point.x), y: high.y.max(point.y), z: high.z.max(point.z) },
        ]);
    }
}

/// Some points of a cell, or all of them.
#[derive(Clone, Copy)]
struct PointPart {
    level: usize,
    cell: usize,
    first: u64,
    count: u64,
    bounds: Bounds,
}

/// All points.
pub(super) struct PointParts<'a> {
    space: &'a MetricSpace,
    levels: Vec<PartLevel>,
    parts: Vec<PointPart>,
}

/// Builder of parts.
pub(super) struct PointPartsBuilder<'a> {
    space: &'a MetricSpace,
    folder: &'a Path,
    memory: u64,
    cells: PartCells,
    level: PartLevel,
}

impl<'a> PointPartsBuilder<'a> {
    /// For about `points` points within bounds, of which `memory` bytes stay in memory.
    pub(super) fn new(
        space: &'a MetricSpace,
        bounds: Bounds,
        points: u64,
        folder: &'a Path,
        memory: u64,
    ) -> Self {
        let cells = PartCells::new(bounds, space, cells_for(points), 0);
        let level = PartLevel::new(cells.count(), folder, memory / 2);
        Self { space, folder, memory, cells, level }
    }

    /// Adds points, draining `entries`.
    pub(super) fn add(&mut self, entries: &mut Vec<NumberedPoint>) -> Result<()> {
        put(&mut self.level, &self.cells, entries)?;
        entries.clear();
        Ok(())
    }

    /// Divides cells that have too many points.
    pub(super) fn finish(self, at: RunControl<'_>) -> Result<PointParts<'a>> {
        let Self { space, folder, memory, level, .. } = self;
        let mut parts = PointParts { space, levels: Vec::new(), parts: Vec::new() };
        let mut next = Some(level);
        while let Some(level) = next {
            at.cancel.check()?;
            let depth = parts.levels.len();
            let crowded = parts.take(&level);
            next = match crowded.is_empty() {
                true => None,
                // Halved at each level: all levels together stay within the memory.
                false => Some(divided(&level, &crowded, space, folder, memory >> (depth + 2), at)?),
            };
            parts.levels.push(level);
        }
        Ok(parts)
    }
}

/// Adds points to their cells.
fn put(level: &mut PartLevel, cells: &PartCells, entries: &[NumberedPoint]) -> Result<()> {
    let mut all: Vec<(usize, NumberedPoint)> =
        entries.iter().map(|entry| (cells.of(entry.point()), *entry)).collect();
    // One push for each cell, not for each point: a push locks its bucket. Stable, so that points stay as they came.
    all.sort_by_key(|(cell, _)| *cell);
    let mut run = Vec::new();
    for same in all.chunk_by(|(a, _), (b, _)| a == b) {
        run.clear();
        for (cell, entry) in same {
            level.widen(*cell, entry.point());
            run.push(*entry);
        }
        level.entries.push(same[0].0, &run)?;
    }
    Ok(())
}

/// Moves the points of some cells of a level into smaller ones.
fn divided(
    level: &PartLevel,
    crowded: &[(usize, Bounds)],
    space: &MetricSpace,
    folder: &Path,
    memory: u64,
    at: RunControl<'_>,
) -> Result<PartLevel> {
    let points: u64 = crowded.iter().map(|(cell, _)| level.entries.len(*cell)).sum();
    let average = AVERAGE.max(points / MAX_CELLS);
    let (mut all, mut first) = (Vec::new(), 0);
    for (cell, bounds) in crowded {
        let cells =
            // Two at least: one would be as crowded as before.
            PartCells::new(*bounds, space, (level.entries.len(*cell) / average).max(2), first);
        first += cells.count();
        all.push(cells);
    }
    let mut next = PartLevel::new(first, folder, memory);
    let mut some = vec![NumberedPoint::zeroed(); TOGETHER];
    for ((cell, _), cells) in crowded.iter().zip(&all) {
        at.cancel.check()?;
        let mut first = 0;
        while first < level.entries.len(*cell) {
            let read = level.entries.read_from(*cell, first, &mut some)?;
            first += read as u64;
            put(&mut next, cells, &some[..read])?;
        }
        level.entries.forget(*cell);
    }
    Ok(next)
}

impl PointParts<'_> {
    /// Adds the cells of the next level as parts, except those with too many points that can be divided.
    fn take(&mut self, level: &PartLevel) -> Vec<(usize, Bounds)> {
        let (depth, mut crowded) = (self.levels.len(), Vec::new());
        for (cell, bounds) in level.bounds.iter().enumerate() {
            let Some(bounds) = *bounds else { continue };
            let count = level.entries.len(cell);
            if count > MOST && bounds[0] != bounds[1] && depth < DEEPEST {
                crowded.push((cell, bounds));
                continue;
            }
            for first in (0..count).step_by(MOST as usize) {
                let count = (count - first).min(MOST);
                self.parts.push(PointPart { level: depth, cell, first, count, bounds });
            }
        }
        crowded
    }

    pub(super) fn count(&self) -> u64 {
        self.parts.len() as u64
    }

    /// The points of a part, and the numbers of their records.
    pub(super) fn load(
        &self,
        part: u64,
        points: &mut Vec<Point>,
        numbers: &mut Vec<u64>,
    ) -> Result<()> {
        self.each(&self.parts[part as usize], &mut |entry| {
            points.push(entry.point());
            numbers.push(entry.number);
        })
    }

    /// The parts around one.
    pub(super) fn around(&self, part: u64) -> NearestParts<'_> {
        NearestParts { parts: self, own: part as usize, queue: None, current: None }
    }

    fn each(&self, part: &PointPart, take: &mut dyn FnMut(&NumberedPoint)) -> Result<()> {
        let (entries, end) = (&self.levels[part.level].entries, part.first + part.count);
        let mut some = vec![NumberedPoint::zeroed(); TOGETHER.min(part.count as usize)];
        let mut first = part.first;
        while first < end {
            let count = (end - first).min(some.len() as u64) as usize;
            let read = entries.read_from(part.cell, first, &mut some[..count])?;
            first += read as u64;
            some[..read].iter().for_each(&mut *take);
        }
        Ok(())
    }
}

/// The parts around one, the nearest first.
pub(in crate::points::stages) struct NearestParts<'a> {
    parts: &'a PointParts<'a>,
    own: usize,
    /// Sorted by the bits of their squared distances, which have the same order.
    queue: Option<BinaryHeap<Reverse<(u64, usize)>>>,
    current: Option<usize>,
}

impl NearestParts<'_> {
    fn queue(&self, within: f64) -> BinaryHeap<Reverse<(u64, usize)>> {
        let (space, all) = (self.parts.space, &self.parts.parts);
        let own = all[self.own].bounds;
        let gaps = all.iter().enumerate().filter(|(i, _)| *i != self.own);
        let gaps = gaps.map(|(i, part)| (space.gap(own, part.bounds), i));
        gaps.filter(|(gap, _)| *gap < within).map(|(gap, i)| Reverse((gap.to_bits(), i))).collect()
    }
}

impl NeighborParts for NearestParts<'_> {
    fn next(&mut self, within: f64) -> Option<Bounds> {
        let mut queue = self.queue.take().unwrap_or_else(|| self.queue(within));
        let next = queue.pop().filter(|Reverse((gap, _))| f64::from_bits(*gap) < within);
        self.queue = Some(queue);
        self.current = next.map(|Reverse((_, part))| part);
        self.current.map(|part| self.parts.parts[part].bounds)
    }

    fn load(&mut self, points: &mut Vec<Point>) -> Result<()> {
        let Some(part) = self.current else { return Ok(()) };
        self.parts.each(&self.parts.parts[part], &mut |entry| points.push(entry.point()))
    }
}
