//! Groups unordered rings into polygons with holes.

use super::geometry::{CoordinateSequence, Geometry, GeometryType};
use super::tree::{Bounds, NOTHING, PackedRTree, around, hilbert_order};
use terrane_base::error::{Error, Result};

/// Limit of edges and rectangles examined to find the nesting of rings: some seconds.
const MAX_VISITED: u64 = 1 << 30;
/// Largest relative difference of the areas of identical rings with different start vertices.
const ROUNDING: f64 = 1e-9;
/// Number of edges from which a ring gets its own tree, so that a point is tested only against edges at its
/// height.
const LARGE: usize = 64;

/// Groups rings into polygons: clockwise rings are outer rings, the others are holes of the smallest outer
/// ring around them. A clockwise ring directly inside another outer ring, without a hole between them, is a
/// hole with reversed orientation. If a hole is in no outer ring, orientation is ignored, and a ring inside
/// an odd number of rings is a hole. One polygon gives a Polygon, several give a MultiPolygon. O(n log n) for
/// disjoint rings.
///
/// # Errors
/// Rings too complex to group within the limit.
pub(super) fn group(coordinates: CoordinateSequence) -> Result<Geometry> {
    if coordinates.ends.len() <= 1 {
        return Geometry::new(GeometryType::Polygon, coordinates);
    }
    let mut rings = NestedRings::new(&coordinates);
    let is_outer = rings.outer()?;
    let owners = match rings.owners(&is_outer)? {
        Some(owners) => owners,
        None => rings.by_nesting()?,
    };
    Ok(arranged(&coordinates, &owners))
}

/// Rings with their search structures.
struct NestedRings<'a> {
    coordinates: &'a CoordinateSequence,
    /// Twice the area, negative where the ring is clockwise.
    areas: Vec<f64>,
    bounds: Vec<Bounds>,
    /// Tree of all rings in the order of a space-filling curve.
    tree: PackedRTree,
    order: Vec<u32>,
    /// Trees of the edges of large rings, by height; built on first use.
    edges: Vec<Option<PackedRTree>>,
    /// Scratch: edges at the height of a point.
    found: Vec<u32>,
    visited: u64,
}

impl<'a> NestedRings<'a> {
    fn new(coordinates: &'a CoordinateSequence) -> Self {
        let all = 0..coordinates.ends.len();
        let rings = all.map(|at| ring(coordinates, at));
        let areas = rings.clone().map(area).collect();
        let bounds: Vec<Bounds> = rings.map(bounds).collect();
        let extent = bounds.iter().fold(NOTHING, |all, one| around(&all, one));
        let order = hilbert_order(&bounds, &extent);
        let tree =
            PackedRTree::new(&order.iter().map(|&at| bounds[at as usize]).collect::<Vec<_>>());
        let edges = bounds.iter().map(|_| None).collect();
        Self { coordinates, areas, bounds, tree, order, edges, found: Vec::new(), visited: 0 }
    }

    /// Which rings are outer rings: clockwise ones except holes with reversed orientation.
    fn outer(&mut self) -> Result<Vec<bool>> {
        let mut is_outer: Vec<bool> = self.areas.iter().map(|&area| area <= 0.0).collect();
        let mut outers: Vec<usize> = (0..is_outer.len()).filter(|&at| is_outer[at]).collect();
        if outers.len() < 2 {
            return Ok(is_outer);
        }
        // The largest first: whether a ring is a hole depends on the last word about the one around it.
        outers.sort_by(|&a, &b| self.areas[b].abs().total_cmp(&self.areas[a].abs()));
        for at in outers {
            let (_, around) = self.around(at, |_| true)?;
            if let Some(around) = around.filter(|&around| is_outer[around]) {
                is_outer[at] = !self.is_wholly_inside(at, around)?;
            }
        }
        Ok(is_outer)
    }

