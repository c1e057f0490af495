//! Fields of points, and their selection for decoding.

use super::point::LazPoint;

/// Fields to decode besides x, y and the return numbers. Unselected layers cost nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FieldSelection {
    /// The height.
    pub z: bool,
    /// The class.
    pub class: bool,
    /// The flags.
    pub flags: bool,
    /// Whole records, with all fields.
    pub records: bool,
}

impl FieldSelection {
    /// Every field with a column.
    pub const ALL: Self = Self { z: true, class: true, flags: true, records: false };
    /// Whole records, and every field with a column.
    pub const RECORDS: Self = Self { records: true, ..Self::ALL };
}

/// Fields of points, an element per point; unselected fields have arbitrary values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DecodedFields {
    /// x, y, z as stored.
    pub places: Vec<[i32; 3]>,
    /// Classes.
    pub classes: Vec<u8>,
    /// Return number in the low half, number of returns of the pulse in the high half.
    pub returns: Vec<u8>,
    /// Synthetic (1), key point (2), withheld (4), overlap (8), scan direction (16), edge of flight
    /// line (32).
    pub flags: Vec<u8>,
    /// Concatenated whole records, if selected; otherwise empty.
    pub records: Vec<u8>,
}

/// Lengths of [`DecodedFields`].
#[derive(Clone, Copy)]
pub(super) struct DecodedLength {
    points: usize,
    bytes: usize,
}

impl DecodedFields {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Removes all points and keeps the allocation.
    pub fn clear(&mut self) {
        self.truncate(DecodedLength { points: 0, bytes: 0 });
    }

    pub(super) fn mark(&self) -> DecodedLength {
        DecodedLength { points: self.len(), bytes: self.records.len() }
    }

    pub(super) fn truncate(&mut self, DecodedLength { points, bytes }: DecodedLength) {
        self.places.truncate(points);
        self.classes.truncate(points);
        self.returns.truncate(points);
        self.flags.truncate(points);
        self.records.truncate(bytes);
    }

    /// Adds `count` points to be filled in; returns the index of the first.
    pub(super) fn grow(&mut self, count: usize) -> usize {
        let (from, to) = (self.len(), self.len() + count);
        self.places.resize(to, [0; 3]);
        self.classes.resize(to, 0);
        self.returns.resize(to, 0);
        self.flags.resize(to, 0);
        from
    }

    pub(super) fn reserve(&mut self, count: usize) {
        self.places.reserve(count);
        self.classes.reserve(count);
        self.returns.reserve(count);
        self.flags.reserve(count);
    }

    #[inline(always)]
    pub(super) fn push(&mut self, point: &LazPoint) {
        self.places.push(point.place);
        self.classes.push(point.class);
        self.returns.push(point.returns.0);
        self.flags.push(point.flags);
    }
}
