//! A point as stored in a file, and its flags.

use serde::{Deserialize, Serialize};

/// A point as stored.
pub(super) trait RawPoint: Copy {
    /// Steps of the file's lattice.
    fn xyz(self) -> [i32; 3];
    fn class(self) -> u8;
    /// Return number and number of returns.
    fn returns(self) -> [u8; 2];
    fn flags(self) -> Flags;
}

/// Classification flags of a point, with the bits of LAS 1.4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Flags(pub u8);

impl Flags {
    /// Synthetic point.
    pub const SYNTHETIC: Self = Self(1);
    /// Model key point, not to be thinned.
    pub const KEY: Self = Self(2);
    /// Withheld point.
    pub const WITHHELD: Self = Self(4);
    /// Overlap point.
    pub const OVERLAP: Self = Self(8);

    /// All flags with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("synthetic", Self::SYNTHETIC),
        ("keypoint", Self::KEY),
        ("withheld", Self::WITHHELD),
        ("overlap", Self::OVERLAP),
    ];

    /// The union of flags.
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// True if the two have a flag in common.
    pub const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}
