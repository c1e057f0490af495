//! The streams of a layered chunk, and their checks.

use super::chunk::{ChunkDamage, LazLayer};
use super::coder::RangeDecoder;
use super::machine::InstructionSet;

/// The streams of the columns. A missing stream means that its field is constant.
#[derive(Clone, Copy)]
pub(super) struct Streams<'a, M> {
    pub(super) places: RangeDecoder<'a, M>,
    pub(super) heights: Option<RangeDecoder<'a, M>>,
    pub(super) classes: Option<RangeDecoder<'a, M>>,
    pub(super) flags: Option<RangeDecoder<'a, M>>,
}

impl<'a, M: InstructionSet> Streams<'a, M> {
    /// The same for another instruction set.
    pub(super) fn on<N: InstructionSet>(self) -> Streams<'a, N> {
        Streams {
            places: self.places.on(),
            heights: self.heights.map(RangeDecoder::on),
            classes: self.classes.map(RangeDecoder::on),
            flags: self.flags.map(RangeDecoder::on),
        }
    }

    /// Reports the first layer that is not `right`, if any.
    pub(super) fn check(&self, right: fn(&RangeDecoder<'a, M>) -> bool) -> Result<(), ChunkDamage> {
        check(LazLayer::Places, &Some(self.places), right)?;
        check(LazLayer::Heights, &self.heights, right)?;
        check(LazLayer::Classes, &self.classes, right)?;
        check(LazLayer::Flags, &self.flags, right)
    }
}

/// The other streams of whole records.
pub(super) struct RestStreams<'a, M> {
    pub(super) intensities: Option<RangeDecoder<'a, M>>,
    pub(super) angles: Option<RangeDecoder<'a, M>>,
    pub(super) user_data: Option<RangeDecoder<'a, M>>,
    pub(super) sources: Option<RangeDecoder<'a, M>>,
    pub(super) times: Option<RangeDecoder<'a, M>>,
    /// Streams of the fields after the common ones.
    pub(super) tails: Vec<(LazLayer, Option<RangeDecoder<'a, M>>)>,
}

impl<'a, M: InstructionSet> RestStreams<'a, M> {
    /// The same for another instruction set.
    pub(super) fn on<N: InstructionSet>(&self) -> RestStreams<'a, N> {
        let tails = self.tails.iter().map(|(layer, coder)| (*layer, coder.map(RangeDecoder::on)));
        RestStreams {
            intensities: self.intensities.map(RangeDecoder::on),
            angles: self.angles.map(RangeDecoder::on),
            user_data: self.user_data.map(RangeDecoder::on),
            sources: self.sources.map(RangeDecoder::on),
            times: self.times.map(RangeDecoder::on),
            tails: tails.collect(),
        }
    }

    /// Reports the first layer that is not `right`, if any.
    pub(super) fn check(&self, right: fn(&RangeDecoder<'a, M>) -> bool) -> Result<(), ChunkDamage> {
        check(LazLayer::Intensities, &self.intensities, right)?;
        check(LazLayer::Angles, &self.angles, right)?;
        check(LazLayer::UserData, &self.user_data, right)?;
        check(LazLayer::Sources, &self.sources, right)?;
        check(LazLayer::Times, &self.times, right)?;
        self.tails.iter().try_for_each(|(layer, coder)| check(*layer, coder, right))
    }
}

fn check<'a, M>(
    layer: LazLayer,
    coder: &Option<RangeDecoder<'a, M>>,
    right: fn(&RangeDecoder<'a, M>) -> bool,
) -> Result<(), ChunkDamage> {
    match coder {
        Some(coder) if !right(coder) => Err(ChunkDamage::Layer(layer)),
        _ => Ok(()),
    }
}
