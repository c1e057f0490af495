//! Required vertices on a tile border, computed identically on both sides: rim samples, and samples along the outline
//! of voids.
//!
//! **Rims.** The corners of a tile are vertices. Further vertices along each rim line are chosen by one-dimensional
//! greedy insertion over the line's samples: in `f64`, from low to high index, the first maximum wins. The choice is a
//! pure function of the line and the tolerance, so two tiles that share a line choose the same vertices without
//! communication. Rim samples are excluded from the tile's own scans, and a tile neither inserts nor drops rim
//! vertices.
//!
//! **Voids.** The surface is the union of the cells whose four samples are valid. Samples on its outline
//! are vertices from the start. Edges of the unit lattice are Delaunay edges whatever else is inserted
//! (the circle around them holds no other sample), so the outline is in the mesh without constraints, and
//! triangles outside it are cut away. A valid sample with no valid cell has no surface. Whether a rim
//! sample lies on the outline depends on the cells beyond the rim, so a tile's window has one sample more
//! on each side where the grid goes on (the *apron*).

use super::exact::within;
use super::lattice_position::TilePosition;
use super::spec::TileInput;
use terrane_line::rdp::refine;

/// The surface cells of a tile and its apron. Positions are tile positions.
pub(super) struct SurfaceCells<'a> {
    input: &'a TileInput<'a>,
    /// One value per cell of tile and apron: 1 if all its samples are valid. Empty if nothing is void.
    cells: Vec<u8>,
    pitch: usize,
}

impl<'a> SurfaceCells<'a> {
    pub(super) fn new(input: &'a TileInput<'a>) -> Self {
        let heights = &input.heights;
        let width = heights.width as usize;
        // Whole chunks at a time, so that the search is vectorised.
        let mut chunks = heights.f32.chunks(1024);
        let has_voids = chunks.any(|chunk| chunk.iter().fold(false, |any, z| any | z.is_nan()));
        let mut cells = Vec::new();
        if has_voids {
            let rows: Vec<_> = heights.f32.chunks_exact(width).collect();
            for pair in rows.windows(2) {
                let corners = pair[0].windows(2).zip(pair[1].windows(2));
                // Without a branch, so that the loop is vectorised.
                cells.extend(corners.map(|(a, b)| {
                    let is_void = a[0].is_nan() | a[1].is_nan() | b[0].is_nan() | b[1].is_nan();
                    u8::from(!is_void)
                }));
            }
        }
        Self { input, cells, pitch: width - 1 }
    }

    /// True when the tile or its apron has a void sample.
    pub(super) fn has_voids(&self) -> bool {
        !self.cells.is_empty()
    }

    /// The cell of tile and apron at (`col`, `row`): `None` if out of bounds.
    fn cell(&self, col: Option<usize>, row: Option<usize>) -> Option<bool> {
        let (col, row) = (col?, row?);
        let is_inside = col < self.pitch && row < self.cells.len() / self.pitch;
        is_inside.then(|| self.cells[row * self.pitch + col] == 1)
    }

    /// True when the cell of the tile whose first sample is (`col`, `row`) belongs to the surface.
    pub(super) fn holds_cell(&self, col: u32, row: u32) -> bool {
        let col = (col + self.input.apron_left) as usize;
        let row = (row + self.input.apron_above) as usize;
        self.cell(Some(col), Some(row)) == Some(true)
    }

    /// Role of a sample in the surface.
    pub(super) fn role(&self, p: TilePosition) -> SurfaceRole {
        if !self.has_voids() {
            return SurfaceRole::Interior;
        }
        let col = (p.col() + self.input.apron_left) as usize;
        let row = (p.row() + self.input.apron_above) as usize;
        let (left, above) = (col.checked_sub(1), row.checked_sub(1));
        let cells = [(left, above), (Some(col), above), (left, Some(row)), (Some(col), Some(row))]
            .map(|(col, row)| self.cell(col, row));
        // Cells beyond the grid are None, neither surface nor void: a sample where the grid ends is no
        // outline by that alone.
        match (cells.contains(&Some(true)), cells.contains(&Some(false))) {
            (true, true) => SurfaceRole::Outline,
            (true, false) => SurfaceRole::Interior,
            (false, _) if self.is_valid(col, row) => SurfaceRole::Isolated,
            (false, _) => SurfaceRole::Void,
        }
    }

