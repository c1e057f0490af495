//! Points of clouds in whole steps of a frame, and the frame that places them in the world.

use bytemuck::{Pod, Zeroable};

/// A point of a cloud, in steps of its [`Frame`]. The order (x, then y, then z) is the canonical one:
/// wherever a tie must be broken, the lowest point wins.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct Point {
    /// Steps east of the frame's origin.
    pub x: i32,
    /// Steps north.
    pub y: i32,
    /// Steps up.
    pub z: i32,
}

impl Point {
    /// The point of these steps.
    pub const fn new(x: i32, y: i32, z: i32) -> Self {
        Self { x, y, z }
    }
}

/// Largest magnitude of a coordinate of a [`Point`]: differences stay below 2^30, so orientation is
/// exact in `i64` and in-circle in `i128`.
pub const REACH: i32 = (1 << 29) - 1;

/// Where the points of a cloud lie: world = offset + scale * steps, axis by axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// World units of a step along x, y, z; finite and positive.
    pub scale: [f64; 3],
    /// World position of the origin; finite.
    pub offset: [f64; 3],
}

impl Frame {
    /// World coordinates of a point.
    pub fn world(&self, point: Point) -> [f64; 3] {
        let steps = [point.x, point.y, point.z].map(f64::from);
        std::array::from_fn(|axis| steps[axis] * self.scale[axis] + self.offset[axis])
    }

    /// Position of a world coordinate on `axis`, in steps; whole steps are points.
    pub fn steps(&self, axis: usize, world: f64) -> f64 {
        (world - self.offset[axis]) / self.scale[axis]
    }
}
