//! Lines simplified square by square, before the independent checker: worlds of which the squares see
//! a few vertices each.

#![allow(dead_code)]

mod line_support;
#[path = "../src/line/topology/tests/twin.rs"]
mod twin;
#[path = "../src/line/topology/tests/worlds.rs"]
mod worlds;

use std::path::{Path, PathBuf};

use terrane::line::Xy;
use terrane::line::topology::{Chains, Collapse, Kept, Strategy};
use terrane::pipeline::line::{Goal, Length, LineJob, LineReport, Topology, run};
use terrane::pipeline::verify::{LineVerifyJob, LineVerifyReport, verify_lines};
use terrane::pipeline::{Cancel, Resources, Silent};
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

    fn job(&self, tolerance: f64, square: u64) -> LineJob {
        let goal = Goal::Tolerance(Length { value: tolerance, unit: None });
        let topology = Topology { square, sides: self.sides(), ..Topology::default() };
        LineJob {
            topology: Some(topology),
            overwrite: true,
            resources: resources(1 << 30, 1),
            ..LineJob::new(self.path("a.wkt"), self.path("b.wkt"), goal)
        }
    }

    fn proof(&self, tolerance: f64) -> LineVerifyReport {
        let job = LineVerifyJob {
            lines: self.path("b.wkt"),
            original: self.path("a.wkt"),
            layer: None,
            tolerance: Some(Length { value: tolerance * (1.0 + 1e-12), unit: None }),
            is_space: false,
            topology: true,
            sides: self.sides(),
            resources: resources(1 << 30, 1),
        };
        verify_lines(&job, &Silent, &Cancel::default()).unwrap()
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

fn resources(memory: u64, threads: usize) -> Resources {
    Resources { threads, memory, temp_dir: None }
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
            (Strategy::Retroactive, Collapse::Minimal),
            (Strategy::Retroactive, Collapse::Drop),
            (Strategy::Proactive, Collapse::Keep),
        ] {
            let mut job = place.job(tolerance, square);
            job.collapse = collapse;
            job.topology.as_mut().unwrap().strategy = strategy;
            let report = simplify(&job);
            let proof = place.proof(tolerance);
            let name = format!("{name} {seed}, {square}, {tolerance}, {strategy:?} {collapse:?}");
            assert_eq!(proof.crossings[2], 0, "{name}: {proof:?}");
            // A loop of a line that touches itself may be dropped.
            if is_clean || collapse != Collapse::Drop {
                assert_eq!(proof.beyond, 0, "{name}: {proof:?}");
                assert_eq!(proof.crossings[1], report.input_crossings, "{name}: {proof:?}");
            }
            if is_clean {
                assert!(proof.passed, "{name}: {:?}", proof.failures);
            }
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
    let rings = line_support::world(seed);
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
        assert!(proof.passed && proof.torn == 0, "{seed}: {:?}", proof.failures);
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
            for (memory, threads) in [(900_000, 1), (900_000, 3), (1 << 30, 3)] {
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

/// A ring of two loops of nearly the same area, one of which may go.
#[test]
fn rings_that_cross_themselves_do_not_turn_over() {
    let mut turned = 0;
    for width in 1..60 {
        // The left loop is a comb with teeth, the right one a plain square.
        let mut ring: Vec<Xy> = vec![[0.0, 0.0]];
        for tooth in 0..8 {
            let y = f64::from(tooth) * 2.0;
            ring.extend([[-20.0, y], [-20.0, y + 1.0], [-1.0, y + 1.0], [-1.0, y + 2.0]]);
        }
        let size = f64::from(width);
        ring.extend([[0.0, 17.0], [20.0, 0.5], [20.0 + size, 0.5], [20.0 + size, 16.0]]);
        ring.extend([[20.0, 16.0], [0.0, 0.0]]);
        let place = Place(tempfile::tempdir().unwrap());
        let far = vec![[500.0, 500.0], [510.0, 505.0], [520.0, 500.0]];
        place.write("a.wkt", [part(&ring), part(&far)].into_iter());
        for square in [6, 20, 60] {
            for memory in [1 << 30, 20_000] {
                let mut job = place.job(1.5, square);
                job.resources = resources(memory, 1);
                simplify(&job);
                let proof = place.proof(1.5);
                assert_eq!(proof.turned + proof.collapsed, 0, "{width} {square} {proof:?}");
                turned += u64::from(proof.vertices[0] > proof.vertices[1]);
            }
        }
    }
    assert!(turned > 0);
}

#[test]
fn what_cannot_be_done_by_squares_is_told() {
    let place = polygons(1);
    let fails = |job: &LineJob| run(job, &Silent, &Cancel::default()).unwrap_err().to_string();
    let mut job = place.job(0.02, 100);
    job.topology.as_mut().unwrap().snap = 0.001;
    assert!(fails(&job).contains("--snap for more than 100 vertices"));
    let mut job = place.job(0.02, 1 << 20);
    job.resources = resources(200_000, 1);
    let told = fails(&job);
    assert!(
        told.contains("neighbours are looked at in memory") && told.contains("a.wkt"),
        "{told}"
    );
    let mut job = place.job(0.02, 100);
    job.goal = Goal::Ratio(0.3);
    simplify(&job);
    assert!(place.proof(1.0).passed);
    job.resources = resources(200_000, 1);
    assert!(fails(&job).contains("looked for in memory"));
    place.write("a.wkt", std::iter::once(part(&[[7, 7]; 101])));
    let told = fails(&place.job(1.0, 100));
    assert!(told.contains("in one place"), "{told}");
}
