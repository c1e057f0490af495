//! GDAL virtual rasters (.vrt): source rectangles, painted in order.
//!
//! A simple source covers the sources below it, including its nodata samples; a complex source with a nodata value
//! is transparent where it has that value. Samples without a source and samples of the band's nodata value are void.
//!
//! VRTs are untrusted input: they are parsed as a stream with limits on depth, text, sources and bytes, without
//! document types or entities. Files outside the folder of the VRT are rejected unless the user allows them.
//! Nesting is limited to eight levels, and bytes and sources are counted over all nested VRTs.

mod parse;
mod path;

use std::io::BufReader;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::format::{GridOpenOptions, RasterFormat};
use crate::grid::{GridInfo, GridSource, unit_and_text};
use crate::notes::{MASK, UNUSED_MASKS};
use crate::registry::{format_of, head_of};
use terrane_base::error::{Error, Result, all};
use terrane_base::geom::{Affine, Crs, Rect, wkt};
use terrane_base::limits;
use terrane_files::{RawFile, is_remote, on_threads, path_of};

use super::find::{MosaicFamily, MosaicNesting, MosaicSource, find};
use super::recode::{self, HeightRecoding, holds, void_range};
use super::{Mosaic, MosaicPart};
use parse::{Vrt, VrtSource};

/// The registry entry.
pub(crate) const FORMAT: RasterFormat = RasterFormat {
    name: "VRT",
    extensions: &["vrt"],
    about: "GDAL virtual rasters with simple and complex sources in files below their folder",
    sniff: is_vrt,
    open,
};

/// Maximum depth of nested VRTs.
const MAX_DEPTH: usize = 8;
/// Default block size, as in GDAL.
const BLOCK: u32 = 128;

/// True if `head` is the start of a VRT, with or without an XML declaration.
fn is_vrt(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head);
    let text = text.trim_start_matches('\u{feff}').trim_start();
    text.starts_with("<VRTDataset") || (text.starts_with("<?xml") && text.contains("<VRTDataset"))
}

/// Whether the file is a VRT.
pub(crate) fn is_at(path: &Path) -> Result<bool> {
    let head = head_of(path)?;
    Ok(format_of(path, &head).is_some_and(|format| format.name == FORMAT.name))
}

fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let vrt = read(path, options, None)?;
    let family = MosaicFamily::new(options);
    let nest = MosaicNesting { family, around: Vec::new() };
    nest.family.count_vrt_bytes(length(path)?)?;
    Ok(Box::new(mosaic(path, vrt, options, &nest).map_err(|e| e.in_file(path))?))
}

/// Opens a VRT inside other mosaics.
pub(super) fn open_within(
    path: &Path,
    options: &GridOpenOptions,
    nest: &MosaicNesting,
) -> Result<Mosaic> {
    let vrt = read(path, options, Some(nest))?;
    mosaic(path, vrt, options, nest).map_err(|e| e.in_file(path))
}

fn length(path: &Path) -> Result<u64> {
    Ok(RawFile::open(path)?.size())
}

fn read(path: &Path, options: &GridOpenOptions, nest: Option<&MosaicNesting>) -> Result<Vrt> {
    let file = RawFile::open(path)?;
    let within = match nest {
        Some(nest) => nest.family.count_vrt_bytes(file.size()),
        None => limits::check("size of the VRT in bytes", file.size(), limits::MAX_VRT_BYTES),
    };
    let text = BufReader::with_capacity(1 << 16, file.reader());
    within.and_then(|()| parse::parse(text, options.band)).map_err(|e| e.in_file(path))
}