    /// True if no vertex of ring `inner` is outside ring `outer`, which is larger.
    fn is_wholly_inside(&mut self, inner: usize, outer: usize) -> Result<bool> {
        if self.is_twin(inner, outer) {
            return Ok(false);
        }
        for vertex in ring(self.coordinates, inner) {
            if self.contains(outer, vertex)? == Some(false) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The outer ring of each ring (its own index for outer rings); `None` for a hole in no outer ring.
    fn owners(&mut self, is_outer: &[bool]) -> Result<Option<Vec<usize>>> {
        let mut owners: Vec<usize> = (0..is_outer.len()).collect();
        let outers = is_outer.iter().filter(|outer| **outer).count();
        let only = is_outer.iter().position(|outer| *outer).filter(|_| outers == 1);
        for hole in (0..is_outer.len()).filter(|&at| !is_outer[at]) {
            let owner = match only {
                Some(only) => Some(only),
                None => self.around(hole, |at| is_outer[at])?.1,
            };
            let Some(owner) = owner else { return Ok(None) };
            owners[hole] = owner;
        }
        Ok(Some(owners))
    }

    /// As [`owners`](Self::owners), by nesting depth.
    fn by_nesting(&mut self) -> Result<Vec<usize>> {
        let mut owners = Vec::with_capacity(self.areas.len());
        for at in 0..self.areas.len() {
            let (count, smallest) = self.around(at, |_| true)?;
            owners.push(smallest.filter(|_| count % 2 == 1).unwrap_or(at));
        }
        // The smallest ring around a hole may not be an outer ring, if rings cross.
        let is_outer: Vec<bool> = owners.iter().enumerate().map(|(at, &own)| own == at).collect();
        let settled = owners.iter().enumerate();
        Ok(settled.map(|(at, &owner)| if is_outer[owner] { owner } else { at }).collect())
    }

    /// Number of rings among those in `counts` that contain ring `inner`, and the smallest of them.
    fn around(
        &mut self,
        inner: usize,
        counts: impl Fn(usize) -> bool,
    ) -> Result<(usize, Option<usize>)> {
        let mut found = Vec::new();
        let visited = self.tree.containing(&self.bounds[inner], &mut found);
        self.count_visited(visited)?;
        found.iter_mut().for_each(|at| *at = self.order[*at as usize]);
        // Of rings of one size the first in the file counts, whatever order the tree finds them in.
        found.sort_unstable();
        let (mut count, mut smallest) = (0, None);
        for outer in found.into_iter().map(|at| at as usize) {
            if outer == inner || !counts(outer) || !self.is_inside(inner, outer)? {
                continue;
            }
            count += 1;
            let size = self.areas[outer].abs();
            if smallest.is_none_or(|known: usize| size < self.areas[known].abs()) {
                smallest = Some(outer);
            }
        }
        Ok((count, smallest))
    }

    /// Whether a ring contains a point; `None` on its boundary. O(log n + edges at the height of the point)
    /// for large rings.
    fn contains(&mut self, at: usize, place: &[f64; 2]) -> Result<Option<bool>> {
        let ring = ring(self.coordinates, at);
        if ring.len() < LARGE {
            self.count_visited(ring.len())?;
            return Ok(contains(ring.windows(2), place));
        }
        let tree = self.edges[at].get_or_insert_with(|| heights(ring));
        let visited = tree.containing(&[0.0, place[1], 0.0, place[1]], &mut self.found);
        let edges = self.found.iter().map(|&edge| &ring[edge as usize..edge as usize + 2]);
        let is_inside = contains(edges, place);
        self.count_visited(visited)?;
        Ok(is_inside)
    }

    /// Counts examined edges or rectangles against the limit.
    fn count_visited(&mut self, count: usize) -> Result<()> {
        self.visited += count as u64;
        if self.visited <= MAX_VISITED {
            return Ok(());
        }
        Err(Error::bad_input("rings are too complex to distinguish holes from islands")
            .remedy("repair the geometry, or write GeoJSON"))
    }

    /// Whether ring `inner` is inside ring `outer`, decided by its first vertex that is not on the boundary.
    /// For identical rings see [`is_twin`](Self::is_twin).
    fn is_inside(&mut self, inner: usize, outer: usize) -> Result<bool> {
        let is_twin = self.is_twin(inner, outer);
        if self.areas[inner].abs() > self.areas[outer].abs() && !is_twin {
            return Ok(false);
        }
        for vertex in ring(self.coordinates, inner) {
            if let Some(is_inside) = self.contains(outer, vertex)? {
                return Ok(is_inside);
            }
        }
        if !is_twin {
            return Ok(true);
        }
        // A ring that fills a hole is inside it; of two with equal orientation, it is the first.
        let [fills, filled] = [inner, outer].map(|at| self.areas[at] <= 0.0);
        Ok(if fills == filled { inner < outer } else { fills })
    }

    /// Whether two rings are identical except for their start vertex.
    fn is_twin(&self, one: usize, other: usize) -> bool {
        let [a, b] = [one, other].map(|at| self.areas[at].abs());
        // The sum of an area is rounded otherwise where a ring begins at another vertex.
        (a - b).abs() <= ROUNDING * a.max(b) && self.bounds[one] == self.bounds[other]
    }
}

/// The polygons, in the order of their outer rings.
fn arranged(from: &CoordinateSequence, owners: &[usize]) -> Geometry {
    let mut order: Vec<(usize, bool, usize)> =
        owners.iter().enumerate().map(|(at, &owner)| (owner, at != owner, at)).collect();
    order.sort_unstable();
    let mut to = CoordinateSequence::default();
    for &(_, is_hole, at) in &order {
        if !is_hole {
            to.end_polygon();
        }
        let start = if at == 0 { 0 } else { from.ends[at - 1] };
        to.extend(from, start..from.ends[at]);
        to.end_part();
    }
    to.end_polygon();
    let kind =
        if to.polygons.len() == 1 { GeometryType::Polygon } else { GeometryType::MultiPolygon };
    Geometry::of_kind(kind, to)
}

fn ring(coordinates: &CoordinateSequence, at: usize) -> &[[f64; 2]] {
    let start = if at == 0 { 0 } else { coordinates.ends[at - 1] };
    &coordinates.xy[start..coordinates.ends[at]]
}

/// Twice the signed area, negative for clockwise rings (y up). Coordinates are relative to the first vertex
/// for precision.
pub(super) fn area(ring: &[[f64; 2]]) -> f64 {
    let Some(&[x, y]) = ring.first() else { return 0.0 };
    let crosses = ring
        .windows(2)
        .map(|pair| (pair[0][0] - x) * (pair[1][1] - y) - (pair[1][0] - x) * (pair[0][1] - y));
    crosses.sum()
}

fn bounds(ring: &[[f64; 2]]) -> Bounds {
    ring.iter().fold(NOTHING, |all, &[x, y]| around(&all, &[x, y, x, y]))
}

/// A tree of the edges of a ring by height.
fn heights(ring: &[[f64; 2]]) -> PackedRTree {
    let heights = ring.windows(2).map(|pair| {
        let [[_, a], [_, b]] = [pair[0], pair[1]];
        [f64::NEG_INFINITY, a.min(b), f64::INFINITY, a.max(b)]
    });
    PackedRTree::new(&heights.collect::<Vec<Bounds>>())
}

/// Whether a closed ring contains a point, from the edges at its height (and any others); `None` on the
/// boundary.
fn contains<'a>(edges: impl Iterator<Item = &'a [[f64; 2]]>, &[x, y]: &[f64; 2]) -> Option<bool> {
    let mut is_inside = false;
    for pair in edges {
        let ([ax, ay], [bx, by]) = (pair[0], pair[1]);
        if ay.min(by) > y || ay.max(by) < y {
            continue;
        }
        let cross = (bx - ax) * (y - ay) - (x - ax) * (by - ay);
        // The height is within the edge's already; a level edge needs the range of x as well.
        if cross == 0.0 && ax.min(bx) <= x && x <= ax.max(bx) {
            return None;
        }
        // An edge includes its lower end and excludes its upper end.
        if (ay > y) != (by > y) && (cross > 0.0) == (by > ay) {
            is_inside = !is_inside;
        }
    }
    Some(is_inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A square around the middle, clockwise or not.
    fn square(to: &mut CoordinateSequence, [x, y]: [f64; 2], reach: f64, clockwise: bool) {
        let mut corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]];
        if clockwise {
            corners.reverse();
        }
        corners.iter().for_each(|[u, v]| to.push([x + u * reach, y + v * reach], None, None));
        to.end_part();
    }

