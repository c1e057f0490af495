//! Files of meshes: written, read back, in many parts, and as others judge them.

#[path = "../common/cli_support.rs"]
mod cli_support;
#[path = "../common/held.rs"]
mod held;

mod channels;
mod round_trip;
mod solid;
mod split;
mod validator;
