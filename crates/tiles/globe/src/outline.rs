//! Bounds of a bent grid's samples, their spacing, and crossings of lines with rows and columns.

use crate::globe::{EQUATOR, EllipsoidNormal, SinCos, Vector};
use crate::table::CubicTable;
use crate::tiling::GeodeticBounds;
use terrane_base::error::{Error, Result};

/// Smallest spacing of samples in degrees along the equator.
pub(crate) fn spacing(upright: &CubicTable<3>) -> f64 {
    let [cols, rows] = upright.parts.map(|parts| parts as usize);
    let mut min = f64::INFINITY;
    for row in 0..=rows {
        for col in 0..=cols {
            let here = Vector(upright.node([col, row]));
            for (axis, next) in [[col + 1, row], [col, row + 1]].into_iter().enumerate() {
                if next[axis] <= [cols, rows][axis] {
                    let off = (Vector(upright.node(next)) - here).length();
                    min = min.min(off / upright.step[axis]);
                }
            }
        }
    }
    min.to_degrees()
}

/// Bounds of all samples.
///
/// # Errors
/// Samples on both sides of 180 degrees.
pub(crate) fn outline(
    [width, height]: [u32; 2],
    upright: &CubicTable<3>,
    spacing: f64,
) -> Result<GeodeticBounds> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (axis, across) in [(0, 0), (0, height - 1), (1, 0), (1, width - 1)] {
        let side = (0..[width, height][axis]).map(|along| {
            let at = if axis == 0 { [along, across] } else { [across, along] };
            EllipsoidNormal::along(Vector(upright.at(at.map(f64::from)))).place()
        });
        let side: Vec<_> = side.collect();
        if side.windows(2).any(|two| (two[0][0] - two[1][0]).abs() > 180.0) {
            return Err(Error::unsupported("crosses 180 degrees or contains a pole")
                .remedy("split it there"));
        }
        for place in side {
            for axis in 0..2 {
                (low[axis], high[axis]) = (low[axis].min(place[axis]), high[axis].max(place[axis]));
            }
        }
    }
    // Sides bulge a little between samples, and inner samples may lie behind them.
    let bow = 1e-11 + spacing * spacing / 10.0;
    Ok(GeodeticBounds {
        west: (low[0] - bow).max(-180.0),
        south: (low[1] - bow).max(-90.0),
        east: (high[0] + bow).min(180.0),
        north: (high[1] + bow).min(90.0),
    })
}

/// Integer crossings along a part of a line, for a linear function; few.
pub(crate) fn crossings([a, b]: [f64; 2], [from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    let (first, last) = (from.min(to).floor() + 1.0, from.max(to).ceil() - 1.0);
    // NaN positions have no crossings.
    let count = if last - first < 4.0 { (last - first + 1.0).max(0.0) as u32 } else { 0 };
    (0..count).map(move |i| a + (b - a) * ((first + f64::from(i) - from) / (to - from)))
}

/// Metres between two positions, along the meridian and then along the parallel of the second.
pub(crate) fn metres(from: [f64; 2], to: [f64; 2]) -> f64 {
    let [x, y] = [0, 1].map(|axis: usize| (from[axis] - to[axis]).abs().to_radians());
    (x * SinCos::of(to[1]).cos + y) * EQUATOR
}
