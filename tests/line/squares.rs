//! Lines simplified square by square, before the independent checker: worlds of which the squares see
//! a few vertices each.

#![allow(dead_code)]

#[path = "../../crates/simplify/line/src/topology/tests/twin.rs"]
mod twin;
#[path = "../../crates/simplify/line/src/topology/tests/worlds.rs"]
mod worlds;

use std::path::{Path, PathBuf};

use crate::coverage;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_line::Xy;
use terrane_line::topology::{Chains, RetainedChainVertices, RingCollapse, Strategy};
use terrane_simplify::{Length, LineGoal, LineJob, LineReport, Topology, run};
use terrane_verify::{LineVerifyJob, LineVerifyReport, verify_lines};
use worlds::{Dice, World};

/// A folder with the files of a world.
struct Place(tempfile::TempDir);

impl Place {
    fn new(world: &World) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let rings = world.rings.iter().filter(|ring| ring.len() > 1);
        place.write("a.wkt", rings.map(|ring| part(ring)));
        if !world.fixed_cells.is_empty() {
            let point = |p: &worlds::Cell| format!("POINT ({} {})\n", p[0], p[1]);
            place.write("p.wkt", world.fixed_cells.iter().map(point));
        }
        place
    }

    fn write(&self, name: &str, features: impl Iterator<Item = String>) {
        std::fs::write(self.path(name), features.collect::<String>()).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn sides(&self) -> Option<PathBuf> {
        Some(self.path("p.wkt")).filter(|path| path.exists())
    }

    fn job(&self, tolerance: f64, tile_vertices: u64) -> LineJob {
        let goal = LineGoal::Tolerance(Length { value: tolerance, unit: None });
        let topology = Topology { tile_vertices, sides: self.sides(), ..Topology::default() };
        LineJob {
            topology: Some(topology),
            overwrite: true,
            resources: resources(1 << 30, 1),
            ..LineJob::new(self.path("a.wkt"), self.path("b.wkt"), goal)
        }
    }

    fn proof(&self, tolerance: f64) -> LineVerifyReport {
        verify_lines(&self.proof_job(tolerance), &Silent, &Cancel::default()).unwrap()
    }

    fn proof_job(&self, tolerance: f64) -> LineVerifyJob {
        LineVerifyJob {
            lines: self.path("b.wkt"),
            original: self.path("a.wkt"),
            layer: None,
            tolerance: Some(Length { value: tolerance * (1.0 + 1e-12), unit: None }),
            is_space: false,
            topology: true,
            may_drop: false,
            sides: self.sides(),
            resources: resources(1 << 30, 1),
        }
    }
}

/// A line, or a ring as a polygon.
fn part<T: std::fmt::Display + PartialEq>(vertices: &[[T; 2]]) -> String {
    let all: Vec<_> = vertices.iter().map(|[x, y]| format!("{x} {y}")).collect();
    match vertices.first() == vertices.last() && vertices.len() > 3 {
        true => format!("POLYGON (({}))\n", all.join(", ")),
        false => format!("LINESTRING ({})\n", all.join(", ")),
    }
}

/// So much memory beside what the program takes by itself.
fn resources(memory: u64, threads: usize) -> Resources {
    Resources { threads, memory: memory + (24 << 20), temp_dir: None }
}

fn simplify(job: &LineJob) -> LineReport {
    run(job, &Silent, &Cancel::default()).unwrap()
}

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

