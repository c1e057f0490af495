//! Tiles of regions, whose samples are read once.

use std::cell::RefCell;

use super::available::KnownTiles;
use super::folder::{TileContext, TileFile};
use super::grid_levels::ScannedGrid;
use super::input::{APRON, max_samples};
use super::mask::TileWaterMask;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::Cancel;
use terrane_globe::{GeodeticBounds, GlobeTileId, HeightPatch, build};

thread_local! {
    /// Buffer for the samples of a region.
    static HEIGHTS: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// Output of the tiles of a region, and its state.
struct TileDescent<'a> {
    patch: &'a HeightPatch<'a>,
    /// Water near the region.
    water: Option<TileWaterMask>,
    known: KnownTiles,
    put: &'a mut dyn FnMut(TileFile) -> Result<()>,
    cancel: &'a Cancel,
}

impl ScannedGrid<'_> {
    /// Makes a region and all tiles in it, each after its own parts.
    pub(super) fn region(
        &self,
        id: GlobeTileId,
        put: &mut dyn FnMut(TileFile) -> Result<()>,
        cancel: &Cancel,
    ) -> Result<()> {
        let (opened, chart) = (self.opened, self.opened.survey.chart());
        let rect = self.rect(&id.bounds());
        if rect.is_empty() {
            return Ok(());
        }
        if rect.len() as u64 > max_samples(chart) {
            return Err(Error::unsupported("has a sample spacing too small for tiles")
                .in_file(&opened.name())
                .remedy("clip it, or resample it to a larger cell size"));
        }
        let mut heights = HEIGHTS.take();
        opened.read(rect, &mut heights)?;
        let fill = self.overview.voids();
        let patch = HeightPatch::new(&heights, rect, chart, fill).with_positions();
        let water = opened.mask.as_ref().map(|mask| mask.near(id));
        let mut descent =
            TileDescent { patch: &patch, water, known: KnownTiles::default(), put, cancel };
        match id.level <= opened.division.last {
            true => self.descend(id, &mut descent)?,
            // All tiles are larger; parents only need to know that this one exists.
            false if patch.holds_any(&id.bounds()) => (descent.put)(TileFile::nothing(id))?,
            false => (),
        }
        opened.grid.copied(rect);
        HEIGHTS.set(heights);
        Ok(())
    }

    /// Samples in a rectangle, with a margin.
    fn rect(&self, bounds: &GeodeticBounds) -> Rect {
        let chart = self.opened.survey.chart();
        let ranges = chart.range(bounds);
        let [cols, rows] = [0, 1].map(|axis: usize| {
            let (count, [low, high]) = (f64::from(chart.size()[axis]), ranges[axis]);
            let low = low.floor() - f64::from(APRON);
            let high = high.ceil() + f64::from(APRON) + 1.0;
            [low, high].map(|at| at.clamp(0.0, count) as u32)
        });
        Rect::new(cols[0], rows[0], cols[1] - cols[0], rows[1] - rows[0])
    }

    fn descend(&self, id: GlobeTileId, to: &mut TileDescent<'_>) -> Result<()> {
        to.cancel.check()?;
        if !to.patch.holds_any(&id.bounds()) {
            return Ok(());
        }
        to.known.insert(id);
        if id.level < self.opened.division.last {
            id.children().into_iter().try_for_each(|child| self.descend(child, to))?;
        }
        let water = to.water.as_ref().map(|water| water.pixels(id));
        for (set, level) in self.of_level(id).enumerate() {
            let tile = build(id, level, to.patch)?;
            let context = TileContext { known: &to.known, water: water.as_deref() };
            (to.put)(TileFile::new(set, &tile, self.opened, level, to.patch, context)?)?;
        }
        Ok(())
    }
}
