//! Damaged and lying mesh files: an error or the right answer, never a panic, a hang, or memory
//! taken for what is not there.

use std::path::{Path, PathBuf};

use crate::held::{self, Mesh};
use terrane_base::{Error, ErrorKind};
use terrane_mesh::{self as mesh, FORMATS, SinkOptions};

struct Lab {
    folder: tempfile::TempDir,
}

impl Lab {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The bytes of a small sound file of the format.
    fn sound(&self, ending: &str) -> Vec<u8> {
        let path = self.path(&format!("sound.{ending}"));
        let format = mesh::by_path(&path, None).unwrap();
        let options = SinkOptions { overwrite: true, ..SinkOptions::default() };
        held::write(format, &path, &held::surface(2, 9), &options, 5).unwrap();
        std::fs::read(&path).unwrap()
    }

    /// Reads everything of a file with these bytes.
    fn read(&self, ending: &str, bytes: &[u8]) -> Result<Mesh, Error> {
        let path = self.path(&format!("bad.{ending}"));
        // A new file each time: some file systems put a file that is overwritten to disk at once.
        let _ = std::fs::remove_file(&path);
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    }

    fn refused(&self, ending: &str, bytes: &[u8]) -> String {
        let error = self.read(ending, bytes).expect_err("a bad file was read");
        let text = error.to_string();
        let kinds = [ErrorKind::BadInput, ErrorKind::Unsupported, ErrorKind::Limit];
        assert!(kinds.contains(&error.kind()), "{text}");
        assert_eq!(error.path(), Some(self.path(&format!("bad.{ending}")).as_path()), "{text}");
        assert!(!text.contains('\n'), "{text}");
        text
    }

    fn assert_refused(&self, ending: &str, bytes: &[u8], reason: &str) {
        let text = self.refused(ending, bytes);
        assert!(text.contains(reason), "\"{text}\" does not say \"{reason}\"");
    }
}

fn read(path: &Path) -> Result<Mesh, Error> {
    let source = mesh::open(path)?;
    let info = source.info();
    let bytes = std::fs::metadata(path).unwrap().len();
    // Of 256 equal vertices two bits for each group of 16 remain, of all of their 12 bytes.
    assert!(
        info.vertices <= 6 * bytes && info.triangles <= bytes,
        "counts beyond the file's bytes"
    );
    let mesh = held::read(&*source, 4)?;
    assert!(mesh.vertices.iter().flatten().all(|c| c.is_finite()));
    assert!(mesh.triangles.iter().flatten().all(|&id| id < info.vertices));
    Ok(mesh)
}

fn endings() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().map(|format| format.extensions[0])
}

#[test]
fn truncated_files_are_refused() {
    let lab = Lab::new();
    for ending in endings() {
        let sound = lab.sound(ending);
        let whole = lab.read(ending, &sound).unwrap();
        for length in 0..sound.len() {
            match lab.read(ending, &sound[..length]) {
                Err(error) => assert_ne!(error.kind(), ErrorKind::Io, "{error}"),
                // Text may end after any line, or within its last number.
                Ok(part) if ending == "obj" => {
                    assert!(part.triangles.len() <= whole.triangles.len());
                }
                // Other text ends in a line break, and nothing else may be missing.
                Ok(part) => {
                    assert_eq!((length, sound.last()), (sound.len() - 1, Some(&b'\n')), "{ending}");
                    assert_eq!(part, whole);
                }
            }
        }
    }
}

/// A small generator of repeatable noise (SplitMix64).
struct Noise(u64);

impl Noise {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % most as u64) as usize
    }
}

/// Changes, adds or removes a byte; in half of the cases one of the header.
fn mutate(bytes: &mut Vec<u8>, noise: &mut Noise) {
    let region = [400, usize::MAX][noise.below(2)].min(bytes.len());
    let at = noise.below(region);
    match noise.below(4) {
        0 => bytes[at] = noise.below(256) as u8,
        1 => bytes[at] ^= 1 << noise.below(8),
        2 => bytes.insert(at, b"9- \n"[noise.below(4)]),
        _ => drop(bytes.remove(at)),
    }
}

