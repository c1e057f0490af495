//! Simplified geometries: a subset of the vertices, without collapsed parts.

use super::geometry::{CoordinateSequence, Geometry, GeometryPart, GeometryType};

/// The vertices of a part to keep.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RetainedVertices {
    /// The whole part, unchanged.
    All,
    /// No vertex.
    Nothing,
    /// Vertices by ascending index. A ring is closed with its first kept vertex, with height and measure;
    /// further vertices at that position at its end are dropped. Lines with less than two vertices (unless
    /// the input has only one) and rings with less than four (the closing vertex included) collapse and are
    /// dropped.
    Vertices(Vec<u32>),
}

impl Geometry {
    /// The same geometry with the vertices that `choose` keeps of each part. `choose` is called in order with
    /// the index of the part in [`parts`](Geometry::parts); points are always kept. A polygon without its
    /// outer ring is dropped with its holes (`choose` is still called for them). The result of dropping
    /// everything is an empty geometry of the same type; empty members of a collection are dropped.
    ///
    /// # Panics
    /// If an index is out of range.
    #[must_use]
    pub fn keep(
        &self,
        mut choose: impl FnMut(usize, GeometryPart<'_>) -> RetainedVertices,
    ) -> Geometry {
        self.keep_from(&mut 0, &mut choose)
    }

    // The depth of collections is limited by their constructor.
    fn keep_from(
        &self,
        index: &mut usize,
        choose: &mut impl FnMut(usize, GeometryPart<'_>) -> RetainedVertices,
    ) -> Geometry {
        match self.kind() {
            GeometryType::Null | GeometryType::Point | GeometryType::MultiPoint => self.clone(),
            GeometryType::Collection => {
                let members = self.members().iter().map(|member| {
                    let left = member.keep_from(index, choose);
                    (left.is_empty() && !member.is_empty(), left)
                });
                let left = members.filter(|(is_gone, _)| !is_gone).map(|(_, left)| left);
                Geometry::with_members(left.collect())
            }
            GeometryType::LineString | GeometryType::MultiLineString => {
                let mut left = CoordinateSequence::default();
                self.own_parts().enumerate().for_each(|(at, part)| {
                    self.keep_part(at, &choose(*index + at, part), part, &mut left);
                });
                *index += self.coordinates().ends.len();
                Geometry::of_kind(self.kind(), left)
            }
            GeometryType::Polygon | GeometryType::MultiPolygon => {
                Geometry::of_kind(self.kind(), self.keep_rings(index, choose))
            }
        }
    }

    fn keep_rings(
        &self,
        index: &mut usize,
        choose: &mut impl FnMut(usize, GeometryPart<'_>) -> RetainedVertices,
    ) -> CoordinateSequence {
        let mut left = CoordinateSequence::default();
        let mut at = 0;
        for polygon in self.polygons() {
            let first = left.ends.len();
            for (ring, part) in polygon.enumerate() {
                let choice = choose(*index, part);
                if ring == 0 || left.ends.len() > first {
                    self.keep_part(at, &choice, part, &mut left);
                }
                *index += 1;
                at += 1;
            }
            left.end_polygon();
        }
        left
    }

    /// Appends the kept vertices of part `at` of this geometry.
    fn keep_part(
        &self,
        at: usize,
        kept: &RetainedVertices,
        part: GeometryPart<'_>,
        left: &mut CoordinateSequence,
    ) {
        let from = self.coordinates();
        let start = if at == 0 { 0 } else { from.ends[at - 1] };
        match kept {
            RetainedVertices::Nothing => {}
            RetainedVertices::All => left.extend(from, start..from.ends[at]),
            RetainedVertices::Vertices(indices) => {
                assert!(
                    indices.iter().all(|&i| (i as usize) < part.xy.len()),
                    "vertex index out of range"
                );
                let (open, again) = match part.is_ring() {
                    true => (opened(indices, part.xy), indices.first()),
                    false => (&indices[..], None),
                };
                let count = open.len() + usize::from(again.is_some());
                let least = if part.is_ring() { 4 } else { part.xy.len().min(2) };
                if count >= least {
                    let chosen = open.iter().chain(again);
                    left.extend(from, chosen.map(|&i| start + i as usize));
                }
            }
        }
        left.end_part();
    }
}

/// Kept vertices of a ring without the repeated closing vertices.
fn opened<'a>(indices: &'a [u32], xy: &[[f64; 2]]) -> &'a [u32] {
    let mut open = indices;
    while let [first, .., last] = open
        && xy[*first as usize] == xy[*last as usize]
    {
        open = &open[..open.len() - 1];
    }
    open
}

#[cfg(test)]
mod tests {
    use super::*;
    use RetainedVertices::{All, Nothing, Vertices};

