//! Low outliers: points below the ground, rejected by their neighbours at several scales.
//!
//! A point is compared with the chords between the lowest points of blocks that lie opposite each other around
//! it, near by and further away. On a slope of any steepness, and along a ditch or a valley, some chord is as
//! low as the point; in a dense forest the ground in one gap is as low as in others. A low outlier lies below
//! every chord at every scale. Blocks are far enough away that a clump of outliers does not fill one.
//!
//! Under the densest crowns so few cells have ground points that chords between them are rare, and all ground
//! looks like outliers. But outliers have any depth, below a smooth surface, and ground is continuous, below a
//! rough one: a point on a plane with many others is kept if hardly any cell around it is smooth.

use crate::grid::{slid, within};
use crate::grow::{FittedPlane, PlaneSums};
use crate::lowest_points::{EMPTY, LowestPoints, NO_POINT};
use terrane_base::geom::Point;

/// Side of a block in cells.
const BLOCK: usize = 3;
/// For each scale: blocks along the side of a square, and cells from the point to its centre; eight squares
/// cover all directions.
const SCALES: [(isize, isize); 3] = [(1, 4), (3, 12), (7, 28)];
/// Number of scales at which a slope may be extrapolated from blocks on one side of a point.
const ONE_SIDED: usize = 2;
/// Half of the directions from a point; the others are opposite.
const DIRECTIONS: [[isize; 2]; 4] = [[1, 0], [1, 1], [0, 1], [-1, 1]];
/// Number of passes, as deeper outliers hide others: in windows with a bounded reach.
pub(crate) const FEW_PASSES: usize = 3;
/// Number of passes in tiles of a fixed size, where the reach does not matter.
pub(crate) const PASSES: usize = 8;
/// Smallest depth of an outlier below all chords: in metres, and in cells if those are large.
const DEPTH: f64 = 1.0;
const DEPTH_OF_CELL: f64 = 0.5;
/// Largest clump of outliers: in square metres, and in cells.
const CLUMP: usize = 9;
/// Largest distance between cells of a clump.
const BESIDE: usize = 3;
/// Half sides, in cells, of the squares in which rejected points may lie on one plane.
const VIEWS: [usize; 3] = [14, 24, 38];
/// Fewest clumps on a plane.
const FEWEST: usize = 8;
/// Rounds of trimming points far from the plane.
const TRIMS: usize = 4;
/// Distance at which a point is far: relative to the median, and at least in metres.
const FAR: (f64, f64) = (2.0, 0.5);
/// Largest distance of points on the plane, in metres.
const STRAY: f64 = 0.8;
/// Largest distance from a plane of half of the points around a smooth cell, in metres.
const SMOOTH: f64 = 0.25;
/// Under crowns at most one cell in this many is smooth.
const ROUGH: usize = 20;
/// Cells around one that decide in few passes whether its point is an outlier.
pub(crate) const REACH: usize = FEW_PASSES * (28 + 7 * BLOCK / 2 + 1) + VIEWS[2] + BESIDE;

/// The lowest points without low outliers, whose cells become empty.
pub(crate) fn without_outliers(lows: &LowestPoints<'_>, passes: usize) -> Vec<Point> {
    let mut points = lows.points.to_vec();
    let mut left_out = Vec::new();
    for _ in 0..passes {
        let outliers = outliers(&LowestPoints { points: &points, ..*lows });
        outliers.iter().for_each(|at| points[*at] = NO_POINT);
        if outliers.is_empty() {
            break;
        }
        left_out.extend(outliers);
    }
    if left_out.len() <= FEWEST {
        return points;
    }
    // `is_on_plane` searches the list by rows.
    left_out.sort_unstable();
    let left = LowestPoints { points: &points, ..*lows };
    let smooth: Vec<_> = (0..points.len()).map(|at| is_smooth(&left, at)).collect();
    for &at in &left_out {
        if is_under_crowns(&smooth, lows.width, at) && is_on_plane(lows, &left_out, at) {
            points[at] = lows.points[at];
        }
    }
    points
}

