//! A points-to-points job with its input open, and the order of its steps.

use std::path::Path;

use super::above::look::Looking;
use super::assign::Assigning;
use super::discs::Discs;
use super::job::TranslateJob;
use super::moved::Move;
use super::noise::{self, Marked};
use super::overlap::{FlightLines, Overlap};
use super::portion::Portion;
use super::shares::Shares;
use super::sorted::{Sort, Sorted};
use super::split::Values;
use super::thin::{self, Thin};
use crate::records::choice::{Choice, Chosen};
use crate::records::{Records, total};
use terrane_base::error::Result;
use terrane_base::geom::Apart;
use terrane_cloud::write::WriteOptions;
use terrane_cloud::{Carrier, Cloud, CloudInfo};
use terrane_engine::plan::At;
use terrane_files::folder_for;

/// A job whose input is open.
pub(super) struct Work<'a> {
    pub(super) job: &'a TranslateJob,
    pub(super) input: &'a Cloud,
    /// What is read, in the frame that methods work in.
    pub(super) cloud: &'a CloudInfo,
    /// What is known before points are moved.
    pub(super) told: &'a CloudInfo,
    pub(super) assigning: &'a Assigning,
    /// What records are divided by.
    pub(super) values: Option<&'a Values>,
    /// What is written.
    pub(super) info: &'a CloudInfo,
    pub(super) moved: Option<&'a Move>,
    pub(super) carrier: &'a Carrier<'a>,
    pub(super) options: WriteOptions,
    pub(super) shares: Shares,
    /// The squares that are made, if not all.
    pub(super) portion: Option<&'a Portion<'a>>,
    pub(super) at: At<'a>,
}

impl Work<'_> {
    /// The records without those that are there twice, where these are not wanted.
    pub(super) fn single<'r>(&self, records: &'r dyn Records) -> Result<Option<Chosen<'r>>> {
        let twice = thin::Twice::new(self.options.format);
        let choose = || self.choose(records, &twice, "points there twice");
        self.job.dedupe.then(choose).transpose()
    }

    /// The records with the class of noise for those that are, where it is looked for.
    pub(super) fn mark<'r>(&self, records: &'r dyn Records) -> Result<Option<Marked<'r>>> {
        let look = |asked| noise::Looking {
            asked,
            info: self.carrier.info(),
            format: self.carrier.format(),
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks,
            folder: self.folder(),
            keeps_withheld: self.job.cloud.filter.keep_withheld,
            at: self.at,
        };
        self.job.above.noise().map(|asked| look(asked).mark(records)).transpose()
    }

    pub(super) fn lines<'r>(
        &self,
        records: &'r dyn Records,
        overlap: Overlap,
    ) -> Result<Chosen<'r>> {
        let (side, format) = (overlap.side(self.told), self.options.format);
        let lines = FlightLines::new(side, &self.told.frame, format)?;
        self.choose(records, &lines, "flight lines")
    }

    pub(super) fn thin<'r>(&self, records: &'r dyn Records, thin: Thin) -> Result<Chosen<'r>> {
        self.choose(records, &thin::Cells::new(thin, &self.told.frame)?, "cells")
    }

    pub(super) fn discs(&self, least: f64) -> Discs<'_> {
        Discs {
            apart: Apart::new(self.told.frame.scale, least),
            info: self.told,
            format: self.options.format,
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks,
            folder: self.folder(),
            at: self.at,
        }
    }

    pub(super) fn sort(&self, records: &dyn Records, by: Sort) -> Result<Sorted> {
        let held = (self.shares.flow, self.shares.marks / 4, self.folder());
        Sorted::new(records, (by, self.options.format), held, self.at)
    }

    pub(super) fn looking(&self) -> Looking<'_> {
        let square = self.job.above.square(self.cloud);
        Looking {
            above: &self.job.above,
            info: self.cloud,
            shift: self.carrier.shift(),
            format: self.carrier.format(),
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks.saturating_sub(square),
            square,
            folder: self.folder(),
            keeps_withheld: self.job.cloud.filter.keep_withheld,
            portion: self.portion,
            at: self.at,
        }
    }

    fn choose<'r>(
        &self,
        records: &'r dyn Records,
        choice: &dyn Choice,
        stage: &str,
    ) -> Result<Chosen<'r>> {
        self.at.progress.begin(stage, total(records));
        let held = (self.shares.flow, self.shares.marks, self.folder());
        let chosen = Chosen::new(records, choice, held, self.at)?;
        self.at.progress.end();
        Ok(chosen)
    }

    /// Where what has to wait goes: beside the output, which a plan is far from.
    pub(super) fn folder(&self) -> &Path {
        match (&self.job.resources.temp_dir, self.portion) {
            (None, Some(portion)) => portion.folder,
            (asked, _) => folder_for(&self.job.output, asked.as_deref()),
        }
    }
}
