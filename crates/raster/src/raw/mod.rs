//! Raw binary grids with a text header beside them: ESRI (.hdr of .bil, .bip, .bsq and GridFloat
//! .flt) and ENVI.

mod envi;
mod esri;

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::file::RawFile;
use crate::strided::{Layout, Strided, check_exact};
use crate::{GridInfo, GridSource, OpenOptions, RasterFormat, SampleType, prj, some_band, world};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_base::limits;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "raw with header",
    extensions: &["flt", "bil", "bip", "bsq", "hdr"],
    about: "binary grids, of any ending, with an ESRI or ENVI .hdr beside them",
    sniff: |_| false,
    open,
};

/// Most bytes of a header.
const MOST_HEADER: u64 = 1 << 20;

/// How the bands lie.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Interleave {
    /// By line.
    Bil,
    /// By pixel.
    Bip,
    /// One band after the other.
    Bsq,
}

impl Interleave {
    fn named(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "bil" => Some(Self::Bil),
            "bip" => Some(Self::Bip),
            "bsq" => Some(Self::Bsq),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Bil => "BIL",
            Self::Bip => "BIP",
            Self::Bsq => "BSQ",
        }
    }
}

/// What a header of either kind says.
#[derive(Clone, Debug, PartialEq)]
struct Header {
    kind: &'static str,
    width: u32,
    height: u32,
    bands: u32,
    sample_type: SampleType,
    big_endian: bool,
    interleave: Interleave,
    /// Bytes before the first sample.
    skip: u64,
    /// Bytes of a row of one band, with padding, where stated.
    band_row_bytes: Option<u64>,
    /// Bytes of a row of all bands, with padding, where stated.
    total_row_bytes: Option<u64>,
    /// Bytes between bands that follow each other.
    band_gap_bytes: u64,
    transform: Option<Affine>,
    nodata: Option<f64>,
    /// Height = stored * scale + offset, by band.
    scale: Vec<f64>,
    offset: Vec<f64>,
    crs: Crs,
}

impl Header {
    /// Where the samples of band `band` (from 1) lie; `None` when that is beyond counting.
    fn layout(&self, band: u32) -> Option<Layout> {
        let size = self.sample_type.bytes() as u64;
        let (width, bands) = (u64::from(self.width), u64::from(self.bands));
        let before = u64::from(band) - 1;
        let band_row = self.band_row_bytes.unwrap_or(width * size);
        let (col_pitch, row_pitch, band_pitch) = match self.interleave {
            Interleave::Bil => {
                let total = match self.total_row_bytes {
                    Some(total) => total,
                    None => band_row.checked_mul(bands)?,
                };
                (size, total, band_row)
            }
            Interleave::Bip => {
                (size * bands, self.total_row_bytes.unwrap_or(width * size * bands), size)
            }
            Interleave::Bsq => {
                let plane = band_row.checked_mul(u64::from(self.height))?;
                (size, band_row, plane.checked_add(self.band_gap_bytes)?)
            }
        };
        let offset = self.skip.checked_add(band_pitch.checked_mul(before)?)?;
        Some(Layout { offset, col_pitch, row_pitch, big_endian: self.big_endian })
    }

    /// The lengths that a file of this can have: it ends with the last sample, or with what fills up
    /// the last row, or with the gap behind its band. `None` when that is beyond counting.
    fn lengths(&self) -> Option<[u64; 3]> {
        let last = self.layout(self.bands)?;
        let end = last.end(self.width, self.height, self.sample_type.bytes())?;
        let rows = last.row_pitch.checked_mul(self.height.into())?;
        let start = if self.interleave == Interleave::Bsq { last.offset } else { self.skip };
        let full = start.checked_add(rows)?;
        Some([end, full, full.checked_add(self.band_gap_bytes)?])
    }

    /// True when nothing fills up the rows.
    fn is_dense(&self) -> bool {
        let row = u64::from(self.width) * self.sample_type.bytes() as u64;
        self.band_row_bytes.is_none_or(|bytes| bytes == row)
            && self.total_row_bytes.is_none_or(|bytes| bytes == row * u64::from(self.bands))
    }

    /// Fails when stated row lengths are shorter than a row.
    fn check_rows(&self) -> Result<()> {
        let row = u64::from(self.width) * self.sample_type.bytes() as u64;
        let all = row * u64::from(self.bands);
        for (name, stated, least) in [
            ("BANDROWBYTES", self.band_row_bytes, row),
            ("TOTALROWBYTES", self.total_row_bytes, all),
        ] {
            if let Some(stated) = stated
                && stated < least
            {
                return Err(Error::bad_input(format!(
                    "{name} is {stated}, less than the {least} bytes of a row"
                )));
            }
        }
        Ok(())
    }