    /// True if the sample at (`col`, `row`), apron included, has a height.
    fn is_valid(&self, col: usize, row: usize) -> bool {
        !self.input.heights.f32[row * self.input.heights.width as usize + col].is_nan()
    }
}

/// Role of a sample in the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SurfaceRole {
    /// All its cells belong to the surface.
    Interior,
    /// Some of its cells belong to the surface: it must be a vertex.
    Outline,
    /// It has a height but no cell: it has no surface.
    Isolated,
    /// It has no height.
    Void,
}

/// Bound on the rounding error of a distance from a chord, relative to the heights.
const DOUBT: f64 = 1e-14;

/// A straight run of rim samples: the first one, the step to the next, and their number.
#[derive(Clone, Copy, Debug)]
pub(super) struct RimRun {
    pub(super) first: TilePosition,
    pub(super) along_rows: bool,
    pub(super) count: u32,
    pub(super) spacing: u32,
}

/// The anchor vertices on a side of `cells` cells: evenly distributed, at most `spacing` apart.
pub(super) fn anchors(cells: u32, spacing: u32) -> impl Iterator<Item = u32> {
    let parts = cells.div_ceil(spacing);
    (0..=parts).map(move |i| i * cells / parts)
}

impl RimRun {
    fn at(&self, i: u32) -> TilePosition {
        let (col, row) = (self.first.col(), self.first.row());
        if self.along_rows {
            TilePosition::new(col, row + i)
        } else {
            TilePosition::new(col + i, row)
        }
    }

    /// The sides of a tile: above, below, left, right.
    pub(super) fn sides(cols: u32, rows: u32, spacing: u32) -> [Self; 4] {
        let first = TilePosition::new(0, 0);
        let above = Self { first, along_rows: false, count: cols, spacing };
        let left = Self { first, along_rows: true, count: rows, spacing };
        let below = Self { first: TilePosition::new(0, rows - 1), ..above };
        let right = Self { first: TilePosition::new(cols - 1, 0), ..left };
        [above, below, left, right]
    }

    /// Appends the rim's vertices in order, its two ends included.
    ///
    /// Between samples of the outline the rim is either all surface or all void. On the surface, between anchor
    /// vertices and required samples, the sample furthest from the chord (the first one of a tie) is kept, and both
    /// halves are refined likewise until every sample is within `tolerance` of its chord. Line simplification works
    /// likewise ([`refine`]), but here the vertical distance is compared without rounding.
    pub(super) fn vertices(
        &self,
        role: impl Fn(TilePosition) -> SurfaceRole,
        is_kept: impl Fn(TilePosition) -> bool,
        sample: impl Fn(TilePosition) -> f64,
        vertex: impl Fn(TilePosition) -> f64,
        tolerance: f64,
        out: &mut Vec<TilePosition>,
    ) {
        let last = self.count - 1;
        let mut anchors = anchors(last, self.spacing).skip(1).peekable();
        let mut start = 0;
        out.push(self.at(0));
        while start < last {
            let fixed = (start + 1..=last).find(|i| {
                let at = self.at(*i);
                anchors.next_if_eq(i).is_some() || role(at) == SurfaceRole::Outline || is_kept(at)
            });
            let end = fixed.unwrap_or(last);
            if end > start + 1 && role(self.at(start + 1)) == SurfaceRole::Interior {
                let ends = [start, end].map(|i| i as usize);
                self.refine(ends, &sample, &vertex, tolerance, out);
            }
            out.push(self.at(end));
            start = end;
        }
    }

    /// Appends the vertices strictly between `start` and `end`, in ascending order.
    fn refine(
        &self,
        [start, end]: [usize; 2],
        sample: &impl Fn(TilePosition) -> f64,
        vertex: &impl Fn(TilePosition) -> f64,
        tolerance: f64,
        out: &mut Vec<TilePosition>,
    ) {
        refine(
            start,
            end,
            &mut Vec::new(),
            |start, end| self.worst(start, end, sample, vertex, tolerance),
            |at| out.push(self.at(at as u32)),
        );
    }

