//! Cloth simulation: a cloth rises from below the points and stops at the lowest ones.
//!
//! After Zhang, Qi, Wan, Wang, Xie, Wang & Yan, "An easy-to-use airborne LiDAR data filtering method based on
//! cloth simulation" (2016), who turn the cloud upside down and let the cloth fall; here it rises. Nodes move
//! by Verlet's integration, neighbours one and two cells away draw them together, a node that meets the lowest
//! point of its cell stays there, and steep slopes that the cloth spans are corrected at the end.

use std::ops::Range;

use crate::finder::{GroundFinder, GroundTiling, Method, Request};
use crate::grid::{nearest_filled, neighbours, widened};
use crate::lowest_points::LowestPoints;
use crate::surface::GroundSurface;
use terrane_base::parameters::Parameter;

pub(crate) const METHOD: Method = Method {
    name: "csf",
    source: "Zhang and others 2016",
    about: "cloth simulation filter: a cloth rises from below until it meets the points",
    parameters: &[
        Parameter::new("cloth", 1.0, [0.25, 100.0], "distance between cloth nodes, metres"),
        Parameter::new(
            "rigidness",
            3.0,
            [1.0, 3.0],
            "cloth rigidness: 1 steep terrain, 2 hills, 3 plains",
        )
        .whole(),
        Parameter::new(
            "threshold",
            0.5,
            [0.0, 100.0],
            "maximum distance of ground from the cloth, metres",
        ),
        Parameter::new("step", 0.65, [0.1, 1.5], "time step"),
        Parameter::new("iterations", 500.0, [1.0, 10_000.0], "maximum number of steps").whole(),
        Parameter::new("smooth", 1.0, [0.0, 1.0], "post-processing of steep slopes, 0 or 1")
            .whole(),
    ],
    finder: GroundFinder {
        tiling: |request, _| GroundTiling::fixed(request.value("cloth")),
        bytes_per_cell: 112,
        find,
    },
};

fn find(request: &Request, lows: &LowestPoints<'_>) -> GroundSurface {
    let step = lows.step[2];
    let cloth = ClothParameters {
        rigidness: request.value("rigidness") as u32,
        time_step: request.value("step"),
        iterations: request.value("iterations") as u32,
        mend: request.value("smooth") > 0.0,
    };
    let heights = widened(&settled(&lows.heights(), lows.width, &cloth), lows.width);
    let heights = heights.into_iter().map(|z| z / step).collect();
    GroundSurface::new(lows.width, heights, |_| request.value("threshold") / step)
}

/// Parameters of the cloth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClothParameters {
    /// Cloth rigidness: 1 steep terrain, 2 hills, 3 plains.
    pub(crate) rigidness: u32,
    /// Time step of the integration.
    pub(crate) time_step: f64,
    pub(crate) iterations: u32,
    /// Whether steep slopes are corrected.
    pub(crate) mend: bool,
}

/// Acceleration of nodes.
const GRAVITY: f64 = 0.2;
/// Fraction of its speed that a node loses in a step.
const DAMPING: f64 = 0.01;
/// Metres below the lowest point that the cloth starts at.
const START: f64 = 0.05;
/// Convergence: largest movement of a node in the last step, in metres.
const STILL: f64 = 0.005;
/// Largest height difference to a settled neighbour at which a node is ground, too, in metres.
const SMOOTH: f64 = 0.3;
/// Fewest connected nodes that are corrected.
const MENDED: usize = 50;

/// Heights in metres of the settled cloth under the heights of cells (NaN for no points).
pub(crate) fn settled(heights: &[f64], width: usize, cloth: &ClothParameters) -> Vec<f64> {
    let ceiling = nearest_filled(heights, width);
    let lowest = ceiling.iter().copied().fold(f64::INFINITY, f64::min);
    if !lowest.is_finite() {
        return ceiling;
    }
    let start = vec![lowest - START; ceiling.len()];
    let free = vec![FREE; ceiling.len()];
    let mut sheet = ClothNodes { width, ceiling, before: start.clone(), now: start, free };
    let push = GRAVITY * cloth.time_step * cloth.time_step;
    let parts = stiffness(cloth.rigidness);
    for _ in 0..cloth.iterations {
        if sheet.step(push, parts) < STILL {
            break;
        }
    }
    if cloth.mend {
        sheet.mend();
    }
    sheet.now
}

