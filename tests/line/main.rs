//! Lines, their topology and their proof, contours, and files of features.

mod coverage;
#[path = "../common/data.rs"]
mod data;

mod contours;
mod doors;
mod faults;
mod files;
mod squares;
mod systems;
mod topology;
mod worlds;
