//! Poisson disk sampling in 3D: no two kept points are nearer to each other than a distance, and each dropped
//! point is nearer than that to a kept one.
//!
//! Points are processed in the order of a hash of their positions, and a point is kept if no earlier kept point
//! is nearer than the distance. So the result is a function of the set of points. A verdict may depend on ever
//! more distant points, but chains of dependent points are short: O(log n) of n points is expected (Blelloch,
//! Fineman, Shun 2012). So tiles are processed separately, with their surroundings; where a chain reaches
//! beyond, verdicts are unknown, and a larger surrounding is read.

mod decisions;

use std::path::Path;
use std::str::FromStr;
use std::sync::Mutex;

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use super::{
    OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput, StageReach,
};
use crate::point_index::Tiling;
use crate::records::numbered::{self, RecordNumbers};
use crate::records::selection::{ChosenRecords, place, time};
use crate::records::{PointRecords, RecordFlow, total};
use decisions::{BLOCKING_BYTES, PoissonVerdict, PoissonVerdicts, Span, contains};
use terrane_base::bits::BitSet;
use terrane_base::bits::{mixed, ordered};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{DistancePredicate, Point};
use terrane_cloud::{CloudInfo, PointFormat};
use terrane_delaunay::SiteWindow;
use terrane_engine::plan::RunControl;
use terrane_engine::workers;
use terrane_files::{Buckets, lock};

/// Poisson disk sampling with this distance in 3D, in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoissonSampling(pub f64);

impl FromStr for PoissonSampling {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        let distance = text.parse().ok().filter(|distance: &f64| *distance > 0.0);
        distance
            .filter(|distance| distance.is_finite())
            .map(Self)
            .ok_or("expected a distance above 0")
    }
}

impl PoissonSampling {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "poisson",
        "DISTANCE",
        "thin to a minimum 3D distance between points (Poisson disk sampling)",
    )];
}

impl Stage for PoissonSampling {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Selects
    }

    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Cloud {
            option: Some("thin_distance"),
            reason: "a point may depend on distant ones",
        })
    }

    fn needed(&self, info: &CloudInfo, _: u64) -> [u64; 2] {
        needed(info.count)
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        check(self.0, input.info)?;
        Ok(Box::new(*self))
    }
}

impl OpenStage for PoissonSampling {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let StageContext { work, info, .. } = *around;
        let discs = PoissonDiscs {
            apart: DistancePredicate::new(info.frame.scale, self.0),
            info,
            format: work.options.format,
            flow: work.shares.flow,
            threads: work.shares.threads,
            memory: around.memory(),
            folder: work.folder(),
            at: work.at,
        };
        discs.select(records).map(StageOutput::new)
    }
}

/// First margin around a tile, in distances.
const HALO: i64 = 4;
/// Least side of a tile, in distances, unless it has too many points.
const MIN_SIDE: i64 = 16;
/// Approximate largest number of points of a tile.
const MAX_POINTS: u64 = 1 << 17;
/// Bytes of tables for each tile.
const SQUARE: u64 = 256;
/// Least bytes of a thread.
const LEAST: u64 = 2 << 20;
/// Most points queued at a time.
const MAX_WAITING: u64 = 1 << 20;
/// Entries that are read together.
const TOGETHER: usize = 1 << 12;

/// A point to decide on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
struct PoissonCandidate {
    place: [i32; 3],
    spare: u32,
    time: u64,
    /// Number of the record.
    number: u64,
}

/// A point by its rank: the lowest comes first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct RankedCandidate {
    hash: u64,
    entry: PoissonCandidate,
}

impl RankedCandidate {
    fn of(entry: PoissonCandidate) -> Self {
        Self { hash: mixed(&entry.place.map(ordered)), entry }
    }

    fn point(&self) -> Point {
        let [x, y, z] = self.entry.place;
        Point { x, y, z }
    }

    /// Whether it need not be processed: it is dropped or, beyond the span, unknown like others of its cell.
    fn is_decided(&self, span: &Span, verdicts: &PoissonVerdicts<'_>) -> bool {
        match contains(span, [self.entry.place[0], self.entry.place[1]]) {
            true => verdicts.is_left_out(self.point()),
            false => verdicts.is_settled(self.point()),
        }
    }
}

