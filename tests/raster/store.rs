//! The store and the job that fills it: what goes in comes out, whatever the type, size, tile,
//! thread count or memory, and a failure leaves nothing behind.

use std::path::Path;

use terrane_base::geom::{Affine, Crs, Rect};
use terrane_base::{Error, ErrorKind, Result};
use terrane_engine::{Cancel, Silent};
use terrane_raster::tiled_tiff::{HeightSlice, TiledTiffWriter};
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource, SampleType};
use terrane_terrain::convert::{ConvertJob, ConvertReport, copy, run};

const TYPES: [SampleType; 9] = [
    SampleType::I8,
    SampleType::U8,
    SampleType::I16,
    SampleType::U16,
    SampleType::I32,
    SampleType::U32,
    SampleType::F16,
    SampleType::F32,
    SampleType::F64,
];

/// A grid in memory, given by its stored values.
struct MemoryGrid {
    info: GridInfo,
    stored: Vec<f64>,
}

impl MemoryGrid {
    /// Values that use the whole range of the type, with a void here and there.
    fn new(sample_type: SampleType, width: u32, height: u32) -> Self {
        let (low, high) = range(sample_type);
        let float = matches!(sample_type, SampleType::F16 | SampleType::F32 | SampleType::F64);
        let nodata = round_to(sample_type, if float { -9999.0 } else { low });
        let value = |k: u64| {
            let t = (k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 11) as f64 / (1_u64 << 53) as f64;
            let value = round_to(sample_type, low + t * (high - low));
            if k % 7 == 3 { nodata } else { value }
        };
        let stored = (0..u64::from(width) * u64::from(height)).map(value).collect();
        Self { info: info(sample_type, width, height, Some(nodata)), stored }
    }

    fn height(&self, col: u32, row: u32) -> f64 {
        let value = self.stored[(row * self.info.width + col) as usize];
        let void = value.is_nan() || Some(value) == self.info.nodata;
        if void { f64::NAN } else { value * self.info.scale + self.info.offset }
    }

    fn window(&self, rect: Rect) -> impl Iterator<Item = f64> {
        let rows = rect.row..rect.end_row();
        rows.flat_map(move |row| (rect.col..rect.end_col()).map(move |col| self.height(col, row)))
    }
}

fn range(sample_type: SampleType) -> (f64, f64) {
    match sample_type {
        SampleType::I8 => (-128.0, 127.0),
        SampleType::U8 => (0.0, 255.0),
        SampleType::I16 => (-32_768.0, 32_767.0),
        SampleType::U16 => (0.0, 65_535.0),
        SampleType::I32 => (-2_147_483_648.0, 2_147_483_647.0),
        SampleType::U32 => (0.0, 4_294_967_295.0),
        _ => (-1000.0, 3000.0),
    }
}

fn round_to(sample_type: SampleType, value: f64) -> f64 {
    match sample_type {
        SampleType::F16 => half::f16::from_f64(value).to_f64(),
        SampleType::F32 => f64::from(value as f32),
        SampleType::F64 => value,
        _ => value.round(),
    }
}

fn info(sample_type: SampleType, width: u32, height: u32, nodata: Option<f64>) -> GridInfo {
    GridInfo {
        transform: Affine { x0: 500_015.1, a: 30.3, b: 0.0, y0: 4_000_000.7, d: 0.0, e: -29.9 },
        georeferenced: true,
        crs: Crs { epsg: Some(32_611), geographic: Some(false), ..Crs::default() },
        nodata,
        ..GridInfo::plain("memory", width, height, sample_type)
    }
}

impl GridSource for MemoryGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        out.iter_mut().zip(self.window(rect)).for_each(|(out, height)| *out = height as f32);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        out.iter_mut().zip(self.window(rect)).for_each(|(out, height)| *out = height);
        Ok(())
    }
}

fn job(output: &Path) -> ConvertJob {
    let mut job = ConvertJob::new("memory", output);
    job.options.file.format = Some("store".to_owned());
    job.options.resources.threads = 2;
    job
}

