//! Scanline test of which samples of a window are inside polygons.
//!
//! If the samples of a row have one y, rows are processed by ascending y. The column of an edge crossing is
//! estimated and then corrected exactly; samples after it are inside or outside, feature by feature. In other grids
//! each sample is tested separately.

use std::cmp::Ordering;
use std::ops::{ControlFlow, Range};

use super::{PolygonEdge, PolygonEdgeIndex, Xy};
use terrane_base::geom::{Affine, Rect, plane};

/// A window of samples, and scratch lists for a row.
pub(crate) struct PolygonScan<'a> {
    areas: &'a PolygonEdgeIndex,
    /// Label of each feature; `None` if features are not distinguished.
    labels: Option<&'a [u32]>,
    map: Affine,
    rect: Rect,
    /// Edges at the height of the row.
    active: Vec<u32>,
    /// Columns at which samples switch between inside and outside of a feature.
    turns: Vec<(u32, u32)>,
    /// Labels and column ranges inside, with borders as separate ranges; sorted and disjoint at the end.
    inside: Vec<Labelled>,
}

/// Column range inside features with a label.
pub(crate) type Labelled = (u32, Range<u32>);

impl<'a> PolygonScan<'a> {
    /// Scans all features together, with label 0.
    pub(crate) fn new(areas: &'a PolygonEdgeIndex, map: Affine, rect: Rect) -> Self {
        let (active, turns, inside) = (Vec::new(), Vec::new(), Vec::new());
        Self { areas, labels: None, map, rect, active, turns, inside }
    }

    /// Scans features by label; labels are given per feature in order of insertion.
    pub(crate) fn labelled(self, labels: &'a [u32]) -> Self {
        Self { labels: Some(labels), ..self }
    }

    /// Calls `see` for each row with its number in the window and the columns inside, sorted and disjoint per
    /// label, until it breaks. Rows come in no fixed order.
    pub(crate) fn rows<B>(
        mut self,
        mut see: impl FnMut(u32, &[Labelled]) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let Affine { b, d, e, .. } = self.map;
        let has_rows = b == 0.0 && d == 0.0;
        let mut next = 0;
        for at in 0..self.rect.height {
            let row = if e < 0.0 { self.rect.height - 1 - at } else { at };
            self.inside.clear();
            match has_rows {
                true => self.look_at_row(row, &mut next),
                false => self.look_at_each(row),
            }
            see(row, &self.inside)?;
        }
        ControlFlow::Continue(())
    }

    fn position(&self, col: u32, row: u32) -> Xy {
        self.map.apply(f64::from(self.rect.col + col), f64::from(self.rect.row + row))
    }

    /// A row whose samples have one y, not lower than that of the previous row; `next` is the first edge that
    /// no earlier row reached.
    fn look_at_row(&mut self, row: u32, next: &mut usize) {
        let edges = &self.areas.edges;
        let y = self.position(0, row)[1];
        self.active.retain(|edge| edges[*edge as usize].high[1] >= y);
        while let Some(edge) = self.areas.reaching(*next, y).filter(|edge| edges[*edge].low[1] <= y)
        {
            self.active.push(edge as u32);
            *next = edge + 1;
        }
        self.turns.clear();
        for at in 0..self.active.len() {
            self.add_crossing(&edges[self.active[at] as usize], row, y);
        }
        self.turns.sort_unstable();
        for of_feature in self.turns.chunk_by(|a, b| a.0 == b.0) {
            let label = label(self.labels, of_feature[0].0);
            let ranges = of_feature.chunks(2).map(|pair| {
                // Without a second crossing, the rest of the row is inside.
                let end = pair.get(1).map_or(self.rect.width, |turn| turn.1);
                (label, pair[0].1..end)
            });
            self.inside.extend(ranges.filter(|(_, range)| !range.is_empty()));
        }
        join(&mut self.inside);
    }

