//! Both codecs beside a port of the reference implementation, both ways.

use meshoptimizer_rs::codec::{self, IndexEncoding, VertexEncoding};
use meshoptimizer_rs::{Limits, Workspace};
use proptest::prelude::*;

use super::attributes;
use super::stream::{MeshoptCodec, MeshoptStream, MeshoptWindow};
use super::triangles;
use crate::input::MeshFile;

fn space() -> Workspace {
    Workspace::new(Limits::default())
}

/// A file with some bytes before a stream, and behind it.
struct Lab {
    _file: tempfile::NamedTempFile,
    input: MeshFile,
    span: (u64, u64),
}

impl Lab {
    fn new(stream: &[u8]) -> Self {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), [&[7; 13], stream, &[9; 40]].concat()).unwrap();
        let input = MeshFile::open(file.path()).unwrap();
        Self { _file: file, input, span: (13, stream.len() as u64) }
    }

    fn read<C: MeshoptCodec>(&self, codec: C, ranges: &[(u64, usize)]) -> Vec<Vec<u8>> {
        let stream = MeshoptStream::with_marks(codec, 3);
        let read = |&(first, count): &(u64, usize)| {
            let mut found = Vec::new();
            let keep = |place: usize, element: &[u8]| {
                assert_eq!(place * element.len(), found.len());
                found.extend_from_slice(element);
                Ok(())
            };
            stream.read(&self.input, first, count, keep).map(|()| found)
        };
        ranges.iter().map(|range| read(range).unwrap()).collect()
    }

    fn attributes(&self, stride: usize, count: u64) -> attributes::MeshoptAttributeReader {
        attributes::MeshoptAttributeReader::new(
            &mut MeshoptWindow::new(&self.input),
            self.span.0,
            self.span.1,
            stride,
            count,
        )
        .unwrap()
    }

    fn triangles(&self, count: u64) -> triangles::MeshoptTriangleReader {
        triangles::MeshoptTriangleReader::new(
            &mut MeshoptWindow::new(&self.input),
            self.span.0,
            self.span.1,
            count,
        )
        .unwrap()
    }
}

/// All of `count` things, and parts of them in odd order.
fn ranges(count: usize) -> Vec<(u64, usize)> {
    let part =
        |from: usize, to: usize| ((from * count / 8) as u64, to * count / 8 - from * count / 8);
    vec![(0, count), part(5, 8), part(0, 3), part(3, 5), part(6, 7), part(2, 2)]
}

fn encoded(elements: &[u8], stride: usize, batch: usize) -> Vec<u8> {
    let mut writer = attributes::MeshoptAttributeWriter::new(stride);
    let mut stream = Vec::new();
    for some in elements.chunks(batch * stride) {
        writer.push(some, &mut stream);
    }
    writer.complete(&mut stream);
    stream
}

/// Elements of bytes that change by as much as `wildness` says.
fn elements(count: usize, stride: usize, seed: u64, wildness: u32) -> Vec<u8> {
    let mut noise = seed | 1;
    let mut value = vec![0_u8; stride];
    let mut all = Vec::new();
    for _ in 0..count {
        for byte in &mut value {
            noise = noise.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
            let bits = (noise >> 33) as u32 % (wildness + 1);
            let step = (noise >> 40) as u32 % (1 << bits);
            *byte = byte.wrapping_add(step as u8).wrapping_sub((1_u32 << bits >> 1) as u8);
        }
        all.extend_from_slice(&value);
    }
    all
}

/// Triangles that share edges, more or less.
fn mesh(steps: &[(u8, u8)]) -> Vec<[u32; 3]> {
    let mut all: Vec<[u32; 3]> = Vec::new();
    let mut most = 0;
    for &(how, far) in steps {
        let back = |by: u8| all[all.len().saturating_sub(1 + usize::from(by) % 20)];
        let triangle = match how % 6 {
            _ if all.is_empty() => [0, 1, 2],
            0 | 1 => [back(far)[0], back(far)[2], most + 1],
            2 => [back(far)[2], back(far)[1], back(far / 2)[0]],
            3 => [most + 1, most + 2, most + 3],
            4 => [u32::from(far) * 70_000, back(1)[2] + 1, u32::MAX - 1],
            _ => [most + 1, back(far)[1], back(2)[0].wrapping_sub(1)],
        };
        // No vertex has the last of all numbers.
        let triangle = triangle.map(|id| id.min(u32::MAX - 1));
        most = most.max(*triangle.iter().filter(|id| **id < 1 << 20).max().unwrap_or(&most));
        all.push(triangle);
    }
    all
}

