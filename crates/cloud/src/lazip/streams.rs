//! The streams of a layered chunk, and what is wrong with them.

use super::chunk::{Damage, LazLayer};
use super::coder::Coder;
use super::machine::InstructionSet;

/// The streams of what grids and meshes need. A stream that is absent leaves its field as it was.
#[derive(Clone, Copy)]
pub(super) struct Streams<'a, M> {
    pub(super) places: Coder<'a, M>,
    pub(super) heights: Option<Coder<'a, M>>,
    pub(super) classes: Option<Coder<'a, M>>,
    pub(super) flags: Option<Coder<'a, M>>,
}

impl<'a, M: InstructionSet> Streams<'a, M> {
    /// The same, for another machine.
    pub(super) fn on<N: InstructionSet>(self) -> Streams<'a, N> {
        Streams {
            places: self.places.on(),
            heights: self.heights.map(Coder::on),
            classes: self.classes.map(Coder::on),
            flags: self.flags.map(Coder::on),
        }
    }

    /// Says which layer is not `right`, if any is not.
    pub(super) fn check(&self, right: fn(&Coder<'a, M>) -> bool) -> Result<(), Damage> {
        check(LazLayer::Places, &Some(self.places), right)?;
        check(LazLayer::Heights, &self.heights, right)?;
        check(LazLayer::Classes, &self.classes, right)?;
        check(LazLayer::Flags, &self.flags, right)
    }
}

/// The streams of what else there is in whole records.
pub(super) struct RestStreams<'a, M> {
    pub(super) intensities: Option<Coder<'a, M>>,
    pub(super) angles: Option<Coder<'a, M>>,
    pub(super) user_data: Option<Coder<'a, M>>,
    pub(super) sources: Option<Coder<'a, M>>,
    pub(super) times: Option<Coder<'a, M>>,
    /// Those of what follows the part that all formats share.
    pub(super) tails: Vec<(LazLayer, Option<Coder<'a, M>>)>,
}

impl<'a, M: InstructionSet> RestStreams<'a, M> {
    /// The same, for another machine.
    pub(super) fn on<N: InstructionSet>(&self) -> RestStreams<'a, N> {
        let on = |(layer, coder): &(LazLayer, Option<Coder<'a, M>>)| (*layer, coder.map(Coder::on));
        RestStreams {
            intensities: self.intensities.map(Coder::on),
            angles: self.angles.map(Coder::on),
            user_data: self.user_data.map(Coder::on),
            sources: self.sources.map(Coder::on),
            times: self.times.map(Coder::on),
            tails: self.tails.iter().map(on).collect(),
        }
    }

    /// Says which layer is not `right`, if any is not.
    pub(super) fn check(&self, right: fn(&Coder<'a, M>) -> bool) -> Result<(), Damage> {
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
    coder: &Option<Coder<'a, M>>,
    right: fn(&Coder<'a, M>) -> bool,
) -> Result<(), Damage> {
    match coder {
        Some(coder) if !right(coder) => Err(Damage::Layer(layer)),
        _ => Ok(()),
    }
}
