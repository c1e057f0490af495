//! TIFF directory entries of stores: encoding and decoding.

use super::layout::PAGE;

/// Tags of a store.
pub(crate) mod tag {
    pub(crate) const WIDTH: u16 = 256;
    pub(crate) const HEIGHT: u16 = 257;
    pub(crate) const BITS: u16 = 258;
    pub(crate) const COMPRESSION: u16 = 259;
    pub(crate) const PHOTOMETRIC: u16 = 262;
    pub(crate) const SAMPLES_PER_PIXEL: u16 = 277;
    pub(crate) const PLANAR: u16 = 284;
    pub(crate) const SOFTWARE: u16 = 305;
    pub(crate) const TILE_WIDTH: u16 = 322;
    pub(crate) const TILE_HEIGHT: u16 = 323;
    pub(crate) const TILE_OFFSETS: u16 = 324;
    pub(crate) const TILE_BYTES: u16 = 325;
    pub(crate) const SAMPLE_FORMAT: u16 = 339;
    pub(crate) const PIXEL_SCALE: u16 = 33_550;
    pub(crate) const TIEPOINT: u16 = 33_922;
    pub(crate) const MATRIX: u16 = 34_264;
    pub(crate) const GEO_KEYS: u16 = 34_735;
    pub(crate) const GEO_DOUBLES: u16 = 34_736;
    pub(crate) const GEO_ASCII: u16 = 34_737;
    pub(crate) const GDAL_METADATA: u16 = 42_112;
    pub(crate) const GDAL_NODATA: u16 = 42_113;
}

/// Size of the BigTIFF header before the directory in bytes.
pub(super) const START: usize = 16;
/// The BigTIFF header, directly followed by the directory.
pub(super) const MAGIC: [u8; START] = [b'I', b'I', 43, 0, 8, 0, 0, 0, 16, 0, 0, 0, 0, 0, 0, 0];
/// Bytes of one entry.
pub(super) const ENTRY: usize = 20;
/// Bytes of values stored inside an entry.
const INLINE: usize = 8;

/// The values of one tag.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TiffTagValues {
    Short(Vec<u16>),
    Long(Vec<u32>),
    Double(Vec<f64>),
    Ascii(String),
    /// One `u64` per tile: first value, and constant step.
    Table {
        count: u64,
        first: u64,
        step: u64,
    },
}

impl TiffTagValues {
    pub(crate) fn short(value: u16) -> Self {
        Self::Short(vec![value])
    }

    pub(crate) fn long(value: u32) -> Self {
        Self::Long(vec![value])
    }

    pub(crate) fn kind(&self) -> u16 {
        match self {
            Self::Ascii(_) => 2,
            Self::Short(_) => 3,
            Self::Long(_) => 4,
            Self::Double(_) => 12,
            Self::Table { .. } => 16,
        }
    }

    pub(crate) fn count(&self) -> u64 {
        match self {
            Self::Short(values) => values.len() as u64,
            Self::Long(values) => values.len() as u64,
            Self::Double(values) => values.len() as u64,
            Self::Ascii(text) => text.len() as u64 + 1,
            Self::Table { count, .. } => *count,
        }
    }

    /// The bytes of all values except long tables, which are never held in memory.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Short(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::Long(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::Double(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::Ascii(text) => text.bytes().chain([0]).collect(),
            Self::Table { count: 1, first, .. } => first.to_le_bytes().to_vec(),
            Self::Table { .. } => Vec::new(),
        }
    }

    /// Values of the given type in a file; `None` for types that stores do not use.
    pub(super) fn decode(kind: u16, bytes: &[u8]) -> Option<Self> {
        Some(match kind {
            2 => Self::Ascii(String::from_utf8(bytes.strip_suffix(&[0])?.to_vec()).ok()?),
            3 => Self::Short(words(bytes).map(u16::from_le_bytes).collect()),
            4 => Self::Long(words(bytes).map(u32::from_le_bytes).collect()),
            12 => Self::Double(words(bytes).map(f64::from_le_bytes).collect()),
            _ => return None,
        })
    }
}

