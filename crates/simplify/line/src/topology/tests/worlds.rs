//! Small random test data on integer coordinates.

use super::twin;
use super::{Chains, RetainedChainVertices, Xy};

pub(super) type Cell = [i64; 2];

/// A generator with a fixed seed (SplitMix64).
pub(super) struct Dice(u64);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xD134_2543_DE82_EF95).wrapping_add(1))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        v ^ (v >> 31)
    }

    pub(super) fn below(&mut self, count: i64) -> i64 {
        (self.next() % count as u64) as i64
    }

    /// From -1 to 1.
    fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Chains (closed if they end at their start) and points.
#[derive(Debug)]
pub(super) struct World {
    pub(super) rings: Vec<Vec<Cell>>,
    pub(super) cells: Vec<Cell>,
    pub(super) points: Vec<Xy>,
    starts: Vec<usize>,
    pub(super) closed: Vec<bool>,
    pub(super) fixed_cells: Vec<Cell>,
    pub(super) fixed: Vec<Xy>,
}

fn float(p: &Cell) -> Xy {
    p.map(|v| v as f64)
}

impl World {
    pub(super) fn new(rings: Vec<Vec<Cell>>, fixed_cells: Vec<Cell>) -> Self {
        let cells: Vec<Cell> = rings.iter().flatten().copied().collect();
        let mut starts = vec![0];
        starts.extend(rings.iter().scan(0, |sum, ring| {
            *sum += ring.len();
            Some(*sum)
        }));
        let closed = rings.iter().map(|r| r.len() > 1 && r.first() == r.last()).collect();
        let points = cells.iter().map(float).collect();
        let fixed = fixed_cells.iter().map(float).collect();
        Self { rings, cells, points, starts, closed, fixed_cells, fixed }
    }

    pub(super) fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }

    pub(super) fn range(&self, chain: usize) -> std::ops::Range<usize> {
        self.starts[chain]..self.starts[chain + 1]
    }

    /// Whether nothing crosses, overlaps or touches, and no vertices except ends of chains coincide.
    pub(super) fn is_clean(&self) -> bool {
        let mut inner: Vec<Cell> = Vec::new();
        let mut ends = Vec::new();
        for ring in self.rings.iter().filter(|r| r.len() > 1) {
            inner.extend(&ring[1..ring.len() - 1]);
            ends.extend([ring[0], ring[ring.len() - 1]]);
        }
        inner.sort_unstable();
        let apart = inner.windows(2).all(|w| w[0] != w[1]);
        let joined = ends.iter().any(|end| inner.binary_search(end).is_ok());
        apart
            && !joined
            && twin::crossings(self, &RetainedChainVertices::all(&self.chains())).is_empty()
    }
}

/// A star-shaped ring of some roughness, in either orientation.
fn star(dice: &mut Dice, centre: Cell, radius: f64, rough: f64) -> Vec<Cell> {
    let count = 3 + dice.below(40);
    let mut ring: Vec<Cell> = Vec::new();
    for i in 0..count {
        let angle = std::f64::consts::TAU * i as f64 / count as f64;
        let r = radius * (1.0 - rough * (dice.signed() + 1.0) / 2.0);
        ring.push([centre[0] + (r * angle.cos()) as i64, centre[1] + (r * angle.sin()) as i64]);
    }
    ring.dedup();
    let turn = dice.below(ring.len() as i64) as usize;
    ring.rotate_left(turn);
    ring.push(ring[0]);
    if dice.below(2) == 0 {
        ring.reverse();
    }
    ring
}

fn points(dice: &mut Dice, size: i64) -> Vec<Cell> {
    (0..dice.below(8)).map(|_| [dice.below(size), dice.below(size)]).collect()
}

/// Islands that almost touch.
pub(super) fn archipelago(dice: &mut Dice) -> World {
    let size = 4096;
    let mut discs: Vec<(Cell, f64)> = Vec::new();
    for _ in 0..3 + dice.below(40) {
        let centre = [dice.below(size), dice.below(size)];
        let gap = |(c, r): &(Cell, f64)| twin::distance(float(c), [float(&centre); 2]) - r;
        let most = discs.iter().map(gap).fold(f64::from(1i32 << (3 + dice.below(8))), f64::min);
        if most > 12.0 {
            discs.push((centre, most - 4.0));
        }
    }
    let rings = discs.iter().map(|&(centre, radius)| {
        let rough = (dice.signed() + 1.0) / 2.0 * 0.9;
        star(dice, centre, radius, rough)
    });
    let rings = rings.collect();
    let fixed = points(dice, size);
    World::new(rings, fixed)
}

