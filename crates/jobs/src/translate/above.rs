//! What the ground under points tells of them: their heights above it, and their classes.
//!
//! ```text
//! records ─┬─ ground: by class, or found ── its triangulation ─┐
//!          └─ places, by square ───────────────────────────────┴─ values, by number ── records again, with these
//! ```

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::sync::Mutex;

use bytemuck::{Pod, Zeroable};

use crate::grid::preset::{Filter, Metres, NOISE, found_by, no_ground_of_class};
use crate::grid::{GROUND, GroundFrom, Surfaces, WORKER, tiling};
use crate::plan::At;
use crate::points::PointStore;
use crate::records::choice::place;
use crate::records::{Flow, Records, Take, numbered};
use crate::workers;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Frame, Point};
use terrane_cloud::{CloudInfo, Flags, PointFormat, Return};
use terrane_files::{Buckets, lock};

/// Where the height of a point above the ground goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeightsAs {
    /// Into the dimension `HeightAboveGround` of its extra bytes, in steps of z.
    Dimension,
    /// Into its z; points that have no ground under them are left out.
    Z,
}

/// What gives points their classes.
#[derive(Clone, Debug, PartialEq)]
pub enum Classify {
    /// Those found to be ground are of class 2, and no others are.
    Ground,
    /// Those of no class (0 or 1) are of one by their height above the ground.
    Height(Layers),
}

/// Classes, each from a height above the ground up to that of the next.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers(Vec<(u8, f64)>);

impl Default for Layers {
    /// Low, medium and high vegetation.
    fn default() -> Self {
        Self(vec![(3, 0.5), (4, 2.0), (5, 5.0)])
    }
}

impl FromStr for Layers {
    type Err = String;

    /// "3=0.5,4=2,5=5".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let one = |part: &str| {
            let (class, height) = part.split_once('=').ok_or_else(|| {
                format!("{part:?} is no class and the height that it begins at, such as 3=0.5")
            })?;
            let class =
                class.trim().parse().map_err(|_| format!("{class} is no class, 0 to 255"))?;
            let height = height.trim().parse().ok().filter(|height: &f64| height.is_finite());
            Ok((class, height.ok_or_else(|| format!("{part:?} names no height"))?))
        };
        let layers = text.split(',').map(one).collect::<std::result::Result<Vec<_>, String>>()?;
        match layers.is_sorted_by(|a, b| a.1 < b.1) {
            true => Ok(Self(layers)),
            false => Err("each height has to be above the one before it".to_owned()),
        }
    }
}

impl FromStr for Classify {
    type Err = String;

    /// "ground", "height", "height:3=0.5,4=2,5=5".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.split_once(':') {
            None if text == "ground" => Ok(Self::Ground),
            None if text == "height" => Ok(Self::Height(Layers::default())),
            Some(("height", layers)) => layers.parse().map(Self::Height),
            _ => Err(format!("{text} is none of ground, height, height:CLASS=FROM,...")),
        }
    }
}

impl fmt::Display for Classify {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::Height(Layers(layers)) = self else { return f.write_str("ground") };
        let all: Vec<_> = layers.iter().map(|(class, from)| format!("{class}={from}")).collect();
        write!(f, "height:{}", all.join(","))
    }
}

impl Layers {
    /// The class at a height; `None` below the first.
    fn at(&self, height: f64) -> Option<u8> {
        self.0.iter().rev().find(|(_, from)| height >= *from).map(|(class, _)| *class)
    }
}

/// What is asked of the ground.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Above {
    /// Which points are ground.
    pub from: GroundFrom,
    /// Where heights above it go.
    pub heights: Option<HeightsAs>,
    /// Who gives classes, one after the other.
    pub classify: Vec<Classify>,
}

/// Bytes of values that are held while they are read.
const VALUES: u64 = 16 << 20;
/// Bytes of tables for each square of the plane.
const SQUARE: u64 = 512;
/// Values of a bucket, and the most buckets.
const BUCKET: u64 = 1 << 16;
const MOST_BUCKETS: u64 = 1 << 14;
/// Places that are looked at together.
const TOGETHER: usize = 1 << 15;
/// Part of the memory that each thread's tile of the ground filter may take.
const TILE_SHARE: u64 = 8;
/// Parts that the memory is divided into: places, candidates and ground.
const PARTS: u64 = 3;
/// The class of points that have none yet, and of those that were looked at, too.
const NO_CLASS: [u8; 2] = [0, 1];
const NO_HEIGHT: i32 = i32::MIN;

