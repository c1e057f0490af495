//! Where the samples of a raster are, and their heights in metres.

use crate::globe::into_world;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Rect};
use terrane_raster::GridSource;

/// EPSG codes of WGS 84 with two and three axes.
const WGS_84: [u32; 2] = [4326, 4979];

/// A raster whose columns are meridians and whose rows are parallels of WGS 84.
pub(super) struct Places<'a> {
    grid: &'a dyn GridSource,
    map: Affine,
    /// Metres in one unit of heights.
    metres: f64,
    /// Whether the raster says what heights are in.
    pub(super) knows_unit: bool,
}

impl<'a> Places<'a> {
    /// Those of a raster.
    ///
    /// # Errors
    /// By name: no reference system, or another than WGS 84 in degrees; a grid that is turned; samples beyond the
    /// poles or the antimeridian.
    pub(super) fn of(grid: &'a dyn GridSource) -> Result<Self> {
        let info = grid.info();
        let (crs, map) = (&info.crs, into_world(info.transform, [info.width, info.height]));
        check_system(crs)?;
        if map.b != 0.0 || map.d != 0.0 {
            return Err(Error::unsupported("is turned: its rows are no parallels"));
        }
        let unit = crs.vertical_metres();
        let places = Self { grid, map, metres: unit.unwrap_or(1.0), knows_unit: unit.is_some() };
        places.check_world()?;
        Ok(places)
    }

    fn check_world(&self) -> Result<()> {
        let Rect { width, height, .. } = self.bounds();
        let longitudes = [0, width - 1].map(|col| self.longitude(col));
        let latitudes = [0, height - 1].map(|row| self.latitude(row));
        let is_beyond = |at: &f64, most: f64| at.is_nan() || at.abs() > most;
        if let Some(at) = longitudes.iter().find(|at| is_beyond(at, 180.0)) {
            return Err(Error::unsupported(format!(
                "has samples at longitude {at}, beyond the antimeridian"
            ))
            .remedy("cut it at 180 degrees, and shift what is beyond by 360"));
        }
        if let Some(at) = latitudes.iter().find(|at| is_beyond(at, 90.0)) {
            return Err(Error::unsupported(format!("has samples at latitude {at}, beyond a pole")));
        }
        Ok(())
    }

    /// The rectangle of all samples.
    pub(super) fn bounds(&self) -> Rect {
        self.grid.info().bounds()
    }

    /// Degrees of a column.
    pub(super) fn longitude(&self, col: u32) -> f64 {
        self.map.apply(f64::from(col), 0.0)[0]
    }

    /// Degrees of a row.
    pub(super) fn latitude(&self, row: u32) -> f64 {
        self.map.apply(0.0, f64::from(row))[1]
    }

    /// Reads heights in metres; voids are NaN.
    pub(super) fn read(&self, rect: Rect, heights: &mut [f64]) -> Result<()> {
        self.grid.read_f64(rect, heights)?;
        self.grid.copied(rect);
        if self.metres != 1.0 {
            heights.iter_mut().for_each(|height| *height *= self.metres);
        }
        Ok(())
    }
}

fn check_system(crs: &Crs) -> Result<()> {
    let remedy = "bring the raster into EPSG:4326, for example with gdalwarp";
    if !crs.is_named() {
        return Err(Error::bad_input("does not say its reference system")
            .remedy("name it in the file or in a .prj beside it"));
    }
    let agrees = |code| {
        let known = Crs { epsg: Some(code), geographic: Some(true), ..Crs::default() };
        crs.agrees(&known)
    };
    if crs.geographic != Some(true) || !WGS_84.into_iter().any(agrees) {
        let message =
            format!("is in {}, and tiles are proved against WGS 84 in degrees", crs.label());
        return Err(Error::unsupported(message).remedy(remedy));
    }
    Ok(())
}
