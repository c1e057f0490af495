//! Samples kept along the borders of tiles.

use std::collections::{BTreeMap, BTreeSet};

use crate::georeference::{GridGeolocation, HAIR};
use terrane_base::geom::Affine;

/// Columns or rows by number, with the kept samples along them: all by default.
pub(super) type Lines = BTreeMap<u32, Option<Vec<u32>>>;

/// Columns and rows of a position, snapped to samples within the tolerance.
pub(super) fn snapped(map: &Affine, place: [f64; 2]) -> [f64; 2] {
    map.invert(place[0], place[1]).map(|at| {
        let near = at.round();
        if (at - near).abs() < HAIR { near } else { at }
    })
}

/// Columns and rows on both sides of meridians and parallels.
pub(super) fn whole_lines(chart: &GridGeolocation, lines: [&[f64]; 2]) -> [Lines; 2] {
    let size = chart.size();
    [0, 1].map(|axis: usize| {
        let last = f64::from(size[axis] - 1);
        // Edges of the grid continue beyond it.
        let mut numbers = BTreeSet::from([0, size[axis] - 1]);
        for line in lines[axis] {
            let Some(map) = chart.map() else { continue };
            let at = match axis {
                0 => map.invert(*line, map.y0)[0],
                _ => map.invert(map.x0, *line)[1],
            };
            if (-1.0..=last + 1.0).contains(&at) {
                // Rounding may put a place on either side of a sample.
                let both = [at - 2.0 * HAIR, at + 2.0 * HAIR].map(f64::floor);
                let both = both.into_iter().flat_map(|at| [at, at + 1.0]);
                numbers.extend(both.filter(|at| (0.0..=last).contains(at)).map(|at| at as u32));
            }
        }
        numbers.into_iter().map(|line| (line, None)).collect()
    })
}

/// Samples around meridians and parallels, by row.
pub(super) fn spots(chart: &GridGeolocation, lines: [&[f64]; 2]) -> [Lines; 2] {
    let mut rows: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let last = chart.size().map(|count| count - 1);
    for (axis, lines) in lines.into_iter().enumerate() {
        for line in lines {
            let ends = [-180.0, 180.0]
                .map(|along| if axis == 0 { [*line, along] } else { [along, *line] });
            chart.stops(ends, &mut |place| {
                let [col, row] = chart.within(place).at.map(|at| at as u32);
                // Includes the cells on either side: the line may pass through them to the next position.
                for row in row..=(row + 1).min(last[1]) {
                    let spots = rows.entry(row).or_default();
                    // Samples along a row are consecutive.
                    for col in col.saturating_sub(1)..=(col + 2).min(last[0]) {
                        if !spots.iter().rev().take(4).any(|spot| *spot == col) {
                            spots.push(col);
                        }
                    }
                }
            });
        }
    }
    for spots in rows.values_mut() {
        spots.sort_unstable();
        spots.dedup();
    }
    [BTreeMap::new(), rows.into_iter().map(|(row, spots)| (row, Some(spots))).collect()]
}
