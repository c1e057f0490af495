//! Grids in gzip files and zip archives: decompressed, with their sidecars, into a temporary folder that is
//! removed once the grid is open.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;
use zip::ZipArchive;

use crate::format::{GridOpenOptions, RasterFormat};
use crate::grid::{GridInfo, GridSource};
use crate::mosaic::vrt;
use crate::registry::{FORMATS, open_path};
use crate::sidecars;
use crate::spool::cannot_unpack;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;
use terrane_files::format::FileFormat;
use terrane_files::{self as file, RawFile};

/// Registry entry of gzip.
pub(super) const GZIP: RasterFormat = RasterFormat {
    name: "gzip",
    extensions: &["gz"],
    about: "any of the formats above, compressed: dem.asc.gz",
    sniff: |head| head.starts_with(b"\x1f\x8b\x08"),
    open: |path, options| open(path, "gzip", unpack_gzip, options),
};

/// Registry entry of zip.
pub(super) const ZIP: RasterFormat = RasterFormat {
    name: "zip",
    extensions: &["zip"],
    about: "one grid of any of the formats above with its sidecar files: dem.flt.zip",
    sniff: |head| head.starts_with(b"PK\x03\x04"),
    open: |path, options| open(path, "zip", unpack_zip, options),
};

/// Extensions of sidecars.
const SIDECARS: [&str; 8] = ["hdr", "prj", "wld", "pgw", "pngw", "npyw", "blw", "tfw"];
/// Maximum number of archive entries that are examined.
const MAX_ENTRIES: u64 = 65_535;

/// Decompresses a file into a folder and returns the path of the grid in it.
type Unpack = fn(&RawFile, &Path) -> Result<PathBuf>;

fn open(
    path: &Path,
    packing: &'static str,
    unpack: Unpack,
    options: &GridOpenOptions,
) -> Result<Box<dyn GridSource>> {
    let file = RawFile::open(path)?;
    let folder = options.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
    let folder = tempfile::Builder::new().prefix("terrane-").tempdir_in(folder);
    let folder = folder.map_err(cannot_unpack)?;
    let inner = unpack(&file, folder.path()).map_err(|e| e.in_file(path))?;
    if is_packed(&inner)? {
        return Err(Error::unsupported("is compressed twice").in_file(path));
    }
    if vrt::is_at(&inner)? {
        return Err(Error::unsupported("contains a VRT, whose source files are not in reach")
            .in_file(path)
            .remedy("unpack it"));
    }
    // The grid keeps its file open, so the folder can be removed at once.
    let grid = open_placed(&inner, path, options).map_err(|e| e.renamed(path))?;
    let mut info = grid.info().clone();
    info.details.push(("packed".to_owned(), packing.to_owned()));
    Ok(Box::new(ExtractedGrid { grid, info, path: path.to_path_buf() }))
}

/// Opens `inner`, under the name of the compressed file `outer` if only that gives its position.
fn open_placed(
    inner: &Path,
    outer: &Path,
    options: &GridOpenOptions,
) -> Result<Box<dyn GridSource>> {
    let grid = open_path(inner, options)?;
    let name = Path::new(outer.file_stem().unwrap_or_default());
    let renamed = inner.with_file_name(name);
    let same_ending = name.extension().is_some() && name.extension() == inner.extension();
    if grid.info().georeferenced || renamed == inner || !same_ending {
        return Ok(grid);
    }
    std::fs::rename(inner, &renamed).map_err(cannot_unpack)?;
    open_path(&renamed, options)
}

/// A grid from a compressed file, which its errors name.
struct ExtractedGrid {
    grid: Box<dyn GridSource>,
    info: GridInfo,
    path: PathBuf,
}

impl GridSource for ExtractedGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.grid.read_f32(rect, out).map_err(|e| e.renamed(&self.path))
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.grid.read_f64(rect, out).map_err(|e| e.renamed(&self.path))
    }

    fn block_bytes(&self) -> u64 {
        self.grid.block_bytes()
    }

    hints_go_to!(grid);
}

