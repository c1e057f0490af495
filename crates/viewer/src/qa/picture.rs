//! Pictures of the cells: density, and differences between flight lines.

use std::path::Path;

use super::lattice::QaLattice;
use crate::cloud_picture::{DENSITIES, density_colour};
use crate::view::encode_png;
use terrane_base::error::Result;
use terrane_engine::{Cancel, Resources, Silent};

/// Most pixels along a side.
const MAX_SIDE: u64 = 640;
/// Most bytes of the pixels of a picture, and of its file.
pub(super) const PICTURE_BYTES: u64 = MAX_SIDE * MAX_SIDE * (size_of::<QaPixel>() as u64 + 16);
/// Colours of differences, low to high.
const DIFFERENCES: [[u8; 3]; 4] = [[222, 235, 226], [250, 214, 120], [224, 110, 60], [128, 18, 40]];

/// Cells of a pixel.
#[derive(Clone, Copy, Debug, Default)]
struct QaPixel {
    points: u64,
    cells: u64,
    /// Largest difference, of cells that were compared.
    difference: Option<f32>,
}

/// Pixels over the bounds of the headers.
pub(super) struct QaPicture {
    /// Cells along the side of a pixel.
    step: u64,
    size: [u64; 2],
    rows: u64,
    pixels: Vec<QaPixel>,
}

/// A picture as a PNG file, and its scale.
pub(super) struct DrawnPicture {
    pub(super) png: Vec<u8>,
    pub(super) size: [u64; 2],
    /// Values from this one on have the last colour.
    pub(super) highest: f64,
    /// Colours from low to high.
    pub(super) colours: &'static [[u8; 3]],
}

impl QaPicture {
    pub(super) fn new(lattice: &QaLattice) -> Self {
        let step = lattice.size.into_iter().max().unwrap_or(1).div_ceil(MAX_SIDE).max(1);
        let size = lattice.size.map(|cells| cells.div_ceil(step));
        let pixels = vec![QaPixel::default(); (size[0] * size[1]) as usize];
        Self { step, size, rows: lattice.size[1], pixels }
    }

    /// Cells along the side of a pixel.
    pub(super) fn step(&self) -> u64 {
        self.step
    }

    /// Adds a cell (row, column); cells outside the bounds of the headers are not drawn.
    pub(super) fn add(&mut self, cell: [i32; 2], points: u64, difference: Option<f64>) {
        let [Ok(row), Ok(col)] = cell.map(u64::try_from) else { return };
        let Some(down) = self.rows.checked_sub(row + 1) else { return };
        let [across, down] = [col / self.step, down / self.step];
        if across >= self.size[0] {
            return;
        }
        let pixel = &mut self.pixels[(down * self.size[0] + across) as usize];
        pixel.points += points;
        pixel.cells += 1;
        if let Some(difference) = difference {
            let difference = difference as f32;
            pixel.difference = Some(pixel.difference.map_or(difference, |it| it.max(difference)));
        }
    }

    /// Points per cell; cells with `most` points and more have the last colour.
    pub(super) fn densities(&self, most: u64, resources: &Resources) -> Result<DrawnPicture> {
        let most = most.max(1) as f64;
        let value = |pixel: &QaPixel| {
            (pixel.cells > 0).then(|| pixel.points as f64 / pixel.cells as f64 / most)
        };
        self.draw(most, &DENSITIES, value, resources)
    }

    /// The largest difference of a pixel; `None` if nothing was compared.
    pub(super) fn differences(&self, resources: &Resources) -> Result<Option<DrawnPicture>> {
        let mut all: Vec<f32> = self.pixels.iter().filter_map(|pixel| pixel.difference).collect();
        let Some(last) = all.len().checked_sub(1) else { return Ok(None) };
        // A few outliers must not hide the others.
        let (_, highest, _) = all.select_nth_unstable_by(last * 98 / 100, f32::total_cmp);
        let highest = f64::from(*highest).max(f64::MIN_POSITIVE);
        let value = |pixel: &QaPixel| pixel.difference.map(|it| f64::from(it) / highest);
        self.draw(highest, &DIFFERENCES, value, resources).map(Some)
    }

    fn draw(
        &self,
        highest: f64,
        colours: &'static [[u8; 3]],
        value: impl Fn(&QaPixel) -> Option<f64> + Sync,
        resources: &Resources,
    ) -> Result<DrawnPicture> {
        let size = self.size.map(|pixels| pixels as usize);
        let mut png = Vec::new();
        let fill = |row: usize, line: &mut [u8]| {
            let (out, _) = line.as_chunks_mut::<4>();
            for (out, pixel) in out.iter_mut().zip(&self.pixels[row * size[0]..]) {
                *out = value(pixel).map_or([0; 4], |at| {
                    let [r, g, b] = density_colour(colours, at);
                    [r, g, b, 255]
                });
            }
        };
        encode_png(
            (&mut png, Path::new("picture")),
            size,
            fill,
            resources,
            &Silent,
            &Cancel::default(),
        )?;
        Ok(DrawnPicture { png, size: self.size, highest, colours })
    }
}
