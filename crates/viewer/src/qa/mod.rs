//! Reports on the quality of point clouds: density, voids, flight lines, contents, headers against contents, and an index
//! of the files.
//!
//! One pass over the points counts them by file, by flight line, and by cell, flight line and file. The counts of cells
//! are sorted by row and column outside memory ([`AggregatedRecords`](terrane_files::AggregatedRecords)). A pass over them, cell by
//! cell, finds everything else: in memory are a row of empty cells, two pictures, and counts by line, by pair of lines and
//! by file. Sums are of integers or in the order of cells, so threads, memory and the order of files do not matter.

mod cells;
mod density;
mod differences;
mod findings;
mod footprint;
mod index;
mod job;
mod lattice;
mod options;
mod page;
mod picture;
mod report;
mod survey;
mod tally;
mod voids;
mod vpc;

pub use options::{QaOptions, QaSetters};
pub use report::{
    QaComparison, QaContents, QaDensity, QaFile, QaFinding, QaLine, QaOverlap, QaReport,
    QaRequirement, QaVoid, QaVoids,
};
pub use tally::QaRange;
