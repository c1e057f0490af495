//! FlatBuffers builder that writes front to back: a table first, then its targets.

/// A size-prefixed buffer; offsets and alignment are relative to the size prefix.
pub(super) struct FlatbufferBuilder {
    pub(super) bytes: Vec<u8>,
}

/// A field of a table.
pub(super) enum FlatbufferField {
    /// Absent.
    None,
    U8(u8),
    U16(u16),
    I32(i32),
    U64(u64),
    /// An offset to be set later.
    Link,
}

impl FlatbufferField {
    fn size(&self) -> usize {
        match self {
            Self::None => 0,
            Self::U8(_) => 1,
            Self::U16(_) => 2,
            Self::I32(_) | Self::Link => 4,
            Self::U64(_) => 8,
        }
    }
}

impl FlatbufferBuilder {
    /// An empty buffer whose root is the table that is appended next.
    pub(super) fn new() -> Self {
        // Size prefix, and offset of the root.
        Self { bytes: vec![0; 8] }
    }

    /// The buffer with its size prefix.
    pub(super) fn finish(mut self) -> Option<Vec<u8>> {
        let size = u32::try_from(self.bytes.len() - 4).ok()?;
        self.bytes[..4].copy_from_slice(&size.to_le_bytes());
        Some(self.bytes)
    }

    fn align(&mut self, to: usize) {
        self.bytes.resize(self.bytes.len().next_multiple_of(to), 0);
    }

    /// Appends a table and returns the offset of each field, for [`link`](Self::link).
    pub(super) fn table(&mut self, slots: &[FlatbufferField]) -> (usize, Vec<usize>) {
        // Large fields first, so that fields are aligned without gaps; the table is aligned so that the
        // content after its first four bytes is.
        let list = 4 + 2 * slots.len();
        self.align(8);
        while !(self.bytes.len() + list + 4).is_multiple_of(8) {
            self.bytes.push(0);
        }
        let start = self.bytes.len();
        let table = start + list;
        let mut places = vec![0; slots.len()];
        let mut end = table + 4;
        for size in [8, 4, 2, 1] {
            for (place, _) in places.iter_mut().zip(slots).filter(|(_, slot)| slot.size() == size) {
                *place = end;
                end += size;
            }
        }
        self.bytes.resize(end, 0);
        self.set(start, &(list as u16).to_le_bytes());
        self.set(start + 2, &((end - table) as u16).to_le_bytes());
        self.set(table, &(list as i32).to_le_bytes());
        for (at, (slot, &place)) in slots.iter().zip(&places).enumerate() {
            let offset = if place == 0 { 0 } else { place - table };
            self.set(start + 4 + 2 * at, &(offset as u16).to_le_bytes());
            match slot {
                FlatbufferField::None | FlatbufferField::Link => {}
                FlatbufferField::U8(value) => self.set(place, &value.to_le_bytes()),
                FlatbufferField::U16(value) => self.set(place, &value.to_le_bytes()),
                FlatbufferField::I32(value) => self.set(place, &value.to_le_bytes()),
                FlatbufferField::U64(value) => self.set(place, &value.to_le_bytes()),
            }
        }
        (table, places)
    }

    fn set(&mut self, at: usize, bytes: &[u8]) {
        self.bytes[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Sets the offset field at `place` to `target`, which follows it. Offsets out of range are detected in
    /// `finish`.
    pub(super) fn link(&mut self, place: usize, target: usize) {
        self.set(place, &((target - place) as u32).to_le_bytes());
    }

    /// Sets the root table.
    pub(super) fn set_root(&mut self, table: usize) {
        self.link(4, table);
    }

    /// Appends a vector of `count` items of `size` bytes and links `place` to it.
    pub(super) fn list(
        &mut self,
        place: usize,
        count: usize,
        size: usize,
        items: impl Iterator<Item = u8>,
    ) {
        while !(self.bytes.len() + 4).is_multiple_of(size.max(4)) {
            self.bytes.push(0);
        }
        self.link(place, self.bytes.len());
        self.bytes.extend_from_slice(&(count as u32).to_le_bytes());
        self.bytes.extend(items);
    }

    /// Appends a vector of numbers.
    pub(super) fn numbers(&mut self, place: usize, numbers: &[f64]) {
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes());
        self.list(place, numbers.len(), 8, bytes);
    }

    /// Appends a zero-terminated string.
    pub(super) fn text(&mut self, place: usize, text: &str) {
        self.list(place, text.len(), 1, text.bytes());
        self.bytes.push(0);
    }

    /// Appends a vector of `count` table offsets and returns their positions.
    pub(super) fn links(&mut self, place: usize, count: usize) -> Vec<usize> {
        self.list(place, count, 4, std::iter::repeat_n(0, count * 4));
        let first = self.bytes.len() - count * 4;
        (0..count).map(|at| first + at * 4).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flatgeobuf::view::FlatbufferTable;

    #[test]
    fn what_is_built_is_seen() {
        let mut build = FlatbufferBuilder::new();
        let slots = [
            FlatbufferField::Link,
            FlatbufferField::U8(7),
            FlatbufferField::None,
            FlatbufferField::U64(9),
            FlatbufferField::U16(3),
            FlatbufferField::Link,
            FlatbufferField::I32(-2),
        ];
        let (root, places) = build.table(&slots);
        build.set_root(root);
        assert!(places[3] % 8 == 0 && places[4] % 2 == 0 && places[6] % 4 == 0);
        build.text(places[0], "é");
        for link in build.links(places[5], 2) {
            let (table, places) = build.table(&[FlatbufferField::Link]);
            build.link(link, table);
            build.numbers(places[0], &[1.5]);
        }
        let bytes = build.finish().unwrap();
        let view = FlatbufferTable::root(&bytes[4..]).unwrap();
        assert_eq!(
            (view.text(0).unwrap(), view.u8(1).unwrap(), view.u8(2).unwrap()),
            (Some("é"), 7, 0)
        );
        assert_eq!(view.number(3).unwrap().map(u64::from_le_bytes), Some(9));
        assert_eq!(view.number(6).unwrap().map(i32::from_le_bytes), Some(-2));
        assert_eq!(view.u8(40).unwrap(), 0);
        let tables: Vec<_> =
            view.tables(5).unwrap().map(|t| t.unwrap().list(0, 8).unwrap()).collect();
        assert_eq!(tables, [1.5_f64.to_le_bytes(), 1.5_f64.to_le_bytes()]);
        for end in 0..bytes.len() - 4 {
            let _ =
                FlatbufferTable::root(&bytes[4..4 + end]).and_then(|view| view.text(0).map(|_| ()));
        }
    }
}
