//! A job on points with all it needs: done whole, in portions, or looked at before.

use std::path::Path;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::carried::CarriedRecords;
use super::noise::{Marked, Noise};
use super::{HeightsAs, Made, Shares, TranslateJob, TranslateReport, Work, over};
use crate::grid::preset::Seen;
use terrane_base::error::{Error, Result};
use terrane_cloud::write::{Packing, packing_by_name};
use terrane_cloud::{Carrier, Cloud, CloudInfo, PointSource, Target};
use terrane_engine::figures::Figures;
use terrane_engine::sift::Losses;
use terrane_engine::transform::Transformed;

/// A job that is ready to be done.
pub(super) struct Prepared<'a> {
    pub(super) work: Work<'a>,
    pub(super) source: &'a CarriedRecords<'a>,
}

/// What has to be known of the whole cloud before some squares are made.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Looked {
    /// Which points are noise, where that has to be known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) noise: Option<Noise>,
    /// Of the ground, where something is told of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) seen: Option<Seen>,
}

impl Looked {
    /// What was found, one line each.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> + '_ {
        let noise = self.noise.iter().flat_map(|noise| &noise.notes);
        noise.chain(self.seen.iter().flat_map(|seen| &seen.notes)).cloned()
    }
}

impl Prepared<'_> {
    /// Writes what is asked for; tells what was made, and what became of points, one line each.
    pub(super) fn make(&self) -> Result<(Made, Vec<String>)> {
        let wide = self.work.job.wide(self.work.portion.is_some())?;
        self.work.run(self.source, wide.as_ref())
    }

    /// Writes it and tells of it, the work being begun at `start`.
    pub(super) fn report(&self, start: Instant) -> Result<TranslateReport> {
        let (made, found) = self.make()?;
        let Work { job, info, moved, carrier, shares, .. } = &self.work;
        let run = Figures::since(start, &job.resources).with_threads(shares.threads);
        let census = self.source.census();
        Ok(TranslateReport {
            input: job.input.join(", "),
            output: job.output.display().to_string(),
            point_format: carrier.format().number(),
            census: Some(census),
            files: made.files,
            points: made.points,
            crs: info.crs.label(),
            output_bytes: made.bytes,
            points_per_second: Some(run.rate(census.read)),
            run,
            transformed: moved.map(|moved| Transformed::of(&moved.operation)),
            notes: [self.notes(), self.losses().notes().collect(), found].concat(),
        })
    }

    /// Files whose damage was passed over.
    fn losses(&self) -> Losses {
        Losses::of(self.source.cloud())
    }

    /// What is told of the cloud and of what is carried, one line each.
    pub(super) fn notes(&self) -> Vec<String> {
        let Work { carrier, moved, .. } = &self.work;
        let moved = moved.iter().flat_map(|moved| &moved.notes);
        self.source.cloud().notes().iter().chain(carrier.notes()).chain(moved).cloned().collect()
    }

    /// What has to be known of the whole cloud: what is noise, and of the ground what some squares do not tell.
    pub(super) fn look(&self) -> Result<Looked> {
        let (work, above) = (&self.work, &self.work.job.above);
        let wide = work.job.wide(false)?;
        let is_own = wide.is_none() || above.noise().is_some();
        let single = if is_own { work.single(self.source)? } else { None };
        let records = over(&single, self.source);
        let marked = work.mark(records)?;
        let noted = |marked: &Marked<'_>| {
            let (own, notes) = (marked.noted(single.as_ref())?, marked.notes.clone());
            Ok(Noise { own, wide: None, notes })
        };
        let mut noise = marked.as_ref().map(noted).transpose()?;
        let seen = match wide {
            Some(wide) => Some(work.look_at_wide(&wide, noise.as_mut())?),
            None if above.is_asked() => Some(work.looking().look(over(&marked, records))?),
            None => None,
        };
        Ok(Looked { noise, seen })
    }
}

impl TranslateJob {
    /// What its points are to be in.
    pub(super) fn target(&self) -> Result<Target> {
        Ok(Target { format: self.format, version: self.version, packing: self.packing()? })
    }

    /// How its files are packed.
    pub(super) fn packing(&self) -> Result<Packing> {
        match (&self.squares, &self.split) {
            (Some((_, plain)), _) => Ok(if *plain { Packing::Plain } else { Packing::Chunks }),
            (None, Some(split)) => Ok(split.packing()),
            (None, None) => packing(&self.output),
        }
    }
}

/// Where the points of a job's cloud lie, as they are written.
pub(super) fn stored(job: &TranslateJob, cloud: &Cloud) -> Result<CloudInfo> {
    Ok(carrier(job, cloud)?.info().clone())
}

/// Bytes of a record that is written.
pub(super) fn record_bytes(job: &TranslateJob, cloud: &Cloud) -> Result<usize> {
    Ok(carrier(job, cloud)?.size())
}

/// What carries the points of a job that can be done.
pub(super) fn carrier<'a>(job: &TranslateJob, cloud: &'a Cloud) -> Result<Carrier<'a>> {
    let has_dimension = job.above.heights == Some(HeightsAs::Dimension);
    let carrier = Carrier::new(cloud, job.target()?, has_dimension)?;
    job.check((carrier.format(), job.packing()?), carrier.info())?;
    Ok(carrier)
}

/// Bytes of memory that a part of a job needs which looks at so many points, and those of them for a thread.
pub(super) fn least(job: &TranslateJob, cloud: &Cloud, points: u64) -> Result<[u64; 2]> {
    let carrier = carrier(job, cloud)?;
    let needed = job.needed(job.packing()?, carrier.info(), (points, true));
    Ok(Shares::least((carrier.size(), carrier.extra_bytes()), needed))
}

fn packing(path: &Path) -> Result<Packing> {
    packing_by_name(path).ok_or_else(|| {
        Error::usage("points are written as .las, .laz, .copc.laz, or text in .csv, .txt or .xyz")
            .in_file(path)
            .remedy("choose a name with one of these endings")
    })
}
