//! Writes records into a folder of files, one for each tile with points.

use std::path::Path;

use serde::{Deserialize, Serialize};
use terrane_options::Choice;

use crate::records::selection::place;
use crate::records::{PointRecords, RecordFlow, total};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Decimal, Point, PointFrame};
use terrane_cloud::write::is_written_here;
use terrane_cloud::write::{CHUNK, CloudWriteOptions, CloudWriter, PointPacking};
use terrane_cloud::{CloudInfo, Flags};
use terrane_engine::plan::RunControl;
use terrane_engine::workers;
use terrane_files::{Buckets, path_of, shown};
use terrane_gridding::{CellEdgeRule, CellLattice};

/// Most tiles: each takes some memory.
const MAX_SQUARES: u64 = 1 << 20;
/// Widest buffer, in sides of a tile.
const MAX_SQUARES_BESIDE: f64 = 8.0;

/// A division of a point cloud into tiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointTiling {
    /// Side of a tile, in units of x and y; corners are at its multiples.
    pub side: f64,
    /// Width of the buffer of points around a tile.
    pub buffer: f64,
    /// Flag of buffer points.
    pub flag: BufferFlag,
}

/// Flag of buffer points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice, Serialize, Deserialize)]
pub enum BufferFlag {
    /// withheld flag; most readers skip these points by default
    #[default]
    Withheld,
    /// synthetic flag
    Synthetic,
}

impl BufferFlag {
    fn flag(self) -> Flags {
        match self {
            Self::Withheld => Flags::WITHHELD,
            Self::Synthetic => Flags::SYNTHETIC,
        }
    }
}

/// First and last tile along both axes.
pub(super) type Spans = [[i64; 2]; 2];

/// Number of files written, and of their points.
#[derive(Default)]
pub(super) struct SplitFiles {
    pub(super) files: u64,
    pub(super) points: u64,
    pub(super) bytes: u64,
}

impl SplitFiles {
    fn add(&mut self, other: &Self) {
        self.files += other.files;
        self.points += other.points;
        self.bytes += other.bytes;
    }
}

/// Tiles along an axis: the first and last step of the points of each file.
struct TilingAxis {
    first: i64,
    reaches: Vec<[i64; 2]>,
    /// Tiles on either side that a buffer may reach into.
    buffer_tiles: usize,
}

impl TilingAxis {
    fn new(
        frame: &PointFrame,
        axis: usize,
        [first, last]: [i64; 2],
        squares: &PointTiling,
    ) -> Self {
        let ruler = frame.ruler(axis);
        let reaches = (first..=last).map(|square| {
            let low = square as f64 * squares.side - squares.buffer;
            let high = (square + 1) as f64 * squares.side + squares.buffer;
            [ruler.first(low), ruler.last(high)]
        });
        let buffer_tiles = (squares.buffer / squares.side).ceil() as usize;
        Self { first, reaches: reaches.collect(), buffer_tiles }
    }

    /// The tile of a point, counted from the first, if it is one of these.
    fn index(&self, square: i64) -> Option<usize> {
        usize::try_from(square - self.first).ok().filter(|index| *index < self.reaches.len())
    }

    /// The tiles whose files have a point of this tile.
    fn around(&self, square: i64, steps: i32) -> impl Iterator<Item = usize> + '_ {
        let (own, reach) = (square - self.first, self.buffer_tiles as i64);
        let count = self.reaches.len() as i64;
        let [first, end] =
            [own - reach, own + reach + 1].map(|square| square.clamp(0, count) as usize);
        (first..end).filter(move |square| {
            let [low, high] = self.reaches[*square];
            *square as i64 == own || (low..=high).contains(&i64::from(steps))
        })
    }
}

/// Divides records.
pub(super) struct PointTileSplitter<'a> {
    squares: PointTiling,
    lattice: CellLattice,
    axes: [TilingAxis; 2],
    buckets: Buckets<u8>,
    options: &'a CloudWriteOptions,
}