/// Worlds of a kind, in squares of few vertices.
fn check_kind(count: u64, make: impl Fn(&mut Dice) -> World, name: &str) {
    let (mut kept, mut cleans) = ([0, 0], 0);
    for seed in 0..count {
        let mut dice = Dice::new(seed);
        let world = make(&mut dice);
        if world.rings.iter().all(|ring| ring.len() < 2) {
            continue;
        }
        let place = Place::new(&world);
        let tolerance = f64::from(1 << dice.below(12));
        let crowd = |p| world.cells.iter().filter(|q| **q == p).count() as u64;
        let crowd = world.cells.iter().map(|p| crowd(*p)).max().unwrap_or(1);
        let square = [4, 12, 40][dice.below(3) as usize].max(crowd);
        let is_clean = world.is_clean();
        cleans += u64::from(is_clean);
        for (strategy, collapse) in [
            (Strategy::Retroactive, RingCollapse::Minimal),
            (Strategy::Retroactive, RingCollapse::Drop),
            (Strategy::Proactive, RingCollapse::Keep),
        ] {
            let mut job = place.job(tolerance, square);
            job.collapse = collapse;
            job.topology.as_mut().unwrap().strategy = strategy;
            let report = simplify(&job);
            let mut proof = place.proof_job(tolerance);
            proof.may_drop = collapse == RingCollapse::Drop;
            let proof = verify_lines(&proof, &Silent, &Cancel::default()).unwrap();
            let name = format!("{name} {seed}, {square}, {tolerance}, {strategy:?} {collapse:?}");
            assert!(proof.verdict.passed, "{name}: {:?}", proof.verdict.failures);
            // Rings that lie on a line in the input are dropped after the count.
            let [met, told] = [proof.crossings[1], report.input_crossings];
            let may_drop = collapse == RingCollapse::Drop && !is_clean;
            assert!(met == told || (met < told && may_drop), "{name}: {proof:?}");
            kept[0] += report.kept;
            kept[1] += report.vertices;
        }
    }
    assert!(kept[0] * 10 < kept[1] * 9, "{name}: {kept:?}");
    assert!(cleans * 100 > count, "{name}: only {cleans} clean worlds");
}

#[test]
fn archipelagos() {
    check_kind(60, worlds::archipelago, "archipelago");
}

#[test]
fn nested_rings() {
    check_kind(60, worlds::nested, "nested");
}

#[test]
fn rings_that_wind_tightly() {
    check_kind(60, worlds::spiral, "spiral");
}

#[test]
fn coverages() {
    check_kind(60, worlds::coverage, "coverage");
}

#[test]
fn anything_on_a_small_lattice() {
    check_kind(400, worlds::lattice, "lattice");
}

/// A coverage of polygons with islands and lakes, in the folder as a.wkt.
fn polygons(seed: u64) -> Place {
    let place = Place(tempfile::tempdir().unwrap());
    let rings = coverage::world(seed);
    let parts = rings.starts.windows(2).map(|ends| part(&rings.points[ends[0]..ends[1]]));
    place.write("a.wkt", parts);
    place
}

#[test]
fn neighbours_share_borders_across_squares() {
    for seed in 0..12 {
        let place = polygons(seed);
        let tolerance = [0.002, 0.02, 0.2][seed as usize % 3];
        let square = [10, 60, 300, 1000][seed as usize % 4];
        let report = simplify(&place.job(tolerance, square));
        let proof = place.proof(tolerance);
        assert!(proof.verdict.passed && proof.torn == 0, "{seed}: {:?}", proof.verdict.failures);
        assert!(report.kept < report.vertices && report.kept == proof.vertices[1]);
        assert!((report.largest_distance - proof.largest_distance).abs() < 1e-12, "{seed}");
    }
}

#[test]
fn memory_and_threads_leave_no_trace() {
    for seed in 0..3 {
        let place = polygons(seed);
        let made = |memory, threads, square| {
            let mut job = place.job(0.02, square);
            job.resources = resources(memory, threads);
            simplify(&job);
            read(&place.path("b.wkt"))
        };
        for square in [20, 400, 1 << 20] {
            let first = made(1 << 30, 1, square);
            // Held, but spilled; neither held nor in memory; and by several threads.
            let little = if square < 1000 { 900_000 } else { 4_000_000 };
            for (memory, threads) in [(little, 1), (little, 3), (1 << 30, 3)] {
                assert!(first == made(memory, threads, square), "{seed}, {square}: {memory}");
            }
            if square < 1000 {
                for (memory, threads) in [(150_000, 1), (150_000, 3)] {
                    assert!(first == made(memory, threads, square), "{seed}, {square}: {memory}");
                }
            }
        }
    }
}

