//! Meaning of a CRS, independent of its notation: CRSs are compared by it, and WKT is written from it where the file
//! had none.

use super::method::{ProjectionMethod, ProjectionParameter};
use super::unit::{LengthUnit, plain};

/// Horizontal CRS and optional vertical CRS.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CrsDefinition {
    pub(super) horizontal: Horizontal,
    pub(super) vertical: Option<VerticalCrs>,
}

/// Meaning of x and y.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Horizontal {
    Geographic(GeographicCrs),
    Projected(Projected),
    /// Local (engineering) CRS without a position on the globe.
    Local {
        name: String,
        unit: LengthUnit,
    },
}

/// Geographic CRS: longitude and latitude in degrees.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GeographicCrs {
    pub(super) name: String,
    pub(super) code: Option<u32>,
    pub(super) datum: EpsgName,
    pub(super) ellipsoid: EpsgName,
    /// Semi-major axis, in metres.
    pub(super) axis: f64,
    /// Inverse flattening; 0 for a sphere.
    pub(super) flattening: f64,
    pub(super) meridian: String,
    /// Longitude of the prime meridian, from Greenwich.
    pub(super) from_greenwich: f64,
    /// True if heights above the ellipsoid are included.
    pub(super) is_3d: bool,
}

/// A name with an optional EPSG code.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct EpsgName {
    pub(super) name: String,
    pub(super) code: Option<u32>,
}

/// Projected CRS. Angles are in degrees, lengths in `unit`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Projected {
    pub(super) name: String,
    pub(super) code: Option<u32>,
    pub(super) base: GeographicCrs,
    pub(super) method: &'static ProjectionMethod,
    /// Parameter values in the order of the roles of the method.
    pub(super) values: Vec<f64>,
    pub(super) unit: LengthUnit,
}

/// Vertical CRS: meaning of z.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct VerticalCrs {
    pub(super) name: String,
    pub(super) code: Option<u32>,
    pub(super) datum: EpsgName,
    pub(super) unit: LengthUnit,
    /// True for depths.
    pub(super) is_down: bool,
}

impl Projected {
    /// From the parameters of a file; `None` if a required parameter is missing, or an unknown one has an effect.
    pub(super) fn new(
        EpsgName { name, code }: EpsgName,
        base: GeographicCrs,
        method: &'static ProjectionMethod,
        given: impl Fn(ProjectionParameter) -> Option<f64>,
        unit: LengthUnit,
    ) -> Option<Self> {
        let parallel = given(ProjectionParameter::Parallel1).filter(|_| method.is_tangent());
        let value = |role: ProjectionParameter| match (role, parallel) {
            (ProjectionParameter::Latitude, Some(parallel)) => Some(parallel),
            (ProjectionParameter::Parallel1, Some(_)) => None,
            _ => given(role),
        };
        let is_moved = given(ProjectionParameter::Latitude)
            .is_some_and(|latitude| parallel.is_some_and(|parallel| parallel != latitude));
        let mut others =
            ProjectionParameter::ALL.iter().filter(|role| !method.roles.contains(role));
        let has_effect =
            others.any(|role| value(*role).is_some_and(|number| role.default() != Some(number)));
        if has_effect || (is_moved && method.code == 9) {
            return None;
        }
        let values = method.roles.iter().map(|role| match (value(*role), role) {
            // Without a rectified grid angle, the angle is the azimuth.
            (None, ProjectionParameter::GridAngle) => value(ProjectionParameter::Azimuth),
            (given, role) => given.or(role.default()),
        });
        let values = values.collect::<Option<Vec<f64>>>()?;
        Some(Self { name, code, base, method, values, unit })
    }

    /// The same in another unit; the EPSG code no longer applies.
    pub(super) fn in_unit(mut self, unit: LengthUnit) -> Self {
        let ratio = self.unit.size / unit.size;
        for (role, value) in self.method.roles.iter().zip(&mut self.values) {
            *value *= if role.is_length() { ratio } else { 1.0 };
        }
        Self { code: None, unit, ..self }
    }

    fn same_numbers(&self, other: &Self) -> bool {
        let mut pairs = self.method.roles.iter().zip(self.values.iter().zip(&other.values));
        self.method == other.method
            && self.unit.is(&other.unit)
            && pairs.all(|(role, (a, b))| {
                let size = if role.is_length() { self.unit.size } else { 1.0 };
                (a - b).abs() * size <= role.slack()
            })
    }
}

impl GeographicCrs {
    /// Compares axis, flattening and meridian with these tolerances.
    fn is_within(&self, other: &Self, [axis, flattening, meridian]: [f64; 3]) -> bool {
        (self.axis - other.axis).abs() < axis
            && (self.flattening - other.flattening).abs() < flattening
            && (self.from_greenwich - other.from_greenwich).abs() < meridian
    }

    pub(super) fn same_figure(&self, other: &Self) -> bool {
        self.is_within(other, [1e-3, 1e-7, 1e-8])
    }

