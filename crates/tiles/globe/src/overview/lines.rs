//! Which samples are kept along the borders of tiles, and the heights between them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::{Overview, Plan};
use crate::chart::{Chart, HAIR};
use crate::ground::around;
use terrane_base::geom::{Affine, Rect};

/// Columns or rows by number, and which samples along them are kept: all of them, if it is not said.
pub(super) type Lines = BTreeMap<u32, Option<Vec<u32>>>;

impl Plan {
    /// The lines that have samples kept in a rectangle, and which of those that are kept along each.
    pub(super) fn within(
        &self,
        axis: usize,
        rect: Rect,
    ) -> impl Iterator<Item = (u32, Range<usize>)> {
        let across = [(rect.col, rect.width), (rect.row, rect.height)];
        let ((first, count), (from, along)) = (across[axis], across[1 - axis]);
        self.lines[axis].range(first..first + count).filter_map(move |(line, spots)| {
            let [from, to] = [from, from + along].map(|end| match spots {
                None => end as usize,
                Some(spots) => spots.partition_point(|spot| *spot < end),
            });
            (from < to).then_some((*line, from..to))
        })
    }

    /// Samples that are kept of a line.
    pub(super) fn len(&self, axis: usize, spots: &Option<Vec<u32>>) -> usize {
        spots.as_ref().map_or(self.blocks.whole[1 - axis] as usize, Vec::len)
    }
}

impl Overview {
    /// The height between samples that are kept; `Err` where they are not.
    pub(super) fn kept(&self, [col, row]: [f64; 2]) -> Result<Option<f64>, ()> {
        match self.plan.chart.map() {
            Some(_) => self.on_line([col, row]),
            None => self.on_spots([col, row]),
        }
    }

    /// A sample that is kept, not a number where it is void; `None` where it is not kept.
    pub(super) fn sample(&self, at: [u32; 2]) -> Option<f64> {
        (0..2).find_map(|axis| {
            let (line, along) = (at[axis], at[1 - axis]);
            let heights = self.lines[axis].get(&line)?;
            match self.plan.lines[axis].get(&line)? {
                None => heights.get(along as usize).copied(),
                Some(spots) => spots.binary_search(&along).ok().map(|spot| heights[spot]),
            }
        })
    }

    /// The height between samples of two rows.
    fn on_spots(&self, at: [f64; 2]) -> Result<Option<f64>, ()> {
        let mut sum = 0.0;
        for (at, part) in around(at) {
            sum += part * self.sample(at).ok_or(())?;
        }
        Ok(sum.is_finite().then_some(sum))
    }

    /// The height on a column or row that is kept, between samples along it; `Err` where it is none of them.
    fn on_line(&self, [col, row]: [f64; 2]) -> Result<Option<f64>, ()> {
        for (axis, [across, along]) in [(0, [col, row]), (1, [row, col])] {
            let first = across as u32;
            let part = across - f64::from(first);
            let next = first + u32::from(part > 0.0);
            let [Some(a), Some(b)] = [first, next].map(|at| self.lines[axis].get(&at)) else {
                continue;
            };
            let at = along as usize;
            let down = along - at as f64;
            let below = at + usize::from(down > 0.0);
            let mixed = |line: &[f64]| match down > 0.0 {
                true => line[at] * (1.0 - down) + line[below] * down,
                false => line[at],
            };
            let height = match part > 0.0 {
                true => mixed(a) * (1.0 - part) + mixed(b) * part,
                false => mixed(a),
            };
            return Ok(height.is_finite().then_some(height));
        }
        Err(())
    }
}

/// Columns and rows of a place; a hair beside a sample is on it.
pub(super) fn beside(map: &Affine, place: [f64; 2]) -> [f64; 2] {
    map.invert(place[0], place[1]).map(|at| {
        let near = at.round();
        if (at - near).abs() < HAIR { near } else { at }
    })
}

/// Columns and rows on both sides of meridians and parallels.
pub(super) fn whole(chart: &Chart, lines: [&[f64]; 2]) -> [Lines; 2] {
    let whole = chart.whole();
    [0, 1].map(|axis: usize| {
        let most = f64::from(whole[axis] - 1);
        // Beyond the grid its edges go on.
        let mut found = BTreeSet::from([0, whole[axis] - 1]);
        for line in lines[axis] {
            let Some(map) = chart.map() else { continue };
            let at = match axis {
                0 => map.invert(*line, map.y0)[0],
                _ => map.invert(map.x0, *line)[1],
            };
            if (-1.0..=most + 1.0).contains(&at) {
                // Rounding may put a place on either side of a sample.
                let both = [at - 2.0 * HAIR, at + 2.0 * HAIR].map(f64::floor);
                let both = both.into_iter().flat_map(|at| [at, at + 1.0]);
                found.extend(both.filter(|at| (0.0..=most).contains(at)).map(|at| at as u32));
            }
        }
        found.into_iter().map(|line| (line, None)).collect()
    })
}

/// The samples around meridians and parallels, by row.
pub(super) fn spots(chart: &Chart, lines: [&[f64]; 2]) -> [Lines; 2] {
    let mut found: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let most = chart.whole().map(|count| count - 1);
    for (axis, lines) in lines.into_iter().enumerate() {
        for line in lines {
            let end = |along: f64| if axis == 0 { [*line, along] } else { [along, *line] };
            chart.stops([end(-180.0), end(180.0)], &mut |place| {
                let [col, row] = chart.within(place).at.map(|at| at as u32);
                // Those of the cells on either side, too: the line may go through them to the next place.
                for row in row..=(row + 1).min(most[1]) {
                    let spots = found.entry(row).or_default();
                    // Those along a row come one after the other.
                    for col in col.saturating_sub(1)..=(col + 2).min(most[0]) {
                        if !spots.iter().rev().take(4).any(|spot| *spot == col) {
                            spots.push(col);
                        }
                    }
                }
            });
        }
    }
    let sorted = |(row, mut spots): (u32, Vec<u32>)| {
        spots.sort_unstable();
        spots.dedup();
        (row, Some(spots))
    };
    [BTreeMap::new(), found.into_iter().map(sorted).collect()]
}
