//! Pairing of the features of simplified lines with the original ones.

use std::collections::{HashMap, HashSet, VecDeque};
use std::path::Path;

use super::attributes::{AttributeRules, Facts, shown};
use super::feature::{ComparedFeature, FeaturePart, MatchedParts, bits, key, match_parts};
use super::findings::FeatureFindings;
use crate::options::LineVerifyJob;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::memory::{PROGRAM, short};
use terrane_engine::{Cancel, Progress};
use terrane_proof::lines::PartVertices;
use terrane_vector::{
    self as vector, Feature, FeatureSource, PartRole, PropertySupport, VectorFormat,
    VectorOpenOptions,
};

/// Bytes for each vertex of either file where all features have to be in memory.
const VERTEX: u64 = 200;
/// Bytes for each vertex of the feature that is compared.
const COMPARED_VERTEX: u64 = 160;
/// Memory of one feature that is allowed with any budget.
const MIN_MEMORY: u64 = 16 << 20;

/// Features of both files. They come in the same order, or, from formats that sort them, in any.
pub(super) struct FeaturePairs<'a> {
    job: &'a LineVerifyJob,
    cancel: &'a Cancel,
    format: &'static VectorFormat,
    /// The features of both files, where they are not in the same order.
    buffered: Option<BufferedFeatures>,
}

/// All features, and for each original feature its result.
struct BufferedFeatures {
    before: Vec<ComparedFeature>,
    after: Vec<ComparedFeature>,
    partners: Vec<Option<usize>>,
    findings: FeatureFindings,
}

/// Outcome of a comparison.
pub(super) enum ComparisonOutcome {
    /// Every feature was compared.
    All(Box<FeatureFindings>),
    /// Features are not in the same order: collect them first.
    OutOfOrder,
}

/// Receives an original part, its result (without vertices when it is missing), and whether it is a ring.
pub(super) type Visit<'a> = dyn FnMut(PartVertices<'_>, PartVertices<'_>, bool) -> Result<()> + 'a;

impl<'a> FeaturePairs<'a> {
    pub(super) fn new(job: &'a LineVerifyJob, cancel: &'a Cancel) -> Result<Self> {
        let format = vector::identify(&job.lines)?.ok_or_else(|| {
            Error::bad_input("not a vector file of a known format").in_file(&job.lines)
        })?;
        Ok(Self { job, cancel, format, buffered: None })
    }

