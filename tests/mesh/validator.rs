//! Our GLB files pass the Khronos validator without error or warning, and the reference decoder of
//! compressed ones finds in them what plain ones hold. Needs node and npm, and is run when asked for.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::held::{self, Mesh};
use terrane_mesh::{self as mesh, SinkOptions};

const SCRIPT: &str = "
const validator = require('gltf-validator'), fs = require('fs');
const bytes = new Uint8Array(fs.readFileSync(process.argv[1]));
validator.validateBytes(bytes, { format: 'glb' })
    .then(report => console.log(JSON.stringify(report)))
    .catch(error => { console.error(error); process.exit(1); });
";

/// Decodes the buffer views of the first file, and prints whether they are those of the second one: corners of
/// triangles from the smallest on.
const DECODE: &str = "
const { MeshoptDecoder: decoder } = require('meshoptimizer'), fs = require('fs');
const read = name => {
    const bytes = fs.readFileSync(name), length = bytes.readUInt32LE(12);
    const json = JSON.parse(bytes.subarray(20, 20 + length));
    return { views: json.bufferViews, data: bytes.subarray(28 + length) };
};
const part = (data, { byteOffset = 0, byteLength }) => data.subarray(byteOffset, byteOffset + byteLength);
const turned = bytes => {
    const ids = new Uint32Array(Uint8Array.from(bytes).buffer);
    for (let i = 0; i < ids.length; i += 3)
        while (ids[i] > Math.min(ids[i + 1], ids[i + 2]))
            ids.set([ids[i + 1], ids[i + 2], ids[i]], i);
    return Buffer.from(ids.buffer);
};
decoder.ready.then(() => {
    const [packed, plain] = process.argv.slice(1).map(read);
    const same = packed.views.map((view, i) => {
        const how = view.extensions.EXT_meshopt_compression;
        const found = new Uint8Array(how.count * how.byteStride);
        const source = part(packed.data, how);
        decoder.decodeGltfBuffer(found, how.count, how.byteStride, source, how.mode, how.filter);
        const wanted = part(plain.data, plain.views[i]);
        return i == 1 ? turned(found).equals(turned(wanted)) : Buffer.from(found).equals(wanted);
    });
    console.log(JSON.stringify(same));
}).catch(error => { console.error(error); process.exit(1); });
";

/// The versions are fixed: other versions may find other things.
const PACKAGES: [&str; 2] = ["gltf-validator@2.0.0-dev.3.10", "meshoptimizer@1.3.0"];

/// A folder in whose `node_modules` the packages are, installed on first use beside other build
/// products. Tests run at the same time have one each.
fn home(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let is_there = |package: &&str| {
        let name = package.split('@').next().unwrap();
        folder.join("node_modules").join(name).join("package.json").exists()
    };
    if PACKAGES.iter().all(is_there) {
        return folder;
    }
    std::fs::create_dir_all(&folder).unwrap();
    let arguments = [
        "install",
        "--fetch-retries=0",
        "--fetch-timeout=30000",
        "--no-audit",
        "--no-fund",
        "--prefix",
        ".",
    ];
    let npm =
        Command::new("npm").args(arguments).args(PACKAGES).current_dir(&folder).output().unwrap();
    assert!(npm.status.success(), "{}", String::from_utf8_lossy(&npm.stderr));
    folder
}

fn node(home: &Path, script: &str, files: &[&Path]) -> String {
    let output =
        Command::new("node").args(["-e", script]).args(files).current_dir(home).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Meshes large and small, without triangles, and without anything.
fn meshes() -> [Mesh; 4] {
    let empty = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    let points = Mesh { vertices: vec![held::ORIGIN; 3], triangles: Vec::new() };
    [held::surface(1, 9), held::surface(50, 7), points, empty]
}

#[test]
#[ignore = "needs node and npm"]
fn the_validator_finds_nothing() {
    let home = home("gltf-validator");
    let folder = tempfile::tempdir().unwrap();
    for (i, mesh) in meshes().iter().enumerate() {
        for ending in ["glb", "meshopt.glb"] {
            let path = folder.path().join(format!("{i}.{ending}"));
            let glb = mesh::by_path(&path, None).unwrap();
            held::write(glb, &path, mesh, &SinkOptions::default(), 100).unwrap();
            let text = node(&home, SCRIPT, &[&path]);
            let report: serde_json::Value = serde_json::from_str(&text).unwrap();
            let issues = &report["issues"];
            assert_eq!(
                (&issues["numErrors"], &issues["numWarnings"]),
                (&0.into(), &0.into()),
                "{text}"
            );
            assert_eq!(report["info"]["totalTriangleCount"], mesh.triangles.len(), "{text}");
        }
    }
}

#[test]
#[ignore = "needs node and npm"]
fn the_reference_decoder_finds_what_is_in_plain_files() {
    let home = home("meshopt");
    let folder = tempfile::tempdir().unwrap();
    let meshes = meshes().into_iter().chain([held::surface(300, 1001)]);
    for (i, mesh) in meshes.filter(|mesh| !mesh.vertices.is_empty()).enumerate() {
        let paths = ["meshopt.glb", "glb"].map(|end| folder.path().join(format!("{i}.{end}")));
        for path in &paths {
            let glb = mesh::by_path(path, None).unwrap();
            held::write(glb, path, &mesh, &SinkOptions::default(), 100).unwrap();
        }
        let found = node(&home, DECODE, &[&paths[0], &paths[1]]);
        let views = if mesh.triangles.is_empty() { "[true]" } else { "[true,true]" };
        assert_eq!(found.trim(), views);
    }
}
