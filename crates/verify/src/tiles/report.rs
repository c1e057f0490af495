//! Report of a verification of tiles.

use serde::Serialize;

use super::context::{ROUNDING, TilesProofContext};
use super::folder;
use super::layer::TilesetPromises;
use super::level::StatedLevel;
use super::sweep::{self, FarthestSample, TileSamples};
use super::tile_checks::{self, TileRecord};
use terrane_base::geom::Crs;
use terrane_engine::proof::ProofVerdict;
use terrane_engine::run_statistics::RunStatistics;
use terrane_proof::tiles::{MaskPixels, ProofTileId, TilesetCheck, TilesetFault, TilesetFaults};

/// Metres that a sphere may be larger than it has to be, and part that a tolerance may: rounding.
const LOOSE: f64 = 1e-3;
const SHARE: f64 = 1e-6;
/// Largest ratio of a tolerance to the measured error where that exceeds the assumption of clients.
const MEASURED: f64 = 1.01;
/// Steps of heights in the error that clients assume, at most.
const FINEST: f64 = 64.0 * (1.0 + 1e-6);

/// Degrees by which bounds may miss a sample: they are written in decimals.
const DEGREES: f64 = 1e-9;

/// Prefix of the fault for files outside the set, or unreadable ones.
const STRAY: &str = "files that are neither";
const UNREADABLE: &str = "tiles that cannot be read";

/// Samples of a tile, about, from which on it need not be as near to rough ground as clients assume.
const MANY: u64 = 1 << 17;
/// Parts of the range of heights that a step of heights is at the most, in tiles with all of that range.
const STEPS: f64 = 8192.0;
/// Steps of heights from zero to the highest place, at least, where single precision asks for larger steps.
const HIGHEST: f64 = 2e6;

/// Report of a verification of tiles. Distances and heights are in metres; tiles are
/// "level/column/row".
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TilesVerifyReport {
    /// The set of tiles.
    pub tiles: String,
    /// The raster.
    pub raster: String,
    /// Its reference system.
    pub crs: String,
    /// Verdict of the proof.
    #[serde(flatten)]
    pub verdict: ProofVerdict,
    /// Further remarks.
    pub notes: Vec<String>,
    /// True when `layer.json` has terrane's own metadata: tolerances, steps and errors.
    pub made_by_terrane: bool,
    /// Tiles, vertices and triangles of all levels.
    pub files: u64,
    /// See `files`.
    pub vertices: u64,
    /// See `files`.
    pub triangles: u64,
    /// Valid samples of the raster.
    pub samples: u64,
    /// Measured samples of all levels; samples on a border count once for each tile.
    pub measured: u64,
    /// Lowest and highest valid sample.
    pub heights: Option<[f64; 2]>,
    /// West, south, east and north of the valid samples.
    pub bounds: Option<[f64; 4]>,
    /// Largest excess of a tile's recorded error over the measured one.
    pub max_overstated: Option<f64>,
    /// One for each thing that is proved.
    pub checks: Vec<CheckReport>,
    /// One for each level, the coarsest first.
    pub levels: Vec<LevelProofReport>,
    /// Samples measured a second.
    pub samples_per_second: f64,
    /// Time, memory and threads of the run.
    #[serde(flatten)]
    pub run: RunStatistics,
}

/// Result of one check.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CheckReport {
    /// Name: structure, samples, borders, levels, containment, water or index.
    pub check: &'static str,
    /// Nothing wrong was found.
    pub kept: bool,
    /// Scope of the check, in words.
    pub looked_at: String,
    /// Faults.
    pub faults: Vec<TileFault>,
}

/// Something wrong.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TileFault {
    /// Description.
    pub what: String,
    /// How often.
    pub count: u64,
    /// The first tile that has it.
    pub first: Option<String>,
}