/// The cells whose points lie below all chords around them, in clumps of a few.
fn outliers(lows: &LowestPoints<'_>) -> Vec<usize> {
    let heights: Vec<i32> = lows.points.iter().map(|p| p.z).collect();
    let blocks = LowestBlocks::new(&heights, lows.width);
    let depth = DEPTH.max(DEPTH_OF_CELL * lows.cell) / lows.step[2];
    let max_clump = ((CLUMP as f64 / lows.cell.powi(2)).ceil() as usize).clamp(1, CLUMP);
    let outliers = (0..heights.len()).filter(|&at| {
        let z = heights[at];
        z != EMPTY
            && blocks.contradict(at, z, depth)
            && count_not_higher(&heights, lows.width, at, f64::from(z) + depth) <= max_clump
    });
    outliers.collect()
}

/// Whether hardly any of the cells around one is smooth: ground is smooth, crowns are not. All points below a
/// smooth surface are noise.
fn is_under_crowns(is_smooth: &[Option<bool>], width: usize, at: usize) -> bool {
    let cols = within(at % width, VIEWS[2], width);
    let rows = within(at / width, VIEWS[2], is_smooth.len() / width);
    let (mut count, mut smooth) = (0, 0);
    for is_smooth in rows.flat_map(|row| &is_smooth[row * width..][cols.clone()]).flatten() {
        count += 1;
        smooth += usize::from(*is_smooth);
    }
    smooth * ROUGH <= count
}

/// Whether half of the points around a cell lie near one plane; `None` if they define none.
fn is_smooth(lows: &LowestPoints<'_>, at: usize) -> Option<bool> {
    let cols = within(at % lows.width, BESIDE, lows.width);
    let rows = within(at / lows.width, BESIDE, lows.points.len() / lows.width);
    let cells = rows.flat_map(|row| cols.clone().map(move |col| row * lows.width + col));
    let mut points: Vec<[f64; 3]> = cells.filter_map(|cell| lows.metres(cell)).collect();
    let first = *points.first()?;
    let mut sums = PlaneSums::default();
    for point in &mut points {
        // From the first: sums of squares of large coordinates would lose the digits of the plane.
        *point = [0, 1, 2].map(|i| point[i] - first[i]);
        sums.add(*point);
    }
    let plane = sums.plane()?;
    let mut away: Vec<f64> = points.iter().map(|point| plane.above(*point).abs()).collect();
    let half = away.len() / 2;
    Some(*away.select_nth_unstable_by(half, f64::total_cmp).1 <= SMOOTH)
}

/// Whether a rejected point lies on a plane with many other rejected points.
fn is_on_plane(lows: &LowestPoints<'_>, left_out: &[usize], at: usize) -> bool {
    let width = lows.width;
    VIEWS.iter().any(|&view| {
        let first = left_out.partition_point(|other| other / width + view < at / width);
        let rows = left_out[first..].iter().take_while(|k| **k / width <= at / width + view);
        let mut clumps = vec![at];
        for &other in rows.filter(|other| cells_apart(**other, at, width) <= view) {
            if clumps.iter().all(|&clump| cells_apart(other, clump, width) > BESIDE) {
                clumps.push(other);
            }
        }
        lie_on_one_plane(lows, at, &clumps[1..])
    })
}

/// Distance of two cells in columns or rows, whichever is larger.
fn cells_apart(a: usize, b: usize, width: usize) -> usize {
    (a % width).abs_diff(b % width).max((a / width).abs_diff(b / width))
}

/// Whether most of the others lie on one plane, and this point as well.
fn lie_on_one_plane(lows: &LowestPoints<'_>, at: usize, others: &[usize]) -> bool {
    let Some([x, y, z]) = lows.metres(at) else { return false };
    let others: Vec<[f64; 3]> = others.iter().filter_map(|&other| lows.metres(other)).collect();
    let others: Vec<[f64; 3]> =
        others.into_iter().map(|[east, north, up]| [east - x, north - y, up - z]).collect();
    let mut far = f64::INFINITY;
    let mut plane = FittedPlane::LEVEL;
    for _ in 0..=TRIMS {
        let mut sums = PlaneSums::default();
        others.iter().filter(|p| plane.above(**p).abs() <= far).for_each(|p| sums.add(*p));
        if sums.count < FEWEST {
            return false;
        }
        let Some(next) = sums.plane() else { return false };
        plane = next;
        let mut away: Vec<f64> = others.iter().map(|p| plane.above(*p).abs()).collect();
        let half = away.len() / 2;
        far = FAR.1.max(FAR.0 * *away.select_nth_unstable_by(half, f64::total_cmp).1);
    }
    plane.stray <= STRAY && plane.height.abs() <= far
}

