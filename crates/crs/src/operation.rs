//! Coordinate operations between two CRSs.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Datum, wkt};

use super::area::{AreaOfUse, FAR, NEAR};
use super::geoid::Geoid;
use super::heights::HeightOperation;
use super::ntv2::ShiftGrid;
use super::projection::Projection;
use super::shift::{Ellipsoid, Helmert};
use super::table::{self, KnownDatumShift};

/// Optional inputs of an operation.
#[derive(Clone, Debug, Default)]
pub struct CoordinateOperationOptions {
    /// Extent of the data in the source CRS, if known: x and y low, x and y high. The best datum shift for the whole
    /// extent is used, and longitudes continue beyond 180 degrees where it does.
    pub extent: Option<[f64; 4]>,
    /// Shift grid between the datums of the two CRSs, in either direction.
    pub shift_grid: Option<Arc<ShiftGrid>>,
    /// Geoid heights above the ellipsoid.
    pub geoid: Option<Arc<Geoid>>,
}

/// A coordinate operation, horizontal and vertical.
#[derive(Clone)]
pub struct CoordinateOperation {
    from: Projection,
    to: Projection,
    legs: Vec<DatumShift>,
    rise: HeightOperation,
    /// Central longitude of the results in a geographic target.
    about: Option<f64>,
    systems: [Crs; 2],
    name: String,
    accuracy: Option<f64>,
    notes: Vec<String>,
}

/// A datum shift; places are longitudes and latitudes in radians.
#[derive(Clone)]
enum DatumShift {
    Helmert { shift: Helmert, ellipsoids: [Ellipsoid; 2], area: AreaOfUse, is_back: bool },
    Grid { grid: Arc<ShiftGrid>, is_back: bool },
}

/// Tolerance, in metres, of ellipsoidal heights when a shift is inverted.
const LEVEL: f64 = 1e-5;

/// Positions of [`CoordinateOperation::transform_line`] for each that is checked.
const CHECK_INTERVAL: usize = 16;
/// Maximum distance of a position from its point at equal steps between the checked ones, in steps. Farther positions
/// are checked individually.
const MAX_DEVIATION: f64 = 0.25;

impl CoordinateOperation {
    /// The operation between two CRSs.
    ///
    /// # Errors
    /// CRSs without a known position on the globe, unknown projections, datum shifts and vertical transformations,
    /// and data across the edge of the target's map; each by name.
    pub fn between(from: &Crs, to: &Crs, options: &CoordinateOperationOptions) -> Result<Self> {
        let target = to.with_heights_of(from);
        let (of_source, of_target) = (from.conversion()?, to.conversion()?);
        let source = Projection::new(&of_source, from.label())?;
        let sink = Projection::new(&of_target, to.label())?;
        let area = options.extent.map(|extent| area(&source, extent)).transpose()?;
        if let Some(area) = &area {
            check_edge(&sink, area, &to.label())?;
        }
        let mut notes = Vec::new();
        let datums = [&of_source.datum, &of_target.datum];
        check_bodies(datums)?;
        let DatumShiftPath { legs, accuracy, name } = match &options.shift_grid {
            Some(grid) => {
                let is_back = grid.is_back(datums)?;
                let legs = vec![DatumShift::Grid { grid: grid.clone(), is_back }];
                DatumShiftPath { legs, accuracy: None, name: grid.name(is_back) }
            }
            None => shift(datums, area.as_ref(), &mut notes)?,
        };
        let rise = HeightOperation::between(
            [from, to],
            !legs.is_empty(),
            options.geoid.as_ref(),
            &mut notes,
        )?;
        let about = area.as_ref().filter(|_| sink.is_geographic()).map(AreaOfUse::middle);
        if sink.is_geographic() && area.as_ref().is_some_and(AreaOfUse::crosses_180) {
            notes.push(
                "longitudes continue beyond 180 degrees to keep the data contiguous".to_owned(),
            );
        }
        let systems = [from.clone(), target];
        Ok(Self { from: source, to: sink, legs, rise, about, systems, name, accuracy, notes })
    }

    /// To longitude and latitude on WGS 84, in degrees. Heights are kept.
    ///
    /// # Errors
    /// Like [`between`](Self::between).
    pub fn to_wgs84(from: &Crs, extent: Option<[f64; 4]>) -> Result<Self> {
        let options =
            CoordinateOperationOptions { extent, ..CoordinateOperationOptions::default() };
        Self::between(from, &wkt::of_srs("EPSG:4326"), &options)
    }

