//! Proof of a mesh against a grid, in passes: the mesh into buckets by domain, then one domain after the
//! other.

use std::sync::Mutex;
use std::time::Instant;

use super::buckets::{MAX_TRIANGLES, MeshSpread};
use super::context::{GridProofContext, MeshRequirements};
use super::report::{VerifyReport, report};
use super::work::ProofResources;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::{Cancel, Progress, Resources, workers};
use terrane_files::lock;
use terrane_mesh::MeshSource;
use terrane_proof::{
    self as proof, DomainLayout, GridDomain, GridProofPart, OutlineFollowing, ProofAngleBound,
    ProofBreakline, ProofPosition, ProofSurface, ProofTally, ProofTriangle, UnpairedEdge,
};
use terrane_raster::{GridInfo, GridSource};

/// Most samples of a domain: with their errors they should stay near the processor.
const MAX_SAMPLES: u64 = 1 << 18;
/// Most rows of a domain on a grid stored in strips.
const STRIP_ROWS: u64 = 256;
/// Domains for each thread, at least, where the grid is large enough.
const SHARES: u64 = 4;

/// Proves `mesh` against `grid`. The error between samples is measured for every `bound`. A caller's
/// caches of both are not part of the memory budget, of which this takes about half.
///
/// Errors: a tolerance that is not a number, a grid without an invertible geotransform, a triangle
/// with an invalid vertex index, too little memory, and errors of the sources.
pub fn verify(
    mesh: &dyn MeshSource,
    grid: &dyn GridSource,
    asked: MeshRequirements<'_>,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VerifyReport> {
    let start = Instant::now();
    let mut work = ProofResources::new(mesh, asked.tolerance, resources, progress, cancel)?;
    work.set_aside(asked.kept.bytes());
    let context = GridProofContext::new(work, grid, asked)?;
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
    let most = if in_strips { MAX_SAMPLES.max(across * STRIP_ROWS) } else { MAX_SAMPLES };
    let density = (1 << 10) * triangles.min(2 * samples) / samples;
    let need = proof::bytes_needed(1 << 10, density + density / 2, density);
    let area = (memory / 2 * (1 << 10) / need)
        .min(most)
        .min(samples / (SHARES * threads as u64))
        .max(unit * unit);
    let side = |samples: u64| (samples / unit * unit).clamp(unit, 1 << 30) as u32;
    let size = if !in_strips {
        [side(area.isqrt()); 2]
    } else if area / across >= unit {
        [side(across), side(area / across)]
    } else {
        [side(area / unit), GridDomain::UNIT]
    };
    DomainLayout { grid, size }
}

/// Fails when the index of all domains takes more than half of the memory.
fn check_index(layout: &DomainLayout, context: &GridProofContext<'_>) -> Result<()> {
    let need = layout.len().saturating_mul(INDEX_BYTES);
    if need <= context.work.memory / 2 {
        return Ok(());
    }
    Err(context.work.short("a grid of this size needs an index", 2 * need))
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
    let judge = |part: &GridProofPart<'_>, tally: &mut ProofTally| {
        let open = proof::check(part, tally);
        open.into_iter().try_for_each(|open| follow(context, &spread.layout, open, tally))
    };
    each(context, spread, proof::bytes_needed, judge, ProofTally::merge)
}

/// Bytes that take samples, triangles and vertices.
type Need = fn(u64, u64, u64) -> u64;

