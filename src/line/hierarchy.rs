//! Ramer-Douglas-Peucker for every tolerance at once.
//!
//! One run down to zero gives a binary tree of splits. The distance at which a vertex appears is the
//! smaller of its own and its parent's, so the vertices kept at a tolerance are those with a larger
//! distance; that is what a direct run keeps, as it reaches a vertex only through its parents. Nodes are
//! stored in the order in which they appear, so a tolerance, or a number of vertices, is a length of that
//! list, and walking that part of the tree from left to right gives the indices in order: time linear
//! in the output, memory touched in proportion to it. 20 bytes a vertex.

use super::metric::Metric;
use super::rdp::Splits;
use crate::error::{Error, Result};

/// No node.
const NONE: u32 = u32::MAX;

/// What a stored hierarchy begins with.
const MAGIC: [u8; 8] = *b"TRNLINH1";

/// Bytes before the nodes: magic, number of vertices, number of nodes, checksum.
const HEADER: usize = 8 + 4 + 4 + 8;

/// Bytes of a node.
const NODE: usize = 8 + 4 + 4 + 4;

/// The splits of a line, in the order in which they appear as the tolerance falls.
#[derive(Clone, Debug, PartialEq)]
pub struct Hierarchy {
    /// Vertices of the line.
    count: u32,
    /// Squared distances, falling.
    squares: Vec<f64>,
    links: Vec<Link>,
}

/// Where a node is, and the nodes below it: their vertices lie before and after its own.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Link {
    vertex: u32,
    before: u32,
    after: u32,
}

/// A split as it is found, parents first.
struct Split {
    square: f64,
    link: Link,
}

/// A part of the line to be split.
struct Part {
    start: u32,
    end: u32,
    parent: u32,
    is_after: bool,
}

impl Hierarchy {
    /// The hierarchy of a line. O(n log n) as [`super::rdp::rdp`].
    pub fn new<V: Copy, M: Metric<V>>(metric: &M, points: &[V]) -> Self {
        let count = points.len() as u32;
        let splits = splits(metric, points);
        let mut order: Vec<u32> = (0..splits.len() as u32).collect();
        // Stable, so parents stay before their children.
        order.sort_by(|a, b| splits[*b as usize].square.total_cmp(&splits[*a as usize].square));
        let mut places = vec![0; splits.len()];
        for (place, split) in order.iter().enumerate() {
            places[*split as usize] = place as u32;
        }
        let place = |node: u32| if node == NONE { NONE } else { places[node as usize] };
        let link = |split: &u32| {
            let link = splits[*split as usize].link;
            Link { vertex: link.vertex, before: place(link.before), after: place(link.after) }
        };
        let squares = order.iter().map(|split| splits[*split as usize].square).collect();
        Self { count, squares, links: order.iter().map(link).collect() }
    }

    /// Vertices of the line.
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// Appends the vertices that [`super::rdp::rdp`] keeps at `tolerance`. Linear in their number.
    pub fn filter(&self, tolerance: f64, kept: &mut Vec<u32>) {
        let square = tolerance * tolerance;
        self.walk(self.squares.partition_point(|own| *own > square), kept);
    }

    /// Appends the `count` vertices that appear first, at least the two ends; fewer where the others lie
    /// on their segments. Linear in their number.
    pub fn keep_count(&self, count: usize, kept: &mut Vec<u32>) {
        self.walk(count.saturating_sub(2).min(self.links.len()), kept);
    }

    /// A tolerance at which no more than `count` vertices are kept (or the two ends, if `count` is less):
    /// the smallest, but for rounding.
    pub fn tolerance_for(&self, count: usize) -> f64 {
        self.squares.get(count.saturating_sub(2)).map_or(0.0, |square| square.sqrt().next_up())
    }

    /// Distances at which the inner vertices appear, falling: as many as there are vertices off their
    /// segments.
    pub fn distances(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.squares.iter().map(|square| square.sqrt())
    }

    /// The first `length` nodes from left to right, between the ends of the line.
    fn walk(&self, length: usize, kept: &mut Vec<u32>) {
        let length = length as u32;
        kept.extend((self.count > 0).then_some(0));
        kept.reserve(length as usize + 1);
        let mut above = Vec::new();
        let mut node = 0;
        loop {
            while node < length {
                above.push(node);
                node = self.links[node as usize].before;
            }
            let Some(next) = above.pop() else { break };
            let link = self.links[next as usize];
            kept.push(link.vertex);
            node = link.after;
        }
        kept.extend((self.count > 1).then(|| self.count - 1));
    }

