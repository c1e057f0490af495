//! Where the samples of a grid are on the globe, and what is to be said of that.

use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_raster::{GridInfo, Inputs};
use terrane_tiles::Bounds;

/// Systems of longitudes and latitudes that are WGS 84, and those that are within a metre or two of it.
const SAME: [u32; 2] = [4326, 4979];
const NEAR: [(u32, &str); 6] = [
    (4258, "ETRS89"),
    (4269, "NAD83"),
    (4283, "GDA94"),
    (7844, "GDA2020"),
    (4167, "NZGD2000"),
    (6668, "JGD2011"),
];

/// Where the samples of a grid are on the globe.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// From samples to longitudes and latitudes.
    pub(super) map: Affine,
    /// Columns and rows.
    pub(super) whole: [u32; 2],
    /// Where the samples lie.
    pub(super) bounds: Bounds,
    /// Degrees between samples, along the finer axis.
    pub(super) spacing: f64,
}

/// What the heights of a grid are, and what is to be said of them.
#[derive(Clone, Debug)]
pub(super) struct Heights {
    /// Metres in a unit.
    pub(super) metres: f64,
    pub(super) notes: Vec<String>,
}

impl Place {
    /// Of a grid of columns and rows, which `map` takes to longitudes and latitudes.
    ///
    /// # Errors
    /// One that is turned, or reaches beyond a pole or 180 degrees.
    pub(super) fn new(map: Affine, whole: [u32; 2]) -> Result<Self> {
        if map.b != 0.0 || map.d != 0.0 {
            return Err(Error::bad_input("is turned: its rows do not run from west to east")
                .remedy("turn it with gdalwarp"));
        }
        let ends =
            [map.apply(0.0, 0.0), map.apply(f64::from(whole[0] - 1), f64::from(whole[1] - 1))];
        let side =
            |axis: usize| [ends[0][axis].min(ends[1][axis]), ends[0][axis].max(ends[1][axis])];
        let ([west, east], [south, north]) = (side(0), side(1));
        if west < -180.0 || east > 180.0 || south < -90.0 || north > 90.0 {
            let reach = format!("reaches from {west}, {south} to {east}, {north} degrees");
            return Err(Error::bad_input(format!("{reach}, beyond 180 degrees or a pole")).remedy(
                "cut it at 180 degrees, and move what is beyond by 360 (gdal_translate -projwin, -a_ullr)",
            ));
        }
        let bounds = Bounds { west, south, east, north };
        let spacing = map.a.abs().min(map.e.abs());
        Ok(Self { map, whole, bounds, spacing })
    }
}

/// Where the samples of a grid are on the globe, and what its heights are.
///
/// # Errors
/// A grid whose place on the globe is not known, by what is missing.
pub(super) fn of(info: &GridInfo, input: &Inputs) -> Result<(Place, Heights)> {
    let found = heights(info)
        .and_then(|heights| Ok((Place::new(info.transform, [info.width, info.height])?, heights)));
    found.map_err(|error| match input.names() {
        [name] => error.in_file(Path::new(name)),
        _ => error,
    })
}

fn heights(info: &GridInfo) -> Result<Heights> {
    let mut notes = Vec::new();
    system(&info.crs, info.georeferenced, &mut notes)?;
    let metres = info.crs.vertical_metres().unwrap_or_else(|| {
        notes.push("the unit of heights is not known; they are taken for metres".to_owned());
        1.0
    });
    notes.push(
        "heights are taken from the ellipsoid on; those above sea level are drawn too low or too high by the \
         height of the geoid, up to 100 m"
            .to_owned(),
    );
    Ok(Heights { metres, notes })
}

/// Fails where positions are not longitudes and latitudes as WGS 84 has them, or nearly.
fn system(crs: &Crs, is_placed: bool, notes: &mut Vec<String>) -> Result<()> {
    let remedy = "transform it to longitudes and latitudes first: gdalwarp -t_srs EPSG:4326";
    if !is_placed || crs.is_unknown() {
        return Err(Error::bad_input("does not say where on the globe it lies")
            .remedy("give it a reference system: gdal_edit.py -a_srs EPSG:4326"));
    }
    let known = |code: u32| Crs { epsg: Some(code), geographic: Some(true), ..Crs::default() };
    if crs.geographic != Some(true) {
        return Err(Error::new(
            terrane_base::error::ErrorKind::Unsupported,
            format!("is in {}, not in longitudes and latitudes", crs.label()),
        )
        .remedy(remedy));
    }
    let is_one = |code: u32| crs.epsg == Some(code) || crs.agrees(&known(code));
    if SAME.into_iter().any(is_one) {
        return Ok(());
    }
    if let Some((_, name)) = NEAR.into_iter().find(|(code, _)| is_one(*code)) {
        notes
            .push(format!("{name} is taken for WGS 84, from which it differs by up to two metres"));
        return Ok(());
    }
    Err(Error::new(
        terrane_base::error::ErrorKind::Unsupported,
        format!("is in {}, which differs from WGS 84", crs.label()),
    )
    .remedy(remedy))
}
