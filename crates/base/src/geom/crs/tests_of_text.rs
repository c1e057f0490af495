//! What single words and numbers of texts and keys say.

use super::node::{CrsWktNode, CrsWktValue};
use super::*;

/// A key directory of shorts, and of texts in the ASCII parameters.
fn keys(shorts: &[(u16, u16)], texts: &[(u16, &str)]) -> Crs {
    let (mut raw, mut ascii) = (vec![1, 1, 0, (shorts.len() + texts.len()) as u16], String::new());
    shorts.iter().for_each(|(id, value)| raw.extend([*id, 0, 1, *value]));
    for (id, text) in texts {
        raw.extend([*id, 34_737, text.len() as u16 + 1, ascii.len() as u16]);
        ascii += &format!("{text}|");
    }
    GeoKeys::new(raw, vec![], ascii).into_crs()
}

const NAD83: &str = r#"GEOGCS["NAD83",DATUM["North_American_Datum_1983",SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]"#;

/// A projected system on NAD83 in metres.
fn projected(projection: &str) -> Crs {
    wkt::from_text(&format!(r#"PROJCS["a",{NAD83},{projection},UNIT["metre",1]]"#))
}

/// One with heights.
fn with_heights(up: &str) -> Crs {
    let system = r#"PROJECTION["Cassini_Soldner"]"#;
    wkt::from_text(&format!(r#"COMPD_CS["b",PROJCS["a",{NAD83},{system},UNIT["metre",1]],{up}]"#))
}

#[test]
fn the_model_tells_the_kind_and_else_the_codes_do() {
    let kind = |shorts: &[(u16, u16)]| keys(shorts, &[]).geographic;
    assert_eq!(
        [1, 2, 3].map(|model| kind(&[(1024, model)])),
        [Some(false), Some(true), Some(false)]
    );
    assert_eq!(kind(&[(1024, 2), (3072, 32_611)]), Some(true));
    assert_eq!(kind(&[(1024, 1), (2048, 4326)]), Some(false));
    assert_eq!(kind(&[(3072, 32_611), (2048, 4326)]), Some(false));
    assert_eq!(kind(&[(2048, 4326)]), Some(true));
    assert_eq!(kind(&[(1026, 1)]), None);
}

#[test]
fn positions_are_of_samples_where_the_keys_say_so() {
    let is_point = |shorts: &[u16]| {
        GeoKeys::new([&[1, 1, 0, 1][..], shorts].concat(), vec![], String::new()).pixel_is_point()
    };
    assert!(is_point(&[1025, 0, 1, 2]));
    assert!(!is_point(&[1025, 0, 1, 1]) && !is_point(&[1024, 0, 1, 2]));
}

#[test]
fn a_system_is_called_by_the_citation_of_its_kind() {
    let texts = [(2049, "the geographic"), (3073, "the projected")];
    let name = |model, texts: &[(u16, &str)]| keys(&[(1024, model)], texts).citation;
    assert_eq!(name(1, &texts).as_deref(), Some("the projected"));
    assert_eq!(name(2, &texts).as_deref(), Some("the geographic"));
    assert_eq!(name(1, &texts[..1]).as_deref(), Some("the geographic"));
    assert_eq!(name(1, &[(1026, "both"), texts[1]]).as_deref(), Some("both"));
    assert_eq!(name(1, &[(3073, "PCS Name = own")]).as_deref(), Some("own"));
}

#[test]
fn geocentric_keys_have_no_meaning_across() {
    let zone = [(2050, 6326), (3072, 32_767), (3074, 16_011), (3076, 9001)];
    let of = |model| keys(&[&[(1024, model)][..], &zone].concat(), &[]).to_wkt();
    assert!(of(1).is_some() && of(3).is_none());
}

#[test]
fn systems_without_a_name_are_told_by_their_method() {
    let named = |name: &str, text: &str| wkt::from_text(&text.replace("\"a\"", name)).label();
    let zone = format!(
        r#"PROJCS["a",{NAD83},PROJECTION["Transverse_Mercator"],PARAMETER["central_meridian",3],UNIT["metre",1]]"#
    );
    assert_eq!(named("\"mine\"", &zone), "mine");
    assert_eq!(named("\"Unknown\"", &zone), "a system of its own (Transverse Mercator)");
    assert_eq!(named("\"unnamed\"", r#"LOCAL_CS["a",UNIT["metre",1]]"#), "a system of its own");
    assert_eq!(named("\"undefined\"", r#"PROJCS["a"]"#), "unknown");
}

#[test]
fn names_that_one_program_writes_without_a_code_have_one() {
    for (name, code) in [
        ("GCS_WGS_1984", 4326),
        ("GCS_North_American_1927", 4267),
        ("GCS_North_American_1983", 4269),
        ("GCS_ETRS_1989", 4258),
    ] {
        assert_eq!(wkt::from_text(&format!("GEOGCS[\"{name}\"]")).epsg, Some(code));
        let own = wkt::of_srs(&format!("EPSG:{code}")).citation;
        assert_ne!(own, None, "{code} is a code");
    }
    let zone = |name: &str| wkt::from_text(&format!("PROJCS[\"{name}\"]")).epsg;
    assert_eq!(zone("WGS_1984_Web_Mercator_Auxiliary_Sphere"), Some(3857));
    for (name, first, [least, most]) in [
        ("WGS_1984_UTM_Zone_#N", 32_600, [1, 60]),
        ("WGS_1984_UTM_Zone_#S", 32_700, [1, 60]),
        ("WGS_1972_UTM_Zone_#N", 32_200, [1, 60]),
        ("WGS_1972_UTM_Zone_#S", 32_300, [1, 60]),
        ("NAD_1927_UTM_Zone_#N", 26_700, [1, 22]),
        ("NAD_1983_UTM_Zone_#N", 26_900, [1, 23]),
        ("ETRS_1989_UTM_Zone_#N", 25_800, [28, 38]),
        ("NAD_1983_UTM_Zone_#S", 0, [1, 0]),
    ] {
        for number in 0..=61 {
            let code = (least..=most).contains(&number).then_some(first + number);
            assert_eq!(zone(&name.replace('#', &number.to_string())), code, "{name} {number}");
        }
    }
}

#[test]
fn codes_of_utm_zones_are_of_that_zone_and_datum() {
    for (datum, name, zones) in [
        ("WGS_1984", "WGS 84", 120),
        ("WGS_1972", "WGS 72", 120),
        ("NAD_1927", "NAD27", 22),
        ("NAD_1983", "NAD83", 23),
        ("ETRS_1989", "ETRS89", 11),
    ] {
        let mut found = 0;
        for (zone, north) in (0..=61).flat_map(|zone| [(zone, true), (zone, false)]) {
            let Some(code) = wkt::utm_code(datum, north, zone) else { continue };
            found += 1;
            let half = if north { 'N' } else { 'S' };
            let known = wkt::of_srs(&format!("EPSG:{code}")).citation;
            // Zone 38 of ETRS89 is no longer recommended.
            let mark = if code == 25_838 { " (deprecated)" } else { "" };
            assert_eq!(known, Some(format!("{name} / UTM zone {zone}{half}{mark}")), "{code}");
        }
        assert_eq!(found, zones, "{name}");
    }
}

#[test]
fn codes_are_of_systems_of_longitude_and_latitude_or_not() {
    let kinds = [4326, 4937, 32_611, 4978, 1, 70_000].map(is_geographic);
    assert_eq!(kinds, [Some(true), Some(true), Some(false), Some(false), None, None]);
    // The text of an old code may be that of the one in its place.
    for code in [4326, 4327, 4937] {
        assert_eq!(codes::geographic(code).unwrap().code, Some(code));
    }
    let is_down = [5714, 5715].map(|code| vertical::by_code(code).unwrap().is_down);
    assert_eq!(is_down, [false, true], "heights and depths");
}

#[test]
fn mercator_has_two_kinds_told_by_their_numbers() {
    let one = r#"PARAMETER["central_meridian",5],PARAMETER["scale_factor",0.9]"#;
    let two = r#"PARAMETER["central_meridian",5],PARAMETER["standard_parallel_1",42]"#;
    let of = |method: &str, given: &str| projected(&format!("PROJECTION[\"{method}\"],{given}"));
    for (given, name, other) in [(one, "Mercator_1SP", two), (two, "Mercator_2SP", one)] {
        assert!(of("Mercator", given).agrees(&of(name, given)), "{name}");
        assert!(!of("Mercator", given).agrees(&of("Mercator", other)), "{name}");
        assert!(of("Mercator", given).label() == "a", "{name}");
    }
}

#[test]
fn methods_are_told_apart_by_their_names_alone() {
    for (i, a) in method::METHODS.iter().enumerate() {
        for (j, b) in method::METHODS.iter().enumerate() {
            assert_eq!(a == b, i == j, "{} {}", a.name, b.name);
        }
    }
    let lambert = r#"PARAMETER["latitude_of_center",45],PARAMETER["longitude_of_center",3]"#;
    let of = |method: &str| projected(&format!("PROJECTION[\"{method}\"],{lambert}"));
    assert!(!of("Lambert_Azimuthal_Equal_Area").agrees(&of("Azimuthal_Equidistant")));
}

#[test]
fn numbers_count_in_their_own_units_and_are_kept_where_those_are_the_usual() {
    let base = NAD83.replace("GEOGCS", "BASEGEOGCRS");
    let of = |meridian: &str, scale: &str| {
        let given = format!(
            r#"METHOD["Transverse Mercator"],PARAMETER["Longitude of natural origin",{meridian}],PARAMETER["Scale factor at natural origin",{scale}]"#
        );
        let axes = r#"CS[Cartesian,2],AXIS["e",east,LENGTHUNIT["metre",1]]"#;
        let text = format!(r#"PROJCRS["a",{base},CONVERSION["c",{given}],{axes}]"#);
        wkt::from_text(&text)
    };
    let written = |crs: &Crs| crs.to_wkt().unwrap();
    let usual =
        of(r#"-101.3,ANGLEUNIT["degree",0.017453292519943]"#, r#"0.9996,SCALEUNIT["unity",1]"#);
    let text = written(&usual);
    assert!(text.contains("\"central_meridian\",-101.3]"), "{text}");
    assert!(text.contains("\"scale_factor\",0.9996]"), "{text}");
    let grads =
        of(r#"-50,ANGLEUNIT["grad",0.015707963267948967]"#, r#"9996,SCALEUNIT["x",0.0001]"#);
    assert!(grads.agrees(&of("-45", "0.9996")), "{}", written(&grads));
    assert!(!grads.agrees(&usual));
}

#[test]
fn a_figure_far_from_that_of_its_code_takes_the_code_away() {
    let of = |axis: &str, flattening: &str, meridian: &str| {
        let text = NAD83.replace("6378137", axis).replace("298.257222101", flattening);
        let text = text.replace("\"Greenwich\",0", &format!("\"Greenwich\",{meridian}"));
        let code = r#",AUTHORITY["EPSG","4269"]]"#;
        wkt::from_text(&format!("{}{code}", &text[..text.len() - 1])).epsg
    };
    assert_eq!(of("6378137", "298.257222101", "0"), Some(4269));
    assert_eq!(of("6378137.5", "298.257225", "0.005"), Some(4269));
    assert_eq!(of("6378138", "298.257222101", "0"), None);
    assert_eq!(of("6378137", "298.257222101", "0.01"), None);
    assert_eq!(of("6378137", "298.2573", "0"), None);
    assert_eq!(of("6378137", "298.257222101", "0.02"), None);
}

#[test]
fn systems_of_a_site_are_one_by_name_and_unit() {
    let local = |name: &str, unit: &str| wkt::from_text(&format!("LOCAL_CS[\"{name}\",{unit}]"));
    let (metre, foot) = (r#"UNIT["metre",1]"#, r#"UNIT["foot",0.3048]"#);
    let own = local("mine", metre);
    // Not the same text, so that meaning decides.
    let again = local("mine", r#"UNIT["Meter",1.0]"#);
    assert!(own.agrees(&again) && again.agrees(&own));
    assert!(!own.agrees(&local("yours", metre)) && !own.agrees(&local("mine", foot)));
    assert_eq!((own.geographic, own.horizontal_unit()), (None, "metre"));
}

#[test]
fn heights_are_one_by_the_name_of_their_datum_or_their_own() {
    let up = |name: &str, datum: &str, rest: &str| {
        with_heights(&format!(
            r#"VERT_CS["{name}",VERT_DATUM["{datum}",2005],UNIT["metre",1]{rest}]"#
        ))
    };
    let own = up("n", "d", "");
    for (name, datum, is_same) in [
        ("N ", "x", true),
        ("x", "D", true),
        ("x", "y", false),
        ("x", "unknown", true),
        ("x", "", true),
    ] {
        let other = up(name, datum, "");
        assert_eq!(own.agrees(&other), is_same, "{name} {datum}");
        assert_eq!(other.agrees(&own), is_same, "{name} {datum}");
    }
    assert!(!own.agrees(&up("n", "d", r#",AXIS["Depth",DOWN]"#)));
    let feet = r#"VERT_CS["n",VERT_DATUM["d",2005],UNIT["foot",0.3048]]"#;
    assert!(!own.agrees(&with_heights(feet)));
    let esri = |sign: &str| {
        let turn = format!(r#"PARAMETER["Vertical_Shift",0.0],PARAMETER["Direction",{sign}]"#);
        with_heights(&format!(r#"VERTCS["n",VDATUM["d"],{turn},UNIT["Meter",1.0]]"#))
    };
    assert!(own.agrees(&esri("1.0")) && !own.agrees(&esri("-1.0")));
    assert!(esri("-1.0").agrees(&up("n", "d", r#",AXIS["Depth",DOWN]"#)));
    // A shift of -1 turns nothing.
    let shifted = r#"VERTCS["n",VDATUM["d"],PARAMETER["Vertical_Shift",-1.0],UNIT["Meter",1.0]]"#;
    assert!(own.agrees(&with_heights(shifted)));
}

#[test]
fn text_with_heights_says_so_and_others_are_joined_to_it() {
    let bare = projected(r#"PROJECTION["Cassini_Soldner"]"#);
    assert!(!bare.wkt_has_heights());
    let up = r#"VERT_CS["n",VERT_DATUM["d",2005],UNIT["metre",1]]"#;
    let high = with_heights(up);
    assert!(high.wkt_has_heights());
    assert_eq!(high.to_wkt(), high.wkt, "all of it is in the text");
    let joined = Crs { vertical_epsg: Some(5703), ..bare.clone() };
    let text = joined.to_wkt().unwrap();
    assert!(joined.wkt_has_heights() && text.starts_with("COMPD_CS[\"a + NAVD88"), "{text}");
    assert!(text.contains(bare.wkt.as_deref().unwrap()), "{text}");
    // Heights in feet are not those of the text, which then is written anew.
    let feet = Crs { vertical_unit: Some("foot".to_owned()), ..high };
    let text = feet.to_wkt().unwrap();
    assert!(text.contains("0.3048") && text.matches("VERT_CS").count() == 1, "{text}");
    assert_eq!((bare.lost_in_wkt(), joined.lost_in_wkt()), (None, None));
}

#[test]
fn numbers_without_end_are_words() {
    let nodes = CrsWktNode::all("A[nan,inf,1e999,-2.5e3]").unwrap();
    let values = [
        CrsWktValue::Word("nan"),
        CrsWktValue::Word("inf"),
        CrsWktValue::Word("1e999"),
        CrsWktValue::Number(-2500.0),
    ];
    assert_eq!(nodes[0].values, values);
}

#[test]
fn units_of_no_size_are_none() {
    let unit =
        |text: &str| LengthUnit::of_node(&CrsWktNode::all(text).unwrap()[0]).map(|unit| unit.name);
    assert_eq!(unit(r#"UNIT["metre",0]"#), None);
    assert_eq!(unit(r#"UNIT["metre",-1]"#), None);
    assert_eq!(unit(r#"UNIT["foot",1]"#).as_deref(), Some("metre"));
    assert_eq!(unit(r#"UNIT["rod",5.0292]"#).as_deref(), Some("rod"));
    // The size of a foot under the name of the other is that other, and not the other way round.
    assert_eq!(unit(r#"UNIT["Foot_US",0.3048]"#).as_deref(), Some("US survey foot"));
    assert_eq!(unit(r#"UNIT["foot",0.304800609601219]"#).as_deref(), Some("US survey foot"));
    let sized = |size: f64| {
        let raw = vec![1, 1, 0, 2, 3076, 0, 1, 32_767, 3077, 34_736, 1, 0];
        GeoKeys::new(raw, vec![size], String::new()).into_crs().horizontal_metres()
    };
    assert_eq!([5.0, 0.0, -1.0, f64::NAN].map(sized), [Some(5.0), None, None, None]);
}

#[test]
fn text_of_the_first_kind_is_told_by_its_first_word() {
    for (text, is_first) in [
        ("PROJCS[", true),
        (" geogcs (", true),
        ("COMPD_CS[\"a\"", true),
        ("PROJCRS[", false),
        ("VERT_CS[", false),
        ("", false),
    ] {
        assert_eq!(read::is_first_kind(text), is_first, "{text}");
    }
}

#[test]
fn heights_with_codes_of_their_datums_are_one_by_those() {
    let up = |name: &str, code: u32| {
        let id = format!(r#"AUTHORITY["EPSG","{code}"]"#);
        with_heights(&format!(
            r#"VERT_CS["{name}",VERT_DATUM["{name}",2005,{id}],UNIT["metre",1]]"#
        ))
    };
    assert!(up("n", 5103).agrees(&up("m", 5103)) && !up("n", 5103).agrees(&up("n", 5104)));
}

#[test]
fn keys_that_override_the_unit_of_a_code_take_the_code_away() {
    let of = |unit| keys(&[(1024, 1), (3072, 32_611), (3076, unit)], &[]);
    assert_eq!((of(9001).epsg, of(9002).epsg), (Some(32_611), None));
    let text = of(9002).to_wkt().unwrap();
    assert!(text.contains("\"false_easting\",1640419.94750656"), "{text}");
    assert!(text.contains(r#"UNIT["foot",0.3048,AUTHORITY["EPSG","9002"]]"#), "{text}");
    assert!(!text.contains("32611"), "{text}");
    assert!(of(9001).to_wkt().unwrap().contains("\"false_easting\",500000"));
    assert_eq!(keys(&[(1024, 3), (2048, 4978)], &[]).epsg, Some(4978));
}

#[test]
fn a_unit_of_heights_alone_is_a_system_without_a_name() {
    let of = |model| keys(&[(1024, model), (2048, 4326), (3072, 32_611), (4099, 9002)], &[]);
    let text = of(1).to_wkt().unwrap();
    assert!(text.contains(r#"VERT_CS["unknown",VERT_DATUM["unknown",2005],UNIT["foot",0.3048"#));
    assert!(!of(2).to_wkt().unwrap().contains("VERT_CS"));
    assert_eq!([of(1), of(2)].map(|crs| crs.vertical_metres()), [Some(0.3048); 2]);
}

#[test]
fn a_system_of_a_known_datum_has_not_the_code_of_another_of_it() {
    let zone = [(1024, 1), (2050, 6326), (3072, 32_767), (3074, 16_011), (3076, 9001)];
    let text = keys(&zone, &[(2049, "GCS Name = mine|")]).to_wkt().unwrap();
    let base = &text[text.find("GEOGCS").unwrap()..text.find("PROJECTION").unwrap()];
    assert!(base.starts_with("GEOGCS[\"mine\"") && base.contains("\"6326\""), "{base}");
    assert!(!base.contains("\"4326\"") && !base.contains("LINUNIT"), "{base}");
    assert!(text.ends_with("AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]]"), "{text}");
}

#[test]
fn polar_systems_are_written_without_axes() {
    let polar = r#"METHOD["Polar Stereographic (variant A)"]"#;
    let base = NAD83.replace("GEOGCS", "BASEGEOGCRS");
    let axes = r#"CS[Cartesian,2],AXIS["e",south,LENGTHUNIT["metre",1]]"#;
    let text = format!(r#"PROJCRS["a",{base},CONVERSION["c",{polar}],{axes}]"#);
    let text = wkt::from_text(&text).to_wkt().unwrap();
    assert!(text.starts_with("PROJCS[") && !text.contains("AXIS"), "{text}");
}

#[test]
fn systems_agree_by_codes_before_names_and_by_names_where_there_is_no_more() {
    let code = |epsg: u32, up: Option<u32>, name: &str| Crs {
        epsg: Some(epsg),
        vertical_epsg: up,
        citation: Some(name.to_owned()),
        ..Crs::default()
    };
    assert!(code(1, None, "a").agrees(&code(1, None, "b")));
    assert!(!code(1, None, "a").agrees(&code(2, None, "a")));
    assert!(code(1, Some(5030), "a").agrees(&code(1, Some(5030), "b")));
    assert!(!code(1, Some(5030), "a").agrees(&code(1, Some(5031), "b")));
    // The text is another's, and the codes count.
    let text = |epsg| Crs { epsg: Some(epsg), wkt: Some(NAD83.to_owned()), ..Crs::default() };
    assert!(!text(4269).agrees(&text(4326)));
    let name = |name: &str| Crs { citation: Some(name.to_owned()), ..Crs::default() };
    assert!(name("a").agrees(&Crs { vertical_unit: Some("m".to_owned()), ..name("a") }));
    assert!(!name("a").agrees(&name("b")) && !name("a").agrees(&Crs::default()));
    let high = Crs { vertical_epsg: Some(5703), ..Crs::default() };
    assert!(!high.agrees(&Crs::default()) && !Crs::default().agrees(&high));
    let metres = Crs { vertical_unit: Some("metre".to_owned()), ..Crs::default() };
    assert!(metres.agrees(&Crs::default()) && !metres.agrees(&name("a")));
    // Keys against none: what both say counts.
    let odd = Crs { geo_keys: vec![1, 1, 0, 1, 3075, 0, 1, 99], ..name("a") };
    assert!(odd.agrees(&Crs { vertical_unit: Some("m".to_owned()), ..name("a") }));
    assert!(!odd.agrees(&Crs { geo_keys: vec![1, 1, 0, 1, 3075, 0, 1, 98], ..name("a") }));
}

#[test]
fn codes_are_whole_numbers() {
    let of = |id: &str| wkt::from_text(&format!(r#"GEOGCRS["x",ID["EPSG",{id}]]"#)).epsg;
    let codes = ["4326", "4326.5", "0", "-4326", "1e10", "\"4326\""].map(of);
    assert_eq!(codes, [Some(4326), None, None, None, None, Some(4326)]);
    let named = wkt::from_text(r#"GEOGCS["x",AUTHORITY["EPSG","4326"]]"#).epsg;
    assert_eq!(named, Some(4326));
}

#[test]
fn sizes_of_units_are_compared_by_their_ratio() {
    let unit = |size: f64| {
        let text = format!(r#"UNIT["x",{size}]"#);
        LengthUnit::of_node(&CrsWktNode::all(&text).unwrap()[0]).unwrap().name
    };
    assert_eq!((unit(1_000.000_05).as_str(), unit(1_000.000_5).as_str()), ("kilometre", "x"));
    assert_eq!(
        (unit(0.3048 * 1.000_000_05).as_str(), unit(0.3048 * 1.000_000_2).as_str()),
        ("foot", "x")
    );
}

#[test]
fn meridians_are_in_the_unit_they_are_given_in() {
    let of = |meridian: &str| {
        wkt::from_text(&NAD83.replace(r#"PRIMEM["Greenwich",0]"#, &format!("PRIMEM[{meridian}]")))
    };
    let grads = of(r#""Paris",2.5969213,ANGLEUNIT["grad",0.015707963267948967]"#);
    assert!(
        grads.agrees(&of(r#""Paris",2.33722917"#)) && !grads.agrees(&of(r#""Paris",2.5969213"#))
    );
}

#[test]
fn heights_above_the_ellipsoid_are_told_in_three_ways() {
    let of = |more: &str| {
        let text = wkt::from_text(&format!("{},{more}]", &NAD83[..NAD83.len() - 1]));
        text.vertical_unit
    };
    let axis = |name: &str| format!("AXIS[\"{name}\",NORTH]");
    let two = [axis("a"), axis("b")].join(",");
    let three = [axis("a"), axis("b"), axis("c")].join(",");
    for is_3d in [r#"LINUNIT["Meter",1.0]"#, "CS[ellipsoidal,3]", &three] {
        assert_eq!(of(is_3d).as_deref(), Some("metre"), "{is_3d}");
    }
    assert_eq!((of("CS[ellipsoidal,2]"), of(&two)), (None, None));
}

#[test]
fn names_of_codes_keep_the_codes_and_bring_the_units_of_heights() {
    let both = wkt::of_srs(" epsg: 32611 + 5703 ");
    assert_eq!((both.epsg, both.vertical_epsg), (Some(32_611), Some(5703)));
    assert_eq!((both.vertical_unit.as_deref(), both.wkt), (Some("metre"), None));
    let unknown = wkt::of_srs("EPSG:70000");
    assert_eq!((unknown.epsg, unknown.wkt), (Some(70_000), None));
    assert_eq!(wkt::of_srs(" "), Crs::default());
}

#[test]
fn lengths_are_one_within_a_millimetre_in_any_unit() {
    let of = |easting: f64| {
        let system = format!(
            r#"PROJECTION["Cassini_Soldner"],PARAMETER["false_easting",{easting}],UNIT["foot",0.3048]"#
        );
        wkt::from_text(&format!(r#"PROJCS["a",{NAD83},{system}]"#))
    };
    let is_same = |off: f64| of(100.0).agrees(&of(100.0 + off));
    assert_eq!([0.0, 0.003, -0.003, 0.004, -0.004].map(is_same), [true, true, true, false, false]);
}

#[test]
fn an_unknown_datum_is_one_with_unknown_ones_alone() {
    let of = |system: &str, datum: &str| {
        let text = NAD83.replace("\"NAD83\"", system);
        wkt::from_text(&text.replace("\"North_American_Datum_1983\"", datum))
    };
    let unknown = of("\"x\"", "\"unknown\"");
    assert!(unknown.agrees(&of("\"y\"", "\"Unknown based on GRS 1980 ellipsoid\"")));
    assert!(!unknown.agrees(&of("\"y\"", "\"North_American_Datum_1983\"")));
    assert!(!of("\"y\"", "\"North_American_Datum_1983\"").agrees(&unknown));
}
