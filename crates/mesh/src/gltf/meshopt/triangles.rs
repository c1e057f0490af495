//! Triangle indices: mostly a shared edge and a close vertex in one byte; other data are in a second part of the
//! stream.

use super::stream::{MeshoptCodec, MeshoptWindow};
use terrane_base::error::{Error, Result};

const HEADER: u8 = 0xe1;
/// Pairs of indices into the vertex queue that have their own code; 0 is the next vertex.
const PAIRS: [u8; 16] =
    [0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xa9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0, 0];
const QUEUE: usize = 16;
/// Empty entry of a queue; not a valid vertex.
const NOTHING: u32 = u32::MAX;
/// Maximum bytes of the data of a triangle beside its code.
const MAX_DATA: usize = 16;
/// Triangles per step.
const STEP: u64 = 512;

/// A queue of the last 16 entries.
#[derive(Clone, Debug)]
struct MeshoptFifo<T> {
    items: [T; QUEUE],
    /// Index of the next entry.
    next: usize,
}

impl<T: Copy + PartialEq> MeshoptFifo<T> {
    fn of(nothing: T) -> Self {
        Self { items: [nothing; QUEUE], next: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.next] = item;
        self.next = (self.next + 1) % QUEUE;
    }

    /// The `age`-th entry from the last.
    fn get(&self, age: usize) -> T {
        self.items[(self.next + 2 * QUEUE - 1 - age) % QUEUE]
    }
}

/// Common state of encoder and decoder.
#[derive(Clone, Debug)]
struct MeshoptTriangleState {
    /// The next new vertex in sequence.
    next: u32,
    /// The last vertex with an explicit index.
    last: u32,
    edges: MeshoptFifo<[u32; 2]>,
    vertices: MeshoptFifo<u32>,
}

impl MeshoptTriangleState {
    fn new() -> Self {
        let (edges, vertices) = (MeshoptFifo::of([NOTHING; 2]), MeshoptFifo::of(NOTHING));
        Self { next: 0, last: 0, edges, vertices }
    }

    /// Updates after a triangle that shares its first edge.
    fn push_shared(&mut self, [a, b, c]: [u32; 3]) {
        self.edges.push([c, b]);
        self.edges.push([a, c]);
    }

    /// Updates after a triangle without a shared edge.
    fn push_alone(&mut self, [a, b, c]: [u32; 3]) {
        self.edges.push([b, a]);
        self.push_shared([a, b, c]);
    }
}

/// Writes a stream of triangles: codes and data separately, as all codes come first.
pub(crate) struct MeshoptTriangleWriter {
    state: MeshoptTriangleState,
}

impl MeshoptTriangleWriter {
    pub(crate) fn new() -> Self {
        Self { state: MeshoptTriangleState::new() }
    }

    /// Header of the codes.
    pub(crate) const HEAD: [u8; 1] = [HEADER];
    /// Trailer after the data.
    pub(crate) const TAIL: [u8; 16] = PAIRS;

    /// Appends the code and data of a triangle.
    pub(crate) fn push(&mut self, corners: [u32; 3], codes: &mut Vec<u8>, data: &mut Vec<u8>) {
        match self.shared(corners) {
            Some((age, corners)) => codes.push((age as u8) << 4 | self.third(corners, data)),
            None => codes.push(self.alone(self.starting_at_next(corners), data)),
        }
    }

    /// Age of the latest shared edge, and the corners rotated to it.
    fn shared(&self, [a, b, c]: [u32; 3]) -> Option<(usize, [u32; 3])> {
        let turns = [[a, b, c], [b, c, a], [c, a, b]];
        // An age of 15 in the upper bits is the code of a triangle that shares no edge.
        (0..QUEUE - 1).find_map(|age| {
            let edge = self.state.edges.get(age);
            turns.into_iter().find(|turn| turn[..2] == edge).map(|turn| (age, turn))
        })
    }

    /// Low bits of the code of a triangle with a known first edge.
    fn third(&mut self, corners: [u32; 3], data: &mut Vec<u8>) -> u8 {
        let (state, [_, _, c]) = (&mut self.state, corners);
        state.push_shared(corners);
        // Ages 1 to 12 have codes of their own; 0 is the next vertex, and 13 to 15 are told by difference.
        let met = (1..13).find(|&age| state.vertices.get(age) == c);
        if let Some(age) = met.filter(|_| c != state.next) {
            return age as u8;
        }
        state.vertices.push(c);
        if c == state.next {
            state.next += 1;
            return 0;
        }
        match c.wrapping_sub(state.last) {
            u32::MAX => {
                state.last = c;
                0xd
            }
            1 => {
                state.last = c;
                0xe
            }
            _ => {
                state.write(c, data);
                0xf
            }
        }
    }

