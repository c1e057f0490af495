//! What is told of an output in another reference system.

use crate::cli::shared::report::Row;
use crate::cli::shared::text;
use terrane_engine::transform::Transformed;

/// What was done to positions, for people.
pub(crate) fn rows(done: Option<&Transformed>) -> impl Iterator<Item = Row> {
    done.into_iter().flat_map(|done| {
        let accuracy = match done.accuracy {
            Some(0.0) => String::new(),
            Some(metres) => format!(", right to {} m", text::number(metres)),
            None => ", how right is not known".to_owned(),
        };
        [("written in", done.crs.clone()), ("operation", format!("{}{accuracy}", done.operation))]
    })
}
