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
use terrane_proof::tiles::{
    MaskPixels, ProofTileId, TilesetCheck, TilesetFault, TilesetFaultCount, TilesetFaults,
};

/// Rounding of the radius of a sphere, in metres.
const LOOSE: f64 = 1e-3;
/// Relative rounding of tolerances and steps.
const SHARE: f64 = 1e-6;
/// Largest ratio of a tolerance to the measured error where that exceeds the assumption of clients.
const MEASURED: f64 = 1.01;
/// Largest number of height steps in the error that clients assume.
const FINEST: f64 = 64.0 * (1.0 + 1e-6);

/// Rounding of bounds in degrees: they are written in decimals.
const DEGREES: f64 = 1e-9;

/// Number of samples of a tile from which on its error may exceed the assumption of clients.
const MANY: u64 = 1 << 17;
/// Smallest number of height steps in the range of heights, in tiles with all of that range.
const STEPS: f64 = 8192.0;
/// Smallest number of height steps from zero to the highest vertex where single precision requires larger steps.
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
    /// CRS of the raster.
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
    /// Results by check.
    pub checks: Vec<CheckReport>,
    /// Figures by level, the coarsest first.
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
    /// No faults.
    pub kept: bool,
    /// Scope of the check, in words.
    pub looked_at: String,
    /// Faults.
    pub faults: Vec<TileFault>,
}

/// A kind of fault.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TileFault {
    /// Description.
    pub what: String,
    /// Number of faults.
    pub count: u64,
    /// The first faulty tile.
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
    /// By the number of the tile.
    pub(super) records: Vec<Option<TileRecord>>,
    pub(super) sweep: sweep::SampleFindings,
    /// By the number of the tile.
    pub(super) samples: Vec<TileSamples>,
}

/// Judges the findings. The report lacks names of files and figures of the run.
pub(super) fn report(
    context: &TilesProofContext<'_>,
    findings: &TilesProofFindings,
    crs: &Crs,
) -> TilesVerifyReport {
    let mut faults = findings.alone.faults.clone();
    faults.merge(&findings.sweep.faults);
    let judge = TilesJudge { context, findings };
    judge.tiles(&mut faults);
    judge.index(&mut faults);
    let levels: Vec<_> = (0..=context.layer.finest).map(|level| judge.level(level)).collect();
    judge.levels(&levels, &mut faults);
    let checks: Vec<_> = TilesetCheck::ALL
        .into_iter()
        .filter(|(check, _)| *check != TilesetCheck::Water || context.layer.has_water)
        .map(|(check, name)| {
            let looked_at = judge.looked_at(check, &levels);
            let faults = faults_of(check, &faults, context.layer);
            CheckReport { check: name, kept: faults.is_empty(), looked_at, faults }
        })
        .collect();
    TilesVerifyReport {
        crs: crs.label(),
        verdict: ProofVerdict::of(judge.failures(&faults), judge.not_judged()),
        notes: judge.notes(),
        made_by_terrane: context.layer.levels.is_some(),
        files: context.tiles.all.len() as u64,
        vertices: sum(&levels, |level| level.vertices),
        triangles: sum(&levels, |level| level.triangles),
        samples: findings.sweep.valid,
        measured: sum(&levels, |level| level.samples),
        heights: findings.sweep.heights,
        bounds: findings.sweep.bounds,
        max_overstated: judge.max_overstated(),
        checks,
        levels,
        ..TilesVerifyReport::default()
    }
}

/// The faults of a check.
fn faults_of(
    check: TilesetCheck,
    faults: &TilesetFaults,
    layer: &TilesetPromises,
) -> Vec<TileFault> {
    let found = faults.found(check);
    found
        .map(|(_, what, count)| TileFault {
            // Texts name the file of quantized-mesh.
            what: what.replace(folder::NAME, layer.name()),
            count: count.count,
            first: count.first.map(|id| id.to_string()),
        })
        .collect()
}

fn sum(levels: &[LevelProofReport], of: fn(&LevelProofReport) -> u64) -> u64 {
    levels.iter().map(of).sum()
}

struct TilesJudge<'a> {
    context: &'a TilesProofContext<'a>,
    findings: &'a TilesProofFindings,
}

