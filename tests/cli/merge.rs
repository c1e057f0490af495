//! Files that differ in lattice or CRS as one grid (`convert --resampling`): against each file resampled alone and laid on
//! top of the others, the same bytes however they are made, and what is refused.

use crate::cli_support::{Place, json};
use crate::relief::values;

/// Three grids: fine ones on two lattices, and a coarse one in another CRS around both, of heights that tell them apart.
fn place() -> Place {
    let place = Place::new();
    let grid = |[x, y, cell]: [f64; 3], [columns, rows]: [usize; 2], base: usize| {
        let height = |k: usize| match k % 23 {
            4 => "-9999".to_owned(),
            _ => format!("{}.5", base + k * 7 % 90),
        };
        let heights = (0..columns * rows).map(height).collect::<Vec<_>>().join(" ");
        format!(
            "ncols {columns}\nnrows {rows}\nxllcorner {x}\nyllcorner {y}\ncellsize {cell}\nNODATA_value -9999\n{heights}\n"
        )
    };
    place
        .write("base.asc", grid([2.98, 42.87, 0.001], [60, 60], 1000))
        .write("base.prj", "EPSG:4326")
        .write("a.asc", grid([500_000.0, 4_749_000.0, 30.0], [40, 50], 2000))
        .write("a.prj", "EPSG:32631")
        .write("b.asc", grid([500_901.0, 4_749_640.0, 10.0], [90, 80], 3000))
        .write("b.prj", "EPSG:32631")
        // On the lattice of the first fine grid.
        .write("c.asc", grid([501_200.0, 4_749_000.0, 30.0], [10, 30], 4000))
        .write("c.prj", "EPSG:32631");
    place
}

/// The heights of files from bottom to top, each resampled alone to the lattice of a grid.
fn overlaid(place: &Place, files: &[&str], like: &str, more: &[&str]) -> Vec<f64> {
    let mut all: Option<Vec<f64>> = None;
    for (at, file) in files.iter().enumerate() {
        let name = format!("alone{at}.tif");
        let convert = ["convert", file, &name, "--like", like, "--overwrite", "--type", "float32"];
        place.ok(&[&convert[..], &["-q"], more].concat());
        let alone = values(place, &name).1;
        all = Some(match all {
            None => alone,
            Some(below) => {
                let both = below.into_iter().zip(alone);
                both.map(|(below, own)| if own.is_nan() { below } else { own }).collect()
            }
        });
    }
    all.unwrap()
}

fn same(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (at, (found, expected)) in found.iter().zip(expected).enumerate() {
        let is_same = found == expected || found.is_nan() && expected.is_nan();
        assert!(is_same, "{what}: sample {at} is {found}, not {expected}");
    }
}

#[test]
fn files_are_resampled_alone_and_laid_on_top_of_each_other() {
    let place = place();
    let utm = ["--to-crs", "EPSG:32631"];
    for (files, more, method) in [
        (&["base.asc", "a.asc", "b.asc"][..], &utm[..], "bilinear"),
        (&["b.asc", "base.asc", "a.asc"], &utm, "near"),
        (&["a.asc", "b.asc"], &["--resolution", "7"], "cubic"),
        (&["base.asc", "b.asc"], &["--to-crs", "EPSG:4326"], "near"),
        (&["a.asc", "base.asc"], &[], "bilinear"),
    ] {
        let method = ["--resampling", method];
        let more = [&method[..], more].concat();
        let run = |more: &[&str], name: &str| {
            let convert =
                [&["convert"][..], files, &[name, "--overwrite", "--json"], more].concat();
            json(&place.ok(&convert).out)
        };
        let told = run(&more, "o.tif");
        let to_crs =
            ["--to-crs", if files == ["base.asc", "b.asc"] { "EPSG:4326" } else { utm[1] }];
        let expected = overlaid(&place, files, "o.tif", &[&method[..], &to_crs].concat());
        same(&values(&place, "o.tif").1, &expected, &format!("{files:?} {more:?}"));
        let note = format!("{} grids of the files are resampled, from bottom to top", files.len());
        assert!(told["notes"].to_string().contains(&note), "{told}");
        run(&[&more[..], &["--threads", "1", "--memory", "48M"]].concat(), "p.tif");
        assert!(place.bytes("o.tif") == place.bytes("p.tif"), "{files:?}");
        run(&[&more[..], &["-f", "COG"]].concat(), "cog.tif");
        same(&values(&place, "cog.tif").1, &expected, "COG");
    }
}

