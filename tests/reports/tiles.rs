//! Reports on tiles of the globe.

use std::collections::BTreeSet;

use serde_json::Value;
use terrane_globe::{
    GlbTileOptions, GlobeTileId, HeightPatch, STEPS, TerrainTile, TileErrorMeasure, TileExtensions,
    TileLevel, TileVertex, glb, quantized_mesh,
};
use terrane_proof::tiles::{
    DecodedTile as Proven, GlbTileContent, ProofTileId as ProvenId, StatedTileLevel,
};

use crate::cli_support::{Place, json};

/// A grid in a system, of one height or what `height` makes of column and row; -9999 is void.
fn grid(
    place: &Place,
    [cols, rows]: [usize; 2],
    (system, [west, south, cell]): (&str, [f64; 3]),
    height: impl Fn(usize, usize) -> f64,
) {
    named(place, "g", [cols, rows], (system, [west, south, cell]), height);
}

fn named(
    place: &Place,
    name: &str,
    [cols, rows]: [usize; 2],
    (system, [west, south, cell]): (&str, [f64; 3]),
    height: impl Fn(usize, usize) -> f64,
) {
    let row = |row| (0..cols).map(|col| height(col, row).to_string()).collect::<Vec<_>>().join(" ");
    let body: Vec<_> = (0..rows).map(row).collect();
    let head = format!(
        "ncols {cols}\nnrows {rows}\nxllcenter {west}\nyllcenter {south}\ncellsize {cell}\n"
    );
    place.write(&format!("{name}.asc"), format!("{head}NODATA_value -9999\n{}\n", body.join("\n")));
    place.write(&format!("{name}.prj"), system);
}

/// Makes both formats of a grid and proves them; what was made.
fn proved(place: &Place, input: &str) -> Value {
    let made =
        ["tiles", input, "t", "-f", "quantized-mesh", "-f", "3dtiles", "--overwrite", "--json"];
    let made = json(&place.ok(&made).out);
    for set in ["t/quantized-mesh", "t/3dtiles"] {
        let ran = place.run(&["verify", set, input]);
        assert_eq!(ran.code, 0, "{set}: {}{}", ran.out, ran.err);
    }
    made
}

/// All files below a folder.
fn walk(place: &Place, folder: &str) -> BTreeSet<String> {
    let top = place.path(folder);
    let (mut open, mut found) = (vec![top.clone()], BTreeSet::new());
    while let Some(path) = open.pop() {
        for entry in std::fs::read_dir(&path).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => open.push(path),
                false => {
                    found.insert(path.strip_prefix(&top).unwrap().display().to_string());
                }
            }
        }
    }
    found
}