    /// The inverse operation.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let [from, to] = self.systems.clone();
        Self {
            from: self.to.clone(),
            to: self.from.clone(),
            legs: self.legs.iter().rev().map(DatumShift::inverse).collect(),
            rise: self.rise.inverse(),
            about: self.about,
            systems: [to, from],
            name: self.name.clone(),
            accuracy: self.accuracy,
            notes: self.notes.clone(),
        }
    }

    /// Transforms a position. Takes some hundred nanoseconds, without allocation.
    ///
    /// # Errors
    /// Positions outside the domain of the projection or of the datum shift.
    pub fn position(&self, at: [f64; 2]) -> Result<[f64; 2]> {
        let mut place = self.from.to_globe(at)?;
        for leg in &self.legs {
            place = leg.apply(place)?;
        }
        Ok(self.settled(self.to.of_globe(place)?))
    }

    /// Transforms neighbouring positions on a line; those that cannot be transformed become NaN. The same as
    /// [`position`](Self::position) for each, at half the cost: one in sixteen is checked by its inverse, and the others
    /// must lie near the points at equal steps between the checked ones.
    pub fn transform_line(&self, line: &mut [[f64; 2]]) {
        let checked = |at: &[f64; 2]| self.position(*at).unwrap_or([f64::NAN; 2]);
        let Some((first, rest)) = line.split_first_mut() else { return };
        let mut before = checked(first);
        *first = before;
        for run in rest.chunks_mut(CHECK_INTERVAL) {
            let (mut own, count) = ([[0.0; 2]; CHECK_INTERVAL], run.len());
            own[..count].copy_from_slice(run);
            let after = checked(&own[count - 1]);
            self.unchecked(run);
            let step = [0, 1].map(|i| (after[i] - before[i]) / count as f64);
            let most = MAX_DEVIATION * step[0].hypot(step[1]);
            for ((place, at), own) in (1..).zip(run).zip(&own) {
                let strays = [0, 1].map(|i| at[i] - (before[i] + step[i] * f64::from(place)));
                // False for NaN.
                let is_near = strays[0].abs() <= most && strays[1].abs() <= most;
                if !is_near {
                    *at = checked(own);
                }
            }
            before = after;
        }
    }

    /// Transforms positions without checks.
    fn unchecked(&self, places: &mut [[f64; 2]]) {
        self.from.unproject_all(places);
        for leg in &self.legs {
            for at in places.iter_mut() {
                *at = leg.apply(*at).unwrap_or([f64::NAN; 2]);
            }
        }
        self.to.project_all(places);
        for at in places {
            *at = self.settled(*at);
        }
    }

    /// Transforms a position and a height. Heights do not affect positions.
    ///
    /// # Errors
    /// Like [`position`](Self::position); places without a geoid height.
    pub fn point(&self, [x, y, z]: [f64; 3]) -> Result<[f64; 3]> {
        let [east, north] = self.position([x, y])?;
        let z = match &self.rise {
            HeightOperation::Times(factor) => z * factor,
            HeightOperation::ToEllipsoid(geoid, metres) => {
                z * metres + geoid.height(degrees(&self.to, [east, north]))?
            }
            HeightOperation::ToGeoid(geoid, metres) => {
                (z - geoid.height(degrees(&self.from, [x, y]))?) / metres
            }
        };
        Ok([east, north, z])
    }

    /// Moves longitudes next to the data.
    fn settled(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.about.filter(|_| self.to.is_geographic()) {
            Some(about) if (x - about).abs() > 180.0 => {
                [x + 360.0 * ((about - x) / 360.0).round(), y]
            }
            _ => [x, y],
        }
    }

    /// The target CRS; with the vertical CRS of the source if it has none.
    pub fn target(&self) -> &Crs {
        &self.systems[1]
    }

    /// The source CRS.
    pub fn source(&self) -> &Crs {
        &self.systems[0]
    }

    /// Name of the operation, in one line.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Accuracy of positions in metres, as stated by EPSG; 0 without a datum shift, `None` if unknown, as for a shift
    /// grid.
    pub fn accuracy(&self) -> Option<f64> {
        self.accuracy
    }

    /// Notes for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// True if heights are unchanged.
    pub fn keeps_heights(&self) -> bool {
        matches!(self.rise, HeightOperation::Times(1.0))
    }

    /// True if longitudes and latitudes are unchanged but for rounding: both CRSs have one datum and one ellipsoid.
    pub fn keeps_degrees(&self) -> bool {
        self.legs.is_empty() && self.from.has_degrees_of(&self.to)
    }

    /// True if x and y are unchanged, to the last bit.
    pub fn is_null(&self) -> bool {
        let [from, to] = &self.systems;
        from.agrees(to) && matches!(self.rise, HeightOperation::Times(1.0))
    }
}

/// Longitude and latitude of a position in degrees.
fn degrees(projection: &Projection, at: [f64; 2]) -> [f64; 2] {
    projection.unproject(at).map(|globe| globe.map(f64::to_degrees)).unwrap_or(at)
}

