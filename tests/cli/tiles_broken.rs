//! `terrane verify` on broken tiles: whatever is done to a sound set, what is wrong with it is named.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use terrane_proof::tiles::TilesetFault;

use crate::cli_support::{Place, json as parsed};
use crate::tiles::{place, walk};

/// A sound set, unpacked so that its bytes can be changed.
fn sound() -> Place {
    let place = place(100);
    place.ok(&["tiles", "dem.asc", "t", "--no-gzip", "-q"]);
    place
}

/// A file of the finest level with triangles whose corners were all used before.
fn tile(place: &Place) -> PathBuf {
    let all = walk(place, "t");
    let is_it = |name: &&String| {
        name.starts_with("14/") && Bytes::of(&place.path("t").join(name)).later().is_some()
    };
    place.path("t").join(all.iter().rev().find(is_it).expect("a tile of several triangles"))
}

/// A tile's bytes, and where things are in them.
struct Bytes {
    bytes: Vec<u8>,
}

impl Bytes {
    fn of(path: &Path) -> Self {
        Self { bytes: fs::read(path).unwrap() }
    }

    fn number(&self, at: usize) -> usize {
        u32::from_le_bytes(self.bytes[at..at + 4].try_into().unwrap()) as usize
    }

    fn short(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes[at..at + 2].try_into().unwrap())
    }

    fn vertices(&self) -> usize {
        self.number(88)
    }

    /// Where the count of triangles is.
    fn triangles(&self) -> usize {
        92 + 6 * self.vertices()
    }

    /// Where the list of the western side begins, with its count.
    fn sides(&self) -> usize {
        self.triangles() + 4 + 6 * self.number(self.triangles())
    }

    /// Where the normals begin.
    fn normals(&self) -> usize {
        let skip = |at: usize| at + 4 + 2 * self.number(at);
        let extensions = skip(skip(skip(skip(self.sides()))));
        assert_eq!(self.bytes[extensions], 1);
        extensions + 5
    }

    /// Where the first triangle is whose corners were all used before.
    fn later(&self) -> Option<usize> {
        let first = self.triangles() + 4;
        let starts = (0..self.number(self.triangles())).map(|i| first + 6 * i);
        starts.into_iter().find(|at| (0..3).all(|k| self.short(at + 2 * k) > 0))
    }

    fn double(&mut self, at: usize, change: impl Fn(f64) -> f64) {
        let old = f64::from_le_bytes(self.bytes[at..at + 8].try_into().unwrap());
        self.bytes[at..at + 8].copy_from_slice(&change(old).to_le_bytes());
    }

    /// Raises all heights by so many metres.
    fn raise(&mut self, by: f32) {
        for at in [24, 28] {
            let old = f32::from_le_bytes(self.bytes[at..at + 4].try_into().unwrap());
            self.bytes[at..at + 4].copy_from_slice(&(old + by).to_le_bytes());
        }
    }

    fn swap(&mut self, a: usize, b: usize) {
        (0..2).for_each(|k| self.bytes.swap(a + k, b + k));
    }

    /// Moves a vertex along an axis (u, v, height) by so many steps; those after it stay where they are.
    fn step(&mut self, vertex: usize, axis: usize, by: i32) {
        let run = 92 + 2 * axis * self.vertices();
        self.differ(run + 2 * vertex, by);
        if vertex + 1 < self.vertices() {
            self.differ(run + 2 * vertex + 2, -by);
        }
    }

    /// Adds to a zig-zag coded difference.
    fn differ(&mut self, at: usize, by: i32) {
        let code = i32::from(self.short(at));
        let value = ((code >> 1) ^ -(code & 1)) + by;
        let code = ((value << 1) ^ (value >> 31)) as u16;
        self.bytes[at..at + 2].copy_from_slice(&code.to_le_bytes());
    }

    /// u and v of a vertex.
    fn place(&self, vertex: usize) -> [i32; 2] {
        [0, 1].map(|axis| {
            let run = 92 + 2 * axis * self.vertices();
            let codes = (0..=vertex).map(|i| i32::from(self.short(run + 2 * i)));
            codes.map(|code| (code >> 1) ^ -(code & 1)).sum()
        })
    }

    /// Adds a vertex where the last one is, with its normal, to no triangle.
    fn grow(&mut self) {
        let (count, normals) = (self.vertices(), self.normals());
        let last = normals + 2 * count - 2;
        let normal = [self.bytes[last], self.bytes[last + 1]];
        self.bytes.splice(last + 2..last + 2, normal);
        self.bytes[normals - 4..normals].copy_from_slice(&(2 * count as u32 + 2).to_le_bytes());
        (1..=3).rev().for_each(|axis| {
            let end = 92 + 2 * axis * count;
            self.bytes.splice(end..end, [0, 0]);
        });
        self.bytes[88..92].copy_from_slice(&(count as u32 + 1).to_le_bytes());
    }

    /// Puts another number where the error is told, of as many places.
    fn tell(&mut self, digit: u8) {
        let key = b"\"error\":";
        let at = self.bytes.windows(key.len()).rposition(|w| w == key).unwrap() + key.len();
        for byte in self.bytes[at..].iter_mut().take_while(|byte| **byte != b'}') {
            if byte.is_ascii_digit() {
                *byte = digit;
            }
        }
    }
}