impl Above {
    /// Whether anything is asked.
    pub(super) fn is_asked(&self) -> bool {
        self.heights.is_some() || !self.classify.is_empty()
    }

    /// Bytes that it needs for so many points, and more for each thread.
    pub(super) fn needed(&self, points: u64) -> [u64; 2] {
        match self.is_asked() {
            true => [2 * VALUES + (points / 4096).clamp(1, 1 << 18) * SQUARE, WORKER],
            false => [0; 2],
        }
    }

    /// Frame, bounds and system of points of this cloud, as they are written.
    pub(super) fn info(&self, info: &CloudInfo) -> CloudInfo {
        if self.heights != Some(HeightsAs::Z) {
            return info.clone();
        }
        let [x, y, _] = info.frame.offset;
        let frame = Frame { offset: [x, y, 0.0], ..info.frame };
        let bounds = info.bounds.map(|[low, high]| {
            // The ground is between the lowest and the highest point; heights are rounded to a step.
            let most = high.z.saturating_sub(low.z).saturating_add(1);
            [Point { z: -most, ..low }, Point { z: most, ..high }]
        });
        CloudInfo { frame, bounds, crs: info.crs.without_heights(), ..info.clone() }
    }

    /// # Errors
    /// What cannot be asked together, or of a format.
    pub(super) fn check(&self, format: PointFormat) -> Result<()> {
        let grounds = self.classify.iter().filter(|one| **one == Classify::Ground).count();
        if grounds > 0 && self.from == GroundFrom::Class {
            return Err(Error::usage(
                "--classify ground cannot act: --ground class takes the classes that there are",
            )
            .remedy("leave one of them out"));
        }
        if !self.is_asked() && self.from != GroundFrom::Auto {
            return Err(Error::usage("--ground cannot act: nothing is asked of the ground")
                .remedy("pass --height-above-ground or --classify, or leave --ground out"));
        }
        if grounds > 1 || self.classify.len() - grounds > 1 {
            return Err(Error::usage("--classify names one way twice").remedy("leave one out"));
        }
        let classes =
            self.layers().into_iter().flat_map(|Layers(all)| all).map(|(class, _)| *class);
        match classes.max().filter(|class| *class > format.most_class()) {
            None => Ok(()),
            Some(class) => {
                let number = format.number();
                Err(Error::usage(format!("point format {number} has no class {class}"))
                    .remedy("pass --point-format 6, or 7 with colours"))
            }
        }
    }

    fn layers(&self) -> Option<&Layers> {
        self.classify.iter().find_map(|one| match one {
            Classify::Height(layers) => Some(layers),
            Classify::Ground => None,
        })
    }

    fn finds_ground(&self) -> bool {
        self.classify.contains(&Classify::Ground)
    }

    /// Whether the ground is that of the classes, if there are points of it.
    fn takes_classes(&self) -> bool {
        !self.from.is_method() && !self.finds_ground()
    }
}

/// Where the ground is looked for, and with what.
pub(super) struct Looking<'a> {
    pub(super) above: &'a Above,
    /// Where records lie.
    pub(super) info: &'a CloudInfo,
    pub(super) format: PointFormat,
    pub(super) flow: Flow,
    pub(super) threads: usize,
    /// Bytes for points.
    pub(super) memory: u64,
    pub(super) folder: &'a Path,
    /// Whether points marked as withheld may be ground.
    pub(super) keeps_withheld: bool,
    pub(super) at: At<'a>,
}

/// Which points are put into a store.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Those of the class of ground.
    Class,
    /// Last returns that are no noise.
    Candidates,
}

/// A point that is to be told of.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Entry {
    place: [i32; 3],
    class: u8,
    is_candidate: u8,
    spare: [u8; 2],
    /// Of the record.
    number: u64,
}

/// What is told of a point.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Value {
    /// Within its bucket.
    number: u32,
    class: u32,
    height: i32,
}

/// What became of points.
#[derive(Clone, Copy, Default)]
struct Counts {
    ground: u64,
    no_longer: u64,
    layered: u64,
    without: u64,
}

