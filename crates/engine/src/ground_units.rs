//! Slopes of a grid on the ground, and areas of its cells: its axes and its units.

use crate::local_frame::spheroid;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Rect, Spheroid};
use terrane_raster::GridInfo;

/// A matrix, row by row, that converts a slope by column and row into a slope on the ground.
pub type Turn = [[f64; 2]; 2];

/// Conversion of slopes by column and row to slopes on the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundScale {
    map: Affine,
    across: HorizontalUnit,
    /// Metres per unit of height.
    rise: f64,
    notes: Vec<String>,
}

/// Metres per unit of x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
enum HorizontalUnit {
    Everywhere(f64),
    /// Degrees, with their length at each latitude of the ellipsoid.
    Degrees(Spheroid),
}

impl GroundScale {
    /// The conversion for a grid with an invertible map.
    ///
    /// # Errors
    /// Heights in an unknown unit, an unknown ellipsoid, latitudes beyond the poles.
    pub fn of(info: &GridInfo) -> Result<Self> {
        let mut notes = Vec::new();
        let across = across(&info.crs, &mut notes)?;
        let rise = rise(&info.crs, across, &mut notes)?;
        let map = info.transform;
        if matches!(across, HorizontalUnit::Degrees(_)) {
            check_latitudes(&map, info.bounds())?;
        }
        Ok(Self { map, across, rise, notes })
    }

    /// Assumptions, for the report.
    pub fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// A conversion with `scale` height units per unit of x and y.
    pub fn scaled(info: &GridInfo, scale: f64) -> Self {
        let across = HorizontalUnit::Everywhere(scale);
        Self { map: info.transform, across, rise: 1.0, notes: Vec::new() }
    }

    /// True if it is constant along a row.
    pub fn is_by_row(&self) -> bool {
        !matches!(self.across, HorizontalUnit::Degrees(_)) || self.map.d == 0.0
    }

    /// The matrix at a column and row: converts both slopes from height units per column and row to slopes per metre
    /// east and north.
    pub fn turn(&self, col: f64, row: f64) -> Turn {
        let Affine { a, b, d, e, .. } = self.map;
        let [east, north] = match self.across {
            HorizontalUnit::Everywhere(metres) => [metres; 2],
            HorizontalUnit::Degrees(spheroid) => {
                spheroid.degree_metres(self.map.apply(col, row)[1])
            }
        };
        let whole = self.rise / self.map.determinant();
        let (east, north) = (whole / east, whole / north);
        [[e * east, -d * east], [-b * north, a * north]]
    }
}

/// Nodes and weights of Gauss and Legendre on -1/2 to 1/2: exact for polynomials of degree 9, so that the area of a cell
/// of ten degrees has ten digits, and one of a degree all of them.
const NODES: [(f64, f64); 5] = [
    (-0.453_089_922_969_332, 0.118_463_442_528_094_54),
    (-0.269_234_655_052_841_55, 0.239_314_335_249_683_24),
    (0.0, 0.284_444_444_444_444_44),
    (0.269_234_655_052_841_55, 0.239_314_335_249_683_24),
    (0.453_089_922_969_332, 0.118_463_442_528_094_54),
];

impl GroundScale {
    /// Metres per unit of height.
    pub fn metres_per_height_unit(&self) -> f64 {
        self.rise
    }

    /// True if all cells have the same area, which then does not depend on the column and row.
    pub fn has_equal_cells(&self) -> bool {
        !matches!(self.across, HorizontalUnit::Degrees(_))
    }

    /// The area of the cell around a sample in square metres; for degrees on the ellipsoid, as far as the cell is not
    /// beyond a pole. It is the same along a row where [`is_by_row`](Self::is_by_row).
    pub fn cell_area(&self, col: f64, row: f64) -> f64 {
        let spheroid = match self.across {
            HorizontalUnit::Everywhere(metres) => {
                return self.map.determinant().abs() * metres * metres;
            }
            HorizontalUnit::Degrees(spheroid) => spheroid,
        };
        // Square metres per square degree.
        let density = |latitude: f64| {
            let [east, north] = spheroid.degree_metres(latitude);
            (east * north).max(0.0)
        };
        let middle = self.map.apply(col, row)[1];
        if self.map.d == 0.0 {
            // Latitudes of the cell, up to the pole.
            let half = self.map.e.abs() / 2.0;
            let [south, north] = [middle - half, middle + half].map(|edge| edge.clamp(-90.0, 90.0));
            let [center, height] = [(south + north) / 2.0, north - south];
            let strip: f64 = NODES.iter().map(|(at, by)| by * density(center + at * height)).sum();
            return strip * height * self.map.a.abs();
        }
        let Affine { d, e, .. } = self.map;
        let nodes = NODES.iter().flat_map(|across| NODES.map(|down| (across, down)));
        let mean: f64 =
            nodes.map(|((x, by), (y, weight))| by * weight * density(middle + x * d + y * e)).sum();
        mean * self.map.determinant().abs()
    }
}

