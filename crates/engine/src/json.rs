//! Plans, tasks and reports as JSON. Their types are turned into one interface first, so that each is compiled once
//! and not for every form of text.

use serde::Serialize;
use serde_json::{Result, Value};

/// On one line.
pub fn to_line(thing: &impl Serialize) -> Result<String> {
    line_of(thing)
}

/// On lines with indents.
pub fn to_lines(thing: &impl Serialize) -> Result<String> {
    lines_of(thing)
}

/// As a value, with the names of each object in alphabetical order.
pub fn to_value(thing: &impl Serialize) -> Result<Value> {
    value_of(thing)
}

fn line_of(thing: &dyn erased_serde::Serialize) -> Result<String> {
    serde_json::to_string(thing)
}

fn lines_of(thing: &dyn erased_serde::Serialize) -> Result<String> {
    serde_json::to_string_pretty(thing)
}

fn value_of(thing: &dyn erased_serde::Serialize) -> Result<Value> {
    serde_json::to_value(thing)
}
