//! Reader, line by line. Consecutive rows with one id form a feature, and those with one part form a line of
//! it; without ids, an empty line ends a feature.

use std::path::Path;
use std::sync::Arc;

use crate::crs;
use crate::decimal;
use crate::feature::{Feature, FeatureProperties, Id, LayerHeader, PropertyValue};
use crate::geometry::{CoordinateSequence, Geometry, GeometryType};
use crate::source::{FeatureSource, VectorOpenOptions};
use crate::window::FileWindow;
use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Maximum line length in bytes.
const MAX_LINE: u64 = 1 << 20;

/// Remedy for quoting errors.
const QUOTING: &str = "quote the whole value and double the quotation marks inside it";

/// Recognised column names, lower case.
const X: &[&str] = &["x", "lon", "long", "lng", "longitude", "easting", "east"];
const Y: &[&str] = &["y", "lat", "latitude", "northing", "north"];
const Z: &[&str] = &["z", "ele", "elevation", "height", "altitude", "alt"];
const M: &[&str] = &["m", "measure"];
const ID: &[&str] = &["id", "line_id", "lineid"];
const PART: &[&str] = &["part", "part_id", "segment"];

/// Opens a file.
pub(super) fn open(path: &Path, options: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    let window = FileWindow::open(path)?;
    let layer = LayerHeader { crs: crs::sidecar_crs(path)?, ..LayerHeader::default() };
    let mut source = CsvFeatureSource {
        window,
        delimiter: b',',
        columns: CsvColumns::default(),
        layer,
        line: 0,
        row_line: 0,
        first_line: 0,
        row: CsvRow::default(),
        first: CsvRow::default(),
        others: 0,
        broken: 0,
        count: 0,
        has_row: false,
        is_over: false,
        rows_are_points: options.rows_are_points,
        notes: Vec::new(),
    };
    source.header()?;
    Ok(Box::new(source))
}

/// Roles of columns.
#[derive(Default)]
struct CsvColumns {
    x: usize,
    y: usize,
    z: Option<usize>,
    m: Option<usize>,
    id: Option<usize>,
    part: Option<usize>,
    /// All other columns.
    properties: Vec<(usize, Arc<str>)>,
}

/// The cells of a row, concatenated.
#[derive(Default)]
struct CsvRow {
    text: String,
    /// End offset of each cell in the text, and whether it was quoted.
    ends: Vec<(usize, bool)>,
}

impl CsvRow {
    fn len(&self) -> usize {
        self.ends.len()
    }

    /// True for an empty line.
    fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    fn get(&self, at: usize) -> Option<&str> {
        let (end, _) = *self.ends.get(at)?;
        let start = if at == 0 { 0 } else { self.ends[at - 1].0 };
        Some(&self.text[start..end])
    }

    /// Value of a cell, trimmed unless quoted.
    fn value(&self, at: usize) -> &str {
        let is_quoted = self.ends.get(at).is_some_and(|(_, is_quoted)| *is_quoted);
        let cell = self.get(at).unwrap_or_default();
        if is_quoted { cell } else { cell.trim() }
    }

    fn push(&mut self, cell: &str) {
        self.text.push_str(cell);
        self.ends.push((self.text.len(), false));
    }

    fn clear(&mut self) {
        self.text.clear();
        self.ends.clear();
    }
}

/// State of the parser within a cell.
#[derive(Clone, Copy, PartialEq, Eq)]
enum CsvCellState {
    /// Unquoted.
    Plain,
    /// Inside quotes.
    Open,
    /// After the closing quote.
    Closed,
}

struct CsvFeatureSource {
    window: FileWindow,
    /// Delimiter; a space stands for any white space.
    delimiter: u8,
    columns: CsvColumns,
    layer: LayerHeader,
    /// Number of lines read.
    line: u64,
    /// Number of the line where the current row begins.
    row_line: u64,
    /// Number of the line where the last feature began.
    first_line: u64,
    row: CsvRow,
    /// First row of the current feature.
    first: CsvRow,
    /// Number of rows that differ from the first row of their feature.
    others: u64,
    /// Number of values with line breaks.
    broken: u64,
    /// Number of columns of the first line, required in all lines.
    count: usize,
    /// True if `row` is the first row of the next feature.
    has_row: bool,
    is_over: bool,
    rows_are_points: bool,
    notes: Vec<String>,
}

