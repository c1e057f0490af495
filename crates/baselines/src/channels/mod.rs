//! Meshes of several channels, such as the colours of a photograph, or heights and colours of a textured terrain.
//!
//! Greedy insertion as in [`greedy4`](crate::greedy), where the error of a sample is the largest over the
//! channels of weight x |value - interpolated value|. Source: Garland & Heckbert, "Fast Polygonal Approximation
//! of Terrains and Height Fields", CMU-CS-95-181 (1995), which also approximates colour images; the paper sums
//! the errors of the channels, while the maximum bounds each channel by itself. For a channel of weight w a
//! tolerance E guarantees |difference| <= E / w, with the quotient rounded to a double: that number is compared
//! exactly, here and by the verification.
//!
//! With one channel of weight 1 the result is that of `greedy4`. Channels are doubles, like the heights of all methods
//! here, so all types of bands are supported; the mesh takes some 200 bytes per sample anyway.

mod prefilter;
#[cfg(test)]
mod tests;

use crate::candidate::RefinementCandidate;
use crate::greedy::CandidateHeap;
use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::BaselineMesh;
use crate::plane::{TrianglePlane, rows_of, weights_in};
use crate::result::{connected, measure};
use crate::settings::{BaselineGoal, BaselineTask, SurfaceSize};
use crate::surface::SampleStatistics;
use prefilter::ChannelSlopeFilter;
use terrane_base::error::{Error, Result};

/// Channels over the same samples, each with a weight of its errors.
///
/// ```
/// use terrane_baselines::{WeightedChannels, BaselineGoal};
///
/// let colours: [Vec<f64>; 2] = [7, 5].map(|n| (0..20 * 20).map(|i| f64::from(i * i % n)).collect());
/// let picture = WeightedChannels::new([20, 20], &colours, &[1.0, 0.5])?;
/// let drawn = picture.triangulate(BaselineGoal::MaxError(1.0), &|| Ok(()))?;
/// assert!(drawn.channels[0].max_error <= 1.0 && drawn.channels[1].max_error <= 2.0);
/// # Ok::<(), terrane_base::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct WeightedChannels<'a> {
    /// At least one.
    channels: Vec<WeightedChannel<'a>>,
}

#[derive(Clone, Copy, Debug)]
struct WeightedChannel<'a> {
    grid: HeightGrid<'a>,
    weight: f64,
}

/// The errors of one channel, without its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelErrors {
    /// The smallest double that is not below the error of any sample.
    pub max_error: f64,
    /// Sum of the squared errors of the samples of the surface.
    pub square_sum: f64,
}

/// A mesh of several channels.
#[derive(Clone, Debug, PartialEq)]
pub struct MultichannelTin {
    /// Samples that are vertices, in (row, column) order.
    pub vertices: Vec<PackedSample>,
    /// Triangles, counter-clockwise in (column, row) axes, as indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
    /// A tolerance that the mesh meets, nearly the smallest.
    pub max_error: f64,
    /// The errors of each channel, in their order.
    pub channels: Vec<ChannelErrors>,
    /// Statistics of the samples.
    pub census: SampleStatistics,
}

/// Makes samples that are void in one plane void in all. All planes have the same length.
pub fn join_voids(planes: &mut [Vec<f64>]) {
    let samples = planes.first().map_or(0, Vec::len);
    for at in 0..samples {
        if planes.iter().any(|plane| plane[at].is_nan()) {
            planes.iter_mut().for_each(|plane| plane[at] = f64::NAN);
        }
    }
}

impl<'a> WeightedChannels<'a> {
    /// Maximum bytes per sample, including the result, for a number of channels.
    pub fn sample_bytes(channels: usize) -> u64 {
        GREEDY_BYTES + 8 * channels as u64
    }

    /// Planes of `width` columns and `height` rows of samples, row by row, NaN where void, and weights.
    ///
    /// # Errors
    /// The errors of [`HeightGrid::new`]; usage: no plane, a different number of weights, a weight that is not finite
    /// and positive, a sample that is void in some planes only (see [`join_voids`]).
    pub fn new([width, height]: [u32; 2], planes: &'a [Vec<f64>], weights: &[f64]) -> Result<Self> {
        if planes.is_empty() || planes.len() != weights.len() {
            let (planes, weights) = (planes.len(), weights.len());
            return Err(Error::usage(format!("{weights} weights for {planes} channels"))
                .remedy("give each channel a weight"));
        }
        let mut channels = Vec::with_capacity(planes.len());
        for (plane, &weight) in planes.iter().zip(weights) {
            check_weight(weight)?;
            let grid = HeightGrid::new(width, height, plane, None)?;
            channels.push(WeightedChannel { grid, weight });
        }
        let differing = (0..planes[0].len())
            .find(|&at| planes.iter().any(|plane| plane[at].is_nan() != planes[0][at].is_nan()));
        match differing {
            None => Ok(Self { channels }),
            Some(at) => Err(Error::usage(format!("sample {at} is void in some channels only"))
                .remedy("make it void in all channels")),
        }
    }

