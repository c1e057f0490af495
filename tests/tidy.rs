//! Order in the house, as far as no compiler sees to it: a `//!` line on every file, no file too long,
//! nothing left to do, no two types of one name, no names in a language of its own, `unsafe` only where it is listed, pure crates without
//! files, threads or clocks, and manifests that say what the table of ARCHITECTURE.md does.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Most lines of a source file.
const MAX_LINES: usize = 600;

/// What a pure crate must not name: files, paths, clocks, threads.
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

/// Words of this project alone, which no name may have: a reader of GDAL's, PDAL's or CGAL's manual knows others.
const PRIVATE_WORDS: [&str; 18] = [
    "told", "asked", "unmet", "plumb", "knit", "sieve", "sift", "shelf", "stock", "recast",
    "carry", "carried", "joints", "feed", "portion", "say", "saying", "figures",
];

/// The one file of a pure crate that names files: an error says which it is about.
const OF_FILES: &str = "crates/base/src/error.rs";

/// The rules, as ARCHITECTURE.md has them.
#[derive(Debug)]
struct Rules {
    /// Crate to the crates it may import.
    imports: BTreeMap<String, BTreeSet<String>>,
    pure: BTreeSet<String>,
    /// Files that may hold unsafe code.
    unsafe_files: BTreeSet<String>,
}

