//! Metadata of a store: from a grid, to a grid, and to TIFF tags.

use super::crs::GeoKeyTags;
use super::layout::TiledTiffLayout;
use super::metadata::{BandName, GdalMetadata, number};
use super::tags::{TiffTagValues, TiledTiffPreamble, tag};
use crate::grid::{GridInfo, SampleType};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;

/// Software tag (305) of every store, with the version of its layout.
pub(super) const MARK: &str = "terrane store 1";
/// Name of the format in [`GridInfo::format`].
const FORMAT: &str = "terrane store";

/// Georeference of a store.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TiledTiffGeoreference {
    Nowhere,
    /// Cell size in x and y, and the world position of the centre of sample (0, 0).
    North {
        scale: [f64; 2],
        origin: [f64; 2],
    },
    /// The 4 x 4 matrix to world coordinates, from cell corners, or from samples if samples are points.
    Matrix(Vec<f64>),
}

/// Metadata from which the whole `TiledTiffPreamble` is generated.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TiledTiffHeader {
    pub(super) layout: TiledTiffLayout,
    pub(super) position: TiledTiffGeoreference,
    pub(super) keys: GeoKeyTags,
    pub(super) metadata: GdalMetadata,
    /// As text, so that it is kept exactly.
    pub(super) nodata: Option<String>,
}

impl TiledTiffHeader {
    /// Metadata of a grid, with tiles of `side`.
    pub(super) fn new(info: &GridInfo, side: u32) -> Result<Self> {
        let layout = TiledTiffLayout::new(info.width, info.height, side, info.sample_type)?;
        check_place(info)?;
        let position = TiledTiffGeoreference::new(info);
        let keys = GeoKeyTags::of(&info.crs, info.pixel_is_point);
        let metadata =
            GdalMetadata::new(info, matches!(position, TiledTiffGeoreference::Matrix(_)));
        Ok(Self { layout, position, keys, metadata, nodata: info.nodata.map(number) })
    }

    /// The described grid; `None` if the metadata are inconsistent.
    pub(super) fn info(&self) -> Option<GridInfo> {
        let TiledTiffLayout { width, height, tile_width, tile_height, sample_type } = self.layout;
        let transform = self.transform()?;
        Some(GridInfo {
            width,
            height,
            transform,
            georeferenced: self.position != TiledTiffGeoreference::Nowhere,
            pixel_is_point: self.keys.is_point(),
            crs: self.metadata.crs(&self.keys)?,
            sample_type,
            nodata: self.nodata.as_ref().map(|text| text.parse()).transpose().ok()?,
            scale: self.metadata.scale()?,
            offset: self.metadata.offset()?,
            block: (tile_width, tile_height),
            bands: 1,
            band: 1,
            format: FORMAT,
            details: vec![
                ("compression".to_owned(), "none".to_owned()),
                ("tiles".to_owned(), format!("{tile_width}x{tile_height}")),
                ("access".to_owned(), "memory-mapped".to_owned()),
            ],
        })
    }

    fn transform(&self) -> Option<Affine> {
        let transform = match &self.position {
            TiledTiffGeoreference::Nowhere => Affine::LATTICE,
            TiledTiffGeoreference::North { scale, origin } => {
                let ([a, e], [x0, y0]) = (*scale, *origin);
                Affine { x0, a, b: 0.0, y0, d: 0.0, e: -e }
            }
            TiledTiffGeoreference::Matrix(m) => {
                let [x0, y0] = self.metadata.origin()?;
                let (a, b, d, e) = (*m.first()?, *m.get(1)?, *m.get(4)?, *m.get(5)?);
                Affine { x0, a, b, y0, d, e }
            }
        };
        transform.is_valid().then_some(transform)
    }

    /// Everything before the tiles.
    pub(super) fn front(&self) -> TiledTiffPreamble {
        TiledTiffPreamble::new(|data| self.tags(data))
    }