    fn polygons(squares: &[([f64; 2], f64, bool)]) -> Vec<Vec<f64>> {
        let mut all = CoordinateSequence::default();
        squares.iter().for_each(|&(at, reach, clockwise)| square(&mut all, at, reach, clockwise));
        let grouped = group(all).unwrap();
        let reach = |xy: &[[f64; 2]]| (bounds(xy)[2] - bounds(xy)[0]) / 2.0;
        grouped.polygons().map(|rings| rings.map(|part| reach(part.xy)).collect()).collect()
    }

    #[test]
    fn holes_go_to_the_smallest_outer_ring_around_them() {
        let o = [0.0, 0.0];
        let found = polygons(&[(o, 1.0, false), (o, 8.0, true), (o, 2.0, true), (o, 4.0, false)]);
        assert_eq!(found, [vec![8.0, 4.0], vec![2.0, 1.0]]);
        let found = polygons(&[([9.0, 0.0], 2.0, true), (o, 3.0, true), ([9.5, 0.0], 1.0, false)]);
        assert_eq!(found, [vec![2.0, 1.0], vec![3.0]]);
    }

    #[test]
    fn wrong_orientations_are_found_out() {
        let o = [0.0, 0.0];
        let found = polygons(&[(o, 8.0, false), (o, 4.0, true), (o, 2.0, false), (o, 1.0, true)]);
        assert_eq!(found, [vec![8.0, 4.0], vec![2.0, 1.0]]);
        assert_eq!(polygons(&[(o, 8.0, false), (o, 4.0, false)]), [[8.0, 4.0]]);
        assert_eq!(polygons(&[(o, 1.0, false), ([5.0, 5.0], 2.0, false)]), [[1.0], [2.0]]);
    }

