//! A pit-free surface of first returns: the highest of several triangulations at each position.
//!
//! After Khosravipour, Skidmore, Isenburg, Wang & Hussin, "Generating pit-free canopy height models from
//! airborne lidar" (2014). Pulses that penetrate a crown leave pits in the triangulation of all first returns.
//! A triangulation of the returns above a height threshold spans the pits; triangles between crowns have long
//! edges and are ignored. The caller triangulates: this module assigns points to triangulations and merges
//! them.

use terrane_base::geom::{Point, is_within};

/// The triangulations. Lengths are in world units.
#[derive(Clone, Debug, PartialEq)]
pub struct PitFree {
    /// Heights above the ground, ascending; the first triangulation has all points, each further one the points
    /// at or above the next threshold.
    thresholds: Vec<f64>,
    /// Longest edge, on the ground, of triangles of all but the first triangulation.
    max_edge: f64,
}

/// The triangle of a triangulation over a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PitFreeFacet {
    /// Its corners.
    pub corners: [Point; 3],
    /// Its height at the place.
    pub z: f64,
}

impl PitFree {
    /// Ignores thresholds that are not finite and above zero; sorts the others.
    pub fn new(thresholds: &[f64], max_edge: f64) -> Self {
        let mut thresholds: Vec<f64> =
            thresholds.iter().copied().filter(|t| *t > 0.0 && t.is_finite()).collect();
        thresholds.sort_by(f64::total_cmp);
        thresholds.dedup();
        Self { thresholds, max_edge }
    }

    /// The usual thresholds, in metres (2, and every 5), for points about `spacing` metres apart.
    pub fn metres(spacing: f64) -> Self {
        let mut thresholds = vec![2.0];
        thresholds.extend((1..=12).map(|k| 5.0 * f64::from(k)));
        Self::new(&thresholds, 3.0 * spacing)
    }

    /// Number of triangulations; the first has all points.
    pub fn layers(&self) -> usize {
        1 + self.thresholds.len()
    }

    /// Longest edge of triangles that count in all but the first triangulation.
    pub fn max_edge(&self) -> f64 {
        self.max_edge
    }

    /// Number of triangulations, from the first one on, that hold a point at this height above ground; at least
    /// 1.
    pub fn layers_of(&self, above_ground: f64) -> usize {
        1 + self.thresholds.partition_point(|threshold| above_ground >= *threshold)
    }

    /// Height of the surface at a place. `facet` gives the triangle of a triangulation there, `None`
    /// beyond its hull; `scale` is the size of steps in x and y. `None` beyond the hull of all points.
    ///
    /// # Errors
    /// Those of `facet`.
    pub fn height<E>(
        &self,
        scale: [f64; 2],
        mut facet: impl FnMut(usize) -> Result<Option<PitFreeFacet>, E>,
    ) -> Result<Option<f64>, E> {
        let Some(base) = facet(0)? else { return Ok(None) };
        let mut highest = base.z;
        for layer in 1..self.layers() {
            // Points of a higher layer are in all lower ones, and so are their hulls.
            let Some(found) = facet(layer)? else { break };
            if found.z > highest && is_short(&found.corners, scale, self.max_edge) {
                highest = found.z;
            }
        }
        Ok(Some(highest))
    }
}

