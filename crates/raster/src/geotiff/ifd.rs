//! TIFF and BigTIFF directories: entries as (type, count, offset), values read on demand, every count checked
//! against the file before memory is allocated.

use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::RawFile;

use super::tags;

/// Byte order of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

impl ByteOrder {
    /// Native byte order.
    pub(super) const NATIVE: ByteOrder =
        if cfg!(target_endian = "big") { ByteOrder::Big } else { ByteOrder::Little };

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Little => "little-endian",
            Self::Big => "big-endian",
        }
    }

    /// The unsigned integer in up to 8 `bytes`.
    fn uint(self, bytes: &[u8]) -> u64 {
        match self {
            Self::Little => bytes.iter().rev().fold(0, append_byte),
            Self::Big => bytes.iter().fold(0, append_byte),
        }
    }
}

fn append_byte(value: u64, byte: &u8) -> u64 {
    value << 8 | u64::from(*byte)
}

/// Type of the values of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GeoTiffFieldType {
    Unsigned,
    Signed,
    Float,
    Text,
    /// Rationals and unknown types, which no used tag has.
    Other,
}

/// An entry of the directory, with values at `offset` in the file.
#[derive(Clone, Copy, Debug)]
struct GeoTiffEntry {
    tag: u16,
    kind: GeoTiffFieldType,
    size: u64,
    count: u64,
    offset: u64,
}

/// Integer values of an entry, not yet read.
#[derive(Clone, Copy, Debug)]
pub(super) struct IntArray {
    /// Number of values.
    pub(super) count: u64,
    offset: u64,
    size: u64,
    signed: bool,
    order: ByteOrder,
    tag: u16,
}

/// One directory of a file.
#[derive(Debug)]
pub(super) struct GeoTiffDirectory<'a> {
    file: &'a RawFile,
    /// Byte order of the file.
    pub(super) order: ByteOrder,
    /// True for BigTIFF.
    pub(super) big: bool,
    entries: Vec<GeoTiffEntry>,
    /// Offset of the next directory; 0 after the last.
    pub(super) next: u64,
}

/// Field widths of TIFF and BigTIFF.
struct TiffFieldWidths {
    count: usize,
    offset: usize,
}

impl TiffFieldWidths {
    fn of(big: bool) -> Self {
        if big { Self { count: 8, offset: 8 } } else { Self { count: 2, offset: 4 } }
    }

    fn entry(&self) -> usize {
        4 + 2 * self.offset
    }
}

/// True if `head` begins like a TIFF or BigTIFF file.
pub(super) fn is_tiff(head: &[u8]) -> bool {
    matches!(head.get(..4), Some(b"II*\0" | b"MM\0*" | b"II+\0" | b"MM\0+"))
}

impl<'a> GeoTiffDirectory<'a> {
    /// Reads the header and the first directory.
    pub(super) fn read(file: &'a RawFile) -> Result<Self> {
        let head = file.head(16)?;
        if !is_tiff(&head) {
            return Err(Error::bad_input("is not a TIFF: it does not start with II or MM")
                .remedy("check the file, or rename it after its real format"));
        }
        let order = if head[0] == b'I' { ByteOrder::Little } else { ByteOrder::Big };
        let big = order.uint(&head[2..4]) == 43;
        let at = first_directory(&head, order, big)?;
        Self::read_at(file, order, big, at).map_err(|e| e.at("directory"))
    }

    fn read_at(file: &'a RawFile, order: ByteOrder, big: bool, at: u64) -> Result<Self> {
        let mut directory = Self { file, order, big, entries: Vec::new(), next: 0 };
        directory.read_entries(at)?;
        Ok(directory)
    }

    /// The directory after this one.
    pub(super) fn following(&self) -> Result<Option<Self>> {
        if self.next == 0 {
            return Ok(None);
        }
        Self::read_at(self.file, self.order, self.big, self.next).map(Some).map_err(|e| {
            e.at(format_args!("directory at offset {}", self.next))
                .remedy("copy the file again, or keep only the first image: gdal_translate IN OUT")
        })
    }

    fn read_entries(&mut self, at: u64) -> Result<()> {
        let widths = TiffFieldWidths::of(self.big);
        let count = self.order.uint(&self.file.read_vec(at, widths.count as u64)?);
        limits::check("number of directory entries", count, limits::MAX_IFD_ENTRIES)?;
        if count == 0 {
            return Err(Error::bad_input("directory is empty"));
        }
        // `at` has been read, so these sums are far from overflow.
        let first = at + widths.count as u64;
        let bytes = self.file.read_vec(first, count * widths.entry() as u64)?;
        for (i, raw) in bytes.chunks_exact(widths.entry()).enumerate() {
            let field = first + (i * widths.entry() + 4 + widths.offset) as u64;
            self.entries.push(self.entry(raw, field, widths.offset));
        }
        let end = first + bytes.len() as u64;
        // Some writers end the file with the last entry.
        let next = self.file.read_vec(end, widths.offset as u64).unwrap_or_default();
        self.next = self.order.uint(&next);
        Ok(())
    }

