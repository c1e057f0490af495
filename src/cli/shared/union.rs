//! Options of a verb with several kinds of inputs: one struct per kind, selected by the inputs.

use std::marker::PhantomData;

use clap::{ArgMatches, Command};
use serde_json::{Map, Value};
use terrane_options::{
    OptionField, OptionRole, OptionRule, OptionTable, Options, set_texts, to_map,
};

use crate::cli::shared::tabled::{argument, given};
use terrane_base::error::{Error, Result};
use terrane_files::path_of;

/// Options of one kind of input.
pub(crate) struct InputKindOptions {
    table: &'static OptionTable,
    defaults: fn() -> Map<String, Value>,
    /// Name of the inputs, such as "grids".
    of: &'static str,
}

impl InputKindOptions {
    pub(crate) const fn of<O: Options>(of: &'static str) -> Self {
        Self { table: O::TABLE, defaults: || to_map(&O::default()), of }
    }
}

/// Kinds of inputs of a verb.
pub(crate) trait InputKinds: Clone + std::fmt::Debug + Send + Sync + 'static {
    const ALL: &'static [InputKindOptions];
}

/// Given options of all kinds of inputs, each once; for a plan only those that affect the result.
#[derive(Clone, Debug)]
pub(crate) struct InputUnion<K, const PLANNED: bool = false> {
    names: Vec<&'static str>,
    texts: Vec<Vec<String>>,
    kinds: PhantomData<K>,
}

/// Options of all kinds, each from the first kind that has it, with the number of that kind.
fn fields<K: InputKinds, const PLANNED: bool>() -> Vec<(usize, &'static OptionField)> {
    let mut fields: Vec<(usize, &OptionField)> = Vec::new();
    for (number, kind) in K::ALL.iter().enumerate() {
        for field in kind.table.fields() {
            let is_known = fields.iter().any(|(_, known)| known.name == field.name);
            let is_left_out = PLANNED && field.role == OptionRole::Run;
            if !is_known && !is_left_out {
                fields.push((number, field));
            }
        }
    }
    fields
}

/// Help of an option: its kinds if not all have it, and its differences between kinds; `all` are the options of
/// each kind.
fn about<K: InputKinds>(field: &OptionField, all: &[Vec<&'static OptionField>]) -> String {
    let mut texts = vec![field.off.unwrap_or(field.about)];
    let of_each = K::ALL.iter().zip(all);
    let of_each = of_each
        .filter_map(|(kind, own)| Some((kind, own.iter().find(|own| own.name == field.name)?)));
    let of_each: Vec<_> = of_each.collect();
    let having: Vec<&str> = of_each.iter().map(|(kind, _)| kind.of).collect();
    let mut about = match having.len() < K::ALL.len() {
        true => format!("{} ({})", texts[0], having.join(", ")),
        false => texts[0].to_owned(),
    };
    for (kind, own) in of_each {
        let other = own.off.unwrap_or(own.about);
        if !texts.contains(&other) {
            about += &format!(". For {}: {}", kind.of, uncapitalized(other));
            texts.push(other);
        }
    }
    about
}

/// True for an option required by a plan: the only target of several that plans support.
fn is_only_one(table: &'static OptionTable, name: &str) -> bool {
    table.rules().into_iter().any(|rule| match rule {
        OptionRule::OneOf(names, _) => {
            let planned = names
                .iter()
                .filter(|name| table.find(name).is_some_and(|field| field.role != OptionRole::Run));
            planned.eq([&name])
        }
        OptionRule::NotWith(..) | OptionRule::Needs(..) => false,
    })
}

/// A text after a colon.
fn uncapitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_lowercase().chain(letters).collect())
}

impl<K: InputKinds, const PLANNED: bool> clap::Args for InputUnion<K, PLANNED> {
    fn augment_args(command: Command) -> Command {
        let defaults: Vec<_> = K::ALL.iter().map(|kind| (kind.defaults)()).collect();
        let all: Vec<_> = K::ALL.iter().map(|kind| kind.table.fields()).collect();
        fields::<K, PLANNED>().into_iter().fold(command, |command, (number, field)| {
            let (kind, default) = (&K::ALL[number], &defaults[number][field.name]);
            let argument = argument::<PLANNED>(field, default, &about::<K>(field, &all));
            command.arg(argument.required(PLANNED && is_only_one(kind.table, field.name)))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<K: InputKinds, const PLANNED: bool> clap::FromArgMatches for InputUnion<K, PLANNED> {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let all =
            fields::<K, PLANNED>().into_iter().map(|(_, own)| (own.name, given(own, matches)));
        let (names, texts) = all.filter(|(_, texts)| !texts.is_empty()).unzip();
        Ok(Self { names, texts, kinds: PhantomData })
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl<K: InputKinds, const PLANNED: bool> InputUnion<K, PLANNED> {
    /// Names of the given options.
    pub(crate) fn given(&self) -> &[&'static str] {
        &self.names
    }

    /// Options of one kind, for an input of that kind.
    ///
    /// # Errors
    /// Usage: an option of another kind was given.
    pub(crate) fn of<O: Options>(&self, input: &str) -> Result<O> {
        let mut options = O::default();
        for (name, texts) in self.names.iter().zip(&self.texts) {
            let Some(field) = O::TABLE.find(name) else {
                return Err(self.refusal(name, input, O::TABLE));
            };
            set_texts(&mut options, field, texts)?;
        }
        Ok(options)
    }

    /// Error of an option of another kind of input.
    fn refusal(&self, name: &str, input: &str, own: &'static OptionTable) -> Error {
        let having = K::ALL.iter().filter_map(|kind| Some((kind.of, kind.table.find(name)?)));
        let (of, fields): (Vec<_>, Vec<_>) = having.unzip();
        let off = if fields.iter().any(|field| field.off.is_some()) { "=false" } else { "" };
        let option = format!("‹{name}{off}›");
        let kind = K::ALL.iter().find(|kind| std::ptr::eq(kind.table, own));
        let kind = kind.map_or("this", |kind| kind.of);
        let in_place = own
            .fields()
            .into_iter()
            .find(|field| field.stands_for.contains(&name) && !self.names.contains(&field.name));
        let of = of.join(if of.len() > 2 { ", " } else { " and " });
        Error::usage(format!("{option} is for {of}, not for {kind}"))
            .in_file(&path_of(input))
            .remedy(match (input, in_place) {
                (_, Some(field)) => format!("pass ‹{}› instead", field.name),
                ("-", None) => {
                    format!("leave {option} out, or pass cloud:- if stdin holds points")
                }
                _ => format!("leave {option} out"),
            })
    }
}
