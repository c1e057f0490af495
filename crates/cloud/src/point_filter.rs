//! Filtering of the records of a file into points in the cloud's frame.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;

use super::attributes::PointTable;
use super::condition::CompiledCondition;
use super::filter::{CloudFilter, CompiledFilter, FilterRecord, FilterVerdict};
use super::frame::{ClaimedExtent, FrameTransform};
use super::raw::{Flags, RawPoint};
use super::source::{PointConsumer, ReturnCounts};

/// Filter of the points of one file.
#[derive(Clone, Debug)]
pub(super) struct PointFilterPass {
    filter: CompiledFilter,
    /// Condition on attributes.
    condition: Option<CompiledCondition>,
    /// True if only withheld points are filtered.
    is_plain: bool,
    claim: ClaimedExtent,
    map: FrameTransform,
    salvage: bool,
}

/// Filtered points, and counts of the others.
#[derive(Default)]
struct FilterCounts {
    kept: usize,
    withheld: u64,
    filtered: u64,
    outside: u64,
}

impl PointFilterPass {
    /// For the points of one file.
    pub(super) fn new(
        filter: CompiledFilter,
        condition: Option<CompiledCondition>,
        claim: ClaimedExtent,
        map: FrameTransform,
        salvage: bool,
    ) -> Self {
        let keep_withheld = filter.options().keep_withheld;
        let open = CloudFilter { keep_withheld, ..CloudFilter::default() };
        Self { is_plain: *filter.options() == open, filter, condition, claim, map, salvage }
    }

    /// What the filter was made of.
    pub(super) fn options(&self) -> &CloudFilter {
        self.filter.options()
    }

    /// Whether the filters need whole records.
    pub(super) fn needs_records(&self) -> bool {
        self.condition.is_some()
    }

    /// Verdict on a point, with its bytes if whole records are needed.
    pub(super) fn judge<R: RawPoint>(
        &self,
        raw: R,
        bytes: &[u8],
        record: &FilterRecord,
    ) -> FilterVerdict {
        let verdict = self.filter.judge(record);
        match &self.condition {
            Some(condition)
                if verdict == FilterVerdict::Keep && !condition.holds(record.point, raw, bytes) =>
            {
                FilterVerdict::Filtered
            }
            _ => verdict,
        }
    }

    /// Counts `records` in `census` and passes on filtered points by way of `table`, which is empty afterwards. `first`
    /// is the index of the first record in its file; bytes of records are used only if the table or the filters need them.
    ///
    /// # Errors
    /// A point outside the bounds of the header, unless these are skipped.
    pub(super) fn batch<'r, R: RawPoint>(
        &self,
        records: impl ExactSizeIterator<Item = (&'r [u8], R)> + Clone,
        first: u64,
        table: &mut PointTable<'_>,
        census: &mut ReturnCounts,
        each: &mut PointConsumer<'_>,
    ) -> Result<()> {
        if table.is_plain() && !self.needs_records() {
            let records = records.map(|(_, raw)| raw);
            self.filter(records, first, &mut table.positions, census)?;
        } else {
            for (index, (bytes, raw)) in (first..).zip(records) {
                if let Some(point) = self.pick(raw, bytes, index, census)? {
                    table.push(point, raw, bytes, each)?;
                }
            }
        }
        table.flush(each)
    }

    /// The same for positions alone, where no whole records are needed: they replace those in `out`.
    fn filter<R: RawPoint>(
        &self,
        records: impl ExactSizeIterator<Item = R> + Clone,
        first: u64,
        out: &mut Vec<Point>,
        census: &mut ReturnCounts,
    ) -> Result<()> {
        let total = records.len();
        out.resize(total, Point::default());
        let counts = match (self.is_plain, self.map) {
            (true, FrameTransform::Shift(by)) => self.plain(records.clone(), by, out),
            _ => self.full(records.clone(), first, out),
        };
        out.truncate(counts.kept);
        if counts.outside > 0 && !self.salvage {
            return Err(self.outside(records, first));
        }
        census.read += total as u64;
        census.kept += counts.kept as u64;
        census.withheld += counts.withheld;
        census.filtered += counts.filtered;
        census.outside += counts.outside;
        Ok(())
    }

