//! Writes records into an octree (COPC): every node has a sample of the points in its cube, and the nodes below
//! it have the rest.
//!
//! A node with at most [`NODE_POINTS`] points has them all, and so has one whose points are all at one
//! position. Otherwise its cube is divided into cells, and it takes the point nearest to the centre of each
//! from the eight nodes below. The result is a function of the points only: it does not depend on the columns
//! of nodes processed at a time, nor on the order of points, which are sorted in each node.
//!
//! Points are first divided into columns of the level where these have some ten thousand, as terrain is flat.
//! The four columns of a node are processed together, and the sample of a node moves up.

use std::collections::{BTreeMap, HashMap};
use std::hash::{BuildHasherDefault, Hasher};
use std::path::Path;

use rayon::prelude::*;

use crate::records::selection::place;
use crate::records::{PointRecords, RecordFlow, total};
use terrane_base::error::Result;
use terrane_base::geom::{Point, PointFrame};
use terrane_cloud::write::{CloudWriter, Key, OctreeCube, PointChunk, PointLayout};
use terrane_cloud::{CloudInfo, PointFormat};
use terrane_engine::plan::RunControl;
use terrane_files::Buckets;

/// Most points of a leaf node; more only if all are at one position.
const NODE_POINTS: usize = 1 << 16;
/// Cells along a side of a node, as a power of two.
const CELLS: u32 = 7;
/// Divisions of the cube along a side, as a power of two.
const FINE: u32 = 30;
/// Deepest level.
const DEEPEST: u32 = FINE - CELLS - 1;
/// Largest average number of points of a column.
const COLUMN_POINTS: u64 = 50_000;
/// Most levels of columns to start from.
const MAX_LEVELS: u32 = 8;

/// Maps points to the cube.
pub(super) struct OctreePlacement {
    frame: PointFrame,
    cube: OctreeCube,
}

/// Pending nodes of a column, by their numbers from the bottom.
type Column = BTreeMap<u32, PendingOctreeNode>;

/// A node whose points may still move up.
#[derive(Default)]
struct PendingOctreeNode {
    records: Vec<u8>,
    /// Occupancy of the points here and below.
    occupied: Occupancy,
}

/// Number of points, and the lowest and highest divisions of the cube they occupy.
#[derive(Clone, Copy)]
struct Occupancy {
    points: usize,
    low: [u32; 3],
    high: [u32; 3],
}

impl Default for Occupancy {
    /// The occupancy of no points.
    fn default() -> Self {
        Self { points: 0, low: [u32::MAX; 3], high: [0; 3] }
    }
}

impl Occupancy {
    /// The occupancy of one point.
    fn of(fine: [u32; 3]) -> Self {
        Self { points: 1, low: fine, high: fine }
    }

    fn and(self, other: Self) -> Self {
        Self {
            points: self.points + other.points,
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
        }
    }

    /// Whether a node has all these points itself.
    fn is_whole(&self) -> bool {
        self.points <= NODE_POINTS || self.low == self.high
    }
}

/// A finished node.
type Done = (Key, Vec<u8>);

impl OctreePlacement {
    /// The cube around a cloud.
    pub(super) fn new(info: &CloudInfo) -> Self {
        let origin = Point { x: 0, y: 0, z: 0 };
        let [low, high] = info.bounds.unwrap_or([origin; 2]).map(|point| info.frame.world(point));
        // A step at least: the cube around a single point is divided by its side too.
        let sides = (0..3).map(|axis| (high[axis] - low[axis]).max(info.frame.scale[axis]));
        let side = sides.fold(0.0, f64::max);
        Self { frame: info.frame, cube: OctreeCube { low, side, cells: 1 << CELLS } }
    }

    pub(super) fn cube(&self) -> OctreeCube {
        self.cube
    }

    /// The node of a level that a record is in.
    fn at(&self, level: u32, record: &[u8]) -> [u32; 3] {
        self.fine(record).map(|fine| fine >> (FINE - level))
    }

    /// The division of the cube that a record is in.
    fn fine(&self, record: &[u8]) -> [u32; 3] {
        let world = self.frame.world(place(record));
        let divisions = f64::from(1_u32 << FINE);
        std::array::from_fn(|axis| {
            let share = (world[axis] - self.cube.low[axis]) / self.cube.side;
            // The highest point is at 1, or by rounding a hair beyond.
            (share * divisions).clamp(0.0, divisions - 1.0) as u32
        })
    }
}

