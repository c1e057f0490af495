//! What a model of a part of a cloud has to know of all of it: which points are ground, how far apart points
//! are, and what surrounds them.

use serde::{Deserialize, Serialize};

use super::filter::spacing;
use super::metres::Metres;
use super::{
    GroundFrom, Making, Preset, found_in_classes, named, no_ground, no_noise, not_of_class,
};
use crate::points::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::{Point, REACH};
use terrane_cloud::{CloudInfo, Return};
use terrane_delaunay::Hull;
use terrane_gridding::pitfree::PitFree;

/// What was seen of a cloud.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Seen {
    /// True where the ground is that of its classes.
    pub(crate) by_class: bool,
    /// Metres between last returns, where a method finds the ground.
    pub(crate) last: f64,
    /// Metres between first returns, for the surface.
    pub(crate) first: f64,
    /// Steps along the longest edge in a crown.
    pub(crate) reach: i32,
    /// What surrounds the ground of the classes.
    ground: Vec<[i32; 3]>,
    /// What surrounds first returns.
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
        seen.look_for_classes(making)?;
        if !seen.by_class {
            let last = making.outlined(no_noise(), Some(Return::Last))?;
            if last.count() == 0 && preset != Preset::Dsm {
                return Err(no_ground());
            }
            seen.look_at_last(&last, cloud, making.job.ground)?;
        }
        if preset != Preset::Dtm {
            let metres = Metres::of(&cloud.crs, &cloud.frame)?;
            let first = making.outlined(no_noise(), Some(Return::First))?;
            seen.first = spacing(&first, &metres);
            seen.reach = reach(seen.first, &metres);
            seen.surface = places(&first.hull()?);
            seen.notes.push(format!("surface: {} first returns", first.count()));
        }
        Ok(seen)
    }

    fn look_for_classes(&mut self, making: &Making<'_>) -> Result<()> {
        if making.job.ground.is_method() {
            return Ok(());
        }
        let classes = making.classes();
        let ground = making.outlined(classes.clone(), None)?;
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

    /// Of last returns, where a method finds the ground among them.
    pub(crate) fn look_at_last(
        &mut self,
        last: &PointStore,
        cloud: &CloudInfo,
        ground: GroundFrom,
    ) -> Result<()> {
        self.last = spacing(last, &Metres::of(&cloud.crs, &cloud.frame)?);
        self.notes.push(format!("ground: found by {}", ground.method().name()));
        Ok(())
    }

    /// What surrounds the ground, where that is known.
    pub(crate) fn around_ground(&self) -> Vec<Point> {
        points(&self.ground)
    }

    /// What surrounds first returns.
    pub(super) fn around_surface(&self) -> Vec<Point> {
        points(&self.surface)
    }
}

/// Steps along the longest edge that counts above the first triangulation, points being so far apart.
fn reach(spacing: f64, metres: &Metres) -> i32 {
    let [x, y, _] = metres.step;
    (PitFree::metres(spacing).max_edge() / x.min(y)).ceil().min(f64::from(REACH)) as i32
}

fn places(hull: &Hull) -> Vec<[i32; 3]> {
    hull.sorted().iter().map(|p| [p.x, p.y, p.z]).collect()
}

fn points(places: &[[i32; 3]]) -> Vec<Point> {
    places.iter().map(|&[x, y, z]| Point { x, y, z }).collect()
}
