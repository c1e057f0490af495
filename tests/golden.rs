//! The bytes of outputs, pinned: what every verb, method and format writes from synthetic inputs has the
//! digests that `golden.tsv` says. Where one changes, `REVISION` changes with it, as a plan that was begun
//! with other code must not be gone on with.
//!
//! To renew the table: `TERRANE_GOLDEN=renew cargo test --test golden`.

#[path = "common/cli_support.rs"]
mod cli_support;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use cli_support::{Place, photograph};
use serde_json::Value;
use terrane_baselines as methods;
use terrane_engine::REVISION;
use terrane_gridding as gridding;
use terrane_line as line;
use terrane_mesh as mesh;
use terrane_raster as raster;
use terrane_synth as synth;
use terrane_vector as vector;
use terrane_window::resample;

/// Where the table is.
const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden.tsv");

/// Members of reports that depend on the machine and the moment.
const PASSING: [&str; 9] = [
    "memory_budget",
    "peak_memory",
    "points_per_second",
    "samples_per_second",
    "segments_per_second",
    "spilled_bytes",
    "threads",
    "tin",
    "wall_seconds",
];

/// Folder of the inputs, as jobs see it.
const INPUTS: [&str; 15] = [
    "synth rough,width=211,height=157,seed=3 rough.tif",
    "synth smooth,width=90,height=120,seed=4 smooth.tif",
    "synth cloud,size=60,density=6,seed=5 dense.laz",
    "synth cloud,size=150,density=0.3,seed=6,voids=1,tile=60 thin.las --point-format 3",
    "synth cloud,size=80,density=2,seed=7,outliers=0.01 steep.laz --point-format 6",
    "synth coverage,vertices=400,features=9,seed=2 coverage.geojson",
    "synth koch,vertices=3000 koch.fgb",
    "synth walk,vertices=2000,features=3,seed=8,size=20 walk.shp",
    "tin rough.tif mesh.ply --max-error 5",
    "tin dense.laz cloud.ply --max-error 0.2 --class 2",
    "line coverage.geojson simple.geojson --tolerance 5 --topology",
    "contour smooth.tif -o contours.fgb --interval 20 --3d",
    "tin photo.png photo.ply --bands 1,2,3 --max-error 12",
    "tiles voids.asc tiles",
    "convert rough.tif globe.tif --to-crs EPSG:4326 --resampling near",
];

/// Features of several kinds, with properties of every type, ids, heights and holes.
const MIXED: &str = r#"{"type":"FeatureCollection","features":[
{"type":"Feature","id":7,"properties":{"name":"Ä b","n":-3,"f":2.5,"yes":true,"none":null},"geometry":
{"type":"LineString","coordinates":[[0,0,1],[1,0.05,2.5],[2,-0.05,3],[3,0.5,-1],[4,0,0]]}},
{"type":"Feature","id":8,"properties":{"name":"","n":9007199254740991,"f":0.1,"yes":false},"geometry":
{"type":"MultiLineString","coordinates":[[[5,5,0],[6,5.01,1],[7,5,2]],[[8,8,0],[8.5,8.6,1],[9,9,2]]]}}]}"#;

/// Heights in degrees, with a void.
fn degrees() -> String {
    let mut text =
        "ncols 24\nnrows 18\nxllcorner 7\nyllcorner 46\ncellsize 0.01\nNODATA_value -9999\n"
            .to_owned();
    for row in 0..18 {
        let height = |col: i32| match (row, col) {
            (5, 7) => -9999,
            _ => 400 + (row * row * 3 + col * (23 - col) * 2 + row * col) % 97,
        };
        let row: Vec<_> = (0..24).map(|col| height(col).to_string()).collect();
        writeln!(text, "{}", row.join(" ")).unwrap();
    }
    text
}

/// Heights of so many samples a side, so many degrees apart from a south-western corner on, with voids inside and
/// on the rim.
fn globe([west, south]: [f64; 2], cell: f64, side: i32) -> String {
    let mut text = format!(
        "ncols {side}\nnrows {side}\nxllcenter {west}\nyllcenter {south}\ncellsize {cell}\nNODATA_value -9999\n"
    );
    for row in 0..side {
        let height = |col: i32| match (row, col) {
            (12..19, 20..31) | (0..5, 0..3) => -9999,
            _ => (row * row / 3 + col * (side - col) + row * col) % 397 - 40,
        };
        let row: Vec<_> = (0..side).map(|col| height(col).to_string()).collect();
        writeln!(text, "{}", row.join(" ")).unwrap();
    }
    text
}

