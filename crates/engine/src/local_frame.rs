//! Local coordinates of a mesh file: in metres for viewers, in millimetres of the print for printers.
//!
//! The map is affine along each axis, `stored = (position - origin) * scale`: it keeps planes and vertical errors, so
//! that it can be inverted for verification. Degrees become metres east and north by the radii of curvature of the
//! CRS's ellipsoid at the middle latitude; a tangent plane would distort heights with distance.
//!
//! Heights are rounded as they will be stored, including the scale, before the bound is checked
//! (`geom::HeightQuantization`); verification has its own formula for stored heights. A tangent plane would be off by 8
//! m at 10 km, and a bound in data units would not hold in the file.

use serde::{Deserialize, Serialize};
use terrane_options::{OptionRange, OptionRule, Options};

use crate::options::{PrintLength, PrintScale};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point3, Spheroid};
use terrane_mesh::MeshFormat;

/// Local coordinates of a mesh file
#[derive(Clone, Copy, Debug, PartialEq, Options)]
#[options(
    heading = "Viewers and printers (STL, 3MF and GLB)",
    setters = group,
    rules = OF_PLACING
)]
pub struct LocalFrame {
    /// Keep longitude and latitude in degrees
    #[option(role = Run, default_text = "local metres (east, north, up) from the centre")]
    pub keep_degrees: bool,
    /// Longest side of the print, such as 100mm or 12cm; plain numbers are millimetres. STL and 3MF are then in
    /// millimetres
    #[option(value = "LENGTH", with = PrintLength, role = Run)]
    pub size: Option<f64>,
    /// Scale of the print, such as 1:50000 or 0.001. STL and 3MF are then in millimetres
    #[option(value = "SCALE", with = PrintScale, role = Run)]
    pub scale: Option<f64>,
    /// Vertical exaggeration factor
    #[option(value = "FACTOR", alias = "exaggerate", range = OptionRange::POSITIVE, role = Run)]
    pub exaggeration: Option<f64>,
}

const OF_PLACING: &[OptionRule] = &[
    OptionRule::NotWith("size", &["scale", "keep_degrees"]),
    OptionRule::NotWith("scale", &["keep_degrees"]),
];

/// Placement of a mesh in its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StorageScale {
    /// Stored units per unit of x, y and z.
    pub scale: Point3,
    /// The stored unit, if it differs from the coordinates' unit.
    pub unit: Option<String>,
}

impl Default for StorageScale {
    fn default() -> Self {
        Self { scale: [1.0; 3], unit: None }
    }
}

impl StorageScale {
    /// True if the file has other coordinates than the data.
    pub fn is_local(&self) -> bool {
        *self != Self::default()
    }
}

/// Decimals of the x and y of an origin: about a metre in degrees. An STL header has little space.
const ORIGIN_DIGITS: i32 = 5;

impl StorageScale {
    /// An origin near `origin` with few digits, for files with local coordinates.
    pub fn origin(&self, origin: Point3, [low, high]: [Point3; 2]) -> Point3 {
        let unit = 10_f64.powi(ORIGIN_DIGITS);
        let [x, y] = [0, 1].map(|axis| {
            let rounded = (origin[axis] * unit).round() / unit;
            // Beside a small mesh a rounded origin would lie so far off that floats lose digits.
            let is_near = (rounded - origin[axis]).abs() * 64.0 <= high[axis] - low[axis];
            if self.unit.is_some() && is_near { rounded } else { origin[axis] }
        });
        [x, y, origin[2]]
    }
}

/// Maximum latitude: nearer to a pole, the length of a degree of longitude vanishes.
const MAX_LATITUDE: f64 = 89.9;

impl LocalFrame {
    /// The option that requests local coordinates, if any.
    pub fn given(&self) -> Option<&'static str> {
        let options = [
            ("‹keep_degrees›", self.keep_degrees),
            ("‹size›", self.size.is_some()),
            ("‹scale›", self.scale.is_some()),
            ("‹exaggeration›", self.exaggeration.is_some()),
        ];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// The placement of a mesh of `crs` within `bounds` in a file of `format`, with notes for the user. `steps` is the
    /// minimum distance of vertices.
    ///
    /// # Errors
    /// An option that the format does not support, degrees for a CRS that is not geographic, units of unknown length,
    /// positions too near to a pole, sizes that exceed the format.
    pub fn place(
        &self,
        crs: &Crs,
        bounds: [Point3; 2],
        steps: Point3,
        format: &MeshFormat,
    ) -> Result<(StorageScale, Vec<String>)> {
        (format.admits)(crs)?;
        let (placed, notes) = self.scaled(crs, bounds, format)?;
        self.check_size(&placed, bounds, steps, format)?;
        Ok((placed, notes))
    }