impl FeatureSource for CsvFeatureSource {
    fn next(&mut self) -> Result<Option<Feature>> {
        if !self.has_row && !self.first_row()? {
            return Ok(None);
        }
        self.has_row = false;
        self.first_line = self.row_line;
        let id = self.cell(self.columns.id).map(str::to_owned);
        let mut part = self.cell(self.columns.part).map(str::to_owned);
        let properties = self.properties();
        let mut found = CoordinateSequence::default();
        self.position(&mut found)?;
        std::mem::swap(&mut self.row, &mut self.first);
        while !self.rows_are_points && self.next_row()? {
            if self.row.is_empty() {
                // Without ids an empty line ends a feature.
                if self.columns.id.is_none() {
                    break;
                }
                continue;
            }
            if self.cell(self.columns.id) != id.as_deref() {
                self.has_row = true;
                break;
            }
            let now = self.cell(self.columns.part);
            if now != part.as_deref() {
                found.end_part();
                part = now.map(str::to_owned);
            }
            self.position(&mut found)?;
            let mut columns = self.columns.properties.iter();
            self.others +=
                u64::from(columns.any(|(at, _)| self.row.value(*at) != self.first.value(*at)));
        }
        let kind = match (found.xy.len(), found.ends.len()) {
            (1, _) => GeometryType::Point,
            (_, 0) => GeometryType::LineString,
            _ => GeometryType::MultiLineString,
        };
        found.end_part();
        let geometry = Geometry::new(kind, found)?;
        let id = id.filter(|id| !id.is_empty());
        let id = id.map(|id| id.parse().map_or_else(|_| Id::Text(id), Id::Int));
        Ok(Some(Feature { id, properties, geometry, foreign: Vec::new() }))
    }

    fn layer(&self) -> &LayerHeader {
        &self.layer
    }

    fn location(&self) -> String {
        format!("from line {}", self.first_line.max(1))
    }

    fn notes(&self) -> Vec<String> {
        let counts = [
            (
                self.others,
                "rows have property values that differ from the first row of their line; those of the first row are used",
            ),
            (self.broken, "quoted values contain line breaks"),
        ];
        let counts = counts.iter().filter(|(count, _)| *count > 0);
        let counts = counts.map(|(count, what)| format!("{count} {what}"));
        self.notes.iter().cloned().chain(counts).collect()
    }
}

impl CsvFeatureSource {
    /// Detects the delimiter and the columns; a first line of numbers is data.
    fn header(&mut self) -> Result<()> {
        loop {
            let Some(line) = self.text()? else {
                return Err(Error::bad_input("contains no rows"));
            };
            if line.is_empty() {
                continue;
            }
            // Delimiters inside quotes do not count.
            let bare: String = line.split('"').step_by(2).collect();
            let found = [b'\t', b';', b','].into_iter().find(|d| bare.as_bytes().contains(d));
            self.delimiter = found.unwrap_or(b' ');
            self.split(&line)?;
            self.count = self.row.len();
            break;
        }
        let names = (0..self.count).filter_map(|at| self.row.get(at));
        let names: Vec<String> = names.map(|name| name.trim().to_ascii_lowercase()).collect();
        if names.first().is_some_and(|first| decimal::whole(first.as_bytes()).is_some()) {
            self.has_row = true;
            return self.without_names(names.len());
        }
        self.name_columns(&names)
    }

    fn without_names(&mut self, count: usize) -> Result<()> {
        if !(2..=4).contains(&count) {
            let message = format!("line {}: {count} columns without a header", self.row_line);
            return Err(Error::bad_input(message).remedy("add a header line such as x,y,z,id"));
        }
        let (z, m) = ((count > 2).then_some(2), (count > 3).then_some(3));
        self.columns = CsvColumns { x: 0, y: 1, z, m, ..CsvColumns::default() };
        Ok(())
    }

