//! Features of all files: held in memory if they fit, otherwise read again each time.

use super::snapping::{RingDamage, SnappedPositions, VertexMoves};
use crate::files::{LineFilePair, LineFiles};
use crate::hierarchy_file::{HierarchyFile, HierarchyUse};
use crate::job::LineJob;
use crate::trees::FeatureHierarchies;
use terrane_base::error::Result;
use terrane_engine::memory::{beside_program, short};
use terrane_engine::{Cancel, Progress};
use terrane_files::Buckets;
use terrane_line::Xy;
use terrane_line::tiles::{LastTile, TileRun, VertexHistogram, VertexQuadtree, cut};
use terrane_vector::{Feature, Geometry, JsonMember, LayerHeader};

/// Approximate memory in bytes per feature beside its vertices.
const FEATURE: u64 = 400;
/// Memory in bytes per vertex with a hierarchy.
const SPLIT: u64 = 24;

/// Memory in bytes beside features, tiles and waiting data: the program, the histogram, and the buffers of
/// sinks.
pub(super) const REST: u64 = 24 << 20;

/// Memory left for features, tiles and waiting data.
pub(super) fn memory_for_features(memory: u64) -> u64 {
    memory.saturating_sub(REST)
}

/// Memory in bytes for features and their results.
pub(super) fn memory_for_tiles(job: &LineJob) -> u64 {
    match job.topology {
        Some(_) => memory_for_features(job.resources.memory),
        None => beside_program(job.resources.memory),
    }
}

/// A file after reading.
pub(super) struct ReadFile {
    /// Header at the beginning.
    pub(super) layer: LayerHeader,
    /// Header after the features.
    pub(super) foreign: Vec<JsonMember>,
    pub(super) notes: Vec<String>,
    /// Its features, if held.
    pub(super) features: Vec<Feature>,
    /// How each is simplified, and its location, until hierarchies exist.
    pub(super) orders: Vec<(HierarchyUse, String)>,
    /// Hierarchies of each feature; none without `--hierarchy`.
    pub(super) trees: Vec<FeatureHierarchies>,
}

/// Statistics of all features after snapping.
#[derive(Default)]
pub(super) struct CoverageSummary {
    /// Their bounds.
    pub(super) census: VertexHistogram,
    /// Effects of snapping.
    pub(super) harm: RingDamage,
}

impl CoverageSummary {
    fn add(&mut self, before: &Geometry, moved: Option<&Geometry>) -> Result<()> {
        if let Some(after) = moved {
            self.harm.add(before, after);
        }
        let now = moved.unwrap_or(before);
        now.parts().try_for_each(|part| self.census.add(part.xy))
    }
}

/// All files of a job.
pub(super) struct CoverageInput<'a> {
    job: &'a LineJob,
    files: &'a LineFiles,
    pub(super) all: Vec<ReadFile>,
    pub(super) vertices: u64,
    /// Snapped positions, once known.
    pub(super) moves: VertexMoves,
    /// Statistics after snapping.
    pub(super) seen: CoverageSummary,
    /// Memory in bytes of all features when held.
    pub(super) bytes: u64,
    /// Whether features are held.
    is_held: bool,
}

