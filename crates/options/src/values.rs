//! Conversion between options and the values of front ends.

use serde_json::{Map, Value as Json};

use crate::table::{OptionArity, OptionField, OptionKind, OptionTable};
use crate::visit::Options;
use terrane_base::error::{Error, Result};

/// Options with these values by name; others have their defaults. `null` means not given.
///
/// # Errors
/// Usage: an unknown name (the message suggests the closest one), a repeated option, or an invalid value.
pub fn fill<O: Options>(given: &Map<String, Json>) -> Result<O> {
    let mut options = O::default();
    let mut taken = Vec::new();
    for (name, value) in given {
        let field = O::TABLE.find(name).ok_or_else(|| unknown(O::TABLE, name))?;
        if !field.is_given(value) {
            continue;
        }
        if taken.contains(&field.name) {
            return Err(Error::usage(format!("‹{}› is given twice", field.name))
                .remedy("leave one of them out"));
        }
        taken.push(field.name);
        set_texts(&mut options, field, &texts_of(field, value)?)?;
    }
    Ok(options)
}

/// Sets one option from the given texts.
///
/// # Errors
/// Usage: invalid texts.
pub fn set_texts<O: Options>(options: &mut O, field: &OptionField, texts: &[String]) -> Result<()> {
    if let Some(number) = texts.last().and_then(|text| text.trim().parse::<f64>().ok()) {
        field.check_range(number).map_err(|expected| {
            Error::usage(format!("‹{}› is {number}: expected {expected}", field.name))
        })?;
    }
    let mut done = Ok(());
    options.visit_mut(&mut |name, value| {
        if name == field.name {
            done = value.set(texts);
        }
    });
    done.map_err(|expected| {
        let of_text = texts.iter().find_map(|text| field.check_text(text).err());
        let expected = of_text.unwrap_or(expected);
        Error::usage(format!("‹{}› is {:?}: {expected}", field.name, texts.join(" ")))
    })
}

/// Texts of a JSON value: lists are split if the option is repeatable, else joined with commas; objects, and pairs in
/// a list, become `KEY=VALUE`.
///
/// # Errors
/// Usage: a value of the wrong type.
pub fn texts_of(field: &OptionField, value: &Json) -> Result<Vec<String>> {
    let several = match value {
        Json::Array(all) => match (field.shape, field.kind) {
            (OptionArity::Repeated, _) => {
                all.iter().map(|value| one_of_several(field, value)).collect()
            }
            (_, kind) if is_list(kind) => {
                let texts: Option<Vec<_>> = all.iter().map(|value| text_of(field, value)).collect();
                texts.map(|texts| vec![texts.join(",")])
            }
            _ => None,
        },
        Json::Object(pairs) if field.shape == OptionArity::Repeated => {
            pairs.iter().map(|(key, value)| pair_of(key, value)).collect()
        }
        _ => text_of(field, value).map(|text| vec![text]),
    };
    several.ok_or_else(|| wrong(field, value))
}

/// True if a list is a single, comma-separated value.
fn is_list(kind: OptionKind) -> bool {
    match kind {
        OptionKind::Numbers => true,
        OptionKind::Shaped(of) => of.contains("Sequence"),
        _ => false,
    }
}

/// Text of a list item: a value, or a pair of key and value.
fn one_of_several(field: &OptionField, value: &Json) -> Option<String> {
    match value.as_array().map(Vec::as_slice) {
        Some([Json::String(key), value]) => pair_of(key, value),
        _ => text_of(field, value),
    }
}

/// `KEY=VALUE` in the notation of formats.
fn pair_of(key: &str, value: &Json) -> Option<String> {
    let value = match value {
        Json::String(text) => text.clone(),
        Json::Number(number) => number.to_string(),
        Json::Bool(flag) => if *flag { "YES" } else { "NO" }.to_owned(),
        _ => return None,
    };
    (!key.contains('=')).then(|| format!("{key}={value}"))
}

