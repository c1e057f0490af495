//! Random worlds on small lattices, simplified with their topology and judged as they are written: by
//! all pairs, in whole numbers, by code that shares nothing with what it judges.
//!
//! `TERRANE_WORLDS=10000 cargo test --test line worlds::` judges more of them.

mod lattice;
mod rounding;
mod whole;

use std::collections::{BTreeMap, BTreeSet};

use lattice::{Cell, Segment, Shape, Way, closed, crowd, moved, world};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_line::METHODS;
use terrane_line::topology::{RingCollapse, Strategy};
use terrane_simplify::{Length, LineGoal, LineJob, LineReport, Topology, run};
use whole::{area, is_on, is_simple, is_within, meet, segments, turns, without_repeats};

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
        tile_vertices: way.tile_vertices,
        ..Topology::default()
    };
    let job = LineJob {
        method: &METHODS[way.method],
        topology: Some(topology),
        collapse: way.collapse,
        decimals: way.decimals,
        overwrite: true,
        resources: Resources { threads: 1, memory: 1 << 30, temp_dir: None },
        ..LineJob::new(&input, &output, LineGoal::Tolerance(length))
    };
    let report = run(&job, &Silent, &Cancel::default()).unwrap();
    let text = std::fs::read_to_string(&output).unwrap();
    (report, text.lines().map(parse).collect())
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

impl Left {
    /// Segments that are as they were, once moved.
    fn originals(&self) -> impl Iterator<Item = Segment> + '_ {
        let plain = self.pieces.iter().filter(|piece| piece.stretch.len() == 2);
        plain.map(|piece| in_order(piece.ends))
    }
}

fn in_order([a, b]: Segment) -> Segment {
    [a.min(b), a.max(b)]
}

/// Whether moving vertices has turned a ring over, made two of these segments meet, or rings of a polygon
/// touch.
fn is_spoilt(all: &[Shape], moved: &[Shape], now: &BTreeSet<Segment>) -> bool {
    let mut old: BTreeMap<Segment, Vec<Segment>> = BTreeMap::new();
    for (before, after) in all.iter().zip(moved) {
        let is_polygon = before.is_polygon;
        for (before, after) in before.parts.iter().zip(&after.parts) {
            let may_turn = area(before) != 0;
            if is_polygon && may_turn && area(before).signum() != area(after).signum() {
                return true;
            }
            for (s, t) in before.windows(2).zip(after.windows(2)) {
                old.entry(in_order([t[0], t[1]])).or_default().push([s[0], s[1]]);
            }
        }
        if is_polygon && touches_anew(before, after) {
            return true;
        }
    }
    let were_apart =
        |s: &Segment, t: &Segment| old[s].iter().any(|s| old[t].iter().any(|t| !meet(*s, *t)));
    let pairs = now.iter().flat_map(|s| now.range(..*s).map(move |t| (s, t)));
    pairs.filter(|(s, t)| meet(**s, **t)).any(|(s, t)| were_apart(s, t))
}

