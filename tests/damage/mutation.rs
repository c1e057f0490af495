//! Damaged files of every format, by the thousand: an answer or an error, soon and in bounded memory,
//! never a panic. `TERRANE_MUTATIONS=100000` does as many of each format as that.

use std::path::Path;

use crate::data;
use crate::raster_support::formats::{self, Sample};
use crate::raster_support::hostile::{MAX_MEMORY, Random, guarded, mutate};
use crate::raster_support::tiff_builder::{Spec, Value};
use crate::raster_support::write_anew;
use terrane_raster::FORMATS;

/// Real files up to this long are damaged too.
const MAX_BYTES: u64 = 200_000;
/// A tile of the shortest kind.
const TILE: (usize, usize) = (601, 1201);

/// Sound files of one grid, one of which is to be damaged.
#[derive(Clone)]
struct Seed {
    /// Names and contents; the first is the file to open.
    files: Vec<(String, Vec<u8>)>,
    /// Which is damaged.
    damaged: usize,
    /// False for real files, some of which are refused as they are.
    sound: bool,
}

impl Seed {
    fn new(name: &str, bytes: Vec<u8>) -> Self {
        Self { files: vec![(name.to_owned(), bytes)], damaged: 0, sound: true }
    }

    /// As [`new`](Self::new), but to be found beside `opened`.
    fn beside(opened: (&str, Vec<u8>), name: &str, bytes: Vec<u8>) -> Self {
        let files = vec![(opened.0.to_owned(), opened.1), (name.to_owned(), bytes)];
        Self { files, damaged: 1, sound: true }
    }

    fn name(&self) -> &str {
        &self.files[self.damaged].0
    }
}

/// Builds the undamaged files of a format.
type Seeds = fn() -> Vec<Seed>;

/// The formats, how their files are built, and how many mutations are done every day.
const GROUPS: &[(&str, Seeds, usize)] = &[
    ("GeoTIFF", tiffs, 2000),
    ("SRTM HGT", tiles, 20),
    ("ESRI ASCII", texts, 2000),
    ("raw with header", || built(&[".bil", ".flt", ".dat"]), 700),
    ("PNG", || built(&[".png"]), 700),
    ("DTED", || built(&[".dt0"]), 700),
    ("USGS DEM", || built(&[".dem"]), 700),
    ("XYZ", || built(&[".xyz", ".csv"]), 700),
    ("NumPy", || built(&[".npy"]), 700),
    ("gzip", || built(&[".gz"]), 500),
    ("zip", zips, 300),
    ("VRT", vrts, 500),
];

/// The built files of these endings; of several that belong together each is damaged in turn.
fn built(endings: &[&str]) -> Vec<Seed> {
    let is_wanted =
        |sample: &Sample| endings.iter().any(|ending| sample.files[0].0.ends_with(ending));
    let seeds = formats::samples().into_iter().filter(is_wanted).flat_map(|sample| {
        let files: Vec<_> =
            sample.files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect();
        (0..files.len()).map(move |damaged| Seed { files: files.clone(), damaged, sound: true })
    });
    seeds.collect()
}

fn ramp(col: usize, row: usize, band: usize) -> f64 {
    (col + 3 * row + 5 * band) as f64
}

fn mask(bits: usize, compression: u16) -> Spec {
    let mut spec = Spec::new(20, 18, 1, bits);
    spec.compression = compression;
    spec.extra = vec![(254, Value::Short(vec![4]))];
    spec
}

fn facts() -> Vec<(u16, Value)> {
    let keys = vec![1, 1, 0, 2, 1024, 0, 1, 1, 1026, 34737, 4, 0];
    let items = r#"<Item name="S" sample="0" role="scale">0.5</Item>"#;
    vec![
        (33550, Value::Double(vec![1.0, 1.0, 0.0])),
        (33922, Value::Double(vec![0.0; 6])),
        (34735, Value::Short(keys)),
        (34737, Value::Text("abc|".to_owned())),
        (42112, Value::Text(items.to_owned())),
        (42113, Value::Text("-9999".to_owned())),
    ]
}

