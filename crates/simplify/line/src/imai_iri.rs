//! Imai-Iri: the minimum number of vertices for a tolerance.
//!
//! Imai & Iri, "Polygonal approximations of a curve" (1988): a shortest path by breadth-first search in the
//! graph of all segments between two vertices of the line that pass the vertices between them within the
//! tolerance. Segments from a vertex are found with a wedge of directions that is narrowed until it is empty
//! (Chan & Chin 1996, with early termination). Most of this work is avoided:
//!
//! - A vertex is skipped if nothing unvisited is in its reach. The few vertices that end the wedge of one
//!   vertex usually end those of its neighbours as well, which bounds the reach in three steps.
//! - A wedge narrowed by a subset of the vertices contains the directions that pass all. A few vertices narrow
//!   it almost completely, so hardly any unvisited vertex within the bound is left in it, and directions are
//!   compared in parallel. Each remaining vertex is tested separately, first against the vertex that blocked the
//!   last segment to it; a blocking vertex narrows the wedge, and gives a minimum distance of the segment end.
//! - Long segments are tested against regions of vertices.
//!
//! Segments whose ends are as far apart as anything they pass are accepted by the wedge alone. When the path is
//! found, each of its segments is checked with the formula of [`super::metric`]; if one fails because of
//! rounding, the search is repeated with all segments checked before they are accepted. So the result is that
//! of an exhaustive search by the formula, with one exception: if the second search takes more than 2000 tests
//! per vertex, which happens for tolerances below the rounding error of long straight lines, the failing
//! segments of the first are replaced by those of the [cone](super::cone).
//!
//! Memory O(n); time O(n^2) at worst, almost linear on irregular lines.

use super::cone::cone;
use super::metric::DistanceMetric;
use super::metric::range::larger;
use super::regions::{VertexRegions, farthest_beyond, first_beyond, last_above};
use super::scratch::{PathNode, SimplifyScratch, keep_short};
use super::wedge::{MAX_SIDES, Wedge, WedgeStep, first_inside};

/// No vertex.
const NONE: u32 = u32::MAX;

/// Where the first unvisited vertex is less than so many vertices away, all narrow the wedge.
const NEAR: usize = 4;

/// Segments over more vertices are tested against regions of them.
const LONG: usize = 128;

/// Tests per vertex of the line before the second search is abandoned.
const LOOKS: u64 = 2000;

/// Smallest number of tests.
const FEWEST_LOOKS: u64 = 1 << 20;

/// Whether the segment between a pair of vertices passes all between within the tolerance.
fn holds<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    pair: &[u32],
    tolerance: f64,
) -> bool {
    let (from, to) = (pair[0] as usize, pair[1] as usize);
    first_beyond(metric, points, from, to, tolerance * tolerance).is_none()
}

/// Appends to `kept` the fewest vertices whose segments pass all others within `tolerance`.
pub fn imai_iri<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
    scratch: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) {
    if keep_short(points.len(), kept) {
        return;
    }
    let from = kept.len();
    ShortcutSearch::run(metric, points, tolerance, None, scratch, kept);
    if kept[from..].windows(2).all(|pair| holds(metric, points, pair, tolerance)) {
        return;
    }
    let path = kept.split_off(from);
    let looks = FEWEST_LOOKS + LOOKS * points.len() as u64;
    if ShortcutSearch::run(metric, points, tolerance, Some(looks), scratch, kept) {
        return;
    }
    kept.push(0);
    for pair in path.windows(2) {
        if holds(metric, points, pair, tolerance) {
            kept.push(pair[1]);
            continue;
        }
        let at = kept.len();
        let part = &points[pair[0] as usize..=pair[1] as usize];
        cone(metric, part, tolerance, scratch, kept);
        kept[at..].iter_mut().for_each(|i| *i += pair[0]);
        kept.remove(at);
    }
}

/// Vertices that empty the wedge of a vertex, ascending: the last to cut each side, and the one that emptied
/// it.
#[derive(Clone, Copy)]
struct DirectionWitness([u32; MAX_SIDES + 1]);

impl DirectionWitness {
    const NONE: Self = Self([NONE; MAX_SIDES + 1]);

    /// Records the vertices that cut each side.
    #[inline(always)]
    fn note(&mut self, mut cuts: u32, by: usize) {
        while cuts != 0 {
            self.0[cuts.trailing_zeros() as usize] = by as u32;
            cuts &= cuts - 1;
        }
    }
}

/// The view from a vertex past some others.
struct VisibilityWedge<W> {
    wedge: W,
    /// Smallest squared distance of visible vertices.
    min_span2: f64,
    /// Vertices that narrowed the wedge.
    witness: DirectionWitness,
    /// True if others than the last witness did.
    is_new: bool,
}

