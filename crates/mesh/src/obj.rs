//! Wavefront OBJ: text, f64 coordinates in the shortest form that reads back exactly.

use std::path::Path;

use crate::capacity::MeshCapacity;
use crate::channels::VertexCapabilities;
use crate::format::MeshFormat;
use crate::input::{MeshFile, MeshFileLines, check_range};
use crate::obj_index::{SparseIndex, TextLineMark};
use crate::sink::{
    FileSink, MeshBatch, MeshCounts, MeshEncoder, MeshHeader, MeshSink, SinkOptions,
};
use crate::source::{MeshInfo, MeshSource};
use crate::text::{self, push_f64, push_u64};
use terrane_base::error::Result;
use terrane_base::geom::Point3;
use terrane_files::AppendWriter;

/// Text has no capacity limit; the bytes are typical values.
const CAPACITY: MeshCapacity = MeshCapacity::new([u64::MAX - 1, u64::MAX, u64::MAX], 32, 24);

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: "OBJ",
    extensions: &["obj"],
    about: "Wavefront OBJ, f64 coordinates as text",
    single_precision: false,
    carries: VertexCapabilities::Nothing,
    can_be_solid: false,
    states_unit: false,
    names_crs: true,
    admits: |_| Ok(()),
    capacity: || CAPACITY,
    create,
    open: |path| Ok(Box::new(ObjSource::open(path)?)),
    sniff,
};

fn create(path: &Path, header: &MeshHeader, options: &SinkOptions) -> Result<Box<dyn MeshSink>> {
    let comments = text::comments(header);
    FileSink::create(path, options, ObjEncoder { comments })
}

/// True if the first line other than a comment begins like OBJ.
fn sniff(head: &[u8]) -> bool {
    const WORDS: [&[u8]; 11] =
        [b"v", b"vn", b"vt", b"f", b"o", b"g", b"s", b"l", b"p", b"mtllib", b"usemtl"];
    let mut lines = head.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let own = head.starts_with(b"# terrane ");
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(b"#"));
    own || first.is_some_and(|line| {
        let mut words = line.split(u8::is_ascii_whitespace);
        words.next().is_some_and(|word| WORDS.contains(&word)) && words.next().is_some()
    })
}

struct ObjEncoder {
    comments: Vec<String>,
}

impl MeshEncoder for ObjEncoder {
    fn name(&self) -> &'static str {
        FORMAT.name
    }

    fn capacity(&self) -> MeshCapacity {
        CAPACITY
    }

    fn header(&self, _counts: MeshCounts) -> Vec<u8> {
        self.comments.iter().flat_map(|text| format!("# {text}\n").into_bytes()).collect()
    }

    fn encode(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        body.lines(batch.vertices, |point, line| {
            push_line(b"v", point, line, |&value, line| push_f64(value, line));
        })?;
        tail.lines(batch.triangles, |ids, line| {
            push_line(b"f", ids, line, |id, line| push_u64(id + 1, line));
        })
    }
}

fn push_line<T>(key: &[u8], values: &[T; 3], line: &mut Vec<u8>, push: impl Fn(&T, &mut Vec<u8>)) {
    line.extend_from_slice(key);
    for value in values {
        line.push(b' ');
        push(value, line);
    }
    line.push(b'\n');
}

/// An open OBJ file.
struct ObjSource {
    input: MeshFile,
    vertices: SparseIndex,
    faces: SparseIndex,
    info: MeshInfo,
}

