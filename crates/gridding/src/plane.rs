//! What is kept of the points of each cell of a block: one kind of number to a plane.

use bytemuck::{Pod, Zeroable};

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point;

/// What is kept of the points of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Primitive {
    /// How many.
    Count,
    /// Sum of the heights in steps.
    Sum,
    /// Sum of their squares.
    Squares,
    /// Lowest height in steps.
    Low,
    /// Highest height in steps.
    High,
    /// Sums of weights and of weighted heights.
    Weights(Falloff),
    /// Lowest of the heights exactly at the centre.
    Hit,
    /// The point nearest to the centre.
    Nearest,
    /// All heights.
    Values,
}

impl Primitive {
    pub(super) fn bytes_per_cell(self) -> usize {
        match self {
            Self::Count | Self::Low | Self::High | Self::Hit => 4,
            Self::Sum => 8,
            Self::Squares => 16,
            Self::Weights(_) => size_of::<Weighted>(),
            Self::Nearest => size_of::<Near>(),
            Self::Values => 0,
        }
    }

    pub(super) fn bytes_per_point(self) -> usize {
        if self == Self::Values { size_of::<Value>() } else { 0 }
    }
}

/// How weights fall off with distance: they are whole numbers, about 2^24 (radius / distance)^power,
/// so that the rounding of the smallest one, at the radius, is less than 2^-24 of it. None is larger
/// than 2^63, which a distance of less than radius * 2^(-39/power) would take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Falloff {
    unit: f64,
    power: f64,
}

const WEIGHT_AT_RADIUS: f64 = (1 << 24) as f64;

impl Falloff {
    pub(super) fn new(radius: f64, power: f64) -> Self {
        Self { unit: WEIGHT_AT_RADIUS * raised(radius * radius, power), power }
    }

    /// Calls `each` with the weights at the squared distances of `hits`.
    fn weigh(self, hits: Hits<'_>, mut each: impl FnMut(usize, i64)) {
        let weight = |divisor: f64| (self.unit / divisor + 0.5) as i64;
        let area = hits.unit * hits.unit;
        let squares = hits.squares.iter().map(|square| float(*square) * area).enumerate();
        if self.power == 1.0 {
            squares.for_each(|(i, square)| each(i, weight(square.sqrt())));
        } else if self.power == 2.0 {
            squares.for_each(|(i, square)| each(i, weight(square)));
        } else {
            squares.for_each(|(i, square)| each(i, weight(raised(square, self.power))));
        }
    }
}

/// The nearest float; nearly all squares are short, and those are quick.
fn float(square: u128) -> f64 {
    match u64::try_from(square) {
        Ok(short) => short as f64,
        Err(_) => square as f64,
    }
}

/// The root of `square` to the power; from products and roots, which are the same on all machines,
/// where the power is a multiple of a half.
fn raised(square: f64, power: f64) -> f64 {
    if (2.0 * power).fract() != 0.0 {
        return square.powf(power / 2.0);
    }
    let distance = square.sqrt();
    let part = if power.fract() == 0.0 { 1.0 } else { distance.sqrt() };
    (0..power as u32).fold(part, |product, _| product * distance)
}

/// Points and the cells they go into.
#[derive(Clone, Copy, Debug)]
pub struct Hits<'a> {
    /// Places of the cells in the block.
    pub cells: &'a [u32],
    /// The points, one for each cell.
    pub points: &'a [Point],
    /// Their squared distances from the centres of the cells, in units; empty where nothing asks for
    /// them.
    pub squares: &'a [u128],
    /// World size of the unit.
    pub unit: f64,
}

/// Sums of weights.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Weighted {
    weight: u128,
    height: i128,
}

/// The nearest point so far.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Near {
    square: u128,
    point: Point,
    unused: u32,
}

impl Near {
    const NONE: Self =
        Self { square: u128::MAX, point: Point::new(NONE_LOW, NONE_LOW, NONE_LOW), unused: 0 };

    /// The nearer of two, of equally near ones the lowest.
    #[inline]
    fn or(self, other: Self) -> Self {
        let nearer =
            other.square < self.square || (other.square == self.square && other.point < self.point);
        if nearer { other } else { self }
    }
}

/// A height and its cell.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub(super) struct Value {
    cell: u32,
    height: i32,
}

/// Stand for no height: no coordinate is as large.
const NONE_LOW: i32 = i32::MAX;
const NONE_HIGH: i32 = i32::MIN;

