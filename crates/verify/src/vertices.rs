//! Random access to a mesh's vertices on the lattice, through a bounded cache of pages.

use terrane_base::error::Result;
use terrane_base::geom::Point3;
use terrane_mesh::MeshSource;
use terrane_proof::{ProofPosition, ProofVertex, Snap, SnapOutcome};

/// Vertices of a page.
const PAGE: usize = 1024;

/// A page and its number.
struct VertexPage {
    number: u64,
    vertices: Vec<ProofVertex>,
}

/// The vertices of a mesh, on the lattice. Each page number has one slot (direct mapping): neighbouring
/// triangles use few pages, so conflicts are rare.
pub(super) struct VertexCache<'a, S> {
    mesh: &'a dyn MeshSource,
    snapper: S,
    slots: Vec<Option<VertexPage>>,
    stored: Vec<Point3>,
}

impl<'a, S: Snap> VertexCache<'a, S> {
    /// A cache of about `bytes`.
    pub(super) fn new(mesh: &'a dyn MeshSource, snapper: S, bytes: u64) -> Self {
        let pages = mesh.info().vertices.div_ceil(PAGE as u64);
        let slots = (bytes / (PAGE * size_of::<ProofVertex>()) as u64).min(pages).max(1);
        Self { mesh, snapper, slots: (0..slots).map(|_| None).collect(), stored: Vec::new() }
    }

    /// Vertex `id`, which the mesh has; `None` when its position or height is unusable.
    pub(super) fn get(&mut self, id: u64) -> Result<Option<ProofVertex>> {
        let number = id / PAGE as u64;
        let slot = (number % self.slots.len() as u64) as usize;
        if self.slots[slot].as_ref().is_none_or(|page| page.number != number) {
            let old = self.slots[slot].take();
            self.slots[slot] = Some(self.load(number, old)?);
        }
        let page = self.slots[slot].as_ref();
        let vertex = page.and_then(|page| page.vertices.get((id % PAGE as u64) as usize));
        Ok(vertex.copied().filter(|vertex| !vertex.z.is_nan()))
    }

    /// Reads a page, reusing the memory of another.
    fn load(&mut self, number: u64, old: Option<VertexPage>) -> Result<VertexPage> {
        let mut vertices = old.map(|page| page.vertices).unwrap_or_default();
        read_page(self.mesh, number, &mut self.stored)?;
        let unusable = ProofVertex { at: ProofPosition::sample(0, 0), z: f64::NAN };
        vertices.clear();
        let snapped = self.stored.iter().map(|&point| self.snapper.snap(point).vertex());
        vertices.extend(snapped.map(|vertex| vertex.unwrap_or(unusable)));
        Ok(VertexPage { number, vertices })
    }
}

fn read_page(mesh: &dyn MeshSource, number: u64, out: &mut Vec<Point3>) -> Result<()> {
    let first = number * PAGE as u64;
    let count = (mesh.info().vertices - first).min(PAGE as u64);
    out.clear();
    out.resize(count as usize, [0.0; 3]);
    mesh.read_vertices(first, out)
}

/// Counts of stored vertices by their position on the lattice.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct VertexCounts {
    /// Moved to a sample by the rounding of their storage.
    pub(super) snapped: u64,
    /// The furthest such move, in cells.
    pub(super) largest_snap: f64,
    /// Not at a sample.
    pub(super) free: u64,
    /// Without finite position or height, or too far away.
    pub(super) unusable: u64,
}

impl VertexCounts {
    /// Pages of the mesh's vertices.
    pub(super) fn pages(mesh: &dyn MeshSource) -> u64 {
        mesh.info().vertices.div_ceil(PAGE as u64)
    }

    /// Counts the vertices of one page and calls `visit` with each usable position.
    pub(super) fn page(
        &mut self,
        mesh: &dyn MeshSource,
        snapper: &impl Snap,
        number: u64,
        stored: &mut Vec<Point3>,
        mut visit: impl FnMut(ProofPosition) -> Result<()>,
    ) -> Result<()> {
        read_page(mesh, number, stored)?;
        for &point in stored.iter() {
            let snapped = snapper.snap(point);
            self.count(snapped);
            snapped.vertex().map_or(Ok(()), |vertex| visit(vertex.at))?;
        }
        Ok(())
    }

    fn count(&mut self, snapped: SnapOutcome) {
        match snapped {
            SnapOutcome::Exact(_) => {}
            SnapOutcome::Moved(_, distance) => {
                self.snapped += 1;
                self.largest_snap = self.largest_snap.max(distance);
            }
            SnapOutcome::Free(_) => self.free += 1,
            SnapOutcome::Unusable => self.unusable += 1,
        }
    }

    /// Adds the counts of another thread.
    pub(super) fn merge(&mut self, other: &Self) {
        self.snapped += other.snapped;
        self.largest_snap = self.largest_snap.max(other.largest_snap);
        self.free += other.free;
        self.unusable += other.unusable;
    }
}
