//! Random worlds on small lattices, and where their vertices have to go.

use std::collections::BTreeSet;

use terrane_line::topology::{RingCollapse, Strategy};

/// A position in thousandths.
pub(crate) type Cell = [i64; 2];
pub(crate) type Segment = [Cell; 2];

/// A generator with a fixed seed (SplitMix64).
pub(crate) struct Dice(u64);

impl Dice {
    fn below(&mut self, count: i64) -> i64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((v ^ (v >> 31)) % count as u64) as i64
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len() as i64) as usize]
    }
}

/// A feature: a line, or the rings of a polygon.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    pub(crate) is_polygon: bool,
    pub(crate) parts: Vec<Vec<Cell>>,
}

pub(crate) fn closed(mut ring: Vec<Cell>) -> Vec<Cell> {
    ring.push(ring[0]);
    ring
}

/// Any ring: it may cross, touch and repeat itself.
pub(crate) fn tangle(dice: &mut Dice, size: i64) -> Vec<Cell> {
    let count = 2 + dice.below(13);
    closed((0..count).map(|_| [dice.below(size), dice.below(size)]).collect())
}

/// A ring around a centre, from one of its vertices on, this way round or that.
pub(crate) fn star(dice: &mut Dice, centre: Cell, radius: i64) -> Vec<Cell> {
    let count = 4 + dice.below(24);
    let mut ring: Vec<Cell> = Vec::new();
    for k in 0..count {
        let angle = std::f64::consts::TAU * k as f64 / count as f64;
        let r = (radius - dice.below(radius / 2 + 1)) as f64;
        let at = [angle.cos(), angle.sin()].map(|c| (r * c).round() as i64);
        ring.push([centre[0] + at[0], centre[1] + at[1]]);
    }
    ring.dedup();
    let turn = dice.below(ring.len() as i64) as usize;
    ring.rotate_left(turn);
    if dice.below(2) == 0 {
        ring.reverse();
    }
    closed(ring)
}

/// A walk that comes back to where it was, and at times ends where it began.
pub(crate) fn walk(dice: &mut Dice, size: i64) -> Vec<Cell> {
    let mut at = [dice.below(size), dice.below(size)];
    let mut line = vec![at];
    for _ in 0..1 + dice.below(24) {
        at = match dice.below(8) {
            0 => [dice.below(size), dice.below(size)],
            1 => line[dice.below(line.len() as i64) as usize],
            _ => [at[0] + dice.below(3) - 1, at[1] + dice.below(3) - 1],
        };
        line.push(at);
    }
    if dice.below(4) == 0 {
        line.push(line[0]);
    }
    if dice.below(6) == 0 {
        line.extend(line.clone().iter().rev());
    }
    line
}

/// The cells of a grid with rough borders that neighbours share.
pub(crate) fn coverage(dice: &mut Dice) -> Vec<Shape> {
    let (across, down, step) = (2 + dice.below(2) as usize, 1 + dice.below(3) as usize, 8);
    let mut corner =
        |x: usize, y: usize| [x as i64 * step + dice.below(3), y as i64 * step + dice.below(3)];
    let corners: Vec<Vec<Cell>> =
        (0..=down).map(|y| (0..=across).map(|x| corner(x, y)).collect()).collect();
    let mut border = |a: Cell, b: Cell| -> Vec<Cell> {
        let steps = 1 + dice.below(7);
        let inner: Vec<Cell> = (1..steps)
            .map(|k| {
                [0, 1].map(|axis| a[axis] + (b[axis] - a[axis]) * k / steps + dice.below(3) - 1)
            })
            .collect();
        [vec![a], inner, vec![b]].concat()
    };
    let flat: Vec<Vec<Vec<Cell>>> = (0..=down)
        .map(|y| (0..across).map(|x| border(corners[y][x], corners[y][x + 1])).collect())
        .collect();
    let upright: Vec<Vec<Vec<Cell>>> = (0..down)
        .map(|y| (0..=across).map(|x| border(corners[y][x], corners[y + 1][x])).collect())
        .collect();
    let back = |line: &[Cell]| line.iter().rev().copied().collect::<Vec<_>>();
    let mut shapes = Vec::new();
    for (y, x) in (0..down * across).map(|k| (k / across, k % across)) {
        let sides = [
            flat[y][x].clone(),
            upright[y][x + 1].clone(),
            back(&flat[y + 1][x]),
            back(&upright[y][x]),
        ];
        let mut ring = sides.concat();
        ring.dedup();
        ring.pop();
        let turn = dice.below(ring.len() as i64) as usize;
        ring.rotate_left(turn);
        shapes.push(Shape { is_polygon: true, parts: vec![closed(ring)] });
    }
    shapes
}

