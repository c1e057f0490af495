//! Vertices moved before all else: those that are nearly one made one, then all of them rounded to the
//! decimals that are written. So what is judged is what is written.

use std::cmp::Ordering;
use std::path::Path;

use super::input::Input;
use super::kept::Cursors;
use crate::error::Result;
use crate::geom::plane::area_sign;
use crate::line::squares::{Place, Squares, cut};
use crate::line::{Xy, arcs};
use crate::pipeline::Cancel;
use crate::pipeline::points::Buckets;
use crate::vector::{Geometry, Part};

/// Where vertices go.
#[derive(Default)]
pub(super) struct Moves {
    pub(super) snapped: Option<Snapped>,
    pub(super) decimals: Option<u8>,
}

impl Moves {
    /// Begins with the first feature again.
    pub(super) fn restart(&mut self) {
        if let Some(snapped) = &mut self.snapped {
            snapped.cursors = Cursors::new(snapped.squares.count());
        }
    }

    /// Whether vertices stay where they are.
    pub(super) fn is_none(&self) -> bool {
        self.snapped.is_none() && self.decimals.is_none()
    }

    /// The next geometry with its vertices where they go; `None` where none is moved.
    pub(super) fn apply(&mut self, geometry: &Geometry) -> Result<Option<Geometry>> {
        if self.is_none() {
            return Ok(None);
        }
        let mut places = Vec::with_capacity(geometry.vertices());
        geometry.parts().for_each(|part| places.extend_from_slice(part.xy));
        if let Some(snapped) = &mut self.snapped {
            places.iter_mut().try_for_each(|at| snapped.next(at))?;
        }
        if let Some(decimals) = self.decimals {
            places.iter_mut().for_each(|at| *at = at.map(|c| rounded(c, decimals)));
        }
        let mut moved = geometry.clone();
        moved.place_parts(&mut places.into_iter());
        Ok(Some(moved))
    }

    /// Bytes in memory.
    pub(super) fn held(&self) -> u64 {
        self.snapped.as_ref().map_or(0, |snapped| snapped.places.held())
    }
}

/// The number nearest to `value` with so many digits behind the point; a number that has no digits there
/// as it is.
fn rounded(value: f64, decimals: u8) -> f64 {
    const EXACT: f64 = (1_u64 << 53) as f64;
    // Powers of ten up to 10^22 are exact, so the quotient is what a reader of the text gets.
    let power = 10_f64.powi(decimals.into());
    let whole = (value * power).round();
    if whole.abs() < EXACT { whole / power + 0.0 } else { value }
}

/// Positions after snapping: of each square in the order in which the input comes by them.
pub(super) struct Snapped {
    squares: Squares,
    places: Buckets<Xy>,
    cursors: Cursors<Xy>,
    place: Place,
}

impl Snapped {
    /// Snaps all vertices, square after square: what has stayed in one is not moved by those to come, so
    /// in all of them no two positions are left that are nearer than `distance`, and none has moved
    /// farther. In a square the rule is that of [`arcs::snap`].
    pub(super) fn new(
        input: &mut Input<'_>,
        squares: Squares,
        distance: f64,
        (folder, memory): (&Path, u64),
        cancel: &Cancel,
    ) -> Result<Self> {
        let count = squares.count();
        let old = sorted(input, &squares, Buckets::new(folder, count, memory / 8), cancel)?;
        let places = Buckets::new(folder, count, memory / 16);
        let stayed = Buckets::new(folder, count, memory / 16);
        let (mut before, mut near) = (Vec::new(), Vec::new());
        for square in 0..count {
            cancel.check()?;
            before.clear();
            old.read(square, |run| before.extend_from_slice(run))?;
            old.forget(square);
            let mut anchors: Vec<Xy> = Vec::new();
            stayed.read(square, |run| anchors.extend_from_slice(run))?;
            stayed.forget(square);
            let mut after = before.clone();
            arcs::snap(&mut after, &anchors, distance)?;
            places.push(square, &after)?;
            for (p, _) in before.iter().zip(&after).filter(|(p, q)| p == q) {
                if squares.count() > 1 {
                    squares.around(*p, distance, &mut near);
                }
                let mut later = near.iter().filter(|other| **other as usize > square);
                later.try_for_each(|other| stayed.push(*other as usize, &[*p]))?;
            }
        }
        Ok(Self { cursors: Cursors::new(count), squares, places, place: Place::default() })
    }

    /// Moves the next vertex.
    fn next(&mut self, at: &mut Xy) -> Result<()> {
        let square = self.squares.of(*at, &mut self.place).unwrap_or_default();
        if let Some(place) = self.cursors.next(&self.places, square as usize)? {
            *at = place;
        }
        Ok(())
    }
}

/// All vertices by square.
fn sorted(
    input: &mut Input<'_>,
    squares: &Squares,
    buckets: Buckets<Xy>,
    cancel: &Cancel,
) -> Result<Buckets<Xy>> {
    let (mut place, mut runs) = (Place::default(), Vec::new());
    input.visit_all(cancel, |feature| {
        feature.geometry.parts().try_for_each(|part| {
            cut(part.xy, false, squares, &mut place, &mut runs);
            let push = |run: &crate::line::squares::Run| {
                buckets.push(run.square as usize, &part.xy[run.first..run.first + run.count])
            };
            runs.iter().try_for_each(push)
        })
    })?;
    Ok(buckets)
}

/// What moving vertices has done to rings.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Harm {
    /// Rings that have turned over, or lost their area.
    pub(super) rings: u64,
    /// Features whose rings touch themselves or each other where they did not.
    pub(super) touching: u64,
}

impl Harm {
    /// Adds what has happened to a geometry.
    pub(super) fn add(&mut self, before: &Geometry, after: &Geometry) {
        let pairs = before.parts().zip(after.parts()).filter(|(part, _)| part.is_ring());
        let sign = |part: &Part<'_>| area_sign(part.xy.iter().copied());
        let is_lost = |(old, new): &(Part<'_>, Part<'_>)| {
            let then = sign(old);
            then != Ordering::Equal && then != sign(new)
        };
        self.rings += pairs.filter(is_lost).count() as u64;
        self.touching += u64::from(touches(after) > touches(before));
    }
}

/// How many positions of rings are those of other vertices, too.
fn touches(geometry: &Geometry) -> usize {
    let mut all: Vec<[u64; 2]> = Vec::new();
    for part in geometry.parts().filter(Part::is_ring) {
        let first = all.len();
        let open = &part.xy[..part.xy.len().saturating_sub(1)];
        all.extend(open.iter().map(|at| at.map(|c| (c + 0.0).to_bits())));
        let mut own = all.split_off(first);
        own.dedup();
        while own.len() > 1 && own.first() == own.last() {
            own.pop();
        }
        all.append(&mut own);
    }
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    count - all.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_rounded_number_is_what_its_text_says(value in -1e9..1e9, decimals in 0_u8..=17) {
            let moved = rounded(value, decimals);
            let text = format!("{moved:.*}", usize::from(decimals));
            prop_assert_eq!(text.parse::<f64>().unwrap(), moved);
            prop_assert!((moved - value).abs() <= 0.500_001 * 0.1_f64.powi(decimals.into()) + 3e-7);
        }
    }

    #[test]
    fn nothing_is_minus_zero() {
        assert!(rounded(-0.2, 0).is_sign_positive());
        assert_eq!(rounded(1e300, 17), 1e300);
    }
}
