//! Visvalingam-Whyatt: again and again drop the vertex that makes the smallest triangle with its
//! neighbours.
//!
//! Visvalingam & Whyatt, "Line generalisation by repeated elimination of points" (1993). The effective
//! area of a vertex is that of its triangle when it goes, or the largest before it if that is more, so a
//! threshold and a number of vertices are both filters. Ties go by index, the lowest first. The method
//! bounds no distance: measure it with [`super::metric::largest_distance2`]. O(n log n) with an indexed
//! heap.

use super::metric::Metric;
use super::{Scratch, keep_short};

/// How the area of a triangle is weighted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Not at all.
    Plain,
    /// By `1 - 0.7 cos(angle at the vertex)`, as mapshaper does unless told otherwise: spikes go sooner,
    /// wide bends later.
    Angle,
}

/// Share of the cosine in [`Weight::Angle`].
const ANGLE: f64 = 0.7;

/// Appends to `kept` the vertices whose effective area is more than `area`.
pub fn visvalingam<V: Copy, M: Metric<V>>(
    metric: &M,
    points: &[V],
    area: f64,
    _: &mut Scratch,
    kept: &mut Vec<u32>,
) {
    if !keep_short(points.len(), kept) {
        Areas::of_line(metric, points, Weight::Plain).filter(area, kept);
    }
}

/// As [`visvalingam`], with areas weighted by the angle.
pub fn weighted_visvalingam<V: Copy, M: Metric<V>>(
    metric: &M,
    points: &[V],
    area: f64,
    _: &mut Scratch,
    kept: &mut Vec<u32>,
) {
    if !keep_short(points.len(), kept) {
        Areas::of_line(metric, points, Weight::Angle).filter(area, kept);
    }
}

/// Effective areas of a line's vertices, and the order in which they go.
#[derive(Clone, Debug, PartialEq)]
pub struct Areas {
    /// One a vertex; infinite for those that never go.
    areas: Vec<f64>,
    /// Vertices that go, in that order.
    order: Vec<u32>,
}

impl Areas {
    /// The areas of a line, whose ends stay.
    pub fn of_line<V: Copy, M: Metric<V>>(metric: &M, points: &[V], weight: Weight) -> Self {
        match weight {
            Weight::Plain => Chain::line(points.len()).dissolve(points, plain(metric)),
            Weight::Angle => Chain::line(points.len()).dissolve(points, by_angle(metric)),
        }
    }

    /// The areas of a ring, given without its closing vertex; its last three vertices stay.
    pub fn of_ring<V: Copy, M: Metric<V>>(metric: &M, points: &[V], weight: Weight) -> Self {
        match weight {
            Weight::Plain => Chain::ring(points.len()).dissolve(points, plain(metric)),
            Weight::Angle => Chain::ring(points.len()).dissolve(points, by_angle(metric)),
        }
    }

    /// The effective area of each vertex, in squared units of distance (weighted, if they are).
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Appends the vertices whose effective area is more than `area`; linear in the line.
    pub fn filter(&self, area: f64, kept: &mut Vec<u32>) {
        let above = self.areas.iter().zip(0..).filter(|(own, _)| **own > area);
        kept.extend(above.map(|(_, i)| i));
    }

    /// Appends the `count` vertices that stay longest, at least those that never go; linear in the line.
    pub fn keep_count(&self, count: usize, kept: &mut Vec<u32>) {
        let gone = self.areas.len().saturating_sub(count).min(self.order.len());
        let mut stays = vec![true; self.areas.len()];
        self.order[..gone].iter().for_each(|i| stays[*i as usize] = false);
        kept.extend(stays.iter().zip(0..).filter(|(stays, _)| **stays).map(|(_, i)| i));
    }
}

fn plain<V: Copy, M: Metric<V>>(metric: &M) -> impl Fn(&V, &V, &V) -> f64 {
    |a, b, c| metric.area(a, b, c)
}

fn by_angle<V: Copy, M: Metric<V>>(metric: &M) -> impl Fn(&V, &V, &V) -> f64 {
    |a, b, c| metric.area(a, b, c) * (1.0 - ANGLE * metric.cosine(a, b, c))
}