/// A relevant line of an OBJ file.
enum ObjLine<'a> {
    Vertex(&'a [u8]),
    Face(&'a [u8]),
    Comment(&'a [u8]),
    Other,
}

fn parse(line: &[u8]) -> ObjLine<'_> {
    match line.trim_ascii_start() {
        [b'v', b' ' | b'\t', rest @ ..] => ObjLine::Vertex(rest),
        [b'f', b' ' | b'\t', rest @ ..] => ObjLine::Face(rest),
        [b'#', rest @ ..] => ObjLine::Comment(rest.trim_ascii()),
        _ => ObjLine::Other,
    }
}

impl ObjSource {
    /// Scans the whole file once.
    fn open(path: &Path) -> Result<Self> {
        let input = MeshFile::open(path)?;
        let (mut vertices, mut faces) = (SparseIndex::new(), SparseIndex::new());
        let mut comments = Vec::new();
        let mut lines = input.lines(0, 1);
        while lines.advance()? {
            let mark = TextLineMark {
                offset: lines.start(),
                line: lines.number(),
                vertices: vertices.count(),
            };
            check_line(&lines)?;
            match parse(lines.text()) {
                ObjLine::Vertex(_) => vertices.note(mark),
                ObjLine::Face(rest) => {
                    check_face(rest, &lines)?;
                    faces.note(mark);
                }
                ObjLine::Comment(text) if is_early(&mark, comments.len()) => {
                    comments.push(String::from_utf8_lossy(text).into_owned());
                }
                ObjLine::Comment(_) | ObjLine::Other => {}
            }
        }
        if vertices.count() == 0 && comments.is_empty() {
            return Err(input.bad("has no vertices"));
        }
        let info = MeshInfo::plain(FORMAT.name, vertices.count(), faces.count());
        let info = info.with_comments(comments);
        Ok(Self { input, vertices, faces, info })
    }

    /// Passes the lines from `mark`, with the number of vertices before each, to `each` until it returns true.
    fn scan(
        &self,
        mark: TextLineMark,
        mut each: impl FnMut(ObjLine<'_>, u64, &MeshFileLines<'_>) -> Result<bool>,
    ) -> Result<()> {
        let mut lines = self.input.lines(mark.offset, mark.line);
        let mut vertices = mark.vertices;
        while lines.advance()? {
            let line = parse(lines.text());
            let is_vertex = matches!(line, ObjLine::Vertex(_));
            if each(line, vertices, &lines)? {
                return Ok(());
            }
            vertices += u64::from(is_vertex);
        }
        Err(self.input.bad("changed while it was read"))
    }
}

/// True for comments before the first vertex, up to a maximum number.
fn is_early(mark: &TextLineMark, kept: usize) -> bool {
    mark.vertices == 0 && kept < 64
}

fn check_line(lines: &MeshFileLines<'_>) -> Result<()> {
    let text = lines.text();
    if text.ends_with(b"\\") && !text.trim_ascii_start().starts_with(b"#") {
        return Err(lines.unsupported("line continuation is not supported"));
    }
    if text.contains(&0) {
        return Err(lines.bad("is not text"));
    }
    Ok(())
}

fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

fn check_face(rest: &[u8], lines: &MeshFileLines<'_>) -> Result<()> {
    match words(rest).count() {
        3 => Ok(()),
        0..3 => Err(lines.bad("face has fewer than three corners")),
        n => Err(lines
            .unsupported(format!("face has {n} corners"))
            .remedy("triangulate the mesh first")),
    }
}

/// Parses the word as a number.
fn number<T: std::str::FromStr>(word: &[u8], lines: &MeshFileLines<'_>) -> Result<T> {
    let text = std::str::from_utf8(word).ok();
    text.and_then(|text| text.parse().ok()).ok_or_else(|| {
        let word: String = String::from_utf8_lossy(word).chars().take(40).collect();
        lines.bad(format!("\"{}\" is not a number", word.escape_debug()))
    })
}

/// The first three numbers; a weight or colour may follow.
fn position(rest: &[u8], lines: &MeshFileLines<'_>) -> Result<Point3> {
    let mut words = words(rest);
    let mut point: Point3 = [0.0; 3];
    for value in &mut point {
        let word = words.next().ok_or_else(|| lines.bad("vertex has fewer than three numbers"))?;
        *value = number(word, lines)?;
        if !value.is_finite() {
            return Err(lines.bad("position is not finite"));
        }
    }
    Ok(point)
}

/// The ids of a face's corners: `v`, `v/vt`, `v//vn` or `v/vt/vn`, from 1, or negative and counted
/// back from the last of the `before` vertices defined so far.
fn corners(rest: &[u8], before: u64, all: u64, lines: &MeshFileLines<'_>) -> Result<[u64; 3]> {
    let mut ids = [0; 3];
    for (id, word) in ids.iter_mut().zip(words(rest)) {
        let index = word.split(|&byte| byte == b'/').next().unwrap_or_default();
        let index: i64 = number(index, lines)?;
        let from_start = (index > 0).then(|| index.unsigned_abs() - 1);
        let from_end = (index < 0).then(|| before.checked_sub(index.unsigned_abs())).flatten();
        *id = from_start.or(from_end).filter(|&id| id < all).ok_or_else(|| {
            lines.bad(format!("vertex {index} does not exist (the mesh has {all} vertices)"))
        })?;
    }
    Ok(ids)
}

impl MeshSource for ObjSource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        check_range("vertices", first, out.len(), self.info.vertices)?;
        let (_, mark) = self.vertices.before(first);
        let mut slots = out.iter_mut();
        let Some(mut slot) = slots.next() else { return Ok(()) };
        self.scan(mark, |line, index, lines| {
            let ObjLine::Vertex(rest) = line else { return Ok(false) };
            if index < first {
                return Ok(false);
            }
            *slot = position(rest, lines)?;
            Ok(advance(&mut slot, &mut slots))
        })
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        check_range("triangles", first, out.len(), self.info.triangles)?;
        let (mut index, mark) = self.faces.before(first);
        let mut slots = out.iter_mut();
        let Some(mut slot) = slots.next() else { return Ok(()) };
        self.scan(mark, |line, before, lines| {
            let ObjLine::Face(rest) = line else { return Ok(false) };
            index += 1;
            if index <= first {
                return Ok(false);
            }
            // The file may have changed since its faces were counted and checked.
            check_face(rest, lines)?;
            *slot = corners(rest, before, self.info.vertices, lines)?;
            Ok(advance(&mut slot, &mut slots))
        })
    }
}

/// Moves to the next slot; true at the end.
fn advance<'a, T>(slot: &mut &'a mut T, slots: &mut std::slice::IterMut<'a, T>) -> bool {
    match slots.next() {
        Some(next) => {
            *slot = next;
            false
        }
        None => true,
    }
}