    /// Filters without branches on points.
    fn plain<R: RawPoint>(
        &self,
        records: impl Iterator<Item = R>,
        by: [i32; 3],
        out: &mut [Point],
    ) -> FilterCounts {
        let mut counts = FilterCounts::default();
        let hidden = if self.options().keep_withheld { Flags::default() } else { Flags::WITHHELD };
        let low = self.claim.low;
        let span: [u32; 3] = std::array::from_fn(|i| self.claim.high[i].abs_diff(low[i]));
        for record in records {
            let raw = record.xyz();
            let withheld = record.flags().meets(hidden);
            let within = |axis: usize| raw[axis].wrapping_sub(low[axis]) as u32 <= span[axis];
            let inside = within(0) & within(1) & within(2);
            let Some(place) = out.get_mut(counts.kept) else { break };
            *place = shifted(raw, by);
            counts.kept += usize::from(inside & !withheld);
            counts.withheld += u64::from(withheld);
            counts.outside += u64::from(!inside & !withheld);
        }
        counts
    }

    /// Applies all filters.
    fn full<R: RawPoint>(
        &self,
        records: impl Iterator<Item = R>,
        first: u64,
        out: &mut [Point],
    ) -> FilterCounts {
        let mut counts = FilterCounts::default();
        for (index, record) in (first..).zip(records) {
            let raw = record.xyz();
            let record = self.record(record, index);
            match self.filter.judge(&record) {
                FilterVerdict::Withheld => counts.withheld += 1,
                FilterVerdict::Filtered => counts.filtered += 1,
                FilterVerdict::Keep if !self.claim.holds(raw) => counts.outside += 1,
                FilterVerdict::Keep => {
                    let Some(place) = out.get_mut(counts.kept) else { break };
                    *place = record.point;
                    counts.kept += 1;
                }
            }
        }
        counts
    }

    /// Counts a record in `census` and returns its position if it passes the filters. Its bytes are used only if
    /// whole records are needed.
    ///
    /// # Errors
    /// Errors of [`filter`](Self::filter).
    pub(super) fn pick<R: RawPoint>(
        &self,
        raw: R,
        bytes: &[u8],
        index: u64,
        census: &mut ReturnCounts,
    ) -> Result<Option<Point>> {
        let record = self.record(raw, index);
        census.read += 1;
        match self.judge(raw, bytes, &record) {
            FilterVerdict::Withheld => census.withheld += 1,
            FilterVerdict::Filtered => census.filtered += 1,
            FilterVerdict::Keep if self.claim.holds(raw.xyz()) => {
                census.kept += 1;
                return Ok(Some(record.point));
            }
            FilterVerdict::Keep if self.salvage => census.outside += 1,
            FilterVerdict::Keep => return Err(self.outside(std::iter::once(raw), index)),
        }
        Ok(None)
    }

    pub(super) fn record<R: RawPoint>(&self, record: R, index: u64) -> FilterRecord {
        let ([number, returns], raw) = (record.returns(), record.xyz());
        FilterRecord {
            point: self.map.in_frame(raw, &self.claim),
            world: self.claim.world(raw),
            class: record.class(),
            number,
            returns,
            flags: record.flags(),
            index,
        }
    }

    /// The error for the first point outside the bounds.
    fn outside<R: RawPoint>(&self, records: impl Iterator<Item = R>, first: u64) -> Error {
        let outside = (first..).zip(records).find(|(index, record)| {
            self.filter.judge(&self.record(*record, *index)) == FilterVerdict::Keep
                && !self.claim.holds(record.xyz())
        });
        let Some((index, record)) = outside else {
            return Error::bad_input("points lie outside the bounds of the header");
        };
        let [x, y, z] = self.claim.world(record.xyz());
        let [low, high] = [self.claim.low, self.claim.high].map(|raw| self.claim.world(raw));
        Error::bad_input(format!(
            "position {x}, {y}, {z} is outside the bounds of the header, {low:?} to {high:?}"
        ))
        .at(format_args!("point {index}"))
        .remedy(
            "repair the header (pdal translate IN OUT), or skip such points, in LAZ whole chunks, with ‹salvage›",
        )
    }
}

fn shifted(raw: [i32; 3], by: [i32; 3]) -> Point {
    let [x, y, z] = std::array::from_fn(|axis| raw[axis].wrapping_sub(by[axis]));
    Point { x, y, z }
}
