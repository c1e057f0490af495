//! Inputs that are made for an operation: points after stages, models of the ground.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tempfile::TempDir;

use crate::plan::{InputFile, stat, with_companions, write_json};
use crate::{REVISION, Resources, feature_files, json};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_cloud as cloud;
use terrane_files::{folder_for, is_made, name_of, path_of, refuse_in_memory};
use terrane_raster::Inputs;

/// A file that was made of a point cloud to be read by an operation.
pub struct MadeInput {
    /// The file, with the name of the point cloud.
    pub inputs: Inputs,
    /// Notes on its making.
    pub notes: Vec<String>,
    path: PathBuf,
    /// Deleted on drop.
    _temporary: Option<TempDir>,
}

/// What a file in a work folder was made of.
#[derive(Serialize, Deserialize)]
struct MadeOf {
    revision: u32,
    request: serde_json::Value,
    files: Vec<InputFile>,
    /// The file, once it is finished.
    made: Option<InputFile>,
    notes: Vec<String>,
}

impl MadeOf {
    /// Whether both are of the same files, by the same request.
    fn is_of(&self, other: &Self) -> bool {
        (self.revision, &self.request, &self.files)
            == (other.revision, &other.request, &other.files)
    }

    /// That of an earlier run.
    fn recorded(path: &Path) -> Option<Self> {
        serde_json::from_slice(&std::fs::read(path).ok()?).ok()
    }
}

impl MadeInput {
    /// The name of a point cloud for messages and outputs.
    pub fn label(source: &Inputs) -> String {
        source.label().map(str::to_owned).unwrap_or_else(|| {
            let names = source.names();
            let files = cloud::files(names).unwrap_or_else(|_| names.to_vec());
            feature_files::in_order(&files).to_string()
        })
    }

    /// A file that stays; `label` names what it was made of.
    ///
    /// # Errors
    /// A path that is not UTF-8.
    pub fn kept(label: String, path: PathBuf, notes: Vec<String>) -> Result<Self> {
        let inputs = Inputs::labelled(vec![name_of(path.clone())?], label);
        Ok(Self { inputs, notes, path, _temporary: None })
    }

    /// A file that `make` writes into a temporary folder beside `output`, deleted with it.
    ///
    /// # Errors
    /// A folder that cannot be written to; the errors of `make`.
    pub fn temporary(
        label: String,
        output: &Path,
        name: &str,
        resources: &Resources,
        make: impl FnOnce(&Path) -> Result<Vec<String>>,
    ) -> Result<Self> {
        let folder = folder_for(output, resources.temp_dir.as_deref());
        let temporary = tempfile::Builder::new()
            .prefix(".terrane-")
            .tempdir_in(folder)
            .map_err(|e| Error::write(folder, e))?;
        let path = temporary.path().join(name);
        let notes = make(&path)?;
        Ok(Self { _temporary: Some(temporary), ..Self::kept(label, path, notes)? })
    }

    /// A file that `make` writes into a work folder, unless it is there already; `beside` are files that it reads beside
    /// the point cloud.
    ///
    /// # Errors
    /// As [`MadeInput::temporary`]; a file that was not made there, or of other files, or by another `request`.
    pub fn in_folder(
        label: String,
        source: &Inputs,
        beside: Vec<PathBuf>,
        folder: &Path,
        name: &str,
        request: &dyn erased_serde::Serialize,
        make: impl FnOnce(&Path) -> Result<Vec<String>>,
    ) -> Result<Self> {
        refuse_in_memory(source.names())?;
        let (path, record) = (folder.join(name), folder.join(name).with_extension("json"));
        let invalid = |e| Error::new(ErrorKind::Internal, format!("the request is not JSON: {e}"));
        let files = cloud::files(source.names())?;
        let files = files.iter().filter(|name| !is_made(name));
        let files = files.map(|name| path_of(name).into_owned()).chain(beside).collect();
        let mut made = MadeOf {
            revision: REVISION,
            request: json::to_value(request).map_err(invalid)?,
            files: stat(&with_companions(files))?,
            made: None,
            notes: Vec::new(),
        };
        let refused = |what: &str| {
            let error = Error::usage(what).in_file(&path);
            error.remedy("choose another work folder, or remove this one")
        };
        match MadeOf::recorded(&record) {
            None if path.exists() => return Err(refused("is not a file of this job")),
            None => {}
            Some(there) => {
                let files = there.files.iter().zip(&mut made.files);
                files.for_each(|(there, here)| here.forgive_time(there));
                if !there.is_of(&made) {
                    return Err(refused("was made of other files, or with other options"));
                }
                if let Some(file) = there.made.as_ref().filter(|_| path.exists()) {
                    file.check(false)?;
                    return Self::kept(label, path, there.notes);
                }
            }
        }
        std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
        // What is there without the rest of its record was interrupted.
        write_json(&record, &made)?;
        made.notes = make(&path)?;
        made.made = stat(std::slice::from_ref(&path))?.pop();
        write_json(&record, &made)?;
        Self::kept(label, path, made.notes)
    }

    /// Reports an error of the file as an error of the point cloud.
    pub fn renamed(&self, error: Error) -> Error {
        match error.path() {
            Some(path) if path == self.path => error.renamed(Path::new(&self.inputs.to_string())),
            _ => error,
        }
    }
}
