//! The pit-free surface of first returns: one triangulation for each height threshold; the highest one counts
//! at each position.

use std::convert::Infallible;

use super::super::extent::CellRequest;
use super::super::neighbours::{CellCenters, CloudSurfaces};
use super::context::Making;
use super::filter::spacing;
use super::first_returns::CanopySurface;
use super::lengths::MetricFrame;
use crate::point_index::{
    ColumnRowPositions, ColumnRowRange, MAX_POINTS, PointStore, SurroundingPoints, reach,
};
use terrane_base::error::Result;
use terrane_base::geom::{Point, PointFrame};
use terrane_delaunay::{ConvexHull, FixedPosition, Location, PointBins, SiteWindow, interpolate};
use terrane_engine::workers;
use terrane_gridding::pitfree::{PitFree, PitFreeFacet, is_short};

/// Points and their hull.
struct PitFreeLayer {
    store: PointStore,
    hull: ConvexHull,
}

/// The triangulations; the first is of all first returns.
pub(super) struct PitFreeLayers {
    layers: Vec<PitFreeLayer>,
    pits: PitFree,
    frame: PointFrame,
    /// Metres in a step along x and y.
    scale: [f64; 2],
    /// True if it has a part of the point cloud only.
    is_part: bool,
}

impl PitFreeLayer {
    fn new(store: PointStore) -> Result<Self> {
        let hull = store.hull()?;
        Ok(Self { store, hull })
    }
}

impl CanopySurface for PitFreeLayers {
    fn values(&self, piece: CellRequest<'_>, out: &mut [f64]) -> Result<()> {
        let centres = CellCenters::new(piece.extent, piece.rect, &self.frame);
        let at = centres.positions();
        let near = |window| self.layers.iter().map(|layer| layer.store.points_near(window)).sum();
        at.in_parts(MAX_POINTS, near, |part, window| {
            self.fill(at, part, window, piece.max_edge, out)
        })
    }

    fn is_exceeded(&self) -> bool {
        self.layers.iter().any(|layer| layer.store.is_exceeded())
    }

    fn spilled(&self) -> u64 {
        self.layers.iter().map(|layer| layer.store.spilled()).sum()
    }
}

impl PitFreeLayers {
    /// Triangulates the points of `first`; those high above `ground` are in further layers, too. Without
    /// `ground` there is one layer.
    pub(super) fn new(
        first: PointStore,
        ground: Option<&CloudSurfaces>,
        (metres, frame): (&MetricFrame, PointFrame),
        making: &Making<'_>,
    ) -> Result<Self> {
        let known = making.part.map(|(_, seen)| seen.first);
        let pits = PitFree::metres(known.unwrap_or_else(|| spacing(&[&first], metres)));
        let count = ground.map_or(0, |_| pits.layers() - 1);
        let memory = making.store_memory() / pits.layers() as u64;
        let tiling = *first.tiling();
        let window = making.surface_window();
        let store =
            |_| making.limited(PointStore::empty(tiling, making.folder(), memory), window, &[]);
        let high: Vec<PointStore> = (0..count).map(store).collect::<Result<_>>()?;
        if let Some(ground) = ground {
            raise(&first, ground, metres.step[2], &pits, &high, making)?;
        }
        let stores = std::iter::once(first).chain(high);
        let layers = stores.map(PitFreeLayer::new).collect::<Result<_>>()?;
        let [x, y, _] = metres.step;
        Ok(Self { layers, pits, frame, scale: [x, y], is_part: window.is_some() })
    }

    fn fill(
        &self,
        at: ColumnRowPositions<'_>,
        part: &ColumnRowRange,
        window: SiteWindow,
        max_edge: Option<f64>,
        out: &mut [f64],
    ) -> Result<()> {
        let margin = self.longest(max_edge).map_or(0, |most| reach(&self.frame, most));
        let mut around = vec![SurroundingPoints::new(&self.layers[0].store, window.grown(margin))?];
        let wide = window.grown(self.reach());
        // A layer has no points where the one before it has none.
        for layer in self.layers[1..].iter().take_while(|layer| layer.store.points_near(wide) > 0) {
            around.push(SurroundingPoints::new(&layer.store, wide)?);
        }
        for row in part.rows.clone() {
            let cells =
                || part.cols.clone().map(|col| FixedPosition::from_steps(at.xs[col], at.ys[row]));
            let facets = self.facets(&mut around, cells, max_edge)?;
            let line = &mut out[row * at.xs.len()..][part.cols.clone()];
            for (i, out) in line.iter_mut().enumerate() {
                *out = self.height(|layer| facets.get(layer).and_then(|line| line[i]));
            }
        }
        Ok(())
    }

