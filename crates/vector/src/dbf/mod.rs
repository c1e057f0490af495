//! dBASE tables as shapefiles have them (level III): properties as text of fixed width.

mod encoding;
mod read;
mod write;

pub(super) use read::DbfReader;
pub(super) use write::{DbfTablePlan, write};
