//! The parts of simplified features beside those they were made from.

use std::collections::{HashMap, HashSet};

use super::LineVerifyJob;
use crate::error::{Error, ErrorKind, Result};
use crate::pipeline::memory::PROGRAM;
use crate::pipeline::{Cancel, Progress};
use crate::vector::{self, Feature, FeatureSource, OpenOptions};

/// Bytes for each vertex of either file where all features have to be held.
const VERTEX: u64 = 180;
/// Bytes for each vertex of the feature that is looked at.
const OWN_VERTEX: u64 = 96;
/// What is taken whatever the budget is.
const LEAST: u64 = 16 << 20;

/// Features of both files. They come in the same order, or, from formats that sort them, in any.
pub(super) struct Pairs<'a> {
    job: &'a LineVerifyJob,
    cancel: &'a Cancel,
    /// The features of both files, once it is known that they are not in the same order.
    held: Option<Held>,
}

/// All features, and for each of the original the one made from it.
struct Held {
    before: Vec<Own>,
    after: Vec<Own>,
    partners: Vec<Option<usize>>,
}

/// How a comparison went.
pub(super) enum Compared {
    /// Every feature had its partner; how many there are.
    All(u64),
    /// Features are not in the same order: collect them first.
    OutOfOrder,
}

/// Takes a part before and after (without vertices when it is gone), and whether it is a ring.
pub(super) type Visit<'a> = dyn FnMut(&[[f64; 3]], &[[f64; 3]], bool) -> Result<()> + 'a;

impl<'a> Pairs<'a> {
    pub(super) fn new(job: &'a LineVerifyJob, cancel: &'a Cancel) -> Self {
        Self { job, cancel, held: None }
    }

    /// Visits all parts in the order of the original.
    pub(super) fn each(&self, progress: &dyn Progress, visit: &mut Visit<'_>) -> Result<Compared> {
        let Some(Held { before, after, partners }) = &self.held else {
            return self.side_by_side(progress, visit);
        };
        for (before, partner) in before.iter().zip(partners) {
            self.cancel.check()?;
            progress.advance(1);
            let gone = || vec![None; before.parts.len()];
            let placed = partner.and_then(|own| beside(before, &after[own])).unwrap_or_else(gone);
            visit_parts(before, &placed, visit)?;
        }
        Ok(Compared::All(before.len() as u64))
    }

    /// Visits parts while both files are read.
    fn side_by_side(&self, progress: &dyn Progress, visit: &mut Visit<'_>) -> Result<Compared> {
        let [mut original, mut lines] = self.open()?;
        let mut features = 0;
        loop {
            self.cancel.check()?;
            progress.advance(1);
            let (before, after) = match (original.next()?, lines.next()?) {
                (None, None) => return Ok(Compared::All(features)),
                (Some(before), Some(after)) => (before, after),
                (before, after) => {
                    let begun = [before.is_some(), after.is_some()].map(u64::from);
                    let rest = [self.rest(&mut *original)?, self.rest(&mut *lines)?];
                    return Err(self.uneven([0, 1].map(|file| features + begun[file] + rest[file])));
                }
            };
            let (before, after) = (self.own(before, &*original)?, self.own(after, &*lines)?);
            let Some(placed) = beside(&before, &after) else { return Ok(Compared::OutOfOrder) };
            visit_parts(&before, &placed, visit)?;
            features += 1;
        }
    }

    /// How many features are left of a file.
    fn rest(&self, source: &mut dyn FeatureSource) -> Result<u64> {
        let mut count = 0;
        while source.next()?.is_some() {
            self.cancel.check()?;
            count += 1;
        }
        Ok(count)
    }

