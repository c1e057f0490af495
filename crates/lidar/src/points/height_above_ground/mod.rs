//! Heights above ground, and classes derived from the ground.
//!
//! ```text
//! records ─┬─ ground: by class, or found ── its triangulation ─┐
//!          └─ places, by square ───────────────────────────────┴─ values, by number ── records again, with these
//! ```

pub(super) mod ground_search;
pub(super) mod queries;
mod reclassify;
pub(super) mod results;

pub use queries::{Classify, HeightClasses, HeightQuery, HeightsAs};
pub use reclassify::Reclassify;
