//! The landscape under a part of a flight: ground, land cover, buildings, trees and voids.

use super::building::{self, Building};
use super::random::PulseRandom;
use super::spline::{COVER, GROUND, Spline};
use super::survey::LidarSurvey;
use crate::hash::{RowHash, mix64};
use terrane_base::geom::Rect;

/// Values of the map of land cover above which there is forest, below which there is water, and between which
/// there are buildings; its values have a standard deviation of 0.28.
const FOREST: f64 = 0.17;
const WATER: f64 = -0.6;
const TOWN: std::ops::Range<f64> = -0.32..-0.04;

/// Side of a tree's cell, in metres.
const TREE: f64 = 6.0;

/// The landscape within a rectangle.
pub(super) struct LandscapeWindow {
    /// Coordinate steps per metre.
    pub(super) by_metre: f64,
    /// Steps from west to east.
    pub(super) columns: i32,
    /// Standard deviation of the range noise in metres.
    pub(super) noise: f64,
    ground: Spline,
    cover: Option<LandCover>,
    voids: Vec<[f64; 3]>,
}

struct LandCover {
    map: Spline,
    town: building::Town,
    trees: u64,
}

/// The object above the ground that a pulse hits.
pub(super) enum PulseTarget<'a> {
    Bare,
    Roof(&'a Building),
    /// In a crown of this height above the ground.
    Crown(f64),
    /// In a forest, between crowns.
    Undergrowth,
}

impl LandscapeWindow {
    /// The landscape over [x min, y min, x max, y max].
    pub(super) fn new(survey: &LidarSurvey, area: [f64; 4]) -> Self {
        let wide = building::whole_lots(area);
        let ground = ground(survey, wide);
        let cover = survey.cover.then(|| LandCover::new(survey, wide, &ground));
        let voids = survey.void_places().filter(|[x, y, r]| {
            x + r >= area[0] && x - r <= area[2] && y + r >= area[1] && y - r <= area[3]
        });
        let voids = voids.collect();
        let by_metre = 1.0 / survey.scale;
        Self { by_metre, columns: survey.steps()[0], noise: survey.noise, ground, cover, voids }
    }

    /// Height of the ground.
    #[inline(always)]
    pub(super) fn ground(&self, x: f64, y: f64) -> f64 {
        self.ground.at(x, y)
    }

    /// The object at a position; `None` if there is no return.
    #[inline(always)]
    pub(super) fn at(&self, x: f64, y: f64) -> Option<PulseTarget<'_>> {
        let is_void = self.voids.iter().any(|[cx, cy, r]| {
            let (dx, dy) = (x - cx, y - cy);
            dx * dx + dy * dy < r * r
        });
        if is_void {
            return None;
        }
        self.cover.as_ref().map_or(Some(PulseTarget::Bare), |cover| cover.at(x, y))
    }
}

impl LandCover {
    fn new(survey: &LidarSurvey, wide: [f64; 4], ground: &Spline) -> Self {
        let map = cover_map(survey, wide);
        let key = survey.key(4);
        let town = building::Town::new(key, wide, |x, y| TOWN.contains(&map.at(x, y)), ground);
        Self { town, map, trees: survey.key(5) }
    }

    #[inline(always)]
    fn at(&self, x: f64, y: f64) -> Option<PulseTarget<'_>> {
        let cover = self.map.at(x, y);
        if cover < WATER {
            return None;
        }
        if let Some(building) = self.town.at(x, y) {
            return Some(PulseTarget::Roof(building));
        }
        if cover <= FOREST {
            return Some(PulseTarget::Bare);
        }
        Some(self.crown(x, y).map_or(PulseTarget::Undergrowth, PulseTarget::Crown))
    }

    /// Height of the crown above a position, if any: each tree has its own cell.
    #[inline(always)]
    fn crown(&self, x: f64, y: f64) -> Option<f64> {
        let (col, row) = ((x * (1.0 / TREE)) as u64, (y * (1.0 / TREE)) as u64);
        let [size, tall, right, up] = PulseRandom(self.trees ^ (col << 32 | row)).four();
        let radius = 1.8 + 1.2 * size;
        let free = 0.5 * TREE - radius;
        let dx = x - (col as f64 + 0.5) * TREE - free * (2.0 * right - 1.0);
        let dy = y - (row as f64 + 0.5) * TREE - free * (2.0 * up - 1.0);
        let out = (dx * dx + dy * dy) / (radius * radius);
        let height = 5.0 + 18.0 * tall * (0.5 + 0.5 * size);
        (out < 1.0).then_some(height * (1.0 - 0.5 * out))
    }
}

impl LidarSurvey {
    /// Centres and radii of the voids, as [x, y, radius].
    pub fn void_places(&self) -> impl Iterator<Item = [f64; 3]> + use<'_> {
        (0..self.voids).map(|k| void(self, k))
    }
}

/// The ground over a rectangle.
pub(super) fn ground(survey: &LidarSurvey, area: [f64; 4]) -> Spline {
    let terrain = survey.terrain();
    Spline::new(GROUND, area, |[col, row, width, height], nodes| {
        terrain.fill_f32(Rect::new(col, row, width, height), nodes);
    })
}

/// The map of land cover: smooth random values, which thresholds divide.
fn cover_map(survey: &LidarSurvey, area: [f64; 4]) -> Spline {
    let key = survey.key(2);
    Spline::new(COVER, area, |[col, row, width, _], nodes| {
        for (line, row) in nodes.chunks_exact_mut(width as usize).zip(row..) {
            let hash = RowHash::new(key, row);
            for (node, col) in line.iter_mut().zip(col..) {
                *node = (hash.at(col) as i32 >> 8) as f32 * (1.0 / 8_388_608.0);
            }
        }
    })
}

/// Centre and radius of a void by its number: in turn on a corner of tiles, on a line between columns of
/// tiles, and on a line between rows, if there are such.
fn void(survey: &LidarSurvey, number: u32) -> [f64; 3] {
    let [across, along, size, _] = PulseRandom(mix64(survey.key(3) ^ u64::from(number))).four();
    let mut x = tile_line(across, survey.width, survey.tile);
    let mut y = tile_line(along, survey.height, survey.tile);
    match number % 3 {
        1 if x.is_some() => y = None,
        2 if y.is_some() => x = None,
        _ => {}
    }
    let x = x.unwrap_or(across * survey.width);
    [x, y.unwrap_or(along * survey.height), 7.5 + 22.5 * size]
}

/// A multiple of `tile` within a length, chosen by a share from 0 to 1, if there is one.
fn tile_line(share: f64, length: f64, tile: f64) -> Option<f64> {
    let lines = (length / tile).ceil() - 1.0;
    (lines >= 1.0).then(|| tile * (1.0 + (share * lines).floor()))
}