#[test]
fn mutated_files_never_panic() {
    let lab = Lab::new();
    let mut noise = Noise(7);
    for ending in endings() {
        let sound = lab.sound(ending);
        let mut refused = 0;
        for _ in 0..2500 {
            let mut bytes = sound.clone();
            for _ in 0..=noise.below(4) {
                mutate(&mut bytes, &mut noise);
            }
            refused += usize::from(lab.read(ending, &bytes).is_err());
        }
        assert!(refused > 100, "{ending}: only {refused} refused");
    }
}

fn with(text: &str, tail: &[u8]) -> Vec<u8> {
    [text.as_bytes(), tail].concat()
}

fn ply(vertices: &str, faces: &str, list: &str) -> String {
    format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\n\
         property float y\nproperty float z\nelement face {faces}\nproperty list {list}\n\
         end_header\n"
    )
}

#[test]
fn lying_ply_files() {
    let lab = Lab::new();
    let refuse = |text: &str, tail: &[u8], reason| {
        lab.assert_refused("ply", &with(text, tail), reason);
    };
    let list = "uchar int vertex_indices";
    for huge in ["4294967295", "18446744073709551615", "1537228672809129302"] {
        refuse(&ply(huge, "0", list), &[], "do not fit into");
        refuse(&ply("0", huge, list), &[], "do not fit into");
    }
    refuse(&ply("-1", "0", list), &[], "\"-1\" is not a count");
    refuse(&ply("18446744073709551616", "0", list), &[], "is not a count");
    let nan = f32::NAN.to_le_bytes().repeat(3);
    refuse(&ply("1", "0", list), &nan, "vertex 0: position is not finite");
    let face = |ids: [i32; 3], corners: u8| {
        [vec![0; 12], vec![corners], ids.map(i32::to_le_bytes).concat()].concat()
    };
    refuse(
        &ply("1", "1", list),
        &face([0, 0, 1], 3),
        "triangle 0: vertex 1 does not exist (the mesh has 1 vertices)",
    );
    refuse(&ply("1", "1", list), &face([0, -1, 0], 3), "vertex index -1 is negative");
    refuse(&ply("1", "1", list), &face([0, 0, 0], 4), "face 0: has 4 corners");
    let quad = [face([0, 0, 0], 4), vec![0; 4]].concat();
    refuse(&ply("1", "1", list), &quad, "has 4 surplus bytes");
    refuse(&ply("1", "1", "uchar float vertex_indices"), &face([0; 3], 3), "not integers");
    refuse(&ply("1", "1", "uchar int other"), &face([0; 3], 3), "no property list");
    refuse(&ply("0", "0", "uchar thing vertex_indices"), &[], "\"thing\" is not a PLY type");
    let ascii = ply("0", "0", list).replace("binary_little_endian", "ascii");
    refuse(&ascii, &[], "ASCII PLY");
    refuse(&ply("0", "0", list).replace("float y", "float w"), &[], "no property \"y\"");
    refuse(&ply("0", "0", list).replace("float y", "int y"), &[], "coordinates (y)");
    refuse(
        &ply("0", "0", list).replace("element vertex 0", ""),
        &[],
        "property without an element",
    );
    refuse("ply\nformat binary_little_endian 1.0\nend_header\n", &[], "no vertices");
    refuse("ply\nelement vertex 0\nproperty float x\n", &[], "header is truncated");
    refuse(&format!("ply\n{}", "comment x\n".repeat(2 << 20)), &[], "PLY header length");
    refuse(&format!("ply\n{}", "element a 1\n".repeat(2000)), &[], "number of PLY elements");
    let strips = ply("0", "0", list).replace("element face", "element tristrips");
    refuse(&strips, &[], "triangle strips");
}

