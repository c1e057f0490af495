//! Binary STL: triangles by position in f32, with a normal each. The header has the origin as `terrane origin X Y Z`,
//! then `scale X Y Z` if it is not 1, and statements such as `max error E`. Optionally the surface is closed with
//! walls and a bottom.

use std::path::Path;

use crate::capacity::{self, MeshCapacity};
use crate::channels::VertexCapabilities;
use crate::format::MeshFormat;
use crate::input::{MeshFile, check_position, check_range};
use crate::promises::Promises;
use crate::relative_positions::{LocalCoordinates, is_scale, to_world};
use crate::sink::{
    FileSink, MeshBatch, MeshCounts, MeshEncoder, MeshHeader, MeshSink, SinkOptions,
};
use crate::solid::{DirectedEdge, SolidBase, SolidOutline, lowered};
use crate::source::{MeshInfo, MeshSource};
use crate::text;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;
use terrane_files::{AppendWriter, folder_for};

/// The number of triangles is a u32.
const CAPACITY: MeshCapacity = MeshCapacity::new([u64::MAX, u32::MAX as u64, u64::MAX], 0, 50);

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: "STL",
    extensions: &["stl"],
    about: "binary STL, f32 relative to an origin in the header; optionally closed to a solid",
    single_precision: true,
    carries: VertexCapabilities::Nothing,
    can_be_solid: true,
    states_unit: false,
    names_crs: false,
    admits: |_| Ok(()),
    capacity: || CAPACITY,
    create,
    open: |path| Ok(Box::new(StlSource::open(path)?)),
    sniff: |head| head.starts_with(ORIGIN.as_bytes()) || is_ascii(head),
};

const ORIGIN: &str = "terrane origin ";
const SCALE: &str = " scale ";
/// Statements of the title: key and abbreviation.
const STATED: [[&str; 2]; 5] = [
    ["max error", "max error"],
    ["bound", "bound"],
    ["fitted", "fitted"],
    ["min angle", "min angle"],
    ["triangulation", "by"],
];
/// Abbreviation of the longest name of a triangulation.
const ANY: [&str; 2] = ["any", "data-dependent"];
/// Words of a title up to the end of the origin: see [`ORIGIN`].
const PLACE_WORDS: usize = 5;
const TITLE_BYTES: usize = 80;
const HEADER_BYTES: u64 = 84;
const TRIANGLE_BYTES: usize = 50;

type Corners = [[f32; 3]; 3];

fn create(path: &Path, header: &MeshHeader, options: &SinkOptions) -> Result<Box<dyn MeshSink>> {
    let local = LocalCoordinates::new(header.origin, header.scale)?;
    let title = title(header.origin, local.scale(), &header.promises)?;
    let folder = folder_for(path, options.temp_dir.as_deref());
    let base = options.solid_base.map(|height| SolidBase::new(height, header)).transpose()?;
    let solid = base.map(|base| SolidFacets { base, outline: SolidOutline::new(folder) });
    let encoder = StlEncoder { local, title, solid, written: 0 };
    FileSink::create(path, options, encoder)
}

/// Abbreviated statements without units: " max error 1.5 bound surface fitted heights".
fn stated(promises: &Promises) -> String {
    let all: Vec<_> = promises.statements().collect();
    let stated = STATED.into_iter().filter_map(|[key, short]| {
        let (_, text) = all.iter().find(|(known, _)| *known == key)?;
        let word = text.split_whitespace().next()?;
        Some(format!(" {short} {}", if word == ANY[1] { ANY[0] } else { word }))
    });
    stated.collect()
}

/// The first 80 bytes. If origin and scale leave no space for the statements, they are omitted; with fitted heights
/// or a minimum angle, this is an error.
fn title(origin: Point3, scale: Option<Point3>, promises: &Promises) -> Result<[u8; TITLE_BYTES]> {
    let scale = scale.map(|scale| format!("{SCALE}{}", text::point_text(scale)));
    let mut text = format!("{ORIGIN}{}{}", text::point_text(origin), scale.unwrap_or_default());
    if text.len() > TITLE_BYTES {
        return Err(Error::usage(format!("the origin {origin:?} does not fit into an STL header")));
    }
    let needed = [
        (promises.fitted.is_some(), "‹fit_heights›", "the note on fitted heights"),
        (promises.min_angle.is_some(), "‹min_angle›", "the smallest angle"),
    ];
    let stated = stated(promises);
    if text.len() + stated.len() <= TITLE_BYTES {
        text += &stated;
    } else if let Some((_, option, what)) = needed.into_iter().find(|(is_needed, ..)| *is_needed) {
        return Err(Error::usage(format!("the STL header has no space for {what}"))
            .remedy(format!("write PLY, OBJ or GLB, or leave {option} out")));
    }
    let mut title = [b' '; TITLE_BYTES];
    title[..text.len()].copy_from_slice(text.as_bytes());
    Ok(title)
}

