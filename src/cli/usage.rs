//! Usage errors on one line; help and version as clap lays them out.

use std::process::ExitCode;

use clap::error::ErrorKind::{
    DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion,
};

use crate::cli::say;
use crate::error::ErrorKind;

/// Prints what clap has to say and returns the exit code.
pub(super) fn report(error: &clap::Error) -> ExitCode {
    match error.kind() {
        DisplayHelp | DisplayVersion => {
            say::flushed(error.print());
            ExitCode::SUCCESS
        }
        DisplayHelpOnMissingArgumentOrSubcommand => {
            say::flushed(error.print());
            ErrorKind::Usage.exit_code().into()
        }
        _ => {
            say::failure(&one_line(&error.render().to_string()));
            ErrorKind::Usage.exit_code().into()
        }
    }
}

/// A clap error without its usage block, joined into a line, with where to read on.
fn one_line(text: &str) -> String {
    let message = text.split("\n\nUsage:").next().unwrap_or(text);
    let message = message.split("\n\nFor more information").next().unwrap_or(message);
    let words: Vec<&str> = message.split_whitespace().collect();
    let message = words.join(" ");
    let message = message.strip_prefix("error: ").unwrap_or(&message);
    let message = message.replace(" tip: ", "; ");
    format!("{message}; see `{} --help`", command_of(text))
}

/// The command that the usage block is about: "terrane tin".
fn command_of(text: &str) -> String {
    let usage = text.split("Usage: ").nth(1).unwrap_or("terrane");
    let words = usage.split_whitespace().take_while(|w| w.chars().all(|c| c.is_ascii_lowercase()));
    words.take(2).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::help::command;

    fn line(args: &[&str]) -> String {
        let args = std::iter::once("terrane").chain(args.iter().copied());
        one_line(&command().try_get_matches_from(args).unwrap_err().render().to_string())
    }

    #[test]
    fn clap_errors_become_one_line_with_a_remedy() {
        assert_eq!(
            line(&["tni"]),
            "unrecognized subcommand 'tni'; a similar subcommand exists: 'tin'; \
             see `terrane --help`"
        );
        assert_eq!(
            line(&["tin", "a.tif", "b.ply"]),
            "the following required arguments were not provided: \
             <--max-error <E>|--max-vertices <N>|--max-triangles <N>>; see `terrane tin --help`"
        );
        let twice = line(&["tin", "a", "b", "--max-error", "1", "--max-vertices", "9"]);
        assert!(twice.contains("cannot be used with") && !twice.contains('\n'), "{twice}");
        let negative = line(&["tin", "a", "b", "--max-error", "-1"]);
        assert!(negative.contains("zero or more") && !negative.contains('\n'), "{negative}");
    }
}
