//! Shared basis of all crates: errors with file, place and remedy, limits for untrusted headers, cancellation, and
//! the geometry of windows, affine maps and coordinate reference systems.

pub mod attribute;
pub mod bits;
pub mod bound;
pub mod byte_size;
pub mod cancel;
pub mod digits;
pub mod error;
pub mod exact_total;
pub mod formula;
pub mod frontend;
pub mod geom;
pub mod limits;
pub mod parameters;
pub mod registry;
pub mod rounding;

pub use cancel::Cancel;
pub use error::{Error, ErrorKind, Result};
