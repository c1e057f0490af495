//! The statistics a cell can have: one file for those that keep the same, the registry, and how they are
//! asked for.

mod count;
mod extremes;
mod idw;
mod moments;
mod nearest;
mod percentile;
mod surface;

use serde::{Deserialize, Serialize};

use super::block::Cell;
use super::plane::Primitive;
use super::recipe::{Region, Rules};
use terrane_base::error::{Error, Result};
use terrane_base::registry::{Named, named};

pub use idw::{MOST_POWER, check_power};
pub use surface::Shape;

/// A statistic of the registry with its parameters.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(into = "Stored", try_from = "Stored")]
pub struct Statistic {
    method: &'static Method,
    values: Values,
}

/// Parameters in the order of the method's; the rank of a percentile.
type Values = [Option<f64>; 2];

impl PartialEq for Statistic {
    fn eq(&self, other: &Self) -> bool {
        self.method.name == other.method.name && self.values == other.values
    }
}

impl Statistic {
    /// Its name in the registry.
    pub fn name(&self) -> &'static str {
        self.method.name
    }

    /// True for values in the unit of heights.
    pub fn is_height(&self) -> bool {
        !self.method.counts
    }

    /// True for whole numbers of points.
    pub fn is_whole(&self) -> bool {
        self.method.whole
    }

    /// True when a cell without points has a value, which is 0.
    pub fn counts(&self) -> bool {
        self.method.counts
    }

    /// The value of a parameter that was given.
    pub fn parameter(&self, key: &str) -> Option<f64> {
        self.place(key).and_then(|at| self.values[at])
    }

    /// The rank of a percentile, 0 to 100.
    pub fn rank(&self) -> Option<f64> {
        self.values[0].filter(|_| self.method.ranks)
    }

    /// True when it has a parameter of this name that was not given, so that the job's counts.
    pub fn lacks(&self, key: &str) -> bool {
        self.place(key).is_some_and(|at| self.values[at].is_none())
    }

    fn place(&self, key: &str) -> Option<usize> {
        self.method.parameters.iter().position(|parameter| parameter.key == key)
    }

    /// What surface it is the height of, if it is made of all points and not of those of a cell.
    pub fn shape(&self) -> Option<Shape> {
        match self.method.of {
            Of::Points { .. } => None,
            Of::All(shape) => Some(shape(self)),
        }
    }

    /// The height of the surface that is linear in the triangulation of all points, but for triangles with
    /// an edge longer than `max_edge`, in world units.
    pub fn linear(max_edge: Option<f64>) -> Self {
        Self { method: &surface::TIN, values: [max_edge, None] }
    }

    /// The points that it is of, and what has to be kept of them.
    pub(super) fn needs(&self, rules: &Rules) -> (Region, Vec<Primitive>) {
        match self.method.of {
            Of::Points { needs, .. } => needs(self, rules),
            Of::All(_) => (rules.own(), Vec::new()),
        }
    }

    /// Its value in a cell; NaN where there is none.
    pub(super) fn value(&self, cell: &Cell<'_>) -> f64 {
        match self.method.of {
            Of::Points { value, .. } => value(self, cell),
            // Cells know nothing of the points around them.
            Of::All(_) => f64::NAN,
        }
    }
}

/// A statistic as plans have it.
#[derive(Serialize, Deserialize)]
struct Stored {
    name: String,
    values: Values,
}

impl From<Statistic> for Stored {
    fn from(statistic: Statistic) -> Self {
        Self { name: statistic.name().to_owned(), values: statistic.values }
    }
}

impl TryFrom<Stored> for Statistic {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self> {
        let method = named(METHODS, &stored.name)?;
        Ok(Self { method, values: stored.values })
    }
}

/// One statistic of the registry.
#[derive(Debug)]
pub struct Method {
    /// Name for `--stat`, unique.
    pub name: &'static str,
    /// Other names.
    pub aliases: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// What may follow its name.
    pub parameters: &'static [Parameter],
    /// It tells of points, and not of heights: a cell without any has the value 0.
    counts: bool,
    /// Its values are whole numbers.
    whole: bool,
    /// It is a percentile, whose rank is in its name.
    ranks: bool,
    check: fn(&Given) -> Result<Values>,
    of: Of,
}

