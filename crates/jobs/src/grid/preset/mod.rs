//! Models of the terrain from what kinds of points there are: the ground, by class or found by a
//! method; the surface of first returns without pits; and how high it is above the ground.
//!
//! They are put into stores of their own: ground by class, or the candidates that a method picks
//! from, tile by tile with its reach as a halo; first returns, and those high above the ground again in a
//! store for each threshold. A triangle that counts in a higher store has short edges, so it is a
//! triangle of the points near by, too: those that are long there are dropped without asking how far
//! their discs reach.

mod canopy;
pub(crate) mod filter;
pub(crate) mod metres;

use std::path::Path;

use super::GridJob;
use super::extent::Extent;
use super::neighbours::Surfaces;
use crate::points::{Filling, PointStore, Tiling};
use crate::{Cancel, Progress};
use canopy::Canopy;
pub(crate) use filter::{Filter, square_bytes};
pub(crate) use metres::Metres;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_cloud::{self as cloud, Census, CloudInfo, Filter as Wanted, OpenOptions, Return};
use terrane_gridding::{Asked, Statistic, Subject};
use terrane_ground as ground;

/// A model of the terrain that is made of the points it takes, instead of a statistic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// The ground: its points, linear in their Delaunay triangulation.
    Dtm,
    /// What is seen from above: first returns, linear in their triangulations, without pits.
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

/// A line that tells what a method found.
pub(crate) fn found_by(method: &ground::Asked, found: u64, all: u64) -> String {
    let by = match method.name() {
        "filter" => "the ground filter".to_owned(),
        name => format!("the method {name}"),
    };
    format!("ground: {found} of {all} last returns, found by {by}")
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
        return Err(Error::usage(message).remedy("leave out --stat or the preset"));
    }
    if wanted.returns.is_some() {
        let message = "--return cannot act: a preset takes the returns that it is made of";
        return Err(Error::usage(message).remedy("leave --return out"));
    }
    if wanted.classes.is_some() && job.ground.is_method() {
        let message = "--class cannot act: it names the classes of ground, which a method of \
            --ground does not ask for";
        return Err(Error::usage(message).remedy("leave --class out, or pass --ground class"));
    }
    Ok(())
}

/// What a preset is made with.
pub(super) struct Making<'a> {
    pub(super) job: &'a GridJob,
    /// How the cloud is read, but for classes and returns.
    pub(super) reading: OpenOptions,
    pub(super) threads: usize,
    /// Bytes for points, in all stores together.
    pub(super) memory: u64,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

