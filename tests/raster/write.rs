//! Grids written in every format: what goes in comes out, the same bytes on any number of threads,
//! and a height that does not fit is refused with its place.

use std::fs::File;
use std::path::Path;

use terrane_base::geom::{Affine, Crs, Rect};
use terrane_base::{Error, ErrorKind, Result};
use terrane_engine::{Cancel, Silent};
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource, SampleType, write};
use terrane_terrain::convert::{ConvertJob, ConvertReport, copy};

/// A grid in memory, given by its stored values; NaN and nodata are void.
#[derive(Clone)]
struct Grid {
    info: GridInfo,
    stored: Vec<f64>,
}

const TRANSFORM: Affine =
    Affine { x0: 500_015.1, a: 30.3, b: 0.0, y0: 4_000_000.7, d: 0.0, e: -29.9 };

impl Grid {
    /// A slope with steps in whole numbers, and a void here and there.
    fn new(sample_type: SampleType, width: u32, height: u32) -> Self {
        let narrow = sample_type.bytes() == 1;
        let nodata = match sample_type {
            SampleType::I8 | SampleType::U8 => 100.0,
            // The half that is nearest to the other is none of its heights either.
            SampleType::F16 => 9984.0,
            _ => 9999.0,
        };
        let value = |k: u64| {
            let (col, row) = (k % u64::from(width), k / u64::from(width));
            let noise = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 61;
            let height = if narrow { col % 40 + noise } else { col + 3 * (row % 300) + noise };
            if k % 11 == 3 { nodata } else { height as f64 }
        };
        let stored = (0..u64::from(width) * u64::from(height)).map(value).collect();
        let info = GridInfo {
            transform: TRANSFORM,
            georeferenced: true,
            crs: Crs {
                epsg: Some(32_611),
                geographic: Some(false),
                vertical_unit: Some("metre".into()),
                ..Crs::default()
            },
            nodata: Some(nodata),
            ..GridInfo::plain("memory", width, height, sample_type)
        };
        Self { info, stored }
    }

    fn height(&self, k: usize) -> f64 {
        let value = self.stored[k];
        let void = value.is_nan() || Some(value) == self.info.nodata;
        if void { f64::NAN } else { value * self.info.scale + self.info.offset }
    }

    fn heights(&self) -> Vec<f64> {
        (0..self.stored.len()).map(|k| self.height(k)).collect()
    }
}

impl GridSource for Grid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        let mut wide = vec![0.0; out.len()];
        self.read_f64(rect, &mut wide)?;
        out.iter_mut().zip(wide).for_each(|(out, height)| *out = height as f32);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        let rows = out.chunks_exact_mut(rect.width as usize);
        for (row, line) in (rect.row..).zip(rows) {
            for (col, out) in (rect.col..).zip(line) {
                *out = self.height((row * self.info.width + col) as usize);
            }
        }
        Ok(())
    }
}

/// A job with `-f` and `--co` as on the command line: "GTiff COMPRESS=LZW TILED=YES".
fn job(path: &Path, asked: &str) -> ConvertJob {
    let mut words = asked.split_whitespace();
    let mut job = ConvertJob::new("memory", path);
    job.options.file.format = words.next().map(str::to_owned);
    let pair = |word: &str| word.split_once('=').map(|(k, v)| (k.to_owned(), v.to_owned()));
    job.options.written.co = words.filter_map(pair).collect();
    job.options.resources.threads = 3;
    job
}

fn convert(grid: &Grid, job: &ConvertJob) -> Result<ConvertReport> {
    copy(grid, job, &Silent, &Cancel::default())
}

fn open(path: &Path) -> Box<dyn GridSource> {
    raster::open(path.to_str().unwrap(), &GridOpenOptions::default()).unwrap()
}

fn heights(source: &dyn GridSource) -> Vec<f64> {
    let rect = source.info().bounds();
    let mut out = vec![0.0; rect.len()];
    source.read_f64(rect, &mut out).unwrap();
    out
}