fn make_inputs(place: &Place) {
    fs::create_dir(place.path("in")).unwrap();
    place.write("in/degrees.asc", degrees());
    place.write("in/degrees.prj", "EPSG:4326");
    // A second of arc apart, on both sides of a border of tiles; and up to a pole and 180 degrees.
    place.write("in/voids.asc", globe([6.99, 46.02], 1.0 / 3600.0, 90));
    place.write("in/pole.asc", globe([60.0, 30.0], 1.5, 41));
    ["voids", "pole"].iter().for_each(|name| {
        place.write(&format!("in/{name}.prj"), "EPSG:4326");
    });
    place.write("in/mixed.geojson", MIXED);
    place.write("in/photo.png", photograph([97, 61], 3));
    place.write(
        "in/colours.txt",
        "0% 0 90 30\n40% 250 240 130\n700 brown 200\n100% white\nnv 0 0 0 0\n",
    );
    let areas = "POLYGON ((7 46, 7.235 46.02, 7.205 46.175, 7 46), (7.1 46.06, 7.15 46.06, 7.15 46.1, 7.1 46.06))";
    let points = (0..40).map(|i| format!("({} {})", 500_003 + i * 31, 4_749_996 - i * 173 % 1100));
    let points = format!("MULTIPOINT ({})", points.collect::<Vec<_>>().join(", "));
    place.write("in/points.wkt", points).write("in/points.prj", "EPSG:32631");
    let water = "POLYGON ((500100 4749950, 500620 4749900, 500560 4749400, 500100 4749950), (500400 4749800, 500500 4749800, 500450 4749700, 500400 4749800))\nPOLYGON ((500020 4749300, 501000 4748900, 501350 4749020, 501350 4748940, 501000 4748820, 500020 4749210, 500020 4749300))\nLINESTRING (500020 4749255, 501000 4748860, 501350 4748980)";
    let zones = "POLYGON ((500103 4749951, 500627 4749904, 500561 4749402, 500103 4749951), (500400 4749800, 500500 4749800, 500450 4749700, 500400 4749800))\nPOLYGON ((501000 4748900, 502300 4749900, 502150 4748000, 501000 4748900))";
    place.write("in/zones.wkt", zones).write("in/zones.prj", "EPSG:32631");
    place.write("in/water.wkt", water).write("in/water.prj", "EPSG:32631");
    place.write("in/areas.wkt", areas).write("in/areas.prj", "EPSG:4326");
    let kerbs = "LINESTRING Z (499990 4750005 150, 500030.123 4750040 260, 500055 4750012 240)\n\
                 POLYGON ((500010 4750010, 500050 4750010.5, 500045 4750052, 500010 4750010))";
    place.write("in/kerbs.wkt", kerbs).write("in/kerbs.prj", "EPSG:32631");
    for job in INPUTS {
        run(job, &place.path("in")).unwrap();
    }
}

