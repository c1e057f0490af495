//! A method with its threshold in a metric, and the vertices it keeps of lines and rings.

use terrane_base::error::{Error, Result};
use terrane_line::metric::{LEAST, MOST, measurable};
use terrane_line::topology::RingCollapse;
use terrane_line::{
    DistanceMetric, GeographicMetric, LocatedVertex, PlaneMetric, SimplifyMethod, SimplifyScratch,
    SpaceMetric, Xy, metric, registry, ring,
};
use terrane_vector::GeometryPart;

/// Metric of distances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DistanceKind {
    /// x and y, in their units.
    #[default]
    Plane,
    /// x, y and z, in one unit.
    Space,
    /// Longitudes and latitudes in degrees, in metres on the ellipsoid.
    Geographic,
}

/// A vertex in the type of a metric.
pub(super) trait MetricVertex: Copy + Send + Sync {
    fn of(xy: Xy, z: f64) -> Self;
}

impl MetricVertex for Xy {
    fn of(xy: Xy, _: f64) -> Self {
        xy.map(measurable)
    }
}

impl MetricVertex for [f64; 3] {
    fn of([x, y]: Xy, z: f64) -> Self {
        [x, y, z].map(measurable)
    }
}

impl MetricVertex for LocatedVertex {
    fn of(xy: Xy, _: f64) -> Self {
        Self::new(xy.map(measurable))
    }
}

/// Vertices of a part in the type of a metric.
pub(super) fn vertices<V: MetricVertex>(part: &GeometryPart<'_>, out: &mut Vec<V>) {
    out.clear();
    let positions = part.xy.iter().enumerate();
    out.extend(positions.map(|(i, xy)| V::of(*xy, part.z.get(i).copied().unwrap_or(0.0))));
}

/// Threshold below all others: keeps all vertices, even those on their segment.
pub(super) const EVERYTHING: f64 = -1.0;

/// A method with its threshold in a metric.
#[derive(Clone, Copy, Debug)]
pub(super) struct SimplifyRule {
    pub(super) method: &'static SimplifyMethod,
    pub(super) measure: DistanceKind,
    /// Tolerance, or area for methods that bound one; or [`EVERYTHING`].
    pub(super) threshold: f64,
    /// Treatment of rings with too few vertices left.
    pub(super) collapse: RingCollapse,
}

/// A task for a method in any metric.
pub(super) trait MetricTask {
    type Output;

    fn run<V: MetricVertex, M: DistanceMetric<V> + Copy>(
        self,
        tool: &MetricTool<V, M>,
    ) -> Self::Output;
}

/// A rule for the vertex type of its metric.
#[derive(Clone, Copy)]
pub(super) struct MetricTool<V, M> {
    pub(super) metric: M,
    run: registry::Run<V, M>,
    pub(super) rule: SimplifyRule,
}

/// Selects vertices of an open line: vertices, buffers, kept indices (appended).
pub(super) type Choose<'a, V> = dyn FnMut(&[V], &mut SimplifyScratch, &mut Vec<u32>) + 'a;

/// Result for a part, with the distance of the omitted vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PartOutcome {
    /// The ring would have fewer than three vertices left.
    pub(super) collapsed: bool,
    /// Largest squared distance of an omitted vertex.
    pub(super) distance2: f64,
}

impl SimplifyRule {
    /// True if no vertex is omitted.
    pub(super) fn keeps_everything(&self) -> bool {
        self.threshold == EVERYTHING
    }

    /// Runs the task with the method in its metric.
    pub(super) fn apply<T: MetricTask>(&self, task: T) -> T::Output {
        let rule = *self;
        match rule.measure {
            DistanceKind::Plane => {
                task.run(&MetricTool { metric: PlaneMetric, run: rule.method.plane, rule })
            }
            DistanceKind::Space => {
                task.run(&MetricTool { metric: SpaceMetric, run: rule.method.space, rule })
            }
            DistanceKind::Geographic => task.run(&MetricTool {
                metric: GeographicMetric,
                run: rule.method.geographic,
                rule,
            }),
        }
    }
}

/// Fails for a part that cannot be measured: missing heights, invalid latitudes, or coordinates whose products
/// overflow.
pub(super) fn check(part: &GeometryPart<'_>, rule: &SimplifyRule) -> Result<()> {
    let z = if rule.measure == DistanceKind::Space { part.z } else { &[] };
    match rule.measure {
        _ if rule.keeps_everything() => return Ok(()),
        DistanceKind::Space if part.z.is_empty() || part.z.iter().any(|z| z.is_nan()) => {
            return Err(Error::bad_input("a vertex has no height (required by ‹metric› 3d)")
                .remedy("leave out ‹metric› 3d"));
        }
        DistanceKind::Geographic if part.xy.iter().any(|[_, y]| y.abs() > 90.0) => {
            return Err(Error::bad_input("a latitude exceeds 90 degrees")
                .remedy("pass ‹tolerance› as a plain number, in units of the data"));
        }
        _ => {}
    }
    let mut all = part.xy.as_flattened().iter().chain(z);
    // Tiny coordinates count as 0, which matters only for a tiny threshold.
    let least = if rule.threshold < FINEST { LEAST } else { 0.0 };
    let wrong = all.find(|c| c.abs() > MOST || (**c != 0.0 && c.abs() < least));
    let Some(wrong) = wrong else { return Ok(()) };
    let (extreme, remedy) = match wrong.abs() > MOST {
        true => ("large", "change the unit of the data, or remove the feature"),
        false => ("small", "pass ‹tolerance› 1e-50 or more, or replace it by 0"),
    };
    let message = format!("coordinate {wrong:?} is too {extreme} to compute distances");
    Err(Error::bad_input(message).remedy(remedy))
}

