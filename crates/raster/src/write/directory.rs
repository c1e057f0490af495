//! TIFF directories, classic and BigTIFF: tags, and tables of contiguous blocks.

use std::io::{self, Write};

use crate::tiled_tiff::tags::TiffTagValues;

/// TIFF variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TiffVariant {
    /// 32-bit offsets.
    Classic,
    /// 64-bit offsets.
    Big,
}

impl TiffVariant {
    /// Size of the file header and of the offset of the first directory in bytes.
    pub(super) fn start(self) -> u64 {
        if self == Self::Classic { 8 } else { 16 }
    }

    /// Maximum file size in bytes.
    pub(super) fn most(self) -> u64 {
        if self == Self::Classic { u64::from(u32::MAX) } else { i64::MAX as u64 }
    }

    /// The file header.
    pub(super) fn header(self) -> Vec<u8> {
        let mut header = b"II".to_vec();
        match self {
            Self::Classic => header.extend([42, 0]),
            Self::Big => header.extend([43, 0, 8, 0, 0, 0]),
        }
        self.word(self.start(), &mut header);
        header
    }

    /// Size of an offset, of a count, and of values stored inside an entry.
    fn word_bytes(self) -> u64 {
        if self == Self::Classic { 4 } else { 8 }
    }

    fn word(self, value: u64, out: &mut Vec<u8>) {
        out.extend_from_slice(&value.to_le_bytes()[..self.word_bytes() as usize]);
    }

    /// Size of the entry count, and of an entry.
    fn counts(self) -> (u64, u64) {
        if self == Self::Classic { (2, 12) } else { (8, 20) }
    }
}

/// Alignment of values.
const ALIGNMENT: u64 = 8;
const LONG: u16 = 4;
const LONG8: u16 = 16;

/// Directory of one image. The file stores the blocks by position, with those of all bands at a
/// position together; the tables list them band by band.
#[derive(Debug)]
pub(super) struct TiffDirectoryBuilder {
    fields: Vec<(u16, TiffFieldContent)>,
    blocks: u64,
    bands: u32,
}

#[derive(Debug)]
enum TiffFieldContent {
    Values(TiffTagValues),
    Offsets,
    Sizes,
}

/// Offsets of the parts of one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct TiffOffsets {
    /// Offset of the directory, a multiple of 8.
    pub(super) at: u64,
    /// Offset of the next directory, 0 after the last.
    pub(super) next: u64,
    /// Offset of the first block.
    pub(super) data: u64,
}

impl TiffDirectoryBuilder {
    /// A directory of `tags` in any order, with block tables in the tags `offsets` and `sizes`.
    pub(super) fn new(
        tags: Vec<(u16, TiffTagValues)>,
        [offsets, sizes]: [u16; 2],
        blocks: u64,
        bands: u32,
    ) -> Self {
        let values = tags.into_iter().map(|(tag, values)| (tag, TiffFieldContent::Values(values)));
        let tables = [(offsets, TiffFieldContent::Offsets), (sizes, TiffFieldContent::Sizes)];
        let mut fields: Vec<_> = values.chain(tables).collect();
        fields.sort_by_key(|(tag, _)| *tag);
        Self { fields, blocks, bands }
    }

    /// Size of the directory with all its values, a multiple of 8.
    pub(super) fn bytes(&self, form: TiffVariant) -> u64 {
        let large = self.fields.iter().map(|(_, content)| self.content_bytes(content, form));
        let large = large.filter(|bytes| *bytes > form.word_bytes());
        self.head_bytes(form) + large.map(|bytes| bytes.next_multiple_of(ALIGNMENT)).sum::<u64>()
    }

    fn head_bytes(&self, form: TiffVariant) -> u64 {
        let (count, entry) = form.counts();
        let head = count + entry * self.fields.len() as u64 + form.word_bytes();
        head.next_multiple_of(ALIGNMENT)
    }

    fn content_bytes(&self, content: &TiffFieldContent, form: TiffVariant) -> u64 {
        match content {
            TiffFieldContent::Values(values) => values.bytes().len() as u64,
            TiffFieldContent::Offsets => self.blocks * form.word_bytes(),
            TiffFieldContent::Sizes => self.blocks * 4,
        }
    }

    /// Field type and number of values.
    fn kind(&self, content: &TiffFieldContent, form: TiffVariant) -> (u16, u64) {
        match content {
            TiffFieldContent::Values(values) => (values.kind(), values.count()),
            TiffFieldContent::Offsets if form == TiffVariant::Big => (LONG8, self.blocks),
            TiffFieldContent::Offsets | TiffFieldContent::Sizes => (LONG, self.blocks),
        }
    }

    /// Writes the directory of [`bytes`](Self::bytes) bytes; `sizes` are the block sizes.
    pub(super) fn write(
        &self,
        out: &mut impl Write,
        form: TiffVariant,
        places: TiffOffsets,
        sizes: &[u32],
    ) -> io::Result<()> {
        out.write_all(&self.head(form, places, sizes)?)?;
        for (_, content) in &self.fields {
            let bytes = self.content_bytes(content, form);
            if bytes > form.word_bytes() {
                self.write_content(content, out, form, places.data, sizes)?;
                let padding = bytes.next_multiple_of(ALIGNMENT) - bytes;
                out.write_all(&[0; ALIGNMENT as usize][..padding as usize])?;
            }
        }
        Ok(())
    }

