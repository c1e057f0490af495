//! The names that a verb is given: those of inputs and, last of all, that of the output.

use std::path::PathBuf;

use clap::error::ErrorKind::MissingRequiredArgument;

/// What the names are called in the help.
pub(super) const NAMES: [&str; 2] = ["INPUT", "OUTPUT"];

/// Takes the output off the names. An option may stand between them, so that only at the end of the
/// command line it is known which name is the last.
pub(super) fn take_output<N: Into<PathBuf>>(
    names: &mut Vec<N>,
    output: &mut PathBuf,
) -> Result<(), clap::Error> {
    match names.pop() {
        Some(last) if !names.is_empty() => {
            *output = last.into();
            Ok(())
        }
        _ => {
            let message = "name an input and, last of all, the file to write";
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
            let mut names: Vec<PathBuf> = few.iter().map(PathBuf::from).collect();
            assert!(take_output(&mut names, &mut PathBuf::new()).is_err(), "{few:?}");
        }
    }
}
