//! Static packed R-tree of the rectangles of a mosaic. Memory is proportional to the number of rectangles; a
//! query takes O(log n + found) if rectangles overlap little.

use terrane_base::geom::Rect;

/// Children of a node.
const FANOUT: usize = 16;

/// The tree. Level 0 has a box per rectangle, the last level a single box.
pub(super) struct MosaicRTree {
    levels: Vec<Vec<MosaicTreeBox>>,
    /// Rectangle of each box of level 0.
    ids: Vec<u32>,
}

/// Half-open ranges of columns and rows.
#[derive(Clone, Copy)]
struct MosaicTreeBox {
    low: [u32; 2],
    high: [u32; 2],
}

impl MosaicTreeBox {
    fn of(rect: &Rect) -> Self {
        Self { low: [rect.col, rect.row], high: [rect.end_col(), rect.end_row()] }
    }

    fn around(boxes: &[Self]) -> Self {
        let low = [0, 1].map(|i| boxes.iter().map(|b| b.low[i]).min().unwrap_or(0));
        let high = [0, 1].map(|i| boxes.iter().map(|b| b.high[i]).max().unwrap_or(0));
        Self { low, high }
    }

    fn touches(&self, other: &Self) -> bool {
        (0..2).all(|i| self.low[i] < other.high[i] && other.low[i] < self.high[i])
    }

    /// Twice the centre along an axis.
    fn middle(&self, axis: usize) -> u64 {
        u64::from(self.low[axis]) + u64::from(self.high[axis])
    }
}

impl MosaicRTree {
    /// A tree of at most 2^32 rectangles, sorted into bands of rows and by column within a band
    /// (sort-tile-recursive; Leutenegger, Lopez & Edgington 1997).
    pub(super) fn new(rects: &[Rect]) -> Self {
        let bounds: Vec<MosaicTreeBox> = rects.iter().map(MosaicTreeBox::of).collect();
        let mut ids: Vec<u32> = (0..rects.len() as u32).collect();
        ids.sort_unstable_by_key(|id| (bounds[*id as usize].middle(1), *id));
        let leaves = rects.len().div_ceil(FANOUT);
        let band = FANOUT * (leaves as f64).sqrt().ceil().max(1.0) as usize;
        for band in ids.chunks_mut(band) {
            band.sort_unstable_by_key(|id| (bounds[*id as usize].middle(0), *id));
        }
        let mut levels = vec![ids.iter().map(|id| bounds[*id as usize]).collect::<Vec<_>>()];
        while let Some(below) = levels.last().filter(|level| level.len() > 1) {
            levels.push(below.chunks(FANOUT).map(MosaicTreeBox::around).collect());
        }
        Self { levels, ids }
    }

    /// The rectangles that overlap `rect`, in ascending order.
    pub(super) fn find(&self, rect: &Rect) -> Vec<u32> {
        let mut found = Vec::new();
        if rect.is_empty() {
            return found;
        }
        let wanted = MosaicTreeBox::of(rect);
        let mut open: Vec<(usize, usize)> = vec![(self.levels.len() - 1, 0)];
        while let Some((level, at)) = open.pop() {
            if !self.levels[level].get(at).is_some_and(|b| b.touches(&wanted)) {
                continue;
            }
            match level {
                0 => found.push(self.ids[at]),
                _ => open.extend((at * FANOUT..(at + 1) * FANOUT).map(|child| (level - 1, child))),
            }
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn finds_what_a_search_of_all_finds(
            seed in prop::collection::vec((0_u32..300, 0_u32..300, 1_u32..60, 1_u32..60), 0..400),
            window in (0_u32..320, 0_u32..320, 0_u32..80, 0_u32..80),
        ) {
            let rects: Vec<Rect> = seed.iter().map(|s| Rect::new(s.0, s.1, s.2, s.3)).collect();
            let window = Rect::new(window.0, window.1, window.2, window.3);
            let slow: Vec<u32> = (0..rects.len() as u32)
                .filter(|id| !rects[*id as usize].intersect(&window).is_empty())
                .collect();
            prop_assert_eq!(MosaicRTree::new(&rects).find(&window), slow);
        }
    }

    #[test]
    fn a_window_of_many_tiles_looks_at_few_boxes() {
        let tile = |i: u32| Rect::new(i % 320 * 100, i / 320 * 100, 100, 100);
        let index = MosaicRTree::new(&(0..102_400).map(tile).collect::<Vec<_>>());
        assert_eq!(index.find(&Rect::new(1050, 2050, 100, 100)), [6410, 6411, 6730, 6731]);
        assert!(index.levels.len() <= 6);
    }
}
