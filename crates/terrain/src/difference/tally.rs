//! Statistics of differences. Sums are exact, so they do not depend on the order of rectangles.

use super::DifferenceReport;
use terrane_base::exact_total::ExactTotal;
use terrane_base::geom::{Affine, Rect};
use terrane_engine::ground_units::GroundScale;

/// Sides of the reference: above it, and below.
const ABOVE: usize = 0;
const BELOW: usize = 1;

/// Units and threshold of areas and volumes.
#[derive(Clone, Debug)]
pub(super) struct DifferenceScale {
    /// To metres and square metres, if the units are known.
    pub(super) ground: Option<GroundScale>,
    /// Differences below count for no area and volume.
    pub(super) level_of_detection: f64,
}

/// Statistics of some samples.
#[derive(Clone, Debug, Default)]
pub(super) struct DifferenceTally {
    pub(super) compared: u64,
    pub(super) only_grid: u64,
    pub(super) only_reference: u64,
    /// Differences above 0 and below.
    sums: [ExactTotal; 2],
    squares: ExactTotal,
    extremes: [Option<DifferenceAt>; 2],
    /// Samples, areas and volumes above and below by at least the level of detection. Areas and volumes are in square
    /// metres and heights; if all cells have one area, volumes are in cells, and areas are not used.
    counts: [u64; 2],
    areas: [ExactTotal; 2],
    volumes: [ExactTotal; 2],
}

/// A difference and its sample.
#[derive(Clone, Copy, Debug)]
struct DifferenceAt {
    difference: f64,
    /// Row and column, in the order of samples.
    at: [u32; 2],
}

impl DifferenceTally {
    /// Adds the samples of a rectangle: heights of the grid and of the reference, and their differences.
    pub(super) fn add(
        &mut self,
        rect: Rect,
        [grid, reference, differences]: [&[f64]; 3],
        scale: &DifferenceScale,
    ) {
        let width = rect.width as usize;
        let rows = differences.chunks_exact(width).zip(grid.chunks_exact(width));
        let rows = rows.zip(reference.chunks_exact(width));
        for (row, ((differences, grid), reference)) in (rect.row..).zip(rows) {
            let by_row = scale.ground.as_ref().filter(|ground| ground.is_by_row());
            let of_row = by_row.map(|ground| ground.cell_area(f64::from(rect.col), row.into()));
            for (col, difference) in (rect.col..).zip(differences) {
                let at = (col - rect.col) as usize;
                if difference.is_nan() {
                    self.only_grid += u64::from(!grid[at].is_nan());
                    self.only_reference += u64::from(!reference[at].is_nan());
                    continue;
                }
                self.count(*difference, [row, col]);
                let side = if *difference > 0.0 { ABOVE } else { BELOW };
                if *difference == 0.0 || difference.abs() < scale.level_of_detection {
                    continue;
                }
                self.counts[side] += 1;
                match &scale.ground {
                    Some(ground) if ground.has_equal_cells() => self.volumes[side].add(*difference),
                    Some(ground) => {
                        let area =
                            of_row.unwrap_or_else(|| ground.cell_area(col.into(), row.into()));
                        self.areas[side].add(area);
                        self.volumes[side].add(area * difference);
                    }
                    None => {}
                }
            }
        }
    }

    fn count(&mut self, difference: f64, at: [u32; 2]) {
        self.compared += 1;
        let side = if difference > 0.0 { ABOVE } else { BELOW };
        self.sums[side].add(difference);
        self.squares.add_square(difference);
        self.extend(DifferenceAt { difference, at });
    }

    fn extend(&mut self, own: DifferenceAt) {
        for (side, extreme) in self.extremes.iter_mut().enumerate() {
            let sign = if side == ABOVE { -1.0 } else { 1.0 };
            let is_further = |other: &DifferenceAt| {
                let [own, other] = [(own.difference, own.at), (other.difference, other.at)];
                sign * own.0 < sign * other.0 || own.0 == other.0 && own.1 < other.1
            };
            if extreme.as_ref().is_none_or(is_further) {
                *extreme = Some(own);
            }
        }
    }

