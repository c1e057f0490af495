//! Interpolation of heights on a mesh.

use std::cmp::Ordering;
use std::ops::RangeInclusive;
use std::sync::Arc;

use terrane_base::geom::plane::orient;
use terrane_terrain::tin::Tin;

/// Spatial index for heights of a [`Tin`] at any position: triangles by the cells of a coarse grid that their
/// bounding boxes touch. About 20 bytes per triangle; construction is linear in the triangles.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// let slope: Vec<f32> = (0..20 * 10).map(|i| (i % 20) as f32 * 2.0).collect();
/// let tin = terrane::Tin::from_array(&slope, 20, 10)?.max_error(0.0).build()?;
/// let surface = terrane::Surface::new(tin);
/// assert_eq!(surface.height(3.25, -4.5), Some(6.5));
/// assert_eq!(surface.height(3.25, 4.5), None, "beyond its border");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Surface {
    tin: Arc<Tin>,
    low: [f64; 2],
    cell: [f64; 2],
    size: [usize; 2],
    /// Start of each cell's triangles in `listed`, and the end of the last.
    starts: Vec<usize>,
    listed: Vec<u32>,
}

impl Surface {
    /// The surface of a mesh.
    pub fn new(tin: impl Into<Arc<Tin>>) -> Self {
        let tin = tin.into();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for vertex in tin.vertices() {
            for axis in 0..2 {
                (low[axis], high[axis]) =
                    (low[axis].min(vertex[axis]), high[axis].max(vertex[axis]));
            }
        }
        let sides = [0, 1].map(|axis| (high[axis] - low[axis]).max(0.0));
        // Two triangles per cell, with the proportions of the mesh.
        let cells = (tin.triangles().len() / 2).max(1) as f64;
        let across = (cells * sides[0] / sides[1]).sqrt().clamp(1.0, cells);
        let across = if across.is_nan() { 1.0 } else { across };
        let size = [across, cells / across].map(|count| count.ceil().max(1.0) as usize);
        let cell = [0, 1].map(|axis| sides[axis] / size[axis] as f64);
        let empty = Self { tin, low, cell, size, starts: Vec::new(), listed: Vec::new() };
        empty.filled()
    }