fn assert_same(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len());
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!(a == b || a.is_nan() && b.is_nan(), "{what}: {a} for {b} at {k}");
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

const TIFFS: &[&str] = &[
    "GTiff",
    "GTiff BLOCKYSIZE=7 COMPRESS=PACKBITS",
    "GTiff COMPRESS=LZW PREDICTOR=2",
    "GTiff COMPRESS=DEFLATE LEVEL=1 PREDICTOR=NO",
    "GTiff TILED=YES BLOCKXSIZE=48 BLOCKYSIZE=32 COMPRESS=ZSTD BIGTIFF=YES",
    "GTiff TILED=YES",
    "COG BLOCKSIZE=64",
    "COG BLOCKSIZE=64 COMPRESS=ZSTD LEVEL=3 BIGTIFF=YES",
    "COG BLOCKSIZE=64 COMPRESS=LZW PREDICTOR=STANDARD RESAMPLING=NEAREST",
    "COG COMPRESS=NONE OVERVIEWS=NONE",
];

#[test]
fn every_type_comes_back_from_every_kind_of_geotiff() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for asked in TIFFS {
        for sample_type in SampleType::ALL {
            for (width, height) in [(1, 1), (131, 1), (3, 200), (150, 97)] {
                let what = format!("{asked} {} {width} x {height}", sample_type.name());
                let grid = Grid::new(sample_type, width, height);
                let job = job(&path, asked).with(|options| {
                    options.file.replacing.overwrite = true;
                });
                let report = convert(&grid, &job).unwrap();
                assert_eq!(report.output_bytes, path.metadata().unwrap().len());
                assert!(report.notes.is_empty());
                let found = open(&path);
                let info = found.info();
                assert_eq!((info.format, info.width, info.height), ("GeoTIFF", width, height));
                assert_eq!((info.sample_type, info.nodata), (sample_type, grid.info.nodata));
                assert_eq!((info.transform, info.crs.epsg), (TRANSFORM, Some(32_611)));
                assert_eq!(info.crs.vertical_unit.as_deref(), Some("metre"));
                assert_same(&heights(found.as_ref()), &grid.heights(), &what);
                let big = std::fs::read(&path).unwrap()[2] == 43;
                assert_eq!(big, asked.contains("BIGTIFF=YES"), "{what}");
            }
        }
    }
}

#[test]
fn every_format_takes_a_grid_of_whole_numbers() {
    for format in write::FORMATS {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("terrain-rgb.{}", format.extensions[0]));
        for point in [false, true] {
            let mut grid = Grid::new(SampleType::I16, 150, 97);
            grid.info.pixel_is_point = point;
            let job = job(&path, format.name).with(|options| {
                options.file.replacing.overwrite = true;
            });
            let report = convert(&grid, &job).unwrap();
            assert_eq!(report.format, format.name);
            let found = open(&path);
            assert_same(&heights(found.as_ref()), &grid.heights(), format.name);
            let found_at = found.info().transform;
            // Tables have the places of their cells as decimals, to a millionth of a cell.
            let slack = if format.name == "CSV" { 1e-9 } else { 0.0 };
            let apart = |at: fn(&Affine) -> f64| (at(&found_at) - at(&TRANSFORM)).abs();
            let parts: [fn(&Affine) -> f64; 6] =
                [|t| t.a, |t| t.b, |t| t.d, |t| t.e, |t| t.x0, |t| t.y0];
            assert!(parts.map(apart).iter().all(|apart| *apart <= slack), "{}", format.name);
            assert_eq!(found.info().crs.epsg, Some(32_611), "{}", format.name);
            assert!(names(folder.path()).iter().all(|name| !name.starts_with('.')));
        }
    }
}