/// Text of a value other than a list.
fn text_of(field: &OptionField, value: &Json) -> Option<String> {
    let is_number = matches!(field.kind, OptionKind::Whole | OptionKind::Number);
    match (value, field.kind) {
        // Non-finite numbers are texts, as JSON has no notation for them.
        (Json::String(text), _) if is_number => {
            (!text.trim().parse().is_ok_and(f64::is_finite)).then(|| text.clone())
        }
        (Json::String(text), kind) if !matches!(kind, OptionKind::Flag) => Some(text.clone()),
        (Json::Bool(true), _) if field.bare.is_some() => field.bare.map(str::to_owned),
        (Json::Bool(flag), OptionKind::Flag) => Some(flag.to_string()),
        (Json::Number(number), OptionKind::Whole) => Some(match number.as_f64() {
            Some(value) if number.is_f64() && value.fract() == 0.0 && value.abs() < 1e15 => {
                format!("{value:.0}")
            }
            _ => number.to_string(),
        }),
        (
            Json::Number(number),
            OptionKind::Number | OptionKind::Numbers | OptionKind::Shaped(_),
        ) => Some(number.to_string()),
        _ => None,
    }
}

/// Maximum characters of a value in messages.
const MAX_LISTED: usize = 60;

fn wrong(field: &OptionField, value: &Json) -> Error {
    let expected = match field.kind {
        OptionKind::Flag => "true or false",
        OptionKind::Whole => "a whole number",
        OptionKind::Number => "a number",
        OptionKind::Numbers => "numbers",
        OptionKind::Shaped(_) => "a number or text",
        OptionKind::Text | OptionKind::Path | OptionKind::Choice(_) => "text",
    };
    let text = value.to_string();
    let start: String = text.chars().take(MAX_LISTED).collect();
    let rest = if start.len() < text.len() { "..." } else { "" };
    Error::usage(format!("‹{}› is {start}{rest}: expected {expected}", field.name))
}

/// All values by name.
pub fn to_map<O: Options>(options: &O) -> Map<String, Json> {
    let mut map = Map::new();
    options.visit(&mut |name, value| {
        map.insert(name.to_owned(), value.json());
    });
    map
}

/// All values by name, for comparisons: values equal to the default in words are `null`.
pub fn noted<O: Options>(options: &O) -> Map<String, Json> {
    let mut map = to_map(options);
    for field in O::TABLE.fields() {
        if let Some(value) = map.get_mut(field.name)
            && field.usual().as_ref() == Some(value)
        {
            *value = Json::Null;
        }
    }
    map
}

/// The same options with `None` for values equal to the default in words.
///
/// # Errors
/// Usage: invalid values, which setters accept.
pub fn settled<O: Options>(options: &O) -> Result<O> {
    fill(&noted(options))
}

/// Values other than the defaults, by name.
pub fn changed<O: Options>(options: &O) -> Map<String, Json> {
    let defaults = to_map(&O::default());
    to_map(options).into_iter().filter(|(name, value)| defaults.get(name) != Some(value)).collect()
}

/// The error for an unknown name, with the closest known one.
fn unknown(table: &'static OptionTable, name: &str) -> Error {
    let given = name.replace('-', "_");
    let names = table
        .fields()
        .into_iter()
        .flat_map(|field| std::iter::once(field.name).chain(field.aliases.iter().copied()));
    let near = names.map(|known| (distance(known, &given), known)).min();
    let error = Error::usage(format!("unknown option {name:?}"));
    match near {
        Some((steps, known)) if steps <= known.len() / 3 + 1 => {
            error.remedy(format!("did you mean ‹{known}›?"))
        }
        _ => error.remedy("leave it out"),
    }
}

/// Edit distance (Levenshtein 1965); time is the product of both lengths.
fn distance(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, letter) in from.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, other) in to.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            // One row of the table is held: the diagonal neighbour is saved before it is written over.
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::distance;

    #[test]
    fn names_are_as_far_apart_as_letters_differ() {
        for (from, to, steps) in
            [("fit", "fit", 0), ("fit", "fits", 1), ("", "abc", 3), ("kitten", "sitting", 3)]
        {
            assert_eq!((distance(from, to), distance(to, from)), (steps, steps));
        }
    }
}
