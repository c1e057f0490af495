//! Breaklines on a grid: segments from sample to sample that edges follow.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Ends, Paths, SampleSegment, cut};

/// A segment, with the first and last step of its path in a tile.
type Part = (SampleSegment, [u64; 2]);

/// Segments that edges of a mesh follow.
#[derive(Clone, Debug, Default)]
pub struct Breaklines {
    paths: Paths,
    path: Option<PathBuf>,
    /// Segments of the file.
    segments: u64,
    outside: u64,
}

impl Breaklines {
    /// No breaklines.
    pub const NONE: Self = Self { paths: Paths::NONE, path: None, segments: 0, outside: 0 };

    /// Breaklines along lines through positions on the lattice of a grid of `size` columns and rows; `ends` holds the
    /// end index of each line. An end of a segment is the sample nearest to its position, or to its entry into the
    /// grid.
    ///
    /// # Errors
    /// No line on the grid.
    pub fn on(at: &[[f64; 2]], ends: &[u32], size: [u32; 2], path: PathBuf) -> Result<Self> {
        let starts = std::iter::once(0).chain(ends.iter().map(|&end| end as usize));
        let lines = starts.zip(ends).map(|(start, &end)| &at[start..end as usize]);
        let (mut segments, mut count) = (Vec::new(), 0);
        for pair in lines.flat_map(|line| line.windows(2)) {
            count += 1;
            segments.extend(cut([pair[0], pair[1]], size));
        }
        let outside = count - segments.len() as u64;
        if segments.is_empty() {
            return Err(Error::bad_input("no line lies on the grid")
                .in_file(&path)
                .remedy("compare the extents of both with terrane info"));
        }
        Ok(Self { path: Some(path), segments: count, outside, ..Self::of(segments) })
    }

    /// Adds the banks of a water file.
    pub fn and_banks(self, banks: Vec<Ends>, water: &Path) -> Self {
        let (segments, outside) = (self.segments + banks.len() as u64, self.outside);
        let path = match self.path {
            Some(path) => PathBuf::from(format!("{} and {}", path.display(), water.display())),
            None => water.to_path_buf(),
        };
        Self { paths: self.paths.and(banks), path: Some(path), segments, outside }
    }

    /// Breaklines of the given segments, in any order and direction.
    pub fn of(segments: Vec<Ends>) -> Self {
        Self { segments: segments.len() as u64, paths: Paths::of(segments), ..Self::default() }
    }

    /// The paths of all segments.
    pub fn paths(&self) -> &Paths {
        &self.paths
    }

    /// Maximum bytes of lines with `vertices` vertices, including a worker's list.
    pub fn max_bytes(vertices: usize) -> u64 {
        (vertices * (size_of::<Ends>() + size_of::<SampleSegment>() + size_of::<Part>())) as u64
    }

    /// Estimated number of vertices on the lines, slightly high, for a mesh with `vertices` vertices on `samples`
    /// samples without lines (measured: 1.8 per expected crossing, plus the ends).
    pub fn vertices_in(&self, vertices: u64, samples: u64) -> u64 {
        let density = vertices as f64 / samples.max(1) as f64;
        let met = 2.0 * self.paths.steps() as f64 * density.sqrt();
        let most = 2 * self.paths.count() as u64 + met as u64;
        most.min(samples - vertices.min(samples))
    }

    /// The report; `None` if no lines were requested.
    pub fn report(&self, apart: u64) -> Option<BreaklinesReport> {
        (self.segments > 0).then(|| BreaklinesReport {
            file: self.path.as_deref().map_or_else(String::new, |path| path.display().to_string()),
            segments: self.segments,
            outside: self.outside,
            apart,
        })
    }
}

/// Report on breaklines.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BreaklinesReport {
    /// The source file.
    pub file: String,
    /// Segments of lines and rings.
    pub segments: u64,
    /// Segments beyond the grid.
    pub outside: u64,
    /// Vertices at which a line does not continue along an edge.
    pub apart: u64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Rect;

    #[test]
    fn what_lies_outside_is_counted_and_all_of_it_refused() {
        let at = [[0.0, 0.0], [5.0, 0.0], [50.0, 0.0], [60.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
        let lines = Breaklines::on(&at, &[4, 6], [11, 6], "a.wkt".into()).unwrap();
        let told = lines.report(3).unwrap();
        assert_eq!((told.segments, told.outside, told.apart), (4, 1, 3));
        let all: Vec<_> = lines.paths().near(Rect::new(0, 0, 11, 6)).collect();
        let expected = [[[0, 0], [5, 0]], [[5, 0], [10, 0]], [[1, 1], [2, 2]]];
        assert_eq!(all, expected.map(|[a, b]| SampleSegment::new(a, b)));
        let error = Breaklines::on(&at[2..4], &[2], [11, 6], "a.wkt".into()).unwrap_err();
        assert!(error.to_string().contains("no line lies on the grid"), "{error}");
        assert_eq!(Breaklines::NONE.report(0), None);
    }
}
