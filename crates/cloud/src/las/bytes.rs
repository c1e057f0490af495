//! Little-endian numbers and texts at fixed offsets of a header.

/// A header's bytes. Numbers beyond its end read as zero: the caller has checked its length.
#[derive(Clone, Copy)]
pub(crate) struct LasHeaderBytes<'a>(pub(crate) &'a [u8]);

impl LasHeaderBytes<'_> {
    fn at<const N: usize>(self, offset: usize) -> [u8; N] {
        let found = self.0.get(offset..).and_then(|rest| rest.first_chunk());
        found.copied().unwrap_or([0; N])
    }

    pub(crate) fn u8(self, offset: usize) -> u8 {
        self.at::<1>(offset)[0]
    }

    pub(crate) fn u16(self, offset: usize) -> u16 {
        u16::from_le_bytes(self.at(offset))
    }

    pub(crate) fn u32(self, offset: usize) -> u32 {
        u32::from_le_bytes(self.at(offset))
    }

    pub(crate) fn i32(self, offset: usize) -> i32 {
        i32::from_le_bytes(self.at(offset))
    }

    pub(crate) fn u64(self, offset: usize) -> u64 {
        u64::from_le_bytes(self.at(offset))
    }

    pub(crate) fn f64(self, offset: usize) -> f64 {
        f64::from_le_bytes(self.at(offset))
    }

    /// Text of at most `bytes` bytes up to the first zero; Latin-1 if it is not valid UTF-8.
    pub(crate) fn text(self, offset: usize, bytes: usize) -> String {
        let rest = self.0.get(offset..).unwrap_or_default();
        let field = &rest[..rest.len().min(bytes)];
        let end = field.iter().position(|b| *b == 0).unwrap_or(field.len());
        let text = match str::from_utf8(&field[..end]) {
            Ok(text) => text.to_owned(),
            Err(_) => field[..end].iter().map(|byte| char::from(*byte)).collect(),
        };
        text.trim().to_owned()
    }
}
