//! Items after the point in records. Each is predicted from the last record, whose bytes are replaced by those of the
//! next.

use super::chunk::LazLayer;
use super::coder::RangeDecoder;
use super::colour::{NearInfrared, OldColour, RgbColor};
use super::machine::InstructionSet;
use super::model::ArithmeticModel;
use super::packet::{PACKET, WavePacketDecoder};
use super::range_encoder::RangeEncoder;
use super::schema::LaszipItem;
use super::time::{GpsTime, OldTime};
use std::mem;

/// Decoder context of an item.
pub(super) enum ItemContext {
    OldTime(Box<OldTime>),
    Time(Box<GpsTime>),
    OldColour(Box<OldColour>),
    Colour(Box<RgbColor>),
    Infrared(Box<NearInfrared>),
    Packet(Box<WavePacketDecoder>),
    Bytes(Vec<ArithmeticModel<16>>),
}

impl ItemContext {
    /// A fresh context for a known item.
    pub(super) fn new(item: &LaszipItem) -> Self {
        match (item.kind, item.version) {
            (7, 1) => Self::OldTime(Box::new(OldTime::new())),
            (7, _) => Self::Time(Box::new(GpsTime::new())),
            (8, 1) => Self::OldColour(Box::new(OldColour::new())),
            (8, _) => Self::Colour(Box::new(RgbColor::new())),
            (9, _) => Self::Packet(Box::new(WavePacketDecoder::new())),
            _ => Self::Bytes(vec![ArithmeticModel::new(); usize::from(item.size)]),
        }
    }

    /// A fresh context for a layer; a layer of extra bytes has a byte of each record.
    pub(super) fn of(layer: LazLayer) -> Self {
        match layer {
            LazLayer::Colours => Self::Colour(Box::new(RgbColor::new())),
            LazLayer::Infrared => Self::Infrared(Box::new(NearInfrared::new())),
            LazLayer::Packets => Self::Packet(Box::new(WavePacketDecoder::new())),
            _ => Self::Bytes(vec![ArithmeticModel::new()]),
        }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        match self {
            Self::OldTime(time) => time.clear(),
            Self::Time(time) => time.clear(),
            Self::OldColour(colour) => colour.clear(),
            Self::Colour(colour) => colour.clear(),
            Self::Infrared(value) => value.clear(),
            Self::Packet(packet) => packet.clear(),
            Self::Bytes(bytes) => bytes.iter_mut().for_each(ArithmeticModel::clear),
        }
    }

    /// Bytes of the item in a record.
    pub(super) fn size(&self) -> usize {
        match self {
            Self::OldTime(_) | Self::Time(_) => 8,
            Self::OldColour(_) | Self::Colour(_) => 6,
            Self::Infrared(_) => 2,
            Self::Packet(_) => PACKET,
            Self::Bytes(bytes) => bytes.len(),
        }
    }

    /// Replaces the item at the start of `rest` by the next one, and splits it off.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        rest: &mut &mut [u8],
    ) {
        match self {
            Self::OldTime(time) => {
                let Some(part) = take(rest) else { return };
                *part = time.next(coder, u64::from_le_bytes(*part)).to_le_bytes();
            }
            Self::Time(time) => {
                let Some(part) = take(rest) else { return };
                *part = time.next::<M, false>(coder, u64::from_le_bytes(*part)).to_le_bytes();
            }
            Self::OldColour(colour) => {
                let Some(part) = take(rest) else { return };
                colour.next(coder, part);
            }
            Self::Colour(colour) => {
                let Some(part) = take(rest) else { return };
                colour.next(coder, part);
            }
            Self::Infrared(value) => {
                let Some(part) = take(rest) else { return };
                value.next(coder, part);
            }
            Self::Packet(packet) => {
                let Some(part) = take(rest) else { return };
                packet.next(coder, part);
            }
            Self::Bytes(models) => {
                let Some((part, after)) = mem::take(rest).split_at_mut_checked(models.len()) else {
                    return;
                };
                *rest = after;
                for (byte, model) in part.iter_mut().zip(models) {
                    *byte = byte.wrapping_add(coder.symbol(model.ready(256)) as u8);
                }
            }
        }
    }
}

impl ItemContext {
    /// Whether it can be encoded: items of layers, without wave packets.
    pub(super) fn is_encoded(layer: LazLayer) -> bool {
        matches!(layer, LazLayer::Colours | LazLayer::Infrared | LazLayer::ExtraBytes)
    }

    /// Encodes an item after the last one; both are as long as [`size`](Self::size) says.
    #[inline(always)]
    pub(super) fn put(&mut self, coder: &mut RangeEncoder, last: &[u8], item: &[u8]) {
        match self {
            Self::Colour(colour) => {
                if let (Ok(last), Ok(item)) = (last.try_into(), item.try_into()) {
                    colour.put(coder, last, item);
                }
            }
            Self::Infrared(value) => {
                if let (Ok(last), Ok(item)) = (last.try_into(), item.try_into()) {
                    value.put(coder, last, item);
                }
            }
            Self::Bytes(models) => {
                for ((last, byte), model) in last.iter().zip(item).zip(models) {
                    coder.symbol(model.ready(256), byte.wrapping_sub(*last).into());
                }
            }
            Self::OldTime(_) | Self::Time(_) | Self::OldColour(_) | Self::Packet(_) => {}
        }
    }
}

/// Splits off the first `N` bytes.
#[inline(always)]
fn take<'r, const N: usize>(rest: &mut &'r mut [u8]) -> Option<&'r mut [u8; N]> {
    let (part, after) = mem::take(rest).split_first_chunk_mut()?;
    *rest = after;
    Some(part)
}
