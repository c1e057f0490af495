//! A split mesh: a folder with a mesh for each block of the grid, and an index.
//!
//! A triangle belongs to the block in which its bounding box begins. Vertices on a border are in both files with
//! bitwise equal coordinates, so the blocks fit together. The index is GeoJSON: a polygon for each block, in the
//! coordinates of the mesh, with the name of its file.
//!
//! Triangles are sorted by block into an anonymous file until a row of blocks is complete; then the blocks are
//! written one by one, so only one file is open at a time, whatever the width of the grid. The ids of a block are in
//! memory while it is written; positions come with the triangles.

mod index;
mod source;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};

use crate::format::MeshFormat;
use crate::registry::open_file;
use crate::sidecar::{prj_path, write_prj};
use crate::sink::{MeshBatch, MeshHeader, MeshSink, SinkOptions};
use index::{MeshBlock, MeshBlockIndex};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Affine, Point3};
use terrane_files::atomic::AtomicFolder;
use terrane_files::{Buckets, folder_for, nameless};

pub(super) use source::open;

/// Triangles per batch of a block.
const BATCH: usize = 1 << 14;
/// Maximum bytes of buffered triangles of incomplete rows of blocks.
const WAITING_BYTES: u64 = 3 << 20;

/// A triangle with vertex ids of the whole mesh.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct BlockTriangle {
    ids: [u64; 3],
    corners: [Point3; 3],
}

/// Division of a grid into blocks.
#[derive(Clone, Copy, Debug)]
pub struct MeshBlockLayout {
    /// Cells along a side of a block; whole tiles.
    pub cells: u32,
    /// Columns and rows of samples of the grid.
    pub samples: [u32; 2],
    /// Grid position to world position.
    pub to_world: Affine,
}

impl MeshBlockLayout {
    /// Columns and rows of blocks.
    fn count(&self) -> [u32; 2] {
        self.samples.map(|samples| (samples - 1).div_ceil(self.cells).max(1))
    }

    /// Fraction of the grid's cells in the largest block.
    pub fn largest_share(&self) -> f64 {
        let cells = self.samples.map(|samples| samples - 1);
        cells.map(|cells| f64::from(self.cells.min(cells)) / f64::from(cells)).iter().product()
    }

    /// Column and row of the block of a triangle.
    fn of(&self, corners: &[Point3; 3]) -> [u32; 2] {
        // Corners are samples; the way to the world and back may miss them by a hair.
        let places = corners.map(|[x, y, _]| self.to_world.invert(x, y).map(f64::round));
        let count = self.count();
        [0, 1].map(|axis| {
            let first = places.iter().fold(f64::INFINITY, |first, place| first.min(place[axis]));
            (first.max(0.0) as u32 / self.cells).min(count[axis] - 1)
        })
    }

    /// World positions of the corners of a block, as a closed ring.
    fn ring(&self, block: [u32; 2]) -> [[f64; 2]; 5] {
        let [[left, right], [top, bottom]] = [0, 1].map(|axis: usize| {
            let [first, end] = [block[axis], block[axis] + 1].map(|at| at * self.cells);
            [first, end.min(self.samples[axis] - 1)].map(f64::from)
        });
        [(left, top), (left, bottom), (right, bottom), (right, top), (left, top)]
            .map(|(col, row)| self.to_world.apply(col, row))
    }
}

/// True for a folder with a split mesh.
pub fn is_split(path: &Path) -> bool {
    path.is_dir() && MeshBlockIndex::read(path).is_ok()
}

/// True for such a folder without other files, which can be replaced safely.
pub fn is_replaceable(path: &Path) -> bool {
    let (Ok(files), Ok(mut entries)) = (files(path), std::fs::read_dir(path)) else { return false };
    let known: HashSet<PathBuf> =
        files.iter().cloned().chain(files.iter().skip(1).map(|mesh| prj_path(mesh))).collect();
    entries.all(|entry| {
        entry.is_ok_and(|entry| {
            known.contains(&entry.path()) && entry.file_type().is_ok_and(|kind| kind.is_file())
        })
    })
}

/// Creates a split mesh in `format` at `path`. Triangles must come in the order of the rows of blocks.
pub fn create(
    path: &Path,
    format: &'static MeshFormat,
    header: &MeshHeader,
    options: &SinkOptions,
    blocks: MeshBlockLayout,
) -> Result<Box<dyn MeshSink>> {
    let folder = AtomicFolder::create(path, options.overwrite, is_replaceable)?;
    let spool = folder_for(path, options.temp_dir.as_deref());
    // Fails at the start, not when the file is needed.
    drop(nameless(spool)?);
    let buckets = Buckets::new(spool, blocks.count()[0] as usize, WAITING_BYTES);
    let index = MeshBlockIndex::new(format.name, header);
    let temp_dir = Some(spool.to_path_buf());
    let (header, options) =
        (header.clone(), SinkOptions { overwrite: false, temp_dir, ..options.clone() });
    Ok(Box::new(SplitMeshSink {
        folder,
        format,
        header,
        options,
        blocks,
        buckets,
        index,
        row: 0,
        bytes: 0,
    }))
}