/// Rings within rings, close to each other, and lines across none of them.
pub(super) fn nested(dice: &mut Dice) -> World {
    let mut rings = Vec::new();
    let mut radius = 3000.0;
    while radius > 20.0 {
        let rough = 0.05 + 0.1 * (dice.signed() + 1.0);
        rings.push(star(dice, [0, 0], radius, rough));
        // A chord between vertices of a star lies within it, but may come near to the next one.
        radius *= (1.0 - rough) * (0.75 + 0.2 * dice.signed());
    }
    let fixed = points(dice, 3000);
    World::new(rings, fixed)
}

/// A spiral corridor with rough walls, closed to a ring or open.
pub(super) fn spiral(dice: &mut Dice) -> World {
    let count = 40 + dice.below(160);
    let turns = 1.0 + (dice.signed() + 1.0) * 2.0;
    let rough = (dice.signed() + 1.0) / 2.0;
    let mut wall = |side: f64| -> Vec<Cell> {
        let at = |i: i64| {
            let t = i as f64 / count as f64;
            let angle = t * turns * std::f64::consts::TAU;
            let r = 300.0 + 400.0 * (t * turns + side) + 90.0 * rough * dice.signed();
            [(r * angle.cos()) as i64, (r * angle.sin()) as i64]
        };
        (0..count).map(at).collect()
    };
    let (mut inner, mut outer) = (wall(0.0), wall(0.5));
    let rings = match dice.below(2) {
        0 => vec![inner, outer],
        _ => {
            outer.reverse();
            inner.append(&mut outer);
            inner.push(inner[0]);
            vec![inner]
        }
    };
    let fixed = points(dice, 2000);
    World::new(rings, fixed)
}

/// Borders of the cells of a jittered grid, each rough and cut at the corners.
pub(super) fn coverage(dice: &mut Dice) -> World {
    let (across, down) = (2 + dice.below(3), 2 + dice.below(3));
    let step = 1000;
    let mut corner = |_: i64, x: i64, y: i64| {
        [x * step + (250.0 * dice.signed()) as i64, y * step + (250.0 * dice.signed()) as i64]
    };
    let corners: Vec<Vec<Cell>> =
        (0..=down).map(|y| (0..=across).map(|x| corner(0, x, y)).collect()).collect();
    let rough = (dice.signed() + 1.0) / 2.0 * 250.0;
    let mut rings = Vec::new();
    for y in 0..=down as usize {
        for x in 0..=across as usize {
            if x < across as usize {
                rings.push(border(dice, corners[y][x], corners[y][x + 1], rough));
            }
            if y < down as usize {
                rings.push(border(dice, corners[y][x], corners[y + 1][x], rough));
            }
        }
    }
    World::new(rings, Vec::new())
}

/// A rough line that deviates from a straight one, most in the middle.
pub(super) fn border(dice: &mut Dice, a: Cell, b: Cell, rough: f64) -> Vec<Cell> {
    let count = 1 + dice.below(30);
    let along = [b[0] - a[0], b[1] - a[1]].map(|v| v as f64);
    let mut line: Vec<Cell> = (0..=count)
        .map(|i| {
            let t = i as f64 / count as f64;
            let off = 4.0 * t * (1.0 - t) * rough * dice.signed() / along[0].hypot(along[1]);
            let at = |axis: usize, side: f64| {
                (a[axis] as f64 + t * along[axis] + side * off * along[1 - axis]).round() as i64
            };
            [at(0, -1.0), at(1, 1.0)]
        })
        .collect();
    line.dedup();
    line
}

/// Lines and rings on few lattice positions: crossings, touches, overlaps and repeated vertices.
pub(super) fn lattice(dice: &mut Dice) -> World {
    let size = 3 + dice.below(40);
    let mut rings = Vec::new();
    for _ in 0..1 + dice.below(5) {
        let mut ring: Vec<Cell> = Vec::new();
        let mut at = [dice.below(size), dice.below(size)];
        for _ in 0..dice.below(14) {
            ring.push(at);
            at = match dice.below(3) {
                0 => [dice.below(size), dice.below(size)],
                _ => [at[0] + dice.below(3) - 1, at[1] + dice.below(3) - 1],
            };
        }
        if dice.below(2) == 0 && ring.len() > 1 {
            ring.push(ring[0]);
        }
        rings.push(ring);
    }
    let fixed = points(dice, size);
    World::new(rings, fixed)
}
