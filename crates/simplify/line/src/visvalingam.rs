//! Visvalingam-Whyatt: repeatedly removes the vertex with the smallest triangle.
//!
//! Visvalingam & Whyatt, "Line generalisation by repeated elimination of points" (1993). The effective area of
//! a vertex is that of its triangle at removal, or the largest area removed before, so a threshold and a number
//! of vertices are both filters. Ties go by index, lowest first. Distances are not bounded: measure with
//! [`super::metric::largest_distance2`]. O(n log n), with a bucket queue and a heap.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::metric::DistanceMetric;
use super::scratch::{SimplifyScratch, keep_short};

/// Weight of a triangle's area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AreaWeight {
    /// No weight.
    Plain,
    /// `1 - 0.7 cos(angle at the vertex)`, the default of mapshaper: spikes go sooner, wide bends later.
    Angle,
}

/// Factor of the cosine in [`AreaWeight::Angle`].
const ANGLE: f64 = 0.7;

/// Appends to `kept` the vertices whose effective area is more than `area`.
pub fn visvalingam<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    area: f64,
    _: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) {
    if !keep_short(points.len(), kept) {
        EffectiveAreas::of_line(metric, points, AreaWeight::Plain).filter(area, kept);
    }
}

/// As [`visvalingam`], with areas weighted by the angle.
pub fn weighted_visvalingam<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    area: f64,
    _: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) {
    if !keep_short(points.len(), kept) {
        EffectiveAreas::of_line(metric, points, AreaWeight::Angle).filter(area, kept);
    }
}

/// Effective areas of a line's vertices, and the order of removal.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectiveAreas {
    /// One per vertex; infinite for vertices that stay.
    areas: Vec<f64>,
    /// Removed vertices in order.
    order: Vec<u32>,
}

impl EffectiveAreas {
    /// Areas of a line with fixed ends.
    pub fn of_line<V: Copy, M: DistanceMetric<V>>(
        metric: &M,
        points: &[V],
        weight: AreaWeight,
    ) -> Self {
        match weight {
            AreaWeight::Plain => VertexChain::line(points.len()).dissolve(points, plain(metric)),
            AreaWeight::Angle => VertexChain::line(points.len()).dissolve(points, by_angle(metric)),
        }
    }

    /// Areas of a ring without its closing vertex; the last three vertices stay.
    pub fn of_ring<V: Copy, M: DistanceMetric<V>>(
        metric: &M,
        points: &[V],
        weight: AreaWeight,
    ) -> Self {
        match weight {
            AreaWeight::Plain => VertexChain::ring(points.len()).dissolve(points, plain(metric)),
            AreaWeight::Angle => VertexChain::ring(points.len()).dissolve(points, by_angle(metric)),
        }
    }

    /// Effective area of each vertex, in squared units of distance, weighted if requested.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Appends the vertices whose effective area is more than `area`; linear in the line.
    pub fn filter(&self, area: f64, kept: &mut Vec<u32>) {
        let above = self.areas.iter().zip(0..).filter(|(own, _)| **own > area);
        kept.extend(above.map(|(_, i)| i));
    }

    /// Appends the last `count` vertices to be removed, at least those that stay; linear in the line.
    pub fn keep_count(&self, count: usize, kept: &mut Vec<u32>) {
        let gone = self.areas.len().saturating_sub(count).min(self.order.len());
        let mut stays = vec![true; self.areas.len()];
        self.order[..gone].iter().for_each(|i| stays[*i as usize] = false);
        kept.extend(stays.iter().zip(0..).filter(|(stays, _)| **stays).map(|(_, i)| i));
    }
}

fn plain<V: Copy, M: DistanceMetric<V>>(metric: &M) -> impl Fn(&V, &V, &V) -> f64 {
    |a, b, c| metric.area(a, b, c)
}

fn by_angle<V: Copy, M: DistanceMetric<V>>(metric: &M) -> impl Fn(&V, &V, &V) -> f64 {
    |a, b, c| metric.area(a, b, c) * (1.0 - ANGLE * metric.cosine(a, b, c))
}

/// Marker for removed vertices instead of neighbours.
const GONE: u32 = u32::MAX;

/// Remaining vertices with their neighbours.
struct VertexChain {
    neighbours: Vec<[u32; 2]>,
    /// Vertices before this one stay, and those from `end` on.
    start: u32,
    end: u32,
    /// Number of others that stay.
    least: usize,
}

impl VertexChain {
    fn line(count: usize) -> Self {
        let n = count as u32;
        let neighbours = (0..n).map(|i| [i.wrapping_sub(1), i + 1]).collect();
        Self { neighbours, start: 1.min(n), end: n.saturating_sub(1).max(1.min(n)), least: 0 }
    }

    fn ring(count: usize) -> Self {
        let n = count as u32;
        let around =
            |i: u32| [if i == 0 { n - 1 } else { i - 1 }, if i + 1 == n { 0 } else { i + 1 }];
        Self { neighbours: (0..n).map(around).collect(), start: 0, end: n, least: 3 }
    }

