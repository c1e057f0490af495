//! Results of features, assembled from the bits of their tiles when the features are read again.

use std::collections::BTreeSet;

use super::kept_bits::{RetainedBits, RetainedBitsReader};
use super::own_ring;
use super::trial::SimplifiedSource;
use crate::feature::chosen;
use terrane_base::error::Result;
use terrane_base::geom::plane::key;
use terrane_line::Xy;
use terrane_line::tiles::{LastTile, TileRun, VertexQuadtree, cut};
use terrane_line::topology::RingCollapse;
use terrane_vector::{self as vector, Feature, GeometryPart, PartRole};

/// Part numbers.
pub(super) type Parts = BTreeSet<u64>;

/// Results of all tiles; computed twice if rings have changed orientation.
#[derive(Clone, Copy)]
pub(super) struct FinishedTiles<'a> {
    pub(super) quadtree: &'a VertexQuadtree,
    /// Parts that stay whole.
    pub(super) whole: &'a Parts,
    /// Kept vertices.
    pub(super) kept: &'a RetainedBits,
    /// Rounded vertices, if rounding applies.
    pub(super) rounded: Option<&'a RetainedBits>,
}

/// Parts cut into runs, one after the other.
pub(super) struct RunCutting<'a> {
    quadtree: &'a VertexQuadtree,
    place: LastTile,
    pub(super) runs: Vec<TileRun>,
    /// Number of parts so far.
    pub(super) number: u64,
}

impl<'a> RunCutting<'a> {
    pub(super) fn new(quadtree: &'a VertexQuadtree) -> Self {
        Self { quadtree, place: LastTile::default(), runs: Vec::new(), number: 0 }
    }

    /// Fills the runs with those of the next part; returns its number.
    pub(super) fn cut(&mut self, part: &GeometryPart<'_>) -> u64 {
        cut(part.xy, part.is_ring(), self.quadtree, &mut self.place, &mut self.runs);
        self.number += 1;
        self.number - 1
    }
}

/// Results of features, one after the other.
pub(super) struct AssembledFeatures<'a> {
    pub(super) parts: RunCutting<'a>,
    whole: &'a Parts,
    kept: RetainedBitsReader<'a>,
    rounded: Option<(RetainedBitsReader<'a>, u8)>,
    collapse: RingCollapse,
    indices: Vec<u32>,
    /// The last outer ring, if it is dropped.
    gone: Option<u64>,
    /// Parts that have to stay whole but were simplified.
    pub(super) turned: Parts,
    pub(super) features: u64,
    pub(super) vertices: u64,
}

impl<'a> AssembledFeatures<'a> {
    pub(super) fn new(
        now: FinishedTiles<'a>,
        collapse: RingCollapse,
        decimals: Option<u8>,
    ) -> Self {
        Self {
            parts: RunCutting::new(now.quadtree),
            whole: now.whole,
            kept: now.kept.reader(),
            rounded: now.rounded.map(RetainedBits::reader).zip(decimals),
            collapse,
            indices: Vec::new(),
            gone: None,
            turned: Parts::new(),
            features: 0,
            vertices: 0,
        }
    }

    fn part(&mut self, part: &GeometryPart<'_>) -> Result<vector::RetainedVertices> {
        let number = self.parts.cut(part);
        let is_cut = self.parts.runs.len() > 1;
        let count = part.xy.len() - usize::from(is_cut && part.is_ring());
        self.kept.part(&self.parts.runs, count, &mut self.indices)?;
        let is_whole = self.whole.contains(&number);
        let kept = match part.is_ring() {
            true if is_whole || self.indices.len() == part.xy.len() => {
                Some(vector::RetainedVertices::All)
            }
            true if is_cut => own_ring::ring(part.xy, &self.indices, self.collapse),
            _ => Some(chosen(&self.indices)),
        };
        if kept.is_none() {
            self.turned.insert(number);
        }
        let kept = kept.unwrap_or(vector::RetainedVertices::All);
        self.note_outer(part.role, number, kept == vector::RetainedVertices::Nothing);
        Ok(kept)
    }

    /// Appends the rounded positions of the last cut part; all vertices at a position are rounded.
    fn rounded(&mut self, part: &GeometryPart<'_>, positions: &mut Vec<[u64; 2]>) -> Result<()> {
        let Some((rounded, _)) = &mut self.rounded else { return Ok(()) };
        let count = part.xy.len() - usize::from(self.parts.runs.len() > 1 && part.is_ring());
        rounded.part(&self.parts.runs, count, &mut self.indices)?;
        positions.extend(self.indices.iter().map(|at| key(part.xy[*at as usize])));
        Ok(())
    }

    /// Keeps an outer ring whole if a hole of it remains (a hole outside its outer ring may): a polygon without
    /// an outer ring is invalid.
    fn note_outer(&mut self, role: PartRole, number: u64, is_gone: bool) {
        match (role, self.gone) {
            (PartRole::Hole, Some(outer)) if !is_gone => {
                self.turned.insert(outer);
            }
            (PartRole::Hole, _) => {}
            _ => self.gone = is_gone.then_some(number),
        }
    }
}

impl SimplifiedSource for AssembledFeatures<'_> {
    fn of(&mut self, feature: &Feature) -> Result<vector::Geometry> {
        let (mut choices, mut rounded) = (Vec::new(), Vec::new());
        for part in feature.geometry.parts() {
            choices.push(self.part(&part)?);
            self.rounded(&part, &mut rounded)?;
        }
        let mut choices = choices.into_iter();
        let mut geometry =
            feature.geometry.keep(|_, _| choices.next().unwrap_or(vector::RetainedVertices::All));
        if let Some((_, decimals)) = self.rounded {
            rounded.sort_unstable();
            let positions = geometry.parts().flat_map(|part| part.xy);
            let positions = positions.map(|at| match rounded.binary_search(&key(*at)) {
                Ok(_) => at.map(|c| vector::rounded(c, decimals)),
                Err(_) => *at,
            });
            let positions: Vec<Xy> = positions.collect();
            geometry.place_parts(&mut positions.into_iter());
        }
        self.features += 1;
        self.vertices += geometry.parts().map(|part| part.xy.len() as u64).sum::<u64>();
        Ok(geometry)
    }

    fn may_appear(&self) -> bool {
        self.turned.is_empty()
    }
}
