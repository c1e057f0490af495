//! The tiles of a mesh, one after the other. Tiles with too many triangles are subdivided.

use std::sync::Mutex;

use crate::buckets::{DomainReach, MAX_TRIANGLES, MeshSpread};
use crate::plane_tiles::{divide, domain_count, load, pieces, respread};
use crate::work::ProofResources;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::{Buckets, lock};
use terrane_proof::quality::{self, Quality, QualityLattice, QualityPart};
use terrane_proof::{GridDomain, ProofPosition, ProofTriangle};

/// Measures all tiles. Also returns the number of triangles left out because of an unusable vertex.
pub(super) fn measure(
    work: &ProofResources<'_>,
    plan: &QualityLattice,
    has_space: bool,
) -> Result<(Quality, u64)> {
    let layout = divide(plan.grid(), tile_count(work));
    let spread = MeshSpread::of_triangles(work, plan, layout, DomainReach::Corners)?;
    let inspector = QualityInspector { work, plan, has_space, crowded: Mutex::new(()) };
    work.progress.begin("measure", layout.len());
    let quality = work.findings(
        layout.len(),
        |quality: &mut Quality, index| {
            inspector.measure(&spread.triangles, index as usize, layout.domain(index), quality)?;
            work.progress.advance(1);
            Ok(())
        },
        Quality::merge,
    )?;
    work.progress.end();
    Ok((quality, spread.broken))
}

/// The number of tiles of a mesh.
fn tile_count(work: &ProofResources<'_>) -> u64 {
    let triangles = work.mesh.info().triangles;
    let need = quality::bytes_needed(triangles.saturating_mul(3) / 2);
    let flushes = triangles / (work.memory / 4 / size_of::<ProofTriangle>() as u64).max(1) + 1;
    domain_count(work, triangles, need, flushes)
}

struct QualityInspector<'a> {
    work: &'a ProofResources<'a>,
    plan: &'a QualityLattice,
    has_space: bool,
    /// Locked while a tile that cannot be split takes more than a thread's share.
    crowded: Mutex<()>,
}

impl QualityInspector<'_> {
    fn measure(
        &self,
        buckets: &Buckets<ProofTriangle>,
        number: usize,
        domain: GridDomain,
        tally: &mut Quality,
    ) -> Result<()> {
        self.work.cancel.check()?;
        let triangles = buckets.len(number);
        let need = quality::bytes_needed(triangles);
        if need <= self.work.share && triangles <= MAX_TRIANGLES {
            return self.measure_whole(buckets, number, domain, tally);
        }
        let pieces = pieces(domain);
        if pieces.len() > 1 {
            let subdivided = respread(self.work, buckets, number, &pieces, has_corner)?;
            return (0..)
                .zip(&pieces)
                .try_for_each(|(number, &piece)| self.measure(&subdivided, number, piece, tally));
        }
        if need > self.work.memory || triangles > MAX_TRIANGLES {
            return Err(self.too_crowded(domain, triangles, need));
        }
        let _alone = lock(&self.crowded);
        self.measure_whole(buckets, number, domain, tally)
    }

    fn measure_whole(
        &self,
        buckets: &Buckets<ProofTriangle>,
        number: usize,
        domain: GridDomain,
        tally: &mut Quality,
    ) -> Result<()> {
        let triangles = load(buckets, number)?;
        let (plan, has_space) = (self.plan, self.has_space);
        quality::measure(&QualityPart { domain, triangles: &triangles, plan, has_space }, tally);
        Ok(())
    }

    fn too_crowded(&self, domain: GridDomain, triangles: u64, need: u64) -> Error {
        let Rect { col, row, .. } = domain.rect;
        let [x, y] = self.plan.world(ProofPosition::sample(i64::from(col), i64::from(row)));
        let what = format!("{triangles} triangles at one position");
        self.work.short(&what, need).at(format!("x {x}, y {y}"))
    }
}

/// True when the domain owns a corner of the triangle.
fn has_corner(domain: &GridDomain, triangle: &ProofTriangle) -> bool {
    triangle.positions().into_iter().any(|at| domain.owns(at))
}
