//! dBASE tables as shapefiles have them (level III): properties as text of fixed width.

mod encoding;
mod read;
mod write;

pub(super) use read::Reader;
pub(super) use write::{Plan, write};

/// Bytes of a table's header, and of each field's description behind it.
const HEADER_BYTES: u64 = 32;
/// The end of the descriptions.
const HEADER_END: u8 = 0x0d;
/// The mark of a record that is deleted.
const DELETED: u8 = b'*';
/// Most bytes of a text.
const MOST_TEXT: usize = 254;