#[test]
fn a_goal_after_moves_leaves_no_trace_of_memory() {
    // Held, or not held; snapping takes more.
    let (some, more) = (150_000, 4_000_000);
    for (snap, decimals, little) in
        [(0.0, Some(3), some), (0.002, None, more), (0.002, Some(3), more)]
    {
        let place = polygons(1);
        let made = |goal, memory, threads| {
            let mut job = place.job(0.0, 60);
            (job.goal, job.decimals) = (goal, decimals);
            job.topology.as_mut().unwrap().snap = snap;
            job.resources = resources(memory, threads);
            simplify(&job);
            read(&place.path("b.wkt"))
        };
        for goal in [LineGoal::Ratio(0.4), LineGoal::Size(90_000)] {
            let held = made(goal, 1 << 30, 1);
            assert!(held == made(goal, little, 2), "{goal:?}, {snap}, {decimals:?}");
        }
    }
}

#[test]
fn heights_go_with_their_vertices() {
    let place = polygons(2);
    let rings = coverage::world(2);
    let text = |ends: &[usize]| {
        let at = |[x, y]: &Xy| format!("{x} {y} {}", (x * 9.0).sin() * 0.1);
        let all: Vec<_> = rings.points[ends[0]..ends[1]].iter().map(at).collect();
        format!("POLYGON Z (({}))\n", all.join(", "))
    };
    place.write("a.wkt", rings.starts.windows(2).map(text));
    let made = |memory| {
        let mut job = place.job(0.03, 50);
        job.is_space = true;
        job.resources = resources(memory, 2);
        let report = simplify(&job);
        (report.kept, report.largest_distance, read(&place.path("b.wkt")))
    };
    let held = made(1 << 30);
    assert!(held == made(150_000));
    let mut proof = place.proof_job(0.03);
    proof.is_space = true;
    let proof = verify_lines(&proof, &Silent, &Cancel::default()).unwrap();
    assert!(proof.verdict.passed, "{:?}", proof.verdict.failures);
    assert!((proof.largest_distance - held.1).abs() < 1e-12);
}

#[test]
fn few_vertices_are_one_square() {
    let place = polygons(5);
    let made = |square| {
        let report = simplify(&place.job(0.02, square));
        (report.arcs, report.vertices, read(&place.path("b.wkt")))
    };
    let (arcs, vertices, whole) = made(u64::MAX);
    assert_eq!((arcs, &whole), (made(vertices).0, &made(vertices).2));
    assert!(made(vertices - 1).0 > arcs);
}

#[test]
fn files_are_one_job() {
    let place = polygons(3);
    let text = String::from_utf8(read(&place.path("a.wkt"))).unwrap();
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let half = lines.len() / 2;
    for (name, lines) in [("w.wkt", &lines[..half]), ("e.wkt", &lines[half..])] {
        place.write(name, lines.iter().map(|line| (*line).to_owned()));
    }
    simplify(&place.job(0.02, 100));
    for memory in [1 << 30, 100_000] {
        let mut job = place.job(0.02, 100);
        job.input = vec![place.path("w.wkt"), place.path("e.wkt")];
        job.output = place.path("out/deep");
        job.resources = resources(memory, 2);
        simplify(&job);
        let parts = ["out/deep/w.wkt", "out/deep/e.wkt"].map(|name| read(&place.path(name)));
        assert!(parts.concat() == read(&place.path("b.wkt")), "{memory}");
    }
}

