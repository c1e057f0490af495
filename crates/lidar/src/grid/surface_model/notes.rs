//! Notes on the points of a terrain model, and errors for clouds without them.

use super::tiles::SpikeFreeTiles;
use terrane_base::error::Error;
use terrane_ground as ground;

/// The note on the points found by a method, and the number and kind of candidates.
pub(crate) fn found_by(method: &ground::Request, found: u64, all: u64, points: &str) -> String {
    format!("ground: {found} of {all} {points}, found by the method {}", method.name())
}

/// The error of a cloud without points of the classes of ground.
pub(crate) fn no_ground_of_class(named: &str) -> Error {
    Error::bad_input(format!("the point cloud has no points of class {named}"))
}

pub(super) fn not_of_class(named: &str) -> Error {
    no_ground_of_class(named).remedy("pass ‹ground› auto, or the ground classes with ‹class›")
}

/// The error of a cloud without ground.
pub(crate) fn no_ground() -> Error {
    Error::bad_input("no ground found in the point cloud")
        .remedy("check ‹bounds›, ‹clip› and ‹z_range›")
}

pub(super) fn found_in_classes(count: u64, classes: &[u8]) -> String {
    format!("ground: {count} points of class {}", named(classes))
}

pub(super) fn named(classes: &[u8]) -> String {
    classes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ")
}

/// The note on the returns of a spike-free surface, and its freeze length.
pub(super) fn frozen(count: u64, squares: &SpikeFreeTiles) -> String {
    let edge = squares.freeze.edge;
    format!("surface: {count} returns, spike-free with triangles of up to {edge:.2} m")
}
