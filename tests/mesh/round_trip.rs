//! Every mesh format of the registry: what is pushed is read back, whichever way it is pushed.

use std::path::Path;

use crate::held::{self, Mesh, ORIGIN};
use terrane::ErrorKind;
use terrane_base::geom::Point3;
use terrane_mesh::{self as mesh, FORMATS, MeshFormat, SinkOptions};

fn file_name(format: &MeshFormat) -> String {
    format!("mesh.{}", format.extensions[0])
}

fn assert_near(found: &Point3, expected: &Point3, exact: bool) {
    for (f, e) in found.iter().zip(expected) {
        // Extents below 4096 leave f32 positions 2^-12 of rounding.
        let allowed = if exact { 0.0 } else { 1.0 / 4096.0 };
        assert!((f - e).abs() <= allowed, "{found:?} is not {expected:?}");
    }
}

fn assert_same(format: &MeshFormat, found: &Mesh, expected: &Mesh, indexed: bool) {
    let exact = !format.single_precision;
    let [found, expected] = [found, expected].map(|mesh| match format.name {
        // Compressed triangles may begin with another of their corners.
        "GLB-meshopt" => held::turned(mesh),
        _ => mesh.clone(),
    });
    let (found, expected) = (&found, &expected);
    if indexed {
        assert_eq!(found.triangles, expected.triangles);
        assert_eq!(found.vertices.len(), expected.vertices.len());
        for (f, e) in found.vertices.iter().zip(&expected.vertices) {
            assert_near(f, e, exact);
        }
    }
    let (found, expected) = (held::corners(found), held::corners(expected));
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert_near(f, e, exact);
    }
}

#[test]
fn what_is_pushed_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for mesh in [held::surface(1, 9), held::surface(70, 11)] {
        for format in FORMATS {
            let path = folder.path().join(file_name(format));
            let options = SinkOptions { overwrite: true, ..SinkOptions::default() };
            let bytes = held::write(format, &path, &mesh, &options, 1000).unwrap();
            assert_eq!(bytes, std::fs::metadata(&path).unwrap().len());
            let source = mesh::open(&path).unwrap();
            let info = source.info();
            assert_eq!(info.format, format.name);
            assert_eq!(info.single_precision, format.single_precision);
            assert_eq!(info.origin, if format.single_precision { ORIGIN } else { [0.0; 3] });
            assert_eq!(info.triangles, mesh.triangles.len() as u64);
            if format.name != "STL" {
                assert_eq!(info.crs.as_deref(), Some("EPSG:32611 (UTM zone 11N)"));
                assert!(info.details.iter().any(|(_, text)| text == "max error 1.5 metre"));
            }
            let own = if info.indexed { mesh.vertices.len() } else { 3 * mesh.triangles.len() };
            assert_eq!(info.vertices, own as u64);
            for batch in [1 << 20, 777] {
                let found = held::read(&*source, batch).unwrap();
                assert_same(format, &found, &mesh, info.indexed);
            }
            let mut beyond = [[0.0; 3]];
            assert!(source.read_vertices(info.vertices, &mut beyond).is_err());
            assert!(source.read_triangles(u64::MAX, &mut [[0; 3]]).is_err());
        }
    }
}