/// One kind of number for each cell of a block.
#[derive(Clone, Debug)]
pub(super) enum Plane {
    Count(Vec<u32>),
    Sum(Vec<i64>),
    Squares(Vec<u128>),
    Low(Vec<i32>),
    High(Vec<i32>),
    Weights(Vec<Weighted>, Falloff),
    Hit(Vec<i32>),
    Nearest(Vec<Near>),
    Values(Vec<Value>),
}

impl Plane {
    pub(super) fn new(primitive: Primitive, cells: usize) -> Self {
        match primitive {
            Primitive::Count => Self::Count(vec![0; cells]),
            Primitive::Sum => Self::Sum(vec![0; cells]),
            Primitive::Squares => Self::Squares(vec![0; cells]),
            Primitive::Low => Self::Low(vec![NONE_LOW; cells]),
            Primitive::High => Self::High(vec![NONE_HIGH; cells]),
            Primitive::Weights(falloff) => Self::Weights(vec![Weighted::default(); cells], falloff),
            Primitive::Hit => Self::Hit(vec![NONE_LOW; cells]),
            Primitive::Nearest => Self::Nearest(vec![Near::NONE; cells]),
            Primitive::Values => Self::Values(Vec::new()),
        }
    }

    /// Takes points in.
    pub(super) fn add(&mut self, hits: Hits<'_>) -> Result<()> {
        let each = || hits.cells.iter().map(|cell| *cell as usize).zip(hits.points);
        match self {
            Self::Count(counts) => return count(counts, hits.cells),
            Self::Sum(sums) => each().for_each(|(at, p)| sums[at] += i64::from(p.z)),
            Self::Squares(sums) => each().for_each(|(at, p)| {
                sums[at] += u128::from(i64::from(p.z).unsigned_abs().pow(2));
            }),
            Self::Low(lows) => each().for_each(|(at, p)| lows[at] = lows[at].min(p.z)),
            Self::High(highs) => each().for_each(|(at, p)| highs[at] = highs[at].max(p.z)),
            Self::Weights(sums, falloff) => falloff.weigh(hits, |i, weight| {
                let sum = &mut sums[hits.cells[i] as usize];
                sum.weight += u128::from(weight.unsigned_abs());
                sum.height += i128::from(weight) * i128::from(hits.points[i].z);
            }),
            Self::Hit(lows) => {
                let at_centre = each().zip(hits.squares).filter(|(_, square)| **square == 0);
                at_centre.for_each(|((at, p), _)| lows[at] = lows[at].min(p.z));
            }
            Self::Nearest(nearest) => {
                each().zip(hits.squares).for_each(|((at, &point), &square)| {
                    nearest[at] = nearest[at].or(Near { square, point, unused: 0 });
                })
            }
            Self::Values(values) => {
                let cells = hits.cells.iter().zip(hits.points);
                values.extend(cells.map(|(&cell, point)| Value { cell, height: point.z }));
            }
        }
        Ok(())
    }

    /// Takes in what another plane of the same cells and kind has taken in.
    pub(super) fn fold(&mut self, other: &Self) -> Result<()> {
        match (self, other) {
            (Self::Count(a), Self::Count(b)) => return fold_counts(a, b),
            (Self::Sum(a), Self::Sum(b)) => zipped(a, b, |a, b| *a += b),
            (Self::Squares(a), Self::Squares(b)) => zipped(a, b, |a, b| *a += b),
            (Self::Low(a), Self::Low(b)) | (Self::Hit(a), Self::Hit(b)) => {
                zipped(a, b, |a, b| *a = b.min(*a));
            }
            (Self::High(a), Self::High(b)) => zipped(a, b, |a, b| *a = b.max(*a)),
            (Self::Weights(a, _), Self::Weights(b, _)) => zipped(a, b, |a, b| {
                a.weight += b.weight;
                a.height += b.height;
            }),
            (Self::Nearest(a), Self::Nearest(b)) => zipped(a, b, |a, b| *a = a.or(b)),
            (Self::Values(a), Self::Values(b)) => a.extend_from_slice(b),
            _ => return Err(Error::new(ErrorKind::Internal, "blocks of different recipes")),
        }
        Ok(())
    }

