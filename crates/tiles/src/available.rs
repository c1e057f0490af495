//! Tiles of each level as runs of columns by row, so a full rectangle takes memory for its rows only.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use terrane_globe::GlobeTileId;

/// Tiles of a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct LevelSpans {
    /// By row: disjoint runs of columns, first and last.
    rows: BTreeMap<u32, Vec<[u32; 2]>>,
}

/// Tiles of all levels, by level.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct KnownTiles(BTreeMap<u8, LevelSpans>);

impl KnownTiles {
    /// Those of a level.
    pub(super) fn level(&self, level: u8) -> &LevelSpans {
        const NONE: &LevelSpans = &LevelSpans { rows: BTreeMap::new() };
        self.0.get(&level).unwrap_or(NONE)
    }

    /// Adds a tile.
    pub(super) fn insert(&mut self, GlobeTileId { level, x, y }: GlobeTileId) {
        self.0.entry(level).or_default().insert(x, y);
    }

    /// Adds all ancestors of the tiles of a level, and both tiles of level 0, which every client requests.
    pub(super) fn add_above(&mut self, near: u8) {
        for level in (0..near).rev() {
            let below = self.level(level + 1).clone();
            let here = self.0.entry(level).or_default();
            for (y, [first, last]) in below.runs() {
                (first / 2..=last / 2).for_each(|x| here.insert(x, y / 2));
            }
        }
        [0, 1].into_iter().for_each(|x| self.insert(GlobeTileId { level: 0, x, y: 0 }));
    }

    /// Descendants of a tile, `by` levels deeper.
    pub(super) fn below(&self, id: GlobeTileId, by: u8) -> LevelSpans {
        let [columns, rows] = [id.x, id.y].map(|at| [at << by, ((at + 1) << by) - 1]);
        let mut spans = LevelSpans::default();
        for (y, runs) in self.level(id.level + by).rows.range(rows[0]..=rows[1]) {
            let clipped =
                runs.iter().map(|[first, last]| [*first.max(&columns[0]), *last.min(&columns[1])]);
            let inner: Vec<_> = clipped.filter(|[first, last]| first <= last).collect();
            if !inner.is_empty() {
                spans.rows.insert(*y, inner);
            }
        }
        spans
    }

    fn holds(&self, id: GlobeTileId) -> bool {
        self.level(id.level).holds(id.x, id.y)
    }
}

/// Whether a tile belongs to the known tiles and is missing.
pub(super) fn is_missing(id: GlobeTileId, [there, known]: [&KnownTiles; 2]) -> bool {
    known.holds(id) && !there.holds(id)
}

impl LevelSpans {
    /// Adds a tile if it is missing.
    pub(super) fn insert(&mut self, x: u32, y: u32) {
        let runs = self.rows.entry(y).or_default();
        // First run that the column may extend.
        let at = runs.partition_point(|[_, last]| last.saturating_add(1) < x);
        match runs.get_mut(at) {
            Some([first, last]) if *first <= x.saturating_add(1) => {
                (*first, *last) = ((*first).min(x), (*last).max(x));
                let next = runs.get(at + 1).copied();
                if let Some(next) = next.filter(|next| next[0] == runs[at][1] + 1) {
                    runs[at][1] = next[1];
                    runs.remove(at + 1);
                }
            }
            _ => runs.insert(at, [x, x]),
        }
    }

    /// Whether a tile exists.
    pub(super) fn holds(&self, x: u32, y: u32) -> bool {
        let runs = self.rows.get(&y).into_iter().flatten();
        runs.into_iter().any(|[first, last]| (*first..=*last).contains(&x))
    }

    /// Number of tiles.
    pub(super) fn count(&self) -> u64 {
        self.runs().map(|(_, [first, last])| u64::from(last - first) + 1).sum()
    }

    fn runs(&self) -> impl Iterator<Item = (u32, [u32; 2])> {
        self.rows.iter().flat_map(|(y, runs)| runs.iter().map(move |run| (*y, *run)))
    }

    /// Rectangles for clients: runs of a row, merged with identical runs of the next rows.
    pub(super) fn rectangles(&self) -> Value {
        let mut rectangles: Vec<[u32; 4]> = Vec::new();
        // By start and end: the rectangle that includes the previous row.
        let mut open: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for (y, runs) in &self.rows {
            let mut here = BTreeMap::new();
            for run in runs {
                let place = match open.get(run).filter(|place| rectangles[**place][3] + 1 == *y) {
                    Some(place) => *place,
                    None => {
                        rectangles.push([run[0], *y, run[1], *y]);
                        rectangles.len() - 1
                    }
                };
                rectangles[place][3] = *y;
                here.insert(*run, place);
            }
            open = here;
        }
        let rectangles = rectangles.iter().map(
            |[x, y, to_x, to_y]| json!({"startX": x, "startY": y, "endX": to_x, "endY": to_y}),
        );
        rectangles.collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use proptest::prelude::*;

    /// The tiles of rectangles.
    fn tiles(rectangles: &Value) -> Vec<(u32, u32)> {
        let mut found = Vec::new();
        for rect in rectangles.as_array().unwrap() {
            let end = |key: &str| rect[key].as_u64().unwrap() as u32;
            for y in end("startY")..=end("endY") {
                found.extend((end("startX")..=end("endX")).map(|x| (x, y)));
            }
        }
        found.sort_unstable();
        found
    }

    proptest! {
        #[test]
        fn spans_are_sets(put in proptest::collection::vec((0_u32..16, 0_u32..16), 0..200)) {
            let (mut known, mut twin) = (KnownTiles::default(), BTreeSet::new());
            for (x, y) in put {
                known.insert(GlobeTileId { level: 4, x, y });
                twin.insert((x, y));
                prop_assert_eq!(known.level(4).count(), twin.len() as u64);
            }
            let spans = known.level(4);
            prop_assert_eq!(tiles(&spans.rectangles()), twin.iter().copied().collect::<Vec<_>>());
            for (x, y) in (0..17).flat_map(|x| (0..17).map(move |y| (x, y))) {
                prop_assert_eq!(spans.holds(x, y), twin.contains(&(x, y)));
            }
            let within = known.below(GlobeTileId { level: 2, x: 1, y: 2 }, 2);
            let inner = twin.iter().copied().filter(|(x, y)| (x >> 2, y >> 2) == (1, 2));
            prop_assert_eq!(tiles(&within.rectangles()), inner.collect::<Vec<_>>());
            known.add_above(4);
            for level in 1..4 {
                let above: BTreeSet<_> =
                    twin.iter().map(|(x, y)| (x >> (4 - level), y >> (4 - level))).collect();
                prop_assert_eq!(tiles(&known.level(level).rectangles()), Vec::from_iter(above));
            }
            prop_assert_eq!(tiles(&known.level(0).rectangles()), vec![(0, 0), (1, 0)]);
        }
    }

    #[test]
    fn full_rows_are_one_rectangle() {
        let mut spans = LevelSpans::default();
        (0..400).for_each(|i| spans.insert(i * 7 % 20, i / 20));
        assert_eq!(spans.rectangles().as_array().unwrap().len(), 1);
        assert_eq!(spans.rows[&3], [[0, 19]]);
    }
}
