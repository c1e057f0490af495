//! A projection and its inverse, checked at every position.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use proj4rs::Proj;
use proj4rs::transform::{Transform, TransformClosure, transform};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Conversion;

/// Round-trip tolerance: a millimetre, in radii of the earth.
const SLACK: f64 = 1e-3 / 6_378_137.0;

/// Projections with a discontinuity at the meridian opposite to the central one.
const CUT: [&str; 16] = [
    "longlat", "latlong", "merc", "webmerc", "lcc", "aea", "leac", "eqdc", "eqc", "cea", "mill",
    "moll", "robin", "sinu", "poly", "eqearth",
];

/// A CRS without its datum: longitudes and latitudes are in radians, on its ellipsoid.
#[derive(Clone)]
pub(crate) struct Projection {
    proj: Proj,
    /// Geographic CRS on the same ellipsoid, from Greenwich.
    globe: Proj,
    label: String,
}

impl Projection {
    pub(crate) fn new(conversion: &Conversion, label: String) -> Result<Self> {
        let name = conversion.proj.split(['=', ' ']).nth(1).unwrap_or_default();
        let refuse = |error: proj4rs::errors::Error| {
            let what = format!("the projection \"{name}\" is not supported: {error}");
            Error::unsupported(what).at(&label).remedy("reproject the data with GDAL or PDAL first")
        };
        let proj = Proj::from_proj_string(&conversion.proj).map_err(refuse)?;
        let (a, b) = proj.ellipse_parameters();
        let globe = Proj::from_proj_string(&format!("+proj=longlat +a={a} +b={b}"));
        let globe = globe.map_err(refuse)?;
        if !proj.has_inverse() || !proj.has_forward() {
            return Err(refuse(proj4rs::errors::Error::NoInverseProjectionDefined));
        }
        Ok(Self { proj, globe, label })
    }

    pub(crate) fn is_geographic(&self) -> bool {
        self.proj.is_latlong()
    }

    /// True for longitudes and latitudes on the same ellipsoid, from the same meridian.
    pub(crate) fn has_degrees_of(&self, other: &Self) -> bool {
        let [own, other] = [self, other].map(|crs| {
            (crs.is_geographic(), crs.proj.ellipse_parameters(), crs.proj.from_greenwich())
        });
        own.0 && own == other
    }

    /// The meridian at which the map is discontinuous, in radians, if any.
    pub(crate) fn cut(&self) -> Option<f64> {
        let is_cut = CUT.contains(&self.proj.projname());
        is_cut.then(|| self.proj.longitude_of_origin() + self.proj.from_greenwich() + PI)
    }

    /// Longitude and latitude of a position.
    pub(crate) fn to_globe(&self, at: [f64; 2]) -> Result<[f64; 2]> {
        let checked = self.unproject(at).and_then(|globe| {
            if self.is_geographic() {
                return Some(globe);
            }
            let back = self.project(globe)?;
            self.is_near(at, back).then_some(globe)
        });
        checked.ok_or_else(|| self.beyond(&format!("{}, {}", at[0], at[1])))
    }

    /// The position of a longitude and latitude.
    pub(crate) fn of_globe(&self, globe: [f64; 2]) -> Result<[f64; 2]> {
        let checked = self.project(globe).filter(|at| {
            self.is_geographic()
                || self.unproject(*at).is_some_and(|back| is_one_place(globe, back))
        });
        checked.ok_or_else(|| {
            let [longitude, latitude] = globe.map(f64::to_degrees);
            self.beyond(&format!("longitude {longitude}, latitude {latitude}"))
        })
    }

    /// Unchecked projection of places; NaN where it fails.
    pub(crate) fn project_all(&self, places: &mut [[f64; 2]]) {
        let done = transform(&self.globe, &self.proj, &mut Places(places));
        let is_geographic = self.is_geographic();
        for at in places {
            *at = if is_geographic { at.map(f64::to_degrees) } else { *at };
            let is_found = done.is_ok() && at[0].is_finite() && at[1].is_finite();
            *at = if is_found { *at } else { [f64::NAN; 2] };
        }
    }

    /// Unchecked inverse projection of positions; NaN where it fails.
    pub(crate) fn unproject_all(&self, places: &mut [[f64; 2]]) {
        if self.is_geographic() {
            for at in places.iter_mut() {
                *at = at.map(f64::to_radians);
                let is_far = at[1].abs() > FRAC_PI_2 || at[0].abs() > 2.0 * TAU;
                *at = if is_far { [f64::NAN; 2] } else { *at };
            }
        }
        let done = transform(&self.proj, &self.globe, &mut Places(places));
        for at in places {
            let is_found = done.is_ok() && at[0].is_finite() && at[1].abs() <= FRAC_PI_2 + 1e-12;
            *at = match is_found {
                true => [at[0], at[1].clamp(-FRAC_PI_2, FRAC_PI_2)],
                false => [f64::NAN; 2],
            };
        }
    }

    /// Unchecked inverse projection.
    pub(crate) fn unproject(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let mut place = [at];
        self.unproject_all(&mut place);
        Some(place[0]).filter(|[longitude, _]| !longitude.is_nan())
    }

    fn project(&self, globe: [f64; 2]) -> Option<[f64; 2]> {
        let mut place = [globe];
        self.project_all(&mut place);
        Some(place[0]).filter(|[x, _]| !x.is_nan())
    }

    fn is_near(&self, a: [f64; 2], b: [f64; 2]) -> bool {
        match self.is_geographic() {
            true => is_one_place(a.map(f64::to_radians), b.map(f64::to_radians)),
            false => {
                let metres = self.proj.to_meter();
                let radius = self.proj.ellipse_parameters().0;
                (a[0] - b[0]).hypot(a[1] - b[1]) * metres <= SLACK * radius
            }
        }
    }

    fn beyond(&self, place: &str) -> Error {
        Error::bad_input(format!("{place} is outside the domain of {}", self.label))
            .remedy("clip the data, or use another CRS")
    }
}

/// Places that are transformed together, step by step. One that fails becomes NaN and is left alone.
struct Places<'a>(&'a mut [[f64; 2]]);

impl Transform for Places<'_> {
    fn transform_coordinates<F: TransformClosure>(
        &mut self,
        step: &mut F,
    ) -> proj4rs::errors::Result<()> {
        for at in self.0.iter_mut().filter(|at| !at[0].is_nan()) {
            *at = step(at[0], at[1], 0.0).map_or([f64::NAN; 2], |(x, y, _)| [x, y]);
        }
        Ok(())
    }
}

/// True for the same place on the globe, in radians.
fn is_one_place(a: [f64; 2], b: [f64; 2]) -> bool {
    // Longitudes a whole turn apart are one place, and at a pole all are: hence the cosine below.
    let east = (a[0] - b[0] + PI).rem_euclid(TAU) - PI;
    (east * a[1].cos()).hypot(a[1] - b[1]) <= SLACK
}
