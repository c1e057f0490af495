//! Proof of a mesh of several bands: each channel is proved as a surface with the values of its band as heights.
//! The heights are proved likewise.

use std::path::Path;

use super::context::MeshRequirements;
use super::findings::{FaultReport, NO_BOUND};
use super::options::{MeshProof, ProofQuestion, SelectedBands};
use super::parts::verify;
use super::report::{BandProof, OfGrid, VerifyReport};
use super::stated::tolerance;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point3};
use terrane_engine::bands::{JoinedBands, MeshBands, label};
use terrane_engine::memory::cache_beside;
use terrane_engine::proof::ProofVerdict;
use terrane_engine::{Cancel, Progress};
use terrane_mesh::{self as mesh, HeightBand, MeshInfo, MeshSource, Promises};
use terrane_raster::GridSource;

/// A mesh and a job that names bands.
pub(super) struct MultibandProof<'a> {
    pub(super) job: &'a ProofQuestion<'a, MeshProof>,
    pub(super) mesh: &'a dyn MeshSource,
    pub(super) stated: &'a Promises,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

impl MultibandProof<'_> {
    /// Proves every channel and the heights; also returns the CRS of the grid.
    pub(super) fn run(&self, selected: &SelectedBands) -> Result<(VerifyReport, Crs)> {
        let written = self.job.written;
        let heights = selected.heights.map(HeightBand::Band).or(self.stated.heights);
        let bands =
            bands(self.mesh.info(), self.stated, selected).map_err(|e| e.in_file(&written.file))?;
        let tolerance = self.job.options.tolerance().or(tolerance(self.stated));
        let cache = cache_beside(self.job.options.resources.memory);
        let options = self.job.options.grid.options(&self.job.options.resources, cache)?;
        let joined = bands
            .open(&written.original, &options)
            .map_err(|e| e.in_file(Path::new(&written.original.to_string())))?;
        let mut report = None;
        match heights {
            Some(HeightBand::Band(band)) => {
                let index = bands.list().iter().position(|(number, _)| *number == band);
                let index = index.unwrap_or_default();
                let allowed = allowed(tolerance, bands.list()[index].1);
                report = Some(self.surface(self.mesh, &*joined.band(index), allowed)?);
            }
            Some(HeightBand::None) => {
                report = Some(self.surface(self.mesh, &*joined.flat(), Some(0.0))?)
            }
            None => {}
        }
        let has_heights = report.is_some();
        let report = self.channels(&bands, &joined, tolerance, report)?;
        Ok((judged(report, tolerance, has_heights), joined.band(0).info().crs.clone()))
    }

    /// Proves the channels, and adds their findings to those of the heights.
    fn channels(
        &self,
        bands: &MeshBands,
        joined: &JoinedBands,
        tolerance: Option<f64>,
        heights: Option<VerifyReport>,
    ) -> Result<VerifyReport> {
        let mut all = heights;
        for (index, &(band, weight)) in bands.list().iter().enumerate() {
            let allowed = allowed(tolerance, weight);
            let channel = ChannelMesh::new(self.mesh, index);
            let found = self.surface(&channel, &*joined.band(index), allowed)?;
            let proof = BandProof {
                band,
                weight,
                tolerance: allowed,
                max_error: found.max_error,
                max_error_at: found.max_error_at,
                rmse: found.rmse,
                over: found.over_tolerance.count,
            };
            let report = all.get_or_insert_with(|| VerifyReport {
                verdict: ProofVerdict::default(),
                over_tolerance: FaultReport::default(),
                ..found.clone()
            });
            add(report, &found, proof);
        }
        all.ok_or_else(|| Error::usage("no band selected").remedy("pass ‹bands›"))
    }

    fn surface(
        &self,
        mesh: &dyn MeshSource,
        grid: &dyn GridSource,
        tolerance: Option<f64>,
    ) -> Result<VerifyReport> {
        let requirements = MeshRequirements {
            min_angle: self.job.options.min_angle,
            ..MeshRequirements::of_samples(tolerance)
        };
        verify(mesh, grid, requirements, &self.job.options.resources, self.progress, self.cancel)
    }
}

/// The largest allowed error in a band of this weight.
fn allowed(tolerance: Option<f64>, weight: f64) -> Option<f64> {
    tolerance.map(|tolerance| (tolerance / weight).min(f64::MAX))
}

