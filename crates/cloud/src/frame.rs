//! The frame of a cloud: one lattice for the points of all its files, independent of their order.

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, PointFrame, REACH, Ruler};

use super::filter::CloudFilter;

/// Lattice and stated bounds of the points of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ClaimedExtent {
    pub(super) scale: [f64; 3],
    pub(super) offset: [f64; 3],
    /// Minimum and maximum steps; bounds between steps are extended to the next step.
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
}

/// Tolerance, in steps, for a position on a step: coordinates in `f64` are rounded.
const SLACK: f64 = 1e-4;
/// Maximum offset, in steps, between two lattices that count as one.
const MAX_STEPS: f64 = (1_u64 << 50) as f64;

impl ClaimedExtent {
    /// From bounds in world units.
    pub(super) fn new(scale: [f64; 3], offset: [f64; 3], low: [f64; 3], high: [f64; 3]) -> Self {
        let offset = offset.map(|o| o + 0.0);
        let steps = |axis: usize, world: f64| (world - offset[axis]) / scale[axis];
        // If doubles no longer resolve steps, the bounds do not hold for all points rounded to them.
        let slack = |axis: usize, world: f64| {
            SLACK - f64::EPSILON * (world.abs() + offset[axis].abs()) / scale[axis]
        };
        // Casts saturate: no point is beyond this range.
        let low = std::array::from_fn(|i| (steps(i, low[i]) + slack(i, low[i])).floor() as i32);
        let high = std::array::from_fn(|i| (steps(i, high[i]) - slack(i, high[i])).ceil() as i32);
        Self { scale, offset, low, high }
    }

    /// World coordinates as LAS readers compute them.
    pub(super) fn world(&self, raw: [i32; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| f64::from(raw[axis]) * self.scale[axis] + self.offset[axis])
    }

    /// Whether a point is within the bounds.
    pub(super) fn holds(&self, raw: [i32; 3]) -> bool {
        (0..3).all(|axis| (self.low[axis]..=self.high[axis]).contains(&raw[axis]))
    }

    /// The bounds cut to the filter's bounds and heights plus a step, as points may be rounded to another lattice;
    /// `None` if empty.
    pub(super) fn within(&self, filter: &CloudFilter) -> Option<Self> {
        let [west, south, east, north] = filter.area();
        let [bottom, top] = filter.z_range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let mut cut = *self;
        for (axis, range) in [[west, east], [south, north], [bottom, top]].iter().enumerate() {
            let ruler = Ruler::new(self.scale[axis], self.offset[axis]);
            cut.low[axis] = cut.low[axis].max(clip(ruler.first(range[0]) - 1));
            cut.high[axis] = cut.high[axis].min(clip(ruler.last(range[1]) + 1));
        }
        (0..3).all(|axis| cut.low[axis] <= cut.high[axis]).then_some(cut)
    }
}

/// Minimum and maximum steps of points in a frame: for exact geometry, and for files.
const EXACT: [i64; 2] = [-(REACH as i64), REACH as i64];
const STORED: [i64; 2] = [i32::MIN as i64, i32::MAX as i64];

/// Transformation from the lattice of a file to the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum FrameTransform {
    /// Subtracts steps, modulo 2^32: the result is within range, so it is exact.
    Shift([i32; 3]),
    /// Rounds to the nearest step of another lattice.
    Round(PointFrame),
}

impl FrameTransform {
    /// Transforms the position `raw`, which is within the file's bounds.
    pub(super) fn in_frame(&self, raw: [i32; 3], claim: &ClaimedExtent) -> Point {
        let [x, y, z] = match self {
            Self::Shift(by) => std::array::from_fn(|axis| raw[axis].wrapping_sub(by[axis])),
            Self::Round(frame) => {
                let world = claim.world(raw);
                std::array::from_fn(|axis| frame.steps(axis, world[axis]).round() as i32)
            }
        };
        Point { x, y, z }
    }
}