/// What a statistic is made of.
#[derive(Clone, Copy, Debug)]
enum Of {
    /// Of some points.
    Points {
        /// Of which, and what has to be kept of them.
        needs: fn(&Statistic, &Rules) -> (Region, Vec<Primitive>),
        /// The value that is made of it, in world units.
        value: fn(&Statistic, &Cell<'_>) -> f64,
    },
    /// Of all points, as the height of this surface.
    All(fn(&Statistic) -> Shape),
}

impl Method {
    /// What most have in common, to be completed: a height without parameters.
    const HEIGHT: Self = Self {
        name: "",
        aliases: &[],
        about: "",
        parameters: &[],
        counts: false,
        whole: false,
        ranks: false,
        check: |_| Ok([None; 2]),
        of: Of::Points { needs: |_, rules| (rules.own(), Vec::new()), value: |_, _| f64::NAN },
    };
}

/// A parameter of a statistic, a number.
#[derive(Debug)]
pub struct Parameter {
    /// Its name.
    pub key: &'static str,
    /// One line for the documentation, with the default.
    pub about: &'static str,
}

const RADIUS: Parameter =
    Parameter { key: "radius", about: "points nearer than this to the cell's centre [--radius]" };

/// All statistics. A new one is a file in this folder and a line here.
pub const METHODS: &[Method] = &[
    count::COUNT,
    count::DENSITY,
    extremes::MIN,
    extremes::MAX,
    extremes::RANGE,
    moments::MEAN,
    moments::STD,
    idw::IDW,
    nearest::NEAREST,
    percentile::MEDIAN,
    percentile::PERCENTILE,
    surface::TIN,
    surface::NATURAL,
];

/// Parameters as given.
#[derive(Debug, Default)]
struct Given {
    rank: Option<f64>,
    values: Vec<(String, f64)>,
}

impl Given {
    fn value(&self, key: &str) -> Option<f64> {
        self.values.iter().find(|(k, _)| k == key).map(|(_, value)| *value)
    }

    fn positive(&self, key: &str) -> Result<Option<f64>> {
        match self.value(key) {
            Some(value) if value <= 0.0 => {
                Err(Error::usage(format!("{key}={value} is not above zero")))
            }
            value => Ok(value),
        }
    }
}

/// A statistic that is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    /// What it is.
    pub statistic: Statistic,
    /// As asked for, by its own name: what its band is called.
    pub label: String,
}

/// The statistics of a list such as "mean,p95,idw:radius=2,power=1".
///
/// # Errors
/// Usage: a name or parameter that is not known (the known ones are told), or a statistic twice.
pub fn parse_list(text: &str) -> Result<Vec<Asked>> {
    let mut asked: Vec<Asked> = Vec::new();
    for item in items(text) {
        let one = parse(&item)?;
        if asked.iter().any(|other| other.label == one.label) {
            return Err(Error::usage(format!("the statistic {} is asked for twice", one.label)));
        }
        asked.push(one);
    }
    Ok(asked)
}

impl Named for Method {
    const KIND: &'static str = "statistic";

    fn name(&self) -> &'static str {
        self.name
    }

    fn aliases(&self) -> &'static [&'static str] {
        self.aliases
    }
}

/// Items between commas; "key=value" goes with the item before it.
fn items(text: &str) -> Vec<String> {
    let mut items: Vec<String> = Vec::new();
    for piece in text.split(',').map(str::trim) {
        match items.last_mut() {
            Some(last) if piece.contains('=') && !piece.contains(':') => {
                *last = format!("{last},{piece}");
            }
            _ => items.push(piece.to_lowercase()),
        }
    }
    items
}