impl Counts {
    fn add(&mut self, other: &Self) {
        self.ground += other.ground;
        self.no_longer += other.no_longer;
        self.layered += other.layered;
        self.without += other.without;
    }
}

/// Values by the numbers of records, in buckets of as many.
struct Values {
    buckets: Buckets<Value>,
    /// Numbers of a bucket.
    each: u64,
}

impl Values {
    fn new(points: u64, folder: &Path) -> Self {
        let each = BUCKET.max(points.div_ceil(MOST_BUCKETS));
        let count = points.div_ceil(each).max(1) as usize;
        Self { buckets: Buckets::new(folder, count, VALUES), each }
    }

    /// Those of a bucket, by number.
    fn of(&self, bucket: u64) -> Result<Vec<(i32, u8)>> {
        let mut all = vec![(NO_HEIGHT, 0); self.buckets.len(bucket as usize) as usize];
        self.buckets.read(bucket as usize, |values| {
            for Value { number, class, height } in values {
                all[*number as usize] = (*height, *class as u8);
            }
        })?;
        Ok(all)
    }
}

/// The ground, and the places of all points.
struct Found {
    /// `None` where nothing but classes of ground is asked, or there is none.
    surface: Option<Surfaces>,
    entries: Buckets<Entry>,
    firsts: Vec<u64>,
    count: u64,
    notes: Vec<String>,
}