    fn name_columns(&mut self, names: &[String]) -> Result<()> {
        let [x, y, z, m, id, part] = [X, Y, Z, M, ID, PART].map(|known| {
            known.iter().find_map(|known| names.iter().position(|name| name == known))
        });
        let (Some(x), Some(y)) = (x, y) else {
            let found = names.join(", ").chars().take(200).collect::<String>();
            let message =
                format!("line {}: columns x and y are missing; found {found:?}", self.row_line);
            return Err(Error::bad_input(message).remedy("name them x and y, or lon and lat"));
        };
        let known = [Some(x), Some(y), z, m, id, part];
        let others = (0..names.len()).filter(|at| !known.contains(&Some(*at)));
        // Property names keep their case, unlike `names`.
        let properties =
            others.filter_map(|at| self.row.get(at).map(|name| (at, name.trim().into()))).collect();
        if names[x].starts_with("lon") && self.layer.crs.is_unknown() {
            self.layer.crs = crs::wgs84();
            self.notes
                .push("CRS is missing; WGS 84 is assumed for longitude and latitude".to_owned());
        }
        self.columns = CsvColumns { x, y, z, m, id, part, properties };
        Ok(())
    }

    /// The next line, trimmed; comments (#) are skipped.
    fn text(&mut self) -> Result<Option<String>> {
        loop {
            let Some(text) = self.line()? else { return Ok(None) };
            self.row_line = self.line;
            // A line end inside quotes belongs to the value.
            let is_open = text.bytes().filter(|byte| *byte == b'"').count() % 2 == 1;
            // White space may be the delimiter.
            let end = if is_open { &text[..] } else { text.trim_end_matches(['\r', ' ']) };
            let text = end.trim_start_matches(' ').to_owned();
            if !text.contains('"') && text.contains('\r') {
                return Err(self.bad("carriage return inside the line").remedy("correct the line"));
            }
            if !text.starts_with('#') {
                return Ok(Some(text));
            }
        }
    }

    /// The next line, unchanged.
    fn line(&mut self) -> Result<Option<String>> {
        let Some(bytes) = self.window.line()? else { return Ok(None) };
        self.line += 1;
        let line = self.line;
        limits::check("line length in bytes", bytes as u64, MAX_LINE)
            .map_err(|e| e.at(format!("line {line}")))?;
        let text = std::str::from_utf8(&self.window.text()[..bytes]).map(str::to_owned);
        let text = text.map_err(|_| {
            Error::bad_input("is not UTF-8")
                .at(format!("line {line}"))
                .remedy("convert it to UTF-8")
        })?;
        self.window.advance(bytes + 1);
        Ok(Some(text))
    }

