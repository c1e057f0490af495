//! Jobs and plans in one process, by the library. No test here starts a program: until that has begun it
//! holds the locks of whatever is open, and a plan that is let go of would seem to be at work.

mod facade;
mod fitted;
mod plan_grid;
mod staged;
mod tiles;
mod tin;
mod tin_files;
mod workdir;