    /// The longest valid edge of the first layer, if longer ones can be rejected locally.
    fn longest(&self, max_edge: Option<f64>) -> Option<f64> {
        max_edge.filter(|_| self.is_part)
    }

    /// Steps along the longest edge that counts in all but the first layer.
    fn reach(&self) -> i32 {
        let [x, y] = self.scale;
        (self.pits.max_edge() / x.min(y)).ceil() as i32
    }

    /// The facet of each layer at each position.
    fn facets<I: Iterator<Item = FixedPosition>>(
        &self,
        around: &mut [SurroundingPoints<'_>],
        positions: impl Fn() -> I,
        max_edge: Option<f64>,
    ) -> Result<Vec<Vec<Option<PitFreeFacet>>>> {
        let mut all = Vec::new();
        for (i, (layer, around)) in self.layers.iter().zip(around).enumerate() {
            let mut line = Vec::new();
            let most = self.pits.max_edge();
            let is_small = |corners: &[Point; 3]| is_short(corners, self.scale, most);
            let hull = &layer.hull;
            let first = |position, found| {
                let facet = facet(position, found);
                line.push(facet.filter(|facet| self.is_surface(facet, max_edge)));
            };
            let [x, y, _] = self.frame.scale;
            let is_base =
                |corners: &[Point; 3]| max_edge.is_none_or(|most| is_short(corners, [x, y], most));
            match (i, self.longest(max_edge)) {
                (0, None) => around.find_all_small(hull, positions(), is_base, first)?,
                (0, Some(most)) => {
                    let reach = reach(&self.frame, most);
                    around.find_small(hull, positions(), reach, is_base, first)?;
                }
                _ => around.find_small(hull, positions(), self.reach(), is_small, |p, found| {
                    line.push(facet(p, found));
                })?,
            }
            all.push(line);
        }
        Ok(all)
    }

    /// Whether no edge is longer than `max_edge` world units.
    fn is_surface(&self, facet: &PitFreeFacet, max_edge: Option<f64>) -> bool {
        let [x, y, _] = self.frame.scale;
        max_edge.is_none_or(|most| is_short(&facet.corners, [x, y], most))
    }

    fn height(&self, mut facet: impl FnMut(usize) -> Option<PitFreeFacet>) -> f64 {
        let Ok(steps) = self.pits.height(self.scale, |layer| Ok::<_, Infallible>(facet(layer)));
        let world = |steps: f64| steps * self.frame.scale[2] + self.frame.offset[2];
        steps.map_or(f64::NAN, world)
    }
}

/// The facet at a position, with its height.
fn facet(position: FixedPosition, found: Location) -> Option<PitFreeFacet> {
    match found {
        Location::At(point) => Some(PitFreeFacet { corners: [point; 3], z: f64::from(point.z) }),
        Location::Triangle(corners) => {
            Some(PitFreeFacet { corners, z: interpolate(&corners, position) })
        }
        Location::Outside => None,
    }
}

/// Adds points to all stores whose threshold their height above ground reaches.
fn raise(
    first: &PointStore,
    ground: &CloudSurfaces,
    rise: f64,
    pits: &PitFree,
    high: &[PointStore],
    making: &Making<'_>,
) -> Result<()> {
    let squares = first.tiling().count() as u64;
    let lift = |points: &mut Vec<Point>, square: u64| {
        first.load(square as usize, points)?;
        if let Some(window) = making.surface_window() {
            points.retain(|p| window.contains([p.x, p.y]));
        }
        let bins = PointBins::new(points);
        let mut layers = vec![Vec::new(); high.len()];
        ground.under(bins.points(), |point, ground| {
            let above = ground.map_or(0.0, |ground| (f64::from(point.z) - ground) * rise);
            layers.iter_mut().take(pits.layers_of(above) - 1).for_each(|layer| layer.push(*point));
        })?;
        layers.iter().zip(high).try_for_each(|(points, store)| store.add(points))?;
        making.progress.advance(1);
        Ok(())
    };
    making.progress.begin("heights", squares);
    workers::run(making.threads, squares, making.cancel, Vec::new, lift, |_| Ok(()))?;
    making.progress.end();
    Ok(())
}
