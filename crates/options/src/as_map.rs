//! Serialisation of options by name: `#[serde(with = "terrane_options::as_map")]`.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value as Json};

use crate::{Options, check, fill, noted};

/// Writes all values by name, as they are [noted].
///
/// # Errors
/// Errors of the writer.
pub fn serialize<O: Options, S: Serializer>(options: &O, out: S) -> Result<S::Ok, S::Error> {
    noted(options).serialize(out)
}

/// Reads values by name; others have their defaults.
///
/// # Errors
/// Errors of the reader; unknown names, invalid values and combinations.
pub fn deserialize<'a, O: Options, D: Deserializer<'a>>(from: D) -> Result<O, D::Error> {
    let given = Map::<String, Json>::deserialize(from)?;
    let options: O = fill(&given).map_err(D::Error::custom)?;
    check(&options).map_err(D::Error::custom)?;
    Ok(options)
}