    /// Advances to the first row of a feature.
    fn first_row(&mut self) -> Result<bool> {
        while self.next_row()? {
            if !self.row.is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Advances to the next row; an empty line gives a row without cells.
    fn next_row(&mut self) -> Result<bool> {
        if self.is_over {
            return Ok(false);
        }
        let Some(line) = self.text()? else {
            self.is_over = true;
            return Ok(false);
        };
        self.row.clear();
        if !line.trim().is_empty() {
            self.split(&line)?;
        }
        let found = self.row.len();
        if found > 0 && found != self.count {
            let message =
                format!("has {found} columns, expected {} as in the first line", self.count);
            return Err(self.bad(message).remedy("correct the line"));
        }
        Ok(true)
    }

    /// Splits a line into cells.
    fn split(&mut self, line: &str) -> Result<()> {
        self.row.clear();
        if self.delimiter == b' ' {
            line.split_whitespace().for_each(|cell| self.row.push(cell));
        } else if line.contains('"') {
            self.split_quoted(line)?;
        } else {
            line.split(char::from(self.delimiter)).for_each(|cell| self.row.push(cell));
        }
        Ok(())
    }

    /// Splits a line with quotes into cells, reading further lines for values with line breaks.
    fn split_quoted(&mut self, line: &str) -> Result<()> {
        let delimiter = char::from(self.delimiter);
        let (mut cell, mut state) = (String::new(), CsvCellState::Plain);
        let mut line = line.to_owned();
        loop {
            let mut characters = line.chars().peekable();
            while let Some(c) = characters.next() {
                let is_end = characters.peek().is_none();
                state = match (state, c) {
                    (CsvCellState::Open, '"') if characters.next_if_eq(&'"').is_some() => {
                        cell.push('"');
                        CsvCellState::Open
                    }
                    (CsvCellState::Open, '"') => CsvCellState::Closed,
                    (CsvCellState::Open, c) => {
                        cell.push(c);
                        CsvCellState::Open
                    }
                    (state, c) if c == delimiter => {
                        self.end_cell(&mut cell, state);
                        CsvCellState::Plain
                    }
                    // CR of the line end.
                    (state, '\r') if is_end => state,
                    (_, '\r') => {
                        return Err(self
                            .bad("carriage return inside the line")
                            .remedy("correct the line"));
                    }
                    (CsvCellState::Closed, ' ') => CsvCellState::Closed,
                    (CsvCellState::Closed, _) => {
                        return Err(self
                            .bad("text after the closing quotation mark of a value")
                            .remedy(QUOTING));
                    }
                    (CsvCellState::Plain, '"') if cell.trim().is_empty() => {
                        cell.clear();
                        CsvCellState::Open
                    }
                    (CsvCellState::Plain, '"') => {
                        return Err(self
                            .bad("quotation mark inside an unquoted value")
                            .remedy(QUOTING));
                    }
                    (CsvCellState::Plain, c) => {
                        cell.push(c);
                        CsvCellState::Plain
                    }
                };
            }
            if state != CsvCellState::Open {
                break;
            }
            limits::check("value length in bytes", cell.len() as u64, MAX_LINE)
                .map_err(|_| self.not_closed())?;
            self.broken += u64::from(!cell.contains('\n'));
            cell.push('\n');
            line = self.line()?.ok_or_else(|| self.not_closed())?;
        }
        self.end_cell(&mut cell, state);
        Ok(())
    }

    fn end_cell(&mut self, cell: &mut String, state: CsvCellState) {
        self.row.text.push_str(cell);
        self.row.ends.push((self.row.text.len(), state == CsvCellState::Closed));
        cell.clear();
    }

    fn not_closed(&self) -> Error {
        self.bad("quotation mark is not closed")
            .remedy("close the quotation, or double a literal quotation mark")
    }

    fn cell(&self, column: Option<usize>) -> Option<&str> {
        column.and_then(|at| self.row.get(at)).map(str::trim)
    }

    /// Properties of the first row of a feature.
    fn properties(&self) -> FeatureProperties {
        let named = self.columns.properties.iter();
        let named = named.map(|(at, name)| (name.clone(), value(self.row.value(*at))));
        FeatureProperties(named.collect())
    }

    fn position(&self, to: &mut CoordinateSequence) -> Result<()> {
        let CsvColumns { x, y, z, m, .. } = self.columns;
        let (x, y) = (self.number("x", x)?, self.number("y", y)?);
        to.push([x, y], self.optional_number("z", z)?, self.optional_number("m", m)?);
        Ok(())
    }

    /// The number in a column, if there is one; `None` for an empty cell.
    fn optional_number(&self, name: &str, column: Option<usize>) -> Result<Option<f64>> {
        let column =
            column.filter(|at| self.row.get(*at).is_some_and(|cell| !cell.trim().is_empty()));
        column.map(|at| self.number(name, at)).transpose()
    }

    fn number(&self, name: &str, at: usize) -> Result<f64> {
        let Some(cell) = self.row.get(at) else {
            let count = self.row.len();
            return Err(self.bad(format!("has {count} columns, but {name} is column {}", at + 1)));
        };
        let value = decimal::whole(cell.as_bytes()).filter(|value| value.is_finite());
        value.ok_or_else(|| {
            let cell: String = cell.trim().chars().take(40).collect();
            self.bad(format!("{name} is not a finite number: {cell:?}"))
                .remedy("correct or remove the line")
        })
    }

    fn bad(&self, message: impl std::fmt::Display) -> Error {
        Error::bad_input(message.to_string()).at(format!("line {}", self.row_line))
    }
}

/// The value of a cell: whole numbers, other finite numbers, or text.
fn value(text: &str) -> PropertyValue {
    match (text.parse(), decimal::whole(text.as_bytes())) {
        _ if text.is_empty() => PropertyValue::Null,
        (Ok(whole), _) => PropertyValue::Int(whole),
        (_, Some(real)) if real.is_finite() && text.trim() == text => PropertyValue::Real(real),
        _ => PropertyValue::Text(text.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{VectorOpenOptions, open};

    fn read(text: &str) -> Result<Vec<Feature>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, text).unwrap();
        let mut source = open(&path, &VectorOpenOptions::default())?;
        std::iter::from_fn(|| source.next().transpose()).collect()
    }

    #[test]
    fn delimiters_and_names_are_found() {
        for text in [
            "x,y,z\n1,2,3\n4,5,6\n",
            "X;Y;Z\r\n1;2;3\r\n4;5;6\r\n",
            "# made by hand\nlon\tlat\tele\n1\t2\t3\n4\t5\t6",
            "1 2   3\n 4 5 6\n\n",
            "name,z,y,x\n\"a,b\",3,2,1\n,6,5,4\n",
        ] {
            let found = read(text).unwrap();
            assert_eq!(found.len(), 1, "{text}");
            let line = found[0].geometry.coordinates();
            assert_eq!(
                (&line.xy, &line.z),
                (&vec![[1.0, 2.0], [4.0, 5.0]], &vec![3.0, 6.0]),
                "{text}"
            );
        }
        let named = read("name,z,y,x\n\"a,\"\"b\",3,2,1\n").unwrap();
        assert_eq!(named[0].properties.get("name"), Some(&PropertyValue::Text("a,\"b".to_owned())));
    }

    #[test]
    fn ids_parts_and_empty_lines_divide() {
        let found = read("id,part,x,y\n7,0,1,1\n7,0,2,2\n7,1,3,3\n7,1,4,4\n\nb,0,5,5\n").unwrap();
        assert_eq!(
            (found[0].id.clone(), found[1].id.clone()),
            (Some(Id::Int(7)), Some(Id::Text("b".into())))
        );
        assert_eq!(found[0].geometry.coordinates().ends, [2, 4]);
        assert_eq!(found[1].geometry.kind(), GeometryType::Point);
        assert_eq!(read("1,1\n2,2\n\n\n3,3\n4,4\n").unwrap().len(), 2);
    }

    #[test]
    fn what_is_no_number_is_told_with_its_line() {
        for (text, told) in [
            ("x,y\n1,2\nnan,3\n", "line 3: x is not a finite number: \"nan\""),
            ("x,y\n1,\n", "line 2: y is not"),
            ("x,y\n1,1e999\n", "line 2"),
            ("x,y\n1\n", "line 2: has 1 columns"),
            ("x,y\n1,2\n1,2,3\n", "line 3: has 3 columns, expected 2"),
            ("1 2 3\n1 2\n", "line 2: has 2 columns, expected 3"),
            ("x,y\n6\r1,2\n", "line 2: carriage return"),
            ("x,y\n8\"9\",2\n", "line 2: quotation mark inside an unquoted value"),
            ("x,y\n\"8\"9,2\n", "line 2: text after the closing quotation mark"),
            ("a,b\n1,2\n", "columns x and y are missing"),
            ("1,2,3,4,5\n", "5 columns without a header"),
            ("x,y\n\"1,2\n", "line 2: quotation mark is not closed"),
            ("\n\n", "contains no rows"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }
}
