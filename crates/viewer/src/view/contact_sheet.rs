//! Meshes side by side in one picture, each with a few lines of text below it, to compare them.

use super::drawn::{DrawnSurface, PIXEL_BYTES};
use super::options::ViewJob;
use super::{mesh, options, style, write_png};
use crate::render::{FieldPainter, text_size, write_text};
use terrane_base::error::{Error, Result};
use terrane_engine::input::{self, SurfaceInput};
use terrane_engine::memory::short;
use terrane_engine::{Cancel, Progress};
use terrane_files::atomic::{AtomicFile, refuse_existing};

/// A mesh and its caption.
#[derive(Clone, Debug)]
pub struct PicturePanel {
    /// Mesh file.
    pub mesh: String,
    /// Lines of text: letters, digits, commas, points and hyphens.
    pub lines: Vec<String>,
}

/// A picture of several meshes.
#[derive(Clone, Debug)]
pub struct ContactSheetJob {
    /// The meshes, row by row.
    pub panels: Vec<PicturePanel>,
    /// Number of panels in a row; at least 1.
    pub columns: usize,
    /// Options of each panel, without its input, and the output; `width` is that of a panel. The default
    /// exaggeration is that of the first.
    pub each: ViewJob,
}

/// Pixels between panels, and around all.
const GAP: usize = 16;
/// Pixels of a dot of a letter, and between lines of text.
const DOT: usize = 2;
const LEADING: usize = 6;
const PAPER: [u8; 4] = [255; 4];
const INK: [u8; 4] = [26, 33, 51, 255];