/// Begun with the smallest corner.
fn turned([a, b, c]: [u32; 3]) -> [u32; 3] {
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()
}

fn ids(bytes: &[u8]) -> Vec<[u32; 3]> {
    let words: Vec<u32> =
        bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
    words.as_chunks().0.iter().map(|corners| turned(*corners)).collect()
}

proptest! {
    #[test]
    fn attributes_are_those_of_the_reference(
        count in 1_usize..1500, words in 1_usize..65, batch in 1_usize..700, seed in any::<u64>(),
        wildness in 0_u32..9,
    ) {
        let stride = 4 * words;
        let elements = elements(count, stride, seed, wildness);
        let stream = encoded(&elements, stride, batch);
        let found = codec::decode_vertex_buffer(count, stride, &stream, &mut space());
        prop_assert!(found.unwrap() == elements);
        let encoding = VertexEncoding::new(0, 0).unwrap();
        let theirs =
            codec::encode_vertex_buffer(&elements, count, stride, encoding, &mut space());
        let theirs = theirs.unwrap();
        prop_assert!(stream.len() <= theirs.len());
        for stream in [stream, theirs] {
            let lab = Lab::new(&stream);
            let ranges = ranges(count);
            let found = lab.read(lab.attributes(stride, count as u64), &ranges);
            for (found, (first, count)) in found.iter().zip(ranges) {
                let first = first as usize * stride;
                prop_assert!(*found == elements[first..first + count * stride]);
            }
        }
    }

    #[test]
    fn triangles_are_those_of_the_reference(
        steps in prop::collection::vec(any::<(u8, u8)>(), 1..3000),
    ) {
        let all = mesh(&steps);
        let (mut codes, mut data) = (triangles::MeshoptTriangleWriter::HEAD.to_vec(), Vec::new());
        let mut writer = triangles::MeshoptTriangleWriter::new();
        all.iter().for_each(|triangle| writer.push(*triangle, &mut codes, &mut data));
        let stream = [&codes[..], &data, &triangles::MeshoptTriangleWriter::TAIL].concat();
        let expected: Vec<_> = all.iter().map(|triangle| turned(*triangle)).collect();
        let count = 3 * all.len();
        let found = codec::decode_index_buffer(count, 4, &stream, &mut space()).unwrap();
        prop_assert!(ids(&found) == expected);
        let theirs = codec::encode_index_buffer(
            all.as_flattened(), IndexEncoding::DEFAULT, &mut space(),
        ).unwrap();
        for stream in [stream, theirs] {
            let lab = Lab::new(&stream);
            let ranges = ranges(all.len());
            let found = lab.read(lab.triangles(all.len() as u64), &ranges);
            for (found, (first, count)) in found.iter().zip(ranges) {
                let first = first as usize;
                prop_assert!(ids(found)[..] == expected[first..first + count]);
            }
        }
    }
}

/// The example of the specification.
#[test]
fn a_group_of_the_specification() {
    let bytes = [
        0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5, // a group of 4 bits
    ];
    let differences = [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0];
    let mut value = 0_u8;
    let mut values = Vec::new();
    for difference in differences {
        value = value.wrapping_add(difference as i8 as u8);
        values.extend([value, 0, 0, 0]);
    }
    let lab = Lab::new(&[&[0xa0, 2], &bytes[..], &[0, 0, 0], &[0; 32]].concat());
    let found = lab.read(lab.attributes(4, 16), &[(0, 16)]).remove(0);
    assert_eq!(found, values);
}

#[test]
fn streams_of_the_wrong_length_are_refused() {
    let elements = elements(300, 12, 5, 8);
    let stream = encoded(&elements, 12, 300);
    let lab = Lab::new(&stream);
    let open = |bytes, stride, count| {
        let window = &mut MeshoptWindow::new(&lab.input);
        attributes::MeshoptAttributeReader::new(window, lab.span.0, bytes, stride, count)
    };
    for (bytes, stride, count) in
        [(90, 12, 300), (lab.span.1, 12, u64::MAX), (lab.span.1, 0, 1), (lab.span.1, 260, 1)]
    {
        assert!(open(bytes, stride, count).is_err(), "{bytes} {stride} {count}");
    }
    for wrong in [lab.span.1 - 1, lab.span.1 + 1] {
        let stream = MeshoptStream::new(open(wrong, 12, 300).unwrap());
        assert!(stream.read(&lab.input, 290, 1, |_, _| Ok(())).is_err(), "{wrong}");
    }
}
