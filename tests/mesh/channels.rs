//! What vertices have beside their positions is written, and read back from any vertex on.

use crate::held;
use terrane::ErrorKind;
use terrane_mesh::ChannelKind::{self, Byte, Double, Single};
use terrane_mesh::{self as mesh, MeshBatch, MeshHeader, MeshSource, SinkOptions, VertexChannel};

const VERTICES: usize = 700;

fn value(vertex: usize, channel: usize, kind: ChannelKind) -> f64 {
    let whole = ((vertex * 7 + channel * 31) % 256) as f64;
    match kind {
        Byte => whole,
        Single => f64::from((whole - 100.3) as f32),
        Double => whole / 7.0 - 1e9,
    }
}

fn values(channels: &[VertexChannel]) -> Vec<f64> {
    let of = |vertex| channels.iter().enumerate().map(move |(i, c)| value(vertex, i, c.kind));
    (0..VERTICES).flat_map(of).collect()
}

/// Writes a mesh of two triangles in batches, with these channels.
fn write(path: &std::path::Path, channels: &[VertexChannel]) -> terrane::Result<u64> {
    let header = MeshHeader { channels: channels.to_vec(), ..held::header() };
    let format = mesh::by_path(path, None)?;
    let options = SinkOptions { overwrite: true, ..SinkOptions::default() };
    let mut sink = (format.create)(path, &header, &options)?;
    let vertices: Vec<_> = (0..VERTICES).map(|i| [i as f64, (i * i % 97) as f64, 1.0]).collect();
    let all = values(channels);
    for (batch, values) in vertices.chunks(111).zip(all.chunks(111 * channels.len())) {
        sink.push(MeshBatch { vertices: batch, values, triangles: &[], corners: &[] })?;
    }
    let triangles = [[0, 1, 2], [1, 699, 2]];
    sink.push(MeshBatch { vertices: &[], values: &[], triangles: &triangles, corners: &[] })?;
    sink.finish()
}

fn check(source: &dyn MeshSource, channels: &[VertexChannel]) {
    let (count, all) = (channels.len(), values(channels));
    let names: Vec<_> = channels.iter().map(|channel| channel.name.clone()).collect();
    assert_eq!(source.info().channels, names);
    for (first, vertices) in [(0, VERTICES), (13, 300), (VERTICES - 1, 1), (5, 0)] {
        let mut found = vec![-1.0; vertices * count];
        source.read_channels(first as u64, &mut found).unwrap();
        assert_eq!(found, all[first * count..(first + vertices) * count]);
    }
    let mut beyond = vec![0.0; count];
    assert!(source.read_channels(VERTICES as u64, &mut beyond).is_err());
    let (mut points, mut triangles) = ([[0.0; 3]; 3], [[0; 3]; 2]);
    source.read_vertices(4, &mut points).unwrap();
    source.read_triangles(0, &mut triangles).unwrap();
    assert_eq!(points, [[4.0, 16.0, 1.0], [5.0, 25.0, 1.0], [6.0, 36.0, 1.0]]);
    // Compressed triangles may begin with another of their corners.
    let turned = triangles.map(|[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min());
    assert_eq!(turned, [Some([0, 1, 2]), Some([1, 699, 2])]);
}

#[test]
fn channels_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for kinds in [
        &[Byte, Byte, Byte][..],
        &[Byte, Byte, Byte, Byte],
        &[Byte],
        &[Single, Double],
        &[Double, Byte, Single, Single, Byte],
    ] {
        let bands: Vec<_> = (1..).zip(kinds.iter().copied()).collect();
        let channels = VertexChannel::of_bands(&bands);
        let path = folder.path().join("a.ply");
        let bytes = write(&path, &channels).unwrap();
        assert_eq!(bytes, std::fs::metadata(&path).unwrap().len());
        check(&*mesh::open(&path).unwrap(), &channels);
        let is_colour = channels[0].name == "red";
        for name in ["a.glb", "a.meshopt.glb"] {
            let path = folder.path().join(name);
            match write(&path, &channels) {
                Ok(_) => assert!(is_colour),
                Err(error) => {
                    assert!(!is_colour && error.kind() == ErrorKind::Usage, "{error}");
                    continue;
                }
            }
            let source = mesh::open(&path).unwrap();
            let mut origin = [[0.0; 3]];
            source.read_vertices(0, &mut origin).unwrap();
            check(&*source, &channels);
        }
    }
}

#[test]
fn values_that_are_missing_or_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let channels = VertexChannel::of_bands(&[(1, Byte), (2, Byte), (3, Byte)]);
    let header = MeshHeader { channels, ..held::header() };
    for name in ["a.ply", "a.glb", "a.meshopt.glb"] {
        for values in [&[1.0, 2.0][..], &[1.0, 2.0, 256.0], &[1.0, 0.5, 2.0], &[f64::NAN, 1.0, 2.0]]
        {
            let path = folder.path().join(name);
            let format = mesh::by_path(&path, None).unwrap();
            let mut sink = (format.create)(&path, &header, &SinkOptions::default()).unwrap();
            let batch =
                MeshBatch { vertices: &[held::ORIGIN], values, triangles: &[], corners: &[] };
            assert!(sink.push(batch).is_err(), "{name} {values:?}");
        }
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A PLY of one vertex with these properties, as others write it.
fn foreign(properties: &str, record: &[u8]) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_big_endian 1.0\nelement vertex 1\n{properties}element face 0\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    [header.as_bytes(), record].concat()
}

#[test]
fn colours_of_other_programs_are_found_wherever_they_lie() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.ply");
    let xyz = [0_u8; 12];
    let place = "property float x\nproperty float y\nproperty float z\n";
    let colours = "property uchar alpha\nproperty uchar blue\nproperty uchar green\n\
                   property short quality\nproperty uchar red\n";
    let record = [&xyz[..], &[4, 3, 2, 9, 9, 1]].concat();
    std::fs::write(&path, foreign(&format!("{place}{colours}"), &record)).unwrap();
    let source = mesh::open(&path).unwrap();
    assert_eq!(source.info().channels, ["red", "green", "blue", "alpha"]);
    let mut found = [0.0; 4];
    source.read_channels(0, &mut found).unwrap();
    assert_eq!(found, [1.0, 2.0, 3.0, 4.0]);
    // Two of three, or colours that are no bytes, are none.
    for (other, bytes) in [
        ("property uchar red\nproperty uchar green\n", 2),
        ("property float red\nproperty float green\nproperty float blue\n", 12),
    ] {
        let record = [&xyz[..], &vec![0; bytes]].concat();
        std::fs::write(&path, foreign(&format!("{place}{other}"), &record)).unwrap();
        assert!(mesh::open(&path).unwrap().info().channels.is_empty(), "{other}");
    }
}
