//! A resampling method, and the ratio of the output cells to those of the input.

use terrane_base::geom::Rect;
use terrane_base::registry::RegistryEntry;

use super::window::{Place, SourceWindow, nearest, nearest_index};

/// A resampling method: an entry of [`RESAMPLINGS`](super::RESAMPLINGS).
#[derive(Debug)]
pub struct ResamplingMethod {
    /// Name on the command line, unique.
    pub name: &'static str,
    /// One line for the documentation.
    pub about: &'static str,
    /// Samples on each side of a position that the kernel covers at the resolution of the grid; 0 for the
    /// nearest sample only, which makes no new heights.
    pub radius: u32,
    pub(super) run: fn(&SourceWindow<'_>, &[Place], Scale, &mut [f64]),
    pub(super) run_on_axes: fn(&SourceWindow<'_>, [&[f64]; 2], Scale, &mut [f64]),
}

/// Columns and rows of the grid for each of the output; at least 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale([f64; 2]);

impl Scale {
    /// The resolution of the grid.
    pub const ONE: Self = Self([1.0; 2]);

    /// Less than a twentieth more counts as the same.
    const SAME: f64 = 1.0 / 0.95;

    /// The scale from a number of columns and rows.
    pub fn new(by: [f64; 2]) -> Self {
        Self(by.map(|by| if by > Self::SAME { by } else { 1.0 }))
    }

    /// Columns and rows.
    pub fn get(self) -> [f64; 2] {
        self.0
    }
}

impl ResamplingMethod {
    /// Samples on each side that the kernel covers, by columns and rows; at least the nearest.
    pub fn reach(&self, scale: Scale) -> [f64; 2] {
        scale.get().map(|scale| (f64::from(self.radius) * scale).ceil().max(1.0))
    }

    /// The rectangle of samples that the heights at some positions depend on; none if no position lies in the
    /// grid.
    pub fn needed(&self, grid: [u32; 2], places: &[Place], scale: Scale) -> Rect {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in places.iter().filter(|place| nearest(grid, **place).is_some()) {
            for axis in [0, 1] {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        self.around(grid, [low, high], scale)
    }

    /// As [`needed`](Self::needed), for all positions on some columns and rows.
    pub fn needed_on_axes(&self, grid: [u32; 2], axes: [&[f64]; 2], scale: Scale) -> Rect {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for axis in [0, 1] {
            let inside = axes[axis].iter().filter(|at| nearest_index(**at, grid[axis]).is_some());
            for at in inside {
                (low[axis], high[axis]) = (low[axis].min(*at), high[axis].max(*at));
            }
        }
        self.around(grid, [low, high], scale)
    }

    /// Samples that count between two positions.
    fn around(&self, grid: [u32; 2], [low, high]: [Place; 2], scale: Scale) -> Rect {
        if low[0] > high[0] || low[1] > high[1] {
            return Rect::new(0, 0, 0, 0);
        }
        let reach = self.reach(scale);
        let [(col, width), (row, height)] = [0, 1].map(|axis| {
            let side = f64::from(grid[axis]);
            let first = (low[axis].floor() - reach[axis] + 1.0).clamp(0.0, side - 1.0);
            let end = (high[axis].floor() + reach[axis] + 1.0).clamp(first + 1.0, side);
            (first as u32, (end - first) as u32)
        });
        Rect::new(col, row, width, height)
    }

    /// The height at each position, in a window with all samples [`needed`](Self::needed); NaN beyond the grid,
    /// and where the nearest sample is void. Takes time linear in the places and in the samples that count for
    /// each.
    pub fn heights(
        &self,
        window: &SourceWindow<'_>,
        places: &[Place],
        scale: Scale,
        out: &mut [f64],
    ) {
        (self.run)(window, places, scale, out);
    }

    /// As [`heights`](Self::heights) for all positions on some columns and rows, row by row: the same numbers, in less
    /// time.
    pub fn heights_on_axes(
        &self,
        window: &SourceWindow<'_>,
        axes: [&[f64]; 2],
        scale: Scale,
        out: &mut [f64],
    ) {
        (self.run_on_axes)(window, axes, scale, out);
    }
}

impl RegistryEntry for ResamplingMethod {
    const KIND: &'static str = "resampling";

    fn name(&self) -> &'static str {
        self.name
    }

    fn aliases(&self) -> &'static [&'static str] {
        if self.radius == 0 { &["nearest"] } else { &[] }
    }
}
