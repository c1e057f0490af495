//! Every promise of a plan, for meshes, grids and tiles alike, by the program itself: a table of kinds of
//! plans x ways to do them x what may go wrong. Whatever happens, the bytes at the end are those of one
//! run without a plan, or the failure names what is wrong and what to do.

use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use crate::cli_support::{Place, json};
use serde_json::Value;

const TERRAIN: &str = "synth:rough,width=250,height=700,seed=5";
const CLOUD: &str = "synth:cloud,size=520,density=0.2,seed=5";

const COPSE: &str = "synth:cloud,size=264,density=0.15,seed=8";

const GROVE: &str = "synth:cloud,size=300,density=0.15,seed=8";

/// A kind of plan.
struct Kind {
    name: &'static str,
    verb: &'static str,
    input: &'static str,
    /// What is asked for, of a plan and of one run without.
    how: &'static [&'static str],
    /// How large tasks are.
    cut: [&'static str; 2],
    ending: &'static str,
    output: &'static str,
}

const KINDS: [Kind; 6] = [
    Kind {
        name: "tin",
        verb: "tin",
        input: TERRAIN,
        how: &["--max-error", "4", "--tile", "64"],
        cut: ["--strip-rows", "3"],
        ending: "ply",
        output: "mesh.ply",
    },
    Kind {
        name: "grid",
        verb: "grid",
        input: CLOUD,
        how: &["--cell", "1", "--stat", "tin:max_edge=8,mean"],
        cut: ["--tile", "256"],
        ending: "tif",
        output: "grid.tif",
    },
    Kind {
        name: "canopy",
        verb: "grid",
        input: COPSE,
        how: &["--cell", "0.5", "--chm", "--ground", "csf:cloth=4"],
        cut: ["--tile", "256"],
        ending: "tif",
        output: "grid.tif",
    },
    Kind {
        name: "cloud",
        verb: "tin",
        input: "synth:cloud,size=520,density=0.5,seed=5",
        how: &["--max-error", "0.7"],
        cut: ["--cut", "131072"],
        ending: "ply",
        output: "mesh.ply",
    },
    Kind {
        name: "tiles",
        verb: "tiles",
        input: "dem.asc",
        how: &[],
        cut: ["--cut", "3"],
        ending: "tiles",
        output: "tiles",
    },
    Kind {
        name: "points",
        verb: "points",
        input: "grove.laz",
        how: &[
            "--tile",
            "90",
            "--buffer",
            "12",
            "--thin",
            "1.5:lowest",
            "--drop-overlap=20",
            "--attribute",
            "intensity=intensity/2",
            "--sort",
            "morton",
            "--ground",
            "csf:cloth=4",
            "--height-above-ground",
            "--classify",
            "ground",
            "--classify",
            "noise:statistical:k=6,m=1.5",
            "--dedupe",
        ],
        cut: ["--cut", "2"],
        ending: "squares",
        output: "points",
    },
];

/// What each kind writes without a plan.
static WHOLES: [OnceLock<Vec<u8>>; KINDS.len()] = [const { OnceLock::new() }; KINDS.len()];

impl Kind {
    /// The bytes of one run without a plan in a place of this kind.
    fn whole(&self, place: &Place) -> &'static [u8] {
        let number = KINDS.iter().position(|kind| kind.name == self.name).unwrap();
        WHOLES[number].get_or_init(|| {
            let whole = format!("single.{}", self.ending);
            place.ok(&[&self.single(&whole)[..], &["-q"]].concat());
            let expected = contents(&place.path(&whole));
            remove(&place.path(&whole));
            expected
        })
    }

    /// The command that plans in `folder`.
    fn plan<'a>(&'a self, folder: &'a str) -> Vec<&'a str> {
        let command = ["plan", self.verb, self.input, "-o", folder];
        [&command[..], self.how, &self.cut].concat()
    }

    /// The command that makes `output` without a plan.
    fn single<'a>(&'a self, output: &'a str) -> Vec<&'a str> {
        [&[self.verb, self.input, output][..], self.how].concat()
    }

    /// A folder with all files that kinds read.
    fn place(&self) -> Place {
        match self.name {
            "tiles" => crate::tiles::place(150),
            "points" => {
                let place = Place::new();
                place.ok(&["synth", &GROVE["synth:".len()..], "grove.laz", "-q"]);
                place
            }
            _ => Place::new(),
        }
    }
}

