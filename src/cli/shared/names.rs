//! Names on the command line: inputs, and the output last.

use std::path::PathBuf;

use clap::builder::TypedValueParser;
use clap::error::ErrorKind::MissingRequiredArgument;

use terrane_files::{name_of, path_of};

/// Names in the help.
pub(crate) const NAMES: [&str; 2] = ["INPUT", "OUTPUT"];

/// A name of any bytes that the system allows.
pub(crate) fn any() -> impl TypedValueParser<Value = String> {
    clap::builder::OsStringValueParser::new().try_map(|name| name_of(PathBuf::from(name)))
}

/// Takes the output from the end of the names. Options may stand between them, so the last name is known only
/// at the end of the command line.
pub(crate) fn take_output(
    names: &mut Vec<String>,
    output: &mut PathBuf,
) -> Result<(), clap::Error> {
    match names.pop() {
        Some(last) if !names.is_empty() => {
            *output = path_of(&last).into_owned();
            Ok(())
        }
        _ => {
            let message = "output file missing: pass the input, then the output";
            Err(clap::Error::raw(MissingRequiredArgument, message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_name_is_the_output() {
        let mut output = PathBuf::new();
        let mut names = ["a", "b", "c"].map(str::to_owned).to_vec();
        take_output(&mut names, &mut output).unwrap();
        assert_eq!((names.as_slice(), output), (&["a", "b"].map(str::to_owned)[..], "c".into()));
        for few in [&[][..], &["a"]] {
            let mut names: Vec<String> = few.iter().map(|&name| name.to_owned()).collect();
            assert!(take_output(&mut names, &mut PathBuf::new()).is_err(), "{few:?}");
        }
    }
}
