//! VLRs as stored in a file.

/// Maximum bytes of a VLR.
pub(super) const MAX_BYTES: usize = u16::MAX as usize;

/// A VLR, or an EVLR if it is too long for that.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Vlr {
    /// User id.
    pub user: String,
    /// Record id.
    pub number: u16,
    /// Description.
    pub about: String,
    /// Data.
    pub data: Vec<u8>,
}

impl Vlr {
    /// User id and record id, for messages.
    pub(crate) fn name(&self) -> String {
        format!("{} {}", self.user, self.number)
    }

    /// Appends it as a VLR or EVLR.
    pub(super) fn append(&self, is_behind: bool, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&[0; 2]);
        bytes.extend_from_slice(&text::<16>(&self.user));
        bytes.extend_from_slice(&self.number.to_le_bytes());
        let length = (self.data.len() as u64).to_le_bytes();
        bytes.extend_from_slice(if is_behind { &length } else { &length[..2] });
        bytes.extend_from_slice(&text::<32>(&self.about));
        bytes.extend_from_slice(&self.data);
    }

    pub(super) fn is_long(&self) -> bool {
        self.data.len() > MAX_BYTES
    }
}

/// Text padded with zeros, or truncated.
pub(super) fn text<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    let end = (0..=N).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
    field[..end].copy_from_slice(&text.as_bytes()[..end]);
    field
}
