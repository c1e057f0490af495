//! What lies beside a grid and changes what is read of it: GDAL's `.aux.xml`, world files of TIFFs.
//! The expected values are those of GDAL 3.10 for the same files.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::raster_support::tiff_builder::{Spec, Value};
use crate::raster_support::{self, open_band, read_all, read_in_windows, same};
use terrane::ErrorKind;
use terrane_engine::{Cancel, Silent};
use terrane_raster::{GridOpenOptions, open, open_all};
use terrane_terrain::convert::{self, ConvertJob};

const WIDTH: usize = 4;
const HEIGHT: usize = 3;

/// Says something else than any of the files beside it.
const PAM: &str = r#"<PAMDataset><SRS>EPSG:25832</SRS><GeoTransform>1, 2, 0, 9, 0, -2</GeoTransform>
  <Metadata><MDI key="AREA_OR_POINT">Point</MDI></Metadata>
  <PAMRasterBand band="1"><NoDataValue>5</NoDataValue><Scale>0.5</Scale><Offset>100</Offset>
  <UnitType>ft</UnitType><Histograms><HistItem/></Histograms></PAMRasterBand></PAMDataset>"#;

fn ramp(col: usize, row: usize, band: usize) -> f64 {
    (col + WIDTH * row + 100 * band) as f64
}

fn tiff(extra: Vec<(u16, Value)>) -> Vec<u8> {
    let mut spec = Spec::new(WIDTH, HEIGHT, 2, 16);
    spec.extra = extra;
    spec.build(ramp)
}

/// EPSG:32611, at 500000 4100000, cells of 10, nodata 3.
fn placed_tiff() -> Vec<u8> {
    tiff(vec![
        (33550, Value::Double(vec![10.0, 10.0, 0.0])),
        (33922, Value::Double(vec![0.0, 0.0, 0.0, 500_000.0, 4_100_000.0, 0.0])),
        (34735, Value::Short(vec![1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32611])),
        (42113, Value::Text("3".to_owned())),
    ])
}

fn text_grid(head: &str) -> Vec<u8> {
    let rows = (0..HEIGHT).map(|row| {
        let row: Vec<String> = (0..WIDTH).map(|col| ramp(col, row, 0).to_string()).collect();
        row.join(" ") + "\n"
    });
    (head.to_owned() + &rows.collect::<String>()).into_bytes()
}

fn raw() -> Vec<u8> {
    let samples = (0..WIDTH * HEIGHT).map(|i| ramp(i % WIDTH, i / WIDTH, 0) as i16);
    samples.flat_map(i16::to_le_bytes).collect()
}

fn points() -> Vec<u8> {
    let points = (0..WIDTH * HEIGHT).map(|i| {
        let (col, row) = (i % WIDTH, i / WIDTH);
        format!("{} {} {}\n", 500_005 + 10 * col, 4_099_995 - 10 * row, ramp(col, row, 0))
    });
    points.collect::<String>().into_bytes()
}

fn picture() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, WIDTH as u32, HEIGHT as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let samples: Vec<u8> =
        (0..WIDTH * HEIGHT).map(|i| ramp(i % WIDTH, i / WIDTH, 0) as u8).collect();
    encoder.write_header().unwrap().write_image_data(&samples).unwrap();
    bytes
}

/// A file, those beside it, and what is read of it beside [`PAM`].
struct Case {
    name: &'static str,
    bytes: Vec<u8>,
    beside: Vec<(&'static str, &'static str)>,
    /// West, cell and north; `None` where it is not placed.
    place: Option<[f64; 3]>,
    epsg: Option<u32>,
    nodata: Option<f64>,
}

const HERE: Option<[f64; 3]> = Some([500_000.0, 10.0, 4_100_000.0]);
const THERE: Option<[f64; 3]> = Some([1.0, 2.0, 9.0]);

fn cases() -> Vec<Case> {
    let case = |name, bytes, beside, place, epsg, nodata| Case {
        name,
        bytes,
        beside,
        place,
        epsg,
        nodata,
    };
    let size = "ncols 4\nnrows 3\n";
    let asc = format!("{size}xllcorner 500000\nyllcorner 4099970\ncellsize 10\nNODATA_value 3\n");
    let esri = "ncols 4\nnrows 3\nnbits 16\npixeltype signedint\nbyteorder I\n";
    let placed = "ncols 4\nnrows 3\nnbits 16\npixeltype signedint\nbyteorder I\n\
        ulxmap 500005\nulymap 4099995\nxdim 10\nydim 10\nnodata 3\n";
    let envi = "ENVI\nsamples=4\nlines=3\nbands=1\ndata type=2\ninterleave=bsq\nbyte order=0\n\
        header offset=0\n";
    vec![
        case("own.tif", placed_tiff(), vec![], THERE, Some(25832), Some(5.0)),
        case("bare.tif", tiff(vec![]), vec![], THERE, Some(25832), Some(5.0)),
        case("own.asc", text_grid(&asc), vec![], HERE, None, Some(3.0)),
        case("bare.bil", raw(), vec![("bare.hdr", esri)], THERE, Some(25832), Some(5.0)),
        case("own.bil", raw(), vec![("own.hdr", placed)], HERE, Some(25832), Some(5.0)),
        case("e.img", raw(), vec![("e.hdr", envi)], None, None, Some(5.0)),
        case("own.xyz", points(), vec![], HERE, Some(25832), Some(5.0)),
        case("bare.png", picture(), vec![], THERE, Some(25832), Some(5.0)),
        case(
            "own.png",
            picture(),
            vec![("own.pgw", "10\n0\n0\n-10\n500005\n4099995\n")],
            HERE,
            Some(25832),
            Some(5.0),
        ),
    ]
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    raster_support::write_anew(&path, bytes);
    path
}

