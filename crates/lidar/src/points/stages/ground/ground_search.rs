//! The ground of a point cloud, and the heights and classes derived from it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::{Pod, Zeroable};

use super::queries::{Classify, HeightQuery, HeightsAs, is_known_noise, is_there};
use crate::grid::surface_model::{
    CloudOverview, GroundFilter, GroundSearchMemory, MetricFrame, NOISE, found_by, no_ground,
    no_ground_of_class,
};
use crate::grid::{CloudSurfaces, GROUND, GroundFrom, more_is_needed, tiling};
use crate::point_index::PointStore;
use crate::points::stages::StageOutput;
use crate::points::tile_subset::TileSubset;
use crate::records::numbered::{self, RecordNumbers};
use crate::records::selection::place;
use crate::records::values::RecordValues;
use crate::records::{PointRecords, RecordFlow, total};
use terrane_base::attribute::Return;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::{CloudInfo, PointFormat};
use terrane_engine::plan::RunControl;
use terrane_engine::workers;
use terrane_files::{Buckets, lock};

/// Positions processed together.
const TOGETHER: usize = 1 << 15;
/// Stores of points: positions, last and other returns, and ground.
pub(super) const STORES: u64 = 4;
/// Strips of a tile that are processed in turn.
const STRIPS: i32 = 32;
/// Marks the lack of a height.
const NO_HEIGHT: i32 = i32::MIN;
/// Offset of z in a record.
const Z: usize = 8;
/// Classes of points that were never classified, and that are unclassified.
const NO_CLASS: [u8; 2] = [0, 1];

/// Context of the search for the ground.
pub(super) struct GroundHeightSearch<'a> {
    pub(super) above: &'a HeightQuery,
    /// Frame and bounds of the points.
    pub(super) info: &'a CloudInfo,
    /// Offset of records in steps.
    pub(super) shift: [i32; 3],
    pub(super) format: PointFormat,
    pub(super) flow: RecordFlow,
    pub(super) threads: usize,
    /// Bytes for points and tiles.
    pub(super) memory: GroundSearchMemory,
    pub(super) folder: &'a Path,
    /// Whether points marked as withheld may be ground.
    pub(super) keeps_withheld: bool,
    /// The tiles to make, if not all.
    pub(super) subset: Option<&'a TileSubset<'a>>,
    pub(super) at: RunControl<'a>,
}

/// Candidate ground points: of any class that may change, without noise.
struct GroundCandidates {
    last: PointStore,
    others: PointStore,
    /// Whether any point is a later return than the first; otherwise return numbers are not reliable.
    is_numbered: AtomicBool,
}

impl GroundCandidates {
    /// The candidates of the method.
    fn stores(&self, all_returns: bool) -> Vec<&PointStore> {
        if all_returns { vec![&self.last, &self.others] } else { vec![&self.last] }
    }

    fn count(&self) -> u64 {
        self.last.count() + self.others.count()
    }
}

/// Consumer of points for the ground.
enum GroundGathering<'a> {
    Nowhere,
    /// Points of the ground class.
    Class(PointStoreInput<'a>),
    /// Last returns and other candidates, and whether return numbers are reliable.
    Candidates([PointStoreInput<'a>; 2], &'a AtomicBool),
}

/// Points on their way into a store.
struct PointStoreInput<'a> {
    store: &'a PointStore,
    points: Vec<Point>,
}

impl<'a> PointStoreInput<'a> {
    fn new(store: &'a PointStore) -> Self {
        Self { store, points: Vec::new() }
    }

    fn push(&mut self, point: Point) -> Result<()> {
        self.points.push(point);
        if self.points.len() == TOGETHER { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        self.store.add(&self.points)?;
        self.points.clear();
        Ok(())
    }
}

impl<'a> GroundGathering<'a> {
    fn of_class(store: &'a PointStore) -> Self {
        Self::Class(PointStoreInput::new(store))
    }

    fn of_candidates(into: &'a GroundCandidates) -> Self {
        Self::Candidates([&into.last, &into.others].map(PointStoreInput::new), &into.is_numbered)
    }

