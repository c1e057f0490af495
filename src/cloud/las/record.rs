//! Fields of uncompressed point records (ASPRS LAS 1.4 R15, tables 7 and 15).

use crate::cloud::Flags;
use crate::cloud::sieve::Raw;

/// A record of formats 0 to 5.
#[derive(Clone, Copy)]
pub(in crate::cloud) struct Old<'a>(&'a [u8; 16]);

/// A record of formats 6 to 10.
#[derive(Clone, Copy)]
pub(in crate::cloud) struct New<'a>(&'a [u8; 17]);

impl<'a> Old<'a> {
    /// From a whole record.
    #[inline(always)]
    pub(in crate::cloud) fn of(record: &'a [u8]) -> Self {
        Self(record.first_chunk().unwrap_or(&[0; 16]))
    }
}

impl<'a> New<'a> {
    /// From a whole record.
    #[inline(always)]
    pub(in crate::cloud) fn of(record: &'a [u8]) -> Self {
        Self(record.first_chunk().unwrap_or(&[0; 17]))
    }
}

/// The class that stands for the mark of overlap in formats without it.
const OVERLAP_CLASS: u8 = 12;

fn xyz(bytes: &[u8]) -> [i32; 3] {
    let (fours, _) = bytes.as_chunks::<4>();
    [fours[0], fours[1], fours[2]].map(i32::from_le_bytes)
}

impl Raw for Old<'_> {
    #[inline(always)]
    fn xyz(self) -> [i32; 3] {
        xyz(&self.0[..12])
    }

    #[inline(always)]
    fn class(self) -> u8 {
        self.0[15] & 31
    }

    #[inline(always)]
    fn returns(self) -> [u8; 2] {
        [self.0[14] & 7, self.0[14] >> 3 & 7]
    }

    #[inline(always)]
    fn flags(self) -> Flags {
        let overlap = if self.class() == OVERLAP_CLASS { Flags::OVERLAP } else { Flags::default() };
        Flags(self.0[15] >> 5).and(overlap)
    }
}

impl Raw for New<'_> {
    #[inline(always)]
    fn xyz(self) -> [i32; 3] {
        xyz(&self.0[..12])
    }

    #[inline(always)]
    fn class(self) -> u8 {
        self.0[16]
    }

    #[inline(always)]
    fn returns(self) -> [u8; 2] {
        [self.0[14] & 15, self.0[14] >> 4]
    }

    #[inline(always)]
    fn flags(self) -> Flags {
        Flags(self.0[15] & 15)
    }
}