#[test]
fn scale_offset_and_pixel_is_point_stay_in_a_geotiff() {
    let folder = tempfile::tempdir().unwrap();
    let turned = Affine { x0: 0.5, a: 30.75, b: 2.25, y0: 0.75, d: 1.5, e: -30.25 };
    for (k, asked) in ["COG BLOCKSIZE=64", "GTiff"].into_iter().enumerate() {
        for (transform, point) in [(TRANSFORM, true), (turned, false), (turned, true)] {
            let path = folder.path().join(format!("{k}{}{point}.tif", transform.b));
            let mut grid = Grid::new(SampleType::I32, 100, 80);
            (grid.info.scale, grid.info.offset) = (0.001, -50.0);
            (grid.info.transform, grid.info.pixel_is_point) = (transform, point);
            convert(&grid, &job(&path, asked)).unwrap();
            let found = open(&path);
            let info = found.info();
            assert_eq!((info.scale, info.offset, info.pixel_is_point), (0.001, -50.0, point));
            assert_eq!(info.transform, transform);
            assert_same(&heights(found.as_ref()), &grid.heights(), asked);
        }
    }
}

#[test]
fn a_system_without_a_code_is_kept_as_text() {
    let folder = tempfile::tempdir().unwrap();
    let wkt = r#"PROJCS["mine",GEOGCS["WGS 84",DATUM["WGS_1984"]],UNIT["metre",1]]"#;
    let mut grid = Grid::new(SampleType::I16, 9, 7);
    (grid.info.crs.epsg, grid.info.crs.wkt) = (None, Some(wkt.to_owned()));
    for (name, asked) in [("a.tif", "GTiff"), ("b.tif", "COG"), ("c.asc", "AAIGrid")] {
        let path = folder.path().join(name);
        convert(&grid, &job(&path, asked)).unwrap();
        assert_eq!(open(&path).info().crs.wkt.as_deref(), Some(wkt), "{asked}");
    }
}

#[test]
fn the_bytes_do_not_depend_on_threads_or_memory() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::new(SampleType::F32, 1100, 700);
    let all = [
        ("COG BLOCKSIZE=128", "tif"),
        ("GTiff COMPRESS=ZSTD", "tif"),
        ("AAIGrid", "asc"),
        ("GridFloat", "flt"),
        ("PNG", "png"),
    ];
    for (asked, ending) in all {
        let mut files = Vec::new();
        for (threads, memory) in [(1, 4096), (2, 20), (8, 4096)] {
            let path = folder.path().join(format!("{threads}.{ending}"));
            let mut job = job(&path, asked).with(|options| {
                options.file.replacing.overwrite = true;
            });
            job.options.resources.threads = threads;
            job.options.resources.memory = memory << 20;
            convert(&grid, &job).unwrap();
            files.push(std::fs::read(&path).unwrap());
        }
        assert!(files.windows(2).all(|pair| pair[0] == pair[1]), "{asked}");
    }
}

/// The images of a file as an independent reader sees them, with their places in the file.
fn images(path: &Path) -> Vec<(u32, u32, Vec<i16>, u64)> {
    let mut decoder = tiff::decoder::Decoder::new(File::open(path).unwrap()).unwrap();
    let mut images = Vec::new();
    loop {
        let (width, height) = decoder.dimensions().unwrap();
        let offsets = decoder.get_tag_u64_vec(tiff::tags::Tag::TileOffsets).unwrap();
        let tiff::decoder::DecodingResult::I16(values) = decoder.read_image().unwrap() else {
            panic!("not int16");
        };
        images.push((width, height, values, offsets[0]));
        if !decoder.more_images() {
            return images;
        }
        decoder.next_image().unwrap();
    }
}