/// Bytes of memory for `points`, and for each thread.
fn needed(points: u64) -> [u64; 2] {
    let tables = (points / 4096).clamp(1, 1 << 18) * SQUARE;
    [points / 8 + tables + LEAST, LEAST]
}

/// Fails if 3D distances are undefined, or the distance is below the coordinate resolution.
fn check(distance: f64, info: &CloudInfo) -> Result<()> {
    let (crs, scale) = (&info.crs, info.frame.scale);
    if crs.horizontal_unit() == "degree" {
        return Err(Error::usage(
            "‹thin_distance› requires projected coordinates; these are in degrees",
        )
        .remedy("reproject the points first, for example with the stage reproject:CRS, or thin by cells"));
    }
    let units = crs.horizontal_metres().zip(crs.vertical_metres());
    if units.is_some_and(|(across, up)| (across / up - 1.0).abs() > 1e-5) {
        return Err(Error::usage("‹thin_distance› requires heights in the unit of x and y")
            .remedy(
                "reproject the points first, for example with the stage reproject:CRS, or thin by cells",
            ));
    }
    if !distance.is_finite() || scale.iter().any(|step| distance < *step) {
        return Err(Error::usage(format!(
            "a distance of {distance} is smaller than the coordinate resolution"
        ))
        .remedy("pass a larger distance, or ‹dedupe› for duplicate points"));
    }
    Ok(())
}

/// Context of the sampling.
struct PoissonDiscs<'a> {
    apart: DistancePredicate,
    /// Frame and bounds of the records.
    info: &'a CloudInfo,
    format: PointFormat,
    flow: RecordFlow,
    threads: usize,
    /// Bytes for points.
    memory: u64,
    folder: &'a Path,
    at: RunControl<'a>,
}

/// Points by tile, and the kept ones.
struct PoissonSampler<'a> {
    discs: &'a PoissonDiscs<'a>,
    tiling: Tiling,
    /// Bounds of all points.
    bounds: Span,
    entries: Buckets<PoissonCandidate>,
    kept: Mutex<BitSet>,
}

/// Result of a tile.
enum TileState {
    All,
    /// All verdicts are known, except some within a span.
    But(Span),
    /// There are too many points.
    TooMany,
}

impl PoissonDiscs<'_> {
    /// The kept records.
    ///
    /// # Errors
    /// Too many nearby points for the memory.
    fn select<'r>(&self, records: &'r dyn PointRecords) -> Result<ChosenRecords<'r>> {
        let [low, high] = self.info.bounds.unwrap_or_default();
        let tiling = Tiling::new([low, high], self.info.count);
        let entries = Buckets::new(self.folder, tiling.count(), self.memory / 2);
        self.at.progress.begin("places", total(records));
        let numbers = self.pass(records, &tiling, &entries)?;
        self.at.progress.end();
        let bounds = [low, high].map(|end| [i64::from(end.x), i64::from(end.y)]);
        let kept = Mutex::new(BitSet::new(numbers.total as usize));
        let search = PoissonSampler { discs: self, tiling, bounds, entries, kept };
        search.run()?;
        let kept = search.kept.into_inner().unwrap_or_default();
        Ok(ChosenRecords::of(records, self.flow.record, numbers, kept))
    }

    fn pass(
        &self,
        records: &dyn PointRecords,
        tiling: &Tiling,
        entries: &Buckets<PoissonCandidate>,
    ) -> Result<RecordNumbers> {
        let time_at = self.format.time_at();
        let mut writer = entries.writer();
        let numbers = numbered::pass(records, self.flow, self.at, &mut |number, record| {
            let point = place(record);
            let (place, time) = ([point.x, point.y, point.z], time(record, time_at));
            let entry = PoissonCandidate { place, spare: 0, time, number };
            writer.push(tiling.square_of(point), entry)
        })?;
        writer.finish()?;
        Ok(numbers)
    }

    /// Bytes of a thread: half for queued points, half for stored ones.
    fn share(&self) -> u64 {
        (self.memory / 2 / self.threads as u64).max(LEAST)
    }

    /// Number of queued points.
    fn max_waiting(&self) -> usize {
        (self.share() / 4 / size_of::<RankedCandidate>() as u64).min(MAX_WAITING) as usize
    }

    fn max_blocking(&self) -> usize {
        (self.share() / 2 / BLOCKING_BYTES) as usize
    }

    /// Larger of the numbers of steps along x and y that exceed the distance.
    fn reach(&self) -> i64 {
        let [x, y, _] = self.apart.steps();
        x.max(y)
    }

    /// The side of tiles whose points, with their surroundings, fit into the queue.
    fn side(&self, tiling: &Tiling) -> i64 {
        let each = (self.info.count / tiling.count() as u64).max(1);
        let squares = (self.max_waiting() as u64).min(MAX_POINTS) / each;
        let side = (squares.max(1).isqrt() as i64).saturating_mul(tiling.side().into());
        let reach = self.reach();
        side.saturating_sub(reach.saturating_mul(2 * HALO)).max(reach.saturating_mul(MIN_SIDE))
    }
}

