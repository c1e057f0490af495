//! Files of others: read by position, and found by name, in folders, lists and patterns.

mod beside;
mod glob;
mod list;
mod name;
mod raw;

pub(crate) use beside::{beside_grid, companions, prj};
pub(crate) use list::Seek;
pub(crate) use name::{name_of, path_of, shown};
pub(crate) use raw::{RawFile, Reader, RowRun, to_usize};
