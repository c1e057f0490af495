//! A split mesh read as one mesh of separate triangles with three vertices each, equal by position.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use super::index::{MeshBlock, MeshBlockIndex};
use crate::registry::open_file;
use crate::source::{MeshInfo, MeshSource};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;
use terrane_files::lock;

/// Maximum blocks in memory.
const MAX_CACHED: usize = 4;
/// Triangles of a block read at a time.
const BATCH: usize = 1 << 12;

/// A split mesh.
struct SplitSource {
    info: MeshInfo,
    parts: Vec<SplitMeshPart>,
    /// The recently read blocks by index in `parts`; the latest last.
    cached: Mutex<Vec<(usize, Arc<OpenPart>)>>,
}

struct SplitMeshPart {
    path: PathBuf,
    /// Index of its first triangle in the whole mesh.
    first: u64,
    /// Number of its triangles.
    triangles: u64,
}

/// Opens the split mesh in `path`.
pub(crate) fn open(path: &Path) -> Result<Box<dyn MeshSource>> {
    let index = MeshBlockIndex::read(path)?;
    let mut parts = Vec::new();
    let (mut first, mut solid) = (0, false);
    let mut systems = index.systems();
    let mut info: Option<MeshInfo> = None;
    for block in &index.blocks {
        let path = path.join(&block.file);
        // Only files: a folder that contains itself would recurse without end.
        let mesh = open_file(&path).map_err(|e| e.remedy("make the folder again"))?;
        let part = mesh.info().clone();
        check(&part, block, &index, &path)?;
        if let Some(first) = info.as_ref().filter(|first| !states_the_same(first, &part)) {
            let what =
                format!("its metadata differ from those of the first block ({})", first.format);
            return Err(lying(&path, what));
        }
        let prj = terrane_files::prj(&path)?;
        systems.extend((!prj.is_empty() && !systems.contains(&prj)).then_some(prj));
        parts.push(SplitMeshPart { path, first, triangles: part.triangles });
        first += part.triangles;
        solid |= part.solid;
        info.get_or_insert(part);
    }
    let info = info.ok_or_else(|| {
        Error::bad_input("the index has no blocks").in_file(path).remedy("make the folder again")
    })?;
    let mut details = info.details.clone();
    details.push(("blocks".to_owned(), index.blocks.len().to_string()));
    let comments = index.comments.iter().map(|comment| ("comment".to_owned(), comment.clone()));
    details.extend(comments.filter(|comment| !info.details.contains(comment)));
    let info = MeshInfo {
        vertices: 3 * first,
        triangles: first,
        indexed: false,
        solid,
        channels: Vec::new(),
        systems: [info.systems.clone(), systems].concat(),
        details,
        ..info
    };
    Ok(Box::new(SplitSource { info, parts, cached: Mutex::default() }))
}

/// Fails unless a block matches the index. Meshes without shared vertices, and solids, have more vertices than the
/// surface.
fn check(found: &MeshInfo, block: &MeshBlock, index: &MeshBlockIndex, path: &Path) -> Result<()> {
    let bytes = std::fs::metadata(path).map_err(|e| Error::read(path, e))?.len();
    let has_vertices = found.indexed && !found.solid;
    let facts = [
        ("triangles", found.triangles, block.triangles),
        ("vertices", if has_vertices { found.vertices } else { block.vertices }, block.vertices),
        ("bytes", bytes, block.bytes),
    ];
    if let Some((what, has, says)) = facts.into_iter().find(|(_, has, says)| has != says) {
        return Err(lying(path, format!("has {has} {what}, the index states {says}")));
    }
    if found.format != index.format {
        let message = format!("is {}, the index states {}", found.format, index.format);
        return Err(lying(path, message));
    }
    Ok(())
}

fn lying(path: &Path, message: String) -> Error {
    Error::bad_input(message).in_file(path).remedy("make the folder again")
}

