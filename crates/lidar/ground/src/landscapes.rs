//! Landscapes whose ground is known, with what stands on them: all methods beside each other, with low outliers and
//! without.

use crate::finder::Request;
use crate::lowest_points::{LowestPoints, NO_POINT};
use crate::method::METHODS;
use terrane_base::geom::Point;
use terrane_delaunay::{FixedPosition, Triangulation, interpolate};

/// Metres along a landscape.
const SIDE: usize = 200;
/// Deviation of the ranging in metres.
const RANGING: f64 = 0.03;

/// Numbers from 0 to 1 that look like chance.
struct LandscapeDice(u64);

pub(crate) fn mixed(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}

fn share(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

impl LandscapeDice {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        share(mixed(self.0))
    }

    /// About normal, of mean 0 and deviation 1.
    fn normal(&mut self) -> f64 {
        (0..4).map(|_| self.next()).sum::<f64>() * 3.0_f64.sqrt() - 2.0 * 3.0_f64.sqrt()
    }
}

/// Smooth hills from -1 to 1, about one in a square of side 1.
fn hills(x: f64, y: f64, seed: u64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let [u, v] = [x - i, y - j].map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let [low, high] = [j, j + 1.0].map(|j| {
        let [west, east] = [i, i + 1.0].map(|i| lattice_height(i, j, seed));
        west + (east - west) * u
    });
    low + (high - low) * v
}

/// Height from -1 to 1 at a corner of the lattice of hills.
fn lattice_height(i: f64, j: f64, seed: u64) -> f64 {
    let at = (i as i64 as u64)
        .wrapping_mul(0x8DA6_B343)
        .wrapping_add((j as i64 as u64).wrapping_mul(0xD816_3841));
    2.0 * share(mixed(at ^ mixed(seed))) - 1.0
}

/// Hills on hills, the largest `wave` metres wide.
fn rough(x: f64, y: f64, wave: f64, seed: u64) -> f64 {
    let octaves = (0..5).map(|k| {
        0.45_f64.powi(k)
            * hills(x / wave * 2.0_f64.powi(k), y / wave * 2.0_f64.powi(k), seed + k as u64)
    });
    octaves.sum()
}

/// Height of the ground at a place.
type Relief = fn(f64, f64) -> f64;
/// How high above the ground an echo comes from, if one comes: 0 for the ground.
type Cover = fn(f64, f64, &mut LandscapeDice) -> Option<f64>;

/// One landscape.
struct Landscape {
    name: &'static str,
    relief: Relief,
    cover: Cover,
    /// Points to a square metre.
    density: f64,
}

fn hilly(x: f64, y: f64) -> f64 {
    12.0 * rough(x, y, 120.0, 1)
}

fn steep(x: f64, y: f64) -> f64 {
    0.7 * x + 0.15 * y + 9.0 * rough(x, y, 60.0, 2)
}

fn gentle(x: f64, y: f64) -> f64 {
    0.04 * x - 0.02 * y + 4.0 * rough(x, y, 150.0, 3)
}

fn gullies(x: f64, y: f64) -> f64 {
    let cut = |deep: f64, wide: f64, away: f64| deep * (1.0 - away.abs() / wide).max(0.0);
    let wide = cut(5.0, 0.14, hills(x / 45.0, y / 60.0, 5));
    0.12 * x + 6.0 * rough(x, y, 140.0, 4)
        - wide
        - cut(2.5, 0.2, hills(x / 17.0 + 3.3, y / 21.0, 6))
}

fn terraces(x: f64, y: f64) -> f64 {
    let level = (0.25 * x + 0.08 * y + 5.0 * rough(x, y, 110.0, 7)) / 2.4;
    let part = level - level.floor();
    2.4 * (level.floor() + if part < 0.9 { 0.1 * part } else { 0.09 + 9.1 * (part - 0.9) })
}

fn alpine(x: f64, y: f64) -> f64 {
    let ridges = 70.0 * (0.9 - 1.6 * hills(x / 110.0, y / 110.0, 8).abs());
    ridges + 14.0 * (0.5 - hills(x / 33.0, y / 33.0, 9).abs()) + 3.0 * rough(x, y, 12.0, 10)
}

/// 18 m high, and so steep at its foot that there is scree.
fn cliff(x: f64, y: f64) -> f64 {
    let edge = 100.0 + 18.0 * rough(x, y, 70.0, 11);
    let up = if x > edge { 18.0 } else { 2.1 * (x - edge + 3.0).max(0.0) };
    0.05 * y + 2.0 * rough(x, y, 40.0, 12) + up
}

fn valley(x: f64, y: f64) -> f64 {
    let away = ((y - 100.0).abs() / 28.0).min(1.0);
    0.02 * x - 9.0 * (1.0 - away * away * (3.0 - 2.0 * away)) + rough(x, y, 60.0, 13)
}

