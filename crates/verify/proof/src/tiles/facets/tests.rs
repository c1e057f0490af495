//! Surfaces with coinciding vertices, and the same surfaces without.

use proptest::prelude::*;

use super::super::ellipsoid::position;
use super::*;

/// Degrees between two vertices.
const STEP: f64 = 1e-5;

/// A lattice of vertices at these columns and rows, with a height for each place; equal numbers are coinciding
/// vertices.
fn lattice(columns: &[usize], rows: &[usize]) -> Facets {
    let height = |col: usize, row: usize| ((col * 37 + row * 91) % 29) as f64 * 0.1;
    let at = |n: usize| n as f64 * STEP;
    let place = |row: usize, col: usize| position(7.0 + at(col), 46.0 + at(row), height(col, row));
    let placed = rows.iter().flat_map(|&row| columns.iter().map(move |&col| place(row, col)));
    let placed: Vec<_> = placed.collect();
    let width = columns.len() as u32;
    let cells = (1..rows.len() as u32).flat_map(|row| (1..width).map(move |col| row * width + col));
    let triangles = cells.flat_map(|d| {
        let [a, b, c] = [d - width - 1, d - width, d - 1];
        [[a, b, d], [a, d, c]]
    });
    let tile = Tile { triangles: triangles.collect(), placed: placed.clone(), ..Tile::default() };
    Facets::new(&tile, &placed)
}

/// The numbers up to the largest, each as often as told.
fn repeated(times: &[usize]) -> Vec<usize> {
    times
        .iter()
        .enumerate()
        .flat_map(|(number, &times)| std::iter::repeat_n(number, times))
        .collect()
}

proptest! {
    /// Degenerate triangles change nothing.
    #[test]
    fn degenerate_triangles_change_nothing(
        columns in prop::collection::vec(1..4_usize, 2..7),
        rows in prop::collection::vec(1..4_usize, 2..7),
        places in prop::collection::vec((0.01..0.99_f64, 0.01..0.99_f64), 1..20),
        from in any::<u32>(),
    ) {
        let once = |times: &[usize]| (0..times.len()).collect::<Vec<_>>();
        let plain = lattice(&once(&columns), &once(&rows));
        let doubled = lattice(&repeated(&columns), &repeated(&rows));
        prop_assert_eq!(plain.facets.len(), doubled.facets.len());
        let side = |count: usize| (count - 1) as f64 * STEP;
        for (x, y) in places {
            let parallel = Parallel::at(46.0 + y * side(rows.len()));
            let meridians = [Meridian::at(7.0 + x * side(columns.len()))];
            let [a, b] = [&plain, &doubled].map(|facets| {
                let mut from = from % facets.facets.len() as u32;
                facets.row(&mut from, &parallel, &meridians, &[1.0], [0.5, 1e-6])
            });
            let [most, other] = [a, b].map(|seen| seen.most.unwrap().0);
            prop_assert!((most - other).abs() < 1e-6 && a.over == b.over, "{:?} {:?}", a, b);
        }
    }
}

/// A tile of degenerate triangles alone is looked at, and is infinitely far from all samples.
#[test]
fn a_surface_without_area_is_far_from_everything() {
    let facets = lattice(&[0, 0], &[0, 0]);
    let (parallel, meridians) = (Parallel::at(46.0), [Meridian::at(7.0)]);
    let seen = facets.row(&mut 0, &parallel, &meridians, &[0.0], [0.5, 1e-6]);
    assert_eq!((seen.count, seen.over), (1, 1));
}
