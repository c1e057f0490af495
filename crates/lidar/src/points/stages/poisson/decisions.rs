//! Verdicts on the points of a window, in order: kept, dropped, or unknown.

use terrane_base::geom::{DistancePredicate, Point};

/// Verdict on a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PoissonVerdict {
    Kept,
    /// A kept point is nearer than the distance.
    LeftOut,
    /// It depends on points beyond the window.
    Unknown,
}

/// Lowest and highest position (x, y), inclusive.
pub(super) type Span = [[i64; 2]; 2];

/// The verdicts on points so far.
pub(super) struct PoissonVerdicts<'a> {
    apart: &'a DistancePredicate,
    /// Steps along the sides of a cell: points nearer than the distance are in cells that touch.
    side: [i64; 3],
    /// The span in which all points within the distance are known.
    sure: Span,
    /// The first point of cells by a hash of the cell; its size is a power of two.
    firsts: Vec<u32>,
    blocking: Vec<BlockingPoint>,
}

/// A point that others depend on.
struct BlockingPoint {
    point: Point,
    /// If false, it represents all points of its cell with unknown verdicts.
    is_kept: bool,
    /// The next one of the same hash.
    next: u32,
}

/// Bytes of memory for a stored point, with the growth of tables.
pub(super) const BLOCKING_BYTES: u64 = 3 * size_of::<BlockingPoint>() as u64 + 8;
const NONE: u32 = u32::MAX;
const FEW: usize = 1 << 10;
/// Cells around one, and it.
const AROUND: i64 = 27;

impl<'a> PoissonVerdicts<'a> {
    pub(super) fn new(apart: &'a DistancePredicate, sure: Span) -> Self {
        let (firsts, blocking) = (vec![NONE; FEW], Vec::new());
        Self { apart, side: apart.steps(), sure, firsts, blocking }
    }

    /// Number of stored points.
    pub(super) fn len(&self) -> usize {
        self.blocking.len()
    }

    /// The verdict on the next point.
    pub(super) fn judge(&mut self, point: Point) -> PoissonVerdict {
        match self.decide(point) {
            None => PoissonVerdict::LeftOut,
            Some(true) if self.is_sure(point) => {
                self.add(point, true);
                PoissonVerdict::Kept
            }
            Some(_) => {
                let cell = self.cell(point);
                // One unknown point makes its cell unknown: more of them would only lengthen the chain.
                if !self.of(cell).any(|other| self.is_open(other, cell)) {
                    self.add(point, false);
                }
                PoissonVerdict::Unknown
            }
        }
    }

    /// Whether a kept point is nearer than the distance.
    pub(super) fn is_left_out(&self, point: Point) -> bool {
        self.decide(point).is_none()
    }

    /// Whether a later point is dropped, or unknown like others of its cell.
    pub(super) fn is_settled(&self, point: Point) -> bool {
        let cell = self.cell(point);
        self.of(cell).any(|other| self.is_open(other, cell)) || self.is_left_out(point)
    }

    /// Whether there are no unknown points near a point; `None` if a kept point is nearer than the distance.
    fn decide(&self, point: Point) -> Option<bool> {
        let ([x, y, z], mut is_clear) = (self.cell(point), true);
        for i in 0..AROUND {
            // Its own cell first: there most are that decide.
            let i = (i + AROUND / 2) % AROUND;
            let cell = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            for other in self.of(cell) {
                if other.is_kept && self.apart.is_nearer(other.point, point) {
                    return None;
                }
                is_clear &= !self.is_open(other, cell);
            }
        }
        Some(is_clear)
    }

    fn is_open(&self, other: &BlockingPoint, cell: [i64; 3]) -> bool {
        !other.is_kept && self.cell(other.point) == cell
    }

    fn is_sure(&self, Point { x, y, .. }: Point) -> bool {
        contains(&self.sure, [x, y])
    }

    fn cell(&self, Point { x, y, z }: Point) -> [i64; 3] {
        let [a, b, c] = self.side;
        [i64::from(x).div_euclid(a), i64::from(y).div_euclid(b), i64::from(z).div_euclid(c)]
    }

    /// Points of a cell, and of others of its hash.
    fn of(&self, cell: [i64; 3]) -> impl Iterator<Item = &BlockingPoint> {
        let first = self.blocking.get(self.firsts[self.hash(cell)] as usize);
        std::iter::successors(first, |other| self.blocking.get(other.next as usize))
    }