    fn scaled(
        &self,
        crs: &Crs,
        bounds: [Point3; 2],
        format: &MeshFormat,
    ) -> Result<(StorageScale, Vec<String>)> {
        let is_geographic = crs.horizontal_unit() == "degree";
        if !format.single_precision {
            return self.keep(is_geographic, format);
        }
        if self.keep_degrees && format.states_unit {
            let why = format!("has no effect on {}, which stores lengths", format.name);
            return Err(refusal("‹keep_degrees›", &why));
        }
        if self.keep_degrees && !is_geographic {
            return Err(refusal("‹keep_degrees›", "requires geographic coordinates"));
        }
        let is_print = self.size.is_some() || self.scale.is_some();
        let rise = self.exaggeration.unwrap_or(1.0);
        if !is_print && !format.states_unit && (self.keep_degrees || !is_geographic) {
            let placed = StorageScale { scale: rounded([1.0, 1.0, rise]), unit: None };
            return Ok((placed, notes_on_degrees(is_geographic, format)));
        }
        let (metres, mut notes) = metres(crs, bounds)?;
        let shrink = self.shrink(metres, bounds)?;
        let is_millimetres = is_print && format.can_be_solid;
        let unit = if is_millimetres { 1000.0 } else { 1.0 };
        let [x, y, z] = metres.map(|metres| metres * shrink * unit);
        let unit = if is_millimetres { "millimetre" } else { "metre" };
        if is_geographic {
            notes.push(format!(
                "{} is written in {unit}s east, north and up of its recorded origin",
                format.name
            ));
        }
        let scale = rounded([x, y, z * rise]);
        Ok((StorageScale { scale, unit: Some(unit.to_owned()) }, notes))
    }

    /// Fails if the format, which stores f32, would merge vertices, or if their coordinates overflow.
    fn check_size(
        &self,
        placed: &StorageScale,
        [low, high]: [Point3; 2],
        steps: Point3,
        format: &MeshFormat,
    ) -> Result<()> {
        if !format.single_precision {
            return Ok(());
        }
        let sides = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let Some(axis) =
            (0..3).find(|&axis| !fits_f32(sides[axis], steps[axis], placed.scale[axis]))
        else {
            return Ok(());
        };
        let rise = self
            .exaggeration
            .filter(|rise| axis == 2 && fits_f32(sides[2], steps[2], placed.scale[2] / rise));
        let options = [("‹exaggeration›", rise), ("‹size›", self.size), ("‹scale›", self.scale)];
        let given = options.into_iter().find(|(_, given)| given.is_some());
        let name = format.name;
        Err(match given {
            Some((option, _)) => {
                let message = format!("{option} puts coordinates outside the range of {name}");
                Error::usage(message).remedy(format!("choose a less extreme {option}"))
            }
            None => Error::unsupported(format!(
                "coordinates of the mesh are outside the range of {name}"
            ))
            .remedy("write PLY or OBJ, or pass ‹scale›"),
        })
    }

    /// Formats that keep the coordinates of the data.
    fn keep(
        &self,
        is_geographic: bool,
        format: &MeshFormat,
    ) -> Result<(StorageScale, Vec<String>)> {
        match self.given() {
            Some(option) => {
                let why =
                    format!("applies to STL, 3MF and GLB; {} keeps the coordinates", format.name);
                Err(refusal(option, &why))
            }
            None => Ok((StorageScale::default(), notes_on_degrees(is_geographic, format))),
        }
    }

    /// Metres in the file per metre on the ground.
    fn shrink(&self, metres: Point3, [low, high]: [Point3; 2]) -> Result<f64> {
        let Some(size) = self.size else { return Ok(self.scale.unwrap_or(1.0)) };
        let [x, y] = [0, 1].map(|axis| (high[axis] - low[axis]) * metres[axis]);
        let longest = x.max(y);
        match longest > 0.0 && longest.is_finite() {
            true => Ok(size * MILLIMETRE / longest),
            false => Err(refusal("‹size›", "requires a surface with an extent")),
        }
    }
}

