//! A compressed chunk, its streams, and its possible damage.

use std::fmt;

/// A compressed chunk.
#[derive(Clone, Copy, Debug)]
pub struct CompressedChunk<'a> {
    /// Its bytes, from the record of the first point on; bytes that follow are passed over.
    pub bytes: &'a [u8],
    /// How many points to decode.
    pub count: usize,
}

/// A stream within a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LazLayer {
    /// x, y, return numbers, scanner channel.
    Places,
    /// z.
    Heights,
    /// Classes.
    Classes,
    /// Flags.
    Flags,
    /// Intensities.
    Intensities,
    /// Scan angles.
    Angles,
    /// User data.
    UserData,
    /// Point sources.
    Sources,
    /// Times.
    Times,
    /// Colours.
    Colours,
    /// Near infrared.
    Infrared,
    /// Wave packets.
    Packets,
    /// One of the extra bytes.
    ExtraBytes,
    /// Whole records, where fields are no layers.
    Records,
}

impl fmt::Display for LazLayer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Places => "places and returns",
            Self::Heights => "heights",
            Self::Classes => "classes",
            Self::Flags => "flags",
            Self::Intensities => "intensities",
            Self::Angles => "scan angles",
            Self::UserData => "user data",
            Self::Sources => "point sources",
            Self::Times => "times",
            Self::Colours => "colours",
            Self::Infrared => "infrared",
            Self::Packets => "wave packets",
            Self::ExtraBytes => "extra bytes",
            Self::Records => "records",
        })
    }
}

/// What is wrong with a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChunkDamage {
    /// The bytes end before the streams do.
    Short,
    /// The chunk says that it holds fewer points than asked for: this many.
    Count(u32),
    /// A stream does not end with its last point, or holds what no encoder writes.
    Layer(LazLayer),
}

impl fmt::Display for ChunkDamage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short => f.write_str("the chunk is truncated"),
            Self::Count(held) => write!(f, "the chunk holds only {held} points"),
            Self::Layer(layer) => write!(f, "the stream of {layer} is damaged"),
        }
    }
}