/// The four columns below one.
fn below(at: [u32; 2]) -> [[u32; 2]; 4] {
    [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| [2 * at[0] + x, 2 * at[1] + y])
}

/// Makes the octree of records.
pub(super) struct Octree<'a> {
    pub(super) place: &'a OctreePlacement,
    pub(super) layout: PointLayout,
    pub(super) folder: &'a Path,
    /// Bytes of records of a column in memory, and of all pending ones.
    pub(super) memory: [u64; 2],
    pub(super) at: RunControl<'a>,
}

impl Octree<'_> {
    /// Writes all records.
    pub(super) fn write(
        &self,
        records: &dyn PointRecords,
        flow: RecordFlow,
        writer: &mut CloudWriter,
    ) -> Result<()> {
        let all = total(records);
        self.at.progress.begin("columns", all);
        let level = (0..MAX_LEVELS).find(|level| all >> (2 * level) <= COLUMN_POINTS);
        let level = level.unwrap_or(MAX_LEVELS);
        let columns = OctreeColumns::new(level, 0, [0; 2], self.folder, self.memory[1]);
        flow.run(records, self.at, &mut |bytes| columns.take(bytes, self))?;
        self.at.progress.end();
        self.at.progress.begin("nodes", all);
        let root = self.column(0, [0; 2], &columns, writer)?;
        let root = root.into_iter().map(|(z, node)| ([0, 0, 0, z as i32], node.records));
        self.put(root.collect(), writer)?;
        self.at.progress.end();
        Ok(())
    }

    fn size(&self) -> usize {
        self.layout.size()
    }

    /// The nodes of a column of a level, those below it written.
    fn column(
        &self,
        level: u32,
        at: [u32; 2],
        columns: &OctreeColumns,
        writer: &mut CloudWriter,
    ) -> Result<Column> {
        self.at.cancel.check()?;
        let four = below(at);
        let below = match level == columns.level {
            true if columns.bytes(at) <= self.memory[0] || level >= DEEPEST => {
                return self.leaf(level, at, columns, writer);
            }
            true => {
                // A quarter, as columns within columns wait at one time: all of them hold a third more than the first.
                let memory = self.memory[1] / 4;
                let finer = OctreeColumns::new(level + 1, level, at, self.folder, memory);
                columns.each(at, self.size(), &mut |bytes| finer.take(bytes, self))?;
                columns.forget(at);
                self.all(level + 1, four, &finer, writer)?
            }
            false => self.all(level + 1, four, columns, writer)?,
        };
        let mut done = Vec::new();
        let column = self.above(level, below, &mut done);
        self.put(done, writer)?;
        Ok(column)
    }

    /// Four columns: at once, where they are the lowest.
    fn all(
        &self,
        level: u32,
        four: [[u32; 2]; 4],
        columns: &OctreeColumns,
        writer: &mut CloudWriter,
    ) -> Result<Vec<([u32; 2], Column)>> {
        if level < columns.level || four.iter().any(|at| columns.bytes(*at) > self.memory[0]) {
            let four = four.into_iter();
            return four.map(|at| Ok((at, self.column(level, at, columns, writer)?))).collect();
        }
        let built = four.into_par_iter().map(|at| Ok((at, self.build(level, at, columns)?)));
        let built: Vec<_> = built.collect::<Result<_>>()?;
        let mut all = Vec::new();
        // Packed on all threads, but appended in the order of columns, so that their number leaves no trace.
        for (at, (column, chunks)) in built {
            self.append(chunks, writer)?;
            all.push((at, column));
        }
        Ok(all)
    }

    /// A column whose points are all held.
    fn leaf(
        &self,
        level: u32,
        at: [u32; 2],
        columns: &OctreeColumns,
        writer: &mut CloudWriter,
    ) -> Result<Column> {
        let (column, chunks) = self.build(level, at, columns)?;
        self.append(chunks, writer)?;
        Ok(column)
    }

    /// The nodes of a column, and those below it, packed.
    fn build(
        &self,
        level: u32,
        at: [u32; 2],
        columns: &OctreeColumns,
    ) -> Result<(Column, Vec<(Key, PointChunk)>)> {
        let mut records = Vec::new();
        columns.each(at, self.size(), &mut |bytes| {
            records.extend_from_slice(bytes);
            Ok(())
        })?;
        columns.forget(at);
        let mut done = Vec::new();
        let column = self.split(level, at, records, &mut done);
        Ok((column, self.packed(done)?))
    }

    /// The nodes of a column of these points; finished nodes below it go to `done`.
    fn split(&self, level: u32, at: [u32; 2], records: Vec<u8>, done: &mut Vec<Done>) -> Column {
        let mut column = Column::new();
        for record in records.chunks_exact(self.size()) {
            let fine = self.place.fine(record);
            let node = column.entry(fine[2] >> (FINE - level)).or_default();
            node.records.extend_from_slice(record);
            node.occupied = node.occupied.and(Occupancy::of(fine));
        }
        // Deeper, cells would be finer than the divisions of the cube.
        if level >= DEEPEST || column.values().all(|node| node.occupied.is_whole()) {
            return column;
        }
        // The copies of this trial go before the quarters are made.
        drop(column);
        let mut four: [Vec<u8>; 4] = Default::default();
        for record in records.chunks_exact(self.size()) {
            let [x, y, _] = self.place.at(level + 1, record);
            four[(x & 1 | (y & 1) << 1) as usize].extend_from_slice(record);
        }
        drop(records);
        let four = below(at).into_iter().zip(four);
        let below = four.map(|(at, records)| (at, self.split(level + 1, at, records, done)));
        let below = below.collect();
        self.above(level, below, done)
    }

    /// The nodes of a column above four others, which become finished.
    fn above(&self, level: u32, below: Vec<([u32; 2], Column)>, done: &mut Vec<Done>) -> Column {
        let mut nodes: BTreeMap<u32, Vec<([u32; 3], PendingOctreeNode)>> = BTreeMap::new();
        for ([x, y], column) in below {
            for (z, node) in column {
                nodes.entry(z / 2).or_default().push(([x, y, z], node));
            }
        }
        nodes.into_iter().map(|(z, below)| (z, self.taken(level, below, done))).collect()
    }

    /// The sample of a node from those below it, which become finished.
    fn taken(
        &self,
        level: u32,
        below: Vec<([u32; 3], PendingOctreeNode)>,
        done: &mut Vec<Done>,
    ) -> PendingOctreeNode {
        let all = below.iter().map(|(_, node)| node.occupied);
        let occupied = all.fold(Occupancy::default(), Occupancy::and);
        if occupied.is_whole() {
            let records = below.iter().flat_map(|(_, node)| node.records.iter().copied()).collect();
            return PendingOctreeNode { records, occupied };
        }
        let all: Vec<SampleCandidate<'_>> = (0..)
            .zip(&below)
            .flat_map(|(node, (_, own))| {
                let records = own.records.chunks_exact(self.size());
                records.map(move |record| self.candidate(level, node, record))
            })
            .collect();
        let best = best(&all);
        let mut sample = Vec::new();
        let mut rest: Vec<Vec<u8>> = vec![Vec::new(); below.len()];
        for (number, own) in (0..).zip(all) {
            let is_sampled = best.get(&own.cell) == Some(&number);
            let into = if is_sampled { &mut sample } else { &mut rest[own.node] };
            into.extend_from_slice(own.record);
        }
        let level = level as i32 + 1;
        for ((at, _), records) in below.iter().zip(rest).filter(|(_, rest)| !rest.is_empty()) {
            let [x, y, z] = at.map(|number| number as i32);
            done.push(([level, x, y, z], records));
        }
        PendingOctreeNode { records: sample, occupied }
    }

    /// A record of a node below, with its cell in a node of a level.
    fn candidate<'r>(&self, level: u32, node: usize, record: &'r [u8]) -> SampleCandidate<'r> {
        let fine = self.place.fine(record);
        let shift = FINE - level - CELLS;
        let [x, y, z] = fine.map(|fine| fine >> shift & ((1 << CELLS) - 1));
        let side = 1_i64 << shift;
        // Doubled: the middles of a cell and of a division of the cube are both at halves.
        let offsets = fine.map(|fine| 2 * (i64::from(fine) & (side - 1)) + 1 - side);
        let squared_distance = offsets.iter().map(|offset| offset.pow(2) as u64).sum();
        let cell = x | y << CELLS | z << (2 * CELLS);
        SampleCandidate { node, cell, squared_distance, record }
    }

    fn put(&self, done: Vec<Done>, writer: &mut CloudWriter) -> Result<()> {
        self.append(self.packed(done)?, writer)
    }

    fn packed(&self, done: Vec<Done>) -> Result<Vec<(Key, PointChunk)>> {
        let done = done.into_par_iter();
        done.map(|(key, records)| Ok((key, self.layout.pack(self.sorted(&records))?))).collect()
    }

    fn append(&self, chunks: Vec<(Key, PointChunk)>, writer: &mut CloudWriter) -> Result<()> {
        for (key, chunk) in chunks {
            writer.append_node(key, &chunk)?;
            self.at.progress.advance(chunk.points() as u64);
        }
        Ok(())
    }

    /// Records by time, then by their bytes.
    fn sorted(&self, records: &[u8]) -> Vec<u8> {
        let at = PointFormat::default().time_at().unwrap_or(0);
        let all = records.chunks_exact(self.size()).map(|record| {
            let time = record[at..].first_chunk().map_or(0.0, |t| f64::from_le_bytes(*t));
            (time, record)
        });
        let mut all: Vec<(f64, &[u8])> = all.collect();
        // Records that are equal in both are the same bytes: the order of the input does not show.
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(b.1)));
        all.iter().flat_map(|(_, record)| record.iter().copied()).collect()
    }
}