fn tiles(side: u32) -> Vec<(String, String)> {
    vec![("BLOCKSIZE".to_owned(), side.to_string())]
}

fn convert(grid: &dyn GridSource, job: &ConvertJob) -> Result<ConvertReport> {
    copy(grid, job, &Silent, &Cancel::default())
}

fn open(path: &Path) -> Box<dyn GridSource> {
    let source = raster::open(path.to_str().unwrap(), &GridOpenOptions::default()).unwrap();
    assert_eq!(source.info().format, "terrane store", "mapped, not read by the general reader");
    source
}

fn same(a: f64, b: f64) -> bool {
    a == b || a.is_nan() && b.is_nan()
}

fn assert_same_heights(store: &dyn GridSource, grid: &MemoryGrid, rect: Rect) {
    let (mut narrow, mut wide) = (vec![0.0; rect.len()], vec![0.0; rect.len()]);
    store.read_f32(rect, &mut narrow).unwrap();
    store.read_f64(rect, &mut wide).unwrap();
    for ((narrow, wide), expected) in narrow.iter().zip(&wide).zip(grid.window(rect)) {
        assert!(same(*wide, expected), "{wide} for {expected}");
        assert!(same(f64::from(*narrow), f64::from(expected as f32)), "{narrow} for {expected}");
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn every_type_and_odd_size_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = [(1, 1), (1, 700), (1300, 1), (63, 65), (257, 255), (600, 530)];
    for (sample_type, (width, height)) in TYPES.into_iter().flat_map(|t| sizes.map(|s| (t, s))) {
        let path = folder.path().join(format!("{}_{width}x{height}.tif", sample_type.name()));
        let grid = MemoryGrid::new(sample_type, width, height);
        let report = convert(
            &grid,
            &job(&path).with(|options| {
                options.written.co = tiles(256);
            }),
        )
        .unwrap();
        let store = open(&path);
        let valid = grid.window(grid.info.bounds()).filter(|z| !z.is_nan()).count() as u64;
        assert_eq!((report.samples, report.valid_samples), (grid.stored.len() as u64, valid));
        assert_eq!(report.output_bytes, path.metadata().unwrap().len());
        assert_same_heights(store.as_ref(), &grid, grid.info.bounds());
        let found = store.info();
        assert_eq!((found.width, found.height), (width, height));
        assert_eq!(found.transform, grid.info.transform);
        assert_eq!((found.sample_type, found.nodata), (sample_type, grid.info.nodata));
    }
}

#[test]
fn windows_of_a_store_are_windows_of_the_grid_even_after_release() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let grid = MemoryGrid::new(SampleType::I16, 1111, 777);
    convert(
        &grid,
        &job(&path).with(|options| {
            options.written.co = tiles(256);
        }),
    )
    .unwrap();
    let store = open(&path);
    let windows = [
        [0, 0, 1111, 777],
        [255, 255, 2, 2],
        [256, 0, 256, 256],
        [1110, 776, 1, 1],
        [300, 5, 700, 3],
    ];
    for [col, row, width, height] in windows {
        let rect = Rect::new(col, row, width, height);
        assert_same_heights(store.as_ref(), &grid, rect);
        store.release(rect);
        assert_same_heights(store.as_ref(), &grid, rect);
    }
    for (rect, values) in [(Rect::new(1000, 0, 112, 1), 112), (Rect::new(0, 0, 5, 5), 24)] {
        let refused = store.read_f32(rect, &mut vec![0.0; values]).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::Usage);
    }
}

