//! DXF release 12 as text, which every reader supports: a 3DFACE for each triangle, f64. The unit is that of all
//! coordinates, or none; metadata are in comments (group 999).

use std::path::Path;

use crate::capacity::MeshCapacity;
use crate::channels::VertexCapabilities;
use crate::format::MeshFormat;
use crate::input::{MeshFile, MeshFileLines, check_range};
use crate::length_unit;
use crate::obj_index::{SparseIndex, TextLineMark};
use crate::sink::{
    FileSink, MeshBatch, MeshCounts, MeshEncoder, MeshHeader, MeshSink, SinkOptions,
};
use crate::source::{MeshInfo, MeshSource};
use crate::text::{self, push_f64};
use terrane_base::error::Result;
use terrane_base::geom::{Crs, Point3};
use terrane_files::AppendWriter;

/// Text has no capacity limit; the bytes are typical values.
const CAPACITY: MeshCapacity = MeshCapacity::new([u64::MAX - 1, u64::MAX / 3, u64::MAX], 0, 170);

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: "DXF",
    extensions: &["dxf"],
    about: "DXF (release 12), a 3DFACE for each triangle, f64 as text",
    single_precision: false,
    carries: VertexCapabilities::Nothing,
    can_be_solid: false,
    states_unit: false,
    names_crs: true,
    admits: |_| Ok(()),
    capacity: || CAPACITY,
    create,
    open: |path| Ok(Box::new(DxfSource::open(path)?)),
    sniff,
};

/// Start of a binary DXF file.
const BINARY: &[u8] = b"AutoCAD Binary DXF";
/// Group codes of the coordinates of a face, corner by corner.
const GROUPS: [[u32; 3]; 4] = [[10, 20, 30], [11, 21, 31], [12, 22, 32], [13, 23, 33]];
/// Maximum number of comments kept.
const MAX_COMMENTS: usize = 64;

/// A unit of lengths.
struct DxfUnit {
    metres: f64,
    /// Value of $INSUNITS.
    code: u8,
    name: &'static str,
}

const UNITS: [DxfUnit; 3] = [
    DxfUnit { metres: 1.0, code: 6, name: "metre" },
    DxfUnit { metres: 0.3048, code: 2, name: "foot" },
    DxfUnit { metres: 1200.0 / 3937.0, code: 21, name: "US survey foot" },
];
/// The variable of the unit.
const UNIT: &str = "$INSUNITS";

/// DXF code of the common unit of all coordinates; 0 if there is none.
fn unit(crs: &Crs) -> u8 {
    let Some(metres) = crs.horizontal_metres() else { return 0 };
    let is_common = crs.vertical_metres().is_none_or(|up| length_unit::is_same(up, metres));
    let unit = UNITS.iter().find(|unit| is_common && length_unit::is_same(unit.metres, metres));
    unit.map_or(0, |unit| unit.code)
}

/// Name of the unit with a DXF code.
fn unit_name(code: &[u8]) -> Option<String> {
    let code = String::from_utf8_lossy(code);
    let known = UNITS.iter().find(|unit| code.parse() == Ok(unit.code));
    (code != "0").then(|| match known {
        Some(unit) => unit.name.to_owned(),
        None => format!("{UNIT} {code}"),
    })
}

fn create(path: &Path, header: &MeshHeader, options: &SinkOptions) -> Result<Box<dyn MeshSink>> {
    let comments = text::comments(header);
    let comments = comments.iter().map(|text| format!("999\n{text}\n")).collect::<String>();
    let unit = unit(&header.crs);
    let head = format!(
        "{comments}0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n9\n{UNIT}\n70\n{unit}\n0\nENDSEC\n\
         0\nSECTION\n2\nENTITIES\n"
    );
    FileSink::create(path, options, DxfEncoder { head })
}

const END: &[u8] = b"0\nENDSEC\n0\nEOF\n";

