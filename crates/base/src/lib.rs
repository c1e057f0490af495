//! What all rooms share: errors that name file, place and remedy, limits for values found in untrusted
//! headers, and the geometry of windows, maps and coordinate reference systems.

pub mod bits;
pub mod bound;
pub mod digits;
pub mod error;
pub mod geom;
pub mod limits;
pub mod registry;

pub use error::{Error, ErrorKind, Result};
