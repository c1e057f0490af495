//! Operations held against PROJ, against themselves, and against what must be refused.

use std::sync::Arc;

use proptest::prelude::*;
use terrane_base::error::ErrorKind;
use terrane_base::geom::Crs;
use terrane_base::geom::wkt::{from_text, of_srs};

use super::{CoordinateOperation, CoordinateOperationOptions, Geoid};

/// What PROJ finds (`tools/compare_operations.py --table`): code, x, y, longitude and latitude on WGS 84.
const POSITIONS: &str = include_str!("positions.tsv");

/// Metres of a degree.
const DEGREE: f64 = 111_320.0;

fn code(code: u32) -> Crs {
    of_srs(&format!("EPSG:{code}"))
}

fn within(
    from: &Crs,
    to: &Crs,
    extent: [f64; 4],
) -> terrane_base::error::Result<CoordinateOperation> {
    CoordinateOperation::between(
        from,
        to,
        &CoordinateOperationOptions {
            extent: Some(extent),
            ..CoordinateOperationOptions::default()
        },
    )
}

/// Rows of one system, and the rectangle they lie in.
fn systems() -> Vec<(u32, Vec<[f64; 4]>, [f64; 4])> {
    let mut all: Vec<(u32, Vec<[f64; 4]>, [f64; 4])> = Vec::new();
    for line in POSITIONS.lines() {
        let numbers: Vec<f64> = line.split('\t').map(|word| word.parse().unwrap()).collect();
        let [own, x, y, longitude, latitude] = numbers[..] else { panic!("{line}") };
        if all.last().is_none_or(|last| last.0 != own as u32) {
            all.push((own as u32, Vec::new(), [f64::MAX, f64::MAX, f64::MIN, f64::MIN]));
        }
        let (_, rows, extent) = all.last_mut().unwrap();
        rows.push([x, y, longitude, latitude]);
        *extent = [extent[0].min(x), extent[1].min(y), extent[2].max(x), extent[3].max(y)];
    }
    all
}

/// To WGS 84, by what is best for a rectangle; without any where a pole is in it.
fn wgs84(crs: &Crs, extent: [f64; 4]) -> terrane_base::error::Result<CoordinateOperation> {
    let has_pole = CoordinateOperation::to_wgs84(crs, Some(extent))
        .is_err_and(|e| e.to_string().contains("a pole"));
    CoordinateOperation::to_wgs84(crs, (!has_pole).then_some(extent))
}

fn metres(a: [f64; 2], b: [f64; 2]) -> f64 {
    let east = (a[0] - b[0] + 180.0).rem_euclid(360.0) - 180.0;
    (east * a[1].to_radians().cos()).hypot(a[1] - b[1]) * DEGREE
}

#[test]
fn positions_are_those_of_proj_there_and_back() {
    let all = systems();
    assert!(all.len() > 80);
    for (own, rows, extent) in all {
        let operation = wgs84(&code(own), extent).unwrap();
        let back = operation.inverse();
        let unit = code(own).horizontal_metres().unwrap_or(DEGREE);
        for [x, y, longitude, latitude] in rows {
            let found = operation.position([x, y]).unwrap();
            assert!(metres(found, [longitude, latitude]) < 1e-3, "{own} {found:?}");
            let [u, v] = back.position(found).unwrap();
            let across =
                if unit == DEGREE { (u - x + 180.0).rem_euclid(360.0) - 180.0 } else { u - x };
            assert!(across.hypot(v - y) * unit < 1e-3, "{own} {u} {v}");
        }
    }
}

/// On lines of any step within the area of a system and far beyond it, there and back.
#[test]
fn positions_on_a_line_are_those_one_by_one() {
    let (mut found, mut none) = (0, 0);
    for (own, _, extent) in systems() {
        let operation = wgs84(&code(own), extent).unwrap();
        let [x0, y0, x1, y1] = extent;
        let [width, height] = [x1 - x0, y1 - y0];
        for step in [1e-5, 0.003, 0.1, 1.7] {
            let there: Vec<[f64; 2]> = (0..75)
                .map(|i| f64::from(i) * step)
                .map(|t| [x0 + width * (0.3 + t), y0 + height * (0.6 - 0.7 * t)])
                .collect();
            let degrees: Vec<[f64; 2]> = (0..75)
                .map(|i| f64::from(i - 37) * step * 10.0)
                .map(|t| [own.rem_euclid(360) as f64 - 180.0 + 3.0 * t, 50.0 + t])
                .collect();
            for (operation, line) in [(&operation, there), (&operation.inverse(), degrees)] {
                let mut together = line.clone();
                operation.transform_line(&mut together);
                for (at, own_at) in line.iter().zip(&together) {
                    match operation.position(*at) {
                        Ok(alone) => assert_eq!(alone, *own_at, "{own} {at:?}"),
                        Err(_) => assert!(own_at[0].is_nan(), "{own} {at:?} {own_at:?}"),
                    }
                    found += usize::from(!own_at[0].is_nan());
                    none += usize::from(own_at[0].is_nan());
                }
            }
        }
    }
    assert!(found > 10_000 && none > 10_000, "{found} {none}");
}