/// Sink of a split mesh.
struct SplitMeshSink {
    folder: AtomicFolder,
    format: &'static MeshFormat,
    header: MeshHeader,
    options: SinkOptions,
    blocks: MeshBlockLayout,
    buckets: Buckets<BlockTriangle>,
    index: MeshBlockIndex,
    /// The current row of blocks.
    row: u32,
    bytes: u64,
}

impl SplitMeshSink {
    /// Writes the blocks of a row, and starts the next row.
    fn finish_row(&mut self) -> Result<()> {
        for col in 0..self.blocks.count()[0] {
            if self.buckets.len(col as usize) > 0 {
                self.write_block([col, self.row])?;
                self.buckets.forget(col as usize);
            }
        }
        self.row += 1;
        Ok(())
    }

    fn write_block(&mut self, [col, row]: [u32; 2]) -> Result<()> {
        let name = format!("block-{row:04}-{col:04}.{}", self.format.extensions[0]);
        let path = self.folder.inside().join(&name);
        let ring = self.blocks.ring([col, row]);
        let mut piece = BlockMesh::new((self.format.create)(&path, &self.header, &self.options)?);
        self.buckets.try_read(col as usize, |records| piece.push(records))?;
        let (vertices, mut triangles) = (piece.ids.count, piece.triangles);
        let bytes = piece.sink.finish()?;
        if self.options.solid_base.is_some() {
            // A solid, with walls and a bottom.
            triangles = open_file(&path)?.info().triangles;
        }
        write_prj(&path, &self.header.crs, false)?;
        self.bytes += bytes;
        self.index.blocks.push(MeshBlock { file: name, vertices, triangles, bytes, ring });
        Ok(())
    }
}

impl MeshSink for SplitMeshSink {
    fn wants_corners(&self) -> bool {
        true
    }

    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
        if batch.corners.len() != batch.triangles.len() {
            return Err(Error::usage("a split mesh requires the corners of every triangle"));
        }
        for (corners, ids) in batch.corners.iter().zip(batch.triangles) {
            let [col, row] = self.blocks.of(corners);
            if row < self.row {
                return Err(Error::new(
                    ErrorKind::Internal,
                    "a triangle was written after its block",
                ));
            }
            while self.row < row {
                self.finish_row()?;
            }
            self.buckets.push(col as usize, &[BlockTriangle { ids: *ids, corners: *corners }])?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<u64> {
        self.finish_row()?;
        let index = self.index.write(self.folder.inside())?;
        self.folder.commit()?;
        Ok(self.bytes + index)
    }
}

/// Ids per page.
const PAGE: u64 = 512;

/// Map of vertex ids of the whole mesh to ids of a block. Ids of a tile are consecutive, so pages are full: about 8
/// bytes per vertex.
#[derive(Default)]
struct BlockVertexIds {
    /// Local id plus 1, or 0 if absent.
    pages: HashMap<u64, Box<[u64; PAGE as usize]>>,
    count: u64,
}

impl BlockVertexIds {
    /// Local id of `id`, and whether it is new.
    fn of(&mut self, id: u64) -> (u64, bool) {
        let page = self.pages.entry(id / PAGE).or_insert_with(|| Box::new([0; PAGE as usize]));
        let number = &mut page[(id % PAGE) as usize];
        let is_new = *number == 0;
        if is_new {
            self.count += 1;
            *number = self.count;
        }
        (*number - 1, is_new)
    }
}

/// The mesh of a block being written.
struct BlockMesh {
    sink: Box<dyn MeshSink>,
    ids: BlockVertexIds,
    triangles: u64,
}

impl BlockMesh {
    fn new(sink: Box<dyn MeshSink>) -> Self {
        Self { sink, ids: BlockVertexIds::default(), triangles: 0 }
    }

    fn push(&mut self, records: &[BlockTriangle]) -> Result<()> {
        for records in records.chunks(BATCH) {
            let mut vertices = Vec::new();
            let triangles: Vec<[u64; 3]> = records
                .iter()
                .map(|record| {
                    [0, 1, 2].map(|corner| {
                        let (id, is_new) = self.ids.of(record.ids[corner]);
                        if is_new {
                            vertices.push(record.corners[corner]);
                        }
                        id
                    })
                })
                .collect();
            let corners: Vec<[Point3; 3]> = match self.sink.wants_corners() {
                true => records.iter().map(|record| record.corners).collect(),
                false => Vec::new(),
            };
            self.triangles += triangles.len() as u64;
            let batch = MeshBatch {
                vertices: &vertices,
                values: &[],
                triangles: &triangles,
                corners: &corners,
            };
            self.sink.push(batch)?;
        }
        Ok(())
    }
}

/// Files of a split mesh: the index, then the meshes.
pub fn files(path: &Path) -> Result<Vec<PathBuf>> {
    let index = MeshBlockIndex::read(path)?;
    let blocks = index.blocks.iter().map(|block| path.join(&block.file));
    Ok([path.join(index::NAME)].into_iter().chain(blocks).collect())
}
