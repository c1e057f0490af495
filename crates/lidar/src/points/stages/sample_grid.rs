//! Attributes from the samples of a grid, or colours from a picture.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::lookup::{PositionValues, ValueLookup, attribute_name, dimension_of};
use super::{AnyStage, OpenStage, Stage, StageInput, StageName};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Point, Rect, Ruler};
use terrane_cloud::{CloudInfo, NewDimension};
use terrane_files::{is_made, name_of, path_of};
use terrane_raster::{self as raster, GridOpenOptions, GridSource, SampleType};

/// Bytes of the block cache of a band, or its four largest blocks.
const CACHE: u64 = 16 << 20;
/// The attributes of colours, from the first three bands.
const COLOURS: [&str; 3] = ["red", "green", "blue"];
/// Largest colours in pictures of 8 bits and in point clouds.
const WHITE: [f64; 2] = [255.0, 65_535.0];

/// Sets attributes to values of a grid at the place of each point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleGrid {
    /// The grid: a file, folder, list or pattern.
    pub grid: String,
    /// What its bands are for.
    pub bands: SampledBands,
}

/// The attributes for the bands of a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SampledBands {
    /// The first three bands are colours: those of the nearest sample.
    Colours,
    /// One band is an attribute.
    Attribute {
        /// The attribute, or a new dimension.
        name: String,
        /// The band, from 1.
        band: u32,
        /// Take the nearest sample, instead of interpolating between the four around the point.
        is_nearest: bool,
    },
}

/// "dtm.tif:Ground", "dtm.tif:Ground:nearest", "bands.tif:Heat:band=2".
fn of_attribute(text: &str) -> std::result::Result<SampleGrid, String> {
    let (mut rest, mut band, mut is_nearest) = (text, 1, false);
    while let Some((before, last)) = rest.rsplit_once(':') {
        match (last.trim(), last.trim().strip_prefix("band=")) {
            ("nearest", _) => is_nearest = true,
            (_, Some(number)) => {
                let number = number.parse().ok().filter(|band| *band > 0);
                band = number.ok_or("a band is a number from 1")?;
            }
            (name, None) if !before.is_empty() => {
                let bands =
                    SampledBands::Attribute { name: attribute_name(name)?, band, is_nearest };
                return Ok(SampleGrid { grid: before.to_owned(), bands });
            }
            _ => break,
        }
        rest = before;
    }
    Err("expected GRID:ATTRIBUTE, then :band=NUMBER or :nearest".to_owned())
}

impl SampleGrid {
    pub(super) const NAMES: [StageName; 2] = [
        StageName {
            name: "sample-grid",
            arguments: "GRID:ATTRIBUTE[:band=NUMBER][:nearest]",
            about: "set an attribute to the value of a grid at each point",
            parse: |text| of_attribute(text).map(Into::into),
        },
        StageName {
            name: "colour",
            arguments: "IMAGE",
            about: "set the colours to those of a georeferenced image, such as an orthophoto",
            parse: |text| match text {
                "" => Err("expected the name of an image".to_owned()),
                _ => Ok(Self { grid: text.to_owned(), bands: SampledBands::Colours }.into()),
            },
        },
    ];

    /// The bands, from 1, and the names of their attributes.
    fn attributes(&self) -> Vec<(u32, &str)> {
        match &self.bands {
            SampledBands::Colours => (1..).zip(COLOURS).collect(),
            SampledBands::Attribute { name, band, .. } => vec![(*band, name)],
        }
    }

    /// A band.
    fn band(&self, band: u32, input: &StageInput<'_>) -> Result<SampledBand> {
        let names = std::slice::from_ref(&self.grid);
        let open = |bytes: u64, colours: bool| {
            let options = GridOpenOptions {
                band,
                colours,
                cache_bytes: bytes as usize,
                temp_dir: input.job.resources.temp_dir.clone(),
                ..GridOpenOptions::default()
            };
            raster::open_all(names, &options)
        };
        let is_colour = self.bands == SampledBands::Colours;
        // The bands of a picture, unless they are encoded heights.
        let any = |bytes| match open(bytes, is_colour) {
            Err(error) if !is_colour => open(bytes, true).map_err(|_| error),
            opened => opened,
        };
        let grid = any(CACHE)?;
        let bytes = CACHE.max(4 * grid.block_bytes());
        let grid = if bytes > CACHE { any(bytes)? } else { grid };
        Ok(SampledBand { grid, bytes })
    }
}

impl Stage for SampleGrid {
    fn dimensions(&self) -> Vec<NewDimension> {
        let names = self.attributes().into_iter();
        names.filter_map(|(_, name)| dimension_of(name, "Of a grid")).collect()
    }

    fn resolved(&self, _: &CloudInfo) -> Result<Option<AnyStage>> {
        if is_made(&self.grid) {
            return Ok(None);
        }
        let path = path_of(&self.grid);
        let grid = name_of(std::path::absolute(&path).map_err(|e| Error::read(&path, e))?)?;
        Ok(Some(Self { grid, ..self.clone() }.into()))
    }

