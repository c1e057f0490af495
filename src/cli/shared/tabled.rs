//! Command line arguments from a table of options.

use std::ffi::OsStr;

use clap::builder::{
    PossibleValue, PossibleValuesParser, Resettable, StringValueParser, TypedValueParser,
    ValueParser,
};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Command, ValueHint};
use terrane_options::{
    OptionArity, OptionField, OptionKind, OptionRole, Options, set_texts, to_map,
};

use crate::cli::shared::names;
use terrane_base::frontend::Frontend;

/// Options as clap arguments, with the names of those given; for a plan only those that affect the result.
#[derive(Clone, Debug)]
pub(crate) struct OperationOptionArgs<O, const PLANNED: bool = false>(
    pub(crate) O,
    pub(crate) Vec<&'static str>,
);

/// Given options after their names.
fn fields<O: Options, const PLANNED: bool>() -> impl Iterator<Item = &'static OptionField> {
    let fields = O::TABLE.fields().into_iter().filter(|field| !field.positional);
    fields.filter(|field| !(PLANNED && field.role == OptionRole::Run))
}

impl<O: Options, const PLANNED: bool> clap::Args for OperationOptionArgs<O, PLANNED> {
    fn augment_args(command: Command) -> Command {
        let defaults = to_map(&O::default());
        fields::<O, PLANNED>().fold(command, |command, field| {
            let about = field.off.unwrap_or(field.about);
            command.arg(argument::<PLANNED>(field, &defaults[field.name], about))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<O: Options, const PLANNED: bool> clap::FromArgMatches for OperationOptionArgs<O, PLANNED> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let (mut options, mut given_names) = (O::default(), Vec::new());
        for field in fields::<O, PLANNED>() {
            let texts = given(field, matches);
            if !texts.is_empty() {
                given_names.push(field.name);
                set_texts(&mut options, field, &texts).map_err(|error| {
                    let text = Frontend::CommandLine.spell(&error.to_string()).into_owned();
                    clap::Error::raw(ErrorKind::ValueValidation, text)
                })?;
            }
        }
        Ok(Self(options, given_names))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Given texts of an option.
pub(crate) fn given(field: &'static OptionField, matches: &ArgMatches) -> Vec<String> {
    match field.kind {
        OptionKind::Flag if matches.get_flag(field.name) => vec![field.off.is_none().to_string()],
        OptionKind::Flag => Vec::new(),
        _ => matches.get_many(field.name).into_iter().flatten().cloned().collect(),
    }
}

/// An option as an argument with its help.
pub(crate) fn argument<const PLANNED: bool>(
    field: &'static OptionField,
    default: &serde_json::Value,
    about: &str,
) -> Arg {
    let long = field.name.replace('_', "-");
    let long = if field.off.is_some() { format!("no-{long}") } else { long };
    let mut argument =
        Arg::new(field.name).long(long).help(match PLANNED && field.name == "format" {
            // The output of a plan is a folder without an extension.
            true => about.to_owned(),
            false => help(field, default, about),
        });
    // Resets the heading of earlier arguments.
    argument = match field.heading {
        "Options" => argument.help_heading(Resettable::Reset),
        heading => argument.help_heading(heading),
    };
    if let Some(letter) = field.short {
        argument = argument.short(letter);
    }
    // Some of GDAL's names have underscores.
    argument = argument.aliases(field.aliases.iter().copied().filter(|alias| alias.contains('_')));
    let off = if field.off.is_some() { "no-" } else { "" };
    let aliases = field.aliases.iter().map(|alias| format!("{off}{}", alias.replace('_', "-")));
    argument = argument.visible_aliases(aliases.collect::<Vec<_>>());
    let OptionKind::Flag = field.kind else {
        let action = match field.shape {
            OptionArity::Repeated => ArgAction::Append,
            OptionArity::One | OptionArity::Optional => ArgAction::Set,
        };
        let argument = argument.value_name(field.value.unwrap_or("VALUE")).action(action);
        let argument = match field.bare {
            Some(bare) => argument.num_args(0..=1).require_equals(true).default_missing_value(bare),
            None => argument,
        };
        return match (field.kind, field.shape) {
            (
                OptionKind::Number | OptionKind::Whole | OptionKind::Choice(_),
                OptionArity::Repeated,
            ) => of_values(field, argument.value_delimiter(',')),
            _ => of_values(field, argument),
        };
    };
    argument.action(ArgAction::SetTrue)
}

/// Accepted values of an argument.
fn of_values(field: &'static OptionField, argument: Arg) -> Arg {
    match field.kind {
        OptionKind::Choice(_) => argument.value_parser(ValueParser::new(ChoiceParser(field))),
        OptionKind::Path => argument.value_hint(ValueHint::FilePath).value_parser(names::any()),
        OptionKind::Number | OptionKind::Numbers | OptionKind::Shaped("str") => {
            argument.allow_hyphen_values(true).value_parser(checked(field))
        }
        OptionKind::Shaped(_) => argument.allow_negative_numbers(true).value_parser(checked(field)),
        OptionKind::Flag | OptionKind::Whole | OptionKind::Text => {
            argument.value_parser(checked(field))
        }
    }
}

/// A name of a choice, as its option reads it.
#[derive(Clone)]
struct ChoiceParser(&'static OptionField);

impl TypedValueParser for ChoiceParser {
    type Value = String;

    fn parse_ref(
        &self,
        command: &Command,
        argument: Option<&Arg>,
        value: &OsStr,
    ) -> Result<String, clap::Error> {
        match value.to_str().filter(|text| (self.0.read)(text).is_ok()) {
            Some(text) => Ok(text.to_owned()),
            // Clap's error lists the values and the nearest one.
            None => PossibleValuesParser::new(names_of(self.0)).parse_ref(command, argument, value),
        }
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(names_of(self.0)))
    }
}

fn names_of(field: &'static OptionField) -> impl Iterator<Item = PossibleValue> {
    let choices = if let OptionKind::Choice(choices) = field.kind { choices() } else { Vec::new() };
    choices.into_iter().map(|own| PossibleValue::new(own.name).help(own.about))
}

/// A valid text of the option.
fn checked(field: &'static OptionField) -> ValueParser {
    ValueParser::new(StringValueParser::new().try_map(move |text| {
        let range = text.trim().parse().map_or(Ok(()), |number| field.check_range(number));
        range.map_err(|expected| format!("expected {expected}"))?;
        field.check_text(&text).map(|()| text)
    }))
}

/// Help of an option with its default.
fn help(field: &OptionField, default: &serde_json::Value, about: &str) -> String {
    let about = Frontend::CommandLine.spell(about).into_owned();
    let default = match (field.default_text, field.shape, field.kind) {
        (Some(words), ..) => Frontend::CommandLine.spell(words).into_owned(),
        (None, _, OptionKind::Flag) | (None, OptionArity::Optional | OptionArity::Repeated, _) => {
            return about;
        }
        (None, OptionArity::One, _) if default == &serde_json::json!([]) => return about,
        (None, OptionArity::One, _) => {
            let number = default.as_f64().map(|number| number.to_string());
            number.or(default.as_str().map(str::to_owned)).unwrap_or_else(|| default.to_string())
        }
    };
    format!("{about} [default: {default}]")
}