fn across(crs: &Crs, notes: &mut Vec<String>) -> Result<HorizontalUnit> {
    if crs.horizontal_unit() == "degree" {
        let remedy = "pass ‹scale›, the height units in one degree";
        return spheroid(crs, notes).map(HorizontalUnit::Degrees).map_err(|e| e.or(remedy));
    }
    Ok(HorizontalUnit::Everywhere(crs.horizontal_metres().unwrap_or_else(|| {
        notes.push("the unit of x and y is unknown; metres are assumed".to_owned());
        1.0
    })))
}

fn rise(crs: &Crs, across: HorizontalUnit, notes: &mut Vec<String>) -> Result<f64> {
    match (crs.vertical_metres(), crs.heights_unit(), across) {
        (Some(metres), ..) => Ok(metres),
        (None, Some(unit), _) => {
            Err(Error::unsupported(format!("the height unit {unit:?} is not a known length"))
                .remedy("use a grid with heights in metres or feet"))
        }
        (None, None, HorizontalUnit::Everywhere(metres)) => {
            notes.push("the height unit is unknown; the unit of x and y is assumed".into());
            Ok(metres)
        }
        (None, None, HorizontalUnit::Degrees(_)) => {
            notes.push("the height unit is unknown; metres are assumed".to_owned());
            Ok(1.0)
        }
    }
}

