//! Decoder of EXT_meshopt_compression (Khronos 2021), independent of the encoder: attributes (version 0), triangles and
//! index sequences (version 1), and the octahedral filter.

use terrane_base::error::{Error, Result};

/// Elements of a group, whose differences take the same number of bits.
const GROUP: usize = 16;
/// Limits of a block of attributes.
const MAX_BLOCK_BYTES: usize = 8192;
const MAX_BLOCK_ELEMENTS: usize = 256;
/// Minimum bytes at the end of a stream of attributes.
const ATTRIBUTES_TAIL: usize = 32;
/// Bytes at the end of a stream of triangles: the table of the most frequent pairs.
const TRIANGLES_TAIL: usize = 16;
/// Bytes at the end of an index sequence.
const LIST_TAIL: usize = 4;

/// The bytes not yet read.
struct ProofMeshoptBytes<'a>(&'a [u8]);

impl<'a> ProofMeshoptBytes<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let (found, rest) = self.0.split_at_checked(count).ok_or_else(|| bad("end too early"))?;
        self.0 = rest;
        Ok(found)
    }

    fn byte(&mut self) -> Result<u8> {
        Ok(self.take(1)?[0])
    }

    /// A number of seven bits a byte, the lowest first.
    fn number(&mut self) -> Result<u32> {
        let mut number = 0;
        for place in 0..5 {
            let byte = self.byte()?;
            number |= u32::from(byte & 127) << (7 * place);
            if byte < 128 {
                return Ok(number);
            }
        }
        Err(bad("contain a number of more than 5 bytes"))
    }

    /// The number of a vertex, as its difference from another.
    fn vertex(&mut self, from: &mut u32) -> Result<u32> {
        let number = self.number()?;
        *from = from.wrapping_add(signed(number));
        Ok(*from)
    }

    /// A known vertex, or else one that is stored as its difference from another.
    fn known_or_vertex(&mut self, known: Option<u32>, from: &mut u32) -> Result<u32> {
        known.map_or_else(|| self.vertex(from), Ok)
    }

    fn end(&self) -> Result<()> {
        if self.0.is_empty() { Ok(()) } else { Err(bad("are followed by further bytes")) }
    }
}

/// Even numbers are steps forwards, odd ones backwards.
fn signed(number: u32) -> u32 {
    if number.is_multiple_of(2) { number / 2 } else { !(number / 2) }
}

/// The elements of a stream of attributes: `count` of `stride` bytes.
///
/// # Errors
/// Bad input.
pub(super) fn attributes(bytes: &[u8], stride: usize, count: usize) -> Result<Vec<u8>> {
    if !stride.is_multiple_of(4) || !(4..=256).contains(&stride) {
        return Err(bad("have elements of another size"));
    }
    // One byte is the head of four groups of one byte of the elements: no memory is allocated for absent elements.
    if count.div_ceil(4 * GROUP).checked_mul(stride).is_none_or(|min| min > bytes.len()) {
        return Err(bad("are too few bytes"));
    }
    let tail = ATTRIBUTES_TAIL.max(stride);
    let body = bytes.len().checked_sub(tail).ok_or_else(|| bad("are too few bytes"))?;
    let mut last = bytes[bytes.len() - stride..].to_vec();
    let mut left = ProofMeshoptBytes(&bytes[..body]);
    if left.byte()? != 0xa0 {
        return Err(bad("are of another version"));
    }
    let max = (MAX_BLOCK_BYTES / stride / GROUP * GROUP).min(MAX_BLOCK_ELEMENTS);
    let mut out = vec![0; count * stride];
    for block in out.chunks_mut(max * stride) {
        for (offset, last) in last.iter_mut().enumerate() {
            column(block, offset, stride, last, &mut left)?;
        }
    }
    left.end()?;
    Ok(out)
}

/// Decodes the byte at an offset of all elements of a block, as differences from the last one.
fn column(
    block: &mut [u8],
    offset: usize,
    stride: usize,
    last: &mut u8,
    left: &mut ProofMeshoptBytes<'_>,
) -> Result<()> {
    let groups = (block.len() / stride).div_ceil(GROUP);
    let heads = left.take(groups.div_ceil(4))?;
    for group in 0..groups {
        let steps = steps(heads[group / 4] >> (group % 4 * 2) & 3, left)?;
        let of_group = block.chunks_exact_mut(stride).skip(group * GROUP);
        for (element, step) in of_group.zip(steps) {
            *last = last.wrapping_add(signed(step.into()) as u8);
            element[offset] = *last;
        }
    }
    Ok(())
}

