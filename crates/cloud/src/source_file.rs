//! A file of a cloud: its parts, and the processing of their points.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::Mutex;

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Crs, Point, PointFrame};
use terrane_files::lock;

use super::attributes::{AttributeReader, PointTable};
use super::filter::{CloudFilter, FilterRecord, FilterVerdict};
use super::format::PointFormat;
use super::frame::ClaimedExtent;
use super::las::{self, LasFile, LasPointBlock, LegacyLasRecord, ModernLasRecord, unpacked};
use super::lazip::FieldSelection;
use super::point_filter::PointFilterPass;
use super::point_format::PointFormatConversion;
use super::raw::{Flags, RawPoint};
use super::source::{PointConsumer, ReturnCounts};
use super::text::{self, TextFile};

/// A file of either kind.
pub(super) enum CloudFile {
    Las(LasFile),
    Text(TextFile),
}

/// A file in the cloud.
pub(super) struct CloudSourceFile {
    pub(super) file: CloudFile,
    /// `None` if no point passes the filter.
    pub(super) pass: Option<PointFilterPass>,
    pub(super) salvage: bool,
    /// Lost points by part.
    pub(super) lost: Mutex<BTreeMap<usize, u64>>,
}

impl CloudFile {
    pub(super) fn crs(&self) -> &Crs {
        match self {
            Self::Las(file) => &file.crs,
            Self::Text(file) => &file.crs,
        }
    }

    pub(super) fn claim(&self) -> Option<ClaimedExtent> {
        match self {
            Self::Las(file) => file.claim(),
            Self::Text(file) => file.claim(),
        }
    }

    /// The lattice of its points.
    pub(super) fn lattice(&self) -> PointFrame {
        match self {
            Self::Las(file) => PointFrame { scale: file.header.scale, offset: file.header.offset },
            Self::Text(file) => file.lattice,
        }
    }

    /// Point format of its records, and whether they have GPS times.
    pub(super) fn attributes(&self) -> Result<(PointFormat, bool)> {
        match self {
            Self::Las(file) => {
                let format = PointFormat::new(file.header.format)?;
                Ok((format, format.time_at().is_some()))
            }
            Self::Text(file) => Ok((file.format(), file.has_time())),
        }
    }

    pub(super) fn notes(&self) -> &[String] {
        match self {
            Self::Las(file) => &file.notes,
            Self::Text(file) => &file.notes,
        }
    }
}

/// Buffers of a thread, kept between parts.
#[derive(Default)]
pub(super) struct SourceFileBuffers {
    records: las::LasReadBuffers,
    points: Vec<Point>,
}

/// Runs `work` with the buffers of the thread; nested calls get new buffers.
pub(super) fn with_buffers<T>(work: impl FnOnce(&mut SourceFileBuffers) -> T) -> T {
    thread_local! {
        static BUFFERS: Cell<Option<Box<SourceFileBuffers>>> = const { Cell::new(None) };
    }
    let mut buffers = BUFFERS.take().unwrap_or_default();
    let result = work(&mut buffers);
    BUFFERS.set(Some(buffers));
    result
}

/// Visitor of the points of a block, by format. Points come with the bytes of their records where these are read, else
/// with none.
trait RecordVisitor {
    fn visit<'r, R: RawPoint>(
        &mut self,
        first: u64,
        records: impl ExactSizeIterator<Item = (&'r [u8], R)> + Clone,
    ) -> Result<()>;
}

/// Passes on filtered points in batches.
struct PointBatcher<'a, 'b> {
    pass: &'a PointFilterPass,
    table: PointTable<'a>,
    counts: ReturnCounts,
    each: &'a mut PointConsumer<'b>,
}

impl RecordVisitor for PointBatcher<'_, '_> {
    fn visit<'r, R: RawPoint>(
        &mut self,
        first: u64,
        records: impl ExactSizeIterator<Item = (&'r [u8], R)> + Clone,
    ) -> Result<()> {
        self.pass.batch(records, first, &mut self.table, &mut self.counts, self.each)
    }
}

/// Consumer of filtered records, and of their bytes where whole records are read.
pub(super) type RecordConsumer<'a> = dyn FnMut(&FilterRecord, &[u8]) + 'a;

/// Visitor of filtered records.
struct FilteredRecordVisitor<'a> {
    pass: &'a PointFilterPass,
    counts: ReturnCounts,
    each: &'a mut RecordConsumer<'a>,
}