/// Whether rings of a polygon come by a place together, or again, that did not by any one place before.
fn touches_anew(before: &Shape, after: &Shape) -> bool {
    let mut visits: BTreeMap<Cell, Vec<BTreeSet<Cell>>> = BTreeMap::new();
    for (old, new) in before.parts.iter().zip(&after.parts) {
        let mut own: Vec<(Cell, BTreeSet<Cell>)> = Vec::new();
        for (p, q) in old.iter().zip(new) {
            match own.last_mut() {
                Some((at, from)) if at == q => drop(from.insert(*p)),
                _ => own.push((*q, BTreeSet::from([*p]))),
            }
        }
        // It ends where it begins.
        if own.len() > 1 {
            let (_, last) = own.pop().unwrap();
            own[0].1.extend(last);
        }
        own.into_iter().for_each(|(at, from)| visits.entry(at).or_default().push(from));
    }
    visits.values().any(|visits| {
        let is_common = |p: &Cell| visits.iter().all(|from| from.contains(p));
        !visits[0].iter().any(is_common)
    })
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
        let before = rounding::before(&moved, written);
        self.faults.extend(rounding::faults(&before, written, way));
        let written = &before[..];
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
        let is_told = report.notes.iter().any(|note| note.contains("new with"));
        self.pairs(&left);
        self.sides(&left);
        if !is_told {
            self.unmoved(all, &moved, &left);
        }
        let written: BTreeSet<Segment> = left.iter().flat_map(Left::originals).collect();
        let is_due = is_spoilt(all, &moved, &written);
        self.demand(is_told || !is_due, || "what moving spoils is not told".into());
        // Rings that are dropped may have spoilt something before.
        let input = moved.iter().flat_map(|shape| &shape.parts).flat_map(|part| segments(part));
        let all_of_it = input.map(in_order).collect();
        let may = if way.collapse == RingCollapse::Drop { &all_of_it } else { &written };
        let is_due = is_spoilt(all, &moved, may);
        self.demand(is_due || !is_told, || "told is what moving does not spoil".into());
    }

    /// A ring of which nothing is written.
    fn gone(&mut self, old: &[Cell], way: &Way) {
        self.demand(way.collapse == RingCollapse::Drop, || "a ring is gone".into());
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
                let is_near = old.windows(2).any(|w| is_within(p, [w[0], w[1]], way.tolerance));
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
    let policies = [RingCollapse::Minimal, RingCollapse::Drop, RingCollapse::Keep];
    let collapse = policies[(seed / 5 % 3) as usize];
    let mut faults = Vec::new();
    for strategy in [Strategy::Retroactive, Strategy::Proactive] {
        let way = Way { strategy, collapse, ..way };
        let (report, written) = simplify(folder, &all, &way);
        kept[0] += report.kept;
        kept[1] += report.vertices;
        let mut judge = Judge::default();
        judge.world(&all, &way, &report, &written);
        let moved = moved(&all, &way);
        let before = rounding::before(&moved, &written);
        judge.faults.extend(far_places(&moved, &before, &way));
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
    for (strategy, collapse) in
        [Strategy::Retroactive, Strategy::Proactive].into_iter().flat_map(|s| {
            [RingCollapse::Minimal, RingCollapse::Drop, RingCollapse::Keep].map(|c| (s, c))
        })
    {
        for tile_vertices in [crowd(&moved(all, &way(tolerance, decimals))).max(4), 1 << 20] {
            let way = Way { strategy, collapse, tile_vertices, ..way(tolerance, decimals) };
            let (report, written) = simplify(folder.path(), all, &way);
            let mut judge = Judge::default();
            judge.world(all, &way, &report, &written);
            faults.extend(judge.faults);
        }
    }
    faults
}

fn way(tolerance: i64, decimals: Option<u8>) -> Way {
    let (strategy, collapse) = (Strategy::Retroactive, RingCollapse::Minimal);
    Way { tolerance, snap: 0, decimals, tile_vertices: 1 << 20, method: 0, strategy, collapse }
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

/// More pairs than are remembered.
#[test]
fn what_is_not_looked_at_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let line = |a: Cell, b: Cell| Shape { is_polygon: false, parts: vec![vec![a, b]] };
    let lines = |k: i64| {
        let at = 1000 * k + 300;
        [line([at, -600], [at, 300_600]), line([-600, at], [300_600, at])]
    };
    let all: Vec<Shape> = (0..300).flat_map(lines).collect();
    let way = Way { snap: 200, ..way(10, None) };
    let (report, _) = simplify(folder.path(), &all, &way);
    assert_eq!(
        report.notes,
        ["90000 pairs of segments meet; the state before ‹snap› 0.2 is known for 65536 of them"]
    );
}

/// A comb whose gaps are narrower than a tenth, and a sliver that rounding would turn over.
#[test]
fn what_rounding_would_spoil_keeps_its_digits() {
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
    for (decimals, keeps) in [(2, false), (1, true)] {
        let way = way(10, Some(decimals));
        let (report, written) = simplify(folder.path(), &all, &way);
        let mut judge = Judge::default();
        judge.world(&all, &way, &report, &written);
        assert_eq!(judge.faults, Vec::<String>::new());
        assert_eq!((report.unrounded > 0, report.input_crossings), (keeps, 0), "{written:?}");
        let is_told = report.notes.iter().any(|note| note.contains("are not rounded to"));
        assert_eq!(is_told, keeps, "{:?}", report.notes);
    }
}
