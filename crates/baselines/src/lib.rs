//! Grid to TIN by textbook methods, with the whole grid in memory. Pure.
//!
//! They serve as a reference: written for clarity, not speed, and independent of the engine's kernel. Every
//! mesh is conforming (no vertex lies within an edge), covers exactly the surface (the union of cells with four
//! valid samples), and has samples as vertices. Error bounds are decided without rounding.
//!
//! ```
//! use terrane_baselines::{BaselineGoal, HeightGrid, METHODS, BaselineTask};
//!
//! let heights: Vec<f64> = (0..20 * 20).map(|i| f64::from((i % 20) * (i / 20) % 7)).collect();
//! let grid = HeightGrid::new(20, 20, &heights, None)?;
//! for method in METHODS {
//!     let tin = (method.run)(&BaselineTask::new(grid, BaselineGoal::MaxError(1.5)))?;
//!     assert!(tin.max_error <= 1.5, "{}: {} vertices", method.name, tin.vertices.len());
//! }
//! # Ok::<(), terrane_base::Error>(())
//! ```

mod candidate;
mod channels;
mod collapse;
mod drop;
mod exact;
mod greedy;
mod grid;
mod kdtree;
mod mesh;
mod method;
mod plane;
mod registry;
mod result;
mod rtin;
mod settings;
mod star;
mod surface;
#[cfg(test)]
mod tests;
mod triangulation;
mod vip;

pub use channels::{ChannelErrors, MultichannelTin, WeightedChannels, join_voids};
pub use grid::{HeightGrid, MOST_SIDE, PackedSample, check_sides};
pub use method::{BaselineMethod, MethodPromise};
pub use registry::METHODS;
pub use result::BaselineTin;
pub use settings::{BaselineGoal, BaselineTask};
pub use surface::SampleStatistics;
pub use triangulation::TriangulationRule;
