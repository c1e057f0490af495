//! Percentiles, from all heights.

use bytemuck::{Pod, Zeroable};

use super::{Method, Of, Statistic};
use crate::block::Cell;
use crate::plane::{Hits, Plane, Primitive, like};
use terrane_base::error::{Error, Result};

const ALL: Primitive = Primitive {
    name: "values",
    parameters: [0.0; 2],
    make: |_, _| Box::new(Heights(Vec::new())),
    bytes_per_cell: 0,
    bytes_per_point: size_of::<Value>(),
};

const OF: Of = Of::Points { needs: |_, rules| (rules.own(), vec![ALL]), value };

pub(super) const MEDIAN: Method = Method {
    name: "median",
    about: "median height, the same as p50",
    ranks: true,
    check: |_| Ok([Some(50.0), None]),
    of: OF,
    ..Method::HEIGHT
};

pub(super) const PERCENTILE: Method = Method {
    // N is the rank.
    name: "pN",
    about: "percentile, such as p95 or p99.9, interpolated between neighbours",
    ranks: true,
    check: |given| match given.rank {
        Some(rank) if (0.0..=100.0).contains(&rank) => Ok([Some(rank), None]),
        _ => Err(Error::usage("a percentile is p0 to p100")),
    },
    of: OF,
    ..Method::HEIGHT
};

fn value(statistic: &Statistic, cell: &Cell<'_>) -> f64 {
    cell.height(
        statistic.rank().and_then(|rank| cell.plane::<Heights>(0)?.percentile(cell.at, rank)),
    )
}

/// A height and its cell.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
struct Value {
    cell: u32,
    height: i32,
}

/// All heights of all cells.
#[derive(Debug)]
struct Heights(Vec<Value>);

impl Plane for Heights {
    fn add(&mut self, hits: Hits<'_>) -> Result<()> {
        let cells = hits.cells.iter().zip(hits.points);
        self.0.extend(cells.map(|(&cell, point)| Value { cell, height: point.z }));
        Ok(())
    }

    fn fold(&mut self, other: &dyn Plane) -> Result<()> {
        self.0.extend_from_slice(&like::<Self>(other)?.0);
        Ok(())
    }

    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }

    fn bytes_mut(&mut self, bytes: usize) -> &mut [u8] {
        self.0.resize(bytes / size_of::<Value>(), Value::default());
        bytemuck::cast_slice_mut(&mut self.0)
    }

    fn held(&self) -> usize {
        self.0.capacity() * size_of::<Value>()
    }

    fn settle(&mut self) {
        self.0.sort_unstable();
    }
}

impl Heights {
    /// The height that `rank` per cent of the heights of a settled cell lie below, in steps: between
    /// the two that the rank falls between, in proportion.
    fn percentile(&self, at: usize, rank: f64) -> Option<f64> {
        let Self(values) = self;
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