    /// Adds the samples of another.
    pub(super) fn merge(&mut self, other: &Self) {
        self.compared += other.compared;
        self.only_grid += other.only_grid;
        self.only_reference += other.only_reference;
        self.squares.merge(&other.squares);
        for side in [ABOVE, BELOW] {
            self.sums[side].merge(&other.sums[side]);
            self.counts[side] += other.counts[side];
            self.areas[side].merge(&other.areas[side]);
            self.volumes[side].merge(&other.volumes[side]);
        }
        other.extremes.iter().flatten().for_each(|extreme| self.extend(*extreme));
    }

    /// Fills in the report on samples of a lattice.
    pub(super) fn report(
        &self,
        lattice: &Affine,
        scale: &DifferenceScale,
        report: &mut DifferenceReport,
    ) {
        let Self { compared, only_grid, only_reference, .. } = *self;
        (report.compared, report.only_grid, report.only_reference) =
            (compared, only_grid, only_reference);
        if compared > 0 {
            let count = compared as f64;
            let mut sum = self.sums[ABOVE].clone();
            sum.merge(&self.sums[BELOW]);
            let absolute = self.sums[ABOVE].get() - self.sums[BELOW].get();
            report.mean = Some(sum.get() / count);
            report.mean_absolute = Some(absolute / count);
            report.rmse = Some((self.squares.get() / count).sqrt());
            report.stdev = Some(variance(compared, &sum, &self.squares).sqrt());
        }
        let [highest, lowest] = self.extremes;
        let place = |own: DifferenceAt| lattice.apply(own.at[1].into(), own.at[0].into());
        report.common.lowest = lowest.map(|own| own.difference);
        report.common.highest = highest.map(|own| own.difference);
        (report.lowest_at, report.highest_at) = (lowest.map(place), highest.map(place));
        let Some(ground) = &scale.ground else { return };
        // Any sample does for cells of one area.
        let (cell, rise) = (ground.cell_area(0.0, 0.0), ground.metres_per_height_unit());
        let [above, below] = [ABOVE, BELOW].map(|side| match ground.has_equal_cells() {
            true => [self.counts[side] as f64 * cell, self.volumes[side].get().abs() * cell * rise],
            false => [self.areas[side].get(), self.volumes[side].get().abs() * rise],
        });
        [report.area_above, report.volume_above] = above.map(Some);
        [report.area_below, report.volume_below] = below.map(Some);
    }
}

