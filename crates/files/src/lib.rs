//! Files of others: read by position, and found by name, in folders, lists and patterns.

pub mod atomic;
mod beside;
pub mod fault;
mod glob;
mod list;
mod name;
mod raw;

pub use beside::{beside_grid, companions, prj};
pub use list::Seek;
pub use name::{name_of, path_of, shown};
pub use raw::{RawFile, Reader, RowRun, to_usize};