/// True if the file begins with DXF groups.
fn sniff(head: &[u8]) -> bool {
    let mut lines = head.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let mut pairs = std::iter::from_fn(|| Some((lines.next()?, lines.next()?)));
    let first = pairs.find(|(code, _)| *code != b"999");
    head.starts_with(BINARY)
        || head.starts_with(b"999\nterrane ")
        || first.is_some_and(|(code, value)| code == b"0" && value == b"SECTION")
}

struct DxfEncoder {
    head: String,
}

impl MeshEncoder for DxfEncoder {
    fn name(&self) -> &'static str {
        FORMAT.name
    }

    fn capacity(&self) -> MeshCapacity {
        CAPACITY
    }

    fn header(&self, _counts: MeshCounts) -> Vec<u8> {
        self.head.clone().into_bytes()
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
        body.lines(batch.corners, |corners, text| {
            text.extend_from_slice(b"0\n3DFACE\n8\nTERRAIN\n");
            let [a, b, c] = corners;
            // A triangle is a face whose last corner is repeated.
            for (groups, corner) in GROUPS.iter().zip([a, b, c, c]) {
                for (group, value) in groups.iter().zip(corner) {
                    text::push_u64((*group).into(), text);
                    text.push(b'\n');
                    push_f64(*value, text);
                    text.push(b'\n');
                }
            }
        })
    }

    fn complete(&mut self, body: &mut AppendWriter, _tail: &mut AppendWriter) -> Result<()> {
        body.write(END)
    }
}

/// Reader of groups: pairs of lines with a code and a value.
struct DxfGroupReader<'a> {
    lines: MeshFileLines<'a>,
    code: u32,
    /// Start of the group.
    start: TextLineMark,
}

impl<'a> DxfGroupReader<'a> {
    fn new(input: &'a MeshFile, mark: TextLineMark) -> Self {
        Self { lines: input.lines(mark.offset, mark.line), code: 0, start: mark }
    }

    /// Reads the next group; false at the end of the file.
    fn advance(&mut self) -> Result<bool> {
        if !self.lines.advance()? {
            return Ok(false);
        }
        let (offset, line) = (self.lines.start(), self.lines.number());
        self.start = TextLineMark { offset, line, vertices: 0 };
        self.code = self.number()?;
        if !self.lines.advance()? {
            return Err(self.lines.bad("truncated group"));
        }
        Ok(true)
    }

    fn value(&self) -> &[u8] {
        self.lines.text().trim_ascii()
    }

    fn is(&self, code: u32, value: &str) -> bool {
        self.code == code && self.value() == value.as_bytes()
    }

    /// Parses the line as a number.
    fn number<T: std::str::FromStr>(&self) -> Result<T> {
        let text = std::str::from_utf8(self.value()).ok();
        text.and_then(|text| text.parse().ok()).ok_or_else(|| {
            let word: String = String::from_utf8_lossy(self.value()).chars().take(40).collect();
            self.lines.bad(format!("\"{}\" is not a number", word.escape_debug()))
        })
    }

    /// The corners of the current face; then the group after it is current.
    fn face(&mut self) -> Result<[Point3; 3]> {
        let mut corners = [[f64::NAN, f64::NAN, 0.0]; 4];
        while self.advance()? && self.code != 0 {
            let slots = corners.as_flattened_mut().iter_mut().zip(GROUPS.as_flattened());
            let slot = slots.into_iter().find(|(_, group)| **group == self.code);
            if let Some((slot, _)) = slot {
                *slot = self.number()?;
                if !slot.is_finite() {
                    return Err(self.lines.bad("position is not finite"));
                }
            }
        }
        let [a, b, c, d] = corners;
        if [a, b, c].as_flattened().iter().any(|value| value.is_nan()) {
            return Err(self.lines.bad("3DFACE has fewer than three corners"));
        }
        if !d[0].is_nan() && d != c && d != a {
            return Err(self
                .lines
                .unsupported("3DFACE has four corners")
                .remedy("triangulate the mesh first"));
        }
        Ok([a, b, c])
    }
}

