//! Tiles of coarse ("far") levels, which cover too many samples to read them all for each tile.
//!
//! Vertices come from the overview of the grid, which has a plane and the two samples furthest from it for each block
//! of samples. The error bound still holds for every sample: a block counts with an upper bound of its error, and where
//! that is too large its samples are read from the grid and measured one by one.

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
    /// Makes tile `id`, of a far level, for each output format; `known` has all tiles that exist.
    pub(super) fn far(
        &self,
        id: GlobeTileId,
        known: &KnownTiles,
        cancel: &Cancel,
    ) -> Result<Vec<TileFile>> {
        let water = self.opened.mask.as_ref().map(|mask| mask.pixels(id));
        let context = TileContext { known, water: water.as_deref() };
        let levels = self.of_level(id).enumerate();
        levels.map(|(set, level)| self.far_tile(set, level, id, context, cancel)).collect()
    }

    /// Makes tile `id` for the output format number `set`, with that format's error and lattice of the level.
    fn far_tile(
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
            // Where the ground beyond the grid reaches the ellipsoid it has an edge, which needs vertices.
            self.overview
                .feet(&bounds, level.stride, &mut |foot| take(TerrainSampleRun::One(foot)));
        });
        let tile = builder.refine(|shell| self.measure(&bounds, level, shell, cancel))?;
        TileFile::new(set, &tile, self.opened, level, self.overview, context)
    }

    /// Adds the errors of all samples in `bounds` to `shell`: by block where the upper bound of a block is within the
    /// error of the level; one by one where it is not, and in blocks across the border of `bounds`.
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
            // Adjacent blocks of a row that have to be read, as one window.
            let mut unread: Option<Rect> = None;
            for col in cols[0]..cols[1] {
                let block = self.overview.block([col, row]);
                let corners = self.overview.corners([col, row]);
                // Distances of the samples from the plane, and of their positions from a flat surface.
                let deviations = [block.off(), self.overview.bow([col, row])];
                let is_done = block.count == 0
                    || match self.overview.lie([col, row], &corners, bounds) {
                        RectRelation::Beside => true,
                        RectRelation::Within => {
                            shell.add_block(&corners, deviations, block.count, level.assumed)
                        }
                        // Some samples may lie outside, so the block cannot count as a whole.
                        RectRelation::Across => false,
                    };
                if is_done {
                    self.measure_samples(unread.take(), bounds, level, shell, &mut heights)?;
                    continue;
                }
                let rect = self.overview.plan().rect([col, row]);
                unread = Some(match unread {
                    Some(before) => Rect { width: before.width + rect.width, ..before },
                    None => rect,
                });
            }
            self.measure_samples(unread, bounds, level, shell, &mut heights)?;
        }
        Ok(())
    }

    /// Reads the window `rect` of the grid, if any, and adds the errors of its samples in `bounds` to `shell`.
    /// `heights` is a buffer.
    fn measure_samples(
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
        // Pages of a mapped grid are released, so that memory does not grow with the grid.
        opened.grid.copied(rect);
        Ok(())
    }
}