    /// The hierarchy as bytes, little-endian: a header with a checksum, squared distances, links.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER + NODE * self.links.len());
        bytes.extend(MAGIC);
        bytes.extend(self.count.to_le_bytes());
        bytes.extend((self.links.len() as u32).to_le_bytes());
        bytes.extend([0; 8]);
        self.squares.iter().for_each(|square| bytes.extend(square.to_le_bytes()));
        for link in &self.links {
            let fields = [link.vertex, link.before, link.after];
            fields.iter().for_each(|field| bytes.extend(field.to_le_bytes()));
        }
        let sum = checksum(&bytes);
        bytes[HEADER - 8..HEADER].copy_from_slice(&sum.to_le_bytes());
        bytes
    }

    /// A hierarchy from its bytes.
    ///
    /// # Errors
    /// When they are not those of a hierarchy: another beginning or length, another checksum, or nodes that
    /// are no tree of splits. Nothing is allocated before the length is known to be right.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let (count, nodes) = header(bytes)?;
        let body = &bytes[HEADER..];
        let (squares, links) = body.split_at(8 * nodes);
        let eight = |field: &[u8]| field.try_into().map(f64::from_le_bytes).unwrap_or(f64::NAN);
        let four = |field: &[u8]| field.try_into().map(u32::from_le_bytes).unwrap_or(NONE);
        let link =
            |f: &[u8]| Link { vertex: four(&f[..4]), before: four(&f[4..8]), after: four(&f[8..]) };
        let hierarchy = Self {
            count,
            squares: squares.chunks_exact(8).map(eight).collect(),
            links: links.chunks_exact(12).map(link).collect(),
        };
        match hierarchy.is_sound() {
            true => Ok(hierarchy),
            false => Err(damaged("its splits are not in order")),
        }
    }

    /// True when distances fall, children follow their parents, each node is below one other, and all
    /// vertices come out in order.
    fn is_sound(&self) -> bool {
        let is_distance = |square: &f64| square.is_finite() && *square > 0.0;
        let is_falling = self.squares.is_sorted_by(|a, b| a >= b);
        if !self.squares.iter().all(is_distance) || !is_falling {
            return false;
        }
        let nodes = self.links.len();
        let mut has_parent = vec![false; nodes];
        for (i, link) in self.links.iter().enumerate() {
            for child in [link.before, link.after].into_iter().filter(|child| *child != NONE) {
                let child = child as usize;
                if child <= i || child >= nodes || std::mem::replace(&mut has_parent[child], true) {
                    return false;
                }
            }
        }
        let mut kept = Vec::new();
        self.walk(nodes, &mut kept);
        let ends = (self.count as usize).min(2);
        kept.len() == nodes + ends && kept.is_sorted_by(|a, b| a < b)
    }
}

/// All splits of a line, each after its parent.
fn splits<V: Copy, M: Metric<V>>(metric: &M, points: &[V]) -> Vec<Split> {
    let mut splits: Vec<Split> = Vec::new();
    if points.len() < 3 {
        return splits;
    }
    let mut finder = Splits::new(metric, points);
    let whole = Part { start: 0, end: points.len() as u32 - 1, parent: NONE, is_after: false };
    let mut parts = vec![whole];
    while let Some(part) = parts.pop() {
        let (start, end) = (part.start as usize, part.end as usize);
        let Some((vertex, square)) = finder.split(start, end, 0.0) else {
            continue;
        };
        let (node, vertex) = (splits.len() as u32, vertex as u32);
        let mut most = f64::INFINITY;
        if let Some(parent) = splits.get_mut(part.parent as usize) {
            most = parent.square;
            match part.is_after {
                true => parent.link.after = node,
                false => parent.link.before = node,
            }
        }
        let link = Link { vertex, before: NONE, after: NONE };
        splits.push(Split { square: square.min(most), link });
        parts.push(Part { start: vertex, parent: node, is_after: true, ..part });
        parts.push(Part { end: vertex, parent: node, is_after: false, ..part });
    }
    splits
}

/// Number of vertices and of nodes, once magic, length and checksum are right.
fn header(bytes: &[u8]) -> Result<(u32, usize)> {
    if bytes.len() < HEADER || bytes[..8] != MAGIC {
        return Err(damaged("it does not begin like one"));
    }
    let word = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
    let (count, nodes) = (word(8), word(12));
    let length = HEADER as u64 + NODE as u64 * u64::from(nodes);
    if bytes.len() as u64 != length || nodes > count.saturating_sub(2) {
        return Err(damaged("its length is not the one it states"));
    }
    let stored = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| bytes[HEADER - 8 + i]);
    match checksum(bytes) == u64::from_le_bytes(stored) {
        true => Ok((count, nodes as usize)),
        false => Err(damaged("its checksum differs")),
    }
}

fn damaged(why: &str) -> Error {
    Error::bad_input(format!("not a hierarchy of a line: {why}"))
        .remedy("make the hierarchy again from the line")
}

/// FNV-1a, by words of eight bytes, of all but the checksum itself.
fn checksum(bytes: &[u8]) -> u64 {
    let mut sum = 0xCBF2_9CE4_8422_2325_u64;
    let mut add = |chunk: &[u8]| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        sum = (sum ^ u64::from_le_bytes(word)).wrapping_mul(0x0000_0100_0000_01B3);
        sum ^= sum >> 32;
    };
    bytes[..HEADER - 8].chunks(8).for_each(&mut add);
    bytes[HEADER..].chunks(8).for_each(&mut add);
    sum
}
