//! x
#![allow(missing_docs,dead_code,unreachable_pub)]
pub mod filter;
mod lows;
mod surface;
pub mod csf;
mod ptd;
mod grid;
mod tin;
pub mod lab;
pub use lows::{EMPTY, NO_POINT, Lows};
pub use surface::Ground;