    #[test]
    fn holes_that_go_the_wrong_way_are_found_by_where_they_lie() {
        let o = [0.0, 0.0];
        assert_eq!(polygons(&[(o, 8.0, true), (o, 4.0, true)]), [[8.0, 4.0]]);
        let found = polygons(&[(o, 2.0, true), (o, 8.0, true), (o, 4.0, true)]);
        assert_eq!(found, [vec![2.0], vec![8.0, 4.0]]);
        // What overlaps, or is there twice, is no hole.
        assert_eq!(polygons(&[(o, 4.0, true), ([5.0, 0.0], 3.0, true)]), [[4.0], [3.0]]);
        assert_eq!(polygons(&[(o, 4.0, true), (o, 4.0, true)]), [[4.0], [4.0]]);
    }

    /// A ring that fills a hole is an island in it, wherever it begins and in whatever order they come.
    #[test]
    fn a_hole_that_is_filled_holds_an_island() {
        for (order, first, from) in orders_and_starts() {
            let mut rings = vec![(8.0, true, 0), (4.0, false, 0), (4.0, true, first)];
            let last = rings.remove(order % 3);
            rings.rotate_left(order / 3);
            rings.push(last);
            let mut all = CoordinateSequence::default();
            for (reach, clockwise, first) in rings {
                let mut one = CoordinateSequence::default();
                square(&mut one, from, reach, clockwise);
                (0..5).for_each(|k| all.push(one.xy[(first + k) % 4], None, None));
                all.end_part();
            }
            let grouped = group(all).unwrap();
            let size = |xy: &[[f64; 2]]| (area(xy).abs() / 2.0).round();
            let mut found: Vec<Vec<f64>> =
                grouped.polygons().map(|rings| rings.map(|part| size(part.xy)).collect()).collect();
            found.sort_by_key(|rings| std::cmp::Reverse(rings.len()));
            assert_eq!(found, [vec![256.0, 64.0], vec![64.0]], "{order} {first} {from:?}");
        }
    }

    /// Orders of three rings, corners of four to begin with, and places.
    fn orders_and_starts() -> impl Iterator<Item = (usize, usize, [f64; 2])> {
        let places = [[0.0, 0.0], [1e6 / 3.0, 5e6 / 7.0]];
        (0..48).map(move |k| (k % 6, k / 6 % 4, places[k / 24]))
    }

