//! dBASE III tables, the attribute tables of shapefiles: properties as text of fixed width.

mod encoding;
mod read;
mod write;

pub(super) use read::DbfReader;
pub(super) use write::{DbfTablePlan, write};