    fn hash(&self, [x, y, z]: [i64; 3]) -> usize {
        const ODD: [i64; 3] =
            [0x9E37_79B1_85EB_CA87_u64.cast_signed(), 0x27D4_EB2F_1656_67C5, 0x1656_67B1_9E37_79F9];
        let mixed = x.wrapping_mul(ODD[0]) ^ y.wrapping_mul(ODD[1]) ^ z.wrapping_mul(ODD[2]);
        let mixed = mixed.cast_unsigned().wrapping_mul(ODD[0].cast_unsigned());
        // High bits of a product depend on all bits of the factor, low ones on the low alone.
        (mixed >> (u64::BITS - self.firsts.len().trailing_zeros())) as usize
    }

    fn add(&mut self, point: Point, is_kept: bool) {
        if self.blocking.len() == self.firsts.len() {
            self.grow();
        }
        let number = self.blocking.len();
        self.blocking.push(BlockingPoint { point, is_kept, next: NONE });
        self.link(number);
    }

    fn link(&mut self, number: usize) {
        let hash = self.hash(self.cell(self.blocking[number].point));
        self.blocking[number].next = std::mem::replace(&mut self.firsts[hash], number as u32);
    }

    fn grow(&mut self) {
        let twice = 2 * self.firsts.len();
        self.firsts.clear();
        self.firsts.resize(twice, NONE);
        (0..self.blocking.len()).for_each(|number| self.link(number));
    }
}

/// Whether a position is within a span.
pub(super) fn contains([low, high]: &Span, place: [i32; 2]) -> bool {
    (0..2).all(|axis| (low[axis]..=high[axis]).contains(&i64::from(place[axis])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_base::bits::{mixed, ordered};

    const ALL: Span = [[i64::MIN; 2], [i64::MAX; 2]];

    /// Fates of points of which those within 0..100 along x are all that is known, beside those of all.
    fn compare(points: &[Point], least: f64) -> Result<(), TestCaseError> {
        let apart = DistancePredicate::new([0.5, 1.0, 0.25], least);
        let reach = apart.steps()[0];
        let mut all = PoissonVerdicts::new(&apart, ALL);
        let mut part = PoissonVerdicts::new(&apart, [[reach, i64::MIN], [99 - reach, i64::MAX]]);
        let mut kept: Vec<Point> = Vec::new();
        for point in points {
            let is_kept = !kept.iter().any(|other| apart.is_nearer(*other, *point));
            prop_assert_eq!(all.is_left_out(*point), !is_kept);
            let verdict = if is_kept { PoissonVerdict::Kept } else { PoissonVerdict::LeftOut };
            prop_assert_eq!(all.judge(*point), verdict);
            kept.extend(is_kept.then_some(*point));
            if (0..100).contains(&point.x) {
                let of_part = part.judge(*point);
                prop_assert!(of_part == verdict || of_part == PoissonVerdict::Unknown);
            }
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn what_a_part_tells_is_so_of_the_whole(
            points in prop::collection::vec((-60..160i32, -20..20i32, -9..9i32), 0..600), least in 0.5..9.0_f64,
        ) {
            let points: Vec<_> = points.into_iter().map(|(x, y, z)| Point::new(x, y, z)).collect();
            compare(&points, least)?;
        }
    }

    #[test]
    fn fates_are_known_a_few_distances_from_the_rim() {
        // A window of 800 by 12 distances, with 25 points to the square of one.
        let place = |i: u64| {
            let [x, y, z] =
                [1, 2, 3].map(|axis| mixed(&[i, axis]) % [4000, 12 * 5, 20][axis as usize - 1]);
            Point::new(x as i32, y as i32, z as i32)
        };
        let mut points: Vec<_> = (0..240_000).map(place).collect();
        points.sort_by_key(|point| mixed(&[point.x, point.y, point.z].map(ordered)));
        let apart = DistancePredicate::new([0.2, 0.2, 0.01], 1.0);
        let mut verdicts = PoissonVerdicts::new(&apart, [[206, i64::MIN], [3794, i64::MAX]]);
        let (mut known, mut depth) = (0, 0);
        for point in points.iter().filter(|point| (200..3800).contains(&point.x)) {
            match verdicts.judge(*point) {
                PoissonVerdict::Unknown => {
                    depth = depth.max((point.x - 200).min(3800 - point.x) / 5)
                }
                _ => known += 1,
            }
        }
        assert!(
            depth < 12 && known > 150_000,
            "{known} known, others {depth} distances from the rim"
        );
    }
}
