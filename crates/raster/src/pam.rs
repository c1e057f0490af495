//! GDAL's persistent auxiliary metadata (PAM) in `FILE.aux.xml`: georeference, CRS, and nodata, scale, offset
//! and unit of each band, for formats that cannot store them and for read-only files. Precedence between file
//! and sidecar differs by format as in GDAL (determined by testing each format).

use std::io::BufReader;
use std::path::{Path, PathBuf};

use crate::format::{GridOpenOptions, RasterFormat};
use crate::grid::{GridInfo, GridSource, unit_and_text};
use crate::sample::HeightSample;
use crate::window::SampleWindow;
use crate::xml::{self, RasterXmlElement, RasterXmlReader, RasterXmlTag};
use crate::{asc, dted, geotiff, hgt, png, raw, sidecars, usgs, xyz};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Affine, Crs, Rect, wkt};
use terrane_base::limits;
use terrane_files::RawFile;

/// Maximum number of heights that are scaled at a time.
const SCRATCH_SAMPLES: u32 = 1 << 16;

/// Precedence if both the file and its sidecar have a value.
#[derive(Clone, Copy, PartialEq)]
enum MetadataPrecedence {
    /// The file, even if it has no value.
    File,
    /// The file, else the sidecar.
    FileFirst,
    /// The sidecar.
    Sidecar,
}

/// Precedence by kind of metadata. Scale and offset always come from the sidecar.
struct PamPrecedence {
    place: MetadataPrecedence,
    crs: MetadataPrecedence,
    nodata: MetadataPrecedence,
    unit: MetadataPrecedence,
}

/// Formats whose sidecars are read.
const RULES: &[(&str, PamPrecedence)] = {
    use MetadataPrecedence::{File, FileFirst, Sidecar};
    &[
        (
            geotiff::FORMAT.name,
            PamPrecedence { place: Sidecar, crs: Sidecar, nodata: Sidecar, unit: Sidecar },
        ),
        (hgt::FORMAT.name, PamPrecedence { place: File, crs: File, nodata: File, unit: File }),
        (asc::FORMAT.name, PamPrecedence { place: File, crs: File, nodata: File, unit: Sidecar }),
        (
            raw::FORMAT.name,
            PamPrecedence { place: FileFirst, crs: FileFirst, nodata: Sidecar, unit: Sidecar },
        ),
        (
            png::FORMAT.name,
            PamPrecedence { place: FileFirst, crs: Sidecar, nodata: FileFirst, unit: Sidecar },
        ),
        (dted::FORMAT.name, PamPrecedence { place: File, crs: Sidecar, nodata: File, unit: File }),
        (usgs::FORMAT.name, PamPrecedence { place: File, crs: File, nodata: File, unit: File }),
        (
            xyz::FORMAT.name,
            PamPrecedence { place: File, crs: Sidecar, nodata: Sidecar, unit: Sidecar },
        ),
    ]
};

/// GDAL assigns ENVI grids without georeference the identity, and so ignores the sidecar.
const ENVI: PamPrecedence = PamPrecedence {
    place: MetadataPrecedence::File,
    crs: MetadataPrecedence::File,
    nodata: MetadataPrecedence::Sidecar,
    unit: MetadataPrecedence::Sidecar,
};

impl MetadataPrecedence {
    /// The sidecar's value `said`, unless the file takes precedence.
    fn pick<T>(self, said: Option<T>, file_is_silent: bool) -> Option<T> {
        said.filter(|_| self == Self::Sidecar || (self == Self::FileFirst && file_is_silent))
    }
}

/// Content of a sidecar for a grid and one band.
#[derive(Debug, Default, PartialEq)]
struct PamMetadata {
    transform: Option<Affine>,
    crs: Option<Crs>,
    is_point: bool,
    nodata: Option<f64>,
    scale: Option<f64>,
    offset: Option<f64>,
    unit: Option<String>,
}

