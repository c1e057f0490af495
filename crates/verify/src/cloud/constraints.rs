//! The constraints of a mesh of a point cloud, computed independently: the points nearest to given positions,
//! and lines clipped to the hull, by domain.

use super::context::CloudProofContext;
use super::points::SpreadPoints;
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_engine::cloud_constraints::OnCloud;
use terrane_files::Buckets;
use terrane_proof::cloud::{
    CloudTrack, NearestQuery, ProofHull, ProofNearestPoints, order, position,
};
use terrane_proof::{DomainLayout, GridDomain, ProofPosition};

/// Points that are sorted and searched at a time.
const CHUNK: usize = 1 << 16;

/// Required points and lines, by domain.
pub(super) struct ConstraintChecks {
    /// Points by domain, in order.
    points: Vec<(u64, Point)>,
    /// Number of positions beyond the hull.
    pub(super) beyond: u64,
    /// By line: `None` outside the hull.
    tracks: Vec<Option<CloudTrack>>,
    /// Domains, and lines in them.
    lines: Vec<(u64, u32)>,
}

impl ConstraintChecks {
    pub(super) fn new(
        context: &CloudProofContext<'_>,
        points: &SpreadPoints,
        hull: &ProofHull,
        layout: DomainLayout,
    ) -> Result<Self> {
        let constraints = &context.constraints;
        let tracks: Vec<_> = constraints
            .lines
            .iter()
            .map(|line| CloudTrack::new(line.ends, line.heights, hull))
            .collect();
        let mut lines = Vec::new();
        for (number, track) in (0..).zip(&tracks) {
            let Some(track) = track else { continue };
            track.each_domain(
                |at| layout.domain(layout.owner(at)),
                |at| lines.push((layout.owner(at), number)),
            );
        }
        lines.sort_unstable();
        let (nearest, beyond) = nearest(constraints, &points.points, hull, layout)?;
        let mut points: Vec<_> =
            nearest.into_iter().map(|point| (layout.owner(position(point)), point)).collect();
        points.sort_unstable_by_key(|(domain, point)| (*domain, order(point)));
        points.dedup();
        Ok(Self { points, beyond, tracks, lines })
    }

    /// Bytes in use.
    pub(super) fn bytes(&self) -> u64 {
        let [points, tracks] = [size_of_val(&self.points[..]), size_of_val(&self.tracks[..])];
        (points + tracks + size_of_val(&self.lines[..])) as u64
    }

    pub(super) fn is_outside(&self, line: usize) -> bool {
        self.tracks[line].is_none()
    }

    /// The points and lines in the domain with this number.
    pub(super) fn of(&self, domain: u64) -> DomainConstraints {
        let points = &self.points[self.points.partition_point(|&(other, _)| other < domain)..];
        let points = points.iter().take_while(|(other, _)| *other == domain);
        let lines = &self.lines[self.lines.partition_point(|&(other, _)| other < domain)..];
        let lines = lines.iter().take_while(|(other, _)| *other == domain);
        let tracks = lines.filter_map(|&(_, line)| self.tracks[line as usize]);
        DomainConstraints {
            points: points.map(|&(_, point)| point).collect(),
            lines: tracks.collect(),
        }
    }
}

/// Required points and lines of one domain.
pub(super) struct DomainConstraints {
    pub(super) points: Vec<Point>,
    pub(super) lines: Vec<CloudTrack>,
}

impl DomainConstraints {
    /// Only the points and lines of a piece of the domain.
    pub(super) fn within(&self, piece: &GridDomain) -> Self {
        let points = self.points.iter().copied().filter(|point| piece.owns(position(*point)));
        let lines = self.lines.iter().copied().filter(|line| line.is_in(piece));
        Self { points: points.collect(), lines: lines.collect() }
    }
}

/// The points nearest to the positions inside the hull, and the number of positions outside.
fn nearest(
    constraints: &OnCloud,
    points: &Buckets<Point>,
    hull: &ProofHull,
    layout: DomainLayout,
) -> Result<(Vec<Point>, u64)> {
    let all = constraints.points.iter().map(|at| at.map(|steps| steps as i32));
    let mut sought: Vec<_> = all.map(|at| NearestQuery { at, found: None }).collect();
    let count = sought.len();
    sought.retain(|sought| hull.contains(sample(sought.at)));
    let beyond = (count - sought.len()) as u64;
    sought.dedup();
    sought.sort_by_key(|sought| owner(sought, layout));
    for group in sought.chunk_by_mut(|a, b| owner(a, layout) == owner(b, layout)) {
        seek(group, owner(&group[0], layout), points, layout)?;
    }
    Ok((
        sought.into_iter().filter_map(|sought| sought.found).map(|(_, point)| point).collect(),
        beyond,
    ))
}

fn sample([x, y]: [i32; 2]) -> ProofPosition {
    ProofPosition::sample(x.into(), y.into())
}

/// The domain of a position.
fn owner(sought: &NearestQuery, layout: DomainLayout) -> u64 {
    layout.owner(sample(sought.at))
}

/// Finds the nearest points of positions in one domain: searches this domain, then rings of domains around it until
/// none can have a nearer point.
fn seek(
    group: &mut [NearestQuery],
    home: u64,
    points: &Buckets<Point>,
    layout: DomainLayout,
) -> Result<()> {
    let [across, down] = layout.counts().map(i64::from);
    let place = [home as i64 % across, home as i64 / across];
    for far in 0..across.max(down) {
        // A domain in ring `far` is at least `far - 1` domains away from any position of this one.
        let away = (far - 1).max(0) * i64::from(layout.size[0].min(layout.size[1]));
        if group.iter().all(|sought| sought.found.is_some_and(|(found, _)| found < away * away)) {
            break;
        }
        let (rows, cols) = (place[1] - far..=place[1] + far, place[0] - far..=place[0] + far);
        for row in rows.filter(|row| (0..down).contains(row)) {
            let is_rim = (row - place[1]).abs() == far;
            let cols = cols.clone().filter(|col| (0..across).contains(col));
            for col in cols.filter(|col| is_rim || (col - place[0]).abs() == far) {
                let number = (row * across + col) as u64;
                let domain = layout.domain(number);
                if points.len(number as usize) > 0
                    && group.iter().any(|sought| may_have(domain, sought))
                {
                    search(group, points, number as usize)?;
                }
            }
        }
    }
    Ok(())
}

/// True when a domain may have a point at least as near as the nearest so far.
fn may_have(domain: GridDomain, sought: &NearestQuery) -> bool {
    sought.found.is_none_or(|(found, _)| gap(sought.at, domain) <= found)
}

fn search(group: &mut [NearestQuery], points: &Buckets<Point>, number: usize) -> Result<()> {
    points.read(number, |run| {
        for chunk in run.chunks(CHUNK) {
            let chunk = ProofNearestPoints::of(chunk.to_vec());
            group.iter_mut().for_each(|sought| chunk.improve(sought));
        }
    })
}

/// Lower bound of the squared distance of a position to a domain.
fn gap(at: [i32; 2], domain: GridDomain) -> i64 {
    let rect = domain.rect;
    let (low, high) = ([rect.col, rect.row], [rect.end_col() - 1, rect.end_row() - 1]);
    [0, 1]
        .map(|axis| {
            let at = i64::from(at[axis]);
            (at - at.clamp(low[axis].into(), high[axis].into())).pow(2)
        })
        .iter()
        .sum()
}