struct StlEncoder {
    local: LocalCoordinates,
    title: [u8; TITLE_BYTES],
    solid: Option<SolidFacets>,
    /// Triangles written, including those of the bottom.
    written: u64,
}

impl MeshEncoder for StlEncoder {
    fn name(&self) -> &'static str {
        FORMAT.name
    }

    /// A solid has each triangle twice.
    fn capacity(&self) -> MeshCapacity {
        let surface = CAPACITY;
        let copies = if self.solid.is_some() { 2 } else { 1 };
        MeshCapacity { triangles: surface.triangles / copies, ..surface }
    }

    fn header(&self, _counts: MeshCounts) -> Vec<u8> {
        let written = (self.written as u32).to_le_bytes();
        [self.title.as_slice(), written.as_slice()].concat()
    }

    fn wants_corners(&self) -> bool {
        true
    }

    fn encode(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        _tail: &mut AppendWriter,
    ) -> Result<()> {
        let Self { local, .. } = self;
        match &mut self.solid {
            None => body.records(batch.corners, |corners| record(&local.triangle(corners)))?,
            Some(solid) => {
                for (&ids, corners) in batch.triangles.iter().zip(batch.corners) {
                    let top = local.triangle(corners);
                    solid.outline.push(ids, top)?;
                    body.records(&[top, solid.bottom(top)?], record)?;
                }
            }
        }
        let copies = if self.solid.is_some() { 2 } else { 1 };
        self.written += copies * batch.corners.len() as u64;
        self.local.check()
    }

    fn complete(&mut self, body: &mut AppendWriter, _tail: &mut AppendWriter) -> Result<()> {
        let Some(SolidFacets { base, outline }) = self.solid.take() else { return Ok(()) };
        let base = base.stored();
        outline.complete(|edge| {
            self.written += 2;
            body.records(&wall(&edge, base), record)
        })?;
        if self.written > u32::MAX.into() {
            let limit = format!("{} triangles", u32::MAX);
            return Err(capacity::too_much(FORMAT.name, &limit, 0, self.written));
        }
        Ok(())
    }
}

/// Converts a surface to a solid: every triangle is repeated at the bottom, reversed, and two upright triangles are
/// added under every edge of the outline. Then each edge has one triangle in each direction, or two under a vertex
/// where two voids touch. STL identifies vertices by position, so this cannot be avoided; every loop of the outline
/// has closed walls of its own.
struct SolidFacets {
    base: SolidBase,
    outline: SolidOutline,
}

impl SolidFacets {
    fn bottom(&self, top: Corners) -> Result<Corners> {
        let [a, b, c] = top;
        self.base.check(a[2].min(b[2]).min(c[2]))?;
        Ok(beneath(top, self.base.stored()))
    }
}

/// The bottom triangle under a triangle of the surface.
fn beneath([a, b, c]: Corners, base: f32) -> Corners {
    [c, b, a].map(|p| lowered(p, base))
}

/// The wall under an edge of the outline, which has the surface on its left.
fn wall(edge: &DirectedEdge, base: f32) -> [Corners; 2] {
    let [a, b] = edge.ends;
    let [low_a, low_b] = edge.ends.map(|p| lowered(p, base));
    [[b, a, low_a], [b, low_a, low_b]]
}

fn record(corners: &Corners) -> [u8; TRIANGLE_BYTES] {
    let mut bytes = [0; TRIANGLE_BYTES];
    let [a, b, c] = *corners;
    let values = [normal(corners), a, b, c];
    let (slots, _) = bytes.as_chunks_mut::<4>();
    for (slot, value) in slots.iter_mut().zip(values.as_flattened()) {
        *slot = value.to_le_bytes();
    }
    bytes
}

/// Unit normal of a triangle; zeros if degenerate.
fn normal([a, b, c]: &Corners) -> [f32; 3] {
    let [u, v] = [b, c].map(|p| [0, 1, 2].map(|i: usize| f64::from(p[i]) - f64::from(a[i])));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
    let usable = length > 0.0 && length.is_finite();
    if usable { n.map(|c| (c / length) as f32) } else { [0.0; 3] }
}

/// An open STL file. Every triangle has three vertices of its own.
struct StlSource {
    input: MeshFile,
    info: MeshInfo,
}

