//! Order in the house: the import table of ARCHITECTURE.md, a `//!` line on every file, no file too
//! long, `unsafe` only where it is listed, nothing left to do.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Most lines of a source file.
const MOST_LINES: usize = 600;

/// Names from the root of the crate that stand for a room.
const REEXPORTS: [(&str, &str); 3] =
    [("Error", "error"), ("ErrorKind", "error"), ("Result", "error")];

/// What a pure room must not name: files, paths, clocks, threads.
const IMPURE: [&str; 10] = [
    "std::fs",
    "std::path",
    "std::io",
    "std::net",
    "std::env",
    "std::process",
    "std::thread",
    "std::time",
    "rayon",
    "crossbeam",
];

/// The rules, as ARCHITECTURE.md has them.
#[derive(Debug)]
struct Rules {
    /// Room to the rooms it may import.
    imports: BTreeMap<String, BTreeSet<String>>,
    pure: BTreeSet<String>,
    /// Files that may hold unsafe code.
    unsafe_files: BTreeSet<String>,
}

impl Rules {
    fn read(text: &str) -> Self {
        let mut rules =
            Self { imports: BTreeMap::new(), pure: BTreeSet::new(), unsafe_files: BTreeSet::new() };
        for row in table(text, "| room |") {
            let (rooms, kind, uses) = (words(&row[0]), row[1].trim(), words(&row[2]));
            for room in rooms {
                if kind == "pure" {
                    rules.pure.insert(room.clone());
                }
                rules.imports.insert(room, uses.iter().cloned().collect());
            }
        }
        for row in table(text, "| file with `unsafe` |") {
            rules.unsafe_files.extend(words(&row[0]));
        }
        rules
    }
}

/// The rows of the markdown table whose heading begins with `heading`.
fn table(text: &str, heading: &str) -> Vec<Vec<String>> {
    let lines = text.lines().skip_while(|line| !line.starts_with(heading)).skip(2);
    let cells =
        |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    lines.take_while(|line| line.starts_with('|')).map(cells).collect()
}

