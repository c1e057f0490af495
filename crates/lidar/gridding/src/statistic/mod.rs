//! The statistics of cells: one file for each family of accumulators, the registry, and the parser.

mod count;
mod distribution;
mod extremes;
mod idw;
mod method;
mod mode;
mod moments;
mod nearest;
mod percentile;
mod share;
mod sorted;
mod surface;

use serde::{Deserialize, Serialize};

use crate::dimension::Subject;
use crate::parameter::GivenParameters;
use method::StoredStatistic;
use terrane_base::error::{Error, Result};
use terrane_base::registry::named;

pub use idw::{MAX_POWER, check_power};
pub use method::{Statistic, StatisticMethod, SurfaceInterpolation};

/// All statistics. A new one is a file in this folder and a line here.
pub const METHODS: &[StatisticMethod] = &[
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
    distribution::SKEWNESS,
    distribution::KURTOSIS,
    distribution::ENTROPY,
    mode::MODE,
    mode::VARIETY,
    share::SHARE,
    share::COVER,
    surface::TIN,
    surface::NATURAL,
];

impl TryFrom<StoredStatistic> for Statistic {
    type Error = Error;

    fn try_from(stored: StoredStatistic) -> Result<Self> {
        let method = named(METHODS, &stored.name)?;
        Ok(Self { method, values: stored.values })
    }
}

impl Statistic {
    /// The height of the surface that is linear in the triangulation of all points, but for triangles with
    /// an edge longer than `max_edge`, in world units.
    pub fn linear(max_edge: Option<f64>) -> Self {
        Self { method: &surface::TIN, values: [max_edge, None] }
    }
}

/// A requested statistic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatisticRequest {
    /// The statistic.
    pub statistic: Statistic,
    /// Its canonical text: the name of its band.
    pub label: String,
    /// Its subject.
    #[serde(default, skip_serializing_if = "Subject::is_plain")]
    pub subject: Subject,
}

impl StatisticRequest {
    /// True for values in the unit of heights.
    pub fn is_height(&self) -> bool {
        self.statistic.is_height() && self.subject.attribute.is_none()
    }
}