/// True if f32 stores scaled coordinates along a side, and distinguishes those a step apart.
fn fits_f32(side: f64, step: f64, scale: f64) -> bool {
    let (min, max) = (f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX));
    let side = side * scale;
    // Heights may be unknown: NaN.
    (min..max).contains(&(step * scale)) && (side.is_nan() || side < max)
}

/// In metres.
const MILLIMETRE: f64 = 1e-3;

fn refusal(option: &str, why: &str) -> Error {
    Error::usage(format!("{option} {why}")).remedy(format!("leave {option} out"))
}

fn notes_on_degrees(is_geographic: bool, format: &MeshFormat) -> Vec<String> {
    let note = format!(
        "x and y of this {} are degrees, heights are not: viewers show a spike; GLB, STL and 3MF \
         are written in metres",
        format.name
    );
    if is_geographic { vec![note] } else { Vec::new() }
}

/// Metres per unit of x, y and z at the centre of `bounds`.
fn metres(crs: &Crs, [low, high]: [Point3; 2]) -> Result<(Point3, Vec<String>)> {
    let mut notes = Vec::new();
    let across = crs.horizontal_unit();
    let [x, y] = match crs.horizontal_metres() {
        _ if across == "degree" => {
            let spheroid = spheroid(crs, &mut notes).map_err(|e| e.or("write PLY or OBJ"))?;
            degree(&spheroid, f64::midpoint(low[1], high[1]))?
        }
        Some(metres) => [metres; 2],
        None => {
            notes.push("the unit of x and y is unknown; metres are assumed".to_owned());
            [1.0; 2]
        }
    };
    let z = match (crs.vertical_metres(), crs.heights_unit()) {
        (Some(metres), _) => metres,
        (None, Some(unit)) => {
            return Err(Error::unsupported(format!(
                "the height unit {unit:?} is not a known length"
            ))
            .remedy("write PLY or OBJ, which keep the coordinates"));
        }
        (None, None) => {
            let taken = if across == "degree" { 1.0 } else { x };
            let like = if taken == 1.0 { "metres" } else { "the unit of x and y" };
            notes.push(format!("the height unit is unknown; {like} is assumed"));
            taken
        }
    };
    Ok(([x, y, z], notes))
}

/// The ellipsoid of a geographic CRS, with a note if an Earth ellipsoid is assumed.
///
/// # Errors
/// An ellipsoid in an unsupported form.
pub fn spheroid(crs: &Crs, notes: &mut Vec<String>) -> Result<Spheroid> {
    Ok(crs.spheroid()?.unwrap_or_else(|| {
        notes.push("the ellipsoid is unknown; WGS 84 is assumed".to_owned());
        Spheroid::WGS84
    }))
}

/// Lengths in metres of a degree of longitude and of latitude.
fn degree(spheroid: &Spheroid, latitude: f64) -> Result<[f64; 2]> {
    if latitude.abs() > MAX_LATITUDE || !latitude.is_finite() {
        return Err(Error::usage(format!("latitude {latitude} is outside -90 to 90 degrees"))
            .remedy("pass ‹keep_degrees›, or reproject the data"));
    }
    Ok(spheroid.degree_metres(latitude))
}

