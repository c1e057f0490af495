//! Reading of features one by one.

use std::path::{Path, PathBuf};

use super::feature::{Feature, LayerHeader};
use terrane_base::error::Result;

/// Options for opening a vector file.
#[derive(Clone, Debug, Default)]
pub struct VectorOpenOptions {
    /// The object of a TopoJSON file to read; the first one when `None`.
    pub layer: Option<String>,
    /// Each row of a table is a feature of one point, instead of a vertex of a line.
    pub rows_are_points: bool,
}

/// Sequential reader of features; one is in memory at a time.
pub trait FeatureSource: Send {
    /// The next feature; `None` at the end. Must not be called again after an error.
    ///
    /// # Errors
    /// Damaged or unsupported content, with its position.
    fn next(&mut self) -> Result<Option<Feature>>;

    /// Header of the layer.
    fn layer(&self) -> &LayerHeader;

    /// Position in the file of the feature read last ("line 7", "record 12").
    fn location(&self) -> String;

    /// Notes on the features read so far.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Checks common to all formats: positions of errors, finite coordinates, and lines with one vertex.
pub(super) struct CheckedFeatures {
    inner: Box<dyn FeatureSource>,
    path: PathBuf,
    /// Features read.
    count: u64,
    /// Number of lines with one vertex.
    single: u64,
}

impl CheckedFeatures {
    pub(super) fn new(inner: Box<dyn FeatureSource>, path: &Path) -> Self {
        Self { inner, path: path.to_path_buf(), count: 0, single: 0 }
    }
}

impl FeatureSource for CheckedFeatures {
    fn next(&mut self) -> Result<Option<Feature>> {
        let next = self.inner.next().and_then(|feature| {
            feature.as_ref().map_or(Ok(()), |feature| feature.geometry.check_finite())?;
            Ok(feature)
        });
        // A feature that cannot be read counts, too: the error refers to it.
        self.count += u64::from(!matches!(next, Ok(None)));
        if let Ok(Some(feature)) = &next {
            let parts = feature.geometry.parts();
            self.single += parts.filter(|part| part.xy.len() == 1).count() as u64;
        }
        next.map_err(|e| e.at(self.location()).in_file(&self.path))
    }

    fn layer(&self) -> &LayerHeader {
        self.inner.layer()
    }

    fn location(&self) -> String {
        let (count, place) = (self.count, self.inner.location());
        if place.is_empty() {
            format!("feature {count}")
        } else {
            format!("feature {count} ({place})")
        }
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.inner.notes();
        if self.single > 0 {
            notes.push(format!("{} lines have a single vertex and are kept", self.single));
        }
        notes
    }
}