impl<W> VisibilityWedge<W> {
    /// Narrows the wedge by vertex `i`.
    #[inline(always)]
    fn pass<V>(&mut self, points: &[V], i: usize) -> WedgeStep
    where
        W: Wedge<V>,
    {
        let step = self.wedge.step(&points[i]);
        self.witness.note(self.wedge.cuts(), i);
        step
    }
}

/// A breadth-first search in progress.
struct ShortcutSearch<'a, V: Copy, M: DistanceMetric<V>> {
    metric: &'a M,
    points: &'a [V],
    tolerance: f64,
    tolerance2: f64,
    nodes: &'a mut [PathNode],
    /// Vertices of the next layer.
    found: &'a mut Vec<u32>,
    witness: DirectionWitness,
    /// A distant vertex that blocked segments.
    outermost: usize,
    /// Built for the first long segment.
    tree: Option<VertexRegions<M::Region>>,
    /// Remaining tests, if every segment is checked with the formula.
    looks: Option<u64>,
}

impl<'a, V: Copy, M: DistanceMetric<V>> ShortcutSearch<'a, V, M> {
    /// Searches and appends the path; returns `false` without a path if the tests run out.
    fn run(
        metric: &'a M,
        points: &'a [V],
        tolerance: f64,
        looks: Option<u64>,
        scratch: &'a mut SimplifyScratch,
        kept: &mut Vec<u32>,
    ) -> bool {
        let SimplifyScratch { nodes, layer, next_layer: found, .. } = scratch;
        nodes.clear();
        nodes.extend((0..points.len() as u32).map(|i| PathNode {
            parent: NONE,
            spoiler: 0,
            next: i,
        }));
        found.clear();
        let mut search = Self {
            metric,
            points,
            tolerance,
            tolerance2: tolerance * tolerance,
            nodes,
            found,
            witness: DirectionWitness::NONE,
            outermost: 0,
            tree: None,
            looks,
        };
        // The first vertex is its own parent, as `NONE` stands for one that is not reached.
        search.visit(0, 0);
        search.reach(points.len() - 1, layer);
        let is_found = search.is_visited(points.len() - 1);
        if is_found {
            search.path(points.len() - 1, kept);
        }
        is_found
    }

    /// Visits layers until `last` is visited.
    fn reach(&mut self, last: usize, layer: &mut Vec<u32>) {
        while !self.found.is_empty() {
            std::mem::swap(layer, self.found);
            self.found.clear();
            // The farthest first: they leave the least to test.
            layer.sort_unstable_by(|a, b| b.cmp(a));
            for from in layer.iter() {
                self.expand(*from as usize);
                if self.is_visited(last) || self.looks == Some(0) {
                    return;
                }
            }
        }
    }

    /// Appends the path to `last`.
    fn path(&self, last: usize, kept: &mut Vec<u32>) {
        let from = kept.len();
        let mut at = last as u32;
        while at != 0 {
            kept.push(at);
            at = self.nodes[at as usize].parent;
        }
        kept.push(0);
        kept[from..].reverse();
    }

    #[inline(always)]
    fn is_visited(&self, i: usize) -> bool {
        self.nodes[i].parent != NONE
    }

    fn visit(&mut self, i: usize, parent: usize) {
        self.nodes[i].parent = parent as u32;
        self.nodes[i].next = i as u32 + 1;
        self.found.push(i as u32);
    }

    /// The first unvisited vertex from `i` on, or the number of vertices.
    #[inline]
    fn unvisited(&mut self, mut i: usize) -> usize {
        while let Some(node) = self.nodes.get(i) {
            let next = node.next as usize;
            if next == i {
                break;
            }
            // Path halving, as in union-find: without it, each search would walk over all visited vertices.
            if let Some(after) = self.nodes.get(next).map(|node| node.next) {
                self.nodes[i].next = after;
            }
            i = next;
        }
        i
    }

    /// Visits all unvisited vertices that a segment from `from` can reach.
    fn expand(&mut self, from: usize) {
        let first = self.unvisited(from + 1);
        if first >= self.points.len() {
            return;
        }
        match first - from < NEAR {
            true => self.sweep(from),
            false => self.seek(from, first),
        }
    }