#[test]
fn systems_by_text_are_those_by_code() {
    let mut compared = 0;
    for (own, rows, extent) in systems() {
        let by_code = wgs84(&code(own), extent).unwrap();
        let Some(text) = code(own).to_wkt() else { continue };
        // The same numbers without any code.
        let parts: Vec<&str> = text.split(",AUTHORITY[").collect();
        let plain: String = std::iter::once(parts[0])
            .chain(parts[1..].iter().filter_map(|part| Some(part.split_once(']')?.1)))
            .collect();
        let crs = from_text(&plain);
        assert_eq!(crs.epsg, None, "{plain}");
        // Those whose methods only codes tell, and datums by names that programs spell otherwise.
        let Ok(by_text) = wgs84(&crs, extent) else { continue };
        compared += 1;
        for [x, y, ..] in rows {
            let [a, b] = [&by_code, &by_text].map(|own| own.position([x, y]).unwrap());
            assert!(metres(a, b) < 1e-3, "{own}: {a:?} {b:?}\n{plain}");
        }
    }
    assert!(compared > 75, "{compared}");
}

#[test]
fn every_code_is_computed_or_refused_and_comes_back() {
    let (mut computed, mut refused) = (0, 0);
    for own in 1..=32_767 {
        let crs = code(own);
        let operation =
            match crs.conversion().and_then(|_| CoordinateOperation::to_wgs84(&crs, None)) {
                Ok(operation) => operation,
                Err(error) => {
                    assert!(matches!(error.kind(), ErrorKind::Unsupported), "{own}: {error}");
                    refused += usize::from(crs.is_named() && crs.citation.is_some());
                    continue;
                }
            };
        computed += 1;
        // Of any place where it can be used at all: a lattice of the globe.
        let back = operation.inverse();
        for place in (-5..=5)
            .flat_map(|r| (-17..18).map(move |c| [f64::from(c) * 10.0, f64::from(r) * 15.0]))
        {
            // Far away, a position may be just too inexact to be taken back.
            let Ok(at) = back.position(place) else { continue };
            let Ok(found) = operation.position(at) else { continue };
            assert!(metres(found, place) < 2e-3, "{own} {place:?} {found:?}");
        }
    }
    assert!(computed > 5000, "{computed} computed, {refused} refused");
}

proptest! {
    #[test]
    fn the_way_back_leads_back(which in 0usize..87, u in 0.0..1.0, v in 0.0..1.0) {
        let all = systems();
        let (own, _, [x0, y0, x1, y1]) = &all[which % all.len()];
        let at = [x0 + u * (x1 - x0), y0 + v * (y1 - y0)];
        let operation = wgs84(&code(*own), [*x0, *y0, *x1, *y1]).unwrap();
        if let Ok(there) = operation.position(at) {
            let back = operation.inverse().position(there).unwrap();
            let unit = code(*own).horizontal_metres().unwrap_or(DEGREE);
            let across = match unit == DEGREE {
                true => (back[0] - at[0] + 180.0).rem_euclid(360.0) - 180.0,
                false => back[0] - at[0],
            };
            prop_assert!(across.hypot(back[1] - at[1]) * unit < 1e-3, "{own} {at:?} {back:?}");
        }
    }
}

