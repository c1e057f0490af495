//! VLRs and EVLRs of a LAS file.

use terrane_base::error::Result;
use terrane_base::limits;
use terrane_files::RawFile;

use super::bytes::LasHeaderBytes;
use super::header::LasHeader;

/// Bytes of the header of a VLR and of an EVLR.
const HEADS: [u64; 2] = [54, 60];
/// Names of both.
const NAMES: [&str; 2] = ["variable length records", "extended variable length records"];

/// A VLR whose data is not read yet.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VlrHeader {
    pub(crate) user: String,
    pub(crate) id: u16,
    pub(crate) description: String,
    /// Offset of the data.
    pub(crate) at: u64,
    pub(crate) bytes: u64,
}

impl VlrHeader {
    /// True for the VLR with these ids.
    pub(crate) fn is(&self, user: &str, id: u16) -> bool {
        self.user == user && self.id == id
    }

    /// The data.
    pub(crate) fn data(&self, file: &RawFile) -> Result<Vec<u8>> {
        limits::check("size of a VLR in bytes", self.bytes, limits::MAX_HEADER_BYTES)?;
        file.read_vec(self.at, self.bytes)
    }
}

/// All VLRs, then all EVLRs. VLRs outside their section are left out with all that follow, with a note: points do not
/// depend on them, except the LASzip and COPC VLRs.
pub(super) fn all(
    file: &RawFile,
    header: &LasHeader,
    notes: &mut Vec<String>,
) -> Result<Vec<VlrHeader>> {
    let mut found = Vec::new();
    let front =
        VlrSequence { at: header.size.into(), end: header.points_at, count: header.vlrs, kind: 0 };
    front.read(file, &mut found, notes)?;
    let least = header.behind(file.size());
    match header.evlrs {
        0 => {}
        _ if header.evlrs_at < least => notes.push(misplaced(header, least)),
        count => {
            let behind = VlrSequence { at: header.evlrs_at, end: file.size(), count, kind: 1 };
            behind.read(file, &mut found, notes)?;
        }
    }
    Ok(found)
}

/// Note on EVLRs with an offset below `least`, the end of the points.
fn misplaced(header: &LasHeader, least: u64) -> String {
    let at = header.evlrs_at;
    let place = match at < header.points_at {
        true => format!("inside the header, which ends at {}", header.points_at),
        false => format!("inside the points, which end at {least}"),
    };
    format!("0 of {} {} read: the offset {at} is {place}", header.evlrs, NAMES[1])
}

/// A sequence of VLRs.
struct VlrSequence {
    at: u64,
    end: u64,
    count: u32,
    /// 0 for VLRs, 1 for EVLRs.
    kind: usize,
}

impl VlrSequence {
    /// Each VLR takes bytes of the file, so their number is bounded by its length.
    fn read(
        self,
        file: &RawFile,
        found: &mut Vec<VlrHeader>,
        notes: &mut Vec<String>,
    ) -> Result<()> {
        let (mut at, head) = (self.at, HEADS[self.kind]);
        for number in 0..self.count {
            let data = at.saturating_add(head);
            if data > self.end {
                notes.push(format!("{number} of {} {} read", self.count, self.name()));
                return Ok(());
            }
            let bytes = file.read_vec(at, head)?;
            let vlr = self.parse(&bytes, data);
            let end = data.saturating_add(vlr.bytes);
            if end > self.end {
                notes.push(format!(
                    "{number} of {} {} read: the next states {} bytes",
                    self.count,
                    self.name(),
                    vlr.bytes
                ));
                return Ok(());
            }
            found.push(vlr);
            at = end;
        }
        Ok(())
    }

    fn parse(&self, head: &[u8], at: u64) -> VlrHeader {
        let b = LasHeaderBytes(head);
        let (bytes, description) = match self.kind {
            0 => (u64::from(b.u16(20)), b.text(22, 32)),
            _ => (b.u64(20), b.text(28, 32)),
        };
        VlrHeader { user: b.text(2, 16), id: b.u16(18), description, at, bytes }
    }

    fn name(&self) -> &'static str {
        NAMES[self.kind]
    }
}
