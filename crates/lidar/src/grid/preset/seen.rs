//! What a model of a part of a cloud has to know of all of it: which points are ground, how far apart points
//! are, and what surrounds them.

use serde::{Deserialize, Serialize};

use super::filter::spacing;
use super::metres::Metres;
use super::squares::{Squares, Tally};
use super::{
    GroundFrom, Making, Preset, found_in_classes, frozen, named, needs_ground, no_ground, no_noise,
    not_of_class,
};
use crate::points::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::{Point, REACH};
use terrane_cloud::{CloudInfo, Return};
use terrane_delaunay::Hull;
use terrane_gridding::canopy::Way;
use terrane_gridding::pitfree::PitFree;

/// What was seen of a cloud.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Seen {
    /// True where the ground is that of its classes.
    pub(crate) by_class: bool,
    /// Metres between last returns, where a method finds the ground.
    pub(crate) last: f64,
    /// True where it looks among all returns, as their numbers tell nothing.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) all_returns: bool,
    /// Metres between first returns, for the surface.
    pub(crate) first: f64,
    /// Steps along the longest edge in a crown, or to the end of what a square of the surface sees.
    pub(crate) reach: i32,
    /// Most points that a square of the surface sees.
    #[serde(default, skip_serializing_if = "is_none")]
    pub(crate) square: u64,
    /// What surrounds the ground of the classes.
    ground: Vec<[i32; 3]>,
    /// What surrounds the returns of the surface.
    surface: Vec<[i32; 3]>,
    /// Which points a model is made of, one line each.
    pub(crate) notes: Vec<String>,
}

impl Seen {
    /// Looks at all points that a model is made of, once.
    ///
    /// # Errors
    /// No ground where there has to be some; units that are no lengths.
    pub(in crate::grid) fn look(
        preset: Preset,
        cloud: &CloudInfo,
        making: &Making<'_>,
    ) -> Result<Self> {
        let mut seen = Self::default();
        if needs_ground(preset, making.job) {
            seen.look_for_ground(preset, cloud, making)?;
        }
        if preset != Preset::Dtm {
            seen.look_at_surface(cloud, making)?;
        }
        Ok(seen)
    }

    fn look_for_ground(
        &mut self,
        preset: Preset,
        cloud: &CloudInfo,
        making: &Making<'_>,
    ) -> Result<()> {
        self.look_for_classes(making)?;
        if self.by_class {
            return Ok(());
        }
        let mut last = making.outlined(no_noise(), Some(Return::Last), &|_| ())?;
        self.all_returns = making.all_returns(&last)?;
        if self.all_returns {
            last = making.outlined(no_noise(), None, &|_| ())?;
        }
        if last.count() == 0 && preset != Preset::Dsm {
            return Err(no_ground());
        }
        self.look_at_candidates(&[&last], cloud, making.job.ground)
    }

    fn look_at_surface(&mut self, cloud: &CloudInfo, making: &Making<'_>) -> Result<()> {
        let metres = Metres::of(&cloud.crs, &cloud.frame)?;
        let first = making.outlined(no_noise(), Some(Return::First), &|_| ())?;
        self.first = spacing(&[&first], &metres);
        let Way::SpikeFree { freeze, buffer } = making.job.canopy.way() else {
            self.reach = reach(self.first, &metres);
            self.surface = places(&first.hull()?);
            self.notes.push(format!("surface: {} first returns", first.count()));
            return Ok(());
        };
        let tally = Tally::new(Squares::new(self.first, (freeze, buffer), &metres));
        let all = making.outlined(no_noise(), None, &|batch| tally.take(batch))?;
        self.reach = tally.squares.reach();
        self.surface = places(&all.hull()?);
        self.notes.push(frozen(all.count(), &tally.squares));
        self.square = tally.counts().into_values().max().unwrap_or(0);
        Ok(())
    }

    fn look_for_classes(&mut self, making: &Making<'_>) -> Result<()> {
        if making.job.ground.is_method() {
            return Ok(());
        }
        let classes = making.classes();
        let ground = making.outlined(classes.clone(), None, &|_| ())?;
        if ground.count() == 0 && making.job.ground == GroundFrom::Class {
            return Err(not_of_class(&named(&classes)));
        }
        self.look_at_classes(&ground, &classes)
    }

    /// Of points of these classes, which are the ground if there are any.
    pub(crate) fn look_at_classes(&mut self, ground: &PointStore, classes: &[u8]) -> Result<()> {
        self.by_class = ground.count() > 0;
        self.ground = places(&ground.hull()?);
        self.notes.extend(self.by_class.then(|| found_in_classes(ground.count(), classes)));
        Ok(())
    }

    /// Of the points that a method finds the ground among.
    pub(crate) fn look_at_candidates(
        &mut self,
        candidates: &[&PointStore],
        cloud: &CloudInfo,
        ground: GroundFrom,
    ) -> Result<()> {
        self.last = spacing(candidates, &Metres::of(&cloud.crs, &cloud.frame)?);
        self.notes.push(format!("ground: found by {}", ground.method().name()));
        Ok(())
    }

    /// What surrounds the ground, where that is known.
    pub(crate) fn around_ground(&self) -> Vec<Point> {
        points(&self.ground)
    }

    /// What surrounds the returns of the surface.
    pub(super) fn around_surface(&self) -> Vec<Point> {
        points(&self.surface)
    }
}

impl Making<'_> {
    /// Whether the ground has to be looked for among all returns, as the numbers of returns do not tell which is the
    /// last: where some points are no last returns, and none is a second one. The last returns were read before.
    pub(super) fn all_returns(&self, last: &PointStore) -> Result<bool> {
        if let Some((_, seen)) = &self.part {
            return Ok(seen.all_returns);
        }
        if last.census().filtered == 0 {
            return Ok(false);
        }
        let second = self.source(no_noise(), Some(Return::Number(2)))?;
        for part in 0..second.parts() {
            if second.read(part, &mut |_| Ok(()))?.kept > 0 {
                return Ok(false);
            }
            self.cancel.check()?;
        }
        Ok(true)
    }
}

/// Steps along the longest edge that counts above the first triangulation, points being so far apart.
fn reach(spacing: f64, metres: &Metres) -> i32 {
    let [x, y, _] = metres.step;
    (PitFree::metres(spacing).max_edge() / x.min(y)).ceil().min(f64::from(REACH)) as i32
}

fn is_none(count: &u64) -> bool {
    *count == 0
}

fn places(hull: &Hull) -> Vec<[i32; 3]> {
    hull.sorted().iter().map(|p| [p.x, p.y, p.z]).collect()
}

fn points(places: &[[i32; 3]]) -> Vec<Point> {
    places.iter().map(|&[x, y, z]| Point { x, y, z }).collect()
}