/// What is pinned: commands, several joined by "then". What they write is called `o`.
fn jobs() -> Vec<String> {
    let mut jobs = Vec::new();
    let mut add = |job: String| jobs.push(job);
    for character in synth::CHARACTERS {
        let name = format!("{},width=143,height=117,seed=3", character.name);
        add(format!("synth {name} o.tif"));
        for error in ["0", "0.7", "6", "80"] {
            add(format!("tin synth:{name} o.ply --max-error {error} --tile 32"));
        }
        add(format!("tin synth:{name} o.ply --max-error 3"));
        add(format!("tin synth:{name} o.ply --max-error 3 --tile 64 --no-drop"));
        add(format!("tin synth:{name} o.ply --max-error 3 --tile 64 --strict"));
        add(format!("tin synth:{name} o.ply --max-error 3 --tile 64 --bound surface"));
        add(format!("tin synth:{name} o.ply --max-error 3 --tile 64 --fit-heights"));
        let any = "--triangulation data-dependent";
        add(format!("tin synth:{name} o.ply --max-error 3 --tile 64 {any}"));
        for options in ["", " --tolerance 4", " --polygons", " --polygons --tolerance 4"] {
            add(format!("contour synth:{name} -o o.geojsonl --interval 25 --tile 64{options}"));
        }
    }
    for format in mesh::FORMATS {
        let mesh = format.extensions[0];
        add(format!("tin ../in/rough.tif o.{mesh} --max-error 4"));
        add(format!("tin ../in/rough.tif o -f {} --max-error 4 --tile 64 --split 2", format.name));
        if format.name != "LandXML" {
            add(format!("tin ../in/degrees.asc o.{mesh} --max-error 2"));
        }
        add(format!("tin ../in/dense.laz o.{mesh} --max-error 0.3"));
    }
    for how in ["--strict", "--no-drop", "--fit-heights", "--max-vertices 900", "-f STL"] {
        let goal = if how.starts_with("--max") { "" } else { "--max-error 1.5" };
        add(format!("tin ../in/rough.tif o.ply --tile 64 --bound surface {goal} {how}"));
    }
    for method in methods::METHODS {
        for grid in ["rough,width=49,height=61,seed=3", "coast,width=57,height=40,seed=2"] {
            let job = format!("tin synth:{grid} o.ply --max-error 6 --method {}", method.name);
            let others =
                if method.takes_triangulation { &["split3", "data-dependent"][..] } else { &[] };
            for name in others {
                add(format!("{job} --triangulation {name}"));
            }
            add(job);
        }
    }
    for limit in ["--max-vertices 300", "--max-triangles 300"] {
        add(format!("tin ../in/rough.tif o.ply --tile 64 {limit}"));
    }
    for print in
        ["--size 100mm --base 3mm", "--scale 1:5000", "--exaggerate 2", "--co SOLID_BASE=0"]
    {
        add(format!("tin ../in/rough.tif o.stl --max-error 4 {print}"));
    }
    add("tin ../in/degrees.asc o.glb --max-error 2 --keep-degrees".into());
    for cloud in ["dense.laz", "thin.las", "steep.laz"] {
        for error in ["0", "0.05", "0.5", "5"] {
            add(format!("tin ../in/{cloud} o.ply --max-error {error}"));
        }
        for model in ["--dtm", "--dsm", "--chm", "--dtm --ground pmf", "--chm --canopy spike-free"]
        {
            add(format!("grid ../in/{cloud} o.tif --cell 1.5 {model}"));
        }
        for method in gridding::METHODS {
            let name = method.name.replace("pN", "p95");
            add(format!("grid ../in/{cloud} o.tif --cell 2 --stat {name}"));
            add(format!("grid ../in/{cloud} o.tif --cell 0.4,0.6 --stat {name}"));
        }
    }
    for options in [
        "--stat idw:radius=3,power=2,nearest:radius=2,std:ddof=1",
        "--stat tin:max_edge=3,natural",
        "--stat mean,max --fill 3",
        "--stat mean,idw --compat pdal --radius 1.5",
        "--stat count,min --compat lasr",
        "--stat max:attribute=intensity,std:attribute=angle,mean:attribute=time,nearest:attribute=source",
        "--stat count:class=2,mean:return=last,density:min=950,max=960,share:class=2,p95:above=950",
        "--stat mean --every 3 --return last",
        "--stat mean --align 0.25,0.75 --type int16 --round --nodata -1",
    ] {
        add(format!("grid ../in/steep.laz o.tif --cell 2 {options}"));
    }
    for (cloud, output) in
        [("dense.laz", "o.las"), ("thin.las", "o.laz"), ("steep.laz", "o.copc.laz")]
    {
        for options in [
            "",
            "--point-format 7",
            "--class 2,6 --every 3",
            "--thin 2:lowest --dedupe",
            "--thin 2:random=3",
            "--to-crs EPSG:4326",
        ] {
            add(format!("points ../in/{cloud} {output} {options}"));
        }
    }
    add("points ../in/dense.laz ../in/thin.las o.copc.laz".into());
    add("points ../in/dense.laz o --tile 25 --buffer 2".into());
    for options in [
        "--height-above-ground",
        "--height-above-ground=z --classify ground --classify height",
        "--classify height:20=1,21=4 --ground class --class 5",
    ] {
        add(format!("points ../in/steep.laz o.laz {options}"));
    }
    let ground = "--classify ground --ground csf --height-above-ground";
    for options in [
        "--classify noise",
        "--classify noise:voxel:step=2,isolated=9,class=18 --return first",
        "--classify noise:statistical",
        &format!("--classify noise:statistical:k=20,m=1.5 --dedupe {ground}"),
    ] {
        add(format!("points ../in/steep.laz o.las {options}"));
        add(format!("points ../in/steep.laz o {options} --tile 25 --buffer 2"));
        // Its digest is that of one run without a plan.
        let plan = format!("plan points ../in/steep.laz -o w {options} --tile 25 --buffer 2");
        add(format!("{plan} --cut 2 then run w -o o"));
    }
    for options in [
        "--thin-distance 0.7",
        "--drop-overlap=2 --sort time",
        "--sort morton --attribute intensity=intensity/2+return --attribute class=class/2",
    ] {
        add(format!("points ../in/dense.laz ../in/steep.laz o.laz {options}"));
    }
    for format in raster::write::FORMATS {
        let (name, ending) = (format.name, format.extensions[0]);
        let round = if format.holds_types { "" } else { " --round" };
        add(format!("grid ../in/dense.laz o.{ending} -f {name} --cell 1 --stat max{round}"));
        for input in ["rough.tif", "degrees.asc"] {
            add(format!("convert ../in/{input} o.{ending} -f {name} --round"));
        }
    }
    for options in [
        "-f COG --co COMPRESS=ZSTD --co BLOCKSIZE=64",
        "-f COG --co COMPRESS=LZW --co OVERVIEW_RESAMPLING=NEAREST --co BLOCKSIZE=64",
        "-f GTiff --co COMPRESS=DEFLATE --co PREDICTOR=3 --co TILED=YES",
        "-f GTiff --co COMPRESS=PACKBITS --type uint16 --round",
        "-f GTiff --co BIGTIFF=YES --type float64",
        "-f store --co BLOCKSIZE=256 --type int16 --round",
        "--bbox 500300,4748600,501000,4749500",
    ] {
        add(format!("convert ../in/rough.tif o.tif {options}"));
    }
    add("convert ../in/rough.tif o.png --co ENCODING=TERRARIUM --round".into());
    for name in resample::RESAMPLINGS.iter().map(|own| own.name) {
        for to in ["--to-crs EPSG:4326", "--to-crs EPSG:3035 --resolution 75", "--like rough.tif"] {
            let to = to.replace("rough.tif", "../in/smooth.tif");
            add(format!("convert ../in/rough.tif o.tif --resampling {name} {to}"));
        }
    }
    for (ending, how) in [("tif", ""), ("tif", " -f COG --alpha"), ("png", " --alpha --nearest")] {
        add(format!("color-relief ../in/rough.tif ../in/colours.txt o.{ending}{how}"));
    }
    for (grid, options) in
        [("voids.asc", " --max-distance 5"), ("voids.asc", " --smoothing 2 -f COG")]
    {
        add(format!("fill ../in/{grid} o.tif{options} --json"));
    }
    add("fill synth:coast,size=150,seed=2 o.tif --max-distance 9 --json".into());
    for other in ["smooth.tif", "globe.tif --resampling cubic", "rough.tif --level-of-detection 1"]
    {
        add(format!("difference ../in/rough.tif ../in/{other} o.tif --json"));
    }
    add("difference ../in/voids.asc ../in/degrees.asc o.tif -f COG --json".into());
    for options in [
        "",
        " --stat sum,stdev,p95,majority,voids",
        " --cells center",
        " --cells touched --prefix d_",
    ] {
        add(format!("zonal ../in/rough.tif ../in/zones.wkt o.geojson{options}"));
    }
    for name in resample::RESAMPLINGS.iter().map(|own| own.name) {
        let options = format!("--with-z --step 40 --resampling {name}");
        add(format!("sample ../in/rough.tif ../in/zones.wkt o.geojson {options}"));
    }
    for method in line::METHODS {
        let name = method.name;
        let (much, little) = match method.bounds {
            line::registry::ToleranceKind::Distance => ("--tolerance 4", "--tolerance 0.4"),
            line::registry::ToleranceKind::Area(_) => ("--area 40", "--area 0.2"),
        };
        for shape in synth::lines::SHAPES {
            let input = format!("synth:{},vertices=700,features=4,seed=5", shape.name);
            add(format!("line {input} o.wkt --method {name} {much}"));
            add(format!("line {input} o.wkt --method {name} {much} --topology"));
        }
        add(format!("line ../in/mixed.geojson o.geojson --method {name} {little} --metric 3d"));
        add(format!("line ../in/coverage.geojson o.wkt --method {name} --keep-ratio 0.2"));
    }
    for options in [
        "--topology --strategy proactive",
        "--topology --collapse drop",
        "--topology --collapse keep",
        "--topology --snap 2 --decimals 1",
        "--decimals 0",
        "--hierarchy o.splits",
    ] {
        add(format!("line ../in/coverage.geojson o.wkt --tolerance 60 {options}"));
    }
    for goal in ["--keep-count 300", "--target-size 20K", "--keep-ratio 0.1 --topology"] {
        add(format!("line ../in/coverage.geojson o.geojson {goal}"));
    }
    add("contour ../in/voids.asc -o o.shp --interval 20 --polygons --to-crs EPSG:3857".to_owned());
    for format in vector::FORMATS.iter().filter(|format| format.create.is_some()) {
        let (name, ending) = (format.name, format.extensions[0]);
        add(format!("synth koch,vertices=200,features=3,size=10 o.{ending}"));
        add(format!("contour ../in/degrees.asc -o o.{ending} -f {name} --interval 20 --index 5"));
        add(format!("line ../in/walk.shp o.{ending} -f {name} --tolerance 0.1"));
        add(format!("line ../in/mixed.geojson o.{ending} -f {name} --tolerance 0.1"));
    }
    for format in [0, 1, 2, 3, 6, 7, 8] {
        for ending in ["las", "laz"] {
            add(format!("synth cloud,size=25,density=5,seed=2 o.{ending} --point-format {format}"));
        }
    }
    for input in ["rough.tif", "smooth.tif --exaggeration 3", "mesh.ply --edges"] {
        add(format!("view ../in/{input} -o o.png --width 120"));
    }
    for input in [
        "rough.tif",
        "degrees.asc",
        "mesh.ply",
        "dense.laz",
        "thin.las",
        "koch.fgb",
        "mixed.geojson",
    ] {
        add(format!("info ../in/{input} --json"));
    }
    add("info ../in/dense.laz --stats --json".into());
    add("qa ../in/dense.laz o.html --cell 2 --min-density 3".into());
    add("qa ../in/dense.laz p.html --index o.geojson".into());
    for what in ["density", "voids", "height", "class"] {
        add(format!("info ../in/dense.laz --picture o.png --picture-of {what} --cell 1"));
    }
    add("info ../in/mesh.ply --quality --grid ../in/rough.tif --json".into());
    for proof in [
        "mesh.ply ../in/rough.tif",
        "cloud.ply ../in/dense.laz --class 2",
        "simple.geojson ../in/coverage.geojson --tolerance 5 --topology",
    ] {
        add(format!("verify ../in/{proof} --json"));
    }
    add("plan tin ../in/rough.tif -o w --max-error 4 --tile 32 then run w -o o.ply".into());
    add(
        "plan tin ../in/rough.tif -o w --max-error 4 --tile 32 --bound surface then run w -o o.ply"
            .into(),
    );
    add("plan tin ../in/rough.tif -o w --max-error 4 --tile 32 --fit-heights then run w -o o.ply"
        .into());
    add("tin ../in/degrees.asc o.ply --max-error 2 --tile 16 --clip ../in/areas.wkt".into());
    add("plan tin ../in/rough.tif -o w --max-error 4 --tile 32 --triangulation data-dependent then run w -o o.ply".into());
    for how in ["", " --fit-heights", " --bound surface", " --triangulation data-dependent"] {
        let keep = "--keep-points ../in/points.wkt";
        add(format!("tin ../in/rough.tif o.ply --max-error 4 --tile 32 {keep}{how}"));
        add(format!("tin ../in/rough.tif o.ply --max-error 4 --tile 32 --min-angle 25{how}"));
        let lines = "--breaklines ../in/areas.wkt";
        add(format!("tin ../in/degrees.asc o.ply --max-error 2 --tile 16 {lines}{how}"));
    }
    for error in [0.2, 0.0] {
        let lines = "--breaklines ../in/kerbs.wkt --keep-points ../in/kerbs.wkt";
        add(format!("tin ../in/dense.laz o.ply --max-error {error} {lines} --verify"));
    }
    for how in ["", " --bound surface"] {
        let water = "--water ../in/water.wkt";
        add(format!("tin ../in/rough.tif o.ply --max-error 4 --tile 32 {water}{how}"));
    }
    add("convert ../in/rough.tif o.tif --water ../in/water.wkt".into());
    add("convert synth:integer,width=143,height=117,seed=3 o.tif --water ../in/water.wkt".into());
    for more in [
        "--max-error 9",
        "--max-error 9 --weights 1,0.5,3",
        "--max-vertices 200",
        "--max-error 9 --band 2",
    ] {
        add(format!("tin ../in/photo.png o.ply --bands 1,2,3 {more}"));
    }
    add("tin ../in/photo.png o.ply --bands 3,1 --max-error 6 --nodata 3".into());
    add("tin ../in/photo.png o.glb --bands 1,2,3 --max-error 9".into());
    add("view ../in/photo.ply -o o.png --width 120".into());
    add("info ../in/photo.ply --json".into());
    add("verify ../in/photo.ply ../in/photo.png --bands 1,2,3 --json".into());
    for grid in ["degrees", "voids", "pole"] {
        for how in [
            "",
            " --threads 1 --memory 96M",
            " --no-gzip",
            " --no-normals",
            " --no-gzip --no-normals --max-level 7",
        ] {
            add(format!("tiles ../in/{grid}.asc o{how}"));
        }
    }
    // Rows that are no parallels.
    for how in ["--no-gzip", "--format 3dtiles --no-gzip", "--threads 1 --memory 200M"] {
        add(format!("tiles synth:rough,size=200,cell=90 o {how}"));
    }
    for how in ["", " --tile-edges", " --meshopt", " --meshopt --tile-edges"] {
        add(format!("tiles ../in/voids.asc o --format 3dtiles{how}"));
    }
    add("tiles ../in/degrees.asc o --no-gzip --clip ../in/areas.wkt".into());
    for how in ["--skirts", "--skirts --meshopt --tile-edges"] {
        add(format!("tiles ../in/voids.asc o --format 3dtiles {how}"));
    }
    for (grid, water) in [("degrees.asc", "areas.wkt"), ("rough.tif", "water.wkt")] {
        let water = format!("--water ../in/{water} --water-mask");
        add(format!("tiles ../in/{grid} o --max-level 14 --no-gzip {water}"));
    }
    add("tiles ../in/dense.laz o --max-level 16".into());
    add("tiles ../in/steep.laz o --cell 2 --class 2 --max-level 16".into());
    add("verify ../in/tiles ../in/voids.asc --json".into());
    add("plan grid ../in/dense.laz -o w --cell 1 --stat max,idw then run w -o o.tif".into());
    // Their digests are those of one run without a plan, which are here as well.
    for canopy in ["", " --canopy spike-free"] {
        let model = format!("--chm{canopy}");
        add(format!("plan grid ../in/dense.laz -o w --cell 1.5 {model} then run w -o o.tif"));
    }
    let found = "--dtm --ground pmf";
    add(format!("plan grid ../in/steep.laz -o w --cell 1.5 {found} then run w -o o.tif"));
    add("plan tin ../in/dense.laz -o w --max-error 0.5 then run w -o o.ply".into());
    add("plan points ../in/dense.laz -o w --tile 25 --buffer 2 --cut 1 then run w -o o".into());
    jobs
}