    fn tags(&self, data: u64) -> Vec<(u16, TiffTagValues)> {
        let layout = &self.layout;
        let (bits, format) = sample_tags(layout.sample_type);
        let (count, step) = (layout.tiles(), layout.tile_bytes());
        let mut tags = vec![
            (tag::WIDTH, TiffTagValues::long(layout.width)),
            (tag::HEIGHT, TiffTagValues::long(layout.height)),
            (tag::BITS, TiffTagValues::short(bits)),
            (tag::COMPRESSION, TiffTagValues::short(1)),
            (tag::PHOTOMETRIC, TiffTagValues::short(1)),
            (tag::SAMPLES_PER_PIXEL, TiffTagValues::short(1)),
            (tag::PLANAR, TiffTagValues::short(1)),
            (tag::SOFTWARE, TiffTagValues::Ascii(MARK.to_owned())),
            (tag::TILE_WIDTH, TiffTagValues::long(layout.tile_width)),
            (tag::TILE_HEIGHT, TiffTagValues::long(layout.tile_height)),
            (tag::TILE_OFFSETS, TiffTagValues::Table { count, first: data, step }),
            (tag::TILE_BYTES, TiffTagValues::Table { count, first: step, step: 0 }),
            (tag::SAMPLE_FORMAT, TiffTagValues::short(format)),
        ];
        tags.extend(self.position.tags(self.keys.is_point()));
        tags.extend(self.keys.tags());
        tags.extend(self.metadata.xml().map(|xml| (tag::GDAL_METADATA, TiffTagValues::Ascii(xml))));
        tags.extend(self.nodata.clone().map(|text| (tag::GDAL_NODATA, TiffTagValues::Ascii(text))));
        tags
    }
}

impl TiledTiffGeoreference {
    fn new(info: &GridInfo) -> Self {
        let t = info.transform;
        if !info.georeferenced && t == Affine::LATTICE {
            return Self::Nowhere;
        }
        if t.b == 0.0 && t.d == 0.0 && t.a > 0.0 && t.e < 0.0 {
            return Self::North { scale: [t.a, -t.e], origin: [t.x0, t.y0] };
        }
        let [corner_x, a, b, corner_y, d, e] = t.to_gdal();
        let point = info.pixel_is_point;
        let [x, y] = if point { [t.x0, t.y0] } else { [corner_x, corner_y] };
        let rows = [[a, b, 0.0, x], [d, e, 0.0, y], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
        Self::Matrix(rows.concat())
    }

    /// Samples that are areas are tied at the centre of their cell.
    fn tags(&self, point: bool) -> Vec<(u16, TiffTagValues)> {
        let tie = if point { 0.0 } else { 0.5 };
        match self {
            Self::Nowhere => Vec::new(),
            Self::North { scale: [a, e], origin: [x, y] } => vec![
                (tag::PIXEL_SCALE, TiffTagValues::Double(vec![*a, *e, 0.0])),
                (tag::TIEPOINT, TiffTagValues::Double(vec![tie, tie, 0.0, *x, *y, 0.0])),
            ],
            Self::Matrix(matrix) => vec![(tag::MATRIX, TiffTagValues::Double(matrix.clone()))],
        }
    }
}

/// Tags of any GeoTIFF besides samples: georeference, CRS, scale, offset, unit, nodata, and band names.
pub(crate) fn facts(info: &GridInfo, bands: &[BandName]) -> Result<Vec<(u16, TiffTagValues)>> {
    check_place(info)?;
    let keys = GeoKeyTags::of(&info.crs, info.pixel_is_point);
    let mut tags = TiledTiffGeoreference::new(info).tags(keys.is_point());
    tags.extend(keys.tags());
    let xml = GdalMetadata::of_bands(info, bands).xml();
    tags.extend(xml.map(|xml| (tag::GDAL_METADATA, TiffTagValues::Ascii(xml))));
    let nodata = info.nodata.map(number);
    tags.extend(nodata.map(|text| (tag::GDAL_NODATA, TiffTagValues::Ascii(text))));
    Ok(tags)
}

fn check_place(info: &GridInfo) -> Result<()> {
    if info.transform.is_valid() {
        return Ok(());
    }
    Err(Error::bad_input("transform of the grid is not invertible"))
}

/// BitsPerSample and SampleFormat.
pub(crate) fn sample_tags(sample_type: SampleType) -> (u16, u16) {
    use SampleType::{F16, F32, F64, I8, I16, I32, U8, U16, U32};
    let format = match sample_type {
        U8 | U16 | U32 => 1,
        I8 | I16 | I32 => 2,
        F16 | F32 | F64 => 3,
    };
    (8 * sample_type.bytes() as u16, format)
}

/// The sample type of BitsPerSample and SampleFormat.
pub(super) fn sample_type(bits: u16, format: u16) -> Option<SampleType> {
    use SampleType::{F16, F32, F64, I8, I16, I32, U8, U16, U32};
    let all = [I8, U8, I16, U16, I32, U32, F16, F32, F64];
    all.into_iter().find(|&sample| sample_tags(sample) == (bits, format))
}