/// A level.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct LevelProofReport {
    pub level: u8,
    pub tiles: u64,
    pub vertices: u64,
    pub triangles: u64,
    /// Largest allowed distance of a sample.
    pub tolerance: f64,
    /// Step of all heights, where it is stated.
    pub step: Option<f64>,
    /// Samples measured, and samples over the tolerance.
    pub samples: u64,
    pub over: u64,
    pub max_error: Option<f64>,
    /// The tile of that error, and longitude and latitude of the sample.
    pub max_error_tile: Option<String>,
    pub max_error_at: Option<[f64; 2]>,
    pub rmse: Option<f64>,
    /// Borders between tiles of the level: compared, with no tile on the other side, different, largest gap.
    pub borders: u64,
    pub borders_alone: u64,
    pub borders_differing: u64,
    pub gap: Option<f64>,
    /// Borders to tiles of the next coarser level, and borders with a larger gap than allowed.
    pub coarser: u64,
    pub coarser_alone: u64,
    pub coarser_over: u64,
    pub coarser_gap: Option<f64>,
    pub coarser_gap_tile: Option<String>,
    pub coarser_gap_allowed: Option<f64>,
}

/// Findings of all checks.
pub(super) struct TilesProofFindings {
    pub(super) alone: tile_checks::SingleTileFindings,
    pub(super) records: Vec<Option<TileRecord>>,
    pub(super) sweep: sweep::SampleFindings,
    pub(super) under: Vec<TileSamples>,
}

/// The findings, judged; without names of files and figures of the run.
pub(super) fn report(
    context: &TilesProofContext<'_>,
    found: &TilesProofFindings,
    crs: &Crs,
) -> TilesVerifyReport {
    let mut faults = found.alone.faults.clone();
    faults.merge(&found.sweep.faults);
    let judge = TilesJudge { context, found };
    judge.tiles(&mut faults);
    judge.index(&mut faults);
    let levels: Vec<_> = (0..=context.layer.finest).map(|level| judge.level(level)).collect();
    judge.levels(&levels, &mut faults);
    let checks: Vec<_> = TilesetCheck::ALL
        .into_iter()
        .filter(|(check, _)| *check != TilesetCheck::Water || context.layer.has_water)
        .map(|(check, name)| {
            let looked_at = judge.looked_at(check, &levels);
            CheckReport::new((check, name), &faults, context.layer, looked_at)
        })
        .collect();
    let sum = |of: fn(&LevelProofReport) -> u64| levels.iter().map(of).sum();
    TilesVerifyReport {
        crs: crs.label(),
        verdict: ProofVerdict::of(judge.failures(&checks), judge.not_judged()),
        notes: judge.notes(),
        made_by_terrane: context.layer.levels.is_some(),
        files: context.tiles.all.len() as u64,
        vertices: sum(|level| level.vertices),
        triangles: sum(|level| level.triangles),
        samples: found.sweep.valid,
        measured: sum(|level| level.samples),
        heights: found.sweep.heights,
        bounds: found.sweep.bounds,
        max_overstated: judge.max_overstated(),
        checks,
        levels,
        ..TilesVerifyReport::default()
    }
}

impl CheckReport {
    fn new(
        (check, name): (TilesetCheck, &'static str),
        faults: &TilesetFaults,
        layer: &TilesetPromises,
        looked_at: String,
    ) -> Self {
        let told = |(_, what, count): (
            TilesetFault,
            &'static str,
            terrane_proof::tiles::TilesetFaultCount,
        )| {
            let first = count.first.map(|id| id.to_string());
            // Texts name the file of quantized-mesh.
            let what = what.replace(folder::NAME, layer.name());
            TileFault { what, count: count.count, first }
        };
        let faults: Vec<_> = faults.found(check).map(told).collect();
        Self { check: name, kept: faults.is_empty(), looked_at, faults }
    }
}

struct TilesJudge<'a> {
    context: &'a TilesProofContext<'a>,
    found: &'a TilesProofFindings,
}