impl<'a> PointTileSplitter<'a> {
    /// A splitter for some tiles of a point cloud; spills to `folder` beyond a number of bytes.
    pub(super) fn new(
        squares: PointTiling,
        spans: Spans,
        info: &CloudInfo,
        folder: &Path,
        memory: u64,
        options: &'a CloudWriteOptions,
    ) -> Self {
        let axes = [0, 1].map(|axis| TilingAxis::new(&info.frame, axis, spans[axis], &squares));
        let count = axes.iter().map(|axis| axis.reaches.len()).product();
        let buckets = Buckets::new(folder, count, memory);
        Self { squares, lattice: squares.lattice(&info.frame), axes, buckets, options }
    }

    /// Writes all records into a folder.
    pub(super) fn write(
        &self,
        records: &dyn PointRecords,
        flow: RecordFlow,
        threads: usize,
        folder: &Path,
        at: RunControl<'_>,
    ) -> Result<SplitFiles> {
        at.progress.begin("squares", total(records));
        let mut copy = Vec::new();
        flow.run(records, at, &mut |bytes| {
            bytes.chunks_exact(flow.record).try_for_each(|record| self.take(record, &mut copy))
        })?;
        at.progress.end();
        let count = self.axes[0].reaches.len() * self.axes[1].reaches.len();
        let all = FilledBuckets { buckets: &self.buckets, count, options: self.options };
        all.write(flow.record, threads, folder, |square| self.name(square), at)
    }

    fn take(&self, record: &[u8], copy: &mut Vec<u8>) -> Result<()> {
        let point = place(record);
        let [x, y] = &self.axes;
        let (column, row) = (self.lattice.x.index(point.x), self.lattice.y.index(point.y));
        let width = x.reaches.len();
        let own = x.index(column).zip(y.index(row));
        if let Some((column, row)) = own {
            self.buckets.push(row * width + column, record)?;
        }
        if self.squares.buffer == 0.0 {
            return Ok(());
        }
        copy.clear();
        copy.extend_from_slice(record);
        self.options.format.set_flags(copy, self.squares.flag.flag());
        for other_row in y.around(row, point.y) {
            for other_column in x.around(column, point.x) {
                if own != Some((other_column, other_row)) {
                    self.buckets.push(other_row * width + other_column, copy)?;
                }
            }
        }
        Ok(())
    }

    /// File name of a tile, by its lowest corner.
    fn name(&self, square: usize) -> String {
        let width = self.axes[0].reaches.len();
        let corner = [square % width, square / width];
        let side = self.squares.side;
        let [x, y] = [0, 1].map(|axis| times(self.axes[axis].first + corner[axis] as i64, side));
        format!("{x}_{y}")
    }
}

/// Extension of the files of a folder.
fn ending(packing: PointPacking) -> &'static str {
    if packing == PointPacking::Plain { "las" } else { "laz" }
}

/// Divided records, with a bucket for each file.
pub(super) struct FilledBuckets<'a> {
    pub(super) buckets: &'a Buckets<u8>,
    /// Number of buckets that may have records.
    pub(super) count: usize,
    pub(super) options: &'a CloudWriteOptions,
}

impl FilledBuckets<'_> {
    /// Writes a file for each bucket with records, under its name with the extension of the packing.
    pub(super) fn write(
        &self,
        record: usize,
        threads: usize,
        folder: &Path,
        name: impl Fn(usize) -> String + Sync,
        at: RunControl<'_>,
    ) -> Result<SplitFiles> {
        at.progress.begin("files", self.count as u64);
        let (ending, mut written) = (ending(self.options.packing), SplitFiles::default());
        workers::in_order(
            threads,
            self.count as u64,
            at.cancel,
            || (),
            |(), bucket| {
                let path = folder.join(format!("{}.{ending}", name(bucket as usize)));
                let file = self.file(bucket as usize, record, &path)?;
                at.progress.advance(1);
                Ok(file)
            },
            |file| {
                written.add(&file);
                Ok(())
            },
        )?;
        at.progress.end();
        Ok(written)
    }

    /// Writes the file of a bucket, if it has records.
    fn file(&self, bucket: usize, record: usize, path: &Path) -> Result<SplitFiles> {
        let all = self.buckets.len(bucket);
        if all == 0 {
            return Ok(SplitFiles::default());
        }
        let mut writer = CloudWriter::create(path, self.options)?;
        let (layout, mut first) = (writer.layout(), 0);
        while first < all {
            let mut piece = vec![0; (all - first).min((CHUNK * record) as u64) as usize];
            first += self.buckets.read_from(bucket, first, &mut piece)? as u64;
            writer.append(&layout.pack(piece)?)?;
        }
        self.buckets.forget(bucket);
        let points = writer.points();
        Ok(SplitFiles { files: 1, points, bytes: writer.finish()? })
    }
}