/// Files that agree are one layer, where the first of them is, and have no seam.
#[test]
fn files_that_agree_are_one_layer() {
    let place = place();
    let method = ["--resampling", "bilinear", "--resolution", "7"];
    let merge = |names: &[&str], name: &str, more: &[&str]| {
        let convert = [&["convert"][..], names, &[name, "--overwrite", "-q"], more].concat();
        place.ok(&convert);
        values(&place, name).1
    };
    let found = merge(&["a.asc", "b.asc", "c.asc"], "o.tif", &method);
    let other = merge(&["c.asc", "b.asc", "a.asc"], "p.tif", &method);
    same(&other, &found, "a and c do not overlap");
    merge(&["a.asc", "c.asc"], "ac.tif", &[]);
    let expected = overlaid(&place, &["ac.tif", "b.asc"], "o.tif", &method[..2]);
    same(&found, &expected, "a and c below b");
}

#[test]
fn smaller_cells_can_be_on_top() {
    let place = place();
    let by = ["--resampling", "near", "--to-crs", "EPSG:32631", "--priority"];
    let run = |names: &[&str], name: &str, rule: &str| {
        let convert = [&["convert"][..], names, &[name, "-q"], &by, &[rule]].concat();
        place.ok(&convert);
    };
    run(&["base.asc", "a.asc", "b.asc"], "ordered.tif", "order");
    run(&["b.asc", "a.asc", "base.asc"], "sized.tif", "resolution");
    same(&values(&place, "sized.tif").1, &values(&place, "ordered.tif").1, "by size");
    run(&["b.asc", "a.asc", "base.asc"], "turned.tif", "order");
    let files = ["b.asc", "a.asc", "base.asc"];
    let expected = overlaid(&place, &files, "turned.tif", &by[..4]);
    same(&values(&place, "turned.tif").1, &expected, "by order");
}

/// Constant heights fade into each other by the distance to the border and to voids, in any parts.
#[test]
fn feathered_files_fade_into_those_below() {
    let place = Place::new();
    let grid = |[x, y, cell]: [f64; 3],
                [columns, rows]: [usize; 2],
                height: &dyn Fn(usize) -> i32| {
        let heights =
            (0..columns * rows).map(|k| height(k).to_string()).collect::<Vec<_>>().join(" ");
        format!(
            "ncols {columns}\nnrows {rows}\nxllcorner {x}\nyllcorner {y}\ncellsize {cell}\nNODATA_value -9999\n{heights}\n"
        )
    };
    // A void at column 30, row 80, beside the border of a piece, and below that grid one that ends at column 240.
    let hole = |k: usize| if k == 80 * 200 + 30 { -9999 } else { 300 };
    place
        .write("low.asc", grid([0.0, 0.0, 2.0], [120, 140], &|_| 100))
        .write("low.prj", "EPSG:32631")
        .write("top.asc", grid([100.0, 20.0, 1.0], [200, 200], &hole))
        .write("top.prj", "EPSG:32631");
    let merge = |name: &str, more: &[&str]| {
        let convert =
            ["convert", "low.asc", "top.asc", name, "--resampling", "near", "--feather", "9"];
        place.ok(&[&convert[..], &["--overwrite", "-q"], more].concat());
        values(&place, name)
    };
    let (columns, found) = merge("o.tif", &[]);
    assert_eq!((columns, found.len() / columns), (300, 280));
    let at = |col: usize, row: usize| found[row * columns + col];
    // Top has columns 100 to 299 and rows 60 to 259.
    for (col, row, expected) in [
        (99, 150, 100.0),
        (100, 150, 120.0),
        (101, 150, 140.0),
        (108, 150, 280.0),
        (109, 150, 300.0),
        (110, 150, 300.0),
        (150, 60, 120.0),
        (150, 62, 160.0),
        (150, 259, 120.0),
        (130, 140, 100.0),
        (130, 141, 120.0),
        (133, 144, 200.0),
        (127, 140, 160.0),
        (200, 150, 300.0),
        (298, 150, 300.0),
        (299, 150, 300.0),
        (299, 259, 300.0),
    ] {
        assert!(
            (at(col, row) - expected).abs() < 1e-4,
            "{col}, {row}: {} {expected}",
            at(col, row)
        );
    }
    // Near the end of what is below, at column 240, and of top, at row 60, both have little weight.
    let (own, below) = (0.1, 0.9 * 0.1);
    let expected = (own * 300.0 + below * 100.0) / (own + below);
    assert!((at(239, 60) - expected).abs() < 1e-4, "{} {expected}", at(239, 60));
    merge("p.tif", &["--threads", "1", "--memory", "48M"]);
    assert!(place.bytes("o.tif") == place.bytes("p.tif"));
    let (_, tiled) = merge("cog.tif", &["-f", "COG"]);
    same(&tiled, &found, "COG");
    place.fails(
        &["convert", "top.asc", "x.tif", "--feather", "3"],
        2,
        &["--feather requires --resampling"],
    );
}

