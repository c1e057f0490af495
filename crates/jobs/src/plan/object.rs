//! The object of a task: a file that the task writes, and a note beside it that seals it.
//!
//! The note has the object's key, the digest of its file and what the object tells of itself. Its seal
//! stands for all of that: it is a function of the plan, the same whoever made the object and when.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{Digest, Look, damaged_object as damaged, digest_of, write_json};
use crate::Cancel;
use terrane_base::error::{Error, Result};

/// Where an object lies, and the key it is known by.
pub(super) struct Place {
    pub(super) file: PathBuf,
    pub(super) key: Digest,
}

/// A finished object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Done<F> {
    key: Digest,
    /// Of the file's bytes.
    digest: Digest,
    pub(crate) bytes: u64,
    #[serde(flatten)]
    pub(crate) facts: F,
    /// Of all the above.
    pub(super) seal: Digest,
}

impl<F: Clone + PartialEq + Serialize + DeserializeOwned> Done<F> {
    /// Looks at what is at `place`; `None` when it is not done. Fails when it is there and damaged.
    pub(super) fn look(place: &Place, look: Look, cancel: &Cancel) -> Result<Option<Self>> {
        let note = note(&place.file);
        let Ok(text) = std::fs::read(&note) else { return Ok(None) };
        let Ok(meta) = std::fs::metadata(&place.file) else { return Ok(None) };
        let done: Self = serde_json::from_slice(&text).map_err(|_| damaged(&note))?;
        if done.key != place.key || done.clone().sealed() != done {
            return Err(damaged(&note));
        }
        let digest = || digest_of(std::slice::from_ref(&place.file), cancel);
        if done.bytes != meta.len() || (look == Look::Whole && digest()? != done.digest) {
            return Err(damaged(&place.file));
        }
        Ok(Some(done))
    }

    /// Seals the file that was just written at `place`.
    pub(super) fn seal(place: &Place, facts: F, cancel: &Cancel) -> Result<Self> {
        let Place { file, key } = place;
        let digest = digest_of(std::slice::from_ref(file), cancel)?;
        let bytes = std::fs::metadata(file).map_err(|e| Error::read(file, e))?.len();
        let done = Self { key: *key, digest, bytes, facts, seal: *key }.sealed();
        write_json(&note(file), &done)?;
        Ok(done)
    }

    fn sealed(self) -> Self {
        let facts = serde_json::to_vec(&self.facts).unwrap_or_default();
        let bytes = self.bytes.to_le_bytes();
        let seal = Digest::of_parts(&[self.key.bytes(), self.digest.bytes(), &bytes, &facts]);
        Self { seal, ..self }
    }
}

/// The note on a file.
fn note(file: &Path) -> PathBuf {
    file.with_extension("json")
}