/// The words in backquotes.
fn words(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The room of a source file, from its path below `src`.
fn room(path: &Path) -> String {
    let first = path.components().next().map(|c| c.as_os_str().to_string_lossy().into_owned());
    first.unwrap_or_default().trim_end_matches(".rs").to_owned()
}

/// Source text without comments and without what follows the test module's attribute.
fn code(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    without_comments(&text[..end])
}

fn without_comments(text: &str) -> String {
    let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.map(|line| line.split(" // ").next().unwrap_or(line)).collect::<Vec<_>>().join("\n")
}

/// Rooms named after `root` ("crate" or "terrane") anywhere in the text.
fn imports(text: &str, root: &str) -> BTreeSet<String> {
    let mark = format!("{root}::");
    let starts = text.match_indices(&mark).filter(|(at, _)| {
        !text[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':')
    });
    let names = starts.flat_map(|(at, _)| heads(&text[at + mark.len()..]));
    names.map(|name| alias(&name)).collect()
}

fn alias(name: &str) -> String {
    let known = REEXPORTS.iter().find(|(from, _)| *from == name);
    known.map_or(name, |(_, room)| room).to_owned()
}

/// The first names of a path, or of each path in a braced group.
fn heads(rest: &str) -> Vec<String> {
    let ident = |text: &str| -> String {
        text.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    if !rest.starts_with('{') {
        return vec![ident(rest)];
    }
    let (mut depth, mut item, mut items) = (0, String::new(), Vec::new());
    for c in rest.chars() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        match (depth, c) {
            (0, _) => break,
            (1, ',') => items.push(std::mem::take(&mut item)),
            (1, '{') => {}
            _ => item.push(c),
        }
    }
    items.push(item);
    items.iter().map(|item| ident(item)).filter(|name| !name.is_empty()).collect()
}

/// Everything wrong with a file's text.
fn faults(path: &str, text: &str, rules: &Rules) -> Vec<String> {
    let below = path.strip_prefix("src/");
    let mut faults = plain_faults(text);
    if let Some(below) = below {
        faults.extend(import_faults(&room(Path::new(below)), text, rules));
        faults.extend(unsafe_faults(path, text, rules));
    }
    faults.iter().map(|fault| format!("{path}: {fault}")).collect()
}

fn plain_faults(text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    if !text.starts_with("//! ") {
        faults.push("does not begin with a //! line".to_owned());
    }
    let lines = text.lines().count();
    if lines > MOST_LINES {
        faults.push(format!("has {lines} lines, more than {MOST_LINES}"));
    }
    let leftovers = [
        concat!("TO", "DO"),
        concat!("FIX", "ME"),
        concat!("unimplemented", "!("),
        concat!("todo", "!("),
    ];
    faults.extend(leftovers.iter().filter(|w| text.contains(**w)).map(|w| format!("says {w}")));
    faults
}

fn import_faults(room: &str, text: &str, rules: &Rules) -> Vec<String> {
    let Some(allowed) = rules.imports.get(room) else {
        return vec![format!("room {room} is not in the import table of ARCHITECTURE.md")];
    };
    let root = if room == "main" { "terrane" } else { "crate" };
    let named = imports(&without_comments(text), root);
    let may = |name: &&String| name.as_str() != room && !allowed.contains(*name);
    let mut faults: Vec<String> = named
        .iter()
        .filter(may)
        .map(|name| format!("room {room} must not import {name}"))
        .collect();
    if rules.pure.contains(room) {
        let code = code(text);
        let impure = IMPURE.iter().filter(|word| code.contains(**word));
        faults.extend(impure.map(|word| format!("pure room {room} must not name {word}")));
    }
    faults
}

fn unsafe_faults(path: &str, text: &str, rules: &Rules) -> Vec<String> {
    let code = without_comments(text);
    let mut words = code.split(|c: char| !c.is_alphanumeric() && c != '_');
    let has = words.any(|word| word == "unsafe");
    let listed = rules.unsafe_files.contains(path);
    let mut faults = Vec::new();
    if has && !listed {
        faults.push("holds unsafe code but is not listed in ARCHITECTURE.md".to_owned());
    }
    if listed && !has {
        faults.push("is listed for unsafe code but holds none".to_owned());
    }
    faults.extend(unexplained(text));
    faults
}

/// Unsafe blocks without a SAFETY comment in the lines before them.
fn unexplained(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().collect();
    let is_comment = |line: &str| line.trim_start().starts_with("//");
    let explained =
        |at: usize| lines[at.saturating_sub(6)..=at].iter().any(|l| l.contains("SAFETY:"));
    let open = ["unsafe {", "unsafe impl"];
    (0..lines.len())
        .filter(|&at| !is_comment(lines[at]) && open.iter().any(|word| lines[at].contains(word)))
        .filter(|&at| !explained(at))
        .map(|at| format!("line {}: unsafe without a SAFETY comment", at + 1))
        .collect()
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

fn rules() -> Rules {
    Rules::read(&fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap())
}

#[test]
fn the_house_is_in_order() {
    let rules = rules();
    let mut files = Vec::new();
    for folder in ["src", "tests", "benches"] {
        rust_files(&root().join(folder), &mut files);
    }
    files.sort();
    assert!(files.len() > 20, "only {} files found", files.len());
    let name = |path: &Path| {
        path.strip_prefix(root()).unwrap().to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/")
    };
    let faults: Vec<String> = files
        .iter()
        .flat_map(|path| faults(&name(path), &fs::read_to_string(path).unwrap(), &rules))
        .collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn the_table_names_rooms_that_exist_and_only_those() {
    let rules = rules();
    let mut rooms = BTreeSet::new();
    for entry in fs::read_dir(root().join("src")).unwrap().flatten() {
        rooms.insert(room(Path::new(&entry.file_name())));
    }
    assert_eq!(rooms, rules.imports.keys().cloned().collect());
    let used: BTreeSet<String> = rules.imports.values().flatten().cloned().collect();
    assert!(used.is_subset(&rooms), "{used:?}");
    for file in &rules.unsafe_files {
        assert!(root().join(file).is_file(), "{file} is listed but not there");
    }
}

#[test]
fn siblings_and_purity_are_what_the_design_says() {
    let rules = rules();
    for pure in &rules.pure {
        // Triangulations of points, and lines, are below the rooms that build on them.
        let base = ["error", "geom", "delaunay", "line"].map(str::to_owned);
        let below = base.into_iter().filter(|room| room != pure).collect();
        assert!(rules.imports[pure].is_subset(&below), "{pure} is pure");
    }
    for sibling in ["raster", "output"] {
        for above in ["raster", "output", "pipeline", "cli", "tin", "verify", "render"] {
            assert!(!rules.imports[sibling].contains(above), "{sibling} must not import {above}");
        }
    }
    assert!(!rules.imports["pipeline"].contains("cli"));
}

/// A small house to try the checks on.
fn small_house() -> Rules {
    Rules::read(
        "# x\n\n| room | kind | may import |\n|---|---|---|\n| `geom`, `tin` | pure | `error` |\n\
         | `raster` | edge | `error`, `geom` |\n\n\
         | file with `unsafe` | why |\n|---|---|\n| `src/raster/map.rs` | maps |\n\nend\n",
    )
}

fn faults_of(path: &str, body: &str) -> Vec<String> {
    faults(path, &format!("//! A file.\n{body}\n"), &small_house())
}

#[test]
fn every_check_can_fail() {
    let bad = [
        ("src/tin/a.rs", "use crate::raster::open;", "tin must not import raster"),
        (
            "src/tin/a.rs",
            "use crate::{error::{Error, Result}, pipeline::tin};",
            "must not import pipeline",
        ),
        ("src/tin/a.rs", "fn f() -> crate::mesh::Sink {}", "must not import output"),
        ("src/tin/a.rs", "use std::path::Path;", "must not name std::path"),
        ("src/geom/a.rs", "rayon::join(a, b);", "must not name rayon"),
        ("src/attic/a.rs", "", "not in the import table"),
        ("src/tin/a.rs", "fn f() { unsafe { g() } }", "not listed"),
        ("src/raster/map.rs", "fn f() { unsafe { g() } }", "without a SAFETY"),
        ("src/raster/map.rs", "fn f() {}", "holds none"),
        ("src/tin/a.rs", concat!("// TO", "DO"), "says"),
        ("src/tin/a.rs", &"\n".repeat(MOST_LINES), "lines"),
    ];
    for (path, body, fault) in bad {
        let found = faults_of(path, body);
        assert!(found.iter().any(|f| f.contains(fault)), "{body:?} gave {found:?}");
    }
    assert!(!faults("src/tin/a.rs", "fn f() {}\n", &small_house()).is_empty(), "no //! line");
}

#[test]
fn sound_files_pass() {
    let good = [
        ("src/tin/a.rs", "use crate::{Error, Result};\nuse crate::tin::scan;\nuse std::fmt;"),
        (
            "src/tin/a.rs",
            "// see crate::raster, std::fs and unsafe { } blocks\n/// [`crate::pipeline`]",
        ),
        ("src/tin/a.rs", "#[cfg(test)]\nmod tests {\n    use std::fs;\n}"),
        (
            "src/raster/map.rs",
            "fn f() {\n    // SAFETY: g has no conditions.\n    unsafe { g() }\n}",
        ),
        ("src/raster/a.rs", "#![deny(unsafe_code)]\nuse crate::geom::Rect;\nuse std::path::Path;"),
    ];
    for (path, body) in good {
        assert_eq!(faults_of(path, body), Vec::<String>::new(), "{body}");
    }
}