impl RecordVisitor for FilteredRecordVisitor<'_> {
    fn visit<'r, R: RawPoint>(
        &mut self,
        first: u64,
        records: impl ExactSizeIterator<Item = (&'r [u8], R)> + Clone,
    ) -> Result<()> {
        for (index, (bytes, raw)) in (first..).zip(records) {
            let record = self.pass.record(raw, index);
            self.counts.read += 1;
            match self.pass.judge(raw, bytes, &record) {
                FilterVerdict::Withheld => self.counts.withheld += 1,
                FilterVerdict::Filtered => self.counts.filtered += 1,
                FilterVerdict::Keep => {
                    self.counts.kept += 1;
                    (self.each)(&record, bytes);
                }
            }
        }
        Ok(())
    }
}

/// Passes on filtered records in another point format.
struct RecordConverter<'a, 'b> {
    pass: &'a PointFilterPass,
    conversion: &'a PointFormatConversion,
    /// Whether positions stay as stored.
    as_stored: bool,
    counts: ReturnCounts,
    out: Vec<u8>,
    each: &'a mut (dyn FnMut(&[u8]) -> Result<()> + 'b),
}

impl RecordVisitor for RecordConverter<'_, '_> {
    fn visit<'r, R: RawPoint>(
        &mut self,
        first: u64,
        records: impl ExactSizeIterator<Item = (&'r [u8], R)> + Clone,
    ) -> Result<()> {
        self.out.clear();
        for (index, (record, raw)) in (first..).zip(records) {
            let Some(place) = self.pass.pick(raw, record, index, &mut self.counts)? else {
                continue;
            };
            let place = (!self.as_stored).then_some(place);
            self.conversion.push(record, place, &mut self.out).map_err(|what| {
                Error::unsupported(format!("the point format cannot store {what}"))
                    .at(format_args!("point {index}"))
                    .remedy("choose ‹point_format› 6 or higher")
            })?;
        }
        (self.each)(&self.out)
    }
}

fn no_records() -> Error {
    Error::new(ErrorKind::Internal, "a decoder skipped a requested field")
}

impl CloudSourceFile {
    pub(super) fn parts(&self) -> usize {
        match &self.file {
            CloudFile::Las(file) => file.parts.len(),
            CloudFile::Text(file) => file.parts.len(),
        }
    }

    pub(super) fn points_of(&self, part: usize) -> u64 {
        match &self.file {
            CloudFile::Las(file) => file.parts.get(part).map_or(0, |part| part.points + part.lost),
            CloudFile::Text(file) => file.parts.get(part).map_or(0, |part| part.points),
        }
    }

    /// Whether a part may have points that pass the filter.
    pub(super) fn touches(&self, part: usize, filter: &CloudFilter) -> bool {
        self.pass.is_some() && self.cube(part).is_none_or(|[low, high]| filter.touches(low, high))
    }

    /// World bounds of the points of a part, if the file states them.
    pub(super) fn cube(&self, part: usize) -> Option<[[f64; 3]; 2]> {
        let CloudFile::Las(file) = &self.file else { return None };
        let [low, high] = file.parts.get(part)?.cube?;
        // Points are rounded to steps.
        let scale = self.file.lattice().scale;
        let lower = std::array::from_fn(|axis| low[axis] - scale[axis]);
        Some([lower, std::array::from_fn(|axis| high[axis] + scale[axis])])
    }

    /// Completes the counts of a part with lost points, which include those outside.
    fn with_lost(&self, part: usize, counts: ReturnCounts, points: u64) -> ReturnCounts {
        if points + counts.outside > 0 {
            lock(&self.lost).insert(part, points + counts.outside);
        }
        ReturnCounts { read: counts.read + points, lost: counts.lost + points, ..counts }
    }

    /// Number of lost points of all parts read so far.
    pub(super) fn lost(&self) -> u64 {
        lock(&self.lost).values().sum()
    }

    /// Passes on the filtered points of a part with the attributes that are read.
    pub(super) fn read(
        &self,
        part: usize,
        readers: &[AttributeReader],
        buffers: &mut SourceFileBuffers,
        each: &mut PointConsumer<'_>,
    ) -> Result<ReturnCounts> {
        let Some(pass) = &self.pass else { return Ok(ReturnCounts::default()) };
        let SourceFileBuffers { records, points } = buffers;
        let table = PointTable::new(std::mem::take(points), readers);
        let mut batcher = PointBatcher { pass, table, counts: ReturnCounts::default(), each };
        let wanted = match readers.iter().any(AttributeReader::needs_record) {
            true => FieldSelection::RECORDS,
            false => pass.needed_fields(readers),
        };
        let lost = self.visit(part, wanted, records, &mut batcher);
        *points = batcher.table.positions;
        Ok(self.with_lost(part, batcher.counts, lost?))
    }