#[test]
fn scaled_values_are_kept_exactly() {
    let folder = tempfile::tempdir().unwrap();
    for (sample_type, scale, offset) in [
        (SampleType::I32, 0.001, 0.0),
        (SampleType::I16, 0.1, -500.0),
        (SampleType::U8, 12.7, 1e6),
        (SampleType::F32, 0.3048, 0.25),
        (SampleType::F64, 0.3048, -100.0),
    ] {
        let path = folder.path().join(format!("{}.tif", sample_type.name()));
        let mut grid = MemoryGrid::new(sample_type, 130, 70);
        (grid.info.scale, grid.info.offset) = (scale, offset);
        convert(&grid, &job(&path)).unwrap();
        let store = open(&path);
        assert_eq!((store.info().scale, store.info().offset), (scale, offset));
        assert_same_heights(store.as_ref(), &grid, grid.info.bounds());
        assert_stored(&std::fs::read(&path).unwrap(), &grid);
    }
}

/// The stored values themselves are the same, seen without scale and offset, and the rest of the
/// tile is nodata. The one tile is 192 x 128 samples.
fn assert_stored(file: &[u8], grid: &MemoryGrid) {
    let bytes = grid.info.sample_type.bytes();
    let tile = &file[file.len() - 192 * 128 * bytes..];
    let values = tile.chunks(bytes).map(|value| number(grid.info.sample_type, value));
    for (found, k) in values.zip(0..) {
        let (row, col) = (k / 192, k % 192);
        let inside = row < 70 && col < 130;
        let nodata = grid.info.nodata.unwrap();
        let expected = if inside { grid.stored[row * 130 + col] } else { nodata };
        // Where several stored values give one height, a last bit may differ.
        let hair = if bytes == 8 { 1e-12 * expected.abs() } else { 0.0 };
        assert!((found - expected).abs() <= hair, "{found} for {expected} at {col}, {row}");
    }
}