impl Rules {
    fn read(text: &str) -> Self {
        let mut rules =
            Self { imports: BTreeMap::new(), pure: BTreeSet::new(), unsafe_files: BTreeSet::new() };
        for row in table(text, "| crate |") {
            let (crates, kind, uses) = (words(&row[0]), row[1].trim(), words(&row[2]));
            for member in crates {
                if kind == "pure" {
                    rules.pure.insert(member.clone());
                }
                rules.imports.insert(member, uses.iter().cloned().collect());
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

/// The crate of a source file, from its path: in `crates` or in the folder of its subject.
fn member(path: &str) -> Option<&str> {
    let (folder, _) = path.strip_prefix("crates/")?.split_once("/src/")?;
    folder.rsplit('/').next()
}

/// The folders of crates below a folder.
fn crates_below(folder: &Path) -> Vec<PathBuf> {
    let below = fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
    let below = below.filter(|path| path.is_dir() && path.file_name().unwrap() != "src");
    below
        .flat_map(|path| {
            let mut found = crates_below(&path);
            if path.join("Cargo.toml").is_file() {
                found.push(path);
            }
            found
        })
        .collect()
}

/// The crates that a manifest names as dependencies.
fn dependencies(manifest: &str) -> BTreeSet<String> {
    let lines = manifest.lines().skip_while(|line| *line != "[dependencies]").skip(1);
    let lines = lines.take_while(|line| !line.starts_with("[dev-"));
    let names = lines.filter_map(|line| line.strip_prefix("terrane-"));
    names.map(|rest| rest.split(['.', ' ']).next().unwrap_or_default().to_owned()).collect()
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

/// Everything wrong with a file's text.
fn faults(path: &str, text: &str, rules: &Rules) -> Vec<String> {
    let mut faults = plain_faults(text);
    if path.starts_with("src/") || path.starts_with("crates/") {
        faults.extend(unsafe_faults(path, text, rules));
    }
    if member(path).is_some_and(|member| member != "base") {
        let dashed = dashed(&code(text)).into_iter();
        faults.extend(dashed.map(|option| format!("spells {option}: a message names ‹options›")));
    }
    if member(path).is_some_and(|member| rules.pure.contains(member)) && path != OF_FILES {
        let code = code(text);
        let impure = IMPURE.iter().filter(|word| code.contains(**word));
        faults.extend(impure.map(|word| format!("must not name {word}, being of a pure crate")));
    }
    if !path.starts_with("tests/") && !path.contains("/tests") {
        faults.extend(private_names(&code(text)));
        faults.extend(unfinished(text));
    }
    faults.iter().map(|fault| format!("{path}: {fault}")).collect()
}

/// Options of programs of others, which messages may tell to pass.
const OF_OTHERS: [&str; 2] = ["--calc", "--outfile"];

/// Options as the command line has them.
fn dashed(code: &str) -> Vec<String> {
    let is_of_option = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let words = code.split(|c: char| !is_of_option(c)).map(str::to_owned);
    let is_option = |word: &String| {
        word.strip_prefix("--")
            .is_some_and(|name| name.starts_with(|c: char| c.is_ascii_lowercase()))
    };
    words.filter(is_option).filter(|word| !OF_OTHERS.contains(&word.as_str())).collect()
}

fn plain_faults(text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    if !text.starts_with("//! ") {
        faults.push("does not begin with a //! line".to_owned());
    }
    let lines = text.lines().count();
    if lines > MAX_LINES {
        faults.push(format!("has {lines} lines, more than {MAX_LINES}"));
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

/// Names that are defined, with a word of this project alone in them.
fn private_names(code: &str) -> Vec<String> {
    let defined = code.lines().filter_map(|line| {
        let mut words =
            line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty());
        words.find(|word| {
            ["fn", "struct", "enum", "trait", "mod", "const", "static"].contains(word)
        })?;
        words.find(|word| !["fn", "unsafe", "mut"].contains(word))
    });
    let is_private =
        |name: &&str| pieces(name).iter().any(|piece| PRIVATE_WORDS.contains(&piece.as_str()));
    defined
        .filter(is_private)
        .map(|name| format!("{name}: a name with a word of this project alone"))
        .collect()
}

/// The words of a name, in lower case.
fn pieces(name: &str) -> Vec<String> {
    let mut pieces = vec![String::new()];
    let mut was_lower = false;
    for c in name.chars() {
        if c == '_' || (c.is_uppercase() && was_lower) {
            pieces.push(String::new());
        }
        if c != '_' {
            pieces.last_mut().unwrap().extend(c.to_lowercase());
        }
        was_lower = c.is_lowercase();
    }
    pieces
}

/// Documentation whose last sentence goes on in the next item.
fn unfinished(text: &str) -> Vec<String> {
    let doc =
        |line: &str| line.trim_start().strip_prefix("///").map(|words| words.trim().to_owned());
    let lines: Vec<&str> = text.lines().collect();
    let ends = lines.windows(2).filter(|pair| doc(pair[1]).is_none_or(|next| next.is_empty()));
    let last = ends.filter_map(|pair| doc(pair[0]));
    let is_unfinished = |line: &String| line.ends_with(',') || line.ends_with(" and");
    last.filter(is_unfinished).map(|line| format!("\"{line}\" goes on in the next item")).collect()
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path()) {
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
    for folder in ["crates", "src", "tests", "benches", "tools/python/src"] {
        rust_files(&root().join(folder), &mut files);
    }
    files.sort();
    assert!(files.len() > 500, "only {} files found", files.len());
    let name = |path: &Path| {
        path.strip_prefix(root()).unwrap().to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/")
    };
    let faults: Vec<String> = files
        .iter()
        .flat_map(|path| faults(&name(path), &fs::read_to_string(path).unwrap(), &rules))
        .collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
    for file in &rules.unsafe_files {
        assert!(root().join(file).is_file(), "{file} is listed but not there");
    }
}

#[test]
fn manifests_say_what_the_table_does() {
    let rules = rules();
    let mut found = BTreeMap::new();
    for folder in crates_below(&root().join("crates")) {
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let member = folder.file_name().unwrap().to_string_lossy().into_owned();
        assert!(manifest.contains(&format!("name = \"terrane-{member}\"")), "{member} is misnamed");
        found.insert(member, dependencies(&manifest));
    }
    assert_eq!(found, rules.imports);
    for pure in &rules.pure {
        assert!(found[pure].is_subset(&rules.pure), "{pure} is pure");
    }
    for member in ["raster", "cloud", "vector", "mesh"] {
        let below = ["base", "files", "synth"].map(str::to_owned).into();
        assert!(found[member].is_subset(&below), "{member} reads and writes, and does no more");
    }
    assert_eq!(found["proof"], ["base".to_owned()].into(), "a proof shares nothing with a kernel");
    for kernel in ["terrain", "tin", "lidar", "delaunay"] {
        assert!(!found["verify"].contains(kernel), "a proof does not name {kernel}");
    }
}

/// The types that a source text declares.
fn types(code: &str) -> impl Iterator<Item = &str> {
    code.lines().filter_map(|line| {
        let is_before =
            |word: &&str| word.starts_with("pub") || word.ends_with(')') || *word == "unsafe";
        let mut words = line.split_whitespace().skip_while(is_before);
        let is_type = matches!(words.next()?, "struct" | "enum" | "trait" | "union");
        let name = words.next().filter(|_| is_type)?;
        name.split(|c: char| !c.is_alphanumeric() && c != '_').next()
    })
}

/// Types that share their name with another, each with the files of both.
fn shared_names<'a>(files: &[(&'a str, &'a str)]) -> Vec<String> {
    let mut found: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (path, code) in files {
        types(code).for_each(|name| found.entry(name).or_default().push(path));
    }
    let shared = found.iter().filter(|(_, paths)| paths.len() > 1);
    shared.map(|(name, paths)| format!("{name}: {}", paths.join(", "))).collect()
}

#[test]
fn each_type_has_a_name_of_its_own() {
    let mut files = Vec::new();
    for folder in ["crates", "src"] {
        rust_files(&root().join(folder), &mut files);
    }
    let is_test = |path: &Path| {
        path.components().any(|part| part.as_os_str() == "tests")
            || ["tests", "oracle"].map(Some).contains(&path.file_stem().and_then(|s| s.to_str()))
    };
    let texts: Vec<(String, String)> = files
        .iter()
        .filter(|path| !is_test(path.strip_prefix(root()).unwrap()))
        .map(|path| (path.display().to_string(), code(&fs::read_to_string(path).unwrap())))
        .collect();
    let texts: Vec<_> = texts.iter().map(|(path, code)| (path.as_str(), code.as_str())).collect();
    let count: usize = texts.iter().map(|(_, code)| types(code).count()).sum();
    assert!(count > 2000, "only {count} types found");
    let shared = shared_names(&texts);
    assert!(shared.is_empty(), "\n{}", shared.join("\n"));
    let two =
        [("a.rs", "pub(in crate::b) struct Grid<T> {"), ("b.rs", "    enum Grid {\n    Cell,")];
    assert_eq!(shared_names(&two), ["Grid: a.rs, b.rs"]);
}

/// Structs of options of whose fields there are setters, in a source text.
fn with_setters(text: &str) -> Vec<&str> {
    let after = text.split("\n#[options(").skip(1);
    let own = after.filter_map(|rest| {
        let (attribute, rest) = rest.split_once(")]\n")?;
        let (_, name) = rest.split_once("pub struct ")?;
        attribute.contains("setters = ").then(|| name.split([' ', '{']).next().unwrap())
    });
    own.collect()
}

#[test]
fn all_setters_are_in_the_prelude() {
    let prelude = fs::read_to_string(root().join("src/prelude.rs")).unwrap();
    let traits: BTreeSet<&str> = prelude.split(|c: char| !c.is_alphanumeric()).collect();
    let mut files = Vec::new();
    rust_files(&root().join("crates"), &mut files);
    let mut count = 0;
    for text in files.iter().map(|path| fs::read_to_string(path).unwrap()) {
        for name in with_setters(&text) {
            let setters = format!("{}Setters", name.strip_suffix("Options").unwrap_or(name));
            assert!(traits.contains(setters.as_str()), "{setters} is not in the prelude");
            count += 1;
        }
    }
    assert!(count > 40, "only {count} structs found");
}

/// A small house to try the checks on.
fn small_house() -> Rules {
    Rules::read(
        "# x\n\n| crate | kind | may import |\n|---|---|---|\n| `base`, `tin` | pure | |\n\
         | `raster` | edge | `base` |\n\n\
         | file with `unsafe` | why |\n|---|---|\n| `crates/raster/src/map.rs` | maps |\n\nend\n",
    )
}

fn faults_of(path: &str, body: &str) -> Vec<String> {
    faults(path, &format!("//! A file.\n{body}\n"), &small_house())
}

#[test]
fn every_check_can_fail() {
    let bad = [
        ("crates/tin/src/a.rs", "use std::path::Path;", "must not name std::path"),
        ("crates/base/src/geom/a.rs", "rayon::join(a, b);", "must not name rayon"),
        ("crates/tin/src/a.rs", "fn f() { unsafe { g() } }", "not listed"),
        ("src/a.rs", "fn f() { unsafe { g() } }", "not listed"),
        ("crates/raster/src/map.rs", "fn f() { unsafe { g() } }", "without a SAFETY"),
        ("crates/raster/src/map.rs", "fn f() {}", "holds none"),
        ("crates/mesh/src/a.rs", "const A: &str = \"pass --memory\";", "spells --memory"),
        ("crates/lidar/tin/src/a.rs", "rayon::join(a, b);", "must not name rayon"),
        ("src/a.rs", "pub(crate) fn lines_told() {}", "lines_told: a name"),
        ("src/a.rs", "struct PointSieve;", "PointSieve: a name"),
        ("src/a.rs", "/// Lowest x, and\nlow: f64,", "goes on in the next item"),
        ("tests/a.rs", concat!("// TO", "DO"), "says"),
        ("crates/tin/src/a.rs", &"\n".repeat(MAX_LINES), "lines"),
    ];
    for (path, body, fault) in bad {
        let found = faults_of(path, body);
        assert!(found.iter().any(|f| f.contains(fault)), "{body:?} gave {found:?}");
    }
    assert!(!faults("src/a.rs", "fn f() {}\n", &small_house()).is_empty(), "no //! line");
    let manifest = "[package]\nname = \"terrane-a\"\n\n[dependencies]\nterrane-b.workspace = true\n\
                    terrane-c = { path = \"c\" }\n\n[dev-dependencies]\nterrane-d.workspace = true\n";
    assert_eq!(dependencies(manifest), ["b", "c"].map(str::to_owned).into());
}

#[test]
fn sound_files_pass() {
    let good = [
        ("crates/tin/src/a.rs", "// see std::fs and unsafe { } blocks"),
        ("crates/tin/src/a.rs", "#[cfg(test)]\nmod tests {\n    use std::fs;\n}"),
        ("crates/mesh/src/a.rs", "const A: &str = \"pass ‹memory›, a--b or gdal_calc.py --calc\";"),
        (OF_FILES, "use std::path::Path;"),
        (
            "crates/raster/src/map.rs",
            "fn f() {\n    // SAFETY: g has no conditions.\n    unsafe { g() }\n}",
        ),
        ("crates/raster/src/a.rs", "#![deny(unsafe_code)]\nuse std::path::Path;"),
    ];
    for (path, body) in good {
        assert_eq!(faults_of(path, body), Vec::<String>::new(), "{body}");
    }
}