/// The files of an output.
pub(crate) fn files(output: &Path) -> Vec<PathBuf> {
    if !output.is_dir() {
        return vec![output.to_path_buf()];
    }
    let entries = std::fs::read_dir(output).unwrap();
    let mut found: Vec<_> = entries.flat_map(|entry| files(&entry.unwrap().path())).collect();
    found.sort();
    found
}

/// The bytes of an output, and the names of its files.
fn contents(output: &Path) -> Vec<u8> {
    let content = |file: PathBuf| {
        let name = file.strip_prefix(output).unwrap().to_str().unwrap().as_bytes().to_vec();
        [name, std::fs::read(&file).unwrap()].concat()
    };
    files(output).into_iter().flat_map(content).collect()
}

fn remove(output: &Path) {
    match output.is_dir() {
        true => std::fs::remove_dir_all(output).unwrap(),
        false => std::fs::remove_file(output).unwrap(),
    }
}

/// A folder with a plan in `work`, and the bytes it has to end with.
struct Work {
    kind: &'static Kind,
    place: Place,
    expected: &'static [u8],
    /// All tasks but the last, in the plan's order.
    tasks: Vec<String>,
}

impl Work {
    fn new(kind: &'static Kind) -> Self {
        let place = kind.place();
        let expected = kind.whole(&place);
        place.ok(&[&kind.plan("work")[..], &["-q"]].concat());
        let mut work = Self { kind, place, expected, tasks: Vec::new() };
        let status = work.status();
        let ids = status["to_do"].as_array().unwrap().iter().map(|t| t["id"].as_str().unwrap());
        work.tasks = ids.filter(|id| *id != "finish").map(str::to_owned).collect();
        assert!(work.tasks.len() > 4, "{:?}", work.tasks);
        work
    }

    fn status(&self) -> Value {
        json(&self.place.ok(&["status", "work", "--json"]).out)
    }

    fn run(&self) -> Value {
        json(&self.place.ok(&["run", "work", "--json"]).out)
    }

    /// Does what is left in one of several ways; returns the tasks told to have been damaged.
    fn end(&self, way: &str) -> Vec<String> {
        let told = |args: &[&str]| {
            let report = json(&self.place.ok(&[args, &["--json"]].concat()).out);
            let damaged = report["damaged"].as_array().unwrap().clone();
            damaged.into_iter().map(|id| id.as_str().unwrap().to_owned()).collect::<Vec<_>>()
        };
        match way {
            "run" => told(&["run", "work"]),
            "finish" => told(&["finish", "work"]),
            _ => {
                let each = |task: &String| told(&["run", "work", "--task", task]);
                let mut all: Vec<_> = self.tasks.iter().flat_map(each).collect();
                all.extend(told(&["finish", "work"]));
                all
            }
        }
    }

    fn output(&self) -> PathBuf {
        self.place.path("work").join(self.kind.output)
    }

    fn check(&self, what: &str) {
        let same = contents(&self.output()) == self.expected;
        assert!(same, "{}, {what}: other bytes", self.kind.name);
    }

    fn objects(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.place.path("work/objects")).unwrap();
        let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        paths
    }
}

/// The task whose result a file is.
fn task_of(path: &std::path::Path) -> String {
    let name = path.file_name().unwrap().to_str().unwrap();
    name.rsplit_once('-').unwrap().0.to_owned()
}

/// Flips of each kind of plan, and where the environment asks for more.
fn flips() -> usize {
    std::env::var("TERRANE_FLIPS").map_or(32, |text| text.parse().unwrap())
}

