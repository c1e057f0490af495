//! BLAKE3 digests that identify results.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::Cancel;
use terrane_base::error::{Error, Result};

/// Bytes of a result read at a time.
const PIECE_BYTES: usize = 1 << 20;

/// A 256-bit digest.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
#[repr(transparent)]
pub struct Digest(pub [u8; 32]);

impl Digest {
    /// Size in bytes.
    pub const BYTES: usize = 32;

    /// The bytes of the digest.
    pub fn bytes(&self) -> &[u8; Self::BYTES] {
        &self.0
    }

    /// Digest of bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// Digest of concatenated byte slices.
    pub fn of_parts(parts: &[&[u8]]) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in parts {
            hasher.update(part);
        }
        Self(*hasher.finalize().as_bytes())
    }

    /// The first 16 hexadecimal digits: enough to distinguish files.
    pub fn short(&self) -> String {
        self.to_string()[..16].to_owned()
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        blake3::Hash::from_bytes(self.0).to_hex().fmt(f)
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        digest.to_string()
    }
}

impl TryFrom<String> for Digest {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        let hash = blake3::Hash::from_hex(&text).map_err(|e| format!("invalid digest: {e}"))?;
        match *hash.to_hex() == *text {
            true => Ok(Self(*hash.as_bytes())),
            false => Err("invalid digest: not in lower case".to_owned()),
        }
    }
}

/// Digest of concatenated files.
pub fn digest_of(files: &[PathBuf], cancel: &Cancel) -> Result<Digest> {
    let mut hasher = blake3::Hasher::new();
    let mut piece = vec![0; PIECE_BYTES];
    for path in files {
        let fail = |e| Error::read(path, e);
        let mut file = File::open(path).map_err(fail)?;
        loop {
            cancel.check()?;
            match file.read(&mut piece).map_err(fail)? {
                0 => break,
                bytes => hasher.update(&piece[..bytes]),
            };
        }
    }
    Ok(Digest(*hasher.finalize().as_bytes()))
}
