//! Longitudes, latitudes and ellipsoidal heights of grid samples.

use std::ops::RangeInclusive;
use std::sync::Arc;

use crate::transform::extent_of;
use crate::{Resources, geoid};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, VerticalReference};
use terrane_crs::{CoordinateOperation, Geoid};
use terrane_raster::GridInfo;

/// Geographic CRSs that are WGS 84, or within a metre or two of it.
const SAME: [u32; 2] = [4326, 4979];
const NEAR: [(u32, &str); 6] = [
    (4258, "ETRS89"),
    (4269, "NAD83"),
    (4283, "GDA94"),
    (7844, "GDA2020"),
    (4167, "NZGD2000"),
    (6668, "JGD2011"),
];

/// Geographic positions of grid samples.
pub enum OnGlobe {
    /// Columns are meridians and rows parallels: the map to longitudes and latitudes.
    Straight(Affine),
    /// The map to positions, and the operation to longitudes and latitudes.
    Moved(Affine, Box<CoordinateOperation>),
}

impl OnGlobe {
    /// The positions for a grid, with notes for the report.
    ///
    /// # Errors
    /// A grid without a known CRS or georeference, or beyond a pole or 180 degrees.
    pub fn of(info: &GridInfo) -> Result<(Self, Vec<String>)> {
        let crs = &info.crs;
        if !info.georeferenced || crs.is_unknown() {
            return Err(Error::bad_input("lacks a georeference or CRS")
                .remedy("assign a CRS: gdal_edit.py -a_srs EPSG:4326"));
        }
        info.check_cells()?;
        let mut notes = Vec::new();
        let is_turned = info.transform.b != 0.0 || info.transform.d != 0.0;
        if crs.geographic == Some(true) && !is_turned && is_near(crs, &mut notes) {
            let whole = [info.width, info.height];
            let map = into_world(info.transform, whole);
            return check_world(&map, whole).map(|()| (Self::Straight(map), notes));
        }
        check_body(crs)?;
        let operation =
            CoordinateOperation::to_wgs84(crs, Some(extent_of(info))).map_err(|error| {
                // Of a system that is known nowhere no part is, either.
                error.remedy(match CoordinateOperation::to_wgs84(crs, None) {
                    Ok(_) => "use a part of it, or reproject it first: gdalwarp -t_srs EPSG:4326",
                    Err(_) => {
                        "assign its CRS (gdal_edit.py -a_srs), or reproject it first: gdalwarp \
                         -t_srs EPSG:4326"
                    }
                })
            })?;
        notes.push(match operation.accuracy() {
            Some(0.0) => format!("samples are transformed from {} to WGS 84", crs.label()),
            Some(metres) => {
                let (name, label) = (operation.name(), crs.label());
                format!(
                    "samples are transformed from {label} to WGS 84 by {name} (accuracy {metres} \
                     m)"
                )
            }
            None => format!(
                "samples are transformed from {} to WGS 84 by {}",
                crs.label(),
                operation.name()
            ),
        });
        notes.extend_from_slice(operation.notes());
        Ok((Self::Moved(info.transform, Box::new(operation)), notes))
    }
}

/// Fails for a CRS of a body other than the Earth.
fn check_body(crs: &Crs) -> Result<()> {
    /// Range of the radii of Earth ellipsoids, in metres.
    const EARTH: RangeInclusive<f64> = 6.35e6..=6.40e6;
    let Ok(conversion) = crs.conversion() else { return Ok(()) };
    let axis = conversion.datum.axis;
    if EARTH.contains(&axis) {
        return Ok(());
    }
    let (name, label) = (conversion.datum.name.replace('_', " "), crs.label());
    let message =
        format!("is not on the Earth: the semi-major axis of {label} (datum {name}) is {axis} m");
    Err(Error::unsupported(message)
        .remedy("tiles require WGS 84; make a mesh with ‹terrane tin› instead"))
}

/// Conversion of grid heights to metres above the ellipsoid.
#[derive(Clone, Debug)]
pub struct VerticalShift {
    /// Metres per unit; negative for depths.
    pub metres: f64,
    geoid: Option<Arc<Geoid>>,
}

impl VerticalShift {
    /// The conversion for heights of a CRS, with a geoid model if they refer to a geoid; and whether the CRS declares
    /// the unit.
    ///
    /// # Errors
    /// A geoid model that cannot be read, or is not applicable to ellipsoidal heights.
    pub fn of(crs: &Crs, geoid: Option<&str>, resources: &Resources) -> Result<(Self, bool)> {
        let unit = crs.vertical_metres();
        let metres = match crs.heights() {
            VerticalReference::Above { is_down: true, .. } => -unit.unwrap_or(1.0),
            _ => unit.unwrap_or(1.0),
        };
        let geoid = geoid.map(|name| read_geoid(name, crs, resources)).transpose()?;
        Ok((Self { metres, geoid }, unit.is_some()))
    }