/// Draws all panels into one PNG; returns its columns and rows. Memory: all its pixels, and [`run`](super::run) for a
/// panel.
///
/// # Errors
/// The errors of [`run`](super::run); usage for an input that is not a mesh.
pub fn run_contact_sheet(
    job: &ContactSheetJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<[usize; 2]> {
    refuse_existing(&job.each.output, job.each.options.replacing.overwrite)?;
    let mut each = job.each.clone();
    let mut sheet = None;
    for (place, panel) in job.panels.iter().enumerate() {
        each.input = panel.mesh.clone().into();
        let drawn = drawn(&each, progress, cancel)?;
        let style = style(&each, &drawn);
        each.options.lighting.heights.exaggeration = Some(style.exaggeration);
        let painter = drawn.painter(style);
        if sheet.is_none() {
            sheet = Some(ContactSheet::new(job, [painter.width(), painter.height()])?);
        }
        sheet.iter_mut().for_each(|sheet| sheet.put(place, &painter, &panel.lines));
    }
    let sheet = sheet.ok_or_else(|| Error::usage("no mesh to draw").remedy("name one"))?;
    let mut file = AtomicFile::create(&each.output, each.options.replacing.overwrite)?;
    write_png(
        &mut file,
        sheet.size,
        |row, line| line.copy_from_slice(sheet.row(row)),
        &each.options.resources,
        progress,
        cancel,
    )?;
    file.commit()?;
    Ok(sheet.size)
}

fn drawn(job: &ViewJob, progress: &dyn Progress, cancel: &Cancel) -> Result<DrawnSurface> {
    match input::open(job.input.names(), &options(job)?)? {
        SurfaceInput::Mesh(mesh) => mesh::draw(mesh.as_ref(), job, progress, cancel),
        SurfaceInput::Grid(_) => Err(Error::usage(format!("{} is a grid, not a mesh", job.input))
            .remedy("make a mesh with ‹terrane tin›")),
    }
}

/// The picture: cells of one size, a panel with its text in each.
struct ContactSheet {
    size: [usize; 2],
    columns: usize,
    /// Pixels of a panel, and of its cell with the text and the gap.
    panel: [usize; 2],
    cell: [usize; 2],
    pixels: Vec<u8>,
}

impl ContactSheet {
    /// An empty sheet for panels of `panel` pixels.
    fn new(job: &ContactSheetJob, panel: [usize; 2]) -> Result<Self> {
        let lines = job.panels.iter().map(|panel| panel.lines.len()).max().unwrap_or(0);
        let text = lines * (text_size("", DOT)[1] + LEADING);
        let cell = [panel[0] + GAP, panel[1] + text + GAP];
        let columns = job.columns.clamp(1, job.panels.len());
        let rows = job.panels.len().div_ceil(columns);
        let size = [columns * cell[0] + GAP, rows * cell[1] + GAP];
        let need = (size[0] * size[1] * 4) as u64 + (panel[0] * panel[1]) as u64 * PIXEL_BYTES;
        if need > job.each.options.resources.memory {
            let mib = need.div_ceil(1 << 20);
            let message = format!("the combined picture needs {mib} MiB of memory");
            return Err(short(message, need));
        }
        let pixels = PAPER.repeat(size[0] * size[1]);
        Ok(Self { size, columns, panel, cell, pixels })
    }

    fn row(&self, row: usize) -> &[u8] {
        &self.pixels[row * self.size[0] * 4..(row + 1) * self.size[0] * 4]
    }

    /// Paints a panel, cropped to its cell, and its text.
    fn put(&mut self, place: usize, painter: &FieldPainter<'_>, lines: &[String]) {
        let left = GAP + place % self.columns * self.cell[0];
        let top = GAP + place / self.columns * self.cell[1];
        let mut painted = vec![0; painter.width() * 4];
        for row in 0..painter.height().min(self.panel[1]) {
            painter.row(row, &mut painted);
            for (col, pixel) in painted.chunks_exact(4).take(self.panel[0]).enumerate() {
                self.over([left + col, top + row], pixel);
            }
        }
        let mut below = top + self.panel[1] + LEADING;
        for line in lines {
            write_text(line, DOT, |col, row| {
                if col < self.panel[0] {
                    self.over([left + col, below + row], &INK);
                }
            });
            below += text_size("", DOT)[1] + LEADING;
        }
    }

    /// Composites a colour over a pixel.
    fn over(&mut self, [col, row]: [usize; 2], colour: &[u8]) {
        let at = (row * self.size[0] + col) * 4;
        let alpha = u32::from(colour[3]);
        for (old, &new) in self.pixels[at..at + 3].iter_mut().zip(colour) {
            *old = ((u32::from(new) * alpha + u32::from(*old) * (255 - alpha) + 127) / 255) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::PictureOptions;
    use terrane_base::error::ErrorKind;
    use terrane_engine::Silent;

    /// Two triangles that make a square, `high` at a corner.
    fn square(high: f64) -> String {
        format!(
            "v 0 0 0\nv 8 0 {high}\nv 8 8 0\nv 0 8 0\n\
             f 1 2 3\nf 1 3 4\n"
        )
    }

    fn job(folder: &std::path::Path, count: usize) -> ContactSheetJob {
        let mesh = |i: usize| {
            let path = folder.join(format!("{i}.obj"));
            std::fs::write(&path, square(i as f64)).unwrap();
            PicturePanel {
                mesh: path.to_str().unwrap().to_owned(),
                lines: vec!["one".into(), "2".into()],
            }
        };
        let each = ViewJob {
            input: "".into(),
            output: folder.join("all.png"),
            options: PictureOptions { width: Some(60), edges: true, ..PictureOptions::default() },
        };
        ContactSheetJob { panels: (0..count).map(mesh).collect(), columns: 2, each }
    }

    #[test]
    fn panels_stand_in_rows_with_text_below_each() {
        let folder = tempfile::tempdir().unwrap();
        let job = job(folder.path(), 3);
        let size = run_contact_sheet(&job, &Silent, &Cancel::default()).unwrap();
        let text = 2 * (18 + LEADING);
        assert_eq!(size, [GAP + 2 * (60 + GAP), GAP + 2 * (60 + text + GAP)]);
        let file = std::io::BufReader::new(std::fs::File::open(&job.each.output).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let at = |col: usize, row: usize| &pixels[(row * size[0] + col) * 4..][..4];
        let row_of_cells = 60 + text + GAP;
        for [left, top] in [[GAP, GAP], [GAP + 60 + GAP, GAP], [GAP, GAP + row_of_cells]] {
            assert_ne!(at(left + 30, top + 30), PAPER, "a panel");
            let below = (0..36 * 24).any(|i| at(left + i % 36, top + 60 + i / 36) == INK);
            assert!(below, "its text");
            assert_eq!(at(left - 2, top + 30), PAPER, "the gap");
        }
        assert_eq!(at(GAP + 60 + GAP + 30, GAP + row_of_cells + 30), PAPER, "no fourth");
    }

    #[test]
    fn nothing_too_much_and_grids_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut refused = job(folder.path(), 1);
        let kind = |job: &ContactSheetJob| {
            run_contact_sheet(job, &Silent, &Cancel::default()).unwrap_err().kind()
        };
        refused.each.options.resources.memory = PIXEL_BYTES * 60 * 60;
        assert_eq!(kind(&refused), ErrorKind::Resource);
        refused.panels[0].mesh = "synth:rough,size=9".to_owned();
        assert_eq!(kind(&refused), ErrorKind::Usage);
        refused.panels.clear();
        assert_eq!(kind(&refused), ErrorKind::Usage);
        assert!(!refused.each.output.exists());
    }
}