/// Fractions of their distance by which two free nodes move towards each other, and a free node towards a fixed
/// one: `rigidness` times 0.3 of the remainder.
fn stiffness(rigidness: u32) -> [f64; 2] {
    let [pair, single] =
        [0.6, 0.3].map(|part| (0..rigidness).fold(1.0, |left, _| left * (1.0 - part)));
    [0.5 * (1.0 - pair), 1.0 - single]
}

/// Marks a node that moves, and one that is fixed: masks of the bits of a number.
const FREE: u64 = u64::MAX;
const FIXED: u64 = 0;
/// Rows that a step begins at once.
const ROWS: usize = 8;
/// Rows whose draws are made side by side.
const SIDE_BY_SIDE: usize = 8;
/// Cells east and north from a node to those that it is drawn to, in turn; where both are, west and north as well.
const OFFSETS: [[usize; 2]; 6] = [[1, 0], [0, 1], [1, 1], [2, 0], [0, 2], [2, 2]];

/// The nodes, one for each cell.
struct ClothNodes {
    width: usize,
    /// The height at which each node is fixed.
    ceiling: Vec<f64>,
    before: Vec<f64>,
    now: Vec<f64>,
    /// [`FREE`] or [`FIXED`].
    free: Vec<u64>,
}

impl ClothNodes {
    /// A step of the simulation; returns the largest movement of a free node.
    ///
    /// All nodes rise, then they are drawn together at each offset in turn, then they meet their heights. Each draw
    /// sees what those before it have moved, so the order of offsets and rows is part of the result. But an offset
    /// begins with rows that the one before it has left: a step is one sweep, with the rows of all offsets in cache.
    fn step(&mut self, push: f64, parts: [f64; 2]) -> f64 {
        let rows = self.now.len() / self.width;
        let (mut risen, mut drawn, mut met) = (0, [0; OFFSETS.len()], 0);
        let mut movement = 0.0_f64;
        while met < rows {
            let end = (risen + ROWS).min(rows);
            self.rise(risen..end, push);
            risen = end;
            let mut left = risen;
            for (offset, drawn) in OFFSETS.into_iter().zip(&mut drawn) {
                // Draws of a row move rows further north, too, which the offset before must have left.
                let end = if left == rows { rows } else { left.saturating_sub(offset[1]) };
                self.draw(*drawn..end, offset, parts);
                *drawn = end;
                left = end;
            }
            movement = movement.max(self.meet(met..left));
            met = left;
        }
        movement
    }

    /// The nodes of rows.
    fn nodes(&self, rows: Range<usize>) -> Range<usize> {
        rows.start * self.width..rows.end * self.width
    }

    /// A step of the integration.
    fn rise(&mut self, rows: Range<usize>, push: f64) {
        let nodes = self.nodes(rows);
        let places = self.now[nodes.clone()].iter_mut().zip(&mut self.before[nodes.clone()]);
        for ((now, before), free) in places.zip(&self.free[nodes]) {
            let next = *now + (*now - *before) * (1.0 - DAMPING) + push;
            let is_free = *free == FREE;
            *before = *now;
            *now = if is_free { next } else { *now };
        }
    }

    /// Draws the nodes of rows to those at an offset.
    fn draw(&mut self, rows: Range<usize>, [east, north]: [usize; 2], parts: [f64; 2]) {
        let width = self.width;
        if north == 0 {
            let nodes = self.nodes(rows);
            let group = SIDE_BY_SIDE * width;
            let groups = self.now[nodes.clone()].chunks_mut(group);
            groups.zip(self.free[nodes].chunks(group)).for_each(|(now, free)| {
                draw_along(now, free, width, east, parts);
            });
            return;
        }
        for row in rows.start..rows.end.min((self.now.len() / width).saturating_sub(north)) {
            let nodes = self.nodes(row..row + north + 1);
            let (now, free) = (&mut self.now[nodes.clone()], &self.free[nodes]);
            let (own, other) = now.split_at_mut(north * width);
            let (own, own_free) = (&mut own[..width], &free[..width]);
            let other_free = &free[north * width..];
            let less = width.saturating_sub(east);
            let from = width - less;
            draw_pairs(
                [&mut own[..less], &mut other[from..]],
                [&own_free[..less], &other_free[from..]],
                parts,
            );
            if east > 0 {
                draw_pairs(
                    [&mut own[from..], &mut other[..less]],
                    [&own_free[from..], &other_free[..less]],
                    parts,
                );
            }
        }
    }

