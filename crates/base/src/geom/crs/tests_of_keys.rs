//! Systems that are told by GeoKeys against those that texts and codes tell.

use super::definition::{EpsgName, Projected};
use super::method::{METHODS, ProjectionMethod, ProjectionParameter};
use super::*;

/// Keys of numbers, of doubles and of texts.
fn keys(shorts: &[(u16, u16)], doubles: &[(u16, f64)], texts: &[(u16, &str)]) -> Crs {
    let count = (shorts.len() + doubles.len() + texts.len()) as u16;
    let (mut raw, mut ascii) = (vec![1, 1, 0, count], String::new());
    shorts.iter().for_each(|(id, value)| raw.extend([*id, 0, 1, *value]));
    (0..).zip(doubles).for_each(|(i, (id, _))| raw.extend([*id, 34_736, 1, i]));
    for (id, text) in texts {
        raw.extend([*id, 34_737, text.len() as u16 + 1, ascii.len() as u16]);
        ascii += &format!("{text}|");
    }
    GeoKeys::new(raw, doubles.iter().map(|double| double.1).collect(), ascii).into_crs()
}

fn code(epsg: u32) -> Crs {
    Crs { epsg: Some(epsg), ..Crs::default() }
}

/// The system of a method, with a number of its own for each role.
fn by_text(
    method: &'static ProjectionMethod,
    number: impl Fn(ProjectionParameter) -> f64,
    unit: &LengthUnit,
) -> Crs {
    let given = |role| method.roles.contains(&role).then(|| number(role));
    let base = codes::geographic(4326).unwrap();
    let name = EpsgName { name: "own".to_owned(), code: None };
    let own = Projected::new(name, base, method, given, unit.clone()).unwrap();
    wkt::from_text(&CrsDefinition { horizontal: Horizontal::Projected(own), vertical: None }.wkt())
}

#[test]
fn a_projection_of_keys_is_that_of_its_text() {
    let number = |role| {
        10.0 + 0.5 * ProjectionParameter::ALL.iter().position(|own| *own == role).unwrap() as f64
    };
    for method in METHODS {
        for unit in [9001, 9002, 9003] {
            let text = by_text(method, number, &LengthUnit::of_code(unit).unwrap());
            // Each key that may hold a number, and one number moved at a time.
            for (which, moved) in (0..3).flat_map(|k| (0..=method.roles.len()).map(move |m| (k, m)))
            {
                let own = |(i, role): (usize, &ProjectionParameter)| {
                    let ids = role.keys();
                    let id = ids[which.min(ids.len() - 1)];
                    (id, number(*role) + if i == moved { 1.0 } else { 0.0 })
                };
                let doubles: Vec<(u16, f64)> = method.roles.iter().enumerate().map(own).collect();
                let shorts =
                    [(1024, 1), (2048, 4326), (3072, 32_767), (3075, method.code), (3076, unit)];
                let found = keys(&shorts, &doubles, &[]);
                let (is_same, what) = (moved == method.roles.len(), method.name);
                assert_eq!(found.agrees(&text), is_same, "{what} {which} {moved}");
                assert_eq!(text.agrees(&found), is_same, "{what} {which} {moved}");
                assert!(
                    is_same || found.distinct_names(&text)[0] != found.distinct_names(&text)[1]
                );
            }
        }
    }
}

#[test]
fn zones_are_those_of_their_codes() {
    for zone in 1..=60_u16 {
        for (projection, epsg) in [(16_000, 32_600), (16_100, 32_700)] {
            let own = |unit| {
                let zone = projection + zone;
                let shorts = [(1024, 1), (2048, 4326), (3072, 32_767), (3074, zone), (3076, unit)];
                keys(&shorts, &[], &[])
            };
            let metres = own(9001);
            for other in 1..=60 {
                let is_same = other == zone;
                assert_eq!(metres.agrees(&code(epsg + u32::from(other))), is_same, "{zone}");
            }
            let feet = own(9002).to_wkt().unwrap();
            assert!(!wkt::from_text(&feet).agrees(&metres));
            assert!(feet.contains("\"false_easting\",1640419.94750656"), "{feet}");
        }
    }
    for (projection, base) in [(16_061, 4326), (16_100, 4326), (16_161, 4326), (16_000, 4326)] {
        let shorts = [(1024, 1), (2048, base), (3072, 32_767), (3074, projection), (3076, 9001)];
        assert_eq!(keys(&shorts, &[], &[]).to_wkt(), None, "{projection}");
    }
}