fn number(sample_type: SampleType, bytes: &[u8]) -> f64 {
    match sample_type {
        SampleType::U8 => f64::from(bytes[0]),
        SampleType::I16 => f64::from(i16::from_le_bytes(bytes.try_into().unwrap())),
        SampleType::I32 => f64::from(i32::from_le_bytes(bytes.try_into().unwrap())),
        SampleType::F32 => f64::from(f32::from_le_bytes(bytes.try_into().unwrap())),
        SampleType::F64 => f64::from_le_bytes(bytes.try_into().unwrap()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_bytes_do_not_depend_on_threads_or_memory() {
    let folder = tempfile::tempdir().unwrap();
    let grid = MemoryGrid::new(SampleType::F64, 3000, 700);
    let mut files = Vec::new();
    for (threads, memory) in [(1, 4096), (2, 14), (8, 4096), (3, 26)] {
        let path = folder.path().join(format!("{threads}_{memory}.tif"));
        let mut job = job(&path);
        job.options.resources.threads = threads;
        job.options.resources.memory = memory << 20;
        assert!(convert(&grid, &job).unwrap().run.threads <= threads);
        files.push(std::fs::read(&path).unwrap());
    }
    assert!(files.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn synthetic_terrain_goes_into_a_store_and_a_store_into_itself() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.tif", "b.tif"].map(|name| folder.path().join(name));
    let name = "synth:coast,width=1300,height=700,seed=4";
    let first = ConvertJob { input: name.into(), ..job(&a) };
    let report = run(&first, &Silent, &Cancel::default()).unwrap();
    assert!(report.valid_samples < report.samples && report.crs.contains("EPSG:32631"));
    let second = ConvertJob { input: a.to_str().unwrap().into(), ..job(&b) };
    run(&second, &Silent, &Cancel::default()).unwrap();
    assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
    let source = raster::open(name, &GridOpenOptions::default()).unwrap();
    let rect = source.info().bounds();
    let (mut expected, mut found) = (vec![0.0; rect.len()], vec![0.0; rect.len()]);
    source.read_f64(rect, &mut expected).unwrap();
    open(&b).read_f64(rect, &mut found).unwrap();
    assert!(expected.iter().zip(&found).all(|(a, b)| same(*a, *b)));
}

#[test]
fn what_is_known_of_the_crs_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let raw = Crs {
        epsg: Some(4326),
        vertical_epsg: Some(5773),
        citation: Some("WGS 84 <\"&\n'quoted'> + EGM96".into()),
        wkt: Some("GEOGCS[\"WGS 84\",\r\n  UNIT[\"degree\",0.0174532925199433]]".into()),
        geographic: Some(true),
        vertical_unit: Some("metre".into()),
        vertical_unit_text: Some("m".into()),
        geo_keys: vec![1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2049, 34_737, 7, 0],
        geo_doubles: vec![6_378_137.0, 298.257_223_563],
        geo_ascii: "WGS 84|".into(),
    };
    let by_wkt = Crs { geo_keys: Vec::new(), geo_ascii: String::new(), epsg: None, ..raw.clone() };
    let by_code = Crs { epsg: Some(32_611), ..Crs::default() };
    for (k, crs) in [raw, by_wkt, by_code, Crs::default()].into_iter().enumerate() {
        let path = folder.path().join(format!("{k}.tif"));
        let mut grid = MemoryGrid::new(SampleType::F32, 20, 10);
        grid.info.crs = crs.clone();
        convert(&grid, &job(&path)).unwrap();
        let found = open(&path).info().crs.clone();
        let Crs { geo_keys, geo_doubles, geo_ascii, .. } = found.clone();
        if !crs.geo_keys.is_empty() {
            assert_eq!(found, crs);
        } else {
            assert_eq!(geo_keys.is_empty(), crs.is_unknown());
            assert_eq!(found, Crs { geo_keys, geo_doubles, geo_ascii, ..crs });
        }
    }
}

#[test]
fn pixel_is_point_stays_pixel_is_point_in_the_same_place() {
    let folder = tempfile::tempdir().unwrap();
    let turned = Affine { x0: 0.1, a: 30.7, b: 2.3, y0: 0.7, d: 1.9, e: -30.1 };
    let sources = [
        vec![1, 1, 0, 2, 1024, 0, 1, 1, 1025, 0, 1, 2],
        vec![1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32_611],
        vec![],
    ];
    for (k, keys) in sources.into_iter().enumerate() {
        for (turn, transform) in [None, Some(turned)].into_iter().enumerate() {
            let path = folder.path().join(format!("{k}{turn}.tif"));
            let mut grid = MemoryGrid::new(SampleType::F32, 20, 10);
            grid.info.transform = transform.unwrap_or(grid.info.transform);
            grid.info.pixel_is_point = true;
            grid.info.crs.geo_keys = keys.clone();
            convert(&grid, &job(&path)).unwrap();
            let store = open(&path);
            assert_eq!(store.info().transform, grid.info.transform);
            assert!(store.info().pixel_is_point);
            let keys = &store.info().crs.geo_keys;
            assert_eq!(keys.len(), 4 + 4 * usize::from(keys[3]));
            assert!(keys.chunks(4).skip(1).is_sorted_by_key(|entry| entry[0]), "{keys:?}");
            assert_eq!(keys.chunks(4).filter(|entry| **entry == [1025, 0, 1, 2]).count(), 1);
            // The mark of a store changed: the general reader sees the same place.
            let mut bytes = std::fs::read(&path).unwrap();
            let mark = bytes.windows(13).position(|w| w == b"terrane store").unwrap();
            bytes[mark] = b'T';
            std::fs::write(&path, bytes).unwrap();
            let other = raster::open(path.to_str().unwrap(), &GridOpenOptions::default()).unwrap();
            assert_eq!(other.info().format, "GeoTIFF");
            assert!(other.info().pixel_is_point);
            assert_eq!(other.info().transform, grid.info.transform);
        }
    }
}

#[test]
fn the_vertical_unit_keeps_its_spelling() {
    let folder = tempfile::tempdir().unwrap();
    for (k, (unit, text)) in [("metre", Some("m")), ("foot", None)].into_iter().enumerate() {
        let path = folder.path().join(format!("{k}.tif"));
        let mut grid = MemoryGrid::new(SampleType::I16, 20, 10);
        grid.info.crs.vertical_unit = Some(unit.to_owned());
        grid.info.crs.vertical_unit_text = text.map(str::to_owned);
        convert(&grid, &job(&path)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let written = format!("role=\"unittype\">{}</Item>", text.unwrap_or(unit));
        assert!(bytes.windows(written.len()).any(|w| w == written.as_bytes()), "{written}");
        let crs = open(&path).info().crs.clone();
        let expected = (Some(unit.to_owned()), text.map(str::to_owned));
        assert_eq!((crs.vertical_unit, crs.vertical_unit_text), expected);
    }
}

#[test]
fn rotated_flipped_and_placeless_grids_keep_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let turned = Affine { x0: 0.1, a: 30.7, b: 2.3, y0: 0.7, d: 1.9, e: -30.1 };
    let south_up = Affine { x0: 5.3, a: 0.1, b: 0.0, y0: 41.0 / 3.0, d: 0.0, e: 0.1 };
    for (k, transform) in [turned, south_up, Affine::LATTICE].into_iter().enumerate() {
        let path = folder.path().join(format!("{k}.tif"));
        let mut grid = MemoryGrid::new(SampleType::U16, 33, 12);
        (grid.info.transform, grid.info.georeferenced) = (transform, k < 2);
        convert(&grid, &job(&path)).unwrap();
        let store = open(&path);
        assert_eq!((store.info().transform, store.info().georeferenced), (transform, k < 2));
    }
}

#[test]
fn a_box_keeps_the_cells_it_overlaps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let grid = MemoryGrid::new(SampleType::I16, 100, 80);
    let place = |col: f64, row: f64| grid.info.transform.apply(col, row);
    let ([x0, y1], [x1, y0]) = (place(10.0, 20.0), place(40.4, 33.9));
    let whole = folder.path().join("whole.tif");
    convert(&grid, &job(&whole)).unwrap();
    let part = |bbox| {
        let options = GridOpenOptions { bbox: Some(bbox), ..GridOpenOptions::default() };
        raster::open_all(&[whole.display().to_string()], &options)
    };
    convert(&*part([x0, y0, x1, y1]).unwrap(), &job(&path)).unwrap();
    let store = open(&path);
    assert_eq!((store.info().width, store.info().height), (31, 15));
    assert_eq!(store.info().transform, grid.info.transform.shifted(10.0, 20.0));
    let mut found = vec![0.0; 31 * 15];
    store.read_f64(store.info().bounds(), &mut found).unwrap();
    let expected = grid.window(Rect::new(10, 20, 31, 15));
    assert!(found.iter().zip(expected).all(|(a, b)| same(*a, b)));
    for bbox in [[0.0, 0.0, 1.0, 1.0], [x1, y0, x0, y1], [f64::NAN; 4]] {
        let error = part(bbox).err().unwrap();
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("y max within"), "{error}");
    }
}

/// Fails, or cancels the job, when a certain sample is read.
struct Faulty<'a> {
    grid: MemoryGrid,
    cancel: Option<&'a Cancel>,
}

