//! Writing: features wait until all columns are known.

use std::path::{Path, PathBuf};

use crate::atomic::Sidecar;
use crate::error::{Error, Result};
use crate::vector::crs;
use crate::vector::feature::{Feature, Layer, Member, Value};
use crate::vector::geometry::Kind;
use crate::vector::number;
use crate::vector::out::Out;
use crate::vector::sink::{FeatureSink, WriteOptions, Written};
use crate::vector::table::{Row, Rows, Table, push_text};

/// Starts a file.
pub(super) fn create(
    path: &Path,
    layer: &Layer,
    options: &WriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    Ok(Box::new(Sink {
        out: Out::create(path, options.overwrite)?,
        prj: crs::prj(path, &layer.crs, options.overwrite)?,
        notes: crs::notes(&layer.crs),
        table: Table::new(path, layer, options.temp_dir.as_deref())?,
        decimals: options.decimals,
        has_z: false,
        has_m: false,
        path: path.to_path_buf(),
    }))
}

struct Sink {
    out: Out,
    prj: Sidecar,
    notes: Vec<String>,
    table: Table,
    decimals: Option<u8>,
    has_z: bool,
    has_m: bool,
    path: PathBuf,
}

impl FeatureSink for Sink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        let kind = feature.geometry.kind();
        let place = format!("feature {}", self.table.len() + 1);
        if !matches!(kind, Kind::Null | Kind::Point | Kind::LineString | Kind::MultiLineString) {
            return Err(Error::usage(format!("CSV holds points and lines, no {}", kind.name()))
                .in_file(&self.path)
                .at(place)
                .remedy("write GeoJSON or FlatGeobuf"));
        }
        self.has_z |= feature.geometry.has_z();
        self.has_m |= feature.geometry.has_m();
        self.table.push(feature, usize::MAX).map_err(|e| e.at(place).in_file(&self.path))
    }

    fn finish(self: Box<Self>, _: &[Member]) -> Result<Written> {
        let this = *self;
        let mut rows = this.table.finish()?;
        let mut out = this.out;
        let mut pen = Pen::new(&rows, this.has_z, this.has_m, this.decimals);
        pen.head(&rows, &mut out.buffer);
        let mut empty = 0;
        for at in 0..rows.len() {
            let row = rows.get(at)?;
            empty += u64::from(row.geometry.is_empty());
            pen.row(at, &row, &mut out.buffer);
            out.settle()?;
        }
        let mut notes = this.notes;
        notes.append(&mut rows.notes);
        if empty > 0 {
            notes.push(format!(
                "{empty} features without a vertex are left out: CSV has a line for each vertex"
            ));
        }
        let (path, mut bytes) = out.commit()?;
        let mut files = vec![path];
        this.prj.commit()?;
        if let Some((path, more)) = this.prj.place() {
            files.push(path);
            bytes += more;
        }
        Ok(Written { features: rows.len() as u64 - empty, bytes, files, notes })
    }
}

struct Pen {
    /// The column of ids.
    id: Option<usize>,
    columns: usize,
    has_z: bool,
    has_m: bool,
    decimals: Option<u8>,
    /// The cells behind a feature's vertices.
    tail: Vec<u8>,
}

impl Pen {
    fn new(rows: &Rows, has_z: bool, has_m: bool, decimals: Option<u8>) -> Self {
        let id = rows.columns.iter().position(|column| *column.name == *"id");
        Self { id, columns: rows.columns.len(), has_z, has_m, decimals, tail: Vec::new() }
    }

    fn head(&self, rows: &Rows, text: &mut Vec<u8>) {
        text.extend_from_slice(b"id,part,x,y");
        if self.has_z {
            text.extend_from_slice(b",z");
        }
        if self.has_m {
            text.extend_from_slice(b",m");
        }
        for (at, column) in rows.columns.iter().enumerate() {
            if Some(at) != self.id {
                text.push(b',');
                push_cell(column.name.as_bytes(), text);
            }
        }
        text.push(b'\n');
    }

    fn row(&mut self, number: usize, row: &Row, text: &mut Vec<u8>) {
        let mut cells = vec![Vec::new(); self.columns];
        row.values.iter().for_each(|(at, value)| push_text(value, &mut cells[*at]));
        let mut id = Vec::new();
        let own = self.id.map(|at| &cells[at]).filter(|cell| !cell.is_empty());
        match own {
            Some(own) => push_cell(own, &mut id),
            None => push_text(&Value::Int(number as i64 + 1), &mut id),
        }
        self.tail.clear();
        for (at, cell) in cells.iter().enumerate() {
            if Some(at) != self.id {
                self.tail.push(b',');
                push_cell(cell, &mut self.tail);
            }
        }
        let found = row.geometry.coordinates();
        let mut part = 0;
        for at in 0..found.xy.len() {
            part += usize::from(found.ends.get(part) == Some(&at));
            text.extend_from_slice(&id);
            text.push(b',');
            push_text(&Value::Int(part as i64), text);
            for value in found.xy[at] {
                text.push(b',');
                number::push(value, self.decimals, text);
            }
            for (is_there, values) in [(self.has_z, &found.z), (self.has_m, &found.m)] {
                if is_there {
                    text.push(b',');
                    if let Some(value) = values.get(at).filter(|value| !value.is_nan()) {
                        number::push(*value, self.decimals, text);
                    }
                }
            }
            text.extend_from_slice(&self.tail);
            text.push(b'\n');
        }
    }
}

/// Appends a cell, in quotation marks where it must be; line breaks become spaces.
fn push_cell(cell: &[u8], text: &mut Vec<u8>) {
    let is_plain =
        !cell.iter().any(|byte| matches!(byte, b',' | b'"' | b'\n' | b'\r' | b';' | b'\t'));
    if is_plain {
        text.extend_from_slice(cell);
        return;
    }
    text.push(b'"');
    for &byte in cell {
        match byte {
            b'"' => text.extend_from_slice(b"\"\""),
            b'\n' | b'\r' => text.push(b' '),
            byte => text.push(byte),
        }
    }
    text.push(b'"');
}