/// A tile of so many columns and rows of vertices, and one more in the middle of a triangle where that is asked for.
fn lattice([cols, rows]: [i32; 2], has_one_more: bool) -> TerrainTile {
    let along = |i: i32, count: i32| i * STEPS / (count - 1);
    let mut vertices: Vec<TileVertex> = (0..rows)
        .flat_map(|row| (0..cols).map(move |col| [along(col, cols), along(row, rows)]))
        .map(|at| TileVertex { at, height: (at[0] * 7 + at[1] * 3) % 100 })
        .collect();
    let vertex = |col: i32, row: i32| (row * cols + col) as u32;
    let mut triangles = Vec::new();
    for row in 0..rows - 1 {
        for col in 0..cols - 1 {
            let [a, b] = [vertex(col, row), vertex(col + 1, row)];
            let [c, d] = [vertex(col + 1, row + 1), vertex(col, row + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    if has_one_more {
        let [a, b, c] = triangles[0];
        let new = vertices.len() as u32;
        let [p, q, r] = [a, b, c].map(|v| vertices[v as usize].at);
        let at = [0, 1].map(|axis: usize| (p[axis] + q[axis] + r[axis]) / 3);
        vertices.push(TileVertex { at, height: 5 });
        triangles[0] = [a, b, new];
        triangles.extend([[b, c, new], [c, a, new]]);
    }
    TerrainTile {
        id: GlobeTileId { level: 9, x: 531, y: 389 },
        step: 1.0,
        lattice: Some(2_f64.powi(-8)),
        vertices,
        triangles,
        measure: TileErrorMeasure::default(),
    }
}

/// Quantized-mesh#6, cesium#5983: two bytes number vertices up to 65,536 of them, four beyond, on a multiple of four;
/// in binary glTF 65,535 stands for none.
#[test]
fn d1_indices_grow_at_the_number_of_the_specification() {
    let none: Option<(&TileLevel, &HeightPatch<'_>)> = None;
    for (size, has_one_more, count) in
        [([255, 257], false, 65_535), ([256, 256], false, 65_536), ([256, 256], true, 65_537)]
    {
        let tile = lattice(size, has_one_more);
        let bytes = quantized_mesh(&tile, none, TileExtensions::default()).unwrap();
        let read = Proven::read(&bytes, |_| Ok(())).unwrap();
        assert_eq!((read.vertices.len(), read.triangles.len()), (count, tile.triangles.len()));
        let all = |vertices: Vec<[i32; 2]>| vertices.into_iter().collect::<BTreeSet<_>>();
        let found = read.vertices.iter().map(|[u, v, _]| [*u, *v].map(i32::from));
        assert!(all(found.collect()) == all(tile.vertices.iter().map(|v| v.at).collect()));
        let after = 92 + 6 * count;
        let start = if count > 65_536 { after.next_multiple_of(4) } else { after };
        let number = u32::from_le_bytes(bytes[start..start + 4].try_into().unwrap());
        assert_eq!(number as usize, tile.triangles.len(), "{count}");
        let (bytes, _) = glb(&tile, none, GlbTileOptions::default()).unwrap();
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let is_long = text.contains(r#""componentType":5125"#);
        assert_eq!(is_long, count > 65_535, "{count}");
        let id = ProvenId::new(9, 531, 389).unwrap();
        let said =
            StatedTileLevel { step: 1.0, lattice: 2_f64.powi(-8), ..StatedTileLevel::default() };
        let read = GlbTileContent::read(&bytes, |_| Ok(())).unwrap().tile(id, said).unwrap();
        assert_eq!((read.vertices.len(), read.triangles.len()), (count, tile.triangles.len()));
    }
}

fn noise(i: usize) -> f64 {
    let mixed = (i as u32 ^ 77).wrapping_mul(0x9e37_79b9);
    f64::from((mixed ^ mixed >> 15).wrapping_mul(0x85eb_ca6b) >> 8) / 16_777_216.0
}

/// White noise of 5,000 m keeps more vertices in a tile than two bytes number.
#[test]
fn d1_white_noise_is_held_by_tiles_of_many_vertices() {
    let place = Place::new();
    let second = 1.0 / 3600.0;
    // In the middle of one tile of level 9.
    let at = ("EPSG:4326", [7.1501, 46.1501, second]);
    grid(&place, [264, 264], at, |col, row| {
        (noise(row * 264 + col) * 1e6).round() / 100.0 - 5000.0
    });
    let made = ["tiles", "g.asc", "t", "--max-level", "9", "--json"];
    let made = json(&place.ok(&made).out);
    let most = made["levels"]
        .as_array()
        .unwrap()
        .iter()
        .map(|level| level["vertices"].as_u64().unwrap() / level["tiles"].as_u64().unwrap());
    assert!(most.max().unwrap() > 65_536, "{made}");
    let ran = place.run(&["verify", "t", "g.asc"]);
    assert_eq!(ran.code, 0, "{}{}", ran.out, ran.err);
}

/// Cesium#7936: every tile has its four corners, and sides from corner to corner, whatever is void.
#[test]
fn d2_tiles_have_their_corners_and_sides_whatever_is_void() {
    let place = Place::new();
    type IsVoid = fn(usize, usize) -> bool;
    let voids: [IsVoid; 5] = [
        |col, row| [0, 1, 38, 39].contains(&col) && [0, 1, 38, 39].contains(&row),
        |col, row| !(5..35).contains(&col) || !(5..35).contains(&row),
        |col, row| (col, row) != (17, 23),
        |col, row| col.abs_diff(row) > 1,
        |col, row| !(col == 0 && row == 39),
    ];
    for is_void in voids {
        // Some forty tiles of the deepest level, whose borders are at no sample.
        let at = ("EPSG:4326", [7.0301, 46.0301, 0.002]);
        grid(&place, [40, 40], at, |col, row| match is_void(col, row) {
            true => -9999.0,
            false => 700.0 + noise(row * 40 + col) * 90.0,
        });
        proved(&place, "g.asc");
        for name in walk(&place, "t/quantized-mesh") {
            let Some(id) = name.strip_suffix(".terrain") else { continue };
            let mut bytes = Vec::new();
            let packed = place.bytes(&format!("t/quantized-mesh/{name}"));
            let mut unpacker = flate2::read::GzDecoder::new(&packed[..]);
            std::io::Read::read_to_end(&mut unpacker, &mut bytes).unwrap();
            let tile = Proven::read(&bytes, |_| Ok(())).unwrap();
            let has = |at: [u16; 2]| tile.vertices.iter().any(|[u, v, _]| [*u, *v] == at);
            let corners = [[0, 0], [0, 32_767], [32_767, 0], [32_767, 32_767]];
            assert!(corners.into_iter().all(has), "{id}");
        }
    }
    grid(&place, [1, 1], ("EPSG:4326", [7.0301, 46.0301, 0.002]), |_, _| 5.0);
    proved(&place, "g.asc");
}

/// What `layer.json` says there is.
fn available(place: &Place) -> BTreeSet<String> {
    let layer: Value = serde_json::from_slice(&place.bytes("t/quantized-mesh/layer.json")).unwrap();
    let mut names = BTreeSet::from(["layer.json".to_owned()]);
    for (level, ranges) in layer["available"].as_array().unwrap().iter().enumerate() {
        for range in ranges.as_array().unwrap() {
            let [x0, x1, y0, y1] =
                ["startX", "endX", "startY", "endY"].map(|key| range[key].as_u64().unwrap());
            names.extend(
                (x0..=x1).flat_map(|x| (y0..=y1).map(move |y| format!("{level}/{x}/{y}.terrain"))),
            );
        }
    }
    names
}

/// Ctod#11: what is said to be there is there, and nothing else.
#[test]
fn d3_claims_and_files_are_equal_in_both_directions() {
    let place = Place::new();
    let at = |west: f64, south: f64| ("EPSG:4326", [west, south, 0.01]);
    // The letter L, and two islands 30 degrees apart.
    named(&place, "a", [30, 60], at(7.0, 46.0), |col, row| (col + row) as f64);
    named(&place, "b", [60, 30], at(7.3, 46.0), |col, row| (col * row % 90) as f64);
    place.ok(&["convert", "a.asc", "b.asc", "l.tif", "-q"]);
    grid(&place, [320, 40], ("EPSG:4326", [7.0, 46.0, 0.1]), |col, row| {
        if (10..310).contains(&col) { -9999.0 } else { ((col + row) % 50) as f64 }
    });
    for input in ["l.tif", "g.asc"] {
        proved(&place, input);
        let files = walk(&place, "t/quantized-mesh");
        assert_eq!(available(&place), files, "{input}");
        assert!(files.contains("0/0/0.terrain") && files.contains("0/1/0.terrain"));
        // 3D Tiles have the same ones; that subtrees say so is proved.
        let tiles = |set: &str, ending: &str| {
            walk(&place, set).iter().filter(|name| name.ends_with(ending)).count()
        };
        assert_eq!(tiles("t/3dtiles", ".glb"), tiles("t/quantized-mesh", ".terrain"));
    }
}

/// Cesium-unreal#840: of four tiles three are not there and not said to be, and the ground goes on without a step.
#[test]
fn d4_a_grid_of_one_quadrant_has_one_tile_of_four() {
    let place = Place::new();
    // A tile of level 8, of which the grid fills the south-western quarter from border to border.
    let (side, quarter) = (180.0 / 256.0, 180.0 / 512.0);
    let (x, y) = (266_u32, 193_u32);
    let [west, south] = [-180.0 + f64::from(x) * side, -90.0 + f64::from(y) * side];
    let cell = quarter / 64.0;
    for (more, children) in [(0, 1), (1, 4)] {
        // Samples on the border belong to the tiles on both sides: half a cell within there are none on it.
        let at = ("EPSG:4326", [west + cell / 2.0, south + cell / 2.0, cell]);
        grid(&place, [64 + more, 64 + more], at, |col, row| 900.0 + (col * 3 + row * 5) as f64);
        proved(&place, "g.asc");
        let files = walk(&place, "t/quantized-mesh");
        let parts = (0..4).filter(|part| {
            let [x, y] = [2 * x + part % 2, 2 * y + part / 2];
            files.contains(&format!("9/{x}/{y}.terrain"))
        });
        assert_eq!(parts.count(), children, "{files:?}");
        assert_eq!(available(&place), files);
    }
}

/// Cesium-terrain-builder#22: heights above a geoid are told, those above the ellipsoid are not, and feet are metres.
#[test]
fn d5_heights_above_a_geoid_are_told() {
    let place = Place::new();
    let (degrees, metres) = ([-100.0, 40.0, 0.001], [-600_000.0, -1_100_000.0, 25.0]);
    for (system, at, is_told, highest) in [
        ("EPSG:6349", degrees, true, 300.0),
        ("EPSG:5514+8357", metres, true, 300.0),
        ("EPSG:2056+5728", [2_600_000.0, 1_200_000.0, 10.0], true, 300.0),
        ("EPSG:4979", degrees, false, 300.0),
        ("EPSG:4269+6360", degrees, true, 300.0 * 1200.0 / 3937.0),
    ] {
        grid(&place, [6, 6], (system, at), |col, row| if col == row { 300.0 } else { 100.0 });
        let made = proved(&place, "g.asc");
        let notes = made["notes"].to_string();
        assert_eq!(notes.contains("pass --geoid"), is_told, "{system}: {notes}");
        let told = json(&place.ok(&["verify", "t/3dtiles", "g.asc", "--json"]).out);
        let found = told["heights"][1].as_f64().unwrap();
        assert!((found - highest).abs() < 1e-3, "{system}: {found}");
        for file in ["t/quantized-mesh/layer.json", "t/3dtiles/tileset.json"] {
            let text = String::from_utf8(place.bytes(file)).unwrap();
            let from =
                if is_told { r#""heights": "as given""# } else { r#""heights": "ellipsoid""# };
            assert!(text.contains(from), "{system}: {text}");
        }
    }
    place.write("g.gtx", geoid());
    grid(&place, [6, 6], ("EPSG:4979", degrees), |_, _| 5.0);
    place.fails(&["tiles", "g.asc", "u", "--geoid", "g.gtx"], 2, &["ellipsoidal already"]);
    grid(&place, [6, 6], ("EPSG:4326", degrees), |_, _| 5.0);
    place.fails(
        &["tiles", "g.asc", "u", "--geoid", "g.gtx", "--geoid", "g.gtx"],
        2,
        &["--geoid", "multiple times"],
    );
    place.ok(&["tiles", "g.asc", "u", "--geoid", "g.gtx", "-q"]);
    let text = String::from_utf8(place.bytes("u/layer.json")).unwrap();
    assert!(text.contains(r#""heights": "ellipsoid, with the geoid added""#), "{text}");
    place.ok(&["verify", "u", "g.asc", "--geoid", "g.gtx", "-q"]);
    let ran = place.run(&["verify", "u", "g.asc"]);
    assert!(ran.code == 1 && ran.out.contains("pass --geoid"), "{}{}", ran.out, ran.err);
}

/// A geoid of 30 m, 38 to 42 degrees north and 102 to 98 west.
fn geoid() -> Vec<u8> {
    let head = [38.0_f64, -102.0, 1.0, 1.0].into_iter().flat_map(f64::to_be_bytes);
    let counts = [5_u32, 5].into_iter().flat_map(u32::to_be_bytes);
    head.chain(counts).chain((0..25).flat_map(|_| 30.0_f32.to_be_bytes())).collect()
}

/// Cesium-terrain-builder#95: a grid of the Moon is never laid on the earth.
#[test]
fn d6_a_grid_of_the_moon_is_refused_by_name() {
    let place = Place::new();
    let moon = r#"GEOGCS["Moon 2000",DATUM["D_Moon_2000",SPHEROID["Moon_2000_IAU_IAG",1737400.0,0.0]],PRIMEM["Reference_Meridian",0.0],UNIT["Degree",0.0174532925199433]]"#;
    let flat = format!(
        r#"PROJCS["Moon flat",{moon},PROJECTION["Equirectangular"],PARAMETER["standard_parallel_1",0],PARAMETER["central_meridian",0],PARAMETER["false_easting",0],PARAMETER["false_northing",0],UNIT["Meter",1]]"#
    );
    for (system, at) in [(moon, [10.0, 20.0, 0.01]), (&flat, [1000.0, 2000.0, 100.0])] {
        grid(&place, [6, 6], (system, at), |col, row| (col + row) as f64);
        place.fails(
            &["tiles", "g.asc", "t"],
            65,
            &["g.asc", "not on the Earth", "1737400", "terrane tin"],
        );
        let ran = place.run(&["tiles", "g.asc", "t"]);
        assert!(!ran.err.contains("use a part"), "{}", ran.err);
    }
    // On the earth, but nobody knows where: no part of it is known better.
    let unknown = r#"GEOGCS["some",DATUM["nobody_knows",SPHEROID["own",6378100,298.3]],PRIMEM["Greenwich",0],UNIT["Degree",0.0174532925199433]]"#;
    grid(&place, [6, 6], (unknown, [10.0, 20.0, 0.01]), |col, row| (col + row) as f64);
    let ran = place.run(&["tiles", "g.asc", "t"]);
    assert!(ran.code == 65 && !ran.err.contains("use a part"), "{}", ran.err);
    assert!(ran.err.contains("gdal_edit.py -a_srs"), "{}", ran.err);
}
