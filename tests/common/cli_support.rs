//! Runs the real binary in a folder of its own.
#![allow(dead_code, unreachable_pub)]

use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// A 4 x 3 grid with one void, as ESRI ASCII.
pub const GRID: &str = "ncols 4\nnrows 3\nxllcorner 100\nyllcorner 200\ncellsize 10\n\
                        NODATA_value -9999\n1 2 3 4\n5 9 7 8\n9 10 11 -9999\n";

/// The same without any height.
pub const VOID_GRID: &str = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n\
                             NODATA_value -9999\n-9999 -9999\n-9999 -9999\n";

/// What a report says.
pub fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

/// A folder to run in; it goes with the value.
pub struct Place {
    folder: TempDir,
}

/// What a run left behind.
#[derive(Debug)]
pub struct Ran {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Place {
    /// What a file holds.
    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> &Self {
        std::fs::write(self.path(name), bytes).unwrap();
        self
    }

    /// Names of all files here, sorted.
    pub fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap().flatten();
        let mut names: Vec<_> =
            entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrane"));
        command.args(args).current_dir(self.folder.path());
        // Made when a file of a server is read.
        command.env("TERRANE_CACHE", self.path("cache"));
        command
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        Ran::from(self.command(args).output().unwrap())
    }

    /// Runs and expects success.
    pub fn ok(&self, args: &[&str]) -> Ran {
        let ran = self.run(args);
        assert_eq!(ran.code, 0, "{args:?}: {}{}", ran.out, ran.err);
        ran
    }

    /// Runs and expects a one-line error with exit code `code` that says each of `words`, and no
    /// new file.
    pub fn fails(&self, args: &[&str], code: i32, words: &[&str]) {
        let before = self.files();
        let ran = self.run(args);
        assert_eq!(ran.code, code, "{args:?}: {}", ran.err);
        assert_eq!(ran.out, "", "{args:?}");
        assert!(ran.err.starts_with("terrane: error: "), "{args:?}: {}", ran.err);
        assert_eq!(ran.err.lines().count(), 1, "{args:?}: {}", ran.err);
        assert!(ran.err.contains("; "), "no remedy, {args:?}: {}", ran.err);
        for word in words {
            assert!(ran.err.contains(word), "{word:?} missing, {args:?}: {}", ran.err);
        }
        assert_eq!(self.files(), before, "{args:?}");
    }

    /// The memory that a run with `memory` is told to ask for, in an error that says each of `words`.
    pub fn advised(&self, args: &[&str], memory: &str, words: &[&str]) -> String {
        let args = [args, &["--memory", memory]].concat();
        self.fails(&args, 75, words);
        let told = self.run(&args).err;
        let advised = told.split("--memory ").nth(1).and_then(|rest| rest.split([' ', ',']).next());
        advised.unwrap_or_else(|| panic!("no memory, {args:?}: {told}")).to_owned()
    }

    /// Expects a run with `memory` to be refused and one with what is advised to succeed.
    pub fn ok_as_advised(&self, args: &[&str], memory: &str, words: &[&str]) {
        let advised = self.advised(args, memory, words);
        self.ok(&[args, &["--memory", &advised]].concat());
    }
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let code = output.status.code().unwrap_or(-1);
        Self { code, out: text(output.stdout), err: text(output.stderr) }
    }
}

/// A grid beside `GRID`, `column` columns of four samples to the east.
pub fn beside(column: u32) -> String {
    GRID.replace("xllcorner 100", &format!("xllcorner {}", 100 + 40 * column))
}

/// Folders of grids, clouds and features, each with three good files and two bad ones, one of them
/// deeper.
pub fn batch() -> Place {
    let place = Place::new();
    for folder in ["g/deep", "c/deep", "f/deep"] {
        std::fs::create_dir_all(place.path(folder)).unwrap();
    }
    for (i, name) in ["g/a.asc", "g/c.asc", "g/deep/e.asc"].into_iter().enumerate() {
        place.write(name, beside(i as u32));
    }
    for (i, name) in ["c/a.laz", "c/c.laz", "c/deep/e.laz"].into_iter().enumerate() {
        let cloud = format!("cloud,size=30,density=1,seed={i}");
        place.ok(&["synth", &cloud, name, "-q"]);
    }
    for name in ["f/a.geojson", "f/c.geojson", "f/deep/e.geojson"] {
        let line = r#"{"type":"LineString","coordinates":[[0,0],[1,0.1],[2,0]]}"#;
        place.write(name, line);
    }
    place.write("g/b.asc", "ncols 4\nnrows").write("g/d.asc", "");
    place.write("c/b.laz", "LASF").write("c/d.laz", "no cloud");
    place.write("f/b.geojson", r#"{"type":"LineStr"#).write("f/d.geojson", "{");
    place
}

/// A synthetic photograph: red, green, blue and opacity of a pixel; discs before a sky.
pub fn colour(col: usize, row: usize) -> [u8; 4] {
    let (x, y) = (col as i32, row as i32);
    let discs =
        [(30, 22, 15, [220, 60, 40]), (70, 44, 19, [40, 150, 70]), (58, 15, 9, [250, 220, 60])];
    let sky = [110 + y, 160 + y / 2 + (x * 7 + y * 3) % 5, 230 - y - x / 4];
    let of = |&(cx, cy, radius, base): &(i32, i32, i32, [i32; 3])| {
        let far = (x - cx).pow(2) + (y - cy).pow(2);
        (far < radius * radius).then(|| base.map(|c| c - c * far / (radius * radius) / 2))
    };
    let [red, green, blue] = discs.iter().rev().find_map(of).unwrap_or(sky).map(|c| c as u8);
    [red, green, blue, 255 - (x / 2) as u8]
}

/// The photograph as a PNG, of three channels, or of four.
pub fn photograph([width, height]: [usize; 2], channels: usize) -> Vec<u8> {
    let pixels =
        (0..width * height).flat_map(|i| colour(i % width, i / width).into_iter().take(channels));
    let (mut out, data) = (Vec::new(), pixels.collect::<Vec<u8>>());
    let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
    encoder.set_color(if channels == 4 { png::ColorType::Rgba } else { png::ColorType::Rgb });
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    out
}
