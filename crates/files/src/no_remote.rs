//! In place of remote files, where the library is built without them.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use terrane_base::error::{Error, Result};

/// There is none.
#[derive(Debug)]
pub(crate) enum NoRemoteFile {}

pub(crate) use NoRemoteFile as RemoteFile;

pub(crate) fn is_remote(_: &Path) -> bool {
    false
}

pub(crate) fn open(path: &Path) -> Result<Arc<RemoteFile>> {
    let error = Error::unsupported("this build cannot read remote files").in_file(path);
    Err(error.remedy("build with the feature `remote`, or download the file (curl -LO URL)"))
}

impl RemoteFile {
    pub(crate) fn bytes(&self) -> u64 {
        match *self {}
    }

    pub(crate) fn version(&self) -> Option<&str> {
        match *self {}
    }

    pub(crate) fn read_at(&self, _: u64, _: &mut [u8], _: u64) -> Result<()> {
        match *self {}
    }

    pub(crate) fn prefetch(&self, _: &[Range<u64>], _: &[Range<u64>]) -> Result<()> {
        match *self {}
    }
}
