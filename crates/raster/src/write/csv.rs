//! CSV tables: one row per valid cell, with its centre and one column per band.

use std::fmt::{Display, Write};
use std::sync::Mutex;

use super::format::{GridFormat, GridSink, GridWriteOptions, GridWriteRequest};
use super::sidecar::{self, Sidecars};
use crate::grid::{GridInfo, SampleType};
use crate::tiled_tiff::HeightSlice;
use crate::tiled_tiff::sample::{SampleCodec, TiledTiffHeight};
use terrane_base::error::Result;
use terrane_base::geom::{Affine, Rect};
use terrane_files::atomic::AtomicFile;
use terrane_files::{AppendWriter, lock, unlocked};

/// The registry entry.
pub(super) const FORMAT: GridFormat = GridFormat {
    name: "CSV",
    extensions: &["csv"],
    about: "table of x and y of cell centres with a column per band; CRS in .prj",
    options: &[],
    several_bands: true,
    holds_colours: false,
    holds_types: true,
    names_voids: false,
    bytes_per_sample: 160,
    create: |order| Ok(Box::new(CsvSink::new(order)?)),
};

/// Approximate number of cells of a block; at least one row.
const BLOCK_CELLS: u32 = 1 << 13;
/// Maximum number of decimals of coordinates, which resolve a millionth of a cell.
const MAX_DECIMALS: f64 = 15.0;

/// A table under construction.
struct CsvSink {
    target: AtomicFile,
    info: GridInfo,
    /// Whether 0 means no value, by band.
    counts: Vec<bool>,
    /// Codec of integer values.
    codec: Option<SampleCodec>,
    decimals: usize,
    sidecars: Sidecars,
    rows: Mutex<GridCsvRows>,
}

/// Buffered rows.
struct GridCsvRows {
    text: AppendWriter,
    /// Columns of the bands of the current block.
    columns: Vec<Vec<u8>>,
}

impl CsvSink {
    fn new(order: &GridWriteRequest<'_>) -> Result<Self> {
        let sample_type = order.options.sample_type.unwrap_or(order.info.sample_type);
        let info = GridInfo { sample_type, nodata: None, ..order.heights(SampleType::F64)? };
        order.info.check_cells()?;
        let is_float = matches!(sample_type, SampleType::F32 | SampleType::F64);
        let codec = SampleCodec::new(&info);
        let codec = (!is_float).then(|| codec.rounding(order.rounding()));
        let target = AtomicFile::create(order.path, order.options.overwrite)?;
        let mut sidecars = Sidecars::new(order.path, order.options);
        sidecars.add_prj(&info.crs)?;
        let mut text = AppendWriter::of(&target, 0)?;
        text.write(heading(order.options).as_bytes())?;
        let counts = match order.options.bands.as_slice() {
            [] => vec![false],
            bands => bands.iter().map(|band| band.counts).collect(),
        };
        let rows = Mutex::new(GridCsvRows { text, columns: Vec::new() });
        let decimals = decimals(&info.transform);
        Ok(Self { target, info, counts, codec, decimals, sidecars, rows })
    }

    /// Values of a band, one per line; for the first band after the coordinates. Voids are empty.
    fn column<H: TiledTiffHeight + Display>(
        &self,
        band: u32,
        rect: Rect,
        values: &[H],
    ) -> Result<Vec<u8>> {
        let mut text = String::new();
        let rows = (rect.row..).zip(values.chunks_exact(rect.width as usize));
        let cells = rows.flat_map(|(row, line)| {
            (rect.col..).zip(line).map(move |(col, value)| (col, row, *value))
        });
        for (col, row, value) in cells {
            if band == 0 {
                for coordinate in self.info.transform.apply(f64::from(col), f64::from(row)) {
                    self.coordinate(coordinate, &mut text);
                }
            }
            match &self.codec {
                _ if value.is_void() => {}
                Some(codec) => {
                    let fitting = codec.fit(value.to_f64()).map_err(|misfit| {
                        codec.refusal(misfit, col, row).in_file(self.target.path())
                    })?;
                    put(&mut text, fitting);
                }
                None => put(&mut text, value),
            }
            text.push('\n');
        }
        Ok(text.into_bytes())
    }

    /// Appends a coordinate and a comma.
    fn coordinate(&self, value: f64, text: &mut String) {
        let from = text.len();
        put(text, format_args!("{value:.*}", self.decimals));
        if self.decimals > 0 {
            let short = text[from..].trim_end_matches('0').trim_end_matches('.').len();
            text.truncate(from + short);
        }
        text.push(',');
    }

    /// Rows of a block whose columns are complete.
    fn lines(&self, columns: &[Vec<u8>]) -> Vec<u8> {
        let mut out = Vec::with_capacity(columns.iter().map(Vec::len).sum());
        let mut columns: Vec<_> =
            columns.iter().map(|column| column.split(|byte| *byte == b'\n')).collect();
        loop {
            let start = out.len();
            let mut is_void = true;
            for (column, counts) in columns.iter_mut().zip(&self.counts) {
                let Some(cell) = column.next() else { return out };
                let value = cell.rsplit(|byte| *byte == b',').next().unwrap_or_default();
                is_void &= value.is_empty() || (*counts && value == b"0");
                out.extend_from_slice(cell);
                out.push(b',');
            }
            out.pop();
            out.push(b'\n');
            if is_void {
                out.truncate(start);
            }
        }
    }
}

/// Header row.
fn heading(options: &GridWriteOptions) -> String {
    let mut names = vec!["x".to_owned(), "y".to_owned()];
    names.extend(options.bands.iter().map(|band| quoted(&band.name)));
    if options.bands.is_empty() {
        names.push("z".to_owned());
    }
    names.join(",") + "\n"
}

/// A name, in quotes where necessary.
fn quoted(name: &str) -> String {
    match name.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name.to_owned(),
    }
}

/// Number of decimals that resolves cells.
fn decimals(transform: &Affine) -> usize {
    let Affine { a, b, d, e, .. } = *transform;
    let cell = a.hypot(d).min(b.hypot(e));
    (6.0 - cell.log10()).ceil().clamp(0.0, MAX_DECIMALS) as usize
}

fn put(text: &mut String, value: impl Display) {
    // Writing to a string does not fail.
    let _ = write!(text, "{value}");
}

impl GridSink for CsvSink {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn block(&self) -> (u32, u32) {
        let GridInfo { width, height, .. } = self.info;
        (width, (BLOCK_CELLS / width).clamp(1, height))
    }

    fn encode(
        &self,
        band: u32,
        rect: Rect,
        heights: HeightSlice<'_>,
        out: &mut Vec<u8>,
    ) -> Result<()> {
        *out = match heights {
            HeightSlice::F32(heights) => self.column(band, rect, heights)?,
            HeightSlice::F64(heights) => self.column(band, rect, heights)?,
        };
        Ok(())
    }

    fn append(&self, bytes: &[u8]) -> Result<()> {
        let GridCsvRows { text, columns } = &mut *lock(&self.rows);
        columns.push(bytes.to_vec());
        if columns.len() < self.counts.len() {
            return Ok(());
        }
        text.write(&self.lines(&std::mem::take(columns)))
    }

    fn notes(&self) -> Vec<String> {
        sidecar::lost(&self.info)
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        let Self { target, sidecars, rows, .. } = *self;
        unlocked(rows).text.flush()?;
        sidecars.commit()?;
        target.commit()
    }
}
