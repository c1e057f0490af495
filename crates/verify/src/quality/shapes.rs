//! The tiles of a mesh, one after the other. Tiles with too many triangles are subdivided.

use std::sync::Mutex;

use crate::buckets::{DomainReach, MAX_TRIANGLES, MeshSpread};
use crate::plane_tiles::{CROWD, MOST, RUN_BYTES, SHARES, divide, load, pieces, respread};
use crate::work::ProofResources;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::workers;
use terrane_files::{Buckets, lock};
use terrane_proof::quality::{self, Quality, QualityLattice, QualityPart};
use terrane_proof::{GridDomain, ProofPosition, ProofTriangle};

/// Measures all tiles. Also returns the number of triangles left out because of an unusable vertex.
pub(super) fn measure(
    work: &ProofResources<'_>,
    plan: &QualityLattice,
    has_space: bool,
) -> Result<(Quality, u64)> {
    let layout = divide(plan.grid(), memory_needed(work));
    let spread = MeshSpread::of_triangles(work, plan, layout, DomainReach::Corners)?;
    let all = Mutex::new(Quality::default());
    let looker = QualityInspector { work, plan, has_space, crowded: Mutex::new(()) };
    work.progress.begin("squares", layout.len());
    let look = |found: &mut Quality, index: u64| {
        let domain = layout.domain(index);
        looker.measure(&spread.triangles, index as usize, domain, found)?;
        work.progress.advance(1);
        Ok(())
    };
    let finish = |found: Quality| {
        lock(&all).merge(&found);
        Ok(())
    };
    workers::run(work.threads, layout.len(), &work.cancel, Quality::default, look, finish)?;
    work.progress.end();
    let found = std::mem::take(&mut *lock(&all));
    Ok((found, spread.broken))
}

/// The number of tiles: few enough for a small index, but so many that one of average density takes half
/// of a thread's memory.
fn memory_needed(work: &ProofResources<'_>) -> u64 {
    let triangles = work.mesh.info().triangles;
    let need = quality::bytes_needed(triangles.saturating_mul(3) / 2);
    let wanted = (triangles / CROWD).max(need / (work.share / 2)).max(SHARES * work.threads as u64);
    // Each time the memory for triangles is full, it leaves a run in every square at worst.
    let flushes = triangles / (work.memory / 4 / size_of::<ProofTriangle>() as u64).max(1) + 1;
    let indexed = work.share / 8 / RUN_BYTES / flushes;
    wanted.min(indexed).clamp(1, MOST)
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
        pile: &Buckets<ProofTriangle>,
        number: usize,
        domain: GridDomain,
        found: &mut Quality,
    ) -> Result<()> {
        self.work.cancel.check()?;
        let triangles = pile.len(number);
        let need = quality::bytes_needed(triangles);
        if need <= self.work.share && triangles <= MAX_TRIANGLES {
            return self.measure_triangle(pile, number, domain, found);
        }
        let pieces = pieces(domain);
        if pieces.len() > 1 {
            let again = respread(self.work, pile, number, &pieces, has_corner)?;
            let mut all = (0..).zip(&pieces);
            return all.try_for_each(|(number, &piece)| self.measure(&again, number, piece, found));
        }
        if need > self.work.memory || triangles > MAX_TRIANGLES {
            return Err(self.too_crowded(domain, triangles, need));
        }
        let _alone = lock(&self.crowded);
        self.measure_triangle(pile, number, domain, found)
    }

    fn measure_triangle(
        &self,
        pile: &Buckets<ProofTriangle>,
        number: usize,
        domain: GridDomain,
        found: &mut Quality,
    ) -> Result<()> {
        let triangles = load(pile, number)?;
        let (plan, has_space) = (self.plan, self.has_space);
        quality::measure(&QualityPart { domain, triangles: &triangles, plan, has_space }, found);
        Ok(())
    }

    fn too_crowded(&self, domain: GridDomain, triangles: u64, need: u64) -> Error {
        let Rect { col, row, .. } = domain.rect;
        let [x, y] = self.plan.world(ProofPosition::sample(i64::from(col), i64::from(row)));
        let what = format!("{triangles} triangles share a place");
        self.work.short(&what, need).at(format!("x {x}, y {y}"))
    }
}

/// True when the domain owns a corner of the triangle.
fn has_corner(domain: &GridDomain, triangle: &ProofTriangle) -> bool {
    triangle.positions().into_iter().any(|at| domain.owns(at))
}