    /// The sample between `start` and `end` furthest from their chord, if one is beyond
    /// `tolerance`.
    fn worst(
        &self,
        start: usize,
        end: usize,
        sample: &impl Fn(TilePosition) -> f64,
        vertex: &impl Fn(TilePosition) -> f64,
        tolerance: f64,
    ) -> Option<usize> {
        let (start, end) = (start as u32, end as u32);
        let (from, to) = (vertex(self.at(start)), vertex(self.at(end)));
        let mut worst: Option<(u32, f64)> = None;
        for i in start + 1..end {
            let (ahead, behind) = (i64::from(end - i), i64::from(i - start));
            let height = sample(self.at(i));
            let chord = (from * ahead as f64 + to * behind as f64) / f64::from(end - start);
            let error = (height - chord).abs();
            let doubt = DOUBT * (from.abs() + to.abs() + height.abs() + tolerance);
            let fails = match error - tolerance {
                excess if excess.abs() > doubt => excess > 0.0,
                _ => !within([ahead, behind, 0], [from, to, 0.0], height, tolerance),
            };
            if fails && worst.is_none_or(|(_, most)| error > most) {
                worst = Some((i, error));
            }
        }
        worst.map(|(i, _)| i as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A third is no number of `f64`: the nearest one is less, and that of two thirds too.
    #[test]
    fn a_tolerance_is_exceeded_by_less_than_a_rounding() {
        let rim = RimRun {
            first: TilePosition::new(0, 0),
            along_rows: false,
            count: 4,
            spacing: u32::MAX,
        };
        for (heights, tolerance, expected) in [
            ([0.0, 0.0, 2.0 / 3.0, 1.0], 1.0 / 3.0, Some(1)),
            ([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0], 0.0, Some(1)),
            ([0.0, 0.0, 0.0, 1.0], 2.0 / 3.0, Some(2)),
            ([0.0, 0.0, 0.0, 1.0], (2.0_f64 / 3.0).next_up(), None),
            ([0.0, -1.0, 0.0, 3.0], 2.0, None),
            ([0.0, -1.0, 0.0, 3.0], 2.0_f64.next_down(), Some(1)),
        ] {
            let height = |p: TilePosition| heights[p.col() as usize];
            let worst = rim.worst(0, 3, &height, &height, tolerance);
            assert_eq!(worst, expected, "{heights:?} {tolerance}");
        }
    }

    /// Whole heights of 53 bits, and such as are that of tiny steps: the chord is rounded, the decision is not.
    #[test]
    fn a_chord_far_from_zero_is_missed_by_the_tolerance_or_more() {
        let n = 1024_u32;
        let rim = RimRun {
            first: TilePosition::new(0, 0),
            along_rows: false,
            count: n + 1,
            spacing: u32::MAX,
        };
        for (unit, k) in [0, -80].into_iter().flat_map(|unit| (1..60).map(move |k| (unit, k))) {
            let unit = 2.0_f64.powi(unit);
            let to = (1_i64 << 53) - 1 - 2 * 7919 * k;
            let chord = to * i64::from(n - 1);
            let height = chord / i64::from(n) + k % 3;
            let off = (height * i64::from(n) - chord).abs() as f64 / f64::from(n);
            let sample = |p: TilePosition| match p.col() {
                col if col == n - 1 => height as f64 * unit,
                col => to as f64 / f64::from(n) * f64::from(col) * unit,
            };
            let vertex = |p: TilePosition| if p.col() == 0 { 0.0 } else { to as f64 * unit };
            let found = |tolerance: f64| {
                let worst = rim.worst(0, n as usize, &sample, &vertex, tolerance * unit);
                worst == Some(n as usize - 1)
            };
            // The others are off by half a unit at most, which is less.
            if off > 0.0 {
                assert!(!found(off), "{unit} {k}");
                assert!(off < 1.0 || found(off.next_down()), "{unit} {k}");
            }
        }
    }
}