/// Whether no edge of a triangle, on the ground, is longer than `max_edge`; `scale` is the size of steps in
/// x and y.
pub fn is_short(corners: &[Point; 3], scale: [f64; 2], max_edge: f64) -> bool {
    let [a, b, c] = *corners;
    [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| is_within(from, to, scale, max_edge))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spade::{
        DelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation,
    };
    use std::convert::Infallible;

    struct Tip(Point);

    impl HasPosition for Tip {
        type Scalar = f64;
        fn position(&self) -> Point2<f64> {
            Point2::new(self.0.x.into(), self.0.y.into())
        }
    }

    type Tin = DelaunayTriangulation<Tip>;

    /// One triangulation for each layer, of points with steps of a tenth of a metre over level ground.
    fn tins(pits: &PitFree, points: &[Point]) -> Vec<Tin> {
        let within = |layer: usize| {
            let high = points.iter().filter(move |p| pits.layers_of(0.1 * f64::from(p.z)) > layer);
            Tin::bulk_load(high.map(|p| Tip(*p)).collect()).unwrap()
        };
        (0..pits.layers()).map(within).collect()
    }

    fn facet(tin: &Tin, x: f64, y: f64) -> Option<PitFreeFacet> {
        let at = Point2::new(x, y);
        let face = match tin.locate(at) {
            PositionInTriangulation::OnFace(face) => tin.face(face),
            PositionInTriangulation::OnEdge(edge) => tin.directed_edge(edge).face().as_inner()?,
            PositionInTriangulation::OnVertex(v) => {
                tin.vertex(v).out_edges().find_map(|e| e.face().as_inner())?
            }
            _ => return None,
        };
        let corners = face.vertices().map(|v| v.data().0);
        let weights = face.barycentric_interpolation(at);
        let z = corners.iter().zip(weights).map(|(p, w)| w * f64::from(p.z)).sum();
        Some(PitFreeFacet { corners, z })
    }

    fn surface(pits: &PitFree, tins: &[Tin], x: f64, y: f64) -> Option<f64> {
        let found: Result<_, Infallible> =
            pits.height([0.1, 0.1], |layer| Ok(facet(&tins[layer], x, y)));
        found.unwrap()
    }

    /// Two crowns 12 m high on a meadow, a point every half a metre; every ninth pulse goes deep.
    fn meadow() -> Vec<Point> {
        let height = |x: i32, y: i32| {
            let crown = |cx: i32| (x - cx).pow(2) + (y - 100).pow(2) < 40 * 40;
            let deep = (x / 5 * 7 + y / 5 * 3) % 9 == 0;
            if !crown(60) && !crown(180) {
                0
            } else if deep {
                15
            } else {
                120
            }
        };
        let place = |k: i32| (k % 49 * 5 + k % 3, k / 49 * 5 + k % 2);
        (0..49 * 41).map(place).map(|(x, y)| Point::new(x, y, height(x, y))).collect()
    }

    #[test]
    fn pits_in_crowns_are_spanned_and_gaps_between_crowns_are_not() {
        let pits = PitFree::metres(0.5);
        let tins = tins(&pits, &meadow());
        let (mut pitted, mut spanned) = (0, 0);
        for (x, y) in (0..240).step_by(3).flat_map(|x| (0..200).step_by(3).map(move |y| (x, y))) {
            let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            let Some(top) = surface(&pits, &tins, x, y) else { continue };
            let plain = facet(&tins[0], x, y).unwrap().z;
            assert!(top >= plain);
            let inside = |cx: f64| (x - cx).powi(2) + (y - 100.0).powi(2) < 30.0_f64.powi(2);
            let outside = |cx: f64| (x - cx).powi(2) + (y - 100.0).powi(2) > 52.0_f64.powi(2);
            if inside(60.0) || inside(180.0) {
                assert_eq!(top.round(), 120.0, "({x}, {y})");
                pitted += u32::from(plain < 100.0);
            } else if outside(60.0) && outside(180.0) {
                assert_eq!(top, plain, "({x}, {y})");
                let wide = facet(&tins[3], x, y).is_some_and(|facet| facet.z > 100.0);
                spanned += u32::from(wide);
            }
        }
        assert!(pitted > 50, "{pitted} pits");
        assert!(spanned > 20, "{spanned} places between crowns that a triangle too long spans");
    }

    #[test]
    fn layers_begin_at_their_threshold() {
        let pits = PitFree::new(&[5.0, 2.0, f64::NAN, -1.0, 0.0, 5.0, 10.0], 1.0);
        assert_eq!(pits.layers(), 4);
        let layers = [-3.0, 0.0, 1.99, 2.0, 5.0, 9.0, 10.0, 99.0].map(|h| pits.layers_of(h));
        assert_eq!(layers, [1, 1, 1, 2, 3, 3, 4, 4]);
        assert_eq!(pits.max_edge(), 1.0);
        let usual = PitFree::metres(0.5);
        assert_eq!((usual.layers(), usual.max_edge()), (14, 1.5));
        for (layer, height) in
            (2..).zip([2.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0])
        {
            assert_eq!(usual.layers_of(height), layer, "{height}");
            assert_eq!(usual.layers_of(height - 0.01), layer - 1, "{height}");
        }
    }

    #[test]
    fn beyond_the_hull_there_is_nothing_and_errors_are_handed_on() {
        let pits = PitFree::metres(1.0);
        assert_eq!(pits.height([1.0; 2], |_| Ok::<_, Infallible>(None)), Ok(None));
        let corners = [Point::new(0, 0, 0), Point::new(1, 0, 0), Point::new(0, 1, 0)];
        let base = PitFreeFacet { corners, z: 1.0 };
        let failing = |layer: usize| if layer == 0 { Ok(Some(base)) } else { Err("more points") };
        assert_eq!(pits.height([1.0; 2], failing), Err("more points"));
    }
}