impl<'a> CoverageInput<'a> {
    /// Reads all files, and holds features up to `most` bytes.
    pub(super) fn read(
        job: &'a LineJob,
        files: &'a LineFiles,
        most: u64,
        store: &mut HierarchyFile,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self> {
        let mut input = Self {
            job,
            files,
            all: Vec::new(),
            vertices: 0,
            moves: VertexMoves::default(),
            seen: CoverageSummary::default(),
            bytes: 0,
            is_held: true,
        };
        progress.begin("read", files.pairs.len() as u64);
        for pair in &files.pairs {
            input.collect(pair, most, store, cancel)?;
            progress.advance(1);
        }
        progress.end();
        Ok(input)
    }

    fn collect(
        &mut self,
        pair: &LineFilePair,
        most: u64,
        store: &mut HierarchyFile,
        cancel: &Cancel,
    ) -> Result<()> {
        let mut source = pair.open(self.job)?;
        let layer = source.layer().clone();
        self.all.push(ReadFile {
            layer,
            foreign: Vec::new(),
            notes: Vec::new(),
            features: Vec::new(),
            orders: Vec::new(),
            trees: Vec::new(),
        });
        while let Some(feature) = source.next()? {
            cancel.check()?;
            let own = bytes(&feature.geometry);
            self.scan(&feature, own).map_err(|e| e.at(source.location()).in_file(&pair.input))?;
            let split =
                if store.is_some() { SPLIT * feature.geometry.vertices() as u64 } else { 0 };
            let more = own + split + FEATURE;
            self.bytes += more;
            match self.all.last_mut() {
                Some(last) if self.is_held && self.bytes <= most => {
                    if store.is_some() {
                        last.orders.push((store.next(&feature.geometry)?, source.location()));
                    }
                    last.features.push(feature);
                }
                _ => self.release(),
            }
        }
        if let Some(last) = self.all.last_mut() {
            last.foreign = source.layer().foreign.clone();
            last.notes = source.notes();
        }
        Ok(())
    }

    fn scan(&mut self, feature: &Feature, bytes: u64) -> Result<()> {
        // A moved feature is held twice, with the data of both.
        let topology = self.job.topology.as_ref();
        let moves = topology.is_some_and(|t| t.snap > 0.0 || self.job.decimals.is_some());
        let copies = if moves { 4 } else { 2 };
        let room = memory_for_tiles(self.job);
        if bytes > room / copies {
            let count = feature.geometry.vertices();
            let message = format!("a feature of {count} vertices does not fit in memory");
            return Err(short(message, copies * bytes + self.job.resources.memory - room));
        }
        self.vertices += feature.geometry.parts().map(|part| part.xy.len() as u64).sum::<u64>();
        if self.job.topology.is_none() {
            return Ok(());
        }
        let moved = self.moves.apply(&feature.geometry)?;
        self.seen.add(&feature.geometry, moved.as_ref())
    }

    /// Provides snapped features from now on.
    pub(super) fn snap(&mut self, snapped: SnappedPositions, cancel: &Cancel) -> Result<()> {
        self.moves = VertexMoves { snapped: Some(snapped) };
        let mut seen = CoverageSummary::default();
        self.visit_moves(cancel, |before, after| seen.add(before, Some(after)))?;
        self.seen = seen;
        Ok(())
    }

    /// Memory in bytes of held features; `None` if not held.
    pub(super) fn memory_use(&self) -> Option<u64> {
        self.is_held.then_some(self.bytes)
    }

    /// Releases the held features.
    pub(super) fn release(&mut self) {
        self.is_held = false;
        self.all.iter_mut().for_each(|file| file.features = Vec::new());
    }

    /// Passes on all features of a file after snapping, and each original geometry if it was moved; files have
    /// to come in order. Held features may be changed.
    fn show(
        &mut self,
        file: usize,
        cancel: &Cancel,
        mut each: impl FnMut(&mut Feature, Option<&Geometry>) -> Result<()>,
    ) -> Result<()> {
        let Self { job, files, all, moves, is_held, .. } = self;
        if file == 0 {
            moves.restart();
        }
        let pair = &files.pairs[file];
        if *is_held {
            return all[file].features.iter_mut().try_for_each(|feature| {
                show_snapped(feature, moves, cancel, &mut each).map_err(|e| e.in_file(&pair.input))
            });
        }
        let mut source = pair.open(job)?;
        while let Some(mut feature) = source.next()? {
            show_snapped(&mut feature, moves, cancel, &mut each)
                .map_err(|e| e.at(source.location()).in_file(&pair.input))?;
        }
        Ok(())
    }

    /// Passes on all snapped features of a file. Files have to come in order.
    pub(super) fn visit(
        &mut self,
        file: usize,
        cancel: &Cancel,
        mut each: impl FnMut(&mut Feature) -> Result<()>,
    ) -> Result<()> {
        self.show(file, cancel, |feature, _| each(feature))
    }

    /// Passes on all snapped features of all files.
    pub(super) fn visit_all(
        &mut self,
        cancel: &Cancel,
        mut each: impl FnMut(&mut Feature) -> Result<()>,
    ) -> Result<()> {
        (0..self.all.len()).try_for_each(|file| self.visit(file, cancel, &mut each))
    }

    /// Sorts all vertices by tile.
    pub(super) fn sort(
        &mut self,
        quadtree: &VertexQuadtree,
        buckets: &Buckets<Xy>,
        cancel: &Cancel,
    ) -> Result<()> {
        let (mut place, mut runs) = (LastTile::default(), Vec::new());
        self.visit_all(cancel, |feature| {
            feature.geometry.parts().try_for_each(|part| {
                cut(part.xy, false, quadtree, &mut place, &mut runs);
                runs.iter().try_for_each(|run: &TileRun| {
                    buckets.push(run.tile as usize, &part.xy[run.first..run.first + run.count])
                })
            })
        })
    }

    /// Passes on all moved geometries, before and after.
    pub(super) fn visit_moves(
        &mut self,
        cancel: &Cancel,
        mut each: impl FnMut(&Geometry, &Geometry) -> Result<()>,
    ) -> Result<()> {
        (0..self.all.len()).try_for_each(|file| {
            self.show(file, cancel, |feature, before| {
                before.map_or(Ok(()), |before| each(before, &feature.geometry))
            })
        })
    }
}

/// Passes on a feature after snapping, with its original geometry if it was moved, which is then restored.
fn show_snapped(
    feature: &mut Feature,
    moves: &mut VertexMoves,
    cancel: &Cancel,
    mut each: impl FnMut(&mut Feature, Option<&Geometry>) -> Result<()>,
) -> Result<()> {
    cancel.check()?;
    let Some(moved) = moves.apply(&feature.geometry)? else { return each(feature, None) };
    let before = std::mem::replace(&mut feature.geometry, moved);
    let shown = each(feature, Some(&before));
    feature.geometry = before;
    shown
}

/// Bytes of the coordinates.
fn bytes(geometry: &Geometry) -> u64 {
    let each = 16 + 8 * u64::from(geometry.has_z()) + 8 * u64::from(geometry.has_m());
    geometry.vertices() as u64 * each
}
