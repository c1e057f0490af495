//! Breaklines: edges run along them, and all the rest holds as without them.

use super::*;

impl Grid {
    /// The same with lines through samples, from each to the next.
    fn with_lines(self, samples: &[(u32, u32)]) -> Self {
        let at = |&(col, row): &(u32, u32)| [col % self.width, row % self.height].map(i64::from);
        let lines: Vec<_> =
            samples.windows(2).map(|pair| SampleSegment::new(at(&pair[0]), at(&pair[1]))).collect();
        let stretch = |line: &SampleSegment| PathStretch::of(*line, self.width, self.height);
        let stretches = lines.iter().filter_map(stretch).collect();
        Self { lines, stretches, ..self }
    }

    /// True where the surface is beside the step from one sample to the next.
    fn borders(&self, a: TilePosition, b: TilePosition) -> bool {
        let (col, row) = (a.col().min(b.col()), a.row().min(b.row()));
        let beside = if a.row() == b.row() {
            row.checked_sub(1).map(|above| (col, above))
        } else {
            col.checked_sub(1).map(|left| (left, row))
        };
        let is_inside = |&(col, row): &(u32, u32)| col + 1 < self.width && row + 1 < self.height;
        [Some((col, row)), beside]
            .into_iter()
            .flatten()
            .filter(is_inside)
            .any(|(c, r)| self.is_cell(c, r))
    }
}

/// The samples along a line, by rounding.
fn path([mut a, mut b]: [[u32; 2]; 2]) -> Vec<TilePosition> {
    if [b[1], b[0]] < [a[1], a[0]] {
        (a, b) = (b, a);
    }
    let [dx, dy] = [0, 1].map(|axis| f64::from(b[axis]) - f64::from(a[axis]));
    let steps = (dx.abs() + dy.abs()) as u32;
    let sample = |step: u32| {
        let cols = (f64::from(step) * dx.abs() / f64::from(steps.max(1)) + 0.5).floor();
        let rows = f64::from(step) - cols;
        let at = |axis: usize, gone: f64, whole: f64| {
            (f64::from(a[axis]) + gone * whole.signum()) as u32
        };
        TilePosition::new(at(0, cols, dx), at(1, rows, dy))
    };
    (0..=steps).map(sample).collect()
}

/// Fails where two neighbouring vertices on a line are joined by no edge, though the surface goes on between them.
fn check_followed(grid: &Grid, samples: &[(u32, u32)], triangles: &[TileTriangle]) {
    let edges = edges(triangles);
    let vertices: BTreeSet<TilePosition> = triangles.iter().flat_map(|t| t.corners).collect();
    let at = |&(col, row): &(u32, u32)| [col % grid.width, row % grid.height];
    for pair in samples.windows(2) {
        let path = path([at(&pair[0]), at(&pair[1])]);
        let stops: Vec<usize> = (0..path.len()).filter(|&i| vertices.contains(&path[i])).collect();
        for stop in stops.windows(2) {
            let (from, to) = (path[stop[0]], path[stop[1]]);
            let is_joined = edges.contains_key(&(from, to)) || edges.contains_key(&(to, from));
            let goes_on =
                path[stop[0]..=stop[1]].windows(2).all(|step| grid.borders(step[0], step[1]));
            assert!(is_joined || !goes_on, "{:?} to {:?}", lattice(from), lattice(to));
        }
        for (i, &end) in path.iter().enumerate() {
            let beside = [i.checked_sub(1), Some(i)].map(|step| {
                step.and_then(|step| path.get(step..step + 2))
                    .is_some_and(|step| grid.borders(step[0], step[1]))
            });
            assert!(
                beside[0] == beside[1] || vertices.contains(&end),
                "{:?} is no vertex",
                lattice(end)
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn edges_run_along_breaklines(
        width in 2_u32..60, height in 2_u32..60, seed in 0_u32..1000, holes in 0_u32..4,
        samples in prop::collection::vec((0_u32..60, 0_u32..60), 2..20),
        tolerance in 0_i32..60, fit: bool, drop: bool, of_surface: bool
    ) {
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let spec = TinSpec { fit_heights: fit, drop: drop || fit, bound, ..spec(tolerance.into()) };
        let grid = Grid::hills(width, height, seed, holes).with_lines(&samples);
        let mesh = whole(&grid, &spec);
        check_followed(&grid, &samples, &mesh.triangles);
        check_delaunay(&mesh.triangles);
        if !fit {
            check_all(&grid, &mesh.triangles, tolerance.into(), 1);
        }
        if of_surface && !fit {
            check_between(&grid, &mesh.triangles, tolerance.into(), 1);
        }
    }

    /// Two tiles have the same vertices on their border, and what joins them follows the lines again.
    #[test]
    fn edges_run_along_breaklines_where_tiles_meet(
        seed in 0_u32..1000, holes in 0_u32..3, half in 8_u32..40, height in 2_u32..50,
        samples in prop::collection::vec((0_u32..80, 0_u32..50), 2..12),
        tolerance in 0_i32..40, of_surface: bool
    ) {
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let spec = TinSpec { bound, ..spec(tolerance.into()) };
        let grid = Grid::hills(2 * half + 1, height, seed, holes).with_lines(&samples);
        let (mended, _) = mend(&grid, half, &spec, half);
        check_followed(&grid, &samples, &mended);
        check_all(&grid, &mended, tolerance.into(), 1);
        check_delaunay(&mended);
    }
}

#[test]
fn a_line_takes_few_vertices_where_the_mesh_is_coarse() {
    // A plane: but for its corners and the ends of the line nothing is needed.
    let z = (0..65 * 65).map(|i| Some((i % 65 + i / 65) as i16)).collect();
    let grid =
        Grid { width: 65, height: 65, z, ..Grid::default() }.with_lines(&[(8, 20), (50, 31)]);
    let mesh = whole(&grid, &spec(0.5));
    assert!(mesh.vertices.len() < 20, "{}", mesh.vertices.len());
}