#[test]
fn a_flipped_bit_anywhere_is_found_by_whoever_reads_it_and_made_good() {
    for kind in &KINDS {
        let work = Work::new(kind);
        work.run();
        let (mut state, mut tried) = (9_u64, 0);
        let objects = work.objects();
        for path in &objects {
            let sound = std::fs::read(path).unwrap();
            for _ in 0..flips().div_ceil(objects.len()) {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
                let (at, bit) = ((state >> 20) as usize % sound.len(), (state >> 60) as u32 % 8);
                let mut bytes = sound.clone();
                bytes[at] ^= 1 << bit;
                std::fs::write(path, &bytes).unwrap();
                remove(&work.output());
                let ways = ["finish", "run", "finish", "finish", "run", "finish", "tasks"];
                let way = ways[tried % ways.len()];
                let what = format!("{way}, {}, byte {at} bit {bit}", path.display());
                let told = work.end(way);
                work.check(&what);
                // Rows of tiles that a seam has done again are not read at the end.
                let is_unread = (kind.name, way) == ("tin", "finish") && told.is_empty();
                let told = if is_unread { work.end("run") } else { told };
                assert_eq!(told, [task_of(path)], "{what}");
                assert!(std::fs::read(path).unwrap() == sound, "{what} is the same again");
                tried += 1;
            }
        }
        assert!(tried >= 30, "{}: {tried}", kind.name);
    }
}

#[test]
fn a_run_after_the_end_looks_at_every_byte() {
    for kind in &KINDS {
        let work = Work::new(kind);
        work.run();
        let again = work.run();
        assert_eq!(again["found"], work.tasks.len(), "{again}");
        assert_eq!(again["found_bytes"], work.status()["object_bytes"], "{again}");
        // What is known of an object, and the object.
        for path in &work.objects()[..2] {
            let sound = std::fs::read(path).unwrap();
            let mut bytes = sound.clone();
            bytes[sound.len() / 2] ^= 4;
            std::fs::write(path, bytes).unwrap();
            let report = work.run();
            assert_eq!(report["damaged"], report["made"], "{report}");
            assert_eq!(report["made"][0], task_of(path), "{report}");
            assert!(std::fs::read(path).unwrap() == sound);
        }
        work.check("a run after the end");
    }
}

#[test]
fn truncated_emptied_and_lost_results_are_made_again() {
    for kind in &KINDS {
        let work = Work::new(kind);
        work.run();
        for (number, path) in work.objects().into_iter().enumerate() {
            let sound = std::fs::read(&path).unwrap();
            let way = ["run", "finish", "tasks", "finish", "run"][number % 5];
            let lost = number % 4 == 0;
            match number % 4 {
                0 => std::fs::remove_file(&path).unwrap(),
                1 => std::fs::write(&path, &sound[..sound.len() / 2]).unwrap(),
                2 => std::fs::write(&path, &sound[..sound.len() - 1]).unwrap(),
                _ => std::fs::write(&path, b"").unwrap(),
            }
            let what = format!("{way} after harm to {}", path.display());
            let left = work.status();
            let ids: Vec<_> = left["to_do"].as_array().unwrap().iter().map(|t| &t["id"]).collect();
            assert!(ids.contains(&&Value::from(task_of(&path))), "{what}: {left}");
            remove(&work.output());
            if lost && way == "finish" {
                let words = [&*task_of(&path), "is not done", "--task"];
                work.place.fails(&["finish", "work"], 69, &words);
                work.end("run");
            } else {
                work.end(way);
            }
            work.check(&what);
            assert!(std::fs::read(&path).unwrap() == sound, "{what} is the same again");
        }
        std::fs::remove_dir_all(work.place.path("work/objects")).unwrap();
        remove(&work.output());
        assert_eq!(work.run()["made"].as_array().unwrap().len(), work.tasks.len());
        work.check("all lost");
    }
}

/// Ends a process by the signal that cannot be caught.
fn kill(mut child: Child, after: u64) {
    std::thread::sleep(Duration::from_millis(after));
    let _ended_before = child.kill();
    child.wait().unwrap();
}

#[test]
fn killed_at_any_moment_whatever_is_done_stays_done() {
    for kind in &KINDS {
        for way in ["run", "tasks"] {
            let work = Work::new(kind);
            let start = |args: &[&str]| {
                let mut command = work.place.command(args);
                command.stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap()
            };
            let mut done = 0;
            for round in 0..5 {
                match way {
                    "run" => kill(start(&["run", "work", "-q"]), 13 * round + 5),
                    _ => {
                        let begin = |task| start(&["run", "work", "-q", "--task", task]);
                        let children: Vec<_> = work.tasks.iter().map(|t| begin(t)).collect();
                        children.into_iter().for_each(|child| kill(child, 3 * round));
                    }
                }
                let status = work.status();
                assert_eq!(status["damaged"].as_array().unwrap().len(), 0, "{status}");
                let now = status["done"].as_u64().unwrap();
                assert!(now >= done, "{}, {way}: {now} of {done}", kind.name);
                done = now;
            }
            assert_eq!(work.end(way), [""; 0], "nothing was damaged");
            work.check(way);
        }
    }
}