/// A common frame, the transformation of each file, and the maximum displacement of points.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CommonFrame {
    pub(super) frame: PointFrame,
    pub(super) maps: Vec<FrameTransform>,
    pub(super) moved: [f64; 3],
}

/// The common frame of files, a pure function of the set of their extents. Lattices that differ by whole steps only
/// are kept, and every point keeps its exact position. Otherwise the finest scale along each axis is used, and points
/// are snapped to it.
///
/// # Errors
/// Extents beyond [`REACH`], unless any extent is allowed; extents beyond the range of files.
pub(super) fn common(claims: &[ClaimedExtent], any_extent: bool) -> Result<CommonFrame> {
    match within(claims, EXACT) {
        Err(_) if any_extent => within(claims, STORED),
        found => found,
    }
}

fn within(claims: &[ClaimedExtent], steps: [i64; 2]) -> Result<CommonFrame> {
    let axes: Vec<Option<SharedLatticeAxis>> =
        (0..3).map(|axis| SharedLatticeAxis::shared(claims, axis)).collect();
    match <[Option<SharedLatticeAxis>; 3]>::try_from(axes) {
        Ok([Some(x), Some(y), Some(z)]) => shifted(claims, [x, y, z], steps),
        _ => rounded(claims, steps),
    }
}

/// A lattice along an axis that all files share.
struct SharedLatticeAxis {
    scale: f64,
    /// The lowest offset of a file.
    base: f64,
    /// Steps from the base to the offset of each file.
    steps: Vec<i64>,
}

impl SharedLatticeAxis {
    fn shared(claims: &[ClaimedExtent], axis: usize) -> Option<Self> {
        let scale = claims.first()?.scale[axis];
        let base = claims.iter().map(|c| c.offset[axis]).fold(f64::INFINITY, f64::min);
        let steps = claims.iter().map(|claim| {
            let steps = (claim.offset[axis] - base) / scale;
            let fits = (steps - steps.round()).abs() <= SLACK && steps.abs() < MAX_STEPS;
            (claim.scale[axis] == scale && fits).then(|| steps.round() as i64)
        });
        Some(Self { scale, base, steps: steps.collect::<Option<_>>()? })
    }

    /// The base if all points are within range of it, else a step near their middle.
    fn origin(&self, claims: &[ClaimedExtent], axis: usize, steps: [i64; 2]) -> Result<i64> {
        let files = claims.iter().zip(&self.steps);
        let low = files.clone().map(|(claim, steps)| i64::from(claim.low[axis]) + steps).min();
        let high = files.map(|(claim, steps)| i64::from(claim.high[axis]) + steps).max();
        let range = [low.unwrap_or(0), high.unwrap_or(0)];
        origin(range, steps).ok_or_else(|| {
            let ruler = Ruler::new(self.scale, self.base);
            too_wide(axis, self.scale, range.map(|step| ruler.at(step)), steps)
        })
    }
}

/// Zero if `low` and `high` are within range of it, else their middle.
fn origin([low, high]: [i64; 2], [least, most]: [i64; 2]) -> Option<i64> {
    if low >= least && high <= most {
        return Some(0);
    }
    let middle = low + (high - low) / 2;
    (low - middle >= least && high - middle <= most).then_some(middle)
}

fn too_wide(axis: usize, scale: f64, [low, high]: [f64; 2], [least, most]: [i64; 2]) -> Error {
    let name = ["x", "y", "z"][axis];
    let (steps, most) = (((high - low) / scale).round(), most - least);
    let part = if axis < 2 { "‹bounds›" } else { "‹z_range›" };
    let what = if most < i64::from(i32::MAX) { "of exact geometry" } else { "of a file" };
    Error::unsupported(format!(
        "{name} ranges from {low} to {high}: {steps} steps of {scale} exceed the {most} steps {what}"
    ))
    .remedy(format!(
        "crop with {part}, or rewrite with a coarser scale, for example scale_{name} of PDAL's writers.las"
    ))
}