/// TIFFs of every compression, with an internal mask or an alpha band, and a mask beside one.
fn tiffs() -> Vec<Seed> {
    let mut seeds = Vec::new();
    for compression in [1, 5, 8, 32773, 50000] {
        for (format, bits, predictor, tiled) in [(2, 16, 2, true), (3, 32, 3, false)] {
            let mut spec = Spec::new(20, 18, format, bits);
            (spec.compression, spec.predictor) = (compression, predictor);
            spec.tile = tiled.then_some((16, 16));
            (spec.bands, spec.separate) = (if tiled { 1 } else { 2 }, compression == 8);
            spec.extra = facts();
            if !tiled {
                spec.extra.push((338, Value::Short(vec![2])));
            }
            let mut bytes = spec.build(ramp);
            if tiled {
                mask(1, compression).append(&mut bytes, &ramp);
            }
            seeds.push(Seed::new("m.tif", bytes));
            (spec.big_tiff, spec.big_endian) = (true, !tiled);
            seeds.push(Seed::new("b.tif", spec.build(ramp)));
        }
    }
    let grid = Spec::new(20, 18, 2, 16).build(ramp);
    seeds.push(Seed::beside(("k.tif", grid), "k.tif.msk", mask(8, 8).build(ramp)));
    seeds.extend(real(&["dem/formats"], ".tif"));
    seeds
}

fn tile() -> Vec<u8> {
    let sample = |i: usize| if i == 5 { i16::MIN } else { (i % 200) as i16 - 100 };
    (0..TILE.0 * TILE.1).flat_map(|i| sample(i).to_be_bytes()).collect()
}

/// Only the length of a plain tile can be wrong.
fn tiles() -> Vec<Seed> {
    vec![Seed::new("S02W010.hgt", tile())]
}

/// A virtual raster with a simple and a complex source, damaged itself; its file is sound.
fn vrts() -> Vec<Seed> {
    let source = |kind: &str, column: u32, more: &str| {
        format!(
            r#"<{kind}><SourceFilename relativeToVRT="1">v.tif</SourceFilename>
            <SourceBand>1</SourceBand><SrcRect xOff="0" yOff="0" xSize="20" ySize="18"/>
            <DstRect xOff="{column}" yOff="0" xSize="20" ySize="18"/>{more}</{kind}>"#
        )
    };
    let simple = source("SimpleSource", 0, "");
    let more = "<ScaleOffset>1</ScaleOffset><ScaleRatio>2</ScaleRatio><NODATA>7</NODATA>";
    let complex = source("ComplexSource", 15, more);
    let text = format!(
        r#"<VRTDataset rasterXSize="35" rasterYSize="18"><SRS>EPSG:32631</SRS>
        <GeoTransform>0, 1, 0, 18, 0, -1</GeoTransform><VRTRasterBand dataType="Float32" band="1">
        <NoDataValue>-9999</NoDataValue>{simple}{complex}</VRTRasterBand></VRTDataset>"#
    );
    let grid = Spec::new(20, 18, 2, 16).build(ramp);
    let files = vec![("m.vrt".to_owned(), text.into_bytes()), ("v.tif".to_owned(), grid)];
    vec![Seed { files, damaged: 0, sound: true }]
}

/// Small archives, and one in eight of a whole tile.
fn zips() -> Vec<Seed> {
    let tile = Seed::new("z.hgt.zip", formats::zip(&[("S02W010.hgt", &tile())]));
    let small = built(&[".zip"]);
    small.into_iter().cycle().take(7).chain([tile]).collect()
}

fn texts() -> Vec<Seed> {
    let header = "ncols 4\nnrows 3\nxllcorner 1\nyllcorner 2\ncellsize 0.5\nNODATA_value -9\n";
    let centre = "NROWS 2\nNCOLS 3\nXLLCENTER 1e2\nYLLCENTER -2\nDX 0.5\nDY 1\n";
    let values = "1 2 3 4\n5 6 7 8.5\n-9 nan 1e3 ,5\n";
    let mut seeds = vec![
        Seed::new("m.asc", format!("{header}{values}").into_bytes()),
        Seed::new("c.asc", format!("{centre}1 2 3\r\n4 5 6").into_bytes()),
    ];
    let prj = br#"PROJCS["x",GEOGCS["y",UNIT["Degree",0.017]],AUTHORITY["EPSG","32611"]]"#;
    let grid = ("p.asc", seeds[0].files[0].1.clone());
    seeds.push(Seed::beside(grid, "p.prj", prj.to_vec()));
    seeds.extend(real(&["dem/formats"], ".asc"));
    seeds
}

/// The small real files, where the environment names their folder.
fn real(folders: &[&str], ending: &str) -> Vec<Seed> {
    let Some(data) = data::at_hand() else { return Vec::new() };
    let mut seeds = Vec::new();
    for folder in folders {
        for entry in std::fs::read_dir(data.join(folder)).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.ends_with(ending) && entry.metadata().unwrap().len() <= MAX_BYTES {
                let bytes = std::fs::read(entry.path()).unwrap();
                seeds.push(Seed { sound: false, ..Seed::new(&name, bytes) });
            }
        }
    }
    seeds.sort_by(|a, b| a.files[0].0.cmp(&b.files[0].0));
    seeds
}