    /// The entries; values that do not fit into an entry follow all entries.
    fn head(&self, form: TiffVariant, places: TiffOffsets, sizes: &[u32]) -> io::Result<Vec<u8>> {
        let (count_bytes, entry_bytes) = form.counts();
        let mut head = (self.fields.len() as u64).to_le_bytes()[..count_bytes as usize].to_vec();
        let mut place = places.at + self.head_bytes(form);
        for (tag, content) in &self.fields {
            let end = head.len() + entry_bytes as usize;
            let (kind, count) = self.kind(content, form);
            head.extend(tag.to_le_bytes());
            head.extend(kind.to_le_bytes());
            form.word(count, &mut head);
            let bytes = self.content_bytes(content, form);
            if bytes > form.word_bytes() {
                form.word(place, &mut head);
                place += bytes.next_multiple_of(ALIGNMENT);
            } else {
                self.write_content(content, &mut head, form, places.data, sizes)?;
            }
            head.resize(end, 0);
        }
        form.word(places.next, &mut head);
        head.resize(self.head_bytes(form) as usize, 0);
        Ok(head)
    }

    fn write_content(
        &self,
        content: &TiffFieldContent,
        out: &mut impl Write,
        form: TiffVariant,
        data: u64,
        sizes: &[u32],
    ) -> io::Result<()> {
        match content {
            TiffFieldContent::Values(values) => out.write_all(&values.bytes()),
            TiffFieldContent::Sizes => {
                self.by_band(sizes).try_for_each(|size| out.write_all(&size.to_le_bytes()))
            }
            TiffFieldContent::Offsets => {
                let mut next = data;
                let places = sizes.iter().map(|size| {
                    let place = next;
                    next += u64::from(*size);
                    place
                });
                let places: Vec<u64> = places.collect();
                self.by_band(&places)
                    .try_for_each(|p| out.write_all(&p.to_le_bytes()[..form.word_bytes() as usize]))
            }
        }
    }

    /// Values of blocks in file order, reordered band by band.
    fn by_band<'a, T>(&self, blocks: &'a [T]) -> impl Iterator<Item = &'a T> {
        let bands = self.bands as usize;
        (0..bands).flat_map(move |band| blocks.iter().skip(band).step_by(bands))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_as_many_as_were_announced() {
        for form in [TiffVariant::Classic, TiffVariant::Big] {
            for blocks in [1_u32, 2, 3, 1000] {
                let tags = vec![
                    (339, TiffTagValues::Short(vec![3])),
                    (256, TiffTagValues::Long(vec![7])),
                    (33_550, TiffTagValues::Double(vec![1.0, 2.0, 0.0])),
                    (305, TiffTagValues::Ascii("abc".to_owned())),
                ];
                let directory = TiffDirectoryBuilder::new(tags, [324, 325], u64::from(blocks), 1);
                let sizes: Vec<u32> = (0..blocks).map(|i| i + 5).collect();
                let places = TiffOffsets { at: form.start(), next: 0, data: 99 };
                let mut out = Vec::new();
                directory.write(&mut out, form, places, &sizes).unwrap();
                assert_eq!(out.len() as u64, directory.bytes(form), "{form:?} {blocks}");
                assert_eq!(out[0], 6);
            }
        }
    }

    #[test]
    fn blocks_beyond_four_gibibytes_keep_their_offsets() {
        let directory = TiffDirectoryBuilder::new(Vec::new(), [324, 325], 2, 1);
        let mut out = Vec::new();
        let data = u64::from(u32::MAX) - 1;
        directory
            .write(&mut out, TiffVariant::Big, TiffOffsets { at: 16, next: 0, data }, &[9, 9])
            .unwrap();
        let offsets: Vec<u8> = [data, data + 9].iter().flat_map(|at| at.to_le_bytes()).collect();
        assert!(out.windows(16).any(|bytes| bytes == offsets), "{out:?}");
    }

    #[test]
    fn tables_go_band_by_band() {
        let directory = TiffDirectoryBuilder::new(Vec::new(), [324, 325], 6, 2);
        let mut out = Vec::new();
        let places = TiffOffsets { at: 8, next: 0, data: 100 };
        directory.write(&mut out, TiffVariant::Classic, places, &[1, 10, 2, 20, 3, 30]).unwrap();
        let words: Vec<u32> =
            out.chunks_exact(4).map(|w| u32::from_le_bytes(w.try_into().unwrap())).collect();
        let has = |run: &[u32]| words.windows(run.len()).any(|words| words == run);
        assert!(has(&[1, 2, 3, 10, 20, 30]) && has(&[100, 111, 133, 101, 113, 136]), "{words:?}");
    }

    #[test]
    fn a_directory_to_the_byte() {
        let directory =
            TiffDirectoryBuilder::new(vec![(256, TiffTagValues::Long(vec![7]))], [273, 279], 2, 1);
        let mut out = Vec::new();
        let places = TiffOffsets { at: 8, next: 0, data: 0x100 };
        directory.write(&mut out, TiffVariant::Classic, places, &[5, 6]).unwrap();
        let mut expected = vec![3, 0, 0, 1, 4, 0, 1, 0, 0, 0, 7, 0, 0, 0];
        expected.extend([17, 1, 4, 0, 2, 0, 0, 0, 56, 0, 0, 0]);
        expected.extend([23, 1, 4, 0, 2, 0, 0, 0, 64, 0, 0, 0]);
        expected.resize(48, 0);
        expected.extend([0, 1, 0, 0, 5, 1, 0, 0, 5, 0, 0, 0, 6, 0, 0, 0]);
        assert_eq!(out, expected);
        assert_eq!(TiffVariant::Classic.header(), [b'I', b'I', 42, 0, 8, 0, 0, 0]);
    }
}
