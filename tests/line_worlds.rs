//! Random worlds on small lattices, simplified with their topology and judged as they are written: by
//! all pairs, in whole numbers, by code that shares nothing with what it judges.
//!
//! `TERRANE_WORLDS=10000 cargo test --test line_worlds` judges more of them.

use std::collections::BTreeSet;

use terrane::line::METHODS;
use terrane::line::topology::{Collapse, Strategy};
use terrane::pipeline::line::{Goal, Length, LineJob, LineReport, Topology, run};
use terrane::pipeline::{Cancel, Resources, Silent};

/// A position in thousandths.
type Cell = [i64; 2];
type Segment = [Cell; 2];

/// A generator with a fixed seed (SplitMix64).
struct Dice(u64);

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
struct Shape {
    is_polygon: bool,
    parts: Vec<Vec<Cell>>,
}

fn closed(mut ring: Vec<Cell>) -> Vec<Cell> {
    ring.push(ring[0]);
    ring
}

/// Any ring: it may cross, touch and repeat itself.
fn tangle(dice: &mut Dice, size: i64) -> Vec<Cell> {
    let count = 2 + dice.below(13);
    closed((0..count).map(|_| [dice.below(size), dice.below(size)]).collect())
}

/// A ring around a centre, from one of its vertices on, this way round or that.
fn star(dice: &mut Dice, centre: Cell, radius: i64) -> Vec<Cell> {
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
fn walk(dice: &mut Dice, size: i64) -> Vec<Cell> {
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
fn coverage(dice: &mut Dice) -> Vec<Shape> {
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
fn shapes(dice: &mut Dice, kind: i64) -> Vec<Shape> {
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
struct Way {
    /// In thousandths, as all that follows.
    tolerance: i64,
    snap: i64,
    decimals: Option<u8>,
    square: u64,
    method: usize,
    strategy: Strategy,
    collapse: Collapse,
}

/// A world in thousandths, and a way to simplify it but for strategy and collapse.
fn world(seed: u64) -> (Vec<Shape>, Way) {
    let mut dice = Dice(seed.wrapping_mul(0xD134_2543_DE82_EF95));
    let mut all = shapes(&mut dice, (seed % 5) as i64);
    let tolerance = dice.of(&[10, 500, 800, 1000, 1500, 2000, 4000]);
    let (snap, decimals) = match dice.below(6) {
        0 => (30, None),
        1 => (30, Some(dice.below(3) as u8)),
        2 | 3 => (0, Some(dice.below(2) as u8)),
        _ => (0, None),
    };
    let scale = if snap == 0 && decimals.is_some() { 373 } else { 1000 };
    for at in all.iter_mut().flat_map(|shape| &mut shape.parts).flatten() {
        *at = at.map(|c| c * scale);
        if snap > 0 {
            *at = at.map(|c| c + 7 * dice.below(3));
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
    let (strategy, collapse) = (Strategy::Retroactive, Collapse::Minimal);
    let mut way = Way { tolerance, snap, decimals, square: 0, method, strategy, collapse };
    let moved = moved(&all, &way);
    way.square = most.max(crowd(&moved));
    (all, way)
}

/// Most vertices at one position.
fn crowd(all: &[Shape]) -> u64 {
    let mut cells: Vec<Cell> = all.iter().flat_map(|s| &s.parts).flatten().copied().collect();
    cells.sort_unstable();
    cells.chunk_by(|p, q| p == q).map(<[Cell]>::len).max().unwrap_or(0) as u64
}

/// Where vertices have to be written: snapped, then rounded, by the words of the manual.
fn moved(all: &[Shape], way: &Way) -> Vec<Shape> {
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
        let p = if way.snap > 0 { *stayed.iter().find(|q| near(p, **q)).unwrap() } else { p };
        match way.decimals {
            Some(decimals) => {
                let unit = 10_i64.pow(3 - u32::from(decimals));
                p.map(|c| (2 * c + unit).div_euclid(2 * unit) * unit)
            }
            None => p,
        }
    };
    let mut moved = all.to_vec();
    moved.iter_mut().flat_map(|s| &mut s.parts).flatten().for_each(|at| *at = place(*at));
    moved
}

/// A number of thousandths.
fn text(c: i64) -> String {
    format!("{}{}.{:03}", if c < 0 { "-" } else { "" }, c.abs() / 1000, c.abs() % 1000)
}

/// Features as WKT; the height of a vertex says which one it is: 1000 times its ring, and its index.
fn wkt(all: &[Shape]) -> String {
    let shape = |shape: &Shape| {
        let part = |(number, part): (usize, &Vec<Cell>)| {
            let vertex = |(at, p): (usize, &Cell)| {
                let at = if shape.is_polygon { at % (part.len() - 1) } else { at };
                format!("{} {} {}", text(p[0]), text(p[1]), 1000 * number + at)
            };
            let vertices: Vec<_> = part.iter().enumerate().map(vertex).collect();
            format!("({})", vertices.join(", "))
        };
        let parts: Vec<_> = shape.parts.iter().enumerate().map(part).collect();
        match shape.is_polygon {
            true => format!("POLYGON Z ({})\n", parts.join(", ")),
            false => format!("LINESTRING Z {}\n", parts[0]),
        }
    };
    all.iter().map(shape).collect()
}

/// What is written of a part: positions, and the height of each.
type Written = Vec<(Cell, i64)>;

/// The parts of a line of WKT.
fn parse(line: &str) -> Vec<Written> {
    let number = |text: &str| {
        let value: f64 = text.parse().unwrap();
        let whole = (value * 1000.0).round();
        assert!((value - whole / 1000.0).abs() < 1e-12, "{text} has more digits");
        whole as i64
    };
    let vertex = |text: &str| {
        let all: Vec<i64> = text.split_whitespace().map(number).collect();
        ([all[0], all[1]], all[2] / 1000)
    };
    let Some(open) = line.find('(') else { return Vec::new() };
    let parts = line[open..].trim_matches(['(', ')']).split(')');
    parts
        .map(|part| part.trim_start_matches([',', ' ', '(']).split(',').map(vertex).collect())
        .collect()
}

/// Simplifies a world, and returns what is written.
fn simplify(folder: &std::path::Path, all: &[Shape], way: &Way) -> (LineReport, Vec<Vec<Written>>) {
    let (input, output) = (folder.join("a.wkt"), folder.join("b.wkt"));
    std::fs::write(&input, wkt(all)).unwrap();
    let length = Length { value: way.tolerance as f64 / 1000.0, unit: None };
    let topology = Topology {
        strategy: way.strategy,
        snap: way.snap as f64 / 1000.0,
        square: way.square,
        ..Topology::default()
    };
    let job = LineJob {
        method: &METHODS[way.method],
        topology: Some(topology),
        collapse: way.collapse,
        decimals: way.decimals,
        overwrite: true,
        resources: Resources { threads: 1, memory: 1 << 30, temp_dir: None },
        ..LineJob::new(&input, &output, Goal::Tolerance(length))
    };
    let report = run(&job, &Silent, &Cancel::default()).unwrap();
    let text = std::fs::read_to_string(&output).unwrap();
    (report, text.lines().map(parse).collect())
}

fn sub(p: Cell, q: Cell) -> Cell {
    [p[0] - q[0], p[1] - q[1]]
}

fn cross(p: Cell, q: Cell) -> i128 {
    i128::from(p[0]) * i128::from(q[1]) - i128::from(p[1]) * i128::from(q[0])
}

fn dot(p: Cell, q: Cell) -> i128 {
    i128::from(p[0]) * i128::from(q[0]) + i128::from(p[1]) * i128::from(q[1])
}

fn square(p: Cell) -> i128 {
    dot(p, p)
}

/// Whether a position is within a distance of a segment.
fn is_within(p: Cell, [a, b]: Segment, distance: i64) -> bool {
    let (along, out) = (sub(b, a), sub(p, a));
    let (t, length2, most) = (dot(out, along), square(along), i128::from(distance).pow(2));
    if t <= 0 {
        square(out) <= most
    } else if t >= length2 {
        square(sub(p, b)) <= most
    } else {
        cross(along, out).pow(2) <= most * length2
    }
}

/// Whether two segments, neither of them a point, have more in common than an end.
fn meet(s: Segment, t: Segment) -> bool {
    let (u, v, w) = (sub(s[1], s[0]), sub(t[1], t[0]), sub(t[0], s[0]));
    let shared = s.iter().filter(|p| t.contains(p)).count();
    let den = cross(u, v);
    if den != 0 {
        let whole = 0..=den.abs();
        let at = [cross(w, v), cross(w, u)].map(|c| c * den.signum());
        return shared == 0 && at.iter().all(|c| whole.contains(c));
    }
    if cross(w, u) != 0 {
        return false;
    }
    let span = |r: Segment| {
        let [a, b] = r.map(|p| dot(p, u));
        (a.min(b), a.max(b))
    };
    let ((a, b), (c, d)) = (span(s), span(t));
    let common = b.min(d) - a.max(c);
    common > 0 || (common == 0 && shared == 0)
}

fn segments(line: &[Cell]) -> impl Iterator<Item = Segment> + Clone + '_ {
    line.windows(2).map(|w| [w[0], w[1]]).filter(|[a, b]| a != b)
}

fn is_on(line: &[Cell], p: Cell) -> bool {
    line.contains(&p) || segments(line).any(|s| is_within(p, s, 0))
}

/// How often a line goes around a position that is not on it: whole turns for a ring; for another line
/// it is told by the ray to the right alone.
fn turns(line: &[Cell], p: Cell) -> i64 {
    let step = |[a, b]: Segment| {
        let side = cross(sub(b, a), sub(p, a));
        match (a[1] <= p[1], b[1] <= p[1]) {
            (true, false) if side > 0 => 1,
            (false, true) if side < 0 => -1,
            _ => 0,
        }
    };
    segments(line).map(step).sum()
}

fn area(ring: &[Cell]) -> i128 {
    segments(ring).map(|[a, b]| cross(a, b)).sum()
}

fn without_repeats(line: &[Cell]) -> Vec<Cell> {
    let mut line = line.to_vec();
    line.dedup();
    line
}

/// Whether a ring touches itself nowhere.
fn is_simple(ring: &[Cell]) -> bool {
    let line = without_repeats(ring);
    let all: Vec<Segment> = segments(&line).collect();
    let distinct: BTreeSet<&Cell> = line.iter().collect();
    let apart = all.iter().enumerate().all(|(i, s)| all[..i].iter().all(|t| !meet(*s, *t)));
    distinct.len() > 2 && distinct.len() + 1 == line.len() && apart
}

/// A segment that is written, and what it stands for, without repeated vertices.
struct Piece {
    ends: Segment,
    stretch: Vec<Cell>,
}

/// A part that is still there: as it was, moved, and as it is written.
struct Left {
    is_ring: bool,
    old: Vec<Cell>,
    new: Vec<Cell>,
    pieces: Vec<Piece>,
}

/// What is wrong with what was written.
#[derive(Default)]
struct Judge {
    faults: Vec<String>,
}

impl Judge {
    fn demand(&mut self, holds: bool, fault: impl FnOnce() -> String) {
        if !holds {
            self.faults.push(fault());
        }
    }

    fn world(&mut self, all: &[Shape], way: &Way, report: &LineReport, written: &[Vec<Written>]) {
        let moved = moved(all, way);
        self.demand(written.len() == all.len(), || "a feature is gone".into());
        let mut left = Vec::new();
        let mut gone = Vec::new();
        for (shape, written) in moved.iter().zip(written) {
            for (number, old) in shape.parts.iter().enumerate() {
                let own = written.iter().find(|part| part[0].1 as usize / 1000 == number);
                match own {
                    Some(own) => left.extend(self.part(old, own, number, shape.is_polygon, way)),
                    None if shape.is_polygon => gone.push(old),
                    None => self.faults.push("a line is gone".into()),
                }
            }
        }
        for old in gone {
            self.gone(old, way);
        }
        let is_told = report.notes.iter().any(|note| note.contains("that did not before"));
        self.pairs(&left);
        self.sides(&left);
        if !is_told {
            self.unmoved(all, &moved, &left);
        }
        let moves = way.snap > 0 || way.decimals.is_some();
        self.demand(moves || !is_told, || "a note of moves that were not".into());
    }

    /// A ring of which nothing is written.
    fn gone(&mut self, old: &[Cell], way: &Way) {
        self.demand(way.collapse == Collapse::Drop, || "a ring is gone".into());
        let is_thin = |s: Segment| old.iter().all(|p| is_within(*p, s, way.tolerance));
        let is_small = old.iter().any(|a| old.iter().any(|b| is_thin([*a, *b])));
        self.demand(is_small, || format!("a ring is gone that was larger: {old:?}"));
    }

    /// One part by itself.
    fn part(
        &mut self,
        old: &[Cell],
        written: &Written,
        number: usize,
        is_ring: bool,
        way: &Way,
    ) -> Option<Left> {
        let count = old.len() - usize::from(is_ring);
        let mut indices: Vec<usize> =
            written.iter().map(|(_, z)| (*z - 1000 * number as i64) as usize).collect();
        let new: Vec<Cell> = written.iter().map(|(p, _)| *p).collect();
        if is_ring {
            let is_closed = written.first() == written.last();
            self.demand(is_closed, || format!("open: {written:?}"));
            indices.last_mut().into_iter().for_each(|last| *last += count);
        } else {
            let is_whole = (indices[0], indices[indices.len() - 1]) == (0, old.len() - 1);
            self.demand(is_whole, || format!("a line without an end: {written:?}"));
        }
        let distinct = |ring: &[Cell]| ring.iter().collect::<BTreeSet<_>>().len();
        let is_sound = !is_ring || distinct(&new) > 2 || distinct(old) < 3;
        self.demand(is_sound, || format!("a ring without area: {written:?} of {old:?}"));
        if !indices.windows(2).all(|pair| pair[0] < pair[1]) {
            self.faults.push(format!("not in order: {written:?}"));
            return None;
        }
        let at = |index: usize| old[if index < count { index } else { index % count }];
        let mut pieces = Vec::new();
        for (pair, ends) in indices.windows(2).zip(new.windows(2)) {
            let stretch: Vec<Cell> =
                (pair[0]..=pair[1]).map(|i| if is_ring { at(i) } else { old[i] }).collect();
            let is_kept = [stretch[0], stretch[stretch.len() - 1]] == *ends;
            self.demand(is_kept, || format!("{ends:?} are not where they should be"));
            let is_near = stretch.iter().all(|p| is_within(*p, [ends[0], ends[1]], way.tolerance));
            self.demand(is_near, || format!("beyond the tolerance: {ends:?} for {stretch:?}"));
            let stretch = without_repeats(&stretch);
            pieces.push(Piece { ends: [ends[0], ends[1]], stretch });
        }
        if is_ring {
            let (then, now) = (area(old).signum(), area(&new).signum());
            self.demand(then == 0 || then == now, || format!("turned over: {new:?} of {old:?}"));
        }
        Some(Left { is_ring, old: old.to_vec(), new, pieces })
    }

    /// Segments meet where they did, and nowhere else; borders are shared where they were.
    fn pairs(&mut self, left: &[Left]) {
        let all = left.iter().flat_map(|part| &part.pieces);
        let all: Vec<&Piece> = all.filter(|piece| piece.ends[0] != piece.ends[1]).collect();
        for (i, p) in all.iter().enumerate() {
            for q in &all[..i] {
                let [a, b] = q.ends;
                let is_same = p.ends == [a, b] || p.ends == [b, a];
                let is_new = p.stretch.len() > 2 || q.stretch.len() > 2;
                let back: Vec<Cell> = q.stretch.iter().rev().copied().collect();
                let is_shared = p.stretch == q.stretch || p.stretch == back;
                self.demand(!is_same || is_shared, || format!("run together: {:?}", p.ends));
                self.demand(is_same || !is_new || !meet(p.ends, q.ends), || {
                    format!("crossing: {:?} and {:?}", p.ends, q.ends)
                });
            }
        }
    }

    /// What is written is on the side of every part where it was.
    fn sides(&mut self, left: &[Left]) {
        let all: BTreeSet<Cell> = left.iter().flat_map(|part| part.new.iter().copied()).collect();
        for part in left {
            for p in all.iter().filter(|p| !is_on(&part.old, **p)) {
                let is_off = !is_on(&part.new, *p);
                self.demand(is_off, || format!("{p:?} has come to lie on {:?}", part.new));
                // Of a line, the loop of what it was and what it is has to go around nothing.
                let [then, now] = [&part.old, &part.new].map(|line| turns(line, *p));
                self.demand(then == now || !is_off, || {
                    format!("{p:?} is on another side of {:?}, of {:?}", part.new, part.old)
                });
            }
        }
    }

    /// What must be told of, if vertices have been moved: rings of another sign, and simple ones that are
    /// not any more.
    fn unmoved(&mut self, all: &[Shape], moved: &[Shape], left: &[Left]) {
        let rings = |all: &[Shape]| -> Vec<Vec<Cell>> {
            let polygons = all.iter().filter(|shape| shape.is_polygon);
            polygons.flat_map(|shape| shape.parts.clone()).collect()
        };
        for (before, old) in rings(all).iter().zip(rings(moved)) {
            let [then, now] = [before, &old].map(|ring| area(ring).signum());
            self.demand(then == 0 || then == now, || format!("silently turned: {before:?}"));
            let written = left.iter().find(|part| part.is_ring && part.old == old);
            let is_sound = written.is_none_or(|part| is_simple(&part.new));
            self.demand(!is_simple(before) || is_sound, || {
                format!("silently no longer simple: {before:?} {:?}", written.map(|part| &part.new))
            });
        }
    }
}

/// Nothing farther from a ring than the tolerance comes to be inside or outside of it: so of two that
/// overlap, no more does than the tolerance explains.
fn far_places(moved: &[Shape], written: &[Vec<Written>], way: &Way) -> Vec<String> {
    let mut faults = Vec::new();
    for (shape, written) in moved.iter().zip(written).filter(|(shape, _)| shape.is_polygon) {
        for (number, old) in shape.parts.iter().enumerate() {
            let own = written.iter().find(|part| part[0].1 as usize / 1000 == number);
            let new: Vec<Cell> = own.into_iter().flatten().map(|(p, _)| *p).collect();
            let range = |axis: usize| {
                let all = old.iter().map(|p| p[axis]);
                let (low, high) = (all.clone().min().unwrap(), all.max().unwrap());
                (low..=high).step_by(((high - low) / 12).max(1) as usize + 1)
            };
            for p in range(0).flat_map(|x| range(1).map(move |y| [x, y])) {
                let is_near = segments(old).any(|s| is_within(p, s, way.tolerance));
                if !is_near && (is_on(&new, p) || turns(old, p) != turns(&new, p)) {
                    faults.push(format!("{p:?} is far from {old:?}, not from {new:?}"));
                }
            }
        }
    }
    faults
}

/// All that is wrong with a world, by both strategies.
fn judge(seed: u64, folder: &std::path::Path, kept: &mut [u64; 2]) -> Vec<String> {
    let (all, way) = world(seed);
    // Kinds of worlds come in fives.
    let policies = [Collapse::Minimal, Collapse::Drop, Collapse::Keep];
    let collapse = policies[(seed / 5 % 3) as usize];
    let mut faults = Vec::new();
    for strategy in [Strategy::Retroactive, Strategy::Proactive] {
        let way = Way { strategy, collapse, ..way };
        let (report, written) = simplify(folder, &all, &way);
        kept[0] += report.kept;
        kept[1] += report.vertices;
        let mut judge = Judge::default();
        judge.world(&all, &way, &report, &written);
        judge.faults.extend(far_places(&moved(&all, &way), &written, &way));
        let name = |fault: &String| format!("{seed} {way:?}: {fault}");
        faults.extend(judge.faults.iter().take(3).map(name));
    }
    faults
}

#[test]
fn what_is_written_of_any_world_is_sound() {
    let count = std::env::var("TERRANE_WORLDS").map_or(240, |count| count.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let mut kept = [0, 0];
    let failed: Vec<Vec<String>> = (0..count)
        .map(|seed| judge(seed, folder.path(), &mut kept))
        .filter(|faults| !faults.is_empty())
        .collect();
    let first: Vec<String> = failed.iter().take(12).flatten().cloned().collect();
    assert!(failed.is_empty(), "{} of {count} worlds failed: {first:#?}", failed.len());
    assert!(kept[0] * 10 < kept[1] * 9 && kept[1] > count * 40, "simplified too little: {kept:?}");
}

/// Faults of one world in every way, from whole coordinates.
fn faults_of(all: &[Shape], tolerance: i64, decimals: Option<u8>) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut faults = Vec::new();
    for (strategy, collapse) in [Strategy::Retroactive, Strategy::Proactive]
        .into_iter()
        .flat_map(|s| [Collapse::Minimal, Collapse::Drop, Collapse::Keep].map(|c| (s, c)))
    {
        for square in [crowd(&moved(all, &way(tolerance, decimals))).max(4), 1 << 20] {
            let way = Way { strategy, collapse, square, ..way(tolerance, decimals) };
            let (report, written) = simplify(folder.path(), all, &way);
            let mut judge = Judge::default();
            judge.world(all, &way, &report, &written);
            faults.extend(judge.faults);
        }
    }
    faults
}

fn way(tolerance: i64, decimals: Option<u8>) -> Way {
    let (strategy, collapse) = (Strategy::Retroactive, Collapse::Minimal);
    Way { tolerance, snap: 0, decimals, square: 1 << 20, method: 0, strategy, collapse }
}

fn shape(is_polygon: bool, part: &[Cell]) -> Shape {
    Shape { is_polygon, parts: vec![part.iter().map(|p| p.map(|c| c * 1000)).collect()] }
}

#[test]
fn loops_and_rings_that_cross_themselves_are_not_lost() {
    let cases: [(&str, bool, i64, &[Cell]); 9] = [
        ("bow tie", true, 10, &[[0, 0], [10, 10], [10, 0], [0, 10], [0, 0]]),
        ("closed line", false, 10, &[[0, 0], [10, 10], [10, 0], [0, 10], [0, 0]]),
        (
            "thin loop of a line",
            false,
            2000,
            &[[0, 0], [200, 1], [400, 0], [0, 0], [0, 200], [-100, 300], [0, 0]],
        ),
        ("out and back", false, 10, &[[0, 0], [10, 0], [10, 50], [10, 0], [20, 0]]),
        (
            "ring with a large loop",
            true,
            10,
            &[
                [3, 2],
                [6, 5],
                [1, 1],
                [1, 2],
                [1, 0],
                [5, 6],
                [4, 4],
                [3, 6],
                [5, 6],
                [0, 0],
                [1, 3],
                [1, 4],
                [3, 2],
            ],
        ),
        (
            "ring that turned over",
            true,
            1500,
            &[
                [0, 1],
                [2, 4],
                [3, 1],
                [2, 2],
                [4, 0],
                [3, 5],
                [0, 2],
                [3, 4],
                [0, 3],
                [3, 1],
                [1, 2],
                [0, 1],
            ],
        ),
        ("doubled closing vertex", true, 10, &[[0, 0], [5, 0], [5, 5], [0, 5], [0, 0], [0, 0]]),
        ("line in one place", false, 10, &[[5, 5], [5, 5], [5, 5]]),
        ("twice around", true, 10, &[[5, 5], [9, 5], [9, 9], [5, 5], [9, 5], [9, 9], [5, 5]]),
    ];
    for (name, is_polygon, tolerance, part) in cases {
        let other = shape(false, &[[0, 0], [-5, 0]]);
        let faults = faults_of(&[shape(is_polygon, part), other], tolerance, None);
        assert!(faults.is_empty(), "{name}: {faults:#?}");
    }
}

/// A comb whose gaps are narrower than a tenth, and one that rounding turns over.
#[test]
fn what_rounding_spoils_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let comb = closed(vec![
        [0, 0],
        [4000, 0],
        [4000, 4000],
        [2020, 4000],
        [2000, 1000],
        [1980, 4000],
        [0, 4000],
    ]);
    let sliver = closed(vec![[9000, 9010], [9300, 9020], [9600, 9010], [9300, 9040]]);
    let all = [comb, sliver].map(|ring| Shape { is_polygon: true, parts: vec![ring] });
    let note = |decimals| {
        let way = way(10, Some(decimals));
        let (report, written) = simplify(folder.path(), &all, &way);
        let mut judge = Judge::default();
        judge.world(&all, &way, &report, &written);
        let mut notes = report.notes.into_iter();
        (notes.find(|note| note.contains("did not before")), judge.faults)
    };
    assert_eq!(note(2).0, None);
    let (told, _) = note(1);
    assert_eq!(
        told.unwrap(),
        "with --decimals 1, 1 rings turn over or lose their area, 2 features have rings that touch \
         themselves or each other that did not before; pass more --decimals"
    );
}