/// Opens `path` by `open` and applies the sidecar of a file of `format`.
///
/// # Errors
/// Errors of `open`; a sidecar that cannot be read, or that contradicts the scale of the file.
pub(super) fn open(
    path: &Path,
    format: &RasterFormat,
    options: &GridOpenOptions,
    open: impl Fn(&GridOpenOptions) -> Result<Box<dyn GridSource>>,
) -> Result<Box<dyn GridSource>> {
    let sidecar = sidecars::pam(path);
    let rules = RULES.iter().find(|(name, _)| *name == format.name).map(|(_, rules)| rules);
    let Some(rules) = rules.filter(|_| sidecar.is_file()) else { return open(options) };
    let metadata = read(&sidecar, options.band).map_err(|e| e.in_file(&sidecar))?;
    let mut grid = open(&with_nodata(options, rules.nodata.pick(metadata.nodata, false)))?;
    // Scale and offset of the sidecar refer to stored values, not to heights encoded in colours.
    let is_packed = format.name == png::FORMAT.name && !is_plain(grid.info());
    let missed = rules.nodata.pick(metadata.nodata, true).filter(|_| !is_packed);
    if grid.info().nodata.is_none() && missed.is_some() {
        grid = open(&with_nodata(options, missed))?;
    }
    let metadata = match is_packed {
        true => PamMetadata { scale: None, offset: None, ..metadata },
        false => metadata,
    };
    let info = metadata.amend(rules, grid.info(), &sidecar).map_err(|e| e.in_file(&sidecar))?;
    Ok(Box::new(GridWithSidecar { grid, info }))
}

/// The options with the nodata value of the sidecar, unless the caller has set one.
fn with_nodata(options: &GridOpenOptions, nodata: Option<f64>) -> GridOpenOptions {
    GridOpenOptions { nodata: options.nodata.or(nodata), ..options.clone() }
}

/// Fails if a sidecar of an earlier file at `path` would apply to a new one.
pub(super) fn refuse_old(path: &Path) -> Result<()> {
    let sidecar = sidecars::pam(path);
    if !sidecar.is_file() || read(&sidecar, 1).is_ok_and(|said| said == PamMetadata::default()) {
        return Ok(());
    }
    let message = "sidecar of an earlier file exists and would apply to the new one";
    Err(Error::new(ErrorKind::CannotWrite, message)
        .in_file(&sidecar)
        .remedy("remove it, or choose another output name"))
}

fn is_plain(info: &GridInfo) -> bool {
    (info.scale, info.offset) == (1.0, 0.0)
}

fn read(sidecar: &Path, band: u32) -> Result<PamMetadata> {
    let file = RawFile::open(sidecar)?;
    limits::check("size of the .aux.xml file in bytes", file.size(), limits::MAX_VRT_BYTES)?;
    let mut xml = RasterXmlReader::new(BufReader::with_capacity(1 << 16, file.reader()));
    let said = PamMetadata::read(&mut xml, band);
    said.map_err(|e| e.at(xml.place()).remedy("correct the file, or move it away"))
}

impl PamMetadata {
    /// Metadata of band `band` (from 1); empty if the file is not PAM.
    fn read<R: std::io::BufRead>(xml: &mut RasterXmlReader<R>, band: u32) -> Result<Self> {
        let mut said = Self::default();
        if !xml.root()?.is("PAMDataset") {
            xml.skip()?;
            return xml.finish().map(|()| said);
        }
        while let Some(tag) = xml.child()? {
            match tag.name.to_ascii_lowercase().as_str() {
                "srs" => said.crs = Some(wkt::of_srs(&xml.node(tag)?.text)),
                "geotransform" => said.transform = Some(place(&xml.node(tag)?)?),
                "metadata" if tag.attribute("domain").is_none() => {
                    said.is_point |= is_pixel_point(xml)?;
                }
                "pamrasterband" if is_band(&tag, band) => said.read_band(xml)?,
                _ => xml.skip()?,
            }
        }
        xml.finish().map(|()| said)
    }