impl Looking<'_> {
    /// The records with what the ground tells of them. Where they are not all points that the ground is made of,
    /// `wide` are; a record has its height `at` a byte.
    ///
    /// # Errors
    /// No ground; units that are no lengths, where it has to be found.
    pub(super) fn tell<'r>(
        &self,
        records: &'r dyn Records,
        wide: Option<&dyn Records>,
        at: Option<usize>,
    ) -> Result<Told<'r>> {
        let Found { surface, entries, firsts, count, mut notes } = self.find(records, wide)?;
        let values = Values::new(count, self.folder);
        let counts = match surface {
            Some(surface) => self.value(&surface, &entries, &values)?,
            None => return Err(no_ground()),
        };
        notes.extend(self.told(&counts));
        let is_z = self.above.heights == Some(HeightsAs::Z);
        let at = if is_z { Some(Z) } else { at };
        let (format, record) = (self.format, self.flow.record);
        Ok(Told { records, format, record, at, values, firsts, notes })
    }

    fn find(&self, records: &dyn Records, wide: Option<&dyn Records>) -> Result<Found> {
        let tiling = tiling(self.info);
        let entries = Buckets::new(self.folder, tiling.count(), self.memory / PARTS);
        let kind = if self.above.takes_classes() { Kind::Class } else { Kind::Candidates };
        let mut store = self.store();
        let (firsts, count) = match wide {
            None => self.pass(records, Some(&entries), Some((kind, &store)))?,
            Some(wide) => {
                self.pass(wide, None, Some((kind, &store)))?;
                self.pass(records, Some(&entries), None)?
            }
        };
        let mut notes = Vec::new();
        if kind == Kind::Class && store.count() > 0 {
            notes.push(format!("ground: {} points of class {GROUND}", store.count()));
        } else {
            if kind == Kind::Class {
                if self.above.from == GroundFrom::Class {
                    return Err(no_ground_of_class(&GROUND.to_string())
                        .remedy("pass --ground filter, or classify the cloud before"));
                }
                store = self.store();
                self.pass(wide.unwrap_or(records), None, Some((Kind::Candidates, &store)))?;
            }
            store = self.filtered(&store, &mut notes)?;
        }
        let surface = (store.count() > 0).then(|| Surfaces::new(store, self.info.frame));
        Ok(Found { surface: surface.transpose()?, entries, firsts, count, notes })
    }

    fn store(&self) -> PointStore {
        PointStore::empty(tiling(self.info), self.folder, self.memory / PARTS)
    }

    /// What the ground filter finds among the candidates.
    fn filtered(&self, candidates: &PointStore, notes: &mut Vec<String>) -> Result<PointStore> {
        let metres = Metres::of(&self.info.crs, &self.info.frame)?;
        if metres.is_guess {
            notes.push("the cloud names no unit of length; it is taken for metres".to_owned());
        }
        let tile = self.memory / TILE_SHARE / self.threads as u64;
        let ground = self.store();
        let method = self.above.from.method();
        let filter = Filter::new(candidates, &metres, method, tile);
        filter.run(&ground, self.threads, self.at.progress, self.at.cancel)?;
        let (found, all) = (ground.count(), candidates.count());
        notes.push(found_by(&method, found, all));
        Ok(ground)
    }

    /// Looks at all records: at where they are, and which may be ground.
    fn pass(
        &self,
        records: &dyn Records,
        entries: Option<&Buckets<Entry>>,
        ground: Option<(Kind, &PointStore)>,
    ) -> Result<(Vec<u64>, u64)> {
        let tiling = tiling(self.info);
        self.at.progress.begin("ground", super::total(records));
        let mut entries = entries.map(Buckets::writer);
        let mut run = Vec::new();
        let found = numbered::pass(records, self.flow, self.at, &mut |number, record| {
            let (point, is_candidate) = (place(record), self.is_candidate(record));
            let class = self.format.class(record);
            if let Some(entries) = &mut entries {
                let place = [point.x, point.y, point.z];
                let is_candidate = is_candidate.into();
                let entry = Entry { place, class, is_candidate, spare: [0; 2], number };
                entries.push(tiling.square_of(point), entry)?;
            }
            let Some((kind, store)) = ground else { return Ok(()) };
            let is_ground = match kind {
                Kind::Class => class == GROUND && self.is_there(record),
                Kind::Candidates => is_candidate,
            };
            if is_ground {
                run.push(point);
            }
            if run.len() == TOGETHER {
                store.add(&run)?;
                run.clear();
            }
            Ok(())
        })?;
        entries.map_or(Ok(()), |entries| entries.finish())?;
        ground.map_or(Ok(()), |(_, store)| store.add(&run))?;
        self.at.progress.end();
        Ok(found)
    }

    /// Whether a point may be found to be ground.
    fn is_candidate(&self, record: &[u8]) -> bool {
        let [number, returns] = self.format.returns(record);
        Return::Last.is(number, returns)
            && !NOISE.contains(&self.format.class(record))
            && self.is_there(record)
    }

    fn is_there(&self, record: &[u8]) -> bool {
        self.keeps_withheld || !self.format.flags(record).meets(Flags::WITHHELD)
    }

    /// Puts what is told of each point to its number.
    fn value(
        &self,
        ground: &Surfaces,
        entries: &Buckets<Entry>,
        values: &Values,
    ) -> Result<Counts> {
        let squares = tiling(self.info).count() as u64;
        self.at.progress.begin("heights", squares);
        let all = Mutex::new(Counts::default());
        let square = |counts: &mut Counts, square: u64| {
            self.square(square as usize, ground, (entries, values), counts)?;
            self.at.progress.advance(1);
            Ok(())
        };
        let finish = |counts: Counts| {
            lock(&all).add(&counts);
            Ok(())
        };
        workers::run(self.threads, squares, self.at.cancel, Counts::default, square, finish)?;
        self.at.progress.end();
        Ok(*lock(&all))
    }

    fn square(
        &self,
        square: usize,
        ground: &Surfaces,
        (entries, values): (&Buckets<Entry>, &Values),
        counts: &mut Counts,
    ) -> Result<()> {
        let (mut known, mut first) = (Vec::new(), 0);
        if self.above.finds_ground() {
            ground.store().load(square, &mut known)?;
        }
        let mut some = vec![Entry::zeroed(); TOGETHER.min(entries.len(square) as usize)];
        let mut put = values.buckets.writer();
        while first < entries.len(square) {
            let read = entries.read_from(square, first, &mut some)?;
            first += read as u64;
            let heights = self.heights(ground, &some[..read])?;
            for (entry, height) in some[..read].iter().zip(heights) {
                let class = self.class(entry, &known, height, counts);
                let height = height.map_or(NO_HEIGHT, |height| height.round() as i32);
                counts.without += u64::from(height == NO_HEIGHT);
                let (bucket, number) = (entry.number / values.each, entry.number % values.each);
                let number = number as u32;
                put.push(bucket as usize, Value { number, class: class.into(), height })?;
            }
        }
        entries.forget(square);
        put.finish()
    }

    /// How far points are above the ground, in steps; `None` beyond it.
    fn heights(&self, ground: &Surfaces, entries: &[Entry]) -> Result<Vec<Option<f64>>> {
        if self.above.heights.is_none() && self.above.layers().is_none() {
            return Ok(vec![None; entries.len()]);
        }
        let points: Vec<Point> = entries.iter().map(Entry::point).collect();
        let mut heights = Vec::with_capacity(points.len());
        ground.under(&points, |point, ground| {
            heights.push(ground.map(|ground| f64::from(point.z) - ground));
        })?;
        Ok(heights)
    }

    /// The class of a point, whose ground is among the points known of its square.
    fn class(
        &self,
        entry: &Entry,
        known: &[Point],
        height: Option<f64>,
        counts: &mut Counts,
    ) -> u8 {
        let mut class = entry.class;
        for way in &self.above.classify {
            class = match way {
                Classify::Ground => {
                    let is_ground =
                        entry.is_candidate > 0 && known.binary_search(&entry.point()).is_ok();
                    counts.ground += u64::from(is_ground);
                    counts.no_longer += u64::from(!is_ground && class == GROUND);
                    match (is_ground, class) {
                        (true, _) => GROUND,
                        (false, GROUND) => NO_CLASS[1],
                        (false, class) => class,
                    }
                }
                Classify::Height(layers) if NO_CLASS.contains(&class) => {
                    let units = height.map(|steps| steps * self.info.frame.scale[2]);
                    let found = units.and_then(|units| layers.at(units));
                    counts.layered += u64::from(found.is_some());
                    found.unwrap_or(class)
                }
                Classify::Height(_) => class,
            };
        }
        class
    }

    /// What became of points, one line each.
    fn told(&self, counts: &Counts) -> Vec<String> {
        let mut notes = Vec::new();
        if self.above.finds_ground() {
            let Counts { ground, no_longer, .. } = counts;
            notes.push(format!("classes: {ground} points are ground, {no_longer} no longer"));
        }
        if self.above.layers().is_some() {
            notes.push(format!("classes: {} points by their heights", counts.layered));
        }
        let has_heights = self.above.heights.is_some() || self.above.layers().is_some();
        if has_heights && counts.without > 0 {
            let without = counts.without;
            let then = match self.above.heights {
                Some(HeightsAs::Z) => "are left out",
                _ => "have no height above it",
            };
            notes.push(format!("{without} points beyond the triangulation of the ground {then}"));
        }
        notes
    }
}