    /// Holds all features and finds out which were made from which.
    pub(super) fn collect(&mut self) -> Result<()> {
        let [mut original, mut lines] = self.open()?;
        let mut held = 0;
        let mut read = |source: &mut dyn FeatureSource| {
            let mut all = Vec::new();
            while let Some(feature) = source.next()? {
                self.cancel.check()?;
                held += feature.geometry.vertices() as u64 * VERTEX;
                if held > self.job.resources.memory {
                    let message = "features are in another order than those they were made from, \
                                   and more than memory holds";
                    return Err(Error::new(ErrorKind::Resource, message)
                        .in_file(&self.job.lines)
                        .remedy(
                            "pass more --memory, or write lines to a format that keeps the order",
                        ));
                }
                all.push(self.own(feature, source)?);
            }
            Ok(all)
        };
        let (before, after) = (read(&mut *original)?, read(&mut *lines)?);
        if before.len() != after.len() {
            return Err(self.uneven([before.len() as u64, after.len() as u64]));
        }
        let partners = partners(&before, &after).map_err(|e| e.in_file(&self.job.lines))?;
        self.held = Some(Held { before, after, partners });
        Ok(())
    }

    fn open(&self) -> Result<[Box<dyn FeatureSource>; 2]> {
        let options = OpenOptions { layer: self.job.layer.clone() };
        let original = vector::open(&self.job.original, &options)?;
        Ok([original, vector::open(&self.job.lines, &OpenOptions::default())?])
    }

    fn own(&self, feature: Feature, source: &dyn FeatureSource) -> Result<Own> {
        let needed = PROGRAM + 2 * OWN_VERTEX * feature.geometry.vertices() as u64;
        let own = Own::of(&feature);
        // Products of larger ones could not be told exactly.
        let is_sound = |p: &[f64; 3]| p.iter().all(|v| v.abs() < 1e130);
        if !own.parts.iter().all(|(points, _)| points.iter().all(is_sound)) {
            return Err(Error::bad_input("a coordinate is beyond 1e130").at(source.place()));
        }
        if needed > self.job.resources.memory.max(LEAST) {
            let needed = needed.div_ceil(1 << 20);
            let message = format!("a feature as large as this takes {needed} MiB of memory");
            return Err(Error::new(ErrorKind::Resource, message)
                .in_file(&self.job.original)
                .at(source.place())
                .remedy(format!("pass --memory {needed}M or more")));
        }
        Ok(own)
    }

    fn uneven(&self, [before, after]: [u64; 2]) -> Error {
        let how = if after < before { "fewer" } else { "more" };
        Error::bad_input(format!("has {how} features than the original: {after}, not {before}"))
            .in_file(&self.job.lines)
            .remedy("name the file that it was made from")
    }
}

fn visit_parts(before: &Own, placed: &Placed<'_>, visit: &mut Visit<'_>) -> Result<()> {
    for ((part, is_ring), own) in before.parts.iter().zip(placed) {
        let own = own.map_or(&[][..], |(points, _)| points);
        if *is_ring && is_backward(part, own) {
            visit(part, &own.iter().rev().copied().collect::<Vec<_>>(), true)?;
        } else {
            visit(part, own, *is_ring)?;
        }
    }
    Ok(())
}

/// The vertices of a part, and whether it is a ring.
type OwnPart = (Vec<[f64; 3]>, bool);

/// A feature.
struct Own {
    parts: Vec<OwnPart>,
    /// Its id and properties, to tell it from others.
    stamp: String,
}

impl Own {
    fn of(feature: &Feature) -> Self {
        let of = |part: vector::Part<'_>| {
            let z = |i: usize| part.z.get(i).copied().filter(|z| z.is_finite()).unwrap_or(0.0);
            let points = part.xy.iter().enumerate().map(|(i, [x, y])| [*x, *y, z(i)]);
            (points.collect(), part.is_ring())
        };
        let values: Vec<_> = feature.properties.iter().map(|(_, value)| value).collect();
        let stamp = format!("{:?} {values:?}", feature.id);
        Self { parts: feature.geometry.parts().map(of).collect(), stamp }
    }
}

/// For each part of a feature before what it became, if it is still there.
type Placed<'a> = Vec<Option<&'a OwnPart>>;