/// Formats that have coordinates of their own record how they come by them.
#[test]
fn positions_in_units_of_the_file_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let degrees = held::surface(9, 4);
    let origin = [7.25, 46.5, 0.0];
    let world = |v: &Point3| {
        let [x, y, z] = [0, 1, 2].map(|i| v[i] - [ORIGIN[0], ORIGIN[1], 0.0][i]);
        [origin[0] + x / 1e6, origin[1] + y / 1e6, z]
    };
    let vertices: Vec<Point3> = degrees.vertices.iter().map(world).collect();
    let corners: Vec<[Point3; 3]> =
        degrees.triangles.iter().map(|ids| ids.map(|id| vertices[id as usize])).collect();
    for format in FORMATS {
        let path = folder.path().join(file_name(format));
        for scale in [[1.0; 3], [76_500.25, 111_170.5, 1.0], [0.02, 0.02, 0.04]] {
            let header = mesh::MeshHeader { origin, scale, ..held::header() };
            let options = SinkOptions { overwrite: true, ..SinkOptions::default() };
            let mut sink = (format.create)(&path, &header, &options).unwrap();
            let corners = if sink.wants_corners() { &corners[..] } else { &[] };
            let triangles = &degrees.triangles;
            sink.push(mesh::MeshBatch { vertices: &vertices, values: &[], triangles, corners })
                .unwrap();
            sink.finish().unwrap();
            let source = mesh::open(&path).unwrap();
            let own = if format.single_precision { scale } else { [1.0; 3] };
            assert_eq!(source.info().scale, own, "{}", format.name);
            let found = held::read(&*source, 100).unwrap();
            let found = held::corners(&held::turned(&found));
            let expected = triangles.iter().map(|ids| ids.map(|id| vertices[id as usize]));
            for (found, expected) in found.iter().flatten().zip(expected.flatten()) {
                for i in 0..3 {
                    let rounding = (expected[i] - origin[i]).abs() * 1e-7;
                    let near = (found[i] - expected[i]).abs() <= rounding + 1e-14;
                    assert!(near, "{}: {found:?} is not {expected:?}", format.name);
                }
            }
        }
    }
}

/// f64 formats keep every bit, however odd the number; f32 formats keep heights that are f32.
#[test]
fn odd_numbers_survive() {
    let folder = tempfile::tempdir().unwrap();
    let values = [0.1, -1.0 / 3.0, 1e-7, 123_456_789.125, 4_000_000.000_000_1, -0.0, 5e-324];
    let z = [1.5, -3.25, 0.0, 8848.86, -432.65, 7.0, 0.1].map(|z: f32| f64::from(z));
    let wide: Vec<Point3> = (0..7).map(|i| [values[i], values[(i + 1) % 7], z[i]]).collect();
    let near: Vec<Point3> =
        (0..7).map(|i| [ORIGIN[0] + i as f64, ORIGIN[1] - 2.5 * i as f64, z[i]]).collect();
    for format in FORMATS.iter() {
        let vertices = if format.single_precision { near.clone() } else { wide.clone() };
        let mesh = Mesh { vertices, triangles: vec![[0, 1, 2], [2, 3, 4], [4, 5, 6]] };
        let path = folder.path().join(file_name(format));
        held::write(format, &path, &mesh, &SinkOptions::default(), 2).unwrap();
        let found = held::read(&*mesh::open(&path).unwrap(), 100).unwrap();
        let bits = |mesh: &Mesh| -> Vec<u64> {
            let turned = held::turned(mesh);
            held::corners(&turned).iter().flatten().flatten().map(|c| c.to_bits()).collect()
        };
        assert_eq!(bits(&found), bits(&mesh), "{}", format.name);
    }
}

#[test]
fn bytes_do_not_depend_on_batches() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = held::surface(60, 7);
    for format in FORMATS {
        for solid_base in [None, Some(-5.0)] {
            let bytes = [7, 256, 1 << 20].map(|batch| {
                let path = folder.path().join(file_name(format));
                let options = SinkOptions { overwrite: true, solid_base, temp_dir: None };
                held::write(format, &path, &mesh, &options, batch).unwrap();
                std::fs::read(&path).unwrap()
            });
            assert!(bytes[0] == bytes[1] && bytes[1] == bytes[2], "{}", format.name);
        }
    }
}

#[test]
fn empty_meshes_and_lone_vertices_are_files_too() {
    let folder = tempfile::tempdir().unwrap();
    let empty = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    let lone = Mesh { vertices: vec![ORIGIN; 4], triangles: Vec::new() };
    for format in FORMATS {
        for mesh in [&empty, &lone] {
            let path = folder.path().join(file_name(format));
            let options = SinkOptions { overwrite: true, ..SinkOptions::default() };
            held::write(format, &path, mesh, &options, 10).unwrap();
            let source = mesh::open(&path).unwrap();
            let found = held::read(&*source, 10).unwrap();
            assert_same(format, &found, mesh, source.info().indexed);
        }
    }
}