fn shifted(
    claims: &[ClaimedExtent],
    axes: [SharedLatticeAxis; 3],
    steps: [i64; 2],
) -> Result<CommonFrame> {
    let mut origins = [0; 3];
    for (axis, lattice) in axes.iter().enumerate() {
        origins[axis] = lattice.origin(claims, axis, steps)?;
    }
    let frame = PointFrame {
        scale: std::array::from_fn(|axis| axes[axis].scale),
        offset: std::array::from_fn(|axis| {
            Ruler::new(axes[axis].scale, axes[axis].base).at(origins[axis])
        }),
    };
    let maps = (0..claims.len()).map(|file| {
        // Wraps modulo 2^32 on purpose.
        FrameTransform::Shift(std::array::from_fn(|axis| {
            (origins[axis] - axes[axis].steps[file]) as i32
        }))
    });
    Ok(CommonFrame { frame, maps: maps.collect(), moved: [0.0; 3] })
}

fn rounded(claims: &[ClaimedExtent], steps: [i64; 2]) -> Result<CommonFrame> {
    let mut frame = PointFrame { scale: [1.0; 3], offset: [0.0; 3] };
    let mut moved = [0.0; 3];
    for (axis, moved) in moved.iter_mut().enumerate() {
        let scale = claims.iter().map(|c| c.scale[axis]).fold(f64::INFINITY, f64::min);
        let low = claims.iter().map(|c| c.world(c.low)[axis]).fold(f64::INFINITY, f64::min);
        let high = claims.iter().map(|c| c.world(c.high)[axis]).fold(f64::NEG_INFINITY, f64::max);
        let [first, last] = [(low / scale).floor(), (high / scale).ceil()];
        let wide = || too_wide(axis, scale, [low, high], steps);
        if first.abs().max(last.abs()) >= MAX_STEPS {
            return Err(wide());
        }
        let origin = origin([first as i64, last as i64], steps).ok_or_else(wide)?;
        let offset = Ruler::new(scale, 0.0).at(origin);
        (frame.scale[axis], frame.offset[axis]) = (scale, offset);
        if !claims.iter().all(|claim| is_within(claim, axis, scale, offset)) {
            *moved = scale / 2.0;
        }
    }
    let maps = vec![FrameTransform::Round(frame); claims.len()];
    Ok(CommonFrame { frame, maps, moved })
}

/// The nearest step that a point can have.
pub(super) fn clip(step: i64) -> i32 {
    step.clamp(i32::MIN.into(), i32::MAX.into()) as i32
}