/// From this threshold on, values below [`LEAST`] have no effect.
const FINEST: f64 = 1e-50;

impl<V: MetricVertex, M: DistanceMetric<V> + Copy> MetricTool<V, M> {
    /// Appends the kept indices of an open line.
    pub(super) fn line(&self, points: &[V], scratch: &mut SimplifyScratch, kept: &mut Vec<u32>) {
        if self.rule.keeps_everything() {
            return kept.extend(0..points.len() as u32);
        }
        (self.run)(&self.metric, points, self.rule.threshold, scratch, kept);
    }

    /// Selects vertices by the method.
    pub(super) fn method(&self) -> impl FnMut(&[V], &mut SimplifyScratch, &mut Vec<u32>) + '_ {
        |points, scratch, kept| self.line(points, scratch, kept)
    }

    /// Writes the kept indices of a line or ring to `kept`. For a closed ring these are ascending indices of
    /// distinct vertices; for a dropped ring, none.
    pub(super) fn part(
        &self,
        points: &[V],
        is_ring: bool,
        choose: &mut Choose<'_, V>,
        scratch: &mut SimplifyScratch,
        kept: &mut Vec<u32>,
    ) -> PartOutcome {
        let collapsed = self.select(points, is_ring, choose, scratch, kept);
        let distance2 =
            if is_ring { self.largest_of_ring(points, kept) } else { self.largest(points, kept) };
        PartOutcome { collapsed, distance2 }
    }

    /// As [`part`](Self::part), without distances; true for a collapsed ring.
    pub(super) fn select(
        &self,
        points: &[V],
        is_ring: bool,
        choose: &mut Choose<'_, V>,
        scratch: &mut SimplifyScratch,
        kept: &mut Vec<u32>,
    ) -> bool {
        kept.clear();
        if !is_ring {
            self.open(points, choose, scratch, kept);
            return false;
        }
        let collapsed = self.whole_ring(points, choose, scratch, kept);
        match (collapsed, self.rule.collapse) {
            (true, RingCollapse::Drop) => kept.clear(),
            (true, RingCollapse::Keep) => {
                kept.clear();
                kept.extend(0..points.len().saturating_sub(1) as u32);
            }
            _ => {}
        }
        collapsed
    }

    /// A line; a closed line keeps its first vertex and is split into halves.
    pub(super) fn open(
        &self,
        points: &[V],
        choose: &mut Choose<'_, V>,
        scratch: &mut SimplifyScratch,
        kept: &mut Vec<u32>,
    ) {
        let ends = [points.first(), points.last()].map(|end| end.map(M::coordinates));
        let is_closed = points.len() > 3 && ends[0] == ends[1];
        let far =
            is_closed.then(|| metric::largest_distance2(&self.metric, points, &self.ends(points)));
        match far.flatten() {
            Some((far, square)) if square > 0.0 => {
                choose(&points[..=far as usize], scratch, kept);
                kept.pop();
                let at = kept.len();
                choose(&points[far as usize..], scratch, kept);
                kept[at..].iter_mut().for_each(|i| *i += far);
            }
            _ => choose(points, scratch, kept),
        }
    }

    /// Appends the kept indices of a ring before the collapse policy applies; true if it collapsed.
    pub(super) fn whole_ring(
        &self,
        points: &[V],
        choose: &mut Choose<'_, V>,
        scratch: &mut SimplifyScratch,
        kept: &mut Vec<u32>,
    ) -> bool {
        let SimplifyRule { method, threshold, .. } = self.rule;
        let fate = match method.bounds.weight() {
            Some(weight) => ring::visvalingam(&self.metric, points, threshold, weight, kept),
            None => {
                let can_move = !method.splits;
                ring::simplify(&self.metric, points, threshold, can_move, choose, scratch, kept)
            }
        };
        fate == ring::RingFate::Collapsed
    }

    fn ends(&self, points: &[V]) -> [u32; 2] {
        [0, points.len() as u32 - 1]
    }

    /// Largest squared distance of an omitted vertex from the segment that replaces it.
    pub(super) fn largest(&self, points: &[V], kept: &[u32]) -> f64 {
        metric::largest_distance2(&self.metric, points, kept).map_or(0.0, |(_, square)| square)
    }

    /// The same for a ring: vertices before the first kept one belong to the last segment.
    fn largest_of_ring(&self, ring: &[V], kept: &[u32]) -> f64 {
        let (Some(&first), Some(&last)) = (kept.first(), kept.last()) else { return 0.0 };
        let around = ring[last as usize..ring.len() - 1].iter().chain(&ring[..=first as usize]);
        let around: Vec<V> = around.copied().collect();
        let closing = match around.len() {
            0 | 1 => 0.0,
            count => self.largest(&around, &[0, count as u32 - 1]),
        };
        self.largest(ring, kept).max(closing)
    }
}