/// Rounds to seven digits: enough for any model, and few enough for an STL header.
fn rounded(scale: Point3) -> Point3 {
    scale.map(|factor| format!("{factor:.6e}").parse().unwrap_or(factor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_mesh as mesh;

    fn format(name: &str) -> &'static MeshFormat {
        mesh::by_path("a".as_ref(), Some(name)).unwrap()
    }

    fn crs(epsg: u32, unit: &str) -> Crs {
        Crs {
            epsg: Some(epsg),
            geographic: Some(epsg == 4326),
            vertical_unit: (!unit.is_empty()).then(|| unit.to_owned()),
            ..Crs::default()
        }
    }

    const DEGREES: [Point3; 2] = [[7.0, 45.0, f64::NAN], [7.5, 45.2, f64::NAN]];
    const METRES: [Point3; 2] = [[0.0, 0.0, f64::NAN], [20_000.0, 10_000.0, f64::NAN]];

    #[test]
    fn degrees_become_metres_by_the_ellipsoid() {
        // The series in multiples of the latitude that is good to some centimetres.
        for latitude in [-80.0_f64, -45.0, 0.0, 7.5, 30.0, 45.0, 60.0, 85.0] {
            let cosine = |times: f64| (times * latitude.to_radians()).cos();
            let across = 111_412.84 * cosine(1.0) - 93.5 * cosine(3.0) + 0.118 * cosine(5.0);
            let along = 111_132.92 - 559.82 * cosine(2.0) + 1.175 * cosine(4.0);
            let [x, y] = degree(&Spheroid::WGS84, latitude).unwrap();
            assert!((x - across).abs() < 0.1 && (y - along).abs() < 0.1, "{latitude}: {x} {y}");
        }
        let degree = |latitude| degree(&Spheroid::WGS84, latitude);
        assert!(degree(90.0).is_err() && degree(f64::NAN).is_err());
    }

    #[test]
    fn what_is_asked_for_is_done_or_refused_by_name() {
        let print = LocalFrame { size: Some(100.0), ..LocalFrame::default() };
        let at = |placing: LocalFrame, crs: &Crs, bounds, name: &str| {
            placing
                .place(crs, bounds, [1.0; 3], format(name))
                .map(|(placed, notes)| (placed.scale, placed.unit.unwrap_or_default(), notes.len()))
        };
        let (degrees, utm) = (crs(4326, "metre"), crs(32631, "metre"));
        let plain = LocalFrame::default();
        let kept = LocalFrame { keep_degrees: true, ..plain };
        let (local, unit, _) = at(plain, &degrees, DEGREES, "GLB").unwrap();
        assert_eq!((local[2], unit.as_str()), (1.0, "metre"));
        assert!((local[0] - 78_708.0).abs() < 10.0 && (local[1] - 111_133.0).abs() < 10.0);
        assert_eq!(at(plain, &crs(4326, "foot"), DEGREES, "STL").unwrap().0[2], 0.3048);
        assert_eq!(at(kept, &degrees, DEGREES, "GLB").unwrap(), ([1.0; 3], String::new(), 1));
        assert_eq!(at(plain, &degrees, DEGREES, "PLY").unwrap(), ([1.0; 3], String::new(), 1));
        assert_eq!(at(plain, &utm, METRES, "GLB").unwrap(), ([1.0; 3], String::new(), 0));
        // 20 km on 100 mm, in millimetres and in metres.
        let (scale, unit, _) = at(print, &utm, METRES, "STL").unwrap();
        assert_eq!((scale, unit.as_str()), ([0.005; 3], "millimetre"));
        assert_eq!(at(print, &utm, METRES, "GLB").unwrap().0, [5e-6; 3]);
        let scaled = LocalFrame { scale: Some(1.0 / 50_000.0), exaggeration: Some(2.0), ..plain };
        assert_eq!(at(scaled, &utm, METRES, "STL").unwrap().0, [0.02, 0.02, 0.04]);
        let steep = LocalFrame { exaggeration: Some(3.0), ..plain };
        assert_eq!(at(steep, &utm, METRES, "STL").unwrap().0, [1.0, 1.0, 3.0]);
        let feet = at(scaled, &crs(2263, ""), METRES, "STL").unwrap().0;
        assert!(
            (feet[0] - 0.006_096).abs() < 1e-6 && (feet[2] / feet[0] - 2.0).abs() < 1e-6,
            "{feet:?}"
        );
        for (placing, crs, name, part) in [
            (print, &utm, "PLY", "‹size› applies to STL, 3MF and GLB; PLY"),
            (kept, &degrees, "OBJ", "‹keep_degrees› applies to STL, 3MF and GLB; OBJ"),
            (kept, &utm, "GLB", "‹keep_degrees› requires geographic coordinates"),
            (print, &self::crs(32631, "sazhen"), "STL", "sazhen"),
        ] {
            let refused = at(placing, crs, METRES, name).unwrap_err().to_string();
            assert!(refused.contains(part), "{refused}");
        }
    }

    #[test]
    fn origins_are_short_where_they_may_be() {
        let placed = StorageScale { scale: [1.0; 3], unit: Some("metre".to_owned()) };
        let origin = [7.250_976_562_5, 45.100_585_937_5, 812.25];
        assert_eq!(placed.origin(origin, DEGREES), [7.25098, 45.10059, 812.25]);
        assert_eq!(StorageScale::default().origin(origin, DEGREES), origin);
        let tiny = [[7.25097, 45.10058, 0.0], [7.25098, 45.10059, 0.0]];
        assert_eq!(placed.origin(origin, tiny), origin, "not outside of what it is the origin of");
    }
}
