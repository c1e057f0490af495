//! Synthetic terrain as a grid source: `synth:rough,size=4097,seed=7`.

use crate::error::{Error, Result};
use crate::raster::GridSource;

/// Placeholder of this branch.
pub(crate) fn open(_name: &str) -> Result<Box<dyn GridSource>> {
    Err(Error::unsupported("synthetic terrain"))
}