    /// The name of the format of the lines.
    pub(super) fn format(&self) -> &'static str {
        self.format.name
    }

    /// Visits all parts in the order of the original.
    pub(super) fn each(
        &self,
        progress: &dyn Progress,
        visit: &mut Visit<'_>,
    ) -> Result<ComparisonOutcome> {
        let Some(BufferedFeatures { before, after, partners, findings }) = &self.buffered else {
            return self.side_by_side(progress, visit);
        };
        let mut findings = findings.clone();
        for (number, (before, partner)) in before.iter().zip(partners).enumerate() {
            self.cancel.check()?;
            progress.advance(1);
            let Some(after) = partner.map(|own| &after[own]) else {
                before.parts.iter().try_for_each(|part| visit_gone(part, visit))?;
                continue;
            };
            let pair = FeaturePair { number: number as u64, before, after };
            self.visit(&pair, &match_parts(before, after), &mut findings, visit)?;
        }
        Ok(ComparisonOutcome::All(Box::new(findings)))
    }

    /// Visits parts while both files are read.
    fn side_by_side(
        &self,
        progress: &dyn Progress,
        visit: &mut Visit<'_>,
    ) -> Result<ComparisonOutcome> {
        let [mut original, mut lines] = self.open()?;
        let mut rules = AttributeRules::new(self.format.holds, &*lines);
        let mut findings = FeatureFindings::default();
        loop {
            self.cancel.check()?;
            progress.advance(1);
            let number = findings.features;
            let (before, after) = match (original.next()?, lines.next()?) {
                (None, None) => {
                    (findings.lost, findings.cut) = (rules.lost, rules.cut());
                    return Ok(ComparisonOutcome::All(Box::new(findings)));
                }
                (Some(before), Some(after)) => (before, after),
                _ => return Ok(ComparisonOutcome::OutOfOrder),
            };
            let facts = [rules.expected(&before), rules.found(&after)];
            let [expected, found] = facts;
            let difference = rules.difference(&expected, &found);
            let before = self.prepare(&before, expected, &*original)?;
            let after = self.prepare(&after, found, &*lines)?;
            let placed = match_parts(&before, &after);
            let (is_same, is_sound) = (difference.is_none(), placed.fits);
            let is_pair = match self.format.holds.ordered {
                true => is_same || is_sound,
                false => is_same && is_sound,
            };
            if !is_pair {
                return Ok(ComparisonOutcome::OutOfOrder);
            }
            if let Some(what) = difference {
                findings.attributes.add(|| format!("feature {number}: {what}"));
            }
            let pair = FeaturePair { number, before: &before, after: &after };
            self.visit(&pair, &placed, &mut findings, visit)?;
            findings.features += 1;
        }
    }

    /// Visits the parts of a feature, and judges the rest of it.
    fn visit(
        &self,
        pair: &FeaturePair<'_>,
        placed: &MatchedParts,
        findings: &mut FeatureFindings,
        visit: &mut Visit<'_>,
    ) -> Result<()> {
        let FeaturePair { number, before, after } = *pair;
        let extras = ZmComparison::new(self.format, before, after);
        findings.unstored[0] += u64::from(!extras.is_stored[0]);
        findings.unstored[1] += u64::from(!extras.is_stored[1]);
        if extras.differ(&before.points, &after.points) {
            findings.points.add(|| format!("feature {number}"));
        }
        let mut outer: &[[f64; 3]] = &[];
        for (part, own) in before.parts.iter().zip(&placed.of) {
            let own = own.map(|own| &after.parts[own]);
            match part.role {
                PartRole::Outer if own.is_none() => outer = &part.points,
                PartRole::Outer | PartRole::Line => outer = &[],
                PartRole::Hole => {}
            }
            let old = extras.of(part, true);
            let new = own.map_or_else(Vec::new, |own| extras.of(own, false));
            let points = own.map_or(&[][..], |own| &own.points);
            // Shapefiles mark holes by their orientation alone, which may turn.
            let has_roles = self.format.holds.values != PropertySupport::Dbase;
            if own.is_some_and(|own| own.role != part.role) && has_roles {
                findings.roles.add(|| format!("in feature {number}"));
            }
            let before = PartVertices { points: &part.points, extras: &old, outer };
            visit(before, PartVertices { points, extras: &new, outer: &[] }, part.is_ring())?;
        }
        for added in placed.added.iter().map(|&own| &after.parts[own]) {
            visit(PartVertices::default(), PartVertices::of(&added.points), added.is_ring())?;
        }
        Ok(())
    }

    /// Reads all features of both files into memory and pairs them.
    pub(super) fn collect(&mut self) -> Result<()> {
        let [mut original, mut lines] = self.open()?;
        let mut rules = AttributeRules::new(self.format.holds, &*lines);
        let mut bytes = 0;
        let before = self.all(&mut *original, &mut bytes, |feature| rules.expected(feature))?;
        let after = self.all(&mut *lines, &mut bytes, |feature| rules.found(feature))?;
        let FeaturePartners { of: partners, made, .. } = FeaturePartners::find(&before, &after);
        let mut findings =
            FeatureFindings { features: before.len() as u64, ..FeatureFindings::default() };
        for (number, (old, partner)) in before.iter().zip(&partners).enumerate() {
            match partner {
                Some(own) => {
                    if let Some(what) = rules.difference(&old.facts, &after[*own].facts) {
                        findings.attributes.add(|| format!("feature {number}: {what}"));
                    }
                }
                // A CSV with a row for each vertex cannot store a feature without vertices.
                None if old.is_empty() && self.format.holds.values == PropertySupport::Cells => {}
                None => findings.gone.add(|| format!("feature {number}{}", named(old))),
            }
        }
        for (number, own) in after.iter().enumerate().filter(|(number, _)| !made[*number]) {
            findings.added.add(|| format!("feature {number} of the lines{}", named(own)));
        }
        (findings.lost, findings.cut) = (rules.lost, rules.cut());
        self.buffered = Some(BufferedFeatures { before, after, partners, findings });
        Ok(())
    }

    /// All features of a file; `bytes` counts the memory of all features read so far.
    fn all(
        &self,
        source: &mut dyn FeatureSource,
        bytes: &mut u64,
        mut facts: impl FnMut(&Feature) -> Facts,
    ) -> Result<Vec<ComparedFeature>> {
        let mut all = Vec::new();
        while let Some(feature) = source.next()? {
            self.cancel.check()?;
            *bytes += (feature.geometry.vertices() as u64 + 1) * VERTEX;
            if *bytes > self.job.resources.memory {
                let message = "features in another order than the original exceed the memory";
                return Err(Error::new(ErrorKind::Resource, message)
                    .in_file(&self.job.lines)
                    .remedy(
                        "pass more ‹memory›, or write lines to a format that keeps the order",
                    ));
            }
            all.push(self.prepare(&feature, facts(&feature), source)?);
        }
        Ok(all)
    }

    fn open(&self) -> Result<[Box<dyn FeatureSource>; 2]> {
        let options = VectorOpenOptions { layer: self.job.layer.clone(), ..Default::default() };
        let original = vector::open(&self.job.original, &options)?;
        Ok([original, vector::open(&self.job.lines, &VectorOpenOptions::default())?])
    }

    /// Prepares a feature for comparison; fails where it needs too much memory or has unusable coordinates.
    fn prepare(
        &self,
        feature: &Feature,
        facts: Facts,
        source: &dyn FeatureSource,
    ) -> Result<ComparedFeature> {
        let needed = PROGRAM + 2 * COMPARED_VERTEX * feature.geometry.vertices() as u64;
        // Checked before the copy is allocated.
        if needed > self.job.resources.memory.max(MIN_MEMORY) {
            let mib = needed.div_ceil(1 << 20);
            let message = format!("feature requires {mib} MiB of memory");
            let error = short(message, needed).in_file(Path::new(&self.job.original));
            return Err(error.at(source.location()));
        }
        let mut prepared = ComparedFeature::new(feature, facts);
        if self.format.holds.values == PropertySupport::Cells {
            prepared = prepared.one_row();
        }
        // Exact signs need products of coordinates within the range of floats.
        if prepared.vertices().flatten().any(|v| v.abs() >= 1e130) {
            return Err(Error::bad_input("coordinate exceeds 1e130").at(source.location()));
        }
        // Squares of distances between smaller ones underflow to 0.
        let is_fine = self.job.tolerance.is_some_and(|tolerance| tolerance.value < 1e-50);
        if is_fine && prepared.vertices().flatten().any(|v| *v != 0.0 && v.abs() < 1e-59) {
            let message = "coordinate below 1e-59: squared distances underflow";
            return Err(Error::bad_input(message)
                .at(source.location())
                .remedy("pass ‹tolerance› 1e-50 or more"));
        }
        Ok(prepared)
    }
}