impl StlSource {
    fn open(path: &Path) -> Result<Self> {
        let input = MeshFile::open(path)?;
        let head = input.head(HEADER_BYTES as usize)?;
        let (Some(title), Some(count)) =
            (head.first_chunk::<TITLE_BYTES>(), head.last_chunk::<4>())
        else {
            return Err(refusal(&input, "file is too short for STL"));
        };
        let triangles = u64::from(u32::from_le_bytes(*count));
        let expected = HEADER_BYTES + triangles * TRIANGLE_BYTES as u64;
        if head.len() as u64 != HEADER_BYTES || input.bytes() != expected {
            let (found, says) = (input.bytes(), format!("{expected} ({triangles} triangles)"));
            return Err(refusal(&input, &format!("has {found} bytes, expected {says}")));
        }
        let known = place(title);
        let (origin, scale) = known.unwrap_or(([0.0; 3], [1.0; 3]));
        let title = String::from_utf8_lossy(title).trim_matches([' ', '\0']).to_owned();
        let stated = known.map_or_else(Vec::new, |_| statements(&title));
        let info = MeshInfo {
            origin,
            scale,
            single_precision: true,
            indexed: false,
            solid: known.is_some() && is_solid(&input, triangles)?,
            details: std::iter::once(("title".to_owned(), title)).chain(stated).collect(),
            ..MeshInfo::plain(FORMAT.name, 3 * triangles, triangles)
        };
        Ok(Self { input, info })
    }
}

/// Statements of a title of this program after origin and scale: a word for each key; other words are a comment.
fn statements(title: &str) -> Vec<(String, String)> {
    let all: Vec<&str> = title.split_whitespace().collect();
    let scale = if all.get(PLACE_WORDS) == Some(&SCALE.trim()) { 4 } else { 0 };
    let mut words = all.get(PLACE_WORDS + scale..).unwrap_or_default();
    let (mut stated, mut unknown) = (Vec::new(), Vec::new());
    while let [first, rest @ ..] = words {
        let starts =
            |[_, short]: &&[&str; 2]| short.split_whitespace().zip(words).all(|(a, b)| a == *b);
        let Some([key, short]) = STATED.iter().find(starts) else {
            unknown.push(*first);
            words = rest;
            continue;
        };
        let length = short.split_whitespace().count();
        let value = words.get(length).copied().unwrap_or_default();
        let value = if value == ANY[0] { ANY[1] } else { value };
        stated.push(((*key).to_owned(), value.to_owned()));
        words = words.get(length + 1..).unwrap_or_default();
    }
    if !unknown.is_empty() {
        stated.push(("comment".to_owned(), unknown.join(" ")));
    }
    stated
}

/// True if the second triangle is the first one at the bottom: see [`SolidFacets`]. Surfaces never have such a
/// sequence.
fn is_solid(input: &MeshFile, triangles: u64) -> Result<bool> {
    if triangles < 2 {
        return Ok(false);
    }
    let mut first = [[[0.0; 3]; 3]; 2];
    let bytes = HEADER_BYTES..HEADER_BYTES + 2 * TRIANGLE_BYTES as u64;
    input.records(bytes, TRIANGLE_BYTES as u64, |place, record| {
        first[place] = [0, 1, 2].map(|corner| corner_of(record, corner).unwrap_or_default());
        Ok(())
    })?;
    let [top, bottom] = first;
    let base = bottom[0][2];
    Ok(top.iter().all(|p| p[2] > base) && bottom == beneath(top, base))
}

/// The error for a file of the wrong length.
fn refusal(input: &MeshFile, message: &str) -> Error {
    match input.head(512) {
        Ok(head) if is_ascii(&head) => {
            input.unsupported("is an ASCII STL file").remedy("convert it to binary STL, PLY or OBJ")
        }
        _ => input.bad(message).remedy("write or copy the file again"),
    }
}

fn is_ascii(head: &[u8]) -> bool {
    let text = head.trim_ascii_start();
    text.starts_with(b"solid") && text.windows(5).any(|word| word == b"facet")
}

/// Origin and scale of a title of this program.
fn place(title: &[u8; TITLE_BYTES]) -> Option<(Point3, Point3)> {
    let text = std::str::from_utf8(title).ok()?.strip_prefix(ORIGIN)?;
    let scale = text.split_once(SCALE).map_or(Some([1.0; 3]), |(_, rest)| numbers(rest))?;
    Some((numbers(text)?, scale)).filter(|(_, scale)| is_scale(scale))
}

/// Three finite numbers at the start of a text.
fn numbers(text: &str) -> Option<Point3> {
    let words = text.split_whitespace().take(3).map(|word| word.parse().ok());
    let point: Point3 = words.collect::<Option<Vec<f64>>>()?.try_into().ok()?;
    point.iter().all(|c| c.is_finite()).then_some(point)
}

/// The position of corner `corner` in a triangle's record.
fn corner_of(record: &[u8], corner: usize) -> Option<[f32; 3]> {
    let (values, _) = record.get(12 + 12 * corner..)?.as_chunks::<4>();
    let &[x, y, z] = values.first_chunk::<3>()?;
    Some([x, y, z].map(f32::from_le_bytes))
}