    /// Decodes the raw entry with its value field at file offset `field`.
    fn entry(&self, raw: &[u8], field: u64, width: usize) -> GeoTiffEntry {
        let (kind, size) = kind_and_size(self.order.uint(&raw[2..4]));
        let count = self.order.uint(&raw[4..4 + width]);
        let fits = count.checked_mul(size).is_some_and(|bytes| bytes <= width as u64);
        let offset = if fits { field } else { self.order.uint(&raw[4 + width..]) };
        GeoTiffEntry { tag: self.order.uint(&raw[..2]) as u16, kind, size, count, offset }
    }

    /// The entry of `tag`; the first one if a damaged directory has several.
    fn find(&self, tag: u16) -> Option<&GeoTiffEntry> {
        self.entries.iter().find(|e| e.tag == tag)
    }

    /// True if the directory has `tag`.
    pub(super) fn has(&self, tag: u16) -> bool {
        self.find(tag).is_some()
    }

    /// The single unsigned value of `tag`.
    pub(super) fn int(&self, tag: u16) -> Result<Option<u64>> {
        let Some(values) = self.int_array(tag)? else { return Ok(None) };
        if values.count != 1 {
            let message = format!("has {} values, expected 1", values.count);
            return Err(about(tag, message));
        }
        values.get(self.file, 0).map(Some)
    }

    /// All unsigned values of `tag`.
    pub(super) fn ints(&self, tag: u16) -> Result<Option<Vec<u64>>> {
        self.int_array(tag)?.map(|values| values.all(self.file)).transpose()
    }

    /// The unsigned values of `tag`, not yet read but checked to be inside the file.
    pub(super) fn int_array(&self, tag: u16) -> Result<Option<IntArray>> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        if !matches!(entry.kind, GeoTiffFieldType::Unsigned | GeoTiffFieldType::Signed) {
            return Err(about(tag, "is not of an integer type"));
        }
        self.check_values(entry)?;
        let GeoTiffEntry { tag, kind, size, count, offset } = *entry;
        let signed = kind == GeoTiffFieldType::Signed;
        Ok(Some(IntArray { count, offset, size, signed, order: self.order, tag }))
    }

    /// All values of `tag` as doubles.
    pub(super) fn doubles(&self, tag: u16) -> Result<Option<Vec<f64>>> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        if entry.kind != GeoTiffFieldType::Float {
            return Err(about(tag, "is not of a floating point type"));
        }
        let bytes = self.value_bytes(entry)?;
        let values = bytes.chunks_exact(entry.size as usize).map(|raw| self.float(raw));
        Ok(Some(values.collect()))
    }

    fn float(&self, raw: &[u8]) -> f64 {
        let bits = self.order.uint(raw);
        if raw.len() == 4 { f64::from(f32::from_bits(bits as u32)) } else { f64::from_bits(bits) }
    }

    /// The text of `tag`, up to its first NUL; invalid UTF-8 is replaced.
    pub(super) fn text(&self, tag: u16) -> Result<Option<String>> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        if entry.size != 1 {
            return Err(about(tag, "is not text"));
        }
        let bytes = self.value_bytes(entry)?;
        let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
        Ok(Some(String::from_utf8_lossy(&bytes[..end]).into_owned()))
    }

    fn value_bytes(&self, entry: &GeoTiffEntry) -> Result<Vec<u8>> {
        let bytes = self.check_values(entry)?;
        limits::check("tag size in bytes", bytes, limits::MAX_HEADER_BYTES)
            .map_err(|e| e.at(tags::name(entry.tag)))?;
        self.file.read_vec(entry.offset, bytes)
    }

    /// Size of the entry's values, which are inside the file.
    fn check_values(&self, entry: &GeoTiffEntry) -> Result<u64> {
        let bytes = entry.count.saturating_mul(entry.size);
        self.file
            .check_range(entry.offset, bytes)
            .map_err(|e| e.at(format_args!("tag {}", tags::name(entry.tag))))?;
        Ok(bytes)
    }
}

/// Offset of the first directory, from the header.
fn first_directory(head: &[u8], order: ByteOrder, big: bool) -> Result<u64> {
    let field = if big { head.get(8..16) } else { head.get(4..8) };
    let Some(field) = field else {
        return Err(Error::bad_input("file is truncated: the TIFF header is not complete"));
    };
    if big && (order.uint(&head[4..6]), order.uint(&head[6..8])) != (8, 0) {
        let message = "BigTIFF with offsets that are not 8 bytes is not supported";
        return Err(Error::unsupported(message).remedy("rewrite the file: gdal_translate IN OUT"));
    }
    Ok(order.uint(field))
}

/// An error about a tag.
pub(super) fn about(tag: u16, message: impl std::fmt::Display) -> Error {
    Error::bad_input(format!("tag {} {message}", tags::name(tag)))
}

