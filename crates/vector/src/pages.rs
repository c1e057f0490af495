//! Random access to records of input files through a buffer.

use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::{AHEAD, RawFile};

/// Bytes read at a time for adjacent records.
const CHUNK_BYTES: u64 = 1 << 18;
/// Minimum number of bytes read for scattered records.
const PAGE_BYTES: u64 = 1 << 12;

/// A file and its buffered part.
pub(super) struct PagedFile {
    file: RawFile,
    buffer: Vec<u8>,
    base: u64,
}

impl PagedFile {
    pub(super) fn open(path: &Path) -> Result<Self> {
        Ok(Self::of(RawFile::open(path)?))
    }

    pub(super) fn of(file: RawFile) -> Self {
        Self { file, buffer: Vec::new(), base: 0 }
    }

    /// Length of the file in bytes.
    pub(super) fn len(&self) -> u64 {
        self.file.size()
    }

    /// `bytes` bytes at `offset`; an error if the file ends before.
    #[inline]
    pub(super) fn get(&mut self, offset: u64, bytes: u64) -> Result<&[u8]> {
        let is_in = offset >= self.base
            && offset.saturating_add(bytes) <= self.base + self.buffer.len() as u64;
        if !is_in {
            self.read(offset, bytes)?;
        }
        let start = (offset - self.base) as usize;
        Ok(&self.buffer[start..start + bytes as usize])
    }

    fn read(&mut self, offset: u64, bytes: u64) -> Result<()> {
        self.file.check_range(offset, bytes)?;
        limits::check("feature size in bytes", bytes, limits::MAX_FEATURE_BYTES)?;
        let end = self.base.saturating_add(self.buffer.len() as u64);
        // A chunk where the file is read on; after a jump most of a chunk would be read in vain.
        let is_next = (self.base..=end).contains(&offset);
        let [least, ahead] = if is_next { [CHUNK_BYTES, AHEAD] } else { [PAGE_BYTES, 0] };
        let window = bytes.max(least).min(self.file.size() - offset);
        // The buffer is valid only after a complete read.
        self.base = u64::MAX;
        self.buffer.resize(window as usize, 0);
        self.file.read_on(offset, &mut self.buffer, ahead)?;
        self.base = offset;
        Ok(())
    }
}

/// Sequential parser of a record; every read is bounds-checked.
pub(super) struct RecordBytes<'a>(pub(super) &'a [u8]);

impl<'a> RecordBytes<'a> {
    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let taken = self.0.split_at_checked(count);
        let (taken, rest) = taken.ok_or_else(|| Error::bad_input("record is truncated"))?;
        self.0 = rest;
        Ok(taken)
    }

    /// The next `N` bytes.
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub(super) fn u8(&mut self) -> Result<u8> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn u16(&mut self) -> Result<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64> {
        self.array().map(f64::from_le_bytes)
    }

    /// The next `count` pairs of numbers.
    pub(super) fn pairs(&mut self, count: usize) -> Result<Vec<[f64; 2]>> {
        let bytes = self.take(count.saturating_mul(16))?;
        Ok(pairs(bytes))
    }

    /// The next `count` numbers.
    pub(super) fn numbers(&mut self, count: usize) -> Result<Vec<f64>> {
        Ok(numbers(self.take(count.saturating_mul(8))?))
    }
}

/// Little-endian numbers.
pub(super) fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|eight| f64::from_le_bytes(*eight)).collect()
}

/// Little-endian pairs of numbers.
pub(super) fn pairs(bytes: &[u8]) -> Vec<[f64; 2]> {
    let pairs = bytes.as_chunks().0.iter().map(|sixteen| {
        let both = u128::from_le_bytes(*sixteen);
        [f64::from_bits(both as u64), f64::from_bits((both >> 64) as u64)]
    });
    pairs.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn any_place_in_any_order_and_nothing_beyond_the_end() {
        let bytes: Vec<u8> = (0..600_000_u32).map(|i| (i % 253) as u8).collect();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        let mut pages = PagedFile::of(RawFile::of(file, Path::new("t")).unwrap());
        for (at, count) in [(0, 10), (599_999, 1), (5, 400_000), (7, 9), (300_000, 300_000), (3, 0)]
        {
            assert_eq!(pages.get(at, count).unwrap(), &bytes[at as usize..(at + count) as usize]);
        }
        for (at, count) in [(600_000, 1), (u64::MAX, 1), (0, u64::MAX), (1, 600_000)] {
            assert!(pages.get(at, count).is_err());
        }
        assert_eq!(pages.get(2, 3).unwrap(), [2, 3, 4]);
    }

    #[test]
    fn numbers_and_pairs() {
        let bytes: Vec<u8> = [1.5_f64, -2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!((pairs(&bytes), numbers(&bytes)), (vec![[1.5, -2.0]], vec![1.5, -2.0]));
        assert!(
            RecordBytes(&bytes).pairs(2).is_err() && RecordBytes(&bytes).pairs(usize::MAX).is_err()
        );
    }
}