#[test]
fn foreign_ply_files() {
    let lab = Lab::new();
    let header = "ply\r\nformat binary_big_endian 1.0\r\ncomment crs EPSG:4326\r\n\
        element camera 1\r\nproperty short id\r\nelement vertex 2\r\nproperty uchar red\r\n\
        property double x\r\nproperty float32 y\r\nproperty float z\r\nelement face 1\r\n\
        property ushort flags\r\nproperty list int ushort vertex_index\r\nproperty char end\r\n\
        element edge 1\r\nproperty list uchar int ends\r\nend_header\r\n";
    let mut bytes = with(header, &[0, 7]);
    for (x, y, z) in [(1.5_f64, 2.5_f32, -3.5_f32), (1e10, 0.0, 8.0)] {
        bytes.push(200);
        bytes.extend(x.to_be_bytes());
        bytes.extend([y.to_be_bytes(), z.to_be_bytes()].concat());
    }
    bytes.extend([0, 0, 0, 0, 0, 3, 0, 1, 0, 0, 0, 1, 9, 2, 0, 0, 0, 0, 0, 0, 0, 1]);
    let found = lab.read("ply", &bytes).unwrap();
    assert_eq!(found.vertices, [[1.5, 2.5, -3.5], [1e10, 0.0, 8.0]]);
    assert_eq!(found.triangles, [[1, 0, 1]]);
    let info = mesh::open(&lab.path("bad.ply")).unwrap().info().clone();
    assert_eq!(info.crs.as_deref(), Some("EPSG:4326"));
}

#[test]
fn lying_obj_files() {
    let lab = Lab::new();
    let refuse = |text: &str, reason| lab.assert_refused("obj", text.as_bytes(), reason);
    let v = "v 0 0 0\n".repeat(3);
    refuse(&format!("{v}f 1 2 4\n"), "line 4: vertex 4 does not exist (the mesh has 3 vertices)");
    refuse(&format!("{v}f 1 2 0\n"), "vertex 0 does not exist");
    refuse(&format!("{v}f -1 -2 -4\n"), "vertex -4 does not exist");
    refuse(&format!("{v}f 1 2 99999999999999999999\n"), "is not a number");
    refuse(&format!("{v}f 1 2 3 1\n"), "line 4: face has 4 corners");
    refuse(&format!("{v}f 1 2\n"), "fewer than three corners");
    refuse(&format!("{v}f 1 2 \\\n3\n"), "line continuation");
    refuse("v 0 0 nan\n", "line 1: position is not finite");
    refuse("v 0 0 1e999\n", "position is not finite");
    refuse("v 0 0\n", "fewer than three numbers");
    refuse("v 0 0 x\u{1b}\n", "\"x\\u{1b}\" is not a number");
    refuse("v 0 0 0\u{0}\n", "line 1: is not text");
    refuse("g nothing\n", "no vertices");
    refuse(&format!("v {}", "0".repeat(2 << 20)), "line length");
}

#[test]
fn foreign_obj_files() {
    let lab = Lab::new();
    let text = "# made elsewhere\r\nmtllib a.mtl\r\nv 1 2 3 1.0\r\n\tv -1.5e1 .5 6. 0.1 0.2 0.3\r\n\
        vt 0 0\nvn 0 0 1\no thing\nv 7 8 9\nf -3/1/1 -2//1 -1/1\ns off\nv 0 0 0\nf 1 2 5\nl 1 2\n\
        v\t10 11 12\n f  4 -1   -5 \n";
    let found = lab.read("obj", text.as_bytes()).unwrap();
    assert_eq!(found.vertices[1], [-15.0, 0.5, 6.0]);
    assert_eq!(found.vertices.len(), 5);
    assert_eq!(found.triangles, [[0, 1, 2], [0, 1, 4], [3, 4, 0]]);
}

#[test]
fn lying_stl_files() {
    let lab = Lab::new();
    let stl = |count: u32, tail: &[u8]| [&[b' '; 80], &count.to_le_bytes()[..], tail].concat();
    lab.assert_refused("stl", &stl(u32::MAX, &[]), "expected 214748364834");
    lab.assert_refused("stl", &stl(1, &[0; 49]), "has 133 bytes, expected 134 (1 triangles)");
    lab.assert_refused("stl", &stl(1, &[0; 51]), "has 135 bytes");
    lab.assert_refused("stl", &stl(1, &[0xff; 50]), "vertex 0: position is not finite");
    lab.assert_refused("stl", b"too short", "too short");
    let ascii = "solid a\n facet normal 0 0 1\n  outer loop\n".repeat(9);
    lab.assert_refused("stl", ascii.as_bytes(), "ASCII STL");
    // Many programs begin their binary files with "solid".
    let mut binary = stl(1, &[0; 50]);
    binary[..9].copy_from_slice(b"solid cad");
    assert_eq!(lab.read("stl", &binary).unwrap().triangles.len(), 1);
}

