//! The landscape under a part of a flight: ground, zones, buildings, trees and voids.

use super::building::{self, Building};
use super::random::PulseRandom;
use super::spline::{GROUND, Spline, ZONES};
use super::survey::LidarSurvey;
use crate::hash::{RowHash, mix64};
use terrane_base::geom::Rect;

/// Values of the map above which there is forest, below which there is water, and between which there
/// are buildings; its values have a deviation of 0.28.
const FOREST: f64 = 0.17;
const WATER: f64 = -0.6;
const TOWN: std::ops::Range<f64> = -0.32..-0.04;

/// Side of a tree's cell, in metres.
const TREE: f64 = 6.0;

/// The landscape within a rectangle.
pub(super) struct LandscapeWindow {
    /// Steps of coordinates by metre.
    pub(super) by_metre: f64,
    /// Steps from west to east.
    pub(super) columns: i32,
    /// Deviation of the ranging in metres.
    pub(super) noise: f64,
    ground: Spline,
    cover: Option<LandCover>,
    voids: Vec<[f64; 3]>,
}

struct LandCover {
    zones: Spline,
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
        let touches = |[x, y, r]: &[f64; 3]| {
            x + r >= area[0] && x - r <= area[2] && y + r >= area[1] && y - r <= area[3]
        };
        let voids = survey.void_places().filter(touches).collect();
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
        let inside = |[cx, cy, r]: &[f64; 3]| {
            let (dx, dy) = (x - cx, y - cy);
            dx * dx + dy * dy < r * r
        };
        if self.voids.iter().any(inside) {
            return None;
        }
        self.cover.as_ref().map_or(Some(PulseTarget::Bare), |cover| cover.at(x, y))
    }
}

impl LandCover {
    fn new(survey: &LidarSurvey, wide: [f64; 4], ground: &Spline) -> Self {
        let zones = zones(survey, wide);
        let is_town = |x: f64, y: f64| TOWN.contains(&zones.at(x, y));
        let town = building::Town::new(survey.key(4), wide, is_town, ground);
        Self { town, zones, trees: survey.key(5) }
    }

    #[inline(always)]
    fn at(&self, x: f64, y: f64) -> Option<PulseTarget<'_>> {
        let zone = self.zones.at(x, y);
        if zone < WATER {
            return None;
        }
        if let Some(building) = self.town.at(x, y) {
            return Some(PulseTarget::Roof(building));
        }
        if zone <= FOREST {
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

/// The map of land cover.
fn zones(survey: &LidarSurvey, area: [f64; 4]) -> Spline {
    let key = survey.key(2);
    Spline::new(ZONES, area, |[col, row, width, _], nodes| {
        for (line, row) in nodes.chunks_exact_mut(width as usize).zip(row..) {
            let hash = RowHash::new(key, row);
            for (node, col) in line.iter_mut().zip(col..) {
                *node = (hash.at(col) as i32 >> 8) as f32 * (1.0 / 8_388_608.0);
            }
        }
    })
}

/// Centre and radius of the void of this number: on a corner of tiles, on a line between columns of
/// tiles, on a line between rows, in turn, as far as there are such.
fn void(survey: &LidarSurvey, number: u32) -> [f64; 3] {
    let [across, along, size, _] = PulseRandom(mix64(survey.key(3) ^ u64::from(number))).four();
    let line = |share: f64, length: f64| {
        let lines = (length / survey.tile).ceil() - 1.0;
        (lines >= 1.0).then(|| survey.tile * (1.0 + (share * lines).floor()))
    };
    let (mut x, mut y) = (line(across, survey.width), line(along, survey.height));
    match number % 3 {
        1 if x.is_some() => y = None,
        2 if y.is_some() => x = None,
        _ => {}
    }
    let x = x.unwrap_or(across * survey.width);
    [x, y.unwrap_or(along * survey.height), 7.5 + 22.5 * size]
}