/// Number of cells around one, itself included, that are not higher: at the corner of a pit they are more than
/// a clump.
fn count_not_higher(heights: &[i32], width: usize, at: usize, max_height: f64) -> usize {
    let cols = within(at % width, BESIDE, width);
    let rows = within(at / width, BESIDE, heights.len() / width);
    let lines = rows.map(|row| &heights[row * width..][cols.clone()]);
    lines.flatten().filter(|z| **z != EMPTY && f64::from(**z) <= max_height).count()
}

/// The lowest height of each block that touches the window, by its first column and row, from `BLOCK - 1` before the
/// window on.
struct LowestBlocks {
    lowest: Vec<i32>,
    width: usize,
    wide: isize,
    rows: isize,
}

impl LowestBlocks {
    fn new(heights: &[i32], width: usize) -> Self {
        let before = BLOCK - 1;
        let (wide, rows) = (width + before, heights.len() / width + before);
        let mut cells = vec![EMPTY; wide * rows];
        let lines = cells.chunks_exact_mut(wide).skip(before);
        for (line, heights) in lines.zip(heights.chunks_exact(width)) {
            line[before..].copy_from_slice(heights);
        }
        let lowest = slid(cells, wide, BLOCK, i32::min);
        Self { lowest, width, wide: wide as isize, rows: rows as isize }
    }

    /// Whether a height of a cell lies too far below the chords around it, at each scale that has any.
    fn contradict(&self, at: usize, height: i32, depth: f64) -> bool {
        let at = [(at % self.width) as isize, (at / self.width) as isize];
        let max_height = f64::from(height) + depth;
        let mut verdicts =
            (0..SCALES.len()).filter_map(|scale| self.verdict(at, scale, max_height));
        // `all` is true of no verdicts, and a point without chords at any scale is not contradicted.
        let mut is_contradicted = false;
        verdicts.all(|verdict| {
            is_contradicted = true;
            verdict
        }) && is_contradicted
    }

    /// Whether all chords of a scale are above a height; `None` where there is none.
    fn verdict(&self, at: [isize; 2], scale: usize, height: f64) -> Option<bool> {
        let (side, away) = SCALES[scale];
        let mut is_above = None;
        for [east, north] in DIRECTIONS {
            for k in 0..side * side {
                let by = [(east, k % side), (north, k / side)]
                    .map(|(direction, k)| direction * away + (k - side / 2) * BLOCK as isize);
                match self.chord(at, by, scale < ONE_SIDED) {
                    Some(chord) if chord <= height => return Some(false),
                    Some(_) => is_above = Some(true),
                    None => {}
                }
            }
        }
        is_above
    }

    /// Height at a cell of the chord between the blocks so far from it, or of the line through two on one side.
    fn chord(&self, at: [isize; 2], by: [isize; 2], one_sided: bool) -> Option<f64> {
        match [self.block_along(at, by, 1), self.block_along(at, by, -1)] {
            [Some(a), Some(b)] => Some(0.5 * (a + b)),
            [Some(a), None] if one_sided => Some(2.0 * a - self.block_along(at, by, 2)?),
            [None, Some(a)] if one_sided => Some(2.0 * a - self.block_along(at, by, -2)?),
            _ => None,
        }
    }

    /// The lowest height of the block so many times an offset from a cell.
    #[inline]
    fn block_along(&self, at: [isize; 2], by: [isize; 2], times: isize) -> Option<f64> {
        self.block([at[0] + times * by[0], at[1] + times * by[1]])
    }

