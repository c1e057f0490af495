//! The points of a cloud that a page shows: those with the lowest hashes of their positions. Each point is equally likely,
//! regions keep their densities, and the order of points and threads does not matter.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use terrane_base::attribute::{CLASS, RETURN, RETURNS};
use terrane_base::bits::{mixed, ordered};
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_cloud::{BATCH, CLASS_FLAGS, Flags, PointBatch, PointCloud, PointSource, ReturnCounts};
use terrane_engine::{Cancel, FileAt, Progress};
use terrane_files::lock;

/// A point of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PageCloudPoint {
    /// Position in the frame of the cloud.
    pub(super) point: Point,
    pub(super) intensity: u16,
    pub(super) class: u8,
    /// Return number from 1, and number of returns; 0 if unknown.
    pub(super) returns: [u8; 2],
    pub(super) flags: Flags,
    /// Red, green, blue as stored; 0 if absent.
    pub(super) colour: [u16; 3],
}

/// The attributes of a [`PageCloudPoint`], in the order of [`PageCloudPoint::of`].
const ATTRIBUTES: [&str; 8] =
    ["intensity", CLASS, RETURN, RETURNS, CLASS_FLAGS, "red", "green", "blue"];

impl PageCloudPoint {
    /// The points of a batch with [`ATTRIBUTES`].
    fn of(batch: PointBatch<'_>) -> impl Iterator<Item = Self> {
        let columns: [&[f64]; ATTRIBUTES.len()] =
            std::array::from_fn(|attribute| batch.attributes[attribute].as_slice());
        batch.positions.iter().enumerate().map(move |(at, point)| {
            // What a file lacks is NaN, of which casts make 0.
            let [intensity, class, number, returns, flags, red, green, blue] =
                columns.map(|column| column[at]);
            Self {
                point: *point,
                intensity: intensity as u16,
                class: class as u8,
                returns: [number as u8, returns as u8],
                flags: Flags(flags as u8),
                colour: [red, green, blue].map(|value| value as u16),
            }
        })
    }
}

/// A rank and its point: hash of the position, later the place along a curve.
pub(super) type Ranked = (u64, PageCloudPoint);

/// Statistics of all points, shown or not.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PagePointTally {
    pub(super) census: ReturnCounts,
    /// Points by class, and by number of their return.
    pub(super) classes: Vec<u64>,
    pub(super) returns: Vec<u64>,
    /// The largest intensity, and value of a colour.
    pub(super) strongest: u16,
    pub(super) brightest: u16,
}

impl Default for PagePointTally {
    fn default() -> Self {
        let (classes, returns) = (vec![0; 256], vec![0; 16]);
        Self { census: ReturnCounts::default(), classes, returns, strongest: 0, brightest: 0 }
    }
}

impl PagePointTally {
    fn add(&mut self, seen: &PageCloudPoint) {
        self.classes[usize::from(seen.class)] += 1;
        self.returns[usize::from(seen.returns[0] & 15)] += 1;
        self.strongest = self.strongest.max(seen.intensity);
        self.brightest = seen.colour.into_iter().fold(self.brightest, u16::max);
    }

    fn and(mut self, other: Self) -> Self {
        self.census.add(&other.census);
        let sums = [(&mut self.classes, other.classes), (&mut self.returns, other.returns)];
        for (counts, added) in sums {
            counts.iter_mut().zip(added).for_each(|(count, added)| *count += added);
        }
        self.strongest = self.strongest.max(other.strongest);
        self.brightest = self.brightest.max(other.brightest);
        self
    }
}

/// The `max` points of lowest rank.
struct PagePointSample {
    max: usize,
    /// Points of higher rank are not in the sample.
    limit: AtomicU64,
    points: Mutex<Vec<Ranked>>,
}

impl PagePointSample {
    fn new(max: usize) -> Self {
        Self { max, limit: AtomicU64::new(u64::MAX), points: Mutex::default() }
    }

    fn offer(&self, points: impl Iterator<Item = PageCloudPoint>) {
        // An outdated limit is too high: it lets superfluous points in, and loses none.
        let limit = self.limit.load(Ordering::Relaxed);
        let ranked = points.map(|seen| (rank(seen.point), seen));
        let candidates: Vec<Ranked> = ranked.filter(|(rank, _)| *rank <= limit).collect();
        let mut sample = lock(&self.points);
        sample.extend(candidates);
        if sample.len() > capacity(self.max) {
            self.shorten(&mut sample);
        }
    }

    fn shorten(&self, sample: &mut Vec<Ranked>) {
        if let Some(last) = self.max.checked_sub(1).filter(|last| *last < sample.len()) {
            let limit = sample.select_nth_unstable(last).1.0;
            self.limit.store(limit, Ordering::Relaxed);
        }
        sample.truncate(self.max);
    }

    fn finish(self) -> Vec<Ranked> {
        let mut sample = std::mem::take(&mut *lock(&self.points));
        self.shorten(&mut sample);
        sample
    }
}

/// Number of points held before those beyond `max` are discarded.
fn capacity(max: usize) -> usize {
    max + max / 4 + BATCH
}

/// Bytes for selecting a number of points, with the slack of a growing list.
pub(super) fn needed(max: u64) -> u64 {
    2 * (max + max / 4 + 2 * BATCH as u64) * size_of::<Ranked>() as u64
}

