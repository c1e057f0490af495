//! Overlapping triangles: a flat triangle may be reversed, because parallels are curved and its sides are not;
//! and clients that decode earth-centred coordinates round vertices to a lattice whose step may exceed a
//! triangle. A sample there has several distances.

use crate::globe::{EQUATOR, EastNorthUpFrame, EllipsoidNormal};
use crate::tile_triangle::TileFacet;
use crate::tiling::{GlobeTileId, STEPS, degrees};

/// Smallest vertical component of a triangle's normal, relative to its length, for a triangle that is not
/// reversed.
const SURELY: f64 = 0.02;

/// Triangles by the cells of positions that they touch.
pub(crate) struct FoldedTriangles {
    lists: Vec<Vec<u32>>,
    /// Cells along a side.
    cells: usize,
}

impl TileFacet {
    /// Whether the vertical at a point meets it, from above or below.
    pub(crate) fn is_met(&self, frame: &EastNorthUpFrame) -> bool {
        let sides = self.view_from(frame).parts;
        let is_over =
            sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0);
        is_over && sides.iter().sum::<f64>() != 0.0
    }

    /// Distance of a sample if it is not a plane: at most that from one of its corners.
    pub(crate) fn within(&self, frame: &EastNorthUpFrame, doubt: f64) -> f64 {
        let view = self.view_from(frame);
        let highest = view.corners.iter().fold(0.0_f64, |max, corner| max.max(corner[2].abs()));
        view.off(doubt).min(highest + doubt)
    }

    fn is_turned_over(&self, id: GlobeTileId, at: [[i32; 2]; 3]) -> bool {
        let out = self.corners[0].unit();
        if self.across.dot(out) > SURELY * self.across.length() {
            return false;
        }
        at.into_iter().any(|at| self.across.dot(EllipsoidNormal::at(id.place(at)).normal) <= 0.0)
    }
}

impl FoldedTriangles {
    /// For triangles by number, with corner positions, on a lattice of this many metres (0 for none); `None` if
    /// no triangle is reversed.
    pub(crate) fn of(
        id: GlobeTileId,
        lattice: f64,
        facets: &[TileFacet],
        triangles: impl Iterator<Item = (u32, [[i32; 2]; 3])> + Clone,
    ) -> Option<Self> {
        triangles.clone().find(|(number, at)| facets[*number as usize].is_turned_over(id, *at))?;
        let cells = (facets.len() as f64).sqrt().ceil().max(1.0) as usize;
        let mut folds = Self { lists: vec![Vec::new(); cells * cells], cells };
        let bounds = id.bounds();
        let north = bounds.south.abs().max(bounds.north.abs()).to_radians();
        let angle = degrees(id.level).to_radians() / f64::from(STEPS);
        let step = angle * EQUATOR;
        let margins = [step * north.cos().max(0.01), step].map(|step| 2.0 + 2.0 * lattice / step);
        for (number, at) in triangles {
            let ends = [0, 1].map(|axis: usize| {
                let all = at.map(|at| f64::from(at[axis]));
                all.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
                    [low.min(at), high.max(at)]
                })
            });
            // Steps that a chord is from the parallel through its ends, at 45 degrees, are half of that.
            let bend = (ends[0][1] - ends[0][0]).powi(2) * angle / 8.0;
            let margins = [margins[0], margins[1] + bend];
            let [cols, rows] = [0, 1].map(|axis: usize| {
                let [low, high] = [ends[axis][0] - margins[axis], ends[axis][1] + margins[axis]];
                cell(low, cells)..=cell(high, cells)
            });
            for row in rows {
                cols.clone().for_each(|col| folds.lists[row * cells + col].push(number));
            }
        }
        Some(folds)
    }

    /// Triangles that may lie above or below a position.
    pub(crate) fn near(&self, [u, v]: [f64; 2]) -> &[u32] {
        &self.lists[cell(v, self.cells) * self.cells + cell(u, self.cells)]
    }
}

/// Cell of a number of steps, of this many along a side.
pub(crate) fn cell(at: f64, cells: usize) -> usize {
    (at / f64::from(STEPS + 1) * cells as f64).clamp(0.0, cells as f64 - 1.0) as usize
}