/// True for blocks with the same metadata.
fn states_the_same(a: &MeshInfo, b: &MeshInfo) -> bool {
    (&a.crs, &a.systems, &a.details, a.origin, a.scale)
        == (&b.crs, &b.systems, &b.details, b.origin, b.scale)
}

impl SplitSource {
    /// Calls `each` with the corners of `count` triangles from `first` on.
    fn visit(&self, first: u64, count: u64, mut each: impl FnMut(&[Point3; 3])) -> Result<()> {
        let mut part = self.parts.partition_point(|part| part.first <= first).saturating_sub(1);
        let (mut at, end) = (first, first + count);
        while at < end {
            let SplitMeshPart { first, triangles, .. } = self.parts[part];
            let last = end.min(first + triangles);
            if at < last {
                self.part(part)?.visit(at - first, last - first, &mut each)?;
            }
            (at, part) = (at.max(last), part + 1);
        }
        Ok(())
    }

    fn part(&self, part: usize) -> Result<Arc<OpenPart>> {
        let mut cached = lock(&self.cached);
        if let Some((_, open)) = cached.iter().find(|(number, _)| *number == part) {
            return Ok(Arc::clone(open));
        }
        if cached.len() >= MAX_CACHED {
            cached.remove(0);
        }
        let open = Arc::new(self.parts[part].open()?);
        cached.push((part, Arc::clone(&open)));
        Ok(open)
    }
}

impl SplitMeshPart {
    fn open(&self) -> Result<OpenPart> {
        let mesh = open_file(&self.path)?;
        let info = mesh.info();
        if info.triangles != self.triangles {
            return Err(changed(&self.path));
        }
        let count = if info.indexed { info.vertices } else { 0 };
        let mut vertices = vec![[0.0; 3]; count as usize];
        mesh.read_vertices(0, &mut vertices)?;
        Ok(OpenPart { mesh, vertices, path: self.path.clone() })
    }
}

/// A block being read.
struct OpenPart {
    mesh: Box<dyn MeshSource>,
    /// Empty if triangles do not share vertices.
    vertices: Vec<Point3>,
    path: PathBuf,
}

impl OpenPart {
    /// Calls `each` with the corners of the triangles `first .. end`.
    fn visit(&self, first: u64, end: u64, each: &mut impl FnMut(&[Point3; 3])) -> Result<()> {
        let mut corners = vec![[[0.0; 3]; 3]; BATCH.min((end - first) as usize)];
        for at in (first..end).step_by(BATCH) {
            let corners = &mut corners[..BATCH.min((end - at) as usize)];
            self.read(at, corners)?;
            corners.iter().for_each(&mut *each);
        }
        Ok(())
    }

    fn read(&self, first: u64, out: &mut [[Point3; 3]]) -> Result<()> {
        if !self.mesh.info().indexed {
            return self.mesh.read_vertices(3 * first, out.as_flattened_mut());
        }
        let mut ids = vec![[0; 3]; out.len()];
        self.mesh.read_triangles(first, &mut ids)?;
        for (out, id) in out.as_flattened_mut().iter_mut().zip(ids.as_flattened()) {
            *out = *self.vertices.get(*id as usize).ok_or_else(|| changed(&self.path))?;
        }
        Ok(())
    }
}

fn changed(path: &Path) -> Error {
    Error::bad_input("changed while it was read").in_file(path)
}

impl MeshSource for SplitSource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        let (start, end) = (first / 3, (first + out.len() as u64).div_ceil(3));
        let mut skip = (first % 3) as usize;
        let mut left = out.iter_mut();
        self.visit(start, end - start, |corners| {
            for (corner, out) in corners[std::mem::take(&mut skip)..].iter().zip(&mut left) {
                *out = *corner;
            }
        })
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        for (triangle, out) in (first..).zip(out) {
            *out = [0, 1, 2].map(|corner| 3 * triangle + corner);
        }
        Ok(())
    }
}
