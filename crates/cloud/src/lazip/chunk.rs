//! A compressed chunk, its streams, and kinds of damage.

use std::fmt;

/// A compressed chunk.
#[derive(Clone, Copy, Debug)]
pub struct CompressedChunk<'a> {
    /// Bytes from the record of the first point; surplus bytes are ignored.
    pub bytes: &'a [u8],
    /// Number of points to decode.
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
    /// Whole records, if fields are not layers.
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

/// Damage of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChunkDamage {
    /// The bytes end before the streams.
    Short,
    /// The chunk states this number of points, which is less than requested.
    Count(u32),
    /// A stream does not end with its last point, or is not valid output of an encoder.
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