#[test]
fn overviews_are_means_of_the_valid_samples_or_every_second_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let grid = Grid::new(SampleType::I16, 300, 201);
    for (asked, average) in [("AVERAGE", true), ("NEAREST", false)] {
        let asked = format!("COG BLOCKSIZE=64 OVERVIEW_RESAMPLING={asked}");
        convert(
            &grid,
            &job(&path, &asked).with(|options| {
                options.file.replacing.overwrite = true;
            }),
        )
        .unwrap();
        let images = images(&path);
        let sizes: Vec<_> = images.iter().map(|(w, h, ..)| (*w, *h)).collect();
        assert_eq!(sizes, [(300, 201), (150, 101), (75, 51), (38, 26)]);
        assert!(images.windows(2).all(|pair| pair[0].3 > pair[1].3), "small ones come first");
        let (mut above, mut width) = (grid.heights(), 300);
        for (w, h, values, _) in &images[1..] {
            let level = naive_level(&above, width, average);
            assert_eq!(level.len(), (*w * *h) as usize);
            for (found, mean) in values.iter().zip(&level) {
                let expected = if mean.is_nan() { 9999.0 } else { *mean };
                // f32 holds quarters of these heights; deeper means are rounded by it.
                assert!((f64::from(*found) - expected).abs() <= 0.501, "{found} for {expected}");
            }
            (above, width) = (level, *w as usize);
        }
    }
}

/// The slow twin: each sample from the four it stands for.
fn naive_level(above: &[f64], width: usize, average: bool) -> Vec<f64> {
    let height = above.len() / width;
    let mut level = Vec::new();
    for row in (0..height).step_by(2) {
        for col in (0..width).step_by(2) {
            let rows = row..(row + 2).min(height);
            let four = rows.flat_map(|r| (col..(col + 2).min(width)).map(move |c| r * width + c));
            let valid: Vec<f64> = four.map(|k| above[k]).filter(|z| !z.is_nan()).collect();
            let mean = valid.iter().sum::<f64>() / valid.len() as f64;
            level.push(if average { mean } else { above[row * width + col] });
        }
    }
    level
}

#[test]
fn a_mean_that_equals_nodata_moves_aside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let mut grid = Grid::new(SampleType::I16, 65, 2);
    (0..grid.stored.len()).for_each(|k| grid.stored[k] = if k % 2 == 0 { 99.0 } else { 101.0 });
    grid.info.nodata = Some(100.0);
    convert(&grid, &job(&path, "COG BLOCKSIZE=64")).unwrap();
    let overview = &images(&path)[1].2;
    assert!(overview.iter().all(|value| *value != 100), "{overview:?}");
}

fn refused(grid: &Grid, job: &ConvertJob, kind: ErrorKind, words: &[&str]) -> Error {
    let error = convert(grid, job).unwrap_err();
    let text = error.to_string();
    assert_eq!(error.kind(), kind, "{text}");
    assert!(words.iter().all(|word| text.contains(word)), "{text}");
    error
}

