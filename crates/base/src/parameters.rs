//! Numeric parameters after the name of a registry entry: `csf:rigidness=2,cloth=0.5`.

use std::fmt;

use crate::error::{Error, Result};

/// A numeric parameter.
#[derive(Debug)]
pub struct Parameter {
    /// Its name.
    pub key: &'static str,
    /// One line for the documentation, with the unit.
    pub about: &'static str,
    /// Default; NaN if it depends on the data.
    pub default: f64,
    /// Minimum and maximum.
    pub range: [f64; 2],
    /// True for integers.
    pub whole: bool,
    /// True if only the minimum and the maximum are allowed.
    pub ends: bool,
}

/// Text of a value that depends on the data.
const AUTO: &str = "auto";

impl Parameter {
    /// A number within a range, both ends included.
    pub const fn new(
        key: &'static str,
        default: f64,
        range: [f64; 2],
        about: &'static str,
    ) -> Self {
        Self { key, about, default, range, whole: false, ends: false }
    }

    /// Restricts the parameter to integers.
    pub const fn whole(self) -> Self {
        Self { whole: true, ..self }
    }

    /// Restricts the parameter to the ends of the range.
    pub const fn ends(self) -> Self {
        Self { ends: true, ..self }
    }

    /// The parameter with its default: `cloth=1`.
    pub fn usual(&self) -> String {
        self.with(self.default)
    }

    /// Whether a value is allowed.
    pub fn allows(&self, value: f64) -> bool {
        let [min, max] = self.range;
        let is_auto = value.is_nan() && self.default.is_nan();
        is_auto
            || match self.ends {
                true => self.range.contains(&value),
                false => (min..=max).contains(&value) && (!self.whole || value.fract() == 0.0),
            }
    }

    /// Parses an allowed value.
    fn parse(&self, text: &str) -> Option<f64> {
        let value = match text.eq_ignore_ascii_case(AUTO) {
            true => f64::NAN,
            false => text.parse().ok().filter(|value: &f64| !value.is_nan())?,
        };
        self.allows(value).then_some(value)
    }

    fn with(&self, value: f64) -> String {
        match value.is_nan() {
            true => format!("{}={AUTO}", self.key),
            false => format!("{}={value}", self.key),
        }
    }

    fn text(&self) -> String {
        let [min, max] = self.range;
        if self.ends {
            return format!("{} ({min} or {max})", self.usual());
        }
        let kind = if self.whole { "a whole number " } else { "" };
        format!("{} ({kind}from {min} to {max})", self.usual())
    }
}

/// Maximum number of parameters of an entry.
pub const MAX_PARAMETERS: usize = 6;

/// Parameter values of an entry, in order.
#[derive(Clone, Copy, Debug)]
pub struct ParameterValues([f64; MAX_PARAMETERS]);

impl PartialEq for ParameterValues {
    /// Values that depend on the data are equal.
    fn eq(&self, other: &Self) -> bool {
        self.0.map(f64::to_bits) == other.0.map(f64::to_bits)
    }
}

impl ParameterValues {
    /// The defaults.
    pub const fn usual(parameters: &[Parameter]) -> Self {
        let (mut values, mut i) = ([0.0; MAX_PARAMETERS], 0);
        while i < parameters.len() {
            values[i] = parameters[i].default;
            i += 1;
        }
        Self(values)
    }

    /// Parses the parameters of the entry `name`: `rigidness=2,cloth=0.5`; omitted ones have their defaults.
    ///
    /// # Errors
    /// Usage: an unknown parameter (the message lists the known ones), a repeated one, or a value out of range.
    pub fn parse(name: &str, parameters: &[Parameter], text: &str) -> Result<Self> {
        let (mut values, mut given) = (Self::usual(parameters), [false; MAX_PARAMETERS]);
        for pair in text.split(',').map(str::trim).filter(|pair| !pair.is_empty()) {
            let (at, value) =
                value_of(parameters, pair).ok_or_else(|| refusal(name, parameters, pair))?;
            if std::mem::replace(&mut given[at], true) {
                return Err(Error::usage(format!("\"{pair}\" is given twice")));
            }
            values.0[at] = value;
        }
        Ok(values)
    }

