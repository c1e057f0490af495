//! Models of the terrain from what kinds of points there are: the ground, by class or found by a
//! method; the surface of first returns without pits; and how high it is above the ground.
//!
//! They are put into stores of their own: ground by class, or the candidates that a method picks
//! from, tile by tile with its reach as a halo; first returns, and those high above the ground again in a
//! store for each threshold. A triangle that counts in a higher store has short edges, so it is a
//! triangle of the points near by, too: those that are long there are dropped without asking how far
//! their discs reach. A surface that is spike-free instead is made of all returns, and defined on squares.

pub(crate) mod filter;
pub(crate) mod metres;
mod pit_free;
mod seen;
mod spike_free;
mod squares;
mod top;

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::GridJob;
use super::extent::{Extent, Piece};
use super::near::Near;
use super::neighbours::Surfaces;
use crate::points::{Filling, Limits, PointStore, Tiling};
pub(crate) use filter::{Filter, around, square_bytes};
pub(crate) use metres::Metres;
use pit_free::Layers;
pub(crate) use seen::Seen;
use spike_free::BySquare;
use squares::{Squares, Tally};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point;
use terrane_cloud::{
    self as cloud, Census, CloudInfo, Filter as Wanted, OpenOptions, PointSource, Return,
};
use terrane_delaunay::Window;
use terrane_engine::memory::short;
use terrane_engine::sift::Losses;
use terrane_engine::{Cancel, Progress};
use terrane_gridding::canopy::Way;
use terrane_gridding::{Asked, Statistic, Subject};
use terrane_ground as ground;
use top::Top;

/// A model of the terrain that is made of the points it takes, instead of a statistic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Preset {
    /// The ground: its points, linear in their Delaunay triangulation.
    Dtm,
    /// What is seen from above, linear in triangulations, without the pits of crowns ([`GridJob::canopy`]).
    Dsm,
    /// The height of the second above the first, nowhere below 0.
    Chm,
}

impl Preset {
    /// The band that holds it.
    pub fn band(self) -> Asked {
        let label = match self {
            Self::Dtm => "dtm",
            Self::Dsm => "dsm",
            Self::Chm => "chm",
        };
        let statistic = Statistic::linear(None);
        Asked { statistic, label: label.to_owned(), subject: Subject::default() }
    }
}

/// Which points are ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum GroundFrom {
    /// Those of the classes, or found by the best method where there is none of them.
    #[default]
    Auto,
    /// Those of the classes.
    Class,
    /// Those that a method finds among last returns that are no noise.
    Method(ground::Asked),
}

impl GroundFrom {
    /// By the morphological filter.
    pub const FILTER: Self = Self::Method(ground::Asked::FILTER);

    /// True when a method is named, so that classes are not asked for.
    pub(crate) fn is_method(self) -> bool {
        matches!(self, Self::Method(_))
    }

    /// The method that finds it where classes do not tell.
    pub(crate) fn method(self) -> ground::Asked {
        match self {
            Self::Method(asked) => asked,
            Self::Auto | Self::Class => ground::Asked::BEST,
        }
    }
}

impl FromStr for GroundFrom {
    type Err = Error;

    /// "auto", "class", or a method with its parameters.
    fn from_str(text: &str) -> Result<Self> {
        match text.to_ascii_lowercase().as_str() {
            "auto" => Ok(Self::Auto),
            "class" => Ok(Self::Class),
            _ => ground::Asked::parse(text).map(Self::Method),
        }
    }
}

impl fmt::Display for GroundFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Class => f.write_str("class"),
            Self::Method(asked) => asked.fmt(f),
        }
    }
}

impl From<GroundFrom> for String {
    fn from(from: GroundFrom) -> Self {
        from.to_string()
    }
}