    /// Rotates the corners to begin at the next vertex, if it is one of them.
    fn starting_at_next(&self, [a, b, c]: [u32; 3]) -> [u32; 3] {
        match self.state.next {
            next if b == next => [b, c, a],
            next if c == next => [c, a, b],
            _ => [a, b, c],
        }
    }

    /// The code of a triangle without a shared edge.
    fn alone(&mut self, [a, b, c]: [u32; 3], data: &mut Vec<u8>) -> u8 {
        let state = &mut self.state;
        let is_next = a == state.next;
        state.next += u32::from(is_next);
        let [place_b, place_c] = [b, c].map(|corner| state.place(corner));
        let pair = place_b << 4 | place_c;
        let known = PAIRS[..14].iter().position(|known| *known == pair).filter(|_| is_next);
        if known.is_none() {
            data.push(pair);
        }
        let written = [(a, !is_next), (b, place_b == 0xf), (c, place_c == 0xf)];
        for (corner, _) in written.into_iter().filter(|(_, is_written)| *is_written) {
            state.write(corner, data);
        }
        for (corner, place) in [(a, 0), (b, place_b), (c, place_c)] {
            if matches!(place, 0 | 0xf) {
                state.vertices.push(corner);
            }
        }
        state.push_alone([a, b, c]);
        match known {
            Some(known) => 0xf0 | known as u8,
            None if is_next => 0xfe,
            None => 0xff,
        }
    }
}

impl MeshoptTriangleState {
    /// 0 for the next vertex, 1 to 14 for an entry of the queue, 15 for others.
    fn place(&mut self, corner: u32) -> u8 {
        if corner == self.next {
            self.next += 1;
            return 0;
        }
        let met = (0..14).find(|&age| self.vertices.get(age) == corner);
        met.map_or(0xf, |age| age as u8 + 1)
    }

    /// Appends the difference of a vertex index to the last explicit one: seven bits a byte, the lowest first.
    fn write(&mut self, corner: u32, data: &mut Vec<u8>) {
        let difference = corner.wrapping_sub(self.last);
        let mut left = difference << 1 ^ ((difference as i32) >> 31) as u32;
        while left > 0x7f {
            data.push(left as u8 | 0x80);
            left >>= 7;
        }
        data.push(left as u8);
        self.last = corner;
    }
}

/// Reads a stream of triangles, as elements of three u32.
pub(crate) struct MeshoptTriangleReader {
    /// Offset of the first code.
    codes: u64,
    /// End of the data.
    end: u64,
    triangles: u64,
    pairs: [u8; 16],
}

/// A position between two triangles.
#[derive(Clone)]
pub(crate) struct MeshoptTriangleCursor {
    triangle: u64,
    /// Offset of its data.
    data: u64,
    state: MeshoptTriangleState,
}

impl MeshoptTriangleReader {
    /// The stream of `triangles` triangles at `start`, with `bytes` bytes.
    pub(crate) fn new(
        window: &mut MeshoptWindow<'_>,
        start: u64,
        bytes: u64,
        triangles: u64,
    ) -> Result<Self> {
        let frame = 1 + PAIRS.len() as u64;
        if triangles.checked_add(frame).is_none_or(|min_bytes| bytes < min_bytes) {
            return Err(bad(format!("have only {bytes} bytes for {triangles} triangles")));
        }
        if window.bytes(start, 1)? != [HEADER] {
            return Err(bad("have an unknown type or version"));
        }
        let end = start + bytes - PAIRS.len() as u64;
        let mut pairs = PAIRS;
        pairs.copy_from_slice(window.bytes(end, PAIRS.len())?);
        let is_valid = pairs.iter().all(|pair| pair & 0xf != 0xf && pair >> 4 != 0xf);
        if !is_valid || pairs[14..] != [0, 0] {
            return Err(bad("have an invalid table"));
        }
        Ok(Self { codes: start + 1, end, triangles, pairs })
    }