/// Parses a list of statistics such as "mean,p95,idw:radius=2,power=1".
///
/// # Errors
/// Usage: an unknown name or parameter (the error lists the known ones), or a duplicate statistic.
pub fn parse_list(text: &str) -> Result<Vec<StatisticRequest>> {
    let mut requests: Vec<StatisticRequest> = Vec::new();
    for item in items(text) {
        let request = parse(&item)?;
        if requests.iter().any(|other| other.label == request.label) {
            return Err(Error::usage(format!(
                "the statistic {} is requested twice",
                request.label
            )));
        }
        requests.push(request);
    }
    Ok(requests)
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

fn parse(item: &str) -> Result<StatisticRequest> {
    let (name, parameters) = item.split_once(':').unwrap_or((item, ""));
    let rank = name.strip_prefix('p').and_then(|rank| rank.parse::<f64>().ok());
    let method = named(METHODS, rank.map_or(name, |_| percentile::PERCENTILE.name))?;
    let (values, subject) = read(method, parameters)?;
    let given = GivenParameters { rank, values };
    let statistic = Statistic { method, values: (method.check)(&given)? };
    let mut label = rank.map_or_else(|| method.name.to_owned(), |rank| format!("p{rank}"));
    if !parameters.is_empty() {
        let parameters: Vec<String> = parameters.split(',').map(shortest).collect();
        label = format!("{label}:{}", parameters.join(","));
    }
    let subject = (method.complete)(subject.or_of(method.usual));
    match &subject.attribute {
        Some(name) if subject.is_real() && !method.is_of_reals() => {
            Err(Error::usage(format!("{} is not supported for {name}", method.name))
                .remedy("use min, max, mean or a percentile"))
        }
        _ => Ok(StatisticRequest { statistic, label, subject }),
    }
}

/// A parameter with its number in the fewest digits that identify it.
fn shortest(pair: &str) -> String {
    match pair.split_once('=').map(|(key, value)| (key, value.parse::<f64>())) {
        Some((key, Ok(number))) if number.is_finite() => format!("{key}={number}"),
        _ => pair.to_owned(),
    }
}

/// The parameters of a statistic by name, and its subject.
fn read(method: &StatisticMethod, text: &str) -> Result<(Vec<(String, f64)>, Subject)> {
    let (mut values, mut subject) = (Vec::<(String, f64)>::new(), Subject::default());
    for pair in text.split(',').filter(|pair| !pair.is_empty()) {
        let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
        let is_taken = if method.parameters.iter().any(|own| own.key == key) {
            let number = value.parse::<f64>().ok().filter(|value| value.is_finite());
            let is_new = values.iter().all(|(known, _)| known != key);
            values.extend(number.map(|number| (key.to_owned(), number)));
            is_new && number.is_some()
        } else {
            method.takes.parameters().any(|own| own.key == key) && subject.take(key, value)
        };
        if !is_taken {
            return Err(refusal(method, pair));
        }
    }
    Ok((values, subject))
}

fn refusal(method: &StatisticMethod, pair: &str) -> Error {
    let error = Error::usage(format!("\"{pair}\" is not a parameter of {}", method.name));
    let all = method.parameters.iter().chain(method.takes.parameters());
    let keys: Vec<String> = all.map(|p| format!("{}={}", p.key, p.value)).collect();
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
        assert!(asked.to_string().contains("mean is requested twice"), "{asked}");
        assert!(parse_list("idw:power=1,idw:power=1.0").is_err() && parse_list("p5,p5.0").is_err());
        let asked =
            parse_list("lowest,idw:radius=2.0,power=1.50,p99.90,std:ddof=1,median").unwrap();
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
    fn what_a_statistic_is_of_is_read_with_its_parameters() {
        let list = "max:attribute=Intensity,count:class=6,std:class=9+2,ddof=1,return=last,mean:min=2,max=5,\
                    mode,mode:attribute=user,cover,cover:min=2,max=5,return=2,share:class=2,p95:attribute=Range Bias";
        let asked = parse_list(list).unwrap();
        let of: Vec<&Subject> = asked.iter().map(|asked| &asked.subject).collect();
        let none = Subject::default();
        let attribute = |name: &str| Subject { attribute: Some(name.to_owned()), ..none.clone() };
        assert_eq!(*of[0], attribute("intensity"));
        assert_eq!(*of[1], Subject { classes: Some(vec![6]), ..none.clone() });
        let returns = Some(terrane_base::attribute::Return::Last);
        assert_eq!(*of[2], Subject { classes: Some(vec![2, 9]), returns, ..none.clone() });
        assert_eq!(asked[2].statistic.parameter("ddof"), Some(1.0));
        assert_eq!((of[3].min, of[3].max, of[3].above), (Some(2.0), Some(5.0), None));
        assert_eq!([of[4], of[5]], [&attribute("classification"), &attribute("user_data")]);
        let first = Some(terrane_base::attribute::Return::First);
        assert_eq!((of[6].above, of[6].returns), (Some(2.0), first));
        let second = Some(terrane_base::attribute::Return::Number(2));
        assert_eq!((of[7].above, of[7].min, of[7].returns), (None, Some(2.0), second));
        assert_eq!(of[8].classes, Some(vec![2]));
        assert!(of[9].is_real() && of[9].attribute.as_deref() == Some("range bias"));
        assert_eq!(asked[1].label, "count:class=6");
        let heights = ["mean", "max:attribute=intensity", "mode", "mode:attribute=z", "skewness"];
        let heights = heights.map(|text| parse_list(text).unwrap()[0].is_height());
        assert_eq!(heights, [true, false, false, true, false]);
    }

    #[test]
    fn what_is_not_known_is_told_with_what_is() {
        for wrong in [
            "",
            "modus",
            "mean:radius=2",
            "tin:class=2",
            "natural:attribute=intensity",
            "count:attribute=intensity",
            "idw:attribute=gps_time",
            "nearest:attribute=amplitude",
            "max:attribute=",
            "count:class=2,class=6",
            "count:class=two",
            "cover:above=high",
            "entropy:layer=0",
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
        let told = parse_list("modus").unwrap_err().to_string();
        assert!(METHODS.iter().all(|m| told.contains(m.name)), "{told}");
        let told = parse_list("idw:r=1").unwrap_err().to_string();
        assert!(told.contains("radius=NUMBER, power=NUMBER"), "{told}");
    }

    #[test]
    fn what_plans_hold_is_read_again() {
        let all = "count,min,idw:radius=2,idw:power=0.1,p99.9,tin:max_edge=7,natural,std:ddof=1,entropy:layer=2";
        for asked in parse_list(all).unwrap() {
            let again = Statistic::try_from(StoredStatistic::from(asked.statistic)).unwrap();
            assert_eq!(again, asked.statistic, "{}", asked.label);
        }
        assert!(
            Statistic::try_from(StoredStatistic { name: "modus".into(), values: [None; 2] })
                .is_err()
        );
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