/// Runs `judge` on each domain with its triangles; `merge` combines the findings of two threads, and
/// `need` returns the bytes that `judge` takes.
pub(super) fn each<T: Default + Send>(
    context: &GridProofContext<'_>,
    spread: &MeshSpread,
    need: Need,
    judge: impl Fn(&GridProofPart<'_>, &mut T) -> Result<()> + Sync,
    merge: impl Fn(&mut T, &T) + Sync,
) -> Result<T> {
    let all = Mutex::new(T::default());
    let (work, info) = (&context.work, context.grid.info());
    work.progress.begin("samples", u64::from(info.width) * u64::from(info.height));
    let checker = GridDomainChecker { context, spread, need, judge, crowded: Mutex::new(()) };
    let judge = |found: &mut T, index| {
        let domain = spread.layout.domain(index);
        checker.check(domain, index as usize, found)?;
        work.progress.advance(domain.rect.len() as u64);
        Ok(())
    };
    let finish = |found: T| {
        merge(&mut lock(&all), &found);
        Ok(())
    };
    let (threads, units) = (work.threads, spread.layout.len());
    workers::run(threads, units, &work.cancel, T::default, judge, finish)?;
    work.progress.end();
    let found = std::mem::take(&mut *lock(&all));
    Ok(found)
}

/// Checks domains, splitting those too large for a thread's memory.
struct GridDomainChecker<'a, J> {
    context: &'a GridProofContext<'a>,
    spread: &'a MeshSpread,
    need: Need,
    judge: J,
    /// Held while a domain that cannot be split takes more than a thread's share.
    crowded: Mutex<()>,
}

impl<J> GridDomainChecker<'_, J> {
    fn check<T>(&self, domain: GridDomain, bucket: usize, found: &mut T) -> Result<()>
    where
        J: Fn(&GridProofPart<'_>, &mut T) -> Result<()>,
    {
        let (triangles, positions) = self.count(domain, bucket)?;
        let samples = domain.rect.len() as u64;
        let kept = samples.min(self.context.asked.kept.count()) * size_of::<ProofPosition>() as u64;
        let lines = self.context.asked.kept.lines().paths().ends_near(domain.rect);
        let lines: u64 = lines.map(|[a, b]| ProofBreakline::between(a, b).bytes_in(&domain)).sum();
        let need = kept + lines + (self.need)(domain.apron().len() as u64, triangles, positions);
        if need <= self.context.work.share {
            return self.check_whole(domain, bucket, [triangles, positions], found);
        }
        match domain.halves() {
            // Halves read the whole bucket and take their own of it: nothing is spread anew.
            Some(halves) => halves.into_iter().try_for_each(|d| self.check(d, bucket, found)),
            None if need > self.context.work.memory || triangles > MAX_TRIANGLES => {
                Err(too_crowded(&self.context.work, domain, [triangles, lines, need]))
            }
            None => {
                // One at a time, as it takes more than the share of a thread.
                let _alone = lock(&self.crowded);
                self.check_whole(domain, bucket, [triangles, positions], found)
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
        [triangles, positions]: [u64; 2],
        found: &mut T,
    ) -> Result<()>
    where
        J: Fn(&GridProofPart<'_>, &mut T) -> Result<()>,
    {
        let mut all = Vec::with_capacity(triangles as usize);
        self.each_triangle(domain, bucket, |triangle| all.push(*triangle))?;
        let mut vertices = Vec::with_capacity(positions as usize);
        self.each_position(domain, bucket, |at| vertices.push(at))?;
        vertices.sort_unstable();
        let kept = self.context.asked.kept.within(domain.rect);
        let mut kept: Vec<_> =
            kept.map(|[col, row]| ProofPosition::sample(col.into(), row.into())).collect();
        kept.sort_unstable();
        let near = self.context.asked.kept.lines().paths().ends_near(domain.rect);
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
            min_angle: self
                .context
                .asked
                .min_angle
                .map(|degrees| ProofAngleBound { degrees, steps }),
            precision: self.context.precision,
            is_fitted: self.context.is_fitted,
            tolerance: self.context.asked.tolerance,
            orientation: self.context.orientation,
        };
        (self.judge)(&part, found)
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
    [triangles, lines, need]: [u64; 3],
) -> Error {
    let Rect { col, row, width, height } = domain.rect;
    let beside = match lines >> 20 {
        0 => String::new(),
        mib => format!(", with breaklines of {mib} MiB,"),
    };
    let what = format!("{triangles} triangles touch the {width} x {height} samples there{beside}");
    work.short(&what, need).at(format!("column {col}, row {row}"))
}
