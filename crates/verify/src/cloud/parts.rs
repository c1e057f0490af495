//! The domains of a cloud and its mesh, one after the other. Domains with too many points are
//! subdivided.
//!
//! Domains are square tiles of the plane. One that is too large for a thread is divided into sixteen
//! through another temporary file, recursively.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use super::constraints::{ConstraintChecks, DomainConstraints};
use super::context::CloudProofContext;
use super::points::SpreadPoints;
use crate::buckets::{MAX_TRIANGLES, MeshSpread};
use crate::plane_tiles::{divide, domain_count, load, pieces, respread};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, Rect};
use terrane_files::{Buckets, lock};
use terrane_proof::cloud::{self, CloudProofPart, ProofHull, position};
use terrane_proof::{DomainLayout, GridDomain, ProofPosition, ProofTally, ProofTriangle};

/// Divides the lattice so that a domain of average density takes half of a thread's memory at most.
pub(super) fn layout(context: &CloudProofContext<'_>) -> Result<DomainLayout> {
    let [low, high] = context.bounds;
    let grid = [high.x.abs_diff(low.x), high.y.abs_diff(low.y)].map(|side| side.saturating_add(1));
    if grid.iter().any(|&side| side > 1 << 30) {
        return Err(Error::bad_input(
            "the extent of the point cloud exceeds 2^30 steps of its scale",
        ));
    }
    Ok(divide(grid, tile_count(context)))
}

/// The number of domains of a cloud and its mesh.
fn tile_count(context: &CloudProofContext<'_>) -> u64 {
    let (work, mesh) = (&context.work, context.work.mesh.info());
    let points = context.source.info().count.max(1);
    let triangles = mesh.triangles.saturating_mul(3) / 2;
    let need = cloud::bytes_needed(points, triangles, mesh.vertices);
    let flushes = points / (work.share / 2 / 40).max(1) + 1;
    domain_count(work, points.max(mesh.triangles), need, flushes)
}

/// Checks every domain. Also returns the bytes spilled for subdivided domains.
pub(super) fn check(
    context: &CloudProofContext<'_>,
    points: &SpreadPoints,
    hull: &ProofHull,
    spread: &MeshSpread,
    constraints: &ConstraintChecks,
) -> Result<(ProofTally, u64)> {
    let (work, layout) = (&context.work, spread.layout);
    let checker =
        CloudDomainChecker { context, hull, crowded: Mutex::new(()), spilled: AtomicU64::new(0) };
    let records = DomainRecords {
        points: &points.points,
        triangles: &spread.triangles,
        positions: spread.positions.as_ref(),
    };
    work.progress.begin("prove", points.counts.kept);
    let tally = work.findings(
        layout.len(),
        |tally: &mut ProofTally, index| {
            let (number, domain) = (index as usize, layout.domain(index));
            checker.check(&records, &constraints.of(index), number, domain, tally)?;
            work.progress.advance(records.points.len(number));
            Ok(())
        },
        ProofTally::merge,
    )?;
    work.progress.end();
    Ok((tally, checker.spilled.into_inner()))
}

/// Records of several domains, by the number of the domain.
#[derive(Clone, Copy)]
struct DomainRecords<'a> {
    points: &'a Buckets<Point>,
    triangles: &'a Buckets<ProofTriangle>,
    positions: Option<&'a Buckets<ProofPosition>>,
}

impl DomainRecords<'_> {
    /// Points, triangles and vertices of a domain.
    fn counts(&self, domain: usize) -> [u64; 3] {
        let positions = self.positions.map_or(0, |positions| positions.len(domain));
        [self.points.len(domain), self.triangles.len(domain), positions]
    }
}

struct CloudDomainChecker<'a> {
    context: &'a CloudProofContext<'a>,
    hull: &'a ProofHull,
    /// Locked while a domain that cannot be split takes more than a thread's share.
    crowded: Mutex<()>,
    /// Bytes spilled for subdivided domains.
    spilled: AtomicU64,
}

impl CloudDomainChecker<'_> {
    fn check(
        &self,
        records: &DomainRecords<'_>,
        constraints: &DomainConstraints,
        number: usize,
        domain: GridDomain,
        tally: &mut ProofTally,
    ) -> Result<()> {
        let work = &self.context.work;
        work.cancel.check()?;
        let [points, triangles, positions] = records.counts(number);
        let need = cloud::bytes_needed(points, triangles, positions);
        if need <= work.share && triangles <= MAX_TRIANGLES {
            return self.check_whole(records, constraints, number, domain, tally);
        }
        let pieces = pieces(domain);
        if pieces.len() > 1 {
            return self.check_pieces(records, constraints, number, &pieces, tally);
        }
        if need > work.memory || triangles > MAX_TRIANGLES {
            return Err(self.too_crowded(domain, points, triangles, need));
        }
        let _alone = lock(&self.crowded);
        self.check_whole(records, constraints, number, domain, tally)
    }

    /// Spreads the contents of a domain over its sixteen subdivisions, and checks those.
    fn check_pieces(
        &self,
        records: &DomainRecords<'_>,
        constraints: &DomainConstraints,
        number: usize,
        pieces: &[GridDomain],
        tally: &mut ProofTally,
    ) -> Result<()> {
        let work = &self.context.work;
        let points = respread(work, records.points, number, pieces, |piece, &point: &Point| {
            piece.owns(position(point))
        })?;
        let triangles = respread(work, records.triangles, number, pieces, GridDomain::may_touch)?;
        let positions = records.positions.map(|positions| {
            respread(work, positions, number, pieces, |piece, &at: &ProofPosition| piece.owns(at))
        });
        let positions = positions.transpose()?;
        let positions = positions.as_ref();
        let subdivided = DomainRecords { points: &points, triangles: &triangles, positions };
        let bytes = points.spilled() + triangles.spilled() + positions.map_or(0, Buckets::spilled);
        self.spilled.fetch_add(bytes, Ordering::Relaxed);
        (0..).zip(pieces).try_for_each(|(number, &piece)| {
            self.check(&subdivided, &constraints.within(&piece), number, piece, tally)
        })
    }

    fn check_whole(
        &self,
        records: &DomainRecords<'_>,
        constraints: &DomainConstraints,
        number: usize,
        domain: GridDomain,
        tally: &mut ProofTally,
    ) -> Result<()> {
        let mut points = load(records.points, number)?;
        points.sort_unstable_by_key(cloud::order);
        let triangles = load(records.triangles, number)?;
        let mut vertices =
            records.positions.map(|positions| load(positions, number)).transpose()?;
        vertices.iter_mut().for_each(|vertices| vertices.sort_unstable());
        let part = CloudProofPart {
            domain,
            points: &points,
            triangles: &triangles,
            vertices: vertices.as_deref(),
            hull: self.hull,
            bound: self.context.bound,
            kept: &constraints.points,
            lines: &constraints.lines,
        };
        cloud::check(&part, tally);
        Ok(())
    }

    fn too_crowded(&self, domain: GridDomain, points: u64, triangles: u64, need: u64) -> Error {
        let Rect { col, row, .. } = domain.rect;
        let at = ProofPosition::sample(i64::from(col), i64::from(row));
        let [x, y] = self.context.placer.world(at);
        let what = format!("{points} points and {triangles} triangles at one position");
        self.context.work.short(&what, need).at(format!("x {x}, y {y}"))
    }
}
