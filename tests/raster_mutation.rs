//! Damaged files of every format, by the thousand: a right answer or an error, soon and in bounded
//! memory, never a panic. `TERRANE_MUTATIONS=100000` does as many of each format as that.

mod raster_support;

use std::io::Write;
use std::path::Path;

use raster_support::hostile::{MOST_MEMORY, Random, guarded, mutate};
use raster_support::tiff_builder::{Spec, Value};
use raster_support::{data_folder, write_anew};

/// Real files up to this long are damaged too.
const MOST_BYTES: u64 = 200_000;
/// A tile of the shortest kind.
const TILE: (usize, usize) = (601, 1201);

/// A sound file: its name and bytes, and the name of the file to open where that is another.
#[derive(Clone)]
struct Seed {
    name: String,
    bytes: Vec<u8>,
    beside: Option<(String, Vec<u8>)>,
}

impl Seed {
    fn new(name: &str, bytes: Vec<u8>) -> Self {
        Self { name: name.to_owned(), bytes, beside: None }
    }
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
    let beside = Some(("k.tif".to_owned(), grid));
    seeds.push(Seed { beside, ..Seed::new("k.tif.msk", mask(8, 8).build(ramp)) });
    seeds.extend(real(&["dem/formats"], ".tif"));
    seeds
}

fn tile() -> Vec<u8> {
    let sample = |i: usize| if i == 5 { i16::MIN } else { (i % 200) as i16 - 100 };
    (0..TILE.0 * TILE.1).flat_map(|i| sample(i).to_be_bytes()).collect()
}

fn zipped_tiles() -> Vec<Seed> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    zip.start_file("S02W010.hgt", zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(&tile()).unwrap();
    let mut seeds = vec![Seed::new("z.hgt.zip", zip.finish().unwrap().into_inner())];
    seeds.extend(real(&["dem"], ".hgt.zip"));
    seeds
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
    let beside = Some(("p.asc".to_owned(), seeds[0].bytes.clone()));
    seeds.push(Seed { beside, ..Seed::new("p.prj", prj.to_vec()) });
    seeds.extend(real(&["dem/formats"], ".asc"));
    seeds
}

/// The small real files, where they are at hand.
fn real(folders: &[&str], ending: &str) -> Vec<Seed> {
    let Some(data) = data_folder() else { return Vec::new() };
    let mut seeds = Vec::new();
    for folder in folders {
        for entry in std::fs::read_dir(data.join(folder)).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.ends_with(ending) && entry.metadata().unwrap().len() <= MOST_BYTES {
                seeds.push(Seed::new(&name, std::fs::read(entry.path()).unwrap()));
            }
        }
    }
    seeds.sort_by(|a, b| a.name.cmp(&b.name));
    seeds
}

/// How many mutations of a format: those asked for, or enough for everyday.
fn count(everyday: usize) -> usize {
    let asked = std::env::var("TERRANE_MUTATIONS").ok();
    asked.map_or(everyday, |count| count.parse().expect("TERRANE_MUTATIONS is a number"))
}

/// Damages each of `seeds` in turn, `count` times in all.
fn run(seeds: &[Seed], count: usize) {
    let folder = tempfile::tempdir().unwrap();
    let mut read = 0;
    for number in 0..count {
        let seed = &seeds[number % seeds.len()];
        let mut bytes = seed.bytes.clone();
        mutate(&mut bytes, &mut Random::of(number));
        match attempt(folder.path(), seed, &bytes) {
            Ok(is_read) => read += usize::from(is_read),
            Err(why) => panic!("mutation {number} of {}: {why}\n{:?}", seed.name, shown(&bytes)),
        }
    }
    println!("{count} mutations: {read} read, {} refused", count - read);
    assert!(read < count, "all {count} read: nothing was damaged");
    assert!(terrane::pipeline::peak_memory().is_none_or(|bytes| bytes < MOST_MEMORY));
}

/// True when the file was read, false when it was refused in one line.
fn attempt(folder: &Path, seed: &Seed, bytes: &[u8]) -> Result<bool, String> {
    let path = folder.join(&seed.name);
    write_anew(&path, bytes);
    let opened = seed.beside.as_ref().map(|(name, bytes)| {
        write_anew(&folder.join(name), bytes);
        folder.join(name)
    });
    let outcome = guarded(opened.as_ref().unwrap_or(&path));
    for path in opened.iter().chain([&path]) {
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
fn every_seed_is_sound_before_it_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let built = [tiffs(), texts(), zipped_tiles(), vec![Seed::new("S02W010.hgt", tile())]];
    for seed in built.concat() {
        let outcome = attempt(folder.path(), &seed, &seed.bytes);
        let built_here = seed.name.split('.').next().is_some_and(|stem| stem.len() == 1);
        assert!(outcome == Ok(true) || !built_here, "{}: {outcome:?}", seed.name);
    }
}

#[test]
fn damaged_tiffs() {
    run(&tiffs(), count(4000));
}

#[test]
fn damaged_texts() {
    run(&texts(), count(4000));
}

#[test]
fn damaged_zipped_tiles() {
    run(&zipped_tiles(), count(200));
}

/// Only the length of a plain tile can be wrong.
#[test]
fn damaged_tiles() {
    run(&[Seed::new("S02W010.hgt", tile())], count(60));
}
