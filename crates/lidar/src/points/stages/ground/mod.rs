//! Heights above ground, and classes derived from the ground.
//!
//! ```text
//! records ─┬─ ground: by class, or found ── its triangulation ─┐
//!          └─ places, by square ───────────────────────────────┴─ values, by number ── records again, with these
//! ```

mod ground_search;
mod input;
pub(super) mod queries;
mod reclassify;
mod stage;

pub(in crate::points) use input::GroundInput;
pub use queries::{Classify, HeightClasses, HeightQuery, HeightsAs};
pub use reclassify::Reclassify;
