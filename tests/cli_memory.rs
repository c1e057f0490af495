//! `--memory` is kept: a dense mesh that would take more is spilled.

mod cli_support;

use cli_support::Place;

/// The most memory that a mesh of three quarters of all samples took with a budget, in MiB.
fn peak_mib(place: &Place, threads: &str, budget: &str) -> f64 {
    let output = format!("{threads}-{budget}.ply");
    let args = [
        "tin",
        "synth:rough,width=2049,height=769",
        &output,
        "--max-error",
        "0.02",
        "--tile",
        "128",
    ];
    let report =
        place.ok(&[&args[..], &["--threads", threads, "--memory", budget, "--json"]].concat());
    let report: serde_json::Value = serde_json::from_str(&report.out).unwrap();
    report["peak_memory"].as_f64().unwrap() / f64::from(1 << 20)
}

#[test]
#[cfg(target_os = "linux")]
fn a_budget_is_kept_that_the_mesh_would_break() {
    let place = Place::new();
    for (threads, budget) in [("1", 30.0), ("2", 36.0)] {
        let free = peak_mib(&place, threads, "4G");
        assert!(free > 1.2 * budget, "the job needs only {free} MiB and proves nothing");
        let bound = peak_mib(&place, threads, &format!("{budget}M"));
        assert!(bound <= budget, "{bound} MiB of {budget} with {threads} threads");
    }
    let read = |name| std::fs::read(place.path(name)).unwrap();
    assert!(read("1-4G.ply") == read("2-36M.ply"), "the budget left a trace");
}

#[test]
#[cfg(target_os = "linux")]
fn a_large_block_takes_little_beyond_the_budget() {
    let place = Place::new();
    let terrain = "synth:rough,width=2049,height=769";
    let args = ["tin", terrain, "out", "--max-error", "0.02", "--tile", "128", "--split", "100"];
    let report = place.ok(&[&args[..], &["--memory", "40M", "--json"]].concat());
    let report: serde_json::Value = serde_json::from_str(&report.out).unwrap();
    let [peak, vertices] = ["peak_memory", "vertices"].map(|key| report[key].as_f64().unwrap());
    let own = (peak - vertices * 8.0) / f64::from(1 << 20);
    assert!(own < 54.0, "{own} MiB without the ids of {vertices} vertices");
}

#[test]
#[cfg(target_os = "linux")]
fn a_folder_of_meshes_is_verified_without_holding_its_triangles() {
    let place = Place::new();
    let terrain = "synth:rough,width=2049,height=769";
    let args = ["tin", terrain, "out", "--max-error", "0.02", "--tile", "128", "--split", "100"];
    place.ok(&[&args[..], &["-q"]].concat());
    let report = place.ok(&["verify", "out", terrain, "--memory", "32M", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&report.out).unwrap();
    let peak = report["peak_memory"].as_f64().unwrap() / f64::from(1 << 20);
    // The vertices of a block (24 bytes each) come on top of the budget.
    let vertices = report["vertices"].as_f64().unwrap() / 3.0 / 2.0 * 24.0 / f64::from(1 << 20);
    assert!(peak < 32.0 + vertices + 16.0, "{peak} MiB with {vertices} MiB of vertices");
}