fn words<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> {
    bytes.chunks_exact(N).filter_map(|word| word.try_into().ok())
}

/// Size of a value of a TIFF type that stores use.
pub(super) fn value_bytes(kind: u16) -> Option<u64> {
    match kind {
        2 => Some(1),
        3 => Some(2),
        4 => Some(4),
        12 | 16 => Some(8),
        _ => None,
    }
}

/// Everything before the tiles.
#[derive(Clone, Debug)]
pub(super) struct TiledTiffPreamble {
    /// Header, directory and small values.
    pub(super) head: Vec<u8>,
    /// Tables that follow the head, one after the other: (count, first value, step).
    pub(super) tables: Vec<(u64, u64, u64)>,
    /// Offset of tile 0.
    pub(super) data: u64,
}

impl TiledTiffPreamble {
    /// Lays out the directory. `tags` must be in ascending order; it is called with the offset of tile 0, and
    /// must give the same types and counts for any offset.
    pub(super) fn new(tags: impl Fn(u64) -> Vec<(u16, TiffTagValues)>) -> Self {
        let draft = Self::place(&tags(0));
        let end = draft.head.len() as u64 + draft.tables.iter().map(|t| 8 * t.0).sum::<u64>();
        let data = end.next_multiple_of(PAGE);
        Self { data, ..Self::place(&tags(data)) }
    }

    fn place(tags: &[(u16, TiffTagValues)]) -> Self {
        let directory = 8 + ENTRY * tags.len() + 8;
        let mut small = Vec::new();
        let mut places = Vec::new();
        for (_, values) in tags {
            let bytes = values.bytes();
            places.push((START + directory + small.len()) as u64);
            if bytes.len() > INLINE {
                small.extend(bytes);
                small.resize(small.len().next_multiple_of(8), 0);
            }
        }
        let mut table = (START + directory + small.len()) as u64;
        let mut head = MAGIC.to_vec();
        head.extend((tags.len() as u64).to_le_bytes());
        let mut tables = Vec::new();
        for ((tag, values), mut place) in tags.iter().zip(places) {
            if let TiffTagValues::Table { count: count @ 2.., first, step } = *values {
                place = table;
                table += 8 * count;
                tables.push((count, first, step));
            }
            head.extend(entry(*tag, values, place));
        }
        head.extend([0; 8]);
        head.extend(small);
        Self { head, tables, data: 0 }
    }

    /// Everything before the tiles in pieces, so that long tables are never held in memory.
    pub(super) fn pieces(&self) -> impl Iterator<Item = Vec<u8>> {
        const AT_ONCE: u64 = 1 << 16;
        let end = self.head.len() as u64 + self.tables.iter().map(|t| 8 * t.0).sum::<u64>();
        let padding = vec![0; (self.data - end) as usize];
        let tables = self.tables.iter().flat_map(|&(count, first, step)| {
            (0..count.div_ceil(AT_ONCE)).map(move |piece| {
                let values = piece * AT_ONCE..count.min((piece + 1) * AT_ONCE);
                values.flat_map(|i| (first + i * step).to_le_bytes()).collect()
            })
        });
        std::iter::once(self.head.clone()).chain(tables).chain([padding])
    }
}

fn entry(tag: u16, values: &TiffTagValues, place: u64) -> Vec<u8> {
    let mut entry = Vec::with_capacity(ENTRY);
    entry.extend(tag.to_le_bytes());
    entry.extend(values.kind().to_le_bytes());
    entry.extend(values.count().to_le_bytes());
    let long_table = matches!(values, TiffTagValues::Table { count: 2.., .. });
    let bytes = values.bytes();
    if long_table || bytes.len() > INLINE {
        entry.extend(place.to_le_bytes());
    } else {
        entry.extend(&bytes);
        entry.resize(ENTRY, 0);
    }
    entry
}