    /// True if a geoid height is added.
    pub fn has_geoid(&self) -> bool {
        self.geoid.is_some()
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> u64 {
        self.geoid.as_ref().map_or(0, |geoid| geoid.bytes())
    }

    /// Converts heights in place; `place` maps an index to a position. Keeps voids.
    ///
    /// # Errors
    /// A position beyond the geoid model.
    pub fn lift(
        &self,
        heights: &mut [f64],
        place: impl Fn(usize) -> Result<[f64; 2]>,
    ) -> Result<()> {
        if self.metres != 1.0 {
            heights.iter_mut().for_each(|height| *height *= self.metres);
        }
        let Some(geoid) = &self.geoid else { return Ok(()) };
        for (number, height) in heights.iter_mut().enumerate().filter(|(_, z)| z.is_finite()) {
            *height += geoid.height(place(number)?)?;
        }
        Ok(())
    }
}

/// Reads a geoid model for heights in `crs`, which must not be ellipsoidal.
fn read_geoid(name: &str, crs: &Crs, resources: &Resources) -> Result<Arc<Geoid>> {
    let path = &*terrane_files::path_of(name);
    if crs.heights() == VerticalReference::Ellipsoidal {
        return Err(Error::usage("the heights of the grid are ellipsoidal already")
            .in_file(path)
            .remedy("leave ‹geoid› out"));
    }
    geoid::read(path, resources).map(Arc::new)
}

/// True if the CRS is the geographic CRS of an EPSG code, by its number or its definition.
fn is_geographic_crs(crs: &Crs, code: u32) -> bool {
    let defined = Crs { epsg: Some(code), geographic: Some(true), ..Crs::default() };
    crs.epsg == Some(code) || crs.agrees(&defined)
}

/// True if the CRS is WGS 84, or nearly.
fn is_near(crs: &Crs, notes: &mut Vec<String>) -> bool {
    if SAME.into_iter().any(|code| is_geographic_crs(crs, code)) {
        return true;
    }
    let near = NEAR.into_iter().find(|(code, _)| is_geographic_crs(crs, *code));
    if let Some((_, name)) = near {
        notes.push(format!("{name} is treated as WGS 84 (difference up to two metres)"));
    }
    near.is_some()
}

fn check_world(map: &Affine, whole: [u32; 2]) -> Result<()> {
    let ends = [map.apply(0.0, 0.0), map.apply(f64::from(whole[0] - 1), f64::from(whole[1] - 1))];
    let [[west, east], [south, north]] =
        [0, 1].map(|axis| [ends[0][axis].min(ends[1][axis]), ends[0][axis].max(ends[1][axis])]);
    // Positive tests, which NaN fails.
    if west >= -180.0 && east <= 180.0 && south >= -90.0 && north <= 90.0 {
        return Ok(());
    }
    let reach = format!("extends from {west}, {south} to {east}, {north} degrees");
    Err(Error::bad_input(format!("{reach}, beyond 180 degrees or a pole")).remedy(
        "split it at 180 degrees and shift the outer part by 360 (gdal_translate -projwin, -a_ullr)",
    ))
}

/// Tolerance in degrees for samples beyond the world, for rounding errors.
const HAIR: f64 = 1e-9;

/// A map to longitudes and latitudes of an unrotated grid, with ends within the tolerance snapped to 180 degrees or a
/// pole.
pub fn into_world(map: Affine, [width, height]: [u32; 2]) -> Affine {
    let [last_col, last_row] = [width, height].map(|samples| f64::from(samples.saturating_sub(1)));
    let [x0, a] = within([map.x0, map.a], last_col, 180.0);
    let [y0, e] = within([map.y0, map.e], last_row, 90.0);
    Affine { x0, a, y0, e, ..map }
}

/// Start and step of an axis after snapping.
fn within([start, step]: [f64; 2], last: f64, max: f64) -> [f64; 2] {
    let ends = [start, start + step * last];
    let [from, to] =
        ends.map(|end| if end.abs() - max < HAIR { end.clamp(-max, max) } else { end });
    if [from, to] == ends || last == 0.0 {
        return [from, step];
    }
    let mut step = (to - from) / last;
    // The step is rounded, too.
    while to.abs() == max && (from + step * last).abs() > max {
        step = if step > 0.0 { step.next_down() } else { step.next_up() };
    }
    [from, step]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_a_hair_beyond_the_world_is_on_its_border() {
        for (start, samples, most) in [(-180.0, 1081_u32, 180.0), (90.0, 541, 90.0)] {
            let last = f64::from(samples - 1);
            for off in [-1e-13, 0.0, 1e-13, 7e-13] {
                let step = -2.0 * start / last + off;
                let [from, found] = within([start, step], last, most);
                let end = from + found * last;
                assert!(from == start && end.abs() <= most, "{start} {off:e} {end}");
                assert!((end + start).abs() < 1e-9);
                assert!((found - step).abs() < 1e-12);
            }
        }
        assert_eq!(within([-180.0000000001, 1.0], 0.0, 180.0), [-180.0, 1.0]);
        assert_eq!(within([170.0, 1.0], 11.0, 180.0), [170.0, 1.0], "far beyond");
        assert_eq!(within([7.0, 0.1], 50.0, 180.0), [7.0, 0.1], "inside");
    }
}