/// A multiple of a number, exact in decimals.
fn times(count: i64, number: f64) -> f64 {
    exact_multiple(count, number).unwrap_or(count as f64 * number)
}

/// A multiple in decimals; `None` if it has too many digits.
fn exact_multiple(count: i64, number: f64) -> Option<f64> {
    let number = Decimal::of(number)?;
    let units = number.units(number.digits())?.checked_mul(count.into())?;
    Some(Decimal::new(units, number.digits()).value())
}

/// The first and the last tile of a point cloud along both axes.
///
/// # Errors
/// Too many tiles; a buffer that is too wide.
pub(super) fn spans(squares: &PointTiling, info: &CloudInfo) -> Result<Spans> {
    if squares.buffer > MAX_SQUARES_BESIDE * squares.side {
        return Err(Error::usage(format!(
            "a buffer of {} is too wide for tiles of {}",
            squares.buffer, squares.side
        ))
        .remedy(format!("pass at most {MAX_SQUARES_BESIDE} times the side of a tile")));
    }
    let origin = Point { x: 0, y: 0, z: 0 };
    let spans = squares.lattice(&info.frame).span(info.bounds.unwrap_or([origin; 2]));
    let [columns, rows] = spans.map(|[first, last]| (last - first).unsigned_abs() + 1);
    if columns.saturating_mul(rows) > MAX_SQUARES {
        return Err(Error::usage(format!(
            "tiles of {} would be {columns} x {rows}, which exceeds the limit of {MAX_SQUARES}",
            squares.side
        ))
        .remedy("raise ‹tile›"));
    }
    Ok(spans)
}

impl PointTiling {
    fn lattice(&self, frame: &PointFrame) -> CellLattice {
        CellLattice::new(frame, [0.0; 2], [self.side; 2], CellEdgeRule::default())
    }
}

/// Whether a folder only has files of tiles written by terrane.
pub(super) fn is_ours(folder: &Path) -> bool {
    holds_only(folder, |stem| {
        let corner = stem.split_once('_');
        corner.is_some_and(|(x, y)| x.parse::<f64>().is_ok() && y.parse::<f64>().is_ok())
    })
}

/// Whether a folder only has files written by terrane with known names, compared without extension.
pub(super) fn holds_only(folder: &Path, is_known: impl Fn(&str) -> bool) -> bool {
    let mut entries = std::fs::read_dir(folder).into_iter().flatten();
    folder.is_dir()
        && entries.all(|entry| entry.is_ok_and(|entry| is_our_file(&entry.path(), &is_known)))
}

/// Whether a file was written by terrane under a known name.
fn is_our_file(path: &Path, is_known: impl Fn(&str) -> bool) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(".laz").or(name.strip_suffix(".las"));
    stem.is_some_and(is_known) && is_written_here(path)
}

/// Fails if one of the files lies in a folder to be replaced.
pub(super) fn refuse_within(files: &[String], folder: &Path) -> Result<()> {
    let Ok(real) = folder.canonicalize() else { return Ok(()) };
    let mut files = files.iter();
    match files.find(|file| path_of(file).canonicalize().is_ok_and(|path| path.starts_with(&real)))
    {
        None => Ok(()),
        Some(file) => {
            Err(Error::usage(format!("the output folder contains the input {}", shown(file)))
                .in_file(folder)
                .remedy("choose another output"))
        }
    }
}