    fn info(self, path: &Path, options: &OpenOptions) -> Result<GridInfo> {
        let place = match self.transform {
            Some(map) => Some(map),
            None => world::beside(path, &["wld", "blw", "bpw", "bqw", "bilw", "bipw", "bsqw"])?,
        };
        let band = options.band as usize - 1;
        let plain = GridInfo::plain(FORMAT.name, self.width, self.height, self.sample_type);
        let order = if self.big_endian { "big-endian" } else { "little-endian" };
        Ok(GridInfo {
            transform: place.unwrap_or(Affine::LATTICE),
            georeferenced: place.is_some(),
            crs: if self.crs.is_unknown() { prj::beside(path)? } else { self.crs },
            nodata: options.nodata.or(self.nodata),
            scale: self.scale.get(band).copied().unwrap_or(1.0),
            offset: self.offset.get(band).copied().unwrap_or(0.0),
            bands: self.bands,
            band: options.band,
            details: vec![
                ("header".to_owned(), self.kind.to_owned()),
                ("interleave".to_owned(), self.interleave.name().to_owned()),
                ("byte order".to_owned(), order.to_owned()),
            ],
            ..plain
        })
    }
}

/// True for the name of a header.
pub(super) fn is_header_name(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hdr"))
}

/// Opens the data file `path` by the header beside it.
pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<Box<dyn GridSource>> {
    if is_header_name(path) {
        return Err(is_header(path));
    }
    let Some(header_path) = header_beside(path) else {
        let name = path.with_extension("hdr");
        return Err(Error::bad_input("raw binary data without a header beside it")
            .in_file(path)
            .remedy(format!(
                "put its header beside it as {}",
                name.file_name().unwrap_or_default().display()
            )));
    };
    let file = RawFile::open(path)?;
    let header = read_header(&file, &header_path).map_err(|e| e.in_file(&header_path))?;
    some_band(options.band, header.bands).map_err(|e| e.in_file(path))?;
    check_exact(&file, header.lengths().as_ref().map(<[u64; 3]>::as_slice))?;
    let Some(layout) = header.layout(options.band) else {
        return Err(Error::bad_input("its rows are beyond counting").in_file(&header_path));
    };
    let info = header.info(path, options)?;
    Ok(Box::new(Strided::new(file, info, layout)?))
}

/// The header of the data file `path`: `name.ext.hdr` or `name.hdr`.
pub(super) fn header_beside(path: &Path) -> Option<PathBuf> {
    let appended = |ending: &str| {
        let mut name = OsString::from(path);
        name.push(ending);
        PathBuf::from(name)
    };
    let candidates = [
        appended(".hdr"),
        appended(".HDR"),
        path.with_extension("hdr"),
        path.with_extension("HDR"),
    ];
    candidates.into_iter().find(|header| header.is_file() && header != path)
}

/// The answer to a user who opens the header.
fn is_header(path: &Path) -> Error {
    let stem = path.with_extension("");
    let endings = ["bil", "flt", "bip", "bsq", "dat", "img", "raw", "bin", "dem"].iter();
    let upper = |e: &&str| [(*e).to_owned(), e.to_uppercase()];
    let mut names = endings.flat_map(upper).map(|e| stem.with_extension(e)).chain([stem.clone()]);
    let remedy = match names.find(|data| data.is_file()) {
        Some(data) => format!("open {}", data.display()),
        None => format!("open the data file beside it ({}.bil, .flt, ...)", stem.display()),
    };
    Error::usage("is the header of a grid, not its data").in_file(path).remedy(remedy)
}

fn read_header(data: &RawFile, path: &Path) -> Result<Header> {
    let text = world::small_text(path, "bytes of a header", MOST_HEADER)?;
    let text = text.trim_start_matches('\u{feff}');
    let header = if text.trim_start().starts_with("ENVI") {
        envi::read(text)?
    } else {
        let ending = data.path().extension().unwrap_or_default().to_string_lossy().to_lowercase();
        esri::read(text, &ending, data.size())?
    };
    header.check_rows()?;
    Ok(header)
}

/// A size from a header, from 1 to `most`.
fn count(key: &str, value: &str, most: u64) -> Result<u32> {
    let number = whole(key, value)?;
    limits::check(key, number, most)?;
    match u32::try_from(number) {
        Ok(number) if number > 0 => Ok(number),
        _ => Err(Error::bad_input(format!("{key} is {value}, not a whole number above 0"))),
    }
}

/// A whole number from a header, also one written as a decimal ("20.0").
fn whole(key: &str, value: &str) -> Result<u64> {
    let bad = || Error::bad_input(format!("{key} is {value:?}, not a whole number"));
    value.parse().or_else(|_| {
        let number: f64 = value.parse().map_err(|_| bad())?;
        let is_whole = number >= 0.0 && number.fract() == 0.0 && number < 1e15;
        if is_whole { Ok(number as u64) } else { Err(bad()) }
    })
}

/// Values by key; a key that has two is refused, as programs disagree on which counts.
fn once<V: PartialEq>(pairs: impl Iterator<Item = (String, V)>) -> Result<HashMap<String, V>> {
    let mut values = HashMap::new();
    for (key, value) in pairs {
        match values.entry(key) {
            Entry::Occupied(known) if *known.get() != value => {
                let key = known.key();
                return Err(Error::bad_input(format!("header says two things of {key}"))
                    .remedy("take out the wrong line"));
            }
            Entry::Occupied(_) => {}
            Entry::Vacant(new) => drop(new.insert(value)),
        }
    }
    Ok(values)
}

/// A number from a header.
fn number(key: &str, value: &str) -> Result<f64> {
    value.parse().map_err(|_| Error::bad_input(format!("{key} is {value:?}, not a number")))
}
