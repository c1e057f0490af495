//! Curvature of the ground, by the partial quartic of Zevenbergen & Thorne (1987).

use terrane_options::Choice;

use crate::relief::{Derivative, Gradient, Heights, Turn};

/// Type of curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum CurvatureKind {
    /// Profile plus plan curvature: positive where the ground is convex
    ///
    /// The negative of the sum of both second derivatives.
    #[default]
    General,
    /// Along the steepest descent: positive where the slope increases downhill
    Profile,
    /// Across the steepest descent: positive where flow diverges
    Plan,
}

/// Curvature, in radians per metre; profile and plan curvature of level ground are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Curvature(pub CurvatureKind);

impl Derivative for Curvature {
    fn at(&self, heights: &Heights, turn: &Turn) -> f64 {
        let [a, b, c, d, e, f, g, h, i] = *heights;
        // By column and row, then by metre.
        let (across, down, both) = (d - 2.0 * e + f, b - 2.0 * e + h, (a - c - g + i) / 4.0);
        let [x, y] = *turn;
        let [xx, xy, yy] = [[x, x], [x, y], [y, y]]
            .map(|[[u, v], [s, t]]| u * s * across + (u * t + v * s) * both + v * t * down);
        let [east, north] = Gradient::ZevenbergenThorne.of(heights, turn);
        let steep = east * east + north * north;
        let along = match self.0 {
            CurvatureKind::General => return -(xx + yy),
            CurvatureKind::Profile => {
                east * east * xx + 2.0 * east * north * xy + north * north * yy
            }
            CurvatureKind::Plan => north * north * xx - 2.0 * east * north * xy + east * east * yy,
        };
        if steep == 0.0 { 0.0 } else { -along / steep }
    }
}