    fn coordinates(ends: &[usize], polygons: &[usize]) -> CoordinateSequence {
        let mut found = CoordinateSequence {
            ends: ends.to_vec(),
            polygons: polygons.to_vec(),
            ..CoordinateSequence::default()
        };
        let mut start = 0;
        for &end in ends {
            for i in start..end {
                let at = if i + 1 == end && !polygons.is_empty() { start } else { i };
                found.push([at as f64, -(at as f64)], Some(at as f64 + 0.5), Some(at as f64 * 2.0));
            }
            start = end;
        }
        found
    }

    fn lines() -> Geometry {
        Geometry::new(GeometryType::MultiLineString, coordinates(&[3, 5, 9], &[])).unwrap()
    }

    fn polygons() -> Geometry {
        Geometry::new(GeometryType::MultiPolygon, coordinates(&[5, 9, 14, 20], &[2, 3, 4])).unwrap()
    }

    fn xs(geometry: &Geometry) -> Vec<Vec<f64>> {
        geometry.parts().map(|part| part.xy.iter().map(|p| p[0]).collect()).collect()
    }

    #[test]
    fn lines_keep_what_is_chosen_with_heights_and_measures() {
        let kept = lines().keep(|index, part| {
            assert_eq!(part.xy.len(), [3, 2, 4][index]);
            [Vertices(vec![0, 2]), Vertices(vec![1]), All][index].clone()
        });
        assert_eq!(xs(&kept), [vec![0.0, 2.0], vec![5.0, 6.0, 7.0, 8.0]]);
        let second = kept.parts().nth(1).unwrap();
        assert_eq!(
            (second.z, second.m),
            (&[5.5, 6.5, 7.5, 8.5][..], &[10.0, 12.0, 14.0, 16.0][..])
        );
        let none = lines().keep(|_, _| Nothing);
        assert_eq!((none.kind(), none.is_empty()), (GeometryType::MultiLineString, true));
        assert_eq!(lines().keep(|_, _| All), lines());
    }

    #[test]
    fn rings_stay_closed_wherever_they_begin() {
        let kept = polygons().keep(|index, part| match index {
            0 => Vertices(vec![1, 2, 3]),
            3 => Vertices(vec![0, 2, 3, 5]),
            _ => {
                assert!(part.is_ring());
                Nothing
            }
        });
        assert_eq!(xs(&kept), [vec![1.0, 2.0, 3.0, 1.0], vec![14.0, 16.0, 17.0, 14.0]]);
        assert_eq!(kept.coordinates().polygons, [1, 2]);
    }

    #[test]
    fn holes_go_with_their_outer_ring() {
        let mut asked = 0;
        let kept = polygons().keep(|index, _| {
            asked += 1;
            if index == 0 { Vertices(vec![0, 1, 4]) } else { All }
        });
        assert_eq!(asked, 4);
        assert_eq!(xs(&kept).iter().map(Vec::len).collect::<Vec<_>>(), [5, 6]);
        let kept = polygons().keep(|index, _| if index == 1 { Nothing } else { All });
        assert_eq!(kept.coordinates().polygons, [1, 2, 3]);
    }

    #[test]
    fn members_that_become_empty_go_and_points_stay() {
        let point =
            Geometry::new(GeometryType::Point, CoordinateSequence::of(vec![[1.0, 2.0]])).unwrap();
        let empty = Geometry::line(Vec::new());
        let inner = Geometry::collection(vec![point.clone(), lines(), empty.clone()]).unwrap();
        let outer = Geometry::collection(vec![inner, polygons(), point.clone()]).unwrap();
        let mut asked = Vec::new();
        let kept = outer.keep(|index, _| {
            asked.push(index);
            Nothing
        });
        assert_eq!(asked, [0, 1, 2, 3, 4, 5, 6]);
        let inner = Geometry::collection(vec![point.clone(), empty]).unwrap();
        assert_eq!(kept, Geometry::collection(vec![inner, point]).unwrap());
    }
}
