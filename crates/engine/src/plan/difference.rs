//! The first difference between two JSON values, as a message.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::json;
use terrane_base::error::{Error, Result};
use terrane_files::{name_of, path_of};

/// Fails if the value of the opened input (`there`) differs from the expected one (`here`): the input is not the `what`
/// of that label.
pub fn refuse_another<T: Serialize>(what: &str, label: &str, there: &T, here: &T) -> Result<()> {
    let Some(how) = difference(there, here) else { return Ok(()) };
    Err(Error::bad_input(format!("differs from the {what} of the plan: {how}"))
        .in_file(Path::new(label))
        .remedy("restore it, or make a new plan in another folder"))
}

/// The value with each file path resolved, links followed, as far as this machine can resolve it.
pub(super) fn by_place<T: Serialize>(thing: &T) -> Value {
    let mut value = json::to_value(thing).unwrap_or_default();
    resolve(&mut value);
    value
}

/// Resolves paths in strings: the whole string, or the part after a format prefix.
fn resolve(value: &mut Value) {
    match value {
        Value::Array(all) => all.iter_mut().for_each(resolve),
        Value::Object(all) => all.values_mut().for_each(resolve),
        Value::String(text) => {
            let Some(begin) = text.find('/') else { return };
            let place = std::fs::canonicalize(&*path_of(&text[begin..])).ok();
            if let Some(place) = place.and_then(|place| name_of(place).ok()) {
                text.replace_range(begin.., &place);
            }
        }
        Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}

/// The first difference between two values, by its name in both.
pub(super) fn difference<T: Serialize>(there: &T, here: &T) -> Option<String> {
    let [there, here] = [there, here].map(|thing| json::to_value(thing).unwrap_or_default());
    first_difference("", &there, &here)
}

fn first_difference(name: &str, there: &Value, here: &Value) -> Option<String> {
    if there == here {
        return None;
    }
    if let (Value::Object(a), Value::Object(b)) = (there, here) {
        let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
        let [of_a, of_b] =
            [a, b].map(|members| |key: &String| members.get(key).unwrap_or(&Value::Null));
        return keys
            .into_iter()
            .find_map(|key| first_difference(&member(name, key), of_a(key), of_b(key)));
    }
    if let (Value::Array(a), Value::Array(b)) = (there, here)
        && a.len() == b.len()
    {
        let mut pairs = a.iter().zip(b).enumerate();
        return pairs.find_map(|(i, (a, b))| first_difference(&member(name, &i.to_string()), a, b));
    }
    Some(format!("{name} is {} in the plan, {} now", abridged(there), abridged(here)))
}

/// The name of a member of the value with that name.
fn member(name: &str, key: &str) -> String {
    if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") }
}

fn abridged(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("a list of {}", items.len()),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named() {
        let of = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        let tell = |a: &str, b: &str| difference(&of(a), &of(b)).unwrap_or_default();
        assert_eq!(
            tell(r#"{"a":{"b":1,"c":2}}"#, r#"{"a":{"b":1,"c":3}}"#),
            "a.c is 2 in the plan, 3 now"
        );
        assert_eq!(tell(r#"{"a":1}"#, r#"{"a":1,"b":2}"#), "b is null in the plan, 2 now");
        assert_eq!(tell(r#"{"a":1,"b":null}"#, r#"{"a":1}"#), "");
        assert_eq!(
            tell(r#"{"f":["x","y"]}"#, r#"{"f":["x"]}"#),
            "f is a list of 2 in the plan, a list of 1 now"
        );
        assert_eq!(
            tell(r#"{"f":["x","y"]}"#, r#"{"f":["x","z"]}"#),
            r#"f.1 is "y" in the plan, "z" now"#
        );
        assert_eq!(tell("[1]", "[1]"), "");
    }
}
