//! A frame of vertices around a window, so that triangles cover everything beyond the known ground.

use crate::grid::within;
use crate::lowest_in_cells::{LowestCells, MILLI};
use terrane_base::geom::Point;

/// Cells from the window to the frame.
const OUT: usize = 10;
/// Most cells from one vertex of the frame to the next, and cells along a block.
const BLOCK: usize = 16;
/// Fewest points of a plane fit.
const ENOUGH: i64 = 12;

/// Vertices around a window, each on a plane fitted to the ground points in the nearest blocks: slopes are
/// extrapolated beyond the known ground.
pub(crate) struct GroundExtrapolation {
    places: Vec<[i32; 2]>,
    /// Steps along a block, and blocks of a row; the first lies around the frame's lowest corner.
    side: i32,
    low: i32,
    across: usize,
    blocks: Vec<PointMoments>,
}

impl GroundExtrapolation {
    pub(crate) fn new(cells: &LowestCells) -> Self {
        let [side, out, width, height] = [BLOCK, OUT, cells.width, cells.rows()]
            .map(|count| (count as f64 * cells.cell * MILLI).ceil() as i32);
        let (east, north) = (width + out, height + out);
        let south = frame_steps(east, out, side).map(|x| [x, -out]);
        let west = frame_steps(north, out, side).map(|y| [-out, y]);
        let half: Vec<_> = south.chain(west.skip(1)).collect();
        let mut places = half.clone();
        places.extend(half.into_iter().map(|[x, y]| [east - out - x, north - out - y]));
        places.extend([[east, -out], [-out, north]]);
        places.sort_unstable();
        places.dedup();
        let [across, up] = [east, north].map(|end| (end + out).div_euclid(side) as usize + 1);
        let blocks = vec![PointMoments::default(); across * up];
        Self { places, side, low: -out, across, blocks }
    }

    /// Number of vertices.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// The column and row of the block around a place.
    fn block(&self, [x, y]: [i32; 2]) -> [usize; 2] {
        [x, y].map(|v| ((v - self.low) / self.side) as usize)
    }

    /// Adds a ground point.
    pub(crate) fn add(&mut self, p: &Point) {
        let [col, row] = self.block([p.x, p.y]);
        self.blocks[row * self.across + col].add(p);
    }

    /// The vertices, extrapolated from the ground points so far.
    pub(crate) fn vertices(&self) -> Vec<Point> {
        self.places.iter().map(|&[x, y]| Point::new(x, y, self.height([x, y]))).collect()
    }

    fn height(&self, place: [i32; 2]) -> i32 {
        let far = self.across.max(self.blocks.len() / self.across);
        let known = (0..far).map(|away| self.around(place, away)).find(|sum| sum.count >= ENOUGH);
        let known = known.unwrap_or_else(|| self.around(place, far));
        known.plane_at(place, f64::from(self.side) / BLOCK as f64).round() as i32
    }

    /// Sums over the blocks within a distance of the block of a position.
    fn around(&self, place: [i32; 2], away: usize) -> PointMoments {
        let rows = self.blocks.len() / self.across;
        let [col, row] = self.block(place);
        let (cols, rows) = (within(col, away, self.across), within(row, away, rows));
        let mut sum = PointMoments::default();
        for block in rows.flat_map(|row| &self.blocks[row * self.across..][cols.clone()]) {
            sum.merge(block);
        }
        sum
    }
}

/// Steps of the vertices along a side of the frame, from `-out` to before `end`, at most `side` apart.
fn frame_steps(end: i32, out: i32, side: i32) -> impl Iterator<Item = i32> {
    let count = (end + out).div_euclid(side) + 1;
    (0..count).map(move |k| (i64::from(end + out) * i64::from(k) / i64::from(count)) as i32 - out)
}

/// Exact sums over points, independent of their order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct PointMoments {
    count: i64,
    first: [i64; 3],
    /// Of x x, x y, y y, x z, y z.
    second: [i128; 5],
}

