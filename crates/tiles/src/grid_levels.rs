//! A grid after the first pass, and the levels of its tiles.

use super::format::TilesFormat;
use super::input::OpenedTilesGrid;
use super::job::TilesJob;
use terrane_globe::{GlobeTileId, GridOverview, LevelRelief, TileLevel, in_shorts};
use terrane_raster::{self as raster, looks_like_nodata};

/// Results of the first pass.
pub(super) struct ScannedGrid<'a> {
    pub(super) opened: &'a OpenedTilesGrid,
    pub(super) overview: &'a GridOverview,
    /// By set, from level 0.
    pub(super) levels: Vec<Vec<TileLevel>>,
}

impl<'a> ScannedGrid<'a> {
    pub(super) fn new(opened: &'a OpenedTilesGrid, overview: &'a GridOverview) -> Self {
        let reliefs = overview.reliefs(opened.division.last);
        let formats = opened.job.tiles.format.iter();
        let levels = formats.map(|format| levels(*format, opened, overview.ends(), &reliefs));
        Self { opened, overview, levels: levels.collect() }
    }

    /// The level of a tile, by set.
    pub(super) fn of_level(&self, id: GlobeTileId) -> impl Iterator<Item = &TileLevel> {
        self.levels.iter().map(move |levels| &levels[usize::from(id.level)])
    }

    /// The lowest stored height, if it looks like a nodata value.
    fn suspect(&self) -> Option<f64> {
        let lowest = self.overview.range[0] / self.opened.heights.lift.metres;
        looks_like_nodata(lowest, self.opened.grid.info())
    }

    /// Notes about the heights.
    pub(super) fn notes(&self) -> Vec<String> {
        let of_nodata = self.suspect().map(|stored| {
            format!("the lowest height, {stored:e}, looks like an undeclared nodata value")
        });
        let info = self.opened.grid.info();
        let metres = self.opened.heights.lift.metres;
        let [a, b] = self.overview.range.map(|height| height / metres);
        let odd = raster::no_terrain(info, [a.min(b), a.max(b)]).filter(|_| of_nodata.is_none());
        let of_grid = raster::cautions(info).into_iter().chain(odd);
        self.opened.heights.notes.iter().cloned().chain(of_nodata).chain(of_grid).collect()
    }
}

/// Levels of a set for heights in a range.
fn levels(
    format: TilesFormat,
    opened: &OpenedTilesGrid,
    range: [f64; 2],
    reliefs: &[LevelRelief],
) -> Vec<TileLevel> {
    let OpenedTilesGrid { job: TilesJob { tiles, .. }, division, .. } = opened;
    let mut levels: Vec<TileLevel> = Vec::with_capacity(reliefs.len());
    for (number, relief) in (0..).zip(reliefs) {
        let level = TileLevel::new(number, division.place.spacing, relief);
        levels.push(match format {
            TilesFormat::QuantizedMesh => level,
            TilesFormat::ThreeTiles => {
                let level = if tiles.skirts { level.with_skirts(levels.last()) } else { level };
                let level = level.on_lattice(range);
                if tiles.meshopt { in_shorts(level) } else { level }
            }
        });
    }
    levels
}
