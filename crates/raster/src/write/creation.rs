//! Creation options, `KEY=VAL` with GDAL's names. Tables list the options of each format; unknown options are
//! rejected with the list of valid ones.

use terrane_base::error::{Error, Result};

/// A creation option of a format.
#[derive(Debug)]
pub struct CreationOption {
    /// Its name, in capitals.
    pub key: &'static str,
    /// Valid values.
    pub accepts: Accepts,
    /// One line for the documentation, with the default.
    pub about: &'static str,
}

/// Valid values of an option.
#[derive(Debug)]
pub enum Accepts {
    /// One of these words, in any case.
    Words(&'static [&'static str]),
    /// An integer within a range, and a multiple of a step.
    Whole {
        /// Minimum.
        least: u32,
        /// Maximum.
        most: u32,
        /// Step.
        step: u32,
    },
}

impl Accepts {
    /// For help and messages: "NONE|DEFLATE", "1 to 12".
    pub fn text(&self) -> String {
        match self {
            Self::Words(words) => words.join("|"),
            Self::Whole { least, most, step: 1 } => format!("{least} to {most}"),
            Self::Whole { least, most, step } => {
                format!("{least} to {most} in steps of {step}")
            }
        }
    }

    fn admit(&self, value: &str) -> bool {
        match *self {
            Self::Words(words) => words.contains(&value),
            Self::Whole { least, most, step } => value
                .parse::<u32>()
                .is_ok_and(|v| (least..=most).contains(&v) && v.is_multiple_of(step)),
        }
    }
}

/// Creation options, validated for one format.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CreationOptions(Vec<(&'static str, String)>);

impl CreationOptions {
    /// Validates `given` against the options of `format`.
    ///
    /// # Errors
    /// Usage: unknown key or value (the message lists the valid ones), or duplicate key.
    pub fn new(
        format: &str,
        options: &'static [CreationOption],
        given: &[(String, String)],
    ) -> Result<Self> {
        let mut found = Self::default();
        for (key, value) in given {
            let (key, value) = (key.to_ascii_uppercase(), value.to_ascii_uppercase());
            let Some(option) = options.iter().find(|option| option.key == key) else {
                return Err(unknown(format, &key, options));
            };
            if !option.accepts.admit(&value) {
                return Err(Error::usage(format!("{key}={value} is not an option of {format}"))
                    .remedy(format!("{key} is {}", option.accepts.text())));
            }
            if found.has(option.key) {
                return Err(Error::usage(format!("{key} is given twice")));
            }
            found.0.push((option.key, value));
        }
        Ok(found)
    }

    /// The value of `key` in capitals, if given.
    pub(super) fn word(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(k, _)| *k == key).map(|(_, value)| value.as_str())
    }

    /// The value of `key` as a number, if given.
    pub(super) fn number(&self, key: &str) -> Option<u32> {
        self.word(key)?.parse().ok()
    }

    /// True if `key` was given.
    pub(super) fn has(&self, key: &str) -> bool {
        self.word(key).is_some()
    }

    /// Fails if `key` was given but is not supported, with the reason `why`.
    pub(super) fn refuse(&self, key: &str, why: &str) -> Result<()> {
        match self.word(key) {
            Some(value) => Err(Error::usage(format!("{key}={value} is not supported {why}"))
                .remedy(format!("omit {key}"))),
            None => Ok(()),
        }
    }
}

fn unknown(format: &str, key: &str, options: &[CreationOption]) -> Error {
    let error = Error::usage(format!("{format} has no creation option {key}"));
    if options.is_empty() {
        return error.remedy("omit ‹co›: the format has no creation options");
    }
    let known: Vec<String> =
        options.iter().map(|o| format!("{}={}", o.key, o.accepts.text())).collect();
    error.remedy(format!("valid options are {}", known.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTIONS: &[CreationOption] = &[
        CreationOption { key: "TILED", accepts: Accepts::Words(&["YES", "NO"]), about: "" },
        CreationOption {
            key: "BLOCKSIZE",
            accepts: Accepts::Whole { least: 64, most: 4096, step: 16 },
            about: "",
        },
    ];

    fn parse(given: &[(&str, &str)]) -> Result<CreationOptions> {
        let given: Vec<_> = given.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        CreationOptions::new("X", OPTIONS, &given)
    }

    #[test]
    fn any_case_is_read() {
        let found = parse(&[("tiled", "yes"), ("BlockSize", "128")]).unwrap();
        assert_eq!((found.word("TILED"), found.number("BLOCKSIZE")), (Some("YES"), Some(128)));
        assert!(found.refuse("TILED", "here").is_err() && found.refuse("LEVEL", "here").is_ok());
    }

    #[test]
    fn what_is_unknown_is_told_with_what_is_known() {
        let wrong: [&[(&str, &str)]; 5] = [
            &[("TILE", "YES")],
            &[("TILED", "MAYBE")],
            &[("BLOCKSIZE", "100")],
            &[("BLOCKSIZE", "-128")],
            &[("TILED", "YES"), ("TILED", "NO")],
        ];
        for given in wrong {
            assert_eq!(
                parse(given).unwrap_err().kind(),
                terrane_base::ErrorKind::Usage,
                "{given:?}"
            );
        }
        let text = parse(&[("TILE", "YES")]).unwrap_err().to_string();
        assert!(text.contains("TILED=YES|NO, BLOCKSIZE=64 to 4096 in steps of 16"), "{text}");
    }
}