/// How many mutations of a format: those asked for, or enough for everyday.
fn count(everyday: usize) -> usize {
    let asked = std::env::var("TERRANE_MUTATIONS").ok();
    asked.map_or(everyday, |count| count.parse().expect("TERRANE_MUTATIONS is a number"))
}

/// Damages the files of the format `name` in turn.
fn damage(name: &str) {
    let (_, seeds, everyday) = GROUPS.iter().find(|group| group.0 == name).unwrap();
    let (seeds, count) = (seeds(), count(*everyday));
    let folder = tempfile::tempdir().unwrap();
    let mut read = 0;
    for number in 0..count {
        let mut seed = seeds[number % seeds.len()].clone();
        mutate(&mut seed.files[seed.damaged].1, &mut Random::of(number));
        match attempt(folder.path(), &seed) {
            Ok(is_read) => read += usize::from(is_read),
            Err(why) => {
                let bytes = shown(&seed.files[seed.damaged].1);
                panic!("mutation {number} of {}: {why}\n{bytes:?}", seed.name())
            }
        }
    }
    println!("{name}: {count} mutations, {read} read, {} refused", count - read);
    assert!(read < count, "all {count} read: nothing was damaged");
    assert!(terrane_engine::peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY));
}

/// True when the grid was read, false when it was refused in one line.
fn attempt(folder: &Path, seed: &Seed) -> Result<bool, String> {
    let paths: Vec<_> = seed.files.iter().map(|(name, _)| folder.join(name)).collect();
    for (path, (_, bytes)) in paths.iter().zip(&seed.files) {
        write_anew(path, bytes);
    }
    let outcome = guarded(&paths[0]);
    for path in &paths {
        std::fs::remove_file(path).unwrap();
    }
    match outcome? {
        Ok(_) => Ok(true),
        Err(error) if error.to_string().contains('\n') => Err(format!("many lines: {error}")),
        Err(_) => Ok(false),
    }
}

fn shown(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.len().min(8192)]
}

#[test]
fn every_format_is_damaged_and_every_seed_is_sound_before() {
    assert!(GROUPS.iter().map(|group| group.0).eq(FORMATS.iter().map(|format| format.name)));
    let folder = tempfile::tempdir().unwrap();
    for (name, seeds, _) in GROUPS {
        let seeds = seeds();
        assert!(!seeds.is_empty(), "{name}");
        for seed in seeds {
            let outcome = attempt(folder.path(), &seed);
            assert!(outcome == Ok(true) || !seed.sound, "{name}, {}: {outcome:?}", seed.name());
        }
    }
}

/// Formats whose fuzz target takes the text file beside a grid from the bytes before the first zero.
const PAIRS: [&str; 5] = ["asc", "bil", "flt", "dat", "png"];

/// Writes the undamaged files for the fuzz targets, by ending; see tools/fuzz/README.md.
#[test]
#[ignore = "writes into tools/fuzz/corpus"]
fn write_seeds() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/fuzz/corpus");
    let seeds = GROUPS.iter().flat_map(|(_, seeds, _)| seeds());
    for (number, seed) in seeds.enumerate() {
        let (name, grid) = &seed.files[0];
        let ending = name.rsplit('.').next().unwrap();
        let bytes = match &seed.files[1..] {
            [] if PAIRS.contains(&ending) => [&[0], &grid[..]].concat(),
            [] => grid.clone(),
            // The text comes first, whichever of the two is opened.
            [(_, beside)] if ending == "vrt" => [grid, &[0][..], beside].concat(),
            [(_, text)] if PAIRS.contains(&ending) => [text, &[0][..], grid].concat(),
            _ => continue,
        };
        let folder = corpus.join(ending);
        std::fs::create_dir_all(&folder).unwrap();
        write_anew(&folder.join(format!("seed-{number}")), &bytes);
    }
}

/// A test for each format, so that they run side by side.
macro_rules! damaged {
    ($($test:ident: $name:literal;)*) => {$(
        #[test]
        fn $test() {
            damage($name);
        }
    )*};
}

damaged! {
    geotiff: "GeoTIFF";
    hgt: "SRTM HGT";
    asc: "ESRI ASCII";
    raw: "raw with header";
    png: "PNG";
    dted: "DTED";
    usgs: "USGS DEM";
    xyz: "XYZ";
    npy: "NumPy";
    gzip: "gzip";
    zip: "zip";
    vrt: "VRT";
}