impl TilesJudge<'_> {
    /// Checks that need all samples and tiles.
    fn tiles(&self, faults: &mut TilesetFaults) {
        let layer = self.context.layer;
        let numbered = self.context.tiles.all.iter().zip(&self.findings.records);
        let [lowest, highest] = self.height_range();
        for ((&id, record), samples) in numbered.zip(&self.findings.samples) {
            let Some(record) = record else { continue };
            self.sphere(id, record, faults);
            let step = layer.stated(id.level).map_or(0.0, |stated| stated.step);
            let [low, high] = record.heights;
            let is_spike = low < lowest - step - ROUNDING || high > highest + step + ROUNDING;
            faults.add(TilesetFault::Spikes, u64::from(is_spike), id);
            let is_superfluous = samples.count == 0 && id.level > 0;
            faults.add(TilesetFault::Superfluous, u64::from(is_superfluous), id);
            let Some(recorded) = record.error else {
                faults.add(TilesetFault::NoError, u64::from(layer.levels.is_some()), id);
                continue;
            };
            let is_over = samples.far.is_some_and(|far| far.ends[0] > recorded + ROUNDING);
            faults.add(TilesetFault::OverRecorded, u64::from(is_over), id);
            let is_reckless = recorded > self.context.max_recorded(id.level);
            faults.add(TilesetFault::Reckless, u64::from(is_reckless), id);
        }
    }

    /// The lowest and the highest height that tiles may have.
    fn height_range(&self) -> [f64; 2] {
        let [low, high] = self.findings.sweep.heights.unwrap_or_default();
        if self.context.layer.tapers { [low.min(0.0), high.max(0.0)] } else { [low, high] }
    }

    /// Checks that the sphere of a tile of 3D Tiles is no larger than the tile and the spheres of its children need.
    fn sphere(&self, id: ProofTileId, record: &TileRecord, faults: &mut TilesetFaults) {
        let Some(three) = self.context.layer.three_tiles() else { return };
        let Some(stated) = three.stated(id) else { return };
        let children = id.below().filter_map(|child| three.stated(child));
        let needed = children.map(|child| stated.radius_with(child)).fold(record.radius, f64::max);
        faults.add(TilesetFault::LooseSphere, u64::from(stated.sphere.1 > needed + LOOSE), id);
    }

    /// The error of a level that its positions and height steps, or too many samples in a tile, make unavoidable.
    fn unavoidable(&self, level: u8) -> f64 {
        let [low, high] = self.height_range();
        let of_level = self.context.tiles.of_level(level);
        let max = self.findings.samples[of_level].iter().map(|samples| samples.count).max();
        let share = match max.unwrap_or_default() > MANY {
            true => 1.0,
            false => (4.0 * self.context.raster.samples_of_step(level) + 1.0 / STEPS).min(1.0),
        };
        self.context.layer.assumed(level) + (high - low) * share
    }

    /// Checks the list of tiles against its metadata.
    fn index(&self, faults: &mut TilesetFaults) {
        let (layer, tiles) = (self.context.layer, self.context.tiles);
        for x in 0..2 {
            let root = ProofTileId { level: 0, y: 0, x };
            faults.add(TilesetFault::NoRoot, u64::from(tiles.number_of(root).is_none()), root);
        }
        for level in 0..=layer.finest {
            self.available(level, faults);
        }
        let beyond = tiles.all.partition_point(|id| id.level <= layer.finest);
        tiles.all[beyond..].iter().for_each(|&id| faults.add(TilesetFault::NotAvailable, 1, id));
        faults.add(TilesetFault::Stray, tiles.strays, None);
        let [plain, packed] = &self.findings.alone.packed;
        let fewer = if plain.count < packed.count { plain } else { packed };
        faults.add(TilesetFault::Mixed, fewer.count, fewer.first);
        if let Some(three) = layer.three_tiles() {
            three.check(faults);
        }
        faults.add(TilesetFault::OtherHeights, u64::from(self.has_other_heights()), None);
        self.bounds(faults);
    }

    /// Checks the stated bounds against those of the samples.
    fn bounds(&self, faults: &mut TilesetFaults) {
        let layer = self.context.layer;
        let Some([west, south, east, north]) = layer.bounds else {
            faults.add(TilesetFault::Bounds, 1, None);
            return;
        };
        let is_beyond = west < -180.0 || south < -90.0 || east > 180.0 || north > 90.0;
        faults.add(TilesetFault::BeyondWorld, u64::from(is_beyond), None);
        // Void samples count for the upper limit, but need not be within.
        let (Some(valid), Some(all)) = (self.findings.sweep.bounds, self.findings.sweep.all_bounds)
        else {
            return;
        };
        let contains = west <= valid[0] + DEGREES
            && south <= valid[1] + DEGREES
            && east >= valid[2] - DEGREES
            && north >= valid[3] - DEGREES;
        faults.add(TilesetFault::Bounds, u64::from(!contains), None);
        let spacing = self.context.raster.spacing();
        // terrane widens the bounds of a single sample, so that they have an area.
        let slack = if spacing > 0.0 { DEGREES + spacing * spacing } else { 1e-8 };
        let excess = [all[0] - west, all[1] - south, east - all[2], north - all[3]];
        let is_loose = layer.levels.is_some() && excess.iter().any(|excess| *excess > slack);
        faults.add(TilesetFault::LooseBounds, u64::from(is_loose), None);
    }

    /// Compares the files of a level with its stated availability.
    fn available(&self, level: u8, faults: &mut TilesetFaults) {
        let tiles = self.context.tiles;
        let of_level = tiles.of_level(level);
        let mut is_named = vec![false; of_level.len()];
        // Rectangles may name far more tiles than there are.
        let mut left = sweep::MAX_MISSING;
        for id in self.context.layer.available(level) {
            let fault = match tiles.number_of(id) {
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
        let [vertices, triangles] = self.findings.alone.sizes[at];
        let [within, coarser] = self.findings.alone.borders[at];
        let samples = &self.findings.sweep.levels[at];
        let far = self.farthest(level);
        let raster = &self.context.raster;
        LevelProofReport {
            level,
            tiles: self.context.tiles.of_level(level).len() as u64,
            vertices,
            triangles,
            tolerance: layer.tolerance(level),
            step: layer.stated(level).map(|stated| stated.step),
            samples: samples.samples,
            over: samples.over,
            max_error: far.map(|(far, _)| far.distance),
            max_error_tile: far.map(|(_, id)| id.to_string()),
            max_error_at: far.and_then(|(FarthestSample { sample: [row, col], .. }, _)| {
                raster.position(col, row).ok()
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
        let all =
            self.context.tiles.all[of_level.clone()].iter().zip(&self.findings.samples[of_level]);
        let fars = all.filter_map(|(&id, samples)| Some((samples.far?, id)));
        fars.reduce(|a, b| {
            let ends = [0, 1].map(|i| a.0.ends[i].max(b.0.ends[i]));
            let (far, id) = if b.0.distance > a.0.distance { b } else { a };
            (FarthestSample { ends, ..far }, id)
        })
    }

    /// Checks the metadata of levels.
    fn levels(&self, levels: &[LevelProofReport], faults: &mut TilesetFaults) {
        let tiles = self.context.tiles;
        for level in levels {
            let id = tiles.all.get(tiles.of_level(level.level).start).copied();
            let assumed = self.context.layer.assumed(level.level);
            // On steep triangles the rounding of positions becomes distance: bounds of the error, not the error.
            let [min, max] = self.farthest(level.level).map_or([0.0; 2], |(far, _)| far.ends);
            let needed = (max * MEASURED + LOOSE).max(assumed);
            let is_lax = level.tolerance > needed * (1.0 + SHARE);
            faults.add(TilesetFault::Assumed, u64::from(is_lax), id);
            let is_far = min > self.unavoidable(level.level);
            faults.add(TilesetFault::Avoidable, u64::from(is_far), id);
            let Some(stated) = self.context.layer.stated(level.level) else { continue };
            let is_over = min > stated.error + ROUNDING;
            faults.add(TilesetFault::LevelError, u64::from(is_over), id);
            let recorded = self.recorded(level.level);
            let is_other = recorded.is_some_and(|recorded| stated.error > recorded + ROUNDING);
            faults.add(TilesetFault::OtherError, u64::from(is_other), id);
            let is_other =
                stated.step < assumed / FINEST || stated.step > self.coarsest(assumed, stated);
            faults.add(TilesetFault::OtherStep, u64::from(is_other), id);
            let allowed = self.context.assumed_gap(level.level) - ROUNDING;
            let is_short = stated.skirt.is_some_and(|skirt| skirt < allowed);
            faults.add(TilesetFault::SkirtShort, u64::from(is_short), id);
            faults.add(TilesetFault::Counts, u64::from(stated.tiles != level.tiles), id);
        }
    }

    /// Whether a geoid was added only to the heights of the tiles, or only to those of the raster.
    fn has_other_heights(&self) -> bool {
        let has_geoid = self.context.raster.has_geoid();
        self.context.layer.has_geoid.is_some_and(|stated| stated != has_geoid)
    }

    /// The largest height step that a level needs: by the assumption of clients, the range of heights in a
    /// tile, single precision at the largest height, and the lattice.
    fn coarsest(&self, assumed: f64, stated: StatedLevel) -> f64 {
        let [low, high] = self.height_range();
        let (low, high) = (low.min(0.0), high.max(0.0));
        let of_range = ((high - low) / STEPS).max(high.max(-low) / HIGHEST);
        (2.0 * assumed / FINEST).max(of_range).max(4.0 * stated.lattice.unwrap_or_default())
            * (1.0 + SHARE)
    }

    /// The largest error that a tile of a level records; `None` if a tile cannot be read.
    fn recorded(&self, level: u8) -> Option<f64> {
        let of_level = &self.findings.records[self.context.tiles.of_level(level)];
        let errors = of_level.iter().map(|record| Some(record.as_ref()?.error.unwrap_or_default()));
        errors.collect::<Option<Vec<_>>>().map(|all| all.into_iter().fold(0.0, f64::max))
    }

    fn max_overstated(&self) -> Option<f64> {
        let tiles = self.findings.records.iter().zip(&self.findings.samples);
        tiles
            .filter_map(|(record, samples)| Some((*record)?.error? - samples.far?.distance))
            .reduce(f64::max)
    }

    fn looked_at(&self, check: TilesetCheck, levels: &[LevelProofReport]) -> String {
        let files = self.context.tiles.all.len();
        match check {
            TilesetCheck::Structure => format!("{files} tiles"),
            TilesetCheck::Samples => {
                format!("{} samples on {} levels", self.findings.sweep.valid, levels.len())
            }
            TilesetCheck::Borders => format!(
                "{} borders within levels, {} with no tile beside",
                sum(levels, |level| level.borders),
                sum(levels, |level| level.borders_alone)
            ),
            TilesetCheck::Levels => format!(
                "{} borders to coarser tiles, {} with no such tile beside",
                sum(levels, |level| level.coarser),
                sum(levels, |level| level.coarser_alone)
            ),
            TilesetCheck::Containment => {
                format!("{} vertices", sum(levels, |level| level.vertices))
            }
            TilesetCheck::Water => {
                let MaskPixels { judged, unclear, .. } = self.findings.alone.pixels;
                format!("{judged} pixels, {unclear} more not judged (too near a shore)")
            }
            TilesetCheck::Index => format!("{}, {files} files", self.context.layer.name()),
        }
    }

    fn failures(&self, faults: &TilesetFaults) -> Vec<String> {
        let found = TilesetCheck::ALL.into_iter().flat_map(|(check, _)| faults.found(check));
        found.map(|(fault, what, count)| self.failure(fault, what, count)).collect()
    }

    /// A fault on one line, with its count and the first tile or file.
    fn failure(&self, fault: TilesetFault, what: &str, found: TilesetFaultCount) -> String {
        // Texts name the file of quantized-mesh.
        let text = what.replace(folder::NAME, self.context.layer.name());
        if what.starts_with(folder::NAME) {
            return text;
        }
        let unreadable = self.findings.alone.unreadable.as_ref();
        let stray = self.context.tiles.first_stray.as_ref();
        let first = match fault {
            TilesetFault::Unreadable => unreadable.map(|(_, error)| format!(", first {error}")),
            TilesetFault::Stray => stray.map(|path| format!(", first {}", path.display())),
            _ => found.first.map(|id| format!(", first in tile {id}")),
        };
        format!("{} {text}{}", found.count, first.unwrap_or_default())
    }

    /// Whether water masks are not checked.
    fn lacks_water(&self) -> bool {
        self.context.layer.has_water && self.context.shore.is_none()
    }

    fn not_judged(&self) -> Vec<String> {
        let mut not_judged = Vec::new();
        if self.lacks_water() {
            not_judged.push("water masks, as no file of water features was passed".to_owned());
        }
        let unknown = &self.context.layer.unknown;
        if !unknown.is_empty() {
            not_judged.push(format!("unknown extensions {}", unknown.join(", ")));
        }
        if self.context.layer.levels.is_none() {
            not_judged.push("lattice of heights, as layer.json states no steps".to_owned());
            let records = self.findings.records.iter().flatten();
            let count = records.filter(|record| record.error.is_none()).count();
            if count > 0 {
                not_judged.push(format!("errors of {count} tiles without a recorded error"));
            }
        }
        not_judged
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.context.raster.notes.clone();
        if self.has_other_heights() {
            let note = match self.context.raster.has_geoid() {
                true => "no geoid was added to the heights of the tiles: leave out ‹geoid›",
                false => "a geoid was added to the heights of the tiles: pass ‹geoid›",
            };
            notes.push(note.to_owned());
        }
        if !self.context.raster.knows_unit {
            let note = "the raster does not say what its heights are in: they are taken for metres";
            notes.push(note.to_owned());
        }
        if self.lacks_water() {
            let note = "the tiles have water masks, and water is level in them: pass ‹water›";
            notes.push(note.to_owned());
        }
        notes
    }
}