    fn filled(mut self) -> Self {
        let mut starts = vec![0; self.size[0] * self.size[1] + 1];
        // Two passes: counts give the starts of all lists in one array.
        for cell in self.tin.triangles().iter().flat_map(|triangle| self.cells_of(triangle)) {
            starts[cell + 1] += 1;
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let (mut next, mut listed) = (starts.clone(), vec![0; starts[starts.len() - 1]]);
        for (number, triangle) in (0..).zip(self.tin.triangles()) {
            for cell in self.cells_of(triangle) {
                listed[next[cell]] = number;
                next[cell] += 1;
            }
        }
        (self.starts, self.listed) = (starts, listed);
        self
    }

    /// The mesh.
    pub fn tin(&self) -> &Arc<Tin> {
        &self.tin
    }

    /// Height of the mesh at a position; `None` outside the mesh. At a vertex it is the vertex height; on an
    /// edge, that of the first of its triangles. Tests a few triangles.
    pub fn height(&self, x: f64, y: f64) -> Option<f64> {
        let [col, row] = self.cell_at([x, y])?;
        let cell = row * self.size[0] + col;
        let listed = &self.listed[self.starts[cell]..self.starts[cell + 1]];
        listed.iter().find_map(|number| {
            height_in(self.corners(&self.tin.triangles()[*number as usize]), [x, y])
        })
    }

    /// The same for many positions; NaN outside the mesh.
    pub fn heights(&self, places: &[[f64; 2]]) -> Vec<f64> {
        places.iter().map(|[x, y]| self.height(*x, *y).unwrap_or(f64::NAN)).collect()
    }

    fn corners(&self, triangle: &[u32; 3]) -> [[f64; 3]; 3] {
        triangle.map(|corner| self.tin.vertices()[corner as usize])
    }

    /// Cell of a position within the bounds of the mesh.
    fn cell_at(&self, place: [f64; 2]) -> Option<[usize; 2]> {
        Some([self.index_at(0, place[0])?, self.index_at(1, place[1])?])
    }

    /// Column (axis 0) or row (axis 1) of a coordinate.
    #[inline]
    fn index_at(&self, axis: usize, coordinate: f64) -> Option<usize> {
        let cells = (coordinate - self.low[axis]) / self.cell[axis];
        // Cells of a mesh without triangles have no size.
        let inside = cells >= 0.0 && cells <= self.size[axis] as f64 * (1.0 + f64::EPSILON);
        inside.then(|| (cells as usize).min(self.size[axis] - 1))
    }

    /// Cells that the bounding box of a triangle touches. Positions use the same monotone arithmetic, so a
    /// position in the box is in one of these cells.
    fn cells_of(&self, triangle: &[u32; 3]) -> impl Iterator<Item = usize> + use<> {
        let corners = self.corners(triangle);
        let [cols, rows] = [0, 1].map(|axis| self.range(axis, corners.map(|corner| corner[axis])));
        let width = self.size[0];
        rows.flat_map(move |row| cols.clone().map(move |col| row * width + col))
    }

    /// Columns or rows from the lowest to the highest of three coordinates.
    fn range(&self, axis: usize, coordinates: [f64; 3]) -> RangeInclusive<usize> {
        let [a, b, c] = coordinates.map(|value| (value - self.low[axis]) / self.cell[axis]);
        let [low, high] = [a.min(b).min(c), a.max(b).max(c)]
            .map(|cells| (cells.max(0.0) as usize).min(self.size[axis] - 1));
        low..=high
    }
}

/// Height of a counter-clockwise triangle at a position in it or on its border.
fn height_in(corners: [[f64; 3]; 3], place: [f64; 2]) -> Option<f64> {
    let [a, b, c] = corners.map(|[x, y, _]| [x, y]);
    if [(a, b), (b, c), (c, a)].iter().any(|(p, q)| orient(*p, *q, place) == Ordering::Less) {
        return None;
    }
    let [ab, ac, ap] = [b, c, place].map(|point| [point[0] - a[0], point[1] - a[1]]);
    let area = cross(ab, ac);
    let (of_b, of_c) = (cross(ap, ac) / area, cross(ab, ap) / area);
    let weights = [1.0 - of_b - of_c, of_b, of_c];
    // From the corner with the largest weight: exact at corners, and where all heights are equal.
    let nearest = match weights[0] >= weights[1].max(weights[2]) {
        true => 0,
        false => 1 + usize::from(weights[2] > weights[1]),
    };
    let base = corners[nearest][2];
    let [next, last] = [(nearest + 1) % 3, (nearest + 2) % 3]
        .map(|corner| (corners[corner][2] - base) * weights[corner]);
    Some(base + (next + last))
}

#[inline]
fn cross(u: [f64; 2], v: [f64; 2]) -> f64 {
    u[0] * v[1] - u[1] * v[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Result;
    use crate::prelude::*;
    use proptest::prelude::*;

    /// A mesh of random heights with holes, turned and far from the origin.
    fn tin(heights: &[f32], width: u32, height: u32, turned: bool) -> Result<Tin> {
        let (a, b) = if turned { (0.7, -0.3) } else { (2.0, 0.0) };
        let to_world = crate::Affine { x0: 5e5, a, b, y0: 4e6, d: b, e: -a };
        Tin::from_array(heights, width, height)?
            .place(to_world, crate::Crs::default())
            .max_error(1.0)
            .build()
    }

    proptest! {
        /// The same as all triangles asked one by one.
        #[test]
        fn heights_are_those_of_the_first_triangle_that_holds_a_place(
            (width, heights) in (3_u32..14, 3_u32..14).prop_flat_map(|(width, height)| {
                let void = prop_oneof![9 => -4.0_f32..4.0, 1 => Just(f32::NAN)];
                (Just(width), prop::collection::vec(void, (width * height) as usize))
            }),
            turned in any::<bool>(),
            places in prop::collection::vec((-2.0_f64..16.0, -2.0_f64..16.0, any::<bool>()), 30),
        ) {
            let Ok(tin) = tin(&heights, width, heights.len() as u32 / width, turned) else { return Ok(()) };
            let surface = Surface::new(tin);
            let to_world = |col: f64, row: f64| match turned {
                true => [5e5 + 0.7 * col - 0.3 * row, 4e6 - 0.3 * col - 0.7 * row],
                false => [5e5 + 2.0 * col, 4e6 - 2.0 * row],
            };
            for (col, row, on_sample) in places {
                let [x, y] = if on_sample { to_world(col.round(), row.round()) } else { to_world(col, row) };
                let tin = surface.tin();
                let slow = tin.triangles().iter().find_map(|triangle| {
                    height_in(triangle.map(|corner| tin.vertices()[corner as usize]), [x, y])
                });
                prop_assert_eq!(surface.height(x, y), slow, "{}, {}", x, y);
            }
            let level = [[0.0, 0.1], [3.7, 0.3], [1.1, 2.9]].map(|[x, y]| [x, y, -179.658_218_38]);
            prop_assert_eq!(height_in(level, [1.3, 0.77]), Some(-179.658_218_38));
            for vertex in surface.tin().vertices() {
                prop_assert_eq!(surface.height(vertex[0], vertex[1]), Some(vertex[2]));
            }
        }
    }
}
