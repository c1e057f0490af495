//! Rules for combinations of options, and ranges: checked once, for all front ends.
//!
//! A rule refers to terms: an option, a value of it (`bound=surface`), or any other value (`method!=greedy`). So the
//! options that only greedy insertion supports are a list of names beside the options of `tin`, not code.

use serde_json::{Map, Value as Json};

use crate::codec::AnyValue;
use crate::table::{OptionField, OptionKind, OptionRole, OptionRule, OptionTable};
use crate::values::{texts_of, to_map};
use crate::visit::Options;
use terrane_base::error::{Error, Result};

/// Fails to compile if a rule refers to an unknown option; for `const` blocks.
///
/// # Panics
/// At compile time only.
pub const fn assert_rules(table: &OptionTable) {
    let (rules, mut i) = (table.rules, 0);
    while i < rules.len() {
        let (first, others) = match &rules[i] {
            OptionRule::OneOf(names, _) => (names[0], *names),
            OptionRule::NotWith(name, others) | OptionRule::Needs(name, others) => (*name, *others),
        };
        assert!(table.has(name_of(first)), "a rule names an unknown option");
        let mut k = 0;
        while k < others.len() {
            assert!(table.has(name_of(others[k])), "a rule names an unknown option");
            k += 1;
        }
        i += 1;
    }
}

/// Option name of a term.
const fn name_of(term: &str) -> &str {
    let bytes = term.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        if bytes[i] == b'=' || bytes[i] == b'!' {
            return term.split_at(i).0;
        }
        i += 1;
    }
    term
}

/// Fails for invalid values, values out of range, and invalid combinations.
///
/// # Errors
/// Usage, with the names of the options.
pub fn check<O: Options>(options: &O) -> Result<()> {
    check_given(options, &[])
}

/// Like [`check`], with the options that were given explicitly, even if equal to their defaults.
///
/// # Errors
/// Errors of [`check`].
pub fn check_given<O: Options>(options: &O, given: &[&str]) -> Result<()> {
    check_as(options, given, false)
}

/// Like [`check`] for a plan, whose messages do not suggest options that affect only a run.
///
/// # Errors
/// Errors of [`check`].
pub fn check_planned<O: Options>(options: &O, given: &[&str]) -> Result<()> {
    check_as(options, given, true)
}

fn check_as<O: Options>(options: &O, given: &[&str], is_plan: bool) -> Result<()> {
    let fields = O::TABLE.fields();
    let mut checked = Ok(());
    options.visit(&mut |name, value| {
        let field = fields.iter().find(|field| field.name == name);
        if let (Some(field), Ok(())) = (field, &checked) {
            checked = check_value(field, value);
        }
    });
    checked?;
    let (table, now, defaults) = (O::TABLE, to_map(options), to_map(&O::default()));
    let given = GivenOptions { table, now, defaults, given, is_plan };
    table.rules().into_iter().try_for_each(|rule| given.check(rule))
}

/// Fails for a value that is out of range or invalid; setters accept any value.
fn check_value(field: &OptionField, value: &dyn AnyValue) -> Result<()> {
    let (name, json) = (field.name, value.json());
    if let Some(number) = value.number() {
        field.check_range(number).map_err(|expected| {
            Error::usage(format!("‹{name}› is {number}: expected {expected}"))
        })?;
    }
    if json.is_null() || json.as_array().is_some_and(Vec::is_empty) {
        return Ok(());
    }
    texts_of(field, &json)?.iter().try_for_each(|text| {
        (field.read)(text)
            .map(drop)
            .map_err(|expected| Error::usage(format!("‹{name}› is {text:?}: {expected}")))
    })
}

struct GivenOptions<'a> {
    table: &'static OptionTable,
    now: Map<String, Json>,
    defaults: Map<String, Json>,
    given: &'a [&'a str],
    is_plan: bool,
}

impl GivenOptions<'_> {
    /// Whether a term holds.
    fn is(&self, term: &str) -> bool {
        match term.split_once('=') {
            Some((name, value)) => match name.strip_suffix('!') {
                Some(name) => !self.has(name, value),
                None => self.has(name, value),
            },
            None => self.now.get(term) != self.defaults.get(term) || self.is_given(term),
        }
    }

    /// Whether an option has this value, or contains it.
    fn has(&self, name: &str, value: &str) -> bool {
        match self.now.get(name) {
            Some(Json::Array(several)) => several.iter().any(|now| text(now) == value),
            now => now.is_some_and(|now| text(now) == value),
        }
    }

    /// Whether an option other than a flag was given explicitly.
    fn is_given(&self, name: &str) -> bool {
        let kind = self.table.find(name).map(|field| field.kind);
        self.given.contains(&name) && !matches!(kind, None | Some(OptionKind::Flag))
    }

    /// The options that this context supports.
    fn had<'n>(&self, names: &[&'n str]) -> Vec<&'n str> {
        let names = names.iter().copied().filter(|name| {
            let is_of_runs =
                self.table.find(name).is_some_and(|field| field.role == OptionRole::Run);
            !(self.is_plan && is_of_runs)
        });
        names.collect()
    }

    /// Options to add; for a single choice, with its values.
    fn offered(&self, names: &[&str]) -> String {
        match (names, names.first().and_then(|name| self.table.find(name)).map(|own| own.kind)) {
            ([_], Some(OptionKind::Choice(choices))) => {
                let choices: Vec<&str> = choices().iter().map(|own| own.name).collect();
                format!("{} ({})", self.listed(names), choices.join(", "))
            }
            _ => self.listed(names),
        }
    }

    /// `‹a›, ‹b› or ‹c›`; flags that are on by default are listed as turned off.
    fn listed(&self, terms: &[&str]) -> String {
        let names: Vec<String> = terms.iter().map(|term| self.spelled(term)).collect();
        match names.split_last() {
            Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
            _ => names.join(""),
        }
    }

    fn spelled(&self, term: &str) -> String {
        match term.split_once("!=") {
            // Its current value.
            Some((name, _)) => {
                format!("‹{name}› {}", self.now.get(name).map_or(String::new(), text))
            }
            None if self.table.find(term).is_some_and(|field| field.off.is_some()) => {
                format!("‹{term}=false›")
            }
            None => format!("‹{term}›"),
        }
    }

    fn together(&self, term: &str, other: &str) -> Error {
        let [term, other] = [term, other].map(|term| self.listed(&[term]));
        Error::usage(format!("{term} cannot be used with {other}")).remedy("leave one of them out")
    }

    fn check(&self, rule: &OptionRule) -> Result<()> {
        match *rule {
            OptionRule::OneOf(names, what) => {
                let given: Vec<&str> = names.iter().copied().filter(|name| self.is(name)).collect();
                match given.as_slice() {
                    [] => Err(Error::usage(format!("no {what} given"))
                        .remedy(format!("pass {}", self.listed(&self.had(names))))),
                    [_] => Ok(()),
                    [first, second, ..] => Err(self.together(first, second)),
                }
            }
            OptionRule::NotWith(name, others) => match others.iter().find(|other| self.is(other)) {
                Some(other) if self.is(name) => Err(self.together(name, other)),
                _ => Ok(()),
            },
            OptionRule::Needs(name, others) => {
                match !self.is(name) || others.iter().any(|o| self.is(o)) {
                    true => Ok(()),
                    false => {
                        let (name, needed) = (self.listed(&[name]), self.listed(others));
                        Err(Error::usage(format!("{name} requires {needed}"))
                            .remedy(format!("add {}, or leave {name} out", self.offered(others))))
                    }
                }
            }
        }
    }
}

/// A value in the notation of terms.
fn text(value: &Json) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