impl PoissonSampler<'_> {
    /// Finds all kept points, tile by tile.
    fn run(&self) -> Result<()> {
        let PoissonDiscs { threads, at, .. } = self.discs;
        let ([low, high], side) = (self.bounds, self.discs.side(&self.tiling));
        let [columns, rows] = [0, 1].map(|axis| (high[axis] - low[axis]) / side + 1);
        let count = (columns * rows) as u64;
        at.progress.begin("distances", count);
        workers::run(
            *threads,
            count,
            at.cancel,
            || Vec::with_capacity(2 * self.discs.max_waiting()),
            |waiting, tile| {
                let place = [tile as i64 % columns, tile as i64 / columns];
                let first = [0, 1].map(|axis| low[axis] + place[axis] * side);
                let last = [0, 1].map(|axis| first[axis].saturating_add(side - 1).min(high[axis]));
                self.sample([first, last], waiting)?;
                at.progress.advance(1);
                Ok(())
            },
            |_| Ok(()),
        )?;
        at.progress.end();
        Ok(())
    }

    /// Finds the kept points of a tile; spans with unknown verdicts are processed again, with a wider margin.
    fn sample(&self, tile: Span, waiting: &mut Vec<RankedCandidate>) -> Result<()> {
        let mut spans = vec![(tile, HALO)];
        while let Some((span, halo)) = spans.pop() {
            self.discs.at.cancel.check()?;
            match self.judge(span, halo, waiting)? {
                TileState::All => {}
                TileState::But(unknown) => spans.push((unknown, 2 * halo)),
                TileState::TooMany => {
                    let quarters = self.quarters(span)?;
                    spans.extend(quarters.map(|quarter| (quarter, halo)));
                }
            }
        }
        Ok(())
    }

    /// The quarters of a span that has too many points.
    fn quarters(&self, [low, high]: Span) -> Result<[Span; 4]> {
        if (0..2).any(|axis| high[axis] - low[axis] < self.discs.reach()) {
            let distance = self.discs.apart.least();
            let message = format!("too many points with a spacing of {distance} in one tile");
            return Err(Error::new(ErrorKind::Resource, message)
                .remedy("raise ‹memory› or ‹thin_distance›"));
        }
        let middle = [0, 1].map(|axis| low[axis] + (high[axis] - low[axis]) / 2);
        let halves = [0, 1].map(|axis| [[low[axis], middle[axis]], [middle[axis] + 1, high[axis]]]);
        Ok([[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| {
            let ([west, east], [south, north]) = (halves[0][x], halves[1][y]);
            [[west, south], [east, north]]
        }))
    }

    /// Decides on the points of a span and a margin of `halo` distances, in order; keeps those of the span that
    /// are known to be kept.
    fn judge(
        &self,
        span: Span,
        halo: i64,
        waiting: &mut Vec<RankedCandidate>,
    ) -> Result<TileState> {
        let (extended, sure) = self.around(span, halo);
        let mut verdicts = PoissonVerdicts::new(&self.discs.apart, sure);
        let (mut unknown, mut after): (Option<Span>, _) = (None, None);
        loop {
            let is_last = self.next([&span, &extended], after, &verdicts, waiting)?;
            let mut kept = Vec::new();
            for turn in waiting.iter() {
                let (verdict, [x, y, _]) = (verdicts.judge(turn.point()), turn.entry.place);
                match verdict {
                    _ if !contains(&span, [x, y]) => {}
                    PoissonVerdict::LeftOut => {}
                    PoissonVerdict::Kept => kept.push(turn.entry.number),
                    PoissonVerdict::Unknown => unknown = Some(with(unknown, [x.into(), y.into()])),
                }
            }
            let mut all = lock(&self.kept);
            kept.iter().for_each(|number| {
                all.insert(*number as usize);
            });
            drop(all);
            if verdicts.len() > self.discs.max_blocking() {
                return Ok(TileState::TooMany);
            }
            if is_last {
                return Ok(unknown.map_or(TileState::All, TileState::But));
            }
            after = waiting.last().copied();
        }
    }

    /// A span with a margin of `halo` distances, and the part of it where all points within one distance are
    /// known.
    fn around(&self, [low, high]: Span, halo: i64) -> (Span, Span) {
        let (reach, ends) = (self.discs.apart.steps(), self.bounds);
        let mut extended = [low, high];
        let mut sure = [[i64::MIN; 2], [i64::MAX; 2]];
        for axis in 0..2 {
            let wide = reach[axis].saturating_mul(halo);
            extended[0][axis] = low[axis].saturating_sub(wide).max(ends[0][axis]);
            extended[1][axis] = high[axis].saturating_add(wide).min(ends[1][axis]);
            if extended[0][axis] > ends[0][axis] {
                sure[0][axis] = extended[0][axis] + reach[axis];
            }
            if extended[1][axis] < ends[1][axis] {
                sure[1][axis] = extended[1][axis] - reach[axis];
            }
        }
        (extended, sure)
    }

    /// The next points in and around a span, in order, with verdicts that are not settled yet. True if there
    /// are no more.
    fn next(
        &self,
        [span, extended]: [&Span; 2],
        after: Option<RankedCandidate>,
        verdicts: &PoissonVerdicts<'_>,
        waiting: &mut Vec<RankedCandidate>,
    ) -> Result<bool> {
        let max_waiting = self.discs.max_waiting();
        let mut until: Option<RankedCandidate> = None;
        waiting.clear();
        self.each(extended, &mut |entry| {
            let turn = RankedCandidate::of(entry);
            let is_next =
                after.is_none_or(|after| after < turn) && until.is_none_or(|until| turn < until);
            if !is_next || after.is_some() && turn.is_decided(span, verdicts) {
                return;
            }
            waiting.push(turn);
            // Cut to half when full: the selection costs each point the same, however many there are.
            if waiting.len() == 2 * max_waiting {
                until = Some(*waiting.select_nth_unstable(max_waiting - 1).1);
                waiting.truncate(max_waiting);
            }
        })?;
        waiting.sort_unstable();
        Ok(until.is_none())
    }

    /// Reads the points of a span.
    fn each(&self, extended: &Span, take: &mut dyn FnMut(PoissonCandidate)) -> Result<()> {
        // Within the bounds, whose ends are i32.
        let [low, high] = extended.map(|end| end.map(|at| at as i32));
        let mut some = vec![PoissonCandidate::zeroed(); TOGETHER];
        for square in self.tiling.touching(SiteWindow { low, high }) {
            let mut first = 0;
            while first < self.entries.len(square) {
                let read = self.entries.read_from(square, first, &mut some)?;
                first += read as u64;
                for entry in &some[..read] {
                    if contains(extended, [entry.place[0], entry.place[1]]) {
                        take(*entry);
                    }
                }
            }
        }
        Ok(())
    }
}

/// Extends a span by a position.
fn with(span: Option<Span>, place: [i64; 2]) -> Span {
    let [low, high] = span.unwrap_or([place; 2]);
    [0, 1].map(|end| {
        [0, 1].map(|axis| match end {
            0 => low[axis].min(place[axis]),
            _ => high[axis].max(place[axis]),
        })
    })
}
