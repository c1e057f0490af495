//! Files of others: read by position, and found by name, in folders, lists and patterns.

mod beside;
mod glob;
mod list;
mod raw;

pub(crate) use beside::prj;
pub(crate) use list::{Seek, name};
pub(crate) use raw::{RawFile, Reader, RowRun, to_usize};
