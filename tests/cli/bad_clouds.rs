//! Bad files among clouds: what is wrong with them x what is made of the others, at once and by a plan.

use crate::cli_support::Place;

/// A folder with good clouds, three that cannot be opened, and one that is damaged where its points are.
fn place() -> Place {
    let place = Place::new();
    std::fs::create_dir(place.path("c")).unwrap();
    for name in ["a", "b", "c", "inside", "truncated"] {
        let seed = name.len();
        place.ok(&[
            "synth",
            &format!("cloud,size=60,density=3,seed={seed}"),
            &format!("c/{name}.laz"),
            "-q",
        ]);
    }
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    let whole = bytes("c/truncated.laz");
    place.write("c/truncated.laz", &whole[..whole.len() / 2]);
    place.write("c/empty.laz", "").write("c/foreign.laz", "no cloud at all, but a line of text\n");
    let mut inside = bytes("c/inside.laz");
    let middle = inside.len() / 2;
    inside[middle..middle + 40].iter_mut().for_each(|byte| *byte ^= 0x5a);
    place.write("c/inside.laz", inside);
    place
}

/// The names of what cannot be opened.
const BAD: [&str; 3] = ["c/empty.laz", "c/foreign.laz", "c/truncated.laz"];

/// What is made of the others; a plan where there are two commands.
const VERBS: [&[&[&str]]; 13] = [
    &[&["points", "c", "out.laz"]],
    &[&["points", "c", "out.copc.laz", "--thin", "2:lowest"]],
    &[&["points", "c", "out", "--tile", "30", "--buffer", "4"]],
    &[&[
        "points",
        "c",
        "out",
        "--tile",
        "30",
        "--workdir",
        "w",
        "--classify",
        "ground",
        "--ground",
        "csf",
    ]],
    &[&["plan", "points", "c", "-o", "w", "--tile", "30"], &["run", "w"]],
    &[&["grid", "c", "out.tif", "--cell", "5"]],
    &[&["grid", "c", "out.tif", "--cell", "5", "--chm"]],
    &[&["plan", "grid", "c", "-o", "w", "--cell", "5", "--stat", "mean"], &["run", "w"]],
    &[&["plan", "grid", "c", "-o", "w", "--cell", "5", "--dtm", "--ground", "pmf"], &["run", "w"]],
    &[&["tin", "c", "out.ply", "--max-error", "1"]],
    &[&["tin", "c", "out.ply", "--max-error", "1", "--workdir", "w"]],
    &[&["plan", "tin", "c", "-o", "w", "--max-error", "1"], &["run", "w"]],
    &[&["tiles", "c", "out", "--cell", "5"]],
];

#[test]
fn a_bad_cloud_never_stops_the_others_and_is_named() {
    for verb in VERBS {
        let place = place();
        let ran = place.run(&[verb[0], &["--json", "--skip-bad"]].concat());
        assert_eq!(ran.code, 0, "{verb:?}: {}", ran.err);
        for name in BAD {
            let lines = ran.err.lines().filter(|line| line.contains(&format!("skipped {name}: ")));
            assert_eq!(lines.count(), 1, "{verb:?}: {}", ran.err);
            assert!(ran.out.contains(name), "{verb:?}: {name} in {}", ran.out);
        }
        let told = match verb.get(1) {
            Some(run) => place.ok(run).out,
            None => ran.out,
        };
        assert!(told.contains("c/inside.laz is damaged: "), "{verb:?}: {told}");
    }
}

#[test]
fn a_cloud_that_is_damaged_inside_stops_who_does_not_ask_for_less() {
    let place = place();
    BAD.iter().for_each(|name| std::fs::remove_file(place.path(name)).unwrap());
    for verb in VERBS {
        let ran = verb.iter().map(|args| place.run(args)).find(|ran| ran.code != 0);
        let ran = ran.unwrap_or_else(|| panic!("{verb:?} went on"));
        assert!(ran.err.contains("inside.laz"), "{verb:?}: {} {}", ran.code, ran.err);
        let _cleared = std::fs::remove_dir_all(place.path("w"));
    }
    let told = place.ok(&["info", "c", "--stats", "--skip-bad"]).out;
    assert!(told.contains("c/inside.laz is damaged: "), "{told}");
    let whole = place.ok(&["grid", "c", "a.tif", "--cell", "5", "--salvage"]).out;
    assert!(whole.contains("lost") && whole.contains("c/inside.laz is damaged: "), "{whole}");
}