    /// Removes vertices one by one.
    fn dissolve<V>(mut self, points: &[V], area: impl Fn(&V, &V, &V) -> f64) -> EffectiveAreas {
        let of = |i: u32, [before, after]: [u32; 2]| {
            area(&points[before as usize], &points[i as usize], &points[after as usize])
        };
        let inner = self.start..self.end;
        let mut areas = vec![f64::INFINITY; points.len()];
        for i in inner.clone() {
            areas[i as usize] = of(i, self.neighbours[i as usize]);
        }
        let mut queue =
            AreaQueue::new(inner.clone().map(|i| VertexArea { key: areas[i as usize], i }));
        let gone = inner.len().saturating_sub(self.least);
        let mut order = Vec::with_capacity(gone);
        let mut most = 0.0_f64;
        while order.len() < gone {
            // Tests the whole bucket first, so that memory is fetched in parallel; one by one, the removals
            // would wait for each.
            let smallest = queue.pop(|entry| {
                let near = self.neighbours[entry.i as usize];
                near[0] != GONE && of(entry.i, near) == entry.key
            });
            let Some(VertexArea { key, i }) = smallest else { break };
            let [before, after] = self.neighbours[i as usize];
            // Stale: the area changed, or the vertex was removed.
            if before == GONE || areas[i as usize] != key {
                continue;
            }
            most = most.max(key);
            order.push(i);
            areas[i as usize] = most;
            self.neighbours[i as usize] = [GONE; 2];
            self.neighbours[before as usize][1] = after;
            self.neighbours[after as usize][0] = before;
            for near in [before, after] {
                if inner.contains(&near) {
                    let key = of(near, self.neighbours[near as usize]);
                    if key != areas[near as usize] {
                        areas[near as usize] = key;
                        queue.push(VertexArea { key, i: near });
                    }
                }
            }
        }
        for i in inner.filter(|i| self.neighbours[*i as usize][0] != GONE) {
            areas[i as usize] = f64::INFINITY;
        }
        EffectiveAreas { areas, order }
    }
}

/// A vertex and its area at some time.
#[derive(Clone, Copy)]
struct VertexArea {
    key: f64,
    i: u32,
}

impl PartialEq for VertexArea {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for VertexArea {}

impl PartialOrd for VertexArea {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for VertexArea {
    /// The smallest area is the greatest entry, with the lowest index among equals.
    fn cmp(&self, other: &Self) -> Ordering {
        other.key.total_cmp(&self.key).then(other.i.cmp(&self.i))
    }
}

/// Approximate number of entries per bucket.
const CROWD: usize = 256;

/// Entries by area, smallest first: a heap of the smallest, and buckets of the others by the leading bits of
/// their areas. The heap stays small enough for the cache.
struct AreaQueue {
    heap: BinaryHeap<VertexArea>,
    /// Bits of the smallest positive area, that of the first bucket.
    least: u64,
    /// Bits per bucket.
    shift: u32,
    /// The buckets before this one are in the heap.
    at: usize,
    buckets: Vec<Vec<VertexArea>>,
}

impl AreaQueue {
    fn new(entries: impl ExactSizeIterator<Item = VertexArea> + Clone) -> Self {
        // Bits of non-negative floats have the order of the floats.
        let bits = entries.clone().map(|entry| entry.key.to_bits()).filter(|bits| *bits > 0);
        let (least, most) = (bits.clone().min().unwrap_or(0), bits.max().unwrap_or(0));
        let wanted = (entries.len() / CROWD).max(1) as u64;
        let shift = ((most - least) / wanted).max(1).ilog2() + 1;
        let count = ((most - least) >> shift) as usize + 1;
        let mut queue =
            Self { heap: BinaryHeap::new(), least, shift, at: 0, buckets: vec![Vec::new(); count] };
        entries.for_each(|entry| queue.push(entry));
        queue
    }

    /// Adds an entry, to the heap if it is small enough.
    #[inline]
    fn push(&mut self, entry: VertexArea) {
        let bits = entry.key.to_bits();
        // Areas below the least at the start come up as neighbours go, 0 among them: first bucket.
        let bucket = (bits.saturating_sub(self.least) >> self.shift) as usize;
        let bucket = bucket.min(self.buckets.len() - 1);
        match bucket < self.at {
            true => self.heap.push(entry),
            false => self.buckets[bucket].push(entry),
        }
    }

    /// Removes the smallest entry; from a new bucket, only valid entries enter the heap.
    #[inline]
    fn pop(&mut self, is_present: impl Fn(&VertexArea) -> bool) -> Option<VertexArea> {
        while self.heap.is_empty() {
            let mut bucket = std::mem::take(self.buckets.get_mut(self.at)?);
            self.at += 1;
            bucket.retain(&is_present);
            self.heap = BinaryHeap::from(bucket);
        }
        self.heap.pop()
    }
}