impl PointMoments {
    fn add(&mut self, p: &Point) {
        let [x, y, z] = [p.x, p.y, p.z].map(i64::from);
        let products = [x * x, x * y, y * y, x * z, y * z].map(i128::from);
        self.merge(&Self { count: 1, first: [x, y, z], second: products });
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.first.iter_mut().zip(other.first).for_each(|(sum, v)| *sum += v);
        self.second.iter_mut().zip(other.second).for_each(|(sum, v)| *sum += v);
    }

    /// The second moments about the mean, in the order of `second`.
    fn central(&self) -> [f64; 5] {
        let [x, y, z] = self.first.map(i128::from);
        let products = [x * x, x * y, y * y, x * z, y * z];
        [0, 1, 2, 3, 4].map(|k| {
            // Exact up to the division: the difference is small against both terms.
            (i128::from(self.count) * self.second[k] - products[k]) as f64 / self.count as f64
        })
    }

    /// Height at a position of the least-squares plane; 0 for no points. Virtual points on each side at the
    /// mean height keep the plane level across a line, and for a single point.
    fn plane_at(&self, place: [i32; 2], aside: f64) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let (count, level) = (self.count as f64, aside * aside);
        let [x, y, z] = self.first.map(|sum| sum as f64 / count);
        let [xx, xy, yy, xz, yz] = self.central();
        let (xx, yy) = (xx + level, yy + level);
        let determinant = xx * yy - xy * xy;
        let [gx, gy] = [(xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant];
        z + gx * (f64::from(place[0]) - x) + gy * (f64::from(place[1]) - y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(width: usize, rows: usize) -> GroundExtrapolation {
        GroundExtrapolation::new(&LowestCells {
            points: vec![None; width * rows],
            width,
            cell: 0.5,
        })
    }

    #[test]
    fn it_goes_all_around_a_window_in_steps_of_a_block() {
        for (width, rows) in [(1, 1), (40, 7), (100, 33), (64, 64)] {
            let frame = frame(width, rows);
            let [east, north] = [width, rows].map(|count| count as i32 * 500 + 5000);
            let on_it = |&[x, y]: &[i32; 2]| {
                let (across, up) = ((-5000..=east).contains(&x), (-5000..=north).contains(&y));
                across && up && (x == -5000 || x == east || y == -5000 || y == north)
            };
            assert!(frame.places.iter().all(on_it), "{width} {rows} {:?}", frame.places);
            for axis in [0, 1] {
                for rim in [-5000, [north, east][axis]] {
                    let along = frame.places.iter().filter(|place| place[1 - axis] == rim);
                    let mut along: Vec<i32> = along.map(|place| place[axis]).collect();
                    along.sort_unstable();
                    assert_eq!(along.first(), Some(&-5000));
                    assert_eq!(along.last(), Some(&[east, north][axis]));
                    assert!(along.windows(2).all(|pair| pair[1] - pair[0] <= 8000), "{along:?}");
                }
            }
        }
    }

    #[test]
    fn a_slope_goes_on_and_one_point_or_a_line_is_level() {
        let plane = |x: i32, y: i32| Point::new(x, y, 700 + x / 2 - y / 4);
        let mut slope = frame(100, 60);
        for k in 0..300 {
            slope.add(&plane(k * 7919 % 50_000 / 4 * 4, k * 104_729 % 30_000 / 4 * 4));
        }
        for p in slope.vertices() {
            // What keeps a line level weighs little against points all around.
            let off = (p.z - plane(p.x, p.y).z).abs();
            assert!(off < 50, "{p:?} {off}");
        }
        let mut one = frame(100, 60);
        assert!(one.vertices().iter().all(|p| p.z == 0), "nothing is known");
        one.add(&Point::new(8000, 9000, -321));
        assert!(one.vertices().iter().all(|p| p.z == -321));
        let mut line = frame(100, 60);
        (0..50).for_each(|k| line.add(&Point::new(k * 1000, 15_000, k * 100)));
        let across = |p: &&Point| p.y == -5000 && (0..50_000).contains(&p.x);
        for p in line.vertices().iter().filter(across) {
            assert!((p.z - p.x / 10).abs() < 500, "{p:?}");
        }
    }
}
