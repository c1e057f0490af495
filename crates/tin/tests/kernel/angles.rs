//! The bound on angles: no triangle of a tile alone is thinner, whatever the cells, and all else holds.

use super::*;
use terrane_tin::MinimumAngle;

/// The smallest angle in degrees, where columns and rows go on by these vectors.
fn smallest(corners: [TilePosition; 3], [col, row]: [[f64; 2]; 2]) -> f64 {
    let at = corners.map(|p| {
        let [cols, rows] = [f64::from(p.col()), f64::from(p.row())];
        [0, 1].map(|axis| cols * col[axis] + rows * row[axis])
    });
    let angle = |i: usize| {
        let [from, a, b] = [at[i], at[(i + 1) % 3], at[(i + 2) % 3]];
        let direction = |to: [f64; 2]| (to[1] - from[1]).atan2(to[0] - from[0]).to_degrees();
        let turn = (direction(a) - direction(b)).abs();
        turn.min(360.0 - turn)
    };
    (0..3).map(angle).fold(180.0, f64::min)
}

/// Square, oblong either way, and turned.
const STEPS: [[[f64; 2]; 2]; 4] = [
    [[1.0, 0.0], [0.0, 1.0]],
    [[10.0, 0.0], [0.0, -15.0]],
    [[2.0, 0.0], [0.0, 1.0]],
    [[4.0, 3.0], [3.0, -4.0]],
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn no_angle_of_a_tile_alone_is_smaller(
        width in 2_u32..70, height in 2_u32..70, seed in 0_u32..1000, holes in 0_u32..4,
        tolerance in 0_i32..80, drop: bool, of_surface: bool, which in 0_usize..4, share in 0.1..1.0
    ) {
        let steps = STEPS[which];
        let halves = [[(0, 0), (2, 0), (0, 1)], [(0, 0), (1, 0), (0, 2)]];
        let most = halves.map(|half| smallest(half.map(|(c, r)| TilePosition::new(c, r)), steps));
        let degrees = share * most[0].min(most[1]);
        let min_angle = Some(MinimumAngle::new(degrees, steps[0], steps[1]));
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let spec = TinSpec { drop, bound, min_angle, ..spec(tolerance.into()) };
        let grid = Grid::hills(width, height, seed, holes);
        let mesh = whole(&grid, &spec);
        check_all(&grid, &mesh.triangles, tolerance.into(), 1);
        check_delaunay(&mesh.triangles);
        if of_surface {
            check_between(&grid, &mesh.triangles, tolerance.into(), 1);
        }
        for triangle in &mesh.triangles {
            let least = smallest(triangle.corners, steps);
            prop_assert!(least >= degrees - 1e-6, "{least} of {degrees}: {triangle:?}");
        }
    }
}
