//! Vertices that wait to be written: in memory, and beyond its share in an unnamed file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::budget::VERTEX_BYTES;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_contour::{Edge, Vertex};
use terrane_files::fault::{self, Point};

/// Vertices, addressed in the order of their arrival.
pub(super) struct Spool {
    folder: PathBuf,
    /// Most vertices in memory.
    most: u64,
    file: Option<File>,
    /// Vertices in the file.
    filed: u64,
    /// Those after them.
    kept: Vec<Vertex>,
}

impl Spool {
    /// `most` vertices are kept in memory; the file is made in `folder` when there are more.
    pub(super) fn new(most: u64, folder: &Path) -> Self {
        Self { folder: folder.to_path_buf(), most, file: None, filed: 0, kept: Vec::new() }
    }

    /// Appends vertices, and gives their address.
    pub(super) fn append(&mut self, vertices: &[Vertex]) -> Result<u64> {
        // Growing by doubling takes up to three times what there is.
        if 3 * (self.kept.len() + vertices.len()) as u64 > self.most && !self.kept.is_empty() {
            self.spill().map_err(|e| self.failure("write to the temporary file", e))?;
        }
        let at = self.filed + self.kept.len() as u64;
        self.kept.extend_from_slice(vertices);
        Ok(at)
    }

    fn spill(&mut self) -> io::Result<()> {
        fault::point(Point::Write)?;
        let mut file = match self.file.take() {
            Some(file) => file,
            None => tempfile::tempfile_in(&self.folder)?,
        };
        file.write_all(bytemuck::cast_slice(&self.kept))?;
        self.file = Some(file);
        self.filed += self.kept.len() as u64;
        self.kept.clear();
        Ok(())
    }

    /// Appends `count` vertices from address `at` to `vertices`. They were appended together, so they
    /// are all in the file or all in memory.
    pub(super) fn read(&mut self, at: u64, count: u32, vertices: &mut Vec<Vertex>) -> Result<()> {
        if at >= self.filed {
            let from = (at - self.filed) as usize;
            vertices.extend_from_slice(&self.kept[from..from + count as usize]);
            return Ok(());
        }
        let start = vertices.len();
        let none = Vertex { edge: Edge::new(0, 0, false, 0), at: 0.0 };
        vertices.resize(start + count as usize, none);
        let bytes = bytemuck::cast_slice_mut(&mut vertices[start..]);
        let read = read_at(self.file.as_mut(), at * VERTEX_BYTES, bytes);
        read.map_err(|e| self.failure("read back the temporary file", e))
    }

    /// Bytes in the file.
    pub(super) fn spilled(&self) -> u64 {
        self.filed * VERTEX_BYTES
    }

    fn failure(&self, action: &str, source: io::Error) -> Error {
        Error::io(ErrorKind::Io, action, source)
            .in_file(&self.folder)
            .remedy("choose another folder with --temp-dir or allow more --memory")
    }
}

fn read_at(file: Option<&mut File>, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
    fault::point(Point::Read)?;
    let file = file.ok_or(io::ErrorKind::NotFound)?;
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertices(first: u32, count: u32) -> Vec<Vertex> {
        let one = |i| Vertex { edge: Edge::new(i, 0, false, 1000), at: 0.25 };
        (first..first + count).map(one).collect()
    }

    #[test]
    fn what_was_appended_comes_back_from_memory_and_file() {
        for most in [0, 30, 1000] {
            let folder = tempfile::tempdir().unwrap();
            let mut spool = Spool::new(most, folder.path());
            let runs: Vec<_> = (0..20).map(|i| vertices(i * 10, 3 + i)).collect();
            let at: Vec<u64> = runs.iter().map(|run| spool.append(run).unwrap()).collect();
            assert_eq!(spool.spilled() > 0, most < 1000, "{most}");
            for (run, &at) in runs.iter().zip(&at).rev() {
                let mut found = vertices(7, 1);
                spool.read(at, run.len() as u32, &mut found).unwrap();
                assert_eq!(found[1..], run[..], "{most}");
            }
        }
    }

    #[test]
    fn a_missing_folder_is_an_error_with_a_remedy() {
        let mut spool = Spool::new(0, Path::new("/nonexistent/terrane"));
        let told = [0, 1].map(|_| spool.append(&vertices(0, 9)));
        let error = told.into_iter().find_map(Result::err).unwrap();
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.to_string().contains("--temp-dir"));
    }
}