    /// Visits the unvisited vertices from `first` that are reachable from `from`, with a wedge narrowed only by
    /// the last witness and by blocking vertices; beyond the witness by all vertices.
    fn seek(&mut self, from: usize, first: usize) {
        let mut view = self.view(from, first);
        let mut at = first;
        let witnesses = self.witness.0.map(|i| i as usize).into_iter();
        for known in witnesses.filter(|i| *i > from && *i < NONE as usize) {
            if at <= known && !self.try_all(from, at, known + 1, &mut view) {
                return;
            }
            at = at.max(known + 1);
            if view.pass(self.points, known) == WedgeStep::Stops {
                if view.is_new {
                    self.stop(view.witness, known);
                }
                return;
            }
        }
        at = self.unvisited(at);
        while at < self.points.len() {
            let step = view.pass(self.points, at);
            if step == WedgeStep::Stops {
                return self.stop(view.witness, at);
            }
            if step == WedgeStep::Ends && !self.try_one(from, at, &mut view) {
                return;
            }
            at = self.unvisited(at + 1);
        }
    }

    /// All directions from `from`, for segments that end at `first` or later.
    fn view(&self, from: usize, first: usize) -> VisibilityWedge<M::Wedge> {
        let wedge = M::Wedge::new(&self.points[from], self.tolerance);
        let is_passed = (from + 1..first).contains(&self.outermost);
        let min_span2 = if is_passed { wedge.min_span2(&self.points[self.outermost]) } else { 0.0 };
        VisibilityWedge { wedge, min_span2, witness: DirectionWitness::NONE, is_new: false }
    }

    /// Tries the segments to visible unvisited vertices of `at..end`: `false` if nothing is visible after that.
    fn try_all(
        &mut self,
        from: usize,
        mut at: usize,
        end: usize,
        view: &mut VisibilityWedge<M::Wedge>,
    ) -> bool {
        loop {
            at = self.unvisited(at);
            if at >= end {
                return true;
            }
            let run = &self.points[at..end];
            let Some(inside) = first_inside(&view.wedge, view.min_span2, run) else {
                return true;
            };
            at += inside;
            if !self.is_visited(at) && !self.try_one(from, at, view) {
                return false;
            }
            at += 1;
        }
    }

    /// Tries the segment to `to`: `false` if its blocking vertex empties the wedge.
    fn try_one(&mut self, from: usize, to: usize, view: &mut VisibilityWedge<M::Wedge>) -> bool {
        if self.is_valid(from, to) {
            self.visit(to, from);
            return true;
        }
        let spoiler = self.nodes[to].spoiler as usize;
        view.is_new = true;
        let min_span2 = view.wedge.min_span2(&self.points[spoiler]);
        if min_span2 > view.min_span2 {
            view.min_span2 = min_span2;
            self.outermost = spoiler;
        }
        let is_left = view.pass(self.points, spoiler) != WedgeStep::Stops;
        if !is_left {
            self.stop(view.witness, spoiler);
        }
        is_left
    }

    /// Records the witness of a wedge emptied by `killer`.
    fn stop(&mut self, mut witness: DirectionWitness, killer: usize) {
        witness.0[MAX_SIDES] = killer as u32;
        witness.0.sort_unstable();
        self.witness = witness;
    }

    /// Narrows the wedge of `from` until it is empty.
    fn sweep(&mut self, from: usize) {
        let mut wedge = M::Wedge::new(&self.points[from], self.tolerance);
        let mut witness = DirectionWitness::NONE;
        let mut span2 = 0.0;
        for to in from + 1..self.points.len() {
            let p = &self.points[to];
            let step = wedge.step(p);
            if step == WedgeStep::Stops {
                return self.stop(witness, to);
            }
            let span = wedge.span2(p);
            let is_outermost = span >= span2;
            span2 = larger(span, span2);
            let is_taken = is_outermost && self.looks.is_none();
            if step == WedgeStep::Ends
                && !self.is_visited(to)
                && (is_taken || self.is_valid(from, to))
            {
                self.visit(to, from);
            }
            witness.note(wedge.cuts(), to);
        }
    }

