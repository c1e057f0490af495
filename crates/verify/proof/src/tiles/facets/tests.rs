//! Surfaces with coinciding vertices, and the same surfaces without.

use proptest::prelude::*;

use super::*;

/// A vertex of a rough surface.
fn vertex(longitude: f64, latitude: f64) -> Vector {
    let height = (longitude * 37e5 + latitude * 91e5).rem_euclid(29.0) * 0.1;
    position(longitude, latitude, height)
}

/// A lattice of vertices at these longitudes and latitudes; equal ones are coinciding vertices. The bits of `diagonals`
/// select the diagonals of the cells.
fn lattice(columns: &[f64], rows: &[f64], diagonals: u64) -> TileFacets {
    let placed = rows.iter().flat_map(|&lat| columns.iter().map(move |&lon| vertex(lon, lat)));
    let placed: Vec<_> = placed.collect();
    let width = columns.len() as u32;
    let cells = (1..rows.len() as u32).flat_map(|row| (1..width).map(move |col| row * width + col));
    let triangles = cells.flat_map(|d| {
        let [a, b, c] = [d - width - 1, d - width, d - 1];
        match diagonals >> (d % 64) & 1 {
            0 => [[a, b, d], [a, d, c]],
            _ => [[a, b, c], [b, d, c]],
        }
    });
    let tile = DecodedTile {
        triangles: triangles.collect(),
        placed: placed.clone(),
        ..DecodedTile::default()
    };
    TileFacets::new(&tile, &placed)
}

/// Coordinates 1e-5 degrees apart, each repeated.
fn repeated(from: f64, times: &[usize]) -> Vec<f64> {
    let all = times.iter().enumerate();
    all.flat_map(|(n, &times)| std::iter::repeat_n(from + n as f64 * 1e-5, times)).collect()
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
        let once = [vec![1; columns.len()], vec![1; rows.len()]];
        let [width, height] = once.each_ref().map(|once| (once.len() - 1) as f64 * 1e-5);
        let [plain, doubled] = [once, [columns, rows]]
            .map(|[columns, rows]| lattice(&repeated(7.0, &columns), &repeated(46.0, &rows), 0));
        prop_assert_eq!(plain.facets.len(), doubled.facets.len());
        for (x, y) in places {
            let parallel = ProofParallel::at(46.0 + y * height);
            let meridians = [ProofMeridian::at(7.0 + x * width)];
            let [a, b] = [&plain, &doubled].map(|facets| {
                let mut from = from % facets.facets.len() as u32;
                facets.row(&mut from, &parallel, &meridians, &[1.0], 0.5, 1e-6)
            });
            let [max, other] = [a, b].map(|errors| errors.max.unwrap().0);
            prop_assert!((max - other).abs() < 1e-6 && a.over == b.over, "{:?} {:?}", a, b);
        }
    }
}

/// Sorted coordinates from one end to another, many of them near the ends.
fn uneven(from: f64, width: f64) -> impl Strategy<Value = Vec<f64>> {
    let part = prop_oneof![0.0..1.0_f64, 0.0001..0.01_f64, 0.99..0.9999_f64];
    prop::collection::vec(part, 1..6).prop_map(move |mut parts| {
        parts.extend([0.0, 1.0]);
        parts.sort_by(f64::total_cmp);
        parts.into_iter().map(|part| from + part * width).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Distances do not depend on where the search begins: parallels bend, so that a tile is not convex.
    #[test]
    fn every_walk_ends_at_the_same_distance(
        (south, columns, rows) in (-84.0..60.0_f64, 0.01..22.5_f64).prop_flat_map(|(south, width)| {
            (Just(south), uneven(7.0, width), uneven(south, width))
        }),
        diagonals: u64,
        place in (0.001..0.999_f64, prop_oneof![0.0..1.0_f64, 0.0..0.01, 0.99..1.0]),
    ) {
        let facets = lattice(&columns, &rows, diagonals);
        let width = columns.last().unwrap() - 7.0;
        let (parallel, at) =
            (ProofParallel::at(south + place.1 * width), ProofMeridian::at(7.0 + place.0 * width));
        let distance = |mut from: u32| {
            facets.row(&mut from, &parallel, &[at], &[1.0], 0.5, 0.0).max.unwrap().0
        };
        // The distance by testing every triangle, if one is met.
        let frame = ProofEastNorthUp::new(&parallel, at, 1.0);
        let all = facets.facets.iter().map(|facet| facets.corners_in(&frame, facet));
        let met = all.filter(|corners| is_met(*corners, 0.0).is_some());
        let met = met.map(|corners| plane(corners)[0].abs());
        let expected = met.reduce(f64::max).unwrap_or_else(|| distance(0));
        for from in 0..facets.facets.len() as u32 {
            let found = distance(from);
            prop_assert!((found - expected).abs() < 1e-3, "{} {} {}", from, found, expected);
        }
    }
}

/// A tile of degenerate triangles only is measured, and is infinitely far from all samples.
#[test]
fn a_surface_without_area_is_far_from_everything() {
    let facets = lattice(&[7.0; 2], &[46.0; 2], 0);
    let (parallel, meridians) = (ProofParallel::at(46.0), [ProofMeridian::at(7.0)]);
    let errors = facets.row(&mut 0, &parallel, &meridians, &[0.0], 0.5, 1e-6);
    assert_eq!((errors.count, errors.over), (1, 1));
}
