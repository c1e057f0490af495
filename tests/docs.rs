//! The documents: links that lead somewhere, pages that are in the book, tutorials that run as they are
//! written, and reports whose members are all told of.

#[path = "common/cli_support.rs"]
mod cli_support;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use cli_support::Place;

/// Documents that are no pages of the book.
const BESIDE_THE_BOOK: [&str; 6] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "benches/RESULTS.md",
    "benches/history/2026.md",
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The pages of the book, and SUMMARY.md.
fn pages() -> Vec<PathBuf> {
    let mut folders = vec![root().join("docs/src")];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path()) {
            match path.is_dir() {
                true => folders.push(path),
                false => found.push(path),
            }
        }
    }
    found.retain(|path| path.extension().is_some_and(|e| e == "md"));
    found.sort();
    assert!(found.len() > 20, "only {} pages found", found.len());
    found
}

/// A page without its blocks of code.
fn prose(text: &str) -> String {
    let outside = text.split("\n```").step_by(2);
    outside.map(|part| part.trim_start_matches('\n')).collect::<Vec<_>>().join("\n")
}

/// Where the links and pictures of a page lead, but for other sites.
fn links(text: &str) -> Vec<String> {
    let prose = prose(text);
    let targets = prose.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    targets.filter(|to| !to.contains("://")).map(str::to_owned).collect()
}

/// What a heading is called in a link, as mdBook and code hosts have it.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = prose(text);
    let headings = headings.lines().filter(|line| line.starts_with('#'));
    let kept = |c: &char| c.is_alphanumeric() || ['-', '_', ' '].contains(c);
    let name = |line: &str| -> String {
        let text = line.trim_start_matches('#').trim();
        text.to_lowercase().chars().filter(kept).map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(name).collect()
}

/// What is wrong with the links of the page at `path`.
fn broken(path: &Path, text: &str) -> Vec<String> {
    let fault = |to: &String| {
        let (file, anchor) = to.split_once('#').unwrap_or((to, ""));
        let target = path.parent().unwrap().join(file);
        if !target.exists() {
            return Some(format!("{}: {to} is not there", path.display()));
        }
        let headings = || if file.is_empty() { anchors(text) } else { anchors(&read(&target)) };
        let held = anchor.is_empty() || headings().contains(anchor);
        (!held).then(|| format!("{}: {to} has no such heading", path.display()))
    };
    links(text).iter().filter_map(fault).collect()
}