fn mosaic(
    path: &Path,
    vrt: Vrt,
    options: &GridOpenOptions,
    nest: &MosaicNesting,
) -> Result<Mosaic> {
    let nest = deeper(path, nest)?;
    nest.family.count_members(vrt.band.sources.len() as u64)?;
    let mut info = describe(&vrt, options)?;
    let unused = AtomicUsize::new(0);
    let masks = (!vrt.has_mask).then_some(&unused);
    let canvas = VrtCanvas { path, info: &info, nest: &nest, masks };
    let parts = on_threads(options.threads.min(vrt.band.sources.len()), || {
        let parts = vrt.band.sources.par_iter().map(|source| {
            canvas.part(source).map_err(|e| match e.path() {
                // Name the source file, since only the VRT refers to it.
                Some(_) => e.named_by(path),
                None => e.at(&source.place),
            })
        });
        all(parts.collect())
    })?;
    let parts: Vec<MosaicPart> = parts.into_iter().flatten().collect();
    info.details.insert(0, ("files".to_owned(), vrt.band.sources.len().to_string()));
    info.details.extend(vrt.has_mask.then(|| (MASK.to_owned(), "mask band".to_owned())));
    let unused = Some(unused.into_inner()).filter(|count| *count > 0);
    info.details.extend(unused.map(|count| (UNUSED_MASKS.to_owned(), count.to_string())));
    Ok(Mosaic::new(info, parts, nest.family))
}

/// The nesting of the sources of this VRT.
fn deeper(path: &Path, nest: &MosaicNesting) -> Result<MosaicNesting> {
    let real = match is_remote(path) {
        true => path.to_owned(),
        false => std::fs::canonicalize(path).map_err(|e| Error::read(path, e))?,
    };
    if nest.around.contains(&real) {
        return Err(Error::bad_input("refers to itself").in_file(path));
    }
    let depth = nest.around.len() as u64 + 1;
    limits::check("depth of nested VRTs", depth, MAX_DEPTH as u64)?;
    let mut deeper = nest.clone();
    deeper.around.push(real);
    Ok(deeper)
}

fn describe(vrt: &Vrt, options: &GridOpenOptions) -> Result<GridInfo> {
    let Vrt { width, height, band, .. } = vrt;
    let transform = vrt.transform.map(Affine::from_gdal);
    if transform.is_some_and(|map| !map.is_valid()) {
        return Err(Error::bad_input("GeoTransform is not finite or singular"));
    }
    let unit = band.unit.as_deref().map(unit_and_text);
    let (vertical_unit, vertical_unit_text) = unit.map_or((None, None), |(u, t)| (Some(u), t));
    let [cols, rows] = band.block.unwrap_or([BLOCK; 2]);
    Ok(GridInfo {
        transform: transform.unwrap_or(Affine::LATTICE),
        georeferenced: transform.is_some(),
        pixel_is_point: vrt.is_point,
        crs: Crs {
            vertical_unit,
            vertical_unit_text,
            ..vrt.srs.as_deref().map(wkt::of_srs).unwrap_or_default()
        },
        nodata: options.nodata.or(band.nodata),
        scale: band.scale,
        offset: band.offset,
        block: (cols.min(*width), rows.min(*height)),
        bands: vrt.bands,
        band: options.band,
        ..GridInfo::plain(FORMAT.name, *width, *height, band.kind)
    })
}

fn is_same(a: Option<f64>, b: Option<f64>) -> bool {
    a == b || a.zip(b).is_some_and(|(a, b)| recode::is_same(a, b))
}

/// Target of the sources.
struct VrtCanvas<'a> {
    path: &'a Path,
    info: &'a GridInfo,
    nest: &'a MosaicNesting,
    /// Counts sources with unused masks, if the VRT has none.
    masks: Option<&'a AtomicUsize>,
}