    fn read_band<R: std::io::BufRead>(&mut self, xml: &mut RasterXmlReader<R>) -> Result<()> {
        while let Some(tag) = xml.child()? {
            match tag.name.to_ascii_lowercase().as_str() {
                "nodatavalue" => self.nodata = nodata(&xml.node(tag)?)?,
                "scale" => self.scale = Some(xml.node(tag)?.finite()?),
                "offset" => self.offset = Some(xml.node(tag)?.finite()?),
                "unittype" => self.unit = Some(xml.node(tag)?.text).filter(|t| !t.is_empty()),
                _ => xml.skip()?,
            }
        }
        if self.scale == Some(0.0) {
            return Err(Error::bad_input("band scale is 0"));
        }
        Ok(())
    }

    /// The metadata `own` of a grid with the sidecar applied.
    fn amend(self, rules: &PamPrecedence, own: &GridInfo, sidecar: &Path) -> Result<GridInfo> {
        let mut info = own.clone();
        let is_envi = own.details.iter().any(|(name, kind)| name == "header" && kind == "ENVI");
        let rules = if is_envi { &ENVI } else { rules };
        let place = rules.place.pick(self.transform, !own.georeferenced);
        if let Some(map) = place {
            (info.transform, info.georeferenced) = (map, true);
            info.pixel_is_point = self.is_point;
        }
        if let Some(crs) = rules.crs.pick(self.crs, own.crs.is_unknown()) {
            let Crs { vertical_unit, vertical_unit_text, .. } = own.crs.clone();
            let vertical_unit = vertical_unit.or(crs.vertical_unit);
            info.crs = Crs { vertical_unit, vertical_unit_text, ..crs };
        }
        if let Some(unit) = rules.unit.pick(self.unit, own.crs.vertical_unit.is_none()) {
            let (unit, text) = unit_and_text(&unit);
            (info.crs.vertical_unit, info.crs.vertical_unit_text) = (Some(unit), text);
        }
        info.scale = self.scale.unwrap_or(own.scale);
        info.offset = self.offset.unwrap_or(own.offset);
        if !is_plain(own) && (info.scale, info.offset) != (own.scale, own.offset) {
            return Err(Error::unsupported(format!(
                "scale {} and offset {} differ from {} and {} of the grid",
                info.scale, info.offset, own.scale, own.offset
            ))
            .remedy("move the sidecar away, or remove its scale and offset"));
        }
        let name = sidecar.file_name().unwrap_or_default().to_string_lossy().into_owned();
        info.details.push(("sidecar".to_owned(), name));
        Ok(info)
    }
}

fn is_band(tag: &RasterXmlTag, band: u32) -> bool {
    tag.attribute("band").and_then(|number| number.trim().parse().ok()) == Some(band)
}

fn place(node: &RasterXmlElement) -> Result<Affine> {
    let map = Affine::from_gdal(xml::geotransform(&node.text)?);
    match map.is_valid() {
        true => Ok(map),
        false => Err(Error::bad_input("GeoTransform is not finite or singular")),
    }
}

fn is_pixel_point<R: std::io::BufRead>(xml: &mut RasterXmlReader<R>) -> Result<bool> {
    let mut found = false;
    while let Some(tag) = xml.child()? {
        let item = xml.node(tag)?;
        found |= item.tag.attribute("key") == Some("AREA_OR_POINT") && item.text == "Point";
    }
    Ok(found)
}

/// The nodata value, from its bit pattern if given; `None` if the text is empty.
fn nodata(node: &RasterXmlElement) -> Result<Option<f64>> {
    let bits = node.tag.attribute("le_hex_endian").filter(|hex| hex.len() == 16);
    let bits = bits.and_then(|hex| u64::from_str_radix(hex, 16).ok());
    match bits {
        Some(bits) => Ok(Some(f64::from_bits(bits.swap_bytes()))),
        None if node.text.is_empty() => Ok(None),
        None => node.number().map(Some),
    }
}

