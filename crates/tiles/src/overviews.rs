//! Tiles with too many samples to process one by one.

use super::available::KnownTiles;
use super::folder::{TileContext, TileFile};
use super::grid_levels::ScannedGrid;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::Cancel;
use terrane_globe::{
    GeodeticBounds, GlobeTileId, HeightPatch, RectRelation, TerrainSampleRun, TerrainSampler as _,
    TileBuilder, TileLevel, TileShell,
};

impl ScannedGrid<'_> {
    /// Makes a tile of a far level for each tileset; `known` has all existing tiles.
    pub(super) fn far(
        &self,
        id: GlobeTileId,
        known: &KnownTiles,
        cancel: &Cancel,
    ) -> Result<Vec<TileFile>> {
        let water = self.opened.mask.as_ref().map(|mask| mask.pixels(id));
        let context = TileContext { known, water: water.as_deref() };
        let levels = self.of_level(id).enumerate();
        levels.map(|(set, level)| self.far_of(set, level, id, context, cancel)).collect()
    }

    fn far_of(
        &self,
        set: usize,
        level: &TileLevel,
        id: GlobeTileId,
        context: TileContext<'_>,
        cancel: &Cancel,
    ) -> Result<TileFile> {
        let bounds = id.bounds();
        let mut builder = TileBuilder::new(id, level, self.overview)?;
        builder.fit(|take| {
            self.overview.runs(&bounds, 1, &mut |run| take(run));
            self.overview
                .feet(&bounds, level.stride, &mut |foot| take(TerrainSampleRun::One(foot)));
        });
        let tile = builder.refine(|shell| self.measure(&bounds, level, shell, cancel))?;
        TileFile::new(set, &tile, self.opened, level, self.overview, context)
    }

    /// Measures all samples of a rectangle: by blocks, and one by one where the bound of a block is not
    /// sufficient or exceeds the error of the level.
    fn measure(
        &self,
        bounds: &GeodeticBounds,
        level: &TileLevel,
        shell: &mut TileShell,
        cancel: &Cancel,
    ) -> Result<()> {
        let [cols, rows] = self.overview.blocks_in(bounds);
        let mut heights = Vec::new();
        for row in rows[0]..rows[1] {
            cancel.check()?;
            // Merges neighbours in a row into one read.
            let mut open: Option<Rect> = None;
            for col in cols[0]..cols[1] {
                let block = self.overview.block([col, row]);
                let corners = self.overview.corners([col, row]);
                let off = [block.off(), self.overview.bow([col, row])];
                let is_measured = block.count == 0
                    || match self.overview.lie([col, row], &corners, bounds) {
                        RectRelation::Beside => true,
                        RectRelation::Within => {
                            shell.add_block(&corners, off, block.count, level.assumed)
                        }
                        RectRelation::Across => false,
                    };
                if is_measured {
                    self.read(open.take(), bounds, level, shell, &mut heights)?;
                    continue;
                }
                let rect = self.overview.plan().rect([col, row]);
                open = Some(match open {
                    Some(before) => Rect { width: before.width + rect.width, ..before },
                    None => rect,
                });
            }
            self.read(open, bounds, level, shell, &mut heights)?;
        }
        Ok(())
    }

    fn read(
        &self,
        rect: Option<Rect>,
        bounds: &GeodeticBounds,
        level: &TileLevel,
        shell: &mut TileShell,
        heights: &mut Vec<f64>,
    ) -> Result<()> {
        let Some(rect) = rect else { return Ok(()) };
        let opened = self.opened;
        opened.read(rect, heights)?;
        let fill = self.overview.voids();
        let patch = HeightPatch::new(heights, rect, opened.survey.chart(), fill);
        patch.runs(bounds, 1, &mut |run| shell.add_run(&run, level.tolerance));
        opened.grid.copied(rect);
        Ok(())
    }
}