/// The vertices still there, each with its neighbours.
struct Chain {
    neighbours: Vec<[u32; 2]>,
    /// Vertices before this one stay, and those from `end` on.
    start: u32,
    end: u32,
    /// How many of the others stay at last.
    least: usize,
}

impl Chain {
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

    /// Takes away vertex after vertex.
    fn dissolve<V>(mut self, points: &[V], area: impl Fn(&V, &V, &V) -> f64) -> Areas {
        let of = |i: u32, [before, after]: [u32; 2]| {
            area(&points[before as usize], &points[i as usize], &points[after as usize])
        };
        let mut areas = vec![f64::INFINITY; points.len()];
        let first =
            (self.start..self.end).map(|i| Entry { key: of(i, self.neighbours[i as usize]), i });
        let mut heap = Heap::new(first.collect(), points.len());
        let mut order = Vec::with_capacity(heap.entries.len().saturating_sub(self.least));
        let mut most = 0.0_f64;
        while heap.entries.len() > self.least {
            let Entry { key, i } = heap.pop();
            most = most.max(key);
            areas[i as usize] = most;
            order.push(i);
            let [before, after] = self.neighbours[i as usize];
            self.neighbours[before as usize][1] = after;
            self.neighbours[after as usize][0] = before;
            for near in [before, after] {
                if (self.start..self.end).contains(&near) {
                    heap.change(near, of(near, self.neighbours[near as usize]));
                }
            }
        }
        Areas { areas, order }
    }
}

/// A vertex and its present area.
#[derive(Clone, Copy)]
struct Entry {
    key: f64,
    i: u32,
}

impl Entry {
    #[inline(always)]
    fn is_before(&self, other: &Self) -> bool {
        self.key < other.key || (self.key == other.key && self.i < other.i)
    }
}

/// Children of a place in the heap.
const WAYS: usize = 4;

/// A heap, the smallest area on top, that knows where each vertex is.
struct Heap {
    entries: Vec<Entry>,
    places: Vec<u32>,
}

impl Heap {
    /// A heap of entries of vertices below `count`.
    fn new(entries: Vec<Entry>, count: usize) -> Self {
        let mut places = vec![0; count];
        entries.iter().zip(0..).for_each(|(entry, place)| places[entry.i as usize] = place);
        let mut heap = Self { entries, places };
        let inner = heap.entries.len().saturating_sub(1).div_ceil(WAYS);
        for place in (0..inner).rev() {
            heap.sink(place, heap.entries[place]);
        }
        heap
    }

    /// Takes the smallest entry; there is one.
    fn pop(&mut self) -> Entry {
        let top = self.entries[0];
        if let Some(last) = self.entries.pop().filter(|_| !self.entries.is_empty()) {
            self.sink(0, last);
        }
        top
    }

    /// Gives a vertex of the heap another area.
    fn change(&mut self, i: u32, key: f64) {
        let place = self.places[i as usize] as usize;
        let entry = Entry { key, i };
        match entry.is_before(&self.entries[place]) {
            true => self.rise(place, entry),
            false => self.sink(place, entry),
        }
    }

    #[inline(always)]
    fn put(&mut self, place: usize, entry: Entry) {
        self.entries[place] = entry;
        self.places[entry.i as usize] = place as u32;
    }

    /// Puts an entry at `place` or above.
    fn rise(&mut self, mut place: usize, entry: Entry) {
        while place > 0 {
            let parent = (place - 1) / WAYS;
            if !entry.is_before(&self.entries[parent]) {
                break;
            }
            self.put(place, self.entries[parent]);
            place = parent;
        }
        self.put(place, entry);
    }

    /// Puts an entry at `place` or below.
    fn sink(&mut self, mut place: usize, entry: Entry) {
        loop {
            let first = place * WAYS + 1;
            let end = (first + WAYS).min(self.entries.len());
            if first >= end {
                break;
            }
            let mut least = first;
            for child in first + 1..end {
                if self.entries[child].is_before(&self.entries[least]) {
                    least = child;
                }
            }
            if !self.entries[least].is_before(&entry) {
                break;
            }
            self.put(place, self.entries[least]);
            place = least;
        }
        self.put(place, entry);
    }
}
