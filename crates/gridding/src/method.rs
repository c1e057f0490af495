//! The statistics a cell can have: the registry, and how they are asked for.

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};

/// A statistic with its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Statistic {
    /// Number of points.
    Count,
    /// Points in a square unit of the CRS.
    Density,
    /// Lowest height.
    Min,
    /// Highest height.
    Max,
    /// Highest minus lowest.
    Range,
    /// Mean height.
    Mean,
    /// Standard deviation of heights, with n - `ddof` (0 or 1) for a divisor.
    Std {
        /// 0: of a population; 1: of a sample.
        ddof: u8,
    },
    /// Mean of the heights within `radius` of the cell's centre, weighted by distance^-`power`.
    Idw {
        /// World units; that of the job when `None`.
        radius: Option<f64>,
        /// At most [`MOST_POWER`]; that of the job when `None`.
        power: Option<f64>,
    },
    /// Height of the point nearest to the cell's centre within `radius`.
    Nearest {
        /// World units; that of the job when `None`.
        radius: Option<f64>,
    },
    /// Height below which `rank` per cent of the points lie, interpolated between neighbours.
    Percentile {
        /// 0 to 100.
        rank: f64,
    },
    /// Height at the cell's centre of the surface that is linear in the Delaunay triangulation of
    /// all points.
    Tin {
        /// Triangles with a longer edge are no surface; world units.
        max_edge: Option<f64>,
    },
    /// Height at the cell's centre from its natural neighbours among all points (Sibson 1981).
    Natural,
}

impl Statistic {
    /// True for values in the unit of heights.
    pub fn is_height(&self) -> bool {
        !matches!(self, Self::Count | Self::Density)
    }
}

/// Greatest power of distance that weights fall off by.
pub const MOST_POWER: f64 = 4.0;

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
    make: fn(&Given) -> Result<Statistic>,
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
const POWER: Parameter =
    Parameter { key: "power", about: "weights are distance^-power, 4 at most [--power]" };
const MAX_EDGE: Parameter = Parameter {
    key: "max_edge",
    about: "triangles with a longer edge are no surface [--max-edge]",
};
const DDOF: Parameter = Parameter {
    key: "ddof",
    about: "0 divides by n, as for a population; 1 by n - 1, as for a sample [0]",
};

/// All statistics. A new one is an entry here and a line where values are told.
pub const METHODS: &[Method] = &[
    Method {
        name: "count",
        aliases: &["n"],
        about: "number of points, 0 where there is none",
        parameters: &[],
        make: |_| Ok(Statistic::Count),
    },
    Method {
        name: "density",
        aliases: &[],
        about: "points in a square unit of the CRS, 0 where there is none",
        parameters: &[],
        make: |_| Ok(Statistic::Density),
    },
    Method {
        name: "min",
        aliases: &["minimum", "lowest"],
        about: "lowest height",
        parameters: &[],
        make: |_| Ok(Statistic::Min),
    },
    Method {
        name: "max",
        aliases: &["maximum", "highest"],
        about: "highest height",
        parameters: &[],
        make: |_| Ok(Statistic::Max),
    },
    Method {
        name: "range",
        aliases: &[],
        about: "highest minus lowest height",
        parameters: &[],
        make: |_| Ok(Statistic::Range),
    },
    Method {
        name: "mean",
        aliases: &["average", "avg"],
        about: "mean height",
        parameters: &[],
        make: |_| Ok(Statistic::Mean),
    },
    Method {
        name: "std",
        aliases: &["stdev", "stddev"],
        about: "standard deviation of heights",
        parameters: &[DDOF],
        make: |given| match given.value("ddof") {
            None | Some(0.0) => Ok(Statistic::Std { ddof: 0 }),
            Some(1.0) => Ok(Statistic::Std { ddof: 1 }),
            Some(other) => Err(Error::usage(format!("ddof={other} is neither 0 nor 1"))),
        },
    },
    Method {
        name: "idw",
        aliases: &[],
        about: "mean of the heights within a radius, weighted by inverse distance",
        parameters: &[RADIUS, POWER],
        make: |given| {
            let power = given.positive("power")?;
            check_power(power.unwrap_or(1.0))?;
            Ok(Statistic::Idw { radius: given.positive("radius")?, power })
        },
    },
    Method {
        name: "nearest",
        aliases: &[],
        about: "height of the point nearest to the cell's centre within a radius",
        parameters: &[RADIUS],
        make: |given| Ok(Statistic::Nearest { radius: given.positive("radius")? }),
    },
    Method {
        name: "median",
        aliases: &[],
        about: "median height, the same as p50",
        parameters: &[],
        make: |_| Ok(Statistic::Percentile { rank: 50.0 }),
    },
    Method {
        name: PERCENTILE,
        aliases: &[],
        about: "percentile, such as p95 or p99.9, interpolated between neighbours",
        parameters: &[],
        make: |given| match given.rank {
            Some(rank) if (0.0..=100.0).contains(&rank) => Ok(Statistic::Percentile { rank }),
            _ => Err(Error::usage("a percentile is p0 to p100")),
        },
    },
    Method {
        name: "tin",
        aliases: &["linear"],
        about: "height at the cell's centre, linear in the Delaunay triangulation of all points",
        parameters: &[MAX_EDGE],
        make: |given| Ok(Statistic::Tin { max_edge: given.positive("max_edge")? }),
    },
    Method {
        name: "natural",
        aliases: &["sibson"],
        about: "height at the cell's centre from its natural neighbours among all points",
        parameters: &[],
        make: |_| Ok(Statistic::Natural),
    },
];

/// Name of the percentiles, N being the rank.
const PERCENTILE: &str = "pN";

/// Fails unless weights can fall off by this power of the distance.
pub fn check_power(power: f64) -> Result<()> {
    if power > 0.0 && power <= MOST_POWER {
        return Ok(());
    }
    Err(Error::usage(format!("the power {power} of distances is not above 0 and at most 4")))
}

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
    let is_it = |m: &&Method| match rank {
        Some(_) => m.name == PERCENTILE,
        None => m.name == name || m.aliases.contains(&name),
    };
    let method = METHODS.iter().find(is_it).ok_or_else(|| unknown(name))?;
    let given = Given { rank, values: values(method, parameters)? };
    let statistic = (method.make)(&given)?;
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

fn unknown(name: &str) -> Error {
    let names: Vec<_> = METHODS.iter().map(|m| m.name).collect();
    Error::usage(format!("unknown statistic \"{name}\""))
        .remedy(format!("known are {}", names.join(", ")))
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
        assert_eq!(asked[1].statistic, Statistic::Idw { radius: Some(2.0), power: Some(1.5) });
        assert_eq!(asked[2].statistic, Statistic::Percentile { rank: 99.9 });
        assert_eq!(asked[3].statistic, Statistic::Std { ddof: 1 });
        assert_eq!(asked[4].statistic, Statistic::Percentile { rank: 50.0 });
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
    fn names_are_unique() {
        let all = METHODS.iter().flat_map(|m| m.aliases.iter().chain([&m.name]));
        let mut names: Vec<_> = all.collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), METHODS.iter().map(|m| m.aliases.len() + 1).sum::<usize>());
    }
}
