//! Chains of vertices, and their kept vertices.

use terrane_base::error::{Error, Result};
use terrane_base::geom::plane::{LEAST, MOST, Xy};

/// Appends to the last argument, ascending, the kept vertices strictly between two vertices of a chain:
/// `(chain, from, to, kept)`.
pub type Refine<'a> = dyn FnMut(usize, u32, u32, &mut Vec<u32>) + 'a;

/// A method of [`METHODS`](crate::METHODS) as [`Refine`]: `method` appends the kept indices of a slice of
/// `vertices`, first and last included.
pub fn refining<'a, V>(
    vertices: &'a [V],
    mut method: impl FnMut(&[V], &mut Vec<u32>) + 'a,
) -> impl FnMut(usize, u32, u32, &mut Vec<u32>) + 'a {
    let mut indices = Vec::new();
    move |_, from, to, kept| {
        indices.clear();
        method(&vertices[from as usize..=to as usize], &mut indices);
        let last = indices.len().saturating_sub(1);
        kept.extend(indices.iter().take(last).skip(1).map(|i| i + from));
    }
}

/// Lines, rings or arcs: all vertices in one slice, chain after chain.
///
/// A vertex is identified by its index in `points` throughout this module.
#[derive(Clone, Copy, Debug)]
pub struct Chains<'a> {
    /// The vertices of all chains. A closed chain has its first vertex again as its last.
    pub points: &'a [Xy],
    /// First vertex of each chain, and the number of all vertices.
    pub starts: &'a [usize],
    /// Whether each chain is closed.
    pub closed: &'a [bool],
}

impl Chains<'_> {
    /// Number of chains.
    pub fn count(&self) -> usize {
        self.closed.len()
    }

    /// The vertices of a chain.
    pub fn range(&self, chain: usize) -> std::ops::Range<usize> {
        self.starts[chain]..self.starts[chain + 1]
    }

    /// Chain with a segment that starts at vertex `from`.
    pub(super) fn chain_of(&self, from: u32) -> usize {
        // Empty chains share their start with the next one, and the last of equals has the vertices.
        self.starts.partition_point(|&start| start <= from as usize) - 1
    }

    /// The vertices from one to another, both included.
    pub(super) fn piece(&self, from: u32, to: u32) -> &[Xy] {
        &self.points[from as usize..=to as usize]
    }

    /// Checks the assumptions of this module.
    ///
    /// # Errors
    /// `Usage` for invalid starts; `BadInput` for a coordinate that is not finite, beyond [`MOST`] or, unless
    /// 0, below [`LEAST`], and for a closed chain with different ends; `Limit` for 2^32 vertices or more.
    pub fn check(&self) -> Result<()> {
        let n = self.points.len();
        if u32::try_from(n).is_err() {
            return Err(
                Error::limit("the number of vertices", n, u32::MAX).remedy("split the input")
            );
        }
        let ordered = self.starts.windows(2).all(|pair| pair[0] <= pair[1]);
        let whole = self.starts.first() == Some(&0) && self.starts.last() == Some(&n);
        if !ordered || !whole || self.starts.len() != self.closed.len() + 1 {
            return Err(Error::usage("chains are not contiguous"));
        }
        if let Some(at) = self.points.iter().position(|p| !p.iter().all(|v| is_measurable(*v))) {
            return Err(Error::bad_input(format!(
                "position {:?} is not finite, too large or too small",
                self.points[at]
            ))
            .at(format!("vertex {at}"))
            .remedy("remove or repair the vertex"));
        }
        let open = (0..self.count()).find(|&chain| {
            let points = &self.points[self.range(chain)];
            self.closed[chain] && points.first() != points.last()
        });
        match open {
            Some(chain) => Err(Error::bad_input("a ring is not closed")
                .at(format!("ring {chain}"))
                .remedy("repeat its first vertex at the end")),
            None => Ok(()),
        }
    }
}

/// Whether a coordinate is 0 or in the range of exact tests; false for NaN.
fn is_measurable(v: f64) -> bool {
    v == 0.0 || (LEAST..=MOST).contains(&v.abs())
}