/// The steps of a group, of 0, 2, 4 or 8 bits each; the largest value of 2 or 4 bits is an escape for a full byte.
fn steps(kind: u8, left: &mut ProofMeshoptBytes<'_>) -> Result<[u8; GROUP]> {
    let bits = match kind {
        0 => return Ok([0; GROUP]),
        1 => 2,
        2 => 4,
        _ => 8,
    };
    let packed = left.take(2 * bits)?;
    let mask = u8::MAX >> (8 - bits);
    let mut found = [0; GROUP];
    for (at, step) in found.iter_mut().enumerate() {
        let bit = at * bits;
        *step = packed[bit / 8] >> (8 - bits - bit % 8) & mask;
        if bits < 8 && *step == mask {
            *step = left.byte()?;
        }
    }
    Ok(found)
}

/// The edges or vertices of earlier triangles, which codes refer to from the last one backwards.
struct MeshoptRecent<T>(Vec<T>);

impl<T: Copy> MeshoptRecent<T> {
    fn push(&mut self, item: T) {
        self.0.push(item);
    }

    fn ago(&self, count: usize) -> Result<T> {
        let index = self.0.len().checked_sub(count + 1);
        index
            .and_then(|index| self.0.get(index).copied())
            .ok_or_else(|| bad("refer to items before the first"))
    }
}

/// The next new vertex.
fn next_vertex(next: &mut u32) -> u32 {
    *next += 1;
    *next - 1
}

/// Decodes the `count` corners of a stream of triangles.
///
/// # Errors
/// Bad input.
pub(super) fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>> {
    let number = count / 3;
    let body = bytes.len().checked_sub(TRIANGLES_TAIL).filter(|body| *body > number);
    let body = body.filter(|_| count.is_multiple_of(3)).ok_or_else(|| bad("are too few bytes"))?;
    if bytes[0] != 0xe1 {
        return Err(bad("are of another version"));
    }
    let (codes, pairs) = (&bytes[1..=number], &bytes[body..]);
    let mut data = ProofMeshoptBytes(&bytes[number + 1..body]);
    let (mut edges, mut vertices) = (MeshoptRecent(Vec::new()), MeshoptRecent(Vec::new()));
    let [mut next, mut last] = [0_u32; 2];
    let mut out = Vec::with_capacity(count);
    for code in codes {
        let (high, low) = (usize::from(code >> 4), code & 15);
        if high < 15 {
            let [a, b] = edges.ago(high)?;
            let is_known = (1..13).contains(&low);
            let c = match low {
                0 => next_vertex(&mut next),
                13 | 14 => {
                    last = if low == 13 { last.wrapping_sub(1) } else { last.wrapping_add(1) };
                    last
                }
                15 => data.vertex(&mut last)?,
                known => vertices.ago(known.into())?,
            };
            if !is_known {
                vertices.push(c);
            }
            edges.push([c, b]);
            edges.push([a, c]);
            out.extend([a, b, c]);
            continue;
        }
        let pair = if low < 14 { pairs[usize::from(low)] } else { data.byte()? };
        if low >= 14 && pair == 0 {
            next = 0;
        }
        let a = if low == 15 { None } else { Some(next_vertex(&mut next)) };
        // New vertices are numbered before the stored ones are read.
        let mut others = [None; 2];
        for (other, place) in others.iter_mut().zip([pair >> 4, pair & 15]) {
            *other = match place {
                0 => Some(next_vertex(&mut next)),
                15 => None,
                known => Some(vertices.ago(usize::from(known) - 1)?),
            };
        }
        let a = data.known_or_vertex(a, &mut last)?;
        let b = data.known_or_vertex(others[0], &mut last)?;
        let c = data.known_or_vertex(others[1], &mut last)?;
        vertices.push(a);
        for (corner, place) in [(b, pair >> 4), (c, pair & 15)] {
            if matches!(place, 0 | 15) {
                vertices.push(corner);
            }
        }
        edges.push([b, a]);
        edges.push([c, b]);
        edges.push([a, c]);
        out.extend([a, b, c]);
    }
    data.end()?;
    Ok(out)
}

/// Decodes the `count` vertices of an index sequence.
///
/// # Errors
/// Bad input.
pub(super) fn list(bytes: &[u8], count: usize) -> Result<Vec<u32>> {
    let body = bytes.len().checked_sub(LIST_TAIL).filter(|body| *body > count);
    let body = body.ok_or_else(|| bad("are too few bytes"))?;
    let mut left = ProofMeshoptBytes(&bytes[..body]);
    if left.byte()? != 0xd1 {
        return Err(bad("are of another version"));
    }
    // The lowest bit selects one of two baselines.
    let mut baselines = [0_u32; 2];
    let mut vertices = Vec::with_capacity(count);
    for _ in 0..count {
        let number = left.number()?;
        let baseline = &mut baselines[number as usize & 1];
        *baseline = baseline.wrapping_add(signed(number >> 1));
        vertices.push(*baseline);
    }
    left.end()?;
    Ok(vertices)
}

