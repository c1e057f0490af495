//! Heights above ground, and classes derived from the ground.
//!
//! ```text
//! records ─┬─ ground: by class, or found ── its triangulation ─┐
//!          └─ places, by square ───────────────────────────────┴─ values, by number ── records again, with these
//! ```

pub(super) mod asked;
pub(super) mod look;
mod reclassify;
pub(super) mod told;

pub use asked::{Classify, HeightAboveGround, HeightClasses, HeightsAs};
pub use reclassify::Reclassify;