#[test]
fn a_figure_of_keys_is_that_of_its_numbers() {
    let text = "GCS Name = mine|Datum = here|Ellipsoid = egg|Primem = Paris|";
    let own = |shorts: &[(u16, u16)], doubles: &[(u16, f64)], text: &str| {
        let shorts = [&[(1024, 2), (2048, 32_767)], shorts].concat();
        keys(&shorts, doubles, &[(2049, text)]).to_wkt()
    };
    let user = [(2050, 32_767), (2056, 32_767)];
    for (third, flattening) in [
        ((2059, 298.25), 298.25),
        ((2058, 6_000_000.0 - 20_000.0), 300.0),
        ((2058, 6_000_000.0), 0.0),
    ] {
        let found = own(&user, &[(2057, 6_000_000.0), third, (2061, 2.5)], text).unwrap();
        let expected = format!("\"egg\",6000000,{flattening}]");
        assert!(found.starts_with("GEOGCS[\"mine\",DATUM[\"here\""), "{found}");
        assert!(found.contains(&expected) && found.contains("PRIMEM[\"Paris\",2.5]"), "{found}");
    }
    // No name of the meridian counts where it is that of Greenwich.
    let found = own(&user, &[(2057, 6_000_000.0), (2059, 298.25)], text).unwrap();
    assert!(found.contains("PRIMEM[\"Greenwich\",0]"), "{found}");
    let found = own(&user, &[(2057, 6_000_000.0), (2059, 298.25)], "plain").unwrap();
    assert!(found.contains("GEOGCS[\"plain\",DATUM[\"unknown"), "{found}");
    // By the code of the datum, or of the ellipsoid.
    let datum = own(&[(2050, 6326)], &[], "WGS 84").unwrap();
    assert!(wkt::from_text(&datum).agrees(&code(4326)), "{datum}");
    let ellipsoid = own(&[(2050, 32_767), (2056, 7030)], &[], "Datum = here|").unwrap();
    assert!(ellipsoid.contains(",6378137,298.257223563"), "{ellipsoid}");
    assert!(!wkt::from_text(&ellipsoid).agrees(&code(4326)), "{ellipsoid}");
    // Nothing is known without a figure, with angles in grads, or from a meridian that is only named.
    for extra in [vec![], vec![(2056, 7030), (2054, 9105)], vec![(2056, 7030), (2051, 8903)]] {
        assert_eq!(own(&[&[(2050, 32_767)][..], &extra].concat(), &[], "x"), None, "{extra:?}");
    }
    for angles in [9102, 9122] {
        assert!(own(&[(2050, 6326), (2054, angles), (2051, 8901)], &[], "x").is_some());
    }
}

#[test]
fn what_is_not_understood_agrees_where_it_is_spelt_alike() {
    let strange = |method, text| {
        keys(&[(1024, 1), (3072, 32_767), (3075, method)], &[(3081, 4.0)], &[(1026, text)])
    };
    let one = strange(9999, "a");
    assert!(one.agrees(&strange(9999, "a")) && !one.agrees(&strange(9998, "a")));
    assert!(!one.agrees(&strange(9999, "b")));
    // What raster positions mean does not matter, and neither does how a text is spaced.
    let mut other = one.clone();
    other.geo_keys[3] += 1;
    other.geo_keys.extend([1025, 0, 1, 2]);
    assert!(other != one && other.agrees(&one));
    let text = |text: &str| wkt::from_text(text);
    let own = r#"PROJCS["a",GEOGCS["b"],PROJECTION["Nobody_Knows"]]"#;
    assert!(text(own).agrees(&text(&own.replace(',', ", "))));
    assert!(!text(own).agrees(&text(&own.replace("Knows", "Cares"))));
}

#[test]
fn numbers_are_alike_within_their_slack() {
    let number = |role| {
        10.0 + 0.5 * ProjectionParameter::ALL.iter().position(|own| *own == role).unwrap() as f64
    };
    for method in METHODS {
        let metre = LengthUnit::metre();
        let own = by_text(method, number, &metre);
        for moved in method.roles {
            for (part, is_same) in [(0.4, true), (-0.4, true), (3.0, false), (-3.0, false)] {
                let slack = match moved {
                    ProjectionParameter::Easting | ProjectionParameter::Northing => 1e-3,
                    ProjectionParameter::Scale => 1e-10,
                    _ => 1e-8,
                };
                let by =
                    |role: ProjectionParameter| if role == *moved { part * slack } else { 0.0 };
                let other = by_text(method, |role| number(role) + by(role), &metre);
                assert_eq!(own.agrees(&other), is_same, "{} {moved:?} {part}", method.name);
            }
        }
    }
}

