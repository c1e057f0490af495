//! What all jobs have in common: what they may use, who is told of them, who may stop them.

use std::path::PathBuf;

use terrane_base::{Error, Result};
use terrane_jobs::operation::Memory;
use terrane_jobs::transform::Transform;
use terrane_jobs::{Cancel, Progress, Resources, Silent};

/// What a builder was told of its run.
pub(super) struct Run {
    pub(super) memory: Option<Memory>,
    pub(super) threads: Option<usize>,
    pub(super) temp_dir: Option<PathBuf>,
    pub(super) overwrite: bool,
    pub(super) progress: Box<dyn Progress + Send>,
    pub(super) cancel: Cancel,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            memory: None,
            threads: None,
            temp_dir: None,
            overwrite: false,
            progress: Box::new(Silent),
            cancel: Cancel::default(),
        }
    }
}

impl Run {
    /// What the job may use.
    pub(super) fn resources(&self) -> Result<Resources> {
        let usual = Resources::default();
        let memory = self.memory.as_ref().map_or(Ok(usual.memory), Memory::bytes)?;
        let threads = self.threads.map_or(usual.threads, |threads| threads.max(1));
        Ok(Resources { threads, memory, temp_dir: self.temp_dir.clone() })
    }
}

/// The reference system of an output, as a builder was told.
#[derive(Default)]
pub(super) struct System {
    pub(super) target: Option<String>,
    pub(super) shift_grid: Option<PathBuf>,
    pub(super) geoid: Option<PathBuf>,
}

impl System {
    /// What the job is to do, if anything.
    pub(super) fn transform(&self) -> Result<Option<Transform>> {
        let Self { target, shift_grid, geoid } = self;
        if target.is_none() && (shift_grid.is_some() || geoid.is_some()) {
            return Err(Error::usage("a grid of shifts and a geoid lead to another system")
                .remedy("say .to_crs(...), or leave them out"));
        }
        let (shift_grid, geoid) = (shift_grid.clone(), geoid.clone());
        Ok(target.clone().map(|target| Transform { target, shift_grid, geoid }))
    }
}

/// The reference system to write in, for a builder that has it as `system`.
macro_rules! system_settings {
    ([$($generic:tt)*] $builder:ty) => {
        impl<$($generic)*> $builder {
            /// Write in this reference system: a code such as `"EPSG:4326"` or `"EPSG:6339+6360"`, or well-known
            /// text. All that is decided is decided before, in the system of the input.
            pub fn to_crs(mut self, system: impl Into<String>) -> Self {
                self.system.target = Some(system.into());
                self
            }

            /// A file with a grid of shifts between the datums of both systems (NTv2), which takes the place of
            /// what is known of them.
            pub fn shift_grid(mut self, file: impl Into<std::path::PathBuf>) -> Self {
                self.system.shift_grid = Some(file.into());
                self
            }

            /// A file with the heights of a geoid above the ellipsoid, in metres (GTX or GeoTIFF), for systems that
            /// count heights from different ones of the two.
            pub fn geoid(mut self, file: impl Into<std::path::PathBuf>) -> Self {
                self.system.geoid = Some(file.into());
                self
            }
        }
    };
}

/// The settings of a run, for a builder that has them as `run`.
macro_rules! run_settings {
    ([$($generic:tt)*] $builder:ty) => {
        impl<$($generic)*> $builder {
            /// Most memory for everything the job holds: bytes, or a text such as `"512M"`. Half of the
            /// machine's, at most 4 GiB, unless told otherwise. No result depends on it.
            pub fn memory(mut self, most: impl Into<crate::Memory>) -> Self {
                self.run.memory = Some(most.into());
                self
            }

            /// Worker threads; all cores unless told otherwise. No result depends on them.
            pub fn threads(mut self, threads: usize) -> Self {
                self.run.threads = Some(threads);
                self
            }

            /// Folder for temporary files; the output's unless told otherwise.
            pub fn temp_dir(mut self, folder: impl Into<std::path::PathBuf>) -> Self {
                self.run.temp_dir = Some(folder.into());
                self
            }

            /// Who is told how far the job is.
            pub fn progress(mut self, told: impl crate::Progress + Send + 'static) -> Self {
                self.run.progress = Box::new(told);
                self
            }

            /// What may stop the job: once cancelled, it fails with [`ErrorKind::Interrupted`] and leaves
            /// nothing behind.
            ///
            /// [`ErrorKind::Interrupted`]: crate::ErrorKind::Interrupted
            pub fn cancel(mut self, by: &crate::Cancel) -> Self {
                self.run.cancel = by.clone();
                self
            }
        }
    };
}

/// The leave to replace files, for a builder that writes.
macro_rules! overwrite_setting {
    ([$($generic:tt)*] $builder:ty) => {
        impl<$($generic)*> $builder {
            /// Replace an output that exists, once the new one is complete; else that is an error.
            pub fn overwrite(mut self, overwrite: bool) -> Self {
                self.run.overwrite = overwrite;
                self
            }
        }
    };
}

/// The same, and the format that is written, for a builder that has it as `format`.
macro_rules! output_settings {
    ([$($generic:tt)*] $builder:ty) => {
        super::run::overwrite_setting!([$($generic)*] $builder);

        impl<$($generic)*> $builder {
            /// Write this format, by its name, instead of the one of the file's ending.
            pub fn format(mut self, name: impl Into<String>) -> Self {
                self.format = Some(name.into());
                self
            }
        }
    };
}

pub(super) use {output_settings, overwrite_setting, run_settings, system_settings};
