//! Which samples of a window lie in polygons: row by row.
//!
//! Where rows of samples have one y, they are taken by rising y. An edge that crosses a row is found among
//! its columns by a guess that is set right exactly; from there on samples are inside or outside, feature
//! by feature. In other grids each sample is decided by itself.

use std::cmp::Ordering;
use std::ops::{ControlFlow, Range};

use super::{Clip, Edge, Xy};
use terrane_base::geom::{Affine, Rect, plane};

/// A window of samples that is looked at, and the lists for a row of it.
pub(super) struct Scan<'a> {
    clip: &'a Clip,
    map: Affine,
    rect: Rect,
    /// The edges at the height of the row.
    active: Vec<u32>,
    /// Where samples of a feature are from then on inside, or outside again.
    turns: Vec<(u32, u32)>,
    /// Columns inside, those on borders by themselves; at last in order and apart.
    inside: Vec<Range<u32>>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(clip: &'a Clip, map: Affine, rect: Rect) -> Self {
        Self { clip, map, rect, active: Vec::new(), turns: Vec::new(), inside: Vec::new() }
    }

    /// Shows for each row, by its number in the window, the columns of the window that are inside, in order
    /// and apart, until `see` breaks it off. Rows come in an order of their own.
    pub(super) fn rows<B>(
        mut self,
        mut see: impl FnMut(u32, &[Range<u32>]) -> ControlFlow<B>,
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

    /// A row whose samples have one y, which is that of the row before or higher; `next` is the first edge
    /// that no row before came up to.
    fn look_at_row(&mut self, row: u32, next: &mut usize) {
        let edges = &self.clip.edges;
        let y = self.position(0, row)[1];
        self.active.retain(|edge| edges[*edge as usize].high[1] >= y);
        while let Some(edge) = self.clip.reaching(*next, y).filter(|edge| edges[*edge].low[1] <= y)
        {
            self.active.push(edge as u32);
            *next = edge + 1;
        }
        self.turns.clear();
        for at in 0..self.active.len() {
            self.look_at_edge(&edges[self.active[at] as usize], (row, y));
        }
        self.turns.sort_unstable();
        for of_feature in self.turns.chunk_by(|a, b| a.0 == b.0) {
            let end = |pair: &[(u32, u32)]| pair.get(1).map_or(self.rect.width, |turn| turn.1);
            let ranges = of_feature.chunks(2).map(|pair| pair[0].1..end(pair));
            self.inside.extend(ranges.filter(|range| !range.is_empty()));
        }
        join(&mut self.inside);
    }

    /// Notes what an edge at the height `y` of a row has to say about its samples.
    fn look_at_edge(&mut self, edge: &Edge, (row, y): (u32, f64)) {
        let Edge { low, high, feature } = *edge;
        let border = if low[1] == high[1] {
            self.columns((low[0], high[0]), row)
        } else if high[1] == y {
            // The end of one is the beginning of another; at a peak it is that of none.
            self.columns((high[0], high[0]), row)
        } else {
            let (before, after) = self.crossing((low, high), (row, y));
            if after < self.rect.width {
                self.turns.push((feature, after));
            }
            before..after
        };
        self.inside.extend((!border.is_empty()).then_some(border));
    }

    /// The first column of a row that is not before an edge that crosses it, and the first one after it.
    fn crossing(&self, (low, high): (Xy, Xy), (row, y): (u32, f64)) -> (u32, u32) {
        let x = low[0] + (y - low[1]) / (high[1] - low[1]) * (high[0] - low[0]);
        // An edge upwards has what is west of it on its left.
        let before = if self.map.a > 0.0 { Ordering::Greater } else { Ordering::Less };
        let side = |col| plane::orient(low, high, self.position(col, row));
        let first = self.seek(x, |col| side(col) == before);
        (first, self.seek(x, |col| side(col) != before.reverse()))
    }

    /// The columns of a row from one x to another.
    fn columns(&self, (west, east): (f64, f64), row: u32) -> Range<u32> {
        let x = |col| self.position(col, row)[0];
        match self.map.a > 0.0 {
            true => self.seek(west, |col| x(col) < west)..self.seek(east, |col| x(col) <= east),
            false => self.seek(east, |col| x(col) > east)..self.seek(west, |col| x(col) >= west),
        }
    }

    /// The first column that does not come `before`, as all do up to somewhere near `x`.
    fn seek(&self, x: f64, before: impl Fn(u32) -> bool) -> u32 {
        let width = self.rect.width;
        let near = (x - self.map.x0) / self.map.a - f64::from(self.rect.col);
        // A float that is beyond the columns becomes the last of them, or the first.
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

    /// A row of samples that are decided by themselves.
    fn look_at_each(&mut self, row: u32) {
        for col in 0..self.rect.width {
            if self.covers(self.position(col, row)) {
                match self.inside.last_mut() {
                    Some(last) if last.end == col => last.end += 1,
                    _ => self.inside.push(col..col + 1),
                }
            }
        }
    }

    fn covers(&mut self, at: Xy) -> bool {
        let edges = &self.clip.edges;
        self.turns.clear();
        let mut next = 0;
        while let Some(edge) =
            self.clip.reaching(next, at[1]).filter(|edge| edges[*edge].low[1] <= at[1])
        {
            let Edge { low, high, feature } = edges[edge];
            let is_between = low[0].min(high[0]) <= at[0] && at[0] <= low[0].max(high[0]);
            match plane::orient(low, high, at) {
                Ordering::Equal if is_between => return true,
                Ordering::Less if at[1] < high[1] => self.turns.push((feature, 0)),
                _ => {}
            }
            next = edge + 1;
        }
        self.turns.sort_unstable();
        self.turns.chunk_by(|a, b| a.0 == b.0).any(|of_feature| of_feature.len() % 2 == 1)
    }
}

/// Puts ranges in order and joins those that meet.
fn join(ranges: &mut Vec<Range<u32>>) {
    ranges.sort_unstable_by_key(|range| range.start);
    ranges.dedup_by(|next, last| {
        let meets = next.start <= last.end;
        if meets {
            last.end = last.end.max(next.end);
        }
        meets
    });
}
