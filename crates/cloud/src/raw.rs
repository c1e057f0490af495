//! A point as stored in a file, and its flags.

use serde::{Deserialize, Serialize};

/// A point as its file has it.
pub(super) trait RawPoint: Copy {
    /// Steps of the file's own lattice.
    fn xyz(self) -> [i32; 3];
    fn class(self) -> u8;
    /// Number of the return, and returns of the pulse.
    fn returns(self) -> [u8; 2];
    fn flags(self) -> Flags;
}

/// Marks that a point may bear, by the bits of LAS 1.4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Flags(pub u8);

impl Flags {
    /// Made by other means than measuring.
    pub const SYNTHETIC: Self = Self(1);
    /// A key point of a model, not to be thinned out.
    pub const KEY: Self = Self(2);
    /// To be left out.
    pub const WITHHELD: Self = Self(4);
    /// In the overlap of flight lines.
    pub const OVERLAP: Self = Self(8);

    /// All marks with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("synthetic", Self::SYNTHETIC),
        ("keypoint", Self::KEY),
        ("withheld", Self::WITHHELD),
        ("overlap", Self::OVERLAP),
    ];

    /// The marks of both.
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// True when the two have a mark in common.
    pub const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}
