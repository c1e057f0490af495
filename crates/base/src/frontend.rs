//! Names of options in messages: `‹max_error›`, or with a value `‹memory=64M›`; each front end spells them for its
//! users.
//!
//! A library cannot know whether `max_error` was given on the command line or in Python. Its errors and notes
//! therefore put the name of the field between two marks that no other text contains. Rust callers read them as they
//! are. Commands are marked likewise, by their name on the command line: `‹terrane plan tin›`.

use std::borrow::Cow;

/// Opening mark of an option.
const OPEN: char = '‹';
/// Closing mark of an option.
const CLOSE: char = '›';

/// A front end with its own spelling of options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frontend {
    /// `--max-error`, `--memory 64M`, `--no-drop`.
    CommandLine,
    /// `max_error`, `memory='64M'`, `drop=False`.
    Python,
}

impl Frontend {
    /// A message with its options spelled.
    ///
    /// ```
    /// use terrane_base::frontend::Frontend;
    /// let remedy = "raise ‹max_error›, or pass ‹memory=64M› and ‹drop=false›";
    /// assert_eq!(Frontend::CommandLine.spell(remedy), "raise --max-error, or pass --memory 64M and --no-drop");
    /// assert_eq!(Frontend::Python.spell(remedy), "raise max_error, or pass memory='64M' and drop=False");
    /// ```
    pub fn spell(self, message: &str) -> Cow<'_, str> {
        if !message.contains(OPEN) {
            return Cow::Borrowed(message);
        }
        let (mut spelled, mut rest) = (String::with_capacity(message.len()), message);
        while let Some((before, after)) = rest.split_once(OPEN) {
            spelled += before;
            match after.split_once(CLOSE).filter(|(option, _)| is_option(option)) {
                Some((option, behind)) => {
                    spelled += &self.option(option);
                    rest = behind;
                }
                None => {
                    spelled.push(OPEN);
                    rest = after;
                }
            }
        }
        Cow::Owned(spelled + rest)
    }

    /// A report as JSON with the options in its messages (notes, remedies, errors) spelled; names of files and
    /// other values stay as they are. Takes time linear in the text.
    ///
    /// ```
    /// use terrane_base::frontend::Frontend;
    /// let report = r#"{"input":"‹tile›.tif","notes":["‹tile› helps"]}"#;
    /// assert_eq!(Frontend::Python.spell_report(report), r#"{"input":"‹tile›.tif","notes":["tile helps"]}"#);
    /// ```
    pub fn spell_report(self, report: &str) -> Cow<'_, str> {
        if !report.contains(OPEN) {
            return Cow::Borrowed(report);
        }
        let (mut spelled, mut rest) = (String::with_capacity(report.len()), report);
        while let Some(start) = NAMED_KEYS.iter().filter_map(|key| value_of(rest, key)).min() {
            let end = start + length(&rest[start..]);
            spelled += &rest[..start];
            spelled += &self.spell(&rest[start..end]);
            rest = &rest[end..];
        }
        Cow::Owned(spelled + rest)
    }

    /// Spells one option (`name` or `name=value`) or one command.
    fn option(self, option: &str) -> String {
        if let Some(verb) = option.strip_prefix(PROGRAM) {
            return match (self, verb.strip_prefix("plan ")) {
                (Self::CommandLine, _) => option.to_owned(),
                (Self::Python, Some(of_plans @ ("run" | "status"))) => format!("Plan.{of_plans}()"),
                (Self::Python, _) => format!("terrane.{}()", verb.replace([' ', '-'], "_")),
            };
        }
        let (name, value) = option.split_once('=').unzip();
        let name = match (self, name.unwrap_or(option)) {
            // Reserved words of Python are renamed.
            (Self::Python, "class") => "classes",
            (Self::Python, "return") => "returns",
            (_, name) => name,
        };
        match (self, value) {
            (Self::CommandLine, Some("false")) => format!("--no-{}", name.replace('_', "-")),
            (Self::CommandLine, None | Some("true")) => format!("--{}", name.replace('_', "-")),
            (Self::CommandLine, Some(value)) => format!("--{} {value}", name.replace('_', "-")),
            (Self::Python, None) => name.to_owned(),
            (Self::Python, Some("true")) => format!("{name}=True"),
            (Self::Python, Some("false")) => format!("{name}=False"),
            (Self::Python, Some(value)) if value.parse::<f64>().is_ok() => {
                format!("{name}={value}")
            }
            (Self::Python, Some(value)) => format!("{name}='{value}'"),
        }
    }
}

