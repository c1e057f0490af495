//! Records into one file: packed in chunks on all threads, appended in order.

use rayon::prelude::*;

use terrane_base::error::Result;
use terrane_cloud::write::{CHUNK, CloudWriter};

/// A file being written, with the records of incomplete chunks.
pub(crate) struct RecordPacker<'a> {
    writer: &'a mut CloudWriter,
    pending: Vec<u8>,
    /// Bytes of a chunk.
    chunk: usize,
    /// Chunks that are packed together.
    together: usize,
}

impl<'a> RecordPacker<'a> {
    /// Packs `together` chunks of a file at a time.
    pub(crate) fn new(writer: &'a mut CloudWriter, together: usize) -> Self {
        let chunk = CHUNK * writer.layout().size();
        Self { writer, pending: Vec::new(), chunk, together: together.max(1) }
    }

    /// Takes the next records.
    pub(crate) fn take(&mut self, mut records: &[u8]) -> Result<()> {
        let full = self.chunk * self.together;
        while !records.is_empty() {
            let (now, later) = records.split_at(records.len().min(full - self.pending.len()));
            self.pending.extend_from_slice(now);
            records = later;
            if self.pending.len() == full {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<()> {
        let layout = self.writer.layout();
        let chunks =
            self.pending.par_chunks(self.chunk).map(|records| layout.pack(records.to_vec()));
        let chunks: Vec<_> = chunks.collect::<Result<_>>()?;
        self.pending.clear();
        chunks.iter().try_for_each(|chunk| self.writer.append(chunk))
    }

    /// Appends the records that are left.
    pub(crate) fn finish(mut self) -> Result<()> {
        self.flush()
    }
}