impl VrtCanvas<'_> {
    /// The part that `source` paints; `None` if it is outside the canvas.
    fn part(&self, source: &VrtSource) -> Result<Option<MosaicPart>> {
        let name = path::resolve(self.path, &source.file, source.is_relative)?;
        let found = find(&name, source.band, None, self.nest)?;
        let Some((rect, from)) = self.place(source, &found.info) else { return Ok(None) };
        let nodata = self.nodata(source, found.info.nodata);
        let recode = self.recode(source, &found.info, nodata, &name)?;
        let transparent = source.nodata.is_some() || source.use_mask;
        let is_masked = found.info.details.iter().any(|(name, _)| name == MASK);
        if let Some(unused) = self.masks.filter(|_| is_masked && !source.use_mask) {
            unused.fetch_add(1, Ordering::Relaxed);
        }
        let source = match (found.source, nodata) {
            (samples, _) if is_same(found.info.nodata, nodata) => samples,
            (MosaicSource::File(file), _) => {
                MosaicSource::File(file.with_nodata(&self.nest.family, nodata))
            }
            (MosaicSource::Nested { .. }, _) => find(&name, source.band, nodata, self.nest)?.source,
        };
        Ok(Some(MosaicPart { source, rect, from, transparent, recode }))
    }

    /// The nodata value to read a file with that declares `own`.
    fn nodata(&self, source: &VrtSource, own: Option<f64>) -> Option<f64> {
        match (source.nodata, source.use_mask) {
            (Some(nodata), _) => Some(nodata),
            // The declared value of the file.
            (None, true) => own,
            // Only the VRT's own value, which refers to converted samples.
            (None, false) => {
                let kept = self.info.nodata.filter(|_| !source.is_changed());
                own.map(|_| kept.unwrap_or(f64::NAN))
            }
        }
    }

    /// Target rectangle of the source, and its first sample in the file, clipped to both.
    fn place(&self, source: &VrtSource, file: &GridInfo) -> Option<(Rect, [u32; 2])> {
        let size = [i64::from(file.width), i64::from(file.height)];
        let to = source.to.unwrap_or([0, 0, size[0], size[1]]);
        let from = source.from.unwrap_or([0, 0, to[2], to[3]]);
        let end = [i64::from(self.info.width), i64::from(self.info.height)];
        let mut first = [0; 2];
        let mut count = [0; 2];
        for axis in 0..2 {
            // Number of samples to skip so that both offsets are 0 or more.
            let skip = (-to[axis]).max(-from[axis]).max(0);
            let room = (end[axis] - to[axis]).min(size[axis] - from[axis]).min(to[axis + 2]);
            first[axis] = skip;
            count[axis] = room - skip;
        }
        if count[0] <= 0 || count[1] <= 0 {
            return None;
        }
        // Between 0 and the size of the file and of the VRT.
        let [to, from] =
            [to, from].map(|origin| [0, 1].map(|axis| (origin[axis] + first[axis]) as u32));
        Some((Rect::new(to[0], to[1], count[0] as u32, count[1] as u32), from))
    }

    /// Conversion of the heights of the file; `None` if they are unchanged.
    fn recode(
        &self,
        source: &VrtSource,
        file: &GridInfo,
        nodata: Option<f64>,
        name: &str,
    ) -> Result<Option<HeightRecoding>> {
        let band = self.info;
        let is_changed = source.is_changed();
        let is_plain = file.scale == 1.0 && file.offset == 0.0;
        let is_alike = (file.scale, file.offset) == (band.scale, band.offset);
        if !is_plain && (is_changed || !is_alike || !holds(band.sample_type, file.sample_type)) {
            return Err(Error::unsupported(format!(
                "scale {} and offset {} differ from {} and {} of the VRT",
                file.scale, file.offset, band.scale, band.offset
            ))
            .in_file(&path_of(name))
            .remedy(format!("unscale it first: gdal_translate -unscale {name} OUT.tif")));
        }
        let kind =
            (is_changed || !holds(band.sample_type, file.sample_type)).then_some(band.sample_type);
        // Samples of this value are void already.
        let is_void = kind.is_none() && is_same(nodata, band.nodata);
        let void = band.nodata.filter(|_| !is_void);
        let void = void.and_then(|nodata| void_range(band.sample_type, nodata));
        let (scale, offset) = if is_plain { (band.scale, band.offset) } else { (1.0, 0.0) };
        let void = void.map(|(low, high)| match is_plain {
            true => (low, high),
            false => (low * band.scale + band.offset, high * band.scale + band.offset),
        });
        // A negative scale swaps the ends.
        let void = void.map(|(low, high)| (low.min(high), low.max(high)));
        let recode =
            HeightRecoding { ratio: source.ratio, shift: source.shift, kind, void, scale, offset };
        Ok(Some(recode).filter(|recode| *recode != HeightRecoding::NONE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vrts_are_known_by_their_start() {
        for head in [
            "<VRTDataset rasterXSize=\"4\"",
            "\u{feff}\n <VRTDataset>",
            "<?xml version=\"1.0\"?>\n<VRTDataset rast",
        ] {
            assert!(is_vrt(head.as_bytes()), "{head}");
        }
        for head in ["", "<?xml version=\"1.0\"?><kml>", "<OGRVRTDataSource>", "VRTDataset"] {
            assert!(!is_vrt(head.as_bytes()), "{head}");
        }
    }
}