/// Decodes oct-encoded directions in place: of four bytes each, the first two are a point of the octahedron, and the third
/// stands for 1.
pub(super) fn directions(elements: &mut [u8]) {
    for element in elements.as_chunks_mut::<4>().0 {
        let [x, y, unit] = [0, 1, 2].map(|at: usize| f32::from(element[at] as i8));
        let z = unit - x.abs() - y.abs();
        let fold = z.min(0.0);
        let [x, y] = [x, y].map(|value| if value >= 0.0 { value + fold } else { value - fold });
        let scale = f32::from(i8::MAX) / (x * x + y * y + z * z).sqrt();
        let bytes = [x, y, z].map(|value| (value * scale).round() as i8 as u8);
        element[..3].copy_from_slice(&bytes);
    }
}

fn bad(what: &str) -> Error {
    Error::bad_input(format!("has compressed elements that {what}"))
}

#[cfg(test)]
mod tests {
    use meshoptimizer_rs::{Workspace, codec};
    use proptest::prelude::*;

    use super::*;

    fn of_version_1() -> codec::IndexEncoding {
        codec::IndexEncoding::new(1).unwrap()
    }

    /// Numbers that are mostly near the one before.
    fn numbers() -> impl Strategy<Value = Vec<u32>> {
        let step = prop_oneof![8 => -3..4_i64, 1 => -300..300_i64, 1 => -70_000..70_000_i64];
        prop::collection::vec(step, 0..700).prop_map(|steps| {
            let sums = steps.into_iter().scan(0_i64, |at, step| {
                *at = (*at + step).clamp(0, 100_000);
                Some(*at as u32)
            });
            sums.collect()
        })
    }

    proptest! {
        /// Streams of a port of the reference encoder are decoded, and every shorter stream is refused.
        #[test]
        fn streams_of_the_reference_are_decoded(values in numbers(), stride in 1..5_usize, cut in 0.0..1.0) {
            let space = &mut Workspace::default();
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            let (stride, count) = (4 * stride, bytes.len() / (4 * stride));
            let bytes = &bytes[..count * stride];
            let version = codec::VertexEncoding::new(0, 2).unwrap();
            let packed = codec::encode_vertex_buffer(bytes, count, stride, version, space).unwrap();
            prop_assert_eq!(&attributes(&packed, stride, count).unwrap()[..], bytes);
            let short = (packed.len() as f64 * cut) as usize;
            let _ = attributes(&packed[..short], stride, count);
            prop_assert!(attributes(&packed, stride, count + 300).is_err());

            let packed = codec::encode_index_sequence(&values, of_version_1(), space).unwrap();
            prop_assert_eq!(&list(&packed, values.len()).unwrap(), &values);
            let short = (packed.len() as f64 * cut) as usize;
            prop_assert!(list(&packed[..short], values.len()).is_err());

            let corners = &values[..values.len() / 3 * 3];
            let packed = codec::encode_index_buffer(corners, of_version_1(), space).unwrap();
            let found = triangles(&packed, corners.len()).unwrap();
            for (a, b) in found.chunks(3).zip(corners.chunks(3)) {
                let is_turned = (0..3).any(|k| (0..3).all(|i| a[i] == b[(i + k) % 3]));
                prop_assert!(is_turned, "{a:?} {b:?}");
            }
            let short = (packed.len() as f64 * cut) as usize;
            prop_assert!(triangles(&packed[..short], corners.len()).is_err());
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300), count in 0..400_usize) {
            for head in [0xa0, 0xe1, 0xd1] {
                let bytes = [&[head], &bytes[..]].concat();
                let _ = (attributes(&bytes, 8, count), triangles(&bytes, count), list(&bytes, count));
                // No memory is allocated for elements that cannot be present.
                let count = usize::MAX / 1024 * (count + 1).min(9);
                assert!(attributes(&bytes, 256, count).is_err());
                assert!(triangles(&bytes, count / 3 * 3).is_err() && list(&bytes, count).is_err());
            }
        }

        /// As a port of the reference decodes them.
        #[test]
        fn directions_are_decoded_alike(bytes in prop::collection::vec(-126..127_i8, 2..60)) {
            let mut mine: Vec<u8> = bytes.chunks_exact(2).flat_map(|at| [at[0] as u8, at[1] as u8, 127, 0]).collect();
            let mut theirs = mine.clone();
            directions(&mut mine);
            let count = theirs.len() / 4;
            codec::decode_filter_oct(&mut theirs, count, 4, &mut Workspace::default()).unwrap();
            prop_assert_eq!(mine, theirs);
        }
    }
}
