//! Largest error and sum of squared errors of a finished triangle, every sample counted once.

use super::Local;
use super::field::Field;
use super::scan::Facet;
use crate::geom::predicates::orient;

/// Samples summed side by side; part of the arithmetic, so that sums never depend on the machine.
const LANES: usize = 8;

/// Measures triangle `p` over all its samples in `f64`. A sample on edge `i` counts in the sum only
/// when `owned[i]`; vertices have no error. Returns (largest error, sum of squares), the first
/// rounded towards zero. Time linear in the samples.
pub(super) fn measure(field: &Field, p: [Local; 3], owned: [bool; 3]) -> (f32, f32) {
    let facet = Facet::new(p, field.vertices(p));
    let whole = field.whole();
    let mut total = Total::default();
    let edges = facet.edges();
    let [first, last] = facet.row_range(&whole);
    for row in first..=last {
        let [low, high] = edges.columns(&whole, row);
        let counts = |col| is_owned(p, owned, Local::new(col as u32, row as u32));
        let is_level = has_level_edge(p, row);
        if low > high {
            continue;
        }
        let start = facet.base + facet.gy * f64::from(row);
        let error = |col: i32| {
            let at = Local::new(col as u32, row as u32);
            start + facet.gx * f64::from(col) - field.sample(at)
        };
        if is_level {
            (low..=high).for_each(|col| total.add(error(col), counts(col)));
            continue;
        }
        // Between the two ends of a row no sample lies on an edge.
        total.add(error(low), counts(low));
        if high > low {
            total.add(error(high), counts(high));
        }
        total.add_run(low + 1, high, error);
    }
    total.finish()
}

/// True when a row holds two corners, and so may run along an edge.
fn has_level_edge(p: [Local; 3], row: i32) -> bool {
    p.iter().filter(|corner| corner.row() as i32 == row).count() > 1
}

/// False when the sample lies on an edge that is not owned.
fn is_owned(p: [Local; 3], owned: [bool; 3], at: Local) -> bool {
    let q = at.lattice();
    (0..3).all(|edge| {
        let [from, to] = [edge, (edge + 1) % 3].map(|i| p[i].lattice());
        owned[edge] || orient(from, to, q) != 0
    })
}

/// Running figures of one triangle.
#[derive(Default)]
struct Total {
    largest: f64,
    sum: f64,
    lanes: [f64; LANES],
    most: [f64; LANES],
}

impl Total {
    fn add(&mut self, error: f64, is_counted: bool) {
        self.largest = self.largest.max(error.abs());
        if is_counted {
            self.sum += error * error;
        }
    }

    /// Adds the counted samples `from .. to`.
    #[inline(always)]
    fn add_run(&mut self, from: i32, to: i32, error: impl Fn(i32) -> f64) {
        let mut col = from;
        while col + LANES as i32 <= to {
            for lane in 0..LANES {
                let error = error(col + lane as i32);
                self.lanes[lane] += error * error;
                self.most[lane] = self.most[lane].max(error.abs());
            }
            col += LANES as i32;
        }
        (col..to).for_each(|col| self.add(error(col), true));
    }

    fn finish(self) -> (f32, f32) {
        let largest = self.most.iter().fold(self.largest, |most, &lane| most.max(lane));
        let sum = self.sum + self.lanes.iter().sum::<f64>();
        (towards_zero(largest), sum as f32)
    }
}

/// The nearest `f32` that is not above `value` (not negative).
fn towards_zero(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) > value { rounded.next_down() } else { rounded }
}

/// Which of the two triangles beside an edge owns the samples on it: decided by direction alone,
/// so that both sides agree wherever they are computed.
pub(super) fn owns_by_direction(from: Local, to: Local) -> bool {
    to.row() < from.row() || (to.row() == from.row() && to.col() > from.col())
}
