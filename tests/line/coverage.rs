//! A coverage with islands and lakes, for tests of lines.

use terrane_line::Xy;
use terrane_line::topology::Chains;

/// A generator with a fixed seed (SplitMix64).
struct Dice(u64);

impl Dice {
    /// From -1 to 1.
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((v ^ (v >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

#[derive(Default)]
pub(crate) struct Rings {
    pub(crate) points: Vec<Xy>,
    pub(crate) starts: Vec<usize>,
    pub(crate) closed: Vec<bool>,
}

impl Rings {
    fn new(rings: &[Vec<Xy>]) -> Self {
        let mut all = Self { starts: vec![0], ..Self::default() };
        for ring in rings {
            all.points.extend_from_slice(ring);
            all.points.push(ring[0]);
            all.starts.push(all.points.len());
            all.closed.push(true);
        }
        all
    }

    pub(crate) fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }
}

/// A rough line without its last vertex.
fn rough(dice: &mut Dice, a: Xy, b: Xy, levels: u32) -> Vec<Xy> {
    let mut line = vec![a, b];
    for _ in 0..levels {
        let mut finer = Vec::new();
        for pair in line.windows(2) {
            let [x, y] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let off = 0.25 * dice.signed();
            finer.push(pair[0]);
            finer.push([pair[0][0] + x / 2.0 - off * y, pair[0][1] + y / 2.0 + off * x]);
        }
        finer.push(b);
        line = finer;
    }
    line
}

/// Cells of a jittered grid with rough borders, an island in each, and a lake in each island that
/// is there as a hole and as a part of another layer.
pub(crate) fn world(seed: u64) -> Rings {
    let mut dice = Dice(seed);
    let side = 4;
    let corners: Vec<Vec<Xy>> = (0..=side)
        .map(|y| (0..=side).map(|x| [x, y].map(|v| f64::from(v) + 0.2 * dice.signed())).collect())
        .collect();
    let side = side as usize;
    let mut border = |a: Xy, b: Xy| rough(&mut dice, a, b, 5);
    let flat: Vec<Vec<Vec<Xy>>> = (0..=side)
        .map(|y| (0..side).map(|x| border(corners[y][x], corners[y][x + 1])).collect())
        .collect();
    let upright: Vec<Vec<Vec<Xy>>> = (0..side)
        .map(|y| (0..=side).map(|x| border(corners[y][x], corners[y + 1][x])).collect())
        .collect();
    let mut rings = Vec::new();
    for (y, x) in (0..side * side).map(|k| (k / side, k % side)) {
        let mut ring: Vec<Xy> = [&flat[y][x][1..], &upright[y][x + 1][1..]].concat();
        ring.extend(flat[y + 1][x].iter().rev().skip(1));
        ring.extend(upright[y][x].iter().rev().skip(1));
        let turn = (7 * x + 13 * y) % ring.len();
        ring.rotate_left(turn);
        rings.push(ring);
        let at = [x, y].map(|v| v as f64 + 0.5);
        let mut diamond = |size: f64| -> Vec<Xy> {
            let corner = |k: usize| {
                let sign = if k % 4 < 2 { size } else { -size };
                if k.is_multiple_of(2) { [at[0] + sign, at[1]] } else { [at[0], at[1] + sign] }
            };
            let sides = (0..4).flat_map(|k| {
                let mut side = rough(&mut dice, corner(k), corner(k + 1), 4);
                side.pop();
                side
            });
            sides.collect()
        };
        rings.push(diamond(0.15));
        let lake = diamond(0.04);
        let mut hole = lake.clone();
        hole.reverse();
        hole.rotate_left(5);
        rings.extend([lake, hole]);
    }
    Rings::new(&rings)
}
