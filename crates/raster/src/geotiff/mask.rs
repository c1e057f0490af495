//! Masks in addition to nodata: an internal mask (TIFF 6.0, NewSubfileType bit 2), a `.msk` sidecar, and an
//! alpha band. A sample is void if any of them is 0.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use crate::cache::SharedBlocks;
use crate::sample::HeightSample;
use crate::sidecars;
use crate::window::SampleWindow;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;
use terrane_files::RawFile;

use super::ifd::GeoTiffDirectory;
use super::image::{GeoTiffImage, check_cache};
use super::layout::GeoTiffLayout;
use super::tags;

/// Bits of NewSubfileType.
const REDUCED: u64 = 1;
const MASK: u64 = 4;
/// Values of ExtraSamples for associated and unassociated alpha.
const ALPHA: [u64; 2] = [1, 2];

/// A mask.
pub(super) struct GeoTiffMask {
    pub(super) image: GeoTiffImage,
    /// Name for `terrane info`.
    pub(super) name: String,
}

/// The grid whose masks are searched.
#[derive(Clone, Copy)]
pub(super) struct MaskedGrid<'a> {
    pub(super) file: &'a Arc<RawFile>,
    pub(super) directory: &'a GeoTiffDirectory<'a>,
    pub(super) layout: &'a GeoTiffLayout,
    /// The selected band, from 0.
    pub(super) band: u32,
    pub(super) cache_bytes: usize,
}

/// All masks of a grid.
pub(super) fn find(grid: MaskedGrid<'_>) -> Result<Vec<GeoTiffMask>> {
    let mut masks = Vec::new();
    if let Some(directory) = internal(grid.directory)? {
        let mask = grid.mask(grid.file, &directory, "internal".to_owned(), 1);
        masks.push(mask.map_err(|e| e.at("internal mask"))?);
    }
    if let Some(path) = sidecars::mask(grid.file.path()) {
        masks.push(grid.open_sidecar(&path).map_err(|e| e.in_file(&path))?);
    }
    masks.extend(grid.alpha()?);
    Ok(masks)
}

/// The directory of the full-resolution mask.
fn internal<'a>(first: &GeoTiffDirectory<'a>) -> Result<Option<GeoTiffDirectory<'a>>> {
    let mut seen = HashSet::from([first.next]);
    let mut next = first.following()?;
    while let Some(directory) = next {
        let kind = directory.int(tags::NEW_SUBFILE_TYPE)?.unwrap_or(0);
        if kind & MASK != 0 && kind & REDUCED == 0 {
            return Ok(Some(directory));
        }
        if !seen.insert(directory.next) {
            break; // The chain is a ring, and all of it has been seen.
        }
        limits::check("number of directories", seen.len() as u64, limits::MAX_DIRECTORIES)?;
        next = directory.following()?;
    }
    Ok(None)
}

impl MaskedGrid<'_> {
    fn open_sidecar(&self, path: &Path) -> Result<GeoTiffMask> {
        let file = Arc::new(RawFile::open(path)?);
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let directory = GeoTiffDirectory::read(&file)?;
        self.mask(&file, &directory, name, 2)
    }

    fn mask(
        &self,
        file: &Arc<RawFile>,
        directory: &GeoTiffDirectory<'_>,
        name: String,
        slot: usize,
    ) -> Result<GeoTiffMask> {
        let layout = GeoTiffLayout::read_mask(directory)?;
        self.check_shape(&layout)?;
        check_cache(&layout, self.cache_bytes)?;
        let band = if layout.bands == 1 { 0 } else { self.band };
        Ok(GeoTiffMask { image: GeoTiffImage::new(file, directory, layout, band, slot)?, name })
    }

    /// A mask has the size of the grid, and one band for all or one per band.
    fn check_shape(&self, mask: &GeoTiffLayout) -> Result<()> {
        let grid = self.layout;
        let same_size = (mask.width, mask.height) == (grid.width, grid.height);
        if same_size && (mask.bands == 1 || mask.bands == grid.bands) {
            return Ok(());
        }
        let message = format!(
            "mask of {} x {} samples and {} bands for a grid of {} x {} and {} is not supported",
            mask.width, mask.height, mask.bands, grid.width, grid.height, grid.bands
        );
        Err(Error::unsupported(message)
            .remedy("write the grid without its mask: gdal_translate -mask none IN OUT"))
    }

    /// The last band, if it is declared as alpha and is not the selected band.
    fn alpha(&self) -> Result<Option<GeoTiffMask>> {
        let last = self.layout.bands - 1;
        let extra = self.directory.ints(tags::EXTRA_SAMPLES)?.unwrap_or_default();
        if self.band == last || !extra.last().is_some_and(|kind| ALPHA.contains(kind)) {
            return Ok(None);
        }
        let image = GeoTiffImage::new(self.file, self.directory, self.layout.clone(), last, 3)?;
        Ok(Some(GeoTiffMask { image, name: format!("alpha (band {})", last + 1) }))
    }
}

impl GeoTiffMask {
    /// Voids the heights of `window` (samples `rect`) where the mask is 0 or sparse.
    pub(super) fn apply<H: HeightSample>(
        &self,
        rect: Rect,
        cache: &SharedBlocks,
        window: &mut SampleWindow<'_, H>,
    ) -> Result<()> {
        let size = self.image.blocks.layout.sample_type.bytes();
        self.image.each_row(rect, cache, |part, row, samples| {
            let heights = window.row(part, row);
            match samples {
                Some(samples) => void_zeros(samples, size, heights),
                None => heights.fill(H::VOID),
            }
        })
    }
}

/// Voids the heights whose mask sample of `size` bytes is 0.
fn void_zeros<H: HeightSample>(samples: &[u8], size: usize, heights: &mut [H]) {
    for (height, sample) in heights.iter_mut().zip(samples.chunks_exact(size)) {
        if sample.iter().all(|byte| *byte == 0) {
            *height = H::VOID;
        }
    }
}
