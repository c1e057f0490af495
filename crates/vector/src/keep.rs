//! A geometry with fewer vertices: parts that collapse go, and their polygons with them.

use super::geometry::{CoordinateSequence, Geometry, GeometryPart, GeometryType};

/// What is to stay of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeptVertices {
    /// All of it, as it is.
    All,
    /// Nothing of it.
    Nothing,
    /// The vertices with these indices, which rise. A ring is closed by its first kept vertex, heights
    /// and measures included; others in that place at its end go. What is left of a line with less
    /// than two vertices (unless it had one only, its first and its last), or of a ring with less than
    /// four (the first again included), is nothing.
    Vertices(Vec<u32>),
}

impl Geometry {
    /// The same geometry with what `choose` keeps of each part. It is called with the index of the
    /// part in [`parts`](Geometry::parts) and the part, in order; points are not asked about and
    /// stay. A polygon whose outer ring is gone goes with its holes (about which `choose` is asked
    /// all the same). What is left of nothing is an empty geometry of the same kind; members of a
    /// collection that have become empty go.
    ///
    /// # Panics
    /// Where an index is beyond the part.
    #[must_use]
    pub fn keep(
        &self,
        mut choose: impl FnMut(usize, GeometryPart<'_>) -> KeptVertices,
    ) -> Geometry {
        self.keep_from(&mut 0, &mut choose)
    }

    // The depth of collections is limited where they are made.
    fn keep_from(
        &self,
        index: &mut usize,
        choose: &mut impl FnMut(usize, GeometryPart<'_>) -> KeptVertices,
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
        choose: &mut impl FnMut(usize, GeometryPart<'_>) -> KeptVertices,
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

    /// Appends what is kept of this geometry's own part `at`.
    fn keep_part(
        &self,
        at: usize,
        kept: &KeptVertices,
        part: GeometryPart<'_>,
        left: &mut CoordinateSequence,
    ) {
        let from = self.coordinates();
        let start = if at == 0 { 0 } else { from.ends[at - 1] };
        match kept {
            KeptVertices::Nothing => {}
            KeptVertices::All => left.extend(from, start..from.ends[at]),
            KeptVertices::Vertices(indices) => {
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

/// What is kept of a ring, up to where it is back at its first vertex for good.
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
    use KeptVertices::{All, Nothing, Vertices};

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