/// What is told, and the change that makes it so: of a tile, of the index, of the files.
type Change = (&'static str, fn(&mut Bytes));
type ChangeOfIndex = (&'static str, fn(&mut Value));
type ChangeOfFiles = (&'static str, fn(&Place));

const CHANGES: [Change; 25] = [
    ("clockwise triangles", |t| {
        let at = t.later().unwrap();
        t.swap(at, at + 2);
    }),
    ("triangles without area", |t| {
        let at = t.later().unwrap();
        let first = t.short(at);
        t.bytes[at + 2..at + 4].copy_from_slice(&first.to_le_bytes());
    }),
    ("edges of one triangle inside", |t| {
        let at = t.later().unwrap();
        let first = t.short(at);
        t.bytes[at + 2..at + 4].copy_from_slice(&first.to_le_bytes());
    }),
    ("lists of the vertices of a side", |t| {
        let (first, last) = (t.sides() + 4, t.sides() + 2 + 2 * t.number(t.sides()));
        let other = t.short(first);
        t.bytes[last..last + 2].copy_from_slice(&other.to_le_bytes());
    }),
    ("normals that do not point outwards", |t| {
        let at = t.normals();
        let count = t.vertices();
        t.bytes[at..at + 2 * count].iter_mut().for_each(|byte| *byte = 255 - *byte);
    }),
    ("samples further from the surface", |t| t.raise(64.0)),
    ("tiles with a larger error than they record", |t| t.tell(b'0')),
    ("record a larger error than the tolerance", |t| t.tell(b'9')),
    ("borders whose vertices or heights differ", |t| t.raise(0.125)),
    ("not a multiple of the height step", |t| t.raise(0.03125)),
    ("borders with a larger gap", |t| t.raise(64.0)),
    ("vertices outside the bounding sphere", |t| t.double(56, |radius| radius / 2.0)),
    ("whose centre is far from", |t| t.double(0, |x| x + 1e5)),
    ("where the horizon occlusion point is hidden", |t| {
        (64..88).step_by(8).for_each(|at| t.double(at, |x| x * 0.9))
    }),
    ("lower or higher than all samples", |t| t.raise(4096.0)),
    ("without the metadata that layer.json announces", |t| {
        let text = t.bytes.iter().rposition(|byte| *byte == b'{').unwrap();
        t.bytes[text - 9] = 77;
    }),
    ("edges of more than two triangles, or passed twice", |t| {
        let at = t.later().unwrap();
        t.swap(at, at + 2);
    }),
    ("sides of tiles without edges", |t| {
        let corner = (0..t.vertices()).find(|vertex| t.place(*vertex) == [0, 0]).unwrap();
        t.step(corner, 0, 1);
    }),
    ("differ from the tile in area", |t| {
        let corner = (0..t.vertices()).find(|vertex| t.place(*vertex) == [0, 0]).unwrap();
        t.step(corner, 1, 1);
    }),
    ("duplicate vertices", |t| {
        let [first, second] = [0, 1].map(|vertex| t.place(vertex));
        (0..2).for_each(|axis| t.step(1, axis, first[axis] - second[axis]));
    }),
    ("unused vertices", Bytes::grow),
    ("without the normals that layer.json announces", |t| {
        let at = t.normals();
        t.bytes[at - 5] = 77;
    }),
    ("whose minimum height exceeds the maximum", |t| {
        (24..28).for_each(|at| t.bytes.swap(at, at + 4));
    }),
    ("height step does not divide", |t| {
        let high = f32::from_le_bytes(t.bytes[28..32].try_into().unwrap());
        t.bytes[28..32].copy_from_slice(&(high + 1.0).to_le_bytes());
    }),
    ("tiles without a recorded error", |t| {
        let key = b"\"error\":";
        let at = t.bytes.windows(key.len()).rposition(|w| w == key).unwrap();
        t.bytes[at + 1] = b'E';
    }),
];

const CHANGES_OF_INDEX: [ChangeOfIndex; 9] = [
    ("does not list as extensions", |l| l["extensions"] = json!(["metadata"])),
    ("larger tolerance than clients assume", |l| {
        l["terrane"]["levels"][3]["tolerance"] = json!(1e5)
    }),
    ("larger error than layer.json states", |l| {
        l["terrane"]["levels"].as_array_mut().unwrap().last_mut().unwrap()["error"] = json!(0.001)
    }),
    ("another number of tiles", |l| l["terrane"]["levels"][2]["tiles"] = json!(77)),
    ("bounds that do not contain all samples", |l| l["bounds"][0] = json!(7.04)),
    ("bounds beyond the world", |l| l["bounds"][3] = json!(91.0)),
    ("not listed as available", |l| *finest(l) = json!([])),
    ("listed twice as available", |l| {
        let ranges = finest(l).as_array_mut().unwrap();
        ranges.push(ranges[0].clone());
    }),
    ("missing tiles listed as available", |l| {
        l["available"][9] = json!([{"startX": 0, "startY": 0, "endX": 0, "endY": 0}]);
    }),
];

const CHANGES_OF_FILES: [ChangeOfFiles; 6] = [
    ("another compression than most", |p| {
        let (path, mut packed) = (tile(p), Vec::new());
        let mut packer = flate2::write::GzEncoder::new(&mut packed, flate2::Compression::fast());
        packer.write_all(&fs::read(&path).unwrap()).unwrap();
        packer.finish().unwrap();
        fs::write(path, packed).unwrap();
    }),
    ("missing tiles with samples", |p| fs::remove_file(tile(p)).unwrap()),
    ("wrong list of the tiles below them", |p| fs::remove_file(tile(p)).unwrap()),
    ("missing roots", |p| fs::remove_file(p.path("t/0/0/0.terrain")).unwrap()),
    ("tiles without samples", |p| {
        fs::create_dir(p.path("t/14/5")).unwrap();
        fs::copy(tile(p), p.path("t/14/5/5.terrain")).unwrap();
    }),
    ("neither layer.json nor a tile", |p| fs::write(p.path("t/14/mine.txt"), "mine").unwrap()),
];

/// What is available of the finest level.
fn finest(layer: &mut Value) -> &mut Value {
    layer["available"].as_array_mut().unwrap().last_mut().unwrap()
}

/// What a proof says in place of what is wrong: nothing where that is among what it says.
fn unnamed(place: &Place, what: &str) -> Option<String> {
    let ran = place.run(&["verify", "t", "dem.asc", "--json"]);
    if ran.code != 1 {
        return Some(format!("{what}: exit code {}: {}", ran.code, ran.err));
    }
    let told = parsed(&ran.out)["failures"].to_string();
    (!told.contains(what)).then(|| format!("{what} is not in {told}"))
}

#[test]
fn there_is_a_change_for_every_fault() {
    let of_tiles = CHANGES.iter().map(|(what, _)| *what);
    let others = CHANGES_OF_INDEX.iter().map(|(what, _)| *what);
    let others = others.chain(CHANGES_OF_FILES.iter().map(|(what, _)| *what));
    let all = of_tiles.chain(others).chain(crate::tiles_three::named());
    let all: Vec<_> =
        all.chain(crate::tiles_skirts::NAMED).chain(crate::tiles_water::NAMED).collect();
    let all = [all, crate::tiles_fields::NAMED.to_vec()].concat();
    for (fault, _, told) in TilesetFault::ALL {
        let of_three = told.replace("layer.json", "tileset.json");
        let is_it = |what: &&str| told.contains(what) || of_three.contains(what);
        assert!(all.iter().any(is_it), "{fault:?}: {told}");
    }
}

#[test]
fn every_change_of_a_tile_is_named() {
    let place = sound();
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    let path = tile(&place);
    let whole = Bytes::of(&path).bytes;
    let unnamed = CHANGES.iter().filter_map(|(what, change)| {
        let mut bytes = Bytes { bytes: whole.clone() };
        change(&mut bytes);
        assert!(bytes.bytes != whole, "{what}");
        fs::write(&path, bytes.bytes).unwrap();
        unnamed(&place, what)
    });
    assert_eq!(unnamed.collect::<Vec<_>>(), Vec::<String>::new());
    fs::write(&path, &whole).unwrap();
    place.ok(&["verify", "t", "dem.asc", "-q"]);
}

#[test]
fn every_change_of_the_index_is_named() {
    let place = sound();
    let path = place.path("t/layer.json");
    let whole: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    for (what, change) in CHANGES_OF_INDEX {
        let mut layer = whole.clone();
        change(&mut layer);
        fs::write(&path, layer.to_string()).unwrap();
        assert_eq!(unnamed(&place, what), None);
    }
}

#[test]
fn every_change_of_the_files_is_named() {
    for (what, change) in CHANGES_OF_FILES {
        let place = sound();
        change(&place);
        assert_eq!(unnamed(&place, what), None);
    }
}

/// What tiles of every tenth level list below them.
#[test]
fn wrong_lists_of_what_is_below_are_named() {
    let place = sound();
    let all = walk(&place, "t");
    let path = place.path("t").join(all.iter().find(|name| name.starts_with("10/")).unwrap());
    let mut bytes = Bytes::of(&path).bytes;
    let key = b"\"startX\":";
    let at = bytes.windows(key.len()).position(|w| w == key).unwrap() + key.len();
    bytes[at] = if bytes[at] == b'1' { b'2' } else { b'1' };
    fs::write(&path, bytes).unwrap();
    assert_eq!(unnamed(&place, "wrong list of the tiles below them"), None);
}

#[test]
fn files_that_are_no_tiles_are_named_and_the_others_proved() {
    let place = sound();
    let path = tile(&place);
    let name = path.file_name().unwrap().to_str().unwrap();
    let whole = Bytes::of(&path).bytes;
    let mut lies: Vec<Vec<u8>> =
        vec![Vec::new(), b"no tile".to_vec(), whole[..whole.len() / 2].to_vec()];
    let with = |change: fn(&mut Bytes)| {
        let mut bytes = Bytes { bytes: whole.clone() };
        change(&mut bytes);
        bytes.bytes
    };
    lies.push(with(|t| t.bytes[88..92].copy_from_slice(&u32::MAX.to_le_bytes())));
    lies.push(with(|t| {
        let at = t.triangles();
        t.bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    }));
    lies.push(with(|t| {
        let at = t.triangles() + 4;
        t.bytes[at..at + 2].copy_from_slice(&9_u16.to_le_bytes());
    }));
    lies.push(with(|t| t.double(64, |_| f64::NAN)));
    lies.push(with(|t| t.bytes.push(0)));
    // Packed: torn, with a lie about the length, and far longer than so few bytes can be.
    let packed = |bytes: &[u8]| {
        let mut packer = libdeflater::Compressor::new(libdeflater::CompressionLvl::default());
        let mut out = vec![0; packer.gzip_compress_bound(bytes.len())];
        let size = packer.gzip_compress(bytes, &mut out).unwrap();
        out.truncate(size);
        out
    };
    let sound = packed(&whole);
    lies.push(sound[..sound.len() - 9].to_vec());
    for length in [0_u32, 7, 60_000_000, u32::MAX] {
        let mut lie = sound.clone();
        let end = lie.len() - 4;
        lie[end..].copy_from_slice(&length.to_le_bytes());
        lies.push(lie);
    }
    lies.push([&sound[..], b"more"].concat());
    lies.push(packed(&vec![0; 65 << 20]));
    let mut damaged = sound.clone();
    damaged[sound.len() / 2] ^= 0x55;
    lies.push(damaged);
    for (i, lie) in lies.iter().enumerate() {
        fs::write(&path, lie).unwrap();
        let ran = place.run(&["verify", "t", "dem.asc", "--json"]);
        let told = parsed(&ran.out);
        let failures = told["failures"].as_array().unwrap();
        assert!(ran.code == 1 && failures.len() == 1, "{i}: {} {told}", ran.code);
        let says = |word: &str| failures[0].as_str().unwrap().contains(word);
        assert!(says(name) && says("cannot be read"), "{i}: {told}");
    }
    // The same bytes, packed, are the same tile, and nothing else is wrong with it.
    fs::write(&path, sound).unwrap();
    assert_eq!(unnamed(&place, "another compression than most"), None);
    let told = parsed(&place.run(&["verify", "t", "dem.asc", "--json"]).out);
    assert_eq!(told["failures"].as_array().unwrap().len(), 1, "{told}");
    fs::write(&path, whole).unwrap();
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    place.write("t/layer.json", "{");
    place.fails(&["verify", "t", "dem.asc"], 65, &["layer.json"]);
}