impl DatumShift {
    fn inverse(&self) -> Self {
        match self.clone() {
            Self::Helmert { shift, ellipsoids, area, is_back } => {
                Self::Helmert { shift: shift.inverse(), ellipsoids, area, is_back: !is_back }
            }
            Self::Grid { grid, is_back } => Self::Grid { grid, is_back: !is_back },
        }
    }

    fn apply(&self, place: [f64; 2]) -> Result<[f64; 2]> {
        match self {
            Self::Helmert { shift, ellipsoids: [own, wgs84], area, is_back } => {
                check_area(area, place)?;
                let [longitude, latitude] = place;
                if !is_back {
                    let at = own.to_centre([longitude, latitude, 0.0]);
                    let [longitude, latitude, _] = wgs84.of_centre(shift.apply(at));
                    return Ok([longitude, latitude]);
                }
                // The place on the other ellipsoid that the shift maps to this one.
                let (mut height, mut found) = (0.0, [0.0; 3]);
                for _ in 0..4 {
                    let at = wgs84.to_centre([longitude, latitude, height]);
                    found = own.of_centre(shift.apply(at));
                    if found[2].abs() < LEVEL {
                        break;
                    }
                    height -= found[2];
                }
                Ok([found[0], found[1]])
            }
            Self::Grid { grid, is_back } => grid.apply(place, *is_back),
        }
    }
}

fn check_area(area: &AreaOfUse, place: [f64; 2]) -> Result<()> {
    let [longitude, latitude] = place.map(f64::to_degrees);
    if area.has([longitude, latitude]) {
        return Ok(());
    }
    let place = format!("longitude {longitude:.4}, latitude {latitude:.4}");
    let AreaOfUse { west, south, east, north } = area;
    Err(Error::unsupported(format!(
        "{place} is outside the area of use of the datum shift (longitude {west} to {east}, latitude {south} to \
             {north})"
    ))
    .remedy("transform the parts separately, or pass a shift grid (‹shift_grid› FILE)"))
}

/// Datum shifts applied one after the other.
struct DatumShiftPath {
    legs: Vec<DatumShift>,
    /// Metres, if known.
    accuracy: Option<f64>,
    name: String,
}

/// The shift between two datums by way of WGS 84.
fn shift(
    datums: [&Datum; 2],
    area: Option<&AreaOfUse>,
    notes: &mut Vec<String>,
) -> Result<DatumShiftPath> {
    if is_same(datums) {
        let name = "the same datum".to_owned();
        return Ok(DatumShiftPath { legs: Vec::new(), accuracy: Some(0.0), name });
    }
    let (mut legs, mut accuracy, mut names) = (Vec::new(), 0.0, Vec::new());
    for (datum, is_back) in datums.into_iter().zip([false, true]) {
        if datum.code == Some(table::WGS84) {
            continue;
        }
        let known = choose_operation(datum, datums, area)?;
        accuracy += known.accuracy;
        names.push(format!("{} (EPSG:{})", known.name, known.code));
        let ellipsoid = Ellipsoid::new(datum.axis, datum.flattening);
        let is_alike =
            (datum.axis - 6_378_137.0).abs() < 1.0 && (datum.flattening - 298.257).abs() < 0.01;
        if known.is_null() && is_alike {
            let name = datum.name.replace('_', " ");
            notes.push(format!(
                "the datum {name} is treated as WGS 84 (accuracy {} m)",
                known.accuracy
            ));
            continue;
        }
        if area.is_some_and(|area| !known.area.holds(area, NEAR)) {
            notes.push(format!(
                "some data lie up to {FAR} degrees outside the area of use of {} and may be less accurate",
                known.name
            ));
        }
        let shift = Helmert::new(known.numbers);
        let shift = if is_back { shift.inverse() } else { shift };
        let ellipsoids = [ellipsoid, Ellipsoid::WGS84];
        legs.push(DatumShift::Helmert { shift, ellipsoids, area: known.area, is_back });
    }
    Ok(DatumShiftPath { legs, accuracy: Some(accuracy), name: names.join(", back by ") })
}

/// Ellipsoids of the Earth differ by less than this fraction of their size.
const ONE_BODY: f64 = 0.02;

/// Fails if the datums are on different celestial bodies, such as the Moon and the Earth.
fn check_bodies(datums: [&Datum; 2]) -> Result<()> {
    let [from, to] = datums.map(|datum| datum.axis);
    if (from - to).abs() <= ONE_BODY * from.max(to) {
        return Ok(());
    }
    let [a, b] = datums.map(|datum| datum.name.replace('_', " "));
    Err(Error::unsupported(format!(
        "the datums {a} and {b} are on different celestial bodies (radii {from} and {to} m)"
    ))
    .remedy("use a CRS of the same body"))
}

