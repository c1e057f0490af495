//! Long jobs: run on a separate thread without the interpreter lock, with checks for signals and progress
//! callbacks.

use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use terrane::{Cancel, Memory, Progress, Result};

use crate::error::to_python;

/// Interval of checks for signals, and of progress callbacks.
const TICK: Duration = Duration::from_millis(30);

/// Resources and progress callback from Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct JobSettings {
    threads: Option<usize>,
    memory: Option<MemoryAmount>,
    progress: Option<Py<PyAny>>,
}

#[derive(FromPyObject)]
enum MemoryAmount {
    Bytes(u64),
    Text(String),
}

/// The same for a builder.
pub(crate) struct BuilderSettings {
    pub(crate) threads: Option<usize>,
    pub(crate) memory: Option<Memory>,
    pub(crate) progress: SharedStage,
    pub(crate) cancel: Cancel,
}

/// Applies `machine` to a builder.
macro_rules! with_machine {
    ($builder:expr, $machine:expr) => {{
        let machine = $machine;
        let mut builder = $builder.progress(machine.progress.clone()).cancel(&machine.cancel);
        if let Some(threads) = machine.threads {
            builder = builder.threads(threads);
        }
        if let Some(memory) = machine.memory.clone() {
            builder = builder.memory(memory);
        }
        builder
    }};
}
pub(crate) use with_machine;

/// Current stage of a job; written by its threads, read at intervals.
#[derive(Clone, Default)]
pub(crate) struct SharedStage(Arc<Mutex<StageProgress>>);

#[derive(Clone, Default, PartialEq)]
struct StageProgress {
    stage: String,
    done: u64,
    total: u64,
}

impl SharedStage {
    fn status(&self) -> std::sync::MutexGuard<'_, StageProgress> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for SharedStage {
    fn begin(&self, stage: &str, total: u64) {
        *self.status() = StageProgress { stage: stage.to_owned(), done: 0, total };
    }

    fn advance(&self, units: u64) {
        self.status().done += units;
    }

    fn end(&self) {
        let mut status = self.status();
        status.done = status.total;
    }
}

/// Runs `work` on a separate thread. A signal (Ctrl-C), or an exception of the progress callback, stops it, and
/// is raised after it has stopped.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    settings: JobSettings,
    work: impl FnOnce(&BuilderSettings) -> Result<T> + Send,
) -> PyResult<T> {
    let JobSettings { threads, memory, progress } = settings;
    let memory = memory.map(|memory| match memory {
        MemoryAmount::Bytes(bytes) => Memory::from(bytes),
        MemoryAmount::Text(text) => Memory::from(text),
    });
    let (stage, cancel) = (SharedStage::default(), Cancel::default());
    let machine =
        BuilderSettings { threads, memory, progress: stage.clone(), cancel: cancel.clone() };
    let mut last = StageProgress::default();
    let mut look = |py: Python<'_>| -> PyResult<()> {
        py.check_signals()?;
        let Some(progress) = &progress else { return Ok(()) };
        let now = stage.status().clone();
        if now != last {
            last = now.clone();
            progress.call1(py, (now.stage, now.done, now.total))?;
        }
        Ok(())
    };
    let (done, stopped) = py.detach(|| {
        std::thread::scope(|scope| {
            let (end, ended) = sync_channel::<()>(1);
            let machine = &machine;
            let worker = scope.spawn(move || {
                let done = work(machine);
                drop(end);
                done
            });
            let mut stopped = None;
            while ended.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                if stopped.is_none() {
                    stopped = Python::attach(&mut look).err();
                    if stopped.is_some() {
                        cancel.cancel();
                    }
                }
            }
            (worker.join(), stopped)
        })
    });
    if let Some(stopped) = stopped {
        return Err(stopped);
    }
    let done =
        done.map_err(|_| PyRuntimeError::new_err("the job failed: internal error of terrane"))?;
    let done = to_python(py, done)?;
    look(py)?;
    Ok(done)
}