#[test]
fn what_cannot_be_done_is_refused_by_name() {
    let swiss = [2_600_000.0, 1_200_000.0, 2_610_000.0, 1_210_000.0];
    let local = from_text(r#"LOCAL_CS["site",UNIT["metre",1]]"#);
    let own = code(27200);
    let moon = r#"GEOGCS["Moon 2000",DATUM["D_Moon_2000",SPHEROID["Moon",1737400,0]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]"#;
    let grid = code(5514);
    for (from, to, word) in [
        (code(2056), code(65000), "unknown EPSG code"),
        (local.clone(), code(4326), "a local (engineering) CRS"),
        (code(2056), local, "a local (engineering) CRS"),
        (code(2056), code(4978), "geocentric"),
        (own, code(4326), "\"nzmg\""),
        (code(8441), code(4326), "\"labrd\""),
        (
            from_text(moon),
            code(4326),
            "celestial bodies (radii 1737400 and 6378137 m); use a CRS of the same body",
        ),
        (code(2056), from_text(moon), "radii 6377397.155 and 1737400 m"),
        (Crs::default(), code(4326), "CRS is missing"),
        (grid, code(28992), "outside the area of use of the datum shift"),
    ] {
        let told = CoordinateOperation::between(&from, &to, &CoordinateOperationOptions::default())
            .and_then(|operation| operation.position([-600_000.0, -1_100_000.0]))
            .unwrap_err()
            .to_string();
        assert!(told.contains(word), "{told}");
    }
    // A shift is known, but not here.
    let told = within(&code(23032), &code(4326), [500_000.0, 1e6, 600_000.0, 2e6])
        .err()
        .unwrap()
        .to_string();
    assert!(told.contains("for the whole extent of the data"), "{told}");
    assert!(within(&code(2056), &code(4326), swiss).is_ok());
}

#[test]
fn positions_beyond_what_a_projection_reaches_are_errors() {
    let utm = CoordinateOperation::to_wgs84(&code(32632), None).unwrap();
    for at in [[5e8, 5e6], [5e5, 2.5e7], [f64::NAN, 0.0], [f64::INFINITY, 0.0]] {
        let told = utm.position(at).unwrap_err().to_string();
        assert!(told.contains("outside the domain"), "{told}");
    }
    let back = utm.inverse();
    for place in [[9.0, 91.0], [9.0, -90.5], [9.0, f64::NAN]] {
        let told = back.position(place).unwrap_err().to_string();
        assert!(told.contains("outside the domain"), "{place:?} {told}");
    }
    // The corner of a map of the world that is round.
    let sinusoidal = code(4326).conversion().unwrap();
    assert!(sinusoidal.proj.starts_with("+proj=longlat"));
    let polar = CoordinateOperation::to_wgs84(&code(3035), None).unwrap();
    assert!(polar.position([4e7, 4e7]).is_err());
}

#[test]
fn longitudes_go_on_across_180_degrees_and_poles_are_refused() {
    let extent = [400_000.0, 5_000_000.0, 900_000.0, 5_100_000.0];
    let operation = CoordinateOperation::to_wgs84(&code(32660), Some(extent)).unwrap();
    let [west, east] =
        [extent[0], extent[2]].map(|x| operation.position([x, 5_050_000.0]).unwrap()[0]);
    let crosses =
        (west + 180.0).rem_euclid(360.0) > 350.0 && (east + 180.0).rem_euclid(360.0) < 10.0;
    assert!(crosses && (0.0..10.0).contains(&(east - west)), "{west} {east}");
    assert!(operation.notes().iter().any(|note| note.contains("beyond 180 degrees")));
    let back = operation.inverse().position([east, 45.59]).unwrap();
    assert!((back[0] - 900_000.0).abs() < 2000.0, "{back:?}");
    // The same positions to a map that is cut there.
    let told = within(&code(32660), &code(3857), extent).err().unwrap().to_string();
    assert!(told.contains("discontinuous"), "{told}");
    let pole = [-1e6, -1e6, 1e6, 1e6];
    let told = within(&code(3413), &code(4326), pole).err().unwrap().to_string();
    assert!(told.contains("surround a pole"), "{told}");
    assert!(within(&code(3413), &code(3995), pole).is_ok());
    assert!(within(&code(3413), &code(4326), [1e5, 1e5, 1e6, 1e6]).is_ok());
}

#[test]
fn accuracies_add_up_and_datums_that_stand_for_wgs_84_are_told() {
    let utm = CoordinateOperation::between(
        &code(25832),
        &code(32632),
        &CoordinateOperationOptions::default(),
    )
    .unwrap();
    assert_eq!(utm.accuracy(), Some(1.0));
    assert!(utm.notes()[0].contains("is treated as WGS 84 (accuracy 1 m)"), "{:?}", utm.notes());
    let [x, y] = utm.position([500_000.0, 5e6]).unwrap();
    assert!((x - 500_000.0).hypot(y - 5e6) < 1e-3, "{x} {y}");
    let both = CoordinateOperation::between(
        &code(28992),
        &code(31370),
        &CoordinateOperationOptions::default(),
    )
    .unwrap();
    assert_eq!(both.accuracy(), Some(2.0));
    assert_eq!(
        both.name(),
        "Amersfoort to WGS 84 (3) (EPSG:15934), back by BD72 to WGS 84 (3) (EPSG:15929)"
    );
    let same = CoordinateOperation::between(
        &code(2154),
        &code(4171),
        &CoordinateOperationOptions::default(),
    )
    .unwrap();
    assert_eq!((same.accuracy(), same.name()), (Some(0.0), "the same datum"));
}

/// A geoid of 47 m everywhere.
fn level() -> Arc<Geoid> {
    let mut bytes: Vec<u8> =
        [-90.0f64, -180.0, 90.0, 90.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    bytes.extend([3u32, 5].iter().flat_map(|count| count.to_be_bytes()));
    bytes.extend([47.0f32; 15].iter().flat_map(|height| height.to_be_bytes()));
    Arc::new(Geoid::of_gtx(&bytes).unwrap())
}

#[test]
fn heights_are_kept_scaled_or_counted_from_the_ellipsoid() {
    let at = [555_000.0, 4_500_000.0, 100.0];
    let between = |from: &str, to: &str, geoid: Option<Arc<Geoid>>| {
        let options = CoordinateOperationOptions { geoid, ..CoordinateOperationOptions::default() };
        CoordinateOperation::between(&of_srs(from), &of_srs(to), &options)
    };
    let foot = 0.3048;
    let survey = 1200.0 / 3937.0;
    for (from, to, geoid, height) in [
        ("EPSG:6339", "EPSG:6318", false, 100.0),
        ("EPSG:6339+6360", "EPSG:6318", false, 100.0),
        ("EPSG:6339+5703", "EPSG:6318+6360", false, 100.0 / survey),
        ("EPSG:6339+8228", "EPSG:6318+5703", false, 100.0 * foot),
        // Heights and depths of one datum.
        ("EPSG:6339+5611", "EPSG:6318+5706", false, -100.0),
        ("EPSG:6339+5703", "EPSG:6319", true, 147.0),
        ("EPSG:6339+8228", "EPSG:6319", true, 100.0 * foot + 47.0),
        ("EPSG:6339", "EPSG:6319", true, 147.0),
    ] {
        let operation = between(from, to, geoid.then(level)).unwrap();
        let found = operation.point(at).unwrap();
        assert!((found[2] - height).abs() < 1e-9, "{from} {to} {found:?}");
        let back = operation.inverse().point(found).unwrap();
        assert!((0..3).all(|axis| (back[axis] - at[axis]).abs() < 1e-3), "{from} {to} {back:?}");
    }
    let kept = between("EPSG:6339+6360", "EPSG:6318", None).unwrap();
    assert_eq!((kept.target().epsg, kept.target().vertical_epsg), (Some(6318), Some(6360)));
    for (from, to, geoid, word) in [
        ("EPSG:6339+5703", "EPSG:6318+5773", false, "target heights are in EGM96 height"),
        ("EPSG:6339", "EPSG:6318+5703", false, "use a target CRS without heights"),
        ("EPSG:6339+5703", "EPSG:6319", false, "pass a geoid (‹geoid› FILE)"),
        ("EPSG:6339+5703", "EPSG:6318", true, "requires a target CRS with a vertical axis"),
        ("EPSG:6339+5703", "EPSG:6318+5773", true, "one geoid converts only"),
    ] {
        let told = between(from, to, geoid.then(level)).err().unwrap().to_string();
        assert!(told.contains(word), "{told}");
    }
}

#[test]
fn heights_above_an_ellipsoid_stay_with_a_datum_that_stands_for_the_other() {
    let between = |from: &str| {
        CoordinateOperation::between(
            &of_srs(from),
            &of_srs("EPSG:4979"),
            &CoordinateOperationOptions::default(),
        )
    };
    let found = between("EPSG:4937").unwrap().point([5.0, 52.0, 43.0]).unwrap();
    assert_eq!(found[2], 43.0);
    let bessel = r#"GEOGCRS["mine",DATUM["Amersfoort",ELLIPSOID["Bessel 1841",6377397.155,299.1528128]],CS[ellipsoidal,3],AXIS["latitude",north],AXIS["longitude",east],AXIS["height",up],ANGLEUNIT["degree",0.0174532925199433]]"#;
    let told = between(bessel).err().unwrap().to_string();
    assert!(told.contains("above the ellipsoid, target heights are above the ellipsoid"), "{told}");
}