    #[test]
    fn a_hole_may_touch_its_outer_ring() {
        let found = polygons(&[
            ([0.0, 0.0], 4.0, true),
            ([20.0, 0.0], 4.0, true),
            ([2.0, 2.0], 2.0, false),
        ]);
        assert_eq!(found, [vec![4.0, 2.0], vec![4.0]]);
    }

    #[test]
    fn many_islands_with_lakes_are_quick_in_any_order() {
        let place = |i: u32| [f64::from(i % 200) * 10.0, f64::from(i / 200) * 10.0];
        let islands = (0..20_000).map(|i| (place(i), 4.0, true));
        let lakes = (0..20_000).map(|i| (place(i), 2.0, false));
        let mut squares: Vec<_> = islands.chain(lakes).collect();
        for turn in 0..2 {
            let found = polygons(&squares);
            assert!(found.len() == 20_000 && found.iter().all(|rings| *rings == [4.0, 2.0]));
            let mut all = CoordinateSequence::default();
            squares.iter().for_each(|&(at, reach, way)| square(&mut all, at, reach, way));
            let mut rings = NestedRings::new(&all);
            let is_outer = rings.outer().unwrap();
            rings.owners(&is_outer).unwrap().unwrap();
            assert!(rings.visited < 60_000 * 200, "{turn}: {}", rings.visited);
            let hash =
                |[x, y]: [f64; 2]| (x * 7919.0 + y).to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15);
            squares.sort_by_key(|(at, _, is_island)| hash(*at) ^ u64::from(*is_island) << 40);
        }
    }

    #[test]
    fn rings_in_rings_in_rings_do_not_take_forever() {
        let two = [([-9e9, 0.0], 1.0, true), ([9e9, 0.0], 1.0, true)];
        let nested = (1..80_000).map(|i| ([0.0, 0.0], f64::from(i), false));
        let mut all = CoordinateSequence::default();
        two.into_iter().chain(nested).for_each(|(at, size, way)| square(&mut all, at, size, way));
        assert!(group(all).unwrap_err().to_string().contains("too complex"));
    }

    proptest! {
        #[test]
        fn large_rings_are_as_small_ones(
            corners in prop::collection::vec((0_i32..12, 0_i32..12), 80..200),
            x in 0_i32..24,
            y in 0_i32..24,
        ) {
            let mut ring = CoordinateSequence::default();
            corners.iter().for_each(|&(x, y)| ring.push([x.into(), y.into()], None, None));
            ring.push([corners[0].0.into(), corners[0].1.into()], None, None);
            ring.end_part();
            let place = [f64::from(x) / 2.0, f64::from(y) / 2.0];
            let expected = contains(ring.xy.windows(2), &place);
            prop_assert_eq!(NestedRings::new(&ring).contains(0, &place).unwrap(), expected);
        }
    }

    #[test]
    fn thousands_of_lakes_in_a_long_coast_are_quick() {
        let mut all = CoordinateSequence::default();
        square(&mut all, [9e9, 0.0], 1.0, true);
        let coast = (0..=1_000_000).rev().map(|i| f64::from(i % 1_000_000) * 6.283_185e-6);
        coast.for_each(|turn| all.push([9e3 * turn.cos(), 9e3 * turn.sin()], None, None));
        all.end_part();
        for i in 0..5000 {
            square(&mut all, [f64::from(i) - 2500.0, 0.0], 0.25, false);
        }
        assert_eq!(group(all).unwrap().coordinates().polygons, [1, 5002]);
    }

    #[test]
    fn inside_outside_and_between() {
        let ring = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0], [0.0, 0.0]];
        for (place, expected) in [
            ([1.0, 1.0], Some(true)),
            ([2.0, 2.0], Some(false)),
            ([2.0, 1.0], None),
            ([0.0, 2.0], None),
            ([-1.0, 4.0], Some(false)),
            ([2.0, 0.5], Some(true)),
            ([5.0, 0.0], Some(false)),
        ] {
            assert_eq!(contains(ring.windows(2), &place), expected, "{place:?}");
        }
    }
}