/// Without another CRS or resolution, samples of the grid with the smallest cells stay where they are.
#[test]
fn the_finest_grid_stays_on_its_lattice() {
    let place = place();
    place.ok(&[
        "convert",
        "base.asc",
        "a.asc",
        "b.asc",
        "o.tif",
        "--resampling",
        "cubic",
        "--to-crs",
        "EPSG:32631",
        "-q",
    ]);
    place.ok(&["convert", "o.tif", "part.tif", "--bounds", "500901,4749640,501801,4750440", "-q"]);
    let [(columns, found), (_, own)] = ["part.tif", "b.asc"].map(|name| values(&place, name));
    assert_eq!(columns, 90);
    for (found, own) in found.iter().zip(&own).filter(|(_, own)| !own.is_nan()) {
        assert!((found - own).abs() < 1e-3, "{found} {own}");
    }
}

/// Rows that run to the north, other sample types and nodata values, scaled heights.
#[test]
fn types_scales_and_directions_may_differ() {
    let place = place();
    place.ok(&[
        "convert",
        "b.asc",
        "b.tif",
        "--type",
        "int16",
        "--round",
        "--out-nodata",
        "-32768",
        "-q",
    ]);
    place.ok(&["convert", "a.asc", "b.tif", "o.tif", "--resampling", "near", "--json"]);
    let expected = overlaid(&place, &["a.asc", "b.tif"], "o.tif", &["--resampling", "near"]);
    same(&values(&place, "o.tif").1, &expected, "types");
    let head = "<VRTDataset rasterXSize=\"90\" rasterYSize=\"80\"><SRS>EPSG:32631</SRS>";
    let vrt = |transform: &str, more: &str| {
        format!(
            "{head}<GeoTransform>{transform}</GeoTransform><VRTRasterBand dataType=\"Int16\" band=\"1\"><NoDataValue>-32768</NoDataValue>{more}<SimpleSource><SourceFilename relativeToVRT=\"1\">b.tif</SourceFilename><SourceBand>1</SourceBand><SrcRect xOff=\"0\" yOff=\"0\" xSize=\"90\" ySize=\"80\"/><DstRect xOff=\"0\" yOff=\"0\" xSize=\"90\" ySize=\"80\"/></SimpleSource></VRTRasterBand></VRTDataset>"
        )
    };
    place.write("up.vrt", vrt("500901, 10, 0, 4749640, 0, 10", ""));
    place.write(
        "scaled.vrt",
        vrt("500901, 10, 0, 4750440, 0, -10", "<Scale>0.5</Scale><Offset>7</Offset>"),
    );
    for name in ["up.vrt", "scaled.vrt"] {
        place.ok(&["convert", "a.asc", name, "v.tif", "--resampling", "near", "--overwrite", "-q"]);
        let expected = overlaid(&place, &["a.asc", name], "v.tif", &["--resampling", "near"]);
        same(&values(&place, "v.tif").1, &expected, name);
    }
}

