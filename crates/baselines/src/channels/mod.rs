//! Several channels at once: a photograph becomes coloured triangles, a textured terrain one mesh for its
//! heights and its colours.
//!
//! Greedy insertion as [`greedy4`](crate::greedy) does it, where the error of a sample is the largest over the
//! channels of weight x |value - interpolated value|. Source: Garland & Heckbert, "Fast Polygonal Approximation
//! of Terrains and Height Fields", CMU-CS-95-181 (1995), which approximates colour images as well; the paper adds
//! the errors of the channels up, and a largest one is a promise for each channel by itself. For channel c of
//! weight w the promise of a tolerance E is |difference| <= E / w, the quotient rounded to a double: that number is
//! what is decided exactly, here and by the proof.
//!
//! With one channel of weight 1 this is `greedy4`, vertex by vertex. Channels are doubles, as heights are for all
//! methods here, so that no band has to be refused; at some 200 bytes a sample for the mesh it does not matter.

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

/// Planes of values over the same samples, each with the weight of its errors.
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
    /// The smallest number that no sample is further off than: exact.
    pub max_error: f64,
    /// Sum of the squared errors of the samples of the surface.
    pub square_sum: f64,
}

/// A mesh of several channels.
#[derive(Clone, Debug, PartialEq)]
pub struct MultichannelTin {
    /// Samples that are vertices, in (row, column) order.
    pub vertices: Vec<PackedSample>,
    /// Triangles, counter-clockwise in (column, row) axes, as places in `vertices`.
    pub triangles: Vec<[u32; 3]>,
    /// A tolerance that the mesh keeps, about the smallest there is.
    pub max_error: f64,
    /// The errors of each channel, in their order.
    pub channels: Vec<ChannelErrors>,
    /// Statistics of the samples.
    pub census: SampleStatistics,
}

/// Makes samples that are void in one plane void in all. The planes are of one length.
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
        let channel = |(plane, &weight): (&'a Vec<f64>, &f64)| {
            check_weight(weight)?;
            Ok(WeightedChannel { grid: HeightGrid::new(width, height, plane, None)?, weight })
        };
        let channels: Vec<_> = planes.iter().zip(weights).map(channel).collect::<Result<_>>()?;
        let is_void = |plane: &Vec<f64>, at: usize| plane[at].is_nan();
        let differs = |at: usize| planes.iter().any(|p| is_void(p, at) != is_void(&planes[0], at));
        match (0..planes[0].len()).find(|&at| differs(at)) {
            None => Ok(Self { channels }),
            Some(at) => Err(Error::usage(format!("sample {at} is void in some channels only"))
                .remedy("make it void in all")),
        }
    }

    /// A Delaunay mesh of samples that keeps to `goal`. Time O((m + n) log m) expected for m vertices of n
    /// samples, times the channels.
    ///
    /// # Errors
    /// `BadInput`: no cell has four valid samples. Usage: the coarsest mesh is larger than the goal allows. And
    /// those of `pulse`, which is called now and then.
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

    /// Inserts until nothing is left to do; `note` hears of every vertex in its turn.
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
        while let Some((found, t)) = heap.take() {
            (task.pulse)()?;
            let Some(fresh) = size.insert(task, mesh, t, found.at) else { break };
            note(found.at);
            heap.scan(mesh, &fresh, worst);
        }
        Ok(())
    }

    /// The greatest candidate of a triangle.
    fn worst(&self, tolerance: f64, corners: [PackedSample; 3]) -> Option<RefinementCandidate> {
        let judges: Vec<ChannelTriangle<'_>> =
            self.channels.iter().map(|channel| channel.judge(tolerance, corners)).collect();
        let mut worst: Option<RefinementCandidate> = None;
        for (row, columns) in rows_of(corners) {
            let (low, high) = (*columns.start(), *columns.end());
            let may_be_worse = |judge: &ChannelTriangle<'_>, low, high| {
                judge.sieve.may_reach(judge.limit(worst), row, low, high)
            };
            if !judges.iter().any(|judge| may_be_worse(judge, low, high)) {
                continue;
            }
            for col in columns {
                let may_be_worse = |judge: &ChannelTriangle<'_>| {
                    judge.sieve.may_reach(judge.limit(worst), row, col, col)
                };
                if judges.iter().any(may_be_worse) {
                    worst =
                        worst.max(candidate(&judges, PackedSample::new(col as u32, row as u32)));
                }
            }
        }
        worst
    }

    /// A tolerance that these errors keep.
    fn min_tolerance(&self, errors: &[ChannelErrors]) -> f64 {
        let pairs = || self.channels.iter().zip(errors);
        let keep = |e: f64| pairs().all(|(channel, found)| found.max_error <= channel.tolerance(e));
        let mut least = pairs().map(|(c, found)| c.weight * found.max_error).fold(0.0, f64::max);
        while !keep(least) {
            // The product is rounded: divided by the weight again it may allow less than the error.
            least = least.next_up();
        }
        least
    }
}

/// `greedy4` without a height.
const GREEDY_BYTES: u64 = 212;

fn check_weight(weight: f64) -> Result<()> {
    if weight.is_normal() && weight > 0.0 {
        return Ok(());
    }
    Err(Error::usage(format!("{weight} is no weight of a channel"))
        .remedy("give finite numbers above 0"))
}

impl<'a> WeightedChannel<'a> {
    /// The largest difference of values that a tolerance allows.
    fn tolerance(&self, tolerance: f64) -> f64 {
        (tolerance / self.weight).min(f64::MAX)
    }

    fn judge(&'a self, tolerance: f64, corners: [PackedSample; 3]) -> ChannelTriangle<'a> {
        let plane = TrianglePlane::new(&self.grid, corners);
        let sieve = ChannelSlopeFilter::new(&self.grid, plane.corners());
        ChannelTriangle { plane, sieve, weight: self.weight, most: self.tolerance(tolerance) }
    }

    fn measured(&self, corners: &[[PackedSample; 3]]) -> ChannelErrors {
        let (max_error, square_sum) = measure(&self.grid, corners);
        ChannelErrors { max_error, square_sum }
    }
}

/// A channel over one triangle.
struct ChannelTriangle<'a> {
    plane: TrianglePlane<'a>,
    sieve: ChannelSlopeFilter<'a>,
    weight: f64,
    most: f64,
}

impl ChannelTriangle<'_> {
    /// A sample that is less far off than this in every channel is not beyond the tolerance, or not as far off as
    /// `worst`.
    fn limit(&self, worst: Option<RefinementCandidate>) -> f64 {
        worst.map_or(self.most, |worst| worst.error / self.weight * (1.0 - 1e-14))
    }
}

/// The candidate that a sample of the triangle is, if a channel of it is beyond its tolerance.
fn candidate(judges: &[ChannelTriangle<'_>], at: PackedSample) -> Option<RefinementCandidate> {
    let weights = weights_in(judges.first()?.plane.corners(), at);
    let (mut exceeds, mut error) = (false, f64::MIN_POSITIVE);
    for judge in judges {
        let offset = judge.plane.offset_by(weights, at);
        if offset.is_corner() {
            return None;
        }
        exceeds = exceeds || !offset.is_within(judge.most);
        error = error.max(judge.weight * offset.error());
    }
    exceeds.then_some(RefinementCandidate { error, at })
}