fn parse(item: &str) -> Result<Asked> {
    let (name, parameters) = item.split_once(':').unwrap_or((item, ""));
    let rank = name.strip_prefix('p').and_then(|rank| rank.parse::<f64>().ok());
    let method = named(METHODS, rank.map_or(name, |_| percentile::PERCENTILE.name))?;
    let given = Given { rank, values: values(method, parameters)? };
    let statistic = Statistic { method, values: (method.check)(&given)? };
    let mut label = if rank.is_some() { name } else { method.name }.to_owned();
    if !parameters.is_empty() {
        label = format!("{label}:{parameters}");
    }
    Ok(Asked { statistic, label })
}

fn values(method: &Method, text: &str) -> Result<Vec<(String, f64)>> {
    let mut values: Vec<(String, f64)> = Vec::new();
    for pair in text.split(',').filter(|pair| !pair.is_empty()) {
        let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
        let known = method.parameters.iter().any(|p| p.key == key);
        let value = value.parse::<f64>().ok().filter(|value| value.is_finite());
        match value {
            Some(value) if known && values.iter().all(|(k, _)| k != key) => {
                values.push((key.to_owned(), value));
            }
            _ => return Err(refusal(method, pair)),
        }
    }
    Ok(values)
}

fn refusal(method: &Method, pair: &str) -> Error {
    let error = Error::usage(format!("\"{pair}\" is no parameter of {}", method.name));
    let keys: Vec<String> = method.parameters.iter().map(|p| format!("{}=NUMBER", p.key)).collect();
    match keys.is_empty() {
        true => error.remedy(format!("{} takes none", method.name)),
        false => error.remedy(format!("it takes {}", keys.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_with_parameters_and_other_names() {
        let asked = parse_list("mean, AVG:,idw:radius=2,power=1.5,p99.9,std:ddof=1").unwrap_err();
        assert!(asked.to_string().contains("mean is asked for twice"), "{asked}");
        let asked = parse_list("lowest,idw:radius=2,power=1.5,p99.9,std:ddof=1,median").unwrap();
        let labels: Vec<_> = asked.iter().map(|a| a.label.as_str()).collect();
        assert_eq!(labels, ["min", "idw:radius=2,power=1.5", "p99.9", "std:ddof=1", "median"]);
        let idw = asked[1].statistic;
        assert_eq!((idw.name(), idw.parameter("radius")), ("idw", Some(2.0)));
        assert_eq!((idw.parameter("power"), idw.lacks("radius")), (Some(1.5), false));
        assert_eq!(
            (asked[2].statistic.name(), asked[2].statistic.values),
            ("pN", [Some(99.9), None])
        );
        assert_eq!(asked[3].statistic.parameter("ddof"), Some(1.0));
        assert_eq!(asked[4].statistic.values, [Some(50.0), None]);
    }

    #[test]
    fn what_is_not_known_is_told_with_what_is() {
        for wrong in [
            "",
            "mode",
            "mean:radius=2",
            "idw:power=0",
            "idw:power=9",
            "idw:radius=-1",
            "p101",
            "idw:radius",
            "idw:radius=1,radius=2",
            "std:ddof=2",
            "idw:radius=nan",
            "mean,,max",
        ] {
            assert!(parse_list(wrong).is_err(), "{wrong}");
        }
        let told = parse_list("mode").unwrap_err().to_string();
        assert!(METHODS.iter().all(|m| told.contains(m.name)), "{told}");
        let told = parse_list("idw:r=1").unwrap_err().to_string();
        assert!(told.contains("radius=NUMBER, power=NUMBER"), "{told}");
    }

    #[test]
    fn what_plans_hold_is_read_again() {
        let all = "count,min,idw:radius=2,idw:power=0.1,p99.9,tin:max_edge=7,natural,std:ddof=1";
        for asked in parse_list(all).unwrap() {
            let again = Statistic::try_from(Stored::from(asked.statistic)).unwrap();
            assert_eq!(again, asked.statistic, "{}", asked.label);
        }
        assert!(Statistic::try_from(Stored { name: "mode".into(), values: [None; 2] }).is_err());
    }

    #[test]
    fn names_are_unique() {
        let all = METHODS.iter().flat_map(|m| m.aliases.iter().chain([&m.name]));
        let mut names: Vec<_> = all.collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), METHODS.iter().map(|m| m.aliases.len() + 1).sum::<usize>());
    }
}