fn is_packed(path: &Path) -> Result<bool> {
    let head = RawFile::open(path)?.head(4)?;
    Ok((GZIP.sniff)(&head) || (ZIP.sniff)(&head))
}

fn unpack_gzip(file: &RawFile, folder: &Path) -> Result<PathBuf> {
    let mut decoder = MultiGzDecoder::new(BufReader::new(file.reader()));
    // Browsers and servers drop the second extension; the remaining one is that of the grid.
    let name = file.path().file_name().unwrap_or_default().to_string_lossy();
    let stem = match name.rsplit_once('.') {
        Some((stem, ending)) if ending.eq_ignore_ascii_case("gz") => stem,
        _ => name.as_ref(),
    };
    let target = folder.join(stem);
    let max_bytes = limits::MAX_UNPACKED_BYTES;
    // One byte beyond the limit tells a file of just that size from a longer one, without unpacking all
    // of it.
    let bytes = copy(&mut decoder, max_bytes.saturating_add(1), &target, "gzip file")?;
    limits::check("unpacked size in bytes", bytes, max_bytes)?;
    copy_sidecars(file.path(), &target)?;
    Ok(target)
}

/// Copies the sidecars of the compressed file.
fn copy_sidecars(packed: &Path, target: &Path) -> Result<()> {
    let unpacked = packed.with_extension("");
    for ending in SIDECARS {
        let Some(sidecar) = sidecars::sidecar(&unpacked, &[ending]) else { continue };
        let file = RawFile::open(&sidecar)?;
        limits::check("sidecar size in bytes", file.size(), limits::MAX_HEADER_BYTES)
            .map_err(|e| e.in_file(&sidecar))?;
        let bytes = file.head(limits::MAX_HEADER_BYTES)?;
        std::fs::write(target.with_extension(ending), bytes).map_err(cannot_unpack)?;
    }
    // By the name of the compressed file, as in GDAL, or by that of the grid in it.
    let named = [sidecars::pam(packed), sidecars::pam(&unpacked)];
    if let Some(sidecar) = named.iter().find(|sidecar| sidecar.is_file()) {
        copy_file(sidecar, &sidecars::pam(target))?;
    }
    if let Some(mask) = sidecars::mask(&unpacked).or_else(|| sidecars::mask(packed)) {
        copy_file(&mask, &sidecars::behind(target, ".msk"))?;
    }
    Ok(())
}

fn copy_file(from: &Path, to: &Path) -> Result<()> {
    let file = RawFile::open(from)?;
    limits::check("sidecar size in bytes", file.size(), limits::MAX_UNPACKED_BYTES)
        .map_err(|e| e.in_file(from))?;
    copy(&mut file.reader(), file.size(), to, "sidecar").map(drop)
}

fn unpack_zip(file: &RawFile, folder: &Path) -> Result<PathBuf> {
    let mut archive = ZipArchive::new(BufReader::new(file.reader())).map_err(damaged_zip)?;
    limits::check("number of files in the archive", archive.len() as u64, MAX_ENTRIES)?;
    let names = archive.file_names().map(|name| name.map(Cow::into_owned));
    let names = names.collect::<std::result::Result<Vec<String>, _>>().map_err(damaged_zip)?;
    let grid = the_grid(&names)?;
    let stem = stem(grid);
    let target = folder.join(base(grid));
    let large = [".aux.xml", ".msk", ".MSK"].map(|ending| format!("{grid}{ending}"));
    let is_large = |name: &String| name == grid || large.contains(name);
    let sidecars = names.iter().filter(|name| !is_large(name) && is_sidecar(name, stem));
    let sidecars = sidecars.take(SIDECARS.len()).chain(names.iter().filter(|n| large.contains(n)));
    for name in sidecars.chain([grid]) {
        let max_bytes =
            if is_large(name) { limits::MAX_UNPACKED_BYTES } else { limits::MAX_HEADER_BYTES };
        // The folders in a name are ignored: "../" in an archive would write outside the folder.
        extract(&mut archive, name, max_bytes, &folder.join(base(name)))?;
    }
    Ok(target)
}