    /// Fixes nodes that have reached their height; returns the largest movement of the others.
    fn meet(&mut self, rows: Range<usize>) -> f64 {
        let nodes = self.nodes(rows);
        let places = self.now[nodes.clone()].iter_mut().zip(&mut self.free[nodes.clone()]);
        let known = self.before[nodes.clone()].iter().zip(&self.ceiling[nodes]);
        // As bits, which are in the order of numbers that are not negative: their maximum is found without waiting.
        let mut movement = 0;
        for ((now, free), (before, ceiling)) in places.zip(known) {
            // Counted before the node is fixed: a cloth that has just met the ground is not still yet.
            movement = movement.max((*now - *before).abs().to_bits() & *free);
            let is_met = *now >= *ceiling;
            // A fixed node is at its height.
            *now = if is_met { *ceiling } else { *now };
            *free = if is_met { FIXED } else { *free };
        }
        f64::from_bits(movement)
    }

    /// Raises large groups of free nodes to their heights, as far as these continue from a fixed node without a
    /// jump.
    fn mend(&mut self) {
        let mut seen: Vec<bool> = self.free.iter().map(|free| *free == FIXED).collect();
        for at in 0..seen.len() {
            if !seen[at] {
                let region = self.region(at, &mut seen);
                if region.len() > MENDED {
                    self.climb(region);
                }
            }
        }
    }

    /// The connected free nodes around one; marks them as seen.
    fn region(&self, at: usize, seen: &mut [bool]) -> Vec<usize> {
        let mut region = vec![at];
        seen[at] = true;
        let mut next = 0;
        while let Some(&node) = region.get(next) {
            for other in neighbours(node, self.width, self.now.len()) {
                if !seen[other] {
                    seen[other] = true;
                    region.push(other);
                }
            }
            next += 1;
        }
        region
    }

    /// Whether the height of a node continues from a fixed neighbour without a jump.
    fn continues(&self, node: usize) -> bool {
        neighbours(node, self.width, self.now.len()).any(|other| {
            self.free[other] == FIXED && (self.ceiling[other] - self.ceiling[node]).abs() < SMOOTH
        })
    }

    fn climb(&mut self, region: Vec<usize>) {
        let mut queue: Vec<usize> =
            region.into_iter().filter(|&node| self.continues(node)).collect();
        queue.iter().for_each(|&node| self.fix(node));
        while let Some(node) = queue.pop() {
            for other in neighbours(node, self.width, self.now.len()) {
                let apart = (self.ceiling[other] - self.ceiling[node]).abs();
                if self.free[other] == FREE && apart < SMOOTH {
                    self.fix(other);
                    queue.push(other);
                }
            }
        }
    }

    fn fix(&mut self, node: usize) {
        (self.now[node], self.free[node]) = (self.ceiling[node], FIXED);
    }
}

/// The part of its distance from another that a node moves; nothing if it is fixed.
#[inline(always)]
fn part(own: u64, other: u64, [pair, single]: [f64; 2]) -> f64 {
    // Bits instead of branches, which are unpredictable, and keep the compiler from making vectors.
    f64::from_bits(own & (other & pair.to_bits() | !other & single.to_bits()))
}

/// Draws nodes of two rows together, each to the one beside it. The compiler makes vectors of it only where slices
/// are arguments, which do not overlap.
#[inline(never)]
fn draw_pairs([a, b]: [&mut [f64]; 2], [free_a, free_b]: [&[u64]; 2], parts: [f64; 2]) {
    for ((a, b), (free_a, free_b)) in a.iter_mut().zip(b).zip(free_a.iter().zip(free_b)) {
        let apart = *b - *a;
        *a += apart * part(*free_a, *free_b, parts);
        *b -= apart * part(*free_b, *free_a, parts);
    }
}

