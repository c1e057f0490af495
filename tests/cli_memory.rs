//! `--memory` is kept: a dense mesh that would take more is spilled.

mod cli_support;

use cli_support::Place;

/// The most memory that a dense mesh took with a budget, in MiB.
fn peak_mib(place: &Place, budget: &str) -> f64 {
    let output = format!("{budget}.ply");
    let args = ["tin", "synth:rough,size=1537", &output, "--max-error", "0.1", "--tile", "256"];
    let report = place.ok(&[&args[..], &["--threads", "1", "--memory", budget, "--json"]].concat());
    let report: serde_json::Value = serde_json::from_str(&report.out).unwrap();
    report["peak_memory"].as_f64().unwrap() / f64::from(1 << 20)
}

#[test]
#[cfg(target_os = "linux")]
fn a_budget_is_kept_that_the_mesh_would_break() {
    let place = Place::new();
    let free = peak_mib(&place, "4G");
    assert!(free > 40.0, "the job needs only {free} MiB and proves nothing");
    let bound = peak_mib(&place, "40M");
    assert!(bound <= 40.0, "{bound} MiB of 40");
    let read = |name| std::fs::read(place.path(name)).unwrap();
    assert!(read("4G.ply") == read("40M.ply"), "the budget left a trace");
}