    /// Codes are kept when the dataset slightly corrects their ellipsoid or meridian.
    fn about_same_figure(&self, other: &Self) -> bool {
        self.is_within(other, [1.0, 1e-5, 1e-2])
    }

    /// Compares codes, else names of the datum and the CRS in either notation.
    pub(super) fn same_datum(&self, other: &Self) -> bool {
        if let (Some(a), Some(b)) = (self.datum.code, other.datum.code) {
            return a == b;
        }
        let [a, b] = [self, other].map(|crs| [datum_name(&crs.datum.name), datum_name(&crs.name)]);
        let are_unknown = [&a, &b].iter().all(|names| names[0].starts_with("unknown"));
        are_unknown || a.iter().any(|name| b.contains(name) && !name.is_empty())
    }

    /// Properties by name, to show how two CRSs differ.
    fn facts(&self) -> Vec<(&'static str, String)> {
        vec![
            ("datum", self.datum.name.clone()),
            ("ellipsoid", format!("{} {}", self.axis, self.flattening)),
            ("prime meridian", self.from_greenwich.to_string()),
            ("dimensions", if self.is_3d { "3" } else { "2" }.to_owned()),
        ]
    }
}

/// The value of a parameter in a list.
pub(super) fn value_of(
    values: &[(ProjectionParameter, f64)],
    role: ProjectionParameter,
) -> Option<f64> {
    values.iter().find(|(own, _)| *own == role).map(|(_, value)| *value)
}

/// Names of datums as programs write them, and their canonical names.
const DATUMS: &[(&str, &str)] = &[
    ("worldgeodeticsystem1984", "wgs1984"),
    ("worldgeodeticsystem1984ensemble", "wgs1984"),
    ("wgs84", "wgs1984"),
    ("northamericandatum1983", "northamerican1983"),
    ("nad83", "northamerican1983"),
    ("northamericandatum1927", "northamerican1927"),
    ("nad27", "northamerican1927"),
    ("europeanterrestrialreferencesystem1989", "etrs1989"),
    ("europeanterrestrialreferencesystem1989ensemble", "etrs1989"),
    ("etrs89", "etrs1989"),
    ("nad83nationalspatialreferencesystem2011", "nad19832011"),
    ("nad832011", "nad19832011"),
];

/// Canonical name of a datum, without Esri's prefix.
fn datum_name(name: &str) -> String {
    let name = name.strip_prefix("D_").or(name.strip_prefix("GCS_")).unwrap_or(name);
    let name = plain(name);
    DATUMS.iter().find(|pair| pair.0 == name).map_or(name, |pair| pair.1.to_owned())
}

impl Horizontal {
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Geographic(own) => &own.name,
            Self::Projected(own) => &own.name,
            Self::Local { name, .. } => name,
        }
    }

    /// True for the same CRS; names are ignored.
    pub(super) fn same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Geographic(a), Self::Geographic(b)) => {
                a.same_figure(b) && a.same_datum(b) && a.is_3d == b.is_3d
            }
            (Self::Projected(a), Self::Projected(b)) => {
                a.base.same_figure(&b.base) && a.base.same_datum(&b.base) && a.same_numbers(b)
            }
            (Self::Local { name: a, unit: x }, Self::Local { name: b, unit: y }) => {
                a == b && x.is(y)
            }
            _ => false,
        }
    }

    /// True if the parameters contradict `other`: another unit, meridian or ellipsoid. Names and methods that cannot
    /// be compared are assumed equal.
    pub(super) fn contradicts(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Geographic(a), Self::Geographic(b)) => !a.about_same_figure(b),
            (Self::Projected(a), Self::Projected(b)) => {
                !a.base.about_same_figure(&b.base) || (a.method == b.method && !a.same_numbers(b))
            }
            _ => false,
        }
    }

    /// Properties by name, to show how two CRSs differ.
    pub(super) fn facts(&self) -> Vec<(&'static str, String)> {
        match self {
            Self::Geographic(own) => own.facts(),
            Self::Local { name, unit } => vec![("name", name.clone()), ("unit", unit.name.clone())],
            Self::Projected(own) => {
                let mut facts = vec![("method", own.method.name.to_owned())];
                let numbers = own.method.roles.iter().zip(&own.values);
                facts.extend(
                    numbers.map(|(role, value)| (own.method.parameter(*role), value.to_string())),
                );
                facts.push(("unit", own.unit.name.clone()));
                facts.extend(own.base.facts());
                facts
            }
        }
    }
}

impl VerticalCrs {
    /// True for the same vertical CRS, or if one of them has no name.
    pub(super) fn same(&self, other: &Self) -> bool {
        let is_alike = self.is_nameless()
            || other.is_nameless()
            || match (self.datum.code, other.datum.code) {
                (Some(a), Some(b)) => a == b,
                _ => {
                    plain(&self.datum.name) == plain(&other.datum.name)
                        || plain(&self.name) == plain(&other.name)
                }
            };
        is_alike && self.unit.is(&other.unit) && self.is_down == other.is_down
    }

    fn is_nameless(&self) -> bool {
        matches!(plain(&self.datum.name).as_str(), "" | "unknown")
    }
}