    /// Records the crossing of an edge with a row at height `y`.
    fn add_crossing(&mut self, edge: &PolygonEdge, row: u32, y: f64) {
        let PolygonEdge { low, high, feature } = *edge;
        let border = if low[1] == high[1] {
            self.columns(low[0], high[0], row)
        } else if high[1] == y {
            // The end of an edge is the start of the next one; at a peak it belongs to none.
            self.columns(high[0], high[0], row)
        } else {
            let crossing = self.crossing(low, high, row, y);
            if crossing.end < self.rect.width {
                self.turns.push((feature, crossing.end));
            }
            crossing
        };
        let label = label(self.labels, feature);
        self.inside.extend((!border.is_empty()).then_some((label, border)));
    }

    /// The columns of a row, at `y`, that lie on a crossing edge; empty between two samples.
    fn crossing(&self, low: Xy, high: Xy, row: u32, y: f64) -> Range<u32> {
        let x = low[0] + (y - low[1]) / (high[1] - low[1]) * (high[0] - low[0]);
        // Positions west of an upward edge are on its left.
        let before = if self.map.a > 0.0 { Ordering::Greater } else { Ordering::Less };
        let side = |col| plane::orient(low, high, self.position(col, row));
        self.seek(x, |col| side(col) == before)..self.seek(x, |col| side(col) != before.reverse())
    }

    /// The columns of a row from one x to another.
    fn columns(&self, west: f64, east: f64, row: u32) -> Range<u32> {
        let x = |col| self.position(col, row)[0];
        match self.map.a > 0.0 {
            true => self.seek(west, |col| x(col) < west)..self.seek(east, |col| x(col) <= east),
            false => self.seek(east, |col| x(col) > east)..self.seek(west, |col| x(col) >= west),
        }
    }

    /// The first column that is not `before`, near `x`; `before` is monotonic.
    fn seek(&self, x: f64, before: impl Fn(u32) -> bool) -> u32 {
        let width = self.rect.width;
        let near = (x - self.map.x0) / self.map.a - f64::from(self.rect.col);
        // Casting saturates to the first or last column.
        let guess = near as u32;
        let (mut low, mut high) =
            (guess.saturating_sub(1).min(width), guess.saturating_add(2).min(width));
        if low > 0 && !before(low - 1) {
            low = 0;
        }
        if high < width && before(high) {
            high = width;
        }
        while low < high {
            let middle = low.midpoint(high);
            if before(middle) { low = middle + 1 } else { high = middle }
        }
        low
    }

    /// A row of samples tested one by one.
    fn look_at_each(&mut self, row: u32) {
        let mut features = Vec::new();
        for col in 0..self.rect.width {
            features.clear();
            self.areas.features_at(self.position(col, row), &mut self.turns, &mut features);
            let labelled = features.iter().map(|&of| (label(self.labels, of), col..col + 1));
            self.inside.extend(labelled);
        }
        join(&mut self.inside);
    }
}

fn label(labels: Option<&[u32]>, feature: u32) -> u32 {
    labels.map_or(0, |labels| labels[feature as usize - 1])
}

impl PolygonEdgeIndex {
    /// Appends the features that contain a position or have it on their border; duplicates are possible.
    pub(crate) fn features_at(&self, at: Xy, turns: &mut Vec<(u32, u32)>, out: &mut Vec<u32>) {
        turns.clear();
        let mut next = 0;
        while let Some(edge) =
            self.reaching(next, at[1]).filter(|edge| self.edges[*edge].low[1] <= at[1])
        {
            let PolygonEdge { low, high, feature } = self.edges[edge];
            let is_between = low[0].min(high[0]) <= at[0] && at[0] <= low[0].max(high[0]);
            match plane::orient(low, high, at) {
                Ordering::Equal if is_between => out.push(feature),
                Ordering::Less if at[1] < high[1] => turns.push((feature, 0)),
                _ => {}
            }
            next = edge + 1;
        }
        turns.sort_unstable();
        let odd = turns.chunk_by(|a, b| a.0 == b.0).filter(|of| of.len() % 2 == 1);
        out.extend(odd.map(|of| of[0].0));
    }
}

/// Sorts ranges and merges adjacent ones of a label.
pub(crate) fn join(ranges: &mut Vec<Labelled>) {
    ranges.sort_unstable_by_key(|(label, range)| (*label, range.start));
    ranges.dedup_by(|next, last| {
        let meets = next.0 == last.0 && next.1.start <= last.1.end;
        if meets {
            last.1.end = last.1.end.max(next.1.end);
        }
        meets
    });
}