impl Entry {
    fn point(&self) -> Point {
        let [x, y, z] = self.place;
        Point { x, y, z }
    }
}

fn no_ground() -> Error {
    Error::bad_input("no ground is found in the cloud")
        .remedy("check what --bounds, --polygon and --z-range leave of it")
}

/// Where a record has its z.
const Z: usize = 8;

/// Records with what was told of them.
pub(super) struct Told<'a> {
    records: &'a dyn Records,
    format: PointFormat,
    record: usize,
    /// Where heights go.
    at: Option<usize>,
    values: Values,
    /// Number of the first record of each unit.
    firsts: Vec<u64>,
    pub(super) notes: Vec<String>,
}

impl Records for Told<'_> {
    fn units(&self) -> usize {
        self.records.units()
    }

    fn points(&self, unit: usize) -> u64 {
        self.records.points(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let (mut number, mut told) = (self.firsts[unit], Vec::new());
        let (mut bucket, mut values) = (None, Vec::new());
        self.records.read(unit, &mut |bytes| {
            told.clear();
            for record in bytes.chunks_exact(self.record) {
                if bucket != Some(number / self.values.each) {
                    bucket = Some(number / self.values.each);
                    values = self.values.of(number / self.values.each)?;
                }
                let (height, class) = values[(number % self.values.each) as usize];
                number += 1;
                if self.at == Some(Z) && height == NO_HEIGHT {
                    continue;
                }
                let first = told.len();
                told.extend_from_slice(record);
                let record = &mut told[first..];
                self.format.set_class(record, class);
                if let Some(at) = self.at {
                    record[at..at + size_of::<i32>()].copy_from_slice(&height.to_le_bytes());
                }
            }
            take(&told)
        })
    }
}
