//! Whether the edges of a finished mesh follow its breaklines: checked vertex by vertex.

use super::counters::MeshFlaws;
use terrane_base::bits::BitSet;
use terrane_base::geom::{Rect, SampleSegment};
use terrane_engine::breaklines::Breaklines;
use terrane_tin::{TileTriangle, goes_on};

/// A sample, counted from the first of a tile: neighbours are as large.
type At = [i16; 2];

/// The triangles around the vertices of a tile that lie on breaklines.
#[derive(Default)]
pub(super) struct BreaklineFans {
    segments: Vec<SampleSegment>,
    /// Samples on their paths.
    on: BitSet,
    rect: Option<Rect>,
    /// Such a vertex, and the other two corners of a triangle there.
    fans: Vec<(At, [At; 2])>,
}

impl BreaklineFans {
    /// Starts with the breaklines in a rectangle.
    pub(super) fn begin(&mut self, lines: &Breaklines, rect: Rect) {
        self.fans.clear();
        self.segments.clear();
        let origin = [rect.col, rect.row].map(i64::from);
        self.segments.extend(lines.paths().near(rect).map(|segment| segment.seen_from(origin)));
        self.rect = (!self.segments.is_empty()).then_some(rect);
        if self.rect.is_some() {
            self.on.reset(rect.len());
        }
        for segment in &self.segments {
            for step in steps(segment, rect) {
                self.on.insert(index(segment.at(step), rect));
            }
        }
    }

    /// Records triangles whose positions are relative to `origin`.
    pub(super) fn add(&mut self, triangles: &[TileTriangle], origin: (u32, u32)) {
        let Some(rect) = self.rect else { return };
        let shift =
            [i64::from(origin.0) - i64::from(rect.col), i64::from(origin.1) - i64::from(rect.row)];
        for triangle in triangles {
            let corners = triangle
                .corners
                .map(|at| [shift[0] + i64::from(at.col()), shift[1] + i64::from(at.row())]);
            for turn in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
                let [a, b, c] = turn.map(|i| corners[i]);
                if holds(rect, a) && self.on.contains(index(a, rect)) {
                    // Positions reach one and a half tiles of at most 8192 cells either way, which 16 bits hold.
                    let [a, b, c] = [a, b, c].map(|at| at.map(|place| place as i16));
                    self.fans.push((a, [b, c]));
                }
            }
        }
    }

    /// Vertices in the rectangle on a line that lack an edge along it.
    pub(super) fn apart(&mut self) -> MeshFlaws {
        let mut apart = MeshFlaws::default();
        let Some(rect) = self.rect else { return apart };
        self.fans.sort_unstable();
        let mut around = Vec::new();
        for segment in &self.segments {
            for step in steps(segment, rect) {
                let at = segment.at(step);
                let key = at.map(|place| place as i16);
                let first = self.fans.partition_point(|fan| fan.0 < key);
                let fan = self.fans[first..].iter().take_while(|fan| fan.0 == key);
                around.clear();
                around.extend(fan.map(|fan| fan.1.map(|at| at.map(i64::from))));
                if goes_on(segment, step, &around) == Some(false) {
                    apart.note(rect.row + at[1] as u32, rect.col + at[0] as u32);
                }
            }
        }
        apart
    }

    /// Most bytes for a tile of `cells` x `cells`.
    pub(super) fn bytes(cells: u32) -> u64 {
        // Six triangles meet at a vertex.
        u64::from(cells + 1).pow(2) * (6 * size_of::<(At, [At; 2])>() as u64 + 1)
    }
}

/// The steps of a path in a tile, from whose first sample its positions are counted.
fn steps(segment: &SampleSegment, rect: Rect) -> impl Iterator<Item = u64> + use<> {
    let high = [rect.width, rect.height].map(|count| i64::from(count) - 1);
    segment.within([0, 0], high).into_iter().flatten()
}

fn holds(rect: Rect, [col, row]: [i64; 2]) -> bool {
    (0..i64::from(rect.width)).contains(&col) && (0..i64::from(rect.height)).contains(&row)
}

fn index([col, row]: [i64; 2], rect: Rect) -> usize {
    row as usize * rect.width as usize + col as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_tin::TilePosition;

    fn triangle(corners: [(u32, u32); 3]) -> TileTriangle {
        let corners = corners.map(|(col, row)| TilePosition::new(col, row));
        TileTriangle { corners, max_error: 0.0, square_sum: 0.0 }
    }

    /// Two triangles of 4 by 2 cells, whose diagonal goes from (4, 0) to (0, 2), in a tile that begins at (10, 20)
    /// with triangles of which some are kept with the tile on its left.
    #[test]
    fn a_line_across_a_triangle_is_told_of() {
        let tile = Rect::new(10, 20, 5, 3);
        let found = |line: [[u32; 2]; 2]| {
            let mut joints = BreaklineFans::default();
            joints.begin(&Breaklines::of(vec![line]), tile);
            joints.add(&[triangle([(0, 0), (4, 0), (0, 2)])], (10, 20));
            joints.add(&[triangle([(12, 0), (12, 2), (8, 2)])], (2, 20));
            joints.apart()
        };
        for followed in [[[10, 20], [14, 20]], [[14, 20], [10, 22]], [[10, 22], [14, 22]]] {
            assert_eq!(found(followed), MeshFlaws::default(), "{followed:?}");
        }
        let across = found([[14, 22], [10, 20]]);
        assert_eq!(across, MeshFlaws { count: 1, first: Some([20, 10]) });
        // An edge beside its path is none along it.
        assert_eq!(found([[10, 20], [14, 21]]).count, 1);
        // What is outside of the tile is told of by another.
        assert_eq!(found([[30, 20], [40, 29]]), MeshFlaws::default());
        let mut joints = BreaklineFans::default();
        joints.begin(&Breaklines::NONE, tile);
        joints.add(&[triangle([(0, 0), (4, 0), (0, 2)])], (10, 20));
        assert_eq!(joints.apart(), MeshFlaws::default());
    }
}