/// Draws the nodes of some rows to those `east` of them, column by column: in a row each draw waits for the one
/// before it, while those of other rows do not.
fn draw_along(now: &mut [f64], free: &[u64], width: usize, east: usize, parts: [f64; 2]) {
    let mut rows: Vec<_> = now.chunks_exact_mut(width).zip(free.chunks_exact(width)).collect();
    for col in 0..width.saturating_sub(east) {
        for (now, free) in &mut rows {
            let apart = now[col + east] - now[col];
            now[col] += apart * part(free[col], free[col + east], parts);
            now[col + east] -= apart * part(free[col + east], free[col], parts);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A step as it is defined: offset by offset, row by row, pair by pair.
    fn slow_step(cloth: &mut ClothNodes, push: f64, [pair, single]: [f64; 2]) -> f64 {
        let ClothNodes { width, ceiling, before, now, free } = cloth;
        let (width, rows, mut movement) = (*width, now.len() / *width, 0.0_f64);
        let moving =
            |free: &[u64]| (0..free.len()).filter(|at| free[*at] == FREE).collect::<Vec<_>>();
        for at in moving(free) {
            let next = now[at] + (now[at] - before[at]) * (1.0 - DAMPING) + push;
            (before[at], now[at]) = (now[at], next);
        }
        for [east, north] in OFFSETS {
            for row in 0..rows.saturating_sub(north) {
                for is_west in [false, true].into_iter().take(1 + (east * north).min(1)) {
                    for col in 0..width.saturating_sub(east) {
                        let (from, to) =
                            if is_west { (col + east, col) } else { (col, col + east) };
                        let (a, b) = (row * width + from, (row + north) * width + to);
                        let apart = now[b] - now[a];
                        match [free[a], free[b]].map(|free| free == FREE) {
                            [true, true] => {
                                (now[a], now[b]) = (now[a] + apart * pair, now[b] - apart * pair)
                            }
                            [true, false] => now[a] += apart * single,
                            [false, true] => now[b] -= apart * single,
                            [false, false] => {}
                        }
                    }
                }
            }
        }
        for at in moving(free) {
            movement = movement.max((now[at] - before[at]).abs());
            if now[at] >= ceiling[at] {
                (now[at], free[at]) = (ceiling[at], FIXED);
            }
        }
        movement
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn a_sweep_is_the_step_that_is_defined(
            width in 1..40usize, heights in prop::collection::vec(0.0..9.0f64, 1..1200), rigidness in 1..4u32,
        ) {
            let rows = (heights.len() / width).max(1);
            let ceiling: Vec<f64> = heights.iter().copied().cycle().take(width * rows).collect();
            let start = vec![-0.05; ceiling.len()];
            let free = vec![FREE; ceiling.len()];
            let sheet = || ClothNodes { width, ceiling: ceiling.clone(), before: start.clone(), now: start.clone(), free: free.clone() };
            let (mut fast, mut slow) = (sheet(), sheet());
            for _ in 0..30 {
                let moved = [
                    fast.step(0.0845, stiffness(rigidness)),
                    slow_step(&mut slow, 0.0845, stiffness(rigidness)),
                ];
                prop_assert_eq!(moved[0], moved[1]);
                prop_assert_eq!(&fast.now, &slow.now);
                prop_assert_eq!(&fast.free, &slow.free);
            }
        }
    }

    #[test]
    fn rigid_cloths_draw_more() {
        let near = |found: [f64; 2], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(near(stiffness(1), [0.3, 0.3]));
        assert!(near(stiffness(2), [0.42, 0.51]));
        assert!(near(stiffness(3), [0.468, 0.657]));
    }

    #[test]
    fn a_cloth_lies_on_level_ground_and_spans_a_pit_of_the_cloud_turned_over() {
        let (width, cells) = (60, 60 * 60);
        let roof = |k: usize| (25..35).contains(&(k % width)) && (25..35).contains(&(k / width));
        let heights: Vec<f64> = (0..cells).map(|k| if roof(k) { 8.0 } else { 2.0 }).collect();
        let cloth = ClothParameters { rigidness: 3, time_step: 0.65, iterations: 500, mend: true };
        let found = settled(&heights, width, &cloth);
        for (k, z) in found.into_iter().enumerate() {
            assert!(if roof(k) { z < 5.0 } else { (z - 2.0).abs() < 0.5 }, "{k} {z}");
        }
    }
}
