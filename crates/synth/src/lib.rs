//! Synthetic terrains: fractal relief by seed, any window of a grid of any size; synthetic point clouds
//! ([`cloud`]), and synthetic lines ([`lines`]). Pure.
//!
//! A sample is a pure function of character, seed, parameters and its (column, row). It does not
//! depend on the requested window, thread or machine, nor on the grid's width and height:
//! only additions, multiplications, divisions and square roots of `f32` are used, which IEEE 754
//! defines to the last bit.

mod character;
pub mod cloud;
mod hash;
mod lattice;
pub mod lines;
mod name;
mod octaves;
mod parameters;
mod terrain;

pub use character::{CHARACTERS, PARAMETERS};
pub use terrain::{MAX_SIDE, SynthParameter, Terrain, TerrainKind};
