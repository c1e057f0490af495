//! Proof of a mesh against a grid, in passes: the mesh into buckets by domain, then one domain after the
//! other.

use std::sync::Mutex;
use std::time::Instant;

use super::buckets::{MAX_TRIANGLES, MeshSpread};
use super::context::{GridProofContext, MeshRequirements};
use super::plane_tiles::DOMAINS_PER_THREAD;
use super::report::{VerifyReport, report};
use super::work::ProofResources;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::lock;
use terrane_mesh::MeshSource;
use terrane_proof::{
    self as proof, DomainLayout, GridDomain, GridProofPart, OutlineFollowing, ProofAngleBound,
    ProofBreakline, ProofPosition, ProofSurface, ProofTally, ProofTriangle, UnpairedEdge,
};
use terrane_raster::{GridInfo, GridSource};

/// Maximum number of samples of a domain: with their errors they should fit into the processor's cache.
const MAX_SAMPLES: u64 = 1 << 18;
/// Maximum number of rows of a domain on a grid stored in strips.
const STRIP_ROWS: u64 = 256;

/// Proves `mesh` against `grid`. The error between samples is measured for every `bound`. A caller's
/// caches of both are not part of the memory budget, of which this takes about half.
///
/// # Errors
/// A tolerance that is not a number, a grid without an invertible geotransform, a triangle with an invalid
/// vertex index, too little memory, and errors of the sources.
pub fn verify(
    mesh: &dyn MeshSource,
    grid: &dyn GridSource,
    requirements: MeshRequirements<'_>,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VerifyReport> {
    let start = Instant::now();
    let mut work = ProofResources::new(mesh, requirements.tolerance, resources, progress, cancel)?;
    work.set_aside(requirements.kept.bytes());
    let context = GridProofContext::new(work, grid, requirements)?;
    let spread = fill(&context)?;
    let tally = check(&context, &spread)?;
    let mut report = report(&context, &spread.counts, spread.broken, &tally);
    report.run = context.work.statistics(start, resources, spread.bytes());
    report.of.samples_per_second = report.run.rate(report.of.samples);
    Ok(report)
}

/// Divides the grid so that a domain of average density takes half of a thread's memory. On a grid
/// stored in strips domains are as wide as the grid if they can, so that strips are decoded once.
fn layout(info: &GridInfo, triangles: u64, memory: u64, threads: usize) -> DomainLayout {
    let grid = [info.width, info.height];
    let samples = u64::from(info.width) * u64::from(info.height);
    let unit = u64::from(GridDomain::UNIT);
    let across = u64::from(info.width).next_multiple_of(unit);
    let in_strips = info.block.0 >= info.width;
    let max_samples = if in_strips { MAX_SAMPLES.max(across * STRIP_ROWS) } else { MAX_SAMPLES };
    let density = (1 << 10) * triangles.min(2 * samples) / samples;
    let need = proof::bytes_needed(1 << 10, density + density / 2, density);
    let area = (memory / 2 * (1 << 10) / need)
        .min(max_samples)
        .min(samples / (DOMAINS_PER_THREAD * threads as u64))
        .max(unit * unit);
    let size = if !in_strips {
        [side(area.isqrt()); 2]
    } else if area / across >= unit {
        [side(across), side(area / across)]
    } else {
        [side(area / unit), GridDomain::UNIT]
    };
    DomainLayout { grid, size }
}

/// The side of a domain of about so many samples: a multiple of the unit.
fn side(samples: u64) -> u32 {
    let unit = u64::from(GridDomain::UNIT);
    (samples / unit * unit).clamp(unit, 1 << 30) as u32
}

/// Fails when the index of all domains takes more than half of the memory.
fn check_index(layout: &DomainLayout, context: &GridProofContext<'_>) -> Result<()> {
    let need = layout.len().saturating_mul(INDEX_BYTES);
    if need <= context.work.memory / 2 {
        return Ok(());
    }
    Err(context.work.short("index of a grid of this size", 2 * need))
}

/// Bytes of index for one domain: two buckets with their runs in the file.
const INDEX_BYTES: u64 = 128;

/// Spreads the mesh over the domains of the grid.
fn fill(context: &GridProofContext<'_>) -> Result<MeshSpread> {
    MeshSpread::fill(&context.work, &context.snapper, divided(context)?)
}