/// Longitudes from 0 to 360 beside those from -180 to 180.
#[test]
fn longitudes_may_be_counted_from_elsewhere() {
    let place = Place::new();
    let world = |west: f64, cell: f64, base: usize| {
        let (columns, rows) = ((360.0 / cell) as usize, (180.0 / cell) as usize);
        let heights =
            (0..columns * rows).map(|k| (base + k % 97).to_string()).collect::<Vec<_>>().join(" ");
        format!(
            "ncols {columns}\nnrows {rows}\nxllcorner {west}\nyllcorner -90\ncellsize {cell}\n{heights}\n"
        )
    };
    place.write("world.asc", world(-180.0, 4.0, 1000)).write("world.prj", "EPSG:4326");
    place.write("turned.asc", world(0.0, 3.0, 2000)).write("turned.prj", "EPSG:4326");
    place.ok(&[
        "convert",
        "world.asc",
        "turned.asc",
        "o.tif",
        "--resampling",
        "near",
        "--extent",
        "-180,-90,180,90",
        "-q",
    ]);
    assert!(values(&place, "o.tif").1.iter().all(|z| *z >= 2000.0), "all of the globe is covered");
}

#[test]
fn what_has_no_meaning_is_refused_by_name() {
    let place = place();
    place.fails(
        &["convert", "a.asc", "b.asc", "o.tif"],
        65,
        &["b.asc", "cell size is 10", "terrane convert", "--resampling"],
    );
    place.fails(
        &["tin", "base.asc", "a.asc", "o.ply", "--max-error", "1"],
        65,
        &["a.asc", "EPSG:4326", "--resampling"],
    );
    place.fails(
        &["convert", "a.asc", "o.tif", "--resampling", "near"],
        2,
        &["no effect", "--resolution"],
    );
    let one = ["convert", "a.asc", "o.tif", "--resampling", "near", "--resolution", "7"];
    let alone = |more: &[&str]| {
        place.fails(&[&one[..], more].concat(), 2, &[more[0], "no effect on a single file"]);
    };
    alone(&["--priority", "resolution"]);
    alone(&["--feather", "2"]);
    place.fails(
        &["convert", "a.asc", "o.tif", "--priority", "resolution"],
        2,
        &["--priority requires --resampling"],
    );
    let merge = |more: &[&str], code: i32, words: &[&str]| {
        place.fails(
            &[&["convert", "a.asc", "b.asc", "o.tif", "--resampling", "near"], more].concat(),
            code,
            words,
        );
    };
    place.write(
        "area.wkt",
        "POLYGON ((500000 4749000, 501000 4749000, 501000 4750000, 500000 4749000))",
    );
    merge(&["--bounds", "500000,4749000,500500,4749500"], 2, &["--bounds", "--extent"]);
    merge(&["--clip", "area.wkt"], 2, &["--clip", "merge the files first"]);
    merge(&["--water", "area.wkt"], 2, &["--water", "merge the files first"]);
    merge(&["--extent", "0,0,9,9"], 2, &["does not intersect the grid", "covers 500000"]);
    // Heights in two units, above two surfaces, and a file without a CRS.
    place
        .write("feet.asc", std::fs::read_to_string(place.path("b.asc")).unwrap())
        .write("feet.prj", "EPSG:32631+6360");
    place
        .write("metres.asc", std::fs::read_to_string(place.path("a.asc")).unwrap())
        .write("metres.prj", "EPSG:32631+5703");
    let near = ["o.tif", "--resampling", "near"];
    let both = [&["convert", "metres.asc", "feet.asc"], &near[..]].concat();
    place.ok(&[&both[..], &["-q"]].concat());
    let (_, found) = values(&place, "o.tif");
    assert!(found.iter().any(|z| (914.0..945.0).contains(z)), "feet become metres");
    place
        .write("egm.prj", "EPSG:32631+5773")
        .write("egm.asc", std::fs::read_to_string(place.path("b.asc")).unwrap());
    let other = [&["convert", "metres.asc", "egm.asc"], &near[..], &["--overwrite"]].concat();
    place.fails(&other, 65, &["egm.asc"]);
    std::fs::remove_file(place.path("b.prj")).unwrap();
    merge(&["--overwrite"], 65, &["b.asc", "CRS"]);
}