/// Fails if the centre of a cell is beyond a pole. The map is affine: checking corners suffices.
fn check_latitudes(map: &Affine, Rect { width, height, .. }: Rect) -> Result<()> {
    let [columns, rows] = [width, height].map(|samples| [0.5, (f64::from(samples) - 1.5).max(0.5)]);
    let corners = columns.into_iter().flat_map(|col| rows.map(|row| map.apply(col, row)));
    let beyond = corners.map(|[_, latitude]| latitude).find(|latitude| latitude.abs() >= 90.0);
    beyond.map_or(Ok(()), |latitude| {
        Err(Error::bad_input(format!("latitude {latitude} is outside -90 to 90 degrees"))
            .remedy("correct the CRS of the grid"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;
    use terrane_proof::slope::turned;
    use terrane_raster::SampleType;

    fn info(transform: Affine, crs: Crs) -> GridInfo {
        GridInfo { transform, crs, ..GridInfo::plain("test", 10, 10, SampleType::F64) }
    }

    /// The slopes by column and row of a plane with the given slopes by x and y.
    fn by_lattice(map: &Affine, [by_x, by_y]: [f64; 2]) -> [f64; 2] {
        [by_x * map.a + by_y * map.d, by_x * map.b + by_y * map.e]
    }

    fn is_near(a: [f64; 2], b: [f64; 2]) -> bool {
        (0..2).all(|i| (a[i] - b[i]).abs() < 1e-9 * (1.0 + b[i].abs()))
    }

    #[test]
    fn any_axes_and_units_are_turned_to_metres() {
        let map = Affine { x0: 5.0, a: 3.0, b: 1.0, y0: 6.0, d: 0.5, e: -2.0 };
        let lattice = by_lattice(&map, [0.2, -0.7]);
        let plain = GroundScale::of(&info(map, Crs::default())).unwrap();
        assert!(is_near(turned(plain.turn(3.5, 4.5), lattice), [0.2, -0.7]));
        assert_eq!(plain.notes().len(), 2);
        let unit = |epsg, unit: &str| Crs {
            epsg: Some(epsg),
            vertical_unit: Some(unit.to_owned()),
            ..Crs::default()
        };
        let feet_on_metres = GroundScale::of(&info(map, unit(32_631, "foot"))).unwrap();
        let [x, y] = turned(feet_on_metres.turn(3.5, 4.5), lattice);
        assert!(
            is_near([x / 0.3048, y / 0.3048], [0.2, -0.7]) && feet_on_metres.notes().is_empty()
        );
        let metres_on_feet = GroundScale::of(&info(map, unit(2263, "metre"))).unwrap();
        let [x, y] = turned(metres_on_feet.turn(3.5, 4.5), lattice);
        let foot = 1200.0 / 3937.0;
        assert!(is_near([x * foot, y * foot], [0.2, -0.7]));
        let odd = GroundScale::of(&info(map, unit(32_631, "sazhen"))).unwrap_err();
        assert!(
            odd.kind() == ErrorKind::Unsupported && odd.to_string().contains("sazhen"),
            "{odd}"
        );
    }

    #[test]
    fn degrees_are_as_long_as_at_the_middle_of_the_cell() {
        let degrees = Crs { geographic: Some(true), ..Crs::default() };
        let map = Affine { x0: 7.0, a: 0.5, b: 0.0, y0: 60.25, d: 0.0, e: -0.5 };
        let ground = GroundScale::of(&info(map, degrees.clone())).unwrap();
        let [x, y] = turned(ground.turn(2.5, 0.5), by_lattice(&map, [1.0, 1.0]));
        // Metres of a degree at 60 degrees north (WGS 84).
        assert!((1.0 / x - 55_800.0).abs() < 1.0 && (1.0 / y - 111_412.0).abs() < 1.0, "{x} {y}");
        assert!(ground.turn(2.5, 9.5)[0][0] < ground.turn(2.5, 0.5)[0][0]);
        let pole = Affine { y0: 90.25, ..map };
        assert!(GroundScale::of(&info(pole, degrees.clone())).is_err());
        let up_to_it = Affine { y0: 90.0, ..map };
        assert!(GroundScale::of(&info(up_to_it, degrees)).is_ok());
    }

    #[test]
    fn areas_of_cells_are_those_of_the_plane_or_of_the_ellipsoid() {
        let map = Affine { x0: 5.0, a: 3.0, b: 1.0, y0: 6.0, d: 0.5, e: -2.0 };
        let feet =
            Crs { epsg: Some(2263), vertical_unit: Some("metre".to_owned()), ..Crs::default() };
        let ground = GroundScale::of(&info(map, feet)).unwrap();
        let foot = 1200.0_f64 / 3937.0;
        assert!(
            (ground.cell_area(3.0, 4.0) - 6.5 * foot * foot).abs() < 1e-12
                && ground.has_equal_cells()
        );
        assert_eq!(ground.metres_per_height_unit(), 1.0);
        let degrees = Crs { geographic: Some(true), ..Crs::default() };
        let rows = |rows: u32, map: Affine| {
            let info = GridInfo { height: rows, ..info(map, degrees.clone()) };
            let ground = GroundScale::of(&info).unwrap();
            (0..rows).map(|row| ground.cell_area(7.0, f64::from(row))).sum::<f64>()
        };
        // From the equator to a latitude the area per radian is known in closed form.
        let band = |latitude: f64| {
            let (axis, squared) = (6_378_137.0_f64, 0.006_694_379_990_141_316_f64);
            let (sine, e) = (latitude.to_radians().sin(), squared.sqrt());
            let polar = axis * axis * (1.0 - squared) / 2.0;
            polar * (sine / (1.0 - squared * sine * sine) + (e * sine).atanh() / e)
        };
        let of = |side: f64, north: f64| {
            let map = Affine { x0: 1.0, a: side, b: 0.0, y0: north, d: 0.0, e: -side };
            (map, side.to_radians())
        };
        let (map, across) = of(1.0, 89.5);
        let whole = rows(180, map) / (2.0 * band(90.0) * across);
        assert!((whole - 1.0).abs() < 1e-13, "{whole}");
        // The surface of the earth.
        assert!((rows(180, map) * 360.0 / 510_065_621_724_088.0 - 1.0).abs() < 1e-12);
        let (map, across) = of(10.0, 45.0);
        let part = rows(3, map) / ((band(50.0) - band(20.0)) * across);
        assert!((part - 1.0).abs() < 1e-10, "{part}");
        // Samples on the poles have half a cell.
        let (map, across) = of(2.0, 90.0);
        let half = rows(91, map) / (2.0 * band(90.0) * across);
        assert!((half - 1.0).abs() < 1e-12, "{half}");
        // A turned lattice has the area of its parallelogram.
        let turned = Affine { x0: 1.0, a: 0.06, b: 0.08, y0: 50.0, d: 0.08, e: -0.06 };
        let ground = GroundScale::of(&info(turned, degrees.clone())).unwrap();
        let latitude = turned.apply(5.0, 5.0)[1];
        let [east, north] = Spheroid::WGS84.degree_metres(latitude);
        let ratio = ground.cell_area(5.0, 5.0) / (0.01 * east * north);
        assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
    }
}
