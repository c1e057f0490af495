//! The pit-free surface of first returns: one triangulation for each height threshold; the highest one counts
//! at each position.

use std::convert::Infallible;

use super::super::extent::CellRequest;
use super::super::neighbours::{CellCenters, CloudSurfaces};
use super::context::SurfaceModelContext;
use super::filter::spacing;
use super::first_returns::CanopySurface;
use super::lengths::MetricFrame;
use crate::point_index::{
    ColumnRowPositions, ColumnRowRange, MAX_POINTS, PointStore, SurroundingPoints, has_short_edges,
    reach,
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
        at.in_parts(
            MAX_POINTS,
            |window| self.layers.iter().map(|layer| layer.store.points_near(window)).sum(),
            |part, window| self.fill(at, part, window, piece.max_edge, out),
        )
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
        metres: &MetricFrame,
        frame: PointFrame,
        context: &SurfaceModelContext<'_>,
    ) -> Result<Self> {
        let known = context.part.map(|(_, seen)| seen.first);
        let pits = PitFree::metres(known.unwrap_or_else(|| spacing(&[&first], metres)));
        let count = ground.map_or(0, |_| pits.layers() - 1);
        let memory = context.store_memory() / pits.layers() as u64;
        let tiling = *first.tiling();
        let window = context.surface_window();
        let high = (0..count).map(|_| PointStore::empty(tiling, context.folder(), memory));
        let high = high.map(|store| context.limited(store, window, &[]));
        let high: Vec<PointStore> = high.collect::<Result<_>>()?;
        if let Some(ground) = ground {
            raise(&first, ground, metres.step[2], &pits, &high, context)?;
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
        let margin = self.longest(max_edge).map_or(0, |longest| reach(&self.frame, longest));
        let mut around = vec![SurroundingPoints::new(&self.layers[0].store, window.grown(margin))?];
        let wide = window.grown(self.reach());
        // A layer has no points where the one before it has none.
        for layer in self.layers[1..].iter().take_while(|layer| layer.store.points_near(wide) > 0) {
            around.push(SurroundingPoints::new(&layer.store, wide)?);
        }
        for row in part.rows.clone() {
            let cols = part.cols.clone();
            let cells = cols.map(|col| FixedPosition::from_steps(at.xs[col], at.ys[row]));
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
    fn facets(
        &self,
        around: &mut [SurroundingPoints<'_>],
        positions: impl Iterator<Item = FixedPosition> + Clone,
        max_edge: Option<f64>,
    ) -> Result<Vec<Vec<Option<PitFreeFacet>>>> {
        let layers = self.layers.iter().zip(around).enumerate();
        layers
            .map(|(i, (layer, around))| match i {
                0 => self.base_facets(&layer.hull, around, positions.clone(), max_edge),
                _ => self.high_facets(&layer.hull, around, positions.clone()),
            })
            .collect()
    }

    /// The facets of the first layer: none with an edge longer than `max_edge`.
    fn base_facets(
        &self,
        hull: &ConvexHull,
        around: &mut SurroundingPoints<'_>,
        positions: impl Iterator<Item = FixedPosition>,
        max_edge: Option<f64>,
    ) -> Result<Vec<Option<PitFreeFacet>>> {
        let mut facets = Vec::new();
        let is_surface = |corners: &[Point; 3]| has_short_edges(corners, &self.frame, max_edge);
        let take = |position, location| {
            facets.push(facet(position, location).filter(|facet| is_surface(&facet.corners)));
        };
        match self.longest(max_edge) {
            None => around.find_all_small(hull, positions, is_surface, take)?,
            Some(longest) => {
                let reach = reach(&self.frame, longest);
                around.find_small(hull, positions, reach, is_surface, take)?;
            }
        }
        Ok(facets)
    }

    /// The facets of another layer, whose long edges do not count.
    fn high_facets(
        &self,
        hull: &ConvexHull,
        around: &mut SurroundingPoints<'_>,
        positions: impl Iterator<Item = FixedPosition>,
    ) -> Result<Vec<Option<PitFreeFacet>>> {
        let mut facets = Vec::new();
        around.find_small(
            hull,
            positions,
            self.reach(),
            |corners| is_short(corners, self.scale, self.pits.max_edge()),
            |position, location| facets.push(facet(position, location)),
        )?;
        Ok(facets)
    }

    fn height(&self, mut facet: impl FnMut(usize) -> Option<PitFreeFacet>) -> f64 {
        let Ok(steps) = self.pits.height(self.scale, |layer| Ok::<_, Infallible>(facet(layer)));
        steps.map_or(f64::NAN, |steps| steps * self.frame.scale[2] + self.frame.offset[2])
    }
}

/// The facet at a position, with its height.
fn facet(position: FixedPosition, location: Location) -> Option<PitFreeFacet> {
    match location {
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
    context: &SurfaceModelContext<'_>,
) -> Result<()> {
    let squares = first.tiling().count() as u64;
    context.progress.begin("heights", squares);
    workers::run(
        context.threads,
        squares,
        context.cancel,
        Vec::new,
        |points: &mut Vec<Point>, square| {
            first.load(square as usize, points)?;
            if let Some(window) = context.surface_window() {
                points.retain(|p| window.contains([p.x, p.y]));
            }
            raise_points(points, ground, rise, pits, high)?;
            context.progress.advance(1);
            Ok(())
        },
        |_| Ok(()),
    )?;
    context.progress.end();
    Ok(())
}

/// Adds the points of a tile to all stores whose threshold they reach.
fn raise_points(
    points: &[Point],
    ground: &CloudSurfaces,
    rise: f64,
    pits: &PitFree,
    high: &[PointStore],
) -> Result<()> {
    let bins = PointBins::new(points);
    let mut layers = vec![Vec::new(); high.len()];
    ground.under(bins.points(), |point, ground| {
        let above = ground.map_or(0.0, |ground| (f64::from(point.z) - ground) * rise);
        layers.iter_mut().take(pits.layers_of(above) - 1).for_each(|layer| layer.push(*point));
    })?;
    layers.iter().zip(high).try_for_each(|(points, store)| store.add(points))
}