    /// The lowest height of the block around a cell.
    fn block(&self, [col, row]: [isize; 2]) -> Option<f64> {
        let beside = BLOCK as isize / 2;
        let (x, y) = (col + beside, row + beside);
        let inside = (0..self.wide).contains(&x) && (0..self.rows).contains(&y);
        let height = self.lowest[if inside { (y * self.wide + x) as usize } else { return None }];
        (height != EMPTY).then_some(f64::from(height))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::landscapes::mixed;

    const WIDTH: usize = 150;

    /// Height of the ground at a cell.
    type Relief = fn(usize, usize) -> f64;
    /// Depth of noise, by a number from 0 to 1.
    type Depth = fn(f64) -> f64;

    /// Cells whose points are left out, of heights in metres.
    fn left_out(
        width: usize,
        rows: usize,
        height: impl Fn(usize, usize) -> f64,
    ) -> Vec<[usize; 2]> {
        let point = |k: usize| {
            let (col, row) = (k % width, k / width);
            Point::new(col as i32, row as i32, (height(col, row) * 100.0).round() as i32)
        };
        let points: Vec<Point> = (0..width * rows).map(point).collect();
        let lows = LowestPoints {
            points: &points,
            width,
            cell: 1.0,
            corner: [0.0; 2],
            step: [1.0, 1.0, 0.01],
        };
        let left = without_outliers(&lows, FEW_PASSES);
        (0..left.len())
            .filter(|&at| left[at] == NO_POINT)
            .map(|at| [at % width, at / width])
            .collect()
    }

    fn slope(col: usize, row: usize) -> f64 {
        0.8 * col as f64 - 0.3 * row as f64
    }

    #[test]
    fn single_points_pairs_and_clumps_are_left_out_and_nothing_else() {
        for place in [[75, 75], [1, 70], [80, 148], [2, 2]] {
            for clump in [&[[0, 0]][..], &[[0, 0], [1, 0]], &[[0, 0], [1, 1], [0, 1], [2, 1]]] {
                let deep: Vec<_> =
                    clump.iter().map(|by| [place[0] + by[0], place[1] + by[1]]).collect();
                let height =
                    |col, row| slope(col, row) - if deep.contains(&[col, row]) { 9.0 } else { 0.0 };
                let mut expected: Vec<_> =
                    deep.iter().filter(|at| at[0] < WIDTH && at[1] < WIDTH).copied().collect();
                expected.sort_by_key(|at| [at[1], at[0]]);
                assert_eq!(left_out(WIDTH, WIDTH, height), expected);
            }
        }
    }

    #[test]
    fn deep_ground_with_company_is_kept() {
        let pit = |col: usize, row: usize| {
            let inside = (60..72).contains(&col) && (50..61).contains(&row);
            if inside { -12.0 } else { 0.0 }
        };
        assert!(left_out(WIDTH, WIDTH, pit).is_empty());
        for (east, north) in [(1, 0), (0, 1), (1, 1), (2, 1), (3, 1), (5, 2)] {
            let ditch = |col: usize, row: usize| {
                let away = (col * north).abs_diff(row * east + 20 * north);
                slope(col, row) - if away < 2 * (east + north) { 3.0 } else { 0.0 }
            };
            assert_eq!(left_out(WIDTH, WIDTH, ditch), [[0; 2]; 0], "{east} {north}");
        }
    }

    /// Crowns with gaps, through which one cell of nine square metres shows the ground.
    #[test]
    fn ground_seen_through_gaps_of_a_forest_is_kept() {
        let hash = |col: usize, row: usize| (col * 7919 + row * 104_729) % 97;
        let crowns = |col: usize, row: usize| {
            let above = if hash(col, row) < 11 { 0.0 } else { 6.0 + hash(row, col) as f64 * 0.1 };
            slope(col, row) + above
        };
        let lost = left_out(WIDTH, WIDTH, crowns);
        assert!(lost.len() < 20, "{lost:?}");
    }

    /// Through the densest crowns a few cells of a thousand see the ground, and a clump of outliers is no ground there.
    #[test]
    fn ground_seen_by_few_cells_of_a_thousand_is_kept() {
        let hills =
            |col: usize, row: usize| 4.0 * (col as f64 / 19.0).sin() * (row as f64 / 23.0).cos();
        let deep = [[40, 50], [41, 50], [41, 51], [110, 100], [70, 130]];
        let dice = |[col, row]: [usize; 2]| {
            let bits = mixed((col as u64) << 32 | row as u64);
            (bits % 1000, (bits >> 32) as f64 / 2.0_f64.powi(32))
        };
        let reliefs: [(&dyn Fn(usize, usize) -> f64, _); 2] =
            [(&slope, [0.8, 0.9, 0.9]), (&hills, [0.25, 0.7, 0.85])];
        for (relief, least) in reliefs {
            for (few, least) in [4, 8, 15].into_iter().zip(least) {
                let above = |at: [usize; 2]| match dice(at) {
                    _ if deep.contains(&at) => -0.2 * at[0] as f64,
                    (seen, _) if seen < few => 0.0,
                    (_, share) => 8.0 + 9.0 * share,
                };
                let lost = left_out(WIDTH, WIDTH, |col, row| relief(col, row) + above([col, row]));
                let ground = (0..WIDTH * WIDTH).filter(|k| above([k % WIDTH, k / WIDTH]) == 0.0);
                let part = lost.iter().filter(|at| above(**at) == 0.0).count() as f64
                    / ground.count() as f64;
                assert!(1.0 - part >= least, "{few}: {part} is lost");
                assert!(deep.iter().all(|at| lost.contains(at)), "{few}");
            }
        }
    }

    /// A layer of noise and noise of any depth, below ground that is level, slopes and rolls: of a thousand cells some
    /// have it. What lies below a steep slope by little, or beside what is deeper, is not told from it.
    #[test]
    fn noise_below_ground_does_not_come_back_however_much_there_is() {
        let hills =
            |col: usize, row: usize| 4.0 * (col as f64 / 19.0).sin() * (row as f64 / 23.0).cos();
        let any = |share: f64| 2.0 + 8.0 * share;
        let kinds: [(Relief, Depth, f64); 5] = [
            (|_, _| 0.0, |_| 2.5, 0.85),
            (|_, _| 0.0, |_| 12.0, 0.85),
            (slope, |_| 12.0, 0.85),
            (hills, |_| 12.0, 0.85),
            (|_, _| 0.0, any, 0.6),
        ];
        for ((relief, depth, least), few) in
            kinds.into_iter().flat_map(|kind| [(kind, 2), (kind, 6)])
        {
            let dice = |[col, row]: [usize; 2], turn: u64| {
                let bits = mixed((col as u64) << 32 | (row as u64) << 4 | turn);
                (bits % 1000, (bits >> 32) as f64 / 2.0_f64.powi(32))
            };
            let is_deep = |at: &[usize; 2]| dice(*at, 0).0 < few;
            let lost = left_out(WIDTH, WIDTH, |col, row| {
                let (up, deep) = (0.2 * dice([col, row], 1).1, -depth(dice([col, row], 2).1));
                relief(col, row) + if is_deep(&[col, row]) { deep } else { up }
            });
            let deep = (0..WIDTH * WIDTH).filter(|k| is_deep(&[k % WIDTH, k / WIDTH])).count();
            let found = lost.iter().filter(|at| is_deep(at)).count();
            assert!(found as f64 >= least * deep as f64, "{few}: {found} of {deep}");
            assert!(lost.len() - found < 5, "{few}: {} of the ground", lost.len() - found);
        }
    }

    #[test]
    fn cells_further_than_the_reach_have_no_part_in_it() {
        let height = |col: usize, row: usize| {
            let hash = (col as u32 ^ (row as u32) << 9).wrapping_mul(0x9E37_79B1).rotate_left(13);
            slope(col, row)
                - if hash.is_multiple_of(400) { (hash >> 20) as f64 * 0.01 } else { 0.0 }
        };
        let (side, part) = (3 * REACH, 2 * REACH + 20);
        let whole = left_out(side, side, height);
        let [east, north] = [23, 41];
        let cut = left_out(part, part, |col, row| height(col + east, row + north));
        let inner = |at: &[usize; 2]| at.iter().all(|v| (REACH..REACH + 20).contains(v));
        let cut: Vec<_> = cut.into_iter().filter(inner).collect();
        let back = |[col, row]: [usize; 2]| Some([col.checked_sub(east)?, row.checked_sub(north)?]);
        let expected: Vec<_> = whole.into_iter().filter_map(back).filter(inner).collect();
        assert_eq!(cut, expected);
    }
}