type Archive<'a> = ZipArchive<BufReader<file::RawFileReader<'a>>>;

/// Decompresses the entry `name` to `target`, and checks its declared size.
fn extract(archive: &mut Archive<'_>, name: &str, max_bytes: u64, target: &Path) -> Result<()> {
    let mut entry = archive.by_name(name).map_err(damaged_zip)?;
    let declared = entry.size();
    limits::check(&format!("unpacked size of {name} in bytes"), declared, max_bytes)?;
    // An entry that goes on behind its declared size is as damaged as a shorter one.
    let copied = copy(&mut entry, declared + 1, target, "zip archive")?;
    if copied != declared {
        return Err(Error::bad_input(format!(
            "damaged zip archive: unpacked size of {name} is not {declared} bytes"
        )));
    }
    Ok(())
}

/// True if a file of an archive has the name of a grid that is not in turn packed or a VRT.
fn is_grid(name: &str) -> bool {
    let is_hidden = base(name).starts_with('.') || name.starts_with("__MACOSX/");
    !is_hidden
        && !is_header(name)
        && FORMATS
            .iter()
            .filter(|format| ![GZIP.name, ZIP.name, vrt::FORMAT.name].contains(&format.name))
            .any(|format| format.has_extension_of(Path::new(name)))
}

fn is_text(name: &str) -> bool {
    ending(name) == "txt" || ending(name) == "csv"
}

/// The only grid of an archive, by extension.
fn the_grid(names: &[String]) -> Result<&String> {
    let mut grids: Vec<&String> = names.iter().filter(|name| is_grid(name)).collect();
    // Licences and notes are .txt too, so grids with another extension come first.
    if grids.iter().any(|name| !is_text(name)) {
        grids.retain(|name| !is_text(name));
    }
    match grids.as_slice() {
        [grid] => Ok(grid),
        [] => Err(Error::unsupported("zip archive contains no grid of a known format")
            .remedy("add a grid such as .hgt, .asc, .tif or .flt with its .hdr")),
        [first, second, ..] => Err(Error::unsupported(format!(
            "zip archive contains {} grids ({first}, {second}, ...)",
            grids.len()
        ))
        .remedy("unzip it and pass one of them")),
    }
}

fn is_header(name: &str) -> bool {
    ending(name) == "hdr"
}

fn is_sidecar(name: &str, stem: &str) -> bool {
    SIDECARS.contains(&ending(name).as_str())
        && (self::stem(name) == stem || self::stem(self::stem(name)) == stem)
}

/// File name without folders.
fn base(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

/// File name without its extension.
fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |pair| pair.0)
}

fn ending(name: &str) -> String {
    base(name).rsplit_once('.').map(|pair| pair.1.to_lowercase()).unwrap_or_default()
}

/// Copies up to `max_bytes` bytes into a new file; returns the number of bytes.
fn copy(from: &mut dyn Read, max_bytes: u64, target: &Path, what: &str) -> Result<u64> {
    let mut out = File::create(target).map_err(cannot_unpack)?;
    io::copy(&mut from.take(max_bytes), &mut out).map_err(|e| match e.downcast::<Error>() {
        Ok(error) => error,
        // A full disk has a system error code; errors of the decoder have none.
        Err(e) if e.raw_os_error().is_some() => cannot_unpack(e),
        Err(e) => Error::bad_input(format!("damaged {what}: {e}")).remedy("copy it again"),
    })
}

fn damaged_zip(error: zip::result::ZipError) -> Error {
    let error = match error {
        zip::result::ZipError::Io(error) => match error.downcast::<Error>() {
            Ok(error) => return error,
            Err(error) => zip::result::ZipError::Io(error),
        },
        error => error,
    };
    Error::bad_input(format!("damaged zip archive: {error}"))
}
