//! Derivatives of surfaces whose own are known.

use proptest::prelude::*;

use super::*;

/// Where columns and rows lead: by column east and north, by row east and north, in metres.
fn turn([[a, d], [b, e]]: [[f64; 2]; 2]) -> Turn {
    let determinant = a * e - b * d;
    [[e / determinant, -d / determinant], [-b / determinant, a / determinant]]
}

/// Nine heights of a surface, on a lattice.
fn heights([[a, d], [b, e]]: [[f64; 2]; 2], of: impl Fn(f64, f64) -> f64) -> Heights {
    std::array::from_fn(|i| {
        let (col, row) = ((i % 3) as f64 - 1.0, (i / 3) as f64 - 1.0);
        of(col * a + row * b, col * d + row * e)
    })
}

/// As angles are told: the same but for whole turns.
fn apart(a: f64, b: f64) -> f64 {
    let off = (a - b).rem_euclid(360.0);
    off.min(360.0 - off)
}

proptest! {
    /// Of quadratic surfaces, on lattices that are turned, sheared or have the south above.
    #[test]
    fn derivatives_are_those_of_the_surface(
        x in -2.0..2.0_f64, y in -2.0..2.0_f64, xx in -0.1..0.1_f64, xy in -0.1..0.1_f64, yy in -0.1..0.1_f64,
        angle in 0.0..7.0_f64, step in 0.5..50.0_f64, flip: bool, azimuth in -400.0..800.0_f64, altitude in 1.0..90.0_f64,
    ) {
        prop_assume!(x.hypot(y) > 1e-3);
        let (sin, cos) = angle.sin_cos();
        let down = if flip { step } else { -step };
        let lattice = [[step * cos, step * sin], [-down * sin, down * cos]];
        let z = heights(lattice, |east, north| {
            700.0 + x * east + y * north + xx * east * east / 2.0 + xy * east * north + yy * north * north / 2.0
        });
        let turn = turn(lattice);
        let steep = x.hypot(y);
        for gradient in [Gradient::Horn, Gradient::ZevenbergenThorne] {
            let [east, north] = gradient.of(&z, &turn);
            prop_assert!((east - x).abs() < 1e-9 && (north - y).abs() < 1e-9);
            let slope = Slope { gradient, is_percent: false }.at(&z, &turn);
            prop_assert!((slope - steep.atan().to_degrees()).abs() < 1e-7);
            let percent = Slope { gradient, is_percent: true }.at(&z, &turn);
            prop_assert!((percent - 100.0 * steep).abs() < 1e-6);
            // Downhill, from north by east.
            let aspect = Aspect { gradient, zero_for_flat: false }.at(&z, &turn);
            let fall = [aspect.to_radians().sin(), aspect.to_radians().cos()];
            prop_assert!((fall[0] * x + fall[1] * y + steep).abs() < 1e-6 && (0.0..360.0).contains(&aspect));
            // The cosine between two unit vectors.
            let usual = Hillshade { gradient, azimuth, altitude, ..Hillshade::default() };
            let (az, alt) = (azimuth.to_radians(), altitude.to_radians());
            let light = [az.sin() * alt.cos(), az.cos() * alt.cos(), alt.sin()];
            let length = (1.0 + x * x + y * y).sqrt();
            let lit = (light[2] - light[0] * x - light[1] * y) / length;
            prop_assert!((usual.at(&z, &turn) - (1.0 + 254.0 * lit.max(0.0))).abs() <= 0.5 + 1e-6);
            let four = Hillshade { light: HillshadeMode::Four, ..usual }.at(&z, &turn);
            // Each light counts by the square of the cosine between it and the aspect.
            let mixed: f64 = [225.0_f64, 270.0, 315.0, 360.0]
                .map(|azimuth| {
                    let az = azimuth.to_radians();
                    let light = [az.sin() * alt.cos(), az.cos() * alt.cos(), alt.sin()];
                    let lit = (light[2] - light[0] * x - light[1] * y) / length;
                    (aspect.to_radians() - az).cos().powi(2) * lit.max(0.0) / 2.0
                })
                .iter()
                .sum();
            prop_assert!((four - (1.0 + 254.0 * mixed)).abs() <= 0.5 + 1e-6);
        }
        let of = |kind| Curvature(kind).at(&z, &turn);
        let along = x * x * xx + 2.0 * x * y * xy + y * y * yy;
        let across = y * y * xx - 2.0 * x * y * xy + x * x * yy;
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * (1.0 + steep.powi(-2));
        prop_assert!(near(of(CurvatureKind::General), -(xx + yy)));
        prop_assert!(near(of(CurvatureKind::Profile), -along / steep.powi(2)));
        prop_assert!(near(of(CurvatureKind::Plan), -across / steep.powi(2)));
        prop_assert!(near(of(CurvatureKind::Profile) + of(CurvatureKind::Plan), of(CurvatureKind::General)));
    }

    /// By their definitions, sample by sample; and a row is its samples.
    #[test]
    fn differences_are_those_of_nine_heights(z in prop::array::uniform32(-50.0..50.0_f64), void in 0_usize..96) {
        let row = |k: usize| -> Vec<f64> {
            (0..12).map(|i| if k * 12 + i == void { f64::NAN } else { z[(k * 12 + i) % 32] }).collect()
        };
        let rows = [row(0), row(1), row(2)];
        let turn = [[0.1, 0.0], [0.0, -0.1]];
        let kinds: [&dyn Derivative; 6] = [
            &Roughness, &TopographicPositionIndex, &Ruggedness(RuggednessMeasure::Riley), &Ruggedness(RuggednessMeasure::Wilson),
            &Slope::default(), &Curvature(CurvatureKind::Plan),
        ];
        for (k, kind) in kinds.into_iter().enumerate() {
            let mut out = [0.0; 10];
            kind.row(rows.each_ref().map(|row| &row[..]), &turn, &mut out);
            for (i, out) in out.into_iter().enumerate() {
                let nine: Vec<f64> = rows.iter().flat_map(|row| row[i..i + 3].to_vec()).collect();
                let here = nine[4];
                let mut sorted = nine.clone();
                sorted.sort_by(f64::total_cmp);
                let off: Vec<f64> = nine.iter().map(|z| (z - here).abs()).collect();
                let expected = match k {
                    _ if nine.iter().any(|z| z.is_nan()) => f64::NAN,
                    0 => sorted[8] - sorted[0],
                    1 => here - (nine.iter().sum::<f64>() - here) / 8.0,
                    2 => off.iter().map(|z| z * z).sum::<f64>().sqrt(),
                    3 => off.iter().sum::<f64>() / 8.0,
                    _ => kind.at(&std::array::from_fn(|i| nine[i]), &turn),
                };
                prop_assert!(out.is_nan() && expected.is_nan() || (out - expected).abs() < 1e-9, "{} {}", k, i);
            }
        }
    }
}