impl GridSource for Faulty<'_> {
    fn info(&self) -> &GridInfo {
        self.grid.info()
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        match self.cancel {
            Some(cancel) => cancel.cancel(),
            None if rect.contains(700, 300) => return Err(Error::bad_input("block is truncated")),
            None => (),
        }
        self.grid.read_f32(rect, out)
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.grid.read_f64(rect, out)
    }
}

#[test]
fn failure_cancel_and_drop_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let cancel = Cancel::default();
    for (flag, kind) in [(None, ErrorKind::BadInput), (Some(&cancel), ErrorKind::Interrupted)] {
        let faulty = Faulty { grid: MemoryGrid::new(SampleType::F32, 900, 600), cancel: flag };
        let error = copy(&faulty, &job(&path), &Silent, &cancel).unwrap_err();
        assert_eq!((error.kind(), names(folder.path()).len()), (kind, 0), "{error}");
    }
    let grid = MemoryGrid::new(SampleType::F32, 900, 600);
    let writer = TiledTiffWriter::create(&path, &grid.info, 512, false).unwrap();
    drop(writer);
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn voids_without_a_value_for_them_are_refused_with_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let mut grid = MemoryGrid::new(SampleType::I16, 700, 300);
    grid.stored.fill(5.0);
    grid.stored[299 * 700 + 650] = f64::NAN;
    grid.info.nodata = None;
    let error = convert(&grid, &job(&path)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::BadInput);
    let text = error.to_string();
    assert!(text.contains("column 650, row 299") && text.contains("‹nodata›"), "{text}");
    // Floats have NaN for it.
    grid.info.sample_type = SampleType::F32;
    convert(&grid, &job(&path)).unwrap();
    assert_same_heights(open(&path).as_ref(), &grid, grid.info.bounds());
}

