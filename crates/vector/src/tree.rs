//! Packed R-tree in the layout of FlatGeobuf: root first, leaves last, nodes of sixteen; and Hilbert order,
//! which makes the tree efficient.

/// Number of children of a node.
pub(super) const NODE: usize = 16;

/// x min, y min, x max, y max.
pub(super) type Bounds = [f64; 4];

/// Empty bounding box.
pub(super) const NOTHING: Bounds =
    [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];

/// Union of two bounding boxes.
pub(super) fn around(a: &Bounds, b: &Bounds) -> Bounds {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

/// Number of nodes of each level from the root to the leaves, for `items` (at least one).
pub(super) fn levels(items: u64, node: u64) -> Vec<u64> {
    let mut levels = vec![items];
    let mut left = items;
    loop {
        left = left.div_ceil(node);
        levels.push(left);
        if left <= 1 {
            levels.reverse();
            return levels;
        }
    }
}

/// A tree in memory.
pub(super) struct PackedRTree {
    /// Bounding boxes of all nodes, level by level from the root.
    nodes: Vec<Bounds>,
    /// Index of the first node of each level, and of the end.
    starts: Vec<usize>,
}

impl PackedRTree {
    /// A tree over `items` (at least one) in their order. O(n).
    pub(super) fn new(items: &[Bounds]) -> Self {
        let counts = levels(items.len() as u64, NODE as u64);
        let mut starts = vec![0];
        for count in counts {
            starts.push(starts[starts.len() - 1] + count as usize);
        }
        let mut nodes = vec![NOTHING; starts[starts.len() - 1]];
        let first = starts[starts.len() - 2];
        nodes[first..].copy_from_slice(items);
        for level in (1..starts.len() - 1).rev() {
            let (above, below) = nodes.split_at_mut(starts[level]);
            let children = below[..starts[level + 1] - starts[level]].chunks(NODE);
            for (parent, children) in above[starts[level - 1]..].iter_mut().zip(children) {
                *parent = children.iter().fold(NOTHING, |all, one| around(&all, one));
            }
        }
        Self { nodes, starts }
    }

    /// Each node with the index of its first child, or of the item of a leaf, level by level.
    pub(super) fn nodes(&self) -> impl Iterator<Item = (&Bounds, usize, bool)> {
        let leaves = self.starts[self.starts.len() - 2];
        (0..self.starts.len() - 1).flat_map(move |level| {
            let range = self.starts[level]..self.starts[level + 1];
            range.map(move |node| {
                let within = node - self.starts[level];
                let is_leaf = node >= leaves;
                let to = if is_leaf { within } else { self.starts[level + 1] + within * NODE };
                (&self.nodes[node], to, is_leaf)
            })
        })
    }

    /// The items whose bounding box contains `inner`, in order; returns the number of nodes visited.
    pub(super) fn containing(&self, inner: &Bounds, found: &mut Vec<u32>) -> usize {
        found.clear();
        let mut visited = 0;
        let last = self.starts.len() - 2;
        let mut stack = vec![(0, 0)];
        while let Some((level, node)) = stack.pop() {
            visited += 1;
            if !encloses(&self.nodes[node], inner) {
                continue;
            }
            if level == last {
                found.push((node - self.starts[last]) as u32);
                continue;
            }
            let first = self.starts[level + 1] + (node - self.starts[level]) * NODE;
            let end = (first + NODE).min(self.starts[level + 2]);
            // Backwards onto the stack, so that items come off it in order.
            stack.extend((first..end).rev().map(|child| (level + 1, child)));
        }
        visited
    }
}

#[inline]
fn encloses(outer: &Bounds, inner: &Bounds) -> bool {
    outer[0] <= inner[0] && outer[1] <= inner[1] && outer[2] >= inner[2] && outer[3] >= inner[3]
}

/// The items sorted by their centres along a Hilbert curve over a grid of 2^16 x 2^16 cells of `extent`; ties
/// keep their order. O(n log n).
pub(super) fn hilbert_order(items: &[Bounds], extent: &Bounds) -> Vec<u32> {
    let keys = items.iter().map(|item| {
        let [x, y] = [0, 1].map(|axis| {
            let centre = (item[axis] + item[axis + 2]) / 2.0;
            let cell = (centre - extent[axis]) / (extent[axis + 2] - extent[axis]) * 65535.0;
            // NaN of an extent of zero width becomes 0.
            cell as u16
        });
        hilbert(x, y)
    });
    let mut order: Vec<(u32, u32)> = keys.zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, item)| item).collect()
}

/// Index of a cell along the Hilbert curve (Hilbert 1891), quadrant by quadrant.
fn hilbert(x: u16, y: u16) -> u32 {
    let (mut x, mut y, mut place) = (u32::from(x), u32::from(y), 0);
    for bit in (0..16).rev() {
        let side = 1 << bit;
        let (right, up) = (u32::from(x & side > 0), u32::from(y & side > 0));
        place += side * side * ((3 * right) ^ up);
        if up == 0 {
            if right == 1 {
                (x, y) = (0xffff - x, 0xffff - y);
            }
            (x, y) = (y, x);
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn boxes() -> impl Strategy<Value = Vec<Bounds>> {
        let one = (0.0..100.0, 0.0..100.0, 0.0..30.0, 0.0..30.0);
        let one = one.prop_map(|(x, y, w, h): (f64, f64, f64, f64)| [x, y, x + w, y + h]);
        prop::collection::vec(one, 1..700)
    }

    proptest! {
        #[test]
        fn finds_what_a_look_at_each_finds(boxes in boxes(), x in 0.0..130.0, y in 0.0..130.0) {
            let tree = PackedRTree::new(&boxes);
            let wanted = [x, y, x + 1.0, y + 1.0];
            let mut found = Vec::new();
            tree.containing(&wanted, &mut found);
            let holds = |b: &Bounds| b[0] <= x && b[1] <= y && b[2] >= x + 1.0 && b[3] >= y + 1.0;
            let each = (0..).zip(&boxes).filter(|(_, b)| holds(b)).map(|(i, _)| i);
            prop_assert_eq!(found, each.collect::<Vec<u32>>());
            let total: u64 = levels(boxes.len() as u64, NODE as u64).iter().sum();
            prop_assert_eq!(tree.nodes().count() as u64, total);
        }
    }

    #[test]
    fn the_curve_visits_neighbours() {
        let mut squares: Vec<(u32, u16, u16)> =
            (0..64).flat_map(|x| (0..64).map(move |y| (hilbert(x, y), x, y))).collect();
        squares.sort_unstable();
        for (at, pair) in squares.windows(2).enumerate() {
            let steps = pair[0].1.abs_diff(pair[1].1) + pair[0].2.abs_diff(pair[1].2);
            assert!(steps == 1 && pair[0].0 as usize == at, "{pair:?}");
        }
    }

    #[test]
    fn the_levels_are_those_of_the_format() {
        assert_eq!(levels(1, 16), [1, 1]);
        assert_eq!(levels(16, 16), [1, 16]);
        assert_eq!(levels(17, 16), [1, 2, 17]);
        assert_eq!(hilbert_order(&[[1.0; 4], [1.0; 4]], &[1.0; 4]), [0, 1]);
    }
}
