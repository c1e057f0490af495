//! Usage errors on one line; help and version in clap's layout.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Command;
use clap::error::ErrorKind::{
    DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion,
};

use crate::cli::shared::output;
use terrane_base::error::ErrorKind;
use terrane_base::frontend::Frontend;

/// Prints clap's message for a command line and returns the exit code.
pub(super) fn report(error: &clap::Error, args: &[OsString], command: &Command) -> ExitCode {
    match error.kind() {
        DisplayHelp | DisplayVersion => {
            output::flushed(error.print());
            ExitCode::SUCCESS
        }
        DisplayHelpOnMissingArgumentOrSubcommand => {
            output::flushed(error.print());
            ErrorKind::Usage.exit_code().into()
        }
        _ => {
            let text = one_line(&error.render().to_string(), args, command);
            output::failure(&Frontend::CommandLine.spell(&text));
            ErrorKind::Usage.exit_code().into()
        }
    }
}

/// A clap error on one line without its usage block, with a pointer to the help.
fn one_line(text: &str, args: &[OsString], command: &Command) -> String {
    let message = text.split("\n\nUsage:").next().unwrap_or(text);
    let message = message.split("\n\nFor more information").next().unwrap_or(message);
    let words: Vec<&str> = message.split_whitespace().collect();
    let message = words.join(" ");
    let message = message.strip_prefix("error: ").unwrap_or(&message);
    let message = message.replace(" tip: ", "; ");
    format!("{message}; see `terrane{} --help`", verb(args, command))
}

/// " tin" or " plan grid" if the command line has a verb.
fn verb(args: &[OsString], command: &Command) -> String {
    let Some((first, rest)) = args.get(1..).and_then(<[OsString]>::split_first) else {
        return String::new();
    };
    match command.find_subcommand(first) {
        Some(found) => {
            let rest: Vec<_> = args.iter().take(1).chain(rest).cloned().collect();
            format!(" {}{}", first.display(), verb(&rest, found))
        }
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(args: &[&str]) -> String {
        let args: Vec<OsString> =
            std::iter::once("terrane").chain(args.iter().copied()).map(OsString::from).collect();
        let command = crate::cli::command();
        let error = command.clone().try_get_matches_from(&args).unwrap_err();
        one_line(&error.render().to_string(), &args, &command)
    }

    #[test]
    fn clap_errors_become_one_line_with_a_remedy() {
        assert_eq!(
            line(&["verfy"]),
            "unrecognized subcommand 'verfy'; a similar subcommand exists: 'verify'; \
             see `terrane --help`"
        );
        assert_eq!(
            line(&["plan", "tin", "a.tif", "--max-error", "1"]),
            "the following required arguments were not provided: --output <FOLDER>; \
             see `terrane plan tin --help`"
        );
        let twice = line(&[
            "plan",
            "tin",
            "a",
            "-o",
            "w",
            "--max-error",
            "1",
            "--cut",
            "1",
            "--strip-rows",
            "2",
        ]);
        assert!(twice.contains("cannot be used with") && !twice.contains('\n'), "{twice}");
        let negative = line(&["tin", "a", "b", "--max-error", "-1"]);
        assert!(
            negative.contains("zero or more")
                && negative.contains("terrane tin --help")
                && !negative.contains('\n'),
            "{negative}"
        );
    }
}