/// A grid of the whole globe, whose outline is nowhere near most of it in a projection.
#[test]
fn the_globe_lies_below_a_small_grid() {
    let place = Place::new();
    let heights = (0..36 * 72).map(|k| (k % 89).to_string()).collect::<Vec<_>>().join(" ");
    let globe = "ncols 72\nnrows 36\nxllcorner -180\nyllcorner -90\ncellsize 5\n";
    place.write("globe.asc", format!("{globe}{heights}\n")).write("globe.prj", "EPSG:4326");
    let small = "ncols 2\nnrows 2\nxllcorner 4000000\nyllcorner 3000000\ncellsize 20000\n9 9 9 9\n";
    for (crs, extent) in [
        ("EPSG:3035", "1000000,1000000,7000000,6000000"),
        ("EPSG:32631", "170000,0,3000000,5000000"),
    ] {
        place.write("small.asc", small).write("small.prj", crs);
        let lattice = ["--extent", extent, "--resolution", "8000", "--to-crs", crs];
        let more = [&["--resampling", "near", "--json"], &lattice[..]].concat();
        let told =
            place.ok(&[&["convert", "globe.asc", "alone.tif", "--overwrite"], &more[..]].concat());
        let valid = json(&told.out)["valid_samples"].clone();
        assert!(valid.as_u64() > Some(200_000), "{crs} {valid}");
        let files = ["convert", "globe.asc", "small.asc", "o.tif", "--overwrite"];
        let told = json(&place.ok(&[&files[..], &more].concat()).out);
        assert_eq!(told["valid_samples"], valid, "{crs}");
        // The poles and the meridian at 180 degrees are far from there.
        let near = ["--extent", "4000000,3000000,4040000,3040000", "--resolution", "8000"];
        let near = [&["convert", "globe.asc", "near.tif", "--overwrite", "-q"], &near[..]].concat();
        place.ok(&[&near[..], &["--to-crs", crs, "--resampling", "near"]].concat());
    }
}

/// What any file states of heights holds for all, whichever comes first.
#[test]
fn heights_are_compared_with_all_files_before() {
    let place = Place::new();
    let grid = |cell: f64| {
        let heights = "7 ".repeat(36);
        format!(
            "ncols 6\nnrows 6\nxllcorner 500000\nyllcorner 4749000\ncellsize {cell}\n{heights}\n"
        )
    };
    let crs = [
        ("n", "", 2.0),
        ("v", "+5703", 3.0),
        ("w", "+5773", 5.0),
        ("feet", "+6360", 7.0),
        ("same", "+5773", 3.0),
    ];
    for (name, vertical, cell) in crs {
        place.write(&format!("{name}.asc"), grid(cell));
        place.write(&format!("{name}.prj"), format!("EPSG:32631{vertical}"));
    }
    let near = ["o.tif", "--resampling", "near", "--overwrite"];
    for files in
        [["n.asc", "v.asc", "w.asc"], ["v.asc", "n.asc", "w.asc"], ["v.asc", "w.asc", "n.asc"]]
    {
        let words = [&["convert"], &files[..], &near].concat();
        place.fails(&words, 65, &["w.asc", "no vertical transformation"]);
    }
    place.fails(&["convert", "v.asc", "same.asc", "x.tif"], 65, &["same.asc", "5773", "--geoid"]);
    place.write("m.asc", grid(3.0)).write("m.prj", "EPSG:32631");
    place.fails(
        &["convert", "m.asc", "v.asc", "same.asc", "x.tif"],
        65,
        &["same.asc", "vertical CRS is EPSG:5773", "v.asc"],
    );
    place.ok(&[&["convert", "n.asc", "v.asc"], &near[..], &["-q"]].concat());
    let told = place.ok(&["info", "o.tif"]).out;
    assert!(told.contains("5703"), "{told}");
    place.ok(&[&["convert", "n.asc", "feet.asc"], &near[..], &["-q"]].concat());
    let told = place.ok(&["info", "o.tif"]).out;
    assert!(told.contains("foot"), "{told}");
}

#[test]
fn files_without_a_crs_are_named_whichever_comes_first() {
    let place = place();
    std::fs::remove_file(place.path("b.prj")).unwrap();
    for files in [["a.asc", "b.asc"], ["b.asc", "a.asc"]] {
        let words = [&["convert"], &files[..], &["o.tif", "--resampling", "near"]].concat();
        place.fails(
            &words,
            65,
            &["b.asc: CRS is missing, which a.asc has", "gdal_edit.py -a_srs EPSG:CODE b.asc"],
        );
    }
    place.fails(
        &["slope", "b.asc", "a.asc", "o.tif"],
        65,
        &["gdal_edit.py -a_srs EPSG:32631 b.asc"],
    );
}