/// A grid with its sidecar applied.
struct GridWithSidecar {
    grid: Box<dyn GridSource>,
    info: GridInfo,
}

impl GridWithSidecar {
    fn read<H: HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window = SampleWindow::new(&self.info, rect, out)?;
        let GridInfo { scale, offset, .. } = self.info;
        let rows = (SCRATCH_SAMPLES / rect.width.max(1)).max(1);
        for row in (rect.row..rect.end_row()).step_by(rows as usize) {
            let strip = Rect { row, height: rows, ..rect }.intersect(&rect);
            let mut stored = vec![0.0; strip.len()];
            self.grid.read_f64(strip, &mut stored)?;
            for (row, stored) in stored.chunks_exact(strip.width.max(1) as usize).enumerate() {
                for (height, stored) in window.row(strip, row as u32).iter_mut().zip(stored) {
                    *height = H::of_f64(stored * scale + offset);
                }
            }
        }
        Ok(())
    }

    /// True if heights are those of the inner grid.
    fn is_as_stored(&self) -> bool {
        let own = self.grid.info();
        (self.info.scale, self.info.offset) == (own.scale, own.offset)
    }
}

impl GridSource for GridWithSidecar {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        if self.is_as_stored() { self.grid.read_f32(rect, out) } else { self.read(rect, out) }
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        if self.is_as_stored() { self.grid.read_f64(rect, out) } else { self.read(rect, out) }
    }

    fn block_bytes(&self) -> u64 {
        self.grid.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.grid.members()
    }

    hints_go_to!(grid);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(text: &str, band: u32) -> Result<PamMetadata> {
        PamMetadata::read(&mut RasterXmlReader::new(text.as_bytes()), band)
    }

    #[test]
    fn what_is_said_of_a_band() {
        let text = "<PAMDataset><SRS>EPSG:25832</SRS><GeoTransform>1, 2, 0, 9, 0, -2</GeoTransform>\
            <Metadata domain='X'><MDI key='AREA_OR_POINT'>Point</MDI></Metadata>\
            <PAMRasterBand band='2'><NoDataValue le_hex_endian='0000000000001440'>5</NoDataValue>\
            <Scale>0.5</Scale><Offset>-1</Offset><UnitType>ft</UnitType><Histograms/>\
            </PAMRasterBand></PAMDataset>";
        let first = said(text, 1).unwrap();
        assert_eq!((first.nodata, first.scale, first.is_point), (None, None, false));
        assert_eq!(first.transform, Some(Affine::from_gdal([1.0, 2.0, 0.0, 9.0, 0.0, -2.0])));
        let second = said(text, 2).unwrap();
        assert_eq!(second.crs.unwrap().epsg, Some(25832));
        assert_eq!(
            (second.nodata, second.scale, second.offset),
            (Some(5.0), Some(0.5), Some(-1.0))
        );
        assert_eq!(second.unit.as_deref(), Some("ft"));
    }

    #[test]
    fn other_documents_say_nothing_and_damage_is_an_error() {
        let band = |text: &str| {
            said(
                &format!("<PAMDataset><PAMRasterBand band='1'>{text}</PAMRasterBand></PAMDataset>"),
                1,
            )
        };
        assert_eq!(said("<Other><PAMRasterBand/></Other>", 1).unwrap(), PamMetadata::default());
        assert_eq!(band("<NoDataValue/><Metadata/>").unwrap(), PamMetadata::default());
        assert!(band("<NoDataValue>nan</NoDataValue>").unwrap().nodata.unwrap().is_nan());
        for bad in
            ["<NoDataValue>none</NoDataValue>", "<Scale>0</Scale>", "<Offset>inf</Offset>", "<"]
        {
            assert!(band(bad).is_err(), "{bad}");
        }
        for bad in ["1,2,3", "0,0,0,0,0,0"] {
            let text = format!("<PAMDataset><GeoTransform>{bad}</GeoTransform></PAMDataset>");
            assert!(said(&text, 1).is_err(), "{bad}");
        }
    }
}