fn refusal(path: &Path) -> String {
    open_band(path, 1).err().expect("a refusal").to_string()
}

#[test]
fn a_sidecar_is_believed_as_gdal_believes_it() {
    let folder = tempfile::tempdir().unwrap();
    for case in cases() {
        let path = put(folder.path(), case.name, &case.bytes);
        for (name, text) in &case.beside {
            put(folder.path(), name, text.as_bytes());
        }
        put(folder.path(), &format!("{}.aux.xml", case.name), PAM.as_bytes());
        let grid = open_band(&path, 1).unwrap_or_else(|e| panic!("{}: {e}", case.name));
        let info = grid.info();
        let [west, cell, _, north, ..] = info.transform.to_gdal();
        assert_eq!(info.georeferenced.then_some([west, cell, north]), case.place, "{}", case.name);
        assert_eq!((info.crs.epsg, info.nodata), (case.epsg, case.nodata), "{}", case.name);
        assert_eq!((info.scale, info.offset), (0.5, 100.0), "{}", case.name);
        assert_eq!(info.crs.vertical_unit.as_deref(), Some("foot"), "{}", case.name);
        assert!(!info.exact_in_f32());
        let narrow = read_in_windows(grid.as_ref(), 2).unwrap();
        for (i, (wide, narrow)) in read_all(grid.as_ref()).unwrap().iter().zip(narrow).enumerate() {
            let stored = ramp(i % WIDTH, i / WIDTH, 0);
            let is_void = Some(stored) == case.nodata;
            let height = if is_void { f64::NAN } else { stored * 0.5 + 100.0 };
            assert!(same(*wide, height) && same(narrow.into(), height), "{} {i}", case.name);
        }
        let mine = open(
            path.to_str().unwrap(),
            &GridOpenOptions { nodata: Some(7.0), ..GridOpenOptions::default() },
        );
        assert_eq!(mine.unwrap().info().nodata, Some(7.0), "the user is believed before both");
    }
}

#[test]
fn a_sidecar_of_statistics_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = put(folder.path(), "a.tif", &placed_tiff());
    let plain = open_band(&path, 1).unwrap().info().clone();
    let statistics = "<PAMDataset><PAMRasterBand band=\"1\"><Metadata><MDI key=\"STATISTICS_MINIMUM\">\
        0</MDI></Metadata></PAMRasterBand><PAMRasterBand band=\"2\"><NoDataValue>8</NoDataValue>\
        </PAMRasterBand></PAMDataset>";
    put(folder.path(), "a.tif.aux.xml", statistics.as_bytes());
    let mut beside = open_band(&path, 1).unwrap().info().clone();
    beside.details.retain(|(name, _)| name != "sidecar");
    assert_eq!(beside, plain);
    assert!(read_all(open_band(&path, 1).unwrap().as_ref()).unwrap()[3].is_nan());
}

#[test]
fn damaged_and_contradicting_sidecars_are_told_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = put(folder.path(), "a.tif", &placed_tiff());
    for (text, said) in [
        ("<PAMDataset><PAMRasterBand", "not well-formed XML"),
        ("<!DOCTYPE x [<!ENTITY a 'b'>]><PAMDataset/>", "document type"),
        ("<PAMDataset><GeoTransform>1,2,3</GeoTransform></PAMDataset>", "not six numbers"),
        ("", "empty"),
    ] {
        put(folder.path(), "a.tif.aux.xml", text.as_bytes());
        let told = refusal(&path);
        assert!(told.contains("a.tif.aux.xml") && told.contains(said), "{told}");
    }
    let xml =
        "<GDALMetadata><Item name=\"SCALE\" sample=\"0\" role=\"scale\">2</Item></GDALMetadata>";
    let scaled = put(folder.path(), "b.tif", &tiff(vec![(42112, Value::Text(xml.to_owned()))]));
    put(folder.path(), "b.tif.aux.xml", PAM.as_bytes());
    let told = refusal(&scaled);
    assert!(told.contains("scale 0.5 and offset 100 differ from 2 and 0"), "{told}");
}

