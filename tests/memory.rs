//! `--memory` is kept, by every verb: what would take more is spilled, read anew, or refused with what is
//! enough.
//!
//! What counts is the largest resident memory of the process, which the system tells when it ends. That
//! is no less than what a control group would count of it, and takes no right to make one. It also counts
//! what the process took that started it, so no other test is in this one.
#![allow(unsafe_code)]

#[path = "common/cli_support.rs"]
mod cli_support;

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::sync::Mutex;

use cli_support::Place;

/// The most memory that a mesh of three quarters of all samples took with a budget, in MiB.
fn peak_mib(place: &Place, threads: &str, budget: &str) -> f64 {
    let output = format!("{threads}-{budget}.ply");
    let args = [
        "tin",
        "synth:rough,width=2049,height=769",
        &output,
        "--max-error",
        "0.02",
        "--tile",
        "128",
    ];
    let report =
        place.ok(&[&args[..], &["--threads", threads, "--memory", budget, "--json"]].concat());
    let report: serde_json::Value = serde_json::from_str(&report.out).unwrap();
    report["peak_memory"].as_f64().unwrap() / f64::from(1 << 20)
}

#[test]
#[cfg(target_os = "linux")]
fn a_budget_is_kept_that_the_mesh_would_break() {
    let place = Place::new();
    for (threads, budget) in [("1", 30.0), ("2", 38.0)] {
        let free = peak_mib(&place, threads, "4G");
        assert!(free > 1.2 * budget, "the job needs only {free} MiB and proves nothing");
        let bound = peak_mib(&place, threads, &format!("{budget}M"));
        assert!(bound <= budget, "{bound} MiB of {budget} with {threads} threads");
    }
    let same = same_bytes(&place.path("1-4G.ply"), &place.path("2-38M.ply"));
    assert!(same, "the budget left a trace");
}