    fn files(&self) -> Vec<PathBuf> {
        let files = raster::files(std::slice::from_ref(&self.grid)).unwrap_or_default();
        let files = files.iter().filter(|name| !is_made(name));
        files.map(|name| path_of(name).into_owned()).collect()
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        let (path, frame) = (path_of(&self.grid).into_owned(), &input.info.frame);
        let is_colour = self.bands == SampledBands::Colours;
        let bands = self.attributes().into_iter().map(|(band, _)| {
            let opened = self.band(band, input);
            opened.map_err(|error| match is_colour && band > 1 {
                true => error.remedy("name an image with three bands, red, green and blue"),
                false => error,
            })
        });
        let bands = bands.collect::<Result<Vec<_>>>()?;
        let info = bands[0].grid.info();
        if !info.georeferenced {
            return Err(Error::bad_input("has no georeference")
                .in_file(&path)
                .remedy("add one, such as a world file"));
        }
        let same = input.info.crs.check_same_of("cloud", &info.crs, "grid");
        same.map_err(|error| error.in_file(&path))?;
        let is_byte = is_colour && info.sample_type == SampleType::U8;
        let values = GridValues {
            rulers: [frame.ruler(0), frame.ruler(1)],
            transform: info.transform,
            size: [info.width, info.height],
            is_nearest: matches!(
                self.bands,
                SampledBands::Colours | SampledBands::Attribute { is_nearest: true, .. }
            ),
            factor: if is_byte { WHITE[1] / WHITE[0] } else { 1.0 },
            bands,
        };
        let names: Vec<_> = self.attributes().into_iter().map(|(_, name)| name).collect();
        Ok(Box::new(ValueLookup::new(&names, values, &path, input)?))
    }
}

impl GridValues {
    /// The column and row of the cell of a place: cells include their western and southern borders.
    fn cell(&self, [col, row]: [f64; 2]) -> [f64; 2] {
        let [west_first, south_first] = [self.transform.a > 0.0, self.transform.e > 0.0];
        let cell = |at: f64, is_first: bool| match is_first {
            true => (at + 0.5).floor(),
            false => (at - 0.5).ceil(),
        };
        [cell(col, west_first), cell(row, south_first)]
    }
}

/// A band, and the bytes of its cache.
struct SampledBand {
    grid: Box<dyn GridSource>,
    bytes: u64,
}

/// The values of a grid at places.
struct GridValues {
    rulers: [Ruler; 2],
    transform: Affine,
    size: [u32; 2],
    is_nearest: bool,
    /// Of the values.
    factor: f64,
    bands: Vec<SampledBand>,
}

impl PositionValues for GridValues {
    fn values(&self, at: Point, out: &mut [f64]) -> Result<()> {
        let [x, y] = [self.rulers[0].at(at.x.into()), self.rulers[1].at(at.y.into())];
        let at = self.transform.invert(x, y);
        for (band, value) in self.bands.iter().zip(out) {
            let sampled = match self.is_nearest {
                true => nearest(&*band.grid, self.cell(at), self.size)?,
                false => bilinear(&*band.grid, at, self.size)?,
            };
            *value = sampled * self.factor;
        }
        Ok(())
    }

    fn bytes(&self) -> u64 {
        self.bands.iter().map(|band| band.bytes).sum()
    }
}

/// The sample of a cell; NaN beyond all cells.
fn nearest(grid: &dyn GridSource, place: [f64; 2], size: [u32; 2]) -> Result<f64> {
    if !(0..2).all(|axis| (0.0..f64::from(size[axis])).contains(&place[axis])) {
        return Ok(f64::NAN);
    }
    let mut value = [0.0];
    grid.read_f64(Rect::new(place[0] as u32, place[1] as u32, 1, 1), &mut value)?;
    Ok(value[0])
}

/// The value between the four samples around a place, or between those that it lies on; NaN beyond the samples and where
/// one of them is void.
fn bilinear(grid: &dyn GridSource, at: [f64; 2], size: [u32; 2]) -> Result<f64> {
    if !(0..2).all(|axis| at[axis] >= 0.0 && at[axis] <= f64::from(size[axis] - 1)) {
        return Ok(f64::NAN);
    }
    let first = at.map(f64::floor);
    let part = [0, 1].map(|axis| at[axis] - first[axis]);
    // What has no weight may be void, or beyond the last sample.
    let count = part.map(|part| if part > 0.0 { 2 } else { 1 });
    let mut values = [0.0; 4];
    let rect = Rect::new(first[0] as u32, first[1] as u32, count[0], count[1]);
    let values = &mut values[..rect.len()];
    grid.read_f64(rect, values)?;
    let along = |row: &[f64]| match row {
        [a, b] => a + (b - a) * part[0],
        _ => row[0],
    };
    let mut rows = values.chunks_exact(count[0] as usize).map(along);
    let above = rows.next().unwrap_or(f64::NAN);
    Ok(rows.next().map_or(above, |below| above + (below - above) * part[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_attributes_and_bands_are_told_apart() {
        let of = |text: &str| of_attribute(text);
        let attribute = |name: &str, band, is_nearest| SampledBands::Attribute {
            name: name.to_owned(),
            band,
            is_nearest,
        };
        let made = of("C:\\dtm.tif:Ground").unwrap();
        assert_eq!(
            (made.grid.as_str(), made.bands),
            ("C:\\dtm.tif", attribute("Ground", 1, false))
        );
        let made = of("synth:rough,size=65:Ground:nearest:band=3").unwrap();
        assert_eq!(made.bands, attribute("Ground", 3, true));
        assert_eq!(made.grid, "synth:rough,size=65");
        for text in [
            "",
            "dtm.tif",
            ":Ground",
            "dtm.tif:x",
            "dtm.tif:A:band=0",
            "dtm.tif:",
            "nearest:band=1",
        ] {
            assert!(of(text).is_err(), "{text}");
        }
    }
}