/// Two loops of nearly the same area, which are left and right of a crossing and go around in opposite
/// ways. Bumps on the left one make it the larger one, by less than its right neighbour is too wide.
fn bow(width: f64) -> Vec<Xy> {
    let mut ring = vec![[-1.0, -1.0], [1.0, 1.0], [1.0, 9.0]];
    ring.extend([[17.0 + width, 9.0], [17.0 + width, -9.0], [1.0, -9.0], [1.0, -1.0]]);
    ring.extend([[-1.0, 1.0], [-1.0, 9.0]]);
    ring.extend((0..=18).map(|k| [-17.0 - f64::from(k % 2), 9.0 - f64::from(k)]));
    ring.extend([[-1.0, -9.0], [-1.0, -1.0]]);
    ring
}

#[test]
fn rings_that_cross_themselves_do_not_turn_over() {
    for (at, width) in (1..10).map(|k| (k, 0.05 * f64::from(k))) {
        let place = Place(tempfile::tempdir().unwrap());
        let other = [[0.0, 50.0], [3.0, 51.0], [9.0, 50.0], [50.0, 50.0]];
        place.write("a.wkt", [part(&bow(width)), part(&other)].into_iter());
        place.write("e.wkt", std::iter::once(part(&other)));
        place.write("c.wkt", std::iter::once(part(&bow(width))));
        for (square, memory) in [6, 10, 20].into_iter().flat_map(|s| [(s, 1 << 30), (s, 20_000)]) {
            let mut job = place.job(1.5, square);
            job.resources = resources(memory, 1);
            simplify(&job);
            let proof = place.proof(1.5);
            assert!(proof.verdict.passed, "{at} {square} {:?}", proof.verdict.failures);
            // Of several files none appears before all are judged: nothing is replaced.
            job.input = vec![place.path("e.wkt"), place.path("c.wkt")];
            job.output = place.path(&format!("{at} {square} {memory}"));
            job.overwrite = false;
            simplify(&job);
            let mut proof = place.proof_job(1.5);
            (proof.lines, proof.original) = (job.output.join("c.wkt"), place.path("c.wkt"));
            let proof = verify_lines(&proof, &Silent, &Cancel::default()).unwrap();
            assert!(proof.verdict.passed, "{at} {square} {:?}", proof.verdict.failures);
        }
    }
}

#[test]
fn a_loop_at_a_border_is_no_ring_to_be_dropped() {
    let place = Place(tempfile::tempdir().unwrap());
    let line =
        [[0, 10], [100, 10], [101, 11], [102, 10], [101, 9], [100, 10], [0, 9], [0, 5], [0, 1]];
    place.write("a.wkt", std::iter::once(part(&line)));
    let mut job = place.job(5.0, 5);
    job.collapse = RingCollapse::Drop;
    simplify(&job);
    let left = String::from_utf8(read(&place.path("b.wkt"))).unwrap();
    assert_eq!(left, "LINESTRING (0 10,100 10,101 11,102 10,100 10,0 9,0 1)\n");
}

/// Two rows of cells on either side of a border that each has by itself, off by up to `gap`.
fn nearly_matching(gap: f64) -> Place {
    let place = Place(tempfile::tempdir().unwrap());
    let mut dice = Dice::new(7);
    let mut off = move || gap * (dice.below(2001) as f64 / 1000.0 - 1.0) / 2.0;
    let cells = (0..40).map(|row| {
        let side = |at: f64, step: f64| -> Vec<Xy> {
            let border = (0..=60).map(|k| {
                let x = 30.0 + step * (f64::from(k) - 30.0);
                [x, at + (x * 1.7).sin() * 0.2]
            });
            border.collect()
        };
        let y = f64::from(row);
        let mut ring = [side(y, 1.0), side(y + 1.0, -1.0)].concat();
        ring.iter_mut().for_each(|at| *at = at.map(|c| c + off()));
        ring.push(ring[0]);
        part(&ring)
    });
    place.write("a.wkt", cells);
    place
}