    fn take(&mut self, search: &GroundHeightSearch<'_>, record: &[u8], point: Point) -> Result<()> {
        match self {
            Self::Class(run) => {
                let is_ground = search.format.class(record) == GROUND && search.is_there(record);
                if is_ground { run.push(point) } else { Ok(()) }
            }
            Self::Candidates([last, others], is_numbered) if search.may_be_ground(record) => {
                let [number, returns] = search.format.returns(record);
                is_numbered.fetch_or(number > 1, Ordering::Relaxed);
                let is_last = Return::Last.is(number, returns);
                if is_last { last.push(point) } else { others.push(point) }
            }
            Self::Nowhere | Self::Candidates(..) => Ok(()),
        }
    }

    fn finish(self) -> Result<()> {
        match self {
            Self::Nowhere => Ok(()),
            Self::Class(mut run) => run.flush(),
            Self::Candidates(mut runs, _) => runs.iter_mut().try_for_each(PointStoreInput::flush),
        }
    }
}

/// A point to classify or measure.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct GroundQueryPoint {
    place: [i32; 3],
    class: u8,
    may_be_ground: u8,
    spare: [u8; 2],
    /// Number of the record.
    number: u64,
}

/// Counts of classified points.
#[derive(Clone, Default)]
struct GroundClassCounts {
    /// Ground points, by their previous class.
    ground: BTreeMap<u8, u64>,
    no_longer: u64,
    /// Points that were not candidates because of their class, by class.
    kept: BTreeMap<u8, u64>,
    layered: u64,
    without: u64,
}

impl GroundClassCounts {
    fn add(&mut self, other: &Self) {
        for (sums, more) in [(&mut self.ground, &other.ground), (&mut self.kept, &other.kept)] {
            more.iter().for_each(|(class, count)| *sums.entry(*class).or_default() += count);
        }
        self.no_longer += other.no_longer;
        self.layered += other.layered;
        self.without += other.without;
    }
}

/// The ground, and the positions of all points.
struct GroundSearchResult {
    /// `None` if only ground classes are needed, or there is no ground.
    surface: Option<CloudSurfaces>,
    entries: Buckets<GroundQueryPoint>,
    numbers: RecordNumbers,
    notes: Vec<String>,
}