/// For each feature before the one made from it, found by its vertices.
fn partners(before: &[Own], after: &[Own]) -> Result<Vec<Option<usize>>> {
    let mut having: HashMap<[u64; 2], Vec<usize>> = HashMap::new();
    for (number, feature) in before.iter().enumerate() {
        for point in feature.parts.iter().flat_map(|(points, _)| points) {
            let numbers = having.entry(key(point)).or_default();
            if numbers.last() != Some(&number) {
                numbers.push(number);
            }
        }
    }
    let mut partners: Vec<Option<usize>> = vec![None; before.len()];
    for (number, feature) in after.iter().enumerate() {
        let firsts = feature.parts.iter().find_map(|(points, _)| points.first());
        let Some(first) = firsts else { continue };
        let candidates = having.get(&key(first)).map_or(&[][..], Vec::as_slice);
        let mut free: Vec<usize> =
            candidates.iter().copied().filter(|own| partners[*own].is_none()).collect();
        // A small one may lie on the vertices of a neighbour: first those that are like it.
        free.sort_by_key(|own| {
            let own = &before[*own];
            (own.stamp != feature.stamp, own.parts.len() != feature.parts.len())
        });
        let own = free.into_iter().find(|own| beside(&before[*own], feature).is_some());
        let own = own.ok_or_else(|| {
            let message = format!("feature {number} was made from none of the original");
            Error::bad_input(message).remedy("name the file that it was made from")
        })?;
        partners[own] = Some(number);
    }
    Ok(partners)
}

/// The parts of a feature beside those they were made from: all of them, or, where some are gone, those
/// whose vertices they have. `None` when one was made from none.
fn beside<'a>(before: &Own, after: &'a Own) -> Option<Placed<'a>> {
    let (before, after) = (&before.parts, &after.parts);
    let one_to_one = before.len() == after.len()
        && before.iter().zip(after).all(|(before, after)| before.1 == after.1);
    let is_near = |part: &OwnPart, own: &OwnPart| {
        let first = own.0.first().map(key);
        part.0.iter().any(|point| Some(key(point)) == first)
    };
    if one_to_one && before.iter().zip(after).all(|(part, own)| is_near(part, own)) {
        return Some(after.iter().map(Some).collect());
    }
    let mut left = after.iter().peekable();
    let mut placed = Vec::new();
    for (part, is_ring) in before {
        let known: HashSet<[u64; 2]> = part.iter().map(key).collect();
        let is_of = |(points, ring): &OwnPart| {
            *ring == *is_ring && points.iter().all(|point| known.contains(&key(point)))
        };
        let is_near =
            |(points, _): &OwnPart| points.iter().any(|point| known.contains(&key(point)));
        placed.push(left.next_if(|next| is_of(next) || (one_to_one && is_near(next))));
    }
    left.next().is_none().then_some(placed)
}

/// True for a ring whose vertices come in the opposite order of those of `part`: formats have rules of
/// their own for the direction of rings.
fn is_backward(part: &[[f64; 3]], ring: &[[f64; 3]]) -> bool {
    if let Some(is_backward) = order_of_three(part, ring) {
        return is_backward;
    }
    let places: HashMap<_, _> = part.iter().zip(0..).map(|(point, at)| (key(point), at)).collect();
    let along: Vec<i64> =
        ring.iter().filter_map(|point| places.get(&key(point)).copied()).collect();
    // Once around there is one step back, where the numbers begin again.
    let back = along.windows(2).filter(|pair| pair[1] < pair[0]).count();
    2 * back > along.len().saturating_sub(1)
}

/// Whether the first three vertices of a ring are in `part` the other way round; `None` where that is
/// not to be told from them.
fn order_of_three(part: &[[f64; 3]], ring: &[[f64; 3]]) -> Option<bool> {
    let three = [ring.first()?, ring.get(1)?, ring.get(2)?].map(key);
    let mut places = [None; 3];
    for (at, point) in part.iter().skip(1).map(key).enumerate() {
        for (place, _) in places.iter_mut().zip(three).filter(|(_, vertex)| *vertex == point) {
            if place.replace(at).is_some() {
                return None;
            }
        }
    }
    let [Some(a), Some(b), Some(c)] = places else { return None };
    // Once around there is one step back, or two the other way round.
    let ahead = [(a, b), (b, c), (c, a)].iter().filter(|(from, to)| from < to).count();
    (a != b && b != c && c != a).then_some(ahead < 2)
}

/// A position in the plane as bits, where 0 and -0 are the same.
fn key(point: &[f64; 3]) -> [u64; 2] {
    [(point[0] + 0.0).to_bits(), (point[1] + 0.0).to_bits()]
}
