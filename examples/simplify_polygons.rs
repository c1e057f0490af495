//! Polygons with fewer vertices whose shared borders stay shared, and a line in memory.
//!
//! `cargo run --example simplify_polygons`

use terrane::Method;
use terrane::prelude::*;

/// Two squares on either side of a wavy border.
fn neighbours() -> String {
    let wave = |i: i32| [5.0 + (f64::from(i) / 7.0).sin() / 4.0, f64::from(i) / 10.0];
    let border: Vec<[f64; 2]> = (0..=100).map(wave).collect();
    let ring = |x: f64, border: Vec<[f64; 2]>| {
        let (first, last) = (border[0], border[border.len() - 1]);
        let mut ring = border;
        ring.extend([[x, last[1]], [x, first[1]], first]);
        let text: Vec<String> = ring.iter().map(|[x, y]| format!("{x} {y}")).collect();
        format!("POLYGON(({}))\n", text.join(", "))
    };
    let back = border.iter().rev().copied().collect();
    ring(0.0, border) + &ring(10.0, back)
}

fn main() -> terrane::Result<()> {
    let folder = std::env::temp_dir().join(format!("terrane-polygons-{}", std::process::id()));
    let failed = |e| terrane::Error::write(&folder, e);
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let (input, output) = (folder.join("polygons.wkt"), folder.join("simpler.geojson"));
    std::fs::write(&input, neighbours()).map_err(failed)?;

    let polygons = terrane::open_features(&input)?;
    let report = polygons.simplify().topology(true).tolerance(0.05).write(&output)?;
    println!("{} of {} vertices kept", report.kept, report.vertices);
    let proof = polygons.verify(&output).topology(true).tolerance(0.05).run()?;
    assert!(proof.verdict.passed && proof.torn == 0, "{:?}", proof.verdict.failures);
    println!("no border torn, no vertex further than {:.4}", proof.largest_distance);

    let line: Vec<[f64; 2]> =
        (0..1000).map(|i| [f64::from(i), (f64::from(i) / 50.0).sin()]).collect();
    let kept = terrane::simplify(&line, 0.01).method(Method::ImaiIri).indices();
    println!("a line: {} of {} vertices kept", kept.len(), line.len());

    std::fs::remove_dir_all(&folder).map_err(failed)
}
