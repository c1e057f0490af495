//! Delaunay triangulations on the threads of a job.

use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_delaunay::{ForkJoin, Triangulation};

/// Forks work onto the thread pool that the caller runs in.
#[derive(Clone, Copy, Debug, Default)]
pub struct DelaunayPool;

impl ForkJoin for DelaunayPool {
    fn join<A: Send, B: Send>(
        &self,
        a: impl FnOnce() -> A + Send,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        rayon::join(a, b)
    }
}

/// The Delaunay triangulation of points, on all threads of the pool that the caller runs in. It does
/// not depend on their number.
///
/// # Errors
/// More points than [`Triangulation::new`] takes.
pub fn triangulate(points: &[Point]) -> Result<Triangulation> {
    Triangulation::forked(points, &DelaunayPool)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_leave_no_trace() {
        let point =
            |i: i32| Point::new(i.wrapping_mul(77_777) & 0xFFFFF, i.wrapping_mul(i) & 0xFFFF, i);
        let points: Vec<_> = (0..60_000).map(point).collect();
        let (one, many) = (Triangulation::new(&points).unwrap(), triangulate(&points).unwrap());
        many.validate().unwrap();
        assert!(one.triangles().eq(many.triangles()));
        assert_eq!(one.duplicates(), many.duplicates());
    }
}