#[test]
fn what_does_not_fit_is_refused_with_its_place_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut grid = Grid::new(SampleType::F32, 70, 70);
    grid.info.nodata = None;
    grid.stored.fill(5.0);
    let place = "column 33, row 69";
    for (bad, kind, remedy) in [
        (0.5, SampleType::I16, "‹round›"),
        (40_000.0, SampleType::I16, "‹type›"),
        (-1.0, SampleType::U16, "‹type›"),
        (f64::NAN, SampleType::U8, "‹out_nodata›"),
        (70_000.0, SampleType::F16, "‹type›"),
        (0.1, SampleType::F16, "‹round›"),
    ] {
        grid.stored[69 * 70 + 33] = bad;
        for asked in ["store", "COG BLOCKSIZE=64", "GTiff"] {
            let job = job(&at("a.tif"), asked).with(|options| {
                options.samples.sample_type = Some(kind);
            });
            refused(&grid, &job, ErrorKind::BadInput, &[place, remedy, "a.tif"]);
        }
    }
    let nodata = job(&at("a.tif"), "COG").with(|options| {
        options.samples.out_nodata = Some(5.0);
    });
    refused(&grid, &nodata, ErrorKind::BadInput, &["column 0, row 0", "nodata"]);
    let impossible = nodata.with(|options| {
        options.samples.sample_type = Some(SampleType::U8);
    });
    let impossible = impossible.with(|options| {
        options.samples.out_nodata = Some(-1.0);
    });
    refused(&grid, &impossible, ErrorKind::Usage, &["-1", "uint8"]);
    grid.stored[69 * 70 + 33] = f64::NAN;
    let asc = job(&at("a.asc"), "AAIGrid").with(|options| {
        options.samples.out_nodata = Some(5.0);
    });
    refused(&grid, &asc, ErrorKind::BadInput, &["column 0, row 0", "nodata"]);
    refused(&grid, &job(&at("a.png"), "PNG"), ErrorKind::BadInput, &[place, "ALPHA=YES"]);
    grid.stored[69 * 70 + 33] = 0.26;
    refused(&grid, &job(&at("a.png"), "PNG"), ErrorKind::BadInput, &[place, "‹round›"]);
    grid.stored[69 * 70 + 33] = -10_001.0;
    refused(&grid, &job(&at("a.png"), "PNG"), ErrorKind::BadInput, &[place, "outside the range"]);
    (grid.stored[69 * 70 + 33], grid.info.sample_type) = (0.1, SampleType::F64);
    refused(&grid, &job(&at("a.flt"), "GridFloat"), ErrorKind::BadInput, &[place, "‹round›"]);
    grid.info.transform.e = 5.0;
    refused(&grid, &job(&at("a.asc"), "AAIGrid"), ErrorKind::CannotWrite, &["north-up"]);
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn round_takes_the_nearest_value_and_types_change_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let mut grid = Grid::new(SampleType::F64, 90, 70);
    grid.stored.iter_mut().filter(|z| **z != 9999.0).for_each(|z| *z += 0.375);
    for kind in [SampleType::I16, SampleType::U16, SampleType::I32] {
        let options = job(&path, "GTiff").with(|options| {
            options.samples.round = true;
            options.file.replacing.overwrite = true;
        });
        convert(
            &grid,
            &options.with(|options| {
                options.samples.sample_type = Some(kind);
            }),
        )
        .unwrap();
        let nearest: Vec<f64> = grid.heights().iter().map(|z| z.round()).collect();
        assert_same(&heights(open(&path).as_ref()), &nearest, kind.name());
        assert_eq!(
            (open(&path).info().sample_type, open(&path).info().nodata),
            (kind, Some(9999.0))
        );
    }
    // Not rounded where it need not be; a nodata value that the type lacks is replaced.
    let options = job(&path, "COG").with(|options| {
        options.file.replacing.overwrite = true;
    });
    let narrow = options.clone().with(|options| {
        options.samples.sample_type = Some(SampleType::F32);
    });
    convert(
        &grid,
        &narrow.with(|options| {
            options.samples.out_nodata = Some(-1.0);
        }),
    )
    .unwrap();
    assert_same(&heights(open(&path).as_ref()), &grid.heights(), "float32");
    assert_eq!(open(&path).info().nodata, Some(-1.0));
    let asc = folder.path().join("a.asc");
    let whole = job(&asc, "AAIGrid").with(|options| {
        options.samples.sample_type = Some(SampleType::I16);
        options.samples.round = true;
    });
    convert(&grid, &whole).unwrap();
    assert_eq!(open(&asc).info().sample_type, SampleType::I16);
    assert!(!std::fs::read_to_string(&asc).unwrap().lines().skip(6).any(|row| row.contains('.')));
}

