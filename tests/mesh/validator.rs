//! Our GLB files pass the Khronos validator without error or warning. Needs node and npm, and is run
//! when asked for.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::held::{self, Mesh};
use terrane_mesh::{self as mesh, SinkOptions};

const SCRIPT: &str = "
const validator = require('gltf-validator'), fs = require('fs');
const bytes = new Uint8Array(fs.readFileSync(process.argv[1]));
validator.validateBytes(bytes, { format: 'glb' })
    .then(report => console.log(JSON.stringify(report)))
    .catch(error => { console.error(error); process.exit(1); });
";

/// The version is fixed: other versions may find other things.
const PACKAGE: &str = "gltf-validator@2.0.0-dev.3.10";

/// A folder in whose `node_modules` the validator is, installed on first use beside other build
/// products.
fn home() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gltf-validator");
    if folder.join("node_modules/gltf-validator/package.json").exists() {
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
        PACKAGE,
    ];
    let npm = Command::new("npm").args(arguments).current_dir(&folder).output().unwrap();
    assert!(npm.status.success(), "{}", String::from_utf8_lossy(&npm.stderr));
    folder
}

fn validate(home: &Path, file: &Path) -> Output {
    Command::new("node").args(["-e", SCRIPT]).arg(file).current_dir(home).output().unwrap()
}

#[test]
#[ignore = "needs node and npm"]
fn the_validator_finds_nothing() {
    let home = home();
    let folder = tempfile::tempdir().unwrap();
    let empty = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    let points = Mesh { vertices: vec![held::ORIGIN; 3], triangles: Vec::new() };
    for (i, mesh) in [held::surface(1, 9), held::surface(50, 7), points, empty].iter().enumerate() {
        let path = folder.path().join(format!("{i}.glb"));
        let glb = mesh::by_path(&path, None).unwrap();
        held::write(glb, &path, mesh, &SinkOptions::default(), 100).unwrap();
        let output = validate(&home, &path);
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
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