/// Kept vertices of each chain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RetainedChainVertices {
    /// Vertex indices, ascending, chain by chain: none of a chain, or at least its first and last vertex.
    pub vertices: Vec<u32>,
    /// Start of each chain in `vertices`, and the total number.
    pub starts: Vec<usize>,
}

impl RetainedChainVertices {
    /// Empty, to be filled with [`RetainedChainVertices::close`].
    pub fn new() -> Self {
        Self { vertices: Vec::new(), starts: vec![0] }
    }

    /// Ends a chain: its vertices were pushed to `vertices` since the last call.
    pub fn close(&mut self) {
        self.starts.push(self.vertices.len());
    }

    /// Kept vertices of every chain by a method as [`Refine`].
    pub fn simplified(chains: &Chains<'_>, method: &mut Refine<'_>) -> Self {
        let mut kept = Self::new();
        for chain in 0..chains.count() {
            let range = chains.range(chain);
            let (first, last) = (range.start as u32, range.end.saturating_sub(1) as u32);
            if !range.is_empty() {
                kept.vertices.push(first);
            }
            if first < last {
                method(chain, first, last, &mut kept.vertices);
                kept.vertices.push(last);
            }
            kept.close();
        }
        kept
    }

    /// Every vertex of every chain.
    pub fn all(chains: &Chains<'_>) -> Self {
        let count = u32::try_from(chains.points.len()).unwrap_or(u32::MAX);
        Self { vertices: (0..count).collect(), starts: chains.starts.to_vec() }
    }

    /// Kept vertices of a chain.
    pub fn of(&self, chain: usize) -> &[u32] {
        &self.vertices[self.starts[chain]..self.starts[chain + 1]]
    }

    /// Fails if it is not a subset of `chains`.
    pub(super) fn check(&self, chains: &Chains<'_>) -> Result<()> {
        let is_aligned = self.starts.len() == chains.starts.len()
            && self.starts.last() == Some(&self.vertices.len())
            && self.starts.windows(2).all(|pair| pair[0] <= pair[1]);
        match is_aligned && (0..chains.count()).all(|chain| self.fits(chain, chains)) {
            true => Ok(()),
            false => Err(Error::usage("the kept vertices are not a subset of the chains")),
        }
    }

    /// Whether the kept vertices of a chain ascend from its first vertex to its last.
    fn fits(&self, chain: usize, chains: &Chains<'_>) -> bool {
        let (kept, range) = (self.of(chain), chains.range(chain));
        kept.windows(2).all(|pair| pair[0] < pair[1])
            && kept.first().is_none_or(|&v| v as usize == range.start)
            && kept.last().is_none_or(|&v| v as usize + 1 == range.end)
    }
}

/// Rotates a closed chain to a vertex that a method for rings keeps, if it drops the first.
pub fn open_at<T: Clone>(ring: &mut [T], at: usize) {
    if let Some(last) = ring.len().checked_sub(1) {
        ring[..last].rotate_left(at);
        ring[last] = ring[0].clone();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_open_anywhere() {
        let mut ring = [1, 2, 3, 4, 1];
        open_at(&mut ring, 2);
        assert_eq!(ring, [3, 4, 1, 2, 3]);
        open_at(&mut ring, 0);
        assert_eq!(ring, [3, 4, 1, 2, 3]);
        open_at::<i32>(&mut [], 0);
    }

    #[test]
    fn bad_chains_are_named() {
        let points = [[0.0, 0.0], [1.0, f64::NAN], [0.0, 1.0]];
        let chains = Chains { points: &points, starts: &[0, 3], closed: &[false] };
        assert!(chains.check().unwrap_err().to_string().contains("vertex 1"));
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let chains = Chains { points: &points, starts: &[0, 3], closed: &[true] };
        assert!(chains.check().unwrap_err().to_string().contains("ring 0"));
        let chains = Chains { points: &points, starts: &[0, 4], closed: &[true] };
        assert!(chains.check().is_err());
    }
}
