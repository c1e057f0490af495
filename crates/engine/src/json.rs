//! Plans, tasks and reports as JSON. Values are trait objects, so that serialization code is compiled once per type and
//! not once per output.

use erased_serde::Serialize;
use serde_json::{Result, Value};

/// JSON on one line.
pub fn to_string(value: &dyn Serialize) -> Result<String> {
    serde_json::to_string(value)
}

/// JSON with line breaks and indents.
pub fn to_string_pretty(value: &dyn Serialize) -> Result<String> {
    serde_json::to_string_pretty(value)
}

/// A JSON value; the names in objects are sorted.
pub fn to_value(value: &dyn Serialize) -> Result<Value> {
    serde_json::to_value(value)
}