    /// Its content as bytes, for this machine.
    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Self::Count(v) => bytemuck::cast_slice(v),
            Self::Sum(v) => bytemuck::cast_slice(v),
            Self::Squares(v) => bytemuck::cast_slice(v),
            Self::Low(v) | Self::High(v) | Self::Hit(v) => bytemuck::cast_slice(v),
            Self::Weights(v, _) => bytemuck::cast_slice(v),
            Self::Nearest(v) => bytemuck::cast_slice(v),
            Self::Values(v) => bytemuck::cast_slice(v),
        }
    }

    /// The same, `bytes` long, to be overwritten.
    pub(super) fn bytes_mut(&mut self, bytes: usize) -> &mut [u8] {
        match self {
            Self::Count(v) => bytemuck::cast_slice_mut(v),
            Self::Sum(v) => bytemuck::cast_slice_mut(v),
            Self::Squares(v) => bytemuck::cast_slice_mut(v),
            Self::Low(v) | Self::High(v) | Self::Hit(v) => bytemuck::cast_slice_mut(v),
            Self::Weights(v, _) => bytemuck::cast_slice_mut(v),
            Self::Nearest(v) => bytemuck::cast_slice_mut(v),
            Self::Values(v) => {
                v.resize(bytes / size_of::<Value>(), Value::default());
                bytemuck::cast_slice_mut(v)
            }
        }
    }

    /// Bytes it takes in memory.
    pub(super) fn held(&self) -> usize {
        match self {
            Self::Values(values) => values.capacity() * size_of::<Value>(),
            _ => self.bytes().len(),
        }
    }

    /// Puts what is kept of single points in order, cell by cell.
    pub(super) fn settle(&mut self) {
        if let Self::Values(values) = self {
            values.sort_unstable();
        }
    }

    /// How many points cell `at` has.
    pub(super) fn count(&self, at: usize) -> u32 {
        if let Self::Count(counts) = self { counts[at] } else { 0 }
    }

    /// Sum of heights.
    pub(super) fn sum(&self, at: usize) -> i64 {
        if let Self::Sum(sums) = self { sums[at] } else { 0 }
    }

    /// Sum of squared heights.
    pub(super) fn squares(&self, at: usize) -> u128 {
        if let Self::Squares(sums) = self { sums[at] } else { 0 }
    }

    /// A height of one point: the lowest, highest, nearest, or the one at the centre.
    pub(super) fn height(&self, at: usize) -> Option<i32> {
        match self {
            Self::Low(lows) | Self::Hit(lows) => Some(lows[at]).filter(|z| *z != NONE_LOW),
            Self::High(highs) => Some(highs[at]).filter(|z| *z != NONE_HIGH),
            Self::Nearest(near) => Some(near[at].point.z).filter(|z| *z != NONE_LOW),
            _ => None,
        }
    }

    /// The weighted mean of heights, in steps.
    pub(super) fn weighted(&self, at: usize) -> Option<f64> {
        let Self::Weights(sums, _) = self else { return None };
        let Weighted { weight, height } = sums[at];
        (weight > 0).then(|| height as f64 / weight as f64)
    }

    /// The height that `rank` per cent of the heights of a settled cell lie below, in steps: between
    /// the two that the rank falls between, in proportion.
    pub(super) fn percentile(&self, at: usize, rank: f64) -> Option<f64> {
        let Self::Values(values) = self else { return None };
        let first = values.partition_point(|value| (value.cell as usize) < at);
        let cell = &values[first..];
        let cell = &cell[..cell.partition_point(|value| value.cell as usize == at)];
        let place = rank / 100.0 * cell.len().checked_sub(1)? as f64;
        let (low, part) = (place as usize, place.fract());
        let low_height = f64::from(cell.get(low)?.height);
        let high = cell.get(low + 1).map_or(low_height, |value| f64::from(value.height));
        Some(low_height + (high - low_height) * part)
    }
}

/// Counts points; more in one cell than can be counted are an error.
fn count(counts: &mut [u32], cells: &[u32]) -> Result<()> {
    let mut beyond = false;
    for cell in cells {
        let count = &mut counts[*cell as usize];
        let (next, over) = count.overflowing_add(1);
        *count = next;
        beyond |= over;
    }
    if beyond { Err(too_many()) } else { Ok(()) }
}

fn fold_counts(counts: &mut [u32], others: &[u32]) -> Result<()> {
    for (count, other) in counts.iter_mut().zip(others) {
        *count = count.checked_add(*other).ok_or_else(too_many)?;
    }
    Ok(())
}

fn too_many() -> Error {
    Error::limit("number of points in one cell", "above 2^32", u32::MAX)
        .remedy("choose a smaller --cell")
}

fn zipped<T: Copy>(a: &mut [T], b: &[T], join: impl Fn(&mut T, T)) {
    a.iter_mut().zip(b).for_each(|(a, b)| join(a, *b));
}
