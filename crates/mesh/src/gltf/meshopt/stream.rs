//! Random access to compressed streams: positions between blocks are recorded in bounded memory, and positions where
//! reading ended, as it mostly continues there.

use std::sync::Mutex;

use crate::input::MeshFile;
use terrane_base::error::Result;
use terrane_files::lock;

/// Maximum recorded positions of a stream.
const MAX_MARKS: u64 = 1 << 12;
/// Maximum recorded ends of reading.
const MAX_ENDS: usize = 16;
/// Bytes read at a time.
const WINDOW_BYTES: u64 = 64 << 10;

/// A codec that decodes a fixed number of elements per step; the last step may have fewer.
pub(crate) trait MeshoptCodec {
    /// Decoder state between two steps.
    type Place: Clone;

    /// State before the first element.
    fn start(&self) -> Self::Place;

    /// Index of the next element.
    fn index(&self, place: &Self::Place) -> u64;

    /// Total number of elements.
    fn count(&self) -> u64;

    /// Elements per step.
    fn step_elements(&self) -> u64;

    /// Bytes of an element.
    fn element_bytes(&self) -> usize;

    /// Decodes the next elements; there is at least one.
    fn step(
        &self,
        place: &mut Self::Place,
        window: &mut MeshoptWindow<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()>;
}

/// A stream and its recorded positions.
pub(crate) struct MeshoptStream<C: MeshoptCodec> {
    codec: C,
    known: Mutex<MeshoptCheckpoints<C::Place>>,
    /// Steps between recorded positions.
    stride: u64,
}

struct MeshoptCheckpoints<P> {
    marks: Vec<Option<P>>,
    ends: Vec<P>,
}

impl<C: MeshoptCodec> MeshoptStream<C> {
    pub(crate) fn new(codec: C) -> Self {
        Self::with_marks(codec, MAX_MARKS)
    }

    pub(super) fn with_marks(codec: C, max_marks: u64) -> Self {
        let steps = codec.count().div_ceil(codec.step_elements());
        let stride = steps.div_ceil(max_marks).max(1);
        Self {
            codec,
            known: Mutex::new(MeshoptCheckpoints { marks: Vec::new(), ends: Vec::new() }),
            stride,
        }
    }

    /// Passes the bytes of elements `first .. first + count` to `each`, numbered from 0; the elements must exist.
    pub(crate) fn read(
        &self,
        input: &MeshFile,
        first: u64,
        count: usize,
        mut each: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let (codec, end) = (&self.codec, first + count as u64);
        let mut window = MeshoptWindow::new(input);
        let mut place = self.before(first);
        let mut elements = Vec::new();
        // The next reader will probably begin here.
        let mut resume = place.clone();
        while codec.index(&place) < end {
            resume.clone_from(&place);
            let from = codec.index(&place);
            self.remember(&place);
            codec
                .step(&mut place, &mut window, &mut elements)
                .map_err(|e| e.in_file(input.path()))?;
            for (index, element) in (from..).zip(elements.chunks_exact(codec.element_bytes())) {
                if (first..end).contains(&index) {
                    each((index - first) as usize, element).map_err(|e| e.in_file(input.path()))?;
                }
            }
        }
        let resume = if codec.index(&place) == end { place } else { resume };
        let ends = &mut lock(&self.known).ends;
        if ends.len() == MAX_ENDS {
            ends.remove(0);
        }
        ends.push(resume);
        Ok(())
    }

    /// The last recorded position at or before an element.
    fn before(&self, element: u64) -> C::Place {
        let known = lock(&self.known);
        let at = (element / self.codec.step_elements() / self.stride) as usize;
        let marks = &known.marks[..known.marks.len().min(at + 1)];
        let mark = marks.iter().rev().flatten().next();
        let usable =
            mark.into_iter().chain(&known.ends).filter(|place| self.codec.index(place) <= element);
        let best = usable.max_by_key(|place| self.codec.index(place));
        best.cloned().unwrap_or_else(|| self.codec.start())
    }

    fn remember(&self, place: &C::Place) {
        let step = self.codec.index(place) / self.codec.step_elements();
        if !step.is_multiple_of(self.stride) {
            return;
        }
        let at = (step / self.stride) as usize;
        let marks = &mut lock(&self.known).marks;
        if marks.len() <= at {
            marks.resize(at + 1, None);
        }
        marks[at].get_or_insert_with(|| place.clone());
    }
}

/// Windows of a file for sequential reading at one or two places in turn.
pub(crate) struct MeshoptWindow<'a> {
    input: &'a MeshFile,
    parts: [(u64, Vec<u8>); 2],
    /// The window used last.
    latest: usize,
}

impl<'a> MeshoptWindow<'a> {
    pub(crate) fn new(input: &'a MeshFile) -> Self {
        Self { input, parts: [(0, Vec::new()), (0, Vec::new())], latest: 0 }
    }

    /// `count` bytes from `offset`, fewer than a window and inside the file.
    pub(crate) fn bytes(&mut self, offset: u64, count: usize) -> Result<&[u8]> {
        let loaded = self.parts.iter().position(|(start, bytes)| {
            offset >= *start && offset + count as u64 <= start + bytes.len() as u64
        });
        self.latest = match loaded {
            Some(part) => part,
            None => self.load(1 - self.latest, offset, count)?,
        };
        let (start, bytes) = &self.parts[self.latest];
        let at = (offset - start) as usize;
        Ok(&bytes[at..at + count])
    }

    fn load(&mut self, part: usize, offset: u64, count: usize) -> Result<usize> {
        let left = self.input.bytes().saturating_sub(offset);
        let size = left.min(WINDOW_BYTES.max(count as u64));
        let (start, bytes) = &mut self.parts[part];
        *start = offset;
        bytes.clear();
        bytes.resize(size.max(count as u64) as usize, 0);
        // Past the end of the file this fails with an ordinary error.
        self.input.read_at(offset, bytes)?;
        Ok(part)
    }
}