fn rank(Point { x, y, z }: Point) -> u64 {
    mixed(&[x, y, z].map(ordered))
}

/// Reads all matching points and keeps a sample of them. Uses the current thread pool.
pub(super) fn select(
    cloud: &PointCloud,
    max: usize,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(Vec<Ranked>, PagePointTally)> {
    let selection = cloud.select_present(&ATTRIBUTES.map(str::to_owned))?;
    let sample = PagePointSample::new(max);
    progress.begin("points", cloud.info().count);
    let read = (0..cloud.parts()).into_par_iter().map(|part| {
        FileAt::report_part(progress, cloud, part);
        let mut tally = PagePointTally::default();
        tally.census = cloud.read(part, &selection, &mut |batch| {
            cancel.check()?;
            sample.offer(PageCloudPoint::of(batch).inspect(|seen| tally.add(seen)));
            Ok(())
        })?;
        progress.advance(cloud.points_of(part));
        Ok(tally)
    });
    let tally = read.try_reduce(PagePointTally::default, |tally, other| Ok(tally.and(other)));
    progress.end();
    Ok((sample.finish(), tally?))
}

/// Sorts points along a Z-order curve (Morton 1966), so that neighbours are near each other; points at one position by
/// their attributes.
pub(super) fn arrange(points: &mut [Ranked]) {
    let west = points.iter().map(|(_, seen)| seen.point.x).min().unwrap_or(0);
    let south = points.iter().map(|(_, seen)| seen.point.y).min().unwrap_or(0);
    points.par_iter_mut().for_each(|(rank, seen)| {
        *rank = spread(seen.point.x.abs_diff(west)) | spread(seen.point.y.abs_diff(south)) << 1;
    });
    points.par_sort_unstable();
}

/// The bits of a number with a gap behind each.
fn spread(number: u32) -> u64 {
    let steps = [
        (16, 0x0000_FFFF_0000_FFFF),
        (8, 0x00FF_00FF_00FF_00FF),
        (4, 0x0F0F_0F0F_0F0F_0F0F),
        (2, 0x3333_3333_3333_3333),
        (1, 0x5555_5555_5555_5555),
    ];
    steps.iter().fold(number.into(), |bits: u64, (shift, mask)| (bits | bits << shift) & mask)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn seen(x: i32, y: i32, z: i32, class: u8) -> PageCloudPoint {
        PageCloudPoint { point: Point::new(x, y, z), class, ..PageCloudPoint::default() }
    }

    /// All at once, and sorted.
    fn chosen(points: &[PageCloudPoint], most: usize) -> Vec<Ranked> {
        let mut all: Vec<Ranked> = points.iter().map(|seen| (rank(seen.point), *seen)).collect();
        all.sort_unstable();
        all.truncate(most);
        all
    }

    proptest! {
        #[test]
        fn the_same_points_are_kept_in_whatever_batches_they_come(
            points in prop::collection::vec((-9..9, -9..9, 0..3, 0..3u8), 0..400),
            most in 0usize..300,
            batch in 1usize..90,
        ) {
            let mut points: Vec<PageCloudPoint> = points.iter().map(|(x, y, z, c)| seen(*x, *y, *z, *c)).collect();
            let expected = chosen(&points, most);
            points.reverse();
            let fewest = PagePointSample::new(most);
            for some in points.chunks(batch) {
                fewest.offer(some.iter().copied());
                fewest.shorten(&mut lock(&fewest.points));
            }
            let mut kept = fewest.finish();
            kept.sort_unstable();
            prop_assert_eq!(kept, expected);
        }

        #[test]
        fn bits_are_spread_one_by_one(number in any::<u32>()) {
            let slow = (0..32).fold(0u64, |all, bit| all | u64::from(number >> bit & 1) << (2 * bit));
            prop_assert_eq!(spread(number), slow);
        }
    }

    #[test]
    fn a_tenth_of_a_lattice_is_a_tenth_of_each_of_its_parts() {
        let points: Vec<PageCloudPoint> =
            (0..90_000).map(|i| seen(i % 300, i / 300, 7, 2)).collect();
        let kept = chosen(&points, 9_000);
        let mut parts = [0; 9];
        for (_, PageCloudPoint { point, .. }) in &kept {
            parts[(point.x / 100 + point.y / 100 * 3) as usize] += 1;
        }
        // Each of 1,000, whose standard deviation is 30.
        assert!(parts.iter().all(|part: &i32| part.abs_diff(1_000) < 120), "{parts:?}");
    }

    #[test]
    fn neighbours_come_together() {
        let square: Vec<PageCloudPoint> =
            (0..4_096).map(|i| seen(i % 64 - 9, i / 64 + 5, 0, 0)).collect();
        let mut points = chosen(&square, usize::MAX);
        arrange(&mut points);
        let apart = |pair: &[Ranked]| {
            let [a, b] = [pair[0].1.point, pair[1].1.point];
            a.x.abs_diff(b.x) + a.y.abs_diff(b.y)
        };
        let mean = points.windows(2).map(apart).sum::<u32>() as f64 / 4_095.0;
        assert!(mean < 2.0, "{mean}");
    }
}