#[test]
fn a_dropped_sink_leaves_nothing() {
    let spools = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let folder = tempfile::tempdir().unwrap();
        let temp_dir = Some(spools.path().to_path_buf());
        let options = SinkOptions { temp_dir, ..SinkOptions::default() };
        let path = folder.path().join(file_name(format));
        let sink = (format.create)(&path, &held::header(), &options).unwrap();
        assert!(!path.exists());
        drop(sink);
        for place in [folder.path(), spools.path()] {
            assert_eq!(std::fs::read_dir(place).unwrap().count(), 0, "{}", format.name);
        }
    }
}

#[test]
fn nothing_is_replaced_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = held::surface(2, 9);
    for format in FORMATS {
        let path = folder.path().join(file_name(format));
        std::fs::write(&path, "precious").unwrap();
        let options = SinkOptions::default();
        let refused = held::write(format, &path, &mesh, &options, 10).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::Usage);
        assert_eq!(std::fs::read(&path).unwrap(), b"precious");
        let options = SinkOptions { overwrite: true, ..options };
        held::write(format, &path, &mesh, &options, 10).unwrap();
        assert!(mesh::open(&path).is_ok());
    }
}

#[test]
fn folders_that_are_not_there_are_refused_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing");
    for format in FORMATS {
        let start = |path: &Path, options: &SinkOptions| {
            (format.create)(path, &held::header(), options).err().unwrap()
        };
        let options = SinkOptions::default();
        let no_folder = start(&missing.join(file_name(format)), &options);
        let options = SinkOptions { temp_dir: Some(missing.clone()), ..options };
        let no_spool = start(&folder.path().join(file_name(format)), &options);
        for error in [no_folder, no_spool] {
            assert_eq!(error.kind(), ErrorKind::CannotWrite, "{error}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn formats_are_found_by_name_extension_and_content() {
    fn name(path: &str, name: Option<&str>) -> &'static str {
        mesh::by_path(Path::new(path), name).unwrap().name
    }
    for format in FORMATS {
        assert_eq!(name("x", Some(format.name)), format.name);
        assert_eq!(name("x.tif", Some(&format.name.to_lowercase())), format.name);
        for ending in format.extensions {
            assert_eq!(name(&format!("a.b.{}", ending.to_uppercase()), None), format.name);
        }
    }
    for error in [
        mesh::by_path(Path::new("mesh.xyz"), None).unwrap_err(),
        mesh::by_path(Path::new("mesh"), None).unwrap_err(),
        mesh::by_path(Path::new("mesh.ply"), Some("dwg")).unwrap_err(),
    ] {
        assert_eq!(error.kind(), ErrorKind::Usage);
        let text = error.to_string().to_lowercase();
        let is_told = |f: &MeshFormat| {
            text.contains(f.extensions[0]) || text.contains(&f.name.to_lowercase())
        };
        assert!(FORMATS.iter().all(is_told), "{text}");
    }
    let folder = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let path = folder.path().join(format!("{}.bin", format.name));
        let mesh = held::surface(3, 99);
        held::write(format, &path, &mesh, &SinkOptions::default(), 10).unwrap();
        assert_eq!(mesh::open(&path).unwrap().info().format, format.name);
    }
    let other = folder.path().join("other.txt");
    std::fs::write(&other, "ncols 3\nnrows 3\n").unwrap();
    assert_eq!(mesh::open(&other).err().unwrap().kind(), ErrorKind::BadInput);
    assert!(mesh::identify(&other).unwrap().is_none());
    assert_eq!(mesh::open(folder.path()).err().unwrap().kind(), ErrorKind::BadInput);
}