/// Runs commands in a folder, and returns what they print.
fn run(job: &str, folder: &Path) -> Result<Vec<u8>, String> {
    let mut printed = Vec::new();
    for command in job.split(" then ") {
        let mut args: Vec<_> = command.split_whitespace().collect();
        if !args.contains(&"--json") {
            args.push("-q");
        }
        let ran =
            Command::new(env!("CARGO_BIN_EXE_terrane")).args(&args).current_dir(folder).output();
        let ran = ran.unwrap();
        if !ran.status.success() {
            return Err(format!("{command}: {}", String::from_utf8_lossy(&ran.stderr)));
        }
        printed.extend(ran.stdout);
    }
    Ok(printed)
}

/// A report without what depends on the machine and the moment.
fn lasting(printed: &[u8]) -> Vec<u8> {
    let Ok(Value::Object(mut report)) = serde_json::from_slice(printed) else {
        return printed.to_vec();
    };
    report.retain(|name, _| !PASSING.contains(&name.as_str()));
    serde_json::to_vec(&report).unwrap()
}

/// The files below a folder whose names begin with an "o", in order.
fn outputs(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(everything(&path));
        } else {
            files.push(path);
        }
    }
    files.retain(|path| path.strip_prefix(folder).unwrap().to_string_lossy().starts_with('o'));
    files.sort();
    files
}

