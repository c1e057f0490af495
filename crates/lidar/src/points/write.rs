//! Output of records: a file, text, an octree (COPC), or a folder of files.

use std::io::Write;
use std::path::Path;

use rayon::prelude::*;

use super::context::TranslateContext;
use super::octree::{Octree, OctreePlacement};
use super::split::{MAX_FILES, SplitColumn};
use super::tile_subset::TileSubset;
use super::tiled_output::{self, FilledBuckets, PointTileSplitter, PointTiling, Spans, SplitFiles};
use crate::records::{PointRecords, RecordPacker, total};
use terrane_base::error::{Error, Result};
use terrane_cloud::write::{CloudWriteOptions, CloudWriter, PointPacking};
use terrane_files::Buckets;
use terrane_files::atomic::{AtomicFile, AtomicFolder, Sidecar};

/// Lines formatted by a thread at a time.
const LINES: usize = 4096;

impl TranslateContext<'_> {
    pub(super) fn write(&self, records: &dyn PointRecords) -> Result<SplitFiles> {
        if let Some(split) = self.split {
            return self.write_split(split, records);
        }
        match (&self.job.squares, self.options.packing) {
            (Some((squares, _)), _) => self.divide(*squares, records),
            (None, PointPacking::Nodes) => self.octree(records),
            (None, PointPacking::Text) => self.text(records),
            (None, _) => self.file(records),
        }
    }

    fn file(&self, records: &dyn PointRecords) -> Result<SplitFiles> {
        let mut writer = CloudWriter::create(&self.job.output, &self.options)?;
        self.at.progress.begin("points", total(records));
        let mut packer = RecordPacker::new(&mut writer, self.shares.threads);
        self.shares.flow.run(records, self.at, &mut |bytes| packer.take(bytes))?;
        packer.finish()?;
        self.at.progress.end();
        finish(writer)
    }

    fn text(&self, records: &dyn PointRecords) -> Result<SplitFiles> {
        let path = &self.job.output;
        let sidecar = path.with_extension("prj");
        let sidecar = Sidecar::new(
            sidecar,
            self.info.crs.to_wkt().map(|text| text + "\n"),
            |existing: &str| self.info.crs.is_said_by(existing),
            self.job.overwrite,
        )?;
        let mut file = AtomicFile::create(path, self.job.overwrite)?;
        let lines = self.converter.lines(&self.info.frame);
        file.write_all(lines.heading().as_bytes()).map_err(|e| Error::write(path, e))?;
        self.at.progress.begin("points", total(records));
        let (size, mut points) = (self.shares.flow.record, 0);
        self.shares.flow.run(records, self.at, &mut |bytes| {
            points += (bytes.len() / size) as u64;
            let parts: Vec<_> =
                bytes.par_chunks(LINES * size).map(|some| lines.lines(some)).collect();
            for text in &parts {
                file.write_all(text.as_bytes()).map_err(|e| Error::write(path, e))?;
            }
            Ok(())
        })?;
        self.at.progress.end();
        let bytes = file.commit()?;
        sidecar.commit()?;
        Ok(SplitFiles { files: 1, points, bytes })
    }

    fn octree(&self, records: &dyn PointRecords) -> Result<SplitFiles> {
        let place = &OctreePlacement::new(self.info);
        let options = CloudWriteOptions { cube: Some(place.cube()), ..self.options.clone() };
        let mut writer = CloudWriter::create(&self.job.output, &options)?;
        let (layout, folder) = (writer.layout(), self.folder());
        let octree = Octree { place, layout, folder, memory: self.shares.columns(), at: self.at };
        octree.write(records, self.shares.flow, &mut writer)?;
        finish(writer)
    }

    fn divide(&self, squares: PointTiling, records: &dyn PointRecords) -> Result<SplitFiles> {
        if let Some(TileSubset { spans, folder, .. }) = self.subset {
            return self.files(squares, *spans, records, folder);
        }
        let folder =
            AtomicFolder::create(&self.job.output, self.job.overwrite, tiled_output::is_ours)?;
        let spans = tiled_output::spans(&squares, self.info)?;
        let made = self.files(squares, spans, records, folder.inside())?;
        folder.commit()?;
        Ok(made)
    }

    fn write_split(&self, split: &SplitColumn, records: &dyn PointRecords) -> Result<SplitFiles> {
        let folder = AtomicFolder::create(&self.job.output, self.job.overwrite, |folder| {
            split.is_ours(folder)
        })?;
        let (flow, threads) = (self.shares.flow, self.shares.threads);
        let buckets = Buckets::new(self.folder(), MAX_FILES, self.shares.of_output() / 2);
        let names = split.distribute(records, flow, &buckets, self.at)?;
        let all = FilledBuckets { buckets: &buckets, count: names.len(), options: &self.options };
        let written = all.write(
            flow.record,
            threads,
            folder.inside(),
            |number| names[number].clone(),
            self.at,
        )?;
        folder.commit()?;
        Ok(written)
    }

    /// Writes the files of some tiles into a folder.
    fn files(
        &self,
        squares: PointTiling,
        spans: Spans,
        records: &dyn PointRecords,
        folder: &Path,
    ) -> Result<SplitFiles> {
        let memory = self.shares.of_output() / 2;
        let splitter =
            PointTileSplitter::new(squares, spans, self.info, self.folder(), memory, &self.options);
        splitter.write(records, self.shares.flow, self.shares.threads, folder, self.at)
    }
}

fn finish(writer: CloudWriter) -> Result<SplitFiles> {
    let points = writer.points();
    Ok(SplitFiles { files: 1, points, bytes: writer.finish()? })
}