impl GroundHeightSearch<'_> {
    /// The records with heights and classes. `ground_records` has the points of the ground if these are not
    /// the records themselves; a record has its height at byte `heights_at`.
    ///
    /// # Errors
    /// No ground; coordinates without a unit of length, for a ground method.
    pub(super) fn annotate<'r>(
        &self,
        records: &'r dyn PointRecords,
        ground_records: Option<&dyn PointRecords>,
        heights_at: Option<usize>,
    ) -> Result<StageOutput<'r>> {
        let GroundSearchResult { surface, entries, numbers, mut notes } =
            self.find(records, ground_records)?;
        let values = RecordValues::new(numbers.total, self.folder);
        let counts = match surface {
            Some(surface) => {
                let counts = self.annotate_tiles(&surface, &entries, &values);
                if surface.store().is_exceeded() {
                    self.subset.into_iter().for_each(TileSubset::exceed);
                    return Err(more_is_needed());
                }
                counts?
            }
            None => return Err(no_ground()),
        };
        notes.extend(self.notes_on_classes(&counts));
        let is_z = self.above.heights == Some(HeightsAs::Z);
        let heights_at = if is_z { Some(Z) } else { heights_at };
        let (format, record) = (self.format, self.flow.record);
        let set = move |record: &mut [u8], [_, class, steps]: [u32; 3]| {
            if is_z && steps == NO_HEIGHT as u32 {
                return false;
            }
            format.set_class(record, class as u8);
            if let Some(at) = heights_at {
                record[at..at + size_of::<i32>()].copy_from_slice(&steps.to_le_bytes());
            }
            true
        };
        Ok(StageOutput { records: Box::new(values.records(records, record, numbers, set)), notes })
    }

    /// Statistics of the ground of all points, for work on a subset of tiles.
    ///
    /// # Errors
    /// As [`annotate`](Self::annotate).
    pub(super) fn scan(&self, records: &dyn PointRecords) -> Result<CloudOverview> {
        let mut seen = CloudOverview::default();
        if self.above.takes_classes() {
            let ground = self.store().outline();
            self.pass(records, None, GroundGathering::of_class(&ground))?;
            seen.add_classes(&ground, &[GROUND])?;
            if !seen.by_class && self.above.from == GroundFrom::Class {
                return Err(not_of_class());
            }
        }
        if !seen.by_class {
            let all = self.candidates(|| self.store().outline());
            self.pass(records, None, GroundGathering::of_candidates(&all))?;
            seen.all_returns = !all.is_numbered.load(Ordering::Relaxed);
            let stores = all.stores(seen.all_returns);
            if stores.iter().all(|store| store.count() == 0) {
                return Err(self.no_candidates());
            }
            seen.add_candidates(&stores, self.info, self.above.from)?;
        }
        Ok(seen)
    }

    /// Statistics of the ground of the whole point cloud, for work on a subset of tiles.
    fn seen(&self) -> Option<&CloudOverview> {
        self.subset.and_then(|subset| subset.knowledge.seen.as_ref())
    }

    fn find(
        &self,
        records: &dyn PointRecords,
        ground_records: Option<&dyn PointRecords>,
    ) -> Result<GroundSearchResult> {
        let tiling = tiling(self.info);
        let entries = Buckets::new(self.folder, tiling.count(), self.memory.store);
        let by_class = self.seen().map_or(self.above.takes_classes(), |seen| seen.by_class);
        let (class, candidates) = (self.store(), self.candidates(|| self.store()));
        let gathering = match by_class {
            true => GroundGathering::of_class(&class),
            false => GroundGathering::of_candidates(&candidates),
        };
        let numbers = match ground_records {
            None => self.pass(records, Some(&entries), gathering)?,
            Some(ground_records) => {
                self.pass(ground_records, None, gathering)?;
                self.pass(records, Some(&entries), GroundGathering::Nowhere)?
            }
        };
        let mut notes = Vec::new();
        let store = if by_class && (class.count() > 0 || self.subset.is_some()) {
            notes.push(format!("ground: {} points of class {GROUND}", class.count()));
            class
        } else {
            if by_class {
                if self.above.from == GroundFrom::Class {
                    return Err(not_of_class());
                }
                let gathering = GroundGathering::of_candidates(&candidates);
                self.pass(ground_records.unwrap_or(records), None, gathering)?;
            }
            if candidates.count() == 0 && self.subset.is_none() {
                return Err(self.no_candidates());
            }
            self.filtered(&candidates, &mut notes)?
        };
        let store = self.limited(store)?;
        let is_there = store.count() > 0 || self.subset.is_some();
        let surface = is_there.then(|| CloudSurfaces::new(store, self.info.frame));
        Ok(GroundSearchResult { surface: surface.transpose()?, entries, numbers, notes })
    }

    /// The ground of a subset of tiles, with the hull of the whole ground, if known.
    fn limited(&self, store: PointStore) -> Result<PointStore> {
        let Some((subset, seen)) = self.subset.zip(self.seen()) else { return Ok(store) };
        let around = seen.around_ground();
        store.add(&around)?;
        Ok(store.limited(Some(subset.limits(!around.is_empty()))))
    }

    fn store(&self) -> PointStore {
        PointStore::empty(tiling(self.info), self.folder, self.memory.store)
    }

    /// Stores for points that may be ground.
    fn candidates(&self, store: impl Fn() -> PointStore) -> GroundCandidates {
        GroundCandidates { last: store(), others: store(), is_numbered: AtomicBool::new(false) }
    }

    /// The error of a point cloud without candidates.
    fn no_candidates(&self) -> Error {
        match self.above.reclassify() {
            None => no_ground(),
            Some(_) => Error::bad_input(
                "the point cloud has no points that ‹classify› ground may reclassify",
            )
            .remedy(
                "pass the classes that may become ground: ‹classify› ground:reclassify=CLASS,...",
            ),
        }
    }

    /// The ground found by the method among the last returns, with all candidates on its surface.
    fn filtered(
        &self,
        candidates: &GroundCandidates,
        notes: &mut Vec<String>,
    ) -> Result<PointStore> {
        let metres = MetricFrame::of(&self.info.crs, &self.info.frame)?;
        if metres.is_guess {
            notes.push(MetricFrame::GUESS.to_owned());
        }
        let (ground, tiles) = (self.store(), self.memory.tiles);
        let method = self.above.from.method();
        let all_returns = self
            .seen()
            .map_or(!candidates.is_numbered.load(Ordering::Relaxed), |seen| seen.all_returns);
        let stores = candidates.stores(all_returns);
        let filter = match self.subset.zip(self.seen()) {
            None => GroundFilter::new(stores, &metres, method, tiles, self.threads),
            Some((subset, seen)) => {
                let (window, spacing) = (subset.ground(), seen.last);
                GroundFilter::within(window, spacing, stores, &metres, method, tiles, self.threads)
            }
        };
        let filter = filter.and(&candidates.others);
        filter.run(&ground, self.at.progress, self.at.cancel)?;
        notes.push(found_by(&method, ground.count(), candidates.count(), "points"));
        Ok(ground)
    }

    /// Reads all records: their positions, and the ground candidates.
    fn pass(
        &self,
        records: &dyn PointRecords,
        entries: Option<&Buckets<GroundQueryPoint>>,
        mut ground: GroundGathering<'_>,
    ) -> Result<RecordNumbers> {
        let tiling = tiling(self.info);
        self.at.progress.begin("ground", total(records));
        let mut entries = entries.map(Buckets::writer);
        let numbers = numbered::pass(records, self.flow, self.at, &mut |number, record| {
            let point = self.place(record);
            if let Some(entries) = &mut entries {
                let place = [point.x, point.y, point.z];
                let may_be_ground = self.may_be_ground(record).into();
                let class = self.format.class(record);
                let entry = GroundQueryPoint { place, class, may_be_ground, spare: [0; 2], number };
                entries.push(tiling.square_of(point), entry)?;
            }
            ground.take(self, record, point)
        })?;
        entries.map_or(Ok(()), |entries| entries.finish())?;
        ground.finish()?;
        self.at.progress.end();
        Ok(numbers)
    }

    fn place(&self, record: &[u8]) -> Point {
        let (Point { x, y, z }, by) = (place(record), self.shift);
        Point { x: x.wrapping_sub(by[0]), y: y.wrapping_sub(by[1]), z: z.wrapping_sub(by[2]) }
    }

    /// Whether a point of any return may be ground.
    fn may_be_ground(&self, record: &[u8]) -> bool {
        self.above.may_be_ground(self.format.class(record))
            && !is_known_noise(self.format, record)
            && self.is_there(record)
    }

    fn is_there(&self, record: &[u8]) -> bool {
        is_there(self.format, self.keeps_withheld, record)
    }

    /// Stores the values of each point by its number.
    fn annotate_tiles(
        &self,
        ground: &CloudSurfaces,
        entries: &Buckets<GroundQueryPoint>,
        values: &RecordValues<3>,
    ) -> Result<GroundClassCounts> {
        let squares = tiling(self.info).count() as u64;
        self.at.progress.begin("heights", squares);
        let all = Mutex::new(GroundClassCounts::default());
        workers::run(
            self.threads,
            squares,
            self.at.cancel,
            GroundClassCounts::default,
            |counts, square| {
                self.annotate_tile(square as usize, ground, entries, values, counts)?;
                self.at.progress.advance(1);
                Ok(())
            },
            |counts| {
                lock(&all).add(&counts);
                Ok(())
            },
        )?;
        self.at.progress.end();
        Ok(std::mem::take(&mut *lock(&all)))
    }

    fn annotate_tile(
        &self,
        square: usize,
        ground: &CloudSurfaces,
        entries: &Buckets<GroundQueryPoint>,
        values: &RecordValues<3>,
        counts: &mut GroundClassCounts,
    ) -> Result<()> {
        if ground.store().is_exceeded() {
            return Err(more_is_needed());
        }
        let (mut known, mut first) = (Vec::new(), 0);
        ground.store().load(square, &mut known)?;
        let mut some = vec![GroundQueryPoint::zeroed(); TOGETHER.min(entries.len(square) as usize)];
        let mut writer = values.writer();
        while first < entries.len(square) {
            let read = entries.read_from(square, first, &mut some)?;
            first += read as u64;
            let heights = self.heights(ground, &known, &some[..read])?;
            for (entry, height) in some[..read].iter().zip(heights) {
                let class = self.class(entry, &known, height, counts);
                let height = height.map_or(NO_HEIGHT, |height| height.round() as i32);
                counts.without += u64::from(height == NO_HEIGHT);
                writer.put(entry.number, [0, class.into(), height as u32])?;
            }
        }
        entries.forget(square);
        writer.finish()
    }

    /// Heights above ground, in steps; `None` outside of it.
    fn heights(
        &self,
        ground: &CloudSurfaces,
        known: &[Point],
        entries: &[GroundQueryPoint],
    ) -> Result<Vec<Option<f64>>> {
        let mut heights = vec![None; entries.len()];
        if self.above.heights.is_none() && self.above.layers().is_none() {
            return Ok(heights);
        }
        let mut between = Vec::new();
        for (i, point) in entries.iter().map(GroundQueryPoint::point).enumerate() {
            match lowest_at(known, point) {
                Some(ground) => heights[i] = Some(f64::from(point.z) - f64::from(ground.z)),
                None => between.push((point, i)),
            }
        }
        // In strips: the triangle of one is often that of the next.
        let strip = (tiling(self.info).side() / STRIPS).max(1);
        between.sort_unstable_by_key(|(point, i)| (point.x.div_euclid(strip), point.y, *i));
        let (points, numbers): (Vec<Point>, Vec<usize>) = between.into_iter().unzip();
        let mut numbers = numbers.into_iter();
        ground.under(&points, |point, ground| {
            if let Some(i) = numbers.next() {
                heights[i] = ground.map(|ground| f64::from(point.z) - ground);
            }
        })?;
        Ok(heights)
    }

    /// The class of a point, given the ground points of its tile.
    fn class(
        &self,
        entry: &GroundQueryPoint,
        known: &[Point],
        height: Option<f64>,
        counts: &mut GroundClassCounts,
    ) -> u8 {
        let mut class = entry.class;
        for step in &self.above.classify {
            class = match step {
                Classify::Ground(classes) => {
                    let is_ground =
                        entry.may_be_ground > 0 && known.binary_search(&entry.point()).is_ok();
                    if is_ground {
                        *counts.ground.entry(class).or_default() += 1;
                    } else if !classes.may_change(class) && !NOISE.contains(&class) {
                        *counts.kept.entry(class).or_default() += 1;
                    }
                    counts.no_longer += u64::from(!is_ground && class == GROUND);
                    match (is_ground, class) {
                        (true, _) => GROUND,
                        (false, GROUND) => NO_CLASS[1],
                        (false, class) => class,
                    }
                }
                Classify::Height(layers) if NO_CLASS.contains(&class) => {
                    let units = height.map(|steps| steps * self.info.frame.scale[2]);
                    let by_height = units.and_then(|units| layers.at(units));
                    counts.layered += u64::from(by_height.is_some());
                    by_height.unwrap_or(class)
                }
                Classify::Height(_) | Classify::Noise(_) => class,
            };
        }
        class
    }

    /// Notes on the points, one line each.
    fn notes_on_classes(&self, counts: &GroundClassCounts) -> Vec<String> {
        let mut notes = Vec::new();
        if self.above.finds_ground() {
            let GroundClassCounts { ground, no_longer, kept, .. } = counts;
            let (all, of) = (ground.values().sum::<u64>(), by_class(ground));
            notes.push(format!("classes: {all} ground points{of}, {no_longer} no longer ground"));
            if !kept.is_empty() {
                let all = kept.values().sum::<u64>();
                let of = by_class(kept);
                let more = "pass ‹classify› ground:reclassify=CLASS,... to change them";
                notes.push(format!(
                    "classes: {all} points on the ground keep their class{of}; {more}"
                ));
            }
        }
        if self.above.layers().is_some() {
            notes.push(format!("classes: {} points classified by height", counts.layered));
        }
        let has_heights = self.above.heights.is_some() || self.above.layers().is_some();
        if has_heights && counts.without > 0 {
            let without = counts.without;
            let then = match self.above.heights {
                Some(HeightsAs::Z) => "are dropped",
                _ => "lack a height above ground",
            };
            notes.push(format!("{without} points outside the ground triangulation {then}"));
        }
        notes
    }
}

/// The number of points of each class: " (3 of class 1, 5 of class 2)".
fn by_class(counts: &BTreeMap<u8, u64>) -> String {
    let all: Vec<_> =
        counts.iter().map(|(class, count)| format!("{count} of class {class}")).collect();
    if all.is_empty() { String::new() } else { format!(" ({})", all.join(", ")) }
}

/// The lowest of sorted points at the position of one.
fn lowest_at(known: &[Point], Point { x, y, .. }: Point) -> Option<Point> {
    let first = known.partition_point(|other| (other.x, other.y) < (x, y));
    known.get(first).copied().filter(|other| (other.x, other.y) == (x, y))
}

impl GroundQueryPoint {
    fn point(&self) -> Point {
        let [x, y, z] = self.place;
        Point { x, y, z }
    }
}

fn not_of_class() -> Error {
    no_ground_of_class(&GROUND.to_string())
        .remedy("pass ‹ground› pmf, or classify the point cloud first")
}