impl TryFrom<String> for GroundFrom {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

/// A line that tells what a method found, and among how many of which points.
pub(crate) fn found_by(method: &ground::Asked, found: u64, all: u64, points: &str) -> String {
    let by = match method.name() {
        "filter" => "the ground filter".to_owned(),
        name => format!("the method {name}"),
    };
    format!("ground: {found} of {all} {points}, found by {by}")
}

/// The class of ground points, unless others are named.
pub(crate) const GROUND: u8 = 2;
/// Classes of noise, below the ground and in the air.
pub(crate) const NOISE: [u8; 2] = [7, 18];
/// Stores that are in memory at once.
const STORES: u64 = 3;
/// Part of the memory that each thread's tile of the ground filter may take.
const TILE_SHARE: u64 = 8;

/// Fails when a preset cannot be made as asked for, whatever the points.
pub(super) fn check(preset: Preset, job: &GridJob) -> Result<()> {
    let wanted = &job.cloud.filter;
    if job.stats != [preset.band()] {
        let message = "a preset is one band, beside which there is no statistic";
        return Err(Error::usage(message).remedy("leave out ‹stat› or the preset"));
    }
    if wanted.returns.is_some() {
        let message = "‹return› cannot act: a preset takes the returns that it is made of";
        return Err(Error::usage(message).remedy("leave ‹return› out"));
    }
    if wanted.classes.is_some() && job.ground.is_method() {
        let message = "‹class› cannot act: it names the classes of ground, which a method of \
            ‹ground› does not ask for";
        return Err(Error::usage(message).remedy("leave ‹class› out, or pass ‹ground› class"));
    }
    check_canopy(preset, job)
}

/// Fails where what is said of the surface, or of a ground that it does not stand on, cannot act.
fn check_canopy(preset: Preset, job: &GridJob) -> Result<()> {
    if preset == Preset::Dtm && !job.canopy.is_usual() {
        return Err(Error::usage("‹canopy› cannot act: it is for ‹dsm› and ‹chm›")
            .remedy("leave ‹canopy› out"));
    }
    let idle = [
        ("‹ground›", job.ground != GroundFrom::Auto),
        ("‹class›", job.cloud.filter.classes.is_some()),
    ];
    match idle.into_iter().find(|(_, given)| *given && !needs_ground(preset, job)) {
        Some((option, _)) => {
            let name = job.canopy.name();
            let message = format!("{option} cannot act: a {name} ‹dsm› knows of no ground");
            Err(Error::usage(message).remedy(format!("leave {option} out")))
        }
        None => Ok(()),
    }
}

/// Whether the ground has to be known.
pub(super) fn needs_ground(preset: Preset, job: &GridJob) -> bool {
    preset != Preset::Dsm || job.canopy.way() == Way::PitFree
}

/// What a preset is made with.
pub(super) struct Making<'a> {
    pub(super) job: &'a GridJob,
    /// The cells.
    pub(super) extent: &'a Extent,
    /// How the cloud is read, but for classes and returns.
    pub(super) reading: OpenOptions,
    pub(super) threads: usize,
    /// Bytes for points, in all stores together.
    pub(super) memory: u64,
    /// The cloud: of its parts only the bounds are asked.
    pub(super) points: &'a dyn PointSource,
    /// Which part of the cloud is read, if not all of it, and what was seen of all.
    pub(super) part: Option<(Near, &'a Seen)>,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

/// A preset whose points are all in.
pub(super) struct Model {
    preset: Preset,
    ground: Option<Surfaces>,
    top: Option<Box<dyn Top>>,
    /// What became of the points of its surface.
    pub(super) census: Census,
    /// Files whose damage was passed over.
    pub(super) losses: Losses,
    /// Which points it is made of, one line each.
    pub(super) notes: Vec<String>,
    spilled: u64,
}

impl Model {
    /// Reads what the preset needs of the cloud.
    pub(super) fn new(preset: Preset, cloud: &CloudInfo, making: &Making<'_>) -> Result<Self> {
        let empty = Self {
            preset,
            ground: None,
            top: None,
            census: Census::default(),
            losses: Losses::default(),
            notes: Vec::new(),
            spilled: 0,
        };
        let mut model = match needs_ground(preset, making.job) {
            true => empty.with_ground(cloud, making)?,
            false => empty,
        };
        if preset != Preset::Dsm && model.ground.is_none() {
            return Err(no_ground());
        }
        if preset != Preset::Dtm {
            match making.job.canopy.way() {
                Way::PitFree => model.add_layers(cloud, making)?,
                Way::SpikeFree { freeze, buffer } => {
                    model.add_squares(cloud, (freeze, buffer), making)?;
                }
            }
        }
        Ok(model)
    }

    /// Finds the ground, if there is any.
    fn with_ground(mut self, cloud: &CloudInfo, making: &Making<'_>) -> Result<Self> {
        let is_seen = |(_, seen): &(Near, &Seen)| seen.by_class;
        if making.job.ground.is_method() || !making.part.as_ref().is_none_or(is_seen) {
            return self.filter_ground(cloud, making);
        }
        let (classes, window) = (making.classes(), making.ground_window());
        let store = making.read(classes.clone(), None, window)?;
        let count = store.count();
        self.take_note(&store);
        if count > 0 || window.is_some() {
            self.notes.push(found_in_classes(count, &classes));
            let around = making.part.map(|(_, seen)| seen.around_ground()).unwrap_or_default();
            let store = making.limited(store, window, &around)?;
            self.ground = Some(Surfaces::new(store, cloud.frame)?);
            return Ok(self);
        }
        if making.job.ground == GroundFrom::Class {
            return Err(not_of_class(&named(&classes)));
        }
        self.filter_ground(cloud, making)
    }

    fn filter_ground(mut self, cloud: &CloudInfo, making: &Making<'_>) -> Result<Self> {
        let metres = self.metres(cloud)?;
        let method = making.job.ground.method();
        let part = making.ground_window().zip(making.part.map(|(_, seen)| seen.last));
        let wide = part.map(|(window, spacing)| around(&method, &metres, spacing, window));
        let mut candidates = making.read(no_noise(), Some(Return::Last), wide)?;
        let all_returns = making.all_returns(&candidates)?;
        if all_returns {
            candidates = making.read(no_noise(), None, wide)?;
        }
        self.take_note(&candidates);
        let square = square_bytes(&method, metres.extent(cloud.bounds));
        // The store of the surface is filled later.
        let room = making.store_memory();
        if square > room {
            let what = format!("finding the ground by {}", method.name());
            let memory = making.job.resources.memory;
            return Err(too_little(&what, least_for(square), memory, "‹ground› filter"));
        }
        let share = if square > 0 { room } else { making.memory / TILE_SHARE };
        let tile = share / making.threads as u64;
        let store = making.store(candidates.tiling());
        let filter = match part {
            None => Filter::new(vec![&candidates], &metres, method, tile),
            Some((window, spacing)) => {
                Filter::within(window, spacing, vec![&candidates], &metres, method, tile)
            }
        };
        filter.run(&store, making.threads, making.progress, making.cancel)?;
        let (found, all) = (store.count(), candidates.count());
        let points = if all_returns { "points" } else { "last returns" };
        self.notes.push(found_by(&method, found, all, points));
        self.spilled += candidates.spilled();
        if found > 0 || part.is_some() {
            let store = making.limited(store, making.ground_window(), &[])?;
            self.ground = Some(Surfaces::new(store, cloud.frame)?);
        }
        Ok(self)
    }

    fn add_layers(&mut self, cloud: &CloudInfo, making: &Making<'_>) -> Result<()> {
        let metres = self.metres(cloud)?;
        let window = making.surface_window();
        let first = making.read(no_noise(), Some(Return::First), window)?;
        self.take_note(&first);
        self.notes.push(format!("surface: {} first returns", first.count()));
        let around = making.part.map(|(_, seen)| seen.around_surface()).unwrap_or_default();
        let first = making.limited(first, window, &around)?;
        if self.ground.is_none() {
            let note = "no ground is known: the surface is that of all first returns, pits and all";
            self.notes.push(note.to_owned());
        }
        let ground = self.ground.as_ref();
        let layers = Layers::new(first, ground, (&metres, cloud.frame), making)?;
        self.top = Some(Box::new(layers));
        Ok(())
    }

    fn add_squares(
        &mut self,
        cloud: &CloudInfo,
        freeze: (Option<f64>, f64),
        making: &Making<'_>,
    ) -> Result<()> {
        let metres = self.metres(cloud)?;
        let spacing = making.pulses(&metres)?;
        let tally = Tally::new(Squares::new(spacing, freeze, &metres));
        let source = making.source(no_noise(), None)?;
        let window = making.surface_window();
        let filling = Filling { within: window, ..making.filling() };
        let store = making.store(&super::neighbours::tiling(source.info()));
        let take = |batch: &[Point]| {
            tally.take(batch);
            Ok(())
        };
        let all = store.filled_and(&*source, &filling, &take)?;
        self.take_note(&all);
        self.notes.push(frozen(all.count(), &tally.squares));
        let around = making.part.map(|(_, seen)| seen.around_surface()).unwrap_or_default();
        let all = making.limited(all, window, &around)?;
        let top = BySquare::new(all, tally, cloud.frame, making)?;
        self.top = Some(Box::new(top));
        Ok(())
    }

    /// Notes what became of the points that were read last.
    fn take_note(&mut self, read: &PointStore) {
        self.census = *read.census();
        self.losses.add(read.losses());
    }

    /// Steps in metres; a unit that is guessed is noted, once.
    fn metres(&mut self, cloud: &CloudInfo) -> Result<Metres> {
        let metres = Metres::of(&cloud.crs, &cloud.frame)?;
        if metres.is_guess && !self.notes.iter().any(|note| note == Metres::GUESS) {
            self.notes.push(Metres::GUESS.to_owned());
        }
        Ok(metres)
    }

    /// Its values at the centres of cells, NaN where void.
    pub(super) fn values(&self, piece: Piece<'_>, out: &mut [f64]) -> Result<()> {
        if self.is_exceeded() {
            return Err(more_is_needed());
        }
        if let Some(top) = &self.top {
            top.values(piece, out)?;
        }
        let Some(ground) = self.ground.as_ref().filter(|_| self.preset != Preset::Dsm) else {
            return Ok(());
        };
        let linear = Statistic::linear(None);
        if self.preset == Preset::Dtm {
            return ground.values(linear, piece, out);
        }
        let mut below = vec![0.0; out.len()];
        ground.values(linear, piece, &mut below)?;
        for (top, below) in out.iter_mut().zip(below) {
            // Void where either is: a maximum would make that 0.
            *top -= below;
            *top = if *top < 0.0 { 0.0 } else { *top };
        }
        Ok(())
    }

    /// True when points were needed that were not read.
    pub(super) fn is_exceeded(&self) -> bool {
        let ground = self.ground.as_ref().is_some_and(|ground| ground.store().is_exceeded());
        ground || self.top.as_ref().is_some_and(|top| top.is_exceeded())
    }

    /// Bytes that went to temporary files.
    pub(super) fn spilled_bytes(&self) -> u64 {
        let ground = self.ground.as_ref().map_or(0, Surfaces::spilled_bytes);
        self.spilled + ground + self.top.as_ref().map_or(0, |top| top.spilled())
    }
}

/// The error of a cloud without points of the classes of ground.
pub(crate) fn no_ground_of_class(named: &str) -> Error {
    Error::bad_input(format!("the cloud has no points of class {named}"))
}

fn not_of_class(named: &str) -> Error {
    no_ground_of_class(named)
        .remedy("pass ‹ground› auto, or name the classes of ground with ‹class›")
}

/// The error of a cloud without ground.
pub(crate) fn no_ground() -> Error {
    Error::bad_input("no ground is found in the cloud")
        .remedy("check what ‹bounds›, ‹clip› and ‹z_range› leave of it")
}

/// The error of a part of a cloud that was too little.
pub(crate) fn more_is_needed() -> Error {
    Error::new(ErrorKind::Resource, "more of the cloud has to be read")
}

fn found_in_classes(count: u64, classes: &[u8]) -> String {
    format!("ground: {count} points of class {}", named(classes))
}

fn named(classes: &[u8]) -> String {
    classes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ")
}

/// A line that tells which returns a spike-free surface is made of, and what freezes.
fn frozen(count: u64, squares: &Squares) -> String {
    let edge = squares.freeze.edge;
    format!("surface: {count} returns, spike-free with triangles of up to {edge:.2} m")
}

/// Bytes of memory in all that a job needs to find the ground as it is asked to, or for a square of the surface,
/// before anything else; 0 where that is not known before the points are.
pub(super) fn least(job: &GridJob, cloud: &CloudInfo, seen: Option<&Seen>) -> u64 {
    let freezes = job.preset.is_some() && job.canopy.way() != Way::PitFree;
    let usual = if freezes { cloud.count.min(spike_free::USUAL) } else { 0 };
    let surface = spike_free::least(seen.map_or(usual, |seen| seen.square));
    surface.max(least_for_ground(job, cloud, seen))
}

fn least_for_ground(job: &GridJob, cloud: &CloudInfo, seen: Option<&Seen>) -> u64 {
    let is_needed = job.preset.is_some_and(|preset| needs_ground(preset, job));
    let is_found = job.ground.is_method() || seen.is_some_and(|seen| !seen.by_class);
    if !is_needed || !is_found {
        return 0;
    }
    let method = job.ground.method();
    let extent = Metres::of(&cloud.crs, &cloud.frame).map(|metres| metres.extent(cloud.bounds));
    extent.map_or(0, |extent| least_for(square_bytes(&method, extent)))
}

/// Of a square: half of the memory is for points, in three stores.
fn least_for(square: u64) -> u64 {
    2 * STORES * square
}

fn too_little(what: &str, least: u64, memory: u64, other: &str) -> Error {
    let [mib, memory] = [least.div_ceil(1 << 20), memory >> 20];
    let message = format!("{what} takes {mib} MiB of memory, and {memory} are allowed");
    short(message, least).or(other)
}

/// All classes but those of noise.
fn no_noise() -> Vec<u8> {
    (0..=u8::MAX).filter(|class| !NOISE.contains(class)).collect()
}

impl Making<'_> {
    /// The classes of ground.
    fn classes(&self) -> Vec<u8> {
        self.job.cloud.filter.classes.clone().unwrap_or_else(|| vec![GROUND])
    }

    /// What is read of first returns; `None` for all.
    fn surface_window(&self) -> Option<Window> {
        self.part.map(|(near, _)| near.window())
    }

    /// Where the ground is to be known: for layers, under all first returns that are read.
    fn ground_window(&self) -> Option<Window> {
        let is_layered = self.job.canopy.way() == Way::PitFree;
        let is_all = self.job.preset == Some(Preset::Dtm) || !is_layered;
        self.part.map(|(near, _)| if is_all { near.window() } else { near.beyond() })
    }

    /// The points of these classes and returns in a window, or all.
    fn read(
        &self,
        classes: Vec<u8>,
        returns: Option<Return>,
        within: Option<Window>,
    ) -> Result<PointStore> {
        let source = self.source(classes, returns)?;
        let filling = Filling { within, ..self.filling() };
        PointStore::fill(&*source, super::neighbours::tiling(source.info()), &filling)
    }

    /// What is known of squares of all these points, and what surrounds them; they are handed to `also`, too.
    fn outlined(
        &self,
        classes: Vec<u8>,
        returns: Option<Return>,
        also: &(dyn Fn(&[Point]) + Sync),
    ) -> Result<PointStore> {
        let source = self.source(classes, returns)?;
        let store = self.store(&super::neighbours::tiling(source.info())).outline();
        store.filled_and(&*source, &self.filling(), &|batch| {
            also(batch);
            Ok(())
        })
    }

    /// How far pulses are apart in all of the cloud, about, in metres.
    fn pulses(&self, metres: &Metres) -> Result<f64> {
        match self.part {
            Some((_, seen)) => Ok(seen.first),
            None => {
                let first = self.outlined(no_noise(), Some(Return::First), &|_| ())?;
                Ok(filter::spacing(&[&first], metres))
            }
        }
    }

    fn source(&self, classes: Vec<u8>, returns: Option<Return>) -> Result<Box<dyn PointSource>> {
        let filter = Wanted { classes: Some(classes), returns, ..self.reading.filter.clone() };
        cloud::source(&self.job.input, &OpenOptions { filter, ..self.reading.clone() })
    }

    fn filling(&self) -> Filling<'_> {
        Filling {
            threads: self.threads,
            memory: self.store_memory(),
            folder: self.folder(),
            within: None,
            progress: self.progress,
            cancel: self.cancel,
        }
    }

    /// A store that has what lies in a window, with what surrounds all such points, where that is known.
    fn limited(
        &self,
        store: PointStore,
        window: Option<Window>,
        around: &[Point],
    ) -> Result<PointStore> {
        let Some(window) = window else { return Ok(store) };
        store.add(around)?;
        let limits = match around {
            [] => Limits::new(self.points, window),
            _ => Limits::with_hull(self.points, window),
        };
        Ok(store.limited(Some(limits)))
    }

    /// A store without points.
    fn store(&self, tiling: &Tiling) -> PointStore {
        PointStore::empty(*tiling, self.folder(), self.store_memory())
    }

    fn store_memory(&self) -> u64 {
        self.memory / STORES
    }

    fn folder(&self) -> &Path {
        self.job.spill_folder()
    }
}