fn shores(x: f64, y: f64) -> f64 {
    0.8 + 5.0 * rough(x, y, 110.0, 14)
}

fn flat(x: f64, y: f64) -> f64 {
    0.004 * x + 0.4 * rough(x, y, 90.0, 15)
}

fn dunes(x: f64, y: f64) -> f64 {
    6.0 * (1.0 - 2.0 * hills(x / 40.0, y / 70.0, 16).abs()) + 0.5 * rough(x, y, 9.0, 17)
}

/// Ditches and a dike.
fn polder(x: f64, y: f64) -> f64 {
    let (ditch, dike) =
        ((x + 0.3 * y).rem_euclid(37.0) - 18.0, (y - 0.2 * x).rem_euclid(61.0) - 30.0);
    flat(x, y) - 1.3 * (1.0 - ditch.abs() / 1.6).max(0.0)
        + 3.2 * (1.0 - dike.abs() / 9.0).clamp(0.0, 0.5)
}

/// Through crowns so high the ground is seen by a share of pulses, and plants below them by another.
fn forest(x: f64, y: f64, dice: &mut LandscapeDice, [open, low, high]: [f64; 3]) -> f64 {
    let crown = 0.5 + 0.5 * hills(x / 4.0, y / 4.0, 91) + 0.25 * hills(x / 25.0, y / 25.0, 92);
    if dice.next() < (open * (1.6 - 1.4 * crown)).clamp(0.005, 1.0) {
        return 0.0;
    }
    let (is_low, deep) = (dice.next() < low, dice.next());
    if is_low {
        0.15 + 2.0 * deep * deep
    } else {
        high * (0.6 + 0.4 * crown) * (1.0 - 0.7 * deep * deep)
    }
}

/// Single trees.
fn tree(x: f64, y: f64, dice: &mut LandscapeDice, share: f64) -> Option<f64> {
    let crown =
        hills(x / 5.0, y / 5.0, 77) + 0.6 * hills(x / 20.0, y / 20.0, 78) - 1.0 + 2.0 * share;
    let is_hit = crown > 0.0 && dice.next() < 0.75;
    is_hit.then(|| 1.5 + (4.0 + 9.0 * crown.min(1.0)) * (1.0 - 0.8 * dice.next().powi(2)))
}

/// Patches of herbs or shrubs so high.
fn herbs(x: f64, y: f64, dice: &mut LandscapeDice, [share, high]: [f64; 2]) -> f64 {
    let patch = hills(x / 2.0, y / 2.0, 55) + 0.5 * hills(x / 9.0, y / 9.0, 56);
    let is_hit = patch > 1.0 - 2.0 * share && dice.next() < 0.8;
    if is_hit { high * (0.3 + 0.7 * dice.next()) } else { 0.0 }
}

/// Houses on lots so wide, of which they fill a share, and so high at most.
fn house(x: f64, y: f64, [lot, fill, high]: [f64; 3]) -> Option<f64> {
    let (i, j) = ((x / lot).floor(), (y / lot).floor());
    let mut dice = LandscapeDice(mixed(lot as u64 ^ (i as u64) << 20 ^ j as u64));
    let is_built = dice.next() > 0.2;
    let along = [[1.0, 0.0], [0.8, 0.6], [0.6, 0.8], [0.96, 0.28]][(dice.next() * 4.0) as usize];
    let centre = [i, j].map(|at: f64| (at + 0.5 + 0.15 * (dice.next() - 0.5)) * lot);
    let half =
        [0.6 + 0.4 * dice.next(), 0.45 + 0.4 * dice.next()].map(|part| part * lot * fill * 0.5);
    let eaves = 2.6 + high * dice.next() * dice.next();
    let ridge = if dice.next() < 0.5 { 0.6 * half[1] } else { 0.0 };
    let (dx, dy) = (x - centre[0], y - centre[1]);
    let (u, v) = ((dx * along[0] + dy * along[1]).abs(), (dy * along[0] - dx * along[1]).abs());
    (is_built && u <= half[0] && v <= half[1]).then(|| eaves + ridge * (1.0 - v / half[1]))
}

/// A deck across the valley.
fn deck(x: f64, y: f64) -> Option<f64> {
    let above = 0.02 * x - valley(x, y);
    ((x - 90.0).abs() < 5.0 && above > 1.0).then_some(above)
}

const fn landscape(name: &'static str, relief: Relief, density: f64, cover: Cover) -> Landscape {
    Landscape { name, relief, cover, density }
}