/// Members of reports whose text is for people.
const NAMED_KEYS: [&str; 7] =
    ["notes", "not_judged", "failures", "reason", "remedy", "about", "default_text"];

/// Start of the value of a member.
fn value_of(json: &str, key: &str) -> Option<usize> {
    let key = format!("\"{key}\":");
    // A quotation mark with a backslash is inside a text.
    let (at, _) = json.match_indices(&key).find(|(at, _)| !json[..*at].ends_with('\\'))?;
    Some(at + key.len())
}

/// Length in bytes of a JSON value with leading white space: a text, a list of texts, or the text up to a comma.
fn length(json: &str) -> usize {
    let (mut depth, mut is_text, mut is_escaped) = (0_u32, false, false);
    for (at, c) in json.char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' if is_text => is_escaped = true,
            '"' => is_text = !is_text,
            _ if is_text => {}
            '[' | '{' => depth += 1,
            ']' | '}' if depth > 0 => depth -= 1,
            ',' | ']' | '}' if depth == 0 => return at,
            _ => {}
        }
    }
    json.len()
}

/// Prefix of a command.
const PROGRAM: &str = "terrane ";

/// True for the name of a field, with or without a value, and for a command; other text between the marks is left
/// alone.
fn is_option(text: &str) -> bool {
    if let Some(verb) = text.strip_prefix(PROGRAM) {
        return verb.chars().all(|c| c.is_ascii_lowercase() || " -".contains(c));
    }
    let name = text.split_once('=').map_or(text, |(name, _)| name);
    !name.is_empty()
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

#[cfg(test)]
mod tests {
    use super::Frontend::{CommandLine, Python};

    #[test]
    fn values_of_reports_stay_and_notes_are_spelled() {
        for (report, spelled) in [
            (
                r#"{"a": "‹tile›", "notes": ["‹tile›, \"]‹b›"], "b": ["‹c›"]}"#,
                r#"{"a": "‹tile›", "notes": ["tile, \"]b"], "b": ["‹c›"]}"#,
            ),
            (
                r#"{"a": "\"notes\":[\"‹tile›\"]", "remedy": "‹tile›", "z": "‹d›"}"#,
                r#"{"a": "\"notes\":[\"‹tile›\"]", "remedy": "tile", "z": "‹d›"}"#,
            ),
            (r#"{"remedy":null,"x":"‹d›","notes":[]}"#, r#"{"remedy":null,"x":"‹d›","notes":[]}"#),
        ] {
            assert_eq!(Python.spell_report(report), spelled);
        }
    }

    #[test]
    fn each_door_spells_options_and_leaves_other_text() {
        for (message, command_line, python) in [
            ("no option", "no option", "no option"),
            ("‹fit_heights› and ‹to_crs›", "--fit-heights and --to-crs", "fit_heights and to_crs"),
            ("‹tile=512›‹strict=true›", "--tile 512--strict", "tile=512strict=True"),
            ("a ‹‹b› and ‹A B› ›", "a ‹--b and ‹A B› ›", "a ‹b and ‹A B› ›"),
            ("‹› ‹tile", "‹› ‹tile", "‹› ‹tile"),
            ("see ‹terrane plan status›", "see terrane plan status", "see Plan.status()"),
            ("‹terrane plan cloud-tin›", "terrane plan cloud-tin", "terrane.plan_cloud_tin()"),
            ("‹terrane tin› ‹terrane A›", "terrane tin ‹terrane A›", "terrane.tin() ‹terrane A›"),
        ] {
            assert_eq!(CommandLine.spell(message), command_line);
            assert_eq!(Python.spell(message), python);
        }
    }
}
