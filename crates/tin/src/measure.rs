//! Largest error and sum of squared errors of a finished triangle, every sample counted once.
//!
//! Errors are measured only for a report: the extra pass takes a third of the time of the kernel.

use super::Local;
use super::field::Field;
use super::scan::Facet;
use terrane_base::geom::predicates::orient;

/// Samples summed side by side; part of the arithmetic, so that sums never depend on the machine.
const LANES: usize = 8;

/// Measures triangle `p`, all samples of which are within `tolerance`, in `f64`. A sample on edge `i`
/// counts in the sum only when `owned[i]`; vertices have no error. Returns (largest error, sum of
/// squares); no sample is further off than the first, for which all rounding goes up, though not
/// beyond the tolerance. Time linear in the samples.
pub(super) fn measure(
    field: &Field,
    p: [Local; 3],
    owned: [bool; 3],
    tolerance: f64,
) -> (f32, f32) {
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
    total.finish(tolerance, |largest| doubt(&facet, p, field.vertices(p), largest))
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

    fn finish(self, tolerance: f64, doubt: impl Fn(f64) -> f64) -> (f32, f32) {
        let largest = self.most.iter().fold(self.largest, |most, &lane| most.max(lane));
        let sum = self.sum + self.lanes.iter().sum::<f64>();
        (upwards((largest + doubt(largest)).min(tolerance)), sum as f32)
    }
}

/// Bound on the rounding of an error up to `largest`: some ten operations on terms no larger than
/// these. A level facet has only one that rounds, the difference itself.
fn doubt(facet: &Facet, p: [Local; 3], z: [f64; 3], largest: f64) -> f64 {
    let [q, r, s] = p.map(|corner| corner.lattice().map(f64::from));
    let [[bx, by], [cx, cy]] = [r, s].map(|to| [to[0] - q[0], to[1] - q[1]]);
    let (zb, zc) = ((z[1] - z[0]).abs(), (z[2] - z[0]).abs());
    let (mut size, far) = (largest, |axis: usize| q[axis].max(r[axis]).max(s[axis]));
    if zb + zc > 0.0 {
        let area = (bx * cy - by * cx).abs();
        let reach = |b: f64, c: f64| b.abs() + c.abs();
        size += z.iter().fold(0.0, |most: f64, z| most.max(z.abs()));
        size += 2.0 * (facet.gx.abs() * far(0) + facet.gy.abs() * far(1));
        size += (zb * cy.abs() + zc * by.abs()) / area * reach(bx, cx);
        size += (zc * bx.abs() + zb * cx.abs()) / area * reach(by, cy);
    }
    16.0 * f64::EPSILON * size
}

/// The nearest `f32` that is not below `value` (not negative).
fn upwards(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) < value { rounded.next_up() } else { rounded }
}

/// Which of the two triangles beside an edge owns the samples on it: decided by direction alone,
/// so that both sides agree wherever they are computed.
pub(super) fn owns_by_direction(from: Local, to: Local) -> bool {
    to.row() < from.row() || (to.row() == from.row() && to.col() > from.col())
}