/// The nearest sample keeps the type, and values that cannot be heights are void as in mosaics.
#[test]
fn types_stay_and_undeclared_voids_are_voids() {
    let place = Place::new();
    let grid = |cell: f64, nodata: &str, heights: &str| {
        let heights = heights.repeat(6);
        format!(
            "ncols 6\nnrows 6\nxllcorner 500000\nyllcorner 4749000\ncellsize {cell}\n{nodata}{heights}\n"
        )
    };
    place
        .write("bare.asc", grid(4.0, "", "1 2 -9999 4 5 300 "))
        .write("bare.prj", "EPSG:32631")
        .write("told.asc", grid(2.0, "NODATA_value -9999\n", "7 8 9 -9999 6 5 "))
        .write("told.prj", "EPSG:32631");
    let report = json(
        &place
            .ok(&["convert", "bare.asc", "told.asc", "o.tif", "--resampling", "near", "--json"])
            .out,
    );
    assert_eq!(
        (&report["sample_type"], &report["lowest"]),
        (&"int16".into(), &1.0.into()),
        "{report}"
    );
    let (_, found) = values(&place, "o.tif");
    assert_eq!(
        found.iter().filter(|z| z.is_nan()).count(),
        12,
        "below the voids of the upper is a height"
    );
    // Files that agree are copied.
    let twice = ["convert", "told.asc", "told.asc", "p.tif", "--resampling", "cubic", "--json"];
    let report = json(&place.ok(&twice).out);
    assert_eq!(report["sample_type"], "int16");
    assert!(report["notes"].to_string().contains("nothing is resampled"), "{report}");
}

/// Neighbouring zones on both sides of 180 degrees stay neighbours, and the note on that is told once.
#[test]
fn zones_beside_the_antimeridian_are_neighbours() {
    let place = Place::new();
    let grid = |x: f64| {
        let heights = "7 ".repeat(400);
        format!("ncols 20\nnrows 20\nxllcorner {x}\nyllcorner 1000\ncellsize 10000\n{heights}\n")
    };
    place
        .write("u60.asc", grid(700_000.0))
        .write("u60.prj", "EPSG:32660")
        .write("u01.asc", grid(100_000.0))
        .write("u01.prj", "EPSG:32601");
    for files in [["u60.asc", "u01.asc"], ["u01.asc", "u60.asc"]] {
        let words = [
            &["convert"],
            &files[..],
            &[
                "o.tif",
                "--overwrite",
                "--json",
                "--resampling",
                "near",
                "--to-crs",
                "EPSG:4326",
                "--out-nodata",
                "-1",
            ],
        ]
        .concat();
        let told = json(&place.ok(&words).out);
        let valid = told["valid_samples"].as_u64().unwrap();
        assert!(told["width"].as_u64() < Some(60) && valid > 400, "{told}");
    }
}

/// Each cell of the output is made of the few files that lie there, however many there are.
#[test]
fn many_files_are_many_lattices() {
    let place = Place::new();
    let names: Vec<String> = (0..150).map(|k| format!("f{k:03}.asc")).collect();
    for (k, name) in names.iter().enumerate() {
        let (x, cell) = (k as f64 * 0.01, 0.001 + k as f64 * 1e-8);
        let heights = format!("{k} ").repeat(100);
        place.write(
            name,
            format!(
                "ncols 10\nnrows 10\nxllcorner {x}\nyllcorner 45\ncellsize {cell}\n{heights}\n"
            ),
        );
        place.write(&name.replace("asc", "prj"), "EPSG:4326");
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let more =
        ["o.tif", "--resampling", "near", "--resolution", "0.001", "--out-nodata", "-1", "-q"];
    place.ok(&[&["convert"], &names[..], &more].concat());
    let (columns, found) = values(&place, "o.tif");
    for (at, z) in found[4 * columns..][..1500].iter().enumerate() {
        assert_eq!(*z, (at / 10) as f64, "{at}");
    }
}
