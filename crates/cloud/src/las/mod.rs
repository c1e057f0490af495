//! LAS and LAZ files: header, VLRs, and parts that are read independently.

mod bytes;
mod copc;
mod crs;
pub(super) mod extra;
mod header;
mod laz;
mod parts;
mod read;
mod record;
mod vlr;

use std::path::{Path, PathBuf};

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Crs;
use terrane_base::limits;
use terrane_files::RawFile;

pub(super) use self::crs::{IS_WKT, PROJECTION, WKT};
pub(super) use copc::OCTREE;
pub(super) use extra::{ExtraBytes, RecordByteCopy};
pub use header::LegacyCounts;
pub(super) use header::{LasHeader, SIZES};
pub(super) use read::{LasPointBlock, LasReadBuffers};
pub(super) use record::{LegacyLasRecord, ModernLasRecord, OVERLAP_CLASS, unpacked};
pub(super) use vlr::VlrHeader;

use self::laz::{LazCompressor, LazLayout};
use super::frame::ClaimedExtent;
use parts::LasPart;

/// User id and record id of the LASzip VLR, which compressed points require.
pub(super) const LASZIP: (&str, u16) = ("laszip encoded", 22_204);

/// A LAS or LAZ file.
#[derive(Debug)]
pub(super) struct LasFile {
    pub(super) path: PathBuf,
    /// Length at the time of opening.
    pub(super) len: u64,
    pub(super) header: LasHeader,
    pub(super) vlrs: Vec<VlrHeader>,
    pub(super) crs: Crs,
    /// Extra bytes of its points.
    pub(super) extra: ExtraBytes,
    /// Compression, if any.
    pub(super) layout: Option<LazLayout>,
    pub(super) is_copc: bool,
    pub(super) parts: Vec<LasPart>,
    /// Notes on oddities.
    pub(super) notes: Vec<String>,
}

impl LasFile {
    /// Reads everything but the points. With `salvage`, missing parts count as lost.
    pub(super) fn open(path: &Path, salvage: bool) -> Result<Self> {
        let file = RawFile::open(path)?;
        Self::read(&file, path, salvage).map_err(|e| e.in_file(path))
    }

    fn read(file: &RawFile, path: &Path, salvage: bool) -> Result<Self> {
        let header = LasHeader::parse(&file.head(header::MAX_BYTES)?, file.size())?;
        let mut notes = header.notes.clone();
        let vlrs = vlr::all(file, &header, &mut notes)?;
        let crs = crs::read(file, &vlrs, header.encoding)?;
        let extra = extra_bytes(file, &header, &vlrs, &mut notes)?;
        let laszip = vlrs.iter().find(|vlr| vlr.is(LASZIP.0, LASZIP.1));
        let layout = match (header.is_compressed, laszip) {
            (false, _) => None,
            (true, Some(vlr)) => Some(LazLayout::parse(&vlr.data(file)?, &header)?),
            (true, None) => {
                return Err(Error::bad_input("the LASzip VLR of the compressed points is missing")
                    .remedy("copy the file again"));
            }
        };
        let nodes = match &layout {
            Some(layout) if layout.compressor == LazCompressor::Layers => {
                copc::nodes(file, &header, &vlrs)
            }
            _ => Ok(None),
        };
        let nodes = match nodes {
            Err(error) if salvage && error.kind() != ErrorKind::Io => {
                notes.push(format!("the octree is ignored: {error}"));
                None
            }
            nodes => nodes?,
        };
        let is_copc = nodes.is_some();
        let parts = match (&layout, nodes) {
            (None, _) => parts::plain(&header, file.size(), salvage, &mut notes)?,
            (Some(_), Some(nodes)) => parts::octree(nodes),
            (Some(layout), None) => parts::packed(file, &header, layout, salvage, &mut notes)?,
        };
        let (path, len) = (path.to_path_buf(), file.size());
        Ok(Self { path, len, header, vlrs, crs, extra, layout, is_copc, parts, notes })
    }

    /// Stated extent of the points; `None` without points.
    pub(super) fn claim(&self) -> Option<ClaimedExtent> {
        let LasHeader { scale, offset, low, high, count, .. } = self.header;
        (count > 0).then(|| ClaimedExtent::new(scale, offset, low, high))
    }

    /// Reopens the file for reading points.
    pub(super) fn reopen(&self) -> Result<RawFile> {
        let file = RawFile::open(&self.path)?;
        if file.size() == self.len {
            return Ok(file);
        }
        Err(Error::bad_input("changed while it was read")
            .in_file(&self.path)
            .remedy("run again when no other program writes to it"))
    }
}

/// Extra bytes by the Extra Bytes VLRs; several of them are read as one.
fn extra_bytes(
    file: &RawFile,
    header: &LasHeader,
    vlrs: &[VlrHeader],
    notes: &mut Vec<String>,
) -> Result<ExtraBytes> {
    let found: Vec<_> = vlrs.iter().filter(|vlr| vlr.is(extra::USER, extra::NUMBER)).collect();
    let bytes = found.iter().map(|vlr| vlr.bytes).sum();
    limits::check("size of the Extra Bytes VLR in bytes", bytes, limits::MAX_HEADER_BYTES)?;
    let described = found.iter().map(|vlr| vlr.data(file)).collect::<Result<Vec<_>>>()?.concat();
    if found.len() > 1 {
        notes.push(format!("{} Extra Bytes VLRs are read as one", found.len()));
    }
    let (extra, odd) = ExtraBytes::of(&described, header.extra_bytes().into());
    notes.extend(odd);
    Ok(extra)
}