/// Features of a kind.
pub(crate) fn shapes(dice: &mut Dice, kind: i64) -> Vec<Shape> {
    let polygon = |parts| Shape { is_polygon: true, parts };
    let mut all = Vec::new();
    let size = 4 + dice.below(9);
    if kind == 0 {
        all = coverage(dice);
    }
    for _ in 0..1 + dice.below(4) {
        match if kind == 4 { 1 + dice.below(3) } else { kind } {
            1 => {
                let (centre, radius) = ([dice.below(30), dice.below(30)], 3 + dice.below(9));
                let mut rings = vec![star(dice, centre, radius)];
                if dice.below(3) == 0 {
                    rings.push(star(dice, centre, 2 + radius / 4));
                }
                all.push(polygon(rings));
            }
            2 => {
                let mut rings = vec![tangle(dice, size)];
                if dice.below(4) == 0 {
                    rings.push(tangle(dice, size));
                }
                all.push(polygon(rings));
            }
            3 => all.push(Shape { is_polygon: false, parts: vec![walk(dice, size)] }),
            _ => {}
        }
    }
    for part in all.iter_mut().flat_map(|shape| &mut shape.parts) {
        // Vertices that are there twice, the closing one among them.
        if dice.below(4) == 0 {
            let any = dice.below(part.len() as i64) as usize;
            let at = dice.of(&[0, part.len() - 1, any]);
            part.insert(at, part[at]);
        }
    }
    all
}

/// What is done with a world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    /// In thousandths, as all that follows.
    pub(crate) tolerance: i64,
    pub(crate) snap: i64,
    pub(crate) decimals: Option<u8>,
    pub(crate) tile_vertices: u64,
    pub(crate) method: usize,
    pub(crate) strategy: Strategy,
    pub(crate) collapse: RingCollapse,
}

/// A world in thousandths, and a way to simplify it but for strategy and collapse.
pub(crate) fn world(seed: u64) -> (Vec<Shape>, Way) {
    let mut dice = Dice(seed.wrapping_mul(0xD134_2543_DE82_EF95));
    let mut all = shapes(&mut dice, (seed % 5) as i64);
    let tolerance = dice.of(&[10, 500, 800, 1000, 1500, 2000, 4000]);
    let (snap, decimals) = match dice.below(6) {
        // Vertices are at eighths or whole numbers: floats that are what their texts say.
        0 => (300, None),
        1 => (300, Some(0)),
        2 | 3 => (0, Some(0)),
        _ => (0, None),
    };
    let scale = if snap == 0 && decimals.is_some() { 375 } else { 1000 };
    for at in all.iter_mut().flat_map(|shape| &mut shape.parts).flatten() {
        *at = at.map(|c| c * scale);
        if snap > 0 {
            *at = at.map(|c| c + 125 * dice.below(3));
        }
    }
    for shape in all.iter_mut().filter(|shape| shape.is_polygon) {
        for ring in &mut shape.parts {
            let last = ring.len() - 1;
            ring[last] = ring[0];
        }
    }
    let most = if snap == 0 && dice.below(2) == 0 { 4 + dice.below(30) as u64 } else { 1 << 20 };
    let method = dice.below(3) as usize;
    let (strategy, collapse) = (Strategy::Retroactive, RingCollapse::Minimal);
    let mut way = Way { tolerance, snap, decimals, tile_vertices: 0, method, strategy, collapse };
    let moved = moved(&all, &way);
    way.tile_vertices = most.max(crowd(&moved));
    (all, way)
}

/// Most vertices at one position.
pub(crate) fn crowd(all: &[Shape]) -> u64 {
    let mut cells: Vec<Cell> = all.iter().flat_map(|s| &s.parts).flatten().copied().collect();
    cells.sort_unstable();
    cells.chunk_by(|p, q| p == q).map(<[Cell]>::len).max().unwrap_or(0) as u64
}

/// A position with fewer digits; halves go away from zero.
pub(crate) fn rounded(p: Cell, decimals: u8) -> Cell {
    let unit = 10_i64.pow(3 - u32::from(decimals));
    p.map(|c| (2 * c.abs() + unit) / (2 * unit) * unit * c.signum())
}

/// Where vertices are before they are simplified: snapped, by the words of the manual.
pub(crate) fn moved(all: &[Shape], way: &Way) -> Vec<Shape> {
    let mut order: BTreeSet<Cell> = BTreeSet::new();
    order.extend(all.iter().flat_map(|shape| &shape.parts).flatten());
    let near = |p: Cell, q: Cell| square(sub(p, q)) <= i128::from(way.snap).pow(2);
    let mut stayed: Vec<Cell> = Vec::new();
    for p in order {
        if !stayed.iter().any(|q| near(p, *q)) {
            stayed.push(p);
        }
    }
    let place = |p: Cell| -> Cell {
        if way.snap > 0 { *stayed.iter().find(|q| near(p, **q)).unwrap() } else { p }
    };
    let mut moved = all.to_vec();
    moved.iter_mut().flat_map(|s| &mut s.parts).flatten().for_each(|at| *at = place(*at));
    moved
}

pub(crate) fn sub(p: Cell, q: Cell) -> Cell {
    [p[0] - q[0], p[1] - q[1]]
}

pub(crate) fn cross(p: Cell, q: Cell) -> i128 {
    i128::from(p[0]) * i128::from(q[1]) - i128::from(p[1]) * i128::from(q[0])
}

pub(crate) fn dot(p: Cell, q: Cell) -> i128 {
    i128::from(p[0]) * i128::from(q[0]) + i128::from(p[1]) * i128::from(q[1])
}

pub(crate) fn square(p: Cell) -> i128 {
    dot(p, p)
}
