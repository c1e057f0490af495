//! Every method, cut into arcs and untangled, before the independent checker.

use crate::coverage::{Rings, world};
use terrane_line::arcs::CoverageArcs;
use terrane_line::metric::PlaneMetric;
use terrane_line::registry::ToleranceKind;
use terrane_line::topology::{
    RetainedChainVertices, RingCollapse, Strategy, UntangleOptions, refining, untangle,
};
use terrane_line::{METHODS, SimplifyMethod, SimplifyScratch, Xy};
use terrane_proof::lines::{LineCheckReport, LineQuestion, ProofDistance, ProofLines, check};

fn simplified(
    method: &SimplifyMethod,
    rings: &Rings,
    tolerance: f64,
    options: &UntangleOptions<'_>,
) -> LineCheckReport {
    let mut scratch = SimplifyScratch::default();
    let arcs = CoverageArcs::new(&rings.chains(), 0.0).unwrap();
    let chains = arcs.chains();
    let mut refine = refining(chains.points, |part, kept| {
        (method.plane)(&PlaneMetric, part, tolerance, &mut scratch, kept);
    });
    let kept = RetainedChainVertices::simplified(&chains, &mut refine);
    let fixed = [[0.5, 0.5], [1.3, 2.2], [2.0, 2.0]];
    let outcome = untangle(&chains, &kept, &fixed, options, &mut refine).unwrap();
    let parts = arcs.rebuild(&outcome.kept);
    let space = |p: &Xy| [p[0], p[1], 0.0];
    let before: Vec<[f64; 3]> = rings.points.iter().map(space).collect();
    let after: Vec<[f64; 3]> =
        parts.vertices.iter().map(|&v| space(&arcs.points[v as usize])).collect();
    let is_bounded = method.bounds == ToleranceKind::Distance;
    let question = LineQuestion {
        original: ProofLines { points: &before, starts: &rings.starts, closed: &rings.closed },
        simplified: ProofLines { points: &after, starts: &parts.starts, closed: &rings.closed },
        points: &fixed,
        distance: ProofDistance::Plane,
        tolerance: is_bounded.then_some(tolerance * (1.0 + 1e-12)),
    };
    check(&question).unwrap()
}

#[test]
fn every_method_comes_out_sound() {
    for method in METHODS {
        for seed in 0..6 {
            let rings = world(seed);
            let tolerance = [0.002, 0.02, 0.2][seed as usize % 3];
            let strategies = [Strategy::Retroactive, Strategy::Proactive];
            for (strategy, collapse) in strategies
                .into_iter()
                .flat_map(|s| [(s, RingCollapse::Minimal), (s, RingCollapse::Keep)])
            {
                let options = UntangleOptions { strategy, collapse, ..UntangleOptions::default() };
                let report = simplified(method, &rings, tolerance, &options);
                let name = format!("{} {seed} {strategy:?} {collapse:?}", method.name);
                assert!(report.is_sound(), "{name}: {report:?}");
                assert!(report.vertices[1] < report.vertices[0], "{name}");
            }
        }
    }
}