#[test]
fn every_link_leads_somewhere() {
    let mut files = pages();
    files.extend(BESIDE_THE_BOOK.map(|name| root().join(name)));
    let texts: Vec<_> = files.iter().map(|path| (path, read(path))).collect();
    let count: usize = texts.iter().map(|(_, text)| links(text).len()).sum();
    assert!(count > 50, "only {count} links found");
    let faults: Vec<_> = texts.iter().flat_map(|(path, text)| broken(path, text)).collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn links_that_lead_nowhere_are_found() {
    let page = root().join("docs/src/index.md");
    let nowhere = "# A\n[a](gone.md) [b](#c) [c](guide/tin.md#no-such) [d](https://x.y)\n";
    assert_eq!(broken(&page, nowhere).len(), 3);
    let sound = "# A `b`: c\n[a](#a-b-c) [b](guide/tin.md#options)\n```sh\n[c](gone.md)\n```\n";
    assert_eq!(broken(&page, sound), Vec::<String>::new());
}

#[test]
fn the_page_of_methods_says_what_the_registry_does() {
    let page = read(&root().join("docs/src/guide/methods.md"));
    for method in terrane_baselines::METHODS {
        let cells = [method.source, method.time, method.promise.text()].join(" | ");
        let row = format!("| `{}` | {cells} |", method.name);
        assert!(page.contains(&row), "{row}");
    }
    for triangulation in terrane_baselines::TriangulationRule::ALL {
        assert!(page.contains(&format!("\n| `{triangulation}` | ")), "{triangulation}");
    }
}

/// Links to files beside the book work in the repository and are broken in the book.
#[test]
fn the_book_has_every_page_and_links_within_itself() {
    let book = root().join("docs/src").canonicalize().unwrap();
    let summary = book.join("SUMMARY.md");
    let listed: BTreeSet<_> = links(&read(&summary)).iter().map(|to| book.join(to)).collect();
    let there = pages().into_iter().map(|page| page.canonicalize().unwrap());
    let there: BTreeSet<_> = there.filter(|page| *page != summary).collect();
    assert_eq!(listed, there);
    for page in there {
        for to in links(&read(&page)) {
            let file = to.split('#').next().unwrap();
            let target = page.parent().unwrap().join(file).canonicalize().unwrap();
            assert!(target.starts_with(&book), "{}: {to} leaves the book", page.display());
        }
    }
}

/// Paragraphs and items of lists of a page; blocks of code and tables are neither.
fn paragraphs(text: &str) -> Vec<String> {
    let prose = prose(text);
    let blocks = prose.split("\n\n").filter(|block| !block.trim_start().starts_with('|'));
    blocks.flat_map(|block| block.split("\n- ")).map(str::to_owned).collect()
}

#[test]
fn paragraphs_are_short() {
    let longest = 90;
    let by_hand = |page: &PathBuf| !page.components().any(|part| part.as_os_str() == "reference");
    for page in pages().into_iter().filter(by_hand) {
        for paragraph in paragraphs(&read(&page)) {
            let words = paragraph.split_whitespace().count();
            assert!(words <= longest, "{}: {words} words: {paragraph}", page.display());
        }
    }
    let page = "# A\n\none\ntwo\n- three\n- four\n\n| five |\n\n```sh\nsix\n```\nseven\n";
    assert_eq!(paragraphs(page), ["# A", "one\ntwo", "three", "four", "seven\n"]);
}

/// The folder of a room, in `crates` or in the folder of its subject.
fn room(name: &str) -> Option<PathBuf> {
    let crates = root().join("crates");
    let subjects = fs::read_dir(&crates).unwrap().map(|entry| entry.unwrap().path());
    let mut folders = std::iter::once(crates).chain(subjects).map(|folder| folder.join(name));
    folders.find(|folder| folder.join("Cargo.toml").is_file())
}

/// The file of a module, such as `terrain::tin::zone`, if there is one.
fn module(path: &str) -> Option<PathBuf> {
    let (name, rest) = path.split_once("::").unwrap_or((path, "lib"));
    let file = room(name)?.join("src").join(rest.replace("::", "/"));
    [file.with_extension("rs"), file.join("mod.rs")].into_iter().find(|file| file.is_file())
}

/// Whether there is such a module, or something of that name in the module above.
fn is_there(path: &str) -> bool {
    let (above, name) = path.rsplit_once("::").unwrap_or((path, ""));
    module(path).or_else(|| module(above).filter(|file| read(file).contains(name))).is_some()
}

#[test]
fn modules_that_the_architecture_names_are_there() {
    let text = read(&root().join("ARCHITECTURE.md"));
    let named = prose(&text);
    let named = named.split('`').skip(1).step_by(2).filter(|word| word.contains("::"));
    let of_rooms = |path: &&str| room(path.split("::").next().unwrap()).is_some();
    let paths: BTreeSet<&str> = named.filter(of_rooms).collect();
    assert!(paths.len() > 30, "only {paths:?} found");
    let gone: Vec<_> = paths.iter().filter(|path| !is_there(path)).collect();
    assert!(gone.is_empty(), "not there: {gone:?}");
    assert!(!is_there("terrain::tin::zones") && !is_there("tin::no_such"));
}

/// A fenced block: what stands behind its backquotes, and its lines.
fn blocks(text: &str) -> Vec<(&str, &str)> {
    let inside = text.split("\n```").skip(1).step_by(2);
    inside.filter_map(|block| block.split_once('\n')).collect()
}

/// Whether `told` has a line with the parts of `line` in their order; `...` stands for anything.
fn tells(told: &str, line: &str) -> bool {
    let parts: Vec<&str> = line.trim().split("...").map(str::trim).collect();
    told.lines().any(|told| {
        let mut rest = Some(told);
        for part in &parts {
            rest = rest.and_then(|rest| rest.split_once(part)).map(|(_, behind)| behind);
        }
        rest.is_some()
    })
}

/// Runs `script` in the folder of `place` with the built program on the path: standard output and error.
#[cfg(unix)]
fn shell(place: &Place, page: &str, script: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_terrane")).parent().unwrap().to_owned();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut shell = std::process::Command::new("sh");
    shell.args(["-ec", &format!("{{\n{script}\n}} 2>&1")]).env("PATH", &path);
    let ran = shell.current_dir(place.path("")).output().unwrap();
    let told = String::from_utf8(ran.stdout).unwrap();
    assert!(ran.status.success(), "{page}: {script}\n{told}");
    told
}

/// Runs the blocks marked `run` of a page in their order in one folder, and looks in what they print for
/// the lines of blocks marked `out`.
#[cfg(unix)]
fn follow(page: &str, text: &str) -> Place {
    let place = Place::new();
    let mut told = String::new();
    let mut count = 0;
    for (kind, block) in blocks(text) {
        if kind == "sh run" {
            told = shell(&place, page, block);
            count += 1;
        } else if kind == "text out" {
            for line in block.lines() {
                assert!(tells(&told, line), "{page}: no {line:?} in\n{told}");
            }
        }
    }
    assert!(count > 0, "{page}: nothing was run");
    place
}

/// Commands in the second column of the tables of a page.
#[cfg(unix)]
fn equivalents(text: &str) -> Vec<&str> {
    let rows = text.lines().filter(|line| line.starts_with("| "));
    let cells = rows.filter_map(|row| row.split(" | ").nth(1));
    let commands = cells.filter_map(|cell| cell.strip_prefix('`')?.strip_suffix('`'));
    commands.filter(|command| command.starts_with("terrane ")).collect()
}

/// Paths of the files and folders of `place`.
#[cfg(unix)]
fn entries(place: &Place) -> BTreeSet<PathBuf> {
    fs::read_dir(place.path("")).unwrap().map(|entry| entry.unwrap().path()).collect()
}

#[cfg(unix)]
#[test]
fn equivalents_of_other_programs_run() {
    run_equivalents("coming-from.md", include_str!("../docs/src/guide/coming-from.md"), 50);
}

#[cfg(unix)]
#[test]
fn ten_jobs_run() {
    run_equivalents("ten-jobs.md", include_str!("../docs/src/tutorials/ten-jobs.md"), 10);
}

/// Each command finds the inputs of the page and no output of another command.
#[cfg(unix)]
fn run_equivalents(page: &str, text: &str, count: usize) {
    let place = follow(page, text);
    let inputs = entries(&place);
    let commands = equivalents(text);
    assert!(commands.len() >= count, "only {} commands found", commands.len());
    for command in commands {
        shell(&place, page, command);
        let outputs: Vec<_> = entries(&place).difference(&inputs).cloned().collect();
        let reads_only =
            ["terrane info ", "terrane verify "].iter().any(|v| command.starts_with(v));
        assert!(reads_only || !outputs.is_empty(), "{command}: no output");
        for path in outputs {
            match path.is_dir() {
                true => fs::remove_dir_all(path).unwrap(),
                false => fs::remove_file(path).unwrap(),
            }
        }
    }
}

#[cfg(unix)]
#[test]
fn the_readme_runs() {
    follow("README.md", include_str!("../README.md"));
}

#[cfg(unix)]
#[test]
fn the_tutorial_of_elevation_models_runs() {
    follow("dem.md", include_str!("../docs/src/tutorials/dem.md"));
}

#[cfg(unix)]
#[test]
fn the_tutorial_of_point_clouds_runs() {
    follow("lidar.md", include_str!("../docs/src/tutorials/lidar.md"));
}

#[cfg(unix)]
#[test]
fn the_tutorial_of_maps_runs() {
    follow("maps.md", include_str!("../docs/src/tutorials/maps.md"));
}

#[cfg(unix)]
#[test]
fn the_tutorial_of_clusters_runs() {
    follow("clusters.md", include_str!("../docs/src/tutorials/clusters.md"));
}

#[cfg(unix)]
#[test]
fn the_tutorial_of_a_county_runs() {
    follow("county.md", include_str!("../docs/src/tutorials/county.md"));
}

/// A tutorial whose program fails, or does not print what it says, is found.
#[cfg(unix)]
#[test]
fn a_tutorial_that_does_not_hold_is_found() {
    let fails = |text: &str| std::panic::catch_unwind(|| follow("a.md", text)).is_err();
    let good = "\n```sh run\necho a b c\n```\n\n```text out\na ... c\n```\n";
    assert!(!fails(good));
    assert!(fails(&good.replace("a ... c", "c ... a")));
    assert!(fails(&good.replace("echo a b c", "echo a b c\nfalse")));
    assert!(fails("\n```sh\ntrue\n```\n"));
}

/// The members of what a run prints with `--json`.
fn members(place: &Place, job: &str) -> BTreeSet<String> {
    let args: Vec<&str> = job.split(' ').collect();
    let told = place.run(&[&args[..], &["--json"]].concat());
    let report: serde_json::Value =
        serde_json::from_str(&told.out).unwrap_or_else(|e| panic!("{job}: {e}: {}", told.err));
    report.as_object().unwrap().keys().cloned().collect()
}

#[test]
fn members_of_reports_are_told_of() {
    let page = include_str!("../docs/src/guide/programs.md");
    let page = page.split("\n## Reports\n").nth(1).unwrap();
    let place = Place::new();
    place.write("some.wkt", "POINT (500100 4749900)").write("some.prj", "EPSG:32631");
    place.write("line.wkt", "LINESTRING (500100 4749900, 500300 4749700)");
    place.write("line.prj", "EPSG:32631");
    let jobs = [
        "synth rough,size=65 dem.tif",
        "synth cloud,size=40,density=2 c.laz",
        "synth coverage,vertices=100,features=4 lines.geojson",
        "tin dem.tif mesh.ply --max-error 20 --keep-points some.wkt --min-angle 20 --verify",
        "tin dem.tif lines.ply --max-error 20 --breaklines line.wkt --verify",
        "tin dem.tif mesh.glb --max-vertices 50",
        "tin c.laz ground.ply --max-error 1",
        "verify mesh.ply dem.tif --keep-points some.wkt",
        "verify ground.ply c.laz",
        "line lines.geojson few.geojson --tolerance 5 --hierarchy h",
        "verify few.geojson lines.geojson --tolerance 5",
        "grid c.laz grid.tif --cell 2",
        "contour dem.tif -o contours.fgb -i 50",
        "convert dem.tif copy.asc",
        "view dem.tif -o view.png --width 50",
        "view mesh.ply --html mesh.html --against dem.tif",
        "view dem.tif --html grid.html",
        "view lines.geojson --html lines.html",
        "view c.laz --html c.html",
        "qa c.laz qa.html --min-density 1 --index index.geojson",
        "demo --methods",
        "info dem.tif --stats",
        "info c.laz --stats",
        "info c.laz --picture view-c.png",
        "info mesh.ply",
        "info lines.geojson",
        "plan tin dem.tif -o mesh --max-error 20",
        "run mesh",
        "status mesh",
        "plan grid c.laz -o grid --cell 2",
        "run grid",
        "plan points c.laz -o squares --tile 20",
        "run squares",
        "points c.laz few.laz --thin 2",
    ];
    for job in jobs {
        for member in members(&place, job) {
            assert!(page.contains(&format!("`{member}`")), "{member}, of {job}");
        }
    }
}