#[test]
fn text_and_raw_grids_apply_scale_and_keep_every_float() {
    let folder = tempfile::tempdir().unwrap();
    let mut grid = Grid::new(SampleType::F32, 64, 50);
    for (k, z) in grid.stored.iter_mut().enumerate().filter(|(_, z)| **z != 9999.0) {
        *z = f64::from((*z as f32) * 0.37 + 1.0 / (k as f32 + 3.0));
    }
    for (ending, name) in [("asc", "AAIGrid"), ("flt", "GridFloat")] {
        let path = folder.path().join(format!("a.{ending}"));
        convert(&grid, &job(&path, name)).unwrap();
        let found = open(&path);
        assert_same(&heights(found.as_ref()), &grid.heights(), name);
        assert_eq!(found.info().nodata, Some(9999.0));
    }
    let mut scaled = Grid::new(SampleType::I16, 64, 50);
    (scaled.info.scale, scaled.info.offset) = (0.5, 100.0);
    for (ending, name) in [("asc", "AAIGrid"), ("flt", "GridFloat"), ("png", "PNG")] {
        let path = folder.path().join(format!("terrarium.{ending}"));
        let report = convert(&scaled, &job(&path, name)).unwrap();
        assert!(report.notes.iter().any(|note| note.contains("metre")), "{:?}", report.notes);
        assert_same(&heights(open(&path).as_ref()), &scaled.heights(), name);
    }
    let named = job(&folder.path().join("terrarium.png"), "PNG ENCODING=TERRAIN-RGB");
    let named = named.with(|options| {
        options.file.replacing.overwrite = true;
    });
    refused(&scaled, &named, ErrorKind::Usage, &["terrarium"]);
}

#[test]
fn options_that_cannot_act_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let grid = Grid::new(SampleType::I16, 20, 20);
    for (asked, word) in [
        ("GTiff BLOCKXSIZE=64", "TILED=YES"),
        ("GTiff TILED=YES BLOCKYSIZE=50", "multiple of 16"),
        ("GTiff LEVEL=5", "LEVEL"),
        ("GTiff COMPRESS=DEFLATE LEVEL=13", "1 to 12"),
        ("GTiff PREDICTOR=2", "PREDICTOR"),
        ("COG PREDICTOR=3", "float samples"),
        ("COG OVERVIEWS=NONE RESAMPLING=NEAREST", "overviews"),
        ("COG BLOCKSIZE=100", "steps of 16"),
        ("store COMPRESS=ZSTD", "BLOCKSIZE=256|512|1024"),
    ] {
        refused(&grid, &job(&path, asked), ErrorKind::Usage, &[word]);
    }
    let typed = job(&folder.path().join("a.flt"), "GridFloat").with(|options| {
        options.samples.sample_type = Some(SampleType::I16);
    });
    refused(&grid, &typed, ErrorKind::Usage, &["float32"]);
    let mut starved = job(&path, "GTiff COMPRESS=LZW");
    starved.options.resources.memory = 4 << 20;
    refused(&grid, &starved, ErrorKind::Resource, &["‹memory›"]);
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_found_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let input = "synth:rough,size=4000000";
    for asked in ["GTiff", "COG COMPRESS=NONE", "COG"] {
        let path = folder.path().join("a.tif");
        let error = terrane_terrain::convert::run(
            &ConvertJob { input: input.into(), ..job(&path, asked) },
            &Silent,
            &Cancel::default(),
        );
        let told = error.unwrap_err().to_string();
        assert!(told.contains("allocating") && told.contains("free some space"), "{told}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{asked}");
    }
}

#[test]
fn spools_of_a_cog_go_where_the_user_says() {
    let folder = tempfile::tempdir().unwrap();
    let mut job = job(&folder.path().join("a.tif"), "COG");
    job.input = "synth:rough,size=65".into();
    job.options.resources.temp_dir = Some(folder.path().join("lost"));
    let error = terrane_terrain::convert::run(&job, &Silent, &Cancel::default()).unwrap_err();
    assert_eq!(error.path(), job.options.resources.temp_dir.as_deref());
    job.options.resources.temp_dir = Some(folder.path().into());
    terrane_terrain::convert::run(&job, &Silent, &Cancel::default()).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
