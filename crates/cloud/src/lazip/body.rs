//! The sections of a layered chunk: first record, number of points, and layers.

use super::chunk::{ChunkDamage, CompressedChunk, LazLayer};
use super::coder::RangeDecoder;
use super::fields::FieldSelection;
use super::machine::PortableInstructions;
use super::point::RECORD;
use super::schema::LayeredSchema;
use super::streams::{RestStreams, Streams};

/// Layers of the fields that all formats share.
const SHARED: usize = 9;

/// The sections of a chunk.
pub(super) struct LayeredChunk<'a> {
    /// The first record.
    pub(super) record: &'a [u8],
    /// Layers of the shared fields.
    shared: [&'a [u8]; SHARED],
    /// Layers of the fields after them.
    tails: LayerSplitter<'a>,
}

impl<'a> LayeredChunk<'a> {
    /// Splits a chunk.
    pub(super) fn new(
        chunk: CompressedChunk<'a>,
        layers: &LayeredSchema,
    ) -> Result<Self, ChunkDamage> {
        let (record, rest) = split(chunk.bytes, RECORD + layers.bytes)?;
        let (count, rest) = rest.split_first_chunk().ok_or(ChunkDamage::Short)?;
        let count = u32::from_le_bytes(*count);
        if (count as usize) < chunk.count {
            return Err(ChunkDamage::Count(count));
        }
        // Four bytes for the size of each layer.
        let (sizes, bytes) = split(rest, 4 * (SHARED + layers.layers.len()))?;
        let (mut layers, mut shared) = (LayerSplitter { sizes, bytes }, [&[][..]; SHARED]);
        for layer in &mut shared {
            *layer = layers.next()?;
        }
        Ok(Self { record, shared, tails: layers })
    }

    /// The selected streams.
    pub(super) fn streams(
        &self,
        wanted: FieldSelection,
    ) -> Result<Streams<'a, PortableInstructions>, ChunkDamage> {
        let places = self.open(LazLayer::Places)?;
        Ok(Streams {
            places: places.ok_or(ChunkDamage::Layer(LazLayer::Places))?,
            heights: self.open_if(wanted.z || wanted.records, LazLayer::Heights)?,
            classes: self.open_if(wanted.class || wanted.records, LazLayer::Classes)?,
            flags: self.open_if(wanted.flags || wanted.records, LazLayer::Flags)?,
        })
    }

    fn open_if(
        &self,
        is_wanted: bool,
        layer: LazLayer,
    ) -> Result<Option<RangeDecoder<'a, PortableInstructions>>, ChunkDamage> {
        if is_wanted { self.open(layer) } else { Ok(None) }
    }

    /// The streams that only whole records need.
    pub(super) fn rest(
        mut self,
        layers: &LayeredSchema,
    ) -> Result<RestStreams<'a, PortableInstructions>, ChunkDamage> {
        let mut tails = Vec::with_capacity(layers.layers.len());
        for &layer in &layers.layers {
            tails.push((layer, open(layer, self.tails.next()?)?));
        }
        Ok(RestStreams {
            intensities: self.open(LazLayer::Intensities)?,
            angles: self.open(LazLayer::Angles)?,
            user_data: self.open(LazLayer::UserData)?,
            sources: self.open(LazLayer::Sources)?,
            times: self.open(LazLayer::Times)?,
            tails,
        })
    }

    fn open(
        &self,
        layer: LazLayer,
    ) -> Result<Option<RangeDecoder<'a, PortableInstructions>>, ChunkDamage> {
        open(layer, self.shared[layer as usize])
    }
}

fn split(bytes: &[u8], at: usize) -> Result<(&[u8], &[u8]), ChunkDamage> {
    bytes.split_at_checked(at).ok_or(ChunkDamage::Short)
}

/// The stream of a layer. An empty layer means that the field is that of the first point.
fn open(
    layer: LazLayer,
    bytes: &[u8],
) -> Result<Option<RangeDecoder<'_, PortableInstructions>>, ChunkDamage> {
    match bytes {
        [] => Ok(None),
        _ => RangeDecoder::new(bytes).map(Some).ok_or(ChunkDamage::Layer(layer)),
    }
}

/// Layers not yet split off.
struct LayerSplitter<'a> {
    /// Four bytes each.
    sizes: &'a [u8],
    bytes: &'a [u8],
}

impl<'a> LayerSplitter<'a> {
    fn next(&mut self) -> Result<&'a [u8], ChunkDamage> {
        let (size, sizes) = self.sizes.split_first_chunk().ok_or(ChunkDamage::Short)?;
        let size = u32::from_le_bytes(*size) as usize;
        let (layer, bytes) = self.bytes.split_at_checked(size).ok_or(ChunkDamage::Short)?;
        *self = Self { sizes, bytes };
        Ok(layer)
    }
}