/// The variance of a number of values, from their exact sum and that of their squares: the difference of both is formed
/// in twice the precision, so a large mean does not spoil it.
fn variance(count: u64, sum: &ExactTotal, squares: &ExactTotal) -> f64 {
    let ([sum, sum_rest], [squares, squares_rest]) = (sum.get_pair(), squares.get_pair());
    let count = count as f64;
    // Products, and their rounding.
    let [all, mean] = [count * squares, sum * sum];
    let [all_rest, mean_rest] = [count.mul_add(squares, -all), sum.mul_add(sum, -mean)];
    let rest = all_rest - mean_rest + count * squares_rest - 2.0 * sum * sum_rest;
    ((all - mean + rest) / count / count).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Crs;
    use terrane_raster::{GridInfo, SampleType};

    #[test]
    fn a_large_mean_leaves_the_deviation_exact() {
        for mean in [0.0, 1.0, 1e6, -1e9] {
            let (mut sum, mut squares) = (ExactTotal::default(), ExactTotal::default());
            for at in 0..1000 {
                let value = mean + f64::from(at % 10) / 1024.0;
                sum.add(value);
                squares.add_square(value);
            }
            let found = variance(1000, &sum, &squares) * 1024.0 * 1024.0;
            assert!((found - 8.25).abs() < 1e-9, "{mean}: {found}");
        }
    }

    /// Heights of two grids of 30 x 20 samples, some of them void.
    fn heights(seed: u32) -> Vec<f64> {
        let value = |at: u32| match (at * 7919 + seed * 31) % 113 {
            0..9 => f64::NAN,
            value => f64::from(value * (at % 7 + seed) % 64) / 4.0,
        };
        (0..600).map(value).collect()
    }

    #[test]
    fn the_report_does_not_depend_on_how_the_grid_is_divided() {
        let [grid, reference] = [heights(1), heights(5)];
        let differences: Vec<f64> = grid.iter().zip(&reference).map(|(a, b)| a - b).collect();
        let degrees = Crs { geographic: Some(true), ..Crs::default() };
        let straight = Affine { x0: 7.0, a: 0.01, b: 0.0, y0: 47.0, d: 0.0, e: -0.01 };
        let turned = Affine { d: 0.003, b: 0.002, ..straight };
        for (crs, transform) in
            [(Crs::default(), straight), (degrees.clone(), straight), (degrees, turned)]
        {
            let info =
                GridInfo { crs, transform, ..GridInfo::plain("test", 30, 20, SampleType::F64) };
            let ground = Some(GroundScale::of(&info).unwrap());
            let scale = DifferenceScale { ground, level_of_detection: 4.0 };
            let divided = |cols: u32, rows: u32, is_reversed: bool| {
                let mut rects: Vec<Rect> = (0..20)
                    .step_by(rows as usize)
                    .flat_map(|row| {
                        (0..30)
                            .step_by(cols as usize)
                            .map(move |col| Rect::new(col, row, cols, rows))
                    })
                    .map(|rect| rect.intersect(&info.bounds()))
                    .collect();
                if is_reversed {
                    rects.reverse();
                }
                let mut all = DifferenceTally::default();
                for rect in rects {
                    let part = |from: &[f64]| -> Vec<f64> {
                        let rows =
                            (rect.row..rect.end_row()).map(|row| (row * 30 + rect.col) as usize);
                        rows.flat_map(|at| from[at..at + rect.width as usize].to_vec()).collect()
                    };
                    let mut own = DifferenceTally::default();
                    own.add(rect, [&part(&grid), &part(&reference), &part(&differences)], &scale);
                    all.merge(&own);
                }
                let mut report = DifferenceReport::default();
                all.report(&info.transform, &scale, &mut report);
                report
            };
            let whole = divided(30, 20, false);
            assert!(whole.compared > 300 && whole.only_grid > 10 && whole.only_reference > 10);
            for (cols, rows, is_reversed) in
                [(7, 3, false), (7, 3, true), (30, 1, true), (1, 20, false)]
            {
                assert_eq!(divided(cols, rows, is_reversed), whole, "{cols} {rows}");
            }
            let count = |own: &[f64], other: &[f64]| {
                own.iter().zip(other).filter(|(a, b)| !a.is_nan() && b.is_nan()).count() as u64
            };
            let only = [whole.only_grid, whole.only_reference];
            assert_eq!(only, [count(&grid, &reference), count(&reference, &grid)]);
            let highest = differences.iter().copied().fold(f64::MIN, f64::max);
            let equal: Vec<usize> = (0..600).filter(|at| differences[*at] == highest).collect();
            assert!(equal.len() > 1, "{highest} is there once and proves nothing");
            let first = info.transform.apply((equal[0] % 30) as f64, (equal[0] / 30) as f64);
            assert_eq!(whole.highest_at, Some(first));
            let valid: Vec<f64> = differences.iter().copied().filter(|d| !d.is_nan()).collect();
            let mean = valid.iter().sum::<f64>() / valid.len() as f64;
            let squares = valid.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
            let stdev = (squares / valid.len() as f64).sqrt();
            assert!((whole.mean.unwrap() - mean).abs() < 1e-9);
            assert!((whole.stdev.unwrap() - stdev).abs() < 1e-9);
            let absolute = valid.iter().map(|d| d.abs()).sum::<f64>() / valid.len() as f64;
            assert!((whole.mean_absolute.unwrap() - absolute).abs() < 1e-9);
            let ground = scale.ground.as_ref().unwrap();
            let volume =
                |at: (usize, &f64)| at.1 * ground.cell_area((at.0 % 30) as f64, (at.0 / 30) as f64);
            let above = differences.iter().enumerate().filter(|(_, d)| **d >= 4.0);
            let expected: f64 = above.map(volume).sum::<f64>() * ground.metres_per_height_unit();
            assert!((whole.volume_above.unwrap() / expected - 1.0).abs() < 1e-12);
        }
    }
}