    /// A Delaunay mesh of samples that meets `goal`. Time O((m + n) log m) expected for m vertices of n
    /// samples, times the channels.
    ///
    /// # Errors
    /// `BadInput`: no cell has four valid samples. Usage: the coarsest mesh is larger than the target. Errors of
    /// `pulse`, which is called at intervals.
    pub fn triangulate(
        &self,
        goal: BaselineGoal,
        pulse: &dyn Fn() -> Result<()>,
    ) -> Result<MultichannelTin> {
        let grid = self.channels[0].grid;
        let task = BaselineTask { pulse, ..BaselineTask::new(grid, goal) };
        let mut mesh = BaselineMesh::of_outline(&grid)?;
        self.insert(&task, &mut mesh, |_| ())?;
        let mut corners =
            mesh.surface().map(|id| mesh.tris[id as usize].corners).collect::<Vec<_>>();
        drop(mesh);
        let (vertices, triangles) = connected(&mut corners);
        let channels: Vec<ChannelErrors> =
            self.channels.iter().map(|c| c.measured(&corners)).collect();
        let (max_error, census) = (self.min_tolerance(&channels), SampleStatistics::of(&grid));
        Ok(MultichannelTin { vertices, triangles, max_error, channels, census })
    }

    /// Inserts vertices until the goal is reached; calls `note` for each in order.
    fn insert(
        &self,
        task: &BaselineTask<'_>,
        mesh: &mut BaselineMesh,
        mut note: impl FnMut(PackedSample),
    ) -> Result<()> {
        let mut size = SurfaceSize::of(mesh, task.goal)?;
        let worst = |corners| self.worst(task.tolerance(), corners);
        let mut heap = CandidateHeap::default();
        heap.scan(mesh, &mesh.surface().collect::<Vec<_>>(), worst);
        while let Some((candidate, t)) = heap.take() {
            (task.pulse)()?;
            let Some(fresh) = size.insert(task, mesh, t, candidate.at) else { break };
            note(candidate.at);
            heap.scan(mesh, &fresh, worst);
        }
        Ok(())
    }

    /// The greatest candidate of a triangle.
    fn worst(&self, tolerance: f64, corners: [PackedSample; 3]) -> Option<RefinementCandidate> {
        let channels: Vec<ChannelTriangle<'_>> =
            self.channels.iter().map(|channel| channel.over(tolerance, corners)).collect();
        let mut worst: Option<RefinementCandidate> = None;
        for (row, columns) in rows_of(corners) {
            let (low, high) = (*columns.start(), *columns.end());
            if !channels.iter().any(|channel| channel.may_exceed(worst, row, low, high)) {
                continue;
            }
            for col in columns {
                if channels.iter().any(|channel| channel.may_exceed(worst, row, col, col)) {
                    let at = PackedSample::new(col as u32, row as u32);
                    worst = worst.max(candidate(&channels, at));
                }
            }
        }
        worst
    }

    /// A tolerance that these errors meet.
    fn min_tolerance(&self, errors: &[ChannelErrors]) -> f64 {
        let pairs: Vec<_> = self.channels.iter().zip(errors).collect();
        let products = pairs.iter().map(|(channel, errors)| channel.weight * errors.max_error);
        let mut tolerance = products.fold(0.0, f64::max);
        // The product is rounded: divided by the weight again it may be less than the error.
        while !pairs.iter().all(|(c, errors)| errors.max_error <= c.tolerance(tolerance)) {
            tolerance = tolerance.next_up();
        }
        tolerance
    }
}

/// Bytes per sample of `greedy4` without the height.
const GREEDY_BYTES: u64 = 212;

fn check_weight(weight: f64) -> Result<()> {
    if weight.is_normal() && weight > 0.0 {
        return Ok(());
    }
    Err(Error::usage(format!("invalid channel weight {weight}"))
        .remedy("give finite weights above 0"))
}

impl<'a> WeightedChannel<'a> {
    /// The largest difference of values that a tolerance allows.
    fn tolerance(&self, tolerance: f64) -> f64 {
        (tolerance / self.weight).min(f64::MAX)
    }

    /// The channel over one triangle.
    fn over(&'a self, tolerance: f64, corners: [PackedSample; 3]) -> ChannelTriangle<'a> {
        let plane = TrianglePlane::new(&self.grid, corners);
        let prefilter = ChannelSlopeFilter::new(&self.grid, plane.corners());
        let tolerance = self.tolerance(tolerance);
        ChannelTriangle { plane, prefilter, weight: self.weight, tolerance }
    }

    fn measured(&self, corners: &[[PackedSample; 3]]) -> ChannelErrors {
        let (max_error, square_sum) = measure(&self.grid, corners);
        ChannelErrors { max_error, square_sum }
    }
}

/// A channel over one triangle.
struct ChannelTriangle<'a> {
    plane: TrianglePlane<'a>,
    prefilter: ChannelSlopeFilter<'a>,
    weight: f64,
    /// Of this channel, without its weight.
    tolerance: f64,
}

impl ChannelTriangle<'_> {
    /// True if a sample in these columns of a row may be beyond the tolerance, and worse than `worst`.
    #[inline]
    fn may_exceed(
        &self,
        worst: Option<RefinementCandidate>,
        row: i32,
        low: i64,
        high: i64,
    ) -> bool {
        let limit = worst.map_or(self.tolerance, |worst| worst.error / self.weight * (1.0 - 1e-14));
        self.prefilter.may_reach(limit, row, low, high)
    }
}

/// A sample of the triangle as a candidate, if one of its channels is beyond the tolerance.
fn candidate(channels: &[ChannelTriangle<'_>], at: PackedSample) -> Option<RefinementCandidate> {
    let weights = weights_in(channels.first()?.plane.corners(), at);
    let (mut exceeds, mut error) = (false, f64::MIN_POSITIVE);
    for channel in channels {
        let offset = channel.plane.offset_by(weights, at);
        if offset.is_corner() {
            return None;
        }
        exceeds = exceeds || !offset.is_within(channel.tolerance);
        error = error.max(channel.weight * offset.error());
    }
    exceeds.then_some(RefinementCandidate { error, at })
}