/// Adds the findings of one channel to the report.
fn add(report: &mut VerifyReport, found: &VerifyReport, proof: BandProof) {
    // Faults of the triangles are found again with every channel.
    let known = &report.verdict.failures;
    let new = found.verdict.failures.iter().filter(|failure| !known.contains(failure));
    let new: Vec<String> = new.map(|failure| format!("band {}: {failure}", proof.band)).collect();
    report.verdict.failures.extend(new);
    report.over_tolerance.count += found.over_tolerance.count;
    report.over_tolerance.first = report.over_tolerance.first.or(found.over_tolerance.first);
    report.run.spilled_bytes = report.run.spilled_bytes.max(found.run.spilled_bytes);
    report.of.bands.push(proof);
}

/// The verdict of all, with the largest weighted error.
fn judged(report: VerifyReport, tolerance: Option<f64>, has_heights: bool) -> VerifyReport {
    let bands = report.of.bands.iter();
    let worst = bands.filter_map(|proof| Some((proof.max_error? * proof.weight, proof)));
    let worst = worst.reduce(|a, b| if b.0 > a.0 { b } else { a });
    let (max_error, max_error_at) =
        worst.map_or((None, None), |(error, proof)| (Some(error), proof.max_error_at));
    let mut not_judged = Vec::new();
    not_judged.extend(tolerance.is_none().then(|| NO_BOUND.to_owned()));
    not_judged.extend((!has_heights).then(|| "its heights (‹band›)".to_owned()));
    let verdict = ProofVerdict::of(report.verdict.failures.clone(), not_judged);
    let of = OfGrid { surface_error: None, surface_error_at: None, breaks: 0, ..report.of };
    VerifyReport {
        of,
        verdict,
        tolerance,
        max_error,
        max_error_at,
        rmse: None,
        mean_error: None,
        error_histogram: Vec::new(),
        ..report
    }
}

/// The selected bands with their weights; fails where the mesh has other channels or states other bands.
fn bands(info: &MeshInfo, stated: &Promises, selected: &SelectedBands) -> Result<MeshBands> {
    let label = label(&selected.bands);
    if let Some(others) = stated.bands.as_ref().filter(|bands| **bands != selected.bands) {
        let others = self::label(others);
        let message = format!("the mesh states that it was made of bands {others}, not {label}");
        return Err(Error::usage(message).remedy(format!("pass ‹bands› {others}")));
    }
    let weights = match selected.weights.is_empty() {
        true => stated.weights.clone().unwrap_or_default(),
        false => selected.weights.clone(),
    };
    let bands = MeshBands::new(&selected.bands, &weights, selected.heights)?;
    let names = info.channels.iter().map(String::as_str);
    let expected = bands.list().iter().map(|(band, _)| format!("band_{band}"));
    let is_colour = mesh::is_colour(names) && info.channels.len() == bands.list().len();
    if is_colour || info.channels.iter().cloned().eq(expected) {
        return Ok(bands);
    }
    let has = match info.channels.as_slice() {
        [] => "no channels at its vertices".to_owned(),
        names => format!("the channels {}", names.join(", ")),
    };
    Err(Error::usage(format!("the mesh has {has} instead of bands {label}"))
        .remedy("omit ‹bands›, or pass the bands of the mesh"))
}

/// The note for a mesh that states bands where none were selected: channels are not judged.
pub(super) fn not_judged(label: &str) -> String {
    format!("the errors of its channels in bands {label} (‹bands›)")
}

/// A channel of a mesh as its heights.
struct ChannelMesh<'a> {
    mesh: &'a dyn MeshSource,
    index: usize,
    info: MeshInfo,
}

impl<'a> ChannelMesh<'a> {
    fn new(mesh: &'a dyn MeshSource, index: usize) -> Self {
        let mut info = mesh.info().clone();
        // Channels are stored without the origin and scale of positions.
        (info.origin[2], info.scale[2]) = (0.0, 1.0);
        Self { mesh, index, info }
    }
}

impl MeshSource for ChannelMesh<'_> {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        self.mesh.read_vertices(first, out)?;
        let channels = self.info.channels.len();
        let mut values = vec![0.0; out.len() * channels];
        self.mesh.read_channels(first, &mut values)?;
        for (point, values) in out.iter_mut().zip(values.chunks_exact(channels)) {
            point[2] = values[self.index];
        }
        Ok(())
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        self.mesh.read_triangles(first, out)
    }
}