#[test]
fn tasks_are_done_beside_a_run_and_a_second_run_is_not() {
    for kind in &KINDS {
        let work = Work::new(kind);
        // As a run holds it.
        let lock = work.place.path("work/lock");
        let lock = std::fs::File::options().create(true).append(true).open(lock).unwrap();
        lock.lock().unwrap();
        work.place.fails(&["run", "work"], 69, &["locked by another run", "--task"]);
        work.end("tasks");
        work.check("beside a run");
        lock.unlock().unwrap();
        // As a task of an earlier version held it: a run does not wait for tasks either.
        lock.lock_shared().unwrap();
        drop(lock);
        work.run();
    }
}

#[test]
fn a_moved_folder_an_altered_output_and_a_missing_one_are_told_apart() {
    for kind in &KINDS {
        let work = Work::new(kind);
        work.run();
        let moved = work.place.path("moved");
        std::fs::rename(work.place.path("work"), &moved).unwrap();
        let output = moved.join(kind.output);
        let status = || json(&work.place.ok(&["status", "moved", "--json"]).out);
        let fault = || status()["output_fault"].as_str().unwrap_or_default().to_owned();
        let is_right = || contents(&output) == work.expected;

        assert_eq!(status()["output"], output.to_str().unwrap(), "moved, and all there");
        let report = json(&work.place.ok(&["run", "moved", "--json"]).out);
        assert_eq!(report["made"].as_array().unwrap().len(), 0, "{report}");

        let last = files(&output).pop().unwrap();
        let all = |files: &[PathBuf]| -> u64 {
            files.iter().map(|file| file.metadata().unwrap().len()).sum()
        };
        let length = all(&files(&output));
        let mut bytes = std::fs::read(&last).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&last, &bytes).unwrap();
        assert!(fault().contains("changed since it was written: content"), "{}", fault());
        for verb in [&["run", "moved"][..], &["finish", "moved"]] {
            work.place.fails(verb, 2, &["changed since", "content changed", "--overwrite"]);
        }
        work.place.ok(&["run", "moved", "--overwrite", "-q"]);
        assert!(is_right() && fault().is_empty(), "made anew when asked");

        bytes.push(0);
        std::fs::write(&last, &bytes).unwrap();
        let words = format!("size changed from {length} to {} bytes", length + 1);
        work.place.fails(&["finish", "moved"], 2, &["changed since", &words]);
        work.place.ok(&["finish", "moved", "--overwrite", "-q"]);
        assert!(is_right());

        remove(&output);
        assert!(fault().ends_with("is missing"), "{}", fault());
        assert_eq!(status()["to_do"][0]["id"], "finish");
        work.place.ok(&["run", "moved", "-q"]);
        assert!(is_right() && fault().is_empty(), "made again");

        let whole = format!("whole.{}", kind.ending);
        match output.is_dir() {
            true => {
                std::fs::create_dir(work.place.path(&whole)).unwrap();
                work.place.write(&format!("{whole}/mine"), "mine");
            }
            false => drop(work.place.write(&whole, "mine")),
        }
        work.place.fails(&["run", "moved", "-o", &whole], 2, &[&whole, "already exists"]);
    }
}