#[test]
fn a_height_that_would_become_a_void_or_another_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let info = info(SampleType::U8, 3, 1, Some(255.0));
    for bad in [255.0, 256.0, -1.0, 0.5, f64::INFINITY] {
        let writer = TiledTiffWriter::create(&path, &info, 256, false).unwrap();
        let rect = Rect::new(0, 0, 3, 1);
        let heights = [1.0, bad, f64::NAN];
        let error = writer.write(rect, HeightSlice::F64(&heights), &mut Vec::new()).unwrap_err();
        assert!(error.to_string().contains("column 1, row 0"), "{error}");
    }
}

#[test]
fn a_writer_refuses_what_is_not_part_of_a_tile_and_an_unfinished_store() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let info = info(SampleType::F32, 600, 300, None);
    let writer = TiledTiffWriter::create(&path, &info, 256, false).unwrap();
    let bad = [[0, 0, 255, 1], [1, 0, 256, 1], [0, 255, 256, 2], [768, 0, 88, 1], [0, 0, 256, 0]];
    for [col, row, width, height] in bad {
        let rect = Rect::new(col, row, width, height);
        let heights = vec![1.0; rect.len()];
        let error = writer.write(rect, HeightSlice::F32(&heights), &mut Vec::new()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
    }
    assert_eq!(writer.finish().unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn an_existing_output_stays_unless_told_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    std::fs::write(&path, b"mine").unwrap();
    let first = ConvertJob { input: "synth:rough,size=20".into(), ..job(&path) };
    let error = run(&first, &Silent, &Cancel::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    run(
        &first.with(|options| {
            options.file.replacing.overwrite = true;
        }),
        &Silent,
        &Cancel::default(),
    )
    .unwrap();
    assert_eq!(open(&path).info().width, 20);
}

/// More bytes than any disk has: refused before the work, and nothing is left.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_found_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let info = info(SampleType::F64, 1 << 23, 1 << 23, None);
    let error = TiledTiffWriter::create(&path, &info, 1024, false).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Io, "{error}");
    assert!(error.to_string().contains("free some space"), "{error}");
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn impossible_jobs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let grid = MemoryGrid::new(SampleType::F32, 20, 20);
    let error = convert(
        &grid,
        &job(&path).with(|options| {
            options.written.co = tiles(300);
        }),
    )
    .unwrap_err();
    assert!(error.to_string().contains("256|512|1024"), "{error}");
    let mut starved = job(&path);
    starved.options.resources.memory = 1 << 20;
    let error = convert(&grid, &starved).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Resource);
    assert!(error.to_string().contains("‹memory›"), "{error}");
    let mut adrift = MemoryGrid::new(SampleType::F32, 20, 20);
    adrift.info.transform.a = f64::NAN;
    assert_eq!(convert(&adrift, &job(&path)).unwrap_err().kind(), ErrorKind::BadInput);
    let input = ConvertJob { input: "synth:ruogh".into(), ..job(&path) };
    assert_eq!(run(&input, &Silent, &Cancel::default()).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(names(folder.path()), Vec::<String>::new());
}
