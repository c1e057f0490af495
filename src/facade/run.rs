//! What all jobs have in common: what they may use, who is told of them, who may stop them.

use std::path::PathBuf;

use terrane_base::Result;
use terrane_jobs::operation::Memory;
use terrane_jobs::{Cancel, Progress, Resources, Silent};

/// What a builder was told of its run.
pub(super) struct Run {
    pub(super) memory: Option<Memory>,
    pub(super) threads: Option<usize>,
    pub(super) temp_dir: Option<PathBuf>,
    pub(super) progress: Box<dyn Progress + Send>,
    pub(super) cancel: Cancel,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            memory: None,
            threads: None,
            temp_dir: None,
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

pub(super) use run_settings;