/// Whether all steps of a file are also steps of another lattice.
fn is_within(claim: &ClaimedExtent, axis: usize, scale: f64, offset: f64) -> bool {
    let ratio = claim.scale[axis] / scale;
    let steps = (claim.offset[axis] - offset) / scale;
    (ratio - ratio.round()).abs() <= 4.0 * f64::EPSILON * ratio
        && (steps - steps.round()).abs() <= SLACK
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(scale: f64, offset: f64, low: f64, high: f64) -> ClaimedExtent {
        ClaimedExtent::new([scale; 3], [offset; 3], [low; 3], [high; 3])
    }

    #[test]
    fn one_file_keeps_its_own_lattice() {
        let near = claim(0.01, 100.0, 0.0, 500.0);
        let common = common(&[near], false).unwrap();
        assert_eq!(common.frame, PointFrame { scale: [0.01; 3], offset: [100.0; 3] });
        assert_eq!(common.maps, [FrameTransform::Shift([0; 3])]);
        assert_eq!((near.low, near.high), ([-10_000; 3], [40_000; 3]));
    }

    #[test]
    fn bounds_hold_for_steps_that_are_rounded_to_them() {
        for (scale, offset, raw) in
            [(1e-16, 2000.0, 51_234), (1e-12, -3e6, -70_001), (1e-3, 5e5, 9)]
        {
            let only = f64::from(raw) * scale + offset;
            assert!(claim(scale, offset, only, only).holds([raw; 3]), "{scale}");
        }
        assert!(!claim(1e-3, 5e5, 5e5, 5e5).holds([1; 3]));
    }

    #[test]
    fn far_points_move_the_origin_by_whole_steps() {
        let far = claim(0.001, 0.0, 1_999_000.0, 2_000_000.0);
        let found = common(&[far], false).unwrap();
        let raw = [1_999_500_123; 3];
        let point = found.maps[0].in_frame(raw, &far);
        assert!(point.x.abs() <= REACH);
        let world = found.frame.world(point)[0];
        assert!((world - 1_999_500.123).abs() < 1e-6, "{world}");
    }

    #[test]
    fn extents_beyond_reach_are_taken_as_they_are_stored_or_refused_with_what_helps() {
        let wide = claim(0.001, 0.0, -2e6, 2e6);
        let told = common(&[wide], false).unwrap_err().to_string();
        assert!(told.contains("from -2000000 to 2000000: 4000000000 steps"), "{told}");
        assert!(told.contains("‹bounds›"), "{told}");
        let found = common(&[wide], true).unwrap();
        assert_eq!(
            (found.frame.offset, &found.maps[..]),
            ([0.0; 3], &[FrameTransform::Shift([0; 3])][..])
        );
        let high = ClaimedExtent { low: [0, 0, i32::MIN], high: [0, 0, i32::MAX], ..wide };
        let told = common(&[high], false).unwrap_err().to_string();
        assert!(told.contains("z ranges") && told.contains("‹z_range›"), "{told}");
        let all = common(&[high], true).unwrap();
        assert_eq!(all.maps[0].in_frame([0, 0, i32::MIN], &high), Point::new(0, 0, i32::MIN));
        // Within range, any extent gives the same frame.
        let near = claim(0.001, 0.0, 1_999_000.0, 2_000_000.0);
        assert_eq!(common(&[near], true).unwrap(), common(&[near], false).unwrap());
        let far = claim(0.001, 5e6, 5e6, 5e6 + 1.0);
        let told = common(&[claim(0.001, 0.0, 0.0, 1.0), far], true).unwrap_err().to_string();
        assert!(told.contains("from 0 to 5000001") && told.contains("of a file"), "{told}");
    }

    #[test]
    fn lattices_that_are_one_are_kept_in_any_order() {
        let (a, b) = (claim(0.01, 0.0, 0.0, 10.0), claim(0.01, 1000.0, 1000.0, 1010.0));
        let (one, two) = (common(&[a, b], false).unwrap(), common(&[b, a], false).unwrap());
        assert_eq!((one.frame, one.moved), (two.frame, [0.0; 3]));
        assert_eq!(one.maps[1].in_frame([7; 3], &b), Point::new(100_007, 100_007, 100_007));
        assert_eq!(two.maps[0], one.maps[1]);
    }

    #[test]
    fn other_lattices_meet_on_the_finest_scale() {
        let (a, b) = (claim(0.01, 0.0, 0.0, 10.0), claim(0.001, 0.0005, 1.0, 2.0));
        let found = common(&[a, b], false).unwrap();
        assert_eq!(found.frame.scale, [0.001; 3]);
        assert_eq!(found.maps[0].in_frame([123; 3], &a), Point::new(1230, 1230, 1230));
        assert_eq!(found.moved, [0.0005; 3]);
        assert_eq!(common(&[b, a], false).unwrap().frame, found.frame);
        // Points already on the finer lattice do not move.
        let finer = claim(0.001, 7.0, 1.0, 2.0);
        assert_eq!(common(&[a, finer], false).unwrap().moved, [0.0; 3]);
    }

    #[test]
    fn bounds_off_the_lattice_reach_to_the_next_step() {
        let odd = claim(0.01, 0.0, 1.003, 1.996);
        assert_eq!((odd.low[0], odd.high[0]), (100, 200));
        let even = claim(0.001, 0.0, 84_808.3, 85_000.0);
        assert_eq!((even.low[0], even.high[0]), (84_808_300, 85_000_000));
    }
}
