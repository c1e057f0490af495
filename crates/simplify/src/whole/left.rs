//! What is left of features, put together again from the bits of their squares as they are read once more.

use std::collections::BTreeSet;

use super::kept::{Kept, Reader};
use super::own;
use super::trial::Leaves;
use crate::part::chosen;
use terrane_base::error::Result;
use terrane_base::geom::plane::key;
use terrane_line::Xy;
use terrane_line::squares::{Place, Run, Squares, cut};
use terrane_line::topology::Collapse;
use terrane_vector::{self as vector, Feature, Part, Role};

/// Numbers of parts.
pub(super) type Parts = BTreeSet<u64>;

/// What is known when all squares are done: twice, if rings have turned over.
#[derive(Clone, Copy)]
pub(super) struct Now<'a> {
    pub(super) squares: &'a Squares,
    /// Parts that stay whole.
    pub(super) whole: &'a Parts,
    /// What is kept.
    pub(super) kept: &'a Kept,
    /// What is rounded of it, where anything is to be.
    pub(super) rounded: Option<&'a Kept>,
}

/// Parts cut into runs, one after the other.
pub(super) struct Cutting<'a> {
    squares: &'a Squares,
    place: Place,
    pub(super) runs: Vec<Run>,
    /// Parts so far.
    pub(super) number: u64,
}

impl<'a> Cutting<'a> {
    pub(super) fn new(squares: &'a Squares) -> Self {
        Self { squares, place: Place::default(), runs: Vec::new(), number: 0 }
    }

    /// Fills the runs with those of the next part; returns its number.
    pub(super) fn cut(&mut self, part: &Part<'_>) -> u64 {
        cut(part.xy, part.is_ring(), self.squares, &mut self.place, &mut self.runs);
        self.number += 1;
        self.number - 1
    }
}

/// What is left of features, one after the other.
pub(super) struct Left<'a> {
    pub(super) parts: Cutting<'a>,
    whole: &'a Parts,
    kept: Reader<'a>,
    rounded: Option<(Reader<'a>, u8)>,
    collapse: Collapse,
    indices: Vec<u32>,
    /// The last outer ring, if nothing is kept of it.
    gone: Option<u64>,
    /// Parts that have to stay whole, and do not.
    pub(super) turned: Parts,
    pub(super) features: u64,
    pub(super) vertices: u64,
}

impl<'a> Left<'a> {
    pub(super) fn new(now: Now<'a>, collapse: Collapse, decimals: Option<u8>) -> Self {
        Self {
            parts: Cutting::new(now.squares),
            whole: now.whole,
            kept: now.kept.reader(),
            rounded: now.rounded.map(Kept::reader).zip(decimals),
            collapse,
            indices: Vec::new(),
            gone: None,
            turned: Parts::new(),
            features: 0,
            vertices: 0,
        }
    }

    fn part(&mut self, part: &Part<'_>) -> Result<vector::Kept> {
        let number = self.parts.cut(part);
        let is_cut = self.parts.runs.len() > 1;
        let count = part.xy.len() - usize::from(is_cut && part.is_ring());
        self.kept.part(&self.parts.runs, count, &mut self.indices)?;
        let is_whole = self.whole.contains(&number);
        let kept = match part.is_ring() {
            true if is_whole || self.indices.len() == part.xy.len() => Some(vector::Kept::All),
            true if is_cut => own::ring(part.xy, &self.indices, self.collapse),
            _ => Some(chosen(&self.indices)),
        };
        if kept.is_none() {
            self.turned.insert(number);
        }
        let kept = kept.unwrap_or(vector::Kept::All);
        self.note_outer(part.role, number, kept == vector::Kept::Nothing);
        Ok(kept)
    }

    /// Appends the positions of the part that was cut last that are rounded: all vertices at one are.
    fn rounded(&mut self, part: &Part<'_>, positions: &mut Vec<[u64; 2]>) -> Result<()> {
        let Some((rounded, _)) = &mut self.rounded else { return Ok(()) };
        let count = part.xy.len() - usize::from(self.parts.runs.len() > 1 && part.is_ring());
        rounded.part(&self.parts.runs, count, &mut self.indices)?;
        positions.extend(self.indices.iter().map(|at| key(part.xy[*at as usize])));
        Ok(())
    }

    /// A polygon without its outer ring is nothing: that ring stays whole where a hole does not go, as one
    /// that lies outside of it may not.
    fn note_outer(&mut self, role: Role, number: u64, is_gone: bool) {
        match (role, self.gone) {
            (Role::Hole, Some(outer)) if !is_gone => {
                self.turned.insert(outer);
            }
            (Role::Hole, _) => {}
            _ => self.gone = is_gone.then_some(number),
        }
    }
}

impl Leaves for Left<'_> {
    fn of(&mut self, feature: &Feature) -> Result<vector::Geometry> {
        let (mut choices, mut rounded) = (Vec::new(), Vec::new());
        for part in feature.geometry.parts() {
            choices.push(self.part(&part)?);
            self.rounded(&part, &mut rounded)?;
        }
        let mut choices = choices.into_iter();
        let keep = |_, _: Part<'_>| choices.next().unwrap_or(vector::Kept::All);
        let mut geometry = feature.geometry.keep(keep);
        if let Some((_, decimals)) = self.rounded {
            rounded.sort_unstable();
            let place = |at: &Xy| match rounded.binary_search(&key(*at)) {
                Ok(_) => at.map(|c| vector::rounded(c, decimals)),
                Err(_) => *at,
            };
            let places: Vec<Xy> = geometry.parts().flat_map(|part| part.xy).map(place).collect();
            geometry.place_parts(&mut places.into_iter());
        }
        self.features += 1;
        self.vertices += geometry.parts().map(|part| part.xy.len() as u64).sum::<u64>();
        Ok(geometry)
    }

    fn may_appear(&self) -> bool {
        self.turned.is_empty()
    }
}
