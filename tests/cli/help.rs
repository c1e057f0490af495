//! Help, version, completions, manual pages, and the book against the registries.

use crate::cli_support::Place;
use terrane_mesh as mesh;
use terrane_raster as raster;
use terrane_synth as synth;

const VERBS: [&str; 11] = [
    "tin",
    "verify",
    "info",
    "view",
    "convert",
    "grid",
    "contour",
    "synth",
    "demo",
    "completions",
    "man",
];

/// The others.
const MORE: [&str; 3] = ["simplify", "plan", "points"];

/// What can be done with plans.
const PLANS: [&str; 7] = ["tin", "grid", "tiles", "points", "run", "status", "finish"];

#[test]
fn help_and_version_go_to_stdout() {
    let place = Place::new();
    let version = place.ok(&["--version"]);
    assert_eq!(version.out, format!("terrane {}\n", env!("CARGO_PKG_VERSION")));
    let help = place.ok(&["--help"]);
    for verb in VERBS.iter().chain(&MORE) {
        assert!(help.out.contains(&format!("\n  {verb} ")), "{verb} in\n{}", help.out);
        let own = place.ok(&[verb, "--help"]);
        assert!(own.out.contains(&format!("Usage: terrane {verb}")), "{}", own.out);
        assert_eq!(own.err, "");
    }
    let plans = place.ok(&["plan", "--help"]).out;
    for what in PLANS {
        assert!(plans.contains(&format!("\n  {what} ")), "{what} in\n{plans}");
        let wrong = place.run(&["plan", what, "--no-such-option"]);
        assert!(wrong.err.contains(&format!("see `terrane plan {what} --help`")), "{}", wrong.err);
    }
    // Its task is the last one.
    let finish = place.ok(&["plan", "finish", "--help"]).out;
    assert!(finish.contains("--output") && !finish.contains("--task"), "{finish}");
    // As they were called before.
    for verb in ["run", "status", "finish"] {
        assert!(!help.out.contains(&format!("\n  {verb} ")));
        place.ok(&[verb, "--help"]);
    }
}

#[test]
fn nothing_asked_gives_the_help_as_an_error() {
    let ran = Place::new().run(&[]);
    assert_eq!((ran.code, ran.out.as_str()), (2, ""));
    assert!(ran.err.contains("Usage: terrane"));
}

#[test]
fn completions_for_every_shell() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = place.ok(&["completions", shell]).out;
        assert!(script.contains("max-error"), "{shell}");
    }
}

#[test]
fn a_manual_page_for_each_verb() {
    let place = Place::new();
    place.ok(&["man", "pages"]);
    for verb in VERBS.iter().chain(&MORE) {
        let page = std::fs::read_to_string(place.path(&format!("pages/terrane-{verb}.1"))).unwrap();
        assert!(page.contains(".TH"), "{verb}");
    }
    for what in PLANS {
        assert!(place.path(&format!("pages/terrane-plan-{what}.1")).is_file(), "{what}");
    }
    assert!(place.path("pages/terrane.1").is_file());
    assert_eq!(place.run(&["man", "pages"]).code, 2, "pages are not replaced unasked");
    place.ok(&["man", "pages", "--overwrite"]);
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let place = Place::new();
    let mut command = place.command(&["completions", "zsh"]);
    command.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn the_book_tells_of_every_format_character_and_verb() {
    let formats = include_str!("../../docs/src/guide/formats.md");
    let endings = |all: &[&str]| all.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" ");
    let known = raster::FORMATS.iter().map(|f| (f.name, endings(f.extensions)));
    let known = known.chain(mesh::FORMATS.iter().map(|f| (f.name, endings(f.extensions))));
    let written = raster::write::FORMATS.iter().map(|f| (f.name, endings(f.extensions)));
    for (name, endings) in written {
        assert!(formats.contains(&format!("| {name} | {endings} |")), "{name}: {endings}");
    }
    let options = raster::write::FORMATS.iter().flat_map(|f| f.options);
    for option in options {
        assert!(formats.contains(&format!("`{}`", option.key)), "{}", option.key);
    }
    let help = Place::new().ok(&["tin", "--help"]).out;
    for (name, endings) in known {
        assert!(formats.contains(&format!("| {name} | {endings} |")), "{name}: {endings}");
        let mut lines = help.lines().filter(|line| line.trim().starts_with(name));
        assert!(lines.any(|line| line.contains(&endings)), "{name}: {endings}");
    }
    let names = include_str!("../../docs/src/reference/names.md");
    for character in synth::CHARACTERS {
        assert!(names.contains(&format!("| `{}` |", character.name)), "{}", character.name);
    }
    let verbs = include_str!("../../docs/src/reference/verbs.md");
    for verb in VERBS {
        assert!(verbs.contains(&format!("\n## terrane {verb}\n")), "{verb}");
    }
}
