//! Fields of points, from records (ASPRS LAS 1.4 R15, tables 7 and 15) or from decompressed fields.

use crate::lazip::DecodedFields;
use crate::raw::{Flags, RawPoint};

/// A record of formats 0 to 5.
#[derive(Clone, Copy)]
pub(crate) struct LegacyLasRecord<'a>(&'a [u8; 16]);

/// A record of formats 6 to 10.
#[derive(Clone, Copy)]
pub(crate) struct ModernLasRecord<'a>(&'a [u8; 17]);

impl<'a> LegacyLasRecord<'a> {
    /// From a whole record.
    #[inline(always)]
    pub(crate) fn of(record: &'a [u8]) -> Self {
        Self(record.first_chunk().unwrap_or(&[0; 16]))
    }
}

impl<'a> ModernLasRecord<'a> {
    /// From a whole record.
    #[inline(always)]
    pub(crate) fn of(record: &'a [u8]) -> Self {
        Self(record.first_chunk().unwrap_or(&[0; 17]))
    }
}

/// Class of overlap points in point formats without the overlap flag.
pub(crate) const OVERLAP_CLASS: u8 = 12;

#[inline(always)]
fn old_flags(bits: u8, class: u8) -> Flags {
    let overlap = if class == OVERLAP_CLASS { Flags::OVERLAP } else { Flags::default() };
    Flags(bits & 7).and(overlap)
}

fn xyz(bytes: &[u8]) -> [i32; 3] {
    let (fours, _) = bytes.as_chunks::<4>();
    [fours[0], fours[1], fours[2]].map(i32::from_le_bytes)
}

impl RawPoint for LegacyLasRecord<'_> {
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
        old_flags(self.0[15] >> 5, self.class())
    }
}

impl RawPoint for ModernLasRecord<'_> {
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

/// A decompressed point, of formats 6 to 10 if it is `NEW`.
#[derive(Clone, Copy)]
pub(crate) struct UnpackedLasPoint<const NEW: bool> {
    place: [i32; 3],
    class: u8,
    returns: u8,
    flags: u8,
}

/// Decompressed points.
pub(crate) fn unpacked<const NEW: bool>(
    fields: &DecodedFields,
) -> impl ExactSizeIterator<Item = UnpackedLasPoint<NEW>> + Clone {
    let bytes = fields.classes.iter().zip(&fields.returns).zip(&fields.flags);
    fields.places.iter().zip(bytes).map(|(place, ((class, returns), flags))| UnpackedLasPoint {
        place: *place,
        class: *class,
        returns: *returns,
        flags: *flags,
    })
}

impl<const NEW: bool> RawPoint for UnpackedLasPoint<NEW> {
    #[inline(always)]
    fn xyz(self) -> [i32; 3] {
        self.place
    }

    #[inline(always)]
    fn class(self) -> u8 {
        self.class
    }

    #[inline(always)]
    fn returns(self) -> [u8; 2] {
        [self.returns & 15, self.returns >> 4]
    }

    #[inline(always)]
    fn flags(self) -> Flags {
        match NEW {
            true => Flags(self.flags & 15),
            false => old_flags(self.flags, self.class),
        }
    }
}
