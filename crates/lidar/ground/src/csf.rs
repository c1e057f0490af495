//! Cloth simulation: a cloth rises from below the points and stops at the lowest ones.
//!
//! After Zhang, Qi, Wan, Wang, Xie, Wang & Yan, "An easy-to-use airborne LiDAR data filtering method based on
//! cloth simulation" (2016), who turn the cloud upside down and let the cloth fall; here it rises. Nodes move
//! by Verlet's integration, neighbours one and two cells away draw them together, a node that meets the lowest
//! point of its cell stays there, and steep slopes that the cloth spans are corrected at the end.

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
    let mut sheet = ClothNodes {
        width,
        ceiling,
        before: start.clone(),
        now: start,
        fixed: vec![false; heights.len()],
    };
    let [pair, single] = stiffness(cloth.rigidness);
    for _ in 0..cloth.iterations {
        sheet.rise(GRAVITY * cloth.time_step * cloth.time_step);
        sheet.draw_together(pair, single);
        if sheet.meet() < STILL {
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

/// The nodes, one for each cell.
struct ClothNodes {
    width: usize,
    /// The height at which each node is fixed.
    ceiling: Vec<f64>,
    before: Vec<f64>,
    now: Vec<f64>,
    fixed: Vec<bool>,
}

impl ClothNodes {
    /// A step of the integration.
    fn rise(&mut self, push: f64) {
        let nodes = self.now.iter_mut().zip(&mut self.before).zip(&self.fixed);
        for ((now, before), _) in nodes.filter(|(_, fixed)| !**fixed) {
            let next = *now + (*now - *before) * (1.0 - DAMPING) + push;
            *before = *now;
            *now = next;
        }
    }

    /// Each node with its neighbours, one and two cells away.
    fn draw_together(&mut self, pair: f64, single: f64) {
        let rows = self.now.len() / self.width;
        // Each draw sees what those before it have moved, so the order of distances, directions and rows is
        // part of the result.
        for away in [1, 2] {
            for (east, north) in [(away, 0), (0, away), (away, away)] {
                for row in 0..rows.saturating_sub(north) {
                    self.draw_row(row, [east, north], false, [pair, single]);
                    if east > 0 && north > 0 {
                        self.draw_row(row, [east, north], true, [pair, single]);
                    }
                }
            }
        }
    }

    /// Draws the nodes of a row to those at an offset east and north; or west if `mirrored`.
    fn draw_row(&mut self, row: usize, [east, north]: [usize; 2], mirrored: bool, parts: [f64; 2]) {
        let (from, to) = (row * self.width, (row + north) * self.width);
        for col in 0..self.width.saturating_sub(east) {
            let (a, b) = match mirrored {
                false => (from + col, to + col + east),
                true => (from + col + east, to + col),
            };
            let apart = self.now[b] - self.now[a];
            let [pair, single] = parts;
            match [self.fixed[a], self.fixed[b]] {
                [false, false] => {
                    self.now[a] += apart * pair;
                    self.now[b] -= apart * pair;
                }
                [false, true] => self.now[a] += apart * single,
                [true, false] => self.now[b] -= apart * single,
                [true, true] => {}
            }
        }
    }

    /// Fixes nodes that have reached their height; returns the largest movement of the others.
    fn meet(&mut self) -> f64 {
        let mut max_movement = 0.0_f64;
        for at in 0..self.now.len() {
            if !self.fixed[at] {
                // Counted before the node is fixed: a cloth that has just met the ground is not still yet.
                max_movement = max_movement.max((self.now[at] - self.before[at]).abs());
                if self.now[at] >= self.ceiling[at] {
                    (self.now[at], self.fixed[at]) = (self.ceiling[at], true);
                }
            }
        }
        max_movement
    }

    /// Raises large groups of free nodes to their heights, as far as these continue from a fixed node without a
    /// jump.
    fn mend(&mut self) {
        let mut seen = self.fixed.clone();
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
            self.fixed[other] && (self.ceiling[other] - self.ceiling[node]).abs() < SMOOTH
        })
    }

    fn climb(&mut self, region: Vec<usize>) {
        let mut queue: Vec<usize> =
            region.into_iter().filter(|&node| self.continues(node)).collect();
        queue.iter().for_each(|&node| self.fix(node));
        while let Some(node) = queue.pop() {
            for other in neighbours(node, self.width, self.now.len()) {
                let apart = (self.ceiling[other] - self.ceiling[node]).abs();
                if !self.fixed[other] && apart < SMOOTH {
                    self.fix(other);
                    queue.push(other);
                }
            }
        }
    }

    fn fix(&mut self, node: usize) {
        (self.now[node], self.fixed[node]) = (self.ceiling[node], true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
