//! Many files as one grid: against a painter that goes sample by sample, against what GDAL makes of
//! the same virtual rasters, and what does not fit together.

use std::path::Path;

use crate::data;
use crate::raster_support::{self, crc, read_all, read_in_windows, same};
use proptest::prelude::*;
use tempfile::TempDir;
use terrane_base::geom::Rect;
use terrane_base::{ErrorKind, Result};
use terrane_raster::{GridOpenOptions, GridSource, SampleType, open, open_all};

const NODATA: f64 = -9999.0;

/// A folder of text grids.
struct Place(TempDir);

/// A text grid of whole heights with its top left sample at a column and row of the lattice.
#[derive(Clone, Debug)]
struct Tile {
    col: i32,
    row: i32,
    width: u32,
    height: u32,
    nodata: Option<f64>,
    heights: Vec<f64>,
}

impl Tile {
    fn new(col: i32, row: i32, width: u32, height: u32, value: impl Fn(u32, u32) -> f64) -> Self {
        let at = |i: u32| value(i % width, i / width);
        let heights = (0..width * height).map(at).collect();
        Self { col, row, width, height, nodata: Some(NODATA), heights }
    }

    fn text(&self) -> String {
        let (west, south) = (10 * self.col, -10 * (self.row + self.height as i32));
        let nodata = self.nodata.map(|n| format!("NODATA_value {n}\n")).unwrap_or_default();
        let mut text = format!(
            "ncols {}\nnrows {}\nxllcorner {west}\nyllcorner {south}\ncellsize 10\n{nodata}",
            self.width, self.height
        );
        for row in self.heights.chunks(self.width as usize) {
            let line: Vec<String> = row.iter().map(f64::to_string).collect();
            text += &(line.join(" ") + "\n");
        }
        text
    }
}

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn at(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        raster_support::write_anew(Path::new(&self.at(name)), bytes.as_ref());
        self.at(name)
    }

    /// Writes `tiles` as t000.asc, t001.asc, ...
    fn tiles(&self, tiles: &[Tile]) -> Vec<String> {
        let write = |(i, tile): (usize, &Tile)| self.write(&format!("t{i:03}.asc"), tile.text());
        tiles.iter().enumerate().map(write).collect()
    }

    /// Writes m.vrt of one band with `sources` in it.
    fn vrt(&self, kind: &str, nodata: &str, size: u32, sources: &str) -> String {
        let nodata = match nodata {
            "" => String::new(),
            value => format!("<NoDataValue>{value}</NoDataValue>"),
        };
        self.write(
            "m.vrt",
            format!(
                "<VRTDataset rasterXSize=\"{size}\" rasterYSize=\"{size}\"><SRS>EPSG:32631</SRS>\
                 <GeoTransform>0, 10, 0, 0, 0, -10</GeoTransform>\
                 <VRTRasterBand dataType=\"{kind}\" band=\"1\">{nodata}{sources}</VRTRasterBand>\
                 </VRTDataset>"
            ),
        )
    }
}

fn source(kind: &str, file: &str, from: [i32; 4], to: [i32; 2], more: &str) -> String {
    let [x, y, w, h] = from;
    let [col, row] = to;
    format!(
        "<{kind}><SourceFilename relativeToVRT=\"1\">{file}</SourceFilename>\
         <SourceBand>1</SourceBand><SrcRect xOff=\"{x}\" yOff=\"{y}\" xSize=\"{w}\" ySize=\"{h}\"/>\
         <DstRect xOff=\"{col}\" yOff=\"{row}\" xSize=\"{w}\" ySize=\"{h}\"/>{more}</{kind}>"
    )
}

fn opened(inputs: &[String]) -> Result<Box<dyn GridSource>> {
    open_all(inputs, &GridOpenOptions::default())
}

fn refused(inputs: &[String]) -> String {
    let error = opened(inputs).err().expect("is refused");
    assert_eq!(error.kind().exit_code(), 65, "{error}");
    error.to_string()
}