#[test]
fn what_tells_systems_apart_is_named() {
    let own = |latitude, vertical| {
        let shorts = [(1024, 1), (2048, 4326), (3072, 32_767), (3075, 1), (4096, vertical)];
        keys(&shorts, &[(3081, latitude), (3092, 0.5)], &[(1026, "own")])
    };
    let found = own(4.0, 5703).distinct_names(&own(5.5, 5703));
    assert_eq!(found, ["own with latitude_of_origin 4", "own with latitude_of_origin 5.5"]);
    let [heights, depths] = [5703, 6357].map(|vertical| own(4.0, vertical));
    let found = heights.distinct_names(&depths);
    assert!(found[0].starts_with("own with heights NAVD88 height in metre"), "{found:?}");
    let text = heights.to_wkt().unwrap();
    assert!(text.starts_with("COMPD_CS[\"own + NAVD88 height\",PROJCS[\"own\","), "{text}");
    let in_feet = |unit| {
        let shorts = [(1024, 1), (2048, 4326), (3072, 32_767), (3075, 1), (4096, 5703)];
        keys(&[&shorts[..], &[(4099, unit)]].concat(), &[(3081, 4.0), (3092, 0.5)], &[])
    };
    assert!(in_feet(9001).agrees(&heights) && !in_feet(9003).agrees(&heights));
    // A known text stays as it is, with the heights beside it.
    let utm = Crs { vertical_epsg: Some(5703), ..code(32_611) }.to_wkt().unwrap();
    let known = code(32_611).to_wkt().unwrap();
    assert!(utm.starts_with("COMPD_CS[") && utm.contains(&known) && utm.contains("VERT_CS["));
}

#[test]
fn texts_of_other_angles_and_other_names() {
    let text = |method: &str, numbers: &[(&str, f64)], angle: &str| {
        let numbers: String =
            numbers.iter().map(|(name, n)| format!(",PARAMETER[\"{name}\",{n}]")).collect();
        wkt::from_text(&format!(
            "PROJCS[\"a\",GEOGCS[\"GCS_WGS_1984\",DATUM[\"D_WGS_1984\",SPHEROID[\"WGS_1984\",6378137.0,298.257223563]],\
             PRIMEM[\"Greenwich\",0.0],UNIT[{angle}]],PROJECTION[\"{method}\"]{numbers},UNIT[\"Meter\",1.0]]"
        ))
    };
    let degree = "\"Degree\",0.0174532925199433";
    let one = [("latitude_of_origin", 40.0), ("central_meridian", 3.0), ("scale_factor", 0.99)];
    let esri = [&one[..], &[("Standard_Parallel_1", 40.0)]].concat();
    let (first, second) = ("Lambert_Conformal_Conic_1SP", "Lambert_Conformal_Conic");
    let own = text(first, &one, degree);
    assert!(own.agrees(&text(second, &esri, degree)) && own.parts().0.is_some());
    assert!(!own.agrees(&text(first, &one, "\"Grad\",0.015707963267949")));
    assert!(text(first, &one, "\"Grad\",0.015707963267949").parts().0.is_none());
    for (name, epsg) in [
        ("WGS_1984_UTM_Zone_7N", Some(32_607)),
        ("WGS_1984_UTM_Zone_7S", Some(32_707)),
        ("NAD_1927_UTM_Zone_22N", Some(26_722)),
        ("NAD_1983_UTM_Zone_23N", Some(26_923)),
        ("ETRS_1989_UTM_Zone_28N", Some(25_828)),
        ("ETRS_1989_UTM_Zone_39N", None),
        ("NAD_1983_UTM_Zone_7S", None),
        ("GCS_ETRS_1989", Some(4258)),
    ] {
        assert_eq!(wkt::from_text(&format!("PROJCS[\"{name}\"]")).epsg, epsg, "{name}");
    }
    assert!(wkt::of_srs(" ").is_unknown() && !wkt::of_srs("my grid").is_unknown());
    assert_eq!(wkt::of_srs("my grid").citation.as_deref(), Some("my grid"));
    // Two axes and a height, or three from the centre of the Earth.
    let system = |cs: &str| {
        wkt::from_text(&format!(
            "GEODCRS[\"x\",DATUM[\"World Geodetic System 1984\",ELLIPSOID[\"WGS 84\",6378137,298.257223563]],\
             CS[{cs}],AXIS[\"x\",north],UNIT[\"degree\",0.0174532925199433]]"
        ))
    };
    let found = ["ellipsoidal,2", "ellipsoidal,3", "Cartesian,3"].map(system);
    assert_eq!(found.each_ref().map(|crs| crs.geographic), [Some(true), Some(true), Some(false)]);
    let units = found.each_ref().map(|crs| crs.vertical_unit.as_deref());
    assert_eq!(units[..2], [None, Some("metre")]);
}
