//! Synthetic terrains as grids: `synth:rough,size=80000,seed=7` in place of a file.

use super::tiled_tiff::complete;
use crate::format::GridOpenOptions;
use crate::grid::{GridInfo, GridSource, SampleType};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Rect};
use terrane_synth::Terrain;

/// Prefix of names of synthetic terrains.
pub(crate) const PREFIX: &str = "synth:";
/// World position of sample (0, 0): on the central meridian of UTM zone 31, in the Pyrenees.
const ORIGIN: [f64; 2] = [500_000.0, 4_750_000.0];

/// Opens the terrain `name`, with or without `synth:` before it.
pub(crate) fn open(name: &str, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    if options.band != 1 || options.nodata.is_some() {
        let message = format!("synthetic grid {name:?} has one band and no nodata value");
        return Err(Error::usage(message).remedy("omit ‹band› and ‹nodata›"));
    }
    let terrain = Terrain::parse(name.strip_prefix(PREFIX).unwrap_or(name))?;
    Ok(Box::new(SyntheticGrid { info: info(&terrain), terrain }))
}

fn info(terrain: &Terrain) -> GridInfo {
    let [x0, y0] = ORIGIN;
    let integer = terrain.character.integer;
    GridInfo {
        width: terrain.width,
        height: terrain.height,
        transform: Affine { x0, a: terrain.cell, b: 0.0, y0, d: 0.0, e: -terrain.cell },
        georeferenced: true,
        pixel_is_point: false,
        crs: crs(),
        sample_type: if integer { SampleType::I16 } else { SampleType::F32 },
        nodata: terrain.character.voids.then_some(-9999.0),
        scale: 1.0,
        offset: 0.0,
        block: (512, 512),
        bands: 1,
        band: 1,
        format: "synthetic terrain",
        details: vec![
            ("terrain".to_owned(), terrain.to_string()),
            ("character".to_owned(), terrain.character.about.to_owned()),
        ],
    }
}

fn crs() -> Crs {
    complete(Crs {
        epsg: Some(32_631),
        citation: Some("WGS 84 / UTM zone 31N".to_owned()),
        geographic: Some(false),
        vertical_unit: Some("metre".to_owned()),
        ..Crs::default()
    })
}

struct SyntheticGrid {
    info: GridInfo,
    terrain: Terrain,
}

impl SyntheticGrid {
    fn check(&self, rect: Rect, values: usize) -> Result<()> {
        if rect.fits(self.info.width, self.info.height) && values == rect.len() {
            return Ok(());
        }
        Err(Error::usage(format!("{rect:?} with {values} values is not a window of the terrain")))
    }
}

impl GridSource for SyntheticGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.check(rect, out.len())?;
        self.terrain.fill_f32(rect, out);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.check(rect, out.len())?;
        let mut heights = vec![0.0; out.len()];
        self.terrain.fill_f32(rect, &mut heights);
        for (out, height) in out.iter_mut().zip(heights) {
            *out = f64::from(height);
        }
        Ok(())
    }
}