fn everything(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { everything(&path) } else { vec![path] }).collect()
}

/// Of what a job prints, and of the names and bytes of what it writes.
fn digest(job: &str, folder: &Path) -> Result<String, String> {
    fs::create_dir(folder).unwrap();
    let mut hasher = blake3::Hasher::new();
    hasher.update(&lasting(&run(job, folder)?));
    let files = outputs(folder);
    if files.is_empty() && !job.ends_with("--json") {
        return Err(format!("{job}: nothing was written"));
    }
    for path in files {
        let bytes = fs::read(&path).unwrap();
        let name = path.strip_prefix(folder).unwrap().to_string_lossy().replace('\\', "/");
        hasher.update(format!("\n{name} {}\n", bytes.len()).as_bytes()).update(&bytes);
    }
    fs::remove_dir_all(folder).unwrap();
    Ok(hasher.finalize().to_hex()[..16].to_owned())
}

/// The digest of each job.
fn digests(jobs: &[String]) -> BTreeMap<String, String> {
    let place = Place::new();
    make_inputs(&place);
    let (next, found) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                let take = || next.fetch_add(1, Ordering::Relaxed);
                let one = || Some(take()).and_then(|number| Some((number, jobs.get(number)?)));
                while let Some((number, job)) = one() {
                    let digest = digest(job, &place.path(&number.to_string()));
                    found.lock().unwrap().insert(job.clone(), digest);
                }
            });
        }
    });
    let found = found.into_inner().unwrap();
    let failed: Vec<_> = found.values().filter_map(|digest| digest.as_ref().err()).collect();
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!(found.len(), jobs.len(), "every job is run, and none is there twice");
    found.into_iter().map(|(job, digest)| (job, digest.unwrap_or_default())).collect()
}

