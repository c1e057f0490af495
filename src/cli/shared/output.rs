//! Output: results on stdout, messages on stderr, files by the user's names. A closed reader is not an error.

use std::io::{self, Write};

use serde::Serialize;

use crate::cli::shared::pipes::display;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::frontend::Frontend;
use terrane_engine::json;

/// Prints a result.
pub(crate) fn result(text: &str) -> Result<()> {
    to_stdout(display(&below_title(text)).as_bytes())
}

/// A result with its options spelled, except file names in its first line.
fn below_title(text: &str) -> String {
    let (title, _) = text.split_once('\n').unwrap_or_default();
    let end = if title.contains(" -> ") { title.len() } else { 0 };
    text[..end].to_owned() + &Frontend::CommandLine.spell(&text[end..])
}

/// Prints a result as indented JSON.
pub(crate) fn json(value: &impl Serialize) -> Result<()> {
    to_stdout(pretty(value)?.as_bytes())
}

/// Prints a result as one line of JSON.
pub(crate) fn json_line(value: &impl Serialize) -> Result<()> {
    let text = json::to_string(value).map_err(not_json)?;
    let text = Frontend::CommandLine.spell_report(&text);
    to_stdout((display(&text) + "\n").as_bytes())
}

/// A value as indented JSON with a line end.
pub(crate) fn pretty(value: &impl Serialize) -> Result<String> {
    let text = json::to_string_pretty(value).map_err(not_json)?;
    let text = Frontend::CommandLine.spell_report(&text);
    Ok((display(&text) + "\n").into_owned())
}

fn not_json(error: serde_json::Error) -> Error {
    Error::io(ErrorKind::Io, "write a report", error.into())
}

/// Writes bytes to stdout as they are.
pub(crate) fn to_stdout(bytes: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::io(ErrorKind::Io, "write to stdout", e))
        }
        _ => Ok(()),
    }
}

/// Prints a result on stderr.
pub(crate) fn aside(text: &str) {
    flushed(io::stderr().write_all(display(&below_title(text)).as_bytes()));
}

/// Prints an error on stderr, on one line; a collection of errors on a line each, with the total last.
pub(crate) fn error(error: &Error) {
    let door = Frontend::CommandLine;
    error.each().iter().for_each(|inner| failure(&inner.spelled(door).to_string()));
    failure(&error.summary(door));
}

/// Prints an error message on stderr, on one line.
pub(crate) fn failure(message: &str) {
    flushed(writeln!(io::stderr(), "terrane: error: {}", one_line(message)));
}

/// Prints unjudged checks on stderr, on one line.
pub(crate) fn not_judged(what: &str) {
    flushed(writeln!(
        io::stderr(),
        "terrane: not judged: {}",
        one_line(&Frontend::CommandLine.spell(what))
    ));
}

/// Prints a note on stderr, on one line.
pub(crate) fn note(message: &str) {
    flushed(writeln!(io::stderr(), "terrane: {}", one_line(&Frontend::CommandLine.spell(message))));
}

fn one_line(message: &str) -> String {
    display(message).chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Ignores a closed reader.
pub(crate) fn flushed(written: io::Result<()>) {
    let _ = written.and_then(|()| io::stdout().flush());
}
