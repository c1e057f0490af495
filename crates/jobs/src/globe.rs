//! Grids on the globe whose last samples rounding has put beyond it.

use terrane_base::geom::Affine;

/// Degrees by which samples may be beyond the world: rounding.
const HAIR: f64 = 1e-9;

/// A map to longitudes and latitudes, of a grid that is not turned, with ends that are a hair beyond 180 degrees or
/// a pole on it.
pub(crate) fn into_world(map: Affine, [width, height]: [u32; 2]) -> Affine {
    let last = |samples: u32| f64::from(samples.saturating_sub(1));
    let [x0, a] = within([map.x0, map.a], last(width), 180.0);
    let [y0, e] = within([map.y0, map.e], last(height), 90.0);
    Affine { x0, a, y0, e, ..map }
}

/// Where an axis begins, and its step.
fn within([start, step]: [f64; 2], last: f64, most: f64) -> [f64; 2] {
    let ends = [start, start + step * last];
    let back = |end: f64| if end.abs() - most < HAIR { end.clamp(-most, most) } else { end };
    let [from, to] = ends.map(back);
    if [from, to] == ends || last == 0.0 {
        return [from, step];
    }
    let mut step = (to - from) / last;
    // The step is rounded, too.
    while to.abs() == most && (from + step * last).abs() > most {
        step = if step > 0.0 { step.next_down() } else { step.next_up() };
    }
    [from, step]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_a_hair_beyond_the_world_is_on_its_border() {
        for (start, samples, most) in [(-180.0, 1081_u32, 180.0), (90.0, 541, 90.0)] {
            let last = f64::from(samples - 1);
            for off in [-1e-13, 0.0, 1e-13, 7e-13] {
                let step = -2.0 * start / last + off;
                let [from, found] = within([start, step], last, most);
                let end = from + found * last;
                assert!(from == start && end.abs() <= most, "{start} {off:e} {end}");
                assert!((end + start).abs() < 1e-9);
                assert!((found - step).abs() < 1e-12);
            }
        }
        assert_eq!(within([-180.0000000001, 1.0], 0.0, 180.0), [-180.0, 1.0]);
        assert_eq!(within([170.0, 1.0], 11.0, 180.0), [170.0, 1.0], "far beyond");
        assert_eq!(within([7.0, 0.1], 50.0, 180.0), [7.0, 0.1], "inside");
    }
}
