//! Lines simplified square by square, before the independent checker: worlds of which the squares see
//! a few vertices each.

#![allow(dead_code)]

#[path = "../src/line/topology/tests/twin.rs"]
mod twin;
#[path = "../src/line/topology/tests/worlds.rs"]
mod worlds;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use terrane::line::Xy;
use terrane::line::topology::{Chains, Collapse, Kept, Strategy};
use terrane::pipeline::line::{Goal, Length, LineJob, LineReport, Topology, method, run};
use terrane::pipeline::verify::{LineVerifyJob, LineVerifyReport, verify_lines};
use terrane::pipeline::{Cancel, Resources, Silent};
use worlds::{Dice, World};

/// A folder with the files of a world.
struct Place(tempfile::TempDir);

impl Place {
    fn new(world: &World) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let text = |ring: &Vec<worlds::Cell>| {
            let at = |p: &worlds::Cell| format!("{} {}", p[0], p[1]);
            let vertices = ring.iter().map(at).collect::<Vec<_>>().join(", ");
            match ring.first() == ring.last() && ring.len() > 3 {
                true => format!("POLYGON (({vertices}))\n"),
                false => format!("LINESTRING ({vertices})\n"),
            }
        };
        let rings = world.rings.iter().filter(|ring| ring.len() > 1);
        std::fs::write(place.path("a.wkt"), rings.map(text).collect::<String>()).unwrap();
        let mut points = String::new();
        for p in &world.fixed_cells {
            writeln!(points, "POINT ({} {})", p[0], p[1]).unwrap();
        }
        if !points.is_empty() {
            std::fs::write(place.path("p.wkt"), points).unwrap();
        }
        place
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
        let place = Place::new(&world);
        let tolerance = f64::from(1 << dice.below(12));
        let square = [4, 12, 40][dice.below(3) as usize];
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
            assert_eq!(proof.foreign + proof.beyond, 0, "{name}: {proof:?}");
            assert_eq!(proof.crossings[2], 0, "{name}: {proof:?}");
            assert_eq!(proof.crossings[1], report.input_crossings, "{name}: {proof:?}");
            assert_eq!(proof.turned, 0, "{name}: {proof:?}");
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