/// A record that may be in the sample of a node.
struct SampleCandidate<'a> {
    /// Number of the node below that has it.
    node: usize,
    cell: u32,
    /// From the centre of the cell.
    squared_distance: u64,
    record: &'a [u8],
}

/// The number of the point nearest to the centre of each cell; of ties the first by its bytes.
fn best(all: &[SampleCandidate<'_>]) -> HashMap<u32, u32, BuildHasherDefault<CellHasher>> {
    let mut best = HashMap::default();
    for (number, own) in (0..).zip(all) {
        let known = best.entry(own.cell).or_insert(number);
        let kept = &all[*known as usize];
        if (own.squared_distance, own.record) < (kept.squared_distance, kept.record) {
            *known = number;
        }
    }
    best
}

/// A fast hash of cells: a node has at most 2^21, so that collisions are few whatever the points.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u32((*byte).into()));
    }

    fn write_u32(&mut self, cell: u32) {
        self.0 = (self.0 ^ u64::from(cell)).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(32);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

/// Records by columns of a level, in memory and in a file.
struct OctreeColumns {
    level: u32,
    /// Level and position of their common column.
    within: (u32, [u32; 2]),
    buckets: Buckets<u8>,
}

impl OctreeColumns {
    fn new(level: u32, above: u32, at: [u32; 2], folder: &Path, memory: u64) -> Self {
        let count = 1 << (2 * (level - above));
        Self { level, within: (above, at), buckets: Buckets::new(folder, count, memory) }
    }

    fn number(&self, at: [u32; 2]) -> usize {
        let (above, corner) = self.within;
        let shift = self.level - above;
        let [x, y] = [0, 1].map(|axis| at[axis] - (corner[axis] << shift));
        (y << shift | x) as usize
    }

    fn take(&self, bytes: &[u8], octree: &Octree<'_>) -> Result<()> {
        for record in bytes.chunks_exact(octree.size()) {
            let [x, y, _] = octree.place.at(self.level, record);
            self.buckets.push(self.number([x, y]), record)?;
        }
        Ok(())
    }

    fn bytes(&self, at: [u32; 2]) -> u64 {
        self.buckets.len(self.number(at))
    }

    /// Reads the complete records of a column, in batches.
    fn each(
        &self,
        at: [u32; 2],
        size: usize,
        each: &mut dyn FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        let (number, max_bytes) = (self.number(at), (1 << 20) / size * size);
        let (mut first, mut piece) = (0, Vec::new());
        while first < self.buckets.len(number) {
            let left = self.buckets.len(number) - first;
            piece.resize(left.min(max_bytes as u64) as usize, 0);
            let read = self.buckets.read_from(number, first, &mut piece)?;
            each(&piece[..read])?;
            first += read as u64;
        }
        Ok(())
    }

    fn forget(&self, at: [u32; 2]) {
        self.buckets.forget(self.number(at));
    }
}