/// The revision and the digests that are checked in.
fn pinned() -> (u32, BTreeMap<String, String>) {
    let text = fs::read_to_string(TABLE).unwrap_or_default();
    let mut rows: BTreeMap<_, _> = text
        .lines()
        .filter_map(|row| row.split_once('\t'))
        .map(|(value, key)| (key.to_owned(), value.to_owned()))
        .collect();
    let revision = rows.remove("revision").map_or(0, |revision| revision.parse().unwrap());
    (revision, rows)
}

fn renew(found: &BTreeMap<String, String>) {
    let rows: String = found.iter().map(|(job, digest)| format!("{digest}\t{job}\n")).collect();
    fs::write(TABLE, format!("{REVISION}\trevision\n{rows}")).unwrap();
}

#[test]
fn outputs_have_the_bytes_that_their_revision_says() {
    let (revision, pinned) = pinned();
    let found = digests(&jobs());
    let changed: Vec<_> = found
        .iter()
        .filter(|(job, digest)| pinned.get(*job).is_some_and(|known| known != *digest))
        .map(|(job, _)| job.as_str())
        .collect();
    assert!(
        changed.is_empty() || revision != REVISION,
        "{} of {} outputs have other bytes than those pinned. Where that is meant, add 1 to REVISION in \
         crates/engine/src/lib.rs, so that plans begun before are not gone on with, and renew the table: \
         TERRANE_GOLDEN=renew cargo test --test golden\n  {}",
        changed.len(),
        pinned.len(),
        changed.join("\n  ")
    );
    if std::env::var("TERRANE_GOLDEN").is_ok_and(|wish| wish == "renew") {
        renew(&found);
    } else {
        assert!(
            revision == REVISION && found.keys().eq(pinned.keys()),
            "tests/golden.tsv is of revision {revision} with {} jobs, the program of {REVISION} with \
             {}; renew it: TERRANE_GOLDEN=renew cargo test --test golden",
            pinned.len(),
            found.len()
        );
    }
}
