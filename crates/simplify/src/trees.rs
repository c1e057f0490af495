//! Hierarchies of a feature: created once for each line of its split parts, then queried for any tolerance
//! instead of the method.

use std::time::Instant;

use super::tool::{
    DistanceKind, MetricTask, MetricTool, MetricVertex, SimplifyRule, check, vertices,
};
use terrane_base::error::{Error, Result};
use terrane_engine::plan::Digest;
use terrane_line::visvalingam::{AreaWeight, EffectiveAreas};
use terrane_line::{DistanceMetric, Hierarchy, SimplifyMethod, SimplifyScratch};
use terrane_vector::{Geometry, GeometryPart};

/// Size in bytes of the length before each hierarchy.
const LENGTH: usize = 8;

/// Hierarchies of a feature, in the order of its simplified lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FeatureHierarchies(Vec<Hierarchy>);

impl FeatureHierarchies {
    /// Builds the hierarchies of all lines of a geometry.
    ///
    /// # Errors
    /// A part that the metric does not support.
    pub(super) fn of(geometry: &Geometry, rule: &SimplifyRule) -> Result<Self> {
        geometry.parts().try_for_each(|part| check(&part, rule))?;
        Ok(Self(rule.apply(LineSplitting(geometry))))
    }

    /// Stored record of a geometry: digest of its coordinates, and the bytes of its hierarchies.
    pub(super) fn record(&self, geometry: &Geometry, measure: DistanceKind) -> Vec<u8> {
        let mut bytes = digest(geometry, measure).bytes().to_vec();
        for tree in &self.0 {
            let own = tree.to_bytes();
            bytes.extend((own.len() as u64).to_le_bytes());
            bytes.extend(own);
        }
        bytes
    }

    /// Hierarchies from their bytes.
    ///
    /// # Errors
    /// Invalid bytes.
    pub(super) fn from_bytes(mut bytes: &[u8]) -> Result<Self> {
        let mut trees = Vec::new();
        while let Some((length, rest)) = bytes.split_first_chunk::<LENGTH>() {
            let length = usize::try_from(u64::from_le_bytes(*length)).ok();
            let own = length.and_then(|length| rest.split_at_checked(length));
            let (own, rest) = own.ok_or_else(cut_short)?;
            trees.push(Hierarchy::from_bytes(own)?);
            bytes = rest;
        }
        if bytes.is_empty() { Ok(Self(trees)) } else { Err(cut_short()) }
    }

    /// Largest record size of a geometry in bytes.
    pub(super) fn max_bytes(geometry: &Geometry) -> u64 {
        let sizes = geometry.parts();
        let sizes = sizes.map(|part| 2 * (LENGTH + 24) as u64 + 8 * part.xy.len() as u64);
        Digest::BYTES as u64 + sizes.sum::<u64>()
    }
}

fn cut_short() -> Error {
    Error::bad_input("the hierarchy of a feature is truncated")
        .remedy("delete the file and run again")
}

/// Bytes of the coordinates used for distances, and of the structure of parts.
pub(super) fn digest(geometry: &Geometry, measure: DistanceKind) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for part in geometry.parts() {
        hasher.update(&head(&part)).update(bytemuck::cast_slice(part.xy));
        if measure == DistanceKind::Space {
            hasher.update(bytemuck::cast_slice(part.z));
        }
    }
    Digest(*hasher.finalize().as_bytes())
}

/// Type of a part, and its number of vertices.
fn head(part: &GeometryPart<'_>) -> [u8; 9] {
    let mut head = [u8::from(part.is_ring()); 9];
    head[1..].copy_from_slice(&(part.xy.len() as u64).to_le_bytes());
    head
}

/// Hierarchies not queried yet.
pub(super) struct PendingHierarchies<'a> {
    trees: &'a [Hierarchy],
    threshold: f64,
    /// Time of the queries.
    pub(super) seconds: f64,
}

impl<'a> PendingHierarchies<'a> {
    /// All hierarchies of a feature; none without a record.
    pub(super) fn of(trees: Option<&'a FeatureHierarchies>, threshold: f64) -> Self {
        Self { trees: trees.map_or(&[], |trees| &trees.0), threshold, seconds: 0.0 }
    }

    /// Appends the kept indices of the next line with this number of vertices; false without a hierarchy.
    pub(super) fn filter(&mut self, vertices: usize, kept: &mut Vec<u32>) -> bool {
        let Some((tree, left)) = self.trees.split_first() else { return false };
        if tree.count() != vertices {
            return false;
        }
        self.trees = left;
        let started = Instant::now();
        tree.filter(self.threshold, kept);
        self.seconds += started.elapsed().as_secs_f64();
        true
    }
}

/// Thresholds of the removable vertices of a geometry, from `trees` if given; distances of other methods are
/// close to those of Ramer-Douglas-Peucker.
///
/// # Errors
/// A part that the metric does not support.
pub(super) fn thresholds(
    geometry: &Geometry,
    trees: Option<&FeatureHierarchies>,
    rule: &SimplifyRule,
) -> Result<Vec<f64>> {
    if rule.method.bounds.weight().is_some() {
        geometry.parts().try_for_each(|part| check(&part, rule))?;
        return Ok(rule.apply(AreaWeighting(geometry)));
    }
    let made = match trees {
        Some(_) => FeatureHierarchies::default(),
        None => FeatureHierarchies::of(
            geometry,
            &SimplifyRule { method: &SimplifyMethod::RDP, ..*rule },
        )?,
    };
    let squares = trees.unwrap_or(&made).0.iter().flat_map(|tree| tree.squares());
    Ok(squares.filter(|square| **square > 0.0).map(|square| square.sqrt()).collect())
}

/// A geometry for areas of vertices.
struct AreaWeighting<'a>(&'a Geometry);

impl MetricTask for AreaWeighting<'_> {
    type Output = Vec<f64>;

    fn run<V: MetricVertex, M: DistanceMetric<V> + Copy>(
        self,
        tool: &MetricTool<V, M>,
    ) -> Vec<f64> {
        let (mut points, mut all) = (Vec::new(), Vec::new());
        let weight = tool.rule.method.bounds.weight().unwrap_or(AreaWeight::Plain);
        for part in self.0.parts() {
            vertices(&part, &mut points);
            let areas = match (part.is_ring(), points.len()) {
                (_, ..3) => continue,
                (true, count) => {
                    EffectiveAreas::of_ring(&tool.metric, &points[..count - 1], weight)
                }
                (false, _) => EffectiveAreas::of_line(&tool.metric, &points, weight),
            };
            all.extend(areas.areas().iter().filter(|area| **area > 0.0 && area.is_finite()));
        }
        all
    }
}

/// A geometry whose lines are split.
struct LineSplitting<'a>(&'a Geometry);

impl MetricTask for LineSplitting<'_> {
    type Output = Vec<Hierarchy>;

    fn run<V: MetricVertex, M: DistanceMetric<V> + Copy>(
        self,
        tool: &MetricTool<V, M>,
    ) -> Vec<Hierarchy> {
        let (mut points, mut kept) = (Vec::new(), Vec::new());
        let (mut scratch, mut trees) = (SimplifyScratch::default(), Vec::new());
        let mut split = |line: &[V], _: &mut SimplifyScratch, kept: &mut Vec<u32>| {
            trees.push(Hierarchy::new(&tool.metric, line));
            kept.extend(0..line.len() as u32);
        };
        for part in self.0.parts() {
            vertices(&part, &mut points);
            tool.select(&points, part.is_ring(), &mut split, &mut scratch, &mut kept);
        }
        trees
    }
}