/// A feature before and after.
struct FeaturePair<'a> {
    number: u64,
    before: &'a ComparedFeature,
    after: &'a ComparedFeature,
}

/// Comparison of heights and measures of a feature.
struct ZmComparison {
    /// False where the original has them and the format cannot store them.
    is_stored: [bool; 2],
    /// True where neither feature has any.
    is_none: bool,
    /// True where a missing height is stored as 0: a shapefile has heights for all of its features or
    /// for none.
    is_zero: bool,
    /// True where measures are timestamps with a resolution of a millisecond.
    is_coarse: bool,
}

impl ZmComparison {
    fn new(format: &VectorFormat, before: &ComparedFeature, after: &ComparedFeature) -> Self {
        let (had, has) = (before.has(), after.has());
        let holds = [format.holds.z, format.holds.m];
        let is_stored = [0, 1].map(|k| holds[k] || !had[k] || has[k] || after.is_empty());
        let is_zero = format.holds.values == PropertySupport::Dbase && has[0] && !had[0];
        let is_coarse = matches!(format.holds.values, PropertySupport::Named(_));
        let is_none = [had, has].iter().flatten().all(|has| !has);
        Self { is_stored, is_none, is_zero, is_coarse }
    }

    /// Heights and measures of a part of the original or of the lines, as far as the format stores
    /// them; empty without any.
    fn of(&self, part: &FeaturePart, is_original: bool) -> Vec<[f64; 2]> {
        if self.is_none {
            return Vec::new();
        }
        part.extras.iter().map(|&extras| self.comparable(extras, is_original)).collect()
    }

    /// A height and a measure as the format stores them; NaN for those that it cannot store.
    fn comparable(&self, [z, m]: [f64; 2], is_original: bool) -> [f64; 2] {
        let z = if self.is_zero && is_original { 0.0 } else { z };
        let m = if self.is_coarse { (m * 1e3).round() } else { m };
        [if self.is_stored[0] { z } else { f64::NAN }, if self.is_stored[1] { m } else { f64::NAN }]
    }

    /// True when points have other positions, heights or measures.
    fn differ(&self, before: &FeaturePart, after: &FeaturePart) -> bool {
        let [old, new] = [self.of(before, true), self.of(after, false)];
        !before.points.iter().map(key).eq(after.points.iter().map(key))
            || !old.iter().flatten().copied().map(bits).eq(new.iter().flatten().copied().map(bits))
    }
}