/// A preset whose points are all in.
pub(super) struct Model {
    preset: Preset,
    ground: Option<Surfaces>,
    canopy: Option<Canopy>,
    /// What became of the points of its surface.
    pub(super) census: Census,
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
            canopy: None,
            census: Census::default(),
            notes: Vec::new(),
            spilled: 0,
        };
        let mut model = empty.with_ground(cloud, making)?;
        if preset != Preset::Dsm && model.ground.is_none() {
            return Err(Error::bad_input("no ground is found in the cloud")
                .remedy("check what --bounds, --polygon and --z-range leave of it"));
        }
        if preset != Preset::Dtm {
            model.add_canopy(cloud, making)?;
        }
        Ok(model)
    }

    /// Finds the ground, if there is any.
    fn with_ground(mut self, cloud: &CloudInfo, making: &Making<'_>) -> Result<Self> {
        let classes = making.job.cloud.filter.classes.clone().unwrap_or_else(|| vec![GROUND]);
        let named = classes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
        if !making.job.ground.is_method() {
            let store = making.read(classes, None)?;
            let count = store.count();
            self.census = *store.census();
            if count > 0 {
                self.notes.push(format!("ground: {count} points of class {named}"));
                self.ground = Some(Surfaces::new(store, cloud.frame)?);
                return Ok(self);
            }
            if making.job.ground == GroundFrom::Class {
                return Err(no_ground_of_class(&named)
                    .remedy("pass --ground auto, or name the classes of ground with --class"));
            }
        }
        self.filter_ground(cloud, making)
    }

    fn filter_ground(mut self, cloud: &CloudInfo, making: &Making<'_>) -> Result<Self> {
        let metres = self.metres(cloud)?;
        let candidates = making.read(no_noise(), Some(Return::Last))?;
        self.census = *candidates.census();
        let method = making.job.ground.method();
        let square = square_bytes(&method, metres.extent(cloud.bounds));
        // The store of the surface is filled later.
        let room = making.store_memory();
        if square > room {
            return Err(too_little(method.name(), least_for(square), making.job.resources.memory));
        }
        let share = if square > 0 { room } else { making.memory / TILE_SHARE };
        let tile = share / making.threads as u64;
        let store = making.store(candidates.tiling());
        let filter = Filter::new(&candidates, &metres, method, tile);
        filter.run(&store, making.threads, making.progress, making.cancel)?;
        let (found, all) = (store.count(), candidates.count());
        self.notes.push(found_by(&method, found, all));
        self.spilled += candidates.spilled();
        self.ground = (found > 0).then(|| Surfaces::new(store, cloud.frame)).transpose()?;
        Ok(self)
    }

    fn add_canopy(&mut self, cloud: &CloudInfo, making: &Making<'_>) -> Result<()> {
        let metres = self.metres(cloud)?;
        let first = making.read(no_noise(), Some(Return::First))?;
        self.census = *first.census();
        self.notes.push(format!("surface: {} first returns", first.count()));
        if self.ground.is_none() {
            let note = "no ground is known: the surface is that of all first returns, pits and all";
            self.notes.push(note.to_owned());
        }
        let ground = self.ground.as_ref();
        self.canopy = Some(Canopy::new(first, ground, (&metres, cloud.frame), making)?);
        Ok(())
    }

    /// Steps in metres; a unit that is guessed is noted, once.
    fn metres(&mut self, cloud: &CloudInfo) -> Result<Metres> {
        let metres = Metres::of(&cloud.crs, &cloud.frame)?;
        let note = "the cloud names no unit of length; it is taken for metres";
        if metres.is_guess && !self.notes.iter().any(|other| other == note) {
            self.notes.push(note.to_owned());
        }
        Ok(metres)
    }

    /// Its values at the centres of the cells of `rect`, NaN where void.
    pub(super) fn values(
        &self,
        max_edge: Option<f64>,
        extent: &Extent,
        rect: Rect,
        out: &mut [f64],
    ) -> Result<()> {
        if let Some(canopy) = &self.canopy {
            canopy.values(max_edge, extent, rect, out)?;
        }
        let Some(ground) = self.ground.as_ref().filter(|_| self.preset != Preset::Dsm) else {
            return Ok(());
        };
        let linear = Statistic::linear(max_edge);
        if self.preset == Preset::Dtm {
            return ground.values(linear, None, extent, rect, out);
        }
        let mut below = vec![0.0; out.len()];
        ground.values(linear, None, extent, rect, &mut below)?;
        for (top, below) in out.iter_mut().zip(below) {
            // Void where either is: a maximum would make that 0.
            *top -= below;
            *top = if *top < 0.0 { 0.0 } else { *top };
        }
        Ok(())
    }

    /// Bytes that went to temporary files.
    pub(super) fn spilled_bytes(&self) -> u64 {
        let ground = self.ground.as_ref().map_or(0, Surfaces::spilled_bytes);
        self.spilled + ground + self.canopy.as_ref().map_or(0, Canopy::spilled)
    }
}

/// The error of a cloud without points of the classes of ground.
pub(crate) fn no_ground_of_class(named: &str) -> Error {
    Error::bad_input(format!("the cloud has no points of class {named}"))
}

/// Bytes of memory in all that a job needs to find the ground as it is asked to, before anything else; 0 where
/// that is not known before the points are.
pub(super) fn least(job: &GridJob, cloud: &CloudInfo) -> u64 {
    let GroundFrom::Method(method) = job.ground else { return 0 };
    let extent = Metres::of(&cloud.crs, &cloud.frame).map(|metres| metres.extent(cloud.bounds));
    extent.map_or(0, |extent| least_for(square_bytes(&method, extent)))
}

/// Of a square: half of the memory is for points, in three stores.
fn least_for(square: u64) -> u64 {
    2 * STORES * square
}

fn too_little(method: &str, least: u64, memory: u64) -> Error {
    let [least, memory] = [least.div_ceil(1 << 20), memory >> 20];
    let message = format!(
        "finding the ground by {method} takes {least} MiB of memory, and {memory} are allowed"
    );
    Error::new(ErrorKind::Resource, message)
        .remedy(format!("pass --memory {least}M or more, or --ground filter"))
}

/// All classes but those of noise.
fn no_noise() -> Vec<u8> {
    (0..=u8::MAX).filter(|class| !NOISE.contains(class)).collect()
}

impl Making<'_> {
    /// The points of these classes and returns.
    fn read(&self, classes: Vec<u8>, returns: Option<Return>) -> Result<PointStore> {
        let filter = Wanted { classes: Some(classes), returns, ..self.reading.filter.clone() };
        let options = OpenOptions { filter, ..self.reading.clone() };
        let source = cloud::source(&self.job.input, &options)?;
        let filling = Filling {
            threads: self.threads,
            memory: self.store_memory(),
            folder: self.folder(),
            progress: self.progress,
            cancel: self.cancel,
        };
        let tiling = super::neighbours::tiling(source.info());
        PointStore::fill(&*source, tiling, &filling)
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
