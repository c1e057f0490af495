//! Decodes a tile (quantized-mesh 1.0, little-endian, not compressed). Errors name the byte; the mesh itself is checked by
//! [`structure`](super::structure).

use super::fault::TilesetFault;
use super::skirt::TileSkirt;
use super::tiling::{LAST, ProofTileId, ProofTileSide, coordinate};
use terrane_base::error::{Error, Result};

/// Limit of the vertices with indices of 16 bits.
const MAX_SHORT: usize = 1 << 16;

/// A tile as it is stored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DecodedTile {
    /// Earth-centred middle of the tile.
    pub centre: [f64; 3],
    /// Heights that 0 and [`LAST`] stand for.
    pub heights: [f32; 2],
    /// Middle and radius of the bounding sphere.
    pub sphere: ([f64; 3], f64),
    /// Horizon occlusion point, on an ellipsoid scaled to a sphere of radius 1.
    pub horizon: [f64; 3],
    /// u, v and height of each vertex.
    pub vertices: Vec<[u16; 3]>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Vertices said to be on each side, in the order of [`ProofTileSide::ALL`].
    pub sides: [Vec<u32>; 4],
    /// Normals of vertices, oct-encoded.
    pub normals: Option<Vec<[u8; 2]>>,
    /// The mask of water: a byte for each of 256 x 256 pixels from the north-west on, or one for all.
    pub water: Option<Vec<u8>>,
    /// Metadata, as text that is meant to be JSON.
    pub metadata: Option<Vec<u8>>,
    /// Earth-centred vertices, where a tile holds such.
    pub placed: Vec<[f64; 3]>,
    /// Skirt below its sides.
    pub skirt: TileSkirt,
    /// Faults found by the decoder, with their counts.
    pub faults: Vec<(TilesetFault, u64)>,
}

impl DecodedTile {
    /// Reads a tile. `check_vertices` is called with the number of vertices before memory is allocated for them.
    ///
    /// # Errors
    /// Bad input with the byte: counts beyond the end of the bytes, indices of missing vertices, coordinates out of range,
    /// numbers that are not finite, duplicate extensions or ones of a wrong length, trailing bytes. Errors of
    /// `check_vertices`.
    pub fn read(bytes: &[u8], check_vertices: impl FnOnce(usize) -> Result<()>) -> Result<Self> {
        let mut from = TileByteCursor { bytes, at: 0 };
        let mut tile = Self { centre: from.point()?, ..Self::default() };
        tile.heights = [from.float()?, from.float()?];
        tile.sphere = (from.point()?, from.double()?);
        tile.horizon = from.point()?;
        let count = from.count(6, "vertices")?;
        check_vertices(count)?;
        tile.vertices = from.vertices(count)?;
        from.skip_to(if count > MAX_SHORT { 4 } else { 2 })?;
        tile.triangles = from.triangles(count)?;
        for side in &mut tile.sides {
            *side = from.indices(count)?;
        }
        while from.at < bytes.len() {
            from.extension(&mut tile)?;
        }
        Ok(tile)
    }

    /// Height of a vertex in metres: exact where the heights are on a lattice.
    pub fn height(&self, vertex: [u16; 3]) -> f64 {
        let [low, high] = self.heights.map(f64::from);
        low + f64::from(vertex[2]) * (high - low) / f64::from(LAST)
    }

    /// Longitude and latitude of a vertex in degrees.
    pub fn place(id: ProofTileId, vertex: [u16; 3]) -> [f64; 2] {
        let [west, south, east, north] = id.bounds();
        [coordinate(vertex[0], west, east), coordinate(vertex[1], south, north)]
    }

    /// True where a vertex lies on a side.
    pub fn is_on(vertex: [u16; 3], side: ProofTileSide) -> bool {
        match side {
            ProofTileSide::West => vertex[0] == 0,
            ProofTileSide::South => vertex[1] == 0,
            ProofTileSide::East => vertex[0] == LAST,
            ProofTileSide::North => vertex[1] == LAST,
        }
    }

    /// Adds an extension; unknown ones are ignored, as the format demands of readers.
    fn extend(&mut self, id: u8, bytes: &[u8]) -> std::result::Result<(), String> {
        let length = bytes.len();
        let is_twice = match id {
            1 if length != 2 * self.vertices.len() => {
                let count = self.vertices.len();
                return Err(format!("normals of {count} vertices have {length} bytes"));
            }
            1 => self.normals.replace(bytes.as_chunks().0.to_vec()).is_some(),
            2 if length != 1 && length != 1 << 16 => {
                return Err(format!("a water mask has {length} bytes, expected 1 or 65536"));
            }
            2 => self.water.replace(bytes.to_vec()).is_some(),
            4 => {
                let text = metadata(bytes).map_err(|e| e.to_string())?;
                self.metadata.replace(text.to_vec()).is_some()
            }
            _ => false,
        };
        match is_twice {
            true => Err(format!("duplicate extension {id}")),
            false => Ok(()),
        }
    }
}

