//! Lines from bytes, through every method: what each promises, and what slow loops give.

use terrane_line::metric::{DistanceMetric, largest_distance2};
use terrane_line::topology::{
    Chains, RetainedChainVertices, RingCollapse, Strategy, UntangleOptions, refining, untangle,
};
use terrane_line::{Hierarchy, METHODS, PlaneMetric, SimplifyMethod, SimplifyScratch, Xy};
use terrane_proof::lines::{LineQuestion, ProofDistance, ProofLines, check};

/// Most vertices.
const MOST: usize = 4000;
/// Most vertices of a line that may cross itself as often as it has pairs of segments.
const CROSSING: usize = 400;
/// Lines of which all segments are tried.
const SHORT: usize = 24;

/// Simplifies the line in `data` every way there is.
///
/// The first bytes are a tolerance, how often the vertices that follow (a byte for each coordinate) are
/// repeated, by what they move on each time, and whether coordinates are whole.
pub fn simplify(data: &[u8]) {
    let [tolerance, repeats, dx, dy, unit, vertices @ ..] = data else { return };
    let (tolerance, unit) = (f64::from(*tolerance) * 0.25, if unit & 1 == 0 { 1.0 } else { 0.1 });
    let count = vertices.len() / 2;
    let times = (usize::from(*repeats) * 16 + 1).min(MOST / count.max(1));
    let at = |byte: u8, step: u8, time: usize| {
        (f64::from(byte) + f64::from(step.cast_signed()) * time as f64) * unit
    };
    let line: Vec<Xy> = (0..times)
        .flat_map(|time| {
            vertices.chunks_exact(2).map(move |v| [at(v[0], *dx, time), at(v[1], *dy, time)])
        })
        .collect();
    bounded(&line, tolerance * unit);
    clean(&line[..line.len().min(CROSSING)], tolerance * unit);
}

fn kept(method: &SimplifyMethod, line: &[Xy], tolerance: f64) -> Vec<u32> {
    let mut kept = Vec::new();
    (method.plane)(&PlaneMetric, line, tolerance, &mut SimplifyScratch::default(), &mut kept);
    assert!(kept.is_sorted_by(|a, b| a < b), "{}: not in order", method.name);
    let ends = [kept.first().copied(), kept.last().map(|last| last + 1)];
    let known = [(!line.is_empty()).then_some(0), Some(line.len() as u32).filter(|n| *n > 0)];
    assert_eq!(ends, known, "{}: not from end to end", method.name);
    kept
}

/// What methods that bound a distance promise.
fn bounded(line: &[Xy], tolerance: f64) {
    let square = tolerance * tolerance;
    let run = |name| kept(terrane_line::registry::method(name).expect("known"), line, tolerance);
    for method in METHODS {
        let kept = kept(method, line, tolerance);
        let worst = largest_distance2(&PlaneMetric, line, &kept).map_or(0.0, |(_, worst)| worst);
        let is_free = method.name.contains("visvalingam");
        assert!(is_free || worst <= square, "{}: {worst} above {square}", method.name);
    }
    let (rdp, fewest) = (run("rdp"), run("imai-iri"));
    assert_eq!(rdp, plain(line, square));
    let mut filtered = Vec::new();
    let hierarchy = Hierarchy::new(&PlaneMetric, line);
    hierarchy.filter(tolerance, &mut filtered);
    assert_eq!(filtered, rdp);
    assert_eq!(Hierarchy::from_bytes(&hierarchy.to_bytes()).expect("its own bytes"), hierarchy);
    assert!(fewest.len() <= rdp.len().min(run("cone").len()));
    if line.len() <= SHORT {
        assert_eq!(fewest.len(), by_trial(line, square));
    }
}

/// Ramer-Douglas-Peucker, one distance at a time.
fn plain(line: &[Xy], square: f64) -> Vec<u32> {
    let last = line.len().saturating_sub(1);
    let mut keeps = vec![false; line.len()];
    let mut parts = vec![(0, last)];
    while let Some((start, end)) = parts.pop() {
        keeps.iter_mut().skip(start).take(1).for_each(|keep| *keep = true);
        keeps.iter_mut().skip(end).take(1).for_each(|keep| *keep = true);
        let mut worst = (start, -1.0);
        let Some([from, to]) = line.get(start).zip(line.get(end)).map(|ends| [ends.0, ends.1])
        else {
            continue;
        };
        let segment = PlaneMetric.segment(from, to);
        for i in start + 1..end {
            let own = PlaneMetric::reach(&segment, &line[i]);
            worst = if own > worst.1 { (i, own) } else { worst };
        }
        if PlaneMetric::squared(&segment, worst.1) > square {
            parts.extend([(start, worst.0), (worst.0, end)]);
        }
    }
    (0..line.len() as u32).filter(|i| keeps[*i as usize]).collect()
}

/// The fewest vertices, by trying all segments.
fn by_trial(line: &[Xy], square: f64) -> usize {
    let holds = |from: usize, to: usize| {
        (from + 1..to).all(|i| PlaneMetric.distance2(&line[i], &line[from], &line[to]) <= square)
    };
    let mut counts: Vec<usize> = Vec::new();
    for to in 0..line.len() {
        let before = (0..to).filter(|from| holds(*from, to)).map(|from| counts[from] + 1);
        counts.push(before.min().unwrap_or(1));
    }
    counts.last().copied().unwrap_or(0)
}

/// The line as a chain and as a ring, without new crossings: the tolerance still holds for the chain, and
/// both strategies end.
fn clean(line: &[Xy], tolerance: f64) {
    let mut points = line.to_vec();
    points.extend(line.first());
    let starts = [0, points.len()];
    for is_closed in [false, true] {
        let chains = Chains { points: &points, starts: &starts, closed: &[is_closed] };
        for strategy in [Strategy::Retroactive, Strategy::Proactive] {
            for method in METHODS.iter().take(3) {
                let mut scratch = SimplifyScratch::default();
                let mut refine = refining(&points, |part, kept| {
                    (method.plane)(&PlaneMetric, part, tolerance, &mut scratch, kept);
                });
                let kept = RetainedChainVertices::simplified(&chains, &mut refine);
                let options = UntangleOptions {
                    strategy,
                    collapse: RingCollapse::Keep,
                    ..UntangleOptions::default()
                };
                let clean = untangle(&chains, &kept, &[], &options, &mut refine);
                let own = clean.expect("a sound chain").kept.vertices;
                let worst = largest_distance2(&PlaneMetric, &points, &own).map_or(0.0, |(_, d)| d);
                assert!(worst <= tolerance * tolerance, "{}: {worst}", method.name);
                assert_eq!(new_crossings(&chains, &own), 0, "{}", method.name);
            }
        }
    }
}

/// Crossings that the input did not have, by the checker's own code.
fn new_crossings(chains: &Chains<'_>, kept: &[u32]) -> u64 {
    let space = |p: &Xy| [p[0], p[1], 0.0];
    let all: Vec<_> = chains.points.iter().map(space).collect();
    let points: Vec<_> = kept.iter().map(|i| all[*i as usize]).collect();
    let starts = [0, points.len()];
    let original = ProofLines { points: &all, starts: chains.starts, closed: chains.closed };
    let simplified = ProofLines { points: &points, starts: &starts, closed: chains.closed };
    let question = LineQuestion {
        original,
        simplified,
        points: &[],
        distance: ProofDistance::Plane,
        tolerance: None,
    };
    check(&question).expect("sound lines").new_crossings.count
}