    /// Passes on filtered points of a part, with their bytes if `whole`.
    pub(super) fn records(
        &self,
        part: usize,
        whole: bool,
        each: &mut RecordConsumer<'_>,
    ) -> Result<ReturnCounts> {
        let Some(pass) = &self.pass else { return Ok(ReturnCounts::default()) };
        let mut visitor = FilteredRecordVisitor { pass, counts: ReturnCounts::default(), each };
        let wanted = match whole || pass.needs_records() {
            true => FieldSelection::RECORDS,
            false => FieldSelection::ALL,
        };
        let lost =
            with_buffers(|buffers| self.visit(part, wanted, &mut buffers.records, &mut visitor))?;
        Ok(self.with_lost(part, visitor.counts, lost))
    }

    /// Passes on the filtered records of a part, converted.
    pub(super) fn convert_records(
        &self,
        part: usize,
        conversion: &PointFormatConversion,
        as_stored: bool,
        buffers: &mut SourceFileBuffers,
        each: &mut dyn FnMut(&[u8]) -> Result<()>,
    ) -> Result<ReturnCounts> {
        let Some(pass) = &self.pass else { return Ok(ReturnCounts::default()) };
        let mut converter = RecordConverter {
            pass,
            conversion,
            as_stored,
            counts: ReturnCounts::default(),
            out: Vec::new(),
            each,
        };
        let wanted = FieldSelection::RECORDS;
        let lost = self.visit(part, wanted, &mut buffers.records, &mut converter)?;
        Ok(self.with_lost(part, converter.counts, lost))
    }

    /// Passes the points of a part to `visitor`, block by block, with the bytes of their records if `wanted`; returns
    /// the number of lost points.
    fn visit(
        &self,
        part: usize,
        wanted: FieldSelection,
        buffers: &mut las::LasReadBuffers,
        visitor: &mut impl RecordVisitor,
    ) -> Result<u64> {
        match &self.file {
            CloudFile::Las(file) => {
                let (size, is_new) = (usize::from(file.header.record), file.header.is_new());
                let filter = self.pass.as_ref().map(PointFilterPass::options);
                file.prefetch(part, |next| {
                    filter.is_some_and(|filter| self.touches(next, filter))
                })?;
                file.records(part, wanted, self.salvage, buffers, &mut |first, block| {
                    match (block, is_new) {
                        (LasPointBlock::Fields(_), _) if wanted.records => Err(no_records()),
                        (LasPointBlock::Fields(fields), true) => {
                            visitor.visit(first, unpacked::<true>(fields).map(without_bytes))
                        }
                        (LasPointBlock::Fields(fields), false) => {
                            visitor.visit(first, unpacked::<false>(fields).map(without_bytes))
                        }
                        (LasPointBlock::Records(bytes), true) => {
                            let records = bytes.chunks_exact(size);
                            visitor.visit(first, records.map(|r| (r, ModernLasRecord::of(r))))
                        }
                        (LasPointBlock::Records(bytes), false) => {
                            let records = bytes.chunks_exact(size);
                            visitor.visit(first, records.map(|r| (r, LegacyLasRecord::of(r))))
                        }
                    }
                    .map_err(|e| e.in_file(&file.path))
                })
            }
            CloudFile::Text(file) => {
                let size = file.format().size();
                file.records(part, self.salvage, &mut |first, lines: &[text::TextPoint]| {
                    let visited = match wanted.records {
                        true => {
                            let records: Vec<_> =
                                lines.iter().map(text::TextPoint::record).collect();
                            let records = records.iter().map(|record| &record[..size]);
                            visitor.visit(first, records.zip(lines.iter().copied()))
                        }
                        false => visitor.visit(first, lines.iter().copied().map(without_bytes)),
                    };
                    visited.map_err(|e| e.in_file(&file.path))
                })
            }
        }
    }
}

/// A point whose record is not read.
fn without_bytes<R: RawPoint>(raw: R) -> (&'static [u8], R) {
    (&[], raw)
}

impl PointFilterPass {
    /// What is decoded of each point, beside x, y and return numbers.
    fn needed_fields(&self, readers: &[AttributeReader]) -> FieldSelection {
        if self.needs_records() {
            return FieldSelection::RECORDS;
        }
        let (filter, has) = (self.options(), |reader| readers.contains(&reader));
        let flags = !filter.keep_withheld || filter.drop != Flags::default();
        FieldSelection {
            class: filter.classes.is_some() || has(AttributeReader::Class),
            flags: flags || has(AttributeReader::Flags),
            ..FieldSelection::ALL
        }
    }
}
