//! A points-to-points job with its input open, and the order of its steps.

use std::path::Path;

use super::assign::AttributeAssigner;
use super::discs::PoissonDiscs;
use super::flight_lines::{FlightLines, Overlap};
use super::height_above_ground::ground_search::GroundHeightSearch;
use super::job::TranslateJob;
use super::memory_shares::TranslateMemory;
use super::noise::{self, MarkedRecords};
use super::reprojection::CloudReprojection;
use super::sorted::{Sort, SortedRecords};
use super::split::SplitColumn;
use super::thinning::{self, CellThinning};
use super::tile_subset::TileSubset;
use crate::records::selection::{ChosenRecords, RecordRanking};
use crate::records::{PointRecords, total};
use terrane_base::error::Result;
use terrane_base::geom::DistancePredicate;
use terrane_cloud::write::CloudWriteOptions;
use terrane_cloud::{CloudInfo, PointCloud, PointFormatConverter};
use terrane_engine::plan::RunControl;
use terrane_files::folder_for;

/// A job whose input is open.
pub(super) struct TranslateContext<'a> {
    pub(super) job: &'a TranslateJob,
    pub(super) input: &'a PointCloud,
    /// The input, in the frame of the methods.
    pub(super) cloud: &'a CloudInfo,
    /// Properties before reprojection.
    pub(super) input_info: &'a CloudInfo,
    pub(super) assigning: &'a AttributeAssigner,
    /// The split column, if any.
    pub(super) split: Option<&'a SplitColumn>,
    /// Properties of the output.
    pub(super) info: &'a CloudInfo,
    pub(super) reprojection: Option<&'a CloudReprojection>,
    pub(super) converter: &'a PointFormatConverter<'a>,
    pub(super) options: CloudWriteOptions,
    pub(super) shares: TranslateMemory,
    /// The tiles to make, if not all.
    pub(super) subset: Option<&'a TileSubset<'a>>,
    pub(super) at: RunControl<'a>,
}

impl TranslateContext<'_> {
    /// The records without duplicates, if requested.
    pub(super) fn single<'r>(
        &self,
        records: &'r dyn PointRecords,
    ) -> Result<Option<ChosenRecords<'r>>> {
        let key = thinning::DuplicateKey::new(self.options.format);
        self.job.dedupe.then(|| self.select(records, &key, "duplicate points")).transpose()
    }

    /// The records with classified noise, if requested.
    pub(super) fn mark<'r>(
        &self,
        records: &'r dyn PointRecords,
    ) -> Result<Option<MarkedRecords<'r>>> {
        let search = self.job.above.noise().map(|request| noise::NoiseSearch {
            request,
            info: self.converter.info(),
            format: self.converter.format(),
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks,
            folder: self.folder(),
            keeps_withheld: self.job.cloud.filter.keep_withheld,
            at: self.at,
        });
        search.map(|search| search.mark_records(records)).transpose()
    }

    pub(super) fn lines<'r>(
        &self,
        records: &'r dyn PointRecords,
        overlap: Overlap,
    ) -> Result<ChosenRecords<'r>> {
        let (side, format) = (overlap.side(self.input_info), self.options.format);
        let lines = FlightLines::new(side, &self.input_info.frame, format)?;
        self.select(records, &lines, "flight lines")
    }

    pub(super) fn thin<'r>(
        &self,
        records: &'r dyn PointRecords,
        thin: CellThinning,
    ) -> Result<ChosenRecords<'r>> {
        self.select(records, &thinning::ThinningCells::new(thin, &self.input_info.frame)?, "cells")
    }

    pub(super) fn discs(&self, distance: f64) -> PoissonDiscs<'_> {
        PoissonDiscs {
            apart: DistancePredicate::new(self.input_info.frame.scale, distance),
            info: self.input_info,
            format: self.options.format,
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks,
            folder: self.folder(),
            at: self.at,
        }
    }

    pub(super) fn sort(&self, records: &dyn PointRecords, by: Sort) -> Result<SortedRecords> {
        let (format, memory) = (self.options.format, self.shares.marks / 4);
        SortedRecords::new(records, by, format, self.shares.flow, memory, self.folder(), self.at)
    }

    pub(super) fn ground_search(&self) -> GroundHeightSearch<'_> {
        let square = self.job.above.square(self.cloud);
        GroundHeightSearch {
            above: &self.job.above,
            info: self.cloud,
            shift: self.converter.shift(),
            format: self.converter.format(),
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks.saturating_sub(square),
            square,
            folder: self.folder(),
            keeps_withheld: self.job.cloud.filter.keep_withheld,
            subset: self.subset,
            at: self.at,
        }
    }

    fn select<'r>(
        &self,
        records: &'r dyn PointRecords,
        choice: &dyn RecordRanking,
        stage: &str,
    ) -> Result<ChosenRecords<'r>> {
        self.at.progress.begin(stage, total(records));
        let (flow, memory) = (self.shares.flow, self.shares.marks);
        let chosen = ChosenRecords::new(records, choice, flow, memory, self.folder(), self.at)?;
        self.at.progress.end();
        Ok(chosen)
    }

    /// Folder for spilled data: that of the output.
    pub(super) fn folder(&self) -> &Path {
        match (&self.job.resources.temp_dir, self.subset) {
            (None, Some(subset)) => subset.folder,
            (temp_dir, _) => folder_for(&self.job.output, temp_dir.as_deref()),
        }
    }
}
