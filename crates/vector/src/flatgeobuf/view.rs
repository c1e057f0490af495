//! FlatBuffers tables in untrusted bytes: every offset and length is checked.

use terrane_base::error::{Error, Result};

/// A table.
#[derive(Clone, Copy)]
pub(super) struct FlatbufferTable<'a> {
    bytes: &'a [u8],
    /// Offset of the table.
    at: usize,
    /// Offset and length of the vtable.
    fields: (usize, usize),
}

fn damaged() -> Error {
    Error::bad_input("offset outside its table").remedy("copy or recreate the file")
}

fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N]> {
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk()).copied();
    found.ok_or_else(damaged)
}

fn u32_at(bytes: &[u8], at: usize) -> Result<usize> {
    Ok(u32::from_le_bytes(bytes_at(bytes, at)?) as usize)
}

impl<'a> FlatbufferTable<'a> {
    /// The root table of a buffer.
    pub(super) fn root(bytes: &'a [u8]) -> Result<Self> {
        Self::at(bytes, u32_at(bytes, 0)?)
    }

    fn at(bytes: &'a [u8], at: usize) -> Result<Self> {
        let back = i64::from(i32::from_le_bytes(bytes_at(bytes, at)?));
        let list = usize::try_from(at as i64 - back).map_err(|_| damaged())?;
        let length = usize::from(u16::from_le_bytes(bytes_at(bytes, list)?));
        if list + length > bytes.len() {
            return Err(damaged());
        }
        Ok(Self { bytes, at, fields: (list, length) })
    }

    /// Offset of a field; `None` if the table lacks it.
    fn field(&self, slot: usize) -> Result<Option<usize>> {
        let (list, length) = self.fields;
        let entry = 4 + 2 * slot;
        if entry + 2 > length {
            return Ok(None);
        }
        let offset = u16::from_le_bytes(bytes_at(self.bytes, list + entry)?);
        Ok((offset > 0).then_some(self.at + usize::from(offset)))
    }

    /// A number of `N` bytes.
    pub(super) fn number<const N: usize>(&self, slot: usize) -> Result<Option<[u8; N]>> {
        self.field(slot)?.map(|at| bytes_at(self.bytes, at)).transpose()
    }

    pub(super) fn u8(&self, slot: usize) -> Result<u8> {
        Ok(self.number(slot)?.map_or(0, u8::from_le_bytes))
    }

    /// Offset that a field points to.
    fn target(&self, slot: usize) -> Result<Option<usize>> {
        let Some(at) = self.field(slot)? else { return Ok(None) };
        Ok(Some(at + u32_at(self.bytes, at)?))
    }

    /// A vector of items of `size` bytes, as bytes; empty if missing.
    pub(super) fn list(&self, slot: usize, size: usize) -> Result<&'a [u8]> {
        let Some(at) = self.target(slot)? else { return Ok(&[]) };
        let bytes = u32_at(self.bytes, at)?.saturating_mul(size);
        let rest = self.bytes.get(at + 4..).ok_or_else(damaged)?;
        rest.get(..bytes).ok_or_else(damaged)
    }

    pub(super) fn text(&self, slot: usize) -> Result<Option<&'a str>> {
        if self.field(slot)?.is_none() {
            return Ok(None);
        }
        let text = std::str::from_utf8(self.list(slot, 1)?);
        text.map(Some).map_err(|_| Error::bad_input("text is not UTF-8"))
    }

    pub(super) fn table(&self, slot: usize) -> Result<Option<FlatbufferTable<'a>>> {
        self.target(slot)?.map(|at| Self::at(self.bytes, at)).transpose()
    }

    /// The tables of a vector.
    pub(super) fn tables(
        &self,
        slot: usize,
    ) -> Result<impl Iterator<Item = Result<FlatbufferTable<'a>>>> {
        let entries = self.list(slot, 4)?;
        let first = self.target(slot)?.map_or(0, |at| at + 4);
        let bytes = self.bytes;
        Ok((0..entries.len() / 4).map(move |entry| {
            let at = first + 4 * entry;
            Self::at(bytes, at + u32_at(bytes, at)?)
        }))
    }
}