    /// The value of a parameter; NaN if it is unknown or depends on the data.
    pub fn get(&self, parameters: &[Parameter], key: &str) -> f64 {
        let at = parameters.iter().position(|p| p.key == key);
        at.map_or(f64::NAN, |at| self.0[at])
    }

    /// Writes the name and all values in the syntax of [`parse`](Self::parse).
    ///
    /// # Errors
    /// Errors of the formatter.
    pub fn write(
        &self,
        name: &str,
        parameters: &[Parameter],
        f: &mut fmt::Formatter<'_>,
    ) -> fmt::Result {
        f.write_str(name)?;
        parameters.iter().zip(self.0).enumerate().try_for_each(|(i, (parameter, value))| {
            write!(f, "{}{}", if i == 0 { ':' } else { ',' }, parameter.with(value))
        })
    }
}

/// Index and value of a parameter "key=value".
fn value_of(parameters: &[Parameter], pair: &str) -> Option<(usize, f64)> {
    let (key, value) = pair.split_once('=')?;
    let at = parameters.iter().position(|p| p.key.eq_ignore_ascii_case(key.trim()))?;
    Some((at, parameters[at].parse(value.trim())?))
}

fn refusal(name: &str, parameters: &[Parameter], pair: &str) -> Error {
    let error = Error::usage(format!("\"{pair}\" is not a parameter of {name}"));
    match parameters {
        [] => error.remedy(format!("{name} takes none")),
        some => {
            let known: Vec<String> = some.iter().map(Parameter::text).collect();
            error.remedy(format!("it takes {}", known.join(", ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOME: &[Parameter] = &[
        Parameter::new("edge", f64::NAN, [0.0, 9.0], "by the data"),
        Parameter::new("rounds", 3.0, [1.0, 5.0], "how often").whole(),
        Parameter::new("side", 7.0, [7.0, 18.0], "one or the other").ends(),
    ];

    struct Shown(ParameterValues);

    impl fmt::Display for Shown {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            self.0.write("tool", SOME, f)
        }
    }

    #[test]
    fn values_are_read_as_they_are_written() {
        let read = |text: &str| ParameterValues::parse("tool", SOME, text).unwrap();
        assert_eq!(read(""), ParameterValues::usual(SOME));
        assert_eq!(Shown(read("")).to_string(), "tool:edge=auto,rounds=3,side=7");
        assert_eq!(read("edge=AUTO,rounds=3"), read(""));
        let given = read("rounds = 5, EDGE=0.5");
        assert_eq!((given.get(SOME, "edge"), given.get(SOME, "rounds")), (0.5, 5.0));
        assert!(read("").get(SOME, "edge").is_nan() && given.get(SOME, "other").is_nan());
        assert_ne!(given, read(""));
        assert_eq!(Shown(given).to_string(), "tool:edge=0.5,rounds=5,side=7");
    }

    #[test]
    fn what_is_no_value_is_told_with_what_is() {
        let told = |text: &str| ParameterValues::parse("tool", SOME, text).unwrap_err().to_string();
        for wrong in ["edge=-1", "edge=nan", "edge", "rounds=auto", "rounds=1.5", "side=8", "hue=1"]
        {
            let told = told(wrong);
            assert!(told.contains("edge=auto (from 0 to 9), rounds=3 (a whole number"), "{told}");
        }
        assert!(told("side=8").contains("side=7 (7 or 18)"));
        assert!(told("edge=1,edge=1").contains("twice"));
        let none = ParameterValues::parse("spade", &[], "edge=1").unwrap_err().to_string();
        assert!(none.contains("spade takes none"), "{none}");
    }
}