/// What a mosaic should be: each tile painted over those before it, sample by sample.
fn painted(tiles: &[Tile]) -> (u32, u32, Vec<f64>) {
    let low = |of: fn(&Tile) -> i32| tiles.iter().map(of).min().unwrap();
    let (left, top) = (low(|t| t.col), low(|t| t.row));
    let high = |of: fn(&Tile) -> i32| tiles.iter().map(of).max().unwrap();
    let width = (high(|t| t.col + t.width as i32) - left) as u32;
    let height = (high(|t| t.row + t.height as i32) - top) as u32;
    let mut all = vec![f64::NAN; (width * height) as usize];
    // What no terrain has for a height is a void in files that declare nothing, too.
    let is_declared = tiles.iter().any(|tile| tile.nodata == Some(NODATA));
    for tile in tiles {
        for (i, z) in tile.heights.iter().enumerate() {
            let col = tile.col - left + i as i32 % tile.width as i32;
            let row = tile.row - top + i as i32 / tile.width as i32;
            if Some(*z) != tile.nodata {
                let void = tile.nodata.is_none() && is_declared && *z == NODATA;
                all[row as usize * width as usize + col as usize] =
                    if void { f64::NAN } else { *z };
            }
        }
    }
    (width, height, all)
}

fn tile() -> impl Strategy<Value = Tile> {
    let nodata = prop_oneof![Just(None), Just(Some(NODATA)), Just(Some(3.0))];
    (-20_i32..20, -20_i32..20, 1_u32..12, 1_u32..12, nodata, any::<u64>()).prop_map(
        |(col, row, width, height, nodata, seed)| {
            let value = |x: u32, y: u32| match seed.rotate_left(x * 7 + y * 13) % 9 {
                0 => NODATA,
                n => n as f64,
            };
            Tile { nodata, ..Tile::new(col, row, width, height, value) }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn a_mosaic_is_what_a_painter_makes(
        tiles in prop::collection::vec(tile(), 2..7), side in 1_u32..40,
    ) {
        let place = Place::new();
        let grid = opened(&place.tiles(&tiles)).unwrap();
        let (width, height, expected) = painted(&tiles);
        prop_assert_eq!((grid.info().width, grid.info().height), (width, height));
        let found = read_all(grid.as_ref()).unwrap();
        prop_assert!(found.iter().zip(&expected).all(|(a, b)| same(*a, *b)), "{found:?} {expected:?}");
        let found = read_in_windows(grid.as_ref(), side).unwrap();
        prop_assert!(found.iter().zip(&expected).all(|(a, b)| same(f64::from(*a), *b)));
    }
}

#[test]
fn folders_lists_and_patterns_are_one_grid() {
    let place = Place::new();
    let two = [
        Tile::new(0, 0, 3, 2, |x, _| f64::from(x)),
        Tile::new(3, 0, 2, 2, |_, y| 7.0 + f64::from(y)),
    ];
    let names = place.tiles(&two);
    place.write("list.txt", "# both\nt000.asc\nt001.asc\n");
    let expected = [0.0, 1.0, 2.0, 7.0, 7.0, 0.0, 1.0, 2.0, 8.0, 8.0];
    for inputs in [
        names.clone(),
        vec![place.at("")],
        vec![place.at("t*.asc")],
        vec![place.at("list.txt")],
        vec![format!("@{}", place.at("list.txt"))],
        vec![names[0].clone(), place.at("t001.as?")],
    ] {
        let grid = opened(&inputs).unwrap();
        assert_eq!(read_all(grid.as_ref()).unwrap(), expected, "{inputs:?}");
        let info = grid.info();
        assert_eq!((info.format, info.georeferenced), ("mosaic", true));
        assert_eq!(info.transform.to_gdal(), [0.0, 10.0, 0.0, 0.0, 0.0, -10.0]);
        assert!(info.details.contains(&("files".to_owned(), "2".to_owned())));
    }
    let one = opened(&[place.at("t000*")]).unwrap();
    assert_eq!(one.info().format, "ESRI ASCII", "one file is itself");
}

#[test]
fn gaps_are_void_and_types_widen() {
    let place = Place::new();
    let whole = Tile { nodata: None, ..Tile::new(0, 0, 2, 1, |_, _| 5.0) };
    place.tiles(&[whole]);
    let mut raw = place.at("b.flt");
    std::fs::write(&raw, [1.5_f64, 2.5].map(f64::to_le_bytes).concat()).unwrap();
    place.write(
        "b.hdr",
        "ncols 2\nnrows 1\nxllcorner 30\nyllcorner -10\ncellsize 10\nnbits 64\npixeltype float\nbyteorder I\n",
    );
    let grid = opened(&[place.at("t000.asc"), std::mem::take(&mut raw)]).unwrap();
    assert_eq!(grid.info().sample_type, SampleType::F64);
    let found = read_all(grid.as_ref()).unwrap();
    assert!(found[2].is_nan());
    assert_eq!([found[0], found[1], found[3], found[4]], [5.0, 5.0, 1.5, 2.5]);
}

#[test]
fn windows_outside_are_refused() {
    let place = Place::new();
    let grid = opened(
        &place.tiles(&[Tile::new(0, 0, 2, 2, |_, _| 1.0), Tile::new(2, 0, 2, 2, |_, _| 1.0)]),
    );
    let grid = grid.unwrap();
    for rect in [Rect::new(3, 0, 2, 1), Rect::new(u32::MAX, 0, 2, 1), Rect::new(0, 0, 1, 1)] {
        assert_eq!(grid.read_f32(rect, &mut [0.0; 2]).unwrap_err().kind(), ErrorKind::Usage);
    }
}

#[test]
fn more_files_than_may_be_open() {
    let place = Place::new();
    let tiles: Vec<Tile> = (0..300)
        .map(|i| {
            Tile::new(i % 20 * 4, i / 20 * 4, 5, 5, move |x, y| {
                f64::from(x + y) + f64::from(i % 20 * 4 + i / 20 * 4)
            })
        })
        .collect();
    place.tiles(&tiles);
    let grid = opened(&[place.at("")]).unwrap();
    let (width, _, expected) = painted(&tiles);
    std::thread::scope(|scope| {
        for first in 0..4_u32 {
            let (grid, expected) = (grid.as_ref(), &expected);
            scope.spawn(move || {
                for row in (first..grid.info().height).step_by(4) {
                    let mut out = vec![0.0; width as usize];
                    grid.read_f64(Rect::new(0, row, width, 1), &mut out).unwrap();
                    assert_eq!(out, expected[(row * width) as usize..][..width as usize]);
                    grid.release(Rect::new(0, row, width, 1));
                }
            });
        }
    });
}

#[test]
fn a_file_that_changes_meanwhile_is_told() {
    let place = Place::new();
    let tiles: Vec<Tile> = (0..300).map(|i| Tile::new(i * 2, 0, 2, 2, |_, _| 1.0)).collect();
    let grid = opened(&place.tiles(&tiles)).unwrap();
    let other: Vec<Tile> = (0..300).map(|i| Tile::new(i * 2, 0, 3, 2, |_, _| 1.0)).collect();
    place.tiles(&other);
    let error = read_all(grid.as_ref()).unwrap_err().to_string();
    assert!(error.contains(".asc: file size or type changed"), "{error}");
}

#[test]
fn files_that_do_not_fit_are_named_with_what_would_help() {
    let place = Place::new();
    let [a, b] = ["a.asc", "b.asc"].map(|name| place.at(name));
    let base = Tile::new(0, 0, 3, 3, |_, _| 1.0).text();
    place.write("a.asc", &base);
    let told = |from: &str, to: &str| {
        place.write("b.asc", base.replace(from, to));
        refused(&[a.clone(), b.clone()])
    };
    let cell = told("cellsize 10", "cellsize 30");
    assert!(
        cell.contains("cell size is 30 x -30, that of") && cell.contains("is 10 x -10"),
        "{cell}"
    );
    assert!(
        cell.contains("a.asc")
            && cell.starts_with(&b)
            && cell.contains("merge the files with ‹terrane convert› and ‹resampling›"),
        "{cell}"
    );
    let offset = told("xllcorner 0", "xllcorner 4");
    assert!(
        offset.contains("samples are 0.400000 x 0.000000 cells off")
            && offset.contains("‹resampling›"),
        "{offset}"
    );
    place.write("b.asc", &base);
    place.write("a.prj", "GEOGCS[\"WGS 84\",AUTHORITY[\"EPSG\",\"4326\"]]");
    place.write("b.prj", "PROJCS[\"UTM\",AUTHORITY[\"EPSG\",\"32631\"]]");
    let crs = refused(&[a.clone(), b.clone()]);
    assert!(crs.contains("EPSG:32631") && crs.contains("‹resampling›"), "{crs}");
    let missing = refused(&[a.clone(), place.at("none.asc")]);
    assert!(missing.contains("none.asc"), "{missing}");
    place.write("c.npy", b"\x93NUMPY\x01\x00\x46\x00{'descr': '<f4', 'fortran_order': False, 'shape': (1, 1), }          \n\0\0\0\0");
    let nowhere = refused(&[a, place.at("c.npy")]);
    assert!(nowhere.contains("georeference is missing"), "{nowhere}");
}

/// Sources of every kind over each other; the sums are those of GDAL 3.10 through rasterio (voids
/// and values of `read(1, masked=True)`).
#[test]
fn virtual_rasters_as_gdal_reads_them() {
    let place = Place::new();
    let tile = |k: u32| {
        Tile::new(0, 0, 20, 20, move |x, y| match (x * 7 + y * 5 + k * 3) % 11 {
            0 => NODATA,
            n => f64::from(n * (k + 1)),
        })
    };
    place.tiles(&[tile(0), tile(1), tile(2)]);
    let nodata = "<NODATA>-9999</NODATA>";
    let scaled = "<ScaleOffset>-2.5</ScaleOffset><ScaleRatio>1.25</ScaleRatio>";
    let simple = |i: u32, from, to| source("SimpleSource", &format!("t00{i}.asc"), from, to, "");
    let complex = |i: u32, from, to, more: &str| {
        source("ComplexSource", &format!("t00{i}.asc"), from, to, more)
    };
    let cases = [
        ("Int16", "-9999", simple(0, [0, 0, 20, 20], [0, 0]) + &simple(1, [3, 4, 9, 9], [10, 12])),
        (
            "Int16",
            "-9999",
            simple(0, [0, 0, 20, 20], [0, 0]) + &complex(1, [0, 0, 20, 20], [8, 6], nodata),
        ),
        (
            "Float32",
            "-9999",
            complex(2, [0, 0, 20, 20], [-5, 9], nodata)
                + &complex(0, [2, 2, 18, 18], [1, 20], &format!("{nodata}{scaled}")),
        ),
        (
            "Byte",
            "4",
            simple(0, [0, 0, 20, 20], [10, 10]) + &complex(1, [0, 0, 20, 20], [0, 0], scaled),
        ),
        (
            "Float64",
            "6",
            complex(1, [0, 0, 20, 20], [5, 5], "<NODATA>6</NODATA>")
                + &complex(2, [0, 0, 20, 20], [12, 0], ""),
        ),
        (
            "Int32",
            "3",
            complex(0, [0, 0, 20, 20], [0, 15], "<NODATA>2</NODATA>")
                + &simple(1, [0, 10, 20, 10], [9, 9]),
        ),
    ];
    let mut sums = Vec::new();
    for (kind, nodata, sources) in &cases {
        let path = place.vrt(kind, nodata, 32, sources);
        let grid = open(&path, &GridOpenOptions::default()).unwrap();
        assert_eq!((grid.info().format, grid.info().crs.epsg), ("VRT", Some(32631)));
        let all = read_all(grid.as_ref()).unwrap();
        let windows = read_in_windows(grid.as_ref(), 7).unwrap();
        assert!(all.iter().zip(&windows).all(|(a, b)| same(*a, f64::from(*b))));
        sums.push(crc(&all));
    }
    assert_eq!(sums, GDAL_SUMS);
}

const GDAL_SUMS: [&str; 6] =
    ["4572d6e4", "3f622141", "52c42ce6", "daa9a560", "a5c94c3c", "dd4ea385"];

#[test]
fn virtual_rasters_within_others() {
    let place = Place::new();
    place.tiles(&[Tile::new(0, 0, 4, 4, |x, y| f64::from(x * y))]);
    let whole = |file: &str| source("SimpleSource", file, [0, 0, 4, 4], [0, 0], "");
    let mut inner = "t000.asc".to_owned();
    for level in 1..=9 {
        let path = place.vrt("Float32", "-9999", 4, &whole(&inner));
        inner = format!("l{level}.vrt");
        std::fs::rename(path, place.at(&inner)).unwrap();
        let opened = open(&place.at(&inner), &GridOpenOptions::default());
        match level {
            ..=8 => assert_eq!(read_all(opened.unwrap().as_ref()).unwrap()[15], 9.0),
            _ => assert!(opened.err().unwrap().to_string().contains("depth of nested VRTs (9)")),
        }
    }
    let own = place.vrt("Byte", "", 4, &whole("m.vrt"));
    assert!(refused(&[own]).contains("refers to itself"));
    // A nested one may be read with another nodata value than its own.
    place.vrt("Float32", "-9999", 4, &whole("t000.asc"));
    std::fs::rename(place.at("m.vrt"), place.at("n.vrt")).unwrap();
    let zero = source("ComplexSource", "n.vrt", [0, 0, 4, 4], [0, 0], "<NODATA>0</NODATA>");
    let grid = open(&place.vrt("Float32", "-9999", 4, &zero), &GridOpenOptions::default()).unwrap();
    let found = read_all(grid.as_ref()).unwrap();
    assert!(found[0].is_nan() && found[5] == 1.0, "{found:?}");
}

#[test]
fn virtual_rasters_that_are_refused() {
    let place = Place::new();
    place.tiles(&[Tile::new(0, 0, 4, 4, |_, _| 1.0)]);
    let whole = |file: &str| source("SimpleSource", file, [0, 0, 4, 4], [0, 0], "");
    let told = |sources: &str| refused(&[place.vrt("Byte", "", 4, sources)]);
    let outside = told(&whole("../x.tif"));
    assert!(
        outside.contains("outside the folder of the VRT")
            && outside.contains("TERRANE_VRT_ALLOW_OUTSIDE=1"),
        "{outside}"
    );
    assert!(outside.contains("m.vrt: byte "), "{outside}");
    assert!(told(&whole("/vsizip/x.zip")).contains("GDAL virtual file"));
    assert!(told(&whole("none.tif")).contains("none.tif: "));
    let resampled = whole("t000.asc").replacen("xSize=\"4\"", "xSize=\"2\"", 1);
    assert!(told(&resampled).contains("source from 2 x 4 to 4 x 4"));
    let dtd = place.write(
        "d.vrt",
        "<?xml version=\"1.0\"?><!DOCTYPE VRTDataset [<!ENTITY a \"b\">]><VRTDataset/>",
    );
    assert!(refused(&[dtd]).contains("document type"));
    let other = place.write("w.vrt", "<VRTDataset subClass=\"VRTWarpedDataset\"/>");
    assert!(refused(&[other]).contains("VRTWarpedDataset"));
    let mut zipped = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut zipped, &std::fs::read(place.at("m.vrt")).unwrap()).unwrap();
    let packed = place.write("p.vrt.gz", zipped.finish().unwrap());
    assert!(refused(&[packed]).contains("contains a VRT"));
}

#[test]
fn damage_anywhere_in_a_vrt_or_a_sidecar_is_told() {
    let place = Place::new();
    place.tiles(&[Tile::new(0, 0, 4, 4, |_, _| 1.0)]);
    let sources = source("SimpleSource", "t000.asc", [0, 0, 4, 4], [0, 0], "");
    let unused =
        "<Metadata domain=\"X\"><MDI key=\"a\">b</MDI></Metadata><Other><Deep>c</Deep></Other>";
    let vrt = std::fs::read_to_string(place.vrt("Byte", "", 4, &sources)).unwrap();
    let vrt = vrt.replace(
        "</VRTDataset>",
        &format!("<VRTRasterBand band=\"2\">{unused}</VRTRasterBand></VRTDataset>"),
    );
    let sidecar = format!(
        "<PAMDataset>{unused}<PAMRasterBand band=\"7\">{unused}</PAMRasterBand></PAMDataset>\n"
    );
    let other = format!("<Something>{unused}</Something>\n");
    let open_vrt = |text: &str| opened(&[place.write("v.vrt", text)]).map(drop);
    let open_beside = |text: &str| {
        place.write("t000.asc.aux.xml", text);
        opened(&[place.at("t000.asc")]).map(drop)
    };
    type Opens<'a> = &'a dyn Fn(&str) -> Result<()>;
    let cases: [(&str, Opens<'_>); 3] =
        [(&vrt, &open_vrt), (&sidecar, &open_beside), (&other, &open_beside)];
    for (sound, open) in cases {
        std::fs::remove_file(place.at("t000.asc.aux.xml")).ok();
        open(sound).unwrap_or_else(|e| panic!("{sound}: {e}"));
        for (from, to) in [
            ("<MDI key=\"a\">b</MDI>", "<MDI key=\"a\">b"),
            ("<MDI key=\"a\">b</MDI>", "<MDI key=\"a\">b</MDO>"),
            ("key=\"a\"", "key=a"),
            ("key=\"a\"", "key=\"a\"key=\"b\""),
            ("key=\"a\"", "key=\"a"),
            (">b<", ">b & c<"),
            (">b<", ">b&nothing;<"),
            (">b<", ">\u{1}<"),
            ("<Deep>c</Deep>", "<Deep>c<Deep>"),
            ("<Deep>", "<Deep><!-- c"),
            ("<Deep>", "<Deep><![CDATA[ c"),
            ("<Deep>c</Deep>", "<1>c</1>"),
            ("</Other>", ""),
        ] {
            let damaged = sound.replacen(from, to, 1);
            assert_ne!(damaged, *sound, "{from}");
            let told = open(&damaged).unwrap_err().to_string();
            assert!(
                ["XML", "inside an element", "entity"].iter().any(|said| told.contains(said)),
                "{to}: {told}"
            );
        }
        for more in ["x", "<Other/>", "</Other>", "&amp;", sound] {
            assert!(open(&format!("{sound}{more}")).is_err(), "{more}");
        }
    }
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn srtm_tiles_share_their_edges() {
    let name = |tile: &str| data::at(&format!("dem/{tile}.hgt.zip")).display().to_string();
    let grid = opened(&[name("N41E001"), name("N42E001")]).unwrap();
    let info = grid.info();
    assert_eq!((info.width, info.height, info.nodata), (1201, 2401, Some(-32768.0)));
    let corner = info.transform.to_gdal();
    assert!((corner[0] - 0.999_583_333).abs() < 1e-8 && (corner[3] - 43.000_416_667).abs() < 1e-8);
    // As GDAL reads the virtual raster that gdalbuildvrt makes of both.
    assert_eq!(crc(&read_all(grid.as_ref()).unwrap()), SRTM_SUM);
}

const SRTM_SUM: &str = "098ba338";