impl TilesJudge<'_> {
    /// Checks that need all samples and tiles.
    fn tiles(&self, faults: &mut TilesetFaults) {
        let layer = self.context.layer;
        let numbered = self.context.tiles.all.iter().zip(&self.found.records);
        let [lowest, highest] = self.reach();
        for ((&id, record), under) in numbered.zip(&self.found.under) {
            let Some(record) = record else { continue };
            self.sphere(id, record, faults);
            let step = layer.own(id.level).map_or(0.0, |own| own.step);
            let [low, high] = record.heights;
            let is_spike = low < lowest - step - ROUNDING || high > highest + step + ROUNDING;
            faults.add(TilesetFault::Spikes, u64::from(is_spike), id);
            let is_vain = under.count == 0 && id.level > 0;
            faults.add(TilesetFault::Superfluous, u64::from(is_vain), id);
            let Some(recorded) = record.error else {
                faults.add(TilesetFault::NoError, u64::from(layer.levels.is_some()), id);
                continue;
            };
            let is_over = under.far.is_some_and(|far| far.ends[0] > recorded + ROUNDING);
            faults.add(TilesetFault::OverRecorded, u64::from(is_over), id);
            let is_reckless = recorded > self.context.max_recorded(id.level);
            faults.add(TilesetFault::Reckless, u64::from(is_reckless), id);
        }
    }

    /// The lowest and the highest height that tiles may have.
    fn reach(&self) -> [f64; 2] {
        let [low, high] = self.found.sweep.heights.unwrap_or_default();
        if self.context.layer.tapers { [low.min(0.0), high.max(0.0)] } else { [low, high] }
    }

    /// Holds the sphere of a tile of terrane's to be no larger than it and the spheres below it need.
    fn sphere(&self, id: ProofTileId, record: &TileRecord, faults: &mut TilesetFaults) {
        let Some(three) = self.context.layer.three() else { return };
        let Some(about) = three.about(id) else { return };
        let below = id.below().filter_map(|part| three.about(part));
        let needed = below.map(|part| about.reach_of(part)).fold(record.radius, f64::max);
        faults.add(TilesetFault::LooseSphere, u64::from(about.sphere.1 > needed + LOOSE), id);
    }

    /// The error of a level that has to be allowed, as its positions and steps of heights cannot hold samples nearer, or
    /// its tiles have too many of them.
    fn unavoidable(&self, level: u8) -> f64 {
        let [low, high] = self.reach();
        let of_level = self.context.tiles.of_level(level);
        let most = self.found.under[of_level].iter().map(|under| under.count).max();
        let steps = match most.unwrap_or_default() > MANY {
            true => 1.0,
            false => (4.0 * self.context.places.samples_of_step(level) + 1.0 / STEPS).min(1.0),
        };
        self.context.layer.assumed(level) + (high - low) * steps
    }

    /// Checks the list of tiles against its metadata.
    fn index(&self, faults: &mut TilesetFaults) {
        let (layer, tiles) = (self.context.layer, self.context.tiles);
        for x in 0..2 {
            let root = ProofTileId { level: 0, y: 0, x };
            faults.add(TilesetFault::NoRoot, u64::from(tiles.find_one(root).is_none()), root);
        }
        for level in 0..=layer.finest {
            self.available(level, faults);
        }
        let beyond = tiles.all.partition_point(|id| id.level <= layer.finest);
        tiles.all[beyond..].iter().for_each(|&id| faults.add(TilesetFault::NotAvailable, 1, id));
        faults.add(TilesetFault::Stray, tiles.strays, None);
        let [plain, packed] = &self.found.alone.packed;
        let fewer = if plain.count < packed.count { plain } else { packed };
        faults.add(TilesetFault::Mixed, fewer.count, fewer.first);
        if let Some(three) = layer.three() {
            three.check(faults);
        }
        let Some(data) = self.found.sweep.bounds else { return };
        let holds = |[west, south, east, north]: [f64; 4]| {
            let low = west <= data[0] + DEGREES && south <= data[1] + DEGREES;
            low && east >= data[2] - DEGREES && north >= data[3] - DEGREES
        };
        faults.add(TilesetFault::Bounds, u64::from(!layer.bounds.is_some_and(holds)), None);
        let spacing = self.context.places.spacing();
        // Of one sample the bounds are widened, so that they have an area.
        let slack = if spacing > 0.0 { DEGREES + spacing * spacing } else { 1e-8 };
        let is_loose = |told: [f64; 4], whole: [f64; 4]| {
            let far =
                [whole[0] - told[0], whole[1] - told[1], told[2] - whole[2], told[3] - whole[3]];
            far.iter().any(|far| *far > slack)
        };
        let both = layer.bounds.zip(self.found.sweep.whole).filter(|_| layer.levels.is_some());
        let is_off = both.is_some_and(|(told, whole)| is_loose(told, whole));
        faults.add(TilesetFault::LooseBounds, u64::from(is_off), None);
        faults.add(TilesetFault::OtherHeights, u64::from(self.has_other_heights()), None);
        let is_beyond = |[west, south, east, north]: [f64; 4]| {
            west < -180.0 || south < -90.0 || east > 180.0 || north > 90.0
        };
        faults.add(TilesetFault::BeyondWorld, u64::from(layer.bounds.is_some_and(is_beyond)), None);
    }

    /// Compares the files of a level with its stated availability.
    fn available(&self, level: u8, faults: &mut TilesetFaults) {
        let tiles = self.context.tiles;
        let of_level = tiles.of_level(level);
        let mut is_named = vec![false; of_level.len()];
        // Rectangles may name far more than there is.
        let mut left = sweep::MAX_MISSING;
        for id in self.context.layer.available(level) {
            let fault = match tiles.find_one(id) {
                None => TilesetFault::NotThere,
                Some(number) if is_named[number - of_level.start] => TilesetFault::NamedTwice,
                Some(number) => {
                    is_named[number - of_level.start] = true;
                    continue;
                }
            };
            faults.add(fault, 1, id);
            left -= 1;
            if left == 0 {
                break;
            }
        }
        let all = tiles.all[of_level].iter().zip(is_named);
        all.filter(|(_, named)| !named)
            .for_each(|(&id, _)| faults.add(TilesetFault::NotAvailable, 1, id));
    }

    fn level(&self, level: u8) -> LevelProofReport {
        let (layer, at) = (self.context.layer, usize::from(level));
        let [vertices, triangles] = self.found.alone.sizes[at];
        let [within, coarser] = self.found.alone.borders[at];
        let samples = &self.found.sweep.levels[at];
        let far = self.farthest(level);
        let places = &self.context.places;
        LevelProofReport {
            level,
            tiles: self.context.tiles.of_level(level).len() as u64,
            vertices,
            triangles,
            tolerance: layer.tolerance(level),
            step: layer.own(level).map(|own| own.step),
            samples: samples.samples,
            over: samples.over,
            max_error: far.map(|(far, _)| far.distance),
            max_error_tile: far.map(|(_, id)| id.to_string()),
            max_error_at: far.and_then(|(FarthestSample { sample: [row, col], .. }, _)| {
                places.place(col, row).ok()
            }),
            rmse: samples.rmse(),
            borders: within.compared,
            borders_alone: within.alone,
            borders_differing: within.broken,
            gap: within.gap.map(|(gap, _)| gap),
            coarser: coarser.compared,
            coarser_alone: coarser.alone,
            coarser_over: coarser.broken,
            coarser_gap: coarser.gap.map(|(gap, _)| gap),
            coarser_gap_tile: coarser.gap.map(|(_, id)| id.to_string()),
            coarser_gap_allowed: (level > 0).then(|| self.context.allowed_gap(level)),
        }
    }

    /// The farthest sample of a level, and its tile.
    fn farthest(&self, level: u8) -> Option<(FarthestSample, ProofTileId)> {
        let of_level = self.context.tiles.of_level(level);
        let all = self.context.tiles.all[of_level.clone()].iter().zip(&self.found.under[of_level]);
        let fars = all.filter_map(|(&id, under)| Some((under.far?, id)));
        fars.reduce(|a, b| {
            let ends = [0, 1].map(|i| a.0.ends[i].max(b.0.ends[i]));
            let (far, id) = if b.0.distance > a.0.distance { b } else { a };
            (FarthestSample { ends, ..far }, id)
        })
    }

    /// Checks the metadata of levels.
    fn levels(&self, levels: &[LevelProofReport], faults: &mut TilesetFaults) {
        for found in levels {
            let id = self.context.tiles.all.get(self.context.tiles.of_level(found.level).start);
            let assumed = self.context.layer.assumed(found.level);
            // Steep triangles make distances of what is rounded.
            let [error, most] = self.farthest(found.level).map_or([0.0; 2], |(far, _)| far.ends);
            let needed = (most * MEASURED + LOOSE).max(assumed);
            let is_lax = found.tolerance > needed * (1.0 + SHARE);
            faults.add(TilesetFault::Assumed, u64::from(is_lax), id.copied());
            let is_far = error > self.unavoidable(found.level);
            faults.add(TilesetFault::Avoidable, u64::from(is_far), id.copied());
            let Some(own) = self.context.layer.own(found.level) else { continue };
            faults.add(
                TilesetFault::LevelError,
                u64::from(error > own.error + ROUNDING),
                id.copied(),
            );
            let recorded = self.recorded(found.level);
            let is_other = recorded.is_some_and(|recorded| own.error > recorded + ROUNDING);
            faults.add(TilesetFault::OtherError, u64::from(is_other), id.copied());
            let is_other = own.step < assumed / FINEST || own.step > self.coarsest(assumed, own);
            faults.add(TilesetFault::OtherStep, u64::from(is_other), id.copied());
            let allowed = self.context.assumed_gap(found.level) - ROUNDING;
            let is_short = own.skirt.is_some_and(|skirt| skirt < allowed);
            faults.add(TilesetFault::SkirtShort, u64::from(is_short), id.copied());
            faults.add(TilesetFault::Counts, u64::from(own.tiles != found.tiles), id.copied());
        }
    }

    /// Whether a geoid was added only to the heights of the tiles, or only to those of the raster.
    fn has_other_heights(&self) -> bool {
        let has_geoid = self.context.places.has_geoid();
        self.context.layer.has_geoid.is_some_and(|said| said != has_geoid)
    }

    /// The largest step of heights that a level needs: by the assumption of clients, the range of heights in a
    /// tile, single precision at the largest height, and the lattice.
    fn coarsest(&self, assumed: f64, own: StatedLevel) -> f64 {
        let [low, high] = self.reach();
        let (low, high) = (low.min(0.0), high.max(0.0));
        let of_range = ((high - low) / STEPS).max(high.max(-low) / HIGHEST);
        (2.0 * assumed / FINEST).max(of_range).max(4.0 * own.lattice.unwrap_or_default())
            * (1.0 + SHARE)
    }

    /// The largest error that a tile of a level records, where all of them can be read.
    fn recorded(&self, level: u8) -> Option<f64> {
        let of_level = &self.found.records[self.context.tiles.of_level(level)];
        let errors = of_level.iter().map(|record| Some(record.as_ref()?.error.unwrap_or_default()));
        errors.collect::<Option<Vec<_>>>().map(|all| all.into_iter().fold(0.0, f64::max))
    }

    fn max_overstated(&self) -> Option<f64> {
        let both = self.found.records.iter().zip(&self.found.under);
        let over = both.filter_map(|(record, under)| Some((*record)?.error? - under.far?.distance));
        over.reduce(f64::max)
    }

    fn looked_at(&self, check: TilesetCheck, levels: &[LevelProofReport]) -> String {
        let sum = |of: fn(&LevelProofReport) -> u64| levels.iter().map(of).sum::<u64>();
        let files = self.context.tiles.all.len();
        match check {
            TilesetCheck::Structure => format!("{files} tiles"),
            TilesetCheck::Samples => {
                format!("{} samples on {} levels", self.found.sweep.valid, levels.len())
            }
            TilesetCheck::Borders => format!(
                "{} borders within levels, {} with no tile beside",
                sum(|level| level.borders),
                sum(|level| level.borders_alone)
            ),
            TilesetCheck::Levels => format!(
                "{} borders to coarser tiles, {} with no such tile beside",
                sum(|level| level.coarser),
                sum(|level| level.coarser_alone)
            ),
            TilesetCheck::Containment => format!("{} vertices", sum(|level| level.vertices)),
            TilesetCheck::Water => {
                let MaskPixels { judged, unclear, .. } = self.found.alone.pixels;
                format!("{judged} pixels, {unclear} more too near to a bank to tell")
            }
            TilesetCheck::Index => format!("{}, {files} files", self.context.layer.name()),
        }
    }

    fn failures(&self, checks: &[CheckReport]) -> Vec<String> {
        let told = |fault: &TileFault| {
            let first = match (&fault.first, &self.context.tiles.first_stray) {
                (Some(tile), _) => format!(", first in tile {tile}"),
                (None, Some(path)) if fault.what.starts_with(STRAY) => {
                    format!(", first {}", path.display())
                }
                _ => String::new(),
            };
            let why = self.found.alone.unreadable.as_ref();
            match (fault.what.strip_prefix(self.context.layer.name()), why) {
                (Some(_), _) => fault.what.clone(),
                (None, Some((_, why))) if fault.what == UNREADABLE => {
                    format!("{} {}, first {why}", fault.count, fault.what)
                }
                (None, _) => format!("{} {}{first}", fault.count, fault.what),
            }
        };
        checks.iter().flat_map(|check| &check.faults).map(told).collect()
    }

    fn not_judged(&self) -> Vec<String> {
        let mut not = Vec::new();
        if self.context.layer.has_water && self.context.shore.is_none() {
            not.push("masks of water, as no file of it was named".to_owned());
        }
        let unknown = &self.context.layer.unknown;
        if !unknown.is_empty() {
            not.push(format!("the extensions {}, which are not known", unknown.join(", ")));
        }
        if self.context.layer.levels.is_none() {
            not.push(
                "whether heights are on one lattice, as layer.json states no steps".to_owned(),
            );
            let records = self.found.records.iter().flatten();
            let none = records.filter(|record| record.error.is_none()).count();
            not.extend((none > 0).then(|| format!("the errors of {none} tiles that record none")));
        }
        not
    }

    fn notes(&self) -> Vec<String> {
        let unknown = !self.context.places.knows_unit;
        let note = "the raster does not say what its heights are in: they are taken for metres";
        let is_dry = self.context.layer.has_water && self.context.shore.is_none();
        let of_water =
            "tiles tell of water, which is level in them: pass ‹water› with the file of it";
        let has_geoid = self.context.places.has_geoid();
        let is_other = self.has_other_heights();
        let of_geoid = match has_geoid {
            true => "the tiles say that no geoid was added to their heights: leave ‹geoid› out",
            false => "the tiles say that a geoid was added to their heights: pass ‹geoid›",
        };
        let found = self.context.places.notes.iter().cloned();
        found
            .chain(is_other.then(|| of_geoid.to_owned()))
            .chain(unknown.then(|| note.to_owned()))
            .chain(is_dry.then(|| of_water.to_owned()))
            .collect()
    }
}