/// The domains of the grid, few enough for their index to fit into memory.
pub(super) fn divided(context: &GridProofContext<'_>) -> Result<DomainLayout> {
    let (work, grid) = (&context.work, context.grid.info());
    let layout = layout(grid, work.mesh.info().triangles, work.share, work.threads);
    check_index(&layout, context)?;
    Ok(layout)
}

/// Checks every domain.
fn check(context: &GridProofContext<'_>, spread: &MeshSpread) -> Result<ProofTally> {
    each(
        context,
        spread,
        proof::bytes_needed,
        |part, tally: &mut ProofTally| {
            let open = proof::check(part, tally);
            open.into_iter().try_for_each(|open| follow(context, &spread.layout, open, tally))
        },
        ProofTally::merge,
    )
}

/// The bytes needed for so many samples, triangles and vertices.
type BytesNeeded = fn(u64, u64, u64) -> u64;

/// Runs `judge` on each domain with its triangles; `merge` combines the findings of two threads, and
/// `bytes_needed` returns the memory of `judge`.
pub(super) fn each<T: Default + Send>(
    context: &GridProofContext<'_>,
    spread: &MeshSpread,
    bytes_needed: BytesNeeded,
    judge: impl Fn(&GridProofPart<'_>, &mut T) -> Result<()> + Sync,
    merge: impl Fn(&mut T, &T) + Sync,
) -> Result<T> {
    let (work, info) = (&context.work, context.grid.info());
    work.progress.begin("samples", u64::from(info.width) * u64::from(info.height));
    let checker =
        GridDomainChecker { context, spread, bytes_needed, judge, crowded: Mutex::new(()) };
    let findings = work.findings(
        spread.layout.len(),
        |findings: &mut T, index| {
            let domain = spread.layout.domain(index);
            checker.check(domain, index as usize, findings)?;
            work.progress.advance(domain.rect.len() as u64);
            Ok(())
        },
        merge,
    )?;
    work.progress.end();
    Ok(findings)
}

/// Checks domains, splitting those too large for a thread's memory.
struct GridDomainChecker<'a, J> {
    context: &'a GridProofContext<'a>,
    spread: &'a MeshSpread,
    bytes_needed: BytesNeeded,
    judge: J,
    /// Locked while a domain that cannot be split takes more than a thread's share.
    crowded: Mutex<()>,
}

