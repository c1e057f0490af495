//! A point with the fields of columns.

use super::returns::ReturnNumbers;

/// Bytes of the common fields of formats 6 to 10.
pub(super) const RECORD: usize = 30;

/// The fields of a point.
#[derive(Clone, Copy)]
pub(super) struct LazPoint {
    pub(super) place: [i32; 3],
    pub(super) returns: ReturnNumbers,
    pub(super) class: u8,
    /// Synthetic, key point, withheld, overlap; then scan direction and edge of flight line.
    pub(super) flags: u8,
}

impl LazPoint {
    /// The point and the scanner channel of a record.
    pub(super) fn new(record: &[u8; RECORD]) -> (Self, usize) {
        let flags = record[15];
        let point = Self {
            place: [0, 4, 8].map(|at| i32::from_le_bytes(std::array::from_fn(|i| record[at + i]))),
            returns: ReturnNumbers(record[14]),
            class: record[16],
            flags: flags & 15 | flags >> 2 & 0x30,
        };
        (point, usize::from(flags >> 4 & 3))
    }
}
