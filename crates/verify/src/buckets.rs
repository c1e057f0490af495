//! A mesh spread over the domains of a layout through temporary files.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use super::vertices::{VertexCache, VertexCounts};
use super::work::ProofResources;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;
use terrane_engine::workers;
use terrane_files::{BucketWriter, Buckets, lock, unlocked};
use terrane_proof::{DomainLayout, ProofPosition, ProofTriangle, Snap};

/// Triangles of a part are numbered with their corners in `u32`.
pub(super) const MAX_TRIANGLES: u64 = 1 << 30;

/// Triangles a worker takes at a time.
const BATCH: u64 = 2048;

/// Which domains get a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DomainReach {
    /// Domains that the triangle may touch.
    Touched,
    /// Domains that own a corner of the triangle.
    Corners,
}

impl DomainReach {
    fn domains(self, layout: &DomainLayout, triangle: &ProofTriangle, out: &mut Vec<u64>) {
        match self {
            Self::Touched => layout.touched(triangle, |domain| out.push(domain)),
            Self::Corners => {
                out.extend(triangle.positions().map(|at| layout.owner(at)));
                out.sort_unstable();
                out.dedup();
            }
        }
    }
}

/// Triangles and vertices of a mesh by domain.
pub(super) struct MeshSpread {
    pub(super) layout: DomainLayout,
    /// Each triangle in every domain it may touch.
    pub(super) triangles: Buckets<ProofTriangle>,
    /// Each vertex in the domain that owns it, where vertices have an identity.
    pub(super) positions: Option<Buckets<ProofPosition>>,
    /// Counts of vertices by position.
    pub(super) counts: VertexCounts,
    /// Triangles left out because of an unusable vertex.
    pub(super) broken: u64,
}

impl MeshSpread {
    /// Reads the mesh once.
    pub(super) fn fill(
        work: &ProofResources<'_>,
        snapper: &impl Snap,
        layout: DomainLayout,
    ) -> Result<Self> {
        let info = work.mesh.info();
        let positions = info.indexed.then(|| work.buckets(layout, work.memory / 2));
        let triangles = work.buckets(layout, work.memory / 4);
        let counts = VertexCounts::default();
        let mut spread = Self { layout, triangles, positions, counts, broken: 0 };
        work.progress.begin("vertices", info.vertices);
        spread.counts = spread.fill_positions(work, snapper)?;
        work.progress.end();
        spread.broken = spread.fill_triangles(work, snapper, DomainReach::Touched)?;
        Ok(spread)
    }

    /// Reads only the triangles of the mesh, once.
    pub(super) fn of_triangles(
        work: &ProofResources<'_>,
        snapper: &impl Snap,
        layout: DomainLayout,
        reach: DomainReach,
    ) -> Result<Self> {
        let triangles = work.buckets(layout, work.memory / 4);
        let counts = VertexCounts::default();
        let mut spread = Self { layout, triangles, positions: None, counts, broken: 0 };
        spread.broken = spread.fill_triangles(work, snapper, reach)?;
        Ok(spread)
    }

    fn fill_positions(
        &self,
        work: &ProofResources<'_>,
        snapper: &impl Snap,
    ) -> Result<VertexCounts> {
        let all = Mutex::new(VertexCounts::default());
        let pages = VertexCounts::pages(work.mesh);
        workers::run(
            work.threads,
            pages,
            &work.cancel,
            || PositionFiller {
                layout: self.layout,
                counts: VertexCounts::default(),
                writer: self.positions.as_ref().map(Buckets::writer),
                stored: Vec::new(),
            },
            |filler, page| filler.page(work, snapper, page),
            |filler| {
                lock(&all).merge(&filler.counts);
                filler.writer.map_or(Ok(()), BucketWriter::finish)
            },
        )?;
        self.positions.as_ref().map_or(Ok(()), Buckets::settle)?;
        Ok(unlocked(all))
    }

    fn fill_triangles(
        &self,
        work: &ProofResources<'_>,
        snapper: &impl Snap,
        reach: DomainReach,
    ) -> Result<u64> {
        work.progress.begin("triangles", work.mesh.info().triangles);
        let broken = AtomicU64::new(0);
        let units = work.mesh.info().triangles.div_ceil(BATCH);
        workers::run(
            work.threads,
            units,
            &work.cancel,
            || DomainFiller {
                layout: self.layout,
                reach,
                cache: VertexCache::new(work.mesh, *snapper, work.share / 2),
                writer: self.triangles.writer(),
                ids: Vec::new(),
                touched: Vec::new(),
                broken: 0,
            },
            |filler, unit| filler.batch(work, unit * BATCH),
            |filler| {
                broken.fetch_add(filler.broken, Ordering::Relaxed);
                filler.writer.finish()
            },
        )?;
        self.triangles.settle()?;
        work.progress.end();
        Ok(broken.into_inner())
    }

    /// Bytes spilled.
    pub(super) fn bytes(&self) -> u64 {
        self.triangles.spilled() + self.positions.as_ref().map_or(0, Buckets::spilled)
    }
}

/// A thread that spreads vertices over domains.
struct PositionFiller<'a> {
    layout: DomainLayout,
    counts: VertexCounts,
    /// `None` where vertices have no identity.
    writer: Option<BucketWriter<'a, ProofPosition>>,
    stored: Vec<Point3>,
}

impl PositionFiller<'_> {
    /// Counts the vertices of a page and spreads them.
    fn page(&mut self, work: &ProofResources<'_>, snapper: &impl Snap, page: u64) -> Result<()> {
        let Self { layout, counts, writer, stored } = self;
        counts.page(work.mesh, snapper, page, stored, |at| match writer {
            Some(writer) => writer.push(layout.owner(at) as usize, at),
            None => Ok(()),
        })?;
        work.progress.advance(stored.len() as u64);
        Ok(())
    }
}

/// A thread that spreads triangles over domains.
struct DomainFiller<'a, S> {
    layout: DomainLayout,
    reach: DomainReach,
    cache: VertexCache<'a, S>,
    writer: BucketWriter<'a, ProofTriangle>,
    ids: Vec<[u64; 3]>,
    touched: Vec<u64>,
    broken: u64,
}

impl<S: Snap> DomainFiller<'_, S> {
    /// Spreads the batch of triangles that begins with `first`.
    fn batch(&mut self, work: &ProofResources<'_>, first: u64) -> Result<()> {
        let info = work.mesh.info();
        let mut ids = std::mem::take(&mut self.ids);
        ids.clear();
        ids.resize((info.triangles - first).min(BATCH) as usize, [0; 3]);
        work.mesh.read_triangles(first, &mut ids)?;
        for (corners, number) in ids.iter().zip(first..) {
            if let Some(&id) = corners.iter().find(|&&id| id >= info.vertices) {
                let message = format!("refers to vertex {id} of {}", info.vertices);
                return Err(Error::bad_input(message).at(format!("triangle {number}")));
            }
            self.spread(corners)?;
        }
        work.progress.advance(ids.len() as u64);
        self.ids = ids;
        Ok(())
    }

    fn spread(&mut self, &[a, b, c]: &[u64; 3]) -> Result<()> {
        let corners = [self.cache.get(a)?, self.cache.get(b)?, self.cache.get(c)?];
        let [Some(a), Some(b), Some(c)] = corners else {
            self.broken += 1;
            return Ok(());
        };
        let triangle = ProofTriangle { corners: [a, b, c] };
        self.touched.clear();
        self.reach.domains(&self.layout, &triangle, &mut self.touched);
        self.touched.iter().try_for_each(|&domain| self.writer.push(domain as usize, triangle))
    }
}