#[test]
fn a_world_file_places_a_tiff_that_does_not_say_where_it_lies() {
    let folder = tempfile::tempdir().unwrap();
    let world = b"2\n0\n0\n-2\n1\n9\n";
    for (name, beside) in [("a.tif", "a.tfw"), ("b.tiff", "b.TFW"), ("c.tif", "c.wld")] {
        let path = put(folder.path(), name, &tiff(vec![]));
        put(folder.path(), beside, world);
        let info = open_band(&path, 1).unwrap().info().clone();
        assert!(info.georeferenced);
        assert_eq!(info.transform.to_gdal(), [0.0, 2.0, 0.0, 10.0, 0.0, -2.0], "{name}");
    }
    let path = put(folder.path(), "d.tif", &placed_tiff());
    put(folder.path(), "d.tfw", world);
    assert_eq!(open_band(&path, 1).unwrap().info().transform.to_gdal()[0], 500_000.0);
    let points: Vec<f64> =
        [[0.0, 0.0, 0.0, 5.0, 6.0, 0.0], [1.0, 1.0, 0.0, 7.0, 8.0, 0.0]].concat();
    let tied = put(folder.path(), "e.tif", &tiff(vec![(33922, Value::Double(points))]));
    assert!(!open_band(&tied, 1).unwrap().info().georeferenced);
    put(folder.path(), "e.tfw", world);
    assert!(open_band(&tied, 1).unwrap().info().georeferenced);
}

#[test]
fn an_old_sidecar_is_not_left_beside_a_new_file() {
    let folder = tempfile::tempdir().unwrap();
    let input = put(folder.path(), "in.tif", &placed_tiff());
    for (name, format) in [("a.tif", None), ("b.tif", Some("COG")), ("c.asc", None)] {
        let sidecar = put(folder.path(), &format!("{name}.aux.xml"), PAM.as_bytes());
        let output = folder.path().join(name);
        let mut job = ConvertJob::new(input.to_str().unwrap(), &output);
        job.options.file.format = format.map(str::to_owned);
        let error = convert::run(&job, &Silent, &Cancel::default()).unwrap_err();
        assert_eq!((error.kind(), error.path()), (ErrorKind::CannotWrite, Some(&*sidecar)));
        assert!(!output.exists());
        put(folder.path(), &format!("{name}.aux.xml"), b"<PAMDataset><Metadata/></PAMDataset>");
        convert::run(&job, &Silent, &Cancel::default()).unwrap();
    }
}

#[test]
fn sidecars_and_masks_come_along_with_packed_files() {
    let folder = tempfile::tempdir().unwrap();
    let mask = Spec { extra: vec![(262, Value::Short(vec![4]))], ..Spec::new(WIDTH, HEIGHT, 1, 8) };
    let mask = mask.build(|col, _, _| f64::from(u8::from(col > 0)));
    let mut archive =
        zip::ZipWriter::new(std::fs::File::create(folder.path().join("a.zip")).unwrap());
    for (name, bytes) in
        [("d/a.tif", &placed_tiff()), ("d/a.tif.aux.xml", &PAM.into()), ("d/a.tif.msk", &mask)]
    {
        archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
    let gz = std::fs::File::create(folder.path().join("b.tif.gz")).unwrap();
    let mut gz = flate2::write::GzEncoder::new(gz, flate2::Compression::fast());
    gz.write_all(&placed_tiff()).unwrap();
    gz.finish().unwrap();
    put(folder.path(), "b.tif.gz.aux.xml", PAM.as_bytes());
    put(folder.path(), "b.tif.msk", &mask);
    for name in ["a.zip", "b.tif.gz"] {
        let grid = open_band(&folder.path().join(name), 1).unwrap();
        assert_eq!((grid.info().nodata, grid.info().scale), (Some(5.0), 0.5), "{name}");
        let heights = read_all(grid.as_ref()).unwrap();
        assert_eq!(heights[1], 100.5);
        assert!([0, 4, 5, 8].iter().all(|i| heights[*i].is_nan()), "{name}: {heights:?}");
    }
}

#[test]
fn what_is_unpacked_goes_where_the_user_says() {
    let folder = tempfile::tempdir().unwrap();
    let gz = std::fs::File::create(folder.path().join("a.tif.gz")).unwrap();
    let mut gz = flate2::write::GzEncoder::new(gz, flate2::Compression::fast());
    gz.write_all(&placed_tiff()).unwrap();
    gz.finish().unwrap();
    put(folder.path(), "b.png", &picture());
    put(folder.path(), "c.xyz", &points());
    let lost = GridOpenOptions {
        temp_dir: Some(folder.path().join("lost")),
        ..GridOpenOptions::default()
    };
    let there =
        GridOpenOptions { temp_dir: Some(folder.path().into()), ..GridOpenOptions::default() };
    let names = ["a.tif.gz", "b.png", "c.xyz"].map(|n| folder.path().join(n).display().to_string());
    for name in &names {
        assert!(open(name, &there).is_ok(), "{name}");
        let told = open(name, &lost).err().expect("nowhere to unpack").to_string();
        assert!(told.contains("temporary folder") && told.contains("‹temp_dir›"), "{told}");
        assert!(!told.contains("at path"), "{told}");
    }
    let both = [names[0].clone(), names[0].clone()];
    assert!(open_all(&both, &there).is_ok() && open_all(&both, &lost).is_err());
}