impl MeshSource for StlSource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        check_range("vertices", first, out.len(), self.info.vertices)?;
        let end = first + out.len() as u64;
        let (from, to) = (first / 3, end.div_ceil(3));
        let [start, stop] =
            [from, to].map(|triangle| HEADER_BYTES + triangle * TRIANGLE_BYTES as u64);
        self.input.records(start..stop, TRIANGLE_BYTES as u64, |place, record| {
            for corner in 0..3 {
                let index = 3 * (from + place as u64) + corner as u64;
                let slot = index.checked_sub(first).and_then(|i| out.get_mut(i as usize));
                if let (Some(slot), Some(local)) = (slot, corner_of(record, corner)) {
                    *slot = to_world(local.map(f64::from), self.info.origin, self.info.scale);
                    check_position(index, slot)?;
                }
            }
            Ok(())
        })
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        check_range("triangles", first, out.len(), self.info.triangles)?;
        for (triangle, ids) in (first..).zip(out) {
            *ids = [0, 1, 2].map(|corner| 3 * triangle + corner);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn promises(lines: &[&str]) -> Promises {
        Promises::parse(lines).unwrap()
    }

    #[test]
    fn the_title_holds_any_origin_a_grid_can_have() {
        for origin in [[500_000.5, -4e6, 0.0], [-1.234_567_890_123_456_7e-300, f64::MIN, 0.0]] {
            let made = title(origin, None, &promises(&["max error 1.5"])).unwrap();
            assert_eq!(place(&made), Some((origin, [1.0; 3])));
        }
        let (origin, scale) = ([-124.515_625, 48.484_375, 4096.0], [74_123.45, 111_132.9, 0.3048]);
        let made = title(origin, Some(scale), &promises(&["max error 1.5"])).unwrap();
        assert_eq!(place(&made), Some((origin, scale)));
        assert!(title([-1.234_567_890_123_456_7e-300; 3], None, &promises(&[])).is_err());
        for bad in ["1 2", "1 2 x", "1 2 3 scale 1 2", "1 2 3 scale 0 1 1", "1 2 3 scale -1 1 1"] {
            let text = format!("{ORIGIN}{bad:<65}");
            assert_eq!(place(text.as_bytes().try_into().unwrap()), None, "{bad}");
        }
    }

    #[test]
    fn the_title_holds_the_bound_where_there_is_room() {
        let plain = promises(&["source a.tif", "max error 1.5 metre"]);
        let made = title([500_000.0, 4e6, 0.0], None, &plain).unwrap();
        assert!(made.starts_with(b"terrane origin 500000 4000000 0 max error 1.5 "), "{made:?}");
        let full = [-1.234_567_890_123_456_7e-300, -1.234_567_890_123_456_7e-300, 1.5];
        let made = title(full, None, &plain).unwrap();
        assert!(!made.windows(3).any(|some| some == b"max"));
        assert_eq!(stated(&promises(&["source a.tif"])), "");
        let fitted = promises(&["fitted heights", "bound surface", "max error 1.5 metre"]);
        assert_eq!(stated(&fitted), " max error 1.5 bound surface fitted heights");
        let angle = promises(&["max error 1.5", "triangulation data-dependent", "min angle 25"]);
        assert_eq!(stated(&angle), " max error 1.5 min angle 25 by any");
        for (promises, option) in [(fitted, "‹fit_heights›"), (angle, "‹min_angle›")] {
            let error = title(full, None, &promises).unwrap_err().to_string();
            assert!(error.contains(option), "{error}");
        }
    }

    #[test]
    fn statements_are_a_word_for_each_key() {
        let stated = |rest: &str| {
            let found = statements(&format!("terrane origin 1 2 3{rest}"));
            found.iter().map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>()
        };
        assert_eq!(stated(""), [""; 0]);
        let all = " max error 1.5 bound surface fitted heights min angle 20 by x";
        let each =
            ["max error=1.5", "bound=surface", "fitted=heights", "min angle=20", "triangulation=x"];
        assert_eq!(stated(all), each);
        assert_eq!(stated(&format!(" scale 4 5 6{all}")), each);
        assert_eq!(stated(" max error 2 by any"), ["max error=2", "triangulation=data-dependent"]);
        let other = stated(" max error 1.5 bounds surface min angles 20 bound");
        assert_eq!(other, ["max error=1.5", "bound=", "comment=bounds surface min angles 20"]);
    }

    #[test]
    fn normals_point_up_and_have_unit_length() {
        let up = normal(&[[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
        assert_eq!(up, [0.0, 0.0, 1.0]);
        assert_eq!(normal(&[[1.0; 3]; 3]), [0.0; 3]);
    }
}
