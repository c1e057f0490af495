//! Raw binary grids with a header sidecar: ESRI (.hdr of .bil, .bip, .bsq and GridFloat .flt) and ENVI.

mod envi;
mod esri;
mod header;

use std::path::{Path, PathBuf};

use self::header::RawRasterHeader;
use crate::format::{GridOpenOptions, RasterFormat, some_band};
use crate::grid::{GridInfo, GridSource};
use crate::strided::{StridedGrid, check_exact};
use crate::{prj, sidecars, world};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_files::RawFile;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "raw with header",
    extensions: &["flt", "bil", "bip", "bsq", "hdr"],
    about: "binary grids of any extension with an ESRI or ENVI .hdr",
    sniff: |_| false,
    open,
};

/// Maximum header size in bytes.
const MAX_HEADER: u64 = 1 << 20;

impl RawRasterHeader {
    fn info(self, path: &Path, options: &GridOpenOptions) -> Result<GridInfo> {
        let place = match self.transform {
            Some(map) => Some(map),
            None => world::sidecar_transform(
                path,
                &["wld", "blw", "bpw", "bqw", "bilw", "bipw", "bsqw"],
            )?,
        };
        let band = options.band as usize - 1;
        let plain = GridInfo::plain(FORMAT.name, self.width, self.height, self.sample_type);
        let order = if self.big_endian { "big-endian" } else { "little-endian" };
        Ok(GridInfo {
            transform: place.unwrap_or(Affine::LATTICE),
            georeferenced: place.is_some(),
            crs: if self.crs.is_unknown() { prj::sidecar_crs(path)? } else { self.crs },
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

/// True for the file name of a header.
pub(super) fn is_header_name(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hdr"))
}

/// Opens the data file `path` with its header sidecar.
pub(super) fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    if is_header_name(path) {
        return Err(is_header(path));
    }
    let Some(header_path) = header_beside(path) else {
        let name = path.with_extension("hdr");
        return Err(Error::bad_input("raw binary data without a header file")
            .in_file(path)
            .remedy(format!(
                "add the header file {}",
                name.file_name().unwrap_or_default().display()
            )));
    };
    let file = RawFile::open(path)?;
    let header = read_header(&file, &header_path).map_err(|e| e.in_file(&header_path))?;
    some_band(options.band, header.bands).map_err(|e| e.in_file(path))?;
    check_exact(&file, header.lengths().as_ref().map(<[u64; 3]>::as_slice))?;
    let Some(layout) = header.layout(options.band) else {
        return Err(Error::bad_input("row size exceeds the supported range").in_file(&header_path));
    };
    let info = header.info(path, options)?;
    Ok(Box::new(StridedGrid::new(file, info, layout)?))
}

/// The header of the data file `path`: `name.ext.hdr` or `name.hdr`.
pub(super) fn header_beside(path: &Path) -> Option<PathBuf> {
    let candidates = [
        sidecars::behind(path, ".hdr"),
        sidecars::behind(path, ".HDR"),
        path.with_extension("hdr"),
        path.with_extension("HDR"),
    ];
    candidates.into_iter().find(|header| header.is_file() && header != path)
}

/// Error of opening the header instead of the data.
fn is_header(path: &Path) -> Error {
    let stem = path.with_extension("");
    let endings = ["bil", "flt", "bip", "bsq", "dat", "img", "raw", "bin", "dem"].iter();
    let endings = endings.flat_map(|ending| [(*ending).to_owned(), ending.to_uppercase()]);
    let mut names = endings.map(|ending| stem.with_extension(ending)).chain([stem.clone()]);
    let remedy = match names.find(|data| data.is_file()) {
        Some(data) => format!("open {}", data.display()),
        None => format!("open the data file beside it ({}.bil, .flt, ...)", stem.display()),
    };
    Error::usage("is the header of a grid, not its data").in_file(path).remedy(remedy)
}

fn read_header(data: &RawFile, path: &Path) -> Result<RawRasterHeader> {
    let text = sidecars::small_text(path, "header size in bytes", MAX_HEADER)?;
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