#[test]
fn rows_of_shades_are_their_samples() {
    let height = |k: usize| match k % 97 {
        13 => f64::NAN,
        _ => (k * 7919 % 1009) as f64 * if k.is_multiple_of(3) { 0.01 } else { 3.0 },
    };
    let rows: [Vec<f64>; 3] =
        std::array::from_fn(|row| (0..203).map(|col| height(row * 203 + col)).collect());
    let turn = [[0.1, 0.02], [0.0, -0.1]];
    for (light, gradient) in [
        (HillshadeMode::One, Gradient::Horn),
        (HillshadeMode::One, Gradient::ZevenbergenThorne),
        (HillshadeMode::Combined, Gradient::Horn),
        (HillshadeMode::Four, Gradient::Horn),
    ] {
        let shade = Hillshade { light, gradient, exaggeration: 0.3, ..Hillshade::default() };
        let mut out = [0.0; 201];
        shade.row(rows.each_ref().map(|row| &row[..]), &turn, &mut out);
        for (i, out) in out.into_iter().enumerate() {
            let nine = std::array::from_fn(|k| rows[k / 3][i + k % 3]);
            let is_void = nine.iter().any(|z: &f64| z.is_nan());
            let expected = if is_void { f64::NAN } else { shade.at(&nine, &turn) };
            assert_eq!(out.to_bits(), expected.to_bits(), "{light:?} {i}");
        }
    }
}

#[test]
fn level_ground_has_no_aspect_and_no_curvature() {
    let (z, turn) = ([5.0; 9], [[0.1, 0.0], [0.0, -0.1]]);
    assert!(Aspect::default().at(&z, &turn).is_nan());
    assert_eq!(Aspect { zero_for_flat: true, ..Aspect::default() }.at(&z, &turn), 0.0);
    for kind in [CurvatureKind::General, CurvatureKind::Profile, CurvatureKind::Plan] {
        assert_eq!(Curvature(kind).at(&z, &turn), 0.0);
    }
    for light in [HillshadeMode::One, HillshadeMode::Four] {
        assert_eq!(Hillshade { light, ..Hillshade::default() }.at(&z, &turn), 181.0);
    }
    assert_eq!(
        Hillshade { light: HillshadeMode::Combined, ..Hillshade::default() }.at(&z, &turn),
        255.0
    );
}

/// The four sides of the sky, as a compass has them.
#[test]
fn aspects_go_from_north_by_east() {
    let lattice = [[10.0, 0.0], [0.0, -10.0]];
    for (fall, expected) in [
        ([0.0, 1.0], 0.0),
        ([1.0, 1.0], 45.0),
        ([1.0, 0.0], 90.0),
        ([0.0, -1.0], 180.0),
        ([-1.0, 0.0], 270.0),
        ([-1.0, 1.0], 315.0),
    ] {
        let z = heights(lattice, |east, north| -(fall[0] * east + fall[1] * north));
        let found = Aspect::default().at(&z, &turn(lattice));
        assert!(apart(found, expected) < 1e-9, "{fall:?} {found}");
    }
}