/// Whether two files hold the same, of which little is in memory at a time: see [`measured`].
#[cfg(target_os = "linux")]
fn same_bytes(first: &Path, second: &Path) -> bool {
    let open = |path| BufReader::new(File::open(path).unwrap());
    let (mut first, mut second) = (open(first), open(second));
    loop {
        let (left, right) = (first.fill_buf().unwrap(), second.fill_buf().unwrap());
        let count = left.len().min(right.len());
        if left[..count] != right[..count] {
            return false;
        }
        if count == 0 {
            return left.len() == right.len();
        }
        first.consume(count);
        second.consume(count);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_large_block_takes_little_beyond_the_budget() {
    let place = Place::new();
    let terrain = "synth:rough,width=2049,height=769";
    let args = ["tin", terrain, "out", "--max-error", "0.02", "--tile", "128", "--split", "100"];
    for threads in ["1", "2"] {
        let more = ["--threads", threads, "--memory", "40M", "--overwrite", "--json"];
        let report = place.ok(&[&args[..], &more].concat());
        let report: serde_json::Value = serde_json::from_str(&report.out).unwrap();
        let [peak, vertices] = ["peak_memory", "vertices"].map(|key| report[key].as_f64().unwrap());
        let own = (peak - vertices * 8.0) / f64::from(1 << 20);
        assert!(own < 42.0, "{own} MiB without the ids of {vertices} vertices, {threads} threads");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_folder_of_meshes_is_verified_without_holding_its_triangles() {
    let place = Place::new();
    let terrain = "synth:rough,width=2049,height=769";
    let args = ["tin", terrain, "out", "--max-error", "0.02", "--tile", "128", "--split", "100"];
    place.ok(&[&args[..], &["-q"]].concat());
    let report = place.ok(&["verify", "out", terrain, "--memory", "32M", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&report.out).unwrap();
    let peak = report["peak_memory"].as_f64().unwrap() / f64::from(1 << 20);
    // The vertices of a block (24 bytes each) come on top of the budget.
    let vertices = report["vertices"].as_f64().unwrap() / 3.0 / 2.0 * 24.0 / f64::from(1 << 20);
    assert!(peak < 32.0 + vertices + 16.0, "{peak} MiB with {vertices} MiB of vertices");
}

/// What the rows of the table work on, made by the program itself.
struct Sizes {
    /// Samples along a side of a terrain.
    terrain: u32,
    /// Metres along a side of clouds, one dense and one sparse.
    cloud: [u32; 2],
    /// Polygons of a coverage of 200 vertices each, and vertices of a walk.
    coverage: u32,
    walk: u32,
}

/// Whether inputs are larger and budgets more.
fn is_thorough() -> bool {
    std::env::var_os("TERRANE_MEMORY_TEST").is_some()
}

/// As large as jobs have to be for tests of memory to mean something.
fn sizes() -> Sizes {
    match is_thorough() {
        true => Sizes { terrain: 4097, cloud: [500, 1500], coverage: 8000, walk: 1_000_000 },
        false => Sizes { terrain: 1025, cloud: [150, 400], coverage: 1000, walk: 150_000 },
    }
}

fn make_inputs(place: &Place) {
    let Sizes { terrain, cloud: [dense, sparse], coverage, walk } = sizes();
    for (name, output) in [
        (format!("rough,size={terrain}"), "dem.tif"),
        (format!("cloud,size={dense},density=12"), "dense.laz"),
        (format!("cloud,size={sparse},density=2"), "sparse.laz"),
        (format!("coverage,vertices=200,features={coverage}"), "coverage.fgb"),
        (format!("walk,vertices={walk}"), "walk.fgb"),
    ] {
        place.ok(&["synth", &name, output, "-q"]);
    }
    // Far more bytes than the least budget.
    place.ok(&["synth", "rough,size=2817", "large.tif", "-q"]);
    let zones = "POLYGON ((499000 4751000, 525000 4749000, 527000 4723000, 504000 4729000, 499000 4751000))\nPOLYGON ((510000 4740000, 520000 4740000, 520000 4730000, 510000 4740000))";
    let small = "POLYGON ((510000 4740000, 511500 4740000, 511500 4738500, 510000 4740000))";
    place.write("small.wkt", small).write("small.prj", "EPSG:32631");
    // Far more bytes in their properties than in their positions.
    let columns: String = (0..400).map(|i| format!(",property{i}")).collect();
    let mut table = File::create(place.path("columns.csv")).unwrap();
    writeln!(table, "x,y{columns}").unwrap();
    for i in 0..8000 {
        writeln!(table, "{},4740000{}", 500_000 + i, ",12345678".repeat(400)).unwrap();
    }
    place.write("columns.prj", "EPSG:32631");
    place.write("zones.wkt", zones).write("zones.prj", "EPSG:32631");
    // Blocks that take as much again, twice, while they are decoded.
    let blocks = "convert large.tif blocks.tif -q --co TILED=YES --co BLOCKXSIZE=1024 --co BLOCKYSIZE=1024 --co COMPRESS=DEFLATE --co PREDICTOR=3";
    place.ok(&blocks.split(' ').collect::<Vec<_>>());
    // Voids all over, narrow and wide.
    place.ok(&["synth", "salt,size=2817,voids=0.3", "holes.tif", "-q"]);
    let moved = "convert large.tif moved.tif -q --to-crs EPSG:4326 --resampling near";
    place.ok(&moved.split(' ').collect::<Vec<_>>());
    place.write("colours.txt", "0% 0 90 30\n40% 250 240 130\n100% white\nnv 0 0 0 0\n");
    place.ok(&["tin", "large.tif", "large.ply", "--max-error", "20", "-q"]);
    place.ok(&["tin", "large.tif", "full.ply", "--max-error", "2", "-q"]);
    let corners = "501000 4730000, 520000 4730000, 520000 4749000, 501000 4749000, 501000 4730000";
    place.write("square.wkt", format!("POLYGON (({corners}))")).write("square.prj", "EPSG:32631");
    let clip = ["--clip", "square.wkt", "--max-error", "20", "-q"];
    place.ok(&[&["tin", "large.tif", "part.ply"], &clip[..]].concat());
    // As many as a quarter of the least budget holds.
    let point = |i: u64| (500_000 + i * 7919 % 28_170, 4_721_840 + i * 104_729 % 28_160);
    let points = (0..125_000).map(point).map(|(x, y)| format!("{x},{y}\n"));
    place.write("points.csv", format!("x,y\n{}", points.collect::<String>()));
    place.write("points.prj", "EPSG:32631");
    let keep = ["--keep-points", "points.csv", "--max-error", "20", "-q"];
    place.ok(&[&["tin", "large.tif", "kept.ply"], &keep[..]].concat());
    // Some 60,000 segments, of which most of what a quarter of the budget holds is.
    let at = |i: u64| (500_000 + i * 7919 % 28_170, 4_721_840 + i * 53 % 28_160);
    let walk = (0..60_000).map(at).map(|(x, y)| format!("{x} {y}, {} {}", x + 90, y + 70));
    let walk = walk.map(|line| format!("LINESTRING ({line})\n")).collect::<String>();
    place.write("walks.wkt", walk).write("walks.prj", "EPSG:32631");
    let follow = ["--breaklines", "walks.wkt", "--max-error", "20", "-q"];
    place.ok(&[&["tin", "large.tif", "followed.ply"], &follow[..]].concat());
    // Ponds all over, in rows of rivers.
    let pond = |i: u64| {
        let (x, y) = (500_100 + i % 90 * 310, 4_749_900 - i / 90 * 450);
        format!("POLYGON (({x} {y}, {} {y}, {} {}, {x} {y}))\n", x + 205, x + 95, y - 190)
    };
    let river = |i: u64| {
        let (y, [x0, x1]) = (4_749_600 - i * 450, [500_000, 528_000]);
        let area = format!("POLYGON (({x0} {y}, {x1} {y}, {x1} {}, {x0} {0}, {x0} {y}))", y - 60);
        format!("{area}\nLINESTRING ({x0} {}, {x1} {0})\n", y - 30)
    };
    let ponds = (0..5_400).map(pond).chain((0..60).map(river)).collect::<String>();
    place.write("ponds.wkt", ponds).write("ponds.prj", "EPSG:32631");
    let flat = ["--water", "ponds.wkt", "--max-error", "20", "-q"];
    place.ok(&[&["tin", "large.tif", "flat.ply"], &flat[..]].concat());
    place.ok(&["tin", "dem.tif", "dem.ply", "--max-error", "0.5", "-q"]);
    place.ok(&["tin", "dense.laz", "dense.ply", "--max-error", "0.5", "-q"]);
    // Short lines all over the dense cloud, half of them with heights.
    let side = u64::from(dense) * 100;
    let kerb = |i: u64| {
        let cm = |at: u64, from: u64| format!("{}.{:02}", from + at / 100, at % 100);
        let (x, y) = (i * 7919 % side, i * 104_729 % side);
        let at = |dx, dy| format!("{} {}", cm(x + dx, 500_000), cm(y + dy, 4_750_000));
        match i % 2 {
            0 => format!("LINESTRING ({}, {})\n", at(0, 40), at(90, 0)),
            _ => format!("LINESTRING Z ({} 200, {} 210)\n", at(0, 40), at(90, 0)),
        }
    };
    place.write("kerbs.wkt", (0..40_000).map(kerb).collect::<String>());
    place.write("kerbs.prj", "EPSG:32631");
    let follow = ["--breaklines", "kerbs.wkt", "--keep-points", "kerbs.wkt", "-q"];
    let kerbed = ["tin", "dense.laz", "kerbed.ply", "--max-error", "0.5"];
    place.ok(&[&kerbed[..], &follow].concat());
    place.ok(&["grid", "dense.laz", "bands.tif", "--cell", "1", "--stat", "mean,max,min", "-q"]);
    let bands = ["--bands", "1,2,3", "--max-error", "1", "-q"];
    place.ok(&[&["tin", "bands.tif", "bands.ply"], &bands[..]].concat());
    place.ok(&["line", "coverage.fgb", "less.fgb", "--tolerance", "5", "--topology", "-q"]);
    place.ok(&["line", "walk.fgb", "walked.fgb", "--tolerance", "5", "-q"]);
    place.ok(&["plan", "tin", "dem.tif", "-o", "tin.plan", "--max-error", "0.5"]);
    let cloud = ["plan", "tin", "dense.laz", "-o", "cloud.plan", "--max-error", "0.5"];
    place.ok(&[&cloud[..], &["--cut", "200000"]].concat());
    let squares = "--tile 60 --dedupe --classify noise:statistical --classify ground";
    let squares: Vec<&str> = squares.split(' ').collect();
    place.ok(&[&["plan", "points", "dense.laz", "-o", "points.plan"], &squares[..]].concat());
    // The same samples, a second of arc apart.
    for (grid, name, side) in [("dem.tif", "globe", terrain), ("large.tif", "wide", 2817)] {
        place.ok(&["convert", grid, &format!("{name}.flt"), "-q"]);
        let header = format!(
            "ncols {side}\nnrows {side}\nxllcenter 7\nyllcenter 46\ncellsize 0.000277777777777778\n\
             NODATA_value -9999\nbyteorder LSBFIRST\n"
        );
        place.write(&format!("{name}.hdr"), header);
        place.write(&format!("{name}.prj"), "EPSG:4326");
    }
    place.ok(&["tiles", "globe.flt", "tiles", "-q"]);
    place.ok(&["tiles", "dem.tif", "moved", "-q"]);
}

/// Every verb in every way of its own to hold memory, without what is the same in all of them.
const JOBS: &[&str] = &[
    "tin dem.tif o.ply --max-error 1 --tile 256",
    "tin dem.tif o.ply --max-error 0 --tile 256",
    "tin dem.tif o.ply --max-error 0.2 --tile 256 --bound surface",
    "tin large.tif o.ply --max-error 20 --tile 256 --keep-points points.csv",
    "tin large.tif o.ply --max-error 20 --tile 256 --breaklines walks.wkt",
    "tin large.tif o.ply --max-error 20 --tile 128 --breaklines walks.wkt",
    "tin large.tif o.ply --max-error 20 --tile 256 --water ponds.wkt",
    "convert large.tif o.tif --water ponds.wkt",
    "tin dem.tif o.ply --max-error 0.2 --tile 256 --fit-heights",
    "tin dem.tif o.ply --max-error 0.2 --tile 256 --min-angle 26",
    "tin dem.tif o.ply --max-error 0 --tile 256 --fit-heights --bound surface",
    "tin dem.tif o.ply --max-error 0.2 --tile 256 --triangulation data-dependent",
    "tin dem.tif o.ply --max-error 0 --tile 256 --triangulation data-dependent --fit-heights",
    "tin dem.tif o.stl --max-error 0 --tile 256",
    "tin dem.tif o.glb --max-error 0.2 --tile 256",
    "tin dem.tif o --max-error 1 --tile 256 --split 256",
    "tin bands.tif o.ply --bands 1,2,3 --max-error 0",
    "tin dense.laz o.ply --max-error 0.5 --breaklines kerbs.wkt",
    "tin dense.laz o.ply --max-error 0 --breaklines kerbs.wkt --keep-points kerbs.wkt",
    "grid dense.laz o.tif --cell 1 --stat mean,max",
    "grid dense.laz o.tif --cell 0.5 --stat p50",
    "grid dense.laz o.tif --cell 1 --stat idw",
    "grid dense.laz o.tif --cell 1 --stat tin",
    "grid dense.laz o.tif --cell 1 --stat natural",
    "grid sparse.laz o.tif --cell 4 --stat natural",
    "qa dense.laz o.html --cell 0.3 --index o.fgb",
    "qa sparse.laz o.html --cell 0.5",
    "grid dense.laz o.tif --cell 1 --dtm",
    "grid dense.laz o.tif --cell 1 --chm",
    "grid dense.laz o.tif --cell 1 --chm --canopy spike-free",
    "grid dense.laz o.tif --cell 1 --dtm --ground ptd",
    "grid sparse.laz o.tif --cell 4 --dtm --ground csf-ptd",
    "contour dem.tif -o o.fgb --interval 20 --tile 256",
    "contour dem.tif -o o.geojson --interval 20 --tolerance 2 --tile 256",
    "verify dem.ply dem.tif",
    "verify large.ply large.tif",
    "verify full.ply large.tif",
    "verify part.ply large.tif --clip square.wkt",
    "verify kept.ply large.tif --keep-points points.csv",
    "verify followed.ply large.tif --breaklines walks.wkt",
    "verify flat.ply large.tif --water ponds.wkt",
    "verify bands.ply bands.tif --bands 1,2,3",
    "verify dense.ply dense.laz",
    "verify kerbed.ply dense.laz --breaklines kerbs.wkt --keep-points kerbs.wkt",
    "verify less.fgb coverage.fgb --tolerance 5 --topology",
    "verify walked.fgb walk.fgb --tolerance 5",
    "line coverage.fgb o.fgb --tolerance 5",
    "line walk.fgb o.geojson --tolerance 5",
    "line walk.fgb o.fgb --tolerance 5 --method imai-iri",
    "line walk.fgb o.fgb --area 5 --method visvalingam",
    "line coverage.fgb o.fgb --tolerance 5 --hierarchy h",
    "line coverage.fgb o.fgb --keep-ratio 0.2",
    "line coverage.fgb o.geojson --target-size 500K",
    "line coverage.fgb o.fgb --tolerance 5 --topology",
    "line coverage.fgb o.fgb --tolerance 0 --topology",
    "line coverage.fgb o.fgb --tolerance 5 --topology --strategy proactive",
    "line coverage.fgb o.fgb --tolerance 5 --topology --snap 0.001",
    "line coverage.fgb o.fgb --keep-ratio 0.2 --topology",
    "line coverage.fgb o.shp --target-size 1M --topology",
    "line walk.fgb o.fgb --tolerance 5 --topology",
    "line walk.fgb o.fgb --tolerance 0 --topology",
    "convert dem.tif o.tif",
    "convert dem.tif o.tif --format COG",
    "convert dem.tif o.asc",
    "convert large.tif o.tif --type float64",
    "convert large.tif o.tif --to-crs EPSG:4326 --resampling cubic",
    "convert large.tif o2.tif -f COG --resolution 90 --resampling bilinear",
    "color-relief large.tif colours.txt o3.tif --alpha",
    "color-relief large.tif colours.txt o4.png",
    "slope large.tif o5.tif",
    "hillshade large.tif o6.tif",
    "fill holes.tif o16.tif",
    "fill holes.tif o17.tif --max-distance 400 -f COG",
    "fill holes.tif o18.asc --smoothing 3",
    "difference large.tif blocks.tif o19.tif",
    "difference blocks.tif large.tif o20.tif -f COG",
    "difference dem.tif large.tif o21.tif --resampling cubic",
    "difference large.tif moved.tif o22.tif",
    "contour large.tif -o o.fgb --interval 100",
    "convert blocks.tif o10.tif",
    "slope blocks.tif o11.tif",
    "contour blocks.tif o12.fgb --interval 100",
    "zonal large.tif zones.wkt o7.fgb",
    "zonal large.tif small.wkt o8.geojson --stat median,majority",
    "sample large.tif zones.wkt o9.fgb --with-z --step 20",
    "sample large.tif columns.csv o13.csv",
    "convert dem.tif o15.tif --co TILED=NO --co BLOCKYSIZE=1025",
    "zonal large.tif small.wkt o14.geojson --stat variety",
    "view dem.tif -o o.png --width 400",
    "view dem.ply -o o.png --width 400",
    "view large.tif -o o.png --width 400",
    "info dem.tif --stats",
    "info large.tif --stats",
    "info dem.ply --quality --grid dem.tif",
    "info large.ply --quality --grid large.tif",
    "info dense.laz --stats",
    "info dense.laz --picture o.png --cell 0.2",
    "info dense.laz --picture o2.png --picture-of height --cell 0.2",
    "view dense.laz --html o.html",
    "view dense.laz --html o2.html --points 20000",
    "info coverage.fgb --stats",
    "synth rough,size=1025 o.tif",
    "synth cloud,size=200 o.laz",
    "run tin.plan",
    "run cloud.plan",
    "run points.plan",
    "tiles globe.flt o1",
    "tiles wide.flt o2 --max-level 4",
    "verify tiles globe.flt",
    "tiles dem.tif o3",
    "tiles large.tif o4 --max-level 5",
    "verify moved dem.tif",
    "points dense.laz o.las",
    "points dense.laz o.laz --thin 0.5:lowest --dedupe",
    "points dense.laz o.copc.laz",
    "points dense.laz o3.laz --classify ground --height-above-ground",
    "points dense.laz o4.laz --classify ground --ground smrf",
    "points dense.laz o9.laz --classify noise",
    "points dense.laz o10.laz --classify noise:statistical:k=20",
    "points dense.laz o11.laz --stage normals:k=20 --stage where:NormalZ>0.5",
    "points dense.laz o12.laz --stage tree-tops:3 --stage sample-grid:dem.tif:Ground",
    "points dense.laz o13.laz --stage trees:2:min=0",
    "points dense.laz o5 --tile 100 --buffer 5",
    "points dense.laz o2.laz --to-crs EPSG:4326",
    "points dense.laz o6.laz --thin-distance 0.3",
    "points dense.laz o7.laz --thin-distance 20 --sort morton",
    "points dense.laz o8.las --drop-overlap --attribute user_data=return --sort time",
];

/// Budgets of the table, in MiB, of which the last is for `TERRANE_MEMORY_TEST`.
///
/// The code of a program with checks alone takes 17.
const BUDGETS: [u64; 4] = [26, 32, 64, 256];

/// Runs a job with so much memory: its exit code, what it said, and the MiB that it took.
///
/// A new process shares the memory of the one that starts it until it is a program of its own, and the
/// system counts that, too: the tests have to stay below the least budget themselves.
#[cfg(target_os = "linux")]
#[expect(
    clippy::zombie_processes,
    reason = "it is waited for with wait4, which tells what it used"
)]
fn measured(place: &Place, job: &str, mib: u64) -> (i32, String, f64) {
    use std::io::Read;
    let memory = format!("{mib}M");
    let words: Vec<&str> = job.split(' ').chain(["--memory", &memory]).collect();
    let mut command = place.command(&words);
    command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut told = String::new();
    child.stderr.take().unwrap().read_to_string(&mut told).unwrap();
    let (mut status, pid) = (0, i32::try_from(child.id()).unwrap());
    // SAFETY: all bytes of the structure may be 0.
    let mut used: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: the process is a child that nobody else waits for; both places outlive the call.
    let waited = unsafe { libc::wait4(pid, &raw mut status, 0, &raw mut used) };
    assert_eq!(waited, pid, "{job}");
    let code = if libc::WIFEXITED(status) { libc::WEXITSTATUS(status) } else { -1 };
    let own = terrane_engine::peak_memory().unwrap() >> 20;
    assert!(own < BUDGETS[0], "the tests take {own} MiB themselves and measure nothing");
    (code, told, used.ru_maxrss as f64 / 1024.0)
}

/// The memory that an error tells to pass.
fn advised(told: &str) -> Option<u64> {
    let (_, rest) = told.split_once("--memory ")?;
    rest.split_once('M')?.0.parse().ok()
}

/// A job as it is run again and again.
fn repeated(job: &str) -> String {
    match job.split(' ').next() {
        Some("verify") => format!("{job} -q"),
        Some("info") if !job.contains("--picture") => job.to_owned(),
        Some("run") => format!("{job} -q"),
        _ => format!("{job} --overwrite -q"),
    }
}

#[test]
#[cfg(target_os = "linux")]
fn no_verb_takes_more_than_it_may() {
    let (place, other) = (Place::new(), Place::new());
    make_inputs(&place);
    link(&place.path(""), &other.path(""));
    let jobs = Mutex::new(JOBS.iter());
    let work = |place: &Place| {
        let next = || jobs.lock().unwrap().next();
        std::iter::from_fn(next).flat_map(|job| faults_of(place, job)).collect::<Vec<_>>()
    };
    let faults = std::thread::scope(|scope| {
        let beside = scope.spawn(|| work(&other));
        [work(&place), beside.join().unwrap()].concat()
    });
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Gives the files of a folder names in another.
#[cfg(target_os = "linux")]
fn link(folder: &Path, other: &Path) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let new = other.join(path.file_name().unwrap());
        match path.is_dir() {
            true => {
                std::fs::create_dir(&new).unwrap();
                link(&path, &new);
            }
            false => std::fs::hard_link(&path, &new).unwrap(),
        }
    }
}

/// Where a job took more than it may, or failed with what it was told is enough.
#[cfg(target_os = "linux")]
fn faults_of(place: &Place, job: &str) -> Vec<String> {
    let (again, mut faults) = (repeated(job), Vec::new());
    let budgets = if is_thorough() { &BUDGETS[..] } else { &BUDGETS[..3] };
    // The budgets that sufficed.
    let mut sufficient = Vec::new();
    for &mib in budgets {
        // One that is refused keeps within its memory, too.
        let mut run = |mib: u64| {
            let (code, told, peak) = measured(place, &again, mib);
            if peak > mib as f64 {
                faults.push(format!("{job}: {peak:.1} MiB of {mib}, exit code {code}"));
            }
            (code, told)
        };
        let (mut mib, (mut code, mut told)) = (mib, run(mib));
        // Of one feature that is too large its own need is told, and what its neighbours take once
        // that is met, as docs/src/guide/promises.md says; otherwise what is told to be enough is enough.
        let steps = if told.contains("a feature of") && job.contains("--topology") { 2 } else { 1 };
        for _ in 0..steps {
            if code != 75 {
                break;
            }
            let Some(enough) = advised(&told).filter(|enough| *enough > mib) else { break };
            // Two budgets may be given the same advice.
            (code, told) = match sufficient.contains(&enough) {
                true => (0, String::new()),
                false => run(enough),
            };
            mib = enough;
        }
        if code != 0 {
            faults.push(format!("{job}, {mib} MiB: exit code {code}, {told}"));
        }
        if code == 0 {
            sufficient.push(mib);
        }
    }
    assert!(!sufficient.is_empty(), "{job} was never done: {faults:?}");
    faults
}