fn glb(json: &str, data: &[u8]) -> Vec<u8> {
    let mut json = json.to_owned();
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let word = |n: usize| (n as u32).to_le_bytes();
    let length = word(28 + json.len() + data.len());
    let head = [*b"glTF", word(2), length, word(json.len()), *b"JSON"].concat();
    [head, json.into_bytes(), word(data.len()).to_vec(), b"BIN\0".to_vec(), data.to_vec()].concat()
}

const FOREIGN_GLB: &str = r#"{"asset":{"version":"2.0","extras":7},"nodes":[{"mesh":0,
    "translation":[0,0,0],"scale":[1,1,1]}],"meshes":[{"primitives":[{"attributes":{"NORMAL":9,
    "POSITION":0},"indices":1}]}],"buffers":[{"byteLength":64}],
    "accessors":[{"bufferView":0,"byteOffset":4,"componentType":5126,"type":"VEC3","count":3},
    {"bufferView":1,"componentType":5123,"type":"SCALAR","count":3}],
    "bufferViews":[{"buffer":0,"byteLength":52,"byteStride":16},
    {"buffer":0,"byteOffset":52,"byteLength":6}]}"#;

/// Three positions (i, 10 i, 100 i) in records of 16 bytes, and the indices 2 1 0.
fn foreign_data() -> Vec<u8> {
    let mut data = Vec::new();
    for i in 0..3 {
        let i = i as f32;
        data.extend([-1.0, i, 10.0 * i, 100.0 * i].map(f32::to_le_bytes).concat());
    }
    data.extend([9, 9, 9, 9, 2, 0, 1, 0, 0, 0, 7, 7, 7, 7, 7, 7]);
    data
}