    /// True if the segment passes all vertices between within the tolerance.
    fn is_valid(&mut self, from: usize, to: usize) -> bool {
        let (points, tolerance2) = (self.points, self.tolerance2);
        let segment = self.metric.segment(&points[from], &points[to]);
        let is_beyond =
            |i: usize| M::squared(&segment, M::reach(&segment, &points[i])) > tolerance2;
        let spoiler = self.nodes[to].spoiler as usize;
        if spoiler > from && is_beyond(spoiler) {
            return false;
        }
        if let Some(looks) = &mut self.looks {
            *looks = looks.saturating_sub((to - from) as u64);
            if *looks == 0 {
                return false;
            }
        }
        if to - from > LONG {
            let tree = self.tree.get_or_insert_with(|| VertexRegions::new::<V, M>(points));
            let farthest =
                farthest_beyond::<V, M>(&segment, points, tree, from + 1, to, tolerance2);
            if let Some((i, _)) = farthest {
                self.nodes[to].spoiler = i as u32;
            }
            return farthest.is_none();
        }
        let limit = M::within(&segment, self.tolerance2);
        let mut end = to;
        while let Some(i) = last_above::<V, M>(&segment, self.points, from + 1, end, limit) {
            if is_beyond(i) {
                self.nodes[to].spoiler = i as u32;
                return false;
            }
            end = i;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::{PlaneMetric, largest_distance2};
    use proptest::prelude::*;

    /// A segment costs as many looks as vertices it passes and the end, and the last look is not enough.
    #[test]
    fn segments_are_tested_while_there_are_looks() {
        let points: Vec<_> = (0..12).map(|i| [f64::from(i), 0.0]).collect();
        for (looks, left, expected) in [
            (Some(100), Some(93), true),
            (Some(8), Some(1), true),
            (Some(7), Some(0), false),
            (Some(3), Some(0), false),
            (None, None, true),
        ] {
            let mut search = ShortcutSearch {
                metric: &PlaneMetric,
                points: &points,
                tolerance: 1.0,
                tolerance2: 1.0,
                nodes: &mut [PathNode { parent: NONE, spoiler: 0, next: 0 }; 12],
                found: &mut Vec::new(),
                witness: DirectionWitness::NONE,
                outermost: 0,
                tree: None,
                looks,
            };
            assert_eq!(search.is_valid(3, 10), expected, "{looks:?}");
            assert_eq!(search.looks, left, "{looks:?}");
        }
    }

    /// What spoiled the last segment to a vertex is asked first, and costs no look; what is not between
    /// the ends is not asked.
    #[test]
    fn spoilers_are_asked_first() {
        let mut points: Vec<_> = (0..12).map(|i| [f64::from(i), 0.0]).collect();
        for spoiler in [2, 3, 5, 7] {
            points[spoiler][1] = 9.0;
        }
        // From the vertex that is beyond, too: its segment passes the others far away.
        for (from, spoiler, left, next) in
            [(4, 5, 100, 5), (4, 7, 100, 7), (4, 2, 94, 7), (4, 6, 94, 7)]
        {
            let mut nodes = [PathNode { parent: NONE, spoiler, next: 0 }; 12];
            let mut search = ShortcutSearch {
                metric: &PlaneMetric,
                points: &points,
                tolerance: 1.0,
                tolerance2: 1.0,
                nodes: &mut nodes,
                found: &mut Vec::new(),
                witness: DirectionWitness::NONE,
                outermost: 0,
                tree: None,
                looks: Some(100),
            };
            assert!(!search.is_valid(from, 10));
            assert_eq!((search.looks, nodes[10].spoiler), (Some(left), next), "spoiler {spoiler}");
        }
    }

    proptest! {
        /// Where nothing is near the tolerance, the word of the wedge is not taken for more than it is
        /// worth: no second search is needed.
        #[test]
        fn the_first_search_finds_segments_that_hold(
            line in prop::collection::vec([-5.0..5.0, -5.0..5.0], 3..60),
            tolerance in 0.5..4.0,
        ) {
            let mut kept = Vec::new();
            let is_found =
                ShortcutSearch::run(&PlaneMetric, &line, tolerance, None, &mut SimplifyScratch::default(), &mut kept);
            prop_assert!(is_found);
            let most = largest_distance2(&PlaneMetric, &line, &kept);
            prop_assert!(most.is_none_or(|(_, square)| square <= tolerance * tolerance));
        }

        /// A second search has a million looks and 2000 a vertex: more than a long straight end takes,
        /// where rounding decides about what is before it.
        #[test]
        fn a_second_search_is_not_given_up_early(
            head in prop::collection::vec((0..7_i32, 0..7_i32), 30..40),
        ) {
            let mut line: Vec<_> =
                head.iter().map(|(x, y)| [f64::from(*x) * 0.1, f64::from(*y) * 0.1]).collect();
            line.extend((0..1600).map(|i| [f64::from(i) + 9.0, 0.0]));
            let (tolerance, mut scratch) = (0.1, SimplifyScratch::default());
            let (mut kept, mut want) = (Vec::new(), Vec::new());
            let most = (1 << 20) + 2000 * line.len() as u64;
            let is_found =
                ShortcutSearch::run(&PlaneMetric, &line, tolerance, Some(most), &mut scratch, &mut want);
            prop_assume!(is_found);
            imai_iri(&PlaneMetric, &line, tolerance, &mut scratch, &mut kept);
            prop_assert_eq!(kept.len(), want.len());
        }
    }
}