#[test]
fn a_mistyped_folder_makes_no_folder() {
    for kind in &KINDS {
        let place = kind.place();
        for verb in [&["run", "tpyo"][..], &["status", "tpyo"], &["finish", "tpyo"]] {
            place.fails(verb, 65, &["tpyo", "does not hold a plan"]);
        }
        place.fails(&["run", "tpyo", "--task", "finish"], 65, &["tpyo", "does not hold a plan"]);
        place.fails(&kind.plan("tpyo/work"), 73, &["tpyo/work", "make tpyo first"]);
        let work = Work::new(kind);
        let output = format!("tpyo/whole.{}", kind.ending);
        for verb in [&["run", "work", "-o", &output][..], &["finish", "work", &output]] {
            work.place.fails(verb, 73, &[&output, "first"]);
        }
        assert_eq!(work.status()["done"], 0, "told before the work");
    }
    for kind in KINDS.iter().filter(|kind| kind.verb != "grid") {
        let whole = format!("whole.{}", kind.ending);
        let single = [&kind.single(&whole)[..], &["--workdir", "tpyo/work"]].concat();
        kind.place().fails(&single, 73, &["tpyo/work", "make tpyo first"]);
    }
}

#[test]
fn too_little_memory_and_not_yet_have_codes_of_their_own() {
    for kind in &KINDS {
        let work = Work::new(kind);
        let first = work.tasks[0].as_str();
        let little = ["run", "work", "--task", first, "--memory", "1M"];
        work.place.fails(&little, 75, &["MiB of memory are needed", "--memory"]);
        work.place.fails(&["finish", "work"], 69, &[first, "is not done"]);
        let least = work.status()["least_memory"].as_u64().unwrap();
        let enough = least.div_ceil(1 << 20).to_string() + "M";
        work.place.ok(&["run", "work", "--memory", &enough, "-q"]);
        work.check("in the least memory told");
    }
}

#[test]
fn what_a_large_job_takes_is_told_before_it_is_begun() {
    let place = Place::new();
    let input = "synth:rough,size=80000";
    let info = place.ok(&["info", input]).out;
    for part in ["tin time", "tin memory", "tin disk", "for the mesh"] {
        assert!(info.contains(part), "{part} in\n{info}");
    }
    let plan = place.ok(&["plan", "tin", input, "-o", "work", "--max-error", "2"]).out;
    let row = |name: &str| {
        let line = plan.lines().find(|line| line.trim_start().starts_with(name));
        line.unwrap_or_else(|| panic!("{name} in\n{plan}")).to_owned()
    };
    assert!(row("time").contains("about"), "{plan}");
    assert!(row("memory").contains("at least"), "{plan}");
    assert!(row("disk").contains("more needed, about") && row("disk").contains("for the mesh"));
    let status = json(&place.ok(&["status", "work", "--json"]).out);
    let facts = json(&place.ok(&["info", input, "--json"]).out)["tin"].clone();
    let [low, high] = [0, 1].map(|i| facts["seconds"][i].as_f64().unwrap());
    let seconds = status["seconds"].as_f64().unwrap();
    assert!((low..=high).contains(&seconds), "{low} {seconds} {high}");
    assert!(status["disk_needed"].as_u64() > Some(1 << 30), "{status}");

    let cloud = "synth:cloud,size=20000,density=2";
    let how = ["--cell", "0.5", "--stat", "mean", "-o", "grid"];
    let plan = place.ok(&[&["plan", "grid", cloud], &how[..]].concat()).out;
    for part in ["time ", "memory ", "disk ", "for the grid"] {
        assert!(plan.contains(part), "{part} in\n{plan}");
    }
}

#[test]
fn a_disk_with_too_little_room_is_refused_unless_told_otherwise() {
    let place = Place::new();
    let input = "synth:rough,size=1000001";
    let how = ["--max-error", "0.01", "--format", "OBJ", "-q"];
    place.ok(&[&["plan", "tin", input, "-o", "work"], &how[..]].concat());
    place.fails(&["run", "work"], 73, &["of disk space are needed", "--no-disk-check"]);
    let mut command = place.command(&["run", "work", "--no-disk-check", "--progress", "json"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap()));
    let begun = lines.map_while(Result::ok).any(|line| line.contains("triangulate"));
    kill(child, 0);
    assert!(begun, "it began");
    let stray = ["tin", input, "a.ply", "--max-error", "1", "--no-disk-check"];
    place.fails(&stray, 2, &["--no-disk-check", "--workdir"]);
    let stray = ["tiles", "dem.asc", "t", "--no-disk-check"];
    crate::tiles::place(20).fails(&stray, 2, &["--no-disk-check", "--workdir"]);
}
