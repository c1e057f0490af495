//! Reports as dictionaries: of jobs, verifications and inspections.

use std::path::PathBuf;

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use serde::Serialize;
use serde_json::{Map, Value as Json};
use terrane::{
    CloudInfoOptions, CloudMeshProof, CloudTilesProof, Data, Error, ErrorKind, FeaturesInfoOptions,
    GridInfoOptions, Inspection, Job, MeshInfoOptions, MeshProof, OutputProof, Reads, TilesProof,
    WrittenOutput, check_named,
};
use terrane_base::frontend::Frontend;
use terrane_options::{OptionTable, Options, fill, to_map};

use crate::work::BuilderSettings;

/// Report of a job as from `--json`.
pub(crate) fn dictionary<'py>(
    py: Python<'py>,
    report: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(report).map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
    py.import("json")?.getattr("loads")?.call1((Frontend::Python.spell_report(&text),))
}

/// A verification or an inspection by name.
pub(crate) struct AnyReport {
    pub(crate) name: &'static str,
    pub(crate) reads: Reads,
    pub(crate) table: &'static OptionTable,
    pub(crate) defaults: fn() -> Map<String, Json>,
    pub(crate) check: fn(&Map<String, Json>) -> terrane::Result<()>,
    pub(crate) run: Run,
}

/// Reports on data, or on a file made of it, with options by name.
type Run =
    fn(&dyn Data, Option<PathBuf>, &Map<String, Json>, &BuilderSettings) -> terrane::Result<Json>;

impl AnyReport {
    const fn of<O: Options>(name: &'static str, reads: Reads, run: Run) -> Self {
        let (defaults, check) = (|| to_map(&O::default()), check_named::<O>);
        Self { name, reads, table: O::TABLE, defaults, check, run }
    }

    const fn proof<O: OutputProof>(name: &'static str, reads: Reads) -> Self {
        Self::of::<O>(name, reads, |data, file, options, machine| {
            let written = WrittenOutput { file: file.unwrap_or_default(), original: data.inputs() };
            let job = Job::new(written, fill::<O>(&data.reading())?).with_named(options)?;
            json(&job.progress(machine.progress.clone()).cancel(&machine.cancel).run()?)
        })
    }

    const fn inspection<O: Inspection>(name: &'static str, reads: Reads) -> Self {
        Self::of::<O>(name, reads, |data, _, options, machine| {
            let job = Job::new(data.inputs(), fill::<O>(&data.reading())?).with_named(options)?;
            json(&job.progress(machine.progress.clone()).cancel(&machine.cancel).run()?)
        })
    }
}

fn json(report: &impl Serialize) -> terrane::Result<Json> {
    serde_json::to_value(report)
        .map_err(|e| Error::new(ErrorKind::Internal, format!("the report is not valid JSON: {e}")))
}

pub(crate) const REPORTS: [AnyReport; 8] = [
    AnyReport::proof::<MeshProof>("verify", Reads::Grid),
    AnyReport::proof::<CloudMeshProof>("verify-cloud", Reads::Cloud),
    AnyReport::proof::<TilesProof>("verify-tiles", Reads::Grid),
    AnyReport::proof::<CloudTilesProof>("verify-cloud-tiles", Reads::Cloud),
    AnyReport::inspection::<GridInfoOptions>("info", Reads::Grid),
    AnyReport::inspection::<MeshInfoOptions>("info-mesh", Reads::Grid),
    AnyReport::inspection::<CloudInfoOptions>("info-cloud", Reads::Cloud),
    AnyReport::inspection::<FeaturesInfoOptions>("info-features", Reads::Features),
];

/// The verification or inspection `name`.
pub(crate) fn report_named(name: &str) -> PyResult<&'static AnyReport> {
    let found = REPORTS.iter().find(|report| report.name == name);
    found.ok_or_else(|| PyValueError::new_err(format!("unknown report {name:?}")))
}