#[test]
fn foreign_glb_files() {
    let lab = Lab::new();
    let found = lab.read("glb", &glb(FOREIGN_GLB, &foreign_data())).unwrap();
    assert_eq!(found.vertices, [[0.0, 0.0, 0.0], [1.0, -100.0, 10.0], [2.0, -200.0, 20.0]]);
    assert_eq!(found.triangles, [[2, 1, 0]]);
    let loose = FOREIGN_GLB.replace(r#","indices":1"#, "");
    assert_eq!(lab.read("glb", &glb(&loose, &foreign_data())).unwrap().triangles, [[0, 1, 2]]);
}

#[test]
fn lying_glb_files() {
    let lab = Lab::new();
    let refuse = |from: &str, to: &str, reason: &str| {
        let json = FOREIGN_GLB.replace(from, to);
        assert!(from.is_empty() || json != FOREIGN_GLB, "{from} is not there");
        lab.assert_refused("glb", &glb(&json, &foreign_data()), reason);
    };
    for count in ["4", "4294967295", "18446744073709551615", "1152921504606846977"] {
        let counts = format!(r#""VEC3","count":{count}"#);
        refuse(r#""VEC3","count":3"#, &counts, "outside its buffer");
    }
    refuse(r#""SCALAR","count":3"#, r#""SCALAR","count":2"#, "indices (2) is not a multiple of 3");
    refuse(r#""count":3"#, r#""count":-3"#, "JSON: ");
    refuse(r#""byteOffset":52"#, r#""byteOffset":18446744073709551615"#, "outside its buffer");
    refuse(r#""byteLength":64"#, r#""byteLength":56"#, "outside its buffer");
    refuse(r#""byteStride":16"#, r#""byteStride":0"#, "byte stride of 0");
    refuse(r#""byteStride":16"#, r#""byteStride":8"#, "byte stride of 8");
    refuse(r#""indices":1"#, r#""indices":7"#, "no accessor 7");
    refuse(r#""indices":1"#, r#""indices":1,"mode":5"#, "mode 5");
    refuse("5126", "5123", "other than VEC3 of f32");
    refuse("5123", "5120", "component type 5120");
    refuse(r#""translation":[0,0,0]"#, r#""translation":[0,1,0]"#, "node 0 has a transform");
    refuse(r#""scale":[1,1,1]"#, r#""rotation":[0,0,1,0]"#, "node 0 has a transform");
    refuse(r#""nodes":["#, r#""nodes":[{"mesh":0},"#, "several nodes");
    refuse(r#""meshes":["#, r#""meshes":[{"primitives":[]},"#, "primitives");
    refuse(r#""buffers":[{"#, r#""buffers":[{"uri":"a.bin","#, "external buffers");
    refuse(r#""type":"VEC3""#, r#""type":"VEC3","sparse":{}"#, "sparse");
    let draco = r#""extensionsRequired":["KHR_draco_mesh_compression"],"nodes":["#;
    refuse(r#""nodes":["#, draco, "KHR_draco_mesh_compression");
    refuse(r#""asset""#, r#""asset"#, "JSON: ");
    let mut data = foreign_data();
    data[54] = 3;
    let beyond = glb(FOREIGN_GLB, &data);
    lab.assert_refused(
        "glb",
        &beyond,
        "triangle 0: vertex 3 does not exist (the mesh has 3 vertices)",
    );
    data[4..8].copy_from_slice(&f32::INFINITY.to_le_bytes());
    lab.assert_refused("glb", &glb(FOREIGN_GLB, &data), "vertex 0: position is not finite");
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    lab.assert_refused("glb", &glb(&deep, &[]), "JSON: ");
    lab.assert_refused("glb", &glb(&" ".repeat(2 << 20), &[]), "GLB JSON length");
    let mut old = glb(FOREIGN_GLB, &foreign_data());
    old[4] = 1;
    lab.assert_refused("glb", &old, "container version 1");
    let mut lying = glb(FOREIGN_GLB, &foreign_data());
    lying[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    lab.assert_refused("glb", &lying, "JSON chunk of 4294967295 bytes is truncated");
}

#[test]
fn lying_compressed_glb_files() {
    let lab = Lab::new();
    let sound = lab.sound("meshopt.glb");
    let data = sound.windows(4).position(|some| some == b"BIN\0").unwrap() + 4;
    let refuse = |from: &str, to: &str, reason: &str| {
        let to = format!("{to:0$}", from.len());
        assert_eq!(to.len(), from.len(), "{from} is as long as {to}");
        let mut bytes = sound.clone();
        let at = bytes.windows(from.len()).position(|some| some == from.as_bytes()).unwrap();
        bytes[at..at + from.len()].copy_from_slice(to.as_bytes());
        lab.assert_refused("meshopt.glb", &bytes, reason);
    };
    refuse(r#""count":9,"mode""#, r#""count":8,"mode""#, "outside its compressed buffer view");
    refuse(r#""ATTRIBUTES""#, r#""TRIANGLES" "#, "index type");
    refuse(r#""ATTRIBUTES""#, r#""INDICES"   "#, r#"mode "INDICES""#);
    refuse(r#""byteStride":12"#, r#""byteStride":13"#, "stride of 13 bytes");
    refuse(r#""byteStride":12"#, r#""byteStride":0 "#, "stride of 0 bytes");
    refuse(r#""byteOffset":0"#, r#""byteOffset":9"#, "type or version");
    refuse(r#""byteStride":4"#, r#""byteStride":2"#, "index type");
    refuse(r#""buffer":0"#, r#""buffer":1"#, "buffer 1");
    let with = |at: usize, byte: u8, reason: &str| {
        let mut bytes = sound.clone();
        bytes[at] = byte;
        lab.assert_refused("meshopt.glb", &bytes, reason);
    };
    with(data, 0xa1, "type or version");
    // Differences of a byte that take more room than there is, and less.
    with(data + 1, 3, "compressed buffer view");
    let triangles = sound[data..].iter().rposition(|byte| *byte == 0xe1).unwrap() + data;
    with(triangles, 0xe0, "type or version");
    with(triangles + 2, 0xeb, "vertex 4294967295 does not exist");
    with(sound.len() - 8, 0xff, "invalid table");
}