    /// The next triangle.
    fn triangle(
        &self,
        code: u8,
        state: &mut MeshoptTriangleState,
        data: &mut MeshoptTriangleBytes<'_>,
    ) -> Result<[u32; 3]> {
        let (high, low) = (code >> 4, code & 0xf);
        if high == 0xf {
            return self.alone(low, state, data);
        }
        let [a, b] = state.edges.get(high.into());
        let c = match low {
            0 => state.take_next(),
            0xd | 0xe => {
                state.last = state.last.wrapping_add(if low == 0xd { u32::MAX } else { 1 });
                state.last
            }
            0xf => data.vertex(state)?,
            age => state.vertices.get(age.into()),
        };
        if matches!(low, 0 | 0xd..) {
            state.vertices.push(c);
        }
        state.push_shared([a, b, c]);
        Ok([a, b, c])
    }

    fn alone(
        &self,
        low: u8,
        state: &mut MeshoptTriangleState,
        data: &mut MeshoptTriangleBytes<'_>,
    ) -> Result<[u32; 3]> {
        let (pair, is_next) = match low {
            0xe | 0xf => (data.byte()?, low == 0xe),
            _ => (self.pairs[usize::from(low)], true),
        };
        // Both corners new, after 0xfe or 0xff, begins the numbering of vertices anew (the extension's
        // mode for triangles). The writer here never does so.
        if low >= 0xe && pair == 0 {
            state.next = 0;
        }
        let a = if is_next { state.take_next() } else { data.vertex(state)? };
        let places = [pair >> 4, pair & 0xf];
        let mut corners = [a; 3];
        for (corner, place) in corners[1..].iter_mut().zip(places) {
            *corner = match place {
                0 => state.take_next(),
                0xf => data.vertex(state)?,
                place => state.vertices.get(usize::from(place) - 1),
            };
        }
        for (corner, place) in corners.into_iter().zip([0, places[0], places[1]]) {
            if matches!(place, 0 | 0xf) {
                state.vertices.push(corner);
            }
        }
        state.push_alone(corners);
        Ok(corners)
    }
}

impl MeshoptTriangleState {
    fn take_next(&mut self) -> u32 {
        let next = self.next;
        self.next = next.wrapping_add(1);
        next
    }
}

/// The remaining data of some triangles.
struct MeshoptTriangleBytes<'a>(&'a [u8]);

impl MeshoptTriangleBytes<'_> {
    fn byte(&mut self) -> Result<u8> {
        let (byte, rest) = self.0.split_first().ok_or_else(|| bad("are truncated"))?;
        self.0 = rest;
        Ok(*byte)
    }

    fn vertex(&mut self, state: &mut MeshoptTriangleState) -> Result<u32> {
        let mut folded = 0_u32;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            folded |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                let difference = folded >> 1 ^ (folded & 1).wrapping_neg();
                state.last = state.last.wrapping_add(difference);
                return Ok(state.last);
            }
        }
        Err(bad("have an overlong number"))
    }
}

impl MeshoptCodec for MeshoptTriangleReader {
    type Place = MeshoptTriangleCursor;

    fn start(&self) -> MeshoptTriangleCursor {
        MeshoptTriangleCursor {
            triangle: 0,
            data: self.codes + self.triangles,
            state: MeshoptTriangleState::new(),
        }
    }

    fn index(&self, place: &MeshoptTriangleCursor) -> u64 {
        place.triangle
    }

    fn count(&self) -> u64 {
        self.triangles
    }

    fn step_elements(&self) -> u64 {
        STEP
    }

    fn element_bytes(&self) -> usize {
        12
    }

    fn step(
        &self,
        place: &mut MeshoptTriangleCursor,
        window: &mut MeshoptWindow<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        let count = STEP.min(self.triangles - place.triangle) as usize;
        // Copied, as the window moves on to the data.
        let codes = window.bytes(self.codes + place.triangle, count)?.to_vec();
        let length = (self.end - place.data).min((count * MAX_DATA) as u64) as usize;
        let mut data = MeshoptTriangleBytes(window.bytes(place.data, length)?);
        out.clear();
        for code in codes {
            let corners = self.triangle(code, &mut place.state, &mut data)?;
            out.extend(corners.map(u32::to_le_bytes).as_flattened());
        }
        place.data += (length - data.0.len()) as u64;
        place.triangle += count as u64;
        if place.triangle == self.triangles && place.data != self.end {
            return Err(bad(format!("have {} surplus bytes", self.end - place.data)));
        }
        Ok(())
    }
}

fn bad(message: impl std::fmt::Display) -> Error {
    Error::bad_input(format!("compressed triangles {message}"))
}