impl<J> GridDomainChecker<'_, J> {
    fn check<T>(&self, domain: GridDomain, bucket: usize, findings: &mut T) -> Result<()>
    where
        J: Fn(&GridProofPart<'_>, &mut T) -> Result<()>,
    {
        let (triangles, positions) = self.count(domain, bucket)?;
        let samples = domain.rect.len() as u64;
        let constraints = self.context.requirements.kept;
        let points = samples.min(constraints.count()) * size_of::<ProofPosition>() as u64;
        let lines = constraints.lines().paths().ends_near(domain.rect);
        let lines: u64 = lines.map(|[a, b]| ProofBreakline::between(a, b).bytes_in(&domain)).sum();
        let need =
            points + lines + (self.bytes_needed)(domain.apron().len() as u64, triangles, positions);
        if need <= self.context.work.share {
            return self.check_whole(domain, bucket, triangles, positions, findings);
        }
        match domain.halves() {
            // Each half filters the bucket of the whole: cheaper than spreading the records again.
            Some(halves) => halves.into_iter().try_for_each(|d| self.check(d, bucket, findings)),
            None if need > self.context.work.memory || triangles > MAX_TRIANGLES => {
                Err(too_crowded(&self.context.work, domain, triangles, lines, need))
            }
            None => {
                // One at a time, as it takes more than the share of a thread.
                let _alone = lock(&self.crowded);
                self.check_whole(domain, bucket, triangles, positions, findings)
            }
        }
    }

    /// Triangles that touch and vertices that lie in a domain, which is (part of) a bucket's.
    fn count(&self, domain: GridDomain, bucket: usize) -> Result<(u64, u64)> {
        let MeshSpread { layout, triangles, positions, .. } = self.spread;
        if domain == layout.domain(bucket as u64) {
            return Ok((triangles.len(bucket), positions.as_ref().map_or(0, |p| p.len(bucket))));
        }
        let mut counts = (0, 0);
        self.each_triangle(domain, bucket, |_| counts.0 += 1)?;
        self.each_position(domain, bucket, |_| counts.1 += 1)?;
        Ok(counts)
    }

    fn each_triangle(
        &self,
        domain: GridDomain,
        bucket: usize,
        mut visit: impl FnMut(&ProofTriangle),
    ) -> Result<()> {
        self.spread.triangles.read(bucket, |triangles| {
            triangles.iter().filter(|t| domain.may_touch(t)).for_each(&mut visit);
        })
    }

    fn each_position(
        &self,
        domain: GridDomain,
        bucket: usize,
        mut visit: impl FnMut(ProofPosition),
    ) -> Result<()> {
        let Some(positions) = &self.spread.positions else { return Ok(()) };
        positions.read(bucket, |positions| {
            positions.iter().copied().filter(|&at| domain.owns(at)).for_each(&mut visit);
        })
    }

    fn check_whole<T>(
        &self,
        domain: GridDomain,
        bucket: usize,
        triangles: u64,
        positions: u64,
        findings: &mut T,
    ) -> Result<()>
    where
        J: Fn(&GridProofPart<'_>, &mut T) -> Result<()>,
    {
        let mut all = Vec::with_capacity(triangles as usize);
        self.each_triangle(domain, bucket, |triangle| all.push(*triangle))?;
        let mut vertices = Vec::with_capacity(positions as usize);
        self.each_position(domain, bucket, |at| vertices.push(at))?;
        vertices.sort_unstable();
        let requirements = &self.context.requirements;
        let mut kept: Vec<_> = requirements
            .kept
            .within(domain.rect)
            .map(|[col, row]| ProofPosition::sample(col.into(), row.into()))
            .collect();
        kept.sort_unstable();
        let near = requirements.kept.lines().paths().ends_near(domain.rect);
        let lines: Vec<_> = near.map(|[a, b]| ProofBreakline::between(a, b)).collect();
        let map = self.context.grid.info().transform;
        let steps = [[map.a, map.d], [map.b, map.e]];
        let part = GridProofPart {
            domain,
            heights: &read(self.context, domain.apron())?,
            triangles: &all,
            vertices: self.spread.positions.is_some().then_some(&vertices[..]),
            kept: &kept,
            lines: &lines,
            min_angle: requirements.min_angle.map(|degrees| ProofAngleBound { degrees, steps }),
            precision: self.context.precision,
            is_fitted: self.context.is_fitted,
            tolerance: requirements.tolerance,
            orientation: self.context.orientation,
        };
        (self.judge)(&part, findings)
    }
}

/// Reads an apron, or another window.
fn read(context: &GridProofContext<'_>, rect: Rect) -> Result<Vec<f64>> {
    let mut heights = vec![0.0; rect.len()];
    context.grid.read_f64(rect, &mut heights)?;
    context.grid.copied(rect);
    Ok(heights)
}

/// Follows an open edge beyond its domain.
fn follow(
    context: &GridProofContext<'_>,
    layout: &DomainLayout,
    mut open: UnpairedEdge,
    tally: &mut ProofTally,
) -> Result<()> {
    loop {
        let window = open.rest.window(layout.grid);
        let surface = ProofSurface::new(layout.grid, window, &read(context, window)?);
        match surface.follow(open.rest) {
            OutlineFollowing::On => return Ok(()),
            OutlineFollowing::Off => {
                tally.crack(&open);
                return Ok(());
            }
            OutlineFollowing::Rest(rest) => open.rest = rest,
        }
    }
}

fn too_crowded(
    work: &ProofResources<'_>,
    domain: GridDomain,
    triangles: u64,
    lines: u64,
    need: u64,
) -> Error {
    let Rect { col, row, width, height } = domain.rect;
    let breaklines = match lines >> 20 {
        0 => String::new(),
        mib => format!(", breaklines of {mib} MiB"),
    };
    let what = format!("{triangles} triangles over {width} x {height} samples{breaklines}");
    work.short(&what, need).at(format!("column {col}, row {row}"))
}