/// The text of a metadata extension.
fn metadata(bytes: &[u8]) -> Result<&[u8]> {
    let mut from = TileByteCursor { bytes, at: 0 };
    let length = from.count(1, "bytes of metadata")?;
    let text = from.take(length, "metadata")?;
    match from.at == bytes.len() {
        true => Ok(text),
        false => Err(from.bad("trailing bytes after metadata".to_owned())),
    }
}

/// Bytes, and the position of the next one.
struct TileByteCursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> TileByteCursor<'a> {
    fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let Some(taken) = rest.get(..length) else {
            let left = rest.len();
            return Err(self.bad(format!("{what} of {length} bytes exceeds the {left} bytes left")));
        };
        self.at += length;
        Ok(taken)
    }

    fn bad(&self, message: String) -> Error {
        Error::bad_input(message).at(format!("byte {}", self.at))
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, what)?);
        Ok(out)
    }

    fn finite(&self, value: f64) -> Result<f64> {
        match value.is_finite() {
            true => Ok(value),
            false => Err(self.bad(format!("header contains {value}"))),
        }
    }

    fn double(&mut self) -> Result<f64> {
        let value = f64::from_le_bytes(self.array("the header")?);
        self.finite(value)
    }

    fn float(&mut self) -> Result<f32> {
        let value = f32::from_le_bytes(self.array("the header")?);
        self.finite(f64::from(value)).map(|_| value)
    }

    fn point(&mut self) -> Result<[f64; 3]> {
        Ok([self.double()?, self.double()?, self.double()?])
    }

    /// The count of the following items of `bytes` bytes each.
    fn count(&mut self, bytes: usize, what: &str) -> Result<usize> {
        let count = u32::from_le_bytes(self.array(what)?);
        let left = self.bytes.len() - self.at;
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        match count.checked_mul(bytes) {
            Some(needed) if needed <= left => Ok(count),
            _ => Err(self.bad(format!("{count} {what} exceed the {left} bytes left"))),
        }
    }

    /// u, v and heights of vertices: three runs of zig-zag coded differences.
    fn vertices(&mut self, count: usize) -> Result<Vec<[u16; 3]>> {
        let mut vertices = vec![[0; 3]; count];
        for (axis, name) in ["u", "v", "height"].into_iter().enumerate() {
            let mut value = 0i32;
            for (number, vertex) in vertices.iter_mut().enumerate() {
                let code = i32::from(u16::from_le_bytes(self.array(name)?));
                value += (code >> 1) ^ -(code & 1);
                let found = u16::try_from(value).ok().filter(|&found| found <= LAST);
                vertex[axis] = found.ok_or_else(|| {
                    self.bad(format!("{name} of vertex {number} is {value}, expected 0 to {LAST}"))
                })?;
            }
        }
        Ok(vertices)
    }

    fn skip_to(&mut self, multiple: usize) -> Result<()> {
        let padding = self.at.next_multiple_of(multiple) - self.at;
        self.take(padding, "the padding").map(drop)
    }

    /// An index of `count` vertices, of 16 or 32 bits.
    fn code(&mut self, count: usize) -> Result<u32> {
        match count > MAX_SHORT {
            true => Ok(u32::from_le_bytes(self.array("an index")?)),
            false => Ok(u32::from(u16::from_le_bytes(self.array("an index")?))),
        }
    }

    fn index_of(&self, index: u32, count: usize) -> Result<u32> {
        match (index as usize) < count {
            true => Ok(index),
            false => Err(self.bad(format!("index {index} exceeds the {count} vertices"))),
        }
    }

    /// Triangles, as differences to the highest index so far.
    fn triangles(&mut self, count: usize) -> Result<Vec<[u32; 3]>> {
        let bytes = if count > MAX_SHORT { 12 } else { 6 };
        let mut triangles = vec![[0; 3]; self.count(bytes, "triangles")?];
        let mut highest = 0u32;
        for index in triangles.as_flattened_mut() {
            let code = self.code(count)?;
            let value = highest.checked_sub(code).ok_or_else(|| {
                self.bad(format!("difference {code} exceeds the highest index so far, {highest}"))
            })?;
            *index = self.index_of(value, count)?;
            highest += u32::from(code == 0);
        }
        Ok(triangles)
    }

    fn indices(&mut self, count: usize) -> Result<Vec<u32>> {
        let bytes = if count > MAX_SHORT { 4 } else { 2 };
        let mut indices = vec![0; self.count(bytes, "vertices of a side")?];
        for index in &mut indices {
            let code = self.code(count)?;
            *index = self.index_of(code, count)?;
        }
        Ok(indices)
    }

    fn extension(&mut self, tile: &mut DecodedTile) -> Result<()> {
        let at = self.at;
        let [id] = self.array("an extension")?;
        let length = self.count(1, "bytes of an extension")?;
        let bytes = self.take(length, "an extension")?;
        let extended = tile.extend(id, bytes);
        extended.map_err(|message| Error::bad_input(message).at(format!("byte {at}")))
    }
}
