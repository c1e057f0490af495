//! Samples to keep: they are vertices, at the heights they have, and all the rest holds as without them.

use super::*;

impl Grid {
    /// What is to be kept of a window, which begins there.
    fn kept_in(&self, cols: [u32; 2], rows: [u32; 2]) -> Vec<TilePosition> {
        let held = |[from, to]: [u32; 2], at| (from..=to).contains(&at);
        let inside = |p: &&TilePosition| held(cols, p.col()) && held(rows, p.row());
        let shift = |p: &TilePosition| TilePosition::new(p.col() - cols[0], p.row() - rows[0]);
        self.kept.iter().filter(inside).map(shift).collect()
    }

    /// The same, with the breaklines there and what these need.
    pub(super) fn features_in(
        &self,
        cols: [u32; 2],
        rows: [u32; 2],
    ) -> (Vec<TilePosition>, Vec<PathStretch>) {
        let [width, height] = [cols, rows].map(|[from, to]| to - from + 1);
        let origin = [cols[0], rows[0]].map(i64::from);
        let stretch = |line: &SampleSegment| PathStretch::of(line.seen_from(origin), width, height);
        let lines: Vec<_> = self.lines.iter().filter_map(stretch).collect();
        let mut kept = self.kept_in(cols, rows);
        kept.extend(lines.iter().flat_map(|line| line.ends(width, height)));
        kept.sort_unstable();
        (kept, lines)
    }
}

/// Every vertex of the surface that `mesh` has to have.
fn wanted(grid: &Grid) -> Vec<TilePosition> {
    let is_on_surface = |p: &&TilePosition| {
        let near =
            |at: u32, cells: u32| [at.wrapping_sub(1), at].map(|at| (at < cells).then_some(at));
        let cols = near(p.col(), grid.width - 1);
        let rows = near(p.row(), grid.height - 1);
        let cells = cols
            .iter()
            .flatten()
            .flat_map(|&col| rows.iter().flatten().map(move |&row| (col, row)));
        cells.into_iter().any(|(col, row)| grid.is_cell(col, row))
    };
    grid.kept.iter().filter(is_on_surface).copied().collect()
}

fn check_kept(grid: &Grid, vertices: &[TilePosition], heights: &[f64]) {
    for p in wanted(grid) {
        let at = vertices.binary_search(&p);
        let at = at.unwrap_or_else(|_| panic!("{:?} is no vertex", lattice(p)));
        assert_eq!(heights[at], grid.at(p.col(), p.row()).unwrap() as f64, "{:?}", lattice(p));
    }
}

/// One in so many samples.
fn scattered(width: u32, height: u32, seed: u32, one_in: u32) -> Vec<TilePosition> {
    let all = (0..height).flat_map(|row| (0..width).map(move |col| TilePosition::new(col, row)));
    let is_taken = |p: &TilePosition| {
        let mix = (p.col() ^ seed).wrapping_mul(0x85eb_ca6b) ^ p.row().wrapping_mul(0xc2b2_ae35);
        (mix.wrapping_mul(0x27d4_eb2f) >> 15).is_multiple_of(one_in)
    };
    all.filter(is_taken).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]

    #[test]
    fn kept_samples_are_vertices_at_their_heights(
        width in 2_u32..50, height in 2_u32..50, seed in 0_u32..1000, holes in 0_u32..4,
        one_in in 1_u32..60, tolerance in 0_i32..60, fit: bool, drop: bool, of_surface: bool
    ) {
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let spec = TinSpec { fit_heights: fit, drop: drop || fit, bound, ..spec(tolerance.into()) };
        let kept = scattered(width, height, seed, one_in);
        let grid = Grid { kept, ..Grid::hills(width, height, seed, holes) };
        let mesh = whole(&grid, &spec);
        check_kept(&grid, &mesh.vertices, &mesh.heights);
        check_delaunay(&mesh.triangles);
        if !fit {
            check_bound(&grid, &mesh.triangles, tolerance.into(), 1);
        }
    }

    /// Two tiles know the same of their border, and what joins them keeps what they kept.
    #[test]
    fn kept_samples_stay_where_tiles_meet(
        seed in 0_u32..1000, holes in 0_u32..3, half in 8_u32..40, height in 2_u32..50,
        one_in in 1_u32..40, tolerance in 0_i32..40, of_surface: bool
    ) {
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let spec = TinSpec { bound, ..spec(tolerance.into()) };
        let kept = scattered(2 * half + 1, height, seed, one_in);
        let grid = Grid { kept, ..Grid::hills(2 * half + 1, height, seed, holes) };
        let (mended, _) = mend(&grid, half, &spec, half);
        let vertices: BTreeSet<TilePosition> = mended.iter().flat_map(|t| t.corners).collect();
        for p in wanted(&grid) {
            prop_assert!(vertices.contains(&p), "{:?} is no vertex", lattice(p));
        }
        check_delaunay(&mended);
        check_bound(&grid, &mended, tolerance.into(), 1);
    }

    /// Heights of a seam are fitted, too, but for those that stay.
    #[test]
    fn what_stays_on_a_fitted_seam_stays_at_its_height(
        seed in 0_u32..1000, half in 8_u32..30, height in 4_u32..40, one_in in 2_u32..20,
        tolerance in 1_i32..20
    ) {
        let spec = TinSpec { fit_heights: true, ..spec(tolerance.into()) };
        let kept = scattered(2 * half + 1, height, seed, one_in);
        let grid = Grid { kept, ..Grid::hills(2 * half + 1, height, seed, 0) };
        let (_, patch) = fit::mend_fitted(&grid, half, &spec);
        check_kept(&grid, &patch.vertices, &patch.heights);
    }
}