#[test]
fn near_vertices_are_made_one_in_any_number_of_squares() {
    let (gap, snap) = (1e-6, 1.5e-6);
    let place = nearly_matching(gap);
    let numbers = |name: &str| -> Vec<f64> {
        let text = String::from_utf8(read(&place.path(name))).unwrap();
        let texts = text.split(|c: char| !c.is_ascii_digit() && !".-e".contains(c));
        texts.filter_map(|text| text.parse().ok()).collect()
    };
    let before = numbers("a.wkt");
    for square in [50, 300, 1 << 20] {
        let mut job = place.job(0.0, square);
        // Each vertex is beyond the tolerance, so all are written.
        job.topology.as_mut().unwrap().snap = snap;
        let report = simplify(&job);
        let (first, after) = (read(&place.path("b.wkt")), numbers("b.wkt"));
        assert_eq!((report.input_crossings, report.kept), (0, report.vertices), "{square}");
        let far = before.iter().zip(&after).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
        assert!(far > 0.0 && far <= snap, "{square}: {far}");
        let mut places: Vec<Xy> = after.chunks(2).map(|at| [at[0], at[1]]).collect();
        places.sort_by(|p, q| p.partial_cmp(q).unwrap());
        places.dedup();
        let apart = |pair: &[Xy]| twin::distance(pair[0], [pair[1]; 2]) > snap;
        assert!(places.windows(2).all(apart), "{square}");
        assert_eq!(places.len(), 41 * 61, "{square}");
        for (memory, threads) in [(1 << 30, 3), (5 << 20, 2), (4 << 20, 1)] {
            if memory < 1 << 30 && square > 1000 {
                continue;
            }
            job.resources = resources(memory, threads);
            simplify(&job);
            assert!(first == read(&place.path("b.wkt")), "{square}, {memory}");
        }
    }
}

#[test]
fn borders_that_almost_match_name_the_distance_to_try() {
    let place = nearly_matching(1e-7);
    for square in [2000, 1 << 20] {
        let mut job = place.job(0.3, square);
        let loose = simplify(&job);
        let note = loose.notes.iter().find(|note| note.contains("borders almost match")).unwrap();
        assert!(
            note.ends_with("; try ‹snap› 1e-6") || note.ends_with("; try ‹snap› 1e-7"),
            "{note}"
        );
        let distance = note.rsplit(' ').next().unwrap().parse::<f64>().unwrap();
        job.topology.as_mut().unwrap().snap = 2.0 * distance;
        let tight = simplify(&job);
        assert!(tight.kept * 3 < loose.kept, "{} {}", loose.kept, tight.kept);
        assert!(!tight.notes.iter().any(|note| note.contains("almost match")));
    }
    let sound = polygons(3);
    assert_eq!(simplify(&sound.job(0.02, 1 << 20)).notes, Vec::<String>::new());
}

#[test]
fn what_cannot_be_done_by_squares_is_told() {
    let place = polygons(1);
    let fails = |job: &LineJob| run(job, &Silent, &Cancel::default()).unwrap_err().to_string();
    let mut job = place.job(0.02, 1 << 20);
    job.resources = resources(200_000, 1);
    let told = fails(&job);
    assert!(told.contains("topology requires") && told.contains("a.wkt"), "{told}");
    let mut job = place.job(0.02, 100);
    job.goal = LineGoal::Ratio(0.3);
    simplify(&job);
    assert!(place.proof(1.0).verdict.passed);
    let held = read(&place.path("b.wkt"));
    job.resources = resources(200_000, 1);
    simplify(&job);
    assert!(held == read(&place.path("b.wkt")), "what is not held is read anew for each trial");
    job.resources = resources(1000, 1);
    assert!(fails(&job).contains("a feature of"));
    place.write("a.wkt", std::iter::once(part(&[[7, 7]; 101])));
    let told = fails(&place.job(1.0, 100));
    assert!(told.contains("at one position"), "{told}");
}
