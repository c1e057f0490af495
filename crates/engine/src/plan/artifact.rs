//! The artifact of a task: a file that the task writes, with a sidecar that holds its checksums.
//!
//! The sidecar holds the artifact's key, the digest of its file and its facts. Its own checksum covers all of these. It
//! depends on the plan alone, whoever made the artifact and when.
//!
//! The key is the digest of the plan's digest, the task's name and the checksums of the input artifacts. An artifact
//! may therefore be deleted, copied, or made by two machines at once.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::digest::{Digest, digest_of};
use super::manifest::write_json;
use crate::{Cancel, json};
use terrane_base::error::{Error, ErrorKind, Result};

/// The folder of artifacts.
pub(super) const OBJECTS: &str = "objects";

/// How thoroughly results are checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CheckDepth {
    /// Sizes and sidecars only.
    Quick,
    /// Every byte.
    Whole,
}

/// The error for an artifact that differs from the written one.
pub fn damaged_object(path: &Path) -> Error {
    Error::new(ErrorKind::Io, "is damaged")
        .in_file(path)
        .remedy("run the plan again to rebuild it: ‹terrane plan run›")
}

/// Path and key of an artifact.
pub(super) struct ArtifactLocation {
    pub(super) file: PathBuf,
    pub(super) key: Digest,
}

impl ArtifactLocation {
    /// A location in the artifact folder; the key is made of the plan, the task, and the checksums of its inputs.
    pub(super) fn new(
        objects: &Path,
        plan: Digest,
        task: &str,
        seals: &[Digest],
        ending: &str,
    ) -> Self {
        let mut parts: Vec<&[u8]> = vec![plan.bytes(), task.as_bytes()];
        parts.extend(seals.iter().map(|seal| seal.bytes().as_slice()));
        let key = Digest::of_parts(&parts);
        Self { file: objects.join(format!("{task}-{}.{ending}", key.short())), key }
    }
}

/// A finished artifact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FinishedArtifact<F> {
    key: Digest,
    /// Digest of the file's bytes.
    digest: Digest,
    pub bytes: u64,
    #[serde(flatten)]
    pub facts: F,
    /// Checksum of all fields above.
    pub(super) seal: Digest,
}

impl<F: Clone + PartialEq + Serialize + DeserializeOwned> FinishedArtifact<F> {
    /// Checks the artifact at `place`; `None` if it is not done. Fails if it is damaged.
    pub(super) fn inspect(
        place: &ArtifactLocation,
        depth: CheckDepth,
        cancel: &Cancel,
    ) -> Result<Option<Self>> {
        let note = note(&place.file);
        let Some(text) = if_exists(std::fs::read(&note), &note)? else { return Ok(None) };
        let meta = if_exists(std::fs::metadata(&place.file), &place.file)?;
        let Some(meta) = meta else { return Ok(None) };
        let done: Self = serde_json::from_slice(&text).map_err(|_| damaged_object(&note))?;
        // The text itself, too: a name that is damaged reads as a value that is not there.
        let is_unaltered =
            json::to_string_pretty(&done).is_ok_and(|written| written.as_bytes() == text);
        if !is_unaltered || done.key != place.key || done.clone().sealed() != done {
            return Err(damaged_object(&note));
        }
        let file = std::slice::from_ref(&place.file);
        if done.bytes != meta.len()
            || (depth == CheckDepth::Whole && digest_of(file, cancel)? != done.digest)
        {
            return Err(damaged_object(&place.file));
        }
        Ok(Some(done))
    }

    /// Writes the sidecar of the file just written at `place`. Uses `digest` if known, else the digest of the file on
    /// disk. Ignores cancellation: without a sidecar the work would be lost.
    pub(super) fn seal(place: &ArtifactLocation, facts: F, digest: Option<Digest>) -> Result<Self> {
        let ArtifactLocation { file, key } = place;
        let digest = match digest {
            Some(digest) => digest,
            None => digest_of(std::slice::from_ref(file), &Cancel::default())?,
        };
        let bytes = std::fs::metadata(file).map_err(|e| Error::read(file, e))?.len();
        let done = Self { key: *key, digest, bytes, facts, seal: *key }.sealed();
        write_json(&note(file), &done)?;
        Ok(done)
    }

    fn sealed(self) -> Self {
        let facts = json::to_string(&self.facts).unwrap_or_default();
        let bytes = self.bytes.to_le_bytes();
        let seal =
            Digest::of_parts(&[self.key.bytes(), self.digest.bytes(), &bytes, facts.as_bytes()]);
        Self { seal, ..self }
    }
}

/// The contents of a file, `None` if it is missing. A file that cannot be read is an error, as its task may be done.
fn if_exists<T>(read: std::io::Result<T>, path: &Path) -> Result<Option<T>> {
    match read {
        Ok(contents) => Ok(Some(contents)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Error::read(path, error)),
    }
}

/// The path of a file's sidecar.
fn note(file: &Path) -> PathBuf {
    file.with_extension("json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Facts {
        points: u64,
    }

    fn location(plan: Digest, task: &str, seals: &[Digest]) -> ArtifactLocation {
        ArtifactLocation::new(Path::new("objects"), plan, task, seals, "tif")
    }

    #[test]
    fn keys_differ_by_plan_task_and_seals() {
        let [a, b] = [b"a", b"b"].map(|text| Digest::of(text));
        let places = [
            location(a, "strip-1", &[]),
            location(b, "strip-1", &[]),
            location(a, "strip-2", &[]),
            location(a, "seam-1", &[a, b]),
            location(a, "seam-1", &[b, a]),
        ];
        for (i, ArtifactLocation { file, key }) in places.iter().enumerate() {
            assert!(places[..i].iter().all(|other| other.key != *key && other.file != *file));
        }
    }

    #[test]
    fn whatever_is_altered_is_damage() {
        let folder = tempfile::tempdir().unwrap();
        let cancel = Cancel::default();
        let place = ArtifactLocation::new(folder.path(), Digest::of(b""), "a", &[], "tif");
        let inspect = |depth| FinishedArtifact::<Facts>::inspect(&place, depth, &cancel);
        assert!(inspect(CheckDepth::Whole).unwrap().is_none(), "nothing is there");
        std::fs::write(&place.file, "one").unwrap();
        let done = FinishedArtifact::seal(&place, Facts { points: 3 }, None).unwrap();
        assert_eq!(inspect(CheckDepth::Whole).unwrap(), Some(done.clone()));
        std::fs::write(&place.file, "two").unwrap();
        assert!(
            inspect(CheckDepth::Quick).is_ok() && inspect(CheckDepth::Whole).is_err(),
            "other bytes"
        );
        std::fs::write(&place.file, "three").unwrap();
        assert!(inspect(CheckDepth::Quick).is_err(), "more bytes");
        std::fs::write(&place.file, "one").unwrap();
        let facts = Facts { points: 4 };
        for other in [
            FinishedArtifact { facts, ..done.clone() },
            FinishedArtifact { key: done.seal, ..done },
        ] {
            write_json(&note(&place.file), &other).unwrap();
            assert!(inspect(CheckDepth::Quick).is_err(), "{other:?}");
        }
    }
}
