//! SRTM tiles: big-endian 16-bit heights of one degree by one degree, named after their south-west
//! corner ("N48W125.hgt").

use std::path::Path;

use crate::format::{GridOpenOptions, RasterFormat, only_band};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::sample::{HeightSample, ToHeight};
use crate::window::SampleWindow;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Rect};
use terrane_files::{RawFile, RowRun};

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "SRTM HGT",
    extensions: &["hgt"],
    about: "1-degree tiles of 1/3 to 3 arc seconds, named by their corner",
    sniff: |_| false,
    open,
};

/// Supported columns and rows: 3, 1, 1/2 and 1/3 arc seconds, and the half-width tiles of high latitudes.
const SHAPES: [(u32, u32); 7] = [
    (1201, 1201),
    (601, 1201),
    (3601, 3601),
    (1801, 3601),
    (7201, 7201),
    (3601, 7201),
    (10801, 10801),
];

const VOID: f64 = -32768.0;
const SAMPLE_BYTES: u64 = 2;
const WGS84: u32 = 4326;

fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let tile = HgtTile::open(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(tile))
}

/// An open tile.
struct HgtTile {
    file: RawFile,
    info: GridInfo,
    to_height: ToHeight,
}

impl HgtTile {
    fn open(path: &Path, options: &GridOpenOptions) -> Result<Self> {
        only_band(options.band)?;
        let file = RawFile::open(path)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let info = describe(file.size(), &name, options)?;
        Ok(Self { to_height: ToHeight::of(&info), file, info })
    }

    fn read<H: HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window =
            SampleWindow::new(&self.info, rect, out).map_err(|e| e.in_file(self.file.path()))?;
        let pitch = u64::from(self.info.width) * SAMPLE_BYTES;
        let run = RowRun {
            offset: u64::from(rect.row) * pitch + u64::from(rect.col) * SAMPLE_BYTES,
            pitch,
            bytes: rect.width as usize * SAMPLE_BYTES as usize,
            rows: rect.height as usize,
        };
        self.file.each_row(run, &mut Vec::new(), |row, bytes| {
            for sample in bytes.as_chunks_mut::<2>().0 {
                *sample = i16::from_be_bytes(*sample).to_ne_bytes();
            }
            self.to_height.convert(bytes, window.row(rect, row as u32));
        })
    }
}

impl GridSource for HgtTile {
    reads_alike!();
}

fn describe(bytes: u64, name: &str, options: &GridOpenOptions) -> Result<GridInfo> {
    let (width, height) = shape(bytes)?;
    let transform = corner(name).map(|[lon, lat]| {
        let (a, e) = (1.0 / f64::from(width - 1), -1.0 / f64::from(height - 1));
        Affine { x0: lon, a, b: 0.0, y0: lat + 1.0, d: 0.0, e }
    });
    let wgs84 = Crs {
        epsg: Some(WGS84),
        citation: Some("WGS 84".to_owned()),
        geographic: Some(true),
        vertical_unit: Some("metre".to_owned()),
        vertical_unit_text: Some("m".to_owned()),
        ..Crs::default()
    };
    Ok(GridInfo {
        width,
        height,
        transform: transform.unwrap_or(Affine::LATTICE),
        georeferenced: transform.is_some(),
        pixel_is_point: true,
        crs: wgs84,
        sample_type: SampleType::I16,
        nodata: Some(options.nodata.unwrap_or(VOID)),
        scale: 1.0,
        offset: 0.0,
        block: (width, 1),
        bands: 1,
        band: 1,
        format: FORMAT.name,
        details: vec![
            ("compression".to_owned(), "none".to_owned()),
            ("byte order".to_owned(), "big-endian".to_owned()),
            ("tile".to_owned(), name.to_owned()),
        ],
    })
}

fn file_bytes(width: u32, height: u32) -> u64 {
    u64::from(width) * u64::from(height) * SAMPLE_BYTES
}

/// Columns and rows of a tile with a file size of `bytes`.
fn shape(bytes: u64) -> Result<(u32, u32)> {
    SHAPES.iter().find(|(w, h)| file_bytes(*w, *h) == bytes).copied().ok_or_else(|| {
        let known = SHAPES.iter().map(|&(w, h)| format!("{} ({w} x {h})", file_bytes(w, h)));
        let known: Vec<String> = known.collect();
        Error::bad_input(format!(
            "file size of {bytes} bytes does not match an SRTM tile; expected one of {}",
            known.join(", ")
        ))
    })
}

/// Longitude and latitude of the south-west corner, from a name such as "N48W125.SRTMGL1.hgt".
fn corner(name: &str) -> Option<[f64; 2]> {
    let bytes = name.as_bytes();
    let lat = signed(bytes.first()?, b'N', b'S')? * number(name.get(1..3)?)?;
    let lon = signed(bytes.get(3)?, b'E', b'W')? * number(name.get(4..7)?)?;
    (lat.abs() <= 90.0 && lon.abs() <= 180.0).then_some([lon, lat])
}

fn signed(letter: &u8, plus: u8, minus: u8) -> Option<f64> {
    match letter.to_ascii_uppercase() {
        l if l == plus => Some(1.0),
        l if l == minus => Some(-1.0),
        _ => None,
    }
}

fn number(digits: &str) -> Option<f64> {
    digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_by_name() {
        assert_eq!(corner("N48W125.hgt"), Some([-125.0, 48.0]));
        assert_eq!(corner("s01e006.SRTMGL3.hgt"), Some([6.0, -1.0]));
        for name in ["", "N4", "N48W12.hgt", "X48W125.hgt", "N99W125.hgt", "Né8W125", "N+8W125"] {
            assert_eq!(corner(name), None, "{name}");
        }
    }

    #[test]
    fn lengths_tell_shapes() {
        assert_eq!(shape(2_884_802).unwrap(), (1201, 1201));
        assert_eq!(shape(1801 * 3601 * 2).unwrap(), (1801, 3601));
        let error = shape(400).unwrap_err().to_string();
        assert!(error.contains("400 bytes") && error.contains("2884802 (1201 x 1201)"), "{error}");
        let mut lengths: Vec<u64> =
            SHAPES.iter().map(|s| u64::from(s.0) * u64::from(s.1)).collect();
        lengths.sort_unstable();
        lengths.dedup();
        assert_eq!(lengths.len(), SHAPES.len(), "a length must tell one shape");
    }
}
