//! The octree of COPC files (COPC 1.0): chunks and the cubes of their points.

use std::collections::HashSet;

use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::RawFile;

use super::bytes::LasHeaderBytes;
use super::header::LasHeader;
use super::laz::LazChunk;
use super::vlr::VlrHeader;

/// User id of COPC VLRs, and record id of the info VLR.
pub(crate) const OCTREE: &str = "copc";
const INFO: u16 = 1;
/// Bytes of the info VLR, and of a hierarchy entry.
const INFO_BYTES: u64 = 160;
const ENTRY_BYTES: u64 = 32;
/// Maximum depth of the octree.
const MAX_LEVELS: i32 = 31;

/// A node with points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CopcNode {
    pub(super) chunk: LazChunk,
    /// Minimum and maximum corner of its cube.
    pub(super) cube: [[f64; 3]; 2],
}

/// A page of the hierarchy.
#[derive(Clone, Copy)]
struct CopcHierarchyPage {
    at: u64,
    bytes: u64,
}

/// The root cube.
struct CopcRootCube {
    low: [f64; 3],
    size: f64,
}

/// The nodes with points in file order; `None` if the file is not COPC.
///
/// # Errors
/// A hierarchy outside the file, or one that does not hold each point once.
pub(super) fn nodes(
    file: &RawFile,
    header: &LasHeader,
    vlrs: &[VlrHeader],
) -> Result<Option<Vec<CopcNode>>> {
    let Some(info) = vlrs.first().filter(|vlr| vlr.is(OCTREE, INFO)) else { return Ok(None) };
    if info.bytes < INFO_BYTES {
        return Err(damaged(format!("the info VLR is {} bytes long", info.bytes)));
    }
    let data = file.read_vec(info.at, INFO_BYTES)?;
    let (root, page) = parse(LasHeaderBytes(&data))?;
    let mut nodes = walk(file, &root, page)?;
    nodes.sort_by_key(|node| node.chunk.at);
    check(&nodes, header, file.size())?;
    Ok(Some(nodes))
}

fn parse(info: LasHeaderBytes<'_>) -> Result<(CopcRootCube, CopcHierarchyPage)> {
    let half = info.f64(24);
    let low = [0, 8, 16].map(|at| info.f64(at) - half);
    let sound = half.is_finite() && half > 0.0 && low.iter().all(|v| v.is_finite());
    if !sound {
        return Err(damaged(format!("the cube at {low:?} has half-size {half}")));
    }
    Ok((
        CopcRootCube { low, size: 2.0 * half },
        CopcHierarchyPage { at: info.u64(40), bytes: info.u64(48) },
    ))
}

/// Reads all pages; each is read once, and their total size is at most the file size, so cyclic references end.
fn walk(file: &RawFile, root: &CopcRootCube, first: CopcHierarchyPage) -> Result<Vec<CopcNode>> {
    let (mut pages, mut seen, mut left) = (vec![first], HashSet::new(), file.size());
    let mut nodes = Vec::new();
    while let Some(page) = pages.pop() {
        if page.bytes > left || !page.bytes.is_multiple_of(ENTRY_BYTES) || !seen.insert(page.at) {
            return Err(damaged(format!(
                "hierarchy page of {} bytes at byte {}",
                page.bytes, page.at
            )));
        }
        limits::check("size of a hierarchy page in bytes", page.bytes, limits::MAX_BLOCK_BYTES)?;
        left -= page.bytes;
        let bytes = file.read_vec(page.at, page.bytes)?;
        for entry in bytes.chunks_exact(ENTRY_BYTES as usize) {
            take(LasHeaderBytes(entry), root, &mut pages, &mut nodes)?;
        }
    }
    Ok(nodes)
}

/// Reads an entry: a node, an empty node, or a reference to another page.
fn take(
    entry: LasHeaderBytes<'_>,
    root: &CopcRootCube,
    pages: &mut Vec<CopcHierarchyPage>,
    nodes: &mut Vec<CopcNode>,
) -> Result<()> {
    let (at, bytes, points) = (entry.u64(16), entry.i32(24), entry.i32(28));
    let bytes = u64::try_from(bytes).map_err(|_| damaged(format!("node of {bytes} bytes")))?;
    match points {
        -1 => pages.push(CopcHierarchyPage { at, bytes }),
        0 => {}
        1.. => {
            let key = [0, 4, 8, 12].map(|at| entry.i32(at));
            let chunk = LazChunk { at, bytes, points: u64::from(points.unsigned_abs()) };
            nodes.push(CopcNode { chunk, cube: cube(root, key)? });
        }
        _ => return Err(damaged(format!("node of {points} points"))),
    }
    Ok(())
}

/// The cube of a key: level, then indices along x, y, z.
fn cube(root: &CopcRootCube, [level, key @ ..]: [i32; 4]) -> Result<[[f64; 3]; 2]> {
    let sound = (0..MAX_LEVELS).contains(&level)
        && key.iter().all(|k| (0..1_i64 << level).contains(&i64::from(*k)));
    if !sound {
        return Err(damaged(format!("node {key:?} on level {level}")));
    }
    let size = root.size / (1_i64 << level) as f64;
    Ok([0.0, 1.0]
        .map(|by| std::array::from_fn(|axis| root.low[axis] + (f64::from(key[axis]) + by) * size)))
}

/// Checks that nodes do not overlap, lie between the first point and the end of the file, and hold every point.
fn check(nodes: &[CopcNode], header: &LasHeader, len: u64) -> Result<()> {
    let mut at = header.points_at;
    for CopcNode { chunk, .. } in nodes {
        let end = chunk.at.saturating_add(chunk.bytes);
        if chunk.at < at || end > len {
            return Err(damaged(format!("node of {} bytes at byte {}", chunk.bytes, chunk.at)));
        }
        at = end;
    }
    let points: u64 = nodes.iter().map(|node| node.chunk.points).sum();
    match points == header.count {
        true => Ok(()),
        false => Err(damaged(format!("the nodes hold {points} of {} points", header.count))),
    }
}

fn damaged(what: String) -> Error {
    Error::bad_input(format!("the COPC octree is damaged: {what}"))
        .remedy("copy the file again, or read it without the octree with ‹salvage›")
}