fn is_same([a, b]: [&Datum; 2]) -> bool {
    match (a.code, b.code) {
        (Some(a), Some(b)) => a == b,
        (None, None) => a == b,
        _ => false,
    }
}

/// The shift of a datum to WGS 84 for an area, or the one with the largest area.
fn choose_operation(
    datum: &Datum,
    [from, to]: [&Datum; 2],
    area: Option<&AreaOfUse>,
) -> Result<KnownDatumShift> {
    let known = datum.code.map(table::shifts).unwrap_or_default();
    let first = known.first().copied();
    let chosen = match (first, area) {
        (Some(first), _) if first.is_null() => Some(first),
        (_, Some(area)) => [NEAR, FAR]
            .into_iter()
            .find_map(|slack| known.iter().find(|known| known.area.holds(area, slack)).copied()),
        (_, None) => known.iter().copied().max_by(|a, b| {
            // The first of several equal ones counts; it is the best.
            a.area.size().total_cmp(&b.area.size()).then(std::cmp::Ordering::Greater)
        }),
    };
    chosen.ok_or_else(|| {
        let [name, from, to] = [datum, from, to].map(|datum| datum.name.replace('_', " "));
        let place = match first {
            Some(_) => " for the whole extent of the data",
            None => "",
        };
        Error::unsupported(format!(
            "datum {from} to {to}: no shift from {name} to WGS 84 is known{place}"
        ))
        .remedy(
            "pass a shift grid (‹shift_grid› FILE), or reproject the data with GDAL or PDAL first",
        )
    })
}

/// The area in degrees covered by a rectangle of a CRS.
fn area(system: &Projection, [x0, y0, x1, y1]: [f64; 4]) -> Result<AreaOfUse> {
    const STEPS: u32 = 16;
    let all = (0..=STEPS).flat_map(|c| (0..=STEPS).map(move |r| [c, r]));
    let steps = std::iter::once([STEPS / 2; 2]).chain(all);
    let places = steps.map(|step| {
        let [u, v] = step.map(|step| f64::from(step) / f64::from(STEPS));
        [x0 + (x1 - x0) * u, y0 + (y1 - y0) * v]
    });
    let places: Vec<[f64; 2]> = places.collect();
    let Some(first) = places.iter().find_map(|at| system.to_globe(*at).ok()) else {
        // None of them can be transformed: the error of one explains it.
        return system.to_globe(places[0]).map(|_| AreaOfUse {
            west: 0.0,
            south: 0.0,
            east: 0.0,
            north: 0.0,
        });
    };
    let is_geographic = system.is_geographic();
    let pairs = places.iter().filter_map(|at| Some((*at, system.to_globe(*at).ok()?)));
    let mut area = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
    for (at, globe) in pairs {
        // Longitudes of the input are not wrapped; others continue those of the first place.
        let east = match is_geographic {
            true => at[0].to_radians(),
            false => first[0] + (globe[0] - first[0] + PI).rem_euclid(TAU) - PI,
        };
        area = [area[0].min(east), area[1].min(globe[1]), area[2].max(east), area[3].max(globe[1])];
    }
    for pole in [-FRAC_PI_2, FRAC_PI_2] {
        let inside = system
            .of_globe([0.0, pole])
            .is_ok_and(|[x, y]| !is_geographic && x0 <= x && x <= x1 && y0 <= y && y <= y1);
        if inside {
            area = [-PI, area[1].min(pole), PI, area[3].max(pole)];
        }
    }
    let [west, south, east, north] = area.map(f64::to_degrees);
    Ok(AreaOfUse { west, south, east, north })
}

/// Fails if data cross the edge of a map.
fn check_edge(target: &Projection, area: &AreaOfUse, label: &str) -> Result<()> {
    let Some(cut) = target.cut().map(f64::to_degrees) else { return Ok(()) };
    let has_pole = area.east - area.west >= 360.0 && (area.north >= 90.0 || area.south <= -90.0);
    if target.is_geographic() {
        return match has_pole && area.north - area.south < 180.0 {
            true => Err(Error::unsupported(format!(
                "the data surround a pole, where {label} is discontinuous"
            ))
            .remedy("use a polar CRS such as EPSG:3413 or EPSG:3031")),
            false => Ok(()),
        };
    }
    let into = (cut - area.west).rem_euclid(360.0);
    let is_inside = into > 1e-9 && into < area.east - area.west - 1e-9;
    match is_inside {
        true => Err(Error::unsupported(format!(
            "the data cross the meridian {:.4}, where {label} is discontinuous",
            (cut + 180.0).rem_euclid(360.0) - 180.0
        ))
        .remedy("process both sides separately, or use another CRS")),
        false => Ok(()),
    }
}