fn visit_gone(part: &FeaturePart, visit: &mut Visit<'_>) -> Result<()> {
    visit(PartVertices::of(&part.points), PartVertices::default(), part.is_ring())
}

/// The first property of a feature, to identify it in messages.
fn named(feature: &ComparedFeature) -> String {
    let first = feature.facts.first();
    first.map_or(String::new(), |(name, value)| format!(" ({name} {})", shown(value)))
}

/// Pairs of original and resulting features.
struct FeaturePartners<'a> {
    before: &'a [ComparedFeature],
    after: &'a [ComparedFeature],
    /// For each original feature its result, and for each result whether it has an original.
    of: Vec<Option<usize>>,
    made: Vec<bool>,
}

impl<'a> FeaturePartners<'a> {
    /// Candidates in order: equal attributes and vertices, then equal vertices, then equal attributes.
    /// An empty feature most likely was empty before.
    fn find(before: &'a [ComparedFeature], after: &'a [ComparedFeature]) -> Self {
        let (of, made) = (vec![None; before.len()], vec![false; after.len()]);
        let mut found = Self { before, after, of, made };
        let (having, mut stamped) = indices(before);
        found.by_vertices(&having, true);
        found.by_vertices(&having, false);
        found.by_facts(&mut stamped, true);
        found.by_facts(&mut stamped, false);
        found
    }

    fn by_vertices(&mut self, having: &Having, with_stamp: bool) {
        for number in 0..self.after.len() {
            if !self.made[number] {
                self.made[number] = self.pair(number, having, with_stamp, &mut HashSet::new());
            }
        }
    }

    /// Finds the original of a feature. Where all candidates are taken, one of their results moves to another
    /// candidate (augmenting path, Berge 1957): the vertices of a short line occur in many longer ones.
    fn pair(
        &mut self,
        number: usize,
        having: &Having,
        with_stamp: bool,
        tried: &mut HashSet<usize>,
    ) -> bool {
        let (before, after) = (self.before, self.after);
        let feature = &after[number];
        let first = feature.vertices().next();
        let Some(near) = first.and_then(|first| having.get(&key(first))) else { return false };
        for is_taken in [false, true] {
            for &old in near {
                if tried.len() >= MAX_TRIED {
                    return false;
                }
                let is_known = self.of[old].is_some() != is_taken || tried.contains(&old);
                let is_other = with_stamp && before[old].stamp != feature.stamp;
                if is_known || is_other || !match_parts(&before[old], feature).fits {
                    continue;
                }
                tried.insert(old);
                let is_free = match self.of[old] {
                    None => true,
                    // A pair with equal attributes is not given up for one with others.
                    Some(other) if !with_stamp && before[old].stamp == after[other].stamp => false,
                    Some(other) => self.pair(other, having, with_stamp, tried),
                };
                if is_free {
                    self.of[old] = Some(number);
                    return true;
                }
            }
        }
        false
    }

    fn by_facts(&mut self, stamped: &mut Stamped<'a>, is_alike: bool) {
        for (number, feature) in self.after.iter().enumerate() {
            let kind = (&*feature.stamp, feature.is_empty() == is_alike);
            let Some(same) = stamped.get_mut(&kind).filter(|_| !self.made[number]) else {
                continue;
            };
            let free = std::iter::from_fn(|| same.pop_front()).find(|&old| self.of[old].is_none());
            if let Some(old) = free {
                (self.of[old], self.made[number]) = (Some(number), true);
            }
        }
    }
}

/// Maximum number of features that are tried for one.
const MAX_TRIED: usize = 256;

/// The features that have a vertex at a position.
type Having = HashMap<[u64; 2], Vec<usize>>;
/// The features with a stamp, and without a vertex or with some.
type Stamped<'a> = HashMap<(&'a str, bool), VecDeque<usize>>;

fn indices(features: &[ComparedFeature]) -> (Having, Stamped<'_>) {
    let (mut having, mut stamped) = (Having::new(), Stamped::new());
    for (number, feature) in features.iter().enumerate() {
        for point in feature.vertices() {
            let numbers = having.entry(key(point)).or_default();
            if numbers.last() != Some(&number) {
                numbers.push(number);
            }
        }
        stamped.entry((&*feature.stamp, feature.is_empty())).or_default().push_back(number);
    }
    (having, stamped)
}