/// Meaning and size of a TIFF field type.
fn kind_and_size(code: u64) -> (GeoTiffFieldType, u64) {
    match code {
        1 | 7 => (GeoTiffFieldType::Unsigned, 1),
        2 => (GeoTiffFieldType::Text, 1),
        3 => (GeoTiffFieldType::Unsigned, 2),
        4 | 13 => (GeoTiffFieldType::Unsigned, 4),
        16 | 18 => (GeoTiffFieldType::Unsigned, 8),
        6 => (GeoTiffFieldType::Signed, 1),
        8 => (GeoTiffFieldType::Signed, 2),
        9 => (GeoTiffFieldType::Signed, 4),
        17 => (GeoTiffFieldType::Signed, 8),
        11 => (GeoTiffFieldType::Float, 4),
        12 => (GeoTiffFieldType::Float, 8),
        _ => (GeoTiffFieldType::Other, 8),
    }
}

impl IntArray {
    /// Value `i`, read from the file.
    pub(super) fn get(&self, file: &RawFile, i: u64) -> Result<u64> {
        if i >= self.count {
            return Err(about(self.tag, format_args!("has only {} values", self.count)));
        }
        let mut raw = [0; 8];
        let raw = &mut raw[..self.size as usize];
        file.read_at(self.offset + i * self.size, raw)?;
        self.value(raw)
    }

    /// All values, within the header size limit.
    pub(super) fn all(&self, file: &RawFile) -> Result<Vec<u64>> {
        let bytes = self.count * self.size;
        limits::check("tag size in bytes", bytes, limits::MAX_HEADER_BYTES)
            .map_err(|e| e.at(tags::name(self.tag)))?;
        let raw = file.read_vec(self.offset, bytes)?;
        raw.chunks_exact(self.size as usize).map(|raw| self.value(raw)).collect()
    }

    fn value(&self, raw: &[u8]) -> Result<u64> {
        let value = self.order.uint(raw);
        if self.signed && value >> (8 * self.size - 1) != 0 {
            return Err(about(self.tag, "has a negative value"));
        }
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::path::Path;

    fn file_of(bytes: &[u8]) -> RawFile {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        RawFile::of(file, Path::new("t.tif")).unwrap()
    }

    #[test]
    fn both_byte_orders_and_inline_values() {
        let little = b"II*\0\x08\0\0\0\x01\0\0\x01\x03\0\x01\0\0\0\x07\0\0\0\0\0\0\0";
        let big = b"MM\0*\0\0\0\x08\0\x01\x01\0\0\x03\0\0\0\x01\0\x07\0\0\0\0\0\0";
        for bytes in [little, big] {
            let file = file_of(bytes);
            let directory = GeoTiffDirectory::read(&file).unwrap();
            assert_eq!(directory.int(tags::IMAGE_WIDTH).unwrap(), Some(7));
            assert_eq!(directory.int(tags::IMAGE_LENGTH).unwrap(), None);
            assert!(directory.text(tags::IMAGE_WIDTH).is_err());
        }
    }

    #[test]
    fn offsets_beyond_four_gibibytes_are_kept() {
        let head = b"II+\0\x08\0\0\0\x10\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0";
        let entry = b"\x11\x01\x10\0\x01\0\0\0\0\0\0\0\x07\0\0\0\x01\0\0\0";
        let file = file_of(&[&head[..], entry, &[0; 8]].concat());
        let directory = GeoTiffDirectory::read(&file).unwrap();
        let offsets = directory.ints(tags::STRIP_OFFSETS).unwrap();
        assert_eq!(offsets, Some(vec![0x1_0000_0007]));
        let array = directory.int_array(tags::STRIP_OFFSETS).unwrap().unwrap();
        assert_eq!(array.get(&file, 0).unwrap(), 0x1_0000_0007);
    }

    #[test]
    fn counts_that_lie_are_refused() {
        // One LONG8-sized claim of 2^31 values in a file of 26 bytes.
        let lie = b"II*\0\x08\0\0\0\x01\0\x11\x01\x04\0\0\0\0\x80\x07\0\0\0\0\0\0\0";
        let file = file_of(lie);
        let directory = GeoTiffDirectory::read(&file).unwrap();
        let error = directory.ints(tags::STRIP_OFFSETS).unwrap_err().to_string();
        assert!(error.contains("StripOffsets") && error.contains("8589934592"), "{error}");
        let entries = b"II*\0\x08\0\0\0\xff\xff";
        assert!(
            GeoTiffDirectory::read(&file_of(entries)).unwrap_err().to_string().contains("limit")
        );
        let nowhere = b"II*\0\xff\xff\xff\xff";
        assert!(GeoTiffDirectory::read(&file_of(nowhere)).is_err());
        assert!(GeoTiffDirectory::read(&file_of(b"II+\0\x08\0\0\0")).is_err());
    }
}