const LANDSCAPES: &[Landscape] = &[
    landscape("steep forest", steep, 6.0, |x, y, d| Some(forest(x, y, d, [0.15, 0.2, 18.0]))),
    landscape("wet forest", hilly, 9.0, |x, y, d| Some(forest(x, y, d, [0.05, 0.45, 24.0]))),
    landscape("steep wet forest", steep, 12.0, |x, y, d| Some(forest(x, y, d, [0.06, 0.35, 26.0]))),
    landscape("open woodland", gentle, 4.0, |x, y, d| {
        tree(x, y, d, 0.3).or_else(|| Some(herbs(x, y, d, [0.3, 1.0])))
    }),
    landscape("gullies", gullies, 4.0, |x, y, d| Some(herbs(x, y, d, [0.2, 0.6]))),
    landscape("gullies in a forest", gullies, 6.0, |x, y, d| {
        Some(forest(x, y, d, [0.3, 0.2, 14.0]))
    }),
    landscape("lakes", shores, 4.0, |x, y, d| {
        let mut dry = || tree(x, y, d, 0.15).unwrap_or_else(|| herbs(x, y, d, [0.2, 0.8]));
        (shores(x, y) >= 0.0).then(&mut dry)
    }),
    landscape("bridge", valley, 6.0, |x, y, d| {
        deck(x, y).or_else(|| tree(x, y, d, 0.2)).or_else(|| Some(herbs(x, y, d, [0.2, 0.5])))
    }),
    landscape("terraces", terraces, 5.0, |x, y, d| {
        tree(x, y, d, 0.1).or_else(|| Some(herbs(x, y, d, [0.15, 1.2])))
    }),
    landscape("alpine", alpine, 3.0, |x, y, d| Some(herbs(x, y, d, [0.05, 0.5]))),
    landscape("cliff", cliff, 4.0, |x, y, d| {
        tree(x, y, d, 0.2).or_else(|| Some(herbs(x, y, d, [0.1, 0.6])))
    }),
    landscape("village", hilly, 5.0, |x, y, d| {
        house(x, y, [28.0, 0.6, 8.0])
            .or_else(|| tree(x, y, d, 0.15))
            .or_else(|| Some(herbs(x, y, d, [0.1, 1.0])))
    }),
    landscape("town", gentle, 8.0, |x, y, d| {
        house(x, y, [45.0, 0.85, 30.0])
            .or_else(|| tree(x, y, d, 0.1))
            .or_else(|| Some(herbs(x, y, d, [0.06, 1.6])))
    }),
    landscape("halls", flat, 5.0, |x, y, d| {
        house(x, y, [110.0, 0.9, 8.0]).or_else(|| Some(herbs(x, y, d, [0.06, 2.0])))
    }),
    landscape("dunes", dunes, 3.0, |x, y, d| Some(herbs(x, y, d, [0.2, 0.7]))),
    landscape("polder", polder, 6.0, |x, y, d| {
        house(x, y, [90.0, 0.2, 4.0]).or_else(|| Some(herbs(x, y, d, [0.2, 0.8])))
    }),
];

fn point([x, y, z]: [f64; 3]) -> Point {
    let [x, y, z] = [x, y, z].map(|v| (v * 1000.0).round() as i32);
    Point::new(x, y, z)
}

impl Landscape {
    /// Points in millimetres.
    fn points(&self) -> Vec<Point> {
        let mut dice = LandscapeDice(self.name.len() as u64);
        let count = (self.density * (SIDE * SIDE) as f64) as usize;
        let echo = |_| {
            let [x, y] = [dice.next(), dice.next()].map(|part| part * SIDE as f64);
            let above = (self.cover)(x, y, &mut dice)?;
            Some(point([x, y, (self.relief)(x, y) + above + RANGING * dice.normal()]))
        };
        (0..count).filter_map(echo).collect()
    }

    /// Single points, pairs and clumps below the ground and single ones in the air: of a million points some hundred.
    fn outliers(&self, points: &[Point]) -> Vec<Point> {
        let mut dice = LandscapeDice(7);
        let mut found = Vec::new();
        for _ in 0..points.len() / 8000 {
            let [x, y] = [dice.next(), dice.next()].map(|part| part * SIDE as f64);
            let deep =
                if dice.next() < 0.5 { 1.5 + 6.0 * dice.next() } else { 5.0 + 45.0 * dice.next() };
            let low =
                (0..25).map(|k| (self.relief)(x + f64::from(k % 5 - 2), y + f64::from(k / 5 - 2)));
            let z = low.fold(f64::INFINITY, f64::min) - deep;
            let clump = [1, 1, 2, 3 + (dice.next() * 6.0) as usize][(dice.next() * 4.0) as usize];
            let beside = |at: f64, dice: &mut LandscapeDice| {
                (at + 2.0 * (dice.next() - 0.5)).clamp(0.0, SIDE as f64)
            };
            found.extend((0..clump).map(|_| {
                let at = [beside(x, &mut dice), beside(y, &mut dice)];
                point([at[0], at[1], z + 0.4 * dice.next()])
            }));
            found.push(point([x, y, z + deep + 20.0 + 80.0 * dice.next()]));
        }
        found
    }