/// An open file. Every triangle has three vertices of its own.
struct DxfSource {
    input: MeshFile,
    faces: SparseIndex,
    info: MeshInfo,
}

impl DxfSource {
    /// Scans the whole file once.
    fn open(path: &Path) -> Result<Self> {
        let input = MeshFile::open(path)?;
        if input.head(BINARY.len())? == BINARY {
            let error = input.unsupported("is a binary DXF file");
            return Err(error.remedy("convert it to ASCII DXF"));
        }
        let mut faces = SparseIndex::new();
        let (mut comments, mut others, mut section) = (Vec::new(), 0_u64, Vec::new());
        let mut pairs =
            DxfGroupReader::new(&input, TextLineMark { offset: 0, line: 1, vertices: 0 });
        let (mut is_section, mut is_over) = (false, false);
        let (mut is_unit, mut unit) = (false, None);
        while !is_over && pairs.advance()? {
            if is_section && pairs.code == 2 {
                section = pairs.value().to_vec();
            }
            if is_unit && pairs.code == 70 {
                unit = unit_name(pairs.value());
            }
            is_unit = pairs.is(9, UNIT);
            is_section = pairs.is(0, "SECTION");
            is_over = pairs.is(0, "EOF");
            match pairs.code {
                999 if comments.len() < MAX_COMMENTS && faces.count() == 0 => {
                    comments.push(String::from_utf8_lossy(pairs.value()).into_owned());
                }
                0 if pairs.is(0, "ENDSEC") => section.clear(),
                0 if section == b"ENTITIES" && pairs.is(0, "3DFACE") => faces.note(pairs.start),
                0 if section == b"ENTITIES" => others += 1,
                _ => {}
            }
        }
        if !is_over {
            return Err(input.bad("EOF is missing").remedy("write or copy the file again"));
        }
        if faces.count() == 0 && comments.is_empty() {
            return Err(input.unsupported("has no 3DFACE entities"));
        }
        let info = info(faces.count(), comments, unit, others);
        drop(pairs);
        Ok(Self { input, faces, info })
    }

    /// Passes the corners of `count` faces from `first` to `each`.
    fn scan(&self, first: u64, count: u64, mut each: impl FnMut(u64, [Point3; 3])) -> Result<()> {
        if count == 0 {
            return Ok(());
        }
        let (mut at, mark) = self.faces.before(first);
        let mut pairs = DxfGroupReader::new(&self.input, mark);
        let mut is_read = pairs.advance()?;
        while is_read {
            if !pairs.is(0, "3DFACE") {
                is_read = pairs.advance()?;
                continue;
            }
            let corners = pairs.face()?;
            if at >= first {
                each(at - first, corners);
            }
            at += 1;
            if at == first + count {
                return Ok(());
            }
        }
        Err(self.input.bad("changed while it was read"))
    }
}

fn info(triangles: u64, comments: Vec<String>, unit: Option<String>, others: u64) -> MeshInfo {
    let others = (others > 0)
        .then(|| ("passed over".to_owned(), format!("{others} entities other than 3DFACE")));
    let details = unit.map(|unit| ("unit".to_owned(), unit)).into_iter().chain(others).collect();
    let plain = MeshInfo::plain(FORMAT.name, 3 * triangles, triangles);
    MeshInfo { details, indexed: false, ..plain }.with_comments(comments)
}

impl MeshSource for DxfSource {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        check_range("vertices", first, out.len(), self.info.vertices)?;
        let end = first + out.len() as u64;
        let (from, to) = (first / 3, end.div_ceil(3));
        self.scan(from, to - from, |face, corners| {
            for (index, corner) in (3 * (from + face)..).zip(corners) {
                let slot = index.checked_sub(first).and_then(|i| out.get_mut(i as usize));
                slot.into_iter().for_each(|slot| *slot = corner);
            }
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