    /// Root of the mean square of what separates the triangulation of the ground that a method finds from the ground,
    /// in metres at the centres of cells; where points come from none is known, no cell counts.
    fn error(&self, method: &Request, points: &[Point]) -> f64 {
        let ground = model(&found(method, points));
        let (mut count, mut sum) = (0.0, 0.0);
        for (at, z) in ground.into_iter().enumerate() {
            let (x, y) = ((at % SIDE) as f64 + 0.5, (at / SIDE) as f64 + 0.5);
            let is_seen =
                (self.cover)(x, y, &mut LandscapeDice(at as u64)).is_some() && deck(x, y).is_none();
            if let Some(z) = z.filter(|_| is_seen) {
                sum += (z - (self.relief)(x, y)).powi(2);
                count += 1.0;
            }
        }
        assert!(count > 0.9 * (SIDE * SIDE) as f64 * if self.name == "lakes" { 0.5 } else { 1.0 });
        f64::sqrt(sum / count)
    }
}

/// The points that a method finds to be ground.
fn found(method: &Request, points: &[Point]) -> Vec<Point> {
    let cell = method.tiling(1.0).cell;
    let (steps, width) = (cell * 1000.0, (SIDE as f64 / cell).ceil() as usize + 1);
    let place = |p: &Point| [p.x, p.y].map(|v| (f64::from(v) / steps).floor() as usize);
    let mut lows = vec![NO_POINT; width * width];
    for p in points {
        let [col, row] = place(p);
        let low = &mut lows[row * width + col];
        *low = if (p.z, p.x, p.y) < (low.z, low.x, low.y) { *p } else { *low };
    }
    let ground = method.find(&LowestPoints {
        points: &lows,
        width,
        cell,
        corner: [0.0; 2],
        step: [0.001; 3],
    });
    let is_ground = |p: &&Point| {
        let [col, row] = place(p);
        let within = [p.x, p.y].map(|v| (f64::from(v) / steps).fract());
        ground.is_ground(col, row, within, p.z)
    };
    points.iter().filter(is_ground).copied().collect()
}

/// Heights in metres at the centres of cells of a metre.
fn model(ground: &[Point]) -> Vec<Option<f64>> {
    let mut points = ground.to_vec();
    points.sort_unstable();
    points.dedup_by_key(|p| [p.x, p.y]);
    let all = Triangulation::new(&points).unwrap();
    let mut last = 0;
    let heights = (0..SIDE * SIDE).map(|at| {
        let site = [at % SIDE, at / SIDE].map(|k| k as i32 * 1000 + 500);
        last = all.find(site, last)?;
        let corners = all.corners(last)?.map(|id| points[id as usize]);
        Some(interpolate(&corners, FixedPosition::of(site)) / 1000.0)
    });
    heights.collect()
}

fn methods() -> impl Iterator<Item = Request> {
    METHODS.iter().map(Request::plain)
}

#[test]
fn the_best_method_is_about_the_best_on_every_landscape() {
    // A centimetre is what the ranging leaves of any.
    let error = |land: &Landscape, method: &Request| land.error(method, &land.points()).max(0.01);
    let (mut sum, mut worst) = (0.0, 0.0_f64);
    for land in LANDSCAPES {
        let all: Vec<f64> = methods().map(|method| error(land, &method)).collect();
        let best = all.iter().copied().fold(f64::INFINITY, f64::min);
        let ratio = error(land, &Request::DEFAULT) / best;
        println!("{}: {ratio:.2} times {best:.3} m, {all:.3?}", land.name);
        sum += ratio.ln();
        worst = worst.max(ratio);
    }
    let mean = (sum / LANDSCAPES.len() as f64).exp();
    println!("{mean:.3} in the geometric mean, {worst:.2} at worst");
    assert!(mean <= 1.05 && worst <= 1.2, "{mean:.3} {worst:.2}");
}

#[test]
fn low_outliers_cost_next_to_nothing_whatever_the_method() {
    for land in LANDSCAPES {
        let clean = land.points();
        let dirty = [clean.clone(), land.outliers(&clean)].concat();
        for method in methods() {
            let [without, with] = [&clean, &dirty].map(|points| land.error(&method, points));
            println!("{} {}: {without:.3} m, {with:.3} m", land.name, method.name());
            // A clump under a roof is told from the ground beside it by nothing, and seeds of `ptd` are the lowest.
            let most = if method.name() == "ptd" { 0.3 } else { 0.12 };
            assert!(with <= 1.2 * without + most, "{} {}: {with:.3}", land.name, method.name());
        }
    }
}
